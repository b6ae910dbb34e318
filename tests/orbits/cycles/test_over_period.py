"""Extremes, harmonics and means of outputs against closed forms, and against the same system in
coordinates of which the outputs are some."""

from __future__ import annotations

import math

import numpy as np
import pytest

import stickslip as ss
from stickslip.orbits.cycles.over_period import harmonics

OMEGA, C = 1.3, 0.2


def masses(**outputs: str) -> ss.System:
    """Two masses, of which one rubs."""
    return ss.System(
        name="masses",
        parameters={"F": ss.Parameter(0.5), "omega": ss.Parameter(1.1)},
        coordinates={"x": ss.Inertial(force="F*cos(omega*t)"), "y": ss.Inertial()},
        kinetic="d_x**2/2 + d_y**2",
        potential="x**2/2 + (x - y)**2",
        viscous="0.05*d_x**2 + 0.03*d_y**2",
        contacts={"rub": ss.Contact("d_y", 0.2)},
        outputs=outputs,
    )


def turned() -> ss.System:
    """The same, of the distance a = x − y and of b = x + y."""
    x = "(a + b)/2"
    d_x, d_y = "(d_a + d_b)/2", "(d_b - d_a)/2"
    return ss.System(
        name="turned",
        parameters={"F": ss.Parameter(0.5), "omega": ss.Parameter(1.1)},
        coordinates={
            "a": ss.Inertial(force="F*cos(omega*t)/2"),
            "b": ss.Inertial(force="F*cos(omega*t)/2"),
        },
        kinetic=f"({d_x})**2/2 + ({d_y})**2",
        potential=f"({x})**2/2 + a**2",
        viscous=f"0.05*({d_x})**2 + 0.03*({d_y})**2",
        contacts={"rub": ss.Contact(d_y, 0.2)},
    )


def test_an_output_is_a_coordinate_of_the_turned_system() -> None:
    one = ss.find_cycle(masses(a="x - y", b="x + y", d_apart="d_x - d_y"))
    other = ss.find_cycle(turned())
    assert one.certificate.ok
    assert other.certificate.ok
    for name in ("a", "b"):
        np.testing.assert_allclose(one.extrema[name], other.extrema[name], rtol=0.0, atol=1e-10)
        assert abs(one.harmonic[name] - other.harmonic[name]) < 1e-10
    np.testing.assert_allclose(one.extrema["d_apart"], other.extrema["d_a"], atol=1e-10)
    assert abs(one.relative_phase["a"] - other.relative_phase["a"]) < 1e-9
    assert abs(one.mean("a**2") - other.mean("a**2")) < 1e-11


def oscillator(**outputs: str) -> ss.System:
    """A linear oscillator whose base moves, x = A cos(ωt + φ)."""
    return ss.System(
        name="oscillator",
        parameters={"omega": ss.Parameter(OMEGA)},
        drives={"push": "cos(omega*t)"},
        functions={"ground": "0.4*sin(omega*t)"},
        coordinates={"x": ss.Inertial(force="push")},
        kinetic="d_x**2/2",
        potential="x**2/2",
        viscous=f"{C}/2*d_x**2",
        outputs=outputs,
    )


def test_outputs_of_a_linear_oscillator() -> None:
    cycle = ss.find_cycle(
        oscillator(
            size="abs(x)",
            squared="x**2",
            cube="x**3",
            relative="x - ground",
            late="d_x + 2*x + omega",
            cut="max(x, 0.1)",
            acceleration="dd_x",
        )
    )
    X = 1.0 / (1.0 - OMEGA**2 + 1j * C * OMEGA)
    A = abs(X)
    relative, late = X + 0.4j, (2.0 + 1j * OMEGA) * X
    expected = {
        "size": (0.0, A),
        "squared": (0.0, A**2),
        "cube": (-(A**3), A**3),
        "relative": (-abs(relative), abs(relative)),
        "late": (OMEGA - abs(late), OMEGA + abs(late)),
        "cut": (0.1, A),
        "acceleration": (-(OMEGA**2) * A, OMEGA**2 * A),
    }
    for name, ends in expected.items():
        np.testing.assert_allclose(cycle.extrema[name], ends, rtol=1e-10, atol=1e-11, err_msg=name)
    third = 0.75 * A**3 * X / A
    waves = {"size": 0.0, "squared": 0.0, "cube": third, "relative": relative, "late": late}
    for name, wave in waves.items():
        assert abs(cycle.harmonic[name] - wave) < 1e-10, name
    assert max(cycle._harmonics[1].values()) < 1e-12
    assert abs(cycle.mean("size") - 2.0 * A / math.pi) < 1e-11
    assert abs(cycle.mean("squared") - A**2 / 2.0) < 1e-11
    share = math.acos(0.1 / A) / math.pi  # of the time above 0.1
    above = A * math.sqrt(1.0 - (0.1 / A) ** 2) / math.pi
    assert abs(cycle.mean("cut") - (above + 0.1 * (1.0 - share))) < 1e-11
    assert abs(cycle.relative_phase["relative"] - np.angle(relative)) < 1e-9


