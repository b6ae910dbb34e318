"""Laws that hold for every motion: symmetries, energy, and that no result depends on how it was
computed."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from properties.families import draw, linear_family
from stickslip import (
    Contact,
    Inertial,
    Internal,
    Parameter,
    RateIndependent,
    System,
    Trajectory,
    Viscous,
    catalogue,
    simulate,
)
from stickslip.arrays import Array

State = dict[str, float]

# Examples are drawn anew from the test's name, the same in every run.
law = settings(max_examples=25, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32 - 1)


def certified(
    system: System,
    span: tuple[float, float],
    start: State,
    values: State | None = None,
    rtol: float = 1e-10,
) -> Trajectory:
    trajectory = simulate(system, span, initial=start, parameters=values, rtol=rtol)
    assert trajectory.outcome.ok, trajectory.message
    assert trajectory.certificate.ok, trajectory.certificate.verdict
    return trajectory


def states(trajectory: Trajectory, times: Array) -> dict[str, Array]:
    values = trajectory.at(times)
    return {name: values[name] for name in trajectory.system.declaration.state}


def assert_equal_motion(
    one: dict[str, Array], other: dict[str, Array], tolerance: float = 1e-9
) -> None:
    assert one.keys() == other.keys()
    for name, values in one.items():
        atol = tolerance * max(1.0, np.abs(values).max())
        np.testing.assert_allclose(other[name], values, rtol=0, atol=atol, err_msg=name)


# --- Systems --------------------------------------------------------------------------------------


@cache
def toy() -> System:
    return catalogue.rocking_toy()


def toy_start(psi: float, rate: float, fraction: float, place: float = 0.0) -> State:
    """Legs at rest inside the stable set G⁻(ψ) ≤ d ≤ G⁺(ψ), at a fraction of the way."""
    p = toy().values

    def weight(angle: float) -> float:
        return p["rho"] + p["H_star"] / 2 * (1 + min(max(angle / p["psi_star"], -1.0), 1.0))

    right = weight(psi)
    left = weight(-psi)
    middle = p["c"] * psi
    top = min(p["P"] + middle + right, -p["P"] + middle + left) / p["a"]
    bottom = max(p["P"] + middle - right, -p["P"] + middle - left) / p["a"]
    d = bottom + fraction * (top - bottom)
    return {"psi": psi, "d_psi": rate, "x_R": place + d / 2, "x_L": place - d / 2}


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers that are zero or of a size that counts."""
    return st.floats(low, high).map(lambda x: round(x, 9))


toy_starts = st.tuples(numbers(-2.2, 2.2), numbers(-1, 1), numbers(0, 1))


@cache
def mixture() -> System:
    """All kinds at once: a mass on a block on a rate-independent slider, with friction that ages
    and heats."""
    values = dict(
        m=1.0, k=1.0, k_1=1.0, k_2=2.0, k_3=0.5, c=0.1, e=0.05, nu=0.3,
        s_q=0.3, s_z=0.4, s_r=0.5, gain=0.3, heat=0.2, tau=1.0,
        F=1.5, omega=1.3, V=0.1, swing=0.2, drop=0.8,
    )  # fmt: skip
    return System(
        name="mixture",
        parameters={name: Parameter(value) for name, value in values.items()},
        functions={"aged(a)": "1 + gain*tanh(a)"},
        coordinates={"q": Inertial(drag="e*d_q**3"), "z": Viscous(), "r": RateIndependent()},
        internal={"a": Internal("(1 - a)/tau - heat*a*abs(d_z) + heat*d_r")},
        kinetic="m/2*d_q**2",
        potential="k/2*q**2 + k_1/2*(q - z)**2 + k_2/2*(z - r)**2 + k_3/2*r**2 + swing*cos(q) - "
        "F*cos(omega*t)*q",
        viscous="nu/2*d_z**2 + c/2*(d_q - d_z)**2",
        contacts={
            "q": Contact("d_q", threshold="s_q*aged(a)", surface_speed="V"),
            "z": Contact(
                "d_z", threshold="s_z*(1 + max(q, 0))", kinetic="drop*s_z*(1 + max(q, 0))"
            ),
            "r": Contact("d_r", threshold="s_r*(1 + 0.3*sin(q)**2)*aged(a)"),
        },
    )


def mixture_case(seed: int) -> tuple[State, State]:
    """Random start and parameters."""
    rng = np.random.default_rng(seed)
    values = {
        name: p.default * float(rng.uniform(0.5, 1.5)) for name, p in mixture().parameters.items()
    }
    values["drop"] = float(rng.uniform(0.7, 1))
    q, z = rng.normal(size=2)
    # The slider starts in equilibrium.
    r = values["k_2"] * z / (values["k_2"] + values["k_3"])
    return {
        "q": q,
        "d_q": float(rng.normal()),
        "z": z,
        "r": r,
        "a": float(rng.uniform(-1, 1)),
    }, values


