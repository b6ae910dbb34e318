"""Maps on a GPU: on an emulated one, against the processor; as PTX; and without a GPU."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import stickslip as ss
from stickslip.cli.app import app
from stickslip.equations.native.systems import assembly_of, compile_system
from stickslip.errors import DeclarationError
from stickslip.machine_code import cuda, ptx
from stickslip.machine_code.emulated import Emulated
from stickslip.orbits.settling.engine.threads import advance_thread, grow_thread
from stickslip.sweeps import sweep
from stickslip.sweeps.work import device
from stickslip.sweeps.work.chunk import measure_chunk

LOOSE = ss.Settings(tolerance=1e-3)
SHORT = ss.Settings(tolerance=1e-2, max_time=80.0)
ENTRIES = advance_thread, grow_thread


@pytest.fixture
def emulated(monkeypatch: pytest.MonkeyPatch) -> Emulated:
    """A GPU in place of none."""
    monkeypatch.setenv("STICKSLIP_EMULATE_GPU", "1")
    made = Emulated()
    monkeypatch.setattr(device, "_emulated", lambda: made)
    return made


Case = tuple[str, dict[str, Any], dict[str, float], Sequence[str], ss.Settings]
CASES: Sequence[Case] = [
    (
        "scaled_slider_limit",
        {"b": [0.5, 1.5], "nu": [0.005, 0.01]},
        {},
        ["period", "amplitude"],
        LOOSE,
    ),
    (
        "rocking_toy",
        {"P": [1.0, 1.1], "d_psi": [0.4, 1.8]},
        {"psi": 0.0, "x_R": 0.0},
        "speed period switches energy_per_cycle peak_force mean_force stick_fraction".split(),
        LOOSE,
    ),
    ("spring_slider", {"V": [0.18]}, {}, ["period", "stick_fraction", "lyapunov"], SHORT),
    ("forced_oscillator", {"omega": [0.8]}, {}, ["amplitude", "period"], LOOSE),
]


def compare(case: Case) -> None:
    """Have a map of the processor and of the GPU the same numbers."""
    name, over, initial, measures, settings = case
    system = ss.catalogue.get(name)
    here = ss.sweep(system, over, measures, initial=initial, settings=settings)
    there = ss.sweep(system, over, measures, initial=initial, settings=settings, device="gpu")
    assert np.all(here["outcome"] == there["outcome"])
    assert np.any(here["outcome"] == 10)
    for variable in map(str, here.dataset.data_vars):
        # What is about 1e-7 apart has rounding errors of 1e-9 of that distance.
        allowed = 1e-8 if variable == "lyapunov" else 1e-12
        np.testing.assert_allclose(there[variable], here[variable], rtol=allowed, atol=allowed)


@pytest.mark.parametrize("case", CASES, ids=[case[0] for case in CASES])
def test_small_maps_are_those_of_the_processor(
    emulated: Emulated, monkeypatch: pytest.MonkeyPatch, case: Case
) -> None:
    monkeypatch.setattr(sweep, "DEVICE_LANES", 3)  # several chunks in a task, and several tasks
    compare(case)
    assert emulated.launches > 0


@pytest.mark.parametrize("case", CASES, ids=[case[0] for case in CASES])
def test_small_maps_on_a_gpu(monkeypatch: pytest.MonkeyPatch, case: Case) -> None:
    monkeypatch.delenv("STICKSLIP_EMULATE_GPU", raising=False)
    try:
        device.check_device()
    except DeclarationError as error:
        pytest.skip(error.reason)
    compare(case)


def test_its_memory_is_given_back(emulated: Emulated) -> None:
    ss.sweep(ss.catalogue.rocking_toy(), {"P": [1.0]}, ["speed"], settings=LOOSE, device="gpu")
    assert emulated.launches > 0 and emulated.taken == 0


def test_one_device_goes_on_with_what_the_other_has_begun(
    emulated: Emulated, tmp_path: Path
) -> None:
    given = ss.catalogue.scaled_slider_limit(), {"b": [0.5, 1.5]}, ["period"], tmp_path / "map.zarr"
    ss.sweep(*given, settings=LOOSE, device="gpu")
    before = emulated.launches
    ss.sweep(*given, settings=LOOSE, device="gpu")
    ss.sweep(*given, settings=LOOSE)
    assert emulated.launches == before > 0  # nothing is left to do


def test_no_kick_is_missed(emulated: Emulated) -> None:
    """Nothing shows it before it comes; see the test of the same name for processors."""
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
    given: tuple[Mapping[str, Any], ...] = {}, {"phi": np.array([3.0])}
    measures, settings = ["speed", "period", "switches"], ss.Settings(tolerance=1e-2)
    here = measure_chunk(system, *given, measures, settings)
    there = measure_chunk(system, *given, measures, settings, device="gpu")
    assert emulated.launches > 0
    assert there["lacking"][0] == 0 and 0.9 < there["speed"][0] * 2.0 * np.pi < 1.0
    for name in ("outcome", "period", "speed", "switches"):
        np.testing.assert_allclose(there[name], here[name], rtol=1e-9, err_msg=name)


# -- PTX -------------------------------------------------------------------------------------------


@pytest.fixture
def mathematics(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """NVIDIA's mathematical library, and an empty cache."""
    try:
        found = ptx.find_mathematics()
    except DeclarationError as error:
        pytest.skip(f"{error.reason}: the extra 'gpu' is not in 'test'")
    monkeypatch.setenv("STICKSLIP_CACHE", str(tmp_path / "cache"))
    return found


