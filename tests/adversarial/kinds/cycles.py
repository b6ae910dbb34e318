"""Cycles: what the library finds from a state, against motions that are followed until they repeat
themselves.

A certified cycle has to be a motion of its mechanics (as in :mod:`.motions`), close, and not close
earlier; neighbours have to come nearer or leave as it says; and the motion from the start has to
settle on it. What is said instead of a cycle (rest, irregular motion) is held against the same
motion. Everything it is compared with is the reference's.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

import stickslip as ss

from ..case import declaration
from ..families.repeating import FAMILIES, Repeating
from ..references.event_driven import integrate
from ..references.mechanics import Array
from ..references.pieces import NoAnswer
from ..references.settling import OWN, Settled, settle
from ..registry import in_turn
from ..verdict import (
    AGREED,
    NO_REFERENCE,
    NOT_CERTIFIED,
    REFUSED,
    WRONG,
    OutOfTime,
    Verdict,
    at_most,
)
from .motions import compare, instants, without_numbers

__all__ = ["FAMILIES", "cases", "draw", "judge", "reproduction"]

draw = FAMILIES.draw

CLOSES = 1e-9  # a cycle closes up to this part of its size
AROUND = 1e-8  # after a part of its period it is nowhere as near as this
SAME = 1e-4  # two cycles with periods and extremes this close are one
# of its size: a start this near to a cycle may mean that cycle, although its motion settles
# elsewhere
BESIDE = 0.3
APART = 1e-5  # of its size: neighbours
GROWN = 20.0  # neighbours are followed until their distance has changed by this factor …
NEUTRAL = 0.96  # … unless that takes longer than with this multiplier
PATIENCE = 300.0  # seconds of the processor for the library
ATTRACTING = 60.0  # … for the reference to follow neighbours …
SETTLING = 10.0  # … for a motion to settle …
FINELY = 60.0  # … and in steps that miss nothing

WORDS = (
    "form a continuous family",
    "no cycle was found",
    "the motion from the start ends",
    "did not converge",
    "a different solution",
)


def cases(seed: int = 0, count: int = 100) -> Iterator[Repeating]:
    """Cases of all families in turn; each depends on its family and its own seed alone."""
    return in_turn(FAMILIES, draw, seed, count)


def judge(case: Repeating) -> Verdict:
    """Ask the library for the cycle, and hold what it says against the reference."""
    # A trial step of the reference may leave the domain of a law: it is made smaller.
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        found = cycle_of(case)
        if isinstance(found, str):
            return without_cycle(case, found)
        if not found.certificate.ok:
            kinds = [residual.name for residual in found.certificate.residuals if not residual.ok]
            return Verdict(
                NOT_CERTIFIED,
                ", ".join(kinds),
                {"period": found.period, "why": found.certificate.verdict},
            )
        try:
            with at_most(PATIENCE):
                return checked(case, found)
        except (NoAnswer, OutOfTime) as error:
            return Verdict(NO_REFERENCE, without_numbers(str(error)), {"period": found.period})


def cycle_of(case: Repeating) -> ss.Cycle | str:
    """The library's cycle, or what it says instead."""
    try:
        with at_most(PATIENCE):
            cycle = ss.find_cycle(case.system, case.initial, parameters=case.parameters)
            _ = cycle.certificate
            return cycle
    except ss.StickslipError as error:
        return str(error)
    except Exception as error:  # whatever it raises is a finding
        return f"raises {type(error).__name__}: {error}"


def reproduction(case: Repeating) -> str:
    """A script that repeats what the library did."""
    numbers = {name: float(value) for name, value in case.parameters.items()}
    start = {name: float(value) for name, value in case.initial.items()}
    return (
        f"system = {declaration(case.system)}\n"
        f"print(ss.find_cycle(system, {start}, parameters={numbers}).summary())"
    )


# -- a cycle ---------------------------------------------------------------------------------------


