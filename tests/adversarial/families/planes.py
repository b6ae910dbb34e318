"""Friction in a plane: random systems of one to three bodies, with contacts along lines among
them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from stickslip import Contact, Inertial, Parameter, System, Unilateral

from ..case import Families, Rng, Scaled, log_uniform, pick
from ..references.mechanics import Array
from ..references.sliding import Bodies, Pad

Numbers = dict[str, Any]
Row = tuple[tuple[str, str], ...]  # coefficients (1, -1, or the name of a number) and coordinates


@dataclass(frozen=True)
class Touch:
    """The words of one contact; its numbers are named by its index.

    Attributes
    ----------
    rows : tuple of tuple of (str, str)
        One or two directions.
    law : str
        "same": k = s; "drop": a part of s; "stribeck": from s down to a part of it.
    threshold : str
        "constant", "time", or "state".
    surface : str
        "none", "swing", or "table", which turns.
    ellipse : bool
    pressed : bool
        Whether the threshold is a normal force: a mass of its own is pressed down by it.
    """

    rows: tuple[Row, ...]
    law: str = "same"
    threshold: str = "constant"
    surface: str = "none"
    ellipse: bool = False
    pressed: bool = False


@dataclass(frozen=True)
class Shape:
    """The words of a system: coordinates, which of them are coupled, and contacts."""

    names: tuple[str, ...]
    touches: tuple[Touch, ...]
    heavy: bool = False  # coupled by mass
    cubic: bool = False


@dataclass(frozen=True)
class Slide(Scaled):
    """One random motion of contacts in planes."""

    shape: Shape

    @property
    def system(self) -> System:
        """What the library gets."""
        return declared(self.shape)

    @property
    def parameters(self) -> dict[str, float]:
        """What the library gets."""
        own = super().parameters
        return {n: own.get(n, self.origin) for n in self.system.parameters}

    def unit(self, name: str) -> float:
        """The library's number of one natural unit, of a coordinate or a rate."""
        return self.length / (self.time if name.startswith("d_") else 1.0)

    def unit_of_number(self, name: str) -> float:
        l, t, f = self.length, self.time, self.force  # noqa: E741
        units = {
            "M": f * t**2 / l, "C": f * t / l, "K": f / l, "Q": f / l**3, "F": f, "G": f,
            "s": f, "r": f, "h": 1 / l**2, "X": l, "Y": l,
            "om": 1 / t, "al": 1 / t, "wo": 1 / t, "Om": 1 / t, "Oa": 1 / t,
            "wx": l / t, "wy": l / t, "ax": l / t, "ay": l / t, "vs": l / t,
        }  # fmt: skip
        return units.get(name.rstrip("0123456789_"), 1.0)

    def bodies(self, numbers: Numbers | None = None) -> Bodies:
        """What the reference gets."""
        return by_hand(self.shape, self.numbers if numbers is None else numbers)


FAMILIES: Families[Any] = Families()
family = FAMILIES.add


# -- declared, and by hand -------------------------------------------------------------------------


def _quadratic(letter: str, names: tuple[str, ...], rate: str, full: bool) -> list[str]:
    return [
        f"{letter}{i}_{j}*{rate}{a}*{rate}{b}" + ("/2" if i == j else "")
        for i, a in enumerate(names)
        for j, b in enumerate(names)
        if i == j or (full and i < j)
    ]


def matrix_names(letter: str, shape: Shape, full: bool) -> list[str]:
    """Names of the numbers of a symmetric matrix."""
    n = len(shape.names)
    return [f"{letter}{i}_{j}" for i in range(n) for j in range(i, n) if i == j or full]


def _diagonal(name: str) -> bool:
    i, _, j = name[1:].partition("_")
    return name[0] in "MK" and i == j


