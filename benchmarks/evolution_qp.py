"""Solvers of quadratic programs on one minimising-movement step, each in the form and at the
tolerance that suit it.

The step is minimise ½ d·A d − r·d + Σ wᵢ|dᵢ|, written with |d| = p + q, d = p − q, p, q ≥ 0
("split"), or with t ≥ ±w d ("epigraph"). Their own tolerances mean different things, so the
residual is measured here, by one formula, from d alone. Interior-point and splitting methods leave
small numbers where a component rests: those below a threshold count as 0, the threshold that suits
the solver best. Every solver is given in both forms at several tolerances, so that a benchmark can
take the fastest that reaches a residual.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
import osqp  # type: ignore[import]
import piqp  # type: ignore[import]
import scipy.sparse as sp

from stickslip.arrays import Array

clarabel: Any = import_module("clarabel")  # compiled, without types
Program = tuple[Any, Array, Any, Any]  # P, q, E, G: minimise ½ x·P x + q·x, E x = 0, G x ≤ 0


def split(A: Any, r: Array, w: Array) -> Program:
    """In (d, p, q)."""
    n = len(r)
    one = sp.eye_array(n)
    none = sp.csc_array((n, n))
    positive = sp.hstack([sp.csc_array((2 * n, n)), -sp.eye_array(2 * n)], format="csc")
    return (
        sp.block_diag((A, none, none), "csc"),
        np.r_[-r, w, w],
        sp.hstack([one, -one, one], "csc"),
        positive,
    )


def epigraph(A: Any, r: Array, w: Array) -> Program:
    """In (d, t)."""
    n = len(r)
    one = sp.eye_array(n)
    none = sp.csc_array((n, n))
    above = sp.block_array([[sp.diags_array(w), -one], [-sp.diags_array(w), -one]], format="csc")
    return sp.block_diag((A, none), "csc"), np.r_[-r, np.ones(n)], sp.csc_array((0, 2 * n)), above


def residual(A: Any, r: Array, w: Array, d: Array) -> float:
    """KKT residual, as a multiple of the largest weight, with the best threshold for rest."""
    found = []
    for threshold in 10.0 ** np.arange(-16, -1):
        at = np.where(np.abs(d) <= threshold * np.abs(d).max(), 0.0, d)
        force = r - A @ at
        found.append(
            np.where(
                at != 0.0, np.abs(force - w * np.sign(at)), np.maximum(np.abs(force) - w, 0.0)
            ).max()
        )
    return float(min(found)) / float(w.max())


def by_osqp(program: Program, tolerance: float) -> tuple[float, Array]:
    """OSQP with polishing."""
    P, q, E, G = program
    rows = sp.csc_matrix(sp.vstack([E, G]))
    lower = np.r_[np.zeros(E.shape[0]), np.full(G.shape[0], -np.inf)]
    solver = osqp.OSQP()
    began = time.perf_counter()
    solver.setup(
        sp.csc_matrix(sp.triu(P)),
        q,
        rows,
        lower,
        np.zeros(len(lower)),
        eps_abs=tolerance,
        eps_rel=tolerance,
        polishing=True,
        max_iter=20_000,
        verbose=False,
    )
    x = solver.solve().x
    return time.perf_counter() - began, x


def by_clarabel(program: Program, tolerance: float) -> tuple[float, Array]:
    """Clarabel."""
    P, q, E, G = program
    options = clarabel.DefaultSettings()
    options.verbose = False
    options.tol_gap_abs = options.tol_gap_rel = options.tol_feas = tolerance
    cones = [clarabel.ZeroConeT(E.shape[0]), clarabel.NonnegativeConeT(G.shape[0])]
    rows = sp.vstack([E, G], "csc")
    upper = sp.triu(P, format="csc")
    began = time.perf_counter()
    x = (
        clarabel.DefaultSolver(upper, q, rows, np.zeros(E.shape[0] + G.shape[0]), cones, options)
        .solve()
        .x
    )
    return time.perf_counter() - began, np.array(x)


def by_piqp(program: Program, tolerance: float) -> tuple[float, Array]:
    """PIQP."""
    P, q, E, G = program
    solver = piqp.SparseSolver()
    settings = solver.settings
    settings.eps_abs = settings.eps_rel = settings.eps_duality_gap_abs = (
        settings.eps_duality_gap_rel
    ) = tolerance
    began = time.perf_counter()
    equal = {"A": E, "b": np.zeros(E.shape[0])} if E.shape[0] else {}
    solver.setup(P=P, c=q, G=G, h_u=np.zeros(G.shape[0]), **equal)
    solver.solve()
    return time.perf_counter() - began, solver.result.x


@dataclass(frozen=True)
class Way:
    """One solver in one form at one tolerance."""

    solver: Callable[[Program, float], tuple[float, Array]]
    form: Callable[[Any, Array, Array], Program]
    tolerance: float

    def __str__(self) -> str:
        return f"{self.form.__name__}, {self.tolerance:.0e}"

    def solve(self, A: Any, r: Array, w: Array) -> tuple[float, float]:
        """Seconds, without those for writing the program down, and residual."""
        seconds, x = self.solver(self.form(A, r, w), self.tolerance)
        return seconds, residual(A, r, w, x[: len(r)])


WAYS = {
    name: [
        Way(solver, form, tolerance)
        for form in (split, epigraph)
        for tolerance in (1e-8, 1e-10, 1e-12, 1e-14)
    ]
    for name, solver in {"OSQP": by_osqp, "Clarabel": by_clarabel, "PIQP": by_piqp}.items()
}
