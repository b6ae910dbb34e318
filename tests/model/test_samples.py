"""Functions of time that are given by samples: what they are, and what is wrong with some."""

from __future__ import annotations

import ctypes
import os
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

import stickslip as ss
from stickslip.errors import DeclarationError
from stickslip.machine_code.objects import address_of
from stickslip.model.entries.samples import SAMPLE_KINDS, SampleKind
from stickslip.model.system_file import loads
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.enclosures import bounds
from stickslip.symbolic.functions import FUNCTIONS

_FUNCTION = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)


def random(seed: int, count: int, kind: SampleKind, periodic: bool) -> ss.Samples:
    """Samples at irregular times."""
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.05, 1.0, count)) - 2.0
    values = rng.normal(size=count)
    if periodic:
        values[-1] = values[0]
    return ss.Samples(times, values, kind, periodic)


@pytest.mark.parametrize("kind", SAMPLE_KINDS)
@pytest.mark.parametrize("periodic", [False, True])
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000), count=st.integers(2, 12))
def test_values(kind: SampleKind, periodic: bool, seed: int, count: int) -> None:
    """Lines, splines and steps as SciPy and NumPy make them; expressions and machine code say the
    same, and derivatives are those of the polynomials."""
    if kind == "cubic" and periodic and count < 3:
        count = 3
    samples = random(seed, count, kind, periodic)
    t, y = samples.times, samples.values
    x = np.random.default_rng(seed + 1).uniform(t[0], t[-1], 40)
    if kind == "cubic":
        wanted = CubicSpline(t, y, bc_type="periodic" if periodic else "not-a-knot")(x)
    else:
        at = np.searchsorted(t, x, side="right") - 1
        wanted = np.interp(x, t, y) if kind == "linear" else y[at]
    shift = 7.0 * samples.period
    scale = np.max(np.abs(y)) + np.max(np.abs(wanted))
    np.testing.assert_allclose(samples(x + shift), wanted, rtol=0, atol=1e-11 * scale)
    expression = samples.at(ex.sym("t"))
    for place, value in zip(x[:5] + shift, wanted[:5], strict=True):
        assert ex.evaluate(expression, {"t": place}) == pytest.approx(value, abs=1e-11 * scale)
        low, high = bounds(expression, {"t": (place, place)})
        assert low <= value + 1e-11 * scale and value - 1e-11 * scale <= high
    names = [name for name in FUNCTIONS if name.startswith(samples.pieces.name)]
    assert len(names) == 2 * samples.pieces.coefficients.shape[1] + 3
    for name in names:
        called = _FUNCTION(address_of(name))
        row = FUNCTIONS[name]
        assert np.array_equal([called(place) for place in x + shift], row.array(x + shift))
        # In the middle of a piece of the other parity the nearest one is another.
        inside = 0.7 * t[1:] + 0.3 * t[:-1]
        step = 1e-5 * np.min(np.diff(t))
        rise = (row.array(inside + step) - row.array(inside - step)) / (2.0 * step)
        slope = [ex.evaluate(row.slope, {"'x": place}) for place in inside]
        np.testing.assert_allclose(rise, slope, atol=1e-5 * (1.0 + np.max(np.abs(slope))))


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), kind=st.sampled_from(SAMPLE_KINDS), periodic=st.booleans())
def test_enclosures(seed: int, kind: SampleKind, periodic: bool) -> None:
    """No value between two times is outside of what is said of all of them, and what is said is
    close."""
    samples = random(seed, 9, kind, periodic)
    first, last = samples.span
    a, b = np.sort(np.random.default_rng(seed).uniform(first, last, 2))
    expression = samples.at(ex.sym("t"))
    low, high = bounds(expression, {"t": (float(a), float(b))})
    found = samples(np.linspace(a, b, 200))
    scale = np.max(np.abs(samples.values))
    assert low <= found.min() + 1e-12 * scale and found.max() - 1e-12 * scale <= high
    everything = samples(np.linspace(first, last, 2000))
    assert low >= everything.min() - 0.05 * scale - np.ptp(everything)


