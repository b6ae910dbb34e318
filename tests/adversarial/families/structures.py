"""Random structures: full matrices, dry contacts along any directions, a force that swings, and
starts out of rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csc_array

from stickslip import Contact, ModalDamping, ProportionalDamping, Structure, System, laws

from ..case import Families, Rng, log_uniform, pick
from ..references.linear import Body, Touch
from ..references.mechanics import Array

Damping = Any  # a matrix, a rule of the library, or None


@dataclass(frozen=True, eq=False)
class Structural:
    """One random motion of a structure.

    Attributes
    ----------
    body : Body
        What the reference gets.
    damping
        What the library gets: a matrix or a rule.
    u, v : array, shape (n,)
        The start.
    duration : float
    sparse : bool
        Whether the library gets sparse matrices.
    family, seed
    """

    body: Body
    damping: Damping
    u: Array
    v: Array
    duration: float
    sparse: bool = False
    family: str = ""
    seed: int = 0

    @property
    def span(self) -> tuple[float, float]:
        """What the library gets."""
        return 0.0, self.duration

    @cached_property
    def shown(self) -> list[int]:
        """Unknowns that are compared: fifty at most, those of contacts and loads among them."""
        n = len(self.u)
        rows = [touch.row != 0.0 for touch in self.body.touches]
        used = [int(i) for i in np.flatnonzero(np.any([*rows, self.body.swing != 0.0], axis=0))]
        others = [i for i in range(n) if i not in used]
        return sorted([*used, *others][:50])

    @property
    def called(self) -> dict[str, int]:
        """Names of the unknowns that are compared, in every other case, and where there are too
        many for all to be shown."""
        return {f"p{i}": i for i in self.shown} if len(self.u) > 50 or self.seed % 2 else {}

    def key(self, i: int) -> str:
        """What an unknown is called in brackets."""
        return f"p{i}" if f"p{i}" in self.called else f"{i}"

    @property
    def names(self) -> list[str]:
        """Of the states that are compared."""
        return [f"{rate}u[{self.key(i)}]" for rate in ("", "d_") for i in self.shown]

    @property
    def contacts(self) -> list[str]:
        """Names of the contacts."""
        return [f"c{i}" for i in range(len(self.body.touches))]

    @cached_property
    def system(self) -> System:
        """What the library gets."""
        body = self.body
        mass, stiffness, damping = body.mass, body.stiffness, self.damping
        if self.sparse:
            mass, stiffness = csc_array(mass), csc_array(stiffness)
            damping = csc_array(damping) if isinstance(damping, np.ndarray) else damping
        start = [("", self.u), ("d_", self.v)]
        return System(
            "structure",
            structures={"u": Structure(mass, stiffness, damping, names=self.called)},
            forces={
                f"u[{self.key(i)}]": f"{float(body.constant[i])!r} + {float(body.swing[i])!r}"
                f"*cos({body.omega!r}*t + {body.phase!r})"
                for i in map(int, np.flatnonzero((body.swing != 0.0) | (body.constant != 0.0)))
            },
            contacts={
                name: self._contact(touch)
                for name, touch in zip(self.contacts, body.touches, strict=True)
            },
            initial={
                f"{rate}u[{self.key(int(i))}]": float(values[i])
                for rate, values in start
                for i in np.flatnonzero(values)
            },
        )

    def _contact(self, touch: Touch) -> Any:
        way = " + ".join(
            f"{float(touch.row[i])!r}*d_u[{self.key(int(i))}]" for i in np.flatnonzero(touch.row)
        )
        if touch.spring:
            return laws.jenkins(way, surface_speed=touch.speed, F_c=touch.holds, k=touch.spring)
        kinetic = None if touch.slides == touch.holds else touch.slides
        return Contact(way, touch.holds, surface_speed=touch.speed, kinetic=kinetic)

    def source(self) -> str:
        """A script that repeats the library's part."""
        return (
            "from tests.adversarial import structures\n"
            f"case = structures.draw({self.family!r}, {self.seed})\n"
            "motion = ss.simulate(case.system, case.span)"
        )


