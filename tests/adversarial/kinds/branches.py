"""Branches of cycles: folds and onsets of stick against shooting on the reference's motion.

A special point is judged by cycles of the reference on both sides of it, at a small distance along
the branch. At an onset they stick on one side and not on the other; at a fold the parameter is
beyond that of the point on no side, and what is left to its extremum is measured. No derivative is
the library's: the return map is differenced, on either side of a change of the phases by itself.
What the branch itself shows has to be named, too: where the parameter turns back along its points,
and where they begin or cease to stick.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

import stickslip as ss

from ..case import declaration
from ..families.branching import FAMILIES, Branching
from ..references.event_driven import Phase, Run, integrate
from ..references.mechanics import Array, Mechanics, pair
from ..references.pieces import NoAnswer, Piece
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

PATIENCE = 120.0  # seconds of the processor for the library, and for the reference
BESIDE = 1e-6  # how far beside a point derivatives are asked, and an onset is looked at
FARTHER = (3e-4, 3e-5)  # … and where the parameter turns smoothly
FINE = 1e-12  # tolerance of the reference
NUDGE = 1e-9  # change of an unknown that shows how fast motions part
CLOSES = 1e-7  # a motion of the reference that misses by more is no cycle
VALUE = 1e-8  # of the range: what a value may be off
CLOSED = 1e-10  # what is left of the equations, in units of the cycle
ONSET = 1e-7  # what is left of speeds and forces at an onset, relative to their size
EVERY = 400  # times in a phase, between which least speeds are looked for
SHORT = 1e-3  # of the period: a stick that may just have begun
LASTS = 1e-10  # of the period: a phase that is shorter is none
KINDS = ("stick onset", "fold")
TURNS = 1e-7  # of the range: the parameter turns by more


def cases(seed: int = 0, count: int = 100) -> Iterator[Branching]:
    """Cases of all families in turn; each depends on its family and its own seed alone."""
    return in_turn(FAMILIES, draw, seed, count)


def judge(case: Branching) -> Verdict:
    """Ask the library for the branch, and hold its special points against the reference."""
    with np.errstate(all="ignore"):
        found = branch_of(case)
        if isinstance(found, str):
            return Verdict(REFUSED, without_numbers(found.split(": ", 1)[-1][:80]))
        own = [point for point in found.special if point.kind in KINDS]
        numbers: dict[str, Any] = {"special points": len(own), "ended": found.ended}
        if not found.certificate.ok:
            faults = [r.name for r in found.certificate.residuals if not r.ok]
            why = found.certificate.verdict
            return Verdict(NOT_CERTIFIED, ", ".join(faults), numbers | {"why": why})
        fault = unnamed(case, found)
        if fault:
            return Verdict(WRONG, fault, numbers)
        missed = ""
        for point in own:
            where = {"point": point.describe()}
            try:
                with at_most(PATIENCE):
                    fault, measured = checked(case, found, point)
            except (NoAnswer, OutOfTime, np.linalg.LinAlgError) as error:
                missed = missed or without_numbers(str(error))
                continue
            numbers |= measured
            if fault:
                return Verdict(WRONG, fault, numbers | where)
        if missed:
            return Verdict(NO_REFERENCE, missed, numbers)
        return Verdict(AGREED, "" if own else "nothing special", numbers)


def branch_of(case: Branching) -> ss.Branch | str:
    """The library's branch, or what it says instead."""
    try:
        with at_most(PATIENCE):
            cycle = ss.find_cycle(case.system, case.initial, parameters=case.parameters)
            branch = ss.continue_cycle(cycle, case.parameter, case.reach)
            _ = branch.points
            return branch
    except ss.StickslipError as error:
        return str(error)
    except OutOfTime as error:
        return f"a branch: {error}"
    except Exception as error:  # whatever it raises is a finding
        return f"a branch: raises {type(error).__name__}: {error}"


def reproduction(case: Branching) -> str:
    """A script that repeats what the library did."""
    numbers = {name: float(value) for name, value in case.parameters.items()}
    start = {name: float(value) for name, value in case.initial.items()}
    return (
        f"system = {declaration(case.system)}\n"
        f"cycle = ss.find_cycle(system, {start}, parameters={numbers})\n"
        f"branch = ss.continue_cycle(cycle, {case.parameter!r}, {case.reach})\n"
        "print(branch.message, branch.certificate.describe())"
    )


