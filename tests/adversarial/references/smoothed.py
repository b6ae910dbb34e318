"""Bodies on points by two smoothed laws of friction, extrapolated: nothing in it knows of modes.

Positions in the plane are complex numbers, z = x + iy. Where a speed r = |Au| is below a width ε
friction grows with it,

    tanh(r/ε)   or   r/√(r² + ε²)   times   k + (s − k) c(r/(Lε)),

with c from 1 to 0 where its argument passes 1: static friction above kinetic friction ends at a
speed that vanishes with ε, too, and is large against it, since points of a body that creeps have
different speeds. Errors are almost of first order in ε, with fractional powers behind it, other
ones for each law: what two laws and two widths leave open is the error that is allowed for.

So is what a looser integration does differently. Where a stick ends within an implicit step,
Newton's method may keep the matrix of the stick, by which the excess of a force is no more than a
velocity of the size of ε: the step passes, and slip begins too late, by both laws and with both
widths.

Within Lε static friction stops more than it should: a point that only passes close to rest, or one
of several that have broken their thresholds, where the others slip first. In the first case the
limit is no motion of the exact law, in the second it is one of two. Both laws agree on it, so it
has to be asked: where a contact comes to rest, kinetic friction alone has to bring it there, or all
is open from then on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from scipy.integrate import solve_ivp

from .mechanics import Array

WIDTHS = (4e-9, 2e-9)
FINE = 0.25  # times as wide where static friction is above kinetic friction
PRECISE = 1e-10  # relative tolerance of the integration
STRICT = 1e-12  # … where that turns out not to be enough
LOOSER = 10.0  # times the tolerance, of the integration that tells
TOLD = 1e-7  # relative; a difference that calls for the strict one
CREEPS = 30.0  # widths: the speed of what rests is below it, at almost all points of a body
MOMENT = 1e-5  # of the span, in which kinetic friction has to bring something to rest
CLOSER = 0.1  # times as wide then …
STOPS = 10.0  # … and within so many of these widths


@dataclass(frozen=True)
class Spot:
    """A point with friction in a plane.

    Attributes
    ----------
    body, on : int
        The body that it belongs to and the one under it; -1: the table.
    place : complex
        In the body.
    s, r, al : float
        The threshold is s + r cos(al t).
    axes : (float, float)
    turned : bool
        Whether the axes turn with the body.
    drop, fast : float
        Sliding friction is a part of the threshold: at all speeds, or (fast > 0) from the whole
        down to it, within this speed.
    """

    body: int
    on: int
    place: complex
    s: float
    r: float
    al: float
    axes: tuple[float, float] = (1.0, 1.0)
    turned: bool = False
    drop: float = 1.0
    fast: float = 0.0


@dataclass(frozen=True)
class Line:
    """A point with friction along a line, whose direction is fixed in space; see Spot."""

    body: int
    on: int
    place: complex
    s: float
    r: float
    al: float
    along: complex


Law = Callable[[Array, float], Array]


@dataclass(frozen=True)
class Smooth:
    """A smoothed law: what is divided by the speed, and what is left of static friction."""

    divided: Law
    left: Callable[[Array], Array]
    long: float  # L


def _tanh(r: Array, width: float) -> Array:
    return np.tanh(r / width) / np.maximum(r, 1e-300)


LAWS = (
    Smooth(_tanh, lambda z: np.exp(-(np.minimum(z, 3.0) ** 8)), 300.0),
    Smooth(lambda r, width: 1.0 / np.sqrt(r * r + width**2), lambda z: 1.0 / (1.0 + z**8), 1000.0),
)


class Smoothable(Protocol):
    """Mechanics with friction that can be smoothed."""

    @property
    def drops(self) -> bool:
        """Whether static friction is above kinetic friction somewhere."""
        ...

    def dropping(self, t: float, y: Array) -> Array:
        """Speeds of the contacts whose static friction is above kinetic friction."""
        ...

    def rates(self, law: Smooth, width: float) -> Callable[[float, Array], Array]:
        """The equations of motion of a smoothed law."""
        ...


@dataclass(frozen=True)
class Board:
    """Rigid bodies in a plane, with coordinates (x, y, θ) of each.

    Attributes
    ----------
    mass, inertia : arrays, shape (bodies,)
        Inertia is that about the centre of mass.
    centre : complex array, shape (bodies,)
        The centre of mass in the body.
    loads : mapping of str to array, shape (3 bodies,)
        Forces on coordinates are G + F cos(om t + ph) − K q − C q′.
    spots : tuple of Spot
    lines : tuple of Line
    table : mapping of str to float
        Numbers of its motion; empty: it rests.
    weight, height : float
        Of one body on three spots, whose thresholds are parts of what presses them; above these,
        the centre of mass. 0: thresholds are forces.
    """

    mass: Array
    inertia: Array
    centre: Array
    loads: Mapping[str, Array]
    spots: tuple[Spot, ...]
    lines: tuple[Line, ...]
    table: Mapping[str, float]
    weight: float = 0.0
    height: float = 0.0

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return 3 * len(self.mass)

    @property
    def drops(self) -> bool:
        """Whether static friction is above kinetic friction somewhere."""
        return any(spot.drop < 1.0 and spot.fast == 0.0 for spot in self.spots)

    def dropping(self, t: float, y: Array) -> Array:
        """Speeds of the spots whose static friction is above kinetic friction."""
        touches = self.touches()
        q, v = y[: self.size], y[self.size :]
        own = touches.measured(q, touches.slide(t, q, v, *touches.arms(q)))
        return np.abs(own[(touches.drop < 1.0) & (touches.fast == 0.0)])

    def loaded(self, t: float, q: Array, v: Array) -> Array:
        """Forces on the coordinates without friction."""
        w = self.loads
        return w["G"] + w["F"] * np.cos(w["om"] * t + w["ph"]) - w["K"] * q - w["C"] * v

    def carries(self, t: float, at: Array) -> Array:
        """The velocity of the table at points."""
        w = self.table
        if not w:
            return np.zeros(len(at), complex)
        swing = np.sin(w["wo"] * t)
        own = complex(w["wx"] + w["ax"] * swing, w["wy"] + w["ay"] * np.cos(w["wo"] * t))
        return own + 1j * (w["Om"] + w["Oa"] * swing) * (at - complex(w["X"], w["Y"]))

    def accelerations(self, t: float, q: Array, v: Array, sums: Array, moments: Array) -> Array:
        """q″ for forces on bodies, and moments about the points of their coordinates."""
        load = self.loaded(t, q, v)
        force = load[0::3] + 1j * load[1::3] + sums
        arm = np.exp(1j * q[2::3]) * self.centre
        turn = (load[2::3] + moments - np.imag(np.conj(arm) * force)) / self.inertia
        move = force / self.mass + (v[2::3] ** 2 - 1j * turn) * arm
        return np.stack([np.real(move), np.imag(move), turn], axis=1).ravel()

    def pressed(self, arm: Array, parts: Array) -> Array:
        """What presses three spots that rub with parts of it, by the balance of moments: nothing
        leaves the table.

        Parameters
        ----------
        arm, parts : complex arrays, shape (3,)
            From the centre of mass to them, and the friction of each, in space.
        """
        lever = arm + self.height * parts
        system = np.stack([np.ones(3), np.real(lever), np.imag(lever)])
        return np.linalg.solve(system, np.array([self.weight, 0.0, 0.0]))

    def touches(self) -> Touches:
        """All contacts as arrays."""
        return Touches(self, (*self.spots, *self.lines))

    def rates(self, law: Smooth, width: float) -> Callable[[float, Array], Array]:
        """The equations of motion of a smoothed law."""
        return rates(self, law, width)


class Touches:
    """Kinematics of all contacts of a board, first those in a plane, then those along lines."""

    def __init__(self, board: Board, points: tuple[Any, ...]) -> None:
        self.board = board
        self.body = np.array([p.body for p in points])
        self.on = np.array([p.on for p in points])
        self.place = np.array([p.place for p in points])
        self.s, self.r, self.al = (
            np.array([getattr(p, w) for p in points]) for w in ("s", "r", "al")
        )
        self.planes = len(board.spots)
        spots = board.spots
        self.axes = np.array([p.axes for p in spots]).reshape(-1, 2)
        self.turned = np.array([p.turned for p in spots], dtype=bool)
        self.along = np.array([p.along for p in board.lines], dtype=complex)
        self.drop = np.array([p.drop for p in spots] + [1.0] * len(board.lines))
        self.fast = np.array([p.fast for p in spots] + [0.0] * len(board.lines))
        self.weakens = bool(np.any(self.fast > 0.0))
        self.drops = bool(np.any((self.drop < 1.0) & (self.fast == 0.0)))
        self.stacked = bool(np.any(self.on >= 0))
        self.plain = bool(np.all(self.axes == 1.0)) and not board.lines

    def threshold(self, t: float) -> Array:
        """s of all contacts."""
        return self.s + self.r * np.cos(self.al * t)

    def arms(self, q: Array) -> tuple[Array, Array]:
        """From the points of the coordinates to contacts, in space; and places of contacts."""
        arm = np.exp(1j * q[2::3])[self.body] * self.place
        return arm, (q[0::3] + 1j * q[1::3])[self.body] + arm

    def slide(self, t: float, q: Array, v: Array, arm: Array, at: Array) -> Array:
        """Relative velocities of all contacts."""
        move = v[0::3] + 1j * v[1::3]
        u = move[self.body] + 1j * v[2::3][self.body] * arm
        if self.stacked:
            below = move[self.on] + 1j * v[2::3][self.on] * (at - (q[0::3] + 1j * q[1::3])[self.on])
            return u - np.where(self.on >= 0, below, self.board.carries(t, at))
        return u - self.board.carries(t, at) if self.board.table else u

    def frames(self, q: Array) -> Array:
        """First axes of all contacts in space."""
        e = np.where(self.turned, np.exp(1j * q[2::3])[self.body[: self.planes]], 1.0)
        return np.concatenate([e, self.along])

    def measured(self, q: Array, u: Array) -> Array:
        """Au in the frames of all contacts; along lines a real number."""
        own = u * np.conj(self.frames(q))
        p = self.planes
        own[:p] = self.axes[:, 0] * np.real(own[:p]) + 1j * self.axes[:, 1] * np.imag(own[:p])
        own[p:] = np.real(own[p:])
        return own

    def sums(self, q: Array, arm: Array, at: Array, force: Array) -> tuple[Array, Array]:
        """Forces on bodies and moments about the points of their coordinates."""
        bodies = len(self.board.mass)
        if bodies == 1:
            return np.array([force.sum()]), np.array([np.imag(np.conj(arm) * force).sum()])
        total, moment = np.zeros(bodies, complex), np.zeros(bodies)
        np.add.at(total, self.body, force)
        np.add.at(moment, self.body, np.imag(np.conj(arm) * force))
        on = self.on >= 0
        below = self.on[on]
        np.add.at(total, below, -force[on])
        arm = at[on] - (q[0::3] + 1j * q[1::3])[below]
        np.add.at(moment, below, -np.imag(np.conj(arm) * force[on]))
        return total, moment

    def in_space(self, q: Array, own: Array) -> Array:
        """Forces Aλ̂ in space, where λ̂ is what `measured` is for velocities."""
        p = self.planes
        found = own.astype(complex)
        found[:p] = self.axes[:, 0] * np.real(own[:p]) + 1j * self.axes[:, 1] * np.imag(own[:p])
        return found * self.frames(q)


def rates(board: Board, law: Smooth, width: float) -> Callable[[float, Array], Array]:
    """The equations of motion of a smoothed law."""
    touches = board.touches()
    n = board.size
    sliding = touches.drop

    def rate(t: float, y: Array) -> Array:
        q, v = y[:n], y[n:]
        arm, at = touches.arms(q)
        u = touches.slide(t, q, v, arm, at)
        own = u if touches.plain else touches.measured(q, u)
        r = np.abs(own)
        hold = touches.threshold(t)
        if touches.weakens:
            soft = np.exp(-r / np.where(touches.fast > 0.0, touches.fast, 1.0))
            hold = hold * np.where(touches.fast > 0.0, sliding + (1.0 - sliding) * soft, 1.0)
        if touches.drops:
            kept = law.left(r / (law.long * width))
            hold = hold * np.where(touches.fast > 0.0, 1.0, sliding + (1.0 - sliding) * kept)
        if board.weight > 0.0:
            hold = hold * board.pressed(arm, -hold * law.divided(r, width) * own)
        force = -hold * law.divided(r, width) * own
        if not touches.plain:
            force = touches.in_space(q, force)
        return np.concatenate([v, board.accelerations(t, q, v, *touches.sums(q, arm, at, force))])

    return rate


def smoothed(
    system: Smoothable,
    start: Array,
    times: Array,
    law: Smooth,
    width: float,
    precise: float = PRECISE,
) -> Array:
    """States (q, q′) at sorted times by a smoothed law.

    Raises
    ------
    RuntimeError
        If the integrator gives up.
    """
    return integrated(system, start, (0.0, float(times[-1])), times, law, width, precise).y.T


def integrated(
    system: Smoothable,
    start: Array,
    span: tuple[float, float],
    times: Array,
    law: Smooth,
    width: float,
    precise: float = PRECISE,
) -> Any:
    """A motion by a smoothed law, as SciPy gives it, with its steps.

    Parameters
    ----------
    start : array, shape (2n,)
    span : (float, float)
    times : array, shape (times,)
        Where states are wanted.
    law, width
        The smoothed law.
    precise : float
        Relative tolerance.

    Raises
    ------
    RuntimeError
        If the integrator gives up.
    """
    rate = system.rates(law, width)

    def slopes(t: float, y: Array) -> Array:
        # Differences over what is small against the width; the integrator would take larger ones.
        here, by = rate(t, y), 1e-3 * width
        return np.stack([(rate(t, y + by * e) - here) / by for e in np.eye(len(y))], axis=1)

    found = solve_ivp(
        rate,
        span,
        start,
        "LSODA",
        times,
        dense_output=True,
        jac=slopes,
        rtol=precise,
        atol=precise * 1e-2,
    )
    if found.status != 0 or found.y.shape[1] != len(times):
        raise RuntimeError(f"smoothed friction: {found.message}")
    return found


def stopped_too_early(system: Smoothable, path: Any, law: Smooth, width: float) -> float:
    """When a contact first comes to rest that kinetic friction alone would not bring there;
    infinite: never.

    Parameters
    ----------
    path
        A motion by the law, with its steps.
    """
    clock = path.sol.ts
    speeds = np.array([system.dropping(t, path.sol(t)) for t in clock]) / width
    stops = (speeds[:-1] > CREEPS) & (speeds[1:] <= CREEPS)
    for i, k in np.argwhere(stops):
        # Before static friction grew, or where it began to move.
        speed = speeds[: i + 1, k]
        first = np.flatnonzero((speed > 3.0 * law.long) | (speed <= CREEPS))
        begin = int(first[-1]) + int(speed[first[-1]] <= CREEPS) if len(first) else 0
        if not stops_alone(system, path, law, width, int(k), (begin, int(i) + 1)):
            return float(clock[i + 1])
    return np.inf


def stops_alone(
    system: Smoothable, path: Any, law: Smooth, width: float, k: int, steps: tuple[int, int]
) -> bool:
    """Whether kinetic friction alone brings a contact to rest.

    Parameters
    ----------
    path, law, width
        A motion by the law, with its steps.
    k : int
        The contact, among those whose friction drops.
    steps : (int, int)
        From where it is followed, and where it comes to rest by the law.
    """
    clock = path.sol.ts
    begin, end = clock[steps[0]], clock[steps[1]]
    span = begin, end + 10.0 * (end - begin) + MOMENT * (clock[-1] - clock[0])
    kinetic, near = replace(law, left=np.zeros_like), CLOSER * width
    alone = integrated(system, path.sol(begin), span, np.array([span[1]]), kinetic, near)
    least = min(system.dropping(t, alone.sol(t))[k] for t in alone.sol.ts)
    return bool(least < STOPS * near)


@dataclass(frozen=True)
class Limit:
    """What smoothed motions tend to.

    Attributes
    ----------
    states : array, shape (times, 2n)
    doubt : array, shape (times, 2n)
        What laws, widths and tolerances leave open; infinite from where something comes to rest
        that kinetic friction would not bring there.
    """

    states: Array
    doubt: Array


def limit(system: Smoothable, start: Array, times: Array, precise: float = PRECISE) -> Limit:
    """The limit of both laws, by Richardson's extrapolation in the width."""
    finer = FINE if system.drops else 1.0
    width = finer * WIDTHS[-1]
    span = 0.0, float(times[-1])
    found, steps, paths = [], [], []
    for law in LAWS:
        wide, narrow = (
            integrated(system, start, span, times, law, finer * w, precise) for w in WIDTHS
        )
        paths.append(narrow)
        found.append(2.0 * narrow.y.T - wide.y.T)
        steps.append(np.abs(narrow.y.T - wide.y.T))
    better = int(np.max(steps[0]) > np.max(steps[1]))
    finest = paths[better].y.T
    loose = smoothed(system, start, times, LAWS[better], width, LOOSER * precise)
    unsolved = np.abs(finest - loose)
    if precise > STRICT and np.max(unsolved) > TOLD * np.max(np.abs(finest)):
        return limit(system, start, times, STRICT)
    doubt = np.abs(found[0] - found[1]) + 0.1 * np.maximum(*steps) + unsolved
    if system.drops:
        # Where the other law does not stop the same, both differ.
        begin = stopped_too_early(system, paths[0], LAWS[0], width)
        doubt[times >= begin] = np.inf
    return Limit(found[better], doubt)
