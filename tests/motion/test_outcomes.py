"""Every named end of a computation, and that what was computed until then is kept."""

import math

import numpy as np
import pytest

from stickslip import (
    Contact,
    DeclarationError,
    Inertial,
    Outcome,
    RateIndependent,
    System,
    Trajectory,
    catalogue,
    simulate,
)
from systems import VARIABLE, distance, ode, on_grid, oscillator, parameters, play, switches

pytestmark = pytest.mark.usefixtures("flow")


def stopped(motion: Trajectory, outcome: Outcome, time: float, within: float = 1e-12) -> None:
    """The motion has ended so, at this time, and obeys its law until then."""
    assert motion.outcome is outcome
    assert not motion.outcome.ok
    assert motion.knots.time[-1] == pytest.approx(time, abs=within)
    assert not motion.certificate.ok
    assert motion.certificate.lawful, motion.certificate.verdict
    assert motion.outcome.label in motion.message
    assert f"t = {motion.knots.time[-1]:.9g}" in motion.message
    assert np.all(np.isfinite(motion.knots.state))


def test_finished() -> None:
    motion = simulate(oscillator(), (0.0, 14.0))
    assert motion.outcome is Outcome.FINISHED
    assert motion.outcome.ok
    assert motion.knots.time[-1] == 14.0
    assert motion.message == Outcome.FINISHED.message


def test_every_outcome_has_its_own_code_and_words() -> None:
    assert (
        len({outcome.code for outcome in Outcome})
        == len({outcome.label for outcome in Outcome})
        == len(Outcome)
    )
    for outcome in Outcome:
        assert Outcome.from_code(outcome.code) is outcome
        assert outcome.message


# --- No bounded rate ------------------------------------------------------------------------------


def test_no_bounded_rate_where_the_energy_loses_convexity() -> None:
    # Φ = (z − t)²/4 − cos z: the sliding branch turns at cos z = −1/2.
    system = System(
        name="rate-independent tip",
        parameters=parameters(k=0.5, mu=0.2),
        coordinates={"z": RateIndependent()},
        potential="k/2*(z - t)**2 - cos(z)",
        contacts={"ground": Contact("d_z", "mu")},
    )
    motion = simulate(system, (0.0, 20.0))
    turn = 2 * math.pi / 3
    stopped(motion, Outcome.NO_BOUNDED_RATE, turn + (math.sin(turn) + 0.2) / 0.5)
    assert motion.final["z"] == pytest.approx(turn, abs=1e-6)
    assert motion.n_switches == 1
    # Until then it slides in balance.
    t = on_grid(motion)[50:]
    z = motion.at(t)["z"]
    assert distance(0.5 * (t - z) - np.sin(z), 0.2) < 1e-12
    # A stiffer spring has no such turn.
    assert simulate(system, (0.0, 20.0), parameters={"k": 1.1}).outcome.ok


def test_no_bounded_rate_when_the_load_frees_the_whole_toy() -> None:
    # P = ρ + H*/2 is more than both legs hold; before that the toy just stands, as nothing rocks
    # it.
    toy = catalogue.rocking_toy()
    pulled = System(
        name="toy under a growing pull",
        parameters=toy.parameters,
        functions=toy.functions,
        coordinates=toy.coordinates,
        kinetic=toy.kinetic,
        potential="a/2*(x_R - x_L)**2 + b/2*psi**2 - c*(x_R - x_L)*psi - P*t*(x_R + x_L)",
        viscous=toy.viscous,
        contacts=toy.contacts,
    )
    motion = simulate(pulled, (0.0, 3.0))
    stopped(motion, Outcome.NO_BOUNDED_RATE, 1.7)
    assert motion.final == {"psi": 0.0, "d_psi": 0.0, "x_R": 0.0, "x_L": 0.0}


def test_no_bounded_rate_keeps_the_motion_before() -> None:
    load = {"phi": -math.pi / 2, "F": 1.5, "jump": -0.9}
    motion = simulate(play(VARIABLE), (0.0, 5.0), initial={}, parameters=load)
    stopped(motion, Outcome.NO_BOUNDED_RATE, 1.0)
    assert switches(motion)["time"].tolist() == pytest.approx([math.asin(2 / 3)], abs=1e-14)
    assert motion.final["x"] == pytest.approx(1.5 * math.sin(1.0) - 1.0, abs=1e-14)


@pytest.mark.parametrize(("x_R", "leg"), [(3.0, "right leg"), (-3.0, "right leg|left leg")])
def test_unstable_start_is_refused(x_R: float, leg: str) -> None:
    with pytest.raises(
        DeclarationError, match=f"initial.x_[RL]: the contact '({leg})' would have to hold"
    ):
        simulate(catalogue.rocking_toy(), (0.0, 1.0), initial={"psi": 0.0, "x_R": x_R})


