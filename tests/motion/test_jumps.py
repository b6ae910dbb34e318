"""Declared jumps of the state: walkers, kicks and resets, and what has no order or no end."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad

import stickslip as ss
from stickslip.errors import DeclarationError
from stickslip.motion.outcome import Outcome

pytestmark = pytest.mark.usefixtures("flow")


def mass(
    *,
    potential: str = "0",
    contacts: dict[str, Any] | None = None,
    initial: dict[str, float] | None = None,
    **jumps: ss.Jump,
) -> ss.System:
    """A mass on a line, and what makes it jump."""
    return ss.System(
        name="mass",
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential=potential,
        contacts=contacts or {},
        jumps=jumps,
        initial=initial or {},
        span=(0.0, 3.0),
    )


def exchanges(found: ss.Trajectory) -> np.ndarray:
    """Knots after the jumps of a system with one guard."""
    return np.flatnonzero(np.append(False, found.switches.jumped[:, 0]))


# -- walkers ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(("alpha", "gamma"), [(0.3, 0.08), (0.4, 0.3), (0.2, 0.05)])
def test_the_rimless_wheel(alpha: float, gamma: float) -> None:
    """ω² → cos² 2α (ω² + 4 (g/l) sin α sin γ), in times that are quadratures."""
    g, length, m = 9.81, 0.7, 3.0
    wheel = ss.catalogue.rimless_wheel(alpha=alpha, gamma=gamma, g=g, l=length, m=m)
    start = {"theta": gamma - alpha, "d_theta": 2.5}
    found = ss.simulate(wheel, (0.0, 8.0), initial=start)
    assert found.certificate.ok, found.certificate
    k = found.knots
    after = exchanges(found)
    assert len(after) > 10
    assert_allclose(k.state[after, 0], gamma - alpha, rtol=1e-15)
    speeds, times = [2.5], [0.0]
    fed = 4 * g / length * np.sin(alpha) * np.sin(gamma)
    for _ in after:
        w = speeds[-1]

        def slowness(a: float, w: float = w) -> float:
            return float(1 / np.sqrt(w**2 + 2 * g / length * (np.cos(gamma - alpha) - np.cos(a))))

        times.append(times[-1] + quad(slowness, gamma - alpha, gamma + alpha, epsabs=1e-13)[0])
        speeds.append(np.cos(2 * alpha) * np.sqrt(w**2 + fed))
    assert_allclose(k.state[after, 1], speeds[1:], rtol=1e-11)
    assert_allclose(k.time[after], times[1:], rtol=1e-11)
    before = np.array(speeds[:-1]) ** 2 + fed
    change = m * length**2 / 2 * (np.array(speeds[1:]) ** 2 - before)
    change += 2 * m * g * length * np.sin(alpha) * np.sin(gamma)
    assert_allclose(found.jumps["energy_change"], change, atol=1e-11 * m * g * length)
    assert set(found.jumps["jump"]) == {"leg_exchange"}
    assert_allclose(found.jumps["time"], times[1:], rtol=1e-11)


def test_the_wheel_reaches_its_cycle() -> None:
    """Its rate and its multiplier are the facts of the declaration."""
    wheel = ss.catalogue.rimless_wheel()
    found = ss.simulate(wheel, (0.0, 120.0))
    speeds = found.knots.state[exchanges(found), 1]
    rate = wheel.evaluate("rate_after_exchange")
    assert speeds[-1] == pytest.approx(rate, rel=1e-11)
    off = speeds**2 - rate**2
    assert_allclose(off[1:10] / off[:9], wheel.evaluate("multiplier"), rtol=1e-9)
    # What an exchange loses, and what it lowers the foot by, balance there.
    assert abs(found.jumps["energy_change"].to_numpy()[-1]) < 1e-11


def test_energy_is_booked() -> None:
    """What jumps take is dissipated, what they give is supplied, and the balance closes."""
    found = ss.simulate(ss.catalogue.rimless_wheel(), (0.0, 10.0))
    data = found.dataset
    change = found.jumps["energy_change"].to_numpy()
    assert np.all(change < 0.0)
    assert data["dissipated_energy"].values[-1] == pytest.approx(-change.sum(), rel=1e-12)
    energy = data["energy"].values
    balance = energy - energy[0] + data["dissipated_energy"].values
    assert_allclose(balance - data["supplied_energy"].values, 0.0, atol=1e-12)
    slow = ss.simulate(ss.catalogue.rimless_wheel(), (0.0, 10.0), initial={"d_theta": 0.3})
    change = slow.jumps["energy_change"].to_numpy()
    assert np.all(change > 0.0) and slow.certificate.ok
    assert slow.dataset["supplied_energy"].values[-1] == pytest.approx(change.sum(), rel=1e-12)
    assert slow.dataset["dissipated_energy"].values[-1] == 0.0


def test_the_simplest_walker() -> None:
    """The long gait at γ = 0.009 of Garcia et al. (1998), to the digits they print."""
    walker = ss.catalogue.simplest_walker()
    theta, rate = 0.200310900, -0.199832473
    found = ss.simulate(
        walker,
        (0.0, 43 * 3.88246),
        initial={
            "theta": theta,
            "d_theta": rate,
            "phi": 2 * theta,
            "d_phi": (1 - np.cos(2 * theta)) * rate,
        },
    )
    assert found.certificate.ok, found.certificate
    after = exchanges(found)
    assert len(after) >= 42
    assert_allclose(found.knots.state[after[:5], :2], [[theta, rate]] * 5, atol=2e-8)
    assert_allclose(found.knots.state[after[40], :2], [theta, rate], atol=1e-9)
    assert_allclose(np.diff(found.knots.time[after])[-3:], 3.88246, atol=5e-6)
    # The swinging foot scuffs the ground in between, which is no heel strike.
    assert len(found.jumps) == len(after) < np.count_nonzero(found.knots.cause == 0)
    assert set(found.events["contact"]) == {"heel_strike"} and found.n_kinks == 0


def test_the_walker_is_stable() -> None:
    """A disturbance shrinks by the modulus of the multipliers −0.190 ± 0.558 i in a step."""
    walker = ss.catalogue.simplest_walker()
    span = (0.0, 30 * 3.88246)
    cycle = ss.simulate(walker, span)
    other = ss.simulate(walker, span, initial={"theta": 0.2004, "phi": 0.4008})
    steps = [found.knots.state[exchanges(found)[:25], :2] for found in (cycle, other)]
    off = (steps[1] - steps[0])[4:16] / 0.6 ** np.arange(12)[:, None]
    terms = np.column_stack([off[1:-1].ravel(), off[:-2].ravel()])
    (trace, minus), *_ = np.linalg.lstsq(terms, off[2:].ravel(), rcond=None)
    assert 0.6 * trace == pytest.approx(2 * -0.190, abs=2e-3)
    assert -0.36 * minus == pytest.approx(0.190**2 + 0.558**2, abs=2e-3)


# -- kicks -----------------------------------------------------------------------------------------


def kicked(damping: float = 0.1, kick: float = 1.0, **initial: float) -> ss.System:
    """An oscillator that is pushed where it passes its middle to the right: an escapement."""
    push = ss.Jump("x", {"d_x": f"d_x + {kick}"}, "rising")
    system = mass(potential="x**2/2", initial={"x": -1.0, **initial}, push=push)
    return replace(system, viscous=f"{damping}*d_x**2/2")


def test_an_escapement() -> None:
    """Closed form: the rate falls by exp(−cT) in a period, and rises by the kick."""
    damping = 0.1
    found = ss.simulate(kicked(damping), (0.0, 200.0))
    assert found.certificate.ok, found.certificate
    after = exchanges(found)
    assert np.all(found.knots.state[after, 0] == 0.0)
    period = 2 * np.pi / np.sqrt(1 - damping**2 / 4)
    speeds = [found.knots.state[after[0], 1]]
    for _ in after[1:]:
        speeds.append(np.exp(-damping / 2 * period) * speeds[-1] + 1.0)
    assert_allclose(found.knots.state[after, 1], speeds, rtol=1e-12)
    assert_allclose(np.diff(found.knots.time[after]), period, rtol=1e-12)
    assert_allclose(
        found.jumps["energy_change"], (np.array(speeds) ** 2 - (np.array(speeds) - 1) ** 2) / 2
    )


def test_both_flows_agree() -> None:
    """Closed forms hand over to a jump and take over after it; contacts stick and slip besides."""
    dry = replace(kicked(), contacts={"floor": ss.Contact("d_x", 0.15, 0.2, kinetic=0.1)})
    exact, taylor = (ss.simulate(dry, (0.0, 60.0), flow=flow) for flow in ("auto", "taylor"))
    assert exact.certificate.ok and taylor.certificate.ok
    assert len(exact.jumps) == len(taylor.jumps) > 5
    assert exact.n_switches == taylor.n_switches > 5
    assert_allclose(exact.jumps["time"], taylor.jumps["time"], rtol=1e-11)
    assert_allclose(exact.knots.state[-1], taylor.knots.state[-1], rtol=1e-9)


def test_all_at_once() -> None:
    """New values are of the state before: two parts change places."""
    system = ss.System(
        name="places",
        internal={"a": ss.Internal("1"), "b": ss.Internal("-2")},
        jumps={"swap": ss.Jump("a - 1", {"a": "b", "b": "a"}, "rising")},
        initial={"a": 0.0, "b": 0.5},
    )
    found = ss.simulate(system, (0.0, 1.5))
    assert_allclose(found.at([1.0])["a"], -1.5, rtol=1e-14)
    assert_allclose(found.at([1.0])["b"], 1.0, rtol=1e-14)
    assert_allclose(found.at([1.0], side="left")["a"], 1.0, rtol=1e-14)
    assert found.certificate.ok and len(found.jumps) == 1


@pytest.mark.parametrize("direction", ["rising", "falling", "both"])
def test_directions(direction: str) -> None:
    """A jump fires in its direction alone; numbers say the same as words."""
    sign = {"falling": -1, "both": 0, "rising": 1}[direction]
    count = ss.Jump("x", {"n": "n + 1"}, sign)  # type: ignore[arg-type]
    assert count == ss.Jump("x", {"n": "n + 1"}, direction)
    system = replace(
        mass(potential="x**2/2", initial={"x": 1.0}),
        internal={"n": ss.Internal("0")},
        jumps={"count": count},
    )
    found = ss.simulate(system, (0.0, 10 * np.pi + 0.1))
    assert found.final["n"] == (10 if direction == "both" else 5)
    assert_allclose(found.jumps["energy_change"], 0.0, atol=1e-14)


def test_a_clock() -> None:
    """Guards of time alone; a load of time may jump with them."""
    push = ss.Jump("sin(pi*t)", {"d_x": "-d_x"}, "rising")
    system = mass(potential="-x*heaviside(t - 2)", initial={"d_x": 1.0}, push=push)
    found = ss.simulate(system, (0.5, 5.0))
    assert found.certificate.ok, found.certificate
    assert_allclose(found.jumps["time"], [2.0, 4.0], rtol=1e-14)
    assert_allclose(found.knots.state[exchanges(found), 1], -1.0, rtol=1e-13)
    assert_allclose(found.at([3.0, 5.0])["d_x"], 0.0, atol=1e-13)


def test_a_guard_that_jumps() -> None:
    """What passes through zero because a load jumps fires, too."""
    push = ss.Jump("x - 1 + 2*heaviside(t - 1)", {"d_x": "3*d_x"}, "rising")
    found = ss.simulate(mass(initial={"d_x": 0.1}, push=push), (0.0, 2.0))
    assert found.certificate.ok
    assert_allclose(found.jumps["time"], [1.0])
    assert found.final["x"] == pytest.approx(0.4, rel=1e-13)


def test_with_an_event_of_a_contact() -> None:
    """A guard that passes through zero when something else fires."""
    lamp = ss.Jump("0.5 - t", {"n": "n + 1", "d_x": "-1"}, "falling")
    system = replace(
        mass(
            initial={"d_x": 1.0},
            contacts={"belt": ss.Contact("d_x", 2.0)},  # it stops at 0.5
        ),
        internal={"n": ss.Internal("0")},
        jumps={"lamp": lamp},
    )
    found = ss.simulate(system, (0.0, 2.0))
    assert found.certificate.ok, found.certificate
    assert found.final["n"] == 1.0
    assert_allclose(found.final["x"], 0.25 - 0.25, atol=1e-13)


def test_what_is_leapt_over_does_not_fire() -> None:
    """A jump, or an impact, crosses nothing; a motion that begins at zero neither."""
    over = ss.Jump("x - 1", {"x": "3"}, "rising")
    other = ss.Jump("x - 2", {"d_x": "0"}, "both")
    found = ss.simulate(mass(initial={"d_x": 1.0}, over=over, other=other), (0.0, 2.0))
    assert found.final == pytest.approx({"x": 4.0, "d_x": 1.0})
    assert list(found.jumps["jump"]) == ["over"] and found.certificate.ok
    start = ss.simulate(mass(initial={"x": 2.0, "d_x": 1.0}, other=other), (0.0, 2.0))
    assert start.final["x"] == pytest.approx(4.0) and len(start.jumps) == 0
    ball = mass(
        potential="9.81*x",
        contacts={"floor": ss.Unilateral("x", restitution=0.5)},
        initial={"x": 1.0},
        turn=ss.Jump("d_x - 1", {"x": "x + 1"}, "rising"),
    )
    bounced = ss.simulate(ball, (0.0, 0.6))
    assert len(bounced.impacts) == 1 and len(bounced.jumps) == 0


# -- jumps and impacts -----------------------------------------------------------------------------


def dropped(to: dict[str, str], e: float = 0.5) -> ss.System:
    """A ball in free flight that jumps at t = 1."""
    return mass(
        contacts={"floor": ss.Unilateral("x", restitution=e)},
        initial={"x": 5.0},
        fall=ss.Jump("t - 1", to, "rising"),
    )


def test_a_jump_then_an_impact() -> None:
    """At one time: the state jumps to the floor, and rebounds."""
    found = ss.simulate(dropped({"x": "0", "d_x": "-3"}), (0.0, 2.0))
    assert found.certificate.ok, found.certificate
    assert found.final == pytest.approx({"x": 1.5, "d_x": 1.5}, rel=1e-13)
    assert_allclose(found.jumps["energy_change"], 4.5)
    assert_allclose(found.impacts["energy"], 4.5 * 0.75)
    assert_allclose([found.jumps["time"][0], found.impacts["time"][0]], 1.0)
    assert found.dataset["supplied_energy"].values[-1] == pytest.approx(4.5)
    assert found.dataset["dissipated_energy"].values[-1] == pytest.approx(4.5 * 0.75)


def test_a_jump_into_the_floor() -> None:
    """No motion goes on from there."""
    found = ss.simulate(dropped({"x": "-1"}), (0.0, 2.0))
    assert found.outcome is Outcome.NO_MODE
    assert found.knots.time[-1] == pytest.approx(1.0, rel=1e-14)
    assert not found.certificate.ok


def test_many_jumps_with_impacts() -> None:
    """However the record is cut into pieces."""
    fall = ss.Jump("sin(pi*t)", {"x": "0", "d_x": "-2"}, "both")
    system = mass(
        contacts={"floor": ss.Unilateral("x", restitution=0.5)}, initial={"x": 1.0}, fall=fall
    )
    found = ss.simulate(system, (0.5, 1500.2))
    assert len(found.jumps) == len(found.impacts) == 1500
    assert found.final == pytest.approx({"x": 0.2, "d_x": 1.0}, rel=1e-10)
    assert found.certificate.ok


# -- ends ------------------------------------------------------------------------------------------


def test_a_ball_that_does_not_rebound() -> None:
    """It would jump for ever where it lies."""
    for e in ("0", "0.5"):
        bounce = ss.Jump("x", {"d_x": f"-{e}*d_x"}, "falling")
        ball = mass(potential="9.81*x", initial={"x": 1.0}, bounce=bounce)
        found = ss.simulate(ball, (0.0, 5.0))
        rest = np.sqrt(2 / 9.81) * (1 + float(e)) / (1 - float(e))
        assert found.outcome in (Outcome.JUMPS_ON, Outcome.ZENO)
        assert found.knots.time[-1] == pytest.approx(rest, rel=1e-9)
        assert not found.certificate.ok and found.certificate.lawful
        assert found.final["x"] == pytest.approx(0.0, abs=1e-9)
    assert ss.simulate(
        mass(potential="9.81*x", initial={"x": 1.0}, stop=ss.Jump("x", {"d_x": "0"}, "falling"))
    ).message.startswith("a jump ends in the guard of a jump (stop) at t = 0.45152364")


def test_a_jump_into_the_guard_of_another() -> None:
    """Named, with both or the one that is known."""
    there = ss.Jump("x - 1", {"x": "3"}, "rising")
    back = ss.Jump("x - 3", {"x": "0"}, "rising")
    found = ss.simulate(mass(initial={"d_x": 1.0}, there=there, back=back))
    assert found.outcome is Outcome.JUMPS_ON
    assert "(back) at t = 1:" in found.message
    # The other way it leaves the guard behind.
    away = ss.simulate(
        mass(initial={"d_x": 1.0}, there=there, back=replace(back, direction="falling"))
    )
    assert away.outcome is Outcome.FINISHED and away.final["x"] == pytest.approx(5.0)


def test_jumps_that_meet() -> None:
    """Two guards at once have no order, whichever is declared first."""
    left = ss.Jump("x - 1", {"d_x": "2*d_x"}, "rising")
    right = ss.Jump("1 - x**2", {"d_x": "d_x + 1"}, "falling")
    for jumps in ({"left": left, "right": right}, {"right": right, "left": left}):
        found = ss.simulate(replace(mass(initial={"d_x": 1.0}), jumps=jumps))
        assert found.outcome is Outcome.JUMPS_MEET
        assert found.knots.time[-1] == pytest.approx(1.0)
        assert found.final["d_x"] == 1.0
        assert all(name in found.message for name in jumps)
        assert len(found.jumps) == 0
    # One guard for each direction is in order.
    other = ss.Jump("x - 1", {"d_x": "-d_x"}, "falling")
    fine = ss.simulate(mass(initial={"d_x": 1.0}, left=left, other=other))
    assert fine.outcome is Outcome.FINISHED and fine.final["d_x"] == 2.0


def test_a_value_that_is_no_number() -> None:
    found = ss.simulate(mass(initial={"d_x": 1.0}, bad=ss.Jump("x - 1", {"x": "sqrt(0.5 - x)"})))
    assert found.outcome is Outcome.UNDEFINED
    assert found.knots.time[-1] == pytest.approx(1.0) and found.final["x"] == pytest.approx(1.0)


def test_a_limit_of_events() -> None:
    found = ss.simulate(ss.catalogue.rimless_wheel(), (0.0, 1000.0), max_events=7)
    assert found.outcome is Outcome.EVENT_LIMIT and len(found.jumps) == 6


# -- what is certified -----------------------------------------------------------------------------


@pytest.mark.parametrize("part", [0, 1])
def test_a_false_jump_is_seen(part: int) -> None:
    """The certificate takes each jump again."""
    found = ss.simulate(ss.catalogue.rimless_wheel(), (0.0, 6.0))
    state = found.knots.state.copy()
    last = exchanges(found)[-1]
    false = ss.simulate(
        found.system,
        (float(found.knots.time[last]), 6.0),
        initial={
            "theta": state[last, 0] + 1e-7 * (part == 0),
            "d_theta": state[last, 1] * (1.0 + 1e-7 * (part == 1)),
        },
    )
    assert false.certificate.ok
    k, tail = found.knots, false.knots
    joined = replace(
        k,
        clock=np.append(k.clock[:last], tail.time),
        state=np.vstack([state[:last], tail.state]),
        mode=np.vstack([k.mode[:last], tail.mode]),
        region=np.vstack([k.region[:last], tail.region]),
        cause=np.append(k.cause[: last + 1], tail.cause[1:]),
    )
    tampered = ss.Trajectory(found.problem, found.t_span, joined, found.outcome)
    assert not tampered.certificate.ok
    missing = replace(
        joined, cause=np.where(np.arange(len(joined.cause)) == last, -1, joined.cause)
    )
    assert not ss.Trajectory(found.problem, found.t_span, missing, found.outcome).certificate.ok


def test_stored(tmp_path: Path) -> None:
    """Files open again with their jumps, bit by bit."""
    found = ss.simulate(ss.catalogue.simplest_walker(), (0.0, 20.0))
    found.save(tmp_path / "w.nc")
    again: Any = ss.open(tmp_path / "w.nc")
    assert again.certificate.ok and again.system == found.system
    assert again.jumps.equals(found.jumps) and len(again.jumps) == 5


def test_pictures() -> None:
    found = ss.simulate(ss.catalogue.simplest_walker(), (0.0, 20.0))
    figure = found.plot()
    assert len(figure.axes) >= 3


# -- no unit, no origin, no company matters --------------------------------------------------------


def test_time_may_be_shifted() -> None:
    """Late as early, also where a jump counts its time from there."""
    push = ss.Jump("x", {"d_x": "d_x + 0.5*cos(t - T)"}, "rising")
    system = replace(
        kicked(),
        parameters={"T": ss.Parameter(0.0)},
        jumps={"push": push, "clock": ss.Jump("t - T - 7.3", {"x": "x/2"}, "rising")},
    )
    early, late = (
        ss.simulate(system, (start, start + 40.0), parameters={"T": start}) for start in (0.0, 2e6)
    )
    assert early.certificate.ok and late.certificate.ok
    assert len(early.jumps) == len(late.jumps) > 5
    assert_allclose(late.knots.state[-1], early.knots.state[-1], rtol=1e-8)


@pytest.mark.parametrize("unit", [1e-30, 1e30])
def test_units_do_not_matter(unit: float) -> None:
    """Lengths and masses in other units."""
    one = ss.simulate(ss.catalogue.rimless_wheel(), (0.0, 20.0))
    other = ss.simulate(ss.catalogue.rimless_wheel(m=unit, g=1.0 / unit, l=1.0 / unit), (0.0, 20.0))
    assert other.certificate.ok
    assert_allclose(other.jumps["time"], one.jumps["time"], rtol=1e-12)
    small = ss.simulate(
        mass(
            potential="x**2/2",
            initial={"x": -unit},
            push=ss.Jump("x", {"d_x": f"d_x + {unit}"}, "rising"),
        ),
        (0.0, 20.0),
    )
    assert small.certificate.ok and len(small.jumps) == 3
    assert small.knots.state[exchanges(small), 1] == pytest.approx(unit * np.arange(2, 5))


def test_ensembles_do_the_same() -> None:
    """Many motions at once have the same bits as one."""
    rates = [0.3, 0.5, 0.9]
    wheel = ss.catalogue.rimless_wheel()
    many = ss.simulate_many(wheel, (0.0, 30.0), initial={"d_theta": rates})
    for i, rate in enumerate(rates):
        one = ss.simulate(wheel, (0.0, 30.0), initial={"d_theta": rate})
        assert float(many["final_theta"][i]) == one.final["theta"]
        assert float(many["final_d_theta"][i]) == one.final["d_theta"]
    kicks = ss.simulate_many(kicked(), (0.0, 30.0), initial={"x": [-1.0, -0.3]})
    assert float(kicks["final_x"][0]) == pytest.approx(
        ss.simulate(kicked(), (0.0, 30.0)).final["x"], rel=1e-12
    )


# -- declarations ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("jump", "reason"),
    [
        (ss.Jump("x - z", {"x": 0}), "unknown name 'z'"),
        (ss.Jump("x", {"x": "z"}), "unknown name 'z'"),
        (ss.Jump("x", {"d_y": 1}), r"jumps.other.to.d_y: not a part of the state. Did you mean"),
        (ss.Jump("x", {}), "the jump has no new values"),
        (ss.Jump("k - 1", {"x": 0}), "neither on the state nor on time"),
        (ss.Jump("x", {"x": 0}, "up"), "expected a direction of zero crossing, got 'up'"),
        (ss.Jump("x", {"x": 0}, 2), "a direction of zero crossing"),  # type: ignore[arg-type]
        (ss.Jump("x", {"d_r": 1}), "has no inertia"),
        (ss.Jump("x", {"k": 1}), "not a part of the state"),
        (ss.Jump("x - 1", {"x": 0}, "both"), "the jump 'first' has the same guard"),
        (ss.Jump(["x"], {"x": 0}), "expected a formula"),  # type: ignore[arg-type]
        (ss.Jump("x", "x"), "expected a table"),  # type: ignore[arg-type]
    ],
)
def test_refused(jump: ss.Jump, reason: str) -> None:
    """What is wrong is named, with what would be right."""
    with pytest.raises(DeclarationError, match=reason):
        replace(
            mass(),
            parameters={"k": ss.Parameter(1.0)},
            coordinates={"x": ss.Inertial(), "r": ss.Viscous()},
            viscous="d_r**2/2",
            jumps={"first": ss.Jump("x - 1", {"x": 0}, "rising"), "other": jump},
        )


def test_a_shift_is_kept() -> None:
    """A translation of the system has to move its jumps, too."""
    back = ss.Jump("d_x", {"x": "x - 1"}, "rising")
    system = mass(potential="-x", initial={"d_x": -1.0}, back=back)
    assert replace(system, translation={"x": 1.0}).declaration
    for wrong in (replace(back, when="x - 5"), replace(back, to={"x": "0"})):
        with pytest.raises(DeclarationError, match=r"jumps\.back.*is not invariant"):
            replace(system, translation={"x": 1.0}, jumps={"back": wrong})


def test_units_are_compared() -> None:
    with pytest.warns(UserWarning, match="jumps.back.to.x"):
        ss.System(
            name="units",
            parameters={"v": ss.Parameter(1.0, "m/s"), "m": ss.Parameter(1.0, "kg")},
            coordinates={"x": ss.Inertial("m")},
            kinetic="m*d_x**2/2",
            jumps={"back": ss.Jump("x", {"x": "x - v"}, "rising")},
            time_unit="s",
        )


@pytest.mark.parametrize("name", ["rimless_wheel", "simplest_walker"])
def test_model_files(name: str, tmp_path: Path) -> None:
    """Without loss."""
    system = ss.catalogue.get(name)
    path = tmp_path / "model.toml"
    path.write_text(system.to_toml())
    assert ss.load(path) == system


def test_a_model_file() -> None:
    """As a table of TOML, too, and mistakes are named by their keys."""
    from stickslip.model.system_file import loads

    text = """