# --- Laws -----------------------------------------------------------------------------------------


@law
@given(seeds)
def test_every_motion_is_certified(seed: int) -> None:
    start, values = mixture_case(seed)
    trajectory = certified(mixture(), (0, 25), start, values)
    assert trajectory.n_switches > 5


@law
@given(toy_starts)
def test_every_walk_is_certified(start: tuple[float, float, float]) -> None:
    certified(toy(), (0, 60), toy_start(*start))


@law
@given(toy_starts, st.floats(-1e3, 1e3))
def test_a_shift_of_both_legs_shifts_the_motion(
    start: tuple[float, float, float], shift: float
) -> None:
    here, there = (certified(toy(), (0, 60), toy_start(*start, place)) for place in (0.0, shift))
    times = np.linspace(0, 60, 301)
    one, other = states(here, times), states(there, times)
    for leg in ("x_R", "x_L"):
        other[leg] = other[leg] - shift
    # Positions of size 1000 carry rounding errors of 1e-13, and the threshold decides on them.
    assert_equal_motion(one, other, 1e-8)
    assert here.n_switches == there.n_switches


@law
@given(toy_starts)
def test_the_mirror_image_of_a_motion_is_a_motion(start: tuple[float, float, float]) -> None:
    begin = toy_start(*start)
    mirrored = {
        "psi": -begin["psi"],
        "d_psi": -begin["d_psi"],
        "x_R": begin["x_L"],
        "x_L": begin["x_R"],
    }
    times = np.linspace(0, 60, 301)
    one, other = (states(certified(toy(), (0, 60), s), times) for s in (begin, mirrored))
    back = {
        "psi": -other["psi"],
        "d_psi": -other["d_psi"],
        "x_R": other["x_L"],
        "x_L": other["x_R"],
    }
    assert_equal_motion(one, {name: back[name] for name in one})


@law
@given(st.floats(-6, 6), st.floats(0, 0.95), st.floats(0.3, 1.5))
def test_the_scaled_slider_is_homogeneous_in_its_rate(
    exponent: float, gamma: float, b: float
) -> None:
    factor = 10.0**exponent
    system = catalogue.scaled_slider_limit()
    times = np.linspace(0, 20, 401)
    motions = [
        states(
            certified(
                system, (0, 20), {"beta": 0.0, "gamma": gamma * v_hat}, {"v_hat": v_hat, "b": b}
            ),
            times,
        )
        for v_hat in (1.0, factor)
    ]
    assert np.ptp(motions[0]["gamma"]) > 0.1
    assert_equal_motion(motions[0], {name: values / factor for name, values in motions[1].items()})


AUTONOMOUS = {
    "rocking_toy": lambda rng: toy_start(*rng.uniform([-2, -1, 0], [2, 1, 1])),
    "scaled_slider": lambda rng: {"beta": 0.0, "gamma": rng.uniform(0, 0.9)},
    "spring_slider": lambda rng: {"U": rng.uniform(0, 0.5), "alpha": rng.uniform(0.5, 1.5)},
    "belt_block": lambda rng: {"x": rng.normal(), "d_x": rng.normal()},
}


