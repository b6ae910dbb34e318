"""Equations of motion -> source text of the functions the engine calls.

The generated module has four functions, and ``KEPT``, the rows that are read beyond order 0:

``setup(p, K, M, C, J, omega)``
    constants, mass matrix, viscous matrix, contact directions and drive frequencies from the
    parameters;
``jets(t, y, mode, reg, K, Rq, Rz, N, W, A, B, mag)``
    Taylor coefficients of all rows up to order N along the motion in a mode, in powers of the time
    that W holds as the rate of the clock (so that they neither overflow nor vanish); 0, or 1 if the
    rates are not determined;
``residual(t, y, mode, reg, K, G, P)``
    how far sliding rate-independent contacts are from λ + σ s = 0, and the matrix to put them back;
``powers(W, reg, K, out)``
    energy, dissipated power, supplied power at order 0.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from stickslip.equations.codegen.printer import by_mode, printed
from stickslip.equations.derive import MotionEquations
from stickslip.model.system import Kind
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.tape import (
    ORIGIN,
    Instruction,
    Op,
    ParameterExpressions,
    Scaled,
    Tape,
    literal,
    scalar_code,
)

ORDERS = (8, 12, 16, 20, 24)  # that a Taylor series may have
_HEADER = '''"""Generated from a declaration; do not edit."""
import math
import numpy as np
from numba import boolean, cfunc, float64, int64, njit, void
from stickslip.equations.codegen.series import *
vector, matrix, indices = float64[::1], float64[:, ::1], int64[::1]
'''


@dataclass
class Layout:
    """Where the engine finds things.

    Attributes
    ----------
    state : list of str
        Names of the state vector y.
    sizes : dict
        n, nq, nz, nr, na, contacts by kind (mq, mz, mr), kinks.
    u, force, plus, minus, kinks : list of int
        Rows of uᵢ, λᵢ, sᵢ⁺, sᵢ⁻ by contact, and of the guards.
    rate_sizes : array of int
        Place of the size of the terms of each state's rate in ``mag``; −1: nothing cancels in it.
    named : dict of str to int
        Rows of the rates ``d_x`` and of the internal rates.
    kinetic : list of (int, int, int, int)
        Contact, direction of slip, row of the sliding force k, and row of s − k at speed 0; where k
        is declared.
    rates : list of int
        Rows of the rates of the state.
    rows : int
        Number of rows of W.
    instructions : list of Instruction
        The tape, in the order of its computation.
    constants : list of Expr
        What stands in K.
    """

    state: list[str]
    sizes: dict[str, int]
    u: list[int] = field(default_factory=list)
    force: list[int] = field(default_factory=list)
    plus: list[int] = field(default_factory=list)
    minus: list[int] = field(default_factory=list)
    kinks: list[int] = field(default_factory=list)
    named: dict[str, int] = field(default_factory=dict)
    kinetic: list[tuple[int, int, int, int]] = field(default_factory=list)
    rates: list[int] = field(default_factory=list)
    rows: int = 0
    instructions: list[Instruction] = field(default_factory=list)
    constants: dict[Expr, int] = field(default_factory=dict)
    magnitudes: int = 0
    frequencies: int = 0
    timed: bool = False
    rate_sizes: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))


@dataclass
class Generated:
    """Source text and layout of a system's compiled functions."""

    source: str
    layout: Layout


def generate(equations: MotionEquations) -> Generated:
    """Generate the module of a system."""
    return _Generator(equations).module()


