"""Equations of motion -> the statements of the functions that the engine calls.

A system has six functions:

``setup(p, K, M, C, J, omega)``
    constants, mass matrix, viscous matrix, contact directions and drive frequencies from the
    parameters, in arrays of zeros;
``jets(t, y, mode, reg, K, Rq, Rz, N, W, A, B, mag)``
    Taylor coefficients of all rows up to order N along the motion in a mode, in powers of the time
    unit that W contains as the rate of the clock (so that they neither overflow nor underflow);
    returns 0, or 1 if the rates are not determined;
``residual(t, y, mode, reg, K, G, P)``
    residual λ + σ s of sliding rate-independent contacts, and the matrix that corrects it;
``powers(W, reg, K, out)``
    energy, dissipated power, supplied power at order 0;
``landings(W, reg, K, out)``
    new values of the state in all jumps, from order 0;
``supports(w, K, out)``
    for each dissipation that is a formula, the support function of its forces at a vector w.
"""

from __future__ import annotations

import numpy as np

from stickslip.equations.codegen.contacts import (
    adhesion_rows,
    has_constant_friction,
    prescribed_forces,
    pressed_slopes,
    speed_row,
    velocity_row,
)
from stickslip.equations.codegen.draft import Draft, order_0
from stickslip.equations.codegen.guards import guard_rows, kinetic_laws
from stickslip.equations.codegen.implicit import implicit_rates, implicit_slopes
from stickslip.equations.codegen.layout import Generated, Layout
from stickslip.equations.codegen.linear_problems import solved_block
from stickslip.equations.codegen.planes import aimed, pulled, support_stores
from stickslip.equations.codegen.rates import rate_rows, residual_stores
from stickslip.equations.derive import MotionEquations
from stickslip.model.entries.declared import Kind
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.scalars import Store, element, scalars_of
from stickslip.symbolic.tape import Instruction, rows_made, rows_read


def generate(equations: MotionEquations) -> Generated:
    """Lay out the equations, and state the content of the functions of a system."""
    draft = Draft(equations)
    _lay_out(draft)
    residual, powers, landings = residual_stores(draft), _powers(draft), _landings(draft)
    supports = support_stores(draft)
    setup = _setup(draft)
    _finish(draft)
    layout, sizes = draft.layout, draft.magnitudes
    return Generated(layout, draft.constants, setup, sizes, residual, powers, landings, supports)


def _lay_out(draft: Draft) -> None:
    """Rows of everything, in the order in which it can be computed: velocities, rates, laws of
    internal variables, accelerations, thresholds and guards."""
    tape = draft.tape
    d = draft.d
    eq = draft.eq
    parts = [velocity_row(draft, i) for i in range(draft.mq)]
    for i in range(draft.mq):
        speed_row(draft, i)
    adhesion_rows(draft)
    aimed(draft, parts, Kind.INERTIAL)
    pulled(draft, Kind.VISCOUS)
    viscous = solved_block(draft, eq.viscous_force[: len(d.damped)], draft.mq, draft.mz, 0, "Rz")
    for z, row in zip(d.damped, viscous, strict=True):
        tape.name(f"d_{z}", row, 1)
    implicit = implicit_rates(draft)
    viscous += implicit.values()
    parts += [velocity_row(draft, i) for i in range(draft.mq, draft.mq + draft.mz)]
    for i, c in enumerate(eq.contacts):
        if c.prescribed:
            speed_row(draft, i)
    aimed(draft, parts, Kind.VISCOUS)
    if draft.nr:
        pulled(draft, Kind.RATE_INDEPENDENT)
        first = rate_rows(draft)
        for i, r in enumerate(d.rate_independent):
            tape.name(f"d_{r}", first + i, 2)
        for i in range(draft.nr):
            c = draft.mq + draft.mz + i
            velocity_row(draft, c)
            tape.name(f"lambda:{c}", tape.row(eq.rate.force[i]), 0)
    # The velocities' own magnitudes are written first, so that the linear problems may add to them.
    draft.magnitudes.sort(key=lambda store: store.adding)
    laws = [tape.row(law) for law in eq.laws]
    for name, row in zip(d.internal, laws, strict=True):
        tape.name(f"d_{name}", row, tape.stage[row]) if f"d_{name}" not in d.state else None
    _stretches(draft)
    inertial = solved_block(draft, eq.shared_force, 0, draft.mq, 2, "Rq")
    for q, row in zip(d.inertial, inertial, strict=True):
        tape.name(f"a:{q}", row, 3)
    implicit_slopes(draft, implicit)
    _law_sizes(draft)
    kinetic_laws(draft)
    prescribed_forces(draft)
    guard_rows(draft)
    layout = draft.layout
    layout.jumps = [
        (jump.kink, jump.direction, [d.places[x] for x in jump.values]) for jump in eq.jumps
    ]
    layout.named = {f"d_{x}": tape.names[f"d_{x}"] for x in d.coordinates}
    layout.named |= {f"d_{a}": row for a, row in zip(d.internal, laws, strict=True)}
    layout.named |= {f"dd_{q}": row for q, row in zip(d.inertial, inertial, strict=True)}
    layout.rates = [*range(draft.nq, 2 * draft.nq), *inertial, *viscous]
    layout.rates += [*(tape.names[f"d_{r}"] for r in d.rate_independent), *laws]
    stages, solves = tape.instructions, draft.solves
    layout.instructions = [
        *stages[0],
        *solves[0],
        *stages[1],
        *solves[1],
        *stages[2],
        *solves[2],
        *stages[3],
    ]


