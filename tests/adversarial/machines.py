"""Mechanics of the systems whose cycles are judged, by SciPy: nothing here is shared with the library.

A machine has a state, modes, rates in each mode, guards that end it, and a rule for what comes next. It is followed by
DOP853 from one switch to the next.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.integrate import solve_ivp

Array = np.ndarray
Mode = tuple[int, ...]
MOST_SWITCHES = 5000


class NoAnswer(Exception):
    """The reference cannot follow a motion."""


class Machine(Protocol):
    """What :func:`follow` takes."""

    def start(self, t: float, y: Array) -> Mode:
        """The mode of a state."""
        ...

    def rates(self, mode: Mode, t: float, y: Array) -> Array:
        """y' in a mode."""
        ...

    def guards(self, mode: Mode, t: float, y: Array) -> list[float]:
        """What is nonnegative in a mode."""
        ...

    def switch(self, mode: Mode, guard: int, t: float, y: Array) -> tuple[Mode, Array]:
        """The mode and the state after a guard has vanished."""
        ...


@dataclass
class Motion:
    """A motion by its pieces: ends of the times, and the solution in between."""

    times: list[float]
    pieces: list[Callable[[Array], Array]]
    end: Array

    def at(self, t: Array) -> Array:
        """States, shape (times, n)."""
        index = np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.pieces) - 1)
        return np.array([self.pieces[i](s) for i, s in zip(index, t, strict=True)])


def follow(machine: Machine, span: tuple[float, float], y: Array, step: float) -> Motion:
    """The motion over a span, in steps of at most some length.

    Raises
    ------
    NoAnswer
        If the integration fails or switches pile up.
    """
    t, y, mode = span[0], np.array(y, dtype=float), machine.start(span[0], y)
    times, pieces = [t], []
    while t < span[1]:
        events = []
        for g in range(len(machine.guards(mode, t, y))):

            def event(s: float, x: Array, g: int = g, mode: Mode = mode) -> float:
                return machine.guards(mode, s, x)[g]

            event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
            events.append(event)
        found = solve_ivp(
            lambda s, x, mode=mode: machine.rates(mode, s, x),
            (t, span[1]),
            y,
            method="DOP853",
            rtol=1e-11,
            atol=1e-13,
            max_step=step,
            events=events,
            dense_output=True,
        )
        if found.status < 0 or len(pieces) > MOST_SWITCHES:
            raise NoAnswer(found.message if found.status < 0 else "switches pile up")
        pieces.append(found.sol)
        t, y = float(found.t[-1]), found.y[:, -1]
        times.append(t)
        if found.status == 1:
            g = next(i for i, e in enumerate(found.t_events) if len(e))
            mode, y = machine.switch(mode, g, t, y)
    return Motion(times, pieces, y)


# -- masses on springs, with dry contacts and dampers in series with springs -----------------------------------------


@dataclass(frozen=True)
class Dry:
    """A contact of a mass with a surface that moves: static friction, and kinetic friction over the speed."""

    mass: int
    speed: float
    static: float
    kinetic: Callable[[float], float]


@dataclass(frozen=True)
class Damper:
    """A spring and a dry contact in series, from a mass to the ground."""

    mass: int
    stiffness: float
    threshold: float


@dataclass(frozen=True)
class Masses:
    """State (x, v, z): positions and velocities of the masses, positions of the dampers.

    Attributes
    ----------
    masses : sequence of float
    force : function
        (t, x, v) ↦ all forces but those of contacts and dampers.
    contacts, dampers : sequences
    """

    masses: Sequence[float]
    force: Callable[[float, Array, Array], Array]
    contacts: Sequence[Dry] = ()
    dampers: Sequence[Damper] = ()

    def _split(self, y: Array) -> tuple[Array, Array, Array]:
        n = len(self.masses)
        return y[:n], y[n : 2 * n], y[2 * n :]

    def _pull(self, t: float, y: Array) -> Array:
        """Forces on the masses, but for those of the contacts."""
        x, v, z = self._split(y)
        total = np.array(self.force(t, x, v), dtype=float)
        for damper, position in zip(self.dampers, z, strict=True):
            total[damper.mass] -= damper.stiffness * (x[damper.mass] - position)
        return total

    def _decide(self, contact: Dry, t: float, y: Array) -> int:
        """Mode of a contact whose relative velocity is 0."""
        pull = self._pull(t, y)[contact.mass]
        return 0 if abs(pull) <= contact.static else int(np.sign(pull))

    def start(self, t: float, y: Array) -> Mode:
        x, v, z = self._split(y)
        modes = []
        for contact in self.contacts:
            u = v[contact.mass] - contact.speed
            still = abs(u) <= 1e-12 * (1.0 + abs(contact.speed))
            modes.append(self._decide(contact, t, y) if still else int(np.sign(u)))
        for damper, position in zip(self.dampers, z, strict=True):
            stretch, rate = x[damper.mass] - position, v[damper.mass]
            full = damper.stiffness * abs(stretch) >= damper.threshold * (1.0 - 1e-12)
            modes.append(int(np.sign(stretch)) if full and stretch * rate > 0.0 else 0)
        return tuple(modes)

    def rates(self, mode: Mode, t: float, y: Array) -> Array:
        _, v, z = self._split(y)
        pull, c = self._pull(t, y), len(self.contacts)
        a = pull / np.array(self.masses)
        for m, contact in zip(mode[:c], self.contacts, strict=True):
            i = contact.mass
            friction = -m * contact.kinetic(abs(v[i] - contact.speed))
            a[i] = 0.0 if m == 0 else (pull[i] + friction) / self.masses[i]
        moved = [abs(m) * v[d.mass] for m, d in zip(mode[c:], self.dampers, strict=True)]
        return np.concatenate([v, a, np.array(moved).reshape(len(z))])

    def guards(self, mode: Mode, t: float, y: Array) -> list[float]:
        x, v, z = self._split(y)
        pull, c, found = self._pull(t, y), len(self.contacts), []
        for m, contact in zip(mode[:c], self.contacts, strict=True):
            i = contact.mass
            found.append(m * (v[i] - contact.speed) if m else contact.static - abs(pull[i]))
        for m, damper, position in zip(mode[c:], self.dampers, z, strict=True):
            i = damper.mass
            found.append(m * v[i] if m else damper.threshold - damper.stiffness * abs(x[i] - position))
        return found

    def switch(self, mode: Mode, guard: int, t: float, y: Array) -> tuple[Mode, Array]:
        modes, y, n, c = list(mode), y.copy(), len(self.masses), len(self.contacts)
        if guard < c:
            contact = self.contacts[guard]
            y[n + contact.mass] = contact.speed
            modes[guard] = self._decide(contact, t, y)
            if mode[guard] == 0 and modes[guard] == 0:
                modes[guard] = int(np.sign(self._pull(t, y)[contact.mass]))
        else:
            damper = self.dampers[guard - c]
            modes[guard] = 0 if mode[guard] else int(np.sign(y[damper.mass] - y[2 * n + guard - c]))
        return tuple(modes), y


