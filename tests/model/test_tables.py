"""Tables: what they are as functions, in files, and what is wrong with some."""

from __future__ import annotations

import ctypes
import pickle
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import (
    CubicSpline,
    PchipInterpolator,
    RectBivariateSpline,
    RegularGridInterpolator,
)
from tests.tables import spring

import stickslip as ss
from stickslip.errors import DeclarationError
from stickslip.machine_code.objects import address_of
from stickslip.model.entries.tables import OUTSIDE, TABLE_KINDS
from stickslip.model.system_file import loads
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.boxes import enclosures, slopes
from stickslip.symbolic.enclosures import bounds
from stickslip.symbolic.functions import FUNCTIONS

_FUNCTION = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)


def random(seed: int, count: int, kind: Any, outside: Any = "refused") -> ss.Table:
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.uniform(0.05, 1.0, count)) - 2.0
    return ss.Table(points, rng.normal(size=count), kind, outside)


def holding(table: ss.Table) -> ss.System:
    """A system in which formulas may call F."""
    return spring("0", tables={"F": table})


@pytest.mark.parametrize("kind", TABLE_KINDS)
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000), count=st.integers(2, 12))
def test_values_slopes_and_integrals(kind: Any, seed: int, count: int) -> None:
    """Those of SciPy, as expressions, in machine code and as arrays."""
    table = random(seed, count, kind)
    (x,) = table.axes
    inside = np.random.default_rng(seed + 1).uniform(x[0], x[-1], 30)
    area: list[Any] = []
    if kind == "linear" or count == 2:
        wanted = np.interp(inside, x, table.values)
        steep = (np.diff(table.values) / np.diff(x))[np.searchsorted(x, inside) - 1]
    else:
        curve = (PchipInterpolator if kind == "pchip" else CubicSpline)(x, table.values)
        wanted, steep = curve(inside), curve(inside, 1)
        origin = min(max(0.0, x[0]), x[-1])
        area = [curve.integrate(origin, place) for place in inside[:6]]
    scale = np.max(np.abs(wanted)) + 1.0
    np.testing.assert_allclose(table(inside), wanted, rtol=0, atol=1e-12 * scale)
    system = holding(table)
    said = {
        name: np.array([system.evaluate(f"{name}(x)", {"x": v}) for v in inside[:6]])
        for name in ("F", "d_F", "integral_F")
    }
    np.testing.assert_allclose(said["F"], wanted[:6], rtol=0, atol=1e-12 * scale)
    slack = 1e-11 * (1.0 + np.max(np.abs(steep)))
    np.testing.assert_allclose(said["d_F"], steep[:6], rtol=0, atol=slack)
    if kind != "linear" and count > 2:
        np.testing.assert_allclose(said["integral_F"], area, rtol=0, atol=1e-11 * scale)
    for name in [n for n in FUNCTIONS if n.startswith(f"table_F_{table.digest}")]:
        called, row = _FUNCTION(address_of(name)), FUNCTIONS[name]
        assert np.array_equal([called(v) for v in inside], row.array(inside))


