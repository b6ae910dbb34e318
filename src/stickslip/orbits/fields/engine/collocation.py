"""A step of a first variation in compiled loops: collocation at Gauss nodes, or, if its Jacobian is
constant, the equivalent flow."""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array
from stickslip.orbits.fields.engine.tables import STAGES, PassSpace
from stickslip.translator import compiled

_LEAST_PIVOT = 0.1  # a pivot below this part of its column is exchanged


def gauss() -> tuple[Array, Array, Array]:
    """Nodes and weights on [0, 1] and the matrix of collocation aᵢⱼ = ∫₀^cᵢ ℓⱼ."""
    x, w = np.polynomial.legendre.leggauss(STAGES)
    c = 0.5 * (x + 1.0)
    # ℓⱼ = Σ_d (2d + 1)/2 wⱼ P_d(xⱼ) P_d, and ∫P_d = (P_{d+1} − P_{d−1})/(2d + 1), both of which are
    # stable.
    P = np.polynomial.legendre.legvander(x, STAGES)
    integral = np.empty((STAGES, STAGES))
    integral[:, 0] = x + 1.0
    for d in range(1, STAGES):
        integral[:, d] = (P[:, d + 1] - P[:, d - 1]) / (2 * d + 1)
    weighted = 0.5 * (2 * np.arange(STAGES) + 1) * P[:, :STAGES] * w[:, None]
    return c, 0.5 * w, 0.5 * integral @ weighted.T


NODES, WEIGHTS, INTEGRALS = gauss()
# ∫₀¹ exp((1 − s)A) b(s) ds = Σₖ Aᵏ Σᵢ MOMENTS[k, i] b(cᵢ), with as many powers as count where no
# eigenvalue of A is larger than what `resolution` leaves
_MOMENTS = np.array([WEIGHTS * (1.0 - NODES) ** k / math.factorial(k) for k in range(25)])
# coefficients of the numerator of the Padé approximant of exp
_PADE = np.array([math.comb(STAGES, k) / math.perm(2 * STAGES, k) for k in range(STAGES + 1)])


@compiled()
def gauss_step(places: Array, values: Array, h: float, change: Array, system: Array) -> None:
    """One step of Φ' = J_y Φ + J_p by collocation at the Gauss nodes.

    Parameters
    ----------
    places : array of int, shape (states × columns,)
        Of the Jacobian in the table of values.
    values : array, shape (places, LANES)
        That of the nodes.
    change : array, shape (columns, directions)
        Φ before, and after.
    system : array, shape (STAGES × states, at least STAGES × states + directions)
        Work space.
    """
    columns, directions = change.shape
    n = len(places) // columns
    size = STAGES * n
    # The slopes K_i at the nodes solve K_i = J_i(Φ + h Σ_j a_ij K_j), all together.
    for i in range(STAGES):
        for r in range(n):
            row = system[i * n + r]
            for c in range(n):
                slope = values[places[r * columns + c], i]
                for j in range(STAGES):
                    row[j * n + c] = -h * INTEGRALS[i, j] * slope
            row[i * n + r] += 1.0
            for d in range(directions):
                total = 0.0
                for c in range(columns):
                    total += values[places[r * columns + c], i] * change[c, d]
                row[size + d] = total
    eliminate(system, size, size + directions)
    for r in range(n):
        for d in range(directions):
            total = 0.0
            for i in range(STAGES):
                total += WEIGHTS[i] * system[i * n + r, size + d]
            change[r, d] += h * total


@compiled()
def forced_step(places: Array, work: PassSpace, h: float, change: Array) -> None:
    """One step of Φ' = J_y Φ + J_p with constant J_y: the flow of J_y, and the contribution of each
    column of J_p.

    Parameters
    ----------
    places : array of int, shape (states × columns,)
        Of the Jacobian in the table of values.
    work : PassSpace
        With the flow of the step as the third of its squares.
    change : array, shape (columns, directions)
        Φ before, and after.
    """
    columns, directions = change.shape
    values, flow, moved = work.values, work.squares[2], work.moved
    added, rates = work.squares[3, 0], work.squares[4, 0]
    n = len(flow)
    for d in range(directions):
        for r in range(n):
            moved[r, d] = 0.0
            for c in range(n):
                moved[r, d] += flow[r, c] * change[c, d]
    for p in range(n, columns):
        for r in range(n):
            added[r] = 0.0
        for k in range(len(_MOMENTS) - 1, -1, -1):
            for r in range(n):
                rates[r] = 0.0
                for c in range(n):
                    rates[r] += values[places[r * columns + c], 0] * added[c]
            for r in range(n):
                added[r] = h * rates[r]
                for i in range(STAGES):
                    added[r] += h * _MOMENTS[k, i] * values[places[r * columns + p], i]
        for d in range(directions):
            for r in range(n):
                moved[r, d] += added[r] * change[p, d]
    for d in range(directions):
        for r in range(n):
            change[r, d] = moved[r, d]


