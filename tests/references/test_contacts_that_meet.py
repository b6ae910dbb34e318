"""Where two contacts meet, on one rate, on one body, or one under the force of another: references
of closed form, and limits of regularised motions."""

from __future__ import annotations

import math

import numpy as np
import pytest

import stickslip as ss


def shaft(**thresholds: float) -> ss.System:
    """A shaft with brakes under A sin t."""
    return ss.System(
        name="shaft",
        parameters={"A": ss.Parameter(3.0)},
        coordinates={"x": ss.Inertial(force="A*sin(t)")},
        kinetic="d_x**2/2",
        contacts={name: ss.Contact("d_x", s) for name, s in thresholds.items()},
        span=(0, 60),
    )


@pytest.mark.parametrize("brakes", [{"brake": 1.0, "support": 1.5}, {"brake": 2.5}])
def test_shares_of_rest_of_two_brakes(brakes: dict[str, float]) -> None:
    """From rest until A sin t is the threshold, and until the impulses of a slip balance."""
    found = ss.sweep(shaft(**brakes), {"A": "2.8:4:4"}, ["stick_fraction"])
    assert found.certificate.ok
    shares = [0.5505, 0.3455, 0.2139, 0.1170]
    np.testing.assert_allclose(found["stick_fraction"], shares, atol=5e-5)


@pytest.mark.parametrize(
    ("threshold", "kinetic", "k", "open_k"),
    [
        ("0.1*normal_f", None, 1.0, 0.0),
        ("0.1*normal_f", "0.05*normal_f", 0.5, 0.0),
        ("0.5 + 0.1*normal_f", None, 1.5, 0.5),
        ("0.5 + 0.1*normal_f", "0.6*(0.5 + 0.1*normal_f)", 0.9, 0.3),
        ("0.5 + 0.1*normal_f", "0.25 + 0.1*normal_f", 1.25, 0.25),
        ("0.5 + 0.1*normal_f", "0.4 + 0.1*normal_f", 1.4, 0.4),
    ],
)
@pytest.mark.parametrize("held", ["constraint", "floor", "open"])
@pytest.mark.parametrize("push", [0.0, 0.6])
def test_static_above_kinetic_under_a_normal_force(
    threshold: str, kinetic: str | None, k: float, open_k: float, held: str, push: float
) -> None:
    """A body at speed 1 slides until friction k has stopped it, or a push drives it on."""
    system = ss.System(
        name="slider",
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential=f"10*y - {push}*x",
        contacts={
            "f": ss.Bilateral("y") if held == "constraint" else ss.Unilateral("y"),
            "a": ss.Contact("d_x", threshold, kinetic=kinetic),
        },
        initial={"d_x": 1.0} | ({"y": 100.0} if held == "open" else {}),
        span=(0, 4),
    )
    motion = ss.simulate(system)
    slows = (open_k if held == "open" else k) - push
    stops = 1.0 / slows if slows > 0.25 else math.inf
    end = 0.5 / slows if stops <= 4.0 else 4.0 - 8.0 * slows
    assert motion.certificate.ok, motion.certificate
    assert motion.final["x"] == pytest.approx(end, abs=1e-12)


BESIDE = {
    "frictionless floor": ({"f": ss.Unilateral("y"), "b": ss.Contact("d_x", 1.5)}, "10*y"),
    "frictionless wire": ({"f": ss.Bilateral("y"), "b": ss.Contact("d_x", 1.5)}, "10*y"),
    "wire": ({"f": ss.Bilateral("y", "d_x", 0.15)}, "10*y"),
    "stop that is far away": ({"s": ss.Unilateral("x + 50"), "b": ss.Contact("d_x", 1.5)}, "y**2"),
}


@pytest.mark.parametrize("beside", BESIDE)
def test_events_are_those_of_friction(beside: str) -> None:
    """What does not rub has no part in events, stick times and catalogues."""

    def driven(contacts: dict[str, ss.Contact], load: str) -> ss.System:
        return ss.System(
            name="driven",
            coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
            kinetic="(d_x**2 + d_y**2)/2",
            potential=f"{load} + x**2/2 - 2*x*cos(0.5*t)",
            contacts=contacts,
            initial={"x": 0.5},
            span=(0, 30),
        )

    alone = ss.simulate(driven({"b": ss.Contact("d_x", 1.5)}, "y**2"))
    motion = ss.simulate(driven(*BESIDE[beside]))
    assert motion.certificate.ok
    assert motion.n_switches == alone.n_switches
    sizes = [each.event_catalogue().dataset["size"] for each in (motion, alone)]
    assert len(sizes[1]) == 4
    np.testing.assert_allclose(*sizes, rtol=1e-9)
    times = [ss.find_cycle(each.system, each).stick_time for each in (motion, alone)]
    assert times[0] == pytest.approx(times[1], rel=1e-9)


def plate(points: list[tuple[float, float]], threshold: float, push: str, turn: str) -> ss.System:
    """A rigid body on points, pushed across."""
    return ss.System(
        name="plate",
        coordinates={
            "x": ss.Inertial(),
            "y": ss.Inertial(force=push),
            "th": ss.Inertial(force=turn),
        },
        kinetic="(d_x**2 + d_y**2)/2 + 0.04/12*d_th**2",
        contacts={
            f"p{i}": ss.Contact(
                (
                    f"d_x - d_th*(({x})*sin(th) + ({y})*cos(th))",
                    f"d_y + d_th*(({x})*cos(th) - ({y})*sin(th))",
                ),
                threshold,
            )
            for i, (x, y) in enumerate(points)
        },
        span=(0, 4.5),
    )


@pytest.mark.parametrize(
    ("points", "y", "th"),
    [
        ([(0.1, 0.0), (-0.1, 0.0)], 1.767, 13.469),
        ([(0.1, 0.0), (-0.05, 0.0866), (-0.05, -0.0866)], 1.357, 10.329),
    ],
)
def test_a_body_on_points_is_pushed_off_its_centre(
    points: list[tuple[float, float]], y: float, th: float
) -> None:
    """The first is the limit of regularised motions."""
    motion = ss.simulate(plate(points, 0.3 * 9.81 / len(points), "t", "0.05*t"))
    assert motion.certificate.ok
    assert motion.final["y"] == pytest.approx(y, abs=5e-4)
    assert motion.final["th"] == pytest.approx(th, abs=5e-4)


def test_two_contacts_of_a_sledge_are_one_of_their_sum() -> None:
    """It stops after |v|²/(2·3), on both at once."""
    sledge = ss.System(
        name="sledge",
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        contacts={
            "front": ss.Contact(("d_x", "d_y"), 1.0),
            "rear": ss.Contact(("d_x", "d_y"), 2.0),
        },
        initial={"d_x": 1.0, "d_y": 0.5},
        span=(0, 5),
    )
    motion = ss.simulate(sledge)
    assert motion.certificate.ok
    assert motion.final["x"] == pytest.approx(math.sqrt(1.25) / 6.0, abs=1e-12)
    assert motion.final["y"] == pytest.approx(math.sqrt(1.25) / 12.0, abs=1e-12)
