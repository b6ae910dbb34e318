"""Certificates as data: named residuals with their limits, and one verdict.

What is measured differs from kind to kind of result, how it is judged and shown does not: a result
is certified if its computation ended as it should, every residual is within its limit, and nothing
was left unverified. A residual that is not a number is never within.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from stickslip import page

_MOST_SPANS = 8  # largest number of spans that are named if they are not verified


@dataclass(frozen=True)
class Residual:
    """A measured error of a result, with its limit.

    Attributes
    ----------
    name : str
        What is measured, such as ``"closure"``.
    value : float
    limit : float
        Infinite if the value is reported without a limit.
    least : bool
        Whether the value has to stay above the limit; otherwise below.
    note : str
        What the value is relative to, or what the measurement does not cover.
    """

    name: str
    value: float
    limit: float = math.inf
    least: bool = False
    note: str = ""

    @property
    def judged(self) -> bool:
        """Whether there is a limit."""
        return math.isfinite(self.limit)

    @property
    def ok(self) -> bool:
        """Whether it is within its limit."""
        return bool(self.value >= self.limit if self.least else self.value <= self.limit)

    @property
    def counts(self) -> bool:
        """Whether the value is a count that should be zero."""
        return self.limit == 0.0 and not self.least

    @property
    def fault(self) -> str:
        """Description of the violation, if it is not within its limit."""
        if self.counts:
            return f"{self.name}: {self.value:g}"
        return f"{self.name} {self.value:.2e} {'below' if self.least else 'above'} {self.limit:.0e}"

    def describe(self) -> str:
        """One line: name, value and limit."""
        bound = (
            f" ({'at least' if self.least else 'at most'} {self.limit:.0e})" if self.judged else ""
        )
        return f"{self.name} {self.value:.1e}{bound}" + (f", {self.note}" if self.note else "")


@dataclass(frozen=True)
class Certificate:
    """Residuals of a result, with the verdict.

    Attributes
    ----------
    residuals : tuple of Residual
    outcome : str
        How the computation ended, if it was not completed.
    unverified : tuple of (float, float)
        Time intervals in which the law could not be bounded; there, the residuals refer only to
        sampled times.
    notes : tuple of str
        Further remarks, such as the sampling density or an error bound.
    """

    residuals: tuple[Residual, ...]
    outcome: str = ""
    unverified: tuple[tuple[float, float], ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether the result is certified."""
        return self.lawful and not self.outcome

    @property
    def lawful(self) -> bool:
        """Whether the computed part obeys the law, regardless of how the computation ended."""
        return not self.unverified and all(residual.ok for residual in self.residuals)

    @property
    def verdict(self) -> str:
        """The verdict: the residuals that exceed their limits, or the common limit and the
        notes."""
        if self.ok:
            return "; ".join([f"certified: {self._limits}", *self.notes])
        until = " (the law is satisfied up to there)" if self.lawful else ""
        reasons = [f"ended with '{self.outcome}'{until}"] if self.outcome else []
        reasons += [residual.fault for residual in self.residuals if not residual.ok]
        reasons += [f"not verified {self._spans}"] if self.unverified else []
        return f"not certified: {'; '.join(reasons)}"

    @property
    def _limits(self) -> str:
        judged = [residual for residual in self.residuals if residual.judged]
        if all(residual.counts for residual in judged):
            return ", ".join(f"{residual.name}: none" for residual in judged)
        limits = {residual.limit for residual in judged}
        if len(limits) == 1 and not any(residual.least for residual in judged):
            return f"all residuals below {limits.pop():.0e}"
        return f"all {len(judged)} residuals within their limits"

    @property
    def _spans(self) -> str:
        shown = [f"between t = {a:.9g} and {b:.9g}" for a, b in self.unverified[:_MOST_SPANS]]
        more = len(self.unverified) - len(shown)
        return ", ".join(shown) + (f" and in {more} more spans" if more else "")

    def __getitem__(self, name: str) -> Residual:
        """The residual of a name.

        Raises
        ------
        KeyError
            If nothing of that name was measured.
        """
        for residual in self.residuals:
            if residual.name == name:
                return residual
        raise KeyError(
            f"no residual '{name}'; available: {', '.join(r.name for r in self.residuals)}"
        )

    def _ipython_key_completions_(self) -> list[str]:
        return [residual.name for residual in self.residuals]

    def _repr_html_(self) -> str:
        rows = [
            (
                residual.name,
                f"{residual.value:.1e}",
                f"{'≥' if residual.least else '≤'} {residual.limit:.0e}" if residual.judged else "",
                residual.note,
                "" if residual.ok else "✗",
            )
            for residual in self.residuals
        ]
        headings = ("residual", "value", "limit", "note", "")
        return page.whole(page.paragraph(self.verdict), page.tabled(rows, headings))

    def describe(self) -> str:
        """The verdict, and one line for each residual."""
        return "\n".join(
            [self.verdict, *(f"  {residual.describe()}" for residual in self.residuals)]
        )

    def to_dict(self) -> dict[str, Any]:
        """Numbers and verdict as plain data."""
        rows = [
            {"name": r.name, "value": float(r.value), "limit": r.limit if r.judged else None}
            | {"least": r.least, "note": r.note, "ok": r.ok}
            for r in self.residuals
        ]
        spans = [list(span) for span in self.unverified]
        verdict = {"ok": self.ok, "verdict": self.verdict}
        return {
            **verdict,
            "residuals": rows,
            "outcome": self.outcome,
            "unverified": spans,
            "notes": list(self.notes),
        }


NOTHING = Certificate((), "nothing found")


def within(limit: float, values: Iterable[tuple[str, float]]) -> list[Residual]:
    """Residuals that share a limit."""
    return [Residual(name, value, limit) for name, value in values]


def worst(certificates: Sequence[Certificate]) -> Certificate:
    """The certificate of many results of one kind: the worst value of every residual, and all
    outcomes and gaps."""
    names = dict.fromkeys(r.name for c in certificates for r in c.residuals)
    chosen = []
    for name in names:
        found = [r for c in certificates for r in c.residuals if r.name == name]
        chosen.append(max(found, key=_strain))
    outcome = next((c.outcome for c in certificates if c.outcome), "")
    notes = dict.fromkeys(note for c in certificates for note in c.notes)
    return Certificate(
        tuple(chosen),
        outcome,
        tuple(span for c in certificates for span in c.unverified),
        tuple(notes),
    )


def _strain(residual: Residual) -> float:
    """The residual as a fraction of its limit; infinite for NaN."""
    value = residual.limit - residual.value if residual.least else residual.value - residual.limit
    return value if value == value else float("inf")
