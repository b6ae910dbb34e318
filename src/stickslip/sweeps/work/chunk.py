"""A chunk of points of a map: every motion is followed until it has settled and is then measured,
in compiled loops."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from stickslip.arrays import Array
from stickslip.model.system import System
from stickslip.motion.outcome import Outcome
from stickslip.motion.problem import Problem
from stickslip.motion.simulate_many import (
    columns,
    common_length,
    initial_states,
    lanes_of_block,
    parameter_table,
    pose_all,
)
from stickslip.motion.starts import put_on_contacts
from stickslip.orbits.fields.stable_set import excess, settle_friction
from stickslip.orbits.settling.engine.tables import ENERGY, LAW, MOTION, make_found
from stickslip.orbits.settling.motions import POINT_SLOTS, Block, Here, Observed, Settings
from stickslip.stopping.scopes import TimeUp, watching
from stickslip.sweeps.request.measures import (
    certified_below,
    ends_with_samples,
    measured,
    measured_again,
    needs_close_look,
)


def measure_chunk(
    system: System,
    initial: Mapping[str, Array],
    parameters: Mapping[str, Array],
    measures: Sequence[str],
    settings: Settings,
    device: str = "cpu",
    section: bool = False,
    start: float | None = None,
    time_limit: float | None = None,
) -> dict[str, Array]:
    """Measures of settled motions.

    Parameters
    ----------
    initial, parameters : mapping of str to array, shape (points,)
        Values that vary; numbers hold for all points. The result of a point does not depend on the
        others.
    measures : sequence of str
        See :mod:`stickslip.sweeps.request.measures`.
    device : str
        ``"cpu"`` or ``"gpu"``.
    section : bool
        Whether the points are states of a section, which share their parameters (and so their
        closed forms); a state outside the stable set starts at the nearest stable state.
    start : float, optional
        Start time of the motions; by default that of the span of the system.
    time_limit : float, optional
        Processor-time limit of each point in seconds.

    Returns
    -------
    dict of str to array, shape (points,)
        By measure; NaN if undefined. Always also ``outcome`` (codes of
        :class:`stickslip.motion.outcome.Outcome`); ``certificate``, the largest of the residual of
        the energy balance, the violation of the friction law, the defect of the equations of
        motion, the closure error, and a number that exceeds the tolerance if a shorter period
        closes within it; ``lacking``, the failed criterion of a certificate
        (:data:`stickslip.sweeps.request.measures.MISSING`); and ``excess``, the violation of |∂Φ| ≤
        s by the initial state.

    Raises
    ------
    DeclarationError
        If a name, a value or a measure is wrong, or there is no such device.
    Stopped
        If a stop was requested.
    """
    starts, given = columns(initial, "initial"), columns(parameters, "parameters")
    count = common_length({**starts, **given})
    table, states = parameter_table(system, given, count), initial_states(system, starts, count)
    origin = system.span[0] if start is None else start
    problem = replace(pose_all(system, given, settings.rtol, settings.atol), origin=origin)
    states = put_on_contacts(problem, origin, table, states)
    if section:
        settle_friction(problem.compiled.equations, problem.parameters, states, problem.origin)
    closely = needs_close_look(system, measures)
    if ends_with_samples(system):
        seen = _over_the_span(problem, table, states, settings, time_limit)
        again = measured_again(problem, table, seen, measures, settings, time_limit)
        return measured(problem, seen, measures, certified_below(settings)) | again
    exponents = "lyapunov" in measures
    if device == "gpu":
        from stickslip.sweeps.work.device import OnDevice, lanes_on_device

        lanes = lanes_on_device(problem, settings)
        loops = OnDevice
    else:
        lanes = count if section else lanes_of_block(problem, POINT_SLOTS)
        loops = Here
    # Threads of a GPU compute their closed forms at the same time, each separately.
    shared = section and device == "cpu"
    blocks = [slice(i, i + lanes) for i in range(0, count, lanes)]
    motions = (Block(problem, table[b], states[b], settings, closely, shared) for b in blocks)
    found = [block.run(loops, exponents, time_limit, classed=True) for block in motions]
    parts = list[dict[str, Array]]()
    for b, observed in zip(blocks, found, strict=True):
        # First: a motion that exceeds the time limit here has no other measures either.
        again = measured_again(problem, table[b], observed, measures, settings, time_limit)
        parts.append(measured(problem, observed, measures, certified_below(settings)) | again)
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _over_the_span(
    problem: Problem, table: Array, states: Array, settings: Settings, time_limit: float | None
) -> Observed:
    """Motions from the start to the end of the declared span, for drives that are defined for a
    limited time.

    Parameters
    ----------
    table, states : arrays, shapes (points, parameters) and (points, n)
    time_limit : float, optional
        Seconds of processor time that each may take.
    """
    from stickslip.motion.simulate import simulate

    system = problem.system
    names = system.declaration.state
    values = dict(zip(system.parameters, table.T, strict=True))
    beyond = excess(problem.compiled.equations, values, states, problem.origin)
    begin, end = system.span
    found = make_found(len(states), len(names), len(problem.rows.u))
    outcome = np.full(len(states), Outcome.OUTSIDE.code)
    for i in np.flatnonzero(beyond == 0.0):
        with watching(time_limit, processor=True) as scope:
            try:
                motion = simulate(
                    system,
                    initial=dict(zip(names, states[i].tolist(), strict=True)),
                    parameters=dict(zip(system.parameters, table[i].tolist(), strict=True)),
                    rtol=settings.rtol,
                    atol=settings.atol,
                    max_events=settings.max_events,
                )
                sums = motion.audit.sums
            except TimeUp as up:
                if not scope.ends(up):
                    raise
                outcome[i] = Outcome.TIME_UP.code
                continue
        outcome[i] = motion.outcome.code
        for whole, own in zip(found.sums, sums, strict=True):
            whole[i] = own
        found.shift[i] = motion.knots.state[-1] - motion.knots.state[0]
        balance, law, equations, rounding = motion.audit.residuals
        found.audit[i, [ENERGY, LAW, MOTION]] = balance, law, max(equations, rounding)
        if np.any(motion.audit.open > 0.0):
            found.audit[i, MOTION] = np.inf
    along = np.array([float(system.plain.translation.get(name, 0.0)) for name in names])
    count = len(states)
    times = np.full(count, begin), states, np.full(count, end - begin)
    return Observed(outcome, *times, along, found, beyond)
