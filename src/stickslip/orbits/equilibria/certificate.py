"""The certificate of an equilibrium.

The equations are solved, the guards of its mode and region hold, and the eigenvalues have an error
bound: those of the exact Jacobian differ from the computed ones by at most this bound, by the
theorems of Bauer and Fike and of Elsner.

References
----------
G. W. Stewart, J. Sun, *Matrix Perturbation Theory*, theorems IV.1.3 (Elsner) and IV.3.3
(Bauer-Fike).
"""

from __future__ import annotations

import numpy as np

from stickslip.certificates import Certificate, Residual
from stickslip.numerics.levels import SUM_ROUNDING
from stickslip.orbits.equilibria.stick_sets import Conditions
from stickslip.orbits.fields.steady import Array, Steady

SOLVED = 1e-12  # residual of the equations relative to their terms
ON_BOUNDARY = 1e-9  # a guard this small, relative to its terms, is zero
_SMALL = 1e-3  # smallest size of an unknown relative to the largest
_KNOWN = 1e-4  # error of eigenvalues relative to the terms of the Jacobian
_NEARBY = 1e-7  # fraction of the state over which the change of the Jacobian is measured


def certify_equilibrium(
    steady: Steady, point: Array, nearest: str = "", beside: Array | None = None
) -> tuple[Certificate, float]:
    """Measure an isolated equilibrium.

    Parameters
    ----------
    steady : Steady
        The problem that it solves.
    point : array
        State and parameters.
    nearest : str
        Description of the guard with the smallest value.
    beside : array, optional
        Another point of the same branch; terms that are large there increase the rounding errors
        here.

    Returns
    -------
    Certificate
    float
        Error bound of the eigenvalues.
    """
    other = point if beside is None else beside
    return certify_equilibria(steady, point[:, None], other[:, None], nearest)[0]


def certify_equilibria(
    steady: Steady, points: Array, beside: Array, nearest: str = ""
) -> list[tuple[Certificate, float]]:
    """Measure many equilibria of one mode; see :func:`certify_equilibrium`.

    Parameters
    ----------
    points, beside : array, shape (states + parameters, points)
    """
    sizes = steady.sizes_beside(points, beside)
    margins = np.min(sizes.margins, axis=1, initial=1.0)
    errors, terms = eigenvalue_errors(steady, points, sizes.state)
    parts = np.where(terms > 0.0, errors / np.where(terms > 0.0, terms, 1.0), errors)
    return [
        (
            Certificate(
                (
                    Residual("equations", float(defect), SOLVED, note="of their terms"),
                    Residual(
                        "nearest guard", float(margin), -ON_BOUNDARY, least=True, note=nearest
                    ),
                    Residual("eigenvalues", float(part), _KNOWN, note="of the Jacobian's terms"),
                )
            ),
            float(error),
        )
        for defect, margin, part, error in zip(sizes.defect, margins, parts, errors, strict=True)
    ]


def eigenvalue_errors(steady: Steady, points: Array, sizes: Array) -> tuple[Array, Array]:
    """Error bounds of the eigenvalues at equilibria, and sizes of the terms of the Jacobians,
    shapes (points,).

    A Jacobian is accurate up to the rounding of its terms, and its change over the rounding of the
    state.
    """
    n = sizes.shape[1]
    count = points.shape[1]
    moved = np.repeat(points[:, :, None], 1 + n, axis=2)
    for i in range(n):
        moved[i, :, 1 + i] += _NEARBY * sizes[:, i]
    found = steady.linearisations(moved.reshape(len(points), -1))
    J = found.reshape(count, 1 + n, *found.shape[1:])
    m = J.shape[-1]
    if m == 0:
        return np.zeros(count), np.zeros(count)
    norms = np.linalg.norm(J - J[:, :1], axis=(2, 3))
    terms = np.linalg.norm(J[:, 0], axis=(1, 2))
    for i in range(n):
        change = moved[i, :, 1 + i] - points[i]
        # Differences estimate |∂A/∂yᵢ|; times the size of yᵢ, the effect of its rounding error.
        terms += (
            np.where(change > 0.0, norms[:, 1 + i] / np.where(change > 0.0, change, 1.0), 0.0)
            * (sizes[:, i])
        )
    error = SUM_ROUNDING * terms
    # Bauer and Fike's bound is useless near a defective matrix, Elsner's for large n (R. Bhatia,
    # *Matrix Analysis*, 1997, chapter VIII).
    with np.errstate(all="ignore"):
        bauer_fike = np.linalg.cond(np.linalg.eig(J[:, 0])[1]) * error
        spectral = np.linalg.norm(J[:, 0], 2, axis=(1, 2))
        elsner = (2.0 * spectral + error) ** (1.0 - 1.0 / m) * error ** (1.0 / m)
    bounds = np.array([bauer_fike, elsner])
    return np.min(np.where(np.isfinite(bounds), bounds, np.inf), axis=0), terms


def certify_set(conditions: Conditions, centre: Array) -> Certificate:
    """Measure the interior point of a set of equilibria."""
    largest = np.max(np.abs(centre), initial=0.0)
    sizes = np.maximum(np.abs(centre), _SMALL * largest) if largest > 0.0 else np.ones(len(centre))
    equations, guards = (
        _relative(part(centre), sizes) for part in (conditions.equations, conditions.guards)
    )
    return Certificate(
        (
            Residual(
                "equations",
                float(np.max(np.abs(equations), initial=0.0)),
                SOLVED,
                note="of their terms",
            ),
            Residual(
                "nearest guard",
                float(np.min(guards, initial=1.0)),
                -ON_BOUNDARY,
                least=True,
                note="inside",
            ),
        )
    )


def _relative(found: tuple[Array, Array], sizes: Array) -> Array:
    """Values relative to the terms that they are made of."""
    value, slopes = found
    terms = np.abs(slopes) @ sizes + np.abs(value)
    return value / np.where(terms > 0.0, terms, 1.0)
