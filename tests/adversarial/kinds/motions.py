"""Motions: the library against the event-driven reference."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

import stickslip as ss

from .. import families  # noqa: F401  (registers them)
from ..case import FAMILIES, Case, draw
from ..references.event_driven import Motion, integrate
from ..references.mechanics import TIME, Array
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

__all__ = ["FAMILIES", "cases", "draw", "judge", "reproduction"]

CLOSE = 1e-8  # relative; ten times the tolerance of the library's certificate
CERTIFIED = 1e-9  # what the certificate leaves open, to be multiplied by the condition of a motion
SHIFT = 1e-7  # relative change of the start and of all friction by which the condition is measured
# natural size: relative to less, an error of CLOSE is below what the library's atol lets pass
LEAST = 1e-3
LONG = 1e-5  # of the span: phases that have to be there
MOST_EVENTS = 20_000
# seconds of the processor for the library (with its compiler), and for the reference
PATIENCE = 300.0


def cases(seed: int = 0, count: int = 100) -> Iterator[Case]:
    """Cases of all families in turn; each depends on its family and its own seed alone."""
    return in_turn(FAMILIES, draw, seed, count)


def judge(case: Case) -> Verdict:
    """Compute a motion twice and compare."""
    with np.errstate(over="ignore", under="ignore"):
        return _judge(case)


def _judge(case: Case) -> Verdict:
    motion = simulated(case)
    if case.mechanics is None:
        return compare_end(case, motion)
    try:
        with at_most(PATIENCE):
            reference = integrate(case.mechanics, (0.0, case.duration), case.start, instants(case))
    except NoAnswer as error:
        if (
            str(error) == "unstable start"
            and isinstance(motion, str)
            and "DeclarationError: initial" in motion
        ):
            return Verdict(AGREED, "both refuse the start")
        return Verdict(NO_REFERENCE, without_numbers(str(error)), {"error": str(error)})
    except (OutOfTime, np.linalg.LinAlgError, ValueError) as error:
        return Verdict(NO_REFERENCE, f"{type(error).__name__}: {error}")
    if isinstance(motion, str):
        return Verdict(REFUSED, motion, {"reference": reference.outcome})
    verdict = compare(case, motion, reference)
    return many(case, motion, verdict) if verdict.kind == AGREED and motion.outcome.ok else verdict


# -- the library -----------------------------------------------------------------------------------


def simulated(case: Case) -> ss.Trajectory | str:
    """The library's motion, or how it refused the declaration."""
    try:
        with at_most(PATIENCE):
            motion = ss.simulate(
                case.system,
                case.span,
                initial=case.initial,
                parameters=case.parameters,
                max_events=MOST_EVENTS,
                atol=case.atol,
            )
            _ = motion.certificate
            return motion
    except ss.DeclarationError as error:
        return "DeclarationError: " + without_numbers(str(error))
    except Exception as error:  # whatever it raises is a finding
        return f"raises {type(error).__name__}: {without_numbers(str(error))}"


def without_numbers(text: str) -> str:
    """A message as it is for all numbers, so that messages can be counted."""
    return re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "…", text)


def compare_end(case: Case, motion: ss.Trajectory | str) -> Verdict:
    """Compare how and when a motion ended with what a closed form says."""
    assert case.expected is not None
    label, time = case.expected
    if isinstance(motion, str):
        return Verdict(REFUSED, motion)
    reached = float(motion.knots.time[-1])
    numbers = {"expected": time, "got": reached, "outcome": motion.outcome.label}
    if motion.outcome.ok:
        kind = WRONG if motion.certificate.ok else NOT_CERTIFIED
        return Verdict(kind, f"goes on where it has to end ({label})", numbers)
    if label not in motion.outcome.label:
        return Verdict(REFUSED, f"{motion.outcome.label} instead of {label}", numbers)
    if abs(reached - time) > 1e-6 * time:
        return Verdict(WRONG, f"ends at another time ({label})", numbers)
    if motion.certificate.ok:
        return Verdict(AGREED, f"{label}; yet the certificate is ok", numbers)
    return Verdict(AGREED, label, numbers)


