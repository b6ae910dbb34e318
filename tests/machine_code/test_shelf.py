"""Where machine code comes from: shipped, kept, or made, and what an edit makes anew."""

from __future__ import annotations

import importlib
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from llvmlite import binding as llvm

from stickslip.machine_code import making, objects, shelf
from stickslip.machine_code.functions import Entry
from stickslip.machine_code.shelf import Library
from stickslip.machine_code.words import Prepared
from stickslip.translator.values import entry_types
from test_house import MODULES

NUMBERS = """
from stickslip.translator import compiled

FACTOR = {factor}

@compiled()
def scaled(x: float) -> float:
    # {comment}
    return FACTOR * x
"""
USER = """
from numbers_of_{name} import scaled
from stickslip.arrays import Vector
from stickslip.machine_code.functions import entry_point
from stickslip.translator import compiled

@compiled()
def long_one(x: Vector) -> float:
    total = 0.0
    for i in range(len(x)):
        if x[i] > 3.0:
            total += x[i]
        elif x[i] < -3.0:
            total -= x[i] * x[i]
        else:
            total += scaled(x[i])
    return total

@entry_point()
def total(x: Vector) -> float:
    return long_one(x)
"""


class Small:
    """Two modules of a user in a folder, and the library of their entries."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.name = f"m{abs(hash(folder)) % 10**9}"
        self.write()
        (folder / f"user_of_{self.name}.py").write_text(USER.format(name=self.name))
        self.library = Library(f"user_of_{self.name}", (f"user_of_{self.name}",))

    def write(self, factor: float = 2.0, comment: str = "a comment") -> None:
        """Edit the first module."""
        path = self.folder / f"numbers_of_{self.name}.py"
        path.write_text(NUMBERS.format(factor=factor, comment=comment))

    def load(self) -> ModuleType:
        """Import both anew."""
        for name in (f"numbers_of_{self.name}", f"user_of_{self.name}"):
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        return importlib.import_module(f"user_of_{self.name}")

    def total(self) -> float:
        """What the entry says now, with machine code from wherever it comes."""
        return shelf.prepare(self.load().total)(np.array([1.0, 2.0]))

    def total_of_library(self, entry: Entry | None = None) -> float:
        """The same, as an entry of the package; by default it is imported anew."""
        now: Entry = self.load().total if entry is None else entry
        engine = objects.loaded(shelf.codes_of(self.library))
        address = engine.address(f"entry.{now.symbol}")
        return Prepared("total", ("x",), *entry_types(now), address)(np.array([1.0, 2.0]))


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Small:
    """Edited modules have another size or time here: Python keeps none of their bytecode."""
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setenv("STICKSLIP_CACHE", str(tmp_path / "cache"))
    folder = tmp_path / "modules"
    folder.mkdir()
    monkeypatch.syspath_prepend(folder)
    return Small(folder)


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the modules that are compiled."""
    names = list[str]()
    make = making.make_one

    def noted(job: making.Compilation) -> bytes:
        names.append(Path(job.place).name.split("_of_")[0].removeprefix("modules_"))
        return make(job)

    monkeypatch.setattr(making, "make_one", noted)
    return names


WAYS = pytest.mark.parametrize("total", [Small.total, Small.total_of_library])


@WAYS
def test_what_was_compiled_is_kept(
    total: Callable[[Small], float], small: Small, made: list[str]
) -> None:
    assert total(small) == 6.0
    assert sorted(made) == ["numbers", "user"]
    made.clear()
    assert total(small) == 6.0
    assert not made


@WAYS
def test_an_edit_compiles_what_it_changes(
    total: Callable[[Small], float], small: Small, made: list[str]
) -> None:
    """A comment nothing, a constant what it is compiled into; and never is old code run."""
    total(small)
    made.clear()
    small.write(comment="another one")
    assert total(small) == 6.0
    assert not made
    small.write(factor=3.0)
    assert total(small) == 9.0
    assert sorted(made) == ["numbers", "user"]  # small functions are copied to where they are used
    made.clear()
    small.write(factor=2.0)
    assert total(small) == 6.0
    assert not made


def test_code_of_sources_edited_after_their_import_is_not_kept(small: Small) -> None:
    """It has the old constants, and would be taken for that of the new sources."""
    entry = small.load().total
    small.write(factor=3.0)
    assert small.total_of_library(entry) == 6.0
    assert small.total_of_library() == 9.0


def test_damaged_code_is_made_again(small: Small, tmp_path: Path) -> None:
    small.total_of_library()
    files = sorted((tmp_path / "cache" / "stickslip").iterdir())
    assert {file.suffix for file in files} == {".o", ".list"}
    for file in files:
        whole = file.read_bytes()
        for damaged in (b"", whole[:-1], whole[:-1] + bytes([whole[-1] ^ 1])):
            file.write_bytes(damaged)
            assert small.total_of_library() == 6.0
            assert file.read_bytes() == whole


def test_swapped_code_is_made_again(small: Small, made: list[str], tmp_path: Path) -> None:
    small.total()
    small.write(factor=5.0)
    small.total()
    made.clear()
    folder = tmp_path / "cache" / "stickslip"
    first, second = sorted(folder.glob(f"modules_numbers_of_{small.name}.*.o"))
    code = first.read_bytes(), second.read_bytes()
    first.write_bytes(code[1])
    second.write_bytes(code[0])
    assert small.total() == 15.0
    assert made == ["numbers"]


