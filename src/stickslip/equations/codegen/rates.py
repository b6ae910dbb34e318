"""Rates of the rate-independent coordinates: their linear problem, and the projection of the state
onto λ + σ s = 0 of sliding contacts."""

from __future__ import annotations

from stickslip.equations.codegen.draft import Draft, order_0, product_of_sizes
from stickslip.equations.planes import Plane
from stickslip.model.entries.declared import Kind
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.scalars import Scalar, Store, added, by_mode, element, numeral, scalars_of
from stickslip.symbolic.tape import Instruction, Op, Scaled


def rate_rows(draft: Draft) -> int:
    """The linear problem for the rates of the rate-independent coordinates; returns the first row
    of ṙ."""
    tape = draft.tape
    rate = draft.eq.rate
    n = draft.nr
    first = tape.rows
    for _ in range(n):
        tape.new_row(2)
    entries = [_entry(draft, i, j) for i in range(n) for j in range(n)]
    draft.solves[1] += [entry for entry in entries if entry.inputs]
    right, base = tape.rows, draft.scratch
    draft.scratch += n
    for _ in range(n):
        tape.new_row(1)
    for i in range(n):
        c = draft.mq + draft.mz + i
        sides = (
            draft.eq.contacts[c].speed,
            rate.rest[i],
            rate.threshold_rest[0][i],
            rate.threshold_rest[1][i],
        )
        plane = _plane_of(draft, i)
        if plane is not None:
            speeds = [draft.eq.contacts[part].speed for part in plane.parts]
            rest = rate.sliding_rest(plane, i, speeds, draft.mq + draft.mz)
            sides = (draft.eq.contacts[c].speed, rest, ex.ZERO, ex.ZERO)
        rows = tuple(tape.row(e) for e in sides)
        draft.solves[1].append(Instruction(Op.RIGHT, right + i, rows, place=c))
        # A contact that slides states a rate of its force; one that sticks a velocity, as large as
        # if it slid.
        plus, minus = (
            draft.size(rate.rest[i]) + draft.size(side[i]) for side in rate.threshold_rest
        )
        weight = abs(draft.constants.scalar(rate.weight[i]))
        over = Scalar("over", (plus, draft.size(rate.stiffness[i][i])))
        free = product_of_sizes(weight, over) + abs(order_0(rows[0]))
        draft.note(base + i, by_mode(c, free, plus, minus))
    draft.solves[1].append(
        Instruction(Op.RATES, first, (right,), size=n, matrix="B", entries=tuple(entries))
    )
    for i in range(n):
        c = draft.mq + draft.mz + i
        place = draft.rate_sizes + draft.nq + draft.nz + i
        draft.note(place, Scalar("spread", name="B", index=(i, n, base)))
        weight = abs(draft.constants.scalar(rate.weight[i]))
        draft.note(c, product_of_sizes(weight, element("mag", place)), adding=True)
        draft.note(2 * draft.nc + c, draft.size(rate.force[i]))
    return first


def _entry(draft: Draft, i: int, j: int) -> Instruction:
    """An entry of the matrix of that problem."""
    rate = draft.eq.rate
    plane = _plane_of(draft, i)
    if plane is not None:
        own = Scaled(rate.weight[i] if i == j else ex.ZERO)
        zero = draft.tape.row(ex.ZERO)
        rows = (draft.tape.row(rate.sliding(plane, i, j, draft.mq + draft.mz)), zero, zero)
        place = draft.mq + draft.mz + i
        return Instruction(Op.ENTRY, draft.tape.new_row(1), rows, (own,), place=place)
    contact = draft.mq + draft.mz + i
    own = Scaled(rate.weight[i] if i == j else ex.ZERO)
    others = rate.stiffness[i][j], rate.threshold_slope[0][i][j], rate.threshold_slope[1][i][j]
    if all(map(draft.constants.is_constant, others)):
        return Instruction(Op.ENTRY, -1, parts=(own, *map(Scaled, others)), place=contact)
    rows = tuple(draft.tape.row(e) for e in others)
    return Instruction(Op.ENTRY, draft.tape.new_row(1), rows, (own,), place=contact)


