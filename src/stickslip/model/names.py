"""Common parts of all kinds of model files: parameters, functions, and reserved names."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar

from stickslip.errors import DeclarationError, short, suggestion
from stickslip.model.entries.units import check_unit, with_unit
from stickslip.model.formats.expected import entry_key
from stickslip.model.system import Drive, Output, Parameter
from stickslip.numerics.levels import SPAN_ENDS
from stickslip.symbolic.formulas import (
    Definition,
    TimeFunction,
    check_name,
    is_finite,
    parse_signature,
)

if TYPE_CHECKING:
    from stickslip.model.entries.tables import Table

_INTERVAL = re.compile(r"\s*([\[(])\s*(\S+?)\s*,\s*(\S+?)\s*([\])])\s*\Z")
_M = TypeVar("_M")


@dataclass(frozen=True)
class Range:
    """Admissible interval of a parameter."""

    text: str
    low: float
    high: float
    closed: tuple[bool, bool]

    def __contains__(self, value: float) -> bool:
        above = value >= self.low if self.closed[0] else value > self.low
        below = value <= self.high if self.closed[1] else value < self.high
        return above and below

    def check(self, value: object, where: str) -> None:
        """Reject values that are not numbers, or out of range."""
        if not is_finite(value):
            raise DeclarationError(where, "not a finite number", "Give a finite number")
        if value not in self:
            raise DeclarationError(
                where,
                f"{value:g} is outside the admissible range {self.text}",
                "Choose a value in this range",
            )


def parse_range(text: object, where: str) -> Range:
    """Interval such as ``(0, inf)`` or ``[0, 1]``."""
    match = _INTERVAL.match(text) if isinstance(text, str) else None
    if match:
        try:
            low, high = float(match[2]), float(match[3])
        except ValueError:
            low, high = 1.0, 0.0
        if low <= high:
            return Range(str(text), low, high, (match[1] == "[", match[4] == "]"))
    raise DeclarationError(
        where, f"'{short(str(text))}' is not an interval", "Write it like '(0, inf)' or '[0, 1]'"
    )


@dataclass
class DeclaredNames:
    """The names of a declaration while it is read: each means one thing.

    Attributes
    ----------
    reserved : mapping of str to str
        Names that mean something else here, with what that is.
    ranges : dict of str to Range
        Of the parameters.
    definitions : dict of str to Definition
        Functions, drives and outputs.
    """

    reserved: Mapping[str, str] = field(default_factory=dict)
    ranges: dict[str, Range] = field(default_factory=dict)
    definitions: dict[str, Definition] = field(default_factory=dict)
    _taken: set[str] = field(default_factory=set)
    _derivatives: dict[str, Definition] = field(default_factory=dict)

    def claim(self, name: str, where: str, rate: bool = False) -> None:
        """Take a name, and that of its rate; refuses one that is taken or reserved."""
        if name in self.reserved:
            raise DeclarationError(
                where, f"'{name}' is {self.reserved[name]}", "Choose another name"
            )
        for each in (name, f"d_{name}") if rate else (name,):
            check_name(each, where, self._taken)
            self._taken.add(each)

    def parameters(self, entries: Mapping[str, Parameter]) -> None:
        """Read parameters: their names, units, ranges and values."""
        for name, parameter in entries.items():
            where = entry_key("parameters", name)
            self.claim(name, where)
            check_unit(parameter.unit, f"{where}.unit")
            self.ranges[name] = parse_range(parameter.range, f"{where}.range")
            self.ranges[name].check(parameter.default, where)

    def functions(self, section: str, entries: Mapping[str, Drive], clock: str = "") -> None:
        """Read functions; `clock` is the variable of differentiation for those without
        arguments."""
        for key, text in entries.items():
            where = entry_key(section, key)
            name, arguments = parse_signature(key, where)
            self.claim(name, where)
            self.definitions[name] = Definition(where, arguments, text)
            by = arguments[0] if len(arguments) == 1 else clock
            if by:
                self._derivatives[f"d_{name}"] = Definition(where, arguments, text, by)

    def tables(self, entries: Mapping[str, Table]) -> None:
        """Read tables: functions by their names, with the slopes and integrals of curves."""
        for name, table in entries.items():
            where = entry_key("tables", name)
            self.claim(name, where)
            for called, text in table.functions(name).items():
                known = self.definitions if called == name else self._derivatives
                known[called] = Definition(where, table.arguments, text)

    def outputs(self, entries: Mapping[str, Output]) -> None:
        """Read outputs: formulas with a name, as functions without arguments are."""
        self.functions("outputs", {name: output.formula for name, output in entries.items()})
        for name, output in entries.items():
            where = entry_key("outputs", name)
            if parse_signature(name, where)[1]:
                raise DeclarationError(
                    where,
                    "an output cannot have arguments",
                    "Move it to 'functions', or give a name only",
                )
            check_unit(output.unit, f"{where}.unit")

    def with_derivatives(self) -> dict[str, Definition]:
        """All definitions, and the derivatives of those of one argument and of drives."""
        derivatives = {name: d for name, d in self._derivatives.items() if name not in self._taken}
        return self.definitions | derivatives


def measured_drives(drives: Mapping[str, Drive | Table]) -> dict[str, TimeFunction]:
    """The drives that are not formulas."""
    return {name: drive for name, drive in drives.items() if isinstance(drive, TimeFunction)}


def check_covered(drives: Mapping[str, TimeFunction], start: float, stop: float) -> None:
    """Reject a time span that a drive does not cover."""
    for name, drive in drives.items():
        if not drive.covers(start, stop):
            first, last = drive.span
            raise DeclarationError(
                entry_key("drives", name),
                f"the samples cover {first:.9g} ... {last:.9g}, the time span is {start:.9g} "
                f"... {stop:.9g}",
                "Shorten the span, give more samples, or declare them periodic",
            )


def parts_left_out(
    drives: Mapping[str, TimeFunction], start: float, stop: float, unit: str
) -> list[str]:
    """Descriptions of the parts of driving records outside a time span.

    Parameters
    ----------
    unit : str
        Of the time.
    """
    found: list[str] = []
    for name, drive in drives.items():
        if not drive.ends:
            continue
        first, last = drive.span
        near = SPAN_ENDS * (last - first)
        if first < start - near:
            begins, begun = (with_unit(t, unit) for t in (first, start))
            found.append(f"record '{name}' begins at {begins}, the motion at {begun}")
        if last > stop + near:
            runs, stops = (with_unit(t, unit) for t in (last, stop))
            found.append(f"record '{name}' runs to {runs}, the motion ends at {stops}")
    return found


def reconfigured(model: _M, given: Mapping[str, Drive | Table], sections: tuple[str, ...]) -> _M:
    """The same model with other values of its parameters and other functions.

    Parameters
    ----------
    given : mapping of str to float or formula
        A parameter's name with its value, or the name of a function with its formula.
    sections : tuple of str
        Fields of the model that hold functions.

    Raises
    ------
    DeclarationError
        If a name is neither, or a value is not admissible.
    """
    if not given:
        return model
    data: Any = model
    parameters = dict(data.parameters)
    functions = {section: dict(getattr(data, section)) for section in sections}
    homes = {
        parse_signature(key, section)[0]: (section, key)
        for section, entries in functions.items()
        for key in entries
    }
    for name, value in given.items():
        if name in parameters:
            if not is_finite(value):
                raise DeclarationError(
                    f"parameters.{name}",
                    f"'{short(str(value))}' is not a finite number",
                    "Give a finite number",
                )
            parameters[name] = replace(parameters[name], default=float(value))
        elif name in homes:
            section, key = homes[name]
            functions[section][key] = value
        else:
            raise DeclarationError(
                data.name,
                f"unknown parameter or function '{short(name)}'",
                suggestion(name, [*parameters, *homes]),
            )
    return replace(data, parameters=parameters, **functions)
