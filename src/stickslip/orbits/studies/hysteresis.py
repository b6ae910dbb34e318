"""Hysteresis operators: two rate-independent coordinates driven by another one, as in [M] section
4.3.

If the friction of two coordinates x, y with the distance d = x − y depends on a third one, ψ, the
force balances are G⁻(ψ) ≤ d ≤ G⁺(ψ), ḋ ≤ 0 on G⁺, ḋ ≥ 0 on G⁻ and ḋ = 0 between. So ψ ↦ d is a
rate-independent play between two curves. The curves follow from the declaration of any such system:
X, ψ₂, ψ₃ of the toy are heights and crossings of the curves, whose closed forms are in its
declaration in the catalogue.

A swing of ψ from one value to another acts on d as d ↦ clip(d, low, high), since compositions of
maps d ↦ clip(d, G⁻, G⁺) have this form. This implies return-point memory: a swing forth, back and
forth again has the same result as the first swing forth.

References
----------
A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017), sections 4.3 and 4.4; M. Brokate, J. Sprekels, *Hysteresis and Phase
Transitions*, Springer 1996, chapter 2.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.equations.derive import MotionEquations, derive
from stickslip.errors import DeclarationError
from stickslip.kept import cached_property
from stickslip.model.entries.declared import Kind
from stickslip.model.system import System
from stickslip.motion.problem import checked_values
from stickslip.numerics.levels import FEW_ROUNDINGS
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

if TYPE_CHECKING:
    from stickslip.rate_independent.play.operator import Play

# a curve that differs from a straight line by less, relative to its values, is affine
_AFFINE = 1e-10
_REMEDY = (
    "The system needs two rate-independent coordinates that are coupled only by their distance "
    "and one other coordinate"
)


@dataclass(frozen=True)
class PiecewiseAffine:
    """A continuous piecewise affine function.

    Attributes
    ----------
    nodes, values : arrays, shape (nodes,)
        Where it may bend, in rising order, and its values there.
    slopes : (float, float)
        Left of the first and right of the last node.
    """

    nodes: Array
    values: Array
    slopes: tuple[float, float]

    @classmethod
    def through(cls, function: Callable[[Array], Array], nodes: Array) -> PiecewiseAffine:
        """The curve that agrees with a function at the nodes and one step beyond the outer ones."""
        y = function(np.concatenate([[nodes[0] - 1.0], nodes, [nodes[-1] + 1.0]]))
        return cls(nodes, y[1:-1], (float(y[1] - y[0]), float(y[-1] - y[-2])))

    def __call__(self, x: ArrayLike) -> Any:
        """Values, of the shape of `x`."""
        x = np.asarray(x, dtype=float)
        inside = np.interp(x, self.nodes, self.values)
        left, right = np.minimum(x - self.nodes[0], 0.0), np.maximum(x - self.nodes[-1], 0.0)
        return inside + self.slopes[0] * left + self.slopes[1] * right

    def crossings(self, level: float) -> Array:
        """Points at which the curve crosses a level, in ascending order."""
        ends = self.nodes[[0, -1]] + _beyond(self, level)
        x = np.array([ends[0], *self.nodes, ends[1]])
        h = self(x) - level
        a, b = h[:-1], h[1:]
        found = np.flatnonzero((a * b < 0.0) | ((b == 0.0) & (a != 0.0)))
        return x[found] - a[found] * (x[found + 1] - x[found]) / (b[found] - a[found])

    def extrema(self, sign: int) -> Array:
        """Nodes at which the curve has a strict local maximum (sign 1) or minimum (−1)."""
        x = np.array([self.nodes[0] - 1.0, *self.nodes, self.nodes[-1] + 1.0])
        rise = sign * np.diff(self(x)) / np.diff(x)
        return self.nodes[(rise[:-1] > 0.0) & (rise[1:] < 0.0)]


def _beyond(curve: PiecewiseAffine, level: float) -> Array:
    """Distance beyond the first and last node within which a level is passed."""
    steps: list[float] = []
    for height, slope, side in zip(curve.values[[0, -1]], curve.slopes, (-1.0, 1.0), strict=True):
        away = (level - height) / slope if slope else 0.0
        steps.append(side + 2.0 * away if side * away > 0.0 else side)
    return np.array(steps)


def extreme_of(one: PiecewiseAffine, other: PiecewiseAffine, sign: int = 1) -> PiecewiseAffine:
    """The smaller (sign 1) or larger (−1) of two curves."""
    pick = np.minimum if sign > 0 else np.maximum
    nodes = np.union1d(one.nodes, other.nodes)
    gap = PiecewiseAffine.through(lambda x: one(x) - other(x), nodes)
    # If the curves are parallel, the slope of their difference is a rounding error.
    least = FEW_ROUNDINGS * max(np.max(np.abs(curve.values)) for curve in (one, other))
    left, right = (slope if abs(slope) > least else 0.0 for slope in gap.slopes)
    gap = replace(gap, slopes=(left, right))
    return PiecewiseAffine.through(
        lambda x: pick(one(x), other(x)), np.union1d(nodes, gap.crossings(0.0))
    )


@dataclass(frozen=True)
class HysteresisOperator:
    """The operator ψ ↦ d of a play between two curves.

    Attributes
    ----------
    input : str
        Name of ψ.
    output : (str, str)
        The coordinates whose difference is d.
    legs : dict of str to (Curve, Curve)
        Lower and upper bounds of each contact, such as G_R⁻, G_R⁺.
    """

    input: str
    output: tuple[str, str]
    legs: dict[str, tuple[PiecewiseAffine, PiecewiseAffine]]

    @classmethod
    def of(
        cls, system: System, *, parameters: Mapping[str, float] | None = None
    ) -> HysteresisOperator:
        """Derive the operator of a system.

        Parameters
        ----------
        system : System
        parameters : mapping of str to float, optional
            Values that replace the defaults.

        Raises
        ------
        DeclarationError
            If an argument is wrong, the system is not of this form, its curves are not piecewise
            affine, or the bounds cross somewhere, so that no bounded rate exists.
        """
        values = checked_values(system, parameters)
        declared = _Declared.read(system, derive(system.declaration), values)
        found = cls(declared.driver, declared.pair, declared.legs())
        x = np.union1d(found.upper.nodes, found.lower.nodes)
        over = found.lower(x) - found.upper(x)
        if np.any(over > 0.0):
            where = f"{declared.driver} = {x[np.argmax(over)]:.6g}"
            raise DeclarationError(
                system.name, f"no d is stable at {where}, where G- exceeds G+", "Reduce the load"
            )
        return found

    @cached_property
    def upper(self) -> PiecewiseAffine:
        """G⁺ = min of the upper bounds."""
        first, *others = (bounds[1] for bounds in self.legs.values())
        for other in others:
            first = extreme_of(first, other)
        return first

    @cached_property
    def lower(self) -> PiecewiseAffine:
        """G⁻ = max of the lower bounds."""
        first, *others = (bounds[0] for bounds in self.legs.values())
        for other in others:
            first = extreme_of(first, other, -1)
        return first

    # -- simple motion -----------------------------------------------------------------------------

    @property
    def X(self) -> float:
        """Height of the peak of G⁻: the value of d after ψ has swung far down. The stride of simple
        walking is 2X per period.

        Raises
        ------
        DeclarationError
            If G⁺ has no valley or G⁻ no peak, so that a swing has no lasting effect.
        """
        return float(self.lower(self._turns()[0]))

    @property
    def psi_3(self) -> float:
        """The ψ at which G⁺ falls to X: beyond this value, an upward swing moves a leg."""
        valley = self._turns()[1]
        return float(self.upper.crossings(self.X)[self.upper.crossings(self.X) < valley][-1])

    @property
    def psi_2(self) -> float:
        """The ψ at which G⁻ rises to the valley of G⁺: after ψ has passed the valley, d is constant
        up to this value."""
        valley = self._turns()[1]
        level = float(self.upper(valley))
        return float(self.lower.crossings(level)[self.lower.crossings(level) > valley][0])

    def _turns(self) -> tuple[float, float]:
        """The peak of G⁻ and the valley of G⁺."""
        peaks, valleys = self.lower.extrema(1), self.upper.extrema(-1)
        if not (len(peaks) and len(valleys)):
            raise DeclarationError(
                self.input,
                "G- has no maximum or G+ has no minimum: the legs do not alternate",
                "Increase H_star, or reduce c",
            )
        return float(peaks[0]), float(valleys[-1])

    # -- the operator ------------------------------------------------------------------------------

    def swing(self, start: float, end: float) -> tuple[float, float]:
        """Effect of a monotone change of ψ: d ↦ clip(d, low, high).

        Returns
        -------
        low, high : float
            Equal if d after the swing does not depend on d before it.
        """
        x = self._nodes(start, end)
        low = -np.inf
        high = np.inf
        for down, up in zip(self.lower(x), self.upper(x), strict=True):
            low, high = min(max(low, down), up), min(max(high, down), up)
        return float(low), float(high)

    def __call__(self, psi: ArrayLike, *, initial: float = 0.0) -> Array:
        """d at samples of ψ, exact if ψ is monotone between them.

        Parameters
        ----------
        psi : array, shape (n,)
        initial : float
            d before; if G⁻ ≤ d ≤ G⁺ fails at the first sample it is put onto the nearer curve.

        Raises
        ------
        DeclarationError
            If ψ is not an array of finite numbers.
        """
        samples = _checked(psi)
        d = np.empty(len(samples))
        value = initial
        for i, end in enumerate(samples):
            low, high = self.swing(samples[max(i - 1, 0)], end)
            d[i] = value = min(max(value, low), high)
        return d

    def path(self, psi: ArrayLike, *, initial: float = 0.0) -> tuple[Array, Array]:
        """The polygonal path of (ψ, d).

        Parameters
        ----------
        psi : array, shape (n,)
            Turning points of ψ.
        initial : float

        Returns
        -------
        psi, d : arrays
            With all corners in between.
        """
        turns = _checked(psi)
        x = np.concatenate([turns[:1], *(self._nodes(a, b)[1:] for a, b in pairwise(turns))])
        corners = [x[:1]]
        d = self(x, initial=initial)
        for i in range(len(x) - 1):
            # Between two nodes d rests until it meets a curve, or has left it at the node.
            meets = [self._meets(curve, x[i], x[i + 1], d[i]) for curve in (self.lower, self.upper)]
            corners += [np.array([m for m in meets if m is not None]), x[i + 1 : i + 2]]
        everywhere = np.concatenate(corners)
        return everywhere, self(everywhere, initial=initial)

    def loop(self, low: float, high: float) -> tuple[Array, Array]:
        """The closed curve to which (ψ, d) converges while ψ oscillates between two values.

        Its area ∮ d dψ, positive if anticlockwise, times the coupling is the energy supplied to ψ
        in a period.
        """
        # Return-point memory closes the loop after one cycle.
        start = self([low, high, low])[-1]
        return self.path([low, high, low], initial=start)

    def driven(
        self, psi: Callable[[Any], Any], t_span: tuple[float, float], *, initial: float
    ) -> Play:
        """d for a function ψ(t); turning points are located automatically.

        Returns
        -------
        Play
            Its ``z`` is d.
        """
        from stickslip.rate_independent.play.operator import play

        return play(
            # A play with moving bounds G⁻ ≤ d ≤ G⁺: load (G⁺ + G⁻)/2, threshold (G⁺ − G⁻)/2.
            lambda t: 0.5 * (self.upper(psi(t)) + self.lower(psi(t))),
            lambda t: 0.5 * (self.upper(psi(t)) - self.lower(psi(t))),
            t_span,
            initial=initial,
        )

    def _nodes(self, start: float, end: float) -> Array:
        """Two values, with the nodes of the curves in between."""
        every = np.union1d(self.lower.nodes, self.upper.nodes)
        between = every[(every > min(start, end)) & (every < max(start, end))]
        return np.array([start, *(between if start < end else between[::-1]), end])

    @staticmethod
    def _meets(curve: PiecewiseAffine, start: float, end: float, level: float) -> float | None:
        """Intersection of a curve that is affine on an interval with a level."""
        a, b = float(curve(start)) - level, float(curve(end)) - level
        return start + (end - start) * a / (a - b) if a * b < 0.0 else None


@dataclass(frozen=True)
class _Declared:
    """The declaration of two rate-independent coordinates and the one that drives them.

    Attributes
    ----------
    contacts : dict of str to (Expr, Expr, Expr)
        By contact: force λ and thresholds s⁺, s⁻, in the driver and the first of the pair (the
        other is 0).
    """

    driver: str
    pair: tuple[str, str]
    contacts: dict[str, tuple[Expr, Expr, Expr]]
    kinks: list[Expr]

    @classmethod
    def read(
        cls, system: System, equations: MotionEquations, values: Mapping[str, float]
    ) -> _Declared:
        """Check that the system has this form."""
        d = system.declaration
        acting = [c for c in equations.contacts if c.kind == Kind.RATE_INDEPENDENT]
        pair = tuple(d.rate_independent)
        shift = system.translation
        if (
            len(pair) != 2
            or len(acting) != 2
            or shift.get(pair[0]) != shift.get(pair[1])
            or not shift.get(pair[0])
        ):
            raise DeclarationError(
                system.name,
                "no two rate-independent coordinates with a common translation",
                _REMEDY,
            )
        known = {name: ex.num(value) for name, value in values.items()} | {pair[1]: ex.ZERO}
        contacts = {
            c.name: tuple(ex.substitute(e, known) for e in (force, c.plus, c.minus))
            for c, force in zip(acting, equations.rate.force, strict=True)
        }
        kinks = [ex.substitute(g, known) for g in equations.kinks]
        used = {name for parts in contacts.values() for e in parts for name in e.symbols}
        used.discard(pair[0])
        if len(used) != 1 or next(iter(used)) not in d.state:
            what = ", ".join(sorted(used)) or "nothing"
            raise DeclarationError(
                system.name, f"the friction depends on {what}, not on a single other state", _REMEDY
            )
        driver = next(iter(used))
        kinks = [g for g in kinks if g.symbols == frozenset({driver})]
        return cls(driver, pair, contacts, kinks)  # type: ignore[arg-type]

    def legs(self) -> dict[str, tuple[PiecewiseAffine, PiecewiseAffine]]:
        """Bounds on d from −s⁺ ≤ λ(ψ, d) ≤ s⁻, where λ is affine in d."""
        nodes = self._corners()
        found: dict[str, tuple[PiecewiseAffine, PiecewiseAffine]] = {}
        for name, (force, plus, minus) in self.contacts.items():
            slope = ex.derivative(force, self.pair[0])
            bends = ex.bends(force, self.pair[:1])
            if bends or not ex.is_number(slope) or ex.number(slope) == 0.0:
                raise DeclarationError(
                    f"potential ({name})", f"the force is not affine in {self.pair[0]}", _REMEDY
                )
            still = ex.substitute(force, {self.pair[0]: ex.ZERO})
            sides = [(-1.0 / ex.number(slope)) * (still + bound) for bound in (plus, -minus)]
            low, high = sides if ex.number(slope) > 0.0 else sides[::-1]
            found[name] = self._curve(name, low, nodes), self._curve(name, high, nodes)
        return found

    def _corners(self) -> Array:
        """Positions of the kinks of the formulas."""
        corners = [0.0]
        for g in self.kinks:
            slope = ex.derivative(g, self.driver)
            if not ex.is_number(slope):
                raise DeclarationError(
                    "functions", f"the kink at {ex.to_text(g)} = 0 is not affine", _REMEDY
                )
            corners.append(-ex.evaluate(g, {self.driver: 0.0}) / ex.number(slope))
        return np.unique(corners)

    def _curve(self, name: str, bound: Expr, nodes: Array) -> PiecewiseAffine:
        """A bound as a curve, which must be affine between the nodes."""

        def values(x: Array) -> Array:
            return np.array([ex.evaluate(bound, {self.driver: float(v)}) for v in x])

        curve = PiecewiseAffine.through(values, nodes)
        x = np.concatenate([[nodes[0] - 2.0], nodes, [nodes[-1] + 2.0]])
        between = np.concatenate([0.5 * (x[:-1] + x[1:]), 0.7 * x[:-1] + 0.3 * x[1:], x[[0, -1]]])
        if np.max(np.abs(values(between) - curve(between))) > _AFFINE * np.max(
            np.abs(curve.values)
        ):
            raise DeclarationError(
                f"contacts.'{name}'.threshold",
                f"not piecewise affine in {self.driver}",
                "Use simulate instead",
            )
        return curve


def _checked(psi: ArrayLike) -> Array:
    samples = np.asarray(psi, dtype=float)
    if samples.ndim != 1 or len(samples) == 0 or not np.all(np.isfinite(samples)):
        raise DeclarationError(
            "psi", "not a 1-D array of finite numbers", "Give samples, or use `driven`"
        )
    return samples
