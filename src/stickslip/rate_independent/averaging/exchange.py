"""K_av = ∩ₛ K(s) by semi-infinite exchange: phases whose constraint is violated join, until none is.

Both questions asked of K_av, its support function and its nearest points, are one program: the ξ in all K(s) with the
least ½⟨Qξ, ξ⟩ − ⟨c, ξ⟩. Its multipliers v_k at finitely many phases s_k have the sum c − Qξ; for Q = 0 they are the
measure of [M] (2.3). A round solves the program for a few phases, moves neighbouring ones together where that is
cheaper, and adds those at which ξ lies farthest outside. Close to the solution, Newton's method for ξ, v_k and s_k ends
the search (R. Hettich and K. O. Kortanek, *Semi-infinite programming*, SIAM Review 35 (1993) 380-429).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from stickslip.errors import ConvergenceError, DeclarationError
from stickslip.rate_independent.averaging.closed_forms import measure
from stickslip.rate_independent.averaging.cones import ConeForm, solve
from stickslip.rate_independent.averaging.minima import SAMPLES, golden_section, peaks
from stickslip.rate_independent.dissipation.base import Array, Average, Dissipation, OptimalMotion, Sampled
from stickslip.rate_independent.dissipation.phase import wrapped

MOST_ROUNDS = 60
CLUSTER = 0.02  # phases closer than this may be one
NEAR = 1e-2  # violation, as a multiple of the size of K, from which Newton's method is tried
ROUNDING = 1e-15  # of a distance, as a multiple of the size of K
SHARPEST = 1e-13  # duality gap that rounding allows
STEP = 1e-6  # of differences in Newton's method
SHIFTS = (-2e-3, -1e-3, 1e-3, 2e-3)
DIFFERENCE = np.array([1.0, -8.0, 8.0, -1.0]) / 12e-3  # derivative of fourth order from the values at SHIFTS
Constraint = tuple[float, ConeForm]


@dataclass(frozen=True, eq=False)
class Held:
    """A force ξ and what holds it: motions v_k at phases s_k, at most `violation` outside any K(s)."""

    xi: Array
    phases: Array
    motions: Array
    violation: float = np.inf
    violated: Sequence[float] = ()

    def balanced(self, c: Array, Q: Array | None) -> Held:
        """With motions whose sum is exactly c − Qξ: the largest one takes what is left."""
        motions = self.motions.copy()
        rest = c - motions.sum(axis=0) - (0.0 if Q is None else Q @ self.xi)
        motions[int(np.linalg.norm(motions, axis=1).argmax())] += rest
        return replace(self, motions=motions)

    def gap(self, source: Dissipation) -> float:
        """Duality gap: what the motions cost, less what the force does on them."""
        cost = sum(source.support(v, s) for s, v in zip(self.phases, self.motions, strict=True))
        lengths = float(np.linalg.norm(self.motions, axis=1).sum())
        return float(cost - (self.motions @ self.xi).sum()) + self.violation * lengths


@dataclass(frozen=True, eq=False)
class Intersection(Average):
    """Ψ_av and K_av of a potential whose average has no closed form.

    Parameters
    ----------
    source : Dissipation
    tolerance : float
        Largest duality gap of Ψ_av(V), as a multiple of |V| and of the size of K(s); and how far a point of K_av may
        lie outside any K(s), as a multiple of that size. A nearest point has a duality gap below 1e-13, or tolerance²
        if that is more, and so is accurate to some 1e-6 at worst; but only to the square root of the tolerance where
        K(s) is known by its support function alone.
    """

    source: Dissipation
    tolerance: float = 1e-8

    def __post_init__(self) -> None:
        if not (np.isfinite(self.tolerance) and self.tolerance > 0):
            raise DeclarationError("tolerance", f"{self.tolerance} is not positive", "Give, for example, 1e-8")

    @property
    def dimension(self) -> int:
        return self.source.dimension

    @cached_property
    def size(self) -> float:
        """Largest Ψ(s, ±e_i) at a few phases."""
        axes = np.eye(self.dimension)
        return float(max(self._grid.support(sign * e).max() for e in axes for sign in (1, -1)))

    def support(self, v: ArrayLike, s: float = 0.0) -> float:
        return self.optimal_motion(v).cost

    def exposed(self, v: ArrayLike, s: float = 0.0) -> Array:
        return self._resisting(self.vector(v, "v")).xi

    def optimal_motion(self, V: ArrayLike) -> OptimalMotion:
        """The measure v(s), with the duality gap that was reached.

        Raises
        ------
        ConvergenceError
            If the duality gap stays above the tolerance.
        """
        V = self.vector(V, "V")
        held = self._resisting(V)
        return measure(self.source, V, held.phases, held.motions, held.xi, held.violation)

    def excess(self, xi: ArrayLike, s: float = 0.0) -> float:
        return float(self._peaks(self.vector(xi, "xi"))[1][0])

    def contains(self, xi: ArrayLike, s: float = 0.0, tolerance: float = 1e-12) -> bool:
        """Whether ξ lies in every K(s), up to the tolerance of the average at least."""
        xi = self.vector(xi, "xi")
        return self._violated(xi)[1] <= max(tolerance * float(np.linalg.norm(xi)), self.tolerance * self.size)

    def project(self, xi: ArrayLike, s: float = 0.0, metric: ArrayLike | None = None) -> Array:
        """The nearest point, up to the tolerance.

        Raises
        ------
        ConvergenceError
            If the point stays outside some K(s) by more than the tolerance.
        """
        xi, M = self.vector(xi, "xi"), self.metric(metric)
        phases, _ = self._violated(xi)
        if not len(phases):
            return xi.copy()
        Q = np.eye(self.dimension) if M is None else M
        y = self.source.project(xi, phases[0], M)
        first = Held(y, phases[:1], (Q @ (xi - y))[None])
        rule = self.tolerance if self.source.cone_form(0.0) is None else max(self.tolerance**2, SHARPEST)
        return self._exchange(first, Q @ xi, Q, rule).xi

    def cone_form(self, s: float) -> None:
        return None

    @property
    def frictionless(self) -> Array:
        return self._lineality

    @cached_property
    def _lineality(self) -> Array:
        return lineality(self, 10 * self.tolerance * self.size)

    def _resisting(self, V: Array) -> Held:
        """The force in K_av that resists V most, and the motion it cannot resist better."""
        if not V.any() or self.size == 0.0:
            return Held(np.zeros(len(V)), np.zeros(1), V[None], 0.0)
        # Perhaps one phase does everything: the one at which V costs least.
        s = peaks(-self._grid.support(V), lambda s: -self.source.sampled(s).support(V))[0][:1]
        return self._exchange(Held(self.source.exposed(V, s[0]), s, V[None]), V, None, self.tolerance)

    def _exchange(self, held: Held, c: Array, Q: Array | None, rule: float) -> Held:
        """The ξ with the least ½⟨Qξ, ξ⟩ − ⟨c, ξ⟩ and a duality gap below `rule`."""
        held = self._judged(held)
        constraints = [self._constraint(s, held.xi) for s in held.phases]
        least, value = np.inf, np.inf
        for _ in range(MOST_ROUNDS):
            if self._gap(held, c, Q) <= rule:
                return held
            closer = self._refined(held, c, Q)
            least = min(least, self._gap(closer, c, Q))
            if least <= rule:
                return closer
            # Constraints that do not hold ξ may go only where the value has fallen: then none can come back for ever.
            now = float(c @ held.xi) - (0.0 if Q is None else float(held.xi @ Q @ held.xi) / 2)
            fallen, value = now < value - 1e-9 * abs(now), min(now, value)
            constraints = self._exchanged([] if fallen else constraints, held)
            held = self._judged(self._solved(constraints, c, Q))
        raise ConvergenceError(
            "average over the phase",
            f"after {MOST_ROUNDS} rounds the duality gap is {least:.3g} of what is moved",
            f"Raise the tolerance {self.tolerance:g}",
        )

    def _gap(self, held: Held, c: Array, Q: Array | None) -> float:
        """Duality gap, relative to what is moved; infinite as long as ξ is outside K_av."""
        if held.violation > self.tolerance * self.size:
            return np.inf
        moved = float(np.linalg.norm(c if Q is None else held.motions, axis=-1).sum())
        # A point that lies outside by rounding is moved by rounding.
        least = 0.0 if Q is None else 1e-3 * self.size * float(np.abs(Q).max())
        return held.gap(self.source) / (self.size * max(moved, least))

    def _refined(self, held: Held, c: Array, Q: Array | None) -> Held:
        """What Newton's method makes of it, once that can be hoped for."""
        if held.violation > NEAR * self.size:
            return held
        try:
            return self._judged(refined(self.source, held, c, Q, self.size).balanced(c, Q))
        except ConvergenceError:  # a projection far from K(s)
            return held

    def _solved(self, constraints: Sequence[Constraint], c: Array, Q: Array | None) -> Held:
        """The solution for a few phases."""
        size = float(np.abs(c).max())
        curvature = None if Q is None else Q * (self.size / size)
        xi, motions = solve([form for _, form in constraints], c / size, curvature)
        phases, motions = self._tidied(np.array([s for s, _ in constraints]), motions * size)
        return Held(xi * self.size, phases, motions).balanced(c, Q)

    def _exchanged(self, constraints: list[Constraint], held: Held) -> list[Constraint]:
        """The constraints that hold ξ, those that it violates, and given others."""
        phases = [*held.phases.tolist(), *held.violated]
        if self.source.cone_form(0.0) is not None:  # one constraint says all about a phase
            constraints = [(s, form) for s, form in constraints if s not in phases]
        return [*constraints, *(self._constraint(s, held.xi) for s in phases)]

    def _constraint(self, s: float, xi: Array) -> Constraint:
        return s, self.source.outer_form(s, xi).scaled(1.0 / self.size)

    @cached_property
    def _grid(self) -> Sampled:
        """The source at the phases at which every search starts."""
        return self.source.sampled(np.arange(SAMPLES) / SAMPLES if self.source.depends_on_phase else np.zeros(1))

    def _peaks(self, xi: Array, directions: Sequence[Array] = ()) -> tuple[Array, Array]:
        """Phases at which ξ lies farthest outside K(s), also seen in some directions, or least far inside; how far."""

        def excess(at: Sampled) -> Array:
            return np.max([at.excess(xi), *(float(d @ xi) - at.support(d) for d in directions)], axis=0)

        return peaks(excess(self._grid), lambda s: excess(self.source.sampled(s)))

    def _violated(self, xi: Array, directions: Sequence[Array] = ()) -> tuple[Array, float]:
        """Phases at which ξ lies outside K(s), the worst first, and its largest distance from any K(s)."""
        phases, values = self._peaks(xi, directions)
        phases = phases[values > 0]
        distances = np.array([self.source.distance(xi, s) for s in phases])
        order = np.argsort(-distances)[: int((distances > ROUNDING * self.size).sum())]
        return phases[order], float(distances.max(initial=0.0))

    def _judged(self, held: Held) -> Held:
        lengths = np.linalg.norm(held.motions, axis=1)
        violated, violation = self._violated(held.xi, list(held.motions[lengths > 0] / lengths[lengths > 0, None]))
        return replace(held, violated=violated.tolist(), violation=violation)

    def _tidied(self, phases: Array, motions: Array) -> tuple[Array, Array]:
        """The same measure, with neighbouring phases joined to the best one between them where that costs no more."""
        moving = np.linalg.norm(motions, axis=1) > 1e-10 * np.linalg.norm(motions)
        order = np.argsort(phases[moving])
        phases, motions = phases[moving][order], motions[moving][order]
        # Cut the circle at its widest gap.
        shift = int(np.diff(phases, append=phases[0] + 1.0).argmax()) + 1
        phases, motions = np.roll(phases, -shift), np.roll(motions, -shift, axis=0)
        phases = phases[0] + (phases - phases[0]) % 1.0
        pieces = np.split(np.arange(len(phases)), np.flatnonzero(np.diff(phases) > CLUSTER) + 1)
        tidy = [self._joined(phases[piece], motions[piece]) for piece in pieces]
        return wrapped(np.concatenate([s for s, _ in tidy])), np.vstack([v for _, v in tidy])

    def _joined(self, phases: Array, motions: Array) -> tuple[Array, Array]:
        v = motions.sum(axis=0)
        if not self.source.depends_on_phase:
            return phases[:1], v[None]
        apart = sum(self.source.support(w, s) for s, w in zip(phases, motions, strict=True))
        low, high = phases[:1] - CLUSTER / 2, phases[-1:] + CLUSTER / 2
        together, s = golden_section(lambda s: self.source.sampled(s).support(v), low, high)
        return (s, v[None]) if together[0] <= apart * (1 + 1e-14) else (phases, motions)


