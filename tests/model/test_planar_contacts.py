"""Contacts in a plane that are declared wrongly: what is said of them, in Python, in a model file,
and on the command line."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from stickslip import Contact, DeclarationError, Inertial, RateIndependent, System, Viscous, load
from stickslip.cli.app import app
from systems import parameters

PLANE = ("d_x", "d_y")
# By a name: the fields of the contact, which of them is refused, what is said, and what would be
# right.
BAD: dict[str, tuple[Mapping[str, Any], str, str, str]] = {
    "one component": (
        {"direction": ("d_x",)},
        "direction",
        "one to three linear combinations",
        "['d_x', 'd_y']",
    ),
    "three components": (
        {"direction": ("d_x", "d_y", "d_u")},
        "axes",
        "expected 3 semi-axes, one for each direction, got 2",
        "disc(v1, v2, a*v3)",
    ),
    "no component": (
        {"direction": ()},
        "direction",
        "one to three linear combinations",
        "['d_x', 'd_y']",
    ),
    "numbers": (
        {"direction": (1, 2)},
        "direction",
        "one to three linear combinations",
        "['d_x', 'd_y']",
    ),
    "a product": (
        {"direction": ("d_x*d_y", "d_y")},
        "direction",
        "not a linear combination of rates",
        "Write it like 'd_x'",
    ),
    "a norm": (
        {"direction": ("sqrt(d_x**2 + d_y**2)", "d_y")},
        "direction",
        "not a linear combination of rates",
        "['d_x', 'd_y']",
    ),
    "no rate": (
        {"direction": ("x", "d_y")},
        "direction",
        "not a linear combination of rates",
        "Write it like 'd_x'",
    ),
    "a constant": (
        {"direction": ("d_x - 0.3", "d_y")},
        "direction",
        "it contains the constant -0.3",
        "Move it to 'surface_speed'",
    ),
    "an unknown name": ({"direction": ("d_x", "d_q")}, "direction", "unknown name 'd_q'", ""),
    "two kinds": (
        {"direction": ("d_x", "d_u")},
        "direction",
        "its components are inertial and viscous",
        "the same kind",
    ),
    "one line": (
        {"direction": ("d_x + d_y", "-2*d_x - 2*d_y")},
        "direction",
        "both of its components are parallel",
        "two independent combinations",
    ),
    "twice the same": (
        {"direction": ("d_x", "d_x")},
        "direction",
        "both of its components are parallel",
        "two independent combinations",
    ),
    "one line by a parameter": (
        {"direction": ("s*d_x + d_y", "2*s*d_x + 2*d_y")},
        "direction",
        "both of its components are parallel",
        "two independent combinations",
    ),
    "an axis of zero": ({"axes": (0, 1)}, "axes", "0 is outside", "in this range"),
    "a negative axis": ({"axes": (1, "a")}, "axes", "-1 is outside", "in this range"),
    "an axis that is none": ({"axes": (float("nan"), 1)}, "axes", "not finite", "finite number"),
    "an endless axis": ({"axes": (1, float("inf"))}, "axes", "not finite", "finite number"),
    "one axis": ({"axes": 2.0}, "axes", "semi-axes, got a number", "["),
    "three axes": (
        {"axes": (1, 1, 1)},
        "axes",
        "expected 2 semi-axes, one for each direction, got 3",
        "[",
    ),
    "axes of the state": ({"axes": ("x", 1)}, "axes", "'x' is not allowed here", "parameters"),
    "axes in time": ({"axes": ("1 + t", 1)}, "axes", "'t' is not allowed here", "parameters"),
    "two thresholds": (
        {"threshold": ("s", "s")},
        "threshold",
        "a contact in a plane has a single threshold",
        "for anisotropic friction add 'axes'",
    ),
    "two kinetic forces": (
        {"kinetic": ("s", "s/2")},
        "kinetic",
        "a contact in a plane has a single threshold",
        "for anisotropic friction add 'axes'",
    ),
    "kinetic above static": ({"kinetic": "2*s"}, "kinetic", "not between 0 and", "Reduce"),
    "a negative threshold": ({"threshold": "-s"}, "threshold", "must not be negative", "max("),
    "one speed": (
        {"surface_speed": "0.3*t"},
        "surface_speed",
        "needs two components",
        "['0.3*t', 0]",
    ),
    "three speeds": (
        {"surface_speed": (1, 2, 3)},
        "surface_speed",
        "needs two components",
        "['V', 0]",
    ),
    "two speeds along a line": (
        {"direction": "d_x", "surface_speed": (1, 2)},
        "surface_speed",
        "a contact along a line has one",
        "two directions, like direction = ['d_x', 'd_y']",
    ),
    "axes along a line": (
        {"direction": "d_x", "axes": (1, 2)},
        "axes",
        "only a contact in a plane has axes",
        "leave the axes out",
    ),
}
cases = pytest.mark.parametrize(("fields", "key", "reason", "remedy"), BAD.values(), ids=BAD)


def contact(fields: Mapping[str, Any]) -> Contact:
    """A contact in a plane with some fields replaced."""
    return Contact(**{"direction": PLANE, "threshold": "s", **fields})


def declared(**contacts: Contact | None) -> System:
    """Two masses and a sheet on viscous supports, with contacts."""
    return System(
        "bad",
        parameters=parameters(s=1.0, a=-1.0),
        coordinates={"x": Inertial(), "y": Inertial(), "u": Viscous()},
        kinetic="(d_x**2 + d_y**2)/2",
        viscous="d_u**2/2",
        potential="(x**2 + y**2 + u**2)/2",
        contacts={name.replace("_", " "): c for name, c in contacts.items() if c is not None},
    )


@cases
def test_refused_with_key_reason_and_remedy(
    fields: Mapping[str, Any], key: str, reason: str, remedy: str
) -> None:
    with pytest.raises(DeclarationError) as caught:
        declared(table=contact(fields))
    said = str(caught.value)
    assert said.startswith(f"contacts.'table'.{key}: ") or f"contacts.table.{key}" in said
    assert reason in said
    assert remedy in said.split(reason, 1)[1]


def in_toml(fields: Mapping[str, Any]) -> str:
    """The same as a model file. JSON writes texts, numbers and lists as TOML does."""
    given = {"direction": PLANE, "threshold": "s", **fields}
    entry = ", ".join(f"{n} = {json.dumps(v)}" for n, v in given.items())
    entry = entry.replace("NaN", "nan").replace("Infinity", "inf")
    return f"""
