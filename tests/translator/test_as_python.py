"""Compiled functions as Python: a motion without compiled code, to be followed with a debugger."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from typing import Any

import numpy as np

SCRIPT = """
import json, sys
import stickslip as ss
from stickslip.machine_code import functions, shelf
motions = {}
# In Python, an index beyond the end of an array is an error: compiled code read such an entry where
# the components of a plane move different coordinates, as in two of these.
for name, flow, end in (
    ("belt_block", "auto", 12.0),
    ("rocking_toy", "taylor", 12.0),
    ("block_chain", "auto", 12.0),
    ("conveyor", "auto", 2.0),
    ("puck", "auto", 2.0),
    ("cart_pendulum", "auto", 1.5),  # inertia moves
):
    motion = ss.simulate(ss.catalogue.get(name), (0.0, end), flow=flow)
    knots = motion.knots
    motions[name] = [knots.clock.tolist(), knots.state.tolist(), knots.mode.tolist()]
compiled = any("prepared" in vars(entry) for entry in shelf.entries_of(shelf.ENGINE))
json.dump([functions.AS_PYTHON, compiled, motions], sys.stdout)
"""
KNOTS_ALIKE = ("belt_block", "rocking_toy", "block_chain", "cart_pendulum")
# How long the many steps before the end of a slip in a plane are, rounding errors decide.
ENDS_ALIKE = ("conveyor", "puck")


def motions(**environment: str) -> list[Any]:
    """What a process computes."""
    command = [sys.executable, "-W", "error", "-c", SCRIPT]
    done = subprocess.run(
        command, env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_a_motion_as_python() -> None:
    here, there = motions(STICKSLIP_AS_PYTHON=""), motions(STICKSLIP_AS_PYTHON="1")
    assert here[:2] == [False, True]
    assert there[:2] == [True, False]
    assert here[2].keys() == there[2].keys() == {*KNOTS_ALIKE, *ENDS_ALIKE}
    for name, compiled in here[2].items():
        python = there[2][name]
        assert len(compiled[0]) > 5
        pairs = [(python[1][-1], compiled[1][-1])]
        if name in KNOTS_ALIKE:
            pairs += zip(python, compiled, strict=True)
        for found, wanted in pairs:
            np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-12)
