"""System -> the equations of motion of one mode, as expressions.

The three kinds of coordinates pose the same linear problem, one time derivative apart:

    inertial          M a  − Jᵀλ  = f,      stick: J a = ẇ,   slip: λ = −σ k
    viscous           C ż  − Jᵀλ  = f,      stick: J ż = w,   slip: λ = −σ k
    rate-independent  H ṙ  − Jᵀλ̇  = −∂ₜ∂Φ,  stick: J ṙ = w,   slip: λ̇ = −σ ṡ

with f the forces that are not from contacts. Where the kinetic energy T(q, q̇, t) or a direction
depends on the configuration, f holds −(∂²T/∂q̇∂q) q̇ − ∂²T/∂q̇∂t + ∂T/∂q, and stick asks for
J a = ẇ − J̇ q̇ (Lagrange's equations). The rate of a viscous coordinate with a drag is the
zero of drag(ż) + c ż − f, which increases with ż. All expressions here hold within one region of
every function with kinks; which region, and which mode, is decided while the motion is computed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from stickslip.equations.coupling import components, together
from stickslip.equations.multiples import group_multiples
from stickslip.equations.planes import (
    Plane,
    component_of,
    matrix_of,
    planes_of,
    pressed_planes,
    pressing_on,
    pull_of,
    relative_velocity,
)
from stickslip.equations.rate_problem import RateProblem, rate_problem_of
from stickslip.kept import cached_property, made_once
from stickslip.model.declaration import Declaration, DryContact, StateJump
from stickslip.model.entries.declared import Kind
from stickslip.model.entries.keys import JOINED
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

if TYPE_CHECKING:
    pass

_KINDS = tuple(Kind)
_NO_FORCE = 1e-300  # force that is negligible compared with any threshold
_MANY = 6  # terms of a stretch that is computed once, and not in the force of each coordinate


@dataclass(frozen=True, eq=False)
class MotionEquations:
    """Everything the engine needs to know of a system, symbolically.

    Attributes
    ----------
    contacts : list of DryContact
        What adheres to a gap is pressed together by its adhesion, while it is closed: by a force
        ``glue:i``, so that λ = N + glue is not negative.
        Ordered by kind: inertial, viscous, then rate-independent in the order of their coordinates.
        Those between motions that are given are counted as viscous.
        Components of a contact in a plane slip with the mode 1; their forces then are those of the
        direction n, whose components are the symbols ``n:i``.
    members : list of tuple of DryContact
        What each of them was declared as: several whose relative velocities are multiples of one
        another are one, since stick is a velocity that is zero, whichever of them holds. It moves
        with the relative velocity of the first. So are several floors, by the name of the first.
    planes : list of Plane
        Contacts in a plane.
    inertial_force, viscous_force : list of Expr
        Right-hand sides f.
    stretches : dict of str to Expr
        By symbols ``stretch:i``: sums of many terms whose squares are in the potential. A spring
        between modes of structures pulls at all of them by its stretch; written out, n of them
        would have n² terms.
    shared_force : list of Expr
        `inertial_force` in terms of these symbols.
    mass, damping : dict of (int, int) to Expr
        M(q, t) of the inertial and C of the viscous coordinates without a drag: the entries that
        there are, row by row.
    implicit : dict of str to Expr
        By viscous coordinate with a drag, what its rate is the zero of.
    kinks : list of Expr
        Guards of all functions with kinks, and of jumps; region 1 is guard ≥ 0.
    jumps : list of StateJump
        In the order of declaration; of each the number of its kink.
    frequencies : list of Expr
        Rates ω of the phases of what repeats in time.
    timed : bool
        Whether time enters the equations.
    energy, dissipation, supply : Expr
        E, the dissipated power and the supplied power, in the state, the rates and the symbols
        ``u:i``, ``lambda:i``.
    """

    declaration: Declaration
    contacts: list[DryContact]
    members: list[tuple[DryContact, ...]]
    planes: list[Plane]
    inertial_force: list[Expr]
    viscous_force: list[Expr]
    stretches: dict[str, Expr]
    shared_force: list[Expr]
    mass: dict[tuple[int, int], Expr]
    damping: dict[tuple[int, int], Expr]
    implicit: dict[str, Expr]
    laws: list[Expr]
    rate: RateProblem
    kinks: list[Expr]
    jumps: list[StateJump]
    frequencies: list[Expr]
    timed: bool
    energy: Expr
    dissipation: Expr
    supply: Expr

    @cached_property
    def formulas(self) -> list[Expr]:
        """All formulas on which the motion depends."""
        found = [*self.inertial_force, *self.viscous_force, *self.laws, *self.rate.force]
        found += self.implicit.values()
        found += self.inertia
        found += _formulas_of(self.jumps)
        for c in self.contacts:
            found += [c.plus, c.minus, c.kinetic_plus, c.kinetic_minus, c.speed]
        return found

    @property
    def inertia(self) -> list[Expr]:
        """Entries of the mass matrix, coefficients of directions, and gaps, that depend on the
        state or on time."""
        held = frozenset(self.declaration.parameters)
        entries = [*self.mass.values(), *(j for c in self.contacts for j in c.direction.values())]
        entries += [c.gap for c in self.contacts if c.gap is not None]
        return [e for e in dict.fromkeys(entries) if not e.symbols <= held]

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """Declared names of contacts: the components of a contact in a plane have one name, and
        sides of constraints none."""
        return tuple("" if c.side_of else c.name.removesuffix(f" {c.plane}") for c in self.contacts)

    @cached_property
    def numbers(self) -> dict[str, int]:
        """Number of each contact by its name, and by the names of the contacts declared in its
        place."""
        found = {c.name: i for i, c in enumerate(self.contacts)}
        return found | {c.name: i for i, own in enumerate(self.members) for c in own}

    def part(self, i: int, c: DryContact) -> tuple[Expr, Expr, Expr, Expr, Expr]:
        """The force of one of the members of a contact along its own direction: in stick, and,
        with the sign of one against it, where the contact slips forward and back, by the sliding
        forces and by the thresholds.

        Forces in stick are not unique: each has as much room, in parts of its own thresholds, as
        the sum of them.
        """
        whole = self.contacts[i]
        if c.opens:
            held = _share(c, self.members[i]) * ex.sym(f"lambda:{i}")
            return held, ex.ZERO, ex.ZERO, ex.ZERO, ex.ZERO
        width = ex.add((whole.plus, 1.0), (whole.minus, 1.0), (ex.num(_NO_FORCE), 1.0))
        share = (ex.sym(f"lambda:{i}") + whole.plus) * (c.plus + c.minus) / width

        def seen(ahead: Expr, behind: Expr) -> Expr:
            return ex.select(c.ratio, ahead, behind)

        return (
            seen(share - c.plus, c.minus - share),
            seen(c.kinetic_plus, -c.kinetic_minus),
            seen(c.kinetic_minus, -c.kinetic_plus),
            seen(c.plus, -c.minus),
            seen(c.minus, -c.plus),
        )

    def turned(self, region: Sequence[int]) -> tuple[str, ...]:
        """Contacts that slip back where the first of those that they are one with slips forward.

        Parameters
        ----------
        region : sequence of int
            Of each kink, among which are zeros of factors between directions.
        """
        known = dict(zip(self.kinks, region, strict=True)) if self.turning else {}
        return tuple(c.name for c in self.turning if _known_sign(c.sense, known) < 0)

    @cached_property
    def turning(self) -> list[DryContact]:
        """Contacts of which that may be true in some region."""
        return [c for own in self.members for c in own if c.sense is not ex.ONE]

    @cached_property
    def guards_alone(self) -> frozenset[Expr]:
        """Guards of jumps that are no kinks of functions."""
        used = [*self.formulas, self.energy, self.dissipation, self.supply]
        held = frozenset(self.declaration.parameters)
        kinks = {ex.listed_guard(n, held) for n in ex.walk(used) if n.op == "select"}
        return frozenset(jump.guard for jump in self.jumps) - kinks

    @cached_property
    def speeds(self) -> dict[str, Expr]:
        """The symbols ``speed:i`` of contacts whose velocities are functions of the state."""
        moving = [i for i, c in enumerate(self.contacts) if c.kind == Kind.INERTIAL or c.prescribed]
        u = {i: self.velocity(i) for i in moving}
        squares = {i: [u[i]] for i in moving}
        for plane in self.planes:
            if plane.parts[0] in u:
                parts = [axis * u[i] for i, axis in zip(plane.parts, plane.axes, strict=True)]
                if plane.formula is not None:
                    way = dict(zip(plane.formula.names, parts, strict=True))
                    parts = [ex.substitute(plane.formula.value, way)]
                squares |= dict.fromkeys(plane.parts, parts)
        return {
            f"speed:{i}": ex.power(ex.add(*((e**2, 1.0) for e in parts)), ex.num(0.5))
            for i, parts in squares.items()
        }

    def velocity(self, i: int) -> Expr:
        """The relative velocity of a contact, Σ jₓ ẋ − w."""
        return relative_velocity(self.contacts[i])

    def pressing(self, i: int) -> list[int]:
        """Contacts that can open whose normal forces are in the friction of contact i."""
        return pressing_on(self.contacts, i)

    def has_own_friction(self, i: int) -> bool:
        """Whether a contact has friction without a normal force."""
        return self._alone[i]

    @cached_property
    def _alone(self) -> list[bool]:
        normals = {f"lambda:{j}": ex.ZERO for j, c in enumerate(self.contacts) if c.opens}
        sides = [(c.plus, c.minus, c.kinetic_plus, c.kinetic_minus) for c in self.contacts]
        return [any(ex.substitute(e, normals) is not ex.ZERO for e in own) for own in sides]

    def is_loose(self, i: int, mode: Sequence[int]) -> bool:
        """Whether a contact has friction under normal forces alone, and all that press it are
        open in a mode."""
        pressing = self.pressing(i)
        opened = all(mode[n] != 0 for n in pressing)
        return bool(pressing) and opened and not self.has_own_friction(i)

    @cached_property
    def directions(self) -> dict[int, tuple[int, ...]]:
        """All directions of each contact, by its first one: one along a line, two in a plane, three
        of a face."""
        planes = {plane.parts[0]: plane.parts for plane in self.planes}
        others = {part for parts in planes.values() for part in parts[1:]}
        return {c: planes.get(c, (c,)) for c in range(len(self.contacts)) if c not in others}

    @cached_property
    def sharing(self) -> dict[int, int]:
        """Groups of contacts with mass that may hold the same coordinates, with friction in a
        plane, so that their directions may depend on each other. A contact with a formula is always
        in a group, since its support function determines how long it sticks."""
        massive = [c for c in self.contacts if c.kind == Kind.INERTIAL]
        pairs = [plane.parts for plane in self.planes if plane.parts[0] < len(massive)]
        if not pairs:
            return {}
        place = {x: i for i, x in enumerate(self.declaration.inertial)}
        parts = components(
            len(place),
            self.mass,
            0,
            [[place[x] for x in c.direction] for c in massive],
            [(c, n) for c in range(len(massive)) for n in self.pressing(c)],
        )
        always = {i for plane in self.planes if plane.formula is not None for i in plane.parts}
        closed = [i for i, c in enumerate(massive) if not c.opens]
        return together(parts, pairs, closed, always)

    def strength(self, i: int) -> Expr:
        """The square of the force that a contact can hold, of those that may share forces: 1 for
        all where one of them is not constant."""
        own = [c for c, number in self.sharing.items() if number == self.sharing[i]]
        held = frozenset(self.declaration.parameters)
        constant = all(self.contacts[c].plus.symbols <= held for c in own)
        return self.contacts[i].plus ** 2 if constant else ex.ONE

    def surface_acceleration(self, i: int) -> Expr:
        """The value of J a in stick: ẇ − J̇ q̇."""
        c = self.contacts[i]
        rates = {"t": ex.ONE, **{q: ex.sym(f"d_{q}") for q in self.declaration.inertial}}
        turning = [(ex.along(j, rates), ex.sym(f"d_{x}")) for x, j in c.direction.items()]
        carried = [(slope * rate, -1.0) for slope, rate in turning if slope is not ex.ZERO]
        return ex.add((ex.along(c.speed, rates), 1.0), *carried)

    def acting(self, zero: frozenset[str]) -> list[bool]:
        """Frequencies that affect the system if some parameters are zero, such as the amplitude of
        a drive."""
        numbers = dict.fromkeys(zero, ex.ZERO)
        try:
            waves = ex.walk([ex.substitute(e, numbers) for e in self.formulas])
            felt = {ex.frequency(e) for e in waves}
            rates = [ex.substitute(e, numbers) for e in self.frequencies]
        except (ZeroDivisionError, OverflowError):
            return [True] * len(self.frequencies)
        return [rate in felt or -rate in felt for rate in rates]

    def count(self, kind: str) -> int:
        """Number of contacts of a kind."""
        return sum(c.kind == kind for c in self.contacts)


def derive(declaration: Declaration) -> MotionEquations:
    """The equations of motion from energy and dissipation potential: derived once for each
    declaration.

    Raises
    ------
    DeclarationError
        If an internal law or a threshold makes the rate problem nonlinear in the rates.
    """
    return made_once(declaration, "equations", lambda: _equations_of(declaration))


def _formulas_of_contacts(
    d: Declaration, contacts: Sequence[DryContact], members: Sequence[Sequence[DryContact]]
) -> list[Expr]:
    """The formulas of contacts, and of the mass if it is not constant, on which the motion
    depends."""
    held = frozenset(d.parameters)
    used = [e for e in d.mass.values() if not e.symbols <= held]
    for c in contacts:
        used += [c.plus, c.minus, c.kinetic_plus, c.kinetic_minus, c.speed]
        # The law at zero speed determines whether sliding forces are admissible.
        at_rest = {f"speed:{i}": ex.ZERO for i in range(len(contacts))}
        forces = (c.kinetic_plus, c.kinetic_minus)
        used += [ex.substitute(force, at_rest, undefined=True) for force in forces]
        used += [j for j in c.direction.values() if not j.symbols <= held]
        used += [c.gap] if c.gap is not None else []
    return used + [c.sense for own in members for c in own]


def _equations_of(d: Declaration) -> MotionEquations:
    own = {r: i for i, r in enumerate(d.rate_independent)}
    contacts = sorted(
        d.contacts, key=lambda c: (_KINDS.index(c.kind), own.get(next(iter(c.direction), ""), 0))
    )
    groups = group_multiples(contacts, frozenset(d.parameters))
    normals = {c.name: (i, _share(c, own)) for i, own in enumerate(groups) for c in own if c.opens}
    glued = [i for i, own in enumerate(groups) if own[0].opens and own[0].plus is not ex.ZERO]
    members = [tuple(_named(c, i, normals, glued) for c in own) for i, own in enumerate(groups)]
    contacts = [_sum_of(own) for own in members]
    planes = planes_of(contacts)
    for plane in planes:
        for i, axis in zip(plane.parts, plane.axes, strict=True):
            contacts[i] = replace(component_of(contacts[i], i, plane), axis=axis)
    planes = pressed_planes(d, contacts, planes)
    slope = {x: ex.derivative(d.potential, x) - d.forces[x] for x in d.coordinates}
    potential, stretches = _with_stretches(d.potential)
    by_inertial, by_all = _damping(d, d.inertial), _damping(d, [*d.inertial, *d.viscous])
    viscous_force = [-slope[z] - by_inertial.get(z, ex.ZERO) for z in d.viscous]
    others = {q: d.velocity_force(q) - d.drags[q] - by_all.get(q, ex.ZERO) for q in d.inertial}
    for i in glued:
        for q, weight in contacts[i].direction.items():
            others[q] -= weight * ex.sym(f"glue:{i}")
    inertial_force = [others[q] - slope[q] for q in d.inertial]
    shared_force = inertial_force
    if stretches:
        shared_force = [
            others[q] + d.forces[q] - _slope_by_stretches(potential, stretches, q)
            for q in d.inertial
        ]
    force_of = dict(zip(d.viscous, viscous_force, strict=True))
    implicit = {z: d.resistance(z) - force_of[z] for z in d.resisted}
    laws = [d.laws[a] for a in d.internal]
    energy, dissipation, supply = _powers(d, contacts)
    rate = rate_problem_of(d, contacts, slope)
    planes = [plane._replace(pull=pull_of(d, contacts, plane, rate, force_of)) for plane in planes]
    moving = [*inertial_force, *viscous_force, *implicit.values(), *laws, *rate.rest, *rate.force]
    moving += [r for row in rate.stiffness for r in row]
    felt = [*moving, *_formulas_of_contacts(d, contacts, members), *_formulas_of(d.jumps)]
    used = [*felt, energy, dissipation, supply, *d.mass.values(), *d.damping.values()]
    used += [e for plane in planes for e in (plane.unit, *plane.slope)]
    used += [e for c in contacts for e in (*c.direction.values(), c.axis, c.restitution)]
    held = frozenset(d.parameters)
    guards = dict.fromkeys(ex.listed_guard(n, held) for n in ex.walk(used) if n.op == "select")
    guards |= dict.fromkeys(jump.guard for jump in d.jumps)
    kinks = list(guards)
    return MotionEquations(
        declaration=d,
        contacts=contacts,
        members=members,
        planes=planes,
        inertial_force=inertial_force,
        viscous_force=viscous_force,
        stretches=stretches,
        shared_force=shared_force,
        mass=matrix_of(d.mass, d.inertial),
        damping=matrix_of(d.damping, d.damped),
        implicit=implicit,
        laws=laws,
        rate=rate,
        kinks=kinks,
        jumps=[replace(jump, kink=kinks.index(jump.guard)) for jump in d.jumps],
        frequencies=_frequencies(felt, d.parameters),
        timed=any("t" in e.symbols for e in felt),
        energy=energy,
        dissipation=dissipation,
        supply=supply,
    )


def _with_stretches(potential: Expr) -> tuple[Expr, dict[str, Expr]]:
    """A potential in which sums of many terms that are squared are symbols, and these symbols."""
    products = [node for node in ex.walk([potential]) if node.op == "prod"]
    squared = [base for node in products for base, p in node.terms if p == 2.0]
    sums = list(dict.fromkeys(e for e in squared if e.op == "sum" and len(e.terms) >= _MANY))
    symbols = {e: ex.sym(f"stretch:{i}") for i, e in enumerate(sums)}
    found = ex.rewrite(potential, symbols.get)
    return found, {str(symbol.value): e for e, symbol in symbols.items()}


def _slope_by_stretches(potential: Expr, stretches: Mapping[str, Expr], name: str) -> Expr:
    """Partial derivative of a potential that depends on stretches, in terms of these (the chain
    rule)."""
    inner = {symbol: ex.derivative(e, name) for symbol, e in stretches.items()}
    return ex.along(potential, {name: ex.ONE, **inner})


def _known_sign(sense: Expr, regions: Mapping[Expr, int]) -> int:
    """A sign, where it is known which kinks are on which side."""
    while sense.op == "select":
        above, *branches = ex.branches_of(sense, regions)
        sense = branches[0 if above == 1 else 1]
    return round(ex.number(sense))


def _formulas_of(jumps: list[StateJump]) -> list[Expr]:
    """Guards and new values."""
    return [e for jump in jumps for e in (jump.guard, *jump.values.values())]


def _sum_of(own: Sequence[DryContact]) -> DryContact:
    """The contact whose friction is that of several: moves with the relative velocity of the
    first."""
    if len(own) == 1:
        return own[0]
    sides = ("plus", "minus", "kinetic_plus", "kinetic_minus")
    totals = zip(*(_along_first(c) for c in own), strict=True)
    return replace(
        own[0],
        name=own[0].name if own[0].opens else JOINED.join(c.name for c in own),
        on=next((c.on for c in own if c.on), ""),
        **{
            side: ex.add(*((part, 1.0) for part in parts))
            for side, parts in zip(sides, totals, strict=True)
        },
    )


def _share(c: DryContact, own: Sequence[DryContact]) -> Expr:
    """Distribution of the normal force over several identical floors: forces of minimum norm with
    the given sum."""
    return c.ratio / ex.add(*((other.ratio**2, 1.0) for other in own))


def _along_first(c: DryContact) -> tuple[Expr, Expr, Expr, Expr]:
    """Thresholds and sliding forces of a contact, as forces along the direction of which its own is
    a multiple. If the factor is negative, forward and backward are exchanged."""
    r = c.ratio
    return (
        ex.select(r, r * c.plus, -r * c.minus),
        ex.select(r, r * c.minus, -r * c.plus),
        ex.select(r, r * c.kinetic_plus, -r * c.kinetic_minus),
        ex.select(r, r * c.kinetic_minus, -r * c.kinetic_plus),
    )


def _named(
    c: DryContact, i: int, normals: dict[str, tuple[int, Expr]], glued: list[int]
) -> DryContact:
    """Give each contact's ``speed`` its own symbol, and normal forces those of the forces.

    What adheres is pressed by as much as it adheres, ``glue:i``; λ is the whole pressure. It makes
    the contact's own friction, and others know of N = λ − glue.
    """
    own = {"speed": ex.absolute(c.ratio) * ex.sym(f"speed:{i}")}
    for name, (n, share) in normals.items():
        pressure = share * ex.sym(f"lambda:{n}")
        others = n in glued and c.on != name
        own[name] = pressure - ex.sym(f"glue:{n}") if others else pressure
    return replace(
        c,
        plus=ex.substitute(c.plus, own),
        minus=ex.substitute(c.minus, own),
        kinetic_plus=ex.substitute(c.kinetic_plus, own),
        kinetic_minus=ex.substitute(c.kinetic_minus, own),
    )


def _damping(d: Declaration, others: list[str]) -> dict[str, Expr]:
    """Viscous forces by coordinate, due to the rates of the given coordinates."""
    felt = frozenset(others)
    found: dict[str, list[tuple[Expr, float]]] = {}
    for (x, y), entry in d.damping.items():
        if y in felt:
            found.setdefault(x, []).append((entry * ex.sym(f"d_{y}"), 1.0))
    return {x: ex.add(*terms) for x, terms in found.items()}


def _powers(d: Declaration, contacts: list[DryContact]) -> tuple[Expr, Expr, Expr]:
    """Energy, dissipated power, and power supplied by time-dependence, belts, forces and internal
    variables."""
    energy = d.moving_energy + d.potential
    rates = {x: ex.sym(f"d_{x}") for x in (*d.coordinates, *d.internal)}
    dissipated = [(2.0 * d.dissipation, 1.0), *((f * rates[x], 1.0) for x, f in d.drags.items())]
    supplied = [
        (ex.derivative(d.potential, "t"), 1.0),
        (ex.derivative(d.kinetic, "t"), -1.0),
        (ex.along(d.potential, {a: rates[a] for a in d.internal}), 1.0),
        *((d.forces[x] * rates[x], 1.0) for x in d.coordinates),
    ]
    for i, c in enumerate(contacts):
        u, force = ex.sym(f"u:{i}"), ex.sym(f"lambda:{i}")
        if c.opens and c.plus is not ex.ZERO:
            force -= ex.sym(f"glue:{i}")
        dissipated.append((force * u, -1.0))
        supplied.append((force * c.speed, 1.0))
    return energy, ex.add(*dissipated), ex.add(*supplied)


def _frequencies(used: list[Expr], parameters: list[str]) -> list[Expr]:
    found: dict[Expr, None] = {}
    for node in ex.walk(used):
        rate = ex.frequency(node)
        if rate is not None and rate.symbols <= set(parameters) and -rate not in found:
            found[rate] = None
    return list(found)
