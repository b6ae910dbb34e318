"""Contacts in a plane whose dissipation is a formula: R(u), convex, homogeneous of degree 1."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.convex.formula import convex_formula
from stickslip.errors import DeclarationError
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.formulas import Scope

M = np.array([[1.0, 0.2], [0.2, 1.3]])
K = np.array([[1.0, 0.3], [0.3, 0.8]])
START = {"x": 1.0, "y": 0.5, "d_x": 0.3, "d_y": -0.4}
PIECES = "sqrt((0.7*max(v1, 0) + 1.3*max(-v1, 0))**2 + 0.36*v2**2)"
FORMULAS = (
    "sqrt(v1**2 + 4*v2**2) + 0.2*v1",
    PIECES,
    "(v1**4 + v2**4 + v1**2*v2**2)**0.25",
    "sqrt(v1**2 + v2**2) + 0.3*sqrt((v1 + v2)**2 + 0.1*v2**2)",
)


def puck(contact, extra="", push=(0.7, 0.5), parameters=None):
    return ss.System(
        "puck",
        parameters=parameters or {},
        coordinates={"x": ss.Inertial("m"), "y": ss.Inertial("m")},
        kinetic="(d_x**2 + 1.3*d_y**2 + 0.4*d_x*d_y)/2",
        potential="x**2/2 + 0.8*y**2/2 + 0.3*x*y"
        f" - ({push[0]})*x*sin(t) - ({push[1]})*y*cos(1.3*t){extra}",
        contacts={"rub": contact},
        initial=START,
    )


def contact(formula, threshold: float | str = 0.7, **others):
    return ss.Contact(("d_x", "d_y"), threshold, dissipation=formula, **others)


def apart(one, other, until, names=("x", "y", "d_x", "d_y")):
    t = np.linspace(0.0, until, 501)
    a, b = one.at(t), other.at(t)
    return max(float(np.abs(a[name] - b[name]).max()) for name in names)


def regularised(formula, threshold, eps, until):
    """The motion with λ = −s R ∇R/√(R² + ε²), by SciPy: it creeps where the contact sticks."""
    scope = Scope({name: ex.sym(name) for name in ("v1", "v2")})
    R = convex_formula(scope.parse(formula, "R"), ("v1", "v2"), {}, "R")
    inverse = np.linalg.inv(M)

    def rates(t, y):
        q, u = y[:2], y[2:]
        force = np.array([0.7 * np.sin(t), 0.5 * np.cos(1.3 * t)]) - K @ q
        if u.any():
            value, *slope = R.numbers([*u])[:3]
            force -= threshold * value / np.hypot(value, eps) * np.array(slope)
        return [*u, *(inverse @ force)]

    start = [START[name] for name in ("x", "y", "d_x", "d_y")]
    return solve_ivp(
        rates, (0.0, until), start, method="LSODA", rtol=1e-9, atol=1e-11, dense_output=True
    )


def test_an_ellipse_as_a_formula_moves_as_one_with_axes():
    until = 30.0
    one = ss.simulate(puck(ss.Contact(("d_x", "d_y"), 0.9, axes=(1.0, 0.6))), (0.0, until))
    other = ss.simulate(puck(contact("sqrt(v1**2 + 0.36*v2**2)", 0.9)), (0.0, until))
    assert one.n_switches == other.n_switches > 4
    assert one.certificate and other.certificate.ok
    assert apart(one, other, until) < 1e-11


def test_a_linear_part_is_a_constant_force():
    until = 30.0
    one = ss.simulate(puck(ss.Contact(("d_x", "d_y"), 0.7), " + 0.7*(0.3*x + 0.2*y)"), (0.0, until))
    other = ss.simulate(puck(contact("sqrt(v1**2 + v2**2) + 0.3*v1 + 0.2*v2")), (0.0, until))
    assert one.n_switches == other.n_switches > 4
    assert apart(one, other, until) < 1e-12


@pytest.mark.parametrize("angle", (0.3, 1.2, 2.5))
def test_directions_may_be_turned(angle):
    """The same friction, declared along turned axes."""
    until = 20.0
    c, s = np.cos(angle), np.sin(angle)
    formula = FORMULAS[0]
    turned = formula.replace("v1", "(C*w1 - S*w2)").replace("v2", "(S*w1 + C*w2)")
    turned = turned.replace("w", "v").replace("C", f"({c!r})").replace("S", f"({s!r})")
    along = (f"({c!r})*d_x + ({s!r})*d_y", f"-({s!r})*d_x + ({c!r})*d_y")
    one = ss.simulate(puck(contact(formula)), (0.0, until))
    other = ss.simulate(puck(ss.Contact(along, 0.7, dissipation=turned)), (0.0, until))
    assert one.n_switches == other.n_switches > 2
    assert apart(one, other, until) < 1e-10


@pytest.mark.parametrize("formula", FORMULAS)
def test_the_regularised_motion_tends_to_ours(formula):
    until, threshold = 10.0, 0.7
    motion = ss.simulate(puck(contact(formula, threshold)), (0.0, until))
    assert motion.certificate.ok
    t = np.linspace(0.0, until, 101)
    ours = motion.at(t)
    errors = []
    for eps in (1e-3, 1e-4):
        theirs = regularised(formula, threshold, eps, until).sol(t)
        errors.append(max(np.abs(theirs[0] - ours["x"]).max(), np.abs(theirs[1] - ours["y"]).max()))
    assert errors[1] < 3e-3
    assert errors[1] < 0.4 * errors[0]


@pytest.mark.parametrize("seed", range(6))
def test_pieces_of_a_formula_on_the_way_to_rest(seed):
    """Kinks of the velocity vanish where a slip ends, all at once."""
    a, b, s = np.random.default_rng(seed).uniform(0.3, 1.2, 3)
    motion = ss.simulate(puck(contact(PIECES, s), push=(a, b)), (0.0, 40.0))
    assert motion.outcome.name == "FINISHED"
    assert motion.certificate.ok


@pytest.mark.parametrize("seed", range(8))
def test_a_drag_with_a_kink_on_the_way_to_rest(seed):
    """A force with a kink where a component of the velocity vanishes, which it does at rest."""
    a, b, s = np.random.default_rng(seed).uniform(0.3, 1.2, 3)
    system = puck(ss.Contact(("d_x", "d_y"), s), push=(a, b))
    drag = ss.Inertial("m", force="-0.1*abs(d_x)*d_x")
    motion = ss.simulate(
        replace(system, coordinates={**system.coordinates, "x": drag}), (0.0, 40.0)
    )
    assert motion.outcome.name == "FINISHED"
    assert motion.certificate.ok


@pytest.mark.parametrize("formula", FORMULAS)
def test_rest_is_where_forces_are_in_their_set(formula):
    """Pushed slowly in some direction, it begins to slip where −λ·v = s R(v) for some v: at the
    radius of the set in that direction."""
    scope = Scope({name: ex.sym(name) for name in ("v1", "v2")})
    R = convex_formula(scope.parse(formula, "R"), ("v1", "v2"), {}, "R")
    angles = np.linspace(0.0, 2.0 * np.pi, 200001)
    ways = np.array([np.cos(angles), np.sin(angles)])
    values = R.values([*ways])[0]
    for angle in np.random.default_rng(5).uniform(0.0, 2.0 * np.pi, 5):
        push = np.array([np.cos(angle), np.sin(angle)])
        along = push @ ways
        radius = np.min(np.where(along > 1e-9, values / np.where(along > 1e-9, along, 1.0), np.inf))
        system = ss.System(
            "slowly",
            coordinates={"x": ss.Inertial("m"), "y": ss.Inertial("m")},
            kinetic="(d_x**2 + d_y**2)/2",
            potential=f"-t*({push[0]!r}*x + {push[1]!r}*y)",
            contacts={"rub": contact(formula, 0.5)},
        )
        motion = ss.simulate(system, (0.0, 4.0))
        first = motion.events.iloc[0]
        assert (first["from"], first["to"]) == ("stick", "slip")
        assert first["time"] == pytest.approx(0.5 * radius, rel=1e-8)
        assert motion.certificate.ok


@pytest.mark.parametrize("formula", FORMULAS)
def test_derivatives_through_begin_and_end(formula):
    system = puck(
        contact(formula, "s"),
        push=("F", 0.5),
        parameters={"F": ss.Parameter(0.7), "s": ss.Parameter(0.8)},
    )
    until = 9.0
    motion = ss.simulate(system, (0.0, until))
    assert len(motion.events) >= 2
    found = motion.sensitivity(["F", "s"])
    for name, h in (("F", 2e-6), ("s", 2e-6)):
        value = system.values[name]
        ends = [
            ss.simulate(system, (0.0, until), parameters={name: value + side * h}).final
            for side in (1.0, -1.0)
        ]
        for x in ("x", "y", "d_x", "d_y"):
            quotient = (ends[0][x] - ends[1][x]) / (2.0 * h)
            exact = float(found[x].sel(parameter=name)[-1])
            assert exact == pytest.approx(quotient, rel=2e-4, abs=2e-5)


@pytest.mark.parametrize("c", (1.0, 2.0, 0.5))
def test_speed_is_the_dissipation(c):
    """(1 + c v) dv = −c dt with k = 1/(1 + R), R = c v."""
    weak = contact(f"{c}*sqrt(v1**2 + v2**2)", 1.0, kinetic="1/(1 + speed)")
    system = replace(puck(weak), kinetic="(d_x**2 + d_y**2)/2", potential="0", initial={})
    motion = ss.simulate(system, (0.0, 3.0), initial={"d_x": 0.5})
    assert motion.certificate
    assert motion.events["time"].iloc[0] == pytest.approx(0.5 / c + 0.125, rel=1e-12)


def test_a_cycle_and_its_multipliers():
    system = puck(contact(FORMULAS[0], 0.5), push=(0.9, 0.0))
    cycle = ss.find_cycle(system)
    assert cycle.certificate.ok
    assert cycle.stable


def test_parameters_of_a_formula_are_checked_where_they_change():
    system = puck(contact("sqrt(v1**2 + v2**2) + c*v1"), parameters={"c": ss.Parameter(0.3)})
    assert ss.simulate(system, (0.0, 1.0), parameters={"c": 0.9}).certificate.ok
    with pytest.raises(DeclarationError, match="nonnegative"):
        ss.simulate(system, (0.0, 1.0), parameters={"c": 1.2})


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"dissipation": "v1**2 + v2**2"}, "degree 2"),
        ({"dissipation": "abs(v1) + abs(v2)"}, "gradient jumps"),
        ({"dissipation": "max(abs(v1), sqrt(v1**2 + v2**2)*0.9)"}, "gradient jumps"),
        ({"dissipation": "sqrt(v1**2)"}, r"gradient jumps|vanishes along"),
        ({"dissipation": "sqrt(v1**2 + v2**2) - 2*v1"}, "nonnegative"),
        ({"dissipation": "sqrt(v1**2 + v2**2) + 1.3*v1**2/sqrt(v1**2 + v2**2)"}, "not convex"),
        ({"dissipation": "sqrt(v1**2 + v3**2)"}, "v3"),
        ({"dissipation": "sqrt(v1**2 + d_x**2)"}, "d_x"),
        ({"dissipation": "sqrt(v1**2 + v2**2)", "axes": (1.0, 0.5)}, "axes"),
        ({"dissipation": "sqrt(v1**2 + q*v2**2)"}, "Known here: v1, v2$"),
        ({"dissipation": "1e300*sqrt(v1**2 + v2**2)"}, "square overflows"),
        ({}, "missing"),
    ],
)
def test_what_is_refused(given, reason):
    with pytest.raises(DeclarationError, match=reason):
        ss.simulate(puck(ss.Contact(("d_x", "d_y"), **given)), (0.0, 1.0))


def test_lines_and_massless_coordinates_have_none():
    system = puck(contact(FORMULAS[0]))
    line = ss.Contact("d_x", 1.0, dissipation="sqrt(v1**2 + v2**2)")
    with pytest.raises(DeclarationError, match="along a line"):
        ss.simulate(replace(system, contacts={"rub": line}), (0.0, 1.0))
    with pytest.raises(DeclarationError, match="inertial"):
        ss.System(
            "soft",
            coordinates={"x": ss.Viscous("m"), "y": ss.Viscous("m")},
            viscous="(d_x**2 + d_y**2)/2",
            potential="(x**2 + y**2)/2",
            contacts={"rub": contact(FORMULAS[0])},
        )