def test_extremes_lie_between_samples() -> None:
    """A turn right beside a sample, and a kink there, are closed in on all the same."""
    for shift in np.linspace(0.0, 0.02, 7):
        system = oscillator(
            bent=f"abs(sin(omega*t + {shift}) - 0.3)", smooth=f"cos(omega*t+{shift})**3"
        )
        found = ss.find_cycle(system).extrema
        np.testing.assert_allclose(found["bent"], (0.0, 1.3), atol=1e-12)
        np.testing.assert_allclose(found["smooth"], (-1.0, 1.0), atol=1e-12)


def test_outputs_of_drifting_cycles_have_no_drift_in_their_harmonics() -> None:
    """x − V t of a tip that is pulled repeats, x does not; both have the same first harmonic."""
    tip = ss.catalogue.prandtl_tomlinson()
    from dataclasses import replace

    cycle = ss.find_cycle(replace(tip, outputs={"spring": "X - x", "twice": "2*x"}))
    assert abs(cycle.harmonic["spring"] + cycle.harmonic["x"]) < 1e-10
    assert abs(cycle.harmonic["twice"] - 2.0 * cycle.harmonic["x"]) < 1e-10


@pytest.mark.parametrize("kind", ["power", "friction"])
def test_forces_are_outputs(kind: str) -> None:
    cycle = ss.find_cycle(masses(power="-friction_rub*slip_speed_rub", friction="friction_rub"))
    low, high = cycle.extrema[kind]
    if kind == "friction":
        assert low == pytest.approx(-0.2, abs=1e-12)
        assert high == pytest.approx(0.2, abs=1e-12)
        return
    assert low == pytest.approx(0.0, abs=1e-12)
    d_y = cycle.extrema["d_y"]
    assert high == pytest.approx(0.2 * max(-d_y[0], d_y[1]), rel=1e-10)
    lost = cycle.contacts["rub"].dissipated
    assert cycle.mean("power") * cycle.period == pytest.approx(lost, rel=1e-9)


def test_stored_cycles_and_branches_have_outputs(tmp_path) -> None:
    cycle = ss.find_cycle(masses(a="x - y"))
    cycle.save(tmp_path / "cycle.nc")
    again = ss.open(tmp_path / "cycle.nc")
    assert again.extrema["a"] == cycle.extrema["a"]
    assert "a" in again.dataset
    branch = ss.continue_cycle(cycle, "F", (0.5, 0.55))
    ends = branch.points["amplitude_a"].values
    assert np.all(ends > 0.0)
    assert branch.points["harmonic_a"].sizes == branch.points["amplitude_x"].sizes


def test_what_is_undefined_spoils_nothing_else() -> None:
    """An output without a value somewhere has none for the cycle; all others are as they were."""
    cycle = ss.find_cycle(oscillator(root="sqrt(x)", doubled="2*x", bent="abs(x)"))
    alone = ss.find_cycle(oscillator())
    assert math.isnan(cycle.extrema["root"][0])
    assert math.isnan(abs(cycle.harmonic["root"]))
    assert math.isinf(cycle._harmonics[1]["root"])
    assert cycle._harmonics[1][""] == alone._harmonics[1][""]
    assert cycle.harmonic["doubled"] == 2.0 * cycle.harmonic["x"]
    assert abs(cycle.harmonic["bent"]) < 1e-10
    found = ss.frequency_response(oscillator(root="sqrt(x)"), "omega", (1.2, 1.3), points=3)
    assert found.certificate.ok
    with pytest.raises(ss.DeclarationError, match="undefined on the cycle"):
        cycle.mean("root")


def test_a_slider_that_has_just_begun() -> None:
    """Its way of 4e-9 is that of the others to rounding; its harmonic is known as well as theirs,
    and a response is certified up to where a contact begins to slide."""
    stiff, damping = np.array([[2.0, -1.0], [-1.0, 2.0]]), 0.02
    omega = 1.3
    squares, V = np.linalg.eigh(stiff)
    C = V @ np.diag(2.0 * damping * np.sqrt(squares)) @ V.T
    held = stiff + np.diag([1.0, 0.0]) - omega**2 * np.eye(2) + 1j * omega * C
    begins = 0.5 / abs(np.linalg.solve(held, [0.0, 1.0])[0])  # force at which the contact slides
    beam = ss.Structure(np.eye(2), stiff, ss.ModalDamping(damping), names={"rub": 0, "tip": 1})
    system = ss.System(
        "two",
        parameters={"F": 1.01 * begins, "omega": omega},
        structures={"u": beam},
        forces={"u[tip]": "F*cos(omega*t)"},
        contacts={"rub": ss.laws.jenkins("d_u[rub]", F_c=0.5, k=1.0)},
    )
    cycle = ss.find_cycle(system)
    for over in (1e-4, 1e-6, 1e-8):
        cycle = ss.find_cycle(system, start=cycle, parameters={"F": begins * (1.0 + over)})
    low, high = cycle.extrema["r_rub"]
    assert high - low == pytest.approx(8.1e-9, rel=0.01)
    _, error = harmonics(cycle.trajectory, cycle.closed.orbit.shift, 1)
    assert error < 1e-13
