"""Drawings of systems with impacts: the woodpecker, the ramp walker and the simplest walker."""

from __future__ import annotations

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy import ndarray as Array

import stickslip as ss
from stickslip_paper.drawing.parts import (
    OPEN,
    STICK,
    Scene,
    by_mode,
    mark,
    modes,
    moving_disc,
    moving_line,
    part,
    shoe,
)
from stickslip_paper.drawing.sketch import BODY_EDGE, canvas, ground, rounded, spring_line, turned
from stickslip_paper.drawing.style import Point
from stickslip_paper.figures.figure_4_1 import FAR

_IMPACT = ss.style.ORANGE

# -- the woodpecker --------------------------------------------------------------------------------


def woodpecker_scene(frames: int = 140) -> Scene:
    """Two pecks of the settled motion: the bird on its pole, and its traces."""
    bird = ss.catalogue.woodpecker()
    period = 0.145976
    motion = ss.simulate(bird, (0.0, 20.0))
    events, impacts = motion.events, motion.impacts
    jams = events.loc[
        (events["contact"] == "lower edge") & (events["to"] == "stick"), "time"
    ].to_numpy()
    # It begins 12 ms before it jams, when it has converged.
    start = float(jams[jams < 20.0 - 2 * period][-1]) - 0.012
    times = start + np.linspace(0.0, 2 * period, 2400)
    t = start + np.linspace(0.0, 2 * period, frames)
    traces, now = motion.at(times), motion.at(t)
    for values in (traces, now):
        values["y"] = 1e3 * (values["y"] - motion.at(np.array([start]))["y"][0])
    strikes = impacts.loc[impacts["contact"] == "beak", "time"].to_numpy()
    strikes = strikes[(strikes > start) & (strikes < t[-1])]
    figure = ss.style.new_figure(6.4, 4.8)
    toy, angle, height = figure.subplot_mosaic(
        [["toy", "angle"], ["toy", "height"]], width_ratios=[1.0, 1.25]
    ).values()
    parts = _Woodpecker(toy, now, t, strikes)
    jam = np.minimum(traces["mode_lower_edge"], traces["mode_upper_edge"])
    at = motion.at(strikes)
    struck = {"phi_S": at["phi_S"], "y": np.interp(strikes, times, traces["y"])}
    for axes, name in ((angle, "phi_S"), (height, "y")):
        by_mode(axes, 1e3 * (times - start), traces[name], jam)
        axes.plot(1e3 * (strikes - start), struck[name], **_STAR)
        axes.set_xlim(0.0, 2e3 * period)
    angle.set_ylabel(r"angle of the bird $\varphi_S$  [rad]", fontsize=11)
    angle.tick_params(labelbottom=False)
    height.set_ylabel("height $y$  [mm]", fontsize=11)
    height.set_xlabel("time $t$  [ms]", fontsize=11)
    peck = Line2D([], [], **_STAR, label="beak strikes")
    handles = [*modes("jammed", "slides", "sleeve free"), peck]
    angle.legend(handles=handles, ncols=2, loc="lower left", bbox_to_anchor=(0.0, 0.98))
    cursors = [axes.axvline(0.0, color=ss.style.THRESHOLD, lw=1.2) for axes in (angle, height)]

    def place(i: int) -> None:
        parts.place(i)
        for cursor in cursors:
            cursor.set_xdata([1e3 * (t[i] - start)] * 2)

    return Scene(figure, [*parts.moving, *cursors], place, frames)


_STAR = {"marker": (8, 1, 0), "ms": 10.0, "mfc": _IMPACT, "mec": STICK, "mew": 0.6, "ls": "none"}
_POLE, _INNER, _OUTER, _HALF = 2.5, 3.1, 5.6, 5.8  # mm: pole and sleeve of the catalogue
_LARGER = 2.5  # clearance and angle of the sleeve
_JOINT = 10.0
_BEAK = (-5.1, 20.0)  # from the joint


