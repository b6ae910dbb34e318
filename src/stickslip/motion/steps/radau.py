"""Radau collocation: polynomials that satisfy the equations at the nodes, by Newton's method.

Radau IIA with s stages: D (Y − y) = H f(Y) for the states Y at the nodes in ]0, H], where D is the
matrix of differentiation of polynomials that vanish at 0. The values of all rows at the nodes
become Legendre polynomials of the change, and these the powers that the table of coefficients has.
Whether such a polynomial is taken, and how long it is, is decided in :mod:`.stiff`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.codegen.layout import ORDERS
from stickslip.equations.codegen.series import invert
from stickslip.motion.steps.arrays import DIMENSION, OK, Flow, Instant, Machine
from stickslip.motion.steps.starting import coefficients
from stickslip.motion.steps.step_size import LEAST_SIZE, better, companion, impulse
from stickslip.numerics.levels import EPSILON, ROUNDING
from stickslip.translator import compiled

_MOST = max(ORDERS) // 2  # largest number of stages
# sum of the semi-axes of the ellipse around [0, H] in the disc of radius 2H
_RHO = 3.0 + math.sqrt(8.0)
_MOST_CORRECTIONS = 12  # largest number of Newton iterations for each length
# largest ratio of successive corrections: with a larger one a shorter step is cheaper
_CONVERGES = 0.5
_SLOW = 0.03  # ratio of successive corrections above which the matrix is recomputed
# fraction of a rounding error that is zero, since subsequent terms compensate it
_NOTHING = 1.0 / 32.0
_VAGUE = 1e-3  # required relative accuracy of a component of the state
_AMPLIFIED = 1e3  # factor on it for a component that is a rounding error of its rate
_NUDGE = 2.0**-26  # relative change of a component of the state for a numerical derivative


def _stages(s: int) -> tuple[Array, Array, Array, float]:
    """Nodes with 0 before them, their matrix of differentiation, the matrix from values to terms,
    and the hidden part.

    The matrix of differentiation is that of polynomials which vanish at 0: the inverse of the
    matrix of Radau IIA.
    """
    legendre = np.polynomial.legendre
    difference = np.zeros(s + 1)
    difference[s], difference[s - 1] = 1.0, -1.0
    x = np.sort(legendre.legroots(difference).real)
    for _ in range(3):
        x -= legendre.legval(x, difference) / legendre.legval(x, legendre.legder(difference))
    x[-1] = 1.0
    nodes = np.concatenate([[0.0], 0.5 * (x + 1.0)])
    apart = nodes[:, None] - nodes + np.eye(s + 1)
    weights = 1.0 / np.prod(apart, axis=1)
    D = weights / weights[:, None] / apart
    np.fill_diagonal(D, np.sum(1.0 / apart, axis=1) - 1.0)
    fine = legendre.legvander(np.linspace(-1.0, 1.0, 801), s - 1)
    lebesgue = np.max(np.sum(np.abs(fine @ np.linalg.inv(legendre.legvander(x, s - 1))), axis=1))
    terms = np.linalg.inv(legendre.legvander(2.0 * nodes - 1.0, s))
    return nodes, D[1:, 1:], terms, float(2.0 * (1.0 + lebesgue) * _RHO ** (1 - s) / (_RHO - 1.0))


def _tables() -> tuple[Array, Array, Array, Array, Array]:
    """All of these for the stages of every order of a series, and the powers in the Legendre
    polynomials of [0, 1]."""
    count = len(ORDERS)
    nodes = np.zeros((count, _MOST + 1))
    slopes = np.zeros((count, _MOST, _MOST))
    terms = np.zeros((count, _MOST + 1, _MOST + 1))
    parts = np.zeros(count)
    for i, order in enumerate(ORDERS):
        s = order // 2
        nodes[i, : s + 1], slopes[i, :s, :s], terms[i, : s + 1, : s + 1], parts[i] = _stages(s)
    powers = np.zeros((_MOST + 1, _MOST + 1))
    for j in range(_MOST + 1):
        for k in range(j + 1):
            powers[k, j] = (-1.0) ** (j + k) * math.comb(j, k) * math.comb(j + k, k)
    return nodes, slopes, terms, parts, powers


STAGE_NODES, SLOPES, TERMS, HIDDEN_PARTS, POWERS = _tables()
_LOWEST = min(ORDERS)  # lowest order of the series: 8, 12, 16, …
_APART = 4  # difference of successive orders


class Stages(NamedTuple):
    """Work space of an implicit step with s stages, for a state of n components.

    Attributes
    ----------
    matrix, inverse : arrays, shapes (sn + 1, ·), (sn, ·)
        Of Newton's method for all nodes at once.
    states, residuals : arrays
        At all nodes.
    state : array
        At one of them.
    rate : array
        At the beginning.
    values : array
        Of some rows.
    rounded : array
        What rounding errors of the state make of the rates and of the guards.
    known : array
        What rounding errors of the rates make of the states.
    slopes : array
        The largest derivatives of rows that are watched, by each part of the state.
    """

    matrix: Array
    inverse: Array
    states: Array
    residuals: Array
    state: Array
    rate: Array
    values: Array
    rounded: Array
    known: Array
    slopes: Array


@compiled()
def stages_of(flow: Flow) -> Stages:
    """The work space of implicit steps."""
    n = flow.rows.sizes[DIMENSION]
    m = flow.order // 2 * n
    rows = flow.space.stages
    first = 2 * m + 1
    return Stages(
        rows[: m + 1],
        rows[m + 1 : first],
        rows[first],
        rows[first + 1],
        rows[first + 2],
        rows[first + 3],
        rows[first + 4],
        rows[first + 5],
        rows[first + 6],
        rows[first + 7 : first + 7 + n],
    )


@compiled()
def tables_of(order: int) -> int:
    """Positions of the nodes and matrices of an order."""
    return (order - _LOWEST) // _APART


@compiled()
def solve_stages(
    machine: Machine, flow: Flow, stages: Stages, start: Instant, step: float, seen: Array
) -> bool:
    """The states Y at the nodes, by Newton's method for D (Y − y) = H f(Y); whether it has settled.

    If so, the values of all rows at the nodes, from the beginning on, are in the table of
    coefficients.

    Parameters
    ----------
    stages : Stages
        With the rate at the beginning; receives the states.
    step : float
        H.
    seen : array
        Largest modulus so far of each row that bounds the steps.
    """
    y = start.y
    n = len(y)
    m = flow.order // 2 * len(y)
    q = tables_of(flow.order)
    before, now = np.inf, np.inf
    for j in range(m):
        stages.states[j] = y[j % n] + STAGE_NODES[q, j // n + 1] * step * stages.rate[j % n]
    for turn in range(_MOST_CORRECTIONS):
        settled = now <= 1e-2 or (turn > 1 and now <= 1.0 and now >= 0.3 * before)
        fresh = not settled and (turn == 0 or not now <= _SLOW * before)
        if not visit(machine, flow, stages, start, step, seen, fresh, settled):
            return False
        if settled:
            return True
        if fresh:
            if not invert(stages.matrix, m, stages.inverse):
                return False
            measure_accuracy(flow, stages, step)
        before = now
        now = newton_step(flow, stages, seen)
        if not now < np.inf or (turn > 0 and now > 1.0 and now > _CONVERGES * before):
            return False
    return False


@compiled()
def measure_accuracy(flow: Flow, stages: Stages, step: float) -> None:
    """Accuracy of the states at the nodes, and of guards: the effect of rounding errors of the
    rates.

    What decays forgets them; what does not, as the speed of a slip in a plane whose forces nearly
    cancel, adds them up.
    """
    noise = flow.rows.noise
    mag = flow.space.mag
    n = flow.rows.sizes[DIMENSION]
    m = flow.order // 2 * n
    for r in range(n):
        stages.known[r] = 0.0
    for i in range(m):
        total = 0.0
        for j in range(m):
            c = j % n
            error = stages.rounded[c] + (EPSILON * mag[noise[c]] if noise[c] >= 0 else 0.0)
            total += abs(stages.inverse[i, j]) * step * error
        stages.known[i % n] = max(stages.known[i % n], total)
    for j in range(n, len(flow.rows.watched)):
        for r in range(n):
            stages.rounded[j] += stages.slopes[r, j] * stages.known[r]


@compiled()
def newton_step(flow: Flow, stages: Stages, seen: Array) -> float:
    """A step of Newton's method; returns the largest correction, relative to its tolerance."""
    n = flow.rows.sizes[DIMENSION]
    m = flow.order // 2 * n
    worst = 0.0
    for j in range(m):
        change = 0.0
        r = j % n
        for i in range(m):
            change -= stages.inverse[j, i] * stages.residuals[i]
        stages.states[j] += change
        size = LEAST_SIZE + abs(stages.states[j]) + flow.atol * seen[r]
        most = (flow.tol + 16.0 * EPSILON) * size + stages.known[r]
        share = abs(change) / most
        worst = max(worst, share) if share == share else np.inf
    return worst


