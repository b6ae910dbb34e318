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
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stickslip.equations.coupling import Component, components, somewhere, together
from stickslip.equations.multiples import one_by_direction
from stickslip.errors import DeclarationError
from stickslip.kept import cached_property, made_once
from stickslip.model.declaration import Declaration, DryContact, StateJump
from stickslip.model.names import JOINED
from stickslip.model.system import Kind
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

if TYPE_CHECKING:
    from stickslip.convex.formula import ConvexFormula

_KINDS = tuple(Kind)
_NO_FORCE = 1e-300  # beside every threshold


@dataclass(frozen=True)
class RateProblem:
    """The problem for the rates of the rate-independent coordinates r (contact i moves coordinate
    i).

    Attributes
    ----------
    weight : list of Expr
        Direction coefficients jᵢ, uᵢ = jᵢ ṙᵢ − wᵢ.
    force : list of Expr
        λᵢ = (∂ᵢΦ − forceᵢ)/jᵢ, a function of the state.
    stiffness, rest : matrix and list of Expr
        d/dt λᵢ = Σⱼ stiffnessᵢⱼ ṙⱼ + restᵢ.
    threshold_slope, threshold_rest : pairs (for u > 0, u < 0) of the same for the thresholds.
    partial, threshold_partial : matrices of ∂λᵢ/∂rⱼ and (pairs of) ∂sᵢ/∂rⱼ
    """

    weight: list[Expr]
    force: list[Expr]
    stiffness: list[list[Expr]]
    rest: list[Expr]
    threshold_slope: tuple[list[list[Expr]], list[list[Expr]]]
    threshold_rest: tuple[list[Expr], list[Expr]]
    partial: list[list[Expr]]
    threshold_partial: tuple[list[list[Expr]], list[list[Expr]]]

    def sliding(self, plane: Plane, i: int, j: int, first: int) -> Expr:
        """What ṙⱼ has in the equation of coordinate i while a contact in a plane slips: of its
        first component d/dt(n·A⁻¹λ + s) = 0, of its second n × Au = 0.

        Parameters
        ----------
        plane : Plane
        i, j : int
            Coordinates.
        first : int
            Number of the first contact that moves a rate-independent coordinate.
        """
        n = [ex.sym(f"n:{part}") for part in plane.parts]
        own = [part - first for part in plane.parts]
        if i == own[0]:
            terms = [
                (x / axis * self.stiffness[k][j], 1.0)
                for x, axis, k in zip(n, plane.axes, own, strict=True)
            ]
            return ex.add(*terms, (self.threshold_slope[0][i][j] / plane.axes[0], 1.0))
        if j not in own:
            return ex.ZERO
        side = own.index(j)
        turned = plane.axes[side] * self.weight[j] * n[1 - side]
        return turned if side else -turned

    def sliding_rest(self, plane: Plane, i: int, speeds: list[Expr], first: int) -> Expr:
        """The rest of that equation.

        Parameters
        ----------
        plane : Plane
        i : int
            Coordinate.
        speeds : list of Expr
            Of the surface.
        first : int
            As of :meth:`sliding`.
        """
        n = [ex.sym(f"n:{part}") for part in plane.parts]
        own = [part - first for part in plane.parts]
        if i == own[0]:
            terms = [
                (x / axis * self.rest[k], 1.0)
                for x, axis, k in zip(n, plane.axes, own, strict=True)
            ]
            return ex.add(*terms, (self.threshold_rest[0][i] / plane.axes[0], 1.0))
        a, b = (axis * w for axis, w in zip(plane.axes, speeds, strict=True))
        return a * n[1] - b * n[0]


