"""The work of friction and of loads along a motion, between given times."""

from __future__ import annotations

from stickslip.arrays import Array, IntVector, Matrix, Vector
from stickslip.machine_code.functions import entry_point
from stickslip.motion.affine.nodes import COUNT, GAUSS_NODES, GAUSS_WEIGHTS
from stickslip.motion.algebra.roots import horner, horner_at_nodes, rate_on
from stickslip.motion.algebra.vectors import copy
from stickslip.motion.audit.accounts import FED, SPENT
from stickslip.motion.audit.between_nodes import StepPiece
from stickslip.motion.modes.inverses import resolve
from stickslip.motion.steps.arrays import (
    CONTACTS,
    COORDINATES,
    DIMENSION,
    DISSIPATED,
    INERTIAL,
    MATRIX,
    MEMBERS,
    SUPPLIED,
    Flow,
    Instant,
    Machine,
    Record,
    is_stopped,
)
from stickslip.motion.steps.contacts import direction_entry
from stickslip.motion.steps.directions import give_directions, take_directions
from stickslip.motion.steps.starting import coefficients
from stickslip.motion.steps.stiff import ends_there, follow_mode
from stickslip.numerics.levels import INSTANT, SHORTEST_PIECE
from stickslip.translator import compiled


@entry_point()
def work_until(
    machine: Machine,
    flow: Flow,
    seen: Vector,
    starts: Record,
    step: IntVector,
    times: Vector,
    work: Matrix,
) -> None:
    """Work from the beginning of steps until times in them, dissipated and supplied.

    Steps are followed from where they begin. From a time within one the motion need not be
    followed as well: where a slip has just begun, its direction is that of a slow way which others
    come to at once.

    Parameters
    ----------
    seen : array
        Sizes of the rows that bound the steps; see :class:`stickslip.motion.steps.arrays.Lane`.
    starts : Record
        Where steps begin.
    step : array of int, shape (times,)
        In which of them each time is, in their order.
    times : array, shape (times,)
        In their order within a step.
    work : array, shape (times, 2)
        Receives the work.
    """
    first = 0
    while first < len(times) and not is_stopped(flow.space):
        last = first
        while last + 1 < len(times) and step[last + 1] == step[first]:
            last = last + 1
        work_in_step(machine, flow, seen, starts, step[first], times, work, first, last)
        first = last + 1


@compiled()
def work_in_step(
    machine: Machine,
    flow: Flow,
    seen: Array,
    starts: Record,
    i: int,
    times: Array,
    work: Array,
    first: int,
    last: int,
) -> None:
    """The same for some of the times, which are in one step.

    Parameters
    ----------
    seen, starts, times, work
        As in :func:`work_until`.
    i : int
        The step.
    first, last : int
        Of the times.
    """
    W = flow.space.W
    y = flow.space.trial
    n = len(y)
    mode = flow.space.touched[: len(flow.rows.u)]
    reg = flow.space.touched[len(flow.rows.u) :]
    copy(starts.mode[i], mode)
    copy(starts.region[i], reg)
    copy(starts.state[i], y)
    resolve(flow.rows, flow.k, flow.space, mode)
    base, before = starts.time[i], 0.0
    spent, fed = 0.0, 0.0
    j = first
    while j <= last and not is_stopped(flow.space):
        left = times[last] - base
        h, series = 0.0, 0.0
        order = flow.order
        if left <= INSTANT * abs(base):
            left = 0.0  # These times cannot be distinguished from the current one.
        if left > 0.0:
            order, h, series = follow_mode(
                machine, flow, Instant(base, y, mode, reg), left, before, seen
            )
            h = min(left, max(h, SHORTEST_PIECE * left))
            if ends_there(h, left, base) or not h > 0.0:
                h = left
        acting = min(h, series) if series > 0.0 else h
        piece = StepPiece(order, base, h, acting, 0.0, 0.0)
        a = 0.0
        while j <= last and (times[j] - base <= h or h >= left):
            b = min(h, max(a, times[j] - base))
            more, other = work_between(machine, flow, piece, mode, reg, a, b)
            spent, fed = spent + more, fed + other
            work[j, SPENT], work[j, FED] = spent, fed
            a = b
            j = j + 1
        if j <= last:
            more, other = work_between(machine, flow, piece, mode, reg, a, h)
            spent, fed = spent + more, fed + other
            for r in range(n):
                y[r] = horner(W[r], order, h / W[n, 1])
            base, before = base + h, h


