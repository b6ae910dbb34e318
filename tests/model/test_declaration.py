"""Everything wrong in a declaration is found when it is declared, with the key, the reason and the
remedy."""

from dataclasses import fields, replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stickslip.errors import DeclarationError
from stickslip.model.system import (
    Condition,
    Contact,
    Inertial,
    Internal,
    Parameter,
    RateIndependent,
    System,
    Viscous,
)
from stickslip.symbolic import expressions as ex


def system(**changes: Any) -> System:
    """A system with every kind of entry; a changed mapping replaces single entries, None removes
    one."""
    entries: dict[str, Any] = {
        "name": "specimen",
        "parameters": {
            "m": Parameter(2.0, "kg", "mass", "(0, inf)"),
            "k": Parameter(3.0, "N/m"),
            "nu": Parameter(0.1),
            "s_0": Parameter(0.5),
        },
        "functions": {"mu(alpha)": "s_0*exp(-alpha)", "twice": "2*k"},
        "drives": {"ell": "sin(t)"},
        "coordinates": {
            "x": Inertial("m"),
            "y": Inertial("m"),
            "u": Viscous("m"),
            "z": RateIndependent("m"),
        },
        "internal": {"alpha": Internal("1 - alpha + abs(d_u)")},
        "kinetic": "m/2*(d_x**2 + d_y**2)",
        "potential": "k/2*(x - y)**2 + k/2*(u - ell)**2 + k/2*(z - u)**2",
        "viscous": "nu/2*(d_x**2 + d_u**2)",
        "contacts": {
            "pad": Contact("d_x - d_y", threshold="mu(alpha)"),
            "slider": Contact("d_u", threshold="mu(alpha)", surface_speed="0.1*cos(t)"),
            "play": Contact("d_z", threshold=("s_0", "2*s_0")),
        },
        "initial": {"x": 0.1},
        "span": (0, 10),
        "conditions": {"order": Condition("k > nu")},
        "facts": {"omega": "sqrt(k/m)"},
    }
    for key, value in changes.items():
        if isinstance(value, dict) and isinstance(entries.get(key), dict):
            value = {name: v for name, v in {**entries[key], **value}.items() if v is not None}
        entries[key] = value
    return System(**entries)


def test_the_specimen_is_right():
    d = system().declaration
    assert d.coordinates == ["x", "y", "u", "z"]
    assert d.state == ["x", "y", "d_x", "d_y", "u", "z", "alpha"]
    assert d.mass["x", "x"] is ex.sym("m")
    assert ("x", "y") not in d.mass
    assert d.damping == {("x", "x"): ex.sym("nu"), ("u", "u"): ex.sym("nu")}
    assert [c.kind for c in d.contacts] == ["inertial", "viscous", "rate-independent"]
    assert d.contacts[0].direction == {"x": ex.ONE, "y": ex.num(-1.0)}
    assert d.contacts[2].plus is ex.sym("s_0")
    assert d.contacts[2].minus is 2.0 * ex.sym("s_0")
    assert d.contacts[2].kinetic_minus is d.contacts[2].minus
    assert ex.evaluate(d.facts["omega"], system().values) == 1.5**0.5
    assert ex.evaluate(d.conditions["order"].margin, system().values) == pytest.approx(2.9)


pad, slider, play = (system().contacts[name] for name in ("pad", "slider", "play"))

