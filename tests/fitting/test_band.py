"""How the uncertainty of a fit moves cycles and special points: against closed forms, and against
500 draws in a sweep."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from fitting import synthetic


@cache
def fitted() -> ss.Fit:
    return synthetic.stribeck(5).fit(starts=2)


@cache
def band() -> ss.Band:
    return fitted().continue_cycle("V", (0.05, 2.0))


def hopf(values: dict[str, float]) -> float:
    """Where the damping of steady sliding vanishes: c = (F_s − F_c)/v_s exp(−V/v_s)."""
    p = {**fitted().declared.values, **values}
    return p["v_s"] * np.log((p["F_s"] - p["F_c"]) / (p["c"] * p["v_s"]))


def test_the_hopf_point_and_its_deviation() -> None:
    """The gradient of the closed form, by differences, with the covariance of the fit."""
    found, fit = band(), fitted()
    (index,) = np.flatnonzero(found["kind"].values == "Hopf")
    exact = hopf(fit.estimate)
    assert found["value"].values[index] == pytest.approx(exact, rel=1e-6)
    gradient = []
    for name in fit.names:
        h = 1e-4 * fit.estimate[name]
        ends = [hopf({**fit.estimate, name: fit.estimate[name] + s * h}) for s in (1.0, -1.0)]
        gradient.append((ends[0] - ends[1]) / (2.0 * h))
    deviation = np.sqrt(np.array(gradient) @ fit.covariance @ gradient)
    assert found["value_sd"].values[index] == pytest.approx(deviation, rel=1e-2)


def test_amplitudes_against_500_draws_in_a_sweep() -> None:
    """Standard deviations to first order beside those of 500 systems, within 15 % (five deviations
    of a deviation of 500 draws are 16 %)."""
    fit, found = fitted(), band()
    draws = fit.draws(500, seed=1)
    data = found.dataset
    stable = np.flatnonzero(
        (data["stable"].values == 1) & np.isfinite(data["amplitude_x_sd"].values)
    )
    i = int(stable[np.argmin(np.abs(data["V"].values[stable] - 0.4))])
    V = float(data["V"].values[i])
    names = fit.names
    system = fit.system.with_parameters(V=V)
    axis = "; ".join(",".join(map(repr, draws[name].values.tolist())) for name in names)
    swept = ss.sweep(system, {",".join(names): axis}, ["amplitude:x", "period"])
    amplitude = swept.dataset["amplitude:x"].values.ravel()
    assert np.isfinite(amplitude).all()
    assert np.std(amplitude) == pytest.approx(float(data["amplitude_x_sd"].values[i]), rel=0.15)
    period = swept.dataset["period"].values.ravel()
    assert np.std(period) == pytest.approx(float(data["period_sd"].values[i]), rel=0.15)


def test_what_a_band_says(tmp_path: Path) -> None:
    found = band()
    assert "stick onset at V" in found.message
    assert np.isfinite(found["value_sd"].values).all()
    found.save(tmp_path / "band.nc")
    again = ss.open(tmp_path / "band.nc")
    assert again.message == found.message
    assert again.summary().to_json() == found.summary().to_json()
    figure = again.plot()
    assert figure.axes[0].get_xlabel().startswith("$V$")


def test_a_fit_of_initial_values_alone_moves_no_branch() -> None:
    record = synthetic.stribeck(0)
    found = ss.fit(record.system, record.data, {"x": (-1.0, 1.0)}, record.observe, starts=1)
    with pytest.raises(ss.DeclarationError, match="no fitted parameter"):
        found.continue_cycle("V", (0.05, 2.0))
