"""Pictures of event catalogues."""

from __future__ import annotations

import stickslip as ss


def test_an_empty_one_says_so() -> None:
    chain = ss.simulate(ss.catalogue.block_chain(N=3), (0.0, 1.0))
    found = chain.event_catalogue()
    assert len(found) == 0
    figure = found.plot()
    assert [text.get_text() for text in figure.axes[0].texts] == ["no events"]


def test_numbers_of_an_axis_do_not_overlap() -> None:
    """Numbers between whole decades are few: 2 and 5 at most."""
    found = ss.simulate(ss.catalogue.block_chain(N=2), (0.0, 80.0)).event_catalogue()
    figure = found.plot()
    figure.canvas.draw()
    for axes in figure.axes[1:]:
        shown = [label for label in axes.get_xticklabels(minor=True) if label.get_text()]
        low, high = axes.get_xlim()
        digits = [
            label.get_text().strip("0.")[:1]
            for label in shown
            if low <= label.get_position()[0] <= high
        ]
        assert set(digits) <= {"2", "5"}
