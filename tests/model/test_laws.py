"""Laws by name: how they are written out, what is said of those that are wrong, and model files."""

from __future__ import annotations

import re
from typing import Any

import pytest

import stickslip as ss
from stickslip.errors import DeclarationError
from stickslip.model import laws
from stickslip.model.system_file import loads

FILE = """
name = "block"
parameters.F = {{default = 1.0, range = "(-inf, inf)"}}
coordinates.x = {{kind = "inertial", unit = "m"}}
kinetic = "d_x**2/2"
potential = "x**2/2"
contacts.foot = {{{entry}}}
"""


_ON_A_TABLE = {"D_c": 0.5, "v_c": 2.0}


def block(contact: Any, **parts: Any) -> ss.System:
    declared: dict[str, Any] = {
        "parameters": {"F": ss.Parameter(1.0)},
        "coordinates": {"x": ss.Inertial(unit="m")},
        "kinetic": "d_x**2/2",
        "potential": "x**2/2",
        "initial": {"x": 2.0},
        "span": (0.0, 5.0),
    }
    return ss.System("block", contacts={"right foot": contact}, **{**declared, **parts})


def example(name: str) -> dict[str, Any]:
    law = laws.by_name(name)
    if law.points:
        return {"F_s": 1.5, "v": (0.0, 1.0, 20.0), "F": (1.4, 1.0, 1.2)}
    if law.increasing:
        # The rates of a fault would be far from those of these motions.
        return {own: _ON_A_TABLE.get(own, p.default) for own, p in law.parameters.items()}
    return {
        own: (p.default, 0.5 * p.default) if own in law.several else p.default
        for own, p in law.parameters.items()
    }


def test_what_each_law_says() -> None:
    assert len(laws.all_names()) == 16
    for name in laws.all_names():
        law = laws.by_name(name)
        assert law is getattr(ss.laws, name)
        assert law.name == name
        assert law.title and law.source and law.about
        assert all(p.meaning for p in law.known().values())
        kinds = [bool(law.force), law.dry, bool(law.stiffness)]
        assert kinds.count(True) == 1, name


@pytest.mark.parametrize("name", laws.all_names())
def test_a_law_stays_a_law_in_a_model_file(name: str, tmp_path: Any) -> None:
    law = laws.by_name(name)
    given = {**example(name), **{own: p.default for own, p in law.options.items()}}
    if law.increasing:
        given["v_0"] = 0.1
    # The state of the slip law has no rate where a motion reverses.
    speed = "-10*F" if law.increasing else "F/10"
    contact = law("2*d_x", surface_speed=speed, unit="N", **given)
    system = block(contact)
    text = system.to_toml()
    assert f'law = "{name}"' in text
    assert loads(text) == system
    assert loads(text).contacts["right foot"] == contact
    # stored with a result
    motion = ss.simulate(system)
    assert motion.certificate.ok
    motion.save(tmp_path / "motion.nc")
    again = ss.open(tmp_path / "motion.nc")
    assert again.system == system
    assert again.certificate.ok
    assert str(system.equations())
    assert system.plain.plain is system.plain
    assert loads(system.plain.to_toml()) == system.plain


def test_parts_have_the_name_of_the_contact() -> None:
    plain = block(ss.laws.iwan("d_x", F_c="F", k=4, elements=3)).plain
    assert list(plain.contacts) == ["right foot 1", "right foot 2", "right foot 3"]
    assert plain.initial["r_right_foot_2"] == 2.0
    assert list(block(ss.laws.dahl("d_x", F_c=1, k=2)).plain.internal) == ["z_right_foot"]
    assert plain.coordinates["r_right_foot_1"].unit == "m"
    shifted = block(
        ss.laws.jenkins("2*d_x", F_c=1.0, k=2.0), potential=0.0, translation={"x": 1}
    ).plain
    assert shifted.translation == {"x": 1, "r_right_foot": 2.0}


def test_a_force_acts_along_the_direction() -> None:
    """Two masses under a law between them keep their momentum."""
    pair = ss.System(
        "pair",
        coordinates={"a": ss.Inertial(force="sin(t)"), "b": ss.Inertial(force="-sin(t)")},
        kinetic="d_a**2/2 + d_b**2",
        contacts={"joint": ss.laws.dahl("d_a - d_b", F_c=0.3, k=2.0)},
        initial={"d_a": 1.0},
        span=(0.0, 7.0),
    )
    end = ss.simulate(pair).final
    assert end["d_a"] + 2 * end["d_b"] == pytest.approx(1.0, abs=1e-9)
    assert "force_joint" in str(pair.plain.coordinates["b"].force)


