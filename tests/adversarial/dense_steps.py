"""Random steps of evolutions with a small dense A: ``python -m tests.adversarial.dense_steps``.

A step is right if the force that is left lies in K and d is normal to K there. Both are measured
from d alone. The numbers must not depend on which kernels the linear algebra library picks, so the
same steps are made with several.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections import defaultdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from stickslip import Ellipsoid, GroupNorm, Polytope, Product, SupportFormula, WeightedL1
from stickslip.arrays import Array
from stickslip.errors import StickslipError
from stickslip.rate_independent.dissipation import Dissipation
from stickslip.rate_independent.dissipation.formula_sets import FormulaSets
from stickslip.rate_independent.sets.stable_sets import Boxes
from stickslip.rate_independent.solvers.dense import BoxSteps, ProjectionSteps

Rng = np.random.Generator
KERNELS = ("", "Haswell", "SkylakeX")
SPREAD = 1.0  # eigenvalues of A: 10^±SPREAD. A d is known to the rounding of |A| |d|, no better
ROUNDINGS = 4.0  # in a force
KINDS = (
    *("boxes", "groups", "ellipsoid", "flat ellipsoid", "hull", "half-spaces"),
    *("formula", "product"),
)


class Outcome(NamedTuple):
    """Of one step: its kind, KKT residual relative to the largest weight (infinite if there is
    none), seconds."""

    kind: str
    residual: float
    seconds: float


def matrix(rng: Rng, n: int, spread: float) -> Array:
    """Symmetric and positive definite."""
    Q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    A = Q @ np.diag(10.0 ** rng.uniform(-spread, spread, n)) @ Q.T
    return 0.5 * (A + A.T)


def potential(rng: Rng, kind: str, n: int) -> Dissipation:
    """A random potential of a kind, of n dimensions or about as many."""
    match kind:
        case "boxes":
            return WeightedL1(rng.uniform(0.0, 2.0, n), rng.uniform(0.0, 2.0, n))
        case "groups":
            return GroupNorm(rng.uniform(0.0, 2.0, n), size=int(rng.integers(1, 4)))
        case "ellipsoid":
            return Ellipsoid(matrix(rng, n, 1.0))
        case "flat ellipsoid":
            squares, axes = np.linalg.eigh(matrix(rng, n, 1.0))
            squares[0] = 0.0
            shape = axes @ np.diag(squares) @ axes.T
            return Ellipsoid(0.5 * (shape + shape.T))
        case "hull":
            points = rng.normal(size=(n + 4, n))
            return Polytope(vertices=np.vstack([points, -3.0 * points.mean(axis=0)]))
        case "half-spaces":
            normals = np.vstack([rng.normal(size=(3, n)), np.eye(n), -np.eye(n)])
            return Polytope(normals=normals, offsets=rng.uniform(0.1, 1.0, 2 * n + 3))
        case "formula":
            formula = SupportFormula(formula_text(rng, n), dimension=n)
            return FormulaSets(formula.convex)
        case _:
            kinds = rng.choice(KINDS[:-1], int(rng.integers(2, 4)))
            return Product(
                tuple(
                    potential(rng, str(k), int(rng.integers(1 if k == "boxes" else 2, 4)))
                    for k in kinds
                )
            )


def formula_text(rng: Rng, n: int) -> str:
    """A random formula with kinks: absolute values, norms and the larger of several, of linear
    forms, and a part that is not even."""

    def linear() -> str:
        # Some components only: then there are edges of every dimension.
        used = rng.random(n) < 0.6
        used[rng.integers(n)] = True
        return "+".join(f"({rng.normal():.3f})*v{i + 1}" for i in np.flatnonzero(used))

    def norm(count: int) -> str:
        return "sqrt(" + "+".join(f"({linear()})**2" for _ in range(count)) + ")"

    made = {
        "size": lambda: f"abs({linear()})",
        "norm": lambda: norm(int(rng.integers(2, n + 1))),
        "larger": lambda: f"max({norm(2)}, abs({linear()}))",
        "part": lambda: f"max({linear()}, 0)",
        "cubic": lambda: f"(abs({linear()})**3 + abs({linear()})**3)**(1/3)",
    }
    chosen = rng.choice(list(made), int(rng.integers(1, 4)))
    terms = [f"{rng.uniform(0.2, 1.0):.3f}*{made[str(name)]()}" for name in chosen]
    axes = "+".join(f"{rng.uniform(0.1, 1.0):.3f}*v{i + 1}**2" for i in range(n))
    return "+".join([*terms, f"sqrt({axes})", f"0.1*v{int(rng.integers(n)) + 1}"])


def step(seed: int) -> Outcome:
    """Make one."""
    rng = np.random.default_rng(seed)
    kind = KINDS[seed % len(KINDS)]
    psi = potential(rng, kind, int(rng.integers(2, 6)))
    n = psi.dimension
    A = matrix(rng, n, SPREAD)
    load = rng.normal(size=n) * 10.0 ** rng.uniform(-1.0, 1.5)
    sets: Any = psi.sets(np.zeros(1))
    started = time.perf_counter()
    try:
        steps: Any = BoxSteps(A) if isinstance(sets, Boxes) else ProjectionSteps(A)
        states, _ = steps.advance(np.zeros(n), load[None], sets)
    except StickslipError:
        return Outcome(kind, np.inf, time.perf_counter() - started)
    seconds = time.perf_counter() - started
    if not len(states):
        return Outcome(kind, np.inf, seconds)
    d = states[0]
    return Outcome(kind, residual(psi, A, load, d), seconds)


def residual(psi: Dissipation, A: Array, load: Array, d: Array) -> float:
    """Distance of ξ = ℓ − A d from ∂Ψ(d): of ξ from K, and what Ψ(d) is more than ⟨ξ, d⟩, as a
    force.

    Forces are rounded numbers, and so d is known to A⁻¹ times that, which costs as much as Ψ says.
    A d as short as that may as well be 0, which is wrong by A d.
    """
    axes = np.eye(len(d))
    size = max(psi.support(sign * e) for e in axes for sign in (1.0, -1.0)) or 1.0
    pull = A @ d
    xi = load - pull
    length = float(np.linalg.norm(d))
    known = (
        ROUNDINGS
        * np.finfo(float).eps
        * float(np.linalg.norm(load))
        / float(np.linalg.eigvalsh(A)[0])
    )
    gap = max(psi.support(d) - float(xi @ d) - known * size, 0.0) / length if length > 0.0 else 0.0
    return max(psi.distance(xi), min(gap, float(np.linalg.norm(pull)))) / size


def child(count: int, first: int) -> None:
    """Make steps and print what came of them."""
    print(json.dumps([step(seed) for seed in range(first, first + count)]))


def table(found: dict[str, list[Outcome]], count: int, first: int) -> str:
    """Counts by kernels and kind, as Markdown."""
    command = f"python -m tests.adversarial.dense_steps --count {count} --first {first}"
    lines = [
        "# Dense steps\n",
        f"{count} random steps with 2 to 15 unknowns, eigenvalues of A between 0.1 and 10, loads "
        "up to 30 times",
        f"as large as the weights: `{command}`.",
        "The residual is that of the KKT conditions, measured from the step alone, relative to the "
        "largest weight.\n",
        "| OPENBLAS_CORETYPE | kind | steps | no result | worst residual | above 1e-11 |",
        "|---|---|---:|---:|---:|---:|",
    ]
    for kernels, outcomes in found.items():
        groups: dict[str, list[Outcome]] = defaultdict(list)
        for outcome in outcomes:
            groups[outcome.kind].append(outcome)
        for kind in KINDS:
            if own := groups[kind]:
                residuals = np.array([o.residual for o in own])
                worst = residuals[np.isfinite(residuals)].max(initial=0.0)
                lines.append(
                    f"| {kernels or 'unset'} | {kind} | {len(own)} | {np.isinf(residuals).sum()} "
                    f"| {worst:.1e} | {(residuals > 1e-11).sum()} |"
                )
    return "\n".join(lines) + "\n"


def main() -> int:
    """Run the steps with all kernels and report. Exit code 1 if one is not converged to 1e-11."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.adversarial.dense_steps", description=__doc__
    )
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument(
        "--table",
        type=Path,
        help="write the report there, such as benchmarks/results/dense_steps.md",
    )
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        child(options.count, options.first)
        return 0
    found = {}
    for kernels in KERNELS:
        command = [sys.executable, "-m", "tests.adversarial.dense_steps", "--child"]
        command += ["--count", str(options.count), "--first", str(options.first)]
        environment = {k: v for k, v in os.environ.items() if k != "OPENBLAS_CORETYPE"}
        environment |= {"OPENBLAS_CORETYPE": kernels} if kernels else {}
        done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
        found[kernels] = [Outcome(*row) for row in json.loads(done.stdout)]
    text = table(found, options.count, options.first)
    if options.table:
        options.table.write_text(text)
    print(text)
    for kernels, outcomes in found.items():
        for k, outcome in enumerate(outcomes):
            if outcome.residual > 1e-11:
                print(f"{kernels or 'unset'}, seed {options.first + k}: {outcome}", file=sys.stderr)
    return 1 if any(o.residual > 1e-11 for outcomes in found.values() for o in outcomes) else 0


if __name__ == "__main__":
    sys.exit(main())
