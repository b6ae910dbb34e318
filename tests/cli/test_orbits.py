"""The commands of the long run: what they print, what they write, and how they end."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
import xarray as xr
from typer.testing import CliRunner, Result

import stickslip as ss
from stickslip.cli.app import app
from stickslip.cli.commands.orbits import (
    BACKBONE,
    BASIN,
    BRANCH,
    CYCLE,
    EQUILIBRIA,
    RESPONSE,
    RING_DOWN,
)
from stickslip.cli.common.present import Files

SLIDER = ("--set", "mu=2/sqrt(alpha)", "--set", "nu=1/20")


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def stickslip(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments), catch_exceptions=False)


def summary(folder: Path, files: Files) -> dict:
    assert sorted(path.name for path in folder.iterdir()) == sorted(files.names)
    assert (folder / "overview.png").read_bytes().startswith(b"\x89PNG")
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))


def test_equilibria(tmp_path: Path) -> None:
    result = stickslip("equilibria", "spring_slider", *SLIDER, "--set", "V=0.3")
    assert result.exit_code == 0, result.stderr
    assert "stable" in result.stdout
    folder = tmp_path / "out" / "spring_slider-equilibria"
    found = summary(folder, EQUILIBRIA)
    (only,) = found["equilibria"]
    # U = μ(α) + νV, α = 1 + UV.
    U, alpha = only["state"]["U"], only["state"]["alpha"]
    assert pytest.approx(2 / alpha**0.5 + 0.05 * 0.3) == U
    assert alpha == pytest.approx(1 + 0.3 * U)
    assert only["stable"] is True
    assert (folder / "equilibria.csv").read_text(encoding="utf-8").startswith("dimension,U,alpha")


def test_set_of_equilibria() -> None:
    result = stickslip("equilibria", "rocking_toy", "--json")
    (only,) = json.loads(result.stdout)["equilibria"]
    assert only["dimension"] == 2
    assert only["modes"] == {"right leg": "stick", "left leg": "stick"}


def test_cycle(tmp_path: Path) -> None:
    result = stickslip("cycle", "rocking_toy")
    assert result.exit_code == 0, result.stderr
    assert "speed 0.1675328" in result.stdout
    folder = tmp_path / "out" / "rocking_toy-cycle"
    found = summary(folder, CYCLE)
    assert found["drift"] == pytest.approx(1.0)
    assert found["stable"] is True
    period = ss.open(folder / "cycle.nc")
    assert period.certificate.ok
    assert period.period == pytest.approx(found["period"])


def test_cycle_that_is_none() -> None:
    result = stickslip("cycle", "rocking_toy", "--initial", "psi=0.1", "--initial", "x_R=0")
    assert result.exit_code == 1
    assert "comes to rest" in result.stderr
    assert not Path("out").exists()


def test_branch(tmp_path: Path) -> None:
    result = stickslip("branch", "spring_slider", *SLIDER, "--over", "V=0.22:0.23")
    assert result.exit_code == 0, result.stderr
    assert "Hopf at V = 0.2248493012" in result.stdout
    folder = tmp_path / "out" / "spring_slider-branch"
    found = summary(folder, BRANCH)
    stored = ss.open(folder / "branch.nc")
    assert [s["value"] for s in found["special"]] == [s.value for s in stored.special]
    assert found["points"] == stored.points.sizes["point"]
    assert (
        len((folder / "branch.csv").read_text(encoding="utf-8").splitlines()) == 1 + found["points"]
    )


def test_branch_of_cycles(tmp_path: Path) -> None:
    result = stickslip("branch", "belt_block", "--cycle", "--over", "V=0.25:0.35", "--out", "mine")
    assert result.exit_code == 0, result.stderr
    stored = ss.open(tmp_path / "mine" / "branch.nc")
    V, T = stored.points["V"].values, stored.points["period"].values
    assert (V[0], V[-1]) == pytest.approx((0.25, 0.35))
    assert ss.catalogue.belt_block().values["V"] == 0.3
    assert T[abs(V - 0.3).argmin()] == pytest.approx(7.0952615, abs=1e-6)


def test_basin(tmp_path: Path) -> None:
    over = ("--over", "psi=-1:1:5", "--over", "d_psi=-9/10:0.9:4")
    result = stickslip("basin", "rocking_toy", *over, "--initial", "x_R=0")
    assert result.exit_code == 0, result.stderr
    assert "walking" in result.stdout
    found = summary(tmp_path / "out" / "rocking_toy-basin", BASIN)
    assert {e["kind"] for e in found["attractors"]} == {"walking", "rest"}
    assert found["section"]["d_psi"] == [-0.9, 0.9, 4]
    with xr.open_dataset(tmp_path / "out" / "rocking_toy-basin" / "basin.nc") as stored:
        assert stored["attractor"].shape == (5, 4)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["branch", "spring_slider", "--over", "V=0.2"], "not of the form V=LOW:HIGH"),
        (["branch", "spring_slider", "--over", "V=0.2:x"], "not a number"),
        (["branch", "spring_slider", "--over", "V=0.4:0.2"], "not a range"),
        (["branch", "spring_slider", "--over", "W=0.1:0.2"], "W"),
        (
            ["branch", "spring_slider", "--over", "V=0.1:0.2", "--over", "nu=0.1:0.2"],
            "Give one parameter",
        ),
        (["basin", "rocking_toy", "--over", "psi=-1:1:5"], "Give two, each with"),
        (
            ["basin", "rocking_toy", "--over", "psi=-1:1:5.5", "--over", "d_psi=-1:1:5"],
            "Give an integer",
        ),
        (
            ["basin", "rocking_toy", "--over", "psi=-1:1:4000", "--over", "d_psi=-1:1:4000"],
            "more than 10,000,000 states",
        ),
        (
            [
                "basin",
                "rocking_toy",
                "--over",
                "psi=-1:1:5",
                "--over",
                "d_psi=-1:1:5",
                "--initial",
                "psi=1",
            ],
            "Give it once",
        ),
        (["branch", "spring_slider", "--over", "V"], "--over V=LOW:HIGH"),
        (
            ["basin", "rocking_toy", "--over", "phi=-1:1:5", "--over", "d_psi=-1:1:5"],
            "unknown parameter",
        ),
        (["cycle", "rocking_toy", "--initial", "phi=1"], "phi"),
        (["cycle", "no_such_toy"], "unknown system"),
        (["equilibria", "forced_oscillator"], "depend on time"),
    ],
)
def test_bad_input(arguments: list[str], message: str) -> None:
    result = stickslip(*arguments)
    assert result.exit_code == 2
    assert result.stdout == ""
    line = result.stderr.strip()
    assert line.startswith("stickslip: ")
    assert message in line
    assert "\n" not in line
    assert not Path("out").exists()


def test_a_file_of_somebody_else_stays() -> None:
    folder = Path("mine")
    folder.mkdir()
    (folder / "basin.nc").write_text("precious", encoding="utf-8")
    over = ("--over", "psi=-1:1:2", "--over", "d_psi=-1:1:2")
    result = stickslip("basin", "rocking_toy", *over, "--out", "mine")
    assert result.exit_code == 2
    assert "not written by stickslip" in result.stderr
    assert (folder / "basin.nc").read_text(encoding="utf-8") == "precious"


def test_units_are_said() -> None:
    result = stickslip("cycle", "two_leg_crawler")
    lines = [" ".join(line.split()) for line in result.stdout.splitlines()]
    assert "drift 0.8 m per period, speed 0.127323954 m/s" in lines
    assert "energy per distance 0.2 N" in lines
    found = json.loads(Path("out/two_leg_crawler-cycle/summary.json").read_text(encoding="utf-8"))
    assert found["units"] == {
        "time": "s",
        "energy": "N*m",
        "drift": "m",
        "speed": "m/s",
        "energy_per_distance": "N",
    }


def test_a_neutral_cycle_is_not_called_unstable() -> None:
    # Without damping the plate oscillates on as it likes; the forced motion has the period of the
    # imbalance.
    result = stickslip("cycle", "plate_compactor", "--json")
    found = json.loads(result.stdout)
    assert found["stability"] == "neutral"
    assert found["period"] == pytest.approx(2.0 * math.pi / 60.0, rel=1e-12)
    assert found["drift"] == pytest.approx(0.1 * found["period"], rel=1e-9)


def test_a_cycle_shows_what_was_measured() -> None:
    """The numbers with their limits, in the table and in summary.json."""
    result = stickslip("cycle", "plate_compactor", "--set", "F=800", "--set", "V=0.005")
    assert result.exit_code == 0, result.stderr
    assert "certified: all 9 residuals within their limits" in result.stdout
    for name in ("closure", "movement", "multipliers 1", "multipliers 0", "neighbours"):
        assert name in result.stdout
    found = json.loads(Path("out/plate_compactor-cycle/summary.json").read_text(encoding="utf-8"))[
        "certificate"
    ]
    assert found["ok"] is True
    limits = {residual["name"]: residual["limit"] for residual in found["residuals"]}
    assert limits["closure"] == 1e-9


def test_families_and_irregular_motion_are_named() -> None:
    result = stickslip("cycle", "forced_oscillator", "--set", "F_c=0.2", "--set", "omega=0.5")
    assert result.exit_code == 1
    assert "the cycles form a continuous family" in result.stderr
    assert "Traceback" not in result.stderr


def test_a_branch_shows_what_was_measured() -> None:
    result = stickslip("branch", "belt_block", "--cycle", "--over", "V=0.2:0.4", "--json")
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    assert found["range"] == [0.2, 0.4]
    names = {residual["name"] for residual in found["certificate"]["residuals"]}
    assert {"closure", "beyond the range", "largest step", "neighbours"} <= names


def test_response(tmp_path: Path) -> None:
    out = tmp_path / "response"
    given = ("forced_oscillator", "--over", "omega=1.2:1.3", "--level", "F_c=0.3", "--points", "2")
    result = stickslip("response", *given, "--out", str(out))
    assert result.exit_code == 0, result.stderr
    found = summary(out, RESPONSE)
    assert (found["level"], found["levels"]) == ("F_c", [0.3])
    (top,) = found["largest response"]
    assert top["amplitude"] == pytest.approx(2.0723838, abs=1e-6)  # Den Hartog's at 1.2
    result = stickslip("plot", str(out / "response.nc"), "--measure", "stick", "--time", "0:1")
    assert result.exit_code == 2 and "not a motion" in result.stderr


def test_response_of_a_formula(tmp_path: Path) -> None:
    """Of twice the coordinate it is twice as large, whichever way that is written."""
    given = ("forced_oscillator", "--over", "omega=1.2:1.3", "--points", "2", "--set", "F_c=0.3")
    for of in ("2*x", "x + x"):
        out = tmp_path / of
        result = stickslip("response", *given, "--of", of, "--out", str(out))
        assert result.exit_code == 0, result.stderr
        found = summary(out, RESPONSE)
        assert found["coordinate"] == of
        (top,) = found["largest response"]
        assert top["amplitude"] == pytest.approx(2.0 * 2.0723838, abs=2e-6)
    result = stickslip("response", *given, "--of", "2*z")
    assert result.exit_code == 2
    assert "z" in result.stderr and "Traceback" not in result.stderr


def test_a_response_finds_the_frequency_of_the_drive(tmp_path: Path) -> None:
    out = tmp_path / "response"
    given = ("--set", "F_c=0.3", "--set", "omega=1.2", "--points", "2")
    result = stickslip("response", "forced_oscillator", *given, "--out", str(out))
    assert result.exit_code == 0, result.stderr
    omega = ss.open(out / "response.nc").dataset["omega"].values
    assert [omega.min(), omega.max()] == pytest.approx([0.6, 1.8])
    result = stickslip("response", "rocking_toy")
    assert result.exit_code == 2
    assert "--over: no parameter changes the frequency of a drive" in result.stderr


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (("--over", "omga=1:2"), "omga"),
        (("--over", "omega=1"), "not of the form omega=LOW:HIGH"),
        (("--over", "omega=1:2", "--over", "m=1:2"), "2 parameters were given"),
        (("--over", "omega=1:2", "--level", "G=1"), "levels.G"),
        (("--over", "k=1:2"), "it does not change the period of the drives"),
    ],
)
def test_a_response_that_makes_no_sense_is_refused(given: tuple[str, ...], message: str) -> None:
    result = stickslip("response", "forced_oscillator", *given)
    assert result.exit_code == 2
    assert message in result.stderr and "Traceback" not in result.stderr


def test_ring_down(tmp_path: Path) -> None:
    start = ("--initial", "x=5", "--initial", "r_damper=4.5")
    model = ("jenkins_oscillator", "--set", "force=0", "--set", "c=0")
    result = stickslip("ring-down", *model, *start, "--until", "40")
    assert result.exit_code == 0, result.stderr
    folder = tmp_path / "out" / "jenkins_oscillator-ring-down"
    found = summary(folder, RING_DOWN)
    assert found["coordinate"] == "x" and found["half cycles"] > 10
    assert found["last frequency"] == pytest.approx(2**0.5 / (2 * math.pi))
    assert (folder / "ring-down.csv").read_text(encoding="utf-8").startswith("time,amplitude,")


def test_backbone(tmp_path: Path) -> None:
    out = tmp_path / "backbone"
    given = ("jenkins_oscillator", "--set", "force=0", "--set", "c=0", "--amplitudes", "0.1:10")
    result = stickslip("backbone", *given, "--points", "3", "--out", str(out))
    assert result.exit_code == 0, result.stderr
    found = summary(out, BACKBONE)
    assert found["points"] == 3 and found["coordinate"] == "x"
    assert found["frequencies"][0] == pytest.approx(2.0**0.5, abs=1e-9)
    result = stickslip("backbone", *given, "--of", "x - 1", "--points", "2", "--out", str(out))
    assert result.exit_code == 0 and summary(out, BACKBONE)["coordinate"] == "x - 1"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ((), "drive 'force'"),
        (("--set", "force=0", "--of", "y"), "unknown quantity 'y'"),
        (("--set", "force=0", "--initial", "z=1"), "initial.z"),
        (("--set", "force=0", "--until", "-1"), "span"),
    ],
)
def test_a_command_for_no_ring_down_is_refused(given: tuple[str, ...], message: str) -> None:
    result = stickslip("ring-down", "jenkins_oscillator", *given)
    assert result.exit_code == 2
    assert message in result.stderr and "Traceback" not in result.stderr


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (("--amplitudes", "0.1"), "LOW:HIGH"),
        (("--amplitudes", "1:0.1", "--set", "force=0"), "amplitudes"),
        (("--amplitudes", "0.1:1"), "driven by 'force'"),
        (("--amplitudes", "0.1:1", "--set", "force=0", "--mode", "3"), "unknown mode 3"),
        (("--amplitudes", "0.1:1", "--set", "force=0", "--of", "y"), "unknown quantity 'y'"),
    ],
)
def test_a_backbone_of_nothing_is_refused(given: tuple[str, ...], message: str) -> None:
    result = stickslip("backbone", "jenkins_oscillator", *given)
    assert result.exit_code == 2
    assert message in result.stderr and "Traceback" not in result.stderr


def test_results_for_other_programs() -> None:
    assert stickslip("run", "belt_block", "--until", "20").exit_code == 0
    motion = "out/belt_block/trajectory.nc"
    given = ("export", motion, "--out", "block.csv", "--quantity", "x", "--step", "0.5", "--units")
    assert stickslip(*given).exit_code == 0
    lines = Path("block.csv").read_text().splitlines()
    assert lines[0] == "time [s],x [m]" and len(lines) == 42
    assert stickslip("export", motion, "--out", "block.parquet").exit_code == 0
    assert stickslip("export", motion, "--out", "x.wav", "--quantity", "x").exit_code == 0
    for wrong, message in (
        (("--out", "block.xlsx"), ".parquet"),
        (("--out", "x.wav"), "quantities"),
        (("--out", "x.csv", "--quantity", "y"), "unknown quantity 'y'"),
        (("--out", "x.csv", "--step", "-1"), "step"),
    ):
        result = stickslip("export", motion, *wrong)
        assert result.exit_code == 2 and message in result.stderr
        assert "Traceback" not in result.stderr


def test_a_window_of_a_motion() -> None:
    assert stickslip("run", "belt_block", "--until", "20").exit_code == 0
    motion = "out/belt_block/trajectory.nc"
    assert stickslip("plot", motion, "--time", "2:9", "--coordinate", "x").exit_code == 0
    for wrong in (("--time", "2"), ("--time", "2:900"), ("--coordinate", "y")):
        result = stickslip("plot", motion, *wrong)
        assert result.exit_code == 2 and "Traceback" not in result.stderr
