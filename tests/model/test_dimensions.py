"""Units that do not agree are said, term by term; units that do not parse are refused by name."""

from __future__ import annotations

import math
import pickle
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import DeclarationError
from stickslip.model.entries.units import (
    UNIT_NAMES,
    agree,
    check_unit,
    factors,
    in_si,
    lowest_terms,
)
from stickslip.model.quantities import quantity
from stickslip.model.system_file import loads

PARAMETERS = {
    "m": ("kg", 2.0),
    "k": ("N/m", 3.0),
    "stiff": ("N", 3.0),
    "c": ("N*s/m", 0.1),
    "F": ("N", 1.0),
    "V": ("m/s", 0.5),
    "a": ("mm", 2.0),
    "omega": ("rad/s", 1.5),
    "speed_of_shaft": ("rpm", 10.0),
    "tilt": ("deg", 3.0),
    "mu": ("1", 0.2),
    "plain": ("", 1.0),
}


def block(**changes: object) -> ss.System:
    parts = {
        "parameters": {
            name: ss.Parameter(value, unit) for name, (unit, value) in PARAMETERS.items()
        },
        "coordinates": {"x": ss.Inertial("m")},
        "kinetic": "m/2*d_x**2",
        "potential": "k/2*(x - V*t)**2",
        "contacts": {"ground": ss.Contact("d_x", "F", unit="N")},
        "time_unit": "s",
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return ss.System(name="block", **parts | changes)  # type: ignore[arg-type]


def test_an_energy_that_is_none_is_a_warning() -> None:
    """It names the term and both units, and where they are."""
    with pytest.warns(UserWarning, match=r"block: potential: .*stiff.* in m\^2\*N, .* N\*m"):
        ss.System(
            name="block",
            parameters={"stiff": ss.Parameter(3.0, "N")},
            coordinates={"x": ss.Inertial("m")},
            kinetic="d_x**2/2",
            potential="stiff*x**2/2",
            contacts={"ground": ss.Contact("d_x", "1", unit="N")},
            time_unit="s",
        )


def inertial(force: str, drag: str = "0") -> dict[str, object]:
    return {"coordinates": {"x": ss.Inertial("m", force=force, drag=drag)}}


@pytest.mark.parametrize(
    ("changes", "where", "says"),
    [
        ({"potential": "stiff*x**2/2"}, "potential", "in m^2*N|in N*m^2"),
        ({"kinetic": "k/2*d_x**2"}, "kinetic", "in m*N/s^2|in N*m/s^2|in N/m*m^2/s^2"),
        ({"viscous": "m/2*d_x**2"}, "viscous", "in m^2*kg/s^2|in kg*m^2/s^2"),
        (inertial("F*x"), "coordinates.x.force", "F*x is in|x*F is in"),
        (inertial("F - k*d_x"), "coordinates.x.force", "divided by x, is in N"),
        (inertial("0", "m*d_x"), "coordinates.x.drag", "divided by x, is in N"),
        ({"potential": "k/2*(x - V)**2"}, "potential", "V is in m/s"),
        ({"potential": "k/2*(x - a)**2"}, "potential", "a is in mm"),
        (
            {"potential": "F*x*cos(omega)"},
            "potential",
            "omega is in rad/s, but 'cos' takes radians",
        ),
        ({"potential": "F*x*sin(tilt)"}, "potential", "tilt is in deg, but 'sin' takes radians"),
        (
            {"potential": "F*x*cos(speed_of_shaft*t)"},
            "potential",
            "is in rpm*s, but 'cos' takes radians|is in s*rpm, but 'cos' takes radians",
        ),
        ({"potential": "F*x*exp(x/V)"}, "potential", "'exp' takes a number"),
        ({"potential": "F*x*triangle(V*t)"}, "potential", "a function with pieces takes a number"),
        (
            {"contacts": {"ground": ss.Contact("d_x", "mu*k", unit="N")}},
            "contacts.'ground'.threshold",
            "the unit of 'ground' is in N",
        ),
        (
            {"contacts": {"ground": ss.Contact("d_x", "F", surface_speed="V*t", unit="N")}},
            "contacts.'ground'.surface_speed",
            "the relative velocity is in m/s",
        ),
        (
            {"contacts": {"ground": ss.Contact("d_x", "F", kinetic="mu*k/(1 + speed/V)")}},
            "contacts.'ground'.kinetic",
            "divided by the relative velocity, is in",
        ),
        (
            {"internal": {"z": ss.Internal("F/c", "m"), "w": ss.Internal("F/k", "m")}},
            "internal.w.law",
            "the rate of w is in m/s",
        ),
        ({"drives": {"ell": "V*t + a*sin(omega*t)"}}, "drives.ell", ""),
    ],
)
def test_what_is_in_doubt(changes: dict[str, object], where: str, says: str) -> None:
    conflicts = block(**changes).unit_conflicts
    assert conflicts and conflicts[0].startswith(f"{where}: "), conflicts
    assert any(part in conflicts[0] for part in says.split("|")), conflicts
    assert len(conflicts) == 1, conflicts


@pytest.mark.parametrize(
    "changes",
    [
        {},
        # numbers that hide units, and names without one
        {"kinetic": "d_x**2/2", "potential": "x**2/2 + 9.81*m*x + plain*x**3"},
        {"potential": "k/2*max(x - 0.1, 0)**2 + F*x*cos(2*pi*x/V*omega)*tanh(x*k/F)"},
        {"potential": "k/2*x**2*(1 + 0.3*sin(omega*t)) - F*sqrt(x**2 + 1)"},
        {"potential": "k/2*mod(x, 2*V/omega)*x - F*x*triangle(omega*t)"},
        {"potential": "k/2*(x - V*t)**2 - F*x*sin(t)"},
        {"contacts": {"ground": ss.Contact("d_x", "F", kinetic="F/(1 + speed/V)", unit="N")}},
        {"contacts": {"ground": ss.Contact("d_x", "F*exp(-abs(x)*k/F)", surface_speed="V")}},
        {"time_unit": ""},
        {"coordinates": {"x": ss.Inertial()}},
    ],
)
def test_what_is_not(changes: dict[str, object]) -> None:
    assert block(**changes).unit_conflicts == []


@pytest.mark.parametrize(
    "name",
    [*ss.catalogue.names(), *sorted(map(str, Path(__file__).parents[2].glob("examples/*.toml")))],
)
def test_nothing_published_is_in_doubt(name: str) -> None:
    system = ss.load(name) if name.endswith(".toml") else ss.catalogue.get(name)
    assert system.unit_conflicts == []


# -- units that parse ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("one", "scale", "other"),
    [
        ("rpm", math.pi / 30, "rad/s"),
        ("rev/min", 1.0, "rpm"),
        ("deg", math.pi / 180, "rad"),
        ("°", 1.0, "deg"),
        ("bar", 1e5, "N/m²"),
        ("mbar", 1.0, "hPa"),
        ("g", 1e-3, "kg"),
        ("μm", 1.0, "µm"),
        ("psi", 4.4482216152605 / 0.0254**2, "Pa"),
        ("lbf*in", 4.4482216152605 * 0.0254, "N*m"),
        ("dm^3", 1.0, "L"),
        ("kgf", 9.80665, "N"),
    ],
)
def test_units_of_workshops(one: str, scale: float, other: str) -> None:
    check_unit(one, "here")
    (a, base), (b, same) = lowest_terms(factors(one)), lowest_terms(factors(other))
    assert base == same
    assert a / b == pytest.approx(scale, rel=1e-12)
    assert agree(factors(one), factors(other)) == (scale == 1.0)