@cache
def declared(shape: Shape) -> System:
    """The system, with parameters for all numbers."""
    names = shape.names
    coupled = len(names) > 1
    potential = _quadratic("K", names, "", coupled)
    if shape.cubic:
        potential += [f"Q{i}/4*{x}**4" for i, x in enumerate(names)]
    forces = {x: f"G{i} + F{i}*cos(om{i}*(t - t_0) + ph{i})" for i, x in enumerate(names)}
    used = ["t_0", *matrix_names("M", shape, shape.heavy), *matrix_names("K", shape, coupled)]
    used += matrix_names("C", shape, False)
    used += [f"{letter}{i}" for i in range(len(names)) for letter in ("F", "G", "om", "ph")]
    used += [f"Q{i}" for i in range(len(names)) if shape.cubic]
    used += [word for k, touch in enumerate(shape.touches) for word in words(touch, k)]
    ones = ("s", "e", "J", "vs")
    kinetic = _quadratic("M", names, "d_", shape.heavy)
    for k, touch in enumerate(shape.touches):
        if touch.pressed:
            forces[f"down{k}"] = f"-({holds(touch, k)})"
            kinetic.append(f"d_down{k}**2/2")
    return System(
        name="slide",
        parameters={n: Parameter(1.0 if n.startswith(ones) or _diagonal(n) else 0.0) for n in used},
        coordinates={x: Inertial(force=f) for x, f in forces.items()},
        kinetic=" + ".join(kinetic),
        potential=" + ".join(potential),
        viscous=" + ".join(_quadratic("C", names, "d_", False)),
        contacts={f"c{k}": contact(touch, k) for k, touch in enumerate(shape.touches)},
    )


def words(touch: Touch, k: int) -> list[str]:
    """Names of the numbers of a contact."""
    found = ["s", *{"same": [], "drop": ["d"], "stribeck": ["d", "vs"]}[touch.law]]
    found += {"constant": [], "time": ["r", "al"], "state": ["h"]}[touch.threshold]
    plane = len(touch.rows) == 2
    swing = ["wx", "ax", "wo"] + (["wy", "ay"] if plane else [])
    found += {"none": [], "swing": swing, "table": ["Om", "Oa", "wo", "X", "Y"]}[touch.surface]
    found += ["ex", "ey"] if touch.ellipse else []
    named = [c for row in touch.rows for c, _ in row if c not in ("1", "-1")]
    return [f"{w}{k}" for w in found] + named


def holds(touch: Touch, k: int) -> str:
    """The threshold of a contact."""
    return {
        "constant": f"s{k}",
        "time": f"s{k} + r{k}*cos(al{k}*(t - t_0))",
        "state": f"s{k}*(1 + h{k}*{touch.rows[0][0][1]}**2)",
    }[touch.threshold]


def contact(touch: Touch, k: int) -> Contact | Unilateral:
    """A contact as the library gets it."""
    along = [" + ".join(f"{c}*d_{x}" for c, x in row) for row in touch.rows]
    x, y = touch.rows[0][0][1], touch.rows[-1][0][1]
    s = holds(touch, k)
    kinetic = {
        "same": None,
        "drop": f"d{k}*({s})",
        "stribeck": f"({s})*(d{k} + (1 - d{k})*exp(-speed/vs{k}))",
    }[touch.law]
    turn = f"(Om{k} + Oa{k}*sin(wo{k}*(t - t_0)))"
    swing = (
        f"wx{k} + ax{k}*sin(wo{k}*(t - t_0))",
        f"wy{k} + ay{k}*cos(wo{k}*(t - t_0))",
    )
    if len(touch.rows) == 1:
        surface: Any = swing[0] if touch.surface == "swing" else 0.0
        return Contact(along[0], s, surface, kinetic)
    surface = {
        "none": 0.0,
        "swing": swing,
        "table": (f"-{turn}*({y} - Y{k})", f"{turn}*({x} - X{k})"),
    }[touch.surface]
    axes: Any = (f"ex{k}", f"ey{k}") if touch.ellipse else (1.0, 1.0)
    if touch.pressed:
        return Unilateral(f"down{k}", (along[0], along[1]), 1.0, surface, axes=axes)
    return Contact((along[0], along[1]), s, surface, kinetic, axes=axes)


