"""A declaration that has been read (:mod:`stickslip.model.reading`): formulas as expressions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import TYPE_CHECKING

from stickslip.errors import DeclarationError, short, suggestion
from stickslip.kept import cached_property
from stickslip.model.entries.checks import check_definite
from stickslip.model.entries.declared import Kind
from stickslip.model.entries.keys import NORMAL
from stickslip.model.formats.expected import entry_key
from stickslip.model.names import Range, check_covered
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import Scope, TimeFunction, is_finite

if TYPE_CHECKING:
    from stickslip.convex.formula import ConvexFormula


@dataclass(frozen=True)
class DryContact:
    """A contact of a declaration, with its formulas as expressions: a contact along a line, a
    component of a contact in a plane or of a face, or the normal direction of a contact that can
    open.

    Attributes
    ----------
    kind : str
        Kind of the coordinates on which the contact acts. It is viscous if there are none, between
        prescribed motions: the velocity is then not part of the state.
    direction : dict of str to Expr
        Coefficients of the relative velocity u by coordinate. They may depend on t and inertial
        coordinates if these are the coordinates of the contact; otherwise they are constant.
    plus, minus : Expr
        Thresholds for u > 0 and u < 0; for a normal direction, the adhesion, and 0.
    kinetic_plus, kinetic_minus : Expr
        Kinetic friction forces (by default the thresholds); may contain the symbol ``speed``.
        Thresholds and kinetic forces may contain normal forces.
    speed : Expr
        Surface speed.
    gap : Expr or None
        For a normal direction, the gap: u is its rate, λ the normal force.
    on : str
        For the friction of a contact that can open, the name of its normal direction.
    restitution : Expr
        Coefficient of restitution of a normal direction, or of its friction.
    plane : int
        1, 2 for the components of a contact in a plane, 1, 2, 3 for those of a face; 0 otherwise.
        The thresholds and kinetic forces of components are those of |A⁻¹λ| with all components λ.
    axis : Expr
        For a component, its diagonal entry of A.
    dissipation : ConvexFormula or None
        For a component, R in units of the threshold; A is then the identity.
    side_of : str
        For a side of a constraint, the name of the constraint.
    ratio : Expr
        Ratio of the relative velocity, or gap, to that of the first contact of its group
        (:mod:`stickslip.equations.multiples`).
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
        """Whether both of its sides have prescribed motions."""
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
    """A declared jump of the state, with its formulas as expressions.

    Attributes
    ----------
    guard : Expr
        The state jumps when the guard passes through zero.
    direction : int
        Sign of the rate of the guard at which the state jumps; 0 for both signs.
    values : dict of str to Expr
        New values of components of the state, as functions of the values before.
    kink : int
        Index of the guard among the kinks of the equations of motion; −1 before these are derived.
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
    otherwise : str
        What happens where it fails.
    """

    margin: Expr
    strict: bool
    otherwise: str

    def fails(self, values: Mapping[str, float]) -> str:
        """Reason why it fails for given parameters; empty if it holds."""
        margin = ex.evaluate(self.margin, values)
        if math.isnan(margin):
            return "undefined for these parameters"
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
    forces : dict of str to Expr
        Non-potential forces.
    drags : dict of str to Expr
        Resistances f(v) of inertial coordinates, and of viscous ones that have any.
    laws : dict of str to Expr
        Rates of the internal variables.
    outputs : dict of str to Expr
        What results show besides, by the names of :attr:`published`.
    scope : Scope
        What names mean in a formula that may use all of them.
    given : dict of str to TimeFunction
        Drives that are no formulas.
    limits : list of (str, Expr, Range)
        Closed formulas that have to stay in a range, with their places: parameters of laws.
    dissipations : list of (str, ConvexFormula, Expr or None)
        Of contacts that have a formula, with their places, and norms in place of mean speeds;
        checked for the declared parameters.
    bodies : list of tuple of str
        The modes of each structure, which are inertial coordinates.
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
    outputs: dict[str, Expr] = field(default_factory=dict)
    drives: dict[str, Expr] = field(default_factory=dict)
    given: dict[str, TimeFunction] = field(default_factory=dict)
    limits: list[tuple[str, Expr, Range]] = field(default_factory=list)
    dissipations: list[tuple[str, ConvexFormula, Expr | None]] = field(default_factory=list)
    scope: Scope = field(default_factory=lambda: Scope({}))
    bodies: list[tuple[str, ...]] = field(default_factory=list)
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
        """Resistance of a viscous coordinate with a drag, including the viscous part."""
        own = self.damping.get((z, z), ex.ZERO)
        return self.drags[z] + own * ex.sym(f"d_{z}")

    @cached_property
    def moving_energy(self) -> Expr:
        """Contribution of the kinetic energy to the balanced energy, q̇·∂T/∂q̇ − T (Jacobi's
        integral): T itself if it is a quadratic form."""
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
    def published(self) -> frozenset[str]:
        """Names of the quantities that results show, but for outputs and modes."""
        from stickslip.model.quantities import ENERGIES, FORCES, IN_PLANE, contact_key

        found = {*self.state, *ENERGIES}
        found |= {f"d_{x}" for x in (*self.coordinates, *self.internal)}
        found |= {f"dd_{q}" for q in self.inertial}
        for c in self.contacts:
            key = contact_key(c.name)
            if c.side_of:
                found.add(f"{NORMAL}{contact_key(c.side_of)}")
            elif c.opens:
                found |= {key, f"gap_{key.removeprefix(NORMAL)}"}
            else:
                kinds = IN_PLANE if c.plane else FORCES
                found |= {f"{kind}_{key}" for kind in (*kinds, "slip_speed")}
        return frozenset(found)

    @cached_property
    def results(self) -> Scope:
        """Meanings of names in formulas of quantities of results."""
        scope = self.scope
        names = {name: ex.sym(name) for name in self.published} | dict(scope.names)
        del names["speed"]
        speed = {"speed": "Name the contact, like slip_speed_c for contact c"}
        return Scope(names, scope.definitions, {**scope.forbidden, **speed}, vectors=scope.vectors)

    @cached_property
    def places(self) -> dict[str, int]:
        """Index of each part of the state."""
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
                    f"unknown name '{short(name)}'",
                    f"Did you mean '{close[0]}'?" if close else "Use t, the state and parameters",
                )
        lacking = sorted(expression.symbols - values.keys())
        if lacking:
            raise DeclarationError("values", f"'{lacking[0]}' has no value", "Give its value")
        return ex.evaluate(expression, values)

    def check_span(self, start: float, stop: float) -> None:
        """Reject a time span that a drive does not cover."""
        check_covered(self.given, start, stop)

    def kinks_known(self, start: float, stop: float) -> int:
        """Maximum number of kinks of measured drives in a time span."""
        return sum(drive.count(start, stop) for drive in self.given.values())

    def check_range(self, name: str, value: object) -> None:
        """Reject one parameter value that is unknown, no number, or out of range."""
        where = entry_key("parameters", name)
        if name not in self.ranges:
            raise DeclarationError(where, "unknown parameter", suggestion(name, self.parameters))
        self.ranges[name].check(value, where)

    def check_parameters(self, values: Mapping[str, float]) -> None:
        """Reject parameter values that are unknown, out of range, or make M or C indefinite.

        Raises
        ------
        DeclarationError
        """
        for name, value in values.items():
            self.check_range(name, value)
        self.check_limits(values)
        self.check_mass({**self.start, **values})
        self.check_damping(values)
        for z in self.resisted:
            self.check_increasing(z, values)

    def check_mass(self, values: Mapping[str, float]) -> None:
        """Reject a mass matrix that is not positive definite."""
        check_definite(self.mass, self.inertial, values, "kinetic", "mass matrix")

    def check_damping(self, values: Mapping[str, float]) -> None:
        """Reject a viscous matrix of viscous coordinates without a drag that is not positive
        definite."""
        what = "viscous matrix of the viscous coordinates"
        check_definite(self.damping, self.damped, values, "viscous", what)

    def check_increasing(self, z: str, values: Mapping[str, float]) -> None:
        """Reject a resistance of a viscous coordinate that does not increase with its rate: by an
        enclosure, and at rates of many sizes where the motion starts."""
        from stickslip.symbolic.enclosures import bounds

        rate = f"d_{z}"
        slope = ex.derivative(self.resistance(z), rate)
        boxes = {name: (value, value) for name, value in values.items() if name in slope.symbols}
        sure = bounds(slope, boxes)[0] >= 0.0
        sizes = [10.0**k for k in range(-12, 4)]
        for v in (0.0, *sizes, *(-size for size in sizes)):
            steep = ex.evaluate(slope, {**self.start, **values, rate: v})
            if not (steep > 0.0 if v == 0.0 else steep >= 0.0 or sure):
                at = ", ".join(
                    f"{name} = {self.start[name]:g}"
                    for name in sorted(slope.symbols & set(self.state))
                )
                raise DeclarationError(
                    f"coordinates.{z}.drag",
                    f"the resistance does not increase with {rate} at {rate} = {v:g}"
                    + (f", {at}" if at else "")
                    + f" (its slope is {steep:g})",
                    "The drag of a coordinate without mass must increase with its rate; add "
                    f"eta/2*{rate}**2 to 'viscous', or declare the coordinate inertial",
                )

    def limit(self, where: str, name: str, interval: Range) -> None:
        """Require that the value of a name remains in a range, if it depends on parameters
        alone."""
        formula = self.scope.parse(name, where)
        if formula.symbols <= set(self.parameters):
            self.limits.append((where, formula, interval))

    def check_limits(self, values: Mapping[str, float]) -> None:
        """Reject parameter values for which one of the limits does not hold."""
        for where, formula, interval in self.limits:
            if formula.symbols <= values.keys():
                interval.check(ex.evaluate(formula, values), where)
        for where, formula, like in self.dissipations:
            ranges = formula.ranges.items()
            if any(not low <= values.get(x, low) <= high for x, (low, high) in ranges):
                from stickslip.convex.smooth import smooth_dissipation

                smooth_dissipation(formula.value, formula.names, values, where, like)


def check_initial(
    declaration: Declaration, name: str, value: object, unknowns: Iterable[str] = ()
) -> None:
    """Reject an initial value of a name that is not part of the state.

    Parameters
    ----------
    unknowns : iterable of str
        Unknowns of structures that would have been accepted in its place.
    """
    if name not in declaration.places:
        known = suggestion(name, [*unknowns, *declaration.state])
        raise DeclarationError(entry_key("initial", name), "not a part of the state", known)
    if not is_finite(value):
        where = entry_key("initial", name)
        raise DeclarationError(where, "not a finite number", "Give a finite number")
