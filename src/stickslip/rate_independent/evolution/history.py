"""The result of an evolution: data, certificate, file and figure."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from stickslip.arrays import Array
from stickslip.certificates import Certificate, Residual
from stickslip.kept import cached_property
from stickslip.numerics.levels import ENERGY_SCALE
from stickslip.rate_independent.evolution.outcome import EvolutionOutcome
from stickslip.results import Result, listed

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PHASE_STEP = 0.25  # longest step that resolves the oscillation, in periods


@dataclass(frozen=True, eq=False, repr=False)
class History(Result):
    """A computed evolution.

    Attributes
    ----------
    dataset : xarray.Dataset
        ``z`` over (time, component) at the output times; over ``step``: ``step_time``, energy,
        dissipated, work and the other columns of every step, and the observables; ``final_state``,
        the last state.
    outcome : EvolutionOutcome
    detail : str
        The reason, if the evolution did not reach its end.
    tolerance, kkt : float
        Tolerances of the certificate.
    wall_time : float
        Seconds.
    """

    KIND: ClassVar[str] = "evolution"
    FORMAT: ClassVar[int] = 2

    dataset: xarray.Dataset
    outcome: EvolutionOutcome
    detail: str
    tolerance: float
    kkt: float
    wall_time: float

    def __repr__(self) -> str:
        times = self.dataset["step_time"].values
        return (
            f"<History of {self.dataset.sizes['component']} components: t = {times[0]:g} ... "
            f"{times[-1]:g}, "
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
        """Description of the outcome."""
        if self.outcome.ok:
            return self.outcome.message
        reason = f" ({self.detail})" if self.detail else ""
        end = float(self.dataset["step_time"][-1])
        return f"{self.outcome.label} after t = {end:.9g}{reason}: {self.outcome.message}"

    @cached_property
    def energy_scale(self) -> float:
        """Energy transferred: the largest of the range of the energy, the dissipated energy and the
        work of the load."""
        energy, dissipated, work = (
            self.dataset[name].values for name in ("energy", "dissipated", "work")
        )
        scale = max(
            np.ptp(energy), dissipated[-1], np.abs(work).max(), self.dataset.attrs["least_energy"]
        )
        # If hardly any energy is transferred, the energy is only accurate to rounding.
        return float(max(scale, ENERGY_SCALE * np.abs(energy).max()))

    @cached_property
    def certificate(self) -> Certificate:
        """Residuals of the evolution, and the verdict. ``evolution/audit.py`` contains the
        formulas.

        The residuals are

        - *stability*: (S), largest distance of ℓ − Az from K over all steps, relative to the
          largest weight;
        - *KKT residual* of a step, relative to the largest weight;
        - *energy balance*: (E), largest violation at any time, relative to the energy transferred;
        - *stability between steps*: how far ℓ − Az may leave K there, relative to the largest
          weight;
        - *length of a step in periods*: 0 if the dissipation does not depend on the phase;

        and, reported without a limit,

        - *energy balance from below*, *from above*: one-sided sums of dissipation and work, which
          bound the energy balance from both sides, relative to the energy transferred;
        - *error of z*: √(2 Σ(|defect| + slack)) plus the largest missed displacement, in the energy
          norm; a rigorous bound if the force never leaves K between steps;
        - *samples*: number of times at which load and thresholds were evaluated; 0 if they are
          bounded between the steps, because they consist of formulas and tables.
        """
        column = {
            name: self.dataset[name].values
            for name in self.dataset
            if self.dataset[name].dims == ("step",)
        }
        balance = column["energy"] - column["energy"][0] + column["dissipated"] - column["work"]
        relative = 1.0 / self.energy_scale if self.energy_scale > 0.0 else 0.0
        below = float(np.sum(column["increment"]))
        periods = (
            self.dataset.attrs["epsilon"] if self.dataset.attrs["depends_on_phase"] else np.inf
        )
        longest = float(np.diff(self.dataset["step_time"].values).max(initial=0.0)) / periods
        error = float(np.sqrt(2.0 * np.sum(np.abs(column["defect"]) + column["slack"])))
        error += float(column["missed"].max())
        samples = 0 if self.dataset.attrs["bounded"] else 2 * self.steps + 1
        looked = (
            f"as sampled at {samples} times"
            if samples
            else "load and thresholds bounded between the steps"
        )
        residuals = (
            Residual("stability", float(column["distance"].max()), self.kkt),
            Residual("KKT residual", float(column["residual"].max()), self.kkt),
            Residual("energy balance", float(np.abs(balance).max()) * relative, self.tolerance),
            Residual("stability between steps", float(column["overshoot"].max()), self.tolerance),
            Residual("length of a step in periods", longest, _PHASE_STEP),
            Residual("energy balance from below", below * relative),
            Residual(
                "energy balance from above", (below + float(np.sum(column["gap"]))) * relative
            ),
            Residual("error of z", error, note="in the energy norm"),
            Residual("samples", float(samples)),
        )
        outcome = "" if self.outcome.ok else self.outcome.label
        doubt = str(self.dataset.attrs.get("doubt", ""))
        notes = (
            looked,
            *([doubt] if doubt else []),
            f"error of z about {error:.1e} in the energy norm",
            *self.warnings,
        )
        return Certificate(residuals, outcome, notes=notes)

    @property
    def warnings(self) -> list[str]:
        """Parts of the load that the evolution omits."""
        said = self.dataset.attrs.get("left_out")
        return [str(said)] if said else []

    # -- description and summary -------------------------------------------------------------------

    @property
    def title(self) -> str:
        """Title of the evolution."""
        return str(self.dataset.attrs.get("title") or "rate-independent evolution")

    @property
    def parameters(self) -> dict[str, float]:
        """The period of the oscillation, if the dissipation depends on its phase."""
        attrs = self.dataset.attrs
        return {"epsilon": float(attrs["epsilon"])} if attrs["depends_on_phase"] else {}

    def facts(self) -> dict[str, Any]:
        """Summary as plain data."""
        times = self.dataset["step_time"].values
        return {
            "method": "minimising movements",
            "end": float(times[-1]),
            "steps": self.steps,
            "final": self.final.tolist(),
            "dissipated": float(self.dataset["dissipated"][-1]),
            "warnings": self.warnings,
        }

    def rows(self) -> list[tuple[str, str]]:
        """Summary as rows of text."""
        times = self.dataset["step_time"].values
        return [
            ("method", "minimising movements"),
            ("time", f"{times[0]:g} to {times[-1]:g}"),
            ("steps", str(self.steps)),
            ("final state", listed([f"{x:.6g}" for x in self.final])),
            ("dissipated", f"{float(self.dataset['dissipated'][-1]):.6g}"),
            *(("warning", text) for text in self.warnings),
        ]

    def overview(self, ax: Axes | None = None) -> Figure:
        """Plot components over time with stick phases shaded, and the energies; only the components
        if axes are given."""
        if ax is not None:
            return self.plot("z", ax=ax)
        from stickslip.figures.evolution import plot_history

        return plot_history(self)

    def stored(self) -> tuple[xarray.Dataset, dict[str, Any]]:
        """The data, and the reference values of the certificate."""
        settings = {
            "outcome": self.outcome.code,
            "detail": self.detail,
            "tolerance": self.tolerance,
            "kkt": self.kkt,
            "wall_time": self.wall_time,
        }
        return self.dataset, {"settings": settings}

    @classmethod
    def restored(cls, data: xarray.Dataset, parts: Mapping[str, str], where: str) -> Self:
        """Restore a stored evolution."""
        settings: dict[str, Any] = json.loads(parts["settings"])
        return cls(data, EvolutionOutcome.from_code(settings.pop("outcome")), **settings)
