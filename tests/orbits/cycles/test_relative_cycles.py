"""Cycles up to a shift that comes in steps: tips that are pulled over lattices, pendulums that go
around; against closed forms and an independent integrator."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from oracles import prandtl_tomlinson as oracle
from orbits.cycles.test_finding import check
from stickslip import (
    Contact,
    Cycle,
    Inertial,
    System,
    Viscous,
    catalogue,
    continue_cycle,
    find_cycle,
    sweep,
)
from stickslip.equations.derive import derive
from stickslip.errors import ConvergenceError, DeclarationError
from stickslip.orbits.branches.chart import extent_of
from stickslip.orbits.fields.clock import cells_of, clock
from systems import parameters

TIP = catalogue.prandtl_tomlinson()
LATTICE = {"k": 1.0, "V_0": 0.05, "a": 0.5}
FORCE = "k*(X - x)"


def heavy(potential: str = "- V_0*cos(2*pi*x/a)", **values: float) -> System:
    """A tip with a mass."""
    numbers = {"m": 1e-3, "k": 1.0, "V_0": 0.05, "a": 0.5, "nu": 0.01, "V": 1.0, "b": 0.75}
    return System(
        "heavy tip",
        parameters=parameters(**{**numbers, **values}),
        drives={"X": "V*t"},
        coordinates={"x": Inertial()},
        kinetic="m/2*d_x**2",
        potential=f"k/2*(x - X)**2 {potential}",
        viscous="nu/2*d_x**2",
        span=(0, 4),
    )


def pendulum(**values: float) -> System:
    """γ x' + sin x = F + A sin ωt, with a mass or without."""
    return System(
        "pendulum",
        parameters=parameters(**{"gamma": 1.0, "F": 1.5, "A": 0.0, "omega": 1.0, **values}),
        coordinates={"x": Viscous()},
        potential="-cos(x) - (F + A*sin(omega*t))*x",
        viscous="gamma/2*d_x**2",
        span=(0, 20),
    )


def certified(cycle: Cycle) -> Cycle:
    check(cycle)
    assert cycle.certificate.ok, cycle.certificate.verdict
    return cycle


# -- a tip without mass ----------------------------------------------------------------------------


def test_slow_tip_has_the_friction_of_its_jumps() -> None:
    """The mean force comes to what is lost in a jump, and exceeds it by V^(2/3)."""
    slow = oracle.friction(**LATTICE)
    supports = np.linspace(10.0, 10.5, 4001)
    x = oracle.quasistatic(supports, **LATTICE)
    assert slow == pytest.approx(np.mean(supports[1:] - x[1:]), rel=1e-3)
    speeds = [1e-2, 3e-3, 1e-3]
    excess = []
    for V in speeds:
        cycle = certified(find_cycle(TIP, parameters={"V": V}))
        assert cycle.period == pytest.approx(0.5 / V, rel=1e-14)
        assert cycle.drift == pytest.approx(0.5, rel=1e-13)
        assert cycle.speed == pytest.approx(V, rel=1e-13)
        assert cycle.stable
        assert cycle.trivial == 0
        force = cycle.mean(FORCE)
        # In a period the energy comes back: what the pull gives is dissipated.
        assert cycle.energy_per_distance == pytest.approx(force, rel=1e-9)
        excess.append(force - slow)
    assert 0.0 < excess[2] < 1e-3 * slow
    orders = np.diff(np.log(excess)) / np.diff(np.log(speeds))
    assert orders == pytest.approx(2 / 3, abs=0.03)


@pytest.mark.parametrize("V", [300.0, 3000.0])
def test_fast_tip(V: float) -> None:
    cycle = certified(find_cycle(TIP, parameters={"V": V}))
    expected = oracle.friction_when_fast(**LATTICE, nu=0.01, V=V)
    lattice = expected - 0.01 * V
    # To second order in the answer of the tip, which is small in the distance of the valleys.
    answer = (2 * math.pi / 0.5) ** 2 * 0.05 / (2 * math.pi * V / 0.5 * 0.01)
    assert cycle.mean(FORCE) - 0.01 * V == pytest.approx(lattice, rel=3 * answer**2)


