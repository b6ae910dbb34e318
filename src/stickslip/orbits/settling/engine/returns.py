"""Returns of a motion to its marks: their distance, their lag, and their extrapolation, in compiled
code.

Marks are states recorded at events or after periods of the drive; the last ones are stored in a
ring buffer. A *return* is the difference between two marks that are one *lag* apart, a number of
marks. While returns shrink, the lag is the one for which the most consecutive marks have repeated
their kinds; otherwise it is the smallest one whose return is nearly the closest. The period does
not depend on the lag: it is determined from the divisors of the lag once the cycle is accurate to
machine precision (:func:`shortest_lag`).

True returns (without extrapolation between their marks) shrink by the multipliers of the cycle. If
few multipliers matter, each return is a linear combination of the previous ones, and the same
combination of the states is the cycle (Anderson 1965; Sidi, *Vector Extrapolation Methods*, 2017).
The weights add up to 1, so that linear invariants (such as the position of a sticking contact) are
preserved.
"""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.algebra.vectors import copy
from stickslip.orbits.settling.engine.tables import (
    COUNT,
    FLOOR,
    LAG,
    LEAPT,
    LEAST,
    OPEN,
    PATIENT,
    SAME,
    SIZED,
    STALLED,
    STRETCH,
    TRUE,
    Marks,
    Rules,
)
from stickslip.translator import compiled

_SURE = 1e-4  # fraction of the tolerance: a smaller miss is accepted without a rate of convergence
_SHRUNK = 0.98  # fraction of the smallest miss below which a return counts as closer
RETURN_PATIENCE = 16  # number of returns without a closer one after which the search ends
_CLOSED = 1e-11  # largest miss of a return that closes the cycle …
_TOLD_APART = 1e3  # … or as a multiple of the miss of the cycle
_DOUBLED = 10.0  # … or of the distance to the cycle, which is much larger near a period doubling
_EXACT = 1e-15  # a miss that is regarded as zero
_FINEST = 1e-3  # fraction of the tolerance `atol` for a polished cycle
# a vector whose remainder after projection on others is a smaller fraction depends on them
_DEPENDENT = 1e-7
MOST_RETURNS = 3  # largest number of returns that are combined
_FORETOLD = 0.25  # largest error of the recurrence of previous returns, as a fraction of a return
_WORTH = 24.0  # number of returns for which waiting is cheaper than a proof of the limit


@compiled()
def remove_shift(v: Array, shifts: Array) -> None:
    """Subtract from a vector its components along translations, which are orthogonal to each
    other."""
    for j in range(len(shifts)):
        along, size = 0.0, 0.0
        for i in range(len(v)):
            along += shifts[j, i] * v[i]
            size += shifts[j, i] ** 2
        if size > 0.0:
            for i in range(len(v)):
                v[i] -= along / size * shifts[j, i]


@compiled()
def remove_cells(v: Array, m: Marks, rules: Rules, i: int) -> None:
    """Subtract translations and integer multiples of cells from a difference of states, or from a
    state.

    Parameters
    ----------
    v : array, shape (n,)
    i : int
        The lane.
    """
    remove_shift(v, rules.shifts)
    for j in range(m.cells.shape[1]):
        parts = 0.0
        for r in range(len(v)):
            parts += m.cells[i, j, 1, r] * v[r]
        whole = math.floor(parts + 0.5)
        if whole != 0.0:
            for r in range(len(v)):
                v[r] -= whole * m.cells[i, j, 0, r]


@compiled()
def gap(m: Marks, rules: Rules, i: int, j: int, t: float, y: Array, out: Array) -> None:
    """Difference of a state and a mark, without the motion of the frame, translations and cells.

    Parameters
    ----------
    i, j : int
        The lane, and the position of the mark in the ring buffer.
    t, y : float and array, shape (n,)
        Time and state.
    out : array, shape (n,)
        Receives the difference.
    """
    for r in range(len(y)):
        out[r] = y[r] - m.state[i, j, r] - m.frame[i, r] * (t - m.time[i, j])
    remove_cells(out, m, rules, i)


