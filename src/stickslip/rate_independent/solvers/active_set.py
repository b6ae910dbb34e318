"""Many steps with a dense A and boxes K(s), in one compiled loop.

A step minimises the strictly convex function ½dᵀAd − rᵀd + Σ max(lower d, upper d). Its state is a
sign for every component: +1 or −1 moves, with the force on the upper or lower bound; 0 rests. On
the face of fixed signs the minimiser is the solution of a linear system. The iteration moves
towards it until a component comes to rest; at the minimiser of a face it releases the resting
components whose forces are out of bounds. Every step of positive length decreases the function.
Released components that would move in the wrong direction are dropped; a single released component
cannot do so, and therefore no face recurs.

The Cholesky factor of A on the moving components is kept from step to step. A change of one sign
updates it by a row (in |S|² operations, stably); a step without changes of sign needs no
factorisation.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array, IntVector, Matrix, Vector
from stickslip.machine_code.functions import entry_point
from stickslip.translator import compiled

_EPSILON = 2.2e-16  # just below the spacing of numbers at 1
_ROUNDING = 16 * _EPSILON  # rounding error of a sum of forces, relative to its largest terms
_FRESH = 200  # number of changes, besides ten per component, after which the factor is recomputed


# Slots of Face.counts.
_MOVING, _CHANGED = range(2)


class Face(NamedTuple):
    """The moving components, kept from step to step.

    Attributes
    ----------
    A, L : arrays, shape (n, n)
        The matrix, and its Cholesky factor on the moving components.
    order : array of int, shape (n,)
        The moving components, in the order of the rows of the factor.
    sign : array of int, shape (n,)
        ±1 where a component moves, with the force on the upper or lower bound; 0 where it rests.
    counts : array of int, shape (2,)
        Number of MOVING components, and how many have CHANGED since the factor was made.
    """

    A: Matrix
    L: Matrix
    order: IntVector
    sign: IntVector
    counts: IntVector


class BoxSpace(NamedTuple):
    """Work space of a step.

    Attributes
    ----------
    r : array, shape (n,)
        Force at rest.
    d, x : array, shape (n,)
        The increment, and the minimiser on a face.
    """

    r: Vector
    d: Vector
    x: Vector


def make_face(A: Array) -> Face:
    """Nothing moves yet."""
    n = len(A)
    whole = np.array(A, float, order="C")
    order = np.zeros(n, np.int64)
    return Face(whole, np.zeros((n, n)), order, np.zeros(n, np.int64), np.zeros(2, np.int64))


def make_box_space(n: int) -> BoxSpace:
    """Work space for n components."""
    return BoxSpace(np.empty(n), np.empty(n), np.empty(n))


@compiled()
def enter(A: Matrix, L: Matrix, order: IntVector, m: int, k: int) -> None:
    """Let component k move: a new last row of the factor.

    Parameters
    ----------
    A, L : array, shape (n, n)
        The matrix, and its factor on the moving components; L is written.
    order : array of int, shape (n,)
        The moving components; written.
    m : int
        How many of them there are.
    """
    square = A[k, k]
    for i in range(m):
        entry = A[k, order[i]]
        for j in range(i):
            entry -= L[m, j] * L[i, j]
        L[m, i] = entry / L[i, i]
        square -= L[m, i] * L[m, i]
    L[m, m] = math.sqrt(max(square, _EPSILON * A[k, k]))
    order[m] = k


@compiled()
def leave_face(L: Matrix, order: IntVector, m: int, k: int) -> None:
    """Let component k rest: a row of the factor goes, and rotations make it triangular again."""
    p = 0
    while order[p] != k:
        p += 1
    for i in range(p, m - 1):
        order[i] = order[i + 1]
        for j in range(i + 2):
            L[i, j] = L[i + 1, j]
    for i in range(p, m - 1):
        length = math.hypot(L[i, i], L[i, i + 1])
        c = L[i, i] / length
        s = L[i, i + 1] / length
        for j in range(i, m - 1):
            x = L[j, i]
            y = L[j, i + 1]
            L[j, i] = c * x + s * y
            L[j, i + 1] = c * y - s * x


@compiled()
def target(face: Face, r: Vector, lower: Vector, upper: Vector, x: Vector) -> None:
    """The minimiser x on the face of the given signs, 0 on resting components.

    Parameters
    ----------
    r, lower, upper : array, shape (n,)
        Force at rest, and its bounds.
    x : array, shape (n,)
        Written on the moving components.
    """
    L = face.L
    order = face.order
    m = face.counts[_MOVING]
    for i in range(m):
        k = order[i]
        entry = r[k] - (upper[k] if face.sign[k] > 0 else lower[k])
        for j in range(i):
            entry -= L[i, j] * x[order[j]]
        x[k] = entry / L[i, i]
    for i in range(m - 1, -1, -1):
        x[order[i]] /= L[i, i]
        for j in range(i):
            x[order[j]] -= L[i, j] * x[order[i]]


@compiled()
def walk_face(face: Face, d: Vector, x: Vector) -> float:
    """Move from d towards the minimiser x until components come to rest; return the fraction of the
    step."""
    sign = face.sign
    share = 1.0
    for i in range(len(d)):
        if sign[i] * x[i] < 0.0:
            share = min(share, d[i] / (d[i] - x[i]))
    for i in range(len(d)):
        if share < 1.0 and sign[i] * x[i] < 0.0 and d[i] / (d[i] - x[i]) <= share:
            leave_face(face.L, face.order, face.counts[_MOVING], i)
            d[i] = 0.0
            x[i] = 0.0
            sign[i] = 0
            face.counts[_MOVING] -= 1
            face.counts[_CHANGED] += 1
        else:
            d[i] = x[i] if share == 1.0 else d[i] + share * (x[i] - d[i])
    return share


@compiled()
def release(face: Face, r: Vector, lower: Vector, upper: Vector, noise: float, x: Vector) -> None:
    """Let the resting components move whose forces are out of bounds at the minimiser of a face.

    Parameters
    ----------
    face : Face
        Its signs and its factor are written.
    r, lower, upper : array, shape (n,)
        Force at rest, and its bounds.
    noise : float
        By which a force may be out of bounds.
    x : array, shape (n,)
        The minimiser.
    """
    sign = face.sign
    m = face.counts[_MOVING]
    for i in range(len(x)):
        if sign[i] == 0:
            force = r[i]
            for j in range(m):
                force -= face.A[i, face.order[j]] * x[face.order[j]]
            if force > upper[i] + noise:
                sign[i] = 2
            elif force < lower[i] - noise:
                sign[i] = -2
    for i in range(len(x)):
        if abs(sign[i]) == 2:
            sign[i] //= 2
            enter(face.A, face.L, face.order, face.counts[_MOVING], i)
            face.counts[_MOVING] += 1
            face.counts[_CHANGED] += 1


@compiled()
def solve_face(
    face: Face, r: Vector, lower: Vector, upper: Vector, noise: float, d: Vector, x: Vector
) -> int:
    """Solve one step in a box: the increment d, with its factor and signs.

    Forces within `noise` of a bound are on it. Returns the number of changes, or −1 if there were
    too many.

    Parameters
    ----------
    face : Face
        Start of the search; overwritten.
    r, lower, upper : array, shape (n,)
        Force at rest, and its bounds.
    d : array, shape (n,)
        Written: the increment.
    x : array, shape (n,)
        Work space.
    """
    n = len(r)
    count = face.counts
    changes = 0
    for i in range(n):
        d[i] = 0.0
        x[i] = 0.0
    while changes <= 1000 + 50 * n:
        if count[_CHANGED] > _FRESH + 10 * n:
            for i in range(count[_MOVING]):
                enter(face.A, face.L, face.order, i, face.order[i])
            count[_CHANGED] = 0
        before = count[_CHANGED]
        target(face, r, lower, upper, x)
        if walk_face(face, d, x) == 1.0:
            release(face, r, lower, upper, noise, x)
        if count[_CHANGED] == before:
            for i in range(n):
                if abs(d[i]) * face.A[i, i] <= noise:
                    d[i] = 0.0
            return changes
        changes += count[_CHANGED] - before
    return -1


@entry_point()
def advance_boxes(
    face: Face,
    z: Vector,
    loads: Matrix,
    lower: Matrix,
    upper: Matrix,
    states: Matrix,
    effort: IntVector,
    space: BoxSpace,
) -> int:
    """Steps from z through the loads, one row each; returns how many were done.

    Bounds have one row per step, or one row for all. z moves along.

    Parameters
    ----------
    face : Face
        Kept from step to step; written.
    z : array, shape (n,)
        Written.
    loads : array, shape (steps, n)
    lower, upper : array, shape (steps, n) or (1, n)
    states : array, shape (steps, n)
        Written.
    effort : array of int, shape (steps,)
        Written: changes of the signs in each step.
    """
    A = face.A
    n = len(z)
    r = space.r
    d = space.d
    for k in range(len(loads)):
        b = k if len(lower) > 1 else 0
        size = 0.0
        for i in range(n):
            r[i] = loads[k, i]
            terms = abs(loads[k, i]) + max(upper[b, i], -lower[b, i])
            for j in range(n):
                r[i] -= A[i, j] * z[j]
                terms += abs(A[i, j] * z[j])
            size = max(size, terms)
        effort[k] = solve_face(face, r, lower[b], upper[b], _ROUNDING * size, d, space.x)
        if effort[k] < 0:
            return k
        for i in range(n):
            z[i] += d[i]
            states[k, i] = z[i]
    return len(loads)
