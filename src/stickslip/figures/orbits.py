"""Bifurcation diagrams."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, short, suggestion
from stickslip.figures.drawing.smooth import PIECES, smooth_curve
from stickslip.figures.drawing.style import (
    BAND,
    BLUE,
    EQUILIBRIUM,
    LINES,
    STICK_LINE,
    UNSTABLE,
    axis_label,
    legend_above,
    line_colours,
    new_figure,
    paper_style,
    root_of,
)
from stickslip.model.entries.units import unit_label
from stickslip.model.quantities import drift_units
from stickslip.orbits.continuation.branch import without_knots

if TYPE_CHECKING:
    from stickslip.orbits.continuation.branch import Branch, SpecialPoint

_LETTERS = 26  # letters per line of the label of a panel
_WIDE = 100.0  # smallest ratio of the ends of a logarithmic axis
_LOW = 0.2  # … and largest ratio of the median to the largest value
_MARKERS = "osD^vPX*"
_THIN, _THICK = 1.1, 2.2  # lines of equilibria and of cycles
_STRIP = 0.06  # width of the shaded strip along a curve, as a fraction of the axes
_SMOOTH = ("fold", "period doubling", "torus")  # special points at which the curve has no corner
_VANISHING = ("Hopf", "boundary equilibrium")  # special points at which a cycle shrinks to a point


def plot_branch(
    branch: Branch,
    names: list[str] | None = None,
    *,
    others: Sequence[Branch] = (),
    ax: Axes | None = None,
) -> Figure:
    """Bifurcation diagram: stable points solid, unstable ones dashed, special points marked and
    named.

    Lines of equilibria are thin and grey, those of cycles thick, and black if they stick. For
    cycles the largest and the smallest value are plotted.

    Parameters
    ----------
    names : list of str, optional
        Quantities plotted against the parameter; by default the coordinates and internal variables
        that change, and the speed of gaits, at most three; the mean friction of pulled systems.
    others : sequence of Branch
        Of the same system and parameter, such as the cycles that emanate from a branch of
        equilibria.
    ax : matplotlib.axes.Axes, optional
        Draw the first of the names into these axes.

    Raises
    ------
    DeclarationError
        If a name is not a variable of the points, or another curve is over other parameters.
    """
    every = [branch, *others]
    if branch.second:
        return _on_page(ax, 4.4, 2, lambda panels: _draw_curves(panels[0], every))
    names = _known(branch, names) if names else _changing(branch)
    names = names[:1] if ax is not None else names

    wide = all(_is_wide(_values(one)) for one in every)

    def draw(panels: Sequence[Axes]) -> list[Line2D]:
        for axes, name in zip(panels, names, strict=True):
            if wide:
                axes.set_xscale("log")
            for one in every:
                _draw(axes, one, name, _markers(every))
            axes.set_ylabel(_label(branch, name))
        parameter = branch.system.parameters[branch.parameter]
        panels[-1].set_xlabel(axis_label([branch.parameter], parameter.unit))
        return _legend(every)

    return _on_page(ax, 1.2 + 2.4 * len(names), 3, draw, len(names))


def _on_page(
    ax: Axes | None,
    height: float,
    columns: int,
    draw: Callable[[Sequence[Axes]], Sequence[Artist]],
    rows: int = 1,
) -> Figure:
    """Draw into given axes, or into panels of a new figure, with the legend above."""
    if ax is not None:
        legend_above(ax, draw([ax]))
        return root_of(ax)
    with paper_style():
        figure = new_figure(6.4, height)
        handles = draw(list(figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]))
        figure.legend(handles=handles, loc="outside upper left", ncols=columns)
    return figure


def _known(branch: Branch, names: list[str]) -> list[str]:
    """Check that all names are variables of the points."""
    variables = [str(n) for n in branch.points.data_vars if branch.points[n].dims == ("point",)]
    known = [*variables, *(n.removeprefix("max_") for n in variables if n.startswith("max_"))]
    for name in names:
        if name not in known:
            raise DeclarationError(
                "quantities",
                f"unknown quantity '{short(str(name))}'",
                suggestion(str(name), known),
            )
    return names


def _draw_curves(axes: Axes, curves: list[Branch]) -> list[Artist]:
    """Plot curves of special points in the plane of two parameters; return the handles of a
    legend."""
    names = curves[0].parameter, curves[0].second
    for curve in curves:
        if not all(name in curve.points for name in names):
            raise DeclarationError(
                "others",
                f"the curve is over {curve.parameter}",
                f"Give curves over {', '.join(names)}",
            )
    handles = list[Artist]()
    markers = _markers(curves)
    for curve, colour in zip(curves, line_colours(len(curves)), strict=True):
        handles += _draw_curve(axes, curve, names, colour)
        for point in without_knots(curve.special):
            place = (point.parameters[name] for name in names)
            axes.plot(*place, **markers[point.kind], zorder=3)
    units = [curves[0].system.parameters[name].unit for name in names]
    axes.set_xlabel(axis_label(names[:1], units[0]))
    axes.set_ylabel(axis_label(names[1:], units[1]))
    axes.margins(0.05)
    shaded = [_shade_stable(axes, curve, names) for curve in curves]
    if any(shaded):
        handles.append(Patch(fc=BAND, ec="none", label="equilibrium stable on this side"))
    return handles + [Line2D([], [], **style, label=kind) for kind, style in markers.items()]


def _shade_stable(axes: Axes, curve: Branch, names: tuple[str, str]) -> bool:
    """Shade a strip along a curve of Hopf points, on the side on which their eigenvalues are
    stable, except where another eigenvalue is unstable. Return whether there is a strip."""
    growths = [f"growth_{name}" for name in names]
    if not all(name in curve.points for name in growths):
        return False
    places = np.stack([curve.points[name].values for name in names], axis=1)
    growth = np.stack([curve.points[name].values for name in growths], axis=1)
    low, high = np.transpose([axes.get_xlim(), axes.get_ylim()])
    box = axes.get_window_extent()
    size = np.array([box.width, box.height]) / (high - low)  # pixels for each unit
    along = np.gradient(places * size, axis=0) if len(places) > 1 else np.zeros_like(places)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    across = np.divide(across, length, out=np.zeros_like(across), where=length > 0.0)
    towards = -np.sign(np.sum(across * growth / size, axis=1))
    reach = _STRIP * min(box.width, box.height) / size
    ends = places + towards[:, None] * across * reach
    sure = (curve.points["unstable_others"].values == 0) & np.isfinite(towards) & (towards != 0.0)
    both = sure[1:] & sure[:-1] & (towards[1:] == towards[:-1])
    strips = np.stack([places[:-1], places[1:], ends[1:], ends[:-1]], axis=1)[both]
    shade = PolyCollection(list(strips), fc=BAND, ec=BAND, lw=0.5, zorder=0)
    axes.add_collection(shade, autolim=False)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    return bool(len(strips))


def _draw_curve(axes: Axes, curve: Branch, names: tuple[str, str], colour: str) -> list[Line2D]:
    """Plot one curve, dashed where the emanating cycles of its Hopf points are unstable; return the
    handles of its lines."""
    x, y = (curve.points[name].values for name in names)
    born = curve.points["lyapunov"].values if "lyapunov" in curve.points else None
    solid = np.ones(len(x), dtype=bool) if born is None else ~(born > 0.0)
    for a, b in pairwise([0, *(np.flatnonzero(np.diff(solid) != 0) + 1), len(x)]):
        part = slice(a, min(b + 1, len(x)))
        marker = "." if len(x) == 1 else ""
        axes.plot(x[part], y[part], color=colour, linestyle=_line(bool(solid[a])), marker=marker)
    handles = []
    for one in sorted(set(solid.tolist()), reverse=True):
        more = "" if born is None else ", stable cycles" if one else ", unstable cycles"
        handles.append(
            Line2D(
                [],
                [],
                color=colour,
                linestyle=_line(one),
                label=f"{curve.points.attrs['kind']}{more}",
            )
        )
    return handles


def _changing(branch: Branch) -> list[str]:
    """Coordinates and internal variables that change along the branch (all of them if none does),
    and a gait's speed.

    Positions of the feet of a gait are omitted, as is the speed of a system carried along by a
    load.
    """
    driven = "harmonics_error" in branch.points and not branch.system.plain.translation
    if driven and "energy_per_distance" in branch.points:
        return ["energy_per_distance"]
    speed = ["speed"] if _is_cycles(branch) and np.any(branch.points["speed"].values != 0.0) else []
    candidates = [
        x for x in branch.system.declaration.state if x in branch.points and not x.startswith("d_")
    ]
    resting = [x for x in candidates if not branch.system.plain.translation.get(x)]
    candidates = resting if speed else resting or candidates
    moving = [
        x
        for x in candidates
        if np.ptp(branch.points[x].values) > 1e-9 * (1 + np.ptp(_values(branch)))
    ]
    return (moving or candidates)[: 3 - len(speed)] + speed


def _label(branch: Branch, name: str) -> str:
    """The label of a quantity: a symbol, or a description."""
    state = branch.system.declaration.state
    known = branch.points[name].attrs if name in branch.points else {}
    meaning = known.get("long_name")
    if name in state or meaning is None:
        return axis_label([name], _unit(branch, name))
    unit = unit_label(_unit(branch, name))
    return fill(str(meaning), _LETTERS) + (f"  [{unit}]" if unit else "")


def _unit(branch: Branch, name: str) -> str:
    if name == "speed" and branch.system.translation:
        return drift_units(branch.system, branch.system.translation)[1]
    declared = {**branch.system.plain.coordinates, **branch.system.plain.internal}
    if name in declared:
        return declared[name].unit
    known = branch.points[name].attrs if name in branch.points else {}
    return str(known.get("units", "")).removeprefix("1")


def _values(branch: Branch) -> Array:
    return branch.points[branch.parameter].values


def _is_cycles(branch: Branch) -> bool:
    return "period" in branch.points


def _sticks(branch: Branch) -> Array:
    """Return whether each point is a cycle that sticks."""
    return (
        branch.points["sticks"].values
        if _is_cycles(branch)
        else np.zeros(len(_values(branch)), np.int8)
    )


def _draw(axes: Axes, branch: Branch, name: str, markers: Mapping[str, dict[str, Any]]) -> None:
    """Plot one variable against the parameter: a line for each part of constant stability."""
    x = _values(branch)
    stable = _decided(branch)
    sticks = _sticks(branch)
    curves = [c for c in (f"max_{name}", f"min_{name}") if c in branch.points] or [name]
    if curves[0] not in branch.points:
        return  # an equilibrium has no speed of a gait
    changed = np.flatnonzero((np.diff(stable) != 0) | (np.diff(sticks) != 0)) + 1
    # A curve of cycles has corners where the sequence changes, and ends where it is not smooth.
    corners = np.zeros(len(x), bool)
    corners[[s.index for s in branch.special if s.kind not in _SMOOTH or s.note]] = True
    for curve in curves:
        across = np.log(x) if axes.get_xscale() == "log" else x
        drawn = smooth_curve(across, branch.points[curve].values.astype(float), corners)
        drawn = (np.exp(drawn[0]), drawn[1]) if axes.get_xscale() == "log" else drawn
        for first, last in pairwise([0, *changed, len(x)]):
            # up to the first point of the next stretch
            part = slice(PIECES * first, PIECES * min(last, len(x) - 1) + 1)
            style = _line(stable[first] == 1)
            kind = _kind(_is_cycles(branch), bool(sticks[first]))
            axes.plot(*(v[part] for v in drawn), linestyle=style, **kind)
    for point in without_knots(branch.special):
        style = markers[point.kind]
        for height in _mark_positions(branch, point, name):
            axes.plot(point.value, height, **style, zorder=3)


def _mark_positions(branch: Branch, point: SpecialPoint, name: str) -> list[float]:
    """Positions of the marks of a special point: the extremes of a cycle, or a single value."""
    if name not in point.state:
        return [float(branch.points[name].values[point.index])]
    if not _is_cycles(branch) or point.kind in _VANISHING:
        return [point.state[name]]
    return [float(branch.points[f"{side}_{name}"].values[point.index]) for side in ("max", "min")]


def _is_wide(x: Array) -> bool:
    """Return whether points extend over orders of magnitude, and most are far below the largest."""
    wide = np.min(x) > 0.0 and np.max(x) >= _WIDE * np.min(x)
    return bool(wide and np.median(x) <= _LOW * np.max(x))


def _decided(branch: Branch) -> Array:
    """Stability of each point; an undecided one inherits that of the previous point."""
    decided = branch.points["stable"].values.copy()
    for i in range(1, len(decided)):
        if decided[i] < 0:
            decided[i] = decided[i - 1]
    return decided


def _line(stable: bool) -> Any:
    return "-" if stable else UNSTABLE


def _kind(cycle: bool, sticks: bool) -> dict[str, Any]:
    """Colour and width of a line: equilibria and cycles are distinguishable also without
    colours."""
    if not cycle:
        return {"color": EQUILIBRIUM, "lw": _THIN}
    return {"color": STICK_LINE if sticks else BLUE, "lw": _THICK}


def _markers(branches: Sequence[Branch]) -> dict[str, dict[str, Any]]:
    """Markers of the kinds of special points: hollow and of different sizes, since points may be
    close together."""
    kinds = list(dict.fromkeys(s.kind for b in branches for s in without_knots(b.special)))
    return {
        kind: {
            "marker": _MARKERS[i % len(_MARKERS)],
            "color": LINES[1:][i % (len(LINES) - 1)],
            "linestyle": "none",
            "markersize": 6 + 2 * i,
            "markerfacecolor": "none",
            "markeredgewidth": 1.6,
        }
        for i, kind in enumerate(kinds)
    }


def _legend(branches: Sequence[Branch]) -> list[Line2D]:
    found = {}
    for branch in branches:
        what = " cycle" if _is_cycles(branch) else " equilibrium"
        for stable, sticks in sorted(
            set(zip(_decided(branch).tolist(), _sticks(branch).tolist(), strict=True))
        )[::-1]:
            text = (
                ("stable" if stable == 1 else "unstable") + what + (" with stick" if sticks else "")
            )
            kind = _kind(_is_cycles(branch), bool(sticks))
            found[text] = Line2D([], [], linestyle=_line(stable == 1), label=text, **kind)
    for kind, style in _markers(branches).items():
        found[kind] = Line2D([], [], **style, label=kind)
    return list(found.values())
