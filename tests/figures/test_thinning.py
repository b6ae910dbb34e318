"""Pictures of long motions and of many contacts: bounded, true to the extremes, and on the page."""

from __future__ import annotations

import io
import time
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend

import stickslip as ss
from figures.boxes import misread
from stickslip.figures.drawing.style import legend_above, new_figure
from stickslip.figures.drawing.thinning import (
    COLUMNS,
    FEW,
    MOST_PIECES,
    PIXELS,
    Columns,
    Curve,
    chosen,
    strip,
    thin,
)
from stickslip.figures.motion import plot_trajectory
from stickslip.model.quantities import FORCES, contact_key
from stickslip.motion.outcome import Outcome
from stickslip.motion.record.knots import Knots


def time_panels(figure: Figure) -> list[Axes]:
    """The panels over time: all that share the axis of the first."""
    first = figure.axes[0]
    return [
        axes
        for axes in figure.axes
        if axes is first or first.get_shared_x_axes().joined(first, axes)
    ]


# -- thinning --------------------------------------------------------------------------------------


def test_few_values_are_drawn_as_they_are() -> None:
    t = np.linspace(0.0, 1.0, FEW)
    again, lines = thin(t, {"sin": np.sin(t)})
    assert again is t
    assert np.array_equal(lines["sin"], np.sin(t))


def test_columns_keep_their_extremes() -> None:
    rng = np.random.default_rng(1)
    t = np.sort(rng.uniform(3.0, 8.0, 300_000))
    values = {"noise": rng.normal(size=len(t)), "spike": np.zeros(len(t)), "up": t**3, "down": -t}
    values["spike"][123_456] = 7.0
    short, lines = thin(t, values)
    assert len(short) <= 4 * COLUMNS
    assert np.all(np.diff(short) > 0.0)
    column = np.minimum((COLUMNS * (t - t[0]) / (t[-1] - t[0])).astype(int), COLUMNS - 1)
    there = np.minimum((COLUMNS * (short - t[0]) / (t[-1] - t[0])).astype(int), COLUMNS - 1)
    for name, v in values.items():
        for extreme in (np.minimum, np.maximum):
            full, thinned = np.full(COLUMNS, np.nan), np.full(COLUMNS, np.nan)
            full[np.unique(column)] = extreme.reduceat(v, np.unique(column, return_index=True)[1])
            thinned[np.unique(there)] = extreme.reduceat(
                lines[name], np.unique(there, return_index=True)[1]
            )
            assert np.array_equal(full, thinned)
    assert np.all(np.diff(lines["up"]) >= 0.0)
    assert np.all(np.diff(lines["down"]) <= 0.0)


def test_columns_do_not_depend_on_the_pieces() -> None:
    t = np.linspace(-1.0, 2.0, 100_001)
    v = np.random.default_rng(2).normal(size=100_001)
    whole, parts = Columns(-1.0, 2.0), Columns(-1.0, 2.0)
    whole.absorb(t, {"v": v})
    for i, j in pairwise([0, 1, 70, 71, 40_000, len(t)]):
        parts.absorb(t[i:j], {"v": v[i:j]})
    assert np.array_equal(whole.lines()[1]["v"], parts.lines()[1]["v"])


def test_a_time_axis_without_length() -> None:
    columns = Columns(5.0, 5.0)
    columns.absorb(np.array([5.0, 5.0]), {"v": np.array([1.0, 2.0])})
    _, lines = columns.lines()
    assert (np.min(lines["v"]), np.max(lines["v"])) == (1.0, 2.0)


def test_steps_in_a_row_are_chosen_everywhere() -> None:
    time = np.concatenate([np.linspace(0.0, 0.5, 90_000), np.linspace(0.9, 1.0, 50_000)])
    some = chosen(time, 20_000)
    assert len(some) <= 20_000 + COLUMNS
    assert np.array_equal(chosen(time, len(time)), np.arange(len(time) - 1))
    # Every column is touched: the one long step, too.
    covered = np.zeros(COLUMNS, bool)
    for i in some:
        covered[int(COLUMNS * time[i]) : int(COLUMNS * time[i + 1]) + 1] = True
    assert covered.all()