FAMILIES: Families[Any] = Families()
family = FAMILIES.add


# -- words of the families -------------------------------------------------------------------------


def even(matrix: Array) -> Array:
    """The symmetric part, which is all of it but for rounding."""
    return (matrix + matrix.T) / 2.0


def turned(rng: Rng, n: int) -> Array:
    """A random orthogonal matrix."""
    q, r = np.linalg.qr(rng.normal(size=(n, n)))
    return q * np.sign(np.diag(r))


def with_frequencies(rng: Rng, omegas: Array, spread: float = 3.0) -> tuple[Array, Array]:
    """Full matrices of mass and stiffness with given frequencies."""
    n = len(omegas)
    q = turned(rng, n)
    roots = np.sqrt(np.exp(rng.uniform(-np.log(spread), np.log(spread), n)))
    half = even(q * roots @ q.T)
    ways = turned(rng, n)
    stiffness = half @ (ways * omegas**2) @ ways.T @ half
    return even(half @ half), even(stiffness)


def some_frequencies(rng: Rng, n: int, ratio: float) -> Array:
    """Between 1 and a ratio, both of them among these."""
    inner = np.exp(rng.uniform(0.0, np.log(ratio), max(n - 2, 0)))
    return np.sort(np.concatenate([[1.0, ratio], inner]))[:n]


def of_ratios(mass: Array, stiffness: Array, ratios: Array) -> Array:
    """The damping matrix of modal ratios."""
    squares, shapes = eigh(stiffness, mass)
    heavy = mass @ shapes
    return even(heavy * (2.0 * ratios * np.sqrt(np.maximum(squares, 0.0))) @ heavy.T)


def damped(rng: Rng, mass: Array, stiffness: Array, kind: str, size: float) -> tuple[Array, Any]:
    """A damping matrix of some size relative to critical damping, and what the library gets."""
    n = len(mass)
    if kind == "none":
        return np.zeros((n, n)), None
    if kind == "ratios":
        many = int(rng.integers(1, n + 1))
        ratios = size * np.exp(rng.normal(size=many))
        each = ratios[np.minimum(np.arange(n), many - 1)]
        return of_ratios(mass, stiffness, each), ModalDamping([float(x) for x in ratios])
    if kind in ("rule", "proportional"):
        alpha, beta = size * rng.uniform(0.2, 1.0), size * rng.uniform(0.2, 1.0)
        matrix = alpha * mass + beta * stiffness
        rule = ProportionalDamping(float(alpha), float(beta))
        return matrix, rule if kind == "rule" else matrix
    if kind == "dashpots":
        matrix = np.zeros((n, n))
        for _ in range(int(rng.integers(1, 3))):
            way = sparse_row(rng, n, 2)
            matrix += 2.0 * size * np.outer(way, way)
        return matrix, matrix
    root = rng.normal(size=(n, n)) / np.sqrt(n)  # "full"
    matrix = even(2.0 * size * root @ root.T)
    return matrix, matrix


def sparse_row(rng: Rng, n: int, most: int = 3) -> Array:
    """A direction that moves with a few unknowns."""
    row = np.zeros(n)
    places = rng.choice(n, size=int(rng.integers(1, min(most, n) + 1)), replace=False)
    row[places] = rng.choice([-1.0, 1.0], len(places)) * rng.uniform(0.5, 1.5, len(places))
    return row


def touches(
    rng: Rng, n: int, count: int, size: float, slides: float = 1.0, most: int = 3
) -> tuple[Touch, ...]:
    """Contacts along independent directions, with thresholds of some size."""
    rows: list[Array] = []
    while len(rows) < count:
        row = sparse_row(rng, n, most)
        whole = np.array([*rows, row])
        if np.linalg.svd(whole / np.linalg.norm(whole, axis=1)[:, None])[1][-1] > 0.1:
            rows.append(row)
    holds = [size * log_uniform(rng, 0.1, 1.0) for _ in rows]
    return tuple(Touch(row, h, h * slides) for row, h in zip(rows, holds, strict=True))