class Plane(NamedTuple):
    """A contact in a plane.

    Attributes
    ----------
    parts : tuple of int
        Its components among the contacts: two in a plane, three of a face.
    axes : tuple of Expr
        The diagonal of A.
    static, kinetic : Expr
        Threshold of abs(A⁻¹λ), and its value in slip.
    pull : tuple of Expr
        Of coordinates without mass, the vector along which they slip, a function of the state:
        what acts against the friction, A⁻¹F. Empty of those with mass, which slip along Au.
    bends : bool
        Whether the response of Au is not linear in the direction: of a formula, and where its
        friction may change the normal force that presses it.
    formula : ConvexFormula or None
        R, in parts of the thresholds, of what has the dissipation s R(Au); A makes of the rate at
        which a face turns a velocity like the others.
    slope : tuple of Expr
        What a unit of the threshold has as friction against a slip along the direction n, whose
        components are the symbols ``n:i``: A n, or A ∇R(n).
    pieces : tuple of (Expr, Expr)
        Kinks between pieces of ∇R, and the same functions of the direction.
    unit : Expr
        What is called speed, of a unit vector: R(n) of a formula.
    """

    parts: tuple[int, ...]
    axes: tuple[Expr, ...]
    static: Expr
    kinetic: Expr
    pull: tuple[Expr, ...] = ()
    bends: bool = False
    formula: ConvexFormula | None = None
    slope: tuple[Expr, ...] = ()
    pieces: tuple[tuple[Expr, Expr], ...] = ()
    unit: Expr = ex.ONE

    @property
    def idle(self) -> tuple[Expr, ...]:
        """What stands for the direction where nothing slips: zero; of a formula, which has no
        gradient at 0, a direction in which all its pieces have one, as those of a disc have where
        its rim is at rest."""
        if self.formula is None:
            return (ex.ZERO,) * len(self.parts)
        if len(self.parts) == 2:
            return (ex.ONE, ex.ZERO)
        return (ex.num(0.5**0.5), ex.ZERO, ex.num(0.5**0.5))

    def bounds(self, i: int) -> tuple[Expr, Expr]:
        """The largest force of a component against a slip forward, and back."""
        if self.formula is None:
            return self.static * self.axes[i], self.static * self.axes[i]
        names = self.formula.names
        along = [
            {x: ex.num(float(side * (j == i))) for j, x in enumerate(names)} for side in (1, -1)
        ]
        R = [ex.substitute(self.formula.value, v, undefined=True) for v in along]
        return self.static * self.axes[i] * R[0], self.static * self.axes[i] * R[1]

    def scaled(self, forces: Sequence[Expr]) -> Expr:
        """abs(A⁻¹λ)² of forces λ."""
        return ex.add(*(((f / a) ** 2, 1.0) for f, a in zip(forces, self.axes, strict=True)))

    def admissible(self, forces: Sequence[Expr]) -> Expr:
        """s² − abs(A⁻¹λ)², not negative where forces λ can be held; of a formula, which says that
        for each direction alone (:meth:`room_along`), s²."""
        square = self.static**2
        return square - self.scaled(forces) if self.formula is None else square

    def room_along(self, forces: Sequence[Expr], way: Sequence[Expr]) -> Expr:
        """s R(w) + A⁻¹λ·w of a formula, not negative for any w where forces λ can be held."""
        assert self.formula is not None
        R = ex.substitute(self.formula.value, dict(zip(self.formula.names, way, strict=True)))
        parts = zip(forces, self.axes, way, strict=True)
        return ex.add((self.static * R, 1.0), *((f / a * w, 1.0) for f, a, w in parts))


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
    mass, damping : dict of (int, int) to Expr
        M(q, t) of the inertial and C of the viscous coordinates without a drag: the entries that
        there are, row by row.
    implicit : dict of str to Expr
        By viscous coordinate with a drag, what its rate is the zero of.
    laws : list of Expr
    rate : RateProblem
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
        """All that the motion depends on."""
        found = [*self.inertial_force, *self.viscous_force, *self.laws, *self.rate.force]
        found += self.implicit.values()
        found += self.inertia
        found += _formulas_of(self.jumps)
        for c in self.contacts:
            found += [c.plus, c.minus, c.kinetic_plus, c.kinetic_minus, c.speed]
        return found

    @property
    def inertia(self) -> list[Expr]:
        """Entries of the mass matrix, coefficients of directions, and gaps, that change on the
        way."""
        held = frozenset(self.declaration.parameters)
        entries = [*self.mass.values(), *(j for c in self.contacts for j in c.direction.values())]
        entries += [c.gap for c in self.contacts if c.gap is not None]
        return [e for e in dict.fromkeys(entries) if not e.symbols <= held]

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """What contacts were declared as: both components of one in a plane have one name, and
        sides of constraints none."""
        return tuple("" if c.side_of else c.name.removesuffix(f" {c.plane}") for c in self.contacts)

    @cached_property
    def numbers(self) -> dict[str, int]:
        """The number of each contact by its name, and by those of what it was declared as."""
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
        return _pressing(self.contacts, i)

    def rubs_alone(self, i: int) -> bool:
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
        return bool(pressing) and opened and not self.rubs_alone(i)

    @cached_property
    def sharing(self) -> dict[int, int]:
        """Of contacts with mass that may hold the same coordinates, with friction in a plane, which
        such group each belongs to: their directions may depend on each other. What has a formula
        is in a group, too, alone or not: how long it holds is asked of its support function."""
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
        """What J a is in stick: ẇ − J̇ q̇."""
        c = self.contacts[i]
        rates = {"t": ex.ONE, **{q: ex.sym(f"d_{q}") for q in self.declaration.inertial}}
        turning = [(ex.along(j, rates), ex.sym(f"d_{x}")) for x, j in c.direction.items()]
        carried = [(slope * rate, -1.0) for slope, rate in turning if slope is not ex.ZERO]
        return ex.add((ex.along(c.speed, rates), 1.0), *carried)

    def acting(self, zero: frozenset[str]) -> list[bool]:
        """Which frequencies are felt where some parameters are zero: the amplitude of a drive may
        be one of them."""
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


