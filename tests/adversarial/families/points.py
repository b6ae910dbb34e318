"""Rigid bodies on several points with friction in a plane: forces of rest are not unique, several
points leave rest and come to rest together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from stickslip import Contact, Inertial, Parameter, System, Unilateral

from ..case import Families, Rng, Scaled, pick
from ..references.smoothed import Board, Line, Spot

Numbers = dict[str, float]


@dataclass(frozen=True)
class Point:
    """The words of one contact; its numbers are named by its index.

    Attributes
    ----------
    body : int
    on : int
        The body under it; -1: the ground or the table.
    law : str
        "same": k = s; "drop": a part of s; "stribeck": from s down to a part of it.
    swings : bool
        Whether the threshold depends on time.
    turned : bool
        Whether directions turn with the body.
    ellipse : bool
    pressed : bool
        Whether the threshold is a normal force: a mass of its own is pressed down by it.
    line : bool
        Whether there is friction along a line only.
    foot : bool
        Whether it is one of three feet of a body which is pressed down by its weight; they are
        below its centre of mass, and a threshold is a part of what presses them.
    """

    body: int = 0
    on: int = -1
    law: str = "same"
    swings: bool = False
    turned: bool = False
    ellipse: bool = False
    pressed: bool = False
    line: bool = False
    foot: bool = False


@dataclass(frozen=True)
class Shape:
    """The words of a system.

    Attributes
    ----------
    points : tuple of Point
    bodies : int
    table : bool
        Whether what is under the bodies moves as is given: it swings and turns.
    off : bool
        Whether coordinates are those of a point which is not the centre of mass.
    """

    points: tuple[Point, ...]
    bodies: int = 1
    table: bool = False
    off: bool = False

    @property
    def feet(self) -> bool:
        """Whether the body stands on feet."""
        return any(point.foot for point in self.points)

    @property
    def names(self) -> tuple[str, ...]:
        """Coordinates in the plane."""
        return tuple(f"{a}{b}" for b in range(self.bodies) for a in ("x", "y", "th"))


@dataclass(frozen=True)
class Carried(Scaled):
    """One random motion of bodies on points."""

    shape: Shape

    @property
    def system(self) -> System:
        """What the library gets."""
        return declared(self.shape)

    def unit(self, name: str) -> float:
        """The library's number of one natural unit, of a coordinate or a rate."""
        rate = name.startswith("d_")
        length = 1.0 if name.removeprefix("d_").startswith("th") else self.length
        return length / (self.time if rate else 1.0)

    def unit_of_number(self, name: str) -> float:
        l, t, f = self.length, self.time, self.force  # noqa: E741
        plain = name.rstrip("0123456789")
        if plain in ("F", "G", "K", "C"):
            turns = int(name[1:]) % 3 == 2
            along = f * l if turns else f
            by = {"F": 1.0, "G": 1.0, "K": 1.0 if turns else l, "C": (1.0 if turns else l) / t}
            return along / by[plain]
        units = {"m": f * t**2 / l, "I": f * l * t**2, "s": f, "r": f, "vs": l / t}
        units |= dict.fromkeys(("px", "py", "cx", "cy", "X", "Y"), l)
        units |= dict.fromkeys(("om", "al", "wo", "Om", "Oa"), 1 / t)
        units |= dict.fromkeys(("wx", "wy", "ax", "ay"), l / t)
        if self.shape.feet:
            units |= {"s": 1.0, "A": units["I"], "h": l, "g": l / t**2}
        return units.get(plain, 1.0)

    def board(self) -> Board:
        """What the reference gets."""
        return by_hand(self.shape, self.numbers)


FAMILIES: Families[Any] = Families()
family = FAMILIES.add


# -- declared, and by hand -------------------------------------------------------------------------


def of_point(point: Point, k: int) -> list[str]:
    """Names of the numbers of a contact."""
    found = ["px", "py", "s", *{"same": [], "drop": ["d"], "stribeck": ["d", "vs"]}[point.law]]
    found += ["r", "al"] if point.swings else []
    found += ["ex", "ey"] if point.ellipse else []
    found += ["la", "lb"] if point.line else []
    return [f"{w}{k}" for w in found]


TABLE = ("wx", "wy", "ax", "ay", "wo", "Om", "Oa", "X", "Y")


