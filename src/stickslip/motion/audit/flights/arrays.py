"""Closed forms as candidates of an audit, and their residuals in the equations."""

from __future__ import annotations

import cmath
from typing import NamedTuple

import numpy as np

from stickslip.arrays import (
    Array,
    Array3,
    ComplexArray3,
    ComplexMatrix,
    ComplexVector,
    IntVector,
    Matrix,
    Vector,
)
from stickslip.motion.affine.forms import (
    EXPONENTS,
    ClosedForms,
    Flight,
)
from stickslip.motion.affine.nodes import COUNT
from stickslip.motion.steps.arrays import (
    DIMENSION,
    INERTIAL,
    Rows,
)
from stickslip.translator import compiled

# length of a flight, in shortest times of its mode, above which it is checked as a whole
LONG_FLIGHT = 150.0
LARGE_STATE = 2.0**200  # a state so large that terms independent of it are negligible
UNKNOWN, KNOWN, REMEMBERED, REFUSED = range(4)
"""Whether a mode has been evaluated at its eigenvectors, in this audit or in an earlier one."""
_FEW = 8  # number of components up to which all extremes are found


class FlightAudit(NamedTuple):
    """Candidate closed forms, the results of substituting them into the equations, and work space.

    Rows of signals are rates, velocities, forces and both thresholds of all contacts, and kinks.

    Attributes
    ----------
    forms : ClosedForms
        Of the motion.
    checked : array of int, shape (2,)
        How many steps were checked as a WHOLE, and how many of these are WITHOUT_EXTREMES.
    state : array of int, shape (slots,)
        UNKNOWN, KNOWN, REMEMBERED, or REFUSED: nothing here follows such a mode.
    right : array of complex, shape (slots, rows, exponents)
        What the equations make of the eigenvectors.
    straight, turned : arrays of complex, shape (slots, exponents, exponents)
        The residuals of eigenvectors, and their conjugates, in eigenvectors.
    aside : array, shape (slots, n, exponents)
        Moduli of what of the residuals is in none.
    base, ramp, bend : arrays, shape (n,)
        q(0) without waves, its slope, and half its second derivative.
    swing : array of complex, shape (n, waves)
        Amplitudes of its waves.
    spin : array of complex, shape (waves,)
        Those of the drives at a time.
    r, begin, z : arrays of complex, shape (exponents,)
        Amplitudes at the beginning of the flight and of a part, and in a signal.
    growth : array, shape (exponents,)
        Largest growth in a flight.
    slow, states : arrays, shapes (rows, COUNT), (n, COUNT)
        Rows at q, at the nodes of a part, and q.
    line, values, points, scratch, stack : arrays
        Of a signal; see :class:`stickslip.motion.affine.modal_sums.ModalSum`.
    followed : array of int, shape (n,)
        1 for each component of which all extremes are found.
    y, x : arrays, shape (n,)
        States.
    bound, size, rest, made : arrays, shape (n,)
        By how much a flight may be off; sizes of the state; and, of residuals of q, what is in no
        eigenvector, and how large it is itself.
    still : array, shape (2, n)
        These at the first node.
    drift, turns : arrays, shape (exponents,)
        By how much residuals of q in eigenvectors differ from what they are first, and vary.
    first, last : arrays of complex, shape (exponents,)
        What they are at the first node, and were at the last one.
    moments : array of complex, shape (COUNT, exponents)
    legendre : array of complex, shape (COUNT,)
    pairs : array of complex, shape (2, exponents, exponents)
        Integrals of exponentials of sums of exponents, and of these with conjugates.
    paired : array of complex, shape (2, n, exponents)
    gram : array, shape (n + 1, n)
        ∫ x xᵀ, and its diagonal.
    before : array, shape (2, contacts)
        Impulses and work of the contacts at the beginning of a flight.
    """

    forms: ClosedForms
    flight: Flight
    checked: IntVector
    state: IntVector
    right: ComplexArray3
    straight: ComplexArray3
    turned: ComplexArray3
    aside: Array3
    base: Vector
    ramp: Vector
    bend: Vector
    swing: ComplexMatrix
    spin: ComplexVector
    r: ComplexVector
    begin: ComplexVector
    z: ComplexVector
    growth: Vector
    slow: Matrix
    states: Matrix
    line: Vector
    values: Vector
    points: Vector
    scratch: Vector
    stack: Matrix
    followed: IntVector
    y: Vector
    x: Vector
    bound: Vector
    size: Vector
    rest: Vector
    made: Vector
    still: Matrix
    drift: Vector
    turns: Vector
    first: ComplexVector
    last: ComplexVector
    moments: ComplexMatrix
    legendre: ComplexVector
    pairs: ComplexArray3
    paired: ComplexArray3
    gram: Matrix
    before: Matrix


