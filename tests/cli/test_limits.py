"""Commands that last: ``--time-limit``, and Ctrl-C."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import stickslip as ss
from stickslip.cli.app import app

RUNNER = CliRunner()

ENDLESS = """\
name = "endless"
parameters.Q = {default = 0.5}
coordinates.x = {kind = "inertial", force = "cos(0.5*t) + Q*cos(sqrt(2)*0.5*t)"}
kinetic = "d_x**2/2"
potential = "x**2/2 + x**4/4"
contacts.ground = {direction = "d_x", threshold = "0.6"}
span = [0, 1e9]
"""


# A motion that settles on nothing: its cycle is looked for during millions of events.
IRREGULAR = """\
name = "irregular"
coordinates.x = {kind = "inertial", force = "7.5*cos(t)"}
kinetic = "d_x**2/2"
potential = "x**4/4"
viscous = "0.025*d_x**2"
contacts.ground = {direction = "d_x", threshold = "0.01"}
span = [0, 1e5]
"""

STIFF = ("run", "two_block_rate_and_state", "--until", "1e13", "--out", "out")  # long steps


@pytest.fixture
def endless(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "endless.toml").write_text(ENDLESS)
    for system in (ss.load("endless.toml"), ss.catalogue.two_block_rate_and_state()):
        ss.simulate(system, (0.0, 1.0))  # compiled before it counts


def command(*words: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "stickslip.cli", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.usefixtures("endless")
def test_a_motion_ends_at_its_limit() -> None:
    found = RUNNER.invoke(app, [*STIFF, "--time-limit", "0.1"])
    assert found.exit_code == 1, found.output
    summary = json.loads(Path("out/summary.json").read_text())
    assert summary["outcome"] == "time limit reached" and not summary["certified"]
    assert ss.open("out/trajectory.nc").outcome is ss.Outcome.TIME_UP


@pytest.mark.usefixtures("endless")
def test_a_cycle_that_is_not_found_in_time() -> None:
    found = RUNNER.invoke(app, "cycle rocking_toy --time-limit 1e-6 --out out".split())
    assert found.exit_code == 1 and found.stderr.count("\n") == 1
    said = "a cycle of rocking_toy: no result within the time limit of 1e-06 s"
    assert said in found.stderr


@pytest.mark.usefixtures("endless")
def test_points_of_a_map_that_take_too_long() -> None:
    over = "--over Q=0,0.4 --measure amplitude --max-time 1e9 --out m.zarr".split()
    found = RUNNER.invoke(app, ["sweep", "endless.toml", *over, "--time-limit", "0.2"])
    assert found.exit_code == 1, found.output
    assert "1 of them reached the time limit" in ss.open("m.zarr").message


@pytest.mark.usefixtures("endless")
@pytest.mark.parametrize("limit", ["0", "-1", "nan"])
def test_no_limit(limit: str) -> None:
    found = RUNNER.invoke(app, ["run", "endless.toml", "--time-limit", limit])
    assert found.exit_code == 2 and found.stderr.count("\n") == 1
    assert "time_limit" in found.stderr


@pytest.mark.usefixtures("endless")
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (STIFF, "the results so far are in out"),
        (("cycle", "catalogue.toml"), "nothing new was written"),
        (
            ("sweep", "endless.toml", "--over", "Q=0.4,0.5", "--measure", "amplitude"),
            "run the same command again to resume",
        ),
    ],
)
def test_control_c_is_answered_by_one_sentence(words: tuple[str, ...], said: str) -> None:
    Path("catalogue.toml").write_text(IRREGULAR)
    if words[0] == "sweep":
        words = (*words, "--max-time", "1e9", "--out", "m.zarr")
    if words[0] == "run":  # on a busy machine, compiling may take longer than the pause below
        compiled = RUNNER.invoke(app, [*words[:2], "--until", "1", "--out", "compiled"])
        assert compiled.exit_code == 0, compiled.output
    process = command(*words)
    deadline = time.monotonic() + 60.0
    while not [*Path().glob("**/.unfinished-*"), *Path().glob("m.zarr/zarr.json")]:
        assert time.monotonic() < deadline and process.poll() is None
        time.sleep(0.05)
    time.sleep(0.5)
    began = time.monotonic()
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=60.0)
    assert process.returncode == 130 and "Traceback" not in output + errors
    assert errors.startswith("stickslip: interrupted; ") and errors.count("\n") == 1
    assert said in errors
    if words[0] != "run":  # which still draws what it has
        assert time.monotonic() - began < 15.0  # however busy the machine is


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="there are no groups of processes")
@pytest.mark.usefixtures("endless")
def test_control_c_ends_a_local_cluster_by_one_sentence() -> None:
    """It reaches all processes of the terminal, the workers too."""
    pytest.importorskip("distributed")
    over = "--over Q=0.4:0.5:3 --measure amplitude --max-time 1e9 --out m.zarr --local-cluster"
    words = [sys.executable, "-m", "stickslip.cli", "sweep", "endless.toml", *over.split()]
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen([*words, "--workers", "2"], start_new_session=True, **pipes)
    try:
        deadline = time.monotonic() + 120.0
        while not Path("m.zarr/zarr.json").exists():
            assert time.monotonic() < deadline and process.poll() is None
            time.sleep(0.1)
        time.sleep(2.0)
        os.killpg(process.pid, signal.SIGINT)
        output, errors = process.communicate(timeout=60.0)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 130 and "Traceback" not in output + errors
    assert errors.startswith("stickslip: interrupted; 0 of 3 points are in m.zarr"), errors
    assert errors.count("\n") == 1
