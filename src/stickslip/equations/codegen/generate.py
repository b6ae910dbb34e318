"""Equations of motion -> what the functions that the engine calls have to compute, as data.

A system has six functions:

``setup(p, K, M, C, J, omega)``
    constants, mass matrix, viscous matrix, contact directions and drive frequencies from the
    parameters, in arrays of zeros;
``jets(t, y, mode, reg, K, Rq, Rz, N, W, A, B, mag)``
    Taylor coefficients of all rows up to order N along the motion in a mode, in powers of the time
    that W holds as the rate of the clock (so that they neither overflow nor vanish); 0, or 1 if the
    rates are not determined;
``residual(t, y, mode, reg, K, G, P)``
    how far sliding rate-independent contacts are from λ + σ s = 0, and the matrix to put them back;
``powers(W, reg, K, out)``
    energy, dissipated power, supplied power at order 0;
``landings(W, reg, K, out)``
    new values of the state in all jumps, from order 0;
``supports(w, K, out)``
    of each dissipation that is a formula, the support function of its forces at a vector w.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from stickslip.equations.coupling import Component, components
from stickslip.equations.derive import MotionEquations, Plane
from stickslip.kept import cached_property
from stickslip.model.declaration import DryContact
from stickslip.model.names import NORMAL
from stickslip.model.system import Kind
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.scalars import Scalar, Store, added, by_mode, element, numeral
from stickslip.symbolic.tape import (
    ORIGIN,
    Instruction,
    Op,
    ParameterExpressions,
    Scaled,
    Tape,
    rows_made,
    rows_read,
    scalars_of,
)

if TYPE_CHECKING:
    from stickslip.convex.formula import ConvexFormula

ORDERS = (8, 12, 16, 20, 24)  # that a Taylor series may have
INVERSES = ("Rq", "Rz")  # of the linear problems of inertial and of viscous coordinates
MATRICES = (*INVERSES, "B")  # and of rate-independent ones


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
    kept : list of int
        Rows that are read beyond order 0.
    instructions : list of Instruction
        The tape, in the order of its computation.
    shown : list of Instruction
        What follows at order 0: rows that results show, and nothing else depends on.
    constants : dict of Expr to int
        What stands in K, and where.
    coupled : dict of str to list of Component
        For each inverse matrix what its rows stand for, component by component.
    together : dict of int to int
        Of inertial contacts whose directions may depend on each other, with friction in a plane:
        which such group each belongs to.
    turning : dict of (int, int) to int
        Rows of the coefficients of directions that change on the way, by contact and by the place
        of the coordinate in its component.
    gaps, restitution : dict of int to int
        Rows of the gaps of contacts that can open, and of the restitution of these and of their
        friction.
    planes : list of tuple of int
        Of each contact in a plane, or face, its components (−1: no third one), the rows of its
        direction (the first), of |Au|, of Au, and of s² − |A⁻¹λ|², the place of the size of that,
        the rows of s and of what is not negative in slip, 1 if it has mass, 1 if the response is
        not linear in the direction, the number of its formula, −1: none, and 1 if Au is a linear
        combination of rates with constant coefficients.
    formulas : int
        Number of dissipations that are formulas.
    pieces : list of (int, int, int)
        Kinks between pieces of these, the number of the plane, and the row of the same function of
        the direction.
    carrying : dict of str to int
        Rows of the force of constraints, the sum of those of their sides, and of the normal forces
        of contacts that adhere.
    parts : dict of str to (int, int, int, int)
        Of contacts that are one with others, the rows of force, thresholds and relative velocity.
    links : list of (int, int, tuple of int)
        What rubs under a normal force, the contact that has it, and the rows of the coefficients:
        kinetic against slip forward and back, static likewise; contact by contact.
    pressed : int
        The most normal forces in the friction of a contact, at least 1.
    prescribed : bool
        Whether there is friction between motions that are given.
    jumps : list of (int, int, list of int)
        Of each jump the number of its kink, its direction, and which parts of the state have new
        values.
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
    kept: list[int] = field(default_factory=list)
    instructions: list[Instruction] = field(default_factory=list)
    shown: list[Instruction] = field(default_factory=list)
    constants: dict[Expr, int] = field(default_factory=dict)
    magnitudes: int = 0
    frequencies: int = 0
    timed: bool = False
    rate_sizes: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    coupled: dict[str, list[Component]] = field(default_factory=dict)
    together: dict[int, int] = field(default_factory=dict)
    turning: dict[tuple[int, int], int] = field(default_factory=dict)
    gaps: dict[int, int] = field(default_factory=dict)
    restitution: dict[int, int] = field(default_factory=dict)
    planes: list[tuple[int, ...]] = field(default_factory=list)
    formulas: int = 0
    pieces: list[tuple[int, int, int]] = field(default_factory=list)
    pressed: int = 1
    prescribed: bool = False
    carrying: dict[str, int] = field(default_factory=dict)
    parts: dict[str, tuple[int, int, int, int]] = field(default_factory=dict)
    links: list[tuple[int, int, tuple[int, ...]]] = field(default_factory=list)
    jumps: list[tuple[int, int, list[int]]] = field(default_factory=list)

    @cached_property
    def without_series(self) -> frozenset[int]:
        """Rows that are known at single times only."""
        return frozenset(row for i in self.shown for row in rows_made(i))

    @property
    def columns_behind(self) -> int:
        """Columns of J behind those of the coordinates: axis and strength of contacts that share
        forces, and coefficients of friction under normal forces."""
        return self.pressed + 2 if self.together or self.pressed > 1 else 1

    def shape(self, name: str) -> tuple[int, ...]:
        """Shape of an array that ``setup`` fills; a row of M, C and J has the coordinates of one
        component. Behind these, J has for contacts that may depend on each other the axis of what
        is in a plane, and the square of a size of the force; last, coefficients of friction."""
        s = self.sizes
        widest = {
            matrix: max((len(part.coordinates) for part in self.coupled[matrix]), default=0)
            for matrix in INVERSES
        }
        shapes = {
            "K": (max(len(self.constants), 1),),
            "M": (s["nq"], widest["Rq"]),
            "C": (s["nz"], widest["Rz"]),
            "J": (s["mq"] + s["mz"], max(widest.values()) + self.columns_behind),
            "omega": (self.frequencies,),
        }
        return shapes[name]


@dataclass
class Generated:
    """What a system's functions compute.

    Attributes
    ----------
    layout : Layout
        With the tape, of which ``jets`` makes series.
    constants : ParameterExpressions
    setup, sizes, residual, powers, landings, supports : list of Store
        Statements of the functions; `sizes`, of ``jets``, fill ``mag`` from order 0.
    """

    layout: Layout
    constants: ParameterExpressions
    setup: list[Store]
    sizes: list[Store]
    residual: list[Store]
    powers: list[Store]
    landings: list[Store]
    supports: list[Store]


def generate(equations: MotionEquations) -> Generated:
    """Lay out the functions of a system."""
    return _Generator(equations).generated()


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
        pressed = [len(equations.pressing(i)) for i in range(self.mq)]
        self.layout = Layout(d.state, sizes, pressed=max([1, *pressed]))
        rows = {name: i for i, name in enumerate(d.state)} | {"t": self.n}
        regions = {guard: i for i, guard in enumerate(equations.kinks)}
        self.tape = Tape(self.constants, rows, self.n + 1, regions)
        self.solves: dict[int, list[Instruction]] = {0: [], 1: [], 2: []}
        self.magnitudes: list[Store] = []
        self.gap_sizes = 3 * (self.mq + self.mz + self.mr) + len(equations.kinks)
        opens = any(c.opens for c in equations.contacts)
        self.plane_sizes = self.gap_sizes + (self.mq if opens else 0)
        self.rate_sizes = self.plane_sizes + len(equations.planes)
        self.directions: dict[int, int] = {}
        self.scratch = self.rate_sizes + self.nq + self.nz + self.nr + self.na
        self.nc = self.mq + self.mz + self.mr

    # -- the blocks --------------------------------------------------------------------------------

    def velocity(self, i: int) -> list[Scaled]:
        """Row of the relative velocity of contact i, and its size for rounding; returns its
        terms."""
        c = self.eq.contacts[i]
        tape = self.tape
        parts = [
            Scaled(j, tape.names[f"d_{x}"])
            if self.constants.is_constant(j)
            else tape.lower(j * ex.sym(f"d_{x}"))
            for x, j in c.direction.items()
        ]
        belt = tape.lower(c.speed)
        parts.append(Scaled(-belt.factor, belt.row))
        self.layout.u.append(tape.assign(parts, None))
        tape.name(f"u:{i}", self.layout.u[i], tape.stage[self.layout.u[i]])
        self.note(i, self.size_of(parts))
        return parts

    def note(self, place: int, size: Scalar, adding: bool = False) -> None:
        """A statement that stores a size."""
        self.magnitudes.append(Store("mag", (place,), size, adding))

    def size_of(self, parts: list[Scaled]) -> Scalar:
        """Sum of the moduli of terms."""
        factors = [(self.constants.scalar(p.factor), p) for p in parts]
        return added(abs(c if p.row is None else _times(c, _start(p.row))) for c, p in factors)

    def size(self, e: Expr) -> Scalar:
        """The sum of the moduli of the terms of an expression: the scale of its rounding error."""
        if e.op == "sum":
            parts = [_times(numeral(abs(c)), self.size(term)) for term, c in e.terms]
            return added([*parts, *([numeral(abs(float(e.value)))] if e.value else [])])
        if e.op == "prod" and any(base.op == "sum" and p == 1.0 for base, p in e.terms):
            return Scalar("product", tuple(self.factor_size(base, p) for base, p in e.terms))
        return self.size_of([self.tape.lower(e)])

    def factor_size(self, base: Expr, p: float) -> Scalar:
        """The size of a factor; a difference in brackets is as large as its terms."""
        if base.op == "sum" and p == 1.0 and not self.constants.is_constant(base):
            return self.size(base)
        size = self.size_of([self.tape.lower(base)])
        return size if p == 1.0 else Scalar("real_power", (size, numeral(p)))

    def block(
        self, forces: list[Expr], first: int, count: int, stage: int, resolvent: str
    ) -> list[int]:
        """Solve one of the linear problems [x; λ] = R [f; g] order by order, component by
        component; returns the rows of x."""
        tape = self.tape
        inertial = resolvent == "Rq"
        names, matrix = (
            (self.d.inertial, self.eq.mass) if inertial else (self.d.damped, self.eq.damping)
        )
        place = {x: i for i, x in enumerate(names)}
        directions = [c.direction for c in self.eq.contacts[first : first + count]]
        coupled = [
            part._replace(moving=self.moves(part, matrix))
            for part in components(
                len(names),
                matrix,
                first,
                [[place[x] for x in direction] for direction in directions],
                [(c, n) for c in range(first, first + count) for n in self.eq.pressing(c)],
            )
            if part.coordinates
        ]
        self.layout.coupled[resolvent] = coupled
        if inertial:
            self.layout.together = self.eq.sharing
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
        base = self.scratch
        self.scratch += n
        for j, f in enumerate(forces):
            tape.into(f, right + seats[j])
            self.note(base + seats[j], self.size(f))
        for c, seat in sorted(contacts.items()):
            self.contact_side(c, right + seat, stage)
            self.note(base + seat, abs(_start(right + seat)))
            tape.name(f"lambda:{c}", solution + seat, stage + 1)
        at = 0
        for part in coupled:
            size = len(part.coordinates) + len(part.contacts)
            solve = Instruction(
                Op.SOLVE, solution + at, (right + at,), place=at, size=size, matrix=resolvent
            )
            if part.moving:
                entries = self.moving_entries(part, names, matrix)
                known = len(part.coordinates)
                shared = inertial and any(c in self.layout.together for c in part.contacts)
                solve = replace(solve, op=Op.RATES, entries=entries, definite=known, shared=shared)
            self.solves[stage].append(solve)
            for c in part.contacts:
                where = (contacts[c], size, base + at)
                self.note(2 * self.nc + c, Scalar("spread", name=resolvent, index=where))
            at += size
        self.block_sizes(
            inertial, matrix, directions, first, [base + seats[j] for j in place.values()]
        )
        return [solution + seats[j] for j in range(len(forces))]

    def moves(self, part: Component, matrix: Mapping[tuple[int, int], Expr]) -> bool:
        """Whether the matrix of a component changes on the way."""
        if not all(self.rubs_evenly(c) for c in part.contacts):
            return True
        own = frozenset(part.coordinates)
        entries = [e for (i, _), e in matrix.items() if i in own]
        entries += [e for c in part.contacts for e in self.eq.contacts[c].direction.values()]
        return not all(map(self.constants.is_constant, entries))

    def rubs_evenly(self, i: int) -> bool:
        """Whether the friction of a contact under each normal force has one constant
        coefficient."""
        found = [set(self.pressed_slopes(i, normal)) for normal in self.eq.pressing(i)]
        return all(len(own) == 1 and self.constants.is_constant(*own) for own in found)

    def pressed_slopes(self, i: int, normal: int) -> list[Expr]:
        """What a unit of a normal force adds to the friction of a contact, and to its threshold,
        either way."""
        return [ex.derivative(side, f"lambda:{normal}") for side in self.friction(i)]

    def moving_entries(
        self, part: Component, names: list[str], matrix: Mapping[tuple[int, int], Expr]
    ) -> tuple[Instruction, ...]:
        """The matrix [[M, −Jᵀ], [stick: J, 0; slip: 0, 1]] of a component, row by row."""
        zero = self.tape.row(ex.ZERO)
        found = list[Instruction]()
        n = len(part.coordinates)
        for i in part.coordinates:
            found += [self.moving_entry(matrix.get((i, j), ex.ZERO)) for j in part.coordinates]
            for c in part.contacts:
                weight = self.eq.contacts[c].direction.get(names[i], ex.ZERO)
                found.append(self.moving_entry(-weight))
        for c in part.contacts:
            for place, i in enumerate(part.coordinates):
                weight = self.eq.contacts[c].direction.get(names[i], ex.ZERO)
                if self.constants.is_constant(weight):
                    found.append(self.fixed_entry(c, weight, ex.ZERO))
                    continue
                row = self.tape.row(weight)
                self.layout.turning[c, place] = row
                sides = (row, zero, zero, zero, zero)
                entry = Instruction(Op.SIDE, self.tape.new_row(0), sides, place=c)
                self.tape.emit(0, entry)
                found.append(entry)
            pressing = frozenset(self.eq.pressing(c))
            for other in part.contacts:
                if other in pressing:
                    found.append(self.pressed_entry(c, other))
                elif c == other:
                    stick = -self.eq.strength(c) if c in self.layout.together else ex.ZERO
                    found.append(self.fixed_entry(c, stick, ex.ONE))
                else:
                    found.append(self.fixed_entry(c, ex.ZERO, ex.ZERO))
        assert len(found) == (n + len(part.contacts)) ** 2
        return tuple(found)

    def plane_with(self, i: int) -> Plane:
        """The contact in a plane that has a contact as a component."""
        return next(p for p in self.eq.planes if i in p.parts)

    def pressed_entry(self, i: int, normal: int) -> Instruction:
        """What a unit of a normal force adds to λᵢ + σk = 0 in slip."""
        zero = self.tape.row(ex.ZERO)
        slopes = tuple(self.tape.row(-slope) for slope in self.pressed_slopes(i, normal))
        entry = Instruction(Op.SIDE, self.tape.new_row(0), (zero, *slopes), place=i)
        self.tape.emit(max(self.tape.stage[row] for row in slopes), entry)
        return entry

    def moving_entry(self, e: Expr) -> Instruction:
        """An entry that is the same in all modes."""
        if self.constants.is_constant(e):
            return self.fixed_entry(0, e, e)
        row = self.tape.row(e)
        return Instruction(Op.LINEAR, row, (row,))

    def fixed_entry(self, contact: int, stick: Expr, slip: Expr) -> Instruction:
        """A constant entry, by the mode of a contact."""
        zero = Scaled(ex.ZERO)
        for e in (stick, slip):
            self.constants.scalar(e)  # has a place
        return Instruction(
            Op.ENTRY, -1, parts=(Scaled(stick), Scaled(slip), zero, zero), place=contact
        )

    def block_sizes(
        self,
        inertial: bool,
        matrix: Mapping[tuple[int, int], Expr],
        directions: Sequence[Mapping[str, Expr]],
        first: int,
        forces: list[int],
    ) -> None:
        """Scales of the rates and of the relative velocities: what they would be if no two forces
        cancelled; `forces` are the places of their sizes."""
        scalar = self.number
        names = self.d.inertial if inertial else self.d.damped
        offset = self.rate_sizes + (0 if inertial else self.nq)
        terms = {x: [element("mag", place)] for x, place in zip(names, forces, strict=True)}
        places = {x: element("mag", offset + i) for i, x in enumerate(names)}
        for c, direction in enumerate(directions, first):
            for x, weight in direction.items():
                force = _start(self.tape.names[f"lambda:{c}"])
                terms[x].append(abs(_times(scalar(weight), force)))
                if self.eq.contacts[c].plane:
                    # its direction may turn
                    most = _start(self.tape.row(self.eq.contacts[c].plus))
                    terms[x].append(abs(_times(scalar(weight), most)))
        for i, x in enumerate(names):
            self.note(offset + i, added(terms[x]) / abs(scalar(matrix[i, i])))
        for c, direction in enumerate(directions, first):
            size = added(_times(abs(scalar(w)), places[x]) for x, w in direction.items())
            if inertial:
                self.note(self.nc + c, size)
            elif direction:
                self.note(c, size, adding=True)

    def number(self, e: Expr) -> Scalar:
        """A constant, or the value of a row."""
        constant = self.constants.is_constant(e)
        return self.constants.scalar(e) if constant else _start(self.tape.row(e))

    def implicit_rates(self) -> dict[str, int]:
        """Rows of the rates that solve equations of their own; the slopes of these rows are still
        to come."""
        tape = self.tape
        found: dict[str, int] = {}
        for z, function in self.eq.implicit.items():
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
            names = {name: _start(r) for name, r in tape.names.items()}
            values = scalars_of([function, slope], names, self.tape.regions, self.constants)
            zero = values[function], values[slope]
            read = sorted({r for s in zero for r in _rows_of(s)} - {row})
            own[start - 1] = Instruction(Op.IMPLICIT, row, (row, *read), zero=zero)
            size = self.size(self.d.resistance(z)) + self.size(self.force_on(z))
            place = self.rate_sizes + self.nq + self.d.viscous.index(z)
            self.note(place, Scalar("over", (size, _start(rows[1]))))
        return found

    def force_on(self, z: str) -> Expr:
        """The force on a viscous coordinate."""
        return self.eq.viscous_force[self.d.viscous.index(z)]

    def implicit_slopes(self, found: Mapping[str, int]) -> None:
        """Rates of change of these rates, from the equations' own along the motion."""
        tape = self.tape
        d = self.d
        rates = {"t": ex.ONE}
        rates |= {x: ex.sym(f"d_{x}") for x in d.coordinates}
        rates |= {f"d_{q}": ex.sym(f"a:{q}") for q in d.inertial}
        rates |= {a: d.laws[a] for a in d.internal}
        for z in found:
            function = self.eq.implicit[z]
            change = ex.along(function, rates) / ex.derivative(function, f"d_{z}")
            slope = tape.row(-change)
            place = next(j for j, made in enumerate(tape.instructions[1]) if made.row == found[z])
            own = tape.instructions[1][place]
            tape.instructions[1][place] = replace(own, inputs=(slope, *own.inputs[1:]))

    def contact_side(self, i: int, row: int, stage: int) -> None:
        """Right-hand side of contact i: the belt in stick, the friction force in slip."""
        c = self.eq.contacts[i]
        tape = self.tape
        belt = c.speed if c.kind == Kind.VISCOUS else self.eq.surface_acceleration(i)
        pressed = {f"lambda:{n}": ex.ZERO for n in self.eq.pressing(i)}
        alone = [ex.substitute(force, pressed) for force in self.friction(i)]
        sides = tuple(tape.row(e) for e in (belt, *alone))
        tape.emit(stage, Instruction(Op.SIDE, row, sides, place=i))
        tape.stage[row] = stage

    def friction(self, i: int) -> tuple[Expr, Expr, Expr, Expr]:
        """Friction of contact i against slip forward and back, and where its threshold is to be
        broken; in a plane that of a component, along the direction of its slip."""
        c = self.eq.contacts[i]
        if c.opens:
            # what is open, or carried, does not press
            return ex.ZERO, ex.ZERO, ex.ZERO, ex.ZERO
        if not c.plane:
            return c.kinetic_plus, c.kinetic_minus, c.plus, c.minus
        plane = next(p for p in self.eq.planes if i in p.parts)
        drops = plane.kinetic is not plane.static and not plane.pull
        static = plane.static * plane.slope[plane.parts.index(i)] if drops else c.kinetic_plus
        return c.kinetic_plus, c.kinetic_plus, static, static

    def ahead(self, plane: Plane) -> list[int]:
        """Rows of Au of a contact in a plane."""
        rows = [self.layout.u[i] for i in plane.parts]
        return [
            row if axis is ex.ONE else self.tape.assign([Scaled(axis, row)], None)
            for row, axis in zip(rows, plane.axes, strict=True)
        ]

    def direction(self, p: int, sides: Sequence[int], terms: list[Scaled]) -> None:
        """Rows of the direction of a slip in a plane, and of the modulus of what it is the
        direction of.

        Parameters
        ----------
        p : int
            Number of the plane.
        sides : sequence of int
            Rows of that vector.
        terms : list of Scaled
            What these are sums of.
        """
        tape = self.tape
        plane = self.eq.planes[p]
        inputs = (*sides, tape.size(terms))
        stage = max(tape.stage[row] for row in inputs)
        count = len(plane.parts)
        first, *_, speed = (tape.new_row(stage) for _ in range(count + 1))
        pressing = self.eq.pressing(plane.parts[0])
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
        self.directions[p] = first

    def aimed(self, parts: Sequence[list[Scaled]], kind: Kind) -> None:
        """Directions of contacts in a plane that slip along Au.

        Parameters
        ----------
        parts : sequence of list of Scaled
            Terms of the velocities of contacts.
        kind : Kind
        """
        for p, plane in enumerate(self.eq.planes):
            if not plane.pull and self.eq.contacts[plane.parts[0]].kind == kind:
                terms = [
                    Scaled(axis * part.factor, part.row)
                    for i, axis in zip(plane.parts, plane.axes, strict=True)
                    for part in parts[i]
                ]
                self.direction(p, self.ahead(plane), terms)

    def pulled(self, kind: Kind) -> None:
        """Directions of contacts in a plane of coordinates without mass."""
        for p, plane in enumerate(self.eq.planes):
            if plane.pull and self.eq.contacts[plane.parts[0]].kind == kind:
                sides = [self.tape.row(e) for e in plane.pull]
                self.direction(p, sides, [Scaled(ex.ONE, row) for row in sides])

    def speeds(self) -> None:
        """Rows of |u| in the kinetic laws of inertial contacts."""
        for i in range(self.mq):
            self.speed(i)

    def speed(self, i: int) -> None:
        """Row of |u| of contact i, if it is along a line."""
        if not self.eq.contacts[i].plane:
            row = self.tape.new_row(0)
            self.tape.emit(0, Instruction(Op.SPEED, row, (self.layout.u[i],), place=i))
            self.tape.name(f"speed:{i}", row, 0)

    def prescribed(self) -> None:
        """Rows of the forces between motions that are given: nothing in stick, in slip what normal
        forces, which are known by then, allow. Their velocities are known to the rounding of what
        they do in a time."""
        zero = self.tape.row(ex.ZERO)
        for i, c in enumerate(self.eq.contacts):
            if c.prescribed:
                sides = (zero, *map(self.tape.row, self.friction(i)))
                stage = max(self.tape.stage[row] for row in sides)
                row = self.tape.new_row(stage)
                self.tape.emit(stage, Instruction(Op.SIDE, row, sides, place=i))
                self.tape.name(f"lambda:{i}", row, stage)
                self.note(2 * self.nc + i, numeral(0.0))
                self.note(self.nc + i, self.size(self.eq.surface_acceleration(i)))

    def adhesion(self) -> None:
        """Rows of what presses contacts together that adhere, while they are closed, or carried by
        others that are."""
        zero = self.tape.row(ex.ZERO)
        for i, c in enumerate(self.eq.contacts):
            if c.opens and c.plus is not ex.ZERO:
                sides = (self.tape.row(c.plus), zero, zero, self.tape.row(-c.plus), zero)
                row = self.tape.new_row(0)
                self.tape.emit(0, Instruction(Op.SIDE, row, sides, place=i))
                self.tape.name(f"glue:{i}", row, 0)

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
            plane = self.plane_of(i)
            if plane is not None:
                speeds = [self.eq.contacts[part].speed for part in plane.parts]
                rest = rate.sliding_rest(plane, i, speeds, self.mq + self.mz)
                sides = (self.eq.contacts[c].speed, rest, ex.ZERO, ex.ZERO)
            rows = tuple(tape.row(e) for e in sides)
            self.solves[1].append(Instruction(Op.RIGHT, right + i, rows, place=c))
            # A contact that slides states a rate of its force; one that sticks a velocity, as large
            # as if it slid.
            plus, minus = (
                self.size(rate.rest[i]) + self.size(side[i]) for side in rate.threshold_rest
            )
            weight = abs(self.constants.scalar(rate.weight[i]))
            over = Scalar("over", (plus, self.size(rate.stiffness[i][i])))
            free = _times(weight, over) + abs(_start(rows[0]))
            self.note(base + i, by_mode(c, free, plus, minus))
        self.solves[1].append(
            Instruction(Op.RATES, first, (right,), size=n, matrix="B", entries=tuple(entries))
        )
        for i in range(n):
            c = self.mq + self.mz + i
            place = self.rate_sizes + self.nq + self.nz + i
            self.note(place, Scalar("spread", name="B", index=(i, n, base)))
            weight = abs(self.constants.scalar(rate.weight[i]))
            self.note(c, _times(weight, element("mag", place)), adding=True)
            self.note(2 * self.nc + c, self.size(rate.force[i]))
        return first

    def plane_of(self, i: int) -> Plane | None:
        """The contact in a plane that rate-independent coordinate i belongs to."""
        contact = self.mq + self.mz + i
        return next((p for p in self.eq.planes if contact in p.parts), None)

    def entry(self, i: int, j: int) -> Instruction:
        """An entry of the matrix of that problem."""
        rate = self.eq.rate
        plane = self.plane_of(i)
        if plane is not None:
            own = Scaled(rate.weight[i] if i == j else ex.ZERO)
            zero = self.tape.row(ex.ZERO)
            rows = (self.tape.row(rate.sliding(plane, i, j, self.mq + self.mz)), zero, zero)
            place = self.mq + self.mz + i
            return Instruction(Op.ENTRY, self.tape.new_row(1), rows, (own,), place=place)
        contact = self.mq + self.mz + i
        own = Scaled(rate.weight[i] if i == j else ex.ZERO)
        others = rate.stiffness[i][j], rate.threshold_slope[0][i][j], rate.threshold_slope[1][i][j]
        if all(map(self.constants.is_constant, others)):
            return Instruction(Op.ENTRY, -1, parts=(own, *map(Scaled, others)), place=contact)
        rows = tuple(self.tape.row(e) for e in others)
        return Instruction(Op.ENTRY, self.tape.new_row(1), rows, (own,), place=contact)

    def kinetic_laws(self) -> None:
        """Rows that say whether sliding forces are admissible, 0 ≤ k and k ≤ s at speed 0."""
        for plane in self.eq.planes:
            i = plane.parts[0]
            if plane.kinetic is not plane.static:
                own = {f"speed:{i}": ex.ZERO}
                at_rest = ex.substitute(plane.kinetic, own, undefined=True)
                rows = self.tape.row(plane.kinetic), self.tape.row(plane.static - at_rest)
                self.layout.kinetic.append((i, 1, *rows))
        for i, c in enumerate(self.eq.contacts):
            if c.plane:
                continue
            for side, force, static in (
                (1, c.kinetic_plus, c.plus),
                (-1, c.kinetic_minus, c.minus),
            ):
                if force is not static:
                    at_rest = ex.substitute(force, {f"speed:{i}": ex.ZERO}, undefined=True)
                    self.layout.kinetic.append(
                        (i, side, self.tape.row(force), self.tape.row(static - at_rest))
                    )

    # -- the functions -----------------------------------------------------------------------------

    def generated(self) -> Generated:
        """Lay the equations out, and state what the functions compute."""
        self.lay_out()
        residual, powers, landings = self.residual(), self.powers(), self.landings()
        supports = self.supports()
        setup = self.setup()
        self.finish()
        layout = self.layout
        guards = [*layout.u, *layout.force, *layout.plus, *layout.minus, *layout.kinks]
        guards += [row for *_, force, margin in layout.kinetic for row in (force, margin)]
        guards += layout.gaps.values()
        for _, _, _, first, speed, *rows, _, static, slips, _, _, _, _ in layout.planes:
            guards += [*range(first, speed + 1), *rows, static, slips]
        guards = [row for row in guards if row >= 0]
        guards += [row for _, _, row in layout.pieces]
        layout.kept = sorted({*range(self.n), *guards})
        needed = _closure(layout.instructions, {*layout.kept, *layout.rates})
        tape, layout.instructions = layout.instructions, []
        for i in tape:
            (layout.instructions if needed & {*rows_made(i)} else layout.shown).append(i)
        sizes = self.magnitudes
        return Generated(layout, self.constants, setup, sizes, residual, powers, landings, supports)

    def lay_out(self) -> None:
        """Rows of everything, in the order in which it can be computed: velocities, rates, laws of
        internal variables, accelerations, thresholds and guards."""
        tape = self.tape
        d = self.d
        eq = self.eq
        parts = [self.velocity(i) for i in range(self.mq)]
        self.speeds()
        self.adhesion()
        self.aimed(parts, Kind.INERTIAL)
        self.pulled(Kind.VISCOUS)
        viscous = self.block(eq.viscous_force[: len(d.damped)], self.mq, self.mz, 0, "Rz")
        for z, row in zip(d.damped, viscous, strict=True):
            tape.name(f"d_{z}", row, 1)
        implicit = self.implicit_rates()
        viscous += implicit.values()
        parts += [self.velocity(i) for i in range(self.mq, self.mq + self.mz)]
        for i, c in enumerate(eq.contacts):
            if c.prescribed:
                self.speed(i)
        self.aimed(parts, Kind.VISCOUS)
        if self.nr:
            self.pulled(Kind.RATE_INDEPENDENT)
            first = self.rates()
            for i, r in enumerate(d.rate_independent):
                tape.name(f"d_{r}", first + i, 2)
            for i in range(self.nr):
                c = self.mq + self.mz + i
                self.velocity(c)
                tape.name(f"lambda:{c}", tape.row(eq.rate.force[i]), 0)
        # The velocities' own magnitudes are written first, so that the linear problems may add to
        # them.
        self.magnitudes.sort(key=lambda store: store.adding)
        laws = [tape.row(law) for law in eq.laws]
        for name, row in zip(d.internal, laws, strict=True):
            tape.name(f"d_{name}", row, tape.stage[row]) if f"d_{name}" not in d.state else None
        inertial = self.block(eq.inertial_force, 0, self.mq, 2, "Rq")
        for q, row in zip(d.inertial, inertial, strict=True):
            tape.name(f"a:{q}", row, 3)
        self.implicit_slopes(implicit)
        self.law_sizes()
        self.kinetic_laws()
        self.prescribed()
        self.guards()
        layout = self.layout
        layout.jumps = [
            (jump.kink, jump.direction, [d.places[x] for x in jump.values]) for jump in eq.jumps
        ]
        layout.named = {f"d_{x}": tape.names[f"d_{x}"] for x in d.coordinates}
        layout.named |= {f"d_{a}": row for a, row in zip(d.internal, laws, strict=True)}
        layout.named |= {f"dd_{q}": row for q, row in zip(d.inertial, inertial, strict=True)}
        layout.rates = [*range(self.nq, 2 * self.nq), *inertial, *viscous]
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
            sides = abs(_start(plus)) + abs(_start(minus))
            self.note(2 * self.nc + i, sides, adding=True)
        turning = {guard: (plane, same) for plane in self.eq.planes for guard, same in plane.pieces}
        for j, guard in enumerate(self.eq.kinks):
            if guard in turning:
                # Of any degree in u, it vanishes as u does where a slip ends. It is known on both
                # sides, which R need not be.
                plane, same = turning[guard]
                layout.kinks.append(tape.row(ex.sym(f"length:{plane.parts[0]}") * same))
                self.note(3 * self.nc + j, added(element("mag", i) for i in plane.parts))
                continue
            if self.constants.is_constant(guard):  # of which only the sign matters, however large
                guard = ex.select(guard, ex.ONE, -ex.ONE)
            layout.kinks.append(tape.row(guard))
            self.note(3 * self.nc + j, self.size(guard))
        for p, plane in enumerate(self.eq.planes):
            first = self.directions[p]
            sides = self.ahead(plane)
            forces = [ex.sym(f"lambda:{part}") for part in plane.parts]
            holds = plane.admissible(forces)
            place = self.plane_sizes + p
            given = self.eq.contacts[plane.parts[0]].prescribed
            pairs = [*zip(plane.parts, plane.axes, strict=True)]
            if given:
                holds = ex.add(*(((axis * ex.sym(f"u:{i}")) ** 2, -1.0) for i, axis in pairs))
            row = tape.row(holds)
            along = [
                (axis * ex.sym(f"n:{i}") * ex.sym(f"u:{i}"), 1.0)
                for i, axis in zip(plane.parts, plane.axes, strict=True)
            ]
            count = len(plane.parts)
            slips = tape.row(ex.add(*along)) if plane.pull else first + count
            massive = int(not (plane.pull or given))
            number = -1 if plane.formula is None else self.formulas.index(plane.formula)
            third = (-1,) * (3 - count)
            held = frozenset(self.d.parameters)
            own = [self.eq.contacts[part] for part in plane.parts]
            fixed = [e for c in own for e in (c.speed, *c.direction.values())]
            even = plane.formula is not None or all(axis is ex.ONE for axis in plane.axes)
            straight = massive and even
            straight = int(straight and all(e.symbols <= held for e in fixed))
            ends = (tape.row(plane.static), slips, massive, int(plane.bends), number, straight)
            where = (*plane.parts, *third, first, first + count, *sides, *third, row, place)
            layout.planes.append((*where, *ends))
            layout.pieces += [
                (self.eq.kinks.index(guard), p, tape.row(same)) for guard, same in plane.pieces
            ]
            # rounding errors of the forces, as they enter their squares
            parts = [self.size(plane.static**2)]
            if given:
                own = [_times(self.constants.scalar(a), element("mag", i)) for i, a in pairs]
                parts = [_times(size, size) for size in own]
            for i, axis in () if given else pairs:
                over = _times(self.constants.scalar(2.0 / axis**2), abs(_start(layout.force[i])))
                parts.append(_times(over, element("mag", 2 * self.nc + i)))
            self.note(place, added(parts))
        for i, own in enumerate(self.eq.members):
            for c in own if len(own) > 1 else ():
                sides = tape.row(c.plus), tape.row(c.minus)
                # of floors the gap
                u = tape.row(c.ratio * ex.sym(f"u:{i}") if c.gap is None else c.gap)
                layout.parts[c.name] = (self.part(i, c), *sides, u)
        facing: dict[str, list[tuple[Expr, float]]] = {}
        for i, c in enumerate(self.eq.contacts):
            if c.side_of:
                facing.setdefault(c.side_of, []).append((ex.sym(f"lambda:{i}"), 1.0))
            if c.opens and c.plus is not ex.ZERO:
                pulled = (ex.sym(f"lambda:{i}"), 1.0), (ex.sym(f"glue:{i}"), -1.0)
                facing[c.name.removeprefix(NORMAL)] = [*pulled]
        layout.carrying = {name: tape.row(ex.add(*forces)) for name, forces in facing.items()}
        for i, c in enumerate(self.eq.contacts):
            if c.gap is not None:
                layout.gaps[i] = tape.row(c.gap)
                self.note(self.gap_sizes + i, self.size(c.gap))
            for normal in self.eq.pressing(i):
                layout.links.append((i, normal, self.coefficients(i, normal)))
            if c.gap is not None or c.on:
                layout.restitution[i] = tape.row(c.restitution)

    def part(self, i: int, c: DryContact) -> int:
        """Row of the force of one of the members of a contact."""
        sides = tuple(map(self.tape.row, self.eq.part(i, c)))
        stage = max(self.tape.stage[row] for row in sides)
        row = self.tape.new_row(stage)
        self.tape.emit(stage, Instruction(Op.SIDE, row, sides, place=i))
        return row

    def coefficients(self, i: int, normal: int) -> tuple[int, ...]:
        """Rows of the coefficients of friction of contact i under a normal force."""
        c = self.eq.contacts[i]
        sides = c.kinetic_plus, c.kinetic_minus, c.plus, c.minus
        if c.plane:
            plane = self.plane_with(i)
            sides = (*(plane.kinetic * c.axis,) * 2, *(plane.static * c.axis,) * 2)
        return tuple(self.tape.row(ex.derivative(side, f"lambda:{normal}")) for side in sides)

    def finish(self) -> None:
        """How large everything has become."""
        layout = self.layout
        first = np.arange(self.rate_sizes, self.scratch)[: self.nq + self.nz + self.nr + self.na]
        layout.rate_sizes = np.concatenate([np.full(self.nq, -1), first]).astype(np.int64)
        layout.rows = self.tape.rows
        layout.magnitudes = self.scratch
        layout.frequencies = len(self.eq.frequencies)
        layout.timed = self.eq.timed
        layout.prescribed = any(c.prescribed for c in self.eq.contacts)
        layout.constants = self.constants.slots
        layout.formulas = len(self.formulas)

    def setup(self) -> list[Store]:
        d = self.d
        scalar = self.constants.scalar
        own: dict[str, int] = {}
        entries = list[Store]()
        for name, resolvent, names, matrix in (
            ("M", "Rq", d.inertial, self.eq.mass),
            ("C", "Rz", d.damped, self.eq.damping),
        ):
            column = {
                i: j
                for part in self.layout.coupled[resolvent]
                for j, i in enumerate(part.coordinates)
            }
            own |= {x: column[i] for i, x in enumerate(names)}
            entries += [
                Store(name, (i, column[j]), scalar(e))
                for (i, j), e in matrix.items()
                if self.constants.is_constant(e)
            ]
        entries += [
            Store("J", (i, own[x]), scalar(e))
            for i, c in enumerate(self.eq.contacts[: self.mq + self.mz])
            for x, e in c.direction.items()
            if self.constants.is_constant(e)
        ]
        last = self.layout.shape("J")[1] - 1
        entries += [
            Store("J", (i, last - k - (2 if k else 0)), scalar(self.pressed_slopes(i, normal)[0]))
            for i in range(self.mq)
            if self.rubs_evenly(i)
            for k, normal in enumerate(self.eq.pressing(i))
        ]
        for i in self.layout.together:
            axis = self.eq.contacts[i].axis if self.eq.contacts[i].plane else ex.ONE
            entries.append(Store("J", (i, last - 2), scalar(axis)))
            entries.append(Store("J", (i, last - 1), scalar(self.eq.strength(i))))
        frequencies = enumerate(self.eq.frequencies)
        entries += [Store("omega", (i,), abs(scalar(e))) for i, e in frequencies]
        return [*self.constants.stores(), *entries]

    def law_sizes(self) -> None:
        """Scales of the rates of the internal variables."""
        for i, law in enumerate(self.eq.laws):
            self.note(self.rate_sizes + self.nq + self.nz + self.nr + i, self.size(law))

    def residual(self) -> list[Store]:
        rate = self.eq.rate
        names = {s: element("y", i) for i, s in enumerate(self.d.state)} | {"t": _TIME}
        acting = self.eq.contacts[self.mq + self.mz :]
        targets = [*rate.force, *(c.plus for c in acting), *(c.minus for c in acting)]
        targets += [term for force in rate.force for term, _ in terms(force)]
        targets += [e for m in (rate.partial, *rate.threshold_partial) for row in m for e in row]
        back = {p.parts[0]: self.back(p) for p in self.eq.planes if self.plane_rates(p)}
        targets += [e for off, rows in back.values() for e in (off, *rows[0], *rows[1])]
        v = scalars_of(targets, names, self.tape.regions, self.constants)
        stores = list[Store]()
        for i, c in enumerate(acting):
            contact = self.mq + self.mz + i
            plus, minus = v[c.plus], v[c.minus]
            # The largest force so far: what a residual is small against also where the force passes
            # through zero.
            parts = [abs(numeral(e) * v[term]) for term, e in terms(rate.force[i])]
            scale = added([*parts, Scalar("larger", (abs(plus), abs(minus)))])
            largest = Scalar("larger", (element("G", self.nr + i), scale))
            stores.append(Store("G", (self.nr + i,), largest))
            force = v[rate.force[i]]
            away = by_mode(contact, numeral(0.0), force + plus, force + -minus)
            if (plane := self.plane_of(i)) is not None:
                off, rows = back[plane.parts[0]]
                first = contact == plane.parts[0]
                held = v[off] if first else numeral(0.0)
                stores.append(Store("G", (i,), by_mode(contact, numeral(0.0), held, held)))
                for j in range(self.nr):
                    own = numeral(1.0 if i == j else 0.0)
                    moved = v[rows[0 if first else 1][j]]
                    stores.append(Store("P", (i, j), by_mode(contact, own, moved, moved)))
                continue
            stores.append(Store("G", (i,), away))
            for j in range(self.nr):
                h, p, q = (v[x[i][j]] for x in (rate.partial, *rate.threshold_partial))
                own = numeral(1.0 if i == j else 0.0)
                stores.append(Store("P", (i, j), by_mode(contact, own, h + p, h + -q)))
        return stores

    def plane_rates(self, plane: Plane) -> bool:
        """Whether a contact in a plane is one of rate-independent coordinates."""
        return self.eq.contacts[plane.parts[0]].kind == Kind.RATE_INDEPENDENT

    def back(self, plane: Plane) -> tuple[Expr, tuple[list[Expr], list[Expr]]]:
        """How far the force of a slip in a plane is from its threshold, s − |A⁻¹λ|, and the two
        rows of a Newton step that puts it back, along the direction of the slip."""
        rate = self.eq.rate
        first = self.mq + self.mz
        size = ex.power(ex.add(*((e**2, 1.0) for e in plane.pull)), ex.num(0.5))
        aim = {f"n:{i}": e / size for i, e in zip(plane.parts, plane.pull, strict=True)}
        along = list[Expr]()
        for j in range(self.nr):
            terms = [
                (ex.sym(f"n:{i}") / axis * rate.partial[i - first][j], 1.0)
                for i, axis in zip(plane.parts, plane.axes, strict=True)
            ]
            slope = rate.threshold_partial[0][plane.parts[0] - first][j]
            terms.append((slope / plane.axes[0], 1.0))
            along.append(ex.substitute(ex.add(*terms), aim))
        across = [
            ex.substitute(rate.sliding(plane, plane.parts[1] - first, j, first), aim)
            for j in range(self.nr)
        ]
        return plane.static - size, (along, across)

    def powers(self) -> list[Store]:
        return self.listed([self.eq.energy, self.eq.dissipation, self.eq.supply])

    @cached_property
    def formulas(self) -> list[ConvexFormula]:
        """Dissipations that are formulas, each once."""
        found = [plane.formula for plane in self.eq.planes if plane.formula is not None]
        return list({id(formula): formula for formula in found}.values())

    def supports(self) -> list[Store]:
        """Of the forces −∂R(0) of each formula beside a middle of them: the support function S(w) =
        R(−w) − w·middle with its first and second derivatives, and that middle, an average of the
        forces against slips along both axes."""
        stores = list[Store]()
        w = [ex.sym(f"w{i}") for i in (1, 2, 3)]
        names = {str(x.value): element("w", i) for i, x in enumerate(w)}
        for f, formula in enumerate(self.formulas):
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
            v = scalars_of(targets, names, constants=self.constants)
            stores += [Store("out", (len(targets) * f + k,), v[e]) for k, e in enumerate(targets)]
        return stores

    def landings(self) -> list[Store]:
        return self.listed([e for jump in self.eq.jumps for e in jump.values.values()])

    def listed(self, targets: list[Expr]) -> list[Store]:
        """Values at order 0, one after the other."""
        names = {s: _start(row) for s, row in self.tape.names.items()}
        v = scalars_of(targets, names, self.tape.regions, self.constants)
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


_TIME = Scalar("name", name="t")


def _start(row: int) -> Scalar:
    """Order 0 of a row."""
    return element("W", row, 0)


def _rows_of(value: Scalar) -> set[int]:
    """Rows that a value is made of."""
    found: dict[Scalar, set[int]] = {}

    def visit(s: Scalar) -> set[int]:
        if s not in found:
            here = {s.index[0]} if s.op == "entry" and s.name == "W" else set[int]()
            found[s] = here.union(*map(visit, s.args))
        return found[s]

    return visit(value)


def _times(a: Scalar, b: Scalar) -> Scalar:
    """A product of sizes, without factors that are 1."""
    plain = [x for x in (a, b) if x.op != "number" or x.value != 1.0]
    return plain[0] * plain[1] if len(plain) == 2 else plain[0] if plain else a


def terms(e: Expr) -> list[tuple[Expr, float]]:
    """Terms of a sum with their coefficients."""
    return list(e.terms) if e.op == "sum" else [(e, 1.0)]
