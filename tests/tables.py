"""Random tables, and the same curves typed out as formulas."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

import stickslip as ss
from stickslip.arrays import Array


def pieces_of(points: Array, values: Array, kind: str) -> Array:
    """Coefficients of a curve as SciPy has them, highest power first, shape (powers, pieces)."""
    if kind == "linear":
        return np.stack([np.diff(values) / np.diff(points), values[:-1]])
    return (PchipInterpolator if kind == "pchip" else CubicSpline)(points, values).c


def typed(table: ss.Table, name: str = "s") -> str:
    """The formula of a curve, with its ends continued as they are."""
    (points,) = table.axes
    c = pieces_of(points, table.values, table.kind)
    parts = [
        " + ".join(f"({a!r})*({name} - ({x!r}))**{k}" for k, a in enumerate(own[::-1].tolist()))
        for own, x in zip(c.T, points.tolist(), strict=False)
    ]
    conditions = [
        f"{name} < ({x!r}), {p}" for x, p in zip(points[1:-1].tolist(), parts, strict=False)
    ]
    return f"piecewise({', '.join(conditions)}, {parts[-1]})" if conditions else parts[0]


def spring(formula: Any, force: Any = 0.0, mu: float = 0.02, **parts: Any) -> ss.System:
    """A block on a rough floor in a potential."""
    return ss.System(
        "spring",
        coordinates={"x": ss.Inertial("m", force=force)},
        kinetic="d_x**2/2",
        potential=formula,
        contacts={"floor": ss.Contact("d_x", mu)},
        **{"initial": {"x": 0.8, "d_x": 0.1}, "span": (0.0, 12.0), **parts},
    )


def belt(kinetic: str = "mu(speed)", threshold: Any = 0.45, **parts: Any) -> ss.System:
    """A block on a belt."""
    return ss.System(
        "belt",
        parameters={"V": ss.Parameter(0.2, range="(0, inf)"), **parts.pop("parameters", {})},
        coordinates={"x": ss.Inertial("m", drag=parts.pop("drag", 0.0))},
        kinetic="d_x**2/2",
        potential="x**2/2",
        contacts={"belt": ss.Contact("d_x", threshold, "V", kinetic)},
        **{"span": (0.0, 30.0), **parts},
    )
