"""The computation of one chunk, in any thread, process or machine."""

from __future__ import annotations

import pickle
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.model.system import System
from stickslip.sweeps.request.measures import OWN
from stickslip.sweeps.request.plan import Plan
from stickslip.sweeps.request.records import Under
from stickslip.sweeps.request.user_measures import (
    FormulaMeasure,
    FunctionMeasure,
    Measure,
    argument_of,
    read_measures,
    variable,
)

if TYPE_CHECKING:
    from stickslip.orbits.settling.motions import Settings
    from stickslip.sweeps.work.carrying import Runs


@dataclass(frozen=True)
class Work:
    """Common data of all points of a map, small enough to be sent with every chunk.

    Attributes
    ----------
    model : str
        Model file of the system.
    asked : tuple
        Arguments from which the measures are created again.
    device : str
        ``"cpu"`` or ``"gpu"``: where the compiled loops run.
    section, carries : bool
        See :class:`stickslip.sweeps.request.plan.Plan`; whether points carry the state.
    time_limit : float, optional
        Seconds of processor time that each point may take.
    under : Under, optional
        The record that drives the system, of a chunk.
    """

    model: str
    asked: tuple[Any, ...]
    initial: tuple[tuple[str, float], ...]
    settings: Settings
    device: str = "cpu"
    section: bool = False
    carries: bool = False
    time_limit: float | None = None
    under: Under | None = None


def work_of(plan: Plan, device: str = "cpu", time_limit: float | None = None) -> Work:
    """The work of a plan at its points."""
    asked = tuple(argument_of(measure) for measure in plan.measures)
    initial = tuple(plan.initial.items())
    model = plan.model
    carries = plan.carry is not None
    return Work(model, asked, initial, plan.settings, device, plan.section, carries, time_limit)


def check_sendable(work: Work) -> None:
    """Reject a function that another process could not find.

    Raises
    ------
    DeclarationError
    """
    try:
        pickle.dumps(work)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        remedy = (
            "Define it at the top level of a module, give it as file.py:function, or use threads"
        )
        raise DeclarationError(
            "measure", f"a function cannot be sent to other processes ({error})", remedy
        ) from None


@lru_cache(maxsize=8)
def _prepared(work: Work) -> tuple[System, tuple[Measure, ...]]:
    from stickslip.model.system_file import loads

    system = loads(work.model)
    if work.under is not None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # issued for the first record
            system = work.under.of(system)
    return system, read_measures(system, work.asked)


def compute(work: Work, columns: Mapping[str, Array], runs: Runs | None = None) -> dict[str, Array]:
    """Compute all stored variables of some points.

    Parameters
    ----------
    columns : mapping of str to array, shape (points,)
        Parameters and initial values that vary.
    runs : Runs, optional
        Of points that carry the state.

    Returns
    -------
    dict of str to array, shape (points,)
        By variable; NaN if undefined.

    Raises
    ------
    Stopped
        If a stop was requested.
    """
    if runs is not None:
        return _along(work, columns, runs)
    found = _independent_points(work, columns)
    return {name: found[name] for name in _stored(work)}


def _along(work: Work, columns: Mapping[str, Array], runs: Runs) -> dict[str, Array]:
    """Compute points sequentially, each from the final state of the previous one."""
    from stickslip.sweeps.work.carried_state import CarriedState, resumed_state
    from stickslip.sweeps.work.carrying import passed_on, stored_of

    system, _ = _prepared(work)
    found: list[dict[str, Array]] = [{}] * len(runs.order)
    left: list[CarriedState | None] = [None] * len(runs.order)
    handed: CarriedState | None = None
    for j, i in enumerate(runs.order.tolist()):
        handed = runs.begins.get(j, handed)
        here = {name: values[i : i + 1] for name, values in columns.items()}
        own = {name: float(v[0]) for name, v in here.items() if name in system.parameters}
        own = {**system.values, **own}
        begun = None if handed is None else resumed_state(system, handed, own)
        found[i] = _independent_points(work, here, begun)
        given = CarriedState(own, begun[0], handed.state) if begun and handed else None
        handed = left[i] = passed_on(system, own, found[i], given)
    stored = {name: np.concatenate([one[name] for one in found]) for name in _stored(work)}
    return stored | stored_of(system, left)


def _stored(work: Work) -> list[str]:
    """Stored variables of a point, without the carried state."""
    _, measures = _prepared(work)
    own = [variable(m) for m in measures if not isinstance(m, str)]
    return [*map(variable, measures), *(f"{name}_missing" for name in own), *OWN]


def _independent_points(
    work: Work,
    columns: Mapping[str, Array],
    begun: tuple[float, Array] | None = None,
) -> dict[str, Array]:
    """Compute independent points; with `begun`, a single one that starts at that time and state."""
    from stickslip.sweeps.work.chunk import measure_chunk

    system, measures = _prepared(work)
    count = len(next(iter(columns.values())))
    parameters = {name: values for name, values in columns.items() if name in system.parameters}
    initial = {name: np.full(count, value) for name, value in work.initial}
    initial |= {name: values for name, values in columns.items() if system.start_slope(name)}
    initial = system.started(initial)
    origin = system.span[0]
    if begun is not None:
        origin, state = begun
        initial = dict(zip(system.declaration.state, state[:, None], strict=True))
    formulas = [m for m in measures if isinstance(m, FormulaMeasure)]
    needed = dict.fromkeys(
        [m for m in measures if isinstance(m, str)] + [n for f in formulas for n in f.needs]
    )
    if work.carries:
        from stickslip.sweeps.work.carrying import needed_to_carry

        needed |= dict.fromkeys(needed_to_carry(system))
    found = measure_chunk(
        system,
        initial,
        parameters,
        tuple(needed),
        work.settings,
        work.device,
        work.section,
        origin,
        work.time_limit,
    )
    known = {**system.values, **_start(system, initial), **parameters, **found}
    result = dict(found)
    for measure in measures:
        name = variable(measure)
        if isinstance(measure, FormulaMeasure):
            result[name], result[f"{name}_missing"] = measure.values(known, count)
        elif isinstance(measure, FunctionMeasure):
            values = _by_function(measure, system, initial, parameters, work, origin)
            result[name], result[f"{name}_missing"] = values
    return result


def _start(system: System, initial: Mapping[str, Array]) -> dict[str, Array | float]:
    declared = {
        name: float(system.plain.initial.get(name, 0.0)) for name in system.declaration.state
    }
    return {**declared, **initial}


def _by_function(
    measure: FunctionMeasure,
    system: System,
    initial: Mapping[str, Array],
    parameters: Mapping[str, Array],
    work: Work,
    start: float,
) -> tuple[Array, Array]:
    """A function of the complete motion, point by point, with the reasons for missing values.

    Parameters
    ----------
    initial, parameters : mapping of str to array, shape (points,)
    start : float
        When the motions begin; they last as long as the span of the system.
    """
    from stickslip.motion.simulate import simulate

    count = len(next(iter({**initial, **parameters}.values())))
    values, why = np.full(count, np.nan), np.zeros(count, np.int8)
    for i in range(count):
        motion = simulate(
            system,
            (start, start + system.span[1] - system.span[0]),
            initial={name: float(column[i]) for name, column in initial.items()},
            parameters={name: float(column[i]) for name, column in parameters.items()},
            rtol=work.settings.rtol,
            atol=work.settings.atol,
            max_events=work.settings.max_events,
            time_limit=work.time_limit,
        )
        values[i], why[i] = measure.value(motion)
    return values, why
