"""Damping that is said of modes, not by a matrix."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, short
from stickslip.symbolic.formulas import is_finite

_ROUNDED = 4.0 * np.finfo(float).eps  # of a sum of magnitudes, what may be rounding


@dataclass(frozen=True)
class ProportionalDamping:
    """Rayleigh damping, C = α M + β K.

    Attributes
    ----------
    alpha, beta : float
        Nonnegative; α in 1/time, β in time.

    Raises
    ------
    DeclarationError
        If one of them is negative or not a number.
    """

    alpha: float
    beta: float

    def __post_init__(self) -> None:
        for name in ("alpha", "beta"):
            object.__setattr__(self, name, _not_negative(getattr(self, name), f"damping.{name}"))

    def of_modes(self, squares: Array) -> Array:
        """What multiplies the rate of each mode of unit mass.

        Parameters
        ----------
        squares : array, shape (n,)
            Squares of angular frequencies.
        """
        return self.alpha + self.beta * squares

    def plain(self) -> dict[str, object]:
        """Plain data for a model file."""
        return {"alpha": self.alpha, "beta": self.beta}


@dataclass(frozen=True)
class ModalDamping:
    """Damping as a fraction of critical damping, mode by mode: a mode with angular frequency ω has
    the damping 2ζω per unit of modal mass.

    Attributes
    ----------
    ratios : float or sequence of float
        ζ of the modes, in order of frequency; the last one applies to all further modes, so a
        single number applies to all.

    Raises
    ------
    DeclarationError
        If a ratio is negative or not a number.
    """

    ratios: float | Sequence[float]

    def __post_init__(self) -> None:
        given = self.ratios
        listed = np.atleast_1d(np.asarray(given, dtype=object))
        if listed.ndim != 1 or not len(listed):
            raise DeclarationError(
                "damping.ratios", "expected a number or a list of them", "Give ratios, like 0.01"
            )
        ratios = tuple(
            _not_negative(ratio, f"damping.ratios[{i}]") for i, ratio in enumerate(listed)
        )
        object.__setattr__(self, "ratios", ratios)

    def of_modes(self, squares: Array) -> Array:
        """What multiplies the rate of each mode of unit mass.

        Parameters
        ----------
        squares : array, shape (n,)
            Squares of angular frequencies.
        """
        ratios = np.asarray(self.ratios, dtype=float)
        each = np.minimum(np.arange(len(squares)), len(ratios) - 1)
        return 2.0 * ratios[each] * np.sqrt(squares)

    def plain(self) -> dict[str, object]:
        """Plain data for a model file."""
        return {"ratios": self.ratios}


def damping_of_shapes(damping: Array, shapes: Array) -> Array:
    """What a positive semidefinite matrix is for shapes: shape (m,) where it does not couple them,
    else (m, m).

    It is made as a product W Wᵀ of a root, so that it is positive semidefinite up to rounding of
    its own entries, even where rigid modes or few dashpots leave hardly anything of a row.

    Parameters
    ----------
    damping : array, shape (n, n)
    shapes : array, shape (n, m)
    """
    scale = np.sqrt(np.abs(np.diag(damping)))  # unknowns may have any units
    scale[scale == 0.0] = 1.0
    parts, ways = np.linalg.eigh(damping / np.outer(scale, scale))
    some = parts > _ROUNDED * len(parts) * np.max(np.abs(parts), initial=0.0)
    root = scale[:, None] * ways[:, some] * np.sqrt(parts[some])
    rows = shapes.T @ root
    terms = np.abs(shapes).T @ np.abs(root)
    noise = _ROUNDED * len(shapes) * np.linalg.norm(terms, axis=1)
    rows[np.linalg.norm(rows, axis=1) <= noise] = 0.0  # rigid modes
    found = rows @ rows.T
    own = np.sqrt(np.diag(found))
    size = np.abs(shapes).T @ (np.abs(damping) @ np.abs(shapes))
    apart = found - np.diag(np.diag(found))
    if np.all(np.abs(apart) <= _ROUNDED * size):
        return np.diag(found).copy()
    small = np.abs(apart) <= _ROUNDED * np.outer(own, own)
    np.fill_diagonal(small, False)
    return np.where(small, 0.0, found)


def _not_negative(value: object, where: str) -> float:
    if not is_finite(value):
        raise DeclarationError(
            where, f"'{short(str(value))}' is not a finite number", "Give a finite number"
        )
    if value < 0.0:
        raise DeclarationError(
            where, f"{value:g} is negative and would create energy", "Give a value >= 0"
        )
    return float(value)
