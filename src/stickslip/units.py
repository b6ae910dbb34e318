"""Units of parameters and coordinates: read, checked, and written for axes."""

from __future__ import annotations

import re

from stickslip.errors import DeclarationError, short

NAMES = frozenset(
    "m kg s A K mol cd g t N Pa J W Hz rad deg V C F ohm T H L bar min h d yr a eV S mm cm km um nm µm "
    "ms us ns µs mN kN MN uN nN pN fN kPa MPa GPa mJ kJ MJ aJ mW kW MW kHz MHz GHz mg mrad pm 1 %".split()
)
POWER = r"\^(?:-?\d+(?:/\d+)?|\(-?\d+(?:/\d+)?\))"
FACTOR = rf"(?:[A-Za-zµ]+|1|%)(?:{POWER})?"
GROUP = rf"(?:{FACTOR}|\({FACTOR}(?:[*·/ ]{FACTOR})*\))"
UNIT = re.compile(rf"{FACTOR}(?:[*·/ ]{GROUP})*\Z")


def check_unit(text: str, where: str) -> str:
    """Return the unit if it parses; ``""`` and ``"1"`` mean dimensionless.

    Raises
    ------
    DeclarationError
        If it is not a product of known unit names with powers, such as ``kg*m^2/s``.
    """
    plain = re.sub(r"\s*([*·/^])\s*", r"\1", text.strip().replace("**", "^"))
    names = re.findall(r"[A-Za-zµ]+", plain)
    unknown = [name for name in names if name not in NAMES]
    if unknown or (plain and not UNIT.match(plain)):
        reason = f"at '{short(unknown[0])}'" if unknown else "as a product of powers"
        raise DeclarationError(
            where,
            f"the unit '{short(text)}' does not parse {reason}",
            "Write a product of SI units with powers, like 'kg*m^2/s', or '1'",
        )
    return text


def with_unit(value: float, unit: str, digits: int = 9) -> str:
    """A number with its unit, if it has one."""
    return f"{value:.{digits}g}" + ("" if unit.strip() in ("", "1") else f" {unit}")


def unit_label(text: str) -> str:
    """The unit as mathtext for a picture; empty if dimensionless."""
    if text.strip() in ("", "1"):
        return ""
    text = text.replace("**", "^").replace("*", r"\,").replace("µ", r"\mu ")
    return r"$\mathrm{" + re.sub(r"\^(?:\((.*?)\)|(-?\d+(?:/\d+)?))", r"^{\1\2}", text) + "}$"
