"""Some random formulas at every place where one may stand. The long run is ``python -m
tests.adversarial``."""

from __future__ import annotations

import pytest

from adversarial.kinds import formulas
from adversarial.kinds.formulas import FAMILIES
from adversarial.verdict import AGREED

# "but right" is a guard that is undefined in a branch that is not taken.
FAIR = ("", "but right")


@pytest.mark.parametrize("family", FAMILIES)
def test_formula(family: str) -> None:
    """Odd seeds have no drive, so that equilibria are looked for, too."""
    for seed in (0, 1, 2, 5):
        case = formulas.draw(family, seed)
        verdict = formulas.judge(case)
        assert verdict.kind == AGREED or verdict.note in FAIR, (
            f"{verdict}\n{formulas.reproduction(case)}"
        )


@pytest.mark.parametrize(
    ("family", "seed"),
    [
        ("formula: kinetic force", 45),  # a kink of the speed, where nothing moves
        ("formula: kinetic force", 93),  # undefined in a region
        ("formula: kinetic force", 237),
        ("formula: force", 77),
        ("formula: planar contact", 201),  # undefined at the only place of a set
    ],
)
def test_equilibria_of_formulas_that_were_not_read(family: str, seed: int) -> None:
    """The search for equilibria raised KeyError, ValueError or ZeroDivisionError."""
    assert formulas.judge(formulas.draw(family, seed)).kind == AGREED
