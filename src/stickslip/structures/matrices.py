"""Symmetric matrices, full or sparse: checks, factors, and the lowest of their frequencies."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import ConvergenceError, DeclarationError
from stickslip.numerics.levels import EXACT_RANK

Symmetric = Any
"""A matrix: an array, or a sparse one of SciPy in compressed columns."""

_ALIKE = 1e-9  # relative to the diagonal: asymmetry of files with nine digits that is accepted
_MOST_MEMORY = 2**30  # largest number of bytes of full matrices made from sparse ones
_COINCIDE = 1e-9  # gap between squared frequencies, relative to them, below which they coincide
_APART = 0.05  # distance of a shift below the lowest ω², relative to it
_SPREAD = 10.0  # multiple of the lowest ω² up to which the requested values lie if a shift pays
_FULL = 400  # number of unknowns below which full matrices are faster
# relative to the largest ratio of diagonals: makes a stiffness with rigid motions regular
_SHIFT = 1e-10


def is_sparse(matrix: Symmetric) -> bool:
    """Whether it is one of SciPy's."""
    return not isinstance(matrix, np.ndarray)


def dense(matrix: Symmetric) -> Array:
    """The matrix as an array.

    Raises
    ------
    DeclarationError
        If that would not fit into memory with its factors.
    """
    if not is_sparse(matrix):
        return matrix
    n = matrix.shape[0]
    check_memory(n)
    return matrix.toarray()


def check_memory(n: int) -> None:
    """Reject to treat a large sparse structure as full."""
    needed = 4 * 8 * n * n  # mass, stiffness, and the work space of LAPACK
    if needed > _MOST_MEMORY:
        raise DeclarationError(
            "structure",
            f"all modes of {n:,} degrees of freedom need full matrices, {_bytes(needed)} of memory",
            "Reduce it: structure.reduced(keep=[...], modes=20)",
        )


def _bytes(count: float) -> str:
    power = min(int(np.log10(count) / 3.0), 4)
    return f"{count / 1000.0**power:.3g} {('B', 'kB', 'MB', 'GB', 'TB')[power]}"


def checked_symmetric(given: Any, what: str, said: Callable[[int], str]) -> Symmetric:
    """A symmetric matrix of finite numbers, read-only.

    Parameters
    ----------
    what : str
        Name in error messages.
    said : callable
        What an unknown is called, by its index.

    Raises
    ------
    DeclarationError
        If it is something else.
    """
    if hasattr(given, "toarray") and hasattr(given, "tocoo"):
        matrix = given.tocsc(copy=True)
        matrix.sum_duplicates()
        values = matrix.data
    else:
        try:
            matrix = values = np.array(given)
        except ValueError:
            raise DeclarationError(
                what, "its rows have different lengths", "Give a square matrix"
            ) from None
    if values.dtype.kind == "c":
        raise DeclarationError(
            what,
            "the matrix is complex",
            "Give real matrices; replace a loss factor by ModalDamping(factor/2)",
        )
    if values.dtype.kind not in "fiu":
        raise DeclarationError(what, "its entries are not all numbers", "Give numbers")
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not matrix.shape[0]:
        shape = " x ".join(map(str, matrix.shape)) or "a number"
        raise DeclarationError(what, f"it is {shape}, not a square matrix", "Give a square matrix")
    if not np.all(np.isfinite(values)):
        i, j = _where(matrix, lambda part: ~np.isfinite(part))
        raise DeclarationError(
            what, f"its entry [{i}, {j}] is {matrix[i, j]}", "Give finite numbers"
        )
    matrix = matrix.astype(float)
    matrix = _symmetric(matrix, what, said)
    for part in (
        (matrix,)
        if not is_sparse(matrix)
        else (
            matrix.data,
            matrix.indices,
            matrix.indptr,
        )
    ):
        part.flags.writeable = False
    return matrix


def _where(matrix: Symmetric, chosen: Callable[[Array], Array]) -> tuple[int, int]:
    """The first entry for which something holds."""
    if not is_sparse(matrix):
        return cast("tuple[int, int]", tuple(map(int, np.argwhere(chosen(matrix))[0])))
    entries = matrix.tocoo()
    first = int(np.flatnonzero(chosen(entries.data))[0])
    return int(entries.row[first]), int(entries.col[first])


