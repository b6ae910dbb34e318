"""Data of the compiled functions of maps: named tuples of arrays, most with a row for every
motion."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stickslip.arrays import Array, Array3, Array4, IntMatrix, IntVector, Many, Matrix, Vector
from stickslip.motion.affine.forms import ClosedForms, Flight
from stickslip.motion.audit.accounts import Steps, Tally, make_steps, make_tally
from stickslip.motion.audit.observers import Sums, make_sums
from stickslip.motion.outcome import Outcome
from stickslip.motion.steps.arrays import (
    DIMENSION,
    POWERS_MADE,
    FlowOfMany,
    Lane,
    Machine,
    Record,
)

if TYPE_CHECKING:
    from stickslip.motion.problem import Problem


SETTLING = 0
PROVING = 1
MEASURING = 2
DONE = 3
WAITING = 4
"""Phases of a motion; what it settles on is proved on the host. One that is WAITING has its turn
later."""

(
    PHASE,
    COUNT,
    TRUE,
    LAG,
    SAME,
    EVENTS,
    EVENTLESS,
    STRIDE,
    LEAPT,
    STALLED,
    REST,
    HOME,
    SIZED,
    WARY,
) = range(14)
"""Columns of :attr:`Marks.numbers`."""

START, DURATION, MISS, FLOOR, STRETCH, OPEN, LEAST, PATIENT, ASK, REACH, LATEST = range(11)
"""Columns of :attr:`Marks.real`."""

ENERGY, LAW, MOTION, CLOSURE, PERIOD = range(5)
"""Columns of :attr:`Found.audit`."""


AT_FIRST, LOST, GAINED, LOWEST, HIGHEST, IMBALANCE = range(6)
"""Slots of :attr:`Bench.balance`."""

AT_REST = int(Outcome.AT_REST.code)
PERIODIC = int(Outcome.PERIODIC.code)
STEADY = int(Outcome.STEADY.code)
NOT_SETTLED = int(Outcome.NOT_SETTLED.code)
"""What a motion settles on."""

DEVICE_LANES = 16_384
"""Motions that are worked on together on a GPU, which is filled by many."""


class Engine(NamedTuple):
    """Arguments of the event loop that are the same for all lanes; see
    :func:`stickslip.motion.engine.event_loop.integrate`."""

    machine: Machine
    flow: FlowOfMany
    flight: Flight
    forms: ClosedForms
    group: IntVector
    codes: IntVector
    lanes: Many[Lane]


class Rules(NamedTuple):
    """Criteria for settled motions and their measures, the same for all lanes.

    Attributes
    ----------
    real : array
        Start, latest end and time between tests, counted from the origin of the problem; tolerance
        of settling, atol, and the largest accepted distance from a cycle.
    most : array of int
        Periods, events, marks in one call, and marks of a cycle.
    shifts : array, shape (translations, n)
        Directions, orthogonal to each other, in which the state may be shifted.
    fine : array, shape (2,)
        Tolerances with which steps are followed again.
    closely : bool
        Whether extremes, work and forces of contacts are measured.
    timed : bool
        Whether time occurs in a way that may not be periodic, which the host has to check.
    leaping : bool
        Whether limits of returns are extrapolated.
    closed : bool
        Whether there are closed forms.
    framed : bool
        Whether the frame of each lane is computed from them.
    """

    real: Vector
    most: IntVector
    shifts: Matrix
    fine: Vector
    closely: bool
    timed: bool
    leaping: bool
    closed: bool
    framed: bool


class Marks(NamedTuple):
    """Stored marks of every lane.

    Attributes
    ----------
    time, state, miss : arrays, shapes (lanes, ring), (lanes, ring, n), (lanes, ring)
        The latest marks, and how closely each comes back to the mark a lag before it.
    kind, word, events : arrays of int, shape (lanes, ring)
        Kind, which must agree for marks to be compared; mode sequence since the previous mark, as a
        number; and number of events so far.
    numbers : array of int, shape (lanes, 14)
        PHASE; COUNT of marks; marks made since the state was last changed by hand (TRUE); LAG that
        is looked at; marks at this lag in a row, less one (SAME); EVENTS at the last look; whether
        the motion has had no events for a while, so that its marks are on a plane (EVENTLESS);
        events from mark to mark, once their modes have been seen to repeat (STRIDE, else 0); leaps
        since the motion was left (LEAPT; negative: what it was taken to has been refused); marks
        since returns have last shrunk (STALLED); mark before which there is no other leap (REST);
        number of the mark that the motion is taken back to (HOME); whether the sizes are those of a
        cycle (SIZED); how often modes have to repeat before marks are put once in a STRIDE, which
        grows where they turn out not to (WARY).
    real : array, shape (lanes, 11)
        START and DURATION of the measured interval; last MISS before a leap; miss of the polished
        cycle (FLOOR), how many times farther away than that the cycle may be (STRETCH), and least
        miss of a return that is shorter (OPEN); LEAST miss at this lag; miss below which polishing
        is tried again (PATIENT); time before which no proof is tried again (ASK); length of the
        first leap (REACH); time at which the motion is given up (LATEST).
    plane : array, shape (lanes, 3, n)
        A state, the normal of the plane through it, and (first) its time.
    size : array, shape (lanes, n)
        Largest modulus of each component; once it has been measured, its size on the cycle.
    felt : array, shape (lanes,)
        Change of the forces over the measured interval.
    drive : array, shape (lanes,)
        Period of the drive; 0 if there is none.
    frame : array, shape (lanes, n)
        Velocity of the frame in which the system does not depend on time, except for its drives.
    cells : array, shape (lanes, cells, 2, n)
        Shifts of the state, with their multiples, that leave the system unchanged, and (second) the
        linear forms that count them.
    outcome : array of int, shape (lanes,)
    home, before : Lane
        State of the motion before the extrapolation, and before the last step of it.
    """

    time: Matrix
    state: Array3
    miss: Matrix
    kind: IntMatrix
    word: IntMatrix
    events: IntMatrix
    numbers: IntMatrix
    real: Matrix
    plane: Array3
    size: Matrix
    felt: Vector
    drive: Vector
    frame: Matrix
    cells: Array4
    outcome: IntVector
    home: Many[Lane]
    before: Many[Lane]


class Found(NamedTuple):
    """Measured values of every lane.

    Attributes
    ----------
    audit : array, shape (lanes, 5)
        Residual of the energy balance (ENERGY), violation of the friction LAW, defect of the
        equations of MOTION, closure error of a cycle (CLOSURE), and the square of the tolerance
        divided by the distance of the closest shorter return (PERIOD): the period is minimal if no
        shorter return closes within the tolerance.
    moves : array, shape (lanes,)
        Largest range of a component over the measured interval, relative to its modulus, without
        frame and translation.
    shift : array, shape (lanes, n)
        Shift of the state over the measured interval.
    exponent : array, shape (lanes,)
        Largest Lyapunov exponent.
    """

    sums: Many[Sums]
    audit: Matrix
    moves: Vector
    shift: Matrix
    exponent: Vector


class Bench(NamedTuple):
    """Work space in which one motion is settled and measured.

    Attributes
    ----------
    work : array, shape (9, n)
    fit : array, shape (4, 4)
        Triangular system of the returns, its right-hand side, and a row to work on.
    record : Record
        Knots; a longer interval is measured piece by piece.
    tally : Tally
        As in :func:`stickslip.motion.audit.step_balance.audit_steps`.
    gaps : array, shape (n,)
        Closure error of a cycle.
    ends : array, shape (3, n)
        Smallest and largest value of each component at the observed times, without frame and
        translation; and its size.
    balance : array, shape (6,)
        Energy AT_FIRST; dissipated (LOST) and supplied (GAINED) so far; LOWEST and HIGHEST energy;
        largest residual of the balance (IMBALANCE).
    residuals : array, shape (4,)
        See :func:`stickslip.motion.audit.step_balance.judge`.
    table, value : arrays
        Taylor coefficients and powers at an instant.
    mode, region : arrays of int
        At the first knot.
    felt : array, shape (2, 3·contacts)
        Forces and thresholds at the start and at the end.
    """

    work: Matrix
    fit: Matrix
    record: Record
    steps: Steps
    tally: Tally
    gaps: Vector
    ends: Matrix
    balance: Vector
    residuals: Vector
    table: Matrix
    value: Vector
    mode: IntVector
    region: IntVector
    felt: Matrix


def make_marks(
    drive: Array, limit: Array, cells: Array, ring: int, home: Lane, before: Lane
) -> Marks:
    """Empty marks of lanes with given periods of their drives.

    Parameters
    ----------
    drive : array, shape (lanes,)
        The periods; 0 where there is no drive.
    limit : array, shape (lanes,)
        When they are given up.
    cells : array, shape (lanes, cells, 2, n)
        See :class:`Marks`.
    ring : int
        Marks that are remembered of each lane.
    """
    lanes, n = home.y.shape
    marks = Marks(
        time=np.zeros((lanes, ring)),
        state=np.zeros((lanes, ring, n)),
        miss=np.zeros((lanes, ring)),
        kind=np.zeros((lanes, ring), np.int64),
        word=np.zeros((lanes, ring), np.int64),
        events=np.zeros((lanes, ring), np.int64),
        numbers=np.zeros((lanes, 14), np.int64),
        real=np.zeros((lanes, 11)),
        plane=np.zeros((lanes, 3, n)),
        size=np.zeros((lanes, n)),
        felt=np.zeros(lanes),
        drive=drive,
        frame=np.zeros((lanes, n)),
        cells=cells,
        outcome=np.full(lanes, -1, np.int64),
        home=home,
        before=before,
    )
    marks.numbers[:, TRUE] = -1  # the first mark is not a return
    marks.real[:, PATIENT] = np.inf
    marks.real[:, ASK] = -np.inf
    marks.real[:, LATEST] = limit
    return marks


def make_found(lanes: int, n: int, contacts: int) -> Found:
    """Nothing measured yet."""
    z = np.zeros
    sums = make_sums((lanes,), n, contacts)
    return Found(sums, z((lanes, 5)), z(lanes), z((lanes, n)), np.full(lanes, np.nan))


def make_bench(problem: Problem, room: int) -> Bench:
    """Work space for a system, in which `room` steps are measured at a time."""
    n = int(problem.rows.sizes[DIMENSION])
    contacts = len(problem.rows.u)
    kinks = len(problem.rows.kinks)
    z = np.zeros
    record = Record(
        z(room + 1),
        z((room + 1, n)),
        z((room + 1, contacts), np.int8),
        z((room + 1, kinks), np.int8),
        z(room + 1, np.int64),
    )
    table = z((problem.compiled.layout.rows, 2))
    table[n, 1] = 1.0  # unit of time of its coefficients
    return Bench(
        work=z((9, n)),
        fit=z((4, 4)),
        record=record,
        steps=make_steps(room, n),
        tally=make_tally(problem.rows),
        gaps=z(n),
        ends=z((3, n)),
        balance=z(6),
        residuals=z(4),
        table=table,
        value=z(POWERS_MADE),
        mode=z(contacts, np.int64),
        region=z(kinks, np.int64),
        felt=z((2, 3 * contacts)),
    )
