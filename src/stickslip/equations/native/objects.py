"""Assembly -> machine code, kept on disk: a second run only loads it."""

from __future__ import annotations

import ctypes
import hashlib
import os
from contextlib import suppress
from ctypes.util import find_library
from functools import cache
from pathlib import Path
from threading import RLock
from typing import Any, NamedTuple

from llvmlite import binding as llvm

# How hard LLVM's code generation works: more than 1 takes longer, and straight code is no faster
# for it; for long assembly, 1 would take longer than most motions.
_SPEED, _SPEED_OF_LONG = 1, 0
_LONG = 400_000  # characters without tables
_DIGEST = 32  # bytes, before the machine code in a file
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
    with _LOCK:
        code = sum(len(line) for line in assembly.splitlines() if not line.startswith("@"))
        speed = _SPEED if code < _LONG else _SPEED_OF_LONG
        key = hashlib.sha256(repr((assembly, processor(), speed)).encode()).hexdigest()
        if key not in _kept:
            _kept[key] = _loaded(assembly, folder / f"system_{key[:24]}.o", speed)
        return [_kept[key].get_function_address(name) for name in names]


def _loaded(assembly: str, path: Path, speed: int) -> Any:
    """The functions in memory, where they can be called."""
    here = processor()
    target = llvm.Target.from_triple(here.triple).create_target_machine(
        cpu=here.name, features=here.features, opt=speed, jit=True
    )
    code = _read(path)
    if code is None:
        code = target.emit_object(llvm.parse_assembly(assembly))
        _write(path, code)
    _find_functions(assembly)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return engine


def _read(path: Path) -> bytes | None:
    """Machine code of a file; None if there is none, or it is damaged."""
    with suppress(OSError):
        found = path.read_bytes()
        digest, code = found[:_DIGEST], found[_DIGEST:]
        if hashlib.sha256(code).digest() == digest:
            return code
    return None


def _write(path: Path, code: bytes) -> None:
    """Keep machine code, whole or not at all."""
    partial = path.with_suffix(f".{os.getpid()}.tmp")
    with suppress(OSError):
        partial.write_bytes(hashlib.sha256(code).digest() + code)
        partial.replace(path)


def _find_functions(assembly: str) -> None:
    """Tell LLVM where functions of the mathematical library are that it does not find itself."""
    for line in assembly.splitlines():
        if line.startswith("declare") and "@llvm." not in line:
            name = line[line.index("@") + 1 : line.index("(")]
            if llvm.address_of_symbol(name) is None:
                function = getattr(_mathematics(), name)
                llvm.add_symbol(name, ctypes.cast(function, ctypes.c_void_p).value)


@cache
def _mathematics() -> ctypes.CDLL:
    """The mathematical library of C."""
    return ctypes.CDLL(find_library("m") or find_library("ucrtbase") or None)