@compiled()
def repeat(places: Array, work: PassSpace, h: float, parts: int, change: Array) -> None:
    """Many equal steps with one Jacobian: powers of the flow of one step, by squaring.

    Parameters
    ----------
    places : array of int
        Of the Jacobian in the table of values.
    h : float
        Length of a step.
    parts : int
        Their number.
    change : array, shape (states, directions)
        The variation before, and after.
    """
    flow, square, moved = work.squares[2], work.squares[3], work.moved
    put_exponential(places, work, h, flow)
    while parts > 0:
        if parts % 2 == 1:
            put_product(flow, change, moved)
            put_matrix(moved, change)
        parts //= 2
        if parts > 0:
            put_product(flow, flow, square)
            put_matrix(square, flow)


@compiled()
def put_exponential(places: Array, work: PassSpace, h: float, flow: Array) -> None:
    """The flow of one step with constant Jacobian. Collocation at the Gauss nodes is the diagonal
    Padé approximant N/D of exp(hJ), with N = V + U and D = V − U, where V is even and U odd in hJ.

    Parameters
    ----------
    places : array of int
        Of the Jacobian in the table of values.
    flow : array, shape (states, states)
        Receives it.
    """
    n = len(flow)
    columns = len(places) // n
    A, square, U, V = work.squares[0], work.squares[1], work.squares[3], work.squares[4]
    for r in range(n):
        for c in range(n):
            A[r, c] = h * work.values[places[r * columns + c], 0]
            U[r, c] = V[r, c] = 0.0
    put_product(A, A, square)
    for r in range(n):
        U[r, r] = _PADE[STAGES - 1]
        V[r, r] = _PADE[STAGES]
    for k in range(STAGES - 2, -1, -2):
        put_product(square, V, flow)
        put_matrix(flow, V)
        if k > 0:
            put_product(square, U, flow)
            put_matrix(flow, U)
        for r in range(n):
            V[r, r] += _PADE[k]
            if k > 0:
                U[r, r] += _PADE[k - 1]
    put_product(A, U, flow)
    system = work.system
    for r in range(n):
        for c in range(n):
            system[r, c] = V[r, c] - flow[r, c]
            system[r, n + c] = V[r, c] + flow[r, c]
    eliminate(system, n, 2 * n)
    for r in range(n):
        for c in range(n):
            flow[r, c] = system[r, n + c]


@compiled()
def eliminate(system: Array, size: int, width: int) -> None:
    """Solve linear equations, whose right-hand sides are the columns from `size` up to a width;
    they are overwritten by the solutions."""
    for c in range(size):
        best, largest = c, abs(system[c, c])
        for r in range(c + 1, size):
            if _LEAST_PIVOT * abs(system[r, c]) > largest:
                best, largest = r, abs(system[r, c])
        if best != c:
            for j in range(c, width):
                system[c, j], system[best, j] = system[best, j], system[c, j]
        inverse = 1.0 / system[c, c]
        for r in range(c + 1, size):
            factor = system[r, c] * inverse
            if factor != 0.0:
                for j in range(c + 1, width):
                    system[r, j] -= factor * system[c, j]
    for c in range(size - 1, -1, -1):
        inverse = 1.0 / system[c, c]
        for j in range(size, width):
            total = system[c, j]
            for r in range(c + 1, size):
                total -= system[c, r] * system[r, j]
            system[c, j] = total * inverse


@compiled()
def put_product(a: Array, b: Array, out: Array) -> None:
    """The product of two matrices."""
    for r in range(a.shape[0]):
        for c in range(b.shape[1]):
            out[r, c] = 0.0
        for j in range(a.shape[1]):
            for c in range(b.shape[1]):
                out[r, c] += a[r, j] * b[j, c]


@compiled()
def put_matrix(a: Array, out: Array) -> None:
    """Copy a matrix."""
    for r in range(a.shape[0]):
        for c in range(a.shape[1]):
            out[r, c] = a[r, c]
