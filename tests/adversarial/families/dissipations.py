"""One contact in a plane, or one face, whose dissipation is a formula, on a few coordinates."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from stickslip import Contact, Inertial, Parameter, System

from ..case import Families, Rng, Scaled, pick
from ..references.directed import RULES, Directed

Numbers = dict[str, float]
FAMILIES: Families[Any] = Families()
family = FAMILIES.add
_SURE = 0.97  # of the largest linear part of a dissipation


@dataclass(frozen=True)
class Shape:
    """The words of a system.

    Attributes
    ----------
    rule : str
        Of the dissipation, one of RULES.
    shifted : bool
        Whether a linear part is added to it: it is not even.
    size : int
        Number of coordinates.
    law : str
        "same": k = s; "drop": a part of s; "stribeck": from s down to a part of it with R(u).
    varies : str
        What the threshold depends on: "", "time" or "place".
    turned : bool
        Whether directions turn with the last coordinate, which is an angle.
    moves : bool
        Whether the surface moves.
    line : bool
        Whether there is a contact along a line beside it.
    """

    rule: str
    shifted: bool = False
    size: int = 2
    law: str = "same"
    varies: str = ""
    turned: bool = False
    moves: bool = False
    line: bool = False

    @property
    def count(self) -> int:
        """Number of directions."""
        return RULES[self.rule].count

    @property
    def names(self) -> tuple[str, ...]:
        """Coordinates."""
        return tuple(f"q{i}" for i in range(self.size))


@dataclass(frozen=True)
class Rubbed(Scaled):
    """One random motion of a face or a contact in a plane. In natural units the radius of a face is
    1: its last coordinate is a length there.

    Attributes
    ----------
    radius : float
        Of a face, in natural units.
    """

    shape: Shape
    radius: float = 1.0

    @property
    def system(self) -> System:
        """What the library gets."""
        return declared(self.shape)

    @property
    def parameters(self) -> dict[str, float]:
        """What the library gets."""
        radius = {"a": self.radius * self.length} if self.shape.count == 3 else {}
        return super().parameters | radius

    def unit(self, name: str) -> float:
        """The library's number of one natural unit, of a coordinate or a rate."""
        rate = name.startswith("d_")
        return self._along(int(name[-1])) / (self.time if rate else 1.0)

    def _along(self, i: int) -> float:
        """Of a coordinate: the last one may be an angle."""
        if i == 2 and self.shape.count == 3:
            return 1.0 / self.radius
        return 1.0 if i == 2 and self.shape.turned else self.length

    def component(self, i: int) -> float:
        """Of a component of the relative velocity, times a time."""
        return 1.0 / self.radius if i == 2 else self.length

    def unit_of_number(self, name: str) -> float:
        l, t, f = self.length, self.time, self.force  # noqa: E741
        letter, *where = name.split("_")
        i, j = (int(x) for x in (*where, "0", "0")[:2])
        work = f * l
        pair = self._along(i) * self._along(j)
        units = {
            "M": work * t**2 / pair,
            "K": work / pair,
            "C": work * t / pair,
            "G": work / self._along(i),
            "F": work / self._along(i),
            "om": 1.0 / t,
            "s": f,
            "sl": f,
            "r": f,
            "al": 1.0 / t if self.shape.varies == "time" else 1.0 / self._along(0),
            "vs": l / t,
            "A": self.component(i) / self._along(j),
            "B": l / self._along(i),
            "W": self.component(i) / t,
            "V": self.component(i) / t,
            "wo": 1.0 / t,
        }
        return units.get(letter, 1.0)

    def board(self) -> Directed:
        """The system as the reference gets it."""
        return Directed(
            RULES[self.shape.rule],
            self.numbers,
            self.shape.size,
            self.shape.law,
            self.shape.varies,
            1.0 / self.radius if self.shape.turned and self.shape.count == 3 else 1.0,
            self.shape.turned,
        )


# -- declared --------------------------------------------------------------------------------------


def used(shape: Shape) -> list[str]:
    """Names of all numbers."""
    n, d = shape.size, shape.count
    found = [f"{w}_{i}_{j}" for w in "MKC" for i in range(n) for j in range(i, n)]
    found += [f"{w}_{i}" for i in range(n) for w in ("G", "F", "om", "ph")]
    found += [f"A_{i}_{j}" for i in range(d) for j in range(n)]
    found += ["s", *RULES[shape.rule].numbers]
    found += [f"b_{i}" for i in range(d)] if shape.shifted else []
    found += {"same": [], "drop": ["d"], "stribeck": ["d", "vs"]}[shape.law]
    found += ["r", "al"] if shape.varies else []
    found += [f"{w}_{i}" for i in range(d) for w in "WV"] + ["wo"] if shape.moves else []
    found += [*(f"B_{i}" for i in range(n)), "sl"] if shape.line else []
    return found


