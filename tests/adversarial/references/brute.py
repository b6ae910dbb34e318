"""Brute force: motions followed by the method of Runge and Kutta until they repeat themselves.

Nothing here is shared with the library but how functions are compiled. Small steps of order four,
cut where a guard vanishes (by halving), and marks: the periods of a drive, or the maxima of the
first component. When the states at the last marks repeat, the smallest lag at which they do is the
period.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array, IntVector, Matrix, Vector
from stickslip.machine_code.functions import entry_point
from stickslip.translator import compiled

MASSES = 0
TOY = 1
SLIDER = 2
CONSTANT = 0  # laws of kinetic friction
EXPONENTIAL = 1
RATIONAL = 2
HALVINGS = 60
INSIDE = 1e-14  # of its threshold: what comes to stick is held
MOST_EVENTS = 4000  # in a call
LAGS = 48
# of its size: how near states at marks have to be to be the same, for steps that are not all the
# same
CLOSE = 2e-8
AS_CLOSE = 100.0
CERTAIN = 1e-6  # of its size: what may be missing to a cycle
STILL = 1e-10  # of its size: what does not move
FADED = 1e-6  # of its size: what may be about to die out


class Brute(NamedTuple):
    """The numbers of a system.

    Attributes
    ----------
    kind : int
    step : float
    period : float
        Of the drive; 0 if there is none.
    mass, stiffness, damping : arrays, shapes (n,), (n, n), (n, n)
    hard : float
        Cubic stiffness of the first mass, on which all loads act.
    load : array
        f + F cos(ωt) + A exp((cos(ωt − φ) − 1)/w²) + G max(0, 1 − |t − T|/τ): f, F, ω, A, φ, w, G,
        T, τ.
    wall : array
        Force −A/cosh²((x − p)/w): A, p, w; and a rough patch, by whose D the threshold of the first
        contact grows.
    dry : array, shape (contacts, 8)
        Mass, speed of the surface, static and kinetic force, law, speed of the law, part of the
        threshold that is lost in a dip at the phase φ, and 1 if the kinetic force is the threshold.
    dampers : array, shape (dampers, 3)
        Mass, stiffness, threshold.
    numbers : array
        Of the toy (δ, P, c, ρ, H*) or the slider (V, ν).
    """

    kind: int
    step: float
    period: float
    mass: Vector
    stiffness: Matrix
    damping: Matrix
    hard: float
    load: Vector
    wall: Vector
    dry: Matrix
    dampers: Matrix
    numbers: Vector


@compiled()
def bump(b: Brute, t: float) -> float:
    """exp((cos(ωt − φ) − 1)/w²)."""
    return math.exp((math.cos(b.load[2] * t - b.load[4]) - 1.0) / b.load[5] ** 2)


@compiled()
def pull(b: Brute, t: float, y: Vector, i: int) -> float:
    """Force on a mass, but for those of contacts."""
    n = len(b.mass)
    load = b.load
    total = 0.0
    for j in range(n):
        total -= b.stiffness[i, j] * y[j] + b.damping[i, j] * y[n + j]
    if i == 0:
        total += load[0] + load[1] * math.cos(load[2] * t) - b.hard * y[0] ** 3
        if load[3] != 0.0:
            total += load[3] * bump(b, t)
        if load[6] != 0.0:
            total += load[6] * max(0.0, 1.0 - abs(t - load[7]) / load[8])
        if b.wall[0] != 0.0:
            total -= b.wall[0] / math.cosh(min(abs((y[0] - b.wall[1]) / b.wall[2]), 300.0)) ** 2
    for d in range(len(b.dampers)):
        if b.dampers[d, 0] == i:
            total -= b.dampers[d, 1] * (y[i] - y[2 * n + d])
    return total


@compiled()
def threshold(b: Brute, t: float, y: Vector, c: int) -> float:
    """Static threshold of a contact."""
    static = b.dry[c, 2]
    if b.dry[c, 6] != 0.0:
        static *= 1.0 - b.dry[c, 6] * bump(b, t)
    if c == 0 and b.wall[3] != 0.0:
        static *= 1.0 + b.wall[3] * math.exp(-(((y[0] - b.wall[1]) / b.wall[2]) ** 2))
    return static


@compiled()
def kinetic(b: Brute, t: float, y: Vector, c: int, speed: float) -> float:
    """Sliding force of a contact."""
    row = b.dry[c]
    if row[7] != 0.0:
        return threshold(b, t, y, c)
    if row[4] == EXPONENTIAL:
        return row[3] + (row[2] - row[3]) * math.exp(-speed / row[5])
    if row[4] == RATIONAL:
        return row[3] + (row[2] - row[3]) / (1.0 + (speed / row[5]) ** 2)
    return row[3]


@compiled()
def toy_bound(b: Brute, psi: float, upper: bool) -> tuple[float, int]:
    """Bound of the distance of the legs, and the leg (1 right, −1 left) that moves there."""
    P = b.numbers[1]
    c = b.numbers[2]
    rho = b.numbers[3]
    H = b.numbers[4]
    right = H / 2.0 * (1.0 + min(max(psi, -1.0), 1.0))
    left = H - right
    if upper:
        a = P + c * psi + rho + right
        other = -P + c * psi + rho + left
        if a <= other:
            return a, 1
        return other, -1
    a = P + c * psi - rho - right
    other = -P + c * psi - rho - left
    if a >= other:
        return a, 1
    return other, -1


@compiled()
def toy_side(psi: float) -> int:
    """Which leg carries all weight: 1 the right one, −1 the left one, 0 neither."""
    return 1 if psi >= 1.0 else (-1 if psi <= -1.0 else 0)


@compiled()
def toy_push(b: Brute, mode: IntVector, rate: float) -> float:
    """Rate at which the legs are pushed apart, on a side and by the bound of a leg."""
    grows = 0.5 * b.numbers[4] * mode[2] if mode[1] == 0 else 0.0
    return (b.numbers[2] + (grows if mode[0] < 0 else -grows)) * rate


@compiled()
def mu(alpha: float) -> float:
    """Friction of the slider."""
    return 2.0 / math.sqrt(alpha)


@compiled()
def rates(b: Brute, mode: IntVector, t: float, y: Vector, f: Vector) -> None:
    """y' in a mode; the last component is the work of friction."""
    last = len(y) - 1
    f[last] = 0.0
    if b.kind == SLIDER:
        slip = (y[0] - mu(y[1])) / b.numbers[1] if mode[0] != 0 else 0.0
        f[0] = b.numbers[0] - slip
        f[1] = 1.0 - y[1] + y[0] * slip
        f[2] = mu(y[1]) * slip
        return
    if b.kind == TOY:
        pushed = toy_push(b, mode, y[1]) if mode[0] != 0 else 0.0
        leg = mode[2]
        f[0] = y[1]
        f[1] = -b.numbers[0] * y[1] - y[0] + b.numbers[2] * y[2]
        f[2] = pushed
        f[3] = leg * pushed
        right = b.numbers[4] / 2.0 * (1.0 + min(max(y[0], -1.0), 1.0))
        f[last] = (b.numbers[3] + (right if leg == 1 else b.numbers[4] - right)) * abs(pushed)
        return
    n = len(b.mass)
    contacts = len(b.dry)
    for i in range(n):
        f[i] = y[n + i]
        f[n + i] = pull(b, t, y, i) / b.mass[i]
    for c in range(contacts):
        i = int(b.dry[c, 0])
        if mode[c] == 0:
            f[n + i] = 0.0
            continue
        speed = abs(y[n + i] - b.dry[c, 1])
        friction = kinetic(b, t, y, c, speed)
        f[n + i] -= mode[c] * friction / b.mass[i]
        f[last] += friction * speed
    for d in range(len(b.dampers)):
        i = int(b.dampers[d, 0])
        f[2 * n + d] = y[n + i] if mode[contacts + d] != 0 else 0.0
        f[last] += b.dampers[d, 2] * abs(f[2 * n + d])