def checked(case: Repeating, cycle: ss.Cycle) -> Verdict:
    """Everything that is said of a certified cycle."""
    numbers = {"period": cycle.period, "stability": cycle.stability}
    own = of_cycle(case, cycle)
    assert own.mechanics is not None
    reference = integrate(own.mechanics, (0.0, own.duration), own.start, instants(own))
    motion = compare(own, cycle.trajectory, reference)
    if motion.kind == WRONG:
        return Verdict(WRONG, f"no motion: {motion.note}", numbers | motion.numbers)
    for check in (around, attracts, settles):
        fault, found = check(case, own, cycle)
        numbers |= found
        if fault:
            return Verdict(WRONG, fault, numbers)
    return Verdict(AGREED, "", numbers | {"difference": motion.numbers["difference"]})


def of_cycle(case: Repeating, cycle: ss.Cycle) -> Repeating:
    """One period of a cycle as a case of its own, with a clock that begins with it."""
    unit = case.units.get("time", 1.0)
    assert case.mechanics is not None
    return replace(
        case,
        initial=cycle.state,
        origin=cycle.time,
        duration=cycle.period / unit,
        mechanics=case.mechanics.later(cycle.time / unit),
    )


def path(own: Repeating, cycle: ss.Cycle, parts: Array) -> Array:
    """States of a cycle after parts of its period, up to shifts, in natural units."""
    values = cycle.trajectory.at(
        np.clip(cycle.time + parts * cycle.period, *cycle.trajectory.t_span)
    )
    return own.at_home(
        np.column_stack([np.asarray(values[n]) / own.units.get(n, 1.0) for n in own.names])
    )


def sizes(states: Array) -> Array:
    """Half the ranges; of what hardly moves, a part of the largest."""
    size = 0.5 * np.ptp(states, axis=0)
    return np.maximum(size, 1e-3 * np.max(size))


def around(case: Repeating, own: Repeating, cycle: ss.Cycle) -> tuple[str, dict]:
    """It closes after its period, and after no part of it."""
    size = sizes(path(own, cycle, np.linspace(0.0, 1.0, 2001)))
    rounds = round(own.duration / case.duration) if case.driven else 12
    if case.driven and abs(own.duration / case.duration - rounds) > 1e-9:
        return "no number of periods of the load", {}
    primes = [p for p in (2, 3, 5, 7, 11) if not case.driven or rounds % p == 0]
    start, *parts = path(own, cycle, np.array([0.0, 1.0, *(1.0 / p for p in primes)]))
    gaps = [float(np.max(np.abs(part - start) / size)) for part in parts]
    if gaps[0] > CLOSES:
        return "it does not close", {"gap": gaps[0]}
    if min(gaps[1:], default=np.inf) < AROUND:
        return "it runs around several times", {"gaps": gaps}
    return "", {}


def attracts(case: Repeating, own: Repeating, cycle: ss.Cycle) -> tuple[str, dict]:
    """Neighbours come nearer, or leave, as the multipliers say."""
    largest = float(np.max(np.abs(cycle.nontrivial), initial=0.0))
    if NEUTRAL < largest < 1.0 / NEUTRAL or not cycle.differentiable:
        return "", {}
    rate = abs(math.log(max(largest, 1e-6)))
    rounds = max(
        1,
        (math.ceil if largest < 1.0 else math.floor)(
            math.log(GROWN if largest < 1.0 else 1e3) / rate
        ),
    )
    try:
        with at_most(ATTRACTING):
            ratios = parting(case, own, cycle, rounds)
            if ratios and cycle.stable and min(ratios) > 0.5:
                # Where a change turns and its axes are far from square, it may grow before it
                # decays.
                rounds *= 3
                ratios = parting(case, own, cycle, rounds)
    except OutOfTime:
        return "", {"multiplier": largest, "ratios": "not within the time"}
    numbers = {"ratios": ratios, "rounds": rounds, "multiplier": largest}
    if ratios and cycle.stable and min(ratios) > 0.5:
        return "called stable, neighbours are not attracted", numbers
    if ratios and not cycle.stable and largest > 1.0 and max(ratios) < 2.0:
        return "called unstable, neighbours are attracted", numbers
    return "", {"multiplier": largest}