@pytest.mark.parametrize("phases", [50, 5000])
def test_phases_have_their_share(phases: int) -> None:
    rng = np.random.default_rng(3)
    time = np.concatenate([[0.0], np.cumsum(rng.exponential(size=2 * phases))])
    holds = np.arange(2 * phases) % 2 == 0
    axes = new_figure(4, 2).add_subplot()
    strip(axes, time, {"#000000": holds, "#ff0000": ~holds})
    black = np.sum(np.diff(time)[holds])
    if phases == 50:
        boxes = [path.get_extents() for path in axes.collections[0].get_paths()]
        assert len(boxes) == phases
        assert sum(box.width for box in boxes) == pytest.approx(black)
    else:
        assert not axes.collections
        (image,) = axes.images
        pixels = np.asarray(image.get_array())[0]
        assert pixels.shape == (COLUMNS, 4)
        assert np.all(pixels[:, 3] == pytest.approx(1.0))
        assert np.mean(1.0 - pixels[:, 0]) * time[-1] == pytest.approx(black)


def test_every_piece_of_a_curve_once() -> None:
    angle = 0.1 * np.arange(200_000)  # 3183 times round
    x, y = np.cos(angle), np.sin(angle)
    curve = Curve(False, x, y)
    for part in np.array_split(np.arange(len(x)), 7):
        curve.absorb(x[part], y[part], np.zeros(len(part), bool), np.ones(len(part) - 1, bool))
    across, up, rests = curve.points()
    assert not rests.any()
    known = ~np.isnan(across)
    assert np.all(np.hypot(across, up)[known] == pytest.approx(1.0))
    assert np.count_nonzero(known) < 0.5 * len(x)
    pixel = 2.0 / PIXELS
    drawn = np.unique(np.floor(np.column_stack([across[known], up[known]]) / pixel), axis=0)
    nearby = {(i + di, j + dj) for i, j in drawn for di in (-1, 0, 1) for dj in (-1, 0, 1)}
    assert all((i, j) in nearby for i, j in np.floor(np.column_stack([x, y])[::97] / pixel))


def test_a_wild_curve_is_bounded() -> None:
    x, y = np.random.default_rng(4).normal(size=(2, 250_000))
    curve = Curve(False, x, y)
    for part in np.array_split(np.arange(len(x)), 4):
        curve.absorb(x[part], y[part], np.zeros(len(part), bool), np.ones(len(part) - 1, bool))
    across, up, _ = curve.points()
    assert 1000 < len(across) <= 3 * MOST_PIECES
    assert np.nanmax(across) == np.max(x)
    assert np.nanmin(up) == np.min(y)


def test_gaps_are_not_drawn() -> None:
    curve = Curve(False, np.array([0.0, 1.0]), np.array([0.0, 1.0]))
    x = np.array([0.0, 0.1, 0.9, 1.0])
    curve.absorb(x, x, np.array([False, False, True, True]), np.array([True, False, True]))
    across, _, rests = curve.points()
    assert np.array_equal(across, [0.0, 0.1, np.nan, 0.9, 1.0, np.nan], equal_nan=True)
    assert np.array_equal(rests[::3], [False, True])


def test_rest_is_a_point() -> None:
    x = np.concatenate([np.linspace(0.0, 1.0, 50), np.full(50, 1.0), np.linspace(1.0, 0.0, 50)])
    rests = np.arange(150) // 50 == 1
    for whole in (True, False):
        curve = Curve(whole, x, x)
        curve.absorb(x, x, rests, np.ones(149, bool))
        assert [v.tolist() for v in curve.spots()] == [[1.0], [1.0]]


