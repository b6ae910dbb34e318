"""The entries of a declaration: parameters, coordinates, contacts, jumps, outputs and conditions.

They are plain data, and hold what was written down; :mod:`stickslip.model.reading` checks it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Self, TypeAlias, TypeVar, cast

from stickslip.model.entries.keys import normal_force
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import TimeFunction, formula_text

if TYPE_CHECKING:
    from stickslip.model.entries.tables import Table
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
AnyTable: TypeAlias = "Table"
"""A measured curve or surface."""
ImpactLaw = str
"""What contacts do that close at once: one of :data:`IMPACT_LAWS`."""
IMPACT_LAWS = ("together", "in turn")
"""All impulses obey the law at once, or one impact comes after the other."""


class Kind(StrEnum):
    """Kind of a coordinate: inertial, viscous, or rate-independent."""

    INERTIAL = "inertial"
    VISCOUS = "viscous"
    RATE_INDEPENDENT = "rate-independent"


@dataclass(frozen=True)
class Parameter:
    """A number of the model.

    Attributes
    ----------
    default : float
        Default value.
    unit : str
        Unit, such as ``"N/m"``; empty if dimensionless.
    meaning : str
        Short description.
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


@dataclass(frozen=True)
class Internal:
    """An internal variable α̇ = law(t, x, ẋ, α)."""

    law: Formula
    unit: str = ""
    meaning: str = ""

    def __post_init__(self) -> None:
        hold_plain(self)


@dataclass(frozen=True)
class Sampled:
    """A variable that is updated at equidistant times and held between them, such as an output or a
    state of a digital controller.

    It is updated at the times offset + k·period after the start of a motion; before the first
    update it has its initial value. All variables sampled at the same time are updated
    simultaneously from the previous values, also with several periods if their ratio is a number:
    ``"T"`` and ``"10*T"``.

    Attributes
    ----------
    period : str or float
        Time between samples, positive.
    law : str or float
        New value: a formula of time, the state, and sampled variables, including itself.
    delay : str or float
        Time after which the new value takes effect, less than the period. The pending value is a
        variable with the suffix ``_next``. For a delay of a whole period sample it again: ``{"G":
        Sampled(T, "k*x"), "F": Sampled(T, "G")}``.
    quantum : str or float
        Values are rounded to multiples of this number, as by an analogue-digital converter; 0 for
        no rounding.
    offset : str or float
        One of the sampling times.
    unit, meaning : str
    """

    period: Formula
    law: Formula
    delay: Formula = 0.0
    quantum: Formula = 0.0
    offset: Formula = 0.0
    unit: str = ""
    meaning: str = ""

    def __post_init__(self) -> None:
        hold_plain(self)


