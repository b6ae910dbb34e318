"""Rates that are defined implicitly by scalar equations: those of viscous coordinates with a
drag."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from stickslip.equations.codegen.draft import Draft, order_0
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.scalars import Scalar, scalars_of
from stickslip.symbolic.tape import Instruction, Op


def implicit_rates(draft: Draft) -> dict[str, int]:
    """Rows of the rates that are defined by scalar equations; the slopes of these rows are appended
    later."""
    tape = draft.tape
    found: dict[str, int] = {}
    for z, function in draft.eq.implicit.items():
        rate = f"d_{z}"
        slope = ex.derivative(function, rate)
        row = tape.new_row(1)
        tape.name(rate, row, 1)
        found[z] = row
        own = tape.instructions[1]
        own.append(Instruction(Op.IMPLICIT, row))
        start = len(own)
        rows = tape.row(function), tape.row(slope)
        tape.emit(1, Instruction(Op.WITHIN, row, rows, place=len(own) - start))
        names = {name: order_0(r) for name, r in tape.names.items()}
        values = scalars_of([function, slope], names, tape.regions, draft.constants)
        zero = values[function], values[slope]
        read = sorted({r for s in zero for r in _rows_of(s)} - {row})
        own[start - 1] = Instruction(Op.IMPLICIT, row, (row, *read), zero=zero)
        size = draft.size(draft.d.resistance(z)) + draft.size(_force_on(draft, z))
        place = draft.rate_sizes + draft.nq + draft.d.viscous.index(z)
        draft.note(place, Scalar("over", (size, order_0(rows[1]))))
    return found


def implicit_slopes(draft: Draft, found: Mapping[str, int]) -> None:
    """Rates of change of these rates, from the equations' own along the motion."""
    tape = draft.tape
    d = draft.d
    rates = {"t": ex.ONE}
    rates |= {x: ex.sym(f"d_{x}") for x in d.coordinates}
    rates |= {f"d_{q}": ex.sym(f"a:{q}") for q in d.inertial}
    rates |= {a: d.laws[a] for a in d.internal}
    for z in found:
        function = draft.eq.implicit[z]
        change = ex.along(function, rates) / ex.derivative(function, f"d_{z}")
        slope = tape.row(-change)
        place = next(j for j, made in enumerate(tape.instructions[1]) if made.row == found[z])
        own = tape.instructions[1][place]
        tape.instructions[1][place] = replace(own, inputs=(slope, *own.inputs[1:]))


def _force_on(draft: Draft, z: str) -> Expr:
    """The force on a viscous coordinate."""
    return draft.eq.viscous_force[draft.d.viscous.index(z)]


def _rows_of(value: Scalar) -> set[int]:
    """Rows that enter a value."""
    found: dict[Scalar, set[int]] = {}

    def visit(s: Scalar) -> set[int]:
        if s not in found:
            here = {s.index[0]} if s.op == "entry" and s.name == "W" else set[int]()
            found[s] = here.union(*map(visit, s.args))
        return found[s]

    return visit(value)