def test_outside_there_is_nothing() -> None:
    """What samples do not cover has no value."""
    samples = ss.Samples([0.0, 1.0, 2.0], [0.0, 1.0, 0.0])
    assert np.isnan(samples([-0.1, 2.1])).all() and samples(2.0) == 0.0
    assert not samples.covers(0.0, 2.1) and samples.covers(0.0, 2.0)
    assert ss.Samples([0.0, 1.0, 2.0], [0.0, 1.0, 0.0], periodic=True)(2.5) == 0.5


def test_they_are_data() -> None:
    """Equal if their content is; pickled, and in model files of any length."""
    samples = random(1, 300, "cubic", False)
    assert pickle.loads(pickle.dumps(samples)) == samples
    assert samples != random(2, 300, "cubic", False) and len({samples, samples}) == 1
    for part in (samples, ss.Samples([0.0, 300.0], [1.0, 2.0]), random(3, 50, "hold", True)):
        system = shaken(part)
        text = system.to_toml()
        assert loads(text) == system and loads(text).drives["a"] == part


def shaken(samples: ss.Samples) -> ss.System:
    """A block on a base that is shaken."""
    first, last = samples.span
    return ss.System(
        name="shaken",
        drives={"a": samples},
        coordinates={"x": ss.Inertial(force="-a")},
        kinetic="d_x**2/2",
        contacts={"base": ss.Contact("d_x", 0.3)},
        span=(first, last),
    )


WRONG = {
    "unknown kind 'cubik'": ([0.0, 1.0], [0.0, 1.0], "cubik", False),
    "2 times and 3 values": ([0.0, 1.0], [0.0, 1.0, 2.0], "linear", False),
    "times[2]: the time 1 occurs twice": ([0.0, 1.0, 1.0], [0.0, 1.0, 2.0], "linear", False),
    "times[2]: the time 0.5 comes after 1": ([0.0, 1.0, 0.5], [0.0, 1.0, 2.0], "linear", False),
    "values[1]: nan is not a number": ([0.0, 1.0], [0.0, np.nan], "linear", False),
    "times: expected numbers, got [0.0": ([0.0, "x"], [0.0, 1.0], "linear", False),
    "they begin with 0 and end with 1": ([0.0, 1.0], [0.0, 1.0], "linear", True),
    "too close to each other": ([1e9, 1e9 + 1e-6], [0.0, 1.0], "linear", False),
}


@pytest.mark.parametrize("reason", WRONG)
def test_wrong_samples(reason: str) -> None:
    """The row is named, and what would be right."""
    times, values, kind, periodic = WRONG[reason]
    with pytest.raises(ss.DeclarationError) as error:
        ss.Samples(times, values, kind=kind, periodic=periodic)
    assert reason in str(error.value) and error.value.remedy


FILES = {
    "line 3, column 'a': 'x' is not a number": "t,a\n0,1\n1,x\n",
    "line 3, column 'a': the value is missing": "t,a\n0,1\n1\n",
    "line 4, column 't': the time 0 occurs twice": "# base\nt;a\n0;1\n0;2\n",
    "line 3, column 't': the time 0 comes after 1": "t\ta\n1\t2\n0\t3",
    "line 3, column 'a': nan is not a number": "t a\n0 1\n1 nan\n",
    "unknown column 'a'. Known here: t, acc": "t,acc\n0,1\n1,2\n",
    "there is no sample between 0.4 and 0.9. Fill the gap": "t,a\n"
    + "".join(f"{0.1 * i:.1f},1\n" for i in range(30) if not 4 < i < 9),
    "the file is empty": "\n",
    "not a text file": "\0\1\2",
    "no such file": None,
}


@pytest.mark.parametrize("reason", FILES)
def test_wrong_files(reason: str, tmp_path: Path) -> None:
    """The line and the column are named."""
    text = FILES[reason]
    if text is not None:
        (tmp_path / "base.csv").write_text(text)
    with pytest.raises(ss.DeclarationError) as error:
        ss.Samples.read(tmp_path / "base.csv", "t", "a")
    assert reason in str(error.value) and error.value.remedy


