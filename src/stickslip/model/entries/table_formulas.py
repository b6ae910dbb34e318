"""Tables in formulas: curves and surfaces as expressions of their arguments."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from stickslip.arrays import Array
from stickslip.errors import short
from stickslip.model.entries.polynomials import (
    PiecewisePolynomial,
)
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import TableFunction

if TYPE_CHECKING:
    from stickslip.model.entries.tables import Table

Read = Callable[[object], Expr]
_PARITIES = ("even", "odd")
_NOT_NEGATIVE = {"speed": (0.0, math.inf)}


@dataclass(frozen=True)
class CurveFunction(TableFunction):
    """A curve, its slope or its integral in formulas."""

    table: Table
    name: str
    called: str
    slope: bool = False

    def at(self, arguments: Sequence[Expr], read: Read) -> Expr:
        """Its value as an expression of its argument."""
        (x,) = arguments
        table = self.table
        open_ends = _open_ends(x, table.axes[0], table, self.name)
        knots = table.knots(self.name, 0, open_ends)
        parts = [(self.part(x, knots, table.pieces(self.called, open_ends)), ex.ONE)]
        if table.formulas:
            if not table.values.any():
                parts = []
            for i, text in table.formulas.items():
                pieces = table.pieces(self.called, open_ends, i)
                parts.append((self.part(x, knots, pieces), read(text)))
        return ex.add(*((part * value, 1.0) for part, value in parts))

    def part(self, x: Expr, knots: PiecewisePolynomial, pieces: PiecewisePolynomial) -> Expr:
        """One of the curves whose sum is the table."""
        order = 1 if self.slope else 0
        if order >= pieces.coefficients.shape[1]:
            return ex.ZERO
        _ = pieces.rows()
        even, odd = (ex.call(pieces.row_name(side, order), x) for side in ("even", "odd"))
        return _by_piece(knots, x, even, odd)


@dataclass(frozen=True)
class SurfaceFunction(TableFunction):
    """A surface in formulas."""

    table: Table
    name: str

    def at(self, arguments: Sequence[Expr], read: Read) -> Expr:
        """Its value as an expression of its arguments."""
        table, name = self.table, self.name
        ends = [
            _open_ends(x, axis, table, name) for x, axis in zip(arguments, table.axes, strict=True)
        ]
        fixed = [axis for axis, x in enumerate(arguments) if x.op == "num"]
        if len(fixed) == 2:
            return ex.num(table(*map(ex.number, arguments)))
        gates = [table.knots(name, axis, ends[axis]) for axis in range(2)]
        if fixed:
            (axis,) = fixed
            other = 1 - axis
            x = arguments[other]
            pieces = table.section(name, axis, ex.number(arguments[axis]), ends[other])
            return _by_piece(gates[other], x, *(ex.call(pieces.rows()[s], x) for s in _PARITIES))
        x, y = arguments
        number, within = (
            _by_piece(gates[0], x, *(ex.call(pieces.rows()[side], x) for side in _PARITIES))
            for pieces in table.places_in_cells(name, 0, ends[0])
        )
        row, above = (pieces.rows() for pieces in table.places_in_cells(name, 1, ends[1]))
        columns, tables = table.coefficients_of_cells(name, ends[0], ends[1])
        sides = list[Expr]()
        for side in _PARITIES:
            cell = number + float(columns) * ex.call(row[side], y)
            w = ex.call(above[side], y)
            sides.append(
                ex.add(
                    *(
                        (ex.call(pieces.rows()["own"], cell) * within**a * w**b, 1.0)
                        for (a, b), pieces in tables.items()
                    )
                )
            )
        # Sums combine their terms by the outer select.
        return _by_piece(gates[1], y, *sides)


def _by_piece(knots: PiecewisePolynomial, x: Expr, even: Expr, odd: Expr) -> Expr:
    """A select between the values in even and in odd pieces; the first if there is one piece."""
    if len(knots.breaks) == 2:
        return even
    return ex.select(ex.call(knots.rows()["gate"], x), even, odd)


def _open_ends(x: Expr, knots: Array, table: Table, name: str) -> tuple[bool, bool]:
    """Whether the formula of an argument proves that it cannot reach the lower or the upper end of
    a table.

    Raises
    ------
    ZeroDivisionError
        If it is a number at which the table has no value.
    """
    from stickslip.symbolic.enclosures import bounds

    low, high = bounds(x, _NOT_NEGATIVE)
    first, last = float(knots[0]), float(knots[-1])
    for beyond, side in ((high < first, table.outside[0]), (low > last, table.outside[1])):
        if beyond and side == "refused":
            raise ZeroDivisionError(
                f"the table '{name}' covers {first:.9g} to {last:.9g}, not {short(ex.to_text(x))}"
            )
    return low >= first, high <= last
