"""Reading of the points of tables: arrays, rows of files, packed strings."""

from __future__ import annotations

import math
import zlib
from base64 import b64decode
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, short, suggestion
from stickslip.model.entries.samples import check_increasing, checked
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

MOST_STORED = 200_000
"""Numbers of a table that a model file holds."""


def check_word(word: object, known: Sequence[str], where: str) -> None:
    if word not in known:
        reason = f"unknown option '{short(str(word))}'"
        raise DeclarationError(where, reason, suggestion(str(word), known, '"'))


def is_grid(points: Any) -> bool:
    """Whether points are two axes: a pair of arrays, not of numbers."""
    pair = isinstance(points, tuple | list) and len(cast("Sequence[Any]", points)) == 2
    return pair and all(np.ndim(axis) == 1 for axis in points)


def checked_grid(points: Any, values: Any, where: str) -> tuple[tuple[Array, ...], Array]:
    axes: list[Array] = []
    for i, axis in enumerate(points):
        t, _ = checked(axis, np.zeros(len(axis)), f"{where}, axis {i + 1}", "point")
        axes.append(t)
    try:
        grid = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise DeclarationError(
            f"{where}, values", "they are not all numbers", "Give numbers"
        ) from None
    shape = tuple(map(len, axes))
    if grid.shape != shape:
        raise DeclarationError(
            f"{where}, values",
            f"they have shape {grid.shape}, but the axes have {shape[0]} and {shape[1]} points",
            "Give a row of values for each point of the first axis",
        )
    if not np.isfinite(grid).all():
        i, j = map(int, np.argwhere(~np.isfinite(grid))[0])
        raise DeclarationError(
            f"{where}, values[{i}][{j}]", f"{grid[i, j]} is not a number", "Give a number"
        )
    return tuple(axes), grid


def grid_in_rows(
    columns: Array, rows: Any, names: Sequence[str], where: str
) -> tuple[tuple[Array, Array], Array]:
    """Axes and values of a surface from the rows of a file, one point each."""
    for column, name in enumerate(names):
        wrong = ~np.isfinite(columns[column])
        if wrong.any():
            k = int(np.argmax(wrong))
            raise DeclarationError(
                f"{where}, line {rows[k]}, column '{short(name)}'",
                f"{columns[column, k]} is not a number",
                "Fill it, or delete the row",
            )
    axes, places = zip(
        *(np.unique(column, return_inverse=True) for column in columns[:2]), strict=True
    )
    for axis, name in zip(axes, names, strict=True):
        check_increasing(axis, f"{where}, column '{short(name)}'", "point")
    grid = np.full(tuple(map(len, axes)), np.nan)
    seen = np.full(grid.shape, -1)
    for k, (i, j) in enumerate(zip(*places, strict=True)):
        place = f"{names[0]} = {axes[0][i]:.9g}, {names[1]} = {axes[1][j]:.9g}"
        if seen[i, j] >= 0:
            raise DeclarationError(
                f"{where}, line {rows[k]}",
                f"{place} is already in line {rows[seen[i, j]]}",
                "Keep one of the two rows",
            )
        seen[i, j] = k
        grid[i, j] = columns[2, k]
        if not math.isfinite(grid[i, j]):
            raise DeclarationError(
                f"{where}, line {rows[k]}", f"the value at {place} is not a number", "Give a number"
            )
    if (seen < 0).any():
        i, j = map(int, np.argwhere(seen < 0)[0])
        raise DeclarationError(
            where,
            f"there is no row for {names[0]} = {axes[0][i]:.9g}, {names[1]} = {axes[1][j]:.9g}",
            "A surface needs a value at every point of its grid",
        )
    return (axes[0], axes[1]), grid


def without_formulas(values: Any) -> tuple[Any, dict[int, str]]:
    """Values with 0 in place of formulas, and the formulas by their places."""
    if not isinstance(values, tuple | list):
        return values, {}
    given = cast("Sequence[object]", values)
    found = {i: v for i, v in enumerate(given) if isinstance(v, str | Expr)}
    texts = {i: ex.to_text(v) if isinstance(v, Expr) else str(v) for i, v in found.items()}
    return [0.0 if i in texts else v for i, v in enumerate(given)], texts


def unpacked_table(table: Mapping[str, Any], where: str) -> tuple[Any, Array]:
    """Points and values of a packed text."""
    try:
        shape = tuple(int(n) for n in table.get("shape", ()))
        content = zlib.decompressobj().decompress(
            b64decode(str(table["packed"]), validate=True), 64 * MOST_STORED
        )
        numbers = np.frombuffer(content, "<f8").astype(float)
        *axes, values = np.split(numbers, np.cumsum(shape))
        return (tuple(axes) if len(axes) > 1 else axes[0]), values.reshape(shape)
    except (ValueError, TypeError, IndexError, zlib.error):
        raise DeclarationError(
            where, "the packed table is damaged", "Write the file again"
        ) from None
