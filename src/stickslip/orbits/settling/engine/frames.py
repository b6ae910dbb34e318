"""The frame in which a system under loads Vt does not depend on time, except for its drives."""

from __future__ import annotations

import math

from stickslip.arrays import Array
from stickslip.motion.affine.forms import AFFINE, GUARDS, ClosedForms, Flight, slots_of
from stickslip.motion.affine.matrices import orthogonalise
from stickslip.numerics.levels import RANK
from stickslip.translator import compiled

_FITS = 1e-9  # largest residual of a row relative to its size
_SEEN = 1e-12  # velocities below this fraction of the largest are regarded as zero


@compiled()
def find_frame(T: ClosedForms, g: int, flight: Flight, frame: Array) -> None:
    """Velocity of the frame, from the closed forms of a group; 0 if there is none.

    In the closed forms ẋ and the guards are linear in (x, 1, t, …): a shift of the state by v·Δt
    compensates the time if the column of t is minus the columns of x times v in all modes.

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
    # Least squares, row by row: the triangular factor, and the transformed right-hand side.
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
    # The shortest v.
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
    """Number of rows of a mode: its rates and guards."""
    return n + T.counts[slot, GUARDS] if T.status[slot] == AFFINE else 0


@compiled()
def take_row(T: ClosedForms, slot: int, r: int, row: Array) -> float:
    """The columns of x of a row of a mode, and (returned) that of t: rows are scaled to one size,
    so that rounding does not hide small rows."""
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
