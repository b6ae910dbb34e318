"""What Python calls of the engine: its arguments as tables, its machine code from a shelf."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from llvmlite import binding as llvm

from stickslip.translator import compiled
from stickslip.arrays import Array
from stickslip.machine_code import kinds, objects, shelf, tables
from stickslip.machine_code.functions import Entry, entry_point
from stickslip.orbits.fields import instructions
from stickslip.orbits.fields.engine.interpreter import interpret
from stickslip.shipping import is_complete
from stickslip.symbolic import expressions as ex
from test_house import MODULES


class Inner(NamedTuple):
    matrix: Array
    scale: float
    number: int


class Outer(NamedTuple):
    inner: Inner
    flags: Array
    both: tuple[float, Inner]
    yes: bool


def outer(rng: np.random.Generator) -> Outer:
    matrix = rng.normal(size=rng.integers(0, 4, 2))
    inner = Inner(matrix, float(rng.normal()), int(rng.integers(-9, 9)))
    other = Inner(np.ones((2, 0)), np.float64(2.5), np.int32(7))  # pyright: ignore[reportArgumentType]
    return Outer(inner, np.zeros(3, bool), (0.5, other), bool(rng.integers(2)))


ARGUMENTS: tuple[Any, ...] = (
    outer(np.random.default_rng(1)),
    np.zeros((2, 2, 2), np.int8),
    np.zeros((), complex),
    kinds.MachineFunction(2**40, "jets"),
)
KIND = (kinds.PLAIN, *map(kinds.argument_kind, ARGUMENTS))


def prepared() -> tables.Prepared:
    return tables.Prepared(KIND, 1, "None")


@pytest.mark.parametrize("seed", range(20))
def test_tables_are_those_that_python_makes(seed: int) -> None:
    arguments = (outer(np.random.default_rng(seed)), *ARGUMENTS[1:])
    found, wanted = prepared().tables(arguments), tables.by_python(KIND, arguments)
    assert found is not None
    assert wanted is not None
    for got, expected in zip(found, wanted, strict=True):
        assert list(got) == list(expected)


def changed(**parts: Any) -> tuple[Any, ...]:
    return (ARGUMENTS[0]._replace(**parts), *ARGUMENTS[1:])


MATRIX = np.ones((4, 4))
READ_ONLY = np.zeros(3, bool)
READ_ONLY.setflags(write=False)
OTHER = {
    "a part less": ARGUMENTS[:-1],
    "a number for a tuple": (1.0, *ARGUMENTS[1:]),
    "a list for a tuple": (list(ARGUMENTS[0]), *ARGUMENTS[1:]),
    "entries of another type": changed(flags=np.zeros(3)),
    "another number of axes": changed(flags=np.zeros((3, 1), bool)),
    "not an array": changed(flags=[True, False]),
    "columns": changed(inner=ARGUMENTS[0].inner._replace(matrix=MATRIX[:, :2])),
    "Fortran's order": changed(inner=ARGUMENTS[0].inner._replace(matrix=MATRIX[:, :3].T)),
    "bytes the other way round": changed(
        inner=ARGUMENTS[0].inner._replace(
            matrix=MATRIX.astype(">f8" if sys.byteorder == "little" else "<f8")
        )
    ),
    "not to be written to": changed(flags=READ_ONLY),
    "a real number for a whole one": changed(inner=ARGUMENTS[0].inner._replace(number=1.5)),
    "too large": changed(inner=ARGUMENTS[0].inner._replace(number=2**70)),
    "no number": changed(inner=ARGUMENTS[0].inner._replace(scale="1")),
}


@pytest.mark.parametrize("what", OTHER)
def test_other_arguments_are_noticed(what: str) -> None:
    """A wrong address would be a crash: whatever is of another kind is refused, by either way."""
    assert prepared().tables(OTHER[what]) is None
    assert tables.by_python(KIND, OTHER[what]) is None
    assert prepared().tables(ARGUMENTS) is not None


@compiled()
def trace(inner: Inner) -> float:
    total = 0.0
    for i in range(min(inner.matrix.shape)):
        total += inner.matrix[i, i]
    return inner.scale * total + inner.number


@entry_point()
def summed(outer: Outer, out: Array) -> float:
    out[0] = trace(outer.inner)
    out[1] = trace(outer.both[1]) * outer.both[0]
    out[2] = len(outer.flags) if outer.yes else -1.0
    for i in range(len(outer.flags)):
        outer.flags[i] = i % 2 == 0
    return out[0]


@entry_point()
def is_large(x: float) -> bool:
    return x > 1.0


@entry_point()
def ends(x: Array, i: int) -> float:
    return x[i, 0] + 10.0 * x[-1][i]


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder of machine code."""
    monkeypatch.setenv("STICKSLIP_CACHE", str(tmp_path))
    return tmp_path / "stickslip"