name = "ball"
coordinates.x = {kind = "inertial"}
kinetic = "d_x**2/2"
[jumps.bounce]
when = "x"
direction = "falling"
to = {d_x = "-0.5*d_x"}
"""
    assert loads(text).jumps["bounce"] == ss.Jump("x", {"d_x": "-0.5*d_x"}, "falling")
    for old, new, reason in (
        ('"falling"', '"down"', r"jumps.bounce.direction: .* got 'down'\. Write \"falling\""),
        ('when = "x"', "", "jumps.bounce.when: this key is missing"),
        ("to =", "too =", "jumps.bounce.too: unknown key"),
    ):
        with pytest.raises(DeclarationError, match=reason):
            loads(text.replace(old, new))


def test_equations() -> None:
    """As a person would write them."""
    shown = ss.catalogue.simplest_walker().equations()
    assert "heel_strike: where φ − 2 θ rises through 0" in str(shown)
    assert "θ → −θ, θ̇ → cos(2 θ) θ̇" in str(shown)
    assert r"\varphi - 2 \, \theta \nearrow 0" in shown.latex()
    assert r"\theta \to -\theta" in shown.latex()
    page = ss.catalogue.simplest_walker()._repr_html_()
    assert "rises through 0" in page and "<mo>→</mo>" in page


def pulled(when: str, direction: str = "rising") -> ss.System:
    """A block that is pulled, and one that slides on the floor; `n` counts the jumps."""
    return ss.System(
        "pulled",
        parameters={"V": ss.Parameter(0.3, "m/s"), "k": ss.Parameter(1.0, "N/m")},
        coordinates={x: ss.Inertial("m") for x in ("x", "s", "y")},
        internal={"n": ss.Internal(0.0)},
        kinetic="d_x**2/2 + d_s**2/2 + d_y**2/2",
        potential="k/2*(x - V*t)**2 + y",
        contacts={
            "rub": ss.Contact("d_x", 1.0, kinetic=0.6, unit="N"),
            "foot": ss.Unilateral("y", "d_s", mu=0.3),
        },
        outputs={
            "pull": ss.Output("k*(V*t - x)", "N"),
            "stored": "energy + pull",
            "lost": "friction_rub*d_x",
            "press": "normal_foot",
        },
        jumps={"count": ss.Jump(when, {"n": "n + 1"}, direction)},
        initial={"d_s": 1.0, "y": 0.2},
        time_unit="s",
        span=(0.0, 20.0),
    )


@pytest.mark.parametrize(
    ("shown", "written"),
    [
        ("pull - 0.5", "k*(V*t - x) - 0.5"),
        ("slip_speed_rub - 0.1", "d_x - 0.1"),
        ("slip_speed_foot - 0.5", "d_s - 0.5"),
        ("0.1 - gap_foot", "0.1 - y"),
        ("pull - threshold_plus_rub/2", "k*(V*t - x) - 0.5"),
        (
            "stored - 1",
            "k/2*(x - V*t)**2 + y + d_x**2/2 + d_s**2/2 + d_y**2/2 + k*(V*t - x) - 1",
        ),
    ],
)
def test_guards_of_what_the_state_says(shown: str, written: str) -> None:
    """An output, or what results show of a contact, is what it is made of."""
    way = "falling" if shown.startswith("slip_speed_foot") else "rising"
    here, there = (ss.simulate(pulled(guard, way)) for guard in (shown, written))
    assert here.certificate.ok and here.final["n"] >= 1.0
    assert here.jumps.equals(there.jumps) and here.final == there.final
    name, _, level = shown.rpartition(" - ")
    if name in here.system.outputs and "/" not in level:
        crossed = here.at(here.jumps["time"].to_numpy())[name]
        assert_allclose(crossed, float(level), atol=1e-11)


@pytest.mark.parametrize(
    ("when", "said"),
    [
        ("friction_rub + 0.5", "'friction_rub' is not allowed here. It depends on the forces"),
        ("normal_foot - 0.5", "'normal_foot' is not allowed here. It depends on the forces"),
        ("dd_x", "Write the force of a spring in series"),
        ("lost + 0.1", "when: it uses the output 'lost', in which 'friction_rub' is not allowed"),
        ("press - 0.5", "when: it uses the output 'press', in which 'normal_foot' is not allowed"),
        ("dissipated_energy - 1", "declare an internal variable with its power as law"),
        ("mode_rub - 0.5", "A mode does not cross zero"),
    ],
)
def test_guards_of_forces_are_refused(when: str, said: str) -> None:
    with pytest.raises(ss.DeclarationError) as error:
        pulled(when)
    assert str(error.value).startswith("jumps.count.when: ") and said in str(error.value)


def test_new_values_of_forces_are_refused() -> None:
    """They are formulas of the state before, as guards are."""
    with pytest.raises(ss.DeclarationError, match="'lost', in which 'friction_rub'"):
        replace(pulled("x - 1"), jumps={"count": ss.Jump("x - 1", {"n": "lost"})})
