"""Systems of the catalogue that laws made possible, against closed forms and other solvers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from oracles import den_hartog


def stable(system: ss.System, **parameters: float) -> bool:
    """Whether steady sliding is stable."""
    (point,) = ss.equilibria(system, parameters=parameters).isolated
    assert point.stable is not None
    return point.stable


def test_where_steady_sliding_on_a_falling_curve_loses_its_stability() -> None:
    system = ss.catalogue.belt_stribeck()
    critical = 0.4 * np.log(0.5 / (0.2 * 0.4))
    assert system.evaluate("critical_speed") == pytest.approx(critical)
    assert stable(system, V=critical * (1 + 1e-6))
    assert not stable(system, V=critical * (1 - 1e-6))


def test_flutter_of_two_modes() -> None:
    """Hoffmann et al. 2002, without and with damping."""
    system = ss.catalogue.brake_mode_coupling()
    k = np.array([[23.25, 9 * 3**0.5 / 4], [9 * 3**0.5 / 4, 18.75]])
    undamped = (k[0, 1] ** 2 + (k[0, 0] - k[1, 1]) ** 2 / 4) / (k[0, 1] * 11)
    assert system.evaluate("undamped_flutter") == pytest.approx(undamped)
    for c in (0.1, 0.5):
        flutter = undamped + c**2 * 42 / (2 * k[0, 1] * 11)
        assert stable(system, c=c, mu=flutter * (1 - 1e-6))
        assert not stable(system, c=c, mu=flutter * (1 + 1e-6))


def test_least_bow_force() -> None:
    system = ss.catalogue.bowed_string()
    least = system.evaluate("least_bow_force")
    assert least == pytest.approx(4 * np.pi * 0.005 * 196 * 5e-4 * 0.04 / (0.5 * 0.1))
    assert stable(system, F=least * (1 - 1e-6))
    assert not stable(system, F=least * (1 + 1e-6))


def test_drill_string_with_a_table_held_fast() -> None:
    system = ss.catalogue.drill_string()
    critical = system.evaluate("critical_speed")
    assert stable(system, Omega=critical * 1.001, c_t=1e6, k_t=1e9)
    assert not stable(system, Omega=critical * 0.999, c_t=1e6, k_t=1e9)


def test_stiff_damper_is_den_hartogs() -> None:
    """Jenkins' oscillator tends to Den Hartog's as its spring becomes stiff. At a turn the slider
    lags by 2F_c/k_d, for a time like the root of that, and so does the amplitude."""
    values = {"m": 1.0, "k": 1.0, "F_c": 0.3, "P": 1.0, "omega": 0.8}
    amplitude = ss.catalogue.forced_oscillator(**values).evaluate("nonstop_amplitude")
    assert amplitude == pytest.approx(den_hartog.amplitude(0.8, 0.3))
    errors = []
    for k_d in (400.0, 1600.0):
        cycle = ss.find_cycle(ss.catalogue.jenkins_oscillator(c=0.0, k_d=k_d, **values))
        errors.append(abs(cycle.extrema["x"][1] - amplitude))
    assert errors[1] < 0.012
    assert errors[1] == pytest.approx(errors[0] / 2, rel=0.01)


def test_a_slider_that_sticks_is_a_spring() -> None:
    system = ss.catalogue.jenkins_oscillator(P=0.1, omega=1.3, c=0.2)
    cycle = ss.find_cycle(system.with_parameters(F_c=1.0))
    assert cycle.extrema["x"][1] == pytest.approx(0.1 / abs(2 - 1.69 + 0.26j), rel=1e-9)


def test_jenkins_loss_in_a_cycle() -> None:
    cycle = ss.find_cycle(ss.catalogue.jenkins_oscillator())
    low, high = cycle.extrema["x"]
    A = (high - low) / 2
    loss = cycle.contacts["damper"].dissipated
    assert loss == pytest.approx(4 * 0.5 * (A - 0.5), rel=1e-9)


def test_hunting() -> None:
    """Canudas de Wit et al. 1995: the position never settles. Breakaways against an implicit
    integrator that knows nothing of this library."""
    system = ss.catalogue.lugre_positioner()
    p = system.values

    def rates(t, y):
        x, v, e, z = y
        g = p["F_c"] + (p["F_s"] - p["F_c"]) * np.exp(-((v / p["v_s"]) ** 2))
        bending = v - p["sigma_0"] * abs(v) * z / g
        friction = p["sigma_0"] * z + p["sigma_1"] * bending + p["sigma_2"] * v
        control = -p["K_p"] * (x - 1) - p["K_i"] * e - p["K_d"] * v
        return [v, control - friction, x - 1, bending]

    times = np.linspace(0.0, 40.0, 21)
    other = solve_ivp(rates, (0, 40), [0.0] * 4, "Radau", times, rtol=1e-9, atol=1e-12)
    motion = ss.simulate(system, (0.0, 90.0))
    assert motion.certificate.ok
    assert motion.at(times)["x"] == pytest.approx(other.y[0], abs=2e-6)
    late = motion.at(np.linspace(45.0, 90.0, 901))["x"]
    assert late.max() > 1.05 and late.min() < 0.95
    cycle = ss.find_cycle(system, motion.final)
    assert cycle.certificate.ok and cycle.stable
    t = np.linspace(40.0, 90.0, 50_001)
    x = motion.at(t)["x"]
    (first, second) = t[1:][(x[:-1] < 1.0) & (x[1:] >= 1.0)][:2]
    assert cycle.period == pytest.approx(second - first, abs=5e-3)


def test_step_of_the_inertia_drive() -> None:
    system = ss.catalogue.stick_slip_actuator()
    motion = ss.simulate(system)
    assert motion.certificate.ok
    x = motion.at(np.arange(2, 10) * 1e-3)["x"]
    assert np.diff(x) == pytest.approx(1e-6 / 0.8 - 0.1 / 0.01 * (2e-4) ** 2, rel=1e-9)
    assert np.diff(x) == pytest.approx(system.evaluate("step"), rel=1e-9)


def test_newmarks_pulse() -> None:
    """A rectangular pulse, as samples: the block slides by (AT)²/(2N) (1 − N/A)."""
    A, T, N = 5.0, 0.4, 0.2 * 9.81
    pulse = ss.Samples([0.0, 1.0, 1.0 + T, 10.0], [0.0, -A, 0.0, 0.0], kind="hold")
    motion = ss.simulate(ss.catalogue.sliding_base(a=pulse))
    assert motion.certificate.ok
    assert motion.final["x"] == pytest.approx((A * T) ** 2 / (2 * N) * (1 - N / A), rel=1e-9)


def test_friction_emerges_from_wells() -> None:
    """Mielke 2012: z tends to the play operator with threshold ρ."""
    times = np.linspace(0.2, 4.9, 300)
    errors = []
    for epsilon in (0.1, 0.02):
        play = ss.play("5*t - t**2", 1.0, (0, 5), initial=0.0)
        motion = ss.simulate(ss.catalogue.wiggly_energy(epsilon=epsilon, gamma=1.5))
        errors.append(np.max(abs(motion.at(times)["z"] - play.at(times)["z"])))
    assert errors[0] < 1.0
    assert errors[1] < 0.3 * errors[0]
