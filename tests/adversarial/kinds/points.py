"""Bodies on several points: the library against :mod:`..references.smoothed`, and against the law
itself."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

import numpy as np

import stickslip as ss

from ..families.dissipations import Rubbed
from ..families.points import FAMILIES, Carried
from ..references.mechanics import Array
from ..references.smoothed import FINE, LAWS, WIDTHS, Limit, limit, smoothed
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
CLOSE = 1e-7  # relative
DOUBT = 4.0  # times what the reference leaves open
DULL = 2e-3  # relative; a reference that leaves more open says nothing
LEAST = 1e-3  # natural size
LONG = 1e-5  # of the span: phases that have to be there
BESIDE = 3e-3  # of the span: from a switch to where states are compared beside it
NONE = 1e-10  # of the rates: what is no velocity where something sticks
LAWFUL = 1e-7  # of the forces: what may be missing in the law
RESTS = 1e-4  # rates of a smoothed motion that are creep
PATIENCE = 30.0

# What breaks the law of friction in a motion, and the largest part of a threshold that is needed.
Law = Callable[[ss.Trajectory], tuple[str, float]]


def cases(seed: int = 0, count: int = 100) -> Iterator[Carried]:
    """Cases of all families in turn."""
    return in_turn(FAMILIES, draw, seed, count)


def reproduction(case: Carried) -> str:
    """A script that repeats a case."""
    return case.source()


def judge(case: Carried) -> Verdict:
    """Compute a motion twice and compare."""
    return judged(case, lambda found: lawless(case, found))


def judged(case: Carried | Rubbed, law: Law) -> Verdict:
    """Compute a motion twice and compare; `law` says what breaks the law of friction in one."""
    with np.errstate(all="ignore"):
        found = simulated(case)
        times = instants(case, found)
        try:
            with at_most(PATIENCE):
                reference = limit(case.board(), started(case), times)
        except (OutOfTime, RuntimeError, ValueError) as error:
            return Verdict(NO_REFERENCE, without_numbers(f"{type(error).__name__}: {error}"))
        if isinstance(found, str):
            return Verdict(REFUSED, found)
        return compare(case, found, times, reference, law)


def simulated(case: Carried | Rubbed) -> ss.Trajectory | str:
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


def started(case: Carried | Rubbed) -> Array:
    """The initial state in natural units."""
    return np.array([case.start.get(name, 0.0) for name in case.names])


def instants(case: Carried | Rubbed, found: ss.Trajectory | str) -> Array:
    """Where states are compared: at random, on both sides of every switch, and at the end."""
    rng = np.random.default_rng(case.seed)
    times = [*rng.uniform(0.0, case.duration, 8), case.duration]
    if not isinstance(found, str):
        knots = found.knots
        changed = np.any(np.diff(knots.mode, axis=0) != 0, axis=1)
        switches = np.asarray(knots.time)[1:][changed] / case.time
        times += [t + by * case.duration for t in switches for by in (-BESIDE, BESIDE)]
    return np.unique(np.clip(times, 0.0, case.duration))


def sizes(case: Carried | Rubbed, states: Array) -> Array:
    """Sizes of coordinates and of rates: what differences are relative to."""
    n = len(case.shape.names)
    largest = np.max(np.abs(np.vstack([states, started(case)])), axis=0)
    return np.maximum(np.repeat([np.max(largest[:n]), np.max(largest[n:])], n), LEAST)


def compare(
    case: Carried | Rubbed, found: ss.Trajectory, times: Array, reference: Limit, law: Law
) -> Verdict:
    """Compare states, modes, forces, and what is said of rest."""
    certificate = found.certificate
    reached = float(found.knots.time[-1]) / case.time
    ended = not found.outcome.ok
    numbers = {"outcome": found.outcome.label, "certificate": certificate.verdict}
    size = sizes(case, reference.states)
    keep = times <= reached * (1.0 - 1e-9 * ended)
    states, doubt = reference.states[keep], reference.doubt[keep]
    sampled = found.at(np.minimum(times[keep] * case.time, found.knots.time[-1]))
    got = np.array([np.asarray(sampled[n]) / case.unit(n) for n in case.names]).T
    off = np.max(np.abs(got - states) / size, axis=1, initial=0.0)
    off = np.where(np.isfinite(off), off, np.inf)
    # What was in doubt once stays so.
    open_ = np.maximum.accumulate(np.max(doubt / size, axis=1, initial=0.0))
    allowed = CLOSE + DOUBT * open_
    numbers |= {"difference": float(np.max(off, initial=0.0))}
    numbers |= {"doubt": float(np.max(open_, initial=0.0))}
    sharp = open_ < DULL
    fault = ""
    if np.any((off > allowed) & sharp):
        worst = int(np.argmax(np.where(sharp, off / allowed, 0.0)))
        fault = f"states differ by {off[worst]:.1e}"
        numbers |= {"time": float(times[worst]), "allowed": float(allowed[worst])}
        numbers |= {"expected": states[worst].tolist(), "got": got[worst].tolist()}
    broken, numbers["full"] = law(found)
    fault = fault or broken
    numbers |= {"fault": fault} if fault else {}
    if fault and certificate.ok:
        return Verdict(WRONG, re.sub(r"by .*|at t = .*", "", fault).strip(), numbers)
    if ended:
        note = found.outcome.label + ("; yet the certificate is ok" if certificate.ok else "")
        return Verdict(REFUSED, note, numbers | {"reached": reached})
    if not certificate.ok:
        reasons = [r.name for r in certificate.residuals if not r.ok]
        reasons += ["not verified everywhere"] * bool(certificate.unverified)
        note = ", ".join(reasons) + (", and wrong" if fault else ", but right")
        return Verdict(NOT_CERTIFIED, note, numbers)
    if not np.all(sharp):
        return Verdict(NO_REFERENCE, "not sharp", numbers)
    if found.outcome is ss.Outcome.AT_REST and moves_later(case):
        return Verdict(WRONG, "moves again where it is said to rest forever", numbers)
    return Verdict(AGREED, "", numbers)


def moves_later(case: Carried | Rubbed) -> bool:
    """Whether it moves after the span, in three times its length."""
    times = np.linspace(1.0, 4.0, 61) * case.duration
    board = case.board()
    width = WIDTHS[0] * (FINE if board.drops else 1.0)
    states = smoothed(board, started(case), times, LAWS[0], width, 1e-9)
    return bool(np.max(np.abs(states[:, len(case.shape.names) :])) > RESTS)


def lawless(case: Carried, found: ss.Trajectory) -> tuple[str, float]:
    """What breaks the law of friction, by kinematics and forces that are computed here, in the
    middle of all phases that are long enough; and the largest force of what sticks, in parts of its
    threshold."""
    board = case.board()
    touches = board.touches()
    clock = np.asarray(found.knots.time) / case.time
    reached = float(clock[-1])
    names = [f"p{k}" for k, point in enumerate(case.shape.points) if not point.line]
    names += [f"p{k}" for k, point in enumerate(case.shape.points) if point.line]
    table = np.array([found.modes[name] for name in names]).T
    changed = np.append(True, np.any(np.diff(table, axis=0) != 0, axis=1))
    starts = clock[changed]
    ends = np.append(starts[1:], reached)
    long = ends - starts > LONG * case.duration
    if not np.any(long):
        return "", 0.0
    starts, ends, modes = starts[long], ends[long], table[changed][long]
    middles = np.concatenate([starts + part * (ends - starts) for part in (0.3, 0.5, 0.8)])
    modes = np.tile(modes, (3, 1))
    sampled = found.at(np.minimum(middles * case.time, found.knots.time[-1]))
    n = board.size
    states = np.array([np.asarray(sampled[x]) / case.unit(x) for x in case.names]).T
    second = np.array(
        [np.asarray(sampled[f"dd_{x}"]) / case.unit(x) * case.time**2 for x in case.shape.names]
    ).T
    fast = max(float(np.max(np.abs(states[:, n:]))), LEAST)
    full = 0.0
    for i, t in enumerate(middles):
        q, v = states[i, :n], states[i, n:]
        arm, at = touches.arms(q)
        own = touches.measured(q, touches.slide(t, q, v, arm, at))
        force = np.zeros(len(names), complex)
        for k, name in enumerate(names):
            keys = [f"{name}_1", f"{name}_2"] if k < touches.planes else [name]
            parts = [float(np.asarray(sampled[f"friction_{key}"])[i]) / case.force for key in keys]
            force[k] = complex(*parts)
        p = touches.planes
        real = force.copy()
        real[:p] = (
            np.real(force[:p]) / touches.axes[:, 0] + 1j * np.imag(force[:p]) / touches.axes[:, 1]
        )
        hold = touches.threshold(t)
        if case.shape.feet:
            bears = [np.asarray(sampled[f"normal_{name}"])[i] / case.force for name in names]
            parts = touches.in_space(q, real) / bears
            if np.max(np.abs(bears - board.pressed(arm, parts))) > LAWFUL * board.weight:
                return f"normal forces do not balance moments at t = {t:.9g}", full
            hold = hold * bears
        r = np.abs(own)
        soft = np.exp(-r / np.where(touches.fast > 0, touches.fast, 1.0))
        part = touches.drop + np.where(touches.fast > 0, (1.0 - touches.drop) * soft, 0.0)
        size = float(np.sum(hold)) + float(np.max(np.abs(board.loaded(t, q, v))))
        for k, name in enumerate(names):
            if modes[i, k] == 0:
                if r[k] > NONE * fast:
                    return (
                        f"'{name}' is said to stick, and slips with {r[k]:.1e} at t = {t:.9g}",
                        full,
                    )
                full = max(full, abs(real[k]) / hold[k])
                if abs(real[k]) - hold[k] > LAWFUL * size:
                    return f"the force of '{name}' at rest is too large at t = {t:.9g}", full
            elif r[k] > 1e-6 * fast:
                expected = -part[k] * hold[k] * own[k] / r[k]
                if abs(real[k] - expected) > LAWFUL * size:
                    return f"the friction of '{name}' in slip is another one at t = {t:.9g}", full
            elif i >= len(middles) // 3 and r[k] == 0.0:
                return f"'{name}' is said to slip, and does not at t = {t:.9g}", full
        pull = touches.in_space(q, real)
        expected = board.accelerations(t, q, v, *touches.sums(q, arm, at, pull))
        if np.max(np.abs(expected - second[i])) > LAWFUL * max(1.0, np.max(np.abs(second[i]))):
            return f"accelerations differ at t = {t:.9g}", full
    return "", full
