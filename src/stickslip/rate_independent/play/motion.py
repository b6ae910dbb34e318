"""The motion of a play between its nodes, and its audit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.numerics.levels import ENERGY_SCALE, ROUNDING
from stickslip.rate_independent.play.nodes import PlayBounds, Sample

_CHUNK = 2**12  # intervals that are evaluated together: their arrays fit into the cache
# rounding errors of a time and of quantities computed from it, in units in the last place
_SPACINGS = 4.0


@dataclass(frozen=True)
class PlayAudit:
    """Work and violations of a motion, integrated anew from its nodes.

    The `blur` of energy, force and gap is the effect of rounded times on them, relevant for steep
    signals.
    """

    energy: Array
    dissipated: Array
    supplied: Array
    supplied_modulus: float
    excess: float
    force: float
    gap: float
    blur: tuple[float, float, float]


class PlayState(NamedTuple):
    """Position, its rate, and the signals at some times."""

    z: Array
    rate: Array
    now: Sample


@dataclass(frozen=True)
class PlayMotion:
    """A play between its nodes; `k` are the numbers of intervals.

    Attributes
    ----------
    time, z : array, shape (n + 1,)
        The nodes, and the positions there.
    mode : array, shape (n,)
        Direction of the motion in each interval.
    """

    bounds: PlayBounds
    time: Array
    z: Array
    mode: Array

    def energy(self, load: Array, z: Array) -> Array:
        """Stored energy under a load at a position."""
        return 0.5 * self.bounds.stiffness * z**2 - load * z

    def middle(self, k: Array) -> Array:
        """Midpoints of intervals."""
        return 0.5 * (self.time[k] + self.time[k + 1])

    def state(self, t: Array, k: Array) -> PlayState:
        """All quantities at times t, shape (..., intervals), inside the intervals k."""
        mode = self.mode[k]
        start = self.z[k]
        end = self.z[k + 1]
        now = self.bounds.sample(t, self.middle(k))
        low, high = (
            np.clip(bound, np.minimum(start, end), np.maximum(start, end))
            for bound in (now.low, now.high)
        )
        z = np.select([mode > 0, mode < 0], [low, high], start)
        return PlayState(
            z, np.select([mode > 0, mode < 0], [now.low_rate, now.high_rate], 0.0), now
        )

    def integrals(self, k: Array, end: Array) -> Array:
        """Integrals over intervals k from their nodes to `end`: dissipated, supplied, |supplied|,
        ∫ż; shape (4, ...).

        Gauss quadrature with as many points as the polynomials have coefficients is exact.
        """
        x, w = np.polynomial.legendre.leggauss(
            max(len(signal.coefficients) for signal in self.bounds.signals)
        )
        out = np.empty((4, len(k)))
        for first in range(0, len(k), _CHUNK):
            part = slice(first, first + _CHUNK)
            start = self.time[k[part]]
            half = 0.5 * (end[part] - self.time[k[part]])
            z, rate, now = self.state(start + half * (x[:, None] + 1.0), k[part])
            threshold = np.where(self.mode[k[part]] > 0, now.plus.value, now.minus.value)
            power = -now.load.rate * z
            out[:, part] = half * np.stack(
                [w @ f for f in (threshold * np.abs(rate), power, np.abs(power), rate)]
            )
        return out

    def audited(self) -> PlayAudit:
        """Energy, work and violations, recomputed from the nodes."""
        time, position = self.time, self.z
        k = np.arange(len(self.mode))
        near = self.middle(k)
        dissipated, supplied, modulus, change = self.integrals(k, time[1:])
        before, after = (self.bounds.load.sample(t, near).value for t in (time[1:], time[:-1]))
        # A jump has no duration: the load jumps first, then z moves down the energy, and the
        # difference is dissipated.
        jumps = np.flatnonzero(time[1:] == time[:-1])
        before[jumps] = after[jumps] = after[jumps + 1]
        fall = self.energy(before, position[:-1]) - self.energy(before, position[1:])
        dissipated[jumps] = fall[jumps]
        change[jumps] = np.diff(position)[jumps]
        work = np.concatenate([[0.0], -(after[1:] - before[:-1]) * position[1:-1]])
        supplied_at = np.concatenate([[0.0], np.cumsum(supplied + np.append(work[1:], 0.0))])
        # Nodes are rounded times, which limits the relative accuracy of short intervals.
        rounding = np.divide(
            _SPACINGS * np.spacing(np.abs(time[1:])),
            np.diff(time),
            out=np.zeros(len(k)),
            where=time[1:] > time[:-1],
        )
        energy_blur = float(np.sum(np.minimum(rounding, 1.0) * (dissipated + modulus)))
        gap_blur = float(np.max(np.minimum(rounding, 1.0) * np.abs(np.diff(position))))
        excess, blur, force = self._violations()
        # The force is the difference of the load and a z, and has the rounding errors of both.
        largest = float(np.max(np.abs([before, after])))
        excess = max(excess - ROUNDING * largest, 0.0)
        force = max(force, ENERGY_SCALE * largest)
        return PlayAudit(
            self.energy(np.append(after, before[-1]), position),
            np.concatenate([[0.0], np.cumsum(dissipated)]),
            supplied_at,
            float(np.sum(modulus) + np.sum(np.abs(work))),
            excess,
            force,
            float(np.max(np.abs(np.diff(position) - change))),
            (energy_blur, blur, gap_blur),
        )

    def _violations(self) -> tuple[float, float, float]:
        """Largest excess of the force over its threshold (or, in motion, distance from it), its
        blur, largest force.

        Evaluated from the original signals, not from their polynomials.
        """
        excess = force = blur = 0.0
        x, _ = np.polynomial.legendre.leggauss(3)
        for first in range(0, len(self.mode), _CHUNK):
            k = np.arange(first, min(first + _CHUNK, len(self.mode)))
            # In intervals of a few units in the last place, rounding may move a time across a jump.
            k = k[np.diff(self.time)[k] > 64.0 * np.spacing(np.abs(self.time[k]))]
            t = self.middle(k) + 0.5 * (self.time[k + 1] - self.time[k]) * x[:, None]
            load, minus, plus = (signal.source(signal.clock(t)) for signal in self.bounds.signals)
            z, _, now = self.state(t, k)
            pull = load - self.bounds.stiffness * z
            steepest = np.abs(now.load.rate) + np.maximum(
                np.abs(now.plus.rate), np.abs(now.minus.rate)
            )
            blur = max(
                blur, float(np.max(_SPACINGS * np.spacing(np.abs(t)) * steepest, initial=0.0))
            )
            mode = np.broadcast_to(self.mode[k], pull.shape)
            beyond = np.maximum(pull - plus, -minus - pull)
            beyond = np.select(
                [mode > 0, mode < 0], [np.abs(pull - plus), np.abs(pull + minus)], beyond
            )
            excess = max(excess, float(np.max(beyond, initial=0.0)))
            force = max(
                force, *(float(np.max(np.abs(f), initial=0.0)) for f in (pull, plus, minus))
            )
        return excess, blur, force