@compiled()
def broken(b: Brute, mode: IntVector, t: float, y: Vector) -> int:
    """The first switch whose guard is negative, or −1."""
    if b.kind == SLIDER:
        excess = y[0] - mu(y[1])
        return 0 if (excess if mode[0] != 0 else -excess) < 0.0 else -1
    if b.kind == TOY:
        if mode[0] != 0:
            if mode[0] * toy_push(b, mode, y[1]) < 0.0:
                return 0
            if toy_side(y[0]) != mode[1]:
                return 1
            return 2 if toy_bound(b, y[0], mode[0] < 0)[1] != mode[2] else -1
        return (
            0 if y[2] > toy_bound(b, y[0], True)[0] or y[2] < toy_bound(b, y[0], False)[0] else -1
        )
    n = len(b.mass)
    contacts = len(b.dry)
    for c in range(contacts):
        i = int(b.dry[c, 0])
        if mode[c] != 0:
            if mode[c] * (y[n + i] - b.dry[c, 1]) < 0.0:
                return c
        elif abs(pull(b, t, y, i)) > threshold(b, t, y, c):
            return c
    for d in range(len(b.dampers)):
        i = int(b.dampers[d, 0])
        if mode[contacts + d] != 0:
            if mode[contacts + d] * y[n + i] < 0.0:
                return contacts + d
        elif b.dampers[d, 1] * abs(y[i] - y[2 * n + d]) > b.dampers[d, 2]:
            return contacts + d
    return -1


