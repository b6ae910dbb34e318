"""Bodies on points however they are written: a point split in halves, directions turned, points in
another order, other units, normal forces in place of thresholds, a point moved along its line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import stickslip as ss
from adversarial.families.points import Carried, Point, Shape, made
from adversarial.kinds.accelerations import at_rest, scale
from adversarial.kinds.accelerations import draw as draw_instant
from stickslip.arrays import Array

CLOSE = 1e-7


def states(case: Carried) -> Array:
    """States at eleven times, in natural units, of a certified motion."""
    motion = ss.simulate(case.system, case.span, initial=case.initial, parameters=case.parameters)
    assert motion.outcome.ok, f"{motion.message}\n{case.source()}"
    assert motion.certificate.ok, f"{motion.certificate.verdict}\n{case.source()}"
    found = motion.at(np.minimum(np.linspace(0.0, case.span[1], 11), motion.knots.time[-1]))
    return np.array([np.asarray(found[name]) / case.unit(name) for name in case.names])


def in_halves(case: Carried) -> Carried:
    """The first point is two, with half of its threshold each."""
    k = len(case.shape.points)
    n = dict(case.numbers) | {f"p{a}{k}": case.numbers[f"p{a}0"] for a in "xy"}
    n |= {"s0": n["s0"] / 2.0, f"s{k}": n["s0"] / 2.0}
    shape = replace(case.shape, points=(*case.shape.points, case.shape.points[0]))
    return replace(case, shape=shape, numbers=n)


def turned(case: Carried) -> Carried:
    """Directions turn with the body."""
    points = tuple(replace(point, turned=True) for point in case.shape.points)
    return replace(case, shape=replace(case.shape, points=points))


def reversed_(case: Carried) -> Carried:
    """Points in another order."""
    last = len(case.shape.points) - 1
    own = {f"{w}{k}" for w in ("px", "py", "s") for k in range(last + 1)}
    n = {w: v for w, v in case.numbers.items() if w not in own}
    n |= {f"{w[:-1]}{last - int(w[-1])}": case.numbers[w] for w in own}
    return replace(case, numbers=n)


def rescaled(case: Carried) -> Carried:
    """In other units."""
    return replace(case, length=1e3, time=2e-4, force=7e5)


def pressed(case: Carried) -> Carried:
    """Every point is pressed by its threshold."""
    points = tuple(replace(point, pressed=True) for point in case.shape.points)
    return replace(case, shape=replace(case.shape, points=points))


def pressed_in_halves(case: Carried) -> Carried:
    """Both halves of a point are pressed by half of its threshold."""
    return pressed(in_halves(case))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "other", [in_halves, turned, reversed_, rescaled, pressed, pressed_in_halves]
)
def test_a_body_on_points(other: Callable[[Carried], Carried], seed: int) -> None:
    """The same motion."""
    case = made(np.random.default_rng([71, seed]), Shape((Point(),) * 2))
    plain = states(case)
    size = np.max(np.abs(plain)) + 1e-3
    np.testing.assert_allclose(states(other(case)), plain, rtol=0.0, atol=CLOSE * size)


@pytest.mark.parametrize("seed", [2, 3])
def test_a_point_in_unequal_parts_about_which_a_body_turns(seed: int) -> None:
    """The larger part holds what the least forces would have the smaller one hold; directions turn
    with the body meanwhile."""
    case = made(np.random.default_rng([72, seed]), Shape((Point(),) * 2), s0=1.0, s1=0.15)
    n = case.numbers | {f"p{a}2": case.numbers[f"p{a}0"] for a in "xy"} | {"s0": 0.93, "s2": 0.07}
    parts = replace(case, shape=Shape((Point(),) * 3), numbers=n)
    plain = states(case)
    size = np.max(np.abs(plain)) + 1e-3
    np.testing.assert_allclose(states(parts), plain, rtol=0.0, atol=CLOSE * size)


@pytest.mark.parametrize("seed", range(20))
def test_a_point_moved_along_its_line(seed: int) -> None:
    """What rests has the same accelerations wherever on the line of its force a point is."""
    case = draw_instant("points and lines at rest", seed)
    assert len(at_rest(case)) == len(case.holds)
    k = len(case.holds) - 1
    c, s = np.cos(case.start["th"]), np.sin(case.start["th"])
    along = np.array([case.numbers[f"la{k}"], case.numbers[f"lb{k}"]]) @ [[c, -s], [s, c]]
    moved = {
        f"p{a}{k}": case.numbers[f"p{a}{k}"] + 0.7 * x for a, x in zip("xy", along, strict=True)
    }
    found = []
    for numbers in (case.numbers, case.numbers | moved):
        motion = ss.simulate(case.system, (0.0, 1e-3), initial=case.start, parameters=numbers)
        at = motion.at(0.0)
        found.append([at[f"dd_{x}"] for x in ("x", "y", "th")])
    np.testing.assert_allclose(found[1], found[0], rtol=0.0, atol=1e-10 * scale(case))
