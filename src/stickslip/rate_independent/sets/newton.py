"""Nearest points of a convex set whose support function is a formula: Newton's method for the
normal.

With v = M(ξ − y) the point y of K nearest to ξ in a metric M belongs to the least ½⟨v, M⁻¹v⟩ + R(v)
− ⟨ξ, v⟩, a strictly convex function. Where R is smooth at its minimum, damped Newton steps find it,
and y = ∇R(v). Where R has a kink there, v moves along the kink only, on which R is smooth again:
the equations get the kink as a constraint, and a start that is close is improved to rounding.

Where ξ is on the boundary of K, that v is 0, and its direction noise. The gauge of ξ is not: it is
R(v) for the least ½R(v)² − ⟨ξ, v⟩, where ∇R(v) is the point of the boundary in the direction of ξ.
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
_MOST_ON_KINK = 25
_SHORTEST = 2.0**-16  # shortest fraction of a step
_SHORT = 0.1
_MOST_SHORT = 3  # number of steps that had to be shortened a lot: there is a kink
_EXACT = 16.0 * _EPS  # residual, relative to the forces, that is a rounding error
# relative to |v|: largest distance of a start from a kink that contains the solution
_NEAR_KINK = 0.05
# relative to |v|: distances from a kink at which gradients are evaluated
_BESIDE = (1e-8, 1e-11, 1e-14)
_SURE = 1e-10  # largest relative distance of a mean of gradients from the point that it represents
_MOST_ON_FACE = 60
_ON_KINK = 1e-9  # relative to |v|: a start this close to a kink lies on it
_PROBES = 8  # number of random directions in which a point is compared with the support function
_NO_PROBE = 1e-9  # smallest length of the sum of two unit vectors that has a direction
_REACHES = (1.0, 1e-1, 1e-2, 1e-3)


class Normal(NamedTuple):
    """A nearest point, or one on a ray.

    Attributes
    ----------
    y : ndarray of shape (n,)
        The point.
    v : ndarray of shape (n,)
        Normal to K there: M(ξ − y), or R(v) = gauge of ξ.
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
    """A function at one v: its value, gradient (n,) and second derivatives (n, n)."""

    value: float
    gradient: Array
    hessian: Array

    def outer(self, v: Array, W: Array | None) -> FormulaAt:
        """Functional of a formula R: ½⟨v, Wv⟩ + R(v), or ½R(v)² without W."""
        if W is None:
            square = np.outer(self.gradient, self.gradient) + self.value * self.hessian
            return FormulaAt(0.5 * self.value**2, self.value * self.gradient, square)
        pull = W @ v
        return FormulaAt(0.5 * float(v @ pull) + self.value, pull + self.gradient, W + self.hessian)


