"""The law that explains data best, and how well they determine it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from stickslip.arrays import Array
from stickslip.certificates import Certificate, Residual, worst
from stickslip.fitting.problem import RTOL, FitProblem, Loss, fit_problem
from stickslip.fitting.recording import Recording
from stickslip.fitting.search import Search, minimise
from stickslip.fitting.statistics import Statistics, statistics_of
from stickslip.fitting.unknowns import Bounds
from stickslip.model.system import Formula, System
from stickslip.model.units import with_unit
from stickslip.motion.simulate import check_positive
from stickslip.progress import told
from stickslip.results import Completion, Result, restored_certificate

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.fitting.band import Band
    from stickslip.fitting.measured import Noise
    from stickslip.motion.trajectory import Trajectory

_NEAR_MINIMUM = 1e-2  # standard errors
_AT_BOUND = 1e-6  # part of its box within which an unknown is at a bound
_UNLIKELY = 1e-3
_SAME = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class Fit(Result):
    """The unknowns for which a system explains data best.

    Attributes
    ----------
    declared : System
        The system as it was given.
    dataset : xarray.Dataset
        Over ``parameter``: ``estimate``, ``standard_error``, ``low`` and ``high`` (of the interval
        of 95 %), ``start``, ``least`` and ``most`` (the bounds), ``unit``; ``covariance``. Over
        ``row`` (``row_2``, ... of further recordings): the data by the names of their columns,
        ``fitted_NAME`` and ``residual_NAME``, NaN in gaps. Over ``start_of_search``: where the
        search began.
    statistics : Statistics
    certificate : Certificate
    log_likelihood : float
    notes : tuple of str
        What one should know before one believes it.
    complete : bool
        False if it was interrupted.
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
        return f"<Fit of {self.declared.name}: {', '.join(self._said_of_unknowns(3))}>"

    # -- what was found ----------------------------------------------------------------------------

    @cached_property
    def problem(self) -> FitProblem:
        """The problem of least squares, with the noise that was estimated."""
        return self._make()

    @property
    def names(self) -> list[str]:
        """The unknowns."""
        return [str(name) for name in self.dataset["parameter"].values]

    @property
    def estimate(self) -> dict[str, float]:
        """Their values."""
        return dict(zip(self.names, self._p.tolist(), strict=True))

    @property
    def interval(self) -> dict[str, tuple[float, float]]:
        """Their intervals of 95 %, from the covariance; :meth:`profile` gives those that need no
        parabola."""
        low, high = self.dataset["low"].values, self.dataset["high"].values
        pairs = zip(low.tolist(), high.tolist(), strict=True)
        return dict(zip(self.names, pairs, strict=True))

    @property
    def covariance(self) -> Array:
        """Their covariance, shape (unknowns, unknowns)."""
        return self.statistics.covariance

    @property
    def _p(self) -> Array:
        return self.dataset["estimate"].values

    @cached_property
    def system(self) -> System:
        """The system with the estimates as its numbers: equilibria, branches and maps follow. With
        one recording, its initial values, too."""
        parameters, initial = self.problem.values_at(self._p)
        system = self.declared.with_parameters(**parameters)
        if len(initial) > 1:
            return system
        m = self.problem.measured[0]
        values = {**parameters, **m.recording.parameters}
        return replace(system, initial={**system.initial, **m.start(values, initial[0])})

    @cached_property
    def trajectories(self) -> tuple[Trajectory, ...]:
        """The fitted motion of each recording."""
        return self.problem.evaluate(self._p).motions

    @property
    def trajectory(self) -> Trajectory:
        """That of the first recording."""
        return self.trajectories[0]

    # -- how well it is determined -----------------------------------------------------------------

    def profile(self, name: str, progress: Callable[[float], None] | None = None) -> xarray.Dataset:
        """Likelihood of the data with one unknown fixed, and the others as likely as they can be.

        Parameters
        ----------
        name : str
        progress : callable, optional
            Is told the fraction done.

        Returns
        -------
        xarray.Dataset
            Over ``value``: ``rise`` of −2 log(likelihood), and the other unknowns. Attributes:
            ``limit``, below which the rise is in the interval of 95 %; ``low`` and ``high``, its
            ends, infinite where the data do not bound it; ``flat``, whether they do not.

        Raises
        ------
        DeclarationError
            If there is no such unknown.
        """
        from stickslip.fitting.profile import profile_of

        return profile_of(self, name, progress)

    def draws(self, count: int = 500, seed: int = 0) -> xarray.Dataset:
        """Values of the unknowns as likely as the data make them: normally distributed, within
        their bounds.

        Parameters
        ----------
        count : int
        seed : int

        Returns
        -------
        xarray.Dataset
            A variable for each unknown, over ``draw``.
        """
        import xarray as xr

        check_positive(count=count)
        low, high = self.problem.bounds
        rng = np.random.default_rng(seed)
        root = _root_of(self.covariance)
        drawn = self._p + rng.standard_normal((count, len(root))) @ root.T
        for _ in range(100):
            outside = np.any((drawn < low) | (drawn > high), axis=1)
            if not outside.any():
                break
            fresh = rng.standard_normal((int(outside.sum()), len(root))) @ root.T
            drawn[outside] = self._p + fresh
        drawn = np.clip(drawn, low, high)
        return xr.Dataset({n: ("draw", drawn[:, j]) for j, n in enumerate(self.names)})

    def continue_cycle(
        self, parameter: str, span: tuple[float, float], initial: Mapping[str, float] | None = None
    ) -> Band:
        """The branch of cycles of the fitted system over a parameter, and how far the uncertainty
        of the fit moves it: amplitudes, Hopf points, onsets of stick, folds.

        Parameters
        ----------
        parameter : str
        span : (float, float)
            Its range.
        initial : mapping of str to float, optional
            State from which the motion settles on the first cycle.

        Returns
        -------
        Band

        Raises
        ------
        ConvergenceError
            If there is no cycle to begin with.
        """
        from stickslip.fitting.band import cycles_with_band

        return cycles_with_band(self, parameter, span, initial)

    # -- what it says of itself --------------------------------------------------------------------

    @property
    def along(self) -> str:
        """Dimension of the table."""
        return "parameter"

    @property
    def title(self) -> str:
        """Of what it is a fit."""
        return self.declared.title or self.declared.name

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the parameters."""
        return self.problem.values_at(self._p)[0]

    @property
    def outcome(self) -> Completion:
        """Whether the search came to its end."""
        return Completion.FINISHED if self.complete else Completion.INTERRUPTED

    @property
    def message(self) -> str:
        """How it ended, and what one should know."""
        return "\n".join([self.outcome.message, *self.notes])

    @property
    def aicc(self) -> float:
        """Akaike's criterion with the correction for few data, of as many data as count."""
        return criteria(self.log_likelihood, self._free, self._count, self.statistics.weight)[0]

    @property
    def bic(self) -> float:
        """Schwarz's criterion."""
        return criteria(self.log_likelihood, self._free, self._count, self.statistics.weight)[1]

    @property
    def _count(self) -> int:
        return self.statistics.freedom + len(self.names)

    @property
    def _free(self) -> int:
        """Unknowns, and columns whose noise is one."""
        return len(self.names) + int(self.dataset.attrs["noises"])

    def facts(self) -> dict[str, Any]:
        """What fits on a page, as plain data."""
        s = self.statistics
        return {
            **self.declared.heading(),
            "estimate": self.estimate,
            "standard_error": dict(zip(self.names, s.error.tolist(), strict=True)),
            "interval": {name: list(ends) for name, ends in self.interval.items()},
            "data": self._count,
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
        """What fits on a page, in words."""
        rows = [("unknown", text) for text in self._said_of_unknowns()]
        rows += [("data", f"{self._count}, of which {100 * self.statistics.weight:.3g} % count")]
        tests = self.statistics.tests
        rows += [
            ("residuals", ", ".join(f"{n.replace('_', ' ')} {v:.3g}" for n, v in tests.items()))
        ]
        rows += [("criteria", f"AICc {self.aicc:.6g}, BIC {self.bic:.6g}")]
        return [*rows, *(("note", note) for note in self.notes)]

    def _said_of_unknowns(self, most: int = 100) -> list[str]:
        data = self.dataset
        found = []
        for j, name in enumerate(self.names[:most]):
            unit = str(data["unit"].values[j])
            value, error = float(self._p[j]), float(self.statistics.error[j])
            if not np.isfinite(error):
                found.append(f"{name} = {with_unit(value, unit, 6)}, not determined")
                continue
            low, high = self.interval[name]
            interval = f"(95 %: {low:.5g} to {high:.5g})"
            found.append(f"{name} = {with_unit(value, unit, 6)} ± {error:.2g} {interval}")
        return found

    def overview(self, ax: Axes | None = None) -> Figure:
        """Data, fitted motion and residuals; in given axes the first column alone."""
        from stickslip.figures.fit import plot_fit

        return plot_fit(self, ax)

    def stored(self) -> tuple[xarray.Dataset, dict[str, Any]]:
        """The numbers, and everything else as data."""
        s = asdict(self.statistics)
        s |= {"covariance": s["covariance"].tolist(), "error": s["error"].tolist()}
        return self.dataset, {
            "system": self.declared.to_toml(),
            "arguments": _arguments(self.problem),
            "statistics": s,
            "certificate": asdict(self.certificate),
            "log_likelihood": self.log_likelihood,
            "notes": list(self.notes),
            "complete": self.complete,
        }

    @classmethod
    def restored(cls, data: xarray.Dataset, parts: Mapping[str, str], where: str) -> Self:
        """A fit as it was."""
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
            lambda: _problem_of(system, arguments, data),
        )


