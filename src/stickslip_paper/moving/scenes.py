"""Drawings with moving parts: the walking toy and the plate compactor, with colours for stick and
slip."""

from __future__ import annotations

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.patches import Patch
from numpy import ndarray as Array

import stickslip as ss
from stickslip_paper.drawing.parts import (
    STICK,
    Scene,
    by_mode,
    modes,
    moving_disc,
    moving_line,
    part,
    shoe,
)
from stickslip_paper.drawing.sketch import BODY, canvas, ground, rounded, spring_line, turned
from stickslip_paper.drawing.style import arrow
from stickslip_paper.figures.figure_4_1 import FAR, leg, trunk

# -- the walking toy -------------------------------------------------------------------------------


def toy_scene(frames: int = 140) -> Scene:
    """Two periods of settled walking: the toy from the side and from behind, and its traces."""
    toy = ss.catalogue.rocking_toy()
    settled = ss.simulate(toy, (0.0, 1000.0), initial={"psi": -1.67, "x_R": 0.5}).final
    motion = ss.simulate(toy, (0.0, 12.0), initial=settled)
    # two periods of 5.969 s
    times = np.linspace(0.0, 11.938, 2400)
    t = np.linspace(0.0, 11.938, frames)
    traces, now = motion.at(times), motion.at(t)
    for name in ("x_R", "x_L"):
        traces[name], now[name] = traces[name] - settled["x_R"], now[name] - settled["x_R"]
    figure = ss.style.new_figure(6.4, 4.8)
    side, behind, angle, legs = figure.subplot_mosaic(
        [["side", "behind"], ["angle", "angle"], ["legs", "legs"]],
        width_ratios=[6.4, 2.4],
        height_ratios=[3, 1, 1.4],
    ).values()
    parts = (_Side(side, now), _Behind(behind, now))
    angle.plot(times, traces["psi"], color=ss.style.STICK_LINE, lw=1.2)
    angle.set_ylabel(r"$\psi$  [rad]", fontsize=11)
    angle.tick_params(labelbottom=False)
    for name, key in _FEET.items():
        by_mode(legs, times, traces[f"x_{name}"], traces[f"mode_{key}"])
        legs.text(t[-1] + 0.1, now[f"x_{name}"][-1], f"$x_{name}$", va="center")
    legs.set_ylabel("$x_R$, $x_L$  [m]", fontsize=11)
    legs.set_xlabel("time $t$  [s]", fontsize=11)
    ss.style.legend_above(angle, modes())
    for axes in (angle, legs):
        axes.set_xlim(0.0, t[-1])
    cursors = [axes.axvline(0.0, color=ss.style.THRESHOLD, lw=1.2) for axes in (angle, legs)]

    def place(i: int) -> None:
        for view in parts:
            view.place(i)
        for cursor in cursors:
            cursor.set_xdata([t[i], t[i]])

    return Scene(figure, [*parts[0].moving, *parts[1].moving, *cursors], place, frames)


_FEET = {"R": "right_leg", "L": "left_leg"}


def _lift(psi: Array, side: str) -> Array:
    """Height of a foot in the drawing; the model has none."""
    return 0.14 * np.clip(-psi if side == "R" else psi, 0.0, 1.5)


