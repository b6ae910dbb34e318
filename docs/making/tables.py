"""What formulas may hold, which friction laws have names, which measures, and how computations
end."""

from __future__ import annotations

import inspect
import math

from making import docstrings, markdown
from stickslip.display.system_page import law_page
from stickslip.figures.drawing.notebook import embedded
from stickslip.figures.law import plot_law
from stickslip.model import laws
from stickslip.motion.outcome import Outcome
from stickslip.rate_independent.evolution.outcome import EvolutionOutcome
from stickslip.results import Completion, Ended
from stickslip.sweeps.request import measures
from stickslip.symbolic import formulas
from stickslip.symbolic.functions import FUNCTIONS, language
from stickslip.symbolic.pieces import STRUCTURES

MEANINGS = {
    "sqrt": "square root",
    "abs": "modulus",
    "clip": "x, limited to the interval from low to high",
    "min": "the smallest of its arguments",
    "max": "the largest of its arguments",
    "sign": "1 for x ≥ 0, −1 for x < 0; `sign(0)` with the number 0 is 0",
    "heaviside": "1 for x ≥ 0, 0 for x < 0",
    "floor": "the largest integer not above x",
    "mod": "the remainder of x modulo m, with the sign of m",
    "square": "the sign of sin x",
    "triangle": "piecewise linear, with the values of the sine at its zeros and extrema",
    "sawtooth": "increases from −1 to 1 in each period 2π, beginning at 0",
    "smoothstep": "0 below low, 1 above high, smoothly in between",
}
_OF = {
    "": "",
    "component": "a component of the state, `{name}:x`",
    "contact": "a contact, `{name}:foot`",
    "force": "a contact, `{name}:foot`; in a plane one component, `{name}:table 1`",
    "quantity": "a variable, including a force, `{name}:friction_foot`",
    "weight": "a formula of the parameters, `{name}:m*g`",
}


def pages() -> dict[str, str]:
    """Four pages."""
    return {
        "reference/formulas.md": _formulas(),
        "reference/laws.md": _laws(),
        "reference/measures.md": _measures(),
        "how-to/outcomes.md": _outcomes(),
    }


def _formulas() -> str:
    smooth = [
        [
            markdown.code(f"{row.name}(x)"),
            markdown.code(row.shown or row.derivative) if row.derivative else "",
            "everywhere" if row.domain == (-math.inf, math.inf) else _interval(row.domain),
        ]
        for row in map(FUNCTIONS.__getitem__, language())
    ]
    pieces = []
    for name, row in STRUCTURES.items():
        arguments = ", ".join([*row.arguments, *["..."] * row.several])
        corner = "smooth where it is defined" if name in ("sqrt", "smoothstep") else "kinks"
        pieces.append(
            [
                markdown.code(f"{name}({arguments})"),
                MEANINGS.get(name, ""),
                "jumps" if row.jumps else corner,
            ]
        )
    elsewhere = [[markdown.code(a), markdown.code(b)] for a, b in formulas._ELSEWHERE.items()]
    return markdown.filled(
        "formulas",
        smooth=markdown.table(["function", "derivative", "defined"], smooth),
        pieces=markdown.table(["function", "value", "corners"], pieces),
        elsewhere=markdown.table(["elsewhere", "here"], elsewhere),
    )


def _interval(ends: tuple[float, float]) -> str:
    low, high = ("∞" if math.isinf(x) else f"{x:g}" for x in ends)
    return f"from {'−' if math.isinf(ends[0]) else ''}{low} to {high}"


def _laws() -> str:
    parts = []
    for name in laws.all_names():
        law = laws.by_name(name)
        picture = embedded(lambda law=law: plot_law(law))
        parts += [f"## {name}\n", markdown.html(law_page(law, picture))]
    return markdown.filled("laws", laws="\n".join(parts))


def _measures() -> str:
    told = inspect.getdoc(measures) or ""
    rows = [
        [
            markdown.code(name),
            row.said.said or row.said.meaning,
            _OF.get(row.said.of, row.said.of).format(name=name),
            "yes" if row.said.of_a_span else "",
            "yes" if row.again else "",
        ]
        for name, row in measures.MEASURES.items()
    ]
    head = [
        "measure",
        "meaning",
        "argument",
        "even if the drive ends",
        "computes the period again",
    ]
    return markdown.filled(
        "measures",
        told="\n\n".join(docstrings.markup(part) for part in told.split("\n\n")[1:]),
        measures=markdown.table(head, rows),
    )


def _outcomes() -> str:
    kinds: list[tuple[str, type[Ended], str]] = [
        ("Motions, and the points of maps", Outcome, "`trajectory.outcome`, `outcome` of a map"),
        ("Evolutions", EvolutionOutcome, "`history.outcome`"),
        ("Branches, maps, studies", Completion, "`branch.outcome`, `map.outcome`"),
    ]
    parts = []
    for title, kind, where in kinds:
        rows = [
            [f"**{o.label}**", "yes" if o.ok else "", o.message]
            for o in sorted(kind, key=lambda o: o.code)
        ]
        parts += [
            f"## {title}\n",
            where + "\n",
            markdown.table(["outcome", "ok", "meaning and remedy"], rows),
        ]
    return markdown.filled("outcomes", outcomes="\n".join(parts))
