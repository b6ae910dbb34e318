"""Where implementations go wrong: starts on a boundary, grazing, corners, endless slip,
coincidences, resonance."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from oracles import coulomb_oscillator, scaled_slider
from stickslip import Outcome, System, Trajectory, catalogue, simulate
from systems import (
    KINDS,
    SMOOTH,
    VARIABLE,
    distance,
    ode,
    on_grid,
    oscillator,
    pair,
    play,
    switches,
)

pytestmark = pytest.mark.usefixtures("flow")

# near the walking motion of the toy: at rest, legs X apart
WALK = {"psi": -1.67, "x_R": 0.5, "x_L": 0.0}
STRIDE = 5.969  # its period


def follow(
    system: System, until: float, initial: dict[str, float] | None = None, /, **values: float
) -> Trajectory:
    """The motion from t = 0, which has to reach the end and be certified."""
    known = {name: value for name, value in values.items() if name in system.parameters}
    trajectory = simulate(system, (0.0, until), initial=initial or {}, parameters=known)
    assert trajectory.outcome.ok, trajectory.message
    assert trajectory.knots.time[-1] == until
    assert trajectory.certificate.ok, trajectory.certificate.verdict
    return trajectory


def table(trajectory: Trajectory) -> list[tuple[str, str]]:
    """The switches as pairs (from, to)."""
    events = switches(trajectory)
    return list(zip(events["from"], events["to"], strict=True))


def gaps(trajectory: Trajectory) -> np.ndarray:
    """Times between the switches."""
    return np.diff(switches(trajectory)["time"].to_numpy())


# --- 1. A start exactly on a switching surface ----------------------------------------------------

# With the load f ± sin t at the threshold f for t = 0: what rises slips at once.
RISING = {
    "inertial": lambda t: t - math.sin(t),
    "viscous": lambda t: 1 - math.cos(t),
    "rate-independent": math.sin,
}


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("kind", KINDS)
def test_start_on_the_threshold_with_rising_load(kind: str, sign: int) -> None:
    load = {
        "mu": 0.5,
        "f": 0.5 * sign,
        "F": sign,
        "phi": -math.pi / 2,
        "k": float(kind == "rate-independent"),
    }
    motion = follow(KINDS[kind](), 1.5, **load)
    assert motion.n_switches == 0
    assert motion.at(0.0)["mode_ground"] == sign
    t = on_grid(motion)
    assert distance(motion.at(t)["x"], [sign * RISING[kind](s) for s in t]) < 1e-14


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("kind", KINDS)
def test_start_on_the_threshold_with_falling_load(kind: str, sign: int) -> None:
    load = {"mu": 0.5, "f": 0.5 * sign, "F": -1.2 * sign, "phi": -math.pi / 2}
    motion = follow(KINDS[kind](), 1.5, **load)
    # The load leaves the threshold at t = 0 and meets the opposite one where f − 1.2 sin t = −f.
    assert table(motion) == [("stick", "slip-" if sign > 0 else "slip+")]
    assert switches(motion).loc[0, "time"] == pytest.approx(math.asin(1 / 1.2), abs=1e-14)


@pytest.mark.parametrize("kind", KINDS)
def test_start_at_the_peak_of_the_load(kind: str) -> None:
    motion = follow(KINDS[kind](), 3.0, mu=1.0)
    assert motion.n_switches == 0
    assert distance(motion.at(on_grid(motion))["x"], 0.0) == 0.0


@pytest.mark.parametrize("kind", KINDS)
def test_start_on_the_threshold_for_ever(kind: str) -> None:
    motion = follow(KINDS[kind](), 100.0, mu=0.5, f=0.5, F=0.0)
    assert motion.n_switches == 0
    assert motion.final["x"] == 0.0


@pytest.mark.parametrize(("x", "time"), [(0.0, 5 / 3), (0.5, 0.0), (-0.5, 10 / 3)])
def test_start_with_the_speed_of_the_belt(x: float, time: float) -> None:
    # Carried along, x = x_0 + V t, until the spring pulls with the threshold 0.5.
    motion = follow(oscillator(), 3.5, {"x": x, "d_x": 0.3}, V=0.3, F=0.0)
    expected = [("stick", "slip-")] if time else []
    assert table(motion)[:1] == expected
    assert motion.at(0.0)["mode_ground"] == (0 if time else -1)
    if time:
        assert switches(motion).loc[0, "time"] == pytest.approx(time, abs=1e-14)


@pytest.mark.parametrize(
    ("gamma", "half_map"), [(0.4, scaled_slider.slip), (2.0, scaled_slider.stick)]
)
def test_start_on_the_kink(gamma: float, half_map: Any) -> None:
    nu, b = 0.01, 1.0
    duration, image = map(float, half_map(gamma, str(nu), str(b)))
    motion = follow(
        catalogue.scaled_slider_limit(), 1.1 * duration, {"beta": 0.0, "gamma": gamma}, nu=nu, b=b
    )
    event = motion.events.iloc[0]
    assert event["time"] == pytest.approx(duration, rel=1e-13)
    assert event["gamma"] == pytest.approx(image, rel=1e-12)
    assert motion.n_kinks == 1


def test_start_on_two_boundaries() -> None:
    # The corner of G±, on the way back: no leg moves there.
    walk = follow(catalogue.rocking_toy(), 20.0, WALK)
    corner = walk.events[
        (walk.events["contact"] != "left leg") & (walk.events["psi"].sub(1).abs() < 1e-12)
    ]
    state = corner.loc[corner["d_psi"] < 0].iloc[0]
    start = {name: float(state[name]) for name in ("d_psi", "x_R", "x_L")} | {"psi": 1.0}
    again = follow(catalogue.rocking_toy(), 8.0, start)
    later = switches(walk)["time"] - state["time"]
    expected = later[later > 1e-3].to_numpy()[:4]
    assert distance(switches(again)["time"][:4], expected) < 1e-12


# --- 2. A pair of crossings inside one step -------------------------------------------------------

# Slip under the load 1 + e cos near its peak, by the time a from threshold to peak: until the
# impulse, the force, or the rate of the load has come back to zero.
LASTS = {"inertial": 3.0, "viscous": 2.0, "rate-independent": 1.0}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("phi", -np.linspace(0.02, 1.4, 12))
def test_grazing_of_the_threshold(kind: str, phi: float) -> None:
    excess = 1e-12
    load = {"mu": 1.0, "k": float(kind == "rate-independent"), "phi": phi}
    found = simulate(KINDS[kind](), (0.0, 2.0), initial={}, parameters=load | {"F": 1.0 + excess})
    assert [event[1] for event in table(found)] == ["slip+", "stick"]
    start, stop = switches(found)["time"]
    assert stop - start == pytest.approx(LASTS[kind] * math.sqrt(2 * excess), rel=0.05)
    assert (start + stop) / 2 == pytest.approx(-phi, abs=5e-6)
    missed = follow(KINDS[kind](), 2.0, **load, F=1.0 - excess)
    assert missed.n_switches == 0
    assert missed.final["x"] == 0.0


@pytest.mark.parametrize("kind", KINDS)
def test_slip_of_a_microsecond(kind: str) -> None:
    # The load 1 + e at its peak exceeds the threshold for ±a with e = (10 a)²/2.
    a = 1e-6 / LASTS[kind]
    load = {"mu": 1.0, "k": float(kind == "rate-independent"), "omega": 10.0, "phi": -1.3}
    motion = simulate(
        KINDS[kind](), (0.0, 0.4), initial={}, parameters=load | {"F": 1.0 + 50 * a**2}
    )
    start, stop = switches(motion)["time"]
    assert stop - start == pytest.approx(1e-6, rel=1e-3)
    assert motion.final["x"] > 0.0


@pytest.mark.parametrize("phi", np.linspace(0.0, 1.2, 7))
def test_grazing_of_rest(phi: float) -> None:
    # v = 1 − (1 ± e)(sin(t + φ) − sin φ)/(1 − sin φ): at the end of the deceleration a stop is
    # missed by e, or not.
    for excess, stops in ((1e-12, 1), (-1e-12, 0)):
        force = (1.0 + excess) / (1.0 - math.sin(phi))
        load = {"k": 0.0, "mu": 1.0, "f": 1.0, "F": -force, "phi": phi}
        motion = follow(oscillator(), 3.0, {"d_x": 1.0}, **load)
        assert table(motion) == [("slip+", "stick"), ("stick", "slip+")] * stops
        if stops:
            stop, start = switches(motion)["time"]
            assert start == pytest.approx(math.pi / 2 - phi, abs=1e-12)
            assert start - stop == pytest.approx(math.sqrt(2e-12 * (1.0 - math.sin(phi))), rel=0.02)


@pytest.mark.parametrize("angle", np.linspace(0.1, 1.5, 8))
def test_grazing_of_a_jump(angle: float) -> None:
    # z counts how long x = (1 ± e) sin(t + angle) is above 1.
    system = ode("time above", x="y", y="-x", z="piecewise(x > 1, 1, 0)")
    for excess, above in ((1e-12, 2 * math.sqrt(2e-12)), (-1e-12, 0.0)):
        size = 1.0 + excess
        start = {"x": size * math.sin(angle), "y": size * math.cos(angle), "z": 0.0}
        assert simulate(system, (0.0, 3.0), initial=start).final["z"] == pytest.approx(
            above, rel=0.02, abs=1e-20
        )


# --- 3. The corner that is touched exactly on every return swing ----------------------------------


def legs(motion: Trajectory) -> list[tuple[str, str]]:
    events = switches(motion)
    return list(zip(events["contact"], events["to"], strict=True))


def test_corner_is_touched_without_a_switch() -> None:
    motion = follow(catalogue.rocking_toy(), 63.0, WALK)
    assert motion.n_switches == 42
    steps = [
        ("left leg", "slip+"),
        ("left leg", "stick"),
        ("right leg", "slip+"),
        ("right leg", "stick"),
    ]
    assert legs(motion) == (11 * steps)[:42]
    assert gaps(motion).min() > 0.1


@pytest.mark.parametrize("psi", [-1.67, -1.6, -1.9, 1.67])
def test_corner_over_three_hundred_cycles(psi: float) -> None:
    start = {"psi": psi, "x_R": -0.5 * np.sign(psi)}
    motion = follow(catalogue.rocking_toy(), 300 * STRIDE, start)
    assert 1198 <= motion.n_switches <= 1201
    moved = [leg for leg, to in legs(motion) if to == "slip+"]
    assert all(a != b for a, b in pairwise(moved))
    assert gaps(motion).min() > 0.1


@pytest.mark.parametrize(
    ("c", "H_star", "psi_star"), [(0.3, 3.0, 0.7), (0.25, 2.9, 1.1), (1 / 3, 3.1, 0.9)]
)
def test_corner_with_other_numbers(c: float, H_star: float, psi_star: float) -> None:
    values = {"c": c, "H_star": H_star, "psi_star": psi_star}
    X = 1.0 - 0.2 - c * psi_star
    motion = follow(catalogue.rocking_toy(), 500.0, {"psi": -1.7, "x_R": X}, **values)
    assert motion.n_switches > 200
    assert gaps(motion).min() > 0.05


# --- 4. Slip that never ends ----------------------------------------------------------------------


def test_stable_focus_slips_for_ever() -> None:
    motion = follow(
        catalogue.scaled_slider_limit(), 1e5, {"beta": 0.0, "gamma": 0.4}, nu=0.01, b=0.05
    )
    assert motion.n_kinks == 14
    assert motion.final["beta"] == pytest.approx(1.0, abs=1e-11)
    assert motion.final["gamma"] == pytest.approx(1.0, abs=1e-11)


def test_sliding_on_a_belt_for_ever() -> None:
    # A threshold that sliding does not lower: the oscillation dies out, the block rests in space, x
    # = 0.5.
    motion = follow(oscillator(), 1e4, {"x": 0.1}, V=1.0, F=0.0, c=0.1)
    assert motion.n_switches == 0
    assert motion.final["x"] == pytest.approx(0.5, abs=1e-11)
    assert motion.at(1e4)["mode_ground"] == -1


def test_undamped_sliding_on_a_belt_for_ever() -> None:
    motion = follow(oscillator(), 1000 * 2 * math.pi, {"x": 0.1}, V=1.0, F=0.0)
    assert motion.n_switches == 0
    assert motion.final["x"] == pytest.approx(0.1, abs=1e-9)


# --- 5. Coincidences, zero lengths, thresholds that vanish or jump --------------------------------


def test_reversal_without_a_stop() -> None:
    motion = follow(oscillator(), 60.0, mu=0.1, omega=0.8)
    assert (
        distance(switches(motion)["time"], coulomb_oscillator.switch_times(60.0, mu=0.1, omega=0.8))
        < 1e-11
    )
    assert set(table(motion)) == {("slip+", "slip-"), ("slip-", "slip+")}
    # One knot at each reversal, none for the rest of length zero.
    assert np.diff(motion.knots.time).min() > 1e-6


@pytest.mark.parametrize(("kind", "x", "exact"), [
    ("inertial", 0.0, lambda t: t * np.sin(t) / 2),
    ("viscous", 0.5, lambda t: (np.cos(t) + np.sin(t)) / 2),
    ("rate-independent", 1.0, np.cos),
])  # fmt: skip
def test_threshold_zero(kind: str, x: float, exact: Any) -> None:
    motion = follow(KINDS[kind](), 20.0, {"x": x}, mu=0.0)
    t = on_grid(motion)
    assert distance(motion.at(t)["x"], exact(t)) < 1e-11
    assert gaps(motion).min() > 0.1


@pytest.mark.parametrize("threshold", [VARIABLE, SMOOTH])
@pytest.mark.parametrize("kind", KINDS)
def test_threshold_touches_zero_without_load(kind: str, threshold: str) -> None:
    motion = follow(KINDS[kind](threshold), 40.0, s_1=1.0, F=0.0)
    assert motion.n_switches == 0
    assert motion.final["x"] == 0.0


@pytest.mark.parametrize("kind", KINDS)
def test_threshold_touches_zero_under_load(kind: str) -> None:
    smooth, general = (
        follow(KINDS[kind](s), 40.0, s_1=1.0, F=0.0, f=0.3) for s in (SMOOTH, VARIABLE)
    )
    # s = 1 + cos t falls to the load at cos t = −0.7. The play is at rest once s has been 0.
    assert switches(smooth).loc[0, "time"] == pytest.approx(math.acos(-0.7), abs=1e-13)
    if kind == "rate-independent":
        assert smooth.final["x"] == pytest.approx(0.3, abs=1e-14)
        assert switches(smooth)["time"].tolist() == pytest.approx(
            [math.acos(-0.7), math.pi], abs=1e-7
        )
    t = on_grid(smooth)
    assert table(smooth) == table(general)
    assert distance(smooth.at(t)["x"], general.at(t)["x"]) < 1e-12


@pytest.mark.parametrize("kind", KINDS)
def test_threshold_is_zero_for_a_while(kind: str) -> None:
    motion = follow(KINDS[kind](VARIABLE), 40.0, s_0=0.0, s_1=1.0, F=0.0)
    assert motion.n_switches == 0
    assert motion.final["x"] == 0.0
    loaded = follow(KINDS[kind](VARIABLE), 40.0, s_0=0.0, s_1=1.0, F=0.0, f=0.3)
    assert switches(loaded).loc[0, "time"] == pytest.approx(math.acos(0.3), abs=1e-13)
    assert gaps(loaded).min() > 1e-4


# The load 0.3, of which the threshold 1 leaves 0.2 as soon as it has fallen to 0.1.
DROPPED = {
    "inertial": lambda t: np.where(
        t < 1, 0.0, np.where(t < 1 + math.pi, 0.2 * (1 - np.cos(t - 1)), 0.4)
    ),
    "viscous": lambda t: np.where(t < 1, 0.0, 0.2 * (1 - np.exp(1 - t))),
}


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("kind", DROPPED)
def test_threshold_jumps_below_the_force(kind: str, sign: int) -> None:
    motion = follow(KINDS[kind](VARIABLE), 20.0, jump=-0.9, F=0.0, f=0.3 * sign)
    t = on_grid(motion)
    assert distance(motion.at(t)["x"], sign * DROPPED[kind](t)) < 1e-13
    assert switches(motion).loc[0, "time"] == pytest.approx(1.0, abs=1e-15)
    # The mass stops exactly where the threshold holds it again.
    assert motion.n_switches == (2 if kind == "inertial" else 1)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("jump", [-0.9, -1.0, -3.0])
def test_threshold_jumps_below_the_force_without_a_bounded_rate(jump: float, sign: int) -> None:
    motion = simulate(
        play(VARIABLE),
        (0.0, 20.0),
        initial={},
        parameters={"jump": jump, "F": 0.0, "f": 0.3 * sign},
    )
    assert motion.outcome is Outcome.NO_BOUNDED_RATE
    assert motion.knots.time[-1] == pytest.approx(1.0, abs=1e-15)
    assert motion.final["x"] == 0.0
    assert motion.n_switches == 0


@pytest.mark.parametrize("kind", KINDS)
def test_threshold_jumps_but_holds(kind: str) -> None:
    for jump in (0.5, -0.6, -0.7):  # the last one leaves exactly the load
        motion = follow(KINDS[kind](VARIABLE), 20.0, jump=jump, F=0.0, f=0.3)
        assert motion.n_switches == 0
        assert motion.final["x"] == 0.0


@pytest.mark.parametrize("kind", ["viscous", "rate-independent"])
def test_threshold_jumps_up_during_slip(kind: str) -> None:
    motion = follow(KINDS[kind](VARIABLE), 1.5, jump=0.5, phi=-math.pi / 2, F=1.5)
    assert table(motion) == [("stick", "slip+"), ("slip+", "stick")]
    assert switches(motion)["time"].tolist() == pytest.approx([math.asin(2 / 3), 1.0], abs=1e-14)


@pytest.mark.parametrize("kind", KINDS)
def test_threshold_jumps_up_when_it_is_reached(kind: str) -> None:
    # sin(πt/6) meets the threshold 0.5 at t = 1, when that jumps to 1.1.
    load = {"s_0": 0.5, "omega": math.pi / 6, "phi": -math.pi / 2}
    assert follow(KINDS[kind](VARIABLE), 20.0, **load, jump=0.6).n_switches == 0


def test_threshold_jumps_down_when_it_is_reached() -> None:
    load = {"s_0": 0.5, "omega": math.pi / 6, "phi": -math.pi / 2, "k": 0.0}
    motion = follow(oscillator(VARIABLE), 2.0, **load, jump=-0.25)
    assert table(motion) == [("stick", "slip+")]
    t = 2.0
    w = math.pi / 6
    v = (math.cos(w) - math.cos(w * t)) / w - 0.25 * (t - 1)
    assert motion.final["d_x"] == pytest.approx(v, abs=1e-13)


# --- 6. Symmetric problems in which several contacts change at once -------------------------------


@pytest.mark.parametrize("N", [2, 3, 8])
def test_equal_blocks_move_as_one(N: int) -> None:
    values = {"V": 0.3}
    one = follow(catalogue.belt_block(), 100.0, {"x": 0.2}, **values)
    blocks = [f"x_{i}" for i in range(1, N + 1)]
    chain = follow(catalogue.block_chain(N=N), 100.0, dict.fromkeys(blocks, 0.2), **values)
    assert chain.n_switches == N * one.n_switches > 20 * N
    t = on_grid(one)
    for x in blocks:
        assert distance(chain.at(t)[x], one.at(t)["x"]) < 1e-11


def test_mirrored_blocks_stay_mirrored() -> None:
    motion = follow(catalogue.block_chain(N=3), 100.0, {"x_1": 0.1, "x_2": -0.3, "x_3": 0.1})
    assert motion.n_switches > 20
    assert np.array_equal(motion.knots.mode[:, 0], motion.knots.mode[:, 2])
    t = on_grid(motion)
    assert distance(motion.at(t)["x_1"], motion.at(t)["x_3"]) < 1e-12


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("kind", ["viscous", "rate-independent"])
def test_equal_loads_move_two_as_one(kind: str, sign: int) -> None:
    # Loaded alike the spring between them stays relaxed; loaded oppositely its middle stays at
    # rest.
    values = {"k": 1.2, "k_c": 0.7, "F_1": 1.0, "F_2": sign, "phi": -math.pi / 2}
    both = follow(pair(kind), 30.0, **values)
    stiffness = 1.2 if sign > 0 else 1.2 + 2 * 0.7
    one = follow(KINDS[kind](), 30.0, k=stiffness, phi=-math.pi / 2)
    assert both.n_switches == 2 * one.n_switches > 20
    t = on_grid(one)
    assert distance(both.at(t)["x_1"], one.at(t)["x"]) < 1e-12
    assert distance(both.at(t)["x_2"], sign * one.at(t)["x"]) < 1e-12


def test_crawler_without_a_preferred_direction() -> None:
    # Both legs yield at once and may share the motion in any way; their distance is the play of L.
    values = {"f_plus": 0.2, "f_minus": 0.2}
    motion = follow(catalogue.two_leg_crawler(), 40.0, **values)
    alone = follow(play(), 40.0, mu=0.2, F=0.5, phi=-math.pi / 2)
    t = on_grid(motion)
    d = motion.at(t)["x_2"] - motion.at(t)["x_1"]
    assert distance(d, alone.at(t)["x"]) < 1e-12


def test_toy_is_mirrored() -> None:
    left = follow(catalogue.rocking_toy(), 200.0, {"psi": 1.9, "x_R": -0.5})
    right = follow(catalogue.rocking_toy(), 200.0, {"psi": -1.9, "x_R": 0.5})
    t = on_grid(left)
    for mirrored, x, sign in (("psi", "psi", -1), ("x_R", "x_L", 1), ("x_L", "x_R", 1)):
        shift = right.at(0.0)[x] - left.at(0.0)[mirrored]
        assert (
            distance(left.at(t)[mirrored], sign * (right.at(t)[x] - (shift if sign > 0 else 0.0)))
            < 1e-10
        )
    assert [leg for leg, _ in legs(left)] == [
        {"left leg": "right leg"}.get(leg, "left leg") for leg, _ in legs(right)
    ]


def test_toy_at_rest_upright() -> None:
    motion = follow(catalogue.rocking_toy(), 100.0, {"psi": 0.0, "x_R": 0.0}, P=1.69)
    assert motion.n_switches == 0
    assert set(motion.final.values()) == {0.0}


# --- 7. Resonances that converge extremely slowly -------------------------------------------------


@pytest.mark.parametrize("n", [1, 2])
def test_resonance(n: int) -> None:
    omega = 1 / (2 * n)
    period = 2 * math.pi / omega
    values = {"F_c": 0.05, "omega": omega}
    motion = follow(catalogue.forced_oscillator(), 400 * period, **values)
    x = motion.at(period * np.arange(400))["x"]
    # Beside a resonance the distance to the periodic motion shrinks by a constant factor; here it
    # does so like 1/n.
    change = np.abs(np.diff(x))
    assert 0.2 < change[350] / change[175] < 0.35
    assert change[350] > 1e-7
    beside = follow(catalogue.forced_oscillator(), 400 * period / 0.9, F_c=0.05, omega=0.9 * omega)
    x = beside.at(period / 0.9 * np.arange(400))["x"]
    assert abs(x[351] - x[350]) < 1e-9
    exact = coulomb_oscillator.phases(40 * period, mu=0.05, omega=omega)
    t = np.linspace(0.0, 40 * period, 101)
    assert distance(motion.at(t)["x"], coulomb_oscillator.state(t, exact)[0]) < 1e-10


@pytest.mark.parametrize("i", range(-4, 5))
def test_a_reversal_at_the_threshold(i: int) -> None:
    """A velocity comes to 0 where stick and slip differ by rounding: one of them has to go on."""
    motion = simulate(
        catalogue.forced_oscillator(),
        (0.0, 200.0),
        initial={},
        parameters={"omega": 0.77, "F_c": 0.8008793135880453 * (1 + i * 1e-13)},
    )
    assert motion.outcome.ok
    assert motion.certificate.ok


@pytest.mark.parametrize("rtol", [1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 1e-6])
def test_an_event_is_known_no_better_than_the_series(rtol: float) -> None:
    # With a loose tolerance a slip begins while the force is below its threshold by more than
    # rounding.
    motion = simulate(catalogue.spring_slider(), (0, 50), rtol=rtol)
    assert motion.outcome is Outcome.FINISHED
    assert motion.n_switches == 18


def test_a_term_too_small_to_be_seen() -> None:
    # At the start no coefficient shows that the exponential will ever matter.
    motion = follow(ode("sleeper", x="1.0", y="exp(200*(x - 2))"), 2.02)
    assert motion.final["y"] == pytest.approx(math.exp(4.0) / 200, rel=1e-9)


@pytest.mark.parametrize("start", [0.0, 164.0])
@pytest.mark.parametrize("speed", [1e-15, 3.3e-14, 1e-12, 1e-10])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_speed_of_rounding_is_rest(start: float, speed: float, side: float) -> None:
    """What is too slow to count as slip, and is no exact rest either, has a motion all the same."""
    system = catalogue.rocking_toy_inertial()
    there = {"psi": -0.93, "x_R": 0.4744, "x_L": 0.0, "d_psi": 1.559, "d_x_R": side * speed}
    motion = simulate(system, (start, start + 1.0), initial=there)
    rest = simulate(system, (start, start + 1.0), initial={**there, "d_x_R": 0.0})
    assert motion.certificate.ok
    assert motion.knots.state[-1] == pytest.approx(rest.knots.state[-1], abs=1e-9)