WRONG = {
    # Names.
    "unknown name": ({"potential": "k*xx"}, "potential", "unknown name 'xx'"),
    "unknown name in a law": (
        {"internal": {"alpha": Internal("1 - alph")}},
        "internal.alpha.law",
        "name 'alph'",
    ),
    "unknown name in a threshold": (
        {"contacts": {"pad": replace(pad, threshold="mu(z")}},
        "contacts.'pad'.threshold",
        "not a formula",
    ),
    "unknown function": ({"potential": "cot(x)"}, "potential", "unknown function 'cot'"),
    "unused function": ({"functions": {"f(s)": "s + q"}}, "functions.'f(s)'", "unknown name 'q'"),
    "no name": ({"name": "  "}, "name", "is missing"),
    "bad name": ({"parameters": {"2m": Parameter(1.0)}}, "parameters.'2m'", "is not a name"),
    "reserved name": ({"parameters": {"t": Parameter(1.0)}}, "parameters.t", "fixed meaning"),
    "name taken": ({"functions": {"x": "1"}}, "functions.x", "declared twice"),
    "rate taken": ({"parameters": {"d_x": Parameter(1.0)}}, "coordinates.x", "declared twice"),
    "bad signature": ({"functions": {"f(s": "s"}}, "functions.'f(s'", "not a name"),
    # Parameters.
    "outside the range": (
        {"parameters": {"m": Parameter(-1.0, range="(0, inf)")}},
        "parameters.m",
        "outside",
    ),
    "on the open end": (
        {"parameters": {"m": Parameter(0.0, range="(0, inf)")}},
        "parameters.m",
        "outside",
    ),
    "no interval": (
        {"parameters": {"m": Parameter(1.0, range="positive")}},
        "parameters.m.range",
        "not an interval",
    ),
    "interval turned round": (
        {"parameters": {"m": Parameter(1.0, range="[2, 1]")}},
        "parameters.m.range",
        "interval",
    ),
    "not finite": (
        {"parameters": {"m": Parameter(float("nan"))}},
        "parameters.m",
        "not a finite number",
    ),
    "too large": ({"parameters": {"m": Parameter(10**400)}}, "parameters.m", "not a finite number"),
    "unit": ({"parameters": {"m": Parameter(1.0, "stone")}}, "parameters.m.unit", "'stone'"),
    "unit of a coordinate": (
        {"coordinates": {"x": Inertial("m//s")}},
        "coordinates.x.unit",
        "cannot parse",
    ),
    "unit of a contact": (
        {"contacts": {"pad": replace(pad, unit="N^")}},
        "contacts.'pad'.unit",
        "cannot parse",
    ),
    "unit of an internal variable": (
        {"internal": {"alpha": Internal("0", "?")}},
        "internal.alpha.unit",
        "cannot parse",
    ),
    "unit of time": ({"time_unit": "eon"}, "time_unit", "'eon'"),
    # Energy.
    "energy with rates": ({"potential": "x*d_x"}, "potential", "'d_x' is not allowed here"),
    "mass that depends on a viscous coordinate": (
        {"kinetic": "m/2*(d_x**2 + d_y**2)*(1 + u**2)"},
        "kinetic",
        "'u' is not allowed here",
    ),
    "mass of a viscous coordinate": (
        {"kinetic": "m/2*(d_x**2 + d_y**2 + d_u**2)"},
        "kinetic",
        "'d_u' is not allowed",
    ),
    "not quadratic": ({"kinetic": "m*(d_x**4 + d_y**2)"}, "kinetic", "not quadratic"),
    "with a kink": ({"kinetic": "m*(d_x*abs(d_x) + d_y**2)"}, "kinetic", "not quadratic"),
    "mass not positive": ({"kinetic": "m/2*(d_x**2 - d_y**2)"}, "kinetic", "not positive definite"),
    "mass singular": ({"kinetic": "m/2*(d_x - d_y)**2"}, "kinetic", "not positive definite"),
    "without mass": ({"kinetic": "m/2*d_x**2"}, "coordinates.y", "needs a mass"),
    "derivatives too large": ({"potential": "1e308*x**10"}, "potential", "derivatives"),
    # Dissipation.
    "viscosity missing": ({"viscous": "nu/2*d_x**2"}, "coordinates.u", "needs viscous friction"),
    "viscosity negative": (
        {"viscous": "nu/2*d_u**2 - nu/2*d_x**2"},
        "viscous",
        "not positive semidefinite",
    ),
    "viscosity indefinite": (
        {"viscous": "nu/2*(d_u**2 + d_x**2) + nu*d_x*d_y"},
        "viscous",
        "not positive semi",
    ),
    "viscosity of a rate-independent coordinate": (
        {"viscous": "nu/2*(d_u**2 + d_z**2)"},
        "viscous",
        "'d_z' is not allowed",
    ),
    "drag that drives": (
        {"coordinates": {"x": Inertial(drag="d_x**3 - d_x")}},
        "coordinates.x.drag",
        "creates energy",
    ),
    "force with a viscous rate": (
        {"coordinates": {"x": Inertial(force="d_u")}},
        "coordinates.x.force",
        "'d_u' is not allowed",
    ),
    # Contacts.
    "without contact": ({"contacts": {"play": None}}, "coordinates.z", "needs dry friction"),
    "two contacts": (
        {"contacts": {"more": Contact("d_z", 1.0)}},
        "contacts.'more'",
        "already has the contact 'play'",
    ),
    "negative threshold": (
        {"contacts": {"pad": replace(pad, threshold="-1")}},
        "contacts.'pad'.threshold",
        "its value is -1",
    ),
    "threshold negative later": (
        {"contacts": {"pad": replace(pad, threshold="1 + 2*cos(t)")}},
        "contacts.'pad'.threshold",
        "can become negative",
    ),
    "threshold negative elsewhere": (
        {"contacts": {"pad": replace(pad, threshold="1 + 2*cos(x)")}},
        "contacts.'pad'.threshold",
        "can become negative",
    ),
    "threshold undefined": (
        {"contacts": {"pad": replace(pad, threshold="sqrt(-1 - x)")}},
        "contacts.'pad'.threshold",
        "nan at the initial state",
    ),
    "one threshold of two": (
        {"contacts": {"play": replace(play, threshold=("1", "-1"))}},
        "contacts.'play'.threshold",
        "its value is -1",
    ),
    "three thresholds": (
        {"contacts": {"play": replace(play, threshold=("1", "1", "1"))}},
        "contacts.'play'.threshold",
        "a formula or a pair of formulas",
    ),
    "threshold of viscous rates": (
        {"contacts": {"pad": replace(pad, threshold="1 + d_u**2")}},
        "contacts.'pad'.threshold",
        "'d_u' is not allowed here",
    ),
    "kinetic above static": (
        {"contacts": {"pad": replace(pad, kinetic="2")}},
        "contacts.'pad'.kinetic",
        "the kinetic force at rest is 2, which is not between",
    ),
    "kinetic negative": (
        {"contacts": {"pad": replace(pad, kinetic="-0.1")}},
        "contacts.'pad'.kinetic",
        "not between",
    ),
    "kinetic and viscous": (
        {"contacts": {"slider": replace(slider, kinetic="0.1/(1 + speed)")}},
        "contacts.'slider'.kinetic",
        "must not depend on the speed",
    ),
    "kinetic and rate-independent": (
        {"contacts": {"play": replace(play, kinetic="0.1")}},
        "contacts.'play'.kinetic",
        "needs inertia or viscosity",
    ),
    "speed in a threshold": (
        {"contacts": {"pad": replace(pad, threshold="1 + speed")}},
        "contacts.'pad'.threshold",
        "'speed' is not allowed here",
    ),
    "direction of a position": (
        {"contacts": {"pad": replace(pad, direction="x")}},
        "contacts.'pad'.direction",
        "not a linear combination",
    ),
    "direction not linear": (
        {"contacts": {"pad": replace(pad, direction="d_x**2")}},
        "contacts.'pad'.direction",
        "not a linear combination",
    ),
    "direction of nothing": (
        {"contacts": {"pad": replace(pad, direction="m")}},
        "contacts.'pad'.direction",
        "not a linear combination",
    ),
    "direction with a constant": (
        {"contacts": {"pad": replace(pad, direction="d_x - 1")}},
        "contacts.'pad'.direction",
        "contains the constant -1",
    ),
    "direction of two kinds": (
        {"contacts": {"pad": replace(pad, direction="d_x - d_u")}},
        "contacts.'pad'.direction",
        "combines inertial and viscous coordinates",
    ),
    "surface speed of the state": (
        {"contacts": {"pad": replace(pad, surface_speed="x")}},
        "contacts.'pad'.surface_speed",
        "'x' is not allowed here",
    ),
    # The rest.
    "drive of the state": ({"drives": {"ell": "x"}}, "drives.ell", "'x' is not allowed here"),
    "cyclic definition": (
        {"functions": {"f": "g + 1", "g": "2*f"}},
        "functions.f",
        "cyclic definition: f -> g -> f",
    ),
    "cyclic function": (
        {"functions": {"f(s)": "1 + f(s/2)"}},
        "functions.'f(s)'",
        "cyclic definition: f -> f",
    ),
    "hostile formula": (
        {"potential": "__import__('os').system('true')"},
        "potential",
        "only plain functions",
    ),
    "endless formula": ({"potential": "9**9**9**9*x"}, "potential", "too large"),
    "initial of nothing": ({"initial": {"w": 1.0}}, "initial.w", "not a part of the state"),
    "initial rate of a viscous coordinate": (
        {"initial": {"d_u": 1.0}},
        "initial.d_u",
        "not a part of the state",
    ),
    "initial not finite": ({"initial": {"x": float("inf")}}, "initial.x", "not a finite number"),
    "span turned round": ({"span": (1, 0)}, "span", "not a time span"),
    "span not finite": ({"span": (0, float("inf"))}, "span", "not a time span"),
    "span of three": ({"span": (0, 1, 2)}, "span", "a pair of numbers"),
    "translation of nothing": ({"translation": {"w": 1}}, "translation.w", "not a coordinate"),
    "translation not finite": (
        {"translation": {"x": float("nan")}},
        "translation.x",
        "not a coordinate",
    ),
    "translation that changes the energy": (
        {"translation": {"x": 1}},
        "translation",
        "potential is not invariant",
    ),
    "translation that changes the backward threshold": (
        {
            "translation": {"x": 1, "y": 1},
            "contacts": {"pad": replace(pad, threshold=("1", "1 + x**2"))},
        },
        "translation",
        "contacts.'pad'.threshold is not invariant",
    ),
    "translation that changes a force": (
        {"translation": {"x": 1, "y": 1}, "coordinates": {"x": Inertial(force="x")}},
        "translation",
        "coordinates.x.force is not invariant",
    ),
    "translation that changes a threshold": (
        {"translation": {"x": 1, "y": 1}, "contacts": {"pad": replace(pad, threshold="1 + x**2")}},
        "translation",
        "contacts.'pad'.threshold is not invariant",
    ),
    "condition without comparison": (
        {"conditions": {"order": Condition("k")}},
        "conditions.order",
        "compare two",
    ),
    "condition of the state": (
        {"conditions": {"order": Condition("x > k")}},
        "conditions.order",
        "'x' is not allowed",
    ),
    "fact of the state": ({"facts": {"omega": "x"}}, "facts.omega", "'x' is not allowed here"),
    # Types.
    "parameters as a number": ({"parameters": 3}, "parameters", "expected a table, got a number"),
    "contacts as a list": ({"contacts": [1, 2]}, "contacts", "expected a table, got a list"),
    "parameter as a text": (
        {"parameters": {"m": "2.0"}},
        "parameters.m",
        "expected a number or a parameter, got a string",
    ),
    "parameter as a truth value": (
        {"parameters": {"m": True}},
        "parameters.m",
        "expected a number or a parameter, got true or false",
    ),
    "parameter that is not finite": (
        {"parameters": {"m": float("nan")}},
        "parameters.m",
        "not a finite number",
    ),
    "parameter as a contact": (
        {"parameters": {"m": Contact("d_x", 1.0)}},
        "parameters.m",
        "expected a number or a parameter, got",
    ),
    "default as a text": (
        {"parameters": {"m": Parameter("2")}},  # pyright: ignore[reportArgumentType]
        "parameters.m.default",
        "expected a number",
    ),
    "default as a bool": (
        {"parameters": {"m": Parameter(True)}},
        "parameters.m.default",
        "got true or false",
    ),
    "range as a number": (
        {"parameters": {"m": Parameter(2.0, range=5)}},  # pyright: ignore[reportArgumentType]
        "parameters.m.range",
        "expected a string",
    ),
    "formula as a list": ({"potential": ["x"]}, "potential", "expected a formula, got a list"),
    "key as a number": ({"initial": {1: 2.0}}, "initial", "a key is not a string"),
    "too many coordinates": (
        {"coordinates": {f"x_{i}": Inertial() for i in range(50_001)}},
        "coordinates",
        "at most",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_declaration(case):
    changes, where, reason = WRONG[case]
    with pytest.raises(DeclarationError) as caught:
        system(**changes)
    error = caught.value
    assert error.where == where
    assert reason in error.reason
    assert error.remedy
    assert str(error) == f"{where}: {error.reason}. {error.remedy}"


ANYTHING = st.recursive(
    st.one_of(
        st.none(),
        st.booleans(),
        st.integers(),
        st.floats(),
        st.text(max_size=5),
        st.sampled_from(["x", "d_x", "m", "k*x", "sin(t)", "viscous", "(0, 1)", 10**400, 1j]),
        st.sampled_from([Parameter(1.0), Inertial(), Contact("d_x", 1)]),
    ),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.tuples(inner, inner),
        st.dictionaries(
            st.one_of(st.text(max_size=4), st.sampled_from(["x", "m", "f(s)", 1])),
            inner,
            max_size=3,
        ),
    ),
    max_leaves=8,
)


SPECIMEN = {entry.name: getattr(system(), entry.name) for entry in fields(System)}


@settings(max_examples=200, deadline=None)
@given(st.sampled_from([entry.name for entry in fields(System)]), ANYTHING)
def test_anything_is_accepted_or_refused(key, value):
    try:
        System(**{**SPECIMEN, key: value})
    except DeclarationError as error:
        assert error.reason
        assert error.remedy
        assert str(error).isprintable()


@settings(max_examples=200, deadline=None)
@given(
    st.sampled_from([Parameter, Inertial, Viscous, RateIndependent, Internal, Contact, Condition]),
    st.data(),
)
def test_any_entry_is_accepted_or_refused(cls, data):
    entry = cls(**{f.name: data.draw(ANYTHING) for f in fields(cls)})
    section = {
        Parameter: "parameters",
        Internal: "internal",
        Contact: "contacts",
        Condition: "conditions",
    }
    try:
        system(**{section.get(cls, "coordinates"): {"new": entry}})
    except DeclarationError as error:
        assert error.where
        assert error.remedy


def test_empty_system():
    with pytest.raises(
        DeclarationError, match=r"coordinates: .* no coordinates and no internal variables"
    ):
        System(name="nothing")


def test_internal_variables_alone():
    d = System(
        name="ode", internal={"a": Internal("b"), "b": Internal("-a + max(b, 0)")}
    ).declaration
    assert d.state == ["a", "b"]
    assert d.coordinates == []


def test_threshold_that_stays_positive_is_accepted():
    for threshold in (
        "1 + cos(t)",
        "max(2*cos(x), 0)",
        "clip(5*sin(x), 0, 1)",
        "abs(x)",
        "exp(x)",
        "1 + x",
        "0",
    ):
        system(contacts={"pad": replace(pad, threshold=threshold)})


def test_drag_is_accepted_if_it_resists():
    for drag in ("d_x**3", "0.1*d_x*abs(d_x)", "tanh(d_x)", "d_x/(1 + d_x**2)"):
        system(coordinates={"x": Inertial(drag=drag)})


def test_derivatives_of_functions_and_drives():
    d = system(
        contacts={"slider": replace(slider, surface_speed="d_ell")},
        internal={"alpha": Internal("d_mu(2*alpha)")},
    ).declaration
    assert d.contacts[1].speed is ex.call("cos", ex.sym("t"))
    assert ex.evaluate(d.laws["alpha"], {"alpha": 0.0, "s_0": 0.5}) == -0.5
    # A name that the declaration uses itself comes first.
    d = system(
        parameters={"d_ell": Parameter(7.0)}, internal={"alpha": Internal("d_ell")}
    ).declaration
    assert d.laws["alpha"] is ex.sym("d_ell")


def test_configure():
    original = system()
    changed = original.configure({"m": 5, "mu": "s_0", "ell": "0.3*t", "twice": 2})
    assert changed.parameters["m"] == replace(original.parameters["m"], default=5.0)
    assert changed.functions == {"mu(alpha)": "s_0", "twice": 2}
    assert changed.drives == {"ell": "0.3*t"}
    assert original == system()
    assert original.with_parameters(k=4.0).values["k"] == 4.0
    for change, reason in [
        ({"mm": 1.0}, r"'mm'. Did you mean 'm'\?"),
        ({"m": "2"}, "not a finite number"),
        ({"m": -1.0}, "outside"),
        ({"mu": "alpha +"}, "not a formula"),
    ]:
        with pytest.raises(DeclarationError, match=reason):
            original.configure(change)


def test_parameters_are_checked_again():
    d = system().declaration
    d.check_parameters({"m": 1.0, "k": -2.0, "nu": 0.1, "s_0": 0.0})
    for values in ({"m": -1.0}, {"m": float("nan")}, {"unknown": 1.0}, {"m": 10**400}):
        with pytest.raises(DeclarationError, match=r"parameters\."):
            d.check_parameters(system().values | values)
    with pytest.raises(DeclarationError, match="viscous matrix"):
        d.check_parameters(system().values | {"nu": 0.0})


def test_damping_may_be_singular():
    """Two dashpots on three coordinates, of which two move almost alike: pivots are rounding."""
    parts = {
        "coordinates": {x: Inertial() for x in "abc"},
        "kinetic": "d_a**2/2 + d_b**2/2 + d_c**2/2",
    }
    damping = "(d_a + d_b)**2/2 + (1e-7*d_b + d_c)**2/2"
    assert System(name="dashpots", viscous=damping, **parts).declaration
    with pytest.raises(DeclarationError, match="viscous matrix is not positive semidefinite"):
        System(name="dashpots", viscous=f"{damping} - 1e-6*d_a*d_c", **parts)


def test_pairs_may_be_lists():
    same = system(contacts={"play": Contact("d_z", threshold=["s_0", "2*s_0"])}, span=[0, 10])  # type: ignore[arg-type]
    assert same == system()
    assert hash(same) == hash(system())


@pytest.mark.parametrize(
    ("given", "where", "remedy"),
    [
        ({"direction": "sqrt(d_x**2 + d_y**2)"}, "direction", r"direction = \['d_x', 'd_y'\]"),
        ({"direction": ["d_x"]}, "direction", r"\['d_x', 'd_y'\]"),
        (
            {"direction": ["d_x", "d_y", "d_x"]},
            "axes",
            "expected 3 semi-axes, one for each direction, got 2",
        ),
        ({"direction": ["d_x", "d_y", "d_x"], "axes": [1, 1, 1]}, "direction", "parallel"),
        ({"direction": ["d_x*d_y", "d_y"]}, "direction", "not a linear combination"),
        ({"direction": ["d_x", "2*d_x"]}, "direction", "parallel"),
        ({"axes": [1, 0]}, "axes", "outside the admissible range"),
        ({"axes": [1, -1.0]}, "axes", "outside the admissible range"),
        ({"threshold": 1e300}, "threshold", "outside the admissible range"),
        ({"threshold": [1, 2]}, "threshold", "a single threshold for all directions"),
        ({"kinetic": [0.1, 0.2]}, "kinetic", "a single threshold for all directions"),
        ({"surface_speed": "0.1"}, "surface_speed", r"\['0.1', 0\]"),
        ({"direction": "d_x", "surface_speed": [1, 0]}, "surface_speed", "along a line has one"),
        ({"direction": "d_x", "axes": [1, 2]}, "axes", "only a contact in a plane has axes"),
    ],
)
def test_what_a_contact_in_a_plane_is_refused_for(
    given: dict[str, Any], where: str, remedy: str
) -> None:
    with pytest.raises(DeclarationError, match=rf"contacts.*table.*{where}.*{remedy}"):
        System(
            "puck",
            coordinates={"x": Inertial(), "y": Inertial()},
            kinetic="(d_x**2 + d_y**2)/2",
            contacts={"table": Contact(**{"direction": ["d_x", "d_y"], "threshold": 1.0, **given})},
        )
