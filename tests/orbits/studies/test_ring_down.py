"""Ring-downs against closed forms: Coulomb, viscous and Jenkins damping, structures, bad input."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from bodies import clamped

PARAMETERS = {"m": ss.Parameter(1.0), "k": ss.Parameter(1.0), "c": ss.Parameter(0.0)}


def spring_and_mass(**parts: Any) -> ss.System:
    """A mass on a spring, with viscous damping."""
    return ss.System(
        "mass",
        parameters={**PARAMETERS, "F": ss.Parameter(1.0)},
        coordinates={"x": ss.Inertial()},
        kinetic="m/2*d_x**2",
        potential=parts.pop("potential", "k/2*x**2"),
        viscous="c/2*d_x**2",
        **parts,
    )


RUBBING = spring_and_mass(contacts={"floor": ss.Contact("d_x", "F")})


def test_coulomb_friction_as_in_sdnd100() -> None:
    """m = 1 kg, k = 1e4 N/m, μN = 1 N, from 0.85 mm: the amplitudes fall by 0.1 mm."""
    decay = ss.ring_down(RUBBING, initial={"x": 0.85e-3}, parameters={"k": 1e4}, span=(0.0, 0.2))
    assert decay.certificate.ok and decay.stops and decay.outcome.ok
    turns = decay["turn_position"].values
    np.testing.assert_allclose(turns, [0.85e-3, -0.65e-3, 0.45e-3, -0.25e-3, 0.05e-3], atol=1e-17)
    np.testing.assert_allclose(decay["turn_time"].values, np.arange(5) * np.pi / 100, rtol=1e-14)
    np.testing.assert_allclose(decay["frequency"].values, 50.0 / np.pi, rtol=1e-13)
    np.testing.assert_allclose(decay["centre"].values, [1e-4, -1e-4, 1e-4, -1e-4], atol=1e-17)
    np.testing.assert_allclose(decay["dissipated"].values, 2.0 * decay["amplitude"].values)
    np.testing.assert_allclose(decay["turn_rest"].values[:-1], 0.0, atol=0.0)
    assert decay["turn_rest"].values[-1] == pytest.approx(0.2 - 0.04 * np.pi)
    energies = 0.5e4 * turns**2
    np.testing.assert_allclose(decay["turn_energy"].values, energies, atol=1e-15)


@pytest.mark.parametrize("start", [30.3, 200.7])
def test_coulomb_friction_over_many_half_cycles(start: float) -> None:
    decay = ss.ring_down(RUBBING, initial={"x": start}, span=(0.0, 400.0))
    amplitudes = start - 1.0 - 2.0 * np.arange(len(decay))
    assert len(decay) == np.ceil((start - 1.0) / 2.0)
    np.testing.assert_allclose(decay["amplitude"].values, amplitudes, rtol=1e-11)


@pytest.mark.parametrize("ratio", [0.0, 1e-3, 0.05, 0.5, 0.9])
def test_viscous_damping(ratio: float) -> None:
    """Two knots are all that such a motion has; hundreds of swings lie between them."""
    values = {"m": 2.0, "k": 8.0, "c": 8.0 * ratio}
    decay = ss.ring_down(
        RUBBING, initial={"x": 1.0}, parameters={**values, "F": 0.0}, span=(0, 1000)
    )
    assert decay.certificate.ok and not decay.stops
    assert len(decay) >= (2 if ratio > 0.5 else 7)
    np.testing.assert_allclose(decay["damping"].values[:-1], ratio, atol=1e-11)
    damped = 2.0 * np.sqrt(1.0 - ratio**2) / (2.0 * np.pi)
    np.testing.assert_allclose(decay["frequency"].values, damped, rtol=1e-11)
    assert bool(decay.notes) == (ratio >= 0.05)


@pytest.mark.parametrize("waves", [256, 1024, 4096, 1000.3])
def test_no_swing_is_stepped_over(waves: float) -> None:
    """Whole numbers of waves between the first samples show nothing of them."""
    decay = ss.ring_down(
        RUBBING, initial={"x": 1.0}, parameters={"F": 0.0}, span=(0.0, 2.0 * np.pi * waves)
    )
    assert len(decay) in (int(2 * waves), int(2 * waves) - 1)
    np.testing.assert_allclose(decay["amplitude"].values, 1.0, rtol=1e-9)


def test_a_pendulum_is_slower_at_large_amplitudes() -> None:
    """Frequencies by the complete elliptic integral; steps are Taylor series."""
    from scipy.special import ellipk

    swing = spring_and_mass(potential="-cos(x)")
    for start in (0.5, 2.5):
        decay = ss.ring_down(swing, initial={"x": start}, span=(0.0, 60.0))
        exact = 1.0 / (4.0 * ellipk(np.sin(start / 2.0) ** 2))
        np.testing.assert_allclose(decay["frequency"].values, exact, rtol=1e-9)


def test_a_dry_damper_behind_a_spring() -> None:
    """While it slides, a half-cycle dissipates F_c(2A − 2F_c/k_d); later none."""
    oscillator = ss.catalogue.jenkins_oscillator(force="0", c=0.0)
    decay = ss.ring_down(oscillator, initial={"x": 30.0, "r_damper": 29.5}, span=(0.0, 200.0))
    assert decay.certificate.ok and not decay.stops
    amplitude, lost = decay["amplitude"].values, decay["dissipated"].values
    np.testing.assert_allclose(lost, np.maximum(0.5 * (2.0 * amplitude - 1.0), 0.0), atol=1e-9)
    # ζ = W/(4πE), with W of a cycle, as long as little is lost in it
    mean, damping = decay["damping_amplitude"].values[:12], decay["damping"].values[:12]
    per_cycle = 2.0 * (mean - 0.5)
    np.testing.assert_allclose(damping, per_cycle / (4.0 * np.pi * 0.5 * mean**2), rtol=0.02)
    # stuck, it has both springs
    assert decay["frequency"].values[-1] == pytest.approx(np.sqrt(2.0) / (2.0 * np.pi), rel=1e-12)
    assert decay["damping"].values[-2] == pytest.approx(0.0, abs=1e-11)


def test_impacts_turn() -> None:
    """A ball turns where it hits the floor, and at the heights between, which fall by e²."""
    ball = ss.ring_down(
        ss.catalogue.bouncing_ball(e=0.8), initial={"y": 1.0, "d_y": 0.0}, span=(0.0, 2.0)
    )
    turns = ball["turn_position"].values
    np.testing.assert_allclose(turns[1::2], 0.0, atol=1e-12)
    np.testing.assert_allclose(turns[2::2] / turns[:-1:2][: len(turns[2::2])], 0.64, rtol=1e-9)


def test_rest_between_half_cycles_is_counted() -> None:
    """A block that a second one kicks on rests meanwhile."""
    system = ss.System(
        "two",
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="d_x**2/2 + 20*d_y**2/2",
        potential="x**2/2 + (x - y)**2/20 + y**2/2",
        contacts={"floor": ss.Contact("d_x", 0.2)},
    )
    decay = ss.ring_down(system, initial={"x": 1.0, "y": 6.0}, span=(0.0, 60.0))
    assert decay.certificate.ok
    rest = decay["turn_rest"].values
    assert np.count_nonzero(rest[:-1] > 0.1) > 0
    motion = ss.simulate(system, (0.0, 60.0), initial={"x": 1.0, "y": 6.0})
    for t, span in zip(decay["turn_time"].values, rest, strict=True):
        inside = motion.at(t + span * np.array([0.2, 0.8]))["d_x"]
        np.testing.assert_allclose(inside, 0.0, atol=1e-9)


def test_a_structure_in_its_first_mode() -> None:
    """A clamped beam with modal damping, by its tip and by the mode itself."""
    mass, stiffness = clamped(4)
    body = ss.Structure(mass, stiffness, ss.ModalDamping(0.02), names={"tip": len(mass) - 2})
    system = ss.System("beam", structures={"u": body})
    omega = float(body.frequencies[0])
    for name in ("u[tip]", "u_mode_1", None):
        span = (0.0, 40.0 / omega)
        decay = ss.ring_down(system, initial={"u_mode_1": 1.0}, of=name, span=span)
        assert decay.coordinate == (name or "u[tip]")
        np.testing.assert_allclose(decay["damping"].values[:-1], 0.02, rtol=1e-9)
        damped = omega * np.sqrt(1.0 - 0.02**2) / (2.0 * np.pi)
        np.testing.assert_allclose(decay["frequency"].values, damped, rtol=1e-9)


def test_a_structure_that_rubs() -> None:
    """Its single mode is a mass on a spring: amplitudes fall by 2F/k."""
    body = ss.Structure([[2.0]], [[50.0]], names={"tip": 0})
    system = ss.System(
        "body", structures={"u": body}, contacts={"rub": ss.Contact("d_u[tip]", 0.5)}
    )
    decay = ss.ring_down(system, initial={"u[tip]": 0.1}, span=(0.0, 10.0))
    np.testing.assert_allclose(decay["amplitude"].values, [0.09, 0.07, 0.05, 0.03, 0.01])
    np.testing.assert_allclose(decay["frequency"].values, 5.0 / (2.0 * np.pi))
    assert decay.stops and decay["turn_position"].values[-1] == pytest.approx(0.0, abs=1e-15)


def test_an_output_swings_as_its_coordinate_does() -> None:
    system = replace(RUBBING, outputs={"gauge": ss.Output("3*x - 1", "mV"), "bent": "x + x**3"})
    for start in (0.0, 1e6):
        span = (start, start + 30.0)
        decay, gauge, bent, same = (
            ss.ring_down(system, span, initial={"x": 7.3}, of=of)
            for of in ("x", "gauge", "bent", "3*x - 1")
        )
        x = decay["turn_position"].values
        np.testing.assert_allclose(gauge["turn_position"], 3.0 * x - 1.0, rtol=1e-12)
        np.testing.assert_allclose(bent["turn_position"], x + x**3, rtol=1e-12)
        for found in (gauge, bent, same):
            assert found.certificate.ok and found.stops and found.plot() is not None
            np.testing.assert_allclose(found["turn_time"], decay["turn_time"], rtol=1e-14)
    assert gauge["amplitude"].attrs["units"] == "mV" and same.coordinate == "3*x - 1"
    assert gauge["sample_position"].values[0] == pytest.approx(3.0 * 7.3 - 1.0)


def test_a_velocity_decays_as_its_place() -> None:
    given: Any = {"initial": {"x": 1.0}, "parameters": {"c": 0.06}, "span": (0.0, 60.0)}
    place, speed = (ss.ring_down(spring_and_mass(), of=of, **given) for of in ("x", "d_x"))
    assert speed.certificate.ok
    np.testing.assert_allclose(speed["damping"].values[1:-1], 0.03, rtol=1e-9)
    np.testing.assert_allclose(
        speed["frequency"].values[1:-1], place["frequency"].values[1:8][0], rtol=1e-9
    )


def test_unknowns_of_a_structure_relative_to_each_other() -> None:
    system = ss.System(
        "beam",
        structures={"u": ss.Structure(*clamped(3))},
        span=(0.0, 1.0),
        outputs={"bow": "u[2] - u[0]"},
    )
    decay, same = (
        ss.ring_down(system, initial={"u_mode_1": 1.0}, of=of) for of in ("bow", "u[2] - u[0]")
    )
    motion = ss.simulate(system, initial={"u_mode_1": 1.0})
    there = motion.at(decay["turn_time"].values)
    np.testing.assert_allclose(
        decay["turn_position"].values, (there["u[2]"] - there["u[0]"]), rtol=1e-9, atol=1e-14
    )
    np.testing.assert_array_equal(decay["amplitude"].values, same["amplitude"].values)


def test_what_does_not_swing() -> None:
    creeping = ss.ring_down(RUBBING, initial={"x": 1.0}, parameters={"F": 0.0, "c": 3.0})
    assert not creeping.stops and "does not oscillate" in creeping.message
    held = ss.ring_down(RUBBING, initial={"x": 0.5})
    for decay in (creeping, held):
        assert len(decay) == 0 and not decay.outcome.ok and not decay.summary().good
        assert decay.plot() is not None and len(decay.table) == 0


def test_late_times_are_as_exact_as_early_ones() -> None:
    early = ss.ring_down(RUBBING, (0.0, 30.0), initial={"x": 7.3})
    late = ss.ring_down(RUBBING, (1e9, 1e9 + 30.0), initial={"x": 7.3})
    assert late.certificate.ok and late.stops
    for name in ("amplitude", "frequency", "damping", "dissipated"):
        np.testing.assert_allclose(late[name].values, early[name].values, rtol=1e-14)


def test_what_ends_early_is_kept() -> None:
    short = ss.ring_down(RUBBING, initial={"x": 7.3}, max_events=2)
    assert len(short) == 1 and not short.stops and not short.summary().good
    assert short.outcome.label == "stopped early" and "limit on events" in short.message


def test_a_ring_down_is_read_back(tmp_path: Path) -> None:
    decay = ss.ring_down(RUBBING, initial={"x": 7.3})
    decay.save(tmp_path / "ring-down.nc")
    again = ss.open(tmp_path / "ring-down.nc")
    assert isinstance(again, ss.RingDown) and again.stops
    assert again.table.equals(decay.table) and again.message == decay.message
    assert str(again.summary()) == str(decay.summary())


DRIVEN = ss.catalogue.jenkins_oscillator()
SHAKEN = spring_and_mass(contacts={"floor": ss.Contact("d_x", "F", "F*cos(t)")})


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"system": DRIVEN}, "drive 'force'"),
        ({"system": SHAKEN}, "depends on time"),
        ({"of": "y"}, "unknown quantity 'y'"),
        ({"of": "max(x, 0)"}, "kinks"),
        ({"of": "friction_floor*x"}, "may jump"),
        (
            {"system": ss.catalogue.jenkins_oscillator(force="0"), "of": "r_damper"},
            "no mass",
        ),
        ({"initial": {"z": 1.0}}, "initial.z"),
        ({"initial": {"x": np.nan}}, "initial.x"),
        ({"span": (1.0, 0.0)}, "span: (1, 0) is not a time span"),
        ({"span": (0.0, np.inf)}, "span"),
        ({"parameters": {"q": 1.0}}, "q"),
        ({"time_limit": -1.0}, "time_limit"),
        ({"rtol": 0.0}, "rtol"),
    ],
)
def test_a_ring_down_that_makes_no_sense_is_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(ss.DeclarationError) as refused:
        ss.ring_down(**{"system": RUBBING, "initial": {"x": 3.0}, **given})
    assert message in str(refused.value)


def test_a_drive_that_is_zero_does_not_act() -> None:
    still = ss.ring_down(SHAKEN, initial={"x": 1.0}, parameters={"F": 0.0}, span=(0.0, 20.0))
    np.testing.assert_allclose(still["amplitude"].values, 1.0, rtol=1e-9)
