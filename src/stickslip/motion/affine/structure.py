"""Classification of the rows of a tape in one mode: proof that a mode is affine.

Random probes cannot tell: a pulse may be zero at all of them. So the tape is followed once with,
for every row, what it may depend on: nothing (then its value counts), time, the state, waves of
time, or anything in another way.
"""

from __future__ import annotations

from stickslip.arrays import Array
from stickslip.equations.codegen.program import (
    FIRST,
    FOURTH,
    OPERATION,
    PLACE,
    RESULT,
    SECOND,
    SIZE,
    THIRD,
)
from stickslip.motion.discs.spreading import side_operand
from stickslip.motion.discs.tables import (
    DIRECTION_ROW,
    ENTRY,
    HYPERBOLIC,
    IMPLICIT_ROW,
    LINEAR,
    PRODUCT,
    QUOTIENT,
    RATES,
    RIGHT,
    ROTATION,
    SELECT,
    SIDE,
    SOLVE,
    SPEED,
    STEADY_ROW,
    TAN,
    TANH,
    WITHIN,
    factor,
)
from stickslip.motion.steps.arrays import (
    ADMISSIBLE,
    AHEAD,
    DIMENSION,
    LEAD,
    SLIPS,
    STATIC,
    Flow,
    Rows,
)
from stickslip.motion.steps.contacts import directions_of
from stickslip.translator import compiled

# Bits, but for the first.
_NOTHING = 0
_TIME = 1
_STATE = 2
_WAVE = 4
_OTHER = 8


@compiled()
def is_affine(flow: Flow, mode: Array, reg: Array) -> bool:
    """Whether the rates and all guards of a mode are affine in the state, with drives 1, t, cos ωt
    and sin ωt.

    The table holds the values of all rows, of order 0, at some state.
    """
    rows = flow.rows
    p = rows.program
    kinds = flow.space.kinds
    n = rows.sizes[DIMENSION]
    for r in range(n):
        kinds[r] = _STATE
    kinds[n] = _TIME
    for i in range(len(p.code)):
        row = p.code[i, RESULT]
        kind = row_kind(flow, mode, reg, i)
        size = p.code[i, SIZE]
        for j in range(max(size, 1)):
            kinds[row + j] = kind
        op = p.code[i, OPERATION]
        if ROTATION <= op <= HYPERBOLIC or op in (TAN, TANH):
            kinds[row + 1] = kind
    found = _NOTHING
    for r in p.rates:
        found |= kinds[r]
    for r in rows.watched:
        found |= kinds[r] if not guards_disc(rows, r) else _NOTHING
    for plane in rows.planes:
        found |= kinds[plane[STATIC]]
        for i in range(len(directions_of(rows, plane[LEAD]))):
            found |= kinds[plane[AHEAD + i]]
    for d in range(len(rows.required)):
        found |= kinds[rows.required[d, 0]]
    return found & _OTHER == 0


@compiled()
def guards_disc(rows: Rows, r: int) -> bool:
    """Whether a row is the guard of a contact in a plane: it is a square, and sides of a polygon
    are asked instead (:func:`stickslip.motion.affine.closed_forms.put_facets`)."""
    found = False
    for plane in rows.planes:
        found = found or plane[ADMISSIBLE] == r or plane[SLIPS] == r
    return bool(found)


@compiled()
def row_kind(flow: Flow, mode: Array, reg: Array, i: int) -> int:
    """Kind of the rows that an instruction makes."""
    p = flow.rows.program
    K = flow.k.K
    kinds = flow.space.kinds
    W = flow.space.W
    op = p.code[i, OPERATION]
    a = p.code[i, FIRST]
    b = p.code[i, SECOND]
    c = p.code[i, PLACE]
    kind = _NOTHING
    if op == LINEAR:
        for j in range(a, a + b):
            if p.term_row[j] >= 0 and factor(p, K, j) != 0.0:
                kind |= kinds[p.term_row[j]]
    elif op == PRODUCT:
        kind = kind_of_product(int(kinds[a]), int(kinds[b]), float(W[a, 0]), float(W[b, 0]))
    elif op == QUOTIENT:
        kind = kinds[a] if kinds[b] == _NOTHING else _OTHER
    elif op == STEADY_ROW:
        kind = _NOTHING if kinds[a] == _NOTHING else _WAVE
    elif op < SELECT:
        kind = _NOTHING if kinds[a] == _NOTHING else _OTHER
    elif op == SELECT:
        j = a if reg[c] == 1 else a + 1
        if p.term_row[j] >= 0 and factor(p, K, j) != 0.0:
            kind = kinds[p.term_row[j]]
    elif op == SPEED:
        kind = kinds[a] if mode[c] != 0 else _NOTHING
    elif op == SIDE:
        kind = kinds[p.code[i, side_operand(int(mode[c]))]]
    elif op == ENTRY:
        threshold = p.code[i, SECOND if mode[c] > 0 else THIRD]
        kind = kinds[a] | kinds[threshold] if mode[c] != 0 else _NOTHING
    elif op == RIGHT:
        threshold = p.code[i, THIRD if mode[c] > 0 else FOURTH]
        kind = kinds[b] | kinds[threshold] if mode[c] != 0 else kinds[a]
    elif op in (SOLVE, RATES):
        # Dependences between rows are not analysed: all coupled rows are of one kind.
        for j in range(p.code[i, SIZE]):
            kind |= kinds[a + j]
        if op == RATES:
            for e in range(b, b + p.code[i, THIRD]):
                kind |= _NOTHING if kinds[p.term_row[e]] == _NOTHING else _OTHER
    elif op in (IMPLICIT_ROW, WITHIN):
        kind = _OTHER
    elif op == DIRECTION_ROW:
        kind = _OTHER if mode[c] != 0 else _NOTHING
    return int(kind)


@compiled()
def kind_of_product(a: int, b: int, x: float, y: float) -> int:
    """Kind of a product of rows of two kinds, with their values where they are constant."""
    if a == _NOTHING:
        return b if x != 0.0 else _NOTHING
    if b == _NOTHING:
        return a if y != 0.0 else _NOTHING
    return _OTHER