@dataclass(frozen=True, eq=False)
class NormalSearch:
    """The sets of a formula."""

    formula: ConvexFormula

    def at(self, v: Array, others: Array) -> FormulaAt:
        """Value and derivatives at v ≠ 0 of any size; NaN if undefined."""
        n = self.formula.dimension
        size = float(np.abs(v).max())
        value, *rest = self.formula.numbers([*(v / size).tolist(), *others.tolist()])
        gradient, hessian = np.array(rest[:n]), np.array(rest[n:]).reshape(n, n)
        return FormulaAt(size * value, gradient, hessian / size)

    def smooth(
        self, xi: Array, W: Array | None, others: Array, start: Array | None = None
    ) -> Normal | None:
        """The nearest point of ξ, or the one on its ray, if it is found where R is smooth.

        Parameters
        ----------
        xi : ndarray of shape (n,)
            Outside K, if the nearest point is meant.
        W : ndarray of shape (n, n), optional
            M⁻¹; None if the point on the ray is meant.
        others : ndarray of shape (k,)
            FormulaAt of the other names.
        start : ndarray of shape (n,), optional
            A v that separates ξ from K; by default Mξ, which may not.
        """
        return self._descended(xi, W, others, start)[0]

    def found(
        self, xi: Array, W: Array | None, others: Array, start: Array | None = None
    ) -> Normal | None:
        """The nearest point of ξ, or the one on its ray, for smooth R or at a kink; None if it is
        not found to rounding.

        Parameters
        ----------
        xi : ndarray of shape (n,)
        W : ndarray of shape (n, n), optional
        others : ndarray of shape (k,)
        start : ndarray of shape (n,), optional
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
        """The minimum, or the last point of the descent; 0 if it could not start."""
        if start is None:
            start = xi if W is None else np.linalg.solve(W, xi)
        v = self._scaled(xi, W, start, others)
        if not v.any():
            return None, v
        now = self.at(v, others)
        shortened = 0
        for _ in range(_MOST):
            here = now.outer(v, W)
            rest = here.gradient - xi
            off = float(np.abs(rest).max())
            if not np.isfinite(here.hessian).all() or not np.isfinite(off):
                return None, v
            size = float(np.abs(xi).max() + np.abs(now.gradient).max())
            if off <= _EXACT * size:
                return Normal(now.gradient, v, np.linalg.pinv(here.hessian)), v
            # At an edge of K many v belong to one point on a ray: any will do.
            try:
                step = (
                    np.linalg.solve(here.hessian, -rest)
                    if W is not None
                    else -np.linalg.pinv(here.hessian, rcond=EXACT_RANK, hermitian=True) @ rest
                )
            except np.linalg.LinAlgError:
                return None, v
            level = here.value - float(xi @ v)
            slope = float(rest @ step)
            share = 1.0
            while True:
                w = v + share * step
                if w.any():
                    then = self.at(w, others)
                    there = then.outer(w, W)
                    left = float(np.abs(there.gradient - xi).max())
                    fallen = there.value - float(xi @ w) <= level + LOWERED * share * slope
                    if fallen or left <= 0.5 * off:
                        break
                share *= 0.5
                if share < _SHORTEST:
                    # No decrease beyond rounding errors: accept a slightly larger residual;
                    # otherwise this is a kink.
                    if off <= 64.0 * _EXACT * size:
                        return Normal(now.gradient, v, np.linalg.pinv(here.hessian)), v
                    return None, v
            shortened += share < _SHORT
            if shortened > _MOST_SHORT:
                return None, v
            v, now = w, then
        return None, v

    def _scaled(self, xi: Array, W: Array | None, v: Array, others: Array) -> Array:
        """The best multiple of v; 0 if v does not separate ξ from K, or from 0."""
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
        kinks that contain it; None if it is not found.

        Parameters
        ----------
        xi : ndarray of shape (n,)
        W : ndarray of shape (n, n), optional
        v : ndarray of shape (n,)
        others : ndarray of shape (k,)
        """
        v = self._scaled(xi, W, v, others)
        if not v.any():
            return None
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
        """The kinks close to a direction, the closest first."""
        size = float(np.abs(v).max())
        if not size > 0.0:
            return []
        near = []
        for i, kink in enumerate(self.formula.kinks):
            zeros, slopes, _ = self._zeros((kink,), v / size, others)
            steep = float(np.abs(slopes).max(initial=0.0))
            off = float(np.abs(zeros).max(initial=0.0))
            if np.isfinite(off) and steep > 0.0 and off <= within * steep:
                near.append((off / steep, i))
        return [i for _, i in sorted(near)]

    def _solved(
        self, kinks: tuple[Kink, ...], xi: Array, W: Array | None, v: Array, others: Array
    ) -> Normal | None:
        n = len(xi)
        held: Array | None = None
        scale = float(np.abs(xi).max())
        for _ in range(_MOST_ON_KINK):
            size = float(np.abs(v).max())
            if not size > 0.0:
                return None
            zeros, slopes, bends = self._zeros(kinks, v / size, others)
            here = self._beside(kinks, v, others).outer(v, W)
            rest = here.gradient - xi
            if not all(np.isfinite(x).all() for x in (rest, here.hessian, slopes, bends)):
                return None
            if held is None:
                # The multipliers of the kinks, at first by least squares.
                held = np.linalg.lstsq(slopes.T, -rest, rcond=None)[0]
            bent = np.einsum("k,kij->ij", held, bends) / size
            # The gradient of the Lagrangian and the kinks vanish together: Newton's method with the
            # KKT matrix.
            corner = np.zeros((len(zeros), len(zeros)))
            matrix = np.block([[here.hessian + bent, slopes.T], [slopes, corner]])
            off = np.concatenate([rest + slopes.T @ held, size * zeros])
            try:
                inverse = np.linalg.pinv(matrix, rcond=EXACT_RANK)
            except np.linalg.LinAlgError:
                return None
            step = -inverse @ off
            missing = float(np.abs(off[:n]).max())
            away = ratio(
                float(np.abs(zeros).max(initial=0.0)), float(np.abs(slopes).max(initial=0.0))
            )
            settled = float(np.abs(step[:n]).max()) <= _EPS * size
            if max(missing / scale, away) <= (64.0 if settled else 0.25) * _EXACT:
                y = xi - W @ v if W is not None else xi / self.at(v, others).value
                return Normal(y, v, inverse[:n, :n], kinks)
            v, held = v + step[:n], held + step[n:]
        return None

    def on_face(self, found: Normal, others: Array) -> Array:
        """The mean of gradients around v that is nearest to the computed point, in the face of K to
        which v is normal: a point of K, exactly if kinks are terms of a sum. If none is close, the
        computed point, which is in K only up to the accuracy of Newton's method.

        Parameters
        ----------
        others : ndarray of shape (k,)
        """
        if not found.kinks:
            return found.y
        unit = found.v / np.abs(found.v).max()
        slopes = self._zeros(found.kinks, unit, others)[1]
        sizes, ways = np.linalg.svd(slopes, full_matrices=False)[1:]
        ways = ways[sizes > EXACT_RANK * sizes.max(initial=0.0)]
        best, least = found.y, _SURE * float(np.abs(found.y).max())
        for reach in _BESIDE:
            near = self._on_face(found, unit, ways, reach, others)
            away = float(np.abs(near - found.y).max())
            if away <= least:
                best, least = near, away
            if away <= 10.0 * _EXACT * float(np.abs(found.y).max()):
                break
        return best

    def _on_face(
        self, found: Normal, unit: Array, ways: Array, reach: float, others: Array
    ) -> Array:
        points: list[Array] = []
        smooth = self._beside(found.kinks, unit, others).gradient

        def add(way: Array) -> bool:
            """Add the gradient off the kinks in a direction, if it is new, corrected for the change
            of the smooth part over the step."""
            v = unit + reach * way
            point = self.at(v, others).gradient
            point = point - self._beside(found.kinks, v, others).gradient + smooth
            size = float(np.abs(point).max())
            if not np.isfinite(size) or any(
                np.abs(point - other).max() <= _EPS * size for other in points
            ):
                return False
            points.append(point)
            return True

        for way in (*ways, *-ways):
            add(way)
        if not points:
            return found.y
        near = points[0]
        for _ in range(_MOST_ON_FACE):
            near = nearest_in_hull(np.array(points), found.y)
            rest = ways.T @ (ways @ (found.y - near))
            length = float(np.linalg.norm(rest))
            if length <= _EPS * float(np.abs(found.y).max()) or not add(rest / length):
                break
        return near

    def _outside(self, found: Normal, others: Array) -> float:
        """Observed excess of a point over K, in random directions and close to v."""
        y, v = found.y, found.v
        n = len(v)
        unit = v / np.linalg.norm(v)
        rng = np.random.default_rng(0)
        ways = np.vstack([np.eye(n), rng.normal(size=(_PROBES, n)) / np.sqrt(n)])
        ways = np.vstack([ways, -ways])
        probes = np.vstack([unit, *(unit + reach * ways for reach in _REACHES)])
        lengths = np.linalg.norm(probes, axis=1)
        probes = (probes[lengths > _NO_PROBE] / lengths[lengths > _NO_PROBE, None]).T
        rows = np.broadcast_to(others[:, None], (len(others), probes.shape[1]))
        values = self.formula.values(np.concatenate([probes, rows]))[0]
        # K = {y : ⟨y, v⟩ ≤ R(v) for all v}, and R is its support function.
        return float((y @ probes - values).max())

    def _beside(self, kinks: tuple[Kink, ...], v: Array, others: Array) -> FormulaAt:
        """The formula at v, with kinks replaced by smooth functions."""
        n = len(v)

        def make() -> Callable[[Sequence[float]], list[float]]:
            inside = {kink.node: kink.inside for kink in kinks}
            smooth = ex.rewrite(self.formula.value, inside.get, again=True)
            return self._derived([smooth])

        size = float(np.abs(v).max())
        numbers = made_once(self, "beside", make, kinks)
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
        """Value, gradient and second derivatives, as expressions in sequence."""
        names = self.formula.names
        rows: list[ex.Expr] = []
        for e in expressions:
            slopes = [ex.derivative(e, name) for name in names]
            rows += [e, *slopes, *(ex.derivative(s, name) for s in slopes for name in names)]
        return evaluator_of_numbers(rows, [*names, *self.formula.ranges])