def _form(letter: str, names: list[str]) -> str:
    """Half a quadratic form."""
    n = len(names)
    terms = [f"{letter}_{i}_{i}/2*{names[i]}**2" for i in range(n)]
    terms += [f"{letter}_{i}_{j}*{names[i]}*{names[j]}" for i in range(n) for j in range(i + 1, n)]
    return " + ".join(terms)


@cache
def declared(shape: Shape) -> System:
    """The system, with parameters for all numbers."""
    n, d = shape.size, shape.count
    rates = [f"d_{x}" for x in shape.names]
    names = used(shape) + (["a"] if d == 3 else [])
    ones = {"s", "sl", "vs", "d", "a", "wo", *RULES[shape.rule].numbers}
    ones = (ones | {f"M_{i}_{i}" for i in range(n)}) - {"e12", "h"}
    along = [" + ".join(f"A_{i}_{j}*{rates[j]}" for j in range(n)) for i in range(d)]
    if shape.turned:
        angle = shape.names[-1]
        v, w = along[:2]
        along[0] = f"cos({angle})*({v}) + sin({angle})*({w})"
        along[1] = f"cos({angle})*({w}) - sin({angle})*({v})"
    s = {"": "s", "time": "s + r*cos(al*t)", "place": "s + r*cos(al*q0)"}[shape.varies]
    kinetic = {
        "same": None,
        "drop": f"d*({s})",
        "stribeck": f"({s})*(d + (1 - d)*exp(-speed/vs))",
    }[shape.law]
    formula = RULES[shape.rule].text.replace("v3", "(a*v3)")
    if shape.shifted:
        formula += " + b_0*v1 + b_1*v2" + (" + b_2*a*v3" if d == 3 else "")
    surface: Any = tuple(f"W_{i} + V_{i}*sin(wo*t)" for i in range(d)) if shape.moves else 0.0
    rub = Contact(tuple(along), s, surface, kinetic, dissipation=formula)
    if shape.rule == "ellipsoid" and not shape.shifted:
        rub = Contact(tuple(along), s, surface, kinetic, axes=("e1", "e2", "e3*a"))
    contacts = {"rub": rub}
    if shape.line:
        contacts["line"] = Contact(" + ".join(f"B_{i}*{rates[i]}" for i in range(n)), "sl")
    return System(
        name="rubbed",
        parameters={x: Parameter(1.0 if x in ones else 0.0) for x in names},
        coordinates={
            x: Inertial(force=f"G_{i} + F_{i}*cos(om_{i}*t + ph_{i})")
            for i, x in enumerate(shape.names)
        },
        kinetic=_form("M", rates),
        potential=_form("K", [*shape.names]),
        viscous=_form("C", rates),
        contacts=contacts,
    )


# -- numbers ---------------------------------------------------------------------------------------


def positive(rng: Rng, n: int, low: float, high: float) -> np.ndarray:
    """A random positive definite matrix."""
    turn = np.linalg.qr(rng.normal(size=(n, n)))[0]
    return turn @ np.diag(rng.uniform(low, high, n)) @ turn.T


def numbers(rng: Rng, shape: Shape) -> Numbers:
    """Numbers with which it sticks and slips many times."""
    n, d = shape.size, shape.count
    K = rng.choice([0.0, 1.0, 1.0]) * positive(rng, n, 0.2, 2.0)
    C = rng.choice([0.0, 0.0, 0.3]) * positive(rng, n, 0.1, 1.0)
    M = positive(rng, n, 0.5, 2.0)
    s = rng.uniform(0.3, 1.0)
    found: Numbers = {}
    for w, matrix in (("M", M), ("K", K), ("C", C)):
        found |= {f"{w}_{i}_{j}": matrix[i, j] for i in range(n) for j in range(i, n)}
    for i in range(n):
        found |= {f"F_{i}": rng.choice([0.0, 1.0, 1.0]) * rng.uniform(0.3, 1.6)}
        found |= {f"G_{i}": rng.choice([0.0, 0.3]) * rng.normal()}
        found |= {f"om_{i}": rng.uniform(0.7, 3.0), f"ph_{i}": rng.uniform(0.0, 6.0)}
    A = np.eye(d, n)
    if rng.integers(2):
        A = A + 0.4 * rng.normal(size=(d, n))
    found |= {f"A_{i}_{j}": A[i, j] for i in range(d) for j in range(n)}
    found |= {"s": s, "d": rng.uniform(0.4, 0.95), "vs": rng.uniform(0.2, 1.0)}
    found |= {"r": s * rng.uniform(-0.6, 0.6), "al": rng.uniform(0.3, 2.0)}
    found |= RULES[shape.rule].draw(rng)
    if shape.shifted:
        found |= shift(rng, shape, found, rng.uniform(0.0, 0.7))
    for i in range(d):
        found |= {f"W_{i}": rng.choice([0.0, 0.4]) * rng.normal()}
        found |= {f"V_{i}": rng.choice([0.0, 0.4]) * rng.normal()}
    found |= {"wo": rng.uniform(0.5, 2.0), "sl": rng.uniform(0.1, 0.5)}
    found |= {f"B_{i}": rng.normal() for i in range(n)}
    return {w: float(found[w]) for w in used(shape)}


