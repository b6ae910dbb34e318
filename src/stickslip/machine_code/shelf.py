"""Where an entry's machine code comes from: shipped with the package, kept from an earlier run, or
made now by numba.

What is shipped is named by the sources it was made from, the processors it is for, and the version
of LLVM: LLVM's bitcode, and machine code for the platform on which the package was built. All
processors of a level run the same code and have the same bits.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from filelock import FileLock
from llvmlite import binding as llvm

from stickslip.machine_code.kinds import PLAIN, ArgumentKind, argument_kind
from stickslip.machine_code.objects import (
    MATHEMATICS,
    Processor,
    cache_folder,
    code_of,
    digest,
    emitted,
    find_functions,
    keep_code,
    loaded,
    machine,
    processor,
)
from stickslip.machine_code.stamps import stamp
from stickslip.machine_code.tables import Prepared

if TYPE_CHECKING:
    from stickslip.machine_code.functions import Entry

SHIPPED = Path(__file__).parent / "shipped"
# Levels of processors that the engine is built for: 64-bit x86 with fused multiplication and
# vectors of four numbers (Intel since 2013, AMD since 2015), and all others.
FAST, PORTABLE = "x86-64-v3", "portable"
FEATURES = ("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave")
_SPEED = 2  # how hard LLVM's code generation works on the engine's loops


@cache
def level() -> str:
    """The level of this machine's processor."""
    known = llvm.get_host_cpu_features()
    is_x86 = processor().triple.startswith("x86_64")
    return FAST if is_x86 and all(known.get(name, False) for name in FEATURES) else PORTABLE


def target_of(level: str) -> Processor:
    """What machine code of a level is made for on this machine."""
    here = processor()
    is_x86 = here.triple.startswith("x86_64")
    return here._replace(name=FAST if level == FAST else "x86-64" if is_x86 else "", features="")


def name_of(function: Entry, kind: ArgumentKind) -> str:
    """The name of an entry's machine code: for these sources, this kind of arguments."""
    sources = stamp(function.py_func.__code__.co_filename)
    return f"{function.py_func.__name__}_{digest(function.__module__, kind, sources)}"


def prepare(function: Entry, arguments: tuple[Any, ...]) -> Prepared:
    """An entry in memory, for arguments of this kind."""
    kind = (PLAIN, *map(argument_kind, arguments))
    name = name_of(function, kind)
    code = _shipped(name) if _filling is None else _for_shipment(function, kind, name, _filling)
    find_functions(MATHEMATICS)
    engine = loaded(code or _own(function, kind, name))
    _kept.append(engine)
    return Prepared(kind, engine.get_function_address(name), function.result)


_kept: list[Any] = []  # machine code in memory, as long as the process lives
_filling: Path | None = None


@contextmanager
def filled(folder: Path) -> Iterator[None]:
    """Put the machine code of all entries that are called into a folder, for the processors that
    numba compiles for."""
    global _filling
    _filling = folder
    try:
        yield
    finally:
        _filling = None


def _for_shipment(function: Entry, kind: ArgumentKind, name: str, folder: Path) -> bytes:
    """An entry's machine code in a folder, made if it is not there."""
    here = target_of(folder.name)
    machine_code, bitcode = object_file(folder, name, here), bitcode_file(folder, name)
    with FileLock(folder / f"{name}.lock"):
        code = code_of(machine_code)
        if code is None or code_of(bitcode) is None:
            text = made(function, kind, name)
            code = from_bitcode(text, here)
            keep_code(bitcode, text)
            keep_code(machine_code, code)
    return code


def object_file(folder: Path, name: str, here: Processor) -> Path:
    """File of an entry's machine code for a processor."""
    return folder / f"{name}.{digest(here)}.o"


def bitcode_file(folder: Path, name: str) -> Path:
    """File of an entry's bitcode as this version of LLVM writes it."""
    return folder / f"{name}.{processor().version[0]}.bc"


def _shipped(name: str) -> bytes | None:
    """Machine code that came with the package: for this platform, else from its bitcode."""
    folder, here = SHIPPED / level(), target_of(level())
    for place in (folder, cache_folder()):
        code = code_of(object_file(place, name, here))
        if code is not None:
            return code
    for path in folder.glob(f"{name}.*.bc"):
        # LLVM reads what older versions have written.
        bitcode = code_of(path) if int(path.suffixes[-2][1:]) <= here.version[0] else None
        if bitcode is not None:
            code = from_bitcode(bitcode, here)
            keep_code(object_file(cache_folder(), name, here), code)
            return code
    return None


def _own(function: Entry, kind: ArgumentKind, name: str) -> bytes:
    """Machine code for this machine alone, made by numba and kept."""
    here = processor()
    path = object_file(cache_folder(), name, here)
    code = code_of(path)
    if code is not None:
        return code
    for tell in listeners:
        tell()
    with FileLock(path.with_suffix(".lock")):
        code = code_of(path)  # by now another process may have made it
        if code is None:
            code = from_bitcode(made(function, kind, name), here)
            keep_code(path, code)
    return code


def made(function: Entry, kind: ArgumentKind, name: str) -> bytes:
    """Bitcode of an entry, by numba."""
    from stickslip.machine_code.by_numba import bitcode

    return bitcode(function, kind, name)


def from_bitcode(bitcode: bytes, here: Processor) -> bytes:
    """Machine code from LLVM's bitcode."""
    module = llvm.parse_bitcode(bitcode)
    module.triple = here.triple
    module.data_layout = str(machine(here).target_data)
    return emitted(module, here, _SPEED)


@cache
def _say() -> None:
    """Say once what takes its time."""
    if sys.stderr.isatty():
        print(
            "stickslip: no machine code of the engine came with these sources for this machine; "
            "numba compiles it once, some minutes ...",
            file=sys.stderr,
        )


# Who is told before an entry is compiled, or waited for.
listeners: list[Callable[[], None]] = [_say]
