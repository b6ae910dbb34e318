"""First variation of a motion in compiled loops: collocation between events, jumps at them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array, Array3, IntArray3, IntMatrix, IntVector, Matrix, Vector
from stickslip.machine_code.functions import entry_point
from stickslip.motion.between.dense import Scratch, states_at
from stickslip.motion.engine.jumps import fired_jump
from stickslip.motion.steps.arrays import (
    COMPONENT,
    MASSIVE,
    Flow,
    Machine,
    Record,
    Rows,
    is_stopped,
    opens,
)
from stickslip.orbits.fields.engine.interpreter import LANES, Instructions, perform
from stickslip.translator import compiled

STAGES = LANES  # Gauss nodes of a step: order 16
# largest |eigenvalue| × step of a collocation step: its Padé approximant of exp is exact to
# rounding there
_REACH = 1.5
_HALVES = 25  # of the time that is left in which a slip in a plane comes to rest
_DOUBLINGS = 6  # ‖J⁶⁴‖ to the power 1/64 is the largest |eigenvalue| up to a few parts in a hundred
TOGETHER = 1e-9  # events closer than this part of the motion are simultaneous
# a guard whose rate is this small, relative to its terms and its usual rate, is touched, not
# crossed
_TANGENT = 1e-6
ALIKE = 1e-8  # derivatives that differ by less, relative to the largest, are the same
_NO_JUMP = 1e-12  # a change of the field this small, relative to its terms, is none
_LEAST_PIVOT = 0.1  # a pivot below this part of its column is exchanged

# What becomes of an event, or of the pass: it may need more room for its nodes, or stand at a knot
# at which the state jumps.
PASSED, GRAZED, CORNER, UNEXPLAINED, CROWDED, STRUCK, HALTED = range(7)
# Entries of Pass.event.
BEGINS, ENDS, MEETING, MET = range(4)


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
# eigenvalue of A is larger than _REACH
_MOMENTS = np.array([WEIGHTS * (1.0 - NODES) ** k / math.factorial(k) for k in range(25)])
# of the numerator of the Padé approximant of exp
_PADE = np.array([math.comb(STAGES, k) / math.perm(2 * STAGES, k) for k in range(STAGES + 1)])


class Listed(NamedTuple):
    """The pieces of a system as instructions. A column is a component of the state or, behind
    these, a free parameter.

    Attributes
    ----------
    made : Instructions
    slopes, guards : arrays of int, shape (pieces, 3)
        Which of them give the Jacobian, and rates and guards with their slopes: the first that is
        the same for all points, the first that is not, and the end.
    jacobian : array of int, shape (pieces, states × columns)
        Places of the Jacobian in the table of values.
    rates : array of int, shape (pieces, states)
        Places of the rates.
    falls : array of int, shape (pieces, guards, 2 + columns)
        Places of the guards, of their derivatives by time, and by the columns.
    switches : array of int, shape (pieces, guards)
        The switch that each belongs to; −1 where there is none.
    settings : array of int, shape (pieces, switches)
    steady : array of int, shape (pieces,)
        1 where the Jacobian is the same at all states.
    """

    made: Instructions
    slopes: IntMatrix
    guards: IntMatrix
    jacobian: IntMatrix
    rates: IntMatrix
    falls: IntArray3
    switches: IntMatrix
    settings: IntMatrix
    steady: IntVector


class Pass(NamedTuple):
    """A motion on the way of being differentiated.

    Attributes
    ----------
    knots : Record
        The motion.
    seen : array
        Sizes of the rows that bound its steps; see :class:`stickslip.motion.steps.arrays.Lane`.
    origin : float
        The time at which its clock is 0.
    drives : float
        Largest frequency of the loads.
    piece : array of int, shape (knots,)
        Piece of the step that begins at each.
    parts : array of int, shape (knots,)
        In which each step is resolved; negative where these become shorter towards its end.
    after : array, shape (knots, columns, directions)
        Change of (state, p) right after each knot.
    late : array, shape (knots, directions)
        How the time of the event there changes; not a number where there is none. Of no direction,
        if it has no columns.
    outcome : array of int, shape (knots,)
        What became of the event there: `PASSED` or `GRAZED`.
    event : array of int
        The event at which the pass has stopped: the knots at which it begins and ends, the number
        of switches that are meeting there, and these, the one that fired first.
    """

    knots: Record
    seen: Vector
    origin: float
    drives: float
    piece: IntVector
    parts: IntVector
    after: Array3
    late: Matrix
    outcome: IntVector
    event: IntVector


class Leave(NamedTuple):
    """The guards of a piece at a point where the motion may leave it.

    Attributes
    ----------
    rates : array, shape (states,)
        The field f.
    value : array, shape (guards,)
    slopes : array, shape (guards, columns)
        Derivatives with respect to the state and the free parameters.
    fall : array, shape (guards,)
        Rates g_t + ∇g·f along the motion.
    terms : array, shape (guards,)
        Sum of the moduli of the terms of the rates.
    """

    rates: Vector
    value: Vector
    slopes: Matrix
    fall: Vector
    terms: Vector


class PassSpace(NamedTuple):
    """Work space of a pass.

    Attributes
    ----------
    values : array, shape (places, LANES)
        Of the instructions.
    step, clock, states : arrays, shapes (room,), (room,) and (room, states)
        The nodes of all steps: the knot before each, when it is, and the state there.
    squares : array, shape (5, states, states)
    moved : array, shape (states, directions)
    system : array, shape (STAGES × states, STAGES × states + the larger of states and directions)
    here, around : Leave
    usual : array, shape (guards,)
    others : array of int, shape (guards,)
    between : Scratch
    """

    values: Matrix
    step: IntVector
    clock: Vector
    states: Matrix
    squares: Array3
    moved: Matrix
    system: Matrix
    here: Leave
    around: Leave
    usual: Vector
    others: IntVector
    between: Scratch


def room_for_pass(
    listed: Listed, places: int, nodes: int, shape: tuple[int, int], between: Scratch
) -> PassSpace:
    """New work space.

    Parameters
    ----------
    listed : Listed
    places : int
        In the table of values.
    nodes : int
    shape : (int, int)
        Columns and directions.
    between : Scratch
    """
    columns, directions = shape
    guards = listed.switches.shape[1]
    n = listed.rates.shape[1]

    def leave() -> Leave:
        return Leave(
            np.zeros(n),
            np.zeros(guards),
            np.zeros((guards, columns)),
            np.zeros(guards),
            np.zeros(guards),
        )

    return PassSpace(
        np.zeros((places, LANES)),
        np.zeros(nodes, np.int64),
        np.zeros(nodes),
        np.zeros((nodes, n)),
        np.zeros((5, n, n)),
        np.zeros((n, directions)),
        np.zeros((STAGES * n, STAGES * n + max(n, directions))),
        leave(),
        leave(),
        np.zeros(guards),
        np.zeros(guards, np.int64),
        between,
    )


# -- between events --------------------------------------------------------------------------------


@compiled()
def time_of(run: Pass, knot: int) -> float:
    """When a knot is."""
    return run.knots.time[knot] + run.origin


@compiled()
def put_point(values: Array, k: int, t: float, y: Array) -> None:
    """Enter a point into the table of values."""
    values[0, k] = t
    for r in range(len(y)):
        values[1 + r, k] = y[r]


@compiled()
def fastest(listed: Listed, run: Pass, work: PassSpace, w: int, knot: int) -> float:
    """Largest modulus of an eigenvalue of the Jacobian at a knot, from high powers of it.

    Parameters
    ----------
    listed : Listed
    run : Pass
    work : PassSpace
    w : int
        The piece.
    knot : int
    """
    J, scaled = work.squares[0], work.squares[1]
    n = len(J)
    columns = run.after.shape[1]
    put_point(work.values, 0, time_of(run, knot), run.knots.state[knot])
    perform(listed.made, listed.slopes[w, 0], listed.slopes[w, 2], work.values, 1)
    for r in range(n):
        for c in range(n):
            J[r, c] = work.values[listed.jacobian[w, r * columns + c], 0]
            if J[r, c] != J[r, c]:
                return 0.0  # where a slip in a plane begins with the motion
    scale = 0.0  # log of what has been divided out, per factor
    power = 1.0
    for _ in range(_DOUBLINGS + 1):
        largest = 0.0
        for r in range(n):
            for c in range(n):
                largest = max(largest, abs(J[r, c]))
        if not 0.0 < largest < np.inf:
            return 0.0
        scale += math.log(largest) / power
        power *= 2.0
        for r in range(n):
            for c in range(n):
                scaled[r, c] = J[r, c] / largest
        put_product(scaled, scaled, J)
    return math.exp(scale)


@compiled()
def share_of_step(run: Pass, i: int, part: int) -> tuple[float, float]:
    """Where a part of a step begins, and how long it is, as parts of the step: all are equal, but
    where a slip in a plane ends each half of what is left has the same number of them, since the
    Jacobian is singular there, as 1/abs(u)."""
    if run.parts[i] > 0:
        return part / run.parts[i], 1.0 / run.parts[i]
    share = -run.parts[i] // _HALVES
    half = part // share
    left = math.ldexp(1.0, -half)
    length = (left if half == _HALVES - 1 else 0.5 * left) / share
    return 1.0 - left + (part % share) * length, length


@entry_point()
def resolve_steps(rows: Rows, listed: Listed, run: Pass, work: PassSpace) -> int:
    """In how many parts each step has to be taken for linear motions to be resolved; returns the
    number of nodes at which states are wanted.

    Where a slip in a plane begins or ends there is no Jacobian; what it would be is a quotient of
    rounding errors.
    """
    nodes = 0
    for i in range(len(run.piece) - 1):
        h = time_of(run, i + 1) - time_of(run, i)
        run.parts[i] = 1
        if h > 0.0:
            w = run.piece[i]
            rate = run.drives
            if i == 0 or not turns_about(rows, listed, run, work, i):
                rate = max(rate, fastest(listed, run, work, w, i))
            if listed.steady[w] == 1:
                run.parts[i] = max(1, math.ceil(h * rate / _REACH))
            elif slides(rows, run, i) and turns_about(rows, listed, run, work, i + 1):
                run.parts[i] = -_HALVES * max(1, math.ceil(0.5 * h * rate / _REACH))
            else:
                if not turns_about(rows, listed, run, work, i + 1):
                    rate = max(rate, fastest(listed, run, work, w, i + 1))
                run.parts[i] = max(1, math.ceil(h * rate / _REACH))
        nodes += nodes_of(listed, run, i)
    return nodes


@compiled()
def slides(rows: Rows, run: Pass, i: int) -> bool:
    """Whether something with mass slips in a plane in the step from a knot."""
    for p in range(len(rows.planes)):
        if rows.planes[p, MASSIVE] == 1 and run.knots.mode[i, rows.planes[p, COMPONENT]] != 0:
            return True
    return False


@compiled()
def turns_about(rows: Rows, listed: Listed, run: Pass, work: PassSpace, i: int) -> bool:
    """Whether a slip in a plane, or of a contact that may share its force with such, begins or ends
    at a knot; or goes on through rest.

    Parameters
    ----------
    rows : Rows
    listed : Listed
    run : Pass
    work : PassSpace
    i : int
        The knot; not the first.
    """
    slips = False
    for c in range(len(rows.group)):
        before, after = run.knots.mode[i - 1, c], run.knots.mode[i, c]
        if rows.plane[c] >= 0 or rows.group[c] >= 0:
            if before != after:
                return True
            slips = slips or (after != 0 and rows.plane[c] >= 0)
    if not slips:
        return False
    guards_at(listed, run, work.values, run.piece[i - 1], i, work.around)
    for g in range(listed.switches.shape[1]):
        c = listed.switches[run.piece[i - 1], g] - len(rows.kinks)
        stands = c >= 0 and rows.plane[c] >= 0 and run.knots.mode[i, c] != 0
        if stands and work.around.value[g] == 0.0 and rows.planes[rows.plane[c], MASSIVE] == 1:
            return True
    return False


@compiled()
def nodes_of(listed: Listed, run: Pass, i: int) -> int:
    """At how many nodes of a step states are wanted: at none where the Jacobian is the same at
    all."""
    even = listed.steady[run.piece[i]] == 1 and run.after.shape[1] == run.knots.state.shape[1]
    return 0 if even or not time_of(run, i + 1) > time_of(run, i) else STAGES * abs(run.parts[i])


@compiled()
def place_nodes(listed: Listed, run: Pass, work: PassSpace) -> None:
    """The step that each of the nodes belongs to, and its time."""
    place = 0
    for i in range(len(run.piece) - 1):
        begin = time_of(run, i)
        h = time_of(run, i + 1) - begin
        for j in range(nodes_of(listed, run, i)):
            first, length = share_of_step(run, i, j // STAGES)
            work.step[place] = i
            work.clock[place] = begin + (first + NODES[j % STAGES] * length) * h - run.origin
            place += 1


@compiled()
def eliminate(system: Array, size: int, width: int) -> None:
    """Solve linear equations, whose right sides are the columns from the first `size` up to a
    width; their solutions take the place of these."""
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
def gauss_step(places: Array, values: Array, h: float, change: Array, system: Array) -> None:
    """One step of Φ' = J_y Φ + J_p by collocation at the Gauss nodes.

    Parameters
    ----------
    places : array of int, shape (states × columns,)
        Of the Jacobian in the table of values.
    values : array, shape (places, LANES)
        That of the nodes.
    h : float
    change : array, shape (columns, directions)
        Φ before, and after.
    system : array, shape (STAGES × states, at least STAGES × states + directions)
        Work space.
    """
    columns, directions = change.shape
    n = len(places) // columns
    size = STAGES * n
    # The slopes K_i at the nodes solve K_i = J_i(Φ + h Σ_j a_ij K_j), all at once.
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
def flow_through(listed: Listed, run: Pass, work: PassSpace, i: int, node: int) -> None:
    """The variation after the step from knot i, from that at its beginning.

    Parameters
    ----------
    listed : Listed
    run : Pass
    work : PassSpace
    i : int
    node : int
        The first of its nodes.
    """
    change = run.after[i + 1]
    put_matrix(run.after[i], change)
    length = time_of(run, i + 1) - time_of(run, i)
    if not length > 0.0:
        return
    w = run.piece[i]
    first, moving, last = listed.slopes[w, 0], listed.slopes[w, 1], listed.slopes[w, 2]
    parts = abs(run.parts[i])
    h = length / parts
    even = nodes_of(listed, run, i) == 0
    for g in range(STAGES):
        put_point(work.values, g, time_of(run, i), run.knots.state[i])
    perform(listed.made, first, last if even else moving, work.values, STAGES)
    if even:
        repeat(listed.jacobian[w], work, h, parts, change)
        return
    for part in range(parts):
        for g in range(STAGES):
            put_point(work.values, g, work.clock[node] + run.origin, work.states[node])
            node += 1
        perform(listed.made, moving, last, work.values, STAGES)
        if listed.steady[w] == 0:
            _, share = share_of_step(run, i, part)
            gauss_step(listed.jacobian[w], work.values, share * length, change, work.system)
        else:
            if part == 0:
                put_exponential(listed.jacobian[w], work, h, work.squares[2])
            forced_step(listed.jacobian[w], work, h, change)


@compiled()
def forced_step(places: Array, work: PassSpace, h: float, change: Array) -> None:
    """One step of Φ' = J_y Φ + J_p where J_y is the same all the time: its flow, and what each
    column of J_p adds on the way.

    Parameters
    ----------
    places : array of int, shape (states × columns,)
        Of the Jacobian in the table of values.
    work : PassSpace
        With the flow of the step as the third of its squares.
    h : float
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
    """Many equal steps under one Jacobian: its flow over one of them, squared and multiplied.

    Parameters
    ----------
    places : array of int
        Of the Jacobian in the table of values.
    work : PassSpace
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
    """The flow of one step under one Jacobian: what collocation at the Gauss nodes comes to, the
    diagonal Padé approximant N/D of exp(hJ), with N = V + U and D = V − U, even and odd in hJ.

    Parameters
    ----------
    places : array of int
        Of the Jacobian in the table of values.
    work : PassSpace
    h : float
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


