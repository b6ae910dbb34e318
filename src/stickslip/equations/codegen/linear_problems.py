"""The linear problems of inertial and of viscous coordinates, [[M, −Jᵀ], [stick: J, 0; slip: 0, 1]]
[x; λ] = [f; g]: rates x and forces λ from right-hand sides, component by component."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from stickslip.equations.codegen.contacts import has_constant_friction, pressed_slopes, right_side
from stickslip.equations.codegen.draft import Draft, order_0, product_of_sizes
from stickslip.equations.coupling import Component, components
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.scalars import Scalar, added, element
from stickslip.symbolic.tape import Instruction, Op, Scaled


def solved_block(
    draft: Draft, forces: list[Expr], first: int, count: int, stage: int, resolvent: str
) -> list[int]:
    """Solve one of the linear problems [x; λ] = R [f; g] order by order, component by component;
    returns the rows of x."""
    tape = draft.tape
    inertial = resolvent == "Rq"
    names, matrix = (
        (draft.d.inertial, draft.eq.mass) if inertial else (draft.d.damped, draft.eq.damping)
    )
    place = {x: i for i, x in enumerate(names)}
    directions = [c.direction for c in draft.eq.contacts[first : first + count]]
    coupled = [
        part._replace(moving=_moves(draft, part, matrix))
        for part in components(
            len(names),
            matrix,
            first,
            [[place[x] for x in direction] for direction in directions],
            [(c, n) for c in range(first, first + count) for n in draft.eq.pressing(c)],
        )
        if part.coordinates
    ]
    draft.layout.coupled[resolvent] = coupled
    if inertial:
        draft.layout.together = draft.eq.sharing
    # Rows of R in the order of the components, each with its contacts last.
    seats: dict[int, int] = {}
    contacts: dict[int, int] = {}
    for part in coupled:
        for own, members in ((seats, part.coordinates), (contacts, part.contacts)):
            for member in members:
                own[member] = len(seats) + len(contacts)
    n = len(seats) + len(contacts)
    right = tape.rows
    for _ in range(n):
        tape.new_row(stage)
    solution = tape.rows
    for _ in range(n):
        tape.new_row(stage + 1)
    base = draft.scratch
    draft.scratch += n
    for j, f in enumerate(forces):
        tape.into(f, right + seats[j])
        draft.note(base + seats[j], draft.size(f))
    for c, seat in sorted(contacts.items()):
        right_side(draft, c, right + seat, stage)
        draft.note(base + seat, abs(order_0(right + seat)))
        tape.name(f"lambda:{c}", solution + seat, stage + 1)
    at = 0
    for part in coupled:
        size = len(part.coordinates) + len(part.contacts)
        solve = Instruction(
            Op.SOLVE, solution + at, (right + at,), place=at, size=size, matrix=resolvent
        )
        if part.moving:
            entries = _moving_entries(draft, part, names, matrix)
            known = len(part.coordinates)
            shared = inertial and any(c in draft.layout.together for c in part.contacts)
            solve = replace(solve, op=Op.RATES, entries=entries, definite=known, shared=shared)
        draft.solves[stage].append(solve)
        for c in part.contacts:
            where = (contacts[c], size, base + at)
            draft.note(2 * draft.nc + c, Scalar("spread", name=resolvent, index=where))
        at += size
    _block_sizes(
        draft, inertial, matrix, directions, first, [base + seats[j] for j in place.values()]
    )
    return [solution + seats[j] for j in range(len(forces))]


def _moves(draft: Draft, part: Component, matrix: Mapping[tuple[int, int], Expr]) -> bool:
    """Whether the matrix of a component varies."""
    if not all(has_constant_friction(draft, c) for c in part.contacts):
        return True
    own = frozenset(part.coordinates)
    entries = [e for (i, _), e in matrix.items() if i in own]
    entries += [e for c in part.contacts for e in draft.eq.contacts[c].direction.values()]
    return not all(map(draft.constants.is_constant, entries))


def _moving_entries(
    draft: Draft, part: Component, names: list[str], matrix: Mapping[tuple[int, int], Expr]
) -> tuple[Instruction, ...]:
    """The matrix [[M, −Jᵀ], [stick: J, 0; slip: 0, 1]] of a component, row by row."""
    zero = draft.tape.row(ex.ZERO)
    found = list[Instruction]()
    n = len(part.coordinates)
    for i in part.coordinates:
        found += [_moving_entry(draft, matrix.get((i, j), ex.ZERO)) for j in part.coordinates]
        for c in part.contacts:
            weight = draft.eq.contacts[c].direction.get(names[i], ex.ZERO)
            found.append(_moving_entry(draft, -weight))
    for c in part.contacts:
        for place, i in enumerate(part.coordinates):
            weight = draft.eq.contacts[c].direction.get(names[i], ex.ZERO)
            if draft.constants.is_constant(weight):
                found.append(_fixed_entry(draft, c, weight, ex.ZERO))
                continue
            row = draft.tape.row(weight)
            draft.layout.turning[c, place] = row
            sides = (row, zero, zero, zero, zero)
            entry = Instruction(Op.SIDE, draft.tape.new_row(0), sides, place=c)
            draft.tape.emit(0, entry)
            found.append(entry)
        pressing = frozenset(draft.eq.pressing(c))
        for other in part.contacts:
            if other in pressing:
                found.append(_pressed_entry(draft, c, other))
            elif c == other:
                stick = -draft.eq.strength(c) if c in draft.layout.together else ex.ZERO
                found.append(_fixed_entry(draft, c, stick, ex.ONE))
            else:
                found.append(_fixed_entry(draft, c, ex.ZERO, ex.ZERO))
    assert len(found) == (n + len(part.contacts)) ** 2
    return tuple(found)


def _pressed_entry(draft: Draft, i: int, normal: int) -> Instruction:
    """Coefficient of a normal force in λᵢ + σk = 0 in slip."""
    zero = draft.tape.row(ex.ZERO)
    slopes = tuple(draft.tape.row(-slope) for slope in pressed_slopes(draft, i, normal))
    entry = Instruction(Op.SIDE, draft.tape.new_row(0), (zero, *slopes), place=i)
    draft.tape.emit(max(draft.tape.stage[row] for row in slopes), entry)
    return entry


def _moving_entry(draft: Draft, e: Expr) -> Instruction:
    """An entry that is the same in all modes."""
    if draft.constants.is_constant(e):
        return _fixed_entry(draft, 0, e, e)
    row = draft.tape.row(e)
    return Instruction(Op.LINEAR, row, (row,))


def _fixed_entry(draft: Draft, contact: int, stick: Expr, slip: Expr) -> Instruction:
    """A constant entry, by the mode of a contact."""
    zero = Scaled(ex.ZERO)
    for e in (stick, slip):
        draft.constants.scalar(e)  # has a place
    return Instruction(Op.ENTRY, -1, parts=(Scaled(stick), Scaled(slip), zero, zero), place=contact)


def _block_sizes(
    draft: Draft,
    inertial: bool,
    matrix: Mapping[tuple[int, int], Expr],
    directions: Sequence[Mapping[str, Expr]],
    first: int,
    forces: list[int],
) -> None:
    """Scales of the rates and of the relative velocities: their values if no forces cancelled.
    `forces` are the positions of the sizes of the forces."""
    scalar = draft.number
    names = draft.d.inertial if inertial else draft.d.damped
    offset = draft.rate_sizes + (0 if inertial else draft.nq)
    terms = {x: [element("mag", place)] for x, place in zip(names, forces, strict=True)}
    places = {x: element("mag", offset + i) for i, x in enumerate(names)}
    for c, direction in enumerate(directions, first):
        for x, weight in direction.items():
            force = order_0(draft.tape.names[f"lambda:{c}"])
            terms[x].append(abs(product_of_sizes(scalar(weight), force)))
            if draft.eq.contacts[c].plane:
                # its direction may change
                most = order_0(draft.tape.row(draft.eq.contacts[c].plus))
                terms[x].append(abs(product_of_sizes(scalar(weight), most)))
    for i, x in enumerate(names):
        draft.note(offset + i, added(terms[x]) / abs(scalar(matrix[i, i])))
    for c, direction in enumerate(directions, first):
        size = added(product_of_sizes(abs(scalar(w)), places[x]) for x, w in direction.items())
        if inertial:
            draft.note(draft.nc + c, size)
        elif direction:
            draft.note(c, size, adding=True)
