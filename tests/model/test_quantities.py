"""Units of everything that is published: derived from the declared ones, and what is not known is
not said."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import stickslip as ss
from stickslip.model.entries.units import (
    UNIT_NAMES,
    agree,
    factors,
    in_si,
    lowest_terms,
    unit_text,
    with_unit,
)
from stickslip.model.quantities import (
    contact_key,
    described,
    energy_unit,
    force_unit,
    per_time,
    quantity,
    slip_unit,
)

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.toml"))
PUBLISHED = [*ss.catalogue.names(), *(path.name for path in EXAMPLES)]
DIMENSIONLESS = (
    "oscillating_play",
    "scaled_slider",
    "scaled_slider_limit",
    "simplest_walker",
    "spring_slider",
    "wiggly_energy",
)
ENERGIES = {
    "rate_and_state_slider": "m*Pa",
    "two_block_rate_and_state": "Pa*m",
    "prandtl_tomlinson": "aJ",
    "lugre_positioner": "m^2*kg/s^2",
    "rimless_wheel": "m^2*kg/s^2",
    "velocity_step": "1",  # it has none
}  # no work at a contact
TURNING = {"face 3", "ice 3", "scales 3"}  # moments of faces
ANGLES = ("psi", "theta", "phi", "phi_M", "phi_S")


def published(name: str) -> ss.System:
    return (
        ss.load(next(p for p in EXAMPLES if p.name == name))
        if name.endswith(".toml")
        else ss.catalogue.get(name)
    )


def block(**changes: object) -> ss.System:
    """A block on a spring, in metres, seconds and newtons."""
    parts = {
        "parameters": {
            "m": ss.Parameter(2.0, "kg"),
            "k": ss.Parameter(3.0, "N/m"),
            "V": ss.Parameter(0.5, "m/s"),
        },
        "coordinates": {"x": ss.Inertial("m")},
        "kinetic": "m/2*d_x**2",
        "potential": "k/2*(x - V*t)**2",
        "contacts": {"ground": ss.Contact("d_x", "1", kinetic="0.6", unit="N")},
        "time_unit": "s",
    }
    return ss.System(name="block", **parts | changes)  # type: ignore[arg-type]


# -- the algebra -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("unit", "text"),
    [
        ("", "1"),
        ("1", "1"),
        ("kg m^2/s", "kg*m^2/s"),
        ("kg·m/s/s", "kg*m/s^2"),
        ("W/(m**2 * K)", "W/(m^2*K)"),
        ("W/(m^2*K^(1/2))", "W/(m^2*K^(1/2))"),
        ("J/m^-1", "J*m"),
        ("m*s/m", "s"),
        ("1/s", "1/s"),
        ("m^1/2", "m^(1/2)"),
    ],
)
def test_a_unit_is_a_product_of_powers(unit: str, text: str) -> None:
    assert unit_text(factors(unit)) == text
    assert factors(text) == factors(unit)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("J", "N*m"),
        ("aJ", "N/m*nm^2"),
        ("W", "V*A"),
        ("ohm", "1/S"),
        ("T", "kg/(A*s^2)"),
        ("H", "ohm*s"),
        ("F", "C^2/J"),
        ("kPa", "mN/mm^2"),
        ("µN", "uN"),
        ("mrad", "mm/m"),
        ("yr", "a"),
        ("GHz", "1/ns"),
        ("N", "g*mm/ms^2"),
    ],
)
def test_equal_units_are_recognised(one: str, other: str) -> None:
    assert agree(factors(one), factors(other))


@pytest.mark.parametrize(
    ("one", "other"),
    [("J", "mJ"), ("N*m", "N*mm"), ("N", "J"), ("h", "min"), ("deg", "rad"), ("%", "1")],
)
def test_different_units_are_told_apart(one: str, other: str) -> None:
    assert not agree(factors(one), factors(other))


def test_every_unit_that_may_be_declared_is_known_in_si() -> None:
    for name in UNIT_NAMES - {"1"}:
        scale, base = in_si(name)
        assert scale > 0.0
        assert set(base) <= {"kg", "m", "s", "A", "K", "mol", "cd"}
    assert in_si("kN")[0] == 1e3
    assert in_si("fN")[0] == pytest.approx(1e-15, rel=1e-14)
    assert in_si("min")[0] == 60.0  # no milli-inch
    assert in_si("cd")[1] == {"cd": 1}  # no centi-day


# -- what is published -----------------------------------------------------------------------------


@pytest.mark.parametrize("name", PUBLISHED)
def test_everything_published_has_its_unit(name: str) -> None:
    system = published(name)
    data = ss.simulate(system, (system.span[0], system.span[0] + 1e-3)).dataset
    for variable, values in data.items():
        assert "long_name" in values.attrs
        assert ("units" in values.attrs) != str(variable).startswith("mode_"), variable
    units = {str(variable): data[variable].attrs.get("units") for variable in data}
    energies = {units[energy] for energy in ("energy", "dissipated_energy", "supplied_energy")}
    expected = "1" if system.name in DIMENSIONLESS else ENERGIES.get(system.name, "N*m")
    assert energies == {expected}
    for q in system.declaration.inertial:
        accelerated = "rad/s^2" if q in ANGLES else "m/s^2"
        if any(q in body for body in system.declaration.bodies):
            accelerated = "kg^(1/2)*m/s^2"  # of a mode of unit mass
        assert units[f"dd_{q}"] == ("1" if system.name in DIMENSIONLESS else accelerated)
    for contact in system.unilateral:
        assert units[f"normal_{contact_key(contact)}"] == "N"
        assert units[f"gap_{contact_key(contact)}"] == "m"
    for contact in (c.name for c in system.declaration.contacts if not c.opens):
        turns = system.name == "drill_string" or contact in TURNING
        slip, force = ("rad/s", "N*m") if turns else ("m/s", "N")
        assert units[f"slip_speed_{contact_key(contact)}"] == ("1" if expected == "1" else slip)
        assert units[f"friction_{contact_key(contact)}"] == ("1" if expected == "1" else force)


def test_numbers_scale_as_their_units_say() -> None:
    # The same block in grams, millimetres and milliseconds, in which forces are newtons again.
    metres = block()
    millimetres = block(
        parameters={
            "m": ss.Parameter(2e3, "g"),
            "k": ss.Parameter(3e-3, "N/mm"),
            "V": ss.Parameter(0.5, "mm/ms"),
        },
        coordinates={"x": ss.Inertial("mm")},
        time_unit="ms",
    )
    one, other = ss.simulate(metres, (0.0, 10.0)), ss.simulate(millimetres, (0.0, 1e4))
    assert one.n_switches == other.n_switches > 2
    times = np.linspace(0.0, 10.0, 57)
    here = one.at(times)
    there = other.at(1e3 * times)
    for name in map(str, one.dataset):
        if name.startswith("mode_"):
            continue
        (a, base), (b, same) = (
            lowest_terms(factors(motion.dataset[name].attrs["units"])) for motion in (one, other)
        )
        assert base == same
        size = np.max(np.abs(a * here[name]))
        assert np.max(np.abs(a * here[name] - b * there[name])) <= 1e-8 * size, name
    assert other.dataset["energy"].attrs["units"] == "N*mm"
    assert other.dataset["dd_x"].attrs["units"] == "mm/ms^2"


# -- what follows from what is declared ------------------------------------------------------------


def test_a_number_may_hide_a_unit() -> None:
    unit_mass = block(
        kinetic="d_x**2", parameters={"k": ss.Parameter(3.0, "N/m"), "V": ss.Parameter(0.5, "m/s")}
    )
    assert energy_unit(unit_mass) == "N*m"
    only_numbers = block(kinetic="d_x**2", potential="(x - t)**2", parameters={})
    assert energy_unit(only_numbers) == "N*m"  # by the contact


def test_units_of_the_user_are_kept() -> None:
    barrier = {
        "E": ss.Parameter(1.0, "J"),
        "a": ss.Parameter(1.0, "m"),
        "m": ss.Parameter(1.0, "kg"),
    }
    assert energy_unit(block(parameters=barrier, potential="E*cos(x/a)")) == "J"
    small = block(
        coordinates={"x": ss.Inertial("mm")}, parameters={}, kinetic="d_x**2", potential="x**2"
    )
    assert energy_unit(small) == "N*mm"


def test_angles_and_levers() -> None:
    drum = block(
        parameters={
            "I": ss.Parameter(1.0, "kg*m^2"),
            "b": ss.Parameter(1.0, "N*m/rad"),
            "r": ss.Parameter(0.5, "m"),
        },
        coordinates={"th": ss.Inertial("rad", "angle")},
        kinetic="I/2*d_th**2",
        potential="b/2*(th - t)**2",
        contacts={
            "pin": ss.Contact("d_th", "1", unit="N*m"),
            "brake": ss.Contact("r*d_th", "1", unit="N"),
        },
    )
    assert slip_unit(drum, "pin") == "rad/s"
    assert slip_unit(drum, "brake") == "m/s"
    assert energy_unit(drum) == "N*m"
    assert quantity(drum, "dd_th") == {"units": "rad/s^2", "long_name": "acceleration of angle"}


def test_a_wheel_slips_in_metres() -> None:
    rolling = block(
        parameters={"r": ss.Parameter(0.5, "m")},
        coordinates={"x": ss.Inertial("m"), "th": ss.Inertial("rad")},
        kinetic="d_x**2 + d_th**2",
        potential="0",
        contacts={"road": ss.Contact("d_x - r*d_th", "1", unit="N")},
    )
    assert slip_unit(rolling, "road") == "m/s"
    numbers = block(
        parameters={},
        coordinates={"x": ss.Inertial("m"), "th": ss.Inertial("rad")},
        kinetic="d_x**2 + d_th**2",
        potential="0",
        contacts={"road": ss.Contact("d_x - 0.5*d_th", "1", unit="N")},
    )
    assert slip_unit(numbers, "road") == "m/s"


def test_a_force_without_a_declared_unit_does_work() -> None:
    assert force_unit(block(contacts={"ground": ss.Contact("d_x", "1")}), "ground") == "N"
    stress = block(
        parameters={"G": ss.Parameter(1.0, "Pa/m"), "eta": ss.Parameter(1.0, "Pa*s/m")},
        coordinates={"x": ss.Viscous("m")},
        kinetic="0",
        viscous="eta/2*d_x**2",
        potential="G/2*(x - t)**2",
        contacts={"fault": ss.Contact("d_x", "1", unit="Pa")},
    )
    assert energy_unit(stress) == "Pa*m"


def test_contradictions_are_not_decided() -> None:
    # N/m * mm² is µJ, N * mm is mJ: no unit is right.
    with pytest.warns(UserWarning) as said:
        mixed = block(coordinates={"x": ss.Inertial("mm")})
    assert any("V*t is in m, but x is in mm" in str(each.message) for each in said)
    assert energy_unit(mixed) is None
    data = ss.simulate(mixed, (0.0, 1.0)).dataset
    assert "units" not in data["energy"].attrs
    assert data["dd_x"].attrs["units"] == "mm/s^2"
    assert data["friction_ground"].attrs["units"] == "N"
    apart = block(
        coordinates={"x": ss.Inertial("m"), "th": ss.Inertial("rad")},
        kinetic="d_x**2 + d_th**2",
        contacts={"odd": ss.Contact("d_x - d_th", "1", unit="N")},
    )
    assert slip_unit(apart, "odd") is None


def test_without_units_all_is_dimensionless() -> None:
    plain = SimpleNamespace(time_unit="")
    assert per_time(plain, "", 2) == "1"  # type: ignore[arg-type]
    assert per_time(SimpleNamespace(time_unit="s"), "", 2) == "1/s^2"  # type: ignore[arg-type]
    assert per_time(SimpleNamespace(time_unit="s"), "kg*m^2/s") == "kg*m^2/s^2"  # type: ignore[arg-type]
    with pytest.raises(KeyError, match="nothing"):
        quantity(block(), "nothing")


def test_a_stick_fraction_says_of_which_contact_it_is() -> None:
    """In every table and picture, also where there is one contact only, or one in a plane."""
    toy, puck = ss.catalogue.rocking_toy(), ss.catalogue.puck()
    assert described(toy, "stick_fraction")["long_name"] == "stick fraction of all contacts"
    for name in toy.contacts:
        said = described(toy, f"stick_fraction:{name}")["long_name"]
        assert said == f"stick fraction of {name}"
    (only,) = puck.contacts
    for measure in ("stick_fraction", f"stick_fraction:{only}"):
        assert described(puck, measure)["long_name"] == f"stick fraction of {only}"
    cycle = ss.find_cycle(toy)
    points = ss.continue_cycle(cycle, "P", (0.99, 1.01)).points
    assert "all contacts" in points["stick_time"].attrs["long_name"]
    for name in toy.contacts:
        said = points[f"stick_time_{contact_key(name)}"].attrs["long_name"]
        assert said == f"time in which {name} sticks"
    assert "of all contacts" in cycle.describe() and "of all contacts" in str(cycle.rows())


def test_numbers_below_a_million_have_no_power_of_ten() -> None:
    said = {
        4e4: "40000 N",
        123456.7: "123500 N",
        4e6: "4e+06 N",
        2e-5: "2e-05 N",
        -7e5: "-700000 N",
    }
    assert {value: with_unit(value, "N", 4) for value in said} == said