@cache
def declared(shape: Shape) -> System:
    """The system, with parameters for all numbers."""
    names = shape.names
    forces = {x: f"G{i} + F{i}*cos(om{i}*t + ph{i})" for i, x in enumerate(names)}
    used = [
        f"{letter}{i}" for i in range(len(names)) for letter in ("F", "G", "om", "ph", "K", "C")
    ]
    used += [f"{w}{b}" for b in range(shape.bodies) for w in ("m", "I")]
    used += [f"{w}{b}" for b in range(shape.bodies if shape.off else 0) for w in ("cx", "cy")]
    used += [w for k, point in enumerate(shape.points) for w in of_point(point, k)]
    used += TABLE if shape.table else []
    used += ["A0", "h0", "g0"] if shape.feet else []
    kinetic = []
    potential = [f"K{i}/2*{x}**2" for i, x in enumerate(names)]
    if shape.feet:
        forces |= {"z": "0", "a": "0", "b": "0"}
        kinetic.append("m0/2*d_z**2 + A0/2*(d_a**2 + d_b**2)")
        potential.append("m0*g0*z")
    for b in range(shape.bodies):
        v, w = f"d_x{b}", f"d_y{b}"
        if shape.off:
            v += f" - d_th{b}*({_turned('y', b, f'cx{b}', f'cy{b}')})"
            w += f" + d_th{b}*({_turned('x', b, f'cx{b}', f'cy{b}')})"
        kinetic.append(f"m{b}/2*(({v})**2 + ({w})**2) + I{b}/2*d_th{b}**2")
    for k, point in enumerate(shape.points):
        if point.pressed:
            forces[f"down{k}"] = f"-({_holds(point, k)})"
            kinetic.append(f"d_down{k}**2/2")
    positive = ("m", "I", "s", "e", "d", "la", "vs", "A", "g")
    return System(
        name="carried",
        parameters={n: Parameter(1.0 if n.startswith(positive) else 0.0) for n in used},
        coordinates={x: Inertial(force=f) for x, f in forces.items()},
        kinetic=" + ".join(kinetic),
        potential=" + ".join(potential),
        viscous=" + ".join(f"C{i}/2*d_{x}**2" for i, x in enumerate(names)),
        contacts={f"p{k}": contact(shape, k) for k in range(len(shape.points))},
    )


def _turned(component: str, b: int, x: str, y: str) -> str:
    """A component of what is (x, y) in a body."""
    c, s = f"cos(th{b})", f"sin(th{b})"
    return f"{x}*{c} - {y}*{s}" if component == "x" else f"{x}*{s} + {y}*{c}"


def _holds(point: Point, k: int) -> str:
    return f"s{k} + r{k}*cos(al{k}*t)" if point.swings else f"s{k}"


def contact(shape: Shape, k: int) -> Contact | Unilateral:
    """A contact as the library gets it."""
    point = shape.points[k]
    b = point.body
    arm = [_turned(a, b, f"px{k}", f"py{k}") for a in "xy"]
    v, w = f"d_x{b} - d_th{b}*({arm[1]})", f"d_y{b} + d_th{b}*({arm[0]})"
    x, y = f"x{b} + {arm[0]}", f"y{b} + {arm[1]}"
    surface: Any = 0.0
    if point.on >= 0:
        o = point.on
        v = f"{v} - (d_x{o} - d_th{o}*({y} - y{o}))"
        w = f"{w} - (d_y{o} + d_th{o}*({x} - x{o}))"
    elif shape.table:
        turn = "(Om + Oa*sin(wo*t))"
        surface = (
            f"wx + ax*sin(wo*t) - {turn}*({y} - Y)",
            f"wy + ay*cos(wo*t) + {turn}*({x} - X)",
        )
    s = _holds(point, k)
    if point.foot:
        v, w = f"{v} - h0*d_b", f"{w} + h0*d_a"
        v, w = _into(b, v, w) if point.turned else (v, w)
        return Unilateral(f"z + ({arm[1]})*a - ({arm[0]})*b", (v, w), s)
    if point.line:
        pull = f"la{k}*({surface[0]}) + lb{k}*({surface[1]})" if surface else 0.0
        return Contact(f"la{k}*({v}) + lb{k}*({w})", s, pull)
    if point.turned:
        v, w = _into(b, v, w)
        surface = _into(b, *surface) if surface else surface
    kinetic = {
        "same": None,
        "drop": f"d{k}*({s})",
        "stribeck": f"({s})*(d{k} + (1 - d{k})*exp(-speed/vs{k}))",
    }[point.law]
    axes: Any = (f"ex{k}", f"ey{k}") if point.ellipse else (1.0, 1.0)
    if point.pressed:
        sliding = f"d{k}" if point.law == "drop" else None
        return Unilateral(f"down{k}", (v, w), 1.0, surface, axes=axes, kinetic=sliding)
    return Contact((v, w), s, surface, kinetic, axes=axes)


