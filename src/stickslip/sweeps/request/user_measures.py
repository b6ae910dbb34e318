"""Measures of a map: named measures, formulas of them, and user-defined functions of the motion."""

from __future__ import annotations

import hashlib
import inspect
import math
import re
import runpy
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, StickslipError, listing, short, suggestion
from stickslip.model.quantities import described, described_as
from stickslip.model.system import System
from stickslip.sweeps.request.carry import CARRIED
from stickslip.sweeps.request.measures import MEASURES, OWN, needs_close_look
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.evaluator import evaluator
from stickslip.symbolic.formulas import NAME, Scope

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

_OF_ONE = re.compile(rf"\b(?:{'|'.join(MEASURES)})\s*:\s*[A-Za-z]\w*(?:\s*\[\s*\w+\s*\])?")
MEASURES_GROUP = "stickslip.measures"
"""Entry points of measures that other packages add."""

REASONS = (
    "given",
    "returned_nan",
    "returned_no_number",
    "raised_an_error",
    "motion_incomplete",
    "measure_missing",
    "undefined",
    "not_finite",
)
"""Why a function of the motion, or a formula of measures, has no value at a point; 0: it has
one."""


@dataclass(frozen=True)
class FormulaMeasure:
    """A formula of named measures and of the parameters, such as ``cost =
    energy_per_cycle/(P*speed)`` or ``range = high:tip - low:tip``.

    Attributes
    ----------
    needs : tuple of str
        Named measures that it is made of.
    """

    name: str
    text: str
    expression: ex.Expr = field(compare=False, repr=False)
    needs: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.name} = {self.text}"

    def values(self, known: Mapping[str, Array | float], count: int) -> tuple[Array, Array]:
        """Values of the formula, NaN if undefined or infinite, with the reasons."""
        names = sorted(self.expression.symbols)
        table = np.empty((len(names), count))
        for row, name in zip(table, names, strict=True):
            row[:] = known[name]
        found = evaluator([self.expression], names)(table)[0]
        why = np.where(np.isnan(found), REASONS.index("undefined"), REASONS.index("not_finite"))
        why[np.isfinite(found)] = 0
        why[np.isnan(table).any(axis=0)] = REASONS.index("measure_missing")
        return np.where(why == 0, found, np.nan), why.astype(np.int8)


@dataclass(frozen=True)
class FunctionMeasure:
    """A Python function of a :class:`~stickslip.Trajectory` that gives a number.

    Attributes
    ----------
    function : callable or None
        None: the function is in a file, and every process that needs it reads it from there.
    digest : str
        Hash of its source, so that a store detects another function of the same name.
    """

    name: str
    function: Callable[[Trajectory], float] | None = field(compare=False)
    path: str = ""
    digest: str = ""

    def __str__(self) -> str:
        return f"{self.name}(trajectory) [{self.digest}]"

    def value(self, trajectory: Trajectory) -> tuple[float, int]:
        """The value at one point, and the reason if it is missing."""
        if not trajectory.outcome.ok:
            return math.nan, REASONS.index("motion_incomplete")
        function = self.function or _from_file(self.path, self.name, self.digest)
        try:
            found = function(trajectory)
        # an error in a user's function is missing data and does not end a map of a million points
        except Exception:
            return math.nan, REASONS.index("raised_an_error")
        try:
            value = float(found)
        except (TypeError, ValueError, OverflowError):
            return math.nan, REASONS.index("returned_no_number")
        return value, 0 if not math.isnan(value) else REASONS.index("returned_nan")


Measure = str | FormulaMeasure | FunctionMeasure


def read_measures(system: System, asked: Sequence[Any]) -> tuple[Measure, ...]:
    """Read the requested measures.

    Parameters
    ----------
    asked : sequence of str or callable
        Names of measures, possibly of one coordinate, output, formula or contact
        (``"amplitude:psi"``, ``"high:u[tip] - u[root]"``); formulas ``"name = formula"`` of
        measures and parameters (``"range = high:tip - low:tip"``); ``"file.py:function"``;
        functions of a Trajectory, or the names of those that other packages add (entry points of
        ``stickslip.measures``).

    Raises
    ------
    DeclarationError
        If there is no such measure, a formula is wrong, or a name is used twice.
    """
    if isinstance(asked, str) or callable(asked):
        asked = [asked]
    measures = tuple(_measure(system, item) for item in asked)
    if not measures:
        known = suggestion("", offered_measures(system))
        raise DeclarationError("measure", "no measure was given", known)
    names = [variable(measure) for measure in measures]
    for name in names:
        if names.count(name) > 1:
            raise DeclarationError(
                f"measure.{short(name)}",
                "it is given twice",
                "Use a different name for each measure",
            )
        taken = {*system.parameters, *system.declaration.state, *OWN}
        if name in taken or name.startswith(CARRIED):
            raise DeclarationError(
                f"measure.{short(name)}", "the name is already used", "Choose another name"
            )
    return measures


