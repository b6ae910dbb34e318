"""The command ``fit``."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner, Result

import stickslip as ss
from stickslip.cli.app import app


@pytest.fixture
def record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    t = np.linspace(0.0, 30.0, 120)
    motion = ss.simulate(ss.catalogue.forced_oscillator(), (0.0, 30.0), parameters={"F_c": 0.4})
    x = motion.at(t)["x"] + 0.01 * np.random.default_rng(0).standard_normal(120)
    pd.DataFrame({"t": t, "position": x}).to_csv("record.csv", index=False)
    return tmp_path


def run(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["fit", "forced_oscillator", *arguments])


def test_a_folder_with_everything(record: Path) -> None:
    result = run("record.csv", "--free", "F_c=0.1:0.9", "--free", "k", "--observe", "x=position")
    assert result.exit_code == 0, result.output
    folder = record / "out" / "forced_oscillator-fit"
    assert {p.name for p in folder.iterdir()} == {
        "fit.nc",
        "fit.csv",
        "summary.json",
        "overview.png",
    }
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["certified"]
    low, high = summary["interval"]["F_c"]
    assert low < 0.4 < high
    table = pd.read_csv(folder / "fit.csv")
    assert list(table["parameter"]) == ["F_c", "k"]
    again = CliRunner().invoke(app, ["check", str(folder / "fit.nc")])
    assert again.exit_code == 0, again.output
    drawn = CliRunner().invoke(app, ["plot", str(folder / "fit.nc")])
    assert drawn.exit_code == 0, drawn.output


def test_columns_on_either_side_and_all_options(record: Path) -> None:
    options = ["--noise", "position=0.01", "--loss", "huber", "--starts", "2", "--time", "t"]
    result = run(
        "record.csv", "record.csv", "--free", "F_c", "--free", "x=-1:1", "--observe", "position=x",
        "--set", "k=1.01", "--set", "P=1", "--initial", "d_x=0*P", "--json", "--out", "o", *options,
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    summary = json.loads(result.stdout)
    assert list(summary["estimate"]) == ["F_c", "x[1]", "x[2]"]
    assert summary["data"] == 240


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["record.csv", "--free", "F_c"], "no column has the name of a quantity"),
        (["nothing.csv", "--free", "F_c"], "no such file"),
        (["record.csv", "--free", "q", "--observe", "x=position"], "free.q: unknown parameter"),
        (["record.csv", "--free", "F_c=1", "--observe", "x=position"], "NAME=LOW:HIGH"),
        (["record.csv", "--free", "F_c", "--observe", "x=place"], "has no column 'place'"),
        (["record.csv", "--free", "F_c", "--observe", "x"], "NAME=NAME"),
        (
            ["record.csv", "--free", "F_c", "--observe", "x=position", "--loss", "l2"],
            "unknown loss",
        ),
        (
            ["record.csv", "--free", "F_c", "--observe", "x=position", "--drive", "w=position"],
            "unknown drive",
        ),
    ],
)
def test_what_is_wrong_is_said(record: Path, arguments: list[str], message: str) -> None:
    result = run(*arguments)
    assert result.exit_code == 2
    assert message in " ".join(result.stderr.split())
    assert not (record / "out").exists()
