"""Machine code in memory and on disk: a second run only loads it."""

from __future__ import annotations

import ctypes
import hashlib
import os
import tempfile
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from ctypes.util import find_library
from functools import cache
from pathlib import Path
from threading import RLock
from typing import Any, NamedTuple

from llvmlite import binding as llvm
from platformdirs import user_cache_path

# How hard LLVM's code generation works: for a system's functions more than 1 takes longer, and
# straight code is no faster for it; for long assembly, 1 would take longer than most motions.
_SPEED, _SPEED_OF_LONG = 1, 0
_LONG = 400_000  # characters without tables
_DIGEST = 32  # bytes, before the machine code in a file
# What the engine may call of C's mathematical library.
MATHEMATICS: Sequence[str] = (
    "acos acosh asin asinh atan atan2 atanh cbrt ceil cos cosh erf exp exp2 expm1 floor fma fmod "
    "frexp hypot ilogb ldexp log log10 log1p log2 pow round sin sinh sqrt tan tanh trunc"
).split()
_LOCK = RLock()
_kept: dict[str, Any] = {}  # what has been loaded, as long as the process lives


class Processor(NamedTuple):
    """What machine code is for, and what makes it."""

    triple: str
    name: str
    features: str
    version: tuple[int, ...]


@cache
def processor() -> Processor:
    """That of this machine."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return Processor(
        llvm.get_process_triple(),
        llvm.get_host_cpu_name(),
        llvm.get_host_cpu_features().flatten(),
        tuple(llvm.llvm_version_info),
    )


def cache_folder() -> Path:
    """Folder of machine code: ``$STICKSLIP_CACHE``, else the user's cache folder, else a temporary
    one."""
    return _folder(os.environ.get("STICKSLIP_CACHE"))


@cache
def _folder(given: str | None) -> Path:
    folder = Path(given) / "stickslip" if given else user_cache_path("stickslip")
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            return folder
    return Path(tempfile.mkdtemp(prefix="stickslip-"))


def addresses(assembly: str, names: list[str], folder: Path) -> list[int]:
    """Addresses of functions: from this process, from disk, or new.

    Parameters
    ----------
    assembly : str
        LLVM assembly that defines the functions.
    names : list of str
        Theirs.
    folder : Path
        Where machine code is kept.
    """
    length = sum(len(line) for line in assembly.splitlines() if not line.startswith("@"))
    speed = _SPEED if length < _LONG else _SPEED_OF_LONG
    key = digest(assembly, processor(), speed)
    with _LOCK:
        if key not in _kept:
            path = folder / f"{names[0]}_{key}.o"
            code = code_of(path)
            if code is None:
                code = emitted(llvm.parse_assembly(assembly), processor(), speed)
                keep_code(path, code)
            declared = [line for line in assembly.splitlines() if line.startswith("declare")]
            find_functions([line[line.index("@") + 1 : line.index("(")] for line in declared])
            _kept[key] = loaded(code)
        return [_kept[key].get_function_address(name) for name in names]


def digest(*facts: Any) -> str:
    """A name for what is made of these facts."""
    return hashlib.sha256(repr(facts).encode()).hexdigest()[:24]


def emitted(module: Any, here: Processor, speed: int) -> bytes:
    """Machine code of a module for a processor."""
    return machine(here, speed).emit_object(module)


def machine(here: Processor, speed: int = _SPEED) -> Any:
    """LLVM's description of a processor."""
    return llvm.Target.from_triple(here.triple).create_target_machine(
        cpu=here.name, features=here.features, opt=speed, jit=True
    )


def loaded(code: bytes) -> Any:
    """Machine code in memory; what its functions call is where it can be found (see
    :func:`find_functions`)."""
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine(processor()))
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return engine


def code_of(path: Path) -> bytes | None:
    """Machine code of a file; None if there is none, or it is damaged."""
    with suppress(OSError):
        found = path.read_bytes()
        digest, code = found[:_DIGEST], found[_DIGEST:]
        if hashlib.sha256(code).digest() == digest:
            return code
    return None


def keep_code(path: Path, code: bytes) -> None:
    """Keep machine code, whole or not at all."""
    partial = path.with_suffix(f".{os.getpid()}.tmp")
    with suppress(OSError):
        partial.write_bytes(hashlib.sha256(code).digest() + code)
        partial.replace(path)


def find_functions(names: Sequence[str]) -> None:
    """Tell LLVM where functions of C's mathematical library and of Python are that it does not find
    itself."""
    for name in names:
        if not name.startswith("llvm.") and llvm.address_of_symbol(name) is None:
            with suppress(AttributeError):  # LLVM says what is missing, if it is called at all
                llvm.add_symbol(name, address_of(name))


def address_of(name: str) -> int:
    """Where a function of C's mathematical library or of Python stands.

    Raises
    ------
    AttributeError
        If there is none of that name.
    """
    known = llvm.address_of_symbol(name)
    if known is not None:
        return int(known)
    if name in _provided:
        return _made(_provided[name]).get_function_address(name)
    library = ctypes.pythonapi if name.startswith("Py") else _mathematics()
    found = ctypes.cast(getattr(library, name), ctypes.c_void_p).value
    assert found is not None
    return found


def provide(names: Iterable[str], make: Callable[[], Any]) -> None:
    """Let functions be found whose machine code `make` brings into memory, when one of them is
    called for the first time."""
    _provided.update(dict.fromkeys(names, make))


_provided: dict[str, Callable[[], Any]] = {}


@cache
def _made(make: Callable[[], Any]) -> Any:
    return make()


@cache
def _mathematics() -> ctypes.CDLL:
    """The mathematical library of C."""
    return ctypes.CDLL(find_library("m") or find_library("ucrtbase") or None)