def _symmetric(letter: str, n: Numbers, size: int) -> Array:
    return np.array(
        [[n.get(f"{letter}{min(i, j)}_{max(i, j)}", 0.0) for j in range(size)] for i in range(size)]
    )


def by_hand(shape: Shape, n: Numbers) -> Bodies:
    """The system as the reference gets it."""
    size = len(shape.names)
    M, K, C = (_symmetric(letter, n, size) for letter in "MKC")
    F, G, om, ph = (np.array([n[f"{w}{i}"] for i in range(size)]) for w in ("F", "G", "om", "ph"))
    Q = np.array([n.get(f"Q{i}", 0.0) for i in range(size)])

    def force(t: Array, q: Array, v: Array) -> Array:
        return G + F * np.cos(t[:, None] * om + ph) - q @ K - v @ C - Q * q**3

    return Bodies(M, force, [pad(shape, touch, k, n) for k, touch in enumerate(shape.touches)])


def pad(shape: Shape, touch: Touch, k: int, n: Numbers) -> Pad:
    """A contact as the reference gets it."""
    rows = np.zeros((len(touch.rows), len(shape.names)))
    for i, row in enumerate(touch.rows):
        for c, x in row:
            rows[i, shape.names.index(x)] = float(c) if c in ("1", "-1") else n[c].real
    ix, iy = shape.names.index(touch.rows[0][0][1]), shape.names.index(touch.rows[-1][0][1])
    get = lambda w, default=0.0: n.get(f"{w}{k}", default)  # noqa: E731
    s, r, al, h, d, vs = get("s"), get("r"), get("al"), get("h"), get("d"), get("vs", 1.0)

    def threshold(t: Array, q: Array) -> Array:
        return (s + r * np.cos(al * t)) * (1 + h * q[:, ix] ** 2)

    kinetic: Callable[[Array, Array, Array], Array] | None = {
        "same": None,
        "drop": lambda t, q, u: d * threshold(t, q),
        "stribeck": lambda t, q, u: threshold(t, q) * (d + (1 - d) * np.exp(-u / vs)),
    }[touch.law]
    wo = get("wo")
    steady, swing = np.array([get("wx"), get("wy")]), np.array([get("ax"), get("ay")])
    width = len(rows)

    def moving(t: Array, q: Array) -> Array:
        turn = np.stack([np.sin(wo * t), np.cos(wo * t)], axis=1)
        return (steady + swing * turn)[:, :width]

    def pulled(t: Array, q: Array, v: Array) -> Array:
        turn = np.stack([np.cos(wo * t), -np.sin(wo * t)], axis=1)
        return (wo * swing * turn)[:, :width]

    Om, Oa, X, Y = get("Om"), get("Oa"), get("X"), get("Y")

    def table(t: Array, q: Array) -> Array:
        turn = (Om + Oa * np.sin(wo * t))[:, None]
        return turn * np.stack([Y - q[:, iy], q[:, ix] - X], axis=1)

    def turned(t: Array, q: Array, v: Array) -> Array:
        turn = (Om + Oa * np.sin(wo * t))[:, None]
        faster = (Oa * wo * np.cos(wo * t))[:, None]
        arm = np.stack([Y - q[:, iy], q[:, ix] - X], axis=1)
        return faster * arm + turn * np.stack([-v[:, iy], v[:, ix]], axis=1)

    surface = {"none": None, "swing": moving, "table": table}[touch.surface]
    rate = {"none": None, "swing": pulled, "table": turned}[touch.surface]
    axes = np.array([get("ex", 1.0), get("ey", 1.0)])
    return Pad(rows, threshold, kinetic, surface, rate, axes)


# -- numbers ---------------------------------------------------------------------------------------


def on(body: int) -> tuple[Row, Row]:
    """Directions of a body on a table."""
    return (("1", f"x{body}"),), (("1", f"y{body}"),)


