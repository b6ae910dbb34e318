"""Data of the compiled functions of first variations: named tuples of arrays, and codes of
events."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stickslip.arrays import (
    Array,
    Array3,
    Array4,
    ComplexArray3,
    ComplexArray4,
    ComplexMatrix,
    ComplexVector,
    IntArray3,
    IntMatrix,
    IntVector,
    Matrix,
    Vector,
)
from stickslip.motion.between.dense import Scratch
from stickslip.motion.steps.arrays import Record
from stickslip.orbits.fields.engine.interpreter import LANES, Instructions
from stickslip.translator import compiled

STAGES = LANES  # Gauss nodes of a step: order 16
TOGETHER = 1e-9  # events closer than this part of the motion are simultaneous
ALIKE = 1e-8  # derivatives that differ by less, relative to the largest, are the same
# Result of an event, or of the pass: it may need more room for its nodes, or be at a knot at which
# the state jumps, or request the eigenvalues of a piece. State of the eigenvalues of a Jacobian:
# none known, the largest, all, or not usable.
PASSED, GRAZED, CORNER, UNEXPLAINED, CROWDED, STRUCK, HALTED, SPECTRUM_ASKED = range(8)
UNSEEN, RATE_KNOWN, DECOMPOSED, DEFECTIVE = range(4)
# Entries of Pass.event.
BEGINS, ENDS, MEETING, MET = range(4)


class Spectra(NamedTuple):
    """Constant Jacobians of pieces, by their eigenvalues.

    Attributes
    ----------
    state : array of int, shape (pieces,)
        `UNSEEN`, `RATE_KNOWN`, `DECOMPOSED` or `DEFECTIVE`.
    rate : array, shape (pieces,)
        Largest modulus of an eigenvalue, about.
    matrix : array, shape (pieces, states, states)
        The Jacobians.
    blocks : array of int, shape (pieces,)
        Eigenvalues without the conjugates.
    exponent : array of complex, shape (pieces, states)
    right, left : arrays, shape (pieces, 2, states, states)
        Real and imaginary parts of the eigenvectors V in columns, of a conjugate pair twice the one
        that is kept, and of L = V⁻¹ in rows.
    slope : array, shape (pieces, parameters, states, states)
        The derivatives A_p of the Jacobian by the free parameters.
    sloped : array of int, shape (pieces, parameters)
        1 where `coupled` belongs to them.
    coupled : array of complex, shape (pieces, 2 × parameters, states, states)
        L A_p V, of the real and of the imaginary part of V.
    """

    state: IntVector
    rate: Vector
    matrix: Array3
    blocks: IntVector
    exponent: ComplexMatrix
    right: Array4
    left: Array4
    slope: Array4
    sloped: IntMatrix
    coupled: ComplexArray4


def make_spectra(pieces: int, n: int, free: int) -> Spectra:
    """Space for the eigenvalues of some pieces with n states and some free parameters."""
    return Spectra(
        np.zeros(pieces, np.int64),
        np.zeros(pieces),
        np.zeros((pieces, n, n)),
        np.zeros(pieces, np.int64),
        np.zeros((pieces, n), np.complex128),
        np.zeros((pieces, 2, n, n)),
        np.zeros((pieces, 2, n, n)),
        np.zeros((pieces, free, n, n)),
        np.zeros((pieces, free), np.int64),
        np.zeros((pieces, 2 * free, n, n), np.complex128),
    )


class Listed(NamedTuple):
    """The pieces of a system as instructions. A column is a component of the state or, behind
    these, a free parameter.

    Attributes
    ----------
    slopes, guards : arrays of int, shape (pieces, 3)
        Ranges of the instructions for the Jacobian, and for rates and guards with their slopes: the
        first that is the same for all points, the first that is not, and the end.
    jacobian : array of int, shape (pieces, states × columns)
        Places of the Jacobian in the table of values.
    rates : array of int, shape (pieces, states)
        Places of the rates.
    falls : array of int, shape (pieces, guards, 2 + columns)
        Places of the guards, and of their derivatives with respect to time and to the columns.
    switches : array of int, shape (pieces, guards)
        Switch of each guard; −1 if there is none.
    settings : array of int, shape (pieces, switches)
    steady : array of int, shape (pieces,)
        1 if the Jacobian is constant.
    timely : array of int, shape (pieces,)
        1 if derivatives of the rates with respect to the free parameters depend on time alone.
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
    timely: IntVector
    spectra: Spectra


class Pass(NamedTuple):
    """State of a pass that differentiates a motion.

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
    modal : int
        1 if steps may be taken by eigenvalues, 2 if several steps of a piece may be taken as one;
        the changes in between are then NaN.
    piece : array of int, shape (knots,)
        Piece of the step that begins at each.
    parts : array of int, shape (knots,)
        Number of parts of each step; negative if they become shorter towards its end.
    after : array, shape (knots, columns, directions)
        Change of (state, p) right after each knot.
    late : array, shape (knots, directions)
        Derivatives of the time of the event at each knot; NaN if there is none. Without columns if
        they are not needed.
    outcome : array of int, shape (knots,)
        Outcome of the event at each knot: `PASSED` or `GRAZED`.
    event : array of int
        The event at which the pass has stopped: the knots at which it begins and ends, the number
        of switches that are meeting there, and these, the one that fired first.
    """

    knots: Record
    seen: Vector
    origin: float
    drives: float
    modal: int
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
    modal : array, shape (2, states, directions)
        Real and imaginary parts of a perturbation in eigenvectors; this and the following arrays
        are for steps by eigenvalues.
    moments, later : arrays of complex, shape (STAGES, states)
    driven : array of complex, shape (parameters, states)
    legendre : array of complex, shape (STAGES + 1,)
    grown : array of complex, shape (states,)
    loaded, held : arrays of complex, shape (2, states, states)
    load : array, shape (2, STAGES)
    places : array of int, shape (states,)
    system : array, shape (STAGES × states, STAGES × states + the larger of states and directions)
    usual : array, shape (guards,)
    others : array of int, shape (guards,)
    """

    values: Matrix
    step: IntVector
    clock: Vector
    states: Matrix
    squares: Array3
    moved: Matrix
    modal: Array3
    moments: ComplexMatrix
    later: ComplexMatrix
    driven: ComplexMatrix
    legendre: ComplexVector
    grown: ComplexVector
    loaded: ComplexArray3
    held: ComplexArray3
    load: Matrix
    places: IntVector
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
    places : int
        In the table of values.
    shape : (int, int)
        Columns and directions.
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
        np.zeros((2, n, directions)),
        np.zeros((STAGES, n), complex),
        np.zeros((STAGES, n), complex),
        np.zeros((columns - n, n), complex),
        np.zeros(STAGES + 1, complex),
        np.zeros(n, complex),
        np.zeros((2, n, n), complex),
        np.zeros((2, n, n), complex),
        np.zeros((2, STAGES)),
        np.zeros(n, np.int64),
        np.zeros((STAGES * n, STAGES * n + max(n, directions))),
        leave(),
        leave(),
        np.zeros(guards),
        np.zeros(guards, np.int64),
        between,
    )


@compiled()
def time_of(run: Pass, knot: int) -> float:
    """When a knot is."""
    return run.knots.time[knot] + run.origin


@compiled()
def put_point(values: Array, k: int, t: float, y: Array) -> None:
    """Write a point into the table of values."""
    values[0, k] = t
    for r in range(len(y)):
        values[1 + r, k] = y[r]
