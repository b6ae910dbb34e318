"""Rows of single contacts: relative velocities and speeds, friction, and normal forces."""

from __future__ import annotations

from stickslip.equations.codegen.draft import Draft
from stickslip.model.entries.declared import Kind
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.scalars import numeral
from stickslip.symbolic.tape import Instruction, Op, Scaled


def velocity_row(draft: Draft, i: int) -> list[Scaled]:
    """Row of the relative velocity of contact i, and its size for rounding; returns its terms."""
    c = draft.eq.contacts[i]
    tape = draft.tape
    parts = [
        Scaled(j, tape.names[f"d_{x}"])
        if draft.constants.is_constant(j)
        else tape.lower(j * ex.sym(f"d_{x}"))
        for x, j in c.direction.items()
    ]
    belt = tape.lower(c.speed)
    parts.append(Scaled(-belt.factor, belt.row))
    draft.layout.u.append(tape.assign(parts, None))
    tape.name(f"u:{i}", draft.layout.u[i], tape.stage[draft.layout.u[i]])
    draft.note(i, draft.size_of(parts))
    return parts


def speed_row(draft: Draft, i: int) -> None:
    """Row of |u| of contact i, if it is along a line."""
    if not draft.eq.contacts[i].plane:
        row = draft.tape.new_row(0)
        draft.tape.emit(0, Instruction(Op.SPEED, row, (draft.layout.u[i],), place=i))
        draft.tape.name(f"speed:{i}", row, 0)


def prescribed_forces(draft: Draft) -> None:
    """Rows of the forces between prescribed motions: zero in stick, in slip the limit given by
    normal forces that are already known. Their velocities are accurate to the rounding errors of
    their changes."""
    zero = draft.tape.row(ex.ZERO)
    for i, c in enumerate(draft.eq.contacts):
        if c.prescribed:
            sides = (zero, *map(draft.tape.row, sliding_forces(draft, i)))
            stage = max(draft.tape.stage[row] for row in sides)
            row = draft.tape.new_row(stage)
            draft.tape.emit(stage, Instruction(Op.SIDE, row, sides, place=i))
            draft.tape.name(f"lambda:{i}", row, stage)
            draft.note(2 * draft.nc + i, numeral(0.0))
            draft.note(draft.nc + i, draft.size(draft.eq.surface_acceleration(i)))


def adhesion_rows(draft: Draft) -> None:
    """Rows of the adhesion of contacts that are closed, or carried by other closed contacts."""
    zero = draft.tape.row(ex.ZERO)
    for i, c in enumerate(draft.eq.contacts):
        if c.opens and c.plus is not ex.ZERO:
            sides = (draft.tape.row(c.plus), zero, zero, draft.tape.row(-c.plus), zero)
            row = draft.tape.new_row(0)
            draft.tape.emit(0, Instruction(Op.SIDE, row, sides, place=i))
            draft.tape.name(f"glue:{i}", row, 0)


def right_side(draft: Draft, i: int, row: int, stage: int) -> None:
    """Right-hand side of contact i: the belt in stick, the friction force in slip."""
    c = draft.eq.contacts[i]
    tape = draft.tape
    belt = c.speed if c.kind == Kind.VISCOUS else draft.eq.surface_acceleration(i)
    pressed = {f"lambda:{n}": ex.ZERO for n in draft.eq.pressing(i)}
    alone = [ex.substitute(force, pressed) for force in sliding_forces(draft, i)]
    sides = tuple(tape.row(e) for e in (belt, *alone))
    tape.emit(stage, Instruction(Op.SIDE, row, sides, place=i))
    tape.stage[row] = stage


def sliding_forces(draft: Draft, i: int) -> tuple[Expr, Expr, Expr, Expr]:
    """Friction of contact i against slip forward and back, and where its threshold is to be
    broken; in a plane that of a component, along the direction of its slip."""
    c = draft.eq.contacts[i]
    if c.opens:
        # an open or a carried contact has no normal force
        return ex.ZERO, ex.ZERO, ex.ZERO, ex.ZERO
    if not c.plane:
        return c.kinetic_plus, c.kinetic_minus, c.plus, c.minus
    plane = draft.plane_with(i)
    drops = plane.kinetic is not plane.static and not plane.pull
    static = plane.static * plane.slope[plane.parts.index(i)] if drops else c.kinetic_plus
    return c.kinetic_plus, c.kinetic_plus, static, static


def pressed_slopes(draft: Draft, i: int, normal: int) -> list[Expr]:
    """Derivatives of the friction of a contact, and of its thresholds, with respect to a normal
    force."""
    return [ex.derivative(side, f"lambda:{normal}") for side in sliding_forces(draft, i)]


def has_constant_friction(draft: Draft, i: int) -> bool:
    """Whether the friction of a contact under each normal force has one constant coefficient."""
    found = [set(pressed_slopes(draft, i, normal)) for normal in draft.eq.pressing(i)]
    return all(len(own) == 1 and draft.constants.is_constant(*own) for own in found)