name = "bad"
kinetic = "(d_x**2 + d_y**2)/2"
viscous = "d_u**2/2"
potential = "(x**2 + y**2 + u**2)/2"
parameters = {{s = {{default = 1.0}}, a = {{default = -1.0}}}}
coordinates.x = {{kind = "inertial"}}
coordinates.y = {{kind = "inertial"}}
coordinates.u = {{kind = "viscous"}}
contacts.table = {{{entry}}}
span = [0, 2]
"""


@cases
def test_refused_in_a_model_file_and_on_the_command_line(
    fields: Mapping[str, Any], key: str, reason: str, remedy: str, tmp_path: Path
) -> None:
    file = tmp_path / "bad.toml"
    file.write_text(in_toml(fields), encoding="utf-8")
    with pytest.raises(DeclarationError) as caught:
        load(file)
    assert f"{key}: " in str(caught.value)
    assert reason in str(caught.value)
    result = CliRunner().invoke(app, ["run", str(file)], catch_exceptions=False)
    assert result.exit_code == 2
    assert result.stdout == ""
    message = result.stderr.strip()
    assert message.startswith("stickslip: ")
    assert "\n" not in message
    assert "Traceback" not in message
    assert reason in message
    assert remedy in message.split(reason, 1)[1]


def test_the_good_one_is_accepted(tmp_path: Path) -> None:
    """What is refused above is refused for what it says."""
    system = declared(table=contact({"axes": (1, "s"), "surface_speed": ("0.1*t", "-x")}))
    assert set(system.contacts) == {"table"}
    file = tmp_path / "good.toml"
    file.write_text(in_toml({"axes": [1, "s"], "surface_speed": ["0.1*t", 0]}), encoding="utf-8")
    found = load(file).contacts["table"]
    assert isinstance(found, Contact)
    assert found.axes == (1, "s")


@pytest.mark.parametrize("taken", ["table 1", "table 2"])
def test_names_of_its_components_are_taken(taken: str) -> None:
    other = Contact("d_u", 1.0)
    with pytest.raises(DeclarationError, match=f"need the name '{taken}', which is already used"):
        declared(**{taken.replace(" ", "_"): other, "table": contact({})})


def test_a_rate_independent_coordinate_has_one_contact() -> None:
    with pytest.raises(DeclarationError, match="'z' already has the contact"):
        System(
            "shared",
            parameters=parameters(s=1.0),
            coordinates={"z": RateIndependent(), "w": RateIndependent()},
            potential="(z**2 + w**2)/2 - t*z",
            contacts={"table": Contact(("d_z", "d_w"), "s"), "play": Contact("d_z", "s")},
        )
