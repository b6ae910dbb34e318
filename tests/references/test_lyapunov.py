"""First Lyapunov coefficients of textbook systems, declared like any other and found on a branch of
equilibria.

The normalisation is that of Y. A. Kuznetsov, *Elements of Applied Bifurcation Theory*, section 5.4,
with ⟨q, q⟩ = 1: l₁ = Re(c)/ω for ζ' = iωζ + cζ|ζ|². Closed forms are derived in the comments; all
values are also compared with the formula of Guckenheimer and Holmes in real Jordan coordinates
(tests/oracles/lyapunov.py).
"""

import math

import numpy as np
import pytest
import sympy as sp

from flows import flow
from oracles.lyapunov import first_lyapunov
from stickslip import Contact, Inertial, System, catalogue
from stickslip.orbits.branches.equilibrium_branch import continue_equilibrium
from stickslip.orbits.continuation.branch import SpecialPoint
from systems import parameters


def hopf_point(
    system: System, parameter: str, span: tuple[float, float], near: dict | None = None
) -> SpecialPoint:
    (found,) = continue_equilibrium(system, parameter, span, start=near).of_kind("Hopf")
    return found


@pytest.mark.parametrize("s", [-1.0, 0.7])
def test_normal_form(s: float) -> None:
    # x + iy = z, z' = (β + i)z + s z|z|²; with q = (1, −i)/√2, z = √2 ζ, so that c = 2s.
    laws = {"x": "beta*x - y + s*x*(x**2 + y**2)", "y": "x + beta*y + s*y*(x**2 + y**2)"}
    point = hopf_point(flow(laws, beta=-0.2, s=s), "beta", (-1, 1), {"x": 0.0, "y": 0.0})
    assert point.value == pytest.approx(0.0, abs=1e-12)
    assert point.data == pytest.approx({"frequency": 1.0, "lyapunov": 2 * s}, rel=1e-12)
    assert point.note == ("supercritical" if s < 0 else "subcritical")
    assert point.period == pytest.approx(2 * math.pi)


def test_van_der_pol() -> None:
    # x'' + x = (m − x²)x': on average r' = r(m/2 − r²/8) for x = r cos t, and r = √2|ζ|: Re c =
    # −1/4.
    mass = System(
        name="van der Pol",
        parameters=parameters(m=0.3),
        coordinates={"x": Inertial(force="(m - x**2)*d_x")},
        kinetic="d_x**2/2",
        potential="x**2/2",
    )
    for system in (mass, flow({"x": "v", "v": "(m - x**2)*v - x"}, m=0.3)):
        point = hopf_point(system, "m", (-1, 1))
        assert point.value == pytest.approx(0.0, abs=1e-12)
        assert point.data == pytest.approx({"frequency": 1.0, "lyapunov": -0.25}, rel=1e-12)


@pytest.mark.parametrize("A", [0.5, 1.3, 3.0])
def test_brusselator(A: float) -> None:
    # Hopf at B = 1 + A², ω = A, l₁ = −(2 + A²)/(2A(1 + 2A²)).
    system = flow(
        {"x": "A - (B + 1)*x + x**2*y", "y": "B*x - x**2*y"}, {"x": A, "y": 1.0}, A=A, B=A**2
    )
    point = hopf_point(system, "B", (0.5 * A**2, 3 + 2 * A**2))
    assert point.value == pytest.approx(1 + A**2, rel=1e-12)
    assert point.data["frequency"] == pytest.approx(A, rel=1e-11)
    assert point.data["lyapunov"] == pytest.approx(
        -(2 + A**2) / (2 * A * (1 + 2 * A**2)), rel=1e-10
    )


def test_feedback_control() -> None:
    # Lur'e's feedback control system (Kuznetsov, example 5.4; the first tutorial of MATCONT): α =
    # 1/β, l₁ = −0.3 at 1.
    system = flow({"x": "y", "y": "z", "z": "-a*z - b*y - x + x**2"}, a=1.5, b=1.0)
    point = hopf_point(system, "a", (0.5, 2.0), {"x": 0.0, "y": 0.0, "z": 0.0})
    assert point.value == pytest.approx(1.0, rel=1e-12)
    assert point.data["lyapunov"] == pytest.approx(-0.3, rel=1e-10)


def test_lorenz() -> None:
    # Subcritical at r = σ(σ + b + 3)/(σ − b − 1), ω² = b(σ + r).
    s = 10.0
    b = 8.0 / 3.0
    laws = {"x": "s*(y - x)", "y": "r*x - y - x*z", "z": "x*y - b*z"}
    near = dict.fromkeys("xy", 8.0) | {"z": 20.0}
    point = hopf_point(flow(laws, near, s=s, b=b, r=20.0), "r", (15.0, 30.0), near)
    r = s * (s + b + 3) / (s - b - 1)
    assert point.value == pytest.approx(r, rel=1e-12)
    assert point.data["frequency"] == pytest.approx(math.sqrt(b * (s + r)), rel=1e-11)
    assert point.note == "subcritical"


@pytest.mark.parametrize("gamma", [0.4, -0.2])
def test_sliding_with_a_cubic_friction_law(gamma: float) -> None:
    # x'' + x = F(V − x'), F = F₀ − αu + γu³: Hopf at F'(V) = 0; with F''' = 6γ the average gives r'
    # = −(3γ/8)r³.
    block = System(
        name="block",
        parameters=parameters(V=0.3, F=2.0, a=0.1 * math.copysign(1, gamma), g=gamma),
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="x**2/2",
        contacts={
            "belt": Contact("d_x", "F + 1", surface_speed="V", kinetic="F - a*speed + g*speed**3")
        },
    )
    point = hopf_point(block, "V", (0.05, 1.0))
    assert point.value == pytest.approx(math.sqrt(0.1 / (3 * abs(gamma))), rel=1e-12)
    assert point.data == pytest.approx({"frequency": 1.0, "lyapunov": -0.75 * gamma}, rel=1e-10)
    assert point.mode == (-1,)


