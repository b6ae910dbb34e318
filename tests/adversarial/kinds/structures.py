"""Structures with dry contacts: the library against :mod:`..references.linear`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import zip_longest
from typing import Any

import numpy as np

import stickslip as ss

from ..families.structures import FAMILIES, Structural
from ..references.linear import Body, Motion, follow
from ..references.mechanics import Array
from ..references.pieces import NoAnswer
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
from .motions import without_numbers

__all__ = ["FAMILIES", "cases", "draw", "judge", "reproduction"]

draw = FAMILIES.draw
CLOSE = 1e-8  # relative; ten times the tolerance of the library's certificate
CERTIFIED = 1e-9  # what the certificate leaves open, to be multiplied by the condition of a motion
SHIFT = 1e-7  # relative change of the start and of all friction by which the condition is measured
ROUNDED = 1e-14  # of the norm of a matrix: what may be rounding, of its modes above all
CALM = 1e-5  # of the span: how far from a switch friction is compared
BRANCHED = 1e-7  # of the span: switches further from each other are different ones
MOST_BRANCHES = 100
MOST_EVENTS = 20_000
PATIENCE = 120.0


def cases(seed: int = 0, count: int = 100) -> Iterator[Structural]:
    """Cases of all families in turn."""
    return in_turn(FAMILIES, draw, seed, count)


def reproduction(case: Structural) -> str:
    """A script that repeats a case."""
    return case.source()


def simulated(case: Structural) -> ss.Trajectory | str:
    """The library's motion, or how it refused."""
    try:
        with at_most(PATIENCE):
            motion = ss.simulate(case.system, case.span, max_events=MOST_EVENTS, atol=atol(case))
            _ = motion.certificate
            return motion
    except Exception as error:  # whatever it raises is a finding
        return f"raises {type(error).__name__}: {without_numbers(str(error))}"


def atol(case: Structural) -> float:
    """Below the sizes of a structure in any units."""
    body = case.body
    stiffness = np.linalg.norm(body.stiffness, 2)
    place = max(np.max(np.abs(case.u)), np.max(np.abs(body.swing)) / stiffness)
    rate = max(np.max(np.abs(case.v)), place / case.duration)
    return 1e-12 * min(1.0, float(place), float(rate))


def judge(case: Structural) -> Verdict:
    """Compute a motion twice and compare."""
    motion = simulated(case)
    rng = np.random.default_rng(case.seed)
    times = np.sort(np.append(rng.uniform(0.0, case.duration, 15), case.duration))
    try:
        with at_most(PATIENCE):
            reference = follow(case.body, case.u, case.v, case.duration, times)
    except (NoAnswer, OutOfTime, ValueError, np.linalg.LinAlgError) as error:
        return Verdict(NO_REFERENCE, f"{type(error).__name__}: {without_numbers(str(error))}")
    if isinstance(motion, str):
        return Verdict(REFUSED, motion, {"phases": len(reference.phases)})
    verdict = compare(case, motion, reference)
    if verdict.kind in (WRONG, NOT_CERTIFIED) and any(p.options > 1 for p in reference.phases):
        return of_several(case, motion, reference, verdict)
    return verdict


def of_several(
    case: Structural, motion: ss.Trajectory, reference: Motion, verdict: Verdict
) -> Verdict:
    """Compare with other motions: where contacts hold more than they slow down, several modes may
    be right at an instant. Of these, that is taken with which both switch alike for longest."""
    taken: dict[int, int] = {}
    until = alike_until(case, motion, reference)
    for _ in range(MOST_BRANCHES):
        better = None
        late = until + BRANCHED * case.duration
        before = [i for i, p in enumerate(reference.phases) if p.options > 1 and p.time <= late]
        if not before or before[-1] in taken:
            return verdict
        for which in range(1, reference.phases[before[-1]].options):
            trial = {**taken, before[-1]: which}
            try:
                with at_most(PATIENCE):
                    other = follow(
                        case.body, case.u, case.v, case.duration, reference.times, 1, trial
                    )
            except (NoAnswer, OutOfTime):
                continue
            reached = alike_until(case, motion, other)
            if reached > late:
                until, better = reached, (trial, other)
                late = reached
        if better is None:
            return verdict
        taken, reference = better
        if until == np.inf:
            found = compare(case, motion, reference, taken)
            alike = found.kind == AGREED
            return replace(found, note="one of several right motions") if alike else found
    return verdict


