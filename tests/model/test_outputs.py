"""Outputs as they are declared: what may stand in them, what is refused, what files keep."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import DeclarationError
from stickslip.model.quantities import ENERGIES, quantity
from stickslip.model.system_file import loads

BEAM = ss.Structure(
    [[2.0, 0.0], [0.0, 1.0]], [[3.0, -1.0], [-1.0, 1.0]], names=["root", "tip"], unit="m"
)


def pair(**given: Any) -> ss.System:
    return ss.System(
        name="pair",
        parameters={"k": ss.Parameter(2.0, "N/m"), "m": ss.Parameter(1.0, "kg")},
        functions={"squared(s)": "s**2"},
        drives={"base": "0.3*sin(t)"},
        coordinates={"x": ss.Inertial(unit="m"), "y": ss.Inertial(unit="m")},
        kinetic="m/2*d_x**2 + m/2*d_y**2",
        potential="k/2*(x - y)**2 + k/2*(x - base)**2",
        contacts={"rub": ss.Contact("d_y", 0.1, unit="N")},
        time_unit="s",
        **given,
    )


def test_outputs_are_formulas_of_all_that_results_show() -> None:
    system = pair(
        outputs={
            "gap": "x - y",
            "force": ss.Output("k*gap", "N", "force of the spring"),
            "power": "friction_rub*slip_speed_rub",
            "mixed": "squared(gap) + dd_x*base + t + energy - dissipated_energy + d_base",
            "four": 4,
        },
        initial={"x": 1.0},
    )
    motion = ss.simulate(system, (0.0, 5.0))
    data = motion.dataset
    x, y, t = (data[name].values for name in ("x", "y", "time"))
    base, rate = 0.3 * np.sin(t), 0.3 * np.cos(t)
    np.testing.assert_array_equal(data["gap"], x - y)
    np.testing.assert_allclose(data["force"], 2.0 * (x - y), rtol=1e-15)
    np.testing.assert_array_equal(data["power"], data["friction_rub"] * data["slip_speed_rub"])
    sums = data["energy"].values - data["dissipated_energy"].values
    mixed = (x - y) ** 2 + data["dd_x"].values * base + t + sums + rate
    np.testing.assert_allclose(data["mixed"], mixed, rtol=1e-12)
    assert np.all(data["four"] == 4.0)
    units = {name: data[name].attrs.get("units") for name in system.outputs}
    assert (units["gap"], units["force"], units["power"]) == ("m", "N", "N*m/s")
    assert data["force"].attrs["long_name"] == "force of the spring"
    assert motion.at(2.5)["gap"] == motion.at(2.5)["x"] - motion.at(2.5)["y"]
    assert system.evaluate("force", {"x": 2.0, "y": 0.5}) == 3.0


def test_outputs_of_unknowns_of_structures() -> None:
    system = ss.System(
        name="beam",
        structures={"u": BEAM},
        outputs={"bend": "u[tip] - u[root]", "rate": "d_u[tip]", "twice": "2*bend"},
        contacts={"rub": ss.Contact("d_u[root]", 0.1)},
        initial={"u[tip]": 1.0},
    )
    data = ss.simulate(system, (0.0, 3.0)).dataset
    np.testing.assert_allclose(data["bend"], data["u[tip]"] - data["u[root]"], atol=1e-14)
    np.testing.assert_allclose(data["rate"], data["d_u[tip]"], atol=1e-14)
    np.testing.assert_allclose(data["twice"], 2.0 * data["bend"], atol=1e-14)
    assert data["bend"].attrs["units"] == "m"


def test_files_keep_outputs() -> None:
    system = pair(outputs={"gap": "x - y", "force": ss.Output("k*gap", "N", "pull")})
    assert loads(system.to_toml()) == system
    short = 'outputs.gap = "x - y"\noutputs.force = {formula = "k*gap", unit = "N"}\n'
    again = loads(pair().to_toml() + short)
    assert again.outputs["gap"] == ss.Output("x - y")
    assert again.outputs["force"].unit == "N"


@pytest.mark.parametrize(
    ("outputs", "where", "message"),
    [
        ({"a": "x - z"}, "outputs.a", "z"),
        ({"a": "b + 1", "b": "2*a"}, "outputs.a", "cyclic definition: a -> b -> a"),
        ({"a": "a"}, "outputs.a", "cyclic"),
        ({"x": "y"}, "outputs.x", "declared twice"),
        ({"k": "y"}, "outputs.k", "declared twice"),
        ({"base": "y"}, "outputs.base", "declared twice"),
        ({"energy": "y"}, "outputs.energy", "results already have a quantity of this name"),
        (
            {"friction_rub": "y"},
            "outputs.friction_rub",
            "results already have a quantity of this name",
        ),
        ({"mode_rub": "y"}, "outputs.mode_rub", "results already have a quantity of this name"),
        ({"time": "y"}, "outputs.time", "results already have a quantity of this name"),
        ({"a(s)": "s"}, "outputs.'a(s)'", "an output cannot have arguments"),
        ({"a b": "x"}, "outputs.'a b'", ""),
        ({"a": "speed"}, "outputs.a", "slip_speed"),
        ({"a": "friction_rubb"}, "outputs.a", "friction_rub"),
        ({"a": "x +"}, "outputs.a", ""),
        ({"a": True}, "outputs.a", "expected a formula"),
        ({"a": None}, "outputs.a", "expected a formula"),
        ({"a": ["x"]}, "outputs.a", "expected a formula"),
        ({"a": ss.Output("x", "m/")}, "outputs.a.unit", ""),
        (["x"], "outputs", "table"),
    ],
)
def test_bad_outputs_are_named(outputs: Any, where: str, message: str) -> None:
    with pytest.raises(DeclarationError, match=r".") as caught:
        pair(outputs=outputs)
    assert caught.value.where == where, caught.value
    assert message in str(caught.value)


def test_units_of_outputs_that_do_not_agree_are_doubted() -> None:
    with pytest.warns(UserWarning, match=r"outputs\.force: x\*k is in N, but its unit is in m"):
        pair(outputs={"force": ss.Output("k*x", "m")})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pair(outputs={"force": ss.Output("k*x", "N"), "free": "k*x"})


def test_outputs_stand_in_other_formulas() -> None:
    """A jump where an output passes a value, and a threshold that depends on one."""
    pushed = pair(
        outputs={"gap": "x - y"},
        jumps={"hit": ss.Jump("gap - 0.5", {"d_x": "-d_x"}, "rising")},
        initial={"d_x": 2.0},
    )
    plain = replace(pushed, jumps={"hit": ss.Jump("x - y - 0.5", {"d_x": "-d_x"}, "rising")})
    found, same = (ss.simulate(s, (0.0, 4.0)) for s in (pushed, plain))
    assert len(found.jumps) > 0
    np.testing.assert_array_equal(found.jumps["time"], same.jumps["time"])
    with pytest.raises(DeclarationError, match="friction_rub"):
        replace(pushed, outputs={"gap": "friction_rub"})


def test_outputs_change_no_equation() -> None:
    system = pair(initial={"x": 1.0})
    shown = replace(system, outputs={"gap": "x - y", "pull": "friction_rub"})
    one, other = (ss.simulate(s, (0.0, 5.0)) for s in (system, shown))
    np.testing.assert_array_equal(one.knots.state, other.knots.state)
    assert set(other.dataset) == {*one.dataset, "gap", "pull"}


@pytest.mark.parametrize(
    "name",
    ["cantilever", "coin", "jenkins_oscillator", "lugre_positioner", "painleve_rod", "puck"],
)
def test_what_outputs_may_name_is_what_results_show(name: str) -> None:
    system = ss.catalogue.get(name)
    motion = ss.simulate(system, (0.0, 1e-3))
    shown = {str(n) for n in motion.dataset if not str(n).startswith("mode_")}
    assert shown - {*system.unknowns} == set(system.declaration.published)
    assert set(ENERGIES) <= shown
    assert all(quantity(system, n)["long_name"] for n in shown)


def test_a_constraint_shows_one_force() -> None:
    system = ss.System(
        name="bead",
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential="y",
        contacts={"wire": ss.Bilateral("y - 0.2*x**2", "d_x + 0.4*x*d_y", 0.1)},
        initial={"x": 1.0, "y": 0.2},
        outputs={"coefficient": "friction_wire/normal_wire"},
    )
    data = ss.simulate(system, (0.0, 0.5)).dataset
    assert {str(n) for n in data if str(n)[:5] != "mode_"} == {
        *system.declaration.published,
        "coefficient",
    }
    np.testing.assert_allclose(np.abs(data["coefficient"]), 0.1, rtol=1e-9)


def test_outputs_are_shown() -> None:
    system = pair(outputs={"gap": "x - y", "force": ss.Output("k*gap", "N", "pull")})
    text = str(system.equations())
    assert "Outputs" in text
    assert "gap = x − y" in text
    assert "pull" in text
    assert "gap" in system.equations(latex=True)
    assert "pull" in system._repr_html_()
    motion = ss.simulate(replace(system, initial={"x": 1.0}), (0.0, 5.0))
    assert len(motion.plot("gap", "force").axes) == 2
    labels = [axes.get_ylabel() for axes in motion.plot().axes]
    assert any("force" in label and "N" in label for label in labels), labels
    assert motion.plot(coordinates=["gap"], t=(1.0, 2.0)).axes
