"""The function ``fit``: the search for the best fit, and its result."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arguments import validated
from stickslip.certificates import Residual, worst
from stickslip.errors import DeclarationError
from stickslip.fitting.fit import Fit
from stickslip.fitting.problem import RTOL, Loss, fit_problem, suffix_of, table_columns
from stickslip.fitting.search import Search, minimise
from stickslip.fitting.statistics import Statistics, statistics_of
from stickslip.fitting.unknowns import FreeRange
from stickslip.model.system import Formula, System
from stickslip.motion.simulate import check_positive
from stickslip.numerics.levels import TINIEST
from stickslip.progress import reporting

if TYPE_CHECKING:
    import xarray

    from stickslip.fitting.measured import Noise

_NEAR_MINIMUM = 1e-2  # standard errors
_AT_BOUND = 1e-6  # relative distance from a bound within which an unknown is at it
_UNLIKELY = 1e-3
_SAME = 1e-6  # relative difference of costs of the same minimum
_NO_COST = 1e-12  # absolute: smaller costs occur with data without errors, and count as equal


@validated
def fit(
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
    starts: int = 8,
    seed: int = 0,
    rtol: float = RTOL,
    progress: Callable[[float], None] | None = None,
) -> Fit:
    """Fit parameters and initial values of a system to data.

    Least squares with the exact Jacobian, from several starts and with recordings of increasing
    length; Ctrl-C keeps the best fit so far.

    Parameters
    ----------
    system, data, free, observe, noise, loss, parameters, initial, drives, time, rtol
        As in :func:`fit_problem`.
    starts : int
        Number of starts: the given start, then points of a Sobol sequence within the bounds (or
        around the start if there are none).
    seed : int
        Seed of that sequence.
    progress : callable, optional
        Called with the completed fraction.

    Returns
    -------
    Fit

    Raises
    ------
    DeclarationError
        If an argument is wrong, or the data do not depend on an unknown.
    ConvergenceError
        If the motion cannot be computed at any start.

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
    with reporting(progress, f"fitting {system.name}") as show:
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
    notes: list[str] = []
    if len(found.starts) > 1 and found.minima:
        least = min(m.cost for m in found.minima)
        same = [m for m in found.minima if m.cost <= least * (1.0 + _SAME) + _NO_COST]
        notes.append(
            f"{len(same)} of {len(found.minima)} completed starts converge to this minimum; a "
            "lower minimum is not excluded"
        )
    if found.reasons:
        notes.append(f"{len(found.reasons)} starts were abandoned ({found.reasons[0]})")
    notes += [f"{name} is not determined by these data" for name in s.undetermined]
    for u, value in zip(problem.unknowns, p, strict=True):
        for bound in (u.low, u.high):
            if np.isfinite(bound) and abs(value - bound) <= _AT_BOUND * max(abs(bound), TINIEST):
                notes.append(f"{u.label} is at its bound {bound:g}: its interval is not reliable")
    if s.weight < 1.0:
        notes.append(
            f"neighbouring residuals have correlation {s.tests['correlation']:.2f}: the "
            f"effective number of the {len(problem.data)} data is "
            f"{s.weight * len(problem.data):.0f}, and intervals are widened accordingly"
        )
    if s.tests.get("p_value", 1.0) < _UNLIKELY:
        notes.append(
            f"residuals are larger than the noise ({s.tests['chi_square']:.4g} for {s.freedom} "
            "degrees of freedom): the model does not explain the data, or the noise is "
            "underestimated"
        )
    dropped = sum(m.dropped for m in problem.measured)
    if dropped:
        notes.append(f"{dropped} rows without a time or a value were skipped")
    return tuple(notes)


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
        row = f"row{suffix_of(r)}"
        variables[f"time{suffix_of(r)}"] = (row, m.times, _about(m.system, "t"))
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
                variables[f"{name}{suffix_of(r)}"] = (row, column, said)
            offset = end
        variables |= table_columns(m.recording, r)
    return xr.Dataset(
        variables,
        {"parameter": ("parameter", problem.names), "other": ("other", problem.names)},
        {"title": problem.system.title or problem.system.name, "noises": len(problem.estimated)},
    )


def _about(system: System, name: str) -> dict[str, str]:
    """Unit and meaning of an observation: a quantity, or a formula; times of events have none."""
    from stickslip.model.quantities import quantity_or_formula

    try:
        return quantity_or_formula(system, name)
    except DeclarationError:
        return {"long_name": name}
