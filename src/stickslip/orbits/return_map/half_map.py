"""Cycles whose second half mirrors the first, as fixed points of half of their return map.

A change of the signs of some components of the state, measured from a centre, with a shift by half
a period, may map the equations onto themselves. For a cycle that it maps onto itself, the half map
is the motion over half a period, followed by the change of signs; the return map is its square.
Where a multiplier of the half map is −1, that of the return map is 1 (a branch point), and the
equations of the cycle are singular; those of the half map are not.

Reference: Y. A. Kuznetsov, *Elements of Applied Bifurcation Theory*, section 7.4.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np

from stickslip.arrays import AnyArray, Array
from stickslip.errors import StickslipError
from stickslip.numerics.levels import FEW_ROUNDINGS, RANK
from stickslip.numerics.ratios import ratio
from stickslip.orbits.fields.mode_field import Piece
from stickslip.orbits.return_map.damped_newton import CLOSED, Closed
from stickslip.orbits.return_map.held import forms
from stickslip.orbits.return_map.recurrence import segments
from stickslip.orbits.return_map.shooting import Orbit, Shooting, parameter_values

# difference of the halves of a cycle, relative to its ranges, up to which they mirror each other,
# if the cycle is not known less well …
_MIRRORED = 1e-6
_LEAST_KNOWN = 1e-3
_PARTS = (0.2, 0.5, 0.8)  # parts of a phase at which the equations are compared
_MOST_STEPS = 4  # towards the centre
# … and of two sides of the equations, relative to their largest value, at …
_SAME = 1e-9
# … states that differ from those of the cycle by this part of its size, …
_JITTER = 0.3
# … and at these parts of the range of the parameter
_PLACES = (0.37, 0.71)


@dataclass(frozen=True)
class HalfMap:
    """The half map of cycles.

    Attributes
    ----------
    signs : array, shape (n,)
        Factors of the components of the state.
    centre : array, shape (n,)
        From where those that change their signs are measured, the same for all parameters of a
        branch; 0 for the others.
    """

    signs: Array
    centre: Array

    def mirrored(self, y: Array) -> Array:
        """The mirror image of states, shape (…, n)."""
        return self.signs * y + 2.0 * self.centre

    def suits(self, shooting: Shooting) -> bool:
        """Return whether a station is after half a period, and positions that contacts keep are
        determined by the symmetry."""
        odd = all(
            not held.edge and np.array_equal(held.form * self.signs, -held.form)
            for held in shooting.setting.held
        )
        return odd and shooting.stations[self._middle(shooting)].part == 0.5

    def equations(self, shooting: Shooting, x: Array) -> tuple[Array, Array]:
        """Residual and derivative with the first station at the mirror image of the middle one,
        instead of at the end of the period."""
        F, J, places = shooting.open_equations(x)
        middle, home = self._middle(shooting), slice(*shooting.first[:2])
        own = slice(*shooting.first[middle : middle + 2])
        station, place = shooting.stations[0], places[middle]
        back = station.chart * self.signs
        F[home] = station.chart @ (self.mirrored(place.state) - station.origin) - x[home]
        J[home, home] = -np.eye(home.stop)
        J[home, own] += back @ place.directions
        J[home, shooting.time] = 0.5 * (back @ place.by_time)
        if shooting.free:
            J[home, -1] = back @ place.by_parameter
        return F, J

    def multipliers(self, shooting: Shooting, orbit: Orbit) -> AnyArray:
        """The multipliers of the half map, without those of positions that contacts keep: these
        are −1, since the symmetry changes their signs."""
        n = len(orbit.shift)
        middle = self._middle(shooting)
        M = np.eye(int(shooting.first[1]))
        for leg, there in zip(orbit.legs[:middle], shooting.stations[1:], strict=False):
            M = there.chart @ leg.change.matrix[:n, : leg.place.directions.shape[1]] @ M
        first = shooting.stations[0]
        M = first.chart * self.signs @ orbit.legs[middle].place.directions @ M
        kept = forms(shooting.setting.held, n) @ first.basis
        if len(kept):
            free = np.linalg.svd(kept)[2][len(kept) :].T
            M = free.T @ M @ free
        return np.linalg.eigvals(M) if len(M) else np.zeros(0)

    @staticmethod
    def _middle(shooting: Shooting) -> int:
        return len(shooting.stations) // 2


def half_map(closed: Closed, free: str, ends: tuple[float, float]) -> HalfMap | None:
    """The half map of a cycle; None if it has none.

    Parameters
    ----------
    free : str
        The parameter that changes.
    ends : (float, float)
        Its range: the equations have the symmetry for all its values.
    """
    symmetry = closed.shooting.setting.symmetry
    moves = np.any(closed.orbit.shift) or (symmetry.frame is not None and np.any(symmetry.frame))
    if moves or symmetry.shifts.shape[1] or symmetry.cells.shape[1]:
        return None
    found = _first_guess(closed)
    if found is None:
        return None
    with np.errstate(all="ignore"), suppress(StickslipError, np.linalg.LinAlgError):
        pairs = _pairs(closed)
        half = replace(found, centre=np.zeros(len(found.centre)))
        if closed.shooting.setting.held:
            # The positions that contacts keep determine the centre.
            half = _centred(found, closed, pairs)
        if _maps_equations(half, closed, pairs, free, ends):
            return half
    return None


def _first_guess(closed: Closed) -> HalfMap | None:
    """Factors and centre by the states in the second half of a period, compared with the first."""
    states = closed.samples(64)
    early, late = np.split(states, 2)
    # A cycle with a multiplier of nearly 1 is known less accurately than it closes.
    near = np.min(np.abs(closed.spectrum.others - 1.0), initial=1.0)
    known = max(_MIRRORED, min(ratio(CLOSED, near), _LEAST_KNOWN))
    known = known * np.maximum(np.ptp(states, axis=0), closed.shooting.setting.sizes)
    centre = 0.5 * np.mean(late + early, axis=0)
    odd = np.max(np.abs(late + early - 2.0 * centre), axis=0) <= known
    even = np.max(np.abs(late - early), axis=0) <= known
    if not np.all(odd | even) or not np.any(odd & ~even):
        return None
    return HalfMap(np.where(odd, -1.0, 1.0), np.where(odd, centre, 0.0))


class _Pair(NamedTuple):
    """A state in a phase of a cycle, with a time, and the pieces there and half a period later."""

    time: float
    state: Array
    here: Piece
    later: Piece


def _pairs(closed: Closed) -> list[_Pair]:
    """Some states of every phase."""
    motion, pieces = closed.orbit.motion, closed.shooting.pieces
    k = motion.knots
    half = 0.5 * float(closed.orbit.period)

    def step(t: float) -> int:
        return min(int(np.searchsorted(k.time, t, side="right")) - 1, len(k.time) - 2)

    found = list[_Pair]()
    for (a, b), part in product(segments(motion), _PARTS):
        t = float(k.time[a]) + part * float(k.time[b] - k.time[a])
        there = step(t + half if t + half < k.time[-1] else t - half)
        here, later = (pieces(k.mode[i], k.region[i]) for i in (a, there))
        y = motion.states_at(np.array([t]), np.array([step(t)]))[0]
        found.append(_Pair(t, y, here, later))
    return found


def _centred(half: HalfMap, closed: Closed, pairs: list[_Pair]) -> HalfMap:
    """The same map with the centre about which the rates have the symmetry."""
    p = parameter_values(closed.orbit.problem)
    n = len(half.signs)
    wait = 0.5 * float(closed.orbit.period)
    units = np.where(half.signs < 0.0, closed.shooting.setting.sizes, 0.0)
    for _ in range(_MOST_STEPS):
        gaps, slopes = list[Array](), list[Array]()
        for t, y, here, later in pairs:
            mirror = half.mirrored(y)
            gaps.append(later.rates(t + wait, mirror, p) - half.signs * here.rates(t, y, p))
            J = later.jacobian(np.array([t + wait]), mirror[:, None], p)[0][:, :n]
            slopes.append(2.0 * J * units)
        step = np.linalg.lstsq(np.vstack(slopes), -np.concatenate(gaps), rcond=RANK)[0]
        half = replace(half, centre=half.centre + units * step)
        if np.max(np.abs(step)) <= FEW_ROUNDINGS:
            break
    return half


def _maps_equations(
    half: HalfMap, closed: Closed, pairs: list[_Pair], free: str, ends: tuple[float, float]
) -> bool:
    """Return whether the equations have the symmetry, in every phase of a cycle and around it."""
    setting, problem = closed.shooting.setting, closed.orbit.problem
    random = np.random.default_rng(0)
    whole = float(closed.orbit.period)
    places = [(parameter_values(problem), whole)]
    for part in _PLACES:
        given = {**problem.parameters, free: ends[0] + part * (ends[1] - ends[0])}
        p = np.array([given[name] for name in problem.system.parameters])
        clock = setting.clock
        places.append((p, whole if clock is None else setting.turns * clock.period(given)))
    same = np.ones(len(half.signs))
    for t, state, here, later in pairs:
        y = state + _JITTER * setting.sizes * random.uniform(-1.0, 1.0, len(state))
        for p, period in places:
            now = t * period / whole
            one = _functions(here, now, y, p, half.signs)
            other = _functions(later, now + 0.5 * period, half.mirrored(y), p, same)
            if not _alike(one, other):
                return False
    return True


def _functions(piece: Piece, t: float, y: Array, p: Array, signs: Array) -> tuple[Array, Array]:
    """The rates with signs, and the moduli of guards and constraints in order of size."""
    found = piece.felt(np.array([t]), y[:, None], p)[:, 0]
    return signs * found[: len(y)], np.sort(np.abs(found[len(y) :]))


def _alike(one: tuple[Array, Array], other: tuple[Array, Array]) -> bool:
    return all(
        a.shape == b.shape and bool(np.all(np.abs(a - b) <= _SAME * np.max(np.abs(a), initial=0.0)))
        for a, b in zip(one, other, strict=True)
    )
