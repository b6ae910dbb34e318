"""Reading the contacts of a declaration: directions, thresholds and kinetic friction forces of
contacts along a line, in a plane, of faces, and of contacts that can open."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, cast

from stickslip.errors import DeclarationError, short
from stickslip.model.declaration import DryContact
from stickslip.model.entries.checks import (
    are_dependent,
    are_parallel,
    check_components,
    check_line,
    check_slopes,
    size_of_terms,
)
from stickslip.model.entries.declared import Kind
from stickslip.model.entries.keys import JOINED, normal_force
from stickslip.model.entries.units import check_unit
from stickslip.model.formats.expected import PLANAR, entry_key
from stickslip.model.names import parse_range
from stickslip.model.system import Contact, Side, Unilateral
from stickslip.numerics.levels import BODIES_OVERLAP, COMPUTED_ZERO, TINIEST
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import Scope

if TYPE_CHECKING:
    from stickslip.convex.formula import ConvexFormula
    from stickslip.model.reading import DeclarationReader

_REMEDY = "A threshold must not be negative; write max(..., 0) around its formula"
_VELOCITIES = ("v1", "v2", "v3")  # names of the velocities in a dissipation
_NUMBERS = {2: "two", 3: "three"}
_SMALL_GAP = 1e-3  # smallest scale of a gap, as a fraction of the largest coordinate
_LARGEST_THRESHOLD = "[-inf, 1e150]"  # in a plane, where thresholds are squared


def read_contacts(reader: DeclarationReader) -> list[DryContact]:
    """Read and check the contacts of a declaration."""
    return _Contacts(reader).read()


class _Contacts:
    """Reads the contacts of one declaration.

    Its scopes contain the names that are allowed in directions (`directions`), thresholds
    (`pressed`), kinetic forces (`sliding`) and surface speeds (`surface`).
    """

    def __init__(self, reader: DeclarationReader) -> None:
        self.reader = reader
        self.system, self.result = reader.system, reader.result
        self.directions = reader.scope(
            reader.inertia,
            reader.rates,
            why="The coefficients of a direction may depend on t, inertial coordinates and "
            "parameters",
        )
        self.normals = {
            normal_force(name): ex.sym(normal_force(name)) for name in self.system.with_gaps
        }
        # The normal force of a constraint is the sum of those of its two sides, one of which is 0.
        for name, sides in self.system.constraints.items():
            own = [(self.normals[normal_force(side)], 1.0) for side in sides]
            self.normals[normal_force(name)] = ex.add(*own)
        self.pressed = reader.scope(
            reader.state,
            reader.velocities,
            self.normals,
            why="Use rates of inertial coordinates only",
        )
        self.sliding = reader.scope(
            reader.state,
            reader.velocities,
            self.normals,
            {"speed": ex.sym("speed")},
            why="Use 'speed' for |u|",
        )
        self.surface = reader.scope(
            reader.inertia,
            why="A surface speed may depend on t, inertial coordinates and parameters",
        )
        self.order = {f"d_{x}": i for i, x in enumerate(self.result.coordinates)}

    def read(self) -> list[DryContact]:
        """All contacts, in the order of their declaration."""
        found = list[DryContact]()
        for name, contact in self.system.plain.contacts.items():
            if JOINED in name:
                raise DeclarationError(
                    entry_key("contacts", name),
                    f"'{JOINED}' is reserved for contacts that share a direction",
                    "Choose another name",
                )
            if isinstance(contact, Unilateral):
                found += self._unilateral(name, contact)
            else:
                found += self._dry(name, cast("Contact", contact))
        self._check_rate_independent(found)
        return found

    def _check_rate_independent(self, contacts: list[DryContact]) -> None:
        """Reject rate-independent coordinates with no contact, or with several."""
        contacts_of = {r: list[str]() for r in self.result.rate_independent}
        for c in contacts:
            for x in c.direction.keys() & contacts_of.keys():
                contacts_of[x].append(c.name)
        for r, acting in contacts_of.items():
            if not acting:
                raise DeclarationError(
                    f"coordinates.{r}",
                    "a rate-independent coordinate needs dry friction",
                    f"Add a contact with direction 'd_{r}'",
                )
            if len(acting) > 1:
                raise DeclarationError(
                    entry_key("contacts", acting[1]),
                    f"'{r}' already has the contact '{short(acting[0])}'",
                    "Combine them into one contact, with the sum of the thresholds",
                )

    def _unilateral(self, name: str, contact: Unilateral) -> list[DryContact]:
        """The normal direction of a contact that can open, and its friction."""
        where = entry_key("contacts", name)
        gap, direction = self._gap(where, contact)
        restitution = self._bounded(contact.restitution, f"{where}.restitution", "[0, 1]")
        tangential = self._bounded(
            contact.tangential_restitution, f"{where}.tangential_restitution", "[0, 1]"
        )
        check_unit(contact.unit, f"{where}.unit")
        self._check_overlap(where, contact, gap)
        adhesion = self.reader.motion.parse(contact.adhesion, f"{where}.adhesion")
        remedy = (
            "Adhesion is the largest tensile force and must not be negative; write max(..., 0) "
            "around its formula"
        )
        self._check_threshold(adhesion, f"{where}.adhesion", remedy)
        normal = DryContact(
            normal_force(name),
            Kind.INERTIAL,
            direction,
            adhesion,
            ex.ZERO,
            ex.ZERO,
            ex.ZERO,
            -ex.derivative(gap, "t"),
            contact.unit,
            gap=gap,
            restitution=restitution,
            side_of=contact.of if isinstance(contact, Side) else "",
        )
        return [normal, *self._friction_of(name, contact, tangential)]

    def _gap(self, where: str, contact: Unilateral) -> tuple[Expr, dict[str, Expr]]:
        """The gap, and its derivatives with respect to the coordinates that it depends on."""
        gaps = self.reader.scope(
            self.reader.inertia, why="A gap may depend on t, inertial coordinates and parameters"
        )
        gap = gaps.parse(contact.gap, f"{where}.gap")
        check_slopes(gap, self.reader.inertia, f"{where}.gap", 3)
        self.reader.check_steps(f"{where}.gap", gap)
        slopes = {q: ex.derivative(gap, q) for q in self.result.inertial}
        direction = {q: slope for q, slope in slopes.items() if slope is not ex.ZERO}
        if not direction:
            raise DeclarationError(
                f"{where}.gap",
                "it does not depend on an inertial coordinate",
                "Write the distance, such as 'y' or 'y - l*sin(phi)'",
            )
        return gap, direction

    def _bounded(self, given: object, where: str, interval: str) -> Expr:
        """A formula of parameters whose values are in an interval, such as ``"[0, 1]"``."""
        formula = self.reader.static.parse(given, where)
        self._limit(formula, where, interval)
        return formula

    def _limit(self, formula: Expr, where: str, interval: str) -> None:
        """Reject values outside an interval, also if parameters change later."""
        limits = parse_range(interval, where)
        limits.check(ex.evaluate(formula, self.system.values), where)
        self.result.limits.append((where, formula, limits))

    def _check_overlap(self, where: str, contact: Unilateral, gap: Expr) -> None:
        """Reject bodies that overlap at the initial state; violations of constraints are checked at
        the start of a motion."""
        here = ex.evaluate(gap, self.reader.start)
        others = [c.gap for c in self.system.plain.contacts.values() if isinstance(c, Unilateral)]
        if any(f"-{contact.gap}" == g or contact.gap == f"-{g}" for g in others):
            return  # both sides of a constraint
        # If all terms of the gap are small, the largest coordinate sets the scale, so that rounding
        # errors of the state are not regarded as an overlap.
        largest = max(abs(self.reader.start[q]) for q in self.result.inertial)
        size = max(size_of_terms(gap, self.reader.start), _SMALL_GAP * largest, TINIEST)
        if here < -BODIES_OVERLAP * size:
            raise DeclarationError(
                f"{where}.gap",
                f"the gap is {here:g} at the initial state: the bodies overlap",
                "Choose initial values with a positive gap, or zero for contact",
            )

    def _friction_of(self, name: str, contact: Unilateral, restitution: Expr) -> list[DryContact]:
        """The friction of a contact that can open: coefficients times its normal force."""
        where = entry_key("contacts", name)
        mu = self.reader.motion.parse(contact.mu, f"{where}.mu")
        at_start = ex.evaluate(mu, self.reader.start)
        if not at_start >= 0.0:
            raise DeclarationError(
                f"{where}.mu",
                f"the coefficient of friction is {at_start:g} at the initial state",
                "It must not be negative",
            )
        if not contact.direction:
            if mu is not ex.ZERO:
                raise DeclarationError(
                    f"{where}.direction",
                    "the direction of friction is missing",
                    "Give the relative velocity, like direction = 'd_x'",
                )
            return []
        coefficients = replace(
            contact.friction(name), threshold=contact.mu, kinetic=contact.kinetic
        )
        rubs = self._dry(name, coefficients)
        if rubs[0].direction and rubs[0].kind != Kind.INERTIAL:
            raise DeclarationError(
                f"{where}.direction",
                f"its coordinates are {rubs[0].kind}",
                "A contact with a gap needs inertial coordinates",
            )
        normal = ex.sym(normal_force(name))
        return [
            replace(
                part,
                plus=part.plus * normal,
                minus=part.minus * normal,
                kinetic_plus=part.kinetic_plus * normal,
                kinetic_minus=part.kinetic_minus * normal,
                on=normal_force(name),
                restitution=restitution,
            )
            for part in rubs
        ]

    def _dry(self, name: str, contact: Contact) -> list[DryContact]:
        """A contact along a line, or the components of a contact in a plane or of a face."""
        where = entry_key("contacts", name)
        if contact.threshold == "":
            raise DeclarationError(
                f"{where}.threshold",
                "this key is missing",
                'Add the largest friction force, like threshold = "mu*m*g"',
            )
        if isinstance(contact.direction, str):
            check_line(where, contact)
            return [self._contact(name, contact)]
        count = len(contact.direction)
        check_components(where, contact, count)
        lengths = contact.axes if len(contact.axes) == count else (1.0,) * count
        axes = [self._bounded(axis, f"{where}.axes", "(0, inf)") for axis in lengths]
        formula = None
        if contact.dissipation is not None or count == 3:
            formula = self._dissipation(where, contact, axes)
            axes = [ex.ONE] * count  # the formula contains them
        parts = contact.components(name)
        for label in parts:
            if label in self.system.contacts:
                raise DeclarationError(
                    where,
                    f"its components need the name '{label}', which is already used",
                    "Rename one of them",
                )
        found = [
            replace(self._contact(label, part, name), plane=i, axis=axis, dissipation=formula)
            for i, ((label, part), axis) in enumerate(zip(parts.items(), axes, strict=True), 1)
        ]
        self._check_plane(where, found)
        if formula is not None:
            self._check_formula(where, found[0])
        return found

    def _dissipation(self, where: str, contact: Contact, axes: list[Expr]) -> ConvexFormula:
        """The dissipation of a contact in a plane or of a face, given by a formula or by axes."""
        from stickslip.convex.faces import mean_speeds, norms_instead
        from stickslip.convex.smooth import smooth_dissipation

        key = f"{where}.dissipation"
        names = _VELOCITIES[: len(axes)]
        velocities = {x: ex.sym(x) for x in names}
        if contact.dissipation is None:
            # R(v) = |A v| with the semi-axes A, so the limit surface is an ellipsoid.
            parts = zip(axes, velocities.values(), strict=True)
            squares = ((a * a * v * v, 1.0) for a, v in parts)
            value = ex.power(ex.add(*squares), ex.num(0.5))
            found = smooth_dissipation(value, names, self.system.values, f"{where}.axes")
            self.result.dissipations.append((f"{where}.axes", found, None))
            return found
        if contact.axes != (1.0, 1.0):
            raise DeclarationError(
                f"{where}.axes",
                "'axes' and 'dissipation' both define how friction depends on the direction",
                "Remove one of them",
            )
        taken = [x for x in names if x in self.reader.constants]
        if taken:
            raise DeclarationError(
                key,
                f"'{taken[0]}' is both a component of the relative velocity and a parameter",
                "Rename the parameter",
            )
        why = f"A dissipation may depend on {', '.join(names)} and parameters"
        scope = self.reader.scope(velocities, why=why)
        # A formula with mean speeds of discs and rings is convex if the same formula with norms in
        # their place is (`convex.faces`).
        value, like = (
            replace(scope, definitions={**own, **scope.definitions}).parse(contact.dissipation, key)
            for own in (mean_speeds(), norms_instead())
        )
        substitute = None if like is value else like
        found = smooth_dissipation(value, names, self.system.values, key, substitute)
        self.result.dissipations.append((key, found, substitute))
        return found

    def _check_formula(self, where: str, part: DryContact) -> None:
        """Reject a dissipation formula of a contact for which motions do not support one."""
        if part.kind != Kind.INERTIAL and not part.prescribed:
            raise DeclarationError(
                f"{where}.dissipation",
                f"its coordinates are {part.kind}",
                "Declare them inertial; for an evolution without mass use a SupportFormula",
            )
        pressed = (part.plus.symbols | part.kinetic_plus.symbols) & self.normals.keys()
        if pressed:
            raise DeclarationError(
                f"{where}.threshold",
                f"it depends on {min(pressed)}, which a contact with a dissipation does not "
                "support",
                "Give the normal force as a formula of time and state, or remove the dissipation",
            )

    def _check_plane(self, where: str, parts: list[DryContact]) -> None:
        """Reject components of different kinds or along one line, and thresholds whose squares
        overflow."""
        for threshold in dict.fromkeys((parts[0].plus, parts[0].kinetic_plus)):
            if threshold.symbols <= self.system.parameters.keys():
                self._limit(threshold, f"{where}.threshold", _LARGEST_THRESHOLD)
        first, *others = parts
        if any(first.prescribed != other.prescribed for other in others):
            raise DeclarationError(
                f"{where}.direction",
                "one of its components contains no rate",
                "Give two independent combinations of rates, like ['d_x', 'd_y'], or no rates "
                "at all if the motion of both surfaces is prescribed",
            )
        if first.prescribed and all(part.speed is ex.ZERO for part in parts):
            raise DeclarationError(
                f"{where}.direction",
                "the direction is zero, and so is the surface speed",
                "Write it like ['d_x', 'd_y']",
            )
        if kinds := [other.kind for other in others if other.kind != first.kind]:
            raise DeclarationError(
                f"{where}.direction",
                f"its components are {first.kind} and {kinds[0]}",
                "Declare all coordinates of one contact with the same kind",
            )
        pairs = [(a, b) for i, a in enumerate(parts) for b in parts[i + 1 :]]
        if not first.prescribed and any(are_parallel(a.direction, b.direction) for a, b in pairs):
            raise DeclarationError(
                f"{where}.direction",
                f"{'both' if len(parts) == 2 else 'two'} of its components are parallel",
                f"Give {_NUMBERS[len(parts)]} independent combinations of rates, like "
                f"{['d_x', 'd_y', 'd_phi'][: len(parts)]}, or fewer",
            )
        if (
            len(parts) > 2
            and not first.prescribed
            and are_dependent([part.direction for part in parts])
        ):
            raise DeclarationError(
                f"{where}.direction",
                "one of its components is a linear combination of the others",
                "Give independent combinations of rates, like ['d_x', 'd_y', 'd_phi']",
            )

    def _contact(self, name: str, contact: Contact, declared: str = "") -> DryContact:
        """A contact along a line, or one component of a declared contact."""
        where = entry_key("contacts", declared or name)
        velocity = self.directions.parse(contact.direction, f"{where}.direction")
        rates = sorted(velocity.symbols & self.order.keys(), key=self.order.__getitem__)
        slopes = {rate[2:]: ex.derivative(velocity, rate) for rate in rates}
        direction = {x: c for x, c in slopes.items() if c is not ex.ZERO}
        if not rates and velocity.symbols <= {"t", *self.reader.constants}:
            return self._prescribed(name, contact, velocity, declared)
        linear = ex.add(*((c * self.reader.rates[f"d_{x}"], 1.0) for x, c in direction.items()))
        curved = any(c.symbols & self.reader.rates.keys() for c in direction.values())
        if not direction or curved or ex.bends(velocity, self.reader.rates):
            raise DeclarationError(
                f"{where}.direction",
                "not a linear combination of rates",
                PLANAR if len(direction) > 1 else "Write it like 'd_x' or 'd_x2 - d_x1'",
            )
        rest = ex.substitute(velocity, {f"d_{x}": ex.ZERO for x in direction})
        if rest is not ex.ZERO and ex.add((velocity, 1.0), (linear, -1.0)) is not ex.ZERO:
            raise DeclarationError(
                f"{where}.direction",
                f"it contains the constant {short(repr(rest))}",
                "Move it to 'surface_speed'",
            )
        kinds = {self.system.coordinates[x].kind for x in direction}
        if len(kinds) > 1:
            raise DeclarationError(
                f"{where}.direction",
                f"it combines {' and '.join(sorted(kinds))} coordinates",
                "Declare all coordinates of one contact with the same kind",
            )
        kind = kinds.pop()
        varying = sorted(
            {name for c in direction.values() for name in c.symbols & self.reader.inertia.keys()}
        )
        if varying and kind != Kind.INERTIAL:
            raise DeclarationError(
                f"{where}.direction",
                f"its coefficients depend on {varying[0]}, but its coordinates are {kind}",
                "Use constant coefficients, or declare the coordinates inertial",
            )
        if varying:
            names = [*self.reader.inertia, *self.reader.rates]
            check_slopes(velocity, names, f"{where}.direction", 2)
            self.reader.check_steps(f"{where}.direction", velocity)
        resisted = direction.keys() & set(self.result.resisted)
        if resisted:
            raise DeclarationError(
                f"{where}.direction",
                f"'{min(resisted)}' has a drag, so a contact cannot act on its rate",
                "Include the friction in the drag, attach another coordinate by a spring, or "
                "declare the coordinate inertial",
            )
        if kind == Kind.RATE_INDEPENDENT and len(direction) > 1:
            raise DeclarationError(
                f"{where}.direction",
                "a contact of rate-independent coordinates must act on exactly one of them",
                "Use one contact per coordinate, or declare them viscous",
            )
        inertial = kind == Kind.INERTIAL
        places = self.surface if declared and inertial else self.reader.clock
        speed = places.parse(contact.surface_speed, f"{where}.surface_speed")
        forces = self._forces(where, contact, kind, in_plane=bool(declared))
        return DryContact(name, kind, direction, *forces, speed, contact.unit)

    def _prescribed(self, name: str, contact: Contact, moves: Expr, declared: str) -> DryContact:
        """Friction between prescribed motions.

        Parameters
        ----------
        name, contact, declared
            As in :meth:`_contact`.
        moves : Expr
            The velocity in its direction, a function of time.
        """
        where = entry_key("contacts", declared or name)
        places = self.surface if declared else self.reader.clock
        speed = places.parse(contact.surface_speed, f"{where}.surface_speed") - moves
        if "t" not in moves.symbols and moves is not ex.ZERO:
            raise DeclarationError(
                f"{where}.direction",
                "not a linear combination of rates",
                "Write it like 'd_x', or 'd_xi' with a drive xi, or '0' for a contact with a "
                "surface_speed only",
            )
        if speed is ex.ZERO and not declared:
            raise DeclarationError(
                f"{where}.direction",
                "the direction is zero, and so is the surface speed",
                "Write it like 'd_x' or 'd_x2 - d_x1', or give a surface_speed",
            )
        forces = self._forces(where, contact, None, in_plane=bool(declared))
        return DryContact(name, Kind.VISCOUS, {}, *forces, speed, contact.unit)

    def _forces(
        self, where: str, contact: Contact, kind: Kind | None, in_plane: bool
    ) -> tuple[Expr, Expr, Expr, Expr]:
        """Thresholds and kinetic friction forces, plus and minus, of a contact whose coordinates
        have the given kind; None if it has no coordinates."""
        pressed = self.pressed if kind in (Kind.INERTIAL, None) else self.reader.motion
        plus, minus = self._pair(contact.threshold, f"{where}.threshold", pressed)
        for e in (plus, minus):
            self._check_proportional(f"{where}.threshold", e)
        kinetic = (plus, minus)
        if contact.kinetic is not None:
            kinetic = self._pair(contact.kinetic, f"{where}.kinetic", self.sliding)
            for e in kinetic:
                self._check_proportional(f"{where}.kinetic", e)
            if kind == Kind.RATE_INDEPENDENT:
                raise DeclarationError(
                    f"{where}.kinetic",
                    "a kinetic force below the threshold needs inertia or viscosity",
                    "Declare the coordinate viscous or inertial",
                )
            if kind == Kind.VISCOUS and any("speed" in k.symbols for k in kinetic):
                raise DeclarationError(
                    f"{where}.kinetic",
                    "for viscous coordinates the kinetic force must not depend on the speed",
                    "Declare the coordinate inertial, or move the slope to 'viscous'",
                )
        self._check_pressed(where, (plus, minus, *kinetic), in_plane)
        check_unit(contact.unit, f"{where}.unit")
        values = self.reader.start
        for static, sliding_force in zip((plus, minus), kinetic, strict=True):
            self._check_threshold(static, f"{where}.threshold", _REMEDY)
            at_rest = ex.evaluate(sliding_force, values)
            if not 0.0 <= at_rest <= ex.evaluate(static, values) * (1 + COMPUTED_ZERO):
                raise DeclarationError(
                    f"{where}.kinetic",
                    f"the kinetic force at rest is {at_rest:g}, which is not between 0 and the "
                    "threshold",
                    "Reduce the kinetic force, or increase the threshold",
                )
        return plus, minus, *kinetic

    def _check_pressed(self, where: str, forces: tuple[Expr, ...], in_plane: bool) -> None:
        """Reject coefficients of friction that are negative, or larger in slip than in stick; in a
        plane also a term without a normal force, or several coefficients."""
        own = set().union(*(force.symbols & self.normals.keys() for force in forces))
        for name in sorted(own):
            slopes = [
                ex.evaluate(ex.derivative(force, name), self.reader.start) for force in forces
            ]
            plus, minus, *sliding = slopes
            if not all(
                0.0 <= slope <= static * (1 + COMPUTED_ZERO)
                for slope, static in zip(sliding, (plus, minus), strict=True)
            ):
                raise DeclarationError(
                    where,
                    f"its coefficients of {name} are {plus:g} in stick and {sliding[0]:g} in "
                    "slip at the initial state",
                    "They must not be negative, and kinetic friction must not exceed the threshold",
                )
        # The parts of the forces that remain without normal forces.
        nothing = dict.fromkeys(own, ex.ZERO)
        rest = [ex.substitute(force, nothing) for force in forces]
        uneven = any(len({ex.derivative(force, name) for name in own}) > 1 for force in forces)
        if in_plane and own and (uneven or any(e is not ex.ZERO for e in rest)):
            raise DeclarationError(
                f"{where}.threshold",
                f"in a plane it must be proportional to {min(own)}",
                f"Write it like 'mu*{min(own)}', and declare other friction as a separate contact",
            )

    def _check_proportional(self, where: str, force: Expr) -> None:
        """Reject a friction force that is not linear in normal forces."""
        own = force.symbols & self.normals.keys()
        slopes = [ex.derivative(force, name) for name in own]
        if any(slope.symbols & own for slope in slopes) or ex.bends(force, own):
            raise DeclarationError(
                where,
                f"it is not linear in {min(own)}",
                f"Write it like '0.5 + mu*{min(own)}', where the coefficient does not depend on "
                "normal forces",
            )

    def _pair(self, given: object, where: str, scope: Scope) -> tuple[Expr, Expr]:
        """Forces for u > 0 and u < 0, given as one formula or as two."""
        if isinstance(given, tuple):
            return scope.parse(given[0], where), scope.parse(given[1], where)
        both = scope.parse(given, where)
        return both, both

    def _check_threshold(self, threshold: Expr, where: str, remedy: str) -> None:
        """Reject a threshold that is negative at the initial state, or that is proved to become
        negative."""
        from stickslip.symbolic.enclosures import bounds

        here = ex.evaluate(threshold, self.reader.start)
        if not 0.0 <= here < math.inf:
            raise DeclarationError(where, f"its value is {here:g} at the initial state", remedy)
        given = self.system.values
        boxes = {n: (given[n], given[n]) for n in threshold.symbols & given.keys()}
        low, high = bounds(threshold, boxes) if threshold.symbols else (ex.number(threshold),) * 2
        if low < -COMPUTED_ZERO * abs(high):
            # An enclosure over all times is too wide for a function of time: its minimum is
            # computed.
            if not threshold.symbols & (self.reader.state.keys() - {"t"}):
                low = self._lowest_in_time(threshold, boxes)
            # Without a finite bound nothing is known; motions check the threshold.
            if -math.inf < low < 0.0:
                raise DeclarationError(
                    where, f"it can become negative (as low as {low:.4g})", remedy
                )

    def _lowest_in_time(self, threshold: Expr, boxes: dict[str, tuple[float, float]]) -> float:
        """Minimum of a threshold over the time span of the system."""
        from stickslip.symbolic.extrema import least

        return least(threshold, "t", *self.system.span, others=boxes, below=0.0).value