def between(one: int, other: int) -> tuple[Row, Row]:
    """Directions of two bodies, one on the other."""
    return (
        (("1", f"x{one}"), ("-1", f"x{other}")),
        (("1", f"y{one}"), ("-1", f"y{other}")),
    )


def bodies(count: int) -> tuple[str, ...]:
    """Coordinates of bodies."""
    return tuple(f"{a}{i}" for i in range(1, count + 1) for a in "xy")


def positive(rng: Rng, letter: str, size: int, low: float, coupling: float) -> Numbers:
    """A positive definite matrix."""
    root = rng.normal(size=(size, size)) * coupling / np.sqrt(size)
    full = root @ root.T + low * np.diag(rng.uniform(0.5, 1.5, size))
    return {f"{letter}{i}_{j}": full[i, j] for i in range(size) for j in range(i, size)}


def ordinary(rng: Rng, shape: Shape) -> Numbers:
    """Numbers with which contacts stick and slip many times."""
    size = len(shape.names)
    n = positive(rng, "K", size, 0.6, 0.7)
    mass = positive(rng, "M", size, 0.8, 0.5)
    n |= mass if shape.heavy else {f"M{i}_{i}": rng.uniform(0.5, 2.0) for i in range(size)}
    n |= {f"C{i}_{i}": rng.choice([0.0, 0.1, 0.4]) * rng.uniform(0.5, 1) for i in range(size)}
    for i in range(size):
        n |= {
            f"F{i}": rng.uniform(0.5, 3.0),
            f"G{i}": rng.choice([0.0, 0.3]) * rng.normal(),
            f"om{i}": rng.uniform(0.5, 2.2),
            f"ph{i}": rng.uniform(0.0, 6.0),
        }
        n |= {f"Q{i}": rng.uniform(0.0, 0.5)} if shape.cubic else {}
    for k, touch in enumerate(shape.touches):
        n |= of_contact(rng, touch, k)
    return n


def of_contact(rng: Rng, touch: Touch, k: int) -> Numbers:
    """Numbers of a contact."""
    s = rng.uniform(0.3, 1.2)
    angle = rng.uniform(0.0, 6.0)
    draws = {
        "s": s, "d": rng.uniform(0.4, 0.95), "vs": rng.uniform(0.2, 1.0),
        "r": s * rng.uniform(-0.7, 0.7), "al": rng.uniform(0.3, 2.0), "h": rng.uniform(0.0, 0.5),
        "wx": 0.4 * rng.normal(), "wy": 0.4 * rng.normal(), "wo": rng.uniform(0.3, 1.5),
        "ax": rng.choice([0.0, 0.3]) * rng.normal(), "ay": rng.choice([0.0, 0.3]) * rng.normal(),
        "Om": 0.5 * rng.normal(), "Oa": rng.choice([0.0, 0.3]) * rng.normal(),
        "X": rng.normal(), "Y": rng.normal(),
        "ex": rng.uniform(0.4, 1.2), "ey": rng.uniform(0.4, 1.2),
    }  # fmt: skip
    used = [w[: -len(str(k))] for w in words(touch, k) if not w.startswith("J")]
    turns = {"a": np.cos(angle), "b": np.sin(angle)}
    named = {w: turns[w[1]] for w in words(touch, k) if w.startswith("J")}
    return {f"{w}{k}": float(draws[w]) for w in used} | {w: float(v) for w, v in named.items()}


def made(rng: Rng, shape: Shape, speed: float = 0.0, **given: Any) -> Slide:
    """A case with ordinary numbers."""
    n = ordinary(rng, shape) | given
    moving = rng.choice([0.0, speed])
    start = {x: float(0.4 * rng.normal()) for x in shape.names}
    start |= {f"d_{x}": float(moving * rng.normal()) for x in shape.names}
    return Slide(shape, n, start, float(rng.uniform(6.0, 18.0)))


def one(touch: Touch, **words: bool) -> Shape:
    """One body on a table."""
    return Shape(bodies(1), (touch,), **words)


# -- families --------------------------------------------------------------------------------------


