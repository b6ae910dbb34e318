"""Modes as matrices: rates, forces and guards that are affine in the state, driven by 1, t, cos ωt
and sin ωt with the frequencies of the declaration.

The tape proves which modes are affine (:mod:`stickslip.motion.affine.structure`); probing them at a
few states and times then gives their matrices, and a few more points tell whether rounding spoils
them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array, Matrix, Vector
from stickslip.motion.affine.kept_slopes import KeptSlopes, keep_slopes, recall_slopes
from stickslip.motion.affine.structure import is_affine
from stickslip.motion.modes.inverses import resolve
from stickslip.motion.steps.arrays import (
    AHEAD,
    COORDINATES,
    DIMENSION,
    FIRST_ROW,
    INERTIAL,
    LEAD,
    MEMBERS,
    OK,
    ON_INERTIAL,
    PART,
    RATE_INDEPENDENT,
    REQUIRED,
    SEAT,
    STATIC,
    VISCOUS,
    Flow,
    Instant,
    Machine,
    Rows,
    Space,
)
from stickslip.motion.steps.contacts import directions_of, own_inverse
from stickslip.motion.steps.starting import coefficients
from stickslip.numerics.levels import COMPUTED_ZERO, EPSILON, FEW_ROUNDINGS, LAST_DIGITS
from stickslip.translator import compiled

# large enough that constants do not hide the slopes in any unit; scaling by a power of 2 is exact
_PROBE = 2.0**200
_AGES = 2.0**300  # the same for slopes in time, if there are no harmonic drives
_TURNS = 3.0  # periods of the slowest harmonic drive over which the drives are sampled
_CHECKS = 4  # number of points at which the matrices are checked
_WELL = 1e-2  # smallest singular value of a fit, relative to the largest
_SWEEPS = 30


class Probes(NamedTuple):
    """A mode as matrices, and work space to find them.

    Rows are the rates of the state, then u, λ, s⁺ and s⁻ of all contacts, guards, what must not
    become negative, and of each contact in a plane s and Au (:func:`facet_row`); columns are s =
    (x, 1, t, cos ω₁t, sin ω₁t, …).

    Attributes
    ----------
    F : array, shape (rows, ns)
        The rows are F s.
    hold : array, shape (contacts, nq + 1)
        Columns that put the velocities of sticking inertial contacts back onto their surface; last,
        the acceleration that a unit of force gives to each.
    later : array
        Times at which the system is probed for its drives, as parts of what they are looked at for.
    s, y, out, rest, peak : arrays
        An instant: drives, state, and rows; rows at rest, and the largest they have over time.
    basis, axes, lengths : arrays
        Of the fit of the drives.
    """

    F: Matrix
    hold: Matrix
    later: Vector
    s: Vector
    y: Vector
    out: Vector
    rest: Vector
    peak: Vector
    basis: Matrix
    axes: Matrix
    lengths: Vector


def make_probes(rows: Rows, waves: int, timed: bool) -> Probes:
    """Work space for the modes of a system with so many frequencies; `timed`: whether time acts."""
    n, nq = int(rows.sizes[DIMENSION]), int(rows.sizes[INERTIAL])
    nc = len(rows.u)
    drives = 2 + 2 * waves
    values = n + 4 * nc + len(rows.kinks) + len(rows.required) + 3 * len(rows.planes)
    # Many times spread over slow and fast periods keep the fit of the drives well conditioned.
    several = [(0.6180339887498949 * k) % 1.0 for k in range(1, 6 * drives)]
    later = np.array([0.0, *(several if waves else [1.0] * timed)])
    z = np.zeros
    return Probes(
        F=z((values, n + drives)),
        hold=z((nc, nq + 1)),
        later=later,
        s=z(n + drives),
        y=z(n),
        out=z(values),
        rest=z(values),
        peak=z(values),
        basis=z((len(later), drives)),
        axes=z((drives, drives)),
        lengths=z(drives),
    )


@compiled()
def facet_row(rows: Rows, p: int) -> int:
    """The first of the rows of a contact in a plane, which follow all others."""
    others = rows.sizes[DIMENSION] + 4 * len(rows.u) + len(rows.kinks) + len(rows.required)
    return int(others + 3 * p)


@compiled()
def drive_vector(t: float, omega: Array, s: Array, n: int) -> None:
    """Append the drives e = (1, t, cos ω₁t, sin ω₁t, …) to the n components of the state."""
    s[n] = 1.0
    s[n + 1] = t
    for m in range(len(omega)):
        s[n + 2 + 2 * m] = math.cos(omega[m] * t)
        s[n + 3 + 2 * m] = math.sin(omega[m] * t)


@compiled()
def linearise(
    machine: Machine, flow: Flow, mode: Array, reg: Array, w: Probes, kept: KeptSlopes
) -> bool:
    """Find the matrices of a mode; False if it has none.

    Parameters
    ----------
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
    w : Probes
        Receives them.
    kept : KeptSlopes
        Slopes over the state that are known.
    """
    rows = flow.rows
    omega = flow.k.omega
    n = rows.sizes[DIMENSION]
    F = w.F
    if not find_holds(flow, mode, w.hold):
        return False
    slowest = np.inf
    for frequency in omega:
        if frequency > 0.0:
            slowest = min(slowest, frequency)
    window = 2.0 * math.pi * _TURNS / slowest if slowest < np.inf else _AGES
    if len(omega) > 0 and not prepare_fit(omega, window, w):
        return False
    for r in range(len(F)):
        w.peak[r] = 0.0
        for j in range(F.shape[1]):
            F[r, j] = 0.0
    # Drives: at rest, at several times.
    for i in range(n):
        w.y[i] = 0.0
    for p in range(len(w.later)):
        if not probe(machine, flow, Instant(w.later[p] * window, w.y, mode, reg), w.out):
            return False
        if p == 0:
            if not is_affine(flow, mode, reg):
                return False
            for r in range(len(F)):
                w.rest[r] = w.out[r]
                F[r, n] = w.out[r] if len(omega) == 0 else 0.0
        if len(omega) > 0:
            add_to_fit(w, p, n)
        elif p > 0 and not see_slopes(w, n, window):
            return False
    if len(omega) > 0:
        for r in range(len(F)):
            for k in range(len(w.lengths)):
                if abs(F[r, n + k]) <= FEW_ROUNDINGS * w.peak[r]:
                    F[r, n + k] = 0.0
            F[r, n + 1] /= window
    if not recall_slopes(kept, flow.k, mode, reg, F):
        # One component of the state at a time.
        for j in range(n):
            w.y[j] = _PROBE
            if not probe(machine, flow, Instant(0.0, w.y, mode, reg), w.out):
                return False
            w.y[j] = 0.0
            for r in range(len(F)):
                change = w.out[r] - w.rest[r]
                if abs(change) > 2.0 * EPSILON * (abs(w.out[r]) + abs(w.rest[r])):
                    F[r, j] = change / _PROBE
        keep_slopes(kept, flow.k, mode, reg, F)
    for k in range(_CHECKS):
        # Small and large states.
        for i in range(n):
            w.y[i] = math.cos(2.3 * i + 1.7 * k + 0.4) * (1.0 if k < 2 else 37.0)
            w.s[i] = w.y[i]
        t = (0.1 * k + 0.007) * window if len(w.later) > 1 else 0.0
        drive_vector(t, omega, w.s, n)
        if not probe(machine, flow, Instant(t, w.y, mode, reg), w.out):
            return False
        for r in range(len(F)):
            total = 0.0
            terms = 0.0
            for j in range(F.shape[1]):
                total += F[r, j] * w.s[j]
                terms += abs(F[r, j] * w.s[j])
            if not abs(total - w.out[r]) <= COMPUTED_ZERO * terms:
                return False
    return True


@compiled()
def find_holds(flow: Flow, mode: Array, hold: Array) -> bool:
    """Solve the linear problems of a mode, and determine the corrections that put sticking contacts
    back onto their surface; False if they are singular, or if inertia is not constant."""
    rows = flow.rows
    space = flow.space
    nq = rows.sizes[INERTIAL]
    space.known[-1] = 1
    space.W[rows.sizes[DIMENSION], 1] = 1.0
    if not resolve(rows, flow.k, space, mode):
        return False
    for c in range(rows.sizes[ON_INERTIAL]):
        for i in range(nq + 1):
            hold[c, i] = 0.0
        if mode[c] == 0:
            part = rows.homes[c, PART]
            first = rows.parts[part, FIRST_ROW]
            for i in range(rows.parts[part, COORDINATES]):
                q = rows.members[rows.parts[part, MEMBERS] + i]
                hold[c, q] = space.Rq[first + i, rows.homes[c, SEAT] - first]
            inverse = own_inverse(rows, space, c)
            if inverse == 0.0:  # variable inertia is inverted at the beginning of a series
                return False
            hold[c, nq] = 1.0 / abs(inverse)
    return True


@compiled()
def probe(machine: Machine, flow: Flow, at: Instant, out: Array) -> bool:
    """Values of all rows at an instant; False if not all are finite."""
    if coefficients(machine, flow, at, 1, flow.space.W) != OK:
        return False
    read_values(flow.rows, flow.space, out)
    finite = True
    for value in out:
        finite = finite and np.isfinite(value)
    return finite


@compiled()
def read_values(rows: Rows, space: Space, out: Array) -> None:
    """Values for :func:`probe` at an instant, from the table of coefficients."""
    sizes = rows.sizes
    W = space.W
    mag = space.mag
    n = sizes[DIMENSION]
    nq = sizes[INERTIAL]
    nc, nk = len(rows.u), len(rows.kinks)
    for i in range(n):
        out[i] = W[i, 1]
    for c in range(nc):
        out[n + c] = settle_zero(W[rows.u[c], 0], mag[c])
        out[n + nc + c] = W[rows.force[c], 0]
        out[n + 2 * nc + c] = W[rows.plus[c], 0]
        out[n + 3 * nc + c] = W[rows.minus[c], 0]
    for j in range(nk):
        out[n + 4 * nc + j] = W[rows.kinks[j], 0]
    for d in range(len(rows.required)):
        out[n + 4 * nc + nk + d] = W[rows.required[d, REQUIRED], 0]
    for p in range(len(rows.planes)):
        plane = rows.planes[p]
        row = facet_row(rows, p)
        out[row] = W[plane[STATIC], 0]
        for i in range(len(directions_of(rows, plane[LEAD]))):
            out[row + 1 + i] = W[plane[AHEAD + i], 0]
    for i in range(nq + sizes[VISCOUS] + sizes[RATE_INDEPENDENT]):
        out[nq + i] = settle_zero(float(out[nq + i]), mag[3 * nc + nk + i])


@compiled()
def settle_zero(value: float, size: float) -> float:
    """The value, or 0 if it is only the rounding error of terms of a size."""
    return 0.0 if abs(value) <= LAST_DIGITS * size else value


@compiled()
def see_slopes(w: Probes, n: int, window: float) -> bool:
    """Slopes in time, without waves, from large times, at which the initial values are negligible.
    False if they are not constant."""
    for r in range(len(w.F)):
        change = w.out[r] - w.rest[r]
        if change != 0.0 and abs(change) < 1e-2 * abs(w.rest[r]):
            return False
        w.F[r, n + 1] = change / window
    return True


@compiled()
def prepare_fit(omega: Array, window: float, w: Probes) -> bool:
    """Orthogonalise the drives (1, t/T, cos ω₁t, …) at all times; False if they are linearly
    dependent."""
    n = len(w.y)
    for p in range(len(w.basis)):
        drive_vector(w.later[p] * window, omega, w.s, n)
        w.s[n + 1] = w.later[p]
        for k in range(len(w.axes)):
            w.basis[p, k] = w.s[n + k]
    orthogonalise(w.basis, w.axes, w.lengths)
    least = np.inf
    largest = 0.0
    for length in w.lengths:
        least = min(least, length)
        largest = max(largest, length)
    return least > _WELL * _WELL * largest


@compiled()
def orthogonalise(A: Array, axes: Array, lengths: Array) -> None:
    """Singular value decomposition by one-sided Jacobi rotations: A becomes A V, whose columns are
    orthogonal.

    Parameters
    ----------
    A : array, shape (rows, n)
    axes : array, shape (n, n)
        Receives V.
    lengths : array, shape (n,)
        Receives the squared lengths of the columns, which are the squared singular values.
    """
    n = len(axes)
    for i in range(n):
        for k in range(n):
            axes[i, k] = 1.0 if i == k else 0.0
    for _ in range(_SWEEPS):
        done = True
        for i in range(n):
            for k in range(i + 1, n):
                a = product_of_columns(A, i, i)
                b = product_of_columns(A, k, k)
                c = product_of_columns(A, i, k)
                if abs(c) <= 4.0 * EPSILON * math.sqrt(a * b):
                    continue
                done = False
                ratio = (b - a) / (2.0 * c)
                # The smaller of both roots: rotations by at most 45° converge.
                tangent = 1.0 / (abs(ratio) + math.sqrt(1.0 + ratio * ratio))
                cosine = 1.0 / math.sqrt(1.0 + tangent * tangent)
                sine = cosine * (tangent if ratio >= 0.0 else -tangent)
                rotate(A, i, k, cosine, sine)
                rotate(axes, i, k, cosine, sine)
        if done:
            break
    for k in range(n):
        lengths[k] = product_of_columns(A, k, k)


@compiled()
def product_of_columns(A: Array, i: int, k: int) -> float:
    """Scalar product of two columns."""
    total = 0.0
    for p in range(len(A)):
        total += A[p, i] * A[p, k]
    return total


@compiled()
def rotate(A: Array, i: int, k: int, cosine: float, sine: float) -> None:
    """Rotate two columns into each other.

    Parameters
    ----------
    i, k : int
        The columns.
    cosine, sine : float
        Of the angle.
    """
    for p in range(len(A)):
        x = A[p, i]
        y = A[p, k]
        A[p, i] = cosine * x - sine * y
        A[p, k] = sine * x + cosine * y


@compiled()
def add_to_fit(w: Probes, p: int, n: int) -> None:
    """Add the contribution of the values at one time to the coefficients of the drives."""
    for i in range(len(w.axes)):
        weight = 0.0
        for k in range(len(w.axes)):
            weight += w.axes[i, k] * w.basis[p, k] / w.lengths[k]
        for r in range(len(w.out)):
            w.F[r, n + i] += weight * w.out[r]
    for r in range(len(w.out)):
        w.peak[r] = max(w.peak[r], abs(w.out[r]))
