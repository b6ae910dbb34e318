"""Branches over a parameter: of equilibria, and of the cycle that the motion settles on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.display.symbols import unicode_unit
from stickslip.errors import StickslipError
from stickslip.explorer.asking.answer import Answer
from stickslip.explorer.asking.request import PageSetting, Request
from stickslip.explorer.subject.systems import shown_motion, system_of, values_of

if TYPE_CHECKING:
    from stickslip.explorer.work.loop import Patience
    from stickslip.orbits.continuation.branch import Branch

_STEP_APART = 1e-9  # of a range, by which its ends are kept off the value in the middle


def follow_branches(request: Request, patience: Patience) -> Iterator[Answer]:
    """One branch after the other, each as soon as it is there; what there is not is said."""
    parameter = request.text("over")
    system, numbers = system_of(request.setting)
    system.declaration.check_range(parameter, values_of(system, numbers).get(parameter, 0.0))
    value = values_of(system, numbers)[parameter]
    span = (request.number("low", 0.5 * value), request.number("high", 2.0 * value))
    for name, follow in (("equilibria", _equilibria), ("cycles", _cycles)):
        patience.check()
        try:
            branch = follow(request.setting, parameter, span, patience)
        except StickslipError as error:
            yield Answer({"part": "note", "text": f"{name}: {error}"})
            continue
        yield described_branch(branch, name)
    yield Answer({"part": "end"})


def described_branch(branch: Branch, name: str) -> Answer:
    """A branch as it says itself what it holds: every variable that has one value at each point,
    with its unit and its meaning."""
    data = branch.dataset
    arrays = {}
    variables = {}
    for key, variable in data.data_vars.items():
        if variable.dims != (branch.along,) or variable.dtype.kind not in "fiub":
            continue
        arrays[f"b:{key}"] = np.asarray(variable.values, float)
        said = variable.attrs
        unit = unicode_unit(str(said.get("units", "")))
        variables[str(key)] = {"unit": unit, "meaning": str(said.get("long_name", ""))}
    special: list[dict[str, Any]] = [
        {"kind": s.kind, "value": s.value, "index": s.index, "text": s.describe()}
        for s in branch.special
    ]
    head = {
        "part": "branch",
        "name": name,
        "over": branch.parameter,
        "variables": variables,
        "states": list(branch.system.declaration.state),
        "special": special,
        "certified": branch.certificate.ok,
        "verdict": branch.certificate.verdict,
        "ended": branch.ended,
    }
    return Answer(head, arrays)


Follow = Callable[[PageSetting, str, tuple[float, float], "Patience"], "Branch"]


def _equilibria(
    setting: PageSetting, parameter: str, span: tuple[float, float], patience: Patience
) -> Branch:
    from stickslip.orbits.branches.equilibrium_branch import continue_equilibrium

    system, numbers = system_of(setting)
    return continue_equilibrium(system, parameter, span, parameters=numbers)


def _cycles(
    setting: PageSetting, parameter: str, span: tuple[float, float], patience: Patience
) -> Branch:
    from stickslip.orbits.branches.cycle_branch import continue_cycle
    from stickslip.orbits.cycles.cycle import find_cycle

    system, numbers = system_of(setting)
    motion = shown_motion(setting, patience)
    cycle = find_cycle(system, motion if motion.outcome.ok else None, parameters=numbers)
    value = cycle.parameters[parameter]
    apart = _STEP_APART * (span[1] - span[0])
    around = (min(span[0], value - apart), max(span[1], value + apart))
    return continue_cycle(cycle, parameter, around)
