"""The command ``records``: what it writes, what it takes up again, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import stickslip as ss
from stickslip.cli.app import app

SLIP = ("--measure", "slip = abs(shift)")
WHAT = ("records", "sliding_base", "quakes", "--scale", "2,4,8", *SLIP)


def stickslip(*arguments: str) -> Any:
    return CliRunner().invoke(app, [*arguments])


def refused(*arguments: str) -> str:
    found = stickslip(*arguments)
    assert found.exit_code == 2 and found.stderr.count("\n") == 1, found.output
    return found.stderr


def write(file: Path, length: float) -> None:
    """A rectangular pulse of 1 m/s²."""
    rows = [(0.0, 0.0), (1.0, -1.0), (1.0 + length, 0.0), (12.0, 0.0)]
    file.write_text("t,a\n" + "\n".join(f"{t},{a}" for t, a in rows) + "\n")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "quakes").mkdir()
    for length in (0.3, 0.5):
        write(tmp_path / "quakes" / f"pulse {length}.csv", length)
    return tmp_path


def test_a_folder_of_records(folder: Path) -> None:
    """The map, the fragility beside it, and more records later."""
    more = ("--kind", "hold", "--over", "mu=0.1,0.2", "--limit", "slip=0.2")
    found = stickslip(*WHAT, *more)
    assert found.exit_code == 0, found.output
    made = ss.open("out/sliding_base-records.zarr")
    A, T = np.array([2.0, 4.0, 8.0])[:, None], np.array([0.3, 0.5])[:, None, None]
    N = 9.81 * np.array([0.1, 0.2])
    expected = np.where(A > N, (A * T) ** 2 / (2.0 * N) * (1.0 - N / A), 0.0)
    np.testing.assert_allclose(made["slip"].values, expected, rtol=1e-9, atol=1e-12)
    beside = folder / "out" / "sliding_base-records-fragility"
    shares = ss.open(beside / "fragility.nc")["share"].values
    np.testing.assert_array_equal(shares, np.mean(expected > 0.2, axis=0))
    assert (beside / "overview.png").stat().st_size > 0
    heading = (beside / "fragility.csv").read_text().splitlines()[0]
    assert heading == "scale,mu,share,low,high,records"
    assert json.loads((beside / "summary.json").read_text())["records"] == 2
    write(folder / "quakes" / "pulse 0.4.csv", 0.4)
    assert "over other values of record (stored 2: pulse 0.3, pulse 0.5" in " ".join(
        stickslip(*WHAT, *more).stderr.split()
    )
    assert stickslip(*WHAT, *more, "--extend").exit_code == 0
    again = ss.open("out/sliding_base-records.zarr")
    np.testing.assert_array_equal(again["slip"].values[::2], made["slip"].values)
    plotted = stickslip("plot", "out/sliding_base-records.zarr", "--measure", "slip")
    assert plotted.exit_code == 0 and Path(plotted.output.strip()).stat().st_size > 0


def test_without_a_limit(folder: Path) -> None:
    found = stickslip(*WHAT, "--until", "3", "--out", "map.zarr", "--json")
    assert found.exit_code == 0, found.output
    data = json.loads(found.stdout)
    (said,) = data["warnings"]
    assert said.startswith("2 of 2 records are longer than the motions, from 0 s to 3 s: 'pulse 0.")
    assert data["axes"] == {"record": 2, "scale": 3}
    assert not list(folder.glob("*fragility"))


def test_a_point_that_takes_too_long(folder: Path) -> None:
    t = np.linspace(0.0, 12.0, 20_001)
    noise = np.random.default_rng(0).standard_normal(len(t))
    np.savetxt(
        folder / "quakes" / "noise.csv",
        np.column_stack([t, noise]),
        delimiter=",",
        header="t,a",
        comments="",
    )
    found = stickslip(*WHAT, "--time-limit", "1e-3", "--limit", "slip=0.1", "--out", "map.zarr")
    assert found.exit_code == 1
    assert "reached the time limit" in " ".join(found.output.split())


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--limit", "slip"], "--limit slip: not of the form MEASURE=VALUE. Write it like --limit"),
        (["--limit", "slip=much"], "--limit slip=much: not of the form MEASURE=VALUE"),
        (["--drive", "b"], "records.b: unknown drive of sliding_base. Known here: a"),
        (["--over", "scale=1,2"], "--over scale: it is already varied. Give it once only"),
        (["--kind", "smooth"], "unknown kind 'smooth'"),
        (["--pattern", "*.AT2"], "none of its 2 files matches '*.AT2'"),
        (["--peak", "0"], "peak: 0.0 is not a positive number. Give a positive"),
        (["--value", "ax"], "unknown column 'ax'"),
        (["--until", "20"], "the samples cover 0 ... 12, the time span is 0 ... 20. Shorten"),
    ],
)
def test_what_is_wrong_is_named(folder: Path, more: list[str], said: str) -> None:
    assert said in refused(*WHAT, *more)


def test_folders_that_are_none(folder: Path) -> None:
    (folder / "nothing").mkdir()
    begin = ("records", "sliding_base")
    assert "nothing: the folder has no records." in refused(*begin, "nothing", *SLIP)
    assert "none: no such folder. Check" in refused(*begin, "none", *SLIP)
    (folder / "quakes" / "bad.csv").write_text("t,a\n0,0\n1,nan\n")
    words = "bad.csv, line 3, column 'a': nan is not a number. Fill it, or delete the row"
    assert words in refused(*WHAT)