# -- what the branch itself shows ------------------------------------------------------------------


def unnamed(case: Branching, branch: ss.Branch) -> str:
    """What its points show and no special point names."""
    values = branch.points[case.parameter].values
    width = case.reach[1] - case.reach[0]
    steps = np.diff(values) / width
    some = np.flatnonzero(np.abs(steps) > TURNS)
    turns = [(i + 1, j) for i, j in pairwise(some) if steps[i] * steps[j] < 0.0]
    for first, last in turns:
        near = range(first - 1, last + 2)
        if not any(p.kind in ("fold", "branch point") and p.index in near for p in branch.special):
            return "a fold is missing"
    sticks = branch.points["sticks"].values
    kinds = ("stick onset", "slip onset", "loss of the cycle")
    for i in np.flatnonzero(np.diff(sticks)):
        near = range(i, i + 3)
        if not any(p.kind in kinds and p.index in near for p in branch.special):
            return "an onset is missing"
    return ""


# -- cycles of the reference -----------------------------------------------------------------------


@dataclass
class Seen:
    """A motion over a period: where it ends, its modes and regions, and how near contacts are to
    the onset of stick, by speeds and by forces at reversals."""

    end: Array
    phases: tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]
    margins: list[float]

    @property
    def short(self) -> bool:
        """Whether an onset is one at a reversal, where short sticks are not resolved."""
        return min(map(abs, self.margins), default=math.inf) > 0.0

    @property
    def sticks(self) -> int:
        """How often a contact begins to stick."""
        modes = [mode for mode, _ in self.phases]
        pairs = zip(modes, modes[1:] + modes[:1], strict=True)
        return sum(b == 0 != a for p, q in pairs for a, b in zip(p, q, strict=True))


