"""The effect of the uncertainty of a fit on branches of cycles.

To first order (the delta method) a number y(p) of the fitted system has the variance gᵀCg with the
gradient g and the covariance C of the fit. Gradients of cycles are exact
(:meth:`Cycle.sensitivity`); special points are located again for parameters on both sides of the
estimate, along the principal axes of C. At a fold the amplitude at a fixed parameter has no
gradient, but the curve itself moves by a finite distance, so bands are computed along its normals.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from stickslip.arrays import Array
from stickslip.certificates import Certificate
from stickslip.errors import ConvergenceError, DeclarationError, StickslipError
from stickslip.orbits.branches.cycle_branch import continue_cycle
from stickslip.orbits.branches.equilibrium_branch import checked_range
from stickslip.orbits.continuation.branch import Branch, SpecialPoint, without_knots
from stickslip.orbits.cycles.cycle import Cycle
from stickslip.orbits.cycles.find_cycle import find_cycle
from stickslip.orbits.sensitivities.cycle import cycle_sensitivity
from stickslip.progress import watched
from stickslip.results import Completion, Result, shortened

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.fitting.fit import Fit
    from stickslip.model.system import System

# standard deviations by which parameters are moved when special points are located again
_BESIDE = 0.1
_AROUND = 0.02  # initial fraction of the range in which a special point is searched for …
# … and distances from it on the branch at which the search starts
_APART = (0.03, 0.01, 0.1, 0.003, 1e-4)
_WIDER = 4.0
_TRIES = 3
_NEGLIGIBLE = 1e-12  # variance relative to the largest below which a principal axis is omitted
_SAME_PERIOD = 1e-6  # relative difference of periods of the same cycle


@dataclass(frozen=True, eq=False, repr=False)
class Band(Result):
    """A branch of cycles of a fitted system, with its uncertainty.

    Attributes
    ----------
    branch : Branch
    dataset : xarray.Dataset
        The points of the branch; ``amplitude_X_sd`` and ``period_sd``, standard deviations at a
        fixed parameter, NaN where there is no derivative, and ``amplitude_X_slope`` over the
        parameter. Over ``special``: ``kind``, ``value``, ``value_sd`` (NaN where the point was not
        found again).
    notes : tuple of str
    """

    KIND: ClassVar[str] = "band"

    branch: Branch
    dataset: xarray.Dataset
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<Band of {self.branch!r}>"

    @property
    def system(self) -> System:
        """The fitted system."""
        return self.branch.system

    @property
    def parameter(self) -> str:
        """The parameter of the branch."""
        return self.branch.parameter

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the parameters that stay fixed."""
        return self.branch.parameters

    @property
    def along(self) -> str:
        """Dimension of the points."""
        return "point"

    @property
    def title(self) -> str:
        """Title of the system."""
        return self.branch.title

    @property
    def outcome(self) -> Completion:
        """Outcome of the branch."""
        return self.branch.outcome

    @property
    def message(self) -> str:
        """Special points with their uncertainties."""
        return "\n".join([*self._uncertain(), self.branch.ended, *self.notes])

    @property
    def certificate(self) -> Certificate:
        """Certificate of the branch; standard deviations are first-order approximations."""
        return self.branch.certificate

    def _uncertain(self) -> list[str]:
        data = self.dataset
        found = []
        for kind, value, sd in zip(
            data["kind"].values, data["value"].values, data["value_sd"].values, strict=True
        ):
            known = f"± {sd:.2g}" if np.isfinite(sd) else "(uncertainty unknown)"
            found.append(f"{kind} at {self.parameter} = {value:.9g} {known}")
        return found

    def facts(self) -> dict[str, Any]:
        """Summary as plain data."""
        data = self.dataset
        special = [
            {"kind": str(kind), "value": float(value), "sd": float(sd)}
            for kind, value, sd in zip(
                data["kind"].values, data["value"].values, data["value_sd"].values, strict=True
            )
        ]
        return {**self.branch.facts(), "uncertain": special, "notes": list(self.notes)}

    def rows(self) -> list[tuple[str, str]]:
        """Summary as rows of text."""
        points = self.branch.rows()[:1]
        special = shortened([("special point", text) for text in self._uncertain()])
        notes = shortened([("note", text) for text in self.notes])
        return [*points, *special, ("ended", self.branch.ended), *notes]

    def overview(self, ax: Axes | None = None) -> Figure:
        """Plot the amplitude against the parameter with its band, and special points with their
        intervals."""
        from stickslip.figures.band import plot_band

        return plot_band(self, ax)

    def stored(self) -> tuple[xarray.Dataset, dict[str, Any]]:
        """The numbers, and everything else as data."""
        _, parts = self.branch.stored()
        return self.dataset, {**parts, "notes": list(self.notes)}

    @classmethod
    def restored(cls, data: xarray.Dataset, parts: Mapping[str, str], where: str) -> Self:
        """Restore a stored band."""
        branch = Branch.restored(data, parts, where)
        return cls(branch, data, tuple(json.loads(parts["notes"])))


