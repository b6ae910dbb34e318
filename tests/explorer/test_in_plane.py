"""Contacts in a plane on the page: a row for each component of their forces, one mode."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from stickslip.explorer.work.motion import _seen, verdict


@pytest.mark.parametrize(
    "name", ["puck", "turntable", "conveyor", "isolated_floor", "planar_jenkins", "tractrix"]
)
def test_what_a_page_gets(name: str) -> None:
    motion = ss.simulate(ss.catalogue.get(name))
    answer = _seen(motion, None)
    contacts = len(motion.system.contacts)
    rows = [group for group in answer.head["groups"] if group["kind"] == "friction"]
    assert len(rows) == 2 * contacts
    assert len({row["key"] for row in rows}) == 2 * contacts
    for row in rows:
        assert f"stick:{row['contact']}" in answer.arrays
        assert all(f"q:{line}" in answer.arrays for line in row["names"])
        force, plus, minus = (answer.arrays[f"q:{line}"] for line in row["names"])
        assert np.all((force <= plus * (1 + 1e-9)) & (-force <= minus * (1 + 1e-9)))
    assert {key for key in answer.arrays if key.startswith("mode:")} == {
        f"mode:{row['contact']}" for row in rows
    }
    assert all(np.all(np.isfinite(values)) for values in answer.arrays.values())
    assert verdict(motion)["certified"]
    assert answer.head["scene"]["about"] == f"{name}, seen from above"
