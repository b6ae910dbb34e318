"""Admissible initial states: on the constraints, without overlap, inside the stable set."""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.kept import made_once
from stickslip.model.entries.declared import Kind
from stickslip.model.entries.keys import NORMAL
from stickslip.model.formats.expected import entry_key
from stickslip.motion.problem import Problem
from stickslip.numerics.levels import BODIES_OVERLAP, CONSTRAINT_KEPT
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.evaluator import evaluator
from stickslip.symbolic.expressions import Expr

_MOST_STEPS = 8  # largest number of Newton iterations onto constraints
_MOST_NAMED = 6  # largest number of coordinates in a message
# relative amount by which rounding errors of a start may put a held force beyond its threshold
_EXCESS = 1e-9


class _Gaps:
    """The gaps of a system as functions of parameters, time, and state.

    Attributes
    ----------
    held : array of bool, shape (gaps, 1)
        Whether it is a side of a constraint.
    place : list of int
        Where the coordinates are among the names.
    """

    def __init__(self, problem: Problem) -> None:
        declaration = problem.system.declaration
        self.contacts = [c for c in problem.compiled.equations.contacts if c.gap is not None]
        formulas = [c.gap for c in self.contacts if c.gap is not None]
        sums = [[ex.add((g, 1.0), (h, 1.0)) for h in formulas] for g in formulas]
        self.held: Array = np.array([[ex.ZERO in row] for row in sums])
        self.coordinates = declaration.inertial
        names = [*problem.system.parameters, "t", *declaration.state]
        self.place = [names.index(q) for q in declaration.inertial]
        self.values = evaluator(formulas, names)
        slopes = [ex.derivative(g, q) for g in formulas for q in self.coordinates]
        self.slopes = evaluator(slopes, names)
        parts = [_terms(g) for g in formulas]
        self._terms = evaluator([term for row in parts for term in row], names)
        self._starts = np.cumsum([0, *map(len, parts)])[:-1]

    def sizes(self, values: Array) -> Array:
        """Sums of the moduli of the terms of the gaps, shape (gaps, motions)."""
        return np.add.reduceat(np.abs(self._terms(values)), self._starts, axis=0)


def _terms(e: Expr) -> list[Expr]:
    """The terms of a sum, its constant first."""
    if e.op != "sum":
        return [e]
    return [ex.num(float(e.value)), *(c * term for term, c in e.terms)]


class _Openings:
    """The gaps of a system at some states.

    Parameters
    ----------
    start : float
        Time.
    table : array, shape (motions, parameters)
    states : array, shape (motions, n)

    Attributes
    ----------
    gaps, off, most : arrays, shape (gaps, motions)
        The gaps, by how much they are wrong, and how much of that may be rounding.
    """

    def __init__(self, problem: Problem, start: float, table: Array, states: Array) -> None:
        self.of: _Gaps = made_once(problem.compiled, "gaps", lambda: _Gaps(problem))
        self.values = np.column_stack([table, np.full(len(states), start), states]).T
        self.gaps: Array = self.of.values(self.values)
        # If nothing else defines the size of a gap, the coordinates do, here or as declared.
        declared = [abs(problem.system.plain.initial.get(q, 0.0)) for q in self.of.coordinates]
        most = np.maximum(np.max(np.abs(self.values[self.of.place]), axis=0), max(declared))
        size = np.maximum(self.of.sizes(self.values), 1e-3 * most)
        held = self.of.held
        self.off: Array = np.where(held, np.abs(self.gaps), np.maximum(-self.gaps, 0.0))
        self.most: Array = np.where(held, CONSTRAINT_KEPT, BODIES_OVERLAP) * size

    def moved(self, i: int) -> Array:
        """Coordinates of a motion on the nearest state that is right."""
        here = self.values[:, i].copy()
        held = self.of.held[:, 0]
        place = self.of.place
        for _ in range(_MOST_STEPS):
            gaps = self.of.values(here)
            active = np.where(held, gaps != 0.0, gaps < 0.0)
            if not active.any():
                break
            J = self.of.slopes(here).reshape(len(gaps), -1)[active]
            here[place] -= np.linalg.lstsq(J, gaps[active], rcond=None)[0]
        return here[place]


