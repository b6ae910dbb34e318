"""Many motions in one call: compiled loops on all cores."""

from __future__ import annotations

import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from stickslip.errors import DeclarationError
from stickslip.motion.outcome import Outcome
from stickslip.motion.problem import Problem, pose
from stickslip.motion.simulate import check_span
from stickslip.system import System

if TYPE_CHECKING:
    import xarray

Array = np.ndarray
BATCH_SLOTS = 12  # closed forms kept for each set of parameters of a batch
PIECE = 256  # lanes of one task


def simulate_many(
    system: System,
    t_span: tuple[float, float] | None = None,
    initial: Mapping[str, ArrayLike] | None = None,
    parameters: Mapping[str, ArrayLike] | None = None,
    *,
    rtol: float = 1e-10,
    atol: float = 1e-12,
    max_events: int = 1_000_000,
    workers: int | None = None,
) -> xarray.Dataset:
    """Final states of many motions of a system.

    Parameters
    ----------
    system : System
    t_span : (float, float), optional
        Start and end, the same for all.
    initial, parameters : mapping of str to float or 1-D array, optional
        What varies from motion to motion; numbers hold for all. All arrays have the same length.
    rtol, atol, max_events
        As in :func:`simulate`.
    workers : int, optional
        Threads; by default all cores. The result does not depend on it.

    Returns
    -------
    xarray.Dataset
        Dimension ``trajectory``: the given values, the final state (``final_psi`` …), ``time`` reached, ``outcome``
        (codes with flag_meanings), ``switches`` of contacts, ``kinks`` crossed, ``steps``.

    Raises
    ------
    DeclarationError
        If an argument is wrong.
    """
    import xarray as xr

    start, end = check_span(system.span if t_span is None else t_span)
    given_initial, given_parameters = columns(initial, "initial"), columns(parameters, "parameters")
    count = common_length({**given_initial, **given_parameters})
    base = pose(system, {}, rtol, atol)
    states = np.tile(base.initial_state({k: float(v[0]) for k, v in given_initial.items()}), (count, 1))
    for name, values in given_initial.items():
        states[:, system.declaration.state.index(name)] = values
    problems, group = groups(base, given_parameters, count)
    lanes = run(problems, group, states, start, end, max_events, workers or os.cpu_count() or 1)
    data = {
        name: ("trajectory", np.broadcast_to(v, count).copy())
        for name, v in {**given_initial, **given_parameters}.items()
    }
    data |= {f"final_{name}": ("trajectory", lanes.now.y[:, i]) for i, name in enumerate(system.declaration.state)}
    labels = {o.code: o.label.replace(" ", "_") for o in Outcome}
    flags = {"flag_values": np.array(list(labels), np.int8), "flag_meanings": " ".join(labels.values())}
    data |= {
        "time": ("trajectory", lanes.now.clock[:, 0], {"units": system.time_unit or "1"}),
        "outcome": ("trajectory", lanes.codes.astype(np.int8), flags),
        "switches": ("trajectory", lanes.now.counters[:, 1]),
        "kinks": ("trajectory", lanes.now.counters[:, 3]),
        "steps": ("trajectory", lanes.now.counters[:, 4]),
    }
    return xr.Dataset(data, attrs={"title": system.title or system.name, "source": system.source})


def run(problems: list[Problem], group: Array, states: Array, start: float, end: float, max_events: int, workers: int):
    """Advance all lanes to their end; the closed forms they need are made in between."""
    from stickslip.motion.lanes import Lanes

    lanes = Lanes.start(problems, group, states, start, end, BATCH_SLOTS)
    parts = [slice(i, i + PIECE) for i in range(0, len(states), PIECE)]
    with ThreadPoolExecutor(workers) as pool:
        while len(lanes.going):
            lanes.make_closed_forms()
            list(pool.map(lambda part: lanes.advance(end, max_events, None, part), parts))
    return lanes


def columns(given: Mapping[str, ArrayLike] | None, where: str) -> dict[str, Array]:
    """What was given as 1-D float arrays."""
    result = {}
    for name, values in (given or {}).items():
        try:
            column = np.atleast_1d(np.asarray(values, dtype=float))
        except (TypeError, ValueError):
            raise DeclarationError(
                f"{where}.{name}", f"{values!r} is not numeric", "Give a number or a 1-D array"
            ) from None
        if column.ndim != 1 or len(column) == 0 or not np.all(np.isfinite(column)):
            raise DeclarationError(
                f"{where}.{name}", "not a 1-D array of finite numbers", "Give a number or a 1-D array"
            )
        result[name] = column
    return result


def common_length(given: Mapping[str, Array]) -> int:
    """Number of motions."""
    lengths = {len(v) for v in given.values()} - {1}
    if len(lengths) > 1:
        raise DeclarationError(
            "initial, parameters", f"arrays of different lengths {sorted(lengths)}", "Give arrays of one length"
        )
    return lengths.pop() if lengths else 1


def groups(base: Problem, parameters: Mapping[str, Array], count: int) -> tuple[list[Problem], Array]:
    """One problem per distinct set of parameters, and the group of each motion."""
    if not parameters:
        return [base], np.zeros(count, np.int64)
    table = np.column_stack([np.broadcast_to(v, count) for v in parameters.values()])
    sets, group = np.unique(table, axis=0, return_inverse=True)
    problems = []
    for row in sets:
        values = {**base.parameters, **dict(zip(parameters, map(float, row), strict=True))}
        base.system.declaration.check_parameters(values)
        problems.append(Problem(base.system, values, base.order, base.tolerance, base.atol, base.exact))
    return problems, np.ascontiguousarray(group.reshape(-1).astype(np.int64))
