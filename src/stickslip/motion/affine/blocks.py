"""Exponents and eigenvectors of a mode, for one connected part of the state after the other."""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.affine.forms import STIFF_RATIO, ClosedForms, Making
from stickslip.motion.affine.kept_modes import NOT_KEPT, keep, recall
from stickslip.motion.algebra.eigenvalues import decompose, invert_basis, modulus, refine_vectors
from stickslip.numerics.levels import EPSILON, FEW_ROUNDINGS, LEFT_OUT, ZERO_EIGENVALUE
from stickslip.translator import compiled

# instead of the number of a part
_FOLLOWS = -1
_LEADS = -2

_CONDITION = 1e4
_FASTEST = 1e9  # largest eigenvalue; larger ones have an extreme unit of time
_KNOWN = 1e-11  # relative change of an eigenvalue by rounding errors of the matrix
_SLOW = 1e-6  # smallest eigenvalue, relative to the largest, for a division
_REAL = 1e-12  # imaginary part of an eigenvalue relative to the largest that is a rounding error
_RESONANCE = 1e-3  # distance of an eigenvalue from a frequency, relative to it
# Component relative to the largest of an eigenvector that is regarded as zero; otherwise every
# signal would seem to contain all parts.
_ABSENT = 4e-15


@compiled()
def find_blocks(T: ClosedForms, w: Making, slot: int, omega: Array) -> int:
    """Exponents of a mode, with eigenvectors V and L = V⁻¹; returns how many there are, without
    conjugates, or −1 where they are ill-conditioned.

    What does not depend on each other is decomposed by itself, so that its zeros are exact zeros.
    """
    F = w.probes.F
    exponent = T.exponent[slot]
    find_parts(F, w.moving, w.part)
    blocks = recall(w.kept, F, w.moving, w.part, exponent, w.V, w.L)
    if blocks == NOT_KEPT:
        blocks = solve_parts(T, w, slot)
        keep(w.kept, F, w.moving, w.part, exponent, w.V, w.L, blocks)
    for b in range(blocks):
        for frequency in omega:
            away = modulus(complex(0.0, frequency) - exponent[b])
            if away <= _RESONANCE * frequency:
                return -1
    return int(blocks)


@compiled()
def solve_parts(T: ClosedForms, w: Making, slot: int) -> int:
    """Eigenvectors of all parts, then of following and leading components; returns as
    :func:`find_blocks` does, for any drives."""
    F = w.probes.F
    n = len(w.moving)
    for i in range(n):
        T.exponent[slot, i] = complex(0.0, 0.0)
        for j in range(n):
            w.V[i, j] = w.L[i, j] = complex(0.0, 0.0)
    blocks = 0
    for head in range(n):
        if w.part[head] != head:
            continue
        count = 0
        for i in range(n):
            if w.part[i] == head:
                w.members[count] = i
                count += 1
        for i in range(count):
            for j in range(count):
                w.spectrum.H[i, j] = F[w.members[i], w.members[j]]
        if not decompose(w.spectrum, count):
            return -1
        blocks = add_part(T, w, slot, count, blocks)
        if blocks < 0:
            return -1
    blocks = add_leaders(T, w, slot, blocks)
    return -1 if blocks < 0 else int(add_followers(T, w, slot, blocks))


@compiled()
def find_parts(F: Array, moving: Array, part: Array) -> None:
    """Partition the moving components by their dependencies: coupled components form parts,
    numbered by their first components; no rate depends on a component that FOLLOWS; a component
    that LEADS depends on none."""
    n = len(moving)
    for i in range(n):
        moving[i] = 0
        for j in range(F.shape[1]):
            moving[i] |= 1 if F[i, j] != 0.0 else 0
    for j in range(n):
        felt = False
        for i in range(n):
            felt = felt or F[i, j] != 0.0
        part[j] = j if felt and moving[j] == 1 else _FOLLOWS
    for i in range(n):
        led = False
        for j in range(n):
            led = led or (F[i, j] != 0.0 and moving[j] == 1)
        if part[i] >= 0 and not led:
            part[i] = _LEADS
    done = False
    while not done:
        done = True
        for i in range(n):
            for j in range(n):
                if F[i, j] != 0.0 and min(part[i], part[j]) >= 0 and part[i] != part[j]:
                    part[i] = part[j] = min(part[i], part[j])
                    done = False


