"""Declared jumps of the state: the jump that fires when a kink is crossed, and the new state."""

from __future__ import annotations

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.steps.arrays import (
    FIRST_LANDING,
    KINK,
    LANDINGS,
    NOWHERE,
    WAY,
    Flow,
    Instant,
    Machine,
    Rows,
)
from stickslip.motion.steps.starting import coefficients
from stickslip.translator import compiled


@compiled()
def fires(rows: Rows, j: int, region: int) -> bool:
    """Whether a jump fires where its guard passes into a region."""
    direction = rows.jumps[j, WAY]
    return bool(direction == 0 or (direction > 0) == (region == 1))


@compiled()
def fired_jump(rows: Rows, switch: int, region: int) -> int:
    """The jump that fires where a switch passes into a region; −1: none."""
    for j in range(len(rows.jumps)):
        if rows.jumps[j, KINK] == switch and fires(rows, j, region):
            return j
    return NOWHERE


@compiled()
def due_jump(rows: Rows, cause: int, reg: Array) -> int:
    """The jump that is due where a switch has just fired, if that is a kink; −1: none."""
    if cause < 0 or cause >= len(reg):
        return NOWHERE
    return fired_jump(rows, cause, reg[cause])


@compiled()
def passed_jumps(rows: Rows, before: Array, after: Array) -> tuple[int, int]:
    """Number of jumps that fire between two lists of regions, and the first of them."""
    count = 0
    first = NOWHERE
    for j in range(len(rows.jumps)):
        kink = rows.jumps[j, KINK]
        if before[kink] != after[kink] and fires(rows, j, after[kink]):
            first = j if count == 0 else first
            count += 1
    return count, first


@compiled()
def make_jump(machine: Machine, flow: Flow, at: Instant, j: int, y: Array) -> bool:
    """Assign a state the new values of a jump at an instant; False, without changes, if one of them
    is NaN.

    Parameters
    ----------
    at : Instant
        Before the jump, in the regions into which its guard passes.
    j : int
        The jump.
    y : array, shape (n,)
        The state that is changed: that of the instant, or a copy.
    """
    rows = flow.rows
    space = flow.space
    landed = space.landed
    coefficients(machine, flow, at, 1, space.V)
    machine.landings(space.V, at.reg, flow.k.K, landed)
    first = rows.jumps[j, FIRST_LANDING]
    last = first + rows.jumps[j, LANDINGS]
    for i in range(first, last):
        if not abs(landed[i]) < np.inf:
            return False
    for i in range(first, last):
        y[rows.landings[i]] = landed[i]
    return True
