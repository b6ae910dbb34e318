"""Contacts that open from rest, and where nothing but rounding errors moves: their velocities are
zero until then, whatever rounding has made of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.arrays import Array
from stickslip.motion.trajectory import Trajectory

PUSHED = ss.System(
    "masses that push each other, and a wall",
    parameters={name: ss.Parameter(1.0) for name in ("m", "n", "k", "h", "F", "omega", "a")},
    coordinates={"x": ss.Inertial(force="F*cos(omega*t)"), "y": ss.Inertial()},
    kinetic="m/2*d_x**2 + n/2*d_y**2",
    potential="k/2*x**2 + h/2*y**2",
    contacts={"each other": ss.Unilateral("y - x + a"), "wall": ss.Unilateral("a - y")},
    span=(0.0, 10.0),
)
IN_TURN = replace(PUSHED, impacts="in turn")


def pushed(rng: np.random.Generator, system: ss.System) -> Trajectory:
    """A random motion of the two masses."""
    values = {name: rng.uniform(0.5, 2.0) for name in ("m", "n", "k", "h", "F", "omega")}
    values["a"] = rng.uniform(0.0, 0.5)
    start = {"d_x": rng.uniform(-1.0, 1.0), "d_y": rng.uniform(-1.0, 1.0)}
    return ss.simulate(system, parameters=values, initial=start)


def with_knots(motion: Trajectory, **arrays: Array) -> Trajectory:
    """A motion with other knots."""
    knots = replace(motion.knots, **arrays)
    return Trajectory(motion.problem, motion.t_span, knots, motion.outcome, motion.rtol)


def carts(count: int) -> ss.System:
    """Carts between two stops without restitution, each with a pendulum."""
    numbers = range(count)
    swings = "d_x{i}**2 + 2*l*d_x{i}*d_phi{i}*cos(phi{i}) + l**2*d_phi{i}**2"
    one = f"M/2*d_x{{i}}**2 + m/2*({swings})"
    stops = {}
    for i in numbers:
        stops |= {f"left{i}": ss.Unilateral(f"x{i} + a"), f"right{i}": ss.Unilateral(f"a - x{i}")}
    return ss.System(
        "carts",
        parameters={name: ss.Parameter(1.0) for name in ("M", "m", "l", "a")},
        coordinates={f"{q}{i}": ss.Inertial() for i in numbers for q in ("x", "phi")},
        kinetic=" + ".join(one.format(i=i) for i in numbers),
        potential=" + ".join(f"-9.81*m*l*cos(phi{i})" for i in numbers),
        contacts=stops,
        span=(0.0, 4.0),
    )


@pytest.mark.parametrize("count", [1, 2, 3])
def test_all_forces_vanish_where_a_cart_leaves_its_stop(count: int) -> None:
    """It does so when its pendulum hangs down, where no force is left beside which a rounding error
    is small; carts that are alike leave theirs together."""
    system = carts(count)
    rng = np.random.default_rng(1)
    left = 0
    for _ in range(10 if count < 3 else 45):
        values = {name: rng.uniform(0.3, 2.0) for name in "Mml"} | {"a": rng.uniform(0.02, 0.3)}
        phi, speed = rng.uniform(-1.2, 1.2), rng.uniform(-2.0, 2.0)
        start = {f"phi{i}": phi if i < 2 else -phi for i in range(count)}
        start |= {f"d_phi{i}": speed if i < 2 else -speed for i in range(count)}
        motion = ss.simulate(system, parameters=values, initial=start)
        assert motion.outcome.ok and motion.certificate.ok, (motion, motion.certificate, values)
        events = motion.events
        opened = events[events["to"] == "open"]
        left += len(opened)
        for i in range(count):
            assert np.all(np.abs(opened[f"phi{i}"]) < 1e-9)
    assert left > 10 * count


def test_opening_from_rest_where_impacts_come_in_turn() -> None:
    """What opens from rest has no impact, of which the audit asks which came first."""
    rng = np.random.default_rng(0)
    opened = 0
    for _ in range(20):
        motion = pushed(rng, IN_TURN)
        assert motion.outcome.ok and motion.certificate.ok, motion.certificate
        from_rest = (motion.events["from"] == "closed") & (motion.events["to"] == "open")
        opened += int(np.sum(from_rest))
        # the same record with jumps that no impacts explain
        for knot in np.flatnonzero(motion.knots.cause >= 0):
            state = motion.knots.state.copy()
            state[knot, 2:] += 1e-7 * rng.choice([-1.0, 1.0], 2)
            assert not with_knots(motion, state=state).certificate.ok
    assert opened > 20


@pytest.mark.parametrize(("scale", "right"), [(1.0, True), (1e12, False)])
def test_an_impact_of_rounding_errors(scale: float, right: bool) -> None:
    """Where all is at rest, an impact that changes rounding errors of the velocities may create
    energy, beside theirs; one that changes velocities may not."""
    values = {"m": 1.4076196918169912, "n": 1.4991706620229643, "k": 0.7337384446988211}
    values |= {"h": 1.3971889296361906, "F": 1.9999056180104884, "omega": 1.0631211765646307}
    values |= {"a": 0.2952437530767488}
    start = {"d_x": -0.23351401468486732, "d_y": -0.9970472315629852}
    damped = replace(PUSHED, viscous="0.02*d_x**2")
    motion = ss.simulate(damped, parameters=values, initial=start)
    assert motion.certificate.ok, motion.certificate
    events: Any = motion.events
    wall = (events["contact"] == "wall") & (events["to"] == "open")
    at = int(np.searchsorted(motion.knots.time, float(events["time"][wall].iloc[0])))
    fields = {
        name: np.insert(getattr(motion.knots, name), at, getattr(motion.knots, name)[at], axis=0)
        for name in ("clock", "state", "mode", "region", "cause")
    }
    fields["state"][at, 2:] = scale * np.array([-1.5410755543465322e-18, 5.5927137221765937e-20])
    fields["state"][at + 1, 2:] = scale * -7.462692636262274e-19
    assert with_knots(motion, **fields).certificate.ok == right
