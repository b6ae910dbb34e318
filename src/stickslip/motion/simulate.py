"""From a system and initial values to its motion."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.model.system import System
from stickslip.motion.outcome import Outcome
from stickslip.motion.problem import Problem, pose
from stickslip.motion.record.knots import Knots
from stickslip.motion.starts import (
    check_contacts,
    check_stable_start,
    numbers_of,
    put_on_contacts,
)
from stickslip.progress import reporting
from stickslip.stopping.scopes import TimeUp, check_limit, watching

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

_CHUNK = 4096  # steps between progress reports
_CHUNK_BYTES = 2**26  # largest number of bytes of a chunk of knots
# outcomes of a motion that cannot start
_NOWHERE = (Outcome.NO_BOUNDED_RATE, Outcome.NO_MODE, Outcome.NO_ACCELERATION)


@validated
def simulate(
    system: System,
    t_span: tuple[float, float] | None = None,
    *,
    initial: Mapping[str, float] | None = None,
    parameters: Mapping[str, float] | None = None,
    rtol: float = 1e-10,
    atol: float = 1e-12,
    max_events: int = 1_000_000,
    flow: Literal["auto", "taylor"] = "auto",
    time_limit: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> Trajectory:
    """Compute the motion of a system, with every switch at its exact time.

    Parameters
    ----------
    system : System
    t_span : (float, float), optional
        Start and end; by default the system's own span.
    initial : mapping of str to float, optional
        Initial values of coordinates, rates ``d_x`` of inertial coordinates and internal variables;
        others have their declared default, or 0.
    parameters : mapping of str to float, optional
        Values that replace the defaults.
    rtol, atol : float
        Relative and absolute tolerance, from 1e-13 to 1e-3 and from 1e-30 to 1. The local error of
        a step is below rtol times the size of the motion plus atol, divided by 1000; unless
        neighbouring motions diverge, the error of the motion is then usually below that sum. An
        atol below 1e-6 rtol acts as 1e-6 rtol. Residuals of the certificate have the limit 10 rtol,
        or 1e-9 if that is larger; a large atol may violate it.
    max_events : int
        Limit on the number of events.
    flow : str
        ``"auto"``: in closed form where a mode is affine, else by Taylor series. ``"taylor"``:
        always by Taylor series, for comparison.
    time_limit : float, optional
        Wall-clock limit in seconds; the motion computed so far is returned.
    progress : callable, optional
        Called repeatedly with the completed fraction.

    Returns
    -------
    Trajectory
        Returned in any case; its ``outcome`` describes how the computation ended.

    Raises
    ------
    DeclarationError
        If an argument is wrong, or the initial state violates |∂Φ| ≤ s of a rate-independent
        coordinate, a constraint, or a gap. Violations at the level of rounding errors are
        corrected.
    """
    from stickslip.motion.rest import rests_forever
    from stickslip.motion.trajectory import Trajectory

    started = time.perf_counter()
    start, end = check_span(system.span if t_span is None else t_span)
    system.declaration.check_span(start, end)
    if flow not in ("auto", "taylor"):
        raise DeclarationError("flow", f"{flow!r} is not a flow", 'Choose "auto" or "taylor"')
    problem = pose(system, parameters, rtol, atol, exact=flow == "auto", origin=start)
    y = problem.initial_state(initial or {})
    y = put_on_contacts(problem, start, numbers_of(problem), y[None])[0]
    check_positive(max_events=max_events)
    check_limit(time_limit)
    with watching(time_limit) as scope:
        with reporting(progress, f"motion of {system.name}") as show:
            most = max_events + system.declaration.kinks_known(start, end)
            code, knots, ended = run_loop(problem, start, end, y, most, show)
        if ended is not None and not scope.ends(ended):
            raise ended
    outcome = Outcome.from_code(code)
    if outcome in _NOWHERE and len(knots.clock) == 1:
        check_contacts(problem, start, y)
        check_stable_start(problem, start, y)
    if outcome is Outcome.FINISHED and rests_forever(problem, knots):
        outcome = Outcome.AT_REST
    trajectory = Trajectory(problem, (start, end), knots, outcome, rtol, y)
    trajectory.wall_time = time.perf_counter() - started
    return trajectory


def check_positive(**given: object) -> None:
    """Reject numbers of events or workers that are none."""
    for name, value in given.items():
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
            raise DeclarationError(name, f"{value!r} is not a positive integer", "Give at least 1")


def check_span(span: object, where: str = "t_span") -> tuple[float, float]:
    """Reject a time span that is none."""
    try:
        start, end = (float(s) for s in span)  # type: ignore[union-attr]
    except (TypeError, ValueError, OverflowError):
        raise DeclarationError(where, f"{span!r} is not a time span", "Give (start, end)") from None
    if not (math.isfinite(start) and math.isfinite(end) and start < end):
        raise DeclarationError(
            where, f"({start:g}, {end:g}) is not a time span", "Give start < end, both finite"
        )
    return start, end


def with_span(system: System, span: tuple[float, float] | None) -> System:
    """The same system over another time span, if one is given.

    Raises
    ------
    DeclarationError
        If it is invalid, or a drive does not cover it.
    """
    return system if span is None else replace(system, span=check_span(span, "span"))


def run_loop(
    problem: Problem,
    start: float,
    end: float,
    y: Array,
    max_events: int,
    progress: Callable[[float], None] | None = None,
) -> tuple[int, Knots, BaseException | None]:
    """Run the compiled loop in chunks; if Ctrl-C or a time limit ends it, the part computed so far
    is kept.

    The compiled loops count time from the origin of the problem.

    Parameters
    ----------
    y : array, shape (n,)
        State at the start.
    progress : callable, optional
        Receives the completed fraction of the span.

    Returns
    -------
    code : int
        Of an :class:`Outcome`.
    ended : KeyboardInterrupt, TimeUp or None
        What ended it, if it is one of these.
    """
    from stickslip.motion.ensemble import Lanes
    from stickslip.motion.steps.arrays import FULL, NOW, Constants

    constants = Constants(*(part[None] for part in problem.constants))
    begin, end = start - problem.origin, end - problem.origin
    lanes = Lanes.start(
        problem, constants, np.zeros(1, np.int64), y[None], (begin, end), problem.closed_forms
    )
    clock = lanes.now.clock[0]
    contacts = lanes.now.mode.shape[1]
    kinks = lanes.now.reg.shape[1]
    pieces: list[Knots] = []
    counts: list[int] = []
    ended: BaseException | None = None
    most = min(_CHUNK, _CHUNK_BYTES // (8 * len(y) + contacts + kinks + 16) + 1)
    size = 64
    try:
        while lanes.codes[0] >= FULL:
            size = min(2 * size, most)
            record = Knots.empty(size, len(y), contacts, kinks, problem.origin)
            record.clock.fill(np.nan)
            pieces.append(record)
            counts.append(lanes.advance(end, max_events, record.record))
            if progress is not None:
                progress((clock[NOW] - begin) / (end - begin))
        code = int(lanes.codes[0])
    except (KeyboardInterrupt, TimeUp) as why:
        ended = why
        code = (Outcome.TIME_UP if isinstance(why, TimeUp) else Outcome.INTERRUPTED).code
        if len(counts) < len(pieces):  # the number of steps has not been recorded
            counts.append(int(np.count_nonzero(pieces[-1].clock <= clock[NOW])))
    pieces = [piece.first(count) for piece, count in zip(pieces, counts, strict=True)]
    knots = (
        Knots.joined(pieces) if pieces else Knots.empty(0, len(y), contacts, kinks, problem.origin)
    )
    if len(knots.clock) == 0 or clock[NOW] > knots.clock[-1]:
        now = lanes.now
        carried = now.mode[0] == now.settled[0]
        mode = np.sign(now.mode[0], out=now.mode[0].copy(), where=~carried)
        last = Knots.single(clock[NOW], now.y[0], mode, now.reg[0], problem.origin)
        knots = Knots.joined([knots, last])
    return code, knots, ended