@compiled()
def switch(b: Brute, mode: IntVector, which: int, t: float, y: Vector) -> None:
    """The mode and the state after a guard has vanished."""
    if b.kind == SLIDER:
        mode[0] = 1 - mode[0]
        return
    if b.kind == TOY:
        if which == 0 and mode[0] != 0:
            low = toy_bound(b, y[0], False)[0]
            high = toy_bound(b, y[0], True)[0]
            y[2] = min(max(y[2], low + INSIDE * (high - low)), high - INSIDE * (high - low))
            mode[0] = 0
            return
        if mode[0] == 0:
            mode[0] = -1 if y[2] > toy_bound(b, y[0], True)[0] else 1
        mode[1] = toy_side(y[0])
        bound, leg = toy_bound(b, y[0], mode[0] < 0)
        y[2] = bound
        mode[2] = leg
        return
    n = len(b.mass)
    contacts = len(b.dry)
    if which >= contacts:
        d = which - contacts
        x = y[int(b.dampers[d, 0])]
        reach = (1.0 - INSIDE) * b.dampers[d, 2] / b.dampers[d, 1]
        mode[which] = 0 if mode[which] != 0 else (1 if x > y[2 * n + d] else -1)
        if mode[which] == 0:
            y[2 * n + d] = min(max(y[2 * n + d], x - reach), x + reach)
        return
    i = int(b.dry[which, 0])
    y[n + i] = b.dry[which, 1]
    force = pull(b, t, y, i)
    if mode[which] == 0 or abs(force) > threshold(b, t, y, which):
        mode[which] = 1 if force > 0.0 else -1
    else:
        mode[which] = 0


@compiled()
def length(b: Brute, t: float, y: Vector, rate: float) -> float:
    """Step that sees all that is narrow."""
    h = b.step
    if b.hard > 0.0 and b.kind == MASSES:
        h /= math.sqrt(1.0 + 3.0 * b.hard * y[0] ** 2 / b.stiffness[0, 0])
    narrow = b.load[3] != 0.0
    for c in range(len(b.dry)):
        narrow = narrow or b.dry[c, 6] != 0.0
    if narrow:
        phase = b.load[2] * t - b.load[4]
        phase -= 2.0 * math.pi * math.floor(phase / (2.0 * math.pi) + 0.5)
        h = min(h, max(0.03 * b.load[5], 0.3 * (abs(phase) - 7.0 * b.load[5])) / b.load[2])
    if b.wall[0] != 0.0 or b.wall[3] != 0.0:
        away = abs(y[0] - b.wall[1]) - 20.0 * b.wall[2]
        h = min(h, max(0.03 * b.wall[2], 0.3 * away) / (abs(rate) + 1e-2))
    if b.load[6] != 0.0:
        for k in range(-1, 2):
            kink = b.load[7] + k * b.load[8]
            if t < kink < t + h:
                h = kink - t
    return h


@compiled()
def step(b: Brute, mode: IntVector, t: float, y: Vector, h: float, k: Matrix, out: Vector) -> None:
    """One step of the classical method of order four."""
    n = len(y)
    rates(b, mode, t, y, k[0])
    for s in range(1, 4):
        part = h if s == 3 else 0.5 * h
        for r in range(n):
            k[4, r] = y[r] + part * k[s - 1, r]
        rates(b, mode, t + part, k[4], k[s])
    for r in range(n):
        out[r] = y[r] + h / 6.0 * (k[0, r] + 2.0 * (k[1, r] + k[2, r]) + k[3, r])


