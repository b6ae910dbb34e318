"""The command line: what it prints, what it writes, and how it ends."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

import stickslip as ss
from stickslip.cli.app import app
from stickslip.cli.commands.orbits import MOTION_FILES
from stickslip.cli.common.folder import result_folder
from stickslip.cli.common.models import assignments, load_model
from stickslip.errors import DeclarationError, StickslipError
from stickslip.motion.trajectory import Trajectory

JUMPS = """
name = "jumps"
coordinates.x = {kind = "rate-independent"}
potential = "-2*t*x"
contacts.ground = {direction = "d_x", threshold = 1}
span = [0, 2]
"""


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def stickslip(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments), catch_exceptions=False)


def process(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "stickslip.cli", *arguments]
    return subprocess.run(
        command, capture_output=True, text=True, env=os.environ | environment, check=False
    )


def refused(result: Result) -> str:
    """The one line that an error is."""
    assert result.exit_code == 2
    assert result.stdout == ""
    message = result.stderr.strip()
    assert message.startswith("stickslip: ")
    assert "\n" not in message
    return message


def test_list_names_every_system_once() -> None:
    result = stickslip("list")
    assert result.exit_code == 0
    assert [line.split()[0] for line in result.stdout.splitlines()] == ss.catalogue.names()
    assert "Mielke 2017, (4.2)" in result.stdout


@pytest.mark.parametrize("arguments", [["--help"], ["list"], ["show", "rocking_toy"]], ids=" ".join)
def test_what_only_reads_starts_nothing_heavy(arguments: list[str]) -> None:
    script = (
        "import sys\nfrom stickslip.cli.app import app\n"
        f"try:\n    app({arguments!r})\nexcept SystemExit as end:\n    assert end.code == 0\n"
        "heavy = {'numba', 'numpy', 'scipy', 'sympy', 'xarray', 'pandas', 'matplotlib'} & "
        "sys.modules.keys()\n"
        "assert not heavy, heavy\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True, capture_output=True)


@pytest.mark.parametrize("name", ss.catalogue.names())
def test_show(name: str) -> None:
    result = stickslip("show", name)
    system = ss.catalogue.get(name)
    assert result.exit_code == 0
    assert result.stdout == str(system.equations())
    assert result.stdout.splitlines()[:2] == [system.title, system.source]


def test_show_latex_and_toml(tmp_path: Path) -> None:
    assert stickslip("show", "rocking_toy", "--latex").stdout.startswith("\\begin{aligned}")
    file = tmp_path / "mine.toml"
    file.write_text(
        stickslip("show", "rocking_toy", "--toml", "--set", "P=1.2").stdout, encoding="utf-8"
    )
    assert ss.load(file) == ss.catalogue.rocking_toy(P=1.2)
    assert stickslip("show", str(file)).stdout == str(ss.catalogue.rocking_toy(P=1.2).equations())


def test_a_structure_starts_at_unknowns() -> None:
    given = ["--initial", "u[tip]=0.001", "--initial", "d_u[rub]=0.01", "--set", "F=10"]
    result = stickslip("run", "cantilever", "--until", "0.02", *given)
    assert result.exit_code == 0, result.stderr
    assert "certified" in result.stdout
    wrong = stickslip("run", "cantilever", "--initial", "u[top]=0.001")
    assert wrong.exit_code == 2
    assert "u[top]" in wrong.stderr
    assert "Traceback" not in wrong.stderr


def test_run_writes_a_certified_result(tmp_path: Path) -> None:
    result = stickslip(
        "run", "spring_slider", "--until", "20", "--set", "V=9/50", "--initial", "U=0.4"
    )
    assert result.exit_code == 0, result.stderr
    assert "certified" in result.stdout
    folder = tmp_path / "out" / "spring_slider"
    assert sorted(p.name for p in folder.iterdir()) == sorted(MOTION_FILES.names)
    assert [p.name for p in folder.parent.iterdir()] == ["spring_slider"]
    assert (folder / "overview.png").read_bytes().startswith(b"\x89PNG")

    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    stored = ss.open(folder / "trajectory.nc")
    assert (summary["program"], summary["version"]) == ("stickslip", ss.__version__)
    assert (summary["outcome"], summary["certified"], summary["complete"]) == (
        "finished",
        True,
        True,
    )
    assert summary["parameters"] == stored.parameters
    assert summary["parameters"]["V"] == 0.18
    assert summary["final"] == stored.final
    assert summary["switches"] == stored.n_switches > 0
    assert summary["certificate"]["ok"]
    assert summary["t_span"] == [0.0, 20.0]
    assert summary["wall_time"] > 0.0
    assert stored.at(0.0)["U"] == 0.4
    rows = (folder / "events.csv").read_text(encoding="utf-8").splitlines()
    assert rows[0].startswith("time,contact,from,to,U,alpha")
    assert len(rows) == 1 + len(stored.events)

    checked = stickslip("check", str(folder / "trajectory.nc"))
    assert checked.exit_code == 0
    assert "certified" in checked.stdout


def test_json_is_all_there_is() -> None:
    result = stickslip("run", "belt_block", "--until", "10", "--out", "here", "--json")
    assert result.exit_code == 0
    assert json.loads(result.stdout) == json.loads(
        Path("here/summary.json").read_text(encoding="utf-8")
    )
    checked = stickslip("check", "here/trajectory.nc", "--json")
    assert json.loads(checked.stdout)["ok"] is True


def test_free_functions_are_set_as_formulas() -> None:
    result = stickslip(
        "run", "spring_slider", "--set", "mu=2/sqrt(alpha)", "--until", "5", "--json"
    )
    assert json.loads(result.stdout)["functions"]["mu(alpha)"] == "2/sqrt(alpha)"


def test_a_failed_condition_is_a_warning_beside_the_result() -> None:
    result = stickslip(
        "run", "rocking_toy", "--set", "P=0.4", "--initial", "x_R=0", "--until", "1", "--json"
    )
    assert result.exit_code == 0
    assert any("X is not positive" in text for text in json.loads(result.stdout)["warnings"])
    shown = stickslip("run", "rocking_toy", "--set", "P=0.4", "--initial", "x_R=0", "--until", "1")
    assert "warning: " in shown.stderr


def test_a_motion_that_stops_early_is_kept_and_exits_1(tmp_path: Path) -> None:
    (tmp_path / "jumps.toml").write_text(JUMPS, encoding="utf-8")
    result = stickslip("run", "jumps.toml")
    assert result.exit_code == 1
    assert "no bounded rate at t = 0.5" in " ".join(result.stdout.split())
    summary = json.loads(Path("out/jumps/summary.json").read_text(encoding="utf-8"))
    assert not summary["complete"]
    assert summary["end"] == pytest.approx(0.5, abs=1e-12)
    # What was computed up to there is right; the motion as a whole is not certified.
    checked = stickslip("check", "out/jumps/trajectory.nc")
    assert checked.exit_code == 1
    assert "'no bounded rate' (the law is satisfied up to there)" in " ".join(
        checked.stdout.split()
    )


def test_a_model_that_was_edited_after_a_run_is_noticed(tmp_path: Path) -> None:
    Path("block.toml").write_text(ss.catalogue.belt_block().to_toml())
    assert stickslip("run", "block.toml", "--until", "5", "--set", "V=0.2").exit_code == 0
    given = ("check", "out/belt_block/trajectory.nc", "--model", "block.toml")
    same = stickslip(*given, "--set", "V=0.2")
    assert same.exit_code == 0 and "as in block.toml" in same.stdout
    text = Path("block.toml").read_text()
    Path("block.toml").write_text(text.replace('kinetic = "', 'kinetic = "2*', 1))
    edited = stickslip(*given, "--set", "V=0.2")
    assert edited.exit_code == 1
    assert "stored: kinetic" in edited.stdout and "block.toml: kinetic" in edited.stdout
    assert json.loads(stickslip(*given, "--json").stdout)["differs"]


BAD: dict[str, tuple[list[str], str]] = {
    "unknown system": (["run", "rocking_toi"], "Did you mean 'rocking_toy'?"),
    "dashes": (["show", "rocking-toy"], "Did you mean 'rocking_toy'?"),
    "no such file": (["run", "nowhere.toml"], "nowhere.toml: no such file"),
    "unknown parameter": (["run", "rocking_toy", "--set", "Q=1"], "'Q'"),
    "no value": (["run", "rocking_toy", "--set", "P"], "Write it like --set P=1.2"),
    "is missing": (["run", "rocking_toy", "--set", "=1"], "Write it like --set P=1.2"),
    "twice": (["run", "rocking_toy", "--set", "P=1", "--set", "P=2"], "given twice"),
    "no number": (["run", "rocking_toy", "--set", "P=much"], "parameters.P"),
    "out of range": (["run", "rocking_toy", "--set", "rho=-1"], "(0, inf)"),
    "huge": (["run", "rocking_toy", "--set", "P=9**9**9**9"], "parameters.P"),
    "hostile": (["run", "spring_slider", "--set", "mu=__import__('os').system('true')"], "mu"),
    "unknown state": (["run", "rocking_toy", "--initial", "phi=1"], "Did you mean 'psi'?"),
    "initial formula": (["run", "rocking_toy", "--initial", "psi=P"], "'P' is not a number"),
    "backwards": (["run", "rocking_toy", "--until", "-1"], "time span"),
    "endless": (["run", "rocking_toy", "--until", "inf"], "time span"),
    "undefined": (["run", "rocking_toy", "--until", "nan"], "time span"),
    "too exact": (["run", "rocking_toy", "--rtol", "0"], "rtol"),
    "no trajectory": (["check", "nowhere.nc"], "nowhere.nc"),
}


@pytest.mark.parametrize(("arguments", "part"), BAD.values(), ids=BAD)
def test_bad_input_is_one_line_and_exit_code_2(
    arguments: list[str], part: str, tmp_path: Path
) -> None:
    assert part in refused(stickslip(*arguments))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "arguments", [["run"], ["fly", "rocking_toy"], ["run", "rocking_toy", "--until", "soon"]]
)
def test_wrong_usage_is_exit_code_2(arguments: list[str]) -> None:
    result = stickslip(*arguments)
    assert result.exit_code == 2
    assert "Usage" in result.stderr


def test_broken_model_files_and_wrong_files(tmp_path: Path) -> None:
    (tmp_path / "broken.toml").write_text("name = ", encoding="utf-8")
    assert "broken.toml" in refused(stickslip("show", "broken.toml"))
    (tmp_path / "text.nc").write_text("no trajectory", encoding="utf-8")
    assert "text.nc: not a result" in refused(stickslip("check", "text.nc"))
    assert refused(stickslip("check", "."))


def test_files_of_evolutions_have_their_own_commands(tmp_path: Path) -> None:
    model = Path(__file__).parents[2] / "examples" / "evolution" / "two-phases.toml"
    assert "or on the command line: stickslip evolve" in refused(stickslip("run", str(model)))
    assert (
        stickslip("evolve", str(model), "--out", str(tmp_path / "e"), "--until", "0.1").exit_code
        == 0
    )
    checked = stickslip("check", str(tmp_path / "e" / "evolution.nc"))
    assert checked.exit_code == 0
    assert "evolution, " in checked.stdout and "certified" in checked.stdout


def test_nothing_of_others_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine", encoding="utf-8")
    assert "not a folder" in refused(stickslip("run", "belt_block", "--out", "file"))
    assert "cannot be written" in refused(stickslip("run", "belt_block", "--out", "file/below"))
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "events.csv").write_text("mine", encoding="utf-8")
    assert "events.csv, not written by stickslip" in refused(
        stickslip("run", "belt_block", "--out", "thesis")
    )
    assert [p.name for p in (tmp_path / "thesis").iterdir()] == ["events.csv"]
    assert (tmp_path / "thesis" / "events.csv").read_text(encoding="utf-8") == "mine"


def test_our_own_results_are_replaced_and_neighbours_stay(tmp_path: Path) -> None:
    arguments = ["run", "belt_block", "--out", "here", "--json"]
    assert stickslip(*arguments, "--until", "5").exit_code == 0
    (tmp_path / "here" / "notes.txt").write_text("mine", encoding="utf-8")
    assert stickslip(*arguments, "--until", "6").exit_code == 0
    assert sorted(p.name for p in (tmp_path / "here").iterdir()) == sorted(
        [*MOTION_FILES.names, "notes.txt"]
    )
    assert ss.open("here/trajectory.nc").t_span == (0.0, 6.0)


def test_a_result_folder_is_complete_or_absent(tmp_path: Path) -> None:
    def write(place: Path) -> None:
        for name in MOTION_FILES.names:
            (place / name).write_text("{}", encoding="utf-8")

    with (
        pytest.raises(RuntimeError),
        result_folder(tmp_path / "a" / "b", MOTION_FILES.names) as place,
    ):
        write(place)
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []
    with result_folder(tmp_path / "a" / "b", MOTION_FILES.names) as place:
        write(place)
    assert sorted(p.name for p in (tmp_path / "a" / "b").iterdir()) == sorted(MOTION_FILES.names)
    with pytest.raises(StickslipError), result_folder(tmp_path / "a" / "b", MOTION_FILES.names):
        pass  # {} is no summary of ours


def test_ctrl_c_keeps_what_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    @contextmanager
    def impatient(what: str) -> Iterator[Callable[[float], None]]:
        def stop(fraction: float) -> None:
            raise KeyboardInterrupt

        yield stop

    monkeypatch.setattr("stickslip.cli.common.present.watched", impatient)
    result = stickslip("run", "belt_block", "--until", "1000")
    assert result.exit_code == 130
    assert "interrupted; the results so far are in " in result.stderr
    stored = ss.open("out/belt_block/trajectory.nc")
    assert stored.outcome is ss.Outcome.INTERRUPTED
    assert stored.certificate.lawful
    assert not stored.certificate.ok


def test_ctrl_c_while_writing_leaves_nothing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def stop(self: Trajectory, path: Path) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Trajectory, "save", stop)
    result = stickslip("run", "belt_block", "--until", "5")
    assert result.exit_code == 130
    assert "nothing new was written" in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_mistake_of_ours_is_no_traceback(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def fail(self: Trajectory, path: Path) -> None:
        raise RuntimeError("broken")

    monkeypatch.setattr(Trajectory, "save", fail)
    result = stickslip("run", "belt_block", "--until", "5")
    assert result.exit_code == 70
    assert result.stderr == "stickslip: internal error; please report it (RuntimeError: broken)\n"
    assert list(tmp_path.iterdir()) == []


def test_check_finds_changed_data(tmp_path: Path) -> None:
    import netCDF4

    ss.simulate(ss.catalogue.belt_block(), (0.0, 20.0)).save("motion.nc")
    with netCDF4.Dataset("motion.nc", "r+") as file:
        states = file["knot_state"][:]
        states[len(states) // 2, 0] += 1e-6
        file["knot_state"][:] = states
    assert "damaged: knot_state" in refused(stickslip("check", "motion.nc"))
    with netCDF4.Dataset("motion.nc", "r+") as file:
        file.delncattr("stickslip_checksums")
        file.delncattr("stickslip_layout")
    with pytest.warns(match="without checksums"):
        result = stickslip("check", "motion.nc")
    assert result.exit_code == 1
    assert "not certified" in result.stdout
    with netCDF4.Dataset("other.nc", "w") as file:
        file.createDimension("time", 3)
        file.createVariable("x", float, ("time",))[:] = np.zeros(3)
    assert "other.nc: not a result" in refused(stickslip("check", "other.nc"))


def test_values_are_numbers_or_formulas() -> None:
    read = assignments(
        ["P=1.2", " q = 1/4 ", "mu=2/sqrt(alpha)", "c=-3e-2", "half=sqrt(1/4)"], "--set"
    )
    assert read == {"P": 1.2, "q": 0.25, "mu": "2/sqrt(alpha)", "c": -0.03, "half": 0.5}
    assert load_model("block_chain", ["N=5"]).title == "Chain of 5 blocks on a belt"
    with pytest.raises(DeclarationError):
        load_model("block_chain", ["N=2.5"])


def test_as_a_process(tmp_path: Path) -> None:
    done = process("run", "belt_block", "--until", "5", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["certified"] is True
    wrong = process("run", "belt_block", "--set", "m=-1")
    assert (wrong.returncode, wrong.stdout, wrong.stderr.count("\n")) == (2, "", 1)
    assert process("--version").stdout == f"stickslip {ss.__version__}\n"
    # A terminal without Greek letters still gets its equations.
    poor = process("show", "rocking_toy", PYTHONIOENCODING="ascii")
    assert (poor.returncode, poor.stderr) == (0, "")
    assert "I_b" in poor.stdout


def test_cite() -> None:
    alone = stickslip("cite").stdout
    assert "stickslip" in alone and "WIAS preprint 2405" in alone
    assert "Contact Mechanics and Friction" in stickslip("cite", "belt_block").stdout
    file = Path(__file__).parents[2] / "examples" / "rocking-toy.toml"
    assert ss.load(file).source in stickslip("cite", str(file)).stdout
    missing = stickslip("cite", "belt_blok")
    assert missing.exit_code == 2 and "Did you mean 'belt_block'?" in missing.stderr


README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")


def test_the_readme_runs() -> None:
    code = "".join(part.split("```")[0] for part in README.split("```python\n")[1:])
    names: dict[str, object] = {}
    Path("examples").symlink_to(Path(__file__).parents[2] / "examples")
    exec(compile(code, "README.md", "exec"), names)
    assert Path("block.png").is_file()
    assert isinstance(names["block"], ss.System)


# Laws.


def test_laws_are_listed_and_shown(tmp_path: Path) -> None:
    listed = stickslip("law").stdout.splitlines()
    assert [line.split()[0] for line in listed] == ss.laws.all_names()
    shown = stickslip("law", "stribeck", "--set", "v_s=0.5")
    assert shown.exit_code == 0
    assert "Tustin 1947" in shown.stdout
    assert "λ = −(F_c + (F_s − F_c) exp(−|u|/v_s) + b |u|) sgn(u)" in shown.stdout
    assert 'law = "stribeck", direction = "d_x", F_s = 1.5' in shown.stdout
    folder = tmp_path / "out" / "stribeck-law"
    assert (folder / "overview.png").stat().st_size > 10_000
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["parameters"]["v_s"] == 0.5
    assert stickslip("law", "stribeck").exit_code == 0  # again, over our own files


def test_laws_that_are_wrong() -> None:
    assert "Did you mean 'lugre'?" in refused(stickslip("law", "lugr"))
    assert "outside the admissible range (0, inf)" in refused(
        stickslip("law", "dahl", "--set", "k=-1")
    )
    assert "unknown parameter or function 'q'" in refused(stickslip("law", "dahl", "--set", "q=1"))
    assert not Path("out").exists()


def test_warmup_says_where_machine_code_is_kept(tmp_path: Path) -> None:
    said = stickslip("warmup")
    assert said.exit_code == 0 and "machine code of systems is stored in" in said.stdout


def test_shells_can_be_told_the_systems() -> None:
    from stickslip.cli.common.options import _systems

    assert _systems("rocking") == ["rocking_oscillator", "rocking_toy", "rocking_toy_inertial"]
    assert "--install-completion" in stickslip("--help").stdout
