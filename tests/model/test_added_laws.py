"""Friction laws that another package adds."""

from __future__ import annotations

import sys
from dataclasses import replace
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from types import ModuleType

import pytest

import stickslip as ss
from stickslip.model import laws


@pytest.fixture(autouse=True)
def _package(monkeypatch: pytest.MonkeyPatch) -> None:
    module = ModuleType("somebody")
    module.__dict__["film"] = replace(laws.by_name("stribeck"), name="film")
    monkeypatch.setitem(sys.modules, "somebody", module)
    places = {
        "film": "somebody:film",
        "gone": "somebody:gone",
        "other": "somebody:film",
        "coulomb": "somebody:film",
    }
    points = EntryPoints(EntryPoint(n, place, laws.LAWS_GROUP) for n, place in places.items())
    monkeypatch.setattr(laws, "entry_points", lambda **wanted: points.select(**wanted))


def block(law: str) -> str:
    """A model file with a law."""
    return f"""
name = "block"
parameters.V = 0.1
coordinates.x = {{kind = "inertial"}}
kinetic = "d_x**2/2"
potential = "x**2/2"
span = [0, 20]
[contacts.belt]
law = "{law}"
direction = "d_x"
surface_speed = "V"
F_s = 1.0
F_c = 0.5
v_s = 0.1
"""


def test_it_is_known_by_its_name(tmp_path: Path) -> None:
    """In Python, in lists and in model files, as ours are."""
    assert "film" in ss.laws.all_names() and ss.laws.by_name("film").name == "film"
    file = tmp_path / "block.toml"
    ends = []
    for law in ("film", "stribeck"):
        file.write_text(block(law), encoding="utf-8")
        system = ss.load(file)
        ends.append(ss.simulate(system).final)
        file.write_text(system.to_toml(), encoding="utf-8")
        assert ss.load(file) == system
    assert ends[0] == ends[1]


def test_names_that_are_taken_stay_ours() -> None:
    assert ss.laws.by_name("coulomb") is ss.laws.coulomb
    assert ss.laws.all_names().count("coulomb") == 1


def test_what_cannot_be_loaded_is_said_when_it_is_asked_for() -> None:
    with pytest.raises(ss.StickslipError, match=r"law gone: somebody:gone cannot be loaded"):
        ss.laws.by_name("gone")
    with pytest.raises(ss.StickslipError, match="not a FrictionLaw of that name"):
        ss.laws.by_name("other")
