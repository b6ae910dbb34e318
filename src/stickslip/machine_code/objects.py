"""LLVM: from assembly to machine code in memory and on disk."""

from __future__ import annotations

import ctypes
import hashlib
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from ctypes.util import find_library
from functools import cache
from pathlib import Path
from threading import RLock
from typing import Any, NamedTuple

from llvmlite import binding as llvm

from stickslip.machine_code.store import cache_folder, keep, stored

# How hard LLVM's code generation works. Loops are optimised first. Straight code, as of a system,
# is no faster for it; where it is long, anything but 0 would take longer than most motions.
LOOPS, STRAIGHT, LONG = 2, 1, 0
_LONG = 400_000  # characters without tables, of straight code
# What compiled functions may call of C's mathematical library.
MATHEMATICS: Sequence[str] = (
    "acos acosh asin asinh atan atan2 atanh cbrt ceil cos cosh erf erfc exp exp2 expm1 floor fma "
    "fmod frexp hypot ilogb ldexp log log10 log1p log2 pow round sin sinh sqrt tan tanh trunc"
).split()
_LOCK = RLock()
_kept: dict[str, Any] = {}  # what has been loaded, by its assembly
_in_memory: list[Any] = []  # everything that has been loaded: addresses of it are everywhere


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


def digest(*facts: Any) -> str:
    """A name for what is made of these facts."""
    return hashlib.sha256(repr(facts).encode()).hexdigest()


# -- making ----------------------------------------------------------------------------------------


def machine(here: Processor, effort: int = STRAIGHT) -> Any:
    """LLVM's description of a processor."""
    processor()  # which makes LLVM know this machine
    return llvm.Target.from_triple(here.triple).create_target_machine(
        cpu=here.name, features=here.features, opt=effort, jit=True
    )


def module_of(assembly: str, here: Processor, effort: int) -> Any:
    """A module for a processor, its loops optimised."""
    module = llvm.parse_assembly(assembly)
    target = machine(here, effort)
    module.triple = here.triple
    module.data_layout = str(target.target_data)
    if effort == LOOPS:
        module.verify()
        optimise(module, target)
    return module


def optimise(module: Any, target: Any, *, loops: bool = True, inlined: int = 225) -> None:
    """LLVM's usual passes. Vectors of straight code are left out: they make the closed forms of
    motions a tenth slower.

    Parameters
    ----------
    module, target
    loops : bool
        Whether loops may be written out, and their rounds put side by side.
    inlined : int
        Largest cost of a call that is inlined, as LLVM counts it.
    """
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    options.inlining_threshold = inlined
    options.slp_vectorization = False
    options.loop_vectorization = loops
    options.loop_interleaving = loops
    options.loop_unrolling = loops
    passes = llvm.create_pass_builder(target, options)
    passes.getModulePassManager().run(module, passes)


def object_of(assembly: str, place: Path, here: Processor, effort: int) -> bytes:
    """Machine code of some assembly, from disk or new.

    Parameters
    ----------
    assembly : str
    place : Path
        Beginning of the name of the file where it is kept.
    here : Processor
    effort : int
        `LOOPS`, `STRAIGHT` or `LONG`.
    """
    key = digest(assembly, here, effort)
    path = place.with_name(f"{place.name}.{key[:24]}.o")
    code = stored(path, key)
    if code is None:
        code = emitted(module_of(assembly, here, effort), here, effort)
        keep(path, key, code)
    return code


def from_bitcode(bitcode: bytes, here: Processor) -> bytes:
    """Machine code from LLVM's bitcode."""
    module = llvm.parse_bitcode(bitcode)
    module.triple = here.triple
    module.data_layout = str(machine(here).target_data)
    return emitted(module, here, LOOPS)


def emitted(module: Any, here: Processor, effort: int) -> bytes:
    """Machine code of a module for a processor."""
    return machine(here, effort).emit_object(module)


# -- loading ---------------------------------------------------------------------------------------


def loaded(codes: Iterable[bytes]) -> Any:
    """Machine code in memory, of parts that call each other; what else they call is where it can be
    found (see :func:`find_functions`)."""
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine(processor()))
    for code in codes:
        engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    _in_memory.append(engine)
    return engine


def addresses(assembly: str, names: list[str]) -> list[int]:
    """Addresses of functions of straight code: from this process, from disk, or new.

    Parameters
    ----------
    assembly : str
        LLVM assembly that defines the functions.
    names : list of str
        Theirs.
    """
    with _LOCK:
        if assembly not in _kept:
            length = sum(len(line) for line in assembly.splitlines() if not line.startswith("@"))
            effort = STRAIGHT if length < _LONG else LONG
            code = object_of(assembly, cache_folder() / names[0], processor(), effort)
            declared = [line for line in assembly.splitlines() if line.startswith("declare")]
            find_functions([line[line.index("@") + 1 : line.index("(")] for line in declared])
            _kept[assembly] = loaded([code])
        return [_kept[assembly].get_function_address(name) for name in names]


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
