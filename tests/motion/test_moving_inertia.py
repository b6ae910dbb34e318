"""Inertia and contact directions that depend on the configuration and on time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad

import stickslip as ss
from oracles import lagrange
from stickslip.errors import DeclarationError
from stickslip.motion.outcome import Outcome


def system(
    coordinates: list[str],
    kinetic: str,
    potential: str = "0",
    contacts: dict[str, ss.Contact] | None = None,
    initial: dict[str, float] | None = None,
    **more: Any,
) -> ss.System:
    """A system of inertial coordinates."""
    return ss.System(
        name="moving",
        coordinates={x: ss.Inertial() for x in coordinates},
        kinetic=kinetic,
        potential=potential,
        contacts=contacts or {},
        initial=initial or {},
        **more,
    )


EXAMPLES = {
    "pendulum on a cart": (
        ["x", "phi"],
        "(1.0 + 0.5)/2*d_x**2 + 0.5/2*(0.49*d_phi**2 + 2*0.7*d_x*d_phi*cos(phi))",
        "-0.5*9.81*0.7*cos(phi)",
        "d_x",
        1.1,
        {"phi": 2.0, "d_phi": 0.3},
        3.0,
    ),
    "double pendulum with a rough elbow": (
        ["a", "b"],
        "0.9*d_a**2 + 0.4*d_b**2 + 0.6*d_a*d_b*cos(a - b)",
        "-7*cos(a) - 4*cos(b)",
        "d_b - d_a",
        1.5,
        {"a": 1.2, "b": 0.4},
        3.0,
    ),
    "bead on a turning hoop": (
        ["theta"],
        "(d_theta**2 + 16*sin(theta)**2)/2",
        "-9.81*cos(theta)",
        "d_theta",
        0.7,
        {"theta": 2.4},
        4.0,
    ),
    "piston of a crank": (
        ["theta"],
        "(0.3 + 0.2*sin(theta)**2)/2*d_theta**2",
        "2*cos(theta)",
        "-d_theta*(sin(theta) + sin(theta)*cos(theta)/sqrt(9 - sin(theta)**2))",
        0.8,
        {"theta": 0.5, "d_theta": 2.0},
        3.0,
    ),
    "a leaking cart": (
        ["x"],
        "(2 + exp(-t))/2*d_x**2",
        "2*x**2 - 1.5*x*sin(3*t)",
        "d_x",
        1.2,
        {"x": 0.8},
        5.0,
    ),
}


@pytest.mark.parametrize("name", EXAMPLES)
def test_against_lagrange(name: str) -> None:
    """Equations by SymPy, motion by SciPy."""
    names, kinetic, potential, direction, threshold, start, end = EXAMPLES[name]
    example = system(names, kinetic, potential, {"rough": ss.Contact(direction, threshold)}, start)
    found = ss.simulate(example, (0, end))
    assert found.outcome.ok and found.certificate.ok, found.certificate
    assert len(found.events) >= 2
    expected = lagrange.motion(names, kinetic, potential, direction, threshold, start, end)
    state = [found.final[x] for x in (*names, *(f"d_{x}" for x in names))]
    assert_allclose(state, expected, atol=3e-9)


def test_coordinates_do_not_matter() -> None:
    """A point on a spring that rubs along rods from the origin, in polar and in plane
    coordinates: constant direction and inertia that turns, or the other way round."""
    rubbing = 0.4
    polar = system(
        ["r", "phi"],
        "(d_r**2 + r**2*d_phi**2)/2",
        "2*r**2 + 0.3*r*cos(phi)",
        {"rod": ss.Contact("d_r", rubbing)},
        {"r": 1.3, "phi": 0.2, "d_phi": 1.1, "d_r": -0.4},
    )
    x, y = 1.3 * np.cos(0.2), 1.3 * np.sin(0.2)
    plane = system(
        ["x", "y"],
        "(d_x**2 + d_y**2)/2",
        "2*(x**2 + y**2) + 0.3*x",
        {"rod": ss.Contact("(x*d_x + y*d_y)/sqrt(x**2 + y**2)", rubbing)},
        {
            "x": x,
            "y": y,
            "d_x": -0.4 * np.cos(0.2) - 1.1 * y,
            "d_y": -0.4 * np.sin(0.2) + 1.1 * x,
        },
    )
    one, other = (ss.simulate(s, (0, 12)) for s in (polar, plane))
    assert one.certificate.ok and other.certificate.ok
    assert len(one.events) == len(other.events) > 10
    end, there = one.final, other.final
    assert_allclose(
        [end["r"] * np.cos(end["phi"]), end["r"] * np.sin(end["phi"])],
        [there["x"], there["y"]],
        atol=1e-9,
    )
    assert_allclose(one.events["time"], other.events["time"], atol=1e-9)


def test_momentum_of_a_mass_that_changes() -> None:
    """d(m v)/dt = 0: x = ∫ p/m, in closed form."""
    found = ss.simulate(system(["x"], "(1 + t)**2/2*d_x**2", initial={"d_x": 3.0}), (0, 9))
    assert found.certificate.ok
    assert found.final["x"] == pytest.approx(3.0 * (1 - 0.1), rel=1e-12)
    assert found.final["d_x"] == pytest.approx(0.03, rel=1e-12)


def test_a_moving_frame_is_a_force() -> None:
    """T = m (ẋ + w)²/2 has a part linear in the rate and one without: −m ẇ, and nothing else."""
    frame = system(
        ["x"], "(d_x + sin(2*t))**2/2", "x**2", {"ground": ss.Contact("d_x", 0.6)}, {"x": 0.3}
    )
    force = ss.System(
        name="pushed",
        coordinates={"x": ss.Inertial(force="-2*cos(2*t)")},
        kinetic="d_x**2/2",
        potential="x**2",
        contacts={"ground": ss.Contact("d_x", 0.6)},
        initial={"x": 0.3},
    )
    one, other = (ss.simulate(s, (0, 30)) for s in (frame, force))
    assert one.certificate.ok and other.certificate.ok
    assert_allclose(one.events["time"], other.events["time"], atol=1e-9)


def test_jacobi_is_kept() -> None:
    """Without friction and time, q̇·∂T/∂q̇ − T + V stays what it is."""
    hoop = system(
        ["theta"],
        "(d_theta**2 + 16*sin(theta)**2)/2",
        "-9.81*cos(theta)",
        initial={"theta": 0.4, "d_theta": 1.0},
    )
    found = ss.simulate(hoop, (0, 100))
    assert found.certificate.ok
    t = np.linspace(0, 100, 301)
    at = found.at(t)
    kept = at["d_theta"] ** 2 / 2 - 8 * np.sin(at["theta"]) ** 2 - 9.81 * np.cos(at["theta"])
    assert_allclose(kept, kept[0], atol=1e-10)
    assert_allclose(at["energy"], kept, atol=1e-10)


def test_stick_along_a_curve() -> None:
    """A contact whose direction turns holds q on the curve it was on: r stays, while phi goes
    on."""
    plane = system(
        ["x", "y"],
        "(d_x**2 + d_y**2)/2",
        "0",
        {"rod": ss.Contact("(x*d_x + y*d_y)/sqrt(x**2 + y**2)", 10.0)},
        {"x": 2.0, "d_y": 3.0},
    )
    found = ss.simulate(plane, (0, 10))
    assert found.certificate.ok
    t = np.linspace(0, 10, 101)
    at = found.at(t)
    assert_allclose(at["x"], 2 * np.cos(1.5 * t), atol=1e-10)
    assert_allclose(at["friction_rod"], -4.5, atol=1e-10)


def test_more_contacts_than_directions() -> None:
    """Two rods along one direction that turns: one is carried, and the motion is that of their
    sum."""
    rod = "(x*d_x + y*d_y)/sqrt(x**2 + y**2)"
    start = {"x": 1.0, "y": 0.4, "d_y": 1.0}
    spring = "3*(x**2 + y**2) + x*sin(t)"
    mass = "(d_x**2 + d_y**2)/2"
    two = system(
        ["x", "y"], mass, spring, {"a": ss.Contact(rod, 0.2), "b": ss.Contact(rod, 0.5)}, start
    )
    one = system(["x", "y"], mass, spring, {"a": ss.Contact(rod, 0.7)}, start)
    found, expected = (ss.simulate(s, (0, 10)) for s in (two, one))
    assert found.certificate.ok and expected.certificate.ok
    assert_allclose(
        [found.final[q] for q in ("x", "y", "d_x", "d_y")],
        [expected.final[q] for q in ("x", "y", "d_x", "d_y")],
        atol=1e-9,
    )


def test_inertia_that_is_lost() -> None:
    """A mass that runs out at x = 1: (1 − x) v²/2 − x stays, so that it is reached in finite time
    and at infinite speed. What was computed up to there is kept."""
    found = ss.simulate(system(["x"], "(1 - x)/2*d_x**2", "-x", initial={"d_x": 1.0}), (0, 10))
    assert found.outcome is Outcome.STEP_TOO_SMALL
    assert not found.certificate.ok
    end, _ = quad(lambda x: np.sqrt((1 - x) / (1 + 2 * x)), 0, 1)
    assert found.knots.time[-1] == pytest.approx(end, abs=1e-6)


def test_indefinite_elsewhere() -> None:
    """A start where the mass matrix is not positive definite."""
    example = system(["x", "y"], "d_x**2/2 + d_y**2/2 + x*d_x*d_y", initial={"d_x": 0.1})
    found = ss.simulate(example, (0, 1), initial={"x": 1.5})
    assert found.outcome is Outcome.NO_INERTIA


@pytest.mark.parametrize(
    ("changes", "where", "reason"),
    [
        ({"kinetic": "x/2*d_x**2"}, "kinetic", "not positive definite"),
        ({"kinetic": "d_x**3"}, "kinetic", "not quadratic"),
        ({"kinetic": "(1 + heaviside(x))/2*d_x**2"}, "kinetic", "jumps with x"),
        ({"kinetic": "abs(d_x)**2/2"}, "kinetic", "kinks"),
    ],
)
def test_refused(changes: dict[str, Any], where: str, reason: str) -> None:
    """Inertia that is none."""
    with pytest.raises(DeclarationError, match=reason) as error:
        ss.System(name="wrong", coordinates={"x": ss.Inertial()}, **changes)
    assert where in str(error.value)


def test_refused_directions() -> None:
    """Directions turn with inertial coordinates only, and do not jump."""
    with pytest.raises(DeclarationError, match="jumps with x"):
        system(["x"], "d_x**2/2", contacts={"c": ss.Contact("sign(x)*d_x", 1.0)})
    with pytest.raises(DeclarationError, match="coefficients depend on t"):
        ss.System(
            name="slow",
            coordinates={"z": ss.Viscous()},
            viscous="d_z**2/2",
            contacts={"c": ss.Contact("(1 + t)*d_z", 1.0)},
        )


def test_a_cycle_of_the_cart() -> None:
    """Under a force that oscillates the cart comes back, though it may stand anywhere: a drift that
    is a rounding error is none."""
    cart = ss.catalogue.cart_pendulum(A=6.0, c=0.15)
    cycle = ss.find_cycle(cart)
    assert cycle.certificate.ok and cycle.stable
    assert cycle.period == pytest.approx(np.pi, rel=1e-12)
    assert cycle.drift == 0.0
    start = float(cycle.trajectory.knots.time[0])
    found = ss.simulate(cart, (start, start + np.pi), initial=cycle.state)
    assert_allclose([found.final[x] for x in cycle.state], list(cycle.state.values()), atol=1e-9)
