"""Published quantities of a motion as expressions of time, state and parameters, mode by mode, and
formulas of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.derive import MotionEquations
from stickslip.equations.field import Field, in_region
from stickslip.errors import DeclarationError, listing, suggestion
from stickslip.kept import kept
from stickslip.model.entries.keys import NORMAL
from stickslip.model.quantities import contact_key
from stickslip.motion.trajectory import Trajectory
from stickslip.orbits.fields.instructions import PointFunction
from stickslip.orbits.fields.mode_field import Piece
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import NAME, Scope

SUPPLY_RATE = "supply:"
"""The supplied power: no name of a user's formula has a colon."""
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
        if c.side_of:
            name = f"normal_{contact_key(c.side_of)}"
            found[name] = ex.add((found.get(name, ex.ZERO), 1.0), (c.force, 1.0))
            continue
        for part in c.parts:
            key = contact_key(part.name)
            if part.gap is not None:
                found |= {part.name: part.force, f"gap_{part.name.removeprefix(NORMAL)}": part.gap}
                continue
            found |= {f"friction_{key}": part.force, f"slip_speed_{key}": part.u}
            found |= {f"threshold_plus_{key}": part.plus, f"threshold_minus_{key}": part.minus}
        if c.gap is not None and c.parts:
            continue
        if c.gap is not None:
            found |= {c.name: c.force, f"gap_{c.name.removeprefix(NORMAL)}": c.gap}
            continue
        key = contact_key(c.name)
        found |= {f"friction_{key}": c.force, f"slip_speed_{key}": c.u}
        if c.plane:
            found[f"threshold_{key}"] = c.plus
        else:
            found |= {f"threshold_plus_{key}": c.plus, f"threshold_minus_{key}": c.minus}
    return found | {"energy": field.energy, SUPPLY_RATE: _supplied_power(equations, field, rates)}


def _supplied_power(equations: MotionEquations, field: Field, rates: dict[str, Expr]) -> Expr:
    """The power that time, belts, forces and internal variables supply, in a mode and region."""
    known = {f"d_{name}": rate for name, rate in rates.items() if f"d_{name}" not in field.state}
    for i, (declared, c) in enumerate(zip(equations.contacts, field.contacts, strict=True)):
        glue = c.plus if declared.opens else ex.ZERO
        known |= {f"u:{i}": c.u, f"lambda:{i}": c.force + glue, f"glue:{i}": glue}
    regions = dict(zip(equations.kinks, field.region, strict=True))
    return ex.substitute(in_region(equations.supply, regions), known)


class Observation(NamedTuple):
    """A quantity, or a formula of quantities, that is observed."""

    name: str
    formula: Expr


def read_observations(trajectory: Trajectory, asked: Sequence[str]) -> tuple[Observation, ...]:
    """Requested quantities of a motion: names, outputs, or formulas of these.

    Raises
    ------
    DeclarationError
        If there is no such quantity, it has no derivative, or a formula has kinks.
    """
    if set(asked) <= set(trajectory.problem.compiled.layout.state):
        return tuple(Observation(name, ex.sym(name)) for name in asked)
    with listing(lambda name: _read_observations(trajectory, (name,))):
        return _read_observations(trajectory, asked)


def _read_observations(trajectory: Trajectory, asked: Sequence[str]) -> tuple[Observation, ...]:
    system = trajectory.system
    declared = system.declaration.results
    known = {*system.declaration.published, *system.parameters, *system.outputs, "t"}
    refused = {
        name: f"{name} is an integral along the motion and has no formula; use powers or forces"
        for name in _SUMMED_UP
    }
    refused |= {f"mode_{key}": "modes are integers" for key in trajectory.modes}
    names = {name: e for name, e in declared.names.items() if name not in refused}
    refused |= declared.forbidden
    scope = Scope(names, declared.definitions, refused, vectors=declared.vectors)
    kinks = set(trajectory.problem.compiled.equations.kinks)
    found: list[Observation] = []
    for text in asked:
        callable_names = {n for n, d in declared.definitions.items() if not d.arguments}
        if NAME.fullmatch(text) and text not in {*names, *refused, *callable_names}:
            raise DeclarationError(
                f"of: {text}",
                "unknown quantity",
                suggestion(
                    text,
                    [*system.unknowns, *sorted(known)],
                    accepts=lambda name: _read_observations(trajectory, (name,)),
                ),
            )
        formula = scope.parse(text, f"of: {text}")
        if any(e.op == "select" and e.args[0] not in kinks for e in ex.walk([formula])):
            raise DeclarationError(
                f"of: {text}",
                "it has a kink that the motion does not have, so it is not differentiable "
                "everywhere",
                "Use a smooth formula, or one whose kinks are those of the system",
            )
        found.append(Observation(text, formula))
    return tuple(found)


class Gradient(NamedTuple):
    """Quantities at some points, shape (quantities, points), their derivatives by state and free
    parameters, shape (points, quantities, columns), and by time, shape (quantities, points)."""

    values: Array
    slopes: Array
    time: Array


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
    at : arrays, shapes (points,) and (states, points)
        Times and states.
    p : array, shape (parameters,)
    """
    made: dict[tuple[Observation, ...], PointFunction] = kept(piece, "observed")
    if observed not in made:
        names = published(equations, piece.field)
        regions = dict(zip(equations.kinks, piece.field.region, strict=True))
        formulas = [ex.substitute(in_region(o.formula, regions), names) for o in observed]
        unknown = {name for f in formulas for name in f.symbols} - {*piece.field.names}
        if unknown:
            raise DeclarationError(
                f"of: {min(unknown)}",
                "it has no formula in this mode",
                "Use parts of the state",
            )
        columns = (*piece.columns, "t")
        wanted = [e for f in formulas for e in (f, *(ex.derivative(f, c) for c in columns))]
        made[observed] = PointFunction(piece.field, wanted)
    t, y = at
    table = made[observed](t, y, p).reshape(len(observed), 2 + len(piece.columns), len(t))
    return Gradient(table[:, 0], np.moveaxis(table[:, 1:-1], -1, 0), table[:, -1])