def test_the_shelf_comes_first(
    small: Small, made: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Machine code of this platform; else bitcode, which becomes machine code once."""
    monkeypatch.setattr(shelf, "SHIPPED", tmp_path / "shipped")
    place = tmp_path / "shipped" / shelf.level()
    place.mkdir(parents=True)
    small.load()
    here = shelf.target_of(shelf.level())
    shelf.make(small.library, place, here, ship=True)
    made.clear()
    assert small.total_of_library() == 6.0
    assert not list((tmp_path / "cache").rglob("*.o"))
    for file in place.glob("*.o"):
        file.unlink()
    for _ in range(2):
        assert small.total_of_library() == 6.0
        assert len(list((tmp_path / "cache" / "stickslip").glob("*.o"))) == 2
        monkeypatch.setattr(shelf, "from_bitcode", lambda *_: pytest.fail("compiled again"))
    assert not made
    # of a newer LLVM it is left alone
    for file in (tmp_path / "cache" / "stickslip").iterdir():
        file.unlink()
    (place / "llvm").write_text(f"{here.version[0] + 1}\n")
    assert small.total_of_library() == 6.0
    assert len(made) == 2


def test_what_is_shipped_no_more_is_removed(
    small: Small, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "shipped"
    place.mkdir()
    here = shelf.target_of(shelf.level())
    for factor in (2.0, 3.0):
        small.write(factor=factor)
        small.load()
        shelf.make(small.library, place, here, ship=True)
    assert len(list(place.glob("*.o"))) == 4
    shelf.clean(place, here, [small.library])
    assert len(list(place.glob("*.o"))) == len(list(place.glob("*.bc"))) == 2
    assert len(list(place.glob("*.list"))) == 2


@pytest.mark.parametrize(
    ("triple", "begins"),
    [
        ("aarch64-unknown-linux-gnu", b"\x7fELF\x02\x01\x01"),
        ("arm64-apple-macosx", bytes.fromhex("cffaedfe 0c000001")),
        (objects.platform_of("arm64-apple-darwin24.6.0"), bytes.fromhex("cffaedfe 0c000001")),
        ("x86_64-pc-windows-msvc", bytes.fromhex("6486")),
        ("wasm32-unknown-unknown", b"\0asm"),
    ],
)
def test_code_of_other_platforms(small: Small, triple: str, begins: bytes) -> None:
    """From the same assembly, and from the bitcode that a wheel carries."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    small.load()
    there = objects.processor()._replace(triple=triple, name="", features="")
    here = shelf.target_of(shelf.PORTABLE)
    for job in shelf.jobs_of(shelf.entries_of(small.library), small.folder, here):
        module = objects.module_of(job.text, there, objects.LOOPS)
        assert objects.emitted(module, there, objects.LOOPS).startswith(begins)
        bitcode = objects.module_of(job.text, here, objects.LOOPS).as_bitcode()
        code = objects.from_bitcode(bitcode, there)
        assert code.startswith(begins)
        assert b"scaled" in code or b"total" in code


@pytest.mark.parametrize(
    ("told", "platform"),
    [
        ("arm64-apple-darwin24.6.0", "arm64-apple-darwin21"),
        ("x86_64-apple-darwin22.1.0", "x86_64-apple-darwin21"),
        ("x86_64-unknown-linux-gnu", "x86_64-unknown-linux-gnu"),
        ("x86_64-pc-windows-msvc", "x86_64-pc-windows-msvc"),
    ],
)
def test_code_does_not_depend_on_the_version_of_macos(told: str, platform: str) -> None:
    """A wheel that was built on one finds its machine code on another."""
    assert objects.platform_of(told) == platform


def test_portable_code_is_the_same_function(small: Small) -> None:
    entry: Entry = small.load().total
    here = shelf.target_of(shelf.PORTABLE)
    jobs = shelf.jobs_of(shelf.entries_of(small.library), small.folder, here)
    engine = objects.loaded([making.make_one(job) for job in jobs])
    address = engine.address(f"entry.{entry.symbol}")
    assert Prepared("total", ("x",), *entry_types(entry), address)(np.array([4.0, 2.0])) == 8.0


def test_two_processes_share_the_work(
    small: Small, made: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the other one makes is taken from disk; what it cannot keep is made here."""
    monkeypatch.setattr(making, "_FEW", 0)
    assert small.total() == 6.0
    assert len(made) == min(2, 3 - min(2, os.cpu_count() or 1))
    monkeypatch.setattr(making, "_helper", lambda jobs: subprocess.Popen([sys.executable, "-V"]))
    small.write(factor=7.0)
    made.clear()
    assert small.total() == 21.0
    assert len(made) == 2


def test_all_entries_of_the_package_are_in_its_library() -> None:
    with_entries = {
        name
        for name, path in MODULES.items()
        if re.search("\n@(entry_point|Kernel)", path.read_text(encoding="utf-8"))
    }
    assert with_entries == {name for library in shelf.LIBRARIES for name in library.modules}


def test_all_sources_of_the_engine_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever its modules import as they are loaded may be compiled into them."""
    read = set[Path]()
    files_of = shelf._files_of

    def noted(*given: Any) -> list[str]:
        found = files_of(*given)
        read.update(Path(path).resolve() for path in found)
        return found

    monkeypatch.setattr(shelf, "_files_of", noted)
    shelf.source_digest(shelf.ENGINE)
    code = (
        "import importlib, sys; from stickslip.machine_code import shelf\n"
        "before = set(sys.modules)\n"
        "[importlib.import_module(name) for name in shelf.ENGINE.modules]\n"
        "new = [name for name in sys.modules if name not in before]\n"
        "new = [sys.modules[name] for name in new if name.startswith('stickslip.')]\n"
        "print(*(module.__file__ for module in new), sep='\\n')"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {Path(line).resolve() for line in said.stdout.splitlines()}
    assert len(loaded) > 30
    missing = {path for path in loaded if path.name != "__init__.py"} - read
    assert not missing
