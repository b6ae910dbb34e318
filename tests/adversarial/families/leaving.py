"""Instants at which contacts are at rest or slip, more of them than there are freedoms: what
accelerates, and what stays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from stickslip import Contact, Inertial, Parameter, System

from ..case import Families, Rng, declaration
from ..references.mechanics import Array

Numbers = dict[str, float]


@dataclass(frozen=True)
class Shape:
    """Contacts with one or two directions each (`widths`), of one body in a plane, or of as many
    coordinates as is said."""

    widths: tuple[int, ...]
    size: int = 3
    body: bool = True


@dataclass(frozen=True)
class Instant:
    """A state, and what acts in it.

    Attributes
    ----------
    shape : Shape
    numbers : dict
    start : dict of str to float
    mass : array, shape (n, n)
    force : array, shape (n,)
        Without friction.
    rows : tuple of arrays, shape (d, n)
        Directions times axes, A J.
    turns : tuple of arrays, shape (d,)
        What relative velocities accelerate by without q″, A J̇ q̇.
    slides : tuple of arrays, shape (d,)
        A u.
    holds : array, shape (contacts,)
    """

    shape: Shape
    numbers: Numbers
    start: Mapping[str, float]
    mass: Array
    force: Array
    rows: tuple[Array, ...]
    turns: tuple[Array, ...]
    slides: tuple[Array, ...]
    holds: Array
    family: str = ""
    seed: int = 0

    @property
    def system(self) -> System:
        """What the library gets."""
        return declared(self.shape)

    def source(self) -> str:
        """A script that repeats the library's part."""
        return (
            f"system = {declaration(self.system)}\n"
            f"motion = ss.simulate(system, (0.0, 1e-3), initial={dict(self.start)}, "
            f"parameters={self.numbers})\n"
            "print({n: v for n, v in motion.at(0.0).items() if n.startswith('dd_')})"
        )


FAMILIES: Families[Any] = Families()
family = FAMILIES.add


def names(shape: Shape) -> tuple[str, ...]:
    """Coordinates."""
    return ("x", "y", "th") if shape.body else tuple(f"q{i}" for i in range(shape.size))


@cache
def declared(shape: Shape) -> System:
    """The system, with parameters for all numbers."""
    coordinates = names(shape)
    used = [f"F{i}" for i in range(shape.size)]
    if shape.body:
        used += ["m", "I"]
        kinetic = "m/2*(d_x**2 + d_y**2) + I/2*d_th**2"
    else:
        pairs = [(i, j) for i in range(shape.size) for j in range(i, shape.size)]
        used += [f"M{i}_{j}" for i, j in pairs]
        kinetic = " + ".join(f"M{i}_{j}*d_q{i}*d_q{j}" + ("/2" if i == j else "") for i, j in pairs)
    contacts = {}
    for k, width in enumerate(shape.widths):
        along, words = directions(shape, k, width)
        used += [*words, f"s{k}"]
        if width == 1:
            contacts[f"c{k}"] = Contact(along[0], f"s{k}")
        else:
            used += [f"ex{k}", f"ey{k}"]
            contacts[f"c{k}"] = Contact(along, f"s{k}", axes=(f"ex{k}", f"ey{k}"))
    positive = ("m", "I", "s", "e", "J", "la")
    ones = {n for n in used if n.startswith(positive) or n in {f"M{i}_{i}" for i in range(9)}}
    return System(
        name="instant",
        parameters={n: Parameter(1.0 if n in ones else 0.0) for n in used},
        coordinates={x: Inertial(force=f"F{i}") for i, x in enumerate(coordinates)},
        kinetic=kinetic,
        contacts=contacts,
    )


def directions(shape: Shape, k: int, width: int) -> tuple[Any, list[str]]:
    """Directions of a contact, and names of their numbers."""
    if not shape.body:
        words = [[f"J{k}_{i}_{j}" for j in range(shape.size)] for i in range(width)]
        rows = [" + ".join(f"{w}*d_q{j}" for j, w in enumerate(row)) for row in words]
        return tuple(rows), [w for row in words for w in row]
    v = f"d_x - d_th*(px{k}*sin(th) + py{k}*cos(th))"
    w = f"d_y + d_th*(px{k}*cos(th) - py{k}*sin(th))"
    if width == 2:
        return (v, w), [f"px{k}", f"py{k}"]
    return (f"la{k}*({v}) + lb{k}*({w})",), [f"px{k}", f"py{k}", f"la{k}", f"lb{k}"]


