"""`stickslip average` and `stickslip evolve`, and the model files of evolutions."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

import stickslip as ss
from stickslip.cli.app import app
from stickslip.errors import DeclarationError
from stickslip.model.system import Parameter
from stickslip.rate_independent.evolution.evolution_file import EVOLUTIONS, load_evolution
from stickslip.rate_independent.evolution.history import History
from stickslip.rate_independent.evolution.model import EvolutionModel

EXAMPLES = Path(__file__).parents[2] / "examples"
FILES = sorted((EXAMPLES / "evolution").glob("*.toml"))
TWO, ELLIPSE, PLATE = (
    str(EXAMPLES / "evolution" / f"{name}.toml")
    for name in ("two-phases", "rotating-ellipse", "plate-compactor")
)

SMALL = """
name = "small"
parameters.r = {default = 0.5, range = "(0, inf)"}
functions."rho(x)" = "1 + r*cos(2*pi*x)"
A = [[2, "r"], ["r", 1]]
load = ["3*sin(t)", "2*t"]
dissipation = {kind = "weighted l1", weights = ["rho(s)", "rho(s + 0.5)"], lower = [2, "1"]}
initial = [0, 0]
epsilon = 0.5
span = [0, 2]
"""

EVERYTHING = EvolutionModel(
    name="everything",
    title='with "quotes", \\ and ψ',
    source="line one\nline two",
    parameters={"k": Parameter(2, "N/m", "stiffness", "(0, inf)"), "w": Parameter(1e-7)},
    functions={"rho(x)": "1 + cos(2*pi*x)/2", "half": 0.5, "one": 1},
    A=[["k", 0], [0.0, "2*k"]],
    load=["sin(t)", 1],
    dissipation={"kind": "group norm", "radii": ["rho(s) + w"], "size": 2},
    initial=["0.1*half", 0.25],
    epsilon="half",
    span=(0, "2*one"),
    steps=40,
)


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def stickslip(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments), catch_exceptions=False)


def refused(result: Result) -> str:
    """The one line that an error is."""
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    message = result.stderr.strip()
    assert message.startswith("stickslip: ")
    assert "\n" not in message
    return message


# --- Model files ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "model",
    [*map(load_evolution, FILES), EVERYTHING, EVOLUTIONS.loads(SMALL)],
    ids=lambda model: model.name,
)
def test_files_are_read_back_as_written(model: EvolutionModel) -> None:
    again = EVOLUTIONS.loads(model.to_toml())
    assert again == model
    assert again.to_toml() == model.to_toml()
    assert repr(again) == repr(model)  # 1 and 1.0 stay apart


def test_a_formula_may_be_long_once_its_functions_are_inserted() -> None:
    """Beyond the 2000 characters to which texts of expressions are shortened."""
    waves = " + ".join(f"sin({k}.25*x)/{k}" for k in range(1, 90))
    model = replace(
        EVERYTHING,
        functions={"f(x)": waves, "rho(x)": "1", "half": 0.5, "one": 1},
        load=["f(t)", 1],
    )
    times = np.linspace(0.0, 2.0, 5)
    k = np.arange(1, 90)[:, None]
    np.testing.assert_allclose(
        model.problem.ell.over(times)[:, 0],
        np.sum(np.sin((k + 0.25) * times) / k, axis=0),
        rtol=1e-12,
    )


def test_a_file_is_the_evolution_it_says() -> None:
    model = EVOLUTIONS.loads(SMALL)
    problem = model.problem
    np.testing.assert_array_equal(problem.A, [[2.0, 0.5], [0.5, 1.0]])
    np.testing.assert_allclose(
        problem.ell.over(np.array([0.3, 1.0])), [[3 * np.sin(0.3), 0.6], [3 * np.sin(1.0), 2.0]]
    )
    assert isinstance(problem.dissipation, ss.WeightedL1)
    lower, upper = problem.dissipation.bounds(0.1)
    np.testing.assert_allclose(
        upper, 1 + 0.5 * np.cos(2 * np.pi * np.array([0.1, 0.6])), rtol=1e-14
    )
    np.testing.assert_array_equal(lower, [-2.0, -1.0])
    assert (problem.epsilon, problem.span) == (0.5, (0.0, 2.0))
    changed = model.configure({"r": 0.25, "rho": "2"}).problem
    np.testing.assert_array_equal(changed.A, [[2.0, 0.25], [0.25, 1.0]])
    assert isinstance(changed.dissipation, ss.WeightedL1)
    np.testing.assert_array_equal(changed.dissipation.bounds(0.3)[1], [2.0, 2.0])


def test_a_dissipation_may_stand_alone(tmp_path: Path) -> None:
    (tmp_path / "square.toml").write_text(
        'name = "square"\n[dissipation]\nkind = "polytope"\n'
        'normals = [[1, 0], [-1, 0], [0, 1], [0, -1]]\noffsets = ["2 + cos(2*pi*s)", 1, 0, 0]\n',
        encoding="utf-8",
    )
    result = stickslip("average", "square.toml", "--json")
    summary = json.loads(result.stdout)
    assert result.exit_code == 0
    np.testing.assert_allclose(summary["offsets"], [1.0, 1.0, 0.0, 0.0], atol=1e-12)
    assert "Friction vanishes in 1 of 2 directions" in summary["frictionless"]
    np.testing.assert_allclose(np.abs(summary["frictionless_directions"]), [[0.0, 1.0]], atol=1e-9)
    assert "A = [[2, 0], [0, 1]]" in refused(stickslip("evolve", "square.toml"))


# --- average --------------------------------------------------------------------------------------


def test_average_says_example_2_1() -> None:
    shown = stickslip("average", TWO)
    assert shown.exit_code == 0, shown.stderr
    assert "Psi_av(v) = 1 |v_1| + 1 |v_2|" in shown.stdout
    folder = Path("out/two_phases-average")
    assert sorted(p.name for p in folder.iterdir()) == ["overview.png", "summary.json"]
    assert (folder / "overview.png").read_bytes().startswith(b"\x89PNG")
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["thresholds"] == {"upper": [1.0, 1.0], "lower": [1.0, 1.0]}
    assert [motion["phases"] for motion in summary["unit_motions"]] == [[0.0], [0.0], [0.5], [0.5]]
    assert summary["certified"] and summary["duality_gap"] < 1e-12


def test_average_of_the_rotating_ellipse_with_another_axis() -> None:
    summary = json.loads(
        stickslip("average", ELLIPSE, "--set", "b=0.25", "--out", "here", "--json").stdout
    )
    assert summary == json.loads(Path("here/summary.json").read_text(encoding="utf-8"))
    assert summary["parameters"]["b"] == 0.25
    np.testing.assert_allclose(summary["extremes"], 0.25, atol=1e-8)
    assert summary["psi_av"] == "0.25 |v|"
    assert all(abs(motion["average"] - 0.25) < 1e-8 for motion in summary["unit_motions"])


# --- evolve ---------------------------------------------------------------------------------------


def test_evolve_writes_a_certified_result(tmp_path: Path) -> None:
    (tmp_path / "small.toml").write_text(SMALL, encoding="utf-8")
    result = stickslip("evolve", "small.toml", "--until", "1", "--steps", "400", "--set", "r=0.25")
    assert result.exit_code == 0, result.output
    assert "certified" in result.stdout
    folder = Path("out/small")
    assert sorted(p.name for p in folder.iterdir()) == [
        "evolution.nc",
        "overview.png",
        "summary.json",
    ]
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    stored = History.open(folder / "evolution.nc")
    assert summary["final"] == stored.final.tolist()
    assert (summary["steps"], summary["t_span"], summary["method"]) == (
        400,
        [0.0, 1.0],
        "minimising movements",
    )
    assert summary["certificate"] == stored.certificate.to_dict()

    # Its own results are replaced, neighbours stay.
    (folder / "notes.txt").write_text("mine", encoding="utf-8")
    again = stickslip("evolve", "small.toml", "--averaged", "--json", "--out", str(folder))
    assert again.exit_code == 0, again.output
    assert json.loads(again.stdout)["averaged"] is True
    assert sorted(p.name for p in folder.iterdir()) == [
        "evolution.nc",
        "notes.txt",
        "overview.png",
        "summary.json",
    ]
    assert not History.open(folder / "evolution.nc").dataset.attrs["depends_on_phase"]


def test_few_steps_are_no_certified_result(tmp_path: Path) -> None:
    (tmp_path / "small.toml").write_text(SMALL, encoding="utf-8")
    result = stickslip("evolve", "small.toml", "--steps", "3")
    assert result.exit_code == 1
    assert "not certified" in result.stdout
    assert not json.loads(Path("out/small/summary.json").read_text(encoding="utf-8"))["certified"]


def test_a_scalar_file_is_an_exact_play() -> None:
    import xarray as xr

    resolved = json.loads(stickslip("evolve", PLATE, "--json").stdout)
    averaged = json.loads(
        stickslip("evolve", PLATE, "--averaged", "--json", "--out", "averaged").stdout
    )
    assert resolved["method"] == averaged["method"] == "exact play"
    assert resolved["certified"] and averaged["certified"]
    # In the limit the spring pulls with μ(mg − F)⁺, before with that and what it winds up in one
    # period.
    k = 5000.0
    law = 0.6 * 81.0
    pull = 0.1 * 4
    assert averaged["final"][0] == pytest.approx(pull - law / k, abs=1e-12)
    assert 0.0 < averaged["final"][0] - resolved["final"][0] < 0.1 * 0.1
    with xr.open_dataset("averaged/evolution.nc", engine="netcdf4") as data:
        assert float(data["z"][-1]) == pytest.approx(averaged["final"][0], abs=1e-15)


def test_ctrl_c_keeps_what_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from stickslip.rate_independent.evolution.stepping import March

    complete = March._advance

    def impatient(self: March, *arguments: object) -> object:
        if self.state.t > 0.0:
            raise KeyboardInterrupt
        return complete(self, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(March, "_advance", impatient)
    (tmp_path / "small.toml").write_text(SMALL, encoding="utf-8")
    result = stickslip("evolve", "small.toml")
    assert result.exit_code == 130
    assert "interrupted; the results so far are in " in result.stderr
    assert 0.0 < History.open("out/small/evolution.nc").dataset["step_time"][-1] < 2.0


def test_nothing_of_others_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine", encoding="utf-8")
    assert "not a folder" in refused(stickslip("evolve", PLATE, "--out", "file"))
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "overview.png").write_text("mine", encoding="utf-8")
    for command in ("evolve", "average"):
        assert "overview.png, not written by stickslip" in refused(
            stickslip(command, PLATE, "--out", "thesis")
        )
    assert [p.name for p in (tmp_path / "thesis").iterdir()] == ["overview.png"]
    assert (tmp_path / "thesis" / "overview.png").read_text(encoding="utf-8") == "mine"


def test_as_a_process() -> None:
    def process(*arguments: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "stickslip.cli", *arguments]
        return subprocess.run(command, capture_output=True, text=True, env=os.environ, check=False)

    done = process("evolve", PLATE, "--until", "1", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["certified"] is True
    wrong = process("average", PLATE, "--set", "m=-1")
    assert (wrong.returncode, wrong.stdout, wrong.stderr.count("\n")) == (2, "", 1)


# --- What is wrong with a file --------------------------------------------------------------------

L1 = 'dissipation = {kind = "weighted l1", weights = ["rho(s)", "rho(s + 0.5)"], lower = [2, "1"]}'
MATRIX = 'A = [[2, "r"], ["r", 1]]'
BAD: dict[str, tuple[str, str, list[str]]] = {
    "no TOML": ('name = "small"', "name = ", ["not valid TOML", "line 2"]),
    "is missing": ('name = "small"', 'title = "small"', ["name", "missing"]),
    "a number as name": ('name = "small"', "name = 3", ["name", "expected a string"]),
    "unknown key": ("epsilon =", "epsilom =", ["epsilom", "Did you mean 'epsilon'?"]),
    "a system": (
        "initial = [0, 0]",
        'coordinates.x = {kind = "viscous"}',
        ["declares a system", "stickslip run"],
    ),
    "no dissipation": (L1, "", ["dissipation", "missing", "kind ="]),
    "unknown kind": (
        L1,
        L1.replace('kind = "weighted l1", ', ""),
        ["dissipation.kind", '"polytope", "weighted l1", "formula", "group norm"'],
    ),
    "wrong kind": (
        L1,
        L1.replace("weighted l1", "weighted l2"),
        ["dissipation.kind", 'Did you mean "weighted l1"?'],
    ),
    "kind is a number": (L1, "dissipation = {kind = 1}", ["dissipation.kind", "expected a string"]),
    "kind only": (
        L1,
        'dissipation = {kind = "ellipsoid"}',
        ["dissipation.shape", "missing", "shape = [[4, 0]"],
    ),
    "unknown dissipation key": (
        L1,
        L1.replace("lower", "lover"),
        ["dissipation.lover", "Did you mean 'lower'?"],
    ),
    "no table": (L1, "dissipation = 1", ["dissipation", "expected a table"]),
    "unknown name": (L1, L1.replace('"1"', '"q"'), ["dissipation.lower[1]", "unknown name 'q'"]),
    "time in the dissipation": (
        L1,
        L1.replace('"1"', '"t"'),
        ["dissipation.lower[1]", "Use s and parameters only"],
    ),
    "phase in the load": ('"2*t"', '"2*s"', ["load[1]", "Use t and parameters only"]),
    "time in A": (MATRIX, 'A = [["t", 0], [0, 1]]', ["A[0][0]", "Use parameters only"]),
    "negative weight": (L1, L1.replace('"1"', '"-1"'), ["dissipation.lower", "negative"]),
    "negative at a phase": (
        L1,
        L1.replace("rho(s)", "1 - 2*rho(s)"),
        ["dissipation.weights", "at phase s = "],
    ),
    "not periodic": (
        L1,
        L1.replace('"rho(s)"', '"1 + s"'),
        ["dissipation.weights", "not 1-periodic"],
    ),
    "both descriptions": (
        L1,
        'dissipation = {kind = "polytope", vertices = [[1, 0]], offsets = [1]}',
        ["dissipation: it needs vertices, or normals and offsets"],
    ),
    "A not symmetric": (MATRIX, "A = [[2, 0.5], [0, 1]]", ["A[0, 1]", "symmetric"]),
    "A indefinite": (MATRIX, "A = [[1, 2], [2, 1]]", ["A", "positive definite"]),
    "A ragged": (MATRIX, "A = [[1, 2], [2]]", ["A", "Give"]),
    "sizes": ("load = [", 'load = ["1", ', ["load", "(3,)", "(2,) is needed"]),
    "no load": ('load = ["3*sin(t)", "2*t"]', "", ["load", "missing", "load = ["]),
    "unstable start": (
        "initial = [0, 0]",
        "initial = [3, 0]",
        ["initial", "outside", "initial = [1, 0]"],
    ),
    "bad parameter": ("default = 0.5", "default = -1", ["parameters.r", "(0, inf)"]),
    "parameter is not a number": (
        "default = 0.5",
        'default = "x"',
        ["parameters.r", "expected a number"],
    ),
    "a parameter called s": (
        "parameters.r =",
        "parameters.s =",
        ["parameters.s", "'s' is the phase"],
    ),
    "cyclic": ('"1 + r*cos', '"rho(x) + r*cos', ["rho", "cyclic"]),
    "hostile": ('"3*sin(t)"', "\"__import__('os').system('true')\"", ["load[0]"]),
    "huge": ("epsilon = 0.5", 'epsilon = "9**9**9**9"', ["epsilon"]),
    "epsilon": ("epsilon = 0.5", "epsilon = 0", ["epsilon", "positive"]),
    "span": ("span = [0, 2]", "span = [2, 0]", ["span", "start < end"]),
    "steps": ("span = [0, 2]", "span = [0, 2]\nsteps = 0", ["steps", "positive integer"]),
    "undefined": ("epsilon = 0.5", 'epsilon = "log(-1)"', ["epsilon"]),
}


@pytest.mark.parametrize(("old", "new", "parts"), BAD.values(), ids=BAD)
def test_a_wrong_file_is_one_clear_line(
    old: str, new: str, parts: list[str], tmp_path: Path
) -> None:
    assert old in SMALL
    (tmp_path / "wrong.toml").write_text(SMALL.replace(old, new), encoding="utf-8")
    message = refused(stickslip("evolve", "wrong.toml"))
    for part in ["wrong.toml: ", *parts]:
        assert part in message
    assert [p.name for p in tmp_path.iterdir()] == ["wrong.toml"]


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["evolve", "nowhere.toml"], "nowhere.toml: no such file"),
        (["evolve", "."], "it is a directory"),
        (["average", TWO, "--set", "delta=1"], "unknown parameter or function 'delta'"),
        (["average", TWO, "--set", "epsilon=x"], "parameters.epsilon"),
        (["average", TWO, "--set", "epsilon=-1"], "(0, inf)"),
        (["evolve", TWO, "--until", "-1"], "--until"),
        (["evolve", TWO, "--until", "nan"], "--until"),
        (["evolve", TWO, "--steps", "0"], "--steps"),
        (["evolve", PLATE, "--steps", "9"], "--steps: a scalar play is computed exactly"),
        (["evolve", str(EXAMPLES / "play.toml")], "stickslip run"),
    ],
)
def test_wrong_arguments_are_one_clear_line(
    arguments: list[str], part: str, tmp_path: Path
) -> None:
    assert part in refused(stickslip(*arguments))
    assert list(tmp_path.iterdir()) == []


def test_an_averaged_start_that_is_not_stable_at_every_phase_names_one_that_is(
    tmp_path: Path,
) -> None:
    (tmp_path / "small.toml").write_text(
        SMALL.replace("initial = [0, 0]", "initial = [-0.6, 0]"), encoding="utf-8"
    )
    message = refused(stickslip("evolve", "small.toml", "--averaged"))
    assert "outside the stable set" in message
    start = message.split("initial = ")[1].rstrip(".")
    (tmp_path / "small.toml").write_text(
        SMALL.replace("initial = [0, 0]", f"initial = {start}"), encoding="utf-8"
    )
    assert stickslip(
        "evolve", "small.toml", "--averaged", "--steps", "100", "--json"
    ).exit_code in (0, 1)


def test_models_are_checked_in_python_too() -> None:
    with pytest.raises(DeclarationError, match=r"steps: 0 steps\. Give a positive integer"):
        EVOLUTIONS.loads(SMALL + "steps = 0\n")
    with pytest.raises(DeclarationError, match=r"dissipation\.weights"):
        EVOLUTIONS.loads(SMALL).configure({"rho": "-1"})
