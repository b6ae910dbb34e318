"""Every key of model files, from the classes that are read from them."""

from __future__ import annotations

from dataclasses import MISSING, fields
from typing import Any

from making import docstrings, markdown
from stickslip.model import system
from stickslip.model.entries.samples import Samples
from stickslip.model.entries.tables import Table
from stickslip.model.formats.expected import EXPECTED
from stickslip.rate_independent.evolution.model import EvolutionModel
from stickslip.structures.structure import Structure

ENTRIES: dict[str, tuple[str, tuple[type, ...]]] = {
    "parameters.NAME": ("A number of the model.", (system.Parameter,)),
    "coordinates.NAME": (
        'A coordinate. Its `kind` is `"inertial"`, `"viscous"` or `"rate-independent"`.',
        (system.Inertial, system.Viscous, system.RateIndependent),
    ),
    "internal.NAME": ("A state variable with an evolution equation.", (system.Internal,)),
    "contacts.NAME": (
        "A contact. With `gap` it can open; with `constraint` it is bilateral; with `law` it has a "
        "named [friction law](laws.md) and the parameters of that law; any other has a "
        "`threshold`.",
        (system.Contact, system.Unilateral, system.Bilateral, system.LawContact),
    ),
    "jumps.NAME": ("A jump of the state: its guard and the new values.", (system.Jump,)),
    "outputs.NAME": (
        "A quantity that results contain. A formula alone is allowed, too.",
        (system.Output,),
    ),
    "conditions.NAME": ("A condition on the parameters from the literature.", (system.Condition,)),
}
_SAMPLES = {
    "file": "text file with columns; relative to the model file",
    "time": "name of the column of times (by default `t` or `time`)",
    "value": "name of the column of values (by default `value`, or the name of the drive)",
    "times": "the times, instead of a file",
    "values": "the values, instead of a file",
    "kind": '`"linear"`, `"cubic"` or `"hold"`: interpolation between the samples',
    "periodic": "`true` if the samples repeat",
    "gaps": "`true` to interpolate missing samples of a file",
    "unit": "unit of the values",
}
_TABLES = {
    "file": "text file with columns; relative to the model file",
    "of": "name of the column of points (by default the first one); for a surface two names",
    "value": "name of the column of values (by default the name of the table, or `value`)",
    "points": "the points, instead of a file; for a surface two lists",
    "values": "the values: numbers, or formulas of parameters",
    "kind": '`"linear"`, `"pchip"` or `"cubic"`: interpolation between the points',
    "outside": '`"refused"`, `"constant"` or `"linear"`, or a pair of these (low, high)',
    "unit": "unit of the values",
}
_STRUCTURES = {
    "mass": "file of the matrix, relative to the model file: `.mtx`, `.npz`, `.npy` or `.mat`; "
    "`beam.mat:M` is one of several arrays. **Required.**",
    "stiffness": "the same for the stiffness. **Required.**",
    "damping": "a file, `{ratios = [0.01]}` or `{alpha = 0.5, beta = 8e-5}`",
    "names": "a list of all names, or a table of some with their indices",
    "unit": "unit of displacements",
    "keep": "degrees of freedom that a reduced structure keeps",
    "modes": "number of modes in addition to these",
    "method": '`"craig-bampton"` or `"modal"`',
    "packed": "all arrays as one string, as stored with results, instead of files",
}


def keys(cls: Any) -> list[list[str]]:
    """Rows: key, what it holds, what it is."""
    told = docstrings.described(cls)
    rows = []
    for item in fields(cls):
        kind, text = told.get(item.name, ("", ""))
        rows.append([markdown.code(item.name), _held(str(item.type), kind), _needed(item, text)])
    return rows


def _held(annotation: str, kind: str) -> str:
    name = annotation.removesuffix(" | None")
    known = EXPECTED.get(name)  # the words of the messages
    if known and not name.startswith("table"):
        return known[0]
    if annotation.startswith("Mapping["):
        return "a table with one entry for each"
    return docstrings.markup(kind)


def _needed(item: Any, text: str) -> str:
    required = item.default is MISSING and item.default_factory is MISSING
    said = docstrings.markup(text) or ENTRIES.get(f"{item.name}.NAME", ("", ()))[0]
    return f"{said} **Required.**" if required else said


def pages() -> dict[str, str]:
    """One page."""
    head = ["key", "holds", "meaning"]
    parts = []
    for key, (about, classes) in ENTRIES.items():
        parts += [f"## {key}\n", about + "\n"]
        for cls in classes:
            if len(classes) > 1:
                parts.append(f"### {cls.__name__}\n\n{docstrings.first_sentence(cls)}\n")
            parts.append(markdown.table(head, keys(cls)))
    structures = [[markdown.code(key), text] for key, text in _STRUCTURES.items()]
    samples = [[markdown.code(key), text] for key, text in _SAMPLES.items()]
    tables = [[markdown.code(key), text] for key, text in _TABLES.items()]
    page = markdown.filled(
        "model-files",
        system=markdown.table(head, keys(system.System)),
        entries="\n".join(parts),
        samples_are=docstrings.first_sentence(Samples),
        tables_are=docstrings.first_sentence(Table),
        tables=markdown.table(["key", "meaning"], tables),
        structures_are=docstrings.first_sentence(Structure),
        structures=markdown.table(["key", "meaning"], structures),
        samples=markdown.table(["key", "meaning"], samples),
        evolution=markdown.table(head, keys(EvolutionModel)),
    )
    return {"reference/model-files.md": page}
