"""The subdivision of the steps of a motion for its first variation, and its nodes, in compiled
loops."""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array
from stickslip.machine_code.functions import entry_point
from stickslip.motion.steps.arrays import Rows
from stickslip.motion.steps.sets import slides_in_plane
from stickslip.orbits.fields.engine.collocation import NODES, put_product
from stickslip.orbits.fields.engine.events import reverses
from stickslip.orbits.fields.engine.interpreter import perform
from stickslip.orbits.fields.engine.modal import LARGE, PADE_REACH, by_eigenvalues, spans_many
from stickslip.orbits.fields.engine.tables import (
    BEGINS,
    DEFECTIVE,
    RATE_KNOWN,
    STAGES,
    UNSEEN,
    Listed,
    Pass,
    PassSpace,
    put_point,
    time_of,
)
from stickslip.translator import compiled

_HALVES = 25  # halvings of the remaining time in which a slip in a plane comes to rest
_DOUBLINGS = 6  # ‖J⁶⁴‖ to the power 1/64 is the largest |eigenvalue| up to a few per cent
# products of a row after which its growth in the next ones gives the same
_ALIGNED, _MEASURED = 32, 64


@compiled()
def fastest(listed: Listed, run: Pass, work: PassSpace, w: int, knot: int) -> float:
    """Largest modulus of an eigenvalue of the Jacobian at a knot, from high powers of it.

    Parameters
    ----------
    w : int
        The piece.
    """
    J, scaled = work.squares[0], work.squares[1]
    n = len(J)
    columns = run.after.shape[1]
    put_point(work.values, 0, time_of(run, knot), run.knots.state[knot])
    perform(listed.made, listed.slopes[w, 0], listed.slopes[w, 2], work.values, 1)
    for r in range(n):
        for c in range(n):
            J[r, c] = work.values[listed.jacobian[w, r * columns + c], 0]
            if J[r, c] != J[r, c]:
                return 0.0  # a slip in a plane begins with the motion
    if n >= LARGE:
        return growth_of_rows(J, scaled)
    scale = 0.0  # log of the factor that has been divided out, per factor
    power = 1.0
    for _ in range(_DOUBLINGS + 1):
        largest = 0.0
        for r in range(n):
            for c in range(n):
                largest = max(largest, abs(J[r, c]))
        if not 0.0 < largest < np.inf:
            return 0.0
        scale += math.log(largest) / power
        power *= 2.0
        for r in range(n):
            for c in range(n):
                scaled[r, c] = J[r, c] / largest
        put_product(scaled, scaled, J)
    return math.exp(scale)


@compiled()
def growth_of_rows(J: Array, rows: Array) -> float:
    """The same by powers of a row vector: products of matrices would cost more than all else."""
    n = len(J)
    for c in range(n):
        rows[0, c] = math.cos(2.3 * c + 0.4)
    growth = 0.0
    for k in range(_ALIGNED + _MEASURED):
        now, after = rows[k % 2], rows[(k + 1) % 2]
        for c in range(n):
            after[c] = 0.0
        for r in range(n):
            factor = now[r]
            for c in range(n):
                after[c] += factor * J[r, c]
        largest = 0.0
        for c in range(n):
            largest = max(largest, abs(after[c]))
        if not 0.0 < largest < np.inf:
            return 0.0
        growth += math.log(largest) if k >= _ALIGNED else 0.0
        for c in range(n):
            after[c] /= largest
    return math.exp(growth / _MEASURED)


@compiled(brief=True)
def remember_rate(listed: Listed, run: Pass, work: PassSpace, w: int, knot: int) -> None:
    """Compute the largest modulus of an eigenvalue of a steady piece, unless its Jacobian is
    unchanged.

    Parameters
    ----------
    listed : Listed
        Receives it.
    w : int
        The piece.
    knot : int
        Where it begins.
    """
    s = listed.spectra
    matrix = s.matrix[w]
    n = len(matrix)
    columns = run.after.shape[1]
    put_point(work.values, 0, time_of(run, knot), run.knots.state[knot])
    perform(listed.made, listed.slopes[w, 0], listed.slopes[w, 2], work.values, 1)
    same = s.state[w] != UNSEEN
    for r in range(n):
        for c in range(n):
            value = work.values[listed.jacobian[w, r * columns + c], 0]
            same = same and matrix[r, c] == value
            matrix[r, c] = value
    if same:
        return
    s.rate[w] = fastest(listed, run, work, w, knot)
    s.state[w] = RATE_KNOWN if s.rate[w] > 0.0 else DEFECTIVE


