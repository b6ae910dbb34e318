"""Craig and Bampton's reduction of sparse structures to 40 coordinates, beside what SciPy alone
offers: SuperLU with minimum degree, and ARPACK.

``python benchmarks/reduction.py`` prints times of a processor, memory, and how far frequencies are
apart; ``--large`` takes 2·10⁵ unknowns, without the rival, which takes many minutes there.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh
from scipy.sparse.linalg import LinearOperator, eigsh, splu

import stickslip as ss

KEPT, MODES = 3, 37


def brick(poisson: float = 0.3) -> tuple[Any, Any]:
    """Mass and stiffness, (24, 24) each, of an elastic cube with eight nodes."""
    lame, shear = poisson / (1 + poisson) / (1 - 2 * poisson), 0.5 / (1 + poisson)
    elastic = np.diag([2 * shear] * 3 + [shear] * 3)
    elastic[:3, :3] += lame
    corners = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], dtype=float)
    mass, stiffness = np.zeros((24, 24)), np.zeros((24, 24))
    for point in corners / np.sqrt(3.0):
        sides = 1.0 + corners * point
        values = sides.prod(axis=1) / 8.0
        slopes = [corners[:, d] * np.delete(sides, d, 1).prod(axis=1) / 4.0 for d in range(3)]
        strain = np.zeros((6, 24))
        for d in range(3):
            strain[d, d::3] = slopes[d]
        for row, (d, e) in enumerate(((0, 1), (1, 2), (0, 2)), start=3):
            strain[row, d::3], strain[row, e::3] = slopes[e], slopes[d]
        stiffness += strain.T @ elastic @ strain / 8.0
        mass += np.kron(np.outer(values, values), np.eye(3)) / 8.0
    return mass, stiffness


def slab(*sizes: int) -> tuple[Any, Any]:
    """Mass and stiffness of so many bricks along each side, clamped where x = 0."""
    nodes = np.arange(np.prod(np.add(sizes, 1))).reshape(np.add(sizes, 1))
    ends = [(slice(None, -1), slice(1, None))[i] for i in (0, 1)]
    corners = np.stack([nodes[i, j, k].ravel() for i in ends for j in ends for k in ends], axis=1)
    places = (3 * corners[:, :, None] + np.arange(3)).reshape(len(corners), 24)
    rows, columns = np.repeat(places, 24, axis=1).ravel(), np.tile(places, (1, 24)).ravel()
    free = np.arange(3 * nodes[0].size, 3 * nodes.size)

    def whole(part: Any) -> Any:
        values = np.tile(part.ravel(), len(corners))
        matrix = sp.csc_array((values, (rows, columns)), shape=(3 * nodes.size,) * 2)
        return matrix[free][:, free].tocsc()

    mass, stiffness = map(whole, brick())
    return mass, stiffness


def strip(long: int, wide: int) -> tuple[Any, Any]:
    """Mass and stiffness of a membrane that is held on all sides."""
    diagonals: Any = sp.diags_array
    lines: list[Any] = [
        diagonals([-np.ones(m - 1), 2.0 * np.ones(m), -np.ones(m - 1)], offsets=[-1, 0, 1])
        for m in (long, wide)
    ]
    one, other = (sp.eye_array(m) for m in (long, wide))
    return sp.eye_array(long * wide).tocsc(), (
        sp.kron(lines[0], other) + sp.kron(one, lines[1])
    ).tocsc()


def ours(mass: Any, stiffness: Any, keep: list[int]) -> Any:
    """Frequencies after the reduction of this library."""
    return ss.Structure(mass, stiffness).reduced(keep=keep, modes=MODES).frequencies


def rival(mass: Any, stiffness: Any, keep: list[int]) -> Any:
    """The same, with as many factors for the same checks: both matrices definite, no mode
    missed."""

    def factors(matrix: Any) -> Any:
        return splu(matrix.tocsc(), "MMD_AT_PLUS_A", 0.0, options={"SymmetricMode": True})

    for matrix in (mass, stiffness):
        assert np.all(factors(matrix).U.diagonal() > 0.0)
    free = np.setdiff1d(np.arange(mass.shape[0]), keep)
    inner, heavy = stiffness[free][:, free].tocsc(), mass[free][:, free].tocsc()
    lu = factors(inner)
    operator: Any = LinearOperator
    inverse = operator(inner.shape, matvec=lu.solve, dtype=float)
    squares, modes = eigsh(inner, MODES + 1, heavy, sigma=0.0, OPinv=inverse)
    below = (squares[-1] + squares[-2]) / 2.0
    assert np.count_nonzero(factors(inner - below * heavy).U.diagonal() < 0.0) == MODES
    shapes = np.zeros((mass.shape[0], len(keep) + MODES))
    shapes[keep, range(len(keep))] = 1.0
    shapes[free, : len(keep)] = -lu.solve(stiffness[free][:, keep].toarray())
    shapes[free, len(keep) :] = modes[:, :MODES]
    return np.sqrt(eigh(*(shapes.T @ (a @ shapes) for a in (stiffness, mass)), eigvals_only=True))


def timed(task: Callable[..., Any], *given: Any) -> tuple[Any, float]:
    """A result, and the seconds of a processor that it took."""
    began = time.process_time()
    found = task(*given)
    return found, time.process_time() - began


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--large", action="store_true", help="2e5 unknowns")
    large = parser.parse_args().large
    cases = {
        "strip": strip(10_000, 20) if large else strip(1_000, 20),
        "elastic slab": slab(100, 44, 14) if large else slab(40, 20, 6),
        "elastic cube": slab(40, 40, 40) if large else slab(16, 16, 16),
    }
    print("| structure | unknowns | seconds | SciPy alone | ratio | apart | peak so far, GB |")
    print("|---|---|---|---|---|---|---|")
    for name, (mass, stiffness) in cases.items():
        n = mass.shape[0]
        keep = [n - 3, n - 2, n - 1]
        found, seconds = timed(ours, mass, stiffness, keep)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
        rest = "| | |"
        if not large:
            other, needed = timed(rival, mass, stiffness, keep)
            apart = float(np.max(np.abs(found / other - 1.0)))
            rest = f"{needed:.1f} | {needed / seconds:.1f} | {apart:.0e}"
        print(f"| {name} | {n:,} | {seconds:.1f} | {rest} | {peak:.2f} |", flush=True)


if __name__ == "__main__":
    main()