@compiled()
def add_part(T: ClosedForms, w: Making, slot: int, count: int, blocks: int) -> int:
    """Add the eigenvectors of a part; returns how many blocks there are now, or −1 where they are
    ill-conditioned.

    Parameters
    ----------
    T : ClosedForms
        Filled.
    count : int
        How many components it has.
    blocks : int
        How many blocks there are so far.
    """
    p = w.spectrum
    X = p.Q
    V = w.V
    L = w.L
    largest, smallest = 0.0, np.inf
    for j in range(count):
        p.x[j] = p.values[j]
        largest = max(largest, modulus(p.values[j]))
    # The ratio of a rate to its displacement is the eigenvalue of the mode.
    scale = min(max(largest, 1.0), _FASTEST)
    for j in range(count):
        value = settled(p.values[j], largest)
        if value != 0.0j and modulus(value) < _SLOW * largest:
            return -1
        # A pair that is complex only by rounding: both parts of its vector belong to one real
        # value.
        if value.imag == 0.0 and p.values[j].imag > 0.0:
            p.values[j + 1] = value
            for i in range(count):
                z = p.vectors[i, j]
                p.vectors[i, j] = complex(z.real, 0.0)
                p.vectors[i, j + 1] = complex(z.imag, 0.0)
        p.values[j] = value
        if value != 0.0j:
            smallest = min(smallest, modulus(value))
    if not invert_basis(p, count):
        return -1
    if largest > STIFF_RATIO * smallest:
        refine_vectors(p, w.probes.F, w.members, count)
        if not invert_basis(p, count):
            return -1
    for j in range(count):
        value = p.values[j]
        if value.imag < 0.0:
            continue
        pair = value.imag > 0.0
        length = 0.0
        right = 0.0
        left = 0.0
        for i in range(count):
            z = complex(0.5 * X[j, i], -0.5 * X[j + 1, i]) if pair else complex(X[j, i], 0.0)
            L[blocks, w.members[i]] = z
            length += z.real * z.real + z.imag * z.imag
            left = max(left, modulus(z))
            right = max(right, modulus(p.vectors[i, j]))
        if not math.sqrt(length) < _CONDITION * scale:
            return -1
        for i in range(count):
            if modulus(p.vectors[i, j]) > _ABSENT * right:
                V[w.members[i], blocks] = (2.0 if pair else 1.0) * p.vectors[i, j]
            if modulus(L[blocks, w.members[i]]) <= _ABSENT * left:
                L[blocks, w.members[i]] = complex(0.0, 0.0)
        if not is_known(w, count, blocks, value):
            return -1
        if value == 0.0j and leaves_out(w, count, blocks, modulus(p.x[j]), largest, scale):
            return -1
        T.exponent[slot, blocks] = value
        blocks += 1
    return blocks


@compiled(brief=True)
def leaves_out(
    w: Making, count: int, block: int, size: float, largest: float, scale: float
) -> bool:
    """Whether setting an eigenvalue to 0 changes the matrix by more than rounding errors.

    Where eigenvectors are missing (a place and its velocity, both constant), those of two
    eigenvalues near 0 are large, and have opposite parts of the matrix.

    Parameters
    ----------
    w : Making
        With the eigenvectors, and the members of the part.
    count : int
        How many members there are.
    block : int
        Where the eigenvectors stand.
    size, largest : float
        Modulus of the eigenvalue, and of the largest one.
    scale : float
        Unit of rates beside their places.
    """
    nq = w.probes.hold.shape[1] - 1
    for i in range(count):
        for j in range(count):
            a, b = w.members[i], w.members[j]
            gone = size * modulus(w.V[a, block]) * modulus(w.L[block, b])
            if nq <= a < 2 * nq:
                gone /= scale
            if nq <= b < 2 * nq:
                gone *= scale
            if gone > LEFT_OUT * largest:
                return True
    return False