@pytest.mark.parametrize("seed", range(5))
def test_an_entry_computes_what_python_computes(seed: int) -> None:
    given = outer(np.random.default_rng(seed))
    matrix = np.arange(6.0).reshape(2, 3)
    given = given._replace(both=(0.5, Inner(matrix, 2.0, 3)))
    found, wanted = np.zeros(3), np.zeros(3)
    assert summed(given, found) == trace.py_func(given.inner)
    np.testing.assert_array_equal(given.flags, [True, False, True])
    wanted[:] = trace.py_func(given.inner), 0.5 * trace.py_func(given.both[1]), -1.0
    if given.yes:
        wanted[2] = 3
    np.testing.assert_array_equal(found, wanted)


def test_truth_and_numbers() -> None:
    assert is_large(2.0) is True
    assert is_large(0.5) is False
    assert is_large(np.float64(3.0)) is True
    assert is_large(3) is True


def test_a_constant_counts_from_the_end() -> None:
    """Where it is the only index; whether others are negative, compiled code does not ask."""
    x = np.arange(9.0).reshape(3, 3)
    assert ends(x, 1) == ends.py_func(x, 1) == 73.0


def test_what_no_compiled_function_takes_is_named() -> None:
    with pytest.raises(TypeError, match="take no str"):
        is_large("2")
    with pytest.raises(TypeError, match="take no NoneType"):
        summed(None, np.zeros(3))
    with pytest.raises(TypeError, match="jets is called by compiled functions alone"):
        kinds.MachineFunction(1, "jets")(0.0)


@entry_point()
def twice(x: float) -> float:
    return 2.0 * x