def cycles_with_band(
    fit: Fit, parameter: str, span: tuple[float, float], initial: Mapping[str, float] | None
) -> Band:
    """The branch of cycles of a fitted system with its uncertainty; see
    :meth:`Fit.continue_cycle`."""
    system = fit.system
    low, high = checked_range(system, parameter, span)
    free, covariance = _free_of(fit, parameter)
    value = system.values[parameter]
    at = value if low <= value <= high else 0.5 * (low + high)
    cycle = find_cycle(system, initial, parameters={parameter: at})
    branch = continue_cycle(cycle, parameter, (low, high))
    data, notes = _with_deviations(branch, free, covariance)
    special, more = _special(branch, free, covariance, high - low)
    return Band(branch, data.assign(special), (*notes, *more))


def _free_of(fit: Fit, parameter: str) -> tuple[list[str], Array]:
    """The fitted parameters, without that of the branch, and their covariance."""
    kept = [
        j
        for j, u in enumerate(fit.problem.unknowns)
        if u.record < 0 and u.name != parameter and np.isfinite(fit.statistics.error[j])
    ]
    if not kept:
        raise DeclarationError(
            "continue_cycle",
            "no fitted parameter affects the branch",
            "Use stickslip.continue_cycle",
        )
    return [fit.names[j] for j in kept], fit.covariance[np.ix_(kept, kept)]


def _with_deviations(
    branch: Branch, free: list[str], covariance: Array
) -> tuple[xarray.Dataset, list[str]]:
    """Standard deviations of amplitudes and periods at every point."""
    points = branch.points
    system = branch.system
    names = [*free, branch.parameter]
    count = points.sizes["point"]
    nothing = np.full(count, np.nan)
    found = {f"amplitude_{x}_{what}": nothing.copy() for x in _moving(system) for what in _PARTS}
    found["period_sd"] = nothing.copy()
    without = 0
    with watched("deviations of the branch") as show:
        for i in range(count):
            show(i / count)
            try:
                slopes = cycle_sensitivity(_cycle_at(branch, i), names, multipliers=False)
            except (DeclarationError, ConvergenceError):
                without += 1
                continue
            for x in _moving(system):
                g = slopes["amplitude"].sel(component=x).values
                found[f"amplitude_{x}_sd"][i] = _deviation(g[:-1], covariance)
                found[f"amplitude_{x}_slope"][i] = g[-1]
            found["period_sd"][i] = _deviation(slopes["period"].values[:-1], covariance)
    data = points.assign({name: ("point", column) for name, column in found.items()})
    note = (
        f"at {without} points the derivative does not exist (events coincide); the band is "
        "interpolated there"
    )
    return data, [note] if without else []


_PARTS = ("sd", "slope")


def _moving(system: System) -> list[str]:
    return list(system.coordinates)


def _deviation(gradient: Array, covariance: Array) -> float:
    return float(np.sqrt(max(gradient @ covariance @ gradient, 0.0)))


