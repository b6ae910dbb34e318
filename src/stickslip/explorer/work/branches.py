"""Branches of equilibria and of the limit cycle in a parameter: sent point by point while they
are followed, and completely when they have been measured."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from stickslip.errors import StickslipError
from stickslip.explorer.asking.answer import Answer
from stickslip.explorer.asking.request import PageSetting, Request
from stickslip.explorer.subject.results import curves_of
from stickslip.explorer.subject.systems import settled_cycle, system_of, values_of

if TYPE_CHECKING:
    from stickslip.explorer.work.loop import Cancellation
    from stickslip.orbits.continuation.branch import Branch
    from stickslip.orbits.continuation.driver import PointOnTheWay, Tell

_STEP_APART = 1e-9  # fraction of a range by which its ends differ from the value in the middle
_EVERY = 0.04  # seconds between two messages with new points


def follow_branches(request: Request, cancellation: Cancellation) -> Iterator[Answer]:
    """Follow the branches sequentially; a missing one is reported."""
    parameter = request.text("over")
    system, numbers = system_of(request.setting)
    system.declaration.check_range(parameter, values_of(system, numbers).get(parameter, 0.0))
    value = values_of(system, numbers)[parameter]
    span = (request.number("low", 0.5 * value), request.number("high", 2.0 * value))
    for name, follow in FOLLOWED.items():
        cancellation.check()
        coming = _PointStream(name, parameter, cancellation)
        try:
            branch = follow(request.setting, parameter, span, cancellation, coming)
        except StickslipError as error:
            yield Answer({"part": "note", "name": name, "text": f"{name}: {error}"})
            continue
        yield curves_of(branch, name)


class _PointStream:
    """Send new points to the page in batches.

    Parameters
    ----------
    name, over : str
        Names of the branch and of its parameter.
    """

    def __init__(self, name: str, over: str, cancellation: Cancellation) -> None:
        self._head = {"part": "points", "name": name, "over": over}
        self._patience = cancellation
        self._points: list[PointOnTheWay] = []
        self._due = 0.0

    def __call__(self, point: PointOnTheWay) -> None:
        """Take a new point."""
        self._patience.check()
        self._points.append(point)
        if time.monotonic() < self._due:
            return
        said = [{"side": p.side, "values": p.values} for p in self._points]
        self._patience.progress({**self._head, "points": said})
        self._points.clear()
        self._due = time.monotonic() + _EVERY


Follow = Callable[[PageSetting, str, tuple[float, float], "Cancellation", "Tell"], "Branch"]


def _equilibria(
    setting: PageSetting,
    parameter: str,
    span: tuple[float, float],
    cancellation: Cancellation,
    tell: Tell,
) -> Branch:
    from stickslip.orbits.branches.equilibrium_branch import continue_equilibrium

    system, numbers = system_of(setting)
    return continue_equilibrium(system, parameter, span, parameters=numbers, progress=tell)


def _cycles(
    setting: PageSetting,
    parameter: str,
    span: tuple[float, float],
    cancellation: Cancellation,
    tell: Tell,
) -> Branch:
    from stickslip.orbits.branches.cycle_branch import continue_cycle

    cycle = settled_cycle(setting, cancellation)
    value = cycle.parameters[parameter]
    apart = _STEP_APART * (span[1] - span[0])
    around = (min(span[0], value - apart), max(span[1], value + apart))
    return continue_cycle(cycle, parameter, around, progress=tell)


FOLLOWED: dict[str, Follow] = {"equilibria": _equilibria, "cycles": _cycles}
"""What is followed, in this order, each under the name that the page shows."""