class _Woodpecker:
    """Pole, sleeve and bird in millimetres."""

    def __init__(self, axes: Axes, now: dict[str, Array], t: Array, strikes: Array) -> None:
        low = float(now["y"].min())
        canvas(axes, (-13.0, 39.0), (low - 29.0, 27.0))
        axes.fill_between([-_POLE, _POLE], low - 29.0, 27.0, fc="#EAD9BD", ec="none")
        for x in (-_POLE, _POLE):
            axes.plot([x, x], [low - 29.0, 27.0], color=STICK, lw=1.0)
        for y in np.arange(-60.0, 21.0, 10.0):
            axes.plot([-8.5, -7.0], [y, y], color=STICK, lw=0.8)
            axes.text(-9.2, y, f"{y:.0f}".replace("-", "−"), ha="right", va="center", fontsize=9)
        axes.text(-9.2, 25.0, "mm", ha="right", va="center", fontsize=9)
        self.now = now
        self.struck = np.any((t[:, None] >= strikes) & (t[:, None] < strikes + 0.012), axis=1)
        inner = _POLE + _LARGER * (_INNER - _POLE)
        outer = inner + _OUTER - _INNER
        self.walls = [
            side * np.array([(inner, -_HALF), (outer, -_HALF), (outer, _HALF), (inner, _HALF)])
            for side in (-1.0, 1.0)
        ]
        self.corners = {"lower_edge": (inner, -_HALF), "upper_edge": (inner, _HALF)}
        self.side = (outer, 0.0)
        self.sleeve = [part(axes, wall, FAR) for wall in self.walls]
        self.rims = [moving_line(axes, 1.2, BODY_EDGE) for _ in range(2)]
        self.spring = moving_line(axes, 1.4)
        self.bird = part(axes, _BIRD)
        self.beak = part(axes, _BEAK_OUTLINE, ss.style.THRESHOLD)
        self.eye = moving_disc(axes, (0.0, 0.0), 0.7, STICK)
        self.wing = moving_line(axes, 1.2, BODY_EDGE)
        self.contacts = {name: moving_disc(axes, (0.0, 0.0), 0.85, STICK) for name in self.corners}
        self.star = axes.plot([], [], **{**_STAR, "ms": 20.0})[0]
        self.moving: list[Artist] = [
            *self.rims,
            *self.sleeve,
            self.spring,
            self.bird,
            self.wing,
            self.eye,
            self.star,
            self.beak,
            *self.contacts.values(),
        ]

    def place(self, i: int) -> None:
        """Put everything where it is in frame i."""
        y, sleeve, bird = (float(self.now[name][i]) for name in ("y", "phi_M", "phi_S"))
        joint = (_JOINT, y + _JOINT * sleeve)

        def jammed(points: Array | Point) -> Array:
            return turned(np.atleast_2d(points), _LARGER * sleeve, to=(0.0, y))

        def swung(points: Array | Point) -> Array:
            return turned(np.atleast_2d(points), bird, to=joint)

        for patch, wall in zip(self.sleeve, self.walls, strict=True):
            patch.set_xy(jammed(wall))
        for rim, end in zip(self.rims, (-_HALF, _HALF), strict=True):
            rim.set_data(*jammed(np.array([(-self.side[0], end), (self.side[0], end)])).T)
        for name, disc in self.contacts.items():
            disc.set_center(tuple(jammed(self.corners[name])[0]))
            mark(disc, int(self.now[f"mode_{name}"][i]))
        self.spring.set_data(*spring_line(jammed(self.side)[0], swung((5.6, 0.0))[0], 3.4, 5))
        self.bird.set_xy(swung(_BIRD))
        self.beak.set_xy(swung(_BEAK_OUTLINE))
        self.eye.set_center(tuple(swung((3.6, 21.0))[0]))
        self.wing.set_data(*swung(_WING).T)
        self.star.set_data([_POLE], [joint[1] + _BEAK[1]])
        self.star.set_visible(bool(self.struck[i]))