def refined(source: Dissipation, held: Held, c: Array, Q: Array | None, size: float) -> Held:
    """Newton's method for ξ, v_k and s_k at once, from close to the solution.

    Qξ + Σ v_k = c, v_k is normal to K(s_k) at ξ, and s_k is stationary for the distance of ξ + v_k from K(s), whose
    square is differentiable in s even where Ψ(s, v_k) has a kink. Derivatives are differences.
    """
    n, k = len(c), len(held.phases)
    length = float(np.linalg.norm(held.motions, axis=1).max())
    curvature = np.zeros((n, n)) if Q is None else Q * (size / length)
    # Unknowns: ξ in units of size, and for each phase v_k in units of length and s_k.
    x, contacts = held.xi / size, np.column_stack([held.motions / length, held.phases])
    reached, best = np.inf, (x, contacts)
    for _ in range(12):
        touch = [_contact(source, x + row[:n], row[n], size) for row in contacts]
        residual = [curvature @ x + contacts[:, :n].sum(axis=0) - c / length]
        residual += [np.append(x - at[:n], at[n]) for at in touch]
        off = float(np.linalg.norm(np.concatenate(residual)))
        if not off < 0.5 * reached:
            break
        reached, best = off, (x, contacts)
        jacobian = np.zeros((n + k * (n + 1), n + k * (n + 1)))
        jacobian[:n, :n] = curvature
        for i, (row, at) in enumerate(zip(contacts, touch, strict=True)):
            own = slice(n + i * (n + 1), n + (i + 1) * (n + 1))
            moved = [_contact(source, x + row[:n] + step[:n], row[n] + step[n], size) for step in STEP * np.eye(n + 1)]
            slopes = np.column_stack([(there - at) / STEP for there in moved])
            slopes[:n] *= -1.0
            jacobian[own, own], jacobian[own, :n] = slopes, slopes[:, :n] + np.eye(n + 1, n)
            jacobian[:n, own] = np.eye(n, n + 1)
        step = np.linalg.lstsq(jacobian, np.concatenate(residual), rcond=1e-10)[0]
        x, contacts = x - step[:n], contacts - step[n:].reshape(k, n + 1)
    x, contacts = best
    return Held(x * size, wrapped(contacts[:, n]), contacts[:, :n] * length)


