"""Every claim of the paper has the verdict that is expected, and each says what it has to say."""

from __future__ import annotations

import math

import pytest

from stickslip_paper import claims
from stickslip_paper.sections.claim import (
    Claim,
    Finding,
    Verdict,
    claim,
    corrects,
    equals,
    maximum,
    minimum,
    scales,
    shows,
    together,
    vanishes,
)
from stickslip_paper.sections.laws import in_sympy, zero

CLAIMS = claims()


@pytest.mark.parametrize("item", CLAIMS, ids=lambda item: item.name)
def test_claim(item: Claim) -> None:
    finding = item.verify()
    assert finding.verdict is item.expected, finding.measured
    assert finding.measured


def test_there_is_one_for_every_section() -> None:
    assert len(CLAIMS) >= 100
    assert len({item.name for item in CLAIMS}) == len(CLAIMS)
    places = {item.place for item in CLAIMS}
    assert {
        "(2.1)",
        "(2.5)",
        "(3.1)",
        "(3.6)",
        "(4.1b)",
        "(4.2a)",
        "theorem 2.2",
        "theorem 3.1",
    } <= places
    assert {f"section {n}" for n in ("2.2", "2.3", "3", "4.1", "4.2", "4.3", "4.4")} <= places


def test_what_is_corrected_says_how_and_why() -> None:
    for item in CLAIMS:
        assert item.statement.endswith(".") and item.formula and item.how, item.name
        corrected = item.expected in (Verdict.CORRECTED, Verdict.FAILS)
        assert bool(item.correction) is corrected, item.name
        assert bool(item.derivation) is corrected, item.name


@pytest.mark.parametrize(
    "name",
    [
        "jacobian_entry",
        "sign_of_the_unfolding",
        "limit_beta_equation",
        "travel_time_of_slip",
        "sticking_orbit",
        "range_of_the_inverse",
        "stick_map_and_viscosity",
        "play_comes_down_from_its_maximum",
        "last_move_starts_late",
        "convention_of_the_loads",
        "pull_of_the_weight",
        "turning_angle",
        "left_curve_changes_sign",
        "distance_stays_between",
        "size_of_rates",
        "amplitude_of_the_walk",
    ],
)
def test_known_slips_are_among_them(name: str) -> None:
    (found,) = [item for item in CLAIMS if item.name == name]
    assert found.expected is Verdict.CORRECTED


def test_judgements() -> None:
    assert vanishes(1e-13, 1e-12).verdict is Verdict.HOLDS
    assert equals(1.0, 1.1, 0.05, "x").verdict is Verdict.FAILS
    for broken in (
        vanishes(math.nan, 1.0),
        equals(math.nan, 1.0, 1.0, "x"),
        corrects(1.0, math.nan, 1.0),
    ):
        assert broken.verdict is Verdict.FAILS
    assert corrects(1.0, 1e-13, 1e-12).verdict is Verdict.CORRECTED
    # the printed form is right after all
    assert corrects(1e-13, 1e-13, 1e-12).verdict is Verdict.HOLDS
    assert corrects(math.nan, 1e-13, 1e-12).verdict is Verdict.FAILS
    assert math.isnan(maximum(0.0, math.nan, 1.0)) and math.isnan(minimum(0.0, math.nan))
    x = [1e-1, 1e-2, 1e-3]
    assert scales(x, [3 * v**0.5 for v in x], 0.5, 0.01, "y", "x").verdict is Verdict.ASYMPTOTIC
    assert scales(x, [3 * v for v in x], 0.5, 0.01, "y", "x").verdict is Verdict.FAILS
    assert scales(x, [0.0, 0.0, 0.0], 0.5, 0.01, "y", "x").verdict is Verdict.FAILS
    good, bad = shows(True, "good"), shows(False, "bad")
    assert together(good, corrects(1.0, 0.0, 1e-9)).verdict is Verdict.CORRECTED
    assert together(corrects(1.0, 0.0, 1e-9), bad).verdict is Verdict.FAILS


def test_a_check_that_stops_fails() -> None:
    @claim("(0.0)", "1/0", "by hand")
    def divided() -> Finding:
        """One divided by zero."""
        raise ZeroDivisionError("by zero")

    finding = divided.verify()
    assert finding.verdict is Verdict.FAILS
    assert "by zero" in finding.measured
    assert divided.statement == "One divided by zero."


def test_expressions_in_sympy() -> None:
    import sympy as sp

    from stickslip.symbolic import expressions as ex

    x, y = ex.sym("x"), ex.sym("y")
    a, b = sp.symbols("x y", real=True)
    pairs = [
        (x * x * 0.25 - y / x + 3.0, a**2 / 4 - b / a + 3),
        (ex.call("exp", x * y) * ex.call("tanh", x), sp.exp(a * b) * sp.tanh(a)),
        (ex.power(x, ex.num(-1.5)), a ** sp.Rational(-3, 2)),
    ]
    for ours, theirs in pairs:
        assert zero(in_sympy(str(ours)) - theirs)
    larger = in_sympy(str(ex.maximum(x, y)))
    assert larger.subs({a: 2, b: 1}) == 2 and larger.subs({a: 1, b: 3}) == 3


@pytest.mark.parametrize("text", ["x.real", "exp(x, 2)", "x if y else 1", "x < 1", "x // 2"])
def test_only_formulas_are_translated(text: str) -> None:
    with pytest.raises((ValueError, KeyError)):
        in_sympy(text)
