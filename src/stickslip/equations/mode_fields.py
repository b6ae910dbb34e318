"""The right-hand side of a mode, and the map of an impact, from the equations."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from stickslip.equations.derive import MotionEquations
from stickslip.equations.field import ContactField, Field, Mode, Region, in_region
from stickslip.equations.planes import Plane
from stickslip.errors import DeclarationError
from stickslip.kept import made_once
from stickslip.model.declaration import DryContact
from stickslip.model.entries.declared import Kind
from stickslip.model.entries.polynomials import in_own_piece
from stickslip.numerics.levels import COMPUTED_ZERO
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

_INDEPENDENT = 1e-7  # relative remainder of a column that is independent of the others


def mode_field(equations: MotionEquations, mode: Mode, region: Region) -> Field:
    """Vector field of a mode and region: made once for each system.

    Parameters
    ----------
    mode : tuple of int
        By contact in the order of ``equations.contacts``: 0 stick, +1 or −1 slip, +2 or −2 carried
        at its threshold; of one that can open 0 closed, +1 open.
    region : tuple of int
        By kink in the order of ``equations.kinks``: 1 where the guard is ≥ 0, else 0.

    Raises
    ------
    DeclarationError
        If a viscous coordinate has a drag, since its rate has no closed expression then.
    ZeroDivisionError
        If the rates are not determined in this mode (more contacts stick than there are directions,
        or the stiffness of the sliding rate-independent coordinates is singular).
    """
    if equations.implicit:
        z = min(equations.implicit)
        raise DeclarationError(
            f"coordinates.{z}.drag",
            f"the rate of {z} is defined implicitly and has no closed form",
            "Motions, ensembles and maps can be computed. For equilibria, cycles, branches, vector "
            f"fields, derivatives and fits add mass to {z}",
        )
    return made_once(
        equations, "fields", lambda: _Solver(equations, mode, region).field(), (mode, region)
    )


def impact_map(
    equations: MotionEquations, mode: Mode, region: Region, settled: frozenset[int]
) -> list[Expr]:
    """The state after an impact, as functions of that before it: Newton's law with Coulomb's
    friction, in impulses (:mod:`stickslip.motion.admissible.impacts_law`).

    Parameters
    ----------
    mode : tuple of int
        Of the impact: of a contact that can open 0 if it takes part, else 1; of the friction of one
        that takes part 0 if it sticks, ±1 if it slips with kinetic friction, ±2 with static.
    settled : frozenset of int
        Contacts that have lost their restitution, because what is left of their bounces takes no
        time.

    Raises
    ------
    ZeroDivisionError
        If the impulses are not determined; or if a slip in a plane turns in the impact, so that its
        direction has no formula.
    """
    return _Solver(equations, mode, region).impact(settled)


class _LinearProblem(NamedTuple):
    """M x − Jᵀλ = f for some coordinates: by contact either J x is asked for, or λ is given."""

    names: list[str]
    matrix: Mapping[tuple[int, int], Expr]
    asked: dict[int, Expr]
    given: dict[int, Expr]


class _Direction(NamedTuple):
    """A condition on the rates along one direction, row·x = target, with a force μ along `pull`;
    contacts with a share in it have the forces share × μ."""

    row: list[Expr]
    pull: list[Expr]
    target: Expr
    shares: dict[int, Expr]


class _Solver:
    def __init__(self, equations: MotionEquations, mode: Mode, region: Region) -> None:
        self.eq = equations
        self.d = equations.declaration
        self.mode = tuple(mode)
        self.region = tuple(region)
        self.regions = dict(zip(equations.kinks, self.region, strict=True))
        self.known: dict[str, Expr] = {}
        self.sharing = equations.sharing
        self.shared: set[int] = set()
        for i, c in enumerate(equations.contacts):
            if (c.kind == Kind.INERTIAL or c.prescribed) and not c.plane:
                self.known[f"speed:{i}"] = self.velocity(i) * float(mode[i])
            if c.opens:
                self.known[f"glue:{i}"] = self.fix(c.plus) if abs(mode[i]) != 1 else ex.ZERO
        for plane in equations.planes:
            self.aim(plane)

    def fix(self, e: Expr) -> Expr:
        """Restrict an expression to this region, and insert the known rates."""
        return ex.substitute(in_region(e, self.regions), self.known)

    def velocity(self, i: int) -> Expr:
        """Relative velocity of contact i."""
        c = self.eq.contacts[i]
        moved = ex.add(*((w * ex.sym(f"d_{x}"), 1.0) for x, w in c.direction.items()))
        return self.fix(moved - c.speed)

    def aim(self, plane: Plane) -> None:
        """Store the direction n of a slip in a plane, that of Au, or without mass that of forces;
        and |Au| with mass. Open contacts have no direction."""
        slips = self.mode[plane.parts[0]] != 0 and not self.is_loose(plane.parts[0])
        vector = [self.fix(e) for e in plane.pull] or self.ahead(plane)
        size = ex.power(ex.add(*((e**2, 1.0) for e in vector)), ex.num(0.5))
        for i, e, idle in zip(plane.parts, vector, plane.idle, strict=True):
            self.known[f"n:{i}"] = e / size if slips else idle
        speed = size * self.fix(plane.unit) if slips else ex.ZERO
        for i in plane.parts if not plane.pull else ():
            self.known[f"speed:{i}"] = speed

    def ahead(self, plane: Plane) -> list[Expr]:
        """Au of a contact in a plane."""
        return [a * self.velocity(i) for i, a in zip(plane.parts, plane.axes, strict=True)]

    def block(
        self,
        kind: str,
        names: list[str],
        matrix: Mapping[tuple[int, int], Expr],
        forces: list[Expr],
    ) -> list[Expr]:
        """Solve M x − Jᵀλ = f with J x given in stick and λ given in slip; notes λ, returns x."""
        own = enumerate(self.eq.contacts)
        contacts = [i for i, c in own if c.kind == kind and not c.prescribed]
        stuck = [i for i in contacts if self.mode[i] == 0]
        self.known |= {f"lambda:{i}": ex.ZERO for i in contacts if self.is_open(i)}
        given = {i: self.slip_force(i) for i in contacts if self.mode[i] != 0}
        viscous = kind == Kind.VISCOUS
        asked = [
            self.eq.contacts[i].speed if viscous else self.eq.surface_acceleration(i) for i in stuck
        ]
        problem = _LinearProblem(names, matrix, dict(zip(stuck, asked, strict=True)), given)
        found, held = self.solve(problem, forces)
        self.known |= held
        return found

    def is_loose(self, i: int) -> bool:
        """Whether all that presses contact i is open."""
        return self.eq.is_loose(i, self.mode)

    def is_open(self, i: int) -> bool:
        """Whether contact i is the normal direction of one that is open."""
        return self.mode[i] != 0 and self.eq.contacts[i].opens

    def solve(
        self, problem: _LinearProblem, forces: list[Expr]
    ) -> tuple[list[Expr], dict[str, Expr]]:
        """x and all λ of M x − Jᵀλ = f with J x asked for or λ given; these may contain others."""
        names, matrix, asked, given = problem
        J = {
            i: [self.fix(self.eq.contacts[i].direction.get(x, ex.ZERO)) for x in names]
            for i in (*asked, *given)
        }
        right = [self.fix(f) for f in forces]
        pull = {i: list(J[i]) for i in asked}
        for i, force in given.items():
            # Friction under an unknown normal force acts together with it.
            rest = ex.substitute(force, {f"lambda:{n}": ex.ZERO for n in asked})
            right = [f + j * rest for f, j in zip(right, J[i], strict=True)]
            for n in asked:
                if f"lambda:{n}" in force.symbols:
                    share = ex.derivative(force, f"lambda:{n}")
                    pull[n] = [a + j * share for a, j in zip(pull[n], J[i], strict=True)]
        directions = self.directions(J, pull, {i: self.fix(e) for i, e in asked.items()})
        right += [direction.target for direction in directions]
        M = {place: self.fix(entry) for place, entry in matrix.items()}
        rows = [
            [
                *(M.get((i, k), ex.ZERO) for k in range(len(names))),
                *(-direction.pull[i] for direction in directions),
            ]
            for i in range(len(names))
        ]
        rows += [[*direction.row, *(ex.ZERO for _ in directions)] for direction in directions]
        solution = solve(rows, right)
        forces_by: dict[int, list[tuple[Expr, float]]] = {n: [] for n in asked}
        for direction, force in zip(directions, solution[len(names) :], strict=True):
            for n, share in direction.shares.items():
                forces_by[n].append((share * force, 1.0))
        found = {f"lambda:{n}": ex.add(*terms) for n, terms in forces_by.items()}
        slid = {f"lambda:{i}": ex.substitute(force, found) for i, force in given.items()}
        return solution[: len(names)], {**found, **slid}

    def directions(
        self, J: Mapping[int, list[Expr]], pull: Mapping[int, list[Expr]], asked: dict[int, Expr]
    ) -> list[_Direction]:
        """Conditions along the directions of contacts; for contacts that share forces, along a
        maximal set of independent combinations.

        The least forces in units of what contacts hold are λ = D G ν, D the squares of these units
        and G the columns of J of independent coordinates: as many unknowns ν as (D G)ᵀ J has rows.
        It has full rank wherever the columns do, whichever rows of J depend on others there.
        """
        groups: dict[int, list[int]] = {}
        for i in asked:
            groups.setdefault(self.sharing.get(i, -1 - i), []).append(i)
        found: list[_Direction] = []
        for own in groups.values():
            columns = independent_columns([J[i] for i in own]) if len(own) > 1 else []
            if len(own) == 1 or len(columns) == len(own):
                found += [_Direction(J[i], pull[i], asked[i], {i: ex.ONE}) for i in own]
                continue
            self.shared |= set(own)
            strength = {i: self.fix(self.eq.strength(i)) for i in own}
            for k in columns:
                shares = {i: strength[i] * J[i][k] for i in own if J[i][k] is not ex.ZERO}
                row, pulled = (
                    [
                        ex.add(*((share * rows[i][j], 1.0) for i, share in shares.items()))
                        for j in range(len(J[own[0]]))
                    ]
                    for rows in (J, pull)
                )
                target = ex.add(*((share * asked[i], 1.0) for i, share in shares.items()))
                found.append(_Direction(row, pulled, target, shares))
        return found

    def impact(self, settled: frozenset[int]) -> list[Expr]:
        """The state after an impact; see :func:`impact_map`."""
        d, eq = self.d, self.eq
        inertial = [i for i, c in enumerate(eq.contacts) if c.kind == Kind.INERTIAL]
        struck = [i for i in inertial if eq.contacts[i].opens and self.mode[i] == 0]
        rubbing = [i for i in inertial if set(eq.pressing(i)) & set(struck)]
        held = [*struck, *(i for i in rubbing if self.mode[i] == 0)]
        # J Δq̇ = −(1 + e) γ⁻ for contacts that take part, Λ = ∓μ Λ_N for those that slip.
        asked = {}
        for i in held:
            e = ex.ZERO if i in settled else self.fix(eq.contacts[i].restitution)
            asked[i] = -(ex.ONE + e) * self.velocity(i)
        given = {i: self.impulse(i, struck) for i in rubbing if self.mode[i] != 0}
        for plane in eq.planes:
            if plane.parts[0] in given:
                self.check_straight(plane, [*asked, *given])
        problem = _LinearProblem(d.inertial, eq.mass, asked, given)
        change, _ = self.solve(problem, [ex.ZERO for _ in d.inertial])
        jumps = {f"d_{q}": e for q, e in zip(d.inertial, change, strict=True)}
        return [ex.sym(y) + jumps.get(y, ex.ZERO) for y in d.state]

    def check_straight(self, plane: Plane, struck: list[int]) -> None:
        """Reject a slip in a plane whose direction after an impact is not that before it: for this
        there is no formula.

        Parameters
        ----------
        struck : list of int
            All contacts that take part.

        Raises
        ------
        ZeroDivisionError
        """
        names = self.d.inertial
        J = {
            i: [self.fix(self.eq.contacts[i].direction.get(x, ex.ZERO)) for x in names]
            for i in struck
        }
        n = range(len(names))
        M = [[self.fix(self.eq.mass.get((i, k), ex.ZERO)) for k in n] for i in n]
        first, second = plane.parts
        felt = {i: solve(M, J[i]) for i in plane.parts}

        def response(i: int, k: int) -> Expr:
            return ex.add(*((j * x, 1.0) for j, x in zip(J[k], felt[i], strict=True)))

        a, b = (axis**2 for axis in plane.axes)
        uneven = [a * response(first, first) - b * response(second, second)]
        own = {*plane.parts, *self.eq.pressing(first)}
        uneven += [response(first, second)]
        uneven += [response(i, k) for i in plane.parts for k in struck if k not in own]
        if not all(map(vanishes, uneven)):
            raise ZeroDivisionError("the direction after the impact has no closed form")

    def impulse(self, i: int, struck: list[int]) -> Expr:
        """Impulse of the friction of a sliding contact i due to normal impulses; zero if its
        friction does not depend on them."""
        others = {f"lambda:{n}": ex.ZERO for n in self.eq.pressing(i) if n not in struck}
        force = ex.substitute(self.slip_force(i), others)
        bounded = ex.substitute(force, {f"lambda:{n}": ex.ZERO for n in struck})
        return force - bounded

    def slip_force(self, i: int) -> Expr:
        """Friction force of contact i, which slips; in it normal forces may be unknown."""
        c = self.eq.contacts[i]
        if c.opens:
            return ex.ZERO
        # A contact that is carried by others, or reversed by an impact, is at its threshold.
        carried = abs(self.mode[i]) == 2
        plus, minus = (c.plus, c.minus) if carried else (c.kinetic_plus, c.kinetic_minus)
        return -self.fix(plus) if self.mode[i] > 0 else self.fix(minus)

    def rates(self) -> list[Expr]:
        """Rates of the rate-independent coordinates."""
        rate = self.eq.rate
        first = len(self.eq.contacts) - len(self.d.rate_independent)
        rows, right = [], []
        for i in range(len(self.d.rate_independent)):
            sigma = self.mode[first + i]
            plane = next((p for p in self.eq.planes if first + i in p.parts), None)
            if sigma != 0 and plane is not None:
                n = range(len(rate.weight))
                speeds = [self.eq.contacts[part].speed for part in plane.parts]
                rows.append([self.fix(rate.sliding(plane, i, j, first)) for j in n])
                right.append(-self.fix(rate.sliding_rest(plane, i, speeds, first)))
                continue
            if sigma == 0:
                rows.append(
                    [rate.weight[i] if i == j else ex.ZERO for j in range(len(rate.weight))]
                )
                right.append(self.fix(self.eq.contacts[first + i].speed))
                continue
            side = 0 if sigma > 0 else 1
            slopes = zip(rate.stiffness[i], rate.threshold_slope[side][i], strict=True)
            rows.append([self.fix(h) + float(sigma) * self.fix(s) for h, s in slopes])
            right.append(
                -self.fix(rate.rest[i]) - float(sigma) * self.fix(rate.threshold_rest[side][i])
            )
        return solve(rows, right)

    def field(self) -> Field:
        d, eq = self.d, self.eq
        damped = self.block(Kind.VISCOUS, d.viscous, eq.damping, eq.viscous_force)
        self.known |= {f"d_{z}": e for z, e in zip(d.viscous, damped, strict=True)}
        slid = self.rates()
        self.known |= {f"d_{r}": e for r, e in zip(d.rate_independent, slid, strict=True)}
        laws = [self.fix(law) for law in eq.laws]
        accelerations = self.block(Kind.INERTIAL, d.inertial, eq.mass, eq.inertial_force)
        for i, c in enumerate(eq.contacts):
            if c.prescribed:
                force = ex.ZERO if self.mode[i] == 0 else self.slip_force(i)
                self.known[f"lambda:{i}"] = force
        contacts = [self.contact(i) for i in range(len(eq.contacts))]
        velocities = [ex.sym(f"d_{q}") for q in d.inertial]
        return Field(
            state=tuple(d.state),
            parameters=tuple(d.parameters),
            mode=self.mode,
            region=self.region,
            rates=[*velocities, *accelerations, *damped, *slid, *laws],
            contacts=contacts,
            kinks=[self.fix(in_own_piece(g)) for g in eq.kinks],
            constraints=self.constraints(contacts),
            leaps=[self.fix(e) - ex.sym(x) for j in eq.jumps for x, e in j.values.items()],
            energy=self.fix(eq.energy),
            planes=[plane.parts for plane in eq.planes],
            shared=frozenset(self.shared),
        )

    def contact(self, i: int) -> ContactField:
        c = self.eq.contacts[i]
        if c.kind == Kind.RATE_INDEPENDENT:
            first = len(self.eq.contacts) - len(self.d.rate_independent)
            force = self.fix(self.eq.rate.force[i - first])
        else:
            force = self.known[f"lambda:{i}"]
        at_rest = self.mode[i] == 0 and c.kind != Kind.INERTIAL and not c.prescribed
        u = ex.ZERO if at_rest else self.velocity(i)
        gap = None if c.gap is None else self.fix(c.gap)
        loose = self.is_loose(i)
        plus, minus = self.fix(c.plus), self.fix(c.minus)
        if c.opens:
            plus = self.known[f"glue:{i}"]
            force -= plus
        room = self.room(i) if c.plane == 1 else ex.ZERO
        own = self.eq.members[i]
        parts = tuple(self.part(i, m, u) for m in own) if len(own) > 1 else ()
        return ContactField(
            *(c.name, c.kind, u, force, plus, minus, gap, loose, c.plane, room, c.side_of, parts),
            prescribed=c.prescribed,
        )

    def part(self, i: int, c: DryContact, u: Expr) -> ContactField:
        """One of the members of contact i, whose relative velocity is u."""
        held, *sides = self.eq.part(i, c)
        mode = self.mode[i]
        against = sides[2 * (abs(mode) // 2) + (0 if mode > 0 else 1)]
        force = held if mode == 0 else -against if mode > 0 else against
        speed, force, plus, minus = map(self.fix, (c.ratio * u, force, c.plus, c.minus))
        gap = None if c.gap is None else self.fix(c.gap)
        return ContactField(c.name, c.kind, speed, force, plus, minus, gap)

    def room(self, i: int) -> Expr:
        """The guard of a contact in a plane, given by its first component."""
        plane = next(p for p in self.eq.planes if p.parts[0] == i)
        if self.mode[i] == 0 and self.eq.contacts[i].prescribed:
            return ex.add(*((e**2, -1.0) for e in self.ahead(plane)))
        if self.mode[i] != 0 and not plane.pull:
            return self.known[f"speed:{i}"]
        if self.mode[i] != 0:
            pairs = zip(plane.parts, self.ahead(plane), strict=True)
            return ex.add(*((self.known[f"n:{part}"] * u, 1.0) for part, u in pairs))
        if self.eq.contacts[i].kind == Kind.RATE_INDEPENDENT:
            first = len(self.eq.contacts) - len(self.d.rate_independent)
            forces = [self.fix(self.eq.rate.force[part - first]) for part in plane.parts]
        else:
            forces = [self.known[f"lambda:{part}"] for part in plane.parts]
        return self.fix(plane.admissible(forces))

    def constraints(self, contacts: list[ContactField]) -> list[Expr]:
        found = []
        for c, m in zip(contacts, self.mode, strict=True):
            if c.kind == Kind.INERTIAL and m == 0:
                found += [c.u] if c.gap is None else [c.gap, c.u]
            elif c.kind == Kind.RATE_INDEPENDENT and m != 0 and not c.plane:
                found.append(c.force + c.plus if m > 0 else c.force - c.minus)
        for plane in self.eq.planes:
            first = contacts[plane.parts[0]]
            if first.kind == Kind.RATE_INDEPENDENT and self.mode[plane.parts[0]] != 0:
                size = ex.add(*((self.fix(e) ** 2, 1.0) for e in plane.pull))
                found.append(self.fix(plane.static) - ex.power(size, ex.num(0.5)))
        return found


def solve(matrix: list[list[Expr]], right: list[Expr]) -> list[Expr]:
    """Solution of a linear system of expressions.

    Gaussian elimination along the diagonal: the matrices of mechanics (positive definite, with
    constraints last) have pivots that vanish only where the matrix is singular.

    Raises
    ------
    ZeroDivisionError
        If a pivot vanishes identically.
    """
    a = [list(row) for row in matrix]
    b = list(right)
    n = len(right)
    for k in range(n):
        if vanishes(a[k][k]):
            raise ZeroDivisionError("the rates are indeterminate in this mode")
        for i in range(k + 1, n):
            if a[i][k] is ex.ZERO:
                continue
            factor = a[i][k] / a[k][k]
            a[i] = [
                x - factor * y if y is not ex.ZERO else x for x, y in zip(a[i], a[k], strict=True)
            ]
            a[i][k] = ex.ZERO
            b[i] = b[i] - factor * b[k]
    for k in reversed(range(n)):
        known = ex.add(*((a[k][j] * b[j], 1.0) for j in range(k + 1, n)))
        b[k] = (b[k] - known) / a[k][k]
    return b


def independent_columns(rows: list[list[Expr]]) -> list[int]:
    """The first columns of a matrix of expressions that are independent of those before them, for
    all but special values of the names."""
    names = sorted(frozenset[str]().union(*(e.symbols for row in rows for e in row)))
    found: list[int] = []
    for values in _random_values(names):
        matrix = np.array([[ex.evaluate(e, values) for e in row] for row in rows])
        if not np.all(np.isfinite(matrix)):
            continue
        basis = np.zeros((0, len(rows)))
        columns: list[int] = []
        for j, column in enumerate(matrix.T):
            left = column - basis.T @ (basis @ column)
            left -= basis.T @ (basis @ left)
            if np.linalg.norm(left) > _INDEPENDENT * np.linalg.norm(column):
                basis = np.vstack([basis, left / np.linalg.norm(left)])
                columns.append(j)
        if len(columns) > len(found):
            found = columns
    return found


def _random_values(names: Sequence[str]) -> Iterator[dict[str, float]]:
    """Values of names at a few points."""
    for turn in range(1, 5):
        yield {
            name: 0.5 + (0.3819660112501051 * turn + 0.5545497331806323 * i) % 1.0
            for i, name in enumerate(names)
        }


def vanishes(e: Expr) -> bool:
    """Whether an expression is zero identically: where it is not, random points show it up to
    rounding."""
    if e.op == "num":
        return ex.is_number(e, 0.0)
    names = sorted(e.symbols)
    parts = list(e.terms) if e.op == "sum" else [(e, 1.0)]
    constant = float(e.value) if e.op == "sum" else 0.0
    for values in _random_values(names):
        terms = [constant, *(c * ex.evaluate(term, values) for term, c in parts)]
        if all(map(math.isfinite, terms)):
            return abs(sum(terms)) <= COMPUTED_ZERO * sum(map(abs, terms))
    return False