# -- the slider with a state of its surface, (3.1)-(3.3) -------------------------------------------------------------


@dataclass(frozen=True)
class Slider:
    """State (U, α): U' = V − (U − μ(α))⁺/ν, α' = 1 − α + U (U − μ(α))⁺/ν."""

    V: float
    nu: float
    mu: Callable[[float], float]

    def start(self, t: float, y: Array) -> Mode:
        return (int(y[0] > self.mu(y[1])),)

    def rates(self, mode: Mode, t: float, y: Array) -> Array:
        slip = mode[0] * (y[0] - self.mu(y[1])) / self.nu
        return np.array([self.V - slip, 1.0 - y[1] + y[0] * slip])

    def guards(self, mode: Mode, t: float, y: Array) -> list[float]:
        excess = y[0] - self.mu(y[1])
        return [excess if mode[0] else -excess]

    def switch(self, mode: Mode, guard: int, t: float, y: Array) -> tuple[Mode, Array]:
        return (1 - mode[0],), y


# -- the toy without translational inertia, (4.2) --------------------------------------------------------------------


@dataclass(frozen=True)
class Toy:
    """State (ψ, ψ', d, s): the distance d of the legs is a play between G⁻(ψ) and G⁺(ψ), s the sum of their positions.

    The mode is 0 where d is kept, −1 where it falls with G⁺, +1 where it rises with G⁻. All other numbers are 1.
    """

    delta: float
    P: float
    c: float
    rho: float
    H: float

    def bounds(self, psi: float) -> tuple[tuple[float, int], tuple[float, int]]:
        """G⁻ and G⁺, each with the leg (+1 right, −1 left) that moves there."""
        right = self.H / 2.0 * (1.0 + min(max(psi, -1.0), 1.0))
        left = self.H - right
        lower = max((self.P + self.c * psi - self.rho - right, 1), (-self.P + self.c * psi - self.rho - left, -1))
        upper = min((self.P + self.c * psi + self.rho + right, 1), (-self.P + self.c * psi + self.rho + left, -1))
        return lower, upper

    def _pushed(self, mode: int, psi: float, rate: float) -> tuple[float, int]:
        """Rate of the bound that pushes d, and the leg that moves."""
        side = math.copysign(1e-8, rate)
        (here, leg), (ahead, _) = (self.bounds(psi + k * side)[mode < 0] for k in (1.0, 2.0))
        return (ahead - here) / side * rate, leg

    def start(self, t: float, y: Array) -> Mode:
        psi, rate, d = y[:3]
        (low, _), (high, _) = self.bounds(psi)
        for mode, at_edge in ((-1, d >= high - 1e-9), (1, d <= low + 1e-9)):
            if at_edge and mode * self._pushed(mode, psi, rate)[0] > 0.0:
                return (mode,)
        return (0,)

    def rates(self, mode: Mode, t: float, y: Array) -> Array:
        psi, rate, d = y[:3]
        pushed, leg = self._pushed(mode[0], psi, rate) if mode[0] else (0.0, 1)
        # d = x_R − x_L: the right leg moves by the change of d, or the left one by minus it.
        return np.array([rate, -self.delta * rate - psi + self.c * d, pushed, leg * pushed])

    def guards(self, mode: Mode, t: float, y: Array) -> list[float]:
        psi, rate, d = y[:3]
        if mode[0]:
            return [mode[0] * self._pushed(mode[0], psi, rate)[0]]
        (low, _), (high, _) = self.bounds(psi)
        return [high - d, d - low]

    def switch(self, mode: Mode, guard: int, t: float, y: Array) -> tuple[Mode, Array]:
        return (0,) if mode[0] else ((-1,) if guard == 0 else (1,)), y
