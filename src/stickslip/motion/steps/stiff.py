"""Detection of stiff motion: the step size is limited by decaying components, not by the motion.

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
  (:mod:`stickslip.motion.discs`) by some B, so that they differ from their interpolants by at
  most

      2 (1 + Λₛ) B ρ^(1 − s)/(ρ − 1),  ρ = 3 + √8,

  where Λₛ is the Lebesgue constant of the nodes; see :mod:`stickslip.motion.audit.between_nodes`.
  What is hidden in a rate counts for as long as a series would last: what came before has decayed;
* it spares as many series as it costs.
"""

from __future__ import annotations

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.discs.spreading import spread, spread_state
from stickslip.motion.discs.tables import BALL, OFF
from stickslip.motion.steps.arrays import (
    AIM_SPEED,
    CAUSE,
    DIMENSION,
    IMPLICIT,
    MOST_IMPLICIT,
    Flow,
    Instant,
    Lane,
    Machine,
    tape_of,
)
from stickslip.motion.steps.directions import spread_given
from stickslip.motion.steps.radau import (
    HIDDEN_PARTS,
    TERMS,
    drop_rounding,
    last_terms,
    solve_stages,
    stages_of,
    tables_of,
    to_legendre,
    to_powers,
)
from stickslip.motion.steps.response import begins_in
from stickslip.motion.steps.sets import slip_speed
from stickslip.motion.steps.step_size import (
    LEAST_SIZE,
    expand,
    fill_powers,
    hidden,
    impulse,
    slip_end,
    step_size,
)
from stickslip.numerics.levels import EPSILON, INSTANT
from stickslip.translator import compiled

_AT_THE_END = 1e-3  # fraction of a step that ends a slip: distance to its end regarded as close
# factor on the tolerances when a motion is recomputed, relative to those that found it
_COARSER = 1e3
_CALM = 1e5  # terms of a third of the order, in tolerances, for which decay limits a step
# terms that are zero by symmetry, in rounding errors of the forces during a series; a larger stiff
# oscillation is a motion
_LOST = 16.0
_TURNS = 30.0  # radians of an oscillation that a polynomial of a step cannot represent
WATCHED = 32  # number of such steps in succession before a polynomial is tried
RESTING = 2048  # number of steps after a polynomial that did not repay its cost
_MOST_TRIES = 12  # largest number of lengths of a polynomial


@compiled()
def cost_in_series(n: int) -> float:
    """Cost of an implicit step (evaluations at all nodes, and an elimination), in numbers of Taylor
    steps."""
    return 16.0 + 4.0 * n * n


@compiled()
def vanishing(flow: Flow, r: int, h: float, tol: float, atol: float, seen: Array) -> float:
    """Terms of a part of the state that vanish: well above tolerances and rounding errors, and well
    below its size.

    Parameters
    ----------
    flow : Flow
        With the series.
    r : int
        Part of the state.
    h : float
        How long the series is good for.
    tol, atol : float
        Local tolerances, as in :class:`stickslip.motion.steps.arrays.Flow`.
    seen : array
        Largest modulus so far of each row that bounds the steps.
    """
    W, mag = flow.space.W, flow.space.mag
    x = h / W[flow.rows.sizes[DIMENSION], 1]
    size = abs(W[r, 0]) + abs(W[r, 1]) * x + atol * seen[r]
    # A component that stays zero by symmetry has the rounding errors of the forces, which decay at
    # all rates.
    return float(_CALM * tol * size + _LOST * EPSILON * impulse(flow.rows, mag, r, h))


@compiled()
def is_stability_limited(flow: Flow, h: float, tol: float, atol: float, seen: Array) -> bool:
    """Whether a series converges to within its tolerance at a third of its order: the step is then
    limited by the stability of decaying components, not by accuracy.

    Parameters
    ----------
    flow, h, tol, atol, seen
        As of :func:`vanishing`.
    """
    W = flow.space.W
    n = flow.rows.sizes[DIMENSION]
    m = flow.order // 3
    x = h / W[n, 1]
    power = x**m
    for r in range(n):
        size = vanishing(flow, r, h, tol, atol, seen)
        if not (abs(W[r, m]) * power <= size and abs(W[r, m + 1]) * power * x <= size):
            return False
    return True


