"""A few random branches of equilibria against closed forms. Long: ``python -m tests.adversarial
--only equilibrium_branches``."""

from __future__ import annotations

from dataclasses import replace

import pytest

import stickslip as ss
from adversarial.kinds import equilibrium_branches as eb
from adversarial.verdict import AGREED, NO_REFERENCE, WRONG

KINDS = {
    "load": {"fold", "Hopf"},
    "load on a spring with a kink": {"fold", "Hopf", "boundary equilibrium"},
    "speed of the belt": {"Hopf"},
}


@pytest.mark.parametrize("family", eb.FAMILIES)
def test_branches(family: str) -> None:
    """Among some seeds there are points of all kinds."""
    special = set[str]()
    for seed in range(10):
        case = eb.draw(family, seed)
        verdict = eb.judge(case)
        assert verdict.kind in (AGREED, NO_REFERENCE), f"{verdict}\n{eb.reproduction(case)}"
        special |= {kind for kind, *_ in verdict.numbers.get("expected", ())}
    assert special >= KINDS[family]


def test_what_is_left_out_moved_or_made_up_is_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    case = next(
        case
        for case in (eb.draw("load", seed) for seed in range(50))
        if len(eb.judge(case).numbers.get("expected", ())) > 2
    )
    found = eb.branch_of(case)
    assert isinstance(found, ss.Branch)
    (first, *others) = found.special
    width = eb.reach(case)[1] - eb.reach(case)[0]
    for wrong in (
        others,
        [*found.special, replace(first, state={"x": first.state["x"] + 0.5, "d_x": 0.0})],
        [replace(first, value=first.value + 1e-7 * width), *others],
    ):
        moved = replace(found, special=wrong)
        monkeypatch.setattr(eb, "branch_of", lambda case, moved=moved: moved)
        assert eb.judge(case).kind == WRONG
