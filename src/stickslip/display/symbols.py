"""Names as symbols: ``psi_star`` is ψ*, ``mu_0`` is μ₀, ``v_hat`` is v̂; and units as they are
printed."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass

_GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "epsilon": "ε", "zeta": "ζ",
    "eta": "η", "theta": "θ", "iota": "ι", "kappa": "κ", "lam": "λ", "lamda": "λ", "mu": "μ",
    "nu": "ν", "xi": "ξ", "rho": "ρ", "sigma": "σ", "tau": "τ", "upsilon": "υ", "phi": "φ",
    "chi": "χ", "psi": "ψ", "omega": "ω", "pi": "π", "ell": "ℓ",
    "Gamma": "Γ", "Delta": "Δ", "Theta": "Θ", "Lambda": "Λ", "Xi": "Ξ", "Pi": "Π", "Sigma": "Σ",
    "Upsilon": "Υ", "Phi": "Φ", "Psi": "Ψ", "Omega": "Ω",
}  # fmt: skip
_GREEK_LATEX = {
    "lam": r"\lambda",
    "lamda": r"\lambda",
    "epsilon": r"\varepsilon",
    "phi": r"\varphi",
}
_ACCENTS = {
    "hat": ("\u0302", r"\hat", "^"),
    "tilde": ("\u0303", r"\tilde", "~"),
    "bar": ("\u0304", r"\bar", "¯"),
}
_ABOVE = {"star": ("*", "*", "*"), "plus": ("⁺", "+", "+"), "minus": ("⁻", "-", "−")}
_DOTS = ("", "\u0307", "\u0308")
_SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


@dataclass(frozen=True)
class Symbol:
    """The parts of a name: letter, accents, superscript and subscript."""

    letter: str
    accents: tuple[str, ...]
    superscripts: tuple[str, ...]
    subscripts: tuple[str, ...]


def parse_name(name: str) -> Symbol:
    """Take ``psi_star`` or ``x_R`` or ``x12`` or ``u[tip]`` apart."""
    first, *rest = name.replace("[", "_").rstrip("]").split("_")
    match = re.fullmatch(r"([A-Za-z]+)(\d+)", first)
    if match and (len(match[1]) == 1 or match[1] in _GREEK):
        first = match[1]
        rest = [match[2], *rest]
    accents, above = (tuple(part for part in rest if part in known) for known in (_ACCENTS, _ABOVE))
    return Symbol(
        first, accents, above, tuple(part for part in rest if part and part not in accents + above)
    )


def is_word(name: str) -> bool:
    """Return whether a name is a word rather than a symbol: ``mean_speed``, not ``v_mean``."""
    first = parse_name(name).letter
    return len(first) > 1 and first not in _GREEK


def unicode_symbol(name: str) -> str:
    """The symbol of a published quantity; ``d_x`` is a rate."""
    rate = name.startswith("d_") and len(name) > 2
    return unicode_name(name[2:], 1) if rate else unicode_name(name)


def unicode_name(name: str, dots: int = 0) -> str:
    """The name as a symbol for the terminal, with one or two dots for rates."""
    if is_word(name):
        return name + "˙" * dots  # a dot over one letter of a word would be misread
    s = parse_name(name)
    letter = (
        _GREEK.get(s.letter, s.letter) + "".join(_ACCENTS[a][0] for a in s.accents) + _DOTS[dots]
    )
    below = [_GREEK.get(part, part) for part in s.subscripts]
    if len(below) == 1 and below[0].isdigit():
        tail = below[0].translate(_SUBSCRIPTS)
    else:
        tail = "_" + ",".join(below) if below else ""
    return (
        unicodedata.normalize("NFC", letter) + tail + "".join(_ABOVE[a][0] for a in s.superscripts)
    )


def symbol_parts(name: str) -> tuple[str, list[str], list[str], list[str]]:
    """Letter, accents, subscript and superscript, in Unicode."""
    s = parse_name(name)
    below, above = [_GREEK.get(part, part) for part in s.subscripts], s.superscripts
    accents = [_ACCENTS[a][2] for a in s.accents]
    return _GREEK.get(s.letter, s.letter), accents, below, [_ABOVE[a][2] for a in above]


def latex_name(name: str, dots: int = 0) -> str:
    """The name as a symbol for LaTeX, with one or two dots for rates."""
    s = parse_name(name)
    text = (
        _latex_word(s.letter)
        if not is_word(name)
        else rf"\mathrm{{{name.replace('_', chr(92) + '_')}}}"
    )
    for accent in () if is_word(name) else s.accents:
        text = f"{_ACCENTS[accent][1]}{{{text}}}"
    if dots:
        text = rf"\{'d' * dots}ot{{{text}}}"
    if is_word(name):
        return text
    below = ",".join(map(_latex_word, s.subscripts))
    above = "".join(_ABOVE[a][1] for a in s.superscripts)
    return text + (f"_{{{below}}}" if below else "") + (f"^{{{above}}}" if above else "")


def _latex_word(word: str) -> str:
    if word in _GREEK:
        return _GREEK_LATEX.get(word, rf"\{word}")
    return word if len(word) == 1 or word.isdigit() else rf"\mathrm{{{word}}}"


def unicode_unit(unit: str) -> str:
    """``kg*m^2/s`` as kg·m²/s; empty if dimensionless."""
    if unit.strip() in ("", "1"):
        return ""
    text = unit.replace("**", "^").replace("*", "·")
    return re.sub(
        r"\^(?:(-?\d+)|\((-?\d+)\))", lambda m: (m[1] or m[2]).translate(SUPERSCRIPTS), text
    )


def width(text: str) -> int:
    """Columns a text takes in a terminal: combining marks take none."""
    return sum(not unicodedata.combining(c) for c in text)