@compiled()
def oscillates(flow: Flow, h: float, step: float, tol: float, atol: float, seen: Array) -> bool:
    """Whether a stability-limited motion oscillates too fast in a step for one polynomial: its
    terms are those of an oscillation, x‴ = −ω²x′, with a large ω times the step.

    Parameters
    ----------
    flow, h, tol, atol, seen
        As in :func:`vanishing`.
    step : float
        Length of the polynomial.
    """
    W = flow.space.W
    n = flow.rows.sizes[DIMENSION]
    x = h / W[n, 1]
    for r in range(n):
        slope, bend = abs(W[r, 1]) * x, abs(W[r, 3]) * x * x * x
        known = vanishing(flow, r, h, tol, atol, seen)
        if bend > known and 6.0 * bend * step * step > _TURNS * _TURNS * slope * h * h:
            return True
    return False


@compiled()
def is_implicit_due(flow: Flow, lane: Lane, h: float, room: float) -> bool:
    """Whether to try an implicit step instead of the series in the table; sets its length.

    Parameters
    ----------
    h, room : float
        How long the series is good for, and most that is wanted.
    """
    clock = lane.clock
    n = len(lane.y)
    if n > MOST_IMPLICIT or not cost_in_series(n) * h < room:
        return False
    settled = lane.counters[CAUSE] < 0 and is_stability_limited(
        flow, h, flow.tol, flow.atol, lane.seen
    )
    if not settled:
        clock[IMPLICIT] = min(clock[IMPLICIT], -WATCHED)
        return False
    if clock[IMPLICIT] < 0.0:
        clock[IMPLICIT] += 1.0
        return False
    if clock[IMPLICIT] == 0.0:
        clock[IMPLICIT] = 4.0 * cost_in_series(n) * h
    clock[IMPLICIT] = min(clock[IMPLICIT], room)
    return True


@compiled()
def follow_mode(
    machine: Machine, flow: Flow, start: Instant, room: float, last: float, seen: Array
) -> tuple[int, float, float]:
    """A polynomial that follows a known motion in a mode: its series, or one that is good for
    longer.

    Parameters
    ----------
    room, last : float
        Most that is wanted, and the length of the piece before (0: it is the first).
    seen : array
        Sizes of the rows that bound the steps; see :class:`stickslip.motion.steps.arrays.Lane`.

    Returns
    -------
    order, step, series
        Order up to which the coefficients are finite, the step for which they are good, and that of
        the series.
    """
    N = flow.order
    n = flow.rows.sizes[DIMENSION]
    # When a step is continued, finer steps may only damp the rounding errors at the end of its last
    # piece.
    coarser = _COARSER if last > 0.0 else 1.0
    tol, atol = coarser * flow.tol, coarser * flow.atol
    before = last
    step = -1.0
    while True:
        order, h = expand(machine, flow, start, room, before, seen)
        if order == N and h < room and touches_rest(flow, start, room, seen):
            return order, room, room
        least = cost_in_series(n) * h
        if before > least:
            # the previous piece was not a series, whose length would bound the change in one step
            before = h
            continue
        if step == 0.0 or not (
            order == N
            and n <= MOST_IMPLICIT
            and 0.0 < least < room
            and is_stability_limited(flow, h, tol, atol, seen)
            and not oscillates(flow, h, least, tol, atol, seen)
        ):
            return order, h, h
        first = room if last == 0.0 else min(room, max(2.0 * last, 4.0 * least))
        step, _ = collocate(machine, flow, start, h, first, seen)
        if step > 0.0:
            return order, step, h