# -- bodies ----------------------------------------------------------------------------------------


def body(
    rng: Rng, places: Array, lines: int = 0, rest: str = "all", alike: bool = False
) -> Instant:
    """A body on points, of which the last may have friction along a line."""
    count = len(places)
    widths = (2,) * (count - lines) + (1,) * lines
    shape = Shape(widths)
    angle = float(rng.choice([0.0, rng.uniform(-3.0, 3.0)]))
    n: Numbers = {"m": rng.uniform(0.5, 2.0), "I": rng.uniform(0.1, 0.6)}
    holds = np.full(count, 0.6) if alike else rng.uniform(0.2, 1.0, count)
    turn = {"all": 0.0, "one": rng.normal(), "none": rng.normal()}[rest]
    c, s = np.cos(angle), np.sin(angle)
    arms = places @ np.array([[c, s], [-s, c]])
    move = np.array([turn * arms[0, 1], -turn * arms[0, 0]]) if rest == "one" else np.zeros(2)
    move = rng.normal(size=2) if rest == "none" else move
    v = np.array([*move, turn])
    rows, turns, slides = [], [], []
    for k, (width, (x, y)) in enumerate(zip(widths, arms, strict=True)):
        J = np.array([[1.0, 0.0, -y], [0.0, 1.0, x]])
        bend = -(turn**2) * np.array([x, y])
        n |= {f"px{k}": places[k, 0], f"py{k}": places[k, 1], f"s{k}": holds[k]}
        if width == 2:
            A = np.diag(rng.choice([1.0, rng.uniform(0.5, 1.2)], 2))
            n |= {f"ex{k}": A[0, 0], f"ey{k}": A[1, 1]}
        else:
            way = rng.uniform(0.0, 6.0)
            A = np.array([[np.cos(way), np.sin(way)]])
            n |= {f"la{k}": A[0, 0], f"lb{k}": A[0, 1]}
        rows.append(A @ J)
        turns.append(A @ bend)
        slides.append(A @ J @ v)
    mass = np.diag([n["m"], n["m"], n["I"]])
    return finished(rng, shape, n, {"th": angle}, v, mass, rows, turns, slides, holds)


def finished(
    rng: Rng, shape: Shape, n: Numbers, place: dict[str, float], v: Array, mass: Array,
    rows: list[Array], turns: list[Array], slides: list[Array], holds: Array,
) -> Instant:  # fmt: skip
    """With a load that is about what friction can hold."""
    size = len(mass)
    load = rng.normal(size=size) * rng.choice([0.0, 1.0, 1.0], size)
    load *= float(rng.uniform(0.2, 2.0)) * np.sum(holds) / max(float(np.linalg.norm(load)), 1.0)
    for slide in slides:  # what cannot be told from nothing is nothing
        slide[np.abs(slide) < 1e-12] = 0.0
    n |= {f"F{i}": f for i, f in enumerate(load)}
    start = place | {f"d_{x}": w for x, w in zip(names(shape), v, strict=True)}
    return Instant(
        shape,
        {w: float(f) for w, f in n.items()},
        {w: float(f) for w, f in start.items()},
        mass,
        load,
        tuple(rows),
        tuple(turns),
        tuple(slides),
        holds,
    )


def scattered(rng: Rng, least: int = 2) -> Array:
    """Points anywhere."""
    return rng.uniform(-1.0, 1.0, (rng.integers(least, 7), 2))


@family
def body_at_rest(rng: Rng) -> Instant:
    """All points rest."""
    return body(rng, scattered(rng))


@family
def regular_body_at_rest(rng: Rng) -> Instant:
    """Points alike on a circle."""
    angles = 2.0 * np.pi * np.arange(count := int(rng.integers(2, 7))) / count
    return body(rng, np.stack([np.cos(angles), np.sin(angles)], axis=1), alike=True)


