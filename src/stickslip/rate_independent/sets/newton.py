"""Nearest points of a convex set whose support function is a formula: Newton's method for the
normal.

Let y be the point of K nearest to ξ in a metric M. Its normal v = M(ξ − y) minimises the strictly
convex function ½⟨v, M⁻¹v⟩ + R(v) − ⟨ξ, v⟩. If R is smooth at the minimum, damped Newton steps
converge to it, and y = ∇R(v). If R has a kink there, v is restricted to the kink, on which R is
smooth: the kink becomes a constraint of the equations, and Newton's method converges from a start
that is close.

If ξ is on the boundary of K, this v is 0, and the direction of a computed one is a rounding error.
The gauge of ξ has no such limit: it is R(v) for the v that minimises ½R(v)² − ⟨ξ, v⟩, and ∇R(v) is
the point of the boundary in the direction of ξ.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.convex.formula import ConvexFormula, Kink
from stickslip.kept import made_once
from stickslip.numerics.levels import EXACT_RANK, LOWERED
from stickslip.numerics.ratios import ratio
from stickslip.rate_independent.sets.projections import nearest_in_hull
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.evaluator import evaluator_of_numbers

_EPS = float(np.finfo(float).eps)
_MOST = 60  # largest number of damped steps
_MOST_ON_KINK = 25  # largest number of Newton steps on a kink
_SHORTEST = 2.0**-16  # smallest fraction of a step
_SHORT = 0.1  # fraction of a step below which the step counts as short …
_MOST_SHORT = 3  # … and number of short steps above which a kink is assumed
_EXACT = 16.0 * _EPS  # residual, relative to the forces, that is a rounding error
# relative to |v|: largest distance of a start from a kink that contains the solution
_NEAR_KINK = 0.05
# relative to |v|: distances from a kink at which gradients are evaluated
_BESIDE = (1e-8, 1e-11, 1e-14)
_SURE = 1e-10  # largest relative distance of a mean of gradients from the point that it represents
_MOST_ON_FACE = 60  # largest number of gradients added for one face
_ON_KINK = 1e-9  # relative to |v|: a start this close to a kink lies on it
_PROBES = 8  # number of random directions in which a point is compared with the support function
_NO_PROBE = 1e-9  # smallest length of the sum of two unit vectors that has a direction
_REACHES = (1.0, 1e-1, 1e-2, 1e-3)  # distances of the probes from the normal, a unit vector


class Normal(NamedTuple):
    """The nearest point of ξ in K, or the boundary point on the ray through ξ, with its normal.

    Attributes
    ----------
    y : ndarray of shape (n,)
        The point.
    v : ndarray of shape (n,)
        Normal to K at y: M(ξ − y); on a ray, with R(v) equal to the gauge of ξ.
    change : ndarray of shape (n, n)
        dv/dξ.
    kinks : tuple of Kink
        Kinks that contain v.
    """

    y: Array
    v: Array
    change: Array
    kinks: tuple[Kink, ...] = ()


class FormulaAt(NamedTuple):
    """A formula at one v: its value, gradient (n,) and second derivatives (n, n)."""

    value: float
    gradient: Array
    hessian: Array

    def outer(self, v: Array, W: Array | None) -> FormulaAt:
        """The function ½⟨v, Wv⟩ + R(v) of a formula R; ½R(v)² without W."""
        if W is None:
            square = np.outer(self.gradient, self.gradient) + self.value * self.hessian
            return FormulaAt(0.5 * self.value**2, self.value * self.gradient, square)
        pull = W @ v
        return FormulaAt(0.5 * float(v @ pull) + self.value, pull + self.gradient, W + self.hessian)


@dataclass(frozen=True, eq=False)
class NormalSearch:
    """Search for normals of the sets K whose support function is a formula R.

    Common arguments of its methods:

    xi : ndarray of shape (n,)
        A force. If the nearest point is requested, it must be outside K.
    W : ndarray of shape (n, n) or None
        The inverse M⁻¹ of the metric if the nearest point is requested; None if the point on the
        ray is.
    others : ndarray of shape (k,)
        Values of the other names in the formula, such as the phase.
    """

    formula: ConvexFormula

    def at(self, v: Array, others: Array) -> FormulaAt:
        """Value and derivatives at v ≠ 0 of any size; NaN if undefined."""
        n = self.formula.dimension
        size = float(np.abs(v).max())
        value, *rest = self.formula.numbers([*(v / size).tolist(), *others.tolist()])
        gradient, hessian = np.array(rest[:n]), np.array(rest[n:]).reshape(n, n)
        return FormulaAt(size * value, gradient, hessian / size)

    def find(
        self, xi: Array, W: Array | None, others: Array, start: Array | None = None
    ) -> Normal | None:
        """The nearest point of ξ, or the one on its ray; None if the search does not converge to
        machine precision.

        Parameters
        ----------
        xi, W, others
            As described in the class.
        start : ndarray of shape (n,), optional
            A v that separates ξ from K; by default Mξ, which may not separate them.
        """
        if start is not None and self._near_kinks(start, others, _ON_KINK):
            found = self.on_kink(xi, W, start, others)
            if found is not None:
                return found
        found, v = self._descended(xi, W, others, start)
        if found is not None:
            return found
        # The search stopped close to a kink.
        return self.on_kink(xi, W, v, others) if v.any() else None

    def _descended(
        self, xi: Array, W: Array | None, others: Array, start: Array | None
    ) -> tuple[Normal | None, Array]:
        """The minimum by damped Newton steps, or None, and the last v; 0 if no start was found."""
        if start is None:
            start = xi if W is None else np.linalg.solve(W, xi)
        v = self._scaled(xi, W, start, others)
        if not v.any():
            return None, v
        now = self.at(v, others)
        shortened = 0
        for _ in range(_MOST):
            here = now.outer(v, W)
            residual = here.gradient - xi
            error = float(np.abs(residual).max())
            if not np.isfinite(here.hessian).all() or not np.isfinite(error):
                return None, v
            size = float(np.abs(xi).max() + np.abs(now.gradient).max())
            if error <= _EXACT * size:
                return Normal(now.gradient, v, np.linalg.pinv(here.hessian)), v
            # At an edge of K, many v belong to one point on a ray, and the matrix is singular.
            try:
                step = (
                    np.linalg.solve(here.hessian, -residual)
                    if W is not None
                    else -np.linalg.pinv(here.hessian, rcond=EXACT_RANK, hermitian=True) @ residual
                )
            except np.linalg.LinAlgError:
                return None, v
            # Armijo's condition; a residual that is halved is accepted as well, since near the
            # minimum the decrease of the function is lost in rounding errors.
            level = here.value - float(xi @ v)
            slope = float(residual @ step)
            fraction = 1.0
            while True:
                w = v + fraction * step
                if w.any():
                    then = self.at(w, others)
                    there = then.outer(w, W)
                    lower = there.value - float(xi @ w) <= level + LOWERED * fraction * slope
                    if lower or float(np.abs(there.gradient - xi).max()) <= 0.5 * error:
                        break
                fraction *= 0.5
                if fraction < _SHORTEST:
                    # No decrease beyond rounding errors: accept a slightly larger residual;
                    # otherwise this is a kink.
                    if error <= 64.0 * _EXACT * size:
                        return Normal(now.gradient, v, np.linalg.pinv(here.hessian)), v
                    return None, v
            shortened += fraction < _SHORT
            if shortened > _MOST_SHORT:
                return None, v
            v, now = w, then
        return None, v

    def _scaled(self, xi: Array, W: Array | None, v: Array, others: Array) -> Array:
        """The multiple of v that minimises the function; 0 if v does not separate ξ from K (on a
        ray, from 0)."""
        if not v.any():
            return v
        value = self.at(v, others).value
        if W is None:
            # The minimum over c > 0 of ½c²R(v)² − c⟨ξ, v⟩.
            ahead, square = float(xi @ v), value**2
        else:
            # The minimum over c > 0 of ½c²⟨v, Wv⟩ + cR(v) − c⟨ξ, v⟩.
            ahead, square = float(xi @ v) - value, float(v @ W @ v)
        return v * (ahead / square) if ahead > 0.0 and square > 0.0 else np.zeros(len(v))

    def on_kink(self, xi: Array, W: Array | None, v: Array, others: Array) -> Normal | None:
        """The nearest point of ξ, or the one on its ray, from a v close to the solution and to the
        kinks that contain it; None if it is not found."""
        v = self._scaled(xi, W, v, others)
        if not v.any():
            return None
        # The kinks nearby that contain the solution are not known. First all of them, then fewer,
        # are constraints; the point that is in K is the solution.
        near = self._near_kinks(v, others, _NEAR_KINK)
        best: Normal | None = None
        least = np.inf
        size = float(np.abs(xi).max())
        for count in range(len(near), 0, -1):
            chosen = tuple(self.formula.kinks[i] for i in sorted(near[:count]))
            found = self._solved(chosen, xi, W, v, others)
            if found is None:
                continue
            outside = self._outside(found, others)
            if outside < least:
                best, least = found, outside
            if outside <= _EXACT * size:
                break
        return best if least <= 100.0 * _EXACT * size else None

    def _near_kinks(self, v: Array, others: Array, within: float) -> list[int]:
        """Indices of the kinks close to a direction, the closest first."""
        size = float(np.abs(v).max())
        if not size > 0.0:
            return []
        near = []
        for i, kink in enumerate(self.formula.kinks):
            zeros, slopes, _ = self._zeros((kink,), v / size, others)
            slope = float(np.abs(slopes).max(initial=0.0))
            value = float(np.abs(zeros).max(initial=0.0))
            if np.isfinite(value) and slope > 0.0 and value <= within * slope:
                near.append((value / slope, i))
        return [i for _, i in sorted(near)]

    def _solved(
        self, kinks: tuple[Kink, ...], xi: Array, W: Array | None, v: Array, others: Array
    ) -> Normal | None:
        """Newton's method on given kinks; None if it does not converge."""
        n = len(xi)
        multipliers: Array | None = None
        scale = float(np.abs(xi).max())
        for _ in range(_MOST_ON_KINK):
            size = float(np.abs(v).max())
            if not size > 0.0:
                return None
            zeros, slopes, bends = self._zeros(kinks, v / size, others)
            here = self._without_kinks(kinks, v, others).outer(v, W)
            residual = here.gradient - xi
            if not all(np.isfinite(x).all() for x in (residual, here.hessian, slopes, bends)):
                return None
            if multipliers is None:
                multipliers = np.linalg.lstsq(slopes.T, -residual, rcond=None)[0]
            bent = np.einsum("k,kij->ij", multipliers, bends) / size
            # The gradient of the Lagrangian and the kinks vanish together: Newton's method with the
            # KKT matrix.
            corner = np.zeros((len(zeros), len(zeros)))
            matrix = np.block([[here.hessian + bent, slopes.T], [slopes, corner]])
            equations = np.concatenate([residual + slopes.T @ multipliers, size * zeros])
            try:
                inverse = np.linalg.pinv(matrix, rcond=EXACT_RANK)
            except np.linalg.LinAlgError:
                return None
            step = -inverse @ equations
            error = float(np.abs(equations[:n]).max()) / scale
            distance = ratio(
                float(np.abs(zeros).max(initial=0.0)), float(np.abs(slopes).max(initial=0.0))
            )
            converged = float(np.abs(step[:n]).max()) <= _EPS * size
            if max(error, distance) <= (64.0 if converged else 0.25) * _EXACT:
                y = xi - W @ v if W is not None else xi / self.at(v, others).value
                return Normal(y, v, inverse[:n, :n], kinks)
            v, multipliers = v + step[:n], multipliers + step[n:]
        return None

    def on_face(self, found: Normal, others: Array) -> Array:
        """Replace the computed point y by a point of the face of K with the normal v.

        Gradients of R at points around v are points of this face. The result is their convex
        combination nearest to y, a point of K (exactly if the kinks are terms of a sum). If none is
        close to y, the result is y itself, which is in K only up to the accuracy of Newton's
        method.
        """
        if not found.kinks:
            return found.y
        unit = found.v / np.abs(found.v).max()
        # Directions in which v leaves the kinks: the row space of their gradients.
        slopes = self._zeros(found.kinks, unit, others)[1]
        sizes, across = np.linalg.svd(slopes, full_matrices=False)[1:]
        across = across[sizes > EXACT_RANK * sizes.max(initial=0.0)]
        size = float(np.abs(found.y).max())
        best, least = found.y, _SURE * size
        for reach in _BESIDE:
            near = self._combined(found, unit, across, reach, others)
            away = float(np.abs(near - found.y).max())
            if away <= least:
                best, least = near, away
            if away <= 10.0 * _EXACT * size:
                break
        return best

    def _combined(
        self, found: Normal, unit: Array, across: Array, reach: float, others: Array
    ) -> Array:
        """The convex combination, nearest to the computed point, of gradients at the distance
        `reach` from the kinks."""
        points: list[Array] = []
        smooth = self._without_kinks(found.kinks, unit, others).gradient

        def add(direction: Array) -> bool:
            """Add the gradient in a direction, corrected for the change of the smooth part over the
            step; return whether it is new."""
            v = unit + reach * direction
            point = self.at(v, others).gradient
            point = point - self._without_kinks(found.kinks, v, others).gradient + smooth
            size = float(np.abs(point).max())
            if not np.isfinite(size) or any(
                np.abs(point - other).max() <= _EPS * size for other in points
            ):
                return False
            points.append(point)
            return True

        for direction in (*across, *-across):
            add(direction)
        if not points:
            return found.y
        near = points[0]
        # Add the gradient in the direction that still separates the hull from y.
        for _ in range(_MOST_ON_FACE):
            near = nearest_in_hull(np.array(points), found.y)
            rest = across.T @ (across @ (found.y - near))
            length = float(np.linalg.norm(rest))
            if length <= _EPS * float(np.abs(found.y).max()) or not add(rest / length):
                break
        return near

    def _outside(self, found: Normal, others: Array) -> float:
        """Largest observed excess ⟨y, v⟩ − R(v) of a point over K, in directions around its
        normal."""
        y, v = found.y, found.v
        n = len(v)
        unit = v / np.linalg.norm(v)
        rng = np.random.default_rng(0)
        offsets = np.vstack([np.eye(n), rng.normal(size=(_PROBES, n)) / np.sqrt(n)])
        offsets = np.vstack([offsets, -offsets])
        probes = np.vstack([unit, *(unit + reach * offsets for reach in _REACHES)])
        lengths = np.linalg.norm(probes, axis=1)
        probes = (probes[lengths > _NO_PROBE] / lengths[lengths > _NO_PROBE, None]).T
        rows = np.broadcast_to(others[:, None], (len(others), probes.shape[1]))
        values = self.formula.values(np.concatenate([probes, rows]))[0]
        # K = {y : ⟨y, v⟩ ≤ R(v) for all v}, and R is its support function.
        return float((y @ probes - values).max())

    def _without_kinks(self, kinks: tuple[Kink, ...], v: Array, others: Array) -> FormulaAt:
        """The formula at v, with some kinks replaced by smooth functions."""
        n = len(v)

        def make() -> Callable[[Sequence[float]], list[float]]:
            inside = {kink.node: kink.inside for kink in kinks}
            smooth = ex.rewrite(self.formula.value, inside.get, again=True)
            return self._derived([smooth])

        size = float(np.abs(v).max())
        numbers = made_once(self, "without kinks", make, kinks)
        out = np.array(numbers([*(v / size).tolist(), *others.tolist()]))
        return FormulaAt(size * float(out[0]), out[1 : n + 1], out[n + 1 :].reshape(n, n) / size)

    def _zeros(
        self, kinks: tuple[Kink, ...], v: Array, others: Array
    ) -> tuple[Array, Array, Array]:
        """Functions that vanish on the kinks (k,), with gradients (k, n) and second derivatives (k,
        n, n)."""
        n = len(v)
        zeros = tuple(dict.fromkeys(zero for kink in kinks for zero in kink.zeros))
        numbers = made_once(self, "zeros", lambda: self._derived(zeros), zeros)
        out = np.array(numbers([*v.tolist(), *others.tolist()])).reshape(len(zeros), -1)
        return out[:, 0], out[:, 1 : n + 1], out[:, n + 1 :].reshape(-1, n, n)

    def _derived(self, expressions: Sequence[ex.Expr]) -> Callable[[Sequence[float]], list[float]]:
        """Function that evaluates expressions, each with its gradient and second derivatives."""
        names = self.formula.names
        rows: list[ex.Expr] = []
        for e in expressions:
            slopes = [ex.derivative(e, name) for name in names]
            rows += [e, *slopes, *(ex.derivative(s, name) for s in slopes for name in names)]
        return evaluator_of_numbers(rows, [*names, *self.formula.ranges])
