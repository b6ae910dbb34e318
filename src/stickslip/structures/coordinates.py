"""A structure in a system: its unknowns in formulas, and its modes as coordinates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from stickslip.errors import DeclarationError, short
from stickslip.kept import made_once
from stickslip.numerics.levels import LAST_DIGITS
from stickslip.structures.damping import ModalDamping, ProportionalDamping
from stickslip.structures.names import entry_of, is_entry
from stickslip.structures.structure import Structure, UnknownKey
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import Indexed, is_finite


@dataclass(frozen=True)
class BySymbols(Indexed):
    """The unknowns of a structure as symbols.

    Attributes
    ----------
    name : str
        Of the structure, or with ``d_`` for the rates.
    """

    name: str
    structure: Structure | InModes

    @property
    def symbols(self) -> frozenset[str]:
        return frozenset()

    @property
    def shown(self) -> tuple[UnknownKey, ...]:
        part = self.structure
        return part.shown if isinstance(part, Structure) else part.structure.shown

    def entry(self, key: int | str) -> Expr:
        return ex.sym(f"{self.name}[{self.structure.key(self.structure.index(key))}]")


@dataclass(frozen=True)
class InForms(Indexed):
    """The unknowns of a structure, or their rates, as linear forms of the modes.

    Attributes
    ----------
    prefix : str
        ``"d_"`` of rates.
    """

    part: InModes
    prefix: str = ""

    @property
    def symbols(self) -> frozenset[str]:
        return frozenset(f"{self.prefix}{mode}" for mode in self.part.coordinates)

    @property
    def shown(self) -> tuple[UnknownKey, ...]:
        return self.part.structure.shown

    def entry(self, key: int | str) -> Expr:
        index = self.part.structure.index(key)
        modes = self.part.coordinates
        return made_once(
            self.part,
            "forms",
            lambda: ex.add(
                *(
                    (ex.sym(f"{self.prefix}{modes[i]}"), weight)
                    for i, weight in self.part.weights(index).items()
                )
            ),
            (self.prefix, index),
        )


@dataclass(frozen=True)
class InModes:
    """A structure in a system that is written out: coordinates are its modes of unit mass."""

    name: str
    structure: Structure

    @property
    def coordinates(self) -> list[str]:
        """Names of the modes."""
        return [f"{self.name}_mode_{i}" for i in range(1, self.structure.coordinates + 1)]

    @property
    def unit(self) -> str:
        """Unit of displacements."""
        return self.structure.unit

    def index(self, unknown: UnknownKey) -> int:
        """Index of a degree of freedom."""
        return self.structure.index(unknown)

    def key(self, index: int) -> UnknownKey:
        """Name of an unknown."""
        return self.structure.key(index)

    def indexed(self) -> dict[str, Indexed]:
        """The value of an indexed name in formulas."""
        return {self.name: InForms(self), f"d_{self.name}": InForms(self, "d_")}

    def weights(self, index: int) -> dict[int, float]:
        """Coefficients of an unknown in the modes that move it, by number of the mode."""
        row = self.structure.shape_at(index)
        large = np.abs(row) > LAST_DIGITS * np.max(np.abs(row), initial=0.0)
        return {int(i): float(row[i]) for i in np.flatnonzero(large)}

    def damping_formulas(self) -> list[str]:
        """Coefficients of the damping that are formulas, without repetition."""
        rule = self.structure.damping
        if not isinstance(rule, ProportionalDamping | ModalDamping):
            return []
        given = (value for value, _ in rule.weights(self.structure.squares))
        return list(dict.fromkeys(value for value in given if isinstance(value, str)))

    def energies(self, words: Mapping[str, str]) -> tuple[str, str, str]:
        """Kinetic and elastic energy and the viscous part of the dissipation potential.

        Parameters
        ----------
        words : mapping of str to str
            Names of the :attr:`damping_formulas`.
        """
        names, s = self.coordinates, self.structure
        kinetic = _sum(f"d_{q}**2/2" for q in names)
        elastic = _sum(
            f"{float(a) / 2.0!r}*{q}**2" for q, a in zip(names, s.squares, strict=True) if a
        )
        if words and isinstance(s.damping, ProportionalDamping | ModalDamping):
            damped = _sum(
                f"{words.get(str(value), value)}*{float(w) / 2.0!r}*d_{q}**2"
                for value, weights in s.damping.weights(s.squares)
                for q, w in zip(names, weights, strict=True)
                if value and w
            )
            return kinetic, elastic, damped
        damping = s.modal_damping
        if damping.ndim == 1:
            damped = _sum(
                f"{float(c) / 2.0!r}*d_{q}**2" for q, c in zip(names, damping, strict=True) if c
            )
        else:
            halved = np.triu(damping, 1) + np.diag(np.diag(damping)) / 2.0
            damped = _sum(
                f"{float(halved[i, j])!r}*d_{names[i]}*d_{names[j]}"
                for i, j in np.argwhere(halved).tolist()
            )
        return kinetic, elastic, damped


def start_of(
    structures: Mapping[str, InModes], given: Mapping[str, float], section: str = "initial"
) -> dict[str, float]:
    """Initial values of parts of the state, if some are given for unknowns: other unknowns of the
    same structure are zero.

    Parameters
    ----------
    section : str
        Where they stand, for messages.

    Raises
    ------
    DeclarationError
        If an unknown does not exist, its value is not a number, or it is not a coordinate of a
        structure that is reduced.
    """
    others: dict[str, float] = {}
    rows: dict[tuple[str, str], dict[int, float]] = {}
    for text, value in given.items():
        if not is_entry(text):
            others[text] = value
            continue
        prefix, name, place = _own_place(structures, text, section)
        if not is_finite(value):
            where = f"{section}.'{short(text)}'"
            raise DeclarationError(where, "not a finite number", "Give a finite number")
        rows.setdefault((prefix, name), {})[place] = float(value)
    found: dict[str, float] = {}
    for (prefix, name), row in rows.items():
        place = np.zeros(structures[name].structure.coordinates)
        place[[*row]] = [*row.values()]
        modes = structures[name].structure.in_modes(place)
        names = (f"{prefix}{mode}" for mode in structures[name].coordinates)
        found |= dict(zip(names, map(float, modes), strict=True))
    return {**found, **others}


def _own_place(structures: Mapping[str, InModes], text: str, section: str) -> tuple[str, str, int]:
    """``"d_"`` or an empty string, the structure, and the index of the coordinate that equals the
    unknown.

    Raises
    ------
    DeclarationError
        If it does not exist, or is not a coordinate of a reduced structure.
    """
    where = f"{section}.'{short(text)}'"
    try:
        prefix, name, index = entry_of(text, structures)
    except KeyError as error:
        raise DeclarationError(where, "no such degree of freedom", error.args[0]) from None
    own = structures[name].structure.own
    if index not in own:
        raise DeclarationError(
            where,
            "it is not a coordinate of the reduced structure",
            "Keep it in the reduction, or give values of modes, like "
            f"{prefix}{structures[name].coordinates[0]}",
        )
    return prefix, name, own[index]


def modes_per_unknown(
    structures: Mapping[str, InModes], text: str, section: str = "initial"
) -> dict[str, float]:
    """Derivatives of the modes, or their rates, with respect to one unknown, or its rate, all other
    unknowns being fixed.

    Parameters
    ----------
    text : str
        Such as ``d_u[tip]``.
    section : str
        Prefix of error messages.

    Raises
    ------
    DeclarationError
        If it does not exist, or is not a coordinate of a reduced structure.
    """
    prefix, name, place = _own_place(structures, text, section)
    unit = np.zeros(structures[name].structure.coordinates)
    unit[place] = 1.0
    modes = structures[name].structure.in_modes(unit)
    names = (f"{prefix}{mode}" for mode in structures[name].coordinates)
    return dict(zip(names, map(float, modes), strict=True))


def _sum(terms: Iterable[str]) -> str:
    return " + ".join(terms) or "0"


def row_of(text: str, structures: Mapping[str, InModes]) -> dict[str, float]:
    """Coefficients of an unknown, or of its rate, in the modes, or in their rates.

    Parameters
    ----------
    text : str
        Such as ``d_u[tip]``.

    Raises
    ------
    KeyError
        If there is no such unknown; its argument is a remedy.
    """
    prefix, name, index = entry_of(text, structures)
    part = structures[name]
    modes = part.coordinates
    return {f"{prefix}{modes[i]}": weight for i, weight in part.weights(index).items()}


def started_of(structures: Mapping[str, InModes]) -> list[str]:
    """Names of unknowns that results show, and of their rates, of which initial values may be
    given: those that are coordinates."""
    return [
        f"{prefix}{name}[{unknown}]"
        for name, part in structures.items()
        for prefix in ("", "d_")
        for unknown in part.structure.shown
        if part.structure.index(unknown) in part.structure.own
    ]


def shown_of(structures: Mapping[str, InModes]) -> dict[str, dict[str, float]]:
    """Unknowns that results show, and their rates, as rows of modes."""
    names = [
        f"{prefix}{name}[{unknown}]"
        for name, part in structures.items()
        for prefix in ("", "d_")
        for unknown in part.structure.shown
    ]
    return {name: row_of(name, structures) for name in names}