def test_an_integral_is_zero_at_zero_and_its_slope_is_the_curve() -> None:
    table = ss.Table([-1.0, 0.5, 2.0], [1.0, 3.0, -1.0], outside="linear")
    system = holding(table)
    assert system.evaluate("integral_F(0)") == 0.0
    energy = system.declaration.scope.parse("integral_F(x)", "here")
    force = ex.derivative(energy, "x")
    for x in (-4.0, -1.0, 0.2, 0.5, 1.9, 7.0):
        assert ex.evaluate(force, {"x": x}) == pytest.approx(float(table(x)), abs=1e-14)
    assert ex.to_text(energy) == "integral_F(x)" and ex.to_text(force) == "F(x)"
    late = holding(ss.Table([1.0, 2.0], [1.0, 1.0]))
    assert late.evaluate("integral_F(1)") == 0.0 and late.evaluate("integral_F(1.5)") == 0.5


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    kind=st.sampled_from(TABLE_KINDS),
    outside=st.sampled_from(OUTSIDE),
)
def test_enclosures(seed: int, kind: Any, outside: Any) -> None:
    """No value and no quotient of differences leaves what is said of a box, across knots and ends
    too; and what is said is close."""
    table = random(seed, 8, kind, outside)
    (x,) = table.axes
    rng = np.random.default_rng(seed)
    reach = 0.0 if outside == "refused" else 0.7
    ends = np.sort(rng.uniform(x[0] - reach, x[-1] + reach, (2, 12)), axis=0)
    expression = holding(table).declaration.scope.parse("F(x)", "here")
    (value,) = enclosures([expression], {"x": (ends[0], ends[1])})
    ((_, slope),) = slopes([expression], {"x": (ends[0], ends[1])}, "x")
    for k in range(ends.shape[1]):
        low, high = float(ends[0, k]), float(ends[1, k])
        fine = np.union1d(np.linspace(low, high, 300), x[(x > low) & (x < high)])
        found = table(fine)
        assert value[0, k] <= found.min() and found.max() <= value[1, k]
        assert (value[0, k], value[1, k]) == bounds(expression, {"x": (low, high)})
        spread = 0.02 * (1.0 + np.ptp(found)) + 0.1 * (high - low)
        assert value[0, k] >= found.min() - spread and value[1, k] <= found.max() + spread
        quotients = np.diff(found) / np.diff(fine)
        slack = 1e-9 * (1.0 + np.max(np.abs(quotients)))
        assert slope[0, k] <= quotients.min() + slack
        assert quotients.max() <= slope[1, k] + slack


def test_a_value_at_its_least_is_not_said_to_stay_off_it() -> None:
    from stickslip.symbolic.enclosures import sure_sign

    expression = holding(ss.Table([0, 1, 2], [1, 0, 1])).declaration.scope.parse("F(x)", "here")
    assert sure_sign(expression, {}) == 0
    samples = ss.Samples([0.0, 1.0, 2.0], [1.0, 0.0, 1.0])
    assert sure_sign(samples.at(ex.sym("t")), {}) == 0


@pytest.mark.parametrize("kind", ["linear", "cubic"])
def test_surfaces(kind: Any) -> None:
    """Those of SciPy, slopes by differences, and enclosures."""
    rng = np.random.default_rng(4)
    x, y = np.cumsum(rng.uniform(0.2, 1, 6)), np.cumsum(rng.uniform(0.2, 1, 5))
    z = rng.normal(size=(6, 5))
    table = ss.Table((x, y), z, kind, outside="constant")
    at = rng.uniform([x[0], y[0]], [x[-1], y[-1]], (60, 2))
    wanted = (
        RegularGridInterpolator((x, y), z)(at)
        if kind == "linear"
        else RectBivariateSpline(x, y, z, s=0)(at[:, 0], at[:, 1], grid=False)
    )
    np.testing.assert_allclose(table(at[:, 0], at[:, 1]), wanted, atol=1e-12)
    system = ss.System(
        "plane", internal={"a": ss.Internal(0), "b": ss.Internal(0)}, tables={"f": table}
    )
    expression = system.declaration.scope.parse("f(a, b)", "here")
    for (a, b), value in zip(at, wanted, strict=True):
        assert ex.evaluate(expression, {"a": a, "b": b}) == pytest.approx(value, abs=1e-12)
        low, high = bounds(expression, {"a": (a, a + 0.01), "b": (b, b + 0.01)})
        assert low <= value <= high
    slope = ex.derivative(expression, "b")
    (a, b), h = at[0], 1e-6
    rise = (table(a, b + h) - table(a, b - h)) / (2 * h)
    assert ex.evaluate(slope, {"a": a, "b": b}) == pytest.approx(rise, abs=1e-6)
    assert table(x[0] - 9.0, y[2]) == pytest.approx(z[0, 2], abs=1e-12)