@pytest.mark.parametrize(
    ("unit", "says"),
    [
        ("Nm", r"'Nm'.*Did you mean 'N\*m'"),
        ("kgm/s^2", r"unknown unit 'kgm'.*'kg\*m'"),
        ("hz", "'Hz'"),
        ("RPM", "'rpm'"),
        ("newton*meter", "'N'"),
        ("seconds", "'s'"),
        ("degrees", "'deg'"),
        ("bars", "'bar'"),
        ("kPaa", "'kPa'"),
        ("m//s", "not a product of powers"),
        ("furlong", "cannot parse 'furlong': unknown unit 'furlong'. Write a product"),
    ],
)
def test_a_unit_that_does_not_parse_is_refused_by_name(unit: str, says: str) -> None:
    with pytest.raises(DeclarationError, match=says) as error:
        ss.System("s", parameters={"p": ss.Parameter(1.0, unit)}, internal={"a": ss.Internal("p")})
    assert str(error.value).startswith("parameters.p.unit: ")


def test_prefixes_do_not_hide_units() -> None:
    for name, base in {"min": 60.0, "cd": 1.0, "ft": 0.3048, "Pa": 1.0, "h": 3600.0}.items():
        assert in_si(name)[0] == base
    assert {"daN", "Nm"}.isdisjoint(UNIT_NAMES)


