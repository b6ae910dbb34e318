"""Structures that the tests share, and the same as formulas."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import stickslip as ss

Matrix = Any


def chain(n: int) -> tuple[Matrix, Matrix]:
    """Mass and stiffness of n unequal masses between springs, held at the left end."""
    stiffness = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    stiffness[-1, -1] = 1.0
    return np.diag(1.0 + 0.1 * np.arange(n)), stiffness


def beam(
    elements: int, length: float = 2.0, bending: float = 2.3125e6, density: float = 117.45
) -> tuple[Matrix, Matrix]:
    """Mass and stiffness of a free beam of Euler and Bernoulli's elements: deflection and rotation
    of each node. By default that of Krack and Gross, Harmonic Balance for Nonlinear Vibration
    Problems (2019), example 8 of NLvib."""
    h = length / elements
    stiff = [
        [12, 6 * h, -12, 6 * h],
        [6 * h, 4 * h**2, -6 * h, 2 * h**2],
        [-12, -6 * h, 12, -6 * h],
        [6 * h, 2 * h**2, -6 * h, 4 * h**2],
    ]
    heavy = [
        [156, 22 * h, 54, -13 * h],
        [22 * h, 4 * h**2, 13 * h, -3 * h**2],
        [54, 13 * h, 156, -22 * h],
        [-13 * h, -3 * h**2, -22 * h, 4 * h**2],
    ]
    n = 2 * (elements + 1)
    mass, stiffness = np.zeros((n, n)), np.zeros((n, n))
    for e in range(elements):
        part = slice(2 * e, 2 * e + 4)
        stiffness[part, part] += bending / h**3 * np.array(stiff)
        mass[part, part] += density * h / 420.0 * np.array(heavy)
    return mass, stiffness


def clamped(elements: int, **given: float) -> tuple[Matrix, Matrix]:
    """The same beam, clamped at its left end."""
    mass, stiffness = beam(elements, **given)
    return mass[2:, 2:], stiffness[2:, 2:]


def random_body(rng: np.random.Generator, n: int) -> tuple[Matrix, Matrix, Matrix]:
    """Full matrices of mass, stiffness and damping."""
    roots = [rng.normal(size=(n, n)) / np.sqrt(n) for _ in range(3)]
    mass, stiffness, damping = (root @ root.T for root in roots)
    return mass + np.eye(n), 4.0 * stiffness + np.eye(n), 0.2 * damping


def form(matrix: Matrix, names: Sequence[str]) -> str:
    """Half of a quadratic form, as a formula."""
    n = len(names)
    return " + ".join(
        f"{float(matrix[i, j]) / 2.0!r}*{names[i]}*{names[j]}"
        for i in range(n)
        for j in range(n)
        if matrix[i, j]
    )


def typed(
    mass: Matrix, stiffness: Matrix, damping: Matrix, forces: dict[int, str], **parts: Any
) -> ss.System:
    """A structure as formulas, its unknowns called q0, q1, ..."""
    n = len(mass)
    places, rates = [f"q{i}" for i in range(n)], [f"d_q{i}" for i in range(n)]
    return ss.System(
        "typed",
        coordinates={x: ss.Inertial(force=forces.get(i, 0.0)) for i, x in enumerate(places)},
        kinetic=form(mass, rates),
        viscous=form(damping, rates),
        potential=" + ".join([form(stiffness, places), parts.pop("potential", "0")]),
        **parts,
    )
