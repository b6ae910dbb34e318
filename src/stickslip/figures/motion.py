"""The plot of a motion: time traces with stick phases shaded and, if informative, the phase plane.

The number of plotted points is bounded for motions of any length: see
:mod:`stickslip.figures.drawing.thinning`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, short, suggestion
from stickslip.figures.drawing.axes import (
    MANY_LINES,
    label_of_several,
    label_rows,
    set_roomy_limits,
    spread_out,
)
from stickslip.figures.drawing.planes import InPlane, PlaneCurves
from stickslip.figures.drawing.sampling import SampledMotion
from stickslip.figures.drawing.style import (
    BAND,
    BLUE,
    SLIP,
    STICK_LINE,
    STICK_SHADE,
    THRESHOLD,
    VERMILION,
    axis_label,
    legend_above,
    line_colours,
    new_figure,
    paper_style,
    powers_in_labels,
    symbol,
)
from stickslip.figures.drawing.thinning import COLUMNS, FEW, Columns, Curve, strip
from stickslip.model.entries.keys import normal_force
from stickslip.model.entries.units import unit_label
from stickslip.model.quantities import FORCES, contact_key, quantity
from stickslip.motion.record.knots import IS_CLOSED, IS_OPEN
from stickslip.numerics.ratios import ratio

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

# fraction of its range over which a quantity varies within a column if its line is a block
_SWINGS = 0.2
_INSIDE = 0.3  # opacity inside an envelope
_MARKED = 200  # largest number of impacts of a contact that are marked
# fraction of the time in contact above which friction is shown instead of the gap
_CLOSED_FOR = 0.1
_ROW = 1.5  # inches
_EXTRA = 1.0  # inches
_SQUARE = 3.5  # inches
_TIME_WIDTH = 7.2  # inches
_PLANE_WIDTH = 4.6  # inches


def plot_trajectory(
    trajectory: Trajectory,
    t: tuple[float, float] | None = None,
    coordinates: Sequence[str] | None = None,
) -> Figure:
    """Overview of a motion, or of a part of it.

    Left, over a shared time axis: coordinates, velocities of inertial coordinates, internal
    variables, outputs, and per contact the friction force between its thresholds. Grey: the contact
    sticks (in the upper panels: every contact does). Right: phase planes of one or two degrees of
    freedom, sticking parts in black; of contacts in a plane their path, and the friction force in
    the set of forces that it may be.

    Parameters
    ----------
    t : (float, float), optional
        Time window.
    coordinates : sequence of str, optional
        Those that are shown, with their rates and with the contacts that move them; internal
        variables, and outputs. By default all.

    Raises
    ------
    DeclarationError
        If the window is none of the computed span, or there is no such coordinate.
    """
    with paper_style():
        return _Overview(trajectory, t, coordinates).draw()


class _Overview:
    """One overview: the selection of quantities, and their panels."""

    def __init__(
        self,
        trajectory: Trajectory,
        t: tuple[float, float] | None,
        coordinates: Sequence[str] | None,
    ) -> None:
        self.trajectory = trajectory
        self.system = trajectory.system
        self.declaration = trajectory.system.declaration
        d = self.declaration
        rows = {x: row for x, row in self.system.unknowns.items() if not x.startswith("d_")}
        modes = {mode for row in rows.values() for mode in row}
        self.inertial = [*(x for x in d.inertial if x not in modes), *rows]
        self.massless = [*d.viscous, *d.rate_independent]
        self.shown = self.chosen(coordinates)
        moving = self.shown.union(*(rows.get(x, ()) for x in self.shown))
        named = {normal_force(name): name for name in self.system.unilateral}
        named |= {part: name for name, parts in self.system.planes.items() for part in parts}
        shown = [
            c.side_of or named.get(c.name, c.name)
            for c in self.declaration.contacts
            if coordinates is None or moving & c.direction.keys()
        ]
        self.names = list(dict.fromkeys(shown))
        self.contacts = [contact_key(name) for name in self.names]
        planes = [InPlane(trajectory, name) for name in self.names if name in self.system.planes]
        self.in_plane = {plane.key: plane for plane in planes}
        self.opening = [contact_key(name) for name in self.names if name in self.system.unilateral]
        self.held = [
            key
            for key in map(contact_key, self.system.constraints)
            if key in self.contacts and not self.has_friction(key)
        ]
        self.motion = SampledMotion(trajectory, t)
        part = slice(self.motion.first, self.motion.first + self.motion.steps)
        modes = {key: mode[part] for key, mode in trajectory.modes.items()}
        self.modes = {key: modes[key] for key in self.contacts}
        # An open contact has no force to plot.
        self.all_stick = np.zeros(self.motion.steps, bool)
        for mode in modes.values():
            self.all_stick |= np.isin(mode, (0, IS_CLOSED))
        for mode in modes.values():
            self.all_stick &= np.isin(mode, (0, IS_CLOSED, IS_OPEN))
        self.whole = self.motion.count <= FEW  # drawn without thinning
        self.t, self.values, self.curves = self.collect()

    def chosen(self, coordinates: Sequence[str] | None) -> set[str]:
        """Plotted coordinates, internal variables and outputs."""
        known = [*self.inertial, *self.massless, *self.declaration.internal, *self.system.outputs]
        if coordinates is None:
            return set(known)
        if not len(coordinates):
            raise DeclarationError("coordinates", "the list is empty", "Name at least one")
        for name in coordinates:
            if name not in known:
                raise DeclarationError(
                    "coordinates", f"unknown quantity '{short(str(name))}'", suggestion(name, known)
                )
        return set(coordinates)

    def has_friction(self, key: str) -> bool:
        """Return whether a contact has friction."""
        return any(contact_key(name) == key for name in self.system.frictional)

    def is_held(self, key: str) -> bool:
        """Return whether to plot the friction force of a contact: it is closed at some time."""
        if not self.has_friction(key):
            return False
        closed = self.modes[key] != IS_OPEN
        time = self.motion.time
        lengths = np.diff(time)[: len(closed)]
        closed_for = float(np.sum(lengths[closed[: len(lengths)]]))
        share = ratio(closed_for, float(time[-1] - time[0]))
        return key not in self.opening or share > _CLOSED_FOR

    def these(self, names: Iterable[str]) -> list[str]:
        """Selected names, from the given ones."""
        return [name for name in names if name in self.shown]

    def unit(self, name: str) -> str:
        return quantity(self.system, name).get("units", "")

    def collect(self) -> tuple[Array, dict[str, Array], list[Curve]]:
        """Collect the lines over time, and the curves of the planes, incrementally over the
        motion."""
        names = [*self.declaration.state, *self.system.unknowns, *self.system.outputs]
        if len(self.contacts) <= MANY_LINES:
            rubbing = [
                key for key in self.contacts if self.has_friction(key) and key not in self.in_plane
            ]
            names += [f"{kind}_{key}" for key in rubbing for kind in FORCES]
            names += [name for plane in self.in_plane.values() for name in plane.traced]
            names += [f"gap_{key}" for key in self.opening]
            names += [f"normal_{key}" for key in self.held]
        motion = self.motion
        planes = self.planes()
        whole = self.whole
        curves = [
            Curve(whole, *(_difference(motion.at_knots, names) for names in plane))
            for plane in planes
        ]
        columns = Columns(motion.time[0], motion.time[-1])
        pieces = []
        self.plane_curves = PlaneCurves(self.shown_planes(), motion, whole)
        for t, steps, values in motion.sampled(names):
            self.plane_curves.absorb(steps, values, self.modes)
            values |= self.sizes(values)
            if whole:
                pieces.append({"t": t, **values})
            else:
                columns.absorb(t, values)
            for plane, curve in zip(planes, curves, strict=True):
                x, y = (_difference(values, names) for names in plane)
                curve.absorb(x, y, self.all_stick[steps], np.diff(steps) <= 1)
        if whole:
            lines = {name: np.concatenate([p[name] for p in pieces]) for name in pieces[0]}
            return lines.pop("t"), lines, curves
        columns.absorb(motion.time, motion.at_knots)
        return *columns.lines(), curves

    def shown_planes(self) -> list[InPlane]:
        """Planar contacts whose paths and forces are plotted."""
        few = len(self.contacts) <= MANY_LINES
        return list(self.in_plane.values()) if few else []

    def sizes(self, values: Mapping[str, Array]) -> dict[str, Array]:
        """Sizes of the friction forces in planes, and their thresholds."""
        found: dict[str, Array] = {}
        for plane in self.shown_planes():
            found[f"size_{plane.key}"], found[f"bound_{plane.key}"] = plane.size(values)
        return found

    def squares(self) -> list[Callable[[Axes], None]]:
        """Panels at the right: paths and forces in planes, or phase planes."""
        if not self.in_plane:
            return [self.plane(*plane, curve) for plane, curve in self.recurrent()]
        curves = self.plane_curves
        paths = [partial(curves.draw_path, plane=plane) for plane in curves.paths()]
        forces = [partial(curves.draw_force, plane=plane) for plane in curves.planes]
        return [*paths, *forces]

    def draw(self) -> Figure:
        panels = self.panels()
        planes = self.squares()
        height = max(_ROW * len(panels) + _EXTRA, 3.6 if planes else 0.0)
        if self.in_plane:
            height = max(height, _SQUARE * len(planes))
        figure = self.figure = new_figure(_TIME_WIDTH + (_PLANE_WIDTH if planes else 0.0), height)
        figure.suptitle(self.system.title or self.system.name, x=0.01, ha="left", fontsize=13)
        columns = [_TIME_WIDTH, _PLANE_WIDTH] if planes else [_TIME_WIDTH]
        grid = figure.add_gridspec(1, len(columns), width_ratios=columns)
        left = grid[0].subgridspec(len(panels), 1)
        rows: list[Axes] = []
        for row, panel in enumerate(panels):
            rows.append(figure.add_subplot(left[row], sharex=rows[0] if rows else None))
            panel(rows[-1])
            rows[-1].tick_params(labelbottom=row == len(panels) - 1)
        if 1 < len(self.contacts) <= MANY_LINES:
            legend_above(
                rows[0], [Patch(color=STICK_SHADE, label="every contact sticks")], right=True
            )
        self.time_axis(rows[-1])
        if planes:
            right = grid[1].subgridspec(len(planes), 1)
            for row, plane in enumerate(planes):
                plane(figure.add_subplot(right[row]))
        figure.align_ylabels(rows)
        powers_in_labels(figure)
        return figure

    def time_axis(self, axes: Axes) -> None:
        unit = unit_label(self.system.time_unit)
        axes.set_xlabel("time $t$" + (f"  [{unit}]" if unit else ""))
        axes.set_xlim(self.t[0], self.t[-1] if self.t[-1] > self.t[0] else self.t[0] + 1.0)

    # Time traces.

    def panels(self) -> list[Callable[[Axes], None]]:
        """Panels from top to bottom."""
        d = self.declaration
        kinds = (self.inertial, d.viscous, d.rate_independent)
        groups = [g for kind in kinds for g in self.by_unit(self.these(kind))]
        velocities = self.by_unit([f"d_{q}" for q in self.these(self.inertial)])
        inside = self.these(d.internal)
        internal = (
            [[name] for name in inside] if len(inside) <= MANY_LINES else self.by_unit(inside)
        )
        panels = [self.trace(names) for names in groups]
        panels += [
            self.trace(names) if len(names) <= MANY_LINES else self.heat(names)
            for names in velocities
        ]
        panels += [self.trace(names) for names in internal]
        panels += [self.trace(names) for names in self.by_unit(self.these(self.system.outputs))]
        if len(self.contacts) > MANY_LINES:
            return [*panels, self.mode_map]
        return panels + [self.contact(name) for name in self.names]

    def contact(self, name: str) -> Callable[[Axes], None]:
        """Plot the panel of a contact: its friction, the force of a frictionless constraint, or a
        gap."""
        key = contact_key(name)
        if key in self.held:
            return self.holding(name)
        return self.friction(name) if self.is_held(key) else self.gap(name)

    def by_unit(self, names: list[str]) -> list[list[str]]:
        """Names in groups that share an axis."""
        groups: dict[str, list[str]] = {}
        for name in names:
            groups.setdefault(self.unit(name), []).append(name)
        return list(groups.values())

    def trace(self, names: list[str]) -> Callable[[Axes], None]:
        def panel(axes: Axes) -> None:
            if len(self.contacts) <= MANY_LINES:  # otherwise the map of the modes shows it
                self.shade(axes, self.all_stick)
            colours = line_colours(len(names))
            for name, colour in zip(names, colours, strict=True):
                self._line(axes, name, colour, self.alpha(len(names)))
            set_roomy_limits(axes, np.concatenate([self.values[name] for name in names]))
            if len(names) > 1:
                shown = [(names[i], colours[i]) for i in spread_out(len(names))]
                legend_above(
                    axes,
                    [Line2D([], [], color=colour, label=symbol(name)) for name, colour in shown],
                )
            axes.set_ylabel(label_of_several(names, self.unit(names[0])))

        return panel

    def _line(
        self, axes: Axes, name: str, colour: str, alpha: float = 1.0, zorder: float = 2
    ) -> None:
        """Plot a quantity over time, or its envelope if it oscillates within pixel columns."""
        values = self.values[name]
        if not self.whole:
            # four values per column
            columns = values.reshape(-1, 4)
            low, high = np.min(columns, axis=1), np.max(columns, axis=1)
            if np.median(high - low) > _SWINGS * np.ptp(values):
                t = np.mean(self.t.reshape(-1, 4), axis=1)
                inside = _INSIDE * alpha
                axes.fill_between(t, low, high, color=colour, lw=0, alpha=inside, zorder=zorder)
                for edge in (low, high):
                    axes.plot(t, edge, color=colour, lw=0.9, zorder=zorder)
                return
        axes.plot(self.t, values, color=colour, alpha=alpha, zorder=zorder)

    def alpha(self, lines: int) -> float:
        """Opacity: lines that oscillate within a column are areas, several of which may overlap."""
        return 1.0 if self.whole or lines == 1 else max(1.0 / lines, 0.25)

    def shade(self, axes: Axes, holds: Array) -> None:
        """Shade grey where a condition holds."""
        strip(axes, self.motion.time, {STICK_SHADE: holds}, transform=axes.get_xaxis_transform())

    def heat(self, names: list[str]) -> Callable[[Axes], None]:
        """Many velocities as a map: one row each."""

        def panel(axes: Axes) -> None:
            rows = np.array([self.values[name] for name in names])
            # Large initial speeds saturate, so that they do not hide the rest.
            largest = float(np.percentile(np.abs(rows), 97)) or float(np.max(np.abs(rows))) or 1.0
            begins = np.searchsorted(
                self.t, np.linspace(self.t[0], self.t[-1], COLUMNS, endpoint=False)
            )
            low, high = (
                extreme.reduceat(rows, begins, axis=1) for extreme in (np.minimum, np.maximum)
            )
            image = np.where(-low > high, low, high)
            extent = (self.t[0], self.t[-1], len(names) + 0.5, 0.5)
            drawn = axes.imshow(
                image,
                aspect="auto",
                extent=extent,
                cmap="RdBu_r",
                vmin=-largest,
                vmax=largest,
                interpolation="nearest",
            )
            unit = unit_label(self.unit(names[0]))
            label = "velocity" + (f"  [{unit}]" if unit else "")
            self.figure.colorbar(drawn, ax=axes, pad=0.01, aspect=8, extend="both", label=label)
            label_rows(axes, [symbol(name) for name in names])

        return panel

    def friction_in_plane(self, plane: InPlane) -> Callable[[Axes], None]:
        """Size of a friction force in a plane, and its threshold."""
        size, bound = (self.values[f"{what}_{plane.key}"] for what in ("size", "bound"))

        def panel(axes: Axes) -> None:
            self.shade(axes, self.modes[plane.key] == 0)
            axes.fill_between(self.t, 0.0, bound, color=BAND, lw=0, alpha=0.6, zorder=1)
            axes.plot(self.t, bound, color=THRESHOLD, lw=0.8, zorder=2)
            self._line(axes, f"size_{plane.key}", BLUE, zorder=3)
            set_roomy_limits(axes, np.concatenate([size, bound, [0.0]]))
            unit = unit_label(self.unit(f"friction_{plane.parts[0]}"))
            plain = plane.is_disc or plane.formula is not None
            said = r"$|\lambda|$" if plain else r"$|A^{-1}\lambda|$"
            said += f"  [{unit}]" if unit else ""
            axes.set_ylabel("fraction of the limit" if plane.turns else said)
            axes.set_title(plane.name)
            if plane is next(iter(self.in_plane.values())):
                self.explain(axes, "size of the friction force", "threshold")

        return panel

    def explain(self, axes: Axes, force: str, threshold: str) -> None:
        """The legend of friction forces."""
        marks = [
            Line2D([], [], color=BLUE, label=force),
            Patch(fc=BAND, ec=THRESHOLD, lw=0.8, label=threshold),
            Patch(color=STICK_SHADE, label="stick"),
        ]
        legend_above(axes, marks, right=True)

    def friction(self, name: str) -> Callable[[Axes], None]:
        """Friction force of one contact between its thresholds."""
        key = contact_key(name)
        if key in self.in_plane:
            return self.friction_in_plane(self.in_plane[key])
        force, plus, minus = (self.values[f"{kind}_{key}"] for kind in FORCES)

        def panel(axes: Axes) -> None:
            self.shade(axes, self.modes[key] == 0)
            # λ = −s⁺ slides forward, λ = s⁻ backward.
            axes.fill_between(self.t, -plus, minus, color=BAND, lw=0, alpha=0.6, zorder=1)
            for bound in (-plus, minus):
                axes.plot(self.t, bound, color=THRESHOLD, lw=0.8, zorder=2, alpha=self.alpha(3))
            self._line(axes, f"friction_{key}", BLUE, zorder=3)
            set_roomy_limits(axes, np.concatenate([force, -plus, minus]))
            unit = unit_label(self.unit(f"friction_{key}"))
            axes.set_ylabel(r"$\lambda$" + (f"  [{unit}]" if unit else ""))
            axes.set_title(name)
            held = (key for key in self.contacts if self.is_held(key) and key not in self.in_plane)
            if key == next(held):
                self.explain(axes, "friction force", "thresholds")

        return panel

    def holding(self, name: str) -> Callable[[Axes], None]:
        """Modulus of the force of a constraint."""
        quantity = f"normal_{contact_key(name)}"

        def panel(axes: Axes) -> None:
            self._line(axes, quantity, BLUE, zorder=3)
            set_roomy_limits(axes, self.values[quantity])
            unit = unit_label(self.unit(quantity))
            axes.set_ylabel(r"$|N|$" + (f"  [{unit}]" if unit else ""))
            axes.set_title(name)

        return panel

    def gap(self, name: str) -> Callable[[Axes], None]:
        """Gap of a contact that can open, and where it is closed."""
        key = contact_key(name)

        def panel(axes: Axes) -> None:
            self.shade(axes, self.modes[key] != IS_OPEN)
            struck = self.struck(key)
            axes.plot(struck, np.zeros(len(struck)), "o", ms=3.5, mfc="white", mec=VERMILION)
            self._line(axes, f"gap_{key}", BLUE, zorder=3)
            set_roomy_limits(axes, self.values[f"gap_{key}"])
            unit = unit_label(self.unit(f"gap_{key}"))
            axes.set_ylabel(r"$g$" + (f"  [{unit}]" if unit else ""))
            axes.set_title(name)
            if key == next(key for key in self.opening if not self.is_held(key)):
                marks = [
                    Line2D([], [], color=BLUE, label="gap"),
                    Patch(color=STICK_SHADE, label="closed"),
                ]
                if any(len(self.struck(k)) for k in self.opening):
                    mark = Line2D([], [], ls="", marker="o", ms=3.5, mfc="white", mec=VERMILION)
                    mark.set_label("impact")
                    marks.append(mark)
                legend_above(axes, marks, right=True)

        return panel

    def struck(self, key: str) -> Array:
        """Times of the impacts of a contact within the plotted interval; none if there are too many
        to mark."""
        impacts = self.trajectory.impacts
        times = np.asarray(impacts["time"])[np.asarray(impacts["contact"]) == key]
        shown = (times >= self.motion.time[0]) & (times <= self.motion.time[-1])
        return times[shown] if np.count_nonzero(shown) <= _MARKED else times[:0]

    def mode_map(self, axes: Axes) -> None:
        """Stick phases over time: one row per contact, empty while it is open."""
        for row, key in enumerate(self.contacts, start=1):
            phases = {
                colour: self.modes[key] == mode
                for mode, colour in ((0, STICK_SHADE), (IS_CLOSED, BAND), *SLIP.items())
            }
            strip(axes, self.motion.time, phases, row - 0.42, row + 0.42)
        axes.set_ylim(len(self.contacts) + 0.5, 0.5)
        label_rows(axes, self.names)
        shown = [(STICK_SHADE, "stick"), (SLIP[1], "slip +"), (SLIP[-1], "slip −")]
        if len(self.in_plane) == len(self.contacts):
            shown[1:] = [(SLIP[1], "slip")]
        if any(np.any(mode == IS_CLOSED) for mode in self.modes.values()):
            shown.append((BAND, "closed"))
        legend_above(axes, [Patch(color=colour, label=label) for colour, label in shown])

    # Phase planes.

    def planes(self) -> list[tuple[list[str], list[str]]]:
        """Informative phase planes: (x, ẋ) of few inertial coordinates, or the two variables of a
        planar system.

        Each axis is a component of the state or the difference of two.
        """
        d = self.declaration
        planes: list[tuple[list[str], list[str]]] = []
        if 1 <= len(self.inertial) <= 2:
            planes += [([q], [f"d_{q}"]) for q in self.inertial]
        elif len(d.state) == 2:
            planes.append(([d.state[0]], [d.state[1]]))
        relative = [x for x, weight in self.system.translation.items() if weight == 1.0]
        others = [x for x in d.coordinates if x not in relative]
        # Two feet and one more coordinate: the distance of the feet is a hysteresis operator of the
        # latter.
        if (
            len(relative) == len(self.system.translation) == 2
            and len(others) == 1
            and self.same_unit(relative)
        ):
            planes.append((others, relative))
        return [
            (across, up)
            for across, up in planes
            if self.shown.issuperset(x.removeprefix("d_") for x in (*across, *up))
        ]

    def recurrent(self) -> Iterator[tuple[tuple[list[str], list[str]], Curve]]:
        """The planes whose variables recur; a plane of a monotone variable would repeat its time
        trace."""
        for plane, curve in zip(self.planes(), self.curves, strict=True):
            across, up = plane
            asked = across if up == [f"d_{across[0]}"] else plane
            if len(up) == 2 or all(self.returns(name) for name in np.ravel(asked)):
                yield plane, curve

    def returns(self, name: str) -> bool:
        steps = np.diff(self.values[name])
        noise = 1e-9 * float(np.ptp(self.values[name]))
        return bool(np.any(steps > noise) and np.any(steps < -noise))

    def same_unit(self, names: list[str]) -> bool:
        return len({self.unit(name) for name in names}) == 1

    def plane(self, across: list[str], up: list[str], curve: Curve) -> Callable[[Axes], None]:
        """A plane of two quantities, each a variable or the difference of two."""

        rubbing = any(map(self.has_friction, self.contacts))

        def panel(axes: Axes) -> None:
            x, y, sticking = curve.points()
            moving = np.where(sticking, np.nan, y)
            axes.plot(x, moving, color=BLUE, lw=1.3, label="slip" if rubbing else None)
            if rubbing:
                label = "stick" if len(self.contacts) == 1 else "all stick"
                width = 2.2 if np.count_nonzero(np.diff(self.all_stick)) <= 40 else 1.4
                axes.plot(
                    x,
                    np.where(sticking, y, np.nan),
                    color=STICK_LINE,
                    lw=width,
                    label=label,
                    zorder=3,
                )
                axes.plot(*curve.spots(), ".", color=STICK_LINE, ms=4.5, zorder=3)
            start = [_difference(self.motion.at_knots, names)[:1] for names in (across, up)]
            axes.plot(*start, "o", ms=6, mfc="white", mec=STICK_LINE, zorder=4, label="start")
            axes.set_xlabel(self.quantity_label(across))
            axes.set_ylabel(self.quantity_label(up))
            set_roomy_limits(axes, y)
            axes.margins(x=0.05)
            axes.set_box_aspect(0.9)
            axes.set_anchor("N")
            legend_above(axes)

        return panel

    def quantity_label(self, names: list[str]) -> str:
        label = axis_label(names, self.unit(names[0]))
        return label.replace("$, $", " - ") if len(names) == 2 else label


def _difference(values: Mapping[str, Array], names: list[str]) -> Array:
    """A quantity, or its difference from a second one."""
    return values[names[0]] - values[names[1]] if len(names) == 2 else values[names[0]]
