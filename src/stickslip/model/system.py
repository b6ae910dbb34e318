"""What a system with dry friction is: its energy and its dissipation potential, as plain data.

A :class:`System` holds texts and numbers only. Creating one checks the whole declaration
(:mod:`stickslip.model.reading`), so a System that exists is a System that makes sense.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from numbers import Real
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeAlias, cast

from stickslip.arguments import validated
from stickslip.kept import cached_property
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import TimeFunction, formula_text

if TYPE_CHECKING:
    from stickslip.model.declaration import Declaration
    from stickslip.rate_independent.sets.potential import Dissipation
    from stickslip.structures.coordinates import InModes
    from stickslip.structures.structure import Structure

Formula = str | float
"""A text or a number. An expression may be given, too: it is written down as a text."""
Direction = str
"""A linear combination of rates."""
SurfaceSpeed = Formula | tuple[Formula, ...]
"""A speed, or in a plane a velocity."""
Axes = tuple[Formula, ...]
"""Half axes of an ellipse, or of an ellipsoid."""
Drive = Formula | TimeFunction
"""A function of time: a formula, or samples."""
Dissipating: TypeAlias = "str | Dissipation"
"""A formula of a dissipation. A potential may be given, too: its formula is kept."""
Passing = str
"""How a guard passes through zero: a key of :data:`CROSSINGS`."""
CROSSINGS = {"falling": -1, "both": 0, "rising": 1}
"""The sign of its rate where it does."""
AnyStructure: TypeAlias = "Structure | InModes"
"""A structure, or in a system that is written out what is left of it."""
AnyOutput: TypeAlias = "Output | Formula"
"""An output, or its formula."""
ImpactLaw = str
"""What contacts do that close at once: one of :data:`IMPACT_LAWS`."""
IMPACT_LAWS = ("together", "in turn")
"""All impulses obey the law at once, or one impact comes after the other."""


class Kind(StrEnum):
    """What a coordinate does with a force: it accelerates, moves, or stays in balance."""

    INERTIAL = "inertial"
    VISCOUS = "viscous"
    RATE_INDEPENDENT = "rate-independent"


@dataclass(frozen=True)
class Parameter:
    """A number of the model.

    Attributes
    ----------
    default : float
        Value used unless another is given.
    unit : str
        Unit, such as ``"N/m"``; empty if dimensionless.
    meaning : str
        What it is, in a few words.
    range : str
        Admissible values as an interval, such as ``"(0, inf)"`` or ``"[0, 1]"``.
    """

    default: float
    unit: str = ""
    meaning: str = ""
    range: str = "(-inf, inf)"


@dataclass(frozen=True)
class Inertial:
    """A coordinate with mass: M q̈ + ∂R/∂q̇ + ∂Φ/∂q ∋ force.

    Attributes
    ----------
    unit, meaning : str
        Unit and meaning of the coordinate.
    drag : str or float
        Any smooth resistance f(v) with v·f(v) ≥ 0, in addition to the quadratic `viscous` part; its
        power is dissipated.
    force : str or float
        Non-potential generalised force acting on the coordinate.
    """

    kind: ClassVar[Kind] = Kind.INERTIAL
    unit: str = ""
    meaning: str = ""
    drag: Formula = 0.0
    force: Formula = 0.0

    def __post_init__(self) -> None:
        hold_plain(self)


@dataclass(frozen=True)
class Viscous:
    """A coordinate without mass, with viscous friction: ∂R/∂ż + ∂Φ/∂z ∋ force.

    Attributes
    ----------
    unit, meaning : str
        Unit and meaning of the coordinate.
    drag : str or float
        Any smooth resistance f(v) that increases with v, f(0) = 0: the slope of a strictly convex
        dissipation potential, in addition to the quadratic `viscous` part. It may depend on the
        state, on time and on rates of inertial coordinates, but not on those of other coordinates.
        No contact acts on a coordinate with a drag.
    force : str or float
        Non-potential generalised force acting on the coordinate.
    """

    kind: ClassVar[Kind] = Kind.VISCOUS
    unit: str = ""
    meaning: str = ""
    drag: Formula = 0.0
    force: Formula = 0.0

    def __post_init__(self) -> None:
        hold_plain(self)


@dataclass(frozen=True)
class RateIndependent:
    """A coordinate with dry friction only: ∂R/∂ż + ∂Φ/∂z ∋ force, R 1-homogeneous."""

    kind: ClassVar[Kind] = Kind.RATE_INDEPENDENT
    unit: str = ""
    meaning: str = ""
    force: Formula = 0.0

    def __post_init__(self) -> None:
        hold_plain(self)


Coordinate = Inertial | Viscous | RateIndependent


@dataclass(frozen=True)
class Internal:
    """An internal variable α̇ = law(t, x, ẋ, α)."""

    law: Formula
    unit: str = ""
    meaning: str = ""

    def __post_init__(self) -> None:
        hold_plain(self)


@dataclass(frozen=True)
class Output:
    """A quantity that results show: a formula of the motion.

    Attributes
    ----------
    formula : str or float
        Of ``t``, parameters, functions and drives, coordinates, rates ``d_x``, internal variables,
        unknowns of structures, other outputs, and what results show of contacts and energies by
        the names in their datasets: ``friction_c``, ``normal_c``, ``slip_speed_c``, ``energy``,
        accelerations ``dd_x``.
    unit, meaning : str
        Unit and meaning; without a unit, the one that follows from the formula.
    """

    formula: Formula
    unit: str = ""
    meaning: str = ""

    def __post_init__(self) -> None:
        hold_plain(self)


@dataclass(frozen=True)
class Contact:
    """A dry contact with relative velocity u = direction − surface_speed, along a line, in a plane,
    or of a face that slides and spins.

    In a plane, u and the friction force λ have two components. With the diagonal matrix A of the
    `axes`, abs(A⁻¹λ) ≤ s in stick, and in slip λ = −k A n with n = Au/abs(Au): the dissipation
    potential is s·abs(Au), and the forces that it holds are an ellipse, a disc for equal axes.
    With a `dissipation` R the potential is s·R(u): it holds λ with −λ·v ≤ s R(v) for all v, and in
    slip λ = −k ∇R(u). A face has three components, two of its velocity and a rate of turning; λ
    is two forces and a moment. Its forces are an ellipsoid (R. D. Howe & M. R. Cutkosky, Int. J.
    Robotics Research 15, 1996), or exactly those of a disc or a ring under an even pressure.

    Attributes
    ----------
    direction : str or pair of str
        Linear combination of rates, such as ``"d_x"`` or ``"d_x2 - d_x1"``; two of them, such as
        ``("d_x", "d_y")``, for a contact in a plane, and three, such as ``("d_x", "d_y",
        "d_phi")``, for a face. Where both sides move as given, the rate of a
        drive, such as ``"d_xi"``, or ``"0"`` beside a surface speed: then it moves nothing, and
        its force in stick, which nothing determines, is 0.
    threshold : str, float or pair of these
        Largest force it can hold, s ≥ 0. A pair gives s⁺ (for u > 0) and s⁻ (for u < 0) along a
        line; in a plane there is one. May be left out beside a `dissipation`, where it is a factor.
    surface_speed : str, float or pair of these
        Speed w(t) of the surface (a belt); in a plane two components, which may also depend on
        coordinates (a turntable).
    kinetic : str, float, pair of these or None
        Friction force k ≤ s while sliding; may use ``speed`` = |u|, in a plane abs(Au), with a
        dissipation R(u), which of a face is a mean of the speeds of its points. By default k = s.
    unit : str
        Unit of the friction force.
    axes : pair of str or float, or three
        Half axes of the set of forces, in parts of the threshold: for a contact in a plane, or a
        face, such as ``(1, 1, "2*a/3")`` for a disc of radius a.
    dissipation : str or Dissipation, optional
        R, of a contact in a plane or a face: an :class:`Ellipsoid` or a :class:`SupportFormula`,
        which is kept as its formula, or a formula in ``v1``, ``v2`` (``v3``) and parameters,
        convex, positive and homogeneous of degree 1, such as ``"sqrt(v1**2 + 4*v2**2) + 0.2*v1"``,
        with a gradient wherever v is not 0. It need not be even. ``"disc(v1, v2, a*v3)"`` and
        ``"ring(v1, v2, a*v3)"`` are the mean speed of a disc and of a ring of radius a. Its
        coordinates are inertial.
    """

    direction: Direction | tuple[Direction, ...]
    threshold: Formula | tuple[Formula, Formula] = ""
    surface_speed: SurfaceSpeed = 0.0
    kinetic: Formula | tuple[Formula, Formula] | None = None
    unit: str = ""
    axes: Axes = (1.0, 1.0)
    dissipation: Dissipating | None = None

    def __post_init__(self) -> None:
        if hasattr(self.dissipation, "as_formula"):
            formula = cast("Dissipation", self.dissipation).as_formula()
            object.__setattr__(self, "dissipation", formula)
        hold_plain(self)
        if self.threshold == "" and self.dissipation is not None:
            object.__setattr__(self, "threshold", 1.0)

    def components(self, name: str) -> dict[str, Contact]:
        """By name, a contact along each of its directions."""
        if isinstance(self.direction, str):
            return {name: self}
        given = self.surface_speed
        speeds = given if isinstance(given, tuple) else (0.0,) * len(self.direction)
        return {
            f"{name} {i}": replace(
                self, direction=d, surface_speed=w, axes=(1.0, 1.0), dissipation=None
            )
            for i, (d, w) in enumerate(zip(self.direction, speeds, strict=True), 1)
        }


@dataclass(frozen=True)
class Unilateral:
    """A contact that can open: gap g ≥ 0, normal force N ≥ 0, N g = 0, and Coulomb's friction μN,
    along a line or in a plane; with adhesion it holds a pull, too.

    Thresholds of all contacts of inertial coordinates may use its normal force, by the name
    ``normal_foot`` for a contact called foot; they are linear in normal forces, of which there may
    be several. Friction in a plane has one; it may change it, if it is alone on its body.

    Attributes
    ----------
    gap : str
        g(q, t), a function of inertial coordinates and time: the distance. The normal force is the
        one that does work on it, so for friction it has to be a length in the units of that.
    direction : str or pair of str
        Linear combination of rates along which it rubs, with coefficients of q and t; two of them
        in a plane.
    mu : str or float
        Coefficient of friction μ ≥ 0; may depend on the state and on time.
    kinetic : str or float, optional
        Coefficient in sliding, at most μ; may depend on the speed too, as ``speed``. By default μ.
    surface_speed : str, float or pair of these
        Speed w(t) of the surface along the direction; in a plane as of a :class:`Contact`.
    restitution, tangential_restitution : str or float
        Part of the approaching velocity with which it rebounds (Newton's law), normal and
        tangential, between 0 and 1.
    unit : str
        Unit of the forces.
    axes : pair of str or float
        As of a :class:`Contact`: in a plane, the half axes of the set of forces in parts of μN.
    adhesion : str or float
        Largest pull that it holds while it is closed, N₀ ≥ 0: then N ≥ −N₀ and friction is
        μ(N + N₀), by Derjaguin's law. It opens when the pull exceeds N₀, has no force while it is
        open, and holds again when it has closed. It is a force, not an energy, and does not change
        impacts. May depend on the state and on time.
    """

    gap: Formula
    direction: Direction | tuple[Direction, Direction] = ""
    mu: Formula = 0.0
    surface_speed: SurfaceSpeed = 0.0
    restitution: Formula = 0.0
    tangential_restitution: Formula = 0.0
    unit: str = ""
    axes: Axes = (1.0, 1.0)
    kinetic: Formula | None = None
    adhesion: Formula = 0.0

    def __post_init__(self) -> None:
        hold_plain(self)

    def friction(self, name: str) -> Contact:
        """What rubs, as a contact under the normal force of the one that is called by a name."""
        return _rubbing(self, name, self.adhesion)


@dataclass(frozen=True)
class Side(Unilateral):
    """One side of a constraint, as it is written out.

    Attributes
    ----------
    of : str
        Name of the constraint.
    """

    of: str = ""


@dataclass(frozen=True)
class Bilateral:
    """A constraint g(q, t) = 0 that holds from both sides, such as a bead on a wire or a pin in a
    slot, with Coulomb's friction μ|N|.

    Thresholds of all contacts of inertial coordinates may use |N|, by the name ``normal_wire``
    for a constraint called wire.

    Attributes
    ----------
    constraint : str
        g(q, t), a function of inertial coordinates and time, zero at the initial state. N is the
        force that does work on it, so for friction it has to be a length in the units of that.
    direction, mu, surface_speed, unit, axes, kinetic
        As in a :class:`Unilateral`.
    """

    constraint: Formula
    direction: Direction | tuple[Direction, Direction] = ""
    mu: Formula = 0.0
    surface_speed: SurfaceSpeed = 0.0
    unit: str = ""
    axes: Axes = (1.0, 1.0)
    kinetic: Formula | None = None

    def __post_init__(self) -> None:
        hold_plain(self)

    def friction(self, name: str) -> Contact:
        """What rubs, as a contact under the normal force of the one that is called by a name."""
        return _rubbing(self, name)


def _rubbing(contact: Unilateral | Bilateral, name: str, adhesion: Formula = 0.0) -> Contact:
    """Coulomb's friction under the normal force of a contact, and its adhesion."""
    from stickslip.model.names import normal_force

    normal = normal_force(name)
    normal = normal if adhesion == 0.0 else f"({normal} + ({adhesion}))"
    kinetic = None if contact.kinetic is None else f"({contact.kinetic})*{normal}"
    speed, unit, axes = contact.surface_speed, contact.unit, contact.axes
    return Contact(contact.direction, f"({contact.mu})*{normal}", speed, kinetic, unit, axes)


@dataclass(frozen=True)
class LawContact:
    """A contact with a friction law of :mod:`stickslip.model.laws`, by its name.

    Attributes
    ----------
    law : str
        Its name, such as ``"stribeck"``.
    direction : str
        As in a :class:`Contact`.
    values : mapping of str to formula, or list of these
        The law's parameters.
    surface_speed : str or float
    unit : str
        Unit of the friction force.
    """

    law: str
    direction: Direction
    values: Mapping[str, Formula | tuple[Formula, ...]] = field(
        default_factory=dict[str, Formula | tuple[Formula, ...]]
    )
    surface_speed: Formula = 0.0
    unit: str = ""

    def __post_init__(self) -> None:
        hold_plain(self)

    def plain(self) -> dict[str, Any]:
        """Its entry in a model file; :meth:`from_plain` gives it back."""
        given = {"surface_speed": self.surface_speed, "unit": self.unit}
        others = {key: value for key, value in given.items() if value not in (0.0, "")}
        return {"law": self.law, "direction": self.direction, **self.values, **others}

    @classmethod
    def from_plain(cls, entry: Mapping[str, Any]) -> Self:
        """The contact of an entry that has a law and a direction."""
        own = {item.name for item in fields(cls)} - {"values"}
        values = {key: value for key, value in entry.items() if key not in own}
        return cls(values=values, **{key: entry[key] for key in own & entry.keys()})


AnyContact = Contact | Unilateral | Bilateral | LawContact


@dataclass(frozen=True)
class Jump:
    """A jump of the state where a formula passes through zero: a leg exchange, a kick, a reset.

    Attributes
    ----------
    when : str
        Formula of the state, rates of inertial coordinates and time. It fires where it passes
        through zero on the way of the motion; what another jump, or an impact, leaps over does not
        fire, and neither does a motion that begins at zero.
    to : mapping of str to formula
        New values of parts of the state: coordinates, rates ``d_x`` of inertial ones, internal
        variables; formulas of the state before, all at once. What is not named stays.
    direction : {"falling", "rising", "both"}
        In which way it passes through zero; −1, 1 and 0 are the same.
    """

    when: Formula
    to: Mapping[str, Formula]
    direction: Passing = "both"

    def __post_init__(self) -> None:
        hold_plain(self)
        given = cast("object", self.direction)
        if isinstance(given, int) and not isinstance(given, bool):
            words = {sign: word for word, sign in CROSSINGS.items()}
            object.__setattr__(self, "direction", words.get(given, given))


@dataclass(frozen=True)
class Condition:
    """An inequality between formulas of the parameters that the literature asks for.

    Attributes
    ----------
    formula : str
        Such as ``"P > rho + c*psi_star"``.
    otherwise : str
        What happens where it fails; shown as a warning.
    """

    formula: str
    otherwise: str = ""


def hold_plain(item: Any) -> None:
    """Let a declaration hold plain data that nobody else changes: copies of its tables, tuples for
    lists, and texts for expressions.

    Raises
    ------
    DeclarationError
        If an expression is too long for a text.
    """
    for entry in fields(item):
        object.__setattr__(item, entry.name, _plain(getattr(item, entry.name), entry.name))


def _plain(value: Any, where: str) -> Any:
    match value:
        case Mapping():
            table = cast(Mapping[Any, Any], value)
            return {key: _plain(part, f"{where}.{key}") for key, part in table.items()}
        case list() | tuple():
            parts = cast(Sequence[Any], value)
            return tuple(_plain(part, f"{where}[{i}]") for i, part in enumerate(parts))
        case Expr():
            return formula_text(value, where)
        case _:
            return value


def _as_outputs(given: Any) -> Any:
    """Outputs with bare formulas made outputs; anything else is refused with the rest."""
    if not isinstance(given, Mapping):
        return given
    entries = cast(Mapping[str, Any], given)
    return {name: Output(entry) if _is_formula(entry) else entry for name, entry in entries.items()}


def _is_formula(entry: object) -> bool:
    return not isinstance(entry, bool) and isinstance(entry, str | Real)


class _NotGiven(tuple[float, float]):
    """A time span that stands because none was given."""


_SPAN = _NotGiven((0.0, 100.0))


def _known(drives: Any) -> _NotGiven:
    """The part of the span that stands if none is given of which all drives say something."""
    start, stop = _SPAN
    # What is no mapping is refused with the rest of the declaration.
    if not isinstance(drives, Mapping):
        return _SPAN
    for drive in cast(Mapping[str, Any], drives).values():
        if isinstance(drive, TimeFunction) and not drive.covers(start, stop):
            start, stop = max(start, drive.span[0]), min(stop, drive.span[1])
    return _NotGiven((start, stop)) if start < stop else _SPAN


@dataclass(frozen=True)
class System:
    """A system declared by its energy and its dissipation potential.

    A formula is a number or a text of numbers, names, ``pi``, ``+ - * / **``, brackets and the
    functions of :data:`~stickslip.symbolic.functions.FUNCTIONS` (exp, sin, erf, ...) and
    :data:`~stickslip.symbolic.pieces.STRUCTURES` (sqrt, abs, floor, triangle, ...), and piecewise.

    Attributes
    ----------
    name, title, source : str
        Short name, one line of description, and the literature.
    parameters : mapping of str to Parameter
    functions : mapping of str to formula
        Functions used in formulas, such as ``{"H_R(psi)": "clip(...)"}``.
    drives : mapping of str to formula or Samples
        Given functions of time, such as ``{"ell": "V*t"}``, or measured ones.
    coordinates : mapping of str to Coordinate
        The rate of coordinate ``x`` is called ``d_x``.
    structures : mapping of str to Structure
        Bodies by their matrices. Of one that is called u, formulas may name unknowns ``u[3]`` or
        ``u[tip]`` and rates ``d_u[tip]``.
    forces : mapping of str to formula
        Non-potential forces on unknowns of structures, such as ``{"u[tip]": "F*cos(omega*t)"}``.
    internal : mapping of str to Internal
    kinetic, potential, viscous : formula
        Kinetic energy T(q, q̇, t), at most quadratic in the rates of inertial coordinates; potential
        Φ(t, x, α); the quadratic viscous part of the dissipation potential.
    contacts : mapping of str to Contact
        Or to a friction law with a name, such as ``ss.laws.stribeck("d_x", ...)``.
    impacts : {"together", "in turn"}
        What contacts do that close at once. By default the impulses of all of them obey Newton's
        and Coulomb's laws together: two balls of equal mass that touch fly off together when a
        third one strikes them. In turn, only the contact whose approach carries the most kinetic
        energy has an impact, then the next one, until none approaches: then the last ball alone
        flies off, as in Newton's cradle.
    jumps : mapping of str to Jump
        Where the state jumps.
    translation : mapping of str to float
        A direction in which the whole system may be shifted.
    initial : mapping of str to float
        Default initial values of coordinates, rates of inertial coordinates, internal variables,
        unknowns of structures and their rates (else 0).
    span : (float, float)
        Default time span; if it is left out, from 0 to 100, or for as long as all samples that
        drive the system are known.
    time_unit : str
    conditions : mapping of str to Condition
        What is known to be necessary, by name.
    facts : mapping of str to formula
        Closed-form facts, formulas of the parameters (such as X, ψ₂ of the rocking toy).
    outputs : mapping of str to Output or formula
        Quantities that results show, such as ``{"tip": "u[tip] - u[root]"}``. Other formulas may
        use them by name, where what they are made of may stand.

    Raises
    ------
    DeclarationError
        If anything in the declaration is wrong; the message names the key, the reason and the
        remedy.
    """

    name: str
    title: str = ""
    source: str = ""
    parameters: Mapping[str, Parameter] = field(default_factory=dict[str, Parameter])
    functions: Mapping[str, Formula] = field(default_factory=dict[str, Formula])
    drives: Mapping[str, Drive] = field(default_factory=dict[str, Drive])
    coordinates: Mapping[str, Coordinate] = field(default_factory=dict[str, Coordinate])
    structures: Mapping[str, AnyStructure] = field(default_factory=dict[str, "AnyStructure"])
    forces: Mapping[str, Formula] = field(default_factory=dict[str, Formula])
    internal: Mapping[str, Internal] = field(default_factory=dict[str, Internal])
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
    outputs: Mapping[str, AnyOutput] = field(default_factory=dict[str, "AnyOutput"])

    def __post_init__(self) -> None:
        given = not isinstance(self.span, _NotGiven)
        hold_plain(self)
        object.__setattr__(self, "outputs", _as_outputs(self.outputs))
        if not given:
            object.__setattr__(self, "span", _known(self.drives))
        _ = self.declaration
        for doubt in self.doubts:
            warnings.warn(f"{self.name}: {doubt}", stacklevel=3)

    @cached_property
    def declaration(self) -> Declaration:
        """The declaration read and checked: every formula as an expression."""
        from stickslip.model.reading import declare

        return declare(self) if self.plain is self else self.plain.declaration

    @cached_property
    def plain(self) -> System:
        """The same system with the laws of its contacts, its constraints and its structures written
        out: what is moved and shown."""
        from stickslip.model.written_out import write_out

        return write_out(self)

    @property
    def written_structures(self) -> Mapping[str, InModes]:
        """What is left of structures where the system is written out."""
        return cast("Mapping[str, InModes]", self.plain.structures)

    @cached_property
    def unknowns(self) -> dict[str, dict[str, float]]:
        """Unknowns of structures that results show, and their rates, each as what it is of the
        modes."""
        if not self.structures:
            return {}
        from stickslip.structures.coordinates import shown_of

        return shown_of(self.written_structures)

    @property
    def declared_outputs(self) -> Mapping[str, Output]:
        """The outputs, each with its unit and meaning."""
        return cast("Mapping[str, Output]", self.outputs)

    @cached_property
    def places(self) -> list[str]:
        """Where things are: coordinates as declared, and unknowns of structures."""
        return [*self.coordinates, *(name for name in self.unknowns if name[:2] != "d_")]

    @property
    def followed(self) -> list[str]:
        """What a person follows: places and outputs."""
        return [*self.places, *self.outputs]

    def unknown(self, name: str) -> dict[str, float]:
        """What an unknown of a structure, or its rate, is of modes; empty if there is none of that
        name."""
        if not self.structures:
            return {}
        from stickslip.structures.coordinates import row_of

        try:
            return row_of(name, self.written_structures)
        except KeyError:
            return {}

    @cached_property
    def dry_contacts(self) -> dict[str, Contact]:
        """Contacts with a threshold: those that laws are made of, the components of those in a
        plane, and the normal direction and the friction of those that can open, too."""
        found: dict[str, Contact] = {}
        for name, contact in self.plain.contacts.items():
            if isinstance(contact, Contact):
                found |= contact.components(name)
            elif isinstance(contact, Unilateral) and not isinstance(contact, Side):
                found |= self._parts_of(name, contact)
        return found

    def _parts_of(self, name: str, contact: Unilateral) -> dict[str, Contact]:
        from stickslip.model.names import normal_force

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
    def rubbing(self) -> dict[str, tuple[str, ...]]:
        """What a person calls a dry contact, with the names of its components: one, two in a
        plane, or three of a face."""
        from stickslip.model.names import normal_force

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
        """What holds from both sides, with the names of the sides."""
        found: dict[str, tuple[str, ...]] = {}
        for name, contact in self.with_gaps.items():
            if isinstance(contact, Side):
                found[contact.of] = (*found.get(contact.of, ()), name)
        return found

    @cached_property
    def doubts(self) -> list[str]:
        """Terms of the formulas whose units do not agree, as far as units are declared; each is a
        warning when the system is declared."""
        from stickslip.model.dimensions import disagreements

        return disagreements(self.plain)

    def __hash__(self) -> int:
        return hash((self.name, repr(self)))

    @validated
    def configure(self, given: Mapping[str, Drive]) -> System:
        """The same system with other parameter values (numbers) and free functions (formulas).

        Parameters
        ----------
        given : mapping of str to float or str
            A parameter's name with its value, or the name of a function or drive with its formula.

        Raises
        ------
        DeclarationError
            If a name is neither, or a value is not admissible.
        """
        from stickslip.model.names import reconfigured

        return reconfigured(self, given, ("functions", "drives"))

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
            Of the parameters, functions, drives and facts of the system, of ``t``, the state, the
            rates ``d_x`` and ``speed``. A fact alone is a formula, too.
        values : mapping of str to float, optional
            Numbers of the names that the formula depends on; of parameters only those that differ
            from their defaults, of the unknowns of a structure those that are not zero.

        Returns
        -------
        float
            NaN where the formula is undefined.

        Raises
        ------
        DeclarationError
            If it is not a formula, a name has no value, or a value has no name.

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

            given = start_of(structures, given, "values")
        return self.declaration.value(expression, {**self.values, **given})

    def heading(self) -> dict[str, Any]:
        """What a summary of its results says of it: its name and its given functions."""
        given = {**self.functions, **self.drives}
        shown = {k: str(f) if isinstance(f, TimeFunction) else f for k, f in given.items()}
        return {"model": self.name, "functions": shown}

    def equations(self, latex: bool = False) -> Any:
        """The equations as a person would write them: Unicode text, or LaTeX."""
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
