"""Steady sliding of the spring slider: equilibrium, trace, determinant and Hopf point in closed
form.

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017), section 3.2, with k = α₀ = 1: U* = μ̃(α*) + νV, α* = 1 + VU*, det = (1 −
Vμ̃′)/ν, trace = −1 − (1 + U*μ̃′)/ν.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import mpmath as mp
import numpy as np
import pytest

from stickslip import catalogue
from stickslip.orbits.branches.equilibrium_branch import continue_equilibrium
from stickslip.orbits.equilibria.equilibrium import Equilibrium
from stickslip.orbits.equilibria.finding import equilibria

Mpf = Any  # mpmath.mpf: no type checker can tell what it is
LAWS: dict[str, Callable[[Mpf], Mpf]] = {
    "2/sqrt(alpha)": lambda a: 2 / mp.sqrt(a),
    "0.5 + exp(-(alpha - 1)/0.4)": lambda a: mp.mpf("0.5") + mp.exp(-(a - 1) / mp.mpf("0.4")),
    "2/(1 + alpha)": lambda a: 2 / (1 + a),
    "1.5 - tanh(alpha - 1.5)": lambda a: mp.mpf("1.5") - mp.tanh(a - mp.mpf("1.5")),
    "2/(1 + (alpha - 1)**2)": lambda a: 2 / (1 + (a - 1) ** 2),
}
HOPF = 0.224849301296112  # for μ̃ = 2/√α, ν = 0.05


def closed_form(law: str, nu: float, V: float, guess: float) -> tuple[float, float, float, float]:
    """U*, α*, trace and determinant in thirty digits."""
    with mp.workdps(30):
        mu = LAWS[law]
        nu = mp.mpf(nu)
        V = mp.mpf(V)
        alpha = mp.findroot(lambda a: a - 1 - V * (mu(a) + nu * V), mp.mpf(guess))
        U = mu(alpha) + nu * V
        slope = mp.diff(mu, alpha)
        return float(U), float(alpha), float(-1 - (1 + U * slope) / nu), float((1 - V * slope) / nu)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("nu", "V"), [(0.02, 0.18), (0.05, 0.6), (0.3, 2.0)])
def test_equilibrium_trace_and_determinant(law: str, nu: float, V: float) -> None:
    # Some laws have a second zero at states α < 1, which no motion reaches (theorem 3.1).
    (found,) = equilibria(
        catalogue.spring_slider(mu=law), parameters={"nu": nu, "V": V}, box={"alpha": (1.0, 40.0)}
    )
    assert isinstance(found, Equilibrium)
    assert found.modes == {"block": "slip-"}
    U, alpha, trace, determinant = closed_form(law, nu, V, found.state["alpha"])
    assert found.state == pytest.approx({"U": U, "alpha": alpha}, rel=1e-13)
    first, second = found.eigenvalues
    assert (first + second).real == pytest.approx(trace, rel=1e-11, abs=1e-11 / nu)
    assert (first * second).real == pytest.approx(determinant, rel=1e-11)
    assert found.stable == (trace < 0)


def test_the_hopf_point_of_the_task() -> None:
    branch = continue_equilibrium(
        catalogue.spring_slider(mu="2/sqrt(alpha)", nu=0.05), "V", (0.02, 0.5)
    )
    (hopf,) = branch.special
    assert hopf.kind == "Hopf"
    assert hopf.value == pytest.approx(HOPF, abs=1e-13)
    _, _, trace, determinant = closed_form("2/sqrt(alpha)", 0.05, HOPF, 1.4)
    assert trace == pytest.approx(0.0, abs=1e-12)
    assert hopf.data["frequency"] == pytest.approx(np.sqrt(determinant), rel=1e-12)


@pytest.mark.parametrize("law", LAWS)
def test_all_hopf_points_and_no_others(law: str) -> None:
    nu = 0.05
    low = 0.02
    high = 2.0
    branch = continue_equilibrium(catalogue.spring_slider(mu=law, nu=nu), "V", (low, high))
    V, alpha = branch.points["V"].values, branch.points["alpha"].values
    order = np.argsort(V)
    grid = np.linspace(low, high, 400)
    guesses = np.interp(grid, V[order], alpha[order])
    traces = [
        closed_form(law, nu, float(v), float(a))[2] for v, a in zip(grid, guesses, strict=True)
    ]
    expected = []
    for i in np.flatnonzero(np.diff(np.sign(traces))):
        with mp.workdps(30):
            root = mp.findroot(
                partial(_trace, law, nu, guesses[i]), (grid[i], grid[i + 1]), solver="anderson"
            )
        expected.append(float(root))
    assert sorted(h.value for h in branch.of_kind("Hopf")) == pytest.approx(expected, abs=1e-10)
    assert {s.kind for s in branch.special} <= {"Hopf"}
    for v, a, stable in list(zip(V, alpha, branch.points["stable"].values, strict=True))[::9]:
        assert stable == -1 or (stable == 1) == (closed_form(law, nu, float(v), float(a))[2] < 0)


def _trace(law: str, nu: float, guess: float, V: Mpf) -> Mpf:
    mu = LAWS[law]
    alpha = mp.findroot(lambda a: a - 1 - V * (mu(a) + mp.mpf(nu) * V), mp.mpf(guess))
    return -1 - (1 + (mu(alpha) + mp.mpf(nu) * V) * mp.diff(mu, alpha)) / mp.mpf(nu)


def test_every_point_of_the_branch_is_an_equilibrium() -> None:
    branch = continue_equilibrium(
        catalogue.spring_slider(mu="2/sqrt(alpha)", nu=0.05), "V", (0.02, 0.5)
    )
    for V, U, alpha in branch.table[["V", "U", "alpha"]].to_numpy():
        exact = closed_form("2/sqrt(alpha)", 0.05, V, alpha)
        assert (U, alpha) == pytest.approx(exact[:2], rel=1e-12)
    assert branch.points["margin"].values.min() > 0
    assert branch.points["defect"].values.max() < 1e-14
    assert (
        branch.ended
        == "first point: V = 0.02, the end of the range; last point: V = 0.5, the end of the range"
    )
