"""Derivatives of motions: closed forms, differences, and where there is none."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.orbits.sensitivities.motion import second_opinion, sensitivities


def oscillator(**changes: Any) -> ss.System:
    """A mass on a spring and on a rough floor."""
    declared: dict[str, Any] = {
        "name": "oscillator",
        "parameters": {
            "m": ss.Parameter(1.3, "kg"),
            "k": ss.Parameter(2.1, "N/m"),
            "s": ss.Parameter(0.2, "N"),
        },
        "coordinates": {"x": ss.Inertial("m", "place")},
        "kinetic": "m/2*d_x**2",
        "potential": "k/2*x**2",
        "contacts": {"floor": ss.Contact("d_x", "s", unit="N")},
        "initial": {"x": 1.0},
        "time_unit": "s",
    }
    return ss.System(**(declared | changes))


def test_free_oscillator() -> None:
    """x = x₀ cos ωt, with ω² = k/m."""
    system = oscillator(contacts={}, parameters={"m": ss.Parameter(1.3), "k": ss.Parameter(2.1)})
    motion = ss.simulate(system, (0.0, 20.0))
    t = np.linspace(0.0, 20.0, 57)
    found = sensitivities(motion, ["k", "m", "x", "d_x"], t, ["x", "energy", "k*x**2/2"])
    w = math.sqrt(2.1 / 1.3)
    slow = -t * np.sin(w * t)
    by_w = {"k": w / (2 * 2.1), "m": -w / (2 * 1.3)}
    expected = [slow * by_w["k"], slow * by_w["m"], np.cos(w * t), np.sin(w * t) / w]
    assert found.slopes[0] == pytest.approx(np.transpose(expected), abs=1e-11)
    # E = k x₀²/2 + m v₀²/2
    assert found.slopes[1] == pytest.approx(np.tile([0.5, 0.0, 2.1, 0.0], (57, 1)), abs=1e-11)
    x = np.cos(w * t)
    assert found.values[2] == pytest.approx(2.1 * x**2 / 2, abs=1e-12)
    assert found.slopes[2][:, 0] == pytest.approx(x**2 / 2 + 2.1 * x * expected[0], abs=1e-11)
    assert found.missing == ()


def test_half_swings() -> None:
    """Every half swing takes π/ω and 2s/k off the amplitude; at the end it rests."""
    motion = ss.simulate(oscillator(), (0.0, 30.0))
    found = sensitivities(motion, ["s", "k", "x", "m"], [29.0], ["x", "friction_floor"])
    # 1 → −0.81 → 0.62 → −0.43 → 0.24 → −0.05, which is within s/k
    n = 5
    sign = (-1.0) ** n
    expected = [sign * -2 * n / 2.1, sign * 2 * n * 0.2 / 2.1**2, sign, 0.0]
    assert found.slopes[0, 0] == pytest.approx(expected, abs=1e-11)
    x = sign * (1.0 - 2 * n * 0.2 / 2.1)
    held = [2.1 * expected[0], x + 2.1 * expected[1], 2.1 * sign, 0.0]
    assert found.slopes[1, 0] == pytest.approx(held, abs=1e-11)
    # t_j = jπ/ω
    w = math.sqrt(2.1 / 1.3)
    times = np.arange(1, n + 1) * math.pi / w
    assert found.switch_times == pytest.approx(times, abs=1e-11)
    by = np.outer(times, [0.0, -1 / (2 * 2.1), 0.0, 1 / (2 * 1.3)])
    assert found.switches == pytest.approx(by, abs=1e-10)


def test_bouncing_ball() -> None:
    """Falls from h, rebounds with e: closed forms after the first impact."""
    system = ss.System(
        name="ball",
        parameters={"g": ss.Parameter(9.81), "e": ss.Parameter(0.8)},
        coordinates={"z": ss.Inertial()},
        kinetic="d_z**2/2",
        potential="g*z",
        contacts={"floor": ss.Unilateral("z", restitution="e")},
        initial={"z": 1.0},
    )
    motion = ss.simulate(system, (0.0, 0.9))
    found = sensitivities(motion, ["g", "e", "z"], [0.8], ["z", "d_z"])
    g, e, h, t = 9.81, 0.8, 1.0, 0.8
    t1 = math.sqrt(2 * h / g)
    tau = t - t1
    by_t1 = np.array([-t1 / (2 * g), 0.0, t1 / (2 * h)])
    v = e * g * t1
    by_v = np.array([e * t1, g * t1, 0.0]) + e * g * by_t1
    z = by_v * tau - v * by_t1 - np.array([tau**2 / 2, 0, 0]) + g * tau * by_t1
    assert found.slopes[0, 0] == pytest.approx(z, abs=1e-11)
    assert found.slopes[1, 0] == pytest.approx(by_v - np.array([tau, 0, 0]) + g * by_t1, abs=1e-11)
    assert found.switches[0] == pytest.approx(by_t1, abs=1e-12)


CASES = {
    "belt_stribeck": (["V", "k", "x"], (0.0, 30.0)),
    "forced_oscillator": (["omega", "F_c", "x"], (0.0, 11.0)),
    "rocking_toy": (["P", "psi"], (0.0, 3.0)),
    "plate_compactor": (["m", "mu"], (0.0, 0.4)),
    "spring_slider": (["V"], (0.0, 8.0)),
    "cart_pendulum": (["F_c", "l", "x"], (0.0, 3.0)),
    "limit_stops": (["k", "e"], (0.0, 0.01)),
    "lugre_positioner": (["K_p", "sigma_0"], (0.0, 0.5)),
}


@pytest.mark.parametrize("name", CASES)
def test_differences(name: str) -> None:
    """The derivative of the last state, beside extrapolated differences of motions."""
    system = getattr(ss.catalogue, name)()
    names, span = CASES[name]

    motion = ss.simulate(system, span)
    found = sensitivities(motion, names, [span[1]])
    assert found.missing == ()
    expected = second_opinion(found)
    size = np.max(np.abs(expected), axis=(1, 2), keepdims=True)
    assert np.max(np.abs(found.slopes - expected) / np.maximum(size, 1e-9)) < 1e-7


def test_pushed_while_it_sticks() -> None:
    """Friction takes a small push away at once, and it hardly moves meanwhile: the derivative with
    respect to the velocity is zero, and exists."""
    motion = ss.simulate(oscillator(initial={"x": 0.05}), (0.0, 1.0))
    found = sensitivities(motion, ["d_x", "x"], [0.5, 1.0], ["x", "d_x"])
    assert np.all(found.slopes[:, :, 0] == 0.0)
    assert np.all(found.slopes[0, :, 1] == 1.0)
    assert found.missing == ()


def test_no_derivative_where_it_begins_to_slip() -> None:
    """Pushed back, it slips the other way first, with another force."""
    motion = ss.simulate(oscillator(), (0.0, 1.0))
    found = sensitivities(motion, ["d_x"], [0.0, 0.5])
    assert found.missing[0][0] == 0.0
    assert np.all(np.isfinite(found.slopes[:, 0])) and np.all(np.isnan(found.slopes[:, 1]))
    assert sensitivities(motion, ["x"], [0.5]).missing == ()


def test_belt_that_carries() -> None:
    """What sticks to a belt moves with it, whatever its first velocity."""
    system = oscillator(
        parameters={"m": ss.Parameter(1.0), "k": ss.Parameter(1.0), "V": ss.Parameter(0.1)},
        contacts={"belt": ss.Contact("d_x", "1", surface_speed="V")},
        initial={"x": 0.0, "d_x": 0.1},
    )
    motion = ss.simulate(system, (0.0, 3.0))
    found = sensitivities(motion, ["V", "d_x"], [2.0], ["x", "d_x"])
    assert found.slopes[:, 0] == pytest.approx(np.array([[2.0, 0.0], [1.0, 0.0]]), abs=1e-13)


def test_no_derivative_where_a_stop_is_touched() -> None:
    """x = cos t comes to the stop at −1 with no speed."""
    system = oscillator(
        parameters={},
        kinetic="d_x**2/2",
        potential="x**2/2",
        contacts={"stop": ss.Unilateral("1 + x", restitution=0.5)},
    )
    motion = ss.simulate(system, (0.0, 6.0))
    found = sensitivities(motion, ["x"], [1.0, 3.0, 4.0, 6.0])
    assert len(found.missing) >= 1
    assert found.missing[0][0] == pytest.approx(math.pi, abs=1e-6)
    assert np.all(np.isfinite(found.slopes[:, :2])) and np.all(np.isnan(found.slopes[:, 2:]))


@pytest.mark.parametrize("samples", [3, 400])
def test_no_derivative_where_the_threshold_is_touched(samples: int) -> None:
    """A force of the same amplitude as the threshold never moves it, but any larger one does."""
    system = oscillator(
        parameters={"F": ss.Parameter(0.2)},
        coordinates={"x": ss.Inertial(force="F*sin(t)")},
        kinetic="d_x**2/2",
        potential="0",
        contacts={"floor": ss.Contact("d_x", "0.2")},
        initial={"x": 0.0},
    )
    motion = ss.simulate(system, (0.0, 4.0))
    found = sensitivities(motion, ["F"], np.linspace(0.0, 4.0, samples))
    assert [t for t, _ in found.missing] == pytest.approx([math.pi / 2], abs=1e-6)
    assert "touched" in found.missing[0][1]
    below = sensitivities(ss.simulate(system, (0.0, 4.0), parameters={"F": 0.199}), ["F"])
    assert below.missing == ()


def test_no_derivative_where_events_coincide() -> None:
    """Two blocks on each other that start to slip at the same time for these parameters only."""
    system = ss.System(
        name="two",
        parameters={"a": ss.Parameter(1.0), "b": ss.Parameter(1.0)},
        coordinates={
            "x": ss.Inertial(force="a*t"),
            "y": ss.Inertial(force="b*t"),
        },
        kinetic="d_x**2/2 + d_y**2/2 + 0.2*d_x*d_y",
        potential="0",
        contacts={name: ss.Contact(f"d_{name}", "1", kinetic="0.5") for name in ("x", "y")},
    )
    motion = ss.simulate(system, (0.0, 2.0))
    found = sensitivities(motion, ["a"], [2.0])
    assert [t for t, _ in found.missing] == pytest.approx([1.0], abs=1e-9)
    assert "coincide" in found.missing[0][1]


def test_dataset() -> None:
    """Units, dimensions and a second opinion."""
    motion = ss.simulate(oscillator(), (0.0, 5.0))
    found = motion.sensitivity(
        ["s", "x"], [1.0, 5.0], of=["x", "friction_floor"], second_opinion=True
    )
    assert dict(found.sizes) == {"parameter": 2, "time": 2, "switch": 2}
    assert found["x"].attrs["units"] == "m"
    assert found["friction_floor"].attrs["units"] == "N"
    assert list(found["parameter_units"].values) == ["N", "m"]
    other = found["x_by_differences"]
    assert found["x"].values == pytest.approx(other.values, abs=1e-8)
    assert found.attrs["missing"] == []


@pytest.mark.parametrize(
    ("names", "times", "of", "said"),
    [
        (["mu"], None, None, "unknown parameter or part of the state"),
        (["k"], [99.0], None, "outside the computed time span"),
        (["k"], None, ["xx"], "unknown quantity"),
        (["k"], None, ["dissipated_energy"], "is an integral"),
        (["k"], None, ["abs(x)"], "kink"),
    ],
)
def test_bad_input(names: list[str], times: Any, of: Any, said: str) -> None:
    motion = ss.simulate(oscillator(), (0.0, 5.0))
    with pytest.raises(ss.DeclarationError, match=said):
        motion.sensitivity(names, times, of=of)


def test_parameters_of_laws_and_samples() -> None:
    """A measured drive that a parameter multiplies, and a law whose numbers depend on one."""
    t = np.linspace(0.0, 6.0, 61)
    a = 3.0 * np.sin(2.0 * t) + np.random.default_rng(0).standard_normal(61)
    system = ss.System(
        name="measured",
        parameters={"gain": ss.Parameter(1.0), "mu": ss.Parameter(1.0, range="(0, inf)")},
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="-gain*a*x",
        drives={"a": ss.Samples(t, a, kind="cubic")},
        contacts={"ground": ss.laws.stribeck("d_x", F_s="1.2*mu", F_c="mu", v_s=0.1)},
        span=(0.0, 6.0),
    )
    found = ss.simulate(system).sensitivity(["gain", "mu"], [2.0, 4.0, 5.9], second_opinion=True)
    assert found.attrs["missing"] == []
    for name in ("x", "d_x"):
        other = found[f"{name}_by_differences"].values
        np.testing.assert_allclose(found[name].values, other, rtol=1e-7)
