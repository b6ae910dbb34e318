"""The long-term behaviour in the phase plane: equilibria with their kind, the limit cycle, and the
states at which contacts begin to slip."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import StickslipError
from stickslip.explorer.asking.answer import Answer
from stickslip.explorer.asking.request import Request
from stickslip.explorer.subject.systems import settled_cycle, shown_motion, system_of

if TYPE_CHECKING:
    from stickslip.explorer.work.loop import Cancellation
    from stickslip.motion.trajectory import Trajectory

_TURN = 1200  # number of samples of a cycle, besides its knots
_MOST = 2000  # largest number of points of a section


def long_run_in_plane(request: Request, cancellation: Cancellation) -> Iterator[Answer]:
    """Equilibria first, then the cycle, if there are any."""
    from stickslip.orbits.equilibria.finding import equilibria

    system, numbers = system_of(request.setting)
    motion = shown_motion(request.setting, cancellation)
    head: dict[str, Any] = {"part": "plane", "equilibria": [], "cycle": "", "notes": []}
    arrays = _section(motion)
    try:
        for found in equilibria(system, parameters=numbers):
            said = {"state": found.state, "stable": found.stable, "text": found.describe()}
            head["equilibria"].append(said)
    except StickslipError as error:
        head["notes"].append(f"Equilibria: {error}")
    yield Answer(head, arrays)
    cancellation.check()
    try:
        cycle = settled_cycle(request.setting, cancellation)
    except StickslipError as error:
        head["notes"].append(f"Cycle: {error}")
    else:
        rows = dict(cycle.summary().rows)
        said = [
            f"{name} {rows[name]}"
            for name in ("period", "drift", "stability", "multipliers")
            if name in rows
        ]
        head["cycle"] = f"cycle: {', '.join(said)}; {cycle.certificate.verdict}"
        arrays |= _turn(cycle.trajectory)
    yield Answer(head, arrays)


def _section(motion: Trajectory) -> dict[str, Array]:
    """States in which a contact begins to slip: points of a section of the motion."""
    begins = np.zeros(len(motion.knots.time), bool)
    for mode in motion.modes.values():
        begins[1:] |= (mode[:-1] == 0) & (mode[1:] != 0)
    states = motion.knots.state[np.flatnonzero(begins)[-_MOST:]]
    return {f"p:{name}": states[:, i] for i, name in enumerate(motion.final)}


def _turn(turn: Trajectory) -> dict[str, Array]:
    """Points over one period, including all switches."""
    knots = turn.knots.time
    times = np.union1d(np.linspace(knots[0], knots[-1], _TURN), knots)
    index = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 1)
    names = list(turn.final)
    return {f"c:{name}": values for name, values in turn.trace(names, times, index).items()}