@compiled()
def share_of_step(run: Pass, i: int, part: int) -> tuple[float, float]:
    """Start and length of a part of a step, as fractions of the step. All parts are equal, except
    before the end of a planar slip, where they are graded geometrically, since the Jacobian is
    singular there, as 1/abs(u)."""
    if run.parts[i] > 0:
        return part / run.parts[i], 1.0 / run.parts[i]
    share = -run.parts[i] // _HALVES
    half = part // share
    left = math.ldexp(1.0, -half)
    length = (left if half == _HALVES - 1 else 0.5 * left) / share
    return 1.0 - left + (part % share) * length, length


@entry_point()
def resolve_steps(rows: Rows, listed: Listed, run: Pass, work: PassSpace) -> int:
    """Number of parts of each step that resolve linear motions. Returns the number of nodes at
    which states are needed, or −1 if the eigenvalues of a piece are needed; its number is then the
    event.

    At the beginning and end of a planar slip the Jacobian is undefined; its formula would be a
    quotient of rounding errors.
    """
    nodes = 0
    before = -1
    for i in range(len(run.piece) - 1):
        h = time_of(run, i + 1) - time_of(run, i)
        run.parts[i] = 1
        if h > 0.0:
            w = run.piece[i]
            rate = run.drives
            if listed.steady[w] == 1:
                # the same at all places
                if w != before:
                    before = w
                    remember_rate(listed, run, work, w, i)
                rate = max(rate, listed.spectra.rate[w])
            elif i == 0 or not reverses(rows, listed, run, work, i):
                rate = max(rate, fastest(listed, run, work, w, i))
            if listed.steady[w] == 1:
                run.parts[i] = max(1, math.ceil(h * rate / PADE_REACH))
                if (
                    run.modal > 0
                    and listed.spectra.state[w] == RATE_KNOWN
                    and spans_many(listed, run, w, h)
                ):
                    run.event[BEGINS] = w
                    return -1
            elif slides_in_plane(rows, run.knots.mode[i]) and reverses(
                rows, listed, run, work, i + 1
            ):
                run.parts[i] = -_HALVES * max(1, math.ceil(0.5 * h * rate / PADE_REACH))
            else:
                if not reverses(rows, listed, run, work, i + 1):
                    rate = max(rate, fastest(listed, run, work, w, i + 1))
                run.parts[i] = max(1, math.ceil(h * rate / PADE_REACH))
        nodes += nodes_of(listed, run, i)
    return nodes


@compiled()
def nodes_of(listed: Listed, run: Pass, i: int) -> int:
    """Number of nodes of a step at which states are needed: none if the Jacobian is constant and
    there are no parameters, or for steps by eigenvalues."""
    even = listed.steady[run.piece[i]] == 1 and run.after.shape[1] == run.knots.state.shape[1]
    if even or not time_of(run, i + 1) > time_of(run, i) or by_eigenvalues(listed, run, i):
        return 0
    return STAGES * abs(run.parts[i])


@compiled()
def place_nodes(listed: Listed, run: Pass, work: PassSpace) -> None:
    """The step of each node, and its time."""
    place = 0
    for i in range(len(run.piece) - 1):
        begin = time_of(run, i)
        h = time_of(run, i + 1) - begin
        for j in range(nodes_of(listed, run, i)):
            first, length = share_of_step(run, i, j // STAGES)
            work.step[place] = i
            work.clock[place] = begin + (first + NODES[j % STAGES] * length) * h - run.origin
            place += 1
