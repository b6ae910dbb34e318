"""Steady motion in one mode: f(y, p) = 0, as one smooth square problem for every kind of system.

The equations f = 0 are singular for two reasons; f is modified off the solutions to remove both:

* constraints g(y) = 0 of the mode (a sticking inertial contact has u = 0) are invariant, so that
  ∂f/∂y has a zero eigenvalue for each: f − (∂g/∂y)ᵀ g has the same zeros and attracts to the
  constraints;
* if a translation e leaves the system unchanged, equilibria form lines, and steady sliding is a
  motion with f = c e: f − e⟨e, f⟩ − e⟨e, y − y₀⟩ selects one representative, and the drift c = ⟨e,
  f⟩ is read off afterwards.

Neither modification changes the motion within the constraints and modulo translation, so
eigenvalues and normal forms of the modified field are those of the system, apart from the added
ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from stickslip.arrays import AnyArray as Array
from stickslip.equations.derive import MotionEquations
from stickslip.equations.field import Field
from stickslip.kept import cached_property
from stickslip.numerics.levels import COMPUTED_ZERO, FINE_RANK, ROUNDED_SUM
from stickslip.numerics.ratios import ratio
from stickslip.orbits.fields.instructions import Evaluator, PointFunction
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr


class ResidualFunction:
    """Expressions as equations in some unknowns: x ↦ (F, ∂F/∂x).

    Parameters
    ----------
    unknowns : sequence of str
        Names of the components of x.
    values : mapping of str to float
        Values of all other names.
    *given : str
        Names whose values follow the unknowns in x; there are no slopes in them.

    Attributes
    ----------
    affine : bool
        Whether no slope depends on an unknown.
    """

    def __init__(
        self,
        expressions: Sequence[Expr],
        unknowns: Sequence[str],
        values: Mapping[str, float],
        *given: str,
    ) -> None:
        self.unknowns: tuple[str, ...] = tuple(unknowns)
        self.rows: int = len(expressions)
        slopes = {
            (i, j): ex.derivative(e, x)
            for i, e in enumerate(expressions)
            for j, x in enumerate(unknowns)
        }
        slopes = {place: d for place, d in slopes.items() if d is not ex.ZERO}
        used = frozenset().union(*(e.symbols for e in expressions)) if expressions else frozenset()
        fixed = sorted(used - {*unknowns, *given})
        self._evaluate = Evaluator(
            [*expressions, *slopes.values()],
            [*unknowns, *given, *fixed],
            len(unknowns) + len(given),
        )
        self._fixed = np.array([values[name] for name in fixed], dtype=float)[:, None]
        self._places = tuple(np.array(list(slopes), dtype=int).reshape(-1, 2).T)
        self.affine: bool = not any(d.symbols & set(unknowns) for d in slopes.values()) and not any(
            ex.bends(e, unknowns) for e in expressions
        )

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """Values and slopes; shapes (rows, …) and (rows, unknowns, …) for x of shape (unknowns,
        …)."""
        points = x.reshape(len(x), -1)
        given = np.empty((len(x) + len(self._fixed), points.shape[1]))
        given[: len(x)] = points
        given[len(x) :] = self._fixed
        out = self._evaluate(given).reshape(-1, *x.shape[1:])
        slopes = np.zeros((self.rows, len(self.unknowns), *x.shape[1:]))
        slopes[self._places] = out[self.rows :]
        return out[: self.rows], slopes


@dataclass(frozen=True)
class Sizes:
    """Scales at some points.

    Attributes
    ----------
    state : array, shape (points, states)
        Size of the state without cancellation of terms in the equations: the scale of its rounding
        errors.
    margins : array, shape (points, guards)
        Guards relative to the size of their terms: nonnegative where the mode holds. States count
        with their largest size over the points.
    defect : array, shape (points,)
        Residual of the equations, relative to the size of their terms.
    """

    state: Array
    margins: Array
    defect: Array


@dataclass(frozen=True)
class Steady:
    """The problem of steady motion in a mode.

    Attributes
    ----------
    values : dict of str to float
        Parameters.
    invariant : array, shape (states, translations)
        Orthonormal directions of translation.
    origin : array, shape (states,)
        The state y₀ from which translations are measured.
    """

    field: Field
    values: Mapping[str, float]
    invariant: Array
    origin: Array

    @cached_property
    def rates(self) -> list[Expr]:
        """The modified field, whose zeros are the steady motions; f itself if it is regular."""
        f = self.field
        changed = list(f.rates)
        for e in self.invariant.T:
            offset = [
                ex.sym(y) - y0 for y, y0 in zip(f.state, map(float, self.origin), strict=True)
            ]
            along = [(rate + d, float(w)) for rate, d, w in zip(f.rates, offset, e, strict=True)]
            total = ex.add(*(pair for pair in along if pair[1] != 0.0))
            changed = [
                r - float(w) * total if w != 0.0 else r for r, w in zip(changed, e, strict=True)
            ]
        for g in f.constraints:
            changed = [r - d * g for r, d in zip(changed, f.gradient(g), strict=True)]
        return changed

    def residual(self, *free: str) -> ResidualFunction:
        """The equations in the state and in free parameters."""
        return ResidualFunction(self.rates, [*self.field.state, *free], self.values)

    @cached_property
    def _local(self) -> ResidualFunction:
        f = self.field
        return ResidualFunction([*f.rates, *f.constraints], f.state, {}, *f.parameters)

    @cached_property
    def _guards(self) -> PointFunction:
        return PointFunction(self.field, [g.value for g in self.field.guards])

    @cached_property
    def _everything(self) -> ResidualFunction:
        """Changed field and guards with their slopes in the state and all parameters."""
        f = self.field
        return ResidualFunction(
            [*self.rates, *(g.value for g in f.guards)], [*f.state, *f.parameters], {}
        )

    def point(self, y: Array, changes: Mapping[str, float] | None = None) -> Array:
        """State and all parameters as one vector."""
        values = {**self.values, **(changes or {})}
        return np.concatenate([y, [values[name] for name in self.field.parameters]])

    def guards(self, point: Array) -> Array:
        """Values of the guards."""
        n = len(self.field.state)
        return self._guards(0.0, point[:n], point[n:])

    def linearisation(self, point: Array) -> Array:
        """∂f/∂y within the constraints and modulo translation."""
        return self._within(self._local(point)[1])

    def linearisations(self, points: Array) -> Array:
        """The same at many points, shape (states + parameters, points)."""
        slopes = np.moveaxis(self._local(points)[1], -1, 0)
        n = len(self.field.state)
        if slopes.shape[1] == n and self.invariant.shape[1] == 0:
            return slopes
        return np.array([self._within(each) for each in slopes])

    def _within(self, slopes: Array) -> Array:
        n = len(self.field.state)
        if len(slopes) == n and self.invariant.shape[1] == 0:
            return slopes
        J = slopes[:n]
        removed = np.vstack([slopes[n:], self.invariant.T])
        basis = np.linalg.svd(removed)[2][np.linalg.matrix_rank(removed) :]
        return basis @ J @ basis.T

    def eigenvalues(self, point: Array) -> Array:
        """Eigenvalues of the linearisation, the rightmost first."""
        return rightmost_first(np.linalg.eigvals(self.linearisation(point)))

    def sizes(self, points: Array, among: Array | None = None) -> Sizes:
        """Sizes of the terms at some points, and residuals.

        Parameters
        ----------
        points : array, shape (states + parameters, points)
        among : array, optional
            All points of the branch; the largest terms over the branch determine the rounding
            errors.
        """
        values, slopes, state = self._scales(points)
        n = state.shape[1]
        largest = np.max(np.abs(points if among is None else among), axis=1)
        largest[:n] = np.maximum(largest[:n], np.max(state, axis=0))
        relative = ratio(values, np.abs(slopes) @ largest)
        return Sizes(state, relative[:, n:], np.max(np.abs(relative[:, :n]), axis=1, initial=0.0))

    def sizes_beside(self, points: Array, beside: Array) -> Sizes:
        """Sizes at separate points, each compared with another point of its branch.

        Parameters
        ----------
        points, beside : array, shape (states + parameters, points)
        """
        values, slopes, state = self._scales(points)
        n = state.shape[1]
        largest = np.maximum(np.abs(points), np.abs(beside)).T
        largest[:, :n] = np.maximum(largest[:, :n], state)
        terms = np.einsum("kij,kj->ki", np.abs(slopes), largest)
        relative = ratio(values, terms)
        return Sizes(state, relative[:, n:], np.max(np.abs(relative[:, :n]), axis=1, initial=0.0))

    def _scales(self, points: Array) -> tuple[Array, Array, Array]:
        """Values and slopes of the changed field and of the guards, and scales of the state."""
        n = len(self.field.state)
        values, slopes = (np.moveaxis(a, -1, 0) for a in self._everything(points))
        # Rounding errors of the terms of f change the solution by |A⁻¹| times the size of the
        # terms.
        inverse = np.linalg.pinv(slopes[:, :n, :n])
        terms = np.einsum("kij,jk->ki", np.abs(slopes), np.abs(points))
        state = np.maximum(
            np.abs(points[:n].T), np.einsum("kij,kj->ki", np.abs(inverse), terms[:, :n])
        )
        return values, slopes, state

    def units(self, x: Array, spans: Mapping[str, tuple[float, float]]) -> Array:
        """Units of each component of the state on a branch over ranges of parameters.

        The unit is its size, or its change with the parameters unless this is much larger.

        Parameters
        ----------
        x : array
            State and the parameters that have ranges.
        """
        n = len(self.field.state)
        state = self.sizes(self.point(x[:n], dict(zip(spans, x[n:], strict=True)))[:, None]).state[
            0
        ]
        own = np.maximum(np.abs(x[:n]), 0.01 * state)
        _, slopes = self.residual(*spans)(x)
        widths = np.array([high - low for low, high in spans.values()])
        # dy/dp = −(∂F/∂y)⁺ ∂F/∂p, the implicit function theorem.
        moved = np.abs(np.linalg.pinv(slopes[:, :n]) @ slopes[:, n:]) @ widths
        own = np.where(
            own > COMPUTED_ZERO * moved, np.maximum(own, np.minimum(moved, 10.0 * own)), moved
        )
        return np.where(own > 0.0, own, np.max(own, initial=0.0) or 1.0)

    def settled(self, y: Array) -> Array:
        """The state with rounding errors set to zero."""
        return np.where(
            np.abs(y) <= ROUNDED_SUM * self.sizes(self.point(y)[:, None]).state[0], 0.0, y
        )

    def drift(self, point: Array) -> Array:
        """Rates of the state in steady motion."""
        if self.invariant.shape[1] == 0:
            return np.zeros(len(self.field.state))
        n = len(self.field.state)
        values, slopes = self._local(point)
        # In steady motion the rates are along translations; other components are residuals.
        rates = self.invariant @ (self.invariant.T @ values[:n])
        return np.where(
            np.abs(rates)
            <= ROUNDED_SUM * (np.abs(slopes[:n]) @ self.sizes(point[:, None]).state[0]),
            0.0,
            rates,
        )


def rightmost_first(eigenvalues: Array) -> Array:
    """Eigenvalues, complex, in the order in which they decay; of many matrices those of each."""
    found = eigenvalues.astype(complex)
    return np.take_along_axis(found, np.lexsort((-found.imag, -found.real)), axis=-1)


def invariant_directions(
    equations: MotionEquations, values: Mapping[str, float], origin: Array
) -> Array:
    """Orthonormal basis of the translations that leave all forces, laws, thresholds, kinks,
    inertias and gaps unchanged.

    Within a region all of these are analytic, so that slopes at random points are decisive.

    Returns
    -------
    array, shape (states, translations)
    """
    d = equations.declaration
    contacts, rate = equations.contacts, equations.rate
    felt = [
        *equations.inertial_force,
        *equations.viscous_force,
        *equations.laws,
        *rate.force,
        *equations.kinks,
        *equations.inertia,
    ]
    for c in contacts:
        felt += [c.plus, c.minus, c.kinetic_plus, c.kinetic_minus]
    places = [i for i, name in enumerate(d.state) if name not in {f"d_{q}" for q in d.inertial}]
    names = [d.state[i] for i in places]
    slopes = [[ex.derivative(e, name) for name in names] for e in felt]
    rng = np.random.default_rng(0)
    rows = []
    others = (
        sorted(frozenset().union(*(e.symbols for e in felt)) - set(values) - set(d.state))
        if felt
        else []
    )
    for turn in range(4):
        spread = 0.3 * turn
        y = origin * (1.0 + spread * rng.uniform(-1, 1, len(origin))) + spread * rng.uniform(
            0, 1, len(origin)
        )
        at = {
            **values,
            **dict(zip(d.state, map(float, y), strict=True)),
            **{name: 0.3 + 0.1 * turn for name in others},
        }
        rows += [[ex.evaluate(s, at) if s is not ex.ZERO else 0.0 for s in row] for row in slopes]
    matrix = np.array(rows).reshape(-1, len(names))
    matrix = matrix[np.all(np.isfinite(matrix), axis=1)]
    size = np.max(np.abs(matrix), axis=1, keepdims=True, initial=0.0)
    matrix = np.vstack([np.zeros((1, len(names))), matrix / np.where(size > 0.0, size, 1.0)])
    # The factor R has the same null space, and far fewer rows.
    _, s, v = np.linalg.svd(np.linalg.qr(matrix, mode="r"))
    rank = int(np.sum(s > FINE_RANK * max(1.0, np.max(s, initial=0.0))))
    basis = np.zeros((len(d.state), len(names) - rank))
    basis[places] = np.where(np.abs(v[rank:]) > COMPUTED_ZERO, v[rank:], 0.0).T
    return basis
