"""Newton's method for a point of a curve F(x) = 0: in a plane across the curve, or at a given value
of one unknown."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import StickslipError

_MANY = 64  # number of unknowns from which on a Jacobian costs more than several residuals
# a Jacobian is kept as long as steps with it shrink at least by this factor; the last one may leave
# an error of the second, relative to the tolerance
_CHORD, _REMAINS = 0.1, 1e-2
_SHRINKS = 0.1  # once it has converged, steps that shrink less than this are rounding errors
FunctionAndJacobian = Callable[[Array], tuple[Array, Array]]
NOT_DEFINED = (ArithmeticError, StickslipError, np.linalg.LinAlgError)
"""What the equations may raise where they are not defined; the step is then shortened."""


@runtime_checkable
class CostlyJacobian(Protocol):
    """Equations whose residual alone costs a fraction of the Jacobian.

    Attributes
    ----------
    latest : array, shape (n − 1, n), or None
        The Jacobian that was computed last.
    """

    latest: Array | None

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """F(x) and its Jacobian."""
        ...

    def residual(self, x: Array) -> Array:
        """F(x)."""
        ...


class Lost(Exception):
    """The corrector does not converge; the message gives the reason."""


def correct(
    equations: FunctionAndJacobian,
    guess: Array,
    scale: Array,
    tangent: Array,
    tolerance: float,
    start: Array | None = None,
    rounding: float = 0.0,
    left: float = math.inf,
) -> Array:
    """Newton's method on F(x) = 0 and ⟨tangent, (x − guess)/scale⟩ = 0.

    Parameters
    ----------
    equations : callable
        x ↦ F(x) and its Jacobian, shapes (n − 1,) and (n − 1, n).
    guess, scale, tangent : array, shape (n,)
        Where to start, units of the unknowns, and a direction in these units.
    tolerance : float
        Of the last step, in the norm of these units.
    start : array, shape (n,), optional
        Where to start, if that is known better.
    rounding : float
        A step that would be shorter than this is not taken: the equations are known where it
        starts.
    left : float
        Steps are taken as long as they shrink and the norm of F is larger than this: near a
        singularity a short step may leave much.

    Returns
    -------
    array, shape (n,)

    Raises
    ------
    Lost
        If it does not converge.
    """
    x = guess if start is None else start
    if isinstance(equations, CostlyJacobian) and len(guess) >= _MANY:
        found = _by_chords(equations, guess, scale, tangent, tolerance, x)
        if found is not None and (left == math.inf or length_of(equations.residual(found)) <= left):
            return found
    settled = None
    matrix = np.empty((len(guess), len(guess)))
    matrix[-1] = tangent
    right = np.empty(len(guess))
    last = np.inf
    for _ in range(12):
        try:
            # The last equation keeps the step in the plane through the guess across the tangent.
            right[:-1], J = equations(x)
            np.multiply(J, scale, out=matrix[:-1])
            right[-1] = tangent @ ((x - guess) / scale)
            if settled is not None and length_of(right[:-1]) <= left:
                return settled
            dz = np.linalg.solve(matrix, right)
        except NOT_DEFINED as problem:
            if settled is not None:
                return settled
            raise Lost(str(problem)) from None
        size = length_of(dz)
        if size <= rounding:
            return x
        if not size <= (2.0 if settled is None else _SHRINKS) * last:
            break
        x = x - scale * dz
        last = size
        if size <= tolerance:
            if left == math.inf:
                return x
            settled = x
    if settled is not None:
        return settled
    raise Lost("Newton's method does not converge")


def _by_chords(
    equations: CostlyJacobian,
    guess: Array,
    scale: Array,
    tangent: Array,
    tolerance: float,
    x: Array,
) -> Array | None:
    """The same with few Jacobians: the latest one, and another where steps with it do not shrink
    fast. None if it does not converge so.

    Parameters
    ----------
    x : array, shape (n,)
        The start.
    """
    from scipy.linalg import lu_factor, lu_solve

    right = np.empty(len(guess))
    J, last = equations.latest, np.inf
    fresh = J is None
    factors: Any = None
    try:
        for _ in range(12):
            if factors is None:
                J = equations(x)[1] if J is None else J
                factors = lu_factor(np.vstack([J * scale, tangent]), check_finite=False)
            right[:-1] = equations.residual(x)
            right[-1] = tangent @ ((x - guess) / scale)
            dz = np.asarray(lu_solve(factors, right, check_finite=False))
            size = length_of(dz)
            shrinks = size / last if last < np.inf else 1.0
            if not size <= 1.0 or (last < np.inf and shrinks > _CHORD):
                if fresh:
                    return None
                J, factors, last, fresh = None, None, np.inf, True
                continue
            x = x - scale * dz
            # The error that remains is about as small in proportion.
            if size * shrinks <= _REMAINS * tolerance:
                return x
            last = size
    except NOT_DEFINED:
        pass
    return None


def correct_at(
    equations: FunctionAndJacobian,
    guess: Array,
    scale: Array,
    component: int,
    value: float,
    tolerance: float,
) -> Array:
    """Newton's method on F(x) = 0 with one component of x at a given value, exactly.

    Parameters
    ----------
    equations : callable
        x ↦ F(x) and its Jacobian, shapes (n − 1,) and (n − 1, n).
    guess, scale : array, shape (n,)
        Where to start, and units of the unknowns.
    value : float
        What this component is.
    tolerance : float
        Of the last step, in the norm of these units.

    Returns
    -------
    array, shape (n,)

    Raises
    ------
    Lost
        If it does not converge.
    """

    def kept(x: Array) -> Array:
        x = x.copy()
        x[component] = value
        return x

    along = np.zeros(len(guess))
    along[component] = 1.0
    return kept(correct(lambda x: equations(kept(x)), kept(guess), scale, along, tolerance))


def length_of(v: Array) -> float:
    """Euclidean length."""
    return math.sqrt(v @ v)