def _into(b: int, v: str, w: str) -> tuple[str, str]:
    """A vector in the directions of a body."""
    c, s = f"cos(th{b})", f"sin(th{b})"
    return f"{c}*({v}) + {s}*({w})", f"{c}*({w}) - {s}*({v})"


def by_hand(shape: Shape, n: Numbers) -> Board:
    """The system as the reference gets it."""
    spots, lines = [], []
    for k, point in enumerate(shape.points):
        get: Callable[..., float] = lambda w, default=0.0, k=k: n.get(f"{w}{k}", default)  # noqa: E731
        common = (point.body, point.on, complex(get("px"), get("py")))
        holds = (get("s"), get("r"), get("al"))
        if point.line:
            lines.append(Line(*common, *holds, complex(get("la"), get("lb"))))
            continue
        axes = (get("ex", 1.0), get("ey", 1.0))
        drop = get("d", 1.0)
        spots.append(Spot(*common, *holds, axes, point.turned, drop, get("vs", 0.0)))
    size = 3 * shape.bodies
    rows = {
        w: np.array([n[f"{w}{i}"] for i in range(size)]) for w in ("G", "F", "om", "ph", "K", "C")
    }
    b = range(shape.bodies)
    return Board(
        np.array([n[f"m{i}"] for i in b]),
        np.array([n[f"I{i}"] for i in b]),
        np.array([complex(n.get(f"cx{i}", 0.0), n.get(f"cy{i}", 0.0)) for i in b]),
        rows,
        tuple(spots),
        tuple(lines),
        {w: n[w] for w in TABLE} if shape.table else {},
        *((n["m0"] * n["g0"], n["h0"]) if shape.feet else ()),
    )


# -- numbers ---------------------------------------------------------------------------------------


def numbers(rng: Rng, shape: Shape) -> Numbers:
    """Numbers with which bodies stick and slip many times."""
    n: Numbers = {}
    for b in range(shape.bodies):
        n |= {f"m{b}": rng.uniform(0.5, 2.0), f"I{b}": rng.uniform(0.1, 0.6)}
        if shape.off:
            n |= {f"cx{b}": rng.uniform(-0.4, 0.4), f"cy{b}": rng.uniform(-0.4, 0.4)}
    count = len(shape.points) / shape.bodies
    which = rng.integers(3)  # loads on translation, on rotation, on both
    for i in range(3 * shape.bodies):
        turns = i % 3 == 2
        loaded = float(which == 2 or turns == (which == 1))
        size = loaded * (0.5 if turns else 1.0)
        n |= {
            f"F{i}": size * rng.uniform(0.3, 1.6),
            f"G{i}": size * rng.choice([0.0, 0.3]) * rng.normal(),
            f"om{i}": rng.uniform(0.8, 3.0),
            f"ph{i}": rng.uniform(0.0, 6.0),
            f"K{i}": rng.choice([0.0, 1.0]) * rng.uniform(0.2, 1.5),
            f"C{i}": rng.choice([0.0, 0.0, 0.2]) * rng.uniform(0.5, 1.0),
        }
    for k, point in enumerate(shape.points):
        s = rng.uniform(0.3, 1.2) / np.sqrt(count)
        angle = rng.uniform(0.0, 6.0)
        draws = {
            "px": rng.uniform(-1.0, 1.0), "py": rng.uniform(-1.0, 1.0),
            "s": s, "d": rng.uniform(0.4, 0.95), "vs": rng.uniform(0.2, 1.0),
            "r": s * rng.uniform(-0.6, 0.6), "al": rng.uniform(0.3, 2.0),
            "ex": rng.uniform(0.5, 1.2), "ey": rng.uniform(0.5, 1.2),
            "la": np.cos(angle), "lb": np.sin(angle),
        }  # fmt: skip
        n |= {w: draws[w[: -len(str(k))]] for w in of_point(point, k)}
    if shape.table:
        n |= {w: 0.3 * rng.normal() for w in ("wx", "wy")}
        n |= {w: rng.choice([0.0, 0.4]) * rng.normal() for w in ("ax", "ay", "Oa")}
        n |= {"wo": rng.uniform(0.5, 2.0), "Om": rng.choice([0.0, 0.4]) * rng.normal()}
        n |= {"X": rng.normal(), "Y": rng.normal()}
    return {w: float(v) for w, v in n.items()}