@compiled()
def is_known(w: Making, count: int, block: int, value: complex) -> bool:
    """Whether an eigenvalue is known for a turn, or a decay: rounding errors of the entries of the
    matrix change it by at most |L| |F| |V| ε.

    Where stiff and soft springs are added up in one entry, what is soft is lost; series keep the
    springs apart.

    Parameters
    ----------
    w : Making
        With the eigenvectors, and the members of the part.
    count : int
        How many members there are.
    block : int
        Where the eigenvectors stand.
    value : complex
        The eigenvalue.
    """
    F = w.probes.F
    size = modulus(value)
    if size == 0.0:
        return True
    error = 0.0
    for i in range(count):
        made = 0.0
        for j in range(count):
            made += abs(F[w.members[i], w.members[j]]) * modulus(w.V[w.members[j], block])
        error += modulus(w.L[block, w.members[i]]) * made
    return EPSILON * error <= _KNOWN * size


@compiled()
def settled(value: complex, largest: float) -> complex:
    """An eigenvalue with real and imaginary parts set to zero if they are rounding errors relative
    to the largest eigenvalue."""
    real = value.real if abs(value.real) >= ZERO_EIGENVALUE * largest else 0.0
    imag = value.imag if abs(value.imag) >= _REAL * largest else 0.0
    return complex(real, imag)


@compiled()
def add_leaders(T: ClosedForms, w: Making, slot: int, own: int) -> int:
    """Add the components with constant rates that others depend on (a block carried by a belt);
    returns as :func:`add_part` does.

    Where such a component stands still, the others have an equilibrium that follows it.
    """
    F = w.probes.F
    V = w.V
    L = w.L
    n = len(w.moving)
    blocks = own
    for k in range(n):
        if w.part[k] != _LEADS:
            continue
        for b in range(own):
            total = complex(0.0, 0.0)
            terms = 0.0
            for i in range(n):
                if w.part[i] >= 0:
                    total += L[b, i] * F[i, k]
                    terms += modulus(L[b, i]) * abs(F[i, k])
            if modulus(total) <= FEW_ROUNDINGS * terms:
                continue
            # A motion that is driven at eigenvalue 0 grows like t², which this form does not
            # contain.
            if T.exponent[slot, b] == 0.0j:
                return -1
            L[b, k] = total / T.exponent[slot, b]
        for i in range(n):
            drawn = 0.0
            terms = 0.0
            for b in range(own):
                drawn += (V[i, b] * L[b, k]).real
                terms += modulus(V[i, b]) * modulus(L[b, k])
            V[i, blocks] = complex(-drawn if abs(drawn) > FEW_ROUNDINGS * terms else 0.0, 0.0)
        V[k, blocks] = L[blocks, k] = complex(1.0, 0.0)
        T.exponent[slot, blocks] = complex(0.0, 0.0)
        blocks += 1
    return blocks


@compiled()
def add_followers(T: ClosedForms, w: Making, slot: int, own: int) -> int:
    """Add the components that no other depends on (a leg dragged along): with z = A_f A⁻¹, x_f −
    z·x is independent of the motion of the others. Returns as :func:`add_part` does."""
    F = w.probes.F
    V = w.V
    L = w.L
    n = len(w.moving)
    blocks = own
    for f in range(n):
        if w.moving[f] == 0 or w.part[f] != _FOLLOWS:
            continue
        for b in range(own):
            if T.exponent[slot, b] == 0.0j:
                return -1
            total = complex(0.0, 0.0)
            for i in range(n):
                if w.part[i] != _FOLLOWS:
                    total += F[f, i] * V[i, b]
            V[f, b] = total / T.exponent[slot, b]
        for i in range(n):
            drag = 0.0
            terms = 0.0
            for b in range(own):
                drag += (V[f, b] * L[b, i]).real
                terms += modulus(V[f, b]) * modulus(L[b, i])
            L[blocks, i] = complex(-drag if abs(drag) > FEW_ROUNDINGS * terms else 0.0, 0.0)
        V[f, blocks] = L[blocks, f] = complex(1.0, 0.0)
        T.exponent[slot, blocks] = complex(0.0, 0.0)
        blocks += 1
    return blocks