def _symmetric(matrix: Symmetric, what: str, said: Callable[[int], str]) -> Symmetric:
    """The mean of a matrix and its transpose, which differ by rounding at most."""
    other = matrix.T.tocsc() if is_sparse(matrix) else matrix.T
    apart = abs(matrix - other)
    largest = apart.max() if apart.shape[0] else 0.0
    if not largest:
        return matrix
    size = np.sqrt(np.abs(matrix.diagonal()))
    scale = abs(matrix).max()
    if is_sparse(matrix):
        entries = apart.tocoo()
        rows, columns, values = entries.row, entries.col, entries.data
    else:
        rows, columns = np.nonzero(apart)
        values = apart[rows, columns]
    bound = size[rows] * size[columns]
    parts = values / np.where(bound > 0.0, bound, scale)
    worst = int(np.argmax(parts))
    if parts[worst] > _ALIKE:
        i, j = sorted((int(rows[worst]), int(columns[worst])))
        raise DeclarationError(
            what,
            f"not symmetric: [{said(i)}, {said(j)}] is {matrix[i, j]:.9g}, [{said(j)}, "
            f"{said(i)}] is {matrix[j, i]:.9g}",
            "Give the full symmetric matrix; structures do not support gyroscopic and "
            "circulatory forces",
        )
    return (matrix + other) / 2.0


@dataclass(frozen=True)
class Factored:
    """A symmetric matrix, factored.

    Attributes
    ----------
    solve : callable
        From right-hand sides, shape (n,) or (n, k), to solutions; NaN of a sparse matrix that is
        not positive definite.
    negative : int
        How many of its eigenvalues are negative (Sylvester's law of inertia).
    least : float
        Its smallest pivot, as a part of the diagonal.
    blocks : array of int, optional
        Of a sparse one, the block of each unknown in the order of elimination; None of one in a
        narrow band, whose order is found at once.
    """

    solve: Callable[[Array], Array]
    negative: int
    least: float
    blocks: Array | None = None

    @property
    def singular(self) -> bool:
        """Whether it has an eigenvalue that is zero up to rounding."""
        return self.least < EXACT_RANK


def factored(matrix: Symmetric, solving: bool = True, blocks: Array | None = None) -> Factored:
    """Factored of a symmetric matrix, L D Lᵀ.

    Rows and columns are scaled to a unit diagonal first, since unknowns may have any units.

    Parameters
    ----------
    matrix : matrix, shape (n, n)
    solving : bool
        Whether there will be right-hand sides; without, a sparse one takes less memory.
    blocks : array of int, optional
        Those of a sparse matrix with entries at the same places.
    """
    diagonal = np.abs(matrix.diagonal())
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    if is_sparse(matrix):
        from scipy.sparse import diags_array

        from stickslip.structures.bands import factored_in_band, order_in_band
        from stickslip.structures.dissection import dissected
        from stickslip.structures.fronts import factored_in_fronts

        by = diags_array(scale)
        scaled = (by @ matrix @ by).tocsc()
        scaled.eliminate_zeros()
        thin = order_in_band(scaled) if blocks is None else None
        if thin is not None:
            found = factored_in_band(scaled, *thin)
        else:
            blocks = dissected(scaled) if blocks is None else blocks
            found = factored_in_fronts(scaled, blocks, solving)
        solve, negative, least = found.solve, found.negative, found.least
    else:
        from scipy.linalg import ldl, solve_triangular

        lower, middle, order = ldl(matrix * scale * scale[:, None], lower=True)
        pivots = np.linalg.eigvalsh(middle) if np.any(np.diag(middle, 1)) else np.diag(middle)
        negative, least = int(np.count_nonzero(pivots < 0.0)), float(np.min(np.abs(pivots)))

        def solve(b: Array) -> Array:
            below = lower[order]
            found = solve_triangular(below, b[order], lower=True, unit_diagonal=True)
            found = np.linalg.solve(middle, found)
            turned = solve_triangular(below.T, found, unit_diagonal=True)
            back = np.empty_like(turned)
            back[order] = turned
            return back

    def unscaled(b: Array) -> Array:
        by = scale if b.ndim == 1 else scale[:, None]
        return by * solve(by * b)

    return Factored(unscaled, negative, least, blocks)


