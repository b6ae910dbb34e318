"""Formulas that are convex and homogeneous of degree 1: what is proved, and what is refused."""

from __future__ import annotations

import re

import numpy as np
import pytest

from stickslip.arrays import Array
from stickslip.convex.degree import degree
from stickslip.convex.formula import ConvexFormula, convex_formula
from stickslip.errors import DeclarationError
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.evaluator import evaluator, evaluator_of_numbers
from stickslip.symbolic.formulas import Scope

PHASE = {"s": (0.0, 1.0)}


def read(text: str, n: int = 2) -> ex.Expr:
    names = [f"v{i + 1}" for i in range(n)]
    return Scope({name: ex.sym(name) for name in [*names, "s"]}).parse(text, "R")


def checked(text: str, n: int = 2) -> ConvexFormula:
    value = read(text, n)
    names = tuple(f"v{i + 1}" for i in range(n))
    return convex_formula(value, names, PHASE if "s" in value.symbols else {}, "R")


PROVED = {
    "sqrt(v1**2 + (3*v2)**2)": "by its form",
    "sqrt(2*v1**2 + v1*v2 + v2**2)": "by its form",
    "sqrt(v1**2 + 2*v1*v2 + v2**2 + 1e-3*v2**2)": "by its form",
    "(abs(v1)**3 + abs(v2)**3)**(1/3)": "by its form",
    "(v1**4 + v2**4)**(1/4)": "by its form",
    "sqrt(v1**2 + v2**2) - v1": "by its form",
    "max(sqrt(v1**2 + v2**2), 2*abs(v1)) + 0.1*v2": "by its form",
    "piecewise(v1 > 0, 0.11, 0.14)*abs(v1) + 0.2*abs(v2)": "by its form",
    "sqrt(piecewise(v1 > 0, 0.11, 0.14)**2*v1**2 + 0.04*v2**2)": "by its form",
    "sqrt((0.11*max(v1, 0) - 0.14*min(v1, 0))**2 + (0.2*v2)**2)": "by its form",
    "(0.11*v1**2 + 0.2*v2**2)/sqrt(v1**2 + v2**2)": "by bounds of its second derivatives",
    "piecewise(v1 > 0, (v1**2 + 1.1*v2**2)/sqrt(v1**2 + v2**2), 1.1*sqrt(2*v1**2 + v2**2))": (
        "by bounds of its second derivatives"
    ),
    "(2 + cos(2*pi*s))*abs(v1) + sqrt(v1**2 + (1 + sin(2*pi*s)**2)*v2**2)": "by its form",
    "(v1**2 + (1.2 + 0.3*cos(2*pi*s))*v2**2)/sqrt(v1**2 + v2**2)": (
        "by bounds of its second derivatives"
    ),
}


@pytest.mark.parametrize("text", PROVED)
def test_what_is_proved(text: str) -> None:
    formula = checked(text)
    assert formula.proved, formula.evidence
    assert formula.convex == PROVED[text]
    assert formula.homogeneous == "by its form"


def test_three_components() -> None:
    text = "(v1**2 + 1.1*v2**2 + 0.9*v3**2)/sqrt(v1**2 + v2**2 + v3**2)"
    assert checked(text, 3).convex == "by bounds of its second derivatives"
    assert checked("sqrt(v1**2 + v2**2) + 2*sqrt(v2**2 + v3**2)", 3).proved


