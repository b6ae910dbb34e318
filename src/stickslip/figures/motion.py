"""The picture of one motion: time traces with stick phases shaded, and the phase plane where it says something."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from stickslip.figures.style import (
    BAND,
    BLUE,
    SLIP,
    STICK_LINE,
    STICK_SHADE,
    THRESHOLD,
    axis_label,
    legend_above,
    line_colours,
    new_figure,
    paper_style,
    symbol,
)
from stickslip.quantities import contact_key
from stickslip.units import unit_label

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

Array = np.ndarray
SAMPLES = 6000
MANY = 4  # lines in one panel, or contacts with a panel of their own, above which a map is drawn instead
ROW, EXTRA, TIME_WIDTH, PLANE_WIDTH = 1.5, 1.0, 7.2, 4.6  # inches


def plot_trajectory(trajectory: Trajectory) -> Figure:
    """Overview of a motion.

    Left, over a shared time axis: coordinates, velocities of inertial coordinates, internal variables, and per
    contact the friction force between its thresholds. Grey: the contact sticks (in the upper panels: every contact
    does). Right: phase planes of one or two degrees of freedom, sticking parts in black.

    Parameters
    ----------
    trajectory : Trajectory

    Returns
    -------
    matplotlib.figure.Figure
    """
    with paper_style():
        return _Overview(trajectory).draw()


class _Overview:
    """One overview: what is shown, and in which panel."""

    def __init__(self, trajectory: Trajectory) -> None:
        self.trajectory, self.system = trajectory, trajectory.system
        self.declaration = trajectory.system.declaration
        self.contacts = [contact_key(name) for name in self.system.contacts]
        self.t = _sample_times(trajectory)
        self.values: dict[str, Array] = {k: np.asarray(v) for k, v in trajectory.at(self.t).items()}
        modes = [self.values[f"mode_{key}"] == 0 for key in self.contacts]
        self.all_stick = np.logical_and.reduce(modes) if modes else np.zeros(len(self.t), bool)

    def unit(self, name: str) -> str:
        return str(self.trajectory.dataset[name].attrs.get("units", ""))

    def draw(self) -> Figure:
        panels, planes = self.panels(), self.planes()
        height = max(ROW * len(panels) + EXTRA, 3.6 if planes else 0.0)
        figure = self.figure = new_figure(TIME_WIDTH + (PLANE_WIDTH if planes else 0.0), height)
        figure.suptitle(self.system.title or self.system.name, x=0.01, ha="left", fontsize=13)
        columns = [TIME_WIDTH, PLANE_WIDTH] if planes else [TIME_WIDTH]
        grid = figure.add_gridspec(1, len(columns), width_ratios=columns)
        left = grid[0].subgridspec(len(panels), 1)
        rows: list[Axes] = []
        for row, panel in enumerate(panels):
            rows.append(figure.add_subplot(left[row], sharex=rows[0] if rows else None))
            panel(rows[-1])
            rows[-1].tick_params(labelbottom=row == len(panels) - 1)
        if 1 < len(self.contacts) <= MANY:
            legend_above(rows[0], [Patch(color=STICK_SHADE, label="every contact sticks")], right=True)
        self.time_axis(rows[-1])
        if planes:
            right = grid[1].subgridspec(len(planes), 1)
            for row, plane in enumerate(planes):
                plane(figure.add_subplot(right[row]))
        figure.align_ylabels(rows)
        return figure

    def time_axis(self, axes: Axes) -> None:
        unit = unit_label(self.system.time_unit)
        axes.set_xlabel("time $t$" + (f"  [{unit}]" if unit else ""))
        axes.set_xlim(self.t[0], self.t[-1] if self.t[-1] > self.t[0] else self.t[0] + 1.0)

    # Time traces.

    def panels(self) -> list[Callable[[Axes], None]]:
        """Panels from top to bottom."""
        d = self.declaration
        groups = [g for kind in (d.inertial, d.viscous, d.rate_independent) for g in self.by_unit(kind)]
        velocities = self.by_unit([f"d_{q}" for q in d.inertial])
        internal = [[name] for name in d.internal] if len(d.internal) <= MANY else self.by_unit(d.internal)
        panels = [self.trace(names) for names in groups]
        panels += [self.trace(names) if len(names) <= MANY else self.heat(names) for names in velocities]
        panels += [self.trace(names) for names in internal]
        if len(self.contacts) > MANY:
            return [*panels, self.mode_map]
        return panels + [self.friction(name) for name in self.system.contacts]

    def by_unit(self, names: list[str]) -> list[list[str]]:
        """Names in groups that share an axis."""
        groups: dict[str, list[str]] = {}
        for name in names:
            groups.setdefault(self.unit(name), []).append(name)
        return list(groups.values())

    def trace(self, names: list[str]) -> Callable[[Axes], None]:
        def panel(axes: Axes) -> None:
            if len(self.contacts) <= MANY:  # else the map of the modes says it
                self.shade(axes, self.all_stick)
            for name, colour in zip(names, line_colours(len(names)), strict=True):
                axes.plot(self.t, self.values[name], color=colour, label=symbol(name))
            _roomy(axes, np.concatenate([self.values[name] for name in names]))
            if len(names) > 1:
                legend_above(axes)
            short = names if len(names) <= MANY else [names[0], names[-1]]
            label = axis_label(short, self.unit(names[0]))
            axes.set_ylabel(label if short is names else label.replace(", ", r" $\ldots$ ", 1))

        return panel

    def shade(self, axes: Axes, where: Array) -> None:
        """Grey where a condition holds."""
        across = axes.get_xaxis_transform()
        axes.fill_between(self.t, 0.0, 1.0, where=where, transform=across, color=STICK_SHADE, lw=0, zorder=0)

    def heat(self, names: list[str]) -> Callable[[Axes], None]:
        """Many velocities as a map: one row each."""

        def panel(axes: Axes) -> None:
            rows = np.array([self.values[name] for name in names])
            # A violent start must not hide the rest: the largest speeds saturate.
            largest = float(np.percentile(np.abs(rows), 97)) or float(np.max(np.abs(rows))) or 1.0
            even = np.linspace(self.t[0], self.t[-1], 1500)
            image = np.array([np.interp(even, self.t, row) for row in rows])
            extent = (self.t[0], self.t[-1], len(names) + 0.5, 0.5)
            drawn = axes.imshow(
                image, aspect="auto", extent=extent, cmap="RdBu_r", vmin=-largest, vmax=largest, interpolation="nearest"
            )
            unit = unit_label(self.unit(names[0]))
            label = "velocity" + (f"  [{unit}]" if unit else "")
            self.figure.colorbar(drawn, ax=axes, pad=0.01, aspect=8, extend="both", label=label)
            _rows(axes, [symbol(name) for name in names])

        return panel

    def friction(self, name: str) -> Callable[[Axes], None]:
        """Friction force of one contact between its thresholds."""
        key = contact_key(name)
        force, plus, minus, mode = (
            self.values[f"{kind}_{key}"] for kind in ("friction", "threshold_plus", "threshold_minus", "mode")
        )

        def panel(axes: Axes) -> None:
            self.shade(axes, mode == 0)
            # λ = −s⁺ slides forward, λ = s⁻ backward.
            axes.fill_between(self.t, -plus, minus, color=BAND, lw=0, alpha=0.6, zorder=1)
            for bound in (-plus, minus):
                axes.plot(self.t, bound, color=THRESHOLD, lw=0.8, zorder=2)
            axes.plot(self.t, force, color=BLUE, zorder=3)
            _roomy(axes, np.concatenate([force, -plus, minus]))
            unit = unit_label(self.unit(f"friction_{key}"))
            axes.set_ylabel(r"$\lambda$" + (f"  [{unit}]" if unit else ""))
            axes.set_title(name)
            if key == self.contacts[0]:
                legend_above(axes, [
                    Line2D([], [], color=BLUE, label="friction force"),
                    Patch(fc=BAND, ec=THRESHOLD, lw=0.8, label="thresholds"),
                    Patch(color=STICK_SHADE, label="stick"),
                ], right=True)  # fmt: skip

        return panel

    def mode_map(self, axes: Axes) -> None:
        """Who sticks when: one row per contact."""
        for row, key in enumerate(self.contacts, start=1):
            mode = self.values[f"mode_{key}"]
            for value, colour in ((0, STICK_SHADE), *SLIP.items()):
                axes.fill_between(self.t, row - 0.42, row + 0.42, where=mode == value, color=colour, lw=0, step="post")
        axes.set_ylim(len(self.contacts) + 0.5, 0.5)
        _rows(axes, list(self.system.contacts))
        shown = ((STICK_SHADE, "stick"), (SLIP[1], "slip +"), (SLIP[-1], "slip −"))
        legend_above(axes, [Patch(color=colour, label=label) for colour, label in shown])

    # Phase planes.

    def planes(self) -> list[Callable[[Axes], None]]:
        """Planes that say something: (x, ẋ) of few inertial coordinates, or the two variables of a planar system."""
        d = self.declaration
        planes: list[Callable[[Axes], None]] = []
        if 1 <= len(d.inertial) <= 2:
            planes += [self.plane([q], [f"d_{q}"]) for q in d.inertial if self.returns(q)]
        elif len(d.state) == 2 and all(map(self.returns, d.state)):
            planes.append(self.plane([d.state[0]], [d.state[1]]))
        relative = [x for x, weight in self.system.translation.items() if weight == 1.0]
        others = [x for x in d.coordinates if x not in relative]
        # Two feet and one more coordinate: the distance of the feet is a hysteresis operator of the latter.
        if len(relative) == len(self.system.translation) == 2 and len(others) == 1 and self.same_unit(relative):
            planes.append(self.plane(others, relative))
        return planes

    def returns(self, name: str) -> bool:
        """Whether a quantity comes back; the plane of one that only moves on is its time trace once more."""
        steps = np.diff(self.values[name])
        noise = 1e-9 * float(np.ptp(self.values[name]))
        return bool(np.any(steps > noise) and np.any(steps < -noise))

    def same_unit(self, names: list[str]) -> bool:
        return len({self.unit(name) for name in names}) == 1

    def plane(self, across: list[str], up: list[str]) -> Callable[[Axes], None]:
        """A plane of two quantities, each a variable or the difference of two."""

        def panel(axes: Axes) -> None:
            x, y = self.quantity(across), self.quantity(up)
            sticking = self.all_stick
            has_contacts = bool(self.contacts)
            axes.plot(x, np.where(sticking, np.nan, y), color=BLUE, lw=1.3, label="slip" if has_contacts else None)
            if has_contacts:
                label = "stick" if len(self.contacts) == 1 else "all stick"
                phases = _phases(sticking)
                width = 2.2 if len(phases) <= 20 else 1.4
                axes.plot(x, np.where(sticking, y, np.nan), color=STICK_LINE, lw=width, label=label, zorder=3)
                # Where the state rests while it sticks, the line is a point.
                size = max(np.ptp(x), np.ptp(y))
                points = [i for i, j in phases if max(np.ptp(x[i:j]), np.ptp(y[i:j])) < 0.01 * size]
                axes.plot(x[points], y[points], ".", color=STICK_LINE, ms=4.5, zorder=3)
            axes.plot(x[:1], y[:1], "o", ms=6, mfc="white", mec=STICK_LINE, zorder=4, label="start")
            axes.set_xlabel(self.quantity_label(across))
            axes.set_ylabel(self.quantity_label(up))
            _roomy(axes, y)
            axes.margins(x=0.05)
            axes.set_box_aspect(0.9)
            axes.set_anchor("N")
            axes.xaxis.set_major_locator(MaxNLocator(6))
            legend_above(axes)

        return panel

    def quantity(self, names: list[str]) -> Array:
        return self.values[names[0]] - (self.values[names[1]] if len(names) == 2 else 0.0)

    def quantity_label(self, names: list[str]) -> str:
        label = axis_label(names, self.unit(names[0]))
        return label.replace("$, $", " - ") if len(names) == 2 else label


def _sample_times(trajectory: Trajectory) -> Array:
    """An even grid, the knots of the result, and both sides of every switch."""
    knots = np.asarray(trajectory.dataset["time"].values, dtype=float)
    start, end = float(knots[0]), float(knots[-1])
    switches = np.asarray(trajectory.events["time"], dtype=float)
    before = np.nextafter(switches, -np.inf)
    times = np.concatenate([np.linspace(start, end, SAMPLES), knots, switches, before])
    return np.unique(times[(times >= start) & (times <= end)])


def _phases(holds: Array) -> list[tuple[int, int]]:
    """First and last plus one index of each run in which a condition holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(np.int8)))
    return [(int(i), int(j)) for i, j in edges.reshape(-1, 2)]


def _roomy(axes: Axes, values: Array) -> None:
    """Limits with some air, also for a constant."""
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    air = 0.07 * (high - low)
    if air <= 1e-9 * max(abs(low), abs(high)):
        air = 0.1 * max(abs(low), abs(high)) or 1.0
    axes.set_ylim(low - air, high + air)


def _rows(axes: Axes, labels: list[str]) -> None:
    """Label rows of a map; only some if there are many."""
    step = -(-len(labels) // 8)
    axes.set_yticks(range(1, len(labels) + 1, step), labels[::step])
    axes.tick_params(axis="y", length=0, labelsize=9)