_BIRD = rounded(
    np.array(
        [
            *[(0.0, 19.0), (1.0, 24.0), (6.0, 26.0), (11.0, 22.0), (11.5, 14.0), (17.5, 9.0)],
            *[(20.5, 0.0), (18.5, -10.0), (17.5, -25.0), (13.0, -25.0), (11.5, -13.0)],
            *[(5.5, -8.0), (4.0, 0.0), (4.5, 10.0), (2.0, 15.0)],
        ]
    )
)
_BEAK_OUTLINE = np.array([_BEAK, (1.0, 18.2), (1.2, 21.4)])
_WING = rounded(np.array([(10.5, 8.0), (17.5, 4.0), (16.0, -13.0), (10.5, -4.0)]))

# -- the ramp walker -------------------------------------------------------------------------------


def ramp_walker_scene(frames: int = 140) -> Scene:
    """Two periods of settled walking down the ramp: from the side and from behind, and traces."""
    walker = ss.catalogue.ramp_walker()
    settled = ss.simulate(walker, (0.0, 60.0)).final
    # two periods of 0.485355 s
    times = np.linspace(0.0, 0.97071, 2400)
    t = np.linspace(0.0, 0.97071, frames)
    motion = ss.simulate(walker, (0.0, 0.971), initial=settled)
    traces, now = motion.at(times), motion.at(t)
    for values in (traces, now):
        for name in ("x_R", "x_L"):
            values[name] = values[name] - settled["x_L"]
    figure = ss.style.new_figure(6.4, 5.2)
    side, behind, angle, feet = figure.subplot_mosaic(
        [["side", "behind"], ["angle", "angle"], ["feet", "feet"]],
        width_ratios=[13.4, 8.4],
        height_ratios=[4.2, 1, 1.5],
    ).values()
    slope = float(walker.values["gamma"])
    parts = (_DownTheRamp(side, now, slope), _OnTheRamp(behind, now))
    angle.plot(times, traces["psi"], color=STICK, lw=1.2)
    angle.set_ylabel(r"$\psi$  [rad]", fontsize=11)
    angle.tick_params(labelbottom=False)
    for name, key in _FEET.items():
        by_mode(feet, times, 100.0 * traces[f"x_{name}"], traces[f"mode_{key}"])
        end = 100.0 * float(now[f"x_{name}"][-1])
        feet.text(t[-1] + 0.01, end, f"$x_{name}$", va="top" if name == "R" else "bottom")
    feet.set_ylabel("$x_R$, $x_L$  [cm]", fontsize=11)
    feet.set_xlabel("time $t$  [s]", fontsize=11)
    ss.style.legend_above(angle, modes("stick", "slip", "lifted"))
    for axes in (angle, feet):
        axes.set_xlim(0.0, t[-1])
    cursors = [axes.axvline(0.0, color=ss.style.THRESHOLD, lw=1.2) for axes in (angle, feet)]

    def place(i: int) -> None:
        for view in parts:
            view.place(i)
        for cursor in cursors:
            cursor.set_xdata([t[i], t[i]])

    return Scene(figure, [*parts[0].moving, *parts[1].moving, *cursors], place, frames)


_FEET = {"R": "right_foot", "L": "left_foot"}
_HIP = 2.6  # cm: height of the hips at rest
_APART = 2.5  # cm: from the middle to a leg
_SOLE = np.array([(-0.55, -0.02), (0.95, -0.02), (0.95, 0.2), (0.2, 0.42), (-0.55, 0.42)])
_PENGUIN = rounded(
    np.array(
        [
            *[(-2.6, 0.1), (-1.5, 1.4), (-1.5, 3.6), (-0.8, 5.6), (0.3, 6.4), (1.4, 5.9)],
            *[(1.5, 4.9), (1.2, 4.2), (1.9, 2.6), (1.6, 0.2), (0.6, -0.5), (-0.9, -0.5)],
        ]
    )
)


