"""Viscous coordinates with a drag: closed forms, rate-and-state friction against SciPy and against
what is known of its stability, and what is refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import stickslip as ss
from stickslip import Contact, DeclarationError, Inertial, Internal, Parameter, System, Viscous
from stickslip.arrays import Array


def resisted(drag: str, potential: str = "x**2/2", **more: Any) -> System:
    """One coordinate that a force pulls against a drag."""
    return System(
        "resisted",
        coordinates={"x": Viscous(drag=drag)},
        potential=potential,
        **{"initial": {"x": 1.0}, **more},
    )


# -- closed forms ----------------------------------------------------------------------------------


def test_relaxation_against_asinh():
    """asinh ẋ = −x: tanh(x/2) decays exponentially."""
    motion = ss.simulate(resisted("asinh(d_x)", initial={"x": 5.0}), (0.0, 10.0))
    t = np.linspace(0.0, 10.0, 101)
    x = 2.0 * np.arctanh(math.tanh(2.5) * np.exp(-t))
    at = motion.at(t)
    np.testing.assert_allclose(at["x"], x, rtol=1e-11)
    np.testing.assert_allclose(at["d_x"], -np.sinh(x), rtol=1e-11)
    assert motion.certificate.ok


def test_relaxation_against_a_cubic_drag_and_viscosity():
    """ẋ + ẋ³ = −x: ln|ẋ| + 3/2 ẋ² falls evenly."""
    motion = ss.simulate(resisted("d_x**3", viscous="d_x**2/2", initial={"x": 30.0}), (0.0, 20.0))
    t = np.linspace(0.0, 20.0, 81)
    v = motion.at(t)["d_x"]
    falling = np.log(-v) + 1.5 * v**2 + t
    np.testing.assert_allclose(falling, falling[0], rtol=1e-11)
    assert motion.certificate.ok


@pytest.mark.parametrize("power", [-140, -60, -7, 0, 7, 60])
@pytest.mark.parametrize("force", [-200.0, -1e-3, 0.0, 1e-12, 0.5, 200.0])
def test_rates_of_any_size(power: int, force: float):
    """asinh(ẋ/c) = F has a zero that may be smaller or larger than any other number here."""
    scale = math.sinh(force) * 10.0**power
    system = resisted(f"asinh(d_x/1e{power})", f"-({force!r})*x", initial={"x": 0.0})
    rate = ss.simulate(system, (0.0, 1.0)).at(0.5)["d_x"]
    assert float(rate) == pytest.approx(scale, rel=1e-13 + 1e-15 * abs(force), abs=1e-307)


def test_work_is_what_the_drag_takes_up():
    """½ x² becomes ∫ v f(v) dt, here with a force of an internal variable and of time beside."""
    motion = ss.simulate(
        resisted(
            "(1 + alpha**2)*sinh(d_x)",
            "x**2/2 - x*sin(t)",
            internal={"alpha": Internal("d_x - alpha")},
        ),
        (0.0, 30.0),
    )
    assert motion.certificate.ok
    t = np.linspace(0.0, 30.0, 7)
    at = motion.at(t)
    drag = (1.0 + at["alpha"] ** 2) * np.sinh(at["d_x"])
    np.testing.assert_allclose(drag, np.sin(t) - at["x"], rtol=1e-10, atol=1e-10)


def test_drag_that_knows_the_rate_of_a_mass():
    """Accelerations enter the change of the rate."""
    system = System(
        "both",
        coordinates={"q": Inertial(), "x": Viscous(drag="(2 + sin(d_q))*asinh(d_x)")},
        kinetic="d_q**2/2",
        potential="q**2/2 + (x - q)**2/2",
        initial={"q": 1.0, "x": 0.3},
    )
    motion = ss.simulate(system, (0.0, 20.0))
    assert motion.certificate.ok

    def rates(t: float, y: Array) -> list[float]:
        q, w, x = y
        return [w, -q - (q - x), math.sinh(-(x - q) / (2.0 + math.sin(w)))]

    t = np.linspace(0.0, 20.0, 41)
    found = solve_ivp(rates, (0.0, 20.0), [1.0, 0.0, 0.3], "DOP853", t, rtol=1e-12, atol=1e-13)
    at = motion.at(t)
    for name, values in zip(("q", "d_q", "x"), found.y, strict=True):
        np.testing.assert_allclose(at[name], values, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("width", [1e-2, 1e-4, 1e-6])
def test_a_pulse_of_the_force_is_met(width: float):
    """What underflows where a step begins is not hidden in the rate: asinh ẋ is the pulse."""
    system = resisted(
        "asinh(d_x)",
        "-x*exp(-((t - 5)/w)**2)",
        parameters={"w": Parameter(1.0)},
        initial={"x": 0.0},
    )
    motion = ss.simulate(system, (0.0, 10.0), parameters={"w": width})
    assert motion.certificate.ok
    s = np.linspace(-9.0, 9.0, 4001)
    moved = np.trapezoid(np.sinh(np.exp(-(s**2))), s) * width
    assert float(motion.final["x"]) == pytest.approx(moved, rel=1e-9)


def test_resistance_that_ends_is_no_silent_answer():
    """tanh never reaches a force of 2: there is no rate."""
    motion = ss.simulate(resisted("tanh(d_x)", "-2*x", initial={"x": 0.0}), (0.0, 1.0))
    assert motion.outcome.value != "finished"
    assert not motion.certificate.ok


# -- rate-and-state friction -----------------------------------------------------------------------

AGEING, SLIP = "1 - Omega", "-Omega*log(Omega)"


def slider(evolution: str = AGEING, **given: float) -> System:
    """The catalogue's."""
    return ss.catalogue.rate_and_state_slider(evolution=evolution, **given)


