"""The store: what stands in it, who can read it, and what is refused."""

from __future__ import annotations

import contextlib
import json
import resource
import shutil
import tracemalloc
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import zarr
from hypothesis import given, settings
from hypothesis import strategies as st

import stickslip as ss
from stickslip.errors import DeclarationError, StickslipError
from stickslip.model.system_file import loads
from stickslip.sweeps.request.axes import read_axes
from stickslip.sweeps.request.measures import OWN
from stickslip.sweeps.request.user_measures import FormulaMeasure, read_measures
from stickslip.sweeps.store import create, opened
from stickslip.sweeps.sweep import Map, Progress, _tasks, make_plan, sweep
from stickslip.symbolic import expressions as ex
from sweeps import stand_in

TOY = ss.catalogue.rocking_toy()
OVER = {"P": "0.6:1.6:21", "delta": "log:0.01:0.2:15"}
MEASURE = ["speed", "period"]


@pytest.fixture(autouse=True)
def _closed_forms(monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in.put_in_place(monkeypatch)


def exact() -> dict[str, np.ndarray]:
    """The map, point by point."""
    P, delta = (axis.values[0] for axis in read_axes(TOY, OVER))
    points = {"P": np.repeat(P, len(delta)), "delta": np.tile(delta, len(P))}
    values = stand_in.closed_form(TOY, points, MEASURE)
    return {name: column.reshape(len(P), len(delta)) for name, column in values.items()}


def same(data: xr.Dataset, expected: dict[str, np.ndarray]) -> None:
    for name, values in expected.items():
        np.testing.assert_array_equal(data[name].values, values, err_msg=name)


def test_in_memory_and_on_disk_are_the_same(tmp_path: Path) -> None:
    same(sweep(TOY, OVER, MEASURE).dataset, exact())
    same(sweep(TOY, OVER, MEASURE, tmp_path / "toy.zarr").dataset, exact())
    same(Map.open(tmp_path / "toy.zarr").dataset, exact())


def test_plain_xarray_and_zarr_read_everything(tmp_path: Path) -> None:
    sweep(TOY, OVER, MEASURE, tmp_path / "toy.zarr", initial={"psi": 0.3}, seed=5)
    data = xr.open_zarr(tmp_path / "toy.zarr", chunks=None)
    assert data.sizes == {"P": 21, "delta": 15}
    assert data["P"].attrs["units"] == "N"
    assert data["delta"].attrs == {
        "units": "N*m*s",
        "long_name": "damping of the rocking",
        "spacing": "log",
    }
    assert data["speed"].attrs["units"] == "m/s"
    assert data["period"].attrs["units"] == "s"
    assert loads(data.attrs["stickslip_model"]) == TOY
    assert json.loads(data.attrs["stickslip_parameters"]) == TOY.values
    assert json.loads(data.attrs["stickslip_initial"]) == {"psi": 0.3}
    assert data.attrs["stickslip_version"] == ss.__version__
    assert data.attrs["stickslip_seed"] == "5"
    words = dict(
        zip(
            data["outcome"].attrs["flag_values"],
            data["outcome"].attrs["flag_meanings"].split(),
            strict=True,
        )
    )
    assert words[0] == "finished"
    assert words[-1] == "not_computed"
    group = zarr.open_group(tmp_path / "toy.zarr", mode="r")
    assert group.metadata.zarr_format == 3
    np.testing.assert_array_equal(np.asarray(group["outcome"]), exact()["outcome"])
    assert float(data["speed"].sel(P=0.6, delta=0.2)) == np.sin(1.8) + 0.3 * 0.2


def test_tied_parameters_and_samples_have_one_dimension() -> None:
    data = sweep(TOY, {"P,delta": "sobol:50; 0.6:1.6; 0.01:0.2", "psi": "0:1:3"}, ["speed"]).dataset
    assert data["speed"].dims == ("P_delta", "psi")
    assert data["P"].dims == data["delta"].dims == ("P_delta",)
    expected = (
        np.sin(3 * data["P"].values)[:, None] + data["psi"].values * data["delta"].values[:, None]
    )
    walks = data["outcome"].values == 0
    np.testing.assert_array_equal(data["speed"].values[walks], expected[walks])


def test_a_formula_of_measures_and_parameters() -> None:
    data = sweep(TOY, OVER, ["cost = energy_per_cycle/(2*P*max(speed, 0.5))"]).dataset
    P = data["P"].values[:, None]
    delta = data["delta"].values
    speed = np.maximum(exact()["speed"], 0.5)
    np.testing.assert_allclose(data["cost"].values, np.exp(delta) * P / (2 * P * speed), rtol=1e-14)
    assert set(data.data_vars) == {"cost", "cost_missing", *OWN}


FORMULAS = [
    "P**0.5 + log(period - 2)",
    "abs(speed)/(speed - 0.25) + atan(1/psi)",
    "piecewise(speed > 0, P, -P)**3 - max(speed, period, 0.3)",
    "exp(1000*speed) - sqrt(psi) + asinh(P)**(speed)",
    "2",
]


@given(st.sampled_from(FORMULAS), st.lists(st.floats(-3, 3), min_size=8, max_size=8))
@settings(max_examples=100, deadline=None)
def test_formulas_at_many_points_are_those_at_one(text: str, numbers: list[float]) -> None:
    (measure,) = read_measures(TOY, [f"m = {text}"])
    assert isinstance(measure, FormulaMeasure)
    table = {name: np.roll(numbers, i) for i, name in enumerate(("P", "psi", "speed", "period"))}
    table["psi"][0] = 0.0
    alone = [
        ex.evaluate(measure.expression, {n: float(v[i]) for n, v in table.items()})
        for i in range(8)
    ]
    together, why = measure.values(table, 8)
    assert np.array_equal(why == 0, np.isfinite(together))
    finite = np.isfinite(alone)
    np.testing.assert_allclose(together[finite], np.array(alone)[finite], rtol=1e-10, atol=1e-12)
    assert np.all(np.isnan(together[~finite]))


def swing(trajectory: ss.Trajectory) -> float:
    """Largest angle of the start, or what the pull makes of it."""
    pull = trajectory.parameters["P"]
    if pull == 0.8:
        raise ZeroDivisionError
    return {0.6: np.nan, 0.7: "far"}.get(pull, trajectory.knots.state[0, 0])


def test_a_formula_that_is_undefined_or_infinite_says_so() -> None:
    """Also where its kinks would hide that: max(sqrt(−1), 0) is not 0."""
    formulas = [
        "ma = max(sqrt(speed - 100), 0)",
        "mb = max(exp(2000*P), 1)",
        "mc = clip(exp(2000*P), 0, 1)",
        "md = 1/period",
    ]
    data = sweep(TOY, OVER, formulas).dataset
    words = data["ma_missing"].attrs["flag_meanings"].split()
    found = {
        name: {words[k] for k in data[f"{name}_missing"].values.ravel()}
        for name in ("ma", "mb", "mc")
    }
    assert found == {"ma": {"undefined"}, "mb": {"not_finite"}, "mc": {"given"}}
    assert np.isnan(data["ma"].values).all()
    assert np.isnan(data["mb"].values).all()
    assert np.all(data["mc"].values == 1.0)
    assert np.array_equal(np.isnan(data["md"].values), data["md_missing"].values != 0)


def test_a_function_of_the_motion_and_why_it_is_missing() -> None:
    toy = loads(TOY.to_toml().replace("span = [0, 120]", "span = [0, 1]"))
    data = sweep(toy, {"P": "0.6,0.7,0.8,0.9", "psi": "0.25,0.5"}, [swing]).dataset
    np.testing.assert_array_equal(data["swing"].values, [[np.nan] * 2] * 3 + [[0.25, 0.5]])
    words = data["swing_missing"].attrs["flag_meanings"].split()
    assert [words[code] for code in data["swing_missing"].values[:, 0]] == [
        "returned_nan",
        "returned_no_number",
        "raised_an_error",
        "given",
    ]


@pytest.mark.parametrize(
    ("measure", "said"),
    [
        ([], "no measure was given"),
        (["sped"], "unknown measure 'sped'"),
        (["amplitude:phi"], "unknown quantity 'phi'"),
        (["stick_fraction:tail"], "unknown quantity 'tail'"),
        (["period:psi"], "unknown quantity 'psi'"),
        (["speed", "speed"], "twice"),
        (["P = speed**2"], "already used"),
        (["speed = period"], "another measure"),
        (["cost = 1/spede"], "spede"),
        (["cost = __import__('os')"], "cost"),
        ([lambda motion: 1.0], "not lambda"),
        ([3], "not a string or a function"),
        (["nowhere.py:cost"], "cannot be read"),
    ],
)
def test_measures_that_do_not_exist(measure: list[object], said: str) -> None:
    with pytest.raises(DeclarationError, match=said):
        sweep(TOY, OVER, measure)
    assert not stand_in.calls


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"system": TOY.with_parameters(rho=0.25)},
            r"another model \(parameters.rho.default: stored 0.2, now 0.25\)",
        ),
        (
            {"over": {**OVER, "P": "0.6:1.7:21"}},
            r"other values of P \(stored 21 from 0.6 to 1.6, now 21 from 0.6 to 1.7",
        ),
        ({"over": {"P": OVER["P"]}}, "other axes"),
        ({"measure": ["speed"]}, "other measures"),
        ({"initial": {"psi": 0.5}}, "other initial values"),
        ({"settings": stand_in.Settings(rtol=1e-8)}, "rtol: stored 1e-10, now 1e-08"),
    ],
)
def test_another_map_is_refused_and_kept(
    tmp_path: Path, changes: dict[str, object], said: str
) -> None:
    asked: dict[str, object] = {
        "system": TOY,
        "over": OVER,
        "measure": MEASURE,
        "out": tmp_path / "toy.zarr",
    }
    sweep(**asked)  # type: ignore[arg-type]
    stand_in.calls.clear()
    with pytest.raises(StickslipError, match=said):
        sweep(**{**asked, **changes})  # type: ignore[arg-type]
    assert not stand_in.calls
    same(Map.open(tmp_path / "toy.zarr").dataset, exact())
    sweep(**{**asked, **changes, "overwrite": True})
    assert stand_in.calls
    assert [path.name for path in tmp_path.iterdir()] == ["toy.zarr"]


