"""Data of the compiled functions that compute first variations of motions: named tuples of arrays,
and codes of events.

A *piece* is the vector field of one mode and region. A *pass* integrates the first variation along
a motion, from knot to knot, in all *directions* (columns of initial perturbations) together.
"""

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

STAGES = LANES  # number of Gauss nodes of a step, which has order 16
TOGETHER = 1e-9  # events closer than this fraction of the motion are simultaneous
ALIKE = 1e-8  # derivatives whose relative difference is smaller are equal
# Result of an event, or of a pass. A pass stops if it needs more space for its nodes (CROWDED), at
# a knot at which the state jumps (STRUCK), on request (HALTED), or if it needs the eigenvalues of
# a piece (SPECTRUM_ASKED); the caller then continues it.
PASSED, GRAZED, CORNER, UNEXPLAINED, CROWDED, STRUCK, HALTED, SPECTRUM_ASKED = range(8)
# Known eigenvalues of a constant Jacobian: none, the modulus of the largest one, all; or the
# eigenvectors cannot be used.
UNSEEN, RATE_KNOWN, DECOMPOSED, DEFECTIVE = range(4)
# Entries of Pass.event; the switches begin at MET.
BEGINS, ENDS, MEETING, MET = range(4)


class Spectra(NamedTuple):
    """Eigenvalues and eigenvectors of pieces with a constant Jacobian.

    Attributes
    ----------
    state : array of int, shape (pieces,)
        `UNSEEN`, `RATE_KNOWN`, `DECOMPOSED` or `DEFECTIVE`.
    rate : array, shape (pieces,)
        Estimate of the largest modulus of an eigenvalue.
    matrix : array, shape (pieces, states, states)
        The Jacobians.
    blocks : array of int, shape (pieces,)
        Number of eigenvalues, with one of each conjugate pair.
    exponent : array of complex, shape (pieces, states)
        These eigenvalues.
    right, left : arrays, shape (pieces, 2, states, states)
        Real and imaginary parts of the eigenvectors V in columns (for a conjugate pair, twice one
        of them), and of L = V⁻¹ in rows.
    slope : array, shape (pieces, parameters, states, states)
        The derivatives A_p of the Jacobian with respect to the free parameters.
    sloped : array of int, shape (pieces, parameters)
        1 if `coupled` has been computed for `slope`.
    coupled : array of complex, shape (pieces, 2 × parameters, states, states)
        L A_p V for the real and for the imaginary part of V.
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
    """Arrays for `pieces` with n states and `free` parameters; no eigenvalues are known."""
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
    """The pieces of a system as instructions for the interpreter. The columns of a derivative are
    the components of the state, followed by the free parameters.

    Attributes
    ----------
    slopes, guards : arrays of int, shape (pieces, 3)
        Ranges of the instructions for the Jacobian, and for rates and guards with their
        derivatives: the first instruction whose result is the same at all points, the first whose
        result is not, and the end.
    jacobian : array of int, shape (pieces, states × columns)
        Positions of the Jacobian in the table of values.
    rates : array of int, shape (pieces, states)
        Positions of the rates.
    falls : array of int, shape (pieces, guards, 2 + columns)
        Positions of the guards, and of their derivatives with respect to time and to the columns.
    switches : array of int, shape (pieces, guards)
        Switch of each guard; −1 for unused entries.
    settings : array of int, shape (pieces, switches)
        Mode and region of each piece.
    steady : array of int, shape (pieces,)
        1 if the Jacobian is constant.
    timely : array of int, shape (pieces,)
        1 if derivatives of the rates with respect to the free parameters depend on time only.
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
    """State of a pass along a motion.

    Attributes
    ----------
    knots : Record
        The motion.
    seen : array
        Sizes of the rows that bound its steps; see :class:`stickslip.motion.steps.arrays.Lane`.
    origin : float
        Time at which the clock of the knots is 0.
    drives : float
        Largest frequency of the loads.
    modal : int
        1 if steps may be computed from eigenvalues, 2 if several steps of a piece may be combined;
        the perturbations at the knots in between are then NaN.
    piece : array of int, shape (knots,)
        Piece of the step that begins at each knot.
    parts : array of int, shape (knots,)
        Number of parts of each step; negative if they become shorter towards its end.
    after : array, shape (knots, columns, directions)
        Perturbation of (state, p) right after each knot.
    late : array, shape (knots, directions)
        Derivatives of the time of the event at each knot; NaN if there is none. Shape (knots, 0) if
        they are not needed.
    outcome : array of int, shape (knots,)
        Outcome of the event at each knot: `PASSED` or `GRAZED`.
    event : array of int
        The event at which the pass has stopped: the knots at which it begins (`BEGINS`) and ends
        (`ENDS`), the number of switches that fire (`MEETING`), and these switches, beginning with
        the one that fires first (`MET`). For `CROWDED` and `SPECTRUM_ASKED`, `BEGINS` contains the
        required number of nodes, or the piece.
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
    """Guards of a piece at a point at which the motion may leave it.

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
        Table of values of the instructions.
    step, clock, states : arrays, shapes (nodes,), (nodes,) and (nodes, states)
        The nodes of all steps: the knot before each, its time, and its state.
    squares : array, shape (5, states, states)
    moved : array, shape (states, directions)
        A perturbation.
    modal : array, shape (2, states, directions)
        Real and imaginary parts of a perturbation in eigenvectors; this and the following arrays
        are for steps by eigenvalues, see :mod:`stickslip.orbits.fields.engine.modal`.
    moments, later : arrays of complex, shape (STAGES, states)
        Integrals of exponentials times Lagrange polynomials ℓ, and the same times 1 − x.
    driven : array of complex, shape (parameters, states)
        The integrals φ.
    legendre : array of complex, shape (STAGES + 1,)
        Integrals of an exponential times Legendre polynomials.
    grown : array of complex, shape (states,)
        exp(hλ).
    loaded, held : arrays of complex, shape (2, states, states)
        Integrals of exponentials times loads γ, and the same times h − s.
    load : array, shape (2, STAGES)
        The loads at the nodes.
    places : array of int, shape (states,)
        Positions of a vector in the table of values.
    system : array, shape (STAGES × states, STAGES × states + the larger of states and directions)
        Equations of a collocation step, with their right-hand sides.
    here, around : Leave
        Guards at an event, in the piece that ends; guards at neighbouring knots or in the next
        piece.
    usual : array, shape (guards,)
        Largest rate of each guard at the neighbouring knots.
    others : array of int, shape (guards,)
        Further guards that fire at the same time.
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
        Number of entries of the table of values.
    nodes : int
        Number of nodes of all steps together.
    shape : (int, int)
        Numbers of columns and of directions.
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
    """Time of a knot."""
    return run.knots.time[knot] + run.origin


@compiled()
def put_point(values: Array, k: int, t: float, y: Array) -> None:
    """Write time and state of a point to column k of the table of values."""
    values[0, k] = t
    for r in range(len(y)):
        values[1 + r, k] = y[r]