def case(
    rng: Rng,
    matrices: tuple[Array, Array],
    count: int,
    damping: tuple[Array, Any] | None = None,
    drive: float = 1.0,
    let_go: float = 0.0,
    omega: float | None = None,
    periods: float = 5.0,
    **words: Any,
) -> Structural:
    """A structure with contacts, driven at one unknown, or let go, or both."""
    mass, stiffness = matrices
    n = len(mass)
    kinds = ("none", "ratios", "rule", "proportional", "dashpots", "full")
    if damping is None:
        damping = damped(rng, mass, stiffness, pick(rng, kinds), log_uniform(rng, 0.003, 0.2))
    swing = np.zeros(n)
    swing[rng.integers(n)] = drive
    omega = log_uniform(rng, 0.4, 3.0) if omega is None else omega
    u, v = let_go * rng.normal(size=n), let_go * rng.normal(size=n)
    size = drive or let_go
    body = Body(
        mass,
        damping[0],
        stiffness,
        touches(rng, n, count, size * log_uniform(rng, 0.2, 1.5), **words),
        swing,
        omega,
        float(rng.uniform(0.0, 2.0 * np.pi)),
        np.zeros(n),
    )
    return Structural(body, damping[1], u, v, periods * 2.0 * np.pi / omega)


def few(rng: Rng, low: int = 2, high: int = 12) -> int:
    """How many unknowns."""
    return int(rng.integers(low, high + 1))


# -- families --------------------------------------------------------------------------------------


@family
def driven_structure(rng: Rng) -> Structural:
    """Full matrices under a force that swings, from rest."""
    n = few(rng)
    omegas = some_frequencies(rng, n, log_uniform(rng, 3.0, 20.0))
    return case(rng, with_frequencies(rng, omegas), int(rng.integers(1, min(n, 3) + 1)))


@family
def let_go(rng: Rng) -> Structural:
    """Out of rest, and without a load: it comes to rest in a finite time."""
    n = few(rng)
    omegas = some_frequencies(rng, n, log_uniform(rng, 3.0, 20.0))
    return case(
        rng,
        with_frequencies(rng, omegas),
        int(rng.integers(1, min(n, 3) + 1)),
        drive=0.0,
        let_go=1.0,
        omega=1.0,
        periods=4.0,
    )


@family
def full_damping(rng: Rng) -> Structural:
    """Damping that couples the modes."""
    n = few(rng)
    matrices = with_frequencies(rng, some_frequencies(rng, n, 10.0))
    size = log_uniform(rng, 0.01, 1.0)
    damping = damped(rng, *matrices, pick(rng, ("full", "dashpots")), size)
    return case(rng, matrices, int(rng.integers(1, min(n, 3) + 1)), damping, let_go=0.5)


@family
def overdamped_structure(rng: Rng) -> Structural:
    """Modes that do not swing, some near critical damping."""
    n = few(rng, 2, 8)
    matrices = with_frequencies(rng, some_frequencies(rng, n, 5.0))
    kind = pick(rng, ("ratios", "full", "critical"))
    if kind == "critical":
        ratios = pick(rng, ([1.0], [1.0 + 1e-9, 1.0 - 1e-7, 1.0], [2.0, 1.0]))
        each = np.array(ratios)[np.minimum(np.arange(n), len(ratios) - 1)]
        damping: tuple[Array, Any] = of_ratios(*matrices, each), ModalDamping(ratios)
    else:
        damping = damped(rng, *matrices, kind, log_uniform(rng, 1.0, 30.0))
    return case(rng, matrices, int(rng.integers(1, min(n, 3) + 1)), damping, let_go=0.5)


