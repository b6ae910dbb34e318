"""The motion of a system: its curves, stick phases and animation, then its certificate."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arrays import Array
from stickslip.display.symbols import unicode_symbol, unicode_unit
from stickslip.display.system_page import name_in_html
from stickslip.errors import DeclarationError
from stickslip.explorer.asking.answer import Answer
from stickslip.explorer.asking.request import Request
from stickslip.explorer.drawings.draw import scene_of
from stickslip.explorer.subject.pixels import seen_times
from stickslip.explorer.subject.results import verdict
from stickslip.explorer.subject.systems import shown_motion
from stickslip.model.quantities import contact_key, quantity

if TYPE_CHECKING:
    from stickslip.explorer.work.loop import Cancellation
    from stickslip.model.system import System
    from stickslip.motion.trajectory import Trajectory

_MOST_LINES = 40  # largest number of lines that are sent to a page
_SOON = 0.04  # seconds to wait for a request of a newer motion before this one is certified
_STICKS = 0


def move(request: Request, cancellation: Cancellation) -> Iterator[Answer]:
    """The motion of a page; then, unless there is a newer request, its certificate."""
    motion = shown_motion(request.setting, cancellation)
    yield _seen(motion, _window(request, motion))
    if request.options.get("window") is None:
        cancellation.pause(_SOON)
        yield Answer(verdict(motion))


def _window(request: Request, motion: Trajectory) -> tuple[float, float] | None:
    """The requested time interval, if any."""
    given = request.options.get("window")
    if given is None:
        return None
    first, last = float(motion.knots.time[0]), float(motion.knots.time[-1])
    if not (isinstance(given, list) and len(given) == 2):
        raise DeclarationError("window", "not a time window", "Zoom to a part of the motion")
    low, high = (min(max(float(end), first), last) for end in given)
    if not low < high:
        raise DeclarationError(
            "window",
            "the window does not contain any part of the motion",
            "Zoom to a part of the motion",
        )
    return low, high


def _seen(motion: Trajectory, window: tuple[float, float] | None) -> Answer:
    """Curves of a motion."""
    about = lines_of(motion.system, tuple(motion.final), tuple(motion.modes))
    names = list(about["symbols"])
    times, index, values = seen_times(motion, names, window)
    arrays: dict[str, Array] = {"t": times, **{f"q:{name}": v for name, v in values.items()}}
    arrays |= {f"mode:{key}": mode[index].astype(np.int32) for key, mode in motion.modes.items()}
    arrays |= stick_phases(motion)
    head: dict[str, Any] = {
        "part": "motion",
        "span": list(motion.t_span),
        "end": float(motion.knots.time[-1]),
        "window": list(window) if window else None,
        "outcome": motion.outcome.label,
        "complete": motion.outcome.ok,
        "message": motion.message,
        "warnings": motion.warnings,
        "switches": motion.n_switches,
        "seconds": motion.wall_time,
        **about,
    }
    if window is None:
        scene = scene_of(motion, times, {**values, **_modes(arrays)})
        head["scene"], more = scene.packed()
        arrays |= more
    return Answer(head, arrays)


def _modes(arrays: dict[str, Array]) -> dict[str, Array]:
    return {f"mode_{k[5:]}": v for k, v in arrays.items() if k.startswith("mode:")}


@lru_cache(maxsize=32)
def lines_of(system: System, states: tuple[str, ...], contacts: tuple[str, ...]) -> dict[str, Any]:
    """Lines drawn for all motions of a system, with their symbols; cached, since dragging a slider
    requests them repeatedly."""
    groups = _groups(system, states, contacts)
    names = list(dict.fromkeys(name for group in groups for name in group["names"]))
    return {
        "groups": groups,
        "states": list(states),
        "symbols": {name: str(name_in_html(name)) for name in names},
        "units": {name: unit_of(system, name) for name in names},
        "plain": {name: unicode_symbol(name) for name in names},
        "time_unit": unicode_unit(system.time_unit),
    }


def unit_of(system: System, name: str) -> str:
    """The unit of a quantity, in printed form."""
    return unicode_unit(quantity(system, name).get("units", ""))


def _groups(
    system: System, known: tuple[str, ...], contacts: tuple[str, ...]
) -> list[dict[str, Any]]:
    """Groups of lines: quantities of the same kind and unit, and each friction force with its
    thresholds."""
    coordinates = system.places
    rates = [r for r in (f"d_{x}" for x in coordinates) if r in known or r in system.unknowns]
    modes = {x for own in system.declaration.bodies for q in own for x in (q, f"d_{q}")}
    others = [name for name in known if name not in {*coordinates, *rates, *modes}]
    groups: list[dict[str, Any]] = []
    for kind, names in (
        ("coordinate", coordinates),
        ("rate", rates),
        ("internal", [*others, *system.outputs]),
    ):
        by_unit: dict[str, list[str]] = {}
        for name in names[:_MOST_LINES]:
            by_unit.setdefault(unit_of(system, name), []).append(name)
        groups += [{"kind": kind, "names": own, "unit": unit} for unit, own in by_unit.items()]
    for contact, parts in system.frictional.items():
        key = contact_key(contact)
        if key not in contacts or len(groups) > _MOST_LINES:
            continue
        for part in parts:
            names = force_lines(parts, part)
            group = {"kind": "friction", "names": names, "unit": unit_of(system, names[0])}
            groups.append(group | {"contact": key, "key": contact_key(part), "title": part})
    return groups


def force_lines(parts: tuple[str, ...], part: str) -> list[str]:
    """The force of a contact, or of a component of one in a plane, and its thresholds for both
    directions."""
    key = contact_key(part)
    if len(parts) > 1:
        return [f"friction_{key}", f"threshold_{key}", f"threshold_{key}"]
    return [f"friction_{key}", f"threshold_plus_{key}", f"threshold_minus_{key}"]


def stick_phases(motion: Trajectory) -> dict[str, Array]:
    """Exact starts and ends of the stick phases of each contact, and of those in which all stick;
    and all switches."""
    knots = motion.knots.time
    found: dict[str, Array] = {}
    every = np.ones(len(knots), bool)
    changes = np.zeros(len(knots), bool)
    for key, mode in motion.modes.items():
        sticks = mode == _STICKS
        every &= sticks
        changes[1:] |= mode[1:] != mode[:-1]
        found[f"stick:{key}"] = _runs(knots, sticks)
    if motion.modes:
        found["stick"] = _runs(knots, every)
    found["switches"] = knots[changes]
    return found


def _runs(knots: Array, holds: Array) -> Array:
    """Starts and ends of the intervals in which a condition on knots holds, flattened."""
    padded = np.concatenate([[False], holds[:-1], [False]]).astype(np.int8)
    edges = np.flatnonzero(np.diff(padded))
    return knots[edges]