def test_what_is_not_a_map_is_never_touched(tmp_path: Path) -> None:
    folder = tmp_path / "thesis"
    folder.mkdir()
    (folder / "chapter.tex").write_text("words")
    other = tmp_path / "other.zarr"
    xr.Dataset({"x": ("t", [1.0])}).to_zarr(other, zarr_format=3, consolidated=False)
    for path in (folder, folder / "chapter.tex", other):
        with pytest.raises(StickslipError, match="not a map stored by stickslip"):
            sweep(TOY, OVER, MEASURE, path, overwrite=True)
    assert (folder / "chapter.tex").read_text() == "words"
    assert float(xr.open_zarr(other, consolidated=False, chunks=None)["x"][0]) == 1.0


def test_places_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file" / "toy.zarr", Path("/proc/nowhere/toy.zarr")):
        with pytest.raises(StickslipError, match="cannot be written"):
            sweep(TOY, OVER, MEASURE, path)
    assert not stand_in.calls


def test_one_process_at_a_time(tmp_path: Path) -> None:
    plan = make_plan(TOY, OVER, MEASURE)
    with (
        opened(plan, tmp_path / "toy.zarr"),
        pytest.raises(StickslipError, match="another process is writing it"),
    ):
        sweep(TOY, OVER, MEASURE, tmp_path / "toy.zarr")
    same(sweep(TOY, OVER, MEASURE, tmp_path / "toy.zarr").dataset, exact())