def test_two_laws_along_one_direction_add_up() -> None:
    contacts = {
        "dry": ss.laws.coulomb("d_x", F_c=0.1),
        "joint": ss.laws.jenkins("d_x", F_c=0.2, k=3.0),
        "bristles": ss.laws.dahl("d_x", F_c=0.2, k=3.0),
    }
    system = block(ss.laws.dahl("d_x", F_c="F/10", k=2.0))
    both = ss.System(
        "both",
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="x**2/2",
        contacts={**contacts, **system.contacts} | {"dry": contacts["dry"]},
        parameters={"F": ss.Parameter(1.0)},
        initial={"x": 1.0},
        span=(0.0, 10.0),
    )
    assert ss.simulate(both).certificate.ok


WRONG = [
    (
        'law = "stribek", direction = "d_x"',
        "contacts.'foot'.law: unknown law 'stribek'. Did you mean 'stribeck'?",
    ),
    ('law = "Lu-Gre", direction = "d_x"', "Did you mean 'lugre'?"),
    ('law = ["dahl", "lugre"], direction = "d_x"', "contacts.'foot'.law: a contact has one law"),
    ('law = 3, direction = "d_x"', "contacts.'foot'.law: expected a string, got a number"),
    ('law = "dahl", F_c = 1, k = 2', "contacts.'foot'.direction: this key is missing"),
    (
        'law = "dahl", direction = 1, F_c = 1, k = 2',
        "contacts.'foot'.direction: expected one linear",
    ),
    (
        'law = "dahl", direction = "d_x", F_c = 1',
        "contacts.'foot'.k: the stiffness before slip is missing. Add it, as in: k = 4",
    ),
    (
        'law = "dahl", direction = "d_x", F_c = 1, F_C = 2',
        "contacts.'foot'.F_C: unknown parameter of 'dahl'. Did you mean 'F_c'?",
    ),
    (
        'law = "dahl", direction = "d_x", threshold = 2',
        "contacts.'foot'.threshold: unknown parameter of 'dahl'. Known here: F_c, k",
    ),
    (
        'law = "dahl", direction = "d_x", F_c = -1, k = 2',
        "contacts.'foot'.F_c: -1 is outside the admissible range (0, inf). "
        "Choose a value in this range",
    ),
    ('law = "dahl", direction = "d_x", F_c = "-F", k = 2', "contacts.'foot'.F_c: -1 is outside"),
    (
        'law = "dahl", direction = "d_x", F_c = nan, k = 2',
        "contacts.'foot'.F_c: the number is not finite",
    ),
    (
        'law = "dahl", direction = "d_x", F_c = true, k = 2',
        "contacts.'foot'.F_c: expected a formula or a list of formulas, got true or false",
    ),
    (
        'law = "dahl", direction = "d_x", F_c = [1, 2], k = 2',
        "contacts.'foot'.F_c: expected a formula, got a list",
    ),
    ('law = "dahl", direction = "d_x", F_c = "G", k = 2', "contacts.'foot'.F_c: unknown name 'G'"),
    (
        'law = "dahl", direction = "d_y", F_c = 1, k = 2',
        "contacts.'foot'.direction: unknown name 'd_y'. Did you mean 'd_x'?",
    ),
    (
        'law = "dahl", direction = "d_x**2", F_c = 1, k = 2',
        "contacts.'foot'.direction: not a linear combination of rates",
    ),
    (
        'law = "dahl", direction = "abs(d_x)", F_c = 1, k = 2',
        "contacts.'foot'.direction: not a linear combination of rates",
    ),
    (
        'law = "dahl", direction = "d_x + F", F_c = 1, k = 2',
        "contacts.'foot'.direction: it contains 'F', which is not a rate. "
        "Move it to 'surface_speed'",
    ),
    (
        'law = "bouc_wen", direction = "d_x", F_c = 1, k = 2, sigma = 0.4',
        "contacts.'foot'.sigma: 0.4 is outside the admissible range [0.5, inf)",
    ),
    (
        'law = "iwan", direction = "d_x", F_c = 1, k = 2, elements = 2.5',
        "contacts.'foot'.elements: not an integer between 1 and 1000",
    ),
    (
        'law = "iwan", direction = "d_x", F_c = 1, k = 2, elements = "F"',
        "contacts.'foot'.elements: not an integer",
    ),
    (
        'law = "maxwell_slip", direction = "d_x", F_c = 1, k = [2]',
        "contacts.'foot'.F_c: expected a list",
    ),
    (
        'law = "maxwell_slip", direction = "d_x", F_c = [1, 2], k = [2]',
        "its lists have different lengths: 'F_c' has 2 and 'k' has 1",
    ),
    (
        'law = "maxwell_slip", direction = "d_x", F_c = [1, -2], k = [2, 1]',
        "contacts.'foot'.F_c[1]: -2 is outside",
    ),
]


