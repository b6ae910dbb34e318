"""Global minima by branch and bound."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stickslip.symbolic import expressions as ex
from stickslip.symbolic.extrema import least
from stickslip.symbolic.formulas import Scope

SCOPE = Scope({name: ex.sym(name) for name in ("s", "a")})
WELLS = {
    "V": "abs(sin(pi*(s - {place!r})))/{width!r}",
    "clipped V": "min(1, abs(s - {place!r})/{width!r})",
    "Gauss": "1 - exp(-((s - {place!r})/{width!r})**2)",
    "Gauss on the circle": "1 - exp(-(sin(pi*(s - {place!r}))/{width!r})**2)",
    "Lorentz": "1 - 1/(1 + ((s - {place!r})/{width!r})**2)",
    "tanh": "tanh(abs(s - {place!r})/{width!r})",
    "box": "piecewise(s < {place!r} - {width!r}, 1, s < {place!r} + {width!r}, 0, 1)",
}


@pytest.mark.parametrize("kind", WELLS)
@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.floats(0.01, 0.99), st.floats(-9, -2), st.floats(0.0, 2.0), st.integers(1, 9))
def test_no_well_is_too_narrow(
    kind: str, place: float, exponent: float, bottom: float, waves: int
) -> None:
    """A well of depth 1 in a wave of height 1/2: its bottom is the minimum, wherever it is."""
    width = 10.0**exponent
    well = WELLS[kind].format(place=place, width=width)
    found = least(
        SCOPE.parse(f"{bottom!r} + {well} + 0.5*(1 - cos(2*pi*{waves}*(s - {place!r})))", "here"),
        "s",
        0,
        1,
    )
    assert found.floor <= found.value and found.resolved
    # Between two numbers that are neighbours a well may have another value.
    assert abs(found.value - bottom) <= 1e-12 + 2e-14 / width
    assert found.gap <= 1e-12 + 2e-14 / width
    assert found.boxes < 5000


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1))
def test_waves_against_a_fine_grid(seed: int) -> None:
    rng = np.random.default_rng(seed)
    terms = [
        (float(a), int(k), float(p))
        for a, k, p in zip(
            rng.normal(size=5), rng.integers(1, 30, 5), rng.uniform(size=5), strict=True
        )
    ]
    text = " + ".join(f"{a!r}*cos(2*pi*{k}*(s - {p!r}))" for a, k, p in terms)
    found = least(SCOPE.parse(text, "here"), "s", 0.0, 1.0)
    s = np.linspace(0.0, 1.0, 200_001)
    sampled = np.sum([a * np.cos(2 * np.pi * k * (s - p)) for a, k, p in terms], axis=0).min()
    assert found.resolved and found.gap <= 1e-12
    assert found.floor <= sampled <= found.value + 1e-5
    assert found.value <= sampled + 1e-13


def test_the_gap_is_stated_where_boxes_run_out() -> None:
    """sin² + cos² is 1, which no interval sees: the gap falls with the square of the number of
    boxes."""
    e = SCOPE.parse("sin(2*pi*s)**2 + cos(2*pi*s)**2", "here")
    few, many = (least(e, "s", 0.0, 1.0, most=most) for most in (2000, 50_000))
    assert not few.resolved and not many.resolved
    assert 1e-9 < many.gap < 1e-2 * few.gap and few.gap < 1e-3
    assert many.floor <= 1.0 <= many.value <= 1.0 + 1e-14
    assert few.boxes <= 2000


def test_other_names_have_ranges() -> None:
    found = least(SCOPE.parse("a*sin(2*pi*s)", "here"), "s", 0.0, 1.0, others={"a": (1.0, 2.0)})
    assert found.floor == pytest.approx(-2.0, rel=1e-12)


def test_undefined_and_unbounded_formulas() -> None:
    assert least(SCOPE.parse("log(abs(s - 0.3))", "here"), "s", 0.0, 1.0).floor == -math.inf
    assert least(SCOPE.parse("1/abs(s - 0.3)", "here"), "s", 0.0, 1.0).floor == pytest.approx(
        1 / 0.7
    )
    assert not math.isnan(least(SCOPE.parse("sqrt(s - 0.5)", "here"), "s", 0.0, 1.0).floor)