def _contact(source: Dissipation, beyond: Array, s: float, size: float) -> Array:
    """The point of K(s) nearest to one beyond it, and the slope of half the squared distance in s; in units of size."""
    squares = [np.square(beyond - source.project(size * beyond, s + h) / size).sum() / 2 for h in SHIFTS]
    return np.append(source.project(size * beyond, s) / size, DIFFERENCE @ squares)


def lineality(average: Average, least: float) -> Array:
    """Orthonormal basis, shape (n, k), of the directions in which K_av is no wider than `least`.

    They are the complement of the span of K_av. In a generic direction of the complement of what is known to be spanned
    K_av has width 0 only if nothing is missing.
    """
    n, rng = average.dimension, np.random.default_rng(0)
    spanned = np.zeros((n, 0))
    while spanned.shape[1] < n:
        d = rng.normal(size=n)
        d -= spanned @ (spanned.T @ d)
        d /= np.linalg.norm(d)
        xi = max((average.exposed(sign * d) for sign in (1, -1)), key=lambda point: abs(float(point @ d)))
        if abs(float(xi @ d)) <= least:
            break
        xi -= spanned @ (spanned.T @ xi)
        spanned = np.column_stack([spanned, xi / np.linalg.norm(xi)])
    return np.linalg.qr(np.column_stack([spanned, np.eye(n)]))[0][:, spanned.shape[1] :]
