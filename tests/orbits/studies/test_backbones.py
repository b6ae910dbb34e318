"""Backbones against closed forms, and against the same system declared otherwise."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.special import ellipk

import stickslip as ss
from bodies import chain


def rubbing_mass() -> ss.System:
    return ss.System(
        "rubbing_mass",
        parameters={
            "m": ss.Parameter(2.0, "kg"),
            "k": ss.Parameter(5.0, "N/m"),
            "F": ss.Parameter(0.3, "N"),
        },
        coordinates={"x": ss.Inertial("m")},
        kinetic="m*d_x**2/2",
        potential="k*x**2/2",
        contacts={"floor": ss.Contact("d_x", "F", unit="N")},
        span=(0, 10),
        time_unit="s",
    )


def test_coulomb_friction_in_closed_form() -> None:
    # While x' < 0 the motion turns around a = F/k and grows by exp(ξT/4) in half a period:
    # (A - a) exp(ξT/4) = A + a. With T = 2π/ω and D = ξ/(2ω) this is πD = ln((A + a)/(A - a)).
    found = ss.backbone(rubbing_mass(), (0.07, 6.0), points=8)
    assert found.certificate.ok and found.outcome.ok
    a, amplitude = 0.3 / 5.0, found.amplitude
    damping = np.log((amplitude + a) / (amplitude - a)) / np.pi
    np.testing.assert_allclose(found.damping, damping, rtol=1e-9)
    np.testing.assert_allclose(found.frequency, np.sqrt(2.5 / (1.0 + damping**2)), rtol=1e-9)
    np.testing.assert_allclose(found["dissipated_floor"], 4 * 0.3 * amplitude, rtol=1e-9)
    assert found.damping[-1] == pytest.approx(2.0 * a / (np.pi * amplitude[-1]), rel=1e-3)
    np.testing.assert_allclose(amplitude, np.geomspace(0.07, 6.0, 8), rtol=1e-9)


def test_a_slider_behind_a_spring() -> None:
    system = ss.catalogue.jenkins_oscillator(c=0.0, force=0)
    found = ss.backbone(system, (0.1, 10.0), points=9)
    amplitude, holds = found.amplitude, found.amplitude < 0.5
    assert not np.any(found["slips"].values[holds]) and np.all(found["slips"].values[~holds])
    np.testing.assert_allclose(found.frequency[holds], np.sqrt(2.0), rtol=1e-9)
    np.testing.assert_allclose(found.damping[holds], 0.0, atol=1e-9)
    assert np.all((found.frequency[~holds] > 1.0) & (found.frequency[~holds] < np.sqrt(2.0)))
    # The area of the hysteresis loop.
    lost = 4.0 * 0.5 * (amplitude - 0.5)[~holds]
    np.testing.assert_allclose(found["dissipated_damper"][~holds], lost, rtol=1e-9)
    weak = found.damping[-1]
    about = lost[-1] / (2.0 * np.pi * found.frequency[-1] ** 2 * amplitude[-1] ** 2)
    assert weak == pytest.approx(about, rel=1e-2)
    energy = 0.5 * (found.frequency[-1] * amplitude[-1]) ** 2
    assert found["energy"].values[-1] == pytest.approx(energy, rel=0.05)


@pytest.mark.parametrize("drag", [0.0, 0.02])
def test_a_hardening_spring_by_elliptic_integrals(drag: float) -> None:
    # Damping in proportion to the mass is what the excitation cancels: ξ = 2ζ exactly.
    system = ss.System(
        "hardening",
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="x**2/2 + x**4/4",
        viscous=f"{drag}*d_x**2",
        span=(0, 10),
    )
    found = ss.backbone(system, (0.05, 5.0), points=7)
    A = found.amplitude
    frequency = np.pi * np.sqrt(1.0 + A**2) / (2.0 * ellipk(A**2 / (2.0 * (1.0 + A**2))))
    assert found.certificate.ok and len(A) == 7
    np.testing.assert_allclose(found.frequency, frequency, rtol=1e-9)
    np.testing.assert_allclose(found.damping, drag / found.frequency, atol=1e-9)


def chain_of_three() -> tuple[ss.System, ss.System]:
    """Three masses with a slider at the last one, by matrices and by coordinates."""
    mass, stiffness = np.diag([1.0, 2.0, 1.5]), np.array([[3, -1, 0], [-1, 2, -1], [0, -1, 2.0]])
    law: dict[str, Any] = {"F_c": 0.4, "k": 0.7}
    body = ss.System(
        "body",
        structures={"u": ss.Structure(mass, stiffness, 0.01 * stiffness, {"tip": 2})},
        contacts={"joint": ss.laws.jenkins("d_u[tip]", **law)},
        span=(0, 20),
    )
    other = ss.System(
        "other",
        coordinates={x: ss.Inertial() for x in ("a", "b", "c")},
        kinetic="(d_a**2 + 2*d_b**2 + 1.5*d_c**2)/2",
        potential="(3*a**2 + 2*b**2 + 2*c**2)/2 - a*b - b*c",
        viscous="0.01*((3*d_a**2 + 2*d_b**2 + 2*d_c**2)/2 - d_a*d_b - d_b*d_c)",
        contacts={"joint": ss.laws.jenkins("d_c", **law)},
        span=(0, 20),
    )
    return body, other


@pytest.mark.parametrize(
    ("of", "other"), [("apart", "c - a"), ("u[tip] - u[0]", "apart"), ("d_u[tip]", "d_c")]
)
def test_what_is_measured_as_the_same_of_the_chain(of: str, other: str) -> None:
    body, chain = chain_of_three()
    body = replace(body, outputs={"apart": "u[tip] - u[0]"})
    chain = replace(chain, outputs={"apart": "c - a + 7"})
    one = ss.backbone(body, (0.2, 2.0), of=of, points=3)
    two = ss.backbone(chain, (0.2, 2.0), of=other, points=3)
    assert one.certificate.ok and one.coordinate == of
    np.testing.assert_allclose(one.amplitude, np.geomspace(0.2, 2.0, 3), rtol=1e-9)
    for name in ("frequency", "damping", "dissipated", "harmonic"):
        np.testing.assert_allclose(one[name], two[name], rtol=1e-8, atol=1e-12)


def test_an_output_that_bends() -> None:
    system = replace(
        ss.catalogue.jenkins_oscillator(c=0.0, force=0),
        outputs={"gauge": ss.Output("3*x + x**3 - 2", "V"), "loop": "friction_damper"},
    )
    places = ss.backbone(system, (0.2, 3.0), points=3)
    A = places.amplitude
    for x, value in zip(A, 3.0 * A + A**3, strict=True):
        found = ss.backbone(system, (value, 1.001 * value), of="gauge", points=2)
        assert found.certificate.ok and found["amplitude"].attrs["units"] == "V"
        alike = ss.backbone(system, (x, 1.001 * x), points=2)
        assert found.frequency[0] == pytest.approx(alike.frequency[0], rel=1e-9)
        assert found.damping[0] == pytest.approx(alike.damping[0], rel=1e-8, abs=1e-10)
        assert "gauge" in str(found.summary()) and found.plot() is not None
    # The first harmonic of 3x + x^3 for x = A cos, where nothing slips.
    assert not places["slips"].values[0]
    found = ss.backbone(system, (3.0 * A[0] + A[0] ** 3, 0.7), of="gauge", points=2)
    assert found["harmonic"].values[0] == pytest.approx(3.0 * A[0] + 0.75 * A[0] ** 3, rel=1e-9)
    velocity = ss.backbone(system, (0.1, 0.2), of="d_x", points=2)
    np.testing.assert_allclose(velocity["harmonic"], velocity.amplitude, rtol=1e-9)


def test_before_it_slips_a_structure_swings_as_one_wave() -> None:
    # The matrix iω - A of harmonics by parts is singular there.
    body = chain_of_three()[0]
    for of in ("u[tip]", "u_mode_2", "d_u[tip]"):
        found = ss.backbone(body, (0.05, 0.1), of=of, mode=2, points=2)
        assert not np.any(found["slips"])
        np.testing.assert_allclose(found["harmonic"], found.amplitude, rtol=1e-9)


@pytest.mark.parametrize("mode", [1, 2])
def test_a_structure_as_the_same_chain(mode: int) -> None:
    body, other = chain_of_three()
    one = ss.backbone(body, (0.2, 4.0), of="u[tip]", mode=mode, points=5)
    two = ss.backbone(other, (0.2, 4.0), of="c", mode=mode, points=5)
    assert one.certificate.ok and two.certificate.ok
    for name in ("frequency", "damping", "dissipated", "dissipated_joint", "energy"):
        np.testing.assert_allclose(one[name], two[name], rtol=1e-8, atol=1e-12)
    assert one.linear_frequency == pytest.approx(two.linear_frequency, rel=1e-12)


def test_a_linear_mode_with_its_damping() -> None:
    ratios = ss.ModalDamping((0.01, 0.02, 0.03))
    mass, stiffness = np.diag([1.0, 2.0, 1.5]), np.array([[3, -1, 0], [-1, 2, -1], [0, -1, 2.0]])
    structure = ss.Structure(mass, stiffness, ratios, {"tip": 2})
    system = ss.System("free", structures={"u": structure}, span=(0, 20))
    for mode, ratio in zip((1, 2, 3), (0.01, 0.02, 0.03), strict=True):
        found = ss.backbone(system, (0.1, 1.0), of="u[tip]", mode=mode, points=2)
        np.testing.assert_allclose(found.frequency, structure.frequencies[mode - 1], rtol=1e-9)
        np.testing.assert_allclose(found.damping, ratio, rtol=1e-8)


def test_a_joint_of_many_sliders() -> None:
    found = ss.backbone(ss.catalogue.iwan_oscillator(force=0, c=0.0), (0.1, 3.0), points=4)
    np.testing.assert_allclose(found["dissipated_joint"], found["dissipated"], rtol=1e-9)


def test_an_offset_does_not_matter() -> None:
    still = rubbing_mass()
    moved = replace(still, potential="k*x**2/2 - 4*F*x")
    one, two = (ss.backbone(s, (0.2, 2.0), points=3) for s in (still, moved))
    np.testing.assert_allclose(one.damping, two.damping, rtol=1e-9)


def test_a_drive_that_is_switched_off() -> None:
    system = ss.System(
        "switched",
        parameters={"P": ss.Parameter(0.2), "F": ss.Parameter(0.1)},
        coordinates={"x": ss.Inertial(force="P*sin(2*t)")},
        kinetic="d_x**2/2",
        potential="x**2/2 - P*cos(t)*x",
        contacts={"floor": ss.Contact("d_x", "F")},
    )
    with pytest.raises(ss.DeclarationError, match=r"driven by time.*Set the amplitude"):
        ss.backbone(system, (0.2, 1.0))
    found = ss.backbone(system, (0.2, 1.0), parameters={"P": 0.0}, points=2)
    np.testing.assert_allclose(found.damping[-1], np.log(1.1 / 0.9) / np.pi, rtol=1e-9)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"amplitudes": (1.0, 0.1)}, "amplitudes"),
        ({"amplitudes": (0.0, 1.0)}, "amplitudes"),
        ({"mode": 2}, "unknown mode 2"),
        ({"mode": 0}, "unknown mode 0"),
        ({"points": 1}, "points"),
        ({"of": "y"}, "unknown quantity 'y'"),
        ({"of": "x*"}, "not a formula"),
        ({"of": "x**2"}, "small oscillations of the mode .* do not change 'x\\*\\*2'"),
        ({"of": "abs(x)"}, "kinks"),
        ({"of": "friction_floor"}, "may jump"),
        ({"of": "dd_x"}, "may jump"),
        ({"of": "x + t"}, "depends explicitly on time"),
        ({"of": "m"}, "it is constant"),
        ({"parameters": {"F": "x"}}, "F"),
        ({"system": ss.catalogue.jenkins_oscillator()}, "driven by 'force'"),
        ({"system": ss.catalogue.cart_pendulum()}, "mass"),
        ({"system": ss.catalogue.spring_slider()}, "backbone|mass|drives"),
    ],
)
def test_a_backbone_that_makes_no_sense_is_refused(given: dict[str, Any], message: str) -> None:
    usual: dict[str, Any] = {"system": rubbing_mass(), "amplitudes": (0.1, 1.0)}
    with pytest.raises(ss.DeclarationError, match=message):
        ss.backbone(**{**usual, **given})


def test_a_time_limit_keeps_what_was_found() -> None:
    body = chain_of_three()[0]
    ss.backbone(body, (0.2, 0.3), of="u[tip]", points=2)
    found = ss.backbone(body, (0.2, 4.0), of="u[tip]", points=2000, time_limit=0.7)
    assert 0 < len(found.amplitude) < 2000
    assert found.outcome.name == "TIME_UP" and found.certificate.ok and not found.notes


def test_where_there_is_no_cycle_it_says_so() -> None:
    # Below F/k the spring cannot move the mass.
    with pytest.raises(ss.ConvergenceError, match="backbone"):
        ss.backbone(rubbing_mass(), (0.01, 0.05), points=3)
    found = ss.backbone(rubbing_mass(), (0.05, 1.0), points=3)
    assert not found.outcome.ok and "no cycle at the amplitude 0.05" in found.message
    assert len(found.amplitude) == 2


def strongly_damped(ratios: float | list[float]) -> ss.System:
    """A chain with a joint that never slips."""
    body = ss.Structure(*chain(3), ss.ModalDamping(ratios))
    joint = ss.laws.jenkins("d_u[1]", F_c=1.0, k=1e-9)
    return ss.System("chain", structures={"u": body}, contacts={"joint": joint})


@pytest.mark.parametrize("ratio", [0.7, 0.9, 0.99])
def test_strong_damping_below_critical(ratio: float) -> None:
    found = ss.backbone(strongly_damped(ratio), (0.1, 1.0), points=3)
    assert found.certificate.ok and found.outcome.ok
    np.testing.assert_allclose(found.damping, ratio, rtol=1e-6)


@pytest.mark.parametrize("ratio", [1.01, 1.5, 3.0, 30.0])
def test_overdamped_modes_have_no_backbone(ratio: float) -> None:
    message = rf"mode 1 is overdamped: its damping ratio is {ratio:.2g}.*no backbone there. Choose"
    with pytest.raises(ss.DeclarationError, match=message):
        ss.backbone(strongly_damped(ratio), (0.1, 1.0), points=3)


def test_overdamped_modes_name_those_that_are_not() -> None:
    system = strongly_damped([0.05, 2.0, 0.3])
    with pytest.raises(ss.DeclarationError, match=r"mode 2 is overdamped.*Choose.* modes 1, 3, or"):
        ss.backbone(system, (0.1, 1.0), mode=2, points=3)
    for mode in (1, 3):
        assert ss.backbone(system, (0.1, 1.0), mode=mode, points=3).certificate.ok


def hardening(c: float) -> ss.System:
    """x'' + c x' + x + x³ = 0: with an excitation that balances the damping, c, it is free."""
    return ss.System(
        "hardening",
        parameters={"c": c},
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="x**2/2 + x**4/4",
        viscous="c*d_x**2/2",
    )


