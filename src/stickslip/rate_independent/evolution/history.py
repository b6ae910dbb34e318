"""The result of an evolution: data, certificate, file and picture."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.rate_independent.evolution.outcome import EvolutionOutcome

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

Array = np.ndarray
KIND, FORMAT = "evolution", 1  # of the stored file
PHASE_STEP = 0.25  # longest step that still sees the oscillation, in periods


@dataclass(frozen=True)
class EvolutionCertificate:
    """What was measured of an evolution, and the verdict. The formulas stand in ``rate_independent/audit.py``.

    Attributes
    ----------
    stability : float
        (S): largest distance of ℓ − Az from K over all steps, relative to the largest weight.
    residual : float
        Largest KKT residual of a step, relative to the largest weight.
    energy_residual : float
        (E): largest violation of the energy balance at any time, relative to the energy that flows.
    overshoot : float
        (S) between the steps: how far ℓ − Az may leave K, relative to the largest weight.
    below, above : float
        Two-sided estimate of the steps: with the one-sided sums of dissipation and work the balance lies between
        −below and above, relative to the energy that flows.
    phase_step : float
        Longest step in periods; 0 if the dissipation does not depend on the phase.
    error_estimate : float
        √(2 Σ(|defect| + slack)): error of z in the energy norm; a bound if nothing overshoots.
    samples : int
        Times at which load and thresholds were looked at; 0 if they are bounded between the steps, since they are made
        of formulas and tables.
    energy_scale : float
        Energy that flows: the largest of the swing of the energy, the dissipated energy and the work of the load.
    tolerance : float
        Of `energy_residual` and `overshoot`.
    kkt : float
        Tolerance of `stability` and `residual`.
    """

    stability: float
    residual: float
    energy_residual: float
    overshoot: float
    below: float
    above: float
    phase_step: float
    error_estimate: float
    samples: int
    energy_scale: float
    tolerance: float
    kkt: float

    def _limits(self) -> list[tuple[str, float, float]]:
        return [
            ("stability", self.stability, self.kkt),
            ("KKT residual", self.residual, self.kkt),
            ("energy balance", self.energy_residual, self.tolerance),
            ("stability between steps", self.overshoot, self.tolerance),
            ("length of a step in periods", self.phase_step, PHASE_STEP),
        ]

    @property
    def ok(self) -> bool:
        """Whether the evolution is certified."""
        return all(value <= limit for _, value, limit in self._limits())

    @property
    def coverage(self) -> str:
        """What is known between the steps, in words."""
        return (
            f"as sampled at {self.samples} times" if self.samples else "load and thresholds bounded between the steps"
        )

    @property
    def verdict(self) -> str:
        """The verdict in words."""
        bad = [f"{name} {value:.2e} above {limit:.0e}" for name, value, limit in self._limits() if not value <= limit]
        if bad:
            return f"not certified: {', '.join(bad)}"
        error = f"error of z about {self.error_estimate:.1e} in the energy norm"
        return f"certified: (S) within {self.kkt:.0e}, (E) within {self.tolerance:.0e}, {self.coverage}; {error}"

    def to_dict(self) -> dict[str, float | bool | str]:
        """Numbers and verdict."""
        return {**asdict(self), "ok": self.ok, "verdict": self.verdict}


@dataclass(frozen=True, eq=False, repr=False)
class History:
    """A computed evolution.

    Attributes
    ----------
    dataset : xarray.Dataset
        ``z`` over (time, component) at the output times; over ``step``: ``step_time``, energy, dissipated, work and the
        other columns of every step, and the observables; ``final_state``, the last state.
    outcome : EvolutionOutcome
    detail : str
        What exactly stopped it, if it did not reach the end.
    tolerance, kkt : float
        What the certificate compares with.
    wall_time : float
        Seconds.
    """

    dataset: xarray.Dataset
    outcome: EvolutionOutcome
    detail: str
    tolerance: float
    kkt: float
    wall_time: float

    def __repr__(self) -> str:
        times = self.dataset["step_time"].values
        return (
            f"<History of {self.dataset.sizes['component']} components: t = {times[0]:g} ... {times[-1]:g}, "
            f"{len(times) - 1} steps, {self.outcome.label}>"
        )

    @property
    def times(self) -> Array:
        """Output times, shape (m,)."""
        return self.dataset["time"].values

    @property
    def z(self) -> Array:
        """States at the output times, shape (m, n)."""
        return self.dataset["z"].values

    @property
    def final(self) -> Array:
        """The last state, shape (n,)."""
        return self.dataset["final_state"].values

    @property
    def steps(self) -> int:
        """Number of steps."""
        return self.dataset.sizes["step"] - 1

    @property
    def message(self) -> str:
        """How it ended, in words."""
        if self.outcome.ok:
            return self.outcome.message
        reason = f" ({self.detail})" if self.detail else ""
        end = float(self.dataset["step_time"][-1])
        return f"{self.outcome.label} after t = {end:.9g}{reason}: {self.outcome.message}"

    @cached_property
    def certificate(self) -> EvolutionCertificate:
        """Stability (S) and energy balance (E) of the whole evolution, measured."""
        column = {name: self.dataset[name].values for name in self.dataset if self.dataset[name].dims == ("step",)}
        balance = column["energy"] - column["energy"][0] + column["dissipated"] - column["work"]
        flows = np.ptp(column["energy"]), column["dissipated"][-1], np.abs(column["work"]).max()
        scale = max(*flows, self.dataset.attrs["least_energy"])
        # Where next to nothing flows, the energy itself is known to rounding only.
        scale = float(max(scale, 1e-6 * np.abs(column["energy"]).max()))
        relative = 1.0 / scale if scale > 0.0 else 0.0
        below = float(np.sum(column["increment"]))
        periods = self.dataset.attrs["epsilon"] if self.dataset.attrs["depends_on_phase"] else np.inf
        return EvolutionCertificate(
            stability=float(column["distance"].max()),
            residual=float(column["residual"].max()),
            energy_residual=float(np.abs(balance).max()) * relative,
            overshoot=float(column["overshoot"].max()),
            below=below * relative,
            above=(below + float(np.sum(column["gap"]))) * relative,
            phase_step=float(np.diff(self.dataset["step_time"].values).max(initial=0.0)) / periods,
            error_estimate=float(np.sqrt(2.0 * np.sum(np.abs(column["defect"]) + column["slack"]))),
            samples=0 if self.dataset.attrs["bounded"] else 2 * self.steps + 1,
            energy_scale=scale,
            tolerance=self.tolerance,
            kkt=self.kkt,
        )

    def plot(self) -> Figure:
        """Components over time with stick phases shaded, and the energies."""
        from stickslip.figures.evolution import plot_history

        return plot_history(self)

    def save(self, path: str | Path) -> None:
        """Write a netCDF-4 file that :func:`open_history` reads back exactly.

        Raises
        ------
        StickslipError
            If the file cannot be written; an existing file is replaced only by a complete one.
        """
        from stickslip import storage

        settings = {
            "outcome": self.outcome.code,
            "detail": self.detail,
            "tolerance": self.tolerance,
            "kkt": self.kkt,
            "wall_time": self.wall_time,
        }
        storage.write(path, self.dataset, KIND, FORMAT, settings=settings)


def open_history(path: str | Path) -> History:
    """Read a stored evolution.

    Raises
    ------
    StickslipError
        If the file does not exist or is not a stored evolution.
    """
    from stickslip import storage

    with storage.reading(path, KIND, FORMAT) as (data, own):
        settings: dict[str, Any] = json.loads(own["settings"])
        return History(data, EvolutionOutcome.from_code(settings.pop("outcome")), **settings)
