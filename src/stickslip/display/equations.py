"""The equations of a system in mathematical notation: Unicode text for the terminal, LaTeX for
notebooks."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, TypeVar, cast

from stickslip.display.friction import AnyFriction, Friction, PlaneFriction
from stickslip.display.printers import LatexWriter, UnicodeWriter
from stickslip.display.symbols import unicode_unit
from stickslip.display.text import EquationsText, is_inclusion
from stickslip.display.tree import (
    HALF,
    NOUGHT,
    UNITY,
    Call,
    Name,
    Node,
    Number,
    Reader,
    Relation,
    Sum,
    as_product,
    coefficient_and_rest,
    differentiated,
    inserted,
    names_in,
    negate,
    raised,
    sum_of,
    times,
)
from stickslip.kept import cached_property
from stickslip.model.declaration import DryContact
from stickslip.model.entries.keys import key_of, normal_force
from stickslip.model.system import Unilateral
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.formulas import compared

if TYPE_CHECKING:
    from stickslip.model.system import Contact, Formula, Output, System

_W = TypeVar("_W", bound=UnicodeWriter)
_PASSES = {
    "falling": ("falls through 0", r"\searrow"),
    "rising": ("rises through 0", r"\nearrow"),
    "both": ("passes through 0", "="),
}
_RATE = "{}'"
ACCELERATION = "{}''"  # not an identifier, so that it cannot be a name of the declaration


@dataclass(frozen=True)
class Balance:
    """One equation of motion: left side, relation (= or ∋) and right side."""

    left: Node
    sign: str
    right: Node


@dataclass(frozen=True)
class Leap:
    """A jump of the state.

    Attributes
    ----------
    passes, sign : str
        Direction of the zero crossing of the guard, in words and as a LaTeX symbol.
    moved : list of Relation
        New values of the changed quantities.
    """

    name: str
    guard: Node
    passes: str
    sign: str
    moved: list[Relation]

    def moves(self, write: UnicodeWriter) -> str:
        """The assignments of a jump, on one line."""
        return write.words(", ").join(map(write, self.moved))


class Equations:
    """The declaration of a system and its equations, in readable form.

    ``str()`` gives Unicode text at most 100 columns wide, :meth:`latex` the equations for a paper;
    a notebook shows the equations and the table of parameters.
    """

    def __init__(self, system: System) -> None:
        self.system = system = system.plain
        self._reader = Reader(system)
        self._declared = system.declaration
        self.frictions: list[AnyFriction] = []
        self.balances: list[Balance] = [self._balance(x) for x in system.coordinates]
        for contact in self._declared.contacts:
            if contact.prescribed:  # in no balance
                self._law_of(contact)
        self.laws: list[Balance] = [
            Balance(Name(_RATE.format(name)), "=", self._reader.read(internal.law))
            for name, internal in system.internal.items()
        ]

    # The equations.

    @cached_property
    def energy(self) -> Node:
        """Kinetic plus potential energy."""
        return sum_of(
            self._reader.read(self.system.kinetic), self._reader.read(self.system.potential)
        )

    @cached_property
    def dissipation(self) -> Node:
        """The dissipation potential: viscous part and dry friction."""
        dry = []
        in_planes = {part for parts in self.system.planes.values() for part in parts}
        for name, contact in self.system.dry_contacts.items():
            if contact.kinetic is not None or name in in_planes:
                # its force is not derived from a potential; it is listed with the friction laws
                continue
            plus, minus = self._pair(contact.threshold)
            u = self._velocity(contact)
            if plus == minus:
                dry.append(times(plus, Call("abs", (u,))))
            else:
                dry += [
                    times(plus, Call("max", (u, NOUGHT))),
                    times(minus, Call("max", (negate(u), NOUGHT))),
                ]
        dry += [
            times(self._pair(contact.threshold)[0], self._length(contact))
            for contact in map(self._in_plane, self.system.planes)
            if contact.kinetic is None
        ]
        return sum_of(self._reader.read(self.system.viscous), *dry)

    def _in_plane(self, name: str) -> Contact:
        """A declared planar contact, or the friction of one that can open."""
        contact = self.system.contacts[name]
        friction = contact.friction(name) if isinstance(contact, Unilateral) else contact
        return cast("Contact", friction)

    def _length(self, contact: Contact) -> Node:
        """|Au| of a planar contact, by its components, or its dissipation as a function of u."""
        read = self._reader.read
        if contact.dissipation is not None:
            u = {f"v{i}": e for i, e in enumerate(self._velocities(contact), 1)}
            return inserted(read(str(contact.dissipation)), u)
        scaled = [
            times(read(axis), u)
            for axis, u in zip(contact.axes, self._velocities(contact), strict=True)
        ]
        return raised(sum_of(*(raised(u, Number(Fraction(2))) for u in scaled)), HALF)

    def _balance(self, x: str) -> Balance:
        system = self.system
        read = self._reader.read
        inertia = self._inertia(x)
        viscous = differentiated(read(system.viscous), f"d_{x}")
        coordinate = system.coordinates[x]
        drag = read(getattr(coordinate, "drag", 0.0))
        slope = differentiated(read(system.potential), x)
        parts = [
            _own_first(inertia, ACCELERATION.format(x)),
            _own_first(viscous, f"d_{x}"),
            drag,
            _own_first(slope, x),
        ]
        dry = [
            self._force(contact, x) for contact in self._declared.contacts if x in contact.direction
        ]
        inclusion = any(is_inclusion(part) for part in dry)
        return Balance(sum_of(*parts, *dry), "∋" if inclusion else "=", read(coordinate.force))

    def _inertia(self, x: str) -> Node:
        """Inertia M a of one coordinate, and velocity-dependent forces if M is not constant."""
        d = self._declared
        read = self._reader.read
        if x not in d.inertial:
            return NOUGHT
        momentum = differentiated(read(self.system.kinetic), f"d_{x}")
        moving = [*d.inertial, *(name[2:] for name in self._reader.unknowns if name[:2] == "d_")]
        accelerations = {f"d_{y}": Name(ACCELERATION.format(y)) for y in moving}
        force = d.velocity_force(x)
        if force is ex.ZERO:
            return inserted(momentum, accelerations)
        # Only the canonical form shows which terms cancel.
        mass = {y: d.mass[x, y] for y in d.inertial if (x, y) in d.mass}
        pushed = [times(read(ex.to_text(m)), accelerations[f"d_{y}"]) for y, m in mass.items()]
        return sum_of(*pushed, negate(read(ex.to_text(force))))

    def _force(self, declared: DryContact, x: str) -> Node:
        """Contribution of a contact to the left side of the balance of x."""
        if declared.side_of:
            first, _ = map(normal_force, self.system.constraints[declared.side_of])
            if declared.name != first:
                return NOUGHT  # both sides have one force, with its sign
            weight = self._reader.read(ex.to_text(declared.direction[x]))
            return negate(times(weight, self._holding(declared.side_of)))
        if declared.opens:
            weight = self._reader.read(ex.to_text(declared.direction[x]))
            return negate(times(weight, Name(declared.name)))
        if declared.plane:
            weight = self._reader.read(ex.to_text(declared.direction[x]))
            return negate(times(weight, self._plane_friction(declared).component(declared.plane)))
        contact = self.system.dry_contacts[declared.name]
        u = self._velocity(contact)
        weight = differentiated(self._reader.read(cast("str", contact.direction)), f"d_{x}")
        plus, minus = self._pair(contact.threshold)
        if plus == minus and contact.kinetic is None:
            return times(weight, plus, Call("Sign", (u,)))
        return negate(times(weight, self._line_friction(declared).force))

    def _law_of(self, declared: DryContact) -> AnyFriction:
        """The law of a contact, for the list of laws."""
        of = self._plane_friction if declared.plane else self._line_friction
        return of(declared)

    def _line_friction(self, declared: DryContact) -> Friction:
        """The law of a contact along a line."""
        for known in self.frictions:
            if isinstance(known, Friction) and known.contact == declared.name:
                return known
        contact = self.system.dry_contacts[declared.name]
        thresholds = self._pair(contact.threshold)
        sliding = thresholds if contact.kinetic is None else self._pair(contact.kinetic)
        u = self._velocity(contact)
        found = Friction(declared.name, self._next_index(), u, thresholds, sliding)
        self.frictions.append(found)
        return found

    def _next_index(self) -> str:
        """The index of the next force λ; empty if there is only one."""
        planes = self.system.planes
        in_planes = {part for parts in planes.values() for part in parts}
        alone = {c.name for c in self._declared.contacts if c.prescribed}
        long = [
            name
            for name, c in self.system.dry_contacts.items()
            if name not in in_planes
            and (name in alone or c.kinetic is not None or isinstance(c.threshold, tuple))
        ]
        return "" if len(long) + len(planes) == 1 else f"_{len(self.frictions) + 1}"

    def _plane_friction(self, declared: DryContact) -> PlaneFriction:
        """The law of the contact in a plane that a component belongs to."""
        planes = self.system.planes
        name = next(name for name, parts in planes.items() if declared.name in parts)
        for known in self.frictions:
            if isinstance(known, PlaneFriction) and known.contact == name:
                return known
        contact = self._in_plane(name)
        threshold, _ = self._pair(contact.threshold)
        sliding = threshold if contact.kinetic is None else self._pair(contact.kinetic)[0]
        index = self._next_index()
        axes = tuple(map(self._reader.read, contact.axes))
        plain = contact.dissipation is not None or all(axis == UNITY for axis in axes)
        matrix = "" if plain else f"{self._free_letter('AEGD')}{index}"
        u = self._velocities(contact)
        found = PlaneFriction(name, index, u, threshold, sliding, matrix, axes)
        if contact.dissipation is not None:
            R = self._reader.read(str(contact.dissipation))
            found = replace(found, dissipation=R, called=f"{self._free_letter('RPS')}{index}")
        self.frictions.append(found)
        return found

    def _free_letter(self, letters: str) -> str:
        """The first of some letters that is unused in the declaration."""
        system = self.system
        taken = {*system.parameters, *system.functions, *system.drives, *system.declaration.state}
        return next((letter for letter in letters if letter not in taken), letters[0])

    def _pair(self, given: str | float | tuple[str | float, str | float]) -> tuple[Node, Node]:
        both = given if isinstance(given, (tuple, list)) else (given, given)
        return self._reader.read(both[0]), self._reader.read(both[1])

    def _velocities(self, contact: Contact) -> tuple[Node, ...]:
        """Components of the velocity of a contact in a plane, or of a face."""
        return tuple(map(self._velocity, contact.components("").values()))

    def _velocity(self, contact: Contact) -> Node:
        """Relative velocity along a line."""
        return sum_of(
            self._reader.read(cast("str", contact.direction)),
            negate(self._reader.read(cast("Formula", contact.surface_speed))),
        )

    def friction_groups(self) -> list[list[AnyFriction]]:
        """Groups of contacts with the same law."""
        groups: dict[Hashable, list[AnyFriction]] = {}
        for friction in self.frictions:
            groups.setdefault((type(friction), friction.law), []).append(friction)
        return list(groups.values())

    def definitions(self) -> Iterator[tuple[Node, Node]]:
        """Functions and drives with their bodies, and unknowns of structures."""
        for name, (arguments, body) in self._reader.definitions.items():
            if name in self.system.outputs:
                continue
            yield Call(name, tuple(Name(a) for a in arguments)), body
        for unknown in self._reader.unknowns.values():
            terms = (times(Number(weight), Name(mode)) for mode, weight in unknown.weights)
            yield unknown, sum_of(*terms)

    def outputs(self) -> Iterator[tuple[Node, Node, Output]]:
        """Outputs: symbols, formulas, and declared properties."""
        for name, output in self.system.outputs.items():
            _, body = self._reader.definitions[name]
            yield Call(name, ()), body, output

    def conditions(self, write: UnicodeWriter) -> Iterator[tuple[str, str, str]]:
        """Names of conditions, their formulas, and whether they hold."""
        for name, condition in self.system.conditions.items():
            reason = self._declared.conditions[name].fails(self.system.values)
            why = f": {reason}" if reason and reason != condition.formula else ""
            verdict = f"FAILS{why}" if reason else "holds"
            left, sign, right = compared(condition.formula, name)
            sides = map(self._reader.read, (left, right))
            yield name, write(Relation(sign, *sides)), verdict

    def facts(self) -> Iterator[tuple[str, Node, float]]:
        """Names of facts, their formulas and values."""
        for name, text in self.system.facts.items():
            value = ex.evaluate(self._declared.facts[name], self.system.values)
            yield name, self._reader.read(text), value

    # Text.

    def writer(self, kind: type[_W]) -> _W:
        """Writer of the formulas of this system in a notation."""
        names = [*self.system.coordinates, *self.system.internal]
        names += {name.removeprefix("d_"): None for name in self._reader.unknowns}
        rates = {f"d_{x}": (x, 1) for x in names if f"d_{x}" not in self.system.internal}
        rates |= {_RATE.format(x): (x, 1) for x in names}
        rates |= {ACCELERATION.format(x): (x, 2) for x in names}
        arguments = {name: given for name, (given, _) in self._reader.definitions.items()}
        return kind(rates, dict.fromkeys(self.system.drives, "t"), arguments)

    def __str__(self) -> str:
        write = self.writer(UnicodeWriter)
        return "\n".join(EquationsText(self, write).lines()) + "\n"

    __repr__ = __str__

    @staticmethod
    def _holding(name: str) -> Node:
        """The force of a constraint."""
        return Name(f"lamda_{key_of(name)}")

    def constraints(self) -> list[Relation]:
        """The functions that constraints hold at zero, and the moduli of their forces."""
        system = self.system
        found = list[Relation]()
        for name, sides in system.constraints.items():
            modulus = Call("abs", (self._holding(name),))
            found += [
                Relation("=", self._reader.read(system.with_gaps[sides[0]].gap), NOUGHT),
                Relation("=", Name(normal_force(name)), modulus),
            ]
        return found

    def openings(self) -> list[tuple[Node, Node]]:
        """Normal forces and gaps of the contacts that can open, and do not adhere."""
        gaps = {
            normal_force(name): c.gap
            for name, c in self.system.unilateral.items()
            if c.adhesion == 0.0
        }
        return [(Name(name), self._reader.read(gap)) for name, gap in gaps.items()]

    def adhesions(self, write: UnicodeWriter) -> list[tuple[str, str]]:
        """Pairs of a condition and its consequence, for contacts with adhesion."""
        found = list[tuple[str, str]]()
        for name, c in self.system.unilateral.items():
            if c.adhesion != 0.0:
                gap, normal = self._reader.read(c.gap), Name(normal_force(name))
                pull = negate(self._reader.read(c.adhesion))
                open_ = write(Relation("=", normal, NOUGHT))
                open_ += write.words(", no friction") if c.direction else ""
                found.append(
                    (write(Relation("=", gap, NOUGHT)), write(Relation(">=", normal, pull)))
                )
                found.append((write(Relation(">", gap, NOUGHT)), open_))
        return found

    def jumps(self) -> Iterator[Leap]:
        """Jumps of the state, in the order of declaration."""
        read = self._reader.read
        for name, jump in self.system.jumps.items():
            moved = [Relation("→", Name(x), read(value)) for x, value in jump.to.items()]
            yield Leap(name, read(jump.when), *_PASSES[jump.direction], moved)

    def latex(self) -> str:
        """The equations of motion, friction laws, jumps, functions, drives and outputs as one
        ``aligned`` block."""
        write = self.writer(LatexWriter)
        rows = [
            f"{write(b.left)} &{'=' if b.sign == '=' else chr(92) + 'ni'} {write(b.right)}"
            for b in [*self.balances, *self.laws]
        ]
        for group in self.friction_groups():
            rows += [f"{write(r.left)} &= {write(r.right)}" for f in group for r in f.named]
            laws = group[0].laws(write, group[0].index if len(group) == 1 else "_i")
            rows += [rf"\text{{if }} {when}: \quad & {law}" for when, law in laws]
        rows += [rf"0 \leq {write(n)} &\perp {write(gap)} \geq 0" for n, gap in self.openings()]
        rows += [rf"\text{{if }} {when}: \quad & {law}" for when, law in self.adhesions(write)]
        rows += [f"{write(r.left)} &= {write(r.right)}" for r in self.constraints()]
        for jump in self.jumps():
            when = f"{write(jump.guard)} {jump.sign} 0"
            rows.append(rf"\text{{if }} {when}: \quad & {jump.moves(write)}")
        rows += [f"{write(left)} &= {write(body)}" for left, body in self.definitions()]
        rows += [f"{write(left)} &= {write(body)}" for left, body, _ in self.outputs()]
        return "\\begin{aligned}\n" + " \\\\\n".join(rows) + "\n\\end{aligned}"

    def _repr_latex_(self) -> str:
        return f"$$\n{self.latex()}\n$$"

    def _repr_markdown_(self) -> str:
        write = self.writer(LatexWriter)
        system = self.system
        heading = f"**{system.title or system.name}**" + (
            f" ({system.source})" if system.source else ""
        )
        rows = ["| parameter | value | unit | meaning |", "|---|---|---|---|"]
        rows += [
            f"| ${write(Name(name))}$ | {p.default:g} | {unicode_unit(p.unit)} | {p.meaning} |"
            for name, p in system.parameters.items()
        ]
        return "\n\n".join([heading, self._repr_latex_(), "\n".join(rows)])


def _own_first(node: Node, name: str) -> Node:
    """The terms with the named variable first and positive: a (x_L − x_R), not −a (x_R − x_L)."""
    terms = [_turned(term, name) for term in (node.terms if isinstance(node, Sum) else (node,))]
    return sum_of(*sorted(terms, key=lambda term: name not in names_in(term)))


def _turned(term: Node, name: str) -> Node:
    factor, powers = coefficient_and_rest(term)
    for i, (base, exponent) in enumerate(powers):
        if isinstance(base, Sum) and exponent == UNITY and len(powers) > 1 and factor < 0:
            own = [t for t in base.terms if name in names_in(t)]
            if own and coefficient_and_rest(own[0])[0] < 0:
                turned = sorted(
                    (negate(t) for t in base.terms),
                    key=lambda t: (isinstance(t, Number), coefficient_and_rest(t)[0] < 0),
                )
                return as_product(
                    -factor, (*powers[:i], (sum_of(*turned), UNITY), *powers[i + 1 :])
                )
    return term
