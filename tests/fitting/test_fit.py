"""What a fit says of itself, and what can be done with it."""

from __future__ import annotations

import signal
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import stickslip as ss
from fitting import synthetic
from stickslip.results import Completion


def line(noise: float = 0.1, seed: int = 0, count: int = 60) -> tuple[ss.System, dict]:
    """y = y_0 + rate·t: a linear model, of which all statistics are known in closed form."""
    system = ss.System(
        name="line",
        parameters={"rate": ss.Parameter(1.0, "m/s")},
        internal={"y": ss.Internal("rate", "m")},
        time_unit="s",
        span=(0.0, 3.0),
    )
    t = np.linspace(0.0, 3.0, count)
    y = 0.5 + 2.0 * t + noise * np.random.default_rng(seed).standard_normal(count)
    return system, {"t": t, "y": y}


def test_linear_regression_in_closed_form() -> None:
    system, data = line()
    found = ss.fit(system, data, {"rate": None, "y": None})
    A = np.column_stack([data["t"], np.ones(60)])
    p, rss, *_ = np.linalg.lstsq(A, data["y"], rcond=None)
    assert_allclose(found.values, p, rtol=1e-9)
    covariance = rss[0] / 58 * np.linalg.inv(A.T @ A)
    assert_allclose(found.covariance, covariance, rtol=1e-8)
    from scipy.stats import t

    half = t.ppf(0.975, 58) * np.sqrt(covariance[0, 0])
    assert_allclose(found.interval["rate"], (p[0] - half, p[0] + half), rtol=1e-8)
    # The profile of a linear model is a parabola: the same interval.
    profile = found.profile("rate")
    assert_allclose(
        [profile.attrs["low"], profile.attrs["high"]], found.interval["rate"], rtol=2e-4
    )
    assert not profile.attrs["flat"]
    sigma2 = rss[0] / 60
    expected = -30.0 * (np.log(2 * np.pi * sigma2) + 1.0)
    assert found.log_likelihood == pytest.approx(expected, rel=1e-10)
    assert found.bic == pytest.approx(-2 * expected + 3 * np.log(60), rel=1e-10)


def test_known_noise_gives_chi_square() -> None:
    system, data = line(noise=0.1)
    found = ss.fit(system, data, {"rate": None, "y": None}, noise={"y": 0.1})
    A = np.column_stack([data["t"], np.ones(60)]) / 0.1
    assert_allclose(found.covariance, np.linalg.inv(A.T @ A), rtol=1e-8)
    assert found.statistics.tests["p_value"] > 1e-3
    profile = found.profile("rate")
    half = 1.959963984540054 * np.sqrt(found.covariance[0, 0])
    assert profile.attrs["high"] - found.estimate["rate"] == pytest.approx(half, rel=1e-3)
    small = ss.fit(system, data, {"rate": None, "y": None}, noise={"y": 0.03})
    assert "larger than the noise" in small.message


def test_correlated_residuals_widen_the_intervals() -> None:
    """Noise of an autoregressive process: the truth is in 95 % of the intervals, which it is not
    without that."""
    rho, inside, narrow = 0.8, 0, 0
    for seed in range(60):
        system, data = line(noise=0.0, count=300)
        rng = np.random.default_rng(seed)
        e = np.zeros(300)
        for i in range(1, 300):
            e[i] = rho * e[i - 1] + 0.1 * rng.standard_normal()
        data["y"] = data["y"] + e
        found = ss.fit(system, data, {"rate": None, "y": None}, starts=1)
        low, high = found.interval["rate"]
        inside += low <= 2.0 <= high
        share = np.sqrt(found.statistics.weight)
        middle, half = 0.5 * (low + high), 0.5 * (high - low) * share
        narrow += abs(middle - 2.0) <= half
        assert found.statistics.weight < 0.3
    assert inside >= 51
    assert narrow <= 45


def test_stored_and_opened(tmp_path: Path) -> None:
    record = synthetic.stribeck(2)
    found = record.fit(starts=2)
    found.save(tmp_path / "fit.nc")
    again = ss.open(tmp_path / "fit.nc")
    assert isinstance(again, ss.Fit)
    assert again.estimate == found.estimate
    assert again.certificate == found.certificate
    assert again.message == found.message
    assert again.problem.log_likelihood(again.values) == found.log_likelihood
    assert_allclose(again.profile("v_s")["rise"], found.profile("v_s")["rise"], atol=1e-9)
    assert again.summary().to_json() == found.summary().to_json()


def test_the_fitted_system_goes_on() -> None:
    record = synthetic.stribeck(2)
    found = record.fit(starts=2)
    system = found.system
    assert {n: system.values[n] for n in found.names} == found.estimate
    assert ss.equilibria(system).isolated
    motion = ss.simulate(system, (0.0, 30.0))
    assert_allclose(motion.at(10.0)["x"], found.trajectory.at(10.0)["x"], atol=1e-7)
    assert "friction" in str(system.equations()) or system.equations() is not None


def test_draws_have_the_covariance() -> None:
    found = synthetic.stribeck(2).fit(starts=1)
    draws = found.draws(4000)
    table = np.array([draws[name].values for name in found.names])
    assert_allclose(np.cov(table) / found.covariance, 1.0, atol=0.25)
    low, high = found.problem.bounds
    assert np.all(table >= low[:, None])
    assert np.all(table <= high[:, None])
    with pytest.raises(ss.DeclarationError, match="count"):
        found.draws(0)
    with pytest.raises(ss.DeclarationError, match="unknown name; it was not fitted"):
        found.profile("V")


def test_interrupted_fits_keep_the_best() -> None:
    """Ctrl-C in the middle: the best so far, said to be that."""
    told: list[float] = []

    def interrupt(done: float) -> None:
        told.append(done)
        if len(told) == 20:
            signal.raise_signal(signal.SIGINT)

    found = synthetic.stribeck(0).fit(starts=64, progress=interrupt)
    assert len(told) == 20
    assert found.outcome is Completion.INTERRUPTED
    assert not found.certificate.ok
    assert np.all(np.isfinite(found.values))
    assert np.isfinite(found.log_likelihood)


def test_progress_is_told() -> None:
    record = synthetic.forced(0)
    told: list[float] = []
    record.fit(starts=2, progress=told.append)
    assert told == sorted(told)
    assert 0.0 <= told[0] < told[-1] <= 1.0


def test_the_picture(tmp_path: Path) -> None:
    found = synthetic.stribeck(0).fit(starts=1)
    figure = found.plot()
    labels = [ax.get_ylabel() for ax in figure.axes]
    assert labels[1::2] == ["residual", "residual"]
    assert "position" in labels[0]
    of_events = synthetic.slips(0).fit(starts=1)
    of_events.plot().savefig(tmp_path / "events.png")
    assert of_events.plot().axes[-1].get_xlabel() == "number of the event"
