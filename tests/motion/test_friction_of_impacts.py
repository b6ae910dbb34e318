"""Friction in impacts where static friction is above kinetic, against floors that are elastic.

A body with a tip has M = diag(m, m, I), the gap y + a φ and the velocity ẋ + b φ̇ along the floor.
Without other forces an elastic floor gives the same impulses however stiff it is.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.arrays import Array

STIFF = 1e4
NAMES = ("x", "y", "phi")
BODY = ss.System(
    "body with a tip",
    parameters={name: ss.Parameter(1.0) for name in ("m", "I", "a", "b", "s", "k", "F")},
    coordinates={x: ss.Inertial() for x in NAMES},
    kinetic="m/2*(d_x**2 + d_y**2) + I/2*d_phi**2",
    potential="F*y",
    contacts={
        "floor": ss.Unilateral("y + a*phi", restitution=1.0),
        "tip": ss.Contact("d_x + b*d_phi", "s*normal_floor", kinetic="k*normal_floor"),
    },
    span=(0.0, 0.1),
)


def drawn(rng: np.random.Generator, coupled: bool) -> tuple[dict[str, float], Array]:
    """Parameters, and velocities before the impact."""
    n = {"m": rng.uniform(0.5, 2.0), "I": rng.uniform(0.2, 2.0), "b": rng.uniform(0.2, 1.0)}
    n |= {"a": rng.uniform(-1.0, 1.0) * coupled, "k": rng.uniform(0.05, 0.4), "F": 0.0}
    n["s"] = n["k"] * rng.uniform(1.3, 3.0)
    v = np.array([rng.uniform(-2.0, 2.0), 0.0, rng.uniform(-0.5, 0.5)])
    v[1] = -abs(n["a"] * v[2]) - rng.uniform(0.5, 2.0)
    return n, v


def bounced(n: dict[str, float], v: Array) -> Array:
    """Velocities after the impact of the library."""
    start = {f"d_{x}": float(value) for x, value in zip(NAMES, v, strict=True)}
    motion = ss.simulate(BODY, parameters=n, initial=start)
    assert motion.certificate.ok, motion.message
    return np.array([motion.final[f"d_{x}"] for x in NAMES])


def on_springs(n: dict[str, float], v: Array) -> tuple[Array, list[float]]:
    """Velocities after an elastic floor, and in which senses it slips: with kinetic friction, from
    rest where static friction does not hold, until it stops."""
    M = np.array([n["m"], n["m"], n["I"]])
    up, along = np.array([0.0, 1.0, n["a"]]), np.array([1.0, 0.0, n["b"]])
    asked = float(up / M @ along) / float(along / M @ along)  # of a unit of the normal force
    pulled = float(np.sign(asked)) if abs(asked) > n["s"] else 0.0

    def rates(t: float, z: Array, sense: float) -> Array:
        N = STIFF * max(-float(up @ z[:3]), 0.0)
        T = -sense * n["k"] * N if sense else -asked * N
        return np.concatenate([z[3:], (up * N + along * T) / M])

    def leaves(t: float, z: Array, sense: float) -> float:
        return float(up @ z[:3]) if t > 0.0 else -1.0

    def stops(t: float, z: Array, sense: float) -> float:
        return sense * float(along @ z[3:])

    leaves.terminal = stops.terminal = True  # type: ignore[attr-defined]
    leaves.direction, stops.direction = 1.0, -1.0  # type: ignore[attr-defined]
    u = float(along @ v)
    senses = [float(np.sign(u)) if abs(u) > 1e-12 else pulled]
    t, z = 0.0, np.concatenate([np.zeros(3), v])
    for _ in range(3):
        watched = (leaves, stops) if senses[-1] * u > 1e-12 else (leaves,)
        options = {"rtol": 1e-10, "atol": 1e-12, "max_step": 0.2 / np.sqrt(STIFF)}
        found = solve_ivp(rates, (t, t + 1.0), z, args=(senses[-1],), events=watched, **options)
        t, z, u = float(found.t[-1]), found.y[:, -1], 0.0
        if len(found.t_events[0]):
            return z[3:], senses
        senses.append(pulled)
    raise AssertionError("the impact does not end")


@pytest.mark.parametrize("coupled", [False, True])
def test_sliding_through_an_impact(coupled: bool) -> None:
    """Kinetic friction where it slides on, and where it stops."""
    rng = np.random.default_rng(coupled)
    seen = {1: 0, 2: 0}
    for _ in range(24):
        n, v = drawn(rng, coupled)
        after, senses = on_springs(n, v)
        if len(senses) == 1 or not coupled:  # else one impulse cannot say what happens in turn
            np.testing.assert_allclose(bounced(n, v), after, atol=1e-7)
            seen[len(senses)] += 1
    assert seen[1] >= 6 and (coupled or seen[2] >= 6)


def test_at_rest_before_an_impact() -> None:
    """Static friction holds, or kinetic friction lets it slip."""
    rng = np.random.default_rng(5)
    seen = set()
    for _ in range(24):
        n, v = drawn(rng, True)
        v[0] = -n["b"] * v[2]
        after, senses = on_springs(n, v)
        np.testing.assert_allclose(bounced(n, v), after, atol=1e-7)
        seen.add(abs(senses[0]))
    assert seen == {0.0, 1.0}


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_each_way_has_its_own_friction(sense: float) -> None:
    """Kinetic friction that depends on the way and on the speed before."""
    block = ss.System(
        "block",
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        contacts={
            "floor": ss.Unilateral("y", restitution=0.5),
            "pad": ss.Contact(
                "d_x",
                "0.5*normal_floor",
                kinetic=("(0.1 + 0.1/(1 + speed))*normal_floor", "0.3*normal_floor"),
            ),
        },
        initial={"d_x": 4.0 * sense, "d_y": -2.0},
        span=(0.0, 1e-3),
    )
    motion = ss.simulate(block)
    mu = 0.12 if sense > 0 else 0.3
    assert motion.certificate.ok
    assert motion.final["d_x"] == pytest.approx(sense * (4.0 - mu * 3.0), rel=1e-12)


def test_sliding_through_an_impact_in_a_plane() -> None:
    """The disc of a slip that goes on is the kinetic one, that of what holds the static one."""
    block = ss.System(
        "block",
        coordinates={"x": ss.Inertial(), "y": ss.Inertial(), "z": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2 + d_z**2)/2",
        contacts={
            "floor": ss.Unilateral("z", restitution=1.0),
            "pad": ss.Contact(("d_x", "d_y"), "0.5*normal_floor", kinetic="0.2*normal_floor"),
        },
        initial={"d_x": 3.0, "d_y": 4.0, "d_z": -1.0},
        span=(0.0, 1e-3),
    )
    motion = ss.simulate(block)
    assert motion.certificate.ok
    found = motion.final["d_x"], motion.final["d_y"]
    assert found == pytest.approx((3.0 * (1 - 0.08), 4.0 * (1 - 0.08)), rel=1e-12)
