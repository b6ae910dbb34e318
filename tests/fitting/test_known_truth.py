"""Fits of records whose truth is known: it lies where the statistics say, as often as they say."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import curve_fit

import stickslip as ss
from fitting import synthetic


def test_truth_is_in_95_of_100_intervals() -> None:
    """Intervals of 95 % hold the truth in 89 to 99 of 100 records (a binomial bound at the 1 %
    level), for each unknown."""
    inside = {"F_c": 0, "k": 0}
    for seed in range(100):
        record = synthetic.forced(seed)
        found = record.fit(starts=1)
        for name, (low, high) in found.interval.items():
            inside[name] += low <= record.truth[name] <= high
    assert all(89 <= count <= 99 for count in inside.values()), inside


@pytest.mark.parametrize("name", sorted(synthetic.ALL))
@pytest.mark.parametrize("seed", [3, 4])
def test_estimates_are_near_the_truth(name: str, seed: int) -> None:
    record = synthetic.ALL[name](seed)
    found = record.fit()
    assert found.certificate.ok
    assert found.statistics.tests["p_value"] > 1e-3  # χ² against noise that is known
    error = dict(zip(found.names, found.statistics.error, strict=True))
    for unknown, value in record.truth.items():
        assert abs(found.estimate[unknown] - value) < 4.0 * error[unknown], unknown


def test_estimates_are_those_of_curve_fit() -> None:
    """SciPy's curve_fit with differences of motions, from the truth, ends in the same minimum with
    the same covariance."""
    record = synthetic.forced(7)
    found = record.fit()
    names = list(record.free)

    def model(t: np.ndarray, *p: float) -> np.ndarray:
        parameters = dict(zip(names, p, strict=True))
        motion = ss.simulate(record.system, (0.0, 40.0), parameters=parameters)
        return np.asarray(motion.at(t)["x"])

    p, covariance = curve_fit(
        model,
        record.data["t"],
        record.data["x"],
        [record.truth[name] for name in names],
        sigma=np.full(len(record.data["t"]), record.noise["x"]),
        absolute_sigma=True,
    )
    error = np.sqrt(np.diag(covariance))
    assert np.max(np.abs(p - list(found.estimate.values())) / error) < 1e-3
    assert_allclose(found.covariance, covariance, rtol=1e-3)


def test_noise_of_unknown_size_is_estimated() -> None:
    record = synthetic.stribeck(0)
    found = ss.fit(record.system, record.data, record.free, record.observe)
    sigma = np.unique(found.dataset["sigma"].values)
    assert len(sigma) == 2
    assert_allclose(sigma, 0.02, rtol=0.15)
    known = record.fit()
    assert_allclose(found.values, known.values, rtol=2e-3)
    assert_allclose(found.statistics.error, known.statistics.error, rtol=0.15)


def test_a_far_start_finds_the_period() -> None:
    """A stick-slip record of ten periods: the sum of squares has a minimum at every period that
    fits a little; recordings that grow lead to the right one."""
    system = ss.catalogue.belt_block()
    truth = {"F_s": 1.0, "F_k": 0.6}
    t = np.linspace(0.0, 70.0, 700)
    x = np.asarray(ss.simulate(system, (0.0, 70.0), parameters=truth).at(t)["x"])
    data = {"t": t, "x": x + 0.02 * np.random.default_rng(0).standard_normal(len(t))}
    found = ss.fit(system, data, {"F_s": (0.3, 4.0), "F_k": (0.05, 0.9)}, starts=8)
    for name, (low, high) in found.interval.items():
        assert low - (high - low) <= truth[name] <= high + (high - low)
    assert found.statistics.tests["correlation"] < 0.2
