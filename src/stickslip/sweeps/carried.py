"""Sweeps that carry the state: what a motion settles on while a parameter is changed step by step,
as in an experiment.

A motion hands on where it has come to (:func:`handed_on`), and the next one, with other parameters,
takes that up at the same phase of the drives (:func:`taken_up`). Maps follow motions so until they
have settled, frequency responses ask for the cycle.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.derive import derive
from stickslip.errors import ConvergenceError, DeclarationError
from stickslip.model.system import System
from stickslip.motion.problem import pose
from stickslip.orbits.cycles.cycle import Cycle, find_cycle
from stickslip.orbits.fields.stable_set import settle_friction
from stickslip.orbits.fields.symmetry import clock
from stickslip.orbits.return_map.shooting import follow_freely
from stickslip.orbits.settling.repetition import Repetition, repeats

_ROUNDED = 1e-3  # of where a component is, that it would have moved by: less is rounding


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
            found.append(str(failure))
            last = motion.knots
            handed = handed_on(system, own, float(last.time[-1]), last.state[-1])
        else:
            found.append(cycle)
            place = cycle.closed.orbit.legs[0].place.state
            rate = cycle.closed.orbit.shift / cycle.period
            handed = handed_on(system, own, cycle.time, place, rate)
    return found


@dataclass(frozen=True)
class Handed:
    """Where a motion has come to.

    Attributes
    ----------
    parameters : dict of str to float
        Of that motion.
    time : float
    state : array, shape (n,)
    """

    parameters: Mapping[str, float]
    time: float
    state: Array


def handed_on(
    system: System,
    parameters: Mapping[str, float],
    time: float,
    state: Array,
    rate: Array | None = None,
) -> Handed:
    """Where a motion has come to, as early as the system is the same.

    A load Vt would jump by ΔV·t when V changes, and what drifts would be ever farther away. So the
    state is taken back, with the frame in which the system goes on repeating itself, to where time
    begins: by whole periods of the drives if there are any. If time enters in another way, it goes
    on.

    Parameters
    ----------
    system : System
    parameters : mapping of str to float
    time : float
    state : array, shape (n,)
    rate : array, shape (n,), optional
        Mean velocity of the state, if the motion repeats up to a drift.
    """
    begin = system.span[0]
    period = period_of_drives(system, parameters)
    repetition = Repetition(derive(system.declaration))
    still = np.zeros(len(state))
    for moving in (still if rate is None else _moving(rate, time - begin, state), still):
        frame = dict(zip(system.declaration.state, map(float, moving), strict=True))
        waves = repetition.waves(parameters, frame, begin)
        if waves is not None and (not waves or (period and repeats(waves, period))):
            back = period * math.floor((time - begin) / period) if period else time - begin
            return Handed(parameters, time - back, state - back * moving)
    return Handed(parameters, time, state.copy())


def _moving(rate: Array, elapsed: float, state: Array) -> Array:
    """A mean velocity without what is rounding: what really moves has got somewhere by then."""
    return np.where(np.abs(rate) * elapsed > _ROUNDED * np.abs(state), rate, 0.0)


def taken_up(
    system: System, handed: Handed, parameters: Mapping[str, float]
) -> tuple[float, Array]:
    """When and where a motion begins that goes on from another one with other parameters.

    The drives are at the same phase, and what friction cannot hold any more has moved to where it
    can.

    Parameters
    ----------
    system : System
    handed : Handed
    parameters : mapping of str to float
        Of the motion that begins.

    Returns
    -------
    time : float
    state : array, shape (n,)
    """
    start, state = handed.time, handed.state.copy()
    before, period = (period_of_drives(system, some) for some in (handed.parameters, parameters))
    if before and period and before != period:
        begin = system.span[0]
        start = begin + math.fmod(start / before - begin / period, 1.0) * period
        start += period if start < begin else 0.0
    settle_friction(derive(system.declaration), parameters, state[None], start)
    return start, state


def period_of_drives(system: System, parameters: Mapping[str, float]) -> float:
    """Period of the drives; 0 if none of them repeats."""
    equations = derive(system.declaration)
    if not equations.timed:
        return 0.0
    try:
        return clock(system, equations, parameters).period(parameters)
    except DeclarationError:
        return 0.0
