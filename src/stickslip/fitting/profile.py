"""Profile likelihood: the likelihood as a function of one unknown, maximised over the others."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, suggestion
from stickslip.fitting.search import polished, started_at

if TYPE_CHECKING:
    import xarray

    from stickslip.fitting.fit import Fit

_STEP = 0.5  # initial step in standard errors
_FASTER = 1.3  # growth factor of the steps
_STEPS = 24  # largest number of steps on a side
_BEYOND = 1.3  # multiple of the limit up to which the profile is continued
_WHOLE = 0.25  # first step relative to an unknown whose standard error is not known
_NO_MOVE = 1e-9  # relative step towards a bound that counts as a change


class Profiled(NamedTuple):
    """A point of a profile: the value, the rise of −2 log(likelihood), all unknowns."""

    value: float
    rise: float
    p: Array


def profile_of(
    fit: Fit, name: str, progress: Callable[[float], None] | None = None
) -> xarray.Dataset:
    """The profile likelihood of an unknown of a fit; see :meth:`Fit.profile`."""
    import xarray as xr

    if name not in fit.names:
        raise DeclarationError(
            f"profile: {name}", "unknown name; it was not fitted", suggestion(name, fit.names)
        )
    j = fit.names.index(name)
    limit = _limit(fit)
    middle = Profiled(float(fit.values[j]), 0.0, fit.values)
    sides: list[list[Profiled]] = []
    for sign in (-1.0, 1.0):
        sides.append(_side(fit, j, sign, limit))
        if progress is not None:
            progress(0.5 * len(sides))
    points = [*reversed(sides[0]), middle, *sides[1]]
    ends = [_crossing([middle, *side], limit, s) for side, s in zip(sides, (-1, 1), strict=True)]
    others = {
        other: ("value", np.array([q.p[i] for q in points]))
        for i, other in enumerate(fit.names)
        if i != j
    }
    data: dict[str, Any] = {"rise": ("value", np.array([q.rise for q in points])), **others}
    unit = {"units": str(fit.dataset["unit"].values[j])}
    flat = not all(map(math.isfinite, ends))
    return xr.Dataset(
        data,
        {"value": ("value", np.array([q.value for q in points]), unit)},
        {"parameter": name, "limit": limit, "low": ends[0], "high": ends[1], "flat": int(flat)},
    )


def _limit(fit: Fit) -> float:
    """Rise of −2 log(likelihood) at the end of an interval of 95 %."""
    from scipy.stats import chi2

    if not fit.problem.estimated:
        return float(chi2.ppf(0.95, 1))
    # For n data with noise of unknown size, n log(1 + t²/ν) for the quantile t of Student's law.
    nu = max(fit.statistics.freedom, 1)
    n = fit.statistics.weight * (nu + len(fit.names))
    return n * math.log1p(fit.statistics.quantile**2 / max(fit.statistics.weight * nu, 1.0))


def _side(fit: Fit, j: int, sign: float, limit: float) -> list[Profiled]:
    """Points on one side of the estimate, until the rise exceeds the limit or the bound is
    reached."""
    problem = fit.problem
    u = problem.unknowns[j]
    error = float(fit.statistics.error[j])
    value = float(fit.values[j])
    step = _STEP * error if math.isfinite(error) and error > 0.0 else _WHOLE * (abs(value) or 1.0)
    bound = u.high if sign > 0 else u.low
    best = fit.log_likelihood
    found: list[Profiled] = []
    p = fit.values
    for _ in range(_STEPS):
        room = abs(bound - value)
        if room == 0.0:
            break
        # Not onto a bound that may be excluded.
        move = step if step < room else 0.5 * room
        if move <= _NO_MOVE * max(abs(value), abs(bound) if math.isfinite(bound) else 0.0):
            break
        value += sign * move
        p = _moved_to(fit, j, value, p)
        likelihood = problem.log_likelihood(p)
        rise = 2.0 * (best - likelihood) * fit.statistics.weight
        if not math.isfinite(rise):
            # No motion exists beyond this value: it bounds the unknown.
            found.append(Profiled(value, math.inf, p))
            break
        found.append(Profiled(value, rise, p))
        if rise > _BEYOND * limit:
            break
        step *= _FASTER
    return found


def _moved_to(fit: Fit, j: int, value: float, p: Array) -> Array:
    """All unknowns, with the likelihood maximised over the others."""
    others = np.delete(p, j)
    held = started_at(fit.problem.held(j, value), others)
    end = polished(held, others)
    return np.insert(others if end.reason else end.p, j, value)


def _crossing(points: list[Profiled], limit: float, sign: int) -> float:
    """The value at which the rise reaches the limit, from its square root, which is nearly
    linear."""
    for a, b in itertools.pairwise(points):
        if b.rise >= limit:
            if math.isinf(b.rise):
                return b.value
            below, above = math.sqrt(max(a.rise, 0.0)), math.sqrt(b.rise)
            return a.value + (b.value - a.value) * (math.sqrt(limit) - below) / (above - below)
    return sign * math.inf
