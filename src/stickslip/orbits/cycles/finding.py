"""From a state, a motion or another cycle to the cycle that is near it, or that it settles on.

A motion is followed until it comes back; Newton's method then closes it. What is said of a motion
that does not come back is what was seen: that it rests is said where it is proved
(:mod:`stickslip.orbits.cycles.resting`), that it is irregular with its largest Lyapunov exponent.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from stickslip.errors import ConvergenceError
from stickslip.motion.outcome import Outcome
from stickslip.motion.problem import Problem, pose
from stickslip.orbits.cycles.lyapunov import Exponent, largest_exponent
from stickslip.orbits.cycles.period import shortest
from stickslip.orbits.cycles.resting import comes_to_rest
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.fields.symmetry import clock
from stickslip.orbits.return_map.damped_newton import Closed, NotClosed, converge, near
from stickslip.orbits.return_map.families import Family, check_isolated, family_of, members_beside
from stickslip.orbits.return_map.recurrence import Recurrence, Window, earliest, latest, window
from stickslip.orbits.return_map.shooting import NoReturn, Shooting, follow_freely

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

Array = np.ndarray

NEARBY = 0.05  # a start that returns this close, relative to its motion, is near a cycle
SETTLED = 1e-3  # a motion that returns this close has settled
ROUNDS = 7  # the time a motion is given to settle doubles so many times
# a cycle this far from the motion it was found from, relative to its size, is another one
AGREES = 0.3
# a cycle that has shrunk to this part of the motion it was found from is an equilibrium
COLLAPSED = 1e-4
NEARLY = 2.0  # returns that miss by this many times the least are as good
REPELS = 1e-6  # no motion settles on a cycle with a multiplier this far outside the unit circle
DIES_OUT = 1e-2  # a motion whose extent has fallen to this part dies out


def from_cycle(start: Closed, time: float, parameters: Mapping[str, float] | None) -> Closed:
    """The cycle that another one becomes at other parameters."""
    old = start.orbit
    problem = pose(old.problem.system, {**old.problem.parameters, **(parameters or {})})
    pieces = Pieces(problem.compiled.equations)
    w = window(old.motion, pieces)
    y = old.legs[0].place.state
    found = Recurrence(time, y, old.period, start.shooting.setting.turns, old.shift, 0.0)
    if w.clock is not None:
        # Drives may act that were off, and the other way round.
        now = clock(problem.system, problem.compiled.equations, problem.parameters)
        values = old.problem.parameters
        one = now.period({**values, **dict.fromkeys(now.zero, 0.0)})
        before = found.turns * w.clock.period(values)
        turns = max(round(before / one), 1)
        found = replace(found, turns=turns, shift=turns * one / before * old.shift)
        w = replace(w, clock=now)
        found = replace(found, period=turns * now.period(problem.parameters))
    try:
        return accepted(*near(problem, pieces, w, found))
    except Family:
        raise
    except ConvergenceError as failure:
        raise ConvergenceError(
            failure.where, failure.reached, "Take smaller steps, or use continue_cycle"
        ) from None


def accepted(shooting: Shooting, x: Array) -> Closed:
    """Close a cycle and see that it is the one that was meant, isolated, once around.

    Raises
    ------
    Family
        If it belongs to a family, or the motion creeps towards the edge of one.
    ConvergenceError
        If it does not close, or closes elsewhere.
    """
    try:
        closed = converge(shooting, x)
    except NotClosed as failure:
        members = members_beside(failure)
        if members and all(_elsewhere(member, shooting, x) == "" for member in members):
            raise family_of(members) from None
        raise
    other = _elsewhere(closed, shooting, x)
    if other:
        raise ConvergenceError(
            f"a cycle of {shooting.problem.system.name}",
            f"Newton's method left the motion it started from for {other}",
            "Start nearer to the cycle, or with a motion that has settled",
        )
    check_isolated(closed)
    return shortest(closed)


def _elsewhere(closed: Closed, shooting: Shooting, x: Array) -> str:
    """What a cycle is that is not the one near the motion it was found from; empty if it is."""
    if closed.extent < COLLAPSED:
        return "an equilibrium"
    change = abs(math.log(closed.orbit.period / x[shooting.time]))
    if change > AGREES or closed.distance(shooting.stations[0].origin, shooting.start) > AGREES:
        return f"another, of period {closed.orbit.period:.6g}"
    return ""


def from_motion(motion: Trajectory) -> Closed:
    """The cycle a motion has settled on."""
    pieces = Pieces(motion._problem.compiled.equations)
    if motion.outcome is Outcome.AT_REST or len(motion.knots.time) < 2:
        raise _at_rest(motion, motion.knots.state[-1])
    k = motion.knots
    w = window(
        motion, pieces, max(0, int(np.searchsorted(k.time, 0.5 * (k.time[0] + k.time[-1]))) - 1)
    )
    rest = comes_to_rest(w, pieces)
    if rest is not None:
        raise _at_rest(motion, rest)
    found = latest(w, pieces)
    least = min((r.distance for r in found), default=np.inf)
    if least > AGREES:
        miss = f"at best to {least:.2g} of its size" if found else "not once"
        raise ConvergenceError(
            f"a cycle of {motion.system.name}",
            f"the motion until t = {motion.knots.time[-1]:.6g} comes back {miss}",
            "Simulate longer, until it has settled, or start from a state",
        )
    # A motion settles on a cycle that attracts; a shorter one next to it may repel, as after a
    # period doubling.
    closed, failure = None, None
    for recurrence in (r for r in found if r.distance <= max(SETTLED, NEARLY * least)):
        try:
            closed = accepted(*near(motion._problem, pieces, w, recurrence))
        except ConvergenceError as caught:
            failure = failure or caught
            continue
        if not repels(closed):
            break
    if closed is None:
        assert failure is not None
        raise failure
    return closed


def repels(closed: Closed) -> bool:
    """Whether no motion settles on a cycle."""
    return bool(np.any(np.abs(closed.spectrum.others) > 1.0 + REPELS))


def from_state(problem: Problem, state: Array, time: float) -> Closed:
    """The cycle near a state, stable or not, else the one that the motion from there settles on."""
    return _Search(problem, state, time).run()


def _at_rest(
    motion: Trajectory, rest: Array, before: ConvergenceError | None = None
) -> ConvergenceError:
    final = ", ".join(
        f"{name} = {value:.6g}" for name, value in zip(motion.final, rest, strict=True)
    )
    tried = f"; before that, {before.reached}" if before is not None else ""
    return ConvergenceError(
        f"a cycle of {motion.system.name}",
        f"the motion comes to rest: from t = {motion.knots.time[-1]:.6g} on it stays near "
        f"{final}{tried}",
        "Start with more energy, or choose parameters for which it keeps moving",
    )


class _Search:
    """Follow the motion from a state until it comes back."""

    def __init__(self, problem: Problem, state: Array, time: float) -> None:
        self.problem = problem
        self.state = state
        self.time = time
        self.pieces = Pieces(problem.compiled.equations)
        self.span = problem.system.span[1] - problem.system.span[0]
        self.best: tuple[Window, list[Recurrence]] | None = None
        self.modulus = np.zeros(len(state))
        self.extents: list[float] = []
        self.failure: ConvergenceError | None = None

    def run(self) -> Closed:
        w = None
        for turn in range(ROUNDS):
            motion = follow_freely(self.problem, self.time, self.time + self.span, self.state)
            if len(motion.knots.time) < 2:
                raise self._ended(motion)
            w = window(motion, self.pieces)
            closed = self._beside(w) if turn == 0 else None
            rest = comes_to_rest(w, self.pieces) if closed is None and motion.outcome.ok else None
            if rest is not None:
                raise _at_rest(motion, rest, self.failure)
            self.modulus = np.maximum(self.modulus, np.max(np.abs(w.states), axis=0))
            self.extents.append(w.extent(self.modulus))
            closed = closed or self._settled(w, latest(w, self.pieces), SETTLED)
            if closed is not None:
                return closed
            if not motion.outcome.ok:
                raise self._ended(motion)
            self.time = float(motion.knots.time[-1])
            self.state = motion.knots.state[-1]
            self.span = 2.0 * self.span
        assert w is not None
        exponent = largest_exponent(w.trajectory, self.pieces, w.sizes)
        # Irregular motion comes near many cycles, and settles on none.
        regular = exponent is None or not exponent.irregular
        closed = self._settled(*self.best, NEARBY) if self.best is not None and regular else None
        if closed is None:
            raise self._failed(exponent)
        return closed

    def _beside(self, w: Window) -> Closed | None:
        """The cycle, stable or not, that the motion starts beside."""
        for recurrence in earliest(w):
            if recurrence.distance <= NEARBY:
                closed = self._try(w, recurrence)
                # A motion that is brought to a cycle, as by a belt that carries it there, has not
                # begun beside it.
                if closed is not None and (
                    not repels(closed) or closed.distance(self.state, self.time) <= AGREES
                ):
                    return closed
        return None

    def _settled(self, w: Window, found: list[Recurrence], near_enough: float) -> Closed | None:
        """The cycle that the motion has settled on; one that repels only came near by chance.

        Raises
        ------
        Family
            If the motion has settled on one of a family.
        """
        if found and (self.best is None or found[-1].distance < self.best[1][-1].distance):
            self.best = w, found
        for recurrence in found:
            if recurrence.distance <= near_enough:
                closed = self._try(w, recurrence)
                if isinstance(self.failure, Family):
                    raise self.failure
                if closed is not None and not repels(closed):
                    return closed
        return None

    def _try(self, w: Window, found: Recurrence) -> Closed | None:
        """The cycle at a recurrence, if that is one."""
        try:
            return accepted(*near(self.problem, self.pieces, w, found))
        except ConvergenceError as failure:
            self.failure = failure
            return None

    def _ended(self, motion: Trajectory) -> ConvergenceError:
        return NoReturn(
            f"a cycle of {self.problem.system.name}",
            f"the motion from the start ends: {motion.message}",
        )

    def _failed(self, exponent: Exponent | None) -> ConvergenceError:
        """What was seen of a motion on which no cycle was found."""
        reached = f"no cycle was found within t = {self.time:.6g}: the motion comes back "
        if self.best is None:
            reached += "not once"
        else:
            closest = self.best[1][-1]
            reached += f"at best to {closest.distance:.2g} of its size, after {closest.period:.6g}"
        if self.extents[-1] < DIES_OUT * self.extents[0]:
            first, last = self.extents[0], self.extents[-1]
            reached += f"; it dies out: its extent fell from {first:.2g} to {last:.2g}"
        elif exponent is not None and exponent.irregular:
            reached += f"; the motion looks irregular: its largest Lyapunov exponent is {exponent}"
        elif self.failure is not None:
            reached += f"; {self.failure.reached}"
        return ConvergenceError(
            f"a cycle of {self.problem.system.name}", reached, "Start elsewhere, nearer to a cycle"
        )