@compiled()
def stopped(b: Brute, mode: IntVector, t: float, y: Vector, sign: float, f: Vector) -> int:
    """A broken guard; −2 where the first component has turned; −1 otherwise."""
    which = broken(b, mode, t, y)
    if which >= 0:
        return which
    rates(b, mode, t, y, f)
    return -2 if f[0] * sign < 0.0 else -1


@entry_point()
def follow(
    b: Brute,
    mode: IntVector,
    clock: Vector,
    y: Vector,
    end: float,
    marks: Matrix,
    reach: Matrix,
    k: Matrix,
    out: Vector,
) -> int:
    """Follow a motion until a time, or until there is no room for marks.

    Parameters
    ----------
    mode, y : arrays
        Where it is; changed.
    clock : array
        Time, sign of the rate of the first component, number of the next mark of a drive; changed.
    marks : array, shape (room, state + 4)
        Receives state, time, and lowest and highest value of the first component and time in stick
        since the last mark.
    reach : array, shape (2, state)
        Receives the least and largest value of each component.
    k, out : arrays, shapes (5, state), (state,)
        Work space.

    Returns
    -------
    int
        Number of marks; −1 if events pile up.
    """
    n = len(y)
    count = 0
    events = 0
    low = y[0]
    high = y[0]
    stick = 0.0
    while clock[0] < end and count < len(marks):
        t = clock[0]
        rates(b, mode, t, y, k[0])
        if clock[1] == 0.0 and k[0, 0] != 0.0:
            clock[1] = 1.0 if k[0, 0] > 0.0 else -1.0
        h = length(b, t, y, k[0, 0])
        due = False
        if b.period > 0.0 and t + h >= clock[2] * b.period - 1e-12:
            h = clock[2] * b.period - t
            due = True
        step(b, mode, t, y, h, k, out)
        which = stopped(b, mode, t + h, out, clock[1], k[4])
        if which != -1:
            due = False
            first = 0.0
            last = h
            for _ in range(HALVINGS):
                middle = 0.5 * (first + last)
                step(b, mode, t, y, middle, k, out)
                found = stopped(b, mode, t + middle, out, clock[1], k[4])
                if found == -1:
                    first = middle
                else:
                    last = middle
                    which = found
            h = last
            step(b, mode, t, y, h, k, out)
            events += 1
        stuck = True
        for c in range(1 if b.kind == TOY else len(mode)):
            stuck = stuck and mode[c] == 0
        stick += h if stuck else 0.0
        for r in range(n):
            y[r] = out[r]
            reach[0, r] = min(reach[0, r], y[r])
            reach[1, r] = max(reach[1, r], y[r])
        clock[0] = t + h
        low = min(low, y[0])
        high = max(high, y[0])
        if which >= 0:
            switch(b, mode, which, clock[0], y)
        if which == -2:
            clock[1] = -clock[1]
            due = b.period == 0.0 and clock[1] < 0.0
        if due:
            for r in range(n):
                marks[count, r] = y[r]
            marks[count, n] = clock[0]
            marks[count, n + 1] = low
            marks[count, n + 2] = high
            marks[count, n + 3] = stick
            low = y[0]
            high = y[0]
            stick = 0.0
            count += 1
            clock[2] += 1.0
        if events > MOST_EVENTS:
            return -1
    return count


class Settled(NamedTuple):
    """What a motion settles on.

    Attributes
    ----------
    kind : str
        "rest", "steady", "cycle", or "moves": it has not settled.
    period, amplitude, stick, work : float
        Half the range of the first component; part of the time in which all contacts stick; work of
        friction.
    nearest : float
        How closely it comes back after a shorter lag; if it moves, after any lag.
    size : float
    """

    kind: str
    period: float = 0.0
    amplitude: float = 0.0
    stick: float = 0.0
    work: float = 0.0
    nearest: float = math.inf
    size: float = 0.0