def made(rng: Rng, shape: Shape, **given: float) -> Carried:
    """A case with ordinary numbers: thrown, or from rest."""
    n = numbers(rng, shape) | {w: float(v) for w, v in given.items()}
    moving = rng.choice([0.0, 1.0])
    start = {x: float(rng.choice([0.0, 0.4]) * rng.normal()) for x in shape.names}
    start |= {f"d_{x}": float(moving * rng.normal()) for x in shape.names}
    return Carried(shape, n, start, float(rng.uniform(2.0, 6.0)))


def several(rng: Rng, least: int = 1, most: int = 6, **words: Any) -> tuple[Point, ...]:
    """Points of one kind."""
    return (Point(**words),) * int(rng.integers(least, most + 1))


# -- families --------------------------------------------------------------------------------------


@family
def thrown_body(rng: Rng) -> Carried:
    """Without loads that vary: it comes to rest, or to a steady slip."""
    case = made(rng, Shape(several(rng)))
    n = {w: 0.0 if w[0] in "FK" else v for w, v in case.numbers.items()}
    start = {**case.start, **{f"d_{x}": float(rng.normal()) for x in case.shape.names}}
    return replace(case, numbers=n, start=start)


@family
def shaken_body(rng: Rng) -> Carried:
    """Loads on translation, on rotation, or on both."""
    return made(rng, Shape(several(rng)))


@family
def regular_body(rng: Rng) -> Carried:
    """Points on a circle about the centre of mass, all alike, in pure translation or rotation."""
    count = int(rng.integers(2, 7))
    case = made(rng, Shape((Point(),) * count))
    n = dict(case.numbers)
    for k in range(count):
        angle = 2.0 * np.pi * k / count
        n |= {f"px{k}": float(np.cos(angle)), f"py{k}": float(np.sin(angle)), f"s{k}": n["s0"]}
    turns = bool(rng.integers(2))
    for i in range(3):
        if turns != (i == 2):
            n |= {f"F{i}": 0.0, f"G{i}": 0.0}
    start = {x: v if x.endswith("th0") == turns else 0.0 for x, v in case.start.items()}
    return replace(case, numbers=n, start=start)


@family
def points_on_a_line(rng: Rng) -> Carried:
    """Where some points may coincide, and the centre of mass may be on the line."""
    case = made(rng, Shape(several(rng, 2)))
    n = dict(case.numbers)
    offset = rng.choice([0.0, 0.4])
    places = rng.choice([-1.0, -0.5, 0.0, 0.5, 1.0], len(case.shape.points))
    n |= {f"px{k}": float(x) for k, x in enumerate(places)}
    n |= {f"py{k}": float(offset) for k in range(len(places))}
    return replace(case, numbers=n)


@family
def points_that_hold_more_at_rest(rng: Rng) -> Carried:
    """Static friction above kinetic friction, of some points or of all."""
    laws = [str(pick(rng, ("drop", "drop", "same"))) for _ in range(rng.integers(1, 5))]
    return made(rng, Shape(tuple(Point(law=law) for law in laws)))


@family
def points_that_slip_more_easily_when_fast(rng: Rng) -> Carried:
    """Friction falls with the speed, from the threshold."""
    return made(rng, Shape(several(rng, 1, 5, law="stribeck")))


@family
def ellipses(rng: Rng) -> Carried:
    """Friction that is not the same in both directions, of space or of the body."""
    return made(rng, Shape(several(rng, 1, 5, ellipse=True, turned=bool(rng.integers(2)))))


@family
def body_on_a_table(rng: Rng) -> Carried:
    """A table that swings and turns as is given."""
    words = {"ellipse": bool(rng.integers(2)), "turned": bool(rng.integers(2))}
    return made(rng, Shape(several(rng, 1, 4, **words), table=True))


@family
def thresholds_in_time(rng: Rng) -> Carried:
    """What holds depends on time, for each point in its own way."""
    return made(rng, Shape(several(rng, 1, 5, swings=True), table=bool(rng.integers(2))))


@family
def off_centre(rng: Rng) -> Carried:
    """Coordinates of a point which is not the centre of mass: inertia moves."""
    return made(rng, Shape(several(rng, 1, 5), off=True))