def lowest_modes(
    stiffness: Symmetric, mass: Symmetric, count: int, factor: Factored | None = None
) -> tuple[Array, Array]:
    """The lowest modes of K x = ω² M x, of unit mass.

    Parameters
    ----------
    stiffness, mass : matrix, shape (n, n)
    factor : Factored, optional
        Of the stiffness, if there is one already.

    Returns
    -------
    squares : array, shape (count,)
        ω², ascending; zero for rigid modes.
    modes : array, shape (n, count)

    Raises
    ------
    ConvergenceError
        If the iteration misses a mode; counting eigenvalues by inertia shows it.
    """
    n = stiffness.shape[0]
    if not is_sparse(stiffness) or n <= max(_FULL, 2 * count):
        from scipy.linalg import eigh

        chosen = None if count == n else (0, count - 1)
        squares, modes = eigh(dense(stiffness), dense(mass), subset_by_index=chosen)
    else:
        squares, modes = _shifted(stiffness, mass, count, factor)
    squares[squares <= rounding(stiffness, mass)] = 0.0
    # The sign of a mode is chosen so that its largest entry is positive.
    tops = np.argmax(np.abs(modes), axis=0)
    modes *= np.where(modes[tops, np.arange(modes.shape[1])] < 0.0, -1.0, 1.0)
    return squares, modes


def rounding(stiffness: Symmetric, mass: Symmetric) -> float:
    """Bound of ω² of a rigid mode due to rounding errors."""
    n = stiffness.shape[0]
    top = float(np.max(np.abs(stiffness.diagonal()) / mass.diagonal()))
    return 8.0 * np.sqrt(n) * np.finfo(float).eps * top


def _shifted(
    stiffness: Symmetric, mass: Symmetric, count: int, factor: Factored | None
) -> tuple[Array, Array]:
    """Lanczos' iteration with (K + s M)⁻¹ M, s > 0 where there are rigid modes, and s < 0 where
    another factor costs little and many frequencies are close."""
    from stickslip.structures.lanczos import vectors_of_largest

    factor, shift = factor or factored(stiffness), 0.0
    if factor.singular or factor.negative:
        shift = _SHIFT * float(np.max(stiffness.diagonal() / mass.diagonal()))
        factor = factored(stiffness + shift * mass)

    def nearer(values: Array) -> Callable[[Array], Array] | None:
        nonlocal shift
        low, high = 1.0 / values[0] - shift, 1.0 / values[-1] - shift
        near = low - _APART * (low + shift)
        if high - low > _SPREAD * (low + shift):
            return None
        closer = factored(stiffness - near * mass)
        if closer.negative or closer.singular:
            return None
        shift = -near
        return closer.solve

    wanted = min(count + 2, stiffness.shape[0] - 1)
    modes = vectors_of_largest(
        factor.solve, mass, wanted, None if factor.blocks is not None else nearer
    )
    heavy = np.einsum("ij,ij->j", modes, mass @ modes)
    squares = np.einsum("ij,ij->j", modes, stiffness @ modes) / heavy
    order = np.argsort(squares)
    squares, modes = squares[order], (modes / np.sqrt(heavy))[:, order]
    # Below a value between two of them there have to be as many as were found. Where the last ones
    # coincide it lies before them.
    gaps = np.diff(squares)
    last = count + int(np.argmax(gaps[count - 1 :]))
    if gaps[last - 1] <= _COINCIDE * squares[last]:
        last = 1 + int(np.max(np.flatnonzero(gaps > _COINCIDE * squares[1:]), initial=-1))
    lower = squares[last - 1] if last else 0.0
    below = 0.5 * (lower + squares[last])
    # A mass usually has entries only where the stiffness has some; if not, the order is only worse.
    found = factored(stiffness - below * mass, solving=False, blocks=factor.blocks).negative
    if found != last:
        raise ConvergenceError(
            "modes",
            f"{last} modes were found below {np.sqrt(below):.6g}, but the structure has {found}",
            "Request a few more modes",
        )
    return squares[:count], modes[:, :count]


def block_of(matrix: Symmetric, rows: Sequence[int] | Array, columns: Sequence[int] | Array) -> Any:
    """A block of a matrix."""
    block = matrix[rows][:, columns]
    return block.tocsc() if is_sparse(matrix) else block
