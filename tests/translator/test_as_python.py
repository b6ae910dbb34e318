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
motions = []
for name, flow in (("belt_block", "auto"), ("rocking_toy", "taylor"), ("block_chain", "auto")):
    motion = ss.simulate(ss.catalogue.get(name), (0.0, 12.0), flow=flow)
    knots = motion.knots
    motions.append([knots.clock.tolist(), knots.state.tolist(), knots.mode.tolist()])
compiled = any("prepared" in vars(entry) for entry in shelf.entries_of(shelf.ENGINE))
json.dump([functions.AS_PYTHON, compiled, motions], sys.stdout)
"""


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
    for compiled, python in zip(here[2], there[2], strict=True):
        assert len(compiled[0]) > 5
        for found, wanted in zip(python, compiled, strict=True):
            np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-12)
