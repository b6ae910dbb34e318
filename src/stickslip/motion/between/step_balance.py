"""The audit of a motion: does it obey its law between the knots, too?

A step is followed again from its first state by Taylor polynomials p, which are nothing but
candidates here. The law is evaluated for them at Gauss nodes, where it uses no series, and between
the nodes it is enclosed: on a disc around the beginning of a piece [0, h] the residual r = p′ −
f(p) and every guard differ from their first values by at most B
(:mod:`stickslip.motion.steps.discs`). A function that is analytic and bounded by B inside the
ellipse with foci 0 and h and sum of half axes ρh/2 differs from its interpolant at n nodes by at
most

    2 (1 + Λ) B ρ^(1 − n)/(ρ − 1)

(L. N. Trefethen, *Approximation Theory and Approximation Practice*, theorem 8.2; Λ is the Lebesgue
constant of the nodes). Nothing is hidden between them: a pulse, however narrow, makes B large.
Pieces are halved until what may be between the nodes is negligible; where that does not succeed,
the time is noted as not verified. Stiff motion is followed by polynomials that last longer than
series (:mod:`stickslip.motion.steps.stiff`); what the law says of them is asked in the same way.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stickslip.machine_code import njit
from stickslip.motion.between.nodes import (
    COUNT,
    LEBESGUE,
    NARROW,
    NODES,
    WEIGHTS,
    WIDE,
    largest_of,
    least,
    most,
)
from stickslip.motion.engine.guards import resting
from stickslip.motion.engine.modes import copy, resolve
from stickslip.motion.engine.roots import horner
from stickslip.motion.steps.arrays import (
    DIMENSION,
    EPSILON,
    INERTIAL,
    INLINED,
    JETS,
    ON_INERTIAL,
    ON_VISCOUS,
    OPTIONS,
    POWERS,
    RATE_INDEPENDENT,
    VISCOUS,
    Constants,
    Rows,
    Space,
)
from stickslip.motion.steps.discs import spread, spread_state
from stickslip.motion.steps.step_size import LEAST, fill_powers, impulse
from stickslip.motion.steps.stiff import follow

Array = np.ndarray

NEGLIGIBLE = 1e-10  # part of its size that a quantity may have between the nodes
MOST_PIECES = 512  # of a step
# part of the velocity that forces would give to what sticks, against which it is measured
REST = 1e-4
CANCELS = 1e-5  # part of its terms against which a sum is measured in which they cancel
ROUNDINGS = 8.0  # rounding errors of a rate, in parts of the size of its terms


class Tally(NamedTuple):
    """What an audit adds up, motion by motion.

    Attributes
    ----------
    state : array, shape (4, n)
        Largest modulus of each component; by how much the terms of its rate would change it within
        a piece; largest defect of a Taylor step; largest rounding error of one.
    law : array, shape (contacts, 7)
        Largest |λ| − s (or s − |λ| where rest ends too early), |λ + σs| of what slides without
        mass, |u| in stick, −σu in slip; largest force, relative velocity, and velocity that the
        forces in stick hold back.
    kinks : array, shape (kinks, 2)
        Largest −guard and |guard|.
    total : array, shape (3,)
        Supplied energy in modulus; rounding errors of the states, summed up; time that is not
        verified.
    """

    state: Array
    law: Array
    kinks: Array
    total: Array


def make_tally(rows: Rows) -> Tally:
    """Nothing added up yet."""
    n = int(rows.sizes[DIMENSION])
    contacts = len(rows.u)
    kinks = len(rows.kinks)
    return Tally(np.zeros((4, n)), np.zeros((contacts, 7)), np.zeros((kinks, 2)), np.zeros(3))


class Steps(NamedTuple):
    """What an audit says of every step.

    Attributes
    ----------
    work : array, shape (steps, 2)
        Dissipated and supplied energy.
    gap : array, shape (steps, n)
        Bound of how far the end of a Taylor step in it is from what the equations make of its
        beginning; used up.
    noise : array, shape (steps, n)
        Rounding errors of that; used up.
    open : array, shape (steps,)
        Time that could not be enclosed.
    """

    work: Array
    gap: Array
    noise: Array
    open: Array


def make_steps(count: int, n: int) -> Steps:
    """Room for some steps."""
    return Steps(np.zeros((count, 2)), np.zeros((count, n)), np.zeros((count, n)), np.zeros(count))


@njit(**OPTIONS)
def audit_steps(
    jets: JETS,
    powers: POWERS,
    rows: Rows,
    k: Constants,
    space: Space,
    N: int,
    tol: float,
    atol: float,
    seen: Array,
    knot_time: Array,
    knot_state: Array,
    knot_mode: Array,
    knot_region: Array,
    ends: Array,
    end_state: Array,
    end_mode: Array,
    end_region: Array,
    check: bool,
    steps: Steps,
    tally: Tally,
) -> None:
    """Follow steps again, and measure them.

    Parameters
    ----------
    seen : array
        Sizes of the rows that bound the steps; see :class:`stickslip.motion.steps.arrays.Lane`.
    ends, end_state, end_mode, end_region : arrays, shapes (steps,), (steps, n), (steps, contacts)
        and (steps, kinks)
        Where each step ends, and the modes and regions that begin there.
    check : bool
        Whether more than the work is wanted.
    steps : Steps
        Zeros; receives the numbers of each step.
    tally : Tally
        Is added to.
    """
    n = rows.sizes[DIMENSION]
    nc = len(rows.u)
    W = space.W
    mode = space.touched[:nc]
    reg = space.touched[nc:]
    start = space.trial
    for i in range(len(ends)):
        left = ends[i] - knot_time[i]
        if not left > 0.0:
            continue
        copy(knot_mode[i], mode)
        copy(knot_region[i], reg)
        resolve(rows.sizes, k, space, mode)
        base = knot_time[i]
        last = 0.0
        pieces = 0
        whole = 0.0
        order = N
        h = left
        copy(knot_state[i], start)
        while left > 0.0:
            order, h, series = follow(
                jets, rows, k, space, N, base, start, mode, reg, left, last, tol, atol, seen
            )
            h = min(left, max(h, 1e-12 * left))
            between = 0.0
            if not h > 0.0:
                h = left  # nothing here is a number, which the nodes will show
            if check:
                # a closed form may last for many Taylor steps, each of which counts by itself
                if not whole > 0.0:
                    whole = h
                    count_gaps(i, steps, tally)
                longest = h
                between = enclose(rows, k, space, mode, reg, order, h, min(h, series), tally)
                while not between < np.inf and pieces < MOST_PIECES:
                    h = 0.5 * h
                    pieces = pieces + 1
                    between = enclose(rows, k, space, mode, reg, order, h, min(h, series), tally)
                if not between < np.inf:
                    h, steps.open[i] = longest, left  # no more is tried in this step
            acting = min(h, series) if series > 0.0 else h
            measure_piece(
                jets, powers, rows, k, space, order, base, h, acting, mode, reg, between,
                check, i, steps, tally,
            )  # fmt: skip
            for r in range(n):
                start[r] = horner(W[r], order, h / W[n, 1])
            base = base + h
            left = left - h
            whole = whole - h
            last = h
            pieces = pieces + 1
        if check:
            close_step(
                rows, space, mode, order, h, ends[i], knot_state[i], end_state[i], i, steps, tally
            )
            judge_departures(
                rows, space, mode, end_mode[i], reg, end_region[i], order, h, ends[i], tally
            )
            for j in range(len(rows.timed)):
                if rows.timed[j] == 1 and end_region[i, j] != reg[j]:
                    # A load that jumps at a time does work on what is at rest, too.
                    before = energy_in(
                        jets, powers, rows, k, space, ends[i], end_state[i], mode, reg
                    )
                    reg[j] = end_region[i, j]
                    jump = (
                        energy_in(jets, powers, rows, k, space, ends[i], end_state[i], mode, reg)
                        - before
                    )
                    steps.work[i, 1] += jump
                    tally.total[0] += abs(jump)


@njit(**OPTIONS)
def energy_in(
    jets: JETS,
    powers: POWERS,
    rows: Rows,
    k: Constants,
    space: Space,
    t: float,
    y: Array,
    mode: Array,
    reg: Array,
) -> float:
    """Energy of a state in given regions."""
    jets(t, y, mode, reg, k.K, space.Rq, space.Rz, 1, space.V, space.A, space.B, space.mag)
    powers(space.V, reg, k.K, space.powers)
    return float(space.powers[0])


@njit(**OPTIONS)
def enclose(
    rows: Rows,
    k: Constants,
    space: Space,
    mode: Array,
    reg: Array,
    N: int,
    h: float,
    acting: float,
    tally: Tally,
) -> float:
    """Bound the residual and all guards on a piece.

    Parameters
    ----------
    acting : float
        How long a series would last; see :func:`counts_for`.

    Returns
    -------
    float
        Factor from discs to what may be between the nodes, or infinity.

    Notes
    -----
    The discs of all rows are left in the work space.
    """
    p = rows.program
    n = rows.sizes[DIMENSION]
    powers = space.reaches
    unit = space.W[n, 1]
    fill_powers(space.powers, h / unit)
    for turn in range(2):
        radius, factor = (4.0 * h, WIDE) if turn == 0 else (2.0 * h, NARROW)
        fill_powers(powers, radius / unit)
        space.discs[n, 0] = radius
        space.discs[n, 1] = 0.0
        spread_state(space.W, N, powers, rows.watched[:n], space.discs)
        spread(
            p,
            k.K,
            space.W,
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
        for r in range(n):
            space.discs[r, 3] = slopes(space.W[r], N, powers) / unit
        if encloses(rows, space, N, h, acting, factor, tally):
            return factor
    return np.inf


@njit(**OPTIONS, fastmath={"reassoc", "contract", "nsz"})
def slopes(c: Array, N: int, powers: Array) -> float:
    """How far the derivative of a polynomial strays from its first value on a disc."""
    total = 0.0
    for k in range(2, N + 1):
        total += k * abs(c[k]) * powers[k - 1]
    return total


@njit(**OPTIONS)
def strays(disc: Array, factor: float) -> float:
    """What a row may do between the nodes."""
    return factor * disc[0] + 2.0 * (1.0 + LEBESGUE) * disc[1]


@njit(**OPTIONS)
def residual_strays(rows: Rows, discs: Array, r: int, factor: float) -> float:
    """What the residual of a part of the state may do between the nodes."""
    return strays(discs[rows.program.rates[r]], factor) + factor * discs[r, 3]


@njit(**OPTIONS)
def extent(c: Array, N: int, powers: Array) -> float:
    """Largest term of a polynomial: its size on a piece, even if it begins with zeros."""
    size = LEAST
    for k in range(N + 1):
        size = max(size, abs(c[k]) * powers[k])
    return size


@njit(**OPTIONS)
def counts_for(rows: Rows, mag: Array, r: int, size: float, h: float, acting: float) -> float:
    """For how long an error of a rate counts in a piece of length h.

    Where a polynomial lasts longer than a series, because something decays, that is as long as a
    series would last, or as the terms of the rate would take to change this part of the state by
    its size: what does not decay counts fully.
    """
    place = rows.program.rate_sizes[r]
    if place < 0 or not acting < h or not mag[place] * h > size:
        return h
    return float(max(acting, size / mag[place]))


@njit(**OPTIONS)
def encloses(
    rows: Rows, space: Space, N: int, h: float, acting: float, factor: float, tally: Tally
) -> bool:
    """Whether what may be between the nodes of a piece is negligible."""
    n = rows.sizes[DIMENSION]
    nc = len(rows.u)
    mag = space.mag
    discs = space.discs
    W = space.W
    powers = space.powers
    for r in range(n):
        size = max(extent(W[r], N, powers), tally.state[0, r])
        time = counts_for(rows, mag, r, size, h, acting)
        size += REST * impulse(rows, mag, r, acting)
        if not time * residual_strays(rows, discs, r, factor) <= NEGLIGIBLE * size:
            return False
    for c in range(nc):
        speed = (
            max(extent(W[rows.u[c]], N, powers), CANCELS * mag[c], tally.law[c, 5])
            + REST * acting * mag[nc + c]
        )
        if not strays(discs[rows.u[c]], factor) <= NEGLIGIBLE * speed:
            return False
        forces = rows.force[c], rows.plus[c], rows.minus[c]
        held = max(CANCELS * mag[2 * nc + c], tally.law[c, 4])
        for row in forces:
            held = max(held, extent(W[row], N - 1, powers))
        for row in forces:
            if not strays(discs[row], factor) <= NEGLIGIBLE * held:
                return False
    for j in range(len(rows.kinks)):
        row = rows.kinks[j]
        size = max(extent(W[row], N - 1, powers), CANCELS * mag[3 * nc + j], tally.kinks[j, 1])
        if not strays(discs[row], factor) <= NEGLIGIBLE * size:
            return False
    return True


@njit(**INLINED)
def measure_piece(
    jets: JETS,
    powers: POWERS,
    rows: Rows,
    k: Constants,
    space: Space,
    N: int,
    base: float,
    h: float,
    acting: float,
    mode: Array,
    reg: Array,
    factor: float,
    check: bool,
    i: int,
    steps: Steps,
    tally: Tally,
) -> None:
    """Evaluate the law at the nodes of a piece, and add up what was found there and what may be
    between them."""
    n = rows.sizes[DIMENSION]
    W = space.W
    V = space.V
    mag = space.mag
    y = space.y0
    power = space.powers
    sizes = rows.program.rate_sizes
    unit = W[n, 1]
    for g in range(COUNT):
        tau, weight = h * NODES[g], h * WEIGHTS[g]
        for r in range(n):
            y[r] = horner(W[r], N, tau / unit)
        jets(base + tau, y, mode, reg, k.K, space.Rq, space.Rz, 1, V, space.A, space.B, mag)
        powers(V, reg, k.K, power)
        steps.work[i, 0] += weight * power[1]
        steps.work[i, 1] += weight * power[2]
        tally.total[0] += weight * abs(power[2])
        if not check:
            continue
        for r in range(n):
            rate = V[rows.program.rates[r], 0]
            space.samples[r, g] = rate - rate_on(W[r], N, tau / unit) / unit
            tally.state[0, r] = most(tally.state[0, r], abs(y[r]))
            if sizes[r] >= 0:
                time = counts_for(rows, mag, r, tally.state[0, r], h, acting)
                steps.noise[i, r] += time * WEIGHTS[g] * ROUNDINGS * EPSILON * mag[sizes[r]]
                tally.total[1] += weight * ROUNDINGS * EPSILON * mag[sizes[r]]
            tally.state[1, r] = most(tally.state[1, r], impulse(rows, mag, r, acting))
        sample_law(rows, space, mode, reg, acting, g, tally)
    if not check:
        return
    for r in range(n):
        largest = 0.0
        for g in range(COUNT):
            largest = most(largest, abs(space.samples[r, g]))
        between = residual_strays(rows, space.discs, r, factor) if factor < np.inf else 0.0
        time = counts_for(rows, mag, r, tally.state[0, r], h, acting)
        steps.gap[i, r] += time * (LEBESGUE * largest + between)
    judge_law(rows, space, mode, factor, tally)


@njit(**OPTIONS)
def rate_on(c: Array, d: int, x: float) -> float:
    """Derivative of Σ c[k] xᵏ, k ≤ d."""
    s = 0.0
    for k in range(d, 0, -1):
        s = s * x + k * c[k]
    return s


@njit(**OPTIONS)
def sample_law(
    rows: Rows, space: Space, mode: Array, reg: Array, h: float, g: int, tally: Tally
) -> None:
    """Keep the values of all guards at a node, and the sizes of what they are made of.

    A contact has three rows: what must be nonnegative (two of them in stick), and what must vanish.
    """
    n = rows.sizes[DIMENSION]
    nc = len(rows.u)
    mq, mz = rows.sizes[ON_INERTIAL], rows.sizes[ON_VISCOUS]
    V = space.V
    mag = space.mag
    samples = space.samples
    law = tally.law
    for c in range(nc):
        u = V[rows.u[c], 0]
        held = V[rows.force[c], 0]
        up = V[rows.plus[c], 0]
        down = V[rows.minus[c], 0]
        # Where thresholds vanish, a force is known up to the rounding of its terms only.
        law[c, 4] = most(most(law[c, 4], max(abs(held), max(up, down))), CANCELS * mag[2 * nc + c])
        law[c, 5] = most(most(law[c, 5], abs(u)), CANCELS * mag[c])
        row = n + 3 * c
        if resting(mode[c]):
            samples[row, g] = held + up
            samples[row + 1, g] = down - held
            samples[row + 2, g] = u
        if abs(mode[c]) == 2:
            law[c, 6] = most(law[c, 6], mag[nc + c] * h if c < mq else mag[c])
        elif mode[c] == 0:
            matrix, place = (
                (space.Rq, rows.sizes[INERTIAL] + c)
                if c < mq
                else (space.Rz, rows.sizes[VISCOUS] + c - mq)
            )
            if c < mq + mz:
                free = mag[2 * nc + c] / abs(matrix[place, place])
                law[c, 6] = most(law[c, 6], free * h if c < mq else free)
            else:
                law[c, 6] = most(law[c, 6], mag[c])
        else:
            samples[row, g] = mode[c] * u
            samples[row + 2, g] = held + (up if mode[c] > 0 else -down)
    for j in range(len(rows.kinks)):
        value = V[rows.kinks[j], 0] if reg[j] == 1 else -V[rows.kinks[j], 0]
        samples[n + 3 * nc + j, g] = value
        tally.kinks[j, 1] = most(tally.kinks[j, 1], abs(value))


@njit(**OPTIONS)
def judge_law(rows: Rows, space: Space, mode: Array, factor: float, tally: Tally) -> None:
    """By how much guards fail on a piece, at the nodes and between them."""
    n = rows.sizes[DIMENSION]
    nc = len(rows.u)
    mag = space.mag
    discs = space.discs
    samples = space.samples
    law = tally.law
    for c in range(nc):
        row = n + 3 * c
        loose = 0.0
        tight = 0.0
        rounding = 64.0 * EPSILON * mag[c]
        unsure = 64.0 * EPSILON * mag[2 * nc + c]
        if factor < np.inf:
            loose = strays(discs[rows.force[c]], factor)
            loose += max(strays(discs[rows.plus[c]], factor), strays(discs[rows.minus[c]], factor))
            tight = strays(discs[rows.u[c]], factor)
        if resting(mode[c]):
            for part in range(2):
                low = least(samples[row + part], space.bernstein, 1e-2 * NEGLIGIBLE * law[c, 4])
                law[c, 0] = most(law[c, 0], loose - low - unsure)
            law[c, 2] = most(law[c, 2], largest_of(samples[row + 2]) + tight - rounding)
        else:
            law[c, 3] = most(
                law[c, 3], tight - rounding - least(samples[row], space.bernstein, rounding)
            )
            if c >= rows.sizes[ON_INERTIAL] + rows.sizes[ON_VISCOUS]:
                law[c, 1] = most(law[c, 1], largest_of(samples[row + 2]) + loose - unsure)
    for j in range(len(rows.kinks)):
        between = strays(discs[rows.kinks[j]], factor) if factor < np.inf else 0.0
        negligible = 1e-2 * NEGLIGIBLE * tally.kinks[j, 1]
        low = least(samples[n + 3 * nc + j], space.bernstein, negligible)
        tally.kinks[j, 0] = most(tally.kinks[j, 0], between - low)


@njit(**OPTIONS)
def judge_departures(
    rows: Rows,
    space: Space,
    mode: Array,
    next_mode: Array,
    reg: Array,
    next_reg: Array,
    order: int,
    h: float,
    t: float,
    tally: Tally,
) -> None:
    """By how much a contact whose sliding force is below its threshold leaves rest before that is
    reached.

    The friction law alone would allow it: the stated rule is that what can stick sticks. Of several
    that leave together one has reached its threshold; what they carry at rest has to hold all it
    can. Where regions change, or a contact comes to rest, forces may jump, and nothing is asked.
    """
    W = space.W
    law = tally.law
    nc = len(mode)
    drops = rows.drops
    x = h / W[rows.sizes[DIMENSION], 1]
    late = 0.5 * EPSILON * abs(t) / W[rows.sizes[DIMENSION], 1]
    leaves = False
    for c in range(nc):
        if not resting(mode[c]) and mode[c] != next_mode[c]:
            return
        leaves = leaves or (drops[c] == 1 and resting(mode[c]) and not resting(next_mode[c]))
    for j in range(len(reg)):
        if reg[j] != next_reg[j]:
            return
    if not leaves:
        return
    least = np.inf
    first = -1
    for c in range(nc):
        held = W[rows.force[c]]
        up = W[rows.plus[c]]
        down = W[rows.minus[c]]
        force = horner(held, order - 1, x)
        room = min(force + horner(up, order - 1, x), horner(down, order - 1, x) - force)
        room -= 64.0 * EPSILON * space.mag[2 * nc + c] + late * (
            abs(rate_on(held, order - 1, x))
            + abs(rate_on(up, order - 1, x))
            + abs(rate_on(down, order - 1, x))
        )
        if resting(mode[c]):
            if not resting(next_mode[c]) and room < least:
                least, first = room, c
        elif (
            drops[c] == 1
            and abs(horner(W[rows.u[c]], order - 1, x)) <= 64.0 * EPSILON * space.mag[c]
        ):
            law[c, 0] = most(law[c, 0], room)
    if first >= 0:
        law[first, 0] = most(law[first, 0], least)


@njit(**OPTIONS)
def close_step(
    rows: Rows,
    space: Space,
    mode: Array,
    N: int,
    h: float,
    t: float,
    first: Array,
    end: Array,
    i: int,
    steps: Steps,
    tally: Tally,
) -> None:
    """Compare the end of a step, at a time t, with where its pieces have arrived (the last is still
    in the work space).

    A time is a rounded number: an end that the motion passes within half a digit of it is right.
    """
    nq = rows.sizes[INERTIAL]
    nz = rows.sizes[VISCOUS]
    nr = rows.sizes[RATE_INDEPENDENT]
    mq = rows.sizes[ON_INERTIAL]
    mz = rows.sizes[ON_VISCOUS]
    W = space.W
    unit = W[rows.sizes[DIMENSION], 1]
    late = 0.5 * EPSILON * abs(t)
    for r in range(len(first)):
        off = abs(end[r] - space.trial[r]) - late * abs(rate_on(W[r], N, h / unit)) / unit
        if 2 * nq + nz <= r < 2 * nq + nz + nr:
            # What slides without viscosity is put back onto λ + σ s = 0, where forces are known to
            # rounding only; near a fold, where its stiffness vanishes, that moves it. The friction
            # law sees the forces themselves.
            for j in range(nr):
                c = mq + mz + j
                if mode[c] != 0:
                    off -= (
                        64.0
                        * EPSILON
                        * abs(space.B[r - 2 * nq - nz, j])
                        * space.mag[2 * len(mode) + c]
                    )
        steps.gap[i, r] += max(off, 0.0) if off == off else np.inf
        tally.state[0, r] = most(most(tally.state[0, r], abs(first[r])), abs(end[r]))
    count_gaps(i, steps, tally)
    tally.total[2] += steps.open[i]


@njit(**OPTIONS)
def count_gaps(i: int, steps: Steps, tally: Tally) -> None:
    """Keep the gap and the rounding errors of a Taylor step, and begin the next with none."""
    for r in range(steps.gap.shape[1]):
        tally.state[2, r] = most(tally.state[2, r], steps.gap[i, r])
        tally.state[3, r] = most(tally.state[3, r], steps.noise[i, r])
        steps.gap[i, r], steps.noise[i, r] = 0.0, 0.0


@njit(**OPTIONS)
def judge(
    rows: Rows, tally: Tally, imbalance: float, flow: float, energy: float, residuals: Array
) -> None:
    """Residuals of a motion, relative to sizes that do not vanish where something sticks.

    Parameters
    ----------
    imbalance : float
        Largest violation of the energy balance.
    flow, energy : float
        Energy that flows, and the largest modulus of the energy.
    residuals : array, shape (4,)
        Receives the residual of the energy balance, the violation of the friction law, the defect
        of the equations of motion, and the audit's own rounding errors.
    """
    state = tally.state
    law = tally.law
    n = rows.sizes[DIMENSION]
    force = 0.0
    reach_ = 0.0
    violation = 0.0
    defect = 0.0
    own = 0.0
    for c in range(len(law)):
        force = most(force, law[c, 4])
        speed = max(law[c, 5], REST * law[c, 6])
        violation = most(violation, relative(max(law[c, 0], law[c, 1]), law[c, 4]))
        violation = most(violation, relative(max(law[c, 2], law[c, 3]), speed))
    for j in range(len(tally.kinks)):
        violation = most(violation, relative(tally.kinks[j, 0], tally.kinks[j, 1]))
    for r in range(n):
        size = max(state[0, r], REST * state[1, r])
        defect = most(defect, relative(state[2, r], size))
        own = most(own, relative(state[3, r], size))
        reach_ = max(reach_, state[0, r])
    # The energy itself is known to rounding only: where next to nothing flows, that is the scale.
    scale = max(flow, 1e-6 * energy, 1e-6 * force * reach_)
    residuals[0] = relative(max(imbalance - force * tally.total[1], 0.0), scale)
    residuals[1] = violation
    residuals[2] = defect
    residuals[3] = own


@njit(**OPTIONS)
def relative(value: float, size: float) -> float:
    """A violation relative to a size; nothing relative to nothing is nothing."""
    if value <= 0.0:
        return 0.0
    return value / size if size > 0.0 else np.inf
