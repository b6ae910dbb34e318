"""Selection of the mode that continues a motion.

One rule decides every mode, at the start, at an event and at a corner where several contacts stand
on their boundary: **a mode is right if all its guards are nonnegative for a short while**, that is,
if the first Taylor coefficient of each guard that is not zero is positive. The guards of a stick
are λ + s⁺ and s⁻ − λ, of a slip σu, of a region its signed kink function. This is the
complementarity problem of the force law in the ordered field of power series, so a principal
pivoting method (Murty: flip the violated switch of least index) finds its solution. Its
leading order is the convex minimisation of the accelerations, velocities or rates.

:mod:`.mode_series` computes the series of a mode, :mod:`.guards` finds violated guards, and
:mod:`.pivots` changes the mode. If pivoting leaves the admissible modes, all states of the switches
that it has flipped are tried, one after the other.
"""

from __future__ import annotations

from stickslip.arrays import Array
from stickslip.equations.codegen.series import INDEFINITE, SINGULAR
from stickslip.motion.algebra.vectors import clear, copy
from stickslip.motion.modes.guards import scan
from stickslip.motion.modes.mode_series import make_series, matches_prediction, unit_for
from stickslip.motion.modes.pivots import (
    flip_apart,
    flip_at_ends,
    hold_or_slide,
    let_carry,
    set_regions,
    watches_nothing,
)
from stickslip.motion.modes.surfaces import begin_at_rest
from stickslip.motion.steps.arrays import (
    CAUSE,
    IMPLICIT,
    KINKS,
    LAST,
    NAN,
    NOW,
    OK,
    ON_INERTIAL,
    ON_RATE_INDEPENDENT,
    ON_VISCOUS,
    OVERFLOW,
    REJECTED,
    UNIT,
    Flow,
    Instant,
    Lane,
    Machine,
    Rows,
)
from stickslip.motion.steps.contacts import set_mode
from stickslip.motion.steps.sets import crosses_pieces, slides_in_plane
from stickslip.motion.steps.step_size import MOST_UNITS, fill_powers, shortened_step
from stickslip.motion.steps.stiff import RESTING, collocate, is_implicit_due
from stickslip.numerics.levels import CLOSEST
from stickslip.translator import compiled

_MOST_CANDIDATES = 60000
# largest factor on rounding errors regarded as zero, if no mode is admissible with less
_SLACKEST = 1e6
# results for a mode other than the number of a violated guard
_NO_GUARD = -1
_OTHER_FORCES = -2
_AGAIN = -3
_OVER = 16.0  # length of a step over a singularity, in the shortest steps that times resolve
_TOGETHER = 16  # number of times that the switches of different components are flipped together


