"""All sets of equilibria that satisfy some conditions, with proofs as far as possible."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from stickslip.arrays import Array
from stickslip.orbits.equilibria.box_bounds import centres, period
from stickslip.orbits.equilibria.level_extents import extents
from stickslip.orbits.equilibria.level_sets import Components, LevelSet
from stickslip.orbits.equilibria.reduction import Irreducible, Reduced
from stickslip.orbits.equilibria.stick_sets import Conditions
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.evaluator import evaluator
from stickslip.symbolic.expressions import Expr

_RANGE = 64.0  # half-width of the search region, in units of the declared initial state, or of 1
_MOST = 3  # largest number of free states: the number of boxes grows with every one
_CLOSED = 1e-9  # largest violation of the conditions at a point, relative to their terms
_SAME = 1e-9  # relative error of a period by which sets are apart

Ranges = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class CoveredSet:
    """A connected set.

    Attributes
    ----------
    state : array, shape (states,)
        An interior point.
    inside : array, shape (states, points)
        Points distributed over the set.
    error : float
        Error bound of the ends of the extent, relative to the size of the set.
    repeats : dict of str to float
        Periods of the set, by state.
    undecided : int
        Number of adjacent boxes that may or may not belong to the set.
    """

    state: Array
    inside: Array
    extent: dict[str, tuple[float, float]]
    error: float
    dimension: int
    repeats: dict[str, float]
    undecided: int


@dataclass(frozen=True)
class CoveredSets:
    """All sets that were found.

    Attributes
    ----------
    undecided : str
        What is not known of others; empty if there are none.
    isolated : bool
        Whether there is at most one state, up to translation.
    """

    found: list[CoveredSet]
    undecided: str = ""
    isolated: bool = False


def cover(conditions: Conditions, invariant: Array, origin: Array, box: Ranges) -> CoveredSets:
    """Components all sets.

    Parameters
    ----------
    conditions : Conditions
        With kinks in place.
    invariant : array, shape (states, translations)
    origin : array, shape (states,)
        Gives the units, and the middle of where is looked.
    box : mapping of str to (float, float)
        Where to look, for some states.

    Raises
    ------
    Irreducible
        If the states are not given by formulas in at most three free ones.
    """
    reduced = conditions.reduced(invariant, origin)
    if len(reduced.free) > _MOST:
        raise Irreducible
    found = _Covered(conditions, reduced, origin, box)
    return found.parts() if reduced.free else found.point(invariant.shape[1])


def valued(
    expressions: list[Expr], names: Sequence[str], values: Mapping[str, float], points: Array
) -> Array:
    """Values of expressions at points of shape (names, N), given those of all other names."""
    held = np.array(list(values.values()), dtype=float)[:, None]
    at = np.concatenate([points, np.repeat(held, points.shape[1], axis=1)])
    return evaluator(expressions, [*names, *values])(at)


class _Covered:
    def __init__(
        self, conditions: Conditions, reduced: Reduced, origin: Array, box: Ranges
    ) -> None:
        self.conditions = conditions
        self.reduced = reduced
        self.states = conditions.states
        self.values = conditions.values
        self.origin = dict(zip(self.states, map(float, origin), strict=True))
        self.box = box
        #: by state
        self.formulas = {x: reduced.given.get(x, ex.sym(x)) for x in self.states}
        self.repeats = {}
        for x in reduced.free:
            felt = [*reduced.nonnegative, *reduced.given.values()]
            if x not in box and (turn := period(felt, x, self.values)):
                self.repeats[x] = turn

    def point(self, translations: int) -> CoveredSets:
        """A set without conditions on the free states: all of them, or none."""
        isolated = self.reduced.dimension <= translations
        state = np.array([ex.evaluate(e, self.values) for e in self.formulas.values()]) + 0.0
        if not all(self._holds(e) for e in self.reduced.nonnegative):
            return CoveredSets([], isolated=isolated)
        extent = self._extent({x: (v, v) for x, v in zip(self.states, state.tolist(), strict=True)})
        inside = state[:, None]
        part = CoveredSet(state, inside, extent, 0.0, self.reduced.dimension, {}, 0)
        return CoveredSets([part] if self._asked(extent) else [], isolated=isolated)

    def _holds(self, e: Expr) -> bool:
        """Return whether a condition without unknowns holds, up to rounding."""
        value = ex.evaluate(e, self.values)
        terms = e.terms if e.op == "sum" else ()
        size = sum(abs(c * ex.evaluate(term, self.values)) for term, c in terms)
        return value >= -_CLOSED * size

    def parts(self) -> CoveredSets:
        """All sets, each once."""
        free = self.reduced.free
        core = np.array([self._range(x) for x in free]).T
        cover = LevelSet(self.reduced.nonnegative, free, self.values, core).components()
        told = [x for x in self.states if x not in self.reduced.unbounded]
        ends, gaps = extents(cover, [self.formulas[x] for x in told])
        found: list[CoveredSet] = []
        for c in range(cover.count):
            pairs = ((float(low), float(high)) for low, high in ends[c])
            extent = self._extent(dict(zip(told, pairs, strict=True)))
            if not self._asked(extent) or any(self._repeated(extent, p.extent) for p in found):
                continue
            size = np.max(np.abs(ends[c]), axis=1) + ends[c, :, 1] - ends[c, :, 0]
            size = np.where((size > 0.0) & np.isfinite(size), size, 1.0)
            error = float(np.max(gaps[c] / size[:, None], initial=0.0))
            own = cover.inside & (cover.component == c)
            middles = centres(cover.low[:, own], cover.high[:, own])
            points = np.column_stack([self._centre(cover, c, extent), middles])
            at = valued(list(self.formulas.values()), free, self.values, points)
            part = CoveredSet(
                at[:, 0],
                at,
                extent,
                error,
                self.reduced.dimension,
                {x: turn for x, turn in self.repeats.items() if np.all(np.isfinite(extent[x]))},
                cover.undecided.shape[2] if c in cover.unsure else 0,
            )
            found.append(part)
        found.sort(key=lambda part: list(part.extent.values()))
        return CoveredSets(found, "; ".join(self._unknown(cover)))

    def _range(self, x: str) -> tuple[float, float]:
        """The searched range of a state."""
        if x in self.box:
            return self.box[x]
        at = self.origin[x]
        far = 0.5 * self.repeats[x] if x in self.repeats else _RANGE * max(abs(at), 1.0)
        return at - far, at + far

    def _extent(self, known: dict[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
        return {x: known.get(x, (-np.inf, np.inf)) for x in self.states} | {
            x: (-np.inf, np.inf) for x in self.reduced.unbounded
        }

    def _asked(self, extent: Mapping[str, tuple[float, float]]) -> bool:
        """Return whether a set intersects the box."""
        return all(
            extent[x][0] <= high and extent[x][1] >= low for x, (low, high) in self.box.items()
        )

    def _repeated(self, one: Ranges, other: Ranges) -> bool:
        """Return whether two sets agree up to a shift by multiples of the periods."""
        for x in self.states:
            turn = self.repeats.get(x, 0.0)
            with np.errstate(invalid="ignore"):
                apart = np.subtract(one[x], other[x])
            apart = np.where(np.equal(one[x], other[x]), 0.0, apart)
            size = max(turn, *map(abs, one[x])) if np.all(np.isfinite(one[x])) else 1.0
            away = apart - turn * np.round(apart[0] / turn) if turn else apart
            if not np.all(np.abs(away) <= _SAME * size):
                return False
        return bool(self.repeats)

    def _centre(self, cover: Components, c: int, extent: Ranges) -> Array:
        """An interior point; in one unknown the middle."""
        (x, *others) = self.reduced.free
        if not others and np.all(np.isfinite(extent[x])):
            return np.array([0.5 * extent[x][0] + 0.5 * extent[x][1]])
        return cover.centre(c)

    def _unknown(self, cover: Components) -> list[str]:
        """Description of the undecided parts."""
        free = self.reduced.free
        said = []
        if cover.undecided.shape[2]:
            low, high = cover.undecided[0].min(axis=1), cover.undecided[1].max(axis=1)
            where = ", ".join(
                f"{a:.9g} ≤ {x} ≤ {b:.9g}" for x, a, b in zip(free, low, high, strict=True)
            )
            said.append(f"{cover.undecided.shape[2]} boxes in {where} are undecided")
        limited = [i for i, x in enumerate(free) if x in self.box or x in self.repeats]
        core = cover.of.core
        beyond = cover.beyond[:, limited]
        inside = np.all(
            (beyond[0] < core[1, limited, None]) & (beyond[1] > core[0, limited, None]), axis=0
        )
        if np.any(inside):
            where = ", ".join(
                f"{core[0, i]:.6g} ≤ {x} ≤ {core[1, i]:.6g}"
                for i, x in enumerate(free)
                if i not in limited
            )
            said.append(f"sets outside {where} were not searched (give a box)")
        return said
