"""Friction laws by name, against the closed forms of their loops."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import DeclarationError
from stickslip.figures.law import loop, steps
from stickslip.model.laws import FrictionLaw


def parts(law: FrictionLaw, amplitude: float = 1.0, **values: float):
    """Displacement and force in the first loading, on the way back, and forth again."""
    _, x, _, force = loop(law, amplitude, 1.0, values)
    return [(a, b) for a, b in zip(np.split(x, 3), np.split(force, 3), strict=True)]


@pytest.mark.parametrize("k", [0.5, 4.0, 60.0])
def test_dahl(k: float) -> None:
    """From (x₁, F₁) on: F = ±F_c + (F₁ ∓ F_c) exp(−k|x − x₁|/F_c)."""
    x_1 = F_1 = 0.0
    for sign, (x, force) in zip((1.0, -1.0, 1.0), parts(ss.laws.dahl, k=k, F_c=1.3), strict=True):
        expected = 1.3 * sign + (F_1 - 1.3 * sign) * np.exp(-k * abs(x - x_1) / 1.3)
        assert force == pytest.approx(expected, abs=1e-9)
        x_1, F_1 = x[-1], force[-1]


def test_bouc_and_wen() -> None:
    """For n = 2 and σ = 1/2 the loading is a tanh and the unloading straight; n = σ = 1 is Dahl's
    law."""
    (x, up), (y, down), _ = parts(ss.laws.bouc_wen, F_c=2.0, k=3.0)
    assert up == pytest.approx(2.0 * np.tanh(1.5 * x), abs=1e-9)
    straight = down > 0.0
    expected = up[-1] - 3.0 * (x[-1] - y)
    assert down[straight] == pytest.approx(expected[straight], abs=1e-9)
    assert down[~straight] == pytest.approx(2.0 * np.tanh(expected / 2.0)[~straight], abs=1e-9)
    mine = np.concatenate([f for _, f in parts(ss.laws.bouc_wen, n=1.0, sigma=1.0)])
    assert mine == pytest.approx(np.concatenate([f for _, f in parts(ss.laws.dahl)]), abs=1e-9)


def sliders(x, k, strength):
    """The loop of Jenkins elements by hand: each a play."""
    spring, out = np.zeros(len(k)), []
    for step in np.diff(x, prepend=0.0):
        spring = np.clip(spring + step, -strength / k, strength / k)
        out.append(spring @ k)
    return np.array(out)


def test_jenkins_is_masing() -> None:
    F_c, k, A = 0.8, 3.0, 0.9
    _, x, _, force = loop(ss.laws.jenkins, A, 2.0, {"F_c": F_c, "k": k})
    assert force == pytest.approx(sliders(x, np.array([k]), np.array([F_c])), abs=1e-12)
    up, down, _ = np.split(force, 3)
    assert up == pytest.approx(np.minimum(k * x[: len(up)], F_c), abs=1e-12)
    first = np.minimum(k * (A - x[len(up) : 2 * len(up)]) / 2.0, F_c)
    assert down == pytest.approx(F_c - 2.0 * first, abs=1e-12)
    work = np.trapezoid(force[len(up) :], x[len(up) :])
    assert work == pytest.approx(4.0 * F_c * (A - F_c / k), abs=1e-4)  # by the trapezoidal rule


def test_maxwell_slip() -> None:
    _, x, _, force = loop(ss.laws.maxwell_slip, 1.0, 1.0, {"F_c": 2.0, "k": 3.0})
    k, strength = 3.0 * np.array([0.6, 0.3, 0.1]), 2.0 * np.array([0.3, 0.4, 0.3])
    assert force == pytest.approx(sliders(x, k, strength), abs=1e-12)


@pytest.mark.parametrize("chi", [0.0, -0.5, 1.5])
def test_iwan(chi: float) -> None:
    """Ten sliders by hand; their distribution tends to the power law, whose first loading and whose
    loss in a cycle are closed."""
    F_c, k, A = 1.0, 4.0, 0.3
    _, x, _, force = loop(ss.laws.iwan, A, 1.0, {"F_c": F_c, "k": k, "chi": chi})
    phi = F_c / k * (2 + chi) / (1 + chi)

    def strengths(n: int):
        return k / n * phi * ((np.arange(n) + 0.5) / n) ** (1 / (1 + chi))

    assert force == pytest.approx(sliders(x, np.full(10, k / 10), strengths(10)), abs=1e-12)
    many = 4000
    up = np.linspace(0.0, min(A, phi), 50)
    expected = k * up * (1 - (up / phi) ** (1 + chi) / (2 + chi))
    found = sliders(up, np.full(many, k / many), strengths(many))
    assert found == pytest.approx(expected, abs=1e-4)
    coarse = np.interp(up, x[: len(x) // 3], force[: len(x) // 3])
    assert coarse == pytest.approx(expected, abs=0.02)
    holds = strengths(many)
    loss = np.sum(4.0 * holds * np.maximum(A - holds * many / k, 0.0))
    power = 4 * k * (1 + chi) * A ** (3 + chi) / ((2 + chi) * (3 + chi) * phi ** (1 + chi))
    assert loss == pytest.approx(power, rel=2e-3)
    assert strengths(many).sum() == pytest.approx(F_c, rel=1e-3)


def test_elastic_bristles_do_not_drift() -> None:
    """Dupont et al.: a load that never exceeds the elastic share moves a body back to where it was;
    with Dahl's law it creeps on and on."""

    def rest(law: str, **values: float) -> float:
        contact = getattr(ss.laws, law)("d_x", F_c=1.0, **values)
        body = ss.System(
            "body",
            coordinates={"x": ss.Inertial(force="0.4*(1 - cos(t)) - 3*d_x", drag=0.0)},
            kinetic="d_x**2/2",
            contacts={"foot": contact},
            span=(0.0, 40 * np.pi),
        )
        return ss.simulate(body).final["x"]

    assert abs(rest("elasto_plastic", sigma_0=4.0, elastic=0.9)) < 0.1
    assert rest("dahl", k=4.0) > 0.5


