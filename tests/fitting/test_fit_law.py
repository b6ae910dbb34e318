"""Friction laws fitted to points of force over speed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import DeclarationError

V = np.concatenate([-np.geomspace(0.01, 2.0, 30)[::-1], np.geomspace(0.01, 2.0, 30)])
TRUTH: dict[str, dict[str, float]] = {
    "coulomb": {"F_c": 0.7, "b": 0.15},
    "stribeck": {"F_s": 1.1, "F_c": 0.6, "v_s": 0.15, "b": 0.1},
    "stribeck_gaussian": {"F_s": 1.1, "F_c": 0.6, "v_s": 0.15, "b": 0.1},
    "stribeck_lorentzian": {"F_s": 1.1, "F_c": 0.6, "v_s": 0.15, "b": 0.1},
}


def forces(name: str, v: Any) -> Any:
    p = TRUTH[name]
    s = np.abs(v)
    fall = {
        "coulomb": lambda: 0.0 * s,
        "stribeck": lambda: np.exp(-s / p["v_s"]),
        "stribeck_gaussian": lambda: np.exp(-((s / p["v_s"]) ** 2)),
        "stribeck_lorentzian": lambda: 1.0 / (1.0 + (s / p["v_s"]) ** 2),
    }[name]()
    return np.sign(v) * (p["F_c"] + (p.get("F_s", 0.0) - p["F_c"]) * fall + p["b"] * s)


@pytest.mark.parametrize("name", TRUTH)
def test_exact_points_give_the_law(name: str) -> None:
    found = ss.fit_law((V, forces(name, V)), name, noise=1e-3, starts=8)
    assert found.certificate.ok
    for parameter, value in TRUTH[name].items():
        assert found.estimate[parameter] == pytest.approx(value, rel=1e-7)
    at = np.array([-1.3, 0.02, 0.7])
    np.testing.assert_allclose(found.at(at), forces(name, at), rtol=1e-7)


def test_intervals_are_those_of_least_squares() -> None:
    """Beside SciPy's covariance, and they hold the truth as often as they say."""
    from scipy.optimize import curve_fit

    def curve(v: Any, F_c: float, b: float) -> Any:
        return np.sign(v) * (F_c + b * np.abs(v))

    held = 0
    for seed in range(20):
        noise = 0.02 * np.random.default_rng(seed).standard_normal(len(V))
        F = forces("coulomb", V) + noise
        found = ss.fit_law((V, F), ss.laws.coulomb, starts=1)
        best, covariance = curve_fit(curve, V, F, [0.5, 0.1])
        np.testing.assert_allclose(found.values, best, rtol=1e-6)
        if found.statistics.weight == 1.0:
            np.testing.assert_allclose(found.covariance, covariance, rtol=1e-5)
        low, high = found.interval["F_c"]
        held += low < 0.7 < high
    assert held >= 17


def test_points_of_every_form(tmp_path: Path) -> None:
    v, F = V[30:], forces("coulomb", V[30:])
    file = tmp_path / "points.csv"
    file.write_text(
        "speed;force\n"
        + "\n".join(f"{a!r};{b!r}" for a, b in zip(v.tolist(), F.tolist(), strict=True))
    )
    ways: list[Any] = [(v, F), np.column_stack([v, F]), {"v": v, "F": F}, file]
    for points in ways:
        found = ss.fit_law(points, "coulomb", starts=1)
        assert found.estimate == pytest.approx(TRUTH["coulomb"], rel=1e-7)


