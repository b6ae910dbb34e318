"""LLVM: from assembly to machine code in memory and on disk."""

from __future__ import annotations

import ctypes
import hashlib
import os
import re
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from ctypes.util import find_library
from functools import cache
from pathlib import Path
from threading import RLock
from typing import Any, NamedTuple
from weakref import WeakValueDictionary

from llvmlite import binding as llvm

from stickslip.kept import cached_property
from stickslip.machine_code.store import cache_folder, keep, stored

# Optimisation levels of LLVM's code generation. Code with loops is optimised before. Code without
# loops, as in a system, is not faster with it, and if it is long, any level but 0 takes longer to
# compile than most motions take to compute.
LOOPS, STRAIGHT, LONG = 2, 1, 0
_LONG = 400_000  # number of characters of long code without loops, not counting tables
# For many systems that each move briefly: level 0 compiles in a fifth of the time, and motions take
# a sixth longer. The bits are the same, because LLVM does not reorder arithmetic.
QUICK = bool(os.environ.get("STICKSLIP_QUICK_COMPILE"))
# Functions of C's mathematical library that compiled functions may call.
MATHEMATICS: Sequence[str] = (
    "acos acosh asin asinh atan atan2 atanh cbrt ceil cos cosh erf erfc exp exp2 expm1 floor fma "
    "fmod frexp hypot ilogb ldexp log log10 log1p log2 pow round sin sinh sqrt tan tanh trunc"
).split()
_LOCK = RLock()


class Code:
    """Machine code in memory, freed with this object.

    Parameters
    ----------
    engine
        LLVM's execution engine.
    needed : iterable of Provider
        The other code that it calls.

    Attributes
    ----------
    lasting : bool
        Whether it and the code that it calls may stay in memory permanently.
    """

    def __init__(self, engine: Any, needed: Iterable[Provider] = ()) -> None:
        self._engine = engine
        self._needed = tuple(needed)
        self.lasting: bool = all(provider.lasting for provider in self._needed)

    def address(self, name: str) -> int:
        """The address of a function."""
        return int(self._engine.get_function_address(name))


class Provider:
    """Functions whose machine code is loaded when one of them is first called.

    Parameters
    ----------
    make : function
        Loads the code.
    lasting : bool
        Whether it may stay in memory permanently.
    """

    def __init__(self, make: Callable[[], Code], lasting: bool) -> None:
        self._make = make
        self.lasting: bool = lasting

    @cached_property
    def code(self) -> Code:
        """The code, loaded on first access."""
        return self._make()


# key: assembly and effort
_kept: WeakValueDictionary[tuple[str, int], Code] = WeakValueDictionary()
_recent: deque[Code] = deque(maxlen=32)  # keeps systems that are declared repeatedly
_permanent: dict[str, Code] = {}  # code that is called by address, without a reference to it
_provided: dict[str, Provider] = {}


class Processor(NamedTuple):
    """The processor that machine code is for, and the version of LLVM."""

    triple: str
    name: str
    features: str
    version: tuple[int, ...]


def platform_of(triple: str) -> str:
    """A platform by its LLVM name. On macOS it contains the version of the system, which changes
    the machine code, so the oldest version with wheels is used for all."""
    return re.sub(r"-darwin[\d.]*$", "-darwin21", triple)


@cache
def processor() -> Processor:
    """The processor of this machine."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return Processor(
        platform_of(llvm.get_process_triple()),
        llvm.get_host_cpu_name(),
        llvm.get_host_cpu_features().flatten(),
        tuple(llvm.llvm_version_info),
    )


def digest(*facts: Any) -> str:
    """A hash of the given facts, as a name."""
    return hashlib.sha256(repr(facts).encode()).hexdigest()


# -- making ----------------------------------------------------------------------------------------


def machine(here: Processor, effort: int = STRAIGHT) -> Any:
    """LLVM's description of a processor."""
    processor()  # initializes LLVM for this machine
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
    loops : bool
        Whether loops may be unrolled, vectorised and interleaved.
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
    place : Path
        Beginning of the name of the file where it is kept.
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


def loaded(codes: Iterable[bytes], needed: Iterable[Provider] = ()) -> Code:
    """Load the machine code of parts that call each other; all else that they call must be known to
    LLVM (see :func:`find_functions`)."""
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine(processor()))
    for code in codes:
        engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return Code(engine, needed)


def code_of(assembly: str, name: str) -> Code:
    """Code without loops in memory: from this process, from disk, or newly compiled.

    Parameters
    ----------
    assembly : str
        LLVM assembly.
    name : str
        Under which it is kept on disk.
    """
    length = sum(len(line) for line in assembly.splitlines() if not line.startswith("@"))
    effort = LONG if QUICK or length >= _LONG else STRAIGHT
    with _LOCK:
        code = _kept.get((assembly, effort))
        if code is None:
            made = object_of(assembly, cache_folder() / name, processor(), effort)
            declared = [line for line in assembly.splitlines() if line.startswith("declare")]
            called = [line[line.index("@") + 1 : line.index("(")] for line in declared]
            find_functions(called)
            needed = [found for name in called if (found := _provided.get(name)) is not None]
            code = _kept[assembly, effort] = loaded([made], needed)
        if code.lasting:
            _recent.append(code)
        return code


def addresses(assembly: str, names: list[str]) -> list[int]:
    """Addresses of functions of code without loops, which remains in memory.

    Parameters
    ----------
    assembly : str
        LLVM assembly that defines the functions.
    names : list of str
        Theirs.
    """
    code = _permanent[assembly] = code_of(assembly, names[0])
    return [code.address(name) for name in names]


def find_functions(names: Sequence[str]) -> None:
    """Tell LLVM the addresses of functions of C's mathematical library and of Python that it does
    not find itself."""
    for name in names:
        # A function that is provided again may have another address than the one stored in LLVM.
        known = name not in _provided and llvm.address_of_symbol(name) is not None
        if not (name.startswith("llvm.") or known):
            with suppress(AttributeError):  # LLVM reports missing functions when they are called
                llvm.add_symbol(name, address_of(name))


def address_of(name: str) -> int:
    """The address of a function of C's mathematical library or of Python.

    Raises
    ------
    AttributeError
        If no function has this name.
    """
    if name in _provided:
        return _provided[name].code.address(name)
    known = llvm.address_of_symbol(name)
    if known is not None:
        return int(known)
    library = ctypes.pythonapi if name.startswith("Py") else _mathematics()
    found = ctypes.cast(getattr(library, name), ctypes.c_void_p).value
    assert found is not None
    return found


def provide(names: Iterable[str], make: Callable[[], Code], lasting: bool = True) -> Provider:
    """Register functions that compiled code may call; see :class:`Provider`."""
    provider = Provider(make, lasting)
    _provided.update(dict.fromkeys(names, provider))
    return provider


def provider_of(name: str) -> Provider | None:
    """The provider of a function; None if it is one of C's mathematical library or of Python."""
    return _provided.get(name)


def withdraw(names: Iterable[str]) -> None:
    """No longer provide functions; code that calls them keeps them."""
    for name in names:
        _provided.pop(name, None)


@cache
def _mathematics() -> ctypes.CDLL:
    """The mathematical library of C."""
    return ctypes.CDLL(find_library("m") or find_library("ucrtbase") or None)
