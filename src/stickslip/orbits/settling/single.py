"""The limit cycle of one motion: its state and period, or the reason why none was found."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.outcome import Outcome
from stickslip.motion.problem import Problem
from stickslip.motion.steps.arrays import NOW
from stickslip.orbits.fields.clock import Clock
from stickslip.orbits.fields.symmetry import Symmetry
from stickslip.orbits.settling.engine.tables import COUNT, DURATION
from stickslip.orbits.settling.motions import Block, Invariance, Settings

_ASIDE = 0.381966  # fraction of a period
_MOST_EVENTS = 1 << 60


@dataclass(frozen=True)
class Settled:
    """State of a motion that has settled or is abandoned.

    Attributes
    ----------
    outcome : Outcome
        ``PERIODIC``, ``AT_REST``, ``STEADY`` or ``UNDAMPED`` (proved), ``NOT_SETTLED`` (the limits
        came first), or why the motion ends.
    elapsed : float
        Time until then.
    time : float
        The same as an equivalent time: the drives are as they are then.
    state : array, shape (n,)
    period : float
        After which a cycle is there again.
    """

    outcome: Outcome
    elapsed: float
    time: float
    state: Array
    period: float


def settle_motion(
    problem: Problem,
    time: float,
    state: Array,
    symmetry: Symmetry,
    clock: Clock | None,
    settings: Settings | None = None,
) -> Settled:
    """Follow a motion until it has settled, as at every point of a map.

    Parameters
    ----------
    time : float
        When it starts.
    state : array, shape (n,)
    symmetry : Symmetry
        Symmetry of the system.
    clock : Clock or None
        Of its drives.
    settings : Settings, optional
    """
    values = problem.parameters
    period = clock.period(values) if symmetry.driven and clock is not None else 0.0
    parts = clock.parts if period > 0.0 and clock is not None else 1
    frame = symmetry.frame if symmetry.frame is not None else symmetry.turn / period
    shifts = np.linalg.qr(symmetry.shifts)[0].T
    crossed = symmetry.driven and bool(np.any(symmetry.turn))
    known = Invariance(shifts, frame, period, parts, symmetry.cells, crossed)
    block = Block(
        replace(problem, origin=time),
        np.array([list(values.values())]).reshape(1, -1),
        state[None],
        settings or Settings(),
        False,
        known=known,
    )
    block.settle()
    marks = block.marks
    layout, jumps = problem.compiled.layout, problem.compiled.equations.jumps
    leaps = bool(layout.gaps or jumps) and period == 0.0
    if leaps and marks.outcome[0] == Outcome.PERIODIC.code:
        _leave_event(block, _ASIDE * float(marks.real[0, DURATION]))
    since = float(block.saved.clock[0, NOW])
    set_back = 0.0 if block.rules.timed else max(int(marks.numbers[0, COUNT]) - 1, 0) * period
    return Settled(
        Outcome.from_code(int(marks.outcome[0])),
        since + set_back,
        time + since,
        block.saved.y[0],
        float(marks.real[0, DURATION]),
    )


def _leave_event(block: Block, later: float) -> None:
    """Move a settled motion away from the event at which it was compared: for a state on a guard,
    up to rounding, the side on which the motion continues may be undecided, which matters if the
    state jumps there.

    Parameters
    ----------
    block : Block
        Of one motion.
    later : float
        Time for which it is followed.
    """
    from stickslip.motion.steps.arrays import FINISHED, FULL

    lanes, saved = block.lanes, block.saved
    for part, kept in zip(lanes.now, saved, strict=True):
        part[:] = kept
    lanes.codes[:] = FULL
    lanes.advance(float(saved.clock[0, NOW]) + later, _MOST_EVENTS)
    if lanes.codes[0] == FINISHED:
        for part, kept in zip(saved, lanes.now, strict=True):
            part[:] = kept
