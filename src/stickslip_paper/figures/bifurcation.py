"""The bifurcation diagram of the spring slider (3.3), with stick-slip that coexists with steady
sliding."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy import ndarray as Array

import stickslip as ss
from stickslip_paper.drawing.entry import FigureEntry
from stickslip_paper.drawing.style import arrow

_SPEEDS = np.union1d(np.linspace(0.04, 0.4, 13), np.linspace(0.2225, 0.2285, 25))
_DASHES = (0, (4, 2))
_CYCLES, _HOPF = ss.style.LINES[2], ss.style.LINES[4]


def draw() -> Figure:
    """Plot steady sliding with its Hopf point, and the range of U of the motion for increasing and
    decreasing V."""
    slider = ss.catalogue.spring_slider(mu="2/sqrt(alpha)", nu=0.05)
    steady = ss.continue_equilibrium(slider, "V", (0.02, 0.4))
    hopf = steady.of_kind("Hopf")[0]
    cycles = ss.continue_cycle(ss.find_cycle(slider, hopf), "V", (0.02, 0.4))
    sweeps = {
        "$V$ rising": sweep(slider, _SPEEDS),
        "$V$ falling": sweep(slider, _SPEEDS[::-1])[::-1],
    }
    with ss.style.paper_style():
        figure = ss.style.new_figure(7.2, 4.4)
        axes = figure.add_subplot(xlim=(0.0, 0.4))
        zoom = axes.inset_axes((0.66, 0.52, 0.34, 0.48), xlim=(0.2235, 0.2280), ylim=(1.615, 1.83))
        for panel in (axes, zoom):
            _draw_branch(panel, steady, "U", ss.style.STICK_LINE, "steady sliding")
            _draw_branch(panel, cycles, "max_U", _CYCLES, "cycles")
            _draw_branch(panel, cycles, "min_U", _CYCLES, "")
            point = {"color": _HOPF, "ms": 7, "zorder": 5, "label": "Hopf point"}
            panel.plot(hopf.value, hopf.state["U"], "s", **point)
            fold = cycles.of_kind("fold")[0]
            ends = [float(cycles.points[key][fold.index]) for key in ("min_U", "max_U")]
            turn = "stick onset and fold"
            panel.plot(
                [fold.value] * 2,
                ends,
                "o",
                mfc="white",
                mec=_CYCLES,
                ms=6,
                zorder=5,
                label=turn,
            )
            _draw_sweeps(panel, sweeps)
        _finish(axes, zoom, hopf.value)
    return figure


def sweep(slider: ss.System, speeds: Array) -> Array:
    """Least and largest U after settling, V by V, each from where the last one ended; shape
    (len(speeds), 2)."""
    state = {"U": 1.5, "alpha": 1.5}
    extent = []
    for V in speeds.tolist():
        state = ss.simulate(slider, (0.0, 1000.0), initial=state, parameters={"V": V}).final
        U = ss.simulate(slider, (0.0, 25.0), initial=state, parameters={"V": V}).at(
            np.linspace(0.0, 25.0, 2501)
        )["U"]
        extent.append((U.min(), U.max()))
    return np.array(extent)


def _draw_branch(axes: Axes, branch: ss.Branch, name: str, colour: str, label: str) -> None:
    """Stable points solid, unstable ones dashed; both stretches end at the point where they
    meet."""
    V, values, stable = (branch.points[key].values for key in ("V", name, "stable"))
    meet = np.isin(
        np.arange(len(V)),
        [point.index for kind in ("Hopf", "fold") for point in branch.of_kind(kind)],
    )
    axes.plot(np.where((stable == 1) | meet, V, np.nan), values, color=colour, label=label)
    axes.plot(np.where((stable != 1) | meet, V, np.nan), values, color=colour, ls=_DASHES)


def _draw_sweeps(axes: Axes, sweeps: dict[str, Array]) -> None:
    """Both ends of U as triangles that point with V."""
    for (label, extent), marker, colour, size in zip(
        sweeps.items(), (">", "<"), (ss.style.BLUE, ss.style.VERMILION), (5.0, 3.2), strict=True
    ):
        for j in range(2):
            axes.plot(
                _SPEEDS,
                extent[:, j],
                marker,
                color=colour,
                ms=size,
                label=label if j else None,
                gid=label,
            )


def _finish(axes: Axes, zoom: Axes, hopf: float) -> None:
    """Labels, and the two jumps in the enlarged part."""
    axes.set_xlabel("rate of the load $V$")
    axes.set_ylabel("stretch $U$, least and largest")
    axes.indicate_inset_zoom(zoom, edgecolor=ss.style.STICK_LINE)
    zoom.tick_params(labelsize=9)
    for end in (1.645, 1.785):
        arrow(zoom, (hopf - 1.2e-4, 1.71), (hopf - 1.2e-4, end), ss.style.VERMILION, width=1.0)
        arrow(zoom, (0.22638, 3.43 - end), (0.22638, 1.71), ss.style.BLUE, width=1.0)
    axes.legend(loc="lower left", bbox_to_anchor=(0.04, 0.16))


ENTRY = FigureEntry(
    "bifurcation",
    "Steady sliding and stick-slip",
    "What the spring slider (3.3) does at constant V, with μ̃(α) = 2/√α, ν = 0.05, k = α₀ = 1; "
    "dashed: unstable. The unique equilibrium U* = μ̃(α*) + νV loses its stability at the Hopf "
    "point V = 0.22485, where trace DF = 0. The bifurcation is subcritical (first Lyapunov "
    "coefficient 2.345 > 0): small unstable cycles without stick emerge there; they begin to "
    "stick at V = 0.2263815 and turn into stable stick-slip in a fold at V = 0.2263881. Triangles: "
    "least and largest U of the settled motion while V rises (▸) and falls (◂) in small steps: "
    "sliding gives way to stick-slip of finite size at once, and in between both are stable. "
    "Theorem 3.1 gives a cycle wherever the equilibrium is unstable.",
    draw,
)
