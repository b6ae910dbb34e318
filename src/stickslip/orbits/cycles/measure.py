"""What a period of a motion amounts to: extremes, phases, time in stick and slip, energy by
contact."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from stickslip.orbits.fields.mode_field import Piece
from stickslip.orbits.fields.variational import resolution
from stickslip.orbits.return_map.recurrence import segments

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

Array = np.ndarray

NODES = 13  # of a piece of a step


@dataclass(frozen=True)
class Phase:
    """A stretch of a cycle in one mode and region.

    Attributes
    ----------
    duration : float
    modes : dict of str to int
        By contact: 0 stick, +1 or −1 slip.
    region : tuple of int
        By kink of the formulas: 1 where its guard is ≥ 0.
    """

    duration: float
    modes: dict[str, int]
    region: tuple[int, ...]

    @property
    def sticks(self) -> bool:
        """Whether all contacts stick."""
        return bool(self.modes) and not any(self.modes.values())


@dataclass(frozen=True)
class ContactShare:
    """What a contact does in a period: time in stick and in slip, and the energy it dissipates."""

    stick_time: float
    slip_time: float
    dissipated: float


def phases(motion: Trajectory) -> tuple[Phase, ...]:
    """The phases of a period; the one it starts in, which it also ends in, comes first as a
    whole."""
    k = motion.knots
    names = [c.name for c in motion._problem.compiled.equations.contacts]
    found = list[Phase]()
    mode = k.slip
    for a, b in segments(k):
        modes = dict(zip(names, map(int, mode[a]), strict=True))
        phase = Phase(float(k.time[b] - k.time[a]), modes, tuple(map(int, k.region[a])))
        if found and (found[-1].modes, found[-1].region) == (phase.modes, phase.region):
            phase = Phase(found.pop().duration + phase.duration, modes, phase.region)
        found.append(phase)
    if len(found) > 1 and (found[0].modes, found[0].region) == (found[-1].modes, found[-1].region):
        whole = Phase(found[0].duration + found[-1].duration, found[0].modes, found[0].region)
        found = [whole, *found[1:-1]]
    return tuple(found)


@dataclass(frozen=True)
class Sampled:
    """A motion at Chebyshev nodes: all quantities of the engine, piece by piece.

    Attributes
    ----------
    times : array, shape (pieces, nodes)
    rows : array, shape (pieces, nodes, rows)
        Values; the state comes first.
    length : array, shape (pieces,)
    """

    times: Array
    rows: Array
    length: Array


def sampled(motion: Trajectory, made: list[Piece]) -> Sampled:
    """Sample a motion so finely that polynomials through the nodes are exact to rounding."""
    k = motion.knots
    p = np.array([motion.parameters[name] for name in motion.system.parameters])
    steps = np.flatnonzero(np.diff(k.time) > 0.0)
    parts = resolution(motion, made, p)[steps]
    owner = np.repeat(steps, parts)
    within = np.arange(len(owner)) - np.repeat(np.cumsum(parts) - parts, parts)
    length = np.repeat(np.diff(k.time)[steps] / parts, parts)
    times = (k.time[owner] + within * length)[:, None] + length[:, None] * chebyshev()[0]
    times = np.minimum(times, k.time[owner + 1][:, None])
    rows = motion._sample(times.ravel(), np.repeat(owner, NODES))
    return Sampled(times, rows.reshape(len(owner), NODES, -1), length)


@lru_cache(maxsize=1)
def chebyshev() -> tuple[Array, Array, Array]:
    """Chebyshev-Lobatto nodes on [0, 1], the weights of Clenshaw and Curtis, and values at the
    nodes ↦ coefficients."""
    from numpy.polynomial.chebyshev import chebvander

    x = -np.cos(np.pi * np.arange(NODES) / (NODES - 1))
    values = chebvander(x, NODES - 1)
    even = np.arange(0, NODES, 2)
    moments = np.zeros(NODES)
    moments[even] = 2.0 / (1.0 - even**2)
    return 0.5 * (x + 1.0), 0.5 * np.linalg.solve(values.T, moments), np.linalg.inv(values)


def contact_shares(motion: Trajectory, found: Sampled) -> dict[str, ContactShare]:
    """Time and energy of every contact."""
    k = motion.knots
    equations = motion._problem.compiled.equations
    layout = motion._problem.compiled.layout
    weights = found.length[:, None] * chebyshev()[1]
    shares = {}
    for i, contact in enumerate(equations.contacts):
        stuck = float(np.sum(np.diff(k.time)[k.slip[:-1, i] == 0]))
        lost = -float(
            np.sum(weights * found.rows[:, :, layout.force[i]] * found.rows[:, :, layout.u[i]])
        )
        shares[contact.name] = ContactShare(stuck, float(k.time[-1] - k.time[0]) - stuck, lost)
    return shares


def extrema(found: Sampled, n: int) -> tuple[Array, Array]:
    """Least and largest value of each component of the state: at nodes, and where polynomials
    between them turn."""
    states = found.rows[:, :, :n]
    low, high = np.min(states, axis=(0, 1)), np.max(states, axis=(0, 1))
    for j in range(n):
        for node in (int(np.argmin(states[:, :, j])), int(np.argmax(states[:, :, j]))):
            for piece in _neighbours(node, len(states)):
                turns = _turns(states[piece, :, j])
                low[j], high[j] = min(low[j], *turns, low[j]), max(high[j], *turns, high[j])
    return low, high


def _neighbours(node: int, pieces: int) -> set[int]:
    """The piece of a node, and the one next to it if the node is shared; the last one comes before
    the first."""
    piece, place = divmod(node, NODES)
    return {piece, (piece - (place == 0)) % pieces, (piece + (place == NODES - 1)) % pieces}


def _turns(values: Array) -> Array:
    """Values at the turning points of the polynomial through the nodes of a piece."""
    from numpy.polynomial import chebyshev as polynomials

    series = chebyshev()[2] @ values
    slope = polynomials.chebder(series)
    size = np.max(np.abs(slope))
    if size <= 1e-13 * np.max(np.abs(values)):
        return np.zeros(0)
    roots = polynomials.chebroots(polynomials.chebtrim(slope, 1e-14 * size))
    inside = roots[(np.abs(roots.imag) < 1e-6) & (np.abs(roots.real) < 1.0)].real
    return polynomials.chebval(inside, series)
