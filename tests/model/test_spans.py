"""The time span of a system under records, and what a motion leaves out of them."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import stickslip as ss
from stickslip.errors import DeclarationError
from stickslip.model.system import DefaultSpan
from stickslip.model.system_file import loads

WHOLE = st.integers(-400, 400)
SPANS = st.tuples(WHOLE, st.integers(1, 900)).map(lambda p: (float(p[0]), float(p[0] + p[1])))


def record(span: tuple[float, float], periodic: bool = False) -> ss.Samples:
    """Of a load that comes and goes."""
    return ss.Samples([span[0], 0.5 * sum(span), span[1]], [0.0, 1.0, 0.0], periodic=periodic)


def driven(drives: dict[str, Any], **more: Any) -> ss.System:
    """A mass that some loads push."""
    force = " + ".join(drives)
    return ss.System(
        "driven",
        parameters={"mu": ss.Parameter(0.5)},
        drives=drives,
        coordinates={"x": ss.Inertial(force=force)},
        kinetic="d_x**2/2",
        contacts={"ground": ss.Contact("d_x", "mu")},
        **more,
    )


@settings(deadline=None)
@given(st.lists(SPANS, min_size=1, max_size=3))
def test_the_default_span_is_what_all_records_cover(spans: list[tuple[float, float]]) -> None:
    drives = {f"a_{i}": record(span) for i, span in enumerate(spans)}
    common = max(a for a, _ in spans), min(b for _, b in spans)
    again: dict[str, Any] = {**drives, "b": record((0.0, 3.0), periodic=True), "c": "cos(t)"}
    if common[0] >= common[1]:
        with pytest.raises(DeclarationError, match="the samples cover"):
            driven(again)
        return
    system = driven(again)
    for same in (system, pickle.loads(pickle.dumps(system)), system.with_parameters(mu=0.2)):
        assert same.span == common
        rest = dict.fromkeys(drives, "sin(t)")
        assert same.configure(rest).span == (0.0, 100.0)
    assert loads(system.to_toml()) == system
    formulas = driven(dict.fromkeys(again, "sin(t)"), span=DefaultSpan((1.0, 2.0)))
    assert formulas.span == (1.0, 2.0) and formulas.configure(again).span == common
    assert formulas.configure(again).configure(dict.fromkeys(again, "0")).span == (1.0, 2.0)


@settings(deadline=None)
@given(SPANS, st.floats(0.0, 0.9), st.floats(0.1, 1.0))
def test_what_a_motion_leaves_out_is_said(
    known: tuple[float, float], begin: float, part: float
) -> None:
    """In its certificate and in the summary, and nothing is said where it leaves nothing out."""
    length = known[1] - known[0]
    start = known[0] + begin * length
    end = min(start + part * length, known[1])
    system = driven({"a": record(known)}, time_unit="s")
    said = system.left_out(start, end)
    assert bool(said) == (start > known[0] + 1e-9 * length or end < known[1] - 1e-9 * length)
    assert system.left_out(*known) == []
    assert all("record 'a' " in words and " s, the motion " in words for words in said)
    periodic = driven({"a": record(known, periodic=True)})
    assert periodic.left_out(start, end) == []


SHAKEN = driven({"a": record((0.0, 20.0))}, time_unit="s")
LATE = "record 'a' runs to 20 s, the motion ends at 10 s"


def test_every_result_says_what_it_leaves_out(tmp_path: Any) -> None:
    """A strong motion after the end of the span is not a certified rest."""
    declared = driven({"a": record((0.0, 20.0))}, time_unit="s", span=(0.0, 10.0))
    motions: list[Any] = [ss.simulate(declared), ss.simulate(SHAKEN, (0.0, 10.0))]
    many = ss.simulate_many(declared, parameters={"mu": [0.1, 0.2]})
    maps = [
        ss.sweep(declared, {"mu": [0.1, 0.2]}, ["shift"]),
        ss.sweep(SHAKEN, {"mu": [0.1, 0.2]}, ["shift"], span=(0.0, 10.0)),
    ]
    for result in [*motions, many, *maps]:
        assert LATE in str(result.summary()) and LATE in result.certificate.notes
        assert result.summary().data["warnings"] == [LATE]
        result.save(tmp_path / "it.nc")
        assert LATE in ss.open(tmp_path / "it.nc").certificate.notes
    for result in [*motions, *maps]:
        assert result.certificate.ok and LATE in result.certificate.verdict
    whole: list[Any] = [
        ss.simulate(SHAKEN),
        ss.simulate_many(SHAKEN, parameters={"mu": [0.1, 0.2]}),
        ss.sweep(SHAKEN, {"mu": [0.1, 0.2]}, ["shift"]),
        ss.sweep(declared, {"mu": [0.1, 0.2]}, ["shift"], span=(0.0, 20.0)),
    ]
    for result in whole:
        assert "record" not in str(result.summary())
    assert maps[0]["shift"].equals(maps[1]["shift"])
    assert whole[2]["shift"].equals(whole[3]["shift"])


def test_records_of_the_catalogue() -> None:
    """The span of a system of the catalogue is a default: a record sets it, whatever its length."""
    t = np.linspace(0.0, 20.0, 401)
    strong = 4.0 * np.sin(9.0 * t) * np.exp(-(((t - 14.0) / 2.0) ** 2))
    for system in (
        ss.catalogue.sliding_base(a=ss.Samples(t, strong)),
        ss.catalogue.sliding_base().configure({"a": ss.Samples(t, strong)}),
    ):
        assert system.span == (0.0, 20.0)
        assert abs(ss.simulate(system, parameters={"mu": 0.1}).final["x"]) > 1e-3


def test_a_span_is_given_to_whatever_looks_for_what_settles() -> None:
    toy = ss.catalogue.rocking_toy(P=1.2)
    late: dict[str, Any] = {"span": (7.0, 60.0)}
    cycle = ss.find_cycle(toy, {"psi": 0.8}, **late)
    assert cycle.system.span == (7.0, 60.0)
    assert cycle.period == pytest.approx(ss.find_cycle(toy, {"psi": 0.8}).period, rel=1e-9)
    found = ss.sweep(toy, {"P": [1.2]}, ["time", "period"], initial={"psi": 0.8}, **late)
    assert float(found["time"].values[0]) > 7.0 and found.system.span == (7.0, 60.0)
    assert found["period"].values[0] == pytest.approx(cycle.period, rel=1e-9)
    over = {"psi": "0.0:1.0:2", "d_psi": "0.0:1.0:2"}
    assert ss.basin(toy, over, **late).system.span == (7.0, 60.0)
    with pytest.raises(DeclarationError, match="a motion, a cycle or a Hopf point already defines"):
        ss.find_cycle(toy, cycle, **late)
    wrong: tuple[float, float] = (3.0, 3.0)
    for call in (
        lambda: ss.find_cycle(toy, span=wrong),
        lambda: ss.sweep(toy, {"P": [1.2]}, ["period"], span=wrong),
        lambda: ss.basin(toy, over, span=wrong),
    ):
        with pytest.raises(DeclarationError, match=r"span: .* is not a time span"):
            call()


T = np.linspace(0.0, 8.0, 81)
LOAD = 3.0 * np.sin(T)
CUT = "load runs to 8, the motion ends at 5"
PULLED = """
name = "pull"
drives.ell = {times = [0, 4, 8], values = [0, 3, 0]}
A = 1
load = "ell"
dissipation = {kind = "weighted l1", weights = [1]}
"""


@pytest.mark.parametrize("load", [ss.Samples(T, LOAD), (T, LOAD)])
def test_plays_and_evolutions_say_it_too(load: Any, tmp_path: Any) -> None:
    friction = ss.WeightedL1([1.0])
    given: Any = (T, LOAD[:, None])
    problem = ss.Evolution([[1.0]], given, friction, [0.0], epsilon=0.5, span=(0.0, 5.0))
    whole = ss.Evolution([[1.0]], given, friction, [0.0], epsilon=0.5)
    assert whole.span == (0.0, 8.0)
    cut: list[Any] = [
        ss.play(load, 1.0, (0.0, 5.0), initial=0.0),
        ss.evolve(problem),
        ss.evolve(whole, (0.0, 5.0)),
    ]
    for result in cut:
        assert CUT in result.certificate.notes and CUT in str(result.summary())
        result.save(tmp_path / "it.nc")
        assert ss.open(tmp_path / "it.nc").warnings == [CUT]
    for result in (ss.play(load, 1.0, (0.0, 8.0), initial=0.0), ss.evolve(whole)):
        assert result.warnings == [] and "runs to" not in str(result.summary())
    positive: Any = ss.Samples(T, 1.0 + LOAD**2) if isinstance(load, ss.Samples) else (T, LOAD**2)
    late = ss.play(1.0, positive, (2.0, 8.0), initial=1.0)
    assert late.warnings == ["threshold begins at 0, the motion at 2"]


def test_the_span_of_a_model_of_an_evolution(tmp_path: Any) -> None:
    (tmp_path / "pull.toml").write_text(PULLED)
    model = ss.load_evolution(tmp_path / "pull.toml")
    assert model.span == (0.0, 8.0)
    assert model.configure({"ell": "sin(t)"}).span == (0.0, 1.0)
    (tmp_path / "pull.toml").write_text(PULLED + "span = [0, 5]\n")
    assert ss.load_evolution(tmp_path / "pull.toml").span == (0.0, 5.0)