def make_flight_audit(forms: ClosedForms, flight: Flight, rows: Rows, trusted: bool) -> FlightAudit:
    """Allocate the work space of an audit of the available closed forms.

    Parameters
    ----------
    trusted : bool
        Whether powers are quadratic; otherwise there are no candidates.
    """
    slots = int(forms.used[0]) if trusted and len(forms.status) else 0
    n, contacts = int(rows.sizes[DIMENSION]), len(rows.u)
    b = int(np.max(forms.counts[:slots, EXPONENTS], initial=0))
    waves = forms.b.shape[2]
    signals = n + 4 * contacts + len(rows.kinks)
    z = np.zeros
    c = np.complex128
    return FlightAudit(
        forms=forms,
        flight=flight,
        checked=z(2, np.int64),
        state=z(slots, np.int64),
        right=z((slots, signals, b), c),
        straight=z((slots, b, b), c),
        turned=z((slots, b, b), c),
        aside=z((slots, n, b)),
        base=z(n),
        ramp=z(n),
        bend=z(n),
        swing=z((n, waves), c),
        spin=z(waves, c),
        r=z(b, c),
        begin=z(b, c),
        z=z(b, c),
        growth=z(b),
        slow=z((signals, COUNT)),
        states=z((n, COUNT)),
        line=z(COUNT),
        values=z(COUNT),
        points=z(COUNT),
        scratch=z(COUNT),
        stack=z((24, COUNT)),
        followed=extremes_known(rows).astype(np.int64),
        y=z(n),
        x=z(n),
        bound=z(n),
        size=z(n),
        rest=z(n),
        made=z(n),
        still=z((2, n)),
        drift=z(b),
        turns=z(b),
        first=z(b, c),
        last=z(b, c),
        moments=z((COUNT, b), c),
        legendre=z(COUNT, c),
        pairs=z((2, b, b), c),
        paired=z((2, n, b), c),
        gram=z((n + 1, n)),
        before=z((2, contacts)),
    )


def has_long_flights(forms: ClosedForms, lengths: Array) -> bool:
    """Whether steps may be worth being checked as a whole."""
    slots = int(forms.used[0]) if len(forms.status) else 0
    shortest = forms.shortest[:slots]
    shortest = shortest[shortest > 0.0]
    return bool(len(shortest) and np.max(lengths, initial=0.0) > LONG_FLIGHT * np.min(shortest))


def extremes_known(rows: Rows) -> Array:
    """Components of the state whose exact extremes are found in long flights: a few that are not
    modes of structures, since fast modes would take longer than the rest of an audit."""
    known = np.ones(int(rows.sizes[DIMENSION]), dtype=bool)
    for begin, count in rows.bodies.tolist():
        for first in (begin, int(rows.sizes[INERTIAL]) + begin):
            known[first : first + count] = False
    return known if np.count_nonzero(known) <= _FEW else np.zeros_like(known)


class Stretch(NamedTuple):
    """A flight: its closed form, its start and length, the number of its parts, the number of its
    exponentials, and the length of a Taylor series."""

    slot: int
    t: float
    h: float
    parts: int
    exponents: int
    acting: float


@compiled()
def put_slow(a: FlightAudit, tau: float, omega: Array, y: Array) -> None:
    """Put q at a time of the flight into a state."""
    for m in range(len(omega)):
        a.spin[m] = cmath.exp(1j * omega[m] * tau)
    for r in range(len(y)):
        y[r] = a.base[r] + tau * (a.ramp[r] + tau * a.bend[r])
        for m in range(len(omega)):
            y[r] += (a.swing[r, m] * a.spin[m]).real


@compiled()
def slow_rate(a: FlightAudit, tau: float, omega: Array, r: int) -> float:
    """q′ at a time of the flight, at which the drives are in the work space."""
    rate = a.ramp[r] + 2.0 * tau * a.bend[r]
    for m in range(len(omega)):
        rate += (1j * omega[m] * a.swing[r, m] * a.spin[m]).real
    return float(rate)


@compiled()
def put_fast(a: FlightAudit, form: ClosedForms, s: Stretch, tau: float) -> None:
    """Put the exponentials at a time of the flight into `z`."""
    for j in range(s.exponents):
        a.z[j] = a.r[j] * cmath.exp(form.exponent[j] * tau)


@compiled()
def put_state(
    a: FlightAudit, form: ClosedForms, s: Stretch, tau: float, omega: Array, y: Array
) -> None:
    """Put p at a time of the flight into a state.

    Parameters
    ----------
    a : FlightAudit
        Receives the exponentials.
    omega : array, shape (waves,)
    y : array, shape (n,)
    """
    first = len(form.c2) - len(y)
    put_slow(a, tau, omega, y)
    put_fast(a, form, s, tau)
    for r in range(len(y)):
        for j in range(s.exponents):
            z, w = form.a[first + r, j], a.z[j]
            y[r] += z.real * w.real - z.imag * w.imag
