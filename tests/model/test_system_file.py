"""Model files: read, written, and everything that can be wrong with one."""

import pickle
import time
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip import catalogue
from stickslip.errors import DeclarationError
from stickslip.model.entries.tables import Table
from stickslip.model.formats.toml import MAX_BYTES
from stickslip.model.system import (
    Bilateral,
    Condition,
    Contact,
    Inertial,
    Internal,
    Jump,
    Output,
    Parameter,
    RateIndependent,
    System,
    Unilateral,
    Viscous,
)
from stickslip.model.system_file import dumps, load, loads, save
from stickslip.structures.damping import ModalDamping
from stickslip.structures.structure import Structure

EXAMPLES = Path(__file__).parents[2] / "examples"
TWINS = {
    "rocking-toy": "rocking_toy",
    "spring-slider": "spring_slider",
    "forced-oscillator": "forced_oscillator",
    "belt-block": "belt_block",
    "crawler": "two_leg_crawler",
    "play": "oscillating_play",
    "chain": "block_chain",
    "scaled-slider": "scaled_slider",
}
"""Examples that declare a system of the catalogue, key by key."""

SMALLEST = 'name = "s"\ninternal.a = {law = "-a"}\n'

EVERYTHING = System(
    name="everything",
    title='with "quotes", \\ and ψ',
    source="line one\nline two\ttabbed",
    parameters={
        "m": Parameter(2, "kg", "mass", "(0, inf)"),
        "k": Parameter(1e-7),
        "n": Parameter(-1.5e300),
    },
    functions={"H(s)": "max(s, 0)", "two(p, q)": "p*q", "half": 0.5, "one": 1, "one_text": "1"},
    tables={
        "mu": Table([0, 0.1, 1], [0.4, "n/5", 0.3], "cubic", ("refused", "constant")),
        "nu": Table(([0, 1], [0, 2, 3]), [[1, 2, 3], [4, 5, 6]], outside="linear"),
    },
    drives={"ell": "sin(t)", "level": 2.0},
    coordinates={
        "x": Inertial("m", "place", drag="d_x**3", force="0.1*m"),
        "u": Viscous(force=0.25),
        "z": RateIndependent(meaning="hysteresis"),
    },
    structures={"beam": Structure([[2.0]], [[3.0]], ModalDamping(0.01), ["tip"])},
    forces={"beam[tip]": "0.5*m"},
    internal={"alpha": Internal("1 - alpha", "K", "temperature"), "beta": Internal(-1)},
    kinetic="m/2*d_x**2",
    potential="k/2*x**2 + H(u)**2 + (z - u)**2",
    viscous="0.5*d_u**2",
    contacts={
        "a contact, named 'so' \"oddly\"": Contact("d_x", 1.0, 0.1, ("0.5", 0.25), unit="N"),
        "b": Contact("d_z", threshold=("1", 2)),
        "ψ": Contact("d_u", threshold="1"),
    },
    impacts="in turn",
    jumps={
        "over, and 'back'": Jump("x - 1", {"x": 0, "d_x": -0.5, "alpha": "2*alpha"}, "falling"),
        "either": Jump("alpha", {"beta": "-beta"}),
    },
    translation={"x": 0, "u": 0.0},
    initial={"x": 1, "d_x": 0.1, "alpha": -0.30000000000000004},
    span=(-1, 2.5),
    time_unit="s",
    conditions={"c d": Condition("m > 0", "else"), "e": Condition("m > 1")},
    facts={"f": "m + 1", "g": 3},
    outputs={"above": Output("x - u", "m", "height"), "tip": "2*beam[tip]", "fixed": 4},
)


def same_types(a: Any, b: Any) -> bool:
    """Whether two systems hold the same kinds of things: 1, 1.0 and "1" are different."""
    return repr(a) == repr(b)


@pytest.mark.parametrize("name", catalogue.names())
def test_round_trip_of_the_catalogue(name):
    system = catalogue.get(name)
    text = dumps(system)
    assert loads(text) == system
    assert same_types(loads(text), system)
    assert dumps(loads(text)) == text
    assert system.to_toml() == text


