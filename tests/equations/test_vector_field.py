"""Vector fields of modes and values of formulas: against differences and by hand, and what may be
asked wrongly."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss

TOY = ss.catalogue.rocking_toy()
STICK = {"right leg": "stick", "left leg": "stick"}
POINT = {"psi": 0.2, "d_psi": 0.1, "x_R": 0.3, "x_L": -0.1}


@pytest.mark.parametrize("right", ["stick", "slip+", "slip-"])
@pytest.mark.parametrize("psi", [-1.4, 0.2, 1.3])
def test_jacobian_is_that_of_the_rates(right: str, psi: float) -> None:
    at = {**POINT, "psi": psi}
    field = ss.vector_field(TOY, {**STICK, "right leg": right}, at=at)
    jacobian = field.jacobian_at()
    for j, name in enumerate(field.state):
        h = 1e-6
        ends = [np.array([*field.rates_at({name: at[name] + s * h}).values()]) for s in (1, -1)]
        assert jacobian[:, j] == pytest.approx((ends[0] - ends[1]) / (2 * h), abs=1e-8)


def test_formulas_are_the_numbers() -> None:
    """What is printed is a formula of the system's own language."""
    inertial = ss.catalogue.rocking_toy_inertial()
    at = {**POINT, "d_x_R": 0.3, "d_x_L": -0.2}
    field = ss.vector_field(inertial, {"right leg": "slip+", "left leg": "slip-"}, at=at)
    values = {name: inertial.evaluate(text, at) for name, text in field.rates.items()}
    assert values == pytest.approx(field.rates_at(), rel=1e-13)
    forces = {name: inertial.evaluate(text, at) for name, text in field.forces.items()}
    assert forces == pytest.approx(field.forces_at(), rel=1e-13)
    texts = [[inertial.evaluate(text, at) for text in row] for row in field.jacobian]
    assert np.array(texts) == pytest.approx(field.jacobian_at(), rel=1e-12)
    assert "..." not in "".join(field.rates.values())


def test_friction_is_against_the_motion() -> None:
    at = {**POINT, "psi": 0.0}
    for mode, sign in (("slip+", -1), ("slip-", 1)):
        slider = ss.catalogue.spring_slider(mu="2/sqrt(alpha)", nu=0.05)
        force = ss.vector_field(slider, {"block": mode}).forces_at({"alpha": 4.0})["block"]
        assert force == sign * 1.0
    held = ss.vector_field(TOY, STICK, at=at).forces_at()
    # the pull of the spring less P on each leg
    assert held == pytest.approx({"right leg": 0.4 - 1.0, "left leg": -0.4 - 1.0}, rel=1e-15)


def test_kinks_are_taken_where_the_point_is() -> None:
    slopes = {}
    for psi in (-1.5, 0.0, 1.5):
        field = ss.vector_field(TOY, {**STICK, "right leg": "slip+"}, at={**POINT, "psi": psi})
        slopes[psi] = field.rates_at({"d_psi": 1.0})["x_R"]
    assert slopes == pytest.approx({-1.5: 0.3, 0.0: 0.3 - 1.5, 1.5: 0.3})


def test_parameters_of_points() -> None:
    field = ss.vector_field(TOY, STICK, at={**POINT, "I_b": 2.0})
    assert field.rates_at()["d_psi"] == pytest.approx(0.5 * (0.3 * 0.4 - 0.04 * 0.1 - 0.2))
    assert field.rates_at({"I_b": 1.0})["d_psi"] == pytest.approx(0.3 * 0.4 - 0.04 * 0.1 - 0.2)


def test_systems_without_contacts_and_with_one_equation() -> None:
    field = ss.vector_field(ss.catalogue.scaled_slider_limit(), at={"beta": -1.0})
    assert field.modes == {} and field.state == ("beta", "gamma")
    assert field.rates["gamma"] == "-gamma"
    assert "no contacts" in repr(field)


@pytest.mark.parametrize(
    ("modes", "at", "message"),
    [
        ({}, {}, "'right leg' has no mode. Give one of slip-, stick, slip"),
        ({**STICK, "left leg": "slides"}, {}, "has an unknown mode 'slides'"),
        ({**STICK, "third leg": "stick"}, {}, "unknown contact 'third leg'"),
        (STICK, {}, "'psi' has no value"),
        (STICK, {"psy": 0.0}, "unknown name 'psy'. Did you mean 'psi'"),
        (STICK, {"psi_2": 0.0}, "unknown name 'psi_2'"),
    ],
)
def test_what_is_asked_wrongly(modes: dict, at: dict, message: str) -> None:
    with pytest.raises(ss.DeclarationError, match=message):
        ss.vector_field(TOY, modes, at=at)


def test_too_many_contacts_stick() -> None:
    corner = ss.System(
        name="corner",
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        contacts={
            "above": ss.Contact("d_x", threshold=1),
            "beside": ss.Contact("d_y", threshold=1),
            "across": ss.Contact("d_x - d_y", threshold=1),
        },
    )
    held = {"above": "stick", "beside": "stick"}
    with pytest.raises(ss.DeclarationError, match="indeterminate"):
        ss.vector_field(corner, {**held, "across": "stick"})
    assert len(ss.vector_field(corner, {**held, "across": "slip+"}).state) == 4


def test_contacts_that_are_one() -> None:
    """Along one direction contacts stick and slip together."""
    twice = ss.System(
        name="twice",
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        contacts={name: ss.Contact("d_x", threshold=1) for name in ("above", "below")},
    )
    with pytest.raises(ss.DeclarationError, match="'above' and 'below' share one direction"):
        ss.vector_field(twice, {"above": "stick", "below": "slip+"})
    slips = ss.vector_field(twice, {"above": "slip+", "below": "slip+"})
    assert slips.rates_at({"x": 0.0, "d_x": 1.0})["d_x"] == -2.0


def test_values_of_formulas() -> None:
    """Of parameters, functions, their derivatives, drives, facts, state, rates and speeds."""
    slider = ss.catalogue.spring_slider()
    assert slider.evaluate("shear") == slider.values["V"]
    assert slider.evaluate("mu(alpha)", {"alpha": 1.0}) == 1.5
    assert slider.evaluate("d_mu(alpha)*d_U + speed", {"alpha": 1.0, "d_U": 2.0, "speed": 1.0}) == (
        pytest.approx(1.0 - 2.0 / 0.4)
    )
    assert TOY.evaluate("X") == TOY.evaluate("(P - rho - c*psi_star)/a") == pytest.approx(0.5)
    assert TOY.evaluate("2*X", {"P": 1.5}) == pytest.approx(2.0)
    assert TOY.evaluate(3) == 3.0
    assert np.isnan(TOY.evaluate("sqrt(psi)", {"psi": -1.0}))


@pytest.mark.parametrize(
    ("formula", "values", "message"),
    [
        ("psi +", {}, "not a formula"),
        ("omega", {}, "unknown name 'omega'"),
        ("psi", {}, "'psi' has no value"),
        ("X", {"X": 2.0}, "unknown name 'X'"),
        ("__import__('os')", {}, "formula: "),
    ],
)
def test_values_that_there_are_not(formula: str, values: dict, message: str) -> None:
    with pytest.raises(ss.DeclarationError, match=message):
        TOY.evaluate(formula, values)