def put_on_contacts(problem: Problem, start: float, table: Array, states: Array) -> Array:
    """Initial states projected onto constraints, and out of overlaps, that they miss by rounding,
    such as that of numbers typed with few digits.

    Parameters
    ----------
    start : float
        Time.
    table : array, shape (motions, parameters)
    states : array, shape (motions, n)
    """
    if all(c.gap is None for c in problem.compiled.equations.contacts):
        return states
    found = _Openings(problem, start, table, states)
    wrong = np.any(found.off > 0.0, axis=0) & np.all(found.off <= found.most, axis=0)
    if wrong.any():
        states = states.copy()
        own = [problem.system.declaration.state.index(q) for q in found.of.coordinates]
        for i in np.flatnonzero(wrong):
            states[i, own] = found.moved(int(i))
    return states


def check_contacts(problem: Problem, start: float, y: Array) -> None:
    """Explain an initial state that no mode of the contacts can continue, because they overlap or a
    constraint does not hold.

    Raises
    ------
    DeclarationError
    """
    if all(c.gap is None for c in problem.compiled.equations.contacts):
        return
    found = _Openings(problem, start, numbers_of(problem), y[None])
    i = int(np.argmax(found.off[:, 0]))
    off, gap = float(found.off[i, 0]), float(found.gaps[i, 0])
    if not off > 0.0:
        return
    name = found.of.contacts[i].name.removeprefix(NORMAL)
    nearest = _nearest(found)
    if found.of.held[i, 0]:
        raise DeclarationError(
            f"{entry_key('contacts', found.of.contacts[i].side_of)}.constraint",
            f"violated by {off:.6g} at the initial state",
            f"Start from a state that satisfies it{nearest}",
        )
    raise DeclarationError(
        f"{entry_key('contacts', name)}.gap",
        f"the gap is {gap:.6g} at the initial state: the bodies overlap",
        f"Start from a state with a positive gap, or zero for contact{nearest}",
    )


def _nearest(found: _Openings) -> str:
    """Text of a message about the nearest admissible state, if Newton's method finds one."""
    moved = found.moved(0)
    values = found.values[:, 0].copy()
    values[found.of.place] = moved
    gaps = found.of.values(values)
    off = np.where(found.of.held[:, 0], np.abs(gaps), -gaps)
    if not np.all(np.isfinite(moved)) or np.any(off > found.most[:, 0]):
        return ""
    before = found.values[found.of.place, 0]
    changed = [
        f"{q} = {new:.17g}"
        for q, old, new in zip(found.of.coordinates, before, moved, strict=True)
        if new != old
    ]
    return f"; the nearest is {', '.join(changed[:_MOST_NAMED])}"


def numbers_of(problem: Problem) -> Array:
    """Its parameters as a table of one row."""
    return np.array([[problem.parameters[name] for name in problem.system.parameters]])


def check_stable_start(problem: Problem, start: float, y: Array) -> None:
    """Explain an initial state outside the stable set of the rate-independent coordinates."""
    equations, declaration = problem.compiled.equations, problem.system.declaration
    values = {
        **problem.parameters,
        **dict(zip(declaration.state, map(float, y), strict=True)),
        "t": start,
    }
    acting = [c for c in equations.contacts if c.kind == Kind.RATE_INDEPENDENT]
    for plane in equations.planes:
        first = equations.contacts[plane.parts[0]]
        if first.kind == Kind.RATE_INDEPENDENT:
            held = math.hypot(*(ex.evaluate(e, values) for e in plane.pull))
            most = ex.evaluate(plane.static, values)
            if held > most * (1.0 + _EXCESS):
                names = [next(iter(equations.contacts[i].direction)) for i in plane.parts]
                raise DeclarationError(
                    f"initial.{names[0]}",
                    f"the contact '{first.name[:-2]}' would have to hold the force {held:.6g}, "
                    f"which exceeds its threshold {most:.6g} by {held - most:.6g}",
                    f"Start with '{names[0]}' and '{names[1]}' inside the stable set",
                )
    for c, force in zip(acting, equations.rate.force, strict=True):
        if c.plane:
            continue
        held = ex.evaluate(force, values)
        plus, minus = ex.evaluate(c.plus, values), ex.evaluate(c.minus, values)
        excess = max(-plus - held, held - minus)
        if excess > _EXCESS * (abs(held) + plus + minus):
            name = next(iter(c.direction))
            raise DeclarationError(
                f"initial.{name}",
                f"the contact '{c.name}' would have to hold the force {held:.6g}, which exceeds "
                "its threshold"
                f" {minus if held > 0 else plus:.6g} by {excess:.6g}",
                f"Start with '{name}' inside the stable set",
            )
