"""Proofs about motions without further events, on the host, for many motions at once.

*In an affine mode* every guard is c + c₁τ + Re Σ aⱼ exp(λⱼτ) + Re Σ bₘ exp(iωₘτ). If no excited
term grows and c exceeds Σ|a| + Σ|b|, no guard is ever reached, and the mode lasts forever: the
decaying terms can be omitted, and the remaining motion is rest, steady sliding or the response to a
drive. A term that neither grows nor decays is undamped.

*In any other mode* that does not depend on time, or in an affine one with repeated zeros of guards
that have no effect (a contact without friction), a motion whose rates have vanished is near an
equilibrium of its mode. It converges there if it cannot leave
(:mod:`stickslip.orbits.settling.resting`).

Both are proofs up to rounding, and both are sufficient, not necessary. If they fail, the motion
continues; at the end of its time, it has not settled.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stickslip.arrays import AnyArray as Array
from stickslip.motion.affine.forms import AFFINE, GUARDS
from stickslip.motion.outcome import Outcome
from stickslip.motion.steps.arrays import NOW
from stickslip.numerics.levels import GUARD_MARGIN, ROUNDED_SUM
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.settling.attraction import Attraction
from stickslip.orbits.settling.engine.tables import (
    ASK,
    COUNT,
    DURATION,
    FLOOR,
    LEAPT,
    MEASURING,
    OPEN,
    PATIENT,
    PHASE,
    PROVING,
    SETTLING,
)
from stickslip.orbits.settling.repetition import Repetition, repeats
from stickslip.orbits.settling.resting import MotionPoint, rest_near

if TYPE_CHECKING:
    from stickslip.motion.ensemble import Lanes
    from stickslip.motion.problem import Problem
    from stickslip.motion.steps.arrays import Lane
    from stickslip.orbits.settling.engine.tables import Bench, Engine, Marks, Rules


_AT_REST = Outcome.AT_REST.code
_STEADY = Outcome.STEADY.code
_PERIODIC = Outcome.PERIODIC.code
_UNDAMPED = Outcome.UNDAMPED.code
_NOTHING = -1
_CENTRE = 1e-12  # real parts this small, relative to the largest eigenvalue, neither grow nor decay
_SEEN = 1e-9  # amplitude of an undamped component relative to its size
_LATER = 0.5  # fraction of the elapsed time after which a proof is tried again


class LongTermOutcomes(NamedTuple):
    """Long-term outcomes of some motions.

    Attributes
    ----------
    outcome : array of int, shape (motions,)
        NOTHING if unknown.
    limit : array, shape (motions, n)
        The state without decaying terms.
    """

    outcome: Array
    limit: Array


class Prover:
    """Proofs of long-term outcomes of motions of a system.

    Parameters
    ----------
    table : array, shape (motions, parameters)

    Attributes
    ----------
    acting : array of bool, shape (motions, frequencies)
        Active drives.
    parts : array of int, shape (motions,)
        Number of periods of the system after which its drives repeat, too: cos(2πx)·cos(2πy) is
        unchanged by a shift by half a cell along both.
    """

    def __init__(self, problem: Problem, table: Array, rules: Rules) -> None:
        self.problem = problem
        self.table = table
        self.rules = rules
        self.repetition: Repetition = Repetition(problem.compiled.equations)
        self.pieces: Pieces = Pieces(problem.compiled.equations)
        self.attraction: Attraction = Attraction(problem, self.pieces, table)
        self.acting: Array = self._acting()
        self.parts: Array = np.ones(len(table), int)

    def _acting(self) -> Array:
        frequencies = self.problem.compiled.layout.frequencies
        if frequencies == 0:
            return np.ones((len(self.table), 0), bool)
        names = np.array(list(self.problem.system.parameters), dtype=object)
        patterns, which = np.unique(self.table == 0.0, axis=0, return_inverse=True)
        acting = np.array(
            [self.repetition.equations.acting(frozenset(names[zero])) for zero in patterns]
        )
        return acting.reshape(-1, frequencies)[which.reshape(-1)]

    def prove(
        self,
        lanes: Lanes,
        engine: Engine,
        settling: tuple[Marks, Rules, Lane, Bench],
    ) -> None:
        """Decide all motions that wait for a proof: they are measured next, or continue.

        Parameters
        ----------
        engine : Engine
            Their compiled loop.
        """
        marks, _, saved, _ = settling
        self._reset(engine, settling)
        index = np.flatnonzero(marks.numbers[:, PHASE] == PROVING)
        if len(index) == 0:
            return
        asked = marks.outcome[index]
        outcome = np.full(len(index), _NOTHING)
        waves = [self.waves(int(i), marks, saved) for i in index]
        periods = np.where(marks.drive[index] > 0.0, marks.real[index, DURATION], 0.0)
        # A cycle lasts a number of periods, after each of which the system is the same.
        whole = periods * self.parts[index]
        fits = np.array(
            [repeats(found, float(period)) for found, period in zip(waves, whole, strict=True)]
        )
        cycles = (asked == _PERIODIC) & (fits | (not self.rules.timed))
        outcome[cycles] = _PERIODIC
        open_ = np.flatnonzero((asked != _PERIODIC) & [found is not None for found in waves])
        if len(open_):
            slot = saved_slots(lanes, index[open_], saved)
            closed = open_[slot >= 0]
            if len(closed):
                outcomes = affine_outcomes(
                    lanes, index[closed], slot[slot >= 0], marks, saved, self.rules.shifts
                )
                # the drives have to have a period in common
                unknown = (outcomes.outcome == _PERIODIC) & ~fits[closed]
                outcome[closed] = np.where(unknown, _NOTHING, outcomes.outcome)
                saved.y[index[closed]] = np.where(
                    unknown[:, None], saved.y[index[closed]], outcomes.limit
                )
            for i in open_[outcome[open_] == _NOTHING]:
                if asked[i] != _NOTHING and not waves[i]:
                    rest = rest_near(self.pieces, self.point(int(index[i]), marks, saved))
                    if rest is not None:
                        outcome[i] = asked[i]
        done = index[outcome != _NOTHING]
        late = index[outcome == _NOTHING]
        leapt = marks.numbers[late, LEAPT] > 0
        marks.outcome[index] = outcome
        marks.numbers[done, PHASE] = MEASURING
        marks.numbers[late, PHASE] = SETTLING
        proved = done[~cycles[outcome != _NOTHING]]
        marks.real[proved, FLOOR] = 0.0
        marks.real[proved, OPEN] = np.inf
        t = saved.clock[:, NOW]
        real = marks.real
        if not self.rules.timed:  # the clocks of driven motions are set back at every mark
            t = t + np.maximum(marks.numbers[:, COUNT] - 1, 0) * marks.drive
        real[late, ASK] = t[late] + np.maximum(
            _LATER * (t[late] - self.rules.real[0]), real[late, DURATION]
        )
        real[late, PATIENT] = np.inf
        marks.numbers[done, LEAPT] = 0
        marks.numbers[late[leapt], LEAPT] = -1
        for part, kept in zip(lanes.now, saved, strict=True):
            part[late] = kept[late]

    def _reset(self, engine: Engine, settling: tuple[Marks, Rules, Lane, Bench]) -> None:
        """Reset motions that do not converge to their extrapolated state."""
        marks = settling[0]
        claimed = (marks.numbers[:, PHASE] == PROVING) & (marks.numbers[:, LEAPT] > 0)
        if not np.any(claimed):
            return
        comes = self.attraction.prove(engine, settling)
        marks.outcome[claimed & ~comes] = _NOTHING
        marks.numbers[claimed & ~comes, PHASE] = SETTLING
        marks.numbers[claimed & ~comes, LEAPT] = -1

    def waves(self, i: int, marks: Marks, saved: Lane) -> frozenset[float] | None:
        """Frequencies of the time dependence of a motion from now on; None if it is more than sines
        and cosines."""
        if not self.problem.compiled.layout.timed:
            return frozenset()
        if self.repetition.plain and marks.drive[i] > 0.0:
            return frozenset([2.0 * np.pi / float(marks.drive[i])])
        names = list(self.problem.system.parameters)
        state = self.problem.compiled.layout.state
        values = dict(zip(names, map(float, self.table[i]), strict=True))
        frame = dict(zip(state, map(float, marks.frame[i]), strict=True))
        return self.repetition.waves(
            values, frame, self.problem.origin + float(saved.clock[i, NOW])
        )

    def point(self, i: int, marks: Marks, saved: Lane) -> MotionPoint:
        """State of a motion whose rates have decayed."""
        return MotionPoint(
            self.problem.origin + float(saved.clock[i, NOW]),
            saved.y[i],
            self.table[i],
            saved.mode[i].astype(np.int8),
            saved.reg[i].astype(np.int8),
            np.maximum(marks.size[i], np.abs(saved.y[i])),
            marks.frame[i],
            self.rules.shifts,
        )


def saved_slots(lanes: Lanes, index: Array, saved: Lane) -> Array:
    """Slots of the closed forms of the saved modes; −1 where there is none."""
    T, slots = lanes.forms, lanes.slots
    if slots == 0:
        return np.full(len(index), -1)
    key = np.ones(len(index), np.int64)
    for column in saved.mode[index].T:
        key = 3 * key + column + 1
    for column in saved.reg[index].T:
        key = 2 * key + column
    place = lanes.group[index][:, None] * slots + np.arange(slots)
    mine = (T.key[place] == key[:, None]) & (np.arange(slots) < T.used[lanes.group[index]][:, None])
    mine &= T.status[place] == AFFINE
    return np.where(np.any(mine, axis=1), place[:, 0] + np.argmax(mine, axis=1), -1)


def affine_outcomes(
    lanes: Lanes, index: Array, slot: Array, marks: Marks, saved: Lane, shifts: Array
) -> LongTermOutcomes:
    """Long-term outcomes of motions in affine modes, if the modes last.

    Parameters
    ----------
    index : array of int, shape (k,)
        Which lanes.
    slot : array of int, shape (k,)
        Slots of the closed forms of their modes.
    saved : Lane
        Where they are.
    shifts : array, shape (translations, n)
        Translations that leave the system unchanged.
    """
    T = lanes.forms
    y = saved.y[index]
    t = saved.clock[index, NOW]
    omega = lanes.constants.omega[lanes.group[index]]
    n = y.shape[1]
    angle = omega * t[:, None]
    waves = np.stack([np.cos(angle), np.sin(angle)], axis=2).reshape(len(index), -1)
    s = np.concatenate([y, np.ones((len(index), 1)), t[:, None], waves], axis=1)
    rate: Array = T.exponent[slot]
    spin = np.exp(1j * angle)
    first = T.c2.shape[1] - n
    r = np.einsum("kis,ks->ki", T.R[slot], s)
    terms = np.einsum("kis,ks->ki", np.abs(T.R[slot]), np.abs(s))
    r = np.where(np.abs(r) > ROUNDED_SUM * terms, r, 0.0)
    largest = np.max(np.abs(rate), axis=1, initial=0.0)[:, None]
    grows = np.any((r != 0.0) & (rate.real > _CENTRE * largest), axis=1)
    stays = (r != 0.0) & (np.abs(rate.real) <= _CENTRE * largest)
    # All signals as c + c₁τ + c₂τ², decaying or oscillating terms, and the response to the drives.
    fading = np.einsum("kgi,ki->kg", T.a[slot], r).real
    answer = np.einsum("kgm,km->kg", T.b[slot], spin).real
    drift = np.einsum("kgs,ks->kg", T.c1[slot], s)
    noise = np.einsum("kgs,ks->kg", np.abs(T.c1[slot]), np.abs(s))
    drift = np.where(np.abs(drift) > ROUNDED_SUM * noise, drift, 0.0)
    swing = np.einsum("kgi,ki->kg", T.swing[slot][:, :, :n], np.abs(r))
    driven = np.sum(T.swing[slot][:, :, n:], axis=2)
    value = np.einsum("kgs,ks->kg", T.G[slot], s)
    size = np.einsum("kgs,ks->kg", np.abs(T.G[slot]), np.abs(s))
    guard = np.arange(value.shape[1])
    real = np.arange(value.shape[1]) < T.counts[slot, GUARDS][:, None]
    reach = (swing + driven)[:, guard]
    margin = GUARD_MARGIN * size
    constant = value - (fading + answer)[:, guard]
    even = drift[:, guard]
    bent = T.c2[slot][:, guard]
    # A guard that is constant, even at zero, has no effect: it was admissible when the mode was
    # chosen.
    inert = (reach <= margin) & (even == 0.0) & (bent == 0.0) & (constant >= -margin)
    held = inert | ((constant - reach > margin) & (even >= 0.0) & (bent >= 0.0))
    lasts = ~grows & np.all(held | ~real, axis=1)
    component = slice(first, None)
    moving = drift[:, component] - marks.frame[index]
    for shift in shifts:
        weight = float(shift @ shift)
        moving -= np.outer(moving @ shift / weight, shift) if weight > 0.0 else 0.0
    even = np.all(
        np.abs(moving) <= ROUNDED_SUM * (noise[:, component] + np.abs(marks.frame[index])), axis=1
    )
    even &= np.all(T.c2[slot][:, component] == 0.0, axis=1)
    size = np.maximum(marks.size[index], np.abs(y))
    swinging = np.einsum("kgi,ki->kg", T.swing[slot][:, component, :n], np.abs(r) * stays)
    undamped = lasts & np.any(swinging > _SEEN * size, axis=1)
    answers = np.any(driven[:, component] > ROUNDED_SUM * size, axis=1)
    rests = np.all(saved.mode[index] == 0, axis=1) & (saved.mode.shape[1] > 0)
    rests &= np.all(drift[:, component] == 0.0, axis=1)
    outcome = np.where(rests, _AT_REST, _STEADY)
    outcome = np.where(answers, _PERIODIC, outcome)
    outcome = np.where(undamped, _UNDAMPED, np.where(lasts & even, outcome, _NOTHING))
    left = (outcome != _NOTHING) & (outcome != _UNDAMPED)
    return LongTermOutcomes(outcome, np.where(left[:, None], y - fading[:, component], y))
