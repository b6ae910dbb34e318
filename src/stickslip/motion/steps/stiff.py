"""Stiff motion: where series are short because something decays, not because the motion changes.

A series stands for all motions nearby. If one of them decays within the time 1/Λ, the series is
good for about 10/Λ, however slowly the motion itself goes on. There a polynomial of degree s takes
its place that obeys the equations at the s nodes of Radau in ]0, H] (Radau IIA; E. Hairer, G.
Wanner, *Solving Ordinary Differential Equations II*, IV.5): what decays does not bound H. The
values of all rows of the tape at the nodes are put into the table of coefficients as polynomials,
so that events, values in between and the audit find what they find of a series.

A polynomial is taken only if

* the last two terms of the state and of all guards, by Legendre polynomials, are as small as those
  of a series are to be, or lost in rounding;
* nothing is hidden between the nodes: all rows are bounded on the disc of twice the step
  (:mod:`stickslip.motion.steps.discs`) by some B, so that they differ from their interpolants by at
  most

      2 (1 + Λₛ) B ρ^(1 − s)/(ρ − 1),  ρ = 3 + √8,

  where Λₛ is the Lebesgue constant of the nodes; see :mod:`stickslip.motion.between.step_balance`.
  What is hidden in a rate counts for as long as a series would last: what came before has decayed;
* it spares as many series as it costs.
"""

from __future__ import annotations

import math

import numpy as np

from stickslip.equations.codegen.generate import ORDERS
from stickslip.equations.codegen.series import invert
from stickslip.machine_code import njit
from stickslip.motion.steps.arrays import (
    DIMENSION,
    EPSILON,
    IMPLICIT,
    INLINED,
    JETS,
    OK,
    OPTIONS,
    ROUNDING,
    Constants,
    Rows,
    Space,
)
from stickslip.motion.steps.discs import spread, spread_state
from stickslip.motion.steps.step_size import LEAST, better, expand, fill_powers, hidden

Array = np.ndarray

MOST = max(ORDERS) // 2  # stages
RHO = 3.0 + math.sqrt(8.0)  # of the ellipse around [0, H] in the disc of radius 2H
# tolerances that the terms of a third of the order may have where a step is bounded by what decays
CALM = 1e5
WATCHED = 32  # such steps in succession, before a polynomial is tried
RESTING = 2048  # and after one has not been worth its cost
MOST_TRIES = 12  # lengths of a polynomial
MOST_CORRECTIONS = 12  # iterations of Newton's method for each
SLOW = 0.03  # factor by which corrections fall where the matrix is made anew
# part of a rounding error that is none, since what follows has to make up for it
NOTHING = 1.0 / 32.0
NUDGE = 2.0**-26  # of its size, by which a part of the state is changed for a derivative
# Rows of the work space behind two matrices: states and residuals at all nodes, a state, the rates
# at the beginning, values of some rows, and what rounding errors of the state make of the guards.
STATES = 0
RESIDUALS = 1
STATE = 2
RATE = 3
VALUES = 4
ROUNDED = 5
SPARE = 6


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
    return nodes, D[1:, 1:], terms, float(2.0 * (1.0 + lebesgue) * RHO ** (1 - s) / (RHO - 1.0))


def _tables() -> tuple[Array, Array, Array, Array, Array]:
    """All of these for the stages of every order of a series, and the powers in the Legendre
    polynomials of [0, 1]."""
    count = len(ORDERS)
    nodes = np.zeros((count, MOST + 1))
    slopes = np.zeros((count, MOST, MOST))
    terms = np.zeros((count, MOST + 1, MOST + 1))
    parts = np.zeros(count)
    for i, order in enumerate(ORDERS):
        s = order // 2
        nodes[i, : s + 1], slopes[i, :s, :s], terms[i, : s + 1, : s + 1], parts[i] = _stages(s)
    powers = np.zeros((MOST + 1, MOST + 1))
    for j in range(MOST + 1):
        for k in range(j + 1):
            powers[k, j] = (-1.0) ** (j + k) * math.comb(j, k) * math.comb(j + k, k)
    return nodes, slopes, terms, parts, powers


NODES, SLOPES, TERMS, PARTS, POWERS = _tables()
FIRST = min(ORDERS)  # of the orders of series: 8, 12, 16, …
APART = 4  # distance of two of them


@njit(**OPTIONS)
def dear(n: int) -> float:
    """How many series cost as much as a polynomial: some evaluations at all nodes, and an
    elimination."""
    return 16.0 + 4.0 * n * n


