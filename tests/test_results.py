"""One protocol for whatever a public function returns."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from matplotlib.figure import Figure

import stickslip as ss
from stickslip.results import Ended, Result
from stickslip.storage import as_texts

BLOCK = ss.catalogue.belt_block()
TOY = ss.catalogue.rocking_toy(P=1.2)
SLIDER = ss.catalogue.spring_slider(mu="2/sqrt(alpha)", V=0.3)


def evolution() -> ss.History:
    psi = ss.WeightedL1(lambda s: np.array([1.0 + np.cos(2.0 * np.pi * s) / 2.0, 1.0]))
    problem = ss.Evolution(np.eye(2), ["3*sin(t)", "t"], psi, np.zeros(2), 0.5, (0.0, 1.0))
    return ss.evolve(problem, tolerance=1e-3)


def study() -> ss.AveragingStudy:
    psi = ss.WeightedL1(lambda s: np.array([1.0 + np.cos(2.0 * np.pi * s) / 2.0]))
    problem = ss.Evolution(np.eye(1), ["2*t"], psi, np.zeros(1), 0.5, (0.0, 2.0))
    return ss.averaging_study(problem, [0.5, 0.25])


OSCILLATOR = ss.catalogue.forced_oscillator()
UNDRIVEN = ss.catalogue.jenkins_oscillator(force=0)


QUAKES = ss.Records(
    {f"{T} s": ss.Samples([0, 1, 1 + T, 9], [0, -1, 0, 0], kind="hold") for T in (0.2, 0.4, 0.5)}
)


def record(friction: float) -> dict[str, np.ndarray]:
    t = np.linspace(0.0, 20.0, 80)
    x = ss.simulate(OSCILLATOR, (0.0, 20.0), parameters={"F_c": friction}).at(t)["x"]
    return {"t": t, "x": x + 0.01 * np.random.default_rng(0).standard_normal(80)}


def fitted(friction: float) -> ss.Fit:
    return ss.fit(OSCILLATOR, record(friction), {"F_c": (0.1, 0.9)}, starts=2)


MAKERS: dict[str, Callable[[], Result]] = {
    "trajectory": lambda: ss.simulate(BLOCK, (0.0, 8.0)),
    "ensemble": lambda: ss.simulate_many(BLOCK, (0.0, 2.0), parameters={"V": [0.1, 0.2]}),
    "event catalogue": lambda: ss.simulate(BLOCK, (0.0, 60.0)).event_catalogue(),
    "evolution": evolution,
    "play": lambda: ss.play("5*t - t**2", "1 + cos(2*pi*s)/2", (0, 5), initial=0.0, epsilon=0.5),
    "averaging study": study,
    "equilibria": lambda: ss.equilibria(SLIDER),
    "set of equilibria": lambda: ss.equilibria(TOY),
    "cycle": lambda: ss.find_cycle(BLOCK),
    "gait": lambda: ss.find_cycle(TOY),
    "branch": lambda: ss.continue_equilibrium(SLIDER, "V", (0.25, 0.31)),
    "gait study": lambda: ss.gait_study(TOY, "P", [0.4, 1.2], initial={"psi": 0.8}),
    "frequency response": lambda: ss.frequency_response(
        ss.catalogue.forced_oscillator(F_c=0.3), "omega", (1.2, 1.3), points=2
    ),
    "ring-down": lambda: ss.ring_down(
        ss.catalogue.jenkins_oscillator(force="0"), initial={"x": 3.0, "r_damper": 2.5}
    ),
    "backbone": lambda: ss.backbone(UNDRIVEN, (0.4, 0.8), points=2),
    "map": lambda: ss.sweep(TOY, {"P": [1.1, 1.2], "delta": [0.05, 0.1]}, ["speed", "period"]),
    "line": lambda: ss.sweep(TOY, {"P": [1.1, 1.2]}, ["speed"], initial={"psi": 0.8}),
    "fragility": lambda: ss.sweep(
        ss.catalogue.sliding_base(),
        {"record": QUAKES, "scale": [4.0, 6.0, 8.0], "mu": [0.2, 0.3]},
        ["shift"],
    ).fragility("shift", 0.5),
    "fit": lambda: fitted(0.3),
    "law fit": lambda: ss.fit_law(
        (np.arange(1.0, 9.0), 0.5 + 0.01 * np.random.default_rng(0).standard_normal(8)),
        ss.laws.coulomb,
        starts=1,
    ),
    "comparison": lambda: ss.compare(
        [OSCILLATOR, OSCILLATOR.with_parameters(k=0.9)], record(0.3), {"F_c": (0.1, 0.9)}, starts=1
    ),
    "band": lambda: fitted(0.3).continue_cycle("omega", (0.38, 0.42)),
    "basin": lambda: ss.basin(TOY, {"psi": "0.0:1.0:2", "d_psi": "0.0:1.0:2"}),
}
QUANTITY = {
    "trajectory": "friction_belt_contact",
    "ensemble": "final_x",
    "event catalogue": "size",
    "evolution": "z",
    "play": "z",
    "averaging study": "distance",
    "equilibria": "largest_real_part",
    "set of equilibria": "largest_real_part",
    "cycle": "x",
    "gait": "psi",
    "branch": "U",
    "gait study": "speed",
    "frequency response": "amplitude",
    "ring-down": "frequency",
    "backbone": "damping",
    "map": "speed",
    "line": "speed",
    "fragility": "share",
    "fit": "estimate",
    "law fit": "estimate",
    "comparison": "aicc",
    "band": "period",
    "basin": "period",
}


@cache
def made(name: str) -> Result:
    return MAKERS[name]()


def same(first: object, second: object) -> None:
    """Plain data, equal; what is not a number is equal to itself."""
    np.testing.assert_equal(first, second)


@pytest.fixture(params=MAKERS)
def name(request: pytest.FixtureRequest) -> str:
    return request.param


def test_says_what_it_is(name: str) -> None:
    result = made(name)
    said = result._said
    assert isinstance(said.dataset, xr.Dataset)
    assert isinstance(said.outcome, Ended)
    assert said.outcome is type(said.outcome).from_code(said.outcome.code)
    assert said.message
    assert said.certificate.verdict in str(result.summary())
    assert len(result.table) >= 1
    data = result.summary().data
    assert data["result"] == result.KIND
    assert (data["complete"], data["certified"]) == (said.outcome.ok, said.certificate.ok)
    assert said.title in str(result.summary()).splitlines()[0]
    assert said.certificate.ok or name in ("ensemble", "basin")


def test_is_read_back_as_it_was_written(name: str, tmp_path: Path) -> None:
    result: Any = made(name)
    result.save(tmp_path / "result.nc")
    again = ss.open(tmp_path / "result.nc")
    assert type(again) is type(result)
    assert again.dataset.identical(type(result).open(tmp_path / "result.nc").dataset)
    for key, values in result._said.dataset.variables.items():
        np.testing.assert_array_equal(again.dataset[key].values, values.values)
    same(again.summary().data, result.summary().data)
    again.save(tmp_path / "again.nc")
    same(ss.open(tmp_path / "again.nc").summary().data, result.summary().data)


def test_is_written_as_a_table(name: str, tmp_path: Path) -> None:
    """Numbers are read back exactly, and what stands for a word is a word."""
    result: Any = made(name)
    ss.export(result, tmp_path / "table.csv")
    ss.export(result, tmp_path / "table.parquet")
    text = pd.read_csv(tmp_path / "table.csv", dtype=str)
    binary = pd.read_parquet(tmp_path / "table.parquet")
    table = result.table
    assert list(text.columns) == list(binary.columns) == list(table.columns)
    assert binary.attrs["stickslip_version"] == ss.__version__
    for column in table.columns:
        if pd.api.types.is_float_dtype(table[column]):
            for found in (text, binary):
                np.testing.assert_array_equal(found[column].astype(float), table[column])
    first = QUANTITY[name]
    ss.export(result, tmp_path / "one.csv", first, units=True)
    chosen = pd.read_csv(tmp_path / "one.csv").columns
    assert any(c.startswith(first) for c in chosen) and len(chosen) <= len(table.columns)
    with pytest.raises(ss.DeclarationError, match=r"(unknown quantity|no measure) 'nonsense'"):
        ss.export(result, tmp_path / "one.csv", "nonsense")


def test_a_list_of_quantities_is_not_plotted(name: str) -> None:
    result: Any = made(name)
    with pytest.raises(ss.DeclarationError, match="quantities: expected a string, got"):
        result.plot([QUANTITY[name]])


def test_goes_to_another_process(name: str) -> None:
    """As it is, or with what it is measured of left behind."""
    result: Any = made(name)
    again = pickle.loads(pickle.dumps(result))
    assert type(again) is type(result)
    same(again.summary().data, result.summary().data)
    assert again.dataset.identical(result.dataset)


def test_every_field_is_stored_once(name: str) -> None:
    """A kind that declares the parts of its file forgets none of its fields."""
    result = made(name)
    kind = type(result)
    if kind.PARTS:
        stored = [field for part, p in kind.PARTS.items() for field in p.fields or (part,)]
        stored += kind.fields_of(result._said.dataset)
        assert sorted(stored) == sorted(field.name for field in fields(kind))  # type: ignore[arg-type]


def test_what_older_files_lack_has_its_default() -> None:
    result = made("frequency response")
    data, parts = result.stored()
    texts = as_texts(parts)
    del texts["time_up"]
    assert type(result).restored(data, texts, "a file").time_up is False  # type: ignore[attr-defined]
    del texts["certificate"]
    with pytest.raises(TypeError, match="certificate"):
        type(result).restored(data, texts, "a file")


def test_a_branch_of_cycles_goes_to_another_process() -> None:
    cycle = ss.find_cycle(BLOCK)
    branch = ss.continue_cycle(cycle, "V", (0.29, 0.31))
    again = pickle.loads(pickle.dumps(branch))
    assert again.points.identical(branch.points)
    assert pickle.loads(pickle.dumps(again)).special == branch.special


def test_has_a_picture(name: str) -> None:
    result = made(name)
    for figure in (result.plot(), result.plot(QUANTITY[name])):
        assert isinstance(figure, Figure)
        assert any(axes.has_data() for axes in figure.axes)
    mine = Figure()
    left, right = mine.subplots(1, 2)
    assert result.plot(ax=left) is mine
    assert result.plot(QUANTITY[name], ax=right) is mine
    assert left.has_data() and right.has_data()
    with pytest.raises(ss.DeclarationError, match=r"(unknown quantity|no measure) 'nonsense'"):
        result.plot("nonsense")


def test_quantities_that_a_plot_lists_are_drawn(name: str) -> None:
    with pytest.raises(ss.DeclarationError) as refused:
        made(name).plot("qq_99")
    listed = str(refused.value).partition("Known here: ")[2].split(", ")
    assert QUANTITY[name] in listed or "..." in listed
    for quantity in listed:
        if quantity != "...":
            figure = made(name).plot(quantity)
            assert any(axes.has_data() for axes in figure.axes), quantity


def test_has_a_face_in_a_notebook(name: str) -> None:
    result = made(name)
    page = result._repr_html_()
    assert page.count("data:image/png;base64,") == 1
    assert "certificate" in page
    assert all(f">{parameter}</td>" in page for parameter in result._said.parameters)


def test_a_picture_that_fails_costs_no_face(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Figure, "savefig", lambda *given, **more: 1 / 0)
    page = made("line")._repr_html_()
    assert "could not be plotted (ZeroDivisionError" in page and "certificate" in page


def test_every_kind_can_be_opened() -> None:
    assert {made(name).KIND for name in MAKERS} == set(ss._KINDS)


def test_what_is_no_result_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ss.StickslipError, match="no such file"):
        ss.open(tmp_path / "none.nc")
    (tmp_path / "text.nc").write_text("nothing")
    xr.Dataset({"x": 1.0}).to_netcdf(tmp_path / "other.nc")
    for other in ("text.nc", "other.nc"):
        with pytest.raises(ss.StickslipError, match="not a result"):
            ss.open(tmp_path / other)
    with pytest.raises(ss.StickslipError, match="not a map"):
        ss.open(tmp_path)
    made("trajectory").save(tmp_path / "motion.nc")
    with pytest.raises(ss.StickslipError, match="holds a trajectory, not a branch"):
        ss.Branch.open(tmp_path / "motion.nc")


def test_an_empty_catalogue_has_an_empty_table() -> None:
    rest = ss.System(
        "rest",
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        contacts={"a": ss.Contact("d_x", 1.0)},
        span=(0.0, 5.0),
    )
    table = ss.simulate(rest).event_catalogue().table
    assert len(table) == 0 and {"start", "duration"} <= set(table.columns)


def test_an_opened_cycle_goes_on(tmp_path: Path) -> None:
    system = SLIDER.with_parameters(V=0.18)
    cycle = ss.find_cycle(system)
    cycle.save(tmp_path / "cycle.nc")
    again = ss.Cycle.open(tmp_path / "cycle.nc")
    assert again.closed.orbit.period == pytest.approx(cycle.period, rel=1e-10)
    slower = {"V": 0.1799}
    found = ss.find_cycle(system, again, parameters=slower)
    assert found.period == pytest.approx(
        ss.find_cycle(system, cycle, parameters=slower).period, rel=1e-9
    )


def test_an_opened_play_is_exact_at_every_time(tmp_path: Path) -> None:
    play = ss.play("sin(t)", ([0.0, 1.0], [0.5, 1.0]), (0.0, 9.0), initial=0.0, epsilon=0.3)
    play.save(tmp_path / "play.nc")
    times = np.linspace(0.0, 9.0, 101)
    np.testing.assert_array_equal(
        ss.open(tmp_path / "play.nc").position(times), play.position(times)
    )
    with pytest.raises(ss.StickslipError, match="Python function"):
        ss.play(np.sin, 0.5, (0.0, 1.0), initial=0.0).save(tmp_path / "no.nc")
    assert not (tmp_path / "no.nc").exists()
