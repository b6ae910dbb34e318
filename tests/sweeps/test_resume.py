"""Maps that were interrupted, and maps that grow: only what is missing is computed, and the bits
are the same."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import stickslip as ss
from stickslip.errors import StickslipError
from stickslip.sweeps.sweep import Map, Progress, sweep
from sweeps import killing, stand_in

TOY = ss.catalogue.rocking_toy()


@pytest.fixture(autouse=True)
def _closed_forms(monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in.put_in_place(monkeypatch)


def equal(a: xr.Dataset, b: xr.Dataset) -> bool:
    """Bit by bit."""
    return all(
        a[name].values.tobytes() == b[name].values.tobytes() for name in [*b.data_vars, *b.coords]
    )


def test_killed_twenty_times(tmp_path: Path) -> None:
    store, log = tmp_path / "toy.zarr", tmp_path / "log"
    script = Path(killing.__file__)
    paths = [str(script.parent.parent), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
    subprocess.run(
        [sys.executable, script, store, log, "20"], env=environment, check=True, timeout=120
    )
    attempts: dict[int, list[int]] = {}
    for line in log.read_text().splitlines():
        number, done = map(int, line.split())
        attempts.setdefault(number, []).append(done)
    kept = [attempts[number] for number in sorted(attempts)]
    assert len(kept) >= 10  # the others were killed before they had opened the store
    assert kept[-1][-1] > kept[0][-1]
    for before, after in pairwise(kept):
        assert after[0] >= before[-1]
    settings = stand_in.Settings(pause=0.02)
    stand_in.calls.clear()
    given = (TOY, killing.OVER, killing.MEASURE)
    resumed = sweep(*given, store, settings=settings).dataset
    assert sum(stand_in.calls) <= 1600 - kept[-1][-1]
    assert equal(resumed, sweep(*given, settings=stand_in.Settings()).dataset)
    assert not [*tmp_path.rglob("*.partial"), *tmp_path.glob(".toy*")]


def test_control_c_keeps_what_is_done(tmp_path: Path) -> None:
    sent: list[int] = []

    def interrupt(state: Progress) -> None:
        if state.done >= 500 and not sent:
            sent.append(state.done)
            os.kill(os.getpid(), signal.SIGINT)

    before = signal.getsignal(signal.SIGINT)
    part = sweep(
        TOY, killing.OVER, ["speed"], tmp_path / "toy.zarr", progress=interrupt, workers=1
    ).dataset
    assert signal.getsignal(signal.SIGINT) is before
    done = int((part["outcome"] >= 0).sum())
    assert 500 <= done < 1600
    assert np.all(np.isnan(part["speed"].values[part["outcome"].values < 0]))
    stand_in.calls.clear()
    whole = sweep(TOY, killing.OVER, ["speed"], tmp_path / "toy.zarr").dataset
    assert sum(stand_in.calls) == 1600 - done
    assert equal(whole, sweep(TOY, killing.OVER, ["speed"]).dataset)


@pytest.mark.parametrize(
    "finer",
    [
        {"P": "0.6:1.6:41", "delta": "log:0.01:0.2:11"},
        {"P": "0.6:1.6:61", "delta": "log:0.01:0.2:31"},
        {"P": "0.6:2.1:31", "delta": "log:0.01:0.2:11"},
    ],
    ids=["halved", "third", "wider"],
)
def test_extended_maps_compute_only_new_points(tmp_path: Path, finer: dict[str, str]) -> None:
    store = tmp_path / "toy.zarr"
    coarse = sweep(
        TOY, {"P": "0.6:1.6:21", "delta": "log:0.01:0.2:11"}, ["speed", "period"], store
    ).dataset
    coarse = coarse.load()
    with pytest.raises(StickslipError, match="--extend"):
        sweep(TOY, finer, ["speed", "period"], store)
    stand_in.calls.clear()
    fine = sweep(TOY, finer, ["speed", "period"], store, extend=True).dataset
    assert sum(stand_in.calls) == fine["speed"].size - 21 * 11
    inside = fine.sel(P=coarse["P"], delta=coarse["delta"])
    assert equal(inside, coarse)
    np.testing.assert_allclose(
        fine["speed"], sweep(TOY, finer, ["speed"])["speed"], rtol=1e-12, atol=1e-14
    )
    stand_in.calls.clear()
    again = sweep(TOY, finer, ["speed", "period"], store, extend=True).dataset
    assert equal(again, fine)
    assert equal(sweep(TOY, finer, ["speed", "period"], store).dataset, fine)
    assert not stand_in.calls
    assert [path.name for path in tmp_path.iterdir()] == ["toy.zarr"]


def test_a_sample_grows(tmp_path: Path) -> None:
    store = tmp_path / "toy.zarr"
    few = sweep(
        TOY, {"P,delta": "sobol:40; 0.6:1.6; 0.01:0.2"}, ["speed"], store, seed=2
    ).dataset.load()
    stand_in.calls.clear()
    many = sweep(
        TOY, {"P,delta": "sobol:100; 0.6:1.6; 0.01:0.2"}, ["speed"], store, seed=2, extend=True
    ).dataset
    assert sum(stand_in.calls) == 60
    assert equal(many.isel(P_delta=slice(40)), few)


def test_extension_that_would_lose_points_is_refused(tmp_path: Path) -> None:
    store = tmp_path / "toy.zarr"
    coarse = sweep(TOY, {"P": "0.6:1.6:21"}, ["speed"], store).dataset.load()
    with pytest.raises(StickslipError, match=r"P = 0\.65 of the stored map is not among"):
        sweep(TOY, {"P": "0.6:1.6:31"}, ["speed"], store, extend=True)
    with pytest.raises(StickslipError, match="its own axes"):
        sweep(TOY, {"delta": "0.1:0.2:31"}, ["speed"], store, extend=True)
    with pytest.raises(StickslipError, match="another model"):
        sweep(TOY.with_parameters(rho=0.3), {"P": "0.6:1.6:41"}, ["speed"], store, extend=True)
    assert equal(Map.open(store).dataset, coarse)


def test_a_damaged_map_is_repaired_before_it_grows(tmp_path: Path) -> None:
    store = tmp_path / "toy.zarr"
    sweep(TOY, {"P": "0.6:1.6:21"}, ["speed"], store)
    (store / "speed" / "c" / "0").write_bytes(b"")
    with pytest.raises(StickslipError, match=r"damaged: speed/c/0.*--repair"):
        sweep(TOY, {"P": "0.6:1.6:41"}, ["speed"], store, extend=True)
    sweep(TOY, {"P": "0.6:1.6:21"}, ["speed"], store, repair=True)
    fine = sweep(TOY, {"P": "0.6:1.6:41"}, ["speed"], store, extend=True).dataset
    np.testing.assert_allclose(
        fine["speed"], sweep(TOY, {"P": "0.6:1.6:41"}, ["speed"])["speed"], rtol=1e-14
    )


def test_extension_killed_between_its_renamings(tmp_path: Path) -> None:
    store = tmp_path / "toy.zarr"
    coarse = sweep(TOY, {"P": "0.6:1.6:21"}, ["speed"], store).dataset.load()
    store.rename(tmp_path / ".toy.zarr.before")
    (tmp_path / ".toy.zarr.77.unfinished").mkdir()
    stand_in.calls.clear()
    assert equal(sweep(TOY, {"P": "0.6:1.6:21"}, ["speed"], store).dataset, coarse)
    assert not stand_in.calls
    assert [path.name for path in tmp_path.iterdir()] == ["toy.zarr"]
