"""Reading a declaration: every formula becomes an expression, and everything wrong is found
here."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from typing import TYPE_CHECKING, cast

from stickslip.errors import DeclarationError, short, some, suggestion
from stickslip.kept import cached_property
from stickslip.model.names import (
    JOINED,
    DeclaredNames,
    Range,
    check_covered,
    measured_drives,
    normal_force,
    parse_range,
)
from stickslip.model.schema import PLANAR, check_shape, entry_key
from stickslip.model.system import CROSSINGS, Contact, Kind, Side, Unilateral
from stickslip.model.units import check_unit
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import Indexed, Scope, TimeFunction, compared, is_finite
from stickslip.symbolic.pieces import unwrapped

if TYPE_CHECKING:
    from stickslip.convex.formula import ConvexFormula
    from stickslip.model.system import System
    from stickslip.structures.coordinates import InModes

_VISCOUS_MATRIX = "viscous matrix of the viscous coordinates"
_REMEDY = "A threshold is never negative; write max(..., 0) where it may vanish"
_VELOCITIES = ("v1", "v2", "v3")  # as a dissipation names them
_NUMBERS = {2: "two", 3: "three"}
_QUADRATIC = "Write a pure quadratic form, like m/2*d_x**2"


@dataclass(frozen=True)
class DryContact:
    """A contact read.

    Attributes
    ----------
    kind : str
        Kind of the coordinates it acts on; viscous where it acts on none, between motions that are
        given: its velocity is not part of the state.
    direction : dict of str to Expr
        Coefficients by coordinate: constants, but of t and inertial coordinates where it acts on
        these.
    plus, minus : Expr
        Thresholds for u > 0 and u < 0; of a normal direction, the pull that it holds, and 0.
    kinetic_plus, kinetic_minus : Expr
        Friction forces while sliding (the thresholds unless declared); may contain the symbol
        ``speed``. Both may contain normal forces.
    gap : Expr or None
        Of the normal direction of a contact that can open: u is its rate, λ the normal force.
    on : str
        Of the friction of such a contact: its name.
    restitution : Expr
        Of either, in an impact.
    plane : int
        1, 2 for the components of a contact in a plane, to 3 of a face, whose forces are of all:
        `plus`,
        `minus` and the kinetic forces then are those of abs(A⁻¹λ).
    axis : Expr
        Of a component, the entry of A.
    dissipation : ConvexFormula or None
        Of a component, R in parts of the threshold; then A is 1.
    side_of : str
        Of a side of a constraint, the name of that.
    ratio : Expr
        Its relative velocity is this times that of the contact with which it is one.
    """

    name: str
    kind: Kind
    direction: Mapping[str, Expr]
    plus: Expr
    minus: Expr
    kinetic_plus: Expr
    kinetic_minus: Expr
    speed: Expr
    unit: str
    gap: Expr | None = None
    on: str = ""
    restitution: Expr = ex.ZERO
    plane: int = 0
    axis: Expr = ex.ONE
    dissipation: ConvexFormula | None = None
    side_of: str = ""
    ratio: Expr = ex.ONE

    @property
    def prescribed(self) -> bool:
        """Whether both of its sides move as given."""
        return not self.direction

    @property
    def opens(self) -> bool:
        """Whether it is the normal direction of a contact that can open."""
        return self.gap is not None

    @property
    def sense(self) -> Expr:
        """The sign of the ratio, 1 where that is zero."""
        return ex.select(self.ratio, ex.ONE, ex.num(-1.0))


@dataclass(frozen=True)
class StateJump:
    """A jump of the state read.

    Attributes
    ----------
    guard : Expr
        It fires where this passes through zero ...
    direction : int
        ... falling (−1), rising (1) or either way (0).
    values : dict of str to Expr
        New values of parts of the state, from those before.
    kink : int
        Number of the guard among the kinks of the equations of motion; −1 before these are derived.
    """

    name: str
    guard: Expr
    direction: int
    values: Mapping[str, Expr]
    kink: int = -1


@dataclass(frozen=True)
class ReadCondition:
    """A condition read.

    Attributes
    ----------
    margin : Expr
        What is positive where it holds, or zero unless it is strict.
    strict : bool
    otherwise : str
        What happens where it fails.
    """

    margin: Expr
    strict: bool
    otherwise: str

    def fails(self, values: Mapping[str, float]) -> str:
        """Why it fails for some parameters; empty if it holds."""
        margin = ex.evaluate(self.margin, values)
        if math.isnan(margin):
            return "it is undefined for these parameters"
        holds = margin > 0.0 or (margin == 0.0 and not self.strict)
        return "" if holds else self.otherwise


@dataclass(eq=False)
class Declaration:
    """A system's formulas as expressions in the symbols ``t``, coordinates, rates ``d_x`` and
    parameters.

    Attributes
    ----------
    inertial, viscous, rate_independent, internal : list of str
        Names by kind, in order of declaration; viscous coordinates with a drag come last.
    mass, damping : dict of (str, str) to Expr
        Matrices M(q, t) of inertial and C, constant, of inertial and viscous coordinates, by pairs.
    kinetic : Expr
        T = q̇·M q̇/2 + b·q̇ + c, with b and c of q and t.
    potential : Expr
    forces : dict of str to Expr
        Non-potential forces.
    drags : dict of str to Expr
        Resistances f(v) of inertial coordinates, and of viscous ones that have any.
    laws : dict of str to Expr
        Rates of the internal variables.
    contacts : list of DryContact
    jumps : list of StateJump
    scope : Scope
        What names mean in a formula that may use all of them.
    given : dict of str to TimeFunction
        Drives that are no formulas.
    limits : list of (str, Expr, Range)
        Closed formulas that have to stay in a range, with their places: parameters of laws.
    dissipations : list of (str, ConvexFormula, Expr or None)
        Of contacts that have a formula, with their places, and norms in place of mean speeds;
        checked for the declared parameters.
    start : dict of str to float
        Values of the state at the start.
    """

    parameters: list[str]
    ranges: dict[str, Range]
    inertial: list[str] = field(default_factory=list)
    viscous: list[str] = field(default_factory=list)
    rate_independent: list[str] = field(default_factory=list)
    internal: list[str] = field(default_factory=list)
    mass: dict[tuple[str, str], Expr] = field(default_factory=dict)
    damping: dict[tuple[str, str], Expr] = field(default_factory=dict)
    kinetic: Expr = ex.ZERO
    potential: Expr = ex.ZERO
    dissipation: Expr = ex.ZERO
    forces: dict[str, Expr] = field(default_factory=dict)
    drags: dict[str, Expr] = field(default_factory=dict)
    laws: dict[str, Expr] = field(default_factory=dict)
    contacts: list[DryContact] = field(default_factory=list)
    jumps: list[StateJump] = field(default_factory=list)
    conditions: dict[str, ReadCondition] = field(default_factory=dict)
    facts: dict[str, Expr] = field(default_factory=dict)
    drives: dict[str, Expr] = field(default_factory=dict)
    given: dict[str, TimeFunction] = field(default_factory=dict)
    limits: list[tuple[str, Expr, Range]] = field(default_factory=list)
    dissipations: list[tuple[str, ConvexFormula, Expr | None]] = field(default_factory=list)
    scope: Scope = field(default_factory=lambda: Scope({}))
    start: dict[str, float] = field(default_factory=dict)

    @property
    def resisted(self) -> list[str]:
        """Viscous coordinates with a drag: their rates solve an equation each."""
        return [z for z in self.viscous if z in self.drags]

    @property
    def damped(self) -> list[str]:
        """Viscous coordinates whose rates solve a linear problem."""
        return [z for z in self.viscous if z not in self.drags]

    def resistance(self, z: str) -> Expr:
        """What resists the rate of a viscous coordinate with a drag, the viscous part included."""
        own = self.damping.get((z, z), ex.ZERO)
        return self.drags[z] + own * ex.sym(f"d_{z}")

    @cached_property
    def moving_energy(self) -> Expr:
        """What the kinetic energy adds to the energy that is conserved, q̇·∂T/∂q̇ − T: T itself
        where it is a quadratic form (Jacobi's integral)."""
        rates = [f"d_{q}" for q in self.inertial]
        at_rest = dict.fromkeys(rates, ex.ZERO)
        if all(
            ex.substitute(e, at_rest) is ex.ZERO
            for e in (self.kinetic, *(ex.derivative(self.kinetic, rate) for rate in rates))
        ):
            return self.kinetic
        momenta = [ex.derivative(self.kinetic, rate) * ex.sym(rate) for rate in rates]
        return ex.add(*((term, 1.0) for term in momenta), (self.kinetic, -1.0))

    def velocity_force(self, q: str) -> Expr:
        """The force on an inertial coordinate where the kinetic energy depends on the
        configuration: ∂T/∂q − (∂²T/∂q̇∂q) q̇ − ∂²T/∂q̇∂t (Coriolis and centrifugal forces)."""
        momentum = ex.derivative(self.kinetic, f"d_{q}")
        rates = {"t": ex.ONE, **{x: ex.sym(f"d_{x}") for x in self.inertial}}
        return ex.derivative(self.kinetic, q) - ex.along(momentum, rates)

    @property
    def coordinates(self) -> list[str]:
        """All coordinates by kind: inertial, viscous, rate-independent."""
        return [*self.inertial, *self.viscous, *self.rate_independent]

    @property
    def state(self) -> list[str]:
        """Names of the state: q, q̇, z, r, α."""
        rates = [f"d_{q}" for q in self.inertial]
        return [*self.inertial, *rates, *self.viscous, *self.rate_independent, *self.internal]

    @cached_property
    def places(self) -> dict[str, int]:
        """Where each part of the state stands in it."""
        return {name: i for i, name in enumerate(self.state)}

    def value(self, expression: Expr, values: Mapping[str, float]) -> float:
        """Number of an expression; NaN where it is undefined.

        Raises
        ------
        DeclarationError
            If it depends on a name without a value, or a value is given to an unknown name.
        """
        for name in values:
            if self.scope.names.get(name) is not ex.sym(name):
                close = get_close_matches(name, self.scope.names, 1)
                raise DeclarationError(
                    "values",
                    f"there is no '{short(name)}'",
                    f"Did you mean '{close[0]}'?" if close else "Give t, the state, parameters",
                )
        lacking = sorted(expression.symbols - values.keys())
        if lacking:
            raise DeclarationError("values", f"'{lacking[0]}' has no value", "Give it a number")
        return ex.evaluate(expression, values)

    def check_span(self, start: float, stop: float) -> None:
        """Refuse a time span of which a drive says nothing."""
        check_covered(self.given, start, stop)

    def kinks_known(self, start: float, stop: float) -> int:
        """How many kinks drives that are no formulas have in a time span, at most."""
        return sum(drive.count(start, stop) for drive in self.given.values())

    def check_range(self, name: str, value: object) -> None:
        """Refuse one parameter value that is unknown, no number, or out of range."""
        where = entry_key("parameters", name)
        if name not in self.ranges:
            raise DeclarationError(
                where,
                "there is no such parameter",
                f"Known: {', '.join(self.parameters) or 'none'}",
            )
        self.ranges[name].check(value, where)

    def check_parameters(self, values: Mapping[str, float]) -> None:
        """Refuse parameter values that are unknown, out of range, or make M or C indefinite.

        Raises
        ------
        DeclarationError
        """
        for name, value in values.items():
            self.check_range(name, value)
        self.check_limits(values)
        here = {**self.start, **values}
        _check_definite(self.mass, self.inertial, here, "kinetic", "mass matrix")
        _check_definite(self.damping, self.damped, values, "viscous", _VISCOUS_MATRIX)
        for z in self.resisted:
            _check_increasing(self, z, values)

    def limit(self, where: str, name: str, interval: Range) -> None:
        """Let what a name means stay in a range, if it depends on nothing but parameters."""
        formula = self.scope.parse(name, where)
        if formula.symbols <= set(self.parameters):
            self.limits.append((where, formula, interval))

    def check_limits(self, values: Mapping[str, float]) -> None:
        """Refuse parameter values for which one of the limits does not hold."""
        for where, formula, interval in self.limits:
            if formula.symbols <= values.keys():
                interval.check(ex.evaluate(formula, values), where)
        for where, formula, like in self.dissipations:
            ranges = formula.ranges.items()
            if any(not low <= values.get(x, low) <= high for x, (low, high) in ranges):
                from stickslip.convex.smooth import smooth_dissipation

                smooth_dissipation(formula.value, formula.names, values, where, like)


def _alike(a: DryContact, b: DryContact) -> bool:
    """Whether two contacts are along one line."""
    return a.direction.keys() == b.direction.keys() and all(
        a.direction[x] * b.direction[y] is b.direction[x] * a.direction[y]
        for x in a.direction
        for y in a.direction
    )


def declare(system: System) -> Declaration:
    """Read and check a declaration.

    Raises
    ------
    DeclarationError
        Naming the key, the reason and the remedy of the first thing wrong.
    """
    check_shape(system)
    reader = _Reader(system)
    try:
        reader.names()
        reader.energy()
        reader.dissipation()
        reader.contacts()
        reader.laws()
        reader.jumps()
        reader.known_facts()
        reader.defaults()
    except ArithmeticError:
        # Single formulas are checked one by one; this is for two that are too large only together.
        raise DeclarationError(
            system.name, "its numbers are too large", "Check large numbers and exponents"
        ) from None
    return reader.result


class _Reader:
    """Reads one declaration, in the order of its keys."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.result = Declaration(list(system.parameters), {})

    def names(self) -> None:
        system, result = self.system, self.result
        if not system.name.strip():
            raise DeclarationError("name", "the system has no name", "Give it a short name")
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
            self.indexed |= cast("InModes", part).indexed()
        for name, internal in system.internal.items():
            where = entry_key("internal", name)
            names.claim(name, where, rate=f"d_{name}" not in system.internal)
            check_unit(internal.unit, f"{where}.unit")
            result.internal.append(name)
        if not result.state:
            raise DeclarationError(
                "coordinates",
                "the system has no coordinates and no internal variables",
                "Declare at least one, where all moves as given an internal variable with law 1",
            )
        check_unit(system.time_unit, "time_unit")
        start, stop = system.span
        if not (is_finite(start) and is_finite(stop) and start < stop):
            raise DeclarationError("span", "not a time span", "Write [start, end] with start < end")
        names.functions("functions", system.functions)
        names.functions("drives", system.drives, clock="t")
        result.given = measured_drives(system.drives)
        result.check_span(start, stop)
        self.declared = list(names.definitions)
        self.definitions = names.with_derivatives()
        self.constants = {name: ex.sym(name) for name in system.parameters}
        self.state = {
            "t": ex.sym("t"),
            **{n: ex.sym(n) for n in (*result.coordinates, *result.internal)},
        }
        self.velocities = {f"d_{q}": ex.sym(f"d_{q}") for q in result.inertial}
        self.rates = {f"d_{x}": ex.sym(f"d_{x}") for x in result.coordinates}

    def scope(self, *groups: Mapping[str, Expr], why: str) -> Scope:
        names = {name: e for group in (self.constants, *groups) for name, e in group.items()}
        everything = [*self.state, *self.rates, "speed"]
        vectors = {name: v for name, v in self.indexed.items() if v.symbols <= names.keys()}
        forbidden = {n: why for n in (*everything, *self.indexed) if n not in names}
        whole = {n: f"Name one of its unknowns, like {n}[0]" for n in vectors}
        return Scope(names, self.definitions, forbidden | whole, vectors=vectors)

    def energy(self) -> None:
        system, result = self.system, self.result
        self.static = self.scope(why="Only parameters may stand here")
        self.clock = self.scope({"t": self.state["t"]}, why="Only t and parameters may stand here")
        self.place = self.scope(
            self.state, why="Only t, coordinates, internal variables and parameters may stand here"
        )
        self.motion = self.scope(
            self.state, self.velocities, why="Only rates of inertial coordinates may stand here"
        )
        self.anywhere = self.scope(
            self.state, self.rates, {"speed": ex.sym("speed")}, why="Use t, coordinates and rates"
        )
        for name in self.declared:
            self.anywhere.check(name)
        for name in system.drives:
            result.drives[name] = self.clock.parse(name, f"drives.{name}")
        result.potential = self.place.parse(system.potential, "potential")
        _check_slopes(result.potential, result.coordinates, "potential", 2)
        self._check_energy()
        self.inertia = {name: self.state[name] for name in ("t", *result.inertial)}
        speeds = self.scope(
            self.inertia,
            self.velocities,
            why="The kinetic energy uses t, inertial coordinates, their rates and parameters",
        )
        result.kinetic = speeds.parse(system.kinetic, "kinetic")
        _check_slopes(result.kinetic, [*self.inertia, *self.velocities], "kinetic", 2)
        self._check_steps("kinetic", result.kinetic)
        result.mass = _quadratic(result.kinetic, result.inertial, "kinetic", pure=False)
        heavy = {q for pair in result.mass for q in pair}
        for q in result.inertial:
            if q not in heavy:
                raise DeclarationError(
                    f"coordinates.{q}",
                    "an inertial coordinate without mass",
                    f"Add m/2*d_{q}**2 to 'kinetic', or declare it viscous or rate-independent",
                )
        result.start = self.start
        _check_definite(result.mass, result.inertial, self.start, "kinetic", "mass matrix")

    def dissipation(self) -> None:
        system, result = self.system, self.result
        smooth = {k: v for k, v in self.rates.items() if k[2:] not in result.rate_independent}
        scope = self.scope(
            smooth,
            why="The viscous part uses rates of inertial and viscous coordinates and parameters",
        )
        result.dissipation = scope.parse(system.viscous, "viscous")
        result.damping = _quadratic(
            result.dissipation, [*result.inertial, *result.viscous], "viscous"
        )
        self._resistances()
        for z in result.damped:
            if (z, z) not in result.damping:
                raise DeclarationError(
                    f"coordinates.{z}",
                    "a viscous coordinate without viscous friction",
                    f"Add nu/2*d_{z}**2 to 'viscous', give it a drag, or declare it "
                    "rate-independent",
                )
        _check_definite(result.damping, result.damped, system.values, "viscous", _VISCOUS_MATRIX)
        both = [*result.inertial, *result.viscous]
        _check_definite(result.damping, both, system.values, "viscous", "viscous matrix", semi=True)
        state = frozenset(result.state)
        for name, coordinate in system.coordinates.items():
            where = f"coordinates.{name}"
            result.forces[name] = self.motion.parse(coordinate.force, f"{where}.force")
            _check_slopes(result.forces[name], state, f"{where}.force")
            self._check_jumps(f"{where}.force", result.forces[name], -1.0)
            if coordinate.kind == Kind.INERTIAL:
                result.drags[name] = self.motion.parse(coordinate.drag, f"{where}.drag")  # type: ignore[union-attr]
                self._check_jumps(f"{where}.drag", result.drags[name], 1.0)
                self._check_drag(name, result.drags[name])

    def _resistances(self) -> None:
        """Drags of viscous coordinates, and what these may not have beside them."""
        system, result = self.system, self.result
        for z in result.viscous:
            where = f"coordinates.{z}.drag"
            rate = f"d_{z}"
            scope = self.scope(
                self.state,
                self.velocities,
                {rate: ex.sym(rate)},
                why=f"A drag uses {rate} and rates of inertial coordinates",
            )
            drag = scope.parse(system.coordinates[z].drag, where)  # type: ignore[union-attr]
            if drag is ex.ZERO:
                continue
            result.drags[z] = drag
            _check_slopes(drag, [rate, *result.state], where)
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
                    f"'viscous' joins d_{z} to d_{others[0]}",
                    "Couple a coordinate with a drag to other viscous ones by springs, or give it "
                    "mass",
                )
        result.viscous.sort(key=lambda z: z in result.drags)
        for z in result.resisted:
            self._check_drag(z, result.drags[z])
            _check_increasing(result, z, system.values)

    def _check_jumps(self, where: str, formula: Expr, resists: float) -> None:
        """Refuse a function whose jump resists a rate: where the rate stays on the jump, the force
        is any between."""
        for guard, part in _by_guard(formula).items():
            for rate in sorted(guard.symbols & self.velocities.keys()):
                jumps = [resists * jump for jump in self._jumps(part, guard, rate) if jump]
                if guard in self.motion.jumping and jumps and min(jumps) > 0.0:
                    raise DeclarationError(
                        where,
                        f"'{self.motion.jumping[guard]}' makes a force that jumps against {rate}: "
                        "that is dry friction, which may be anything between while nothing slides",
                        f"Declare a contact with a direction like '{rate}' and a threshold",
                    )

    def _check_energy(self) -> None:
        """Refuse an energy that jumps on the way of a coordinate: no force is finite there."""
        for guard, part in _by_guard(self.result.potential).items():
            for x in sorted(guard.symbols & set(self.result.coordinates)):
                if any(self._jumps(part, guard, x)):
                    raise DeclarationError(
                        "potential",
                        f"the energy jumps with {x} where {ex.to_text(unwrapped(guard))} = 0, so "
                        "that the force would be infinite",
                        "Make it continuous, or write the force that jumps under 'force'",
                    )

    def _check_steps(self, where: str, formula: Expr) -> None:
        """Refuse an inertia or a direction that jumps with a coordinate or in time: momentum would
        have to, too."""
        for guard, part in _by_guard(formula).items():
            for x in sorted(guard.symbols & self.inertia.keys()):
                if any(self._jumps(part, guard, x)):
                    raise DeclarationError(
                        where,
                        f"it jumps with {x} where {ex.to_text(unwrapped(guard))} = 0, so that "
                        "velocities would have to jump",
                        "Make it continuous",
                    )

    def _jumps(self, formula: Expr, guard: Expr, name: str) -> list[float]:
        """By how much a formula jumps where a name rises through a guard, at some places; 0 where
        it is not seen to."""
        above, below = (_beside(formula, guard, k) for k in (1, 2))
        slope = ex.derivative(guard, name)
        here = {x: self.start[x] for x in sorted(formula.symbols | guard.symbols)}
        found = []
        for k in (0, 1, -1):  # beside the start, where there may happen to be no jump
            moving = enumerate(sorted(here.keys() - self.constants.keys()))
            at = {**here, **{x: here[x] + 0.1 * k * (i + 3) for i, x in moving}, name: 0.0}
            steep = ex.evaluate(slope, at)
            place = -ex.evaluate(guard, at) / steep if steep else math.nan
            near = 0.1 * (1.0 + abs(place))
            (off, one, other), *around = (
                [ex.evaluate(e, {**at, name: place + shift}) for e in (guard, above, below)]
                for shift in (0.0, near, -near)
            )
            scale = max(abs(value) for side in around for value in side[1:])
            jumps = abs(off) <= 1e-9 * abs(steep) * near and abs(one - other) > 1e-9 * scale
            found.append(math.copysign(one - other, (one - other) * steep) if jumps else 0.0)
        return found

    def _check_drag(self, name: str, drag: Expr) -> None:
        from stickslip.symbolic.enclosures import bounds

        values = {symbol: self.start[symbol] for symbol in drag.symbols}
        for v in (-10.0, -1.0, -0.1, -1e-3, 1e-3, 0.1, 1.0, 10.0):
            at = {**values, f"d_{name}": v}
            if not math.isfinite(ex.evaluate(drag, at)):
                others = ", ".join(f"{n} = {at[n]:g}" for n in sorted(at.keys() & self.state))
                raise DeclarationError(
                    f"coordinates.{name}.drag",
                    f"the resistance is undefined at the start, at d_{name} = {v:g}"
                    + (f", {others}" if others else ""),
                    "Declare initial values at which it is a number",
                )
            low, high = bounds(drag, {n: (a, a) for n, a in at.items()})
            # Refused is what feeds energy in for sure, not for rounding.
            if high < 0.0 if v > 0.0 else low > 0.0:
                raise DeclarationError(
                    f"coordinates.{name}.drag",
                    f"the resistance feeds energy in at d_{name} = {v:g}",
                    "A drag has v*f(v) >= 0; put other forces under 'force'",
                )

    def contacts(self) -> None:
        system, result = self.system, self.result
        self.directions = self.scope(
            self.inertia,
            self.rates,
            why="A direction is a linear combination of rates, with coefficients of t, inertial "
            "coordinates and parameters",
        )
        self.normals = {normal_force(name): ex.sym(normal_force(name)) for name in system.with_gaps}
        for name, sides in system.constraints.items():
            own = [(self.normals[normal_force(side)], 1.0) for side in sides]
            self.normals[normal_force(name)] = ex.add(*own)
        self.pressed = self.scope(
            self.state,
            self.velocities,
            self.normals,
            why="Only rates of inertial coordinates may stand here",
        )
        self.sliding = self.scope(
            self.state,
            self.velocities,
            self.normals,
            {"speed": ex.sym("speed")},
            why="Use 'speed' for |u|",
        )
        self.surface = self.scope(
            self.inertia, why="A surface moves with t, inertial coordinates and parameters"
        )
        self.order = {f"d_{x}": i for i, x in enumerate(result.coordinates)}
        for name, contact in system.plain.contacts.items():
            if JOINED in name:
                raise DeclarationError(
                    entry_key("contacts", name),
                    f"'{JOINED}' joins the names of contacts that rub along one direction",
                    "Give it another name",
                )
            if isinstance(contact, Unilateral):
                result.contacts += self._unilateral(name, contact)
            else:
                result.contacts += self._dry(name, cast("Contact", contact))
        moving = {r: list[str]() for r in result.rate_independent}
        for c in result.contacts:
            for x in c.direction.keys() & moving.keys():
                moving[x].append(c.name)
        for r, acting in moving.items():
            if not acting:
                raise DeclarationError(
                    f"coordinates.{r}",
                    "a rate-independent coordinate without dry friction",
                    f"Add a contact with direction 'd_{r}'",
                )
            if len(acting) > 1:
                raise DeclarationError(
                    entry_key("contacts", acting[1]),
                    f"'{r}' already has the contact '{short(acting[0])}'",
                    "Add their thresholds in one contact",
                )

    def _unilateral(self, name: str, contact: Unilateral) -> list[DryContact]:
        """The normal direction of a contact that can open, and its friction."""
        where = entry_key("contacts", name)
        gaps = self.scope(self.inertia, why="A gap uses t, inertial coordinates and parameters")
        gap = gaps.parse(contact.gap, f"{where}.gap")
        _check_slopes(gap, self.inertia, f"{where}.gap", 3)
        self._check_steps(f"{where}.gap", gap)
        slopes = {q: ex.derivative(gap, q) for q in self.result.inertial}
        direction = {q: slope for q, slope in slopes.items() if slope is not ex.ZERO}
        if not direction:
            raise DeclarationError(
                f"{where}.gap",
                "it depends on no inertial coordinate",
                "Write the distance, such as 'y' or 'y - l*sin(phi)'",
            )
        parts = [
            self.static.parse(given, f"{where}.{key}")
            for key, given in (
                ("restitution", contact.restitution),
                ("tangential_restitution", contact.tangential_restitution),
            )
        ]
        for key, part in zip(("restitution", "tangential_restitution"), parts, strict=True):
            interval = parse_range("[0, 1]", where)
            interval.check(ex.evaluate(part, self.system.values), f"{where}.{key}")
            self.result.limits.append((f"{where}.{key}", part, interval))
        check_unit(contact.unit, f"{where}.unit")
        here = ex.evaluate(gap, self.start)
        # Where nothing else says how large it is, rounding errors of the state are no overlap. How
        # far a constraint holds is seen where a motion starts.
        most = max(abs(self.start[q]) for q in self.result.inertial)
        others = [c.gap for c in self.system.plain.contacts.values() if isinstance(c, Unilateral)]
        held = any(f"-{contact.gap}" == g or contact.gap == f"-{g}" for g in others)
        if not held and here < -1e-12 * max(_size(gap, self.start), 1e-3 * most, 1e-300):
            raise DeclarationError(
                f"{where}.gap",
                f"it is {here:g} at the initial state: the bodies overlap",
                "Start where it is positive, or zero for contact",
            )
        adhesion = self.motion.parse(contact.adhesion, f"{where}.adhesion")
        remedy = "It is the largest pull; write max(..., 0) where it may vanish"
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
            restitution=parts[0],
            side_of=contact.of if isinstance(contact, Side) else "",
        )
        mu = self.motion.parse(contact.mu, f"{where}.mu")
        if not ex.evaluate(mu, self.start) >= 0.0:
            raise DeclarationError(
                f"{where}.mu",
                f"the coefficient of friction is {ex.evaluate(mu, self.start):g} at the start",
                "It is never negative",
            )
        if not contact.direction:
            if mu is not ex.ZERO:
                raise DeclarationError(
                    f"{where}.direction",
                    "friction has no direction",
                    "Give the relative velocity, like direction = 'd_x'",
                )
            return [normal]
        coefficients = replace(
            contact.friction(name), threshold=contact.mu, kinetic=contact.kinetic
        )
        rubs = self._dry(name, coefficients)
        if rubs[0].direction and rubs[0].kind != Kind.INERTIAL:
            raise DeclarationError(
                f"{where}.direction",
                f"its coordinates are {rubs[0].kind}",
                "A contact that can open moves inertial coordinates",
            )
        normal_here = ex.sym(normal_force(name))
        friction = [
            replace(
                part,
                plus=part.plus * normal_here,
                minus=part.minus * normal_here,
                kinetic_plus=part.kinetic_plus * normal_here,
                kinetic_minus=part.kinetic_minus * normal_here,
                on=normal_force(name),
                restitution=parts[1],
            )
            for part in rubs
        ]
        return [normal, *friction]

    def _dry(self, name: str, contact: Contact) -> list[DryContact]:
        """A contact along a line, or the two components of one in a plane."""
        where = entry_key("contacts", name)
        if contact.threshold == "":
            raise DeclarationError(
                f"{where}.threshold",
                "this key is missing",
                'Add the largest force that it holds, like threshold = "mu*m*g"',
            )
        if isinstance(contact.direction, str):
            if contact.dissipation is not None:
                raise DeclarationError(
                    f"{where}.dissipation",
                    "a contact along a line has none",
                    "Give a pair of thresholds, or two directions, like direction = ['d_x', 'd_y']",
                )
            if isinstance(contact.surface_speed, tuple):
                raise DeclarationError(
                    f"{where}.surface_speed",
                    "two components, and a contact along a line has one",
                    "Give one formula, or two directions, like direction = ['d_x', 'd_y']",
                )
            if contact.axes != (1.0, 1.0):
                raise DeclarationError(
                    f"{where}.axes",
                    "a contact along a line has none",
                    "Give two directions, like direction = ['d_x', 'd_y'], or leave the axes out",
                )
            return [self._contact(name, contact)]
        for key, given in (("threshold", contact.threshold), ("kinetic", contact.kinetic)):
            if isinstance(given, tuple):
                raise DeclarationError(
                    f"{where}.{key}",
                    "a contact in a plane has one, for all directions",
                    "Give one formula, and its axes where friction is not the same in both "
                    "directions",
                )
        given = contact.surface_speed
        count = len(contact.direction)
        if (given != 0.0) if not isinstance(given, tuple) else (len(given) != count):
            raise DeclarationError(
                f"{where}.surface_speed",
                f"a surface below it has a velocity of {_NUMBERS[count]} components",
                f"Write it like ['{given if isinstance(given, str | float | int) else 'V'}'"
                f"{', 0' * (count - 1)}]",
            )
        lengths = contact.axes
        if contact.dissipation is None and len(lengths) != count:
            raise DeclarationError(
                f"{where}.axes",
                f"there are {len(lengths)} for {count} directions",
                "Give the half axes of the ellipsoid of forces and moments, like [1, 1, '2*a/3'] "
                "for a disc of radius a, or a dissipation, like 'disc(v1, v2, a*v3)'"
                if count == 3
                else "Give one for each direction, like [1.0, 0.6]",
            )
        lengths = lengths if len(lengths) == count else (1.0,) * count
        axes = [self._axis(axis, f"{where}.axes") for axis in lengths]
        formula = None
        if contact.dissipation is not None or count == 3:
            formula = self._dissipation(where, contact, axes)
            axes = [ex.ONE] * count
        parts = contact.components(name)
        for label in parts:
            if label in self.system.contacts:
                raise DeclarationError(
                    where,
                    f"its components need the name '{label}', which is taken",
                    "Rename one of the two",
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
        """The dissipation of a contact in a plane, or of a face, that has a formula, or axes."""
        from stickslip.convex.faces import mean_speeds, norms_instead
        from stickslip.convex.smooth import smooth_dissipation

        key = f"{where}.dissipation"
        names = _VELOCITIES[: len(axes)]
        velocities = {x: ex.sym(x) for x in names}
        if contact.dissipation is None:
            parts = zip(axes, velocities.values(), strict=True)
            squares = ((a * a * v * v, 1.0) for a, v in parts)
            value = ex.power(ex.add(*squares), ex.num(0.5))
            found = smooth_dissipation(value, names, self.system.values, f"{where}.axes")
            self.result.dissipations.append((f"{where}.axes", found, None))
            return found
        if contact.axes != (1.0, 1.0):
            raise DeclarationError(
                f"{where}.axes",
                "it has a dissipation, which says how friction depends on the direction",
                "Leave one of the two out",
            )
        taken = [x for x in names if x in self.constants]
        if taken:
            raise DeclarationError(
                key,
                f"'{taken[0]}' is a component of the relative velocity there, and a parameter",
                "Rename the parameter",
            )
        why = f"A dissipation uses {', '.join(names)} and parameters"
        scope = self.scope(velocities, why=why)
        value, like = (
            replace(scope, definitions={**own, **scope.definitions}).parse(contact.dissipation, key)
            for own in (mean_speeds(), norms_instead())
        )
        alike = None if like is value else like
        found = smooth_dissipation(value, names, self.system.values, key, alike)
        self.result.dissipations.append((key, found, alike))
        return found

    def _check_formula(self, where: str, part: DryContact) -> None:
        """Refuse a dissipation where no motion knows it."""
        if part.kind != Kind.INERTIAL and not part.prescribed:
            raise DeclarationError(
                f"{where}.dissipation",
                f"its coordinates are {part.kind}",
                "Declare them inertial; evolutions without mass take a SupportFormula",
            )
        pressed = (part.plus.symbols | part.kinetic_plus.symbols) & self.normals.keys()
        if pressed:
            raise DeclarationError(
                f"{where}.threshold",
                f"it depends on {min(pressed)}, and the contact has a dissipation of its own",
                "Give the normal force as a formula of time and state, or leave the dissipation "
                "out",
            )

    def _axis(self, given: object, where: str) -> Expr:
        """A half axis, which is positive."""
        axis = self.static.parse(given, where)
        interval = parse_range("(0, inf)", where)
        interval.check(ex.evaluate(axis, self.system.values), where)
        self.result.limits.append((where, axis, interval))
        return axis

    def _check_plane(self, where: str, parts: list[DryContact]) -> None:
        """Refuse components that are of different kinds, or along one line, and thresholds whose
        squares overflow."""
        for threshold in {parts[0].plus, parts[0].kinetic_plus}:
            if threshold.symbols <= self.system.parameters.keys():
                interval = parse_range("[-inf, 1e150]", where)
                interval.check(ex.evaluate(threshold, self.system.values), f"{where}.threshold")
                self.result.limits.append((f"{where}.threshold", threshold, interval))
        first, *others = parts
        second = others[-1]
        if any(first.prescribed != other.prescribed for other in others):
            raise DeclarationError(
                f"{where}.direction",
                "one of its components has no rate",
                "Give two independent combinations of rates, like ['d_x', 'd_y'], or none at all "
                "where both surfaces move as given",
            )
        if first.prescribed and all(part.speed is ex.ZERO for part in parts):
            raise DeclarationError(
                f"{where}.direction", "neither side moves", "Write it like ['d_x', 'd_y']"
            )
        second = next((other for other in others if other.kind != first.kind), second)
        if first.kind != second.kind:
            raise DeclarationError(
                f"{where}.direction",
                f"its components are {first.kind} and {second.kind}",
                "Give all coordinates of one contact the same kind",
            )
        pairs = [(a, b) for i, a in enumerate(parts) for b in parts[i + 1 :]]
        if not first.prescribed and any(_alike(a, b) for a, b in pairs):
            raise DeclarationError(
                f"{where}.direction",
                f"{'both' if len(parts) == 2 else 'two'} of its components are along one line",
                f"Give {_NUMBERS[len(parts)]} independent combinations of rates, like "
                f"{['d_x', 'd_y', 'd_phi'][: len(parts)]}, or fewer",
            )
        if len(parts) > 2 and not first.prescribed and self._are_dependent(parts):
            raise DeclarationError(
                f"{where}.direction",
                "one of its components is a combination of the others",
                "Give independent combinations of rates, like ['d_x', 'd_y', 'd_phi']",
            )

    def _are_dependent(self, parts: list[DryContact]) -> bool:
        """Whether directions depend on each other, whatever the parameters and the state are."""
        import numpy as np

        names = sorted({x for part in parts for x in part.direction})
        entries = [[part.direction.get(x, ex.ZERO) for x in names] for part in parts]
        symbols = sorted({x for row in entries for e in row for x in e.symbols})
        # Parameters may be zero until a motion is asked for, so the rank is that at a place that is
        # not special.
        rng = np.random.default_rng(0)
        place = dict(zip(symbols, rng.uniform(0.5, 1.5, len(symbols)), strict=True))
        J = np.array([[ex.evaluate(e, place) for e in row] for row in entries])
        sizes = np.linalg.norm(J, axis=1)
        if not (np.isfinite(sizes).all() and sizes.all()):
            return False
        return bool(np.linalg.matrix_rank(J / sizes[:, None]) < len(parts))

    def _contact(self, name: str, contact: Contact, declared: str = "") -> DryContact:
        """A contact along a line, or a component of the one that was declared."""
        where = entry_key("contacts", declared or name)
        text = self.directions.parse(contact.direction, f"{where}.direction")
        rates = sorted(text.symbols & self.order.keys(), key=self.order.__getitem__)
        slopes = {rate[2:]: ex.derivative(text, rate) for rate in rates}
        direction = {x: c for x, c in slopes.items() if c is not ex.ZERO}
        if not rates and text.symbols <= {"t", *self.constants}:
            return self._prescribed(name, contact, text, declared)
        linear = ex.add(*((c * self.rates[f"d_{x}"], 1.0) for x, c in direction.items()))
        curved = any(c.symbols & self.rates.keys() for c in direction.values())
        if not direction or curved or ex.bends(text, self.rates):
            raise DeclarationError(
                f"{where}.direction",
                "not a linear combination of rates",
                PLANAR if len(direction) > 1 else "Write it like 'd_x' or 'd_x2 - d_x1'",
            )
        rest = ex.substitute(text, {f"d_{x}": ex.ZERO for x in direction})
        if rest is not ex.ZERO and ex.add((text, 1.0), (linear, -1.0)) is not ex.ZERO:
            raise DeclarationError(
                f"{where}.direction",
                f"it contains the constant {short(repr(rest))}",
                "Put it under surface_speed",
            )
        kinds = {self.system.coordinates[x].kind for x in direction}
        if len(kinds) > 1:
            raise DeclarationError(
                f"{where}.direction",
                f"it joins {' and '.join(sorted(kinds))} coordinates",
                "Give all coordinates of one contact the same kind",
            )
        kind = kinds.pop()
        turning = sorted(
            {name for c in direction.values() for name in c.symbols & self.inertia.keys()}
        )
        if turning and kind != Kind.INERTIAL:
            raise DeclarationError(
                f"{where}.direction",
                f"it depends on {turning[0]}, and its coordinates are {kind}",
                "Let it have constant coefficients, or declare the coordinates inertial",
            )
        if turning:
            _check_slopes(text, [*self.inertia, *self.rates], f"{where}.direction", 2)
            self._check_steps(f"{where}.direction", text)
        resisted = direction.keys() & set(self.result.resisted)
        if resisted:
            raise DeclarationError(
                f"{where}.direction",
                f"'{min(resisted)}' has a drag, whose rate no contact may hold",
                "Put the friction into the drag, join another coordinate by a spring, or declare "
                "the coordinate inertial",
            )
        if kind == Kind.RATE_INDEPENDENT and len(direction) > 1:
            raise DeclarationError(
                f"{where}.direction",
                "a contact of rate-independent coordinates moves one of them",
                "Use one contact per coordinate, or give them viscosity",
            )
        inertial = kind == Kind.INERTIAL
        places = self.surface if declared and inertial else self.clock
        speed = places.parse(contact.surface_speed, f"{where}.surface_speed")
        forces = self._forces(where, contact, kind, in_plane=bool(declared))
        return DryContact(name, kind, direction, *forces, speed, contact.unit)

    def _prescribed(self, name: str, contact: Contact, moves: Expr, declared: str) -> DryContact:
        """Friction between motions that are given.

        Parameters
        ----------
        name, contact, declared
            As of :meth:`_contact`.
        moves : Expr
            The velocity that its direction stands for.
        """
        where = entry_key("contacts", declared or name)
        places = self.surface if declared else self.clock
        speed = places.parse(contact.surface_speed, f"{where}.surface_speed") - moves
        if "t" not in moves.symbols and moves is not ex.ZERO:
            raise DeclarationError(
                f"{where}.direction",
                "not a linear combination of rates",
                "Write it like 'd_x', or 'd_xi' with a drive xi; '0' for a surface_speed alone",
            )
        if speed is ex.ZERO and not declared:
            raise DeclarationError(
                f"{where}.direction",
                "neither side moves",
                "Write it like 'd_x' or 'd_x2 - d_x1', or give a surface_speed",
            )
        forces = self._forces(where, contact, None, in_plane=bool(declared))
        return DryContact(name, Kind.VISCOUS, {}, *forces, speed, contact.unit)

    def _forces(
        self, where: str, contact: Contact, kind: Kind | None, in_plane: bool
    ) -> tuple[Expr, Expr, Expr, Expr]:
        """Thresholds and sliding forces of a contact of coordinates of a kind, or of none."""
        pressed = self.pressed if kind in (Kind.INERTIAL, None) else self.motion
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
                    "without inertia or viscosity the drop to the kinetic force is a jump",
                    "Declare the coordinate viscous or inertial",
                )
            if kind == Kind.VISCOUS and any("speed" in k.symbols for k in kinetic):
                raise DeclarationError(
                    f"{where}.kinetic",
                    "for viscous coordinates it may not depend on the speed",
                    "Declare the coordinate inertial, or put the slope into 'viscous'",
                )
        self._check_pressed(where, (plus, minus, *kinetic), in_plane)
        check_unit(contact.unit, f"{where}.unit")
        values = self.start
        for static, sliding_force in zip((plus, minus), kinetic, strict=True):
            self._check_threshold(static, f"{where}.threshold", _REMEDY)
            at_rest = ex.evaluate(sliding_force, values)
            if not 0.0 <= at_rest <= ex.evaluate(static, values) * (1 + 1e-12):
                raise DeclarationError(
                    f"{where}.kinetic",
                    f"the kinetic force {at_rest:g} is not between 0 and the threshold",
                    "Sliding friction is at most the threshold",
                )
        return plus, minus, *kinetic

    def _check_pressed(self, where: str, forces: tuple[Expr, ...], in_plane: bool) -> None:
        """Refuse coefficients of friction that are negative, or larger in sliding than at rest;
        and in a plane a part without a normal force, or several coefficients."""
        own = set().union(*(force.symbols & self.normals.keys() for force in forces))
        for name in sorted(own):
            slopes = [ex.evaluate(ex.derivative(force, name), self.start) for force in forces]
            plus, minus, *sliding = slopes
            if not all(
                0.0 <= slope <= static * (1 + 1e-12)
                for slope, static in zip(sliding, (plus, minus), strict=True)
            ):
                raise DeclarationError(
                    where,
                    f"its coefficients under {name} are {plus:g} at rest and {sliding[0]:g} in "
                    "sliding at the start",
                    "They are not negative, and sliding friction is at most the threshold",
                )
        nothing = dict.fromkeys(own, ex.ZERO)
        rest = [ex.substitute(force, nothing) for force in forces]
        uneven = any(len({ex.derivative(force, name) for name in own}) > 1 for force in forces)
        if in_plane and own and (uneven or any(e is not ex.ZERO for e in rest)):
            raise DeclarationError(
                f"{where}.threshold",
                f"in a plane it is not proportional to {min(own)} alone",
                f"Write it like 'mu*{min(own)}', and give other friction a contact of its own",
            )

    def _check_proportional(self, where: str, force: Expr) -> None:
        """Refuse a friction force that is not linear in normal forces."""
        own = force.symbols & self.normals.keys()
        slopes = [ex.derivative(force, name) for name in own]
        if any(slope.symbols & own for slope in slopes) or ex.bends(force, own):
            raise DeclarationError(
                where,
                f"it is not linear in {min(own)}",
                f"Write it like '0.5 + mu*{min(own)}', with a coefficient without normal forces",
            )

    def _pair(self, given: object, where: str, scope: Scope) -> tuple[Expr, Expr]:
        if isinstance(given, tuple):
            return scope.parse(given[0], where), scope.parse(given[1], where)
        both = scope.parse(given, where)
        return both, both

    def _check_threshold(self, threshold: Expr, where: str, remedy: str) -> None:
        values = self.start
        from stickslip.symbolic.enclosures import bounds

        given = self.system.values
        boxes = {n: (given[n], given[n]) for n in threshold.symbols & given.keys()}
        low, high = bounds(threshold, boxes) if threshold.symbols else (ex.number(threshold),) * 2
        here = ex.evaluate(threshold, values)
        if not 0.0 <= here < math.inf:
            raise DeclarationError(where, f"it is {here:g} at the initial state", remedy)
        if low < -1e-12 * abs(high):
            if not threshold.symbols & (self.state.keys() - {"t"}):
                low = self._lowest_in_time(threshold, boxes)
            if -math.inf < low < 0.0:
                raise DeclarationError(
                    where, f"it can become negative (as low as {low:.4g})", remedy
                )

    def _lowest_in_time(self, threshold: Expr, boxes: dict[str, tuple[float, float]]) -> float:
        from stickslip.symbolic.extrema import least

        return least(threshold, "t", *self.system.span, others=boxes, below=0.0).value

    def laws(self) -> None:
        scope = self.scope(
            self.state, self.rates, why="The speed of a contact is known to its kinetic law only"
        )
        state = frozenset(self.result.state)
        for name, internal in self.system.internal.items():
            self.result.laws[name] = scope.parse(internal.law, f"internal.{name}.law")
            _check_slopes(self.result.laws[name], state, f"internal.{name}.law")

    def jumps(self) -> None:
        """Guards and new values; each guard fires one jump."""
        result = self.result
        felt = frozenset([*result.state, "t"])
        taken: dict[tuple[Expr, int], str] = {}
        for name, jump in self.system.jumps.items():
            where = entry_key("jumps", name)
            guard = self.motion.parse(jump.when, f"{where}.when")
            _check_slopes(guard, felt, f"{where}.when")
            if not guard.symbols & felt:
                raise DeclarationError(
                    f"{where}.when",
                    "it depends neither on the state nor on time, so that it never passes through "
                    "zero",
                    "Write what vanishes where the state jumps, such as 'x - 1'",
                )
            if not jump.to:
                raise DeclarationError(
                    f"{where}.to", "nothing jumps", 'Give new values, like {d_x = "-d_x"}'
                )
            direction = CROSSINGS[jump.direction]
            for way in (-1, 1) if direction == 0 else (direction,):
                if (guard, way) in taken:
                    raise DeclarationError(
                        f"{where}.when",
                        f"'{short(taken[guard, way])}' jumps there, too",
                        "Give all new values in one jump, or one of them another direction",
                    )
                taken[guard, way] = name
            values = {x: self._landing(f"{where}.to", x, value) for x, value in jump.to.items()}
            result.jumps.append(StateJump(name, guard, direction, values))

    def _landing(self, where: str, name: str, value: object) -> Expr:
        """The new value of a part of the state."""
        result = self.result
        if name not in result.places:
            massless = name[2:] in (*result.viscous, *result.rate_independent)
            if name.startswith("d_") and massless:
                raise DeclarationError(
                    entry_key(where, name),
                    f"the rate of '{name[2:]}', which has no inertia, follows from the forces",
                    f"Let '{name[2:]}' jump, or declare it inertial",
                )
            raise DeclarationError(
                entry_key(where, name),
                "not a part of the state",
                suggestion(name, result.state),
            )
        return self.motion.parse(value, entry_key(where, name))

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

    def defaults(self) -> None:
        system, result = self.system, self.result
        for name, value in system.initial.items():
            check_initial(result, name, value)
        for name, weight in system.translation.items():
            if name not in result.coordinates or not is_finite(weight):
                raise DeclarationError(
                    entry_key("translation", name),
                    "not a coordinate with a number",
                    "Name coordinates, like x = 1",
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
            tested += [ex.along(guard, shift) for guard in _by_guard(formula)]
            for moved in states:
                if any(
                    abs(ex.evaluate(probe, moved)) > 1e-9 * _size(probe, moved) for probe in tested
                ):
                    raise DeclarationError(
                        "translation",
                        f"the shift changes {where}",
                        "Remove it, or correct the direction",
                    )

    @cached_property
    def start(self) -> dict[str, float]:
        """Values at the start, at rest where none is declared."""
        state = dict.fromkeys([*self.state, *self.rates, "speed"], 0.0)
        given = {k: float(v) for k, v in self.system.initial.items() if is_finite(v)}
        pressed = {normal_force(name): 0.0 for name in self.system.with_gaps}
        return {**state, **given, **self.system.values, **pressed, "t": float(self.system.span[0])}


def _check_increasing(d: Declaration, z: str, values: Mapping[str, float]) -> None:
    """Refuse a resistance of a viscous coordinate that does not increase with its rate: by an
    enclosure, and at rates of many sizes where the motion starts."""
    from stickslip.symbolic.enclosures import bounds

    rate = f"d_{z}"
    slope = ex.derivative(d.resistance(z), rate)
    boxes = {name: (value, value) for name, value in values.items() if name in slope.symbols}
    sure = bounds(slope, boxes)[0] >= 0.0
    sizes = [10.0**k for k in range(-12, 4)]
    for v in (0.0, *sizes, *(-size for size in sizes)):
        steep = ex.evaluate(slope, {**d.start, **values, rate: v})
        if not (steep > 0.0 if v == 0.0 else steep >= 0.0 or sure):
            at = ", ".join(
                f"{name} = {d.start[name]:g}" for name in sorted(slope.symbols & set(d.state))
            )
            raise DeclarationError(
                f"coordinates.{z}.drag",
                f"the resistance does not increase with {rate} at {rate} = {v:g}"
                + (f", {at}" if at else "")
                + f" (its slope is {steep:g})",
                "A drag of a coordinate without mass increases with its rate; add eta/2*"
                f"{rate}**2 to 'viscous', or declare the coordinate inertial",
            )


def check_initial(declaration: Declaration, name: str, value: object) -> None:
    """Refuse an initial value of something that is no part of the state."""
    where = entry_key("initial", name)
    if name not in declaration.places:
        raise DeclarationError(
            where, "not a part of the state", f"The state is {some(declaration.state)}"
        )
    if not is_finite(value):
        raise DeclarationError(where, "its value is not a finite number", "Give a number")


def _quadratic(
    form: Expr, names: Iterable[str], where: str, pure: bool = True
) -> dict[tuple[str, str], Expr]:
    """Matrix of a form of degree two in the rates of the named coordinates; a pure one has no terms
    of lower degree."""
    order = {f"d_{x}": (i, x) for i, x in enumerate(names)}
    at_rest = dict.fromkeys(order, ex.ZERO)
    if ex.bends(form, order):
        raise DeclarationError(
            where, "not quadratic: it has kinks or jumps in the rates", _QUADRATIC
        )
    _check_slopes(form, order, where, 2)
    matrix = {}
    for rate, (i, x) in order.items():
        slope = ex.derivative(form, rate)
        for j, y in sorted(order[other] for other in slope.symbols & order.keys()):
            if j > i:
                break
            entry = ex.derivative(slope, f"d_{y}")
            if entry.symbols & order.keys():
                raise DeclarationError(where, f"not quadratic in d_{x}", "Write it like m/2*d_x**2")
            if entry is not ex.ZERO:
                matrix[x, y] = matrix[y, x] = entry
        rest = ex.substitute(slope, at_rest)
        if pure and rest is not ex.ZERO:
            raise DeclarationError(where, f"it has a part linear in d_{x}", _QUADRATIC)
    if pure and ex.substitute(form, at_rest) is not ex.ZERO:
        raise DeclarationError(where, "it has a part without rates", _QUADRATIC)
    return matrix


def _check_slopes(formula: Expr, names: Iterable[str], where: str, order: int = 1) -> None:
    """Refuse a formula whose derivatives cannot be formed."""
    names = frozenset(names)
    try:
        slopes = [formula]
        for _ in range(order):
            slopes = [ex.derivative(e, name) for e in slopes for name in e.symbols & names]
    except ArithmeticError:
        raise DeclarationError(
            where,
            "its derivatives contain numbers that are too large or undefined",
            "Check exponents and large numbers",
        ) from None


def _beside(formula: Expr, guard: Expr, branch: int) -> Expr:
    """A formula on one side of a guard: with the first or second branch of each of its selects."""

    def change(e: Expr) -> Expr | None:
        return e.args[branch] if e.op == "select" and e.args[0] is guard else None

    return ex.rewrite(formula, change, again=True, undefined=True)


def _by_guard(formula: Expr) -> dict[Expr, Expr]:
    """For each guard of a kink, the terms of a formula in which it stands."""
    found: dict[Expr, dict[Expr, float]] = {}
    for term, c in formula.terms if formula.op == "sum" else ((formula, 1.0),):
        for e in ex.walk([term]):
            if e.op == "select":
                found.setdefault(e.args[0], {})[term] = c
    return {guard: ex.add(*terms.items()) for guard, terms in found.items()}


def _size(e: Expr, values: Mapping[str, float]) -> float:
    """Sum of the moduli of the terms of an expression."""
    terms = e.terms if e.op == "sum" else [(e, 1.0)]
    constant = abs(float(e.value)) if e.op == "sum" else 0.0
    return constant + sum(abs(c * ex.evaluate(term, values)) for term, c in terms)


def _check_definite(
    matrix: Mapping[tuple[str, str], Expr],
    names: list[str],
    values: Mapping[str, float],
    where: str,
    what: str,
    semi: bool = False,
) -> None:
    """Refuse a matrix that is not symmetric positive (semi-)definite, by Cholesky factorisation of
    the entries that there are.

    Its diagonal is scaled to 1 before pivots are judged: coordinates may have any units.
    """
    place = {x: i for i, x in enumerate(names)}
    # right of the diagonal and on it
    rows = [dict[int, float]() for _ in names]
    largest = [0.0] * len(names)
    for (x, y), entry in matrix.items():
        if x in place and y in place:
            i, j = place[x], place[y]
            value = ex.evaluate(entry, values)
            largest[i] = max(largest[i], abs(value))
            if i <= j:
                rows[i][j] = value
    own = [abs(row.get(i, 0.0)) for i, row in enumerate(rows)]
    scale = [math.sqrt(a or b or 1.0) for a, b in zip(own, largest, strict=True)]
    rows = [{j: a / scale[i] / scale[j] for j, a in row.items()} for i, row in enumerate(rows)]
    small = 1e-13
    for k, row in enumerate(rows):
        pivot = row.pop(k, 0.0)
        if not (pivot >= -small if semi else pivot > small):
            kind = "positive semidefinite" if semi else "positive definite"
            raise DeclarationError(
                where,
                f"the {what} is not {kind} (at '{names[k]}')",
                "Check signs and missing terms",
            )
        if pivot <= small:
            if any(abs(a) > small for a in row.values()):
                raise DeclarationError(
                    where,
                    f"the {what} is not positive semidefinite (at '{names[k]}')",
                    "Check signs and missing terms",
                )
            continue
        for i, a in row.items():
            for j, b in row.items():
                if j >= i:
                    rows[i][j] = rows[i].get(j, 0.0) - a / pivot * b