# -- at events -------------------------------------------------------------------------------------


@compiled()
def guards_at(listed: Listed, run: Pass, values: Array, w: int, knot: int, out: Leave) -> None:
    """The guards of a piece at a knot.

    Parameters
    ----------
    listed : Listed
    run : Pass
    values : array, shape (places, LANES)
        Work space.
    w : int
        The piece.
    knot : int
    out : Leave
    """
    put_point(values, 0, time_of(run, knot), run.knots.state[knot])
    perform(listed.made, listed.guards[w, 0], listed.guards[w, 2], values, 1)
    n = run.knots.state.shape[1]
    for r in range(n):
        out.rates[r] = values[listed.rates[w, r], 0]
    for g in range(listed.falls.shape[1]):
        if listed.switches[w, g] >= 0:
            places = listed.falls[w, g]
            out.value[g] = values[places[0], 0]
            time = values[places[1], 0]
            along, terms = 0.0, 0.0
            for c in range(len(places) - 2):
                slope = values[places[2 + c], 0]
                out.slopes[g, c] = slope
                if c < n:
                    along += slope * out.rates[c]
                    terms += abs(slope * out.rates[c])
            out.fall[g] = time + along
            out.terms[g] = abs(time) + terms


@compiled()
def fired(listed: Listed, run: Pass, i: int, last: int, here: Leave) -> int:
    """The guard that fired: of those that belong to the causes, else to a switch that changed, the
    one at zero; −1 if there is none.

    Parameters
    ----------
    listed : Listed
    run : Pass
    i, last : int
        The first and the last knot of the events.
    here : Leave
        The guards of the piece before.
    """
    left, right = run.piece[i - 1], run.piece[last]
    named = False
    for j in range(i, last + 1):
        named = named or run.knots.cause[j] >= 0
    best, least = -1, np.inf
    for g in range(listed.switches.shape[1]):
        switch = listed.switches[left, g]
        if switch < 0:
            continue
        meant = False
        if named:
            for j in range(i, last + 1):
                meant = meant or run.knots.cause[j] == switch
        else:
            meant = listed.settings[left, switch] != listed.settings[right, switch]
        off = abs(here.value[g]) / (abs(here.fall[g]) + 1e-300)
        if meant and (best < 0 or off < least):
            best, least = g, off
    return best


