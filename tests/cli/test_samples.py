"""Drives from files on the command line, and in model files of evolutions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import stickslip as ss
from stickslip.cli.app import app

t = np.linspace(0.0, 10.0, 501)
SHAKEN = 4.0 * np.exp(-(((t - 4.0) / 2.0) ** 2)) * np.sin(9.0 * t)
PULL = """
name = "pull"
parameters.F = {default = 1.0}
drives.ell = {file = "load.csv"}
drives.wave = "F*sin(3*t)"
A = 1
load = "LOAD"
dissipation = {kind = "weighted l1", weights = ["1 + cos(2*pi*s)/2"]}
epsilon = 0.1
span = [0, 5]
"""


def write(path: Path, heading: str, *columns: Any) -> Path:
    rows = [
        ",".join(f"{number!r}" for number in map(float, row)) for row in zip(*columns, strict=True)
    ]
    path.write_text("\n".join([heading, *rows]) + "\n", encoding="utf-8")
    return path


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "base.csv", "t,a", t, SHAKEN)
    write(tmp_path / "three.csv", "time,ax,ay", t, SHAKEN, 0.0 * t)
    u = np.linspace(0.0, 5.0, 201)
    write(tmp_path / "load.csv", "t,force", u, 5.0 * u - u**2)
    return tmp_path


def stickslip(*arguments: str) -> Any:
    return CliRunner().invoke(app, [*arguments])


def refused(*arguments: str) -> str:
    found = stickslip(*arguments)
    assert found.exit_code == 2 and found.stderr.count("\n") == 1, found.output
    return found.stderr


@pytest.mark.parametrize(
    ("given", "kind"),
    [
        ("base.csv", "linear"),
        ('{file = "base.csv", time = "t", value = "a", kind = "cubic"}', "cubic"),
        ('{file = "three.csv", value = "ax", kind = "hold"}', "hold"),
    ],
)
def test_a_drive_is_a_file(folder: Path, given: str, kind: Any) -> None:
    found = stickslip("run", "sliding_base", "--set", f"a={given}", "--out", "o")
    assert found.exit_code == 0, found.output
    motion = ss.open(folder / "o" / "trajectory.nc")
    samples = ss.Samples(t, SHAKEN, kind)
    assert motion.system.drives["a"] == samples
    assert motion.final == ss.simulate(ss.catalogue.sliding_base(a=samples)).final


@pytest.mark.parametrize("command", ["show", "run", "equilibria", "cycle", "basin", "sweep"])
def test_every_command_that_sets_takes_files(folder: Path, command: str) -> None:
    more = {
        "basin": ["--over", "x=0:1:2", "--over", "d_x=0:1:2"],
        "sweep": ["--over", "mu=0.1:0.2:2", "--measure", "speed"],
    }
    words = refused(command, "sliding_base", "--set", "a=no.csv", *more.get(command, []))
    assert words == "stickslip: no.csv: no such file. Check the path\n"


@pytest.mark.parametrize(
    ("heading", "rows", "said"),
    [
        (
            "t,a",
            ["0,0", "1,nan", "12,0"],
            "line 3, column 'a': nan is not a number. Fill it, or delete",
        ),
        (
            "t,a",
            ["0,0", "1,one", "12,0"],
            "line 3, column 'a': 'one' is not a number. Fill it, or delete",
        ),
        (
            "t,a",
            ["0,0", "1", "12,0"],
            "line 3, column 'a': the value is missing. Fill it, or delete",
        ),
        ("t,a", ["0,0", "2,1", "1,0"], "line 4, column 't': the time 1 comes after 2. Sort"),
        ("t,a", ["0,0", "1,1", "1,0"], "line 4, column 't': the time 1 occurs twice. Keep one"),
        ("0,0", ["1,0"], "line 1: the header line has numbers instead of column names. Add"),
        ("t,x,y", ["0,0,0"], "it is ambiguous which column has the values: t, x, y. Name it"),
        ("x,y", ["0,0"], "it is ambiguous which column has the times: x, y. Name it"),
    ],
)
def test_what_is_wrong_is_named(folder: Path, heading: str, rows: list[str], said: str) -> None:
    (folder / "bad.csv").write_text("\n".join([heading, *rows]), encoding="utf-8")
    assert said in refused("run", "sliding_base", "--set", "a=bad.csv")


def test_what_is_no_file(folder: Path) -> None:
    run = ("run", "sliding_base", "--set")
    assert "'{file = base.csv}' is not a table. Write it like" in refused(
        *run, "a={file = base.csv}"
    )
    assert "unknown column 'az'" in refused(*run, 'a={file = "three.csv", value = "az"}')
    assert "parameters.mu: '501 samples" in refused(*run, "mu=base.csv")
    assert "drives.a: this Python construct is not allowed" in refused(*run, "a=3*x.y")
    assert "'base.csv' is not a number" in refused("law", "coulomb", "--set", "F_c=base.csv")
    assert "'base.csv' is not a number" in refused("run", "sliding_base", "--initial", "x=base.csv")


def test_the_span_is_that_of_the_samples_unless_it_is_given(folder: Path) -> None:
    write(folder / "short.csv", "t,a", t[:201], SHAKEN[:201])
    for given, end in (("base", 10.0), ("short", 4.0)):
        run = ("run", "sliding_base", "--set", f"a={given}.csv", "--out", "o")
        assert stickslip(*run).exit_code == 0
        assert ss.open(folder / "o" / "trajectory.nc").t_span == (0.0, end)
        until = f"{end + 1.0:g}"
        words = f"the samples cover 0 ... {end:g}, the time span is 0 ... {until}. Shorten"
        assert words in refused(*run, "--until", until)
        found = stickslip(*run, "--until", "3")
        assert found.exit_code == 0
        lines = " ".join(found.output.split())
        words = f"record 'a' runs to {end:g} s, the motion ends at 3 s"
        assert lines.count(words) == 2 and f"warning: {words}" in found.stderr
    assert "--until: the time span begins at 0, and would end at 0. Choose" in refused(
        *run, "--until", "0"
    )


def test_until_ends_the_motions_of_maps(folder: Path) -> None:
    sweep = ("sweep", "sliding_base", "--set", "a=base.csv", "--over", "mu=0.1,0.2")
    assert stickslip(*sweep, "--measure", "duration", "--out", "m.zarr").exit_code == 0
    assert ss.open("m.zarr")["duration"].values.tolist() == [10.0, 10.0]
    found = stickslip(*sweep, "--measure", "duration", "--out", "n.zarr", "--until", "6")
    assert "record 'a' runs to 10 s, the motion ends at 6 s" in " ".join(found.output.split())
    assert ss.open("n.zarr")["duration"].values.tolist() == [6.0, 6.0]


# -- evolutions ------------------------------------------------------------------------------------


def pulled(folder: Path, load: str) -> str:
    (folder / "pull.toml").write_text(PULL.replace("LOAD", load), encoding="utf-8")
    return "pull.toml"


def test_a_measured_load(folder: Path) -> None:
    """A scalar load is a play: exact, and stored."""
    found = stickslip("evolve", pulled(folder, "ell"), "--out", "o")
    assert found.exit_code == 0, found.output
    u = np.linspace(0.0, 5.0, 201)
    exact = ss.play(
        ss.Samples(u, 5.0 * u - u**2), "1 + cos(2*pi*s)/2", (0, 5), initial=0.0, epsilon=0.1
    )
    assert ss.open(folder / "o" / "evolution.nc").final == exact.final
    assert stickslip("check", "o/evolution.nc").exit_code == 0


def test_sums_with_measured_loads(folder: Path) -> None:
    """Weights and a formula beside the samples: as if the sum had been sampled."""
    model = ss.load_evolution(pulled(folder, "2*ell - ell/2 + wave - 1 + 1"))
    found = stickslip("evolve", "pull.toml", "--set", "F=0.5", "--out", "o")
    assert found.exit_code == 0, found.output
    play = ss.open(folder / "o" / "evolution.nc")
    assert play.certificate.ok
    u = np.linspace(0.0, 5.0, 201)
    fine = np.linspace(0.0, 5.0, 40_001)
    total = 1.5 * np.interp(fine, u, 5.0 * u - u**2) + 0.5 * np.sin(3.0 * fine)
    sampled = ss.play((fine, total), "1 + cos(2*pi*s)/2", (0, 5), initial=0.0, epsilon=0.1)
    np.testing.assert_allclose(play.position(u), sampled.position(u), atol=1e-5)
    assert model.problem.bounded
    text = model.to_toml()
    (folder / "again.toml").write_text(text, encoding="utf-8")
    assert ss.load_evolution("again.toml") == model


def test_several_components(folder: Path) -> None:
    text = PULL.replace("A = 1", "A = [[2, -1], [-1, 2]]").replace('s)/2"]', 's)/2", "1"]')
    text = text.replace('"LOAD"', '["ell + wave", "ell/2"]')
    (folder / "two.toml").write_text(text, encoding="utf-8")
    found = stickslip("evolve", "two.toml", "--set", "F=0", "--steps", "200", "--out", "o")
    assert found.exit_code in (0, 1), found.output
    history = ss.open(folder / "o" / "evolution.nc")
    u = np.linspace(0.0, 5.0, 201)
    table = np.stack([5.0 * u - u**2, 0.5 * (5.0 * u - u**2)], axis=1)
    friction = ss.WeightedL1(["1 + cos(2*pi*s)/2", "1"])
    problem = ss.Evolution(
        [[2.0, -1.0], [-1.0, 2.0]], (u, table), friction, [0.0, 0.0], epsilon=0.1, span=(0, 5)
    )
    np.testing.assert_allclose(history.final, ss.evolve(problem, steps=200).final, atol=1e-12)


@pytest.mark.parametrize(
    ("load", "more", "said"),
    [
        ("ell**2", [], "load: the measured drive 'ell' may only be multiplied by a number"),
        ("t*ell", [], "load: the measured drive 'ell' may only be multiplied by a number"),
        ("heaviside(ell)", [], "load: the measured drive 'ell' may only be multiplied by a number"),
        ("d_ell", [], "'d_ell' is not allowed here. A measured drive has no rate here"),
        ("ell", ["--until", "7"], "--until: the samples cover 0 ... 5, the time span is 0 ... 7"),
        ("ell", ["--set", "ell=no.csv"], "no.csv: no such file"),
        (
            "ell",
            ["--set", "ell={file = 'three.csv'}"],
            "it is ambiguous which column has the values",
        ),
    ],
)
def test_what_is_wrong_in_an_evolution(folder: Path, load: str, more: list[str], said: str) -> None:
    assert said in refused("evolve", pulled(folder, load), *more)


def test_friction_is_no_function_of_time(folder: Path) -> None:
    text = PULL.replace("LOAD", "ell").replace('/2"]', '/2 + ell"]')
    (folder / "pull.toml").write_text(text, encoding="utf-8")
    assert "'ell' is not allowed here. Use s and parameters only" in refused("evolve", "pull.toml")


@pytest.mark.parametrize("kind", ["linear", "cubic", "hold"])
@pytest.mark.parametrize("periodic", [False, True])
def test_chords_of_samples_are_bounds(kind: Any, periodic: bool) -> None:
    """How far samples are off the line between two times is bounded, not estimated: a cubic has
    what the middle does not show."""
    values = np.array([0.0, 3.0, -1.0, 2.0, 0.0])
    samples = ss.Samples([0.0, 1.0, 2.5, 3.0, 4.0], values, kind, periodic)
    problem = ss.Evolution([[1.0]], [samples], ss.WeightedL1([9.0]), [0.0], span=(0, 4))
    rng = np.random.default_rng(0)
    low = rng.uniform(0.0, 3.9, 200)
    high = low + rng.uniform(0.0, 1.0, 200) * (4.0 - low)
    chord = problem.ell.chord(low, high)
    share = np.linspace(0.0, 1.0, 201)[:, None]
    line = (1.0 - share) * chord.start[:, 0] + share * chord.end[:, 0]
    inside = np.array([[float(samples(u)) for u in row] for row in low + share * (high - low)])
    whole = np.searchsorted(samples.times, low, "right") == np.searchsorted(samples.times, high)
    seen = whole | periodic  # what is no period has its samples as knots
    assert seen.sum() > 30
    assert np.all((np.abs(inside - line).max(axis=0) <= chord.off[:, 0] + 1e-12)[seen])
