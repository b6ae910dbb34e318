"""Outputs and formulas in maps and responses, against closed forms, cycles, and the same system in
coordinates of which they are some."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from oracles.jenkins import Jenkins, response
from orbits.examples import jenkins
from stickslip.errors import DeclarationError

PARAMETERS = {"F": ss.Parameter(0.5), "omega": ss.Parameter(1.1), "mu": ss.Parameter(0.2)}


def masses(**given: Any) -> ss.System:
    """Two masses, of which the second rubs."""
    return ss.System(
        name="masses",
        parameters=PARAMETERS,
        coordinates={"x": ss.Inertial("m", force="F*cos(omega*t)"), "y": ss.Inertial("m")},
        kinetic="d_x**2/2 + d_y**2",
        potential="x**2/2 + (x - y)**2",
        viscous="0.05*d_x**2 + 0.03*d_y**2",
        contacts={"rub": ss.Contact("d_y", "mu")},
        **given,
    )


def turned() -> ss.System:
    """The same, of the distance a = x − y and of b = x + y."""
    x = "(a + b)/2"
    d_x, d_y = "(d_a + d_b)/2", "(d_b - d_a)/2"
    force = ss.Inertial("m", force="F*cos(omega*t)/2")
    return ss.System(
        name="turned",
        parameters=PARAMETERS,
        coordinates={"a": force, "b": force},
        kinetic=f"({d_x})**2/2 + ({d_y})**2",
        potential=f"({x})**2/2 + a**2",
        viscous=f"0.05*({d_x})**2 + 0.03*({d_y})**2",
        contacts={"rub": ss.Contact(d_y, "mu")},
    )


OUTPUT = masses(outputs={"apart": "x - y"})


@pytest.mark.parametrize(
    ("system", "of"), [(OUTPUT, "apart"), (OUTPUT, "2*apart - (x - y)"), (masses(), "x - y")]
)
def test_a_response_of_an_output_is_that_of_a_turned_coordinate(system: ss.System, of: str) -> None:
    asked: dict[str, Any] = {"levels": {"F": [0.4, 0.8]}, "points": 8, "drive": "cos(omega*t)"}
    found = ss.frequency_response(system, "omega", (0.9, 1.3), of=of, **asked)
    same = ss.frequency_response(turned(), "omega", (0.9, 1.3), of="a", **asked)
    assert found.certificate.ok
    assert found.coordinate == of
    assert found.system == system
    for name in ("swept_amplitude", "swept_harmonic", "swept_phase"):
        np.testing.assert_allclose(found[name], same[name], rtol=1e-9, err_msg=name)
    np.testing.assert_allclose(found["peak_amplitude"], same["peak_amplitude"], rtol=1e-9)
    np.testing.assert_allclose(found["peak_omega"], same["peak_omega"], rtol=1e-5)
    np.testing.assert_allclose(found["backbone_amplitude"], same["backbone_amplitude"], rtol=1e-9)
    assert found["amplitude"].attrs == {"units": "m", "long_name": f"amplitude of {of}"}


def test_a_linear_response_of_a_difference() -> None:
    """Without friction, |H₁ − H₂| F; the phase is relative to the only force."""
    found = ss.frequency_response(
        masses(), "omega", (0.9, 1.3), of="x - y", points=5, parameters={"mu": 0.0}
    )
    omega = found["omega"].values
    transfer = np.array(
        [
            np.linalg.solve(
                [[3 - w**2 + 0.1j * w, -2.0], [-2.0, 2 - 2 * w**2 + 0.06j * w]], [0.5, 0.0]
            )
            for w in omega
        ]
    )
    apart = transfer[:, 0] - transfer[:, 1]
    np.testing.assert_allclose(found["amplitude"], np.abs(apart), rtol=1e-9)
    np.testing.assert_allclose(found["harmonic"], np.abs(apart), rtol=1e-9)
    wave = np.exp(1j * found["phase"].values)
    np.testing.assert_allclose(wave, apart / np.abs(apart), atol=1e-9)


def test_the_response_of_a_jenkins_element(tmp_path: Path) -> None:
    """Of twice the coordinate, and of its force, which swings between its limits once it slips."""
    system = jenkins()
    F = 0.8
    found = ss.frequency_response(
        system, "omega", (0.8, 1.2), of="2*x", points=5, parameters={"F": F}
    )
    swept = found["swept_amplitude"].sel(direction="up").values.ravel()
    start = None
    for amplitude, omega in zip(swept, np.linspace(0.8, 1.2, 5), strict=True):
        r = response(Jenkins(F=F, omega=float(omega)), start)
        start = r.start if r.stick < 1.0 else None
        assert abs(amplitude / (2.0 * r.amplitude) - 1.0) < 1e-10
    force = ss.frequency_response(
        system, "omega", (0.8, 1.2), of="friction_damper", points=3, parameters={"F": F}
    )
    slips = force["slips"].values == 1
    assert np.any(slips)
    largest = float(ss.simulate(system, (0.0, 1.0))["threshold_plus_damper"][0])
    np.testing.assert_allclose(force["amplitude"].values[slips], largest, rtol=1e-9)
    force.save(tmp_path / "force.nc")
    assert ss.open(tmp_path / "force.nc").coordinate == "friction_damper"
    assert any("friction_damper" in a.get_ylabel() for a in force.plot().axes)


def test_an_output_that_is_the_same_for_all_cycles_hides_no_line() -> None:
    """Lines are those of the coordinate, whatever is asked of them; and doubts are said once."""
    with pytest.warns(UserWarning, match="is in N, but its unit is in m"):
        system = replace(
            masses(),
            parameters={**PARAMETERS, "mu": ss.Parameter(0.2, "N")},
            outputs={"doubtful": ss.Output("2*mu", "m")},
        )
    asked: dict[str, Any] = {"levels": {"F": [0.8]}, "points": 4}
    one = ss.frequency_response(system, "omega", (0.9, 1.3), of="4 + 0*x", **asked)
    other = ss.frequency_response(system, "omega", (0.9, 1.3), of="x", **asked)
    np.testing.assert_array_equal(one["line"], other["line"])
    np.testing.assert_array_equal(one["omega"], other["omega"])
    assert np.all(one["amplitude"] == 0.0)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"of": "z"}, "of: unknown quantity 'z'"),
        ({"of": "x - z"}, "z"),
        ({"of": "apartt"}, "apart"),
    ],
)
def test_what_has_no_response_is_named(given: dict[str, Any], message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        ss.frequency_response(OUTPUT, "omega", (0.9, 1.3), points=3, **given)


def test_two_forces_leave_the_phase_of_a_difference_open() -> None:
    both = replace(
        masses(),
        coordinates={
            "x": ss.Inertial(force="F*cos(omega*t)"),
            "y": ss.Inertial(force="F*sin(omega*t)"),
        },
    )
    with pytest.raises(DeclarationError, match=r"the forces on x and y depend on time.*drive="):
        ss.frequency_response(both, "omega", (0.9, 1.3), of="x - y", points=3)


def test_maps_measure_outputs_and_formulas() -> None:
    of = ("apart", "x - y", "abs(apart)", "friction_rub", "d_x - d_y")
    names = ("high", "low", "amplitude", "mean", "harmonic", "phase", "state", "shift", "speed")
    asked = [f"{name}:{one}" for name in names for one in of]
    asked += ["relative_phase:apart", "range = high:apart - low:apart", "part = amplitude:x/mu"]
    found = ss.sweep(OUTPUT, {"F": [0.5, 0.9]}, measure=asked)
    for i, F in enumerate((0.5, 0.9)):
        cycle = ss.find_cycle(OUTPUT, parameters={"F": F})
        own = {name: float(found[name][i]) for name in map(str, found.dataset.data_vars)}
        low, high = cycle.extrema["apart"]
        for one in ("apart", "x - y"):
            assert own[f"high:{one}"] == pytest.approx(high, rel=1e-9)
            assert own[f"low:{one}"] == pytest.approx(low, rel=1e-9)
            assert own[f"amplitude:{one}"] == pytest.approx((high - low) / 2.0, rel=1e-9)
            assert own[f"harmonic:{one}"] == pytest.approx(abs(cycle.harmonic["apart"]), rel=1e-9)
            assert own[f"mean:{one}"] == pytest.approx(0.0, abs=1e-8)
            assert own[f"shift:{one}"] == pytest.approx(0.0, abs=1e-8)
        assert own["mean:abs(apart)"] == pytest.approx(cycle.mean("abs(x - y)"), rel=1e-9)
        assert own["high:abs(apart)"] == pytest.approx(max(-low, high), rel=1e-9)
        assert own["high:friction_rub"] == pytest.approx(0.2, rel=1e-9)
        assert own["range"] == pytest.approx(high - low, rel=1e-9)
        x = cycle.extrema["x"]
        assert own["part"] == pytest.approx((x[1] - x[0]) / 2.0 / 0.2, rel=1e-9)
        assert own["relative_phase:apart"] == pytest.approx(cycle.relative_phase["apart"], abs=1e-8)
    assert found["high:apart"].attrs["units"] == "m"


def test_maps_of_structures_measure_unknowns() -> None:
    beam = ss.Structure([[1.0, 0.0], [0.0, 1.0]], [[2.0, -1.0], [-1.0, 1.0]], ss.ModalDamping(0.02))
    system = ss.System(
        name="beam",
        parameters={"omega": ss.Parameter(0.9)},
        structures={"u": beam},
        forces={"u[1]": "cos(omega*t)"},
    )
    asked = ["high:u[1]", "amplitude:u[1] - u[0]", "range = high:u[1] - low:u[1]"]
    found = ss.sweep(system, {"omega": [0.8, 0.9]}, measure=asked)
    cycle = ss.find_cycle(replace(system, outputs={"tip": "u[1]", "bend": "u[1] - u[0]"}))
    low, high = cycle.extrema["tip"]
    assert float(found["high:u[1]"][1]) == pytest.approx(high, rel=1e-8)
    assert float(found["range"][1]) == pytest.approx(high - low, rel=1e-8)
    bend = cycle.extrema["bend"]
    assert float(found["amplitude:u[1] - u[0]"][1]) == pytest.approx(np.ptp(bend) / 2.0, rel=1e-8)


def test_outputs_at_rest_and_under_a_record() -> None:
    still = ss.sweep(
        replace(OUTPUT, initial={"x": 0.1}), {"F": [0.0]}, measure=["high:apart", "mean:x + 1"]
    )
    assert np.isfinite(still["high:apart"].values).all()
    assert float(still["mean:x + 1"][0]) == pytest.approx(1.0, abs=0.3)
    t = np.linspace(0.0, 4.0, 81)
    shaken = ss.System(
        name="shaken",
        parameters={"k": ss.Parameter(4.0)},
        drives={"base": ss.Samples(t, np.sin(3.0 * t) * t / 4.0)},
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="k/2*(x - base)**2",
        outputs={"drift": "x - base"},
    )
    found = ss.sweep(shaken, {"k": [4.0, 9.0]}, measure=["high:drift", "low:drift", "mean:drift"])
    motion = ss.simulate(shaken, parameters={"k": 9.0})
    fine = motion.at(np.linspace(0.0, 4.0, 400_001))["drift"]
    assert float(found["high:drift"][1]) == pytest.approx(fine.max(), rel=1e-8)
    assert float(found["low:drift"][1]) == pytest.approx(fine.min(), rel=1e-8)
    assert float(found["mean:drift"][1]) == pytest.approx(np.mean(fine), rel=1e-4)


@pytest.mark.parametrize(
    ("measure", "message"),
    [
        ("high:z", "measure.high: unknown quantity 'z'"),
        ("high:x - z", "z"),
        ("high:apartt", "Did you mean 'apart'"),
        ("high:x/2", "contains a /"),
        ("range = high:z - 1", "unknown quantity 'z'"),
        ("energy_per_distance:apart", "unknown quantity 'apart'"),
    ],
)
def test_measures_of_nothing_are_named(measure: str, message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        ss.sweep(OUTPUT, {"F": [0.5]}, measure=[measure])