def shift(rng: Rng, shape: Shape, found: Numbers, part: float) -> Numbers:
    """A linear part of the dissipation: this part of the largest that leaves it positive."""
    way = rng.normal(size=shape.count)
    v = rng.normal(size=(20000, shape.count))
    rule = RULES[shape.rule]
    most = min(rule.value(found, u) / max(-float(way @ u), 1e-12) for u in v)
    return {f"b_{i}": _SURE * part * most * x for i, x in enumerate(way)}


def made(rng: Rng, shape: Shape, **given: float) -> Rubbed:
    """A case with ordinary numbers: thrown, or from rest."""
    n = numbers(rng, shape) | {w: float(v) for w, v in given.items()}
    moving = rng.choice([0.0, 1.0])
    start = {x: float(rng.choice([0.0, 0.4]) * rng.normal()) for x in shape.names}
    start |= {f"d_{x}": float(moving * rng.normal()) for x in shape.names}
    return Rubbed(shape, n, start, float(rng.uniform(2.0, 8.0)))


IN_PLANE = ("ellipse", "quartic", "sum", "pieces")
FACES = ("disc", "ring", "ellipsoid", "disc and norm", "quartic face", "pieces face")


def any_rule(rng: Rng, **words: Any) -> Shape:
    """One of all dissipations, in a plane or of a face."""
    rule = str(pick(rng, (*IN_PLANE, "disc", "ring", "ellipsoid")))
    if RULES[rule].count == 3:
        words |= {"size": 3}
    given: dict[str, Any] = {"shifted": rule == "ellipse" or not rng.integers(3)}
    return Shape(rule, **(given | words))


# -- families --------------------------------------------------------------------------------------


@family
def shifted_ellipses(rng: Rng) -> Rubbed:
    """A norm and a linear part."""
    return made(rng, Shape("ellipse", True, size=int(rng.integers(2, 4))))


@family
def quartics(rng: Rng) -> Rubbed:
    """The fourth root of a quartic, which may have no curvature along its axes."""
    return made(rng, Shape("quartic", bool(rng.integers(2)), size=int(rng.integers(2, 4))))


@family
def sums_of_norms(rng: Rng) -> Rubbed:
    """One of them may be flat."""
    return made(rng, Shape("sum", bool(rng.integers(2)), size=int(rng.integers(2, 4))))


@family
def forward_and_backward(rng: Rng) -> Rubbed:
    """Pieces: it rubs otherwise backward than forward, and to the side."""
    return made(rng, Shape("pieces", bool(rng.integers(2)), size=int(rng.integers(2, 4))))


@family
def nearly_one_sided(rng: Rng) -> Rubbed:
    """Along some way it hardly rubs."""
    rule = str(pick(rng, ("ellipse", "ellipse", "disc", "ellipsoid")))
    shape = Shape(rule, True, size=3 if rule != "ellipse" else int(rng.integers(2, 4)))
    case = made(rng, shape)
    part = float(rng.uniform(0.95, 1.03))
    return replace(case, numbers=case.numbers | shift(rng, shape, case.numbers, part))


@family
def very_flat(rng: Rng) -> Rubbed:
    """It holds up to 50 times more to the side."""
    rule = str(pick(rng, ("ellipse", "pieces", "ellipsoid", "quartic")))
    case = made(rng, Shape(rule, size=3 if rule == "ellipsoid" else 2))
    flat = float(rng.choice([0.02, 0.05, 0.1]))
    n = dict(case.numbers)
    n |= {"e2": flat * n["e1"]} | ({"e12": 0.0} if "e12" in n else {})
    return replace(case, numbers=n)


@family
def discs(rng: Rng) -> Rubbed:
    """That slide and spin."""
    return made(rng, Shape("disc", size=3))


@family
def rings(rng: Rng) -> Rubbed:
    """That slide and spin."""
    return made(rng, Shape("ring", size=3))


@family
def ellipsoids(rng: Rng) -> Rubbed:
    """By their axes."""
    return made(rng, Shape("ellipsoid", size=3))


