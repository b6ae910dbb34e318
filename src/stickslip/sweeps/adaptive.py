"""Adaptive maps: refined only in cells in which an outcome or a measure changes.

The points of the map are those of the full grid. A coarse selection of them divides it into cells;
a cell is halved in all directions if an outcome or a measure changes among the points computed in
it and on its boundary, down to the grid. Because of the boundary, refinement follows a curve from
cell to cell. Points in cells without changes are interpolated and marked as such; a feature between
the coarse points may be missed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np

from stickslip.arguments import check_fields
from stickslip.arrays import Array
from stickslip.errors import DeclarationError, short, suggestion
from stickslip.sweeps.request.axes import Grid
from stickslip.sweeps.request.measures import OWN
from stickslip.sweeps.request.plan import INTERPOLATED
from stickslip.sweeps.store import MapStore

Cell = tuple[tuple[int, int], ...]
"""First and last index along each axis."""

_COARSEST = 8  # smallest initial number of cells along an axis


@dataclass(frozen=True)
class Adaptive:
    """Criteria for the refinement of a map.

    Attributes
    ----------
    by : tuple of str
        ``"outcome"`` and measures.
    contrast : float
        Change of a measure within a cell above which points are added, relative to the range of the
        measure over the map.
    """

    by: tuple[str, ...] = ("outcome",)
    contrast: float = 0.05

    def __post_init__(self) -> None:
        check_fields(self)


def check_adaptive(adaptive: Adaptive, store: MapStore) -> None:
    """Reject a refinement by quantities that are not measured, or along axes without order.

    Raises
    ------
    DeclarationError
    """
    known = ["outcome", *filter(_is_measure, store.names)]
    for name in adaptive.by:
        if name not in known:
            raise DeclarationError(
                "adaptive",
                f"'{short(name)}' is not one of the measures",
                suggestion(name, known),
            )
    if not adaptive.by or not 0.0 < adaptive.contrast < 1.0:
        raise DeclarationError(
            "adaptive",
            "the contrast is not a number between 0 and 1, or nothing is measured",
            "Try 0.05",
        )
    for axis in store.grid.axes:
        if not axis.ordered:
            names = ",".join(axis.names)
            raise DeclarationError(
                "adaptive",
                f"the values of {names} are not ordered",
                "Vary one parameter over a range",
            )


def rounds(store: MapStore, adaptive: Adaptive) -> Iterator[Array]:
    """Requested points, in successive sets; each set depends on the previous results.

    Yields
    ------
    array of bool, shape of the grid
    """
    leaves = _coarse(store.grid)
    while True:
        yield _corners(store.grid, leaves)
        known = store.outcome >= 0
        tables = [
            np.where(known, store.outcome, np.nan) if name == "outcome" else store.whole(name)
            for name in adaptive.by
        ]
        limits = [
            0.0 if name == "outcome" else adaptive.contrast * _range(table[known])
            for name, table in zip(adaptive.by, tables, strict=True)
        ]
        finer: list[Cell] = []
        for cell in leaves:
            finer += (
                _halves(cell)
                if _divisible(cell) and _changes(cell, known, tables, limits)
                else [cell]
            )
        if len(finer) == len(leaves):
            break
        leaves = finer
    _interpolate(store, leaves)


def _coarse(grid: Grid) -> list[Cell]:
    """The cells to begin with."""
    ranges: list[list[tuple[int, int]]] = []
    for n in grid.shape:
        stride = 1
        while (n - 1) // (2 * stride) >= _COARSEST:
            stride *= 2
        nodes = [*range(0, n - 1, stride), n - 1] if n > 1 else [0, 0]
        ranges.append(list(pairwise(nodes)))
    return list(product(*ranges))


def _corners(grid: Grid, cells: Sequence[Cell]) -> Array:
    wanted = np.zeros(grid.shape, bool)
    ends = np.array(cells)  # cells, axes, 2
    for corner in product((0, 1), repeat=len(grid.shape)):
        wanted[tuple(ends[:, axis, side] for axis, side in enumerate(corner))] = True
    return wanted


def _range(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(np.ptp(finite)) if len(finite) else 0.0


def _box(cell: Cell) -> tuple[slice, ...]:
    return tuple(slice(low, high + 1) for low, high in cell)


def _divisible(cell: Cell) -> bool:
    return any(high - low > 1 for low, high in cell)


def _changes(cell: Cell, known: Array, tables: Sequence[Array], limits: Sequence[float]) -> bool:
    """Return whether an outcome or a measure changes among the computed points of a cell."""
    box = _box(cell)
    here = known[box]
    for table, limit in zip(tables, limits, strict=True):
        values = table[box][here]
        undefined = np.isnan(values)
        if undefined.any() and not undefined.all():
            return True
        if not undefined.any() and np.ptp(values) > limit:
            return True
    return False


def _halves(cell: Cell) -> list[Cell]:
    parts: list[list[tuple[int, int]]] = []
    for low, high in cell:
        middle = (low + high) // 2
        parts.append([(low, middle), (middle, high)] if high - low > 1 else [(low, high)])
    return list(product(*parts))


def _interpolate(store: MapStore, leaves: Sequence[Cell]) -> None:
    """Interpolate the points inside cells from their corners, with the worst certificate of
    these."""
    gaps = [cell for cell in leaves if np.any(store.outcome[_box(cell)] < 0)]
    if not gaps:
        return
    inferred = store.outcome < 0
    for name in store.names:
        if name == "outcome":
            continue
        table = store.whole(name)
        filled = table.copy()
        for cell in gaps:
            box = _box(cell)
            if _is_measure(name):
                filled[box] = np.where(inferred[box], _multilinear(table, cell), table[box])
            elif name in ("certificate", "lacking"):
                filled[box] = np.where(inferred[box], np.max(_at_corners(table, cell)), table[box])
        store.replace(name, filled, inferred)
    store.replace("outcome", np.where(inferred, np.int8(INTERPOLATED), store.outcome), inferred)


def _is_measure(name: str) -> bool:
    return name not in OWN and not name.endswith("_missing")


def _at_corners(table: Array, cell: Cell) -> Array:
    return table[np.ix_(*([low, high] for low, high in cell))]


def _multilinear(table: Array, cell: Cell) -> Array:
    """Values in a box that are linear along each axis between its corners."""
    values = _at_corners(table, cell)
    for axis, (low, high) in enumerate(cell):
        shape = [1] * len(cell)
        shape[axis] = high - low + 1
        # Linear interpolation axis by axis is multilinear in the cell.
        weight = np.linspace(0.0, 1.0, high - low + 1).reshape(shape)
        first, last = np.take(values, [0], axis), np.take(values, [1], axis)
        values = first + (last - first) * weight
    return values