# -- what was measured -----------------------------------------------------------------------------


def shaken(
    unit: str = "", potential: str = "k/2*(x + w)**2", force: str = "0", table: str = ""
) -> ss.System:
    """A mass on a spring whose foot moves as recorded, with measured curves beside it."""
    t = np.linspace(0.0, 10.0, 11)
    return ss.System(
        "shaken",
        parameters={"k": ss.Parameter(1.0, "N/m"), "m": ss.Parameter(1.0, "kg")},
        drives={"w": ss.Samples(t, np.sin(t), "cubic", unit=unit)},
        tables={
            "F": ss.Table([-5.0, 0.0, 5.0], [-1.0, 0.0, 1.0], outside="linear", unit=table),
            "G": ss.Table(([-5.0, 5.0], [-5.0, 5.0]), np.eye(2), outside="linear", unit=table),
            "H": ss.Table([-5.0, 5.0], [-1.0, "k*1"], outside="linear", unit=table),
        },
        coordinates={"x": ss.Inertial("m", force=force)},
        kinetic="m*d_x**2/2",
        potential=potential,
        outputs={"y": "x + w", "rate": "d_w", "pull": "F(x)", "both": "G(x, d_x)"},
        time_unit="s",
        span=(0.0, 10.0),
    )


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("unit", "said"),
    [
        ("", []),
        ("m", []),
        ("mm", ["potential: w is in mm, but x is in m"]),
        ("m/s", ["potential: w is in m/s, but x is in m"]),
    ],
)
def test_samples_have_a_unit(unit: str, said: list[str]) -> None:
    """As far as it is declared it is compared, whatever else is not."""
    assert shaken(unit).unit_conflicts == said


@pytest.mark.filterwarnings("ignore")
def test_rates_of_samples_and_integrals_of_tables_have_units() -> None:
    inertia = {"force": "-m*d_w"}
    found = shaken("m/s", "k*x**2/2", **inertia).unit_conflicts
    assert found == ["outputs.y: w is in m/s, but x is in m"]
    (said,) = shaken("m", "k*x**2/2", **inertia).unit_conflicts
    assert said.startswith("coordinates.x.force: -d_w*m is in m*kg/s,")
    assert shaken(potential="integral_F(x) + k*x**2/2", table="N").unit_conflicts == []
    (said,) = shaken(potential="integral_F(x) + k*x**2/2", table="mm").unit_conflicts
    assert said.startswith("potential: integral_F(x) is in mm*m,")
    for name in ("F(x)", "G(x, d_x)", "d_F(x)*x"):
        assert shaken("m", force=f"-{name}", table="N").unit_conflicts == []
        assert shaken("m", force=f"-{name}", table="J").unit_conflicts != []
    units = {n: quantity(shaken("m", table="N"), n)["units"] for n in ("y", "rate", "pull", "both")}
    assert units == {"y": "m", "rate": "m/s", "pull": "N", "both": "N"}