def test_tip_that_is_pulled_back() -> None:
    forth, back = (find_cycle(TIP, parameters={"V": V}) for V in (1.0, -1.0))
    assert back.drift == pytest.approx(-forth.drift, rel=1e-13)
    assert back.mean(FORCE) == pytest.approx(-forth.mean(FORCE), rel=1e-10)


def test_tip_that_follows_without_jumps() -> None:
    """Where the lattice vanishes the tip slides steadily, which is said; where it is flat, it goes
    along with it."""
    certified(find_cycle(TIP, parameters={"V_0": 1e-3}))
    with pytest.raises(ConvergenceError, match="translates uniformly, x at speed 1, from"):
        find_cycle(TIP, parameters={"V_0": 0.0})


def test_wiggly_energy_is_dry_friction() -> None:
    """The friction of wells as small as ε comes to ρ (Mielke 2012): that of a lattice of distance
    2πε."""
    found = []
    for epsilon in (0.1, 0.03, 0.01):
        system = catalogue.wiggly_energy(ell="1e-3*t", epsilon=epsilon, rho=0.8)
        cycle = certified(find_cycle(system))
        assert cycle.drift == pytest.approx(2 * math.pi * epsilon, rel=1e-12)
        slow = oracle.friction(1.0, 0.8 * epsilon, 2 * math.pi * epsilon)
        found.append(cycle.mean("ell - z"))
        assert found[-1] == pytest.approx(slow, rel=2e-2)
    assert found == sorted(found)
    assert found[-1] == pytest.approx(0.8, rel=0.05)


# -- tips with mass --------------------------------------------------------------------------------


def sine(x: float, depth: float, a: float) -> float:
    """Slope of −depth cos(2πx/a)."""
    return 2 * math.pi / a * depth * math.sin(2 * math.pi * x / a)


@pytest.mark.parametrize(
    "system, steps, slope",
    [
        (heavy(V=3.0), 3, lambda x: sine(x, 0.05, 0.5)),
        (heavy(V=2.0, nu=0.003), 2, lambda x: sine(x, 0.05, 0.5)),
        (
            heavy("- V_0*cos(2*pi*x/a) - V_0*cos(2*pi*x/b)"),
            3,
            lambda x: sine(x, 0.05, 0.5) + sine(x, 0.05, 0.75),
        ),
        (heavy("+ V_0*sin(pi*x/a)**2", V=3.0), 2, lambda x: sine(x, 0.025, 0.5)),
    ],
    ids=["three valleys", "two valleys", "two lattices", "square of a sine"],
)
def test_against_an_independent_integrator(
    system: System, steps: int, slope: Callable[[float], float]
) -> None:
    """Return and multipliers, by DOP853 and differences of it."""
    cycle = certified(find_cycle(system))
    p = system.values
    assert cycle.drift == pytest.approx(steps * p["a"], rel=1e-12)
    assert cycle.period == pytest.approx(steps * p["a"] / p["V"], rel=1e-13)

    def rates(t: float, y: Any) -> list[float]:
        force = -slope(y[0]) - p["k"] * (y[0] - p["V"] * t) - p["nu"] * y[1]
        return [y[1], force / p["m"]]

    def follow(y: Any) -> Any:
        times = cycle.time, cycle.time + cycle.period
        return solve_ivp(rates, times, y, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]

    y = np.array(list(cycle.state.values()))
    assert follow(y) - [cycle.drift, 0.0] == pytest.approx(y, abs=1e-8)
    sizes = np.array([1e-7, 3e-6])
    M = np.column_stack([(follow(y + d) - follow(y - d)) / 2.0 for d in np.diag(sizes)]) / sizes
    found = np.sort_complex(np.linalg.eigvals(M))
    assert found == pytest.approx(np.sort_complex(cycle.multipliers), abs=1e-4)


def test_chain_over_a_lattice() -> None:
    """Two tips with a spring between them, of which one is pulled: both are shifted."""
    pair = System(
        "pair",
        parameters=parameters(k=1.0, c=2.0, V=0.3),
        coordinates={"x": Viscous(), "y": Viscous()},
        potential="k/2*(x - V*t)**2 + c/2*(x - y - 1)**2 - cos(2*pi*x) - cos(2*pi*y)",
        viscous="0.1*(d_x**2 + d_y**2)",
        span=(0, 10),
    )
    cycle = certified(find_cycle(pair))
    assert cycle.direction == pytest.approx({"x": 1.0, "y": 1.0})
    assert cycle.drift % 1.0 == pytest.approx(0.0, abs=1e-12)
    assert cycle.mean("k*(V*t - x)") == pytest.approx(cycle.energy_per_distance, rel=1e-8)


