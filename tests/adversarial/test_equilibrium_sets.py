"""A few random sets of equilibria against dense scans. Long: ``python -m tests.adversarial``."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adversarial.kinds import equilibrium_sets
from adversarial.verdict import AGREED, WRONG


@pytest.mark.parametrize("family", equilibrium_sets.FAMILIES)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_sets(family: str, seed: int) -> None:
    case = equilibrium_sets.draw(family, seed)
    verdict = equilibrium_sets.judge(case)
    assert verdict.kind == AGREED, f"{verdict}\n{equilibrium_sets.reproduction(case)}"


def test_what_is_missing_joined_or_moved_is_wrong() -> None:
    case = replace(equilibrium_sets.draw("wells on a line", 2), box={})
    assert equilibrium_sets.judge(case).kind == AGREED
    sets = case.sets()
    assert len(sets) > 2
    (((low, high),), *others) = sets
    ((_, last),) = others[-1]
    for wrong in (
        others,
        [*sets, ((9.0, 10.0),)],
        [((low, last),)],
        [((low, high + 1e-6),), *others],
    ):
        assert equilibrium_sets.judge(replace(case, sets=lambda w=wrong: w)).kind == WRONG


def test_the_reference_knows_closed_forms() -> None:
    (inner, outer) = equilibrium_sets.on_a_line(
        lambda x: np.minimum(abs(x) - 1e-5, 1 - abs(x)), -2.0, 2.0
    )
    assert np.ravel([inner, outer]) == pytest.approx([-1, -1e-5, 1e-5, 1], abs=1e-14)
    (one,) = equilibrium_sets.in_a_plane(lambda z: 1 - z[:1] ** 2 - z[1:] ** 2 / 4, 3.0)
    assert np.ravel(one) == pytest.approx([-1, 1, -2, 2], rel=1e-9)
