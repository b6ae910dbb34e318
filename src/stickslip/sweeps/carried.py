"""Sweeps that carry the state: the attractors of a motion while a parameter changes in steps, as in
an experiment.

Frequency responses use the cycle; maps, which carry the state in the same way
(:mod:`stickslip.sweeps.work.carried_state`), use measures of the settled motions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from stickslip.arrays import Array
from stickslip.equations.derive import derive
from stickslip.errors import ConvergenceError
from stickslip.model.system import System
from stickslip.motion.outcome import Outcome
from stickslip.motion.problem import pose
from stickslip.orbits.cycles.cycle import Cycle
from stickslip.orbits.cycles.find_cycle import find_cycle
from stickslip.orbits.cycles.finding import is_unstable
from stickslip.orbits.fields.stable_set import settle_friction
from stickslip.orbits.return_map.following import follow_freely
from stickslip.sweeps.work.carried_state import (
    CarriedState,
    carried_state,
    period_of_drives,
    resumed_state,
)

# fraction of its first distance from a cycle that a motion reaches if it converges there
_NEARER = 0.2
_THERE = 1e-9  # distance in units of the cycle that counts as zero
_LOOKS = 7  # number of looks, after 1, 2, 4, … further periods
_MOST_LOOKS = 10  # … and largest number if each of them is nearer by this factor
_SLOWLY = 0.9


def carried(
    system: System,
    parameter: str,
    values: Sequence[float],
    *,
    parameters: Mapping[str, float] | None = None,
    initial: Mapping[str, float] | None = None,
    progress: Callable[[int], None] | None = None,
    known: Callable[[float], Iterable[Cycle]] | None = None,
) -> Iterator[tuple[Cycle | str, bool]]:
    """The limit cycles of a motion for successive values of a parameter.

    Each motion starts from the state of the previous one, at the same phase of the drives. If a
    cycle is known at the new value, or the previous one can be continued to it, the motion is
    followed until its distance from the cycle has decreased to a fifth; otherwise until it has
    settled.

    Parameters
    ----------
    values : sequence of float
        In the order of the sweep.
    parameters : mapping of str to float, optional
        Values of the others.
    initial : mapping of str to float, optional
        State of the first motion; by default the declared one.
    progress : callable, optional
        Called with the number of each value before its computation.
    known : callable, optional
        value ↦ cycles that are known there; called before each motion.

    Yields
    ------
    found : Cycle or str
        The cycle, or the reason why there is none; the next motion then starts from the final
        state.
    followed : bool
        Whether it is the previous cycle, continued to the new value.
    """
    handed: CarriedState | None = None
    cycle: Cycle | None = None
    for i, value in enumerate(values):
        if progress is not None:
            progress(i)
        problem = pose(system, {**(parameters or {}), parameter: float(value)})
        own = problem.parameters
        if handed is None:
            state, start = problem.initial_state(initial or {}), system.span[0]
            settle_friction(derive(system.declaration), own, state[None], start)
        else:
            start, state = resumed_state(system, handed, own)
        before, cycle = cycle, None
        there = [*known(float(value))] if known is not None else []
        there.sort(key=lambda seen: seen.closed.distance(state, start))
        cycle = next((seen for seen in there if _approached(seen, start, state)), None)
        followed = False
        if cycle is None and before is not None and not there:
            cycle = _followed(before, parameter, float(value), start, state)
            followed = cycle is not None
        if cycle is None:
            # From the motion, not its start, near which there may be an unstable cycle.
            length = period_of_drives(system, own) or 0.05 * (system.span[1] - system.span[0])
            motion = follow_freely(problem, start, start + length, state)
            try:
                cycle = find_cycle(system, motion)
            except ConvergenceError as failure:
                last = motion.knots
                handed = carried_state(system, own, float(last.time[-1]), last.state[-1])
                yield str(failure), False
                continue
        place = cycle.closed.orbit.legs[0].place.state
        rate = cycle.closed.orbit.shift / cycle.period
        handed = carried_state(system, own, cycle.closed.shooting.start, place, rate)
        yield cycle, followed


def moved(cycle: Cycle, parameters: Mapping[str, float], halvings: int = 5) -> Cycle:
    """A cycle continued to other parameters, with intermediate values if necessary.

    Raises
    ------
    ConvergenceError
        If steps of a 2⁻ʰ-th part are still too long.
    """
    try:
        return find_cycle(cycle.system, cycle, parameters=parameters)
    except ConvergenceError:
        if halvings == 0:
            raise
    middle = {name: 0.5 * (cycle.parameters[name] + value) for name, value in parameters.items()}
    return moved(moved(cycle, middle, halvings - 1), parameters, halvings - 1)


def _followed(
    cycle: Cycle, parameter: str, value: float, start: float, state: Array
) -> Cycle | None:
    """A cycle continued to the next value of a parameter, if the motion from a state approaches
    it."""
    if cycle.closed.shooting.setting.held:
        return None
    try:
        found = moved(cycle, {parameter: value}, halvings=2)
    except ConvergenceError:
        return None
    return found if _approached(found, start, state) else None


def _approached(cycle: Cycle, time: float, state: Array) -> bool:
    """Return whether the motion from a state approaches a cycle that is not unstable."""
    closed = cycle.closed
    # The rest position of a contact that never slips follows from a motion, not from a neighbouring
    # cycle.
    if closed.shooting.setting.held or is_unstable(closed):
        return False
    first = closed.distance(state, time)
    last = first
    for look in range(_MOST_LOOKS):
        end = time + 2.0**look * cycle.period
        motion = follow_freely(closed.orbit.problem, time, end, state)
        if motion.outcome is not Outcome.FINISHED:
            return False
        time, state = float(motion.knots.time[-1]), motion.knots.state[-1]
        now = closed.distance(state, time)
        if now <= max(_NEARER * first, _THERE):
            return True
        if look + 1 >= _LOOKS and not now <= _SLOWLY * last:
            return False
        last = now
    return False
