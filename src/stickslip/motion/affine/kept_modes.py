"""Eigenvectors of modes, kept from motion to motion.

The matrix of a mode often does not depend on what differs between two motions: the frequency and
the amplitude of a drive, a threshold. Its eigenvalue problem, which costs the third power of the
number of states, is then solved once. The matrices are compared bit by bit, so that no result
depends on what was computed before.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stickslip.arrays import (
    Array,
    Array3,
    ComplexArray3,
    ComplexMatrix,
    IntArray3,
    IntVector,
)
from stickslip.translator import compiled

# smallest number of states: for fewer, recomputation costs no more than the comparisons
FEWEST_KEPT = 16
MOST_KEPT = 64  # number of modes that are kept
KEPT_BYTES = 2**26  # largest number of bytes for them; an empty slot takes none
NOT_KEPT = -2  # instead of the number of blocks
USED, NEXT = range(2)


class KeptModes(NamedTuple):
    """Matrices of modes and their eigenvectors, the oldest replaced by the newest.

    Attributes
    ----------
    used : array of int, shape (2,)
        How many slots are USED, and which is filled NEXT.
    F : array, shape (slots, n, n)
        Rates of the state over the state.
    parts : array of int, shape (slots, 2, n)
        Which components move, and their parts, as in
        :class:`stickslip.motion.affine.forms.Making`.
    blocks : array of int, shape (slots,)
        Number of exponents, −1 if the problem is ill-conditioned.
    exponent, V, L : arrays of complex, shapes (slots, n), (slots, n, n) and (slots, n, n)
    """

    used: IntVector
    F: Array3
    parts: IntArray3
    blocks: IntVector
    exponent: ComplexMatrix
    V: ComplexArray3
    L: ComplexArray3


def make_kept_modes(n: int) -> KeptModes:
    """Allocate storage for the modes of a system with n states; empty if n is small."""
    of_each = (8 + 2 * 16) * n * n
    slots = min(MOST_KEPT, KEPT_BYTES // of_each) if n >= FEWEST_KEPT else 0
    z = np.zeros
    c = np.complex128
    return KeptModes(
        used=z(2, np.int64),
        F=z((slots, n, n)),
        parts=z((slots, 2, n), np.int64),
        blocks=z(slots, np.int64),
        exponent=z((slots, n), c),
        V=z((slots, n, n), c),
        L=z((slots, n, n), c),
    )


@compiled()
def is_same(k: KeptModes, slot: int, F: Array, moving: Array, part: Array) -> bool:
    """Whether a slot has the eigenvectors of a matrix with these parts."""
    n = len(moving)
    for i in range(n):
        if k.parts[slot, 0, i] != moving[i] or k.parts[slot, 1, i] != part[i]:
            return False
    # Modes differ in the rates of velocities, which come after those of positions.
    for i in range(n - 1, -1, -1):
        for j in range(n):
            if k.F[slot, i, j] != F[i, j]:
                return False
    return True


@compiled()
def recall(
    k: KeptModes, F: Array, moving: Array, part: Array, exponent: Array, V: Array, L: Array
) -> int:
    """Copy kept eigenvectors of a matrix; returns the number of blocks, NOT_KEPT if there are none.

    Parameters
    ----------
    exponent, V, L : arrays of complex, shapes (n,), (n, n) and (n, n)
        Receive them.
    """
    n = len(moving)
    for slot in range(k.used[USED]):
        if is_same(k, slot, F, moving, part):
            for i in range(n):
                exponent[i] = k.exponent[slot, i]
                for j in range(n):
                    V[i, j] = k.V[slot, i, j]
                    L[i, j] = k.L[slot, i, j]
            return int(k.blocks[slot])
    return NOT_KEPT


@compiled()
def keep(
    k: KeptModes,
    F: Array,
    moving: Array,
    part: Array,
    exponent: Array,
    V: Array,
    L: Array,
    blocks: int,
) -> None:
    """Keep the eigenvectors of a matrix, in place of the oldest ones if there is no room."""
    slots = len(k.blocks)
    if slots == 0:
        return
    n = len(moving)
    slot = k.used[NEXT]
    for i in range(n):
        k.parts[slot, 0, i] = moving[i]
        k.parts[slot, 1, i] = part[i]
        k.exponent[slot, i] = exponent[i]
        for j in range(n):
            k.F[slot, i, j] = F[i, j]
            k.V[slot, i, j] = V[i, j]
            k.L[slot, i, j] = L[i, j]
    k.blocks[slot] = blocks
    k.used[NEXT] = (slot + 1) % slots
    k.used[USED] = max(k.used[USED], slot + 1)