def residual_stores(draft: Draft) -> list[Store]:
    """Residuals λ + σ s of sliding contacts, and the matrix of their correction."""
    rate = draft.eq.rate
    names = {s: element("y", i) for i, s in enumerate(draft.d.state)}
    names["t"] = Scalar("name", name="t")
    acting = draft.eq.contacts[draft.mq + draft.mz :]
    targets = [*rate.force, *(c.plus for c in acting), *(c.minus for c in acting)]
    targets += [term for force in rate.force for term, _ in _terms(force)]
    targets += [e for m in (rate.partial, *rate.threshold_partial) for row in m for e in row]
    back = {p.parts[0]: _back(draft, p) for p in draft.eq.planes if _plane_rates(draft, p)}
    targets += [e for off, rows in back.values() for e in (off, *rows[0], *rows[1])]
    v = scalars_of(targets, names, draft.tape.regions, draft.constants)
    stores = list[Store]()
    for i, c in enumerate(acting):
        contact = draft.mq + draft.mz + i
        plus, minus = v[c.plus], v[c.minus]
        # The largest force so far: residuals are relative to it also when the force passes through
        # zero.
        parts = [abs(numeral(e) * v[term]) for term, e in _terms(rate.force[i])]
        scale = added([*parts, Scalar("larger", (abs(plus), abs(minus)))])
        largest = Scalar("larger", (element("G", draft.nr + i), scale))
        stores.append(Store("G", (draft.nr + i,), largest))
        force = v[rate.force[i]]
        away = by_mode(contact, numeral(0.0), force + plus, force + -minus)
        if (plane := _plane_of(draft, i)) is not None:
            off, rows = back[plane.parts[0]]
            first = contact == plane.parts[0]
            held = v[off] if first else numeral(0.0)
            stores.append(Store("G", (i,), by_mode(contact, numeral(0.0), held, held)))
            for j in range(draft.nr):
                own = numeral(1.0 if i == j else 0.0)
                moved = v[rows[0 if first else 1][j]]
                stores.append(Store("P", (i, j), by_mode(contact, own, moved, moved)))
            continue
        stores.append(Store("G", (i,), away))
        for j in range(draft.nr):
            h, p, q = (v[x[i][j]] for x in (rate.partial, *rate.threshold_partial))
            own = numeral(1.0 if i == j else 0.0)
            stores.append(Store("P", (i, j), by_mode(contact, own, h + p, h + -q)))
    return stores


def _back(draft: Draft, plane: Plane) -> tuple[Expr, tuple[list[Expr], list[Expr]]]:
    """Residual s − |A⁻¹λ| of a slip in a plane, and the two rows of a Newton step that corrects it
    along the direction of slip."""
    rate = draft.eq.rate
    first = draft.mq + draft.mz
    size = ex.power(ex.add(*((e**2, 1.0) for e in plane.pull)), ex.num(0.5))
    aim = {f"n:{i}": e / size for i, e in zip(plane.parts, plane.pull, strict=True)}
    along = list[Expr]()
    for j in range(draft.nr):
        terms = [
            (ex.sym(f"n:{i}") / axis * rate.partial[i - first][j], 1.0)
            for i, axis in zip(plane.parts, plane.axes, strict=True)
        ]
        slope = rate.threshold_partial[0][plane.parts[0] - first][j]
        terms.append((slope / plane.axes[0], 1.0))
        along.append(ex.substitute(ex.add(*terms), aim))
    across = [
        ex.substitute(rate.sliding(plane, plane.parts[1] - first, j, first), aim)
        for j in range(draft.nr)
    ]
    return plane.static - size, (along, across)


def _plane_rates(draft: Draft, plane: Plane) -> bool:
    """Whether a contact in a plane is one of rate-independent coordinates."""
    return draft.eq.contacts[plane.parts[0]].kind == Kind.RATE_INDEPENDENT


def _plane_of(draft: Draft, i: int) -> Plane | None:
    """The contact in a plane that rate-independent coordinate i belongs to."""
    contact = draft.mq + draft.mz + i
    return next((p for p in draft.eq.planes if contact in p.parts), None)


def _terms(e: Expr) -> list[tuple[Expr, float]]:
    """Terms of a sum with their coefficients."""
    return list(e.terms) if e.op == "sum" else [(e, 1.0)]