def criteria(log_likelihood: float, free: int, count: int, weight: float) -> tuple[float, float]:
    """Akaike's (with correction) and Schwarz's criterion, where a part of the data counts.

    Parameters
    ----------
    log_likelihood : float
    free : int
        Number of unknowns.
    count : int
        Of data.
    weight : float
        Part of them that counts.
    """
    n = weight * count
    deviance = -2.0 * weight * log_likelihood
    correction = 2.0 * free * (free + 1.0) / (n - free - 1.0) if n > free + 1.0 else np.inf
    return deviance + 2.0 * free + correction, deviance + free * float(np.log(n))


def _root_of(covariance: Array) -> Array:
    """A square root of a covariance, which may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    return vectors * np.sqrt(np.maximum(values, 0.0))


# -- making one ------------------------------------------------------------------------------------


def fit(
    system: System,
    data: Any,
    free: Mapping[str, Bounds] | Iterable[str],
    observe: Mapping[str, str] | None = None,
    *,
    noise: Mapping[str, Noise] | None = None,
    loss: Loss = "linear",
    parameters: Mapping[str, float] | None = None,
    initial: Mapping[str, Formula] | None = None,
    drives: Mapping[str, str] | None = None,
    time: str = "",
    starts: int = 8,
    seed: int = 0,
    rtol: float = RTOL,
    progress: Callable[[float], None] | None = None,
) -> Fit:
    """Find the parameters, and initial values, for which a system explains data best.

    Least squares with the exact Jacobian, from several starts over recordings that grow; Ctrl-C
    keeps the best so far.

    Parameters
    ----------
    system, data, free, observe, noise, loss, parameters, initial, drives, time, rtol
        As of :func:`fit_problem`.
    starts : int
        Points of a Sobol sequence in the bounds (or around the start where there are none), the
        given start first.
    seed : int
        Of that sequence.
    progress : callable, optional
        Is told the fraction done.

    Returns
    -------
    Fit

    Raises
    ------
    DeclarationError
        If an argument is wrong, or nothing that was measured depends on an unknown.
    ConvergenceError
        If there is a motion at no start.

    Examples
    --------
    >>> import numpy as np
    >>> import stickslip as ss
    >>> system = ss.catalogue.forced_oscillator()
    >>> t = np.linspace(0.0, 40.0, 200)
    >>> x = ss.simulate(system, (0, 40), parameters={"F_c": 0.4}).at(t)["x"]
    >>> noisy = {"t": t, "x": x + 0.01 * np.random.default_rng(0).standard_normal(200)}
    >>> found = ss.fit(system, noisy, {"F_c": (0.1, 0.9)}, starts=4)
    >>> low, high = found.interval["F_c"]
    >>> low < 0.4 < high
    True
    """
    problem = fit_problem(
        system,
        data,
        free,
        observe,
        noise=noise,
        loss=loss,
        parameters=parameters,
        initial=initial,
        drives=drives,
        time=time,
        rtol=rtol,
    )
    check_positive(starts=starts)
    with told(progress, f"fitting {system.name}") as show:
        only = progress is not None

        def tell(share: float, text: str) -> None:
            show(share) if only else show(share, text)  # type: ignore[call-arg]

        found = minimise(problem, starts, seed, tell)
    return _made(found)


def _made(found: Search) -> Fit:
    """The result of a search."""
    problem, p = found.problem, found.best.p
    statistics = statistics_of(problem, p)
    motions = problem.evaluate(p).motions
    near = Residual(
        "step to the minimum", statistics.step, _NEAR_MINIMUM, note="in standard errors"
    )
    lost = Residual("unknowns that are not determined", float(len(statistics.undetermined)), 0.0)
    of_motions = worst([motion.certificate for motion in motions])
    ended = "interrupted" if found.interrupted else of_motions.outcome
    certificate = replace(of_motions, residuals=(near, lost, *of_motions.residuals), outcome=ended)
    return Fit(
        problem.system,
        _dataset(found, statistics),
        statistics,
        certificate,
        problem.log_likelihood(p),
        _notes(found, statistics),
        not found.interrupted,
        lambda: problem,
    )


def _notes(found: Search, s: Statistics) -> tuple[str, ...]:
    problem, p = found.problem, found.best.p
    notes = list(found.notes)
    if len(found.starts) > 1 and found.minima:
        least = min(m.cost for m in found.minima)
        same = [m for m in found.minima if m.cost <= least * (1.0 + _SAME) + 1e-12]
        notes.append(
            f"{len(same)} of {len(found.minima)} starts that were followed to the end lead here; "
            "that no other minimum is lower is not proved"
        )
    if found.reasons:
        notes.append(f"{len(found.reasons)} starts were given up ({found.reasons[0]})")
    notes += [f"{name} is not determined by these data" for name in s.undetermined]
    for u, value in zip(problem.unknowns, p, strict=True):
        for bound in (u.low, u.high):
            if np.isfinite(bound) and abs(value - bound) <= _AT_BOUND * max(abs(bound), 1e-300):
                notes.append(f"{u.label} is at its bound {bound:g}: its interval says little")
    if s.weight < 1.0:
        notes.append(
            f"residuals of neighbours are correlated by {s.tests['correlation']:.2f}: of "
            f"{len(problem.data)} data as many as {s.weight * len(problem.data):.0f} count, and "
            "intervals are as wide as that makes them"
        )
    if s.tests.get("p_value", 1.0) < _UNLIKELY:
        notes.append(
            f"residuals are larger than the noise ({s.tests['chi_square']:.4g} for {s.freedom} "
            "degrees of freedom): the law does not explain the data, or the noise is larger"
        )
    dropped = sum(m.dropped for m in problem.measured)
    if dropped:
        notes.append(f"{dropped} rows without a time or a value were left out")
    return tuple(notes)


def _suffix(r: int) -> str:
    """What names of the data of a recording end with."""
    return "" if r == 0 else f"_{r + 1}"


def _dataset(found: Search, s: Statistics) -> xarray.Dataset:
    import xarray as xr

    problem, p = found.problem, found.best.p
    unknowns = problem.unknowns
    wide = np.where(np.isfinite(s.error), s.quantile * s.error, np.inf)
    low, high = problem.bounds
    variables: dict[str, Any] = {
        "estimate": ("parameter", p),
        "standard_error": ("parameter", s.error),
        "low": ("parameter", np.maximum(p - wide, low)),
        "high": ("parameter", np.minimum(p + wide, high)),
        "start": ("parameter", problem.start),
        "least": ("parameter", low),
        "most": ("parameter", high),
        "unit": ("parameter", [u.unit for u in unknowns]),
        "covariance": (("parameter", "other"), s.covariance),
        "starts": (("start_of_search", "parameter"), found.starts),
        "sigma": ("datum", problem.sigma),
    }
    values = problem.evaluate(p).values
    offset = 0
    for r, m in enumerate(problem.measured):
        row = f"row{_suffix(r)}"
        variables[f"time{_suffix(r)}"] = (row, m.times, _about(m.system, "t"))
        for c in m.columns:
            end = offset + len(c.rows)
            said = _about(m.system, c.formula)
            sides = {
                c.name: c.values,
                f"fitted_{c.name}": values[offset:end],
                f"residual_{c.name}": (c.values - values[offset:end]),
            }
            for name, part in sides.items():
                column = np.full(len(m.times), np.nan)
                column[c.rows] = part
                variables[f"{name}{_suffix(r)}"] = (row, column, said)
            offset = end
        variables |= _table(m.recording, r)
    return xr.Dataset(
        variables,
        {"parameter": ("parameter", problem.names), "other": ("other", problem.names)},
        {"title": problem.system.title or problem.system.name, "noises": len(problem.estimated)},
    )


def _about(system: System, name: str) -> dict[str, str]:
    from stickslip.model.quantities import quantity

    try:
        return quantity(system, name)
    except KeyError:
        return {"long_name": name}


def _table(recording: Recording, r: int) -> dict[str, Any]:
    """The columns of a recording as they came, so that a stored fit has its data."""
    names = [str(c) for c in recording.table.columns]
    found = {}
    for name in names:
        try:
            values = recording.column(name)
        except ValueError:
            continue  # words are nothing that was compared
        found[f"table{_suffix(r)}: {name}"] = (f"table_row{_suffix(r)}", values)
    return found


def _arguments(problem: FitProblem) -> dict[str, Any]:
    """What the problem was made of, as plain data."""
    free = {u.name: [u.low, u.high] for u in problem.unknowns}
    return {
        "free": free,
        "observe": [{c.name: c.formula for c in m.columns} for m in problem.measured],
        "known": [[c.name for c in m.columns if c.noise is not None] for m in problem.measured],
        "loss": problem.loss,
        "parameters": problem.given,
        "rtol": problem.rtol,
        "recordings": [
            {
                "parameters": dict(m.recording.parameters),
                "initial": dict(m.recording.initial),
                "drives": dict(m.recording.drives),
                "time": m.recording.time,
                "begin": m.recording.begin,
                "end": m.recording.end,
                "events": m.recording.events,
            }
            for m in problem.measured
        ],
    }


def _problem_of(system: System, given: Mapping[str, Any], data: xarray.Dataset) -> FitProblem:
    """The problem of stored arguments and data."""
    recordings = []
    for r, entry in enumerate(given["recordings"]):
        prefix = f"table{_suffix(r)}: "
        names = [str(n) for n in data.data_vars if str(n).startswith(prefix)]
        table = {name.removeprefix(prefix): data[name].values for name in names}
        recordings.append(Recording(table, **entry))
    observe: dict[str, str] = {}
    for entry in given["observe"]:
        observe |= entry
    known = {name for names in given["known"] for name in names}
    sigma = data["sigma"].values
    problem = fit_problem(
        system,
        recordings,
        {name: tuple(bounds) for name, bounds in given["free"].items()},
        observe,
        noise=dict.fromkeys(known, 1.0),
        loss=given["loss"],
        parameters=given["parameters"],
        rtol=given["rtol"],
    )
    return problem.with_sigma(sigma)