@compiled()
def coincide(here: Leave, first: int, among: Array, count: int, arrived: Array) -> bool:
    """Whether events that coincide do so for all neighbours, too, so that they are one.

    Parameters
    ----------
    here : Leave
    first : int
        The guard that fired.
    among : array of int
        The others, in its first entries.
    count : int
        Their number.
    arrived : array, shape (columns, directions)
        The variation before the events.
    """
    largest, apart = 0.0, 0.0
    for d in range(arrived.shape[1]):
        reference = delay(here, first, arrived, d)
        largest = max(largest, abs(reference))
        for i in range(count):
            other = delay(here, among[i], arrived, d)
            if not abs(other) < np.inf:
                return False
            largest = max(largest, abs(other))
            apart = max(apart, abs(other - reference))
    return apart <= ALIKE * largest


@compiled()
def delay(here: Leave, g: int, arrived: Array, d: int) -> float:
    """By how much earlier neighbours in a direction pass a guard."""
    total = 0.0
    for c in range(len(arrived)):
        total += here.slopes[g, c] / here.fall[g] * arrived[c, d]
    return total


@entry_point()
def jump(here: Leave, g: int, onward: Vector, usual: float, change: Matrix) -> int:
    """The variation after one guard, where the motion goes on with other rates.

    Parameters
    ----------
    here : Leave
    g : int
        The guard.
    onward : array, shape (states,)
        The rates beyond it.
    usual : float
        The rate at which it usually falls.
    change : array, shape (columns, directions)
        The variation before, and after.

    Returns
    -------
    int
        `PASSED`, or `GRAZED` where the guard is touched without being crossed: then nothing jumps.
    """
    n = len(onward)
    largest, size = 0.0, 0.0
    for r in range(n):
        largest = max(largest, abs(onward[r] - here.rates[r]))
        size = max(size, abs(onward[r]) + abs(here.rates[r]))
    if largest <= _NO_JUMP * size:
        return PASSED
    if abs(here.fall[g]) <= _TANGENT * usual:
        return GRAZED
    for d in range(change.shape[1]):
        earlier = delay(here, g, change, d)
        for r in range(n):
            change[r, d] += (onward[r] - here.rates[r]) * earlier
    return PASSED


