"""Families of systems whose matrices are parameters: each is compiled once and stands for all
systems of its shape."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip import Contact, Inertial, Parameter, RateIndependent, System, Viscous

Array = NDArray[np.float64]
KINDS = {"inertial": Inertial, "viscous": Viscous, "rate-independent": RateIndependent}


@cache
def linear_family(kind: str, size: int, contacts: int) -> System:
    """Systems M x″ + C x′ + K x = f + Jᵀλ of one kind with given numbers of coordinates and
    contacts.

    fᵢ = Fᵢ cos(ωᵢ t + φᵢ), thresholds sᵢ + rᵢ cos(αᵢ t), surface speeds bᵢ sin(βᵢ t). Without
    inertia M is absent; if rate-independent, C, J and b are, too.
    """
    names = range(size)
    parameters: dict[str, Parameter] = {}

    def number(name: str, default: float) -> str:
        parameters[name] = Parameter(default)
        return name

    def quadratic(letter: str, rate: str) -> str:
        entries = [(i, j) for i in names for j in range(i, size)]
        return " + ".join(
            f"{number(f'{letter}{i}_{j}', float(i == j))}*{rate}x{i}*{rate}x{j}"
            + ("/2" if i == j else "")
            for i, j in entries
        )

    loads = [
        f"{number(f'F{i}', 0)}*cos({number(f'omega{i}', 1)}*t + {number(f'phi{i}', 0)})*x{i}"
        for i in names
    ]
    dry = {}
    for k in range(contacts):
        direction = f"d_x{k}"
        belt = "0"
        if kind != "rate-independent":
            direction = " + ".join(
                f"{number(f'J{k}_{i}', float(i == k % size))}*d_x{i}" for i in names
            )
            belt = f"{number(f'b{k}', 0)}*sin({number(f'beta{k}', 1)}*t)"
        threshold = f"{number(f's{k}', 1)} + {number(f'r{k}', 0)}*cos({number(f'alpha{k}', 1)}*t)"
        dry[f"contact {k}"] = Contact(direction, threshold, belt)
    return System(
        name=f"{kind}, {size} coordinates, {contacts} contacts",
        parameters=parameters,
        coordinates={f"x{i}": KINDS[kind]() for i in names},
        kinetic=quadratic("M", "d_") if kind == "inertial" else 0.0,
        viscous=quadratic("C", "d_") if kind != "rate-independent" else 0.0,
        potential=" - ".join([quadratic("K", ""), *loads]),
        contacts=dry,
    )


@dataclass(frozen=True)
class Drawn:
    """One member of a family: its matrices, its loads, and where it starts."""

    M: Array
    C: Array
    K: Array
    J: Array
    F: Array
    omega: Array
    phi: Array
    s: Array
    r: Array
    alpha: Array
    b: Array
    beta: Array
    x: Array
    v: Array

    def parameters(self, system: System) -> dict[str, float]:
        """Values of all parameters of the family."""
        values = {}
        for letter in ("M", "C", "K", "J"):
            matrix = getattr(self, letter)
            values |= {
                f"{letter}{i}_{j}": float(matrix[i, j]) for i, j in np.ndindex(*matrix.shape)
            }
        for name in ("F", "omega", "phi", "s", "r", "alpha", "b", "beta"):
            values |= {f"{name}{i}": float(value) for i, value in enumerate(getattr(self, name))}
        return {name: values[name] for name in system.parameters}

    def initial(self, system: System) -> dict[str, float]:
        """Initial positions, and velocities if there are any."""
        values = {f"x{i}": float(x) for i, x in enumerate(self.x)}
        if system.declaration.inertial:
            values |= {f"d_x{i}": float(v) for i, v in enumerate(self.v)}
        return values

    def load(self, t: ArrayLike) -> Array:
        """f at given times, one row each."""
        return self.F * np.cos(np.outer(np.asarray(t), self.omega) + self.phi)

    def threshold(self, t: ArrayLike) -> Array:
        """Thresholds at given times, one row each."""
        return self.s + self.r * np.cos(np.outer(np.asarray(t), self.alpha))

    def belt(self, t: ArrayLike) -> Array:
        """Surface speeds at given times, one row each."""
        return self.b * np.sin(np.outer(np.asarray(t), self.beta))


def draw(rng: np.random.Generator, size: int, contacts: int, **given: Array) -> Drawn:
    """A random system with eigenvalues of order one in which contacts stick and slip many times
    within t ≤ 20.

    Parameters
    ----------
    **given : ndarray
        Replaces what would be drawn.
    """

    def positive() -> Array:
        root = rng.normal(size=(size, size)) / np.sqrt(size)
        return root @ root.T + np.eye(size)

    def directions() -> Array:
        # Far from parallel: Gauss-Seidel iterations, which judge the result, are slow otherwise.
        while True:
            J = rng.normal(size=(contacts, size))
            if contacts > size or np.linalg.cond(J) < 5:
                return J

    s = rng.uniform(0.4, 0.8, contacts)
    drawn: Mapping[str, Array] = {
        "M": positive(),
        "C": 0.2 * positive(),
        "K": positive(),
        "J": directions(),
        "F": rng.uniform(1, 3, size),
        "omega": rng.uniform(0.6, 2, size),
        "phi": rng.uniform(0, 6, size),
        "s": s,
        "r": s * rng.choice([0.0, 0.5, 0.8], contacts),
        "alpha": rng.uniform(0.3, 2, contacts),
        "b": rng.choice([0.0, 0.0, 0.3], contacts),
        "beta": rng.uniform(0.3, 1, contacts),
        "x": 0.5 * rng.normal(size=size),
        "v": rng.choice([0.0, 1.0]) * rng.normal(size=size),
    }
    return Drawn(**{**drawn, **given})