def test_a_sum_has_the_unit_of_what_is_known() -> None:
    """Whatever the order in which its terms came about: a record without a unit says nothing."""
    for unit in ("", "m"):
        system = shaken(unit)
        for output in ("k*(w - x)", "k*(x - w + 0.6/k)", "k*(0.6/k - x + w)"):
            shown = replace(system, outputs={"pull": output})
            assert quantity(shown, "pull")["units"] == "N"


def recorded(system: ss.System) -> ss.Samples:
    """What drives it."""
    drive = system.drives["w"]
    assert isinstance(drive, ss.Samples)
    return drive


def test_units_of_samples_and_tables_come_back(tmp_path: Path) -> None:
    """From model files, other processes and files of numbers; they are part of what these are."""
    system = shaken("m", table="N")
    for again in (loads(system.to_toml()), pickle.loads(pickle.dumps(system))):
        assert again == system
        assert recorded(again).unit == "m" and again.tables["G"].unit == "N"
    assert system.drives["w"] != shaken("", table="N").drives["w"]
    assert system.tables["F"] != shaken("m").tables["F"]
    (tmp_path / "w.csv").write_text("t,w\n0,1\n1,2\n")
    model = tmp_path / "w.toml"
    text = shaken().to_toml().replace("span = [0.0, 10.0]", "span = [0.0, 1.0]")
    lines = [line for line in text.splitlines() if not line.startswith("drives.w")]
    model.write_text("\n".join([*lines, 'drives.w = {file = "w.csv", unit = "m"}']))
    assert recorded(ss.load(model)).unit == "m"
    assert ss.Samples.read(tmp_path / "w.csv", unit="mm").unit == "mm"
    assert "in mm" in str(ss.Samples.read(tmp_path / "w.csv", unit="mm"))
    many = ss.noise((0.0, 1.0), 1e-3, seed=1, unit="V")
    assert ss.Samples.from_plain(many.plain(), "w") == many
    for wrong in ('"metre/s"', "3"):
        model.write_text("\n".join([*lines, f'drives.w = {{file = "w.csv", unit = {wrong}}}']))
        with pytest.raises(ss.DeclarationError, match=r"drives\.w\.unit"):
            ss.load(model)
    with pytest.raises(ss.DeclarationError, match="table, unit"):
        ss.Table([0.0, 1.0], [0.0, 1.0], unit="newtons")


def test_samples_without_a_unit_are_what_they_were() -> None:
    """Maps that are stored know records by these names."""
    assert ss.Samples([0.0, 1.0, 3.0], [0.0, 2.0, 0.0]).digest == "962d05356b34bbc8"


LISTS = ("maxwell_slip", "table")  # laws whose parameters are lists


@pytest.mark.parametrize("name", [n for n in ss.laws.all_names() if n not in LISTS])
def test_plain_numbers_as_parameters_of_laws_are_not_in_doubt(name: str) -> None:
    """Nothing is known of their unit, nor of that of numbers in front of a function."""
    law = ss.laws.by_name(name)
    numbers = {n: p.default for n, p in law.parameters.items()}
    for chosen, number in numbers.items():
        if chosen == "elements":
            continue  # a whole number
        system = ss.System(
            "laws",
            parameters={"k": ss.Parameter(1.0, "N/m"), chosen: number},
            coordinates={"x": ss.Inertial("m")},
            kinetic="d_x**2/2",
            potential="k*x**2/2",
            contacts={"c": law("d_x", **{**numbers, chosen: chosen})},
            time_unit="s",
        )
        assert system.unit_conflicts == []
