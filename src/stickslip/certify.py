"""Certificates: does a result obey the law it is meant to solve?

All three numbers are computed from the stored knots alone, with a quadrature that the integration did not use:

* *energy balance (E)*: E(t) + dissipated = E(0) + supplied, at every knot, relative to the energy that flows;
* *stability (S)*, force form: |λ| ≤ s always, λ = −σk and σu ≥ 0 in slip, u = 0 in stick, relative to the largest force
  and relative velocity, and every region on its side of its kink;
* *defect*: y(t_{k+1}) − y(t_k) − ∫ẏ dt over every step, relative to the size of each component.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory


@dataclass(frozen=True)
class Certificate:
    """What was measured of a result, and the verdict.

    Attributes
    ----------
    energy_residual : float
        Largest violation of the energy balance, relative to the energy scale.
    stability_violation : float
        Largest violation of the friction law, relative to the largest force and velocity.
    defect : float
        Largest violation of the equations of motion over one step, relative to the state.
    tolerance : float
        Each of the three must stay below it.
    energy_scale : float
        Energy that the residual is relative to (0: the system has no energy to balance).
    """

    energy_residual: float
    stability_violation: float
    defect: float
    tolerance: float
    energy_scale: float

    @property
    def ok(self) -> bool:
        """Whether the result is certified."""
        return all(v <= self.tolerance for v in (self.energy_residual, self.stability_violation, self.defect))

    @property
    def verdict(self) -> str:
        """The verdict in words."""
        if self.ok:
            return f"certified: all residuals below {self.tolerance:.0e}"
        bad = [
            f"{name} {value:.2e}"
            for name, value in (
                ("energy balance", self.energy_residual),
                ("friction law", self.stability_violation),
                ("equations of motion", self.defect),
            )
            if not value <= self.tolerance
        ]
        return f"not certified: {', '.join(bad)} above {self.tolerance:.0e}"

    def to_dict(self) -> dict[str, float | bool | str]:
        """Numbers and verdict."""
        return {**asdict(self), "ok": self.ok, "verdict": self.verdict}


def certify(trajectory: Trajectory) -> Certificate:
    """Measure a trajectory against energy balance, friction law and equations of motion.

    Returns
    -------
    Certificate
    """
    audit = trajectory.audit
    knots = trajectory.knots
    energy = audit.energy
    balance = energy - energy[0] + audit.dissipated - audit.supplied
    flow = max(np.ptp(energy), audit.dissipated[-1], audit.supplied_modulus, np.max(audit.kinetic, initial=0.0))
    excess, off, creep, back, force, speed, held = audit.worst[:7]
    # The energy itself is known to rounding only: where next to nothing flows, that is the scale, or the work of the
    # largest force over the least distance that counts.
    least = trajectory.atol
    scale = float(max(flow, 1e-6 * np.max(np.abs(energy)), least * max(least, force)))
    excess_work = np.max(np.abs(balance)) - force * np.sum(audit.noise)
    residual = float(np.maximum(excess_work, 0.0)) / scale if scale > 0.0 else 0.0
    # In stick, velocities are what is left of forces that cancel, and are known to the rounding of that.
    at_rest = 1e-4 * held
    speed = max(speed, at_rest)
    beyond, reach = audit.worst[8::2], audit.worst[9::2]
    side = float(np.max(beyond / np.where(reach > 0.0, reach, 1.0), initial=0.0))
    violation = max(
        (max(excess, off) / force if force > 0.0 else 0.0), (max(creep, back) / speed if speed > 0.0 else 0.0), side
    )
    steps = len(knots.time) - 1
    gap = np.maximum(np.abs(np.diff(knots.state, axis=0) - audit.change[:steps]) - audit.noise[:steps], 0.0)
    size = np.maximum(np.max(np.abs(knots.state), axis=0, initial=least), audit.largest)
    masses = len(trajectory.system.declaration.inertial)
    size[masses : 2 * masses] = np.maximum(size[masses : 2 * masses], at_rest)
    defect = float(np.max(gap / size, initial=0.0))
    tolerance = max(1e-9, 10.0 * trajectory.rtol)
    values = [float(v) if np.isfinite(v) else np.inf for v in (residual, violation, defect)]
    return Certificate(values[0], values[1], values[2], tolerance, scale)
