"""Sparse matrices, factored in fronts: inertia, solutions and modes against LAPACK, and fill."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp

from stickslip.structures.dissection import dissected
from stickslip.structures.fronts import factored_in_fronts
from stickslip.structures.matrices import factored, lowest_modes

lines: Any = sp.diags_array


def line(n: int) -> Any:
    return lines([-np.ones(n - 1), 2.0 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1])


def grid(*sizes: int) -> Any:
    """The Laplace operator of a grid, with more neighbours than along its lines."""
    found: Any = sp.csr_array([[1.0]])
    for n in sizes:
        found = sp.kron(found, sp.eye_array(n) + 0.2 * line(n))
    return sp.csc_array(found)


def scattered(n: int, seed: int) -> Any:
    rng = np.random.default_rng(seed)
    part = sp.random_array((n, n), density=3.0 / n, rng=rng)
    return sp.csc_array(part + part.T + 8.0 * sp.eye_array(n))


def hub(n: int) -> Any:
    """A chain whose first unknown touches all."""
    matrix = (2.0 * line(n) + sp.eye_array(n)).tolil()
    matrix[0, 1:] = matrix[1:, 0] = 0.01
    return sp.csc_array(matrix)


MATRICES = {
    "one unknown": lambda: sp.csc_array([[3.0]]),
    "diagonal": lambda: sp.csc_array(sp.diags_array(np.arange(1.0, 500.0))),
    "chain": lambda: sp.csc_array(line(700)),
    "grid": lambda: grid(20, 30),
    "block": lambda: grid(8, 9, 10),
    "three unknowns a node": lambda: sp.csc_array(
        sp.kron(grid(6, 7, 6), np.array([[2.0, 0.5, 0.1], [0.5, 2.0, 0.3], [0.1, 0.3, 2.0]]))
    ),
    "two bodies": lambda: sp.csc_array(sp.block_diag([grid(15, 20), line(300)])),
    "scattered": lambda: scattered(600, 1),
    "hub": lambda: hub(800),
    "full": lambda: sp.csc_array(np.ones((150, 150)) + 150.0 * np.eye(150)),
}


@pytest.mark.parametrize("name", MATRICES)
def test_solutions_and_inertia_are_those_of_lapack(name: str) -> None:
    matrix = MATRICES[name]()
    n = matrix.shape[0]
    values = np.linalg.eigvalsh(matrix.toarray())
    factor = factored(matrix)
    assert factor.negative == 0
    assert not factor.singular
    right = np.random.default_rng(2).standard_normal((n, 3))
    exact = np.linalg.solve(matrix.toarray(), right)
    np.testing.assert_allclose(factor.solve(right), exact, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(factor.solve(right[:, 0]), exact[:, 0], rtol=1e-9, atol=1e-9)
    for part in (0.1, 0.5, 0.9):
        below = float(np.quantile(values, part)) * (1.0 + 1e-7)
        shifted = sp.csc_array(matrix - below * sp.eye_array(n))
        wanted = int(np.count_nonzero(values < below))
        assert factored(shifted, solving=False).negative == wanted
        assert factored(shifted, solving=False, blocks=factor.blocks).negative == wanted


def test_what_is_singular_is_seen() -> None:
    free = line(900).tolil()
    free[0, 0] = free[-1, -1] = 1.0
    assert factored(sp.csc_array(free)).singular
    assert factored(sp.csc_array(np.zeros((5, 5)))).singular


@pytest.mark.parametrize(("sizes", "most"), [((60, 60), 100), ((20, 20, 20), 400)])
def test_fill_is_that_of_nested_dissection(sizes: tuple[int, ...], most: float) -> None:
    """Entries for each unknown; SuperLU with minimum degree holds 52 and 427."""
    matrix = grid(*sizes)
    found = factored_in_fronts(matrix, dissected(matrix), solving=True)
    entries = sum(own.size + border.size for _, own, border in found.factors)
    assert entries / matrix.shape[0] < most


def test_modes_of_a_block_and_of_equal_frequencies() -> None:
    """A cube: most of its frequencies are there three or six times."""
    one = line(9)
    eye = sp.eye_array(9)
    mass = sp.csc_array(sp.kron(sp.kron(eye + 0.1 * one, eye), eye))
    parts = [sp.kron(sp.kron(a, b), c) for a, b, c in ((one, eye, eye), (eye, one, eye))]
    stiffness = sp.csc_array(parts[0] + parts[1] + sp.kron(sp.kron(eye, eye), one))
    for heavy in (mass, sp.csc_array(sp.eye_array(729))):
        squares, modes = lowest_modes(stiffness, heavy, 30)
        exact = sl.eigh(stiffness.toarray(), heavy.toarray(), eigvals_only=True)[:30]
        np.testing.assert_allclose(squares, exact, rtol=1e-11)
        np.testing.assert_allclose(modes.T @ (heavy @ modes), np.eye(30), atol=1e-9)


@pytest.mark.parametrize(("long", "wide", "count"), [(900, 5, 30), (40, 12, 60), (600, 1, 25)])
def test_modes_of_a_strip(long: int, wide: int, count: int) -> None:
    """Its frequencies are close where it is long: the iteration goes on with a nearer shift, or
    with the best of its vectors."""
    squares, modes = lowest_modes(grid(long, wide), sp.csc_array(sp.eye_array(long * wide)), count)
    parts = [1.4 - 0.4 * np.cos(np.pi * np.arange(1, m + 1) / (m + 1)) for m in (long, wide)]
    exact = np.sort(np.multiply.outer(*parts), axis=None)[:count]
    np.testing.assert_allclose(squares, exact, rtol=1e-9)
    np.testing.assert_allclose(modes.T @ modes, np.eye(count), atol=1e-9)