def _equations_of(d: Declaration) -> MotionEquations:
    own = {r: i for i, r in enumerate(d.rate_independent)}
    contacts = sorted(
        d.contacts, key=lambda c: (_KINDS.index(c.kind), own.get(next(iter(c.direction), ""), 0))
    )
    groups = one_by_direction(contacts, frozenset(d.parameters))
    normals = {c.name: (i, _share(c, own)) for i, own in enumerate(groups) for c in own if c.opens}
    glued = [i for i, own in enumerate(groups) if own[0].opens and own[0].plus is not ex.ZERO]
    members = [tuple(_named(c, i, normals, glued) for c in own) for i, own in enumerate(groups)]
    contacts = [_sum_of(own) for own in members]
    planes = _planes(contacts)
    for plane in planes:
        for i, axis in zip(plane.parts, plane.axes, strict=True):
            contacts[i] = replace(_component(contacts[i], i, plane), axis=axis)
    planes = _pressed(d, contacts, planes)
    slope = {x: ex.derivative(d.potential, x) - d.forces[x] for x in d.coordinates}
    by_inertial, by_all = _damping(d, d.inertial), _damping(d, [*d.inertial, *d.viscous])
    viscous_force = [-slope[z] - by_inertial.get(z, ex.ZERO) for z in d.viscous]
    inertial_force = [
        -slope[q] - d.drags[q] - by_all.get(q, ex.ZERO) + d.velocity_force(q) for q in d.inertial
    ]
    for i in glued:
        for q, weight in contacts[i].direction.items():
            inertial_force[d.inertial.index(q)] -= weight * ex.sym(f"glue:{i}")
    force_of = dict(zip(d.viscous, viscous_force, strict=True))
    implicit = {z: d.resistance(z) - force_of[z] for z in d.resisted}
    laws = [d.laws[a] for a in d.internal]
    energy, dissipation, supply = _powers(d, contacts)
    rate = _rate_problem(d, contacts, slope)
    planes = [plane._replace(pull=_pull(d, contacts, plane, rate, force_of)) for plane in planes]
    used = [
        *inertial_force,
        *viscous_force,
        *implicit.values(),
        *laws,
        *rate.rest,
        *rate.force,
        *(r for row in rate.stiffness for r in row),
    ]
    held = frozenset(d.parameters)
    used += [e for e in d.mass.values() if not e.symbols <= held]
    for c in contacts:
        used += [c.plus, c.minus, c.kinetic_plus, c.kinetic_minus, c.speed]
        # The law at rest says whether sliding forces are admissible.
        at_rest = {f"speed:{i}": ex.ZERO for i in range(len(contacts))}
        forces = (c.kinetic_plus, c.kinetic_minus)
        used += [ex.substitute(force, at_rest, undefined=True) for force in forces]
        used += [j for j in c.direction.values() if not j.symbols <= held]
        used += [c.gap] if c.gap is not None else []
    used += [c.sense for own in members for c in own]
    used += _formulas_of(d.jumps)
    felt = list(used)
    used += [energy, dissipation, supply, *d.mass.values(), *d.damping.values()]
    used += [e for plane in planes for e in (plane.unit, *plane.slope)]
    used += [e for c in contacts for e in (*c.direction.values(), c.axis, c.restitution)]
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
        mass=_matrix(d.mass, d.inertial),
        damping=_matrix(d.damping, d.damped),
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
    totals = zip(*(_seen_from_first(c) for c in own), strict=True)
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
    """What each of several floors that are one has of the normal force: the least forces with that
    sum."""
    return c.ratio / ex.add(*((other.ratio**2, 1.0) for other in own))