def alike_until(case: Structural, motion: ss.Trajectory, reference: Motion) -> float:
    """When the first switch is that is another one, or at another time."""
    own = motion.events[motion.events["contact"].isin(case.contacts)]
    mine = zip(own["time"].astype(float), own["contact"], strict=True)
    phases = zip(reference.phases, reference.phases[1:], strict=False)
    theirs = (
        (phase.time, name)
        for before, phase in phases
        for name, was, sign in zip(case.contacts, before.mode, phase.mode, strict=True)
        if was != sign
    )
    end = (np.inf, "")
    for (time, name), (when, other) in zip_longest(mine, theirs, fillvalue=end):
        if name != other or abs(time - when) > BRANCHED * case.duration:
            return float(min(time, when))
    return np.inf


def differences(
    case: Structural, motion: ss.Trajectory, reference: Motion, keep: int
) -> tuple[Array, Any]:
    """Of states at the first times, relative to their sizes; and what the library says there."""
    reached = float(motion.knots.time[-1])
    sampled = motion.at(np.minimum(reference.times[:keep], reached))
    n = len(case.u)
    places = [*case.shown, *(n + i for i in case.shown)]
    found = np.array([np.asarray(sampled[name]) for name in case.names]).T.reshape(keep, -1)
    size = sizes(case, reference.states)[places]
    off = np.max(np.abs(found - reference.states[:keep][:, places]) / size, axis=1, initial=0.0)
    return np.where(np.isfinite(off), off, np.inf), sampled


def sizes(case: Structural, states: Array) -> Array:
    """What differences of unknowns and of their rates are relative to."""
    n = len(case.u)
    whole = np.abs(np.vstack([states, np.concatenate([case.u, case.v])]))
    place, rate = float(np.max(whole[:, :n])), float(np.max(whole[:, n:]))
    body = case.body
    belts = max(abs(touch.speed) for touch in body.touches)
    # where all stick, what loads would do to the stiffest mode
    loads = max(float(np.max(np.abs(body.swing))), *(touch.holds for touch in body.touches))
    least = loads / float(np.linalg.norm(body.stiffness, 2))
    return np.repeat([max(place, least), max(rate, belts, least * body.omega)], n)


def compare(
    case: Structural,
    motion: ss.Trajectory,
    reference: Motion,
    taken: Mapping[int, int] | None = None,
) -> Verdict:
    """Compare states and friction as far as the library got."""
    reached = float(motion.knots.time[-1])
    ended = not motion.outcome.ok
    numbers: dict[str, Any] = {
        "outcome": motion.outcome.label,
        "certificate": motion.certificate.verdict,
        "phases": len(reference.phases),
    }
    times = reference.times
    keep = int(np.sum(times <= reached * (1.0 - 1e-9 * ended))) if ended else len(times)
    off, sampled = differences(case, motion, reference, keep)
    numbers["difference"] = float(np.max(off, initial=0.0))
    fault = ""
    if np.any(off > CLOSE):
        allowed, numbers["condition"] = tolerance(case, reference, taken)
        if np.any(off > allowed[:keep]):
            worst = int(np.argmax(off / allowed[:keep]))
            numbers |= {"time": float(times[worst]), "allowed": float(allowed[worst])}
            fault = "states differ"
    elif not ended:
        fault = compare_friction(case, reference, sampled, numbers, taken)
    certified = motion.certificate.ok
    if ended:
        return Verdict(REFUSED, f"{motion.outcome.label}; {fault or 'right until then'}", numbers)
    if fault:
        return Verdict(WRONG if certified else NOT_CERTIFIED, fault, numbers)
    if not certified:
        reasons = [r.name for r in motion.certificate.residuals if not r.ok]
        reasons += ["not verified everywhere"] * bool(motion.certificate.unverified)
        return Verdict(NOT_CERTIFIED, ", ".join(reasons) + ", but right", numbers)
    return Verdict(AGREED, "", numbers)


