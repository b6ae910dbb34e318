"""Phase portraits: motions, cycles, equilibria, lines at which the law switches, and regions of
stick."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from stickslip.arrays import Array
from stickslip.equations.derive import MotionEquations, derive
from stickslip.equations.field import Region
from stickslip.equations.mode_fields import mode_field
from stickslip.errors import DeclarationError
from stickslip.figures.drawing.style import (
    BLUE,
    STICK_LINE,
    STICK_SHADE,
    THRESHOLD,
    VERMILION,
    axis_label,
    new_figure,
    paper_style,
)
from stickslip.model.entries.declared import Kind
from stickslip.model.quantities import quantity
from stickslip.model.system import System
from stickslip.motion.problem import checked_values
from stickslip.motion.simulate import simulate
from stickslip.orbits.equilibria.equilibrium import Equilibrium
from stickslip.orbits.equilibria.finding import equilibria
from stickslip.orbits.fields.regions import values_at

if TYPE_CHECKING:
    from stickslip.orbits.cycles.cycle import Cycle
    from stickslip.symbolic.expressions import Expr

_GRID = 301
_SAMPLES = 600
_FAINT = "#A8A8A8"
_EQUILIBRIA = {
    True: ("stable", STICK_LINE),
    False: ("unstable", "white"),
    None: ("undecided", _FAINT),
}


def plot_phase_portrait(
    system: System,
    over: Mapping[str, tuple[float, float]],
    parameters: Mapping[str, float] | None = None,
    *,
    cycles: Sequence[Cycle] = (),
    starts: int = 5,
    span: float | None = None,
) -> Figure:
    """The phase plane of a system with two states.

    Parameters
    ----------
    system : System
        With two states, which does not depend on time.
    over : mapping of str to (low, high)
        The part of the plane, the horizontal axis first.
    parameters : mapping of str to float, optional
        Values that replace the defaults.
    cycles : sequence of Cycle
        Drawn solid if stable, else dashed.
    starts : int
        Motions begin at so many times so many states.
    span : float, optional
        How long they are followed; by default a tenth of the declared span.

    Raises
    ------
    DeclarationError
        If an argument is wrong, or the system has no phase plane.
    """
    return _Portrait(system, over, parameters, cycles).draw(starts, span)


class _Portrait:
    def __init__(
        self,
        system: System,
        over: Mapping[str, tuple[float, float]],
        parameters: Mapping[str, float] | None,
        cycles: Sequence[Cycle],
    ) -> None:
        self.system = system
        self.cycles = cycles
        self.values = checked_values(system, parameters)
        self.equations: MotionEquations = derive(system.declaration)
        state = system.declaration.state
        if len(state) != 2 or self.equations.timed:
            raise DeclarationError(
                system.name,
                "the system has no phase plane",
                "Use a system with two states that does not depend on time",
            )
        if sorted(over) != sorted(state):
            raise DeclarationError(
                "over",
                f"the ranges of {', '.join(state)} are missing",
                "Give {name: (low, high)} for both",
            )
        (self.across, x), (self.up, y) = over.items()
        self.x, self.y = (np.linspace(float(low), float(high), _GRID) for low, high in (x, y))

    def draw(self, starts: int, span: float | None) -> Figure:
        with paper_style():
            figure = new_figure(5.6, 4.6)
            axes = figure.add_subplot()
            handles = [*self.sticking(axes), *self.kinks(axes)]
            begin, end = self.system.span
            self.motions(axes, starts, span or 0.1 * (end - begin))
            handles += [*self.orbits(axes), *self.steady(axes)]
            axes.set_xlim(self.x[0], self.x[-1])
            axes.set_ylim(self.y[0], self.y[-1])
            for name, label in ((self.across, axes.set_xlabel), (self.up, axes.set_ylabel)):
                label(axis_label([name], quantity(self.system, name).get("units", "")))
            figure.legend(handles=handles, loc="outside upper left", ncols=3)
        return figure

    def grid(self, expressions) -> Array:
        """Values of expressions over the plane, shape (expressions, y, x)."""
        x, y = (a.ravel() for a in np.meshgrid(self.x, self.y))
        columns = {self.across: x, self.up: y}
        states = np.column_stack([columns[name] for name in self.system.declaration.state])
        return values_at(self.equations, self.values, states, expressions).reshape(-1, _GRID, _GRID)

    def sticking(self, axes: Axes) -> list[Patch | Line2D]:
        """The states of stick: a region or, with inertia, a part of the line of zero velocity."""
        contacts = self.equations.contacts
        n = len(self.equations.contacts)
        if not n:
            return []

        def held(region: Region) -> list[Expr]:
            field = mode_field(self.equations, (0,) * n, region)
            return [e for c in field.contacts for e in (c.force + c.plus, c.minus - c.force, c.u)]

        found = self.grid(held).reshape(n, 3, _GRID, _GRID)
        shown: list[Patch | Line2D] = []
        for contact, (above, below, u) in zip(contacts, found, strict=True):
            margin = np.minimum(above, below)
            if contact.kind == Kind.INERTIAL:
                axes.contour(self.x, self.y, u, [0.0], colors=THRESHOLD, linewidths=0.9)
                axes.contour(
                    self.x,
                    self.y,
                    np.where(margin >= 0.0, u, np.nan),
                    [0.0],
                    colors=STICK_LINE,
                    linewidths=3,
                )
                shown.append(Line2D([], [], color=STICK_LINE, lw=3, label="stick"))
            else:
                axes.contourf(self.x, self.y, margin, [0.0, np.inf], colors=[STICK_SHADE])
                axes.contour(self.x, self.y, margin, [0.0], colors=THRESHOLD, linewidths=0.9)
                shown.append(Patch(fc=STICK_SHADE, ec=THRESHOLD, lw=0.9, label="stick"))
        return shown[:1]

    def kinks(self, axes: Axes) -> list[Line2D]:
        """Lines at which a formula switches."""
        drawn = False
        for values in self.grid(self.equations.kinks) if self.equations.kinks else ():
            if np.min(values) < 0.0 < np.max(values):
                axes.contour(
                    self.x,
                    self.y,
                    values,
                    [0.0],
                    colors=THRESHOLD,
                    linewidths=0.9,
                    linestyles="dashed",
                )
                drawn = True
        return (
            [Line2D([], [], color=THRESHOLD, lw=0.9, ls="--", label="switching line")]
            if drawn
            else []
        )

    def motions(self, axes: Axes, starts: int, span: float) -> None:
        """Some motions, with an arrow each."""
        begin = self.system.span[0]
        fractions = (np.arange(starts) + 0.5) / starts
        for x in self.x[0] + fractions * np.ptp(self.x):
            for y in self.y[0] + fractions * np.ptp(self.y):
                motion = simulate(
                    self.system,
                    (begin, begin + span),
                    initial={self.across: x, self.up: y},
                    parameters=self.values,
                )
                end = motion.knots.time[-1]
                if end > begin:
                    t = np.union1d(np.linspace(begin, end, _SAMPLES), motion.knots.time)
                    values = motion.at(t)
                    self.arrowed(axes, values[self.across], values[self.up])

    def arrowed(self, axes: Axes, x: Array, y: Array) -> None:
        """A line with an arrow slightly after its start."""
        axes.plot(x, y, color=_FAINT, lw=0.7, zorder=1.5)
        length = np.cumsum(np.hypot(np.diff(x) / np.ptp(self.x), np.diff(y) / np.ptp(self.y)))
        at = int(np.searchsorted(length, min(0.05, 0.5 * length[-1])))
        if length[-1] > 0.02 and at + 1 < len(x):
            style = {
                "arrowstyle": "-|>",
                "color": _FAINT,
                "lw": 0.7,
                "mutation_scale": 8,
                "shrinkA": 0,
                "shrinkB": 0,
            }
            axes.annotate(
                "",
                (x[at + 1], y[at + 1]),
                (x[at], y[at]),
                arrowprops=style,
                zorder=1.6,
                annotation_clip=True,
            )

    def orbits(self, axes: Axes) -> list[Line2D]:
        """The cycles."""
        shown = {}
        for cycle in self.cycles:
            k = cycle.trajectory.knots
            values = cycle.trajectory.at(
                np.union1d(np.linspace(k.time[0], k.time[-1], _SAMPLES), k.time)
            )
            style = (
                (BLUE, "-", "stable cycle")
                if cycle.stable
                else (VERMILION, (0, (4, 2)), "unstable cycle")
            )
            (line,) = axes.plot(
                values[self.across],
                values[self.up],
                color=style[0],
                ls=style[1],
                lw=1.9,
                label=style[2],
                zorder=3,
            )
            shown[style[2]] = line
        return list(shown.values())

    def steady(self, axes: Axes) -> list[Line2D]:
        """Isolated equilibria: full if stable, grey if linearisation does not decide."""
        shown = {}
        for e in equilibria(self.system, parameters=self.values):
            if not isinstance(e, Equilibrium):
                continue
            verdict, fill = _EQUILIBRIA[e.stable]
            name = f"{verdict} equilibrium"
            place = e.state[self.across], e.state[self.up]
            (shown[name],) = axes.plot(
                *place, "o", mfc=fill, mec=STICK_LINE, ms=6, zorder=4, ls="none", label=name
            )
        return list(shown.values())
