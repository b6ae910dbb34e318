"""Plain text with formulas, as the claims and captions have it, to HTML with sub- and
superscripts."""

from __future__ import annotations

import re
from html import escape

_MARKS = "[\u0300-\u036f]*"  # dots and hats over a letter
_WORD = "(?:min|max|av|frict|per)(?![a-z])"
# A base is one letter (with its dots; one more may stand before it), an operator or a bracket.
# Python names such as find_cycle have longer ones.
_BASE = rf"(?:(?<![A-Za-z]{{2}})[^\W\d_]{_MARKS}|\b(?:min|max|sup|inf)|[∂)\]‖*\u0300-\u036f])"
_SUBSCRIPT = re.compile(rf"({_BASE})_(?:{{([^}}]*)}}|({_WORD}|[\w∞*]{_MARKS}\*?))")
_SUPERSCRIPT = re.compile(
    r"\^(?:\{([^}]*)\}|\(([^()]*(?:\([^()]*\)[^()]*)*)\)|([-−]?\d+(?:\.\d+)?|[^\W_]|[+−±-]))"
)
_POWER_OF_TEN = re.compile(r"(?<![\w.])(\d(?:\.\d+)?)e([+-])0*(\d+)(?![\w.]*\w)")


def typeset(text: str) -> str:
    """The text as HTML.

    ``z_ε`` and ``ρ_min`` get a subscript, ``e^{−T}`` and ``ε^(3/2)`` a superscript, 1.5e-12 becomes
    1.5·10⁻¹².
    """
    html = escape(text)
    html = _SUBSCRIPT.sub(_subscript, html)
    html = _SUPERSCRIPT.sub(
        lambda m: f"<sup>{next(g for g in m.groups() if g is not None)}</sup>", html
    )
    return _POWER_OF_TEN.sub(_scientific, html)


def _subscript(match: re.Match[str]) -> str:
    return f"{match[1]}<sub>{_SUBSCRIPT.sub(_subscript, match[2] or match[3])}</sub>"


def _scientific(match: re.Match[str]) -> str:
    mantissa, sign, exponent = match.groups()
    if float(mantissa) == 0.0:
        return "0"
    power = ("−" if sign == "-" else "") + (exponent or "0")
    return ("" if float(mantissa) == 1.0 else f"{mantissa}·") + f"10<sup>{power}</sup>"
