"""Friction in a plane: the library against :mod:`..references.sliding`."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

import stickslip as ss

from ..families.planes import FAMILIES, Slide
from ..references.mechanics import Array
from ..references.pieces import NoAnswer
from ..references.sliding import PLANE, TOLERANCE, Motion, motion
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
from .motions import phases, without_numbers

__all__ = ["FAMILIES", "cases", "draw", "judge", "reproduction"]

draw = FAMILIES.draw
CLOSE = 1e-8  # relative; ten times the tolerance of the library's certificate
CERTIFIED = 1e-9  # what the certificate leaves open, to be multiplied by the condition of a motion
SHIFT = 1e-7  # relative change of all numbers by which the condition is measured
LEAST = 1e-3  # natural size
LONG = 1e-5  # of the span: phases that have to be there
PATIENCE = 60.0


def cases(seed: int = 0, count: int = 100) -> Iterator[Slide]:
    """Cases of all families in turn."""
    return in_turn(FAMILIES, draw, seed, count)


def reproduction(case: Slide) -> str:
    """A script that repeats a case."""
    return case.source()


def judge(case: Slide) -> Verdict:
    """Compute a motion twice and compare."""
    with np.errstate(all="ignore"):
        return _judge(case)


def _judge(case: Slide) -> Verdict:
    found = simulated(case)
    try:
        with at_most(PATIENCE):
            reference = follow(case)
    except (NoAnswer, OutOfTime, ValueError, np.linalg.LinAlgError) as error:
        return Verdict(NO_REFERENCE, f"{type(error).__name__}: {error}")
    if isinstance(found, str):
        return Verdict(REFUSED, found)
    return compare(case, found, reference)


def simulated(case: Slide) -> ss.Trajectory | str:
    """The library's motion, or how it refused."""
    try:
        with at_most(PATIENCE):
            motion = ss.simulate(
                case.system, case.span, initial=case.initial, parameters=case.parameters
            )
            _ = motion.certificate
            return motion
    except Exception as error:  # whatever it raises is a finding
        return f"raises {type(error).__name__}: {without_numbers(str(error))}"


def instants(case: Slide) -> Array:
    """Where states are compared, as the library's clock shows them."""
    rng = np.random.default_rng(case.seed)
    times = np.sort(np.append(rng.uniform(0.0, case.duration, 11), case.duration))
    clock = np.minimum(case.origin + times * case.time, case.span[1])
    return np.clip((clock - case.origin) / case.time, 0.0, case.duration)


def follow(
    case: Slide, times: Array | None = None, tolerance: float = TOLERANCE, shift: int = 0
) -> Motion:
    """The reference, with all numbers changed by so little as a seed says."""
    rng = np.random.default_rng([case.seed, abs(shift)])
    by = SHIFT * np.sign(shift)
    n = {w: v * (1 + by * rng.choice([-1.0, 1.0])) for w, v in case.numbers.items()}
    start = [case.start.get(name, 0.0) * (1 + by * rng.choice([-1.0, 1.0])) for name in case.names]
    times = instants(case) if times is None else times
    return motion(case.bodies(n), start, times, case.duration, tolerance=tolerance)


def sizes(case: Slide, states: Array) -> Array:
    """Sizes of coordinates and of rates: what differences are relative to."""
    n = len(case.shape.names)
    start = np.array([case.start.get(name, 0.0) for name in case.names])
    largest = np.max(np.abs(np.vstack([states, start])), axis=0)
    return np.maximum(np.repeat([np.max(largest[:n]), np.max(largest[n:])], n), LEAST)


def compare(case: Slide, found: ss.Trajectory, reference: Motion) -> Verdict:
    """Compare states, forces and modes."""
    certificate = found.certificate
    numbers = {"outcome": found.outcome.label, "certificate": certificate.verdict}
    if not found.outcome.ok:
        note = found.outcome.label + ("; yet the certificate is ok" if certificate.ok else "")
        return Verdict(REFUSED, note, numbers)
    clock = np.clip(case.origin + reference.times * case.time, *case.span)
    sampled = found.at(clock)
    got = np.array([np.asarray(sampled[n]) / case.unit(n) for n in case.names]).T
    size = sizes(case, reference.states)
    off = np.max(np.abs(got - reference.states) / size, axis=1)
    off = np.where(np.isfinite(off), off, np.inf)
    numbers |= {"difference": float(np.max(off)), "switches": len(reference.phases) - 1}
    fault = ""
    if np.any(off > CLOSE):
        allowed, numbers["condition"] = tolerance(case, reference, size)
        if np.any(off > allowed):
            worst = int(np.argmax(off / allowed))
            fault = f"states differ by {off[worst]:.1e}"
            expected = dict(zip(case.names, map(float, reference.states[worst]), strict=True))
            here = dict(zip(case.names, map(float, got[worst]), strict=True))
            numbers |= {"time": float(reference.times[worst]), "expected": expected, "got": here}
    else:
        fault = compare_contacts(case, found, reference, sampled)
    numbers |= {"fault": fault} if fault else {}
    if fault and certificate.ok:
        return Verdict(WRONG, re.sub(r"by .*|at t = .*", "", fault).strip(), numbers)
    if not certificate.ok:
        reasons = [r.name for r in certificate.residuals if not r.ok]
        reasons += ["not verified everywhere"] * bool(certificate.unverified)
        note = ", ".join(reasons) + (", and wrong" if fault else ", but right")
        return Verdict(NOT_CERTIFIED, note, numbers)
    if found.outcome is ss.Outcome.AT_REST and moves_later(case, reference):
        return Verdict(WRONG, "moves again where it is said to rest forever", numbers)
    return Verdict(AGREED, "", numbers)


