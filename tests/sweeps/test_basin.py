"""Basins: every label against the motion itself, symmetries, driven and autonomous systems, honest
remains."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import xarray as xr

from orbits.examples import SLIDER, dragged, duffing
from stickslip import (
    Contact,
    Inertial,
    Parameter,
    RateIndependent,
    Settings,
    System,
    catalogue,
    simulate,
)
from stickslip.errors import DeclarationError
from stickslip.motion.outcome import Outcome
from stickslip.orbits.branches.equilibrium_branch import continue_equilibrium
from stickslip.orbits.cycles.find_cycle import find_cycle
from stickslip.stopping.scopes import Stopped, scope, watching
from stickslip.sweeps import basin as module
from stickslip.sweeps import sweep as sweep_module
from stickslip.sweeps.basin import basin
from stickslip.sweeps.request import axes as axes_module
from stickslip.sweeps.work import scheduler
from stickslip.sweeps.work.job import Work
from systems import ode


@cache
def toy_map() -> xr.Dataset:
    return basin(
        catalogue.rocking_toy(),
        {"psi": "-1.0:1.0:15", "d_psi": "-0.9:0.9:13"},
        initial={"x_R": 0.0},
    ).dataset


def test_toy_rests_or_walks() -> None:
    found = toy_map()
    assert found["attractor"].dims == ("psi", "d_psi")
    assert found["kind"].values.tolist() == ["walking", "rest"]
    assert found["certified"].all()
    assert found["speed"].values == pytest.approx([0.1675328, 0.0], abs=1e-6)
    assert found["period"].values == pytest.approx([5.9689804, 0.0], abs=1e-6)
    assert float(found["share"].sum()) == 1.0
    assert (found["low_psi"].values[0], found["high_psi"].values[0]) == pytest.approx(
        (-1.6235734, 1.6235734), abs=1e-6
    )
    # Rest is around the upright position, walking all around it.
    names = found["reached"].values[found["attractor"].values]
    assert names[7, 6] == "rest"
    assert set(names[[0, -1]].ravel()) == {"walking"}


def test_labels_are_what_motions_do() -> None:
    found = toy_map()
    rng = np.random.default_rng(3)
    for _ in range(8):
        i, j = int(rng.integers(15)), int(rng.integers(13))
        start = {"psi": float(found["psi"][i]), "d_psi": float(found["d_psi"][j]), "x_R": 0.0}
        try:
            motion = simulate(catalogue.rocking_toy(), (0.0, 1500.0), initial=start)
        except DeclarationError:
            # friction cannot hold d = 0 there: the map starts at the nearest d that it can hold
            continue
        walks = motion.outcome is not Outcome.AT_REST
        assert bool(found["attractor"][i, j] == 0) is walks


def test_mirror_and_translation() -> None:
    """ψ → −ψ with the legs exchanged, and a shift of both legs, change nothing."""
    found = toy_map()["attractor"].values
    assert np.array_equal(found, found[::-1, ::-1])
    axes = {"psi": toy_map()["psi"].values[::3], "d_psi": toy_map()["d_psi"].values[::3]}
    shifted = basin(
        catalogue.rocking_toy(), axes, initial={"x_R": 7.25, "x_L": 7.25}, workers=1
    ).dataset
    assert np.array_equal(shifted["attractor"].values, found[::3, ::3])


def test_unstable_cycle_is_the_boundary() -> None:
    """The spring slider below its fold: steady sliding inside the unstable cycle, stick-slip
    outside."""
    values = {"V": 0.2255}
    point = continue_equilibrium(SLIDER, "V", (0.2, 0.25)).of_kind("Hopf")[0]
    barrier = find_cycle(SLIDER, point, parameters=values)
    t = np.linspace(barrier.time, barrier.time + barrier.period, 2)[:-1]
    states = barrier.trajectory.at(np.minimum(t, barrier.trajectory.knots.time[-1]))
    middle = np.array([point.state["U"], point.state["alpha"]])
    for factor, kind in ((0.6, "sliding"), (1.4, "cycle")):
        for U, alpha in zip(states["U"], states["alpha"], strict=True):
            start = middle + factor * (np.array([U, alpha]) - middle)
            axes = {
                "U": start[0] + np.array([0.0, 1e-6]),
                "alpha": start[1] + np.array([0.0, 1e-6]),
            }
            found = basin(SLIDER, axes, parameters=values).dataset
            assert found["kind"].values.tolist() == [kind]


def test_two_wells_of_a_driven_oscillator() -> None:
    found = basin(duffing(), {"x": "-1.3:1.3:6", "v": "-0.1:0.1:2"}, parameters={"F": 0.05}).dataset
    assert found["kind"].values.tolist() == ["cycle", "cycle"]
    assert found["period"].values == pytest.approx(2 * np.pi / 1.2, rel=1e-12)
    left, right = found["attractor"].values[0, 0], found["attractor"].values[-1, 0]
    assert left != right
    assert found["high_x"].values[left] < 0.0 < found["low_x"].values[right]


def test_moving_frame() -> None:
    """A block that a spring drags over the ground: stick-slip, or for ever an undamped oscillation
    about sliding.

    Its radius about the stretch F_k/k = 0.6 and the speed V = 0.3 has to stay below V for it never
    to stick.
    """
    found = basin(dragged(), {"x": "-0.5:0.5:3", "d_x": "0.0:0.5:2"}).dataset
    assert found["kind"].values.tolist() == ["walking"]
    assert found["speed"].values == pytest.approx([0.3])
    x, v = np.meshgrid(found["x"].values, found["d_x"].values, indexing="ij")
    never_sticks = np.hypot(-x - 0.6, v - 0.3) < 0.3
    assert np.sum(never_sticks) == 1
    assert np.array_equal(found["attractor"].values, np.where(never_sticks, module.UNDAMPED, 0))


def test_moving_and_shaking_load() -> None:
    """A period of the shaking later the system is the same, V T further on: every motion arrives on
    one gait."""
    values = {"A": 0.5, "F_s": 0.4, "F_k": 0.4, "V": 0.1}
    found = basin(dragged(), {"x": "-0.3:0.3:3", "d_x": "0.0:0.3:2"}, parameters=values).dataset
    assert found["kind"].values.tolist() == ["walking"]
    assert found["speed"].values == pytest.approx([0.1])
    assert np.all(found["attractor"].values == 0)


def test_motions_that_stop_or_do_not_arrive() -> None:
    blows_up = ode("blow up", x="x**2 - 1")
    found = basin(blows_up, {"x": "-2.0:2.0:5"}).dataset
    assert found["kind"].values.tolist() == ["rest", "rest"]
    assert found["stability"].values.tolist() == ["stable", "unstable"]
    assert found["attractor"].values.tolist() == [0, 0, 0, 1, -1]
    assert found["state_x"].values == pytest.approx([-1.0, 1.0])


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        ({"phi": "0.0:1.0:3"}, "unknown parameter or part of the state"),
        ({"P": "0.8:1.0:3"}, "not a state"),
        ({"psi": (-1.0, 1.0, 3)}, "is ambiguous: a range or three values"),
        ({"psi": [1.0, 0.0]}, "do not increase"),
        ({"psi": [0.5]}, "do not increase"),
        ({"psi": "abc"}, "abc"),
        ({}, "no axis was given"),
    ],
)
def test_bad_arguments(axes: dict, message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        basin(catalogue.rocking_toy(), axes)


def test_parameters_are_checked() -> None:
    system: System = catalogue.rocking_toy()
    with pytest.raises(DeclarationError, match="Q"):
        basin(system, {"psi": "0.0:1.0:2"}, parameters={"Q": 1.0})


def pendulum(**changes: str) -> System:
    """A pendulum with friction in its hinge."""
    declared = {"kinetic": "d_x**2/2", "potential": "-cos(x)", "span": (0, 20)}
    return System(
        name="pendulum",
        coordinates={"x": Inertial()},
        contacts={"hinge": Contact("d_x", 0.3)},
        **{**declared, **changes},
    )


def test_rest_is_proved_where_forces_are_not_affine_or_driven() -> None:
    driven = basin(
        catalogue.forced_oscillator(F_c=0.5, P=0.3), {"x": "-1.0:1.0:3", "d_x": "-1.0:1.0:2"}
    ).dataset
    for found in (basin(pendulum(), {"x": "-2.0:2.0:4", "d_x": "-1.0:1.0:3"}).dataset, driven):
        assert found["kind"].values.tolist() == ["rest"]
        assert np.all(found["attractor"].values == 0) and np.all(found["lacking"].values == 0)


def test_rest_under_a_load_that_does_not_repeat_is_not_said() -> None:
    """The hinge holds the pendulum for 1000 units of time; then a gust comes, which no look at the
    forces can know."""
    gust = pendulum(potential="-cos(x) - 2*exp(-((t - 5000)/3)**2)*x")
    found = basin(
        gust, {"x": "-0.2:0.2:2", "d_x": "-0.1:0.1:2"}, settings=Settings(max_time=400.0)
    ).dataset
    assert np.all(found["attractor"].values == module.ON_ITS_WAY)


def jenkins(**values: float) -> System:
    """A mass on a spring with viscous friction and, in parallel, a spring in series with a dry
    damper."""
    given = {"c": 0.02, "k": 1.0, "k_d": 0.5, "F_c": 1.0, "F": 0.3, "omega": 0.9, **values}
    return System(
        name="jenkins",
        parameters={name: Parameter(value) for name, value in given.items()},
        coordinates={"x": Inertial(), "z": RateIndependent()},
        kinetic="d_x**2/2",
        potential="k*x**2/2 + k_d*(x - z)**2/2 - push*x",
        viscous="c*d_x**2/2",
        drives={"push": "F*cos(omega*t)"},
        contacts={"damper": Contact("d_z", threshold="F_c")},
        span=(0, 100),
    )


def test_an_oscillation_whose_damper_sticks_is_no_rest() -> None:
    """Wherever the damper sticks, the mass swings with the amplitude of the linear oscillator."""
    system = jenkins()
    found = basin(system, {"x": "-3.0:3.0:5", "d_x": "-1.0:1.0:4"}, initial={"z": 0.0}).dataset
    assert found["kind"].values.tolist() == ["oscillation"]
    assert found["family"].values.all() and found["certified"].values.all()
    assert np.all(found["attractor"].values == 0) and np.all(found["lacking"].values == 0)
    assert found["period"].values == pytest.approx(2.0 * np.pi / 0.9, rel=1e-12)
    width = 2.0 * 0.3 / abs(1.5 - 0.9**2 + 0.02j * 0.9)
    assert found["high_x"].values - found["low_x"].values == pytest.approx(width, rel=1e-9)


def test_interruption_keeps_what_has_arrived(monkeypatch: pytest.MonkeyPatch) -> None:
    computed = sweep_module.compute

    def once(work: Work, columns: dict[str, np.ndarray], runs: None = None) -> object:
        if columns["psi"][0] > 0.0 or columns["d_psi"][0] > 0.0:
            raise Stopped
        scope().interrupt[0] = 1
        with watching(interrupt=np.zeros(1, np.int64)):
            return computed(work, columns)  # what is under way when Ctrl-C comes may still end

    monkeypatch.setattr(sweep_module, "compute", once)
    monkeypatch.setattr(scheduler, "_PULSE", 60.0)  # however busy the machine is
    monkeypatch.setattr(axes_module, "FEWEST", 4)
    axes = {"psi": "0.0:2.0:3", "d_psi": "0.0:0.1:4"}
    found = basin(catalogue.rocking_toy(), axes, initial={"x_R": 0.0}, workers=1).dataset
    assert found.attrs["interrupted"] == 1
    arrived = found["attractor"].values != module._NOT_COMPUTED
    assert np.array_equal(np.argwhere(arrived), [[0, 0], [0, 1], [1, 0], [1, 1]])
    assert np.all(found["attractor"].values[arrived] >= 0)
    assert np.all(found["lacking"].values[~arrived] > 0)


def test_interrupted_before_anything_has_arrived(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*given: object) -> None:
        raise Stopped

    monkeypatch.setattr(sweep_module, "compute", interrupted)
    found = basin(catalogue.rocking_toy(), {"psi": "-1.0:1.0:3", "d_psi": "-1.0:1.0:2"}).dataset
    assert found.sizes["reached"] == 0
    assert (found["attractor"] == module._NOT_COMPUTED).all()
