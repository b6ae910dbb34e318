"""The search for a cycle: from a motion, a state, another cycle or a Hopf point."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.model.system import System
from stickslip.motion.problem import Problem, pose
from stickslip.motion.simulate import with_span
from stickslip.orbits.continuation.branch import SpecialPoint
from stickslip.orbits.cycles.cycle import Cycle, make_cycle
from stickslip.orbits.cycles.finding import from_cycle, from_motion, from_state
from stickslip.results import Result
from stickslip.stopping.scopes import limited

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory


@validated
def find_cycle(
    system: System,
    start: Trajectory | Cycle | SpecialPoint | Mapping[str, float] | ArrayLike | None = None,
    *,
    parameters: Mapping[str, float] | None = None,
    span: tuple[float, float] | None = None,
    time_limit: float | None = None,
) -> Cycle:
    """Find the cycle near a motion, a state, another cycle or a Hopf point.

    Parameters
    ----------
    system : System
    start : Trajectory, Cycle, SpecialPoint, mapping of str to float, or array, optional
        From a motion that has converged, the cycle near its end is computed. From a state, the
        cycle near it, stable or unstable, is computed; if there is none, the motion from this state
        is simulated until it converges to a cycle. The start may also be a cycle at other
        parameters, or a Hopf point of a branch of equilibria, from which cycles emanate. By default
        it is the declared initial state. A motion continues from its end, a state from the start of
        the declared span.
    parameters : mapping of str to float, optional
        Values that replace the defaults, or those of `start`. At a Hopf point the value of the
        branch parameter selects one of the cycles; by default a small one.
    span : (float, float), optional
        Time span that replaces the span of the system, for a start at a state: the motion starts at
        its beginning, and is abandoned after 100 times its length.
    time_limit : float, optional
        Wall-clock limit in seconds.

    Returns
    -------
    Cycle

    Raises
    ------
    DeclarationError
        If an argument is wrong, or the system depends on time aperiodically.
    ConvergenceError
        If the motion comes to rest, does not return, or Newton's method does not converge; if the
        cycles form a continuous family without a translation. The message reports what was tried
        and the closest approach. Its subclass :class:`stickslip.errors.TimeLimitError` is raised at
        the time limit.
    """
    if span is not None and isinstance(start, SpecialPoint | Result):
        reason = "a motion, a cycle or a Hopf point already defines the initial time"
        raise DeclarationError("span", reason, "Remove it, or give a state as the start")
    system = with_span(system, span)
    with limited(time_limit, f"a cycle of {system.name}"):
        return _found(system, start, parameters)


def _found(
    system: System,
    start: Trajectory | Cycle | SpecialPoint | Mapping[str, float] | ArrayLike | None,
    parameters: Mapping[str, float] | None,
) -> Cycle:
    """The cycle; see :func:`find_cycle`."""
    from stickslip.motion.trajectory import Trajectory

    if isinstance(start, SpecialPoint):
        from stickslip.orbits.cycles.hopf_switching import emanating_cycle

        return make_cycle(emanating_cycle(system, start, parameters))
    if isinstance(start, Cycle):
        if start.system != system:
            raise DeclarationError(
                "start",
                f"the start is a cycle of {start.system.name}, not of {system.name}",
                "Use the same system",
            )
        return make_cycle(from_cycle(start.closed, parameters))
    if isinstance(start, Trajectory):
        if start.system != system:
            raise DeclarationError(
                "start",
                f"the start is a motion of {start.system.name}, not of {system.name}",
                "Use the same system",
            )
        if not parameters:
            return make_cycle(from_motion(start))
        k = start.knots
        problem = pose(system, {**start.parameters, **parameters})
        return make_cycle(from_state(problem, k.state[-1], float(k.time[-1])))
    problem = pose(system, parameters)
    return make_cycle(from_state(problem, _state(problem, start), system.span[0]))


def _state(problem: Problem, start: Mapping[str, float] | ArrayLike | None) -> Array:
    """State vector of the given start."""
    names = problem.system.declaration.state
    if start is None or isinstance(start, Mapping):
        return problem.initial_state(start or {})
    try:
        y = np.asarray(start, dtype=float)
    except (TypeError, ValueError, OverflowError):
        y = np.zeros(0)
    if y.shape != (len(names),):
        raise DeclarationError(
            "start", "not a state", f"Give values of {', '.join(names)}, a motion or a Hopf point"
        )
    return problem.initial_state(dict(zip(names, map(float, y), strict=True)))
