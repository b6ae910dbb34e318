"""The expansion of a system: named laws, constraints and structures are replaced by coordinates,
contacts and formulas, so that no other code depends on them.

A law becomes thresholds, forces, internal variables and sliders behind springs, with the contact's
name behind each of their names; a constraint two contacts that face each other, and friction under
the sum of their forces.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, cast

from stickslip.errors import DeclarationError, suggestion
from stickslip.model.entries.declared import Kind
from stickslip.model.entries.keys import key_of
from stickslip.model.entries.sampling import Sampling, at_once
from stickslip.model.entries.units import check_unit
from stickslip.model.expansion import Expansion, renamed
from stickslip.model.formats.expected import entry_key
from stickslip.model.names import parse_range
from stickslip.model.schema import check_shape
from stickslip.model.system import (
    AnyStructure,
    Bilateral,
    Contact,
    Formula,
    Inertial,
    Internal,
    Jump,
    LawContact,
    RateIndependent,
    Sampled,
    Side,
    System,
    Unilateral,
)
from stickslip.numerics.levels import CONSTRAINT_KEPT
from stickslip.structures.names import entry_of, is_entry
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.formulas import (
    Scope,
    check_name,
    is_finite,
    parse_signature,
)

if TYPE_CHECKING:
    from stickslip.model.laws import FrictionLaw
    from stickslip.structures.coordinates import InModes

_MOST_ELEMENTS = 1000
_OF_CURVES = ("kind", "outside")  # entries of laws with points besides parameters


def write_out(system: System) -> System:
    """The expanded system; the system itself if there is nothing to expand.

    Raises
    ------
    DeclarationError
        If a law does not exist, or its parameters are unknown, missing or out of their range, or
        if a constraint does not hold at the start.
    """
    check_shape(system)
    short_hand = (LawContact, Bilateral, Unilateral)
    long = any(isinstance(contact, short_hand) for contact in system.contacts.values())
    sampled = {n: a for n, a in system.internal.items() if isinstance(a, Sampled)}
    if not (long or sampled or system.structures or system.forces):
        return system
    work = _WrittenOut(system)
    for name, contact in system.contacts.items():
        if isinstance(contact, LawContact):
            work.law(name, contact)
        elif isinstance(contact, Bilateral):
            work.constraint(name, contact)
        else:
            work.contacts[name] = contact
    for name, structure in system.structures.items():
        work.structure(name, structure)
    work.start_structures()
    work.samplers(sampled)
    if not sampled and work.contacts == system.contacts and work.structures == system.structures:
        return system
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # its warnings were issued for the system
        try:
            plain = work.result()
        except DeclarationError as error:
            raise work.as_declared(error) from None
    work.check_sampled(plain)
    for where, name, text in (*work.ranges, *work.quotients):
        plain.declaration.limit(where, name, parse_range(text, where))
    plain.declaration.check_limits(system.values)
    return plain


class _WrittenOut(Expansion):
    """Writes laws, constraints, structures and sampled variables out."""

    def samplers(self, sampled: Mapping[str, Sampled]) -> None:
        """Expand sampled variables: variables at rest, with jumps at equidistant times at which all
        sampled variables of that time change together."""
        groups: dict[tuple[str, ...], dict[str, Sampled]] = {}
        acting: dict[tuple[str, ...], dict[str, Sampled]] = {}
        for name, part in sampled.items():
            where = entry_key("internal", name)
            check_unit(part.unit, f"{where}.unit")
            if isinstance(part.period, float | int):
                parse_range("(0, inf)", where).check(float(part.period), f"{where}.period")
            period, offset, delay = map(str, (part.period, part.offset, part.delay))
            self.quotients.append((f"{where}.period", period, "(0, inf)"))
            self.quotients.append((f"{where}.delay", f"({delay})/({period})", "[0, 1)"))
            self.quotients.append((f"{where}.quantum", str(part.quantum), "[0, inf)"))
            groups.setdefault((period, offset), {})[name] = part
            if not _is_nothing(part.delay):
                acting.setdefault((period, offset, delay), {})[name] = part
                later = Internal(0.0, part.unit, f"next value of {part.meaning or name}")
                self.take(self.internal, f"{name}_next", later, f"{where}.delay")
                self.initial.setdefault(f"{name}_next", self.initial.get(name, 0.0))
        samplings: list[Sampling] = []
        for (period, offset), parts in groups.items():
            to = {n if _is_nothing(p.delay) else f"{n}_next": _rounded(p) for n, p in parts.items()}
            label = f"sample {', '.join(parts)}"
            samplings.append(Sampling(label, tuple(parts), offset, period, to))
        for (period, offset, delay), parts in acting.items():
            to = {name: f"{name}_next" for name in parts}
            label, later = f"output {', '.join(parts)}", f"({offset}) + ({delay})"
            samplings.append(Sampling(label, tuple(parts), later, period, to))
        for sampling in at_once(samplings, self._number):
            self._sample(sampling)

    def _number(self, text: str) -> float | None:
        """A formula of parameters that does not depend on them; None of any other."""
        names = {name: ex.sym(name) for name in self.system.parameters}
        try:
            formula = Scope(names).parse(text, "period")
        except DeclarationError:
            return None
        return None if formula.symbols else ex.evaluate(formula, {})

    def check_sampled(self, plain: System) -> None:
        """Reject a period, a delay or a quantum that does not depend on parameters alone, and a
        period longer than the time span."""
        span = self.system.span
        for where, text, _ in self.quotients:
            formula = plain.declaration.scope.parse(text, where)
            if others := sorted(formula.symbols - set(self.system.parameters)):
                raise DeclarationError(
                    where, f"it depends on '{others[0]}'", "Use numbers and parameters only"
                )
            if where.endswith(".period"):
                period = ex.evaluate(formula, self.system.values)
                if period > span[1] - span[0]:
                    raise DeclarationError(
                        where,
                        f"the period {period:g} is longer than the span ({span[0]:g}, {span[1]:g})",
                        "Give a longer span, or a shorter period",
                    )

    def _sample(self, sampling: Sampling) -> None:
        """Add a jump at even times."""
        label = sampling.label
        if label in self.jumps:
            where = entry_key("internal", sampling.names[0])
            raise DeclarationError(
                where, f"it needs the name '{label}', which is used by a jump", "Rename the jump"
            )
        self.jumps[label] = Jump(f"sin(pi*{sampling.since})", dict(sampling.to))
        place = entry_key("jumps", label)
        for name in sampling.to:
            own = name if name in self.system.internal else name.removesuffix("_next")
            self.origins[f"{place}.to.{name}"] = f"{entry_key('internal', own)}.law"
        self.origins[place] = f"{entry_key('internal', sampling.names[0])}.period"

    def law(self, name: str, contact: LawContact) -> None:
        """Write one contact out."""
        from stickslip.model.laws import by_name

        where = entry_key("contacts", name)
        law = by_name(contact.law, f"{where}.law")
        self.check_values(where, contact, law)
        known = law.known()
        key = key_of(name)
        words = {own: f"{own}_{key}" for own in (*known, *law.internal)}
        signatures = {text: parse_signature(text, text)[0] for text in law.functions}
        words |= {own: f"{own}_{key}" for own in signatures.values()}
        words |= {"u": f"u_{key}"}
        slopes = self.slopes(contact, where)
        if law.stiffness:
            self.sliders(name, contact, law, words, slopes)
        elif law.points:
            self.measured(name, contact, law, words)
        else:
            self.single(name, contact, law, words, slopes)

    def check_values(self, where: str, contact: LawContact, law: FrictionLaw) -> None:
        """Reject parameters that the law does not have, needs, or cannot have."""
        known = law.known()
        for given in contact.values:
            if given not in known and not (law.points and given in _OF_CURVES):
                raise DeclarationError(
                    f"{where}.{given}",
                    f"unknown parameter of '{law.name}'",
                    suggestion(given, known),
                )
        for needed, parameter in law.parameters.items():
            if needed not in contact.values:
                raise DeclarationError(
                    f"{where}.{needed}",
                    f"the {parameter.meaning} is missing",
                    f"Add it, as in: {needed} = {parameter.default:g}",
                )
        of_forces = law.dry and not law.functions
        for own, value in contact.values.items():
            if self.is_pressed(value) and not of_forces:
                raise DeclarationError(
                    f"{where}.{own}",
                    "a law with internal states or sliders cannot depend on a normal force",
                    "Use a law with a threshold, such as 'stribeck', or give the normal force "
                    "as a formula of time and state",
                )

    def single(
        self,
        name: str,
        contact: LawContact,
        law: FrictionLaw,
        words: dict[str, str],
        slopes: Mapping[str, str],
    ) -> None:
        """A law of one element: a threshold, or a force that depends on internal variables."""
        where = entry_key("contacts", name)
        for own, parameter in law.known().items():
            value = contact.values.get(own, parameter.default)
            if self.is_pressed(value):
                words[own] = f"({value})"  # no function may use a normal force
                continue
            words[own] = self.define(f"{where}.{own}", words[own], value, parameter.range)
        for text, body in law.functions.items():
            self.take(self.functions, renamed(text, words), renamed(body, words), where)
        if law.threshold:
            self.contacts[name] = Contact(
                contact.direction,
                renamed(law.threshold, words),
                contact.surface_speed,
                renamed(law.kinetic, words) if law.kinetic else None,
                contact.unit,
            )
        else:
            self.act(self.internal_force(name, contact, law, words, slopes), law, slopes, where)

    def internal_force(
        self,
        name: str,
        contact: LawContact,
        law: FrictionLaw,
        words: dict[str, str],
        slopes: Mapping[str, str],
    ) -> str:
        """The name of the function that is the force of a law with internal variables."""
        where = entry_key("contacts", name)
        velocity = f"{contact.direction} - ({contact.surface_speed})"
        velocity = contact.direction if contact.surface_speed == 0.0 else velocity
        self.take(self.functions, words["u"], velocity, where)
        self.origins[f"functions.{words['u']}"] = f"{where}.direction"
        unit = self.unit_of_way(slopes)
        for own, internal in law.internal.items():
            meaning = f"{internal.meaning} of {name}"
            part = Internal(renamed(str(internal.law), words), internal.unit or unit, meaning)
            self.take(self.internal, words[own], part, where)
            self.origins[f"internal.{words[own]}"] = where
            if own in law.start:
                self.initial.setdefault(words[own], self.number(law.start[own], words, where))
        force = f"force_{key_of(name)}"
        self.take(self.functions, force, renamed(law.force, words), where)
        return force

    def act(self, force: str, law: FrictionLaw, slopes: Mapping[str, str], where: str) -> None:
        """Add a force along a direction; on a coordinate without mass it is a drag."""
        massless = [
            x for x in slopes if not is_entry(x) and self.coordinates[x].kind == Kind.VISCOUS
        ]
        if law.increasing and massless and len(slopes) > 1:
            raise DeclarationError(
                f"{where}.direction",
                f"it couples '{massless[0]}', which has no mass, to other coordinates",
                "Use a direction with one coordinate, or declare the coordinates inertial",
            )
        for x, slope in slopes.items():
            if law.increasing and massless:
                self.resist(x, slope, force, where)
            else:
                self.push(x, slope, force)

    def structure(self, name: str, structure: AnyStructure) -> None:
        """Expand a structure: its modes are coordinates, and forces on unknowns act on them."""
        from stickslip.structures.coordinates import InModes

        if isinstance(structure, InModes):
            return
        where = entry_key("structures", name)
        check_name(name, where)
        part = InModes(name, structure)
        self.structures[name] = part
        try:
            _ = structure.squares
        except DeclarationError as error:  # too large for all its modes
            raise DeclarationError(where, error.reason, error.remedy) from None
        energies = part.energies(self.damping_words(part, f"{where}.damping"))
        for kind, energy in zip(("kinetic", "potential", "viscous"), energies, strict=True):
            self.energies[kind].append(energy)
        pushed: list[list[str]] = [[] for _ in part.coordinates]
        for unknown, force in self.forces.items():
            _, of, index = entry_of(unknown, self.structures)
            if of == name:
                load = f"load_{key_of(unknown).strip('_')}"
                self.take(self.functions, load, force, where)
                self.origins[f"functions.{load}"] = entry_key("forces", unknown)
                for i, weight in part.weights(index).items():
                    pushed[i].append(f"({weight!r})*{load}")
        for i, (mode, terms) in enumerate(zip(part.coordinates, pushed, strict=True), 1):
            coordinate = Inertial(
                structure.unit, f"mode {i} of {name}", force=" + ".join(terms) or 0.0
            )
            self.take(self.coordinates, mode, coordinate, where)
            self.origins[f"coordinates.{mode}"] = where

    def damping_words(self, part: InModes, where: str) -> dict[str, str]:
        """Names of the functions that hold the formulas in the damping of a structure."""
        words: dict[str, str] = {}
        for i, formula in enumerate(part.damping_formulas(), 1):
            words[formula] = own = f"damping_{part.name}_{i}"
            self.take(self.functions, own, formula, where)
            self.origins[f"functions.{own}"] = where
            self.ranges.append((where, own, "[0, inf)"))
            try:
                value = self.number(formula, {}, where)
            except DeclarationError:
                continue  # refused where the function is parsed
            parse_range("[0, inf)", where).check(value, where)
        return words

    def start_structures(self) -> None:
        """Initial values of modes, and their values after jumps, from those of unknowns."""
        if self.structures:
            from stickslip.structures.coordinates import start_of

            parts = cast("Mapping[str, InModes]", self.structures)
            self.initial = start_of(parts, self.initial)
            for name, jump in self.jumps.items():
                to = self.landing(entry_key("jumps", name), jump.to, parts)
                self.jumps[name] = replace(jump, to=to)

    def landing(
        self, where: str, to: Mapping[str, Formula], parts: Mapping[str, InModes]
    ) -> dict[str, Formula]:
        """New values of modes from those declared of unknowns; all other unknowns stay."""
        from stickslip.structures.coordinates import modes_per_unknown

        found: dict[str, Formula] = {x: value for x, value in to.items() if not is_entry(x)}
        terms: dict[str, list[str]] = {}
        known: list[dict[str, float]] = []
        for number, (x, value) in enumerate(to.items(), 1):
            if not is_entry(x):
                continue
            own, here = f"landing_{key_of(where)}_{number}", entry_key(f"{where}.to", x)
            self.take(self.functions, own, value, here)
            self.origins[f"functions.{own}"] = here
            slope = modes_per_unknown(parts, x, f"{where}.to")
            if slope in known:
                raise DeclarationError(
                    here, "this degree of freedom has two new values", "Give it once only"
                )
            if both := [mode for mode in slope if mode in found]:
                raise DeclarationError(
                    here,
                    f"a new value of the mode {both[0]} is given as well",
                    "Give either degrees of freedom or modes",
                )
            known.append(slope)
            for mode, weight in slope.items():
                terms.setdefault(mode, [mode]).append(f"({weight!r})*({own} - {x})")
        return found | {mode: " + ".join(parts) for mode, parts in terms.items()}

    def constraint(self, name: str, contact: Bilateral) -> None:
        """Write a constraint out: two contacts that face each other, and friction under the sum of
        their forces, of which one vanishes."""
        where = entry_key("contacts", name)
        self.check_held(contact.constraint, f"{where}.constraint")
        for i, sign in enumerate(("", "-"), 1):
            label = f"{name} side {i}"
            side = Side(f"{sign}({contact.constraint})", unit=contact.unit, of=name)
            self.origins[f"{entry_key('contacts', label)}.gap"] = f"{where}.constraint"
            self.add_contact(label, side, where)
        if contact.direction:
            self.add_contact(name, contact.friction(name), where)
        elif contact.mu != 0.0:
            raise DeclarationError(
                f"{where}.direction",
                "the direction of friction is missing",
                "Give the relative velocity, like direction = 'd_x'",
            )

    def check_held(self, constraint: Formula, where: str) -> None:
        """Reject a constraint that does not hold at the start."""
        system = self.system
        held = self.scope.parse(constraint, where)
        places = [*system.coordinates, *(name for name in held.symbols if is_entry(name))]
        state = {x: float(self.initial.get(x, 0.0)) for x in places}
        values = {**state, **system.values, "t": float(system.span[0])}
        if not held.symbols <= values.keys():
            return  # refused as a gap
        here = ex.evaluate(held, values)
        if not abs(here) <= CONSTRAINT_KEPT * max([1.0, *map(abs, state.values())]):
            raise DeclarationError(
                where,
                f"it is {here:g} at the initial state, but must be zero",
                "Choose initial values that satisfy it",
            )

    def sliders(
        self,
        name: str,
        contact: LawContact,
        law: FrictionLaw,
        words: dict[str, str],
        slopes: Mapping[str, str],
    ) -> None:
        """Expand sliders behind springs, in parallel: each is a rate-independent coordinate with a
        contact.

        Parameters
        ----------
        words : dict of str to str
            What the law's own names become.
        slopes : mapping of str to str
            Coefficients of the direction.
        """
        where, key = entry_key("contacts", name), key_of(name)
        known = law.known()
        values = {own: contact.values.get(own, p.default) for own, p in known.items()}
        count = self.how_many(values, law, where)
        lists: dict[int, dict[str, str]] = {i: {} for i in range(1, count + 1)}
        for own, parameter in known.items():
            if own in law.several:
                for i, value in enumerate(cast(tuple[Formula, ...], values[own]), 1):
                    place = f"{where}.{own}[{i - 1}]"
                    lists[i][own] = self.define(place, f"{words[own]}_{i}", value, parameter.range)
            elif own != "elements":
                words[own] = self.define(f"{where}.{own}", words[own], values[own], parameter.range)
        for text, body in law.functions.items():
            self.take(self.functions, renamed(text, words), renamed(body, words), where)
        unit = self.unit_of_way(slopes)
        terms = [f"{x}" if c == "1" else f"({c})*{x}" for x, c in slopes.items()]
        way = " + ".join(terms) or "0"
        for i in range(1, count + 1):
            index = f"_{i}" if count > 1 else ""
            each = {**words, **lists[i], "i": str(i), "elements": str(count)}
            slider = f"r_{key}{index}"
            label = f"{name} {i}" if count > 1 else name
            part = RateIndependent(unit, f"position of the slider of {label}")
            self.take(self.coordinates, slider, part, where)
            part = Contact(
                f"d_{slider}",
                renamed(law.threshold, each),
                contact.surface_speed,
                unit=contact.unit,
            )
            self.add_contact(label, part, where)
            self.energies["potential"].append(
                f"({renamed(law.stiffness, each)})/2*({way} - {slider})**2"
            )
            self.start(slider, slopes)

    def measured(
        self, name: str, contact: LawContact, law: FrictionLaw, words: dict[str, str]
    ) -> None:
        """A contact whose sliding force is given by points: a table, or one for each way."""
        from stickslip.model.entries.sliding_points import sliding_curves

        where = entry_key("contacts", name)
        curves = sliding_curves(contact.values, law.points, where)
        static = contact.values["F_s"]
        held = static if isinstance(static, tuple) else (static,)
        if len(held) > 2:
            raise DeclarationError(
                f"{where}.F_s",
                f"{len(held)} values were given, but there are two directions of sliding",
                "Give one value, or two: forward and backward",
            )
        factor = contact.values.get("N", law.options["N"].default)
        words = {**words, "N": self.strength(f"{where}.N", words["N"], factor, law)}
        threshold, kinetic = list[str](), list[str]()
        for way, end in enumerate(("", "_back")):
            if way < len(held):
                place = f"{where}.F_s[{way}]" if len(held) > 1 else f"{where}.F_s"
                label = f"F_s{end}_{key_of(name)}"
                words["F_s"] = self.strength(place, label, held[way], law)
            if way < len(curves):
                words["curve"] = f"curve{end}_{key_of(name)}"
                self.take(self.tables, words["curve"], curves[way], where)
                self.origins[f"tables.{words['curve']}"] = f"{where}.F"
            threshold.append(renamed(law.threshold, words))
            kinetic.append(renamed(law.kinetic, words))
        both = len(held) > 1 or len(curves) > 1
        self.contacts[name] = Contact(
            contact.direction,
            (threshold[0], threshold[1]) if both else threshold[0],
            contact.surface_speed,
            (kinetic[0], kinetic[1]) if both else kinetic[0],
            contact.unit,
        )

    def strength(self, where: str, name: str, value: object, law: FrictionLaw) -> str:
        """Name of a force of a tabulated law, or of its factor; a normal force keeps its name."""
        if self.is_pressed(value):
            return f"({value})"  # no function may use a normal force
        return self.define(
            where, name, value, law.known()["N" if name.startswith("N_") else "F_s"].range
        )

    def how_many(self, values: Mapping[str, object], law: FrictionLaw, where: str) -> int:
        """The number of elements: that of the lists, or a whole number."""
        lengths = {}
        for own in law.several:
            value = values[own]
            if not isinstance(value, tuple) or not value:
                raise DeclarationError(
                    f"{where}.{own}",
                    "expected a list with one entry for each element",
                    f"Write it like {own} = [1.0, 0.5]",
                )
            lengths[own] = len(value)
        if len(set(lengths.values())) > 1:
            said = " and ".join(f"'{own}' has {n}" for own, n in lengths.items())
            raise DeclarationError(
                where, f"its lists have different lengths: {said}", "Give lists of the same length"
            )
        if lengths:
            return next(iter(lengths.values()))
        count = values.get("elements", 1)
        if not is_finite(count) or count != int(count) or not 1 <= count <= _MOST_ELEMENTS:
            raise DeclarationError(
                f"{where}.elements",
                f"not an integer between 1 and {_MOST_ELEMENTS}",
                "Write it like elements = 10",
            )
        return int(count)

    def start(self, slider: str, slopes: Mapping[str, str]) -> None:
        """Set the spring of a slider to be relaxed at the start, and shifted with the system."""
        try:
            weights = {x: float(slope) for x, slope in slopes.items()}
        except ValueError:
            return  # the direction depends on parameters
        for section in (self.initial, self.translation):
            given = {x: float(section[x]) for x in weights if x in section}
            if given:
                section.setdefault(slider, sum(weights[x] * a for x, a in given.items()))


def _is_nothing(formula: Formula) -> bool:
    return str(formula).strip() in ("0", "0.0")


def _rounded(part: Sampled) -> str:
    """The law of a sampled variable, rounded to its quantum."""
    if _is_nothing(part.quantum):
        return str(part.law)
    return f"({part.quantum})*floor(({part.law})/({part.quantum}) + 0.5)"