class Shooting:
    """Cycles near a special point: z = (state, period, drift, parameter) in units of the cycle,
    from z = 0 at the point.

    The first state lies well inside a phase in which all of its changes are free.
    """

    def __init__(self, case: Branching, point: ss.SpecialPoint) -> None:
        assert point.period is not None
        self.case = case
        self.value = point.value
        self.period = point.period
        self.width = case.reach[1] - case.reach[0]
        state = np.array([point.state[name] for name in case.names])
        time = float(point.data.get("time", 0.0))
        self.time, self.state, self.sizes = self._well_inside(time, state)
        self.shift = np.array([name in case.together for name in case.names], dtype=float)
        m = self._mechanics(self.value)
        rate = integrate(m, (0.0, 1e-6), self.state, np.array([0.0])).rates[0]
        n = len(state)
        own = sum(m.kinds[:3])
        # Rates of the coordinates, then those of inertial velocities and internal variables.
        self.rate = np.concatenate([rate[:own], rate[own:n]]) / self.sizes
        self.rate /= np.linalg.norm(self.rate)
        self.n = n
        self.drift = 0.0
        # What sticks throughout comes back wherever it rests, and stays there along the branch.
        self.rests = np.zeros(n, dtype=bool)

    def _mechanics(self, value: float, time: float | None = None) -> Mechanics:
        """The mechanics with a clock that begins where the cycle does."""
        return self.case.at(value).later(self.time if time is None else time)

    def _well_inside(self, time: float, state: Array) -> tuple[float, Array, Array]:
        """Time and state in the middle of the longest phase whose states are free, and half the
        ranges of the state."""
        m = self._mechanics(self.value, time)
        run = Run(m, 0.0, state, self.period, np.zeros(0), FINE)
        run.path = []
        run.follow(self.period)
        starts = np.array([t for t, _ in run.path])
        t = np.linspace(0.0, self.period, 401)[:-1]
        steps = np.clip(np.searchsorted(starts, t, side="right") - 1, 0, len(starts) - 1)
        states = np.array([run.path[i][1](s) for i, s in zip(steps, t, strict=True)])
        home = self.case.at_home(states)
        sizes = 0.5 * np.ptp(home, axis=0)
        sizes = np.maximum(sizes, 1e-3 * np.max(sizes))
        inertial, inside = m.kinds[0], sum(m.kinds[:2])
        J = np.abs(np.asarray(m.J, dtype=float))
        quick, tied = (J[:, :inertial] > 0.0).any(axis=1), (J[:, inside:] > 0.0).any(axis=1)
        best = (0.0, 0.0)
        for phase, end in zip(run.phases, [*(p.time for p in run.phases[1:]), run.t], strict=True):
            if np.any((phase.mode == 0) & quick) or np.any((phase.mode != 0) & tied):
                continue
            t = np.linspace(phase.time, end, EVERY)[10:-10]
            u = np.array([speeds(run, phase, s) for s in t])
            u = np.where(phase.mode == 0, 1.0, u / np.maximum(u.max(axis=0), 1e-300)).min(axis=1)
            i = int(np.argmax(u))
            best = max(best, ((end - phase.time) * float(u[i]), float(t[i])))
        if best[0] == 0.0:
            raise NoAnswer("no phase whose states are free")
        middle = best[1]
        return time + middle, run_to(m, state, middle), sizes

    def __call__(self, z: Array) -> tuple[Array, Seen]:
        """What is left of the equations, and the motion."""
        n = self.n
        y = self.state + self.sizes * z[:n]
        T = self.period * math.exp(z[n])
        value = self.value + self.width * z[-1]
        seen = follow(self._mechanics(value), y, T)
        drift = self.drift + z[n + 1] * self.scale if self.together else 0.0
        missed = (seen.end - y - drift * self.shift) / self.sizes
        missed = np.where(self.rests, z[:n], missed)
        more = [np.exp(z[n]) - self.driven(value) if self.case.driven else self.rate @ z[:n]]
        if self.together:
            more.append(float((self.shift / self.shift.sum()) @ z[:n]))
        return np.append(missed, more), seen

    @property
    def together(self) -> bool:
        """Whether coordinates can be shifted."""
        return bool(np.any(self.shift))

    @property
    def scale(self) -> float:
        """Unit of the drift."""
        return float(np.max(self.sizes * self.shift))

    def driven(self, value: float) -> float:
        """The period of the load, relative to that of the cycle."""
        now = 2.0 * np.pi / {**self.case.parameters, self.case.parameter: value}["omega"]
        here = {**self.case.parameters, self.case.parameter: self.value}["omega"]
        rounds = round(self.period * here / (2.0 * np.pi))
        return float(rounds * now / self.period)

    def at_point(self) -> tuple[float, Seen]:
        """By how much the motion at the point fails to close, and the motion."""
        if self.together:
            at = follow(self._mechanics(self.value), self.state, self.period)
            self.drift = float(((at.end - self.state) @ self.shift) / self.shift.sum())
        F, seen = self(np.zeros(self.n + 2 + self.together))
        return float(np.linalg.norm(F)), seen

    def steepest(self) -> float:
        """By how much a motion misses, at most, for a change of an unknown."""
        zero = np.zeros(self.n + 2 + self.together)
        here, _ = self(zero)
        found = 0.0
        for i in range(len(zero)):
            z = zero.copy()
            z[i] = NUDGE
            found = max(found, float(np.linalg.norm(self(z)[0] - here)) / NUDGE)
        return found

    def sides(self) -> list[Side]:
        """Both sides of the point: derivatives, and the direction of the branch.

        Of every pair of changes of an unknown, up and down, one lies on either side of a change of
        the phases; where there is none, both are of one side.
        """
        count = self.n + 1 + self.together
        zero = np.zeros(count + 1)
        for i in range(self.n):
            z = zero.copy()
            z[i] = BESIDE
            y = self.state + self.sizes * z[: self.n]
            end = follow(self._mechanics(self.value), y, self.period).end
            own = self.case.names[i]
            kind = self.case.system.coordinates.get(own)
            self.rests[i] = isinstance(kind, ss.RateIndependent) and end[i] == y[i]
        here, _ = self(zero)
        looks = []
        for i in range(count + 1):
            for sign in (1.0, -1.0):
                z = zero.copy()
                z[i] = sign * BESIDE
                F, seen = self(z)
                looks.append((i, (F - here) / z[i], seen.phases))
        names = dict.fromkeys(phases for _, _, phases in looks)
        sides = []
        for name in names:
            J = np.zeros((count, count + 1))
            for i in range(count + 1):
                own = [slope for j, slope, phases in looks if j == i and phases == name]
                every = [slope for j, slope, _ in looks if j == i]
                J[:, i] = np.mean(own or every, axis=0)
            tangent = np.linalg.svd(J)[2][-1]
            sides.append((name, J, tangent))
        if len(sides) == 1:
            name, J, tangent = sides[0]
            return [Side(self, J, tangent), Side(self, J, -tangent)]
        found = []
        for name, J, tangent in sides:
            for sign in (1.0, -1.0):
                if self(sign * 2.0 * BESIDE * tangent)[1].phases == name:
                    found.append(Side(self, J, sign * tangent))
                    break
        if len(found) != 2:
            raise NoAnswer(f"{len(found)} sides")
        return found


