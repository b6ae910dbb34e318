"""Checks of the arguments of public functions against their annotations.

An argument annotated ``rtol: float`` must be a number, ``system: System`` a system. Ranges, names,
and other conditions of a single function are checked by this function.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import wraps
from inspect import signature
from itertools import chain, cycle
from numbers import Integral, Real
from typing import Any, NamedTuple, ParamSpec, TypeVar

from stickslip.errors import DeclarationError, short

P = ParamSpec("P")
R = TypeVar("R")

_MOST = 2**62
"""The largest whole number: compiled functions take up to 2⁶³, and may add to it."""


class ArgumentKind(NamedTuple):
    """One kind of argument.

    Attributes
    ----------
    name : str
        What it is, for a message.
    remedy : str
        How it is written.
    fits : callable
        Whether a value is of the kind.
    """

    name: str
    remedy: str
    fits: Callable[[Any], bool]


def validated(function: Callable[P, R]) -> Callable[P, R]:
    """The function with a check of its arguments.

    An argument whose annotation has a part that is in no table here is not checked.

    Raises
    ------
    DeclarationError
        By the function: an argument is not what its annotation says.
    """
    parameters = signature(function).parameters
    positional = [n for n, p in parameters.items() if p.kind <= p.POSITIONAL_OR_KEYWORD]
    others = [n for n, p in parameters.items() if p.kind is p.VAR_POSITIONAL]
    kinds = {
        name: found
        for name, parameter in parameters.items()
        if (found := kinds_of(str(parameter.annotation)))
    }

    @wraps(function)
    def run(*args: P.args, **kwargs: P.kwargs) -> R:
        for name, value in zip(chain(positional, cycle(others)), args, strict=False):
            if name in kinds:
                check_argument(name, value, kinds[name])
        for name, value in kwargs.items():
            if name in kinds:
                check_argument(name, value, kinds[name])
        return function(*args, **kwargs)

    return run


def check_fields(item: Any) -> None:
    """Reject fields of a dataclass that do not match their annotations.

    Raises
    ------
    DeclarationError
    """
    for field in fields(item):
        if kinds := kinds_of(str(field.type)):
            check_argument(field.name, getattr(item, field.name), kinds)


def check_argument(name: str, value: Any, kinds: tuple[ArgumentKind, ...]) -> None:
    """Reject a value that is of none of some kinds.

    Raises
    ------
    DeclarationError
    """
    for kind in kinds:
        if kind.fits(value):
            return
    # None is not mentioned
    said = [kind for kind in kinds if kind is not _KINDS["None"]] or list(kinds)
    expected = " or ".join(dict.fromkeys(kind.name for kind in said))
    raise DeclarationError(name, f"expected {expected}, got {argument_said(value)}", said[0].remedy)


def check_tolerances(**given: float) -> None:
    """Reject tolerances that are not positive and finite.

    Raises
    ------
    DeclarationError
    """
    for name, value in given.items():
        if not (is_real(value) and 0.0 < value < math.inf):
            raise DeclarationError(
                name, f"{value!r} is not a tolerance", "Give a small positive number"
            )


def argument_said(value: Any) -> str:
    """A value of the wrong kind, for a message."""
    if value is None or isinstance(value, bool | str | bytes):
        return short(repr(value))
    if isinstance(value, int):  # Python writes no more than 4300 digits of one
        return str(value) if abs(value) <= _MOST else "an integer that is too large"
    if isinstance(value, Real | complex):
        return short(str(value))
    if isinstance(value, list | tuple) and len(value) < 5 and all(map(_is_formula, value)):
        return short(repr(value))
    if isinstance(value, type):
        return f"the class {value.__name__}"
    article = "an" if type(value).__name__[:1] in "aeiouAEIOU" else "a"
    return f"{article} {type(value).__name__}"


def kinds_of(annotation: str) -> tuple[ArgumentKind, ...]:
    """The kinds in an annotation; none if one of its parts is not known here."""
    parts = [part.strip() for part in _parts(annotation)]
    if not {"Path", "PathLike[str]"}.isdisjoint(parts):  # then a text is a path, too
        parts = [part for part in parts if part != "str"]
    found = [_kind_of(part) for part in parts]
    return tuple(kind for kind in found if kind) if all(found) else ()


def is_real(value: Any) -> bool:
    """Whether a value is a real number that a float can hold."""
    if type(value) is float:  # most are; abstract classes take ten times as long
        return value == value
    # Arrays without axes of any library are numbers, too.
    if _is_truth(value) or not (isinstance(value, Real) or getattr(value, "ndim", 1) == 0):
        return False
    try:
        return not math.isnan(float(value))
    except (TypeError, ValueError, OverflowError):
        return False


def _is_whole(value: Any) -> bool:
    return isinstance(value, Integral) and not _is_truth(value) and abs(int(value)) <= _MOST


def _is_truth(value: Any) -> bool:
    return type(value).__name__ in ("bool", "bool_")  # the second is NumPy's


def _is_pair(value: Any) -> bool:
    # Entries that are not numbers are rejected by the functions, together with ranges.
    return _is_list(value) and len(value) == 2 and all(is_real(v) or v != v for v in value)


def _is_list(value: Any) -> bool:
    sized = hasattr(value, "__len__") and getattr(value, "ndim", 1) > 0
    return sized and not isinstance(value, str | bytes | Mapping | type)


def _is_array(value: Any) -> bool:
    if is_real(value):
        return True
    if isinstance(value, str | bytes | Mapping | type) or value is None:
        return False
    import numpy as np

    try:
        array = np.asarray(value)
        if array.dtype.kind == "O":  # numbers of other kinds than NumPy's
            return all(map(is_real, array.reshape(-1)))
    except (TypeError, ValueError, OverflowError):
        return False
    return array.dtype.kind in "iuf" or array.size == 0


def _mapping(of: Callable[[Any], bool] | None = None) -> Callable[[Any], bool]:
    def fits(value: Any) -> bool:
        if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
            return False
        return of is None or all(map(of, value.values()))

    return fits


def _sequence(of: Callable[[Any], bool] | None = None) -> Callable[[Any], bool]:
    def fits(value: Any) -> bool:
        if not _is_list(value):  # an iterator can be consumed only once
            return hasattr(value, "__next__")
        return of is None or all(map(of, value))

    return fits


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_formula(value: Any) -> bool:
    return isinstance(value, str) or is_real(value)


def _is_path(value: Any) -> bool:
    return isinstance(value, str | os.PathLike)


_PATH = ArgumentKind("a path", 'Give a path, like "motion.nc"', _is_path)
_KINDS = {
    "None": ArgumentKind("nothing", "Leave it out", lambda value: value is None),
    "float": ArgumentKind("a number", "Give a number, like 0.5", is_real),
    "int": ArgumentKind("an integer", "Give an integer, like 40", _is_whole),
    "bool": ArgumentKind("True or False", "Use True or False", _is_truth),
    "str": ArgumentKind("a string", 'Write it in quotes, like "x"', _is_text),
    "Path": _PATH,
    "PathLike[str]": _PATH,
    "tuple[float, float]": ArgumentKind(
        "a pair of numbers", "Give a pair, like (0, 100)", _is_pair
    ),
    "Tell": ArgumentKind("a function", "Give a function, like print", callable),
}
_NAMES = 'Give names, like {"x": 1.0}'
_KINDS |= {
    "ArrayLike": ArgumentKind("numbers", "Give a number or a list, like [0.1, 0.2]", _is_array),
    "Sequence[str]": ArgumentKind(
        "a list of strings", 'Give a list, like ["x"]', _sequence(_KINDS["str"].fits)
    ),
    "Sequence[float]": ArgumentKind(
        "a list of numbers", "Give a list, like [0.1, 0.2]", _sequence(is_real)
    ),
    "Mapping[str, ArrayLike]": ArgumentKind(
        "a mapping of names to numbers", _NAMES, _mapping(_is_array)
    ),
    "Mapping[str, Observable]": ArgumentKind(
        "a mapping of names to functions", "Give functions of t and z", _mapping(callable)
    ),
}
_KINDS["tuple[str, ...]"] = _KINDS["Iterable[str]"] = _KINDS["Sequence[str]"]
_KINDS["Loss"] = _KINDS["SampleKind"] = _KINDS["str"]
_KINDS["Formula"] = ArgumentKind("a formula", 'Write it like "2*k"', _is_formula)
_KINDS["State"] = _KINDS["Values"] = ArgumentKind("a mapping of names", _NAMES, _mapping())
_GENERIC = {
    "Mapping[str,": _KINDS["State"],
    "Sequence[": ArgumentKind("a list", "Give a list, like [0.1, 0.2]", _sequence()),
    "Callable[": ArgumentKind("a function", "Give a function, like print", callable),
    "Literal[": _KINDS["str"],
}
_CLASSES = {
    "Adaptive": "Use ss.Adaptive(...)",
    "Cycle": "Use ss.find_cycle(...)",
    "Dissipation": "Use one like ss.WeightedL1(...)",
    "Equilibrium": "Use one of ss.equilibria(...)",
    "Evolution": "Use ss.Evolution(...) or ss.load_evolution(...)",
    "History": "Use ss.evolve(...)",
    "Settings": "Use ss.Settings(...)",
    "SpecialPoint": "Use one of branch.special",
    "StepControl": "Use ss.StepControl(...)",
    "System": "Use ss.load or ss.catalogue",
    "Trajectory": "Use ss.simulate(...)",
}
"""Public classes whose objects are arguments, and where these come from."""


def _kind_of(part: str) -> ArgumentKind | None:
    if part in _KINDS:
        return _KINDS[part]
    if part in _CLASSES:
        article = "an" if part[0] in "AEIOU" else "a"
        return ArgumentKind(f"{article} {part}", _CLASSES[part], _instance(part))
    for beginning, many, of in (
        ("Sequence[", "a list", _sequence),
        ("Mapping[str, ", "a mapping of names", _mapping),
    ):
        if part.startswith(beginning) and (name := part[len(beginning) : -1]) in _CLASSES:
            return ArgumentKind(f"{many} of {name}s", _CLASSES[name], of(_instance(name)))
    return next((kind for start, kind in _GENERIC.items() if part.startswith(start)), None)


def _instance(name: str) -> Callable[[Any], bool]:
    # Compared by name, so that the module of the class is not imported here.
    return lambda value: any(kind.__name__ == name for kind in type(value).__mro__)


def _parts(annotation: str) -> list[str]:
    """The alternatives of an annotation."""
    parts, depth = [""], 0
    for character in annotation:
        depth += {"[": 1, "]": -1}.get(character, 0)
        if character == "|" and depth == 0:
            parts.append("")
        else:
            parts[-1] += character
    return parts