def counted(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of what numba is asked to compile."""
    asked = list[str]()
    made = shelf.made

    def make(function: Any, kind: kinds.ArgumentKind, name: str) -> bytes:
        asked.append(name)
        return made(function, kind, name)

    monkeypatch.setattr(shelf, "made", make)
    return asked


def test_what_was_compiled_is_kept(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = counted(monkeypatch)
    for times in (1, 1):
        assert shelf.prepare(twice, (1.5,)).run is not None
        assert len(asked) == times
    (kept,) = cache.glob("twice*.o")
    for damaged in (b"", kept.read_bytes()[:-1], b"0" * 100):
        kept.write_bytes(damaged)
        asked.clear()
        found = shelf.prepare(twice, (1.5,))
        assert len(asked) == 1
        given = found.tables((1.5,))
        assert given is not None
        assert found.run(*given) == 3.0


def test_the_shelf_comes_first(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Machine code of this platform; else bitcode, which is compiled once; else numba."""
    shipped = tmp_path / "shipped"
    place = shipped / shelf.level()
    place.mkdir(parents=True)
    with shelf.filled(place):
        shelf.prepare(twice, (1.0,))
    monkeypatch.setattr(shelf, "SHIPPED", shipped)
    asked = counted(monkeypatch)
    shelf.prepare(twice, (1.0,))
    assert not list(cache.glob("twice*"))
    for file in place.glob("*.o"):
        file.unlink()
    shelf.prepare(twice, (1.0,))
    assert len(list(cache.glob("twice*.o"))) == 1
    monkeypatch.setattr(shelf, "from_bitcode", lambda *_: pytest.fail("compiled again"))
    shelf.prepare(twice, (1.0,))
    assert not asked


def test_bitcode_of_a_newer_llvm_is_left_alone(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "shipped" / shelf.level()
    place.mkdir(parents=True)
    with shelf.filled(place):
        shelf.prepare(twice, (1.0,))
    for file in place.glob("*.o"):
        file.unlink()
    (bitcode,) = place.glob("*.bc")
    name = bitcode.name.split(".")[0]
    bitcode.rename(place / f"{name}.{objects.processor().version[0] + 1}.bc")
    monkeypatch.setattr(shelf, "SHIPPED", tmp_path / "shipped")
    asked = counted(monkeypatch)
    shelf.prepare(twice, (1.0,))
    assert len(asked) == 1


def test_portable_code_is_the_same_function(tmp_path: Path) -> None:
    """Bitcode for any processor, made for this one."""
    name = shelf.name_of(twice, (kinds.PLAIN, "f"))
    bitcode = shelf.made(twice, (kinds.PLAIN, "f"), name)
    code = shelf.from_bitcode(bitcode, shelf.target_of(shelf.PORTABLE))
    engine = objects.loaded(code)
    found = tables.Prepared((kinds.PLAIN, "f"), engine.get_function_address(name), "float")
    given = found.tables((21.0,))
    assert given is not None
    assert found.run(*given) == 42.0


@pytest.mark.parametrize(
    ("triple", "begins"),
    [
        ("aarch64-unknown-linux-gnu", b"\x7fELF\x02\x01\x01"),
        ("arm64-apple-macosx", bytes.fromhex("cffaedfe 0c000001")),
        ("x86_64-pc-windows-msvc", bytes.fromhex("6486")),
    ],
)
def test_bitcode_becomes_machine_code_of_other_platforms(triple: str, begins: bytes) -> None:
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    bitcode = shelf.made(summed, (kinds.PLAIN, kinds.argument_kind(ARGUMENTS[0]), "f8:1"), "summed")
    there = objects.processor()._replace(triple=triple, name="", features="")
    code = shelf.from_bitcode(bitcode, there)
    assert code.startswith(begins)
    assert b"summed" in code


def test_other_sources_have_other_machine_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = shelf.name_of(twice, (kinds.PLAIN, "f"))
    assert shelf.name_of(twice, (kinds.PLAIN, "i")) != before
    monkeypatch.setattr(shelf, "stamp", lambda file: "other")
    assert shelf.name_of(twice, (kinds.PLAIN, "f")) != before


needs_shipment = pytest.mark.skipif(
    not is_complete(shelf.SHIPPED / shelf.level()),
    reason="the engine was not compiled ahead of time: make machine-code",
)


@needs_shipment
def test_all_entries_are_shipped() -> None:
    """The tours come to every function of the engine that Python calls."""
    entries = {
        value.__name__
        for name in MODULES
        if name.startswith(("stickslip.motion.", "stickslip.orbits."))
        for value in vars(importlib.import_module(name)).values()
        if isinstance(value, Entry)
    }
    assert len(entries) > 10
    shipped = {file.name.rpartition("_")[0] for file in (shelf.SHIPPED / shelf.level()).glob("*.o")}
    assert entries == shipped


@needs_shipment
def test_shipped_code_has_the_bits_that_numba_makes(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same source as numba alone compiles it, for this machine."""
    x, y = ex.sym("x"), ex.sym("y")
    wave = ex.multiply(ex.call("sin", y), ex.call("exp", ex.multiply(ex.num(-1.0), x)))
    formulas = [wave, ex.power(ex.add((x, 1.0), (wave, 0.3)), ex.num(-2.0)), ex.multiply(x, x, y)]
    values = instructions.Evaluator([*formulas, ex.derivative(formulas[1], "x")], ["x", "y"], 2)
    given = np.random.default_rng(5).uniform(0.5, 2.0, (2, 37))
    shipped = values(given)
    monkeypatch.setattr(instructions, "interpret", interpret.dispatcher)
    np.testing.assert_array_equal(values(given), shipped)


@needs_shipment
def test_a_motion_needs_no_compiler() -> None:
    """What the package is shipped with moves without numba."""
    script = """
import sys
import stickslip as ss
for flow in ("auto", "taylor"):
    motion = ss.simulate(ss.catalogue.rocking_toy(), (0.0, 5.0), flow=flow)
    motion.at(1.0)
assert "numba" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", script], check=True, env={**os.environ})