@family
def puck(rng: Rng) -> Slide:
    """Thrown under a constant force, it comes to rest, or goes on for ever."""
    case = made(rng, one(Touch(on(1))), 1.0)
    zero = {n: 0.0 for n in case.numbers if n[0] in "KFC"}
    n = {**case.numbers, **zero, **{f"G{i}": 0.5 * rng.normal() for i in range(2)}}
    start = {**case.start, "d_x1": float(rng.normal()), "d_y1": float(rng.normal())}
    return Slide(case.shape, n, start, case.duration)


@family
def shaken_block(rng: Rng) -> Slide:
    """A block on springs, shaken in both directions."""
    return made(rng, one(Touch(on(1)), cubic=bool(rng.integers(2))), 1.0)


@family
def block_with_static_above_kinetic(rng: Rng) -> Slide:
    """What begins to slip is accelerated at once."""
    return made(rng, one(Touch(on(1), "drop")), 1.0)


@family
def block_that_slips_more_easily_when_fast(rng: Rng) -> Slide:
    """Friction falls with the speed, from the threshold."""
    return made(rng, one(Touch(on(1), "stribeck")), 1.0)


@family
def ellipse(rng: Rng) -> Slide:
    """Friction that is not the same in both directions."""
    law = pick(rng, ("same", "same", "drop"))
    return made(rng, one(Touch(on(1), law, ellipse=True), heavy=bool(rng.integers(2))), 1.0)


@family
def moving_surface(rng: Rng) -> Slide:
    """A belt that moves in both directions."""
    law = pick(rng, ("same", "same", "drop", "stribeck"))
    return made(rng, one(Touch(on(1), law, surface="swing")), 1.0)


@family
def turntable(rng: Rng) -> Slide:
    """A block on a table that turns about a point."""
    law = pick(rng, ("same", "same", "drop"))
    return made(rng, one(Touch(on(1), law, surface="table", ellipse=bool(rng.integers(2)))), 1.0)


@family
def threshold_in_time(rng: Rng) -> Slide:
    """What holds depends on time."""
    law = pick(rng, ("same", "same", "drop"))
    surface = pick(rng, ("none", "swing"))
    return made(rng, one(Touch(on(1), law, "time", surface)), 1.0)


@family
def threshold_in_the_state(rng: Rng) -> Slide:
    """What holds depends on the place."""
    law = pick(rng, ("same", "same", "drop"))
    return made(rng, one(Touch(on(1), law, "state", ellipse=bool(rng.integers(2)))), 1.0)


@family
def coupled_by_mass(rng: Rng) -> Slide:
    """Inertia is not the same in both directions, so that the way out of rest is not along the
    force."""
    return made(rng, one(Touch(on(1), pick(rng, ("same", "drop"))), heavy=True), 1.0)


@family
def two_bodies_by_springs(rng: Rng) -> Slide:
    """Two blocks on a table."""
    law = pick(rng, ("same", "same", "drop"))
    touches = Touch(on(1), law), Touch(on(2), surface=pick(rng, ("none", "swing")))
    return made(rng, Shape(bodies(2), touches), 1.0)


@family
def one_on_the_other(rng: Rng) -> Slide:
    """A block on a block on a table."""
    law = pick(rng, ("same", "same", "drop"))
    return made(rng, Shape(bodies(2), (Touch(on(1)), Touch(between(2, 1), law))), 1.0)


@family
def plane_and_line(rng: Rng) -> Slide:
    """A block on a table, and one in a guide."""
    law = pick(rng, ("same", "same", "drop"))
    surface = pick(rng, ("none", "swing"))
    other = Touch(((("1", "z"),),), pick(rng, ("same", "drop")), surface=surface)
    shape = Shape((*bodies(1), "z"), (Touch(on(1), law), other), heavy=bool(rng.integers(2)))
    return made(rng, shape, 1.0)


@family
def plane_and_rail(rng: Rng) -> Slide:
    """A block that rubs on a table, and along a rail that gives way."""
    rail = Touch(((("Ja", "x1"), ("Jb", "y1"), ("-1", "z")),))
    return made(rng, Shape((*bodies(1), "z"), (Touch(on(1)), rail)), 1.0)


