"""Structures whose matrices are full, as reduced models of a finite-element program are: Taylor
series against those of M q̈ + D q̇ + K q = f + λ, computed with NumPy."""

from __future__ import annotations

import math

import numpy as np
import pytest

from oracles.tape import Interpreted
from stickslip import Contact, Inertial, RateIndependent, System, Viscous, simulate
from stickslip.arrays import Array
from stickslip.equations.codegen.generate import generate
from stickslip.equations.derive import derive
from stickslip.equations.native.looped import is_long
from stickslip.equations.native.systems import compile_system
from stickslip.motion.problem import pose
from stickslip.motion.steps.arrays import (
    CONTACTS,
    COORDINATES,
    FIRST_ROW,
    MEMBERS,
    Constants,
    Space,
    make_space,
)

ORDERS = 24
START = 0.3
SUBSETS = ("", "M", "K", "D", "MK", "MD", "KD", "MKD")
FRICTION = 0.5


def form(A: Array, x: list[str]) -> str:
    """xᵀ A x/2 as text."""
    n = len(x)
    return " + ".join(
        f"({float(A[i, j] / (1 + (i == j)))!r})*{x[i]}*{x[j]}"
        for i in range(n)
        for j in range(i, n)
        if A[i, j] != 0.0
    )


def matrices(n: int, full: str) -> dict[str, Array]:
    """Mass, stiffness and damping, of which some are full."""
    rng = np.random.default_rng(n)
    found = dict[str, Array]()
    for name in "MKD":
        root = rng.normal(size=(n, n))
        own = np.diag(rng.uniform(0.5, 2.0, n))
        found[name] = root @ root.T / n + own if name in full else own
    return found


def structure(n: int, full: str) -> System:
    q = [f"q{i}" for i in range(n)]
    v = [f"d_{x}" for x in q]
    A = matrices(n, full)
    return System(
        f"structure of {n}",
        coordinates={x: Inertial() for x in q},
        kinetic=form(A["M"], v),
        viscous=form(A["D"], v),
        potential=f"{form(A['K'], q)} - 5*cos(t)*q0",
        contacts={"rub": Contact(v[0], FRICTION)},
    )


def expected(n: int, full: str, q: Array, v: Array, sticks: bool) -> tuple[Array, Array]:
    """Taylor coefficients of positions and velocities, the first velocity positive or held."""
    A = matrices(n, full)
    inverse = np.linalg.inv(A["M"])
    Q, V = np.zeros((n, ORDERS + 1)), np.zeros((n, ORDERS + 1))
    Q[:, 0], V[:, 0] = q, v
    for k in range(ORDERS):
        force = -A["K"] @ Q[:, k] - A["D"] @ V[:, k]
        force[0] += 5 * math.cos(START + k * math.pi / 2) / math.factorial(k)
        acceleration = inverse @ force
        if sticks:
            acceleration -= inverse[:, 0] * acceleration[0] / inverse[0, 0]
        elif k == 0:
            acceleration -= FRICTION * inverse[:, 0]
        Q[:, k + 1], V[:, k + 1] = V[:, k] / (k + 1), acceleration / (k + 1)
    return Q, V


def invert_parts(system: System, k: Constants, space: Space, sticks: bool) -> None:
    """The inverses of [[M, −Jᵀ], [J or 0, 0 or 1]] of the components."""
    rows = pose(system).rows
    for part in rows.parts:
        n, m, first = part[COORDINATES], part[CONTACTS], part[MEMBERS]
        own, contacts = np.split(rows.members[first : first + n + m], [n])
        A = np.eye(n + m)
        A[:n, :n] = k.M[own, :n]
        A[:n, n:] = -k.J[contacts, :n].T
        if sticks:
            A[n:, :n] = k.J[contacts, :n]
            A[n:, n:] = 0.0
        place = part[FIRST_ROW]
        space.Rq[place : place + n + m, : n + m] = np.linalg.inv(A)


def compare(n: int, full: str, sticks: bool) -> None:
    """The series of a structure, and the sizes of its terms, where the oracle of tapes has them."""
    system = structure(n, full)
    compiled = compile_system(system)
    layout = compiled.layout
    k = Constants(*(np.zeros(layout.shape(name)) for name in Constants._fields))
    compiled.setup(np.array([*system.values.values(), 0.0]), *k)
    spaces = [
        make_space(pose(system).rows, layout.rows, layout.magnitudes, ORDERS) for _ in range(2)
    ]
    y = np.random.default_rng(1).normal(size=2 * n)
    place = {name: i for i, name in enumerate(layout.state)}
    q = np.array([y[place[f"q{i}"]] for i in range(n)])
    v = np.array([y[place[f"d_q{i}"]] for i in range(n)])
    mode = np.full(1, 0 if sticks else 1)
    series = (compiled.jets, Interpreted(compiled.generated).jets)
    for s, jets, N in zip(spaces, series, (ORDERS, 1), strict=True):
        invert_parts(system, k, s, sticks)
        nothing = np.zeros(0, np.int64)
        assert not jets(START, y, mode, nothing, k.K, s.Rq, s.Rz, N, s.W, s.A, s.B, s.mag)
    np.testing.assert_allclose(spaces[0].mag, spaces[1].mag, rtol=1e-12, atol=1e-300)
    for start, wanted in zip(("q", "d_q"), expected(n, full, q, v, sticks), strict=True):
        got = spaces[0].W[[place[f"{start}{i}"] for i in range(n)], : ORDERS + 1]
        size = np.maximum.accumulate(np.max(np.abs(wanted), axis=0))
        assert np.all(np.abs(got - wanted) <= 1e-11 * size)


@pytest.mark.parametrize("n", [*range(2, 10), 16, 17, 18, 29, 40])
def test_series_of_full_matrices(n: int) -> None:
    for full in SUBSETS:
        compare(n, full, sticks=n % 2 == 0)


@pytest.mark.parametrize("full", ["KD", "MKD"])
def test_a_full_structure_moves(full: str) -> None:
    """Sums of many terms, one for each of many rows: a loop inside a loop."""
    assert simulate(structure(20, full), (0.0, 0.5)).outcome.ok


def test_full_matrices_of_the_other_kinds() -> None:
    """Viscous and rate-independent coordinates have sums of many terms, too."""
    n = 36
    x = [f"x{i}" for i in range(n)]
    A = matrices(n, "KD")
    damped = System(
        "viscous",
        coordinates={name: Viscous() for name in x},
        viscous=form(A["D"], [f"d_{name}" for name in x]),
        potential=f"{form(A['K'], x)} - sin(t)*x0",
        contacts={"rub": Contact("d_x0", 0.1)},
    )
    slow = System(
        "rate-independent",
        coordinates={name: RateIndependent() for name in x},
        potential=f"{form(A['K'], x)} - 3*sin(t)*x0",
        contacts={name: Contact(f"d_{name}", 0.5) for name in x},
    )
    for system in (damped, slow):
        assert is_long(generate(derive(system.declaration)))
        assert simulate(system, (0.0, 2.0)).outcome.ok