@compiled()
def pass_event(listed: Listed, run: Pass, work: PassSpace, i: int, last: int) -> int:
    """The variation after some events, from that before, which stands at the first of them; says
    what became of it.

    Parameters
    ----------
    listed : Listed
    run : Pass
    work : PassSpace
    i, last : int
        The first and the last knot of the events.
    """
    left, right = run.piece[i - 1], run.piece[last]
    guards = listed.switches.shape[1]
    final = len(run.piece) - 1
    here, around, usual, others = work.here, work.around, work.usual, work.others
    for g in range(guards):
        usual[g] = 0.0
    for knot in (i - 1, min(last + 1, final)):
        guards_at(listed, run, work.values, left, knot, around)
        for g in range(guards):
            if listed.switches[left, g] >= 0 and abs(around.fall[g]) < np.inf:
                usual[g] = max(usual[g], abs(around.fall[g]))
    guards_at(listed, run, work.values, right, i, around)
    guards_at(listed, run, work.values, left, i, here)
    g = fired(listed, run, i, last, here)
    run.event[MEETING] = 1
    if g < 0:
        return UNEXPLAINED
    together = TOGETHER * (time_of(run, final) - time_of(run, 0))
    count = 0
    run.event[MET] = listed.switches[left, g]
    for j in range(guards):
        switch = listed.switches[left, j]
        if switch >= 0 and switch != listed.switches[left, g]:
            falls = here.fall[j] < -_TANGENT * max(usual[j], here.terms[j])
            if abs(here.value[j]) <= together * abs(here.fall[j]) and falls:
                others[count] = j
                count += 1
                run.event[MET + count] = switch
    run.event[MEETING] = 1 + count
    change = run.after[i]
    for d in range(run.late.shape[1]):
        run.late[i, d] = -delay(here, g, change, d)
    if count and not coincide(here, g, others, count, change):
        return CORNER
    return jump(here, g, around.rates, max(usual[g], here.terms[g]), change)


