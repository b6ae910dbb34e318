"""A claim of the paper: a statement with its place, a check, and the expected verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from inspect import cleandoc

import numpy as np


class Verdict(Enum):
    """Possible results of a check."""

    HOLDS = "holds"
    CORRECTED = "holds as corrected"
    ASYMPTOTIC = "holds asymptotically"
    FAILS = "fails"


@dataclass(frozen=True)
class Finding:
    """Result of a check.

    Attributes
    ----------
    measured : str
        The measured number and the reference value.
    numbers : mapping of str to float
        The same as data.
    """

    verdict: Verdict
    measured: str
    numbers: Mapping[str, float] = field(default_factory=dict)


Check = Callable[[], Finding]


@dataclass(frozen=True)
class Claim:
    """A statement of the paper.

    Attributes
    ----------
    place : str
        Place in the paper: ``"(3.6)"``, ``"theorem 3.1"``, ``"section 4.3"``.
    name : str
        A short unique name.
    statement, formula : str
        In words, and as in the paper.
    how : str
        Description of the check.
    check : callable
        The check; returns a Finding.
    correction, derivation : str
        Correction of the published form, if it is wrong, and its derivation.
    """

    place: str
    name: str
    statement: str
    formula: str
    how: str
    check: Check
    expected: Verdict
    correction: str = ""
    derivation: str = ""

    def verify(self) -> Finding:
        """Run the check; an error counts as a failure."""
        try:
            return self.check()
        except Exception as error:  # any error in a computation is a failure of the claim
            return Finding(Verdict.FAILS, f"the check stopped: {type(error).__name__}: {error}")


def claim(
    place: str,
    formula: str,
    how: str,
    expected: Verdict = Verdict.HOLDS,
    *,
    correction: str = "",
    derivation: str = "",
) -> Callable[[Check], Claim]:
    """Declare a claim: the function is its check, the docstring its statement, the name its
    name."""

    def declare(check: Check) -> Claim:
        statement = " ".join(cleandoc(check.__doc__ or "").split())
        return Claim(
            place, check.__name__, statement, formula, how, check, expected, correction, derivation
        )

    return declare


# -- judgements ------------------------------------------------------------------------------------


def maximum(*values: float) -> float:
    """The largest of some numbers; NaN if one of them is NaN (which ``max`` may lose)."""
    return math.nan if any(map(math.isnan, values)) else float(max(values))


def minimum(*values: float) -> float:
    """The smallest of some numbers; NaN if one of them is NaN."""
    return -maximum(*(-value for value in values))


def vanishes(error: float, tolerance: float, what: str = "largest difference") -> Finding:
    """Return whether an error is within its tolerance."""
    verdict = Verdict.HOLDS if abs(error) <= tolerance else Verdict.FAILS
    return Finding(
        verdict, f"{what} {abs(error):.1e} (tolerance {tolerance:.0e})", {"error": float(error)}
    )


def equals(value: float, expected: float, tolerance: float, what: str) -> Finding:
    """Return whether a number is the expected one."""
    verdict = Verdict.HOLDS if abs(value - expected) <= tolerance else Verdict.FAILS
    text = f"{what} {value:.10g}, expected {expected:.10g} ± {tolerance:.0e}"
    return Finding(verdict, text, {"value": float(value), "expected": float(expected)})


def shows(condition: bool, measured: str, **numbers: float) -> Finding:
    """Return whether the numbers show a qualitative statement."""
    return Finding(
        Verdict.HOLDS if condition else Verdict.FAILS,
        measured,
        {k: float(v) for k, v in numbers.items()},
    )


def corrects(printed: float, corrected: float, tolerance: float, what: str = "error") -> Finding:
    """Compare the errors of the printed and of the corrected form: the first must exceed the
    tolerance a lot."""
    text = (
        f"{what}: printed {abs(printed):.2g}, corrected {abs(corrected):.1e} "
        f"(tolerance {tolerance:.0e})"
    )
    if not abs(corrected) <= tolerance or math.isnan(printed):
        verdict = Verdict.FAILS
    else:
        verdict = Verdict.CORRECTED if abs(printed) > 100 * tolerance else Verdict.HOLDS
    return Finding(verdict, text, {"printed": float(printed), "corrected": float(corrected)})


def fitted_power(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """p and c of the least-squares fit log y = p log x + log c; NaN if fewer than two y are
    positive."""
    positive = y > 0.0
    if np.count_nonzero(positive) < 2:
        return math.nan, math.nan
    power, offset = np.polyfit(np.log(x[positive]), np.log(y[positive]), 1)
    return float(power), float(np.exp(offset))


def scales(
    x: list[float], y: list[float], exponent: float, within: float, what: str, symbol: str
) -> Finding:
    """Return whether y ~ x^exponent, by a fit over the given range."""
    power, _ = fitted_power(np.asarray(x, dtype=float), np.abs(np.asarray(y, dtype=float)))
    verdict = Verdict.ASYMPTOTIC if abs(power - exponent) <= within else Verdict.FAILS
    values = ", ".join(f"{v:.2g}" for v in y)
    span = f"{symbol} = {x[0]:.0e} … {x[-1]:.0e}"
    text = f"{what} ~ {symbol}^{power:.3f}, expected {exponent:g} ± {within:g} ({values} at {span})"
    return Finding(verdict, text, {"exponent": power})


def together(*findings: Finding) -> Finding:
    """Several findings about one claim: it fails if one of them does."""
    verdicts = [f.verdict for f in findings]
    verdict = next(
        (v for v in (Verdict.FAILS, Verdict.CORRECTED, Verdict.ASYMPTOTIC) if v in verdicts),
        Verdict.HOLDS,
    )
    numbers = {f"{k}_{i}": v for i, f in enumerate(findings, 1) for k, v in f.numbers.items()}
    return Finding(verdict, "; ".join(f.measured for f in findings), numbers)
