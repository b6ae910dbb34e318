"""Bounds between the ends of steps: the excess of the force over the stable set.

Between the ends, z is affine; the deviations of load and thresholds from straight lines on an
interval are bounded from their formulas. If the bound does not prove that the force stays inside,
the interval is divided, down to the rounding of time; the steps themselves are not. So a short
pulse of the load, or a short dip of a threshold, is not missed if it is a formula. Tables are
linear between their knots. For Python functions the deviation is estimated from the middle of each
step.
"""

from __future__ import annotations

import numpy as np

from stickslip.arrays import Array
from stickslip.rate_independent.evolution.evolution import Evolution
from stickslip.rate_independent.sets.phase_intervals import Index

_PARTS = 4  # number of parts of a divided interval
_MOST = 200_000  # largest number of intervals of one block of steps


def overshoot(problem: Evolution, times: Array, elastic: Array, limit: Array) -> Array:
    """Excess of the force over K(s) during each step, shape (m,); at least 0.

    Parameters
    ----------
    times : ndarray of shape (m + 1,)
        Ends of the steps.
    elastic : ndarray of shape (m + 1, n)
        A z there.
    limit : ndarray of shape (m,)
        Below this, no sharper bound is needed.
    """
    worst = np.zeros(len(limit))
    seen = np.full(len(limit), -np.inf)
    looked = 0
    low, high, step = _intervals(problem, times)
    while True:
        looked += len(step)
        start, end, out = _outside(problem, times, elastic, low, high, step, float(limit.min()))
        np.maximum.at(seen, step, np.maximum(start, end))
        # A step that is found to be too long needs no further examination.
        open_ = (out > limit[step]) & (seen[step] <= limit[step]) & problem.bounded
        open_ &= high - low > 8.0 * np.spacing(np.maximum(np.abs(low), np.abs(high)))
        if looked + _PARTS * int(open_.sum()) > _MOST:
            open_[:] = False
        np.maximum.at(worst, step[~open_], out[~open_])
        if not open_.any():
            return np.maximum(worst, seen)
        edges = low[open_, None] + (high - low)[open_, None] * (np.arange(_PARTS + 1) / _PARTS)
        edges[:, -1] = high[open_]
        low = edges[:, :-1].ravel()
        high = edges[:, 1:].ravel()
        step = np.repeat(step[open_], _PARTS)


def _intervals(problem: Evolution, times: Array) -> tuple[Array, Array, Index]:
    """The steps, divided at knots of tables and starts of periods: starts, ends, and step
    numbers."""
    cuts = problem.ell.knots
    if problem.dissipation.depends_on_phase:
        first, last = np.ceil(times[0] / problem.epsilon), np.floor(times[-1] / problem.epsilon)
        cuts = np.append(cuts, np.arange(first, last + 1.0) * problem.epsilon)
    edges = np.union1d(times, cuts[(cuts > times[0]) & (cuts < times[-1])])
    return edges[:-1], edges[1:], np.searchsorted(times, edges[:-1], side="right") - 1


def _outside(
    problem: Evolution,
    times: Array,
    elastic: Array,
    low: Array,
    high: Array,
    step: Index,
    enough: float,
) -> tuple[Array, Array, Array]:
    """Excess of the force over K(s) at both ends of time intervals, and its upper bound in
    between."""
    load = problem.ell.chord(low, high)
    before, after = (
        at - _affine(times, elastic, t, step) for at, t in ((load.start, low), (load.end, high))
    )
    phases = np.zeros((2, len(low)))
    if problem.dissipation.depends_on_phase:
        phases = np.stack([low, high]) / problem.epsilon
        phases = np.clip(phases - np.floor(phases.mean(axis=0)), 0.0, 1.0)
    return problem.dissipation.over(*phases).outside(before, after, load.off, enough)


def _affine(times: Array, rows: Array, t: Array, step: Index) -> Array:
    share = ((t - times[step]) / (times[step + 1] - times[step]))[:, None]
    return (1.0 - share) * rows[step] + share * rows[step + 1]