@compiled()
def visit(
    machine: Machine,
    flow: Flow,
    stages: Stages,
    start: Instant,
    step: float,
    seen: Array,
    fresh: bool,
    settled: bool,
) -> bool:
    """Evaluate the rows at all nodes; False if there are no rates at one of them.

    Where the states have settled, the values are kept. Before that, D (Y − y) − H f(Y) is wanted,
    and, where it is said, its derivatives anew. These are differences: they matter to how fast
    Newton's method settles, not to where. They tell as well what rounding errors of the state and
    of time make of the rates and of the guards.

    Parameters
    ----------
    stages : Stages
        With the states; receives residuals and, where `fresh`, derivatives.
    step : float
        H.
    seen : array
        Largest modulus so far of each row that bounds the steps.
    fresh, settled : bool
        Whether derivatives are wanted anew; whether the states have settled.
    """
    y = start.y
    s = flow.order // 2
    n = len(y)
    q = tables_of(flow.order)
    V = flow.space.V
    z = stages.state
    for i in range(s - 1, -2 if settled else -1, -1):
        for c in range(-1, n + 1 if fresh else 0):
            for r in range(n):
                z[r] = stages.states[i * n + r] if i >= 0 else y[r]
            time = start.t + STAGE_NODES[q, i + 1] * step
            nudge = 0.0
            around = 0.0
            if c == n:
                around = abs(time)
                nudge = _NUDGE * (abs(time) + step)
                time += nudge
            # Differences relative to the value and to its change in the step, so that they exceed
            # rounding errors also for components near zero.
            elif c >= 0:
                around = abs(z[c])
                moved = abs(stages.rate[c]) * step
                z[c] += _NUDGE * (LEAST_SIZE + around + moved + flow.atol * seen[c])
                nudge = z[c] - stages.states[i * n + c]
            node = Instant(time, z, start.mode, start.reg)
            if coefficients(machine, flow, node, 1, V) != OK:
                return False
            if settled:
                for row in range(len(V)):
                    flow.space.W[row, i + 1] = V[row, 0]
            elif c < 0:
                begin_node(flow, stages, y, i, step, fresh)
            else:
                compare(flow, stages, i, c, step, nudge, n * EPSILON * around)
    return True


