"""The minimisation of a least-squares problem of motions: several starts, and recordings of
increasing length.

For periodic motions, sums of squares have local minima at many periods; far from the solution, only
the first part of a recording leads to the global one. So each start is optimised over an eighth of
the recordings, a quarter, a half and all, and after each of these stages the better half of the
starts continues. The least-squares solver is SciPy's (a trust region method with bounds), with the
exact Jacobian.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import ConvergenceError, DeclarationError
from stickslip.fitting.problem import LOSSES, FitProblem, NoDerivative
from stickslip.fitting.unknowns import spread_starts
from stickslip.numerics.levels import SAME_VALUE
from stickslip.numerics.ratios import ratio

_SHARES = (0.125, 0.25, 0.5)
_ROWS = 16  # smallest number of rows of a part of a recording
# weight of the distance from the start, in widths of the box, for a part of a recording
_DRAWN = 1.0
# fraction of the spread of a column above which differences count as outliers in a part
_ROUGH = 0.1
_TOLERANCE = 1e-13
_ROUNDS = 12  # largest number of estimates of the noise
_BESIDE = 1e-7  # relative change of parameters to a point at which a motion has a derivative
_IRRATIONAL = (math.sqrt(5.0) - 1.0) / 2.0
_TRIES = 3
_NOTHING = 1e-13  # relative change of a residual below which it does not depend on an unknown
_SETTLED = 1e-4  # relative change of estimated errors at which the iteration ends
_OF_STARTS = 1e-4  # tolerance of the starts, the best of which are improved
_DIFFERENCE = 1e-4  # relative step of differences, before Richardson's extrapolation


class Minimum(NamedTuple):
    """Result of one start: values, the sum of (the loss of) squares, and the reason for a
    failure."""

    p: Array
    cost: float
    reason: str


@dataclass
class Search:
    """Result of a search.

    Attributes
    ----------
    problem : FitProblem
        With the estimated noise.
    starts : array, shape (starts, unknowns)
    minima : list of Minimum
        Where the starts have led that were followed to the end.
    reasons : list of str
        Why starts were given up.
    """

    problem: FitProblem
    best: Minimum
    starts: Array
    minima: list[Minimum] = field(default_factory=list[Minimum])
    reasons: list[str] = field(default_factory=list[str])
    interrupted: bool = False


def minimise(
    problem: FitProblem, starts: int, seed: int, show: Callable[[float, str], object]
) -> Search:
    """Minimise the sum of squares.

    Parameters
    ----------
    starts : int
        Number of starts, the given one first.
    seed : int
        Seed of the other starts.
    show : callable
        Called with the completed fraction.

    Raises
    ------
    ConvergenceError
        If the motion cannot be computed at any start.
    DeclarationError
        If no observation depends on an unknown.
    """
    begin = spread_starts(problem.unknowns, starts, seed)
    found = Search(problem, Minimum(begin[0], math.inf, "not tried yet"), begin)
    try:
        _look(found, show)
    except KeyboardInterrupt:
        found.interrupted = True
        _best_so_far(found)
    return found


def _look(found: Search, show: Callable[[float, str], object]) -> None:
    problem = found.problem
    alive = list(found.starts)
    _refuse_idle(problem, alive)
    stages = [s for s in _SHARES if s * min(len(m.times) for m in problem.measured) >= _ROWS]
    steps = len(stages) + 2
    for i, share in enumerate(stages):
        part = problem.first(share)
        ended: list[Minimum] = []
        for j, p in enumerate(alive):
            show((i + j / len(alive)) / steps, f"{share:g} of the data, start {j + 1}")
            ended.append(_descend(part, p, rough=True))
        found.reasons += [m.reason for m in ended if m.reason]
        good = sorted((m for m in ended if not m.reason), key=lambda m: m.cost)
        if not good:
            break
        alive = [m.p for m in good[: max(math.ceil(len(good) / 2), min(2, len(good)))]]
        found.best = Minimum(alive[0], math.inf, "")
    for j, p in enumerate(alive):
        show((len(stages) + j / len(alive)) / steps, f"start {j + 1} of {len(alive)}")
        end = _descend(problem, p)
        (found.reasons.append(end.reason) if end.reason else found.minima.append(end))
        found.best = min([found.best, end], key=lambda m: (bool(m.reason), m.cost))
    if not found.minima:
        raise ConvergenceError(
            f"a fit of {problem.system.name}",
            f"the motion could not be compared with the data at any of {len(found.starts)} "
            f"starts ({found.reasons[0] if found.reasons else 'none'})",
            "Choose other starts, or give bounds for the unknowns",
        )
    show((steps - 1) / steps, "noise")
    _with_noise(found)


def _with_noise(found: Search) -> None:
    """Estimate the unknown noise of columns, and minimise again, until both are consistent."""
    for _ in range(_ROUNDS):
        sigma = estimated_sigma(found.problem, found.best.p)
        if sigma is None:
            return
        change = float(np.max(np.abs(np.log(sigma / found.problem.sigma))))
        shared = np.ptp(sigma / found.problem.sigma) <= SAME_VALUE * np.max(
            sigma / found.problem.sigma
        )
        found.problem = found.problem.with_sigma(sigma)
        again = not shared or found.problem.loss != "linear"
        if not again or change < _SETTLED:
            cost = cost_of(found.problem, found.best.p)
            found.best = found.best._replace(cost=cost)
            return
        end = _descend(found.problem, found.best.p)
        if end.reason:
            return
        found.best = end


def estimated_sigma(problem: FitProblem, p: Array) -> Array | None:
    """Standard deviations with those of unknown noise estimated from the residuals; None if all
    noise is known.

    A column with m of all n data takes m/n of the unknowns. For robust losses the median of the
    absolute residuals is taken.
    """
    groups = problem.estimated
    r = problem.residuals(p) * problem.sigma
    if not groups or not np.all(np.isfinite(r)):
        return None
    sigma = problem.sigma.copy()
    k = len(problem.unknowns)
    for group in groups:
        own = problem.groups == group
        m = int(own.sum())
        # Degrees of freedom: each column loses its share of the k fitted unknowns.
        left = max(m * (1.0 - k / len(r)), 1.0)
        if problem.loss == "linear":
            size = math.sqrt(float(r[own] @ r[own]) / left)
        else:
            # 1.4826 times the median modulus estimates σ of normal residuals, robustly against
            # outliers.
            size = 1.4826 * float(np.median(np.abs(r[own])))
        # The noise is at least the accuracy of the motion.
        least = problem.rtol * float(np.max(np.abs(problem.data[own])))
        sigma[own] = max(size, least, np.finfo(float).tiny)
    return sigma


def cost_of(problem: FitProblem, p: Array) -> float:
    """Half the sum of the loss of squares."""
    r = problem.residuals(p)
    return 0.5 * float(np.sum(LOSSES[problem.loss](r**2)[0])) if np.all(np.isfinite(r)) else np.inf


def _best_so_far(found: Search) -> None:
    """Result of an interrupted search: the best values so far."""
    if found.minima or math.isfinite(found.best.cost):
        return
    try:
        found.best = Minimum(found.best.p, cost_of(found.problem, found.best.p), "")
    except KeyboardInterrupt:
        found.best = found.best._replace(reason="interrupted")


# -- one start -------------------------------------------------------------------------------------


class _Coordinates:
    """The problem in the coordinates of the search."""

    def __init__(self, problem: FitProblem, origin: Array, drawn: float) -> None:
        self.problem = problem
        self.origin = origin
        unknowns = problem.unknowns
        boxes = [[float(u.to_search(end)) for end in u.box] for u in unknowns]
        self.weight = ratio(drawn, np.array([high - low for low, high in boxes]))
        low, high = np.array([u.searched for u in unknowns]).T
        self.low, self.high = low, high

    def values(self, u: Array) -> Array:
        """Values of the unknowns, within their bounds despite rounding."""
        pairs = zip(self.problem.unknowns, u, strict=True)
        p = np.array([float(k.from_search(x)) for k, x in pairs])
        return np.clip(p, *self.problem.bounds)

    def residuals(self, u: Array) -> Array:
        r = self.problem.residuals(self.values(u))
        return np.concatenate([r, self._pull(u)])

    def jacobian(self, u: Array) -> Array:
        p = self.values(u)
        J = jacobian_near(self.problem, p)
        scale = np.array([v if k.logarithmic else 1.0 for k, v in self._with(p)])
        return np.vstack([J * scale, *([np.diag(self.weight)] if self.weight.any() else [])])

    def _with(self, p: Array) -> Any:
        return zip(self.problem.unknowns, p, strict=True)

    def _pull(self, u: Array) -> Array:
        return self.weight * (u - self.origin) if self.weight.any() else np.zeros(0)


def _descend(problem: FitProblem, p: Array, rough: bool = False) -> Minimum:
    """The minimum reached from a start."""
    from scipy.optimize import least_squares as untyped

    least_squares: Any = untyped  # its type hints do not allow a function as Jacobian
    reason = problem.reason(p)
    if reason:
        return Minimum(p, math.inf, reason)
    if not len(p):
        return Minimum(p, cost_of(problem, p), "")
    u = np.array([float(k.to_search(x)) for k, x in zip(problem.unknowns, p, strict=True)])
    inside = _Coordinates(problem, u, _DRAWN if rough else 0.0)
    known = not problem.estimated
    tolerance = _OF_STARTS if rough else _TOLERANCE
    try:
        end = least_squares(
            inside.residuals,
            np.clip(u, inside.low, inside.high),
            inside.jacobian,
            (inside.low, inside.high),
            x_scale="jac",
            loss="soft_l1" if rough else problem.loss,
            f_scale=(1.0 if known else _ROUGH) if rough else 1.0,
            ftol=tolerance,
            xtol=tolerance,
            gtol=tolerance,
            max_nfev=30 if rough else 200,
        )
    except NoDerivative as error:
        return Minimum(p, math.inf, str(error))
    values = inside.values(end.x)
    return Minimum(values, float(end.cost) if rough else cost_of(problem, values), "")


def jacobian_near(problem: FitProblem, p: Array) -> Array:
    """The Jacobian; if it does not exist, that of a neighbouring point; if these have none either,
    differences.

    Raises
    ------
    NoDerivative
        If there are no motions to compare.
    """
    try:
        return problem.slopes(p, touching=False)
    except NoDerivative as error:
        if problem.reason(p):
            raise
        first = error
    low, high = problem.bounds
    for i in range(1, _TRIES + 1):
        # Neighbours in no special direction.
        share = np.modf(_IRRATIONAL * (i + np.arange(len(p))))[0] - 0.5
        beside = p + _BESIDE * i * share * np.maximum(np.abs(p), 1e-3)
        try:
            return problem.slopes(np.clip(beside, low, high), touching=False)
        except NoDerivative:
            continue
    return _by_differences(problem, p, first)


def _by_differences(problem: FitProblem, p: Array, first: NoDerivative) -> Array:
    """Richardson's extrapolation of differences of residuals."""
    columns = []
    for j in range(len(p)):
        h = _DIFFERENCE * max(abs(p[j]), 1e-3)
        step = np.eye(len(p))[j] * h
        rough, fine = (
            (problem.residuals(p + s * step) - problem.residuals(p - s * step)) / (2.0 * s * h)
            for s in (1.0, 0.5)
        )
        columns.append((4.0 * fine - rough) / 3.0)
    J = np.column_stack(columns)
    if not np.all(np.isfinite(J)):
        raise first
    return J


def _refuse_idle(problem: FitProblem, starts: list[Array]) -> None:
    """Reject unknowns on which no observation depends, at any start."""
    idle = np.ones(len(problem.unknowns), bool)
    looked = 0
    for p in starts:
        if problem.reason(p):
            continue
        try:
            J = jacobian_near(problem, p)
        except NoDerivative:
            return
        size = np.linalg.norm(J, axis=0) * np.maximum(np.abs(p), 1e-3)
        idle &= size <= _NOTHING * math.sqrt(len(problem.data))
        looked += 1
        if not idle.any() or looked >= _TRIES:
            break
    if looked and idle.any():
        name = problem.names[int(np.argmax(idle))]
        raise DeclarationError(
            f"free.{name}",
            "the data do not depend on it",
            "Fix it, or add data that depend on it",
        )


def started_at(problem: FitProblem, p: Array) -> FitProblem:
    """The problem started from the minimum of another one."""
    unknowns = tuple(replace(u, start=float(x)) for u, x in zip(problem.unknowns, p, strict=True))
    return replace(problem, unknowns=unknowns)


def polished(problem: FitProblem, p: Array) -> Minimum:
    """The minimum near some values."""
    return _descend(problem, p)