@family
def stiff_structure(rng: Rng) -> Structural:
    """Frequencies up to 1e4 times the lowest."""
    n = few(rng, 2, 10)
    ratio = log_uniform(rng, 1e2, 1e4)
    matrices = with_frequencies(rng, some_frequencies(rng, n, ratio))
    kind = pick(rng, ("ratios", "rule", "none"))
    damping = damped(rng, *matrices, kind, 0.03 if kind == "ratios" else 1e-3)
    let_go = pick(rng, (0.0, 0.3 / ratio))
    return case(rng, matrices, int(rng.integers(1, 3)), damping, let_go=let_go, periods=2.0)


@family
def rigid_modes(rng: Rng) -> Structural:
    """Springs and dashpots between masses that nothing holds."""
    n = few(rng)
    mass = np.diag(rng.uniform(0.5, 2.0, n))
    stiffness, damping = np.zeros((2, n, n))
    parts = int(rng.integers(1, 3)) if n > 3 else 1  # bodies
    for i in range(n - parts):
        way = np.zeros(n)
        way[i], way[i + parts] = -1.0, 1.0
        stiffness += rng.uniform(0.5, 5.0) * np.outer(way, way)
        damping += rng.uniform(0.0, 0.3) * np.outer(way, way)
    given = (damping, damping) if rng.uniform() < 0.7 else (np.zeros((n, n)), None)
    return case(
        rng,
        (mass, stiffness),
        int(rng.integers(1, min(n, 3) + 1)),
        given,
        let_go=pick(rng, (0.0, 1.0)),
    )


@family
def many_contacts(rng: Rng) -> Structural:
    """Four to six contacts at once."""
    n = few(rng, 6, 14)
    omegas = some_frequencies(rng, n, log_uniform(rng, 2.0, 8.0))
    return case(
        rng,
        with_frequencies(rng, omegas),
        int(rng.integers(4, 7)),
        let_go=pick(rng, (0.0, 1.0)),
        periods=3.0,
    )


@family
def large_structure(rng: Rng) -> Structural:
    """Twenty to sixty unknowns."""
    n = few(rng, 20, 60)
    omegas = some_frequencies(rng, n, log_uniform(rng, 3.0, 30.0))
    return case(
        rng,
        with_frequencies(rng, omegas),
        int(rng.integers(1, 5)),
        drive=5.0,
        let_go=pick(rng, (0.0, 1.0)),
        periods=3.0,
    )


@family
def jenkins_elements(rng: Rng) -> Structural:
    """Sliders behind springs, with contacts that have none."""
    n = few(rng)
    omegas = some_frequencies(rng, n, log_uniform(rng, 3.0, 20.0))
    found = case(
        rng,
        with_frequencies(rng, omegas),
        int(rng.integers(1, min(n, 4) + 1)),
        let_go=pick(rng, (0.0, 1.0)),
    )
    own = found.body.touches
    sprung = rng.uniform(size=len(own)) < 0.7
    sprung[0] = True
    stiff = [log_uniform(rng, 0.3, 10.0) * bool(spring) for spring in sprung]
    changed = tuple(replace(t, spring=k) for t, k in zip(own, stiff, strict=True))
    return replace(found, body=replace(found.body, touches=changed))


@family
def on_belts(rng: Rng) -> Structural:
    """Surfaces that move, and hold more than they slow down."""
    n = few(rng, 2, 8)
    found = case(
        rng,
        with_frequencies(rng, some_frequencies(rng, n, 6.0)),
        int(rng.integers(1, min(n, 3) + 1)),
        drive=pick(rng, (0.0, 0.3)),
        let_go=0.3,
        omega=1.0,
        slides=float(rng.uniform(0.5, 1.0)),
    )
    speeds = rng.normal(size=len(found.body.touches)) * 0.5
    changed = tuple(
        replace(touch, speed=float(w)) for touch, w in zip(found.body.touches, speeds, strict=True)
    )
    return replace(found, body=replace(found.body, touches=changed))


