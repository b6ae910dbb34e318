"""What the compiled functions of maps pass to each other: named tuples of arrays, most with a row for every motion."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stickslip.motion.audit import Steps, Tally, make_steps, make_tally
from stickslip.motion.forms import ClosedForms, Flight
from stickslip.motion.kernel import JETS, POWERS, RESIDUAL, Constants, Lane, Record, Rows, Space

if TYPE_CHECKING:
    from stickslip.motion.problem import Problem

Array = np.ndarray

SETTLING, MEASURING, DONE = 0, 1, 2
"""Phases of a motion."""

DEVICE_LANES = 16_384
"""Motions that are worked on together on a GPU, which is filled by many."""


class Engine(NamedTuple):
    """What the event loop takes, the same for all lanes.

    Attributes
    ----------
    jets, residual, powers
        Machine code of the system.
    slots : int
        Closed forms of each group.
    order : int
    tolerance, atol : float
        Order of the Taylor series, and local tolerance relative to the size of the state plus `atol`.
    others
        As in :func:`stickslip.motion.engine.integrate`.
    """

    jets: JETS
    residual: RESIDUAL
    powers: POWERS
    rows: Rows
    space: Space
    flight: Flight
    constants: Constants
    forms: ClosedForms
    slots: int
    order: int
    tolerance: float
    atol: float
    group: Array
    codes: Array
    lanes: Lane


class Rules(NamedTuple):
    """How motions settle and are measured, the same for all lanes.

    Attributes
    ----------
    real : array
        t₀, end, time between looks, tolerance, atol.
    most : array of int
        Periods, events, and marks in one call.
    translation : array, shape (n,)
    fine : array, shape (2,)
        Tolerances with which steps are followed again.
    closely : bool
        As in :func:`stickslip.sweeps.observers.observe`.
    """

    real: Array
    most: Array
    translation: Array
    fine: Array
    closely: bool


class Marks(NamedTuple):
    """What is remembered of every lane.

    Attributes
    ----------
    time, state, kind : arrays, shapes (lanes, ring), (lanes, ring, n), (lanes, ring)
        The latest marks; as many as a cycle may have.
    miss, lag : arrays, shape (lanes, ring)
        How closely each comes back to the mark that lies `lag` marks before it.
    numbers : array of int, shape (lanes, 6)
        Phase; marks; marks since the motion was last carried on; lag of the period; events at the last look; whether
        the motion has had no events for a while, so that its marks are on a plane.
    plane : array, shape (lanes, 3, n)
        A state, the normal of the plane through it, and (first) its time.
    size : array, shape (lanes, n)
        Largest modulus of each component.
    period : array, shape (lanes, 3)
        Start and duration of what is measured; miss of the last mark, then change of the forces in a period.
    drive : array, shape (lanes,)
        Period of the drive; 0 if there is none.
    frame : array, shape (lanes, n)
        Velocity of the frame in which the system does not depend on time, but for its drives.
    outcome : array of int, shape (lanes,)
    """

    time: Array
    state: Array
    kind: Array
    miss: Array
    lag: Array
    numbers: Array
    plane: Array
    size: Array
    period: Array
    drive: Array
    frame: Array
    outcome: Array


class Sums(NamedTuple):
    """What has been observed of a motion (or, with a leading axis, of every lane).

    Attributes
    ----------
    low, high : arrays, shape (n,)
        Least and largest value of each component.
    stick, work, peak, impulse : arrays, shape (contacts,)
        Time in stick, dissipated energy −∫λu dt, largest |λ| and ∫λ dt.
    total : array
        Duration, and the time in which all contacts stick.
    switches : array of int
        Changes between stick and slip.
    """

    low: Array
    high: Array
    stick: Array
    work: Array
    peak: Array
    impulse: Array
    total: Array
    switches: Array


class Found(NamedTuple):
    """What has been measured of every lane.

    Attributes
    ----------
    sums : Sums
    audit : array, shape (lanes, 4)
        Residual of the energy balance, violation of the friction law, defect of the equations of motion, and by how
        much a cycle fails to close.
    shift : array, shape (lanes, n)
        Of the state, in the time that is measured.
    exponent : array, shape (lanes,)
        Largest Lyapunov exponent.
    """

    sums: Sums
    audit: Array
    shift: Array
    exponent: Array


class Bench(NamedTuple):
    """Work space in which one motion is settled and measured.

    Attributes
    ----------
    work : array, shape (2, n)
    record : Record
        Knots; what does not fit is measured piece by piece.
    steps : Steps
    tally : Tally
        As in :func:`stickslip.motion.audit.audit_steps`.
    gaps : array, shape (n,)
        By how much a cycle fails to close.
    balance : array, shape (6,)
        First energy; dissipated and supplied so far; least and largest energy; largest residual.
    residuals : array, shape (4,)
        See :func:`stickslip.motion.audit.judge`.
    table, value : arrays
        Taylor coefficients and powers at an instant.
    mode, region : arrays of int
        At the first knot.
    felt : array, shape (2, 3·contacts)
        Forces and thresholds at the start and at the end.
    """

    work: Array
    record: Record
    steps: Steps
    tally: Tally
    gaps: Array
    balance: Array
    residuals: Array
    table: Array
    value: Array
    mode: Array
    region: Array
    felt: Array


def make_marks(drive: Array, ring: int, n: int) -> Marks:
    """Nothing remembered yet of lanes with these periods of their drives."""
    lanes = len(drive)
    return Marks(
        time=np.zeros((lanes, ring)),
        state=np.zeros((lanes, ring, n)),
        kind=np.zeros((lanes, ring), np.int64),
        miss=np.zeros((lanes, ring)),
        lag=np.zeros((lanes, ring), np.int64),
        numbers=np.zeros((lanes, 6), np.int64),
        plane=np.zeros((lanes, 3, n)),
        size=np.zeros((lanes, n)),
        period=np.zeros((lanes, 3)),
        drive=drive,
        frame=np.zeros((lanes, n)),
        outcome=np.full(lanes, -1, np.int64),
    )


def make_found(lanes: int, n: int, contacts: int) -> Found:
    """Nothing measured yet."""
    z = np.zeros
    sums = Sums(
        low=z((lanes, n)),
        high=z((lanes, n)),
        stick=z((lanes, contacts)),
        work=z((lanes, contacts)),
        peak=z((lanes, contacts)),
        impulse=z((lanes, contacts)),
        total=z((lanes, 2)),
        switches=z((lanes, 1), np.int64),
    )
    return Found(sums, z((lanes, 4)), z((lanes, n)), np.full(lanes, np.nan))


def make_bench(problem: Problem, room: int) -> Bench:
    """Work space for a system, in which `room` steps are measured at a time."""
    n, contacts, kinks = int(problem.rows.sizes[0]), len(problem.rows.u), len(problem.rows.kinks)
    z = np.zeros
    record = Record(
        z(room + 1),
        z((room + 1, n)),
        z((room + 1, contacts), np.int8),
        z((room + 1, kinks), np.int8),
        z(room + 1, np.int64),
    )
    return Bench(
        work=z((2, n)),
        record=record,
        steps=make_steps(room, n),
        tally=make_tally(problem.rows),
        gaps=z(n),
        balance=z(6),
        residuals=z(4),
        table=z((problem.compiled.layout.rows, 2)),
        value=z(3),
        mode=z(contacts, np.int64),
        region=z(kinks, np.int64),
        felt=z((2, 3 * contacts)),
    )
