"""Taylor recurrences, against series and integrals that mpmath computes to 30 digits.

First the compiled recurrences one by one, all orders at once; then the whole path from a formula to
machine code, by the integrals of many formulas of time that are moved as internal variables.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import cache, reduce
from itertools import pairwise
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from stickslip import Internal, Parameter, System, Trajectory, simulate
from stickslip.arrays import Array
from stickslip.equations.codegen import series

ORDER = 24
Mpf = Any  # mpmath.mpf: no type checker can tell what it is
Series = Callable[[Mpf], Mpf]


@pytest.fixture(autouse=True)
def thirty_digits() -> Iterator[None]:
    with mp.workdps(30):
        yield


# --- The recurrences ------------------------------------------------------------------------------


def argument(rng: np.random.Generator, low: float, high: float) -> tuple[Array, Series]:
    """A random analytic function of radius above 1: its Taylor coefficients, and itself."""
    c = rng.normal(size=ORDER + 1) * 0.5 ** np.arange(ORDER + 1)
    c[0] = rng.uniform(low, high)
    return c, lambda x: mp.polyval([mp.mpf(v) for v in c[::-1]], x)


def assert_series(computed: Array, exact: Series) -> None:
    # Rounding errors of low orders reach the higher ones with the decay of the argument's
    # coefficients.
    with mp.workdps(60):
        expected = np.array([float(v) for v in mp.taylor(exact, 0, ORDER)])
    decay = 0.5 ** np.arange(ORDER + 1)
    size = decay * np.maximum.accumulate(np.abs(expected) / decay)
    np.testing.assert_array_less(np.abs(computed - expected) / size, 1e-12)
    assert np.count_nonzero(expected) > ORDER // 2


def rows(*known: Array, free: int = 1) -> Array:
    """The workspace of the generated code: known series, and room for the results."""
    return np.vstack([*known, np.full((free, ORDER + 1), np.nan)])


def fill(W: Array, row: int, recurrence: Callable[[int], float]) -> None:
    for k in range(ORDER + 1):
        W[row, k] = recurrence(k)


seeds = pytest.mark.parametrize("seed", range(4))


@seeds
def test_product(seed: int) -> None:
    rng = np.random.default_rng(seed)
    (a, f), (b, g) = argument(rng, -2, 2), argument(rng, -2, 2)
    W = rows(a, b)
    fill(W, 2, lambda k: series.product_order(W, 0, 1, k))
    assert_series(W[2], lambda x: f(x) * g(x))


@seeds
def test_division_and_inverse(seed: int) -> None:
    rng = np.random.default_rng(seed)
    (a, f), (b, g) = argument(rng, -2, 2), argument(rng, 1, 2)
    b *= (-1) ** seed  # and g with it
    W = rows(a, b, free=2)
    fill(W, 2, lambda k: series.divide_order(W, 0, 1, 2, k))
    fill(W, 3, lambda k: series.inverse_order(W, 1, 3, k))
    assert_series(W[2], lambda x: f(x) / g(x))
    assert_series(W[3], lambda x: 1 / g(x))


@pytest.mark.parametrize("p", [0.5, -0.5, 1 / 3, 2.7, -3.0, 9.0])
def test_power(p: float) -> None:
    a, f = argument(np.random.default_rng(7), 0.8, 2)
    W = rows(a)
    fill(W, 1, lambda k: series.power_order(W, 0, 1, p, 0.0, k))
    assert_series(W[1], lambda x: f(x) ** mp.mpf(p))


def test_a_whole_power_of_something_negative() -> None:
    a, f = argument(np.random.default_rng(8), -2, -1)
    W = rows(a)
    fill(W, 1, lambda k: series.power_order(W, 0, 1, 9.0, 0.0, k))
    assert_series(W[1], lambda x: f(x) ** 9)


@seeds
def test_exponential_and_logarithm(seed: int) -> None:
    a, f = argument(np.random.default_rng(seed), 0.8, 2)
    W = rows(a, free=2)
    fill(W, 1, lambda k: series.exp_order(W, 0, 1, k))
    fill(W, 2, lambda k: series.log_order(W, 0, 2, k))
    assert_series(W[1], lambda x: mp.exp(f(x)))
    assert_series(W[2], lambda x: mp.log(f(x)))


@seeds
@pytest.mark.parametrize(
    ("recurrence", "sine", "cosine"),
    [(series.rotation_order, mp.sin, mp.cos), (series.hyperbolic_order, mp.sinh, mp.cosh)],
)
def test_pairs(recurrence: Callable, sine: Series, cosine: Series, seed: int) -> None:
    a, f = argument(np.random.default_rng(seed), -2, 2)
    W = rows(a, free=2)
    for k in range(ORDER + 1):
        recurrence(W, 0, 1, 2, k)
    assert_series(W[1], lambda x: sine(f(x)))
    assert_series(W[2], lambda x: cosine(f(x)))


@pytest.mark.parametrize(
    ("recurrence", "sine", "cosine"),
    [(series.steady_rotation_order, mp.sin, mp.cos), (series.hyperbolic_order, mp.sinh, mp.cosh)],
)
@pytest.mark.parametrize("rate", [2.3, -0.7])
def test_pairs_of_a_steady_phase(
    recurrence: Callable, sine: Series, cosine: Series, rate: float
) -> None:
    a = np.zeros(ORDER + 1)
    a[:2] = 0.4, rate
    W = rows(a, free=2)
    for k in range(ORDER + 1):
        recurrence(W, 0, 1, 2, k)
    assert_series(W[1], lambda x: sine(mp.mpf("0.4") + mp.mpf(rate) * x))
    assert_series(W[2], lambda x: cosine(mp.mpf("0.4") + mp.mpf(rate) * x))


@seeds
def test_chain(seed: int) -> None:
    # y = atan a, from the series of its slope 1/(1 + a²).
    a, f = argument(np.random.default_rng(seed), -2, 2)
    W = rows(a, free=2)
    with mp.workdps(60):
        W[1] = [float(v) for v in mp.taylor(lambda x: 1 / (1 + f(x) ** 2), 0, ORDER)]
    fill(W, 2, lambda k: np.arctan(a[0]) if k == 0 else series.chain_order(W, 0, 1, k))
    assert_series(W[2], lambda x: mp.atan(f(x)))


def test_lagged_product() -> None:
    rng = np.random.default_rng(3)
    (a, f), (b, g) = argument(rng, -2, 2), argument(rng, -2, 2)
    W = rows(a, b)
    fill(W, 2, lambda k: series.lagged_order(W, 0, 1, k))
    W[2] += a[0] * b
    assert_series(W[2], lambda x: f(x) * g(x))


@seeds
def test_linear_system(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = 5
    A = rng.normal(size=(n, n))
    right = rng.normal(size=(n, ORDER + 1))
    A[0, 0] = 0.0  # the first pivot is not the first entry
    R = np.empty((n, n))
    W = rows(right, free=n)
    assert series.invert(np.vstack([A, np.zeros(n)]), n, R)
    for k in range(ORDER + 1):
        series.solve_order(R, 0, W, 0, n, n, k)
    np.testing.assert_allclose(A @ W[n:], right, rtol=0, atol=1e-12)


def test_a_singular_matrix_is_recognised() -> None:
    root = np.random.default_rng(5).normal(size=(4, 3))
    assert not series.invert(np.vstack([root @ root.T, np.zeros(4)]), 4, np.empty((4, 4)))


@pytest.mark.parametrize(
    ("function", "x", "value"),
    [
        (lambda: series.real_power(-1.0, 0.5), "power", np.nan),
        (lambda: series.reciprocal(0.0), "reciprocal", np.inf),
    ],
)
def test_what_is_undefined_stays_visible(
    function: Callable[[], float], x: str, value: float
) -> None:
    np.testing.assert_equal(function(), value)


# --- From a formula to machine code ---------------------------------------------------------------

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


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.tuples(*[st.floats(-1e9, 1e9)] * 2), min_size=1, max_size=5), st.floats(-1e-9, 1e-9)
)
def test_sum_in_which_large_terms_cancel(pairs, rest):
    """Against rational numbers: a·b − a·b·(1 + ε) keeps its digits."""
    a, b = zip(*pairs, strict=True)
    a = (*a, -a[0], rest)
    b = (*b, b[0] * (1.0 + 1e-13), 1.0)
    exact = sum(Fraction(x) * Fraction(y) for x, y in zip(a, b, strict=True))
    size = sum(abs(Fraction(x) * Fraction(y)) for x, y in zip(a, b, strict=True))
    error = abs(Fraction(series.dot(a, b)) - exact)
    assert error <= 2.0**-52 * abs(exact) + 2.0**-96 * size + 1e-290


def test_sum_of_what_overflows():
    assert series.dot((1e200, 1.0), (1e200, 1.0)) == np.inf
    assert series.dot((1e305, 1.0), (1.0, 1.0)) == 1e305
