"""Residuals as a function of JAX: its derivatives in both directions, alone and in company."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from importlib import import_module
from typing import Any

import numpy as np
import pytest

import stickslip as ss

jax: Any = import_module("jax")
jnp: Any = import_module("jax.numpy")


@pytest.fixture(autouse=True)
def double() -> Iterator[None]:
    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    yield
    jax.config.update("jax_enable_x64", before)


@pytest.fixture(scope="module")
def problem() -> ss.FitProblem:
    """A forced oscillator with stops, and three unknowns, of which one is an initial value."""
    system = ss.catalogue.forced_oscillator()
    t = np.linspace(0.0, 25.0, 40)
    x = ss.simulate(system, (0.0, 25.0), parameters={"F_c": 0.5}).at(t)["x"]
    free = {"F_c": (0.1, 0.9), "k": (0.5, 2.0), "x": (-0.5, 0.5)}
    return ss.fit_problem(system, {"t": t, "x": x}, free, noise={"x": 0.1})


P = np.array([0.55, 1.07, 0.1])
MANY = P + 0.01 * np.arange(3.0)[:, None]
TANGENT = np.array([0.3, -1.0, 0.7])


def test_values(problem: ss.FitProblem) -> None:
    residuals = problem.jax()
    assert np.array_equal(residuals(P), problem.residuals(P))
    assert np.array_equal(jax.jit(residuals)(P), problem.residuals(P))


def test_forward(problem: ss.FitProblem) -> None:
    value, slope = jax.jvp(problem.jax(), (jnp.array(P),), (jnp.array(TANGENT),))
    assert np.array_equal(value, problem.residuals(P))
    assert np.allclose(slope, problem.jacobian(P) @ TANGENT, rtol=1e-12, atol=1e-12)


def test_backward(problem: ss.FitProblem) -> None:
    value, back = jax.vjp(problem.jax(), jnp.array(P))
    cotangent = np.cos(np.arange(len(problem.data)))
    assert np.array_equal(value, problem.residuals(P))
    expected = problem.jacobian(P).T @ cotangent
    assert np.allclose(back(jnp.array(cotangent))[0], expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("direction", ["jacfwd", "jacrev"])
def test_jacobians(problem: ss.FitProblem, direction: str) -> None:
    """Those of the problem; and these are right beside extrapolated differences."""
    jacobian = jax.jit(getattr(jax, direction)(problem.jax()))(P)
    assert np.allclose(jacobian, problem.jacobian(P), rtol=1e-12, atol=1e-12)
    for j, step in enumerate(1e-4 * np.eye(3)):
        rough, fine = (
            (problem.residuals(P + s * step) - problem.residuals(P - s * step)) / (2e-4 * s)
            for s in (1.0, 0.5)
        )
        differences = (4.0 * fine - rough) / 3.0
        assert np.allclose(jacobian[:, j], differences, atol=1e-6 * np.max(np.abs(differences)))


def test_many_at_once(problem: ss.FitProblem) -> None:
    residuals = problem.jax()
    values = jax.jit(jax.vmap(residuals))(MANY)
    assert np.array_equal(values, [problem.residuals(p) for p in MANY])
    slopes = jax.vmap(jax.jacrev(residuals))(jnp.array(MANY))
    assert np.allclose(slopes, [problem.jacobian(p) for p in MANY], rtol=1e-12, atol=1e-12)


def test_part_of_a_larger_function(problem: ss.FitProblem) -> None:
    """exp(q) for the parameters, a sum of squares, and a prior: the chain rule."""
    residuals = problem.jax()

    def cost(q: Any) -> Any:
        p = jnp.concatenate([jnp.exp(q[:2]), q[2:]])
        return 0.5 * jnp.sum(residuals(p) ** 2) + jnp.sum(q**2)

    q = np.array([*np.log(P[:2]), P[2]])
    value, slope = jax.jit(jax.value_and_grad(cost))(q)
    r = problem.residuals(P)
    assert value == pytest.approx(0.5 * r @ r + q @ q, rel=1e-12)
    expected = problem.jacobian(P).T @ r * [*P[:2], 1.0] + 2.0 * q
    assert np.allclose(slope, expected, rtol=1e-11)


def test_no_second_derivatives(problem: ss.FitProblem) -> None:
    residuals = problem.jax()
    with pytest.raises(ss.StickslipError, match="first derivatives only"):
        jax.hessian(lambda p: jnp.sum(residuals(p) ** 2))(jnp.array(P))


def test_another_shape(problem: ss.FitProblem) -> None:
    with pytest.raises(ss.DeclarationError, match="Give 3 values: F_c, k, x"):
        problem.jax()(jnp.zeros(2))


def test_where_there_is_no_motion(problem: ss.FitProblem) -> None:
    """Residuals are infinite; derivatives are refused, with the reason."""
    outside = np.array([-1.0, 1.0, 0.0])
    assert problem.reason(outside)
    residuals = problem.jax()
    assert np.all(np.isinf(residuals(outside)))
    with pytest.raises(Exception, match="the motion cannot be computed"):
        jax.block_until_ready(jax.jacfwd(residuals)(jnp.array(outside)))


def test_single_precision(problem: ss.FitProblem) -> None:
    jax.config.update("jax_enable_x64", False)
    values = problem.jax()(P)
    assert values.dtype == np.float32
    assert np.allclose(values, problem.residuals(P), rtol=1e-4, atol=1e-4)


def test_without_jax(problem: ss.FitProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "jax", None)
    with pytest.raises(ss.StickslipError, match=r"pip install 'stickslip\[jax\]'"):
        problem.jax()
