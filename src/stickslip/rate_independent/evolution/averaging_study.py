"""[M] Theorem 2.2 as an experiment: z_ε against the averaged motion z_0, for several ε."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from stickslip.arguments import check_tolerances, validated
from stickslip.arrays import Array
from stickslip.certificates import Certificate, worst
from stickslip.errors import ConvergenceError, DeclarationError
from stickslip.kept import cached_property
from stickslip.progress import reporting
from stickslip.rate_independent.evolution.blocks import TESTS, Gauge, Motion, motion_of
from stickslip.rate_independent.evolution.evolution import Evolution, UnstableStart
from stickslip.results import CERTIFICATE, TEXT, Completion, Result, shortened
from stickslip.symbolic.formulas import is_finite

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LOADING = 5.0  # wall time in seconds above which the loading of machine code is negligible
_INTERRUPTED = "interrupted"
_SHOWN = ("distance", "equicontinuity", "rate_l1", "rate_l2", "steps")  # over ε, in a summary
_GRID = 1024  # intervals of the span on which the modulus of continuity is measured
_LEAST_TIME = 1e-9  # seconds: no clock shows less


@dataclass(frozen=True, eq=False, repr=False)
class AveragingStudy(Result):
    """Comparison of z_ε with the averaged motion z_0. |·| is the energy norm √⟨Az, z⟩.

    Attributes
    ----------
    dataset : xarray.Dataset
        Over ``epsilon``: ``distance``, sup|z_ε − z_0|; ``modulus`` (epsilon, delta), sup |z_ε(t₂) −
        z_ε(t₁)| over |t₂ − t₁| ≤ δ; ``equicontinuity``, its excess over the modulus of z_0, ω(ε) in
        [M] (2.5); ``weak_distance`` (epsilon, test), |∫φ dz_ε − ∫φ dz_0| for φ = cos(jπ(t − t₀)/T);
        ``rate_l1`` and ``rate_l2``, norms of ż_ε in L¹ and L²; ``dissipated`` energy; ``steps`` and
        ``wall_time`` of the resolved motion. Quantities that are defined for z_0 are included as
        ``averaged_...``. Moduli are measured on a grid of 1024 intervals (fewer if n > 16384).
    certificate : Certificate
        The largest value of every residual over all motions.
    stopped : str
        Empty, or the reason for an early stop of the study.
    """

    KIND: ClassVar[str] = "averaging study"
    PARTS: ClassVar = {"certificate": CERTIFICATE, "stopped": TEXT}

    dataset: xarray.Dataset
    certificate: Certificate
    stopped: str = ""

    def __repr__(self) -> str:
        epsilon = self.dataset["epsilon"].values
        scales = f"epsilon = {epsilon[0]:g} ... {epsilon[-1]:g}"
        return f"<AveragingStudy: {scales}, distance ~ epsilon^{self.rate:.2f}>"

    @cached_property
    def rate(self) -> float:
        """Exponent p of the fit sup|z_ε − z_0| ~ εᵖ; NaN if fewer than two distances are
        positive."""
        return self.powers["distance"]

    @cached_property
    def powers(self) -> dict[str, float]:
        """Fitted exponents of the columns; for ``weak_distance``, that of the largest over all test
        functions."""
        columns = {
            name: self.dataset[name].values
            for name in ("distance", "equicontinuity", "rate_l1", "rate_l2", "steps")
        }
        columns["weak_distance"] = self.dataset["weak_distance"].max("test").values
        return {
            name: fitted_power(self.dataset["epsilon"].values, column)[0]
            for name, column in columns.items()
        }

    @property
    def saved(self) -> dict[str, Array]:
        """Ratios of the numbers of steps, and of the wall times, of the resolved and the averaged
        motion, for each ε."""
        return {
            name: self.dataset[name].values
            / max(float(self.dataset[f"averaged_{name}"]), _LEAST_TIME)
            for name in ("steps", "wall_time")
        }

    # -- description and summary -------------------------------------------------------------------

    @property
    def along(self) -> str:
        """Dimension of the dataset."""
        return "epsilon"

    @property
    def title(self) -> str:
        """Description of the comparison."""
        return "fast oscillations and their average"

    @property
    def parameters(self) -> dict[str, float]:
        """Empty, since ε varies."""
        return {}

    @property
    def outcome(self) -> Completion:
        """Whether all ε were computed."""
        known = {"": Completion.FINISHED, _INTERRUPTED: Completion.INTERRUPTED}
        return known.get(self.stopped, Completion.STOPPED_EARLY)

    @property
    def message(self) -> str:
        """Reason of an early stop, or the statement that the study is complete."""
        return self.stopped or self.outcome.message

    def facts(self) -> dict[str, Any]:
        """Summary as plain data."""
        epsilon = self.dataset["epsilon"].values
        columns = {name: self.dataset[name].values.tolist() for name in _SHOWN}
        return {"epsilon": epsilon.tolist(), **columns, "powers": self.powers}

    def rows(self) -> list[tuple[str, str]]:
        """Summary as rows of text."""
        distances = zip(
            self.dataset["epsilon"].values, self.dataset["distance"].values, strict=True
        )
        rows = [(f"epsilon = {e:g}", f"distance {d:.3e}") for e, d in distances]
        powers = [f"{name.replace('_', ' ')} {power:.2f}" for name, power in self.powers.items()]
        return [*shortened(rows), ("powers of epsilon", ", ".join(powers))]

    def overview(self, ax: Axes | None = None) -> Figure:
        """Plot distances and rates against ε in double logarithmic axes, with their fitted powers;
        only the distances if axes are given."""
        from stickslip.figures.evolution import plot_study

        return plot_study(self, ax)


@validated
def averaging_study(
    problem: Evolution,
    epsilons: Sequence[float],
    *,
    tolerance: float = 1e-4,
    progress: Callable[[float], None] | None = None,
) -> AveragingStudy:
    """Study the convergence of z_ε to the averaged motion as ε → 0 ([M] Theorem 2.2).

    Parameters
    ----------
    problem : Evolution
        Its own ε is not used. The initial state has to be stable at every phase.
    epsilons : sequence of float
        Periods.
    tolerance : float
        Tolerance of the adaptive evolutions and approximate accuracy of the distance, relative to
        the size of the weights. A scalar problem with weighted ℓ1 dissipation is a play, which is
        exact.
    progress : callable, optional
        Called repeatedly with the completed fraction. By default a progress bar is shown on a
        terminal.

    Returns
    -------
    AveragingStudy
        Ctrl-C, or an evolution that stops early, ends the study with the values of ε completed so
        far.

    Raises
    ------
    DeclarationError
        If an ε is not positive, the dissipation does not depend on the phase, or the initial state
        is not stable at every phase.
    ConvergenceError
        If the first ε cannot be computed.
    """
    periods = _checked_periods(epsilons)
    check_tolerances(tolerance=tolerance)
    if not problem.dissipation.depends_on_phase:
        raise DeclarationError(
            "dissipation",
            "it does not depend on the phase",
            "Use a dissipation that depends on the phase",
        )
    averaged = _averaged(problem)
    start, end = map(float, problem.span)
    grid = np.linspace(start, end, _intervals(problem.n) + 1)
    limit, limit_gauge = _limit(averaged, grid, tolerance)
    done: list[tuple[Motion, Gauge]] = []
    stopped = ""
    try:
        with reporting(progress, "averaging study", patience=0.0) as show:
            for k, epsilon in enumerate(periods.tolist()):
                motion = motion_of(problem.with_period(epsilon), tolerance)
                done.append((motion, Gauge(problem.A, grid, limit.at).measure(motion)))
                show(float(np.sum(1.0 / periods[: k + 1]) / np.sum(1.0 / periods)))
    except (KeyboardInterrupt, ConvergenceError) as stop:
        if not done:
            raise
        stopped = _INTERRUPTED if isinstance(stop, KeyboardInterrupt) else str(stop)
    certificate = worst([limit.certificate, *(motion.certificate for motion, _ in done)])
    data = _dataset(periods[: len(done)], done, (limit, limit_gauge), grid)
    return AveragingStudy(data, certificate, stopped)


def fitted_power(x: Array, y: Array) -> tuple[float, float]:
    """p and c of the least-squares fit log y = p log x + log c; NaN if fewer than two y are
    positive."""
    positive = y > 0.0
    if np.count_nonzero(positive) < 2:
        return np.nan, np.nan
    power, offset = np.polyfit(np.log(x[positive]), np.log(y[positive]), 1)
    return float(power), float(np.exp(offset))


def _checked_periods(epsilons: Sequence[float]) -> Array:
    given = list(np.atleast_1d(np.asarray(epsilons, dtype=object)))
    if not given or not all(is_finite(e) and e > 0.0 for e in given):
        raise DeclarationError(
            "epsilons", f"{epsilons!r} are not all positive numbers", "Give positive numbers"
        )
    return np.array(given, dtype=float)


def _limit(averaged: Evolution, grid: Array, tolerance: float) -> tuple[Motion, Gauge]:
    """The averaged motion, computed twice if its first time may include loading machine code."""
    motion = motion_of(averaged, tolerance, keep=True)
    gauge = Gauge(averaged.A, grid).measure(motion)
    if motion.wall_time > _LOADING:
        return motion, gauge
    motion = motion_of(averaged, tolerance, keep=True)
    return motion, Gauge(averaged.A, grid).measure(motion)


def _averaged(problem: Evolution) -> Evolution:
    try:
        return problem.averaged()
    except UnstableStart as unstable:
        raise DeclarationError(
            "initial",
            f"not stable at every phase ({unstable.reason})",
            "Use the initial state Evolution.settled(A, load, dissipation.average(), "
            "initial).initial",
        ) from None


def _intervals(n: int) -> int:
    """Intervals of the grid, so that its states stay below 16 million numbers."""
    return int(np.clip(2**24 // n, 64, _GRID))


def _dataset(
    epsilons: Array, motions: list[tuple[Motion, Gauge]], limit: tuple[Motion, Gauge], grid: Array
) -> xarray.Dataset:
    """Measured values, over ε."""
    import xarray as xr

    (averaged, limit_gauge), gauges = limit, [gauge for _, gauge in motions]
    lags = 2 ** np.arange(int(np.log2(len(grid) - 1)) + 1)
    columns: dict[str, tuple[str, list[float]]] = {
        "distance": ("sup |z_eps - z_0|", [g.distance for g in gauges]),
        "equicontinuity": (
            "excess of the modulus of continuity over that of z_0",
            [float(np.max(g.modulus - limit_gauge.modulus, initial=0.0)) for g in gauges],
        ),
        "rate_l1": ("norm of the rate in L1, its total variation", [g.variation for g in gauges]),
        "rate_l2": ("norm of the rate in L2", [g.square**0.5 for g in gauges]),
        "dissipated": ("dissipated energy", [m.dissipated for m, _ in motions]),
        "steps": ("steps", [m.steps for m, _ in motions]),
        "wall_time": ("wall time", [m.wall_time for m, _ in motions]),
    }
    data: dict[str, Any] = {
        name: ("epsilon", values, {"long_name": text}) for name, (text, values) in columns.items()
    }
    data["wall_time"][2]["units"] = "s"
    data["weak_distance"] = (
        ("epsilon", "test"),
        [g.weak_distance(limit_gauge) for g in gauges],
        {"long_name": "|∫φ dz_eps - ∫φ dz_0| for φ = cos(test π (t - t0)/T)"},
    )
    data["modulus"] = (
        ("epsilon", "delta"),
        [g.modulus[lags - 1] for g in gauges],
        {"long_name": "modulus of continuity"},
    )
    data["averaged_modulus"] = ("delta", limit_gauge.modulus[lags - 1])
    data |= {
        "averaged_dissipated": averaged.dissipated,
        "averaged_steps": averaged.steps,
        "averaged_wall_time": averaged.wall_time,
        "averaged_rate_l1": limit_gauge.variation,
        "averaged_rate_l2": limit_gauge.square**0.5,
    }
    coordinates = {
        "epsilon": epsilons,
        "test": np.arange(TESTS),
        "delta": lags * (grid[1] - grid[0]),
    }
    return xr.Dataset(data, coordinates, {"norm": "energy norm"})