@compiled()
def settle_mode(
    machine: Machine, flow: Flow, lane: Lane, room: float, hold: bool, unchecked: float
) -> tuple[int, float, float, int]:
    """Find the mode the motion takes now; its series, or a polynomial, is left in the work space.

    Parameters
    ----------
    room, hold
        Longest step that is wanted; whether sticking contacts are put onto the surface speed.
    unchecked : float
        Length of the last step if its predicted rates have not been checked yet; otherwise 0.

    Returns
    -------
    status, step, series, count
        OK, the step size, that of the series, and the number of guards that may fire; NAN or
        INDEFINITE; SINGULAR if no mode is possible; REJECTED if the last step is inaccurate.
    """
    rows = flow.rows
    space = flow.space
    touched = space.touched
    nk = len(rows.kinks)
    n = len(lane.y)
    keep_start(machine, flow, lane)
    clear(touched)
    space.W[n, 1] = lane.clock[UNIT]
    # First pivoting; if that leaves the admissible modes (a singular or impossible one), all states
    # of the switches concerned, `total` in number.
    pivots = 0
    units = 0
    candidate = 0
    total = 0
    kept = 0  # number of corrections of the forces of such a state
    flipped = lane.counters[CAUSE]
    slack = 1.0
    breaks = 1  # whether a contact has to break its static threshold to slip in such a state
    denied = 0.0  # longest step of a mode that was rejected
    while True:
        if pivots > 0:
            copy(space.y0, lane.y)
        pivots += 1
        if total > 0 and kept == 0:
            candidate, total, slack, breaks = choose_next(
                rows, touched, lane.mode, lane.reg, candidate, total, slack, breaks
            )
            if total == 0:
                return SINGULAR, 0.0, 0.0, 0
        status, h = make_series(machine, flow, lane, room, slack * denied, hold or pivots > 1)
        known = pivots == 1 and status != SINGULAR
        if (
            known
            and unchecked > 0.0
            and not matches_prediction(flow, space.W, lane.y, lane.seen, unchecked)
        ):
            return REJECTED, 0.0, 0.0, 0
        if status == OK and len(rows.bounded) > 0 and watches_nothing(rows, space.W):
            status = NAN
        # A formula may end where its region ends.
        lost = status in (NAN, OVERFLOW, INDEFINITE) and total == 0 and pivots <= nk + 1
        if lost and set_regions(rows, space.W, space.mag, lane.reg):
            continue
        begins = lost and pivots == 1 and lane.counters[CAUSE] < 0  # possibly at the end of a table
        if begins and flip_at_ends(rows, space.W, space.mag, lane.reg):
            continue
        rescaled, unit = unit_for(status, h, room, space.W[n, 1])
        if status in (NAN, INDEFINITE) or (rescaled and units == MOST_UNITS):
            return (INDEFINITE if status == INDEFINITE else NAN), 0.0, 0.0, 0
        if rescaled:
            space.W[n, 1] = unit
            units += 1
            pivots -= 1
            candidate -= 1 if total > 0 else 0
            continue
        if status == OK:
            denied = max(denied, h)
            guard, count, h, series = try_mode(machine, flow, lane, h, room, slack, pivots == 1)
            if guard == _NO_GUARD:
                return OK, h, series, count
            others = guard == _OTHER_FORCES and total > 0 and kept <= 2 * len(rows.u)
            kept = kept + 1 if others else 0
            if guard == _AGAIN:
                pivots = 0
                continue
            if guard >= 0 and total == 0:
                looked_at = count if pivots <= _TOGETHER else 1
                flipped = flip_apart(rows, space, lane.mode, lane.reg, looked_at)
        many = pivots > 3 * len(touched) + 8
        carried = status == SINGULAR and total == 0 and let_carry(flow, lane.mode, flipped - nk)
        if total == 0 and (many or (status != OK and not carried)):
            total = concerned(rows, touched, lane.mode, lane.counters[CAUSE])


@compiled()
def keep_start(machine: Machine, flow: Flow, lane: Lane) -> None:
    """Keep the state from which modes are tried."""
    begin_at_rest(machine, flow, lane)
    copy(lane.y, flow.space.y0)


@compiled()
def try_mode(
    machine: Machine,
    flow: Flow,
    lane: Lane,
    h: float,
    room: float,
    slack: float,
    quiet: bool,
) -> tuple[int, int, float, float]:
    """Test whether the mode whose series are in the work space is consistent, and choose a step in
    which nothing is missed, or a longer one by a polynomial if the motion is stiff.

    Parameters
    ----------
    h, room : float
        Step of the series, and longest step that is wanted.
    quiet : bool
        Whether this is the mode that the motion was in.

    Returns
    -------
    guard, count, step, series
        NO_GUARD if the mode is right; the least guard that is violated at once; OTHER_FORCES if
        contacts that do not stick have to have others; AGAIN if a guard vanishes in a polynomial,
        which has to be a series. Then the number of guards that may fire, or are violated; the
        step, and that of the series.
    """
    rows, space = flow.rows, flow.space
    clock = lane.clock
    mode = lane.mode
    n = len(lane.y)
    last = clock[LAST]
    fired = lane.counters[CAUSE]
    unit = space.W[n, 1]
    fill_powers(space.powers, h / unit)
    guard, count = scan(flow, mode, lane.reg, lane.settled, last, fired, slack)
    if guard >= 0:
        return guard, count, h, h
    if hold_or_slide(flow, mode, last, fired, slack):
        return _OTHER_FORCES, count, h, h
    series = shortened_step(flow, mode, lane.reg, h, lane.seen)
    brief = CLOSEST * abs(clock[NOW])
    # Not twice: a real edge is passed by the first such step.
    once = fired >= 0 or last < 0.5 * _OVER * brief
    if series <= brief and once and crosses_pieces(rows, mode):
        series = _OVER * brief
        keep_rates(flow)
    step = series
    length = h
    # If a slip in a plane is slow, discs shorten stiff steps as well.
    whole = not step < h or slides_in_plane(flow.rows, mode)
    stiff = quiet and whole and is_implicit_due(flow, lane, step, room)
    if stiff:
        here = Instant(clock[NOW], lane.y, mode, lane.reg)
        step, clock[IMPLICIT] = collocate(machine, flow, here, step, clock[IMPLICIT], lane.seen)
    if step != h:
        length = (clock[NOW] + step) - clock[NOW]
        fill_powers(space.powers, length / space.W[n, 1])
        guard, count = scan(flow, mode, lane.reg, lane.settled, last, fired, slack)
    if stiff and (guard >= 0 or not step > 0.0):
        # A vanishing guard is more accurate from its series.
        clock[IMPLICIT] = -RESTING
        space.W[n, 1] = unit
        return _AGAIN, count, h, series
    if guard >= 0:
        return guard, count, length, series
    clock[UNIT] = unit
    for i in range(len(flow.rows.watched)):
        lane.seen[i] = max(lane.seen[i], abs(space.W[flow.rows.watched[i], 0]))
    return _NO_GUARD, count, length, series


