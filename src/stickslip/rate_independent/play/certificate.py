"""What is measured of a play, and the verdict."""

from __future__ import annotations

from dataclasses import asdict, dataclass


@dataclass(frozen=True)
class PlayCertificate:
    """What was measured of a play, and the verdict.

    Attributes
    ----------
    energy_residual : float
        (E): largest violation of the energy balance at any time, relative to the energy that flows.
    stability_violation : float
        (S) in the form of forces: how far ℓ − a z leaves its interval, or a bound that it follows, relative to the
        largest force.
    defect : float
        Largest difference between an increment of z and the integral of its rate, relative to z.
    samples : int
        Most times (or phases) at which a function of Python was looked at; 0 if load and thresholds are known
        everywhere, since they are formulas or samples.
    tolerance : float
        Each of the three must stay below it: 1e-9, or what the rounding of times alone makes of load and thresholds
        where these are steep, if that is more.
    """

    energy_residual: float
    stability_violation: float
    defect: float
    samples: int
    tolerance: float

    @property
    def _residuals(self) -> dict[str, float]:
        return {
            "energy balance": self.energy_residual,
            "friction law": self.stability_violation,
            "rates": self.defect,
        }

    @property
    def ok(self) -> bool:
        """Whether the motion is certified."""
        return all(value <= self.tolerance for value in self._residuals.values())

    @property
    def coverage(self) -> str:
        """What is known between the places that were looked at, in words."""
        return f"as sampled at {self.samples} points" if self.samples else "load and thresholds bounded everywhere"

    @property
    def verdict(self) -> str:
        """The verdict in words."""
        if self.ok:
            return f"certified: all residuals below {self.tolerance:.1g}, {self.coverage}"
        bad = [f"{name} {value:.2e}" for name, value in self._residuals.items() if not value <= self.tolerance]
        return f"not certified: {', '.join(bad)} above {self.tolerance:.1g}"

    def to_dict(self) -> dict[str, float | bool | str]:
        """Numbers and verdict."""
        return {**asdict(self), "ok": self.ok, "verdict": self.verdict}
