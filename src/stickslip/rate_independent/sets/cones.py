"""Convex sets as images of cones, and the programs whose constraints they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from itertools import pairwise
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import ConvergenceError, need
from stickslip.numerics.levels import FEASIBLE

_TIGHTEST = 1e-13  # tolerance of an interior-point method, limited by rounding errors
_NONNEGATIVE = "nonnegative"
_SECOND_ORDER = "second order"


@dataclass(frozen=True, eq=False)
class ConeForm:
    """The set {image y : offset − matrix y ∈ cones}.

    Attributes
    ----------
    matrix : ndarray of shape (m, k)
    offset : ndarray of shape (m,)
    cones : tuple of (str, int)
        Kind and size of each cone; the sizes add up to m.
    image : ndarray of shape (n, k), optional
        By default the identity.
    """

    matrix: Array
    offset: Array
    cones: tuple[tuple[str, int], ...]
    image: Array | None = None

    def scaled(self, factor: float) -> ConeForm:
        """The set times a positive factor."""
        if self.image is None:
            return replace(self, offset=self.offset * factor)
        return replace(self, image=self.image * factor)


def polyhedron(normals: Array, offsets: Array) -> ConeForm:
    """{ξ : normals ξ ≤ offsets}."""
    return ConeForm(normals, offsets, ((_NONNEGATIVE, len(offsets)),))


def hull(vertices: Array) -> ConeForm:
    """Convex hull of the rows of `vertices` and of 0."""
    k = len(vertices)
    matrix = np.vstack([-np.eye(k), np.ones((1, k))])
    return ConeForm(matrix, np.append(np.zeros(k), 1.0), ((_NONNEGATIVE, k + 1),), vertices.T)


def balls(radii: Array, size: int) -> ConeForm:
    """Product of balls in R^size."""
    matrix = np.zeros((len(radii), size + 1, len(radii), size))
    offset = np.zeros((len(radii), size + 1))
    for g in range(len(radii)):
        matrix[g, 1:, g] = -np.eye(size)
    offset[:, 0] = radii
    return ConeForm(
        matrix.reshape(len(radii) * (size + 1), -1),
        offset.ravel(),
        ((_SECOND_ORDER, size + 1),) * len(radii),
    )


def ellipsoid(root: Array) -> ConeForm:
    """{root y : |y| ≤ 1}."""
    unit = balls(np.ones(1), root.shape[1])
    return replace(unit, image=root)


def product_of_cones(forms: Sequence[ConeForm], dimensions: Sequence[int]) -> ConeForm:
    """Product of sets."""
    from scipy.linalg import block_diag

    image = None
    if any(form.image is not None for form in forms):
        images = [
            np.eye(n) if f.image is None else f.image
            for f, n in zip(forms, dimensions, strict=True)
        ]
        image = np.asarray(block_diag(*images))
    return ConeForm(
        np.asarray(block_diag(*(form.matrix for form in forms))),
        np.concatenate([form.offset for form in forms]),
        tuple(cone for form in forms for cone in form.cones),
        image,
    )


def solve_cones(forms: Sequence[ConeForm], c: Array, Q: Array | None = None) -> tuple[Array, Array]:
    """The ξ in all sets that minimises ½⟨Qξ, ξ⟩ − ⟨c, ξ⟩, and its multipliers.

    Linear programs are solved by the simplex method of HiGHS, all others by the interior-point
    method of Clarabel.

    Parameters
    ----------
    forms : sequence of ConeForm
        The sets, each of a size of order 1.
    c : ndarray of shape (n,)
    Q : ndarray of shape (n, n), optional
        Symmetric and positive semidefinite; 0 by default.

    Returns
    -------
    xi : ndarray of shape (n,)
    motions : ndarray of shape (len(forms), n)
        Multipliers v_i of the constraints: normal to their sets at ξ, with the sum c − Qξ. For Q =
        0 they are the motion of least cost Σ Ψ_i(v_i) with the sum c.

    Raises
    ------
    ConvergenceError
        If no solution is found.
    """
    linear = Q is None and all(kind == _NONNEGATIVE for form in forms for kind, _ in form.cones)
    n = len(c)
    # ξ, then the y of each set that is an image.
    ends = np.cumsum([n, *(0 if f.image is None else f.image.shape[1] for f in forms)])
    equal = []
    conic = []
    offsets = []
    for form, (start, end) in zip(forms, pairwise(ends), strict=True):
        row = np.zeros((len(form.offset), ends[-1]))
        if form.image is None:
            row[:, :n] = form.matrix
        else:
            row[:, start:end] = form.matrix
            tie = np.zeros((n, ends[-1]))
            tie[:, :n] = np.eye(n)
            tie[:, start:end] = -form.image
            equal.append(tie)
        conic.append(row)
        offsets.append(form.offset)
    ties = np.vstack(equal) if equal else np.zeros((0, ends[-1]))
    cost = np.concatenate([c, np.zeros(ends[-1] - n)])
    if linear:
        x, tension, pressure = _simplex(cost, ties, np.vstack(conic), np.concatenate(offsets))
    else:
        curvature = np.zeros((ends[-1], ends[-1]))
        if Q is not None:
            curvature[:n, :n] = Q
        cones = [cone for form in forms for cone in form.cones]
        x, tension, pressure = _interior_point(
            cost, curvature, ties, np.vstack(conic), np.concatenate(offsets), cones
        )
    motions = []
    tied = 0
    pressed = 0
    for form in forms:
        if form.image is None:
            motions.append(form.matrix.T @ pressure[pressed : pressed + len(form.offset)])
        else:
            motions.append(tension[tied : tied + n])
            tied += n
        pressed += len(form.offset)
    return x[:n], np.array(motions)


def _simplex(c: Array, ties: Array, rows: Array, offsets: Array) -> tuple[Array, Array, Array]:
    from scipy.optimize import linprog

    tight = {"primal_feasibility_tolerance": FEASIBLE, "dual_feasibility_tolerance": FEASIBLE}
    result = linprog(
        -c,
        A_ub=rows,
        b_ub=offsets,
        A_eq=ties if len(ties) else None,
        b_eq=np.zeros(len(ties)) if len(ties) else None,
        bounds=(None, None),
        method="highs-ds",
        options=tight,
    )
    if result.status != 0:
        raise ConvergenceError("linear program", f"HiGHS found no solution ({result.message})")
    return result.x, -result.eqlin.marginals, -result.ineqlin.marginals


def _interior_point(
    c: Array, Q: Array, ties: Array, rows: Array, offsets: Array, cones: Sequence[tuple[str, int]]
) -> tuple[Array, Array, Array]:
    from scipy.sparse import csc_matrix, triu

    need("clarabel", "evolutions")
    clarabel: Any = import_module("clarabel")  # compiled, without types
    kinds = {_NONNEGATIVE: clarabel.NonnegativeConeT, _SECOND_ORDER: clarabel.SecondOrderConeT}
    zero = [clarabel.ZeroConeT(len(ties))] if len(ties) else []
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    # To the attainable accuracy: the caller checks the result.
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = _TIGHTEST
    solver = clarabel.DefaultSolver(
        csc_matrix(triu(Q)),
        -c,
        csc_matrix(np.vstack([ties, rows])),
        np.concatenate([np.zeros(len(ties)), offsets]),
        [*zero, *(kinds[kind](size) for kind, size in cones)],
        settings,
    )
    solution = solver.solve()
    x, z = np.array(solution.x), np.array(solution.z)
    if not (np.isfinite(x).all() and np.isfinite(z).all()) or "Infeasible" in str(solution.status):
        raise ConvergenceError("cone program", f"Clarabel found no solution ({solution.status})")
    return x, z[: len(ties)], z[len(ties) :]
