"""The certificate of a cycle.

The motion satisfies its equations, closes, moves, and does not close earlier. Directions of
symmetry have multipliers 1 and directions lost in stick multipliers 0, and simulated neighbouring
motions agree with the multipliers.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import cache

import numpy as np

from stickslip.arrays import Array
from stickslip.certificates import Certificate, Residual
from stickslip.errors import StickslipError
from stickslip.numerics.ratios import ratio
from stickslip.orbits.cycles.period import same, shorter
from stickslip.orbits.fields.engine.tables import TOGETHER
from stickslip.orbits.fields.stable_set import settle_friction
from stickslip.orbits.return_map.damped_newton import CLOSED, Closed, largest_growth
from stickslip.orbits.return_map.following import arrivals, follow_state
from stickslip.orbits.return_map.mode_sequence import sequence
from stickslip.orbits.return_map.shooting import parameter_values

# smallest range of a cycle, relative to the state: below it, its size is not known to the tolerance
_MOVES = 1e-7
_UNCHANGED = (
    1e-9  # largest change of a perturbation along a symmetry, relative to the growth of others
)
_FORGOTTEN = 1e-9  # fraction of a change that remains after a contact has stuck
_AGREES = 1e-4  # largest relative difference between returns of neighbours and their multipliers
# … distances of neighbours in units of the size of the cycle; small ones if other modes are near
_APART = (1e-5, 1e-6, 1e-7, 1e-8, 1e-10)


def certify_cycle(closed: Closed) -> Certificate:
    """Measure a cycle.

    The residuals are those of its motion, and

    - *closure*: closure error of the state, up to the symmetry, in units of the size of the cycle;
    - *movement*: the largest range of a component relative to its modulus;
    - *shorter period*: the smallest closure error after T/p, for all primes p that may divide the
      period (absent if there are none, as for a driven cycle with the period of its drive);
    - *multipliers 1*, *multipliers 0*: deviation from the exact values due to symmetry and stick,
      relative to the growth of perturbations along the cycle;
    - *neighbours*: difference between simulated motions near the cycle, perturbed along the
      direction of largest growth and along another, and the prediction of the derivative, relative
      to the larger of the distances before and after.
    """
    orbit, shooting = closed.orbit, closed.shooting
    most = max(1.0, largest_growth(orbit))
    trivial = float(np.max(np.abs(closed.spectrum.trivial - 1.0), initial=0.0))
    motion = orbit.motion.certificate
    residuals = [
        *motion.residuals,
        Residual("closure", shooting.miss(orbit), CLOSED, note="of the size of the cycle"),
        Residual("movement", _movement(closed), _MOVES, least=True, note="of the state"),
    ]
    misses = shorter(closed)
    if misses:
        p = min(misses, key=lambda p: misses[p])
        note = f"of the size, after 1/{p} of the period"
        residuals.append(Residual("shorter period", misses[p], same(closed), least=True, note=note))
    residuals += [
        Residual("multipliers 1", trivial / most, _UNCHANGED, note=f"of the growth {most:.2g}"),
        Residual(
            "multipliers 0", _remembered(closed), _FORGOTTEN, note="of the growth of a change"
        ),
        _neighbours(closed),
    ]
    closed.trim()  # branches keep hundreds of cycles
    return replace(motion, residuals=tuple(residuals))


def _movement(closed: Closed) -> float:
    """Largest range of a component, relative to its modulus."""
    samples = closed.samples(64)
    return float(np.max(ratio(np.ptp(samples, axis=0), np.max(np.abs(samples), axis=0))))


def _remembered(closed: Closed) -> float:
    """Remaining growth of perturbations that sticking contacts (and sliding ones without mass)
    should eliminate."""
    worst = 0.0
    p = parameter_values(closed.orbit.problem)
    sizes = closed.shooting.setting.sizes
    for leg in closed.orbit.legs:
        k = leg.motion.knots
        n = len(sizes)
        # Events that coincide are passed as one. Within a piece changes may be unknown.
        lasting = np.append(np.diff(k.time), np.inf) > TOGETHER * (k.time[-1] - k.time[0])
        changes = leg.change.after[:, :n, : leg.place.directions.shape[1]]
        lasting &= np.isfinite(leg.change.after[:, 0]).all(axis=1)
        grown = np.max(np.abs(changes) / sizes[:, None], axis=(1, 2), initial=0.0)
        most = np.maximum.accumulate(np.where(lasting, np.maximum(grown, 1.0), 1.0))
        pieces = leg.change.pieces
        for piece in dict.fromkeys(pieces):
            own = np.array([i for i in np.flatnonzero(lasting).tolist() if pieces[i] is piece], int)
            if not piece.bound or not len(own):
                continue
            points = own[:1] if piece.straight else own
            slopes = np.array(
                [piece.bounds(float(k.time[i]), k.state[i], p).slopes[:, :n] for i in points]
            )
            left = np.max(np.abs(slopes @ changes[own]), axis=2, initial=0.0)
            terms = np.abs(slopes) @ sizes * most[own, None]
            worst = max(worst, float(np.max(left / terms)))
    return worst


def _neighbours(closed: Closed) -> Residual:
    """Compare neighbouring motions of every leg, along the direction of largest growth and along
    another, with the derivative."""
    found = [Residual("neighbours", 0.0, _AGREES, note="of their distance")]
    for j, leg in enumerate(closed.orbit.legs):
        there = closed.shooting.stations[(j + 1) % len(closed.orbit.legs)]
        q = leg.place.directions.shape[1]
        if q:
            matrix = there.chart @ leg.change.matrix[: len(closed.orbit.shift), :q]
            # The right singular vector of the largest singular value grows most.
            directions = [np.linalg.svd(matrix)[2][0], *([_another(q)] if q > 1 else [])]
            found += [_along(closed, j, matrix, d / np.linalg.norm(d)) for d in directions]
    return max(
        found, key=lambda residual: residual.value if np.isfinite(residual.value) else np.inf
    )


@cache
def _another(q: int) -> Array:
    """A direction of neighbours, one of q components."""
    return np.random.default_rng(0).normal(size=q)


def _along(closed: Closed, j: int, matrix: Array, direction: Array) -> Residual:
    """Accuracy of the derivative of a leg, compared with neighbouring motions in a direction.

    If a neighbour has another mode sequence, the other side decides.
    """
    expected = matrix @ direction
    size = max(float(np.linalg.norm(expected)), 1.0)
    best = Residual("neighbours", float("nan"), _AGREES)

    def better(apart: float, ends: list[tuple[float, Array]]) -> Residual:
        # Differences on both sides cancel the curvature; on one side of a corner there is only one.
        slope = sum(sign * end for sign, end in ends) / (len(ends) * apart)
        value = float(np.linalg.norm(slope - expected)) / size
        note = f"of their distance {apart:.0e}" + ("" if len(ends) == 2 else ", on one side")
        return best if value > best.value else Residual("neighbours", value, _AGREES, note=note)

    for apart in (apart / size for apart in _APART):
        starts = _beside(closed, j, [apart * direction, -apart * direction])
        ends = _arrived(closed, j, starts)
        if len(ends) == 2:
            best = better(apart, ends)
        if not best.ok:
            alike = _alike(closed, j, starts)
            kept = [end for end in ends if end[0] in alike]
            best = better(apart, kept) if kept else best
        if best.ok:
            break
    return best


def _beside(closed: Closed, j: int, changes: list[Array]) -> Array:
    """Neighbouring states at the start of a leg, from changes of the coordinates of its station."""
    shooting = closed.shooting
    p = parameter_values(closed.orbit.problem)
    begin = float(closed.orbit.legs[j].motion.knots.time[0])
    own = closed.orbit.x[slice(*shooting.first[j : j + 2])]
    states = np.array([shooting.stations[j].place(own + xi, begin, p).state for xi in changes])
    # A contact that slides without mass is on its threshold only up to rounding errors of the
    # forces on it.
    problem = closed.orbit.problem
    settle_friction(problem.compiled.equations, problem.parameters, states, begin)
    return states


def _arrived(closed: Closed, j: int, starts: Array) -> list[tuple[float, Array]]:
    """Distances of the neighbours on both sides from the cycle at the end of a leg, with the signs
    of their sides; without those that end early."""
    knots = closed.orbit.legs[j].motion.knots
    begin, end = float(knots.time[0]), float(knots.time[-1])
    there = closed.shooting.stations[(j + 1) % len(closed.orbit.legs)]
    arrived = arrivals(closed.orbit.problem, begin, end, starts)
    return [
        (sign, there.chart @ (y - knots.state[-1]))
        for sign, y in zip((1.0, -1.0), arrived, strict=True)
        if y is not None
    ]


def _alike(closed: Closed, j: int, starts: Array) -> set[float]:
    """The sides on which neighbours have the mode sequence of the cycle."""
    motion = closed.orbit.legs[j].motion
    here = sequence(motion)
    found = set[float]()
    for sign, start in zip((1.0, -1.0), starts, strict=True):
        with suppress(StickslipError):
            begin, end = float(motion.knots.time[0]), float(motion.knots.time[-1])
            other = follow_state(closed.orbit.problem, begin, end, start)
            found |= {sign} if sequence(other) == here else set()
    return found
