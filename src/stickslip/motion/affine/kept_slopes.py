"""Slopes of modes over the state, kept from motion to motion.

They are determined by one evaluation of the equations for each component of the state, and depend
on the mode and on the constants that multiply components of the state only: not on a drive, nor on
a threshold that does not change. These constants are compared bit by bit.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array, Array3, IntMatrix, IntVector, Matrix
from stickslip.motion.affine.kept_modes import FEWEST_KEPT, KEPT_BYTES, MOST_KEPT, NEXT, USED
from stickslip.motion.steps.arrays import Constants
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.tape import Instruction, Op, rows_made, rows_read
from stickslip.translator import compiled

_LINEAR = frozenset({Op.LINEAR, Op.SELECT, Op.SIDE, Op.SPEED, Op.RIGHT, Op.SOLVE})
_UNKNOWN = frozenset({Op.IMPLICIT, Op.WITHIN})


class KeptSlopes(NamedTuple):
    """Slopes of modes, the oldest replaced by the newest.

    Attributes
    ----------
    used : array of int, shape (2,)
        How many slots are USED, and which is filled NEXT.
    scaling : array of int
        Places in K of the constants that may multiply components of the state.
    settings : array of int, shape (slots, contacts + kinks)
        Modes and regions.
    constants : array, shape (slots, constants)
        Those of K, then M, C and J.
    slopes : array, shape (slots, rows, n)
        Columns of the state of :attr:`stickslip.motion.affine.matrices.Probes.F`.
    """

    used: IntVector
    scaling: IntVector
    settings: IntMatrix
    constants: Matrix
    slopes: Array3


def make_kept_slopes(
    scaling: Array, matrices: int, switches: int, shape: tuple[int, int]
) -> KeptSlopes:
    """Allocate storage; empty for few states.

    Parameters
    ----------
    scaling : array of int
        See :class:`KeptSlopes`.
    matrices : int
        Number of entries of M, C and J.
    switches : int
        Number of contacts and kinks.
    shape : (int, int)
        Of the slopes of a mode.
    """
    rows, n = shape
    of_each = 8 * (1 + rows * n + len(scaling) + matrices + switches)
    slots = min(MOST_KEPT, KEPT_BYTES // of_each) if n >= FEWEST_KEPT else 0
    return KeptSlopes(
        np.zeros(2, np.int64),
        scaling,
        np.zeros((slots, switches), np.int64),
        np.zeros((slots, len(scaling) + matrices)),
        np.zeros((slots, rows, n)),
    )


def scaling_constants(
    instructions: Iterable[Instruction], states: int, places: Mapping[Expr, int]
) -> Array:
    """Places of the constants of a tape that may multiply components of the state.

    Parameters
    ----------
    states : int
        Number of rows of the state, the first ones.
    places : mapping of Expr to int
        Of the constants.
    """
    moving = set(range(states))
    behind = dict[int, frozenset[int]]()  # the constants that a row depends on
    found = set[int]()
    for i in instructions:
        if i.op in _UNKNOWN:
            return np.array(sorted(places.values()), dtype=np.int64)
        factors = [(part.row, places.get(part.factor)) for part in i.parts]
        for entry in i.entries:
            factors += [(None, places.get(part.factor)) for part in entry.parts]
        own = {place for _, place in factors if place is not None}
        every = frozenset(own.union(*(behind.get(row, ()) for row in rows_read(i))))
        moves = any(row in moving for row in rows_read(i))
        if i.op in (Op.LINEAR, Op.SELECT):
            found |= {place for row, place in factors if place is not None and row in moving}
        elif i.op is Op.RATES:
            # A matrix, whose entries are constants or rows; its right-hand side enters linearly.
            entries = [entry.row for entry in i.entries if entry.inputs]
            found |= own.union(*(behind.get(row, ()) for row in entries))
        elif (moves and i.op not in _LINEAR) or i.op is Op.ENTRY:
            found |= every
        if moves:
            moving |= set(rows_made(i))
        behind |= dict.fromkeys(rows_made(i), every)
    return np.array(sorted(found), dtype=np.int64)


@compiled()
def has_entries(constants: Array, at: int, matrix: Array) -> bool:
    """Whether constants from a place on are the entries of a matrix."""
    columns = matrix.shape[1]
    for i in range(matrix.shape[0]):
        for j in range(columns):
            if constants[at + i * columns + j] != matrix[i, j]:
                return False
    return True


@compiled()
def put_entries(constants: Array, at: int, matrix: Array) -> int:
    """Write the entries of a matrix into constants from a place on; returns the next place."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            constants[at] = matrix[i, j]
            at += 1
    return at


@compiled()
def is_entry(kept: KeptSlopes, slot: int, k: Constants, mode: Array, reg: Array) -> bool:
    """Whether a slot has the slopes of a mode with these constants."""
    settings, constants = kept.settings[slot], kept.constants[slot]
    for c in range(len(mode)):
        if settings[c] != mode[c]:
            return False
    for j in range(len(reg)):
        if settings[len(mode) + j] != reg[j]:
            return False
    at = len(kept.scaling)
    for i in range(at):
        if constants[i] != k.K[kept.scaling[i]]:
            return False
    same = has_entries(constants, at, k.M)
    at += k.M.shape[0] * k.M.shape[1]
    same = same and has_entries(constants, at, k.C)
    at += k.C.shape[0] * k.C.shape[1]
    return same and has_entries(constants, at, k.J)


@compiled()
def recall_slopes(kept: KeptSlopes, k: Constants, mode: Array, reg: Array, F: Array) -> bool:
    """Copy the kept slopes of a mode into the first columns of a matrix; False if there are none.

    Parameters
    ----------
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
    F : array, shape (rows, ns)
        Receives them.
    """
    rows, n = kept.slopes.shape[1], kept.slopes.shape[2]
    for slot in range(kept.used[USED]):
        if is_entry(kept, slot, k, mode, reg):
            for r in range(rows):
                for j in range(n):
                    F[r, j] = kept.slopes[slot, r, j]
            return True
    return False


@compiled()
def keep_slopes(kept: KeptSlopes, k: Constants, mode: Array, reg: Array, F: Array) -> None:
    """Store the slopes of a mode. If there is no room, they replace the oldest ones. The arguments
    are those of :func:`recall_slopes`."""
    slots = len(kept.settings)
    if slots == 0:
        return
    slot = kept.used[NEXT]
    settings, constants = kept.settings[slot], kept.constants[slot]
    for c in range(len(mode)):
        settings[c] = mode[c]
    for j in range(len(reg)):
        settings[len(mode) + j] = reg[j]
    at = len(kept.scaling)
    for i in range(at):
        constants[i] = k.K[kept.scaling[i]]
    at = put_entries(constants, at, k.M)
    at = put_entries(constants, at, k.C)
    put_entries(constants, at, k.J)
    for r in range(kept.slopes.shape[1]):
        for j in range(kept.slopes.shape[2]):
            kept.slopes[slot, r, j] = F[r, j]
    kept.used[NEXT] = (slot + 1) % slots
    kept.used[USED] = max(kept.used[USED], slot + 1)
