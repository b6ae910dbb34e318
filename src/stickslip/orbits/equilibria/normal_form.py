"""Normal forms on the centre manifold, which determine how an equilibrium loses its stability.

References
----------
Y. A. Kuznetsov, *Elements of Applied Bifurcation Theory*, sections 5.4 and 8.7.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from stickslip.orbits.fields.steady import Array
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.evaluator import evaluator
from stickslip.symbolic.expressions import Expr

_DEGENERATE = 1e-9  # a coefficient this small, relative to its terms, is zero


@dataclass(frozen=True)
class Hopf:
    """A pair of imaginary eigenvalues ±iω, with the first Lyapunov coefficient.

    Attributes
    ----------
    frequency : float
        ω.
    lyapunov : float
        First Lyapunov coefficient l₁ for the eigenvector q with ⟨q, q⟩ = 1 (modulo translation): on
        the centre manifold ζ' = iωζ + c ζ|ζ|² + ..., y = ζq + ζ̄q̄ + ..., l₁ = Re(c)/ω.
    size : float
        Sum of the moduli of the terms of l₁.
    vector : array of complex, shape (states,)
        q.
    """

    frequency: float
    lyapunov: float
    size: float
    vector: Array

    @property
    def criticality(self) -> str:
        """Whether the emanating cycle is stable (supercritical) or unstable (subcritical), in the
        centre manifold."""
        if not abs(self.lyapunov) > _DEGENERATE * self.size:
            return "degenerate"
        return "supercritical" if self.lyapunov < 0.0 else "subcritical"


class Derivatives:
    """First, second and third derivatives of a field, exact, at any point.

    Parameters
    ----------
    rates : sequence of Expr
        The field.
    """

    def __init__(self, rates: Sequence[Expr], state: Sequence[str]) -> None:
        self.state: tuple[str, ...] = tuple(state)
        self.places: list[tuple[int, ...]] = []
        wanted = list[Expr]()
        for i, rate in enumerate(rates):
            self._collect(rate, (i,), wanted)
        self._names = (
            sorted(frozenset().union(*(e.symbols for e in wanted)) - set(state)) if wanted else []
        )
        self._evaluate = evaluator(wanted, [*state, *self._names])

    def _collect(self, e: Expr, row: tuple[int, ...], wanted: list[Expr]) -> None:
        """Slopes that are not identically zero, each once: the order of differentiation does not
        matter."""
        for k in range(row[-1] if len(row) > 1 else 0, len(self.state)):
            slope = ex.derivative(e, self.state[k])
            if slope is not ex.ZERO:
                self.places.append((*row, k))
                wanted.append(slope)
                if len(row) < 3:
                    self._collect(slope, (*row, k), wanted)

    def __call__(self, y: Array, values: Mapping[str, float]) -> tuple[Array, Array, Array]:
        """Arrays of shape (n, n), (n, n, n), (n, n, n, n)."""
        n = len(self.state)
        numbers = self._evaluate(
            np.array([*y, *(values[name] for name in self._names)], dtype=float)
        )
        tensors = np.zeros((n, n)), np.zeros((n, n, n)), np.zeros((n, n, n, n))
        for (i, *where), value in zip(self.places, numbers, strict=True):
            for order in permutations(where):
                tensors[len(where) - 1][(i, *order)] = value
        return tensors


def hopf(
    derivatives: Derivatives, y: Array, values: Mapping[str, float], invariant: Array | None = None
) -> Hopf:
    """Frequency and first Lyapunov coefficient of the pair of eigenvalues nearest to the imaginary
    axis.

    Parameters
    ----------
    derivatives : Derivatives
        Of the field.
    y : array, shape (n,)
        The equilibrium.
    values : mapping of str to float
        Parameters.
    invariant : array, shape (n, translations), optional
        Directions of translation, which do not count in the norm of the eigenvector.

    Raises
    ------
    ZeroDivisionError
        If no eigenvalue has an imaginary part.
    """
    # A q = iωq and Aᵀp = −iωp, with ⟨p, q⟩ = 1.
    A, B, C = derivatives(y, values)
    eigenvalue, q = critical_pair(A)
    omega = float(eigenvalue.imag)
    q = q / np.linalg.norm(q if invariant is None else q - invariant @ (invariant.T @ q))
    left, vectors = np.linalg.eig(A.T)
    p: Array = vectors[:, np.argmin(np.abs(left - np.conj(eigenvalue)))]
    p = p / np.conj(np.vdot(p, q))

    def bilinear(u: Array, v: Array) -> Array:
        return np.einsum("ijk,j,k->i", B, u, v)

    # The centre manifold to second order: its constant part and that of twice the frequency.
    cubic = np.einsum("ijkm,j,k,m->i", C, q, q, np.conj(q))
    slow = np.linalg.solve(A, bilinear(q, np.conj(q)))
    fast = np.linalg.solve(2j * omega * np.eye(len(A)) - A, bilinear(q, q))
    terms = [
        np.vdot(p, cubic),
        -2.0 * np.vdot(p, bilinear(q, slow)),
        np.vdot(p, bilinear(np.conj(q), fast)),
    ]
    scale = 1.0 / (2.0 * omega)
    return Hopf(omega, float(scale * sum(terms).real), float(scale * sum(map(abs, terms))), q)


def critical_pair(A: Array) -> tuple[complex, Array]:
    """The complex eigenvalue (imaginary part positive) nearest to the imaginary axis, and its
    eigenvector.

    Raises
    ------
    ZeroDivisionError
        If all eigenvalues are real.
    """
    values: Array
    values, vectors = np.linalg.eig(A.astype(complex))
    upper = np.flatnonzero(values.imag > 0.0)
    if len(upper) == 0:
        raise ZeroDivisionError("no eigenvalue has an imaginary part")
    chosen = upper[np.argmin(np.abs(values[upper].real))]
    return complex(values[chosen]), vectors[:, chosen]
