"""Sources of the machine code of compiled functions: shipped with the package, cached from an
earlier run, or compiled now.

Entries that are compiled together are a *library*, an object for each source file. What is shipped
is named by the sources it was made from and the processors it is for: machine code for the platform
on which the package was built, and LLVM's bitcode for others. All processors of a level run the
same code and have the same bits.
"""

from __future__ import annotations

import hashlib
import importlib
import inspect
import os
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

from llvmlite import binding as llvm

from stickslip.machine_code.functions import Entry, Kernel
from stickslip.machine_code.making import Compilation, make_all
from stickslip.machine_code.objects import (
    LOOPS,
    MATHEMATICS,
    Code,
    Processor,
    digest,
    find_functions,
    from_bitcode,
    loaded,
    processor,
)
from stickslip.machine_code.store import alone, cache_folder, keep, stored
from stickslip.machine_code.words import Prepared
from stickslip.translator import BEGAN, READ
from stickslip.translator.values import entry_types

SHIPPED = Path(__file__).parent / "shipped"
# Levels of processors that the engine is built for: 64-bit x86 with fused multiplication and
# vectors of four numbers (Intel since 2013, AMD since 2015), and all others.
FAST, PORTABLE = "x86-64-v3", "portable"
FEATURES = ("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave")
_MAKERS = tuple(
    f"stickslip.{name}"
    for name in (
        "machine_code.objects",
        "translator.__init__",
        "translator.modules",
    )
)
"""What makes machine code, with all that these modules import."""
_IMPORTED = re.compile(rb"\n(?:from|import) ([\w.]+)(?: import (?:\(([^)]*)\)|([^\n]*)))?")
_PACKAGE = str(Path(__file__).parent.parent)


@cache
def level() -> str:
    """The level of this machine's processor."""
    known = llvm.get_host_cpu_features()
    is_x86 = processor().triple.startswith("x86_64")
    return FAST if is_x86 and all(known.get(name, False) for name in FEATURES) else PORTABLE


def target_of(level: str) -> Processor:
    """Target of machine code of a level on this machine."""
    here = processor()
    is_x86 = here.triple.startswith("x86_64")
    return here._replace(name=FAST if level == FAST else "x86-64" if is_x86 else "", features="")


class Library(NamedTuple):
    """Entries that are compiled together.

    Attributes
    ----------
    modules : tuple of str
        Where the entries are.
    """

    name: str
    modules: tuple[str, ...]


ENGINE = Library(
    "engine",
    tuple(
        f"stickslip.{name}"
        for name in (
            "equations.native.kernels",
            "motion.affine.flights",
            "motion.audit.flights.whole",
            "motion.audit.step_balance",
            "motion.audit.work",
            "motion.between.dense",
            "motion.between.trace",
            "motion.engine.event_loop",
            "motion.engine.tables",
            "orbits.fields.engine.events",
            "orbits.fields.engine.interpreter",
            "orbits.fields.engine.resolution",
            "orbits.fields.engine.variations",
            "orbits.settling.engine.attraction",
            "orbits.settling.engine.exponents",
            "orbits.settling.engine.measuring",
            "orbits.settling.engine.settling",
            "orbits.settling.engine.threads",
        )
    ),
)
EVOLUTION_SOLVERS = Library(
    "evolutions",
    tuple(
        f"stickslip.rate_independent.{name}"
        for name in (
            "play.clamp",
            "signals.chebyshev",
            "solvers.active_set",
            "solvers.smoothing",
            "solvers.truncation",
        )
    ),
)
LIBRARIES = (ENGINE, EVOLUTION_SOLVERS)
"""All modules of the package with functions that Python, or the machine code of systems, calls."""


# -- loading ---------------------------------------------------------------------------------------


def prepare(entry: Entry) -> Prepared:
    """An entry in memory."""
    library = next((x for x in LIBRARIES if entry.__module__ in x.modules), None)
    code = _alone(entry) if library is None else _in_memory(library)
    address = code.address(f"entry.{entry.symbol}")
    names = tuple(inspect.signature(entry.python).parameters)
    return Prepared(entry.__name__, names, *entry_types(entry), address, code)


