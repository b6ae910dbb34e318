"""Results of any kind, described by their own metadata: the page does not depend on the kind."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.display.symbols import unicode_unit
from stickslip.explorer.asking.answer import Answer
from stickslip.orbits.continuation.branch import KNOT

if TYPE_CHECKING:
    from stickslip.results import Result


def verdict(result: Result) -> dict[str, Any]:
    """Verdict of a result, for the status line."""
    said = result.summary()
    certificate = result._said.certificate
    return {
        "part": "verdict",
        "title": said.title,
        "rows": [list(row) for row in said.rows],
        "good": said.good,
        "certified": bool(certificate.ok),
        "verdict": certificate.verdict,
        "outcome": result._said.outcome.label,
        "message": result._said.message,
        "residuals": [
            {
                "name": r.name,
                "value": r.value,
                "limit": r.limit if r.judged else None,
                "ok": r.ok,
                "note": r.note,
            }
            for r in certificate.residuals
        ],
    }


def curves_of(result: Result, name: str) -> Answer:
    """Every variable of a result that has one value at each of its points, with unit and meaning,
    over the first of them; special points, if it names some; and its verdict.

    Parameters
    ----------
    name : str
        What it is called on the page.
    """
    data, along = result._said.dataset, result.along
    curves = {
        str(key): variable
        for key, variable in data.variables.items()
        if variable.dims == (along,) and variable.dtype.kind in "fiub"
    }
    over = along if along in curves else next(iter(curves))
    said = verdict(result)
    head = {
        **{key: said[key] for key in ("certified", "verdict", "message")},
        "part": "curves",
        "name": name,
        "kind": result.KIND,
        "over": over,
        "variables": {
            key: {
                "unit": unicode_unit(str(curve.attrs.get("units", ""))),
                "meaning": str(curve.attrs.get("long_name", "")),
            }
            for key, curve in curves.items()
        },
        "special": [
            {key: point[key] for key in ("kind", "value", "index", "text")}
            for point in result._said.facts().get("special", ())
            if point["kind"] != KNOT
        ],
    }
    return Answer(head, {f"b:{key}": np.asarray(c.values, float) for key, c in curves.items()})
