"""What is measured of an equilibrium before it is called one.

It solves the equations, it lies inside its mode and region, and its eigenvalues are known to a
bound: those of the exact Jacobian are within it of those that were computed, by the theorems of
Bauer and Fike and of Elsner.

References
----------
G. W. Stewart, J. Sun, *Matrix Perturbation Theory*, theorems IV.1.3 (Elsner) and IV.3.3
(Bauer-Fike).
"""

from __future__ import annotations

import numpy as np

from stickslip.certificates import Certificate, Residual
from stickslip.orbits.equilibria.stick_sets import Conditions
from stickslip.orbits.fields.steady import Array, Steady

SOLVED = 1e-12  # what is left of the equations, relative to their terms
ON_BOUNDARY = 1e-9  # a guard this small, relative to its terms, is zero
_SMALL = 1e-3  # unknowns count with at least this part of the largest
_KNOWN = 1e-4  # eigenvalues are known to this part of the terms of the Jacobian
_NEARBY = 1e-7  # over this part of the state the change of the Jacobian is seen
_ROUNDING = 8.0 * np.finfo(float).eps


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
        What is said of the guard with the least value.
    beside : array, optional
        Another point of the same branch: what is large there is known no better here.

    Returns
    -------
    Certificate
    float
        By how much the eigenvalues may be wrong.
    """
    sizes = steady.sizes(
        point[:, None], None if beside is None else np.column_stack([point, beside])
    )
    margin = float(np.min(sizes.margins[0], initial=1.0))
    error, terms = eigenvalue_error(steady, point, sizes.state[0])
    residuals = (
        Residual("equations", float(sizes.defect[0]), SOLVED, note="of their terms"),
        Residual("nearest guard", margin, -ON_BOUNDARY, least=True, note=nearest),
        Residual(
            "eigenvalues",
            error / terms if terms > 0.0 else error,
            _KNOWN,
            note="of the Jacobian's terms",
        ),
    )
    return Certificate(residuals), error


def eigenvalue_error(steady: Steady, point: Array, sizes: Array) -> tuple[float, float]:
    """By how much the eigenvalues at an equilibrium may be wrong, and how large the terms of the
    Jacobian are.

    The Jacobian is known to the rounding of its terms: its own size, and what it changes by with
    the state.
    """
    J = steady.linearisation(point)
    if not J.size:
        return 0.0, 0.0
    terms = float(np.linalg.norm(J))
    for i, size in enumerate(sizes):
        moved = point.copy()
        moved[i] += _NEARBY * size
        if moved[i] > point[i]:
            terms += (
                float(np.linalg.norm(steady.linearisation(moved) - J))
                / (moved[i] - point[i])
                * size
            )
    error = _ROUNDING * terms
    n = len(J)
    # Bauer and Fike's bound is useless near a defective matrix, Elsner's for large n (R. Bhatia,
    # *Matrix Analysis*, 1997, chapter VIII).
    bauer_fike = np.linalg.cond(np.linalg.eig(J)[1]) * error
    elsner = (2.0 * np.linalg.norm(J, 2) + error) ** (1.0 - 1.0 / n) * error ** (1.0 / n)
    return min(
        (float(b) for b in (bauer_fike, elsner) if np.isfinite(b)), default=float("inf")
    ), terms


def certify_set(conditions: Conditions, centre: Array) -> Certificate:
    """Measure the point well inside a set of equilibria."""
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