def engine() -> Code:
    """The engine in memory, where LLVM knows the addresses of its functions."""
    return _in_memory(ENGINE)


def _alone(entry: Entry) -> Code:
    """An entry that is not of the package, in memory: translated in each process, compiled once."""
    find_functions(MATHEMATICS)
    jobs = jobs_of([entry], cache_folder(), target_of(level()))
    return loaded(make_all(jobs, entry.__name__))


@cache
def _in_memory(library: Library) -> Code:
    find_functions(MATHEMATICS)
    return loaded(codes_of(library))


def codes_of(library: Library) -> list[bytes]:
    """The machine code of a library: shipped, kept, or made now."""
    here, sources = target_of(level()), source_digest(library)
    codes = shipped(library, level(), sources)
    if codes is None:
        codes = _listed(library, cache_folder(), digest(sources, here), ".o", False)
    if codes is not None:
        return codes
    bitcodes = _listed(library, SHIPPED / level(), digest(sources, "bitcode"), ".bc", True)
    if bitcodes is not None and _is_readable():
        return _made_from(library, bitcodes, sources, here)
    return make(library, cache_folder(), here)


def shipped(library: Library, level: str, sources: str) -> list[bytes] | None:
    """The machine code that came with the package for this platform; None if none did."""
    key = digest(sources, target_of(level))
    return _listed(library, SHIPPED / level, key, ".o", True)


def _listed(
    library: Library, folder: Path, key: str, kind: str, trusted: bool
) -> list[bytes] | None:
    """Parts of a library in a folder; None if any is missing."""
    found = stored(_list_path(library, folder, key), key, trusted=trusted)
    if found is None:
        return None
    lines = [line.split(" ") for line in found.decode().splitlines()]
    codes = [stored(folder / f"{name}{kind}", own, trusted=trusted) for name, own in lines]
    return [code for code in codes if code is not None] if None not in codes else None


def _list_path(library: Library, folder: Path, key: str) -> Path:
    return folder / f"{library.name}.{key[:24]}.list"


def _keep_list(library: Library, folder: Path, key: str, jobs: list[tuple[str, str]]) -> None:
    """Store the names of the parts of a library."""
    lines = "".join(f"{name} {own}\n" for name, own in jobs)
    keep(_list_path(library, folder, key), key, lines.encode())


def _made_from(
    library: Library, bitcodes: list[bytes], sources: str, here: Processor
) -> list[bytes]:
    """Machine code for this platform, from shipped bitcode; kept."""
    folder = cache_folder()
    with alone(folder / library.name):
        codes = list[bytes]()
        parts = list[tuple[str, str]]()
        for bitcode in bitcodes:
            own = digest(hashlib.sha256(bitcode).hexdigest(), here)
            name = f"{library.name}.{own[:24]}"
            codes.append(from_bitcode(bitcode, here))
            keep(folder / f"{name}.o", own, codes[-1])
            parts.append((name, own))
        _keep_list(library, folder, digest(sources, here), parts)
    return codes


def _is_readable() -> bool:
    """Whether this LLVM reads the bitcode that came with the package: its own, and that of older
    versions."""
    folder = SHIPPED / level()
    try:
        return int((folder / _VERSION).read_text(encoding="utf-8")) <= processor().version[0]
    except (OSError, ValueError):
        return False


_VERSION = "llvm"  # name of the file with the version that wrote the bitcode


# -- making ----------------------------------------------------------------------------------------


def make(library: Library, folder: Path, here: Processor, ship: bool = False) -> list[bytes]:
    """Compile the parts of a library that a folder does not contain.

    Parameters
    ----------
    ship : bool
        Whether to keep bitcode, too.
    """
    sources = source_digest(library)
    for tell in listeners:
        tell()
    with alone(folder / library.name):
        # another process may have made it in the meantime
        codes = None if ship else _listed(library, folder, digest(sources, here), ".o", False)
        if codes is not None:
            return codes
        jobs = jobs_of(entries_of(library), folder, here, ship)
        codes = make_all(jobs, library.name)
        if not _is_as_imported(library):
            # Constants are those of the import, so this code is not that of the sources.
            return codes
        parts = [(Path(job.place).name, job.key) for job in jobs]
        _keep_list(library, folder, digest(sources, here), parts)
        if ship:
            _keep_list(library, folder, digest(sources, "bitcode"), parts)
            (folder / _VERSION).write_text(f"{here.version[0]}\n", encoding="utf-8")
    return codes


