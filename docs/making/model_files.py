"""Every key of model files, from the classes that are read from them."""

from __future__ import annotations

from dataclasses import MISSING, fields
from typing import Any

from making import docstrings, markdown
from stickslip.model import schema, system
from stickslip.model.entries.samples import Samples
from stickslip.model.entries.tables import Table
from stickslip.rate_independent.evolution.model import EvolutionModel
from stickslip.structures.structure import Structure

ENTRIES: dict[str, tuple[str, tuple[type, ...]]] = {
    "parameters.NAME": ("A number of the model.", (system.Parameter,)),
    "coordinates.NAME": (
        'A coordinate. Its `kind` is `"inertial"`, `"viscous"` or `"rate-independent"`.',
        (system.Inertial, system.Viscous, system.RateIndependent),
    ),
    "internal.NAME": ("A variable with a law of its own.", (system.Internal,)),
    "contacts.NAME": (
        "A contact. One with `gap` can open, one with `constraint` holds from both sides, one with "
        "`law` has a [friction law](laws.md) by its name and the parameters of that beside it; any "
        "other has a `threshold`.",
        (system.Contact, system.Unilateral, system.Bilateral, system.LawContact),
    ),
    "jumps.NAME": ("Where the state jumps, and to what.", (system.Jump,)),
    "outputs.NAME": (
        "A quantity that results show. A formula alone is one, too.",
        (system.Output,),
    ),
    "conditions.NAME": ("What the literature asks of the parameters.", (system.Condition,)),
}
_SAMPLES = {
    "file": "text file with columns; relative to the model file",
    "time": "name of the column of times (else `t` or `time`)",
    "value": "name of the column of values (else `value`, or the name of the drive)",
    "times": "the times themselves, in place of a file",
    "values": "the values themselves",
    "kind": '`"linear"`, `"cubic"` or `"hold"`: what is between the samples',
    "periodic": "`true` if they repeat",
    "unit": "unit of the values",
}
_TABLES = {
    "file": "text file with columns; relative to the model file",
    "of": "name of the column of points (else the first one); of a surface two names",
    "value": "name of the column of values (else that of the table, or `value`)",
    "points": "the points themselves, in place of a file; of a surface two lists",
    "values": "the values themselves: numbers, or formulas of parameters",
    "kind": '`"linear"`, `"pchip"` or `"cubic"`: what is between the points',
    "outside": '`"refused"`, `"constant"` or `"linear"`, or a pair of these for below and above',
    "unit": "unit of the values",
}
_STRUCTURES = {
    "mass": "file of the matrix, relative to the model file: `.mtx`, `.npz`, `.npy` or `.mat`; "
    "`beam.mat:M` is one of several arrays. **Has to be there.**",
    "stiffness": "the same of the stiffness. **Has to be there.**",
    "damping": "a file, `{ratios = [0.01]}` or `{alpha = 0.5, beta = 8e-5}`",
    "names": "a list of all names, or a table of some with their indices",
    "unit": "unit of displacements",
    "keep": "unknowns that a reduced structure keeps",
    "modes": "how many modes it has beside them",
    "method": '`"craig-bampton"` or `"modal"`',
    "packed": "all arrays as one text, as they are stored with results, in place of files",
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
    known = schema._EXPECTED.get(name)  # the words of the messages
    if known and not name.startswith("table"):
        return known[0]
    if annotation.startswith("Mapping["):
        return "a table, an entry each"
    return docstrings.markup(kind)


def _needed(item: Any, text: str) -> str:
    required = item.default is MISSING and item.default_factory is MISSING
    said = docstrings.markup(text) or ENTRIES.get(f"{item.name}.NAME", ("", ()))[0]
    return f"{said} **Has to be there.**" if required else said


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
