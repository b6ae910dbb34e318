"""Potentials known only as functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import SupportsFloat

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.numerics.levels import SAME_VALUE
from stickslip.rate_independent.averaging.semi_infinite import Intersection
from stickslip.rate_independent.sets.potential import Dissipation
from stickslip.rate_independent.sets.projections import nearest_by_support
from stickslip.rate_independent.signals.signal import SAMPLE_PHASES, wrapped

_STEPS = (1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 1e-6, 3e-7)  # steps of differences, in units of |v|
_TILT = 1e-5
_BY_DIFFERENCES = 1e-6  # accuracy of a nearest point from differences of the support function …
_BY_SUBGRADIENTS = 1e-9  # … and from its subgradients
_ROUGH = 1e-4  # accuracy of a nearest point that only starts a search
_ENOUGH = 1e-11  # change between steps of differences that is accepted …
_ENOUGH_ASIDE = 1e-9  # … and near a kink


class SupportFunction(Dissipation):
    """Ψ(s, v) as a callable.

    Parameters
    ----------
    function : callable (s, v) -> float
        Ψ: nonnegative, convex and 1-homogeneous in v of shape (n,), 1-periodic in s.
    dimension : int
        n.
    subgradient : callable (s, v) -> array of shape (n,), optional
        A point ξ of K(s) with ⟨ξ, v⟩ = Ψ(s, v). By default it is computed from differences of Ψ.
    depends_on_phase : bool

    Raises
    ------
    DeclarationError
        If Ψ is negative, not finite, not homogeneous or not convex at a sampled point.

    Notes
    -----
    Nearest points are computed from subgradients only. Distances are accurate to 1e-9 of the size
    of K(s), or a ConvergenceError is raised. Without a given subgradient the accuracy is 1e-6 at
    worst, where corners of K(s) meet curved parts, and computations take about four times as long.
    """

    @validated
    def __init__(
        self,
        function: Callable[[float, Array], SupportsFloat],
        dimension: int,
        subgradient: Callable[[float, Array], ArrayLike] | None = None,
        depends_on_phase: bool = True,
    ) -> None:
        if (
            isinstance(dimension, bool)
            or not isinstance(dimension, int | np.integer)
            or dimension < 1
        ):
            raise DeclarationError(
                "dimension", f"{dimension!r} is not a dimension", "Give 1, 2, 3, ..."
            )
        if not callable(function):
            raise DeclarationError(
                "function", "it is not callable", "Give a function of the phase s and of v"
            )
        self.function: Callable[[float, Array], SupportsFloat] = function
        self.subgradient: Callable[[float, Array], ArrayLike] | None = subgradient
        self._dimension = int(dimension)
        self._depends_on_phase = depends_on_phase
        directions = np.random.default_rng(0).normal(size=(len(SAMPLE_PHASES) + 1, dimension))
        for s, v, w in zip(SAMPLE_PHASES, directions, directions[1:], strict=False):
            self._check(s, v, w)
        start = self._psi(0.0, directions[0])
        if depends_on_phase and abs(start - self._psi(1.0, directions[0])) > SAME_VALUE * start:
            raise DeclarationError(
                "function",
                "it differs between the phases s = 0 and s = 1",
                "Write it as a function with period 1 in s",
            )

    @property
    def dimension(self) -> int:
        return self._dimension

    @property
    def depends_on_phase(self) -> bool:
        return self._depends_on_phase

    def support(self, v: ArrayLike, s: float = 0.0) -> float:
        v = self.vector(v, "v")
        length = float(np.linalg.norm(v))
        return length * self._psi(wrapped(s), v / length) if length > 0 else 0.0

    def exposed(self, v: ArrayLike, s: float = 0.0) -> Array:
        v = self.vector(v, "v")
        s = wrapped(s)
        length = float(np.linalg.norm(v))
        if length == 0.0:
            return np.zeros(self.dimension)
        if self.subgradient is None:
            return self._differences(v / length, s)
        return self.vector(self.subgradient(s, v / length), f"subgradient at phase s = {s:g}")

    def project(self, xi: ArrayLike, s: float = 0.0, metric: ArrayLike | None = None) -> Array:
        """The nearest point of the convex hull of subgradients, which are computed as needed."""
        sure = _BY_DIFFERENCES if self.subgradient is None else _BY_SUBGRADIENTS
        return nearest_by_support(self, self.vector(xi, "xi"), s, self.metric(metric), sure=sure)

    def _nearest_at(self, s: float) -> Callable[[Array], Array]:
        # Points of K(s) serve all projections. They are for a search, which four digits do not
        # mislead.
        known: list[Array] = []
        return lambda x: nearest_by_support(self, x, s, None, known, accuracy=_ROUGH)

    def average(self, tolerance: float = 1e-8) -> Intersection:
        return Intersection(self, tolerance)

    def _psi(self, s: float, v: Array) -> float:
        try:
            value = float(self.function(s, v))
        except Exception as error:
            raise DeclarationError(
                "function",
                f"it raises an error at phase s = {s:g} and v = {v} ({type(error).__name__}: "
                f"{error})",
                "Correct it",
            ) from error
        if not (np.isfinite(value) and value >= 0.0):
            reason = "but a dissipation potential is nonnegative, so K(s) must contain 0"
            raise DeclarationError(
                "function", f"it is {value} at phase s = {s:g} and v = {v}, {reason}", "Correct it"
            )
        return value

    def _check(self, s: float, v: Array, w: Array) -> None:
        """Check the properties of a support function in two directions at one phase."""
        one = self._psi(s, v)
        other = self._psi(s, w)
        both = self._psi(s, v + w)
        if abs(self._psi(s, 2 * v) - 2 * one) > SAME_VALUE * one:
            raise DeclarationError(
                "function",
                f"it is not 1-homogeneous at phase s = {s:g}: Psi(2v) is not 2 Psi(v) for v = {v}",
                "Correct it",
            )
        if both > (one + other) * (1 + SAME_VALUE):
            raise DeclarationError(
                "function",
                f"it is not convex at phase s = {s:g}: "
                f"Psi(v + w) > Psi(v) + Psi(w) for v = {v}, w = {w}",
                "Use a potential that is convex in v",
            )

    def _differences(self, v: Array, s: float) -> Array:
        """Subgradient at a unit vector by central differences of fourth order.

        A step is accepted if the previous one agrees and Euler's identity ⟨ξ, v⟩ = Ψ(s, v) holds.
        If none is, v is on a kink; a subgradient at a nearby point off the kink is then used: its
        error in Ψ(s, v) is of the order of the squared distance.
        """
        psi = self._psi(s, v)
        axes = np.eye(self.dimension)
        tilts = _TILT * np.random.default_rng(1).normal(size=(8, self.dimension))
        best = v * psi
        least = np.inf
        for w, steps, enough in [
            (v, _STEPS, _ENOUGH),
            *((v + tilt, _STEPS[-2:], _ENOUGH_ASIDE) for tilt in tilts),
        ]:
            last = np.full(self.dimension, np.inf)
            for h in steps:
                near = [self._psi(s, w + h * e) - self._psi(s, w - h * e) for e in axes]
                far = [self._psi(s, w + 2 * h * e) - self._psi(s, w - 2 * h * e) for e in axes]
                slope = (8 * np.array(near) - np.array(far)) / (12 * h)
                missing = max(abs(float(slope @ w) - self._psi(s, w)), psi - float(slope @ v))
                off = max(missing, float(np.abs(slope - last).max()))
                if off < least:
                    best, least = slope, off
                if least <= enough * psi:
                    return best
                last = slope
        return best