def _stretches(draft: Draft) -> None:
    """Rows of the stretches that the forces of many coordinates have in common, and their sizes."""
    for symbol, stretch in draft.eq.stretches.items():
        row = draft.tape.row(stretch)
        draft.tape.name(symbol, row, draft.tape.stage[row])
        draft.note(draft.scratch, draft.size(stretch))
        draft.stretch_sizes[ex.sym(symbol)] = element("mag", draft.scratch)
        draft.scratch += 1


def _finish(draft: Draft) -> None:
    """Final sizes of the layout, and the rows that are needed beyond order 0."""
    layout = draft.layout
    first = np.arange(draft.rate_sizes, draft.scratch)[: draft.nq + draft.nz + draft.nr + draft.na]
    layout.rate_sizes = np.concatenate([np.full(draft.nq, -1), first]).astype(np.int64)
    layout.rows = draft.tape.rows
    layout.magnitudes = draft.scratch
    layout.frequencies = len(draft.eq.frequencies)
    layout.timed = draft.eq.timed
    layout.prescribed = any(c.prescribed for c in draft.eq.contacts)
    layout.constants = draft.constants.slots
    layout.formulas = len(draft.formulas)
    layout.kept = sorted({*range(draft.n), *_guards(layout)})
    needed = _closure(layout.instructions, {*layout.kept, *layout.rates})
    tape, layout.instructions = layout.instructions, []
    for i in tape:
        (layout.instructions if needed & {*rows_made(i)} else layout.shown).append(i)


def _guards(layout: Layout) -> list[int]:
    """Rows that guards look at."""
    guards = [*layout.u, *layout.force, *layout.plus, *layout.minus, *layout.kinks]
    guards += [row for *_, force, margin in layout.kinetic for row in (force, margin)]
    guards += layout.gaps.values()
    for _, first, speed, *rows, _, static, slips, _, _, _, _, _ in layout.planes:
        guards += [*range(first, speed + 1), *rows, static, slips]
    return [row for row in guards if row >= 0] + [row for _, _, row in layout.pieces]


def _setup(draft: Draft) -> list[Store]:
    """Constants, and entries of matrices, directions and frequencies."""
    d = draft.d
    scalar = draft.constants.scalar
    own: dict[str, int] = {}
    entries = list[Store]()
    for name, resolvent, names, matrix in (
        ("M", "Rq", d.inertial, draft.eq.mass),
        ("C", "Rz", d.damped, draft.eq.damping),
    ):
        column = {
            i: j for part in draft.layout.coupled[resolvent] for j, i in enumerate(part.coordinates)
        }
        own |= {x: column[i] for i, x in enumerate(names)}
        entries += [
            Store(name, (i, column[j]), scalar(e))
            for (i, j), e in matrix.items()
            if draft.constants.is_constant(e)
        ]
    entries += [
        Store("J", (i, own[x]), scalar(e))
        for i, c in enumerate(draft.eq.contacts[: draft.mq + draft.mz])
        for x, e in c.direction.items()
        if draft.constants.is_constant(e)
    ]
    last = draft.layout.shape("J")[1] - 1
    entries += [
        Store("J", (i, last - k - (2 if k else 0)), scalar(pressed_slopes(draft, i, normal)[0]))
        for i in range(draft.mq)
        if has_constant_friction(draft, i)
        for k, normal in enumerate(draft.eq.pressing(i))
    ]
    for i in draft.layout.together:
        axis = draft.eq.contacts[i].axis if draft.eq.contacts[i].plane else ex.ONE
        entries.append(Store("J", (i, last - 2), scalar(axis)))
        entries.append(Store("J", (i, last - 1), scalar(draft.eq.strength(i))))
    frequencies = enumerate(draft.eq.frequencies)
    entries += [Store("omega", (i,), abs(scalar(e))) for i, e in frequencies]
    return [*draft.constants.stores(), *entries]


def _law_sizes(draft: Draft) -> None:
    """Scales of the rates of the internal variables."""
    for i, law in enumerate(draft.eq.laws):
        draft.note(draft.rate_sizes + draft.nq + draft.nz + draft.nr + i, draft.size(law))


def _powers(draft: Draft) -> list[Store]:
    """Energy, dissipated power and supplied power."""
    return _listed(draft, [draft.eq.energy, draft.eq.dissipation, draft.eq.supply])


def _landings(draft: Draft) -> list[Store]:
    """New values of the state in all jumps."""
    return _listed(draft, [e for jump in draft.eq.jumps for e in jump.values.values()])


def _listed(draft: Draft, targets: list[Expr]) -> list[Store]:
    """Values at order 0, one after the other."""
    names = {s: order_0(row) for s, row in draft.tape.names.items()}
    v = scalars_of(targets, names, draft.tape.regions, draft.constants)
    return [Store("out", (i,), v[e]) for i, e in enumerate(targets)]


def _closure(instructions: list[Instruction], wanted: set[int]) -> set[int]:
    """Rows, and all that they depend on."""
    before = -1
    while len(wanted) > before:
        before = len(wanted)
        for i in reversed(instructions):
            if wanted & {*rows_made(i)}:
                wanted |= {*rows_read(i), *i.inputs}
    return wanted
