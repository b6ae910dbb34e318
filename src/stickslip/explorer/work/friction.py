"""Effective friction: the stable set K(t) of forces along a motion, and its average.

Friction that oscillates fast is, in the limit, that of the set of all forces that hold at every
phase (Mielke 2017, section 2): the intersection of all K(s), whose support function is Ψ_av. Motion
occurs at the phases whose boundaries the intersection touches.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.display.symbols import unicode_unit
from stickslip.errors import DeclarationError, StickslipError
from stickslip.explorer.asking.answer import Answer
from stickslip.explorer.asking.request import Request
from stickslip.explorer.subject.systems import settled_cycle, shown_motion
from stickslip.explorer.work.motion import force_lines
from stickslip.model.quantities import contact_key, quantity

if TYPE_CHECKING:
    from stickslip.explorer.work.loop import Cancellation
    from stickslip.motion.trajectory import Trajectory

_SAMPLES = 1600
_MOST = 6  # largest number of contacts that are shown


def effective_friction(request: Request, cancellation: Cancellation) -> Iterator[Answer]:
    """Thresholds and forces over one period of the limit cycle, or over the second half of the
    motion if it does not repeat.

    Raises
    ------
    DeclarationError
        If no contact is dry.
    """
    motion, about = _settled(request, cancellation)
    system = motion.system
    modes = motion.modes
    shown = [
        (part, force_lines(parts, part), modes[contact_key(name)])
        for name, parts in system.frictional.items()
        for part in parts
        if contact_key(name) in modes
    ]
    if not shown:
        raise DeclarationError("", "this system has no dry contacts", "Choose another system")
    knots = motion.knots.time
    start = knots[0] if about["period"] else (knots[0] + knots[-1]) / 2.0
    times = np.union1d(np.linspace(start, knots[-1], _SAMPLES), knots[knots >= start])
    index = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 1)
    contacts: list[dict[str, Any]] = []
    arrays = {"t": times - times[0]}
    for name, names, mode in shown[:_MOST]:
        key = contact_key(name)
        traced = motion.trace(list(dict.fromkeys(names)), times, index)
        force, plus, minus = (traced[line] for line in names)
        arrays |= {
            f"force:{key}": -force,
            f"plus:{key}": plus,
            f"minus:{key}": minus,
            f"mode:{key}": mode[index].astype(np.int32),
        }
        unit = unicode_unit(quantity(system, names[0]).get("units", ""))
        slips = mode[index] != 0
        contacts.append(
            {
                "key": key,
                "name": name,
                "unit": unit,
                "plus": float(plus.min()),
                "minus": float(minus.min()),
                "plus_at": float(times[plus.argmin()] - times[0]),
                "minus_at": float(times[minus.argmin()] - times[0]),
                "mean": float((plus.mean() + minus.mean()) / 2.0),
                "slips": float(np.mean(slips)),
            }
        )
    yield Answer({"part": "friction", **about, "contacts": contacts, "samples": len(times)}, arrays)


def _settled(request: Request, cancellation: Cancellation) -> tuple[Trajectory, dict[str, Any]]:
    """The motion to show, and its description."""
    motion = shown_motion(request.setting, cancellation)
    unit = unicode_unit(motion.system.time_unit)
    try:
        cycle = settled_cycle(request.setting, cancellation)
    except StickslipError:
        return motion, {"period": None, "time_unit": unit}
    return cycle.trajectory, {"period": cycle.period, "time_unit": unit}
