"""Trees of :mod:`stickslip.display.tree` as MathML, which browsers show without any script."""

from __future__ import annotations

from fractions import Fraction
from html import escape

from stickslip.display.printers import UnicodeWriter
from stickslip.display.symbols import is_word, symbol_parts
from stickslip.display.tree import Call, Node
from stickslip.symbolic.pieces import STRUCTURES, Pieced


def math(content: str) -> str:
    """A displayed formula."""
    return f'<math displaystyle="true">{content}</math>'


def row(*content: str) -> str:
    """Parts that are one."""
    return f"<mrow>{''.join(content)}</mrow>"


class MathmlWriter(UnicodeWriter):
    """Writes trees for a web page."""

    plus: str = "<mo>+</mo>"
    minus: str = "<mo>−</mo>"
    gap: str = '<mspace width="0.2em"></mspace>'
    comma: str = "<mo>,</mo>"

    def words(self, text: str) -> str:
        return f"<mtext>{escape(text)}</mtext>"

    def relation(self, sign: str) -> str:
        return f"<mo>{escape(super().relation(sign))}</mo>"

    def name(self, name: str) -> str:
        if name == "speed":
            return row("<mo>|</mo>", "<mi>u</mi>", "<mo>|</mo>")
        base, dots = self.rates.get(name, (name, 0))
        return symbol_of(base, dots)

    def number(self, value: Fraction) -> str:
        sign, size = ("<mo>−</mo>" if value < 0 else ""), abs(value)
        text = super().number(size)
        if "/" in text:
            return row(sign, _fraction(*(f"<mn>{part}</mn>" for part in text.split("/"))))
        mantissa, _, exponent = f"{float(size):.15g}".partition("e")
        if not exponent:
            return sign + f"<mn>{mantissa}</mn>"
        power = f"<msup><mn>10</mn><mn>{int(exponent)}</mn></msup>".replace("-", "−")
        front = f"<mn>{mantissa}</mn><mo>·</mo>" if mantissa != "1" else ""
        return row(sign, front, power)

    def vulgar(self, value: Fraction) -> str:
        return _fraction(f"<mn>{value.numerator}</mn>", f"<mn>{value.denominator}</mn>")

    def brackets(self, text: str) -> str:
        return row("<mo>(</mo>", text, "<mo>)</mo>")

    def fenced(self, structure: Pieced, text: str) -> str:
        left, right = (f"<mo>{escape(fence)}</mo>" for fence in structure.fences)
        return row(left, text, right)

    def fraction(self, above: Node, below: Node) -> str:
        return _fraction(self(above), self(below))

    def root(self, base: Node) -> str:
        return f"<msqrt>{self(base)}</msqrt>"

    def raised(self, base: str, exponent: Node) -> str:
        return f"<msup>{row(base)}{row(self(exponent))}</msup>"

    def cases(self, pairs: list[tuple[str, str]], otherwise: str) -> str:
        rows = [(value, f"<mtext>if&#160;</mtext>{when}") for value, when in pairs]
        rows.append((otherwise, "<mtext>otherwise</mtext>"))
        cells = "".join(
            f"<mtr><mtd>{row(value)}</mtd><mtd>{row(when)}</mtd></mtr>" for value, when in rows
        )
        return row("<mo>{</mo>", f'<mtable columnalign="left">{cells}</mtable>')

    def function(self, node: Call, arguments: list[str]) -> str:
        inside = self.brackets(self.comma.join(arguments)) if arguments else ""
        if self.is_rate(node):
            return row(symbol_of(node.name, 1), inside)
        if node.by and set(node.by) == {"0"} and len(node.arguments) == 1:
            primes = f"<mo>{'′' * len(node.by)}</mo>"
            return row(f"<msup>{self.name(node.name)}{primes}</msup>", inside)
        names = [
            self.name(self.arguments[node.name][int(i)] if i.isdigit() else i) for i in node.by
        ]
        slopes = "".join(f"<msub><mo>∂</mo>{row(name)}</msub>" for name in names)
        shown = STRUCTURES[node.name].shown if node.name in STRUCTURES else ""
        own = f"<mi>{escape(shown)}</mi>" if shown else self.name(node.name)
        return row(slopes, own, inside)


def symbol_of(name: str, dots: int = 0) -> str:
    """The name as a symbol, with one or two dots for rates."""
    if is_word(name):
        return _accented(f'<mi mathvariant="normal">{escape(name)}</mi>', "˙" * dots)
    letter, accents, below, above = symbol_parts(name)
    text = f"<mi>{letter}</mi>"
    for accent in (*accents, ("", "˙", "¨")[dots]):
        text = _accented(text, accent)
    low = "".join(f"<mi>{part}</mi>" for part in below)
    high = "".join(f"<mo>{part}</mo>" for part in above)
    if low and high:
        return f"<msubsup>{text}{row(low)}{row(high)}</msubsup>"
    if low:
        return f"<msub>{text}{row(low)}</msub>"
    return f"<msup>{text}{row(high)}</msup>" if high else text


def _accented(text: str, accent: str) -> str:
    return f'<mover accent="true">{text}<mo>{accent}</mo></mover>' if accent else text


def _fraction(above: str, below: str) -> str:
    return f"<mfrac>{row(above)}{row(below)}</mfrac>"