@dataclass(frozen=True)
class Output:
    """An additional quantity of results: a formula of the motion.

    Attributes
    ----------
    formula : str or float
        May use ``t``, parameters, functions and drives, coordinates, rates ``d_x``, internal
        variables, degrees of freedom of structures, other outputs, and quantities of contacts and
        energies by their names in the datasets of results: ``friction_c``, ``normal_c``,
        ``slip_speed_c``, ``energy``, accelerations ``dd_x``.
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
    potential is s·abs(Au), and the admissible forces form an ellipse, a disc for equal axes. With a
    `dissipation` R the potential is s·R(u): −λ·v ≤ s R(v) for all v in stick, and λ = −k ∇R(u) in
    slip. A face has three components, two of its velocity and a rate of rotation; λ is two forces
    and a moment. Its forces are an ellipsoid (R. D. Howe & M. R. Cutkosky, Int. J. Robotics
    Research 15, 1996), or exactly those of a disc or a ring under uniform pressure.

    Attributes
    ----------
    direction : str or pair of str
        Linear combination of rates, such as ``"d_x"`` or ``"d_x2 - d_x1"``; two of them, such as
        ``("d_x", "d_y")``, for a contact in a plane, and three, such as ``("d_x", "d_y",
        "d_phi")``, for a face. If the motion of both sides is prescribed, the rate of a drive, such
        as ``"d_xi"``, or ``"0"`` with a surface speed; the contact then acts on no coordinate, and
        its force in stick, which is undetermined, is 0.
    threshold : str, float or pair of these
        Largest friction force in stick, s ≥ 0. A pair gives s⁺ (for u > 0) and s⁻ (for u < 0) along
        a line; in a plane there is only one. Optional with a `dissipation`, which it multiplies.
    surface_speed : str, float or pair of these
        Speed w(t) of the surface (a belt); in a plane two components, which may also depend on
        coordinates (a turntable).
    kinetic : str, float, pair of these or None
        Friction force k ≤ s in slip; may use ``speed``, which is |u| along a line, abs(Au) in a
        plane, and R(u) with a `dissipation` (for a face, a mean of the speeds of its points). By
        default k = s.
    unit : str
        Unit of the friction force.
    axes : pair of str or float, or three
        Semi-axes of the set of forces, relative to the threshold: for a contact in a plane, or a
        face, such as ``(1, 1, "2*a/3")`` for a disc of radius a.
    dissipation : str or Dissipation, optional
        R, for a contact in a plane or a face: an :class:`Ellipsoid` or a :class:`SupportFormula`,
        which is stored as its formula, or a formula in ``v1``, ``v2`` (``v3``) and parameters,
        convex, positive and homogeneous of degree 1, such as ``"sqrt(v1**2 + 4*v2**2) + 0.2*v1"``,
        with a gradient wherever v is not 0. It need not be even. ``"disc(v1, v2, a*v3)"`` and
        ``"ring(v1, v2, a*v3)"`` are the mean speed of a disc and of a ring of radius a. The
        coordinates of the contact must be inertial.
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
        """A contact along each direction, by name."""
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
    """A unilateral contact: gap g ≥ 0, normal force N ≥ 0, N g = 0, and Coulomb friction μN, along
    a line or in a plane, optionally with adhesion.

    Thresholds of all contacts of inertial coordinates may use its normal force, with the name
    ``normal_foot`` for a contact named foot. They must be linear in normal forces, and may use
    several. Friction in a plane may depend on only one normal force, and may influence this force
    only if the body has no other such contact.

    Attributes
    ----------
    gap : str
        g(q, t), a function of inertial coordinates and time: the distance. The normal force is
        conjugate to it, so with friction it must be a length in the units of the sliding distance.
    direction : str or pair of str
        Linear combination of rates of the sliding direction, with coefficients that depend on q and
        t; two combinations in a plane.
    mu : str or float
        Coefficient of friction μ ≥ 0; may depend on the state and on time.
    kinetic : str or float, optional
        Coefficient of kinetic friction, at most μ; may also depend on ``speed``. By default μ.
    surface_speed : str, float or pair of these
        Speed w(t) of the surface along the direction; in a plane as in a :class:`Contact`.
    restitution, tangential_restitution : str or float
        Coefficients of restitution of Newton's impact law, normal and tangential, between 0 and 1.
    unit : str
        Unit of the forces.
    axes : pair of str or float
        As in a :class:`Contact`: in a plane, the semi-axes of the set of forces relative to μN.
    adhesion : str or float
        Largest tensile force of the closed contact, N₀ ≥ 0: N ≥ −N₀, and friction is μ(N + N₀), by
        Derjaguin's law. The contact opens when the tension exceeds N₀, exerts no force while open,
        and adheres again after closing. Adhesion is a force, not an energy, and does not affect
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
        """The friction, as a contact with the normal force of the named contact."""
        return _rubbing(self, name, self.adhesion)


@dataclass(frozen=True)
class Side(Unilateral):
    """One side of a constraint in the expanded system.

    Attributes
    ----------
    of : str
        Name of the constraint.
    """

    of: str = ""