@compiled()
def strikes(rows: Rows, listed: Listed, run: Pass, work: PassSpace, i: int) -> bool:
    """Whether the state jumps at a knot: a gap has closed, or a declared jump has been taken; or
    whether a slip in a plane begins or ends, or turns round, where its field has no value, or one
    of contacts that share forces.

    Parameters
    ----------
    rows : Rows
    listed : Listed
    run : Pass
    work : PassSpace
    i : int
        The knot; not the first.
    """
    if turns_about(rows, listed, run, work, i):
        return True
    cause = run.knots.cause[i]
    c = cause - len(rows.kinks)
    if cause >= 0 and c < 0:
        return bool(fired_jump(rows, cause, 1 - run.knots.region[i - 1, cause]) >= 0)
    return bool(c >= 0 and opens(rows, c) and run.knots.mode[i - 1, c] != 0)


@entry_point()
def vary(
    machine: Machine, flow: Flow, listed: Listed, run: Pass, work: PassSpace, start: int
) -> int:
    """The variation along a motion, from a knot on, at which it is known.

    Parameters
    ----------
    machine : Machine
    flow : Flow
        Tolerances with which the motion is followed again between its knots.
    listed : Listed
    run : Pass
    work : PassSpace
    start : int
        Knot. From the first one on, states are computed at the nodes.

    Returns
    -------
    int
        `PASSED`; or `CORNER` where guards meet that do not meet for neighbours, `STRUCK` where the
        state jumps (of both the caller has to say what comes after it, and to go on from there),
        `UNEXPLAINED` where no guard has fired, `CROWDED` with the number of nodes for which there
        has to be room as the event, or `HALTED` if there is a wish to stop.
    """
    if start == 0:
        nodes = resolve_steps(flow.rows, listed, run, work)
        if nodes > len(work.step):
            run.event[BEGINS] = nodes
            return CROWDED
        place_nodes(listed, run, work)
        step, clock = work.step[:nodes], work.clock[:nodes]
        states_at(machine, flow, run.seen, run.knots, step, clock, work.between, work.states)
    knots = len(run.piece)
    together = TOGETHER * (time_of(run, knots - 1) - time_of(run, 0))
    node = 0
    i = 0
    while i < knots - 1:
        if is_stopped(flow.space):
            return HALTED
        if i >= start:
            flow_through(listed, run, work, i, node)
        node += nodes_of(listed, run, i)
        i += 1
        if i <= start:
            continue
        last = i
        if strikes(flow.rows, listed, run, work, i):
            run.event[BEGINS], run.event[ENDS] = i, i
            return STRUCK
        if run.piece[i] != run.piece[i - 1]:
            while last + 2 < knots and time_of(run, last + 1) - time_of(run, i) <= 1e-3 * together:
                if strikes(flow.rows, listed, run, work, last + 1):
                    break
                last += 1
            run.event[BEGINS], run.event[ENDS] = i, last
            code = pass_event(listed, run, work, i, last)
            if code in (CORNER, UNEXPLAINED):
                return code
            run.outcome[i] = code
        for j in range(i, last):
            put_matrix(run.after[i], run.after[j + 1])
            node += nodes_of(listed, run, j)
        i = last
    return PASSED