class _Side:
    """The toy from the side: two pairs of legs, feet coloured by mode."""

    def __init__(self, axes: Axes, now: dict[str, Array]) -> None:
        canvas(axes, (-1.7, 4.5), (-0.35, 2.8))
        ground(axes, (-1.7, 0.0), (4.5, 0.0), spacing=0.25)
        origin = 0.5 * (now["x_R"][0] + now["x_L"][0])
        self.x = {side: now[f"x_{side}"] - origin for side in _FEET}
        self.modes = {side: now[f"mode_{key}"] for side, key in _FEET.items()}
        self.psi = now["psi"]
        self.trunk = trunk() - (2.3, 0.0)
        self.body = part(axes, self.trunk)
        self.eye = moving_disc(axes, (0.0, 2.28), 0.05, ss.style.STICK_LINE)
        self.legs = {
            (side, hip): part(axes, self.trunk, face)
            for side, face in (("L", FAR), ("R", "white"))
            for hip in (-0.8, 0.8)
        }
        self.feet = {key: part(axes, self.trunk, STICK, 0.0) for key in self.legs}
        far = [part[key] for part in (self.legs, self.feet) for key in part if key[0] == "L"]
        near = [part[key] for part in (self.legs, self.feet) for key in part if key[0] == "R"]
        self.moving: list[Artist] = [*far, self.body, self.eye, *near]

    def place(self, i: int) -> None:
        """Put everything where it is in frame i."""
        middle = 0.5 * (self.x["R"][i] + self.x["L"][i])
        self.body.set_xy(self.trunk + np.array([middle, 0.0]))
        self.eye.set_center((middle + 1.68, 2.28))
        for (side, hip), patch in self.legs.items():
            foot = np.array([self.x[side][i] + hip, _lift(self.psi[i], side)])
            patch.set_xy(leg(foot, (middle + hip, 1.15)))
            sole = np.array(
                [(-0.2, -0.02), (0.34, -0.02), (0.34, 0.12), (0.1, 0.22), (-0.17, 0.22)]
            )
            shoe(self.feet[side, hip], foot + sole, int(self.modes[side][i]))


class _Behind:
    """The toy from behind: it stands on the right leg while ψ > 0."""

    def __init__(self, axes: Axes, now: dict[str, Array]) -> None:
        canvas(axes, (-1.2, 1.2), (-0.35, 2.8))
        ground(axes, (-1.2, 0.0), (1.2, 0.0), spacing=0.25)
        self.psi = now["psi"]
        self.modes = {side: now[f"mode_{key}"] for side, key in _FEET.items()}
        self.outlines = {
            "R": _column(0.4),
            "L": _column(-0.4),
            "body": rounded(
                np.array(
                    [(-0.7, 0.95), (-0.7, 2.0), (0.0, 2.25), (0.7, 2.0), (0.7, 0.95), (0.0, 0.8)]
                )
            ),
        }
        faces = {"R": "white", "L": FAR, "body": BODY}
        self.parts = {
            name: part(axes, points, faces[name]) for name, points in self.outlines.items()
        }
        self.feet = {side: part(axes, self.outlines[side], STICK, 0.0) for side in "RL"}
        self.moving: list[Artist] = [
            self.parts["R"],
            self.parts["L"],
            *self.feet.values(),
            self.parts["body"],
        ]

    def place(self, i: int) -> None:
        """Tilt about the stance foot."""
        foot = (0.4 if self.psi[i] > 0.0 else -0.4, 0.0)
        for name, patch in self.parts.items():
            patch.set_xy(turned(self.outlines[name], -0.1 * self.psi[i], foot, foot))
        for side, patch in self.feet.items():
            at = 0.4 if side == "R" else -0.4
            sole = np.array(
                [(at - 0.16, -0.02), (at + 0.16, -0.02), (at + 0.16, 0.2), (at - 0.16, 0.2)]
            )
            shoe(patch, turned(sole, -0.1 * self.psi[i], foot, foot), int(self.modes[side][i]))


def _column(x: float) -> Array:
    return np.array([(x - 0.14, 0.0), (x - 0.14, 1.2), (x + 0.14, 1.2), (x + 0.14, 0.0)])


# -- the plate compactor ---------------------------------------------------------------------------