def test_outside() -> None:
    """Nothing, the value at the end, or the line on which it ends; another thing on each side."""
    points, values = [0.0, 1.0, 3.0], [1.0, 2.0, 0.0]
    sides: list[Any] = ["refused", "constant", "linear", ("constant", "linear")]
    refused, constant, linear, mixed = (
        ss.Table(points, values, outside=outside) for outside in sides
    )
    assert np.isnan(refused([-0.1, 3.1])).all() and refused(3.0) == 0.0
    assert constant([-5.0, 9.0]).tolist() == [1.0, 0.0]
    assert linear([-5.0, 9.0]).tolist() == [-4.0, -6.0]
    assert mixed([-5.0, 9.0]).tolist() == [1.0, -6.0]
    system = holding(refused)
    assert np.isnan(system.evaluate("F(x)", {"x": 3.1})) and system.evaluate("F(3)") == 0.0
    with pytest.raises(DeclarationError, match=r"the table 'F' covers 0 to 3, not 4"):
        spring("F(4)*x", tables={"F": refused})


def test_an_argument_that_stays_inside_has_no_event_at_the_end() -> None:
    """abs(v) does not come below 0, so that nothing happens there."""
    table = ss.Table([0.0, 1.0], [1.0, 0.5], outside=("refused", "constant"))
    inner, outer = (
        spring("0", tables={"F": table}).declaration.scope.parse(text, "here")
        for text in ("F(abs(x))", "F(x)")
    )
    rows: list[Any] = [FUNCTIONS[e.args[0].op] for e in (inner, outer)]
    pieces = [row.pieces for row in rows]
    assert [len(p.breaks) - 1 for p in pieces] == [2, 3]


def test_values_that_are_formulas() -> None:
    """A curve is linear in its values, so that it has derivatives by them."""
    rng = np.random.default_rng(2)
    points, values = np.cumsum(rng.uniform(0.1, 1, 6)), rng.normal(size=6)
    for kind in ("linear", "cubic"):
        given: list[Any] = values.tolist()
        given[2] = "p"
        given[4] = "2*q"
        table = ss.Table(points, given, kind, "constant")
        numbers = {"p": float(values[2]), "q": float(values[4]) / 2}
        system = spring(
            "0",
            tables={"F": table},
            parameters={name: ss.Parameter(value) for name, value in numbers.items()},
        )
        plain = ss.Table(points, values, kind, "constant")
        for x in np.linspace(points[0] - 1, points[-1] + 1, 20):
            assert system.evaluate("F(x)", {"x": x}) == pytest.approx(plain(x), abs=1e-12)
        moved = values.copy()
        moved[4] += 2e-3
        other = ss.Table(points, moved, kind, "constant")
        expression = ex.derivative(system.declaration.scope.parse("F(x)", "here"), "q")
        for x in (points[3] + 0.01, points[0]):
            slope = ex.evaluate(expression, {"x": x, **numbers})
            assert slope == pytest.approx((other(x) - plain(x)) / 1e-3, abs=1e-9)
        assert loads(system.to_toml()) == system
        with pytest.raises(DeclarationError, match="its values are formulas"):
            table(1.0)


def test_they_are_data(tmp_path: Path) -> None:
    """Equal if their content is; pickled, and in model files of any length."""
    surface = ss.Table((np.arange(3.0), np.arange(40.0)), np.ones((3, 40)), "cubic", "linear")
    long = random(1, 300, "pchip", ("constant", "refused"))
    for table in (random(3, 5, "linear"), long, surface):
        assert pickle.loads(pickle.dumps(table)) == table
        system = ss.System("s", internal={"a": ss.Internal(0)}, tables={"F": table})
        text = system.to_toml()
        assert loads(text) == system and loads(text).tables["F"] == table
    assert random(1, 5, "linear") != random(1, 5, "pchip") != random(2, 5, "pchip")
    other = random(9, 4, "linear")
    system = spring("0", tables={"F": random(3, 5, "linear")})
    assert system.configure({"F": other}).tables["F"] == other
    assert "F(x)" in str(spring("integral_F(x)", tables={"F": other}).equations())


