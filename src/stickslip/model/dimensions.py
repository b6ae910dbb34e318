"""Consistency of the units of a declaration: term by term, as far as units are declared.

Units are optional, and numbers may hide some (a mass of 1, a 9.81). So a term counts only if every
name in it has a unit, one of its factors is a parameter, samples or a table, and its coefficient is
a plain one such as 1/2. A parameter that was declared as a plain number has no unit that is known.
Inconsistent units cause a warning, not an error, because no computation depends on units.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from fractions import Fraction
from functools import cache
from math import pi

from stickslip.kept import cached_property
from stickslip.model.entries.units import agree, factors, lowest_terms, unit_product, unit_text
from stickslip.model.formats.expected import entry_key
from stickslip.model.system import System
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.functions import FUNCTIONS

Unit = tuple[tuple[str, Fraction], ...]
_NUMBER: Unit = ()
# relative error of a number with all digits that is regarded as a fraction of small integers
_AS_FRACTION = 1e-12
# largest numerator, and denominators, of coefficients without a hidden unit
_NUMERATOR, _DENOMINATORS = 4, (1, 2, 3, 4, 6, 8, 12, 24)


def disagreements(system: System) -> list[str]:
    """Inconsistent units of a declaration, one line for each term."""
    declared = (system.parameters, system.coordinates, system.internal, system.dry_contacts)
    if not any(item.unit for group in declared for item in group.values()):
        return []
    return _Check(system).conflicts()


class _Check:
    """Check the units of a declaration."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.found: dict[str, None] = {}
        self.taken: set[tuple[str, Unit]] = set()
        self.where = ""
        self.known: dict[Expr, Unit | None] = {}
        self.at_speed: dict[Expr, Unit | None] = {}
        self.counting: dict[Expr, bool] = {}
        self.parameters = frozenset(system.parameters)
        time = _declared(system.time_unit)
        self.units: dict[str, Unit | None] = {"t": time}
        for name, item in {**system.parameters, **system.coordinates, **system.internal}.items():
            self.units[name] = _declared(item.unit)
        for name in (*system.coordinates, *system.internal):
            self.units.setdefault(f"d_{name}", _over(self.units[name], time))

    @cached_property
    def measured(self) -> dict[Expr, Expr]:
        """The placeholder of a measured drive, or of its rate, and its name."""
        found: dict[Expr, Expr] = {}
        for name in self.system.declaration.given:
            drive = self.system.declaration.drives[name]
            found |= {drive: ex.sym(name), ex.derivative(drive, "t"): ex.sym(f"d_{name}")}
        return {e: name for e, name in found.items() if e.op != "num"}

    def conflicts(self) -> list[str]:
        d, time = self.system.declaration, self.units["t"]
        energy, label = self.energy()
        power, as_power = _over(energy, time), f"{label}, divided by time,"
        self.terms("potential", d.potential, energy, label)
        self.terms("kinetic", d.kinetic, energy, label)
        self.terms("viscous", d.dissipation, power, as_power)
        for x, force in d.forces.items():
            unit, meaning = _over(energy, self.units[x]), f"{label}, divided by {x},"
            self.terms(f"coordinates.{x}.force", force, unit, meaning)
            if x in d.drags:
                self.terms(f"coordinates.{x}.drag", d.drags[x], unit, meaning)
        for a, law in d.laws.items():
            self.terms(f"internal.{a}.law", law, self.units[f"d_{a}"], f"the rate of {a}")
        for c in d.contacts:
            where = entry_key("contacts", c.name)
            slip = self.slip(c.direction)
            force = _declared(c.unit)
            meaning = f"the unit of '{c.name}'"
            if force is None:
                force, meaning = _over(power, slip), f"{as_power} divided by the relative velocity,"
            self.terms(f"{where}.surface_speed", c.speed, slip, "the relative velocity")
            if c.dissipation is not None:
                continue  # these are factors, and numbers in a formula may have units
            for e in (c.plus, c.minus):
                self.terms(f"{where}.threshold", e, force, meaning)
            self.units["speed"] = slip
            self.at_speed.clear()
            for e in {c.kinetic_plus, c.kinetic_minus} - {c.plus, c.minus}:
                self.terms(f"{where}.kinetic", e, force, meaning)
        for jump in d.jumps:
            where = entry_key("jumps", jump.name)
            self.terms(f"{where}.when", jump.guard, None, "")
            for x, value in jump.values.items():
                self.terms(f"{where}.to.{x}", value, self.of(ex.sym(x)), f"'{x}'")
        for name, drive in d.drives.items():
            self.terms(f"drives.{name}", drive, None, "")
        for name, output in self.system.outputs.items():
            self.terms(
                entry_key("outputs", name), d.outputs[name], _declared(output.unit), "its unit"
            )
        return list(self.found)

    def slip(self, direction: Mapping[str, Expr]) -> Unit | None:
        """The unit of a relative velocity, if all its terms agree; numbers other than ±1 may have
        any unit."""
        found = [
            self.product([(weight, 1.0), (ex.sym(f"d_{x}"), 1.0)])
            if weight.op != "num" or abs(ex.number(weight)) == 1.0
            else None
            for x, weight in direction.items()
        ]
        first = found[0] if found else None
        alike = first is not None and all(u is not None and _alike(first, u) for u in found)
        return first if alike else None

    def energy(self) -> tuple[Unit | None, str]:
        """The unit of energies, with its origin: a term with the dimension of an energy, if there
        is one; preferably work at a contact."""
        d, time = self.system.declaration, self.units["t"]
        found = list[tuple[Unit, Callable[[], str]]]()

        def note(unit: Unit | None, label: Callable[[], str]) -> None:
            if unit is not None:
                found.append((unit, label))

        for c in d.contacts:
            work = _times(_declared(c.unit), self.slip(c.direction), time)
            note(work, lambda c=c: f"the work at '{c.name}'")
        for where, formula in (("kinetic", d.kinetic), ("potential", d.potential)):
            self.where = where
            for term, unit in self.sure(formula):
                note(unit, lambda term=term, where=where: f"{self.text(term)} in '{where}'")
        self.where = "viscous"
        for term, unit in self.sure(d.dissipation):
            note(
                _times(unit, time),
                lambda term=term: f"{self.text(term)} in 'viscous', times time,",
            )
        energies = [pair for pair in found if _base(pair[0]) == _base(_of("J"))]
        for unit, label in energies or found:
            return unit, label()
        return None, ""

    def terms(self, where: str, formula: Expr, unit: Unit | None, meaning: str) -> None:
        """Compare the terms of a formula with the unit that it has to have."""
        self.where = where
        if unit is None:
            self.of(formula)
            return
        for term, own in self.sure(formula):
            if not _alike(own, unit):
                self.say(f"{self.text(term)} is in {_text(own)}", meaning, unit)

    def sure(self, formula: Expr) -> Iterator[tuple[Expr, Unit]]:
        """The terms of a formula whose units count."""
        for term, c in _terms(formula):
            unit = self.of(term)
            if unit is not None and _is_plain(c) and self.counts(term):
                yield c * term, unit

    def text(self, e: Expr) -> str:
        """A formula, with the names of drives that were measured."""
        return ex.to_text(ex.rewrite(e, self.measured.get) if self.measured else e)

    def say(self, what: str, other: str, unit: Unit) -> None:
        self.found[f"{self.where}: {what}, but {other} is in {_text(unit)}"] = None

    # -- the unit of a formula ---------------------------------------------------------------------

    def of(self, e: Expr) -> Unit | None:
        """The unit of an expression; None if it is not known."""
        for node in ex.walk([e]):
            known = self.memory(node)
            if node not in known:
                known[node] = self.made(node)
        return self.memory(e)[e]

    def memory(self, e: Expr) -> dict[Expr, Unit | None]:
        """The cache for the unit of an expression: separate for expressions of the speed, since
        each contact has its own."""
        return self.at_speed if "speed" in e.symbols else self.known

    def made(self, e: Expr) -> Unit | None:
        match e.op:
            case "num":
                return _NUMBER
            case "sym":
                return self.units.get(str(e.value))
            case "sum":
                constant = [] if e.value == 0.0 else [(ex.num(float(e.value)), 1.0)]
                return self.common([*e.terms, *constant])
            case "prod":
                return self.product(e.terms)
            case "pow":
                return _NUMBER if all(self.of(part) == _NUMBER for part in e.args) else None
            case "select":
                return self.common([(part, 1.0) for part in e.args[1:]])
            case _ if FUNCTIONS[e.op].tabulated:
                return self.tabulated(e)
            case _:
                self.argument(e)
                return _NUMBER

    def tabulated(self, e: Expr) -> Unit | None:
        """Declared unit of samples or a table; of a slope or an integral also by its argument."""
        unit, power = FUNCTIONS[e.op].unit
        if not unit:
            return None
        own = _of(unit)
        return _times(own, self.of(e.args[0]), powers=(1.0, float(power))) if power else own

    def counts(self, e: Expr) -> bool:
        """Whether an expression contains a parameter, samples or a table with a unit, other than in
        arguments of functions."""
        for node in ex.walk([e]):
            if node not in self.counting:
                self.counting[node] = self.has_own(node)
        return self.counting[e]

    def has_own(self, e: Expr) -> bool:
        match e.op:
            case "sym":
                return str(e.value) in self.parameters
            case "sum" | "prod":
                return any(self.counting[part] for part, _ in e.terms)
            case "select":
                return any(self.counting[part] for part in e.args[1:])
            case "num" | "pow":
                return False
            case _:
                row = FUNCTIONS[e.op]
                return row.tabulated and bool(_declared(row.unit[0]))

    def may_hide(self, term: Expr, c: float) -> bool:
        """Whether a number in front of a term without parameters may have a unit."""
        return abs(c) != 1.0 and not self.counts(term)

    def product(self, powers: Iterable[tuple[Expr, float]]) -> Unit | None:
        powers = list(powers)
        return _times(*(self.of(base) for base, _ in powers), powers=tuple(p for _, p in powers))

    def common(self, terms: list[tuple[Expr, float]]) -> Unit | None:
        """Common unit of all terms; None if one may have another. Zero has any unit."""
        terms = [(term, c) for term, c in terms if not ex.is_number(term, 0.0)]
        units = [self.of(term) for term, _ in terms]
        sure = [
            (term, c, unit)
            for (term, c), unit in zip(terms, units, strict=True)
            if unit is not None and term.op != "num" and _is_plain(c)
        ]
        for term, c, unit in sure[1:]:
            first, weight, other = sure[0]
            declared = self.counts(term) or self.counts(first)
            if not _alike(unit, other) and declared and not self.may_hide(term, c):
                if not self.may_hide(first, weight):
                    text = f"{self.text(c * term)} is in {_text(unit)}"
                    self.say(text, self.text(weight * first), other)
                return None
        first = sure[0][2] if sure else _NUMBER
        alike = all(unit is not None and _alike(unit, first) for unit in units)
        return first if alike else None

    def argument(self, e: Expr) -> None:
        """A function takes numbers; a sine, radians."""
        (x,) = e.args
        unit = self.of(x)
        if unit is None or _alike(unit, _NUMBER) or x.op == "num":
            return
        angle = not _base(unit)
        if angle or x.symbols & self.parameters:
            name = "a function with pieces" if FUNCTIONS[e.op].typed else f"'{e.op}'"
            wanted = "radians" if FUNCTIONS[e.op].crest is not None else "a number"
            # A wave with pieces is a wave and its pieces.
            if not (FUNCTIONS[e.op].typed and (self.where, unit) in self.taken):
                text = f"{self.where}: {self.text(x)} is in {_text(unit)}"
                self.found[f"{text}, but {name} takes {wanted}"] = None
            self.taken.add((self.where, unit))


