"""Certificates: does a motion obey the law it is meant to solve?

All numbers are computed from the stored knots alone, by a method that did not produce them
(:mod:`stickslip.motion.between.step_balance`):

* *energy balance (E)*: E(t) + dissipated = E(0) + supplied, at every knot, relative to the energy that flows;
* *stability (S)*, force form: |λ| ≤ s always, λ = −σk and σu ≥ 0 in slip, u = 0 in stick, and every region on its side
  of its kink, each relative to the largest force and relative velocity of its contact;
* *defect*: by how much the equations of motion fail over a step, relative to the size of each component; where motion
  is stiff, in the time that a Taylor step would take.

The last two are bounds for all times, not for those that were looked at: what could not be enclosed is named.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

MOST_SPANS = 8  # not verified, that are named


@dataclass(frozen=True)
class Certificate:
    """What was measured of a result, and the verdict.

    Attributes
    ----------
    energy_residual : float
        Largest violation of the energy balance, relative to the energy that flows.
    stability_violation : float
        Bound of the violation of the friction law, relative to the largest force and velocity of each contact.
    defect : float
        Bound of the violation of the equations of motion over one step, relative to the size of each component.
    audit_error : float
        Rounding errors of the audit itself, in the same units as the defect.
    tolerance : float
        Each of these must stay below it.
    unverified : tuple of (float, float)
        Times between which the law could not be enclosed; the numbers above hold there at the times looked at only.
    outcome : str
        How the motion ended, if it was refused.
    """

    energy_residual: float
    stability_violation: float
    defect: float
    audit_error: float
    tolerance: float
    unverified: tuple[tuple[float, float], ...] = ()
    outcome: str = ""

    @property
    def ok(self) -> bool:
        """Whether the result is certified: it was computed to its end, and obeys its law."""
        return not self.outcome and self.lawful

    @property
    def lawful(self) -> bool:
        """Whether what was computed obeys the law, however it ended."""
        return not self.unverified and all(v <= self.tolerance for v in self._residuals.values())

    @property
    def _residuals(self) -> dict[str, float]:
        return {
            "energy balance": self.energy_residual,
            "friction law": self.stability_violation,
            "equations of motion": self.defect,
            "rounding errors of the audit": self.audit_error,
        }

    @property
    def verdict(self) -> str:
        """The verdict in words."""
        if self.ok:
            return f"certified: all residuals below {self.tolerance:.0e}"
        bad = [f"{name} {value:.2e}" for name, value in self._residuals.items() if not value <= self.tolerance]
        until = ", and obeys the law until then" if self.lawful else ""
        reasons = [f"the motion ended with '{self.outcome}'{until}"] if self.outcome else []
        reasons += [f"{', '.join(bad)} above {self.tolerance:.0e}"] if bad else []
        reasons += [f"not verified {self._spans}"] if self.unverified else []
        return f"not certified: {'; '.join(reasons)}"

    @property
    def _spans(self) -> str:
        shown = [f"between t = {a:.9g} and {b:.9g}" for a, b in self.unverified[:MOST_SPANS]]
        more = len(self.unverified) - len(shown)
        return ", ".join(shown) + (f" and in {more} more spans" if more else "")

    def to_dict(self) -> dict[str, float | bool | str | list]:
        """Numbers and verdict."""
        spans = [list(span) for span in self.unverified]
        return {**asdict(self), "unverified": spans, "ok": self.ok, "verdict": self.verdict}


def certify(trajectory: Trajectory) -> Certificate:
    """Measure a trajectory against energy balance, friction law and equations of motion."""
    audit = trajectory.audit
    tolerance = max(1e-9, 10.0 * trajectory.rtol)
    energy, friction, defect, own = (float(v) if np.isfinite(v) else np.inf for v in audit.residuals)
    outcome = "" if trajectory.outcome.ok else trajectory.outcome.label
    return Certificate(energy, friction, defect, own, tolerance, _unverified(trajectory), outcome)


def _unverified(trajectory: Trajectory) -> tuple[tuple[float, float], ...]:
    """Spans of the steps that could not be enclosed to their end, joined where they touch."""
    time, left = trajectory.knots.time, trajectory.audit.open
    spans: list[tuple[float, float]] = []
    for i in np.flatnonzero(left > 0.0):
        begin, end = float(time[i + 1] - left[i]), float(time[i + 1])
        if spans and begin <= spans[-1][1]:
            spans[-1] = spans[-1][0], end
        else:
            spans.append((begin, end))
    return tuple(spans)