class _Generator:
    def __init__(self, equations: MotionEquations) -> None:
        self.eq = equations
        d = self.d = equations.declaration
        self.constants = ParameterExpressions([*d.parameters, ORIGIN])
        self.nq, self.nz, self.nr, self.na = map(
            len, (d.inertial, d.viscous, d.rate_independent, d.internal)
        )
        self.mq, self.mz, self.mr = (equations.count(kind) for kind in Kind)
        self.n = len(d.state)
        sizes = dict(
            n=self.n,
            nq=self.nq,
            nz=self.nz,
            nr=self.nr,
            na=self.na,
            mq=self.mq,
            mz=self.mz,
            mr=self.mr,
            kinks=len(equations.kinks),
        )
        self.layout = Layout(d.state, sizes)
        rows = {name: i for i, name in enumerate(d.state)} | {"t": self.n}
        regions = {guard: i for i, guard in enumerate(equations.kinks)}
        self.tape = Tape(self.constants, rows, self.n + 1, regions)
        self.solves: dict[int, list[Instruction]] = {0: [], 1: [], 2: []}
        self.magnitudes: list[str] = []
        self.rate_sizes = 3 * (self.mq + self.mz + self.mr) + len(equations.kinks)
        self.scratch = self.rate_sizes + self.nq + self.nz + self.nr + self.na
        self.nc = self.mq + self.mz + self.mr

    # -- the blocks --------------------------------------------------------------------------------

    def velocity(self, i: int) -> None:
        """Row of the relative velocity of contact i, and its size for rounding."""
        c = self.eq.contacts[i]
        tape = self.tape
        parts = [Scaled(j, tape.names[f"d_{x}"]) for x, j in c.direction.items()]
        belt = tape.lower(c.speed)
        parts.append(Scaled(-belt.factor, belt.row))
        self.layout.u.append(tape.assign(parts, None))
        tape.name(f"u:{i}", self.layout.u[i], tape.stage[self.layout.u[i]])
        self.magnitudes.append(f"mag[{i}] = {self.size_of(parts)}")

    def size_of(self, parts: list[Scaled]) -> str:
        code = [(self.constants.code(p.factor), p.row) for p in parts]
        return (
            " + ".join(f"abs({c})" if row is None else f"abs({c}*W[{row}, 0])" for c, row in code)
            or "0.0"
        )

    def size(self, e: Expr) -> str:
        """Code for the sum of the moduli of the terms of an expression: the scale of its rounding
        error."""
        if e.op == "sum":
            parts = [f"abs({c!r})*({self.size(term)})" for term, c in e.terms]
            return " + ".join([*parts, repr(abs(float(e.value)))])
        if e.op == "prod" and any(base.op == "sum" and p == 1.0 for base, p in e.terms):
            return "*".join(self.factor_size(base, p) for base, p in e.terms)
        return self.size_of([self.tape.lower(e)])

    def factor_size(self, base: Expr, p: float) -> str:
        """Code for the size of a factor; a difference in brackets is as large as its terms."""
        if base.op == "sum" and p == 1.0 and not self.constants.is_constant(base):
            return f"({self.size(base)})"
        return f"({self.size_of([self.tape.lower(base)])})**{literal(p)}"

    def block(self, forces: list[Expr], first: int, count: int, stage: int, resolvent: str) -> int:
        """Solve one of the linear problems [x; λ] = R [f; g] order by order; returns the first row
        of x."""
        tape = self.tape
        n = len(forces) + count
        right = tape.rows
        for _ in range(n):
            tape.new_row(stage)
        solution = tape.rows
        for _ in range(n):
            tape.new_row(stage + 1)
        base = self.scratch
        self.scratch += n
        for j, f in enumerate(forces):
            tape.into(f, right + j)
            self.magnitudes.append(f"mag[{base + j}] = {self.size(f)}")
        for j in range(count):
            self.contact_side(first + j, right + len(forces) + j, stage)
            self.magnitudes.append(
                f"mag[{base + len(forces) + j}] = abs(W[{right + len(forces) + j}, 0])"
            )
        self.solves[stage].append(
            Instruction(Op.SOLVE, solution, (right,), size=n, matrix=resolvent)
        )
        for j in range(count):
            row = solution + len(forces) + j
            size = " + ".join(
                f"abs({resolvent}[{len(forces) + j}, {m}])*mag[{base + m}]" for m in range(n)
            )
            self.magnitudes.append(f"mag[{2 * self.nc + first + j}] = {size}")
            tape.name(f"lambda:{first + j}", row, stage + 1)
        self.block_sizes(forces, first, count, base, solution + len(forces))
        return solution

    def block_sizes(
        self, forces: list[Expr], first: int, count: int, base: int, multipliers: int
    ) -> None:
        """Scales of the rates and of the relative velocities: what they would be if no two forces
        cancelled."""
        inertial = first == 0 and len(forces) == self.nq and forces is self.eq.inertial_force
        names, matrix = (
            (self.d.inertial, self.eq.mass) if inertial else (self.d.viscous, self.eq.damping)
        )
        offset = self.rate_sizes + (0 if inertial else self.nq)
        for i, x in enumerate(names):
            terms = [f"mag[{base + i}]"]
            for j in range(count):
                weight = self.eq.contacts[first + j].direction.get(x)
                if weight is not None:
                    terms.append(f"abs({self.constants.code(weight)}*W[{multipliers + j}, 0])")
            total = " + ".join(terms)
            diagonal = self.constants.code(matrix[i][i])
            self.magnitudes.append(f"mag[{offset + i}] = ({total})/abs({diagonal})")
        for j in range(count):
            direction = self.eq.contacts[first + j].direction
            size = " + ".join(
                f"abs({self.constants.code(w)})*mag[{offset + names.index(x)}]"
                for x, w in direction.items()
            )
            place = f"mag[{self.nc + first + j}] =" if inertial else f"mag[{first + j}] +="
            self.magnitudes.append(f"{place} {size}")

    def contact_side(self, i: int, row: int, stage: int) -> None:
        """Right-hand side of contact i: the belt in stick, the friction force in slip."""
        c = self.eq.contacts[i]
        tape = self.tape
        belt = c.speed if c.kind == Kind.VISCOUS else ex.derivative(c.speed, "t")
        sides = tuple(tape.row(e) for e in (belt, c.kinetic_plus, c.kinetic_minus, c.plus, c.minus))
        tape.emit(stage, Instruction(Op.SIDE, row, sides, place=i))
        tape.stage[row] = stage

    def speeds(self) -> None:
        """Rows of |u| in the kinetic laws of inertial contacts."""
        for i in range(self.mq):
            row = self.tape.new_row(0)
            self.tape.emit(0, Instruction(Op.SPEED, row, (self.layout.u[i],), place=i))
            self.tape.name(f"speed:{i}", row, 0)

    def rates(self) -> int:
        """The linear problem for the rates of the rate-independent coordinates; returns the first
        row of ṙ."""
        tape = self.tape
        rate = self.eq.rate
        n = self.nr
        first = tape.rows
        for _ in range(n):
            tape.new_row(2)
        entries = [self.entry(i, j) for i in range(n) for j in range(n)]
        self.solves[1] += [entry for entry in entries if entry.inputs]
        right, base = tape.rows, self.scratch
        self.scratch += n
        for _ in range(n):
            tape.new_row(1)
        for i in range(n):
            c = self.mq + self.mz + i
            sides = (
                self.eq.contacts[c].speed,
                rate.rest[i],
                rate.threshold_rest[0][i],
                rate.threshold_rest[1][i],
            )
            rows = tuple(tape.row(e) for e in sides)
            self.solves[1].append(Instruction(Op.RIGHT, right + i, rows, place=c))
            # A contact that slides states a rate of its force; one that sticks a velocity, as large
            # as if it slid.
            plus, minus = (
                f"{self.size(rate.rest[i])} + {self.size(side[i])}" for side in rate.threshold_rest
            )
            weight = self.constants.code(rate.weight[i])
            stiffness = self.size(rate.stiffness[i][i])
            free = f"abs({weight})*over({plus}, {stiffness}) + abs(W[{rows[0]}, 0])"
            self.magnitudes.append(f"mag[{base + i}] = {by_mode(c, free, plus, minus)}")
        self.solves[1].append(
            Instruction(Op.RATES, first, (right,), size=n, entries=tuple(entries))
        )
        for i in range(n):
            inner = " + ".join(f"abs(B[{i}, {m}])*mag[{base + m}]" for m in range(n))
            c = self.mq + self.mz + i
            place = self.rate_sizes + self.nq + self.nz + i
            self.magnitudes.append(f"mag[{place}] = {inner}")
            self.magnitudes.append(
                f"mag[{c}] += abs({self.constants.code(rate.weight[i])})*mag[{place}]"
            )
            self.magnitudes.append(f"mag[{2 * self.nc + c}] = {self.size(rate.force[i])}")
        return first

    def entry(self, i: int, j: int) -> Instruction:
        """An entry of the matrix of that problem."""
        rate = self.eq.rate
        contact = self.mq + self.mz + i
        own = Scaled(rate.weight[i] if i == j else ex.ZERO)
        others = rate.stiffness[i][j], rate.threshold_slope[0][i][j], rate.threshold_slope[1][i][j]
        if all(map(self.constants.is_constant, others)):
            return Instruction(Op.ENTRY, -1, parts=(own, *map(Scaled, others)), place=contact)
        rows = tuple(self.tape.row(e) for e in others)
        return Instruction(Op.ENTRY, self.tape.new_row(1), rows, (own,), place=contact)

    def kinetic_laws(self) -> None:
        """Rows that say whether sliding forces are admissible, 0 ≤ k and k ≤ s at speed 0."""
        for i, c in enumerate(self.eq.contacts):
            for side, force, static in (
                (1, c.kinetic_plus, c.plus),
                (-1, c.kinetic_minus, c.minus),
            ):
                if force is not static:
                    at_rest = ex.substitute(force, {f"speed:{i}": ex.ZERO})
                    self.layout.kinetic.append(
                        (i, side, self.tape.row(force), self.tape.row(static - at_rest))
                    )

    # -- the functions -----------------------------------------------------------------------------

    def module(self) -> Generated:
        """Lay the equations out, and print the functions."""
        self.lay_out()
        residual, powers = self.residual(), self.powers()
        jets = self.jets()
        setup = self.setup()
        self.finish()
        layout = self.layout
        guards = [*layout.u, *layout.force, *layout.plus, *layout.minus, *layout.kinks]
        guards += [row for *_, force, margin in layout.kinetic for row in (force, margin)]
        kept = sorted({*range(self.n), *guards})
        parts = [[_HEADER, f"KEPT = {tuple(kept)}"], setup, jets, residual, powers]
        lines = [line for part in parts for line in (*part, "")]
        return Generated("\n".join(lines), layout)

    def lay_out(self) -> None:
        """Rows of everything, in the order in which it can be computed: velocities, rates, laws of
        internal variables, accelerations, thresholds and guards."""
        tape = self.tape
        d = self.d
        eq = self.eq
        for i in range(self.mq):
            self.velocity(i)
        self.speeds()
        viscous = self.block(eq.viscous_force, self.mq, self.mz, 0, "Rz") if self.nz else 0
        for i, z in enumerate(d.viscous):
            tape.name(f"d_{z}", viscous + i, 1)
        for i in range(self.mq, self.mq + self.mz):
            self.velocity(i)
        if self.nr:
            first = self.rates()
            for i, r in enumerate(d.rate_independent):
                tape.name(f"d_{r}", first + i, 2)
            for i in range(self.nr):
                c = self.mq + self.mz + i
                self.velocity(c)
                tape.name(f"lambda:{c}", tape.row(eq.rate.force[i]), 0)
        # The velocities' own magnitudes are written first, so that the linear problems may add to
        # them.
        self.magnitudes.sort(key=lambda line: "+=" in line)
        laws = [tape.row(law) for law in eq.laws]
        for name, row in zip(d.internal, laws, strict=True):
            tape.name(f"d_{name}", row, tape.stage[row]) if f"d_{name}" not in d.state else None
        inertial = self.block(eq.inertial_force, 0, self.mq, 2, "Rq") if self.nq else 0
        self.law_sizes()
        self.kinetic_laws()
        self.guards()
        layout = self.layout
        layout.named = {f"d_{x}": tape.names[f"d_{x}"] for x in d.coordinates}
        layout.named |= {f"d_{a}": row for a, row in zip(d.internal, laws, strict=True)}
        layout.named |= {f"dd_{q}": inertial + i for i, q in enumerate(d.inertial)}
        layout.rates = [*range(self.nq, 2 * self.nq), *(inertial + i for i in range(self.nq))]
        layout.rates += [*(viscous + i for i in range(self.nz))]
        layout.rates += [*(tape.names[f"d_{r}"] for r in d.rate_independent), *laws]
        stages, solves = tape.instructions, self.solves
        layout.instructions = [
            *stages[0],
            *solves[0],
            *stages[1],
            *solves[1],
            *stages[2],
            *solves[2],
            *stages[3],
        ]

    def guards(self) -> None:
        """Rows of forces, thresholds and kinks, and the sizes of their terms."""
        tape = self.tape
        layout = self.layout
        layout.plus = [tape.row(c.plus) for c in self.eq.contacts]
        layout.minus = [tape.row(c.minus) for c in self.eq.contacts]
        layout.force = [tape.names[f"lambda:{i}"] for i in range(self.nc)]
        for i, (plus, minus) in enumerate(zip(layout.plus, layout.minus, strict=True)):
            # A force is measured against its threshold, too.
            self.magnitudes.append(
                f"mag[{2 * self.nc + i}] += abs(W[{plus}, 0]) + abs(W[{minus}, 0])"
            )
        for j, guard in enumerate(self.eq.kinks):
            layout.kinks.append(tape.row(guard))
            self.magnitudes.append(f"mag[{3 * self.nc + j}] = {self.size(guard)}")

    def finish(self) -> None:
        """How large everything has become by printing."""
        layout = self.layout
        first = np.arange(self.rate_sizes, self.scratch)[: self.nq + self.nz + self.nr + self.na]
        layout.rate_sizes = np.concatenate([np.full(self.nq, -1), first]).astype(np.int64)
        layout.rows = self.tape.rows
        layout.magnitudes = self.scratch
        layout.frequencies = len(self.eq.frequencies)
        layout.timed = self.eq.timed
        layout.constants = self.constants.slots

    def setup(self) -> list[str]:
        d = self.d
        code = self.constants.code
        entries = [
            (f"M[{i}, {j}]", e) for i, row in enumerate(self.eq.mass) for j, e in enumerate(row)
        ]
        entries += [
            (f"C[{i}, {j}]", e) for i, row in enumerate(self.eq.damping) for j, e in enumerate(row)
        ]
        for i, c in enumerate(self.eq.contacts):
            entries += [
                (f"J[{i}, {j}]", c.direction.get(x, ex.ZERO)) for j, x in enumerate(d.coordinates)
            ]
        fill = [f"{place} = {code(e)}" for place, e in entries]
        fill += [f"omega[{i}] = abs({code(e)})" for i, e in enumerate(self.eq.frequencies)]
        return [
            _compiled("void(vector, vector, matrix, matrix, matrix, vector)"),
            "def setup(p, K, M, C, J, omega):",
            *_indent([*self.constants.source(), *fill, "return"]),
        ]

    def law_sizes(self) -> None:
        """Scales of the rates of the internal variables."""
        for i, law in enumerate(self.eq.laws):
            self.magnitudes.append(
                f"mag[{self.rate_sizes + self.nq + self.nz + self.nr + i}] = {self.size(law)}"
            )

    def jets(self) -> list[str]:
        n, layout = self.n, self.layout
        loop = [
            line
            for instruction in layout.instructions
            for line in printed(instruction, self.constants)
        ]
        loop += [
            f"W[{i}, k + 1] = W[{row}, k]*(unit/(k + 1))" for i, row in enumerate(layout.rates)
        ]
        body = [
            f"unit = W[{n}, 1]",
            f"for i in range({n}):",
            "    W[i, 0] = y[i]",
            f"W[{n}, 0] = t",
            "for k in range(2, N + 1):",
            f"    W[{n}, k] = 0.0",
            "for k in range(N):",
            *_indent(loop),
            *self.magnitudes,
            "return 0",
        ]
        return [
            _compiled(
                "int64(float64, vector, indices, indices, vector, matrix, matrix, int64, "
                f"{'matrix, ' * 3}vector)"
            ),
            "def jets(t, y, mode, reg, K, Rq, Rz, N, W, A, B, mag):",
            *_indent(body),
        ]

    def residual(self) -> list[str]:
        rate = self.eq.rate
        names = {s: f"y[{i}]" for i, s in enumerate(self.d.state)}
        regions = {guard: f"reg[{i}]" for i, guard in enumerate(self.eq.kinks)}
        acting = self.eq.contacts[self.mq + self.mz :]
        targets = [*rate.force, *(c.plus for c in acting), *(c.minus for c in acting)]
        targets += [term for force in rate.force for term, _ in terms(force)]
        targets += [e for m in (rate.partial, *rate.threshold_partial) for row in m for e in row]
        lines, v = scalar_code(targets, names, regions, self.constants)
        for i, c in enumerate(acting):
            m = f"mode[{self.mq + self.mz + i}]"
            plus, minus = v[c.plus], v[c.minus]
            # The largest force so far: what a residual is small against also where the force passes
            # through zero.
            scale = " + ".join(f"abs({e!r}*{v[term]})" for term, e in terms(rate.force[i]))
            lines.append(
                f"G[{self.nr + i}] = max(G[{self.nr + i}], {scale} + max(abs({plus}), "
                f"abs({minus})))"
            )
            lines.append(
                f"G[{i}] = 0.0 if {m} == 0 else {v[rate.force[i]]} + ({plus} if {m} > 0 else "
                f"-{minus})"
            )
            for j in range(self.nr):
                h, p, q = (v[x[i][j]] for x in (rate.partial, *rate.threshold_partial))
                own = 1.0 if i == j else 0.0
                lines.append(
                    f"P[{i}, {j}] = {own} if {m} == 0 else ({h} + {p} if {m} > 0 else {h} - {q})"
                )
        return [
            _compiled("void(float64, vector, indices, indices, vector, vector, matrix)"),
            "def residual(t, y, mode, reg, K, G, P):",
            *_indent([*lines, "return"]),
        ]

    def powers(self) -> list[str]:
        names = {s: f"W[{row}, 0]" for s, row in self.tape.names.items()}
        regions = {guard: f"reg[{i}]" for i, guard in enumerate(self.eq.kinks)}
        targets = [self.eq.energy, self.eq.dissipation, self.eq.supply]
        lines, v = scalar_code(targets, names, regions, self.constants)
        lines = [f"t = W[{self.n}, 0]", *lines]
        lines += [f"out[{i}] = {v[e]}" for i, e in enumerate(targets)]
        return [
            _compiled("void(matrix, indices, vector, vector)"),
            "def powers(W, reg, K, out):",
            *_indent([*lines, "return"]),
        ]


def terms(e: Expr) -> list[tuple[Expr, float]]:
    """Terms of a sum with their coefficients."""
    return list(e.terms) if e.op == "sum" else [(e, 1.0)]


def _compiled(signature: str) -> str:
    """Decorator of a generated function."""
    return f"@cfunc({signature}, cache=True, nopython=True, error_model='numpy', _nrt=False)"


def _indent(lines: list[str]) -> list[str]:
    return ["    " + line for line in lines]
