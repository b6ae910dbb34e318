"""The gait diagram: which contact moves when, and the positions of the feet."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from stickslip.errors import DeclarationError
from stickslip.figures.drawing.style import (
    BAND,
    SLIP,
    STICK_LINE,
    STICK_SHADE,
    axis_label,
    legend_above,
    line_colours,
    new_figure,
    paper_style,
)
from stickslip.model.entries.units import unit_label
from stickslip.model.quantities import contact_key, quantity
from stickslip.motion.record.knots import IS_CLOSED, IS_OPEN

if TYPE_CHECKING:
    from stickslip.orbits.cycles.cycle import Cycle

_SAMPLES = 400


def plot_gait(cycle: Cycle, periods: int = 2) -> Figure:
    """Stick, forward slip and backward slip of the contacts, above the coordinates that drift.

    Parameters
    ----------
    cycle : Cycle
        Of a system with contacts.
    periods : int
        Number of periods shown.
    """
    if not cycle.contacts:
        raise DeclarationError("cycle", "the system has no contacts", "Use another figure")
    moving = [name for name in cycle.direction if cycle.drift] or list(
        cycle.system.declaration.coordinates
    )
    rows = len(cycle.contacts)
    with paper_style():
        figure = new_figure(6.4, 2.9 + 0.42 * rows)
        top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[0.42 * rows, 2.2])
        _bars(top, cycle, periods)
        _positions(bottom, cycle, moving, periods)
        unit = unit_label(cycle.system.time_unit)
        bottom.set_xlabel("time $t$" + (f"  [{unit}]" if unit else ""))
        bottom.set_xlim(0.0, periods * cycle.period)
    return figure


def _bars(axes: Axes, cycle: Cycle, periods: int) -> None:
    """Plot one row for each contact, with a bar for each phase, except where it is open, and a line
    for each impact."""
    knots = cycle.trajectory.knots
    names = list(cycle.contacts)
    start = knots.time[:-1] - knots.time[0]
    length = np.diff(knots.time)
    shown: set[int] = set()
    colours = {**SLIP, 0: STICK_SHADE, IS_CLOSED: BAND}
    for row, name in enumerate(names):
        mode = cycle.trajectory.modes[contact_key(name)][:-1]
        edges = np.flatnonzero(np.append(True, np.diff(mode) != 0))
        for turn in range(periods):
            for i, j in zip(edges, [*edges[1:], len(mode)], strict=True):
                begins = start[i] + turn * cycle.period
                lasts = float(np.sum(length[i:j]))
                if mode[i] != IS_OPEN:
                    colour = colours[int(mode[i])]
                    axes.broken_barh([(begins, lasts)], (row - 0.36, 0.72), color=colour, lw=0)
                    shown.add(int(mode[i]))
    struck = cycle.trajectory.impacts
    for row, name in enumerate(names):
        times = np.asarray(struck["time"])[np.asarray(struck["contact"]) == contact_key(name)]
        times = times - knots.time[0]
        every = np.concatenate([times + turn * cycle.period for turn in range(periods)])
        if len(every):
            axes.vlines(every, row - 0.36, row + 0.36, color=STICK_LINE, lw=1.4)
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.tick_params(left=False)
    axes.spines[["left", "bottom"]].set_visible(False)
    axes.tick_params(bottom=False, labelbottom=False)
    meanings = (
        (0, STICK_SHADE, "stick"),
        (1, SLIP[1], "slip forward"),
        (-1, SLIP[-1], "slip backward"),
        (IS_CLOSED, BAND, "closed"),
    )
    marks: list[Artist] = [
        Patch(color=c, label=text) for mode, c, text in meanings if mode in shown
    ]
    if len(struck):
        marks.append(Line2D([], [], color=STICK_LINE, lw=1.4, label="impact"))
    legend_above(axes, marks)


def _positions(axes: Axes, cycle: Cycle, names: list[str], periods: int) -> None:
    """Displacements of the coordinates, relative to the start of the first one."""
    t = np.linspace(0.0, cycle.period, _SAMPLES)
    values = cycle.trajectory.at(np.minimum(t + cycle.time, cycle.trajectory.knots.time[-1]))
    origin = values[names[0]][0]
    for name, colour in zip(names, line_colours(len(names) + 2)[2:], strict=True):
        shift = cycle.drift * cycle.direction.get(name, 0.0)
        x = np.concatenate([values[name] - origin + turn * shift for turn in range(periods)])
        times = np.concatenate([t + turn * cycle.period for turn in range(periods)])
        axes.plot(times, x, color=colour, label=axis_label([name], ""))
    axes.set_ylabel(axis_label(names, quantity(cycle.system, names[0]).get("units", "")))
    if len(names) > 1:
        legend_above(axes)
