"""The examples that fit records: measured basalt, and a belt of known truth."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"


def example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name.replace("/", "_"), EXAMPLES / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_basalt() -> None:
    """Values as rate-and-state fits of such gouges have them; the data prefer the slip law a
    little, and do not decide, since only every sixth datum counts."""
    basalt = example("basalt/fit")
    found = basalt.compared(starts=2)
    assert found.certificate.ok
    for fit in found.fits:
        p = fit.estimate
        assert 0.007 < p["a"] < p["b"] < 0.012  # velocity weakening
        assert 4.0 < p["D_c"] < 13.0
        assert 0.1 < fit.statistics.weight < 0.3
        assert p["k"] * p["D_c"] > p["b"] - p["a"]  # it slid stably in the apparatus
    ageing, slip = found.fits
    assert ageing.estimate["D_c"] < slip.estimate["D_c"]
    assert not found.decided
    assert found.best is slip
    figure = basalt.picture(found)
    assert [ax.get_xlabel() for ax in figure.axes][:2] == ["time  [s]", "time  [s]"]


def test_from_a_record_to_a_map() -> None:
    belt = example("belt/map")
    found = belt.fitted(starts=2)
    for name, value in belt.TRUTH.items():
        low, high = found.interval[name]
        assert low - (high - low) < value < high + (high - low)
    low, middle, high = belt.critical_speeds(found, np.array([0.2]), draws=200)
    p = {**found.parameters, "c": 0.2}
    exact = p["v_s"] * np.log((p["F_s"] - p["F_c"]) / (p["c"] * p["v_s"]))
    assert middle[0] == pytest.approx(exact, rel=1e-12)
    assert low[0] < exact < high[0]
    data = belt.stability_map(found, speeds=4, dampings=3)
    assert data.certificate.ok