def moves_later(case: Slide, reference: Motion) -> bool:
    """Whether the motion goes on after the span, in three times its length."""
    start = [case.start.get(name, 0.0) for name in case.names]
    later = motion(case.bodies(), start, [], 4 * case.duration)
    return len(later.phases) > len(reference.phases)


def tolerance(case: Slide, reference: Motion, size: Array) -> tuple[Array, float]:
    """How far a right motion may be off at each time, and the condition of the motion: how much
    more it differs than its numbers do. The reference's own error is seen by a thousand times its
    tolerance."""
    own = np.zeros(len(reference.times))
    condition = np.zeros(len(reference.times))
    for shift in (0, 1, -1, 2, -2):
        try:
            with at_most(PATIENCE):
                other = follow(
                    case, reference.times, TOLERANCE if shift else 1e3 * TOLERANCE, shift
                )
        except (NoAnswer, OutOfTime):
            continue
        gap = np.max(np.abs(other.states - reference.states) / size, axis=1)
        if shift:
            condition = np.maximum(condition, gap / SHIFT)
        else:
            own = np.minimum(gap, 1.0)
    condition = np.maximum.accumulate(condition)
    allowed = CLOSE + 0.1 * np.maximum.accumulate(own) + CERTIFIED * condition
    return allowed, float(np.max(condition))


def compare_contacts(
    case: Slide, found: ss.Trajectory, reference: Motion, sampled: dict[str, Array]
) -> str:
    """Forces at the sample times, away from switches, and modes of every phase that is long
    enough."""
    switched = np.array([float(phase.time) for phase in reference.phases])
    apart = np.array([np.min(np.abs(switched - t)) for t in reference.times])
    calm = apart > LONG * case.duration
    engine = [c.name for c in found.problem.compiled.equations.contacts]
    times = (np.asarray(found.knots.time) - case.origin) / case.time
    for k, touch in enumerate(case.shape.touches):
        keys = [f"c{k}"] if len(touch.rows) == 1 else [f"c{k} 1", f"c{k} 2"]
        expected = reference.forces[k][calm]
        got = np.array(
            [np.asarray(sampled["friction_" + re.sub(r"\W", "_", key)])[calm] for key in keys]
        ).T.reshape(expected.shape)
        size = max(float(np.max(np.abs(expected), initial=0.0)), case.numbers[f"s{k}"])
        worst = np.max(np.abs(got / case.force - expected), initial=0.0) / size
        if not worst <= 100 * CLOSE:
            return f"friction forces differ by {worst:.1e}"
        own = np.asarray(found.knots.mode)[:, engine.index(keys[0])]
        fault = compare_modes(case, reference, k, times, own)
        if fault:
            return fault
    return ""


def compare_modes(case: Slide, reference: Motion, k: int, times: Array, own: Array) -> str:
    """The same modes for as long as it matters: where they differ, so little moves that it cannot
    be seen."""
    theirs = np.array([float(phase.time) for phase in reference.phases])
    modes = np.array([phase.mode[k] for phase in reference.phases])
    modes = np.where(modes == PLANE, 1, modes)
    for begin, end, mode in phases(times, own, case.duration):
        for other_begin, other_end, other in phases(theirs, modes, case.duration):
            first, last = max(begin, other_begin), min(end, other_end)
            if mode != other and last - first > LONG * case.duration:
                middle = (first + last) / 2
                bodies = case.bodies()
                there = follow(case, np.array([middle])).states
                half = bodies.size
                slide = bodies.pads[k].slide(np.array([middle]), there[:, :half], there[:, half:])
                if np.max(np.abs(slide)) * (last - first) > CLOSE * np.max(
                    sizes(case, reference.states)
                ):
                    return f"modes of contact {k} differ at t = {middle:.9g}"
    return ""