def test_full_disk_keeps_what_is_there(tmp_path: Path) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)

    def fill_up(state: object) -> None:
        if state.done >= 100:  # type: ignore[attr-defined]
            resource.setrlimit(resource.RLIMIT_FSIZE, (20, before[1]))

    try:
        with pytest.raises(
            StickslipError, match=r"cannot be written \(File too large\).*points are kept"
        ):
            sweep(TOY, OVER, MEASURE, tmp_path / "toy.zarr", progress=fill_up)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    kept = int((Map.open(tmp_path / "toy.zarr")["outcome"] >= 0).sum())
    assert 100 <= kept < 21 * 15
    stand_in.calls.clear()
    same(sweep(TOY, OVER, MEASURE, tmp_path / "toy.zarr").dataset, exact())
    assert sum(stand_in.calls) == 21 * 15 - kept


def test_ten_million_points_are_never_held() -> None:
    """Beside one byte for each outcome and the points under way."""
    plan = make_plan(TOY, {"P": "0.6:1.6:4000", "delta": "0.01:0.2:2500"}, MEASURE)
    tracemalloc.start()
    store = create(plan, None)
    points = [len(task.columns["P"]) for task in islice(_tasks(store, None, 1), 50)]
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert max(points) <= 4096
    assert peak < 4e7


def flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


