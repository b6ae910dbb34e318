"""Cells in plots of maps: colours, and hatching that is clipped at the cells."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path

from stickslip.arrays import Array
from stickslip.figures.drawing.maps import uncertified
from stickslip.figures.drawing.style import (
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    SKY,
    STICK_LINE,
    STICK_SHADE,
    VERMILION,
    root_of,
)
from stickslip.motion.outcome import Outcome
from stickslip.sweeps.request.measures import MISSING
from stickslip.sweeps.request.plan import NOT_COMPUTED

if TYPE_CHECKING:
    import xarray

    from stickslip.sweeps.request.scales import ColourScale

COLOURS: Mapping[str, str] = {
    "one way": "viridis",
    "both ways": "RdYlBu_r",
    "round": "twilight",
}
"""Colour maps by the kind of scale. Colour-blind readers can tell them apart, and none has the
white of what is not computed."""

HATCHES: Mapping[Outcome, str] = {
    Outcome.IRREGULAR: "x",
    Outcome.SLOW: ".",
    Outcome.NOT_SETTLED: "\\",
}
"""Hatching of motions that have not settled, by why."""

REGIMES: Mapping[Outcome, str] = {
    Outcome.PERIODIC: BLUE,
    Outcome.STEADY: GREEN,
    Outcome.AT_REST: STICK_SHADE,
    Outcome.IRREGULAR: VERMILION,
    Outcome.SLOW: ORANGE,
    Outcome.NOT_SETTLED: PURPLE,
    Outcome.FINISHED: SKY,
}
"""Colours of the outcomes that most maps have; others have the colours that are left, and greys."""

UNCERTAIN = "/"
"""Hatching of whatever else is shown without a certificate."""

_INCH = 6  # lines of a hatch per inch, for each letter of its pattern
_FINEST = 5  # largest number of letters; more would be black
_ACROSS = 1.5  # smallest number of lines through a cell, unless they are too fine
# widths of lines and of the white around them, for contrast on dark colours
_THIN, _HALO = 0.6, 2.2


def cell_edges(values: Array, log: bool = False) -> Array:
    """Boundaries of the cells around sorted values, half way to their neighbours."""
    v = np.log(values) if log else values
    if len(v) == 1:
        edges = np.array([v[0] - 0.5, v[0] + 0.5])
    else:
        middle = (v[1:] + v[:-1]) / 2
        edges = np.concatenate(
            [[v[0] - (middle[0] - v[0])], middle, [v[-1] + (v[-1] - middle[-1])]]
        )
    return np.exp(edges) if log else edges


def fill_cells(
    axes: Axes, edges: tuple[Array, Array], values: Array, scale: ColourScale, **more: Any
) -> Any:
    """Colour cells by a scale, except those without a number.

    Parameters
    ----------
    edges : pair of arrays, shapes (m + 1,) and (n + 1,)
    values : array, shape (m, n)
    **more
        For matplotlib's ``pcolormesh``, whose result is returned.
    """
    more = {"cmap": COLOURS[scale.kind], "vmin": scale.low, "vmax": scale.high, **more}
    return axes.pcolormesh(*edges, values.T, rasterized=True, **more)


def hatch_cells(axes: Axes, edges: tuple[Array, Array], where: Array, hatch: str) -> None:
    """Hatch given cells, clipped at their boundaries.

    Parameters
    ----------
    edges : pair of arrays, shapes (m + 1,) and (n + 1,)
    where : array of bool, shape (m, n)
        Which cells.
    hatch : str
        A letter of matplotlib's hatches, repeated so often that each cell has a line.
    """
    if not np.any(where):
        return
    x, y = edges
    padded = np.pad(where, ((0, 0), (1, 1))).astype(np.int8)
    column, first = np.nonzero(np.diff(padded, axis=1) > 0)
    _, last = np.nonzero(np.diff(padded, axis=1) < 0)
    left, right, low, high = x[column], x[column + 1], y[first], y[last]
    corners = np.stack([left, low, right, low, right, high, left, high, left, low], axis=1)
    codes = [Path.MOVETO, Path.LINETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY]
    outline = Path(corners.reshape(-1, 2), np.tile(codes, len(corners)).tolist())
    box = axes.get_position()
    size = root_of(axes).get_size_inches() * (box.width, box.height)
    cell = float(np.min(size / where.shape))
    letters = int(np.clip(np.ceil(_ACROSS / (_INCH * cell)), 2, _FINEST))
    for colour, width in (("white", _HALO), (STICK_LINE, _THIN)):
        patch = PathPatch(outline, fc="none", ec=colour, lw=0.0, hatch=hatch * letters)
        if not _set_width(patch, width) and colour == "white":
            continue
        axes.add_patch(patch)


def hatched_patch(hatch: str, label: str, colour: str | tuple[str, float] = "none") -> Patch:
    """Legend entries for hatched cells."""
    patch = Patch(fc=colour, ec=STICK_LINE, lw=0.6, hatch=4 * hatch, label=label)
    _set_width(patch, _THIN)
    return patch


def _set_width(patch: Patch, width: float) -> bool:
    """Set the width of the lines of a hatch, supported since matplotlib 3.10."""
    known = getattr(patch, "set_hatch_linewidth", None)
    if known is not None:
        known(width)
    return known is not None


def doubtful(data: xarray.Dataset, name: str) -> dict[str, Array]:
    """Points without a certificate, by their hatching: those that have not settled, with or without
    a value, and others with a value of the measure."""
    outcome = data["outcome"].values
    found = {hatch: outcome == kind.code for kind, hatch in HATCHES.items()}
    rest = uncertified(data, name) & (outcome != NOT_COMPUTED)
    if name == "outcome" and "lacking" in data:  # for those that have stopped the colour suffices
        rest &= data["lacking"].values != MISSING.index("result")
    for here in found.values():
        rest &= ~here
    return {hatch: here for hatch, here in {**found, UNCERTAIN: rest}.items() if np.any(here)}
