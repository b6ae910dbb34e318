"""Data compared with a motion: residuals, and parameters of the best fit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.explorer.asking.answer import Answer
from stickslip.explorer.asking.request import Request
from stickslip.explorer.subject.results import verdict
from stickslip.explorer.subject.systems import shown_motion, system_of

if TYPE_CHECKING:
    from stickslip.explorer.work.loop import Cancellation

_MOST = 20_000  # rows of data
_MOST_FREE = 8  # parameters of a fit
_STARTS = 4


def compare_data(request: Request, cancellation: Cancellation) -> Iterator[Answer]:
    """Residuals of data at their own times; with the option ``free`` a fit of these parameters."""
    times, values, name = _given(request)
    free = request.options.get("free")
    if free:
        yield from _fitted(request, cancellation, times, values, name)
        return
    motion = shown_motion(request.setting, cancellation)
    inside = (times >= motion.knots.time[0]) & (times <= motion.knots.time[-1])
    if not inside.any():
        raise DeclarationError(
            "data",
            "none of the times is in the motion",
            "Choose the column of times, or extend the motion",
        )
    if name not in {*motion.final, *motion.row_of, *motion.system.outputs}:
        raise DeclarationError(
            "data", f"unknown quantity '{name}'", "Choose a quantity of the motion"
        )
    expected = motion.at(times[inside])[name]
    residual = values[inside] - expected
    spread = float(np.sqrt(np.mean((values[inside] - values[inside].mean()) ** 2)))
    root = float(np.sqrt(np.mean(residual**2)))
    head = {
        "part": "residual",
        "root": root,
        "largest": float(np.abs(residual).max()),
        "explained": 1.0 - (root / spread) ** 2 if spread > 0.0 else None,
        "used": int(inside.sum()),
        "of": len(times),
    }
    yield Answer(head, {"t": times[inside], "residual": residual})


def _fitted(
    request: Request, cancellation: Cancellation, times: Array, values: Array, name: str
) -> Iterator[Answer]:
    from stickslip.fitting.making import fit

    system, numbers = system_of(request.setting)
    free = request.options.get("free")
    if not (isinstance(free, list) and all(isinstance(x, str) for x in free)):
        raise DeclarationError("free", "these are not names", "Choose parameters")
    if len(free) > _MOST_FREE:
        raise DeclarationError(
            "free", f"{len(free)} parameters are too many", f"Choose at most {_MOST_FREE}"
        )
    found = fit(
        system,
        {"t": times, name: values},
        free,
        parameters=numbers,
        initial=dict(request.setting.initial) or None,
        starts=_STARTS,
        progress=cancellation.check,
    )
    said: dict[str, Any] = verdict(found)
    best = {key: value for key, value in found.estimate.items() if key in free}
    ends = {key: list(map(float, found.interval[key])) for key in best}
    yield Answer({**said, "part": "fit", "values": best, "intervals": ends})


def _given(request: Request) -> tuple[Array, Array, str]:
    """Times and values, ascending in time."""
    columns = []
    for key in ("times", "values"):
        column = request.options.get(key)
        if not isinstance(column, list) or len(column) > _MOST:
            raise DeclarationError(
                "data", f"the {key} are not a list of at most {_MOST:,} entries", "Drop a CSV file"
            )
        try:
            columns.append(np.array(column, float))
        except (TypeError, ValueError, OverflowError):
            raise DeclarationError(
                "data", f"the {key} are not all numbers", "Choose other columns"
            ) from None
    times, values = columns
    good = (
        np.isfinite(times) & np.isfinite(values) if len(times) == len(values) else np.zeros(0, bool)
    )
    if not good.any():
        raise DeclarationError("data", "the columns have no numbers", "Choose other columns")
    order = np.argsort(times[good], kind="stable")
    return times[good][order], values[good][order], request.text("quantity")