def steady(system: System) -> dict[str, float]:
    """A start at steady sliding, with the load where it is at t = 0."""
    p = system.values
    behind = system.evaluate("steady_stress") / p["k"]
    return {"x": system.evaluate("sigma*mu_0/k") - behind, "theta": p["D_c"] / p["V"]}


def independent(system: System, start: dict[str, float], span: float, t: Array) -> Array:
    """ln v and ln θ by SciPy, from an equation for the rate of ln v."""
    p = system.values
    slips = "log" in str(system.functions["evolution(Omega)"])
    a, b, s, k = (p[name] for name in ("a", "b", "sigma", "k"))

    def argument(w: float, lt: float) -> float:
        psi = (p["mu_0"] + b * (math.log(p["v_0"] / p["D_c"]) + lt)) / a
        return math.exp(w + psi) / (2.0 * p["v_0"])

    def stress(w: float, lt: float) -> float:
        return a * s * math.asinh(argument(w, lt)) + p["eta"] * math.exp(w)

    def rates(_: float, y: Array) -> list[float]:
        w, lt = y
        v = math.exp(w)
        omega = v * math.exp(lt) / p["D_c"]
        aged = (-omega * math.log(omega) if slips else 1.0 - omega) * math.exp(-lt)
        u = argument(w, lt)
        part = s * u / math.hypot(1.0, u)
        return [(k * (p["V"] - v) - b * part * aged) / (a * part + p["eta"] * v), aged]

    lt = math.log(start["theta"])
    pull = p["sigma"] * p["mu_0"] - k * start["x"]
    w = brentq(lambda w: stress(w, lt) - pull, -60.0, 10.0, xtol=1e-14)
    found = solve_ivp(rates, (0.0, span), [w, lt], "LSODA", t, rtol=1e-11, atol=1e-12)
    assert found.success
    return found.y