# -- comparison ------------------------------------------------------------------------------------


def instants(case: Case) -> Array:
    """Where states are compared: at random, after every feature in time, and at the end."""
    rng = np.random.default_rng(case.seed)
    assert case.mechanics is not None
    features = [z.place + 5 * z.width for z in case.mechanics.zones if z.row == TIME]
    times = np.concatenate([rng.uniform(0.0, case.duration, 11), features, [case.duration]])
    # As the library's clock shows them.
    unit = case.units.get("time", 1.0)
    clock = np.minimum(case.origin + times * unit, case.span[1])
    return np.unique(np.clip((clock - case.origin) / unit, 0.0, case.duration))


def sizes(case: Case, states: Array) -> Array:
    """Sizes of coordinates, of rates, and of each internal variable: what differences are relative
    to."""
    assert case.mechanics is not None
    nq, nz, nr, _ = case.mechanics.kinds
    n = nq + nz + nr
    largest = np.max(np.abs(np.vstack([states, case.start])), axis=0)
    size = np.array(largest)
    size[:n] = np.max(largest[:n], initial=0.0)
    size[n : n + nq] = np.max(largest[n : n + nq], initial=0.0)
    return np.maximum(size, LEAST)


def compare(case: Case, motion: ss.Trajectory, reference: Motion) -> Verdict:
    """Compare states, forces and modes; what ended before is compared as far as it got."""
    unit = case.units.get("time", 1.0)
    reached = (float(motion.knots.time[-1]) - case.origin) / unit
    ended = not motion.outcome.ok
    numbers = {"outcome": motion.outcome.label, "certificate": motion.certificate.verdict}
    keep = reference.times <= min(reached, reference.end) * (1 - 1e-9 * ended)
    times, states = reference.times[keep], reference.states[keep]
    sampled = motion.at(np.clip(case.origin + times * unit, case.span[0], motion.knots.time[-1]))
    found = np.array(
        [np.asarray(sampled[n]) / case.units.get(n, 1.0) for n in case.names]
    ).T.reshape(states.shape)
    size = sizes(case, reference.states)
    off = np.max(np.abs(found - states) / size, axis=1, initial=0.0)
    off = np.where(np.isfinite(off), off, np.inf)
    numbers |= {"difference": float(np.max(off, initial=0.0)), "switches": len(reference.phases)}
    fault = ""
    if np.any(off > max(CLOSE, 10 * case.noise)):
        allowed, numbers["condition"] = tolerance(case, reference, times, size)
        if np.any(off > allowed):
            worst = int(np.argmax(off / allowed))
            fault = f"states differ by {off[worst]:.1e}"
            expected = dict(zip(case.names, map(float, states[worst]), strict=True))
            got = dict(zip(case.names, map(float, found[worst]), strict=True))
            numbers |= {"time": float(times[worst]), "expected": expected, "got": got}
    elif case.friction and not ended:
        fault = compare_contacts(case, motion, reference, times, sampled)
    return _said(case, motion, reference, reached, fault, numbers)


