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
from stickslip.symbolic.functions import FUNCTIONS
from stickslip.symbolic.pieces import STRUCTURES

MEANINGS = {
    "sqrt": "square root",
    "abs": "modulus",
    "clip": "x, but at least low and at most high",
    "min": "the least of its arguments",
    "max": "the largest of its arguments",
    "sign": "1 where x ≥ 0, −1 below; `sign(0)` typed as a number is 0",
    "heaviside": "1 where x ≥ 0, 0 below",
    "floor": "the largest whole number that is not above x",
    "mod": "what is left of x modulo m, with the sign of m",
    "square": "the sign of sin x",
    "triangle": "goes through 0, 1, 0, −1 where the sine does, on straight lines",
    "sawtooth": "rises from −1 to 1 over each period 2π, from 0 on",
    "smoothstep": "0 below low, 1 above high, smoothly in between",
}
_OF = {
    "": "",
    "component": "a part of the state, `amplitude:x`",
    "contact": "a contact, `stick_fraction:foot`",
    "quantity": "a variable, also a force, `harmonic:friction_foot`",
    "weight": "a formula of the parameters, `cost_of_transport:m*g`",
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
        for row in FUNCTIONS.values()
        if not row.typed
    ]
    pieces = []
    for name, row in STRUCTURES.items():
        arguments = ", ".join([*row.arguments, *["..."] * row.several])
        corner = "smooth where it is defined" if name in ("sqrt", "smoothstep") else "kinks"
        pieces.append(
            [markdown.code(f"{name}({arguments})"), MEANINGS.get(name, ""), "jumps" if row.jumps else corner]
        )
    elsewhere = [[markdown.code(a), markdown.code(b)] for a, b in formulas._ELSEWHERE.items()]
    return "\n".join(
        [
            "# Formulas\n",
            "A formula is a number, or a text of numbers, names, `pi`, `+ - * / **`, brackets and the functions "
            "below. It is read by a whitelist; nothing that is typed is ever run. Comparisons `<`, `<=`, `>`, `>=` "
            "stand in `piecewise(condition, value, ..., otherwise)` alone.\n",
            "## Smooth functions\n",
            markdown.table(["function", "derivative", "defined"], smooth),
            "## Functions with kinks and jumps\n",
            "Where one of them has a kink or jumps is an event of the motion, found to machine precision; at a jump a "
            "function has the value from above. A force that jumps against a rate is refused: that is dry friction, "
            "and a contact says it.\n",
            markdown.table(["function", "value", "corners"], pieces),
            "Further: `piecewise(x < 0, a, x < 1, b, c)`, one value after the other.\n",
            "## Functions of your own\n",
            'A system may declare functions of any number of arguments, `functions = {"mu(v)": "1/(1 + v)"}`; of '
            "those of one argument, and of drives, the derivative has a name, `d_mu(v)`.\n",
            "## What is written otherwise elsewhere\n",
            markdown.table(["elsewhere", "here"], elsewhere),
        ]
    )


def _interval(ends: tuple[float, float]) -> str:
    low, high = ("∞" if math.isinf(x) else f"{x:g}" for x in ends)
    return f"from {'−' if math.isinf(ends[0]) else ''}{low} to {high}"


def _laws() -> str:
    parts = [
        "# Friction laws\n",
        'Where a contact stands, a law may stand by its name: `ss.laws.stribeck("d_x", F_s=2.0, F_c=1.0, v_s=0.1)`, '
        'in a model file `contacts.foot = {law = "stribeck", direction = "d_x", F_s = 2.0, F_c = 1.0, v_s = 0.1}`. '
        "Parameters are numbers or formulas of the system's parameters. `stickslip law stribeck` shows the same as "
        "below. A law that is not here is [a formula of yours](../how-to/own-friction-law.md).\n",
    ]
    for name in laws.all_names():
        law = laws.by_name(name)
        picture = embedded(lambda law=law: plot_law(law))
        parts += [f"## {name}\n", markdown.html(law_page(law, picture))]
    return "\n".join(parts)


def _measures() -> str:
    told = inspect.getdoc(measures) or ""
    rows = [
        [
            markdown.code(name),
            _OF.get(row.of, row.of),
            "yes" if name in measures._OF_A_SPAN else "",
            "yes" if row.again else "",
        ]
        for name, row in measures.MEASURES.items()
    ]
    return "\n".join(
        [
            "# Measures\n",
            "What a [map](python/sweep.rst) may show of what a motion settles on, by name; formulas of names are "
            'measures, too, `"cost = energy_per_cycle/(F*speed)"`, and [functions of yours](../how-to/own-measure.md).\n',
            "\n\n".join(docstrings.markup(part) for part in told.split("\n\n")[1:]) + "\n",
            markdown.table(
                ["measure", "may be taken of", "also where nothing settles", "follows the period once more"],
                rows,
            ),
        ]
    )


def _outcomes() -> str:
    kinds: list[tuple[str, type[Ended], str]] = [
        ("Motions, and the points of maps", Outcome, "`trajectory.outcome`, `outcome` of a map"),
        ("Evolutions", EvolutionOutcome, "`history.outcome`"),
        ("Branches, maps, studies", Completion, "`branch.outcome`, `map.outcome`"),
    ]
    parts = [
        "# My motion stopped: every outcome, why, and what to do\n",
        "A computation ends in one of these ways, and says so: `trajectory.outcome.label` and `trajectory.message` in "
        "Python, `outcome` in `summary.json`, the line *outcome* on the command line. Whatever was computed before is "
        "kept, and obeys the law; but what has stopped early is not [certified](not-certified.md).\n",
    ]
    for title, kind, where in kinds:
        rows = [
            [f"**{o.label}**", "yes" if o.ok else "", o.message] for o in sorted(kind, key=lambda o: o.code)
        ]
        parts += [f"## {title}\n", where + "\n", markdown.table(["outcome", "good", "meaning and remedy"], rows)]
    parts.append(_MORE)
    return "\n".join(parts)


_MORE = """## Reading the numbers

* *no bounded rate* at the start: the load does not fit the state. `ss.equilibria(system)` says where the system can
  rest, `initial=` puts it there.
* *event accumulation* is not the bouncing ball: the end of its impacts is known in closed form and the contact closes.
  It is what remains, such as a threshold that falls to zero in a contact that chatters.
* *limit on events reached*: `ss.simulate(..., max_events=10**7)`. A motion of millions of switches is no harder than
  one of ten, but takes as much longer.
* *not settled* in a map is a verdict about waiting, not about the motion. `ss.Settings(max_time=..., max_cycles=...)`
  waits longer; a chaotic motion never settles, and its exponent stands in `lyapunov`.
"""