REFUSED = {
    "degree 2": ("v1**2 + v2**2", r"homogeneous of degree 2, not 1: R\(2 v\) is 4 R\(v\)"),
    "no degree": ("log(exp(v1) + exp(-v1)) + abs(v2)", r"not homogeneous of degree 1"),
    "constant": ("abs(v1) + abs(v2) + 0.1", r"not homogeneous of degree 1"),
    "negative": ("abs(v1) - 0.5*abs(v2)", r"it is -0.5 at v = \(0, 1\)"),
    "negative in part": ("sqrt(v1**2 + v2**2) - 1.1*v1", r"nonnegative"),
    "concave": ("min(abs(v1), abs(v2))", r"not convex: R\(u \+ w\) = .* exceeds"),
    "mean": ("sqrt(abs(v1*v2))", r"not convex"),
    "curved": ("(0.11*v1**2 + 0.3*v2**2)/sqrt(v1**2 + v2**2)", r"not convex"),
    "concave kink": ("sqrt(v1**2 + v2**2) - 0.05*abs(v1)", r"not convex"),
    "jump": ("piecewise(v1 > 0, 1, 2)*sqrt(v1**2 + v2**2)", r"not convex"),
    "undefined": ("sqrt(v1) + abs(v2)", r"no finite value at v = \("),
    "pole": ("v1**2/abs(v1) + abs(v2)", r"no finite value at v = \(0, 1\)"),
    "at a phase": ("abs(v1) + (1.5 + 2*cos(2*pi*s))*abs(v2)", r"nonnegative|not convex"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused(case: str) -> None:
    text, message = REFUSED[case]
    with pytest.raises(DeclarationError, match=message):
        checked(text)


def test_one_component_is_convex_if_it_is_nonnegative() -> None:
    assert checked("piecewise(v1 > 0, v1, -2*v1)", 1).proved
    with pytest.raises(DeclarationError, match="nonnegative"):
        checked("v1", 1)


def test_what_is_too_narrow_to_see_is_not_proved() -> None:
    """A bump of half a thousandth of a radian, which no sample meets, makes it concave there."""
    width = "(v1/(abs(v1) + abs(v2)) - 0.31234)/0.0005"
    bump = f"1e-3*exp(-({width})**2)*(abs(v1) + abs(v2))"
    formula = checked(f"sqrt(v1**2 + v2**2) + {bump}")
    assert not formula.convex
    assert not formula.proved
    assert re.search(r"convex as sampled in \d+ directions", formula.evidence)
    # It is indeed not convex.
    angles = np.linspace(0.0, np.pi / 2, 200_001)
    v = np.array([np.cos(angles), np.sin(angles)])
    R = formula.values(v)[0]
    step = angles[1]
    assert ((R[2:] + R[:-2]) / (2.0 * np.cos(step)) < R[1:-1] * (1.0 - 1e-9)).any()


def random_text(rng: np.random.Generator) -> str:
    """Homogeneous of degree 1, and as often convex as not."""

    def linear() -> str:
        a, b = rng.normal(size=2)
        return f"({a:.2f})*v1+({b:.2f})*v2"

    made = [
        lambda: f"abs({linear()})",
        lambda: f"sqrt(({linear()})**2 + ({linear()})**2 + 0.01*v1**2)",
        lambda: f"max({linear()}, {linear()}, {linear()})",
        lambda: f"min(abs({linear()}), sqrt(v1**2 + v2**2))",
        lambda: f"piecewise({linear()} > 0, sqrt(v1**2 + v2**2), sqrt(v1**2 + 1.3*v2**2))",
        lambda: f"({linear()})**2/sqrt(v1**2 + {rng.uniform(0.5, 2):.2f}*v2**2)",
        lambda: f"piecewise(v1 > 0, {rng.uniform():.2f}, {rng.uniform():.2f})*abs(v1)",
    ]
    count = int(rng.integers(1, 4))
    terms = [f"({rng.uniform(-0.4, 1.0):.2f})*{made[i]()}" for i in rng.integers(7, size=count)]
    return "+".join([*terms, f"{rng.uniform(0.0, 2.0):.2f}*sqrt(v1**2 + v2**2)"])


def is_convex(values: Array, step: float) -> bool:
    """By second differences on a circle of many directions."""
    both = (np.roll(values, 1) + np.roll(values, -1)) / (2.0 * np.cos(step))
    return bool((values <= both + 1e-12 * values.max()).all())


def test_random_formulas_are_judged_rightly() -> None:
    """What is proved is convex on 50,000 directions; of what is refused, two motions show it."""
    rng = np.random.default_rng(0)
    count = 50_000
    angles = 2.0 * np.pi * (np.arange(count) + 0.37) / count
    circle = np.array([np.cos(angles), np.sin(angles)])
    seen = {"proved": 0, "sampled": 0, "not convex": 0, "negative": 0}
    for _ in range(60):
        text = random_text(rng)
        value = evaluator([read(text)], ["v1", "v2"])
        try:
            formula = checked(text)
        except DeclarationError as error:
            if "nonnegative" in error.reason:
                assert value(circle)[0].min() < 0.0, text
                seen["negative"] += 1
                continue
            found = re.search(r"for u = \((.*)\) and w = \((.*)\)", error.reason)
            assert found, (text, str(error))
            u, w = (np.array([float(x) for x in part.split(",")]) for part in found.groups())
            assert value(u + w)[0] > (value(u)[0] + value(w)[0]) * (1.0 + 1e-9), text
            seen["not convex"] += 1
            continue
        seen["proved" if formula.proved else "sampled"] += 1
        if formula.proved:
            assert is_convex(value(circle)[0], float(angles[1] - angles[0])), text
    assert seen["proved"] >= 15
    assert seen["not convex"] >= 25
    assert seen["sampled"] <= 3


def test_derivatives() -> None:
    """⟨∇R, v⟩ = R, ∇²R v = 0, and both are derivatives."""
    formula = checked("sqrt(v1**2 + v1*v2 + 2*v2**2) + 0.3*max(v1, v2) + 0.1*v2")
    rng = np.random.default_rng(1)
    for v in rng.normal(size=(20, 2)):
        R, *rest = formula.numbers(v.tolist())
        gradient, hessian = np.array(rest[:2]), np.array(rest[2:]).reshape(2, 2)
        assert gradient @ v == pytest.approx(R, rel=1e-14)
        assert np.abs(hessian @ v).max() < 1e-14 * np.abs(hessian).max()
        h = 1e-6 * np.eye(2)
        slope = [(formula.values(v + d)[0] - formula.values(v - d)[0]) / 2e-6 for d in h]
        np.testing.assert_allclose(gradient, slope, rtol=1e-7)


def test_degrees() -> None:
    names = ("v1", "v2")
    known = {
        "v1*v2": 2.0,
        "sqrt(abs(v1)**3)/v2": 0.5,
        "exp(v1/v2)": 0.0,
        "max(v1, abs(v2))": 1.0,
        "(abs(v1)**1.7 + abs(v2)**1.7)**(1/1.7)": pytest.approx(1.0),
        "1 + v1/v2": 0.0,
    }
    for text, expected in known.items():
        assert degree(read(text), names) == expected
    for text in ("1 + v1", "v1 + v2**2", "exp(v1)", "piecewise(v1 > 1, v1, v2)"):
        assert degree(read(text), names) is None
    assert np.isnan(degree(ex.ZERO, names) or 0.0)


def test_numbers_one_at_a_time_are_those_of_arrays() -> None:
    """Roots, powers, poles, kinks, what repeats and what is undefined."""
    texts = [
        "sqrt(v1)*v2**(-1) + v1**3",
        "piecewise(v1 < v2, v1**1.5, abs(v2)**0.3)",
        "exp(v1)*log(v2) + tanh(v1/v2)",
        "floor(3*v1) + mod(v2, 0.7) + erf(v1)",
        "v2**v1 + sign(v1)",
    ]
    expressions = [read(text) for text in texts]
    one, many = (make(expressions, ["v1", "v2"]) for make in (evaluator_of_numbers, evaluator))
    places = np.random.default_rng(2).normal(size=(200, 2)) * 2.0
    places[::7, 0] = 0.0
    places[::11, 1] = 0.0
    for v in places:
        np.testing.assert_allclose(one(v.tolist()), many(v), rtol=1e-13, atol=0.0)
