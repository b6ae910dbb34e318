"""Truncated nonsmooth Newton multigrid for one minimising-movement step with a large sparse matrix.

The step minimises J(d) = ½ dᵀA d − rᵀd + ψ(d), ψ a sum of max(lowerᵢ dᵢ, upperᵢ dᵢ) over
components, or of radiusᵍ |dᵍ|₂ over groups. One cycle (Gräser & Kornhuber 2009, Gräser & Sander
2019):

1. nonlinear Gauss–Seidel: every node takes its exact minimiser;
2. without the nodes at rest, J is smooth near d: a multigrid cycle (or several, as preconditioner
   of conjugate gradients, if one is not enough) solves Newton's equation for the other nodes;
3. nodes that would pass through their kinks stop there if that decreases J more, and a line search
   ensures a decrease of J.

J never increases, and step 1 alone converges for every symmetric positive definite A, so the method
converges globally; step 2 makes it fast once the moving nodes are known. Nested iteration, the same
problem on coarser levels first, identifies most of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple

import numpy as np

from stickslip.arrays import Array, Matrix, Vector
from stickslip.errors import ConvergenceError, DeclarationError
from stickslip.numerics.levels import SUM_ROUNDING
from stickslip.rate_independent.solvers.hierarchy import Hierarchy, Level, blocks
from stickslip.rate_independent.solvers.matrix import checked_matrix
from stickslip.rate_independent.solvers.smoothing import (
    BlockRows,
    defect,
    forces,
    project,
    relax,
    slope_along,
)

_NEWTON = 0.1  # reduction of the gradient by the linear solver before the nodes at rest are updated
_LINE = 0.1  # reduction of the derivative along a correction
_NESTED = 0.1  # reduction of the residual on coarser levels,
_NESTED_CYCLES = 4  # within this number of cycles
# relative to the residual of d = 0: a given start with more is replaced by nested iteration
_GOOD_START = 0.01


class StepOutcome(Enum):
    """How a step ended; the result has the lowest energy that was reached."""

    CONVERGED = ("converged", "The KKT residual is within the tolerance")
    ROUNDING = (
        "at rounding",
        "The KKT residual is limited by rounding and exceeds the tolerance. Increase the tolerance",
    )
    CYCLE_LIMIT = (
        "limit on cycles reached",
        "The limit of max_cycles was reached. Increase max_cycles, or use a dense solver if the "
        "matrix is not a discretised elliptic operator",
    )

    def __init__(self, label: str, message: str) -> None:
        self.label: str = label
        self.message: str = message


@dataclass(frozen=True)
class StepResult:
    """One minimising-movement step.

    Attributes
    ----------
    delta : array (n,)
        The increment d.
    residual : float
        Largest distance of ξ = r − A d to the subdifferential of the dissipation at d, over
        components or groups, as a multiple of the largest weight (of the largest |r| if all weights
        vanish).
    cycles : int
        Multigrid cycles on the finest level.
    """

    delta: Array
    residual: float
    cycles: int
    outcome: StepOutcome


class Law(NamedTuple):
    """Terms of the functional on one level in addition to ½ dᵀA d: −rᵀd and the weights of the
    dissipation, of shape (nodes,)."""

    r: Matrix
    lower: Vector
    upper: Vector


class Multigrid:
    """Steps with one matrix; the levels are built once, and the steps are independent of each
    other.

    Parameters
    ----------
    A : sparse array (n, n)
        Symmetric and positive definite, any SciPy format.
    groups : int
        Size m of the groups of components with a common threshold, entries g m, …, g m + m − 1 for
        group g. 1: every component separately.

    Raises
    ------
    DeclarationError
        If A is not symmetric or not positive definite, or groups does not divide n.
    """

    def __init__(self, A: Any, groups: int = 1) -> None:
        self.groups = groups
        self.hierarchy: Hierarchy = Hierarchy(*block_rows(A, groups))

    def step(
        self,
        r: Array,
        lower: Array | None = None,
        upper: Array | None = None,
        *,
        radii: Array | None = None,
        start: Array | None = None,
        tolerance: float = 1e-8,
        max_cycles: int = 200,
    ) -> StepResult:
        """Minimise ½ dᵀA d − rᵀd + Σ max(lower d, upper d), or with radiusᵍ |dᵍ|₂ for groups.

        Parameters
        ----------
        r : array (n,)
            ℓₖ − A zₖ₋₁.
        lower, upper : array (n,), lower ≤ 0 ≤ upper
            The box K; not for groups, unless as −radii, radii.
        radii : array (n / groups,), at least 0
            Of the balls K, instead of a box.
        start : array (n,), optional
            An increment to start from, if it is so near that nested iteration would not pay.
        tolerance : float
            Of the KKT residual, as a multiple of the largest weight.

        Raises
        ------
        DeclarationError
            If sizes do not fit, a number is not finite, or 0 is not in K.
        ConvergenceError
            If numbers overflow on the way.
        """
        law = self._law(r, lower, upper, radii)
        scale = float(max(law.upper.max(), -law.lower.min())) or float(np.abs(law.r).max()) or 1.0
        d = self._start(law, start)
        residual, cycles, outcome = self._descend(0, law, d, tolerance * scale, max_cycles)
        if not np.isfinite(residual):
            raise ConvergenceError("step", "the forces overflow", "Rescale A, r and the weights")
        return StepResult(d.ravel(), residual / scale, cycles, outcome)

    def _law(self, r: Any, lower: Any, upper: Any, radii: Any) -> Law:
        """Check the arguments of a step."""
        nodes, m = self.hierarchy.levels[0].x.shape
        if radii is not None:
            upper = checked_vector(radii, "radii", nodes)
            lower = -upper
        law = Law(
            checked_vector(r, "r", nodes * m).reshape(nodes, m),
            checked_vector(lower, "lower", nodes),
            checked_vector(upper, "upper", nodes),
        )
        if np.any(law.lower > 0.0) or np.any(law.upper < 0.0):
            i = int(np.argmax((law.lower > 0.0) | (law.upper < 0.0)))
            raise DeclarationError(
                f"lower[{i}], upper[{i}]",
                f"[{law.lower[i]:g}, {law.upper[i]:g}] does not contain 0",
                "Give lower <= 0 <= upper",
            )
        if m > 1 and np.any(law.lower != -law.upper):
            raise DeclarationError("lower", "groups have radii, not bounds", "Give radii")
        return law

    def _start(self, law: Law, given: Array | None) -> Array:
        """The given start if it is a good one, otherwise that of nested iteration."""
        finest = self.hierarchy.levels[0]
        if given is not None:
            d = checked_vector(given, "start", law.r.size).reshape(law.r.shape).copy()
            at_start, _ = distances(finest, law, d, finest.rest)
            at_rest, _ = distances(finest, law, np.zeros_like(d), finest.rest)
            if at_start <= _GOOD_START * at_rest:
                return d
        return self._from_below(0, law)

    def _from_below(self, depth: int, law: Law) -> Array:
        """Nested iteration: the increment interpolated from the next level, where the same problem
        is solved roughly.

        P d has the weights |P|ᵀ upper, |P|ᵀ lower: with P ≥ 0, ψ(P d) is at most the sum of them
        over the coarse nodes.
        """
        from scipy.sparse import csr_array

        if depth == len(self.hierarchy.transfers):
            return np.zeros_like(law.r)
        coarse, (_, R) = self.hierarchy.levels[depth + 1], self.hierarchy.transfers[depth]
        R = csr_array((R.value, R.column, R.start), shape=(len(coarse.x), len(law.r)))
        weights = abs(R)
        inner = Law(R @ law.r, weights @ law.lower, weights @ law.upper)
        # With a loose tolerance: a fraction of the residual at rest.
        d = self._from_below(depth + 1, inner)
        at_rest, _ = distances(coarse, inner, np.zeros_like(d), coarse.rest)
        self._descend(depth + 1, inner, d, _NESTED * at_rest, _NESTED_CYCLES)
        return R.T @ d

    def _descend(
        self, depth: int, law: Law, d: Array, target: float, limit: int
    ) -> tuple[float, int, StepOutcome]:
        """Cycles on one level, which change d, until the residual is at the target; returns it and
        their number.

        Parameters
        ----------
        depth : int
            The level; 0 is the finest.
        law : Law
            Of that level.
        d : array, shape (nodes, m)
            Written.
        target : float
            Of the residual.
        limit : int
            Most cycles.
        """
        level = self.hierarchy.levels[depth]
        b = np.empty_like(d)
        cycles = 0
        residual = np.inf
        while True:
            before = residual
            relax(level.A, *law, d, level.space)
            residual, beyond_rounding = distances(level, law, d, b)
            if residual <= target:
                return residual, cycles, StepOutcome.CONVERGED
            if beyond_rounding <= target and residual > 0.5 * before:
                return residual, cycles, StepOutcome.ROUNDING
            if cycles >= limit or np.isnan(residual):
                return residual, cycles, StepOutcome.CYCLE_LIMIT
            self.hierarchy.truncate(depth, law.upper, d)
            goal = max(_NEWTON * max_norm(b), 0.3 * target)
            newton = np.zeros_like(d)
            spent = 1
            for spent, (rest, _) in enumerate(self._conjugate_gradients(depth, b, newton), start=1):
                if rest <= goal or cycles + spent >= limit:
                    break
            self._correct(depth, law, d, b, newton)
            cycles += spent

    def _conjugate_gradients(self, depth: int, b: Array, x: Array) -> Iterator[tuple[float, float]]:
        """Iterates in x, which is 0, for H x = b, H the truncated Hessian, with a V-cycle as
        preconditioner.

        Yields the largest |b − H x| and the last p·H p; ends if that is not positive. Every x has
        b·x ≥ 0.
        """
        level = self.hierarchy.levels[depth]
        p = np.zeros_like(b)
        q = np.empty_like(b)
        r = b.copy()
        before = 1.0
        rest = max_norm(b)
        curvature = 1.0
        while rest > 0.0 and curvature > 0.0:
            z = self.hierarchy.cycle(depth, r)
            product = np.vdot(r, z)
            p *= product / before
            p += z
            before = product
            curvature = defect(level.H, level.inverse, r, p, q)  # q = r − H p
            if curvature > 0.0:
                alpha = product / curvature
                np.multiply(p, alpha, out=z)
                x += z
                q *= alpha
                r *= 1.0 - alpha
                r += q
                rest = max_norm(r)
            yield rest, curvature

    def _correct(self, depth: int, law: Law, d: Array, b: Array, newton: Array) -> None:
        """Add a Newton step, shortened until it decreases J, with or without a stop at the kinks,
        whichever decreases J more.

        Parameters
        ----------
        depth : int
            The level; 0 is the finest.
        law : Law
            Of that level.
        d : array, shape (nodes, m)
            Written.
        b : array, shape (nodes, m)
            −∇J where d ≠ 0, and 0 elsewhere.
        newton : array, shape (nodes, m)
            The step.
        """
        p = newton.copy()
        stopped = project(d, p)
        if stopped == 0 and self.groups == 1:
            # Without a kink in between J is quadratic, and conjugate gradients have its minimiser
            # along p.
            d += p
            return
        ways = (p, newton) if stopped else (p,)
        (_, t), way = min(
            ((self._line_search(depth, law, d, b, way), way) for way in ways),
            key=lambda found: found[0],
        )
        d += t * way

    def _line_search(
        self, depth: int, law: Law, d: Array, b: Array, p: Array
    ) -> tuple[float, float]:
        """Approximate minimum of J(d + t p) − J(d), and its t in [0, 1].

        Parameters
        ----------
        depth : int
            The level; 0 is the finest.
        law : Law
            Of that level.
        d, b, p : array, shape (nodes, m)
            Increment; −∇J where d ≠ 0, and 0 elsewhere; direction.
        """
        level = self.hierarchy.levels[depth]
        curvature = defect(level.A, level.inverse, b, p, level.rest)
        start = -float(np.vdot(b, p))
        offset = start - slope_along(law.lower, law.upper, d, p, 0.0)
        t, end = lowest_along(
            lambda t: offset + t * curvature + slope_along(law.lower, law.upper, d, p, t), start
        )
        # not from values of J: their differences are soon rounding errors
        return 0.5 * t * (start + end), t


def lowest_along(derivative: Callable[[float], float], start: float) -> tuple[float, float]:
    """A t in [0, 1] just before the minimum of a convex function, and its derivative there.

    By regula falsi (Illinois) for the increasing derivative, which is `start` at 0. For a linear
    derivative one secant step is exact.
    """
    left = 0.0
    low = start
    right = 1.0
    high = derivative(1.0)
    if not low < 0.0:
        return left, low
    if high <= 0.0:
        return right, high
    moved = 0
    for _ in range(40):
        t = right - high * (right - left) / (high - low)
        here = derivative(t)
        if _LINE * start <= here <= -SUM_ROUNDING * start:
            return t, here
        if here < 0.0:
            left = t
            low = here
            high = high * (0.5 if moved < 0 else 1.0)
            moved = -1
        else:
            right = t
            high = here
            low = low * (0.5 if moved > 0 else 1.0)
            moved = 1
    return left, low


def distances(level: Level, law: Law, d: Array, b: Array) -> tuple[float, float]:
    """The distances of :func:`forces`, which writes −∇J to b where d ≠ 0, and 0 elsewhere."""
    found = np.empty(2)
    forces(level.A, *law, d, b, found)
    worst, beyond = found.tolist()
    return worst, beyond


def max_norm(v: Array) -> float:
    """max |v|, without a copy."""
    return max(float(v.max()), -float(v.min()))


def checked_vector(given: Any, name: str, size: int) -> Array:
    """Check that an array has finite numbers and a given size."""
    if given is None:
        raise DeclarationError(name, "the value is missing", f"Give {size} numbers")
    # compiled functions accept only writable arrays
    array = np.require(given, float, ("C", "A", "W"))
    if array.shape != (size,):
        raise DeclarationError(name, f"its shape is {array.shape}", f"Give {size} numbers")
    if not np.all(np.isfinite(array)):
        i = int(np.argmin(np.isfinite(array)))
        raise DeclarationError(f"{name}[{i}]", f"{array[i]} is not finite", "Give finite numbers")
    return array


def block_rows(A: Any, groups: int) -> tuple[BlockRows, Any]:
    """A in block rows, and the matrix with the mean diagonal of every block, after which nodes are
    coarsened."""
    from scipy.sparse import csr_array

    A = csr_array(checked_matrix(A))
    n = A.shape[0]
    if groups < 1 or n % groups:
        raise DeclarationError(
            "groups",
            f"{groups} is not a divisor of the number of rows of A, {n}",
            "Give the size of one group",
        )
    if not A.has_canonical_format:
        A = A.copy()
        A.sum_duplicates()
    if groups == 1:
        return blocks(A, 1), A
    made = blocks(A.tobsr((groups, groups)), groups)
    trace = np.trace(made.value, axis1=1, axis2=2) / groups
    return made, csr_array((trace, made.column, made.start), shape=(n // groups,) * 2)