def _seen_from_first(c: DryContact) -> tuple[Expr, Expr, Expr, Expr]:
    """Thresholds and sliding forces of a contact, as forces along the direction that its own is a
    multiple of. What acts backward there acts forward here if the factor is negative."""
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


def _planes(contacts: list[DryContact]) -> list[Plane]:
    """Contacts in a plane, from their components."""
    found = list[Plane]()
    for c in contacts:
        if c.plane != 1:
            continue
        stem = c.name.removesuffix("1")
        own = {
            other.plane: k
            for k, other in enumerate(contacts)
            if other.plane and other.name == f"{stem}{other.plane}"
        }
        parts = tuple(own[k] for k in sorted(own))
        axes = tuple(contacts[part].axis for part in parts)
        plane = Plane(parts, axes, c.plus, c.kinetic_plus)
        n = [ex.sym(f"n:{part}") for part in parts]
        slope = tuple(axis * x for axis, x in zip(axes, n, strict=True))
        pieces: tuple[tuple[Expr, Expr], ...] = ()
        unit = ex.ONE
        if c.dissipation is not None:
            from stickslip.convex.smooth import evened, gradient_along

            formula, axes = evened(c.dissipation)
            u = [a * relative_velocity(contacts[p]) for a, p in zip(axes, parts, strict=True)]
            slopes, pieces, unit = gradient_along(formula, n, u)
            slope = tuple(a * e for a, e in zip(axes, slopes, strict=True))
            plane = plane._replace(axes=axes, formula=formula)
        found.append(plane._replace(slope=slope, pieces=pieces, unit=unit))
    return found


def relative_velocity(c: DryContact) -> Expr:
    """The relative velocity of a contact, Σ jₓ ẋ − w."""
    moved = ((j * ex.sym(f"d_{x}"), 1.0) for x, j in c.direction.items())
    return ex.add(*moved, (c.speed, -1.0))


def _pressing(contacts: list[DryContact], i: int) -> list[int]:
    c = contacts[i]
    names = c.plus.symbols | c.minus.symbols | c.kinetic_plus.symbols | c.kinetic_minus.symbols
    if c.prescribed:
        return []  # it has no part in the problem for normal forces
    normals = [j for j, other in enumerate(contacts) if other.opens]
    return [j for j in normals if f"lambda:{j}" in names]


def _pressed(d: Declaration, contacts: list[DryContact], planes: list[Plane]) -> list[Plane]:
    """Note which friction in a plane may change a normal force that it depends on, or that another
    depends on: masses, or contacts, join a plane and the normal direction.

    Raises
    ------
    DeclarationError
        If the law does not tell the normal force that presses one of them.
    """
    acting = [c for c in contacts if c.kind == Kind.INERTIAL]
    parts = [i for plane in planes for i in plane.parts]
    links = [(i, n) for i in range(len(acting)) if i not in parts for n in _pressing(contacts, i)]
    place = {q: i for i, q in enumerate(d.inertial)}
    entries = _matrix(d.mass, d.inertial)
    moved = [[place[q] for q in c.direction] for c in acting]
    joined = components(len(place), entries, 0, moved, links)
    home = {c: k for k, part in enumerate(joined) for c in part.contacts}
    rubbed = {home.get(plane.parts[0]) for plane in planes}
    opening = [[i for i in part.contacts if contacts[i].opens] for part in joined]
    shared = set[int]().union(*(_dependent(own, contacts) for own in opening if planes))
    found = list[Plane]()
    for plane in planes:
        normals = _pressing(contacts, plane.parts[0])
        bends = any(home[n] in rubbed for n in normals)
        others = [
            o for o in planes if o is not plane and home.get(o.parts[0]) == home.get(plane.parts[0])
        ]
        if plane.parts[0] not in home:  # between motions that are given
            found.append(plane)
            continue
        if plane.formula is not None:
            _check_turning(d, contacts, plane, joined[home[plane.parts[0]]])
        if plane.formula is not None and others:
            name, beside = (
                contacts[q.parts[0]].name.removesuffix(" 1") for q in (plane, others[0])
            )
            raise DeclarationError(
                f"contacts.'{name}'",
                f"it has a dissipation of its own, beside the friction of '{beside}' in a plane "
                "on the same body",
                "Let one contact of the body rub in a plane",
            )
        if bends and (unknown := [contacts[n].name for n in normals if n in shared]):
            raise DeclarationError(
                f"contacts.'{contacts[plane.parts[0]].name.removesuffix(' 1')}'",
                f"its friction changes {unknown[0]}, which it depends on, and no law tells how the "
                "body shares its weight: the normal directions of its contacts depend on each "
                "other",
                "Let it stand on three feet, or give the normal forces as formulas of time and "
                "state",
            )
        found.append(plane._replace(bends=bends or plane.formula is not None))
    return found


