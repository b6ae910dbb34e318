"""A few dozen random motions against the reference. The long run is ``python -m
tests.adversarial``."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from adversarial import report
from adversarial.case import FAMILIES, Case, draw
from adversarial.command import plan, read
from adversarial.kinds import motions
from adversarial.verdict import AGREED, NOT_CERTIFIED, REFUSED, WRONG

# Seeds of one formula each, so that little is compiled.
CHOSEN = {
    "forced oscillator": (0, 1),
    "pulse in the load, inertial": (5, 7, 9),
    "train of pulses, viscous": (1, 4, 7),
    "step in the load, inertial": (1, 3, 7),
    "dip of a threshold, rate-independent": (0, 5, 6),
    "rough patch, viscous": (0, 5, 7),
    "travelling weakness, viscous": (1, 4, 6),
    "narrow wall, inertial": (1, 5, 6, 15, 150, 164),  # the last three: steep residuals
    "narrow in a state": (5, 6, 7),
    "narrow in speed, inertial": (8, 68, 132),
    "thrown block": (4, 6, 8, 221, 1006),
    "block on a sled": (1, 3, 4),
    "mutual friction": (28, 508, 515, 517),
    "heavy and light": (1, 2, 7),
    "toy on a knife edge": (0, 1, 2, 249),
    "one sided powers": (1, 2, 2005),
    "scales of force": (0, 8, 11, 17),
    "scales of everything": (9, 16, 2008),
    "grazing slip": (0, 3),
    "late belt": (0, 1),
    "kinetic force negative": (0, 1),
    "pads side by side": (2, 4, 9),
    "pair with a pulse": (11,),
    "hyperstatic with static above kinetic": (0, 1, 7),
}


@pytest.mark.parametrize(("family", "seed"), [(f, s) for f, seeds in CHOSEN.items() for s in seeds])
def test_motion(family: str, seed: int) -> None:
    case = draw(family, seed)
    verdict = motions.judge(case)
    assert verdict.kind == AGREED, f"{verdict}\n{case.source()}"
    assert "yet the certificate is ok" not in verdict.note


# -- the judge -------------------------------------------------------------------------------------


def other(case: Case, **changes: float) -> Case:
    """The same case with some of the library's parameters multiplied."""
    return replace(
        case, parameters={n: v * changes.get(n, 1.0) for n, v in case.parameters.items()}
    )


def test_a_wrong_motion_is_called_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    case = draw("forced oscillator", 0)
    simulated = motions.simulated
    monkeypatch.setattr(motions, "simulated", lambda c: simulated(other(c, mu=1 + 1e-6)))
    verdict = motions.judge(case)
    assert verdict.kind == WRONG
    assert verdict.numbers["difference"] < 1e-4
    monkeypatch.setattr(motions, "simulated", lambda c: simulated(other(c, mu=1 + 1e-11)))
    assert motions.judge(case).kind == AGREED


def test_a_refused_motion_is_called_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    case = draw("forced oscillator", 0)
    simulated = motions.simulated
    monkeypatch.setattr(motions, "simulated", lambda c: simulated(other(c, k=np.nan)))
    verdict = motions.judge(case)
    assert verdict.kind == REFUSED
    assert verdict.note.startswith("DeclarationError: parameters.k")
    monkeypatch.setattr(motions, "MOST_EVENTS", 2)
    monkeypatch.setattr(motions, "simulated", simulated)
    assert motions.judge(case).note.startswith("limit on events reached")


def test_an_end_that_does_not_come_is_called_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    case = draw("forced oscillator", 0)
    simulated = motions.simulated
    ends = replace(case, mechanics=None, expected=("no bounded rate", 3.0))
    assert motions.judge(ends).kind == WRONG
    monkeypatch.setattr(motions, "simulated", lambda c: simulated(c))
    assert "goes on" in motions.judge(ends).note


# -- families and the command ----------------------------------------------------------------------


def test_families_are_many_and_their_cases_fixed() -> None:
    assert len(FAMILIES) >= 30
    for family in FAMILIES:
        one = draw(family, 3)
        same = draw(family, 3)
        next_one = draw(family, 4)
        assert (one.parameters, one.initial, one.duration) == (
            same.parameters,
            same.initial,
            same.duration,
        )
        assert (one.parameters, one.initial, one.duration) != (
            next_one.parameters,
            next_one.initial,
            next_one.duration,
        )
        assert FAMILIES[family].__doc__
    in_turn = list(motions.cases(5, len(FAMILIES) + 1))
    assert [c.family for c in in_turn] == [*FAMILIES, next(iter(FAMILIES))]
    assert (in_turn[0].seed, in_turn[-1].seed) == (5, 6)


def test_plan_leaves_out_what_is_done() -> None:
    families = list(FAMILIES)
    whole = list(plan(2 * len(families), 0, "motions", set()))
    assert {(f, s) for _, f, seeds in whole for s in seeds} == {
        (f, s) for f in families for s in (0, 1)
    }
    rest = list(plan(2 * len(families), 0, "motions", {("motions", families[0], 1)}))
    assert [seeds for _, f, seeds in rest if f == families[0]] == [[0]]


def test_report_counts_and_shows_the_shortest() -> None:
    def row(family: str, verdict: str, note: str = "", script: str = "") -> dict:
        return {
            "kind": "motions",
            "family": family,
            "seed": 1,
            "verdict": verdict,
            "note": note,
        } | {
            "numbers": {"difference": 1e-13},
            "reproduction": script,
        }

    rows = [row("a", AGREED), row("a", REFUSED, "late", "long"), row("b", REFUSED, "late", "no")]
    text = report.summary([*rows, row("b", NOT_CERTIFIED, "why", "yes")])
    assert "| a | 2 | 1 | 1 | 0 | 0 | 0 |" in text
    assert "### late: 2" in text
    assert "no\n" in text
    assert "long" not in text


def test_command_goes_on_where_it_was_stopped(tmp_path: Path) -> None:
    out, table = tmp_path / "rows.jsonl", tmp_path / "truth.md"
    command = [
        sys.executable,
        "-m",
        "tests.adversarial",
        "--only",
        "forced oscillator",
        "--workers",
        "1",
    ]
    command += ["--out", str(out), "--table", str(table)]
    root = Path(__file__).parents[2]
    ended = subprocess.run(
        [*command, "--count", "2"], cwd=root, capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stderr
    assert ended.stderr == ""
    first = out.read_text()
    sources = json.loads(first.splitlines()[0])
    assert "| forced oscillator | 2 | 2 |" in table.read_text()
    with out.open("a") as file:
        file.write('{"kind": "motions", "fam')  # killed while writing
    assert [row["seed"] for row in read(out, sources)] == [0, 1]
    with pytest.raises(SystemExit, match="the library has changed"):
        read(out, sources | {"library": "another"})
    assert [row["seed"] for row in read(out, sources)] == [0, 1]
    lines = [json.loads(line) for line in out.read_text().splitlines()[:-1]]
    lines[1]["verdict"] = WRONG
    out.write_text("".join(json.dumps(line) + "\n" for line in lines))
    # A better adversary judges again what did not agree.
    assert [row["seed"] for row in read(out, sources | {"adversary": "better"})] == [1]
    assert [row["seed"] for row in read(out, sources | {"adversary": "better"})] == [1]
