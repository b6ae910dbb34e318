"""Statistics of a fit: standard errors, correlations of the residuals, tests.

Near its minimum the sum of squares is a parabola, (p − p̂)ᵀ JᵀJ (p − p̂)/σ², so the covariance is
σ² (JᵀJ)⁻¹; for a robust loss with ψ(r) = ρ′(r²) r it is E[ψ²]/E[ψ′]² (JᵀJ)⁻¹ (Huber). Residuals of
neighbours that are correlated by ρ contain less information: n of them count as n (1 − ρ)/(1 + ρ)
independent ones (for an autoregressive process of order one), and standard errors increase
accordingly.

References
----------
P. J. Huber, *Robust Statistics*, Wiley 1981, chapter 7; G. A. F. Seber, C. J. Wild, *Nonlinear
Regression*, Wiley 1989, chapters 5 and 6 (autocorrelated errors).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.fitting.problem import LOSSES, FitProblem
from stickslip.fitting.search import jacobian_near

LEVEL = 0.95
_SIGNIFICANT = 3.0  # number of standard deviations of a significant correlation
_SINGULAR = 1e-8  # relative to the largest singular value: with less a direction is not determined
_TAKES_PART = 0.1  # component of an undetermined direction above which an unknown is named
_FEW = 8  # smallest number of data for the tests of their distribution
_DIFFERENCE = 1e-5  # step of a central difference, in standard deviations: about the cube root of ε


@dataclass(frozen=True)
class Statistics:
    """Statistics of the unknowns.

    Attributes
    ----------
    covariance : array, shape (unknowns, unknowns)
        Zero where an unknown is not determined.
    error : array, shape (unknowns,)
        Standard errors; infinite where an unknown is not determined.
    quantile : float
        By which they are multiplied for an interval of 95 %.
    freedom : int
        Data less unknowns.
    weight : float
        Part of the data that counts, since residuals of neighbours are alike.
    step : float
        Distance of the minimum from the estimate, in standard errors.
    undetermined : tuple of str
        Unknowns on which the data do not depend here, or only together.
    tests : dict
        Of the residuals: ``correlation`` of neighbours, ``chi_square`` with ``p_value`` where the
        noise is known, ``normality`` (p value of Jarque and Bera), ``largest`` residual.
    """

    covariance: Array
    error: Array
    quantile: float
    freedom: int
    weight: float
    step: float
    undetermined: tuple[str, ...]
    tests: dict[str, float]


def statistics_of(problem: FitProblem, p: Array) -> Statistics:
    """Statistics of the unknowns at a minimum.

    Raises
    ------
    NoDerivative
        If there is no motion.
    """
    from scipy.stats import norm, t

    J = jacobian_near(problem, p)
    r = problem.residuals(p)
    freedom = max(len(r) - len(p), 0)
    all_known = not problem.estimated
    psi = LOSSES[problem.loss](r**2)[1] * r
    gain = _gain(problem, r)
    variance = 1.0 if all_known and problem.loss == "linear" else float(np.mean(psi**2)) / gain**2
    if not all_known and problem.loss == "linear":
        # Unbiased: the sum of squares divided by the degrees of freedom.
        variance *= len(r) / max(freedom, 1)
    # Columns of unit length: the rank does not depend on the units of the unknowns.
    norms = np.linalg.norm(J, axis=0)
    safe = np.where(norms > 0.0, norms, 1.0)
    _, s, vt = np.linalg.svd(J / safe, full_matrices=False)
    keep = s > _SINGULAR * max(float(s[0]), np.finfo(float).tiny)
    lost = np.any(np.abs(vt[~keep]) > _TAKES_PART, axis=0) | (norms == 0.0)
    inverse = (vt[keep].T / s[keep] ** 2) @ vt[keep] / np.outer(safe, safe)
    rho = correlation(problem, r)
    weight = effective_share(rho, len(r))
    covariance = inverse * variance / weight
    covariance[lost] = 0.0
    covariance[:, lost] = 0.0
    error = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    # Newton's step relative to the standard error.
    newton = inverse @ (J.T @ psi) / gain
    size = np.sqrt(np.diag(inverse) * max(variance, problem.rtol**2))
    step = float(np.max(np.abs(np.where(lost, 0.0, newton)) / np.where(size > 0.0, size, 1.0)))
    quantile = float(norm.ppf(0.5 + LEVEL / 2) if all_known else t.ppf(0.5 + LEVEL / 2, freedom))
    tests = _tests(problem, r, rho, freedom)
    names = tuple(name for name, gone in zip(problem.names, lost, strict=True) if gone)
    error = np.where(lost, np.inf, error)
    return Statistics(
        covariance, error, quantile if freedom else np.inf, freedom, weight, step, names, tests
    )


def _gain(problem: FitProblem, r: Array) -> float:
    """Mean slope of ψ."""
    if problem.loss == "linear":
        return 1.0
    h = _DIFFERENCE
    ends = [LOSSES[problem.loss]((r + s) ** 2)[1] * (r + s) for s in (h, -h)]
    return max(float(np.mean(ends[0] - ends[1])) / (2.0 * h), 1e-3)


def correlation(problem: FitProblem, r: Array) -> float:
    """Correlation of consecutive residuals in one column."""
    above = below = 0.0
    offset = 0
    for m in problem.measured:
        for c in m.columns:
            own = r[offset : offset + len(c.rows)]
            offset += len(c.rows)
            own = own - np.mean(own)
            # Lag-1 autocorrelation, pooled over columns, each without its mean.
            above += float(own[1:] @ own[:-1])
            below += float(own @ own)
    return above / below if below > 0.0 else 0.0


def effective_share(rho: float, count: int) -> float:
    """Effective fraction of the data."""
    if rho <= _SIGNIFICANT / math.sqrt(count):
        return 1.0
    return (1.0 - rho) / (1.0 + rho)


def _tests(problem: FitProblem, r: Array, rho: float, freedom: int) -> dict[str, float]:
    from scipy.stats import chi2, jarque_bera

    found: dict[str, float] = {"correlation": rho, "largest": float(np.max(np.abs(r)))}
    if not problem.estimated and freedom:
        square = float(r @ r)
        found |= {"chi_square": square, "p_value": float(chi2.sf(square, freedom))}
    if len(r) >= _FEW and np.ptp(r) > 0.0:
        result: Any = jarque_bera(r)
        found["normality"] = float(result.pvalue)
    return found
