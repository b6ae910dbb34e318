"""The sections of a system as text for the terminal."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

from stickslip.display.printers import UnicodeWriter
from stickslip.display.symbols import is_word, unicode_unit, width
from stickslip.display.terminal import text_table, wrap
from stickslip.display.tree import (
    NOUGHT,
    Call,
    Name,
    Node,
    Number,
    Sum,
    Term,
    sum_of,
    times,
)

if TYPE_CHECKING:
    from stickslip.display.equations import Equations


class EquationsText:
    """Format the sections of one system for the terminal."""

    def __init__(self, equations: Equations, write: UnicodeWriter) -> None:
        self.equations = equations
        self.system = equations.system
        self.write = write

    def openings(self) -> list[str]:
        """0 ≤ N ⟂ g ≥ 0 for each of them."""
        pairs = self.equations.openings()
        lines = [f"0 ≤ {self.write(force)} ⟂ {self.write(gap)} ≥ 0" for force, gap in pairs]
        lines += [f"{when}:  {law}" for when, law in self.equations.adhesions(self.write)]
        in_turn = ["impacts sequentially"] if self.system.impacts == "in turn" else []
        return lines + in_turn

    def lines(self) -> list[str]:
        system = self.system
        head = [system.title or system.name, system.source]
        sections = [
            ("", [line for line in head if line]),
            ("State", self.state()),
            ("Energy", self.formula(self.equations.energy)),
            ("Dissipation potential", self.formula(self.equations.dissipation)),
            ("Equations of motion", self.motion()),
            ("Friction", self.friction()),
            ("Unilateral contacts", self.openings()),
            ("Constraints", [self.write(r) for r in self.equations.constraints()]),
            ("Jumps", self.jumps()),
            ("with", self.definitions()),
            ("Outputs", self.outputs()),
            ("Parameters", self.parameters()),
            ("Start", self.start()),
            ("Translation invariance", self.translation()),
            ("Conditions", self.conditions()),
            ("Facts", self.facts()),
        ]
        text: list[str] = []
        for title, content in sections:
            if content:
                indent = "  " if title else ""
                text += (
                    ([""] if text else [])
                    + ([title] if title else [])
                    + [indent + line for line in content]
                )
        return text

    def formula(self, node: Node) -> list[str]:
        return [] if node == NOUGHT else wrap(self.write(node))

    def state(self) -> list[str]:
        rows = []
        for name, x in self.system.coordinates.items():
            rows.append([self.write(Name(name)), x.kind, unicode_unit(x.unit), x.meaning])
        for name, a in self.system.internal.items():
            rows.append([self.write(Name(name)), "internal", unicode_unit(a.unit), a.meaning])
        return text_table(rows)

    def motion(self) -> list[str]:
        lines = []
        for b in [*self.equations.balances, *self.equations.laws]:
            lines += wrap(f"{self.write(b.left)} {b.sign} {self.write(b.right)}")
        return lines

    def friction(self) -> list[str]:
        lines = []
        for group in self.equations.friction_groups():
            lines += text_table(
                [[f"{f.contact}:", ",  ".join(map(self.write, f.named))] for f in group]
            )
            for when, law in group[0].laws(self.write, group[0].index if len(group) == 1 else "_i"):
                lines += ["  " + line for line in wrap(f"{when}:  {law}")]
        return lines

    def jumps(self) -> list[str]:
        lines = []
        for jump in self.equations.jumps():
            lines += wrap(f"{jump.name}: where {self.write(jump.guard)} {jump.passes}")
            lines += ["  " + line for line in wrap(jump.moves(self.write), breaks=(", ",))]
        return lines

    def definitions(self) -> list[str]:
        lines = []
        for left, body in self.equations.definitions():
            match body:
                case Call("piecewise", arguments):
                    lines += self.cases(self.write(left), arguments)
                case _:
                    lines += wrap(f"{self.write(left)} = {self.write(body)}")
        if any(is_inclusion(b.left) for b in self.equations.balances):
            lines.append("Sign(v) = v/|v| for v ≠ 0,  Sign(0) = [−1, 1]")
        return lines

    def outputs(self) -> list[str]:
        rows = [
            [f"{self.write(left)} = {self.write(body)}", unicode_unit(output.unit), output.meaning]
            for left, body, output in self.equations.outputs()
        ]
        return text_table(rows)

    def cases(self, left: str, arguments: tuple[Node, ...]) -> list[str]:
        """A piecewise function with a brace over several lines."""
        pairs = [
            (self.write(v), f"if {self.write(c)}")
            for c, v in zip(arguments[:-1:2], arguments[1::2], strict=True)
        ]
        pairs.append((self.write(arguments[-1]), "otherwise"))
        rows = text_table([list(pair) for pair in pairs])
        braces = ["⎧", *["⎪"] * (len(rows) - 2), "⎩"]
        middle = len(rows) // 2
        if len(rows) > 2:
            braces[middle] = "⎨"
        start = f"{left} = "
        blank = " " * width(start)
        return [
            (start if i == middle else blank) + f"{braces[i]} {row}" for i, row in enumerate(rows)
        ]

    def parameters(self) -> list[str]:
        rows = []
        for name, p in self.system.parameters.items():
            bounds = (
                ""
                if p.range == "(-inf, inf)"
                else "in " + p.range.replace("inf", "∞").replace("-", "−")
            )
            symbol = self.write(Name(name))
            plain = name if name != symbol else ""
            rows.append([symbol, plain, f"{p.default:g}", unicode_unit(p.unit), bounds, p.meaning])
        return text_table(rows)

    def start(self) -> list[str]:
        system = self.system
        given = [
            f"{self.write(Name(name))} = {value:g}".replace("-", "−")
            for name, value in system.initial.items()
        ]
        rest = len(given) < len(system.declaration.state)
        unit = unicode_unit(system.time_unit)
        t = f"t from {system.span[0]:g} to {system.span[1]:g} {unit}".rstrip()
        others = ["all 0" if not given else "the others 0"] if rest else []
        return wrap(f"{', '.join(given + others)};  {t}", breaks=(", ",))

    def translation(self) -> list[str]:
        taken = {*self.system.parameters, *self.system.functions, *self.system.drives}
        shift = Name(
            next(letter for letter in ("s", "h", "r", "tau", "shift") if letter not in taken)
        )
        moved = [
            f"{self.write(Name(x))} → "
            f"{self.write(sum_of(Name(x), times(Number(Fraction(repr(float(w)))), shift)))}"
            for x, w in self.system.translation.items()
        ]
        return wrap(",  ".join(moved), breaks=(", ",)) if moved else []

    def conditions(self) -> list[str]:
        return text_table([[*row] for row in self.equations.conditions(self.write)])

    def facts(self) -> list[str]:
        lines = []
        for name, read, value in self.equations.facts():
            symbol = self.write(Name(name))
            formula = self.write(read)
            shown = f"{value:.6g}".replace("-", "−").replace("nan", "undefined")
            left = name.replace("_", " ") if is_word(name) else symbol
            lines += wrap(
                " = ".join([left, *([formula] if formula not in (symbol, shown) else []), shown])
            )
        return lines


def is_inclusion(node: Node) -> bool:
    """Return whether an equation is an inclusion: a part of it is set-valued."""
    match node:
        case Call("Sign"):
            return True
        case Sum(terms):
            return any(map(is_inclusion, terms))
        case Term(_, powers):
            return any(is_inclusion(base) for base, _ in powers)
    return False
