"""Connected components of {G ≥ 0}, and sets of equilibria that are such: against closed forms."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import stickslip as ss
from stickslip.orbits.equilibria.level_extents import extents
from stickslip.orbits.equilibria.level_sets import LevelSet
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

X, Y = ex.sym("x"), ex.sym("y")
WELLS = "0.383*x**2 + 1.345/2.319*sin(2.319*x)"


def components(
    *conditions: Expr, core: tuple[tuple[float, float], ...] = ((-64.0, 64.0),)
) -> list[list[tuple[float, float]]]:
    """Ends of all components by unknown, proved, in order."""
    names = ("x", "y")[: len(core)]
    cover = LevelSet(conditions, names, {}, np.array(core).T).components()
    assert cover.undecided.shape[2] == 0
    assert cover.beyond.shape[2] == 0
    ends, gaps = extents(cover, [ex.sym(x) for x in names])
    assert np.max(gaps, initial=0.0) < 1e-10 * (1.0 + np.max(np.abs(ends), initial=0.0))
    return in_order([(float(low), float(high)) for low, high in part] for part in ends)


def in_order(parts: Iterable[list[tuple[float, float]]]) -> list[list[tuple[float, float]]]:
    return sorted(parts, key=lambda part: np.round(part, 6).tolist())


def disc(x: float, y: float, r: float) -> Expr:
    return r**2 - (X - x) ** 2 - (Y - y) ** 2


# -- level sets ------------------------------------------------------------------------------------


@settings(max_examples=15, deadline=None)
@given(steps=st.lists(st.floats(-6.0, 1.0), min_size=1, max_size=7).filter(lambda s: len(s) % 2))
def test_roots_of_any_distance(steps: list[float]) -> None:
    """−(x − r₁)(x − r₂)… ≥ 0 between roots in pairs, however near they are."""
    roots = np.cumsum([-3.3, *(10.0**s for s in steps)])
    product = ex.multiply(*(X - float(r) for r in roots))
    found = components(-product)
    for (ends,), pair in zip(found, roots.reshape(-1, 2), strict=True):
        assert ends == pytest.approx(pair, abs=1e-10)


@settings(max_examples=6, deadline=None)
@given(
    a=st.floats(0.3, 2.0),
    nearness=st.floats(-4.0, -0.5),
    one=st.booleans(),
    along=st.booleans(),
    centre=st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)),
)
def test_ovals_of_cassini(
    a: float, nearness: float, one: bool, along: bool, centre: tuple[float, float]
) -> None:
    """The product of the distances from (± a, 0) is at most b²: two sets, or one if b > a."""
    b = a * (1.0 + (1.0 if one else -1.0) * 10.0**nearness)
    u, v = (X - centre[0], Y - centre[1]) if along else (Y - centre[1], X - centre[0])
    found = components(b**4 - ((u - a) ** 2 + v**2) * ((u + a) ** 2 + v**2), core=((-64, 64),) * 2)
    far = math.sqrt(a**2 + b**2)
    across = math.sqrt(b**2 - a**2) if b > a * math.sqrt(2.0) else b**2 / (2.0 * a)
    near = math.sqrt(max(a**2 - b**2, 0.0))
    spans = [(-far, far)] if one else [(-far, -near), (near, far)]
    expected = []
    for span in spans:
        pair = [span, (-across, across)] if along else [(-across, across), span]
        expected.append([(c + e[0], c + e[1]) for c, e in zip(centre, pair, strict=True)])
    assert np.array(found) == pytest.approx(np.array(in_order(expected)), abs=1e-9)


@settings(max_examples=6, deadline=None)
@given(
    angle=st.floats(0.0, 6.28),
    radii=st.tuples(st.floats(0.2, 2.0), st.floats(0.2, 2.0)),
    apart=st.floats(-4.0, 0.0),
)
def test_discs_that_nearly_meet(angle: float, radii: tuple[float, float], apart: float) -> None:
    r, s = radii
    d = (r + s) * (1.0 + 10.0**apart)
    x, y = d * math.cos(angle), d * math.sin(angle)
    found = components(ex.maximum(disc(0, 0, r), disc(x, y, s)), core=((-64, 64),) * 2)
    expected = in_order([[(-r, r), (-r, r)], [(x - s, x + s), (y - s, y + s)]])
    assert np.array(found) == pytest.approx(np.array(expected), abs=1e-9)


def test_boxes_are_where_they_are_said_to_be() -> None:
    """Boxes inside are inside, and a set has the area that it must have."""
    ring = ex.minimum(disc(0, 0, 1), -disc(0, 0, 0.4))
    cover = LevelSet(
        (ex.maximum(ring, disc(0.1, 0, 0.1)),), ("x", "y"), {}, np.full((2, 2), 9.0) * [[-1], [1]]
    ).components()
    assert cover.count == 2
    areas = sorted(cover.size(c) for c in range(2))
    for (least, most), area in zip(areas, (math.pi * 0.01, math.pi * (1 - 0.16)), strict=True):
        assert least <= area <= most
    for c in range(2):
        x, y = cover.centre(c)
        assert (math.hypot(x - 0.1, y) < 0.1) or 0.4 < math.hypot(x, y) < 1.0
    own = cover.inside
    for corner in (cover.low[:, own], cover.high[:, own]):
        r = np.hypot(*corner)
        assert np.all(((r >= 0.4) & (r <= 1.0)) | (np.hypot(corner[0] - 0.1, corner[1]) <= 0.1))


def test_what_rounding_decides_is_undecided() -> None:
    """Two intervals, or one: they touch at 1."""
    touching = 4.0 - 8.0 * X + 3.0 * X**2 + 2.0 * X**3 - X**4  # (x − 1)²(4 − x²)
    cover = LevelSet((touching,), ("x",), {}, np.array([[-9.0], [9.0]]))
    found = cover.components()
    assert found.undecided.shape[2] > 0
    assert found.undecided[:, 0] == pytest.approx(1.0, abs=1e-6)


def test_far_out() -> None:
    """What is beyond all boxes is decided, too: x/(1 + x²) falls, x⁵ − x³ rises."""
    endless = components(0.4 - X / (1.0 + X**2), 0.4 + X / (1.0 + X**2))
    assert np.array(endless) == pytest.approx(
        np.array([[(-math.inf, -2.0)], [(-0.5, 0.5)], [(2.0, math.inf)]]), abs=1e-10
    )
    ((ends,),) = components(1.0 - (X**5 - X**3), X**5 - X**3 + 1.0)
    assert ends[1] == pytest.approx(np.roots([1, 0, -1, 0, 0, -1])[0].real)
    # The corner between two lines that no condition excludes by itself.
    force = [3.0 * X - 2.0 * Y + ex.call("sin", X), 3.0 * Y - 2.0 * X]
    assert len(components(*(1.0 + s * f for f in force for s in (-1, 1)), core=((-9, 9),) * 2)) == 1


def test_where_formulas_are_defined() -> None:
    root = ex.power(X, ex.num(0.5))
    assert components(2.0 - root) == [[pytest.approx((0.0, 4.0), abs=1e-10)]]
    guarded = ex.select(X, 2.0 - root, X + 1.0)
    assert components(guarded) == [[pytest.approx((-1.0, 4.0), abs=1e-10)]]
    assert components(1.0 - X**-2, 3.0 - X, X + 3.0) == [
        [pytest.approx((-3.0, -1.0))],
        [pytest.approx((1.0, 3.0))],
    ]


# -- sets of equilibria ----------------------------------------------------------------------------


def block(potential: str, threshold: Any = 1.0, kind: Any = ss.Inertial, **more: Any) -> ss.System:
    return ss.System(
        "block",
        coordinates={"x": kind()},
        kinetic="d_x**2/2" if kind is ss.Inertial else 0.0,
        viscous="d_x**2/2" if kind is ss.Viscous else 0.0,
        potential=potential,
        contacts={"b": ss.Contact("d_x", threshold), **more},
    )


def ends(found: ss.Equilibria, name: str = "x") -> list[tuple[float, float]]:
    assert found.certificate.ok, found.message
    assert all(s.exact and s.certificate.ok for s in found.sets)
    return [s.extent[name] for s in found.sets]


@pytest.mark.parametrize("kind", [ss.Inertial, ss.Viscous, ss.RateIndependent])
@pytest.mark.parametrize("box", [None, {"x": (-4.0, 4.0)}, {"x": (-2.5, 0.0)}])
def test_wells(kind: Any, box: dict[str, tuple[float, float]] | None) -> None:
    system = block(WELLS, kind=kind)
    found = ends(ss.equilibria(system, box=box))
    exact = [
        (-2.8973181555458, -2.2882277312656),
        (-0.8026118612596, -0.2222659008947),
        (0.4610015373158, 1.8866161732330),
    ]
    exact = exact[:2] if box and box["x"][1] == 0.0 else exact
    assert np.array(found) == pytest.approx(np.array(exact), abs=1e-12)


def test_motions_agree_about_the_gaps() -> None:
    system = block(WELLS)
    sets = ends(ss.equilibria(system))
    for x in (-2.6, -1.5, -0.5, 0.0, 1.0, 2.0):
        rests = any(low <= x <= high for low, high in sets)
        motion = ss.simulate(system, (0.0, 5.0), initial={"x": x})
        assert (abs(motion.final["x"] - x) < 1e-12) == rests


def test_disc_and_ring() -> None:
    system = ss.System(
        "hat",
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential="(x**2 + y**2 - 1)**2",
        contacts={"b": ss.Contact(("d_x", "d_y"), 0.5)},
    )
    found = ss.equilibria(system)
    ring, inner = found.sets
    radii = sorted(r.real for r in np.roots([4, 0, -4, -0.5]))  # 4 r (r² − 1) = ± 0.5
    assert ring.extent["y"] == pytest.approx((-radii[2], radii[2]), abs=1e-10)
    assert inner.extent["x"] == pytest.approx((radii[1], -radii[1]), abs=1e-10)
    assert -radii[0] < math.hypot(ring.state["x"], ring.state["y"]) < radii[2]
    assert ring.dimension == inner.dimension == 2
    assert "(a bounding box)" in ring.describe()
    assert found.certificate.ok


def test_kinks_and_jumps() -> None:
    # x² − 1 = ± 0.3 on both sides of a kink; a threshold that falls from 2 to 1 at 1.5.
    ends_of_kink = np.sqrt([[0.7, 1.3]])
    assert np.array(ends(ss.equilibria(block("abs(x)**3/3 - abs(x)", 0.3)))) == pytest.approx(
        np.concatenate([-ends_of_kink[:, ::-1], ends_of_kink]), abs=1e-12
    )
    found = ss.equilibria(block("x**2/2", "piecewise(x < 1.5, 2, 1 + sin(x)**2/9)"))
    assert np.array(ends(found)) == pytest.approx(np.array([[-2.0, 1.5]]), abs=1e-12)


def test_forces_that_the_state_does_not_determine() -> None:
    brakes = block(WELLS, 0.4, c=ss.Contact("2*d_x", 0.3))
    assert np.array(ends(ss.equilibria(brakes))) == pytest.approx(
        np.array(ends(ss.equilibria(block(WELLS)))), abs=1e-12
    )


def test_a_lever_that_vanishes() -> None:
    # a − sin a = λ cos a with −0.5 ≤ λ ≤ 0.4.
    arm = ss.System(
        "arm",
        coordinates={"a": ss.Inertial()},
        kinetic="d_a**2/2",
        potential="a**2/2 + cos(a)",
        contacts={"b": ss.Contact("cos(a)*d_a", (0.5, 0.4))},
    )
    ((low, high),) = ends(ss.equilibria(arm), "a")
    assert low - math.sin(low) == pytest.approx(-0.5 * math.cos(low), abs=1e-12)
    assert high - math.sin(high) == pytest.approx(0.4 * math.cos(high), abs=1e-12)


def test_what_is_not_proved_is_said(tmp_path: Any) -> None:
    touching = ss.equilibria(block("x**4/4 - x**3/3", 4 / 27))
    assert not touching.certificate.ok
    assert "not complete: " in touching.message
    chain = ss.System(
        "chain",
        coordinates={f"x{i}": ss.Viscous() for i in range(4)},
        viscous="+".join(f"d_x{i}**2/2" for i in range(4)),
        potential="+".join(f"x{i}**2/2 + x{i}**4/4" for i in range(4)),
        contacts={f"b{i}": ss.Contact(f"d_x{i}", 0.5) for i in range(4)},
    )
    found = ss.equilibria(chain)
    assert len(found.sets) == 1
    assert not found.certificate.ok
    assert not found.sets[0].exact
    assert "not complete: " in found.message
    many = ss.equilibria(block("sin(x) + cos(sqrt(2)*x)", 0.5))
    assert "sets outside -64 ≤ x ≤ 64 were not searched" in many.message
    assert not many.certificate.ok
    many.save(tmp_path / "many.nc")
    assert ss.open(tmp_path / "many.nc").message == many.message


# -- points in them --------------------------------------------------------------------------------


def test_a_point_is_in_a_set_or_not() -> None:
    """Gaps and holes are not part of sets, however far their extents reach."""
    rng = np.random.default_rng(0)
    for kind in (ss.Inertial, ss.Viscous, ss.RateIndependent):
        found = ss.equilibria(block(WELLS, "1 + 0.3*cos(x)", kind))
        for x in rng.uniform(-4.0, 4.0, 60):
            margin = 1 + 0.3 * math.cos(x) - abs(0.766 * x + 1.345 * math.cos(2.319 * x))
            assert found.contains({"x": float(x)}) == (margin >= 0.0)
    assert not ss.equilibria(block(WELLS)).contains({"x": -1.5})


def test_points_in_a_plane() -> None:
    hat = ss.System(
        "hat",
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential="(x**2 + y**2 - 1)**2",
        contacts={"b": ss.Contact(("d_x", "d_y"), 0.5)},
    )
    found = ss.equilibria(hat)
    rng = np.random.default_rng(1)
    for x, y in rng.uniform(-1.2, 1.2, (80, 2)):
        r = math.hypot(x, y)
        assert found.contains({"x": float(x), "y": float(y)}) == (4 * r * abs(r * r - 1) <= 0.5)
    assert not found.contains({"x": 0.0, "y": 0.0, "d_x": 1e-3})


def test_points_of_polyhedra_and_isolated_equilibria() -> None:
    pair = ss.System(
        "pair",
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential="x**2/2 + (y - x)**2/2",
        contacts={"a": ss.Contact("d_x", 1.0)},
    )
    found = ss.equilibria(pair)
    assert found.contains({"x": 0.5, "y": 0.5})
    assert not found.contains({"x": 0.5, "y": 0.6})
    assert not found.contains({"x": 1.1, "y": 1.1})
    belt = ss.equilibria(ss.catalogue.belt_block(V=0.3))
    (one,) = belt.isolated
    assert belt.contains(one.state)
    assert not belt.contains({**one.state, "x": one.state["x"] + 1e-3})
    with pytest.raises(ss.DeclarationError, match=r"point\.y: the value is missing"):
        found.contains({"x": 0.5})
    with pytest.raises(ss.DeclarationError, match="z: not a part of the state"):
        found.contains({"x": 0.5, "y": 0.5, "z": 1.0})


def test_variables_that_nothing_restricts() -> None:
    """Bristles may be bent by any amount while the mass rests at its goal."""
    found = ss.equilibria(ss.catalogue.lugre_positioner())
    (rest,) = found.sets
    assert found.certificate.ok, found.message
    assert rest.extent["x"] == (1.0, 1.0) and rest.dimension == 1
    assert rest.extent["z_guide"] == (-math.inf, math.inf)
    assert found.contains({"x": 1.0, "e": -1e5 * 1e-6 / 4.0, "z_guide": 1e-6})
    assert not found.contains({"x": 1.0, "e": 0.0, "z_guide": 1e-6})


def test_what_is_zero_nowhere() -> None:
    """The first belt of the conveyor always bears a little: there is no slip on both that is
    steady, only the second belt carries the parcel away."""
    found = ss.equilibria(ss.catalogue.conveyor())
    (carried,) = found.sets
    assert found.certificate.ok, found.message
    low, high = carried.extent["x"]
    assert abs(low) < 1e-9 and high == math.inf
    assert carried.drift == {"y": pytest.approx(0.8)}
    assert found.contains({"x": 0.1, "y": 3.0}) and not found.contains({"x": -0.1, "y": 3.0})
