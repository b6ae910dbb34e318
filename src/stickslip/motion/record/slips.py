"""Slips of the contacts of a motion: the knots between which contacts slip, and displacements."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.symbolic import expressions as ex

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

_EXACT = 1e-13  # relative error of the displacement of a surface whose speed changes
NODES_OF_STEP = 16
"""Gauss nodes on a step, which is a Taylor series there."""


def slipping_contacts(motion: Trajectory, numbers: list[int]) -> Array:
    """Whether contacts, given by their numbers in the engine, slip after every knot. Open contacts
    do not slip."""
    mode = motion.knots.slip
    equations = motion.problem.compiled.equations
    found = mode[:, numbers] != 0
    for j, c in enumerate(numbers):
        if equations.pressing(c) and not equations.has_own_friction(c):
            found[:, j] &= np.any(mode[:, equations.pressing(c)] == 0, axis=1)
    return found


def dry_contacts_of(motion: Trajectory) -> tuple[Array, list[list[int]]]:
    """Names of the dry contacts, and the numbers of their components in the engine. Those that are
    one have one name."""
    equations = motion.problem.compiled.equations
    groups: dict[str, list[int]] = {}
    for i, (name, c) in enumerate(zip(equations.labels, equations.contacts, strict=True)):
        if not c.opens:
            groups.setdefault(name, []).append(i)
    return np.array([*groups], dtype=object), [*groups.values()]


def intervals_of_slip(slips: Array, clock: Array) -> Array:
    """Knots at which events begin and end, shape (events, 2): all contacts stick before and
    after."""
    slipping = np.any(slips, axis=1)
    # A rest without duration does not count.
    lasts = np.append(np.diff(clock) > 0.0, True)
    knots = np.flatnonzero(lasts)
    change = np.flatnonzero(np.diff(slipping[knots].astype(int)))
    edges = knots[change] + 1
    begins = slipping[knots[change + 1]]
    # One that had begun before the motion is left out, and one that is not at its end.
    if len(edges) and not begins[0]:
        edges = edges[1:]
    return edges[: len(edges) // 2 * 2].reshape(-1, 2)


def slips_in(motion: Trajectory, runs: Array) -> Array:
    """Slip of every contact in every event, shape (events, contacts): relative displacement of its
    sides."""
    k, values = motion.knots, motion.parameters
    names = motion.system.declaration.state
    moved = k.state[runs[:, 1]] - k.state[runs[:, 0]]
    found = np.zeros((len(runs), k.mode.shape[1]))
    for c, contact in enumerate(motion.problem.compiled.equations.contacts):
        for x, weight in contact.direction.items():
            found[:, c] += ex.evaluate(weight, values) * moved[:, names.index(x)]
        if contact.speed is ex.ZERO:
            continue
        if contact.speed.symbols & {*names}:
            found[:, c] -= _way_along(motion, contact.speed, runs)
        else:
            found[:, c] -= _way(contact.speed, values, k.clock[runs], k.origin)
    return found


def _way_along(motion: Trajectory, speed: ex.Expr, runs: Array) -> Array:
    """Displacement of a surface with state-dependent speed in each of several intervals of knots,
    shape (events, 2): by Gauss quadrature on every step."""
    from stickslip.symbolic.evaluator import evaluator

    k = motion.knots
    d = motion.system.declaration
    formula = evaluator([speed], [*d.state, "t", *d.parameters])
    nodes, weights = np.polynomial.legendre.leggauss(NODES_OF_STEP)
    found = np.zeros(len(runs))
    for event, (begun, ended) in enumerate(runs):
        steps = np.arange(begun, ended)
        half = 0.5 * np.diff(k.clock[begun : ended + 1])
        times = (k.clock[steps] + half)[:, None] + half[:, None] * nodes
        index = np.repeat(steps, NODES_OF_STEP)
        states = motion.states_at(times.ravel() + k.origin, index)
        given = [np.full(len(index), motion.parameters[p]) for p in d.parameters]
        (rate,) = formula(np.array([*states.T, times.ravel() + k.origin, *given]))
        found[event] = np.sum(half[:, None] * weights * np.reshape(rate, times.shape))
    return found


def _way(speed: ex.Expr, values: Mapping[str, float], clock: Array, origin: float) -> Array:
    """Displacement of a surface in each of several time intervals, shape (events, 2)."""
    if "t" not in speed.symbols:
        return ex.evaluate(speed, values) * (clock[:, 1] - clock[:, 0])
    from scipy.integrate import quad

    def at(time: float) -> float:
        return ex.evaluate(speed, {**values, "t": origin + time})

    return np.array([quad(at, a, b, epsrel=_EXACT, limit=200)[0] for a, b in clock])
