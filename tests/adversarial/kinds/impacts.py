"""Motions with contacts that open: the library against :mod:`..references.bouncing`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

import stickslip as ss

from ..families import openings
from ..families.openings import FAMILIES
from ..references.bouncing import Bodies, Path, follow
from ..references.mechanics import Array
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
CLOSE = 1e-7  # relative; what rebounds at 1e-5 of the speeds is closed in the reference
SHIFT = 1e-8  # relative change of all loads by which the condition of a motion is measured
PATIENCE = 60.0


def cases(seed: int = 0, count: int = 100) -> Iterator[openings.Opening]:
    """Cases of all families in turn."""
    return in_turn(FAMILIES, draw, seed, count)


def reproduction(case: openings.Opening) -> str:
    """A script that repeats a case."""
    return case.source()


def judge(case: openings.Opening) -> Verdict:
    """Compute a motion twice and compare."""
    with np.errstate(all="ignore"):
        return _judge(case)


def simulated(case: openings.Opening) -> ss.Trajectory | str:
    """The library's motion, or how it refused."""
    try:
        with at_most(PATIENCE):
            motion = ss.simulate(
                case.system,
                (0.0, case.duration),
                initial=case.initial,
                parameters=case.parameters,
                max_events=20_000,
            )
            _ = motion.certificate
            return motion
    except Exception as error:  # whatever it raises is a finding
        return f"raises {type(error).__name__}: {without_numbers(str(error))}"


def _judge(case: openings.Opening) -> Verdict:
    motion = simulated(case)
    rng = np.random.default_rng(case.seed)
    times = np.sort(np.append(rng.uniform(0.0, case.duration, 15), case.duration))
    try:
        with at_most(PATIENCE):
            reference = _follow(case, case.bodies, times, 1e-12)
    except (OutOfTime, ValueError, np.linalg.LinAlgError) as error:
        return Verdict(NO_REFERENCE, f"{type(error).__name__}")
    if isinstance(motion, str):
        return Verdict(REFUSED, motion, {"reference": reference.outcome})
    return compare(case, motion, reference, times)


def _follow(
    case: openings.Opening, bodies: Bodies, times: Array, rtol: float, touches: float = 1e-9
) -> Path:
    sizes = (case.length, case.speed)
    return follow(bodies, case.start, case.duration, times, rtol, sizes, touches)


def compare(
    case: openings.Opening, motion: ss.Trajectory, reference: Path, times: Array
) -> Verdict:
    """Compare states as far as both got."""
    reached = float(motion.knots.time[-1])
    ended = not motion.outcome.ok
    numbers: dict[str, Any] = {
        "outcome": motion.outcome.label,
        "certificate": motion.certificate.verdict,
        "impacts": reference.impacts,
        "reference": reference.outcome,
    }
    upto = min(reached, reference.end)
    keep = int(np.sum(times[: len(reference.states)] <= upto * (1 - 1e-9 * ended)))
    sampled = motion.at(np.minimum(times[:keep], reached))
    found = np.array([np.asarray(sampled[n]) for n in case.names]).T.reshape(keep, len(case.names))
    d = len(case.names) // 2
    size = np.array([case.length] * d + [case.speed] * d)
    expected = reference.states[:keep]
    off = np.max(np.abs(found - expected) / size, axis=1, initial=0.0)
    numbers["difference"] = float(np.max(off, initial=0.0))
    fault = ""
    if np.any(off > CLOSE):
        allowed, numbers["condition"] = tolerance(case, reference, times[:keep], size)
        if np.any(off > allowed):
            worst = int(np.argmax(off / allowed))
            numbers |= {"time": float(times[worst]), "got": found[worst].tolist()}
            numbers |= {"expected": expected[worst].tolist(), "allowed": float(allowed[worst])}
            fault = "states differ"
    if ended:
        same = reference.outcome == WORDS.get(motion.outcome.name, "?") and abs(
            reached - reference.end
        ) <= 1e-5 * (case.duration + 1.0)
        numbers |= {"reached": reached, "end": reference.end}
        if same and not fault:
            return Verdict(AGREED, motion.outcome.label, numbers)
        if reference.outcome not in ("finished", *WORDS.values()):
            return Verdict(NO_REFERENCE, without_numbers(reference.outcome), numbers)
        return Verdict(REFUSED, f"{motion.outcome.label}; {fault or 'right until then'}", numbers)
    certified = motion.certificate.ok
    if fault:
        return Verdict(WRONG if certified else NOT_CERTIFIED, fault, numbers)
    if reference.outcome != "finished":
        return Verdict(NO_REFERENCE, without_numbers(reference.outcome), numbers)
    if not certified:
        reasons = [r.name for r in motion.certificate.residuals if not r.ok]
        return Verdict(NOT_CERTIFIED, ", ".join(reasons) + ", but right", numbers)
    return Verdict(AGREED, "", numbers)


# What the reference says where the library ends with an outcome of a name.
WORDS = {
    "NO_ACCELERATION": "no mode",
    "NO_COLLISION": "no impulse",
    "CREATES_ENERGY": "creates energy",
}


def tolerance(
    case: openings.Opening, reference: Path, times: Array, size: Array
) -> tuple[Array, float]:
    """How far a right motion may be off at each time, and the condition of the motion.

    The reference's own error is seen by looser tolerances and an earlier end of bouncing.
    """
    own, condition = np.zeros(len(times)), np.zeros(len(times))
    # Impacts that come together do not depend continuously on anything: how near is together?
    runs = [(case.bodies, 1e-9, 1e-9, 1.0), (case.bodies, 1e-12, 1e-6, 1.0)]
    runs += [(case.bodies, 1e-12, 1e-12, 1.0)]
    runs += [(case.bodies.pushed(1 + s), 1e-12, 1e-9, SHIFT) for s in (SHIFT, -SHIFT)]
    for bodies, rtol, touches, shift in runs:
        try:
            with at_most(PATIENCE):
                other = _follow(case, bodies, times, rtol, touches).states[: len(times)]
        except (OutOfTime, ValueError, np.linalg.LinAlgError):
            continue
        common = min(len(times), len(other))
        gap = np.full(len(times), np.inf)
        gap[:common] = np.max(
            np.abs(other[:common] - reference.states[:common]) / size, axis=1, initial=0.0
        )
        if shift == 1.0:
            own = np.maximum(own, gap)
        else:
            condition = np.maximum(condition, gap / shift)
    condition = np.maximum.accumulate(condition)
    allowed = CLOSE + np.maximum.accumulate(own) + 1e-8 * condition
    return allowed, float(np.max(condition, initial=0.0))
