"""A fit as a least-squares problem: residuals and their exact Jacobian, for any optimiser or
sampler."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.errors import DeclarationError, StickslipError, suggestion
from stickslip.fitting.measured import Column, MeasuredRecord, Noise, Unusable, read_recording
from stickslip.fitting.recording import CLOCKS, Recording, as_recordings
from stickslip.fitting.unknowns import FreeRange, Unknown, read_unknowns
from stickslip.kept import cached_property
from stickslip.model.system import Formula, System
from stickslip.motion.problem import pose
from stickslip.motion.record.knots import Knots
from stickslip.motion.trajectory import Trajectory
from stickslip.numerics.levels import FEW_ROUNDINGS
from stickslip.orbits.sensitivities.quantities import read_observations

if TYPE_CHECKING:
    import xarray

Loss = Literal["linear", "soft_l1", "huber", "cauchy"]
RTOL = 1e-9
_SQUARED = 1e150  # largest residual whose square can be summed
_LEAST = 4  # smallest number of rows of a part of a recording


class NoDerivative(StickslipError, RuntimeError):
    """The motion has no derivative here: the message gives the time and the reason."""


def _huber(z: Array) -> tuple[Array, Array]:
    root = np.sqrt(np.maximum(z, 1.0))
    return np.where(z <= 1.0, z, 2.0 * root - 1.0), 1.0 / root


# ρ(z) and ρ′(z) of z = r², as in SciPy.
LOSSES: dict[str, Callable[[Array], tuple[Array, Array]]] = {
    "linear": lambda z: (z, np.ones_like(z)),
    "soft_l1": lambda z: (2.0 * (np.sqrt(1.0 + z) - 1.0), 1.0 / np.sqrt(1.0 + z)),
    "huber": _huber,
    "cauchy": lambda z: (np.log1p(z), 1.0 / (1.0 + z)),
}


class Evaluated(NamedTuple):
    """The motions for some values, and their measurements; or the reason why there are none."""

    motions: tuple[Trajectory, ...]
    values: Array
    reason: str


@dataclass(frozen=True, eq=False)
class FitProblem:
    """Residuals of a system with respect to data, as functions of the unknowns.

    Attributes
    ----------
    system : System
    measured : tuple of MeasuredRecord
        The recordings as read.
    unknowns : tuple of Unknown
    given : dict of str to float
        Values of fixed parameters that differ from the defaults.
    loss : {"linear", "soft_l1", "huber", "cauchy"}
        Loss function of the squared residuals.
    sigma : array, shape (data,)
        Scale of the differences: the standard deviation of the noise if known; else the spread of
        the column or, after a fit, its estimate.
    rtol : float
        Relative tolerance of the motions, as in :func:`stickslip.simulate`.
    """

    system: System
    measured: tuple[MeasuredRecord, ...]
    unknowns: tuple[Unknown, ...]
    given: dict[str, float]
    loss: Loss
    sigma: Array
    rtol: float = RTOL
    _kept: list[tuple[bytes, Evaluated]] = field(default_factory=list[Any], repr=False)

    @property
    def names(self) -> list[str]:
        """Labels of the unknowns; an initial value of one of several recordings has its number,
        ``x[2]``."""
        return [u.label for u in self.unknowns]

    @property
    def start(self) -> Array:
        """Start values, shape (unknowns,)."""
        return np.array([u.start for u in self.unknowns])

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds, as for ``scipy.optimize.least_squares``."""
        return np.array([u.low for u in self.unknowns]), np.array([u.high for u in self.unknowns])

    @cached_property
    def data(self) -> Array:
        """All measured values, recording after recording, column after column."""
        return np.concatenate([m.data for m in self.measured])

    @cached_property
    def groups(self) -> Array:
        """Index of the column of each datum (columns of the same name count as one); −1 if its
        noise is known."""
        names = list(dict.fromkeys(c.name for m in self.measured for c in m.columns))
        parts = [
            np.full(len(c.rows), -1 if c.noise is not None else names.index(c.name))
            for m in self.measured
            for c in m.columns
        ]
        return np.concatenate(parts)

    @property
    def estimated(self) -> list[int]:
        """Columns whose noise is not known."""
        return sorted(set(self.groups.tolist()) - {-1})

    # -- interface for optimisers and samplers -----------------------------------------------------

    def residuals(self, p: Any) -> Array:
        """(motion − data)/sigma; infinite if the motion cannot be computed (:meth:`reason`), or
        their squares would overflow.

        Parameters
        ----------
        p : array, shape (unknowns,)

        Returns
        -------
        array, shape (data,)

        Raises
        ------
        DeclarationError
            If `p` has the wrong shape, or does not contain numbers.
        """
        found = self.evaluate(p)
        if found.reason:
            return np.full(len(self.data), np.inf)
        r = (found.values - self.data) / self.sigma
        return r if np.max(np.abs(r), initial=0.0) < _SQUARED else np.full(len(r), np.inf)

    def reason(self, p: Any) -> str:
        """Reason why the motion cannot be computed for given values; empty if it can."""
        return self.evaluate(p).reason

    def jacobian(self, p: Any) -> Array:
        """Derivatives of the residuals, exact across switches, corners and impacts; shape (data,
        unknowns).

        Raises
        ------
        NoDerivative
            If the motion cannot be computed, or has no derivative.
        """
        return self.slopes(p, touching=True)

    def slopes(self, p: Any, touching: bool) -> Array:
        """The same as :meth:`jacobian`, except that boundaries that are touched without being
        crossed, where half of the neighbouring motions have other events, may go unnoticed: a
        search does not hit them."""
        p = self._checked(p)
        found = self.evaluate(p)
        if found.reason:
            raise NoDerivative(f"the motion cannot be computed: {found.reason}")
        parts = [
            self._slopes(m, found.motions[r], r, touching) for r, m in enumerate(self.measured)
        ]
        return np.vstack(parts) / self.sigma[:, None]

    def log_likelihood(self, p: Any) -> float:
        """Logarithm of the likelihood of the data under independent Gaussian noise.

        It is maximised over the unknown standard deviations of columns (concentrated likelihood).
        With a robust loss, ρ(r²) replaces r². −inf if the motion cannot be computed.
        """
        r = self.residuals(p)
        if not np.all(np.isfinite(r)):
            return -math.inf
        known, total = self._known, 0.0
        rho = LOSSES[self.loss](r[known] ** 2)[0]
        log_sigma = float(np.sum(np.log(self.sigma[known])))
        total -= 0.5 * float(np.sum(rho)) + log_sigma + 0.5 * len(rho) * math.log(2.0 * math.pi)
        for group in self._concentrated:
            own = self.groups == group
            n, raw = int(own.sum()), r[own] * self.sigma[own]
            mean = max(float(raw @ raw) / n, np.finfo(float).tiny)
            total -= 0.5 * n * (math.log(2.0 * math.pi * mean) + 1.0)
        return total

    def log_likelihood_gradient(self, p: Any) -> Array:
        """Gradient of the log-likelihood, shape (unknowns,).

        Raises
        ------
        NoDerivative
            If the motion cannot be computed, or has no derivative.
        """
        J, r = self.jacobian(p), self.residuals(p)
        weight = LOSSES[self.loss](r**2)[1]
        for group in self._concentrated:
            own = self.groups == group
            # The likelihood maximised over σ is −m/2 log(r·r) up to a constant; this is its
            # derivative.
            weight[own] = own.sum() / max(float(r[own] @ r[own]), np.finfo(float).tiny)
        return -J.T @ (weight * r)

    def jax(self) -> Callable[[Any], Any]:
        """The residuals as a JAX function with forward and reverse derivatives, which may be part
        of larger functions (requires the extra ``jax``; see docs/fits-elsewhere.md).

        Raises
        ------
        StickslipError
            If JAX is not installed.
        """
        from stickslip.fitting.jax_function import as_jax

        return as_jax(self)

    # -- motions -----------------------------------------------------------------------------------

    def values_at(self, p: Array) -> tuple[dict[str, float], list[dict[str, float]]]:
        """Parameters, and the free initial values of every recording."""
        parameters = {**self.system.values, **self.given}
        initial: list[dict[str, float]] = [{} for _ in self.measured]
        for u, value in zip(self.unknowns, map(float, p), strict=True):
            (parameters if u.record < 0 else initial[u.record])[u.name] = value
        return parameters, initial

    def evaluate(self, p: Any) -> Evaluated:
        """Motions for given values of the unknowns, with the measured quantities."""
        p = self._checked(p)
        key = p.tobytes()
        for known, found in self._kept:
            if known == key:
                return found
        found = self._moved(p)
        self._kept[:] = [(key, found), *self._kept[:1]]
        return found

    def _moved(self, p: Array) -> Evaluated:
        parameters, initial = self.values_at(p)
        motions = []
        parts = []
        try:
            for m, free in zip(self.measured, initial, strict=True):
                motion = m.move(parameters, free, self.rtol)
                values = m.flat(m.of_motion(motion).values)
                if not np.all(np.isfinite(values)):
                    raise Unusable("a measured quantity is not a finite number")
                motions.append(motion)
                parts.append(values)
        except Unusable as reason:
            return Evaluated(tuple(motions), np.zeros(0), str(reason))
        return Evaluated(tuple(motions), np.concatenate(parts), "")

    def _slopes(self, m: MeasuredRecord, motion: Trajectory, r: int, touching: bool) -> Array:
        """Derivatives of the measurements of a recording with respect to the unknowns."""
        own = [j for j, u in enumerate(self.unknowns) if u.record in (-1, r)]
        names = [self.unknowns[j].name for j in own]
        found = m.of_motion(motion, names, touching)
        slopes = m.flat(found.slopes)
        if not np.all(np.isfinite(slopes)):
            when, why = found.missing[0] if found.missing else (m.span[0], "not finite")
            raise NoDerivative(f"no derivative after t = {when:.9g}: {why}")
        every = np.zeros((len(slopes), len(self.unknowns)))
        every[:, own] = slopes
        return every

    def check_shape(self, shape: tuple[int, ...]) -> None:
        """Reject values of the unknowns whose shape is not (unknowns,).

        Raises
        ------
        DeclarationError
        """
        if shape != (len(self.unknowns),):
            names = ", ".join(self.names)
            raise DeclarationError(
                "p", f"wrong shape {shape}", f"Give {len(self.unknowns)} values: {names}"
            )

    def _checked(self, p: Any) -> Array:
        values = np.array(p, float)
        self.check_shape(values.shape)
        if np.any(np.isnan(values)):
            name = self.names[int(np.argmax(np.isnan(values)))]
            raise DeclarationError(f"p: {name}", "not a number", "Give a number")
        return values

    @property
    def _concentrated(self) -> list[int]:
        """Columns whose noise is estimated by maximum likelihood."""
        return self.estimated if self.loss == "linear" else []

    @property
    def _known(self) -> Array:
        """Data with known noise."""
        return ~np.isin(self.groups, self._concentrated)

    # -- other problems ----------------------------------------------------------------------------

    def with_sigma(self, sigma: Array) -> FitProblem:
        """The same problem with other standard deviations."""
        return replace(self, sigma=sigma, _kept=list(self._kept))

    def first(self, share: float) -> FitProblem:
        """The same problem with the first part of every recording."""
        kept: list[Array] = []
        parts = []
        offset = 0
        for m in self.measured:
            most = max(math.ceil(share * len(m.times)), min(_LEAST, len(m.times)))
            parts.append(m.first(most))
            for c in m.columns:
                kept.append(offset + np.flatnonzero(c.rows < most))
                offset += len(c.rows)
        sigma = self.sigma[np.concatenate(kept)]
        return replace(self, measured=tuple(parts), sigma=sigma, _kept=[])

    def held(self, j: int, value: float) -> FitProblem:
        """The same problem with one unknown fixed."""
        u = self.unknowns[j]
        others = tuple(other for i, other in enumerate(self.unknowns) if i != j)
        if u.record < 0:
            given = {**self.given, u.name: value}
            return replace(self, unknowns=others, given=given, _kept=[])
        from stickslip.symbolic import expressions as ex

        measured = list(self.measured)
        m = measured[u.record]
        measured[u.record] = replace(m, initial={**m.initial, u.name: ex.num(value)})
        return replace(self, unknowns=others, measured=tuple(measured), _kept=[])