def _said(
    case: Case, motion: ss.Trajectory, reference: Motion, reached: float, fault: str, numbers: dict
) -> Verdict:
    """What the library says of its motion, and what is to be said of that."""
    certified = motion.certificate.ok
    ended = not motion.outcome.ok
    kind_of_fault = re.sub(r"by .*|at t = .*", "", fault).strip()
    numbers |= {"fault": fault} if fault else {}
    if fault and certified:
        return Verdict(WRONG, kind_of_fault, numbers)
    if ended:
        same = (
            reference.outcome == motion.outcome.label
            and abs(reached - reference.end) < 1e-5 * case.duration
        )
        if same and not fault:
            return Verdict(AGREED, motion.outcome.label, numbers)
        note = motion.outcome.label + ("; yet the certificate is ok" if certified else "")
        return Verdict(
            REFUSED, note, numbers | {"reached": reached, "reference": reference.outcome}
        )
    if reference.outcome != "finished":
        numbers |= {"reference": reference.outcome, "end": reference.end}
        return Verdict(
            WRONG if certified else NOT_CERTIFIED, f"goes on beyond {reference.outcome}", numbers
        )
    if not certified:
        found = motion.certificate
        reasons = [r.name for r in found.residuals if not r.ok] + [
            "not verified everywhere"
        ] * bool(found.unverified)
        return Verdict(
            NOT_CERTIFIED, ", ".join(reasons) + (", and wrong" if fault else ", but right"), numbers
        )
    if motion.outcome is ss.Outcome.AT_REST and moves_later(case, reference):
        return Verdict(WRONG, "moves again where it is said to rest forever", numbers)
    return Verdict(AGREED, "", numbers)


def moves_later(case: Case, reference: Motion) -> bool:
    """Whether the motion goes on after the span, in three times its length."""
    assert case.mechanics is not None
    later = integrate(
        case.mechanics, (0.0, 4 * case.duration), case.start, np.array([4 * case.duration]), 1e-10
    )
    return len(later.phases) > len(reference.phases)


def many(case: Case, motion: ss.Trajectory, agreed: Verdict) -> Verdict:
    """Every fourth motion is computed by `simulate_many` as well."""
    if case.seed % 4:
        return agreed
    ended = ss.simulate_many(
        case.system,
        case.span,
        initial={n: [v] for n, v in case.initial.items()},
        parameters={n: [v] for n, v in case.parameters.items()},
        max_events=MOST_EVENTS,
        atol=case.atol,
        workers=1,
    ).dataset
    final = np.array([float(ended[f"final_{n}"][0]) / case.units.get(n, 1.0) for n in case.names])
    own = np.array([motion.final[n] / case.units.get(n, 1.0) for n in case.names])
    gap = float(np.max(np.abs(final - own) / sizes(case, own[None]), initial=0.0))
    if not gap <= CLOSE:
        return Verdict(WRONG, "simulate_many ends elsewhere", agreed.numbers | {"gap": gap})
    return agreed


def tolerance(case: Case, reference: Motion, times: Array, size: Array) -> tuple[Array, float]:
    """How far a right motion may be off at each time, and the condition of the motion.

    The reference's own error is seen by a hundred times its tolerance. The condition is how much
    more a motion differs than its start and its friction do.
    """
    assert case.mechanics is not None
    m = case.mechanics
    rng = np.random.default_rng(case.seed)
    kick = SHIFT * m.held(case.start, size * rng.choice([-1.0, 1.0], len(size)))
    runs = [
        (m, case.start, 1e-10, 1.0),
        (m, case.start + kick, 1e-12, SHIFT),
        (m, case.start - kick, 1e-12, SHIFT),
        (m.stronger(1 + SHIFT), case.start, 1e-12, SHIFT),
        (m.stronger(1 - SHIFT), case.start, 1e-12, SHIFT),
    ]
    own, condition = np.zeros(len(times)), np.zeros(len(times))
    for mechanics, start, rtol, shift in runs:
        try:
            with at_most(PATIENCE):
                other = integrate(mechanics, (0.0, case.duration), start, reference.times, rtol)
        except (NoAnswer, OutOfTime):
            continue
        common = min(len(times), len(other.times))
        gap = np.full(len(times), np.inf if rtol > 1e-12 else 0.0)
        gap[:common] = np.max(
            np.abs(other.states[:common] - reference.states[:common]) / size, axis=1, initial=0.0
        )
        if rtol > 1e-12:
            own = np.minimum(gap, 1.0)
        else:
            condition = np.maximum(condition, gap / shift)
    # What was wrong once stays wrong: errors are as large as the largest before.
    condition = np.maximum.accumulate(condition)
    allowed = max(CLOSE, 10 * case.noise) + 0.1 * np.maximum.accumulate(own) + CERTIFIED * condition
    return allowed, float(np.max(condition, initial=0.0))