@family
def holds_more_at_rest(rng: Rng) -> Structural:
    """Thresholds above the friction in slip."""
    n = few(rng)
    omegas = some_frequencies(rng, n, log_uniform(rng, 3.0, 20.0))
    return case(
        rng,
        with_frequencies(rng, omegas),
        int(rng.integers(1, min(n, 3) + 1)),
        slides=float(rng.uniform(0.3, 0.95)),
        let_go=pick(rng, (0.0, 0.5)),
    )


@family
def alike(rng: Rng) -> Structural:
    """Equal masses in a chain or a ring: modes of equal frequencies, and modes that do not move
    what is pushed."""
    n = few(rng, 3, 15)
    ring = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    if rng.uniform() < 0.5:
        ring[0, -1] = ring[-1, 0] = -1.0
        ring += np.eye(n)
    matrices = np.eye(n), 2.0 * ring
    ratio = log_uniform(rng, 0.003, 0.1)
    damping = of_ratios(*matrices, np.full(n, ratio)), ModalDamping(ratio)
    found = case(rng, matrices, 1, damping, most=1)
    swing, row = np.zeros((2, n))
    swing[n // 2] = 1.0
    row[pick(rng, (n // 2, 0))] = 1.0
    pad = replace(found.body.touches[0], row=row)
    return replace(found, body=replace(found.body, touches=(pad,), swing=swing))


@family
def sparse_matrices(rng: Rng) -> Structural:
    """A chain with unequal masses and damping, as sparse matrices, under a dead load as well."""
    n = few(rng, 5, 40)
    mass = np.diag(rng.uniform(0.5, 2.0, n))
    between = rng.uniform(1.0, 4.0, n + 1)
    stiffness = np.diag(between[:-1] + between[1:])
    stiffness -= np.diag(between[1:-1], 1) + np.diag(between[1:-1], -1)
    damping = damped(rng, mass, stiffness, pick(rng, ("rule", "dashpots")), 0.05)
    found = case(rng, (mass, stiffness), int(rng.integers(1, 4)), damping, let_go=0.5)
    dead = np.zeros(n)
    dead[rng.integers(n)] = rng.normal()
    return replace(found, body=replace(found.body, constant=dead), sparse=True)


@family
def units_of_structures(rng: Rng) -> Structural:
    """In millimetres and tonnes, or worse: any units of length, time and force, and unknowns of
    different kinds."""
    make: Callable[[Rng], Structural] = pick(
        rng, (driven_structure, let_go, full_damping, jenkins_elements, rigid_modes, on_belts)
    )
    found = make(rng)
    length, time, force = (10.0 ** float(rng.uniform(-6.0, 6.0)) for _ in range(3))
    return scaled(found, length, time, force)


def scaled(found: Structural, length: float, time: float, force: float) -> Structural:
    """The same in other units."""
    body, damping = found.body, found.damping
    stiff, viscous = force / length, force * time / length
    if isinstance(damping, ProportionalDamping):
        alpha, beta = float(damping.alpha), float(damping.beta)
        damping = ProportionalDamping(alpha / time, beta * time)
    elif isinstance(damping, np.ndarray):
        damping = damping * viscous
    changed = tuple(
        replace(
            touch,
            holds=touch.holds * force,
            slides=touch.slides * force,
            speed=touch.speed * length / time,
            spring=touch.spring * stiff,
        )
        for touch in body.touches
    )
    return replace(
        found,
        body=Body(
            body.mass * force * time**2 / length,
            body.damping * viscous,
            body.stiffness * stiff,
            changed,
            body.swing * force,
            body.omega / time,
            body.phase,
            body.constant * force,
        ),
        damping=damping,
        u=found.u * length,
        v=found.v * length / time,
        duration=found.duration * time,
    )
