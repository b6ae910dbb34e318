"""Damping that is said of modes, not by a matrix."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, short
from stickslip.symbolic.formulas import is_finite


@dataclass(frozen=True)
class ProportionalDamping:
    """Rayleigh's damping, C = α M + β K.

    Attributes
    ----------
    alpha, beta : float
        At least zero; α in 1/time, β in time.

    Raises
    ------
    DeclarationError
        If one of them is negative, or no number.
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
        """What a model file says of it."""
        return {"alpha": self.alpha, "beta": self.beta}


@dataclass(frozen=True)
class ModalDamping:
    """Parts of critical damping, mode by mode: a mode with angular frequency ω has the damping
    2ζω for each unit of its mass.

    Attributes
    ----------
    ratios : float or sequence of float
        ζ of the modes, in the order of their frequencies; the last one holds for all further modes,
        so that one number is the ratio of all.

    Raises
    ------
    DeclarationError
        If a ratio is negative, or no number.
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
        """What a model file says of it."""
        return {"ratios": self.ratios}


def _not_negative(value: object, where: str) -> float:
    if not is_finite(value):
        raise DeclarationError(
            where, f"'{short(str(value))}' is not a finite number", "Give a number"
        )
    if value < 0.0:
        raise DeclarationError(where, f"{value:g} would feed energy in", "Damping is at least zero")
    return float(value)
