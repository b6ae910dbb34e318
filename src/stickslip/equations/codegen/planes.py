"""Contacts in a plane, and faces: their directions of slip, admissible forces, and dissipations
given by formulas."""

from __future__ import annotations

from collections.abc import Sequence

from stickslip.equations.codegen.draft import Draft, order_0, product_of_sizes
from stickslip.equations.planes import Plane
from stickslip.model.entries.declared import Kind
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.scalars import Scalar, Store, added, element, scalars_of
from stickslip.symbolic.tape import Instruction, Op, Scaled


def aimed(draft: Draft, parts: Sequence[list[Scaled]], kind: Kind) -> None:
    """Directions of contacts in a plane that slip along Au.

    Parameters
    ----------
    parts : sequence of list of Scaled
        Terms of the velocities of contacts.
    """
    for p, plane in enumerate(draft.eq.planes):
        if not plane.pull and draft.eq.contacts[plane.parts[0]].kind == kind:
            terms = [
                Scaled(axis * part.factor, part.row)
                for i, axis in zip(plane.parts, plane.axes, strict=True)
                for part in parts[i]
            ]
            _direction(draft, p, ahead(draft, plane), terms)


def pulled(draft: Draft, kind: Kind) -> None:
    """Directions of contacts in a plane of coordinates without mass."""
    for p, plane in enumerate(draft.eq.planes):
        if plane.pull and draft.eq.contacts[plane.parts[0]].kind == kind:
            sides = [draft.tape.row(e) for e in plane.pull]
            _direction(draft, p, sides, [Scaled(ex.ONE, row) for row in sides])


def _direction(draft: Draft, p: int, sides: Sequence[int], terms: list[Scaled]) -> None:
    """Rows of the direction of a slip in a plane, and of the modulus of the vector that defines it.

    Parameters
    ----------
    p : int
        Number of the plane.
    sides : sequence of int
        Rows of that vector.
    terms : list of Scaled
        What these are sums of.
    """
    tape = draft.tape
    plane = draft.eq.planes[p]
    size = tape.size(terms)
    inputs = (*sides, size)
    stage = max(tape.stage[row] for row in inputs)
    count = len(plane.parts)
    first, *_, speed = (tape.new_row(stage) for _ in range(count + 1))
    pressing = draft.eq.pressing(plane.parts[0])
    rests = () if plane.formula is None else tuple(Scaled(e) for e in plane.idle)
    made = Instruction(
        Op.DIRECTION, first, inputs, rests, plane.parts[0], count + 1, pressed=(*pressing,)
    )
    tape.emit(stage, made)
    for row, i in enumerate(plane.parts, first):
        tape.name(f"n:{i}", row, stage)
    if not plane.pull:
        tape.name(f"length:{plane.parts[0]}", speed, stage)
        if plane.unit is not ex.ONE:
            # R(u) = |u| R(n)
            speed = tape.row(ex.sym(f"length:{plane.parts[0]}") * plane.unit)
        for i in plane.parts:
            tape.name(f"speed:{i}", speed, tape.stage[speed])
    draft.directions[p] = first
    draft.speed_sizes[p] = size


def ahead(draft: Draft, plane: Plane) -> list[int]:
    """Rows of Au of a contact in a plane."""
    rows = [draft.layout.u[i] for i in plane.parts]
    return [
        row if axis is ex.ONE else draft.tape.assign([Scaled(axis, row)], None)
        for row, axis in zip(rows, plane.axes, strict=True)
    ]