def compare_contacts(
    case: Case, motion: ss.Trajectory, reference: Motion, times: Array, sampled: dict
) -> str:
    """Forces at the sample times, away from switches, and modes in the middle of every phase that
    is long enough."""
    keys = [re.sub(r"\W", "_", name) for name in case.system.contacts]
    switched = np.array([phase.time for phase in reference.phases])
    gap = LONG * case.duration
    calm = np.array([np.min(np.abs(switched - t), initial=np.inf) > gap for t in times], dtype=bool)
    expected = reference.friction[: len(times)][calm]
    got = np.array([np.asarray(sampled[f"friction_{key}"]) for key in keys]).T.reshape(
        len(times), -1
    )
    got = got[calm] / case.units.get("force", 1.0)
    # What rests without a load is held by rounding errors: forces are measured against their
    # thresholds, too.
    thresholds = [
        np.abs(np.asarray(sampled[f"threshold_{side}_{key}"]))
        for key in keys
        for side in ("plus", "minus")
    ]
    size = max(
        np.nanmax(thresholds, initial=0.0) / case.units.get("force", 1.0),
        np.nanmax(np.abs(expected), initial=0.0),
    )
    worst = np.nanmax(np.abs(got - expected), initial=0.0) / max(size, 1e-300)
    if worst > 100 * max(CLOSE, 10 * case.noise):
        return f"friction forces differ by {worst:.1e}"
    return compare_modes(case, motion, reference, keys)


def compare_modes(case: Case, motion: ss.Trajectory, reference: Motion, keys: list[str]) -> str:
    """The same modes for as long as it matters: where they differ, so little moves that it cannot
    be seen."""
    contacts = [c.name for c in motion.problem.compiled.equations.contacts]
    times = (np.asarray(motion.knots.time) - case.origin) / case.units.get("time", 1.0)
    theirs = np.array([phase.time for phase in reference.phases])
    for i, (key, name) in enumerate(zip(keys, case.system.contacts, strict=True)):
        own = phases(times, np.asarray(motion.knots.mode)[:, contacts.index(name)], case.duration)
        expected = phases(
            theirs, np.array([phase.mode[i] for phase in reference.phases]), case.duration
        )
        for begin, end, mode in own:
            for other_begin, other_end, other in expected:
                first, last = max(begin, other_begin), min(end, other_end)
                if mode != other and last - first > (LONG + case.noise) * case.duration:
                    slip = slip_between(case, motion, i, key, (first + last) / 2) * (last - first)
                    if slip > CLOSE * np.max(sizes(case, reference.states)):
                        return f"modes of '{key}' differ at t = {(first + last) / 2:.9g}"
    return ""


def slip_between(case: Case, motion: ss.Trajectory, contact: int, key: str, time: float) -> float:
    """Larger one of the relative velocities that the library and the reference give a contact."""
    m = case.mechanics
    unit = case.units.get("time", 1.0)
    assert m is not None
    rates = integrate(m, (0.0, case.duration), case.start, np.array([time])).rates[0]
    w = m.belt(time)[contact] if m.belt is not None else 0.0
    expected = np.dot(m.J[contact], rates[: len(m.J[contact])]) - w
    slip = case.units.get("slip", 1.0) * case.units.get(case.names[0], 1.0) / unit
    got = motion.at(case.origin + time * unit)[f"slip_speed_{key}"] / slip
    return max(abs(expected), abs(got))


def phases(times: Array, modes: Array, end: float) -> list[tuple[float, float, int]]:
    """Beginning, end and mode of every phase of one contact."""
    new = np.flatnonzero(np.append(True, modes[1:] != modes[:-1]))
    return list(zip(times[new], np.append(times[new][1:], end), modes[new], strict=True))


def reproduction(case: Case) -> str:
    """A script that repeats a case."""
    return case.source()