@pytest.mark.parametrize(("entry", "message"), WRONG)
def test_what_is_wrong_is_said_where_it_stands(entry: str, message: str) -> None:
    with pytest.raises(DeclarationError, match=re.escape(message)):
        _ = loads(FILE.format(entry=entry))


def test_ranges_hold_for_the_values_of_a_motion() -> None:
    system = loads(FILE.format(entry='law = "dahl", direction = "d_x", F_c = "2*F", k = 2'))
    with pytest.raises(DeclarationError, match=r"'foot'.F_c: -2 is outside .* \(0, inf\)"):
        _ = ss.simulate(system, parameters={"F": -1.0})
    with pytest.raises(DeclarationError, match=r"'foot'.F_c: -2 is outside"):
        _ = system.with_parameters(F=-1.0)


def test_names_that_are_taken() -> None:
    with pytest.raises(DeclarationError, match="its law needs the name 'z_right_foot', which is"):
        _ = block(
            ss.laws.dahl("d_x", F_c=1, k=2),
            internal={"z_right_foot": ss.Internal("-z_right_foot")},
        )
    with pytest.raises(DeclarationError, match="needs the name 'foot 1', which is already used"):
        _ = ss.System(
            "both",
            coordinates={"x": ss.Inertial()},
            kinetic="d_x**2/2",
            contacts={
                "foot 1": ss.Contact("d_x", 1.0),
                "foot": ss.laws.iwan("d_x", F_c=1, k=1, elements=2),
            },
        )


def test_what_only_inertial_coordinates_can_have() -> None:
    with pytest.raises(DeclarationError, match="'foot'"):
        _ = ss.System(
            "light",
            coordinates={"x": ss.Viscous()},
            viscous="d_x**2/2",
            contacts={"foot": ss.laws.lugre("d_x", **example("lugre"))},
        )


def test_units_of_a_law_are_checked() -> None:
    with pytest.warns(UserWarning, match="threshold"):
        _ = ss.System(
            "units",
            parameters={"mu": ss.Parameter(0.3, "m/s"), "m": ss.Parameter(1.0, "kg")},
            coordinates={"x": ss.Inertial("m")},
            kinetic="m/2*d_x**2",
            contacts={"foot": ss.laws.coulomb("d_x", F_c="mu*m", unit="N")},
            time_unit="s",
        )


def test_a_page_says_which_parameters_may_be_left_out() -> None:
    from stickslip.display.system_page import law_page
    from stickslip.page import Html

    for name in laws.all_names():
        law = laws.by_name(name)
        rows = [row.split("<td") for row in law_page(law, Html("")).split("<tr>")]
        told = {
            cells[1].split(">")[1].split("<")[0]: "yes" in cells[-1]
            for cells in rows
            if len(cells) > 4
        }
        if law.options:
            assert {own: told[own] for own in law.known()} == {
                own: own in law.options for own in law.known()
            }


@pytest.mark.parametrize("end", [" # soft", " -", " *", " + (1", " -\n"])
@pytest.mark.parametrize("section", ["potential", "kinetic", "viscous"])
def test_what_is_added_to_an_energy_does_not_end_it(section: str, end: str) -> None:
    """The spring of a slider stands behind the declared energy; a comment would hide it, and an
    open end change its sign."""
    energies = {"potential": "x**2/2", "kinetic": "d_x**2/2", "viscous": "d_x**2/20"}
    law = ss.laws.jenkins("d_x", F_c=0.5, k=2.0)
    with pytest.raises(DeclarationError, match=f"{section}: .*(formula|read)"):
        block(law, **{**energies, section: energies[section] + end})


@pytest.mark.parametrize("end", [" -", " *", " + (1", " -\n"])
def test_what_is_added_to_a_force_does_not_end_it(end: str) -> None:
    law = ss.laws.dahl("d_x", F_c=0.5, k=2.0)
    with pytest.raises(DeclarationError, match=r"force: .*(formula|read)"):
        block(law, coordinates={"x": ss.Inertial(force=f"cos(t){end}")})


def test_lines_after_a_comment_are_not_lost() -> None:
    with pytest.raises(DeclarationError, match="'#' is not allowed in a formula"):
        block(ss.Contact("d_x", 1.0), potential="x**2/2 # soft\n + x**4/4 # hard")