def _check_turning(
    d: Declaration, contacts: list[DryContact], plane: Plane, part: Component
) -> None:
    """Refuse a contact with a formula on a body that more contacts hold than it has freedoms, if
    their directions turn: then nothing says how long it holds."""
    closed = [c for c in part.contacts if not contacts[c].opens]
    held = frozenset(d.parameters)
    turning = any(not j.symbols <= held for c in closed for j in contacts[c].direction.values())
    if turning and len(closed) > len(part.coordinates):
        raise DeclarationError(
            f"contacts.'{contacts[plane.parts[0]].name.removesuffix(' 1')}'",
            f"it has a dissipation of its own, and {len(closed)} directions that turn hold "
            f"{len(part.coordinates)} coordinates",
            "Let as many directions hold a body as it has freedoms",
        )


def _dependent(normals: list[int], contacts: list[DryContact]) -> set[int]:
    """Those of the normal forces of a body that its motion does not tell, where all are at work.

    Their directions depend on those of others, and so do their gaps, or they are not closed at the
    same time: a floor and a ceiling are not. Both are looked at in one point, which is nothing
    special; both sides of a constraint are one.
    """
    sides = {contacts[n].side_of or contacts[n].name: n for n in reversed(normals)}
    closed = list(sides.values())
    names = sorted({q for n in closed for q in contacts[n].direction})
    if len(closed) < 2:
        return set()
    table = [
        [*(contacts[n].direction.get(q, ex.ZERO) for q in names), contacts[n].gap or ex.ZERO]
        for n in closed
    ]
    J = np.array(somewhere(table))
    J /= np.linalg.norm(J, axis=1)[:, None]
    rank = np.linalg.matrix_rank(J)
    rest = (np.delete(J, i, axis=0) for i in range(len(J)))
    among = {
        contacts[n].side_of or contacts[n].name
        for n, others in zip(closed, rest, strict=True)
        if np.linalg.matrix_rank(others) == rank
    }
    return {n for n in normals if (contacts[n].side_of or contacts[n].name) in among}


def _pull(
    d: Declaration,
    contacts: list[DryContact],
    plane: Plane,
    rate: RateProblem,
    force_of: dict[str, Expr],
) -> tuple[Expr, ...]:
    """What acts against the friction of a contact in a plane of coordinates without mass.

    Of rate-independent ones it is −λ. Of viscous ones u = g (F + λ), with the force F that holds
    them in stick, if the resistance 1/g is the same in all directions: then they slip along F.

    Raises
    ------
    DeclarationError
        If the viscosity is not that of single coordinates, the same in both directions.
    """
    own = [contacts[i] for i in plane.parts]
    if own[0].kind == Kind.INERTIAL or own[0].prescribed:
        return ()
    if own[0].kind == Kind.RATE_INDEPENDENT:
        first = len(contacts) - len(rate.force)
        forces = [rate.force[i - first] for i in plane.parts]
        return tuple(-f / a for f, a in zip(forces, plane.axes, strict=True))
    found = list[Expr]()
    resistance = list[Expr]()
    for c, axis in zip(own, plane.axes, strict=True):
        (z, weight), *others = c.direction.items()
        shared = [other for other in contacts if z in other.direction and other is not c]
        coupled = [y for (x, y) in d.damping if x == z and y != z]
        if others or shared or coupled:
            raise DeclarationError(
                f"contacts.'{c.name.removesuffix(str(c.plane)).rstrip()}'",
                f"without mass, it slips along forces, and '{z}' has others that share its rate",
                "Let each component move one viscous coordinate with a viscosity and no contact of "
                "its own, or declare the coordinates inertial",
            )
        damping = d.damping[z, z]
        found.append((force_of[z] / weight - damping * c.speed / weight**2) / axis)
        resistance.append(damping / (weight * axis) ** 2)
    if resistance[0] is not resistance[1] and not _equal(*resistance):
        raise DeclarationError(
            f"contacts.'{own[0].name.removesuffix('1').rstrip()}'",
            "the viscosity of its components is not the same, so that it does not slip along the "
            "force",
            "Give both coordinates the same viscosity (in parts of the squares of axes), or "
            "declare them inertial",
        )
    return tuple(found)


