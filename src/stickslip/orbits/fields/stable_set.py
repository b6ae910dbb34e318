"""Where friction holds rate-independent coordinates: the stable set |∂Φ| ≤ s, and the way into
it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.derive import MotionEquations
from stickslip.model.system import Kind
from stickslip.orbits.fields.regions import values_at

_SWEEPS = 100  # of the start of rate-independent coordinates
_BEYOND = 1e-9  # excess, relative to the forces, that is none


def excess(
    equations: MotionEquations,
    values: Mapping[str, float | Array],
    states: Array,
    time: float = 0.0,
) -> Array:
    """By how much states violate |∂Φ| ≤ s: the largest excess of a force over its threshold, 0
    inside.

    Parameters
    ----------
    equations : MotionEquations
    values : mapping of str to float or array, shape (points,)
        Parameters.
    states : array, shape (points, states)
    time : float

    Returns
    -------
    array, shape (points,)
        In the unit of the forces.
    """
    acting = [c for c in equations.contacts if c.kind == Kind.RATE_INDEPENDENT]
    wanted = [
        e
        for c, force in zip(acting, equations.rate.force, strict=True)
        for e in (force, c.plus, c.minus)
    ]
    if not wanted:
        return np.zeros(len(states))
    found = values_at(equations, values, states, wanted, time).reshape(-1, 3, len(states))
    force, plus, minus = np.moveaxis(found, 1, 0)
    beyond = np.maximum(-plus - force, force - minus)
    return np.max(np.where(beyond > _BEYOND * (np.abs(force) + plus + minus), beyond, 0.0), axis=0)


def settle_friction(
    equations: MotionEquations, values: Mapping[str, float], states: Array, time: float = 0.0
) -> None:
    """Move rate-independent coordinates, one after the other, until friction holds them; changes
    `states`.

    Each goes to the nearest place at which its own contact holds: descent, coordinate by
    coordinate, in the minimisation E(x) + Σ sᵢ|xᵢ − xᵢ⁰| that decides where such a system goes from
    a state it cannot rest in.
    """
    rate = equations.rate
    acting = [c for c in equations.contacts if c.kind == Kind.RATE_INDEPENDENT]
    rows = [equations.declaration.state.index(next(iter(c.direction))) for c in acting]
    for _ in range(_SWEEPS if acting else 0):
        moved = 0.0
        for i, (c, row) in enumerate(zip(acting, rows, strict=True)):
            wanted = [rate.force[i], c.plus, c.minus, rate.partial[i][i]]
            force, plus, minus, slope = values_at(equations, values, states, wanted, time)
            beyond = np.maximum(force - minus, 0.0) + np.minimum(force + plus, 0.0)
            step = np.where(slope != 0.0, -beyond / np.where(slope != 0.0, slope, 1.0), 0.0)
            states[:, row] += step
            moved = max(moved, float(np.max(np.abs(step)) / (1.0 + np.max(np.abs(states[:, row])))))
        if moved < 1e-15:
            return
