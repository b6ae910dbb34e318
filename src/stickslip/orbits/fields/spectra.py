"""Eigenvalues of the Jacobians of first variations, where these are the same at all states."""

from __future__ import annotations

import numpy as np

from stickslip.arrays import AnyArray, Array
from stickslip.numerics.levels import LEFT_OUT, ZERO_EIGENVALUE
from stickslip.orbits.fields.engine.tables import DECOMPOSED, DEFECTIVE, Spectra

_CONDITION = 1e4  # of eigenvectors, in whatever units, from which on they are nearly dependent
_ROUNDING = 1e-11  # part of an eigenvalue that may be rounding


def decompose_piece(spectra: Spectra, w: int, rates: Array, held: Array) -> None:
    """Decompose the Jacobian of a piece; where its eigenvectors are nearly dependent, it is marked
    as useless.

    Parameters
    ----------
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
    if not _decomposed(spectra, w, A, rates) and len(held):
        _decomposed(spectra, w, A - spectra.rate[w] * np.linalg.pinv(held) @ held, rates)


def _decomposed(spectra: Spectra, w: int, A: Array, rates: Array) -> bool:
    """Put eigenvalues and eigenvectors of a matrix into the spectra of a piece, if they are
    sound."""
    values: AnyArray
    V: AnyArray
    values, V = np.linalg.eig(A)
    try:
        L: AnyArray = np.linalg.inv(V)
    except np.linalg.LinAlgError:
        return False
    # The sum of |L| |V| is a condition of each eigenvalue that no choice of units changes.
    dependence = np.einsum("bi,ib->b", np.abs(L), np.abs(V))
    if not np.all(np.isfinite(L)) or np.max(dependence) > _CONDITION:
        return False
    error = np.finfo(float).eps * np.einsum("bi,ij,jb->b", np.abs(L), np.abs(A), np.abs(V))
    size = np.abs(values)
    values = np.where(size > ZERO_EIGENVALUE * np.max(size), values, 0.0)
    if np.any(error > _ROUNDING * np.abs(values), where=values != 0.0):
        return False
    # Where eigenvectors are missing (a place and its velocity, both constant), those of two
    # eigenvalues near 0 are not enough: what is left out with these is seen in units in which a
    # velocity is as large as its place for the fastest mode.
    unit = np.where(rates, np.max(size), 1.0)
    gone = (np.abs(V) * np.where(values == 0.0, size, 0.0)) @ np.abs(L)
    if np.any(gone * unit > LEFT_OUT * np.max(size) * unit[:, None]):
        return False
    kept = np.flatnonzero(values.imag >= 0.0)
    twice = np.where(values[kept].imag > 0.0, 2.0, 1.0)
    count = len(kept)
    spectra.blocks[w] = count
    spectra.exponent[w, :count] = values[kept]
    right = V[:, kept] * twice
    spectra.right[w, 0, :, :count] = right.real
    spectra.right[w, 1, :, :count] = right.imag
    spectra.left[w, 0, :count] = L[kept].real
    spectra.left[w, 1, :count] = L[kept].imag
    spectra.state[w] = DECOMPOSED
    return True
