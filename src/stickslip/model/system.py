"""The declaration of a system with dry friction, as plain data: its energy and its dissipation
potential.

A :class:`System` contains only strings and numbers. The complete declaration is checked when a
System is created (:mod:`stickslip.model.reading`), so every System is valid.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from numbers import Real
from typing import TYPE_CHECKING, Any, cast

from stickslip.arguments import validated
from stickslip.errors import DeclarationError, short
from stickslip.kept import cached_property
from stickslip.model.entries.declared import (
    AnyStructure,
    AnyTable,
    Bilateral,
    Condition,
    Contact,
    Drive,
    Entries,
    Formula,
    ImpactLaw,
    Inertial,
    Internal,
    Jump,
    LawContact,
    Output,
    Parameter,
    RateIndependent,
    Sampled,
    Side,
    Unilateral,
    Viscous,
    hold_plain,
)
from stickslip.structures.names import is_entry
from stickslip.symbolic.formulas import TimeFunction, formula_text

if TYPE_CHECKING:
    from stickslip.model.declaration import Declaration
    from stickslip.structures.coordinates import InModes

Coordinate = Inertial | Viscous | RateIndependent
AnyInternal = Internal | Sampled
AnyContact = Contact | Unilateral | Bilateral | LawContact


class DefaultSpan(tuple[float, float]):
    """The default time span of a system. If drives are samples that end, it is the span that all of
    them cover.

    Attributes
    ----------
    otherwise : (float, float)
        The span used if no drive ends.
    """

    otherwise: tuple[float, float]

    def __new__(
        cls, span: tuple[float, float], otherwise: tuple[float, float] | None = None
    ) -> DefaultSpan:
        made = super().__new__(cls, span)
        made.otherwise = otherwise or span
        return made

    def under(self, drives: Any) -> DefaultSpan:
        """The default span of a system with given drives."""
        # Values of other types are rejected later, with the rest of the declaration.
        table = cast("Mapping[str, Any]", drives if isinstance(drives, Mapping) else {})
        ending = [d for d in table.values() if isinstance(d, TimeFunction) and d.ends]
        if not ending:
            return DefaultSpan(self.otherwise)
        start, stop = max(d.span[0] for d in ending), min(d.span[1] for d in ending)
        # Drives that do not overlap are rejected later as well.
        return DefaultSpan((start, stop) if start < stop else self.otherwise, self.otherwise)


_SPAN = DefaultSpan((0.0, 100.0))


def is_span_given(span: tuple[float, float]) -> bool:
    """Return whether the time span of a system was given by the user."""
    return not isinstance(span, DefaultSpan)


@dataclass(frozen=True)
class System:
    """A system declared by its energy and its dissipation potential.

    A formula is a number or a string of numbers, names, ``pi``, ``+ - * / **``, brackets and the
    functions of :data:`~stickslip.symbolic.functions.FUNCTIONS` (exp, sin, erf, ...) and
    :data:`~stickslip.symbolic.pieces.STRUCTURES` (sqrt, abs, floor, triangle, ...), and piecewise.

    Attributes
    ----------
    name, title, source : str
        Short name, one line of description, and references.
    parameters : mapping of str to Parameter or float
        For example ``{"k": ss.Parameter(2.0, "N/m"), "c": 0.1}``.
    functions : mapping of str to formula
        Functions used in formulas, such as ``{"H_R(psi)": "clip(...)"}``.
    tables : mapping of str to Table
        Measured curves and surfaces, available as functions in formulas.
    drives : mapping of str to formula or Samples
        Given functions of time, such as ``{"ell": "V*t"}``, or measured ones.
    coordinates : mapping of str to Coordinate
        The rate of coordinate ``x`` is named ``d_x``.
    structures : mapping of str to Structure
        Bodies given by matrices. For a structure named u, formulas may use its degrees of freedom,
        such as ``u[3]`` or ``u[tip]``, and their rates, such as ``d_u[tip]``.
    forces : mapping of str to formula
        Non-potential forces on degrees of freedom of structures, such as ``{"u[tip]":
        "F*cos(omega*t)"}``.
    internal : mapping of str to Internal or Sampled
        Internal variables with a first-order equation, and digital controllers.
    kinetic, potential, viscous : formula
        Kinetic energy T(q, q̇, t), at most quadratic in the rates of inertial coordinates; potential
        Φ(t, x, α); the quadratic viscous part of the dissipation potential.
    contacts : mapping of str to Contact, Unilateral or Bilateral
        Dry friction, contacts that can open, and constraints; also named friction laws, such as
        ``ss.laws.stribeck("d_x", ...)``.
    impacts : {"together", "in turn"}
        Treatment of contacts that close at the same time. By default their impulses satisfy
        Newton's and Coulomb's laws simultaneously: two touching balls of equal mass move off
        together when a third one hits them. With ``"in turn"``, impacts occur sequentially, first
        at the contact whose approach has the most kinetic energy, until no contact approaches: then
        only the last ball moves off, as in Newton's cradle.
    jumps : mapping of str to Jump
        Jumps of the state at zeros of guards.
    translation : mapping of str to float
        A direction of translation under which the system is invariant.
    initial : mapping of str to float
        Default initial values of coordinates, rates of inertial coordinates, internal variables,
        degrees of freedom of structures and their rates; 0 if omitted.
    span : (float, float)
        Default time span; if omitted, from 0 to 100 or, if drives are samples that end, the span
        that all of them cover. A :class:`DefaultSpan` counts as omitted.
    time_unit : str
        Unit of time, such as ``"s"``.
    conditions : mapping of str to Condition
        Necessary conditions on the parameters, by name.
    facts : mapping of str to formula
        Quantities known in closed form, as formulas of the parameters (such as X and ψ₂ of the
        rocking toy).
    outputs : mapping of str to Output or formula
        Additional quantities of results, such as ``{"tip": "u[tip] - u[root]"}``. They may be used
        by name in all formulas in which the names that they contain are allowed.

    Raises
    ------
    DeclarationError
        If anything in the declaration is wrong; the message names the key, the reason and the
        remedy.
    """

    name: str
    title: str = ""
    source: str = ""
    parameters: Entries[Parameter] = Entries(Parameter, Real)  # noqa: RUF009 (a descriptor)
    functions: Mapping[str, Formula] = field(default_factory=dict[str, Formula])
    tables: Mapping[str, AnyTable] = field(default_factory=dict[str, "AnyTable"])
    drives: Mapping[str, Drive] = field(default_factory=dict[str, Drive])
    coordinates: Mapping[str, Coordinate] = field(default_factory=dict[str, Coordinate])
    structures: Mapping[str, AnyStructure] = field(default_factory=dict[str, "AnyStructure"])
    forces: Mapping[str, Formula] = field(default_factory=dict[str, Formula])
    internal: Mapping[str, AnyInternal] = field(default_factory=dict[str, AnyInternal])
    kinetic: Formula = 0.0
    potential: Formula = 0.0
    viscous: Formula = 0.0
    contacts: Mapping[str, AnyContact] = field(default_factory=dict[str, AnyContact])
    impacts: ImpactLaw = "together"
    jumps: Mapping[str, Jump] = field(default_factory=dict[str, Jump])
    translation: Mapping[str, float] = field(default_factory=dict[str, float])
    initial: Mapping[str, float] = field(default_factory=dict[str, float])
    span: tuple[float, float] = _SPAN
    time_unit: str = ""
    conditions: Mapping[str, Condition] = field(default_factory=dict[str, Condition])
    facts: Mapping[str, Formula] = field(default_factory=dict[str, Formula])
    outputs: Entries[Output] = Entries(Output, (str, Real))  # noqa: RUF009 (a descriptor)

    def __post_init__(self) -> None:
        # `hold_plain` converts every span to a tuple, so a default span is restored afterwards.
        default = self.span if isinstance(self.span, DefaultSpan) else None
        hold_plain(self)
        if default is not None:
            object.__setattr__(self, "span", default.under(self.drives))
        _ = self.declaration  # raises if the declaration is not valid
        for conflict in self.unit_conflicts:
            warnings.warn(f"{self.name}: {conflict}", stacklevel=3)

    @cached_property
    def declaration(self) -> Declaration:
        """The parsed and checked declaration, with every formula as an expression."""
        from stickslip.model.reading import declare

        return declare(self) if self.plain is self else self.plain.declaration

    @cached_property
    def plain(self) -> System:
        """The same system with its laws, constraints and structures expanded to formulas;
        computations and plots use this one."""
        from stickslip.model.written_out import write_out

        return write_out(self)

    @property
    def written_structures(self) -> Mapping[str, InModes]:
        """The structures in the expanded system."""
        return cast("Mapping[str, InModes]", self.plain.structures)

    @cached_property
    def unknowns(self) -> dict[str, dict[str, float]]:
        """Degrees of freedom of structures that results show, and their rates, each as a linear
        combination of the modes."""
        if not self.structures:
            return {}
        from stickslip.structures.coordinates import shown_of

        return shown_of(self.written_structures)

    @property
    def started_unknowns(self) -> list[str]:
        """Degrees of freedom of structures that results show, and their rates, if initial values
        may be given for them."""
        if not self.structures:
            return []
        from stickslip.structures.coordinates import started_of

        return started_of(self.written_structures)

    @property
    def starts(self) -> list[str]:
        """Names of initial values: degrees of freedom of structures, and components of the
        state."""
        return [*self.started_unknowns, *self.declaration.state]

    @cached_property
    def places(self) -> list[str]:
        """Positions: declared coordinates, and degrees of freedom of structures."""
        return [*self.coordinates, *(name for name in self.unknowns if name[:2] != "d_")]

    @property
    def followed(self) -> list[str]:
        """Coordinates and outputs."""
        return [*self.places, *self.outputs]

    def unknown(self, name: str) -> dict[str, float]:
        """Modal coefficients of a degree of freedom of a structure, or of its rate; empty for an
        unknown name."""
        if not self.structures:
            return {}
        from stickslip.structures.coordinates import row_of

        try:
            return row_of(name, self.written_structures)
        except KeyError:
            return {}

    def started(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Convert initial values, some of which belong to degrees of freedom of structures, to
        initial values of the state.

        Parameters
        ----------
        given : mapping of str
            Numbers, arrays or expressions. The other degrees of freedom have their declared values.

        Raises
        ------
        DeclarationError
            If a name is unknown, a value does not determine any mode, or two values conflict.
        """
        unknowns = [name for name in given if is_entry(name)]
        if not unknowns or not self.structures:
            return dict(given)
        self.check_starts(given, "initial")
        from stickslip.structures.coordinates import start_of

        # Amplitudes of modes are linear in the values: those for zero values are increased.
        zero: dict[str, float] = dict.fromkeys(unknowns, 0.0)
        offset = start_of(self.written_structures, {**self.initial, **zero})
        found: dict[str, Any] = {}
        for name in unknowns:
            for mode, slope in self.start_slope(name).items():
                if mode not in self.initial:
                    found[mode] = found.get(mode, offset[mode]) + given[name] * slope
        return found | {name: value for name, value in given.items() if not is_entry(name)}

    def start_slope(self, name: str, section: str = "initial") -> dict[str, float]:
        """Derivative of the initial state with respect to one initial value, of a component of the
        state or of a degree of freedom of a structure; all others are fixed.

        Parameters
        ----------
        name : str
            The component of the state, or the degree of freedom, such as ``d_u[tip]``.
        section : str
            Prefix of error messages.

        Returns
        -------
        dict of str to float
            Derivatives by component of the state; empty for any other name.

        Raises
        ------
        DeclarationError
            If there is no such degree of freedom, or a reduced structure does not keep it as a
            coordinate.
        """
        if name in self.declaration.places:
            return {name: 1.0}
        if not (is_entry(name) and self.structures):
            return {}
        from stickslip.structures.coordinates import modes_per_unknown

        return modes_per_unknown(self.written_structures, name, section)

    def check_starts(self, names: Iterable[str], section: str) -> None:
        """Reject initial values of a degree of freedom together with one of its modes, and of one
        degree of freedom under two names.

        Parameters
        ----------
        names : iterable of str
            Names of all initial values that are given or varied; other names are ignored.
        section : str
            Prefix of error messages.

        Raises
        ------
        DeclarationError
            If there is such a pair.
        """
        slopes = {name: self.start_slope(name, section) for name in names}
        unknowns = {name: slope for name, slope in slopes.items() if slope and name not in slope}
        for name, slope in unknowns.items():
            where = f"{section}.{short(name)}"
            if own := sorted(slope.keys() & slopes.keys()):
                raise DeclarationError(
                    where,
                    f"an initial value of the mode {own[0]} is given as well",
                    "Give either degrees of freedom or modes",
                )
            if twice := [x for x, other in unknowns.items() if x != name and other == slope]:
                raise DeclarationError(
                    where, f"it is the same degree of freedom as {twice[0]}", "Give it once only"
                )

    @cached_property
    def dry_contacts(self) -> dict[str, Contact]:
        """Contacts with a threshold, including those in the expansion of laws, the components of
        contacts in a plane, and the normal direction and the friction of contacts that can open."""
        found: dict[str, Contact] = {}
        for name, contact in self.plain.contacts.items():
            if isinstance(contact, Contact):
                found |= contact.components(name)
            elif isinstance(contact, Unilateral) and not isinstance(contact, Side):
                found |= self._parts_of(name, contact)
        return found

    def _parts_of(self, name: str, contact: Unilateral) -> dict[str, Contact]:
        """The normal direction and the friction of a contact that can open, as dry contacts."""
        from stickslip.model.entries.keys import normal_force

        normal = normal_force(name)
        (declared,) = (c for c in self.declaration.contacts if c.name == normal)
        rate = " + ".join(
            f"({formula_text(weight, normal)})*d_{x}" for x, weight in declared.direction.items()
        )
        speed = formula_text(declared.speed, normal)
        parts = {normal: Contact(rate, 0.0, speed, unit=contact.unit)}
        return parts | (contact.friction(name).components(name) if contact.direction else {})

    @cached_property
    def planes(self) -> dict[str, tuple[str, ...]]:
        """Contacts in a plane, and faces, with the names of their components among the dry
        contacts."""
        found: dict[str, tuple[str, ...]] = {}
        for name, contact in self.plain.contacts.items():
            if not isinstance(contact, LawContact) and isinstance(contact.direction, tuple):
                found[name] = tuple(f"{name} {i + 1}" for i in range(len(contact.direction)))
        return found

    @cached_property
    def frictional(self) -> dict[str, tuple[str, ...]]:
        """Dry contacts as declared, each with the names of its components: one for a line, two for
        a plane, three for a face."""
        from stickslip.model.entries.keys import normal_force

        of = {part: (name, parts) for name, parts in self.planes.items() for part in parts}
        normals = set(map(normal_force, self.unilateral))
        rubs = [name for name in self.dry_contacts if name not in normals]
        return dict(of.get(name, (name, (name,))) for name in rubs)

    @cached_property
    def unilateral(self) -> dict[str, Unilateral]:
        """Contacts that can open."""
        return {n: c for n, c in self.with_gaps.items() if not isinstance(c, Side)}

    @cached_property
    def with_gaps(self) -> dict[str, Unilateral]:
        """Contacts that can open, and both sides of constraints."""
        return {n: c for n, c in self.plain.contacts.items() if isinstance(c, Unilateral)}

    @cached_property
    def constraints(self) -> dict[str, tuple[str, ...]]:
        """Bilateral constraints, with the names of their two sides."""
        found: dict[str, tuple[str, ...]] = {}
        for name, contact in self.with_gaps.items():
            if isinstance(contact, Side):
                found[contact.of] = (*found.get(contact.of, ()), name)
        return found

    @cached_property
    def unit_conflicts(self) -> list[str]:
        """Terms of formulas whose declared units do not agree. Each one causes a warning when the
        system is declared."""
        from stickslip.model.dimensions import disagreements

        return disagreements(self.plain)

    def __hash__(self) -> int:
        return hash((self.name, repr(self)))

    @validated
    def configure(self, given: Mapping[str, Drive | AnyTable]) -> System:
        """The same system with other parameter values, functions, drives and tables.

        Parameters
        ----------
        given : mapping of str to float, formula or Table
            Values of parameters, formulas of functions and drives, and tables, by name.

        Raises
        ------
        DeclarationError
            If a name is unknown, or a value is not admissible.
        """
        from stickslip.model.names import reconfigured

        return reconfigured(self, given, ("functions", "tables", "drives"))

    def with_parameters(self, **values: float) -> System:
        """The same system with other default values of its parameters."""
        return self.configure(values)

    @cached_property
    def values(self) -> dict[str, float]:
        """Default values of the parameters."""
        return {name: p.default for name, p in self.parameters.items()}

    @validated
    def evaluate(self, formula: Formula, values: Mapping[str, float] | None = None) -> float:
        """The value of a formula in the language of this declaration.

        Parameters
        ----------
        formula : str or float
            May use the parameters, functions, drives and facts of the system, ``t``, the state, the
            rates ``d_x``, and ``speed``. The name of a fact is also a formula.
        values : mapping of str to float, optional
            Values of the names on which the formula depends. Parameters that are not given have
            their defaults, and degrees of freedom of a structure are zero.

        Returns
        -------
        float
            NaN where the formula is undefined.

        Raises
        ------
        DeclarationError
            If the formula is invalid, a name has no value, or a value is given for an unknown name.

        Examples
        --------
        >>> import stickslip as ss
        >>> toy = ss.catalogue.rocking_toy()
        >>> toy.evaluate("rho + H_R(psi)", {"psi": 0.5})
        2.45
        >>> round(toy.evaluate("psi_2", {"rho": 0.1}), 12)
        1.666666666667
        """
        expression = self.declaration.scope.parse(formula, "formula")
        given = values or {}
        if structures := self.written_structures:
            from stickslip.structures.coordinates import start_of

            self.check_starts(given, "values")
            given = start_of(structures, given, "values")
        return self.declaration.value(expression, {**self.values, **given})

    def left_out(self, start: float, end: float) -> list[str]:
        """Descriptions of the parts of driving records outside the time span of a motion."""
        from stickslip.model.names import parts_left_out

        return parts_left_out(self.declaration.given, start, end, self.time_unit)

    def heading(self) -> dict[str, Any]:
        """Heading of summaries: the name, functions, drives and tables."""
        given = {**self.functions, **self.drives} | {k: str(t) for k, t in self.tables.items()}
        shown = {k: str(f) if isinstance(f, TimeFunction) else f for k, f in given.items()}
        return {"model": self.name, "functions": shown}

    def equations(self, latex: bool = False) -> Any:
        """The equations in mathematical notation, as Unicode text or LaTeX."""
        from stickslip.display.equations import Equations

        shown = Equations(self)
        return shown.latex() if latex else shown

    def _repr_html_(self) -> str:
        from stickslip.display.system_page import system_page

        return system_page(self)

    def to_toml(self) -> str:
        """The declaration as a model file."""
        from stickslip.model.system_file import dumps

        return dumps(self)