def test_tip_with_dry_friction() -> None:
    """A tip without mass only slides on: of what it is pulled with, the contact takes its share."""
    tip = System(
        "rough tip",
        parameters=parameters(k=1.0, V=0.01, F=0.1),
        coordinates={"x": Viscous()},
        potential="k/2*(x - V*t)**2 - 0.05*cos(4*pi*x)",
        viscous="0.005*d_x**2",
        contacts={"base": Contact("d_x", "F")},
        span=(0, 200),
    )
    cycle = certified(find_cycle(tip))
    assert cycle.drift == pytest.approx(0.5, rel=1e-12)
    assert cycle.mean("k*(V*t - x)") == pytest.approx(cycle.energy_per_distance, rel=1e-9)
    assert cycle.contacts["base"].dissipated == pytest.approx(0.1 * 0.5, rel=1e-9)


# -- cells, with a period that nobody knows --------------------------------------------------------


@pytest.mark.parametrize("F", [1.1, 1.5, -3.0])
def test_pendulum_that_goes_around(F: float) -> None:
    """T = 2πγ/√(F² − 1)."""
    cycle = certified(find_cycle(pendulum(F=F, gamma=0.7)))
    assert cycle.period == pytest.approx(2 * math.pi * 0.7 / math.sqrt(F**2 - 1), rel=1e-11)
    assert cycle.drift == pytest.approx(math.copysign(2 * math.pi, F), rel=1e-13)
    assert cycle.trivial == 1
    assert len(cycle.nontrivial) == 0
    assert cycle.mean("d_x") == pytest.approx(cycle.speed, rel=1e-10)