def test_constraint_and_translation_together() -> None:
    # The first block is carried by a belt and pulls the second one, whose friction is F(u) = F₀ −
    # au + gu³, over the ground: the same oscillator as above. Modulo translation q = (−½, ½, 0, i)
    # and |q|² = 3/2 instead of 2: l₁ = −g.
    pair = System(
        name="tow",
        parameters=parameters(V=0.4, F=2.0, a=0.1, g=0.3),
        coordinates={"x": Inertial(), "y": Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential="(x - y)**2/2",
        contacts={
            "belt": Contact("d_x", "9", surface_speed="V"),
            "ground": Contact("d_y", "F + 1", kinetic="F - a*speed + g*speed**3"),
        },
        translation={"x": 1, "y": 1},
    )
    branch = continue_equilibrium(pair, "V", (0.05, 1.0))
    (point,) = branch.of_kind("Hopf")
    assert point.mode == (0, 1)
    assert point.value == pytest.approx(1 / 3, rel=1e-12)
    assert point.data == pytest.approx({"frequency": 1.0, "lyapunov": -0.3}, rel=1e-10)
    assert branch.points["drift_x"].values == pytest.approx(branch.points["V"].values, rel=1e-12)
    assert branch.points.sizes["eigenvalue"] == 2


def test_what_nobody_feels_does_not_count() -> None:
    # Coordinates that others do not feel (here a counter that even drifts) and translations change
    # nothing.
    laws = {"x": "v", "v": "(m - x**2 + 0.3*x)*v - x", "far": "1 + x - v**2"}
    bare = hopf_point(flow({k: laws[k] for k in "xv"}, m=0.3), "m", (-1, 1))
    with_counter = hopf_point(flow(laws, m=0.3), "m", (-1, 1))
    assert with_counter.data == pytest.approx(bare.data, rel=1e-11)


SYSTEMS = {
    "FitzHugh-Nagumo": (
        {"v": "v - v**3/3 - w + I", "w": "0.08*(v + 0.7 - 0.8*w)"},
        {},
        "I",
        (0.0, 0.6),
    ),
    "predator and prey": (
        {"x": "x*(1 - x/K) - 2*x*y/(1 + x)", "y": "-0.5*y + 1.2*x*y/(1 + x)"},
        {"x": 0.8, "y": 0.5},
        "K",
        (1.3, 6.0),
    ),
    "Rössler": ({"x": "-y - z", "y": "x + a*y", "z": "0.4*x + z*(x - 4.5)"}, {}, "a", (-0.5, 0.35)),
    "Lorenz": (
        {"x": "10*(y - x)", "y": "r*x - y - x*z", "z": "x*y - 8/3*z"},
        {"x": 8.0, "y": 8.0, "z": 20.0},
        "r",
        (15.0, 30.0),
    ),
    "feedback control": ({"x": "y", "y": "z", "z": "-a*z - y - x + x**2"}, {}, "a", (0.5, 2.0)),
    "four dimensions": (
        {
            "x": "m*x - y + x*u - x*w",
            "y": "x + m*y + y*u + x*y",
            "u": "-u + 2*x**2 + x*y + 0.3*w",
            "w": "-2*w + y**2 - 0.5*x*y - u*w",
        },
        {},
        "m",
        (-0.3, 0.2),
    ),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_jordan_coordinates_agree(name: str) -> None:
    laws, start, parameter, span = SYSTEMS[name]
    system = flow(laws, start, **{parameter: 0.5 * sum(span)})
    near = start or dict.fromkeys(laws, 0.0)
    points = continue_equilibrium(system, parameter, span, start=near).of_kind("Hopf")
    assert points
    state = sp.symbols(list(laws))
    for point in points:
        rates = [sp.sympify(law.replace("**", "^").replace("I", "q_0")) for law in laws.values()]
        values = {("q_0" if parameter == "I" else parameter): point.value}
        omega, expected = first_lyapunov(
            [r.subs(values) for r in rates], state, list(point.state.values())
        )
        assert point.data["frequency"] == pytest.approx(omega, rel=1e-8)
        assert point.data["lyapunov"] == pytest.approx(expected, rel=1e-6)


MU = ["2/sqrt(alpha)", "0.5 + exp(-(alpha - 1)/0.4)", "2/(1 + (alpha - 1)**2)"]


@pytest.mark.parametrize("mu", MU)
def test_spring_slider(mu: str) -> None:
    # (3.3) of [M] in slip: U' = V − (U − μ̃(α))/ν with U − μ̃ = νv, α' = 1 − α + vU.
    points = continue_equilibrium(
        catalogue.spring_slider(mu=mu, nu=0.05), "V", (0.02, 2.0)
    ).of_kind("Hopf")
    assert points
    U, alpha = sp.symbols("U alpha")
    for point in points:
        v = (U - sp.sympify(mu)) / sp.Float(0.05)
        omega, expected = first_lyapunov(
            [point.value - v, 1 - alpha + v * U], [U, alpha], list(point.state.values())
        )
        assert point.data["frequency"] == pytest.approx(omega, rel=1e-9)
        assert point.data["lyapunov"] == pytest.approx(expected, rel=1e-8)
        assert (point.note == "subcritical") == (expected > 0)
        assert np.isfinite(expected)
