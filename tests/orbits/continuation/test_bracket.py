"""Zeros near a guess: where secants divide by zero, brackets do not."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from stickslip.orbits.continuation.bracket import zero_between, zero_near


@pytest.mark.parametrize(
    ("function", "known", "guess", "zero"),
    [
        (lambda x: x - 2.0, 0.0, 1.9, 2.0),  # a little beyond the guess
        (lambda x: x - 2.0, 3.0, 2.5, 2.0),  # well beyond it, downward
        # flat on both sides: every slope is 0
        (lambda x: math.copysign(1.0, x - 2.0), 0.0, 1.9, 2.0),
        (lambda x: (x - 2.0) ** 3, 0.0, 1.9, 2.0),  # flat at the zero
        (lambda x: 0.0, 1.0, 2.0, 1.0),  # zero where it is known
        (lambda x: x, 0.5, 0.5, None),  # the guess is no other place
        (lambda x: 1.0, 0.0, 1.0, None),  # constant: no slope, no zero
        (lambda x: 1.0 + x * x, 0.0, 1.0, None),
        (lambda x: 1.0 - x if x < 0.5 else math.nan, 0.0, 1.0, None),
        (lambda x: math.nan, 0.0, 1.0, None),
    ],
)
def test_zero_near(
    function: Callable[[float], float], known: float, guess: float, zero: float | None
) -> None:
    found = zero_near(function, known, guess)
    assert found == (None if zero is None else pytest.approx(zero, abs=1e-5))


def test_errors_are_passed_on() -> None:
    with pytest.raises(ZeroDivisionError):
        zero_near(lambda x: 1.0 / (x - 1.0), 0.0, 1.0)


def test_a_bracket_is_not_left_silently() -> None:
    """Where a function is not finite, neither is the result, without a warning."""
    with np.errstate(all="raise"):
        for bad in (math.inf, -math.inf, math.nan):
            assert math.isnan(zero_between(lambda x, bad=bad: bad, 0.0, 1.0, -1.0, 1.0))
            assert math.isnan(zero_between(lambda x: x, 0.0, 1.0, bad, 1.0))
    assert zero_between(lambda x: x**3 - 0.1, 0.0, 1.0, -0.1, 0.9) == pytest.approx(0.1 ** (1 / 3))