@compiled()
def touches_rest(flow: Flow, start: Instant, room: float, seen: Array) -> bool:
    """Whether a slip in a plane begins or ends with a step, and the series is accurate in all of
    it, as in the original computation. Shorter steps would approach the end only slowly, and leave
    the beginning slowly, because decay is fast while the slip is slow.

    Parameters
    ----------
    flow : Flow
        With the series in its work space, and the finer tolerances of :func:`follow_mode`.
    room : float
        What is left of the step.
    seen : array
        As in :func:`follow_mode`.
    """
    rows = flow.rows
    W = flow.space.W
    unit = W[rows.sizes[DIMENSION], 1]
    touches = False
    for p in range(len(rows.planes)):
        if slip_speed(rows, start.mode, W, p) > 0.0:
            end, _ = slip_end(W[rows.planes[p, AIM_SPEED]], flow.order, 2.0 * room / unit)
            near = _AT_THE_END * room + INSTANT * abs(start.t)
            touches = touches or abs(end * unit - room) <= near
        else:
            touches = touches or begins_in(flow, p)
    if not touches:
        return False
    tol, atol = _COARSER * flow.tol, _COARSER * flow.atol
    known = Flow(rows, flow.k, flow.space, flow.order, tol, atol, flow.supports)
    return step_size(known, start.mode, flow.order, seen, room) >= room


@compiled()
def ends_there(h: float, left: float, base: float) -> bool:
    """Whether a polynomial that is accurate for a time h is used up to the end of a step: the
    remaining time cannot be resolved.

    Parameters
    ----------
    h, left : float
        How long it is good for, and what is left of the step.
    base : float
        The time at which it begins.
    """
    return bool(h < left <= 2.0 * h and left - h <= INSTANT * abs(base))


@compiled()
def collocate(
    machine: Machine, flow: Flow, start: Instant, h: float, first: float, seen: Array
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
    W = flow.space.W
    n = flow.rows.sizes[DIMENSION]
    s = flow.order // 2
    stages = stages_of(flow)
    step = first
    cut = False
    for r in range(n):
        stages.rate[r] = W[r, 1] / W[n, 1]
    for _ in range(_MOST_TRIES):
        if not step >= cost_in_series(n) * h:
            break
        if not solve_stages(machine, flow, stages, start, step, seen):
            step = 0.25 * step
            cut = True
            continue
        to_legendre(W, s, n, TERMS[tables_of(flow.order)], stages.values)
        drop_rounding(flow, stages.known)
        excess = last_terms(flow, stages, step, seen)
        # The last terms of a polynomial of degree s scale with the s-th power of the step.
        fits = 0.9 * max(excess, LEAST_SIZE) ** (-1.0 / s) if excess < np.inf else 0.0
        if not excess <= 1.0:
            step = step * max(0.1, fits)
            cut = True
            continue
        to_powers(W, s, n, step, stages.values)
        excess = between_nodes(flow, start, h, step, seen)
        if excess <= 1.0:
            return step, step * (1.1 if cut else min(2.0, fits))
        step = step * (0.7 if excess < 10.0 else 0.5)
        cut = True
    return 0.0, 0.0


@compiled()
def between_nodes(flow: Flow, start: Instant, h: float, step: float, seen: Array) -> float:
    """Bound of features between the nodes of a polynomial, relative to the tolerance: all rows are
    bounded on the disc of twice the step.

    Parameters
    ----------
    h, step : float
        How long a series is good for, and length of the polynomial.
    seen : array
        Largest modulus so far of each row that bounds the steps.
    """
    W = flow.space.W
    discs = flow.space.discs
    powers = flow.space.reaches
    n = flow.rows.sizes[DIMENSION]
    fill_powers(powers, 2.0 * step / W[n, 1])
    discs[n, BALL] = 2.0 * step
    discs[n, OFF] = 0.0
    spread_state(W, flow.order, powers, flow.rows.watched[:n], discs)
    spread_given(flow, start.mode, flow.order)
    spread(tape_of(flow, flow.order), start.mode, start.reg, 0, len(flow.rows.program.code))
    fill_powers(powers, step / W[n, 1])
    return hidden(flow, start.mode, h, HIDDEN_PARTS[tables_of(flow.order)], seen)
