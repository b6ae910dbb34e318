"""From a formula to machine code: integrals of many formulas of time, which are moved as internal
variables, against those that mpmath computes to 30 digits. And the inverse of a matrix."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from functools import cache, reduce
from itertools import pairwise
from typing import Any

import mpmath as mp
import numpy as np
import pytest

from stickslip import Internal, Parameter, System, Trajectory, simulate
from stickslip.equations.codegen import series

Mpf = Any  # mpmath.mpf: no type checker can tell what it is
Series = Callable[[Mpf], Mpf]


@pytest.fixture(autouse=True)
def thirty_digits() -> Iterator[None]:
    with mp.workdps(30):
        yield


DRIVES = {"g": "A + B*sin(omega*t + phi) + C*t**2", "h": "D + E*cos(0.7*t)*exp(-F*t)"}
"""Two inner arguments that are analytic, positive and not steady: g is within [0.6, 2.9], h within
[0.8, 2.2]."""

FORMULAS = [
    "exp(g)", "log(g)", "sqrt(g)", "sin(g)", "cos(g)", "tan(g/3)",
    "sinh(g)", "cosh(g)", "tanh(g)", "asinh(g)", "atan(g)",
    "sin(g)*cos(g) + sin(h)", "sinh(h)*cosh(h)", "sin(omega*t + phi)*cos(omega*t + phi)",
    "exp(sin(exp(h/2)))",
    "tan(h/4)*tanh(h/4)", "atan(asinh(g*h))", "asinh(atan(g)/h)",
    "g*h", "g*g*h", "g/h", "1/h", "A/(g*h)", "g**2/h**3", "(g + h)/(g - 4*h)", "-A*g*h/(B + 2)",
    "g**2", "g**3", "g**7", "g**8", "g**9", "g**(-1)", "g**(-2)", "g**(-9)",
    "(3 - g)**5", "(g - 4)**3", "(g - 4)**(-3)", "(2*g)**0.3", "(-2*g)**3", "(A*g)**2.5",
    "g**0.5*h**0.5", "g**1.5", "g**(-1.5)", "g**A", "g**(-B)", "(g + A)**(B + h)",
    "2**g", "B**h", "g**h",
    "A**2*sqrt(B)*g", "cosh(A)*exp(B)*log(D)*atan(E)*h",
    "g + 2*h - 3", "-(g - h) + A", "A + B", "t", "t**3 - 2*t", "0", "A*t + B*t**2",
    "abs(g - h)", "max(g, h)", "min(g, h, 1.3)", "clip(g, 1.4, 1.7)", "clip(A*h, 2.1, 2.5)*g",
    "max(g - 1.5, 0)**2", "piecewise(g < 1.4, h, g < 1.6, 2*h, h**2)",
    "piecewise(t > 1.1, sin(g), -A)", "abs(sin(3*g))*h", "1/(1 + abs(g - h))",
    "erf(g - 1.5)", "exp(-g)*erf(h/g)",
]  # fmt: skip

SPAN = 3.0
SEEDS = 2
GROUP = 16  # formulas in one system: long functions take long to compile


@cache
def formulas_system(group: int) -> System:
    return System(
        name=f"formulas {group}",
        parameters={
            name: Parameter(value)
            for name, value in dict(
                A=1.7, B=0.6, C=0.08, D=1.3, E=0.5, F=0.2, omega=1.9, phi=0.3
            ).items()
        },
        drives=DRIVES,
        internal={
            f"y{i}": Internal(text) for i, text in enumerate(FORMULAS) if i // GROUP == group
        },
    )


@cache
def moved(group: int, seed: int) -> Trajectory:
    return simulate(formulas_system(group), (0.0, SPAN), parameters=drawn(seed), rtol=1e-12)


def drawn(seed: int) -> dict[str, float]:
    rng = np.random.default_rng(seed)
    low = np.array([1.4, 0.3, 0.02, 1.2, 0.2, 0.1, 1.0, -1.0])
    high = np.array([1.9, 0.6, 0.10, 1.5, 0.4, 0.5, 2.5, 1.0])
    names = ("A", "B", "C", "D", "E", "F", "omega", "phi")
    return dict(zip(names, map(float, rng.uniform(low, high)), strict=True))


FUNCTIONS: dict[str, Callable[..., Mpf]] = {
    **{f: getattr(mp, f) for f in "sqrt exp log sin cos tan sinh cosh tanh asinh atan erf".split()},
    "abs": abs,
    "max": max,
    "min": min,
    "clip": lambda x, low, high: min(max(x, low), high),
    "piecewise": lambda *p: next((v for c, v in zip(p[:-1:2], p[1::2], strict=True) if c), p[-1]),
}


def by_mpmath(text: str, parameters: dict[str, float]) -> Series:
    """The same formula as a function of time in many digits."""

    # Numbers as mpf, so that 1/3 or 2**0.5 do not slip through doubles.
    def compiled(formula: str) -> object:
        class Exact(ast.NodeTransformer):
            def visit_Constant(self, node: ast.Constant) -> ast.AST:
                return ast.Call(ast.Name("mpf", ast.Load()), [node], [])

        return compile(
            ast.fix_missing_locations(Exact().visit(ast.parse(formula, mode="eval"))),
            formula,
            "eval",
        )

    codes: dict[str, Any] = {name: compiled(formula) for name, formula in DRIVES.items()}
    code: Any = compiled(text)
    names = {
        **FUNCTIONS,
        "mpf": mp.mpf,
        **{name: mp.mpf(value) for name, value in parameters.items()},
    }

    def function(t: Mpf) -> Mpf:
        scope = {**names, "t": t}
        scope |= {name: eval(drive, scope) for name, drive in codes.items()}
        return eval(code, scope)

    return function


@pytest.mark.parametrize("seed", range(SEEDS))
@pytest.mark.parametrize("number", range(len(FORMULAS)), ids=FORMULAS)
def test_flow_of_a_formula(number: int, seed: int) -> None:
    trajectory = moved(number // GROUP, seed)
    exact = by_mpmath(FORMULAS[number], drawn(seed))
    assert trajectory.outcome.ok
    times = np.linspace(0, SPAN, 7)
    values = trajectory.at(times)
    for t, rate in zip(times, values[f"d_y{number}"], strict=True):
        assert rate == pytest.approx(float(exact(mp.mpf(t))), rel=1e-13, abs=1e-13)
    # Where a formula has a kink the trajectory has a knot: the integrand is analytic in between.
    nodes = [0.0, *trajectory.events["time"], SPAN]
    parts = [mp.quad(exact, [mp.mpf(a), mp.mpf(b)]) for a, b in pairwise(nodes)]
    integral: Any = reduce(lambda a, b: a + b, parts)
    assert values[f"y{number}"][-1] == pytest.approx(float(integral), rel=1e-13, abs=1e-13)


def test_every_kink_is_crossed() -> None:
    kinks = [
        text
        for text in FORMULAS
        if any(f in text for f in ("abs", "max", "min", "clip", "piecewise"))
    ]
    for group in {FORMULAS.index(text) // GROUP for text in kinks}:
        changes = [np.ptp(moved(group, seed).knots.region, axis=0) for seed in range(SEEDS)]
        crossed = np.sum(changes, axis=0)
        assert np.all(crossed > 0), list(crossed)


@pytest.mark.parametrize("p", [-1.0, 1.0, 3.0])
def test_kinks_of_parameters_alone(p: float) -> None:
    system = System(
        "kinks of parameters",
        parameters={"p": Parameter(p)},
        internal={"x": Internal("max(p, 0.5) - abs(p - 2)*x")},
    )
    rate = abs(p - 2.0)
    exact = max(p, 0.5) * (1.0 - np.exp(-rate)) / rate
    motion = simulate(system, (0.0, 1.0))
    assert motion.knots.state[-1].item() == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_inverse(seed: int) -> None:
    n = 5
    A = np.random.default_rng(seed).normal(size=(n, n))
    A[0, 0] = 0.0  # the first pivot is not the first entry
    R = np.empty((n, n))
    assert series.invert(np.vstack([A, np.zeros(n)]), n, R)
    np.testing.assert_allclose(A @ R, np.eye(n), rtol=0, atol=1e-12)


def test_a_singular_matrix_is_recognised() -> None:
    root = np.random.default_rng(5).normal(size=(4, 3))
    A = np.vstack([root @ root.T, np.zeros(4)])
    assert not series.invert(A, 4, np.empty((4, 4)))
