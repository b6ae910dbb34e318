"""Steady slip of the rate-and-state spring slider is lost in a Hopf point at the critical
stiffness.

K. Ranjith and J. R. Rice, *Stability of quasi-static slip in a single degree of freedom elastic
system with rate and state dependent friction*, J. Mech. Phys. Solids 47 (1999) 1207-1218: k_c = (b
− a)σ/D_c, ω_c = (V/D_c)√((b − a)/a). With the ageing law the quasi-static motion at k_c is exactly
periodic at any amplitude, so that the first Lyapunov coefficient vanishes; with the slip law too
(J.-C. Gu, J. R. Rice, A. L. Ruina and S. T. Tse, J. Mech. Phys. Solids 32 (1984) 167-196). A mass m
multiplies k_c by 1 + mV²/(aσD_c) (J. R. Rice and A. L. Ruina 1983).
"""

import numpy as np
import pytest

from oracles.rate_and_state import critical_frequency, critical_stiffness
from stickslip import Inertial, Internal, System, simulate
from stickslip.orbits.branches.equilibrium_branch import continue_equilibrium
from systems import parameters

A = 0.4
B = 0.7
SIGMA = 1.3
D_C = 0.8
MU_0 = 6.0
FRICTION = "sigma*(mu_0 + a*log({v}/V) + b*log(V*theta/D_c))"


def numbers(**more: float) -> dict:
    return parameters(K=1.0, V=1.5, a=A, b=B, sigma=SIGMA, D_c=D_C, mu_0=MU_0, **more)


def quasi_static(state_law: str) -> System:
    """The stress τ follows the spring, and the friction law gives the velocity."""
    return System(
        name="quasi-static slider",
        parameters=numbers(),
        functions={"v(tau, theta)": "V*exp((tau/sigma - mu_0 - b*log(V*theta/D_c))/a)"},
        internal={"tau": Internal("K*(V - v(tau, theta))"), "theta": Internal(state_law)},
        initial={"tau": SIGMA * MU_0, "theta": D_C / 1.5},
        span=(0, 20),
    )


def with_mass() -> System:
    """The stretch U of the spring is the coordinate; the block moves with V − U'."""
    return System(
        name="slider with mass",
        parameters=numbers(m=0.3),
        coordinates={"U": Inertial(force=FRICTION.format(v="(V - d_U)"))},
        internal={"theta": Internal("1 - (V - d_U)*theta/D_c")},
        kinetic="m/2*d_U**2",
        potential="K/2*U**2",
        initial={"U": SIGMA * MU_0, "theta": D_C / 1.5},
        span=(0, 20),
    )


AGEING = "1 - v(tau, theta)*theta/D_c"
SLIP = "-v(tau, theta)*theta/D_c*log(v(tau, theta)*theta/D_c)"


@pytest.mark.parametrize("law", [AGEING, SLIP])
def test_quasi_static(law: str) -> None:
    branch = continue_equilibrium(quasi_static(law), "K", (0.1, 2.0))
    (hopf,) = branch.special
    assert hopf.kind == "Hopf"
    assert hopf.value == pytest.approx(critical_stiffness(A, B, SIGMA, D_C), rel=1e-12)
    assert hopf.data["frequency"] == pytest.approx(critical_frequency(A, B, D_C, 1.5), rel=1e-12)
    assert hopf.note == "degenerate"
    assert hopf.state == pytest.approx({"tau": SIGMA * MU_0, "theta": D_C / 1.5}, rel=1e-12)
    softer = branch.points["K"].values < hopf.value * (1 - 1e-9)
    assert np.all(branch.points["stable"].values[softer] == 0)


def test_mass_makes_it_less_stable() -> None:
    (hopf,) = continue_equilibrium(with_mass(), "K", (0.3, 3.0)).of_kind("Hopf")
    assert hopf.value == pytest.approx(critical_stiffness(A, B, SIGMA, D_C, 0.3, 1.5), rel=1e-12)
    assert hopf.data["frequency"] == pytest.approx(critical_frequency(A, B, D_C, 1.5), rel=1e-12)


def test_the_motion_agrees() -> None:
    system = quasi_static(AGEING)
    k_c = critical_stiffness(A, B, SIGMA, D_C)
    period = 2 * np.pi / critical_frequency(A, B, D_C, 1.5)
    start = {"tau": SIGMA * MU_0 + 1e-4, "theta": D_C / 1.5}
    size = []
    for factor in (0.98, 1.0, 1.02):
        motion = simulate(system, (0, 10 * period), initial=start, parameters={"K": factor * k_c})
        assert motion.certificate.ok
        last = motion.at(np.linspace(9 * period, 10 * period, 400))["tau"]
        size.append(np.max(np.abs(last - SIGMA * MU_0)))
    first = simulate(system, (0, period), initial=start, parameters={"K": k_c}).at(
        np.linspace(0, period, 400)
    )["tau"]
    assert size[0] > 1.1 * size[1] > 1.2 * size[2]
    assert size[1] == pytest.approx(np.max(np.abs(first - SIGMA * MU_0)), rel=1e-3)
