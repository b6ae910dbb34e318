"""Variables that are sampled: digital controllers, with delay and quantisation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.model.system_file import dumps, loads

CARRIAGE: dict[str, Any] = {
    "coordinates": {"x": ss.Inertial("m")},
    "kinetic": "m*d_x**2/2",
    "potential": "-F*x",
    "contacts": {"rail": ss.Contact("d_x", 1.5, kinetic=1.0)},
}
PERIOD = 0.02


def controlled(**sampled: Any) -> ss.System:
    internal = {
        "I": ss.Sampled("T", "I + T*(1 - x)"),
        "F": ss.Sampled("T", "40*(1 - x) + 60*(I + T*(1 - x)) - 12*d_x", **sampled),
    }
    parameters = {"m": 2.0, "T": PERIOD}
    return ss.System("controlled", parameters=parameters, internal=internal, **CARRIAGE)


def by_hand(delay: float, quantum: float, count: int) -> np.ndarray:
    """Positions at the samples, with the controller in Python."""
    plain = ss.System("free", parameters={"m": 2.0, "F": 0.0}, **CARRIAGE)
    stepper = ss.Stepper(plain, inputs=["F"])
    integral = force = acting = 0.0
    found: list[float] = []
    for k in range(count):
        state = stepper.state
        if k > 0:
            error = 1.0 - state["x"]
            integral += PERIOD * error
            force = 40.0 * error + 60.0 * integral - 12.0 * state["d_x"]
            force = quantum * np.floor(force / quantum + 0.5) if quantum else force
        if delay:
            stepper.advance(k * PERIOD + delay, {"F": acting})
        acting = force
        found.append(stepper.advance((k + 1) * PERIOD, {"F": acting})["x"])
    return np.array(found)


@pytest.mark.parametrize("delay", [0.0, 0.007])
@pytest.mark.parametrize("quantum", [0.0, 0.5])
def test_a_sampled_controller_is_one_in_python(delay: float, quantum: float) -> None:
    """A PID controller with an integral of its own: it overshoots, sticks, and hunts."""
    motion = ss.simulate(controlled(delay=delay, quantum=quantum), (0.0, 8.0))
    assert motion.certificate.ok, motion.certificate.verdict
    times = np.arange(1, 401) * PERIOD
    np.testing.assert_allclose(motion.at(times)["x"], by_hand(delay, quantum, 400), atol=1e-11)
    assert motion.n_switches > 4
    if quantum:
        steps = motion.at(times)["F"] / quantum
        np.testing.assert_array_equal(steps, np.round(steps))


def test_what_is_sampled_together_is_computed_from_the_values_before() -> None:
    """A chain of samples is a delay of whole periods."""
    system = ss.System(
        "chain",
        internal={
            "s": ss.Internal("1"),
            "a": ss.Sampled(0.1, "s"),
            "b": ss.Sampled(0.1, "a"),
            "c": ss.Sampled(0.1, "b"),
        },
        span=(0, 1),
    )
    motion = ss.simulate(system)
    now = motion.at(0.95)
    assert [now[name] for name in "abc"] == pytest.approx([0.9, 0.8, 0.7], abs=1e-14)
    assert {str(name) for name in motion.events["contact"]} == {"sample a, b, c"}


def test_samples_begin_at_the_offset() -> None:
    system = ss.System(
        "offset",
        parameters={"d": 0.03},
        internal={"s": ss.Internal("1"), "a": ss.Sampled(0.1, "s", offset="d")},
        initial={"a": -1.0},
        span=(0, 1),
    )
    motion = ss.simulate(system)
    assert motion.at(0.02)["a"] == -1.0
    times = motion.events["time"].to_numpy()
    np.testing.assert_allclose(times, np.arange(0.03, 1.0, 0.1), atol=1e-14)
    moved = ss.simulate(system, parameters={"d": 0.05})
    assert moved.events["time"].to_numpy()[0] == pytest.approx(0.05, abs=1e-14)


def test_a_model_file_says_the_same() -> None:
    system = controlled(delay="T/2", quantum=0.01)
    assert loads(dumps(system)) == system
    assert 'internal.F = {period = "T"' in dumps(system)


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"period": 0.0, "law": "x"}, r"internal\.F\.period: 0 is outside"),
        ({"period": "-T", "law": "x"}, r"internal\.F\.period: -0\.02 is outside"),
        ({"period": "x", "law": "x"}, r"internal\.F\.period: it depends on 'x'"),
        ({"period": 1000.0, "law": "x"}, r"internal\.F\.period: the period 1000 is longer"),
        ({"period": 0.1, "law": "y"}, r"internal\.F\.law: unknown name 'y'"),
        ({"period": 0.1, "law": "friction_rail"}, r"internal\.F\.law: 'friction_rail' is not"),
        ({"period": 0.1, "law": "x", "delay": 0.1}, r"internal\.F\.delay: 1 is outside"),
        ({"period": 0.1, "law": "x", "delay": -0.1}, r"internal\.F\.delay: -1 is outside"),
        ({"period": 0.1, "law": "x", "quantum": -1.0}, r"internal\.F\.quantum: -1 is outside"),
        ({"period": 0.1, "law": "x", "unit": "nonsense&"}, r"internal\.F\.unit"),
    ],
)
def test_bad_input(given: dict[str, Any], reason: str) -> None:
    with pytest.raises(ss.DeclarationError, match=reason):
        ss.System(
            "bad",
            parameters={"m": 2.0, "T": PERIOD},
            internal={"F": ss.Sampled(**given)},
            **CARRIAGE,
        )


def test_a_period_is_checked_again_where_parameters_change() -> None:
    with pytest.raises(ss.DeclarationError, match=r"internal\.I\.period: 0 is outside"):
        ss.simulate(controlled(), (0.0, 1.0), parameters={"T": 0.0})


def test_a_controlled_carriage_in_a_map_and_its_derivatives() -> None:
    system = controlled(delay="T/4")
    found = ss.sweep(system, {"T": [0.01, 0.02]}, ["high:x"])
    for period, highest in zip([0.01, 0.02], found.dataset["high:x"].values, strict=True):
        motion = ss.simulate(system, (0.0, 100.0), parameters={"T": period})
        assert motion.outcome.ok and np.isfinite(highest)
    motion = ss.simulate(system, (0.0, 1.0))
    exact = motion.sensitivity(["m"], [1.0], of=["x"], second_opinion=True)
    ours, differences = (float(exact[n].values[0, 0]) for n in ("x", "x_by_differences"))
    assert ours == pytest.approx(differences, rel=1e-6)


SLIDER: dict[str, Any] = {
    "coordinates": {"x": ss.Inertial()},
    "kinetic": "d_x**2/2",
    "potential": "-u*x",
    "contacts": {"rail": ss.Contact("d_x", 0.3)},
}


def cascade(outer: float | str, inner: float | str, offset: float | str = 0.0) -> ss.System:
    """A fast loop of the speed within a slow one of the place."""
    internal = {
        "v": ss.Sampled(outer, "8*(1 - x)", offset=offset),
        "u": ss.Sampled(inner, "4*(v - d_x)"),
    }
    return ss.System("cascade", parameters={"T": 0.01}, internal=internal, **SLIDER)


def cascade_by_hand(outer: int, inner: int, offset: int, tick: float, count: int) -> list[float]:
    """Positions after each tick, with both loops in Python."""
    plain = ss.System("free", parameters={"u": 0.0}, **SLIDER)
    stepper = ss.Stepper(plain, inputs=["u"])
    v = u = 0.0
    found: list[float] = []
    for k in range(count):
        state = stepper.state
        before = v
        if k > 0 and (k - offset) % outer == 0:
            v = 8.0 * (1.0 - state["x"])
        if k > 0 and k % inner == 0:
            u = 4.0 * (before - state["d_x"])
        found.append(stepper.advance((k + 1) * tick, {"u": u})["x"])
    return found


@pytest.mark.parametrize(
    ("declared", "ticks"),
    [
        (("5*T", "T"), (5, 1, 0)),
        (("5*T", "T", "2*T"), (5, 1, 2)),
        ((0.05, 0.01), (5, 1, 0)),
        (("1.5*T", "T"), (3, 2, 0)),
        (("3*T", "T", "T/2"), (6, 2, 1)),
    ],
)
def test_several_rates(declared: tuple[Any, ...], ticks: tuple[int, int, int]) -> None:
    """Loops of several rates: what is sampled at the same time is computed from values before."""
    system = cascade(*declared)
    tick = 0.01 / ticks[1]
    motion = ss.simulate(system, (0.0, 1.0))
    assert motion.certificate.ok, motion.certificate.verdict
    times = np.arange(1, 1 + round(1.0 / tick)) * tick
    by_hand = cascade_by_hand(*ticks, tick, len(times))
    np.testing.assert_allclose(motion.at(times[:-1])["x"], by_hand[:-1], atol=1e-11)


def test_periods_whose_ratio_is_not_known() -> None:
    """Two parameters may have any ratio: where they meet, the remedy is said."""
    internal = {"v": ss.Sampled("S", "8*(1 - x)"), "u": ss.Sampled("T", "4*(v - d_x)")}
    parameters = {"T": 0.01, "S": 0.05}
    found = ss.simulate(
        ss.System("cascade", parameters=parameters, internal=internal, **SLIDER), (0.0, 1.0)
    )
    assert found.outcome is ss.Outcome.JUMPS_MEET and "10*T" in found.message