def test_lugre_slides_on_stribecks_curve() -> None:
    """Even sliding at u: force g(u) + σ₂u."""
    system = ss.System(
        "pulled",
        parameters={"V": ss.Parameter(0.5)},
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="(x - V*t)**2/2",
        viscous="d_x**2",
        contacts={
            "foot": ss.laws.lugre(
                "d_x", F_s=1.5, F_c=1.0, v_s=0.3, sigma_0=100.0, sigma_1=5.0, sigma_2=0.2
            )
        },
        initial={"d_x": 0.5},
        span=(0.0, 60.0),
    )
    end = ss.simulate(system).final
    g = 1.0 + 0.5 * np.exp(-((0.5 / 0.3) ** 2))
    assert 0.5 * 60.0 - end["x"] == pytest.approx(g + 0.2 * 0.5 + 2 * 0.5, rel=1e-8)
    assert end["z_foot"] == pytest.approx(g / 100.0, rel=1e-8)


SLIDING = {
    "coulomb": ({"F_c": 0.6, "b": 0.1}, "0.6", "0.6 + 0.1*speed"),
    "static_kinetic": ({"F_s": 0.9, "F_c": 0.6}, "0.9", "0.6"),
    "stribeck": ({"F_s": 0.9, "F_c": 0.6, "v_s": 0.2}, "0.9", "0.6 + 0.3*exp(-speed/0.2)"),
    "stribeck_gaussian": (
        {"F_s": 0.9, "F_c": 0.6, "v_s": 0.2},
        "0.9",
        "0.6 + 0.3*exp(-(speed/0.2)**2)",
    ),
    "stribeck_lorentzian": (
        {"F_s": 0.9, "F_c": 0.6, "v_s": 0.2},
        "0.9",
        "0.6 + 0.3/(1 + (speed/0.2)**2)",
    ),
}


