"""What leaves a system unchanged: slopes at many points, with as few rows as they take."""

from __future__ import annotations

import numpy as np
import pytest

from stickslip.orbits.fields.symmetry import _merged


@pytest.mark.parametrize("timed", [False, True])
def test_merged_slopes_have_the_same_singular_values(timed: bool) -> None:
    rng = np.random.default_rng(5)
    for _ in range(30):
        points, functions, n = (int(rng.integers(1, 6)) for _ in range(3))
        slopes = rng.normal(size=(points, functions, 1 + n))
        alike = rng.uniform(size=functions) < 0.6
        slopes[:, alike, 1:] = slopes[:1, alike, 1:]
        slopes[:, rng.uniform(size=functions) < 0.3, 0] = 0.0
        found = _merged(slopes, timed)
        every = slopes.reshape(-1, 1 + n)
        weighted = found.weights[:, None] * found.rows
        np.testing.assert_allclose(weighted.T @ weighted, every.T @ every, atol=1e-13)
        for f in range(functions):
            own = weighted[found.of == f]
            wanted = slopes[:, f].T @ slopes[:, f]
            np.testing.assert_allclose(own.T @ own, wanted, atol=1e-13)
