"""A rate-independent evolution as data: A, ℓ, Ψ, the initial state and the period, all checked."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from stickslip import page
from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.rate_independent.dissipation import Dissipation
from stickslip.rate_independent.sets.stable_sets import (
    SIZED_AT,
    StableSets,
    largest_weight,
)
from stickslip.rate_independent.signals.reading import read
from stickslip.rate_independent.signals.signal import OF_TIME, Signal, finite
from stickslip.rate_independent.solvers.matrix import checked_matrix
from stickslip.symbolic.formulas import is_finite

STABLE_WITHIN = (
    1e-9  # distance from the stable set, relative to the largest force, that counts as none
)


@dataclass(frozen=True, eq=False)
class Evolution:
    """0 ∈ ∂Ψ(t/ε, ż) + A z − ℓ(t), [M] (2.1).

    Energy ½⟨Az, z⟩ − ⟨ℓ(t), z⟩, A symmetric positive definite; dissipation Ψ(s, ż), of period 1 in
    the phase s = t/ε.

    Parameters
    ----------
    A : array or sparse array, shape (n, n)
        Dense, or in any SciPy sparse format (as assembled by scikit-fem).
    load : callable, (times, values), or list of formulas
        ℓ: a function t → (n,); or a table, linear in between; or n formulas in ``t``.
    dissipation : Dissipation
        Ψ, of dimension n.
    initial : array, shape (n,)
        z at the start of the span; ℓ − A z has to lie in K.
    epsilon : float
        Period of the dissipation in the units of time.
    span : (float, float), optional
        Start, at which `initial` is given, and end. By default the span of a table, or (0, 1).

    Raises
    ------
    DeclarationError
        If A is not symmetric positive definite, shapes do not match, a number is not finite, some
        K(s) does not contain 0, or the initial state is not stable.

    Examples
    --------
    >>> psi = ss.WeightedL1(["1 + cos(2*pi*s)/2"])
    >>> problem = ss.Evolution([[1.0]], "5*t - t**2", psi, [0.0], epsilon=0.1, span=(0, 5))
    """

    A: Any
    load: Any
    dissipation: Dissipation
    initial: Any
    epsilon: float = 1.0
    span: Any = None
    ell: Signal = field(init=False, repr=False)

    def __post_init__(self) -> None:
        A: Any = checked_matrix(self.A)
        n = A.shape[0]
        ell = read(self.load, "load", OF_TIME, (n,))
        values = {
            "A": A,
            "ell": ell,
            "initial": _checked_state(self.initial, n),
            "epsilon": _checked_period(self.epsilon),
            "span": _checked_span(self.span, ell),
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)
        self._check_dissipation()
        ell.over(np.linspace(self.span[0], self.span[1], 5))
        self._check_start()

    @property
    def n(self) -> int:
        """Number of components."""
        return self.A.shape[0]

    @property
    def bounded(self) -> bool:
        """Whether load and dissipation can be bounded on intervals of time, not only evaluated at
        given times."""
        return self.ell.bounded and self.dissipation.bounded

    def sets(self, times: Array) -> StableSets:
        """K(t/ε) at given times."""
        return self.dissipation.sets(np.asarray(times, dtype=float) / self.epsilon)

    def force(self, t: float, z: Array) -> Array:
        """ℓ(t) − A z, the force on the friction elements, shape (n,)."""
        return self.ell.over(np.array([t]))[0] - self.A @ z

    def energy(self, t: float, z: Array) -> float:
        """½⟨Az, z⟩ − ⟨ℓ(t), z⟩."""
        return float(0.5 * z @ (self.A @ z) - z @ self.ell.over(np.array([t]))[0])

    def _repr_html_(self) -> str:
        rows = [
            ("unknowns", str(self.n)),
            ("dissipation", type(self.dissipation).__name__),
            ("period ε", f"{self.epsilon:.9g}"),
            ("time", f"{self.span[0]:g} to {self.span[1]:g}"),
        ]
        return page.whole(
            page.headline("Rate-independent evolution"),
            page.paragraph("0 ∈ ∂Ψ(t/ε, ż) + A z − ℓ(t)"),
            page.tabled(rows),
        )

    def with_period(self, epsilon: float) -> Evolution:
        """The same evolution with another ε."""
        return replace(self, epsilon=epsilon)

    def averaged(self) -> Evolution:
        """The limit ε → 0: the same evolution with Ψ_av ([M] Theorem 2.2).

        Raises
        ------
        DeclarationError
            If the initial state is not stable for Ψ_av, that is, for every phase.
        """
        return replace(self, dissipation=self.dissipation.average())

    @classmethod
    def settled(
        cls, A: Any, load: Any, dissipation: Dissipation, initial: Any, *more: Any, **kwargs: Any
    ) -> Evolution:
        """The evolution that starts from the stable state nearest to `initial` in the energy norm.

        Takes the arguments of `Evolution`. That state is one minimising-movement step away:
        argmin ½⟨Az, z⟩ − ⟨ℓ, z⟩ + Ψ(s, z − initial).

        Parameters
        ----------
        A, load, dissipation, initial, *more, **kwargs
            As for `Evolution`; `initial`, shape (n,), need not be stable.

        Raises
        ------
        DeclarationError
            If an argument is wrong.
        """
        from stickslip.rate_independent.evolution.evolve import nearest_stable

        try:
            return cls(A, load, dissipation, initial, *more, **kwargs)
        except UnstableStart as unstable:
            return cls(A, load, dissipation, nearest_stable(unstable.problem), *more, **kwargs)

    def _check_dissipation(self) -> None:
        if not isinstance(self.dissipation, Dissipation):
            raise DeclarationError(
                "dissipation",
                f"a {type(self.dissipation).__name__} is not a dissipation potential",
                "Give a dissipation potential, like WeightedL1(...)",
            )
        if self.dissipation.dimension != self.n:
            raise DeclarationError(
                "dissipation",
                f"it acts on {self.dissipation.dimension} components, but A has {self.n} rows",
                "Use the same size for both",
            )
        phases = (
            np.linspace(0.0, 1.0, SIZED_AT) if self.dissipation.depends_on_phase else np.zeros(1)
        )
        for s in phases:
            if not self.dissipation.contains(np.zeros(self.n), s):
                raise DeclarationError(
                    "dissipation",
                    f"K(s) does not contain 0 at s = {s:g}",
                    "Give weights that are nonnegative at all phases",
                )

    def _check_start(self) -> None:
        start = self.span[0]
        force = self.force(start, self.initial)[None]
        sets = self.sets(np.array([start]))
        beyond = sets.outside(force)
        scale = max(largest_weight(self.dissipation), float(np.abs(force).max()))
        if sets.largest(beyond)[0] > STABLE_WITHIN * scale:
            i = int(np.argmax(np.abs(beyond[0])))
            raise UnstableStart(self, float(np.linalg.norm(beyond)), i, float(force[0, i]))


class UnstableStart(DeclarationError):
    """The initial state is outside the stable set."""

    def __init__(self, problem: Evolution, distance: float, component: int, force: float) -> None:
        self.problem = problem
        super().__init__(
            "initial",
            f"the force l - A z at t = {problem.span[0]:g} is outside the stable set by "
            f"{distance:.6g} (the force on component {component} would be {force:.6g})",
            "Start from a stable state; Evolution.settled(...) computes the nearest one",
        )


def _checked_state(given: Any, n: int) -> Array:
    try:
        state = np.array(given, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise DeclarationError(
            "initial", f"{given!r} is not a vector of numbers", f"Give {n} numbers"
        ) from None
    if state.ndim == 0 and n == 1:
        state = state[None]
    if state.shape != (n,):
        raise DeclarationError(
            "initial", f"its shape is {state.shape}, but A has {n} rows", f"Give {n} numbers"
        )
    return finite(state, "initial")


def _checked_period(epsilon: Any) -> float:
    if not is_finite(epsilon) or epsilon <= 0.0:
        raise DeclarationError(
            "epsilon", f"{epsilon!r} is not a positive number", "Give a positive number"
        )
    return float(epsilon)


def _checked_span(span: Any, ell: Signal) -> tuple[float, float]:
    if span is None:
        span = ell.span if math.isfinite(ell.span[0]) else (0.0, 1.0)
    try:
        start, end = map(float, span)
    except (TypeError, ValueError, OverflowError):
        raise DeclarationError(
            "span", f"{span!r} is not a time span", "Give (start, end)"
        ) from None
    if not (math.isfinite(start) and math.isfinite(end) and start < end):
        raise DeclarationError(
            "span", f"({start:g}, {end:g}) is not a time span", "Give start < end, both finite"
        )
    ell.check_span(start, end)
    return start, end
