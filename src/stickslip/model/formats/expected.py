"""Keys of entries in messages, and the types expected there."""

from __future__ import annotations

from numbers import Real
from typing import Any

from stickslip.errors import DeclarationError, short
from stickslip.symbolic.formulas import NAME

PLANAR = (
    "Write it like 'd_x' or 'd_x2 - d_x1'; friction in a plane is a contact with a threshold and "
    "two directions, like direction = ['d_x', 'd_y']"
)
"""The remedy for a direction that is not a linear combination of rates."""
EXPECTED = {
    "str": ("a string", 'Write it in quotes, like "N/m"'),
    "float": ("a number", "Write it without quotes, like 0.5"),
    "Formula": ("a formula", 'Write it in quotes, like "k*x", or give a number'),
    "Drive": (
        "a formula or samples",
        'Write "V*t", or {file = "base.csv", time = "t", value = "a"}',
    ),
    "Formula | tuple[Formula, Formula]": (
        "a formula or a pair of formulas",
        'Write "mu*m*g" or ["f_plus", "f_minus"]',
    ),
    "SurfaceSpeed": (
        "a formula or a pair of formulas",
        'Write "V", or both components for a contact in a plane, like ["V", 0]',
    ),
    "Axes": ("two or three semi-axes", "Write it like [1.0, 0.6]"),
    "Direction | tuple[Direction, ...]": (
        "one to three linear combinations of rates",
        "Write it like 'd_x' or 'd_x2 - d_x1'; friction in a plane has two components, like "
        "['d_x', 'd_y'], a face that rotates has three, like ['d_x', 'd_y', 'd_phi']",
    ),
    "Dissipating": (
        "a formula of the velocity",
        "Write it like 'sqrt(v1**2 + 4*v2**2)', or give an Ellipsoid or a SupportFormula",
    ),
    "Passing": ("a direction of zero crossing", 'Write "falling", "rising" or "both"'),
    "ImpactLaw": ("an impact law", 'Write "together" or "in turn"'),
    "Direction": ("one linear combination of rates", PLANAR),
    "Direction | tuple[Direction, Direction]": (
        "a linear combination of rates, or a pair",
        "Write it like 'd_x' or 'd_x2 - d_x1'; friction in a plane has two components, "
        "like ['d_x', 'd_y']",
    ),
    "Formula | tuple[Formula, ...]": (
        "a formula or a list of formulas",
        'Write "mu*m*g", or [1.0, "2*F"] for several elements',
    ),
    "FormulaTable": ("a formula or lists of formulas", 'Write "k*t", or ["sin(t)", "2*t"]'),
    "int": ("an integer", "Write it without quotes, like 40"),
    "tuple[Formula, Formula]": ("a pair of formulas", 'Write it like [0, "2*pi/omega"]'),
    "tuple[float, float]": ("a pair of numbers", "Write it like [0, 100]"),
    "AnyStructure": (
        "a structure",
        'Give ss.Structure(mass, stiffness); in a model file {mass = "M.mtx", stiffness = "K.mtx"}',
    ),
    "AnyTable": (
        "a table",
        "Give ss.Table(points, values); in a model file "
        '{file = "mu.csv", of = "speed", value = "mu"}',
    ),
    "Output": (
        "a formula",
        'Write it in quotes, like "x1 - x2", or {formula = "x1 - x2", unit = "m"}',
    ),
    "Parameter": (
        "a number or a parameter",
        'Write it like 1.5, or ss.Parameter(1.5, "N/m"); in a file {default = 1.5, unit = "N/m"}',
    ),
    "table": (
        "a table",
        "Write it like {name = value} or Parameter(1.0), as for the other entries of this section",
    ),
}
"""What a field of a declaration holds, by its annotation, and how that is written."""


def wrong_kind(value: Any, expected: str, where: str) -> DeclarationError:
    """The error for a value that is not of the expected kind, a key of :data:`EXPECTED`."""
    names = {
        "dict": "a table",
        "list": f"a list of {len(value)}" if isinstance(value, list) else "",
        "tuple": f"a list of {len(value)}" if isinstance(value, tuple) else "",
        "str": "a string",
        "bool": "true or false",
    }
    kind = type(value).__name__
    if expected in ("Passing", "ImpactLaw"):
        names |= {"str": f"'{short(str(value))}'"}
    plain = isinstance(value, Real) and not isinstance(value, bool)
    found = "a number" if plain else names.get(kind, f"a value of type {kind}")
    what, remedy = EXPECTED[expected]
    return DeclarationError(where, f"expected {what}, got {found}", remedy)


def entry_key(section: str, name: str) -> str:
    """The full key of an entry, such as ``contacts.'right leg'``."""
    return (
        f"{section}.{name}"
        if NAME.match(name) and section != "contacts"
        else f"{section}.'{short(name)}'"
    )
