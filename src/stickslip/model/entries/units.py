"""Units of parameters and coordinates: read, checked, multiplied, compared, and written for
axes."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from difflib import get_close_matches
from fractions import Fraction
from functools import cache

from stickslip.errors import DeclarationError, short
from stickslip.numerics.levels import SAME_VALUE

_POWER = r"\^(?:-?\d+(?:/\d+)?|\(-?\d+(?:/\d+)?\))"
_FACTOR = rf"(?:[A-Za-zµ]+|1|%)(?:{_POWER})?"
_GROUP = rf"(?:{_FACTOR}|\({_FACTOR}(?:[*·/ ]{_FACTOR})*\))"
_UNIT = re.compile(rf"{_FACTOR}(?:[*·/ ]{_GROUP})*\Z")
_PREFIXES = {
    "a": -18,
    "f": -15,
    "p": -12,
    "n": -9,
    "u": -6,
    "µ": -6,
    "m": -3,
    "c": -2,
    "d": -1,
    "h": 2,
    "k": 3,
    "M": 6,
    "G": 9,
}
SI = ("kg", "m", "s", "A", "K", "mol", "cd")
_DERIVED = {
    "g": (1e-3, "kg"), "t": (1e3, "kg"), "L": (1e-3, "m^3"), "min": (60.0, "s"), "h": (3600.0, "s"),
    "d": (86400.0, "s"), "a": (31557600.0, "s"), "yr": (31557600.0, "s"), "rad": (1.0, "1"),
    "deg": (math.pi / 180.0, "1"), "%": (0.01, "1"), "Hz": (1.0, "1/s"), "N": (1.0, "kg*m/s^2"),
    "Pa": (1.0, "N/m^2"), "bar": (1e5, "Pa"), "J": (1.0, "N*m"), "eV": (1.602176634e-19, "J"),
    "W": (1.0, "J/s"), "C": (1.0, "A*s"), "V": (1.0, "W/A"), "F": (1.0, "C/V"),
    "ohm": (1.0, "V/A"), "S": (1.0, "A/V"), "T": (1.0, "V*s/m^2"), "H": (1.0, "V*s/A"),
    "rev": (2.0 * math.pi, "1"), "rpm": (math.pi / 30.0, "1/s"), "arcmin": (math.pi / 10800.0, "1"),
    "arcsec": (math.pi / 648000.0, "1"), "atm": (101325.0, "Pa"), "psi": (6894.757293168361, "Pa"),
    "dyn": (1e-5, "N"), "kgf": (9.80665, "N"), "lbf": (4.4482216152605, "N"),
    "lb": (0.45359237, "kg"), "in": (0.0254, "m"), "ft": (0.3048, "m"),
}  # fmt: skip
_WITH_PREFIXES = "m g s A K N Pa J W Hz rad V C F ohm T H L bar eV S mol".split()
UNIT_NAMES = frozenset(
    [*SI, *_DERIVED, "1", *(prefix + name for prefix in _PREFIXES for name in _WITH_PREFIXES)]
)
_WORDS = {
    "sec": "s", "second": "s", "minute": "min", "hour": "h", "day": "d", "year": "yr",
    "meter": "m", "metre": "m", "newton": "N", "joule": "J", "watt": "W", "pascal": "Pa",
    "hertz": "Hz", "kilogram": "kg", "gram": "g", "gramme": "g", "degree": "deg", "radian": "rad",
    "hr": "h", "turn": "rev", "inch": "in", "foot": "ft", "pound": "lb", "volt": "V",
    "ampere": "A", "amp": "A", "kelvin": "K", "liter": "L", "litre": "L", "tonne": "t",
    "percent": "%",
}  # fmt: skip

_SIGNS = str.maketrans({"μ": "µ", "²": "^2", "³": "^3", "°": "deg", "Ω": "ohm", "⋅": "·"})

UnitPowers = Mapping[str, Fraction]


def check_unit(text: str, where: str) -> str:
    """Return the unit if it parses; ``""`` and ``"1"`` mean dimensionless.

    Raises
    ------
    DeclarationError
        If it is not a product of known unit names with powers, such as ``kg*m^2/s``.
    """
    plain = _plain(text)
    names = re.findall(r"[A-Za-zµ]+", plain)
    unknown = [name for name in names if name not in UNIT_NAMES]
    if unknown or (plain and not _UNIT.match(plain)):
        reason = (
            f": unknown unit '{short(unknown[0])}'"
            if unknown
            else ": it is not a product of powers"
        )
        remedy = "Write a product of SI units with powers, like 'kg*m^2/s', or '1'"
        meant = _meant(unknown[0]) if unknown else []
        if meant:
            remedy = f"Did you mean {' or '.join(repr(name) for name in meant)}? {remedy}"
        raise DeclarationError(where, f"cannot parse '{short(text)}'{reason}", remedy)
    return text


def _meant(name: str) -> list[str]:
    """Suggestions for an unknown unit: a word, other capitals, a missing operator, or a
    misspelling."""
    word = name.lower()
    for form in (word, word.removesuffix("s")):
        if form in _WORDS:
            return [_WORDS[form]]
    if name[:-1] in UNIT_NAMES and name.endswith("s"):
        return [name[:-1]]
    capitals = sorted(unit for unit in UNIT_NAMES if unit.lower() == word)
    splits = [(name[:i], name[i:]) for i in range(1, len(name))]
    pairs = [f"{a}*{b}" for a, b in splits if a in UNIT_NAMES and b in UNIT_NAMES]
    close = get_close_matches(name, sorted(UNIT_NAMES), 2)
    return list(dict.fromkeys([*pairs, *capitals, *close]))[:3]


def _plain(text: str) -> str:
    """The unit without blanks around its operators."""
    return re.sub(r"\s*([*·/^])\s*", r"\1", text.strip().translate(_SIGNS).replace("**", "^"))


@cache
def factors(unit: str) -> UnitPowers:
    """Powers of the names in a unit: ``kg*m/s^2`` is {kg: 1, m: 1, s: −2}; empty if
    dimensionless."""
    powers: dict[str, Fraction] = {}
    for operator, group, one in re.findall(
        rf"([*·/ ]?)(?:\(([^()]*(?:\([^()]*\)[^()]*)*)\)|({_FACTOR}))", _plain(unit)
    ):
        inner = dict(factors(group)) if group else {}
        if one:
            name, _, power = one.partition("^")
            inner = {name: Fraction(power.strip("()") or 1)}
        for name, power in inner.items():
            powers[name] = powers.get(name, Fraction(0)) + (-power if operator == "/" else power)
    return {name: power for name, power in powers.items() if power and name != "1"}


def unit_product(*terms: tuple[UnitPowers, float]) -> UnitPowers:
    """Product of powers of units; a radian is written only if nothing else is in the numerator."""
    powers: dict[str, Fraction] = {}
    for unit, exponent in terms:
        for name, power in unit.items():
            powers[name] = powers.get(name, Fraction(0)) + power * Fraction(
                exponent
            ).limit_denominator(1000)
    powers = {name: power for name, power in powers.items() if power}
    if any(power > 0 for name, power in powers.items() if name != "rad"):
        powers.pop("rad", None)
    return powers


def unit_text(unit: UnitPowers) -> str:
    """The unit as declared: ``kg*m^2/s``, ``1/s``, ``W/(m^2*K)``, ``1``."""

    def text(sign: int) -> list[str]:
        shown = [(name, sign * power) for name, power in unit.items() if sign * power > 0]
        return [
            name if p == 1 else f"{name}^{p}" if p.denominator == 1 else f"{name}^({p})"
            for name, p in shown
        ]

    above, below = text(1), text(-1)
    over = "*".join(above) or "1"
    return over + (f"/({'*'.join(below)})" if len(below) > 1 else f"/{below[0]}" if below else "")


@cache
def in_si(name: str) -> tuple[float, UnitPowers]:
    """A unit name as a multiple of a product of SI base units."""
    if name in SI:
        return 1.0, {name: Fraction(1)}
    if name in _DERIVED:
        scale, unit = _DERIVED[name]
    else:
        scale = 10.0 ** _PREFIXES[name[0]]
        unit = name[1:]
    more, base = lowest_terms(factors(unit))
    return scale * more, base


def lowest_terms(unit: UnitPowers) -> tuple[float, UnitPowers]:
    """A unit as a multiple of a product of SI base units."""
    parts = [(*in_si(name), power) for name, power in unit.items()]
    scale = math.prod(scale ** float(power) for scale, _, power in parts)
    return scale, unit_product(*((base, float(power)) for _, base, power in parts))


def agree(first: UnitPowers, second: UnitPowers) -> bool:
    """Whether two units are the same, such as aJ and N/m*nm^2."""
    (a, one), (b, two) = lowest_terms(first), lowest_terms(second)
    return one == two and math.isclose(a, b, rel_tol=SAME_VALUE)


def with_unit(value: float, unit: str, digits: int = 9) -> str:
    """A number with its unit, if it has one; below a million without a power of ten."""
    text = f"{value:.{digits}g}"
    if "e+" in text and abs(value) < 1e6:
        text = f"{float(text):.0f}"
    return text + ("" if unit.strip() in ("", "1") else f" {unit}")


def unit_label(text: str) -> str:
    """The unit as mathtext for a picture; empty if dimensionless."""
    if text.strip() in ("", "1"):
        return ""
    text = text.replace("**", "^").replace("*", r"\,").replace("µ", r"\mu ")
    return r"$\mathrm{" + re.sub(r"\^(?:\((.*?)\)|(-?\d+(?:/\d+)?))", r"^{\1\2}", text) + "}$"
