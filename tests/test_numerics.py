"""Ratios whose denominators may vanish."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from stickslip.numerics.ratios import ratio

SIZES = st.floats(0.0, 1e300) | st.sampled_from([0.0, 5e-324, 1e-300, 1.0])
VALUES = st.floats(-1e6, 1e6)


@given(VALUES, SIZES)
def test_a_ratio_is_the_quotient_where_there_is_one(a: float, b: float) -> None:
    found = ratio(a, b)
    assert type(found) is float
    assert found == a / (b if b > 1e-300 else 1e-300)
    assert math.copysign(1.0, found) == math.copysign(1.0, a)


@given(arrays(float, 4, elements=VALUES), arrays(float, 4, elements=SIZES))
def test_arrays_have_the_ratios_of_their_elements(a: np.ndarray, b: np.ndarray) -> None:
    assert ratio(a, b).tolist() == [
        ratio(x, y) for x, y in zip(a.tolist(), b.tolist(), strict=True)
    ]
    assert ratio(a, float(b[0])).tolist() == [ratio(x, float(b[0])) for x in a.tolist()]
    assert ratio(1.0, b).tolist() == [ratio(1.0, y) for y in b.tolist()]


def test_where_nothing_is_missed_of_nothing_the_ratio_is_zero() -> None:
    assert ratio(0.0, 0.0) == 0.0
    assert ratio(1e-280, 0.0) > 1e19
    assert ratio(np.float64(1.0), np.float64(0.0)) > 1e299
    assert math.isnan(ratio(1.0, math.nan))
    assert np.isnan(ratio(np.ones(2), np.array([math.nan, 1.0]))).tolist() == [True, False]
