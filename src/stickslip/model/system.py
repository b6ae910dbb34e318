"""What a system with dry friction is: its energy and its dissipation potential, as plain data.

A :class:`System` holds texts and numbers only. Creating one checks the whole declaration
(:mod:`stickslip.model.declaration`), so a System that exists is a System that makes sense.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from difflib import get_close_matches
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

from stickslip.errors import DeclarationError, short
from stickslip.symbolic.formulas import is_finite, parse_signature

if TYPE_CHECKING:
    from stickslip.model.declaration import Declaration

Formula = str | float


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


@dataclass(frozen=True)
class Viscous:
    """A coordinate without mass, with viscous friction: ∂R/∂ż + ∂Φ/∂z ∋ force."""

    kind: ClassVar[Kind] = Kind.VISCOUS
    unit: str = ""
    meaning: str = ""
    force: Formula = 0.0


@dataclass(frozen=True)
class RateIndependent:
    """A coordinate with dry friction only: ∂R/∂ż + ∂Φ/∂z ∋ force, R 1-homogeneous."""

    kind: ClassVar[Kind] = Kind.RATE_INDEPENDENT
    unit: str = ""
    meaning: str = ""
    force: Formula = 0.0


Coordinate = Inertial | Viscous | RateIndependent


@dataclass(frozen=True)
class Internal:
    """An internal variable α̇ = law(t, x, ẋ, α)."""

    law: Formula
    unit: str = ""
    meaning: str = ""


@dataclass(frozen=True)
class Contact:
    """A dry contact with relative velocity u = direction − surface_speed.

    Attributes
    ----------
    direction : str
        Linear combination of rates, such as ``"d_x"`` or ``"d_x2 - d_x1"``.
    threshold : str, float or pair of these
        Largest force it can hold, s ≥ 0. A pair gives s⁺ (for u > 0) and s⁻ (for u < 0).
    surface_speed : str or float
        Speed w(t) of the surface (a belt).
    kinetic : str, float, pair of these or None
        Friction force k ≤ s while sliding; may use ``speed`` = |u|. By default k = s.
    unit : str
        Unit of the friction force.
    """

    direction: str
    threshold: Formula | tuple[Formula, Formula]
    surface_speed: Formula = 0.0
    kinetic: Formula | tuple[Formula, Formula] | None = None
    unit: str = ""

    def __post_init__(self) -> None:
        _lists_to_tuples(self)


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


def _lists_to_tuples(item: Contact | System) -> None:
    """A pair may be given as a list, as in a model file."""
    for entry in fields(item):
        value = getattr(item, entry.name)
        if isinstance(value, list):
            object.__setattr__(item, entry.name, tuple(value))


@dataclass(frozen=True)
class System:
    """A system declared by its energy and its dissipation potential.

    Attributes
    ----------
    name, title, source : str
        Short name, one line of description, and the literature.
    parameters : mapping of str to Parameter
    functions : mapping of str to formula
        Functions used in formulas, such as ``{"H_R(psi)": "clip(...)"}``.
    drives : mapping of str to formula
        Given functions of time, such as ``{"ell": "V*t"}``.
    coordinates : mapping of str to Coordinate
        The rate of coordinate ``x`` is called ``d_x``.
    internal : mapping of str to Internal
    kinetic, potential, viscous : formula
        Kinetic energy (quadratic in the rates of inertial coordinates, constant coefficients),
        potential Φ(t, x, α), and the quadratic viscous part of the dissipation potential.
    contacts : mapping of str to Contact
    translation : mapping of str to float
        A direction in which the whole system may be shifted.
    initial : mapping of str to float
        Default initial values of coordinates, rates of inertial coordinates and internal variables
        (else 0).
    span : (float, float)
        Default time span.
    time_unit : str
    conditions : mapping of str to Condition
        What is known to be necessary, by name.
    facts : mapping of str to formula
        Closed-form facts, formulas of the parameters (such as X, ψ₂ of the rocking toy).

    Raises
    ------
    DeclarationError
        If anything in the declaration is wrong; the message names the key, the reason and the
        remedy.
    """

    name: str
    title: str = ""
    source: str = ""
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    functions: Mapping[str, Formula] = field(default_factory=dict)
    drives: Mapping[str, Formula] = field(default_factory=dict)
    coordinates: Mapping[str, Coordinate] = field(default_factory=dict)
    internal: Mapping[str, Internal] = field(default_factory=dict)
    kinetic: Formula = 0.0
    potential: Formula = 0.0
    viscous: Formula = 0.0
    contacts: Mapping[str, Contact] = field(default_factory=dict)
    translation: Mapping[str, float] = field(default_factory=dict)
    initial: Mapping[str, float] = field(default_factory=dict)
    span: tuple[float, float] = (0.0, 100.0)
    time_unit: str = ""
    conditions: Mapping[str, Condition] = field(default_factory=dict)
    facts: Mapping[str, Formula] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, Mapping):
                object.__setattr__(self, item.name, dict(value))
        _lists_to_tuples(self)
        _ = self.declaration

    @cached_property
    def declaration(self) -> Declaration:
        """The declaration read and checked: every formula as an expression."""
        from stickslip.model.declaration import declare

        return declare(self)

    def __hash__(self) -> int:
        return hash((self.name, repr(self)))

    def configure(self, given: Mapping[str, Formula]) -> System:
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
        changes: dict[str, dict[str, Any]] = {"parameters": {}, "functions": {}, "drives": {}}
        signatures = {parse_signature(key, "functions")[0]: key for key in self.functions}
        for name, value in given.items():
            if name in self.parameters:
                if not is_finite(value):
                    raise DeclarationError(
                        f"parameters.{name}",
                        f"'{short(str(value))}' is not a finite number",
                        "Give a number",
                    )
                changes["parameters"][name] = replace(self.parameters[name], default=float(value))
            elif name in signatures:
                changes["functions"][signatures[name]] = value
            elif name in self.drives:
                changes["drives"][name] = value
            else:
                known = [*self.parameters, *signatures, *self.drives]
                close = get_close_matches(name, known, 1)
                raise DeclarationError(
                    self.name,
                    f"there is no parameter or free function '{short(name)}'",
                    f"Did you mean '{close[0]}'?" if close else f"Known: {', '.join(known)}",
                )
        return replace(
            self, **{key: {**getattr(self, key), **new} for key, new in changes.items() if new}
        )

    def with_parameters(self, **values: float) -> System:
        """The same system with other default values of its parameters."""
        return self.configure(values)

    @cached_property
    def values(self) -> dict[str, float]:
        """Default values of the parameters."""
        return {name: p.default for name, p in self.parameters.items()}

    def heading(self) -> dict[str, Any]:
        """What a summary of its results says of it: its name and its given functions."""
        return {"model": self.name, "functions": {**self.functions, **self.drives}}

    def equations(self, latex: bool = False) -> Any:
        """The equations as a person would write them: Unicode text, or LaTeX."""
        from stickslip.display.equations import Equations

        shown = Equations(self)
        return shown.latex() if latex else shown

    def to_toml(self) -> str:
        """The declaration as a model file."""
        from stickslip.model.system_file import dumps

        return dumps(self)
