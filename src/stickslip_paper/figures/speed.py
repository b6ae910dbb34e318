"""Speed of the walking toy (4.2) against its pull."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import stickslip as ss
from stickslip_paper.drawing.entry import FigureEntry


def draw() -> Figure:
    """Plot the speed of the toy over the pull; below the interval it comes to rest, above it
    slides."""
    toy = ss.catalogue.rocking_toy()
    smallest = smallest_pull(toy, 0.5, 0.8)
    sliding = toy.values["rho"] + toy.values["H_star"] / 2
    pulls = np.append(np.linspace(smallest, 1.5628, 25), np.linspace(1.563, sliding - 1e-3, 4))
    speeds = [walking_speed(toy, P) for P in pulls.tolist()]
    with ss.style.paper_style():
        figure = ss.style.new_figure(7.2, 3.8)
        axes = figure.add_subplot(xlim=(0.4, 1.95), ylim=(-0.012, 0.42))
        axes.axvspan(sliding, 1.95, color=ss.style.BAND, lw=0)
        axes.plot([0.4, sliding], [0.0, 0.0], color=ss.style.STICK_LINE, lw=2.2)
        axes.plot(pulls, speeds, color=ss.style.BLUE, lw=2.2, gid="walking")
        axes.plot(smallest, speeds[0], "o", color=ss.style.BLUE, ms=6.5)
        _name_the_parts(axes, smallest, sliding)
    return figure


def walking_speed(toy: ss.System, P: float) -> float:
    """Stride over period [m/s] of the motion that a large rocking settles to; 0 if it comes to
    rest."""
    start = {"psi": -1.67, "x_R": P - 0.7}
    settled = ss.simulate(toy, (0.0, 2000.0), initial=start, parameters={"P": P})
    if settled.outcome is ss.Outcome.AT_REST:
        return 0.0
    motion = ss.simulate(toy, (0.0, 20.0), initial=settled.final, parameters={"P": P})
    steps = motion.events.query("contact == 'left leg' and to == 'slip+'")
    return float(np.diff(steps["x_L"])[0] / np.diff(steps["time"])[0])


def smallest_pull(toy: ss.System, low: float, high: float) -> float:
    """The smallest P that walks, by bisection."""
    while high - low > 1e-5:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if walking_speed(toy, middle) > 0.0 else (middle, high)
    return high


def _name_the_parts(axes: Axes, smallest: float, sliding: float) -> None:
    """Label the intervals of the pull by the behaviour of the toy."""
    axes.annotate(
        f"smallest pull\nthat walks:\n$P$ = {smallest:.4f} N",
        (smallest, 0.037),
        (0.43, 0.13),
        color=ss.style.BLUE,
        arrowprops={"arrowstyle": "-", "color": ss.style.BLUE, "lw": 0.8},
    )
    axes.text(
        1.05, 0.215, "walks", color=ss.style.BLUE, rotation=31, rotation_mode="anchor", fontsize=13
    )
    axes.text(1.1, 0.012, "rests, unless it is rocking", ha="center")
    axes.text(
        0.5 * (sliding + 1.95), 0.2, "slides:\n$P \\geq$\n$\\rho + H_*/2$", ha="center", va="center"
    )
    axes.set_xlabel("pull on each leg $P$  [N]")
    axes.set_ylabel("walking speed $v$  [m/s]")


ENTRY = FigureEntry(
    "speed",
    "Walking speed against the pull",
    "The simplified toy (4.2) with I_b = 1 kg m², a = 1 N/m, b = 1 N m, c = 0.3 N, ρ = 0.2 N, "
    "ψ* = 1, H* = 3 N and δ = 0.04 N m s. Every point is a settled motion, v its stride over its "
    "period. Rocking, the toy walks from P = 0.6166 N on, a little more than a third of the pull "
    "ρ + H*/2 = 1.7 N that is needed for sliding without rocking (section 4.2, for v → 0). In "
    "simple walking v = 2X/T with X = (P − ρ − cψ*)/a. From P = 1.563 N on the rocking stays below "
    "ψ*, where (4.2) is homogeneous of degree 1 in ρ + H*/2 − P: the period stays the same, and "
    "amplitude and speed fall to 0. Rest coexists with walking.",
    draw,
)