@family
def turned_by_one_point(rng: Rng) -> Carried:
    """One point holds more than the others together: the body turns about it."""
    count = int(rng.integers(2, 6))
    case = made(rng, Shape((Point(),) * count))
    n = dict(case.numbers) | {f"s{k}": case.numbers[f"s{k}"] / 3.0 for k in range(1, count)}
    return replace(case, numbers=n | {"s0": float(rng.uniform(1.0, 2.5))})


@family
def points_and_lines(rng: Rng) -> Carried:
    """Points with friction in a plane, and others along a line."""
    points = several(rng, 1, 4) + several(rng, 1, 2, line=True)
    return made(rng, Shape(points))


@family
def body_on_a_body(rng: Rng) -> Carried:
    """A body with points on another one, which has points on the ground."""
    upper, lower = several(rng, 1, 3, body=1, on=0), several(rng, 1, 3)
    return made(rng, Shape(lower + upper, bodies=2))


@family
def pressed_points(rng: Rng) -> Carried:
    """What holds is a normal force."""
    law = str(pick(rng, ("same", "same", "drop")))
    return made(rng, Shape(several(rng, 1, 3, law=law, pressed=True)))


@family
def on_three_legs(rng: Rng) -> Carried:
    """Friction below the centre of mass moves the weight from foot to foot, and is a part of it; so
    low that no foot leaves the table."""
    case = made(rng, Shape((Point(foot=True, turned=bool(rng.integers(2))),) * 3))
    n = dict(case.numbers)
    angles = rng.uniform(0.0, 2.0 * np.pi) + 2.0 * np.pi / 3.0 * (
        np.arange(3.0) + rng.uniform(-0.2, 0.2, 3)
    )
    feet = rng.uniform(0.4, 1.2, 3) * np.exp(1j * angles)
    edges = np.roll(feet, -1) - feet
    margin = float(np.min(np.imag(np.conj(feet) * edges) / np.abs(edges)))
    n |= {f"px{k}": float(z.real) for k, z in enumerate(feet)}
    n |= {f"py{k}": float(z.imag) for k, z in enumerate(feet)}
    n |= {"A0": float(rng.uniform(0.1, 0.6)), "g0": float(rng.uniform(0.5, 2.0))}
    rubs = rng.uniform(0.2, 0.8, 3) if rng.integers(2) else np.full(3, rng.uniform(0.2, 0.8))
    n |= {f"s{k}": float(mu) for k, mu in enumerate(rubs)}
    n["h0"] = float(rng.uniform(0.2, 0.95) * margin / np.max(rubs))
    case = replace(case, numbers=n)
    if rng.integers(4) == 0:
        powers = [float(10.0 ** rng.integers(-4, 5)) for _ in range(3)]
        case = replace(case, length=powers[0], time=powers[1], force=powers[2])
    return case


@family
def slow_loads(rng: Rng) -> Carried:
    """Loads that grow from nothing past what is held, and fall again."""
    case = made(rng, Shape(several(rng)))
    n = dict(case.numbers)
    for i in range(3):
        n |= {f"om{i}": 0.7, f"ph{i}": float(np.pi / 2), f"G{i}": 0.0, f"K{i}": 0.0}
        n[f"F{i}"] *= 2.0
    return replace(case, numbers=n, start={}, duration=6.0)


@family
def rod_pushed_across(rng: Rng) -> Carried:
    """Points alike on a line about the centre of mass, and a load across it that grows: all leave
    rest at once, and many mechanisms could begin."""
    count = int(rng.integers(2, 7))
    case = made(rng, Shape((Point(),) * count))
    n = {w: 0.0 if w[0] in "FGKC" else v for w, v in case.numbers.items()}
    for k in range(count):
        n |= {f"px{k}": 2.0 * k / (count - 1) - 1.0, f"py{k}": 0.0, f"s{k}": n["s0"]}
    n |= {"F1": 2.0 * count * n["s0"], "om1": 0.7, "ph1": float(np.pi / 2)}
    return replace(case, numbers=n, start={})


@family
def units(rng: Rng) -> Carried:
    """In units in which numbers are small or large."""
    law = str(pick(rng, ("same", "same", "drop")))
    case = made(rng, Shape(several(rng, 1, 4, law=law)))
    powers = [float(10.0 ** rng.integers(-6, 7)) for _ in range(3)]
    return replace(case, length=powers[0], time=powers[1], force=powers[2])
