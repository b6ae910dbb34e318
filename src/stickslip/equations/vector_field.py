"""The vector field of one mode, as formulas and as numbers: the equations of a system while none of
its contacts changes its mode."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from stickslip import page
from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.equations.derive import derive
from stickslip.equations.field import MODE_NAMES, ContactField, Field
from stickslip.equations.mode_fields import mode_field
from stickslip.errors import DeclarationError, short, suggestion
from stickslip.kept import cached_property
from stickslip.model.system import System
from stickslip.symbolic.expressions import Expr, substitute, to_text

Values = Mapping[str, float]
_LONGEST = 1_000_000  # largest number of characters of a formula
_SIGNS = {name: sign for sign, name in MODE_NAMES.items()}


@dataclass(frozen=True, eq=False, repr=False)
class VectorField:
    """The equations of motion of a system in one mode, solved for the rates.

    They hold in the region of all functions with kinks (abs, min, max, clip, piecewise) in which
    `at` lies.

    Attributes
    ----------
    system : System
    modes : dict of str to str
        ``"stick"``, ``"slip+"`` or ``"slip-"`` of every contact.
    at : dict of str to float
        A point of the region, which supplies values that later points omit.
    """

    system: System
    modes: dict[str, str]
    at: dict[str, float]
    _field: Field

    def __repr__(self) -> str:
        modes = ", ".join(f"{contact}: {mode}" for contact, mode in self.modes.items())
        return f"<VectorField of {self.system.name}: {modes or 'no contacts'}>"

    def _repr_html_(self) -> str:
        modes = ", ".join(f"{contact}: {mode}" for contact, mode in self.modes.items())
        return page.whole(
            page.headline(self.system.title or self.system.name),
            page.paragraph(f"Modes: {modes}" if modes else "No contacts"),
            page.tabled(self.rates.items(), ("state", "its rate")),
            page.tabled(self.forces.items(), ("contact", "its force")),
        )

    @property
    def state(self) -> tuple[str, ...]:
        """Names of the state, in the order of rows and columns of the Jacobian."""
        return self._field.state

    @cached_property
    def rates(self) -> dict[str, str]:
        """The rate of every name of the state: a formula of ``t``, the state and parameters."""
        return dict(zip(self.state, map(_text, self._field.rates), strict=True))

    @cached_property
    def jacobian(self) -> list[list[str]]:
        """Derivatives of the rates with respect to the state, as formulas."""
        return [list(map(_text, row)) for row in self._field.jacobian]

    @cached_property
    def forces(self) -> dict[str, str]:
        """Friction force of every contact, as a formula; positive if it acts forward."""
        return {contact.name: _text(contact.force) for contact in self._declared}

    @validated
    def rates_at(self, values: Values | None = None) -> dict[str, float]:
        """Rates at a point; names that are not given have their values in `at`.

        Raises
        ------
        DeclarationError
            If a name has no value, or a value is given for an unknown name.
        """
        numbers = self._numbers(self._field.rates, values)
        return dict(zip(self.state, numbers, strict=True))

    @validated
    def jacobian_at(self, values: Values | None = None) -> Array:
        """Jacobian at a point, shape (n, n)."""
        return np.array([self._numbers(row, values) for row in self._field.jacobian])

    @validated
    def forces_at(self, values: Values | None = None) -> dict[str, float]:
        """Friction forces at a point, by contact."""
        numbers = self._numbers([c.force for c in self._declared], values)
        return {c.name: force for c, force in zip(self._declared, numbers, strict=True)}

    @property
    def _declared(self) -> list[ContactField]:
        return [part for c in self._field.contacts for part in c.parts or (c,)]

    def _numbers(self, expressions: list[Expr], values: Values | None) -> list[float]:
        point = {**self.at, **(values or {})}
        return [self.system.declaration.value(e, point) for e in expressions]


@validated
def vector_field(
    system: System, modes: Mapping[str, str] | None = None, *, at: Values | None = None
) -> VectorField:
    """Derive the equations of motion of a system for given modes of its contacts.

    Parameters
    ----------
    system : System
    modes : mapping of str to str
        ``"stick"``, ``"slip+"`` or ``"slip-"`` for every contact, as in results of equilibria and
        motions.
    at : mapping of str to float, optional
        Values of ``t``, the state and parameters (else their defaults). It selects the region of
        functions with kinks, and supplies values that later points omit.

    Returns
    -------
    VectorField
        Rates, Jacobian and friction forces, as formulas and as numbers.

    Raises
    ------
    DeclarationError
        If contacts or modes are unknown or missing, kinks depend on names without a value, or the
        rates are indeterminate in this mode.

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.catalogue.spring_slider(mu="2/sqrt(alpha)", nu=0.05)
    >>> field = ss.vector_field(slider, {"block": "slip-"})
    >>> field.rates["U"]
    '(2/alpha**0.5 + V*nu - k*U)/nu'
    >>> field.rates_at({"U": 1.5, "alpha": 4.0, "V": 0.2})
    {'U': -9.8, 'alpha': 12.0}
    """
    equations = derive(system.declaration)
    names = [c.name for own in equations.members for c in own]
    given = dict(modes or {})
    for name in names:
        if given.get(name) not in _SIGNS:
            said = (
                f"has an unknown mode '{short(str(given[name]))}'"
                if name in given
                else "has no mode"
            )
            raise DeclarationError(
                "modes", f"'{short(name)}' {said}", f"Give one of {', '.join(_SIGNS)}"
            )
    for name in given:
        if name not in names:
            known = suggestion(name, names)
            raise DeclarationError("modes", f"unknown contact '{short(name)}'", known)
    point = {**system.values, **(at or {})}
    kinks = [substitute(g, equations.speeds) for g in equations.kinks]
    region = tuple(int(system.declaration.value(g, point) >= 0.0) for g in kinks)
    turned = equations.turned(region)
    signs = {name: _SIGNS[given[name]] * (-1 if name in turned else 1) for name in names}
    for own in equations.members:
        if len({signs[c.name] for c in own}) > 1:
            said = " and ".join(f"'{short(c.name)}'" for c in own)
            back = " and ".join(f"'{short(c.name)}'" for c in own if c.name in turned)
            raise DeclarationError(
                "modes",
                f"{said} {'share one gap' if own[0].gap else 'share one direction'}"
                + (f", {back} backward" if back else ""),
                "Give them consistent modes" if back else "Give them the same mode",
            )
    mode = tuple(signs[own[0].name] for own in equations.members)
    try:
        found = mode_field(equations, mode, region)
    except ZeroDivisionError:
        raise DeclarationError(
            "modes", "the rates are indeterminate in this mode", "Choose fewer sticking contacts"
        ) from None
    return VectorField(system, {name: given[name] for name in names}, point, found)


def _text(expression: Expr) -> str:
    return to_text(expression, _LONGEST)
