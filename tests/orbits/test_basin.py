"""Basins: every label against the motion itself, symmetries, driven and autonomous systems, honest remains."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import xarray as xr

from orbits.examples import SLIDER, dragged, duffing
from stickslip import Contact, Inertial, System, catalogue, simulate
from stickslip.errors import DeclarationError
from stickslip.motion.outcome import Outcome
from stickslip.orbits import basin as module
from stickslip.orbits.basin import basin
from stickslip.orbits.cycles import find_cycle
from stickslip.orbits.equilibrium_branch import continue_equilibrium
from systems import ode


@cache
def toy_map() -> xr.Dataset:
    return basin(catalogue.rocking_toy(), {"psi": (-1.0, 1.0, 15), "d_psi": (-0.9, 0.9, 13)}, initial={"x_R": 0.0})


def test_toy_rests_or_walks() -> None:
    found = toy_map()
    assert found["attractor"].dims == ("psi", "d_psi")
    assert found["kind"].values.tolist() == ["walking", "rest"]
    assert found["certified"].all()
    assert found["speed"].values == pytest.approx([0.1675328, 0.0], abs=1e-6)
    assert found["period"].values == pytest.approx([5.9689804, 0.0], abs=1e-6)
    assert float(found["share"].sum()) == 1.0
    assert (found["low_psi"].values[0], found["high_psi"].values[0]) == pytest.approx((-1.6235734, 1.6235734), abs=1e-6)
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
            motion = simulate(catalogue.rocking_toy(), (0.0, 1500.0), start)
        except DeclarationError:
            continue  # friction cannot hold d = 0 there: the map starts at the nearest d that it can hold
        walks = motion.outcome is not Outcome.AT_REST
        assert bool(found["attractor"][i, j] == 0) is walks


def test_mirror_and_translation() -> None:
    """ψ → −ψ with the legs exchanged, and a shift of both legs, change nothing."""
    found = toy_map()["attractor"].values
    assert np.array_equal(found, found[::-1, ::-1])
    axes = {"psi": toy_map()["psi"].values[::3], "d_psi": toy_map()["d_psi"].values[::3]}
    shifted = basin(catalogue.rocking_toy(), axes, initial={"x_R": 7.25, "x_L": 7.25}, workers=1)
    assert np.array_equal(shifted["attractor"].values, found[::3, ::3])


def test_unstable_cycle_is_the_boundary() -> None:
    """The spring slider below its fold: steady sliding inside the unstable cycle, stick-slip outside."""
    values = {"V": 0.2255}
    point = continue_equilibrium(SLIDER, "V", (0.2, 0.25)).of_kind("Hopf")[0]
    barrier = find_cycle(SLIDER, point, values)
    t = np.linspace(barrier.time, barrier.time + barrier.period, 2)[:-1]
    states = barrier.trajectory.at(np.minimum(t, barrier.trajectory.knots.time[-1]))
    middle = np.array([point.state["U"], point.state["alpha"]])
    for factor, kind in ((0.6, "sliding"), (1.4, "cycle")):
        for U, alpha in zip(states["U"], states["alpha"], strict=True):
            start = middle + factor * (np.array([U, alpha]) - middle)
            axes = {"U": start[0] + np.array([0.0, 1e-6]), "alpha": start[1] + np.array([0.0, 1e-6])}
            found = basin(SLIDER, axes, values)
            assert found["kind"].values.tolist() == [kind]


def test_two_wells_of_a_driven_oscillator() -> None:
    found = basin(duffing(), {"x": (-1.3, 1.3, 6), "v": (-0.1, 0.1, 2)}, {"F": 0.05})
    assert found["kind"].values.tolist() == ["cycle", "cycle"]
    assert found["period"].values == pytest.approx(2 * np.pi / 1.2, rel=1e-12)
    left, right = found["attractor"].values[0, 0], found["attractor"].values[-1, 0]
    assert left != right
    assert found["high_x"].values[left] < 0.0 < found["low_x"].values[right]


def test_moving_frame() -> None:
    """A block that a spring drags over the ground: stick-slip, or for ever an undamped oscillation about sliding.

    Its radius about the stretch F_k/k = 0.6 and the speed V = 0.3 has to stay below V for it never to stick.
    """
    found = basin(dragged(), {"x": (-0.5, 0.5, 3), "d_x": (0.0, 0.5, 2)})
    assert found["kind"].values.tolist() == ["walking"]
    assert found["speed"].values == pytest.approx([0.3])
    x, v = np.meshgrid(found["x"].values, found["d_x"].values, indexing="ij")
    never_sticks = np.hypot(-x - 0.6, v - 0.3) < 0.3
    assert np.sum(never_sticks) == 1
    assert np.array_equal(found["attractor"].values, np.where(never_sticks, -2, 0))


def test_moving_and_shaking_load() -> None:
    """A period of the shaking later the system is the same, V T further on: every motion arrives on one gait."""
    values = {"A": 0.5, "F_s": 0.4, "F_k": 0.4, "V": 0.1}
    found = basin(dragged(), {"x": (-0.3, 0.3, 3), "d_x": (0.0, 0.3, 2)}, values)
    assert found["kind"].values.tolist() == ["walking"]
    assert found["speed"].values == pytest.approx([0.1])
    assert np.all(found["attractor"].values == 0)


def test_motions_that_stop_or_do_not_arrive() -> None:
    blows_up = ode("blow up", x="x**2 - 1")
    found = basin(blows_up, {"x": (-2.0, 2.0, 5)})
    assert found["kind"].values.tolist() == ["rest"]
    assert found["attractor"].values[[0, 1, 2, 4]].tolist() == [0, 0, 0, -1]
    assert found["state_x"].values == pytest.approx([-1.0])


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        ({"phi": (0.0, 1.0, 3)}, "not a state"),
        ({"psi": (1.0, 0.0, 3)}, "no range"),
        ({"psi": (0.0, 1.0, 1)}, "no range"),
        ({"psi": "abc"}, "no range"),
        ({}, "nothing varies"),
    ],
)
def test_bad_arguments(axes: dict, message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        basin(catalogue.rocking_toy(), axes)


def test_parameters_are_checked() -> None:
    system: System = catalogue.rocking_toy()
    with pytest.raises(DeclarationError, match="Q"):
        basin(system, {"psi": (0.0, 1.0, 2)}, {"Q": 1.0})


def test_rest_without_a_proof() -> None:
    """Where forces are not affine, or driven, rest is seen from a round in which nothing has changed."""
    pendulum = System(
        name="pendulum",
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="-cos(x)",
        contacts={"hinge": Contact("d_x", 0.3)},
        span=(0, 20),
    )
    driven = basin(catalogue.forced_oscillator(F_c=0.5, P=0.3), {"x": (-1.0, 1.0, 3), "d_x": (-1.0, 1.0, 2)})
    for found in (basin(pendulum, {"x": (-2.0, 2.0, 4), "d_x": (-1.0, 1.0, 3)}), driven):
        assert found["kind"].values.tolist() == ["rest"]
        assert np.all(found["attractor"].values == 0)


def test_interruption_keeps_what_has_arrived(monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(module._Search, "_new", stop)
    found = basin(catalogue.rocking_toy(), {"psi": (0.0, 2.0, 3), "d_psi": (0.0, 0.1, 2)}, initial={"x_R": 0.0})
    assert found.attrs["interrupted"] == 1
    assert found["attractor"].values[0, 0] == 0
    assert found["attractor"].values[2, 0] == -2


def test_interrupted_before_anything_has_arrived(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*given: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(module, "run", interrupted)
    found = basin(catalogue.rocking_toy(), {"psi": (-1.0, 1.0, 3), "d_psi": (-1.0, 1.0, 2)})
    assert found.attrs["interrupted"] == 1
    assert found.sizes["reached"] == 0
    assert (found["attractor"] == module.ON_ITS_WAY).all()