@pytest.mark.parametrize("how", ["flipped", "cut", "emptied", "removed"])
@pytest.mark.parametrize("name", ["speed", "outcome"])
def test_damaged_chunks_are_found_and_repaired(tmp_path: Path, name: str, how: str) -> None:
    store = tmp_path / "toy.zarr"
    sweep(TOY, OVER, MEASURE, store)
    victim = store / name / "c" / "1" / "0"
    match how:
        case "flipped":
            flip(victim)
        case "cut":
            victim.write_bytes(victim.read_bytes()[:-3])
        case "emptied":
            victim.write_bytes(b"")
        case "removed":
            victim.unlink()
    stand_in.calls.clear()
    if how == "removed":  # its points are not computed, and the same call goes on
        with contextlib.nullcontext() if name == "outcome" else pytest.warns(match=f"{name}/c/1/0"):
            part = ss.open(store)
        assert not part.outcome.ok and part.computed == int((part["outcome"] >= 0).sum()) < 21 * 15
        gone = part["outcome"].values < 0
        assert gone.any() and all(np.isnan(part[n].values[gone]).all() for n in ("speed", "excess"))
        same(sweep(TOY, OVER, MEASURE, store).dataset, exact())
    else:
        with pytest.raises(StickslipError, match=rf"damaged: {name}/c/1/0.*--repair"):
            ss.open(store)
        with pytest.raises(StickslipError, match=rf"damaged: {name}/c/1/0.*--repair"):
            sweep(TOY, OVER, MEASURE, store)
        assert not stand_in.calls
        same(sweep(TOY, OVER, MEASURE, store, repair=True).dataset, exact())
    same(ss.open(store).dataset, exact())
    chunk = next(iter(xr.open_zarr(store)["speed"].encoding["chunks"]))
    assert 0 < sum(stand_in.calls) <= chunk * 15


@pytest.mark.parametrize(
    ("source", "target"),
    [("speed/c/0/0", "speed/c/1/0"), ("period/c/0/0", "speed/c/0/0"), ("P/c/0", "delta/c/0")],
)
def test_a_chunk_in_the_place_of_another_is_damage(
    tmp_path: Path, source: str, target: str
) -> None:
    store = tmp_path / "toy.zarr"
    sweep(TOY, OVER, MEASURE, store)
    shutil.copyfile(store / source, store / target)
    with pytest.raises(StickslipError, match=f"damaged: {target}"):
        ss.open(store)
    with pytest.raises(StickslipError, match=f"damaged: {target}"):
        sweep(TOY, OVER, MEASURE, store)
    if not target.startswith("delta"):
        same(sweep(TOY, OVER, MEASURE, store, repair=True).dataset, exact())
        same(ss.open(store).dataset, exact())


def test_the_whole_store_may_be_moved(tmp_path: Path) -> None:
    sweep(TOY, OVER, MEASURE, tmp_path / "toy.zarr")
    shutil.move(tmp_path / "toy.zarr", tmp_path / "moved.zarr")
    stand_in.calls.clear()
    same(sweep(TOY, OVER, MEASURE, tmp_path / "moved.zarr").dataset, exact())
    assert not stand_in.calls


def chunks_of(store: Path) -> list[Path]:
    """Files of all chunks of points."""
    names = ("speed", "outcome", "certificate", "lacking", "excess")
    return sorted(f for name in names for f in (store / name / "c").rglob("*") if f.is_file())


@pytest.mark.parametrize("seed", range(12))
def test_what_is_removed_from_an_open_map_is_said(tmp_path: Path, seed: int) -> None:
    """Values are read when they are needed; what is gone by then is no NaN."""
    store = tmp_path / "toy.zarr"
    swept = sweep(TOY, OVER, ["speed"], store)
    found = Map.open(store)
    chosen = np.random.default_rng(seed).choice(np.array(chunks_of(store), object))
    if seed % 3 == 0:
        shutil.rmtree(store)
    else:
        chosen.unlink()
    name = chosen.relative_to(store).parts[0]
    with pytest.raises(StickslipError, match=r"toy\.zarr: .*was removed after the map was opened"):
        found[name].load()
    if seed % 3 == 0:
        with pytest.raises(StickslipError, match="was removed after the map was opened"):
            swept[name].load()


def test_points_that_were_never_computed_are_no_loss(tmp_path: Path) -> None:
    """A chunk that was not there when the map was opened is one that is not computed."""

    def enough(state: Progress) -> None:
        if state.new:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(
            TOY,
            {"P": "0.6:1.6:40", "delta": "0.01:0.2:40"},
            ["speed"],
            tmp_path / "toy.zarr",
            progress=enough,
        )
    found = Map.open(tmp_path / "toy.zarr")
    assert np.isnan(found["speed"].values).any() and found.outcome.interrupted


def test_a_map_whose_files_are_removed_while_it_is_computed(tmp_path: Path) -> None:
    store = tmp_path / "toy.zarr"

    def remove(state: Progress) -> None:
        if state.new:
            shutil.rmtree(store, ignore_errors=True)

    with pytest.raises(StickslipError, match=r"toy\.zarr: was removed while the map was computed"):
        sweep(TOY, {"P": "0.6:1.6:40", "delta": "0.01:0.2:40"}, ["speed"], store, progress=remove)
    assert not store.exists()