# -- motions ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["rocking_toy", "plate_compactor", "spring_slider", "oscillating_play", "block_chain"]
)
def test_what_is_drawn_is_the_motion(name: str) -> None:
    system = ss.catalogue.get(name)
    motion = ss.simulate(system, (system.span[0], system.span[0] + 0.2 * np.ptp(system.span)))
    k = motion.knots.time
    steps = np.repeat(np.arange(len(k) - 1), 5)
    t = k[steps] + np.tile(np.linspace(0.0, 1.0, 5), len(k) - 1) * (k[steps + 1] - k[steps])
    names = [
        *system.declaration.state,
        *(f"{kind}_{key}" for key in motion.modes for kind in FORCES),
    ]
    seen = motion.trace(names, t, steps)
    inside = (
        np.tile([False, True, True, True, False], len(k) - 1) & (k[steps] < t) & (t < k[steps + 1])
    )
    exact = motion.at(t[inside])
    for name in names:
        size = max(np.max(np.abs(exact[name])), 1e-300)
        assert np.max(np.abs(seen[name][inside] - exact[name])) <= 1e-9 * size, name


def angles(motion: ss.Trajectory, start: float, end: float) -> np.ndarray:
    """ψ at many times, without the audit of a million steps."""
    t = np.linspace(start, end, 20_000)
    return motion.trace(["psi"], t, np.searchsorted(motion.knots.time, t, side="right") - 1)["psi"]


def test_a_million_switches_are_drawn() -> None:
    system = ss.catalogue.rocking_toy()
    ss.simulate(system, (0.0, 1.0)).plot()  # compiled
    motion = ss.simulate(system, (0.0, 1e12))
    assert motion.outcome is Outcome.EVENT_LIMIT
    assert len(motion.knots.time) > 1_000_000
    began = time.process_time()
    figure = motion.plot()
    figure.savefig(io.BytesIO(), format="png", dpi=200)
    assert time.process_time() - began < 20.0  # five on an idle machine
    # What swings in every column is an envelope.
    below, above = figure.axes[0].get_lines()
    assert len(np.asarray(below.get_xdata())) == len(np.asarray(above.get_xdata())) == COLUMNS
    late = angles(motion, 9e5, 9.001e5)
    then = np.asarray(below.get_xdata()) > 8e5
    shown = np.concatenate([np.asarray(line.get_ydata())[then] for line in (below, above)])
    assert np.max(late) == pytest.approx(np.max(shown), rel=1e-2)
    assert np.min(late) == pytest.approx(np.min(shown), rel=1e-2)
    assert sum(len(c.get_paths()) for axes in figure.axes for c in axes.collections) < 100
    # Grey by the share of the time in which every contact sticks.
    sticks = np.all(motion.knots.mode[:-1] == 0, axis=1)
    share = np.sum(np.diff(motion.knots.time)[sticks]) / np.ptp(motion.knots.time)
    assert np.mean(np.asarray(figure.axes[0].images[0].get_array())[0, :, 3]) == pytest.approx(
        share
    )
    plane = next(axes for axes in figure.axes if axes.get_xlabel().startswith(r"$\psi$"))
    assert all(len(np.asarray(line.get_xdata())) < 3 * MOST_PIECES for line in plane.get_lines())
    high = np.nanmax(
        np.concatenate([np.asarray(line.get_xdata(), float) for line in plane.get_lines()])
    )
    assert high == pytest.approx(np.max(angles(motion, 0.0, 300.0)), rel=1e-2)


def test_more_steps_than_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    from stickslip.figures.drawing import sampling as module

    motion = ss.simulate(ss.catalogue.rocking_toy(), (0.0, 4e4))
    monkeypatch.setattr(module, "MOST_DRAWN", 3 * COLUMNS)
    figure = motion.plot()
    below, above = figure.axes[0].get_lines()
    assert len(np.asarray(below.get_xdata())) == len(np.asarray(above.get_xdata())) == COLUMNS
    states = motion.knots.state[:, 0]  # extremes at knots are all there
    assert np.max(np.asarray(above.get_ydata())) >= np.max(states)
    assert np.min(np.asarray(below.get_ydata())) <= np.min(states)
    figure.savefig(io.BytesIO(), format="png")


