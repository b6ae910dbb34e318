"""Kinetic friction forces given by points of force against speed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stickslip.errors import DeclarationError
from stickslip.model.entries.samples import check_increasing
from stickslip.model.entries.tables import Table
from stickslip.symbolic.formulas import is_finite


def sliding_curves(values: Mapping[str, Any], points: Sequence[str], where: str) -> list[Table]:
    """The sliding force against the speed that points of a friction law give: one curve, or one for
    each way if some speeds are negative.

    Parameters
    ----------
    values : mapping
        Of the law, with lists of speeds and forces, and a ``kind`` and what is ``outside``.
    points : (str, str)
        What speeds and forces are called in them.
    where : str
        The key of the contact, for messages.

    Raises
    ------
    DeclarationError
    """
    v, F = (values[name] for name in points)
    for name, part in zip(points, (v, F), strict=True):
        if not isinstance(part, tuple):
            raise DeclarationError(
                f"{where}.{name}", "not a list", f"Write it like {name} = [0.0, 0.1, 1.0]"
            )
    for i, speed in enumerate(v):
        if not is_finite(speed):
            raise DeclarationError(f"{where}.{points[0]}[{i}]", "not a number", "Give numbers")
    if len(v) != len(F):
        reason = f"{len(v)} speeds and {len(F)} forces"
        raise DeclarationError(f"{where}.{points[1]}", reason, "Give as many speeds as forces")
    outside: Any = values.get("outside", ("constant", "refused"))
    kind: Any = values.get("kind", "linear")
    if v and min(v) >= 0.0:
        return [Table(v, F, kind, outside, where=where)]
    pairs = list(zip(map(float, v), F, strict=True))
    check_increasing(np.array([speed for speed, _ in pairs]), where, "speed")
    forward = [pair for pair in pairs if pair[0] > 0.0]
    back = [(-speed, _opposite(force)) for speed, force in reversed(pairs) if speed < 0.0]
    if len(forward) + len(back) < len(pairs):
        raise DeclarationError(
            f"{where}.{points[0]}",
            "with points for both directions, the force at speed 0 is static friction, F_s",
            "Remove that point, and give F_s",
        )
    for side, name in ((forward, "positive"), (back, "negative")):
        if len(side) < 2:
            raise DeclarationError(
                f"{where}.{points[0]}",
                f"there are fewer than two {name} speeds",
                "Give points for both directions",
            )
    return [
        Table([v for v, _ in side], [force for _, force in side], kind, outside, where=where)
        for side in (forward, back)
    ]


def _opposite(force: Any) -> Any:
    return f"-({force})" if isinstance(force, str) else -force
