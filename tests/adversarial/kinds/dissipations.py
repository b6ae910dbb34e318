"""Contacts in a plane and faces whose dissipation is a formula: the library against
:mod:`..references.smoothed`, and against the law itself."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

import stickslip as ss

from ..families.dissipations import FAMILIES, Rubbed
from ..references.directed import Directed
from ..references.mechanics import Array
from ..registry import in_turn
from ..verdict import Verdict
from .points import LAWFUL, LEAST, LONG, NONE, judged

__all__ = ["FAMILIES", "cases", "draw", "judge", "reproduction"]

draw = FAMILIES.draw
WAYS = 3000  # in which forces of rest are compared with R


def cases(seed: int = 0, count: int = 100) -> Iterator[Rubbed]:
    """Cases of all families in turn."""
    return in_turn(FAMILIES, draw, seed, count)


def reproduction(case: Rubbed) -> str:
    """A script that repeats a case."""
    return case.source()


def judge(case: Rubbed) -> Verdict:
    """Compute a motion twice and compare."""
    return judged(case, lambda found: lawless(case, found))


@cache
def ways(count: int) -> Array:
    """Directions, shape (WAYS, count)."""
    found = np.random.default_rng(0).normal(size=(WAYS, count))
    found[: 2 * count] = np.concatenate([np.eye(count), -np.eye(count)])
    return found / np.linalg.norm(found, axis=1)[:, None]


def needed(board: Directed, force: Array) -> float:
    """What part of its set of forces, of threshold 1, a force needs: the largest −λ·v/R(v) of
    sampled directions."""
    return max(float(-force @ v) / board.dissipation(v)[0] for v in ways(board.rule.count))


def lawless(case: Rubbed, found: ss.Trajectory) -> tuple[str, float]:
    """What breaks the law of friction, by kinematics and forces that are computed here, in the
    middle of all phases that are long enough; and the largest force of what sticks, in parts of its
    threshold."""
    board = case.board()
    n, d = board.size, board.rule.count
    clock = np.asarray(found.knots.time) / case.time
    names = ["rub", "line"] if case.shape.line else ["rub"]
    table = np.array([found.modes[name] for name in names]).T
    changed = np.append(True, np.any(np.diff(table, axis=0) != 0, axis=1))
    starts = clock[changed]
    ends = np.append(starts[1:], clock[-1])
    long = ends - starts > LONG * case.duration
    if not np.any(long):
        return "", 0.0
    starts, ends, modes = starts[long], ends[long], table[changed][long]
    middles = np.concatenate([starts + part * (ends - starts) for part in (0.3, 0.5, 0.8)])
    modes = np.tile(modes, (3, 1))
    sampled = found.at(np.minimum(middles * case.time, found.knots.time[-1]))

    def got(name: str, unit: float) -> Array:
        return np.asarray(sampled[name]) / unit

    states = np.array([got(x, case.unit(x)) for x in case.names]).T
    second = np.array([got(f"dd_{x}", case.unit(x) / case.time**2) for x in case.shape.names]).T
    work = case.force * case.length
    forces = np.array([got(f"friction_rub_{i + 1}", work / case.component(i)) for i in range(d)]).T
    along = got("friction_line", case.force) if case.shape.line else np.zeros(len(middles))
    fast = max(float(np.max(np.abs(states[:, n:]))), LEAST)
    full = 0.0
    for i, t in enumerate(middles):
        q, v, force = states[i, :n], states[i, n:], forces[i]
        u = board.slide(t, q, v)
        hold = board.threshold(t, q)
        size = hold + float(np.max(np.abs(board.loaded(t, q, v))))
        speed = float(np.linalg.norm(u))
        if modes[i, 0] == 0:
            if speed > NONE * fast:
                return f"it is said to stick, and slips with {speed:.1e} at t = {t:.9g}", full
            part = needed(board, force) / hold
            full = max(full, part)
            if part > 1.0 + LAWFUL * size / hold:
                return f"the force at rest is too large at t = {t:.9g}", full
        elif speed > 1e-6 * fast:
            R, slope = board.dissipation(u)
            expected = -board.sliding(R) * hold * slope
            if np.max(np.abs(force - expected)) > LAWFUL * size:
                return f"the friction in slip is another one at t = {t:.9g}", full
        elif i >= len(middles) // 3 and speed == 0.0:
            return f"it is said to slip, and does not at t = {t:.9g}", full
        if case.shape.line:
            rub, most = float(board.line @ v), case.numbers["sl"]
            if modes[i, 1] == 0 and (abs(rub) > NONE * fast or abs(along[i]) > most + LAWFUL):
                return f"the line is said to stick, and does not at t = {t:.9g}", full
            off = abs(along[i] + most * np.sign(rub))
            if modes[i, 1] != 0 and abs(rub) > 1e-6 * fast and off > LAWFUL * size:
                return f"the friction of the line is another one at t = {t:.9g}", full
        expected = board.accelerations(t, q, v, force, along[i])
        if np.max(np.abs(expected - second[i])) > LAWFUL * max(1.0, np.max(np.abs(second[i]))):
            return f"accelerations differ at t = {t:.9g}", full
    return "", full
