"""K_av = ∩ₛ K(s) by semi-infinite exchange: phases with violated constraints are added until none
remains.

The support function and the nearest points of K_av are solutions of the same program: the ξ in all
K(s) that minimises ½⟨Qξ, ξ⟩ − ⟨c, ξ⟩. Its multipliers v_k at finitely many phases s_k have the sum
c − Qξ; for Q = 0 they are the measure of [M] (2.3). A round solves the program for a few phases,
merges neighbouring ones if that reduces the cost, and adds those at which the excess of ξ is
largest. Close to the solution, Newton's method for ξ, v_k and s_k completes the search (R. Hettich
and K. O. Kortanek, *Semi-infinite programming*, SIAM Review 35 (1993) 380-429).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arguments import check_tolerances
from stickslip.arrays import Array
from stickslip.errors import ConvergenceError
from stickslip.kept import cached_property
from stickslip.numerics.golden import golden_section
from stickslip.numerics.levels import FEW_ROUNDINGS, LAST_DIGITS
from stickslip.rate_independent.averaging.cover import NO_PHASES, Cover, SearchResult
from stickslip.rate_independent.averaging.minima import refined_maxima
from stickslip.rate_independent.averaging.optimal_motion import measure_with_sum
from stickslip.rate_independent.averaging.polishing import ForceWithMultipliers, refined
from stickslip.rate_independent.sets.cones import ConeForm, solve_cones
from stickslip.rate_independent.sets.phase_intervals import (
    AtPhases,
    Fixed,
    OneByOne,
    PhaseIntervals,
    lengths,
)
from stickslip.rate_independent.sets.potential import Average, Dissipation, OptimalMotion
from stickslip.rate_independent.signals.signal import wrapped

MOST_ROUNDS = 60
_FORGETFUL = 6  # number of iterations in which constraints may be removed
_CLUSTER = 0.02  # phases closer than this may be the same
_SAME = 1e-6  # phases closer than this are the same
_NEAR = 1e-2  # violation, as a multiple of the size of K, below which Newton's method is tried
_SHARPEST = 1e-13  # smallest duality gap, limited by rounding errors
_MOST_PEAKS = 16  # largest number of phases added in one iteration
_SURE = 0.25  # fraction of the tolerance for the part of K(s) that is not sampled
_MEMORY = 256  # number of solutions that are stored
_LOOKS = 192  # number of forces whose distances from K(s) are stored
_AT_ONCE = 64  # number of forces that are examined together
_FALLEN = 1e-9  # relative decrease of a bound after which phases are discarded
_MOVING = 1e-10  # relative to the norm of a measure: a phase with less has no motion
Constraint = tuple[float, ConeForm]


@dataclass(frozen=True, eq=False)
class Intersection(Average):
    """Ψ_av and K_av of a potential whose average has no closed form.

    Parameters
    ----------
    source : Dissipation
    tolerance : float
        Largest duality gap of Ψ_av(V), relative to |V| and the size of K(s), and largest distance
        of a point of K_av from any K(s), relative to that size; all phases are covered by bounds if
        the source is bounded. A nearest point has a duality gap below 1e-13, or tolerance² if that
        is larger. It lies outside K(s) by at most the tolerance, so its error may reach the square
        root of the tolerance, relative to the size of K(s).
    """

    source: Dissipation
    tolerance: float = 1e-8

    def __post_init__(self) -> None:
        check_tolerances(tolerance=self.tolerance)

    @property
    def dimension(self) -> int:
        return self.source.dimension

    @property
    def doubt(self) -> str:
        return self.source.doubt

    @cached_property
    def cover(self) -> Cover:
        """All phases."""
        return Cover(self.source)

    @property
    def samples(self) -> int:
        return 0 if self.source.bounded else self.cover.looked_at

    @cached_property
    def size(self) -> float:
        """Largest Ψ(s, ±e_i) at the first phases."""
        axes = np.eye(self.dimension)
        first = self.cover.first.start
        return float(max(first.support(sign * e).max() for e in axes for sign in (1, -1)))

    def support(self, v: ArrayLike, s: float = 0.0) -> float:
        return self.optimal_motion(v).cost

    def exposed(self, v: ArrayLike, s: float = 0.0) -> Array:
        return self._resisting(self.vector(v, "v")).xi

    def optimal_motion(self, V: ArrayLike) -> OptimalMotion:
        """The measure v(s), with its duality gap.

        Raises
        ------
        ConvergenceError
            If the duality gap stays above the tolerance.
        """
        v = self.vector(V, "V")
        held = self._resisting(v)
        return measure_with_sum(self.source, v, held.phases, held.motions, held.xi, held.bound)

    def excess(self, xi: ArrayLike, s: float = 0.0) -> float:
        return float(self.excesses(self.vector(xi, "xi")[None])[0])

    def holds(self, xi: Array, s: float, noise: float) -> bool:
        return not self._beyond(xi, noise) and _worst(self._look(xi)) <= noise

    def contains(self, xi: ArrayLike, s: float = 0.0, tolerance: float = 1e-12) -> bool:
        """Return whether ξ lies in every K(s), up to the tolerance of the average at least."""
        xi = self.vector(xi, "xi")
        enough = max(tolerance * float(np.linalg.norm(xi)), self.tolerance * self.size)
        return self.cover.look(xi, enough).bound <= enough

    def project(self, xi: ArrayLike, s: float = 0.0, metric: ArrayLike | None = None) -> Array:
        """The nearest point, up to the tolerance.

        Raises
        ------
        ConvergenceError
            If the point stays outside some K(s) by more than the tolerance.
        """
        xi = self.vector(xi, "xi")
        M = self.metric(metric)
        if not self._beyond(xi, LAST_DIGITS * self.size):
            looked = self._look(xi)
            if (
                looked.excess.max() <= LAST_DIGITS * self.size
                and looked.bound <= self.tolerance * self.size
            ):
                return xi.copy()
        Q = np.eye(self.dimension) if M is None else M
        rule = (
            self.tolerance
            if self.source.cone_form(0.0) is None
            else max(self.tolerance**2, _SHARPEST)
        )
        start = self._ahead(xi, Q) if self._forces else None
        if start is not None and start.motions.any():
            held = self._newton(start, Q @ xi, Q)
            if self._gap(held, Q @ xi, Q) <= rule:
                return self._kept(held, Q).xi
        looked = self._look(xi)
        first = self._at_once(xi, Q, float(looked.phases[looked.excess.argmax()]))
        return self._exchange(first, Q @ xi, Q, rule).xi

    def cone_form(self, s: float) -> None:
        return None

    def sampled(self, phases: Array) -> AtPhases:
        return Together(self, phases)

    def over(self, low: Array, high: Array) -> PhaseIntervals[Any]:
        ends = Together(self, low)
        return FixedTogether(ends, ends)

    def excesses(self, xi: Array) -> Array:
        """Excess of forces, shape (m, n), over K_av, shape (m,)."""
        known = [self._known(row) for row in xi]
        excess = np.array(
            [_worst(looked) if looked and np.isfinite(looked.bound) else np.nan for looked in known]
        )
        (new,) = np.nonzero(np.isnan(excess))
        for part in np.array_split(new, -(-len(new) // _AT_ONCE)) if len(new) else []:
            excess[part] = self.cover.excess(xi[part], _SURE * self.tolerance * self.size)
        return excess

    @property
    def frictionless(self) -> Array:
        return self._lineality

    @cached_property
    def _lineality(self) -> Array:
        return lineality(self, 10 * self.tolerance * self.size)

    @cached_property
    def _memory(self) -> deque[ForceWithMultipliers]:
        """Last results, as starts for the next searches, which are often nearby."""
        return deque(maxlen=_MEMORY)

    @cached_property
    def _forces(self) -> deque[ForceWithMultipliers]:
        """The last two nearest points."""
        return deque(maxlen=2)

    @cached_property
    def _looked(self) -> deque[SearchResult]:
        """Phases of the last evaluations; the forces are rows of a circular buffer."""
        return deque(maxlen=_LOOKS)

    @cached_property
    def _places(self) -> Array:
        return np.full((_LOOKS, self.dimension), np.inf)

    def _beyond(self, xi: Array, least: float) -> bool:
        """Return whether the excess of ξ is larger than a limit at the phases of the last
        multipliers."""
        sets = self._forces[-1].sets if self._forces else None
        return sets is not None and float(sets.excess(xi).max()) > least

    def _known(self, xi: Array) -> SearchResult | None:
        """Known results for a force that agrees with a previous one up to rounding."""
        away = np.abs(self._places - xi).max(axis=1)
        k = int(away.argmin())
        if away[k] > LAST_DIGITS * self.size:
            return None
        looked = self._looked[k - _LOOKS + len(self._looked)]
        return looked._replace(bound=looked.bound + float(away[k]) * len(xi))

    def _look(self, xi: Array, touching: Array = NO_PHASES) -> SearchResult:
        looked = self._known(xi)
        if looked is None:
            looked = self.cover.look(xi, _SURE * self.tolerance * self.size, touching)
            self._looked.append(looked)
            self._places[:-1] = self._places[1:].copy()
            self._places[-1] = xi
        return looked

    def _resisting(self, V: Array) -> ForceWithMultipliers:
        """The force in K_av that resists V most, and the motion it cannot resist better."""
        if not V.any() or self.size == 0.0:
            return ForceWithMultipliers(np.zeros(len(V)), np.zeros(1), V[None], 0.0, 0.0)
        if (again := self._remembered(V, self.tolerance)) is not None:
            return again
        # First candidate: all motion at the phase of minimum cost of V.
        costs = self.cover.first.start.support(V)
        k = int(costs.argmin())
        low = self.cover.low
        high = self.cover.high
        near = np.array([low[k - 1] - (k == 0), low[k], high[k]])[:, None]
        values = np.array([costs[k - 1], costs[k], costs[(k + 1) % len(costs)]])[:, None]
        s = wrapped(refined_maxima(near, -values, lambda s: -self.source.sampled(s).support(V))[0])
        return self._exchange(
            ForceWithMultipliers(self.source.exposed(V, float(s[0])), s, V[None]),
            V,
            None,
            self.tolerance,
        )

    def _exchange(
        self, held: ForceWithMultipliers, c: Array, Q: Array | None, rule: float
    ) -> ForceWithMultipliers:
        """The ξ that minimises ½⟨Qξ, ξ⟩ − ⟨c, ξ⟩, with a duality gap below `rule`."""
        held = self._judged(held)
        constraints = [self._constraint(s, held.xi) for s in held.phases]
        least, value = np.inf, np.inf
        for k in range(MOST_ROUNDS):
            if self._gap(held, c, Q) <= rule:
                return self._kept(held, Q)
            closer = self._refined(held, c, Q)
            least = min(least, self._gap(closer, c, Q))
            if least <= rule:
                return self._kept(closer, Q)
            # Inactive constraints are dropped only if the value has decreased, and only in early
            # rounds, so that the exchange cannot cycle.
            now = float(c @ held.xi) - (0.0 if Q is None else float(held.xi @ Q @ held.xi) / 2)
            fallen = k < _FORGETFUL and now < value - _FALLEN * abs(now)
            value = min(now, value)
            constraints = self._exchanged([] if fallen else constraints, held, closer)
            held = self._judged(self._solved(constraints, c, Q))
        raise ConvergenceError(
            "average over the phase",
            f"after {MOST_ROUNDS} iterations the relative duality gap is {least:.3g}",
            f"Increase the tolerance {self.tolerance:g}",
        )

    def _kept(self, held: ForceWithMultipliers, Q: Array | None) -> ForceWithMultipliers:
        self._memory.append(held)
        if Q is not None:
            self._forces.append(held)
        return held

    def _remembered(self, V: Array, rule: float) -> ForceWithMultipliers | None:
        """The force opposing V, if it follows from previous results."""
        if not self._memory:
            return None
        # A motion is held by the force that held one in the same direction.
        moved = np.array([held.moved for held in self._memory])
        last = self._memory[
            int(np.argmax(moved @ V / np.maximum(lengths(moved), np.finfo(float).tiny)))
        ]
        share = (
            max(
                float(last.moved @ V) / max(float(last.moved @ last.moved), np.finfo(float).tiny),
                0.0,
            )
            or 1.0
        )
        held = replace(last, motions=last.motions * share).balanced(V, None).merged(_SAME)
        if self._gap(held, V, None) > rule:
            held = self._newton(held, V, None)
        return self._kept(held, None) if self._gap(held, V, None) <= rule else None

    def _ahead(self, xi: Array, Q: Array) -> ForceWithMultipliers:
        """A start for the point nearest to ξ, from the last two points, since steps of an evolution
        are close."""
        last, before = self._forces[-1], self._forces[0]
        near = (
            last.phases.shape == before.phases.shape
            and np.abs(last.phases - before.phases).max() < _CLUSTER
        )
        phases = 2.0 * last.phases - before.phases if near else last.phases
        if len(phases) == 1:
            return self._at_once(xi, Q, float(wrapped(phases[0])))
        point, motions = (
            (2.0 * last.xi - before.xi, 2.0 * last.motions - before.motions)
            if near
            else (last.xi, last.motions)
        )
        return ForceWithMultipliers(point, phases, motions).balanced(Q @ xi, Q).merged(_SAME)

    def _at_once(self, xi: Array, Q: Array, s: float) -> ForceWithMultipliers:
        """The point nearest to ξ if all motion is at one phase."""
        y = self.source.project(xi, s, Q)
        return ForceWithMultipliers(y, np.array([s]), (Q @ (xi - y))[None])

    def _gap(self, held: ForceWithMultipliers, c: Array, Q: Array | None) -> float:
        """Duality gap, relative to the motion; infinite while ξ is outside K_av."""
        if held.bound > self.tolerance * self.size:
            return np.inf
        moved = float(np.linalg.norm(c if Q is None else held.motions, axis=-1).sum())
        # A point that lies outside by rounding is moved by rounding.
        least = 0.0 if Q is None else 1e-3 * self.size * float(np.abs(Q).max())
        return held.gap(self.source) / (self.size * max(moved, least))

    def _refined(
        self, held: ForceWithMultipliers, c: Array, Q: Array | None
    ) -> ForceWithMultipliers:
        """Result of Newton's method, once convergence is likely; neighbouring phases may be
        merged."""
        if held.violation > _NEAR * self.size:
            return held
        one = held.merged(_CLUSTER)
        found = [self._newton(start, c, Q) for start in ([one] if one is held else [one, held])]
        return min(found, key=lambda closer: self._gap(closer, c, Q))

    def _newton(
        self, held: ForceWithMultipliers, c: Array, Q: Array | None
    ) -> ForceWithMultipliers:
        scales = np.array([self.cover.scale(s) for s in held.phases.tolist()])
        try:
            return self._judged(refined(self.source, held, c, Q, self.size, scales).balanced(c, Q))
        except ConvergenceError:  # a projection far from K(s)
            return held

    def _solved(
        self, constraints: Sequence[Constraint], c: Array, Q: Array | None
    ) -> ForceWithMultipliers:
        """The solution for a few phases."""
        size = float(np.abs(c).max())
        curvature = None if Q is None else Q * (self.size / size)
        xi, motions = solve_cones([form for _, form in constraints], c / size, curvature)
        phases, motions = self._tidied(np.array([s for s, _ in constraints]), motions * size)
        return ForceWithMultipliers(xi * self.size, phases, motions).balanced(c, Q)

    def _exchanged(
        self, constraints: list[Constraint], *found: ForceWithMultipliers
    ) -> list[Constraint]:
        """Active constraints of a force, violated ones, and given others."""
        forces = {s: held.xi for held in found for s in (*held.phases.tolist(), *held.violated)}
        if self.source.cone_form(0.0) is not None:  # one constraint describes a phase completely
            constraints = [(s, form) for s, form in constraints if s not in forces]
        return [*constraints, *(self._constraint(s, xi) for s, xi in forces.items())]

    def _constraint(self, s: float, xi: Array) -> Constraint:
        return s, self.source.outer_form(s, xi).scaled(1.0 / self.size)

    def _judged(self, held: ForceWithMultipliers) -> ForceWithMultipliers:
        """Excess over K(s), at the phases of the multipliers and at all others."""
        looked = self._look(held.xi, held.phases)
        sets = self.source.sampled(held.phases)
        violation = max(float(looked.excess.max()), float(sets.excess(held.xi).max()), 0.0)
        phases = self._peaks(looked, held.xi) if violation > LAST_DIGITS * self.size else ()
        return replace(
            held,
            sets=sets,
            violated=phases,
            violation=violation,
            bound=max(looked.bound, violation),
        )

    def _peaks(self, looked: SearchResult, xi: Array) -> list[float]:
        """Local maxima of the excess of ξ over K(s), the largest first."""
        phases, first = np.unique(wrapped(looked.phases), return_index=True)
        excess = looked.excess[first]
        if len(phases) < 3:
            return phases[excess > LAST_DIGITS * self.size].tolist()
        before, after = np.roll(excess, 1), np.roll(excess, -1)
        (k,) = np.nonzero(
            (excess >= before) & (excess >= after) & (excess > LAST_DIGITS * self.size)
        )
        if not len(k):
            return []
        k = k[np.argsort(-excess[k])][:_MOST_PEAKS]
        count = len(phases)
        near = np.array(
            [phases[k - 1] - (k == 0), phases[k], phases[(k + 1) % count] + (k + 1 == count)]
        )
        values = np.array([before[k], excess[k], after[k]])
        found, value = refined_maxima(near, values, lambda s: self.source.sampled(s).excess(xi))
        return wrapped(found[np.argsort(-value)]).tolist()

    def _tidied(self, phases: Array, motions: Array) -> tuple[Array, Array]:
        """The same measure, with neighbouring phases joined to the best one between them where that
        costs no more."""
        moving = np.linalg.norm(motions, axis=1) > _MOVING * np.linalg.norm(motions)
        order = np.argsort(phases[moving])
        phases, motions = phases[moving][order], motions[moving][order]
        # Cut the circle at its widest gap.
        shift = int(np.diff(phases, append=phases[0] + 1.0).argmax()) + 1
        phases = np.roll(phases, -shift)
        motions = np.roll(motions, -shift, axis=0)
        phases = phases[0] + (phases - phases[0]) % 1.0
        pieces = np.split(np.arange(len(phases)), np.flatnonzero(np.diff(phases) > _CLUSTER) + 1)
        tidy = [self._joined(phases[piece], motions[piece]) for piece in pieces]
        return wrapped(np.concatenate([s for s, _ in tidy])), np.vstack([v for _, v in tidy])

    def _joined(self, phases: Array, motions: Array) -> tuple[Array, Array]:
        v = motions.sum(axis=0)
        if not self.source.depends_on_phase:
            return phases[:1], v[None]
        apart = float(self.source.sampled(phases).support(motions).sum())
        # A kink may be narrower than the cluster is wide.
        width = max(float(phases[-1] - phases[0]), self.cover.scale(float(wrapped(phases[0]))))
        reach = np.array([width, _CLUSTER / 2])
        costs, found = golden_section(
            lambda s: self.source.sampled(s).support(v), phases[0] - reach, phases[-1] + reach
        )
        k = int(costs.argmin())
        return (
            (found[k : k + 1], v[None])
            if costs[k] <= apart * (1 + FEW_ROUNDINGS)
            else (phases, motions)
        )


def _worst(looked: SearchResult) -> float:
    """Signed distance of a force; 0 if it is outside by less than the resolution."""
    worst = float(looked.excess.max())
    return (
        worst
        if not np.isfinite(looked.bound)
        else max(worst, 0.0)
        if looked.bound > 0.0 > worst
        else worst
    )


@dataclass(frozen=True, eq=False)
class Together(OneByOne):
    """An intersection for many forces simultaneously."""

    potential: Intersection

    def excess(self, xi: Array) -> Array:
        return self.potential.excesses(np.broadcast_to(xi, (len(self.phases), xi.shape[-1])))


@dataclass(frozen=True, eq=False)
class FixedTogether(Fixed):
    """An average, evaluated for all its forces together."""

    start: Together
    end: Together

    def outside(
        self, before: Array, after: Array, off: Array, enough: float | Array
    ) -> tuple[Array, Array, Array]:
        # The force at the end of an interval is that at the start of the next one.
        forces, place = np.unique(np.concatenate([before, after]), axis=0, return_inverse=True)
        first, last = np.split(self.start.potential.excesses(forces)[place.ravel()], 2)
        return first, last, self.between(np.maximum(first, last), before, after, off, enough)


def lineality(average: Average, least: float) -> Array:
    """Orthonormal basis, shape (n, k), of the directions in which the width of K_av is at most
    `least`.

    They are the complement of the span of K_av. In a generic direction of the complement of a
    subspace of the span, K_av has width 0 only if the subspace is the span.
    """
    n = average.dimension
    rng = np.random.default_rng(0)
    spanned = np.zeros((n, 0))
    while spanned.shape[1] < n:
        d = rng.normal(size=n)
        # A point exposed across the known span has a part along d, or K_av is flat in it.
        d -= spanned @ (spanned.T @ d)
        d /= np.linalg.norm(d)
        xi = max(
            (average.exposed(sign * d) for sign in (1, -1)), key=lambda point: abs(float(point @ d))
        )
        if abs(float(xi @ d)) <= least:
            break
        xi -= spanned @ (spanned.T @ xi)
        spanned = np.column_stack([spanned, xi / np.linalg.norm(xi)])
    return np.linalg.qr(np.column_stack([spanned, np.eye(n)]))[0][:, spanned.shape[1] :]
