"""Positions of contacts that stick throughout a cycle.

Such a contact returns trivially. There is a cycle for every position at which the thresholds hold
it throughout; the cycle of a given position is computed. If a parameter changes so far that a
threshold no longer holds the contact there, it is carried along at the edge: it rests at the last
position at which it is held.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arrays import Array
from stickslip.numerics.levels import FEW_ROUNDINGS
from stickslip.orbits.fields.engine.collocation import NODES
from stickslip.orbits.fields.mode_field import Piece, Pieces
from stickslip.orbits.fields.variational import Variation, variation
from stickslip.symbolic import expressions as ex

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory


_PARTS = 16  # parts of the motion; in each a guard is evaluated at eight points and at its ends
# relative distance of a held contact from its thresholds: nearer, rounding errors make it slip
HELD = 1e-9


@dataclass(frozen=True)
class Held:
    """A position that does not change.

    Attributes
    ----------
    contact : int
        That sticks throughout.
    form : array, shape (n,)
        The position as a linear form of the state.
    edge : int
        0: it is that at the origin of the first station. +1, −1: it is that in which the contact
        just fails to slip this way.
    """

    contact: int
    form: Array
    edge: int = 0


@dataclass(frozen=True)
class Touch:
    """Point at which a contact is nearest to slipping.

    Attributes
    ----------
    margin : float
        By how much it is held there, relative to both thresholds, beyond :data:`HELD`.
    slopes : array
        Derivatives by the directions of the variation of that leg.
    """

    margin: float
    leg: int
    slopes: Array


def held_positions(motion: Trajectory, before: Sequence[Held] = ()) -> tuple[Held, ...]:
    """The independent positions of contacts that stick throughout a motion; contacts on an edge
    stay there."""
    k = motion.knots
    equations = motion.problem.compiled.equations
    state = equations.declaration.state
    edges = {h.contact: h.edge for h in before}
    stuck = np.all(k.mode[:-1][np.diff(k.time) > 0.0] == 0, axis=0)
    found: list[Held] = []
    for i in np.flatnonzero(stuck):
        if equations.contacts[i].opens:
            continue  # the position at which it is closed is not arbitrary
        form = np.zeros(len(state))
        for x, weight in equations.contacts[i].direction.items():
            form[state.index(x)] = ex.evaluate(weight, motion.parameters)
        if np.linalg.matrix_rank(np.array([*(h.form for h in found), form])) > len(found):
            found.append(Held(int(i), form, edges.get(int(i), 0)))
    return tuple(found)


def forms(held: Sequence[Held], n: int) -> Array:
    """The linear forms, shape (held, n)."""
    return np.array([h.form for h in held]).reshape(-1, n)


def released(held: Sequence[Held], sizes: Array) -> Array:
    """Directions in which the held positions change, one for each, shape (n, held)."""
    return sizes[:, None] * np.linalg.pinv(forms(held, len(sizes)) * sizes)


def same_held(a: Sequence[Held], b: Sequence[Held]) -> bool:
    """Return whether the same contacts are held."""
    return [h.contact for h in a] == [h.contact for h in b]


def slips(held: Held, motions: Sequence[Trajectory]) -> bool:
    """Return whether a contact slips in any of the motions."""
    return any(
        bool(np.any(m.knots.mode[:-1][np.diff(m.knots.time) > 0.0, held.contact])) for m in motions
    )


def nearest_slip(held: Held, legs: Sequence[tuple[Trajectory, Variation]], pieces: Pieces) -> Touch:
    """Point at which a contact that sticks throughout is nearest to slipping in the direction of
    its edge.

    At a minimum of its guard the change of the time has no effect, so that the derivatives are
    those at a fixed time.
    """
    found = [(*_lowest(held, motion, change), j) for j, (motion, change) in enumerate(legs)]
    _, t, i, j = min(found, key=lambda entry: entry[0])
    motion, change = legs[j]
    piece = change.pieces[i]
    y = motion.states_at(np.array([t]), np.array([i]))[0]
    p = np.array([motion.parameters[name] for name in motion.system.parameters])
    here, (row, other) = piece.leave(t, y, p), _guards(held, piece)
    both = float(here.value[row] + here.value[other])
    slopes = here.slopes[row] @ _changed(motion, change, pieces, i, t, y)
    return Touch(float(here.value[row]) / both - HELD, j, slopes / both)


def _guards(held: Held, piece: Piece) -> tuple[int, int]:
    """Numbers of the guards of a contact in stick: against slip in the direction of its edge, and
    in the opposite one."""
    switch = len(piece.field.kinks) + held.contact
    own = [g for g, guard in enumerate(piece.field.guards) if guard.switch == switch]
    return tuple(sorted(own, key=lambda g: piece.field.guards[g].to != held.edge))  # type: ignore[return-value]


def _lowest(held: Held, motion: Trajectory, change: Variation) -> tuple[float, float, int]:
    """The smallest value of the guard of a contact, relative to both thresholds, with its time and
    step."""
    from scipy.optimize import minimize_scalar

    k = motion.knots
    n = motion.knots.state.shape[1]
    p = np.array([motion.parameters[name] for name in motion.system.parameters])
    nodes = np.concatenate([[0.0], NODES, [1.0]])
    best = (np.inf, 0.0, 0)
    ends = (0.0, 0.0)

    def value(t: Array, i: int) -> Array:
        piece = change.pieces[i]
        times = np.atleast_1d(t)
        states = motion.states_at(times, np.full(len(times), i))
        row, other = _guards(held, piece)
        guards = piece.felt(times, states.T, p)[n : n + len(piece.switches)]
        return guards[row] / (guards[row] + guards[other])

    for i in np.flatnonzero(np.diff(k.time) > 0.0):
        # A flight in closed form may be one step and hold the whole period.
        parts = 1 + int(_PARTS * (k.time[i + 1] - k.time[i]) / (k.time[-1] - k.time[0]))
        grid = np.unique((np.arange(parts)[:, None] + nodes).ravel() / parts)
        times = k.time[i] + grid * (k.time[i + 1] - k.time[i])
        values = value(times, int(i))
        low = int(np.argmin(values))
        if values[low] < best[0]:
            best = float(values[low]), float(times[low]), int(i)
            ends = times[max(low - 1, 0)], times[min(low + 1, len(times) - 1)]

    def near(t: float) -> float:
        return float(value(np.array([t]), best[2])[0])

    found: Any = minimize_scalar(
        near, bounds=ends, method="bounded", options={"xatol": FEW_ROUNDINGS}
    )
    return min(best, (float(found.fun), float(found.x), best[2]), key=lambda entry: entry[0])


def _changed(
    motion: Trajectory, change: Variation, pieces: Pieces, i: int, t: float, y: Array
) -> Array:
    """Derivatives of the state at a time within a step."""
    from stickslip.motion.record.knots import Knots
    from stickslip.motion.trajectory import Trajectory

    k = motion.knots
    if t <= k.time[i]:
        return change.after[i]
    times, states = np.array([k.time[i], t]), np.array([k.state[i], y])
    knots = Knots(times, states, k.mode[[i, i]], k.region[[i, i]], k.cause[[i, i]])
    part = Trajectory(motion.problem, (float(k.time[i]), t), knots, motion.outcome)
    return variation(part, pieces, change.after[i]).matrix