def _declared(unit: str) -> Unit | None:
    """A unit, if one is declared."""
    return _of(unit) if unit.strip() else None


def _times(*units: Unit | None, powers: tuple[float, ...] = ()) -> Unit | None:
    """A product of units; None if one of them is not known."""
    return None if None in units else _product(units, powers or (1.0,) * len(units))


def _over(unit: Unit | None, by: Unit | None) -> Unit | None:
    return _times(unit, by, powers=(1.0, -1.0))


# A long chain has few units.


@cache
def _of(unit: str) -> Unit:
    return tuple(factors(unit).items())


@cache
def _product(units: tuple[Unit, ...], powers: tuple[float, ...]) -> Unit:
    return tuple(unit_product(*zip(map(dict, units), powers, strict=True)).items())


@cache
def _alike(one: Unit, other: Unit) -> bool:
    return agree(dict(one), dict(other))


@cache
def _base(unit: Unit) -> frozenset[tuple[str, Fraction]]:
    """The powers of SI base units in it."""
    return frozenset(lowest_terms(dict(unit))[1].items())


@cache
def _text(unit: Unit) -> str:
    return unit_text(dict(unit))


def _terms(formula: Expr) -> list[tuple[Expr, float]]:
    if formula.op == "num":
        return []
    return list(formula.terms) if formula.op == "sum" else [(formula, 1.0)]


@cache
def _is_plain(c: float) -> bool:
    """Whether a coefficient is a simple fraction, or one of π: it hides no unit."""
    for value in (c, c / pi, c * pi):
        near = Fraction(value).limit_denominator(_DENOMINATORS[-1])
        plain = abs(near.numerator) <= _NUMERATOR and near.denominator in _DENOMINATORS
        if plain and abs(float(near) - value) <= _AS_FRACTION * abs(value):
            return True
    return False
