"""Sets of equilibria against dense scans: {|∂Φ| ≤ s} of energies that are not convex, and of
thresholds that depend on the place.

On a line the ends are roots between the points of a scan, to which all its extrema that are near
zero are added. In a plane components are those of a fine grid, and an end is found by sequential
quadratic programming from the outermost point of the grid.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.ndimage import label
from scipy.optimize import brentq, minimize, minimize_scalar

import stickslip as ss

from ..case import Rng, declaration, pick
from ..references.mechanics import Array
from ..registry import in_turn
from ..verdict import AGREED, NO_REFERENCE, NOT_CERTIFIED, REFUSED, WRONG, Verdict, at_most

CLOSE = 1e-8  # of ends, relative to the size of the set and where it is
CLOSE_IN_PLANE = 1e-7  # the same of ends that are optima
SCANNED = 20_000  # points of a scan on a line
GRID = 901  # points of a grid, each way
NEAR = 1e-7  # margins whose sign decides and that are no larger are not judged
PATIENCE = 30.0  # seconds

Margin = Callable[[Any], Any]
Ends = tuple[tuple[float, float], ...]
KINDS = (ss.Inertial, ss.Viscous, ss.RateIndependent)


class NotKnown(Exception):
    """The reference cannot tell."""


@dataclass(frozen=True)
class Case:
    """A system at rest.

    Attributes
    ----------
    names : tuple of str
        Coordinates whose ends are compared.
    sets : function
        Ends of all sets, by coordinate.
    box : dict of str to (float, float)
        What the library gets.
    """

    family: str
    seed: int
    system: ss.System
    names: tuple[str, ...]
    sets: Callable[[], list[Ends]]
    box: dict[str, tuple[float, float]]


FAMILIES: dict[str, Callable[[Rng], tuple[Any, ...]]] = {}


def family(make: Callable[[Rng], tuple[Any, ...]]) -> Callable[[Rng], tuple[Any, ...]]:
    """Register a family under its name in words."""
    FAMILIES[make.__name__.replace("_", " ")] = make
    return make


def draw(name: str, seed: int) -> Case:
    """The case of a family with a seed, the same on every machine."""
    rng = np.random.default_rng([zlib.crc32(name.encode()), seed])
    return Case(name, seed, *FAMILIES[name](rng))


def cases(seed: int = 0, count: int = 100) -> Iterator[Case]:
    """Cases of all families in turn."""
    return in_turn(FAMILIES, draw, seed, count)


def reproduction(case: Case) -> str:
    """A script that repeats a case."""
    return (
        f"system = {declaration(case.system)}\n"
        f"found = ss.equilibria(system, box={case.box})\nprint(found.message)"
    )


# -- references ------------------------------------------------------------------------------------


def on_a_line(margin: Margin, low: float, high: float) -> list[Ends]:
    """Where a margin is not negative, between two numbers at which it is."""
    x = np.linspace(low, high, SCANNED)
    y = margin(x)
    turns = np.flatnonzero((y[1:-1] - y[:-2]) * (y[2:] - y[1:-1]) <= 0.0) + 1
    steps = np.abs(np.diff(y)).max()
    more = []
    for k in turns[np.abs(y[turns]) < 4.0 * steps]:
        sign = 1.0 if y[k] >= y[k - 1] else -1.0
        found: Any = minimize_scalar(
            lambda v, sign=sign: -sign * float(margin(v)),
            bounds=(x[k - 1], x[k + 1]),
            method="bounded",
            options={"xatol": 1e-12},
        )
        if abs(found.fun) < NEAR:
            raise NotKnown("a margin touches zero")
        more.append(float(found.x))
    x = np.sort(np.append(x, more))
    y = margin(x)
    if y[0] >= 0.0 or y[-1] >= 0.0:
        raise NotKnown("the range is too small")
    k = np.flatnonzero((y[:-1] < 0.0) != (y[1:] < 0.0))
    ends = [_root(lambda v: float(margin(v)), x[i], x[i + 1]) for i in k]
    return [((a, b),) for a, b in zip(ends[::2], ends[1::2], strict=True)]


def _root(f: Callable[[float], float], low: float, high: float) -> float:
    found: Any = brentq(f, low, high, xtol=1e-15, rtol=np.float64(1e-15))
    return float(found)


def in_a_plane(margins: Margin, far: float) -> list[Ends]:
    """Where no margin is negative, in a square around 0."""
    axis = np.linspace(-far, far, GRID)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    values = np.min(margins(np.array([x, y])), axis=0)
    inside = values >= 0.0
    if inside[0].any() or inside[-1].any() or inside[:, 0].any() or inside[:, -1].any():
        raise NotKnown("the range is too small")
    h = axis[1] - axis[0]
    count, parts = _parts(inside)
    others = [_parts(level)[0] for level in (values >= -h, values >= h, inside[::2, ::2])]
    if others != [count] * 3 or np.bincount(parts.ravel()).min() < 30:
        raise NotKnown("parts are too near, or too small, for the grid")
    sets = []
    for c in range(1, count + 1):
        places = np.array([axis[i] for i in np.nonzero(parts == c)])
        sets.append(
            tuple(tuple(sorted(_end(margins, places, i, s, h) for s in (-1, 1))) for i in (0, 1))
        )
    return sets


def _parts(inside: Array) -> tuple[int, Array]:
    """Number of parts of a grid, but for those of a few points, and the part of every point."""
    found: Any = label(inside, np.ones((3, 3)))
    return int(np.sum(np.bincount(found[0].ravel())[1:] > 4)), found[0]


def _end(margins: Margin, places: Array, i: int, sign: int, h: float) -> float:
    """The end of a part, from the outermost point of the grid in it."""
    start = places[:, np.argmax(sign * places[i])]
    goal = -sign * np.eye(2)[i]
    found: Any = minimize(
        lambda d: float(goal @ d),
        np.zeros(2),
        jac=lambda d: goal,
        bounds=[(-80.0, 80.0)] * 2,
        method="SLSQP",
        constraints={"type": "ineq", "fun": lambda d: margins(start + h * d) / h},
        options={"maxiter": 500, "ftol": 1e-13},
    )
    place = start + h * found.x
    if np.min(margins(place)) < -1e-8 * h or np.max(np.abs(found.x)) > 79.0:
        raise NotKnown("an end is not seen")
    return float(place[i])


# -- judge -----------------------------------------------------------------------------------------


def judge(case: Case) -> Verdict:
    """Find all sets twice and compare."""
    try:
        with at_most(PATIENCE):
            expected = [
                ends
                for ends in case.sets()
                if all(_asked(case, x, e) for x, e in zip(case.names, ends, strict=True))
            ]
    except NotKnown as reason:
        return Verdict(NO_REFERENCE, str(reason))
    try:
        with at_most(PATIENCE):
            found = ss.equilibria(case.system, box=case.box)
    except Exception as error:  # whatever it raises is a finding
        return Verdict(REFUSED, f"raises {type(error).__name__}: {error}")
    got = [tuple(s.extent[x] for x in case.names) for s in found.sets]
    numbers: dict[str, Any] = {"got": got, "expected": expected, "verdict": found.message}
    left = list(got)
    off = 0.0
    missing = 0
    for ends in expected:
        errors = [_difference(ends, other) for other in left]
        if not errors or min(errors) > 1e-2:
            missing += 1
            continue
        best = int(np.argmin(errors))
        off = max(off, errors[best])
        del left[best]
    numbers |= {"difference": off, "missing": missing, "extra": len(left)}
    certified = found.certificate.ok if len(found) else not found.undecided
    close = CLOSE if len(case.names) == 1 else CLOSE_IN_PLANE
    if missing or left or not off <= close:
        return Verdict(WRONG if certified else NOT_CERTIFIED, "sets differ", numbers)
    if not certified:
        return Verdict(NOT_CERTIFIED, "but right", numbers)
    return Verdict(AGREED, "", numbers)


def _asked(case: Case, x: str, ends: tuple[float, float]) -> bool:
    """Whether a set reaches into the box."""
    low, high = case.box.get(x, (-np.inf, np.inf))
    if any(abs(a - b) < NEAR for a in ends for b in (low, high)):
        raise NotKnown("a set ends at the box")
    return ends[0] <= high and ends[1] >= low


def _difference(one: Ends, other: Ends) -> float:
    """How far ends are apart, relative to the size of the set and where it is."""
    return max(
        max(abs(p - q) for p, q in zip(a, b, strict=True)) / (a[1] - a[0] + max(map(abs, a)))
        for a, b in zip(one, other, strict=True)
    )


# -- one coordinate --------------------------------------------------------------------------------


def uniform(rng: Rng, low: float, high: float) -> float:
    """A number with three digits."""
    return round(float(rng.uniform(low, high)), 3)


def on_one(
    rng: Rng,
    potential: str,
    contacts: dict[str, Any],
    margin: Margin,
    far: float,
    kinds: tuple[Any, ...] = KINDS,
) -> tuple[Any, ...]:
    """A coordinate of any kind."""
    kind = pick(rng, kinds)
    system = ss.System(
        "at rest",
        coordinates={"x": kind()},
        kinetic="d_x**2/2" if kind is ss.Inertial else 0.0,
        viscous="d_x**2/2" if kind is ss.Viscous else 0.0,
        potential=potential,
        contacts=contacts,
    )
    boxed = rng.integers(2) == 0
    ranges = {"x": (-uniform(rng, 1.0, 4.0), uniform(rng, 1.0, 4.0))} if boxed else {}
    return system, ("x",), partial(on_a_line, margin, -far, far), ranges


def wells(rng: Rng) -> tuple[str, Margin, float]:
    """A spring and a wave or two: the energy, the force, and where no threshold up to 2 holds."""
    k = uniform(rng, 0.3, 1.0)
    waves = [
        (uniform(rng, 0.3, 2.0), uniform(rng, 1.0, 5.0), uniform(rng, 0.0, 6.0))
        for _ in range(rng.integers(1, 3))
    ]
    text = f"{k}/2*x**2" + "".join(f" + {A}/{q}*sin({q}*x + {p})" for A, q, p in waves)

    def force(x: Any) -> Any:
        return k * x + sum(A * np.cos(q * x + p) for A, q, p in waves)

    return text, force, (2.1 + sum(A for A, _, _ in waves)) / k


@family
def wells_on_a_line(rng: Rng) -> tuple[Any, ...]:
    text, force, far = wells(rng)
    plus, minus = uniform(rng, 0.1, 1.5), uniform(rng, 0.1, 1.5)
    contact = ss.Contact("d_x", (plus, minus))

    def margin(x: Any) -> Any:
        return np.minimum(force(x) + plus, minus - force(x))

    return on_one(rng, text, {"b": contact}, margin, far)


@family
def rough_ground(rng: Rng) -> tuple[Any, ...]:
    text, force, far = wells(rng) if rng.integers(2) else ("x**2/2", lambda x: x, 2.5)
    F, a, q, p = uniform(rng, 0.3, 1.0), uniform(rng, 0.3, 0.95), uniform(rng, 2, 8), 0.3
    contact = ss.Contact("d_x", f"{F}*(1 + {a}*cos({q}*x + {p}))")
    return on_one(
        rng,
        text,
        {"b": contact},
        lambda x: F * (1 + a * np.cos(q * x + p)) - abs(force(x)),
        far,
    )


@family
def threshold_that_rises(rng: Rng) -> tuple[Any, ...]:
    text, force, far = wells(rng)
    F, a, kinetic = uniform(rng, 0.3, 1.2), uniform(rng, -0.5, 0.5), uniform(rng, 0.2, 0.9)
    place = f"(1 + {a}*tanh(x))"
    law = f"({kinetic * F} + {(1 - kinetic) * F}*exp(-speed/0.3))*{place}"
    contact = ss.Contact("d_x", f"{F}*{place}", kinetic=law)

    def margin(x: Any) -> Any:
        return F * (1 + a * np.tanh(x)) - abs(force(x))

    return on_one(rng, text, {"b": contact}, margin, far, KINDS[:1])


@family
def polynomials(rng: Rng) -> tuple[Any, ...]:
    roots = np.sort(rng.uniform(-2.5, 2.5, pick(rng, (3, 5)))).round(3)
    c = np.poly(roots)
    s = uniform(rng, 0.1, 1.0) * float(np.abs(np.polyval(c, np.linspace(-2, 2, 50))).mean())
    s = round(s, 4)
    V = np.polyint(c)
    text = " + ".join(f"({a!r})*x**{len(V) - 1 - i}" for i, a in enumerate(map(float, V)) if a)
    return on_one(rng, text, {"b": ss.Contact("d_x", s)}, lambda x: s - abs(np.polyval(c, x)), 12.0)


@family
def branches_and_jumps(rng: Rng) -> tuple[Any, ...]:
    """Kinks in the energy, and a threshold that jumps."""
    text, force, far = wells(rng)
    a, b, s, t = uniform(rng, -1, 1), uniform(rng, 0.2, 1), uniform(rng, 0.2, 1), uniform(rng, 0, 1)
    contact = ss.Contact("d_x", f"piecewise(x > {a}, {s}, {t})")

    def margin(x: Any) -> Any:
        push = force(x) + b * np.clip(x - a, -0.5, 0.7)
        return np.where(x > a, s, t) - abs(push)

    side = f"piecewise(x - {a} < -0.5, -0.5*(x - {a}) - 0.125, x - {a} > 0.7, "
    side += f"0.7*(x - {a}) - 0.245, (x - {a})**2/2)"
    return on_one(rng, f"{text} + {b}*{side}", {"b": contact}, margin, far)


@family
def two_brakes(rng: Rng) -> tuple[Any, ...]:
    """Two contacts of one coordinate hold together what both can hold."""
    text, force, far = wells(rng)
    s, F, q = uniform(rng, 0.1, 0.8), uniform(rng, 0.2, 0.8), uniform(rng, 1, 5)
    brakes = {"b": ss.Contact("d_x", s), "c": ss.Contact("2*d_x", f"{F}*(1 + sin({q}*x)/2)")}
    return on_one(
        rng,
        text,
        brakes,
        lambda x: s + 2 * F * (1 + np.sin(q * x) / 2) - abs(force(x)),
        2.0 * far,
        KINDS[:2],
    )


@family
def joint_friction(rng: Rng) -> tuple[Any, ...]:
    """A pendulum, or two on one shaft: all sets in a box of several turns."""
    g, h, n = uniform(rng, 1, 10), uniform(rng, 0, 5), int(rng.integers(1, 4))
    s = uniform(rng, 0.05, 0.9) * g
    margin: Margin = lambda a: s - abs(g * np.sin(a) + n * h * np.sin(n * a + 0.4))  # noqa: E731
    system = ss.System(
        "pendulum",
        coordinates={"a": ss.Inertial()},
        kinetic="d_a**2/2",
        potential=f"-{g}*cos(a) - {h}*cos({n}*a + 0.4)",
        contacts={"b": ss.Contact("d_a", s)},
    )
    low, high = -uniform(rng, 1, 9), uniform(rng, 1, 9)

    def sets() -> list[Ends]:
        ends = np.linspace(-5, 5, 200)
        ends = ends[margin(ends) < -1e-3]
        if not len(ends):
            raise NotKnown("it rests everywhere")
        start = float(ends[0])
        return on_a_line(margin, start - 6 * np.pi, start + 6 * np.pi)

    return system, ("a",), sets, {"a": (low, high)}


@family
def something_that_hangs_on(rng: Rng) -> tuple[Any, ...]:
    """A mass without friction on a spring moves with what sticks."""
    text, force, far = wells(rng)
    s, k, f = uniform(rng, 0.2, 1.5), uniform(rng, 0.5, 3), uniform(rng, -0.5, 0.5)
    system = ss.System(
        "hanging on",
        coordinates={"x": ss.Inertial(), "z": ss.Inertial()},
        kinetic="(d_x**2 + d_z**2)/2",
        potential=f"{text} + {k}/2*(x - z)**2 - {f}*z",
        contacts={"b": ss.Contact("d_x", s)},
    )

    def sets() -> list[Ends]:
        found = on_a_line(lambda x: s - abs(force(x) - f), -far - 1, far + 1)
        return [((a, b), (a + f / k, b + f / k)) for ((a, b),) in found]

    return system, ("x", "z"), sets, {}


@family
def pressed_on_a_stop(rng: Rng) -> tuple[Any, ...]:
    """Before the stop, and at it, where any force towards it is held."""
    text, force, far = wells(rng)
    s, at = uniform(rng, 0.2, 1.2), uniform(rng, 0.2, 1.5)
    system = ss.System(
        "stop",
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential=text,
        contacts={"b": ss.Contact("d_x", s), "stop": ss.Unilateral(f"{at} - x")},
    )

    def sets() -> list[Ends]:
        if abs(s - abs(force(at))) < 1e-3:
            raise NotKnown("a margin touches zero")
        found = on_a_line(lambda x: np.minimum(s - abs(force(x)), at - x), -far, far)
        return found + [((at, at),)] * int(force(at) <= s)

    return system, ("x",), sets, {}


@family
def one_slides_one_sticks(rng: Rng) -> tuple[Any, ...]:
    """A block on a belt, tied to one on rough ground."""
    text, force, far = wells(rng)
    k, V, s, r = uniform(rng, 0.5, 2), uniform(rng, 0.1, 1), uniform(rng, 0.2, 1), 0.7
    system = ss.System(
        "belt",
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential=f"{text} + {k}/2*(x - y)**2",
        contacts={"b": ss.Contact("d_x", r), "belt": ss.Contact("d_y", s, surface_speed=V)},
    )

    def sets() -> list[Ends]:
        found = on_a_line(lambda x: r - abs(force(x) - s), -far - 2, far + 2)
        return [((a, b), (a + s / k, b + s / k)) for ((a, b),) in found]

    return system, ("x", "y"), sets, {}


# -- two coordinates -------------------------------------------------------------------------------


@family
def two_blocks(rng: Rng) -> tuple[Any, ...]:
    """Two blocks in wells, tied by a spring, each with a contact of its own."""
    k, c = uniform(rng, 0.6, 1.2), uniform(rng, 0.1, 0.8)
    A, q = uniform(rng, 0.6, 2.0), uniform(rng, 1, 3)
    B, p = uniform(rng, 0.6, 2.0), uniform(rng, 1, 3)
    s, r, a = uniform(rng, 0.3, 1), uniform(rng, 0.3, 1), uniform(rng, 0, 0.6)
    kind = pick(rng, KINDS)
    system = ss.System(
        "two blocks",
        coordinates={"x": kind(), "y": kind()},
        kinetic="(d_x**2 + d_y**2)/2" if kind is ss.Inertial else 0.0,
        viscous="(d_x**2 + d_y**2)/2" if kind is ss.Viscous else 0.0,
        potential=f"{k}/2*(x**2 + y**2) + {c}/2*(x - y)**2 + {A}/{q}*sin({q}*x) "
        f"+ {B}/{p}*cos({p}*y)",
        contacts={
            "b": ss.Contact("d_x", f"{s}*(1 + {a}*cos(2*x))"),
            "c": ss.Contact("d_y", r),
        },
    )

    def margins(z: Array) -> Array:
        x, y = z
        first = k * x + c * (x - y) + A * np.cos(q * x)
        other = k * y + c * (y - x) - B * np.sin(p * y)
        rough = s * (1 + a * np.cos(2 * x))
        return np.array([rough - first, rough + first, r - other, r + other])

    far = (max(s * (1 + a), r) + max(A, B)) / k + 0.1
    return system, ("x", "y"), partial(in_a_plane, margins, far), {}


@family
def on_a_table(rng: Rng) -> tuple[Any, ...]:
    """A contact in a plane under an energy with hills: discs, rings and what is between."""
    c, d = uniform(rng, -0.3, 0.3), uniform(rng, 0.8, 1.2)
    s, a = uniform(rng, 0.2, 0.9), uniform(rng, 0, 0.5)
    system = ss.System(
        "table",
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential=f"(x**2 + {d}*y**2 - 1)**2 + {c}*x",
        contacts={"b": ss.Contact(("d_x", "d_y"), f"{s}*(1 + {a}*tanh(y))")},
    )

    def margins(z: Array) -> Array:
        x, y = z
        r = x**2 + d * y**2 - 1
        return np.array([s * (1 + a * np.tanh(y)) - np.hypot(4 * x * r + c, 4 * d * y * r)])

    return system, ("x", "y"), partial(in_a_plane, margins, 2.0), {}