def _check_derivatives(system: System) -> None:
    """Reject systems and observations that have no derivatives for any motion."""
    for z in system.plain.declaration.resisted:
        raise DeclarationError(
            "system",
            f"the rate of {z} is defined implicitly, since a drag or friction law of {z} depends "
            "on it; a fit needs derivatives of motions, which do not exist then",
            f"Declare {z} inertial, with a negligible mass, or write the stress as an internal "
            "variable, as in ss.catalogue.velocity_step",
        )


@validated
def fit_problem(
    system: System,
    data: Any,
    free: Mapping[str, FreeRange] | Iterable[str],
    observe: Mapping[str, str] | None = None,
    *,
    noise: Mapping[str, Noise] | None = None,
    loss: Loss = "linear",
    parameters: Mapping[str, float] | None = None,
    initial: Mapping[str, Formula] | None = None,
    drives: Mapping[str, str] | None = None,
    time: str = "",
    rtol: float = RTOL,
) -> FitProblem:
    """Formulate a system and data as a problem for any optimiser or sampler: ``residuals(p)``,
    ``jacobian(p)``, ``log_likelihood(p)``, ``bounds``, ``start``, ``names``.

    Parameters
    ----------
    system : System
    data : table, Recording, or sequence of these
        A file, a DataFrame, a Dataset, or a mapping of names to arrays; see :class:`Recording`.
    free : mapping of str to (float, float) or None, or names
        Unknowns with bounds: parameters, and parts of the state, or degrees of freedom ``u[tip]``
        of structures, for their initial values (one for each recording); by default the declared
        ranges.
    observe : mapping of str to str, optional
        The quantity of the motion (or a formula of quantities) for each column; by default columns
        have the names of quantities. ``t`` is the time of an event.
    noise : mapping of str to float or str, optional
        Standard deviation of columns, or names of columns that contain it. Estimated by default.
    loss : {"linear", "soft_l1", "huber", "cauchy"}
        Robust losses are less sensitive to outliers.
    parameters : mapping of str to float, optional
        Values that replace the defaults: start values, or known values.
    initial : mapping of str to float or str, optional
        Known initial values of all recordings; formulas of the parameters are allowed.
    drives : mapping of str to str, optional
        Recorded drives, and their columns.
    time : str
        Column of the time; by default ``time`` or ``t``.
    rtol : float
        Relative tolerance of the motions, as in :func:`stickslip.simulate`.

    Returns
    -------
    FitProblem

    Raises
    ------
    DeclarationError
        If a column, a quantity, a name or a bound is wrong, data are constant, there are fewer
        data than unknowns, or motions have no derivatives, since the friction of a coordinate
        without mass depends on its rate.

    Examples
    --------
    >>> import numpy as np
    >>> import stickslip as ss
    >>> system = ss.catalogue.forced_oscillator()
    >>> t = np.linspace(0.0, 10.0, 50)
    >>> data = {"t": t, "x": ss.simulate(system, (0, 10)).at(t)["x"]}
    >>> problem = ss.fit_problem(system, data, {"F_c": (0.1, 0.9)})
    >>> problem.jacobian(problem.start).shape
    (50, 1)
    """
    if loss not in LOSSES:
        raise DeclarationError("loss", f"unknown loss '{loss}'", suggestion(loss, LOSSES, '"'))
    given = dict(parameters or {})
    system.plain.declaration.check_parameters({**system.values, **given})
    _check_derivatives(system)
    shared = {
        "parameters": {},
        "initial": initial or {},
        "drives": drives or {},
        "time": time,
    }
    recordings = as_recordings(data, shared)
    for r in recordings:
        for name in r.parameters:
            system.plain.declaration.check_range(name, r.parameters[name])
    measured = tuple(_read(system, r, observe, noise or {}) for r in recordings)
    unknowns = read_unknowns(system, free, recordings, given)
    count = sum(m.count for m in measured)
    if count < len(unknowns):
        raise DeclarationError(
            "free",
            f"{len(unknowns)} unknowns and {count} data",
            "Fit fewer unknowns, or give more data",
        )
    sigma = np.concatenate([_scale(c, measured) for m in measured for c in m.columns])
    fixed = {name: value for name, value in given.items()}
    return FitProblem(system, measured, unknowns, fixed, loss, sigma, rtol)


