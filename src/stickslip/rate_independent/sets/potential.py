"""The interface of dissipation potentials."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from stickslip import page
from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.numerics.levels import COMPUTED_ZERO, LAST_DIGITS, ROUNDED_SUM, SYMMETRIC
from stickslip.rate_independent.sets.cones import ConeForm, polyhedron
from stickslip.rate_independent.sets.phase_intervals import (
    NOWHERE_NEAR,
    AtPhases,
    Estimated,
    Fixed,
    Near,
    OneByOne,
    PhaseIntervals,
)
from stickslip.rate_independent.sets.projections import nearest_by_support, slope_by_differences
from stickslip.rate_independent.sets.stable_sets import ConvexSets, StableSets
from stickslip.rate_independent.signals.signal import Signal, finite
from stickslip.results import listed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DRAWN = 8  # number of components up to which a potential is drawn in a notebook
_DIFFERENCE = 1e-7  # step for slopes of projections relative to the largest force: about √ε
_OUTSIDE = 1e-8  # relative distance outside K(s) at which its normal is computed
_DEPTH = 1e-8  # accuracy of the distance of a force from the boundary
_AXIS = 1e-8  # component of a basis of frictionless directions above which an axis is one of them


class Dissipation(ABC):
    """A dissipation potential Ψ(s, ·): convex and 1-homogeneous on Rⁿ, 1-periodic in the phase s,
    [M] section 2.1.

    It is the support function of its stable set K(s) = ∂Ψ(s, 0), a closed convex set that contains
    0: Ψ(s, v) = sup {⟨ξ, v⟩ : ξ ∈ K(s)}.

    Attributes
    ----------
    dimension : int
        n.
    depends_on_phase : bool
    kinds : dict of str to type, of the class
        Potentials available in model files, by their registered names: ``class Mine(Dissipation,
        kind="mine")``. Their fields are the keys of a file.

    Notes
    -----
    A user-defined potential must provide its dimension, whether it depends on the phase, its
    support function, exposed points, and its average; everything else has a default implementation.
    Further methods may be overridden for speed, accuracy, or bounds between the sampled phases.
    """

    kinds: ClassVar[dict[str, type[Dissipation]]] = {}

    def __init_subclass__(cls, kind: str | None = None, **more: Any) -> None:
        super().__init_subclass__(**more)
        for name in ("support", "exposed", "excess", "project", "average", "hessian"):
            if name in vars(cls):
                setattr(cls, name, validated(vars(cls)[name]))
        if kind is not None:
            Dissipation.kinds[kind] = cls

    @property
    @abstractmethod
    def dimension(self) -> int:
        """n."""

    @property
    @abstractmethod
    def depends_on_phase(self) -> bool:
        """Whether Ψ(s, ·) depends on s."""

    def as_formula(self) -> str:
        """Ψ as a formula in ``v1``, ..., ``vn``, as accepted for the dissipation of a contact.

        Raises
        ------
        DeclarationError
            If it depends on the phase, or this kind of potential has no formula.
        """
        if self.depends_on_phase:
            raise DeclarationError(
                "dissipation",
                "it depends on a phase, which a contact does not have",
                "Declare a threshold that depends on time instead",
            )
        return self._formula()

    def _formula(self) -> str:
        raise DeclarationError(
            "dissipation",
            f"{type(self).__name__} has no formula",
            "Give an Ellipsoid, a SupportFormula, or a formula as text",
        )

    @abstractmethod
    def support(self, v: ArrayLike, s: float = 0.0) -> float:
        """Support function of K(s) at v, shape (n,): the number Ψ(s, v)."""

    @abstractmethod
    def exposed(self, v: ArrayLike, s: float = 0.0) -> Array:
        """A point ξ of K(s) with ⟨ξ, v⟩ = Ψ(s, v): a subgradient of Ψ(s, ·) at v, shape (n,)."""

    def project(self, xi: ArrayLike, s: float = 0.0, metric: ArrayLike | None = None) -> Array:
        """The point y of K(s) that minimises ½⟨M(ξ − y), ξ − y⟩.

        Parameters
        ----------
        xi : array of shape (n,)
        s : float
            Phase.
        metric : array of shape (n, n), optional
            M, symmetric and positive definite; by default the identity.

        Returns
        -------
        ndarray of shape (n,)

        Raises
        ------
        DeclarationError
            If an argument has the wrong shape, or it is not a valid potential at this phase.
        ConvergenceError
            If an iterative projection cannot reach its accuracy.

        Notes
        -----
        By default it is found from points exposed by the support function; the distance is accurate
        to 1e-9 of the size of K(s).
        """
        return nearest_by_support(self, self.vector(xi, "xi"), s, self.metric(metric))

    def projection(self, xi: Array, s: float = 0.0) -> tuple[Array, Array]:
        """The Euclidean projection of ξ, shape (n,), onto K(s), and a generalised derivative of it,
        shape (n, n)."""
        y = self.project(xi, s)
        return y, slope_by_differences(
            lambda x: self.project(x, s), xi, y, _DIFFERENCE * float(np.abs(xi).max() or 1.0)
        )

    def member(self, xi: Array, s: float) -> Array:
        """The point of K(s) from which the distance of ξ, shape (n,), is measured: by default the
        nearest."""
        return self.project(xi, s)

    def cone_form(self, s: float) -> ConeForm | None:
        """K(s) as an image of cones; None if it is known by its support function only."""
        return None

    @abstractmethod
    def average(self, tolerance: float = 1e-8) -> Average:
        """K_av = ∩ₛ K(s) and its support function Ψ_av, [M] (2.3).

        Parameters
        ----------
        tolerance : float
            Accuracy if there is no closed form, relative to the size of K(s).

        Raises
        ------
        ConvergenceError
            If the tolerance cannot be reached.
        """

    @property
    def doubt(self) -> str:
        """Properties that are not proved, as stated in certificates; by default none."""
        return ""

    @classmethod
    def variables(cls, given: Mapping[str, Any]) -> tuple[str, ...]:
        """Names that its formulas in a model file may use in addition to the phase; by default
        none.

        Parameters
        ----------
        given : mapping
            The fields as given in the file.
        """
        return ()

    def outer_form(self, s: float, xi: Array) -> ConeForm:
        """A bounded image of cones that contains K(s), but not a given ξ outside it: K(s) itself
        where it is one, else the half-space that separates ξ, and a box around K(s)."""
        form = self.cone_form(s)
        if form is not None:
            return form
        axes = np.eye(self.dimension)
        beyond = xi - self.project(xi, s)
        length = float(np.linalg.norm(beyond))
        normals = np.vstack([axes, -axes, *([beyond / length] if length > 0 else [])])
        return polyhedron(normals, np.array([self.support(d, s) for d in normals]))

    @validated
    def value(self, s: float, v: ArrayLike) -> float:
        """Ψ(s, v) for v of shape (n,)."""
        return self.support(v, s)

    @validated
    def distance(self, xi: ArrayLike, s: float = 0.0) -> float:
        """Euclidean distance of ξ, shape (n,), from K(s)."""
        xi = self.vector(xi, "xi")
        return float(np.linalg.norm(xi - self.member(xi, s)))

    @validated
    def contains(self, xi: ArrayLike, s: float = 0.0, tolerance: float = 1e-12) -> bool:
        """Return whether ξ, shape (n,), lies in K(s), up to `tolerance` relative to the length of
        ξ, or to the extent of K(s) in its direction."""
        xi = self.vector(xi, "xi")
        beyond = xi - self.member(xi, s)
        distance = float(np.linalg.norm(beyond))
        if distance == 0.0:
            return True
        return distance <= tolerance * max(
            float(np.linalg.norm(xi)), self.support(beyond / distance, s)
        )

    def excess(self, xi: ArrayLike, s: float = 0.0) -> float:
        """Signed excess of ξ, shape (n,), over K(s): positive outside, negative inside, in units of
        a distance."""
        xi = self.vector(xi, "xi")
        nearest = self._nearest_at(s)
        outside = float(np.linalg.norm(xi - nearest(xi)))
        length = float(np.linalg.norm(xi))
        return outside if outside > ROUNDED_SUM * length else -self._depth(xi, length, s, nearest)

    @validated
    def gauge(self, xi: ArrayLike, s: float = 0.0) -> float:
        """The smallest γ ≥ 0 with ξ in γ K(s), for ξ of shape (n,): the polar of Ψ(s, ·), at most 1
        exactly in K(s); infinite if no multiple of K(s) reaches ξ."""
        xi = self.vector(xi, "xi")
        length = float(np.linalg.norm(xi))
        if length == 0.0:
            return 0.0
        direction = xi / length
        reach = self._reach(direction, s, lambda x: self.project(x, s), LAST_DIGITS)
        # The normal of K(s) is most accurate at a small distance outside, neither far nor too
        # close.
        beyond = (1.0 + _OUTSIDE) * reach * direction
        ahead = beyond - self.project(beyond, s)
        slope = float(ahead @ direction)
        if slope > 0.0:
            reach = min(reach, self.support(ahead, s) / slope)
        return length / reach if reach > LAST_DIGITS * length else np.inf

    def holds(self, xi: Array, s: float, noise: float) -> bool:
        """Return whether ξ, shape (n,), lies outside K(s) by no more than `noise`."""
        return self.excess(xi, s) <= noise

    def sampled(self, phases: Array) -> AtPhases:
        """The potential at several phases, shape (m,)."""
        return OneByOne(self, phases)

    def sets(self, phases: Array) -> StableSets:
        """K(s) at several phases, shape (m,), as required by the steps of an evolution; a single
        row if it does not depend on the phase.

        Raises
        ------
        DeclarationError
            If it is not a valid potential at one of them.
        """
        return ConvexSets(self, phases if self.depends_on_phase else phases[:1])

    @property
    def thresholds(self) -> tuple[Signal, Signal] | None:
        """ρ⁺ and ρ⁻ as functions of the phase, if K(s) is [−ρ⁻(s), ρ⁺(s)] and they are known: then
        evolutions are exact plays."""
        return None

    def halfspaces(self, phases: Array) -> tuple[Array, Array] | None:
        """Unit normals, shape (k, n), and offsets, shape (k,), of the half-spaces that define K(s)
        at several phases, if it is given by half-spaces."""
        return None

    @property
    def bounded(self) -> bool:
        """Whether the potential consists of numbers and formulas, so that it can be bounded over
        all phases, not only evaluated at some; by default, whether it is independent of the
        phase."""
        return not self.depends_on_phase

    def over(self, low: Array, high: Array) -> PhaseIntervals[Any]:
        """The potential on intervals of phases, shape (m,) each, within one period: 0 <= low <=
        high <= 1.

        Its bounds for the phases in between are proved if the potential is `bounded`, and estimated
        otherwise.
        """
        start, end, middle = (OneByOne(self, s) for s in (low, high, 0.5 * (low + high)))
        return Estimated(start, end, middle) if self.depends_on_phase else Fixed(start, end)

    def closest(self, phases: Array, xi: Array) -> Array:
        """Phases near given ones, shape (k,), at which a force is approximately closest to the
        boundary of K(s)."""
        return phases

    def around(self, phases: Array, xi: Array, enough: float) -> Near:
        """Intervals around phases, shape (k,), at which ξ may touch K(s), on which its excess is at
        most `enough`.

        These bounds are proved from second derivatives. By default, there are no such intervals.
        """
        return NOWHERE_NEAR

    @validated
    def prox(self, v: ArrayLike, s: float = 0.0, step: float = 1.0) -> Array:
        """Proximal step: the minimiser w of ½|w − v|² + step Ψ(s, w), shape (n,).

        By Moreau's decomposition it is v minus its nearest point in step K(s).
        """
        v = self.vector(v, "v")
        if not 0.0 < float(step) < np.inf:
            raise DeclarationError(
                "step", f"{step} is not positive", "Give the length of a proximal step"
            )
        return v - float(step) * self.project(v / float(step), s)

    def vector(self, given: ArrayLike, name: str) -> Array:
        """The argument as an array of shape (n,); rejects other sizes and NaN."""
        try:
            x = np.asarray(given, dtype=float)
        except (TypeError, ValueError, OverflowError):
            raise DeclarationError(
                name, "it is not a vector of numbers", f"Give {self.dimension} numbers"
            ) from None
        if x.shape != (self.dimension,):
            raise DeclarationError(
                name,
                f"its shape is {x.shape}, but the potential is defined on R^{self.dimension}",
                "Give a vector of this dimension",
            )
        return finite(x, name)

    def metric(self, given: ArrayLike | None) -> Array | None:
        """Check the metric of a projection, which must be symmetric and positive definite."""
        return None if given is None else spd(given, self.dimension, "metric")

    # -- a page of a notebook ----------------------------------------------------------------------

    def _repr_html_(self) -> str:
        picture = page.drawn(self._picture) if self._drawn else page.Html("")
        return page.whole(page.headline(type(self).__name__), picture, page.tabled(self._said()))

    @property
    def _drawn(self) -> bool:
        """Whether the HTML page includes a figure."""
        return self.dimension <= _DRAWN

    def _picture(self) -> Figure:
        """Stable sets and costs, with those of the average."""
        from stickslip.figures.dissipation import plot_average

        return plot_average(self, self.average())

    def _said(self) -> list[tuple[str, str]]:
        """Its summary."""
        depends = "the phase s = t/ε" if self.depends_on_phase else "the rates only"
        known = "bounded at all phases" if self.bounded else "known at sampled phases"
        return [
            ("dimension", str(self.dimension)),
            ("depends on", depends),
            *([("phases", known)] if self.depends_on_phase else []),
            *([("not proved", self.doubt)] if self.doubt else []),
        ]

    def _nearest_at(self, s: float) -> Callable[[Array], Array]:
        """The Euclidean projection onto K(s), for several points, as accurate as a search over the
        phase needs it."""
        return lambda x: self.project(x, s)

    def _depth(
        self, xi: Array, length: float, s: float, nearest: Callable[[Array], Array]
    ) -> float:
        """Distance from ξ, a point of K(s), to the boundary along its ray; at 0, the smallest
        distance along the axes."""
        if length == 0.0:
            axes = np.eye(self.dimension)
            return min(self.support(sign * e, s) for e in axes for sign in (1.0, -1.0))
        return max(self._reach(xi / length, s, nearest, _DEPTH) - length, 0.0)

    def _reach(
        self, direction: Array, s: float, nearest: Callable[[Array], Array], accuracy: float
    ) -> float:
        """Distance from 0 to the boundary of K(s) along a unit vector."""
        reach = self.support(direction, s)
        # Newton's method from outside: cut the ray by the supporting hyperplane at the nearest
        # point of K(s).
        for _ in range(60):
            ahead = reach * direction - nearest(reach * direction)
            slope = float(ahead @ direction)
            if slope <= min(COMPUTED_ZERO, accuracy) * reach:
                break
            reach, last = min(reach, self.support(ahead, s) / slope), reach
            if last - reach <= accuracy * last:
                break
        return reach


@dataclass(frozen=True, eq=False)
class OptimalMotion:
    """A measure v(s) that attains the infimum of [M] (2.3): the distribution of the motion over
    phases.

    Attributes
    ----------
    phases : ndarray of shape (m,)
        Phases at which something moves, increasing.
    motions : ndarray of shape (m, n)
        What moves at each; the sum over the phases is V.
    cost : float
        Σ Ψ(s_k, v_k), an upper bound of Ψ_av(V).
    bound : float
        ⟨ξ, V⟩ − δ Σ|v_k| with the force ξ that holds V back, at most δ outside every K(s). No
        measure that moves as much as this one costs less.
    gap : float
        Duality gap: cost − bound.
    """

    phases: Array
    motions: Array
    cost: float
    bound: float

    @property
    def gap(self) -> float:
        """Duality gap: cost − bound."""
        return self.cost - self.bound


class ClosedForm(NamedTuple):
    """An average in closed form.

    Attributes
    ----------
    terms : list of str
        Whose sum Ψ_av(v) is, as a person would write them.
    numbers : dict of str to lists
        By name.
    """

    terms: list[str]
    numbers: dict[str, Any]


class Average(Dissipation):
    """The averaged potential Ψ_av, the support function of K_av = ∩ₛ K(s); it does not depend on
    the phase.

    Attributes
    ----------
    frictionless : ndarray of shape (n, k)
        Orthonormal basis of the directions V with Ψ_av(V) = Ψ_av(−V) = 0.
    """

    @property
    def depends_on_phase(self) -> bool:
        """False: the phase is averaged out."""
        return False

    @property
    @abstractmethod
    def frictionless(self) -> Array:
        """Orthonormal basis, shape (n, k), of the directions V with Ψ_av(V) = Ψ_av(−V) = 0."""

    @abstractmethod
    def optimal_motion(self, V: ArrayLike) -> OptimalMotion:
        """The measure v(s) of [M] (2.3) with the displacement V, shape (n,), of minimum cost."""

    @property
    @abstractmethod
    def samples(self) -> int:
        """Number of examined phases; 0 if all phases are covered by bounds."""

    @property
    def bounded(self) -> bool:
        """Whether all phases are covered by bounds."""
        return self.samples == 0

    @property
    def coverage(self) -> str:
        """Description of the phases that were examined."""
        return (
            f"as sampled at {self.samples} phases"
            if self.samples
            else "all phases covered by bounds"
        )

    @property
    def closed_form(self) -> ClosedForm | None:
        """The average in closed form, if each threshold is replaced by its minimum over the
        phase."""
        return None

    @property
    def verdict(self) -> str:
        """Whether friction vanishes in some direction, as a sentence."""
        count = self.frictionless.shape[1]
        n = self.dimension
        if count == 0:
            return "Friction vanishes in no direction"
        if count == n:
            return "Friction vanishes in every direction: K_av = {0}"
        axes = [i for i in range(n) if np.abs(self.frictionless[i]).max() > _AXIS]
        listed = ", ".join(map(str, axes[:10]))
        more = ", ..." if len(axes) > 10 else ""
        named = f"among the components {listed}{more}"
        return f"Friction vanishes in {count} of {n} directions, {named}: K_av has no interior"

    def average(self, tolerance: float = 1e-8) -> Self:
        """Itself."""
        return self

    @property
    def _drawn(self) -> bool:
        return self.dimension == 2

    def _picture(self) -> Figure:
        from stickslip.figures.dissipation import stable_sets
        from stickslip.figures.drawing.style import new_figure

        figure = new_figure(4.4, 4.4)
        stable_sets(figure.add_subplot(), self)
        return figure

    def _said(self) -> list[tuple[str, str]]:
        known = self.closed_form
        terms = listed(known.terms) if known else ""
        return [
            ("dimension", str(self.dimension)),
            *([("Ψ_av(v), the sum of", terms)] if terms else []),
            ("friction", self.verdict),
            ("phases", self.coverage),
        ]


def spd(given: ArrayLike, n: int, where: str) -> Array:
    """A symmetric positive definite array of shape (n, n); refuses anything else."""
    from scipy.linalg import LinAlgError, cholesky

    try:
        matrix = np.asarray(given, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise DeclarationError(
            where, "it is not a matrix of numbers", f"Give a {n} x {n} array"
        ) from None
    if matrix.shape != (n, n):
        raise DeclarationError(where, f"its shape is {matrix.shape}", f"Give a {n} x {n} array")
    finite(matrix, where)
    lopsided = np.abs(matrix - matrix.T).max(initial=0.0)
    if lopsided > SYMMETRIC * np.abs(matrix).max(initial=0.0):
        raise DeclarationError(
            where, f"it is not symmetric (M - M^T reaches {lopsided:.3g})", "Give (M + M^T)/2"
        )
    try:
        cholesky(matrix, lower=True)
    except LinAlgError:
        raise DeclarationError(
            where, "it is not positive definite", "Give a positive definite matrix"
        ) from None
    return matrix
