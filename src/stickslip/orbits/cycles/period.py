"""The shortest period of a cycle.

Newton's method may find a cycle that traverses a shorter one several times: with complex
multipliers, a later return of a settling motion may be closer than an earlier one. The test is
therefore applied to the closed cycle, at its accuracy: T is the shortest period if the states after
T/p differ from the first one for all primes p. A cycle just after a period doubling may close after
half its period to within 1e-6; a transient of that size has decayed in the closed cycle.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stickslip.numerics.ratios import ratio
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.return_map.damped_newton import Closed, converge, flattest, near
from stickslip.orbits.return_map.recurrence import Recurrence, window

_SAME = 1e-11  # states this close, in units of the size of the cycle, are the same …
_FLOOR = 1e3  # … or if they differ by at most this multiple of the closure error of the cycle …
# … or by this multiple of the resulting error of the state along the flattest direction
_KNOWN = 10.0
_SAMPLES = 16  # samples of every step, for counting the oscillations of a component
_MOVES = 1e-6  # a component that moves by less, in units of its size, is not counted


def shorter(closed: Closed) -> dict[int, float]:
    """Closure errors of a cycle after 1/p of its period, in units of its size, by primes p.

    These are all primes that may divide the number of its rounds: those of the periods of the
    drive; or those up to the number of times that a component has a maximum.
    """
    sizes = closed.shooting.setting.sizes
    cells = closed.shooting.setting.cells
    primes = [p for p in _primes(_rounds(closed)) if not np.any(cells % p)]
    if not primes:
        return {}
    start, *later = closed.states_at(np.array([0.0, *(1.0 / p for p in primes)]))
    misses = (float(np.linalg.norm((state - start) / sizes)) for state in later)
    return dict(zip(primes, misses, strict=True))


def same(closed: Closed) -> float:
    """Distance below which states are equal: the accuracy of the state of the cycle."""
    missed = closed.shooting.miss(closed.orbit)
    least = flattest(closed.shooting, closed.orbit)[0]
    return max(_SAME, _FLOOR * missed, ratio(_KNOWN * missed, least))


def shortest(closed: Closed) -> Closed:
    """The same cycle with its shortest period."""
    again = True
    while again:
        again = False
        for p, miss in shorter(closed).items():
            if miss <= same(closed):
                closed = part_of(closed, p)
                again = True
                break
    return closed


def part_of(closed: Closed, rounds: int) -> Closed:
    """The cycle of a part of the period near a cycle that almost closes there."""
    orbit = closed.orbit
    setting = closed.shooting.setting
    pieces = Pieces(orbit.problem.compiled.equations)
    first = orbit.legs[0].place.state
    turns = max(setting.turns // rounds, 1)
    found = Recurrence(
        closed.shooting.start, first, orbit.period / rounds, turns, orbit.shift / rounds, 0.0
    )
    return converge(*near(orbit.problem, pieces, window(orbit.motion, pieces), found))


def _rounds(closed: Closed) -> int:
    """A multiple of the number of rounds (driven systems), or minus an upper bound of it."""
    setting = closed.shooting.setting
    return setting.turns if setting.symmetry.driven else -_turning_points(closed)


def _turning_points(closed: Closed) -> int:
    """Largest number of maxima of a component in a period."""
    k = closed.orbit.motion.knots
    shift = closed.orbit.shift
    steps = np.flatnonzero(np.diff(k.time) > 0.0)
    times = np.linspace(k.time[steps], k.time[steps + 1], _SAMPLES, endpoint=False, axis=1).ravel()
    states = closed.orbit.motion.states_at(times, np.repeat(steps, _SAMPLES))
    home = (
        states - np.outer((times - k.time[0]) / closed.orbit.period, shift)
    ) / closed.shooting.setting.sizes
    moving = np.ptp(home, axis=0) > _MOVES
    up = np.diff(np.vstack([home, home[:1]]), axis=0)[:, moving] > 0.0
    return int(np.max(np.sum(up & ~np.roll(up, -1, axis=0), axis=0), initial=1))


def _primes(rounds: int) -> Iterator[int]:
    """Primes that divide a number, or that do not exceed its modulus if it is negative."""
    for p in range(2, abs(rounds) + 1):
        if all(p % q for q in range(2, int(p**0.5) + 1)) and (rounds < 0 or rounds % p == 0):
            yield p