def _read(
    system: System,
    recording: Recording,
    observe: Mapping[str, str] | None,
    noise: Mapping[str, Noise],
) -> MeasuredRecord:
    empty = _without_motion(system)
    columns = [str(c) for c in recording.table.columns]
    if observe is None:
        known = {*empty.row_of, *system.outputs, *(["t"] if recording.events else [])}
        clock = "" if recording.events else recording.clock
        observe = {
            name: name
            for name in columns
            if name != clock and (name in known or system.unknown(name))
        }
        if not observe:
            raise DeclarationError(
                f"{recording.source}, observe",
                f"no column has the name of a quantity of {system.name}",
                f'Map columns to quantities, like {{"{_other(columns)}": '
                f'"{next(iter(empty.row_of))}"}}',
            )
    for name in noise:
        if name not in observe:
            raise DeclarationError(f"noise.{name}", "unknown column", suggestion(name, observe))
    read_observations(empty, [str(formula) for formula in observe.values()])
    return read_recording(system, recording, observe, noise)


def _other(columns: list[str]) -> str:
    """A column that is not the time."""
    return next((name for name in columns if name not in CLOCKS), "column")


def _without_motion(system: System) -> Trajectory:
    """A motion of zero length, for the names of its quantities."""
    from stickslip.motion.outcome import Outcome

    problem = pose(system)
    layout = problem.compiled.layout
    contacts, kinks = len(layout.u), len(layout.kinks)
    nothing = Knots.empty(0, len(layout.state), contacts, kinks)
    return Trajectory(problem, system.span, nothing, Outcome.FINISHED, RTOL)


