"""Nearest points of convex sets: one finite or safeguarded method for each shape."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.errors import ConvergenceError
from stickslip.numerics.levels import EXACT_RANK, FEW_ROUNDINGS, LAST_DIGITS
from stickslip.rate_independent.sets.phase_intervals import lengths

if TYPE_CHECKING:
    from stickslip.rate_independent.sets.potential import Dissipation

Projection = Callable[[Array], tuple[Array, Array]]
_DAMPED = 0.95  # fraction of the longest admissible gradient step
_MOST_NEWTON = 500  # largest number of Newton steps
_MOST_IDLE = 40  # largest number of steps without progress
_SHORTEST_SHARE = 2.0**-12  # shortest fraction of a Newton step
_ENOUGH = 1e-11  # accepted residual, relative to the sizes of ξ and y
# exchanges of whole blocks without progress before one index at a time is exchanged
_BLOCK_TRIALS = 3
_NO_STEP = 1e-16  # relative: less than half of ε, so that a multiplier does not change
_ON_SPHERE = 2e-16  # a length below 1 + ε is 1
# violation of half-spaces by a projection, relative to the largest distance or offset
_HOLDS = 1e-9
# smallest residual relative to the compared sizes, limited by rounding errors
_LEAST_RESIDUAL = 1e-16


def nearest_in_box(M: Array, xi: Array, lower: Array, upper: Array) -> Array:
    """The y in [lower, upper] with the least ½⟨M(ξ − y), ξ − y⟩, by block principal pivoting.

    All components on the wrong side change at once as long as their number falls; otherwise only
    the first one does, a rule that cannot cycle since M is positive definite (J. J. Júdice and F.
    M. Pires, *A block principal pivoting algorithm for large-scale strictly monotone linear
    complementarity problems*, Comput. Oper. Res. 21 (1994) 587-596).
    """
    from scipy.linalg import cho_factor, cho_solve

    if (lower <= xi).all() and (xi <= upper).all():
        return xi.copy()
    size = max(np.abs(xi).max(), np.abs(lower).max(), np.abs(upper).max())
    slack = FEW_ROUNDINGS * size
    force_slack = FEW_ROUNDINGS * size * np.abs(M).sum(axis=1).max()
    # −1 at the lower bound, 1 at the upper one, 0 free
    held = np.where(xi < lower, -1, np.where(xi > upper, 1, 0))
    pinned = lower == upper
    held[pinned] = -1
    fewest = len(xi) + 1
    trials = _BLOCK_TRIALS
    for _ in range(1000 + 50 * len(xi)):
        free = held == 0
        y = np.where(held < 0, lower, upper)
        if free.any():
            # With the other components at their bounds, the force on the free ones vanishes.
            pull = (M[free] @ xi) - M[np.ix_(free, ~free)] @ y[~free]
            y[free] = cho_solve(cho_factor(M[np.ix_(free, free)]), pull)
        force = M @ (xi - y)
        below = free & (y < lower - slack)
        above = free & (y > upper + slack)
        off = ~pinned & (
            ((held < 0) & (force > force_slack)) | ((held > 0) & (force < -force_slack))
        )
        wrong = np.flatnonzero(below | above | off)
        if not len(wrong):
            return np.clip(y, lower, upper)
        if len(wrong) < fewest:
            fewest = len(wrong)
            trials = _BLOCK_TRIALS
        elif trials > 0:
            trials -= 1
        else:
            wrong = wrong[:1]
        held[wrong] = np.where(below, -1, np.where(above, 1, 0))[wrong]
    raise ConvergenceError(
        "projection onto a box",
        f"{fewest} of {len(xi)} components still have the wrong sign",
        "The metric is too ill-conditioned for double precision",
    )


def nearest_in_ellipsoid(root: Array, xi: Array, M: Array | None = None) -> Array:
    """The y in {root u : |u| ≤ 1} with the least ½⟨M(ξ − y), ξ − y⟩; `root` has full column
    rank."""
    if root.shape[1] == 0:
        return np.zeros_like(xi)
    # With y = root u the metric of u is rootᵀ M root; in its axes the multiplier of |u| ≤ 1 is the
    # root of one secular equation.
    pulled = root if M is None else M @ root
    eigenvalues, Q = np.linalg.eigh(root.T @ pulled)
    ((u,), (multiplier,)) = secular((Q.T @ (pulled.T @ xi))[None], eigenvalues[None])
    if multiplier == 0.0:
        return xi.copy() if root.shape[0] == root.shape[1] else root @ (Q @ u)
    return root @ (Q @ (u / np.linalg.norm(u)))


def secular(load: Array, eigenvalues: Array) -> tuple[Array, Array]:
    """u = (B + λ)⁻¹ load with the least λ ≥ 0 for which |u| ≤ 1, and that λ; row by row, B
    diagonal, shapes (m, k).

    1/|u| is concave and increasing in λ, so that Newton's method for 1/|u| = 1 from λ = 0 goes up
    to the root and not beyond. Components whose load is 0 are 0 in u.
    """
    eigenvalues = np.where(load != 0.0, eigenvalues, 1.0)
    multiplier = np.zeros(len(load))
    u = load / eigenvalues
    open_ = np.flatnonzero(np.square(u).sum(axis=1) > 1.0)
    for _ in range(100):
        if not len(open_):
            break
        shifted = eigenvalues[open_] + multiplier[open_, None]
        u[open_] = v = load[open_] / shifted
        square = np.square(v).sum(axis=1)
        length = np.sqrt(square)
        # since d|u|/dλ = −Σ (uᵢ²/(bᵢ + λ))/|u|
        step = (length - 1.0) * square / (np.square(v) / shifted).sum(axis=1)
        multiplier[open_] += np.maximum(step, 0.0)
        open_ = open_[(step > _NO_STEP * multiplier[open_]) & (length - 1.0 > _ON_SPHERE)]
    return u, multiplier


def nearest_in_hull(points: Array, xi: Array, M: Array | None = None) -> Array:
    """The point of the convex hull of the rows of `points`, shape (k, n), nearest to ξ, by an
    active set."""
    weights = weights_in_hull(points, xi, M)
    base, *others = np.flatnonzero(weights)
    # Solved again on the face that was found, to full accuracy.
    if others:
        rest = points - xi if M is None else (points - xi) @ np.linalg.cholesky(M)
        share = np.linalg.lstsq((rest[others] - rest[base]).T, -rest[base], rcond=None)[0]
        if share.min() >= 0 and share.sum() <= 1:
            return points[base] + share @ (points[others] - points[base])
    return weights @ points


def weights_in_hull(points: Array, xi: Array, M: Array | None = None) -> Array:
    """Weights of the nearest point, shape (k,): nonnegative, with the sum 1, at most n + 1 of them
    positive.

    The nonnegative u with the least |Σ u_j (p_j − ξ)|² + (Σ u_j − 1)² has them, up to a factor (C.
    L. Lawson and R. J. Hanson, *Solving Least Squares Problems*, 1974, chapter 23).
    """
    rest = points - xi
    # In the coordinates of the Cholesky factor the metric is the Euclidean one.
    if M is not None:
        rest = rest @ np.linalg.cholesky(M)
    size = np.linalg.norm(rest, axis=1).max()
    if size == 0.0:
        return np.eye(len(points))[0]
    weights = nonnegative_least_squares(np.vstack([rest.T / size, np.ones(len(rest))]))
    return weights / weights.sum()


def nearest_in_polyhedron(
    normals: Array, offsets: Array, xi: Array, M: Array | None = None
) -> Array:
    """The y with normals y ≤ offsets nearest to ξ."""
    return nearest_and_faces(normals, offsets, xi, M)[0]


def nearest_and_faces(
    normals: Array, offsets: Array, xi: Array, M: Array | None = None
) -> tuple[Array, NDArray[np.bool_]]:
    """The y with normals y ≤ offsets nearest to ξ, and which faces are active.

    By the least distance program of Lawson and Hanson, chapter 23.
    """
    beyond = normals @ xi - offsets
    worst = beyond.max()
    if worst <= 0:
        return xi.copy(), np.zeros(len(offsets), bool)
    G = -normals if M is None else -np.linalg.solve(np.linalg.cholesky(M), normals.T).T
    rows = np.column_stack([G, beyond / worst])
    rows /= np.linalg.norm(rows, axis=1)[:, None]
    weights = nonnegative_least_squares(rows.T)
    active = weights > 0
    # The active faces are known: the nearest point of their intersection, to full accuracy.
    step = np.linalg.lstsq(G[active], beyond[active], rcond=None)[0]
    y = xi + (step if M is None else np.linalg.solve(np.linalg.cholesky(M).T, step))
    left = float((normals @ y - offsets).max())
    if not left <= _HOLDS * max(worst, float(np.abs(offsets).max())):
        raise ConvergenceError(
            "projection onto a polytope",
            f"the distance of the result from the set is still {left:.3g}",
        )
    return y, active


def onto_span(rows: Array) -> Array:
    """The orthogonal projection onto the span of vectors, shape (k, n), as a matrix."""
    if not len(rows):
        return np.zeros((rows.shape[1], rows.shape[1]))
    _, sizes, basis = np.linalg.svd(rows, full_matrices=False)
    basis = basis[sizes > EXACT_RANK * sizes.max(initial=0.0)]
    return basis.T @ basis


def nonnegative_least_squares(E: Array) -> Array:
    """The u ≥ 0 with the least |E u − (0, ..., 0, 1)|."""
    from scipy.optimize import nnls

    try:
        return nnls(E, np.append(np.zeros(len(E) - 1), 1.0), maxiter=30 * E.shape[1] + 100)[0]
    except RuntimeError as error:
        raise ConvergenceError(
            "projection onto a polytope", f"the active set did not converge ({error})"
        ) from None


def nearest_in_metric(
    project: Projection, xi: Array, M: Array, start: Array | None = None
) -> Array:
    """The point of a convex set nearest to ξ in a metric, from its Euclidean projection, to
    rounding.

    y is nearest if it is the projection of y − γM(y − ξ). That is solved by semismooth Newton
    steps; since M is positive definite, they converge quadratically from nearby even where the
    projection has a kink. They are globalised by the forward-backward envelope, a function with the
    same minimiser that every projected gradient step decreases: a Newton step is shortened until it
    decreases the envelope, and replaced by a projected gradient step if it never does
    (P. Patrinos, L. Stella and A. Bemporad, *Forward-backward truncated Newton methods for convex
    composite optimization*, 2014).

    Parameters
    ----------
    project : callable
        Point of shape (n,) -> its projection, and a generalised derivative of that, shape (n, n).
    xi : ndarray of shape (n,)
    M : ndarray of shape (n, n)
    start : ndarray of shape (n,), optional
        By default the Euclidean projection of ξ.

    Raises
    ------
    ConvergenceError
        If the residual stays above 1e-11 times the size of ξ and y.
    """
    step = _DAMPED / float(np.linalg.eigvalsh(M)[-1])
    identity = np.eye(len(xi))

    def at(y: Array) -> Iterate:
        # A projected gradient step of ½⟨M(y − ξ), y − ξ⟩. The envelope is the least value on the
        # set of the linear model plus |rest|²/(2γ).
        pull = M @ (y - xi)
        image, slope = project(y - step * pull)
        rest = image - y
        envelope = (
            0.5 * float(pull @ (y - xi)) + float(pull @ rest) + 0.5 * float(rest @ rest) / step
        )
        return Iterate(y, image, slope, float(np.linalg.norm(rest)), envelope)

    now = at(project(xi)[0] if start is None else start)
    best = now
    idle = 0
    for _ in range(_MOST_NEWTON):
        size = float(np.linalg.norm(xi)) + float(np.linalg.norm(now.image))
        if now.residual <= _LEAST_RESIDUAL * size or idle >= _MOST_IDLE:
            break
        # The derivative of y − P(y − γM(y − ξ)), P′ a generalised one.
        newton = np.linalg.solve(identity - now.slope @ (identity - step * M), now.image - now.y)
        share = 1.0
        ahead = at(now.y + newton)
        while (
            not (ahead.residual <= 0.5 * now.residual or ahead.envelope < now.envelope)
            and share > _SHORTEST_SHARE
        ):
            share *= 0.5
            ahead = at(now.y + share * newton)
        if not (ahead.residual < now.residual or ahead.envelope < now.envelope):
            ahead = at(now.image)
        idle = 0 if ahead.residual < 0.9 * best.residual else idle + 1
        now = ahead
        best = min(best, ahead, key=lambda iterate: iterate.residual)
    if not best.residual <= _ENOUGH * (
        float(np.linalg.norm(xi)) + float(np.linalg.norm(best.image))
    ):
        raise ConvergenceError(
            "projection in a metric",
            f"the residual stays at {best.residual:.3g} for a force of "
            f"{float(np.linalg.norm(xi)):.3g}",
            "The metric is too ill-conditioned",
        )
    return best.image


class Iterate(NamedTuple):
    """A point, the projection of its gradient step with its derivative, their distance, and the
    envelope."""

    y: Array
    image: Array
    slope: Array
    residual: float
    envelope: float


def slope_by_differences(
    project: Callable[[Array], Array], x: Array, image: Array, h: float
) -> Array:
    """Derivative of a projection, column by column."""
    return np.column_stack([(project(x + shift) - image) / h for shift in h * np.eye(len(x))])


def nearest_by_support(
    dissipation: Dissipation,
    xi: Array,
    s: float,
    M: Array | None,
    known: list[Array] | None = None,
    accuracy: float = 0.0,
    sure: float = 1e-9,
) -> Array:
    """The point of K(s) nearest to ξ, by the support function alone (fully corrective Frank-Wolfe):
    the nearest point y of the hull of known points, to which the one exposed by d is added.

    With d = M(ξ − y), the duality gap bounds the error: |y − y*|²_M ≤ Ψ(s, d) − ⟨d, y⟩.

    Parameters
    ----------
    known : list of ndarray, optional
        Points of K(s) to start from; those that are found are added.
    accuracy : float
        Accepted relative error of the distance; by default as small as possible.
    sure : float
        Largest error of the distance, as a multiple of the size of K(s).

    Raises
    ------
    ConvergenceError
        If the distance is not that accurate.
    """
    points = [] if known is None else known
    if not points:
        points.append(dissipation.exposed(xi, s))
    best = points[0]
    least = np.inf
    for _ in range(300):
        table = np.array(points)
        y = nearest_in_hull(table, xi, M)
        size = float(np.abs(table).max() + np.abs(xi).max()) or 1.0
        d = xi - y if M is None else M @ (xi - y)
        far = float(np.linalg.norm(xi - y)) / size
        if far <= FEW_ROUNDINGS:
            return y
        ahead = dissipation.exposed(d, s)
        gap = (dissipation.support(d, s) - float(d @ y)) / (float(np.linalg.norm(d)) * size)
        if min(gap, far) < least:
            best = y
            least = min(gap, far)
        if (
            gap <= max(LAST_DIGITS, accuracy * far)
            or (np.abs(table - ahead).max(axis=1) <= LAST_DIGITS * size).any()
        ):
            break
        points.append(ahead)
    if not least <= max(sure, accuracy):
        raise ConvergenceError(
            "projection by a support function",
            f"the accuracy of the distance is only {least:.3g} of the size of K(s)",
            "Give the subgradient of the function",
        )
    return best


def onto_balls(x: Array, radii: Array, size: int) -> tuple[Array, Array]:
    """The projection onto a product of balls in R^size, and a generalised derivative of it."""
    groups = x.reshape(-1, size)
    norms = lengths(groups)
    outside = norms > radii
    share = np.divide(radii, norms, out=np.ones_like(norms), where=outside)
    along = np.where(outside[:, None], groups, 0.0) / np.where(norms > 0.0, norms, 1.0)[:, None]
    slope = np.zeros((len(norms), size, len(norms), size))
    index = np.arange(len(norms))
    slope[index, :, index, :] = share[:, None, None] * (
        np.eye(size) - along[:, :, None] * along[:, None, :]
    )
    return (share[:, None] * groups).ravel(), slope.reshape(len(x), len(x))