@compiled()
def keep_rates(flow: Flow) -> None:
    """Discard all coefficients except values and rates: in a step shorter than the resolution of
    time, all others are lost in rounding."""
    W = flow.space.W
    for r in range(len(W)):
        for k in range(2, flow.order + 1):
            W[r, k] = 0.0


# -- every state of the switches concerned ---------------------------------------------------------


@compiled()
def concerned(rows: Rows, touched: Array, mode: Array, fired: int) -> int:
    """Count the states of the switches that pivoting has flipped, of the one that has just fired,
    and of contacts that slide without mass."""
    sizes = rows.sizes
    nk = sizes[KINKS]
    first = sizes[ON_INERTIAL] + sizes[ON_VISCOUS]
    if fired >= 0:
        touched[fired] = 1
    for c in range(first, first + sizes[ON_RATE_INDEPENDENT]):
        if mode[c] != 0:
            touched[nk + c] = 1
    return candidates(rows, touched, nk)


@compiled()
def choose_next(
    rows: Rows,
    touched: Array,
    mode: Array,
    reg: Array,
    candidate: int,
    total: int,
    slack: float,
    breaks: int,
) -> tuple[int, int, float, int]:
    """Put the switches concerned into the next of all their states.

    Parameters
    ----------
    touched : array of int, shape (kinks + contacts,)
        1 for each switch concerned; all contacts are once no state is left.
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
        Are changed.
    candidate, total : int
        The number of the next state, and of all states.
    slack : float
        Rounding errors that count as zero.
    breaks : int
        1 if what slips is at its threshold, 0 if it has its sliding force.

    Returns
    -------
    candidate, total, slack, breaks
        The number of the state after that, of all states (0: none is left), rounding errors that
        count as zero, and what slips has.
    """
    nk = len(reg)
    if candidate == total:
        # If forces are not unique, contacts that pivoting never changed may have to change, too.
        asked = 0
        for c in range(len(mode)):
            asked += 1 - touched[nk + c]
            touched[nk + c] = 1
        total = candidates(rows, touched, nk)
        if asked == 0:
            # A contact may be so close to two modes that rounding errors exclude both.
            slack *= 1e2
            if slack > _SLACKEST and breaks == 1:
                # A contact that has broken its threshold may let others stick by its smaller force.
                # This comes last: a contact that cannot stick because of rounding errors has broken
                # nothing.
                slack = 1.0
                breaks = 0
        candidate = 0
    if total > _MOST_CANDIDATES or slack > _SLACKEST:
        return candidate, 0, slack, breaks
    choose(rows, candidate, touched, mode, reg, breaks)
    return candidate + 1, total, slack, breaks


@compiled()
def candidates(rows: Rows, touched: Array, nk: int) -> int:
    """Number of states of the switches concerned (more than are tried, if there are too many)."""
    total = 1
    for i in range(len(touched)):
        if touched[i] == 1 and total <= _MOST_CANDIDATES:
            total *= 2 if i < nk else rows.states[i - nk]
    return total


@compiled()
def choose(
    rows: Rows, candidate: int, touched: Array, mode: Array, reg: Array, breaks: int
) -> None:
    """Set the switches concerned to the states with a number; contacts that do not stick are at
    their threshold, have their sliding force, or are open.

    Parameters
    ----------
    candidate : int
        The number.
    touched : array of int, shape (kinks + contacts,)
        1 for each switch concerned.
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
        Are changed.
    breaks : int
        As in :func:`choose_next`.
    """
    nk = len(reg)
    for j in range(nk):
        if touched[j] == 1:
            reg[j] = candidate % 2
            candidate //= 2
    for c in rows.contacts:
        if touched[nk + c] == 1:
            states = int(rows.states[c])
            set_mode(rows, mode, c, (candidate % states - 1) * (1 + breaks * rows.drops[c]))
            candidate //= states
