"""Sweeps that carry the state: what a motion settles on while a parameter is changed step by step,
as in an experiment.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from stickslip.arrays import Array
from stickslip.equations.derive import derive
from stickslip.errors import ConvergenceError, DeclarationError
from stickslip.model.system import System
from stickslip.motion.problem import Problem, pose
from stickslip.orbits.cycles.cycle import Cycle, find_cycle
from stickslip.orbits.fields.stable_set import settle_friction
from stickslip.orbits.fields.symmetry import clock
from stickslip.orbits.return_map.shooting import follow_freely


def carried(
    system: System,
    parameter: str,
    values: Sequence[float],
    *,
    parameters: Mapping[str, float] | None = None,
    initial: Mapping[str, float] | None = None,
    progress: Callable[[int], None] | None = None,
) -> list[Cycle | str]:
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

    Returns
    -------
    list of Cycle or str
        Where there is no cycle, why; the next motion goes on from where that one came to.
    """
    found: list[Cycle | str] = []
    state: Array | None = None
    time = system.span[0]
    phase = 0.0
    for i, value in enumerate(values):
        if progress is not None:
            progress(i)
        problem = pose(system, {**(parameters or {}), parameter: float(value)})
        period = _period(problem)
        if state is None:
            state = problem.initial_state(initial or {})
            phase = time / period if period else 0.0
        start = phase * period if period else time
        settle_friction(derive(system.declaration), problem.parameters, state[None], start)
        # A motion, and not its start: what is near the start may be a cycle that repels.
        length = period or 0.05 * (system.span[1] - system.span[0])
        motion = follow_freely(problem, start, start + length, state)
        try:
            cycle = find_cycle(system, motion)
        except ConvergenceError as failure:
            found.append(str(failure))
            state, time = motion.knots.state[-1].copy(), float(motion.knots.time[-1])
        else:
            found.append(cycle)
            state, time = cycle.closed.orbit.legs[0].place.state.copy(), cycle.time
            if period:
                # Whole periods of the drives are left out, with what makes up for them.
                whole = math.floor(time / period)
                state -= whole / cycle.closed.shooting.setting.turns * cycle.closed.orbit.shift
        phase = math.fmod(time, period) / period if period else 0.0
    return found


def _period(problem: Problem) -> float:
    """Period of the drives; 0 if none of them repeats."""
    equations = problem.compiled.equations
    if not equations.timed:
        return 0.0
    try:
        return clock(problem.system, equations, problem.parameters).period(problem.parameters)
    except DeclarationError:
        return 0.0