def settle(
    b: Brute,
    y: Array,
    mode: Sequence[int] | Array,
    span: float,
    late: float = 0.0,
    rounds: int = 4000,
) -> Settled | None:
    """Follow a motion until it repeats itself; None if events pile up.

    Parameters
    ----------
    span : float
        About the duration of a cycle.
    late : float
        Time before which nothing is said.
    rounds : int
        After so many spans it has not settled.
    """
    y = np.append(y, 0.0)
    mode = np.array(mode, np.int64)
    clock = np.array([0.0, 0.0, 1.0])
    size = 0.0
    own = slice(0, 3 if b.kind == TOY else len(y) - 1)
    kept = np.zeros((0, len(y) + 4))
    extent = np.ones(len(y[own]))
    n = len(y)
    k = np.zeros((5, n))
    out = np.zeros(n)
    chunk = 2.0 * LAGS * span
    while clock[0] < max(rounds * span, 1.5 * late):
        marks = np.zeros((4 * LAGS, n + 4))
        before = y[own].copy()
        work = y[-1]
        reach = np.array([y, y])
        end = clock[0] + chunk
        while clock[0] < end:
            count = follow(b, mode, clock, y, end, marks, reach, k, out)
            if count < 0:
                return None
            kept = np.concatenate([kept, marks[:count]])[-4 * LAGS :]
        size = max(size, float(np.max(np.abs(y[own]))))
        if clock[0] < late:
            continue
        if np.max(np.abs(y[own] - before)) <= STILL * size and _lies_still(
            kept, end - chunk, n, size
        ):
            still = not np.any(mode[:1] if b.kind == TOY else mode)
            return Settled("rest" if still and y[-1] == work else "steady", stick=float(still))
        extent = 0.5 * (reach[1] - reach[0])[own]
        found = _repeats(kept, extent, n)
        # What dies out returns, too.
        if found is not None and (b.period > 0.0 or found.amplitude > FADED * size):
            return found
    return Settled(
        "moves", nearest=min(_returns(kept, extent).values(), default=math.inf), size=size
    )


def _lies_still(marks: Array, since: float, n: int, size: float) -> bool:
    """Whether the first component has had one value since a time."""
    own = marks[marks[:, n] > since]
    return bool(
        len(own) == 0 or np.max(own[1:, n + 2] - own[1:, n + 1], initial=0.0) <= STILL * size
    )


def _repeats(marks: Array, size: Array, n: int) -> Settled | None:
    """The cycle, if the last marks repeat themselves up to the sizes of the components."""
    if len(marks) < 4 * LAGS:
        return None
    gaps = _gaps(marks, size)
    last = _returns(marks, size)
    least = min(last.values())
    if least > CLOSE:
        return None
    # Returns that are nearly as close as the closest have only not died out as far.
    lag = next(lag for lag in last if last[lag] <= AS_CLOSE * max(least, 0.01 * CLOSE))
    if _missing(gaps[lag], lag) > CERTAIN:
        return None
    once = marks[-lag:]
    start = marks[-1 - lag]
    low, high = np.min(once[:, n + 1]), np.max(once[:, n + 2])
    period = float(marks[-1, n] - start[n])
    return Settled(
        "cycle",
        period,
        float(high - low) / 2.0,
        float(np.sum(once[:, n + 3])) / period,
        float(marks[-1, n - 1] - start[n - 1]),
        min((last[shorter] for shorter in range(1, lag)), default=math.inf),
        float(size[0]),
    )


def _gaps(marks: Array, size: Array) -> dict[int, Array]:
    """Differences between marks, for all lags, relative to the sizes of the components."""
    states = marks[:, : len(size)]
    size = np.maximum(size, 1e-3 * np.max(np.abs(states), axis=0, initial=0.0))
    size = np.maximum(size, 1e-6 * np.max(size))
    return {
        lag: np.max(np.abs(states[lag:] - states[:-lag]) / size, axis=1)
        for lag in range(1, LAGS + 1)
    }


def _returns(marks: Array, size: Array) -> dict[int, float]:
    """How closely it has come back of late, for all lags."""
    if len(marks) < 4 * LAGS:
        return {}
    return {lag: float(np.max(gap[-2 * LAGS :])) for lag, gap in _gaps(marks, size).items()}


def _missing(gap: Array, lag: int) -> float:
    """What is missing to the cycle, if returns go on to shrink as they do."""
    before = float(np.max(gap[:LAGS]))
    now = float(np.max(gap[-LAGS:]))
    if not now < 0.5 * before:
        q = (
            0.5
            if before < CERTAIN**2 or now >= 0.9 * before
            else (now / before) ** (lag / (len(gap) - LAGS))
        )
    else:
        q = (now / before) ** (lag / (len(gap) - LAGS))
    return now / (1.0 - q)