# --- Sliding on a jump ----------------------------------------------------------------------------


def test_sliding_on_a_jump() -> None:
    system = ode("pushed to zero", x="piecewise(x > 0, -1, 1)")
    stopped(simulate(system, (0.0, 10.0), initial={"x": 2.0}), Outcome.SLIDING_ON_A_JUMP, 2.0)
    stopped(simulate(system, (0.0, 10.0), initial={"x": -3.0}), Outcome.SLIDING_ON_A_JUMP, 3.0)
    stopped(simulate(system, (0.0, 10.0), initial={"x": 0.0}), Outcome.SLIDING_ON_A_JUMP, 0.0)


def test_crossing_and_leaving_a_jump_is_no_sliding() -> None:
    away = simulate(
        ode("pushed from zero", x="piecewise(x > 0, 1, -1)"), (0.0, 10.0), initial={"x": 0.0}
    )
    assert away.outcome.ok
    assert abs(away.final["x"]) == pytest.approx(10.0)
    across = simulate(
        ode("faster above", x="piecewise(x > 0, 2, 1)"), (0.0, 3.0), initial={"x": -1.0}
    )
    assert across.outcome.ok
    assert across.final["x"] == pytest.approx(4.0, abs=1e-14)
    assert across.n_kinks == 1


def test_oscillator_that_slides_along_its_jump() -> None:
    # Section 4.4: with a jump in ψ' larger than the other forces the motion sticks to ψ' = 0
    # without a contact.
    motion = simulate(catalogue.rocking_oscillator(c=-0.3), (0.0, 63.0), initial={"psi": 0.1})
    assert motion.outcome is Outcome.SLIDING_ON_A_JUMP
    assert motion.certificate.lawful
    assert motion.final["d_psi"] == pytest.approx(0.0, abs=1e-12)


# --- Zeno, step too small, undefined --------------------------------------------------------------

SIGNS = {"sign_x": "piecewise(x > 0, 1, -1)", "sign_y": "piecewise(y > 0, 1, -1)"}


def test_zeno(flow: str) -> None:
    # Filippov's example: each turn shrinks by 3^4, each quarter by 3; from (1, 0) the origin is
    # reached at t = 1/2.
    system = ode("spiral into zero", SIGNS, x="-sign_x + 2*sign_y", y="-2*sign_x - sign_y")
    motion = simulate(system, (0.0, 10.0), initial={"x": 1.0, "y": 0.0})
    # Taylor steps know the switches to the rounding of a whole step; closer to zero both jumps are
    # met at once.
    last = Outcome.ZENO if flow == "closed forms" else Outcome.SLIDING_ON_A_JUMP
    assert motion.outcome is last
    assert motion.knots.time[-1] == pytest.approx(0.5, abs=1e-12)
    assert motion.n_kinks > 20
    assert distance([motion.final["x"], motion.final["y"]], 0.0) < 1e-11
    # The turns before are kept: |x| + |y| falls linearly.
    values = motion.at(np.linspace(0.0, 0.49, 50))
    assert motion.at(1 / 3)["x"] == pytest.approx(0.0, abs=1e-14)
    assert values["energy"].shape == (50,)


@pytest.mark.parametrize("sign", [1, -1])
def test_many_events_are_not_zeno(sign: int) -> None:
    # Contracts, but exponentially in time.
    motion = simulate(
        oscillator(), (0.0, 20_000.0), initial={"x": 0.1 * sign}, parameters={"mu": 0.1}
    )
    assert motion.n_switches > 5000
    assert motion.outcome is Outcome.FINISHED


@pytest.mark.parametrize(
    ("law", "start", "end"),
    [("x**2", 1.0, 1.0), ("x**3", 1.0, 0.5), ("1 + x**2", 0.0, math.pi / 2)],
)
def test_blow_up(law: str, start: float, end: float) -> None:
    motion = simulate(ode(f"blow-up {law}", x=law), (0.0, 10.0), initial={"x": start})
    assert motion.outcome is Outcome.STEP_TOO_SMALL
    assert motion.knots.time[-1] == pytest.approx(end, abs=1e-9)
    assert np.all(np.isfinite(motion.knots.state))
    # Until shortly before the end it is as accurate as ever.
    t = np.linspace(0.0, 0.99 * end, 50)
    exact = {
        "x**2": lambda: 1 / (1 - t),
        "x**3": lambda: 1 / np.sqrt(1 - 2 * t),
        "1 + x**2": lambda: np.tan(t),
    }[law]()
    np.testing.assert_allclose(motion.at(t)["x"], exact, rtol=1e-10, atol=1e-14)