def _scale(column: Column, measured: tuple[MeasuredRecord, ...]) -> Array:
    """Scale of the differences of a column before a fit."""
    if column.noise is not None:
        return column.noise
    same = [c.values for m in measured for c in m.columns if c.name == column.name]
    every = np.concatenate(same)
    spread = float(np.std(every))
    if spread <= FEW_ROUNDINGS * float(np.max(np.abs(every))):
        raise DeclarationError(
            f"column '{column.name}'",
            f"all {len(every)} values are {every[0]:g}, so there is nothing to fit",
            "Remove it, or give its noise",
        )
    return np.full(len(column.rows), spread)


# -- files -----------------------------------------------------------------------------------------


def suffix_of(r: int) -> str:
    """Suffix of the names of the data of a recording."""
    return "" if r == 0 else f"_{r + 1}"


def table_columns(recording: Recording, r: int) -> dict[str, Any]:
    """The original columns of a recording, which a stored fit includes."""
    names = [str(c) for c in recording.table.columns]
    found = {}
    for name in names:
        try:
            values = recording.column(name)
        except ValueError:
            continue  # text was not compared
        found[f"table{suffix_of(r)}: {name}"] = (f"table_row{suffix_of(r)}", values)
    return found


def arguments_of(problem: FitProblem) -> dict[str, Any]:
    """Arguments of the problem, as plain data."""
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


def problem_again(system: System, given: Mapping[str, Any], data: xarray.Dataset) -> FitProblem:
    """The problem of stored arguments and data."""
    recordings = []
    for r, entry in enumerate(given["recordings"]):
        prefix = f"table{suffix_of(r)}: "
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
