"""Storage of the closed forms of affine modes, and the work space of flights.

In an affine mode the state and the drives form one vector s = (x, 1, t, cos ωₘt, sin ωₘt, …) with
ṡ = S s. Guards and components of the state are *signals*,

    g(τ) = g(0) + c₁ τ + c₂ τ² + Re Σ a r (exp(λτ) − 1) + Re Σ b (exp(iωₘτ) − 1) exp(iωₘt),

with r = R s and c₁ linear in s, and λ the eigenvalues of the mode. A *flight* is the motion up to
the first zero of a guard.
"""

from __future__ import annotations

import mmap
import weakref
from typing import Any, NamedTuple

import numpy as np

from stickslip.arrays import (
    Array,
    Array3,
    ComplexArray3,
    ComplexMatrix,
    ComplexVector,
    IntMatrix,
    IntVector,
    Matrix,
    Vector,
)
from stickslip.motion.affine.kept_modes import KeptModes, make_kept_modes
from stickslip.motion.affine.kept_slopes import KeptSlopes, make_kept_slopes
from stickslip.motion.affine.matrices import Probes, make_probes
from stickslip.motion.algebra.eigenvalues import Eigenproblem, make_eigenproblem
from stickslip.motion.steps.arrays import DIMENSION, Rows
from stickslip.translator import compiled

# Values of ClosedForms.status; 0 if the mode has not been analysed.
AFFINE = 1
SMOOTH = 2
# Values of ClosedForms.held.
SLIDES = 1
STICKS = 2
LEADING_ORDERS = 6
"""Number of derivatives, beginning with order 0, that decide the sign of a guard."""
STIFF_RATIO = 40.0
"""Ratio of rates above which a mode is stiff: flights are then always faster than steps."""
FEW_COMPONENTS = 4
"""Number of components of a state up to which none is so small that the exponentials of which it is
the sum cancel."""
FACETS = 16
"""Number of guards of a contact that sticks in a plane: sides of a polygon within its set of
forces."""
# Largest number of contacts and kinks of a system with closed forms; the number of a mode would fit
# into 64 bits up to 39.
MOST_SWITCHES = 30
_LARGE = 2**24  # number of bytes above which storage is one block
_MOST_UNUSED = 2  # blocks of each layout that wait
_ALIGNED = 64  # bytes at a multiple of which arrays begin
# Columns of ClosedForms.counts.
EXPONENTS, GUARDS, SEARCHED = range(3)


class ClosedForms(NamedTuple):
    """Closed forms of affine modes: one slot per mode, for each group of motions with the same
    parameters.

    Rows of signals are the guards, followed by the components of the state. There are as many rows
    as the largest possible number of guards, plus n.

    Attributes
    ----------
    status, key, own : arrays of int
        AFFINE, SMOOTH (not affine) or 0 (not analysed); number of the mode; number of the slot.
    counts : array of int, shape (·, 3)
        Number of EXPONENTS, of GUARDS, and of guards that are SEARCHED for zeros: a flight ends
        where one of the others may decrease to zero.
    pace : array
        Unit of time of the mode: a power of two close to its shortest time scale.
    S : array
        Matrix of ṡ = S s, in this unit.
    exponent : array of complex
        The eigenvalues λ, one of each conjugate pair.
    tilt, sine : arrays
        arg λ, and its sine.
    R : array of complex
        Matrix of the amplitudes r = R s of the exponentials.
    G, reach : arrays
        Matrix of the guards G s, and the row sums of |G| |S|ᵏ, bounds of their k-th derivatives.
    felt : array
        1 for each component of s on which rates or guards depend, otherwise 0.
    switch : array of int
        The number of each guard, as in :func:`stickslip.motion.modes.guards.scan`.
    c1, c2 : arrays
        Coefficients of the powers of τ in the signals: c₁ = c1·s, c₂ = c2.
    a, b : arrays of complex
        Coefficients of the exponentials and of the drives in the signals.
    swing : array
        Moduli of a, then of b.
    angle : array
        arg a, of guards.
    drifts, decays : arrays of int
        1 if c₁ or c₂ may differ from zero; 1 if no exponential of a guard grows.
    held : array of int
        For each contact, STICKS or SLIDES if `zero` vanishes in the mode, otherwise 0.
    zero : array
        Quantity that vanishes, zero·s: u of sticking inertial contacts, λ + σs of sliding
        rate-independent contacts.
    hold : array
        Correction of the velocities of a sticking contact.
    brake : array
        Largest acceleration by the thresholds of a contact, brake·s.
    used : array of int
        Number of slots in use, by group.
    shortest : array
        Shortest time scale, 1/max |λ|.
    flown : array of int
        1 if flights are faster than Taylor steps.
    """

    status: IntVector
    key: IntVector
    own: IntVector
    counts: IntMatrix
    pace: Vector
    S: Array3
    exponent: ComplexMatrix
    tilt: Matrix
    sine: Matrix
    R: ComplexArray3
    G: Array3
    reach: Array3
    felt: Matrix
    switch: IntMatrix
    c1: Array3
    c2: Matrix
    a: ComplexArray3
    b: ComplexArray3
    swing: Array3
    angle: Array3
    drifts: IntMatrix
    decays: IntMatrix
    held: IntMatrix
    zero: Array3
    hold: Array3
    brake: Array3
    used: IntVector
    shortest: Vector
    flown: IntVector


