"""Steps of collocation at Radau's nodes, in real or complex numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import legendre

from .mechanics import Array

NODES = 12
MORE = 4  # iterations for imaginary parts, which are too small to be seen


def _radau() -> tuple[Array, Array, Array, Array]:
    """Nodes in (0, 1], the matrix of integrals, the inverse of the basis on 0 and the nodes, and
    that on the nodes."""
    series = np.zeros(NODES + 1)
    series[-2:] = -1.0, 1.0
    nodes = (1.0 + np.sort(legendre.legroots(series))) / 2
    nodes[-1] = 1.0
    basis = legendre.legvander(2 * nodes - 1, NODES - 1)
    integrals = np.array(
        [legendre.legval(2 * nodes - 1, legendre.legint(row, lbnd=-1)) / 2 for row in np.eye(NODES)]
    ).T
    whole = legendre.legvander(2 * np.append(0.0, nodes) - 1, NODES)
    return nodes, integrals @ np.linalg.inv(basis), np.linalg.inv(whole), np.linalg.inv(basis)


PLACES, INTEGRALS, THROUGH, INWARD = _radau()


@dataclass(frozen=True)
class Step:
    """A polynomial on [0, 1] of what is integrated."""

    coefficients: Array

    def __call__(self, theta: Any) -> Array:
        """Values, one row for each place."""
        x = 2 * np.atleast_1d(theta) - 1
        return legendre.legvander(x, NODES) @ self.coefficients


def picard(f: Callable[[Array], Array], y: Array, h: Any, guess: Array) -> Array | None:
    """Values at the nodes by Picard's iteration, or None where it does not end."""
    stages = guess
    last = np.inf
    more = MORE if np.iscomplexobj(guess) else 0
    for _ in range(50):
        new = y + h * (INTEGRALS @ f(stages))
        change = np.max(np.abs(new - stages) / (1.0 + np.abs(y)))
        stages = new
        if not np.isfinite(change):
            return None
        if change < 1e-15 or (change < 1e-14 and change >= last):
            if more == 0:
                return stages
            more -= 1
        last = change
    return None


def newton(f: Callable[[Array], Array], y: Array, h: Any, guess: Array) -> Array | None:
    """Values at the nodes by Newton's method: for the beginning of a slip."""
    width = len(y)
    stages = guess
    last = np.inf
    more = MORE if np.iscomplexobj(guess) else 0
    for _ in range(12 + more):
        value = f(stages)
        gap = y + h * (INTEGRALS @ value) - stages
        jacobian = np.zeros((NODES, width, width), dtype=value.dtype)
        for j in range(width):
            by = 1e-7 * np.maximum(np.abs(stages[:, j] - y[j]), 1e-9)
            moved = np.array(stages)
            moved[:, j] += by
            jacobian[:, :, j] = (f(moved) - value) / by[:, None]
        # d(gap)ᵢ/d(stage)ⱼ = h Aᵢⱼ f′(stageⱼ) − 1
        matrix = -h * np.einsum("ij,jab->iajb", INTEGRALS, jacobian).reshape(
            NODES * width, NODES * width
        )
        matrix += np.eye(NODES * width)
        if not np.all(np.isfinite(matrix)):
            return None
        change = np.linalg.solve(matrix, gap.ravel()).reshape(NODES, width)
        stages = stages + change
        size = float(np.max(np.abs(change) / (1.0 + np.abs(y))))
        if not size < 1e3:
            return None
        # the end is linear, as exact as the differences, and then rounding
        if size < 1e-15 or (size < 1e-13 and size > 0.1 * last):
            if more == 0:
                return stages
            more -= 1
        last = size
    return None


def tail_of(values: Array, y: Array, h: Any) -> float:
    """The last coefficients of the rates on a step."""
    series = INWARD @ values
    return float(np.max(np.abs(h * series[-2:]) / (1.0 + np.abs(y))))


def polynomial(y: Array, stages: Array) -> Step:
    return Step(THROUGH @ np.vstack([y, stages]))
