"""Reading a declaration: formulas are parsed to expressions and checked; those of contacts in
:mod:`stickslip.model.contact_reading`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, cast

from stickslip.errors import DeclarationError, listing, short, suggestion
from stickslip.kept import cached_property
from stickslip.model.contact_reading import read_contacts
from stickslip.model.declaration import Declaration, ReadCondition, StateJump, check_initial
from stickslip.model.entries.checks import (
    check_definite,
    check_slopes,
    jumps_through,
    quadratic_form,
    size_of_terms,
    terms_by_guard,
)
from stickslip.model.entries.declared import CROSSINGS, Kind
from stickslip.model.entries.keys import NORMAL, normal_force
from stickslip.model.entries.units import check_unit
from stickslip.model.formats.expected import entry_key
from stickslip.model.names import DeclaredNames, measured_drives
from stickslip.model.schema import check_shape
from stickslip.numerics.levels import ON_SURFACE
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import Indexed, Scope, compared, is_finite
from stickslip.symbolic.pieces import unwrapped

if TYPE_CHECKING:
    from stickslip.model.system import System
    from stickslip.structures.coordinates import InModes


def declare(system: System) -> Declaration:
    """Read and check a declaration.

    Raises
    ------
    DeclarationError
        Naming the key, the reason and the remedy of the first thing wrong.
    """
    check_shape(system)
    reader = DeclarationReader(system)
    try:
        reader.names()
        reader.energy()
        reader.dissipation()
        reader.contacts()
        reader.laws()
        reader.jumps()
        reader.known_facts()
        reader.outputs()
        reader.defaults()
    except ArithmeticError:
        # Single formulas are checked separately; this is for two that are too large only together.
        raise DeclarationError(
            system.name,
            "it contains numbers that are too large",
            "Check large numbers and exponents",
        ) from None
    return reader.result


class DeclarationReader:
    """Reads one declaration, in the order of its keys.

    Attributes
    ----------
    result : Declaration
        What has been read so far.
    constants, state, velocities, rates, inertia : dict of str to Expr
        What names mean: parameters; t, coordinates and internal variables; rates of inertial
        coordinates; all rates; t and inertial coordinates.
    static, clock, place, motion, anywhere : Scope
        Formulas of parameters; of t besides; of the state without rates; with the rates of inertial
        coordinates; of everything.
    """

    def __init__(self, system: System) -> None:
        self.system = system
        self.result = Declaration(list(system.parameters), {})

    def names(self) -> None:
        system, result = self.system, self.result
        if not system.name.strip():
            raise DeclarationError(
                "name", "the name of the system is missing", "Give the system a short name"
            )
        names = DeclaredNames(ranges=result.ranges)
        names.parameters(system.parameters)
        kinds = dict(
            zip(Kind, (result.inertial, result.viscous, result.rate_independent), strict=True)
        )
        for name, coordinate in system.coordinates.items():
            where = entry_key("coordinates", name)
            names.claim(name, where, rate=True)
            check_unit(coordinate.unit, f"{where}.unit")
            kinds[coordinate.kind].append(name)
        self.indexed: dict[str, Indexed] = {}
        for name, part in system.structures.items():
            names.claim(name, entry_key("structures", name), rate=True)
            modes = cast("InModes", part)
            self.indexed |= modes.indexed()
            result.bodies.append(tuple(modes.coordinates))
        for name, internal in system.internal.items():
            where = entry_key("internal", name)
            names.claim(name, where, rate=f"d_{name}" not in system.internal)
            check_unit(internal.unit, f"{where}.unit")
            result.internal.append(name)
        if not result.state:
            raise DeclarationError(
                "coordinates",
                "the system has no coordinates and no internal variables",
                "Declare at least one coordinate; if all motion is prescribed, declare an "
                "internal variable with law = 1",
            )
        check_unit(system.time_unit, "time_unit")
        start, stop = system.span
        if not (is_finite(start) and is_finite(stop) and start < stop):
            raise DeclarationError("span", "not a time span", "Write [start, end] with start < end")
        names.functions("functions", system.functions)
        names.tables(system.tables)
        names.functions("drives", system.drives, clock="t")
        result.given = measured_drives(system.drives)
        result.check_span(start, stop)
        self.declared = list(names.definitions)
        names.outputs(system.outputs)
        self.definitions = names.with_derivatives()
        self.constants = {name: ex.sym(name) for name in system.parameters}
        self.state = {
            "t": ex.sym("t"),
            **{n: ex.sym(n) for n in (*result.coordinates, *result.internal)},
        }
        self.velocities = {f"d_{q}": ex.sym(f"d_{q}") for q in result.inertial}
        self.rates = {f"d_{x}": ex.sym(f"d_{x}") for x in result.coordinates}

    def scope(self, *groups: Mapping[str, Expr], why: str) -> Scope:
        """Formulas of parameters and of some groups of names; `why` not of others."""
        names = {name: e for group in (self.constants, *groups) for name, e in group.items()}
        everything = [*self.state, *self.rates, "speed"]
        vectors = {name: v for name, v in self.indexed.items() if v.symbols <= names.keys()}
        forbidden = {n: why for n in (*everything, *self.indexed) if n not in names}
        whole = {n: f"Name one of its components, like {n}[0]" for n in vectors}
        return Scope(names, self.definitions, forbidden | whole, vectors=vectors)

    def energy(self) -> None:
        system, result = self.system, self.result
        self.static = self.scope(why="Use parameters only")
        self.clock = self.scope({"t": self.state["t"]}, why="Use t and parameters only")
        self.place = self.scope(
            self.state, why="Use t, coordinates, internal variables and parameters only"
        )
        self.motion = self.scope(
            self.state, self.velocities, why="Use rates of inertial coordinates only"
        )
        self.anywhere = self.scope(
            self.state,
            self.rates,
            {"speed": ex.sym("speed")},
            why="Use t, coordinates and rates only",
        )
        for name, table in system.tables.items():
            for i, text in table.formulas.items():
                self.static.parse(text, f"{entry_key('tables', name)}, values[{i}]")
        for name in self.declared:
            self.anywhere.check(name)
        for name in system.drives:
            result.drives[name] = self.clock.parse(name, f"drives.{name}")
        result.potential = self.place.parse(system.potential, "potential")
        check_slopes(result.potential, result.coordinates, "potential", 2)
        self._check_energy()
        self.inertia = {name: self.state[name] for name in ("t", *result.inertial)}
        speeds = self.scope(
            self.inertia,
            self.velocities,
            why="The kinetic energy may depend on t, inertial coordinates, their rates and "
            "parameters",
        )
        result.kinetic = speeds.parse(system.kinetic, "kinetic")
        check_slopes(result.kinetic, [*self.inertia, *self.velocities], "kinetic", 2)
        self.check_steps("kinetic", result.kinetic)
        result.mass = quadratic_form(result.kinetic, result.inertial, "kinetic", pure=False)
        heavy = {q for pair in result.mass for q in pair}
        for q in result.inertial:
            if q not in heavy:
                raise DeclarationError(
                    f"coordinates.{q}",
                    "an inertial coordinate needs a mass",
                    f"Add m/2*d_{q}**2 to 'kinetic', or declare it viscous or rate-independent",
                )
        result.start = self.start
        result.check_mass(self.start)

    def dissipation(self) -> None:
        system, result = self.system, self.result
        smooth = {k: v for k, v in self.rates.items() if k[2:] not in result.rate_independent}
        scope = self.scope(
            smooth,
            why="The viscous part may depend on rates of inertial and viscous coordinates, and "
            "parameters",
        )
        result.dissipation = scope.parse(system.viscous, "viscous")
        result.damping = quadratic_form(
            result.dissipation, [*result.inertial, *result.viscous], "viscous"
        )
        self._resistances()
        for z in result.damped:
            if (z, z) not in result.damping:
                raise DeclarationError(
                    f"coordinates.{z}",
                    "a viscous coordinate needs viscous friction",
                    f"Add nu/2*d_{z}**2 to 'viscous', give it a drag, or declare it "
                    "rate-independent",
                )
        result.check_damping(system.values)
        both = [*result.inertial, *result.viscous]
        check_definite(result.damping, both, system.values, "viscous", "viscous matrix", semi=True)
        state = frozenset(result.state)
        for name, coordinate in system.coordinates.items():
            where = f"coordinates.{name}"
            result.forces[name] = self.motion.parse(coordinate.force, f"{where}.force")
            check_slopes(result.forces[name], state, f"{where}.force")
            self._check_jumps(f"{where}.force", result.forces[name], -1.0)
            if coordinate.kind == Kind.INERTIAL:
                result.drags[name] = self.motion.parse(coordinate.drag, f"{where}.drag")  # type: ignore[union-attr]
                self._check_jumps(f"{where}.drag", result.drags[name], 1.0)
                self._check_drag(name, result.drags[name])

    def _resistances(self) -> None:
        """Drags of viscous coordinates; rejects terms that cannot be combined with them."""
        system, result = self.system, self.result
        for z in result.viscous:
            where = f"coordinates.{z}.drag"
            rate = f"d_{z}"
            scope = self.scope(
                self.state,
                self.velocities,
                {rate: ex.sym(rate)},
                why=f"A drag may depend on {rate} and rates of inertial coordinates",
            )
            drag = scope.parse(system.coordinates[z].drag, where)  # type: ignore[union-attr]
            if drag is ex.ZERO:
                continue
            result.drags[z] = drag
            check_slopes(drag, [rate, *result.state], where)
            if ex.bends(drag, {rate}):
                raise DeclarationError(
                    where,
                    f"it has kinks or jumps in {rate}",
                    "Write it with smooth functions, such as asinh, or declare dry friction as a "
                    "contact of a coordinate without a drag",
                )
            others = [y for x, y in result.damping if x == z != y and y in result.viscous]
            if others:
                raise DeclarationError(
                    where,
                    f"'viscous' couples d_{z} to d_{others[0]}, but '{z}' has a drag",
                    "Couple it to other viscous coordinates by springs, or declare it inertial",
                )
        result.viscous.sort(key=lambda z: z in result.drags)
        for z in result.resisted:
            self._check_drag(z, result.drags[z])
            result.check_increasing(z, system.values)

    def _check_jumps(self, where: str, formula: Expr, resists: float) -> None:
        """Reject a function whose jump resists a rate: where the rate stays on the jump, the force
        is any between."""
        for guard, part in terms_by_guard(formula).items():
            for rate in sorted(guard.symbols & self.velocities.keys()):
                jumps = [
                    resists * jump
                    for jump in jumps_through(part, guard, rate, self.start, self.constants)
                    if jump
                ]
                if guard in self.motion.jumping and jumps and min(jumps) > 0.0:
                    raise DeclarationError(
                        where,
                        f"'{self.motion.jumping[guard]}' makes a force that jumps against "
                        f"{rate}: this is dry friction, whose force at rest is set-valued",
                        f"Declare a contact with a direction like '{rate}' and a threshold",
                    )

    def _check_energy(self) -> None:
        """Reject an energy that jumps as a coordinate changes: the force there would be
        infinite."""
        for guard, part in terms_by_guard(self.result.potential).items():
            for x in sorted(guard.symbols & set(self.result.coordinates)):
                if any(jumps_through(part, guard, x, self.start, self.constants)):
                    raise DeclarationError(
                        "potential",
                        f"the energy jumps with {x} where {ex.to_text(unwrapped(guard))} = 0, "
                        "which would be an infinite force",
                        "Make it continuous, or declare a discontinuous force under 'force'",
                    )

    def check_steps(self, where: str, formula: Expr) -> None:
        """Reject an inertia or a direction that jumps with a coordinate or in time: momentum would
        have to, too."""
        for guard, part in terms_by_guard(formula).items():
            for x in sorted(guard.symbols & self.inertia.keys()):
                if any(jumps_through(part, guard, x, self.start, self.constants)):
                    raise DeclarationError(
                        where,
                        f"it jumps with {x} where {ex.to_text(unwrapped(guard))} = 0, so "
                        "velocities would jump as well",
                        "Make it continuous",
                    )

    def _check_drag(self, name: str, drag: Expr) -> None:
        from stickslip.symbolic.enclosures import bounds

        values = {symbol: self.start[symbol] for symbol in drag.symbols}
        for v in (-10.0, -1.0, -0.1, -1e-3, 1e-3, 0.1, 1.0, 10.0):
            at = {**values, f"d_{name}": v}
            if not math.isfinite(ex.evaluate(drag, at)):
                others = ", ".join(f"{n} = {at[n]:g}" for n in sorted(at.keys() & self.state))
                raise DeclarationError(
                    f"coordinates.{name}.drag",
                    f"the resistance is undefined at the initial state with d_{name} = {v:g}"
                    + (f", {others}" if others else ""),
                    "Declare initial values at which it is defined",
                )
            low, high = bounds(drag, {n: (a, a) for n, a in at.items()})
            # Only drag that certainly feeds energy in is rejected, not rounding errors.
            if high < 0.0 if v > 0.0 else low > 0.0:
                raise DeclarationError(
                    f"coordinates.{name}.drag",
                    f"the resistance creates energy at d_{name} = {v:g}",
                    "A drag f(v) must satisfy v*f(v) >= 0; declare other forces under 'force'",
                )

    def contacts(self) -> None:
        self.result.contacts = read_contacts(self)

    def laws(self) -> None:
        scope = self.scope(
            self.state, self.rates, why="'speed' is available in the kinetic law of a contact only"
        )
        state = frozenset(self.result.state)
        for name, internal in self.system.internal.items():
            self.result.laws[name] = scope.parse(internal.law, f"internal.{name}.law")
            check_slopes(self.result.laws[name], state, f"internal.{name}.law")

    def jumps(self) -> None:
        """Guards and new values; each guard fires one jump."""
        result = self.result
        taken: dict[tuple[Expr, int], str] = {}
        for name, jump in self.system.jumps.items():
            where = entry_key("jumps", name)
            with listing(partial(self._guard, where=f"{where}.when")):
                guard = self._guard(jump.when, f"{where}.when")
            if not jump.to:
                raise DeclarationError(
                    f"{where}.to",
                    "the jump has no new values",
                    'Give new values, like {d_x = "-d_x"}',
                )
            direction = CROSSINGS[jump.direction]
            for way in (-1, 1) if direction == 0 else (direction,):
                if (guard, way) in taken:
                    raise DeclarationError(
                        f"{where}.when",
                        f"the jump '{short(taken[guard, way])}' has the same guard and direction",
                        "Combine them into one jump, or change the direction of one of them",
                    )
                taken[guard, way] = name
            values = {x: self._landing(f"{where}.to", x, value) for x, value in jump.to.items()}
            result.jumps.append(StateJump(name, guard, direction, values))

    def _guard(self, text: object, where: str) -> Expr:
        """A formula that may cross zero."""
        felt = frozenset([*self.result.state, "t"])
        guard = self._of_state(text, where)
        check_slopes(guard, felt, where)
        if not guard.symbols & felt:
            raise DeclarationError(
                where,
                "it depends neither on the state nor on time, so it cannot cross zero",
                "Give a formula that is zero where the state jumps, such as 'x - 1'",
            )
        return guard

    def _landing(self, where: str, name: str, value: object) -> Expr:
        """The new value of a part of the state."""
        result = self.result
        if name not in result.places:
            massless = name[2:] in (*result.viscous, *result.rate_independent)
            if name.startswith("d_") and massless:
                raise DeclarationError(
                    entry_key(where, name),
                    f"'{name[2:]}' has no inertia, so its rate is determined by the forces",
                    f"Let '{name[2:]}' jump, or declare it inertial",
                )
            raise DeclarationError(
                entry_key(where, name),
                "not a part of the state",
                suggestion(name, result.state),
            )
        return self._of_state(value, entry_key(where, name))

    def _of_state(self, text: object, where: str) -> Expr:
        """A formula of the state in which reported quantities may occur, if the state alone
        determines them."""
        try:
            return self.shown.parse(text, where)
        except DeclarationError as error:
            used = error.where.removeprefix("outputs.")
            if used == error.where or used not in self.system.outputs:
                raise
            raise DeclarationError(
                where, f"it uses the output '{used}', in which {error.reason}", error.remedy
            ) from None

    @cached_property
    def shown(self) -> Scope:
        """Formulas of the state, and of gaps, relative velocities, thresholds and the energy if
        they are functions of it. Forces depend on the sticking contacts, which an event may
        change."""
        from stickslip.model.quantities import contact_key

        result = self.result
        found = {"energy": ex.add((result.potential, 1.0), (result.moving_energy, 1.0))}
        forces = {f"dd_{q}" for q in result.inertial}
        for c in result.contacts:
            key = contact_key(c.side_of or c.name)
            if c.opens:
                forces.add(key if not c.side_of else f"{NORMAL}{key}")
                if not c.side_of and c.gap is not None:
                    found[f"gap_{key.removeprefix(NORMAL)}"] = c.gap
                continue
            forces.add(f"friction_{key}")
            rates = [(weight * ex.sym(f"d_{x}"), 1.0) for x, weight in c.direction.items()]
            found[f"slip_speed_{key}"] = ex.add(*rates, (c.speed, -1.0))
            if not c.plane:
                found |= {f"threshold_plus_{key}": c.plus, f"threshold_minus_{key}": c.minus}
        known = self.motion.names.keys()
        names = {name: e for name, e in found.items() if e.symbols <= known}
        of_state = (
            "It depends on the forces, and thus on which contacts stick, not on the state alone. "
            "Write the force of a spring in series, like k*(x - y), or use a contact with that "
            "threshold"
        )
        summed = (
            "It is an integral along the motion: declare an internal variable with its power as law"
        )
        modes = "A mode does not cross zero: give a formula that does, such as a relative velocity"
        forbidden = {
            **self.motion.forbidden,
            **{f"mode_{contact_key(c.name)}": modes for c in result.contacts},
            **dict.fromkeys(forces | (found.keys() - names.keys()), of_state),
            **dict.fromkeys(("dissipated_energy", "supplied_energy"), summed),
        }
        # Declared names have precedence.
        own = {*self.motion.names, *self.definitions}
        return Scope(
            {**{name: e for name, e in names.items() if name not in own}, **self.motion.names},
            self.definitions,
            forbidden,
            vectors=self.motion.vectors,
        )

    def known_facts(self) -> None:
        for name, condition in self.system.conditions.items():
            where = entry_key("conditions", name)
            first, sign, second = compared(condition.formula, where)
            left, right = (self.static.parse(side, where) for side in (first, second))
            margin = left - right if sign.startswith(">") else right - left
            otherwise = condition.otherwise or condition.formula
            self.result.conditions[name] = ReadCondition(margin, "=" not in sign, otherwise)
        for name, text in self.system.facts.items():
            self.result.facts[name] = self.static.parse(text, entry_key("facts", name))
        names = {**self.result.facts, **self.anywhere.names}
        forbidden, vectors = self.anywhere.forbidden, self.anywhere.vectors
        self.result.scope = Scope(names, self.definitions, forbidden, vectors=vectors)

    def outputs(self) -> None:
        """Outputs: formulas of quantities of results."""
        result = self.result
        for name in self.system.outputs:
            where = entry_key("outputs", name)
            if name in result.published or name.startswith("mode_") or name == "time":
                raise DeclarationError(
                    where, "results already have a quantity of this name", "Choose another name"
                )
            result.outputs[name] = result.results.parse(name, where)

    def defaults(self) -> None:
        system, result = self.system, self.result
        for name, value in system.initial.items():
            check_initial(result, name, value, system.started_unknowns)
        for name, weight in system.translation.items():
            if name not in result.coordinates or not is_finite(weight):
                raise DeclarationError(
                    entry_key("translation", name),
                    "not a coordinate with a finite number",
                    "Give a coordinate and a number, like x = 1",
                )
        self._check_translation()

    def _check_translation(self) -> None:
        system, result = self.system, self.result
        if not system.translation:
            return
        shift = {x: ex.num(float(w)) for x, w in system.translation.items()}
        formulas = [
            ("potential", result.potential),
            ("kinetic", result.kinetic),
            *((f"internal.{n}.law", law) for n, law in result.laws.items()),
        ]
        for c in result.contacts:
            where = entry_key("contacts", c.name)
            formulas += [(f"{where}.direction", weight) for weight in c.direction.values()]
            formulas += [(f"{where}.threshold", c.plus), (f"{where}.threshold", c.minus)]
            formulas.append((f"{where}.surface_speed", c.speed))
            formulas += [
                (f"{where}.kinetic", c.kinetic_plus),
                (f"{where}.kinetic", c.kinetic_minus),
            ]
        for x in result.coordinates:
            formulas += [(f"coordinates.{x}.force", result.forces[x])]
        for jump in result.jumps:
            where = entry_key("jumps", jump.name)
            formulas.append((f"{where}.when", jump.guard))
            formulas += [(f"{where}.to.{x}", e - ex.sym(x)) for x, e in jump.values.items()]
        values = {
            **self.start,
            **{f"d_{x}": 0.3 for x in result.coordinates},
            "speed": 0.3,
        }
        states = [
            {
                k: v + offset * (1 + 0.1 * i) if k in self.state else v
                for i, (k, v) in enumerate(values.items())
            }
            for offset in (0.0, 0.37, -1.3)
        ]
        for where, formula in formulas:
            change = ex.along(formula, shift)
            # A potential may tilt (a constant pull); its slope must not change under the shift.
            tested = (
                [ex.derivative(change, x) for x in result.coordinates]
                if where == "potential"
                else [change]
            )
            tested += [ex.along(guard, shift) for guard in terms_by_guard(formula)]
            for moved in states:
                if any(
                    abs(ex.evaluate(probe, moved)) > ON_SURFACE * size_of_terms(probe, moved)
                    for probe in tested
                ):
                    raise DeclarationError(
                        "translation",
                        f"{where} is not invariant under this translation",
                        "Remove the translation, or correct its direction",
                    )

    @cached_property
    def start(self) -> dict[str, float]:
        """Values at the start, at rest where none is declared."""
        state = dict.fromkeys([*self.state, *self.rates, "speed"], 0.0)
        given = {k: float(v) for k, v in self.system.initial.items() if is_finite(v)}
        pressed = {normal_force(name): 0.0 for name in self.system.with_gaps}
        return {**state, **given, **self.system.values, **pressed, "t": float(self.system.span[0])}
