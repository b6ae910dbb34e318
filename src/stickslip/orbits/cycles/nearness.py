"""The distance of states from an attractor, an equilibrium or a cycle, up to symmetries of the
system."""

from __future__ import annotations

import numpy as np

from stickslip.arrays import Array
from stickslip.numerics.levels import TINIEST
from stickslip.numerics.ratios import ratio
from stickslip.orbits.cycles.cycle import Cycle
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.return_map.recurrence import Window, window

# finer than the samples for recurrence: chords are then closer to a cycle than 1e-3 of its size
_FINER = 8
_PART = 256  # number of states whose distances are computed together


class NearPoint:
    """Nearness to an isolated equilibrium, up to translation."""

    def __init__(self, state: Array, invariant: Array, sizes: Array) -> None:
        self.across: Array = np.eye(len(state)) - invariant @ invariant.T
        size = np.maximum(sizes, np.abs(self.across @ state))
        self.state = state
        self.sizes: Array = np.where(size > 0.0, size, np.max(size, initial=TINIEST))

    def distance(self, states: Array) -> Array:
        """Largest difference of a component, in units of the section."""
        return np.max(np.abs((states - self.state) @ self.across.T) / self.sizes, axis=1)


class NearCycle:
    """Nearness to a cycle: in the frame of the system and up to translation; to a driven one at the
    same phase."""

    def __init__(self, cycle: Cycle) -> None:
        motion = cycle.trajectory
        self.cycle = cycle
        self.window: Window = window(motion, Pieces(motion.problem.compiled.equations))
        t = self.window.times
        self.polygon: Array = self._home(
            np.append(np.linspace(t[:-1], t[1:], _FINER, endpoint=False, axis=1), t[-1])
        )

    def distance(self, states: Array, times: Array) -> Array:
        """Euclidean, in units of the size of the cycle; each state at its time."""
        home = self.window.in_frame(states, times)
        period = self.window.period
        found = np.empty(len(states))
        if period is None:
            for i in range(0, len(home), _PART):
                found[i : i + _PART] = self._to_polygon(home[i : i + _PART])
            return found
        for time in np.unique(times):
            points = self._home(*self._phases(float(time), period))
            found[times == time] = self._to_points(home[times == time], points)
        return found

    def _home(self, times: Array, periods: Array | float = 0.0) -> Array:
        """States of the cycle in units of its size, a number of periods of the drives later."""
        values = self.cycle.trajectory.at(times)
        states = np.column_stack([values[name] for name in self.cycle.state])
        return self.window.in_frame(
            states + np.multiply.outer(periods, self.window.symmetry.turn), times
        )

    def _phases(self, time: float, period: float) -> tuple[Array, Array]:
        """Times on the cycle with the same phases of the drives as a given time, and the number of
        periods between them."""
        k = self.cycle.trajectory.knots
        turns = round(self.cycle.period / period)
        times = k.time[0] + np.mod(time - k.time[0], period) + period * np.arange(turns)
        return np.minimum(times, k.time[-1]), np.rint((time - times) / period)

    def _offset(self, states: Array, points: Array) -> Array:
        """From points to states, without whole cells; shape (states, points, n)."""
        sizes = self.window.sizes
        return self.window.symmetry.in_frame((states[:, None] - points) * sizes, sizes) / sizes

    def _to_points(self, states: Array, points: Array) -> Array:
        return np.min(np.linalg.norm(self._offset(states, points), axis=2), axis=1)

    def _to_polygon(self, states: Array) -> Array:
        """Distance of states to the polygon of the cycle."""
        a = self.polygon[:-1]
        chord = np.diff(self.polygon, axis=0)
        length = np.sum(chord**2, axis=1)
        offset = self._offset(states, a)
        # Foot of the perpendicular on each chord, limited to its ends.
        part = np.clip(ratio(np.einsum("sci,ci->sc", offset, chord), length), 0.0, 1.0)
        return np.min(np.linalg.norm(offset - part[:, :, None] * chord, axis=2), axis=1)
