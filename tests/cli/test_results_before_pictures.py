"""Results are on disk before a picture of them is drawn; a picture that fails is a warning."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from typer.testing import CliRunner, Result

import stickslip as ss
from stickslip.cli.app import app
from stickslip.cli.commands.evolving import AVERAGE, EVOLUTION
from stickslip.cli.commands.orbits import BASIN, BRANCH, CYCLE, EQUILIBRIA, MOTION_FILES
from stickslip.cli.common.folder import PICTURE

TWO_PHASES = str(Path(__file__).parents[2] / "examples" / "evolution" / "two-phases.toml")
COMMANDS = {
    "run": (["run", "belt_block", "--until", "8"], MOTION_FILES),
    "average": (["average", TWO_PHASES], AVERAGE),
    "evolve": (["evolve", TWO_PHASES, "--until", "0.05"], EVOLUTION),
    "equilibria": (["equilibria", "rocking_toy"], EQUILIBRIA),
    "cycle": (["cycle", "belt_block"], CYCLE),
    "gait": (["cycle", "rocking_toy"], CYCLE),
    "branch": (
        ["branch", "spring_slider", "--set", "mu=2/sqrt(alpha)", "--over", "V=0.3:0.31"],
        BRANCH,
    ),
    "basin": (
        ["basin", "rocking_toy", "--over", "psi=0:1:2", "--over", "d_psi=0:1:2"],
        BASIN,
    ),
}


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def stickslip(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments), catch_exceptions=False)


@pytest.mark.parametrize("name", COMMANDS)
def test_a_picture_that_fails_is_a_warning(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments, files = COMMANDS[name]
    folder = tmp_path / "here"
    results = sorted(set(files.names) - {PICTURE})
    there = []

    def overflow(self: Figure, path: Path, **given: object) -> None:
        there.append(sorted(p.name for p in folder.iterdir()))
        raise OverflowError("Exceeded cell block limit")

    monkeypatch.setattr(Figure, "savefig", overflow)
    result = stickslip(*arguments, "--out", "here", "--json")
    assert there == [results]
    assert result.exit_code == 0
    warning = " ".join(result.stderr.split())
    assert warning.startswith(
        "warning: the figure could not be plotted (OverflowError: Exceeded cell block limit)"
    )
    assert sorted(p.name for p in folder.iterdir()) == results
    assert json.loads(result.stdout) == json.loads(
        (folder / "summary.json").read_text(encoding="utf-8")
    )


def test_the_table_names_what_is_written(monkeypatch: pytest.MonkeyPatch) -> None:
    arguments, _ = COMMANDS["run"]
    assert PICTURE in stickslip(*arguments, "--out", "here").stdout
    monkeypatch.setattr(Figure, "savefig", lambda *given, **more: 1 / 0)
    assert PICTURE not in stickslip(*arguments, "--out", "here").stdout
    # The picture of the first run would not show what the second has found.
    assert not Path("here", PICTURE).exists()
    assert ss.open("here/trajectory.nc").certificate.ok


def test_the_exit_code_is_that_of_the_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "jumps.toml").write_text(
        'name = "jumps"\ncoordinates.x = {kind = "rate-independent"}\npotential = "-2*t*x"\n'
        'contacts.ground = {direction = "d_x", threshold = 1}\nspan = [0, 2]\n',
        encoding="utf-8",
    )
    monkeypatch.setattr(ss.Trajectory, "plot", lambda self: 1 / 0)
    result = stickslip("run", "jumps.toml", "--out", "here")
    assert result.exit_code == 1
    assert "ZeroDivisionError" in result.stderr
    assert Path("here/trajectory.nc").exists()


def test_ctrl_c_while_drawing_keeps_the_results(monkeypatch: pytest.MonkeyPatch) -> None:
    def impatient(self: ss.Trajectory) -> Figure:
        raise KeyboardInterrupt

    monkeypatch.setattr(ss.Trajectory, "plot", impatient)
    result = stickslip("run", "belt_block", "--until", "8", "--out", "here")
    assert result.exit_code == 130
    assert "interrupted while plotting; the results are in here" in result.stderr
    assert ss.open("here/trajectory.nc").outcome is ss.Outcome.FINISHED
    assert sorted(p.name for p in Path("here").iterdir()) == sorted(
        set(MOTION_FILES.names) - {PICTURE}
    )


def test_claims_are_written_while_the_paper_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    from stickslip_paper import making

    def dies(work: making.Work, folder: Path, progress) -> None:
        item = next(item for item in work.items if item.kind == "claim")
        work.done[item] = making.make(item, folder)
        progress(0.5, item)
        raise MemoryError

    monkeypatch.setattr(making, "make_all", dies)
    assert stickslip("paper", "--only", "(3.6)", "--out", "paper").exit_code == 70
    (claim,) = json.loads(Path("paper/claims.json").read_text(encoding="utf-8"))["claims"]
    assert claim["as_expected"] is True
