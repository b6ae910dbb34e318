"""Certificates as data: named residuals with their limits, and one verdict.

What is measured differs from kind to kind of result, how it is judged and shown does not: a result is certified if
every residual is within its limit. A residual that is no number is never within.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Residual:
    """A number that tells whether a result is right.

    Attributes
    ----------
    name : str
        What is measured, such as ``"closure"``.
    value : float
    limit : float
    least : bool
        Whether the value has to stay above the limit; otherwise below.
    note : str
        What the number is relative to, or what it could not see.
    """

    name: str
    value: float
    limit: float
    least: bool = False
    note: str = ""

    @property
    def ok(self) -> bool:
        """Whether it is within its limit."""
        return bool(self.value >= self.limit if self.least else self.value <= self.limit)

    def describe(self) -> str:
        """One line: name, value and limit."""
        bound = "at least" if self.least else "at most"
        return f"{self.name} {self.value:.1e} ({bound} {self.limit:.0e})" + (f", {self.note}" if self.note else "")


@dataclass(frozen=True)
class Certificate:
    """All that was measured of a result.

    Attributes
    ----------
    residuals : tuple of Residual
    """

    residuals: tuple[Residual, ...]

    @property
    def ok(self) -> bool:
        """Whether the result is certified."""
        return all(residual.ok for residual in self.residuals)

    @property
    def verdict(self) -> str:
        """The verdict in words, with the residuals that are not within their limits."""
        bad = [residual.describe() for residual in self.residuals if not residual.ok]
        return f"not certified: {'; '.join(bad)}" if bad else f"certified: {len(self.residuals)} residuals in limits"

    def __getitem__(self, name: str) -> Residual:
        """The residual of a name."""
        return next(residual for residual in self.residuals if residual.name == name)

    def describe(self) -> str:
        """The verdict, and every residual on a line of its own."""
        return "\n".join([self.verdict, *(f"  {residual.describe()}" for residual in self.residuals)])

    def to_dict(self) -> dict[str, Any]:
        """Numbers and verdict as plain data."""
        rows = [
            {"name": r.name, "value": float(r.value), "limit": r.limit, "least": r.least, "note": r.note, "ok": r.ok}
            for r in self.residuals
        ]
        return {"ok": self.ok, "verdict": self.verdict, "residuals": rows}


def worst(certificates: Sequence[Certificate]) -> Certificate:
    """Of many results of one kind: every residual where it is worst."""
    names = dict.fromkeys(r.name for c in certificates for r in c.residuals)
    chosen = []
    for name in names:
        found = [r for c in certificates for r in c.residuals if r.name == name]
        chosen.append(max(found, key=_strain))
    return Certificate(tuple(chosen))


def _strain(residual: Residual) -> float:
    """How near a residual is to its limit; infinite for what is no number."""
    value = residual.limit - residual.value if residual.least else residual.value - residual.limit
    return value if value == value else float("inf")
