"""The interpreter of the tape, against series that mpmath computes to 30 digits."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, cast

import mpmath as mp
import numpy as np
import pytest

from stickslip.arrays import Array
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.scalars import ParameterExpressions, Scalar, numeral
from stickslip.symbolic.tape import Instruction, Op, Scaled

from .tape import Call, Undetermined, inverse, is_definite, step_of, value_of, zero_of

ORDER = 24
Mpf = Any  # mpmath.mpf: no type checker can tell what it is
Series = Callable[[Mpf], Mpf]
seeds = pytest.mark.parametrize("seed", range(4))


@pytest.fixture(autouse=True)
def thirty_digits() -> Iterator[None]:
    with mp.workdps(30):
        yield


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


def computed(instruction: Instruction, *known: Array, free: int = 1, mode: int = 1) -> Array:
    """The rows of a tape with one instruction, and `free` rows for its results."""
    W = np.vstack([*known, np.full((free, ORDER + 1), np.nan)])
    c = Call({"W": W, "mode": np.array([mode]), "B": np.full((4, 4), np.nan)})
    step = step_of(instruction, ParameterExpressions([]))
    for k in range(ORDER + 1):
        step(c, k)
    return W


@seeds
def test_product(seed: int) -> None:
    rng = np.random.default_rng(seed)
    (a, f), (b, g) = argument(rng, -2, 2), argument(rng, -2, 2)
    W = computed(Instruction(Op.PRODUCT, 2, (0, 1)), a, b)
    assert_series(W[2], lambda x: f(x) * g(x))


@seeds
def test_quotient_and_reciprocal(seed: int) -> None:
    rng = np.random.default_rng(seed)
    (a, f), (b, g) = argument(rng, -2, 2), argument(rng, 1, 2)
    b *= (-1) ** seed  # and g with it
    assert_series(computed(Instruction(Op.QUOTIENT, 2, (0, 1)), a, b)[2], lambda x: f(x) / g(x))
    assert_series(computed(Instruction(Op.RECIPROCAL, 1, (0,)), b)[1], lambda x: 1 / g(x))


def power(a: Array, p: float) -> Array:
    return computed(Instruction(Op.POWER, 1, (0,), (Scaled(ex.num(p)),)), a)[1]


@pytest.mark.parametrize("p", [0.5, -0.5, 1 / 3, 2.7, -3.0, 9.0])
def test_power(p: float) -> None:
    a, f = argument(np.random.default_rng(7), 0.8, 2)
    assert_series(power(a, p), lambda x: f(x) ** mp.mpf(p))


def test_a_whole_power_of_something_negative() -> None:
    a, f = argument(np.random.default_rng(8), -2, -1)
    assert_series(power(a, 9.0), lambda x: f(x) ** 9)


@seeds
@pytest.mark.parametrize(("op", "function"), [(Op.EXP, mp.exp), (Op.LOG, mp.log)])
def test_exponential_and_logarithm(op: Op, function: Series, seed: int) -> None:
    a, f = argument(np.random.default_rng(seed), 0.8, 2)
    assert_series(computed(Instruction(op, 1, (0,)), a)[1], lambda x: function(f(x)))


@seeds
@pytest.mark.parametrize(
    ("op", "sine", "cosine"), [(Op.ROTATION, mp.sin, mp.cos), (Op.HYPERBOLIC, mp.sinh, mp.cosh)]
)
def test_pairs(op: Op, sine: Series, cosine: Series, seed: int) -> None:
    a, f = argument(np.random.default_rng(seed), -2, 2)
    W = computed(Instruction(op, 1, (0,)), a, free=2)
    assert_series(W[1], lambda x: sine(f(x)))
    assert_series(W[2], lambda x: cosine(f(x)))


@pytest.mark.parametrize("rate", [2.3, -0.7])
def test_sine_and_cosine_of_a_steady_phase(rate: float) -> None:
    a = np.zeros(ORDER + 1)
    a[:2] = 0.4, rate
    W = computed(Instruction(Op.STEADY, 1, (0,)), a, free=2)
    assert_series(W[1], lambda x: mp.sin(mp.mpf(0.4) + mp.mpf(rate) * x))
    assert_series(W[2], lambda x: mp.cos(mp.mpf(0.4) + mp.mpf(rate) * x))


@seeds
@pytest.mark.parametrize(("op", "function"), [(Op.TAN, mp.tan), (Op.TANH, mp.tanh)])
def test_tangents(op: Op, function: Series, seed: int) -> None:
    a, f = argument(np.random.default_rng(seed), -0.7, 0.7)
    W = computed(Instruction(op, 1, (0,), function=op.name.lower()), a, free=2)
    assert_series(W[1], lambda x: function(f(x)))
    assert_series(W[2], lambda x: 1 + (1 if op is Op.TAN else -1) * function(f(x)) ** 2)


@seeds
def test_chain(seed: int) -> None:
    a, f = argument(np.random.default_rng(seed), -2, 2)
    with mp.workdps(60):
        slope = np.array([float(v) for v in mp.taylor(lambda x: 1 / (1 + f(x) ** 2), 0, ORDER)])
    W = computed(Instruction(Op.CHAIN, 2, (0, 1), function="atan"), a, slope)
    assert_series(W[2], lambda x: mp.atan(f(x)))


@seeds
def test_direction(seed: int) -> None:
    rng = np.random.default_rng(seed)
    (a, f), (b, g) = argument(rng, 1, 2), argument(rng, -2, 2)
    W = computed(Instruction(Op.DIRECTION, 3, (0, 1, 2)), a, b, np.ones(ORDER + 1), free=3)
    for row, side in ((3, f), (4, g), (5, None)):

        def exact(x: Mpf, side: Series | None = side) -> Mpf:
            speed = mp.sqrt(f(x) ** 2 + g(x) ** 2)
            return speed if side is None else side(x) / speed

        assert_series(W[row], exact)
    stuck = computed(Instruction(Op.DIRECTION, 3, (0, 1, 2)), a, b, b, free=3, mode=0)
    assert not np.any(stuck[3:])


@seeds
def test_rates_whose_matrix_changes(seed: int) -> None:
    """A product of the matrix and the rates is the right-hand side, order by order."""
    rng = np.random.default_rng(seed)
    n = 4
    A = rng.normal(size=(n * n, ORDER + 1)) * 0.5 ** np.arange(ORDER + 1)
    A[0, 0] = 0.0  # the first pivot is not the first entry
    right = rng.normal(size=(n, ORDER + 1))
    entries = tuple(Instruction(Op.ENTRY, row, (row,)) for row in range(n * n))
    first = n * n
    rates = Instruction(Op.RATES, first + n, (first,), size=n, matrix="B", entries=entries)
    y = computed(rates, A, right, free=n)[first + n :]
    size = np.maximum.accumulate(np.max(np.abs(y), axis=0))
    for i in range(n):
        made = sum(np.convolve(A[i * n + j], y[j])[: ORDER + 1] for j in range(n))
        np.testing.assert_array_less(np.abs(made - right[i]), 1e-12 * (1.0 + size))


def test_a_matrix_without_inverse() -> None:
    root = np.random.default_rng(5).normal(size=(4, 3))
    with pytest.raises(Undetermined, match="1"):
        inverse(root @ root.T)
    with pytest.raises(Undetermined, match="1"):
        inverse(np.zeros((1, 1)))
    units = np.diag([1e12, 1e-200])
    np.testing.assert_allclose(inverse(units) @ units, np.eye(2), rtol=1e-15)


def test_definite_matrices() -> None:
    root = np.random.default_rng(5).normal(size=(4, 4))
    assert is_definite(root @ root.T)
    assert not is_definite(root[:, :3] @ root[:, :3].T)
    assert not is_definite(-np.eye(2))


@pytest.mark.parametrize("zero", [0.0, 1e-200, -3.7, 1e200])
def test_zero_of_an_increasing_function(zero: float) -> None:
    assert zero_of(lambda v: (np.arctan(v - zero), 1.0)) == pytest.approx(zero, rel=1e-15)


def test_no_zero_of_a_falling_function() -> None:
    assert np.isnan(zero_of(lambda v: (1.0 - v, -1.0)))


@pytest.mark.parametrize(
    ("op", "arguments", "value"),
    [
        ("real_power", (-1.0, 0.5), np.nan),
        ("reciprocal", (0.0,), np.nan),
        ("quotient", (-1.0, 0.0), -np.inf),
        ("over", (1.0, 0.0), 0.0),
        ("first_power", (1e-16, 0.5, 1.0), 0.0),
        ("dot", (1e200, 1e200, 1.0, 1.0), np.inf),
        ("dot", (1e16, 1.0, 1.0, 1.0, -1e16, 1.0), 1.0),
        ("sign", (0.0, 2.0, 3.0), 2.0),
        ("sign", (-1.0, 2.0, 3.0), 3.0),
    ],
)
def test_what_is_undefined_stays_visible(
    op: str, arguments: tuple[float, ...], value: float
) -> None:
    with np.errstate(all="ignore"):
        made = value_of(Scalar(op, tuple(map(numeral, arguments))))(Call({}))
    np.testing.assert_equal(made, value)


def test_what_is_not_known_is_refused() -> None:
    with pytest.raises(NotImplementedError):
        step_of(Instruction(cast(Op, max(Op) + 1), 0), ParameterExpressions([]))
    with pytest.raises(NotImplementedError, match="unheard of"):
        value_of(Scalar("unheard of"))
