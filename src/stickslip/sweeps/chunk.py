"""A chunk of points of a map: every motion is followed until it has settled and is then measured, in compiled loops."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stickslip.equations.compiled import announced
from stickslip.errors import DeclarationError
from stickslip.motion import affine
from stickslip.motion.batch import (
    columns,
    common_length,
    initial_states,
    lanes_of_block,
    parameter_table,
    pose_all,
)
from stickslip.motion.kernel import FULL, NEED, Lane, Record
from stickslip.motion.lanes import Lanes
from stickslip.motion.problem import Problem
from stickslip.sweeps import measuring, settling
from stickslip.sweeps.measures import Observed, measured, needs_close_look
from stickslip.sweeps.observers import Sums
from stickslip.system import System

Array = np.ndarray

SLOTS = 12  # closed forms of every point
ROOM = 256  # knots that are measured at a time
SPANS = 100.0  # of the system, after which a motion is given up by default
LOOKS = 4.0  # in a span
MARGIN = 0.1  # what a section misses by is more where the motion is fast


@dataclass(frozen=True)
class Settings:
    """How a motion settles, and with which accuracy it is computed.

    Attributes
    ----------
    tolerance : float
        A motion has settled when what is still missing to its cycle or equilibrium is below this part of its size.
    max_time : float, optional
        When it is given up; by default after 100 times the span of the system.
    max_cycles : int
        … or after so many cycles.
    rtol, atol, max_events
        As in :func:`stickslip.simulate`.
    """

    tolerance: float = 1e-8
    max_time: float | None = None
    max_cycles: int = 10_000
    rtol: float = 1e-10
    atol: float = 1e-12
    max_events: int = 1_000_000

    def __post_init__(self) -> None:
        if not 1e-12 <= self.tolerance <= 1e-2:
            raise DeclarationError("tolerance", f"{self.tolerance!r} is out of range", "Choose 1e-12 ... 1e-2")
        if self.max_time is not None and not 0.0 < self.max_time < np.inf:
            raise DeclarationError("max_time", f"{self.max_time!r} is no duration", "Give a positive number")
        for name in ("max_cycles", "max_events"):
            if getattr(self, name) < 1:
                raise DeclarationError(name, f"{getattr(self, name)} is not positive", "Allow at least one")


def measure_chunk(
    system: System,
    initial: Mapping[str, Array],
    parameters: Mapping[str, Array],
    measures: Sequence[str],
    settings: Settings,
) -> dict[str, Array]:
    """Measures of what motions settle on.

    Parameters
    ----------
    system : System
    initial, parameters : mapping of str to array, shape (points,)
        What varies; numbers hold for all points. What a point gives does not depend on the others.
    measures : sequence of str
        See :mod:`stickslip.sweeps.measures`.
    settings : Settings

    Returns
    -------
    dict of str to array, shape (points,)
        By measure; NaN where there is nothing to measure. Always also ``outcome`` (codes of
        :class:`stickslip.motion.outcome.Outcome`) and ``certificate``: the largest of the residual of the energy
        balance, the violation of the friction law, the defect of the equations of motion, and the failure to close.

    Raises
    ------
    DeclarationError
        If a name, a value or a measure is wrong.
    """
    starts, given = columns(initial, "initial"), columns(parameters, "parameters")
    count = common_length({**starts, **given})
    table, states = parameter_table(system, given, count), initial_states(system, starts, count)
    problem = pose_all(system, given, settings.rtol, settings.atol)
    closely, exponents, lanes = (
        needs_close_look(system, measures),
        "lyapunov" in measures,
        lanes_of_block(problem, SLOTS),
    )
    blocks = [slice(i, i + lanes) for i in range(0, count, lanes)]
    found = [_Block(problem, table[b], states[b], settings, closely, exponents).run() for b in blocks]
    parts = [measured(problem, observed, measures) for observed in found]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


class _Block:
    """Points that are worked on together, each with closed forms of its own."""

    def __init__(
        self, problem: Problem, table: Array, states: Array, settings: Settings, closely: bool, exponents: bool
    ) -> None:
        self.problem, self.settings, self.closely = problem, settings, closely
        count, (n, contacts, kinks) = len(table), (states.shape[1], len(problem.rows.u), len(problem.rows.kinks))
        t, end = problem.system.span
        self.limits = settling.Limits(
            np.array([
                t,
                t + (settings.max_time or SPANS * (end - t)),
                (end - t) / LOOKS,
                MARGIN * settings.tolerance,
                settings.atol,
            ]),
            np.array([settings.max_cycles, settings.max_events]),
        )  # fmt: skip
        constants, group = problem.constants_of(table), np.arange(count)
        self.lanes = Lanes.start(
            problem, constants, group, states, (t, float(self.limits.real[1])), problem.empty_forms(count, SLOTS)
        )
        self.saved = Lane(*(part.copy() for part in self.lanes.now))
        self.marks = empty_marks(count, n)
        self.driven = drive_period(constants.omega)
        self.translation = np.array(
            [float(problem.system.translation.get(x, 0.0)) for x in problem.compiled.layout.state]
        )
        self.sums = Sums(
            low=np.zeros((count, n)),
            high=np.zeros((count, n)),
            stick=np.zeros((count, contacts)),
            work=np.zeros((count, contacts)),
            peak=np.zeros((count, contacts)),
            impulse=np.zeros((count, contacts)),
            total=np.zeros((count, 2)),
            switches=np.zeros((count, 1), np.int64),
        )
        self.audit, self.shift = np.zeros((count, 4)), np.zeros((count, n))
        self.exponents = exponents
        self.exponent = np.full(count, np.nan)
        self.record = Record(
            np.zeros(ROOM + 1),
            np.zeros((ROOM + 1, n)),
            np.zeros((ROOM + 1, contacts), np.int8),
            np.zeros((ROOM + 1, kinks), np.int8),
            np.zeros(ROOM + 1, np.int64),
        )

    def run(self) -> Observed:
        """Follow and measure all points; the closed forms they need are made in between."""
        self._until_done(self._advance, self.lanes)
        if self.exponents:
            settled = (self.marks.outcome >= settling.PERIODIC) & (self.marks.outcome <= settling.NOT_SETTLED)
            self.marks.numbers[settled, 0] = settling.MEASURING
            self.twins = replace(
                self.lanes, codes=self.lanes.codes.copy(), now=Lane(*(part.copy() for part in self.lanes.now))
            )
            self._until_done(self._grow_apart, self.lanes, self.twins)
        return Observed(
            self.marks.outcome,
            self.marks.period[:, 1],
            self.shift,
            self.sums,
            self.audit,
            self.translation,
            self.exponent,
        )

    def _until_done(self, compiled: Callable[[], int], *involved: Lanes) -> None:
        waiting = True
        while waiting:
            for lanes in involved:
                lanes.make_closed_forms()
                need = np.flatnonzero(lanes.codes == NEED)
                if self.problem.compiled.layout.timed and len(need):
                    self.marks.frame[need] = frames(lanes, need)
                lanes.codes[need] = FULL
            with announced():
                waiting = compiled() > 0

    def _engine(self, lanes: Lanes) -> settling.Engine:
        p = self.problem
        return settling.Engine(
            p.rows, p.space(), p.flight(), lanes.constants, lanes.forms, lanes.group, lanes.codes, lanes.now
        )

    def _advance(self) -> int:
        p, lanes = self.problem, self.lanes
        layout, inertial = p.compiled.layout, p.system.declaration.inertial
        rates = [layout.state.index(f"d_{q}") for q in inertial] + [layout.named[f"dd_{q}"] for q in inertial]
        rates += [layout.named[f"d_{x}"] for x in layout.state[2 * len(inertial) :]]
        return measuring.advance(
            self._engine(lanes),
            p.compiled.jets,
            p.compiled.residual,
            p.compiled.powers,
            lanes.slots,
            p.order,
            p.tolerance,
            p.atol,
            np.array(p.retrace),
            self.marks,
            self.limits,
            self.driven,
            self.translation,
            self.saved,
            self.record,
            np.array(rates, dtype=np.int64),
            layout.rate_sizes,
            self.closely,
            self.sums,
            self.audit,
            self.shift,
        )

    def _grow_apart(self) -> int:
        from stickslip.sweeps import exponents

        p, lanes = self.problem, self.lanes
        return exponents.grow_all(
            self._engine(lanes),
            self._engine(self.twins),
            p.compiled.jets,
            p.compiled.residual,
            lanes.slots,
            p.order,
            p.tolerance,
            p.atol,
            self.marks,
            self.limits,
            self.saved,
            self.record,
            self.exponent,
        )


def empty_marks(count: int, n: int) -> settling.Marks:
    """Nothing remembered yet."""
    ring = settling.RING
    return settling.Marks(
        time=np.zeros((count, ring)),
        state=np.zeros((count, ring, n)),
        kind=np.zeros((count, ring), np.int64),
        miss=np.zeros((count, ring)),
        lag=np.zeros((count, ring), np.int64),
        numbers=np.zeros((count, 6), np.int64),
        plane=np.zeros((count, 3, n)),
        size=np.zeros((count, n)),
        period=np.zeros((count, 3)),
        frame=np.zeros((count, n)),
        outcome=np.full(count, -1, np.int64),
    )


def drive_period(omega: Array) -> Array:
    """Period of the first drive that moves; 0 where none does. Other drives only make the cycle longer."""
    moving = omega > 0.0
    if not omega.shape[1]:
        return np.zeros(len(omega))
    first = np.take_along_axis(omega, np.argmax(moving, axis=1)[:, None], 1)[:, 0]
    return np.divide(2.0 * np.pi, first, out=np.zeros(len(omega)), where=first > 0.0)


def frames(lanes: Lanes, index: Array) -> Array:
    """Velocities of the frames in which systems under loads Vt do not depend on time, but for their drives.

    In the closed forms ẋ and the guards are linear in (x, 1, t, …): shifting the state by v·Δt makes up for the time
    if the column of t is minus the columns of x times v in all modes. 0 where there is no such v.
    """
    T, slots = lanes.forms, lanes.slots
    place = index[:, None] * slots + np.arange(slots)
    n = T.hold.shape[2]
    table = np.concatenate([T.S[place][:, :, :n], T.G[place]], axis=2)
    matrix, load = table[..., :n], table[..., n + 1]
    known = (T.status[place] == affine.AFFINE)[:, :, None]
    matrix = np.where(known[..., None], matrix, 0.0).reshape(len(index), -1, matrix.shape[3])
    load = np.where(known, load, 0.0).reshape(len(index), -1)
    size = np.max(np.abs(matrix), axis=2) + np.abs(load)
    weight = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0.0)
    matrix, load = matrix * weight[:, :, None], load * weight
    frame = -(np.linalg.pinv(matrix, rcond=1e-9) @ load[:, :, None])[:, :, 0]
    off = np.max(np.abs((matrix @ frame[:, :, None])[:, :, 0] + load), axis=1, initial=0.0)
    return np.where((off <= 1e-9)[:, None] & (np.abs(frame) > 1e-12 * np.max(np.abs(frame), initial=0.0)), frame, 0.0)
