"""Pictures of contacts in a plane: the path, the force in its disc, and both in the overview."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

import stickslip as ss
from stickslip.figures.drawing.thinning import FEW


def axes_of(motion: ss.Trajectory) -> list[Axes]:
    figure = motion.plot()
    figure.draw_without_rendering()
    return figure.axes


def drawn(axes: Axes, label: str) -> tuple[np.ndarray, np.ndarray]:
    (line,) = (line for line in axes.get_lines() if line.get_label() == label)
    return np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float)


def test_the_path_is_that_of_the_motion_and_black_where_it_sticks() -> None:
    motion = ss.simulate(ss.catalogue.turntable(), (0, 2))
    axes = ss.style.new_figure(4.0, 4.0).add_subplot()
    ss.figures.path_in_plane(axes, motion, "disc")
    assert axes.get_aspect() == 1.0
    assert axes.get_xlabel() == r"$x$  [$\mathrm{m}$]"
    x, y = drawn(axes, "stick")
    carried = np.hypot(x, y)[np.isfinite(y)]
    resting = motion.at(motion.knots.time)
    radius = {round(float(r), 6) for r in carried}  # it is carried along on two circles
    sticks = motion.modes["disc"] == 0
    assert radius == {round(float(r), 6) for r in np.hypot(resting["x"], resting["y"])[sticks]}
    assert len(radius) <= 3
    assert drawn(axes, "start")[0] == pytest.approx([0.1])
    assert drawn(axes, "end")[0] == pytest.approx([motion.final["x"]])


def test_the_force_stays_in_its_ellipse_and_slips_on_the_edge() -> None:
    system = ss.System(
        name="rolled",
        coordinates={"x": ss.Inertial(force="2*sin(t)"), "y": ss.Inertial(force="0.5*cos(1.3*t)")},
        kinetic="(d_x**2 + d_y**2)/2",
        contacts={"table": ss.Contact(("d_x", "d_y"), 1.5, axes=(1.0, 0.4))},
        span=(0, 6),
    )
    motion = ss.simulate(system)
    axes = ss.style.new_figure(4.0, 4.0).add_subplot()
    ss.figures.force_in_plane(axes, motion)
    (edge,) = (patch for patch in axes.patches if isinstance(patch, Polygon))
    outline = np.asarray(edge.get_xy(), float)
    assert np.hypot(outline[:, 0] / 1.5, outline[:, 1] / 0.6) == pytest.approx(1.0)
    assert np.ptp(outline, axis=0) == pytest.approx((3.0, 1.2), rel=1e-3)
    _, slips, sticks, *_ = axes.get_lines()
    for line, low in ((slips, 1.0 - 1e-9), (sticks, 0.0)):
        x, y = (np.asarray(v, float) for v in line.get_data())
        size = np.hypot(x / 1.5, y / 0.6)
        size = size[np.isfinite(size)]
        assert len(size)
        assert np.all((low <= size) & (size <= 1.0 + 1e-9))


def test_an_overview_has_the_path_and_the_force_beside_the_time() -> None:
    motion = ss.simulate(ss.catalogue.puck())
    labels = [(a.get_xlabel(), a.get_ylabel()) for a in axes_of(motion)]
    assert [y for _, y in labels[:3]] == [
        r"$x$, $y$  [$\mathrm{m}$]",
        r"$\dot{x}$, $\dot{y}$  [$\mathrm{m/s}$]",
        r"$|\lambda|$  [$\mathrm{N}$]",
    ]
    assert labels[3:] == [
        (r"$x$  [$\mathrm{m}$]", r"$y$  [$\mathrm{m}$]"),
        (r"$\lambda_{1}$  [$\mathrm{N}$]", r"$\lambda_{2}$  [$\mathrm{N}$]"),
    ]


def test_two_contacts_on_one_path_have_one_picture_of_it() -> None:
    panels = axes_of(ss.simulate(ss.catalogue.conveyor()))
    assert [a.get_xlabel()[:4] for a in panels[-3:]] == ["$x$ ", r"$\la", r"$\la"]
    assert [a.texts[0].get_text() for a in panels[-2:]] == ["first belt", "second belt"]


def test_a_long_motion_in_a_plane_is_drawn_with_few_points() -> None:
    motion = ss.simulate(ss.catalogue.turntable(), (0, 400))
    *_, path, force = axes_of(motion)
    for axes in (path, force):
        assert all(len(np.asarray(line.get_xdata())) < FEW for line in axes.get_lines())
    x, y = drawn(path, "stick")
    assert np.nanmax(np.hypot(x, y)) == pytest.approx(0.1, rel=1e-3)


def test_a_window_of_the_time_begins_and_ends_there() -> None:
    motion = ss.simulate(ss.catalogue.puck())
    path = motion.plot(t=(0.2, 0.5)).axes[-2]
    start, end = motion.at(0.2), motion.at(0.5)
    assert drawn(path, "start")[1] == pytest.approx([float(start["y"])])
    assert drawn(path, "end")[1] == pytest.approx([float(end["y"])])


def test_what_has_no_contact_in_a_plane_says_so() -> None:
    axes = ss.style.new_figure(4.0, 4.0).add_subplot()
    belt = ss.simulate(ss.catalogue.belt_block(), (0, 1))
    with pytest.raises(ss.DeclarationError, match="belt_block has no contact in a plane"):
        ss.figures.path_in_plane(axes, belt)
    puck = ss.simulate(ss.catalogue.puck())
    with pytest.raises(ss.DeclarationError, match="unknown contact in a plane 'tabel'"):
        ss.figures.force_in_plane(axes, puck, "tabel")


def block(mu: float) -> ss.System:
    """A block on three legs that is pushed at its centre of mass."""
    legs = {"front": (0.5, 0.4), "beside": (0.5, -0.4), "back": (-0.6, 0.0)}
    return ss.System(
        name="block",
        parameters={"h": ss.Parameter(0.6), "mu": ss.Parameter(mu)},
        coordinates={"x": ss.Inertial(force="4*t")}
        | {name: ss.Inertial() for name in ("y", "z", "a", "b", "turn")},
        kinetic="(d_x**2 + d_y**2 + d_z**2)/2 + 0.1*(d_a**2 + d_b**2)/2 + 0.15*d_turn**2/2",
        potential="9.81*z",
        contacts={
            name: ss.Unilateral(
                f"z + {y}*a - {x}*b",
                (f"d_x - {y}*d_turn - h*d_b", f"d_y + {x}*d_turn + h*d_a"),
                "mu",
            )
            for name, (x, y) in legs.items()
        },
        span=(0, 2),
    )


def test_pictures_show_forces_that_legs_can_hold() -> None:
    """Three legs share a push: what is drawn of each stays within its threshold."""
    motion = ss.simulate(block(0.9))
    times = np.linspace(0.0, 2.0, 41)
    names = [f"{kind}_back_{i}" for kind in ("friction", "threshold") for i in (1, 2)]
    seen = motion.trace(names, times, np.zeros(41, int))
    size = np.hypot(seen["friction_back_1"], seen["friction_back_2"])
    assert np.all(size <= seen["threshold_back_1"] * (1.0 + 1e-9))
    np.testing.assert_allclose(size, np.hypot(*(motion.at(times)[n] for n in names[:2])), atol=1e-9)


@pytest.mark.parametrize("mu", [0.4, 0.9])
def test_a_path_has_no_rounding_errors(mu: float) -> None:
    """A block slides straight, or tips about legs that rest, and no scale is that of errors."""
    motion = ss.simulate(block(mu), (0, 2.5))
    paths = [axes for axes in axes_of(motion) if "turn" in axes.get_ylabel() and axes.get_xlabel()]
    assert len(paths) == 3
    for axes in paths:
        assert "10^" not in axes.get_xlabel() + axes.get_ylabel()
        _, y = drawn(axes, "slip" if mu < 0.5 else "stick")
        assert np.nanmax(np.abs(y), initial=0.0) == 0.0
