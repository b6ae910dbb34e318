"""Checks of the parts of a structure: names, basis, and definite matrices."""

from __future__ import annotations

import keyword
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, short
from stickslip.numerics.levels import COMPUTED_ZERO
from stickslip.structures import matrices
from stickslip.structures.matrices import Symmetric, is_sparse
from stickslip.symbolic.formulas import NAME

if TYPE_CHECKING:
    pass


def check_names(given: Any, names: dict[str, int], count: int) -> None:
    """Reject names that are not names, or that are not those of degrees of freedom; indices become
    plain integers."""
    if isinstance(given, str) or not isinstance(given, Mapping | Sequence | None):
        raise DeclarationError("names", "expected a list of names", 'Write it like ["tip"]')
    listed = not isinstance(given, Mapping)
    if listed and given is not None:
        if len(given) != count:
            raise DeclarationError(
                "names",
                f"{len(given)} names were given for {count} degrees of freedom",
                'Give one for each, or a mapping of names to indices, like {"tip": 3}',
            )
        twice = next((name for i, name in enumerate(given) if name in given[:i]), None)
        if twice is not None:
            raise DeclarationError(
                "names", f"'{short(str(twice))}' is given twice", "Use a different name for each"
            )
    called: dict[int, str] = {}
    for name, index in names.items():
        if not isinstance(name, str) or not NAME.match(name) or keyword.iskeyword(name):
            raise DeclarationError(
                "names",
                f"'{short(str(name))}' is not a name",
                "Use letters, digits and _, starting with a letter",
            )
        if isinstance(index, bool) or not isinstance(index, int | np.integer):
            raise DeclarationError(
                f"names.{name}", "its index is not an integer", "Use indices from 0"
            )
        if not 0 <= index < count:
            raise DeclarationError(
                f"names.{name}",
                f"no degree of freedom {index}",
                f"Use an index from 0 to {count - 1}",
            )
        if index in called:
            raise DeclarationError(
                f"names.{name}",
                f"degree of freedom {index} is already called '{called[index]}'",
                "Use one name",
            )
        called[int(index)] = name
        names[name] = int(index)


def checked_basis(given: Any, columns: int) -> Array:
    """A basis as an array that cannot be written to, one column for each coordinate."""
    if hasattr(given, "toarray"):
        given = given.toarray()
    basis = np.array(given)
    if basis.dtype.kind not in "fiu" or basis.ndim != 2 or not np.all(np.isfinite(basis)):
        raise DeclarationError("basis", "it is not a real, finite matrix", "Give shapes as columns")
    if basis.shape[1] != columns:
        raise DeclarationError(
            "basis",
            f"it has {basis.shape[1]} columns, but the mass has {columns}",
            "Give a column for each coordinate, and a row for each degree of freedom",
        )
    basis = basis.astype(float)
    basis.flags.writeable = False
    return basis


def check_positive(mass: Symmetric, said: Any) -> None:
    """Reject a mass matrix that is not positive definite; `said` names a degree of freedom."""
    diagonal = mass.diagonal()
    if np.any(diagonal <= 0.0):
        worst = int(np.argmin(diagonal))
        raise DeclarationError(
            "mass",
            f"not positive definite: the diagonal entry of {said(worst)} is {diagonal[worst]:g}",
            "Remove degrees of freedom without mass by static condensation",
        )
    factor = matrices.factored(mass, solving=False)
    if factor.negative or factor.singular:
        raise DeclarationError(
            "mass",
            f"not positive definite: {_lowest_of(mass, None, factor.negative)}",
            "Check the signs, and for linearly dependent degrees of freedom",
        )


def check_not_negative(matrix: Symmetric, mass: Symmetric, what: str) -> None:
    """Reject a matrix with an eigenvalue that is negative beyond rounding."""
    diagonal = np.abs(matrix.diagonal())
    spread = float(np.max(diagonal, initial=0.0)) or 1.0
    small = COMPUTED_ZERO * np.where(diagonal > 0.0, diagonal, spread)
    if is_sparse(matrix):
        from scipy.sparse import diags_array

        raised = (matrix + diags_array(small)).tocsc()
    else:
        raised = matrix + np.diag(small)
    factor = matrices.factored(raised, solving=False)
    if factor.negative or factor.least == 0.0:
        raise DeclarationError(
            what,
            f"indefinite: {_lowest_of(matrix, mass, factor.negative)}",
            "Check the signs; declare a negative stiffness in the potential of the system, such "
            "as -k/2*u[3]**2"
            if what == "stiffness"
            else "Damping must not create energy; declare negative damping as a force of the "
            "system",
        )


def _lowest_of(matrix: Symmetric, mass: Symmetric | None, negative: int) -> str:
    """The lowest eigenvalue, in words."""
    n = matrix.shape[0]
    if is_sparse(matrix) and n > 2000:
        return f"{negative or 'some'} of its {n:,} eigenvalues are not positive"
    from scipy.linalg import eigvalsh

    by = None if mass is None else matrices.dense(mass)
    low = eigvalsh(matrices.dense(matrix), by, subset_by_index=(0, 0))[0]
    what = "the smallest" if mass is None else "relative to the mass, the smallest"
    return f"{what} of its {n} eigenvalues is {low:.6g}"
