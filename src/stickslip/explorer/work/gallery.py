"""Figures of the catalogue, one for each system."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from stickslip import catalogue
from stickslip.errors import StickslipError
from stickslip.explorer.asking.answer import Answer
from stickslip.explorer.asking.request import Request
from stickslip.explorer.drawings.draw import scene_of
from stickslip.motion.simulate import simulate

if TYPE_CHECKING:
    from stickslip.explorer.work.loop import Cancellation

_PLACE = 0.37  # position in a short motion at which it is drawn, as a fraction of it
_PART = 0.15  # length of it as a fraction of the usual span


def draw_gallery(request: Request, cancellation: Cancellation) -> Iterator[Answer]:
    """A figure, a title and a source for every system of the catalogue."""
    for name in catalogue.names():
        cancellation.check()
        system = catalogue.get(name)
        said = {"name": name, "title": system.title or name, "source": system.source}
        start, end = map(float, system.span)
        try:
            motion = simulate(system, (start, start + _PART * (end - start)), max_events=2000)
        except StickslipError:
            yield Answer(said)
            continue
        knots = motion.knots.time
        at = np.linspace(knots[0], knots[-1], 64)
        index = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(knots) - 1)
        values = motion.trace([*motion.final, *system.unknowns], at, index)
        scene, arrays = scene_of(motion, at, values).packed()
        here = int(_PLACE * len(at))
        small = {key: values[here : here + 1] for key, values in arrays.items()}
        modes = {
            f"mode:{key}": m[index][here : here + 1].astype(np.int32)
            for key, m in motion.modes.items()
        }
        yield Answer({**said, "scene": scene}, small | modes)
