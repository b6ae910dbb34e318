"""Measures that other packages add."""

from __future__ import annotations

import sys
from importlib.metadata import EntryPoint, EntryPoints
from types import ModuleType

import pytest

import stickslip as ss
from stickslip.errors import DeclarationError, StickslipError
from stickslip.sweeps.request import user_measures
from stickslip.sweeps.request.measures import MEASURES
from stickslip.sweeps.request.user_measures import FunctionMeasure, offered_measures, read_measures

TOY = ss.catalogue.rocking_toy()


def turns(motion: ss.Trajectory) -> float:
    """A measure of somebody's."""
    return float(motion.n_switches)


@pytest.fixture(autouse=True)
def _package(monkeypatch: pytest.MonkeyPatch) -> None:
    module = ModuleType("somebody")
    monkeypatch.setattr(module, "turns", turns, raising=False)
    monkeypatch.setitem(sys.modules, "somebody", module)
    places = {"turns": "somebody:turns", "missing": "somebody:gone", "other": "somebody:turns"}
    group = user_measures.MEASURES_GROUP
    points = EntryPoints(EntryPoint(name, value, group) for name, value in places.items())
    monkeypatch.setattr(user_measures, "entry_points", lambda **wanted: points.select(**wanted))


def test_they_are_asked_for_by_name() -> None:
    (measure,) = read_measures(TOY, ["turns"])
    assert isinstance(measure, FunctionMeasure)
    found = ss.sweep(TOY, {"P": [0.8, 1.0]}, ["turns"]).dataset["turns"]
    assert found.values.tolist() == [
        ss.simulate(TOY, parameters={"P": P}).n_switches for P in (0.8, 1.0)
    ]


def test_what_is_offered_can_be_measured() -> None:
    """All names by which something of a system is measured, with unit and meaning; no others."""
    offered = offered_measures(TOY)
    assert {"speed", "amplitude", "turns"} <= set(offered)
    assert offered["speed"] == {"units": "m/s", "long_name": "mean speed"}
    assert "relative_phase" not in offered and "cost_of_transport" not in offered
    assert "speed" not in offered_measures(ss.catalogue.belt_block())
    named = [name for name in offered if name in MEASURES]
    found = ss.sweep(TOY, {"P": [1.0]}, named).dataset
    assert all(found[name].attrs["long_name"] == offered[name]["long_name"] for name in named)


def test_what_cannot_be_loaded_is_said_when_it_is_asked_for() -> None:
    with pytest.raises(StickslipError, match=r"measure missing: somebody:gone cannot be loaded"):
        read_measures(TOY, ["missing"])
    with pytest.raises(StickslipError, match="not a function of that name"):
        read_measures(TOY, ["other"])
    with pytest.raises(DeclarationError, match="unknown measure 'nobody'"):
        read_measures(TOY, ["nobody"])


def test_formulas_of_measures_have_the_unit_of_what_they_are_made_of() -> None:
    belt = ss.catalogue.belt_block()
    asked = ["reach = max(high:x, -low:x)", "pitch = 1/period", "part = speed:x/V"]
    found = ss.sweep(belt, {"V": [0.3, 0.4]}, asked)
    units = {name: found[name].attrs["units"] for name in ("reach", "pitch", "part")}
    assert units == {"reach": "m", "pitch": "1/s", "part": "1"}