def _heights(now: dict[str, Array]) -> dict[str, Array]:
    """Heights of the hips [cm]: the ends of the legs at the body."""
    lean = _APART * np.sin(now["psi"])
    return {side: _HIP + 100.0 * now["y"] + sign * lean for side, sign in (("R", -1.0), ("L", 1.0))}


class _DownTheRamp:
    """The toy from the side, in centimetres; lengths and angles are those of the model."""

    def __init__(self, axes: Axes, now: dict[str, Array], slope: float) -> None:
        canvas(axes, (-4.6, 8.8), (-2.0, 9.9))
        self.slope = slope
        ground(axes, self.on((-4.6, 0.0))[0], self.on((8.8, 0.0))[0], 0.3, 0.4)
        for cm in range(7):
            axes.plot(*self.on([(cm, -0.45), (cm, -0.7)]).T, color=STICK, lw=0.8)
            if cm % 2 == 0:
                x, y = self.on((cm, -1.1))[0]
                axes.text(x, y, f"{cm} cm" if cm == 6 else f"{cm}", ha="center", va="center")
        self.now = now
        self.hips = _heights(now)
        self.x = {side: 100.0 * now[f"x_{side}"] for side in _FEET}
        self.z = {side: 100.0 * now[f"z_{side}"] for side in _FEET}
        self.springs = {side: moving_line(axes, 1.5, BODY_EDGE) for side in "LR"}
        self.feet = {side: part(axes, _SOLE, STICK, 0.0) for side in "LR"}
        self.body = part(axes, _PENGUIN)
        self.beak = part(axes, _SOLE, ss.style.THRESHOLD, 0.8)
        self.eye = moving_disc(axes, (0.0, 0.0), 0.13, STICK)
        self.moving: list[Artist] = [
            self.springs["L"],
            self.feet["L"],
            self.beak,
            self.body,
            self.eye,
            self.springs["R"],
            self.feet["R"],
        ]

    def on(self, points: Array | Point | list[tuple[float, float]]) -> Array:
        """From coordinates along and across the ramp."""
        return turned(np.atleast_2d(np.asarray(points)), -self.slope)

    def place(self, i: int) -> None:
        """Put everything where it is in frame i."""
        middle = 0.5 * (self.x["R"][i] + self.x["L"][i])
        at = np.array([middle, _HIP + 100.0 * self.now["y"][i]])
        self.body.set_xy(self.on(_PENGUIN + at))
        self.beak.set_xy(self.on(np.array([(1.1, 5.6), (2.5, 5.0), (1.2, 4.9)]) + at))
        self.eye.set_center(tuple(self.on(np.array([0.75, 5.45]) + at)[0]))
        ankle = np.array([0.0, 0.42])
        for side, key in _FEET.items():
            foot = np.array([self.x[side][i], self.z[side][i]])
            hip = np.array([middle, self.hips[side][i]])
            self.springs[side].set_data(
                *spring_line(self.on(foot + ankle)[0], self.on(hip)[0], 0.6, 5)
            )
            shoe(self.feet[side], self.on(foot + _SOLE), int(self.now[f"mode_{key}"][i]))


