"""Linear structures with dry contacts, exactly: in each mode of stick and slip the state obeys
x' = A x with a constant matrix, of which powers of the exponential are taken.

The state is x = (y, v, s, cos ωt, sin ωt, 1): y = Lᵀu with M = L Lᵀ, so that the mass is the unit
matrix, v = y', and s are the forces of the springs in front of sliders, all of them in units of
their own. A contact that sticks takes
its direction out of the accelerations by a projection, and its force is a row times x, as is every
guard. Guards are looked at at least twenty times in a period of the fastest mode, with their
derivatives, so that a guard that dips between two looks is found, too; Brent's method finds zeros.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, cast

import numpy as np
from scipy.linalg import cholesky, expm, solve_triangular
from scipy.optimize import brentq

from .mechanics import Array
from .pieces import NoAnswer

STEP = 0.3  # of the largest rate of a matrix
GRADED = 10  # halvings of the first step after a switch
BLOCK = 7  # doublings: so many steps are taken at once, at most
ZERO = 1e-13  # of the sum of magnitudes of a row's terms: what may be rounding
TERMS = 16  # of the series over a step
TOGETHER = 1e-11  # of the span: switches so close are one
MOST_PHASES = 20_000
MOST_STEPS = 3_000_000


@dataclass(frozen=True)
class Touch:
    """A dry contact between unknowns, or an unknown and the ground.

    Attributes
    ----------
    row : array, shape (n,)
        Its relative velocity is row·u' − speed.
    holds, slides : float
        The force up to which it sticks, and that in slip.
    speed : float
        Of the surface.
    spring : float
        Stiffness in front of the slider; zero of a contact without spring.
    """

    row: Array
    holds: float
    slides: float
    speed: float = 0.0
    spring: float = 0.0


@dataclass(frozen=True)
class Body:
    """M u'' + C u' + K u = constant + swing cos(ωt + phase) − friction."""

    mass: Array
    damping: Array
    stiffness: Array
    touches: tuple[Touch, ...]
    swing: Array
    omega: float
    phase: float
    constant: Array

    def stronger(self, factor: float) -> Body:
        """With larger friction."""
        return replace(
            self,
            touches=tuple(
                replace(touch, holds=touch.holds * factor, slides=touch.slides * factor)
                for touch in self.touches
            ),
        )


@dataclass(frozen=True)
class Phase:
    """Since when contacts have which mode: −1, 0 or 1; and how many modes were right then."""

    time: float
    mode: tuple[int, ...]
    options: int = 1


@dataclass(frozen=True)
class Motion:
    """States (u, u') and friction at times."""

    times: Array
    states: Array
    friction: Array
    phases: list[Phase]


@dataclass
class Mode:
    """The matrix of a mode, powers of its exponential, and rows.

    Attributes
    ----------
    matrix : array
    step : float
    rows : array
        Guards: nonnegative while the mode is right. Of each contact two.
    forces : array
        Friction of each contact.
    powers : list of arrays
        exp(A step 2^k).
    """

    matrix: Array
    step: float
    rows: Array
    forces: Array
    powers: list[Array] = field(default_factory=list)


def zero(of: Callable[[float], float], low: float, high: float) -> float:
    """Where a function vanishes between two places, at which it has different signs."""
    return float(cast("Any", brentq)(of, low, high, xtol=1e-15, rtol=1e-15))


