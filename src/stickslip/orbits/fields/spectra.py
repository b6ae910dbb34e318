"""Eigenvalues of constant Jacobians of first variations."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stickslip.arrays import AnyArray, Array
from stickslip.equations.derive import MotionEquations
from stickslip.kept import made_once
from stickslip.numerics.levels import LEFT_OUT, ZERO_EIGENVALUE
from stickslip.orbits.fields.engine.tables import DECOMPOSED, DEFECTIVE, Spectra

_CONDITION = 1e4  # condition of eigenvectors, in any units, above which they are nearly dependent
_ROUNDING = 1e-11  # relative rounding error of an eigenvalue
_MOST = 256  # number of decomposed matrices of a system that are kept
_ROOM = 2**26  # approximate number of bytes for them


class _Modes(NamedTuple):
    """Eigenvalues without the conjugates, with V and L as in :class:`Spectra`."""

    exponent: AnyArray
    right: AnyArray
    left: AnyArray


def decompose_piece(
    equations: MotionEquations, spectra: Spectra, w: int, rates: Array, held: Array
) -> None:
    """Decompose the Jacobian of a piece; if its eigenvectors are nearly dependent, mark it as
    unusable.

    Parameters
    ----------
    equations : MotionEquations
        Of the system. What has been decomposed is kept with them.
    spectra : Spectra
        Receives the result.
    w : int
        The piece.
    rates : array of bool, shape (n,)
        Which components are rates of others.
    held : array, shape (rows, n)
        Linear forms that are zero all the time, of states and of their changes. Where eigenvectors
        are missing (a place and its velocity, both constant), these forms decay instead.
    """
    spectra.state[w] = DEFECTIVE
    spectra.sloped[w] = 0
    A = spectra.matrix[w]
    found = _known(equations, A, rates)
    if found is None and len(held):
        damped = A - spectra.rate[w] * np.linalg.pinv(held) @ held
        found = _known(equations, damped, rates)
    if found is None:
        return
    count = len(found.exponent)
    spectra.blocks[w] = count
    spectra.exponent[w, :count] = found.exponent
    spectra.right[w, 0, :, :count] = found.right.real
    spectra.right[w, 1, :, :count] = found.right.imag
    spectra.left[w, 0, :count] = found.left.real
    spectra.left[w, 1, :count] = found.left.imag
    spectra.state[w] = DECOMPOSED


def _known(equations: MotionEquations, A: Array, rates: Array) -> _Modes | None:
    """The modes of a matrix, cached over motions, since those of a piece do not depend on its
    drives."""
    most = min(max(_ROOM // (24 * A.size), 1), _MOST)
    key = A.tobytes(), rates.tobytes()
    return made_once(equations, "modes", lambda: _decomposed(A, rates), key, most)


def _decomposed(A: Array, rates: Array) -> _Modes | None:
    """Eigenvalues and eigenvectors of a matrix, if they are sound."""
    values: AnyArray
    V: AnyArray
    values, V = np.linalg.eig(A)
    try:
        L: AnyArray = np.linalg.inv(V)
    except np.linalg.LinAlgError:
        return None
    # The sum of |L| |V| is a condition of each eigenvalue that no choice of units changes.
    dependence = np.einsum("bi,ib->b", np.abs(L), np.abs(V))
    if not np.all(np.isfinite(L)) or np.max(dependence) > _CONDITION:
        return None
    made = np.abs(L) @ np.abs(A)
    error = np.finfo(float).eps * np.einsum("bj,jb->b", made, np.abs(V))
    size = np.abs(values)
    values = np.where(size > ZERO_EIGENVALUE * np.max(size), values, 0.0)
    if np.any(error > _ROUNDING * np.abs(values), where=values != 0.0):
        return None
    # If eigenvectors are missing (a position and its velocity, both constant), those of two
    # eigenvalues near 0 are not enough: the part omitted with these is measured in units in which a
    # velocity is as large as its position for the fastest mode.
    unit = np.where(rates, np.max(size), 1.0)
    gone = (np.abs(V) * np.where(values == 0.0, size, 0.0)) @ np.abs(L)
    if np.any(gone * unit > LEFT_OUT * np.max(size) * unit[:, None]):
        return None
    kept = np.flatnonzero(values.imag >= 0.0)
    twice = np.where(values[kept].imag > 0.0, 2.0, 1.0)
    return _Modes(values[kept], V[:, kept] * twice, L[kept])
