"""The description of a model for a page: equations, parameters, functions, initial values."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arrays import Array
from stickslip.display.symbols import unicode_unit
from stickslip.display.system_page import equations_page, name_in_html
from stickslip.errors import DeclarationError
from stickslip.explorer.asking.answer import Answer
from stickslip.explorer.asking.request import Request
from stickslip.explorer.subject.systems import system_of, values_of
from stickslip.model.names import parse_range
from stickslip.model.quantities import quantity
from stickslip.model.system import Parameter, System
from stickslip.symbolic.formulas import parse_signature

if TYPE_CHECKING:
    from stickslip.explorer.work.loop import Cancellation

_DIVISIONS = 200  # number of steps of a slider
# largest number of unknowns of a structure with initial displacements and velocities
_MOST_UNKNOWNS = 8
_GRAPH = 81  # points of the small graph of a function


def describe_model(request: Request, cancellation: Cancellation) -> Iterator[Answer]:
    """Description of a model for a page."""
    system, numbers = system_of(request.setting)
    graphs, arrays = _graphs(system, values_of(system, numbers))
    yield Answer(
        {
            "part": "model",
            "name": system.name,
            "title": system.title or system.name,
            "source": system.source,
            "equations": equations_page(system),
            "parameters": parameter_rows(system.parameters),
            "functions": _functions(system, graphs),
            "initial": _initial(system),
            "span": list(system.span),
            "time_unit": unicode_unit(system.time_unit),
            "translation": dict(system.translation),
            "doubts": system.unit_conflicts,
            "toml": system.to_toml() if request.setting.toml else "",
            "autonomous": "t" not in _depends(system),
        },
        arrays,
    )


def parameter_rows(parameters: Mapping[str, Parameter]) -> list[dict[str, Any]]:
    """Parameters for a page, with their units, meanings, and the ends of their sliders."""
    found = []
    for name, p in parameters.items():
        admissible = parse_range(p.range, f"parameters.{name}")
        low, high = _slider(p.default, admissible.low, admissible.high, admissible.closed)
        shown = "" if p.range == "(-inf, inf)" else p.range.replace("inf", "∞")
        found.append(
            {
                "name": name,
                "symbol": str(name_in_html(name)),
                "value": p.default,
                "unit": unicode_unit(p.unit),
                "meaning": p.meaning,
                "range": shown,
                "low": low,
                "high": high,
                "step": _step(high - low),
            }
        )
    return found


def _slider(
    value: float, low: float, high: float, closed: tuple[bool, bool]
) -> tuple[float, float]:
    """Ends of a slider: those of the admissible range, or three times the value."""
    reach = 3.0 * abs(value) or 1.0
    first = low if math.isfinite(low) else -reach
    last = high if math.isfinite(high) else max(reach, first + reach)
    step = _step(last - first)
    # The end of an open interval is not an admissible value.
    if math.isfinite(low) and not closed[0]:
        first = low + step if low != 0.0 else step
    if math.isfinite(high) and not closed[1]:
        last = high - step
    return min(first, value), max(last, value)


def _step(width: float) -> float:
    """About 1/200 of a width, rounded to 1, 2 or 5 times a power of ten."""
    rough = width / _DIVISIONS or 1.0
    power = 10.0 ** math.floor(math.log10(rough))
    return next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= rough * 0.999)


def _functions(system: System, graphs: dict[str, list[float]]) -> list[dict[str, Any]]:
    found = []
    for kind, entries in (("function", system.functions), ("drive", system.drives)):
        for key, formula in entries.items():
            name, arguments = parse_signature(key, kind)
            text = formula if isinstance(formula, str | int | float) else None
            found.append(
                {
                    "name": name,
                    "signature": key,
                    "symbol": str(name_in_html(name)),
                    "arguments": ", ".join(map(str, map(name_in_html, arguments or ("t",)))),
                    "formula": "" if text is None else str(text),
                    "measured": text is None,
                    "over": graphs.get(name),
                }
            )
    return found


def _graphs(
    system: System, values: dict[str, float]
) -> tuple[dict[str, list[float]], dict[str, Array]]:
    """A small graph of each function of one variable: over the time for a drive, otherwise around
    the initial value of its argument."""
    ends: dict[str, list[float]] = {}
    arrays: dict[str, Array] = {}
    for key in [*system.functions, *system.drives]:
        name, arguments = parse_signature(key, "")
        if len(arguments) > 1:
            continue
        low, high = (-2.0, 2.0) if arguments else _some(system.span)
        at = np.linspace(low, high, _GRAPH)
        variable = arguments[0] if arguments else "t"
        called = f"{name}({variable})" if arguments else name
        try:
            curve = np.array([system.evaluate(called, {**values, variable: v}) for v in at])
        except (DeclarationError, ArithmeticError):
            continue  # it depends on something else, too
        if np.all(np.isfinite(curve)):
            ends[name] = [low, high]
            arrays[f"graph:{name}"] = curve
    return ends, arrays


def _some(span: tuple[float, float]) -> tuple[float, float]:
    return float(span[0]), float(span[1])


def _initial(system: System) -> list[dict[str, Any]]:
    found = []
    modes = {mode for body in system.declaration.bodies for mode in body}
    state = [x for x in system.declaration.state if x.removeprefix("d_") not in modes]
    for name in [*_starting(system), *state]:
        said = quantity(system, name)
        value = float(system.initial.get(name, 0.0))
        reach = 2.0 * max(abs(value), 0.5)
        found.append(
            {
                "name": name,
                "symbol": str(name_in_html(name)),
                "value": value,
                "unit": unicode_unit(said.get("units", "")),
                "meaning": said.get("long_name", ""),
                "low": -reach,
                "high": reach,
                "step": _step(2.0 * reach),
            }
        )
    return found


def _starting(system: System) -> list[str]:
    """Unknowns of structures, and their rates, that determine where a motion starts."""
    found: list[str] = []
    for name, part in system.written_structures.items() if system.structures else ():
        own = [key for key in part.structure.shown if part.index(key) in part.structure.own]
        found += [f"{prefix}{name}[{key}]" for prefix in ("", "d_") for key in own[:_MOST_UNKNOWNS]]
    return found


def _depends(system: System) -> set[str]:
    """Names that the texts of a system use; whether it is driven is a matter of display here."""
    texts = [str(system.potential), str(system.viscous), *map(str, system.drives.values())]
    return {"t"} if system.drives or any("*t" in text for text in texts) else set()