def test_gaps(tmp_path: Path) -> None:
    """Between even steps one is allowed on request, or in what is held; between others always."""
    (tmp_path / "base.csv").write_text(next(t for r, t in FILES.items() if "between" in r) or "")
    read = ss.Samples.read(tmp_path / "base.csv", "t", "a", gaps=True)
    assert len(read.times) == 26
    assert ss.Samples.read(tmp_path / "base.csv", "t", "a", "hold").kind == "hold"
    model = shaken(ss.Samples([0, 2], [1, 3])).to_toml()
    listed = "{times = [0.0, 2.0], values = [1.0, 3.0]}"
    for gaps, refused in (("true", False), ("false", True), ("1", True)):
        named = '{file = "base.csv", time = "t", value = "a", gaps = ' + gaps + "}"
        (tmp_path / "shaken.toml").write_text(model.replace(listed, named))
        if refused:
            with pytest.raises(ss.DeclarationError, match="gap"):
                ss.load(tmp_path / "shaken.toml")
        else:
            (found,) = ss.load(tmp_path / "shaken.toml").drives.values()
            assert found == read
    (tmp_path / "base.csv").write_text("t,a\n0,0\n1,1\n1.1,0\n9,0\n")
    assert len(ss.Samples.read(tmp_path / "base.csv", "t", "a").times) == 4


def test_files(tmp_path: Path) -> None:
    """Commas, semicolons, tabs and blanks; a model file names its samples beside it."""
    for separator in (",", ";", "\t", "  "):
        lines = [separator.join(row) for row in (("t", "b", "a"), ("0", "9", "1"), ("2", "9", "3"))]
        (tmp_path / "base.csv").write_text("# measured\n" + "\n".join(lines))
        assert ss.Samples.read(tmp_path / "base.csv", "t", "a") == ss.Samples([0, 2], [1, 3])
    model = shaken(ss.Samples([0, 2], [1, 3])).to_toml()
    named = model.replace(
        "{times = [0.0, 2.0], values = [1.0, 3.0]}", '{file = "base.csv", time = "t", value = "a"}'
    )
    assert named != model
    (tmp_path / "shaken.toml").write_text(named)
    assert ss.load(tmp_path / "shaken.toml") == shaken(ss.Samples([0, 2], [1, 3]))
    (tmp_path / "shaken.toml").write_text(named.replace('"base.csv"', '"base.cvs"'))
    with pytest.raises(ss.DeclarationError, match=r"base\.cvs: no such file"):
        ss.load(tmp_path / "shaken.toml")


def test_spans_that_are_not_covered() -> None:
    """Refused when a system is declared, and when it is moved."""
    samples = ss.Samples([0.0, 5.0], [0.0, 1.0])
    with pytest.raises(ss.DeclarationError, match=r"drives\.a: the samples cover 0 \.\.\. 5"):
        ss.System(
            name="shaken",
            drives={"a": samples},
            coordinates={"x": ss.Inertial(force="-a")},
            kinetic="d_x**2/2",
            span=(0.0, 6.0),
        )
    with pytest.raises(ss.DeclarationError, match=r"the time span is 0 \.\.\. 5\.1"):
        ss.simulate(shaken(samples), (0.0, 5.1))


def test_the_span_that_stands_if_none_is_given_ends_with_the_samples(tmp_path: Path) -> None:
    parts: dict[str, Any] = {
        "coordinates": {"x": ss.Inertial()},
        "kinetic": "d_x**2/2",
        "potential": "x**2/2 - a*x",
    }
    late, early = ss.Samples([2.0, 7.0], [0.0, 1.0]), ss.Samples([-1.0, 5.0], [0.0, 1.0])
    again = ss.Samples([0.0, 1.0, 2.0], [0.0, 1.0, 0.0], periodic=True)
    for drives, span in (
        ({"a": late}, (2.0, 7.0)),
        ({"a": late, "b": early}, (2.0, 5.0)),
        ({"a": again}, (0.0, 100.0)),
        ({"a": "sin(t)"}, (0.0, 100.0)),
    ):
        system = ss.System("driven", drives=drives, **parts)
        assert system.span == span and ss.simulate(system).t_span == span
    driven = ss.System("driven", drives={"a": "sin(t)"}, **parts).configure({"a": late})
    assert driven.span == (2.0, 7.0)
    assert driven.configure({"a": "sin(t)"}).span == (0.0, 100.0)
    asked: list[Any] = [(0.0, 3.0), (0.0, 100.0), [0, 100]]
    for span in asked:
        with pytest.raises(DeclarationError, match="samples cover"):
            ss.simulate(ss.System("driven", drives={"a": late}, span=span, **parts))


