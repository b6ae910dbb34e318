"""Samples that repeat, for many periods: as speed of a belt, as force, as end of a spring, as
threshold; against closed forms, piece by piece.

One mass moves under x'' = f − k x − c x' + F. What drives it is linear between knots, which the
reference counts by the number of their period; so x is a line and a swing between switches, and
the force of stick is a parabola.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

import stickslip as ss

from ..case import Rng, given, log_uniform, pick
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

FAMILIES = ("belt", "force", "end of a spring", "threshold")
CLOSE = 1e-8  # of the sizes of the motion
CERTIFIED = 1e-9  # what the certificate leaves open, to be multiplied by the condition of a motion
SHIFT = 1e-7  # of the start and of friction, by which the condition is measured
PATIENCE = 20.0  # s
INSTANTS = 11
RELATIVE: Any = 1e-14  # of roots
_ZERO = 1e-12  # of velocities and forces: what rounding makes of nothing
_LOOKS = 40  # in a piece, and in a swing, at the relative velocity


@dataclass(frozen=True)
class Case:
    """A mass, and samples that drive it.

    Attributes
    ----------
    family : str
    seed : int
    times, values : array
        The samples of one period.
    hold : bool
        Whether values are held between samples; else they lie on lines.
    k, c : float
    load : float
        Constant.
    size : float
        What the values are multiplied with.
    static, kinetic : float
    start : (float, float)
        x and x'.
    span : (float, float)
    """

    family: str
    seed: int
    times: Array
    values: Array
    hold: bool
    k: float
    c: float
    load: float
    size: float
    static: float
    kinetic: float
    start: tuple[float, float]
    span: tuple[float, float]

    @property
    def period(self) -> float:
        return float(self.times[-1] - self.times[0])

    def drive(self, once: bool = False) -> ss.Samples:
        """The samples, or those of all periods of the span written out."""
        kind = "hold" if self.hold else "linear"
        if not once:
            return ss.Samples(self.times, self.values, kind=kind, periodic=True)
        first, last = (
            int(np.floor((t - self.times[0]) / self.period)) + more
            for t, more in zip(self.span, (-1, 2), strict=True)
        )
        turns = np.arange(first, last)[:, None] * self.period
        times = np.append((self.times[:-1] + turns).ravel(), self.times[0] + last * self.period)
        values = np.append(np.tile(self.values[:-1], len(turns)), self.values[0])
        return ss.Samples(times, values, kind=kind)

    def system(self, once: bool = False) -> ss.System:
        """What the library gets."""
        wave = "A*w"
        pull = {"force": f" + {wave}", "end of a spring": f" + k*{wave}"}.get(self.family, "")
        weakness = f"*(1 + {wave})" if self.family == "threshold" else ""
        return ss.System(
            "repeated samples",
            drives={"w": self.drive(once)},
            parameters=given(
                k=self.k, c=self.c, f=self.load, A=self.size, s=self.static, r=self.kinetic
            ),
            coordinates={"x": ss.Inertial(force=f"f - k*x - c*d_x{pull}")},
            kinetic="d_x**2/2",
            contacts={
                "pad": ss.Contact(
                    "d_x",
                    f"s{weakness}",
                    wave if self.family == "belt" else "0",
                    kinetic=f"r{weakness}",
                )
            },
            initial={"x": self.start[0], "d_x": self.start[1]},
            span=self.span,
        )


def draw(family: str, seed: int) -> Case:
    """The case of a family with a seed, the same on every machine."""
    rng = np.random.default_rng([zlib.crc32(family.encode()), seed, 1])
    times, values = wave(rng)
    T = float(times[-1] - times[0])
    rate = 2 * np.pi / T
    k = (rate * log_uniform(rng, 0.1, 3.0)) ** 2
    c = 0.1 * rng.uniform(0.2, 1.0) * np.sqrt(k)
    hold = bool(rng.random() < 0.3)
    pull = k if family == "end of a spring" else rate if family == "belt" else 1.0
    static = pull * rng.uniform(0.2, 0.9)
    size = 0.5 if family == "threshold" else 1.0
    load = static * rng.uniform(-0.5, 0.5)
    start = (0.0, 0.0)
    if family == "threshold":
        start = (float(rng.uniform(2.0, 8.0)) * static / k, 0.0)
        c = 0.02 * c
    first = float(pick(rng, (0.0, rng.uniform(-3.0, 50.0)))) * T
    span = first, first + float(np.rint(log_uniform(rng, 15.0, 150.0))) * T
    kinetic = static * float(pick(rng, (1.0, rng.uniform(0.6, 0.95))))
    return Case(family, seed, times, values, hold, k, c, load, size, static, kinetic, start, span)


def wave(rng: Rng) -> tuple[Array, Array]:
    """Samples of one period: of round numbers, or not."""
    m = int(rng.integers(2, 8))
    T = float(pick(rng, (0.02, 0.1, 0.7, 1.0, log_uniform(rng, 0.01, 10.0))))
    first = float(pick(rng, (0.0, 0.0, rng.uniform(-2.0, 2.0))))
    cuts = rng.choice(np.arange(1, 40), m - 1, replace=False) / 40
    if rng.random() < 0.5:
        cuts = cuts + rng.uniform(-0.4, 0.4, m - 1) / 40
    values = rng.uniform(-1.0, 1.0, m)
    return first + T * np.array([0.0, *np.sort(cuts), 1.0]), np.append(values, values[0])


def cases(seed: int = 0, count: int = 100) -> Iterator[Case]:
    """Cases of all families in turn."""
    return in_turn(FAMILIES, draw, seed, count)


# -- the reference ---------------------------------------------------------------------------------


class Swing:
    """x'' + c x' + k x = p + q t from a state at t = 0, with c² < 4k."""

    def __init__(self, c: float, k: float, p: float, q: float, x: float, v: float) -> None:
        self.line = p / k - c * q / k**2, q / k
        self.decay = 0.5 * c
        self.rate = float(np.sqrt(k - self.decay**2))
        self.a = x - self.line[0]
        self.b = (v - self.line[1] + self.decay * self.a) / self.rate

    def at(self, t: Any) -> tuple[Any, Any]:
        """Position and velocity."""
        cos, sin, fade = np.cos(self.rate * t), np.sin(self.rate * t), np.exp(-self.decay * t)
        swing = fade * (self.a * cos + self.b * sin)
        turned = fade * self.rate * (self.b * cos - self.a * sin)
        return self.line[0] + self.line[1] * t + swing, self.line[1] + turned - self.decay * swing