@family
def turned_directions(rng: Rng) -> Slide:
    """Directions of an ellipse that are not those of the coordinates."""
    rows = (("Ja", "x1"), ("Jb", "y1")), (("Jc", "x1"), ("Jd", "y1"))
    case = made(rng, one(Touch(on(1))), 1.0)
    angle = rng.uniform(0.0, 6.0)
    c, s = float(np.cos(angle)), float(np.sin(angle))
    shape = one(Touch(rows, ellipse=True))
    turned = {"Ja": c, "Jb": s, "Jc": -s, "Jd": c}
    turned |= {"ex0": rng.uniform(0.4, 1.2), "ey0": rng.uniform(0.4, 1.2)}
    return Slide(shape, case.numbers | turned, case.start, case.duration)


@family
def three_bodies(rng: Rng) -> Slide:
    """Everything at once."""

    def law() -> str:
        return str(pick(rng, ("same", "same", "drop", "stribeck")))

    touches = (
        Touch(on(1), law(), surface=pick(rng, ("none", "swing", "table"))),
        Touch(between(2, 1), law(), pick(rng, ("constant", "time")), ellipse=True),
        Touch(((("1", "x3"),),), law()),
    )
    return made(rng, Shape(bodies(3), touches, heavy=True), 1.0)


@family
def almost_along_a_line(rng: Rng) -> Slide:
    """So little happens across that the speed almost vanishes where it is reversed."""
    case = made(rng, one(Touch(on(1))))
    little = log_uniform(rng, 1e-12, 1e-2)
    n = case.numbers | {"K0_1": 0.0, "F1": little, "G1": 0.0, "F0": rng.uniform(1.5, 4.0)}
    start = {**case.start, "y1": 0.0}
    return Slide(case.shape, n, start, case.duration)


@family
def close_pass(rng: Rng) -> Slide:
    """A force that turns while the speed passes zero at a small distance."""
    little = log_uniform(rng, 1e-13, 1e-3)
    shape = one(Touch(on(1)))
    n = ordinary(rng, shape) | {x: 0.0 for x in ("K0_0", "K0_1", "K1_1", "C0_0", "C1_1")}
    speed = rng.uniform(0.5, 2.0)
    decay = rng.uniform(1.2, 3.0) * n["s0"]  # of the speed, together with friction
    n |= {"G0": -decay, "G1": 0.0, "F0": 0.0, "F1": 0.0, "M0_0": 1.0, "M1_1": 1.0}
    start = {"x1": 0.0, "y1": 0.0, "d_x1": speed, "d_y1": little}
    return Slide(shape, n, start, float(rng.uniform(2.0, 6.0)))


@family
def pressed(rng: Rng) -> Slide:
    """What holds is a normal force, which depends on time or on the place."""
    pad = Touch(
        on(1),
        threshold=pick(rng, ("constant", "time", "state")),
        surface=pick(rng, ("none", "swing", "table")),
        ellipse=bool(rng.integers(2)),
        pressed=True,
    )
    other = Touch(between(2, 1), ellipse=bool(rng.integers(2)), pressed=True)
    stacked = bool(rng.integers(3) == 0)
    shape = Shape(bodies(2), (pad, other)) if stacked else one(pad, heavy=bool(rng.integers(2)))
    return made(rng, shape, 1.0)


@family
def scales(rng: Rng) -> Slide:
    """In units in which numbers are small or large, and late."""
    law = pick(rng, ("same", "drop"))
    case = made(rng, one(Touch(on(1), law, surface=pick(rng, ("none", "swing")))), 1.0)
    powers = [float(10.0 ** rng.integers(-6, 7)) for _ in range(3)]
    origin = float(pick(rng, (0.0, 0.0, 1e4))) * powers[1]
    first, second, third = powers
    ends = (case.duration, first, second, third, origin)
    return Slide(case.shape, case.numbers, case.start, *ends)