def test_what_follows_from_it(tmp_path: Path) -> None:
    """Profiles, files, pictures, and a contact."""
    noise = 0.01 * np.random.default_rng(0).standard_normal(len(V))
    found = ss.fit_law((V, forces("stribeck", V) + noise), ss.laws.stribeck, starts=4)
    profile = found.profile("v_s")
    low, high = found.interval["v_s"]
    assert profile.attrs["low"] == pytest.approx(low, rel=0.01)
    assert profile.attrs["high"] == pytest.approx(high, rel=0.01)
    found.save(tmp_path / "law.nc")
    again = ss.open(tmp_path / "law.nc")
    assert isinstance(again, ss.LawFit) and again.estimate == found.estimate
    assert again.law is ss.laws.stribeck
    np.testing.assert_array_equal(again.speeds, V)
    axes = found.plot().axes
    assert [a.get_ylabel() for a in axes] == ["friction force  [N]", "residual"]
    system = ss.System(
        "block",
        coordinates={"x": ss.Inertial("m")},
        kinetic="d_x**2/2",
        potential="x**2/2",
        contacts={"belt": found.contact("d_x", surface_speed=0.1)},
        span=(0.0, 20.0),
    )
    assert ss.simulate(system).certificate.ok


def test_a_law_that_does_not_fit_is_noticed() -> None:
    found = ss.fit_law((V, forces("stribeck", V)), "coulomb", starts=2)
    assert found.statistics.weight < 0.5
    assert any("correlation" in note for note in found.notes)
    fixed = ss.fit_law(
        (V, forces("coulomb", V)), "static_kinetic", parameters={"F_s": 3.0}, starts=2
    )
    assert fixed.names == ["F_c", "b"]


WRONG: dict[str, tuple[Any, ...]] = {
    "2 speeds and 60 forces": ((V[:2], V), "coulomb"),
    "points[1]: at speed 0 the friction force is indeterminate": (
        ([1.0, 0.0], [1.0, 0.5]),
        "coulomb",
    ),
    "points[0]: the force is nan": (([1.0, 2.0], [np.nan, 0.5]), "coulomb"),
    "Change the sign": ((V, -V), "coulomb"),
    "the force of 'lugre' is not a function of the speed": ((V, V), "lugre"),
    "the force of 'table' is not": ((V, V), "table"),
    "unknown law 'stribek'": ((V, V), "stribek"),
    "free.F_s: the data do not depend": ((V, forces("coulomb", V)), "static_kinetic"),
    "it is ambiguous which columns have the speeds and forces": (
        {"a": V, "b": V, "c": V},
        "coulomb",
    ),
    "the array has shape (60,)": (V, "coulomb"),
    "they are not all numbers": (([1.0, "x"], [1.0, 2.0]), "coulomb"),
    "free.q": ((V, V), "coulomb", ["q"]),
}


@pytest.mark.parametrize("reason", WRONG)
def test_wrong_points(reason: str) -> None:
    with pytest.raises(DeclarationError) as error:
        ss.fit_law(*WRONG[reason], starts=1)
    assert reason in str(error.value) and error.value.remedy


def test_values_of_a_table_are_fitted_with_a_motion() -> None:
    """They are parameters like others: the Jacobian is exact, and the truth is found."""
    from tests.tables import belt

    system = belt(
        parameters={
            "a": ss.Parameter(0.3, range="(0, 0.45)"),
            "b": ss.Parameter(0.2, range="(0, 1)"),
        },
        tables={"mu": ss.Table([0.0, 0.1, 0.6, 3.0], [0.44, "a", "b", 0.3])},
    )
    truth = {"a": 0.33, "b": 0.24}
    t = np.linspace(0.1, 12.0, 80)
    x = np.asarray(ss.simulate(system, (0.0, 12.0), parameters=truth).at(t)["x"])
    noise = 0.002 * np.random.default_rng(1).standard_normal(len(t))
    problem = ss.fit_problem(system, {"t": t, "x": x + noise}, ["a", "b"], initial={"x": 0.0})
    p, h = np.array([0.31, 0.22]), 1e-6
    J = problem.jacobian(p)
    for j in range(2):
        step = h * np.eye(2)[j]
        rise = (problem.residuals(p + step) - problem.residuals(p - step)) / (2 * h)
        np.testing.assert_allclose(J[:, j], rise, rtol=1e-4, atol=1e-4 * np.abs(J).max())
    found = ss.fit(system, {"t": t, "x": x + noise}, ["a", "b"], starts=2)
    for name, (low, high) in found.interval.items():
        assert low - 0.01 < truth[name] < high + 0.01
    assert found.certificate.ok