@pytest.mark.parametrize("c", [0.1, 1.9, 2.0, 3.0, 10.0, 40.0])
@pytest.mark.parametrize("span", [(0.05, 60.0), (5.0, 10.0), (20.0, 100.0)])
def test_hardening_oscillators_begin_where_they_oscillate(
    c: float, span: tuple[float, float]
) -> None:
    """Far from the linear mode, and overdamped at small amplitudes or at all of them: the period is
    4 K(m)/√(1 + A²) with m = A²/(2 + 2A²)."""
    A = np.geomspace(*span, 7)
    omega = 0.5 * np.pi * np.sqrt(1.0 + A**2) / ellipk(A**2 / (2.0 + 2.0 * A**2))
    swings = c / (2.0 * omega) < 1.0
    if not np.any(swings):
        with pytest.raises(ss.DeclarationError, match=r"overdamped.*Choose larger amplitudes"):
            ss.backbone(hardening(c), span, points=7)
        return
    found = ss.backbone(hardening(c), span, points=7)
    assert found.certificate.ok
    np.testing.assert_allclose(found.amplitude, A[swings], rtol=1e-8)
    np.testing.assert_allclose(found.frequency, omega[swings], rtol=1e-8)
    np.testing.assert_allclose(found.damping, c / (2.0 * omega[swings]), rtol=1e-8)
    assert len(found.notes) == np.sum(~swings)
    assert all("the mode is overdamped" in note for note in found.notes)
