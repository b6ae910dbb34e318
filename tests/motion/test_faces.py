"""Faces that slide and spin: a coin and a ring on a table, and the ellipsoid in their place.

References: Z. Farkas, G. Bartels, T. Unger & D. E. Wolf, Phys. Rev. Lett. 90, 248302 (2003), for
v/(aω) → 0.6530; closed forms of pure sliding and spinning; an integral over the face by Gauss
points, with SciPy's integrator.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import minimize
from scipy.special import ellipe, ellipk

import stickslip as ss
from stickslip.convex.faces import mean_speeds
from stickslip.errors import DeclarationError
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.evaluator import evaluator
from stickslip.symbolic.formulas import Scope

MU, G = 0.3, 10.0
NAMES = ("v1", "v2", "v3")


def coin(form="disc", inertia=0.5, potential="0", **start):
    given: dict[str, Any] = {"axes": (1, 1, "2*a/3")} if form == "ellipsoid" else {}
    if form != "ellipsoid":
        given["dissipation"] = f"{form}(v1, v2, a*v3)"
    return ss.System(
        "coin",
        parameters={
            "m": ss.Parameter(1.0, "kg"),
            "a": ss.Parameter(1.0, "m"),
            "mu": ss.Parameter(MU),
            "g": ss.Parameter(G, "m/s^2"),
        },
        coordinates={"x": ss.Inertial("m"), "y": ss.Inertial("m"), "phi": ss.Inertial("rad")},
        kinetic=f"m/2*(d_x**2 + d_y**2) + {inertia}*m*a**2/2*d_phi**2",
        potential=potential,
        contacts={"face": ss.Contact(("d_x", "d_y", "d_phi"), "mu*m*g", **given, unit="N")},
        initial=start,
        time_unit="s",
    )


@pytest.fixture(scope="module")
def disc():
    return coin()


def ratio_left(motion, left):
    """v/(aω) at parts of the time that is left until it stops."""
    stop = motion.events["time"].iloc[-1]
    at = motion.at(stop * (1.0 - np.array(left)))
    return np.hypot(at["d_x"], at["d_y"]) / np.abs(at["d_phi"])


def disc_forces(slide, spin):
    """Force and moment of a disc in parts of μN and μN a, as in the paper, by SciPy's elliptic
    integrals."""
    eps = slide / spin
    if eps <= 1.0:
        E, K = ellipe(eps**2), ellipk(eps**2)
        force = ((eps**2 + 1.0) * E + (eps**2 - 1.0) * K) / eps
        moment = (4.0 - 2.0 * eps**2) * E + (eps**2 - 1.0) * K
    else:
        E, K = ellipe(eps**-2), ellipk(eps**-2)
        force = (eps**2 + 1.0) * E - (eps**2 - 1.0) * K
        moment = eps * ((4.0 - 2.0 * eps**2) * E + (2.0 * eps**2 - 5.0 + 3.0 / eps**2) * K)
    return 4.0 / (3.0 * np.pi) * force, 4.0 / (9.0 * np.pi) * moment


@pytest.mark.parametrize("name", ("disc", "ring"))
def test_mean_speeds_are_integrals(name):
    scope = Scope({n: ex.sym(n) for n in NAMES}, mean_speeds())
    e = scope.parse(f"{name}(v1, v2, v3)", "R")
    f = evaluator([e, *(ex.derivative(e, n) for n in NAMES)], NAMES)
    rng = np.random.default_rng(1)
    for v in [*rng.normal(size=(12, 3)), (1.0, 0.0, 0.999), (1.0, 0.0, 1.0 + 1e-7)]:
        slide, spin = np.hypot(v[0], v[1]), v[2]

        def around(r, slide=slide, spin=spin):
            speed = lambda t: np.sqrt(  # noqa: E731
                slide**2 + (spin * r) ** 2 + 2.0 * slide * spin * r * np.cos(t)
            )
            return quad(speed, 0.0, np.pi, epsabs=1e-13, epsrel=1e-13, limit=200)[0] / np.pi

        exact = (
            around(1.0)
            if name == "ring"
            else quad(
                lambda r: 2.0 * r * around(r),
                0.0,
                1.0,
                points=[min(slide / abs(spin), 1.0)],
                epsabs=1e-13,
                limit=400,
            )[0]
        )
        value, *slope = (float(x) for x in np.ravel(f([np.array([x]) for x in v])))
        assert value == pytest.approx(exact, rel=1e-9)
        assert np.dot(slope, v) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize(
    ("slide", "spin"), [(0.5, 1.0), (0.1, 1.0), (0.9, 1.0), (2.0, 0.5), (1e-3, 1.0)]
)
def test_a_coin_stops_sliding_and_spinning_at_once(disc, slide, spin):
    motion = ss.simulate(
        disc, (0.0, 3.0), initial={"d_x": 0.6 * slide, "d_y": 0.8 * slide, "d_phi": spin}
    )
    assert motion.certificate.ok
    assert [*motion.events["to"]].count("stick") == 1
    ratios = ratio_left(motion, [1e-6, 1e-8, 1e-10] if slide > 1e-2 else [1e-12])
    if slide > 1e-2:
        assert ratios[-1] == pytest.approx(0.65300, abs=3e-5)
        # each turn of the screw is nearer to it
        assert abs(ratios[1] - 0.65300) < abs(ratios[0] - 0.65300) + 1e-5
    else:
        assert 0.3 < ratios[0] < 0.654


def test_the_ratio_solves_its_equation():
    """At the end v/(aω) = ε stays what it is: F(ε)/m = ε T(ε) a/(I/a), with I = m a²/2."""
    scope = Scope({n: ex.sym(n) for n in NAMES}, mean_speeds())
    e = scope.parse("disc(v1, v2, v3)", "R")
    f = evaluator([ex.derivative(e, "v1"), ex.derivative(e, "v3")], NAMES)

    def off(eps):
        force, moment = (float(x) for x in np.ravel(f([np.array([x]) for x in (eps, 0.0, 1.0)])))
        return force - 2.0 * eps * moment

    low, high = 0.6, 0.7
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if off(middle) * off(low) > 0.0 else (low, middle)
    assert low == pytest.approx(0.65300, abs=5e-6)


@pytest.mark.parametrize("slide", (0.3, 1.0, 3.0))
def test_with_the_ellipsoid_sliding_dies_first(slide):
    motion = ss.simulate(coin("ellipsoid", d_x=slide, d_phi=1.0), (0.0, 3.0))
    assert motion.certificate.ok
    ratios = ratio_left(motion, [1e-2, 1e-6, 1e-10])
    assert ratios[0] > ratios[1] > ratios[2]
    assert ratios[2] < 0.3


@pytest.mark.parametrize(("form", "moment"), [("disc", 2 / 3), ("ring", 1.0), ("ellipsoid", 2 / 3)])
def test_pure_sliding_and_pure_spinning(form, moment):
    system = coin(form)
    sliding = ss.simulate(system, (0.0, 3.0), initial={"d_x": 0.6, "d_y": -0.8})
    assert sliding.events["time"].iloc[0] == pytest.approx(1.0 / (MU * G), rel=1e-13)
    spinning = ss.simulate(system, (0.0, 3.0), initial={"d_phi": -2.0})
    # I α = moment·μ m g a
    assert spinning.events["time"].iloc[0] == pytest.approx(
        0.5 * 2.0 / (moment * MU * G), rel=1e-13
    )
    assert spinning.certificate.ok
    assert sliding.certificate.ok


@pytest.mark.parametrize("start", [(0.6, 0.3, 1.5), (1.0, 0.4, 0.5)])
def test_against_an_independent_integrator(start):
    def rates(t, state):
        u, v, w = state[3:]
        force, moment = disc_forces(np.hypot(u, v), w)
        along = MU * G * force / np.hypot(u, v)
        return [u, v, w, -along * u, -along * v, -2.0 * MU * G * moment]

    motion = ss.simulate(coin(d_x=start[0], d_y=start[1], d_phi=start[2]), (0.0, 3.0))
    until = 0.9 * motion.events["time"].iloc[-1]
    first = [0.0, 0.0, 0.0, *start]
    theirs = solve_ivp(rates, (0.0, until), first, rtol=1e-10, atol=1e-12).y[:, -1]
    ours = motion.at(until)
    names = ("x", "y", "phi", "d_x", "d_y", "d_phi")
    assert np.abs(theirs - [float(ours[name]) for name in names]).max() < 1e-8


@pytest.mark.parametrize("form", ("disc", "ring", "ellipsoid"))
def test_it_begins_to_slip_where_the_force_leaves_its_set(form):
    """Loaded slowly: the time is the least of R(w)/(f·w) over all ways w to move."""
    scope = Scope({n: ex.sym(n) for n in NAMES}, mean_speeds())
    text = "sqrt(v1**2 + v2**2 + 4*v3**2/9)" if form == "ellipsoid" else f"{form}(v1, v2, v3)"
    R = evaluator([scope.parse(text, "R")], NAMES)
    system = replace(coin(form), time_unit="")
    loads = {name: ss.Parameter(0.0) for name in ("p", "q", "r")}
    load = "-mu*m*g*t*(p*x + q*y + r*a*phi)"
    system = replace(system, parameters={**system.parameters, **loads}, potential=load)
    rng = np.random.default_rng(3)
    for load in rng.normal(size=(3, 3)):

        def time(w, load=load):
            w = np.asarray(w) / np.linalg.norm(w)
            return float(R([np.array([x]) for x in w])[0][0]) / max(float(np.dot(load, w)), 1e-12)

        starts = rng.normal(size=(6, 3))
        starts *= np.sign(starts @ load)[:, None]
        best = min(
            minimize(time, w, method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-13}).fun
            for w in starts
        )
        given = dict(zip(loads, map(float, load), strict=True))
        motion = ss.simulate(system, (0.0, 4.0 * best), parameters=given)
        assert motion.certificate.ok
        assert motion.events["time"].iloc[0] == pytest.approx(best, rel=1e-8)


def test_a_small_face_in_other_units():
    """Millimetres and radians: the same motion of a coin whose radius is a hundredth."""
    large = ss.simulate(coin(d_x=0.5, d_phi=1.0), (0.0, 1.0))
    small = ss.simulate(
        coin(d_x=0.005, d_phi=1.0), (0.0, 1.0), parameters={"a": 0.01, "g": 0.01 * G}
    )
    assert small.certificate.ok
    assert small.events["time"].iloc[0] == pytest.approx(large.events["time"].iloc[0], rel=1e-11)
    assert small.final["x"] == pytest.approx(0.01 * large.final["x"], rel=1e-10)
    assert small.final["phi"] == pytest.approx(large.final["phi"], rel=1e-10)


def test_derivatives_of_a_face_that_begins_and_stops():
    load = "-A*sin(t)*(x + 0.5*y + 0.4*phi)"
    base = coin("ellipsoid")
    system = replace(
        base,
        parameters={**base.parameters, "A": ss.Parameter(4.0)},
        potential=load,
        time_unit="",
    )
    until = 5.0
    motion = ss.simulate(system, (0.0, until))
    assert motion.n_switches >= 2
    found = motion.sensitivity(["A"])
    h = 2e-6
    ends = [ss.simulate(system, (0.0, until), parameters={"A": 4.0 + s * h}).final for s in (1, -1)]
    for name in ("x", "y", "phi", "d_x", "d_phi"):
        quotient = (ends[0][name] - ends[1][name]) / (2.0 * h)
        exact = float(found[name].sel(parameter="A")[-1])
        assert exact == pytest.approx(quotient, rel=1e-4, abs=1e-5)


def test_speed_of_a_face_is_its_mean_speed():
    """A law that weakens: kinetic friction by R(u)."""
    system = coin(d_x=1.0)
    weak = replace(system.contacts["face"], kinetic="mu*m*g/(1 + speed)")
    motion = ss.simulate(replace(system, contacts={"face": weak}), (0.0, 2.0))
    # (1 + v) dv = −μ g dt
    assert motion.events["time"].iloc[0] == pytest.approx(1.5 / (MU * G), rel=1e-10)
    assert motion.certificate.ok


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({}, "one for each direction"),
        ({"axes": (1.0, 0.5)}, "expected 3 semi-axes, one for each direction"),
        ({"axes": (1.0, 1.0, 0.0)}, "inf"),
        ({"dissipation": "disc(v1, v2)"}, "argument"),
        ({"dissipation": "disc(v1, v2, v3) - 1.2*v1"}, "nonnegative|convex"),
        ({"dissipation": "sqrt(v1**2 + v2**2)"}, "vanishes along"),
        ({"dissipation": "sqrt(v1**2 + v2**2) + abs(v3)"}, "gradient jumps"),
        ({"axes": (1, 1, 1), "surface_speed": (1.0, 0.0)}, "three components"),
    ],
)
def test_what_is_refused(given, reason):
    face = ss.Contact(("d_x", "d_y", "d_phi"), 1.0, **given)
    with pytest.raises(DeclarationError, match=reason):
        replace(coin("ellipsoid"), contacts={"face": face})


def test_dependent_directions_are_refused():
    face = ss.Contact(("d_x", "d_y", "d_x + d_y"), 1.0, axes=(1, 1, 1))
    with pytest.raises(DeclarationError, match="combination of the others"):
        replace(coin("ellipsoid"), contacts={"face": face})


def test_pictures_and_equations(disc):
    motion = ss.simulate(disc, (0.0, 1.0), initial={"d_x": 0.5, "d_phi": 1.0})
    assert "disc(" in str(disc.equations())
    figure = motion.overview()
    assert len(figure.axes) >= 5
    assert motion.dataset["friction_face_3"].attrs["units"] == "N*m"
