"""Event-driven motion of given mechanics by SciPy's DOP853: the reference that shares no code with
the library.

A mode is followed until the first of its guards falls below zero. Guards are sampled within every
step, minima between samples are refined, roots are bracketed on the dense output, and the step is
integrated again up to the root.

*Which mode comes next* is decided by trial (complementarity by enumeration): the open switches,
those at zero of their guards, are tried in all 3^m 2^k states; each candidate is followed for a
short while, and the one whose guards stay nonnegative is right. Static thresholds decide who
slides; what slides takes its kinetic force; then the rest is decided again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq, minimize_scalar

from .mechanics import TIME, Array, Law, Mechanics
from .pieces import NoAnswer, Piece

ZERO = 1e-13  # of a guard's scale: what rounding makes of a guard that is 0
NEAR = 1e-9  # of a guard's scale: a switch this close is tried in all states
# Where guards are sampled in a step; close to its ends, too, so that a minimum at an end is one
# between samples.
EVEN = np.linspace(0.0, 1.0, 9)[1:-1]
LATER = np.concatenate([[0.0, 1e-5], EVEN, [1 - 1e-5, 1.0]])
FRESH = np.concatenate([[0.0, 1e-5, 1 / 1024, 1 / 256, 1 / 64, 1 / 16], EVEN, [1 - 1e-5, 1.0]])
SHORT = 10.0 ** -np.arange(7)  # fractions of a step for which candidates are followed
# The steps in which they are: what is wrong at first may look right later, after an event that it
# knows nothing of.
STAGES = np.diff([0.0, 1e-3, 1e-2, 1e-1, 0.25, 0.5, 0.75, 1.0])
MOST_EVENTS = 20_000
MOST_STEPS = 200_000


class Phase(NamedTuple):
    """A mode and a region from a time on."""

    time: float
    mode: Array
    side: Array


@dataclass
class Motion:
    """What the reference computed.

    Attributes
    ----------
    times, states, rates, friction : ndarray, shapes (k,), (k, n), (k, n), (k, m)
        States, their rates and contact forces (NaN where they are not unique) at the times asked
        for, as far as it got.
    phases : list of Phase
    end : float
        Where it ended.
    outcome : str
        "finished", or why it ended before.
    """

    times: Array
    states: Array
    rates: Array
    friction: Array
    phases: list[Phase]
    end: float
    outcome: str = "finished"
    steps: int = 0


@dataclass
class Run:
    """A motion under way."""

    m: Mechanics
    t: float
    y: Array
    end: float
    times: Array
    rtol: float
    mode: Array = field(init=False)
    side: Array = field(init=False)
    piece: Piece = field(init=False)
    h: float = 0.0
    steps: int = 0
    wrong: bytes = b""
    pieces: dict[tuple[bytes, bytes, tuple[int, ...]], Piece] = field(default_factory=dict)
    # beginnings and interpolants of the steps, if they are kept
    path: list[tuple[float, Law]] | None = None

    def __post_init__(self) -> None:
        m, (nq, nz, nr, _) = self.m, self.m.kinds
        n = nq + nz + nr
        self.y = np.array(self.y, dtype=float)
        x = self.y[:n]
        v = self.y[n : n + nq]
        a = self.y[n + nq :]
        kinks = (
            np.asarray(m.kinks(self.t, x, v, a), dtype=float)
            if m.kinks is not None
            else np.zeros(0)
        )
        self.side = np.where(kinks >= 0.0, 1, -1)
        contacts = len(m.J)
        piece = self.piece_of(np.zeros(contacts, int), self.side)
        w = piece.belt(self.t)[0]
        u = piece.J[:, :nq] @ v - w
        self.mode = np.where(
            piece.inertial & (np.abs(u) > 1e-14 * (1 + np.abs(w))), np.sign(u), 0
        ).astype(int)
        self.found: list[tuple[float, Array, Array, Array]] = []
        self.phases: list[Phase] = []
        self.h = min(
            m.step,
            self.limit(self.piece_of(self.mode, self.side), self.t, self.y),
            1e-3 * (self.end - self.t),
        )
        held = set(np.flatnonzero((self.mode == 0) & ~piece.rate).tolist())
        self.check_stable(self.piece_of(self.mode, self.side), n, nq)
        self.decide(held, set(np.flatnonzero(np.abs(kinks) < 1e-14).tolist()))

    def check_stable(self, piece: Piece, n: int, nq: int) -> None:
        guards = piece.rates(self.t, self.y)[1]
        scale = piece.scales(self.t, self.y, self.h)
        held = np.flatnonzero(piece.rate)
        both = np.concatenate([held, held + len(self.mode)])
        if np.any(guards[both] < -1e-9 * scale[both]):
            raise NoAnswer("unstable start")

    # -- deciding ----------------------------------------------------------------------------------

    def piece_of(self, mode: Array, side: Array, static: Sequence[int] = ()) -> Piece:
        """The piece of a mode and a region: its matrices are constant."""
        key = (mode.tobytes(), side.tobytes(), tuple(static))
        if key not in self.pieces:
            self.pieces[key] = Piece(self.m, mode.copy(), side.copy(), static)
        return self.pieces[key]

    def decide(self, contacts: set[int], kinks: set[int], wrong: bytes = b"") -> None:
        """Find the mode and region that are right from here on; the open switches are given, near
        ones are added.

        The state of all switches that is known to be `wrong`, since a guard has fallen in it, is
        left out.
        """
        self.wrong = wrong
        now = self.piece_of(self.mode, self.side)
        guards = now.rates(self.t, self.y)[1]
        scale = now.scales(self.t, self.y, self.h)
        count = len(self.mode)
        close = np.abs(guards) <= NEAR * scale
        contacts = contacts | {int(i) % count for i in np.flatnonzero(close[: 2 * count])}
        if self.m.kinetic is not None:
            # Static thresholds decide together who slides: what breaks pulls at others before its
            # force drops.
            contacts = contacts | {int(i) for i in np.flatnonzero((self.mode == 0) & ~now.rate)}
        kinks = kinks | {int(j) for j in np.flatnonzero(close[2 * count :])}
        mode, side, piece = self.mode, self.side, now
        for _ in range(count + len(self.side) + 2):
            self.land(contacts)
            mode, side = self.choose(contacts, kinks)
            piece = self.piece_of(mode, side)
            # Forces jump when something starts to slide: others may not hold any more.
            broken = np.flatnonzero(
                piece.rates(self.t, self.y)[1] < NEAR * piece.scales(self.t, self.y, self.h)
            )
            more = {int(g) % count for g in broken[broken < 2 * count]} - contacts
            bent = {int(g) - 2 * count for g in broken[broken >= 2 * count]} - kinks
            if not more and not bent:
                break
            contacts, kinks = contacts | more, kinks | bent
        self.mode = mode
        self.side = side
        self.piece = piece
        self.settle(piece)
        self.phases.append(Phase(self.t, mode.copy(), side.copy()))

    def choose(self, contacts: set[int], kinks: set[int]) -> tuple[Array, Array]:
        """Static thresholds decide who slides; what slides takes its kinetic force; the rest is
        decided again."""
        open_ = set(contacts)
        mode = self.mode.copy()
        side = self.side.copy()
        while True:
            mode, side = self.best(sorted(open_), sorted(kinks), mode, side)
            moving = {i for i in open_ if mode[i] != 0}
            if self.m.kinetic is None or not moving:
                return mode, side
            open_ -= moving

    def best(
        self, contacts: list[int], kinks: list[int], mode: Array, side: Array
    ) -> tuple[Array, Array]:
        """The state of the open switches whose guards stay nonnegative for a short while."""
        count = len(mode)
        watched = [*contacts, *(i + count for i in contacts), *(2 * count + j for j in kinks)]
        if not watched:
            return mode, side
        candidates = []
        for states in product(*[(0, 1, -1)] * len(contacts), *[(1, -1)] * len(kinks)):
            new_mode, new_side = mode.copy(), side.copy()
            new_mode[contacts], new_side[kinks] = states[: len(contacts)], states[len(contacts) :]
            if new_mode.tobytes() + new_side.tobytes() == self.wrong:
                continue
            candidates.append((np.count_nonzero(new_mode), new_mode, new_side))
        candidates.sort(key=lambda c: c[0])  # what can stick sticks
        scores: list[float] = []
        for h in self.h * SHORT:
            scores = []
            right = None
            for candidate in candidates:
                least = self.probe(self.piece_of(candidate[1], candidate[2], contacts), h)[watched]
                scores.append(float(np.min(least, initial=np.inf)))
                if scores[-1] >= -ZERO:
                    right = candidate
                    break
            if right is None and max(scores) > -1e-9:
                right = candidates[int(np.argmax(scores))]
            if right is not None:
                return right[1], right[2]
        if np.any(np.isneginf(scores)):
            raise NoAnswer("no bounded rate")
        raise NoAnswer(f"no mode at t = {self.t:.9g}: best {max(scores):.2e}")

    def probe(self, piece: Piece, h: float) -> Array:
        """Least relative guards on the way through Runge-Kutta steps that grow."""
        t = self.t
        y = self.y
        scale = piece.scales(self.t, self.y, h)
        first = piece.rates(t, y)[1] / scale
        # what is nearly zero is decided by what comes
        least = np.where(first < -NEAR, first, np.inf)
        if (
            piece.sliding
            and np.max(np.abs(piece.balance(t, y))) > 1e-6 * scale[-len(piece.side) - 1]
        ):
            return np.full_like(least, -1.0)
        try:
            for g in h * STAGES:
                k1 = piece.rhs(t, y)
                k2 = piece.rhs(t + g / 2, y + g / 2 * k1)
                k3 = piece.rhs(t + g / 2, y + g / 2 * k2)
                k4 = piece.rhs(t + g, y + g * k3)
                t = t + g
                y = y + g / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
                least = np.fmin(least, piece.rates(t, y)[1] / scale)
        except NoAnswer:
            return np.full_like(least, -np.inf)
        return least

    def land(self, contacts: set[int]) -> None:
        """Relative velocities that have just vanished are 0, not nearly."""
        piece = self.piece_of(self.mode, self.side)
        nq = self.m.kinds[0]
        rows = [i for i in sorted(contacts) if piece.inertial[i]]
        if rows:
            v = self.y[piece.n : piece.n + nq]
            J = piece.J[rows, :nq]
            w = piece.belt(self.t)[0][rows]
            inverse = piece.inverse[:nq, :nq]
            self.y[piece.n : piece.n + nq] -= (
                inverse @ J.T @ np.linalg.pinv(J @ inverse @ J.T) @ (J @ v - w)
            )

    def settle(self, piece: Piece) -> None:
        """Rate-independent coordinates that slide are put onto their balance."""
        for _ in range(3 if piece.sliding else 0):
            columns, slope = piece.slopes(self.t, self.y)
            self.y[columns] -= np.linalg.solve(slope, np.real(piece.balance(self.t, self.y)))

    # -- stepping ----------------------------------------------------------------------------------

    def limit(self, piece: Piece, t: float, y: Array) -> float:
        """Longest step that cannot pass over a planted feature."""
        h = self.m.step
        rates = None
        for zone in self.m.zones:
            if zone.row == TIME:
                h = min(h, (abs(t - zone.place) + zone.width) / 3)
            else:
                rates = piece.rhs(t, y) if rates is None else rates
                reach = abs(y[zone.row] - zone.place - zone.speed * t) + zone.width
                h = min(h, reach / (3 * abs(rates[zone.row] - zone.speed) + 1e-300))
        return h

    def passed(self, times: Array, path: Array) -> bool:
        """Whether a step moved further than the distance to a feature lets it."""
        for zone in self.m.zones:
            if zone.row != TIME:
                track = path[zone.row] - zone.place - zone.speed * times
                if np.ptp(track) > 0.7 * (np.min(np.abs(track)) + zone.width):
                    return True
        return False

    def solver(self, t: float, y: Array, end: float, first: float | None = None) -> DOP853:
        if end - t <= 0.0:
            raise NoAnswer("zero step")
        first = None if first is None else min(first, end - t)
        return DOP853(
            self.piece.rhs,
            t,
            y,
            end,
            max_step=self.m.step,
            rtol=self.rtol,
            atol=0.01 * self.rtol,
            first_step=first,
        )

    def shoot(self, t: float, y: Array, end: float) -> Array:
        """The state at a given time within a step."""
        if end <= t:
            return y
        solver = self.solver(t, y, end, end - t)
        while solver.status == "running":
            solver.step()
        if solver.status == "failed":
            raise NoAnswer("step too small")
        return solver.y

    def follow(self, end: float) -> None:
        """Follow the motion to a time."""
        self.end = end
        still = 0
        while self.t < end and self.until_event():
            last = [phase.time for phase in self.phases[-2:]]
            still = (
                still + 1
                if len(last) > 1 and last[-1] - last[-2] < 1e-13 * (1 + abs(last[-1]))
                else 0
            )
            if still > 12 or len(self.phases) > MOST_EVENTS:
                raise NoAnswer("event accumulation" if still > 12 else "too many events")

    def until_event(self) -> bool:
        """Follow the mode; False at the end of the span."""
        solver = self.solver(self.t, self.y, self.end)
        fresh = True
        while solver.status == "running":
            t, y = solver.t, solver.y
            solver.max_step = min(self.m.step, self.limit(self.piece, t, y))
            solver.h_abs = min(solver.h_abs, solver.max_step)
            solver.step()
            self.steps += 1
            if solver.status == "failed" or self.steps > MOST_STEPS:
                small = "no bounded rate" if self.piece.sliding else "step too small"
                raise NoAnswer(small if solver.status == "failed" else "too many steps")
            dense = solver.dense_output()
            h = solver.t - t
            tau = h * (FRESH if fresh else LATER)
            path = dense(t + tau)
            if self.passed(t + tau, path):
                solver = self.solver(t, y, self.end, h / 3)
                continue
            guards = np.array([self.piece.rates(t + s, path[:, i])[1] for i, s in enumerate(tau)])
            event = self.first_root(t, tau, dense, guards, self.piece.scales(t, y, h))
            self.record(t, y, t + event[0] if event else solver.t)
            if self.path is not None:
                self.path.append((t, dense))
            if event:
                self.cross(t, y, dense, *event)
                return True
            self.t = solver.t
            self.y = solver.y
            self.h = h
            fresh = False
        return False

    def first_root(
        self, t: float, tau: Array, dense: Law, guards: Array, scale: Array
    ) -> tuple[float, list[int]] | None:
        """Where the first guard falls below zero within a step, and which ones fall there."""
        # What rounding has made negative at the beginning counts as zero.
        low = ZERO * scale + np.clip(-guards[0], 0.0, NEAR * scale)
        roots: dict[int, float] = {}
        for g in range(guards.shape[1]):
            column = guards[:, g] + low[g]

            def value(s: float, g: int = g) -> float:
                return self._guard(g, dense, t, s) + low[g]

            first = next(iter(np.flatnonzero(column < 0.0)), len(column))
            for j in range(1, min(first, len(column) - 1)):
                dip = self._dip(value, tau, column, j)
                if dip is not None:
                    roots[g] = fall(value, tau[j - 1], dip)
                    break
            else:
                if first < len(column):
                    roots[g] = fall(value, tau[first - 1], tau[first])
        if not roots:
            return None
        least = min(roots.values())
        return least, [g for g, s in roots.items() if s <= least + 1e-9 * tau[-1]]

    def _dip(self, value: Law, tau: Array, column: Array, j: int) -> float | None:
        """A point where a guard is negative around a sampled minimum, if there is one."""
        a, b, c = column[j - 1 : j + 2]
        if not (b <= a and b <= c) or b < 0.0 or c < 0.0:
            return None
        p = (a - b) / (tau[j] - tau[j - 1])
        q = (c - b) / (tau[j + 1] - tau[j])
        if b > 0.5 * max(p, q) * (tau[j + 1] - tau[j - 1]):
            return None
        found: Any = minimize_scalar(
            value, bounds=(tau[j - 1], tau[j + 1]), method="bounded", options={"xatol": 1e-12}
        )
        return float(found.x) if found.fun < 0.0 else None

    def cross(self, t: float, y: Array, dense: Law, tau: float, fallen: list[int]) -> None:
        """Go to the root exactly, and decide."""
        g = fallen[0]
        at = self.shoot(t, y, t + tau)
        scale = self.piece.scales(t, y, max(self.h, tau))[g]
        for _ in range(3):
            h = max(1e-4 * tau, 1e-12)
            slope = (self._guard(g, dense, t, tau + h) - self._guard(g, dense, t, tau - h)) / (
                2 * h
            )
            value = float(self.piece.rates(t + tau, at)[1][g])
            if slope > -1e-6 * scale or abs(value) < 1e-15 * scale:
                break
            tau = max(tau - value / slope, 0.0)
            at = self.shoot(t, y, t + tau)
        self.t = t + tau
        self.y = np.array(at)
        self.h = min(
            0.1 * max(self.h, tau), self.m.step / 30, self.limit(self.piece, self.t, self.y) / 10
        )
        self.settle(self.piece)
        count = len(self.mode)
        contacts = {f % count for f in fallen if f < 2 * count}
        self.decide(
            contacts,
            {f - 2 * count for f in fallen if f >= 2 * count},
            self.mode.tobytes() + self.side.tobytes(),
        )

    def _guard(self, g: int, dense: Law, t: float, tau: float) -> float:
        return float(self.piece.rates(t + tau, dense(t + tau))[1][g])

    def record(self, t: float, y: Array, end: float) -> None:
        """States and forces at the times that lie in a step."""
        while len(self.found) < len(self.times) and self.times[len(self.found)] <= end:
            s = float(self.times[len(self.found)])
            at = self.shoot(t, y, s)
            rates, _, friction = self.piece.rates(s, at)
            self.found.append((s, np.array(at), rates, friction))


def fall(value: Law, a: float, b: float) -> float:
    """Where a guard falls between two times; what is only rounding at one of them is there."""
    if value(a) <= 0.0:
        return a
    if not value(b) < 0.0:
        return b
    root: Any = brentq(value, a, b, xtol=1e-15, rtol=np.float64(1e-14))
    return root


def integrate(
    m: Mechanics,
    span: tuple[float, float],
    start: Sequence[float] | Array,
    times: Array,
    rtol: float = 1e-12,
) -> Motion:
    """The motion from a state (x, v, a), switch by switch.

    Parameters
    ----------
    times : ndarray
        Ascending; where the state is wanted.

    Raises
    ------
    NoAnswer
        If no mode is right; "no bounded rate" and the like are outcomes.
    """
    run: Run | None = None
    outcome = "finished"
    try:
        run = Run(m, span[0], np.asarray(start, dtype=float), span[1], times, rtol)
        run.record(run.t, run.y, run.t)
        run.follow(span[1])
    except NoAnswer as error:
        if run is None or str(error) not in (
            "no bounded rate",
            "step too small",
            "event accumulation",
        ):
            raise
        outcome = str(error)
    found = run.found
    widths = (len(start), len(start), len(m.J))
    states, rates, friction = (
        np.array([f[1 + i] for f in found]).reshape(len(found), width)
        for i, width in enumerate(widths)
    )
    times = np.array([f[0] for f in found])
    return Motion(times, states, rates, friction, run.phases, run.t, outcome, run.steps)