@njit(**OPTIONS)
def calm(W: Array, n: int, N: int, h: float, tol: float, atol: float, seen: Array) -> bool:
    """Whether a series is as good as known at a third of its order: its step is bounded by
    something that decays."""
    m = N // 3
    x = h / W[n, 1]
    power = x**m
    for r in range(n):
        size = CALM * tol * (abs(W[r, 0]) + abs(W[r, 1]) * x + atol * seen[r])
        if not (abs(W[r, m]) * power <= size and abs(W[r, m + 1]) * power * x <= size):
            return False
    return True


@njit(**OPTIONS)
def lingers(
    W: Array,
    n: int,
    N: int,
    h: float,
    room: float,
    tol: float,
    atol: float,
    seen: Array,
    clock: Array,
    fired: int,
) -> bool:
    """Whether it is time to try a polynomial instead of the series that is in the table, and how
    long a one."""
    if not dear(n) * h < room:
        return False
    if fired >= 0 or not calm(W, n, N, h, tol, atol, seen):
        clock[IMPLICIT] = min(clock[IMPLICIT], -WATCHED)
        return False
    if clock[IMPLICIT] < 0.0:
        clock[IMPLICIT] += 1.0
        return False
    if clock[IMPLICIT] == 0.0:
        clock[IMPLICIT] = 4.0 * dear(n) * h
    clock[IMPLICIT] = min(clock[IMPLICIT], room)
    return True


@njit(**OPTIONS)
def follow(
    jets: JETS,
    rows: Rows,
    k: Constants,
    space: Space,
    N: int,
    t: float,
    y: Array,
    mode: Array,
    reg: Array,
    room: float,
    last: float,
    tol: float,
    atol: float,
    seen: Array,
) -> tuple[int, float, float]:
    """A polynomial that follows a known motion in a mode: its series, or one that is good for
    longer.

    Parameters
    ----------
    room, last : float
        Most that is wanted, and the length of the piece before (0: it is the first).

    Returns
    -------
    order, step, series
        Order up to which the coefficients are finite, the step for which they are good, and that of
        the series.
    """
    n = rows.sizes[DIMENSION]
    before = last
    step = -1.0
    while True:
        order, h = expand(jets, rows, k, space, N, t, y, mode, reg, room, before, tol, atol, seen)
        least = dear(n) * h
        if before > least:
            # the piece before was no series, whose length would tell what may change in one
            before = h
            continue
        if step == 0.0 or not (
            order == N and 0.0 < least < room and calm(space.W, n, N, h, tol, atol, seen)
        ):
            return order, h, h
        first = room if last == 0.0 else min(room, max(2.0 * last, 4.0 * least))
        step, _ = collocate(jets, rows, k, space, N, t, y, mode, reg, h, first, tol, atol, seen)
        if step > 0.0:
            return order, step, h


@njit(**OPTIONS)
def collocate(
    jets: JETS,
    rows: Rows,
    k: Constants,
    space: Space,
    N: int,
    t: float,
    y: Array,
    mode: Array,
    reg: Array,
    h: float,
    first: float,
    tol: float,
    atol: float,
    seen: Array,
) -> tuple[float, float]:
    """The longest polynomial up to some length that is good, in the table of coefficients.

    Parameters
    ----------
    h : float
        How long a series is good for.
    first : float
        The length that is tried first.

    Returns
    -------
    step, next
        Its length, and that to be tried next; zeros if none is worth its cost.
    """
    p = rows.program
    W = space.W
    n = rows.sizes[DIMENSION]
    powers = space.reaches
    s = N // 2
    q = (N - FIRST) // APART
    work = space.stages[2 * s * n + 1 :]
    step = first
    cut = False
    values = work[VALUES]
    for r in range(n):
        work[RATE, r] = W[r, 1] / W[n, 1]
    for _ in range(MOST_TRIES):
        if not step >= dear(n) * h:
            break
        if not solve_stages(jets, rows, k, space, N, t, y, mode, reg, h, step, tol, atol, seen):
            step = 0.25 * step
            cut = True
            continue
        to_legendre(W, s, n, TERMS[q], values)
        drop_rounding(W, s, n, rows.noise, space.mag, work[ROUNDED], h)
        excess = last_terms(
            W, s, n, rows.watched, rows.noise, space.mag, work[ROUNDED], h, tol, atol, seen
        )
        fits = 0.9 * max(excess, LEAST) ** (-1.0 / s) if excess < np.inf else 0.0
        if not excess <= 1.0:
            step = step * max(0.1, fits)
            cut = True
            continue
        to_powers(W, s, n, step, values)
        fill_powers(powers, 2.0 * step / W[n, 1])
        space.discs[n, 0] = 2.0 * step
        space.discs[n, 1] = 0.0
        spread_state(W, N, powers, rows.watched[:n], space.discs)
        spread(
            p,
            k.K,
            W,
            space.discs,
            space.Rq,
            space.Rz,
            space.B,
            space.balls,
            mode,
            reg,
            0,
            len(p.code),
        )
        fill_powers(powers, step / W[n, 1])
        excess = hidden(rows, space, mode, N, h, PARTS[q], tol, atol, seen)
        if excess <= 1.0:
            return step, step * (1.1 if cut else min(2.0, fits))
        step = step * (0.7 if excess < 10.0 else 0.5)
        cut = True
    return 0.0, 0.0


