"""Damping rules of structures, by modes in place of a matrix.

A rule is a sum of coefficients, each with a weight for every mode. A coefficient is a number, or a
formula of the parameters of the system that contains the structure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from stickslip.arrays import AnyArray, Array
from stickslip.errors import DeclarationError, short
from stickslip.symbolic.formulas import is_finite

Coefficient = float | str
"""A number, or a formula of parameters."""
_ROUNDED = 4.0 * np.finfo(float).eps  # rounding error relative to a sum of magnitudes


@dataclass(frozen=True)
class ProportionalDamping:
    """Rayleigh damping, C = α M + β K.

    Attributes
    ----------
    alpha, beta : float or str
        Nonnegative; α in 1/time, β in time. A string is a formula of parameters of the system.

    Raises
    ------
    DeclarationError
        If one of them is negative, or neither a number nor a formula.
    """

    alpha: Coefficient
    beta: Coefficient

    def __post_init__(self) -> None:
        for name in ("alpha", "beta"):
            object.__setattr__(self, name, _coefficient(getattr(self, name), f"damping.{name}"))

    def weights(self, squares: Array) -> list[tuple[Coefficient, Array]]:
        """Coefficients, each with its factors in the damping of the modes of unit mass, shape (n,).

        Parameters
        ----------
        squares : array, shape (n,)
            Squares of angular frequencies.
        """
        return [(self.alpha, np.ones(len(squares))), (self.beta, squares)]

    def of_modes(self, squares: Array) -> Array:
        """Damping coefficient of each mode of unit mass.

        Parameters
        ----------
        squares : array, shape (n,)
            Squares of angular frequencies.

        Raises
        ------
        DeclarationError
            If a coefficient is a formula.
        """
        alpha, beta = _numbers((self.alpha, self.beta))
        return alpha + beta * squares

    def plain(self) -> dict[str, object]:
        """Plain data for a model file."""
        return {"alpha": self.alpha, "beta": self.beta}


@dataclass(frozen=True)
class ModalDamping:
    """Damping as a fraction of critical damping, mode by mode: a mode with angular frequency ω has
    the damping 2ζω per unit of modal mass.

    Attributes
    ----------
    ratios : float, str, or sequence of these
        ζ of the modes, in order of frequency, at most one for each; the last one applies to all
        further modes, so a single number applies to all. A string is a formula of parameters of the
        system, as in ``ModalDamping("zeta")``.

    Raises
    ------
    DeclarationError
        If a ratio is negative, or neither a number nor a formula.

    Examples
    --------
    >>> import stickslip as ss
    >>> body = ss.Structure([[1.0]], [[4.0]], ss.ModalDamping("zeta"))
    >>> system = ss.System("s", parameters={"zeta": 0.05}, structures={"u": body})
    >>> decay = ss.ring_down(system, (0.0, 20.0), initial={"u[0]": 1.0})
    >>> float(decay["damping"][0].round(12))
    0.05
    """

    ratios: Coefficient | Sequence[Coefficient]

    def __post_init__(self) -> None:
        given = self.ratios
        listed = np.atleast_1d(np.asarray(given, dtype=object))
        if listed.ndim != 1 or not len(listed):
            raise DeclarationError(
                "damping.ratios", "expected a number or a list of them", "Give ratios, like 0.01"
            )
        ratios = tuple(
            _coefficient(ratio, f"damping.ratios[{i}]") for i, ratio in enumerate(listed)
        )
        object.__setattr__(self, "ratios", ratios)

    def weights(self, squares: Array) -> list[tuple[Coefficient, Array]]:
        """Coefficients, each with its factors in the damping of the modes of unit mass, shape (n,).

        Parameters
        ----------
        squares : array, shape (n,)
            Squares of angular frequencies.
        """
        each = self._each(len(squares))
        twice = 2.0 * np.sqrt(squares)
        return [(ratio, twice * (each == i)) for i, ratio in enumerate(self._listed)]

    def of_modes(self, squares: Array) -> Array:
        """Damping coefficient of each mode of unit mass.

        Parameters
        ----------
        squares : array, shape (n,)
            Squares of angular frequencies.

        Raises
        ------
        DeclarationError
            If a ratio is a formula.
        """
        ratios = np.array(_numbers(self._listed))
        return 2.0 * ratios[self._each(len(squares))] * np.sqrt(squares)

    def check_count(self, modes: int) -> None:
        """Reject more ratios than modes.

        Raises
        ------
        DeclarationError
            If there are more.
        """
        if len(self._listed) > modes:
            raise DeclarationError(
                "damping.ratios",
                f"there are {len(self._listed)} ratios, but the structure has {modes} "
                f"mode{'' if modes == 1 else 's'}",
                "Give at most one ratio for each mode; the last one applies to all further modes",
            )

    def of_lowest(self, modes: int) -> ModalDamping:
        """The damping of the lowest modes only."""
        return self if len(self._listed) <= modes else ModalDamping(self._listed[:modes])

    @property
    def _listed(self) -> tuple[Coefficient, ...]:
        return cast("tuple[Coefficient, ...]", self.ratios)

    def _each(self, count: int) -> AnyArray:
        """Index of the ratio of each mode."""
        return np.minimum(np.arange(count), len(self._listed) - 1)

    def plain(self) -> dict[str, object]:
        """Plain data for a model file."""
        return {"ratios": self.ratios}


def damping_of_shapes(damping: Array, shapes: Array) -> Array:
    """Projection of a positive semidefinite matrix onto shapes: shape (m,) if it does not couple
    them, else (m, m).

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


def _numbers(coefficients: Sequence[Coefficient]) -> list[float]:
    """The coefficients as numbers.

    Raises
    ------
    DeclarationError
        If one is a formula.
    """
    found: list[float] = []
    for coefficient in coefficients:
        if isinstance(coefficient, str):
            raise DeclarationError(
                "damping",
                f"'{short(coefficient)}' is a formula of parameters, which have no values outside "
                "a system",
                "Give a number, or use the structure in a system",
            )
        found.append(coefficient)
    return found


def _coefficient(value: object, where: str) -> Coefficient:
    if isinstance(value, str) and value.strip():
        return value
    if not is_finite(value):
        raise DeclarationError(
            where,
            f"'{short(str(value))}' is not a finite number",
            'Give a finite number, or a formula of parameters, like "zeta"',
        )
    if value < 0.0:
        raise DeclarationError(
            where, f"{value:g} is negative and would create energy", "Give a value >= 0"
        )
    return float(value)