def _cycle_at(branch: Branch, i: int) -> Cycle:
    """The cycle of a point, closed again from its state."""
    point = branch.points.isel(point=i)
    system = branch.system
    parameters = {**branch.parameters, branch.parameter: float(point[branch.parameter])}
    state = {name: float(point[name]) for name in system.declaration.state}
    from stickslip.motion.problem import pose
    from stickslip.orbits.cycles.finding import from_state

    problem = pose(system, parameters)
    closed = from_state(problem, problem.initial_state(state), float(point["time"]))
    cycle = Cycle(system, parameters, closed)
    near = abs(cycle.period / float(point["period"]) - 1.0)
    if near > _SAME_PERIOD:
        raise ConvergenceError("a cycle of the branch", "another cycle was found", "")
    return cycle


# -- special points --------------------------------------------------------------------------------


def _special(
    branch: Branch, free: list[str], covariance: Array, width: float
) -> tuple[dict[str, Any], list[str]]:
    """Special points with their standard deviations."""
    deviations = []
    lost = []
    special = without_knots(branch.special)
    with watched("deviations of special points") as show:
        for i, point in enumerate(special):
            show(i / len(special))
            try:
                deviations.append(_moved_by(branch, point, free, covariance, width))
            except StickslipError as error:
                deviations.append(np.nan)
                lost.append(f"{point.describe()}: not found again nearby ({error})")
    return {
        "kind": ("special", np.array([s.kind for s in special], dtype=object)),
        "value": ("special", np.array([s.value for s in special])),
        "value_sd": ("special", np.array(deviations)),
    }, lost


def _moved_by(
    branch: Branch, point: SpecialPoint, free: list[str], covariance: Array, width: float
) -> float:
    """Standard deviation of the parameter at a special point."""
    variances, axes = np.linalg.eigh(covariance)
    total = 0.0
    start = _beside(branch, point, width)
    estimate = np.array([branch.parameters[name] for name in free])
    for variance, axis in zip(variances, axes.T, strict=True):
        if variance <= _NEGLIGIBLE * variances[-1]:
            continue
        # Along the principal axes of the covariance the changes are independent: variances add up.
        step = _BESIDE * np.sqrt(variance) * axis
        ends = [
            _again(branch, point, start, dict(zip(free, estimate + s * step, strict=True)), width)
            for s in (1.0, -1.0)
        ]
        total += ((ends[0] - ends[1]) / (2.0 * _BESIDE)) ** 2
    return float(np.sqrt(total))


def _beside(branch: Branch, point: SpecialPoint, width: float) -> Cycle:
    """A cycle of the branch near a special point, far enough from it to exist for neighbouring
    parameters, too; the point is located again from there."""
    values = branch.points[branch.parameter].values
    certified = branch.points["certified"].values == 1
    away = np.abs(values - point.value) / width
    for least in _APART:
        far = np.flatnonzero(certified & (away > least))
        for i in sorted(far, key=lambda i: abs(i - point.index))[:2]:
            try:
                return _cycle_at(branch, int(i))
            except ConvergenceError:
                continue
    raise ConvergenceError(point.describe(), "neighbouring cycles do not converge", "")


def _again(
    branch: Branch, point: SpecialPoint, start: Cycle, moved: dict[str, float], width: float
) -> float:
    """A special point at other parameters."""
    name = branch.parameter
    low, high = (
        float(branch.points[name].values.min()) - width,
        float(branch.points[name].values.max()) + width,
    )
    around = max(_AROUND * width, 1.5 * abs(start.parameters[name] - point.value))
    cycle = find_cycle(branch.system, start, parameters=moved)
    declared = branch.system.plain.declaration.ranges[name]
    for _ in range(_TRIES):
        ends = (
            max(point.value - around, low, declared.low),
            min(point.value + around, high, declared.high),
        )
        found = continue_cycle(cycle, name, ends)
        same = [s.value for s in found.of_kind(point.kind)]
        if same:
            return min(same, key=lambda value: abs(value - point.value))
        around *= _WIDER
    raise ConvergenceError(point.kind, "no such point was found nearby for other parameters", "")