def test_round_trip_of_contacts_that_open():
    system = System(
        name="held",
        coordinates={"x": Inertial(), "y": Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        contacts={
            "foot": Unilateral("y", "d_x", 0.3, restitution=0.5, unit="N"),
            "a slot": Bilateral("x - y", "d_x + d_y", "0.2"),
            "brake": Contact("d_x", "0.1*normal_foot + normal_a_slot"),
        },
    )
    assert loads(dumps(system)) == system
    assert same_types(loads(dumps(system)), system)


def test_round_trip_of_everything():
    again = loads(dumps(EVERYTHING))
    assert again == EVERYTHING
    assert same_types(again, EVERYTHING)
    assert again.functions["one"] == 1
    assert again.functions["one_text"] == "1"
    assert list(again.coordinates) == list(EVERYTHING.coordinates)
    assert [c.name for c in again.declaration.contacts] == list(EVERYTHING.contacts)


@given(
    st.text(st.characters(codec="utf-8")),
    st.floats(allow_nan=False, allow_infinity=False),
    st.integers(-(2**70), 2**70),
)
def test_round_trip_of_texts_and_numbers(text, number, integer):
    system = System(
        name="s",
        title=text,
        source=f"\\ {text}",
        parameters={"p": Parameter(number, meaning=text)},
        internal={"a": Internal(integer)},
        conditions={text: Condition("p < 1", text)},
    )
    assert loads(dumps(system)) == system
    assert same_types(loads(dumps(system)), system)


def test_numbers_of_numpy_are_written_as_numbers():
    system = System(
        name="s",
        internal={"a": Internal(np.float64(0.5))},
        initial={"a": np.int64(3)},  # pyright: ignore[reportArgumentType]
    )
    assert loads(dumps(system)) == system


def test_keys_stand_in_the_order_of_the_fields():
    written = dict.fromkeys(
        line.split(" = ")[0].split(".")[0] for line in dumps(EVERYTHING).splitlines() if line
    )
    assert list(written) == [entry.name for entry in fields(System)]


def test_defaults_are_not_written():
    text = dumps(System(name="s", internal={"a": Internal("-a")}))
    assert text == 'name = "s"\ninternal.a = {law = "-a"}\n'


def test_save_and_load(tmp_path):
    save(EVERYTHING, tmp_path / "model.toml")
    assert load(tmp_path / "model.toml") == EVERYTHING
    assert load(str(tmp_path / "model.toml")) == EVERYTHING
    with pytest.raises(DeclarationError, match="cannot be written"):
        save(EVERYTHING, tmp_path)
    with pytest.raises(DeclarationError, match="cannot be written"):
        save(replace(EVERYTHING, title="\ud800"), tmp_path / "model.toml")


def test_a_parameter_may_be_a_number():
    text = """
name = "block"
parameters.k = 1.5
parameters.m = 2
coordinates.x = {kind = "inertial"}
kinetic = "m*d_x**2/2"
potential = "k*x**2/2"
"""
    declared = System(
        "block",
        parameters={"k": 1.5, "m": 2},
        coordinates={"x": Inertial()},
        kinetic="m*d_x**2/2",
        potential="k*x**2/2",
    )
    assert loads(text) == declared
    assert declared.parameters["k"] == Parameter(1.5)
    assert loads(dumps(declared)) == declared
    assert replace(declared, name="other").parameters == declared.parameters
    assert pickle.loads(pickle.dumps(declared)) == declared


def test_tables_are_read_as_well():
    text = """
name = "oscillator"
kinetic = "m/2*d_x**2"
potential = "k/2*x**2"
span = [0, 10]

[parameters]
m = {default = 1.0, range = "(0, inf)"}

[parameters.k]
default = 2.0
unit = "N/m"

[coordinates.x]
kind = "inertial"
unit = "m"

[contacts."the ground"]
direction = "d_x"
threshold = ["0.1", 0.2]
"""
    system = loads(text)
    assert system.parameters == {"m": Parameter(1.0, range="(0, inf)"), "k": Parameter(2.0, "N/m")}
    assert system.contacts == {"the ground": Contact("d_x", ("0.1", 0.2))}
    assert system.span == (0, 10)
    assert loads(text.replace("\n", "\r\n")) == system


def test_every_example_has_its_twin():
    assert {path.stem for path in EXAMPLES.glob("*.toml")} == set(TWINS)


@pytest.mark.parametrize("example", TWINS)
def test_example_is_the_system_of_the_catalogue(example):
    path = EXAMPLES / f"{example}.toml"
    assert load(path) == catalogue.get(TWINS[example])
    lines = path.read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith("# "), "an example begins by saying what it is"
    assert all(len(line) <= 140 for line in lines)


WRONG = {
    "not TOML": (
        "name",
        "model",
        "not valid TOML: Expected '=' after a key in a key/value pair at line 1",
    ),
    "no value": ("name = ", "model", "not valid TOML: Invalid value at line 1, column 8: name ="),
    "text without quotes": (
        SMALLEST + "potential = k*x",
        "model",
        "not valid TOML: Invalid value at line 3",
    ),
    "duplicate key": (
        SMALLEST + 'name = "again"',
        "model",
        "Cannot overwrite a value at line 3, column 15: name =",
    ),
    "duplicate table": (
        SMALLEST + "[drives]\n[drives]",
        "model",
        "Cannot declare ('drives',) twice at line 4",
    ),
    "duplicate in a table": (
        SMALLEST + "initial = {a = 1, a = 2}",
        "model",
        "Duplicate inline table key 'a' at line",
    ),
    "value and table": (
        SMALLEST + "parameters = 1\nparameters.P = 2",
        "model",
        "Cannot overwrite a value at line 4",
    ),
    "open text": (SMALLEST + 'title = "x', "model", "not valid TOML"),
    "no such escape": (SMALLEST + r'title = "\q"', "model", "not valid TOML"),
    "control character": (SMALLEST + 'title = "\x00"', "model", "not valid TOML"),
    "no such date": (SMALLEST + "span = 2001-99-99", "model", "not valid TOML"),
    "no such number": ("span = " + "9" * 5000, "model", "invalid number or date"),
    "deep lists": ("span = " + "[" * 20_000, "model", "nested too deeply"),
    "deep tables": ("span = " + "{a = " * 5000, "model", "nested too deeply"),
    "deep key": ("a." * 20_000 + "a = 1", "model", "a key has too many parts (line 1)"),
    "deep quoted key": (
        SMALLEST + "[" + '"a" . ' * 20_000 + "a]",
        "model",
        "a key has too many parts (line 3)",
    ),
    "nothing": ("", "model: name", "this key is missing"),
    "unknown key": (SMALLEST + 'potentail = "1"', "model: potentail", "unknown key"),
    "unknown odd key": (SMALLEST + '"a\\nb" = "1"', "model: 'a b'", "unknown key"),
    "unknown key of a parameter": (
        SMALLEST + "parameters.P = {defalt = 1}",
        "model: parameters.P.defalt",
        "unknown",
    ),
    "unknown key of a coordinate": (
        SMALLEST + 'coordinates.x = {kind = "viscous", draft = "1"}',
        "model: coordinates.x.draft",
        "unknown key",
    ),
    "missing default": (
        SMALLEST + "parameters.P = {}",
        "model: parameters.P.default",
        "this key is missing",
    ),
    "missing law": ('name = "s"\ninternal.a = {}', "model: internal.a.law", "this key is missing"),
    "missing threshold": (
        SMALLEST + 'contacts."a b" = {direction = "d"}',
        "model: contacts.'a b'.threshold",
        "this key is missing",
    ),
    "missing kind": (SMALLEST + "coordinates.x = {}", "model: coordinates.x.kind", "missing"),
    "unknown kind": (
        SMALLEST + 'coordinates.x = {kind = "viscose"}',
        "model: coordinates.x.kind",
        "unknown kind 'viscose'",
    ),
    "kind of no text": (
        SMALLEST + "coordinates.x = {kind = 1}",
        "model: coordinates.x.kind",
        "expected a string",
    ),
    "name as a number": ("name = 3", "model: name", "expected a string, got a number"),
    "parameters as a number": (
        SMALLEST + "parameters = 3",
        "model: parameters",
        "expected a table, got a number",
    ),
    "parameters as a list of tables": (
        SMALLEST + "[[parameters]]\nP = 1",
        "model: parameters",
        "got a list",
    ),
    "parameter as a text": (
        SMALLEST + 'parameters.P = "3"',
        "model: parameters.P",
        "expected a number or a parameter, got a string",
    ),
    "contacts as a list": (
        SMALLEST + "contacts = [1, 2]",
        "model: contacts",
        "expected a table, got a list",
    ),
    "contact as a text": (
        SMALLEST + 'contacts.c = "d_x"',
        "model: contacts.'c'",
        "expected a table, got a string",
    ),
    "coordinate as a bool": (
        SMALLEST + "coordinates.x = true",
        "model: coordinates.x",
        "got true or false",
    ),
    "range as a number": (
        SMALLEST + "parameters.P = {default = 1, range = 5}",
        "model: parameters.P.range",
        "a string",
    ),
    "default as a table": (
        SMALLEST + "parameters.P = {default = {a = 1}}",
        "model: parameters.P.default",
        "a table",
    ),
    "default as a date": (
        SMALLEST + "parameters.P = {default = 1979-05-27}",
        "model: parameters.P.default",
        "date",
    ),
    "default not a number": (
        SMALLEST + "parameters.P = {default = nan}",
        "model: parameters.P",
        "not a finite number",
    ),
    "default too large": (
        SMALLEST + f"parameters.P = {{default = {10**400}}}",
        "model: parameters.P",
        "not a finite",
    ),
    "default in long hex": (
        SMALLEST + f"parameters.P = {{default = 0x{'f' * 9000}}}",
        "model: parameters.P",
        "finite",
    ),
    "law as a list": (
        'name = "s"\ninternal.a = {law = ["a"]}',
        "model: internal.a.law",
        "a formula, got a list",
    ),
    "law as a table": (
        'name = "s"\ninternal.a = {law = {b = {c = 1}}}',
        "model: internal.a.law",
        "got a table",
    ),
    "formula as a bool": (SMALLEST + "potential = true", "model: potential", "got true or false"),
    "formula too large": (
        SMALLEST + f"potential = 0x{'f' * 9000}",
        "model: potential",
        "not finite",
    ),
    "threshold of three": (
        'name = "s"\ncoordinates.z = {kind = "rate-independent"}\n'
        'contacts.c = {direction = "d_z", threshold = [1, 2, 3]}',
        "model: contacts.'c'.threshold",
        "expected a formula or a pair of formulas",
    ),
    "function as a table": (
        SMALLEST + "functions.f = {text = 1}",
        "model: functions.f",
        "got a table",
    ),
    "initial as a text": (
        SMALLEST + 'initial.a = "1"',
        "model: initial.a",
        "expected a number, got a string",
    ),
    "initial as a list": (
        SMALLEST + "initial = [1]",
        "model: initial",
        "expected a table, got a list",
    ),
    "span as a number": (
        SMALLEST + "span = 5",
        "model: span",
        "expected a pair of numbers, got a number",
    ),
    "span of one": (
        SMALLEST + "span = [5]",
        "model: span",
        "expected a pair of numbers, got a list",
    ),
    "span of texts": (SMALLEST + 'span = ["0", "1"]', "model: span", "expected a pair of numbers"),
    "condition as a text": (
        SMALLEST + 'conditions.c = "1 > 0"',
        "model: conditions.c",
        "expected a table",
    ),
    "hostile formula": (
        SMALLEST + "potential = \"__import__('os')\"",
        "model: potential",
        "unknown function",
    ),
    "fault inside": (SMALLEST + 'potential = "b + 1"', "model: potential", "unknown name 'b'"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_text(case):
    text, where, reason = WRONG[case]
    start = time.process_time()
    with pytest.raises(DeclarationError) as caught:
        loads(text)
    assert time.process_time() - start < 2
    error = caught.value
    assert error.where == where
    assert reason in error.reason
    assert error.remedy
    assert "\n" not in str(error)
    assert len(str(error)) < 400


def test_suggestions():
    for text, remedy in [
        (SMALLEST + 'potentail = "1"', "Did you mean 'potential'?"),
        (SMALLEST + "parameters.P = {defalt = 1}", "Did you mean 'default'?"),
        (SMALLEST + 'coordinates.x = {kind = "viscose"}', 'Did you mean "viscous"?'),
        (SMALLEST + "coordinates.x = {}", 'Give one of "inertial", "viscous", "rate-independent"'),
        (SMALLEST + 'name = "again"', "A key may occur once; remove or rename one of them"),
    ]:
        with pytest.raises(DeclarationError) as caught:
            loads(text)
        assert caught.value.remedy == remedy


def test_large_text_is_read_or_refused_in_time():
    for text in (
        "\n".join(f"k{i}.a.b = 1" for i in range(20_000)),
        "\n".join(f"parameters.p{i} = {{default = 1}}" for i in range(8_000)),
        "\n".join(f'functions.f{i} = "1"' for i in range(12_000)),
        SMALLEST + "\n".join(f'functions.f{i} = "1"' for i in range(999)) + '\npotential = "b"',
        'title = "' + "\\n" * 140_000 + '"',
        "a" * 299_999,
        "[[a]]\n" * 45_000,
        "span = [" + "1," * 140_000 + "]",
        "#" * 299_999,
        "x" * (MAX_BYTES + 1),
    ):
        start = time.process_time()
        with pytest.raises(DeclarationError):
            loads(text)
        assert time.process_time() - start < 2


def test_wrong_files(tmp_path):
    def message(name: str, data: bytes | None = None) -> str:
        if data is not None:
            (tmp_path / name).write_bytes(data)
        with pytest.raises(DeclarationError) as caught:
            load(tmp_path / name)
        assert str(tmp_path / name) in caught.value.where or "\0" in name
        assert caught.value.remedy
        return str(caught.value)

    assert "no such file" in message("missing.toml")
    assert "it is a directory" in message(".")
    assert "cannot be read" in message("a\0b")
    assert "cannot be read" in message("x" * 300)
    assert "not UTF-8 text (line 2)" in message("latin.toml", b'name = "s"\ntitle = "\xe9"\n')
    assert "more than 300,000 bytes" in message("huge.toml", b"#" * (MAX_BYTES + 1))
    assert "bad.toml: not valid TOML" in message("bad.toml", b"name = \n")
    assert "bad.toml: potential: unknown name 'b'" in message(
        "bad.toml", (SMALLEST + 'potential = "b"').encode()
    )


def test_a_mark_at_the_beginning_is_no_mistake(tmp_path):
    (tmp_path / "m.toml").write_bytes(b"\xef\xbb\xbf" + SMALLEST.encode())
    assert load(tmp_path / "m.toml").name == "s"