@dataclass
class Side:
    """The branch on one side of a point."""

    shooting: Shooting
    J: Array
    tangent: Array

    def at(self, length: float) -> tuple[Array, Seen]:
        """The cycle at a distance along the direction, by Newton's method with Broyden's updates.

        Raises
        ------
        NoAnswer
            If there is none.
        """
        M = np.vstack([self.J, self.tangent])
        z = length * self.tangent
        F, seen = self.shooting(z)
        for _ in range(25):
            step = -np.linalg.solve(M, np.append(F, self.tangent @ z - length))
            if np.linalg.norm(np.append(F, self.tangent @ z - length)) <= CLOSED:
                return z, seen
            z = z + step
            new, seen = self.shooting(z)
            missed = np.append(new, self.tangent @ z - length)
            if not np.all(np.isfinite(missed)) or np.linalg.norm(z) > 1.0:
                break
            M = M + np.outer(missed, step) / (step @ step)
            F = new
        raise NoAnswer("the reference finds no cycle")


def follow(m: Mechanics, y: Array, T: float) -> Seen:
    """A motion over a time."""
    run = Run(m, 0.0, y, T, np.zeros(0), FINE)
    run.path = []
    run.follow(T)
    lengths = np.diff([*(phase.time for phase in run.phases), T])
    phases = [
        (tuple(map(int, phase.mode)), tuple(map(int, phase.side)))
        for phase, length in zip(run.phases, lengths, strict=True)
        if length > LASTS * T
    ]
    if len(phases) > 1 and phases[0] == phases[-1]:
        phases = phases[:-1]
    kept = [phase for i, phase in enumerate(phases) if phase != phases[i - 1]] or phases[:1]
    around = min(tuple(kept[i:] + kept[:i]) for i in range(len(kept)))
    return Seen(run.y, around, [*touches(run), *reversals(run)])


def speeds(run: Run, phase: Phase, t: float) -> Array:
    """Moduli of the relative velocities at a time within a phase."""
    assert run.path is not None
    piece = Piece(run.m, phase.mode, phase.side)
    i = max(int(np.searchsorted([s for s, _ in run.path], t)) - 1, 0)
    rates = piece.rates(t, run.path[i][1](t))[0][: sum(run.m.kinds[:3])]
    return np.abs(piece.J @ rates - piece.belt(t)[0])


def touches(run: Run) -> list[float]:
    """Least slip speeds within phases, relative to the largest; 0 for a stick that is short."""
    m = run.m
    assert run.path is not None
    found = []
    ends = [*(phase.time for phase in run.phases[1:]), run.t]
    for phase, end in zip(run.phases, ends, strict=True):
        if end - phase.time <= LASTS * run.t:
            continue
        t = np.linspace(phase.time, end, 2 + EVERY)[1:-1]
        u = np.array([speeds(run, phase, s) for s in t])
        for c in range(len(m.J)):
            if phase.mode[c] == 0:
                found += [0.0] if end - phase.time <= SHORT * run.t else []
                continue
            for i in range(1, len(t) - 1):
                if u[i, c] < u[i - 1, c] and u[i, c] <= u[i + 1, c]:
                    least: Any = minimize_scalar(
                        lambda s, c=c, phase=phase: float(speeds(run, phase, s)[c]),
                        bounds=(t[i - 1], t[i + 1]),
                        method="bounded",
                        options={"xatol": 1e-9 * run.t},
                    )
                    found.append(float(least.fun / u[:, c].max()))
    return found


