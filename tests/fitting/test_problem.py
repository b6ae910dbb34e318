"""Residuals and Jacobians: against differences, across recordings, events, drives and formulas."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import stickslip as ss
from fitting import synthetic
from stickslip.fitting.problem import NoDerivative


def differences(f: Callable[[np.ndarray], np.ndarray], p: np.ndarray) -> np.ndarray:
    """Richardson's extrapolation of central differences."""
    columns = []
    for j in range(len(p)):
        h = 1e-4 * max(abs(p[j]), 1e-2)
        step = np.eye(len(p))[j] * h
        rough, fine = ((f(p + s * step) - f(p - s * step)) / (2 * s * h) for s in (1.0, 0.5))
        columns.append((4.0 * fine - rough) / 3.0)
    return np.column_stack(columns)


def agrees(problem: ss.FitProblem, p: np.ndarray, limit: float = 1e-6) -> None:
    J = problem.jacobian(p)
    other = differences(problem.residuals, p)
    size = np.max(np.abs(J), axis=0)
    off = np.abs(J - other) / size
    # A switch that passes a datum within the differences makes these wrong, at few data.
    assert np.quantile(off, 0.97) < limit


@pytest.mark.parametrize("name", sorted(synthetic.ALL))
def test_jacobian_against_differences(name: str) -> None:
    record = synthetic.ALL[name](0)
    problem = ss.fit_problem(
        record.system, record.data, record.free, record.observe, noise=record.noise
    )
    agrees(problem, np.array([record.truth[n] for n in problem.names]), 1e-5)


def test_initial_values_as_formulas_and_free_ones() -> None:
    system = ss.catalogue.belt_block()
    t = np.linspace(0.5, 20.0, 60)
    exact = ss.simulate(system, (0.0, 20.0), initial={"x": 0.3, "d_x": 0.3})
    data = {"t": t, "x": exact.at(t)["x"]}
    begin = ss.Recording(data, begin=0.0, initial={"d_x": "V"})
    problem = ss.fit_problem(system, begin, {"V": None, "x": (-1.0, 1.0), "k": None})
    assert problem.names == ["V", "x", "k"]
    p = np.array([0.3, 0.3, 1.0])
    assert np.max(np.abs(problem.residuals(p))) < 1e-8
    agrees(problem, p + np.array([0.01, 0.02, 0.03]))


def test_several_recordings() -> None:
    """Two speeds of the belt, one friction law; each has its own start."""
    system = ss.catalogue.belt_stribeck()
    recordings = []
    for V, x in ((0.2, 0.1), (0.4, -0.2)):
        t = np.linspace(0.0, 15.0, 80)
        motion = ss.simulate(system, (0.0, 15.0), parameters={"V": V}, initial={"x": x})
        data = {"t": t, "x": motion.at(t)["x"]}
        recordings.append(ss.Recording(data, parameters={"V": V}))
    problem = ss.fit_problem(system, recordings, {"F_s": (0.5, 2), "x": (-1, 1)})
    assert problem.names == ["F_s", "x[1]", "x[2]"]
    p = np.array([1.0, 0.1, -0.2])
    assert np.max(np.abs(problem.residuals(p))) < 1e-8
    agrees(problem, p + 0.01)
    found = ss.fit(system, recordings, {"F_s": (0.5, 2), "x": (-1, 1)}, starts=2)
    assert_allclose(found.values, p, atol=1e-6)
    assert {"x", "x_2", "fitted_x_2", "time_2"} <= set(found.dataset)
    assert len(found.trajectories) == 2


def test_columns_called_like_unknowns_of_structures() -> None:
    """Those that results show, and all others."""
    body = ss.Structure(np.eye(3), 3.0 * np.eye(3) - np.ones((3, 3)) / 2.0, names={"tip": 2})
    system = ss.System(
        "body",
        parameters={"F": ss.Parameter(1.0)},
        structures={"u": body},
        forces={"u[tip]": "F*cos(t)"},
        contacts={"foot": ss.Contact("d_u[0]", 0.3)},
    )
    t = np.linspace(0.0, 10.0, 41)
    motion = ss.simulate(system, (0.0, 10.0), parameters={"F": 2.0})
    for name in ("u[tip]", "d_u[tip]", "u[1]"):
        column = sum(weight * motion.at(t)[mode] for mode, weight in system.unknown(name).items())
        problem = ss.fit_problem(system, {"t": t, name: column, "note": t}, {"F": (0.5, 3.0)})
        assert [entry.name for entry in problem.measured[0].columns] == [name]
        assert_allclose(problem.residuals(np.array([2.0])), 0.0, atol=1e-9)


def test_drives_from_the_same_file() -> None:
    """A shaken base: its acceleration and the answer stand in one table, with gaps."""
    system = ss.catalogue.sliding_base()
    drive = next(iter(system.drives))
    name = next(iter(system.coordinates))
    t = np.linspace(0.0, 6.0, 61)
    a = 4.0 * np.sin(2.0 * t) + np.sin(5.3 * t)
    given = replace(system, span=(0.0, 6.0)).configure({drive: ss.Samples(t, a)})
    motion = ss.simulate(given, (0.0, 6.0))
    x = np.asarray(motion.at(t)[name])
    x[[5, 17]] = np.nan
    free = {p: None for p in system.parameters if p.startswith("mu")}
    problem = ss.fit_problem(system, {"t": t, "a": a, name: x}, free, drives={drive: "a"})
    assert len(problem.data) == 59
    assert np.max(np.abs(problem.residuals(problem.start))) < 1e-8
    assert problem.measured[0].dropped == 2
    moved = problem.start * 1.01
    agrees(problem, moved)


