"""Painlevé's rod: where friction leaves no acceleration, and how motions come there."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.motion.outcome import Outcome

G = 9.81


def angles(mu: float) -> tuple[float, float]:
    """1 + 3 cos² θ = 3 μ sin θ cos θ is tan² θ − 3 μ tan θ + 4 = 0."""
    root = np.sqrt(9 * mu**2 - 16)
    return float(np.arctan((3 * mu - root) / 2)), float(np.arctan((3 * mu + root) / 2))


def slide(
    mu: float,
    theta: float,
    speed: float,
    rate: float = 0.0,
    end: float = 0.01,
    **given: float,
) -> ss.Trajectory:
    """The motion of the rod from a start with its tip on the floor.

    Parameters
    ----------
    mu, theta, speed, rate, end : float
        Friction, angle, velocity of the tip, rate of the angle, end of the span.
    **given : float
        Other parameters.
    """
    half = given.get("l", 1.0)
    start = {
        "y": half * float(np.sin(theta)),
        "theta": theta,
        "d_x": speed - half * float(np.sin(theta)) * rate,
        "d_y": half * float(np.cos(theta)) * rate,
        "d_theta": rate,
    }
    return ss.simulate(
        ss.catalogue.painleve_rod(), (0.0, end), initial=start, parameters={"mu": mu, **given}
    )


@pytest.mark.parametrize("mu", [1.34, 1.5, 2.0, 5.0])
def test_the_interval(mu: float) -> None:
    """What slides within it ends at once; outside, or the other way, it goes on."""
    lower, upper = angles(mu)
    facts = ss.catalogue.painleve_rod(mu=mu).declaration.facts
    assert {"critical_mu", "theta_1", "theta_2"} == set(facts)
    for theta in (lower + 1e-8, (lower + upper) / 2, upper - 1e-8):
        found = slide(mu, theta, -3.0)
        assert found.outcome is Outcome.NO_ACCELERATION and found.knots.time[-1] == 0.0
        other = slide(mu, theta, 3.0)
        assert other.outcome.ok and other.certificate.ok
    # The normal force there is m g over what friction leaves of the bracket.
    for theta in (lower - 1e-3, upper + 1e-3):
        found = slide(mu, theta, -3.0, end=1e-9)
        assert found.outcome.ok
        bracket = 1 + 3 * np.cos(theta) ** 2 - 3 * mu * np.sin(theta) * np.cos(theta)
        assert found.at([0.0])["normal_tip"][0] == pytest.approx(G / bracket, rel=1e-9)


def lifts_off(mu: float, theta: float, rate: float) -> tuple[bool, float, float]:
    """Whether the tip lifts off before the sliding motion jams, and angle and rate there.

    With dt = A ds, A = 1 + 3 cos² θ − 3 μ sin θ cos θ, the motion is smooth and takes for ever to
    come to A = 0; N = −m b/A, b = θ̇² sin θ − g.
    """

    def rates(s: float, y: NDArray[np.float64]) -> list[float]:
        sine, cosine = np.sin(y[0]), np.cos(y[0])
        bracket = 1 + 3 * cosine**2 - 3 * mu * sine * cosine
        return [y[1] * bracket, -3 * (y[1] ** 2 * sine - G) * (mu * sine - cosine)]

    def off(s: float, y: NDArray[np.float64]) -> float:
        return y[1] ** 2 * np.sin(y[0]) - G

    off.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(
        rates, (0.0, 10.0), [theta, rate], "DOP853", events=off, rtol=1e-12, atol=1e-13
    )
    theta, rate = map(float, found.y[:, -1])
    left = 1 + 3 * np.cos(theta) ** 2 - 3 * mu * np.sin(theta) * np.cos(theta)
    return found.status == 1 and left > 1e-9, theta, rate


@pytest.mark.parametrize("mu", [1.34, 1.4, 1.5, 1.6, 2.0, 3.0])
@pytest.mark.parametrize(("back", "part"), [(0.02, 0.5), (0.1, 0.2), (0.1, 0.98)])
def test_sliding_towards_it(mu: float, back: float, part: float) -> None:
    """The tip lifts off where l θ̇² sin θ = g; only for μ > 8/√27, and not always then, the motion
    comes to θ = θ₁ with that rate, and N tends to infinity."""
    lower, _ = angles(mu)
    rate = float(np.sqrt(G / np.sin(lower)))
    off, theta, turning = lifts_off(mu, lower - back, part * rate)
    assert off or mu > 8 / np.sqrt(27)
    found = slide(mu, lower - back, -60.0, part * rate, 0.3)
    if off:
        assert found.outcome.ok and found.certificate.ok
        assert next(iter(found.events["to"])) == "open"
        at = found.at([float(found.events["time"].iloc[0])])
        assert at["theta"][0] == pytest.approx(theta, abs=1e-9) and theta < lower
        assert at["d_theta"][0] == pytest.approx(turning, rel=1e-9)
        return
    assert theta == pytest.approx(lower, abs=1e-8)
    assert not found.certificate.ok
    if mu < 2.0:
        return  # a little above 8/√27 rounding may lead past that point
    assert found.outcome is Outcome.NO_ACCELERATION and len(found.events) == 0
    assert found.final["theta"] == pytest.approx(lower, abs=1e-8)
    assert found.final["d_theta"] == pytest.approx(rate, rel=0.1)  # comes there later
    end = found.knots.time[-1]
    force = found.at(end * (1 - 10.0 ** -np.arange(2.0, 6.0)))["normal_tip"]
    assert np.all(np.diff(force) > 0.0) and force[-1] > 20 * G


@settings(max_examples=60, deadline=None)
@given(
    mu=st.floats(0.0, 4 / 3 - 1e-6),
    theta=st.floats(0.05, 3.09),
    speed=st.floats(-10.0, 10.0),
    rate=st.floats(-8.0, 8.0),
    e=st.sampled_from([0.0, 0.5]),
    half=st.floats(0.3, 3.0),
)
@example(mu=1.015625, theta=1.015625, speed=-9.0, rate=0.0, e=0.5, half=0.375)  # bounces gently
def test_never_below_four_thirds(
    mu: float, theta: float, speed: float, rate: float, e: float, half: float
) -> None:
    """Every start of a slender rod has its motion if μ < 4/3.

    Parameters
    ----------
    mu, theta, speed, rate, e, half : float
        As of :func:`slide`.
    """
    found = slide(mu, theta, speed, rate, 0.5, e=e, l=half)
    assert found.outcome.ok, found.outcome
    assert found.certificate.ok, found.certificate


def test_as_declared() -> None:
    """The tip sticks, and the rod vaults over it."""
    found = ss.simulate(ss.catalogue.painleve_rod())
    assert found.outcome.ok and found.certificate.ok
    assert list(found.events["to"]) == ["stick", "slip-"]
    theta = found.at(np.linspace(*found.t_span, 1001))["theta"]
    assert np.min(theta) > 0.0 and 3.0 < np.max(theta) < np.pi