def test_undefined_at_the_start() -> None:
    motion = simulate(ode("logarithm", x="log(x)"), (0.0, 10.0), initial={"x": -1.0})
    assert motion.outcome is Outcome.UNDEFINED
    assert motion.knots.time.tolist() == [0.0]
    assert motion.final == {"x": -1.0}


def test_undefined_where_a_logarithm_ends() -> None:
    # x falls through 0, where log(x) ends.
    motion = simulate(
        ode("falling into a logarithm", x="-1 + log(x)/1000"), (0.0, 10.0), initial={"x": 2.0}
    )
    assert motion.outcome in (Outcome.UNDEFINED, Outcome.STEP_TOO_SMALL)
    assert motion.knots.time[-1] == pytest.approx(2.0, abs=1e-2)
    assert np.all(np.isfinite(motion.knots.state))
    assert motion.final["x"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("law", "outcome", "x"), [
    ("sqrt(1 - t)", Outcome.UNDEFINED, 5 / 3),
    ("log(1 - t)", Outcome.STEP_TOO_SMALL, 0.0),  # without bound on the way to where it ends
])  # fmt: skip
def test_undefined_after_a_time(law: str, outcome: Outcome, x: float) -> None:
    motion = simulate(ode(f"until 1, {law}", x=law), (0.0, 10.0), initial={"x": 1.0})
    stopped(motion, outcome, 1.0, within=1e-6)
    assert motion.final["x"] == pytest.approx(x, abs=1e-6)


def test_root_that_is_an_exact_polynomial() -> None:
    # x = (1 − t/2)² until it is 0; the polynomial goes on, the motion does not.
    motion = simulate(ode("draining", x="-sqrt(x)"), (0.0, 10.0), initial={"x": 1.0})
    assert not (motion.outcome.ok and motion.certificate.ok)


# --- Limits ---------------------------------------------------------------------------------------


def test_limit_on_events() -> None:
    motion = simulate(oscillator(), (0.0, 100.0), max_events=3)
    whole = simulate(oscillator(), (0.0, 100.0))
    stopped(motion, Outcome.EVENT_LIMIT, switches(whole)["time"].tolist()[2])
    t = on_grid(motion)
    assert distance(motion.at(t)["x"], whole.at(t)["x"]) < 1e-14


def test_limit_on_events_has_to_be_positive() -> None:
    with pytest.raises(DeclarationError, match="max_events"):
        simulate(oscillator(), (0.0, 1.0), max_events=0)


def falling(threshold: str) -> System:
    """A mass under the constant force 2."""
    return System(
        name=f"threshold {threshold}",
        parameters=parameters(s=1.0),
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="-2*x",
        contacts={"ground": Contact("d_x", threshold)},
        span=(0.0, 1.0),
    )


def test_threshold_negative_in_time() -> None:
    # s = 1 − t is positive for all of the declared span, but not beyond it.
    motion = simulate(falling("s - t"), (0.0, 5.0))
    stopped(motion, Outcome.NEGATIVE_THRESHOLD, 1.0)
    assert motion.final["d_x"] == pytest.approx(1.5, abs=1e-14)


def test_threshold_negative_in_state() -> None:
    # x'' = 1 + x until x = 1.
    motion = simulate(falling("s - x"), (0.0, 10.0))
    stopped(motion, Outcome.NEGATIVE_THRESHOLD, math.acosh(2.0))
    assert motion.final["x"] == pytest.approx(1.0, abs=1e-14)
    start = simulate(falling("s - x"), (0.0, 10.0), initial={"x": 2.0})
    assert start.outcome is Outcome.NEGATIVE_THRESHOLD
    assert start.knots.time.tolist() == [0.0]


def test_interrupted_by_the_user() -> None:
    def interrupt(fraction: float) -> None:
        if fraction > 0.01:
            raise KeyboardInterrupt

    motion = simulate(oscillator(), (0.0, 1e5), progress=interrupt)
    assert motion.outcome is Outcome.INTERRUPTED
    assert 1e3 < motion.knots.time[-1] < 1e5
    assert motion.certificate.lawful
    assert motion.n_switches > 100


@pytest.mark.parametrize("k", [1e9, 1e11])
def test_slips_of_a_very_stiff_spring_are_followed(k: float) -> None:
    """One of them lasts ten microseconds, and is no end of the motion."""
    stiff = System(
        "stiff",
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential=f"{k}/2*(x - 0.1*t)**2",
        contacts={"pad": Contact("d_x", 1.0, kinetic=0.6)},
        span=(0.0, 20.0),
    )
    motion = simulate(stiff, max_events=100)
    assert motion.outcome is Outcome.EVENT_LIMIT
    assert motion.certificate.lawful
