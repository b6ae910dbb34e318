"""Translations, and periods, frames and cells of motions over spatially periodic systems.

The compiled code of a system contains its drives, with their frequencies. A formula that is
periodic in space is a drive only in the frame of the motion, at a frequency that depends on its
speed; and a system that is periodic in space is unchanged by shifts by a cell.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.derive import MotionEquations
from stickslip.errors import DeclarationError
from stickslip.kept import made_once
from stickslip.motion.problem import Problem
from stickslip.numerics.ratios import ratio
from stickslip.orbits.fields.clock import Clock, cells_of, clock, moving_frame

# a shift whose remainder after projection on others is a smaller fraction of it depends on them
_SAME = 1e-9

_MOST = 256  # largest number of states among which combinations are searched for


class Lattice(NamedTuple):
    """Spatial periods of some motions.

    Attributes
    ----------
    period : array, shape (motions,)
        Period of the system in the frame; 0 if it is not driven there.
    parts : array of int, shape (motions,)
        Number of these periods after which the drives repeat, too.
    frame : array, shape (motions, n)
        Velocity of the frame.
    moved : bool
        Whether a load moves the state with time.
    cells : array, shape (motions, cells, 2, n)
        Cells in the form that the compiled loops use (:func:`forms_of`).
    """

    period: Array
    parts: Array
    frame: Array
    moved: bool
    cells: Array


def lattice(problem: Problem, table: Array) -> Lattice | None:
    """Spatial periods for given parameters, shape (motions, parameters); None if there are none."""
    equations = problem.compiled.equations
    read = moving_frame(equations, frozenset()).reading
    if not any(phase.keys() - {"t"} for phase in read.phases):
        return None
    names = list(problem.system.parameters)
    n = len(equations.declaration.state)
    moved = any("t" in line for line in read.lines)
    period, frame = np.zeros(len(table)), np.zeros((len(table), n))
    parts = np.ones(len(table), int)
    cells: list[Array] = []
    known: dict[frozenset[str], Clock] = {}
    for i, row in enumerate(table):
        values = dict(zip(names, map(float, row), strict=True))
        zero = frozenset(name for name in names if values[name] == 0.0)
        free = _may_have_cells(equations, zero)
        cells.append(cells_of(equations, values) if free else np.zeros((n, 0)))
        if not moved:
            continue
        try:
            ticking = known.get(zero)
            if ticking is None or not ticking.alone:
                ticking = known[zero] = clock(problem.system, equations, values)
            period[i] = ticking.period(values)
            parts[i] = ticking.parts
            frame[i] = ticking.drives(values).velocity
        except DeclarationError:
            # Without a common period only the frame may leave the system unchanged.
            frame[i] = moving_frame(equations, zero).full(values)
    return Lattice(period, parts, frame, moved, forms_of(cells))


def forms_of(cells: list[Array]) -> Array:
    """Cells, each of shape (n, cells), with the linear forms that count them; shape (motions,
    cells, 2, n), padded with zeros."""
    n = len(cells[0])
    found = np.zeros((len(cells), max(part.shape[1] for part in cells), 2, n))
    for own, part in zip(found, cells, strict=True):
        own[: part.shape[1], 0] = part.T
        own[: part.shape[1], 1] = np.linalg.pinv(part)
    return found


def translations(equations: MotionEquations, declared: Array) -> Array:
    """Directions of translation of the state: the declared one (0 if there is none), and those
    found in the formulas, orthogonal to each other; shape (directions, n)."""
    found = made_once(equations, "translations", lambda: _translations(equations))
    rows = [declared]
    for shift in found.T:
        rest = shift.copy()
        for row in rows:
            rest -= ratio(rest @ row, float(row @ row)) * row
        if np.max(np.abs(rest)) > _SAME * np.max(np.abs(shift)):
            rows.append(rest)
    return np.array(rows)


def _translations(equations: MotionEquations) -> Array:
    """Shifts of the state found in the formulas, shape (n, shifts)."""
    frame = moving_frame(equations, frozenset())
    names = equations.declaration.state
    # Components set by a jump are not shifted with the rest.
    put = {x for jump in equations.jumps for x in jump.values}
    free = [x for x in frame.states if x not in put]
    if len(free) > _MOST:
        read = frame.reading
        felt = set[str]().union(*read.lines, *read.phases)
        free = [x for x in free if x not in felt]
    try:
        shifts = frame.reading.shifts(free, unrelated(equations, frozenset()))
    except (ZeroDivisionError, OverflowError, np.linalg.LinAlgError):
        shifts = np.zeros((len(free), 0))
    found = np.zeros((len(names), shifts.shape[1]))
    found[[names.index(x) for x in free]] = shifts
    return found


def unrelated(equations: MotionEquations, zero: frozenset[str]) -> dict[str, float]:
    """Generic values of the parameters, without relations between them."""
    names = equations.declaration.parameters
    return {x: 0.0 if x in zero else 1.0 + 0.1 * np.sin(i + 1) for i, x in enumerate(names)}


def _may_have_cells(equations: MotionEquations, zero: frozenset[str]) -> bool:
    """Return whether the system may have cells, for given zero parameters; cached."""
    return made_once(equations, "may have cells", lambda: _has_cells(equations, zero), zero)


def _has_cells(equations: MotionEquations, zero: frozenset[str]) -> bool:
    """Return whether some shift of the state alone leaves all lines unchanged and changes a phase,
    for generic values of the parameters."""
    frame = moving_frame(equations, zero)
    try:
        return frame.reading.changes_phase(frame.states, unrelated(equations, zero))
    except (ZeroDivisionError, OverflowError, np.linalg.LinAlgError):
        return True