@family
def rod_at_rest(rng: Rng) -> Instant:
    """Points on a line, some of which coincide."""
    places = np.zeros((int(rng.integers(2, 7)), 2))
    places[:, 0] = rng.choice([-1.0, -0.5, 0.0, 0.5, 1.0], len(places))
    places[:, 1] = rng.choice([0.0, 0.3])
    return body(rng, places)


@family
def body_about_a_point(rng: Rng) -> Instant:
    """It turns about one of its points, which may begin to slip."""
    return body(rng, scattered(rng), rest="one")


@family
def body_about_points(rng: Rng) -> Instant:
    """It turns about several of its points, which are at one place."""
    places = scattered(rng, 3)
    places[1 : int(rng.integers(2, len(places)))] = places[0]
    return body(rng, places, rest="one")


@family
def body_in_slip(rng: Rng) -> Instant:
    """No point rests."""
    return body(rng, scattered(rng), rest="none")


@family
def points_and_lines_at_rest(rng: Rng) -> Instant:
    """Some points have friction along a line only."""
    places = scattered(rng, 3)
    return body(rng, places, int(rng.integers(1, min(3, len(places)))))


# -- rows ------------------------------------------------------------------------------------------


def rowed(rng: Rng, whole: bool, planes: bool, rest: bool) -> Instant:
    """Any directions of a few coordinates, more than these."""
    size = int(rng.integers(1, 5)) + planes
    count = int(rng.integers(size // (1 + planes) + 1, size + 3))
    widths = tuple(int(w) for w in rng.integers(1, 2 + planes, count))
    shape = Shape(widths, size, body=False)
    root = rng.normal(size=(size, size))
    mass = 0.3 * root @ root.T + np.diag(rng.uniform(0.5, 1.5, size))
    n: Numbers = {f"M{i}_{j}": mass[i, j] for i in range(size) for j in range(i, size)}
    drawn = [
        (rng.integers(-2, 3, (w, size)).astype(float) if whole else rng.normal(size=(w, size)))
        for w in widths
    ]
    rank = int(rng.integers(1, size + 1))
    if not whole:
        base = rng.normal(size=(rank, size))
        drawn = [rng.normal(size=(w, rank)) @ base for w in widths]
    for J in drawn:
        if np.linalg.matrix_rank(J) < len(J):
            J += np.eye(len(J), size)
        if np.linalg.matrix_rank(J) < len(J):
            J[:] = np.eye(len(J), size)
    v = np.zeros(size) if rest else rng.integers(-1, 2, size).astype(float)
    holds = rng.uniform(0.2, 1.0, count)
    rows, slides = [], []
    for k, (width, J) in enumerate(zip(widths, drawn, strict=True)):
        n |= {f"J{k}_{i}_{j}": J[i, j] for i in range(width) for j in range(size)}
        n |= {f"s{k}": holds[k]}
        axes = rng.choice([1.0, rng.uniform(0.5, 1.2)], width) if width == 2 else np.ones(1)
        n |= {f"e{a}{k}": e for a, e in zip("xy", axes, strict=False)} if width == 2 else {}
        rows.append(axes[:, None] * J)
        slides.append(axes * (J @ v))
    turns = [np.zeros(w) for w in widths]
    return finished(rng, shape, n, {}, v, mass, rows, turns, slides, holds)


@family
def lines_at_rest(rng: Rng) -> Instant:
    """Friction along more lines than there are coordinates."""
    return rowed(rng, bool(rng.integers(2)), planes=False, rest=True)


@family
def lines_in_part(rng: Rng) -> Instant:
    """Some of them slip."""
    return rowed(rng, whole=True, planes=False, rest=False)


@family
def planes_at_rest(rng: Rng) -> Instant:
    """Friction in planes and along lines."""
    return rowed(rng, bool(rng.integers(2)), planes=True, rest=True)


@family
def planes_in_part(rng: Rng) -> Instant:
    """Some of them slip."""
    return rowed(rng, whole=True, planes=True, rest=False)