def test_files(tmp_path: Path) -> None:
    """Columns by their names, by the name of the table, or the only ones; surfaces in any order."""
    (tmp_path / "mu.csv").write_bytes(b"\xef\xbb\xbfspeed;mu;T\n0;1;5\n2;3;5\n")
    wanted = ss.Table([0, 2], [1, 3])
    assert ss.Table.read(tmp_path / "mu.csv", "speed", "mu") == wanted
    assert ss.Table.read(tmp_path / "mu.csv", name="mu") == wanted
    (tmp_path / "grid.csv").write_text("x y z\n0 0 1\n1 2 4\n1 0 3\n0 2 2\n")
    surface = ss.Table.read(tmp_path / "grid.csv", ("x", "y"), "z")
    assert surface == ss.Table(([0, 1], [0, 2]), [[1, 2], [3, 4]])
    text = 'name = "m"\ninternal.a = {law = "1"}\ntables.mu = {FILE}\nspan = [0, 1]\n'
    model = tmp_path / "m.toml"
    model.write_text(text.replace("FILE", 'file = "mu.csv", of = "speed", value = "mu"'))
    assert ss.load(model).tables["mu"] == wanted
    model.write_text(text.replace("FILE", 'file = "grid.csv", of = ["x", "y"]'))
    assert ss.load(model).tables["mu"] == surface


WRONG: dict[str, tuple[Any, ...]] = {
    "kind: unknown option 'cubik'": ([0, 1], [0, 1], "cubik"),
    "outside: unknown option 'no'": ([0, 1], [0, 1], "linear", "no"),
    "2 points and 3 values": ([0, 1], [0, 1, 2]),
    "1 points and 1 values": ([0], [0]),
    "points[2]: the point 1 occurs twice": ([0, 1, 1], [0, 1, 2]),
    "points[2]: the point 0.5 comes after 1. Sort the rows": ([0, 1, 0.5], [0, 1, 2]),
    "values[1]: nan is not a number": ([0, 1], [0, np.nan]),
    "points[1]: inf is not a number": ([0, np.inf], [0, 1]),
    "too close to each other": ([1e9, 1e9 + 1e-6], [0, 1]),
    "points: they are not all numbers": ([0, "x"], [0, 1]),
    "shape (2, 3), but the axes have 2 and 2": (([0, 1], [0, 1]), [[1, 2, 3], [4, 5, 6]]),
    "values[1][0]: nan is not a number": (([0, 1], [0, 1]), [[1, 2], [np.nan, 2]]),
    "axis 2, points[1]: the point 0 comes after 1": (([0, 1], [1, 0]), [[1, 2], [3, 4]]),
    "is not available for surfaces": (([0, 1], [0, 1]), [[1, 2], [3, 4]], "pchip"),
    "is not available for values that are formulas": ([0, 1], [0, "p"], "pchip"),
}


@pytest.mark.parametrize("reason", WRONG)
def test_wrong_tables(reason: str) -> None:
    """The place is named, and what would be right."""
    with pytest.raises(DeclarationError) as error:
        ss.Table(*WRONG[reason])
    assert reason in str(error.value) and error.value.remedy


FILES = {
    "line 3, column 'mu': 'x' is not a number": "v,mu\n0,1\n1,x\n",
    "line 3, column 'mu': the value is missing": "v,mu\n0,1\n1\n",
    "line 3, column 'mu': nan is not a number": "v,mu\n0,1\n1,nan\n",
    "line 4, column 'v': the point 0 occurs twice": "# dry\nv;mu\n0;1\n0;2\n",
    "line 3, column 'v': the point 0 comes after 1": "v\tmu\n1\t2\n0\t3",
    "unknown column 'mu'. Known here: v, nu": "v,nu\n0,1\n1,2\n",
    "the header line has numbers instead of column names": "0,1\n1,2\n",
    "decimal points": "v;mu\n0,0;1,0\n1,0;2,0\n",
    "the file is empty": "\n",
    "not a text file": "\0\1\2",
    "no such file": None,
}


