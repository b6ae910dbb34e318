"""Data of the compiled functions: layouts, constants and work space as named tuples of arrays."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from stickslip.arrays import Array, ByteMatrix, IntMatrix, IntVector, Matrix, Vector
from stickslip.equations.codegen.program import Program
from stickslip.machine_code.interface import Jets, Landings, Powers, Residuals, Supports
from stickslip.motion.discs.tables import DiscTape
from stickslip.translator import compiled, row_of

# Codes of motion.outcome.Outcome, and one that requests another call with a new record.
FINISHED = 0
NO_RATE = 2
ON_JUMP = 3
ZENO = 4
TINY = 5
LIMIT = 6
NEGATIVE = 7
UNDEFINED = 8
INADMISSIBLE = 14
NO_INERTIA = 16
NO_ACCELERATION = 17
NO_COLLISION = 18
CREATES_ENERGY = 19
JUMPS_MEET = 20
JUMPS_ON = 21
NO_MODE = 22
OUTSIDE_TABLE = 24
FULL = 100
# Results for a candidate mode, or for the step that led to it if it does not solve the equations.
# (SINGULAR, 1, and INDEFINITE, 6, are defined in `jets`.)
OK = 0
NAN = 2
OFF_SURFACE = 3
REJECTED = 4
OVERFLOW = 5

MOST_SHARED = 64  # largest number of contacts with shared forces in an audit: its work space is n²
# largest number of components of a state with implicit steps: their work space is n²
MOST_IMPLICIT = 500
AUDIT_NODES = 18  # largest number of nodes of an audit in a piece of a step
PER_FACE = 24  # number of rows of Space.facing for each face
NOWHERE = -1  # no row
NONE_YET = 9  # no mode of a contact

# Slots of Rows.sizes: the lengths of the state, and of its inertial, viscous, rate-independent and
# internal parts; the numbers of contacts that move coordinates of each kind; the number of kinks.
(
    DIMENSION,
    INERTIAL,
    VISCOUS,
    RATE_INDEPENDENT,
    _INTERNAL,
    ON_INERTIAL,
    ON_VISCOUS,
    ON_RATE_INDEPENDENT,
    KINKS,
) = range(9)
# Results of the compiled function `powers` of a system: energy, dissipated and supplied power.
STORED, DISSIPATED, SUPPLIED = range(3)
POWERS_MADE = 3
# Rows of Space.last_step.
PREDICTED, STARTED = range(2)
# Columns of Rows.parts: which inverse (0: inertial, 1: viscous), its first row there, how many
# coordinates and contacts, where these begin in Rows.members, and whether its matrix changes on the
# way; columns of Rows.homes.
MATRIX, FIRST_ROW, COORDINATES, CONTACTS, MEMBERS, MOVING = range(6)
PART, SEAT = range(2)
# Columns of Rows.jumps: the kink, the direction, where its parts of the state begin in
# Rows.landings, and how many they are.
KINK, WAY, FIRST_LANDING, LANDINGS = range(4)
FEWEST_ORDERS = 8  # smallest order of a Taylor series
AIMS = 15  # number of rows of Space.aims for each plane; see stickslip.motion.steps.response
# Columns of Rows.planes: the first direction, the first row of the direction of its slip (the
# others follow), the rows of |Au|, of Au, of s² − |A⁻¹λ|² with the place of its size, of s, and of
# what is not negative in slip (|Au| with mass, else n·Au), 1 for one with mass, 1 for one whose
# friction makes of Au what is not linear in its direction, the number of its formula, −1: none,
# 1 where Au is a linear combination of rates with constant coefficients, the row of the size of the
# terms of Au, and 1 where Au is not u itself.
LEAD, AIM, AIM_SPEED, AHEAD, ASIDE, ATOP, ADMISSIBLE, ADMISSIBLE_SIZE = range(8)
STATIC, SLIPS, MASSIVE, BENDS, FORMULA, AU_IS_LINEAR, AU_SIZE, HAS_AXES = range(8, 16)
# Columns of Rows.required.
REQUIRED, SLIPPING, TOWARDS = range(3)
# Columns of Rows.links.
RUBBING, PRESSING = range(2)
# Rows of Space.impact: the largest gap of a contact so far, the sense in which it slips in an
# impact; and by link, coefficients of friction against slip forward and back, and where it holds.
WIDEST, SENSE, FORWARD, BACK, HOLDS_FORWARD, HOLDS_BACK = range(6, 12)
# Slots of Lane.clock, and of Lane.counters: see there.
NOW, LAST, LONG_AGO, SPAN, RECENT, UNIT, IMPLICIT, SERIES, SINCE = range(9)
HAPPENED, SWITCHES, CAUSE, CROSSED, TAKEN, WORD = range(6)
EMPTY_WORD = 1  # word of a motion that has not entered a mode


class Rows(NamedTuple):
    """Positions of quantities in the tables of Taylor coefficients and magnitudes.

    Attributes
    ----------
    sizes : array of int
        By the slots from `DIMENSION` to `KINKS`.
    u, force, plus, minus : arrays of int
        Rows of uᵢ, λᵢ, sᵢ⁺, sᵢ⁻ by contact.
    kinks : array of int
        Rows of the guards.
    watched : array of int
        Rows that bound the step: the state, then what the guards are made of.
    noise : array of int
        Place of the size of the terms of each of these in the table of magnitudes, −1: nothing
        cancels in it.
    required : array of int, shape (·, 3)
        Rows that are REQUIRED to be nonnegative but may become negative; the contact that is
        SLIPPING and the direction TOWARDS which it does then (−1, 0: always).
    timed : array of int
        1 for each kink that comes at a time, whatever the state.
    bounded : array of int
        1 for each knot of a table that is undefined beyond one of its knots; empty if there are
        none.
    vanishing : array of int
        Part of the state that is zero where a kink is, −1 for other kinks: there powers of it have
        few derivatives.
    drops : array of int
        1 for each contact whose sliding force is not its threshold, and for each that others may
        hold since their directions depend on each other: it may be carried at its threshold, which
        is not to slip.
    program : Program
        The tape of the system.
    parts : array of int, shape (components, 6)
        Components of the linear problems of inertial, then of viscous coordinates, by the columns
        from `MATRIX` to `MOVING`.
    members : array of int
        Coordinates (among those of their kind), then contacts of each component.
    homes : array of int, shape (contacts, 2)
        Component of each contact (PART; all that are rate-independent share one behind the others),
        and its row in the inverse (SEAT).
    turning : array of int, shape (contacts, coordinates of a component)
        Rows of the coefficients of directions that change on the way; −1: constant.
    gaps, restitution : arrays of int, shape (contacts,)
        Rows of the gaps of contacts that can open, and of the restitution of these and of their
        friction; −1: none.
    links : array of int, shape (links, 2)
        Contacts that rub under a normal force (RUBBING), each with the contact that has it
        (PRESSING), contact by contact.
    first_link : array of int, shape (contacts + 1,)
        Where the links of each contact begin, and end with those of the next.
    friction : array of int, shape (links, 4)
        Rows of the coefficients: kinetic against slip forward and back, static likewise.
    alone : array of int, shape (contacts,)
        1 for each contact that holds forces without a normal force of another one, too.
    held_again : array of int, shape (contacts,)
        Whether what slips, or is open, may be held by more than its force, or from another side:
        at any time (2, in a plane), where it begins (1), or not (0).
    jumps : array of int, shape (jumps, 4)
        By the columns from `KINK` to `LANDINGS`.
    landings : array of int
        Parts of the state that have new values, jump by jump.
    planes : array of int, shape (planes, 16)
        Contacts in a plane, by the columns from `LEAD` to `HAS_AXES`.
    plane : array of int, shape (contacts,)
        Which of them each contact is a component of; −1: of none.
    massive_planes, formula_planes : arrays of int
        Those that move masses, and those whose dissipation has a formula.
    pieces : array of int, shape (pieces, 3)
        Kinks of the dissipations of planes that have a formula, the plane, and the row of the same
        function of the direction.
    in_turn : int
        1 if contacts that close at once have impacts one after the other.
    group : array of int, shape (contacts,)
        For contacts whose directions may depend on each other, friction in a plane among them:
        which of such groups each belongs to; −1: of none.
    sharing : array of int
        The contacts of these groups, by their first directions.
    bodies : array of int, shape (structures, 2)
        First coordinate and number of coordinates of each structure.
    contacts : array of int
        The first direction of each contact: one along a line has no other, one in a plane has two,
        a face has three. What is said above of a contact is said of each of these directions.
    massive_contacts : int
        How many of them move inertial coordinates; these come first.
    lead : array of int, shape (directions,)
        The first direction of the contact that each direction belongs to.
    directions, first_direction : arrays of int, shapes (directions,), (directions + 1,)
        The directions of each contact, and where they begin by its first one; others have none.
    openings, adhesive : arrays of int
        Contacts that can open; and those among them that hold a pull: they have a threshold.
    frictional : array of int
        The others, by their first directions.
    massive_frictional : int
        How many of them move inertial coordinates; these come first.
    lines : array of int
        Those that have a single direction.
    radii : array of int, shape (directions, 2)
        The rows whose mean is the radius of the set of forces: both thresholds of a line, and twice
        that of a plane or a face.
    formula : array of int, shape (directions,)
        Number of the formula of its dissipation; −1: none.
    beside : array of int, shape (directions,)
        1 for each direction that one linear problem couples to friction in a plane, whose rounding
        errors reach it then.
    made : array of int
        For each row that bounds the steps, and is a coordinate or a gap beside friction in a plane,
        the place of the size of the terms of its second derivative; −1 for others.
    states : array of int, shape (directions,)
        Number of states of each contact, by its first direction: in a plane, and of what can open,
        a slip has no sign. Other directions have one.
    guards : array of int
        The numbers of the guards that there are: of the kinks, of the contacts, and of `required`
        (:mod:`stickslip.motion.modes.guards`).
    """

    sizes: IntVector
    u: IntVector
    force: IntVector
    plus: IntVector
    minus: IntVector
    kinks: IntVector
    watched: IntVector
    noise: IntVector
    required: IntMatrix
    timed: IntVector
    bounded: IntVector
    vanishing: IntVector
    drops: IntVector
    program: Program
    parts: IntMatrix
    members: IntVector
    homes: IntMatrix
    turning: IntMatrix
    gaps: IntVector
    restitution: IntVector
    links: IntMatrix
    first_link: IntVector
    friction: IntMatrix
    alone: IntVector
    held_again: IntVector
    jumps: IntMatrix
    landings: IntVector
    planes: IntMatrix
    plane: IntVector
    massive_planes: IntVector
    formula_planes: IntVector
    pieces: IntMatrix
    in_turn: int
    group: IntVector
    sharing: IntVector
    bodies: IntMatrix
    contacts: IntVector
    massive_contacts: int
    lead: IntVector
    directions: IntVector
    first_direction: IntVector
    openings: IntVector
    adhesive: IntVector
    frictional: IntVector
    massive_frictional: int
    lines: IntVector
    radii: IntMatrix
    formula: IntVector
    beside: IntVector
    made: IntVector
    states: IntVector
    guards: IntVector


class Constants(NamedTuple):
    """Constants, mass matrix, viscous matrix, contact directions and drive frequencies for a set of
    parameters.

    A row of M, C and J has a column for each coordinate of the component that it belongs to; the
    last columns of J, from the last one back, are the coefficients of friction under normal forces,
    where these are constant.
    """

    K: Vector
    M: Matrix
    C: Matrix
    J: Matrix
    omega: Vector


class Space(NamedTuple):
    """Work space of the Taylor steps.

    Attributes
    ----------
    W, V : arrays, shapes (rows, N + 1), (rows, 2)
        Taylor coefficients, in powers of the unit of time that is the rate of the clock, row n;
        values and rates at the end of a step.
    mag : array
        Sizes of the terms of what may cancel: the scale of rounding errors.
    Rq, Rz : arrays
        Inverses of the linear problems of inertial and viscous coordinates, one component below the
        other.
    A, B, G : arrays
        Matrix, inverse and residual of the rate-independent coordinates; A also of inertial ones
        where theirs changes on the way.
    discs : array, shape (rows, 4)
        Bounds of the deviation of each row from its value at the beginning of a step, and of its
        distance from zero, see :mod:`stickslip.motion.discs`; last, of the deviation of the
        derivative of a component of the state.
    kinds : array of int
        What each row depends on; see :mod:`stickslip.motion.affine.structure`.
    nodes : array, shape (n + 1, nodes)
        Of an audit: states at the nodes of a piece, and these in the unit of its polynomials.
    samples, bernstein : arrays, shapes (rows, nodes) and (halvings, nodes)
        Of an audit: residuals and guards at the nodes of a piece, and polynomials in Bernstein's
        form.
    last_step : array, shape (2, n)
        Rates at the end of the last step according to its series, times its length (PREDICTED);
        and the state it STARTED from.
    rubbing : array of int
        Contacts that have friction in a mode; see :mod:`stickslip.motion.steps.contacts`.
    known : array of int
        Mode for which Rq and Rz were made; last entry 0 if they are valid.
    asked : array of int
        1 for each component of which a contact has changed its mode.
    stages : array
        Of implicit steps: two matrices and some vectors; see :mod:`stickslip.motion.steps.radau`.
    impact, tried : arrays
        Of impacts; see :mod:`stickslip.motion.admissible.impacts_law`.
    response, delassus, impulses : arrays, shapes (nq, mq), (mq, mq), (mq, mq + 1)
        M⁻¹Jᵀ and J M⁻¹ Jᵀ of contacts that take part in an impact, and the equations of impulses.
    cones, rays, shares, explained : arrays
        Of forces and impulses that a law allows; see :mod:`stickslip.motion.admissible.cones` and
        :mod:`stickslip.motion.audit.impulses`.
    begun, answer, aims, facing : arrays
        Of slips in a plane that begin; see :mod:`stickslip.motion.steps.starting`, and of faces,
        :mod:`stickslip.motion.steps.face_onset`.
    basis, in_basis, in_turned_basis, bend, unbent, aside, points, piece, leaving : arrays
        Of contacts that share forces; see :mod:`stickslip.motion.admissible.overload`.
    cancelling : array
        Of those among them whose directions turn; see :mod:`stickslip.motion.admissible.turning`.
    along, supported : arrays
        Vectors, and support functions there; see :mod:`stickslip.motion.steps.sets`.
    span, face, turn, turned, onset : arrays
        Of slips that begin together; see :mod:`stickslip.motion.steps.onset`.
    landed, previous_regions : arrays
        New values of the state in all jumps; and the regions before a mode is chosen, then the kink
        whose jump has just been taken, −1: none.
    interrupt, late : arrays of int, shape (1,)
        Not zero once a stop is requested, and once the time is up
        (:mod:`stickslip.stopping`).
    """

    W: Matrix
    V: Matrix
    mag: Vector
    Rq: Matrix
    Rz: Matrix
    A: Matrix
    B: Matrix
    G: Vector
    discs: Matrix
    balls: Matrix
    reaches: Vector
    kinds: IntVector
    nodes: Matrix
    samples: Matrix
    bernstein: Matrix
    scratch: Matrix
    stack: Matrix
    touched: IntVector
    y0: Vector
    trial: Vector
    last_step: Matrix
    powers: Vector
    pending: Matrix
    labels: IntMatrix
    rubbing: IntMatrix
    known: IntVector
    asked: IntVector
    stages: Matrix
    impact: Matrix
    tried: IntMatrix
    response: Matrix
    delassus: Matrix
    impulses: Matrix
    cones: Matrix
    rays: Matrix
    shares: Matrix
    explained: Matrix
    landed: Vector
    previous_regions: IntVector
    begun: Matrix
    answer: Matrix
    aims: Matrix
    facing: Matrix
    basis: Matrix
    in_basis: Matrix
    in_turned_basis: Matrix
    bend: Matrix
    unbent: Matrix
    aside: Matrix
    points: Matrix
    piece: Matrix
    cancelling: Matrix
    leaving: IntVector
    along: Matrix
    supported: Vector
    span: Matrix
    face: Matrix
    turn: Matrix
    turned: Matrix
    onset: Matrix
    interrupt: IntVector
    late: IntVector


class Lane(NamedTuple):
    """State of one motion.

    Attributes
    ----------
    clock : array
        By slots: `NOW`, the time; `LAST`, the last step; `LONG_AGO`, when an event was many events
        ago; `SPAN`, the time it may last; `RECENT`, the length of recent steps (events that
        coincide up to rounding make steps of no length); `UNIT`, the unit of time of the Taylor
        coefficients; `IMPLICIT`, the length of the next implicit step (negative: steps until one is
        tried); `SERIES`, the step that a series would have been good for; `SINCE`, the last
        event.
    y : array
        State.
    seen : array
        Largest modulus so far of each row that bounds the steps.
    mode, settled, reg : arrays of int
        Mode of each contact (0: stick; ±1: slip; ±2: at its threshold, about to slip or carried by
        others), the mode before the last event (9: none yet), and region of each kink.
    counters : array of int
        By slots: `HAPPENED`, events; `SWITCHES` of contacts; `CAUSE`, the switch that has just
        fired, or −1; `CROSSED`, kinks; `TAKEN`, steps; `WORD`, the modes that it has been in, one
        after the other, as a number (:func:`stickslip.motion.modes.guards.extended_word`).
    """

    clock: Vector
    y: Vector
    seen: Vector
    mode: IntVector
    settled: IntVector
    reg: IntVector
    counters: IntVector


class Record(NamedTuple):
    """Record of the steps: start time, state, mode, region, and the switch that caused it (−1:
    none)."""

    time: Vector
    state: Matrix
    mode: ByteMatrix
    region: ByteMatrix
    cause: IntVector


class Task(NamedTuple):
    """Arguments of a call of the event loop.

    Attributes
    ----------
    end : float
        Time at which the motions end.
    max_events : int
        After so many events they end, too.
    recording : bool
        Whether to record the steps (of a single lane).
    """

    end: float
    max_events: int
    recording: bool
    record: Record


class Machine(NamedTuple):
    """Machine code of a system: Taylor coefficients of all rows, residual of the rate-independent
    coordinates, energy with dissipated and supplied power, and new values of the state in jumps.
    """

    jets: Jets
    residual: Residuals
    powers: Powers
    landings: Landings


class Flow(NamedTuple):
    """A system with numbers, and how its motion is followed.

    Attributes
    ----------
    k : Constants
        Of one set of parameters; or of many (a leading axis).
    order : int
        Of the Taylor series.
    tol, atol : float
        Local tolerance relative to the size of the state plus `atol`.
    supports : Supports
        Support functions of the forces of contacts that have a formula.
    """

    rows: Rows
    k: Constants
    space: Space
    order: int
    tol: float
    atol: float
    supports: Supports


FlowOfMany = Annotated[Flow, "many k"]
"""With many sets of parameters."""


class Instant(NamedTuple):
    """A point of a motion: time, state, mode of each contact and region of each kink."""

    t: float
    y: Vector
    mode: IntVector
    reg: IntVector


@compiled()
def flow_of(flow: Flow, g: int) -> Flow:
    """The same for one of many sets of parameters."""
    k = row_of(flow.k, g)
    return Flow(flow.rows, k, flow.space, flow.order, flow.tol, flow.atol, flow.supports)


@compiled()
def is_stopped(space: Space) -> bool:
    """Whether compiled loops have to return."""
    return bool(space.interrupt[0] != 0 or space.late[0] != 0)


@compiled()
def tape_of(flow: Flow, N: int) -> DiscTape:
    """The tape of a system, at the instant of which the series are in the work space.

    Parameters
    ----------
    N : int
        Order of the polynomials that parts of the state are.
    """
    p, s = flow.rows.program, flow.space
    return DiscTape(p, flow.k.K, s.W, s.discs, s.Rq, s.Rz, s.B, s.balls, s.reaches, N)


@compiled()
def plain_coefficients(machine: Machine, flow: Flow, at: Instant, order: int, table: Array) -> int:
    """Taylor coefficients of all rows of the tape at an instant, up to an order, in a table;
    directions of beginning slips in a plane keep their entries there."""
    s = flow.space
    return machine.jets(
        at.t, at.y, at.mode, at.reg, flow.k.K, s.Rq, s.Rz, order, table, s.A, s.B, s.mag
    )


def make_space(rows: Rows, table_rows: int, magnitudes: int, N: int) -> Space:
    """Work space for a system."""
    n, nq, nz, nr, _, mq, mz, mr, nk = map(int, rows.sizes)
    nc = mq + mz + mr
    z = np.zeros
    widths = [
        max((int(p[COORDINATES] + p[CONTACTS]) for p in rows.parts if p[MATRIX] == i), default=0)
        for i in (0, 1)
    ]
    big = max(widths)
    moving = [int(p[COORDINATES] + p[CONTACTS]) for p in rows.parts if p[MOVING]]
    most = max([nr, *moving])  # unknowns of a problem whose matrix changes on the way
    guards = nk + 2 * nc + len(rows.required) + 1
    struck = mq if np.any(rows.gaps >= 0) or mq <= MOST_SHARED else 0
    implicit = N // 2 * n if n <= MOST_IMPLICIT else 0
    sharing = bool(np.any(rows.group >= 0))
    turning = bool(np.any(rows.turning[rows.group >= 0] >= 0))
    several = nq + 1 if sharing else 0
    bends = bool(np.any(rows.planes[:, BENDS]))
    slips = 2 * len(rows.planes) if sharing or bends else 0
    most_points = max(N + 1, AUDIT_NODES)
    W = z((table_rows, N + 1))
    V = z((table_rows, 2))
    W[n, 1] = V[n, 1] = 1.0
    return Space(
        W=W,
        V=V,
        mag=z(max(magnitudes, 1)),
        Rq=z((nq + mq, widths[0])),
        Rz=z((nz + mz, widths[1])),
        A=z((most + 3, most)),
        B=z((nr, nr)),
        G=z(2 * nr),
        discs=z((table_rows, 4)),
        balls=z((2, max(most, 1))),
        reaches=z(N + 1),
        kinds=z(table_rows, np.int64),
        nodes=z((n + 1, AUDIT_NODES)),
        samples=z((n + 3 * nc + nk, AUDIT_NODES)),
        bernstein=z((24, AUDIT_NODES)),
        scratch=z((big + 3, big)),
        stack=z((64, 36)),
        touched=z(nk + nc, np.int64),
        y0=z(n),
        trial=z(n),
        last_step=z((2, n)),
        powers=z(N + 1),
        pending=z((guards, N + 1)),
        labels=z((guards, 2), np.int64),
        rubbing=z((3, nc + 1), np.int64),
        known=np.ones(mq + mz + 1, np.int64),
        asked=z(len(rows.parts) + 1, np.int64),
        impact=z((17, max(nq, nc, len(rows.links)))),
        tried=z((6, max(nc, 1)), np.int64),
        response=z((nq, struck)),
        delassus=z((struck, struck)),
        impulses=z((struck, struck + 1)),
        cones=z((19, max(struck, len(rows.links)) if struck else 0)),
        rays=z((2 * struck + 1, 2 * struck + 1)),
        shares=z((2 * struck + 1, 2 * struck + 2)),
        explained=z((8, max(nq, nc) if struck else 0)),
        landed=z(max(len(rows.landings), 1)),
        previous_regions=np.full(nk + 1, -1, np.int64),
        begun=z((table_rows if len(rows.planes) else 0, FEWEST_ORDERS + 1)),
        answer=z((2 * len(rows.planes), 2 * len(rows.planes))),
        aims=z((AIMS * len(rows.planes), N + 1)),
        facing=z((PER_FACE * len(rows.planes), 5)),
        basis=z((several, nq)),
        in_basis=z((mq if sharing else 0, nq)),
        in_turned_basis=z((mq if sharing else 0, nq)),
        bend=z((several, nq)),
        unbent=z((several, nq)),
        aside=z((13 if sharing else 0, max(nq, mq, most_points))),
        points=z((2 * mq if sharing else 0, most_points)),
        piece=z((2 * mq if sharing else 0, most_points)),
        cancelling=z((mq * (nq + 1) if turning else 0, most_points)),
        leaving=np.full(nc, 2, np.int64),
        along=z((3, 3)),
        supported=z(13 * max(1, int(rows.planes[:, FORMULA].max(initial=-1)) + 1)),
        span=z((slips + 1, slips)),
        face=z((slips + 1, slips)),
        turn=z((2 * slips + 1, 2 * slips)),
        turned=z((2 * slips, 2 * slips)),
        onset=z((8 + slips, max(N + 2, 2 * slips))),
        interrupt=z(1, np.int64),
        late=z(1, np.int64),
        stages=z((2 * implicit + 8 + n, max(implicit, len(rows.watched), N // 2 + 1))),
    )
