"""The moving frame in which a system under linearly growing loads V t does not depend on time,
except through its drives."""

from __future__ import annotations

import math

from stickslip.arrays import Array
from stickslip.motion.affine.forms import AFFINE, GUARDS, ClosedForms, Flight, slots_of
from stickslip.motion.affine.matrices import orthogonalise
from stickslip.numerics.levels import RANK
from stickslip.translator import compiled

_FITS = 1e-9  # largest residual of an equation, relative to its largest coefficient
_SEEN = 1e-12  # velocities below this fraction of the largest one are regarded as zero


@compiled()
def find_frame(T: ClosedForms, g: int, flight: Flight, frame: Array) -> None:
    """Compute the velocity v of the frame from the closed forms of a group; 0 if there is no frame.

    In the closed forms ẋ and the guards are linear in (x, 1, t, …), with coefficients A of x and b
    of t. A shift of the state by v Δt compensates a shift of time by Δt if A v + b = 0 for the
    rates and guards of all modes. The frame is the least-squares solution of minimum norm, if it
    satisfies all equations.

    Parameters
    ----------
    g : int
        The group.
    flight : Flight
        Work space.
    frame : array, shape (n,)
        Receives the velocity.
    """
    p = flight.making.spectrum
    right = flight.making.ones[0]
    row = p.v
    n = len(frame)
    first = g * slots_of(T)
    # QR factorisation by Givens rotations, row by row: R, and Qᵀ times the right-hand side −b.
    R = p.H[:n]
    for i in range(n):
        frame[i] = right[i] = 0.0
        for j in range(n):
            R[i, j] = 0.0
    for slot in range(first, first + T.used[g]):
        for r in range(rows_of(T, slot, n)):
            load = take_row(T, slot, r, row)
            for j in range(n):
                if row[j] == 0.0:
                    continue
                length = math.sqrt(R[j, j] * R[j, j] + row[j] * row[j])
                cosine = R[j, j] / length
                sine = row[j] / length
                for k in range(j, n):
                    x = R[j, k]
                    R[j, k] = cosine * x + sine * row[k]
                    row[k] = cosine * row[k] - sine * x
                x = right[j]
                right[j] = cosine * x - sine * load
                load = cosine * load + sine * x
    # The solution of minimum norm, by singular values: R is singular if the equations do not depend
    # on all components of v.
    orthogonalise(R, p.Q, p.scale)
    largest = 0.0
    for k in range(n):
        largest = max(largest, p.scale[k])
    for k in range(n):
        if p.scale[k] > RANK * RANK * largest:
            total = 0.0
            for i in range(n):
                total += R[i, k] * right[i]
            for i in range(n):
                frame[i] += p.Q[i, k] * total / p.scale[k]
    largest = 0.0
    for i in range(n):
        largest = max(largest, abs(frame[i]))
    # Accept v only if it satisfies all equations.
    fits = True
    for slot in range(first, first + T.used[g]):
        for r in range(rows_of(T, slot, n)):
            off = take_row(T, slot, r, row)
            for j in range(n):
                off += row[j] * frame[j]
            fits = fits and abs(off) <= _FITS
    for i in range(n):
        if not fits or abs(frame[i]) <= _SEEN * largest:
            frame[i] = 0.0


@compiled()
def rows_of(T: ClosedForms, slot: int, n: int) -> int:
    """Number of equations of a mode: its rates and guards; 0 if it is not affine."""
    return n + T.counts[slot, GUARDS] if T.status[slot] == AFFINE else 0


@compiled()
def take_row(T: ClosedForms, slot: int, r: int, row: Array) -> float:
    """Copy the coefficients of x of a rate or guard to `row`, and return that of t. Each equation
    is scaled to its largest coefficient, so that small ones are not lost in rounding errors."""
    n = len(row)
    source = T.S[slot, r] if r < n else T.G[slot, r - n]
    size = 0.0
    for j in range(n):
        size = max(size, abs(source[j]))
    size += abs(source[n + 1])
    if size == 0.0:
        size = 1.0
    for j in range(n):
        row[j] = source[j] / size
    return source[n + 1] / size