@pytest.mark.parametrize("name", AUTONOMOUS)
@pytest.mark.parametrize("seed", range(4))
def test_an_autonomous_system_does_not_know_the_time(name: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    system = catalogue.get(name)
    start = {k: float(v) for k, v in AUTONOMOUS[name](rng).items()}
    shift = float(rng.uniform(-50, 50))
    T = 30.0
    times = np.linspace(0, T, 301)
    one = states(certified(system, (0, T), start), times)
    later = certified(system, (shift, shift + T), start)
    # Times are rounded when they are shifted: stay inside the span.
    other = states(later, np.clip(times + shift, shift, shift + T))
    assert_equal_motion(one, other, 1e-8)


@law
@given(seeds)
def test_results_do_not_depend_on_the_tolerance(seed: int) -> None:
    start, values = mixture_case(seed)
    times = np.linspace(0, 25, 251)
    coarse, fine = (
        states(certified(mixture(), (0, 25), start, values, rtol), times) for rtol in (1e-8, 1e-11)
    )
    assert_equal_motion(fine, coarse, 1e-7)


@law
@given(toy_starts)
def test_walks_do_not_depend_on_the_tolerance(start: tuple[float, float, float]) -> None:
    times = np.linspace(0, 60, 301)
    coarse, fine = (
        states(certified(toy(), (0, 60), toy_start(*start), rtol=rtol), times)
        for rtol in (1e-8, 1e-11)
    )
    assert_equal_motion(fine, coarse, 1e-7)


@law
@given(seeds, st.lists(st.floats(0.5, 24.5), min_size=1, max_size=6))
def test_a_motion_in_pieces_is_the_same_motion(seed: int, cuts: list[float]) -> None:
    """Stopping anywhere and starting again from the state there changes nothing: the state says
    everything.

    Unless kinetic friction is below static friction: then a massless block remembers whether it
    slides.
    """
    start, values = mixture_case(seed)
    values["drop"] = 1.0
    whole = certified(mixture(), (0, 25), start, values)
    for begin, end in pairwise([0.0, *sorted(cuts), 25.0]):
        if begin < end:
            start = certified(mixture(), (begin, end), start, values).final
            expected = whole.at(end)
            for name, value in start.items():
                assert value == pytest.approx(expected[name], abs=1e-9), (name, end)


@law
@given(toy_starts, st.lists(st.floats(0.5, 59.5), min_size=1, max_size=6))
def test_a_walk_in_pieces_is_the_same_walk(
    start: tuple[float, float, float], cuts: list[float]
) -> None:
    state = toy_start(*start)
    whole = certified(toy(), (0, 60), state)
    for begin, end in pairwise([0.0, *sorted(cuts), 60.0]):
        if begin < end:
            state = certified(toy(), (begin, end), state).final
            expected = whole.at(end)
            for name, value in state.items():
                assert value == pytest.approx(expected[name], abs=1e-8), (name, end)


@pytest.mark.parametrize(
    ("kind", "size", "contacts"),
    [("inertial", 1, 1), ("inertial", 3, 2), ("inertial", 4, 4), ("viscous", 3, 2)],
)
@pytest.mark.parametrize("seed", range(8))
def test_without_load_energy_never_increases(
    kind: str, size: int, contacts: int, seed: int
) -> None:
    rng = np.random.default_rng([seed, size])
    free = {
        "F": np.zeros(size),
        "b": np.zeros(contacts),
        "x": 3 * rng.normal(size=size),
        "v": rng.normal(size=size),
    }
    drawn = draw(rng, size, contacts, **free)
    system = linear_family(kind, size, contacts)
    trajectory = certified(system, (0, 20), drawn.initial(system), drawn.parameters(system))
    data = trajectory.dataset
    energy, dissipated = data["energy"].values, data["dissipated_energy"].values
    assert energy[0] - energy[-1] > 0.1 * energy[0]
    assert np.all(np.diff(energy) <= 1e-13 * energy[0])
    assert np.all(np.diff(dissipated) >= -1e-13 * energy[0])
    np.testing.assert_allclose(energy + dissipated, energy[0], rtol=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_a_body_at_rest_is_certified(seed: int) -> None:
    """Its velocities are rounding errors: they must not be judged relative to themselves."""
    rng = np.random.default_rng([seed, 5])
    still = {
        "x": rng.normal(size=2) / 50,
        "v": np.zeros(2),
        "b": np.zeros(2),
        "s": np.ones(2),
        "r": np.zeros(2),
    }
    drawn = draw(rng, 2, 2, F=rng.uniform(0.01, 0.1, 2), **still)
    system = linear_family("inertial", 2, 2)
    trajectory = certified(system, (0, 20), drawn.initial(system), drawn.parameters(system))
    assert trajectory.n_switches == 0
    assert np.abs(trajectory.knots.state[:, 2:]).max() < 1e-13


def test_a_body_at_rest_under_a_changing_load_is_certified() -> None:
    """Its state does not change, but its energy does."""
    trajectory = certified(catalogue.two_leg_crawler(D=0.1), (0, 40), {})
    assert np.ptp(trajectory.knots.state) == 0
    assert np.ptp(trajectory.dataset["energy"].values) > 1e-3


@law
@given(toy_starts)
def test_without_pull_the_toy_comes_to_rest(start: tuple[float, float, float]) -> None:
    values = {"P": 0.0, "delta": 0.4}
    psi, rate, _ = start
    trajectory = certified(
        toy(), (0, 60), {"psi": psi, "d_psi": rate, "x_R": 0.3 * psi, "x_L": 0.0}, values
    )
    energy = trajectory.dataset["energy"].values
    assert np.all(np.diff(energy) <= 1e-13 * max(1.0, energy[0]))
    assert abs(trajectory.final["d_psi"]) < 1e-3