class _Block:
    """Arrays of zeros from one block of memory, which is used again when none of them is left.

    Parameters
    ----------
    size : int
        Its bytes; arrays that do not fit are allocated separately.
    layout : tuple of int
        What determines the arrays: first the number of groups. If there is only one, the first
        array has one entry, which counts the rows in use of the others.
    """

    def __init__(self, size: int, layout: tuple[int, ...]) -> None:
        waiting = _UNUSED.setdefault(layout, []) if layout[0] == 1 else []
        try:  # another thread may take the last one
            memory, used = waiting.pop(), True
        except IndexError:
            memory, used = _pages(size), False
        self._memory = np.frombuffer(memory, np.uint8)
        self._stale = int(self._memory[:8].view(np.int64)[0]) if used else 0
        self._used = 0
        weakref.finalize(self._memory, _put_back, layout, memory).atexit = False

    def __call__(self, shape: int | tuple[int, ...], dtype: type = np.float64) -> Any:
        """An array of zeros."""
        size = int(np.prod(shape)) * np.dtype(dtype).itemsize
        begin = self._used
        if begin + size > len(self._memory):
            return np.zeros(shape, dtype)
        self._used = begin + -(-size // _ALIGNED) * _ALIGNED
        found = self._memory[begin : begin + size].view(dtype).reshape(shape)
        found[: self._stale] = 0
        return found


_UNUSED: dict[tuple[int, ...], list[mmap.mmap]] = {}
"""Blocks of memory that wait to be used again, by the layout of their arrays."""


def _pages(size: int) -> mmap.mmap:
    """New memory, of which the system clears only the pages that are used. Pages are small, since
    the arrays of one mode are far apart."""
    if not hasattr(mmap, "MAP_PRIVATE"):
        return mmap.mmap(-1, size)
    memory = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    if hasattr(mmap, "MADV_NOHUGEPAGE"):
        memory.madvise(mmap.MADV_NOHUGEPAGE)
    return memory


def _put_back(layout: tuple[int, ...], memory: mmap.mmap) -> None:
    """Keep a block of memory for the next arrays of the same layout, unless enough wait."""
    waiting = _UNUSED.get(layout)
    if waiting is not None and len(waiting) < _MOST_UNUSED:
        waiting.append(memory)


def bytes_of_form(n: int, guards: int, contacts: int, waves: int) -> int:
    """Memory for one closed form."""
    ns = n + 2 + 2 * waves
    return ns * (8 * ns + 16 * n + 40 * (guards + n) + 8 * (guards + 3 * contacts) + _ALIGNED)


def make_closed_forms(
    groups: int,
    slots: int,
    n: int,
    contacts: int,
    kinks: int,
    required: int,
    waves: int,
    planes: int = 0,
) -> ClosedForms:
    """Empty storage of closed forms.

    Parameters
    ----------
    groups, slots : int
        Number of groups of motions with the same parameters, and of slots per group.
    n, contacts, kinks : int
        Numbers of components of the state, of contacts and of kinks.
    required : int
        Number of rows that must not become negative.
    waves : int
        Number of frequencies of the drives.
    planes : int
        Number of contacts in a plane.
    """
    guards = kinks + 2 * contacts + required + FACETS * planes
    m = groups * slots
    ns = n + 2 + 2 * waves  # components of s
    rows = guards + n
    i = np.int64
    c = np.complex128
    z = np.zeros
    size = m * bytes_of_form(n, guards, contacts, waves)
    if size > _LARGE:
        z = _Block(size, (groups, slots, n, contacts, kinks, required, waves, planes))
    used = z(groups, i)
    return ClosedForms(
        status=z(m, i),
        key=z(m, i),
        own=np.arange(m),
        counts=z((m, 3), i),
        pace=np.ones(m),
        S=z((m, ns, ns)),
        exponent=z((m, n), c),
        tilt=z((m, n)),
        sine=z((m, n)),
        R=z((m, n, ns), c),
        G=z((m, guards, ns)),
        reach=z((m, guards, LEADING_ORDERS + 1)),
        felt=z((m, ns)),
        switch=z((m, guards), i),
        c1=z((m, rows, ns)),
        c2=z((m, rows)),
        a=z((m, rows, n), c),
        b=z((m, rows, waves), c),
        swing=z((m, rows, n + waves)),
        angle=z((m, rows, n)),
        drifts=z((m, rows), i),
        decays=z((m, guards), i),
        held=z((m, contacts), i),
        zero=z((m, contacts, ns)),
        hold=z((m, contacts, n)),
        brake=z((m, contacts, ns)),
        used=used,
        shortest=z(m),
        flown=z(m, i),
    )


@compiled(inline=True)
def slots_of(T: ClosedForms) -> int:
    """Number of slots per group."""
    return len(T.status) // len(T.used)


@compiled(inline=True)
def form_of(T: ClosedForms, slot: int) -> ClosedForms:
    """The closed form in a slot: arrays without the leading axis."""
    return ClosedForms(
        T.status[slot],
        T.key[slot],
        T.own[slot],
        T.counts[slot],
        T.pace[slot],
        T.S[slot],
        T.exponent[slot],
        T.tilt[slot],
        T.sine[slot],
        T.R[slot],
        T.G[slot],
        T.reach[slot],
        T.felt[slot],
        T.switch[slot],
        T.c1[slot],
        T.c2[slot],
        T.a[slot],
        T.b[slot],
        T.swing[slot],
        T.angle[slot],
        T.drifts[slot],
        T.decays[slot],
        T.held[slot],
        T.zero[slot],
        T.hold[slot],
        T.brake[slot],
        T.used,
        T.shortest[slot],
        T.flown[slot],
    )


class Making(NamedTuple):
    """Work space for the computation of closed forms.

    Attributes
    ----------
    moving, part, members : arrays of int, shape (n,)
        1 for each component that moves; the connected part to which it belongs, or a negative code
        if it is eliminated (:mod:`stickslip.motion.affine.blocks`); the components of one part.
    V, L : arrays of complex, shape (n, n)
        Right eigenvectors (columns; for a conjugate pair, twice one of them) and left eigenvectors
        (rows): the components that move are Re V w with w = L x.
    ramp : array of complex, shape (n, ns)
        Coefficients c₁ of w.
    bend : array of complex, shape (n,)
        Coefficients c₂ of w.
    up, down : arrays of complex, shape (n, waves)
        Parts of w proportional to exp(iωₘt) and to exp(−iωₘt).
    ones : array, shape (2, ns)
        Work space for `ClosedForms.reach`.
    kept : KeptModes
        Eigenvectors of modes computed earlier in this work space.
    slopes : KeptSlopes
        Their slopes over the state.
    """

    probes: Probes
    spectrum: Eigenproblem
    moving: IntVector
    part: IntVector
    members: IntVector
    V: ComplexMatrix
    L: ComplexMatrix
    ramp: ComplexMatrix
    bend: ComplexVector
    up: ComplexMatrix
    down: ComplexMatrix
    ones: Matrix
    kept: KeptModes
    slopes: KeptSlopes


def make_making(rows: Rows, waves: int, timed: bool, known: tuple[Array, int] | None) -> Making:
    """Work space for the computation of closed forms; see :func:`make_flight`."""
    probes = make_probes(rows, waves, timed)
    scaling, matrices = known or (np.zeros(0, np.int64), 0)
    switches = len(rows.u) + len(rows.kinks)
    shape = (len(probes.F), int(rows.sizes[DIMENSION]) if known else 0)
    n = int(rows.sizes[DIMENSION])
    ns = n + 2 + 2 * waves
    z = np.zeros
    c = np.complex128
    return Making(
        probes=probes,
        spectrum=make_eigenproblem(n),
        moving=z(n, np.int64),
        part=z(n, np.int64),
        members=z(n, np.int64),
        V=z((n, n), c),
        L=z((n, n), c),
        ramp=z((n, ns), c),
        bend=z(n, c),
        up=z((n, waves), c),
        down=z((n, waves), c),
        ones=z((2, ns)),
        kept=make_kept_modes(n if known else 0),
        slopes=make_kept_slopes(scaling, matrices, switches, shape),
    )


class Flight(NamedTuple):
    """Work space of one flight.

    Attributes
    ----------
    v, size : arrays
        s and its derivatives, and the sizes of their terms.
    value, terms : arrays
        Guards and the sizes of their terms.
    orders : array of int
        Order of the first derivative of each guard that is not zero.
    r, turned : arrays of complex
        Amplitudes of the exponentials, and their changes until the end of the flight.
    modulus, phase, rounding : arrays
        |r|, arg r, and the sizes of the terms of r.
    spin : array of complex
        exp(iωₘt) at the beginning of the flight.
    a, b, z : arrays of complex
        Amplitudes of one signal, and its exponentials at the time of the search.
    window, kept : arrays
        As in :class:`stickslip.motion.affine.signals.SignalSum`.
    kind, lead, c, floor, guess : arrays
        For each guard: the kind of the signal, the index of its only exponential, its coefficients
        of powers of τ, the rounding error of its values, and an estimate of its zero.
    taylor : array
        Polynomial of a signal in one window of the search.
    stack : array
        Work space for the subdivision of this polynomial.
    mode0, reg0 : arrays of int
        Mode and region at the beginning of the flight.
    making : Making
        Work space for new closed forms.
    """

    v: Matrix
    size: Matrix
    value: Vector
    terms: Vector
    orders: IntVector
    r: ComplexVector
    turned: ComplexVector
    modulus: Vector
    phase: Vector
    rounding: Vector
    spin: ComplexVector
    a: ComplexVector
    b: ComplexVector
    z: ComplexVector
    window: Vector
    kept: ComplexVector
    kind: IntVector
    lead: IntVector
    c: Matrix
    floor: Vector
    guess: Vector
    taylor: Vector
    stack: Matrix
    mode0: IntVector
    reg0: IntVector
    making: Making


def make_flight(
    rows: Rows, waves: int, timed: bool, known: tuple[Array, int] | None = None
) -> Flight:
    """Work space of the flights of a system.

    Parameters
    ----------
    waves : int
        Number of frequencies of the drives.
    timed : bool
        Whether the rates depend on time.
    known : (array of int, int), optional
        As in :func:`stickslip.motion.affine.kept_slopes.make_kept_slopes`, if slopes and
        eigenvectors of modes are stored for reuse.
    """
    z = np.zeros
    c = np.complex128
    orders = LEADING_ORDERS + 1
    n = int(rows.sizes[DIMENSION])
    contacts, kinks = len(rows.u), len(rows.kinks)
    ns = n + 2 + 2 * waves
    guards = kinks + 2 * contacts + len(rows.required) + FACETS * len(rows.planes) + 1
    return Flight(
        v=z((orders, ns)),
        size=z((orders, ns)),
        value=z(guards),
        terms=z(guards),
        orders=z(guards, np.int64),
        r=z(n, c),
        turned=z(n, c),
        modulus=z(n),
        phase=z(n),
        rounding=z(n),
        spin=z(waves, c),
        a=z(n, c),
        b=z(waves, c),
        z=z(n, c),
        window=z(n),
        kept=z(n, c),
        kind=z(guards, np.int64),
        lead=z(guards, np.int64),
        c=z((guards, 3)),
        floor=z(guards),
        guess=z(guards),
        taylor=z(33),
        stack=z((64, 36)),
        mode0=z(contacts, np.int64),
        reg0=z(kinks, np.int64),
        making=make_making(rows, waves, timed, known),
    )