@compiled()
def work_between(
    machine: Machine, flow: Flow, piece: StepPiece, mode: Array, reg: Array, a: float, b: float
) -> tuple[float, float]:
    """Work on a part of a piece, dissipated and supplied.

    Parameters
    ----------
    flow : Flow
        Its work space has the polynomials of the piece.
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
    a, b : float
        The part, from the beginning of the piece.
    """
    spent, fed = 0.0, 0.0
    if b > a:
        give_directions(flow.rows, mode, True)
        put_nodes(flow, piece, a, b)
        for g in range(COUNT):
            weight = (b - a) * GAUSS_WEIGHTS[g]
            lost, given = powers_at(
                machine, flow, piece, mode, reg, a + (b - a) * GAUSS_NODES[g], g
            )
            spent += weight * lost
            fed += weight * given
        give_directions(flow.rows, mode, False)
    return spent, fed


@compiled()
def put_nodes(flow: Flow, piece: StepPiece, a: float, b: float) -> None:
    """Put the states at the nodes of a part of a piece into the work space.

    Parameters
    ----------
    flow : Flow
        Its work space has the polynomials of the piece.
    a, b : float
        The part, from the beginning of the piece.
    """
    nodes, W = flow.space.nodes, flow.space.W
    n = flow.rows.sizes[DIMENSION]
    unit = W[n, 1]
    for g in range(COUNT):
        nodes[n, g] = (a + (b - a) * GAUSS_NODES[g]) / unit
    horner_at_nodes(W, piece.order, nodes[n], nodes[:n])


@compiled()
def powers_at(
    machine: Machine,
    flow: Flow,
    piece: StepPiece,
    mode: Array,
    reg: Array,
    tau: float,
    node: int,
) -> tuple[float, float]:
    """Power that is dissipated, and supplied, at a node of a piece, with directions given. The
    values of the rows are left in the work space, and the state.

    Parameters
    ----------
    flow : Flow
        Its work space has the polynomials of the piece, and the states at the nodes.
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
    tau : float
        The time, from the beginning of the piece.
    node : int
        The number of the node.
    """
    rows, space = flow.rows, flow.space
    n = rows.sizes[DIMENSION]
    W, V, y = space.W, space.V, space.y0
    unit = W[n, 1]
    for r in range(n):
        y[r] = space.nodes[r, node]
    take_directions(rows, W, piece.order, tau / unit, V)
    coefficients(machine, flow, Instant(piece.t + tau, y, mode, reg), 1, V)
    machine.powers(V, reg, flow.k.K, space.powers)
    lost = space.powers[DISSIPATED]
    if piece.acting < piece.h:
        lost -= power_of_residuals(flow, piece, tau)
    return float(lost), float(space.powers[SUPPLIED])


@compiled()
def power_of_residuals(flow: Flow, piece: StepPiece, tau: float) -> float:
    """Power, at a node, of forces on coordinates without mass in the difference between the rates
    of the law and those of the polynomials.

    The way is that of the polynomials. Where they last longer than series, because something
    decays, the rates of the law have errors that are forgotten at once; their power would be
    counted all the time.

    Parameters
    ----------
    flow : Flow
        Its work space has the polynomials, and the values of the rows at the node.
    tau : float
        The node.
    """
    rows = flow.rows
    W = flow.space.W
    V = flow.space.V
    unit = W[rows.sizes[DIMENSION], 1]
    first = 2 * rows.sizes[INERTIAL]
    rates = rows.program.rates
    power = 0.0
    for part in rows.parts:
        if part[MATRIX] == 0:
            continue
        n = part[COORDINATES]
        members = rows.members[part[MEMBERS] :]
        for i in range(n):
            z = members[i]
            force = 0.0
            for j in range(n):
                force += flow.k.C[z, j] * V[rates[first + members[j]], 0]
            for j in range(part[CONTACTS]):
                c = members[n + j]
                force -= direction_entry(rows, flow.k.J, V, c, i) * V[rows.force[c], 0]
            way = rate_on(W[first + z], piece.order, tau / unit) / unit
            power += force * (V[rates[first + z], 0] - way)
    return power
