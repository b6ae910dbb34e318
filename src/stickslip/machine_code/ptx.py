"""PTX, NVIDIA's assembly for GPUs: code for the threads, with the functions of a system and
NVIDIA's mathematical library inside."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from llvmlite import binding as llvm

from stickslip.errors import DeclarationError
from stickslip.machine_code.functions import Entry, Kernel
from stickslip.machine_code.interface import INTERFACE
from stickslip.machine_code.objects import (
    LOOPS,
    MATHEMATICS,
    STRAIGHT,
    Processor,
    digest,
    machine,
    module_of,
    optimise,
)
from stickslip.machine_code.shelf import (
    ENGINE,
    Library,
    entries_of,
    listeners,
    source_digest,
)
from stickslip.machine_code.store import cache_folder, keep, stored

# The oldest GPUs with independent thread scheduling (since 2017); all later ones accept the same
# code.
_OLDEST, _FEATURES = "sm_70", "+ptx60"
CAPABILITY = 7, 0
"""What a GPU has to be capable of, as NVIDIA counts it."""
_FILE = Path("nvvm", "libdevice", "libdevice.10.bc")
# Functions that LLVM provides for a processor, but not for a GPU.
_MISSING = "cos exp exp2 log log10 log2 pow sin tan".split()
_NAMES = re.compile(rf"@(?:({'|'.join(MATHEMATICS)})|llvm\.({'|'.join(_MISSING)})\.f64)\(")
# Code is kept short: threads of a GPU wait for memory, not for jumps, and its assembler is slow.
# LLVM uses eleven times this number for a GPU.
_INLINED = 20


def ptx_of(entries: Sequence[Entry], system: str) -> bytes:
    """Entries for a system, from disk or new.

    Parameters
    ----------
    entries : sequence of Entry
        What threads run; each gets its number as the last argument.
    system : str
        LLVM assembly of the functions of the system.

    Raises
    ------
    DeclarationError
        If NVIDIA's mathematical library is not found, or the system calls what has no form for a
        GPU.
    """
    mathematics = find_mathematics().read_bytes()
    modules = {__name__, *(x.__module__ for x in (*entries, *_kernels_in(system)))}
    sources = source_digest(Library("gpu", tuple(sorted(modules))))
    names = [entry.__name__ for entry in entries]
    key = digest(sources, names, system, sha256(mathematics).hexdigest(), _target())
    path = cache_folder() / f"gpu.{key[:24]}.ptx"
    made = stored(path, key)
    if made is None:
        for tell in listeners:
            tell()
        made = _made(entries, system, mathematics)
        keep(path, key, made)
    return made


def find_mathematics() -> Path:
    """NVIDIA's mathematical library, as LLVM's bitcode.

    Raises
    ------
    DeclarationError
        If it is not found.
    """
    for folder in _folders():
        if (folder / _FILE).is_file():
            return folder / _FILE
    reason = "libdevice, NVIDIA's mathematical library, was not found"
    raise DeclarationError("device", reason, "Install stickslip[gpu], or set CUDA_HOME")


def _folders() -> Iterator[Path]:
    """Possible folders of NVIDIA's compiler: a Python package, or an installation."""
    if find_spec("nvidia") is not None and (package := find_spec("nvidia.cuda_nvcc")) is not None:
        yield from map(Path, package.submodule_search_locations or ())
    yield from (Path(os.environ[name]) for name in ("CUDA_HOME", "CUDA_PATH") if name in os.environ)
    yield Path("/usr/local/cuda")


@cache
def _target() -> Processor:
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    version = tuple(llvm.llvm_version_info)
    return Processor("nvptx64-nvidia-cuda", _OLDEST, _FEATURES, version)


def _kernels_in(system: str) -> list[Kernel]:
    """Functions of the engine that a system calls."""
    return [x for x in entries_of(ENGINE) if isinstance(x, Kernel) and x.symbol in system]


def _made(entries: Sequence[Entry], system: str, mathematics: bytes) -> bytes:
    from stickslip.translator.modules import Program

    direct = {kind: name for name, kind in INTERFACE.items()}
    program = Program((), _kernels_in(system), threads=entries, direct=direct)
    module = _module(program.whole())
    of_system = _module(system)
    called = [part.name for part in of_system.functions if part.is_declaration]
    module.link_in(of_system)
    module.link_in(_mathematics(mathematics))
    missing = [
        name
        for name in called
        if not name.startswith("llvm.") and module.get_function(name).is_declaration
    ]
    if missing:
        reason = f"a table of samples ({', '.join(missing)}) cannot be called on a GPU"
        raise DeclarationError("device", reason, 'Use device="cpu"')
    names = {entry.__name__ for entry in entries}
    # LLVM converts internal names to names that PTX accepts.
    for part in (*module.functions, *module.global_variables):
        if not part.is_declaration and part.name not in names:
            part.linkage = "internal"
    module.verify()
    target = machine(_target(), LOOPS)
    optimise(module, target, loops=False, inlined=_INLINED)
    return target.emit_assembly(module).encode()


def _module(assembly: str) -> Any:
    """A module whose mathematical functions are NVIDIA's."""
    lines = _NAMES.sub(lambda name: f"@__nv_{name[1] or name[2]}(", assembly).splitlines()
    # functions with different names in LLVM and C have the same name here
    declared = {x.partition("(")[0]: x for x in lines if x.startswith("declare ")}
    rest = [x for x in lines if not x.startswith("declare ")]
    return module_of("\n".join([*declared.values(), *rest]), _target(), STRAIGHT)


def _mathematics(bitcode: bytes) -> Any:
    """NVIDIA's library; only short functions of it are inlined."""
    text = str(llvm.parse_bitcode(bitcode)).replace("alwaysinline", "")
    return module_of(text, _target(), STRAIGHT)