def system_text(system: ss.System) -> str:
    """The functions of a system as LLVM assembly."""
    return assembly_of(compile_system(system).generated)


def test_it_compiles_without_a_gpu(
    mathematics: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It also tests that they are kept: the next process makes nothing again."""
    system = system_text(ss.catalogue.scaled_slider_limit())
    code = ptx.ptx_of(ENTRIES, system)
    text = code.decode()
    for name in ("advance_thread", "grow_thread"):
        assert f".visible .entry {name}(" in text
    assert "fma.rn.f64" in text and "div.rn.f64" in text and "sqrt.rn.f64" in text
    assert not re.search(r"\.extern|div\.(full|approx)|sqrt\.approx\.(?!ftz)|mul\.ftz", text)
    monkeypatch.setattr(ptx, "_made", None)
    assert ptx.ptx_of(ENTRIES, system) == code
    with pytest.raises(TypeError):
        ptx.ptx_of(ENTRIES, f"{system}\n; another system")
    if shutil.which("ptxas") is None:
        pytest.skip("no ptxas, NVIDIA's assembler, on the path; what it would be given looks right")
    place = tmp_path / "entries.ptx"
    place.write_bytes(code)
    given = ["ptxas", "--compile-only", "--gpu-name=sm_80", str(place), "-o", str(tmp_path / "o")]
    assert subprocess.run(given, capture_output=True, check=False).stderr == b""


def test_a_table_of_samples_is_refused(mathematics: Path) -> None:
    """It stands in the memory of this process."""
    system = ss.System(
        name="shaken",
        drives={"a": ss.Samples([0.0, 1.0, 2.0], [0.0, 1.0, 0.0], periodic=True)},
        coordinates={"x": ss.Inertial(force="-a")},
        kinetic="d_x**2/2",
        contacts={"base": ss.Contact("d_x", 0.3)},
        span=(0, 10),
    )
    with pytest.raises(DeclarationError, match=r"a table of samples \(.*\) cannot be called"):
        ptx.ptx_of(ENTRIES, system_text(system))


# -- without a GPU ---------------------------------------------------------------------------------

GIVEN = ["sweep", "rocking_toy", "--over", "P=1:1.1:2", "--measure", "speed", "--out", "toy.zarr"]


@pytest.mark.parametrize(
    ("installed", "option", "said"),
    [
        (False, ["--device", "gpu"], "libdevice, NVIDIA's mathematical library, was not found"),
        (True, ["--device", "gpu"], "NVIDIA's driver (no driver) is not installed"),
        (True, ["--device", "gpu", "--processes"], "a GPU needs the scheduler"),
        (True, ["--device", "tpu"], "unknown device 'tpu'"),
    ],
)
def test_without_a_gpu_it_says_so(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    installed: bool,
    option: list[str],
    said: str,
) -> None:
    here, there = tmp_path / "here", tmp_path / "cuda"
    here.mkdir()
    monkeypatch.chdir(here)
    monkeypatch.delenv("STICKSLIP_EMULATE_GPU", raising=False)
    monkeypatch.setattr(cuda, "_DRIVER", "no driver")
    monkeypatch.setattr(ptx, "_folders", lambda: iter([there]))
    if installed:
        (there / "nvvm" / "libdevice").mkdir(parents=True)
        (there / "nvvm" / "libdevice" / "libdevice.10.bc").touch()
    result = CliRunner().invoke(app, [*GIVEN, *option], catch_exceptions=False)
    assert result.exit_code == 2
    assert said in result.stderr and result.stderr.strip().count("\n") == 0
    assert not list(here.iterdir())
    with pytest.raises(DeclarationError, match="device"):
        ss.sweep(ss.catalogue.rocking_toy(), {"P": [1.0]}, ["speed"], device="gpu")
