"""What stands at axes and lines: powers of ten with the units, names of lines beside them."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Annotation

import stickslip as ss
from stickslip.figures.drawing.style import legend_above, new_figure, powers_in_labels

SMALL = ("bowed_string", "stick_slip_actuator", "rate_and_state_slider")


@pytest.mark.parametrize("name", SMALL)
def test_powers_of_ten_stand_with_the_unit(name: str) -> None:
    figure = ss.simulate(ss.catalogue.get(name)).plot()
    figure.draw_without_rendering()
    axes = [axis for panel in figure.axes for axis in (panel.xaxis, panel.yaxis)]
    assert not any(axis.offsetText.get_visible() and axis.offsetText.get_text() for axis in axes)
    labels = [axis.get_label_text() for axis in axes]
    assert any("$10^{" in label for label in labels)
    assert all(label.endswith("]") for label in labels if "$10^{" in label)


@pytest.mark.parametrize(
    ("largest", "label", "wanted"),
    [
        (8e-6, "x  [m]", "x  [$10^{-6}$ m]"),
        (3e9, "t", "t  [$10^{9}$]"),
        (2.5e-4, "x  [m]", "x  [$10^{-3}$ m]"),
        (0.05, "x  [m]", "x  [m]"),
        (6000.0, "x  [m]", "x  [m]"),
    ],
)
def test_powers_are_multiples_of_three(largest: float, label: str, wanted: str) -> None:
    figure = new_figure(4.0, 3.0)
    axes = figure.add_subplot()
    axes.plot([0.0, 1.0], [0.0, largest])
    axes.set_ylabel(label)
    powers_in_labels(figure)
    assert axes.get_ylabel() == wanted


def boxes(figure: Figure) -> list[tuple[Annotation, np.ndarray]]:
    """The names of lines, and the corners of their boxes."""
    figure.draw_without_rendering()
    found = [t for axes in figure.axes for t in axes.texts if isinstance(t, Annotation)]
    return [(text, text.get_window_extent().get_points()) for text in found]


def test_names_of_lines_hit_nothing() -> None:
    """Neither a line, nor each other, nor the edge of the picture."""
    response = ss.frequency_response(
        ss.catalogue.forced_oscillator(P=1.0, F_c=0.2),
        "omega",
        (0.5, 1.5),
        levels={"F_c": [0.3, 0.35, 0.4]},
        points=3,
    )
    figure = response.plot("amplitude")
    (axes,) = figure.axes
    named = boxes(figure)
    assert len(named) == 3
    for (_, one), (_, other) in combinations(named, 2):
        assert np.any(one[1] < other[0]) or np.any(other[1] < one[0])
    frame = axes.get_window_extent().get_points()
    for text, box in named:
        assert np.all(box[0] >= frame[0]) and np.all(box[1] <= frame[1])
        for line in axes.get_lines():
            ends = axes.transData.transform(np.asarray(line.get_xydata()))
            share = np.linspace(0.0, 1.0, 9)[:, None, None]
            points = (ends[:-1] + share * np.diff(ends, axis=0)).reshape(-1, 2)
            hit = np.all((points >= box[0]) & (points <= box[1]), axis=1)
            assert not hit.any(), text.get_text()


def test_legends_are_read_row_by_row() -> None:
    figure = new_figure(3.0, 2.0)
    axes = figure.add_subplot()
    for k in range(6):
        axes.plot([0, 1], [k, k], label=f"number {k} of six")
    legend_above(axes)
    figure.draw_without_rendering()
    legend = axes.get_legend()
    assert legend is not None
    texts = legend.texts
    places = [text.get_window_extent().get_points()[0] for text in texts]
    order = sorted(range(6), key=lambda k: (-round(places[k][1]), places[k][0]))
    assert [texts[k].get_text() for k in order] == [f"number {k} of six" for k in range(6)]


def test_names_of_lines_are_in_their_panel() -> None:
    """However much the layout changes the panel once labels and legend are there."""
    response = ss.frequency_response(
        ss.catalogue.forced_oscillator(F_c=0.1),
        "omega",
        (0.6, 1.4),
        levels={"P": [0.13, 0.2, 1.5]},
        points=9,
    )
    figure = response.plot("amplitude", "period", "dissipated", "phase")
    found = boxes(figure)
    assert len(found) >= 3
    for text, corners in found:
        assert text.axes is not None
        frame = text.axes.get_window_extent()
        assert all(frame.contains(*corner) for corner in corners), text.get_text()