class Run:
    """The reference's motion: states at times that are asked for."""

    def __init__(self, case: Case, times: Sequence[float]) -> None:
        self.case = case
        self.x, self.v = case.start
        self.t = case.span[0]
        self.mode = 0
        self.switches = 0
        self.asked = sorted(times)
        self.found: list[tuple[float, float]] = []
        self.follow()

    def knots(self) -> Iterator[tuple[float, float, float, float]]:
        """Ends of the pieces from the start on, with the value at the beginning and the slope."""
        case = self.case
        n = int(np.floor((case.span[0] - case.times[0]) / case.period)) - 1
        while True:
            for i in range(len(case.times) - 1):
                start, end = (float(case.times[j] + n * case.period) for j in (i, i + 1))
                slope = 0.0 if case.hold else (case.values[i + 1] - case.values[i]) / (end - start)
                yield start, end, float(case.values[i]), float(slope)
            n += 1

    def follow(self) -> None:
        """Piece by piece to the end."""
        first = True
        for start, end, value, slope in self.knots():
            if end <= self.t + 1e-13 * self.case.period:
                continue
            self.piece(start, min(end, self.case.span[1]), value, slope, first)
            first = False
            if end >= self.case.span[1]:
                break

    def piece(self, start: float, end: float, value: float, slope: float, first: bool) -> None:
        """A piece of the drive, switch by switch."""
        case = self.case
        A, role = case.size, case.family
        begins = True
        while self.t < end:
            d, e = A * (value + slope * (self.t - start)), A * slope
            w, dw = (d, e) if role == "belt" else (0.0, 0.0)
            pull = {"force": 1.0, "end of a spring": case.k}.get(role, 0.0)
            p, q = case.load + pull * d, pull * e
            weak, weaker = (1 + d, e) if role == "threshold" else (1.0, 0.0)
            # Σ λⱼ tʲ, the force that stick takes
            stick = [
                dw + case.c * w + case.k * self.x - p,
                case.c * dw + case.k * w - q,
                0.5 * case.k * dw,
            ]
            s = [case.static * weak, case.static * weaker]
            self.decide(self.v - w, stick, s, begins)
            left = end - self.t
            if self.mode == 0:
                length = min(
                    _first_root([s[0] - stick[0], s[1] - stick[1], -stick[2]], left),
                    _first_root([s[0] + stick[0], s[1] + stick[1], stick[2]], left),
                )
                self.record(
                    length, lambda t, x=self.x, w=w, dw=dw: (x + w * t + dw * t * t / 2, w + dw * t)
                )
            else:
                kinetic = case.kinetic * weak, case.kinetic * weaker
                swing = Swing(
                    case.c,
                    case.k,
                    p - self.mode * kinetic[0],
                    q - self.mode * kinetic[1],
                    self.x,
                    self.v,
                )
                length = self.slip(swing, w, dw, left)
                self.record(length, swing.at)
            done = length >= left
            self.t = end if done else self.t + length
            if not done:
                self.switches += 1
                if self.mode != 0:
                    self.v = w + dw * length
            begins = done

    def decide(self, u: float, stick: list[float], s: list[float], begins: bool) -> None:
        """Which way the mass slips, if it does."""
        size = abs(stick[0]) + s[0]
        if abs(u) > _ZERO * (abs(self.v) + abs(self.v - u)) and (begins or self.mode == 0):
            self.mode = 1 if u > 0 else -1
            return
        if abs(u) > _ZERO * (abs(self.v) + abs(self.v - u)):
            return
        over = abs(stick[0]) - s[0]
        if over <= -_ZERO * size:
            self.mode = 0
        elif over >= _ZERO * size or np.sign(stick[0]) * stick[1] > s[1]:
            self.mode = -int(np.sign(stick[0]))
        else:
            self.mode = 0

    def slip(self, swing: Swing, w: float, dw: float, left: float) -> float:
        """How long the mass goes on in this sense, within what is left of the piece."""
        sense = self.mode

        def speed(t: Any) -> Any:
            return sense * (swing.at(t)[1] - w - dw * t)

        looks = int(_LOOKS * (1 + swing.rate * left / (2 * np.pi)))
        t = np.concatenate(
            [
                [0.0],
                left * np.geomspace(1e-6, 1.0 / looks, 20)[:-1],
                np.linspace(0.0, left, looks + 1)[1:],
            ]
        )
        u = speed(t)
        terms = abs(swing.line[1]) + swing.rate * (abs(swing.a) + abs(swing.b)) + abs(w)
        forces = self.case.static + self.case.k * abs(self.x) + self.case.c * abs(self.v)
        noise = 1e-14 * terms + 1e-12 * forces * t[1:]
        below = np.flatnonzero(u[1:] < -noise)
        if len(below) == 0:
            return left
        i = int(below[0]) + 1
        above = np.flatnonzero(u[:i] > 0.0)
        if len(above) == 0:
            raise ValueError("no mode")
        root: Any = brentq(speed, t[above[-1]], t[i], xtol=1e-15 * left, rtol=RELATIVE)
        return float(root)

    def record(self, length: float, at: Any) -> None:
        """Keep what was asked for, and go on to the end of what is known."""
        last = self.t + length >= self.case.span[1]
        while self.asked and (self.asked[0] <= self.t + length or last):
            x, v = at(min(self.asked.pop(0) - self.t, length))
            self.found.append((float(x), float(v)))
        self.x, self.v = map(float, at(length))