def _equal(a: Expr, b: Expr) -> bool:
    """Whether two expressions of parameters are the same."""
    return ex.add((a, 1.0), (b, -1.0)) is ex.ZERO


def _component(c: DryContact, i: int, plane: Plane) -> DryContact:
    """A component of a contact in a plane, with its part of the forces."""
    k = plane.parts.index(i)
    plus, minus = plane.bounds(k)
    kinetic = plane.kinetic * plane.slope[k]
    return replace(c, plus=plus, minus=minus, kinetic_plus=kinetic, kinetic_minus=kinetic)


def _damping(d: Declaration, others: list[str]) -> dict[str, Expr]:
    """Viscous forces by coordinate, as far as they come from the rates of some coordinates."""
    felt = frozenset(others)
    found: dict[str, list[tuple[Expr, float]]] = {}
    for (x, y), entry in d.damping.items():
        if y in felt:
            found.setdefault(x, []).append((entry * ex.sym(f"d_{y}"), 1.0))
    return {x: ex.add(*terms) for x, terms in found.items()}


def _matrix(entries: dict[tuple[str, str], Expr], names: list[str]) -> dict[tuple[int, int], Expr]:
    place = {x: i for i, x in enumerate(names)}
    found = {(place[x], place[y]): e for (x, y), e in entries.items() if x in place and y in place}
    return dict(sorted(found.items(), key=lambda item: item[0]))


def _rate_problem(
    d: Declaration, contacts: list[DryContact], slope: dict[str, Expr]
) -> RateProblem:
    acting = [c for c in contacts if c.kind == Kind.RATE_INDEPENDENT]
    names = d.rate_independent
    weight = [c.direction[r] for c, r in zip(acting, names, strict=True)]
    force = [slope[r] / j for r, j in zip(names, weight, strict=True)]
    rates = {
        "t": ex.ONE,
        **{x: ex.sym(f"d_{x}") for x in d.coordinates},
        **{a: d.laws[a] for a in d.internal},
    }

    def split(e: Expr, where: str) -> tuple[list[Expr], Expr]:
        if any(f"d_{q}" in e.symbols for q in d.inertial):
            raise DeclarationError(
                where,
                "a force on a rate-independent coordinate depends on a velocity",
                "Let it depend on t, coordinates and internal variables",
            )
        total = ex.along(e, rates)
        linear = [ex.derivative(total, f"d_{r}") for r in names]
        own = {f"d_{r}" for r in names}
        if any(part.symbols & own for part in linear) or ex.bends(total, own):
            raise DeclarationError(
                where,
                "its rate is not linear in the rates of the rate-independent coordinates",
                "Let internal laws depend on them linearly",
            )
        return linear, ex.substitute(total, {r: ex.ZERO for r in own})

    def rows(expressions: list[Expr]) -> tuple[list[list[Expr]], list[Expr]]:
        pairs = [split(e, f"contacts.'{c.name}'") for e, c in zip(expressions, acting, strict=True)]
        return [p[0] for p in pairs], [p[1] for p in pairs]

    def partials(expressions: list[Expr]) -> list[list[Expr]]:
        return [[ex.derivative(e, r) for r in names] for e in expressions]

    stiffness, rest = rows(force)
    plus, minus = [c.plus for c in acting], [c.minus for c in acting]
    (slope_plus, rest_plus), (slope_minus, rest_minus) = rows(plus), rows(minus)
    return RateProblem(
        weight,
        force,
        stiffness,
        rest,
        (slope_plus, slope_minus),
        (rest_plus, rest_minus),
        partials(force),
        (partials(plus), partials(minus)),
    )


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
