"""The result of a fit: estimates, with their uncertainty."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.certificates import Certificate
from stickslip.errors import DeclarationError
from stickslip.fitting.problem import FitProblem, arguments_of, problem_again
from stickslip.fitting.statistics import Statistics
from stickslip.kept import cached_property
from stickslip.model.entries.units import with_unit
from stickslip.model.system import System
from stickslip.motion.simulate import check_positive
from stickslip.results import Completion, Result, restored_certificate

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.fitting.band import Band
    from stickslip.motion.trajectory import Trajectory


_MOST_REJECTIONS = 100  # largest number of rounds of rejection sampling


@dataclass(frozen=True, eq=False, repr=False)
class Fit(Result):
    """Parameter estimates of a system from data, with uncertainties.

    Attributes
    ----------
    declared : System
        The system that was fitted, with its declared parameter values.
    dataset : xarray.Dataset
        Over ``parameter``: ``estimate``, ``standard_error``, ``low`` and ``high`` (the ends of the
        95 % interval), ``start``, ``least`` and ``most`` (the bounds), ``unit``; ``covariance``.
        Over ``row`` (``row_2``, ... for further recordings): the data by the names of their
        columns, ``fitted_NAME`` and ``residual_NAME``, NaN in gaps. Over ``start_of_search``: the
        starts of the search.
    statistics : Statistics
    certificate : Certificate
    log_likelihood : float
    notes : tuple of str
        Warnings about the reliability of the fit.
    complete : bool
        False if the fit was interrupted.
    """

    KIND: ClassVar[str] = "fit"

    declared: System
    dataset: xarray.Dataset
    statistics: Statistics
    certificate: Certificate
    log_likelihood: float
    notes: tuple[str, ...]
    complete: bool
    _make: Callable[[], FitProblem] = field(repr=False)

    def __repr__(self) -> str:
        return f"<Fit of {self.declared.name}: {', '.join(self.unknowns_in_words(3))}>"

    # -- results -----------------------------------------------------------------------------------

    @cached_property
    def problem(self) -> FitProblem:
        """The least-squares problem, with the estimated noise."""
        return self._make()

    @property
    def names(self) -> list[str]:
        """The unknowns."""
        return [str(name) for name in self.dataset["parameter"].values]

    @property
    def estimate(self) -> dict[str, float]:
        """Estimates of the unknowns."""
        return dict(zip(self.names, self.values.tolist(), strict=True))

    @property
    def interval(self) -> dict[str, tuple[float, float]]:
        """95 % intervals from the covariance; :meth:`profile` gives likelihood intervals without
        this approximation."""
        low, high = self.dataset["low"].values, self.dataset["high"].values
        pairs = zip(low.tolist(), high.tolist(), strict=True)
        return dict(zip(self.names, pairs, strict=True))

    @property
    def covariance(self) -> Array:
        """Covariance of the estimates, shape (unknowns, unknowns)."""
        return self.statistics.covariance

    @property
    def values(self) -> Array:
        """Estimates as an array, shape (unknowns,)."""
        return self.dataset["estimate"].values

    @cached_property
    def system(self) -> System:
        """The system with the estimates as parameter values, for equilibria, branches and maps.
        After a fit to one recording, also with the initial values of this recording."""
        parameters, initial = self.problem.values_at(self.values)
        system = self.declared.with_parameters(**parameters)
        if len(initial) > 1:
            return system
        measured = self.problem.measured[0]
        values = {**parameters, **measured.recording.parameters}
        return replace(system, initial={**system.initial, **measured.start(values, initial[0])})

    @cached_property
    def trajectories(self) -> tuple[Trajectory, ...]:
        """The fitted motion of each recording."""
        return self.problem.evaluate(self.values).motions

    @property
    def trajectory(self) -> Trajectory:
        """The fitted motion of the first recording."""
        return self.trajectories[0]

    # -- uncertainty -------------------------------------------------------------------------------

    @validated
    def profile(
        self, name: str, *, progress: Callable[[float], None] | None = None
    ) -> xarray.Dataset:
        """Profile likelihood: the likelihood with one unknown fixed, maximised over the others.

        Parameters
        ----------
        name : str
        progress : callable, optional
            Called with the completed fraction.

        Returns
        -------
        xarray.Dataset
            Over ``value``: ``rise``, the increase of −2 log(likelihood), and the other unknowns.
            Attributes: ``limit``, the rise at the ends of the 95 % interval; ``low`` and ``high``,
            these ends, infinite if the data do not bound the interval; ``flat``, whether this is
            the case.

        Raises
        ------
        DeclarationError
            If there is no such unknown.
        """
        from stickslip.fitting.profile import profile_of

        return profile_of(self, name, progress)

    @validated
    def draws(self, count: int = 500, *, seed: int = 0) -> xarray.Dataset:
        """Draw random values of the unknowns from their estimated normal distribution, restricted
        to their bounds. Unknowns that the data do not determine keep their estimates.

        Parameters
        ----------
        count : int
            Number of draws.
        seed : int
            Seed of the random numbers, >= 0.

        Returns
        -------
        xarray.Dataset
            A variable for each unknown, over ``draw``.

        Raises
        ------
        DeclarationError
            If `count` is not positive, or `seed` is negative.
        """
        import xarray as xr

        check_positive(count=count)
        if seed < 0:
            raise DeclarationError("seed", f"{seed} is negative", "Give an integer >= 0")
        low, high = self.problem.bounds
        rng = np.random.default_rng(seed)
        root = _root_of(self.covariance)
        drawn = self.values + rng.standard_normal((count, len(root))) @ root.T
        # Rejection sampling of the truncated distribution. If the bounds admit almost no draws, the
        # last ones are moved to the bounds.
        for _ in range(_MOST_REJECTIONS):
            outside = np.any((drawn < low) | (drawn > high), axis=1)
            if not outside.any():
                break
            fresh = rng.standard_normal((int(outside.sum()), len(root))) @ root.T
            drawn[outside] = self.values + fresh
        drawn = np.clip(drawn, low, high)
        return xr.Dataset({n: ("draw", drawn[:, j]) for j, n in enumerate(self.names)})

    @validated
    def continue_cycle(
        self,
        parameter: str,
        span: tuple[float, float],
        *,
        initial: Mapping[str, float] | None = None,
    ) -> Band:
        """Continue a cycle of the fitted system in a parameter, with the resulting uncertainty of
        amplitudes, Hopf points, onsets of stick, and folds.

        Parameters
        ----------
        parameter : str
        span : (float, float)
            Range of the parameter.
        initial : mapping of str to float, optional
            Initial state of a motion that converges to the first cycle.

        Returns
        -------
        Band

        Raises
        ------
        ConvergenceError
            If the first cycle is not found.
        """
        from stickslip.fitting.band import cycles_with_band

        return cycles_with_band(self, parameter, span, initial)

    # -- description and summary -------------------------------------------------------------------

    @property
    def along(self) -> str:
        """Dimension of the estimates in the dataset."""
        return "parameter"

    @property
    def title(self) -> str:
        """Title of the system, or its name."""
        return self.declared.title or self.declared.name

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the parameters, with the estimates."""
        return self.problem.values_at(self.values)[0]

    @property
    def outcome(self) -> Completion:
        """Whether the search was completed."""
        return Completion.FINISHED if self.complete else Completion.INTERRUPTED

    @property
    def message(self) -> str:
        """Outcome and warnings."""
        return "\n".join([self.outcome.message, *self.notes])

    @property
    def aicc(self) -> float:
        """Akaike's information criterion with the small-sample correction, for the effective number
        of data."""
        return criteria(self.log_likelihood, self.free, self.count, self.statistics.weight)[0]

    @property
    def bic(self) -> float:
        """Schwarz's (Bayesian) information criterion, for the effective number of data."""
        return criteria(self.log_likelihood, self.free, self.count, self.statistics.weight)[1]

    @property
    def count(self) -> int:
        """Number of data."""
        return self.statistics.freedom + len(self.names)

    @property
    def free(self) -> int:
        """Number of estimated quantities: the unknowns, and the noise levels of columns."""
        return len(self.names) + int(self.dataset.attrs["noises"])

    def facts(self) -> dict[str, Any]:
        """Summary as plain data."""
        s = self.statistics
        return {
            **self.declared.heading(),
            "estimate": self.estimate,
            "standard_error": dict(zip(self.names, s.error.tolist(), strict=True)),
            "interval": {name: list(ends) for name, ends in self.interval.items()},
            "data": self.count,
            "unknowns": len(self.names),
            "log_likelihood": self.log_likelihood,
            "aicc": self.aicc,
            "bic": self.bic,
            "weight of the data": s.weight,
            "undetermined": list(s.undetermined),
            "tests": s.tests,
            "notes": list(self.notes),
        }

    def rows(self) -> list[tuple[str, str]]:
        """Summary as rows of text."""
        s = self.statistics
        tests = ", ".join(f"{name.replace('_', ' ')} {v:.3g}" for name, v in s.tests.items())
        return [
            *(("unknown", text) for text in self.unknowns_in_words()),
            ("data", f"{self.count}, effectively {100 * s.weight:.3g} % of them"),
            ("residuals", tests),
            ("criteria", f"AICc {self.aicc:.6g}, BIC {self.bic:.6g}"),
            *(("note", note) for note in self.notes),
        ]

    def unknowns_in_words(self, most: int = 100) -> list[str]:
        """Estimates with standard errors and intervals, one line each."""
        data = self.dataset
        found = []
        for j, name in enumerate(self.names[:most]):
            unit = str(data["unit"].values[j])
            value, error = float(self.values[j]), float(self.statistics.error[j])
            if not np.isfinite(error):
                found.append(f"{name} = {with_unit(value, unit, 6)}, not determined")
                continue
            low, high = self.interval[name]
            interval = f"(95 %: {low:.5g} to {high:.5g})"
            found.append(f"{name} = {with_unit(value, unit, 6)} ± {error:.2g} {interval}")
        return found

    def overview(self, ax: Axes | None = None) -> Figure:
        """Plot data, fitted motion and residuals; only the first column if axes are given."""
        from stickslip.figures.fit import plot_fit

        return plot_fit(self, ax)

    def stored(self) -> tuple[xarray.Dataset, dict[str, Any]]:
        """The dataset, and all other parts as plain data."""
        s = asdict(self.statistics)
        s |= {"covariance": s["covariance"].tolist(), "error": s["error"].tolist()}
        return self.dataset, {
            "system": self.declared.to_toml(),
            "arguments": arguments_of(self.problem),
            "statistics": s,
            "certificate": asdict(self.certificate),
            "log_likelihood": self.log_likelihood,
            "notes": list(self.notes),
            "complete": self.complete,
        }

    @classmethod
    def restored(cls, data: xarray.Dataset, parts: Mapping[str, str], where: str) -> Self:
        """Restore a stored fit; its problem is created again when it is needed."""
        from stickslip.model.system_file import loads

        system = loads(parts["system"], f"{where}: system")
        arguments = json.loads(parts["arguments"])
        s = json.loads(parts["statistics"])
        arrays = {name: np.array(s[name]) for name in ("covariance", "error")}
        statistics = Statistics(**{**s, **arrays, "undetermined": tuple(s["undetermined"])})
        return cls(
            system,
            data,
            statistics,
            restored_certificate(json.loads(parts["certificate"])),
            json.loads(parts["log_likelihood"]),
            tuple(json.loads(parts["notes"])),
            json.loads(parts["complete"]),
            lambda: problem_again(system, arguments, data),
        )


def criteria(log_likelihood: float, free: int, count: int, weight: float) -> tuple[float, float]:
    """Akaike's (with the small-sample correction) and Schwarz's information criterion.

    Both are computed for the effective number of data: residuals of neighbours are correlated, so
    that a fraction `weight` of the data counts as independent.

    Parameters
    ----------
    free : int
        Number of estimated quantities.
    count : int
        Number of data.
    weight : float
        Effective fraction of the data.
    """
    n = weight * count
    deviance = -2.0 * weight * log_likelihood
    correction = 2.0 * free * (free + 1.0) / (n - free - 1.0) if n > free + 1.0 else np.inf
    return deviance + 2.0 * free + correction, deviance + free * float(np.log(n))


def _root_of(covariance: Array) -> Array:
    """A matrix R with R Rᵀ equal to a covariance matrix, which may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    return vectors * np.sqrt(np.maximum(values, 0.0))
