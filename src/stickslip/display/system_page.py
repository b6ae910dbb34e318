"""A system as a page of a notebook: its equations in MathML, and its declaration."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator
from typing import TYPE_CHECKING

from stickslip import page
from stickslip.display.equations import Equations
from stickslip.display.mathml import MathmlWriter, math
from stickslip.display.symbols import is_word, symbol_parts, unicode_symbol, unicode_unit
from stickslip.display.tree import NOUGHT, Name
from stickslip.model.entries.samples import Samples
from stickslip.model.entries.tables import Table
from stickslip.model.entries.units import with_unit
from stickslip.page import Html

if TYPE_CHECKING:
    from stickslip.model.laws import FrictionLaw
    from stickslip.model.system import System

_INDENT = "margin:0.3em 0 0.3em 1.5em;overflow-x:auto"


def system_page(system: System) -> str:
    """The declaration of a system and its equations."""
    shown = _Page(Equations(system))
    return page.whole(page.headline(system.title or system.name, system.source), *shown.sections())


def equations_page(system: System) -> str:
    """The equations of a system, without the tables of its declaration."""
    return page.whole(*_Page(Equations(system)).formulas())


def name_in_html(name: str) -> Html:
    """The symbol of a published quantity, with subscripts and superscripts; ``d_x`` is a rate."""
    rate = name.startswith("d_") and len(name) > 2
    if is_word(name[2:] if rate else name):
        return page.text(unicode_symbol(name))
    letter, accents, below, above = symbol_parts(name[2:] if rate else name)
    marks = "".join({"^": "\u0302", "~": "\u0303", "¯": "\u0304"}[a] for a in accents)
    main = page.text(unicodedata.normalize("NFC", letter + marks + ("\u0307" if rate else "")))
    sub = f"<sub>{page.text(','.join(below))}</sub>" if below else ""
    sup = f"<sup>{page.text(''.join(above))}</sup>" if above else ""
    return Html(f"<i>{main}</i>{sub}{sup}")


def law_page(law: FrictionLaw, picture: Html) -> str:
    """The page of a friction law: the figure of its loops, its equations for a mass, its
    parameters."""
    example = law.specimen()
    shown = _Page(Equations(example))
    rows = [
        (
            own,
            f"{p.default:g}",
            unicode_unit(p.unit),
            p.meaning,
            "yes" if own in law.options else "",
        )
        for own, p in law.known().items()
    ]
    return page.whole(
        page.headline(law.title, law.source),
        page.paragraph(law.about),
        picture,
        shown.balances(),
        shown.friction(),
        shown.definitions(),
        page.tabled(rows, ("parameter", "in the example", "unit", "meaning", "optional")),
    )


class _Page:
    def __init__(self, equations: Equations) -> None:
        self.equations = equations
        self.system = equations.system
        self.write = equations.writer(MathmlWriter)

    def sections(self) -> Iterator[str]:
        """All sections, in the order of the terminal output."""
        yield self.state()
        yield from self.formulas()
        yield self.outputs()
        yield self.parameters()
        yield self.start()
        yield self.conditions()
        yield self.facts()

    def formulas(self) -> Iterator[str]:
        """Energy, dissipation potential, and the equations derived from them."""
        for title, node in (
            ("Energy", self.equations.energy),
            ("Dissipation potential", self.equations.dissipation),
        ):
            if node != NOUGHT:
                yield _section(title, [self.write(node)])
        yield self.balances()
        yield self.friction()
        if self.system.impacts == "in turn":
            yield _section("Impacts", ["<mtext>sequentially</mtext>"])
        yield self.jumps()
        yield self.definitions()

    def symbol(self, name: str) -> Html:
        return Html(math(self.write(Name(name))))

    def state(self) -> str:
        rows = [
            (self.symbol(name), name, str(x.kind), unicode_unit(x.unit), x.meaning)
            for name, x in self.system.coordinates.items()
        ]
        rows += [
            (self.symbol(name), name, "internal", unicode_unit(a.unit), a.meaning)
            for name, a in self.system.internal.items()
        ]
        return page.tabled(rows, ("state", "name", "kind", "unit", "meaning"))

    def balances(self) -> str:
        lines = [
            self.write(b.left) + f"<mo>{b.sign}</mo>" + self.write(b.right)
            for b in [*self.equations.balances, *self.equations.laws]
        ]
        return _section("Equations of motion", lines)

    def friction(self) -> str:
        lines = []
        for group in self.equations.friction_groups():
            for f in group:
                named = f"<mtext>{page.text(f.contact)}:&#160;&#160;</mtext>"
                said = "<mtext>,&#160;&#160;</mtext>".join(map(self.write, f.named))
                lines.append(named + said)
            index = group[0].index if len(group) == 1 else "_i"
            for when, law in group[0].laws(self.write, index):
                lines.append(f"{when}<mtext>:&#160;&#160;</mtext>{law}")
        return _section("Friction", lines)

    def jumps(self) -> str:
        lines = []
        for jump in self.equations.jumps():
            where = f"<mtext>{page.text(jump.name)}: where&#160;</mtext>{self.write(jump.guard)}"
            where += f"<mtext>&#160;{jump.passes}:&#160;&#160;</mtext>"
            lines.append(where + jump.moves(self.write))
        return _section("Jumps", lines)

    def definitions(self) -> str:
        lines = [
            f"{self.write(left)}<mo>=</mo>{self.write(body)}"
            for left, body in self.equations.definitions()
        ]
        return _section("with", lines)

    def outputs(self) -> str:
        rows = [
            (self.symbol(name), Html(math(self.write(body))), unicode_unit(o.unit), o.meaning)
            for name, (_, body, o) in zip(
                self.system.outputs, self.equations.outputs(), strict=True
            )
        ]
        return page.tabled(rows, ("output", "formula", "unit", "meaning"))

    def parameters(self) -> str:
        rows = [
            (
                self.symbol(name),
                name,
                f"{p.default:g}",
                unicode_unit(p.unit),
                "" if p.range == "(-inf, inf)" else p.range.replace("inf", "∞"),
                p.meaning,
            )
            for name, p in self.system.parameters.items()
        ]
        headings = ("parameter", "name", "value", "unit", "admissible", "meaning")
        return page.tabled(rows, headings)

    def start(self) -> str:
        system = self.system
        given = [f"{unicode_symbol(name)} = {value:g}" for name, value in system.initial.items()]
        if len(given) < len(system.declaration.state):
            given.append("the others 0" if given else "all 0")
        unit = unicode_unit(system.time_unit)
        span = f"t from {system.span[0]:g} to {system.span[1]:g} {unit}".rstrip()
        return page.paragraph(f"Start: {', '.join(given)}; {span}")

    def conditions(self) -> str:
        rows = [
            (name, condition, verdict)
            for name, condition, verdict in self.equations.conditions(self.write)
        ]
        cells = [(name, Html(math(said)), verdict) for name, said, verdict in rows]
        return page.tabled(cells, ("condition", "", ""))

    def facts(self) -> str:
        rows = [
            (name.replace("_", " "), Html(math(self.write(formula))), f"{value:.6g}")
            for name, formula, value in self.equations.facts()
        ]
        return page.tabled(rows, ("fact", "", "value"))


def _section(title: str, lines: list[str]) -> Html:
    """A section of formulas, one per line."""
    shown = "".join(f'<div style="{_INDENT}">{math(line)}</div>' for line in lines)
    return Html(f"<p>{page.text(title)}</p>{shown}" if lines else "")


def table_page(table: Table, picture: str) -> str:
    """The page of a table: number of points, interpolation and extrapolation, figure."""
    source = table.source
    axes = [f"{len(a):,}, {a[0]:.9g} to {a[-1]:.9g}" for a in table.axes]
    rows = [
        *(("points", text) for text in axes),
        ("between them", table.kind),
        ("outside", " and ".join(dict.fromkeys(table.outside))),
    ]
    if table.unit:
        rows.append(("unit of the values", table.unit))
    if table.formulas:
        rows.append(("values that are formulas", ", ".join(table.formulas.values())))
    if source:
        of = source["of"] if isinstance(source["of"], str) else " and ".join(source["of"])
        rows.append(("file", f"{source['file']}, {source['value']} over {of}"))
    return page.whole(page.headline("Table"), Html(picture), page.tabled(rows))


def samples_page(samples: Samples, picture: Html) -> str:
    """The page of samples: number, time span, figure."""
    low, high = float(samples.values.min()), float(samples.values.max())
    source = samples.source
    rows = [
        ("samples", f"{len(samples.times):,}"),
        ("time", f"{samples.span[0]:.9g} to {samples.span[1]:.9g}"),
        ("values", f"{low:.6g} to {with_unit(high, samples.unit, 6)}"),
        ("between them", samples.kind),
        ("period", f"{samples.period:.9g}" if samples.periodic else "none"),
    ]
    if source:
        rows.append(("file", f"{source['file']}, columns {source['time']} and {source['value']}"))
    return page.whole(page.headline("Samples"), picture, page.tabled(rows))
