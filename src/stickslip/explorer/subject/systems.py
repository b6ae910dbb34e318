"""The systems and motions of pages, cached: dragging a slider requests the same ones repeatedly."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import TYPE_CHECKING

from stickslip import catalogue
from stickslip.errors import DeclarationError, short
from stickslip.explorer.asking.limits import EVENTS_OF_A_PAGE
from stickslip.explorer.asking.request import PageSetting
from stickslip.model.formats.toml import parse
from stickslip.model.system import System
from stickslip.model.system_file import loads

if TYPE_CHECKING:
    from stickslip.explorer.work.loop import Cancellation
    from stickslip.motion.trajectory import Trajectory
    from stickslip.orbits.cycles.cycle import Cycle

_KEPT = 8  # number of motions that are kept
_MOTIONS: dict[tuple[object, ...], Trajectory] = {}


def system_of(setting: PageSetting) -> tuple[System, dict[str, float]]:
    """The system of a page, and the parameters that differ from its defaults.

    Raises
    ------
    DeclarationError
        If there is no such model, or it is invalid.
    """
    system = _declared(setting.model, setting.toml)
    numbers = {n: v for n, v in setting.values.items() if n in system.parameters}
    formulas = {n: v for n, v in setting.values.items() if n not in system.parameters}
    for name, value in numbers.items():
        if isinstance(value, str):
            raise DeclarationError(
                name, f"'{short(value)}' is not a number", "Enter a number, like 0.5"
            )
    if formulas:
        system = _configured(setting.model, setting.toml, tuple(sorted(formulas.items())))
    return system, {name: float(value) for name, value in numbers.items()}


def shown_motion(setting: PageSetting, cancellation: Cancellation) -> Trajectory:
    """The motion of a page.

    Raises
    ------
    DeclarationError
        If the setting is wrong.
    """
    key = (
        setting.model,
        setting.toml,
        tuple(sorted(setting.values.items())),
        tuple(sorted(setting.initial.items())),
        setting.until,
    )
    if (found := _MOTIONS.get(key)) is None:
        from stickslip.motion.simulate import simulate

        system, numbers = system_of(setting)
        found = simulate(
            system,
            shown_span(system, setting),
            initial=setting.initial,
            parameters=numbers,
            max_events=EVENTS_OF_A_PAGE,
            progress=cancellation.check,
        )
        while len(_MOTIONS) >= _KEPT:
            del _MOTIONS[next(iter(_MOTIONS))]
        _MOTIONS[key] = found
    return found


def settled_cycle(setting: PageSetting, cancellation: Cancellation) -> Cycle:
    """The cycle to which the motion of a page converges.

    Raises
    ------
    StickslipError
        If there is no such model.
    """
    from stickslip.orbits.cycles.find_cycle import find_cycle

    system, numbers = system_of(setting)
    motion = shown_motion(setting, cancellation)
    return find_cycle(system, motion if motion.outcome.ok else None, parameters=numbers)


def shown_span(system: System, setting: PageSetting) -> tuple[float, float]:
    """The time span of a page."""
    return system.span if setting.until is None else (float(system.span[0]), setting.until)


def values_of(system: System, given: Mapping[str, float]) -> dict[str, float]:
    """All parameters of a system."""
    return {**system.values, **given}


@lru_cache(maxsize=64)
def _declared(model: str, toml: str) -> System:
    if toml:
        check_no_files(toml)
        return loads(toml, "model file")
    return catalogue.get(model)


@lru_cache(maxsize=64)
def _configured(model: str, toml: str, formulas: tuple[tuple[str, float | str], ...]) -> System:
    return _declared(model, toml).configure(dict(formulas))


def check_no_files(toml: str) -> None:
    """Reject a model that would read a file of this machine: it came from a page."""
    read = {"drives": ("file",), "structures": ("mass", "stiffness", "damping")}
    declared = parse(toml)
    for section, keys in read.items():
        entries = declared.get(section, {})
        for name, entry in entries.items() if isinstance(entries, dict) else ():
            if isinstance(entry, dict) and any(isinstance(entry.get(key), str) for key in keys):
                raise DeclarationError(
                    f"{section}.{name}",
                    "a model entered in the page cannot read files",
                    "Open the explorer with the model file: stickslip explore mine.toml",
                )