def compactor_scene(frames: int = 140) -> Scene:
    """The plate with its imbalance and spring, and the forces."""
    turns, settling = 6, 400
    system = ss.catalogue.plate_compactor(F=800.0, V=0.005)
    value = system.values
    period = 2 * np.pi / value["Omega"]
    smallest = value["mu"] * (value["m"] * value["g"] - value["F"])
    motion = ss.simulate(system, (0.0, settling * period), initial={"x": -smallest / value["k"]})
    start = (settling - turns) * period
    end = settling * period
    times = np.linspace(start, end, 2400)
    t = np.linspace(start, end, frames)
    traces, now = motion.at(times), motion.at(t)
    figure = ss.style.new_figure(6.4, 4.5)
    machine, trace = figure.subplots(2, 1, height_ratios=[3, 2])
    parts = _Machine(machine, now, value["Omega"] * (t - start))
    s = (times - start) / period
    force = value["k"] * (value["V"] * times - traces["x"])
    trace.fill_between(
        s, 0.0, traces["threshold_plus_ground"], fc=ss.style.BAND, ec=ss.style.THRESHOLD, lw=0.8
    )
    by_mode(trace, s, force, traces["mode_ground"])
    trace.set_xlim(0.0, turns)
    trace.set_ylim(0.0, 1100.0)
    trace.set_xlabel("turns of the imbalance", fontsize=11)
    trace.set_ylabel("force  [N]", fontsize=11)
    ss.style.legend_above(
        trace,
        [
            Patch(fc=ss.style.BAND, ec=ss.style.THRESHOLD, label=r"threshold $\mu N(t)$"),
            *modes("spring force, stick", "spring force, slip"),
        ],
    )
    s = (t - start) / period
    cursor = trace.axvline(0.0, color=ss.style.THRESHOLD, lw=1.2)

    def place(i: int) -> None:
        parts.place(i)
        cursor.set_xdata([s[i], s[i]])

    return Scene(figure, [*parts.moving, cursor], place, frames)


class _Machine:
    """The plate compactor from the side; horizontal displacements are drawn at 2.5 mm per unit of
    the drawing."""

    def __init__(self, axes: Axes, now: dict[str, Array], phase: Array) -> None:
        canvas(axes, (-0.4, 7.4), (-0.5, 2.2))
        ground(axes, (-0.4, 0.0), (7.4, 0.0))
        for mm in range(4):
            axes.plot([1.15 + 0.4 * mm] * 2, [-0.32, -0.2], color=ss.style.STICK_LINE, lw=0.8)
            axes.text(1.15 + 0.4 * mm, -0.46, f"{mm}", ha="center", va="center", fontsize=9)
        axes.text(2.65, -0.46, "mm", va="center", fontsize=9)
        self.moved = 400.0 * (now["x"] - now["x"][0])
        self.phase = phase
        self.modes = now["mode_ground"]
        self.length = 1.2 * now["threshold_plus_ground"] / now["threshold_plus_ground"].max()
        sole = np.array(
            [(0.9, 0.45), (1.15, 0.05), (3.65, 0.05), (3.9, 0.45), (3.65, 0.3), (1.15, 0.3)]
        )
        self.outlines = [sole, np.array([(1.5, 0.3), (1.5, 1.8), (3.3, 1.8), (3.3, 0.3)])]
        self.plate = [part(axes, points) for points in self.outlines]
        self.sole = part(axes, sole, STICK, 0.0)
        self.wheel = moving_disc(axes, (0.0, 1.05), 0.6, "white")
        self.arm = moving_line(axes, 1.4)
        self.mass = moving_disc(axes, (0.0, 0.0), 0.12, ss.style.STICK_LINE)
        self.spring = moving_line(axes)
        self.press = arrow(axes, (0.0, 1.0), (0.0, 0.0), ss.style.THRESHOLD)
        axes.text(0.3, 1.5, "$N(t)$", ha="center", color=ss.style.THRESHOLD, fontsize=13)
        self.moving: list[Artist] = [
            self.spring,
            *self.plate,
            self.sole,
            self.wheel,
            self.arm,
            self.mass,
            self.press,
        ]

    def place(self, i: int) -> None:
        """Put everything where it is in frame i."""
        x = self.moved[i]
        for patch, outline in zip(self.plate, self.outlines, strict=True):
            patch.set_xy(outline + np.array([x, 0.0]))
        sole = np.array([(1.15, 0.0), (3.65, 0.0), (3.65, 0.12), (1.15, 0.12)])
        shoe(self.sole, sole + np.array([x, 0.0]), int(self.modes[i]))
        centre = np.array([2.4 + x, 1.05])
        mass = centre + 0.42 * np.array([np.sin(self.phase[i]), -np.cos(self.phase[i])])
        self.wheel.set_center(tuple(centre))
        self.mass.set_center(tuple(mass))
        self.arm.set_data(*np.array([centre, mass]).T)
        self.spring.set_data(*spring_line((3.8 + x, 0.38), (6.0 + x, 0.38), 0.24))
        self.press.set_positions((0.3, 0.1 + self.length[i]), (0.3, 0.05))