def plane_rows(draft: Draft) -> None:
    """Rows by which contacts in a plane are guarded: where their forces are admissible, whether
    they still slip ahead, and kinks between pieces of formulas."""
    tape = draft.tape
    layout = draft.layout
    for p, plane in enumerate(draft.eq.planes):
        first = draft.directions[p]
        sides = ahead(draft, plane)
        forces = [ex.sym(f"lambda:{part}") for part in plane.parts]
        holds = plane.admissible(forces)
        place = draft.plane_sizes + p
        own = [draft.eq.contacts[part] for part in plane.parts]
        given = own[0].prescribed
        pairs = [*zip(plane.parts, plane.axes, strict=True)]
        if given:
            holds = ex.add(*(((axis * ex.sym(f"u:{i}")) ** 2, -1.0) for i, axis in pairs))
        row = tape.row(holds)
        along = [(axis * ex.sym(f"n:{i}") * ex.sym(f"u:{i}"), 1.0) for i, axis in pairs]
        count = len(plane.parts)
        slips = tape.row(ex.add(*along)) if plane.pull else first + count
        massive = not (plane.pull or given)
        number = -1 if plane.formula is None else draft.formulas.index(plane.formula)
        third = (-1,) * (3 - count)
        held = frozenset(draft.d.parameters)
        fixed = [e for c in own for e in (c.speed, *c.direction.values())]
        even = plane.formula is not None or all(axis is ex.ONE for axis in plane.axes)
        straight = massive and even and all(e.symbols <= held for e in fixed)
        static = tape.row(plane.static)
        scaled = int(any(axis is not ex.ONE for axis in plane.axes[:2]))
        ends = (static, slips, int(massive), int(plane.bends), number, int(straight))
        size = draft.speed_sizes[p]
        where = (plane.parts[0], first, first + count, *sides, *third, row, place)
        layout.planes.append((*where, *ends, size, scaled))
        layout.pieces += [
            (draft.eq.kinks.index(guard), p, tape.row(same)) for guard, same in plane.pieces
        ]
        draft.note(place, _admissible_size(draft, plane, given))


def _admissible_size(draft: Draft, plane: Plane, given: bool) -> Scalar:
    """Size of the admissibility guard of a contact in a plane, by the rounding errors of the forces
    in their squares; for a contact between prescribed motions, by those of its velocity."""
    pairs = [*zip(plane.parts, plane.axes, strict=True)]
    scalar = draft.constants.scalar
    parts = [draft.size(plane.static**2)]
    if given:
        own = [product_of_sizes(scalar(a), element("mag", i)) for i, a in pairs]
        return added(product_of_sizes(size, size) for size in own)
    for i, axis in pairs:
        over = product_of_sizes(scalar(2.0 / axis**2), abs(order_0(draft.layout.force[i])))
        parts.append(product_of_sizes(over, element("mag", 2 * draft.nc + i)))
    return added(parts)


def support_stores(draft: Draft) -> list[Store]:
    """For each formula, the set of forces −∂R(0) relative to its middle: the support function S(w)
    = R(−w) − w·middle with its first and second derivatives, and the middle, an average of the
    forces against slips along both axes."""
    stores = list[Store]()
    w = [ex.sym(f"w{i}") for i in (1, 2, 3)]
    names = {str(x.value): element("w", i) for i, x in enumerate(w)}
    for f, formula in enumerate(draft.formulas):
        n = formula.dimension
        along = [
            {x: ex.num(float(side * (i == j))) for j, x in enumerate(formula.names)}
            for i in range(n)
            for side in (1, -1)
        ]
        middle = [
            ex.add(*((ex.substitute(slope, way, undefined=True), -0.5 / n) for way in along))
            for slope in formula.gradient
        ]
        back = {x: -e for x, e in zip(formula.names, w[:n], strict=True)}
        parts = ((x * m, -1.0) for x, m in zip(w[:n], middle, strict=True))
        S = ex.add((ex.substitute(formula.value, back, undefined=True), 1.0), *parts)
        slope = [ex.derivative(S, f"w{i + 1}") if i < n else ex.ZERO for i in range(3)]
        bend = [ex.derivative(slope[i], f"w{j + 1}") for i in range(3) for j in range(i, 3)]
        targets = [S, *slope, *bend, *middle, *[ex.ZERO] * (3 - n)]
        v = scalars_of(targets, names, constants=draft.constants)
        stores += [Store("out", (len(targets) * f + k,), v[e]) for k, e in enumerate(targets)]
    return stores
