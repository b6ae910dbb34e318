"""The stable set |∂Φ| ≤ s of rate-independent coordinates, and the projection onto it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.derive import MotionEquations
from stickslip.equations.planes import Plane
from stickslip.model.entries.declared import Kind
from stickslip.orbits.fields.regions import values_at
from stickslip.symbolic import expressions as ex

_SWEEPS = 100  # largest number of iterations for the start of rate-independent coordinates
_BEYOND = 1e-9  # excess, relative to the forces, that counts as zero
# relative to 1 + the modulus: coordinates that friction moves by less have converged
_UNMOVED = 1e-15


def excess(
    equations: MotionEquations,
    values: Mapping[str, float | Array],
    states: Array,
    time: float = 0.0,
) -> Array:
    """Violation of |∂Φ| ≤ s by states: the largest excess of a force over its threshold, 0 inside.

    Parameters
    ----------
    values : mapping of str to float or array, shape (points,)
        Parameters.
    states : array, shape (points, states)

    Returns
    -------
    array, shape (points,)
        In the unit of the forces.
    """
    acting = [c for c in equations.contacts if c.kind == Kind.RATE_INDEPENDENT]
    wanted = [
        e
        for c, force in zip(acting, equations.rate.force, strict=True)
        if not c.plane
        for e in (force, c.plus, c.minus)
    ]
    for plane in _planes(equations):
        # |A⁻¹λ| is one force, against one threshold
        size = ex.power(ex.add(*((e**2, 1.0) for e in plane.pull)), ex.num(0.5))
        wanted += [size, plane.static, plane.static]
    if not wanted:
        return np.zeros(len(states))
    found = values_at(equations, values, states, wanted, time).reshape(-1, 3, len(states))
    force, plus, minus = np.moveaxis(found, 1, 0)
    beyond = np.maximum(-plus - force, force - minus)
    return np.max(np.where(beyond > _BEYOND * (np.abs(force) + plus + minus), beyond, 0.0), axis=0)


def settle_friction(
    equations: MotionEquations, values: Mapping[str, float], states: Array, time: float = 0.0
) -> None:
    """Move rate-independent coordinates sequentially until friction holds them; changes `states`.

    Each moves to the nearest position at which its contact holds: coordinate descent for the
    minimisation of E(x) + Σ sᵢ|xᵢ − xᵢ⁰|, which defines the jump of such a system from an unstable
    state.
    """
    rate = equations.rate
    acting = [c for c in equations.contacts if c.kind == Kind.RATE_INDEPENDENT]
    rows = [equations.declaration.state.index(next(iter(c.direction))) for c in acting]
    alone = [i for i, c in enumerate(acting) if not c.plane]
    # Contacts whose forces and thresholds do not depend on each other's positions move together.
    asked = {i: (rate.force[i], acting[i].plus, acting[i].minus, rate.partial[i][i]) for i in alone}
    names = {i: next(iter(acting[i].direction)) for i in alone}
    coupled = any(names[j] in e.symbols for i in alone for e in asked[i] for j in alone if j != i)
    groups = [[i] for i in alone] if coupled else [alone] if alone else []
    for _ in range(_SWEEPS if acting else 0):
        moved = 0.0
        for group in groups:
            wanted = [e for i in group for e in asked[i]]
            found = values_at(equations, values, states, wanted, time)
            for i, (force, plus, minus, slope) in zip(
                group, found.reshape(-1, 4, len(states)), strict=True
            ):
                beyond = np.maximum(force - minus, 0.0) + np.minimum(force + plus, 0.0)
                step = np.where(slope != 0.0, -beyond / np.where(slope != 0.0, slope, 1.0), 0.0)
                moved = max(moved, _moved(states, rows[i], step))
        for plane in _planes(equations):
            moved = max(moved, _settle_plane(equations, plane, values, states, time))
        if moved < _UNMOVED:
            return


def _moved(states: Array, row: int, step: Array) -> float:
    """Move a coordinate of all states; returns the displacement relative to the positions."""
    states[:, row] += step
    return float(np.max(np.abs(step)) / (1.0 + np.max(np.abs(states[:, row]))))


def _planes(equations: MotionEquations) -> list[Plane]:
    """Contacts in a plane of rate-independent coordinates."""
    kinds = [c.kind for c in equations.contacts]
    return [p for p in equations.planes if kinds[p.parts[0]] == Kind.RATE_INDEPENDENT]


def _settle_plane(
    equations: MotionEquations,
    plane: Plane,
    values: Mapping[str, float],
    states: Array,
    time: float,
) -> float:
    """Move both coordinates of a planar contact along their forces towards the stable set; returns
    the displacement relative to the positions."""
    rate = equations.rate
    first = len(equations.contacts) - len(rate.force)
    own = [i - first for i in plane.parts]
    rows = [
        equations.declaration.state.index(next(iter(equations.contacts[i].direction)))
        for i in plane.parts
    ]
    wanted = [*plane.pull, plane.static, *(rate.force[i] for i in own)]
    wanted += [rate.partial[i][i] for i in own]
    x, y, s, *rest = values_at(equations, values, states, wanted, time)
    size = np.hypot(x, y)
    beyond = np.where(size > s, 1.0 - s / np.where(size > 0.0, size, 1.0), 0.0)
    moved = 0.0
    for row, force, slope in zip(rows, rest[:2], rest[2:], strict=True):
        step = np.where(slope != 0.0, -force * beyond / np.where(slope != 0.0, slope, 1.0), 0.0)
        moved = max(moved, _moved(states, row, step))
    return moved
