"""The state that a motion passes on to the next one with other parameters, as in an experiment: its
last state, at the same phase of the drives."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import chain

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.derive import derive
from stickslip.errors import DeclarationError
from stickslip.model.system import System
from stickslip.orbits.fields.clock import clock
from stickslip.orbits.fields.stable_set import settle_friction
from stickslip.orbits.settling.repetition import Repetition, repeats
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

_ROUNDED = 1e-3  # displacement relative to the component below which its rate is a rounding error


@dataclass(frozen=True)
class CarriedState:
    """State reached by a motion.

    Attributes
    ----------
    parameters : dict of str to float
        Of that motion.
    state : array, shape (n,)
    """

    parameters: Mapping[str, float]
    time: float
    state: Array


def carried_state(
    system: System,
    parameters: Mapping[str, float],
    time: float,
    state: Array,
    rate: Array | None = None,
) -> CarriedState:
    """Final time and state of a motion, shifted back to the earliest time at which the system is
    equivalent.

    A load Vt would jump by ΔV·t when V changes, and drifting coordinates would grow without bound.
    Therefore the state is shifted back, in the frame in which the system is periodic, to the start
    of time: by whole periods of the drives if there are any. If time occurs in another way, it
    continues.

    Parameters
    ----------
    state : array, shape (n,)
    rate : array, shape (n,), optional
        Mean velocity of the state, if the motion repeats up to a drift.
    """
    begin = system.span[0]
    period = period_of_drives(system, parameters)
    measured = [] if rate is None else [_moving(rate, time - begin, state)]
    for moving in chain(measured, [np.zeros(len(state))], _pulled(system, parameters)):
        if _repeats(system, parameters, moving, begin, period):
            back = period * math.floor((time - begin) / period) if period else time - begin
            return CarriedState(parameters, time - back, state - back * moving)
    return CarriedState(parameters, time, state.copy())


def _repeats(
    system: System, parameters: Mapping[str, float], moving: Array, begin: float, period: float
) -> bool:
    """Return whether a system is invariant under a period, or under any time shift if there is
    none, in a moving frame, after a given time.

    Parameters
    ----------
    moving : array, shape (n,)
        Velocity of the frame.
    """
    equations = derive(system.declaration)
    if not equations.timed and not np.any(moving):
        return True
    frame = dict(zip(system.declaration.state, map(float, moving), strict=True))
    waves = Repetition(equations).waves(parameters, frame, begin)
    return waves is not None and (not waves or (period > 0.0 and repeats(waves, period)))


def _pulled(system: System, parameters: Mapping[str, float]) -> Iterator[Array]:
    """Candidates for the frame in which a load Vt pulls a system, for motions that do not repeat:
    for each sum of t and coordinates, these coordinates, or all of them, move so that the sum is
    constant. Candidates must be tested."""
    declaration = system.declaration
    places = set(declaration.coordinates)
    numbers = {name: ex.num(value) for name, value in parameters.items()}
    seen = set[Expr]()
    left = [ex.substitute(e, numbers) for e in derive(declaration).formulas]
    while left:
        e = left.pop()
        if e in seen or "t" not in e.symbols:
            continue
        seen.add(e)
        left += [*e.args, *(base for base, _ in e.terms)]
        if e.op != "sum":
            continue
        pull = sum(weight * _slope(term, "t") for term, weight in e.terms)
        held = {x: sum(w * _slope(term, x) for term, w in e.terms) for x in e.symbols & places}
        hold = sum(held.values())
        if pull and hold:
            for moving in ({x for x in held if held[x]}, places):
                yield np.array([-pull / hold if x in moving else 0.0 for x in declaration.state])


def _slope(term: Expr, name: str) -> float:
    """The coefficient of a name in an expression that is linear in it; otherwise 0."""
    slope = ex.derivative(term, name)
    return ex.number(slope) if slope.op == "num" else 0.0


def _moving(rate: Array, elapsed: float, state: Array) -> Array:
    """A mean velocity without rounding errors: a component that moves has a significant
    displacement by then."""
    return np.where(np.abs(rate) * elapsed > _ROUNDED * np.abs(state), rate, 0.0)


def resumed_state(
    system: System, handed: CarriedState, parameters: Mapping[str, float]
) -> tuple[float, Array]:
    """Time and state at the start of a motion that continues another one with other parameters.

    The drives are at the same phase, and coordinates outside the stable set have moved to the
    nearest stable positions.

    Parameters
    ----------
    parameters : mapping of str to float
        Of the new motion.

    Returns
    -------
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
    """Period of the drives; 0 if none is periodic."""
    equations = derive(system.declaration)
    if not equations.timed:
        return 0.0
    try:
        return clock(system, equations, parameters).period(parameters)
    except DeclarationError:
        return 0.0