class _OnTheRamp:
    """From behind, across the ramp: it leans to the right while ψ > 0."""

    def __init__(self, axes: Axes, now: dict[str, Array]) -> None:
        canvas(axes, (-4.2, 4.2), (-2.0, 9.9))
        ground(axes, (-4.2, 0.0), (4.2, 0.0), 0.3, 0.4)
        self.now = now
        self.hips = _heights(now)
        self.springs = {side: moving_line(axes, 1.5, BODY_EDGE) for side in "LR"}
        self.feet = {side: part(axes, _SOLE, STICK, 0.0) for side in "LR"}
        self.outline = rounded(
            np.array(
                [
                    *[(-2.7, -0.2), (-2.8, 2.2), (-1.6, 3.9), (-1.5, 5.4), (-0.7, 6.4)],
                    *[(0.7, 6.4), (1.5, 5.4), (1.6, 3.9), (2.8, 2.2), (2.7, -0.2), (0.0, -0.6)],
                ]
            )
        )
        self.body = part(axes, self.outline)
        self.upright = axes.plot([0.0, 0.0], [0.0, 9.1], ":", color=STICK, lw=0.8)[0]
        self.axis = axes.plot([], [], "--", color=STICK, lw=1.0)[0]
        self.name = axes.text(0.0, 0.0, r"$\psi$", ha="center", va="center", fontsize=12)
        self.moving: list[Artist] = [
            *self.springs.values(),
            *self.feet.values(),
            self.body,
            self.upright,
            self.axis,
            self.name,
        ]

    def place(self, i: int) -> None:
        """Tilt the body; the legs stay upright under it."""
        psi = float(self.now["psi"][i])
        at = (0.0, _HIP + 100.0 * float(self.now["y"][i]))
        self.body.set_xy(turned(self.outline, -psi, to=at))
        self.axis.set_data(*turned(np.array([(0.0, -0.6), (0.0, 6.7)]), -psi, to=at).T)
        x, y = turned(np.array([(0.0, 6.9)]), -0.5 * psi, to=at)[0]
        self.name.set_position((float(x), float(y)))
        self.name.set_visible(abs(psi) > 0.12)
        for sign, (side, key) in zip((1.0, -1.0), _FEET.items(), strict=True):
            x = sign * _APART
            z = 100.0 * float(self.now[f"z_{side}"][i])
            self.springs[side].set_data(
                *spring_line(
                    (x, z + 0.35), (sign * _APART * np.cos(psi), self.hips[side][i]), 0.6, 5
                )
            )
            sole = np.array([(-0.6, -0.02), (0.6, -0.02), (0.6, 0.35), (-0.6, 0.35)])
            sole += np.array([x, z])
            shoe(self.feet[side], sole, int(self.now[f"mode_{key}"][i]))


# -- the simplest walker ---------------------------------------------------------------------------


def simplest_walker_scene(frames: int = 140) -> Scene:
    """Four steps of the simplest walker, and the angles of its legs."""
    walker = ss.catalogue.simplest_walker()
    theta, rate, step = 0.200310900, -0.199832473, 3.88246
    initial = {
        "theta": theta,
        "d_theta": rate,
        "phi": 2 * theta,
        "d_phi": (1 - np.cos(2 * theta)) * rate,
    }
    motion = ss.simulate(walker, (0.0, 4.1 * step), initial=initial)
    end = 4 * step - 0.02
    t = np.linspace(0.0, end, frames)
    times = np.linspace(0.0, end, 2400)
    now, traces = motion.at(t), motion.at(times)
    strikes = motion.jumps["time"].to_numpy()[:3]
    lengths = 2 * np.abs(np.sin(motion.at(strikes)["theta"]))
    feet = np.append(0.0, np.cumsum(lengths))
    figure = ss.style.new_figure(6.4, 4.6)
    slope, angles = figure.subplots(2, 1, height_ratios=[1.6, 1.0])
    count = np.searchsorted(strikes, t, "right")
    struck = np.any((t[:, None] >= strikes) & (t[:, None] < strikes + 0.6), axis=1)
    parts = _OnTheSlope(slope, now, feet, count, struck)
    steps = np.searchsorted(strikes, times, "right")
    for count in range(4):
        shown = steps == count
        leg = traces["theta"][shown]
        angles.plot(times[shown], leg, color=STICK, lw=1.8)
        angles.plot(times[shown], leg - traces["phi"][shown], color=OPEN, lw=2.2)
    at = motion.at(strikes)["theta"]
    for sign in (-1.0, 1.0):
        angles.plot(strikes, sign * np.abs(at), **_STAR)
    angles.set_xlim(0.0, end)
    angles.set_ylabel("angles of the legs  [rad]", fontsize=11)
    angles.set_xlabel(r"time $t$  [$\sqrt{\ell/g}$]", fontsize=11)
    lines = [
        Line2D([], [], color=STICK, lw=2.5, label=r"stance leg, $\theta$"),
        Line2D([], [], color=OPEN, lw=2.5, label=r"swing leg, $\theta - \varphi$"),
        Line2D([], [], **_STAR, label="heel strike"),
    ]
    ss.style.legend_above(angles, lines)
    cursor = angles.axvline(0.0, color=ss.style.THRESHOLD, lw=1.2)

    def place(i: int) -> None:
        parts.place(i)
        cursor.set_xdata([t[i], t[i]])

    return Scene(figure, [*parts.moving, cursor], place, frames)


