"""Pictures that others add to a kind of result."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import stickslip as ss
from stickslip.errors import DeclarationError
from stickslip.figures.drawing import registry
from stickslip.results import Result

TOY = ss.catalogue.rocking_toy()


@pytest.fixture(autouse=True)
def _as_before(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(registry, "_drawn", {})
    yield


def sketch(result: Any, ax: Axes | None = None) -> Figure:
    """A picture of somebody's."""
    figure = Figure() if ax is None else ax.figure
    assert isinstance(figure, Figure)
    figure.suptitle(result.title)
    return figure


def test_one_kind_has_it_and_no_other() -> None:
    ss.figures.register(ss.Trajectory)(sketch)
    assert registry.registered(ss.Trajectory, "sketch") is sketch
    assert registry.registered(ss.Equilibria, "sketch") is None
    with pytest.raises(DeclarationError, match="unknown quantity 'sketch'"):
        ss.equilibria(TOY).plot("sketch")


def test_every_kind_may_have_it() -> None:
    ss.figures.register(Result)(sketch)
    ax = Figure().subplots()
    assert ss.simulate(TOY, (0.0, 1.0)).plot("sketch", ax=ax) is ax.figure
    assert ss.equilibria(TOY).plot("sketch").get_suptitle()


def test_a_name_that_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    ss.figures.register(ss.Trajectory)(sketch)
    ss.figures.register(ss.Trajectory)(sketch)  # the same module, run again

    def other(result: Any, ax: Axes | None = None) -> Figure:
        return Figure()

    monkeypatch.setattr(other, "__name__", "sketch")
    monkeypatch.setattr(other, "__module__", "somebody")
    with pytest.raises(DeclarationError, match="already registered by"):
        ss.figures.register(ss.Trajectory)(other)
    assert registry.registered(ss.Trajectory, "sketch") is sketch