@njit(**OPTIONS)
def known_to(noise: Array, mag: Array, rounded: Array, r: int, size: float, h: float) -> float:
    """Rounding error of a part of the state of some size, whose rate decides it within the time
    h."""
    return (
        16.0 * EPSILON * size
        + (rounded[r] + (EPSILON * mag[noise[r]] if noise[r] >= 0 else 0.0)) * h
    )


@njit(**INLINED)
def solve_stages(
    jets: JETS,
    rows: Rows,
    k: Constants,
    space: Space,
    N: int,
    t: float,
    y: Array,
    mode: Array,
    reg: Array,
    h: float,
    step: float,
    tol: float,
    atol: float,
    seen: Array,
) -> bool:
    """The states Y at the nodes, by Newton's method for D (Y − y) = H f(Y); whether it has settled.

    If so, the values of all rows at the nodes, from the beginning on, are in the table of
    coefficients.
    """
    n = len(y)
    m = N // 2 * len(y)
    q = (N - FIRST) // APART
    work = space.stages[2 * m + 1 :]
    inverse = space.stages[m + 1 : 2 * m + 1]
    before, now = np.inf, np.inf
    for j in range(m):
        work[STATES, j] = y[j % n] + NODES[q, j // n + 1] * step * work[RATE, j % n]
    for turn in range(MOST_CORRECTIONS):
        settled = now <= 1e-2 or (turn > 1 and now <= 1.0 and now >= 0.3 * before)
        fresh = not settled and (turn == 0 or not now <= SLOW * before)
        if not visit(jets, rows, k, space, N, t, y, mode, reg, step, atol, seen, fresh, settled):
            return False
        if settled:
            return True
        if fresh and not invert(space.stages[: m + 1], m, inverse):
            return False
        before = now
        now = correct(work, inverse, m, n, rows.noise, space.mag, h, tol, atol, seen)
        if not now < np.inf or (turn > 1 and now > 1.0 and now > 2.0 * before):
            return False
    return False


@njit(**OPTIONS)
def correct(
    work: Array,
    inverse: Array,
    m: int,
    n: int,
    noise: Array,
    mag: Array,
    h: float,
    tol: float,
    atol: float,
    seen: Array,
) -> float:
    """A step of Newton's method: the largest correction, in parts of what it may be."""
    worst = 0.0
    for j in range(m):
        change = 0.0
        r = j % n
        for i in range(m):
            change -= inverse[j, i] * work[RESIDUALS, i]
        work[STATES, j] += change
        size = LEAST + abs(work[STATES, j]) + atol * seen[r]
        share = abs(change) / (tol * size + known_to(noise, mag, work[ROUNDED], r, size, h))
        worst = max(worst, share) if share == share else np.inf
    return worst


@njit(**INLINED)
def visit(
    jets: JETS,
    rows: Rows,
    k: Constants,
    space: Space,
    N: int,
    t: float,
    y: Array,
    mode: Array,
    reg: Array,
    step: float,
    atol: float,
    seen: Array,
    fresh: bool,
    settled: bool,
) -> bool:
    """Evaluate the rows at all nodes; False if there are no rates at one of them.

    Where the states have settled, the values are kept. Before that, D (Y − y) − H f(Y) is wanted,
    and, where it is said, its derivatives anew. These are differences: they matter to how fast
    Newton's method settles, not to where. They tell as well what rounding errors of the state and
    of time make of the rates and of the guards.
    """
    s = N // 2
    n = len(y)
    m = N // 2 * len(y)
    q = (N - FIRST) // APART
    V = space.V
    rates = rows.program.rates
    work = space.stages[2 * m + 1 :]
    watched = rows.watched
    z = work[STATE]
    for i in range(s - 1, -2 if settled else -1, -1):
        for c in range(-1, n + 1 if fresh else 0):
            for r in range(n):
                z[r] = work[STATES, i * n + r] if i >= 0 else y[r]
            time = t + NODES[q, i + 1] * step
            nudge = 0.0
            around = 0.0
            if c == n:
                around = abs(time)
                nudge = NUDGE * (abs(time) + step)
                time += nudge
            elif c >= 0:
                around = abs(z[c])
                z[c] += NUDGE * (LEAST + around + abs(work[RATE, c]) * step + atol * seen[c])
                nudge = z[c] - work[STATES, i * n + c]
            if (
                jets(time, z, mode, reg, k.K, space.Rq, space.Rz, 1, V, space.A, space.B, space.mag)
                != OK
            ):
                return False
            if settled:
                for row in range(len(V)):
                    space.W[row, i + 1] = V[row, 0]
            elif c < 0:
                begin_node(work, space.stages, SLOPES[q], V, rates, watched, y, i, step, s, fresh)
            else:
                compare(
                    work,
                    space.stages,
                    V,
                    rates,
                    watched,
                    n,
                    i,
                    c,
                    step,
                    nudge,
                    n * EPSILON * around,
                )
    return True


@njit(**OPTIONS)
def begin_node(
    work: Array,
    matrix: Array,
    D: Array,
    V: Array,
    rates: Array,
    watched: Array,
    y: Array,
    i: int,
    step: float,
    s: int,
    fresh: bool,
) -> None:
    """What is wanted of a node from the values of the rows there, and room for the derivatives."""
    n = len(y)
    for r in range(n):
        place = i * n + r
        total = -step * V[rates[r], 0]
        for j in range(s):
            total += D[i, j] * (work[STATES, j * n + r] - y[r])
        work[RESIDUALS, place] = total
        for j in range(s * n if fresh else 0):
            matrix[place, j] = D[i, j // n] if j % n == r else 0.0
    for j in range(len(watched) if fresh else 0):
        work[VALUES, j] = V[rates[j] if j < n else watched[j], 0]
        if i == s - 1:
            work[ROUNDED, j] = 0.0


@njit(**OPTIONS)
def compare(
    work: Array,
    matrix: Array,
    V: Array,
    rates: Array,
    watched: Array,
    n: int,
    i: int,
    c: int,
    step: float,
    nudge: float,
    error: float,
) -> None:
    """What a change of a part of the state (or of time, behind them) makes of the rates, and an
    error of the guards."""
    for j in range(len(watched)):
        slope = (V[rates[j] if j < n else watched[j], 0] - work[VALUES, j]) / nudge
        if j < n and c < n:
            matrix[i * n + j, i * n + c] -= step * slope
        work[ROUNDED, j] = max(work[ROUNDED, j], error * abs(slope))


@njit(**OPTIONS)
def to_legendre(W: Array, s: int, n: int, terms: Array, values: Array) -> None:
    """Values of all rows at the nodes, as a first value and Legendre polynomials of the change."""
    for row in range(len(W)):
        for i in range(s + 1):
            values[i] = W[row, i] - W[row, 0]
        for j in range(1, W.shape[1]):
            W[row, j] = 0.0
        for j in range(1, s + 1):
            for i in range(1, s + 1):
                W[row, j] += terms[j, i] * values[i]


@njit(**OPTIONS)
def drop_rounding(
    W: Array, s: int, n: int, noise: Array, mag: Array, rounded: Array, h: float
) -> None:
    """Leave out what the state has behind its last term that is more than rounding: on discs it
    would become large."""
    for r in range(n):
        last = s
        size = abs(W[r, 0])
        for j in range(1, s + 1):
            size += abs(W[r, j])
        left = NOTHING * known_to(noise, mag, rounded, r, size, h)
        while last > 0 and abs(W[r, last]) <= left:
            left -= abs(W[r, last])
            W[r, last] = 0.0
            last -= 1


@njit(**OPTIONS)
def last_terms(
    W: Array,
    s: int,
    n: int,
    watched: Array,
    noise: Array,
    mag: Array,
    rounded: Array,
    h: float,
    tol: float,
    atol: float,
    seen: Array,
) -> float:
    """The last two terms of the state and of all guards, in parts of what they may be."""
    worst = 0.0
    for i in range(len(watched)):
        row = watched[i]
        size = LEAST + abs(W[row, 0])
        for j in range(1, s + 1):
            size += abs(W[row, j])
        most = tol * (size + atol * seen[i])
        if i < n:
            most += known_to(noise, mag, rounded, i, size, h)
        else:
            most += (
                ROUNDING * size
                + 16.0 * rounded[i]
                + (ROUNDING * mag[noise[i]] if noise[i] >= 0 else 0.0)
            )
        share = max(abs(W[row, s]), abs(W[row, s - 1])) / most
        worst = max(worst, share) if share == share else np.inf
    return worst


@njit(**OPTIONS)
def to_powers(W: Array, s: int, n: int, step: float, values: Array) -> None:
    """The Legendre polynomials of all rows but time in powers of a unit of time."""
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
