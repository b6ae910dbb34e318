"""Maps on a GPU: in the simulator that comes with numba, against the processor; as machine code;
and without a GPU."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from typer.testing import CliRunner

import stickslip as ss
from stickslip.cli.app import app
from stickslip.errors import DeclarationError
from stickslip.sweeps.work import device

SMALL_MAPS = """
import numpy as np, stickslip as ss
from stickslip.sweeps import sweep
from stickslip.sweeps.work import device
loose, short = ss.Settings(tolerance=1e-3), ss.Settings(tolerance=1e-2, max_time=80.0)
push = {"psi": 0.0, "x_R": 0.0}
cases = [
    (ss.catalogue.scaled_slider_limit(), {"b": [0.5, 1.5], "nu": [0.005, 0.01]}, {},
     ["period", "amplitude"], loose),
    (ss.catalogue.rocking_toy(), {"P": [1.0, 1.1], "d_psi": [0.4, 1.8]}, push,
     ["speed", "period", "switches", "energy_per_cycle", "peak_force", "mean_force",
      "stick_fraction"], loose),
    (ss.catalogue.spring_slider(), {"V": [0.18]}, {},
     ["period", "stick_fraction", "lyapunov"], short),
    (ss.catalogue.forced_oscillator(), {"omega": [0.8]}, {}, ["amplitude", "period"], loose),
]
launches, launch = [], device.OnDevice._launch
device.OnDevice._launch = lambda *given: (launches.append(1), launch(*given))[1]
sweep.DEVICE_LANES = 3  # several chunks in a task, and several tasks
for system, over, initial, measures, settings in cases:
    here = ss.sweep(system, over, measures, initial=initial, settings=settings)
    before = len(launches)
    there = ss.sweep(system, over, measures, initial=initial, settings=settings, device="gpu")
    assert len(launches) > before, system.name
    assert np.all(here["outcome"] == there["outcome"]), system.name
    assert np.any(here["outcome"] == 10), system.name
    for name in here.dataset.data_vars:
        # What is about 1e-7 apart has rounding errors of 1e-9 of that distance.
        allowed = 1e-8 if name == "lyapunov" else 1e-12
        np.testing.assert_allclose(
            there[name], here[name], rtol=allowed, atol=allowed, err_msg=system.name
        )
ss.sweep(*cases[0][:2], ["period"], "map.zarr", settings=loose, device="gpu")
before = len(launches)
# The other device finds nothing left to do.
ss.sweep(*cases[0][:2], ["period"], "map.zarr", settings=loose)
assert len(launches) == before
print("same")
"""

KICKED = """
import numpy as np, stickslip as ss
from stickslip.sweeps.work.chunk import measure_chunk
values = {"omega": 1.0, "phi": 3.0, "w": 1e-2, "I": 1.0, "F_s": 0.5}
system = ss.System(
    name="kicked",
    parameters={name: ss.Parameter(value) for name, value in values.items()},
    drives={"kick": "I*omega/(w*sqrt(2*pi))*exp(-2*(sin((omega*t - phi)/2)/w)**2)"},
    coordinates={"x": ss.Inertial(force="kick")},
    kinetic="d_x**2/2",
    contacts={"ground": ss.Contact("d_x", "F_s")},
    translation={"x": 1},
    span=(0, 50),
)
given = {}, {"phi": np.array([3.0])}, ["speed", "period", "switches"], ss.Settings(tolerance=1e-2)
here, there = measure_chunk(system, *given), measure_chunk(system, *given, device="gpu")
assert there["lacking"][0] == 0 and 0.9 < there["speed"][0] * 2.0 * np.pi < 1.0
for name in ("outcome", "period", "speed", "switches"):
    np.testing.assert_allclose(there[name], here[name], rtol=1e-9, err_msg=name)
print("same")
"""

PTX = """
import types, numpy as np, stickslip as ss
from numba import cuda, types as numba_types, typeof
from numba.cuda import dispatcher
from stickslip.motion.simulate_many import initial_states, parameter_table, pose_all
from stickslip.sweeps.work import chunk, device
# What a GPU is asked for.
dispatcher.get_current_device = lambda: types.SimpleNamespace(compute_capability=(8, 0))
cuda.to_device = lambda part: part
system = ss.catalogue.scaled_slider_limit()
problem = pose_all(system, {}, 1e-10, 1e-12)
table, states = parameter_table(system, {}, 1), initial_states(system, {}, 1)
block = chunk.Block(problem, table, states, chunk.Settings(), True)
there = device.OnDevice(block, np.zeros(1, np.int64))
given = there.engine, there.marks, there.rules, there.saved, there.bench, there.found, there.stop
signature = numba_types.void(*map(typeof, given))
code, _ = cuda.compile_ptx(there.kernels[0].python, signature, cc=(8, 0), opt=False)
assert ".visible .entry" in code and "fma.rn.f64" in code
print("compiled")
"""


def python(code: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """In a process of its own: numba decides what its CUDA is when it is first imported."""
    command = [sys.executable, "-W", "ignore", "-c", code]
    given = {**os.environ, **environment}
    return subprocess.run(
        command, cwd=folder, env=given, capture_output=True, text=True, check=False
    )


@pytest.mark.skipif(
    find_spec("numba_cuda") is None, reason="numba-cuda has the simulator; it is not installed"
)
def test_small_maps_in_the_simulator(tmp_path: Path) -> None:
    run = python(SMALL_MAPS, tmp_path, NUMBA_ENABLE_CUDASIM="1")
    assert run.stdout.strip() == "same", run.stderr


@pytest.mark.skipif(
    find_spec("numba_cuda") is None, reason="numba-cuda has the simulator; it is not installed"
)
def test_no_kick_is_missed_in_the_simulator(tmp_path: Path) -> None:
    """Nothing shows it before it comes; see the test of the same name for processors."""
    run = python(KICKED, tmp_path, NUMBA_ENABLE_CUDASIM="1")
    assert run.stdout.strip() == "same", run.stderr


@pytest.mark.skipif(
    find_spec("nvidia") is None, reason="the extra 'gpu' has the compiler: 430 MB, so not in 'test'"
)
def test_the_kernel_compiles_without_a_gpu(tmp_path: Path) -> None:
    run = python(PTX, tmp_path)
    assert run.stdout.strip() == "compiled", run.stderr


GIVEN = ["sweep", "rocking_toy", "--over", "P=1:1.1:2", "--measure", "speed", "--out", "toy.zarr"]


@pytest.mark.parametrize(
    ("installed", "option", "said"),
    [
        (
            None,
            ["--device", "gpu"],
            "numba-cuda, which drives the GPU, is not installed. Install stickslip[gpu]",
        ),
        ("there", ["--device", "gpu"], "no CUDA device was found"),
        ("there", ["--device", "gpu", "--processes"], "a GPU serves the threads of one process"),
        ("there", ["--device", "tpu"], "there is no 'tpu'"),
    ],
)
def test_without_a_gpu_it_says_so(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    installed: str | None,
    option: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(device, "find_spec", lambda name: installed)
    monkeypatch.setattr(device.cuda, "is_available", lambda: False)
    result = CliRunner().invoke(app, [*GIVEN, *option], catch_exceptions=False)
    assert result.exit_code == 2
    assert said in result.stderr and result.stderr.strip().count("\n") == 0
    assert not list(tmp_path.iterdir())
    with pytest.raises(DeclarationError, match="device"):
        ss.sweep(ss.catalogue.rocking_toy(), {"P": [1.0]}, ["speed"], device="gpu")