def compare_friction(
    case: Structural,
    reference: Motion,
    sampled: Any,
    numbers: dict[str, Any],
    taken: Mapping[int, int] | None,
) -> str:
    """Friction at the times of comparison, away from switches: modes show in it."""
    switched = np.array([phase.time for phase in reference.phases])
    gap = CALM * case.duration
    calm = np.array([np.min(np.abs(switched - t)) > gap for t in reference.times])
    got = np.array([np.asarray(sampled[f"friction_{name}"]) for name in case.contacts]).T
    size = max(touch.holds for touch in case.body.touches)
    off = np.max(np.abs(got - reference.friction)[calm], axis=1, initial=0.0) / size
    numbers["friction"] = float(np.max(off, initial=0.0))
    if np.all(off <= 100.0 * CLOSE):
        return ""
    allowed, numbers["condition"] = tolerance(case, reference, taken, friction=True)
    return "friction differs" if np.any(off > 100.0 * allowed[calm]) else ""


def tolerance(
    case: Structural,
    reference: Motion,
    taken: Mapping[int, int] | None = None,
    friction: bool = False,
) -> tuple[Array, float]:
    """How far a right motion may be off at each time, and the condition of the motion.

    The reference's own error is seen by shorter steps, and what rounding of matrices does by other
    roundings of these. The condition is how much more a motion differs than its start and its
    friction do.
    """
    times, body = reference.times, case.body
    rng = np.random.default_rng(case.seed)
    size = sizes(case, reference.states)
    kick = SHIFT * size * rng.choice([-1.0, 1.0], len(size))
    n = len(case.u)
    up, down = case.u + kick[:n], case.u - kick[:n]
    runs: list[tuple[Body, Array, float, int]] = [(body, case.u, 1.0, 2)]
    runs += [(rounded(body, rng), case.u, 1.0, 1) for _ in range(3)]
    runs += [(body, up, SHIFT, 1), (body, down, SHIFT, 1)]
    runs += [(body.stronger(1.0 + s), case.u, SHIFT, 1) for s in (SHIFT, -SHIFT)]
    own, condition = np.zeros(len(times)), np.zeros(len(times))
    forces = max(touch.holds for touch in body.touches)
    for changed, u, shift, finer in runs:
        try:
            with at_most(PATIENCE):
                other = follow(changed, u, case.v, case.duration, times, finer, taken)
        except (NoAnswer, OutOfTime):
            continue
        gap = np.max(np.abs(other.states - reference.states) / size, axis=1)
        if friction:
            gap = np.max(np.abs(other.friction - reference.friction), axis=1) / forces
        if shift == 1.0:
            own = np.maximum(own, gap)
        else:
            condition = np.maximum(condition, gap / shift)
    condition = np.maximum.accumulate(condition)
    allowed = CLOSE + np.maximum.accumulate(own) + CERTIFIED * condition
    return allowed, float(np.max(condition, initial=0.0))


def rounded(body: Body, rng: np.random.Generator) -> Body:
    """The body with other roundings of its matrices."""

    def other(matrix: Array) -> Array:
        noise = rng.normal(size=matrix.shape) / np.sqrt(len(matrix))
        scale = np.sqrt(np.abs(np.diag(matrix)))
        return matrix + ROUNDED * (noise + noise.T) * np.outer(scale, scale)

    return replace(
        body,
        mass=other(body.mass),
        damping=other(body.damping),
        stiffness=other(body.stiffness),
    )
