"""The event loop as a CUDA kernel, in the simulator that comes with numba, against the same loop on the processor."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

import stickslip as ss
from stickslip.errors import StickslipError

SMALL_MAP = """
import numpy as np, stickslip as ss
from dataclasses import replace
from stickslip.motion.batch import follow_block, initial_states, parameter_table, pose_all
from stickslip.sweeps.device import follow_on_device
push = {"psi": np.zeros(3), "d_psi": np.full(3, 1.8), "x_R": np.zeros(3)}
cases = [
    (ss.catalogue.scaled_slider_limit(), {"b": [0.5, 1.0, 1.5], "nu": [0.01, 0.005, 0.01]}, {}, 8.0, True),
    (ss.catalogue.scaled_slider_limit(), {"b": [0.5, 1.0, 1.5]}, {}, 2.0, False),
    (ss.catalogue.rocking_toy(), {"P": [0.9, 1.0, 1.1]}, push, 8.0, True),
    (ss.catalogue.spring_slider(), {"V": [0.15, 0.18, 0.3]}, {}, 3.0, True),
]
for system, given, start, end, exact in cases:
    given = {name: np.array(values) for name, values in given.items()}
    table, states = parameter_table(system, given, 3), initial_states(system, start, 3)
    problem = replace(pose_all(system, given, 1e-10, 1e-12), exact=exact)
    here, codes = follow_block(problem, table, states, (0.0, end), 10**6, 12)
    there, other = follow_on_device(problem, table, states, (0.0, end))
    assert codes.tolist() == other.tolist() == [0, 0, 0], (system.name, codes, other)
    assert here.counters.tolist() == there.counters.tolist(), system.name
    assert np.max(np.abs(here.y - there.y)) <= 1e-12 * np.max(np.abs(here.y)), system.name
print("same")
"""


def test_small_maps_in_the_simulator() -> None:
    """In a process of its own: numba asks for the simulator when it is first imported."""
    run = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", SMALL_MAP],
        env={**os.environ, "NUMBA_ENABLE_CUDASIM": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.stdout.strip() == "same", run.stderr


def test_without_a_gpu_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    from stickslip.motion.batch import initial_states, parameter_table
    from stickslip.motion.problem import pose
    from stickslip.sweeps import device

    system = ss.catalogue.scaled_slider_limit()
    monkeypatch.setattr(device.cuda, "is_available", lambda: False)
    with pytest.raises(StickslipError, match="No CUDA device"):
        device.follow_on_device(pose(system), parameter_table(system, {}, 1), initial_states(system, {}, 1), (0.0, 1.0))