@pytest.mark.parametrize("name", SLIDING)
def test_laws_of_the_speed(name: str) -> None:
    values, threshold, kinetic = SLIDING[name]

    def block(contact):
        return ss.System(
            "block",
            coordinates={"x": ss.Inertial()},
            kinetic="d_x**2/2",
            potential="x**2/2",
            contacts={"belt": contact},
            span=(0.0, 20.0),
        )

    by_name = getattr(ss.laws, name)("d_x", surface_speed=0.3, **values)
    by_hand = ss.Contact("d_x", threshold, 0.3, kinetic)
    found, expected = ss.simulate(block(by_name)), ss.simulate(block(by_hand))
    assert found.certificate.ok
    assert found.n_switches == expected.n_switches
    assert found.final == pytest.approx(expected.final, rel=1e-9)


@pytest.mark.parametrize("ratio", [0.05, 7.0])
@pytest.mark.parametrize("name", ["rate_and_state", "rate_and_state_slip", "rate_and_state_cutoff"])
def test_steps_of_the_rate(name: str, ratio: float) -> None:
    """At a constant rate the state nears D_c/u exponentially in slip: θ itself under the ageing
    law, its logarithm under the slip law."""
    law = getattr(ss.laws, name)
    x, u, force = steps(law, ratio)[1:]
    known = law.specimen().values
    a, b, D_c, mu_0, v_0 = (known[p] for p in ("a", "b", "D_c", "mu_0", "v_0"))
    after = x[: len(x) // 3] * 2.0 / D_c  # slip since a step, in D_c
    found = [np.ones(len(after))]  # Ω = uθ/D_c
    for faster in (ratio, 1.0 / ratio):
        first = found[-1][-1] * faster
        if name == "rate_and_state_slip":
            found.append(first ** np.exp(-after))
        else:
            found.append(1.0 + (first - 1.0) * np.exp(-after))
    state = np.concatenate(found) * v_0 / u
    if name == "rate_and_state_cutoff":
        state = state + v_0 / known["v_c"]
    expected = a * np.arcsinh(u / (2.0 * v_0) * np.exp((mu_0 + b * np.log(state)) / a))
    assert force == pytest.approx(expected, abs=1e-11)


@pytest.mark.parametrize("evolution", ["ageing", "slip"])
def test_a_fault_without_mass(evolution: str) -> None:
    """On a coordinate without mass the law is the drag of the slider with rate and state."""
    slip = evolution == "slip"
    printed = ss.catalogue.rate_and_state_slider(
        **({"evolution": "-Omega*log(Omega)"} if slip else {})
    )
    law = ss.laws.rate_and_state_slip if slip else ss.laws.rate_and_state
    names = {name: name for name in ("a", "b", "D_c", "mu_0", "v_0", "eta")}
    fault = ss.System(
        name="fault",
        parameters=printed.parameters,
        drives=printed.drives,
        coordinates={"x": ss.Viscous("m")},
        potential=printed.potential,
        contacts={"fault": law("d_x", N="sigma", **names)},
        initial={"theta_fault": 8e6},
        span=(0.0, 4e8),
        time_unit="s",
    )
    one, other = ss.simulate(fault), ss.simulate(printed, (0.0, 4e8))
    assert one.certificate.ok and other.certificate.ok
    assert one.final["x"] == pytest.approx(other.final["x"], rel=1e-9)
    assert one.final["theta_fault"] == pytest.approx(other.final["theta"], rel=1e-9)


def test_where_rate_and_state_ends() -> None:
    """Two coordinates without mass cannot share it; the slip law says where a motion reverses."""
    with pytest.raises(DeclarationError, match="which has no mass"):
        ss.System(
            name="two",
            coordinates={"x": ss.Viscous(), "y": ss.Viscous()},
            contacts={"c": ss.laws.rate_and_state("d_x - d_y", a=0.01, b=0.015, D_c=1.0, N=1.0)},
        )
    law = ss.laws.rate_and_state_slip("d_x", a=0.01, b=0.015, D_c=1.0, N=1.0, v_0=0.1)
    turning = ss.System(
        name="turning",
        coordinates={"x": ss.Inertial(force="cos(t)")},
        kinetic="d_x**2/2",
        potential="x**2/2",
        contacts={"c": law},
        initial={"d_x": 1.0},
    )
    assert ss.simulate(turning).outcome.label in ("undefined", "step too small")
