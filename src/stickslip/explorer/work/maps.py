"""A map over two parameters, coarse at first and then finer."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.display.symbols import unicode_unit
from stickslip.errors import DeclarationError, short, suggestion
from stickslip.explorer.asking.answer import Answer
from stickslip.explorer.asking.request import Request
from stickslip.explorer.subject.systems import system_of
from stickslip.explorer.work.export import model_of

if TYPE_CHECKING:
    from stickslip.explorer.work.loop import Cancellation

_ROUNDS = (9, 17, 33, 65)  # points along each axis
_GOES_ON = 200  # number of values per axis in the command that continues the map


def fill_map(request: Request, cancellation: Cancellation) -> Iterator[Answer]:
    """Maps on finer and finer grids.

    Raises
    ------
    DeclarationError
        If an axis or the measure is none.
    """
    from stickslip.motion.outcome import Outcome
    from stickslip.sweeps.request.scales import colour_scale
    from stickslip.sweeps.request.user_measures import offered_measures
    from stickslip.sweeps.sweep import sweep

    system, numbers = system_of(request.setting)
    own = system.configure(numbers)
    axes = [
        (request.text(k), request.number(f"{k}_low", 0.0), request.number(f"{k}_high", 1.0))
        for k in "xy"
    ]
    if axes[0][0] == axes[1][0]:
        raise DeclarationError("map", "the two axes are the same", "Choose two parameters")
    measure = request.text("measure", "amplitude")
    # Names only: otherwise the library would also read Python files.
    if measure not in (known := offered_measures(own)):
        raise DeclarationError(
            "measure", f"unknown measure '{short(measure)}'", suggestion(measure, known)
        )
    for count in _ROUNDS:
        over = {name: f"{low!r}:{high!r}:{count}" for name, low, high in axes}
        found = sweep(
            own, over, [measure], initial=dict(request.setting.initial) or None, workers=1,
            progress=lambda state, count=count: cancellation.progress(
                {"part": "progress", "share": state.done / state.total, "points": count}
            ),
        )  # fmt: skip
        data = found.dataset
        (x, *_), (y, *_) = axes
        values = data[measure].transpose(y, x)
        outcome = data["outcome"].transpose(y, x)
        said = values.attrs
        scale = colour_scale(measure, values.values, said)
        codes = np.unique(outcome.values)
        head: dict[str, Any] = {
            "part": "map",
            "final_round": count == _ROUNDS[-1],
            "x": x,
            "y": y,
            "count": count,
            "measure": measure,
            "scale": {"low": scale.low, "high": scale.high, "kind": scale.kind},
            "unit": unicode_unit(str(said.get("units", ""))),
            "meaning": str(said.get("long_name", measure)),
            "outcomes": {int(c): Outcome.from_code(int(c)).label for c in codes},
            "verdict": found.certificate.verdict,
            "command": _command(request, axes, measure),
        }
        yield Answer(
            head,
            {
                "x": np.asarray(data[x].values, float),
                "y": np.asarray(data[y].values, float),
                "values": np.ascontiguousarray(values.values, float).ravel(),
                "outcome": np.ascontiguousarray(outcome.values, np.int32).ravel(),
            },
        )


def offer_measures(request: Request, cancellation: Cancellation) -> Iterator[Answer]:
    """Measures that a map may show, the most common ones first."""
    from stickslip.sweeps.request.user_measures import offered_measures

    system, _ = system_of(request.setting)
    known = offered_measures(system)
    likely = "speed" if system.translation and "speed" in known else "amplitude"
    first = [likely] if likely in known else []
    names = [*first, *(name for name in known if name not in first)]
    found = [{"name": name, "meaning": known[name]["long_name"]} for name in names]
    yield Answer({"part": "measures", "measures": found})


def _command(request: Request, axes: list[tuple[str, float, float]], measure: str) -> str:
    """The command of the same map with a finer grid."""
    words = ["stickslip", "sweep", model_of(request.setting)]
    over = {name for name, _, _ in axes}
    for name, value in request.setting.values.items():
        if name not in over:
            words += ["--set", f"{name}={value}"]
    for name, value in request.setting.initial.items():
        words += ["--initial", f"{name}={value!r}"]
    for name, low, high in axes:
        words += ["--over", f"{name}={low!r}:{high!r}:{_GOES_ON}"]
    return shlex.join([*words, "--measure", measure, "--out", f"{measure.split(':')[0]}.zarr"])
