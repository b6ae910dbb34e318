"""Conditions of rest, reduced to as few unknowns as possible.

Equations that are linear in an unknown, with a coefficient that has no zeros, are solved for it,
forces first. Forces that remain, because more contacts stick than there are directions, are
eliminated from the inequalities by Fourier–Motzkin elimination. Translations that leave the system
unchanged are removed by fixing one state for each.

Source: A. Schrijver, *Theory of Linear and Integer Programming*, Wiley (1986), section 12.2.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from stickslip.arrays import Array
from stickslip.numerics.levels import RANK
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.enclosures import bounds, sure_sign
from stickslip.symbolic.expressions import Expr

_MOST = 200  # largest number of inequalities after the elimination of a force
_ZERO = 1e-9  # residual of an equation without unknowns, relative to its terms


@dataclass(frozen=True)
class Reduced:
    """The states of a set: free ones, and others that are functions of them.

    Attributes
    ----------
    free : tuple of str
        States that vary in the set.
    given : dict of str to Expr
        All other states.
    unbounded : frozenset of str
        States on which no condition depends, or that a translation changes.
    nonnegative : tuple of Expr
        Expressions of the free states that must not be negative.
    dimension : int
        Dimension of the set.
    """

    free: tuple[str, ...]
    given: dict[str, Expr]
    unbounded: frozenset[str]
    nonnegative: tuple[Expr, ...]
    dimension: int


class Irreducible(Exception):
    """The states of a set cannot be expressed as formulas of free ones; or the set is empty."""

    def __init__(self, empty: bool = False) -> None:
        super().__init__("the conditions cannot be reduced")
        self.empty = empty


def reduce(
    states: Sequence[str],
    forces: Sequence[str],
    equal: Sequence[Expr],
    nonnegative: Sequence[Expr],
    values: Mapping[str, float],
    invariant: Array,
    origin: Array,
) -> Reduced:
    """The free states, and the conditions on them.

    Parameters
    ----------
    states, forces : sequence of str
        Unknowns.
    values : mapping of str to float
        Of the parameters.
    invariant : array, shape (states, translations)
    origin : array, shape (states,)

    Raises
    ------
    Irreducible
    """
    found = _Elimination(states, forces, list(equal), list(nonnegative), values)
    return found.run(invariant, origin)


class _Elimination:
    def __init__(
        self,
        states: Sequence[str],
        forces: Sequence[str],
        equal: list[Expr],
        nonnegative: list[Expr],
        values: Mapping[str, float],
    ) -> None:
        self.states = tuple(states)
        self.forces = list(forces)
        self.equal = equal
        self.nonnegative = nonnegative
        self.values = values
        self.ranges = {name: (v, v) for name, v in values.items()}
        self.given: dict[str, Expr] = {}

    def run(self, invariant: Array, origin: Array) -> Reduced:
        free = [*self.forces, *self.states]
        while (found := self._solvable(free)) is not None:
            self._substitute(*found)
            free.remove(found[0])
        for x in [x for x in self.forces if x in free]:
            if self._eliminate(x, free):
                free.remove(x)
        if any(sure_sign(e, self.ranges) for e in self.equal):
            raise Irreducible(empty=True)
        if any(e.symbols & set(free) for e in self.equal):
            raise Irreducible
        if not all(self._vanishes(e) for e in self.equal):
            raise Irreducible(empty=True)
        for x in [x for x in self.forces if x in free]:
            self._project(x)
            free.remove(x)
        held = self._fix_translations(free, invariant, origin)
        moved = {x for x, row in zip(self.states, invariant, strict=True) if np.any(row != 0.0)}
        used = frozenset[str]().union(*(e.symbols for e in self.nonnegative))
        anything = {x for x in free if x not in used and x not in held}
        for x in [*held, *anything]:
            if x in free:
                free.remove(x)
        at = {x: ex.num(float(origin[self.states.index(x)])) for x in anything}
        given = {x: ex.substitute(e, at) for x, e in self.given.items() if x in self.states}
        moved |= {x for x, e in self.given.items() if e.symbols & anything} & set(self.states)
        return Reduced(
            tuple(free),
            given | at,
            frozenset(moved | anything),
            tuple(self.nonnegative),
            len(free) + len(held) + len(anything),
        )

    def _solvable(self, free: list[str]) -> tuple[str, Expr] | None:
        """An unknown and its value, from the equation with the fewest unknowns that can be solved
        for it."""
        for names in (self.forces, self.states):
            found: tuple[int, str, int, Expr] | None = None
            for x in names:
                for n, e in enumerate(self.equal) if x in free else ():
                    count = len(e.symbols.intersection(free))
                    if x not in e.symbols or (found and found[0] <= count) or ex.bends(e, [x]):
                        continue
                    slope = ex.derivative(e, x)
                    varies = slope.symbols.intersection(free if x in self.states else [x])
                    low, high = bounds(slope, self.ranges)
                    if not varies and (low > 0.0 or high < 0.0):
                        found = count, x, n, slope
            if found is not None:
                _, x, n, slope = found
                return x, -ex.substitute(self.equal.pop(n), {x: ex.ZERO}) / slope
        return None

    def _substitute(self, x: str, value: Expr) -> None:
        """Replace an unknown by its value everywhere."""
        try:
            self.equal = [ex.substitute(e, {x: value}) for e in self.equal]
            self.nonnegative = [ex.substitute(e, {x: value}) for e in self.nonnegative]
        except ZeroDivisionError:
            raise Irreducible(empty=True) from None  # a formula is undefined at the only value
        self.given = {name: ex.substitute(e, {x: value}) for name, e in self.given.items()}
        self.given[x] = value

    def _vanishes(self, e: Expr) -> bool:
        """Return whether an equation without unknowns holds up to rounding."""
        terms = list(e.terms) if e.op == "sum" else [(e, 1.0)]
        parts = [float(e.value) if e.op == "sum" else 0.0]
        parts += [c * ex.evaluate(term, self.values) for term, c in terms]
        return abs(math.fsum(parts)) <= _ZERO * math.fsum(map(abs, parts))

    def _eliminate(self, force: str, free: list[str]) -> bool:
        """Eliminate a force from the only equation that contains it, J·force + F = 0, where J may
        vanish: l ≤ force ≤ u holds for some force if −F lies between J l and J u."""
        held = [e for e in self.equal if force in e.symbols]
        if len(held) != 1 or ex.bends(held[0], [force]):
            return False
        factor = ex.derivative(held[0], force)
        others = {x for x in free if x in self.forces}
        if (factor.symbols | held[0].symbols - {force}) & others:
            return False
        rest, least, most = self._bounds(force)
        if not least or not most:
            return False
        low, high = least[0], most[0]
        for e in least[1:]:
            low = ex.maximum(low, e)
        for e in most[1:]:
            high = ex.minimum(high, e)
        pull = -ex.substitute(held[0], {force: ex.ZERO})
        ends = factor * low, factor * high
        self.equal.remove(held[0])
        self.nonnegative = [*rest, ex.maximum(*ends) - pull, pull - ex.minimum(*ends)]
        self.nonnegative += [b - a for a in least for b in most]
        return True

    def _bounds(self, force: str) -> tuple[list[Expr], list[Expr], list[Expr]]:
        """The inequalities without a force, and its lower and upper bounds by the others."""
        rest, least, most = [], [], []
        for e in self.nonnegative:
            if force not in e.symbols:
                rest.append(e)
                continue
            slope = ex.derivative(e, force)
            low, high = bounds(slope, self.ranges)
            if force in slope.symbols or ex.bends(e, [force]) or not (low > 0.0 or high < 0.0):
                raise Irreducible
            bound = -ex.substitute(e, {force: ex.ZERO}) / slope
            (least if low > 0.0 else most).append(bound)
        return rest, least, most

    def _project(self, force: str) -> None:
        """Eliminate a force from inequalities that are linear in it."""
        rest, least, most = self._bounds(force)
        if len(rest) + len(least) * len(most) > _MOST:
            raise Irreducible
        self.nonnegative = [*rest, *(high - low for low in least for high in most)]

    def _fix_translations(self, free: list[str], invariant: Array, origin: Array) -> set[str]:
        """Fix one free state for each translation at its present value, chosen by complete
        pivoting; returns their names."""
        rows = np.array([self.states.index(x) for x in free], dtype=int)
        left = invariant[rows].copy()
        held: set[str] = set()
        for _ in range(left.shape[1]):
            if not left.size or np.max(np.abs(left)) < RANK:
                break
            i, j = np.unravel_index(np.argmax(np.abs(left)), left.shape)
            x = free[int(i)]
            held.add(x)
            column = left[:, j] / left[i, j]
            left = left - np.outer(column, left[i])
            self._substitute(x, ex.num(float(origin[self.states.index(x)])))
        return held
