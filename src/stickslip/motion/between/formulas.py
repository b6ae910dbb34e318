"""Formulas of the quantities of a motion at times within its steps: outputs, and formulas in
arguments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import AnyArray, Array
from stickslip.errors import DeclarationError, short, suggestion
from stickslip.model.quantities import ENERGIES
from stickslip.model.system import System
from stickslip.symbolic.evaluator import evaluator
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import NAME

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory


def read_formula(system: System, text: str, where: str) -> Expr:
    """A name or a formula of reported quantities of a system.

    Parameters
    ----------
    text : str
        Of the state, rates, unknowns of structures, outputs, forces, energies, ``t``, parameters,
        functions and drives.
    where : str
        What messages call it.

    Raises
    ------
    DeclarationError
        If it is no formula of these.
    """
    declared = system.declaration
    scope, bare = declared.results, text.strip()
    if NAME.fullmatch(bare) and bare not in {*scope.names, *scope.definitions, *scope.forbidden}:
        quantities = [*system.followed, *system.unknowns, *sorted(declared.published)]
        known = suggestion(
            bare, [*quantities, *scope.definitions], accepts=lambda x: scope.parse(x, where)
        )
        raise DeclarationError(where, f"unknown quantity '{short(bare)}'", known)
    return scope.parse(text, where)


def evaluated(formulas: Sequence[Expr], values: Mapping[str, Array | float], count: int) -> Array:
    """Values of formulas, shape (formulas, count), from those of names.

    Parameters
    ----------
    values : mapping of str to array, shape (count,), or number
    """
    names = sorted({name for formula in formulas for name in formula.symbols})
    table = np.empty((len(names), count))
    for row, name in zip(table, names, strict=True):
        row[:] = values[name]
    return evaluator(formulas, names)(table)


class Along:
    """Values of formulas along a motion: from its states if these suffice, otherwise from forces,
    rates and energies, which are recomputed from the states.

    Parameters
    ----------
    formulas : sequence of Expr
        Of names that :attr:`~stickslip.model.declaration.Declaration.results` has.
    """

    def __init__(self, motion: Trajectory, formulas: Sequence[Expr]) -> None:
        self.motion = motion
        self.formulas = list(formulas)
        names = {name for formula in formulas for name in formula.symbols}
        names -= {"t", *motion.parameters}
        self._timed = not names
        self._of_state = names <= set(motion.system.declaration.state)
        self._sums = bool(names & set(ENERGIES))

    def __call__(self, times: Array, index: Array) -> Array:
        """Values at times within the steps of the knots `index`, shape (times, formulas)."""
        return self._found(times, times - self.motion.knots.origin, index)

    def on_clock(self, clock: Array, index: AnyArray) -> Array:
        """The same at times since the origin."""
        return self._found(clock + self.motion.knots.origin, clock, index)

    def _found(self, times: Array, clock: Array, index: AnyArray) -> Array:
        motion = self.motion
        values: dict[str, Array] = {}
        if self._sums:
            values = motion._values_without_outputs(clock, index)
        elif not self._of_state:
            rows = motion.dense_output.rows(clock, index)
            values = {name: rows[:, row] for name, row in motion.row_of.items()}
            motion._without_contact(values, index)
        elif not self._timed:
            states = motion.dense_output.states(clock, index)
            values = dict(zip(motion.system.declaration.state, states.T, strict=True))
        given = {**values, **motion.parameters, "t": times}
        return evaluated(self.formulas, given, len(times)).T
