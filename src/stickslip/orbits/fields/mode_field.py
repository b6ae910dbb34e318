"""The smooth pieces of a system with numbers: field, Jacobian, guards and constraints of each mode
and region."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.equations.derive import MotionEquations
from stickslip.equations.field import Field, mode_field
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr


@dataclass(frozen=True)
class Leaving:
    """The guards of a piece at a point where the motion may leave it.

    Attributes
    ----------
    rates : array, shape (states,)
        The field f.
    value : array, shape (guards,)
    slopes : array, shape (guards, columns)
        Derivatives with respect to the state and the free parameter.
    fall : array, shape (guards,)
        Rates g_t + ∇g·f along the motion.
    terms : array, shape (guards,)
        Sum of the moduli of the terms of the rates.
    """

    rates: Array
    value: Array
    slopes: Array
    fall: Array
    terms: Array


@dataclass(frozen=True)
class Bounds:
    """The constraints of a piece at a point: values and derivatives by time, state and free
    parameter."""

    value: Array
    time: Array
    slopes: Array


class Piece:
    """The smooth motion y' = f(t, y, p) in one mode and region, with first derivatives.

    Parameters
    ----------
    field : Field
    free : str or None
        A parameter; derivatives with respect to it follow those with respect to the state as a last
        column.
    """

    def __init__(self, field: Field, free: str | None) -> None:
        self.field = field
        self.columns: tuple[str, ...] = (*field.state, *((free,) if free else ()))
        self.switches: Array = np.array([g.switch for g in field.guards], dtype=int)
        slopes = [[ex.derivative(f, c) for c in self.columns] for f in field.rates]
        moving = {"t", *field.state}
        self.constant: bool = not any(
            e.symbols & moving for row in slopes for e in row[: len(field.state)]
        )
        self.rates: Callable[[ArrayLike, ArrayLike, ArrayLike], Array] = field.function(field.rates)
        self._slopes = field.function([e for row in slopes for e in row])

    def jacobian(self, t: Array, y: Array, p: Array) -> Array:
        """∂f/∂(y, p) at many points, shape (points, states, columns)."""
        values = self._slopes(t, y, p)
        return np.moveaxis(values.reshape(len(self.field.state), len(self.columns), -1), -1, 0)

    def leave(self, t: float, y: Array, p: Array) -> Leaving:
        """The guards at a point."""
        n = len(y)
        values = self._guards(t, y, p)
        f = values[:n]
        table = values[n:].reshape(-1, 2 + len(self.columns))
        value = table[:, 0]
        time = table[:, 1]
        slopes = table[:, 2:]
        terms = slopes[:, :n] * f
        return Leaving(
            f,
            value,
            slopes,
            time + np.sum(terms, axis=1),
            np.abs(time) + np.sum(np.abs(terms), axis=1),
        )

    def bounds(self, t: float, y: Array, p: Array) -> Bounds:
        """The constraints at a point."""
        table = self._constraints(t, y, p).reshape(-1, 2 + len(self.columns))
        return Bounds(table[:, 0], table[:, 1], table[:, 2:])

    def felt(self, t: Array, y: Array, p: Array) -> Array:
        """Rates, guards and constraints at many points, shape (functions, points)."""
        return self._felt(t, y, p)

    def dependence(self, t: Array, y: Array, p: Array) -> Array:
        """Their derivatives with respect to time and the state, shape (points, functions, 1 +
        states)."""
        values = self._dependence(t, y, p)
        return np.moveaxis(values.reshape(-1, 1 + len(y), len(t)), -1, 0)

    @property
    def bound(self) -> int:
        """Number of constraints."""
        return len(self.field.constraints)

    def setting(self, switch: int) -> int:
        """Region or mode of a switch."""
        kinks = len(self.field.region)
        return self.field.region[switch] if switch < kinks else self.field.mode[switch - kinks]

    def switched(self, switch: int, setting: int) -> tuple[Array, Array]:
        """Mode and region that differ by one switch."""
        mode, region = np.array(self.field.mode, np.int8), np.array(self.field.region, np.int8)
        if switch < len(region):
            region[switch] = setting
        else:
            mode[switch - len(region)] = setting
        return mode, region

    @cached_property
    def _guards(self):
        return self.field.function(
            [*self.field.rates, *self._with_slopes([g.value for g in self.field.guards])]
        )

    @property
    def _all(self) -> list[Expr]:
        return [*self.field.rates, *(g.value for g in self.field.guards), *self.field.constraints]

    @cached_property
    def _felt(self):
        return self.field.function(self._all)

    @cached_property
    def _dependence(self):
        return self.field.function(
            [ex.derivative(e, c) for e in self._all for c in ("t", *self.field.state)]
        )

    @cached_property
    def _constraints(self):
        return self.field.function(self._with_slopes(self.field.constraints))

    def _with_slopes(self, functions: list[Expr]) -> list[Expr]:
        return [
            e for g in functions for e in (g, *(ex.derivative(g, c) for c in ("t", *self.columns)))
        ]


class Pieces:
    """All pieces of a system, made when first asked for.

    Parameters
    ----------
    equations : MotionEquations
    free : str, optional
        A parameter to differentiate with respect to.
    """

    def __init__(self, equations: MotionEquations, free: str | None = None) -> None:
        self.equations: MotionEquations = equations
        self.free: str | None = free
        self._made: dict[bytes, Piece] = {}

    def __call__(self, mode: Array, region: Array) -> Piece:
        """The piece of a mode and region (arrays of int8), as the engine numbers them."""
        key = mode.tobytes() + region.tobytes()
        if key not in self._made:
            field = mode_field(self.equations, tuple(map(int, mode)), tuple(map(int, region)))
            self._made[key] = Piece(field, self.free)
        return self._made[key]
