"""Search for the cycle near a state, a motion or another cycle, or for the limit cycle of the
motion.

A motion is followed until it has settled (:mod:`stickslip.orbits.settling`), as at every point of a
map; Newton's method then closes the cycle. Rest is reported only if it is proved. For a motion that
has not settled within its time, the message reports its closest return and, if it is irregular, its
largest Lyapunov exponent.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import ConvergenceError, DeclarationError, StickslipError, some
from stickslip.model.system import is_span_given
from stickslip.motion.outcome import Outcome
from stickslip.motion.problem import Problem, pose
from stickslip.numerics.ratios import ratio
from stickslip.orbits.cycles.lyapunov import Exponent, largest_exponent
from stickslip.orbits.cycles.period import shortest
from stickslip.orbits.fields.clock import clock
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.fields.stable_set import settle_friction
from stickslip.orbits.fields.symmetry import alike
from stickslip.orbits.return_map.damped_newton import Closed, NotClosed, converge, near
from stickslip.orbits.return_map.families import (
    Family,
    check_isolated,
    family_of,
    neighbouring_members,
)
from stickslip.orbits.return_map.following import NoReturn, follow_freely
from stickslip.orbits.return_map.recurrence import (
    Recurrence,
    Window,
    after,
    earliest,
    latest,
    window,
)
from stickslip.orbits.return_map.shooting import Setting, Shooting, parameter_values
from stickslip.orbits.return_map.slopes import cycle_slope
from stickslip.orbits.settling.single import Settled, settle_motion

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory


_NEARBY = 0.05  # a start that returns this close, relative to its motion, is near a cycle
_SETTLED = 1e-3  # a motion that returns this close at the end of its time has nearly converged
LAST_SPANS = 27.0  # number of spans over which such a motion is examined
_FAR = 1.0  # a cycle that has moved farther, relative to its size, is not extrapolated
_ROUNDS = 3  # largest number of searches for transformations that leave the system unchanged
_PERIODS = 2.5  # number of periods of the limit cycle that are sampled
_STILL = 1e-13  # range of a component at rest, relative to its modulus
# a cycle this far from the motion it was found from, relative to its size, is another one
_AGREES = 0.3
# a cycle that has shrunk to this part of the motion it was found from is an equilibrium
_COLLAPSED = 1e-4
_REPELS = 1e-6  # no motion converges to a cycle with a multiplier this far outside the unit circle
_LOOK = 0.01  # fraction of the span over which the velocity of a steady motion is measured
_STEADY = 1e-10  # change of the state, relative to it, that is regarded as zero
_TURNS = 100.0  # periods of a drive that are simulated first, if no time span is given
_DIES_OUT = 1e-2  # a motion whose extent has decreased to this fraction decays


def from_cycle(start: Closed, parameters: Mapping[str, float] | None) -> Closed:
    """A cycle continued to other parameters."""
    old = start.orbit
    time = start.shooting.start
    problem = pose(old.problem.system, {**old.problem.parameters, **(parameters or {})})
    pieces = start.shooting.pieces.with_free()
    setting = start.shooting.setting
    w: Window | Setting
    if setting.surroundings.contain(old.motion.knots):
        w = replace(setting, symmetry=setting.at(old.problem))
    else:
        w = window(old.motion, pieces)
    y = old.legs[0].place.state
    found = Recurrence(time, y, old.period, start.shooting.setting.turns, old.shift, 0.0)
    if w.clock is not None:
        # Drives that were off may act, and vice versa.
        now = clock(problem.system, problem.compiled.equations, problem.parameters)
        values = old.problem.parameters
        one = now.period({**values, **dict.fromkeys(now.zero, 0.0)})
        before = found.turns * w.clock.period(values)
        turns = max(round(before / one), 1)
        found = replace(found, turns=turns, shift=turns * one / before * old.shift)
        w = replace(w, clock=now)
        found = replace(found, period=turns * now.period(problem.parameters))
    found = _extrapolated(start, found, problem.parameters) or found
    # To first order a contact that slides without mass stays on a tangent of its limit surface.
    states = found.state[None, :].copy()
    settle_friction(problem.compiled.equations, problem.parameters, states, found.time)
    found = replace(found, state=states[0])
    try:
        return accepted(*near(problem, pieces, w, found))
    except Family:
        raise
    except ConvergenceError as failure:
        raise ConvergenceError(
            failure.where, failure.reached, "Use smaller steps, or continue_cycle"
        ) from None


def _extrapolated(
    start: Closed, found: Recurrence, parameters: Mapping[str, float]
) -> Recurrence | None:
    """First-order extrapolation of a cycle to other parameters; None if they are far away, or
    additional drives act there."""
    old, setting = start.orbit, start.shooting.setting
    if found.turns != setting.turns:
        return None
    steps = {
        name: value - old.problem.parameters[name]
        for name, value in parameters.items()
        if value != old.problem.parameters[name]
    }
    try:
        slopes = {name: cycle_slope(start, name) for name in steps}
    except (StickslipError, np.linalg.LinAlgError):
        return None
    state = sum((steps[name] * slopes[name].state for name in steps), np.zeros(len(found.state)))
    period = old.period + sum(steps[name] * slopes[name].period for name in steps)
    shift = old.shift + sum(steps[name] * slopes[name].shift for name in steps)
    later = 0.0
    if setting.clock is not None:
        # Drives keep their phase: at a fixed time a motion turns with their frequency.
        place = start.shooting.stations[0]
        rate = place.piece.rates(found.time, found.state, parameter_values(old.problem))
        state = state + (period / old.period - 1.0) * found.time * rate
        later = (found.period / old.period - 1.0) * found.time
        period = found.period
    far = float(np.linalg.norm(state / setting.sizes))
    if not (far <= _FAR and abs(period / old.period - 1.0) <= _FAR):
        return None
    return replace(
        found, time=found.time + later, state=found.state + state, period=period, shift=shift
    )


def accepted(shooting: Shooting, x: Array) -> Closed:
    """Close a cycle and check that it is the requested one, isolated, and traversed once.

    Raises
    ------
    Family
        If the cycle belongs to a family, or the motion converges slowly to the boundary of one.
    ConvergenceError
        If Newton's method does not converge, or converges elsewhere.
    """
    try:
        closed = converge(shooting, x)
    except NotClosed as failure:
        members = neighbouring_members(failure)
        if members and all(_elsewhere(member, shooting, x) == "" for member in members):
            raise family_of(members) from None
        raise
    other = _elsewhere(closed, shooting, x)
    if other:
        raise ConvergenceError(
            f"a cycle of {shooting.problem.system.name}",
            f"Newton's method converged to a different solution, {other}",
            "Choose a start closer to the cycle, or a motion that has converged",
        )
    check_isolated(closed)
    return shortest(closed)


def _elsewhere(closed: Closed, shooting: Shooting, x: Array) -> str:
    """Description of a cycle that is not near the motion it was found from; empty if it is near."""
    if closed.extent < _COLLAPSED:
        return "an equilibrium"
    change = abs(math.log(closed.orbit.period / x[shooting.time]))
    if change > _AGREES or closed.distance(shooting.stations[0].origin, shooting.start) > _AGREES:
        return f"a cycle of period {closed.orbit.period:.6g}"
    return ""


def from_motion(motion: Trajectory) -> Closed:
    """The limit cycle of a motion, continued from its end."""
    k = motion.knots
    if motion.outcome is Outcome.AT_REST or len(k.time) < 2:
        raise _at_rest(motion.problem, float(k.time[-1]), k.state[-1])
    return _Search(motion.problem, k.state[-1], float(k.time[-1])).run(beside=False)


def is_unstable(closed: Closed) -> bool:
    """Return whether a cycle is unstable."""
    return bool(np.any(np.abs(closed.spectrum.others) > 1.0 + _REPELS))


def from_state(problem: Problem, state: Array, time: float) -> Closed:
    """The cycle near a state, stable or not; otherwise the limit cycle of the motion from it."""
    return _Search(problem, state, time).run(beside=True)


def _at_rest(
    problem: Problem,
    time: float,
    rest: Array,
    before: ConvergenceError | None = None,
    velocity: Array | None = None,
) -> ConvergenceError:
    """Error for a motion that comes to rest, possibly in a moving frame.

    Parameters
    ----------
    rest : array, shape (n,)
    before : ConvergenceError, optional
        What was tried before.
    velocity : array, shape (n,), optional
        Of the frame.
    """
    names = problem.system.declaration.state
    final = some([f"{name} = {value:.6g}" for name, value in zip(names, rest, strict=True)], 8)
    tried = f"; before that, {before.reached}" if before is not None else ""
    moved = (
        {n: v for n, v in zip(names, velocity, strict=True) if v} if velocity is not None else {}
    )
    along = some([f"{name} at speed {v:.6g}" for name, v in moved.items()], 8)
    return ConvergenceError(
        f"a cycle of {problem.system.name}",
        (
            f"the motion becomes steady: from t = {time:.6g} it translates uniformly, {along}, "
            f"from {final}{tried}"
            if moved
            else f"the motion comes to rest: from t = {time:.6g} it stays near {final}{tried}"
        ),
        "Choose a start with more energy, or parameters for which the motion does not stop",
    )


def _first_look(problem: Problem) -> float:
    """Duration of the first part of a motion: the time span of its system or, if none is given,
    some periods of its drives."""
    begin, end = problem.system.span
    if is_span_given(problem.system.span):
        return end - begin
    try:
        drives = clock(problem.system, problem.compiled.equations, problem.parameters)
        return min(end - begin, _TURNS * drives.period(problem.parameters))
    except DeclarationError:  # no drives, or no periodic ones
        return end - begin


class _Search:
    """Search for the cycle near a state, or the limit cycle of the motion from it."""

    def __init__(self, problem: Problem, state: Array, time: float) -> None:
        self.problem = problem
        self.state = state
        self.time = time
        self.pieces = Pieces(problem.compiled.equations)
        self.span = _first_look(problem)
        self.failure: ConvergenceError | None = None

    def run(self, beside: bool) -> Closed:
        """Close a cycle.

        Raises
        ------
        ConvergenceError
            If no cycle is found; the message describes the end of the motion.
        """
        w = self._window(self.time, self.state, self.span)
        closed = self._beside(w) if beside else None
        if closed is not None:
            return closed
        if not w.trajectory.outcome.ok:
            raise self._ended(w.trajectory.message)
        settled, along = self._settle(w)
        reached = self.time + settled.elapsed
        if settled.outcome in (Outcome.AT_REST, Outcome.STEADY):
            raise self._rests(reached, settled, along)
        if settled.outcome is Outcome.PERIODIC:
            if not along.extent(np.max(np.abs(along.states), axis=0)) > _STILL:
                raise self._rests(reached, settled, along)
            closed = self._tried(along, [after(along, self.pieces, settled.period)])
        elif settled.outcome is Outcome.UNDAMPED:
            self._tried(w, earliest(w))
            raise self.failure if isinstance(self.failure, Family) else self._undamped()
        elif settled.outcome is not Outcome.NOT_SETTLED:
            raise self._ended(
                f"{settled.outcome.label} at t = {reached:.9g}: {settled.outcome.message}"
            )
        return closed or self._nearest(settled, w)

    def _window(self, time: float, state: Array, duration: float) -> Window:
        """The motion from a state, sampled."""
        motion = follow_freely(self.problem, time, time + duration, state)
        if len(motion.knots.time) < 2:
            raise self._ended(motion.message)
        return window(motion, self.pieces)

    def _settle(self, w: Window) -> tuple[Settled, Window]:
        """The attractor of a motion, and some periods of it; symmetries are determined again at the
        state that it reaches."""
        settled = settle_motion(self.problem, self.time, self.state, w.symmetry, w.clock)
        for _ in range(_ROUNDS):
            if settled.outcome is not Outcome.PERIODIC:
                break
            along = self._window(settled.time, settled.state, _PERIODS * settled.period)
            if alike(along.symmetry, w.symmetry):
                return settled, along
            w = along
            settled = settle_motion(self.problem, settled.time, settled.state, w.symmetry, w.clock)
        return settled, w

    def _beside(self, w: Window) -> Closed | None:
        """The cycle, stable or not, near the start of the motion."""
        for recurrence in earliest(w):
            if recurrence.distance <= _NEARBY:
                closed = self._try(w, recurrence)
                # A motion that is driven to a cycle, as by a belt, did not start near it.
                if closed is not None and (
                    not is_unstable(closed) or closed.distance(self.state, self.time) <= _AGREES
                ):
                    return closed
        return None

    def _tried(self, w: Window, found: Sequence[Recurrence]) -> Closed | None:
        """The first cycle at some recurrences that is not unstable: a motion that returns near an
        unstable cycle does so by chance.

        Raises
        ------
        Family
            If the motion has settled on a cycle of a family.
        """
        for recurrence in found:
            closed = self._try(w, recurrence)
            if isinstance(self.failure, Family):
                raise self.failure
            if closed is not None and not is_unstable(closed):
                return closed
        return None

    def _try(self, w: Window, found: Recurrence) -> Closed | None:
        """The cycle at a recurrence, if there is one."""
        try:
            return accepted(*near(self.problem, self.pieces, w, found))
        except ConvergenceError as failure:
            self.failure = failure
            return None

    def _nearest(self, settled: Settled, first: Window) -> Closed:
        """The cycle near a motion that has not settled within its time, if the motion nearly
        returns.

        Raises
        ------
        ConvergenceError
            If it does not; the message reports the observations.
        """
        w = self._window(settled.time, settled.state, LAST_SPANS * self.span)
        if not w.trajectory.outcome.ok:
            raise self._ended(w.trajectory.message)
        found = latest(w, self.pieces)
        closed = self._tried(w, [r for r in found if r.distance <= _SETTLED])
        if closed is not None:
            return closed
        exponent = largest_exponent(w.trajectory, self.pieces, w.sizes)
        # An irregular motion comes close to many cycles and converges to none.
        if exponent is None or not exponent.irregular:
            closed = self._tried(w, [r for r in found if _SETTLED < r.distance <= _NEARBY])
            if closed is not None:
                return closed
        modulus = np.maximum(*(np.max(np.abs(part.states), axis=0) for part in (first, w)))
        extents = first.extent(modulus), w.extent(modulus)
        until = self.time + settled.elapsed + LAST_SPANS * self.span
        raise self._failed(until, found[-1] if found else None, extents, exponent)

    def _rests(self, time: float, settled: Settled, w: Window) -> ConvergenceError:
        velocity = w.symmetry.frame
        if settled.outcome is Outcome.STEADY and w.symmetry.shifts.shape[1]:
            # Along a translation, too.
            motion = follow_freely(
                self.problem, settled.time, settled.time + _LOOK * self.span, settled.state
            )
            times, states = motion.knots.time[[0, -1]], motion.knots.state[[0, -1]]
            shift, size = states[1] - states[0], np.abs(states).max(axis=0)
            moved = np.abs(shift) > _STEADY * size
            velocity = ratio(np.where(moved, shift, 0.0), float(times[1] - times[0]))
        return _at_rest(self.problem, time, settled.state, self.failure, velocity)

    def _ended(self, message: str) -> ConvergenceError:
        return NoReturn(
            f"a cycle of {self.problem.system.name}", f"the motion from the start ends: {message}"
        )

    def _undamped(self) -> ConvergenceError:
        return ConvergenceError(
            f"a cycle of {self.problem.system.name}",
            "the motion continues without further events, with an undamped oscillation that "
            "neither decays nor grows",
            "Add damping, or choose a start without this oscillation",
        )

    def _failed(
        self,
        until: float,
        closest: Recurrence | None,
        extents: tuple[float, float],
        exponent: Exponent | None,
    ) -> ConvergenceError:
        """Observations of a motion on which no cycle was found."""
        reached = f"no cycle was found within t = {until:.6g}: the motion "
        reached += (
            f"returns at best to within {closest.distance:.2g} of its size, after "
            f"{closest.period:.6g}"
            if closest is not None
            else "never returns"
        )
        if extents[1] < _DIES_OUT * extents[0]:
            reached += (
                f"; it decays: its extent decreased from {extents[0]:.2g} to {extents[1]:.2g}"
            )
        elif exponent is not None and exponent.irregular:
            reached += f"; the motion appears chaotic: its largest Lyapunov exponent is {exponent}"
        elif self.failure is not None:
            reached += f"; {self.failure.reached}"
        return ConvergenceError(
            f"a cycle of {self.problem.system.name}",
            reached,
            "Choose a start closer to a cycle, or start from a cycle at other parameters, which "
            "also works if convergence is slow",
        )