@compiled()
def miss(v: Array, size: Array, atol: float) -> float:
    """Largest component of a difference, relative to the size of this component; `atol` is
    subtracted first."""
    worst = 0.0
    for r in range(len(v)):
        excess = abs(v[r]) - atol
        if excess > 0.0:
            worst = max(worst, excess / size[r])
    return worst


@compiled()
def grow(m: Marks, rules: Rules, i: int, t: float, y: Array, work: Array) -> None:
    """Update the largest modulus of every component, as long as the size of the cycle has not been
    measured.

    Parameters
    ----------
    t, y : float and array, shape (n,)
        Time and state.
    work : array, shape (n,)
        Work space.
    """
    if m.numbers[i, SIZED] == 1:
        return
    for r in range(len(y)):
        work[r] = y[r] - m.frame[i, r] * (t - rules.real[0])
    remove_cells(work, m, rules, i)
    for r in range(len(y)):
        m.size[i, r] = max(m.size[i, r], abs(work[r]))


@compiled()
def remember(m: Marks, i: int, kind: int, word: int, t: float, y: Array) -> None:
    """Append a mark.

    Parameters
    ----------
    i : int
        The lane.
    kind, word : int
        Kind of the mark (only marks of one kind are compared), and a hash of the modes since the
        previous mark.
    t, y : float and array, shape (n,)
        Time and state.
    """
    numbers = m.numbers[i]
    here = m.numbers[i, COUNT] % m.time.shape[1]
    m.time[i, here] = t
    m.kind[i, here] = kind
    m.word[i, here] = word
    copy(y, m.state[i, here])
    numbers[COUNT] += 1
    numbers[TRUE] += 1


@compiled()
def begin_again(m: Marks, i: int, lag: int) -> None:
    """Start the comparison of returns over a new lag."""
    m.numbers[i, LAG] = lag
    m.numbers[i, SAME] = 0
    m.numbers[i, STALLED] = 0
    m.real[i, LEAST] = np.inf


@compiled()
def distance(m: Marks, rules: Rules, i: int, back: int, work: Array) -> float:
    """Distance of the last mark from an earlier one.

    Parameters
    ----------
    i, back : int
        The lane, and the number of marks between the two.
    work : array, shape (n,)
        Receives the difference.
    """
    here = m.numbers[i, COUNT] - 1
    ring = m.time.shape[1]
    gap(
        m,
        rules,
        i,
        (here - back) % ring,
        m.time[i, here % ring],
        m.state[i, here % ring],
        work,
    )
    return miss(work, m.size[i], rules.real[4] * (_FINEST if m.numbers[i, LEAPT] > 0 else 1.0))


@compiled()
def same_kind(m: Marks, i: int, back: int) -> bool:
    """Return whether the last mark has the same kind as the mark `back` marks before it."""
    here = m.numbers[i, COUNT] - 1
    ring = m.time.shape[1]
    return m.kind[i, (here - back) % ring] == m.kind[i, here % ring]


@compiled()
def best_lag(m: Marks, i: int, longest: int) -> int:
    """The smallest lag for which the kinds of the most consecutive last marks have repeated; 0 if
    the kind of the last mark has not occurred before. (The last mark alone does not determine the
    lag if a kind occurs twice in a cycle.)"""
    here = m.numbers[i, COUNT] - 1
    ring = m.time.shape[1]
    kind = m.kind[i]
    found = most = 0
    for lag in range(1, longest + 1):
        limit = min(here + 1, ring) - lag
        run = 0
        while run < limit and kind[(here - run) % ring] == kind[(here - run - lag) % ring]:
            run += 1
        if run > most:
            found, most = lag, run
    return found


