"""Tolerances bound the errors that they name, and smaller ones make these smaller."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import stickslip as ss

SWING = ss.catalogue.cart_pendulum()
SPAN = (0.0, 10.0)
ELLIPSE = ss.Ellipsoid(
    [["1 + cos(2*pi*s)/2", "0.2*sin(2*pi*s)"], ["0.2*sin(2*pi*s)", "1 + sin(2*pi*s)/3"]]
)
FAR = np.array([5.0, 3.0])
PUSHED = ss.System(
    "pushed",
    parameters={"F": 0.5},
    coordinates={"x": ss.Inertial(force="F")},
    kinetic="d_x**2/2",
    contacts={"floor": ss.Contact("d_x", 1.0)},
)


def end(rtol: float = 1e-10, atol: float = 1e-12) -> float:
    """Where the pendulum ends."""
    return float(ss.simulate(SWING, SPAN, rtol=rtol, atol=atol, flow="taylor")["phi"][-1])


def end_of_many(rtol: float) -> float:
    return float(ss.simulate_many(SWING, SPAN, rtol=rtol).dataset["final_phi"][0])


def end_of_steps(rtol: float) -> float:
    stepper = ss.Stepper(SWING, rtol=rtol)
    return [stepper.advance(t)["phi"] for t in (3.0, 7.0, 10.0)][-1]


def residual(rtol: float) -> float:
    """Of a fit to exact data, where it starts."""
    data = {"t": [0.0, 10.0], "phi": [0.0, end(1e-13)]}
    problem = ss.fit_problem(SWING, data, ["M"], noise={"phi": 1.0}, rtol=rtol)
    return float(problem.residuals(problem.start)[-1])


def bracket(tolerance: float) -> float:
    """Part of the range between rest and sliding."""
    found = ss.sliding_threshold(PUSHED, "F", (0.3, 2.3), initial={"x": 0.0}, tolerance=tolerance)
    assert found.still <= 1.0 <= found.moving
    return (found.moving - found.still) / 2.0


def balance(tolerance: float) -> float:
    psi = ss.WeightedL1(["1 + cos(2*pi*s)/2", "1"])
    stiffness = [[2.0, -1.0], [-1.0, 2.0]]
    problem = ss.Evolution(stiffness, ["5*t - t**2", "2*sin(t)"], psi, np.zeros(2), 0.3, (0, 5))
    return ss.evolve(problem, tolerance=tolerance).certificate["energy balance"].value


def nearest(tolerance: float) -> float:
    """Distance from the nearest point, relative to the size of the set (about 1)."""
    return float(np.linalg.norm(ELLIPSE.average(tolerance).project(FAR) - EXACT))


EXACT = ELLIPSE.average(1e-11).project(FAR)
ACCURACY: dict[str, tuple[Callable[[float], float], float, tuple[float, ...]]] = {
    "rtol": (end, end(1e-13), (1e-4, 1e-7, 1e-10)),
    "atol": (lambda atol: end(1e-12, atol), end(1e-13), (1e-2, 1e-5, 1e-8)),
    "rtol of many": (end_of_many, end(1e-13), (1e-4, 1e-7, 1e-10)),
    "rtol of steps": (end_of_steps, end(1e-13), (1e-4, 1e-7, 1e-10)),
    "rtol of a fit": (residual, 0.0, (1e-4, 1e-7, 1e-10)),
    "threshold": (bracket, 0.0, (1e-1, 1e-3, 1e-6)),
    "energy balance": (balance, 0.0, (1e-1, 1e-2, 1e-3)),
    "nearest point": (lambda gap: nearest(gap**2), 0.0, (1e-2, 3e-3, 1e-3)),
}


@pytest.mark.parametrize("kind", ACCURACY)
def test_tolerances_bound_errors(kind: str) -> None:
    found, exact, tolerances = ACCURACY[kind]
    errors = [abs(found(tolerance) - exact) for tolerance in tolerances]
    assert np.all(np.array(errors) <= tolerances), errors
    assert errors[0] > errors[-1], errors
