"""Friction in a plane by collocation: exact to rounding, and the library's steps are not in it.

    M q″ = f(t, q, q′) + Σ Jᵀλ,   u = J q′ − w(t, q),   |A⁻¹λ| ≤ s in stick,
    λ = −k A n in slip, n = Au/|Au|

A slip is integrated with ℓ = log|Au| and n among the unknowns, in a time σ with

    dt = Π |Au|/(|Au| + δ) dσ,

so that its end, where ℓ → −∞, is as smooth as the rest: ℓ′ and n′ are u′ along and across n over
|Au| + δ. Its beginning is singular for n alone; u itself is smooth there, and the collocation
polynomial of one step, whose nodes leave the beginning out, is that smooth solution. A step is
Radau's with twelve nodes; everything is analytic in all numbers, so that they may be complex: the
imaginary part of a result is the derivative by the step of a parameter, through all switches.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from .collocation import NODES, PLACES, Step, newton, picard, polynomial, tail_of
from .mechanics import Array
from .pieces import NoAnswer

Mode = tuple[int, ...]

STICK, PLANE = 0, 2  # modes of a pad; ±1 in slip along a line
TOLERANCE = 2e-14  # of the last coefficients of a step
END = np.log(1e-15)  # of log|Au| where nothing remains of a slip
NEGLIGIBLE = 1e-9  # rates of |Au| below which a slip begins like t²
LEAST_STEP = 1e-7
PACE = 0.05  # of the first step of a phase
MOST_PHASES = 400
SAMPLES = np.linspace(0.0, 1.0, 49)[1:]


def _zero(width: int) -> Callable[..., Array]:
    return lambda t, q, *_: np.zeros((len(t), width))


@dataclass(frozen=True)
class Pad:
    """A contact along d = 1 or 2 directions. All laws are those of many instants at once.

    Attributes
    ----------
    directions : array, shape (d, n)
    threshold : function of (t, q)
        s, shape (instants,).
    kinetic : function of (t, q, speed), optional
        k; by default s.
    surface : function of (t, q)
        w, shape (instants, d).
    surface_rate : function of (t, q, q′)
        Its rate along the motion.
    axes : array, shape (d,)
        The diagonal of A.
    """

    directions: Array
    threshold: Callable[[Array, Array], Array]
    kinetic: Callable[[Array, Array, Array], Array] | None = None
    surface: Callable[[Array, Array], Array] | None = None
    surface_rate: Callable[[Array, Array, Array], Array] | None = None
    axes: Array = field(default_factory=lambda: np.ones(2))
    scale: float = 0.1

    @property
    def plane(self) -> bool:
        return len(self.directions) == 2

    @property
    def A(self) -> Array:
        return self.axes[: len(self.directions)]

    def held(self, t: Array, q: Array) -> Array:
        """s at instants."""
        return self.threshold(t, q) + np.zeros(len(t))

    def sliding(self, t: Array, q: Array, speed: Array) -> Array:
        """k at instants."""
        return self.held(t, q) if self.kinetic is None else self.kinetic(t, q, speed)

    def slide(self, t: Array, q: Array, v: Array) -> Array:
        """Au at instants."""
        w = 0.0 if self.surface is None else self.surface(t, q)
        return (v @ self.directions.T - w) * self.A

    def pull(self, t: Array, q: Array, v: Array) -> Array:
        """The rate of w at instants."""
        if self.surface_rate is None:
            return np.zeros((len(t), len(self.directions)))
        return self.surface_rate(t, q, v)


@dataclass(frozen=True)
class Bodies:
    """A system.

    Attributes
    ----------
    mass : array, shape (n, n)
    force : function of (t, q, q′)
        Shape (instants, n).
    pads : sequence of Pad
    """

    mass: Array
    force: Callable[[Array, Array, Array], Array]
    pads: Sequence[Pad]

    def __post_init__(self) -> None:
        object.__setattr__(self, "inverse", np.linalg.inv(self.mass))

    inverse: Array = field(init=False)

    @property
    def size(self) -> int:
        return len(self.mass)

    def response(self, mode: Mode) -> tuple[Array, Array]:
        """Directions of what sticks, and the inverse of their Delassus matrix."""
        stuck = [pad.directions for pad, m in zip(self.pads, mode, strict=True) if m == STICK]
        rows = np.concatenate([np.zeros((0, self.size)), *stuck])
        return rows, np.linalg.inv(rows @ self.inverse @ rows.T)

    def move(
        self, mode: Mode, t: Array, q: Array, v: Array, aims: dict[int, tuple[Array, Array]]
    ) -> tuple[Array, dict[int, Array]]:
        """Accelerations, and the forces of all pads, for given n and |Au| of what slides."""
        push = self.force(t, q, v)
        forces: dict[int, Array] = {}
        for c, (n, r) in aims.items():
            pad = self.pads[c]
            forces[c] = -pad.sliding(t, q, r)[:, None] * n * pad.A
            push = push + forces[c] @ pad.directions
        a = push @ self.inverse
        stuck = [c for c, m in enumerate(mode) if m == STICK]
        if stuck:
            rows, response = self.response(mode)
            pulled = np.concatenate([self.pads[c].pull(t, q, v) for c in stuck], axis=1)
            held = (pulled - a @ rows.T) @ response
            a = a + held @ rows @ self.inverse
            place = 0
            for c in stuck:
                width = len(self.pads[c].directions)
                forces[c] = held[:, place : place + width]
                place += width
        return a, forces


# -- motions ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Phase:
    """A time from which a mode holds."""

    time: Any
    mode: Mode


@dataclass(frozen=True)
class Motion:
    """States (q, q′) and forces at the times that were asked for, and the phases."""

    times: Array
    states: Array
    forces: list[Array]
    phases: list[Phase]


@dataclass
class Run:
    """One motion while it is computed."""

    bodies: Bodies
    end: float
    wanted: Array
    y: Array
    mode: Mode
    phases: list[Phase] = field(default_factory=list)
    states: list[Array] = field(default_factory=list)
    forces: list[list[Array]] = field(default_factory=list)
    tolerance: float = TOLERANCE

    # Rows of what is integrated: t, q, q′, and of each slip in a plane ℓ and n, if `aimed`, or Au:
    # where it begins, Au is much smaller than what rounding leaves of q′.

    @property
    def planes(self) -> list[int]:
        return [c for c, m in enumerate(self.mode) if m == PLANE]

    def parts(self, y: Array) -> tuple[Array, Array, Array]:
        n = self.bodies.size
        return y[:, 0], y[:, 1 : n + 1], y[:, n + 1 : 2 * n + 1]

    def aims(self, y: Array, aimed: bool) -> dict[int, tuple[Array, Array]]:
        """n and |Au| of all that slides."""
        t, q, v = self.parts(y)
        found: dict[int, tuple[Array, Array]] = {}
        place = 2 * self.bodies.size + 1
        for c, m in enumerate(self.mode):
            pad = self.bodies.pads[c]
            if m == PLANE and aimed:
                found[c] = y[:, place + 1 : place + 3], np.exp(y[:, place])
                place += 3
            elif m == PLANE:
                given = y.shape[1] > place
                slide = y[:, place : place + 2] if given else pad.slide(t, q, v)
                place += 2
                size = np.sqrt(np.sum(slide**2, axis=1))
                found[c] = slide / size[:, None], size
            elif m != STICK:
                found[c] = np.full((len(t), 1), float(m)), m * pad.slide(t, q, v)[:, 0]
        return found

    def rates(self, y: Array, aimed: bool) -> Array:
        """Rates of all rows by σ."""
        t, q, v = self.parts(y)
        aims = self.aims(y, aimed)
        a, _ = self.bodies.move(self.mode, t, q, v, aims)
        plain = np.concatenate([np.ones((len(t), 1)), v, a], axis=1)
        if not aimed:
            slides = [
                (a @ pad.directions.T - pad.pull(t, q, v)) * pad.A
                for pad in (self.bodies.pads[c] for c in self.planes)
            ]
            return np.concatenate([plain, *slides], axis=1)
        paces = {c: aims[c][1] / (aims[c][1] + self.bodies.pads[c].scale) for c in self.planes}
        whole = np.prod(np.array(list(paces.values())), axis=0) if paces else np.ones(len(t))
        rows = [plain * whole[:, None]]
        for c in self.planes:
            pad = self.bodies.pads[c]
            n, r = aims[c]
            rate = (a @ pad.directions.T - pad.pull(t, q, v)) * pad.A
            along = np.sum(rate * n, axis=1, keepdims=True)
            other = np.prod([paces[b] for b in paces if b != c], axis=0) / (r + pad.scale)
            rows.append(np.concatenate([along, rate - along * n], axis=1) * other[:, None])
        return np.concatenate(rows, axis=1)

    def guards(self, y: Array, aimed: bool) -> dict[int, Array]:
        """What is positive as long as the mode holds, for each pad."""
        t, q, v = self.parts(y)
        _, forces = self.bodies.move(self.mode, t, q, v, self.aims(y, aimed))
        found: dict[int, Array] = {}
        place = 2 * self.bodies.size + 1
        for c, m in enumerate(self.mode):
            pad = self.bodies.pads[c]
            if m == STICK:
                found[c] = pad.held(t, q) ** 2 - np.sum((forces[c] / pad.A) ** 2, axis=1)
            elif m == PLANE:
                found[c] = y[:, place] - END if aimed else np.ones(len(t))
                place += 3 if aimed else 2
            else:
                found[c] = m * pad.slide(t, q, v)[:, 0]
        return found

    def lifted(self, y: Array) -> Array:
        """A state with ℓ and n of each slip in a plane, from its velocities."""
        aims = self.aims(y[None], aimed=False)
        rows = [np.concatenate([np.log(r), n[0]]) for n, r in (aims[c] for c in self.planes)]
        return np.concatenate([y[: 2 * self.bodies.size + 1], *rows])

    def run(self) -> Motion:
        """Phase after phase."""
        new = self.choose(set(range(len(self.mode))), set())
        while True:
            self.phases.append(Phase(self.y[0], self.mode))
            if len(self.phases) > MOST_PHASES:
                raise NoAnswer("too many phases")
            event = self.phase(new)
            if event is None:
                break
            new = self.after(event)
        n = self.bodies.size
        states = np.array(self.states).reshape(len(self.wanted), 2 * n)
        forces = [np.array(column) for column in zip(*self.forces, strict=True)]
        return Motion(self.wanted, states, forces, self.phases)

    def phase(self, new: dict[int, tuple[Array, Any, Any]]) -> int | None:
        """Integrate until a guard vanishes; its pad, or None at the end."""
        armed: set[int] = set()
        if new:
            event = self.begin(new, armed)
            if event is not None or self.y[0].real >= self.end:
                return event
        y = self.lifted(self.y)
        h = PACE
        guess = np.tile(y, (NODES, 1))
        f = lambda z: self.rates(z, aimed=True)  # noqa: E731
        while True:
            stages = picard(f, y, h, guess)
            tail = np.inf if stages is None else tail_of(f(stages), y, h)
            if tail > 10 * self.tolerance:
                h /= 2
                if h < LEAST_STEP:
                    raise NoAnswer("step too small")
                guess = np.tile(y, (NODES, 1))
                continue
            assert stages is not None
            step = polynomial(y, stages)
            theta, event = self.look(step, armed, aimed=True)
            self.note(step, theta, aimed=True)
            y = step(theta)[0]
            self.y = y[: 2 * self.bodies.size + 1]
            if event is not None or self.y[0].real >= self.end:
                if event is not None and self.mode[event] == PLANE:
                    self.finish(event, y)
                return event
            for place in range(2 * self.bodies.size + 2, len(y), 3):
                y[place : place + 2] /= np.sqrt(np.sum(y[place : place + 2] ** 2))
            grow = min(2.0, 0.9 * (self.tolerance / max(tail, 1e-18)) ** (1 / NODES))
            guess = step(1.0 + PLACES * grow) if grow <= 1.2 else np.tile(y, (NODES, 1))
            h *= grow

    def finish(self, pad: int, y: Array) -> None:
        """What remains of a slip: nothing of its speed, and r/|r′| of its time."""
        place = 2 * self.bodies.size + 1 + 3 * self.planes.index(pad)
        f = self.rates(y[None], aimed=True)[0]
        self.y[0] += np.exp(y[place]) * -f[0] / (f[place] * np.exp(y[place]))

    def look(self, step: Step, armed: set[int], aimed: bool) -> tuple[Any, int | None]:
        """Where the step has to end, and why: a pad whose guard vanishes, or the last time."""
        values = self.guards(step(SAMPLES), aimed)
        armed |= {c for c, g in self.guards(step(0.0), aimed).items() if g[0].real > 1e-13}
        best: tuple[float, int | None] = (1.0, None)
        for c, g in values.items():
            g = np.real(g)
            size = np.max(np.abs(g))
            start = 0 if c in armed else int(np.argmax(g > 1e-13))
            if c not in armed and not np.any(g > 1e-13):
                continue
            armed.add(c)
            root = self._first_root(step, c, aimed, g, start, size)
            if root is not None and root < best[0]:
                best = (root, c)
        theta, event = best
        last = step(theta)[0, 0].real
        if last >= self.end:
            return self.place_of(step, self.end), None
        if event is None:
            return 1.0, None
        return self._polish(step, event, aimed, theta), event

    def _first_root(
        self, step: Step, c: int, aimed: bool, g: Array, start: int, size: float
    ) -> float | None:
        def value(theta: float) -> float:
            return float(self.guards(step(theta), aimed)[c][0].real)

        for i in range(start, len(g)):
            before = SAMPLES[i - 1] if i > 0 else 0.0
            if g[i] <= 0.0:
                low = value(before)
                if low <= 0.0:
                    return float(before)
                root: Any = brentq(value, before, SAMPLES[i], xtol=1e-15)
                return float(root)
            dips = start < i < len(g) - 1 and g[i] < min(g[i - 1], g[i + 1])
            if dips and g[i] < 0.05 * size:
                least: Any = minimize_scalar(
                    value, bounds=(before, SAMPLES[i + 1]), method="bounded",
                    options={"xatol": 1e-10},
                )  # fmt: skip
                if least.fun < 0.0:
                    below: Any = brentq(value, before, least.x, xtol=1e-15)
                    return float(below)
        return None

    def _polish(self, step: Step, c: int, aimed: bool, theta: Any) -> Any:
        """Newton's method for the root of a guard, in complex numbers."""
        if not np.iscomplexobj(step.coefficients):
            return theta
        for _ in range(3):
            g, ahead, behind = (
                self.guards(step(theta + d), aimed)[c][0] for d in (0.0, 1e-5, -1e-5)
            )
            theta = theta - g / ((ahead - behind) / 2e-5)
        return theta

    def place_of(self, step: Step, time: float) -> Any:
        """Where in a step a time is."""
        ends = [step(x)[0, 0].real - time for x in (0.0, 1.0)]
        if ends[0] * ends[1] >= 0.0:  # up to rounding it is one of them
            return 0.0 if abs(ends[0]) < abs(ends[1]) else 1.0
        theta: Any = brentq(lambda x: step(x)[0, 0].real - time, 0.0, 1.0, xtol=1e-15)
        for _ in range(3):
            ahead, behind = step(theta + 1e-5)[0, 0], step(theta - 1e-5)[0, 0]
            theta = theta - (step(theta)[0, 0] - time) / ((ahead - behind) / 2e-5)
        return theta

    def note(self, step: Step, theta: Any, aimed: bool) -> None:
        """Keep what was asked for within a step."""
        n = self.bodies.size
        last = step(theta)[0, 0].real
        while len(self.states) < len(self.wanted):
            time = self.wanted[len(self.states)]
            ends = last >= self.end and time >= self.end
            if time > last and not ends:
                break
            x = theta if ends else self.place_of(step, time) if time > step(0.0)[0, 0].real else 0.0
            y = step(x)
            t, q, v = self.parts(y)
            _, forces = self.bodies.move(self.mode, t, q, v, self.aims(y, aimed))
            self.states.append(y[0, 1 : 2 * n + 1])
            self.forces.append([forces[c][0] for c in range(len(self.mode))])

    # -- switches ----------------------------------------------------------------------------------

    def after(self, event: int) -> dict[int, tuple[Array, Any, Any]]:
        """Choose the mode after the guard of a pad has vanished."""
        if self.mode[event] == STICK:
            return self.choose({c for c, m in enumerate(self.mode) if m == STICK}, {event})
        resting = {c for c, m in enumerate(self.mode) if m == STICK} | {event}
        return self.choose(resting, set())

    def choose(self, resting: set[int], forced: set[int]) -> dict[int, tuple[Array, Any, Any]]:
        """The mode from here on: as much sticks as can. Returns how slips in planes begin: n, and
        the coefficients of t and t² of |Au|."""
        t, q, v = self.parts(self.y[None])
        sliding = {
            c for c in resting
            if not self.phases and np.max(np.abs(self.bodies.pads[c].slide(t, q, v))) > 1e-12
        }  # fmt: skip
        resting = resting - sliding
        base = list(self.mode)
        for c in sliding:
            pad = self.bodies.pads[c]
            base[c] = PLANE if pad.plane else int(np.sign(pad.slide(t, q, v)[0, 0].real))
        free = sorted(resting - forced)
        before = self.mode
        for slips in sorted(product((False, True), repeat=len(free)), key=sum):
            moving = forced | {c for c, s in zip(free, slips, strict=True) if s}
            mode = list(base)
            for c in resting:
                mode[c] = STICK
            aims = self._directions(tuple(mode), moving)
            if aims is None:
                continue
            rates = self._admitted(mode, moving, aims)
            if rates is None:
                continue
            excess = {c: self._excess(before, c) if abs(rates[c]) < NEGLIGIBLE else 0.0
                      for c in moving}  # fmt: skip
            for c in moving:
                mode[c] = PLANE if self.bodies.pads[c].plane else int(np.sign(aims[c][0].real))
            self.mode = tuple(mode)
            self._settle()
            return {
                c: (aims[c], rates[c], self._second(tuple(mode), c, aims[c], excess[c]))
                for c in moving if self.bodies.pads[c].plane
            }  # fmt: skip
        raise NoAnswer("no mode")

    def _now(self, mode: Mode, aims: dict[int, Array]) -> tuple[Array, dict[int, Array]]:
        """Accelerations and forces here, with given directions of what begins to slide."""
        was = self.mode
        self.mode = tuple(m if c not in aims else STICK for c, m in enumerate(mode))
        known = self.aims(self.y[None], aimed=False)
        self.mode = was
        t, q, v = self.parts(self.y[None])
        zero = np.zeros(1)
        full = known | {c: (n[None], zero) for c, n in aims.items()}
        marked = tuple(PLANE if c in aims else m for c, m in enumerate(mode))
        return self.bodies.move(marked, t, q, v, full)

    def _away(self, mode: Mode, c: int, aims: dict[int, Array]) -> Array:
        """The rate of Au of a pad."""
        pad = self.bodies.pads[c]
        a, _ = self._now(mode, aims)
        t, q, v = self.parts(self.y[None])
        return ((a @ pad.directions.T - pad.pull(t, q, v)) * pad.A)[0]

    def _directions(self, mode: Mode, moving: set[int]) -> dict[int, Array] | None:
        """Directions of slips that begin together, each in turn until nothing changes."""
        aims = {c: np.zeros(len(self.bodies.pads[c].directions)) + 0j for c in moving}
        for _ in range(200 if len(moving) > 1 else 1):
            change = 0.0
            for c in moving:
                new = self._direction(mode, c, aims)
                change = max(change, float(np.max(np.abs(new - aims[c]))))
                aims[c] = new
            if change < 1e-15:
                break
        real = not np.iscomplexobj(self.y)
        return {c: n.real if real else n for c, n in aims.items()}

    def _direction(self, mode: Mode, c: int, aims: dict[int, Array]) -> Array:
        """n with b − D n along n, where that is the most."""
        width = len(aims[c])
        b = self._away(mode, c, aims | {c: np.zeros(width)})
        D = np.array(
            [b - self._away(mode, c, aims | {c: np.eye(width)[i]}) for i in range(width)]
        ).T
        if width == 1:
            return np.sign(np.real(b)) + 0j

        def across(angle: Any) -> Any:
            n = np.array([np.cos(angle), np.sin(angle)])
            rate = b - D @ n
            return n[0] * rate[1] - n[1] * rate[0]

        angles = np.linspace(0.0, 2 * np.pi, 181)
        values = np.array([across(a).real for a in angles])
        best, most = None, -np.inf
        for i in np.flatnonzero(np.sign(values[1:]) != np.sign(values[:-1])):
            angle: Any = brentq(lambda a: across(a).real, angles[i], angles[i + 1], xtol=1e-16)
            n = np.array([np.cos(angle), np.sin(angle)])
            along = float(np.dot(n, b - D @ n).real)
            if along > most:
                best, most = angle, along
        if best is None:
            raise NoAnswer("no direction")
        angle = best + 0j
        for _ in range(3):
            angle -= across(angle) / ((across(angle + 1e-5) - across(angle - 1e-5)) / 2e-5)
        return np.array([np.cos(angle), np.sin(angle)])

    def _admitted(
        self, mode: list[int], moving: set[int], aims: dict[int, Array]
    ) -> dict[int, Any] | None:
        """Rates of |Au| of what begins, if all of them grow and all else can be held."""
        t, q, _ = self.parts(self.y[None])
        _, forces = self._now(tuple(mode), aims)
        for c, m in enumerate(mode):
            pad = self.bodies.pads[c]
            if m == STICK and c not in moving:
                held = pad.held(t, q)[0].real
                need = np.sqrt(np.sum((forces[c][0].real / np.real(pad.A)) ** 2))
                if need > held * (1 + 1e-11):
                    return None
        rates = {c: np.sum(self._away(tuple(mode), c, aims) * aims[c]) for c in moving}
        return None if any(r.real < -NEGLIGIBLE for r in rates.values()) else rates

    def _excess(self, before: Mode, c: int) -> Any:
        """The rate at which the force that a pad needs outgrows what it gives, while it sticks."""
        pad = self.bodies.pads[c]
        was = self.mode
        self.mode = tuple(STICK if b == c else m for b, m in enumerate(before))
        values = []
        for by in (-1e-4, 1e-4):
            rates = self.rates(self.y[None], aimed=False)
            y = self.y[None] + by * rates[:, : len(self.y)]
            t, q, v = self.parts(y)
            _, forces = self.bodies.move(self.mode, t, q, v, self.aims(y, aimed=False))
            need = np.sqrt(np.sum((forces[c] / pad.A) ** 2, axis=1))
            values.append((need - pad.sliding(t, q, np.zeros(1)))[0])
        self.mode = was
        return (values[1] - values[0]) / 2e-4

    def _second(self, mode: Mode, c: int, n: Array, excess: Any) -> Any:
        """ρ of Au = ρ t² n: half the excess over n·D⁻¹n."""
        pad = self.bodies.pads[c]
        others = tuple(m if b != c else PLANE for b, m in enumerate(mode))
        rows, response = self.bodies.response(others)
        inverse = self.bodies.inverse
        inverse = inverse - inverse @ rows.T @ response @ rows @ inverse
        D = (pad.directions @ inverse @ pad.directions.T) * np.outer(pad.A, pad.A)
        return excess / (2 * (n @ np.linalg.solve(D, n)))

    def _settle(self) -> None:
        """Let what sticks move with its surface."""
        rows, response = self.bodies.response(self.mode)
        if len(rows):
            t, q, v = self.parts(self.y[None])
            slide = np.concatenate(
                [
                    self.bodies.pads[c].slide(t, q, v)[0] / self.bodies.pads[c].A
                    for c, m in enumerate(self.mode)
                    if m == STICK
                ]
            )
            n = self.bodies.size
            self.y[n + 1 :] -= self.bodies.inverse @ rows.T @ (response @ slide)

    def begin(self, new: dict[int, tuple[Array, Any, Any]], armed: set[int]) -> int | None:
        """The first step of slips in planes: the smooth solution, from what it begins like."""
        f = lambda z: self.rates(z, aimed=False)  # noqa: E731
        self._rest(new)
        t, q, v = self.parts(self.y[None])
        slides = [
            np.zeros(2) if c in new else self.bodies.pads[c].slide(t, q, v)[0] for c in self.planes
        ]
        y = np.concatenate([self.y, *slides])
        h = 0.1
        guess = self._first_guess(new, y, h)
        while True:
            stages = newton(f, y, h, guess)
            if stages is None:
                stages = newton(f, y, h, self._first_guess(new, y, h))
            tail = np.inf if stages is None else tail_of(f(stages), y, h)
            if tail <= self.tolerance:
                break
            h /= 2
            if h < LEAST_STEP:
                raise NoAnswer("no beginning of a slip")
            # the first half of what was too long is near
            found = None if stages is None else polynomial(y, stages)
            guess = self._first_guess(new, y, h) if found is None else found(PLACES / 2)
        assert stages is not None
        aims = self.aims(stages, aimed=False)
        if any(np.sum(aims[c][0][0] * n).real < 0.9 for c, (n, _, _) in new.items()):
            raise NoAnswer("another beginning of a slip")
        step = polynomial(y, stages)
        theta, event = self.look(step, armed, aimed=False)
        self.note(step, theta, aimed=False)
        self.y = step(theta)[0]
        if event is not None:
            self.y = self.y[: 2 * self.bodies.size + 1]
        return event

    def _rest(self, new: dict[int, Any]) -> None:
        """Let what begins to slide begin at rest."""
        was = self.mode
        self.mode = tuple(STICK if c in new else m for c, m in enumerate(was))
        self._settle()
        self.mode = was

    def _first_guess(self, new: dict[int, tuple[Array, Any, Any]], y0: Array, h: float) -> Array:
        times = h * PLACES[:, None]
        n = self.bodies.size
        a, _ = self._now(self.mode, {c: aim for c, (aim, _, _) in new.items()})
        y = np.tile(y0, (NODES, 1))
        y[:, 0] += times[:, 0]
        y[:, 1 : n + 1] += times * y0[n + 1 : 2 * n + 1] + times**2 / 2 * a
        y[:, n + 1 : 2 * n + 1] += times * a
        for i, c in enumerate(self.planes):
            if c in new:
                aim, first, second = new[c]
                y[:, 2 * n + 1 + 2 * i : 2 * n + 3 + 2 * i] = (
                    first * times + second * times**2
                ) * aim
        return y


def motion(
    bodies: Bodies, start: Sequence[Any] | Array, times: Sequence[float] | Array, end: float,
    origin: Any = 0.0,
    tolerance: float = TOLERANCE,
) -> Motion:  # fmt: skip
    """The motion of a system.

    Parameters
    ----------
    bodies : Bodies
    start : array of 2n numbers
        q and q′. What slides by less than 1e-12 rests.
    times : sorted array
        Where states are wanted.
    end : float
        Last time.
    origin : number
        First time.
    tolerance : float
        Of the last coefficients of a step, relative.

    Raises
    ------
    NoAnswer
        Where it does not decide.
    """
    y = np.concatenate([[origin], np.asarray(start)])
    half = bodies.size + 1
    push = bodies.force(y[:1], y[None, 1:half], y[None, half:])
    dtype = np.result_type(y, bodies.mass, push)
    wanted = np.asarray(times, dtype=float)
    mode = (STICK,) * len(bodies.pads)
    return Run(bodies, end, wanted, y.astype(dtype), mode, tolerance=tolerance).run()