def test_events_of_a_long_motion_are_a_table_at_once() -> None:
    motion = ss.simulate(ss.catalogue.rocking_toy(), (0.0, 1e5))
    began = time.process_time()
    events = motion.events
    assert time.process_time() - began < 3.0  # a tenth of a second on an idle machine
    assert np.count_nonzero(~events["contact"].str.endswith("= 0")) == motion.n_switches
    assert np.count_nonzero(events["contact"].str.endswith("= 0")) == motion.n_kinks
    assert set(events["from"]) | set(events["to"]) <= {"stick", "slip+", "slip-", "below", "above"}
    switch = events[events["contact"] == "left leg"].iloc[100]
    left, right = (motion.at(switch["time"], side)["mode_left_leg"] for side in ("left", "right"))
    names = {-1: "slip-", 0: "stick", 1: "slip+"}
    assert (switch["from"], switch["to"]) == (names[left], names[right])


# -- many contacts ---------------------------------------------------------------------------------


def legends(figure: Figure) -> list[Legend]:
    return [
        child for axes in figure.axes for child in axes.get_children() if isinstance(child, Legend)
    ]


@pytest.mark.parametrize("name", ss.catalogue.names())
def test_every_system_is_on_the_page(name: str) -> None:
    system = ss.catalogue.get(name)
    fits(ss.simulate(system, (system.span[0], system.span[0] + 0.1 * np.ptp(system.span))).plot())


@pytest.mark.parametrize("N", [2, 4, 5, 8, 12, 20, 100])
def test_chains_are_on_the_page(N: int) -> None:
    fits(plot_trajectory(Made(ss.catalogue.block_chain(N=N))))  # type: ignore[arg-type]


class Made:
    """Something with the shape of a motion of a chain, since machine code for many blocks takes
    minutes to make."""

    def __init__(self, system: ss.System) -> None:
        rng = np.random.default_rng(5)
        n = len(system.contacts)
        self.system = system
        time = np.sort(rng.uniform(0.0, 100.0, 40 * n))
        modes = np.where(rng.uniform(size=(len(time), n)) < 0.7, 0, -1)
        state = rng.normal(size=(len(time), 2 * n))
        nothing = np.zeros((len(time), 0), int)
        self.knots = Knots(time, state, modes, nothing, np.zeros(len(time), int))
        self.modes = {contact_key(name): modes[:, i] for i, name in enumerate(system.contacts)}

    def trace(
        self, names: list[str], times: np.ndarray, index: np.ndarray
    ) -> dict[str, np.ndarray]:
        return {name: np.sin(times + i) for i, name in enumerate(names)}


def fits(figure: Figure) -> None:
    """Panels over time line up, and nothing is off the page or on something else."""
    # a layout that does not fit is a warning, and that is an error here
    assert misread(figure) == []
    sides = [axes.get_window_extent().intervalx for axes in time_panels(figure)]
    assert len(sides) >= 1
    assert np.ptp(sides, axis=0) == pytest.approx(0.0, abs=0.5)
    page = figure.bbox
    for legend in legends(figure):
        box = legend.get_window_extent()
        assert page.x0 <= box.x0 and box.x1 <= page.x1 + 0.5 and box.y1 <= page.y1 + 0.5
    for axes in time_panels(figure):
        names = [
            child.get_window_extent() for child in axes.get_children() if isinstance(child, Legend)
        ]
        assert not (len(names) == 2 and names[0].overlaps(names[1]))
    for one, other in pairwise(time_panels(figure)):
        assert other.get_window_extent().y1 < one.get_window_extent().y0


def test_long_names_take_more_rows() -> None:
    figure = new_figure(7.2, 3.0)
    axes = figure.add_subplot()
    lines = [
        axes.plot([0, 1], [0, i], label=f"a coordinate with a long name, {i}")[0] for i in range(4)
    ]
    legend_above(axes, lines[:3])
    legend_above(axes, lines[3:], right=True)
    figure.savefig(io.BytesIO(), format="png")
    (legend,) = legends(figure)
    assert [text.get_text()[-1] for text in legend.get_texts()] == ["0", "1", "2", "3"]
    box = legend.get_window_extent()
    assert box.x0 >= 0.0
    assert box.x1 <= figure.bbox.x1
    axes = new_figure(7.2, 3.0).add_subplot()
    first, second = (axes.plot([0, 1], label=name)[0] for name in ("x", "y"))
    legend_above(axes, [first])
    legend_above(axes, [second], right=True)
    assert len([child for child in axes.get_children() if isinstance(child, Legend)]) == 2