class Linear:
    """Motions of a body."""

    def __init__(self, body: Body, finer: int = 1) -> None:
        self.body = body
        self.finer = finer  # times shorter steps, by which the own error is seen
        self.n = n = len(body.mass)
        self.touches = body.touches
        self.sliders = [i for i, touch in enumerate(body.touches) if touch.spring]
        self.dry = [i for i, touch in enumerate(body.touches) if not touch.spring]
        self.lower = cholesky(body.mass, lower=True)
        self.K = self._both(body.stiffness)
        self.C = self._both(body.damping)
        self.J = np.array([self._one(touch.row) for touch in body.touches]).reshape(-1, n)
        top = np.sqrt(max(np.linalg.norm(self.K, 2), 0.0))
        self.rate = max(top, body.omega)
        loads = [self._one(body.swing), self._one(body.constant)]
        loads += [touch.holds * way for touch, way in zip(self.touches, self.J, strict=True)]
        # what stands for 1 in the state: loads are accelerations of the size of the others then
        self.one = max(float(np.max(np.abs(load))) for load in loads) / self.rate
        self.size = 2 * n + len(self.sliders) + 3
        self.modes: dict[tuple[int, ...], Mode] = {}
        self.born: list[int] = []  # guards that are zero as a phase begins
        self.scale = np.full(
            self.size, self.one
        )  # the largest entries so far, of each part of the state

    def _one(self, row: Array) -> Array:
        return solve_triangular(self.lower, row, lower=True)

    def _both(self, matrix: Array) -> Array:
        half = solve_triangular(self.lower, matrix, lower=True)
        found = solve_triangular(self.lower, half.T, lower=True)
        return (found + found.T) / 2.0

    # -- matrices ----------------------------------------------------------------------------------

    def row(self, i: int) -> Array:
        """The relative velocity of a contact, as a row."""
        found = np.zeros(self.size)
        found[self.n : 2 * self.n] = self.J[i]
        found[-1] = -self.touches[i].speed / self.one
        return found

    def most(self, i: int) -> float:
        """The state of a slider at its threshold."""
        return self.touches[i].holds / np.sqrt(self.touches[i].spring)

    def mode(self, signs: tuple[int, ...]) -> Mode:
        """The mode with these signs."""
        if signs not in self.modes:
            self.modes[signs] = self._made(signs)
        return self.modes[signs]

    def _made(self, signs: tuple[int, ...]) -> Mode:
        n, body = self.n, self.body
        push = np.zeros((n, self.size))  # accelerations without what sticks
        push[:, :n] = -self.K / self.rate
        push[:, n : 2 * n] = -self.C
        push[:, -3] = self._one(body.swing * np.cos(body.phase)) / self.one
        push[:, -2] = -self._one(body.swing * np.sin(body.phase)) / self.one
        push[:, -1] = self._one(body.constant) / self.one
        forces = np.zeros((len(signs), self.size))
        A = np.zeros((self.size, self.size))
        A[:n, n : 2 * n] = self.rate * np.eye(n)
        for place, i in enumerate(self.sliders, 2 * n):
            forces[i, place] = root = np.sqrt(self.touches[i].spring)
            if not signs[i]:
                A[place] = root * self.row(i)
        for i in self.dry:
            if signs[i]:
                forces[i, -1] = signs[i] * self.touches[i].slides / self.one
        push -= self.J.T @ forces
        held = [i for i in self.dry if not signs[i]]
        if held:
            J = self.J[held]
            forces[held] = np.linalg.solve(J @ J.T, J @ push)
            push -= J.T @ forces[held]
        A[n : 2 * n] = push
        A[-3, -2] = -body.omega
        A[-2, -3] = body.omega
        rows = np.zeros((2 * len(signs), self.size))
        for i, sign in enumerate(signs):
            if sign:
                rows[2 * i] = sign * self.row(i)
                rows[2 * i + 1, -1] = 1.0  # there is but one guard
            else:
                for k, side in enumerate((1.0, -1.0)):
                    rows[2 * i + k] = -side * forces[i]
                    rows[2 * i + k, -1] += self.touches[i].holds / self.one
        core = A[:-3, :-3]
        rate = max(float(np.linalg.norm(core, 2)), body.omega)
        step = STEP / rate / self.finer
        return Mode(A, step, rows, forces, [expm(A * step)])

    def power(self, mode: Mode, k: int) -> Array:
        """exp(A step 2^k)."""
        while len(mode.powers) <= k:
            mode.powers.append(mode.powers[-1] @ mode.powers[-1])
        return mode.powers[k]

    # -- what comes next ---------------------------------------------------------------------------

    def begins(self, row: Array, A: Array, x: Array) -> int:
        """The sign of a row just after an instant; zero if three derivatives do not tell."""
        for _ in range(3):
            value = float(row @ x)
            if abs(value) > ZERO * float(np.abs(row) @ self.scale):
                return 1 if value > 0.0 else -1
            row = row @ A
        return 0

    def right(
        self, x: Array, signs: Sequence[int | None], failed: Sequence[int] = ()
    ) -> list[tuple[int, ...]]:
        """Modes that are right just after an instant, the likely one first: signs are None of
        contacts whose velocity is zero.

        There is one, unless contacts hold more than they slow down: what has `failed` to stick
        slips then, if that is possible, and of the others as many stick as can.
        """
        open_ones = [i for i in self.dry if signs[i] is None]
        unique = all(touch.holds == touch.slides for touch in self.touches)
        found: list[tuple[int, ...]] = []

        def changes(option: Sequence[int]) -> int:
            pairs = zip(open_ones, option, strict=True)
            return sum(100 * (not sign) if i in failed else bool(sign) for i, sign in pairs)

        for option in sorted(product((0, 1, -1), repeat=len(open_ones)), key=changes):
            trial = [0 if sign is None else sign for sign in signs]
            for i, sign in zip(open_ones, option, strict=True):
                trial[i] = sign
            if self._right(self.mode(tuple(trial)), x, open_ones, option):
                found.append(tuple(trial))
                if unique:
                    break
        if not found:
            raise NoAnswer("no mode is right")
        return found

    def begun(
        self, x: Array, signs: Sequence[int | None], chosen: tuple[int, ...]
    ) -> tuple[int, ...]:
        """A mode of dry contacts with the sliders that go with it."""
        trial = list(chosen)
        self.born = [2 * i for i in self.dry if signs[i] is None and trial[i]]
        A = self.mode(chosen).matrix
        for place, i in enumerate(self.sliders, 2 * self.n):
            if signs[i] is None:  # its force may be at the threshold, and its velocity zero
                trial[i] = 0
                if abs(x[place]) >= self.most(i) * (1.0 - 1e-9):
                    side = 1 if x[place] > 0.0 else -1
                    moves = self.begins(side * (self.row(i) @ A), A, x)
                    if not moves:
                        raise NoAnswer("a slider that hardly moves")
                    trial[i] = side if moves > 0 else 0
                    self.born.append(2 * i if moves > 0 or side > 0 else 2 * i + 1)
        return tuple(trial)

    def _right(self, mode: Mode, x: Array, ones: Sequence[int], option: Sequence[int]) -> bool:
        for i, sign in zip(ones, option, strict=True):
            if sign:
                if self.begins(sign * (self.row(i) @ mode.matrix), mode.matrix, x) <= 0:
                    return False
            elif any(self.begins(mode.rows[2 * i + k], mode.matrix, x) <= 0 for k in (0, 1)):
                return False
        return True

    # -- motions -----------------------------------------------------------------------------------

    def start(self, u: Array, v: Array) -> Array:
        """The state at t = 0."""
        x = np.zeros(self.size)
        x[: self.n] = self.rate * (self.lower.T @ u)
        x[self.n : 2 * self.n] = self.lower.T @ v
        x[-3] = x[-1] = self.one
        self.grow(x)
        return x

    def grow(self, x: Array) -> None:
        """Keep how large the parts of the state were."""
        n = self.n
        for part in (slice(0, n), slice(n, 2 * n), slice(2 * n, self.size)):
            top = float(np.max(np.abs(x[part]), initial=0.0))
            self.scale[part] = np.maximum(self.scale[part], top)

    def first(self, x: Array) -> list[int | None]:
        """Signs at the start, where springs are relaxed."""
        signs: list[int | None] = [None] * len(self.touches)
        for i in self.dry:
            row = self.row(i)
            velocity = float(row @ x)
            if abs(velocity) > ZERO * float(np.abs(row) @ self.scale):
                signs[i] = 1 if velocity > 0.0 else -1
        return signs

    def followed(
        self, u: Array, v: Array, duration: float, times: Array, taken: Mapping[int, int]
    ) -> Motion:
        """The motion from a state, at times; `taken` says which of several right modes phases have
        that do not have the likely one.

        Raises
        ------
        NoAnswer
            If the next mode is not clear, or there are too many of them.
        """
        x, t = self.start(u, v), 0.0
        open_signs, failed = self.first(x), list[int]()
        phases, steps = list[Phase](), 0
        states = np.zeros((len(times), 2 * self.n))
        friction = np.zeros((len(times), len(self.touches)))
        done = 0
        while True:
            options = self.right(x, open_signs, failed)
            which = taken.get(len(phases), 0)
            if which >= len(options):
                raise NoAnswer("another motion")
            signs = self.begun(x, open_signs, options[which])
            if phases and phases[-1].time == t and phases[-1].mode == signs:
                raise NoAnswer("it does not go on")
            phases.append(Phase(t, signs, len(options)))
            mode = self.mode(signs)
            end, x_end, events, more = self._phase(mode, x, t, duration)
            steps += more
            while done < len(times) and times[done] <= end:
                at = self.moved(mode, x, times[done] - t)
                states[done] = self.shown(at)
                friction[done] = -mode.forces @ at
                done += 1
            if not events:
                return Motion(times, states, friction, phases)
            if len(phases) > MOST_PHASES or steps > MOST_STEPS:
                raise NoAnswer("too many phases" if steps <= MOST_STEPS else "too many steps")
            x, t = x_end, end
            open_signs = self._after(x, signs, events)
            failed = [i for i in events if not signs[i]]

    def shown(self, x: Array) -> Array:
        """(u, u') of a state."""
        n = self.n
        parts = np.array([x[:n] / self.rate, x[n : 2 * n]]).T
        return solve_triangular(self.lower.T, parts).T.reshape(-1)

    def _after(self, x: Array, signs: tuple[int, ...], events: list[int]) -> list[int | None]:
        """Signs after switches of some contacts, None of what may stick or slip."""
        next_signs: list[int | None] = []
        for i, sign in enumerate(signs):
            switches = i in events
            if self.touches[i].spring and sign == 0 and switches:  # it begins to slide as it moves
                moves = self.begins(self.row(i), self.mode(signs).matrix, x)
                place = 2 * self.n + self.sliders.index(i)
                side = 1 if x[place] > 0.0 else -1
                if moves != side:
                    raise NoAnswer("a slider at its threshold")
                x[place] = side * self.most(i)
                next_signs.append(side)
            elif switches or (sign == 0 and not self.touches[i].spring):
                next_signs.append(None)
            else:
                next_signs.append(sign)
        still = [i for i in self.dry if next_signs[i] is None]
        if still:  # exactly
            J = self.J[still]
            gap = np.array([self.row(i) @ x for i in still])
            x[self.n : 2 * self.n] -= J.T @ np.linalg.solve(J @ J.T, gap)
        return next_signs

    def moved(self, mode: Mode, x: Array, dt: float) -> Array:
        """exp(A dt) x."""
        whole = int(dt / mode.step)
        k = 0
        rest = dt - whole * mode.step
        while whole:
            if whole & 1:
                x = self.power(mode, k) @ x
            whole >>= 1
            k += 1
        return self.near(mode, x, rest)

    def near(self, mode: Mode, x: Array, dt: float) -> Array:
        """The same for at most a step, by the series."""
        term, found = x, x
        for k in range(1, TERMS):
            term = mode.matrix @ term * (dt / k)
            found = found + term
        return found

    def _phase(
        self, mode: Mode, x: Array, t: float, duration: float
    ) -> tuple[float, Array, list[int], int]:
        """How far a mode is right: the time, the state, contacts that switch, and steps."""
        slopes = mode.rows @ mode.matrix
        size = np.abs(mode.rows[self.born]) @ self.scale
        offset, steps = 0.0, 0
        parts = [mode.step * 2.0**-k for k in range(GRADED, 0, -1)]
        first, blocks = True, 0
        while True:
            if first:
                ends = np.array([*parts, mode.step])
                points = np.array([self.near(mode, x, dt) for dt in ends]).T
            else:
                points = (self.power(mode, 0) @ x)[:, None]
                for k in range(min(2 + blocks, BLOCK)):
                    points = np.hstack([points, self.power(mode, k) @ points])
                ends = mode.step * np.arange(1, points.shape[1] + 1)
            looked = np.hstack([x[:, None], points])
            starts = np.concatenate([[0.0], ends[:-1]])
            values, rates = mode.rows @ looked, slopes @ looked
            least = np.zeros(values.shape)
            if first:  # guards that are zero and grow are rounding for a while
                least[self.born] = -ZERO * size[:, None]
                values[self.born, 0] = 0.0
            crossed = values[:, 1:] < least[:, 1:]
            dipped = (rates[:, :-1] < 0.0) & (rates[:, 1:] > 0.0) & ~crossed
            dipped &= least[:, :-1] == 0.0
            width = ends - starts
            dipped &= values[:, :-1] + 4.0 * rates[:, :-1] * width < 0.0
            dipped &= values[:, 1:] - 4.0 * rates[:, 1:] * width < 0.0
            hits: list[tuple[float, int]] = []
            for j in np.flatnonzero(np.any(crossed | dipped, axis=0)):
                for g in np.flatnonzero(crossed[:, j] | dipped[:, j]):
                    part = float(width[j])
                    hit = self._zero(mode, looked[:, j], part, int(g), bool(crossed[g, j]))
                    if hit is not None:
                        hits.append((float(starts[j]) + hit, int(g)))
                if hits:
                    break
            if hits:
                at = min(hits)[0]
                if t + offset + at >= duration:
                    break
                together = [g // 2 for when, g in hits if when - at <= TOGETHER * duration]
                last = int(np.searchsorted(ends, at))
                x_end = self.near(mode, looked[:, last], at - float(starts[last]))
                return t + offset + at, x_end, sorted(set(together)), steps
            self.grow(np.max(np.abs(points), axis=1))
            steps += points.shape[1]
            x = points[:, -1]
            offset += float(ends[-1])
            first = False
            blocks += 1
            if t + offset >= duration or steps > MOST_STEPS:
                break
        return duration, x, [], steps

    def _zero(self, mode: Mode, x: Array, width: float, g: int, crossed: bool) -> float | None:
        """When a guard first vanishes within a step, if it does; `crossed` if it is negative at its
        end."""
        terms, term = [], x
        for k in range(1, TERMS + 1):  # of the guard, as a series in the part of the step
            terms.append(float(mode.rows[g] @ term))
            term = mode.matrix @ term * (width / k)
        value = np.polynomial.Polynomial(terms)
        rate = value.deriv()

        upto = 1.0
        if value(upto) >= 0.0:
            if rate(0.0) >= 0.0 or rate(upto) <= 0.0:
                return width if crossed else None  # zero there, but for rounding
            upto = zero(rate, 0.0, upto)
            if value(upto) >= 0.0:
                return None
        low = 0.0
        if value(0.0) <= 0.0:  # it was zero, and grows first
            if rate(0.0) <= 0.0:
                return 0.0
            low = zero(rate, 0.0, upto) if rate(upto) < 0.0 else 0.0
            if value(low) <= 0.0:
                return 0.0
        return width * zero(value, low, upto)


def follow(
    body: Body,
    u: Array,
    v: Array,
    duration: float,
    times: Array,
    finer: int = 1,
    taken: Mapping[int, int] | None = None,
) -> Motion:
    """The motion of a body from u and v, at sorted times."""
    with np.errstate(over="ignore", under="ignore"):
        return Linear(body, finer).followed(u, v, duration, times, taken or {})
