"""The public names of the library: a page each."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import stickslip as ss
from making import docstrings, markdown, sessions

ROOT = Path(__file__).parents[2]
FOLDER = "reference/python"
GROUPS: Mapping[str, str] = {
    "Declare a system": "System Parameter Inertial Viscous RateIndependent Internal Sampled "
    "Contact Unilateral Bilateral Structure ModalDamping ProportionalDamping Jump Output Condition "
    "Samples noise Table load laws catalogue",
    "Motions": "simulate simulate_many Stepper StepperState Trajectory Ensemble EventCatalogue "
    "Outcome vector_field "
    "VectorField",
    "Rest, cycles, branches": "equilibria Equilibria Equilibrium EquilibriumSet find_cycle Cycle "
    "continue_equilibrium continue_cycle Branch SpecialPoint StepControl hopf_curve fold_curve "
    "stick_onset_curve frequency_response FrequencyResponse "
    "ring_down RingDown backbone Backbone",
    "Gaits": "gait_study GaitStudy walking_threshold sliding_threshold HysteresisOperator",
    "Maps": "sweep Map basin Basin Records Fragility Settings Adaptive",
    "Data": "fit Fit fit_law LawFit fit_problem FitProblem Recording compare Comparison Band",
    "Rate-independent evolutions": "Evolution EvolutionModel load_evolution evolve History "
    "averaging_study AveragingStudy play Play prandtl_ishlinskii Dissipation WeightedL1 GroupNorm "
    "Ellipsoid Polytope SupportFormula SupportFunction Product Intersection",
    "Files, errors, figures": "open export StickslipError DeclarationError ConvergenceError "
    "figures style explore",
}
"""What belongs together; a name that is not listed here has a page as well."""
# Parts of results.
OTHERS = {
    "Certificate": "stickslip.certificates",
    "Residual": "stickslip.certificates",
    "Summary": "stickslip.results",
    "FrictionLaw": "stickslip.model.laws",
    "LawContact": "stickslip.model.system",
}
# Where they are seen in a session.
_MEMBERS = {
    "Certificate": r"\.certificate\b",
    "Residual": r"\.certificate\[",
    "Summary": r"\.summary\(",
    "FrictionLaw": r"ss\.laws\.by_name",
    "LawContact": r"ss\.laws\.\w+\(\"",
}
_PAGES = (
    "by-example",
    "tutorials/gaits",
    "extending",
    "how-to/data",
    "how-to/controllers",
    "how-to/fmi",
    "tutorials/controllers",
)


def groups() -> dict[str, list[str]]:
    """The public names in their groups, each in one."""
    public = {name for name in ss.__all__ if not name.startswith("__")}
    found = {title: names.split() for title, names in GROUPS.items()}
    placed = {name for names in found.values() for name in names}
    rest = sorted(public - placed)
    found = {title: [n for n in names if n in public] for title, names in found.items()}
    return found | ({"More": rest} if rest else {}) | {"Parts of results": list(OTHERS)}


def thing(name: str) -> Any:
    """What a name of the reference stands for."""
    if name in OTHERS:
        return getattr(__import__(OTHERS[name], fromlist=[name]), name)
    return getattr(ss, name)


def pages() -> dict[str, str]:
    """The page of each name, and the list of all."""
    made = {f"{FOLDER}/{name}.rst": _page(name) for names in groups().values() for name in names}
    parts = []
    for title, names in groups().items():
        rows = [[f"[`{n}`](python/{n}.rst)", docstrings.first_sentence(thing(n))] for n in names]
        parts += [f"## {title}\n", markdown.table(["name", "what it is"], rows)]
    names = [f"{n} <python/{n}>" for group in groups().values() for n in group]
    parts.append(markdown.toctree(names))
    return made | {f"{FOLDER}.md": markdown.filled("python", names="\n".join(parts))}


def _page(name: str) -> str:
    """reStructuredText, which docstrings are written in."""
    value = thing(name)
    home = OTHERS.get(name, "stickslip")
    full = f"{home}.{name}"
    title = full if home == "stickslip" else name
    lines = [title, "=" * len(title), ""]
    if inspect.ismodule(value):
        lines += _of_module(name, value)
    elif inspect.isclass(value):
        lines += [
            f".. autoclass:: {full}",
            "   :members:",
            "   :inherited-members: Exception, Enum",
        ]
    else:
        lines += [f".. autofunction:: {full}"]
    lines += ["", *_example(name)]
    return "\n".join(lines)


def _of_module(name: str, module: Any) -> list[str]:
    lines = [f".. automodule:: {module.__name__}", ""]
    if name == "catalogue":
        lines += ["Each system has a page in the :doc:`gallery </gallery/index>`.", ""]
    if name == "laws":
        lines += ["The page :doc:`Friction laws </reference/laws>` shows each law.", ""]
    for inner in getattr(module, "__all__", sorted(vars(module))):
        part = getattr(module, inner)
        ours = inspect.isfunction(part) and part.__module__.startswith("stickslip")
        if ours and not inner.startswith("_") and part.__doc__:
            if name in ("catalogue", "laws") and part.__module__ != module.__name__:
                continue
            lines += [f".. autofunction:: {part.__module__}.{inner}", ""]
    return lines


def _example(name: str) -> list[str]:
    """The first block of a page in which a name occurs, with all that it needs."""
    for page in _PAGES:
        session = sessions.of_page(ROOT / "docs" / f"{page}.md")
        wanted = _MEMBERS.get(name, rf"\bss\.{name}\b")
        block = next((b for b in session.blocks if re.search(wanted, b.source)), None)
        if block is not None:
            code = [f"   {line}".rstrip() for line in session.alone(block).splitlines()]
            where = f"From the page :doc:`/{page}`, with the statements that it needs:"
            head = [".. rubric:: Example", "", where, ""]
            return [*head, ".. code-block:: pycon", "", *code, ""]
    return []