@dataclass(frozen=True)
class Bilateral:
    """A bilateral constraint g(q, t) = 0, such as a bead on a wire or a pin in a slot, with Coulomb
    friction μ|N|.

    Thresholds of all contacts of inertial coordinates may use |N|, with the name ``normal_wire``
    for a constraint named wire.

    Attributes
    ----------
    constraint : str
        g(q, t), a function of inertial coordinates and time, zero at the initial state. N is
        conjugate to it, so with friction it must be a length in the units of the sliding distance.
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
        """The friction, as a contact with the normal force of the named contact."""
        return _rubbing(self, name)


def _rubbing(contact: Unilateral | Bilateral, name: str, adhesion: Formula = 0.0) -> Contact:
    """Coulomb's friction under the normal force of a contact, and its adhesion."""
    normal = normal_force(name)
    normal = normal if adhesion == 0.0 else f"({normal} + ({adhesion}))"
    kinetic = None if contact.kinetic is None else f"({contact.kinetic})*{normal}"
    speed, unit, axes = contact.surface_speed, contact.unit, contact.axes
    return Contact(contact.direction, f"({contact.mu})*{normal}", speed, kinetic, unit, axes)


@dataclass(frozen=True)
class LawContact:
    """A contact with a named friction law of :mod:`stickslip.model.laws`.

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
        """Its entry in a model file; :meth:`from_plain` is the inverse."""
        given = {"surface_speed": self.surface_speed, "unit": self.unit}
        others = {key: value for key, value in given.items() if value not in (0.0, "")}
        return {"law": self.law, "direction": self.direction, **self.values, **others}

    @classmethod
    def from_plain(cls, entry: Mapping[str, Any]) -> Self:
        """The contact from an entry with a law and a direction."""
        own = {item.name for item in fields(cls)} - {"values"}
        values = {key: value for key, value in entry.items() if key not in own}
        return cls(values=values, **{key: entry[key] for key in own & entry.keys()})


@dataclass(frozen=True)
class Jump:
    """A jump of the state where a formula passes through zero: a leg exchange, a kick, a reset.

    Attributes
    ----------
    when : str
        Formula of the state, rates of inertial coordinates and time. The jump fires where the
        formula crosses zero during the motion. It does not fire if another jump or an impact skips
        over zero, or if the motion begins at zero.
    to : mapping of str to formula
        New values of parts of the state: coordinates, rates ``d_x`` of inertial coordinates,
        degrees of freedom ``u[tip]`` of structures and their rates, internal variables. They are
        formulas of the state before the jump, applied simultaneously; other parts are unchanged.
    direction : {"falling", "rising", "both"}
        Direction of the zero crossing; −1, 1 and 0 are equivalent.
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
    """An inequality between formulas of the parameters, such as a condition from the literature.

    Attributes
    ----------
    formula : str
        Such as ``"P > rho + c*psi_star"``.
    otherwise : str
        Warning that is shown if the inequality is violated.
    """

    formula: str
    otherwise: str = ""


E = TypeVar("E", "Parameter", "Output")


class Entries(Generic[E]):
    """A table of entries in a declaration. A plain value is converted to an entry:
    ``parameters={"k": 1.0}`` means ``{"k": Parameter(1.0)}``.

    Parameters
    ----------
    kind : type
        Parameter or Output.
    plain : type or tuple of types
        Types of the values that are converted to entries.
    """

    def __init__(self, kind: type[E], plain: Any) -> None:
        self.kind = kind
        self.plain = plain

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, instance: object, owner: type | None = None) -> Mapping[str, E]:
        # A dataclass reads the default of the field from the class.
        return _NO_ENTRIES if instance is None else instance.__dict__[self.name]

    def __set__(self, instance: object, value: Mapping[str, E | Formula]) -> None:
        # Other types are rejected with the rest of the declaration.
        table = cast(Any, value)
        if isinstance(value, Mapping):
            table = {name: self._entry(entry) for name, entry in value.items()}
        instance.__dict__[self.name] = table

    def _entry(self, value: Any) -> Any:
        is_plain = isinstance(value, self.plain) and not isinstance(value, bool)
        return cast(Any, self.kind)(value) if is_plain else value


class _NoEntries(Mapping[str, Any]):
    """An empty table that can be a default, for it never changes."""

    def __getitem__(self, key: str) -> Any:
        raise KeyError(key)

    def __iter__(self) -> Iterator[str]:
        return iter(())

    def __len__(self) -> int:
        return 0

    def __hash__(self) -> int:
        return 0

    def __repr__(self) -> str:
        return "{}"


_NO_ENTRIES = _NoEntries()


def hold_plain(item: Any) -> None:
    """Copy mutable inputs of a declaration into plain data: copies of tables, tuples for lists, and
    strings for expressions.

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