def reversals(run: Run) -> list[float]:
    """By how much the force that would hold a mass misses its threshold, where it slips back; known
    of a single one, on a belt that may move."""
    m = run.m
    if m.kinds[0] != 1 or len(m.J) != 1 or sum(m.kinds) > 1:
        return []
    assert run.path is not None
    starts = [t for t, _ in run.path]
    along, mass = float(m.J[0][0]), float(np.asarray(m.inertia)[0, 0])
    found = []
    for before, after in pairwise(run.phases):
        if before.mode[0] * after.mode[0] == -1:
            t = after.time
            i = max(int(np.searchsorted(starts, t)) - 1, 0)
            carried = [float(w[0]) / along for w in Piece(m, after.mode, after.side).belt(t)]
            state = (t, run.path[i][1](t)[:1], np.array(carried[:1]), np.zeros(0), after.side)
            push = (float(m.force(*state)[0]) - mass * carried[1]) / along
            plus, minus = pair(m.threshold(*state))
            found.append(abs(push) / float((plus if push > 0.0 else minus)[0]) - 1.0)
    return found


def run_to(m: Mechanics, y: Array, T: float) -> Array:
    """The state after a time."""
    return integrate(m, (0.0, T), y, np.array([T])).states[-1]


# -- special points --------------------------------------------------------------------------------


def checked(case: Branching, branch: ss.Branch, point: ss.SpecialPoint) -> tuple[str, dict]:
    """Hold a fold or an onset of stick against cycles of the reference on both sides."""
    shooting = Shooting(case, point)
    missed, seen = shooting.at_point()
    if missed > CLOSES:
        if FINE * shooting.steepest() > CLOSES:
            raise NoAnswer("motions part faster than the reference is known")
        return "no cycle of the reference", {"missed": missed}
    numbers: dict[str, Any] = {}
    if point.kind == "stick onset":
        margin = min(map(abs, seen.margins), default=math.inf)
        numbers = {"margin": margin}
        if margin > ONSET:
            return "the onset is elsewhere", numbers
    try:
        sides = shooting.sides()
    except NoAnswer:
        if point.kind == "stick onset":
            return "", numbers | {"sides": "not told apart"}
        raise
    z, _ = sides[0].at(0.0)
    if point.kind == "fold":
        return fold(sides, float(z[-1]))
    sticks = [side.at(BESIDE)[1].sticks for side in sides]
    numbers |= {"off": abs(float(z[-1])), "sticks": sticks}
    if sticks[0] == sticks[1] and not seen.short:
        return "the reference sticks as often on both sides of the onset", numbers
    return ("the onset is elsewhere" if numbers["off"] > VALUE else ""), numbers


def fold(sides: list[Side], here: float) -> tuple[str, dict]:
    """Whether the parameter turns back, and where."""
    corner = sides[0].J is not sides[1].J
    numbers: dict[str, Any] = {}
    fault = ""
    for length in (BESIDE,) if corner else FARTHER:
        ahead, back = [float(side.at(length)[0][-1]) - here for side in sides]
        numbers = {"ahead": ahead, "back": back, "off": abs(here)}
        if corner and ahead * back > 0.0:
            # On a smooth side the extremum may lie a little further on.
            return ("the fold is elsewhere" if abs(here) > VALUE else ""), numbers
        bend = (ahead + back) / length**2
        slope = (ahead - back) / (2.0 * length)
        left = slope**2 / (2.0 * abs(bend)) + abs(here)
        numbers["off"] = left
        if left <= VALUE and abs(bend) * length > abs(slope):
            return "", numbers
        fault = (
            "the parameter does not turn back there" if left <= VALUE else "the fold is elsewhere"
        )
    return fault, numbers
