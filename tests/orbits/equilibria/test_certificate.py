"""What an equilibrium has to prove: it solves the equations inside its mode, its eigenvalues are
known to a bound."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from numpy.typing import NDArray

from orbits.examples import SLIDER, stribeck_belt
from stickslip import Contact, Inertial, Internal, System, catalogue
from stickslip.equations.derive import derive
from stickslip.equations.mode_fields import mode_field
from stickslip.orbits.branches.equilibrium_branch import continue_equilibrium
from stickslip.orbits.equilibria.certificate import certify_equilibrium, eigenvalue_errors
from stickslip.orbits.equilibria.finding import equilibria
from stickslip.orbits.fields.steady import Steady
from systems import parameters


def linear(matrix: NDArray[np.float64]) -> System:
    """y' = A y as internal variables."""
    names = [f"y{i}" for i in range(len(matrix))]
    laws = [
        " + ".join(f"({a:.17g})*{x}" for a, x in zip(row, names, strict=True)) for row in matrix
    ]
    return System(
        name="linear", internal={x: Internal(law) for x, law in zip(names, laws, strict=True)}
    )


@pytest.mark.parametrize("kind", ["normal", "nearly defective", "defective", "graded"])
@pytest.mark.parametrize("seed", range(4))
def test_eigenvalues_are_within_their_bound(kind: str, seed: int) -> None:
    """Against 50 digits: the bound holds, and it is as large as the matrix is ill conditioned."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(4, 4))
    if kind == "normal":
        A = A + A.T
    elif kind != "graded":
        lam = -1.0 + (
            np.array([0.0, 1e-7, 2e-7, 3e-7]) if kind == "nearly defective" else np.zeros(4)
        )
        Q = np.linalg.qr(A)[0]
        A = Q @ (np.diag(lam) + np.triu(rng.uniform(1.0, 2.0, (4, 4)), 1)) @ Q.T
    else:
        A = A * 10.0 ** np.array([0, 2, -3, 1])[:, None]
    system = linear(A)
    steady = Steady(
        mode_field(derive(system.declaration), (), ()), {}, np.zeros((4, 0)), np.zeros(4)
    )
    point = steady.point(np.zeros(4))
    (error,), _ = eigenvalue_errors(steady, point[:, None], np.ones((1, 4)))
    computed = steady.eigenvalues(point)
    with mpmath.workdps(50):
        exact = [complex(z) for z in mpmath.eig(mpmath.matrix(A.tolist()), left=False, right=False)]
    worst = max(min(abs(z - w) for w in exact) for z in computed)
    assert worst <= error
    assert error <= (1e-12 if kind == "normal" else 1e-1) * np.linalg.norm(A)


def test_numbers_are_shown() -> None:
    (found,) = equilibria(SLIDER, parameters={"V": 0.3}).isolated
    assert found.certificate.ok
    names = [residual.name for residual in found.certificate.residuals]
    assert names == ["equations", "nearest guard", "eigenvalues"]
    assert found.certificate["nearest guard"].note == "contact 'block' goes from slip- to stick"
    assert 0.0 < found.eigenvalue_error < 1e-9
    assert found.describe().endswith("; stable; certified: all 3 residuals within their limits")


def test_a_wrong_state_is_not_certified() -> None:
    (found,) = equilibria(SLIDER, parameters={"V": 0.3}).isolated
    y = np.array(list(found.state.values()))
    field = mode_field(derive(SLIDER.declaration), found.mode, found.region)
    steady = Steady(field, found.parameters, np.zeros((2, 0)), y)
    assert certify_equilibrium(steady, steady.point(y))[0].ok
    assert not certify_equilibrium(steady, steady.point(y * (1.0 + 1e-8)))[0]["equations"].ok
    # Where the block would slip the other way: outside its mode.
    assert not certify_equilibrium(steady, steady.point(y * np.array([-1.0, 1.0])))[0][
        "nearest guard"
    ].ok


def test_stability_that_rounding_decides_is_not_decided() -> None:
    """At the Hopf point itself the real part is 0 give or take what the eigenvalues are known
    to."""
    (hopf,) = continue_equilibrium(stribeck_belt(), "V", (0.5, 2.5)).of_kind("Hopf")
    (there,) = equilibria(stribeck_belt(), parameters={"V": hopf.value}).isolated
    assert there.stable is None
    for V, stable in ((hopf.value - 1e-6, False), (hopf.value + 1e-6, True)):
        (found,) = equilibria(stribeck_belt(), parameters={"V": V}).isolated
        assert found.stable is stable


def test_sets() -> None:
    (toy,) = equilibria(catalogue.rocking_toy()).sets
    assert toy.certificate.ok, toy.certificate.describe()
    pendulum = System(
        name="pendulum",
        parameters=parameters(s=0.4),
        coordinates={"psi": Inertial()},
        kinetic="d_psi**2/2",
        potential="-cos(psi)",
        contacts={"joint": Contact("d_psi", "s")},
    )
    assert all(found.certificate.ok for found in equilibria(pendulum).sets)


def test_branches_are_certified_within_their_range() -> None:
    branch = continue_equilibrium(stribeck_belt(), "V", (0.02, 4.0))
    assert branch.certificate.ok, branch.certificate.describe()
    assert branch.points["certified"].values.all()
    assert branch.points["V"].values[[0, -1]].tolist() == [0.02, 4.0]
    assert branch.points["eigenvalue_error"].values.max() < 1e-9
    assert branch.certificate["beyond the range"].value == 0.0
