"""Parsing of arguments: model names, files, and assignments such as P=1.2 or mu=2/sqrt(alpha)."""

from __future__ import annotations

import inspect
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from stickslip import catalogue, load
from stickslip.errors import DeclarationError, short
from stickslip.model.formats import toml
from stickslip.model.names import measured_drives
from stickslip.model.system import DefaultSpan, Drive, Formula, System
from stickslip.structures.names import is_entry
from stickslip.symbolic.expressions import is_number, number
from stickslip.symbolic.formulas import Scope

if TYPE_CHECKING:
    from stickslip.model.entries.tables import Table
    from stickslip.results import Result

_FILE = re.compile(r"[^*+()^<>]*\.(?![eE]\d)[A-Za-z]\w*\Z")  # formulas do not match


def load_model(model: str, settings: Iterable[str], until: float | None = None) -> System:
    """The system of a catalogue name or a model file, with ``--set`` applied.

    Parameters
    ----------
    until : float, optional
        End of its time span, which samples must cover. By default the declared span or, without
        one, that of the samples.

    Raises
    ------
    DeclarationError
        If there is no such model, or something in it or in the settings is wrong.
    """
    given = settings_of(settings)
    samples = measured_drives(given)
    others = {name: value for name, value in given.items() if name not in samples}
    if model in catalogue.names():
        system = getattr(catalogue, model)(**others)
    elif model.endswith(".toml") or os.sep in model or Path(model).is_file():
        system = load(model).configure(others)
    else:
        system = catalogue.get(model)
    if until is None:
        return system.configure(samples)
    if isinstance(system.span, DefaultSpan):
        system = system.configure(samples)
    start, _ = system.span
    if not until > start:
        reason = f"the time span begins at {start:g}, and would end at {until:g}"
        raise DeclarationError("--until", reason, "Choose a later end")
    return replace(system, span=(start, until)).configure(samples)


def differences(result: Result, system: System, model: str) -> list[str]:
    """Lines of the model file in which the system of a result and another differ.

    Parameters
    ----------
    model : str
        What the other is called.

    Raises
    ------
    DeclarationError
        If the result is not one of a system.
    """
    own = getattr(result, "system", None)
    if not isinstance(own, System):
        reason = f"{result.KIND} is not a result of one system"
        raise DeclarationError("--model", reason, f"Remove {model}")
    # The span of a motion is not a setting: --until defines it.
    before, now = (s.to_toml().splitlines() for s in (own, replace(system, span=own.span)))
    lost = [f"stored: {line}" for line in before if line and line not in now]
    new = [f"{model}: {line}" for line in now if line and line not in before]
    return [*lost, *new]


def references(model: str) -> list[str]:
    """Origin of a system: the references of a catalogue entry, or the source in a file.

    Raises
    ------
    DeclarationError
        If there is no such model.
    """
    system = load_model(model, [])
    if model in catalogue.names():
        text = inspect.getdoc(getattr(catalogue, model)) or ""
        section = text.partition("References\n----------\n")[2]
        return [" ".join(part.split()) for part in section.split("\n\n") if part.strip()]
    return [system.source] if system.source else []


def settings_of(texts: Iterable[str]) -> dict[str, Drive | Table]:
    """Values of ``--set``: numbers, formulas, and samples from files, as in ``a=base.csv`` or
    ``a={file = "base.csv", time = "t", value = "a", kind = "cubic"}``; and tables, as in ``mu={file
    = "mu.csv", of = "speed"}``."""
    return {
        name: _samples(name, value) if isinstance(value, str) and _is_file(value) else value
        for name, value in assignments(texts, "--set").items()
    }


def assignments(texts: Iterable[str], option: str) -> dict[str, Formula]:
    """Read NAME=VALUE texts; a value without names in it becomes a number (``1/3`` too)."""
    found: dict[str, Formula] = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not ((name.isidentifier() or is_entry(name)) and equals and value):
            raise DeclarationError(
                f"{option} {text}", "not of the form NAME=VALUE", f"Write it like {option} P=1.2"
            )
        if name in found:
            raise DeclarationError(f"{option} {name}", "given twice", "Give it once only")
        found[name] = _value(value)
    return found


def numbers(given: Mapping[str, Formula], option: str) -> dict[str, float]:
    """Read NAME=VALUE texts whose values must be numbers."""
    for name, value in given.items():
        if isinstance(value, str):
            raise DeclarationError(
                f"{option} {name}", f"'{value}' is not a number", "Give a number, like 0.8 or 1/3"
            )
    return {name: float(value) for name, value in given.items()}


def given(texts: Iterable[str] | None, option: str = "--initial") -> dict[str, float] | None:
    """Numbers by name, such as the initial values of ``--initial``; None if there are none."""
    return numbers(assignments(texts or [], option), option) or None


def spans(texts: Iterable[str], option: str = "--over") -> dict[str, list[float]]:
    """Read NAME=LOW:HIGH; both numbers may be fractions."""
    texts = list(texts)
    for text in texts:
        if "=" not in text:
            raise DeclarationError(
                f"{option} {text}",
                "not of the form NAME=LOW:HIGH",
                f"Write it like {option} {text}=LOW:HIGH",
            )
    found = {}
    for name, value in assignments(texts, option).items():
        pieces = str(value).split(":")
        if len(pieces) != 2:
            raise DeclarationError(
                f"{option} {name}={value}",
                f"not of the form {name}=LOW:HIGH",
                f"Write it like {option} {name}=LOW:HIGH",
            )
        found[name] = [numbers(assignments([f"{name}={p}"], option), option)[name] for p in pieces]
    return found


def _is_file(text: str) -> bool:
    """Return whether a value names a file of samples, or is a table that does."""
    return text.startswith("{") or bool(_FILE.match(text)) or Path(text).is_file()


def _samples(name: str, text: str) -> Drive | Table:
    """Samples of a drive, with or without names of the columns; a table, if it declares the
    quantity of its values."""
    from stickslip.model.entries.samples import Samples
    from stickslip.model.entries.tables import Table

    where = f"--set {name}"
    table: object = {"file": text}
    if text.startswith("{"):
        try:
            table = toml.parse(f"it = {text}")["it"]
        except DeclarationError:
            form = '{file = "base.csv", time = "t", value = "a"}'
            raise DeclarationError(
                where, f"'{short(text)}' is not a table", f"Write it like --set '{name}={form}'"
            ) from None
    given = toml.mapping(table, where)
    kind = Table if {"of", "points"} & given.keys() else Samples
    return kind.from_plain(given, where, name=name)


def _value(text: str) -> Formula:
    try:
        constant = Scope({}).parse(text, "")
    except DeclarationError:
        return text  # a formula in the system's names, or an error that the declaration reports
    return number(constant) if is_number(constant) else text