def test_a_span_that_is_given_as_the_default_is_given() -> None:
    """Nothing shortens it, also not after a file, a copy or a change of parameters."""
    late = ss.Samples([2.0, 7.0], [0.0, 1.0])
    parts: dict[str, Any] = {
        "parameters": {"k": ss.Parameter(1.0)},
        "drives": {"a": "sin(t)"},
        "coordinates": {"x": ss.Inertial()},
        "kinetic": "d_x**2/2",
        "potential": "k*x**2/2 - a*x",
    }
    asked = ss.System("driven", span=(0.0, 100.0), **parts)
    own = ss.System("driven", **parts)
    assert "span" in asked.to_toml() and "span" not in own.to_toml()
    for change in (
        lambda s: s,
        lambda s: loads(s.to_toml()),
        lambda s: pickle.loads(pickle.dumps(s)),
        lambda s: s.with_parameters(k=2.0),
        lambda s: s.plain,
    ):
        assert replace(change(own), drives={"a": late}).span == (2.0, 7.0)
        with pytest.raises(DeclarationError, match=r"samples cover 2 \.\.\. 7"):
            replace(change(asked), drives={"a": late})


TABLES = {
    "byte order mark": (b"\xef\xbb\xbft,x\n0,1\n1,2\n2,3\n", ""),
    "semicolons": (b"t;x\n0;1\n1;2\n2;3\n", ""),
    "blanks": (b" t   x\n 0   1\n1 2\n2 3\n", ""),
    "line ends": (b"t,x\r\n0,1\r\n1,2\r\n2,3\r\n", ""),
    "comments": (b"# of Tuesday, at noon\nt,x\n0,1\n1,2\n2,3\n", ""),
    "empty": (b"", "is empty"),
    "only blanks": (b" \n\n", "is empty"),
    "decimal commas": (b"t;x\n0,0;1,0\n1,0;2,0\n2,5;3,5\n", "decimal points"),
    "decimal commas, commas": (b"t,x\n0,0,1,0\n1,0,2,0\n2,5,3,5\n", "decimal points"),
    "UTF-16": ("t,x\n0,1\n".encode("utf-16"), "not a text file|not UTF-8"),
    "Latin": ("t,x\n0,1\n# Größe\n".encode("latin-1"), "not UTF-8"),
    "binary": (bytes(range(256)), "not a text file"),
}


@pytest.mark.parametrize("name", TABLES)
def test_tables_of_both_readers(tmp_path: Path, name: str) -> None:
    """Drives and records read the same tables, and refuse the same by the name of the file."""
    content, wrong = TABLES[name]
    file = tmp_path / "table.csv"
    file.write_bytes(content)
    readers: tuple[Any, ...] = (ss.Samples.read, lambda f: ss.Recording(f).column("x"))
    for read in readers:
        if wrong:
            with pytest.raises(DeclarationError, match=rf"table\.csv.*({wrong})"):
                read(file)
        else:
            found = read(file)
            values = found.values if isinstance(found, ss.Samples) else found
            np.testing.assert_array_equal(values, [1.0, 2.0, 3.0])


def test_what_is_no_table(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    places = {
        tmp_path: "a directory",
        tmp_path / "fifo": "not a regular file",
        Path("/dev/zero"): "not a regular file",
        tmp_path / "none.csv": "no such file",
        tmp_path / ("x" * 5000): "cannot be read",
    }
    for place, said in places.items():
        for read in (ss.Samples.read, ss.Recording):
            with pytest.raises(DeclarationError, match=said) as raised:
                read(place)
            assert len(str(raised.value)) < 300