def _first_root(c: list[float], left: float) -> float:
    """The first time at which a parabola that is positive, or zero and rising, falls below zero;
    `left` if that is later."""
    roots = np.roots(c[::-1]) if any(c[1:]) else np.zeros(0)
    size = abs(c[0]) + abs(c[1]) * left + abs(c[2]) * left**2
    times = sorted(float(r.real) for r in roots if r.imag == 0.0)
    return next(
        (
            t
            for t in times
            if 0 < t < left and c[1] + 2 * c[2] * t < 0 and t * size > _ZERO * left * abs(c[0])
        ),
        left,
    )


# -- the judge -------------------------------------------------------------------------------------


def judge(case: Case) -> Verdict:
    """The motion and that of an ensemble against the reference."""
    rng = np.random.default_rng(case.seed)
    times = [*np.sort(rng.uniform(*case.span, INSTANTS)).tolist(), case.span[1]]
    try:
        with at_most(PATIENCE):
            motion = ss.simulate(case.system())
            certified = motion.certificate.ok
            many = ss.simulate_many(case.system(), workers=1).dataset
    except Exception as error:  # whatever it raises, it gave no result
        return Verdict(REFUSED, f"{type(error).__name__}: {str(error).split(':')[0]}")
    if not motion.outcome.ok:
        return Verdict(REFUSED, motion.outcome.label)
    try:
        with at_most(PATIENCE):
            own = np.array(Run(case, times).found)
            moved = [np.array(Run(other, times).found) for other in shifted(case)]
    except (OutOfTime, ValueError) as error:
        return Verdict(NO_REFERENCE, type(error).__name__)
    sampled = motion.at(np.array(times))
    got = np.stack([sampled["x"], sampled["d_x"]], axis=1)
    size = np.maximum(np.max(np.abs(own), axis=0), 1e-300)
    condition = max(float(np.max(np.abs(other - own) / size)) for other in moved) / SHIFT
    allowed = CLOSE + CERTIFIED * condition
    off = float(np.max(np.abs(got - own) / size))
    end = np.array([float(many[f"final_{name}"][0]) for name in ("x", "d_x")])
    apart = float(np.max(np.abs(end - got[-1]) / size))
    numbers = {"difference": off, "condition": condition, "ensemble": apart}
    right = off <= allowed
    if certified and not right:
        return Verdict(WRONG, "another motion", numbers)
    if not apart <= allowed:
        return Verdict(WRONG, "simulate_many ends elsewhere", numbers)
    if not certified:
        return Verdict(NOT_CERTIFIED, "right" if right else "wrong", numbers)
    return Verdict(AGREED, "", numbers)


def shifted(case: Case) -> Iterator[Case]:
    """Cases that differ a little."""
    yield replace(case, static=case.static * (1 + SHIFT), kinetic=case.kinetic * (1 + SHIFT))
    yield replace(case, load=case.load + SHIFT * case.static)


def reproduction(case: Case) -> str:
    """A script that repeats what the library did."""
    return (
        "from adversarial import samples\n"
        f"case = samples.draw({case.family!r}, {case.seed})\n"
        "print(samples.ss.simulate(case.system()).summary(), samples.judge(case))"
    )
