"""Sweeps that carry the state: what a motion settles on while a parameter is changed step by step,
as in an experiment.

Frequency responses ask for the cycle; maps, which carry the state in the same way
(:mod:`stickslip.sweeps.work.handed`), measure what motions settle on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

from stickslip.equations.derive import derive
from stickslip.errors import ConvergenceError
from stickslip.model.system import System
from stickslip.motion.problem import pose
from stickslip.orbits.cycles.cycle import Cycle, find_cycle
from stickslip.orbits.fields.stable_set import settle_friction
from stickslip.orbits.return_map.shooting import follow_freely
from stickslip.sweeps.work.handed import Handed, handed_on, period_of_drives, taken_up


def carried(
    system: System,
    parameter: str,
    values: Sequence[float],
    *,
    parameters: Mapping[str, float] | None = None,
    initial: Mapping[str, float] | None = None,
    progress: Callable[[int], None] | None = None,
) -> Iterator[Cycle | str]:
    """The cycles that a motion settles on while a parameter takes one value after the other.

    Each motion goes on from the state of the last one, at the same phase of the drives.

    Parameters
    ----------
    system : System
    parameter : str
    values : sequence of float
        In the order in which they are taken.
    parameters : mapping of str to float, optional
        Values of the others.
    initial : mapping of str to float, optional
        State of the first motion; by default the declared one.
    progress : callable, optional
        Called with the number of each value before it is taken.

    Yields
    ------
    Cycle or str
        Where there is no cycle, why; the next motion goes on from where that one came to.
    """
    handed: Handed | None = None
    for i, value in enumerate(values):
        if progress is not None:
            progress(i)
        problem = pose(system, {**(parameters or {}), parameter: float(value)})
        own = problem.parameters
        if handed is None:
            state, start = problem.initial_state(initial or {}), system.span[0]
            settle_friction(derive(system.declaration), own, state[None], start)
        else:
            start, state = taken_up(system, handed, own)
        # A motion, and not its start: what is near the start may be a cycle that repels.
        length = period_of_drives(system, own) or 0.05 * (system.span[1] - system.span[0])
        motion = follow_freely(problem, start, start + length, state)
        try:
            cycle = find_cycle(system, motion)
        except ConvergenceError as failure:
            last = motion.knots
            handed = handed_on(system, own, float(last.time[-1]), last.state[-1])
            yield str(failure)
        else:
            place = cycle.closed.orbit.legs[0].place.state
            rate = cycle.closed.orbit.shift / cycle.period
            handed = handed_on(system, own, cycle.time, place, rate)
            yield cycle