@compiled()
def compare_with_lag(m: Marks, rules: Rules, i: int, work: Array) -> float:
    """Distance of the last mark from the mark one lag before it; infinite if there is no such mark.
    The lag is updated if necessary."""
    numbers = m.numbers[i]
    real = m.real[i]
    ring = m.time.shape[1]
    longest = min(numbers[COUNT] - 1, rules.most[3])
    if not (0 < numbers[LAG] <= longest and same_kind(m, i, numbers[LAG])):
        begin_again(m, i, best_lag(m, i, longest))
    lag = numbers[LAG]
    if lag == 0:
        return np.inf
    d = distance(m, rules, i, lag, work)
    m.miss[i, (numbers[COUNT] - 1) % ring] = d
    if numbers[TRUE] >= lag:
        numbers[SAME] += 1
        numbers[STALLED] += 1
        if d < _SHRUNK * real[LEAST]:
            real[LEAST] = d
            numbers[STALLED] = 0
    return d


@compiled()
def shorten_lag(m: Marks, rules: Rules, i: int, work: Array) -> None:
    """Use the shortest lag whose return is nearly the closest. Called if returns have not become
    smaller for some time."""
    numbers = m.numbers[i]
    best = np.inf
    lag = 0
    for back in range(1, min(numbers[COUNT] - 1, rules.most[3]) + 1):
        if same_kind(m, i, back):
            d = distance(m, rules, i, back, work)
            if d < 0.5 * best:
                best, lag = d, back
    if lag != numbers[LAG]:
        begin_again(m, i, lag)
    m.real[i, LEAST] = best
    numbers[STALLED] = 0