@pytest.mark.parametrize("law", [AGEING, SLIP])
def test_near_steady_sliding(law: str):
    """Beside steady sliding both agree to many digits."""
    system = slider(law, k=2e7)
    start = steady(system)
    start["x"] += 0.05 * system.values["D_c"]
    t = np.linspace(0.0, 5e7, 60)
    motion = ss.simulate(system, (0.0, 5e7), initial=start)
    assert motion.certificate.ok
    at = motion.at(t)
    w, lt = independent(system, start, 5e7, t)
    np.testing.assert_allclose(np.log(at["d_x"]), w, rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(np.log(at["theta"]), lt, rtol=0.0, atol=1e-7)


def test_an_earthquake():
    """One cycle, over fourteen orders of magnitude of the slip rate."""
    system = slider()
    motion = ss.simulate(system, (0.0, 8e8))
    assert motion.certificate.ok
    start = {"x": 0.0, "theta": float(system.initial["theta"])}
    t = np.linspace(0.0, 8e8, 300)
    w, lt = independent(system, start, 8e8, t)
    at = motion.at(t)
    np.testing.assert_allclose(np.log(at["d_x"]), w, rtol=0.0, atol=1e-5)
    np.testing.assert_allclose(np.log(at["theta"]), lt, rtol=0.0, atol=1e-5)
    fastest = np.max(motion.at(motion.knots.time)["d_x"])
    assert 0.1 < float(fastest) < 2.0
    assert np.min(at["d_x"]) < 1e-13


def peaks(system: System, off: float, span: float) -> Array:
    """Largest values of ln(v/V), one after the other, from a state θ that is larger by a factor
    than in steady sliding."""
    start = steady(system)
    start["theta"] *= off
    motion = ss.simulate(system, (0.0, span), initial=start)
    assert motion.certificate.ok
    t = np.linspace(0.0, span, 40001)
    w = np.log(motion.at(t)["d_x"] / system.values["V"])
    i = np.flatnonzero((w[1:-1] > w[:-2]) & (w[1:-1] >= w[2:])) + 1
    # the vertex of the parabola through three samples
    bend = w[i - 1] - 2.0 * w[i] + w[i + 1]
    return w[i] - (w[i + 1] - w[i - 1]) ** 2 / (8.0 * bend)


@pytest.mark.parametrize("law", [AGEING, SLIP])
@pytest.mark.parametrize("eta", [0.0, 1e14])
def test_critical_stiffness(law: str, eta: float):
    """Steady sliding is stable for a stiff spring, and unstable for a soft one (Rice and Ruina
    1983); radiation damping makes it stabler, here by two fifths."""
    bare = slider(law, eta=eta)
    critical = bare.evaluate("critical_stiffness")
    assert critical == pytest.approx(3.125e7 * (1.0 if eta == 0.0 else 0.6), rel=1e-12)
    for factor, sign in ((1.05, -1.0), (0.95, 1.0)):
        heights = peaks(slider(law, eta=eta, k=factor * critical), 1.01, 4e8)
        assert len(heights) > 3
        assert np.all(sign * np.diff(heights) > 0.0)


def test_periodic_at_the_critical_stiffness():
    """With the ageing law and without damping all motions at the critical stiffness are periodic,
    however large (J. R. Ranjith and J. R. Rice, J. Mech. Phys. Solids 47 (1999), 1207)."""
    critical = slider(eta=0.0).evaluate("critical_stiffness")
    even, stiff, soft = (
        peaks(slider(eta=0.0, k=factor * critical), 3.0, 3e8) for factor in (1.0, 1.02, 0.98)
    )
    assert len(even) >= 3 and even[0] > 0.5
    np.testing.assert_allclose(even, even[0], rtol=1e-6)
    assert np.all(np.diff(stiff) < 0.0)
    assert np.all(np.diff(soft) > 0.0)


def chain(n: int, coupling: float) -> System:
    """Sliders beside each other, joined by springs."""
    one = slider()
    friction = one.functions["friction(v, theta)"]
    return System(
        "sliders",
        parameters={**one.parameters, "k_c": Parameter(coupling)},
        functions={"friction(v, theta)": friction},
        coordinates={
            f"x{i}": Viscous(drag=f"sigma*friction(d_x{i}, theta{i}) + eta*d_x{i}")
            for i in range(n)
        },
        internal={f"theta{i}": Internal(f"1 - d_x{i}*theta{i}/D_c") for i in range(n)},
        potential=" + ".join(
            [f"k/2*(V*t + sigma*mu_0/k - x{i})**2" for i in range(n)]
            + [f"k_c/2*(x{i + 1} - x{i})**2" for i in range(n - 1)]
        ),
        initial={f"theta{i}": 8e6 * (1.0 + 0.1 * i) for i in range(n)},
    )


def test_sliders_that_are_not_joined_go_alone():
    motion = ss.simulate(chain(3, 0.0), (0.0, 4e8))
    alone = ss.simulate(slider(), (0.0, 4e8))
    assert motion.certificate.ok
    t = np.linspace(0.0, 4e8, 50)
    np.testing.assert_allclose(motion.at(t)["d_x0"], alone.at(t)["d_x"], rtol=1e-6)


def test_sliders_that_are_joined():
    """Springs between them carry what one of them loses; every force balances."""
    system = chain(3, 3e7)
    p = system.values
    motion = ss.simulate(system, (0.0, 1e9))
    assert motion.certificate.ok
    t = np.linspace(0.0, 1e9, 40)
    at = motion.at(t)
    x = np.array([at[f"x{i}"] for i in range(3)])
    v = np.array([at[f"d_x{i}"] for i in range(3)])
    theta = np.array([at[f"theta{i}"] for i in range(3)])
    psi = (p["mu_0"] + p["b"] * np.log(p["v_0"] * theta / p["D_c"])) / p["a"]
    stress = p["a"] * p["sigma"] * np.arcsinh(v / (2.0 * p["v_0"]) * np.exp(psi)) + p["eta"] * v
    pull = p["k"] * (p["V"] * t + p["sigma"] * p["mu_0"] / p["k"] - x)
    pull += p["k_c"] * (np.diff(x, axis=0, append=x[-1:]) - np.diff(x, axis=0, prepend=x[:1]))
    np.testing.assert_allclose(stress, pull, rtol=1e-9)
    # they do not move as one
    assert np.max(np.abs(x[0] - x[2])) > 1e-4


# -- what is refused -------------------------------------------------------------------------------

REFUSED: dict[str, tuple[dict[str, Any], str, str]] = {
    "falls": ({"drag": "2*d_x*exp(-d_x**2)"}, "drag", "does not increase with d_x"),
    "flat at rest": ({"drag": "d_x**3"}, "drag", "at d_x = 0"),
    "feeds in": ({"drag": "d_x - 1"}, "drag", "creates energy"),
    "kink": ({"drag": "d_x + abs(d_x)*d_x"}, "drag", "kinks or jumps in d_x"),
    "undefined": ({"drag": "d_x*log(x)", "initial": {}}, "drag", "undefined at the initial state"),
    "rate of another": ({"drag": "d_x + d_y"}, "drag", "'d_y' is not allowed"),
    "coupled": ({"viscous": "(d_x - d_y)**2/2"}, "drag", "couples d_x to d_y"),
    "contact": ({"contacts": {"c": Contact("d_x - d_y", 1.0)}}, "contacts", "'x' has a drag"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(case: str):
    changed, place, reason = REFUSED[case]
    drag = changed.get("drag", "asinh(d_x)")
    fields = {k: v for k, v in changed.items() if k != "drag"}
    with pytest.raises(DeclarationError, match=reason) as error:
        System(
            "two",
            coordinates={"x": Viscous(drag=drag), "y": Viscous()},
            **{"viscous": "d_y**2/2", "initial": {"x": 1.0}, **fields},
        )
    assert place in str(error.value)


def test_refused_for_a_parameter():
    system = resisted("c*d_x", parameters={"c": Parameter(1.0)})
    with pytest.raises(DeclarationError, match="does not increase"):
        ss.simulate(system, (0.0, 1.0), parameters={"c": -1.0})
    with pytest.raises(DeclarationError, match="does not increase"):
        ss.simulate_many(system, (0.0, 1.0), parameters={"c": np.array([1.0, -1.0])})


def test_no_formula_for_the_rate():
    with pytest.raises(DeclarationError, match="is defined implicitly"):
        ss.equilibria(resisted("asinh(d_x)"))
