"""Published quantities of a motion as expressions of time, state and parameters, mode by mode, and
formulas of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.derive import MotionEquations
from stickslip.equations.field import Field
from stickslip.errors import DeclarationError, suggestion
from stickslip.model.names import NORMAL
from stickslip.model.quantities import contact_key
from stickslip.motion.trajectory import Trajectory
from stickslip.orbits.fields.instructions import PointFunction
from stickslip.orbits.fields.mode_field import Piece
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import NAME, Scope

_SUMMED_UP = ("dissipated_energy", "supplied_energy")


def published(equations: MotionEquations, field: Field) -> dict[str, Expr]:
    """The quantities of a motion in a mode and region, by the names under which they are
    published."""
    d = equations.declaration
    found = {name: ex.sym(name) for name in ("t", *field.state, *field.parameters)}
    rates = dict(zip(field.state, field.rates, strict=True))
    found |= {f"d_{name}": rate for name, rate in rates.items() if f"d_{name}" not in found}
    found |= {f"dd_{q}": rates[f"d_{q}"] for q in d.inertial}
    for c in field.contacts:
        if c.gap is not None:
            found |= {c.name: c.force, f"gap_{c.name.removeprefix(NORMAL)}": c.gap}
            continue
        key = contact_key(c.name)
        found |= {
            f"friction_{key}": c.force,
            f"threshold_plus_{key}": c.plus,
            f"threshold_minus_{key}": c.minus,
            f"slip_speed_{key}": c.u,
        }
    return found | {"energy": field.energy}


class Observation(NamedTuple):
    """A quantity, or a formula of quantities, that is observed."""

    name: str
    formula: Expr


def read_observations(trajectory: Trajectory, asked: Sequence[str]) -> tuple[Observation, ...]:
    """What is observed of a motion: names, or formulas of names.

    Raises
    ------
    DeclarationError
        If there is no such quantity, it has no derivative, or a formula has a kink.
    """
    known = {*trajectory._rows, *trajectory.system.parameters, "t", "energy"}
    refused = {
        name: f"{name} is summed up along the way and has no formula; take powers or forces"
        for name in _SUMMED_UP
    }
    refused |= {f"mode_{key}": "modes are whole numbers" for key in trajectory.modes}
    scope = Scope({name: ex.sym(name) for name in known}, forbidden=refused)
    found: list[Observation] = []
    for text in asked:
        if NAME.fullmatch(text) and text not in known and text not in refused:
            raise DeclarationError(
                f"of: {text}",
                "no quantity of this motion has this name",
                suggestion(text, sorted(known)),
            )
        formula = scope.parse(text, f"of: {text}")
        if any(e.op == "select" for e in ex.walk([formula])):
            raise DeclarationError(
                f"of: {text}",
                "a formula with a kink has no derivative everywhere",
                "Observe a smooth formula",
            )
        found.append(Observation(text, formula))
    return tuple(found)


class Gradient(NamedTuple):
    """Quantities at some points, shape (quantities, points), and their derivatives by state and
    free parameters, shape (points, quantities, columns)."""

    values: Array
    slopes: Array


_made: WeakKeyDictionary[Piece, dict[tuple[Observation, ...], PointFunction]] = WeakKeyDictionary()


def gradient(
    equations: MotionEquations,
    piece: Piece,
    observed: tuple[Observation, ...],
    at: tuple[Array, Array],
    p: Array,
) -> Gradient:
    """Quantities with their derivatives at points of one mode.

    Parameters
    ----------
    equations : MotionEquations
    piece : Piece
    observed : tuple of Observation
    at : arrays, shapes (points,) and (states, points)
        Times and states.
    p : array, shape (parameters,)
    """
    made = _made.setdefault(piece, {})
    if observed not in made:
        names = published(equations, piece.field)
        formulas = [ex.substitute(o.formula, names) for o in observed]
        unknown = {name for f in formulas for name in f.symbols} - {*piece.field.names}
        if unknown:
            raise DeclarationError(
                f"of: {min(unknown)}",
                "it has no formula in this mode",
                "Observe parts of the state",
            )
        wanted = [e for f in formulas for e in (f, *(ex.derivative(f, c) for c in piece.columns))]
        made[observed] = PointFunction(piece.field, wanted)
    t, y = at
    table = made[observed](t, y, p).reshape(len(observed), 1 + len(piece.columns), len(t))
    return Gradient(table[:, 0], np.moveaxis(table[:, 1:], -1, 0))
