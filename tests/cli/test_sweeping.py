"""The commands ``sweep`` and ``plot``, and the pictures."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

import stickslip as ss
from figures.boxes import hatched
from stickslip.cli.app import app
from stickslip.errors import DeclarationError
from stickslip.figures.sweep import plot_sweep
from stickslip.sweeps.adaptive import Adaptive
from stickslip.sweeps.request.measures import measures_of
from stickslip.sweeps.sweep import Map, Progress, sweep
from sweeps import stand_in

TOY = ss.catalogue.rocking_toy()
OVER = ["--over", "P=0.6:1.6:12", "--over", "delta=log:0.01:0.2:9"]
GIVEN = ["sweep", "rocking_toy", *OVER, "--measure", "speed", "--out", "toy.zarr"]


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    stand_in.put_in_place(monkeypatch)


def stickslip(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments), catch_exceptions=False)


def test_sweep_and_plot() -> None:
    result = stickslip(
        *GIVEN, "--measure", "cost = 2*speed", "--set", "rho=0.25", "--initial", "psi=0.5"
    )
    assert result.exit_code == 0, result.output
    rows = {
        line.strip().split("  ")[0]: line.split()[-1] for line in result.stdout.splitlines()[1:]
    }
    data = Map.open("toy.zarr")
    assert rows["points"] == "108"
    assert int(rows["at rest forever"]) == int((data["outcome"] == 1).sum())
    assert int(rows["certified"]) == int((data["certificate"] < 1e-8).sum())
    assert rows["written"] == "toy.zarr"
    np.testing.assert_array_equal(data["cost"], 2.0 * data["speed"])
    result = stickslip("plot", "toy.zarr", "--measure", "cost")
    assert (result.exit_code, result.stdout) == (0, "toy.png\n")
    assert Path("toy.png").read_bytes().startswith(b"\x89PNG")


def test_the_same_command_computes_nothing_again() -> None:
    stickslip(*GIVEN)
    stand_in.calls.clear()
    assert stickslip(*GIVEN).exit_code == 0
    assert not stand_in.calls
    assert (
        "--extend" in stickslip(*GIVEN[:2], "--over", "P=0.6:1.6:23", *OVER[2:], *GIVEN[6:]).stderr
    )
    assert (
        stickslip(*GIVEN[:2], "--over", "P=0.6:1.6:23", *OVER[2:], *GIVEN[6:], "--extend").exit_code
        == 0
    )
    assert sum(stand_in.calls) == 11 * 9


def test_a_function_from_a_file() -> None:
    Path("mine.py").write_text(
        "def first(trajectory):\n    return trajectory.parameters['P'] if 1 else None\n"
    )
    Path("short.toml").write_text(TOY.to_toml().replace("span = [0, 120]", "span = [0, 1]"))
    given = ["sweep", "short.toml", "--over", "P=1:1.5:3", "--out", "f.zarr", "--measure"]
    assert stickslip(*given, "mine.py:first").exit_code == 0
    np.testing.assert_array_equal(Map.open("f.zarr")["first"], [1.0, 1.25, 1.5])
    assert "unknown function 'frist'" in stickslip(*given, "mine.py:frist").stderr
    Path("mine.py").write_text("def first(trajectory):\n    return float('nan')\n")
    assert "other measures" in stickslip(*given, "mine.py:first").stderr
    result = stickslip(*given, "mine.py:first", "--overwrite")
    assert "3 returned nan" in result.stdout


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--over", "P=2:1:0", "--measure", "speed"], "not a number of points"),
        (["--over", "P=-1:1:4", "--measure", "speed"], "outside the admissible range"),
        (["--over", "P=1:2:4", "--measure", "sped"], "unknown measure 'sped'"),
        (
            ["--over", "P=1:2:4", "--measure", "speed", "--initial", "phi=1"],
            "not a part of the state",
        ),
        (
            ["--over", "psi=1:2:4", "--measure", "speed", "--initial", "psi=1"],
            "it already varies along an axis",
        ),
        (
            ["--over", "P=1:2:4", "--measure", "speed", "--adaptive", "period"],
            "not one of the measures",
        ),
        (
            ["--over", "P=1:2:4", "--measure", "speed", "--processes", "--local-cluster"],
            "exclude each other",
        ),
        (["--over", "P=1:2:4", "--measure", "speed", "--workers", "0"], "number of workers"),
        (["--over", "P=1:2:4", "--measure", "speed", "--rtol", "0"], "rtol: 0.0 is out of range"),
    ],
)
def test_wrong_input_is_one_line_and_leaves_nothing(arguments: list[str], said: str) -> None:
    result = stickslip("sweep", "rocking_toy", *arguments)
    assert result.exit_code == 2
    assert said in result.stderr
    assert result.stderr.strip().count("\n") == 0
    assert not stand_in.calls


def test_plot_of_what_is_no_map() -> None:
    assert "no such file" in stickslip("plot", "nowhere.zarr").stderr
    stickslip(*GIVEN)
    assert (
        "the map has no measure 'period'"
        in stickslip("plot", "toy.zarr", "--measure", "period").stderr
    )
    assert "unknown figure format" in stickslip("plot", "toy.zarr", "--out", "toy.xyz").stderr
    assert "not a map" in stickslip("plot", ".").stderr


def test_control_c_names_what_is_kept() -> None:
    code = (
        "import sys; from sweeps import stand_in; sys.modules['stickslip.sweeps.work.chunk'] = "
        "stand_in;"
        "fast = stand_in.measure_chunk;"
        "stand_in.measure_chunk = lambda *given: (stand_in.time.sleep(0.2), fast(*given))[1];"
        "from stickslip.cli import main; sys.argv[0] = 'stickslip'; main()"
    )
    given = [
        *GIVEN[:2],
        "--over",
        "P=0.6:1.6:40",
        "--over",
        "delta=0.01:0.2:40",
        *GIVEN[6:],
        "--workers",
        "1",
    ]
    environment = os.environ | {"PYTHONPATH": str(Path(stand_in.__file__).parent.parent)}
    command = [sys.executable, "-c", code, *given]
    process = subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    deadline = time.monotonic() + 30
    while not list(Path().glob("toy.zarr/outcome/c/*/*")) and time.monotonic() < deadline:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130, err
    assert out == ""
    done = int((Map.open("toy.zarr")["outcome"] >= 0).sum())
    assert 0 < done < 1600
    assert err.strip() == (
        f"stickslip: interrupted; {done:,} of 1,600 points are in toy.zarr; run the same "
        "command again to resume"
    )


def test_the_line_of_progress() -> None:
    assert Progress(0, 2000, 0, 0.0, {}).describe() == "0 of 2,000 points"
    line = Progress(1500, 2000, 1000, 2.0, {0: 1400, 1: 100}).describe()
    assert line == "1,500 of 2,000 points, 500/s: 1,400 finished, 100 at rest forever"


# -- pictures --------------------------------------------------------------------------------------


def test_a_map_shows_values_hatches_and_logarithmic_axes() -> None:
    data = sweep(TOY, {"P": "0.6:1.6:12", "delta": "log:0.01:0.2:9"}, ["period", "speed"]).dataset
    assert measures_of(data) == ["period", "speed"]
    period, speed, *bars = plot_sweep(data).axes
    assert len(bars) == 2
    assert speed.get_yscale() == "log"
    assert speed.get_xscale() == "linear"
    assert "N" in speed.get_xlabel()
    assert "m/s" in bars[1].get_ylabel()
    mesh = speed.collections[0]
    np.testing.assert_array_equal(
        np.asarray(mesh.get_array()).reshape(9, 12), data["speed"].values.T
    )
    assert {letter for letter, _ in hatched(speed)} == {"/"}
    edges = mesh.get_coordinates()  # type: ignore[attr-defined]
    np.testing.assert_allclose(edges[1:, 0, 1] / edges[:-1, 0, 1], 20 ** (1 / 8))
    legend = {text.get_text() for text in plot_sweep(data).legends[0].get_texts()}
    assert legend == {"not certified (closure)", "no value: at rest forever"}
    grey, values = (
        np.isnan(np.asarray(mesh.get_array()).astype(float)) for mesh in period.collections[:2]
    )
    assert np.any(values) and np.array_equal(values, ~grey)


def test_lines_dots_and_small_multiples() -> None:
    line = plot_sweep(sweep(TOY, {"P": "log:0.6:1.6:12"}, ["speed", "period"]).dataset).axes
    assert len(line) == 2
    assert line[1].get_xscale() == "log"
    np.testing.assert_allclose(np.asarray(line[0].lines[0].get_xdata()), np.geomspace(0.6, 1.6, 12))
    dots = plot_sweep(
        sweep(TOY, {"P,delta": "halton:30; 0.6:1.6; 0.01:0.2"}, ["speed"]).dataset
    ).axes
    assert len(np.asarray(dots[0].collections[0].get_offsets())) == 30
    multiples = plot_sweep(
        sweep(TOY, {"P": "0.6:1.6:12", "delta": "0.01:0.2:9", "psi": "0:1:3"}, ["speed"]).dataset
    ).axes
    assert [axes.get_title("left").split("=")[1].split()[0] for axes in multiples[:3]] == [
        "0",
        "0.5",
        "1",
    ]
    limits = {axes.collections[0].get_clim() for axes in multiples[:3]}
    assert len(limits) == 1


def test_outcomes_and_interpolated_points() -> None:
    over = {"P": "0.6:1.6:33", "delta": "0.01:0.2:33"}
    figure = plot_sweep(sweep(TOY, over, ["speed"], adaptive=Adaptive()).dataset, ["outcome"])
    names = [text.get_text() for text in figure.axes[1].get_yticklabels()]
    assert names == ["at rest forever", "finished"]
    assert any("interpolated from" in text.get_text() for text in figure.legends[0].get_texts())


def test_four_axes_have_no_picture() -> None:
    over = {"P": "1:2:2", "delta": "0.1:0.2:2", "psi": "0:1:2", "rho": "0.1:0.2:2"}
    with pytest.raises(DeclarationError, match="cannot be plotted"):
        plot_sweep(sweep(TOY, over, ["speed"]).dataset)
