"""Rows of the arguments of guards (forces, thresholds, kinks and gaps), and of contacts in
results."""

from __future__ import annotations

from stickslip.equations.codegen.draft import Draft, order_0
from stickslip.equations.codegen.planes import plane_rows
from stickslip.model.declaration import DryContact
from stickslip.model.entries.keys import NORMAL
from stickslip.model.entries.polynomials import in_own_piece
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.scalars import added, element, numeral
from stickslip.symbolic.tape import Instruction, Op


def kinetic_laws(draft: Draft) -> None:
    """Rows that are negative if a sliding force is inadmissible: 0 ≤ k, and k ≤ s at speed 0."""
    for plane in draft.eq.planes:
        i = plane.parts[0]
        if plane.kinetic is not plane.static:
            own = {f"speed:{i}": ex.ZERO}
            at_rest = ex.substitute(plane.kinetic, own, undefined=True)
            rows = draft.tape.row(plane.kinetic), draft.tape.row(plane.static - at_rest)
            draft.layout.kinetic.append((i, 1, *rows))
    for i, c in enumerate(draft.eq.contacts):
        if c.plane:
            continue
        for side, force, static in (
            (1, c.kinetic_plus, c.plus),
            (-1, c.kinetic_minus, c.minus),
        ):
            if force is not static:
                at_rest = ex.substitute(force, {f"speed:{i}": ex.ZERO}, undefined=True)
                draft.layout.kinetic.append(
                    (i, side, draft.tape.row(force), draft.tape.row(static - at_rest))
                )


def guard_rows(draft: Draft) -> None:
    """Rows of forces, thresholds, kinks and gaps, and of the sizes of their terms; and reported
    rows of contacts that switch as one."""
    _thresholds(draft)
    _kinks(draft)
    plane_rows(draft)
    _members(draft)
    _carrying(draft)
    _normal_directions(draft)


def _thresholds(draft: Draft) -> None:
    """Rows of forces and of their thresholds."""
    tape = draft.tape
    layout = draft.layout
    layout.plus = [tape.row(c.plus) for c in draft.eq.contacts]
    layout.minus = [tape.row(c.minus) for c in draft.eq.contacts]
    layout.force = [tape.names[f"lambda:{i}"] for i in range(draft.nc)]
    for i, (plus, minus) in enumerate(zip(layout.plus, layout.minus, strict=True)):
        # A force is measured against its threshold, too.
        sides = abs(order_0(plus)) + abs(order_0(minus))
        draft.note(2 * draft.nc + i, sides, adding=True)


def _kinks(draft: Draft) -> None:
    """Rows of the guards of kinks."""
    tape = draft.tape
    kinks = draft.layout.kinks
    turning = {guard: (plane, same) for plane in draft.eq.planes for guard, same in plane.pieces}
    for j, guard in enumerate(draft.eq.kinks):
        if guard in turning:
            # For any degree in u, it vanishes with u at the end of a slip. It is known on both
            # sides, unlike R.
            plane, same = turning[guard]
            kinks.append(tape.row(ex.sym(f"length:{plane.parts[0]}") * same))
            draft.note(3 * draft.nc + j, added(element("mag", i) for i in plane.parts))
            continue
        if draft.constants.is_constant(guard):  # only the sign matters, however large the value
            guard = ex.select(guard, ex.ONE, -ex.ONE)
        kinks.append(tape.row(in_own_piece(guard)))
        if in_own_piece(guard) is not guard:  # a difference to a knot is as large as its arguments
            draft.note(3 * draft.nc + j, numeral(2.0) * draft.size(guard.args[0]))
            continue
        draft.note(3 * draft.nc + j, draft.size(guard))


def _members(draft: Draft) -> None:
    """Rows of the forces, thresholds and relative velocities of contacts that are one with
    others."""
    tape = draft.tape
    for i, own in enumerate(draft.eq.members):
        for c in own if len(own) > 1 else ():
            sides = tape.row(c.plus), tape.row(c.minus)
            # the gap of a floor
            u = tape.row(c.ratio * ex.sym(f"u:{i}") if c.gap is None else c.gap)
            draft.layout.parts[c.name] = (_part(draft, i, c), *sides, u)


def _carrying(draft: Draft) -> None:
    """Rows of the forces of constraints, and of the normal forces of contacts that adhere."""
    facing: dict[str, list[tuple[Expr, float]]] = {}
    for i, c in enumerate(draft.eq.contacts):
        if c.side_of:
            facing.setdefault(c.side_of, []).append((ex.sym(f"lambda:{i}"), 1.0))
        if c.opens and c.plus is not ex.ZERO:
            pulled = (ex.sym(f"lambda:{i}"), 1.0), (ex.sym(f"glue:{i}"), -1.0)
            facing[c.name.removeprefix(NORMAL)] = [*pulled]
    draft.layout.carrying = {
        name: draft.tape.row(ex.add(*forces)) for name, forces in facing.items()
    }


def _normal_directions(draft: Draft) -> None:
    """Rows of gaps, of friction under normal forces, and of restitution."""
    layout = draft.layout
    for i, c in enumerate(draft.eq.contacts):
        if c.gap is not None:
            layout.gaps[i] = draft.tape.row(c.gap)
            draft.note(draft.gap_sizes + i, draft.size(c.gap))
        for normal in draft.eq.pressing(i):
            layout.links.append((i, normal, _coefficients(draft, i, normal)))
        if c.gap is not None or c.on:
            layout.restitution[i] = draft.tape.row(c.restitution)


def _part(draft: Draft, i: int, c: DryContact) -> int:
    """Row of the force of one of the members of a contact."""
    sides = tuple(map(draft.tape.row, draft.eq.part(i, c)))
    stage = max(draft.tape.stage[row] for row in sides)
    row = draft.tape.new_row(stage)
    draft.tape.emit(stage, Instruction(Op.SIDE, row, sides, place=i))
    return row


def _coefficients(draft: Draft, i: int, normal: int) -> tuple[int, ...]:
    """Rows of the coefficients of friction of contact i under a normal force."""
    c = draft.eq.contacts[i]
    sides = c.kinetic_plus, c.kinetic_minus, c.plus, c.minus
    if c.plane:
        plane = draft.plane_with(i)
        sides = (*(plane.kinetic * c.axis,) * 2, *(plane.static * c.axis,) * 2)
    return tuple(draft.tape.row(ex.derivative(side, f"lambda:{normal}")) for side in sides)