def test_pendulum_with_mass() -> None:
    system = System(
        "heavy pendulum",
        parameters=parameters(c=0.2, F=0.7),
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="-cos(x) - F*x",
        viscous="c/2*d_x**2",
        initial={"d_x": 3.0},
        span=(0, 20),
    )
    cycle = certified(find_cycle(system))
    assert cycle.drift == pytest.approx(2 * math.pi, rel=1e-12)
    # Liouville: volume shrinks by exp(−cT).
    assert cycle.nontrivial == pytest.approx([math.exp(-0.2 * cycle.period)], rel=1e-8)
    # What the torque gives in a turn is dissipated.
    assert cycle.dissipated == pytest.approx(0.7 * 2 * math.pi, rel=1e-9)

    def rates(t: float, y: Any) -> list[float]:
        return [y[1], 0.7 - math.sin(y[0]) - 0.2 * y[1]]

    y = list(cycle.state.values())
    end = solve_ivp(rates, (0.0, cycle.period), y, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    assert end - [2 * math.pi, 0.0] == pytest.approx(y, abs=1e-9)
    branch = continue_cycle(cycle, "F", (0.5, 1.5))
    assert branch.certificate.ok
    assert np.allclose(branch.points.drift, 2 * math.pi)


def test_steps_of_a_driven_pendulum() -> None:
    """Phase locking (Shapiro steps): its mean speed is that of the drive, a turn for a period."""
    cycle = certified(find_cycle(pendulum(F=1.2, A=1.0, omega=1.0)))
    assert cycle.period == pytest.approx(2 * math.pi, rel=1e-13)
    assert cycle.drift == pytest.approx(2 * math.pi, rel=1e-12)
    assert cycle.trivial == 0
    assert 0.0 < abs(cycle.multipliers[0]) < 1.0


def test_what_swings_goes_around_no_cell() -> None:
    cycle = certified(find_cycle(pendulum(F=0.2, A=0.5)))
    assert cycle.drift == 0.0
    assert cycle.closed.shooting.setting.cells.size == 0


@pytest.mark.parametrize(
    "potential, expected",
    [
        ("-cos(x) - cos(y)", [[2 * math.pi, 0.0], [0.0, 2 * math.pi]]),
        ("-cos(x) + (x - y)**2", [[2 * math.pi, 2 * math.pi]]),
        ("-cos(x) - cos(x/2 - y)", [[2 * math.pi, math.pi], [0.0, 2 * math.pi]]),
        ("-cos(x)*cos(3*x) + y**2", [[2 * math.pi, 0.0]]),
        ("-cos(x) - cos(sqrt(2)*x) + y**2", []),
        ("-cos(x) + x**4 + y**2", []),
        ("x**2 + y**2", []),
    ],
)
def test_cells(potential: str, expected: list[list[float]]) -> None:
    """What leaves forces unchanged: checked on them, too."""
    system = System(
        "cells",
        coordinates={"x": Viscous(), "y": Viscous()},
        potential=potential,
        viscous="(d_x**2 + d_y**2)/2",
    )
    equations = derive(system.declaration)
    cells = cells_of(equations, {})
    lattice = np.array(expected).reshape(-1, 2).T
    assert cells.shape == lattice.shape
    if cells.size:
        # The same lattice: each is made of the others by whole numbers.
        for one, other in ((cells, lattice), (lattice, cells)):
            parts = np.linalg.lstsq(one, other, rcond=None)[0]
            assert one @ parts == pytest.approx(other, abs=1e-9)
            assert parts == pytest.approx(np.rint(parts), abs=1e-9)


# -- branches, files, refusals ---------------------------------------------------------------------


def test_branch_over_speed() -> None:
    branch = continue_cycle(find_cycle(TIP), "V", (0.01, 10.0))
    assert branch.certificate.ok
    points = branch.points
    assert np.allclose(points.period * points.V, 0.5, rtol=1e-12)
    assert np.allclose(points.drift, 0.5, rtol=1e-12)
    friction = points.energy_per_distance
    assert friction.attrs["units"] == "aJ/nm"
    assert np.all(np.diff(friction.values[np.argsort(points.V.values)]) > 0.0)
    alone = find_cycle(TIP, parameters={"V": float(points.V[3])})
    assert float(friction[3]) == pytest.approx(alone.mean(FORCE), rel=1e-9)


def test_branch_over_the_lattice() -> None:
    """The distance of the valleys changes period and shift."""
    branch = continue_cycle(find_cycle(TIP), "a", (0.4, 0.7))
    assert branch.certificate.ok
    turns = branch.points.drift / branch.points.a
    assert np.allclose(turns, np.rint(turns), rtol=1e-12)
    assert np.allclose(branch.points.period, turns * branch.points.a, rtol=1e-12)


def test_branch_ends_where_the_lattice_does() -> None:
    """In proportion to its depth the cycle shrinks to steady sliding: no Hopf point."""
    cycle = find_cycle(TIP, parameters={"V_0": 0.01})
    branch = continue_cycle(cycle, "V_0", (0.0, 0.02))
    assert not branch.special
    assert "shrinks to a steady motion, at about V_0 = 0;" in branch.ended


def test_longest_period_of_a_branch() -> None:
    """A period that grows with 1/V grows within bounds: up to that at the end of the range."""
    closed = find_cycle(TIP).closed
    assert extent_of(closed, "V", (1e-5, 2.0)).period == pytest.approx(0.5e5, rel=1e-12)
    assert extent_of(closed, "V", (0.0, 2.0)).period == pytest.approx(0.5, rel=1e-12)


def test_slope_of_the_period() -> None:
    """The frame of a chain moves at V, whatever else; of a tip on two springs at what they agree
    on."""
    system = System(
        "two springs",
        parameters=parameters(k=1.0, c=3.0, V=1.0, W=2.0, a=0.5),
        coordinates={"x": Viscous(), "y": Viscous()},
        potential="k/2*(x - V*t)**2 + c/2*(x - y - W*t)**2 + cos(2*pi*x/a)",
        viscous="d_x**2 + d_y**2",
    )
    equations = derive(system.declaration)
    values = system.values
    ticking = clock(system, equations, values)
    assert ticking.period(values) == pytest.approx(0.5, rel=1e-14)
    assert ticking.drives(values).velocity == pytest.approx([1.0, -1.0], rel=1e-12)
    for name in values:
        ends = [ticking.period({**values, name: values[name] + h}) for h in (-1e-6, 1e-6)]
        change = (ends[1] - ends[0]) / 2e-6
        assert ticking.slope(values, name) == pytest.approx(change, abs=1e-8)


def test_stored(tmp_path) -> None:
    cycle = find_cycle(TIP)
    cycle.save(tmp_path / "cycle.nc")
    back = Cycle.open(tmp_path / "cycle.nc")
    assert back.drift == cycle.drift
    assert back.mean(FORCE) == pytest.approx(cycle.mean(FORCE), rel=1e-12)
    assert back.certificate == cycle.certificate


def test_means() -> None:
    cycle = find_cycle(TIP)
    assert cycle.mean("3") == pytest.approx(3.0, rel=1e-14)
    assert cycle.mean("V*t - X") == pytest.approx(0.0, abs=1e-14)
    with pytest.raises(DeclarationError, match="banana"):
        cycle.mean("banana")
    with pytest.raises(DeclarationError, match="'speed' is not allowed here"):
        cycle.mean("speed")
    with pytest.raises(DeclarationError, match="undefined on the cycle"):
        cycle.mean("log(x - 100)")


def test_mean_friction_of_a_contact() -> None:
    """On a belt it is that of the spring, on the average."""
    cycle = find_cycle(catalogue.belt_block())
    assert cycle.mean("friction_belt_contact") == pytest.approx(cycle.mean("k*x"), rel=1e-9)


def test_refusals_say_why() -> None:
    with pytest.raises(
        DeclarationError, match="no uniform translation of the state compensates for time in"
    ):
        find_cycle(heavy("- V_0*cos(2*pi*x/a) + x**4"))
    with pytest.raises(
        DeclarationError,
        match=r"no uniform translation of the state compensates for time in t\*\*2",
    ):
        find_cycle(catalogue.wiggly_energy())
    with pytest.raises(DeclarationError, match="no common period"):
        find_cycle(heavy("- V_0*cos(2*pi*x/a) - V_0*cos(2*pi*x/b)", b=0.5 * math.sqrt(2)))


# -- maps ------------------------------------------------------------------------------------------


def test_map_over_speed_and_depth() -> None:
    """Periods are those of the lattice, however slow; without valleys, or without a pull, it is
    steady."""
    over = {"V": [-1.0, 0.0, 1e-3, 10.0], "V_0": [0.0, 0.05]}
    found = sweep(TIP, over, measure=["period", "shift:x"])
    assert found.certificate.ok
    periods = found.dataset.period.values
    assert np.all(np.isnan(periods[:, 0]))
    assert np.isnan(periods[1, 1])
    assert periods[[0, 2, 3], 1] == pytest.approx([0.5, 500.0, 0.05], rel=1e-12)
    shifts = found.dataset["shift:x"].values
    assert shifts[[0, 2, 3], 1] == pytest.approx([-0.5, 0.5, 0.5], rel=1e-9)


def test_map_of_pendulums() -> None:
    """At rest below F = 1, around with the period 2πγ/√(F² − 1) above."""
    torques = [-2.0, 0.5, 1.5, 3.0]
    found = sweep(pendulum(), {"F": torques}, measure=["period", "shift:x"])
    assert found.certificate.ok
    periods = found.dataset.period.values
    expected = [2 * math.pi / math.sqrt(F**2 - 1) if abs(F) > 1 else math.nan for F in torques]
    assert periods == pytest.approx(expected, rel=1e-8, nan_ok=True)
    assert found.dataset["shift:x"].values[[0, 2]] == pytest.approx([-2 * math.pi, 2 * math.pi])


def test_map_of_locked_pendulums() -> None:
    """As :func:`find_cycle` has them, each with its own cells."""
    system = pendulum(F=1.2, A=1.0)
    found = sweep(system, {"omega": [0.8, 1.0]}, measure=["period", "shift:x"])
    for i, omega in enumerate((0.8, 1.0)):
        cycle = find_cycle(system, parameters={"omega": omega})
        assert float(found.dataset.period[i]) == pytest.approx(cycle.period, rel=1e-9)
        assert float(found.dataset["shift:x"][i]) == pytest.approx(cycle.drift, rel=1e-9)