class _OnTheSlope:
    """Two legs of length 1 with a heavy hip; the legs take turns in being stance leg."""

    def __init__(
        self, axes: Axes, now: dict[str, Array], feet: Array, steps: Array, struck: Array
    ) -> None:
        """Legs on successive `feet`.

        Parameters
        ----------
        now : dict of str to ndarray
            The motion in every frame.
        feet : ndarray, shape (n,)
            Position of the stance foot in each step.
        steps, struck : ndarray, shape (frames,)
            Number of the step, and whether a heel has just struck.
        """
        canvas(axes, (-0.6, 2.2), (-0.16, 1.16))
        self.slope = 0.009
        ground(axes, self.on((-0.6, 0.0)), self.on((2.2, 0.0)), 0.04, 0.06)
        for foot in (feet[0] - feet[1], *feet, 2 * feet[-1] - feet[-2]):
            axes.plot(*np.array([self.on((foot, -0.06)), self.on((foot, -0.1))]).T, color=STICK)
        self.now = now
        self.feet = feet
        self.steps = steps
        self.struck = struck
        self.legs = [part(axes, np.zeros((4, 2)), face) for face in ("white", FAR)]
        self.lifted = moving_disc(axes, (0.0, 0.0), 0.032, "white")
        self.foot = moving_disc(axes, (0.0, 0.0), 0.032, STICK)
        self.hip = moving_disc(axes, (0.0, 0.0), 0.075, ss.style.BLUE)
        self.path = moving_line(axes, 1.0, ss.style.BLUE)
        self.path.set_linestyle(":")
        self.star = axes.plot([], [], **{**_STAR, "ms": 20.0})[0]
        self.hips = np.array(
            [
                self.on((feet[step] - np.sin(theta), np.cos(theta)))
                for step, theta in zip(steps, now["theta"], strict=True)
            ]
        )
        self.moving: list[Artist] = [
            self.path,
            self.star,
            *self.legs,
            self.lifted,
            self.foot,
            self.hip,
        ]

    def on(self, point: Point) -> Array:
        """From coordinates along and across the slope."""
        return turned(np.array([point]), -self.slope)[0]

    def place(self, i: int) -> None:
        """Put both legs where they are in frame i."""
        theta = float(self.now["theta"][i])
        swing = theta - float(self.now["phi"][i])
        hip = self.hips[i]
        stands = int(self.steps[i]) % 2
        for leg, angle, sole in ((stands, theta, self.foot), (1 - stands, swing, self.lifted)):
            direction = turned(np.array([(0.0, -1.0)]), angle - self.slope)[0]
            across = 0.022 * np.array([-direction[1], direction[0]])
            foot = hip + direction
            self.legs[leg].set_xy([hip - across, hip + across, foot + across, foot - across])
            sole.set_center(tuple(foot))
        self.star.set_data(*np.array([self.foot.get_center()]).T)
        self.star.set_visible(bool(self.struck[i]))
        self.hip.set_center(tuple(hip))
        self.path.set_data(*self.hips[: i + 1].T)
