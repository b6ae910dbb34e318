"""Trees of :mod:`stickslip.display.tree` as text: Unicode for the terminal, LaTeX for papers."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from stickslip.display.symbols import SUPERSCRIPTS, latex_name, unicode_name
from stickslip.display.tree import (
    HALF,
    INVERSE,
    UNITY,
    VECTOR,
    Call,
    Factors,
    InWords,
    Name,
    Node,
    Number,
    Relation,
    Sum,
    Term,
    as_product,
    coefficient_and_rest,
    negate,
)
from stickslip.symbolic.functions import FUNCTIONS
from stickslip.symbolic.pieces import STRUCTURES, Pieced

_SUM, _PRODUCT, _POWER, _ATOM = range(4)
_VULGAR = {
    Fraction(1, 2): "½",
    Fraction(1, 3): "⅓",
    Fraction(2, 3): "⅔",
    Fraction(1, 4): "¼",
    Fraction(3, 4): "¾",
}
_RELATIONS = {"=": "=", "<": "<", "<=": "≤", ">": ">", ">=": "≥", "!=": "≠", "→": "→"}


class UnicodeWriter:
    """Writes trees for the terminal.

    Parameters
    ----------
    rates : mapping of str to (str, int)
        Which names are rates: ``d_x`` is ("x", 1).
    drives : mapping of str to str
        Functions shown with an argument they do not have in formulas: drives, with ``t``.
    arguments : mapping of str to tuple of str
        Names of the arguments of the system's functions, for partial derivatives.
    """

    plus: str = "+"
    minus: str = "−"
    gap: str = " "
    comma: str = ", "

    def __init__(
        self,
        rates: Mapping[str, tuple[str, int]],
        drives: Mapping[str, str],
        arguments: Mapping[str, tuple[str, ...]],
    ) -> None:
        self.rates = rates
        self.drives = drives
        self.arguments = arguments

    def __call__(self, node: Node, level: int = _SUM) -> str:
        """Text of a tree, in brackets if it binds less than `level`."""
        match node:
            case Number(value):
                text = self.number(value)
                own = _SUM if value < 0 else _ATOM if _is_digits(value) else _PRODUCT
            case Name(name):
                text = self.name(name)
                own = _ATOM
            case InWords(words):
                return self.words(words)
            case Call():
                return self.call(node)
            case Sum(terms):
                text = self.join(terms)
                own = _SUM
            case Term(factor, powers):
                text, own = self.product(factor, powers)
            case Relation(sign, left, right):
                return f"{self(left)} {self.relation(sign)} {self(right)}"
        return self.brackets(text) if own < level else text

    def words(self, text: str) -> str:
        """Text that is not a formula."""
        return text

    def join(self, terms: tuple[Node, ...]) -> str:
        """Terms with their signs."""
        text = ""
        for term in terms:
            negative = coefficient_and_rest(term)[0] < 0
            body = self(negate(term) if negative else term, _PRODUCT)
            sign = self.minus if negative else self.plus
            text += f" {sign} {body}" if text else f"{self.minus if negative else ''}{body}"
        return text

    def product(self, factor: Fraction, powers: Factors) -> tuple[str, int]:
        """Text and binding of a product; negative exponents become a fraction."""
        if factor < 0:
            return self.minus + self.product(-factor, powers)[0], _SUM
        above = tuple((b, e) for b, e in powers if not _negative(e))
        below = tuple((b, negate(e)) for b, e in powers if _negative(e))
        over, under = Fraction(factor.numerator), Fraction(factor.denominator)
        if _is_decimal(factor) and factor not in _VULGAR:
            over = factor
            under = Fraction(1)
        if below or (under != 1 and factor not in _VULGAR):
            return self.fraction(as_product(over, above), as_product(under, below)), _PRODUCT
        if factor == 1 and len(above) == 1:
            return self.power(*above[0])
        front = (
            []
            if factor == 1
            else [self.vulgar(factor) if factor in _VULGAR else self.number(factor)]
        )
        return self.gap.join([*front, *(self.power(*pair)[0] for pair in above)]), _PRODUCT

    def power(self, base: Node, exponent: Node) -> tuple[str, int]:
        if exponent == HALF:
            return self.root(base), _ATOM
        if exponent == UNITY:
            return self(base, _PRODUCT), _PRODUCT
        return self.raised(self(base, _ATOM), exponent), _POWER

    def call(self, node: Call) -> str:
        match node:
            case Call(name, (x,)) if name in STRUCTURES and STRUCTURES[name].fences[0]:
                return self.fenced(STRUCTURES[name], self(x))
            case Call(name, parts) if name == VECTOR:
                return self.brackets(self.comma.join(map(self, parts)))
            case Call(name, (x,)) if name == INVERSE:
                return self.raised(self(x, _ATOM), Number(Fraction(-1)))
            case Call("piecewise", arguments):
                pairs = list(zip(arguments[:-1:2], arguments[1:-1:2], strict=True))
                return self.cases(
                    [(self(value), self(condition)) for condition, value in pairs],
                    self(arguments[-1]),
                )
        arguments = [self(a) for a in node.arguments]
        if node.name in self.drives and not node.arguments:
            arguments = [self.name(self.drives[node.name])]
        return self.function(node, arguments)

    def function(self, node: Call, arguments: list[str]) -> str:
        inside = f"({self.comma.join(arguments)})" if arguments else ""
        if self.is_rate(node):
            return unicode_name(node.name, 1) + inside
        if node.by and set(node.by) == {"0"} and len(node.arguments) == 1:
            return self.name(node.name) + "′" * len(node.by) + inside
        names = [
            self.name(self.arguments[node.name][int(i)] if i.isdigit() else i) for i in node.by
        ]
        shown = STRUCTURES[node.name].shown if node.name in STRUCTURES else ""
        return "".join(f"∂_{name} " for name in names) + (shown or self.name(node.name)) + inside

    def is_rate(self, node: Call) -> bool:
        """Return whether it is the time derivative of a drive."""
        return node.by == ("t",) and node.name in self.drives

    # The differences between the alphabets.

    def name(self, name: str) -> str:
        if name == "speed":
            return "|u|"
        base, dots = self.rates.get(name, (name, 0))
        return unicode_name(base, dots)

    def number(self, value: Fraction) -> str:
        if not _is_decimal(value):
            return f"{value.numerator}/{value.denominator}".replace("-", "−")
        text = f"{float(value):.15g}"
        mantissa, _, exponent = text.partition("e")
        if exponent:
            digits = str(int(exponent)).translate(SUPERSCRIPTS)
            return (f"{mantissa}·" if mantissa != "1" else "").replace("-", "−") + f"10{digits}"
        return mantissa.replace("-", "−")

    def vulgar(self, value: Fraction) -> str:
        return _VULGAR[value]

    def relation(self, sign: str) -> str:
        return _RELATIONS[sign]

    def brackets(self, text: str) -> str:
        return f"({text})"

    def fenced(self, structure: Pieced, text: str) -> str:
        return text.join(structure.fences)

    def fraction(self, above: Node, below: Node) -> str:
        return f"{self(above, _PRODUCT)}/{self(below, _POWER)}"

    def root(self, base: Node) -> str:
        text = self(base, _ATOM)
        return f"√{text}"

    def raised(self, base: str, exponent: Node) -> str:
        if isinstance(exponent, Number) and exponent.value.denominator == 1:
            return base + str(exponent.value).translate(SUPERSCRIPTS)
        return f"{base}^{self(exponent, _ATOM)}"

    def cases(self, pairs: list[tuple[str, str]], otherwise: str) -> str:
        return (
            "{"
            + "; ".join(
                f"{value} if {condition}" for condition, value in [(c, v) for v, c in pairs]
            )
            + (f"; {otherwise} otherwise}}")
        )


class LatexWriter(UnicodeWriter):
    """Writes trees for LaTeX."""

    minus: str = "-"
    gap: str = r" \, "

    def name(self, name: str) -> str:
        if name == "speed":
            return "|u|"
        base, dots = self.rates.get(name, (name, 0))
        return latex_name(base, dots)

    def number(self, value: Fraction) -> str:
        if not _is_decimal(value):
            sign = "-" if value < 0 else ""
            return rf"{sign}\tfrac{{{abs(value.numerator)}}}{{{value.denominator}}}"
        mantissa, _, exponent = f"{float(value):.15g}".partition("e")
        if exponent:
            return (rf"{mantissa} \cdot " if mantissa != "1" else "") + f"10^{{{int(exponent)}}}"
        return mantissa

    def vulgar(self, value: Fraction) -> str:
        return rf"\tfrac{{{value.numerator}}}{{{value.denominator}}}"

    def relation(self, sign: str) -> str:
        return {"<=": r"\leq", ">=": r"\geq", "!=": r"\neq", "→": r"\to"}.get(sign, sign)

    def words(self, text: str) -> str:
        return rf"\text{{{text}}}"

    def brackets(self, text: str) -> str:
        tall = r"\frac" in text or r"\begin" in text
        return rf"\left({text}\right)" if tall else f"({text})"

    def fenced(self, structure: Pieced, text: str) -> str:
        return text.join(structure.latex_fences)

    def fraction(self, above: Node, below: Node) -> str:
        return rf"\frac{{{self(above)}}}{{{self(below)}}}"

    def root(self, base: Node) -> str:
        return rf"\sqrt{{{self(base)}}}"

    def raised(self, base: str, exponent: Node) -> str:
        return f"{base}^{{{self(exponent)}}}"

    def cases(self, pairs: list[tuple[str, str]], otherwise: str) -> str:
        rows = [rf"{value} & \text{{if }} {condition}" for value, condition in pairs]
        return (
            r"\begin{cases} "
            + r" \\ ".join([*rows, rf"{otherwise} & \text{{otherwise}}"])
            + r" \end{cases}"
        )

    def function(self, node: Call, arguments: list[str]) -> str:
        inside = self.brackets(self.comma.join(arguments)) if arguments else ""
        if node.name in FUNCTIONS:
            return FUNCTIONS[node.name].in_latex + inside
        if node.name in ("min", "max"):
            return rf"\{node.name}{inside}"
        if node.name in STRUCTURES:
            return rf"\operatorname{{{STRUCTURES[node.name].shown or node.name}}}{inside}"
        if self.is_rate(node):
            return latex_name(node.name, 1) + inside
        if node.by and set(node.by) == {"0"} and len(node.arguments) == 1:
            return self.name(node.name) + "'" * len(node.by) + inside
        names = [
            self.name(self.arguments[node.name][int(i)] if i.isdigit() else i) for i in node.by
        ]
        return "".join(rf"\partial_{{{name}}} " for name in names) + self.name(node.name) + inside


def _negative(exponent: Node) -> bool:
    return coefficient_and_rest(exponent)[0] < 0


def _is_digits(value: Fraction) -> bool:
    """Return whether it is written in digits, without a fraction and a power of ten."""
    return _is_decimal(value) and f"{float(value):.15g}".replace(".", "").isdecimal()


def _is_decimal(value: Fraction) -> bool:
    """Return whether it has a finite decimal expansion."""
    rest = value.denominator
    for prime in (2, 5):
        while rest % prime == 0:
            rest //= prime
    return rest == 1
