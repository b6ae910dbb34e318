"""Motions with contacts that open, by SciPy's DOP853 and by hand: accelerations from the linear
problem of a mode, impacts by trial of all cases of Newton's and Coulomb's law.

A mode says of every contact whether it is open, slips or sticks. It is followed until one of its
guards falls through zero; then all modes of the contacts that are at their boundary are tried, and
the one whose guards stay nonnegative for a short while is right.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

from .mechanics import Array
from .pieces import NoAnswer

OPEN, PLUS, MINUS, STICK = 0, 1, -1, 2
TOUCHES = 1e-9  # of the sizes of a case: gaps and velocities that count as zero at an event
SAMPLES = np.linspace(0.0, 1.0, 13)[1:]
MOST_EVENTS = 600


def nothing(*state: Any) -> float:
    """Zero, for what is straight or at rest."""
    return 0.0


@dataclass(frozen=True)
class Touch:
    """A contact that may open, or one with a given threshold.

    Attributes
    ----------
    gap : function (t, q) -> float, optional
        None: always closed, with friction of `threshold`.
    normal : function (t, q) -> d numbers
        ∂g/∂q.
    advance : function (t, q) -> float
        ∂g/∂t.
    bend : function (t, q, v) -> float
        g'' less normal·a.
    direction : function q -> d numbers, optional
        Slip u = direction·v − belt; None: smooth.
    turn : function (q, v) -> float
        u' less direction·a.
    mu, e, e_t, belt, threshold, pull : float
        The last is the adhesion: N ≥ −pull, with friction mu (N + pull).
    """

    gap: Callable[..., float] | None = None
    normal: Callable[..., Any] | None = None
    advance: Callable[..., float] = nothing
    bend: Callable[..., float] = nothing
    direction: Callable[..., Any] | None = None
    turn: Callable[..., float] = nothing
    mu: float = 0.0
    e: float = 0.0
    e_t: float = 0.0
    belt: float = 0.0
    threshold: float = 0.0
    pull: float = 0.0

    @property
    def least(self) -> float:
        """Friction without a normal force, while it is closed."""
        return self.threshold + self.mu * self.pull


@dataclass(frozen=True)
class Bodies:
    """What moves: mass(q) a = load(t, q, v) + forces of the contacts."""

    size: int
    mass: Callable[..., Any]
    load: Callable[..., Any]
    touches: Sequence[Touch]
    step: float = 0.1

    def pushed(self, factor: float) -> Bodies:
        """The same with all loads multiplied by what swings to and fro: energy is not kept then."""
        load, part = self.load, factor - 1.0
        return replace(
            self,
            load=lambda t, *state: (1 + part * np.cos(3 * t)) * np.asarray(load(t, *state)),
        )


@dataclass
class Path:
    """What the reference found: states at the times asked for, and how it ended."""

    states: Array
    end: float
    outcome: str = "finished"
    impacts: int = 0
    phases: list[tuple[float, tuple[int, ...]]] = field(default_factory=list)


@dataclass
class Follower:
    """A motion under way."""

    bodies: Bodies
    t: float
    y: Array
    rtol: float
    length: float
    speed: float
    touches: float = TOUCHES
    mode: tuple[int, ...] = ()
    impacts: int = 0
    hit: float = 0.0
    hard: set[int] = field(default_factory=set)
    dropped: set[int] = field(default_factory=set)

    # -- one mode ----------------------------------------------------------------------------------

    def solve(self, t: float, y: Array, mode: tuple[int, ...]) -> tuple[Array, Array, Array]:
        """Accelerations, normal forces and friction in a mode."""
        b = self.bodies
        d, c = b.size, len(b.touches)
        q, v = y[:d], y[d:]
        A = np.zeros((d + 2 * c, d + 2 * c))
        r = np.zeros(d + 2 * c)
        A[:d, :d] = b.mass(q)
        r[:d] = b.load(t, q, v)
        for i, touch in enumerate(b.touches):
            rows = (d + i, d + c + i)
            A[rows[0], rows[0]] = A[rows[1], rows[1]] = 1.0
            w = None if touch.direction is None else np.asarray(touch.direction(q), float)
            if touch.gap is None or mode[i] != OPEN:
                if touch.gap is not None and touch.normal is not None:
                    n = np.asarray(touch.normal(t, q), float)
                    A[:d, rows[0]] = -n
                    A[rows[0]] = 0.0
                    A[rows[0], :d] = n
                    r[rows[0]] = -touch.bend(t, q, v)
                if w is not None:
                    A[:d, rows[1]] = -w
                    if mode[i] == STICK:
                        A[rows[1]] = 0.0
                        A[rows[1], :d] = w
                        r[rows[1]] = -touch.turn(q, v)
                    else:
                        A[rows[1], rows[0]] = mode[i] * touch.mu
                        r[rows[1]] = -mode[i] * touch.least
        # Where contacts ask for the same, their forces are not unique: the least ones are taken.
        x, _, rank, _ = np.linalg.lstsq(A, r, rcond=1e-11)
        if rank < len(A) and np.max(np.abs(A @ x - r)) > 1e-9 * (1.0 + np.max(np.abs(r))):
            raise NoAnswer("singular mode")
        return x[:d], x[d : d + c], x[d + c :]

    def rates(self, mode: tuple[int, ...]) -> Callable[[float, Array], Array]:
        d = self.bodies.size
        return lambda t, y: np.concatenate([y[d:], self.solve(t, y, mode)[0]])

    def gap_speed(self, touch: Touch, t: float, y: Array) -> float:
        assert touch.normal is not None
        d = self.bodies.size
        return float(np.dot(touch.normal(t, y[:d]), y[d:])) + touch.advance(t, y[:d])

    def slip(self, touch: Touch, y: Array) -> float:
        assert touch.direction is not None
        d = self.bodies.size
        return float(np.dot(touch.direction(y[:d]), y[d:])) - touch.belt

    def guards(self, t: float, y: Array, mode: tuple[int, ...]) -> Array:
        """Per contact: the gap or the normal force; then the slip, or room of the friction."""
        d = self.bodies.size
        _, N, T = self.solve(t, y, mode)
        found = np.full((len(mode), 2), np.inf)
        for i, touch in enumerate(self.bodies.touches):
            if touch.gap is not None:
                found[i, 0] = touch.gap(t, y[:d]) if mode[i] == OPEN else N[i] + touch.pull
            if touch.direction is not None and mode[i] in (PLUS, MINUS):
                found[i, 1] = mode[i] * self.slip(touch, y)
            if touch.direction is not None and mode[i] == STICK:
                found[i, 1] = touch.mu * N[i] + touch.least - abs(T[i])
        return found.ravel()

    # -- deciding ----------------------------------------------------------------------------------

    def near(self) -> list[int]:
        """Contacts whose gap is zero."""
        d = self.bodies.size
        return [
            i
            for i, touch in enumerate(self.bodies.touches)
            if touch.gap is not None
            and abs(touch.gap(self.t, self.y[:d])) <= self.touches * self.length
        ]

    def decide(self) -> None:
        """The mode that is right from here on."""
        choices = []
        near = self.near()
        small = self.touches * self.speed
        for i, touch in enumerate(self.bodies.touches):
            options = []
            if touch.gap is not None:
                options.append(OPEN)
                if i not in near or self.gap_speed(touch, self.t, self.y) > small:
                    choices.append(options)
                    continue
            if touch.direction is None:
                options.append(PLUS)
            else:
                u = self.slip(touch, self.y)
                options += [STICK, PLUS, MINUS] if abs(u) <= small else [PLUS if u > 0 else MINUS]
            choices.append(options)
        candidates = sorted(product(*choices), key=lambda m: m.count(OPEN))
        best: tuple[float, tuple[int, ...]] = (-np.inf, self.mode)
        for h in (1e-3, 1e-5, 1e-7):
            scores = [(self.probe(m, h * self.bodies.step), m) for m in candidates]
            right = [m for s, m in scores if s >= 0.0]
            if any(touch.pull for touch in self.bodies.touches):
                # What can stay closed does.
                right = [m for m in right if m.count(OPEN) == right[0].count(OPEN)]
            if len(right) > 1 and self.differ(right):
                raise NoAnswer("several modes")
            if right:
                self.mode = right[0]
                return
            best = max(scores, key=lambda s: s[0])
        raise NoAnswer(f"no mode: best {best[0]:.1e}")

    def differ(self, modes: list[tuple[int, ...]]) -> bool:
        a = np.array([self.solve(self.t, self.y, m)[0] for m in modes])
        return bool(np.max(np.abs(a - a[0])) > 1e-6 * (1.0 + np.max(np.abs(a))))

    def probe(self, mode: tuple[int, ...], h: float) -> float:
        """Least of what has to be nonnegative in short steps, with what rounding does set aside:
        accelerations of gaps that are zero, forces, slips that begin."""
        f = self.rates(mode)
        near = self.near()
        touches = self.bodies.touches
        small = self.touches * self.speed
        least = np.inf
        try:
            force = 1.0 + float(np.max(np.abs(self.solve(self.t, self.y, mode)[1:])))
            t, y = self.t, self.y
            begins = [
                mode[i] in (PLUS, MINUS)
                and touch.direction is not None
                and abs(self.slip(touch, y)) <= small
                for i, touch in enumerate(touches)
            ]
            waits = [
                i in near and mode[i] == OPEN and self.gap_speed(touches[i], t, y) <= small
                for i in range(len(touches))
            ]
            for g in (0.3 * h, 0.7 * h):
                k1 = f(t, y)
                k2 = f(t + g / 2, y + g / 2 * k1)
                y = y + g * k2
                t = t + g
                found = self.guards(t, y, mode).reshape(-1, 2)
                for i, touch in enumerate(touches):
                    if waits[i]:
                        least = min(least, self.gap_acceleration(touch, t, y, mode) + 1e-10 * force)
                    elif mode[i] != OPEN and touch.gap is not None:
                        least = min(least, found[i, 0] + 1e-10 * force)
                    if begins[i]:
                        least = min(least, found[i, 1] + 1e-13 * self.speed)
                    elif mode[i] == STICK:
                        least = min(least, found[i, 1] + 1e-10 * force)
        except NoAnswer:
            return -np.inf
        return float(least)

    def gap_acceleration(self, touch: Touch, t: float, y: Array, mode: tuple[int, ...]) -> float:
        """g''."""
        assert touch.normal is not None
        d = self.bodies.size
        a = self.solve(t, y, mode)[0]
        return float(np.dot(touch.normal(t, y[:d]), a)) + touch.bend(t, y[:d], y[d:])

    # -- impacts -----------------------------------------------------------------------------------

    def collide(self) -> bool:
        """Let rates jump if a closed gap approaches; whether one did."""
        b = self.bodies
        d = b.size
        near = self.near()
        small = self.touches * self.speed
        speeds = {i: self.gap_speed(b.touches[i], self.t, self.y) for i in near}
        if not any(s < -small for s in speeds.values()):
            return False
        self.impacts += 1
        hard = {i for i, s in speeds.items() if s < -1e-3 * self.speed}
        self.refuse_coincidence(hard, {i for i in near if self.mode[i] == OPEN})
        self.dropped = {i for i, s in speeds.items() if 0.0 < -s * b.touches[i].e <= self.slow()}
        inverse = np.linalg.inv(np.asarray(b.mass(self.y[:d]), float))
        cases = [
            (OPEN, STICK, PLUS, MINUS) if b.touches[i].direction is not None else (OPEN, PLUS)
            for i in near
        ]
        found: list[tuple[float, Array]] = []
        for case in product(*cases):
            jump = self.impulse(inverse, near, case, speeds)
            if jump is not None:
                found.append(jump)
        if not found:
            raise NoAnswer("no impulse")
        gained, after = min(found, key=lambda f: f[0])
        size = float(self.y[d:] @ np.asarray(b.mass(self.y[:d])) @ self.y[d:])
        if gained > 1e-10 * size:
            raise NoAnswer("creates energy")
        near_best = [f for f in found if f[0] <= gained + 1e-9 * size]
        if any(np.max(np.abs(f[1] - after)) > 1e-7 * self.speed for f in near_best):
            raise NoAnswer("impact not unique")
        self.y = np.concatenate([self.y[:d], after])
        return True

    def refuse_coincidence(self, hard: set[int], opened: set[int]) -> None:
        """No answer where different contacts are struck hard at once or one right after the other,
        or one beside an open gap as small as rounding: what comes of it depends on their order."""
        soon = 1e-9 * self.length / self.speed
        if len(hard) > 1 or (hard and opened - hard):
            raise NoAnswer("impacts coincide")
        if hard and self.hard and self.t - self.hit < soon and hard != self.hard:
            raise NoAnswer("impacts nearly coincide")
        if hard:
            self.hit, self.hard = self.t, hard

    def slow(self) -> float:
        return 1e-5 * self.speed * (10.0 if self.rtol > 1e-10 else 1.0)

    def still(self, which: list[int], inverse: Array) -> None:
        """Take what is left of the velocity of gaps away."""
        d = self.bodies.size
        for i in which:
            touch = self.bodies.touches[i]
            assert touch.normal is not None
            n = np.asarray(touch.normal(self.t, self.y[:d]), float)
            rate = self.gap_speed(touch, self.t, self.y)
            self.y[d:] -= inverse @ n * rate / (n @ inverse @ n)

    def impulse(
        self, inverse: Array, near: list[int], case: tuple[int, ...], speeds: dict[int, float]
    ) -> tuple[float, Array] | None:
        """Energy gained and rates after impulses of a case, if they obey the law."""
        b = self.bodies
        d = b.size
        q, v = self.y[:d], self.y[d:]
        k = len(near)
        normals: list[Array] = []
        slips: list[Array] = []
        before_t = np.zeros(k)
        for j, i in enumerate(near):
            touch = b.touches[i]
            assert touch.normal is not None
            normals.append(np.asarray(touch.normal(self.t, q), float))
            w = np.zeros(d) if touch.direction is None else np.asarray(touch.direction(q), float)
            slips.append(w)
            before_t[j] = 0.0 if touch.direction is None else self.slip(touch, self.y)
        before = np.array([speeds[i] for i in near])
        # What would rebound so slowly comes to rest: the impulse is that of all bounces left.
        back = [b.touches[i].e * (-speeds[i] * b.touches[i].e > self.slow()) for i in near]
        J = np.array([*normals, *slips])
        G = J @ inverse @ J.T
        A, r = np.eye(2 * k), np.zeros(2 * k)
        for j, i in enumerate(near):
            touch = b.touches[i]
            if case[j] == OPEN:
                continue
            A[j], r[j] = G[j], -(1 + back[j]) * before[j]
            if case[j] == STICK:
                A[k + j], r[k + j] = G[k + j], -(1 + touch.e_t) * before_t[j]
            else:
                A[k + j, j] = case[j] * touch.mu
        try:
            if np.linalg.cond(A) > 1e12:
                return None
            L = np.linalg.solve(A, r)
        except np.linalg.LinAlgError:
            return None
        after = v + inverse @ J.T @ L
        tiny = 1e-10 * (1e-300 + float(np.max(np.abs(L), initial=0.0)))
        slow = 1e-10 * self.speed
        change = G @ L
        for j, i in enumerate(near):
            touch = b.touches[i]
            moved = before[j] + change[j] + back[j] * before[j]
            moved_t = before_t[j] + change[k + j] + touch.e_t * before_t[j]
            if case[j] == OPEN and moved < -slow:
                return None
            if case[j] != OPEN and L[j] < -tiny:
                return None
            if case[j] == STICK and abs(L[k + j]) > touch.mu * L[j] + tiny:
                return None
            if (
                touch.direction is not None
                and case[j] in (PLUS, MINUS)
                and case[j] * moved_t < -slow
            ):
                return None
        gained = float(L[:k] @ (before + change[:k] / 2) + L[k:] @ (before_t + change[k:] / 2))
        return gained, after

    # -- stepping ----------------------------------------------------------------------------------

    def land(self) -> None:
        """What has just come to rest or to a floor is there."""
        b = self.bodies
        d = b.size
        inverse = np.linalg.inv(np.asarray(b.mass(self.y[:d]), float))
        for i, touch in enumerate(b.touches):
            if self.mode[i] == OPEN and touch.gap is not None:
                continue
            if touch.gap is not None and touch.normal is not None:
                n = np.asarray(touch.normal(self.t, self.y[:d]), float)
                self.y[:d] -= n * touch.gap(self.t, self.y[:d]) / (n @ n)
                self.still([i], inverse)
            if self.mode[i] == STICK and touch.direction is not None:
                w = np.asarray(touch.direction(self.y[:d]), float)
                self.y[d:] -= inverse @ w * self.slip(touch, self.y) / (w @ inverse @ w)

    def run(self, end: float, times: Array) -> Path:
        """Follow the motion to a time."""
        found: list[Array] = []
        phases: list[tuple[float, tuple[int, ...]]] = []
        outcome = "finished"
        try:
            for _ in range(MOST_EVENTS):
                self.dropped = set()
                self.collide()
                self.decide()
                if any(self.mode[i] == OPEN for i in self.dropped):
                    raise NoAnswer("a slow rebound is none")  # it does not stay closed
                self.land()
                phases.append((self.t, self.mode))
                if self.t >= end or not self.until_event(end, times, found):
                    break
            else:
                raise NoAnswer("too many events")
        except NoAnswer as error:
            outcome = str(error).split(":")[0]
        states = np.array(found).reshape(len(found), 2 * self.bodies.size)
        return Path(states, self.t, outcome, self.impacts, phases)

    def until_event(self, end: float, times: Array, found: list[Array]) -> bool:
        """Follow the mode; False at the end of the span."""
        f = self.rates(self.mode)
        step = self.bodies.step
        solver = DOP853(
            f, self.t, self.y, end, max_step=step, rtol=self.rtol, atol=1e-2 * self.rtol,
            first_step=min(1e-5 * step, end - self.t),
        )  # fmt: skip
        # A guard that begins at zero, or below it by rounding, has to rise first.
        armed = self.guards(self.t, self.y, self.mode) > 1e-9 * max(self.length, self.speed)
        fastest = np.zeros(len(self.bodies.touches))
        while solver.status == "running":
            t = solver.t
            solver.step()
            if solver.status == "failed":
                raise NoAnswer("step too small")
            dense = solver.dense_output()
            first, which = np.inf, -1
            last = t
            for s in t + SAMPLES * (solver.t - t):
                now = self.guards(s, dense(s), self.mode)
                for g in np.flatnonzero(now < 0.0):
                    if not armed[g] and now[g] > -1e-12 * max(self.length, self.speed):
                        continue

                    def value(x: float, g: int = int(g), path: Any = dense) -> float:
                        return float(self.guards(x, path(x), self.mode)[g])

                    if value(last) <= 0.0:
                        at = last
                    else:
                        root: Any = brentq(value, last, s, xtol=1e-15, rtol=np.float64(1e-14))
                        at = float(root)
                    if at < first:
                        first, which = at, int(g)
                # Where a slip ends, a gap may have closed just before, and turned there.
                graze = self.grazes(dense, last, min(first, s))
                if graze is not None:
                    first, which = graze
                if which >= 0:
                    break
                armed |= now > 0.0
                last = s
                for i, touch in enumerate(self.bodies.touches):
                    if touch.gap is not None:
                        fastest[i] = max(fastest[i], abs(self.gap_speed(touch, s, dense(s))))
            stop = min(first, solver.t)
            while len(found) < len(times) and times[len(found)] <= stop:
                found.append(np.array(dense(times[len(found)])))
            if which >= 0:
                self.t, self.y = stop, np.array(dense(stop))
                self.refuse_touch(fastest)
                self.land()
                self.mode_after(which)
                return True
        self.t, self.y = solver.t, np.array(solver.y)
        return False

    def refuse_touch(self, fastest: Array) -> None:
        """No answer where an open gap just touches: there all of its speed is error.

        Parameters
        ----------
        fastest : array
            The largest speed of each gap on the way there.
        """
        for i, touch in enumerate(self.bodies.touches):
            if touch.gap is None or self.mode[i] != OPEN or fastest[i] < self.slow():
                continue
            near = abs(float(touch.gap(self.t, self.y[: self.bodies.size]))) < 1e-8 * self.length
            if near and abs(self.gap_speed(touch, self.t, self.y)) < 1e-5 * fastest[i]:
                raise NoAnswer("it grazes")

    def grazes(self, path: Any, begin: float, end: float) -> tuple[float, int] | None:
        """Where a gap dips below zero between two samples that do not show it."""
        d = self.bodies.size
        little = 1e-8 * self.length
        for i, touch in enumerate(self.bodies.touches):
            gap = touch.gap
            if gap is None or self.mode[i] != OPEN:
                continue

            def closes(x: float, touch: Touch = touch) -> float:
                return self.gap_speed(touch, x, path(x))

            def value(x: float, gap: Any = gap) -> float:
                return float(gap(x, path(x)[:d]))

            if value(begin) < little or not closes(begin) < 0.0:
                continue
            turn: Any = end
            if closes(end) > 0.0:
                turn = brentq(closes, begin, end, xtol=1e-15, rtol=np.float64(1e-14))
            elif not self.turns(touch, end, path(end)):
                continue
            if abs(value(turn)) < little:
                raise NoAnswer("it grazes")
            if value(turn) < 0.0:
                root: Any = brentq(value, begin, turn, xtol=1e-15, rtol=np.float64(1e-14))
                return float(root), 2 * i
        return None

    def turns(self, touch: Touch, t: float, y: Array) -> bool:
        """Whether a gap stands still, but for errors."""
        return abs(self.gap_speed(touch, t, y)) < self.slow()

    def mode_after(self, guard: int) -> None:
        """Put what has reached its boundary exactly there."""
        b = self.bodies
        d = b.size
        i, kind = divmod(guard, 2)
        touch = b.touches[i]
        if (
            kind == 0
            and self.mode[i] == OPEN
            and touch.gap is not None
            and touch.normal is not None
        ):
            n = np.asarray(touch.normal(self.t, self.y[:d]), float)
            self.y[:d] -= n * touch.gap(self.t, self.y[:d]) / (n @ n)
        if kind == 1 and self.mode[i] in (PLUS, MINUS) and touch.direction is not None:
            inverse = np.linalg.inv(np.asarray(b.mass(self.y[:d]), float))
            w = np.asarray(touch.direction(self.y[:d]), float)
            self.y[d:] -= inverse @ w * self.slip(touch, self.y) / (w @ inverse @ w)


def follow(
    bodies: Bodies,
    start: Array,
    end: float,
    times: Array,
    rtol: float,
    sizes: tuple[float, float],
    touches: float = TOUCHES,
) -> Path:
    """The motion from a start.

    Parameters
    ----------
    bodies : Bodies
    start : array, shape (2d,)
    end : float
    times : array
        Ascending; where states are wanted.
    rtol : float
    sizes : (float, float)
        Of lengths and of speeds.
    touches : float
        Part of them that counts as zero at an event.
    """
    contacts = tuple(OPEN if t.gap is not None else STICK for t in bodies.touches)
    y = np.array(start, dtype=float)
    return Follower(bodies, 0.0, y, rtol, *sizes, touches, contacts).run(end, times)