@compiled()
def has_settled(m: Marks, rules: Rules, i: int, d: float) -> bool:
    """Return whether the estimated remaining distance to the cycle, d + d q + d q² + …, is below
    the tolerance. The rate of convergence q is that of the last one to three returns."""
    numbers = m.numbers[i]
    ring = m.time.shape[1]
    if numbers[SAME] < 1 or d > m.real[i, PATIENT]:
        return False
    lag = numbers[LAG]
    returns = min(3, (numbers[SAME] - 1) // lag)
    q = 0.0
    if returns > 0:
        before = m.miss[i, (numbers[COUNT] - 1 - returns * lag) % ring]
        q = (d / before) ** (1.0 / returns) if before > 0.0 else 0.0
    m.real[i, STRETCH] = 1.0 / (1.0 - q) if q < 1.0 else 1.0
    if d <= _SURE * rules.real[3]:
        return True
    return returns > 0 and q < 1.0 and d <= (1.0 - q) * rules.real[3]


@compiled()
def extrapolate(
    m: Marks, rules: Rules, i: int, k: int, work: Array, fit: Array
) -> tuple[float, float]:
    """Extrapolate the limit of the last k + 1 returns.

    With the returns r₀ (the last one), r₁, …, the weights c minimise |r₀ − Σ cⱼ (r₀ − rⱼ₊₁)| over
    the components that change, relative to their sizes (QR factorisation by Gram-Schmidt). The step
    from the last state y₀ to the limit is −Σ cⱼ (y₀ − yⱼ₊₁), with the mark yⱼ j lags before y₀.

    Parameters
    ----------
    i, k : int
        The lane, and the number of returns before the last, at most 3.
    work, fit : arrays, shapes (9, n), (4, 4)
        Work space.

    Returns
    -------
    misfit, length
        Relative residual of the minimisation, and length of the step, which is stored in
        ``work[8]``.
    """
    lag = m.numbers[i, LAG]
    here = m.numbers[i, COUNT] - 1
    ring = m.time.shape[1]
    n = work.shape[1]
    t = m.time[i, here % ring]
    y = m.state[i, here % ring]
    size = m.size[i]
    for j in range(k + 1):
        gap(m, rules, i, (here - (j + 1) * lag) % ring, t, y, work[j])
    for r in range(n):
        largest = 0.0
        for j in range(k + 1):
            largest = max(largest, abs(work[j, r]))
        weight = 1.0 / size[r] if largest > _FINEST * rules.real[4] else 0.0
        work[7, r] = weight * work[0, r]
        for j in range(k):
            work[4 + j, r] = weight * (work[0, r] - (work[j + 1, r] - work[j, r]))
    whole = norm(work[7])
    for a in range(k):
        column = work[4 + a]
        before = norm(column)
        for b in range(a):
            fit[b, a] = remove_part(column, work[4 + b])
        left = norm(column)
        fit[a, a] = left if left > _DEPENDENT * before else 0.0
        for r in range(n):
            column[r] = column[r] / left if fit[a, a] > 0.0 else 0.0
        fit[a, 3] = remove_part(work[7], column)
    misfit = norm(work[7]) / whole if whole > 0.0 else 0.0
    for a in range(k - 1, -1, -1):
        for b in range(a + 1, k):
            fit[a, 3] -= fit[a, b] * fit[b, 3]
        fit[a, 3] = fit[a, 3] / fit[a, a] if fit[a, a] > 0.0 else 0.0
    for r in range(n):
        work[8, r] = 0.0
        for j in range(k):
            work[8, r] -= fit[j, 3] * work[j, r]
    return misfit, miss(work[8], size, 0.0)


@compiled()
def equal_sequences(m: Marks, i: int, lag: int, most: int) -> int:
    """Number of consecutive last marks, at most `most`, whose mode sequence is the same as that of
    the mark one lag before."""
    here = m.numbers[i, COUNT] - 1
    ring = m.time.shape[1]
    most = min(most, ring - 1 - lag, here - lag)
    same = 0
    while same < most and m.word[i, (here - same) % ring] == m.word[i, (here - same - lag) % ring]:
        same += 1
    return same


@compiled()
def recurrence_order(m: Marks, rules: Rules, i: int, work: Array, fit: Array) -> int:
    """The order of a convergent linear recurrence of the returns that predicts the last one.

    Returns near a cycle are sums of powers of its multipliers and satisfy a linear recurrence rⱼ =
    Σ cₖ rⱼ₊ₖ, counted back from the last return r₀. It is fitted to all returns except the last, by
    least squares relative to their sizes. It is accepted if it predicts r₀ and all its roots are
    within the unit circle, so that it converges.

    Parameters
    ----------
    work, fit : arrays, shapes (9, n), (4, 4)
        Work space.

    Returns
    -------
    int
        The order; 0 if there is no such recurrence, or if the motion converges within a few
        returns.
    """
    lag = m.numbers[i, LAG]
    here = m.numbers[i, COUNT] - 1
    ring = m.time.shape[1]
    n = work.shape[1]
    known = min(m.numbers[i, TRUE] // lag, (ring - 1) // lag, len(work))
    known = min(known, 1 + equal_sequences(m, i, lag, (known - 1) * lag) // lag)
    if known < 3:
        return 0
    for j in range(known):
        late = (here - j * lag) % ring
        gap(
            m,
            rules,
            i,
            (here - (j + 1) * lag) % ring,
            m.time[i, late],
            m.state[i, late],
            work[j],
        )
        for r in range(n):
            work[j, r] = work[j, r] / m.size[i, r] if m.size[i, r] > 0.0 else 0.0
    last = largest_component(work[0])
    first = largest_component(work[known - 1])
    if not 0.0 < last < _SHRUNK * first:
        return 0
    rate = math.log(first / last) / (known - 1)
    if math.log(last / rules.real[3]) < _WORTH * rate:
        return 0
    for k in range(1, min(MOST_RETURNS, n, (known - 1) // 2) + 1):
        fit_recurrence(work, known, k, fit)
        wrong = 0.0
        for r in range(n):
            guess = 0.0
            for a in range(k):
                guess += fit[a, 3] * work[a + 1, r]
            wrong = max(wrong, abs(guess - work[0, r]))
        if wrong <= _FORETOLD * last and converges_to_zero(fit, k):
            return k
    return 0


@compiled()
def largest_component(v: Array) -> float:
    """Largest modulus of a component; infinite if a component is NaN."""
    size = 0.0
    for r in range(len(v)):
        size = max(size, abs(v[r])) if abs(v[r]) < np.inf else np.inf
    return size


@compiled()
def fit_recurrence(work: Array, known: int, k: int, fit: Array) -> None:
    """Fit a recurrence of order k to all returns except the last, by Givens rotations.

    Parameters
    ----------
    work : array, shape (·, n)
        The returns, the last one first.
    known, k : int
        Number of returns, and order.
    fit : array, shape (4, 4)
        Receives the coefficients, in its last column.
    """
    for a in range(4):
        for b in range(4):
            fit[a, b] = 0.0
    row = fit[3]
    for j in range(1, known - k):
        size = largest_component(work[j])
        for r in range(work.shape[1]):
            for a in range(k):
                row[a] = work[j + 1 + a, r] / size if size > 0.0 else 0.0
            row[3] = work[j, r] / size if size > 0.0 else 0.0
            for a in range(k):
                radius = math.hypot(fit[a, a], row[a])
                if row[a] != 0.0:
                    turn = row[a] / radius
                    keep = fit[a, a] / radius
                    for b in range(a, 4):
                        above = fit[a, b]
                        fit[a, b] = keep * above + turn * row[b]
                        row[b] = keep * row[b] - turn * above
    scale = abs(fit[0, 0])
    for a in range(k - 1, -1, -1):
        for b in range(a + 1, k):
            fit[a, 3] -= fit[a, b] * fit[b, 3]
        fit[a, 3] = fit[a, 3] / fit[a, a] if abs(fit[a, a]) > _DEPENDENT * scale else 0.0


@compiled()
def converges_to_zero(fit: Array, k: int) -> bool:
    """Return whether all roots of zᵏ − Σ c_a zᵏ⁻ᵃ are within the unit circle (Schur and Cohn).

    Parameters
    ----------
    fit : array, shape (4, 4)
        Coefficients in the last column; the last row is work space.
    k : int
        At most 3.
    """
    a = fit[3]
    for j in range(k):
        a[j] = -fit[j, 3]
    for degree in range(k, 0, -1):
        end = a[degree - 1]
        if not abs(end) < 1.0:
            return False
        for j in range(degree // 2):
            low = a[j]
            high = a[degree - 2 - j]
            a[j] = (low - end * high) / (1.0 - end * end)
            a[degree - 2 - j] = (high - end * low) / (1.0 - end * end)
    return True


@compiled()
def norm(v: Array) -> float:
    """Euclidean norm."""
    total = 0.0
    for r in range(len(v)):
        total += v[r] * v[r]
    return math.sqrt(total)


@compiled()
def remove_part(v: Array, unit: Array) -> float:
    """Subtract from a vector its component along a unit vector; return this component."""
    part = 0.0
    for r in range(len(v)):
        part += unit[r] * v[r]
    for r in range(len(v)):
        v[r] -= part * unit[r]
    return part


@compiled()
def distinct_above(m: Marks, i: int) -> float:
    """Distance above which two states are different, derived from the closure error of the polished
    cycle, a measure of its accuracy."""
    floor = m.real[i, FLOOR]
    return max(_CLOSED, _TOLD_APART * floor, _DOUBLED * m.real[i, STRETCH] * max(floor, _EXACT))


@compiled()
def shortest_lag(m: Marks, rules: Rules, i: int, work: Array) -> int:
    """The smallest divisor of the lag after which the polished cycle closes as well."""
    lag = m.numbers[i, LAG]
    limit = distinct_above(m, i)
    p = 2
    m.real[i, OPEN] = np.inf
    while p <= lag:
        d = (
            distance(m, rules, i, lag // p, work)
            if lag % p == 0 and same_kind(m, i, lag // p)
            else np.inf
        )
        if d <= limit:
            lag //= p
        else:
            m.real[i, OPEN] = min(d, m.real[i, OPEN])
            p += 1
    return lag