@family
def other_faces(rng: Rng) -> Rubbed:
    """A disc and a norm, a quartic, pieces; and linear parts of all faces."""
    rule = str(pick(rng, FACES))
    return made(rng, Shape(rule, rule in FACES[:3], size=3))


@family
def coins(rng: Rng) -> Rubbed:
    """A disc or a ring thrown onto a table, with inertia of its own."""
    case = made(rng, Shape(str(pick(rng, ("disc", "ring"))), size=3))
    n = {w: 0.0 if w[0] in "KCFG" else v for w, v in case.numbers.items()}
    n |= {f"M_{i}_{j}": 0.0 for i in range(3) for j in range(i, 3)}
    n |= {f"A_{i}_{j}": float(i == j) for i in range(3) for j in range(3)}
    n |= {"M_0_0": 1.0, "M_1_1": 1.0, "M_2_2": float(rng.uniform(0.2, 1.5))}
    way = rng.normal(size=3) * [1.0, 1.0, 10.0 ** rng.uniform(-1.5, 1.5)]
    start = {f"d_q{i}": float(v) for i, v in enumerate(way / np.linalg.norm(way))}
    return replace(case, numbers=n, start=start)


@family
def small_faces(rng: Rng) -> Rubbed:
    """With a radius of a hundredth."""
    rule = str(pick(rng, ("disc", "ring", "ellipsoid")))
    case = made(rng, Shape(rule, bool(rng.integers(2)), size=3))
    return replace(case, radius=float(rng.choice([0.01, 0.03])))


@family
def moving_surfaces(rng: Rng) -> Rubbed:
    """A belt, or one that swings."""
    return made(rng, any_rule(rng, moves=True))


@family
def thresholds_in_time(rng: Rng) -> Rubbed:
    """What it holds swings."""
    return made(rng, any_rule(rng, varies="time"))


@family
def thresholds_of_place(rng: Rng) -> Rubbed:
    """What it holds depends on where it is."""
    return made(rng, any_rule(rng, varies="place"))


@family
def holds_more_at_rest(rng: Rng) -> Rubbed:
    """Static friction above kinetic friction."""
    return made(rng, any_rule(rng, law="drop", varies=str(pick(rng, ("", "", "time")))))


@family
def slips_more_easily_when_fast(rng: Rng) -> Rubbed:
    """Friction falls with R(u)."""
    return made(rng, any_rule(rng, law="stribeck", moves=bool(rng.integers(2))))


@family
def turned_by_an_angle(rng: Rng) -> Rubbed:
    """Directions of a body that turns."""
    rule = str(pick(rng, (*IN_PLANE, "pieces face", "ellipsoid")))
    shape = Shape(rule, rule == "ellipse", size=3, turned=True)
    case = made(rng, shape)
    return replace(case, radius=float(rng.uniform(0.5, 2.0)) if shape.count == 3 else 1.0)


@family
def beside_a_line(rng: Rng) -> Rubbed:
    """A contact along a line rubs the same coordinates."""
    return made(rng, any_rule(rng, size=int(rng.integers(2, 4)), line=True))


@family
def slow_loads(rng: Rng) -> Rubbed:
    """Loads that grow from nothing past what is held, and fall again."""
    case = made(rng, any_rule(rng))
    n = dict(case.numbers)
    for i in range(case.shape.size):
        n |= {f"om_{i}": 0.7, f"ph_{i}": float(np.pi / 2), f"G_{i}": 0.0, f"F_{i}": 2 * n[f"F_{i}"]}
    n = {w: 0.0 if w[0] == "K" else v for w, v in n.items()}
    return replace(case, numbers=n, start={}, duration=6.0)


@family
def loads_along_an_axis(rng: Rng) -> Rubbed:
    """All forces and velocities along one axis: where some formulas have their pieces, or no
    curvature."""
    shape = any_rule(rng, shifted=False)
    case = made(rng, shape)
    axis = int(rng.integers(shape.count))
    n = {w: 0.0 if w[0] in "GF" and w[-1] != str(axis) else v for w, v in case.numbers.items()}
    for w in "MKCA":
        n |= {x: 0.0 for x in n if x[0] == w and x[-1] != x[-3]}
    n |= {x: 1.0 for x in n if x[0] == "A" and x[-1] == x[-3]}
    start = {x: v for x, v in case.start.items() if x[-1] == str(axis)}
    return replace(case, numbers=n, start=start)


@family
def units(rng: Rng) -> Rubbed:
    """In units in which numbers are small or large."""
    case = made(rng, any_rule(rng, law=str(pick(rng, ("same", "same", "drop")))))
    powers = [float(10.0 ** rng.integers(-6, 7)) for _ in range(3)]
    return replace(case, length=powers[0], time=powers[1], force=powers[2])
