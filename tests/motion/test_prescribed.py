"""Friction between motions that are given: a force and a work, by quadrature."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

import stickslip as ss
from stickslip.model.system_file import loads


def driven(
    contact: ss.Contact | ss.Unilateral,
    drives: dict[str, str] | None = None,
    force: str = "0",
    span: tuple[float, float] = (0.0, 12.0),
    **others: ss.Contact,
) -> ss.System:
    """A mass on a spring, beside which something rubs."""
    return ss.System(
        "driven",
        drives=drives or {},
        coordinates={"y": ss.Inertial(force=force)},
        kinetic="d_y**2/2",
        potential="(y - 1)**2/2",
        viscous="d_y**2/20",
        contacts={"pad": contact, **others},
        initial={"y": 0.5},
        span=span,
    )


def integral(f: Callable[[float], float], stop: float, corners: list[float]) -> float:
    inner = [t for t in sorted(corners) if 0.0 < t < stop]
    edges = [0.0, *inner, stop]
    return sum(quad(f, a, b, epsabs=1e-13, epsrel=1e-13, limit=200)[0] for a, b in pairwise(edges))


def dissipated(motion: ss.Trajectory) -> float:
    return float(motion.dataset.dissipated_energy[-1])


def test_an_imposed_displacement_dissipates_the_integral_of_its_force() -> None:
    rng = np.random.default_rng(3)
    for _ in range(10):
        A, w, p = rng.uniform(0.3, 3.0, 3)
        s, b = rng.uniform(1.0, 2.0), rng.uniform(0.0, 0.9)
        zeros = [(np.pi / 2 + k * np.pi - p) / w for k in range(-5, 20)]
        zeros = [t for t in zeros if 0.0 < t < 12.0]
        motion = ss.simulate(
            driven(ss.Contact("d_xi", f"{s} + {b}*sin(t)"), {"xi": f"{A}*sin({w}*t + {p})"})
        )
        assert motion.certificate.ok
        assert motion.events["time"].tolist() == pytest.approx(zeros, rel=1e-12)
        t = rng.uniform(0.0, 12.0, 20)
        u = A * w * np.cos(w * t + p)
        found = motion.at(np.sort(t))
        order = np.argsort(t)
        assert found["slip_speed_pad"] == pytest.approx(u[order], abs=1e-12)
        force = -np.sign(u) * (s + b * np.sin(t))
        assert found["friction_pad"] == pytest.approx(force[order], rel=1e-12)
        work = integral(
            lambda t, s=s, b=b, A=A, w=w, p=p: (s + b * np.sin(t)) * abs(A * w * np.cos(w * t + p)),
            12.0,
            zeros,
        )
        supplied = float(motion.dataset.supplied_energy[-1])
        total = float(motion.dataset.energy[-1] - motion.dataset.energy[0])
        assert supplied == pytest.approx(work, rel=1e-11)  # all that comes from outside
        assert dissipated(motion) - supplied == pytest.approx(-total, rel=1e-9)


def test_it_sticks_where_it_does_not_move() -> None:
    """The force of stick, which nothing determines, is the least: 0."""
    system = driven(ss.Contact("d_xi", 1, kinetic="0.8/(1 + speed)"), {"xi": "max(sin(t), 0)"})
    motion = ss.simulate(system)
    assert motion.certificate.ok
    found = motion.at([0.5, 2.0, 4.0, 5.0, 7.0])
    assert found["mode_pad"].tolist() == [1, -1, 0, 0, 1]
    u = np.cos([0.5, 2.0, 4.0, 5.0, 7.0]) * [1, 1, 0, 0, 1]
    assert found["friction_pad"] == pytest.approx(-np.sign(u) * 0.8 / (1 + np.abs(u)), rel=1e-12)
    listed = motion.event_catalogue()
    assert listed.table["start"].tolist() == pytest.approx([2 * np.pi], rel=1e-12)
    assert listed.table["duration"].tolist() == pytest.approx([np.pi], rel=1e-12)
    assert bool(np.all(np.isfinite(listed.table["energy_released"].to_numpy())))


def test_several_rub_on_one_motion() -> None:
    """Each has its own force and threshold, the certificate is that of the sum."""
    system = driven(ss.Contact("d_xi", "1 + y"), {"xi": "sin(t)"}, other=ss.Contact("d_xi", 0.5))
    motion = ss.simulate(system)
    assert motion.certificate.ok
    found = motion.at([1.0, 2.0])
    assert found["friction_pad"] == pytest.approx(-(1 + found["y"]) * [1, -1], rel=1e-12)
    assert found["friction_other"] == pytest.approx([-0.5, 0.5], rel=1e-12)


def test_a_normal_force_of_the_motion_presses_it() -> None:
    """A mass that bounces on a table which shakes sideways, and does not move it."""
    system = ss.System(
        "shaken",
        coordinates={"y": ss.Inertial(force="-1 + 0.6*sin(2*t)")},
        kinetic="d_y**2/2",
        contacts={"foot": ss.Unilateral("y", "0", 0.3, surface_speed="cos(3*t)")},
        initial={"y": 1.0},
        span=(0, 10),
    )
    motion = ss.simulate(system)
    assert motion.certificate.ok
    landed = float(motion.impacts["time"].to_numpy()[0])

    def power(t: float) -> float:
        return 0.3 * (1 - 0.6 * np.sin(2 * t)) * abs(np.cos(3 * t)) if t > landed else 0.0

    corners = [landed, *(np.pi / 6 + k * np.pi / 3 for k in range(12))]
    lost = float(np.sum(motion.impacts["energy"].to_numpy()))
    assert dissipated(motion) - lost == pytest.approx(integral(power, 10.0, corners), rel=1e-10)
    assert motion.at([0.5])["friction_foot"][0] == 0.0


VELOCITIES: dict[str, tuple[str, str, Callable[[float], tuple[float, float]]]] = {
    "ellipse": ("2*cos(t)", "sin(t)", lambda t: (2 * np.cos(t), np.sin(t))),
    "line": ("2*cos(t)", "-cos(t)", lambda t: (2 * np.cos(t), -np.cos(t))),
    "from rest": ("t*cos(t)", "t**2", lambda t: (t * np.cos(t), t**2)),
    "gently": ("t**2*cos(t)", "t**3", lambda t: (t**2 * np.cos(t), t**3)),
    "at rest": (
        "max(sin(t), 0)",
        "-max(sin(t), 0)",
        lambda t: (max(np.sin(t), 0.0), -max(np.sin(t), 0.0)),
    ),
}


@pytest.mark.parametrize("case", [*VELOCITIES])
def test_in_a_plane_it_acts_against_the_velocity(case: str) -> None:
    """Also from rest on, and where the velocity passes through zero."""
    u, v, velocity = VELOCITIES[case]
    axes = (1.0, 0.5)
    speeds = (f"-({u})", f"-({v})")
    contact = ss.Contact(("0", "0"), "1 + sin(t)/2", surface_speed=speeds, axes=axes)
    motion = ss.simulate(driven(contact, span=(0, 6)))
    assert motion.certificate.ok

    def power(t: float) -> float:
        x, y = velocity(t)
        return (1 + np.sin(t) / 2) * np.hypot(axes[0] * x, axes[1] * y)

    t = np.array([0.01, 0.7, 1.9, 2.9, 4.0, 5.5])
    found = motion.at(t)
    for i, time in enumerate(t):
        scaled = [a * w for a, w in zip(axes, velocity(time), strict=True)]
        size = math.hypot(*scaled) or 1.0
        held = 1 + np.sin(time) / 2
        force = [-held * a * w / size for a, w in zip(axes, scaled, strict=True)]
        forces = [found["friction_pad_1"][i], found["friction_pad_2"][i]]
        assert forces == pytest.approx(force, abs=1e-10)
    supplied = float(motion.dataset.supplied_energy[-1])
    work = integral(power, 6.0, [np.pi / 2, np.pi, 3 * np.pi / 2])
    assert supplied == pytest.approx(work, rel=1e-9)


def test_energies_of_a_cycle() -> None:
    """Fretting under a normal force that changes: energy per cycle, and a mode field that knows."""
    system = driven(
        ss.Contact("d_xi", "0.3*max(2 - y, 0)"), {"xi": "2*sin(t)"}, force="0.2*sin(2*t)"
    )
    cycle = ss.find_cycle(system)
    assert cycle.certificate.ok
    t = np.linspace(0.0, 2 * np.pi, 20001)
    motion = ss.simulate(system, (0, 60 + 2 * np.pi))
    y = motion.at(60 + t)["y"]
    power = 0.3 * np.maximum(2 - y, 0) * np.abs(2 * np.cos(60 + t))
    spent = np.diff(motion.at([60.0, 60 + 2 * np.pi])["dissipated_energy"])[0]
    damped = np.trapezoid(motion.at(60 + t)["d_y"] ** 2 / 10, t)
    assert spent - damped == pytest.approx(np.trapezoid(power, t), rel=1e-6)


def test_what_moves_nothing_is_refused_by_name() -> None:
    for contact, reason in (
        (ss.Contact("0", 1), "the direction is zero"),
        (ss.Contact(("0", "0"), 1), "the direction is zero"),
        (ss.Contact("2", 1), "not a linear combination of rates"),
        (ss.Contact("y", 1), "not a linear combination of rates"),
        (
            ss.Contact(("d_y", "0"), 1, surface_speed=("0", "1")),
            "one of its components contains no rate",
        ),
    ):
        with pytest.raises(ss.DeclarationError, match=reason):
            driven(contact)


def test_it_is_shown_and_written() -> None:
    system = driven(ss.Contact("d_xi", "2 + sin(t)"), {"xi": "sin(t)"})
    assert loads(system.to_toml()) == system
    text = str(system.equations())
    assert "pad:   u = ξ̇(t)" in text
    assert "λ = −(2 + sin(t)) sgn(u)" in text


@pytest.mark.parametrize("face", ["ellipsoid", "disc"])
def test_a_face_begins_from_rest(face: str) -> None:
    """All three directions of a face, sliding and turning as given, begin at once."""
    axes = (1.0, 1.0, 0.3)
    directions = ("d_X", "d_Y", "d_P")
    contact = (
        ss.Contact(directions, 1.0, axes=axes)
        if face == "ellipsoid"
        else ss.Contact(directions, dissipation="disc(v1, v2, v3)")
    )
    system = ss.System(
        name="face",
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        drives={"X": "t**3", "Y": "0.7*t**2", "P": "t**2"},
        contacts={"pad": contact},
        span=(0, 3),
    )
    motion = ss.simulate(system)
    assert motion.certificate.ok, motion.certificate
    t = np.array([1e-3, 0.1, 0.7, 2.9])
    found = motion.at(t)
    forces = np.stack([found[f"friction_pad_{i}"] for i in (1, 2, 3)])
    u = np.stack([3 * t**2, 1.4 * t, 2 * t])
    if face == "ellipsoid":
        scaled = np.array(axes)[:, None] * u
        exact = -np.array(axes)[:, None] * scaled / np.linalg.norm(scaled, axis=0)
        np.testing.assert_allclose(forces, exact, atol=1e-12)
    else:
        # the mean speed of points of the disc
        r = np.sqrt((np.arange(400) + 0.5) / 400)[:, None]
        angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
        x, y = r * np.cos(angle), r * np.sin(angle)
        mean = [np.mean(np.hypot(a - w * y, b + w * x)) for a, b, w in u.T]
        np.testing.assert_allclose(-np.sum(forces * u, axis=0), mean, rtol=1e-4)


@pytest.mark.parametrize("form", ["ellipsoid", "disc", "ring", "plane"])
def test_what_is_given_reverses(form: str) -> None:
    """All components vanish at once, at t = π/6 and π/2, and the force changes its sign there."""
    given: dict[str, Any] = {
        "ellipsoid": {"threshold": 1.0, "axes": (1.0, 1.0, 0.3)},
        "plane": {"dissipation": "sqrt(v1**2 + v2**2/4)"},
    }.get(form, {"dissipation": f"{form}(v1, v2, v3)"})
    speeds = ("cos(3*t)", "0.5*cos(3*t)", "0.3*cos(3*t)")[: 2 if form == "plane" else 3]
    contact = ss.Contact(("0",) * len(speeds), surface_speed=speeds, **given)
    motion = ss.simulate(driven(contact), (0.0, 2.0))
    assert motion.certificate.ok, motion.certificate
    ahead, back, again = (
        np.array([motion.at(t)[f"friction_pad_{i + 1}"] for i in range(len(speeds))])
        for t in (0.3, 1.1, 1.9)
    )
    assert np.hypot(*ahead[:2]) > 0.5
    np.testing.assert_allclose(back, -ahead, atol=1e-12)
    np.testing.assert_allclose(again, ahead, atol=1e-12)
