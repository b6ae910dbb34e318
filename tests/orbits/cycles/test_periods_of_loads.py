"""The period of a load is the shortest one of its formula, not that of the sines and cosines it is
made of."""

from __future__ import annotations

import math

import pytest

from stickslip import Contact, Inertial, Parameter, System, catalogue
from stickslip.errors import DeclarationError
from stickslip.motion.problem import pose
from stickslip.orbits.branches.cycle_branch import continue_cycle
from stickslip.orbits.cycles.find_cycle import find_cycle
from stickslip.orbits.fields.clock import clock
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.return_map.following import follow_freely
from stickslip.orbits.return_map.recurrence import window


def loaded(load: str, threshold: str = "mu") -> System:
    return System(
        name="loaded",
        parameters={
            name: Parameter(value)
            for name, value in {"omega": 1.3, "mu": 0.1, "F": 0.8, "G": 0.3}.items()
        },
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential=f"x**2/2 - ({load})*x",
        viscous="0.1*d_x**2",
        contacts={"ground": Contact("d_x", threshold)},
    )


@pytest.mark.parametrize(
    ("load", "threshold", "periods"),
    [
        ("F*cos(omega*t)", "mu", 1.0),
        ("F*cos(omega*t)**2", "mu", 0.5),
        ("F*abs(sin(omega*t))", "mu", 0.5),
        ("F*sin(omega*t)*cos(omega*t + 0.3)", "mu", 0.5),
        ("F*exp(-(sin(omega*t)/0.3)**2)", "mu", 0.5),
        ("F*(sin(omega*t)**4 + cos(omega*t)**4)", "mu", 0.25),
        ("F*abs(sin(omega*t) + cos(2*omega*t)**2)", "mu", 1.0),
        ("F*sin(omega*t)*cos(3*omega*t)", "mu", 0.5),
        ("F*cos(omega*t)**2", "mu*(1.5 + cos(omega*t))", 1.0),
        ("F*cos(omega*t)**2 + G*cos(omega*t/3)", "mu", 3.0),
        ("F*cos(sin(omega*t))", "mu", 0.5),
        ("F*sin(sin(omega*t))", "mu", 1.0),
        ("F*cos(omega*t)**2", "mu*abs(cos(-omega*t))", 0.5),
        ("F*triangle(omega*t)", "mu", 1.0),
        ("F*triangle(omega*t)**2", "mu", 0.5),
        ("F*abs(triangle(omega*t))", "mu", 0.5),
        ("F*square(omega*t)", "mu*(1 + mod(omega*t, pi))", 1.0),
        ("F*sawtooth(2*omega*t)", "mu", 0.5),
        ("F*mod(omega*t, 2*pi)", "mu", 1.0),
        ("F*mod(omega*t + 1, 4*pi)", "mu", 2.0),
        ("F*floor(3*mod(omega*t/(2*pi), 1))", "mu", 1.0),
        ("F*sin(1.7*mod(omega*t, 2*pi))", "mu", 1.0),
        ("F*smoothstep(sin(omega*t), 0, 0.5)", "mu", 1.0),
    ],
)
def test_shortest_period(load: str, threshold: str, periods: float) -> None:
    system = loaded(load, threshold)
    cycle = find_cycle(system)
    assert cycle.certificate.ok, cycle.certificate.describe()
    assert cycle.period == pytest.approx(periods * 2 * math.pi / 1.3, rel=1e-13)


def test_a_staircase_is_a_drift_and_a_wave() -> None:
    """Each step of the load moves the cycle by F, and F alone."""
    cycle = find_cycle(loaded("F*floor(omega*t/(2*pi))"))
    assert cycle.certificate.ok, cycle.certificate.describe()
    assert cycle.period == pytest.approx(2 * math.pi / 1.3, rel=1e-13)
    x = cycle.trajectory.knots.state[:, 0]
    assert x[-1] - x[0] == pytest.approx(0.8, rel=1e-10)


def test_period_over_a_parameter() -> None:
    """The derivative by a parameter of the frequency is that of the shorter period."""
    system = loaded("F*cos(omega**2*t)**2")
    problem = pose(system, {})
    found = clock(system, problem.compiled.equations, problem.parameters)
    values = problem.parameters
    h = 1e-6
    numeric = (
        found.period({**values, "omega": 1.3 + h}) - found.period({**values, "omega": 1.3 - h})
    ) / (2 * h)
    assert found.period(values) == pytest.approx(math.pi / 1.69, rel=1e-14)
    assert found.slope(values, "omega") == pytest.approx(numeric, rel=1e-9)


TWO = "F*cos(omega*t) + G*cos(omega*t/3)"
THREE = 3 * 2 * math.pi / 1.3


def test_drives_that_are_off() -> None:
    """A drive of amplitude 0 has no period; where it acts, cycles have its period, too."""
    system = loaded(TWO)
    off = find_cycle(system, parameters={"G": 0.0})
    assert off.period == pytest.approx(THREE / 3, rel=1e-13)
    assert off.certificate.ok
    on = find_cycle(system, off, parameters={"G": 0.01})
    assert on.period == pytest.approx(THREE, rel=1e-13)
    assert on.certificate.ok, on.certificate.describe()
    again = find_cycle(system, on, parameters={"G": 0.0})
    assert again.period == pytest.approx(THREE / 3, rel=1e-13)
    assert again.extrema["x"] == pytest.approx(off.extrema["x"], rel=1e-9)
    # Other parameters that are 0 do not matter.
    free = find_cycle(system, parameters={"G": 0.0, "mu": 0.0})
    assert free.closed.shooting.setting.clock is not None
    assert free.closed.shooting.setting.clock.zero == {"G"}


def test_a_branch_over_the_amplitude_of_a_drive_that_is_off() -> None:
    system = loaded(TWO)
    found = continue_cycle(find_cycle(system, parameters={"G": 0.0}), "G", (0.0, 0.1))
    assert "the drives have a different period" in found.ended
    whole = continue_cycle(find_cycle(system, parameters={"G": 0.05}), "G", (0.04, 0.06))
    assert whole.certificate.ok
    assert whole.points["period"].values == pytest.approx(THREE, rel=1e-13)


def test_drives_without_a_common_period() -> None:
    """Only those that act need one."""
    system = loaded("F*cos(omega*t) + G*cos(1.2345*t)")
    with pytest.raises(DeclarationError, match="no common period"):
        find_cycle(system)
    cycle = find_cycle(system, parameters={"G": 0.0})
    assert cycle.period == pytest.approx(THREE / 3, rel=1e-13)


def test_time_is_noticed_at_any_phase() -> None:
    """A motion whose every step begins where the load does not change is driven all the same."""
    problem = pose(catalogue.forced_oscillator(F_c=0.2, omega=0.5), {})
    motion = follow_freely(problem, 0.0, 100.0, problem.initial_state({"x": 1.3333}))
    assert abs(math.sin(0.5 * motion.knots.time[3])) < 1e-12
    assert window(motion, Pieces(problem.compiled.equations)).symmetry.driven