@pytest.mark.parametrize("reason", FILES)
def test_wrong_files(reason: str, tmp_path: Path) -> None:
    """The line and the column are named."""
    text = FILES[reason]
    if text is not None:
        (tmp_path / "mu.csv").write_text(text)
    named: Any = () if reason.startswith("the header line") else ("v", "mu")
    with pytest.raises(DeclarationError) as error:
        ss.Table.read(tmp_path / "mu.csv", *named)
    assert reason in str(error.value) and error.value.remedy


def test_wrong_grids(tmp_path: Path) -> None:
    file = tmp_path / "grid.csv"
    for text, reason in (
        ("x y z\n0 0 1\n1 2 4\n1 0 3\n", "no row for x = 0, y = 2"),
        ("x y z\n0 0 1\n0 0 4\n1 0 3\n", "line 3: x = 0, y = 0 is already in line 2"),
        ("x y z\n0 nan 1\n0 1 4\n1 0 3\n", "line 2, column 'y': nan is not a number"),
        ("x y z w\n0 0 1 2\n", "it is ambiguous which column has the values"),
    ):
        file.write_text(text)
        with pytest.raises(DeclarationError, match=reason):
            ss.Table.read(file, ("x", "y"))


def test_wrong_declarations() -> None:
    table = ss.Table([0, 1], [1, 2])
    for parts, reason in (
        ({"tables": {"F": [[0, 1], [1, 2]]}}, r"tables\.F: expected a table"),
        ({"tables": {"sin": table}}, "has a fixed meaning"),
        ({"tables": {"F": table}, "functions": {"F(s)": "s"}}, "declared twice"),
        (
            {"tables": {"F": ss.Table([0, 1], ["x", 1])}},
            r"tables\.F, values\[0\]: 'x' is not allowed",
        ),
        ({"tables": {"F": ss.Table([0, 1], ["a b", 1])}}, r"values\[0\].*is not a formula"),
        ({"tables": {"F": table}, "force": "F(x, 1)"}, "takes 1 argument"),
        ({"tables": {"F": table}, "force": "F"}, "takes 1 argument"),
    ):
        with pytest.raises(DeclarationError, match=reason):
            spring("0", **cast(Any, parts))


def test_the_unit_is_anybodys() -> None:
    """What a table says is in no unit that is known, and neither is what it is asked."""
    system = ss.System(
        "spring",
        parameters={"k": ss.Parameter(2.0, "N/m"), "a": ss.Parameter(0.5, "m")},
        tables={"F": ss.Table([-9, 9], [-1, 1])},
        coordinates={"x": ss.Inertial("m", force="a*F(x + a)")},
        kinetic="d_x**2/2",
        potential="k/2*x**2 + a*integral_F(x + a)",
        time_unit="s",
    )
    assert system.unit_conflicts == []


def test_at_the_command_line(tmp_path: Path) -> None:
    from stickslip.cli.common.models import load_model

    table = ss.Table([0, 1], [1, 2])
    (tmp_path / "m.toml").write_text(spring("integral_F(x)", tables={"F": table}).to_toml())
    (tmp_path / "F.csv").write_text("x,F\n0,2\n3,4\n")
    setting = f'F={{file = "{tmp_path / "F.csv"}", of = "x", kind = "pchip"}}'
    system = load_model(str(tmp_path / "m.toml"), [setting])
    assert system.tables["F"] == ss.Table([0, 3], [2, 4], "pchip")
    with pytest.raises(DeclarationError, match=r"tables\.F: expected a table"):
        load_model(str(tmp_path / "m.toml"), ["F=x**2"])