def offered_measures(system: System) -> dict[str, dict[str, str]]:
    """Measures available by name, with unit and meaning: the named measures, and those that other
    packages add."""
    found: dict[str, dict[str, str]] = {}
    for name in MEASURES:
        with suppress(DeclarationError):
            needs_close_look(system, [name])
            found[name] = described(system, name)
    added = (entry.name for entry in entry_points(group=MEASURES_GROUP))
    return {**{name: described_as(name.replace("_", " "), "1") for name in added}, **found}


def argument_of(measure: Measure) -> Any:
    """Argument from which :func:`read_measures` creates the same measure in another process, since
    expressions cannot be pickled."""
    return measure if isinstance(measure, FunctionMeasure) else str(measure)


def variable(measure: Measure) -> str:
    """Name of the variable of a measure."""
    return measure if isinstance(measure, str) else measure.name


def _measure(system: System, item: Any) -> Measure:
    if isinstance(item, FunctionMeasure):
        return item
    if callable(item):
        name = getattr(item, "__name__", type(item).__name__)
        _check_new_name(name)
        return FunctionMeasure(name, cast(Any, item), "", _digest(_source(item)))
    if not isinstance(item, str):
        raise DeclarationError(
            "measure", f"{item!r} is not a string or a function", "Give a measure"
        )
    name, equals, text = (part.strip() for part in item.partition("="))
    if equals:
        return _formula(system, name, text)
    path, colon, function = item.rpartition(":")
    if colon and path.endswith(".py"):
        return _file_function(path, function)
    if item not in MEASURES and (entries := entry_points(group=MEASURES_GROUP, name=item)):
        return _measure(system, _loaded(next(iter(entries))))
    needs_close_look(system, [item])  # rejects unknown measures
    return item


def _loaded(entry: EntryPoint) -> Callable[[Trajectory], float]:
    """The function that another package adds as a measure."""
    try:
        function = entry.load()
    except Exception as error:
        reason = f"{entry.value} cannot be loaded ({type(error).__name__}: {short(str(error))})"
        raise StickslipError(f"measure {entry.name}: {reason}") from None
    if getattr(function, "__name__", "") != entry.name:
        raise StickslipError(
            f"measure {entry.name}: {entry.value} is not a function of that name. Use the same "
            "name for both"
        )
    return function


def _check_new_name(name: str) -> None:
    if not NAME.match(name) or name in MEASURES:
        reason = "the name of another measure" if name in MEASURES else "not a name"
        raise DeclarationError(
            "measure",
            f"'{short(name)}' is {reason}",
            "Use letters, digits and _; define the function with def, not lambda",
        )


def _formula(system: System, name: str, text: str) -> FormulaMeasure:
    _check_new_name(name)
    own = {*system.parameters, *system.declaration.state}
    vectors = system.declaration.scope.vectors
    names = {symbol: ex.sym(symbol) for symbol in {*own, *MEASURES}}
    measures = dict.fromkeys(MEASURES)
    short_names: dict[str, str] = {}

    def called(match: re.Match[str]) -> str:
        """A name for the measure of one quantity."""
        measure = re.sub(r"\s", "", match[0])
        measures.setdefault(measure)
        return short_names.setdefault(measure, f"measure_{len(short_names) + 1}_of")

    plain = _OF_ONE.sub(called, text)
    names |= {given: ex.sym(measure) for measure, given in short_names.items()}
    with listing(lambda x: _formula(system, name, x)):
        expression = Scope(names, vectors=vectors).parse(plain, f"measure.{name}")
    needs = tuple(n for n in measures if n in expression.symbols and n not in own)
    needs_close_look(system, needs)  # rejects unknown measures
    return FormulaMeasure(name, text, expression, needs)


def _file_function(path: str, name: str) -> FunctionMeasure:
    _check_new_name(name)
    place = str(Path(path).resolve())
    digest = _digest(_read(place))
    _from_file(place, name, digest)
    return FunctionMeasure(name, None, place, digest)


def _read(path: str) -> str:
    try:
        return Path(path).read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise DeclarationError(
            f"measure {path}", f"the file cannot be read ({reason})", "Check the path"
        ) from None


@lru_cache
def _from_file(path: str, name: str, digest: str) -> Callable[[Trajectory], float]:
    """A function of a user-defined Python file; rejected if it has changed since the request."""
    if _digest(_read(path)) != digest:
        raise StickslipError(
            f"measure {path}: the file has changed while the map was computed. Start again"
        )
    try:
        names = runpy.run_path(path)
    except Exception as error:
        reason = f"the file cannot be run ({type(error).__name__}: {short(str(error))})"
        raise StickslipError(f"measure {path}: {reason}") from None
    if not callable(names.get(name)):
        known = [key for key, value in names.items() if inspect.isfunction(value)]
        close = get_close_matches(name, known, 1) or known
        raise DeclarationError(
            f"measure {path}",
            f"unknown function '{short(name)}'",
            f"Choose from {', '.join(close)}",
        )
    return names[name]


def _source(function: Callable[..., Any]) -> str:
    try:
        return inspect.getsource(function)
    except (OSError, TypeError):  # typed at a prompt, or compiled: its name has to suffice
        return repr(getattr(function, "__qualname__", type(function)))


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:12]
