"""What workers answer, asked in this process: results of any kind, and evolutions."""

from __future__ import annotations

import ast
import json
import re
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import stickslip as ss
from stickslip.explorer.asking.answer import Answer
from stickslip.explorer.asking.request import PageSetting, Request
from stickslip.explorer.work import branches, export
from stickslip.explorer.work.loop import Cancellation, Cancelled, answers
from stickslip.rate_independent.evolution.blocks import evolved
from stickslip.rate_independent.play.operator import Play

EXAMPLES = Path(__file__).parents[2] / "examples" / "evolution"
SLIDER = PageSetting("spring_slider", "", {"mu": "2/sqrt(alpha)", "nu": 0.05, "V": 0.15})


def asked(what: str, setting: PageSetting, options: Mapping[str, Any]) -> list[Answer]:
    """Everything that is answered, with what is told on the way."""
    found: list[Answer] = []
    cancellation = Cancellation()
    cancellation.tell = found.append
    found.extend(answers(Request(1, "lane", what, setting, options), cancellation))
    assert not [a.head["refused"] for a in found if "refused" in a.head]
    return found


def test_a_result_of_another_kind_is_drawn_by_what_it_says(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is followed is a table; the page is told of variables, whatever they are of."""
    psi = ss.WeightedL1(["1 + cos(2*pi*s)/2"])
    history = ss.evolve(ss.Evolution([[1.0]], "5*t", psi, [0.0], epsilon=0.5, span=(0, 1)))
    monkeypatch.setattr(branches, "FOLLOWED", {"history": lambda *_: history})
    (answer,) = asked("branch", SLIDER, {"over": "V", "low": 0.1, "high": 0.2})
    assert answer.head["kind"] == history.KIND
    assert answer.head["over"] == "time"
    assert set(answer.head["variables"]) >= {"time"}
    assert answer.head["special"] == []
    assert answer.head["certified"] == history.certificate.ok


def test_points_of_branches_come_before_the_branches() -> None:
    found = asked("branch", SLIDER, {"over": "V", "low": 0.05, "high": 0.4})
    parts = [(a.head["part"], a.head["name"]) for a in found]
    for name in ("equilibria", "cycles"):
        assert parts.index(("points", name)) < parts.index(("curves", name))
    (cycles,) = (a for a in found if a.head["name"] == "cycles" and a.head["part"] == "curves")
    first = next(a for a in found if a.head["part"] == "points" and a.head["name"] == "cycles")
    on_the_way = first.head["points"][0]["values"]
    assert set(on_the_way) <= set(cycles.head["variables"])
    assert np.abs(cycles.arrays["b:V"] - on_the_way["V"]).min() < 1e-12


def test_a_branch_that_nobody_waits_for_is_given_up() -> None:
    cancellation = Cancellation()

    def tell(answer: Answer) -> None:
        cancellation.end()

    cancellation.tell = tell
    request = Request(1, "branch", "branch", SLIDER, {"over": "V", "low": 0.05, "high": 0.4})
    assert list(answers(request, cancellation)) == []
    with pytest.raises(Cancelled):
        cancellation.check()


@pytest.mark.parametrize("name", ["plate-compactor", "two-phases"])
def test_an_evolution_is_that_of_the_library(name: str) -> None:
    """Its average has the least cost of all phases; motions and forces are those of ``evolve``."""
    path = EXAMPLES / f"{name}.toml"
    found = asked("evolution", PageSetting(), {"toml": path.read_text(encoding="utf-8")})
    sets, averaged, resolved = found
    model = ss.load_evolution(path)
    average = model.potential.average()
    for i, cost in enumerate(sets.head["costs"]):
        e = np.eye(model.potential.dimension)[i]
        assert cost["plus"] == pytest.approx(average.support(e), rel=1e-9)
        assert sets.arrays[f"plus:{i}"].min() == pytest.approx(cost["plus"], rel=1e-3)
        assert sets.arrays[f"plus:{i}"][:-1].mean() == pytest.approx(cost["mean"], rel=1e-9)
    for part, limit in ((averaged, True), (resolved, False)):
        expected = evolved(model, limit)
        assert part.head["certified"] == expected.certificate.ok
        times = part.arrays["t"]
        z = expected.position(times) if isinstance(expected, Play) else expected.z[:, 0]
        assert_allclose(part.arrays["z:0"], z, rtol=0, atol=1e-9)
        load = model.problem.ell.over(times)[:, 0]
        assert_allclose(part.arrays["force:0"], load - model.problem.A[0, 0] * z, atol=1e-6)


def test_the_common_set_of_a_turning_ellipse_is_a_disc() -> None:
    text = (EXAMPLES / "rotating-ellipse.toml").read_text(encoding="utf-8")
    request = Request(1, "e", "evolution", PageSetting(), {"toml": text, "values": {"b": 0.25}})
    sets = next(answers(request, Cancellation()))
    x, y = sets.arrays["common"]
    assert_allclose(np.hypot(x, y), 0.25, rtol=1e-3)
    x, y = sets.arrays["set:0"]
    assert_allclose([np.abs(x).max(), np.abs(y).max()], [2.0, 0.25], rtol=1e-3)


def shape_of(script: str) -> list[str]:
    """What a script does: kinds of its nodes, and all names in it, but no texts and numbers."""
    return [
        f"{type(node).__name__} {getattr(node, 'id', '')}{getattr(node, 'attr', '')}"
        for node in ast.walk(ast.parse(script))
    ]


# Quotes, line ends and what shells read, more often than chance would have them.
HOSTILE = st.text(
    st.sampled_from("\"'\\`$();#{}%\n\r\t/.-~ ab\u2028é") | st.characters(codec="utf-8")
)


@given(HOSTILE.filter(str.strip))
@settings(max_examples=200, deadline=None)
def test_what_is_taken_away_runs_nothing_of_a_model(name: str) -> None:
    """Whatever a model file calls its system, the script and the command are the same but for the
    name of a file, and that is no option and in no other folder."""

    def taken(name: str) -> tuple[str, str]:
        toml = SYSTEM.to_toml().replace('name = "block"', f"name = {json.dumps(name)}")
        setting = PageSetting("", toml, {"k": 2.0}, {"x": 1.0}, 3.0)
        return export.python_of(setting), export.command_of(setting)

    try:
        script, command = taken(name)
    except ss.StickslipError:
        return  # not every text is a name
    plain_script, plain_command = taken("block")
    assert shape_of(script) == shape_of(plain_script)
    assert len(script.splitlines()) == len(plain_script.splitlines())
    words, plain = shlex.split(command), shlex.split(plain_command)
    assert [*words[:2], *words[3:]] == [*plain[:2], *plain[3:]]
    (file,) = re.findall(r'ss\.load\("(.*)"\)', script)
    assert file == words[2] == Path(file).name and re.fullmatch(r"[\w+][\w.+-]*\.toml", file)


SYSTEM = ss.System(
    "block",
    parameters={"k": ss.Parameter(1.0)},
    coordinates={"x": ss.Inertial()},
    kinetic="d_x**2/2",
    potential="k*x**2/2",
    span=(0, 3),
)