@compiled()
def begin_node(flow: Flow, stages: Stages, y: Array, i: int, step: float, fresh: bool) -> None:
    """Collect the data of node i from the values of the rows, and prepare the derivatives.

    Parameters
    ----------
    stages : Stages
        Receives residuals, rows of the matrix, and values.
    y : array, shape (n,)
        State at the beginning of the step.
    i : int
        The node, from 0.
    step : float
        H.
    fresh : bool
        Whether derivatives are wanted anew.
    """
    V = flow.space.V
    D = SLOPES[tables_of(flow.order)]
    s = flow.order // 2
    rates = flow.rows.program.rates
    n = len(y)
    for r in range(n):
        place = i * n + r
        total = -step * V[rates[r], 0]
        for j in range(s):
            total += D[i, j] * (stages.states[j * n + r] - y[r])
        stages.residuals[place] = total
        for j in range(s * n if fresh else 0):
            stages.matrix[place, j] = D[i, j // n] if j % n == r else 0.0
    watched = flow.rows.watched
    for j in range(len(watched) if fresh else 0):
        stages.values[j] = V[sampled_row(rates, watched, j), 0]
        if i == s - 1:
            stages.rounded[j] = 0.0
            for r in range(n):
                stages.slopes[r, j] = 0.0


@compiled()
def sampled_row(rates: Array, watched: Array, j: int) -> int:
    """The j-th row that is watched; of a part of the state, its rate."""
    return int(rates[j] if j < len(rates) else watched[j])


@compiled()
def compare(
    flow: Flow, stages: Stages, i: int, c: int, step: float, nudge: float, error: float
) -> None:
    """Change of the rates at node i due to a change of a component of the state (or of time, after
    these), and the error of the guards.

    Parameters
    ----------
    stages : Stages
        Receives part of a column of the matrix, and what rounding errors make.
    i, c : int
        Node, from 0, and part of the state (n: time).
    step : float
        H.
    nudge, error : float
        The change, and n times the rounding error of that part.
    """
    V = flow.space.V
    rates = flow.rows.program.rates
    watched = flow.rows.watched
    matrix = stages.matrix
    values = stages.values
    rounded = stages.rounded
    noise = flow.rows.noise
    mag = flow.space.mag
    n = len(rates)
    for j in range(len(watched)):
        change = V[sampled_row(rates, watched, j), 0] - values[j]
        if noise[j] >= 0 and abs(change) <= 4.0 * EPSILON * mag[noise[j]]:
            change = 0.0  # lost in rounding
        slope = change / nudge
        if j < n and c < n:
            matrix[i * n + j, i * n + c] -= step * slope
        rounded[j] = max(rounded[j], error * abs(slope))
        if c < n:
            stages.slopes[c, j] = max(stages.slopes[c, j], abs(slope))


@compiled()
def to_legendre(W: Array, s: int, n: int, terms: Array, values: Array) -> None:
    """Values of all rows at the nodes, as a first value and Legendre polynomials of the change.

    Parameters
    ----------
    W : array, shape (rows, N + 1)
        Values in columns 0 … s; receives the first value and the terms.
    s, n : int
        Stages, and components of the state.
    terms : array
        Matrix from values to terms.
    values : array
        Work space.
    """
    for row in range(len(W)):
        for i in range(s + 1):
            values[i] = W[row, i] - W[row, 0]
        for j in range(1, W.shape[1]):
            W[row, j] = 0.0
        for j in range(1, s + 1):
            for i in range(1, s + 1):
                W[row, j] += terms[j, i] * values[i]


@compiled()
def drop_rounding(flow: Flow, known: Array) -> None:
    """Set terms of the state beyond its last significant one to zero, since they would grow large
    on discs."""
    W = flow.space.W
    s = flow.order // 2
    for r in range(flow.rows.sizes[DIMENSION]):
        last = s
        size = span_of(W, r, s)
        left = _NOTHING * (16.0 * EPSILON * size + known[r])
        while last > 0 and abs(W[r, last]) <= left:
            left -= abs(W[r, last])
            W[r, last] = 0.0
            last -= 1


@compiled()
def span_of(W: Array, row: int, s: int) -> float:
    """Bound of a row in its s Legendre polynomials."""
    size = abs(W[row, 0])
    for j in range(1, s + 1):
        size += abs(W[row, j])
    return size


@compiled()
def last_terms(flow: Flow, stages: Stages, step: float, seen: Array) -> float:
    """The last two terms of the state and of all guards, relative to their tolerances.

    Infinite where rounding errors leave nothing of a part of the state, as they do where Newton's
    method has gone to states that no motion comes to: there every term would be one of them.
    """
    W = flow.space.W
    mag = flow.space.mag
    noise = flow.rows.noise
    watched = flow.rows.watched
    s = flow.order // 2
    n = flow.rows.sizes[DIMENSION]
    worst = 0.0
    for i in range(len(watched)):
        row = watched[i]
        # The direction of a slip counts, not its smaller component.
        size = LEAST_SIZE + max(span_of(W, row, s), span_of(W, companion(flow.rows, row), s))
        most = flow.tol * (size + flow.atol * seen[i])
        if i < n:
            natural = EPSILON * impulse(flow.rows, mag, i, step)
            if stages.known[i] > _VAGUE * (size + flow.atol * seen[i]) + _AMPLIFIED * natural:
                return np.inf
            most += 16.0 * EPSILON * size + stages.known[i]
        else:
            most += (
                ROUNDING * size
                + 16.0 * stages.rounded[i]
                + (ROUNDING * mag[noise[i]] if noise[i] >= 0 else 0.0)
            )
        share = max(abs(W[row, s]), abs(W[row, s - 1])) / most
        worst = max(worst, share) if share == share else np.inf
    return worst


@compiled()
def to_powers(W: Array, s: int, n: int, step: float, values: Array) -> None:
    """The Legendre polynomials of all rows but time in powers of a unit of time.

    Parameters
    ----------
    W : array, shape (rows, N + 1)
        Terms; receives the coefficients, with the unit of time in row n.
    s, n : int
        Stages, and components of the state.
    step : float
        Length of the polynomial.
    values : array
        Work space.
    """
    unit = better(step, 1.0)
    for row in range(len(W)):
        factor = 1.0
        for j in range(1, s + 1):
            values[j] = W[row, j]
        for i in range(1, s + 1):
            factor *= unit / step
            W[row, i] = 0.0
            for j in range(i, s + 1):
                W[row, i] += POWERS[i, j] * values[j] * factor
    W[n, 1] = unit
    for i in range(2, W.shape[1]):
        W[n, i] = 0.0