def parting(case: Repeating, own: Repeating, cycle: ss.Cycle, rounds: int) -> list[float]:
    """By which factors the distances of neighbours have changed after some rounds."""
    states = path(own, cycle, np.linspace(0.0, 1.0, 20_001))
    size = sizes(states)
    rng = np.random.default_rng(case.seed)
    ratios = []
    assert own.mechanics is not None
    # A threshold decides where rate-independent coordinates go.
    free = [
        not isinstance(own.system.coordinates.get(name), ss.RateIndependent) for name in own.names
    ]
    for _ in range(2):
        kick = own.mechanics.held(
            own.start, APART * size * free * rng.choice([-1.0, 1.0], len(size))
        )
        # A kick of one component may be a large one of another, relative to its size, as soon as it
        # has come around.
        times = (
            np.unique([1, 2, rounds] if cycle.stable and rounds > 4 else [rounds]) * own.duration
        )
        try:
            motion = integrate(own.mechanics, (0.0, times[-1]), own.start + kick, times, 1e-11)
        except NoAnswer:
            continue
        if np.any(kick) and len(motion.states):
            homes = [own.at_home(state) for state in motion.states]
            besides = [
                (states[0] if case.driven else nearest(states, home, size)) - home for home in homes
            ]
            *first, last = [float(np.max(np.abs(beside) / size)) for beside in besides]
            ratios.append(last / max(*first, float(np.max(np.abs(own.at_home(kick)) / size)), 0.0))
    return ratios


def nearest(states: Array, last: Array, size: Array) -> Array:
    """The nearest point of a closed curve."""
    a = states[:-1]
    chord = np.diff(states, axis=0)
    along = np.sum((last - a) * chord / size**2, axis=1)
    part = np.clip(along / np.maximum(np.sum((chord / size) ** 2, axis=1), 1e-300), 0.0, 1.0)
    points = a + part[:, None] * chord
    return points[np.argmin(np.max(np.abs(last - points) / size, axis=1))]


def settles(case: Repeating, own: Repeating, cycle: ss.Cycle) -> tuple[str, dict]:
    """The motion from the start settles on it, or starts beside it; what long steps deny, shorter
    ones have to."""
    fault, numbers = settles_on(own, cycle, case, settle(case, SETTLING))
    return settles_on(own, cycle, case, settle(case, FINELY, OWN)) if fault else (fault, numbers)


def settles_on(
    own: Repeating, cycle: ss.Cycle, case: Repeating, found: Settled | None
) -> tuple[str, dict]:
    """Whether what a motion settles on is the cycle."""
    if found is None:
        return "", {"settled": "not within the time"}
    states = path(own, cycle, np.linspace(0.0, 1.0, 4001))
    size = sizes(states)
    off = np.max(np.abs([found.low - states.min(axis=0), found.high - states.max(axis=0)]) / size)
    if abs(found.period / own.duration - 1.0) <= SAME and off <= 10.0 * SAME:
        return "", {"settled": found.time}
    start = case.at_home(case.start)
    beside = float(np.min(np.max(np.abs(states - start) / size, axis=1)))
    if beside < BESIDE and not cycle.stable:
        return "", {"settled": "elsewhere, from beside it"}
    numbers = {"settles on": found.period, "extremes off": float(off), "start beside": beside}
    return (
        "the motion rests" if found.period == 0.0 else "the motion settles on another cycle",
        numbers,
    )


# -- none ------------------------------------------------------------------------------------------


def without_cycle(case: Repeating, reason: str) -> Verdict:
    """What the library says instead of a cycle, against the motion; what long steps deny, shorter
    ones have to."""
    verdict = instead(reason.split(": ", 1)[-1], settle(case, SETTLING))
    if verdict.kind == WRONG:
        return instead(reason.split(": ", 1)[-1], settle(case, FINELY, OWN))
    return verdict


def instead(said: str, found: Settled | None) -> Verdict:
    """Whether what is said instead of a cycle agrees with what the motion settles on."""
    numbers = {"said": said[:400], "settles on": None if found is None else found.period}
    cycles = found is not None and found.period > 0.0
    for words, note in (
        ("comes to rest", "said to rest"),
        ("the motion appears chaotic", "said to be irregular"),
    ):
        if words in said:
            if cycles:
                return Verdict(WRONG, note, numbers)
            if found is None and words == "comes to rest":
                return Verdict(NO_REFERENCE, f"{note}; no answer within the time", numbers)
            return Verdict(
                AGREED if (found is None) == (words != "comes to rest") else WRONG, note, numbers
            )
    note = next((words for words in WORDS if words in said), without_numbers(said[:80]))
    return Verdict(REFUSED, note + (", yet it settles" if cycles else ""), numbers)