def test_times_of_events_and_what_is_then() -> None:
    """F = F_s at the onset of slip, whatever else; its time moves by 1/(kV)."""
    record = synthetic.slips(0)
    problem = ss.fit_problem(
        record.system, record.data, {"F_s": (0.5, 3)}, record.observe, noise=record.noise,
        parameters={"F_k": 0.7, "V": 0.25},
    )  # fmt: skip
    J = problem.jacobian([1.2]) * problem.sigma[:, None]
    onset, force = np.split(J[:, 0], 2)
    assert_allclose(force, 1.0, rtol=1e-9)
    # The first slip waits for F_s in stick; so does every period, which is
    # 2Δ/(kV) + (2/ω)(π − arctan(ωΔ/(kV))).
    k, V, omega = 1.0, 0.25, 1.0
    z = omega * (1.2 - 0.7) / (k * V)
    period = 2.0 / (k * V) * (1.0 - 1.0 / (1.0 + z**2))
    assert_allclose(onset, 1.0 / (k * V) + period * np.arange(len(onset)), rtol=1e-9)
    agrees(problem, np.array([1.2]))


def test_where_there_is_no_derivative_it_says_so() -> None:
    """A force that just reaches the threshold: no number, but when and why."""
    system = ss.System(
        name="grazed",
        parameters={"A": ss.Parameter(1.0), "s": ss.Parameter(1.0, range="(0, inf)")},
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="-A*sin(t)*x",
        contacts={"ground": ss.Contact("d_x", "s")},
        span=(0.0, 3.0),
    )
    t = np.linspace(0.0, 3.0, 10)
    problem = ss.fit_problem(system, {"t": t, "x": t}, {"A": (0.5, 2.0)})
    with pytest.raises(NoDerivative, match=r"t = 1\.57"):
        problem.jacobian([1.0])
    assert problem.jacobian([0.9]).shape == (10, 1)
    assert np.all(problem.jacobian([0.9]) == 0.0)


def test_a_motion_that_stops_is_a_bad_fit_with_a_reason() -> None:
    system = ss.System(
        name="blows up",
        parameters={"r": ss.Parameter(0.1, range="(0, inf)")},
        internal={"y": ss.Internal("r*y**2")},
        initial={"y": 1.0},
        span=(0.0, 2.0),
    )
    t = np.linspace(0.0, 2.0, 20)
    problem = ss.fit_problem(system, {"t": t, "y": 1.0 / (1.0 - 0.2 * t)}, {"r": (0.01, 5.0)})
    assert np.all(np.isinf(problem.residuals([3.0])))
    assert "step too small" in problem.reason([3.0])
    assert problem.log_likelihood([3.0]) == -np.inf
    with pytest.raises(NoDerivative, match="the motion cannot be computed"):
        problem.jacobian([3.0])
    found = ss.fit(system, {"t": t, "y": 1.0 / (1.0 - 0.2 * t)}, {"r": (0.01, 5.0)})
    assert found.estimate["r"] == pytest.approx(0.2, rel=1e-7)
    assert any("abandoned (step too small" in note for note in found.notes)


def test_likelihood_and_its_gradient() -> None:
    record = synthetic.forced(0)  # a position is smooth at switches, so that differences hold
    p = np.array([0.5, 1.05])
    for noise in (record.noise, None):
        problem = ss.fit_problem(
            record.system, record.data, record.free, record.observe, noise=noise
        )
        slope = differences(lambda q, f=problem: np.array([f.log_likelihood(q)]), p)[0]
        assert_allclose(problem.log_likelihood_gradient(p), slope, rtol=1e-4)
    known = ss.fit_problem(
        record.system, record.data, record.free, record.observe, noise=record.noise
    )
    r = known.residuals(p)
    expected = -0.5 * r @ r - len(r) * (np.log(0.05) + 0.5 * np.log(2 * np.pi))
    assert known.log_likelihood(p) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("loss", ["soft_l1", "huber", "cauchy"])
def test_robust_losses_are_those_of_scipy(loss: str) -> None:
    from scipy.optimize import least_squares

    from stickslip.fitting.problem import LOSSES

    r = np.linspace(-3.0, 3.0, 13)
    cost = least_squares(lambda _: r, [0.0], loss=loss, max_nfev=1).cost
    assert 0.5 * np.sum(LOSSES[loss](r**2)[0]) == pytest.approx(cost, rel=1e-13)
    h = 1e-6
    slope = (LOSSES[loss](r**2 + h)[0] - LOSSES[loss](r**2 - h)[0]) / (2 * h)
    away = np.abs(r**2 - 1.0) > 2 * h
    assert_allclose(LOSSES[loss](r**2)[1][away], slope[away], rtol=1e-6)


def test_outliers_are_felt_less_by_a_robust_loss() -> None:
    record = synthetic.forced(11)
    x = record.data["x"].copy()
    x[::6] *= 2.0
    data = {**record.data, "x": x}
    plain = ss.fit(record.system, data, record.free, noise=record.noise, starts=2)
    robust = ss.fit(record.system, data, record.free, noise=record.noise, loss="cauchy", starts=2)
    off = [abs(f.estimate["F_c"] - record.truth["F_c"]) for f in (plain, robust)]
    assert off[1] < 0.3 * off[0]
    error = robust.statistics.error[robust.names.index("F_c")]
    assert off[1] < 4.0 * error