def clean(folder: Path, here: Processor, libraries: Sequence[Library] = LIBRARIES) -> None:
    """Remove files that belong to no library from a folder of shipped code."""
    wanted = {_VERSION}
    for library in libraries:
        sources = source_digest(library)
        for key in (digest(sources, here), digest(sources, "bitcode")):
            path = _list_path(library, folder, key)
            lines = (stored(path, key, trusted=True) or b"").decode().splitlines()
            names = [line.split(" ")[0] for line in lines]
            wanted |= {path.name, *(f"{name}{kind}" for name in names for kind in (".o", ".bc"))}
    for path in folder.iterdir():
        if path.name not in wanted:
            path.unlink()


def jobs_of(
    entries: Sequence[Entry | Kernel], folder: Path, here: Processor, ship: bool = False
) -> list[Compilation]:
    """Compilation jobs for some entries: a module for each source file."""
    from stickslip.translator.modules import Program

    jobs = list[Compilation]()
    kernels = [x for x in entries if isinstance(x, Kernel)]
    program = Program([x for x in entries if isinstance(x, Entry)], kernels)
    for file, text in program.modules().items():
        key = digest(text, here, LOOPS)
        name = re.sub(r"\W+", "_", f"{Path(file).parent.name} {Path(file).stem}")
        place = folder / f"{name}.{key[:24]}"
        jobs.append(Compilation(text, str(place), key, here, ship))
    return jobs


def entries_of(library: Library) -> list[Entry | Kernel]:
    """The functions of a library that are called from outside."""
    found = list[Entry | Kernel]()
    for name in library.modules:
        module = sys.modules.get(name) or importlib.import_module(name)
        own = [x for x in vars(module).values() if isinstance(x, Entry | Kernel)]
        found += [x for x in own if x.__module__ == name]
    return found


def source_digest(library: Library) -> str:
    """A hash of all sources that may affect the machine code of a library: those of its modules, of
    their imports, and of the translator."""
    content = hashlib.sha256()
    for path, text in sorted(_sources(library).items()):
        name = path.removeprefix(_PACKAGE).replace(os.sep, "/") or os.path.basename(path)
        content.update(f"{name}\n{len(text)}\n".encode())
        content.update(text)
    return content.hexdigest()


def _is_as_imported(library: Library) -> bool:
    """Whether no source of a library was edited after this process had imported it."""
    changed = {path: os.stat(path).st_mtime_ns for path in _sources(library)}
    return all(
        READ[path] == moment if path in READ else moment <= BEGAN
        for path, moment in changed.items()
    )


def _sources(library: Library) -> dict[str, bytes]:
    """The contents of all sources that may shape the machine code of a library, by path."""
    known = dict[str, bytes]()
    left = [path for name in (*library.modules, *_MAKERS) for path in _files_of(name, "")]
    while left:
        path = left.pop()
        if path not in known:
            with open(path, "rb") as file:
                known[path] = file.read()
            folder = os.path.dirname(path)
            for module, several, few in _IMPORTED.findall(known[path]):
                names = (several or few).decode().replace(",", " ").split()
                left += _files_of(module.decode(), folder, names)
    return known


def _files_of(name: str, folder: str, inside: Iterable[str] = ()) -> list[str]:
    """Source files of a module of the package, or of the package that an import refers to; for
    other modules the file, if the module is loaded and in this folder."""
    if name.partition(".")[0] == "stickslip":
        place = os.path.join(_PACKAGE, *name.split(".")[1:])
        if not os.path.isdir(place):
            return [f"{place}.py"]
        return [
            path
            for other in inside
            for path in _files_of(f"{name}.{other}", "")
            if os.path.exists(path)
        ]
    file = getattr(sys.modules.get(name), "__file__", None) or ""
    return [file] if file.startswith(folder) and file.endswith(".py") else []


listeners: list[Callable[[], None]] = []
"""Function that is called before compilation, or before waiting for it."""
