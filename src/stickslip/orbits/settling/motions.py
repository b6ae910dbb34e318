"""Many motions, each followed until it has settled and then measured: compiled loops, and proofs on
the host for motions without further events.

A map is many of these motions, a basin many that share their parameters, the search for a cycle
one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from stickslip.arguments import check_fields
from stickslip.arrays import Array, plain_array
from stickslip.errors import DeclarationError
from stickslip.model.entries.polynomials import ends_of_tables
from stickslip.motion.audit.observers import LASTED, STUCK, Sums
from stickslip.motion.ensemble import Lanes
from stickslip.motion.outcome import Outcome
from stickslip.motion.problem import Problem
from stickslip.motion.steps.arrays import NOW, Lane
from stickslip.orbits.fields.stable_set import excess
from stickslip.orbits.settling.engine import measuring, settling
from stickslip.orbits.settling.engine.exponents import SKIPPED, TURNS
from stickslip.orbits.settling.engine.tables import (
    DONE,
    DURATION,
    MEASURING,
    PHASE,
    PROVING,
    WAITING,
    Bench,
    Engine,
    Found,
    Marks,
    Rules,
    make_bench,
    make_found,
    make_marks,
)
from stickslip.orbits.settling.lattice import forms_of, lattice, translations
from stickslip.orbits.settling.proofs import Prover
from stickslip.orbits.settling.repetition import Repetition
from stickslip.orbits.settling.unsettled import CERTAIN_GROWTH, changes_slowly, elapsed_of
from stickslip.stopping.scopes import TimeUp, check_stop, flagged, watching

POINT_SLOTS = 12  # number of closed forms of every point
_SHARED_SLOTS = 64  # number of closed forms of all points
_ROOM = 256  # number of knots that are measured together
_SPANS = 100.0  # spans of the system after which a motion is abandoned by default
_LOOKS = 4.0  # number of looks per span
_CROSSINGS = 100.0  # periods of a lattice after which a motion may be abandoned
# fraction of the tolerance below which a motion is polished: its returns do not determine the error
# exactly
_MARGIN = 0.1
_RINGS = 2  # number of longest cycles that are stored, so that two returns can be compared
_ENDLESS = np.iinfo(np.int64).max
# largest number of states with extrapolation: the proof uses matrices of eight times as many rows
_MOST_STATES = 32
_TURNS = 1024  # marks of a single motion between checks for Ctrl-C
_LEAST_TOLERANCE = 1e-12  # smallest tolerance of attractors: hundreds of times the local errors
ATTRACTORS = (Outcome.AT_REST, Outcome.PERIODIC, Outcome.STEADY, Outcome.UNDAMPED)
UNSETTLED = (Outcome.NOT_SETTLED, Outcome.IRREGULAR, Outcome.SLOW)
MEASURED = (*ATTRACTORS, *UNSETTLED)


@dataclass(frozen=True)
class Settings:
    """Criteria of convergence, and the accuracy of motions.

    Attributes
    ----------
    tolerance : float
        A motion has converged if its distance from the cycle or equilibrium, relative to its size,
        is below this tolerance. Cycles are then refined by Newton's method, so that errors of
        measures are usually much smaller. It is also the limit of the residuals of certified
        points, or 10 rtol if that is larger.
    max_time : float, optional
        Time at which a motion is abandoned; by default 100 times the span of the system or, if it
        is pulled over a lattice, 100 periods of the lattice if that is later.
    max_cycles : int
        Number of cycles after which a motion is abandoned.
    longest_cycle : int
        Maximum number of events (coincident events count once), or of drive periods, of a cycle.
    rtol, atol, max_events
        As in :func:`stickslip.simulate`.
    """

    tolerance: float = 1e-8
    max_time: float | None = None
    max_cycles: int = 10_000
    longest_cycle: int = 48
    rtol: float = 1e-10
    atol: float = 1e-12
    max_events: int = 1_000_000

    def __post_init__(self) -> None:
        check_fields(self)
        if not _LEAST_TOLERANCE <= self.tolerance <= 1e-2:
            raise DeclarationError(
                "tolerance",
                f"{self.tolerance!r} is out of range",
                "Choose a value from 1e-12 to 1e-2",
            )
        if self.max_time is not None and not 0.0 < self.max_time < np.inf:
            raise DeclarationError(
                "max_time", f"{self.max_time!r} is not a duration", "Give a positive number"
            )
        for name in ("max_cycles", "max_events"):
            if getattr(self, name) < 1:
                raise DeclarationError(
                    name, f"{getattr(self, name)} is not positive", "Give at least 1"
                )
        if not 4 <= self.longest_cycle <= 4096:
            raise DeclarationError(
                "longest_cycle",
                f"{self.longest_cycle} is out of range",
                "Choose a value from 4 to 4096",
            )


@dataclass(frozen=True)
class Observed:
    """Observations of some points by compiled code.

    Attributes
    ----------
    outcome : array of int, shape (points,)
    time : array, shape (points,)
    state : array, shape (points, n)
        Start of the measured interval.
    duration : array, shape (points,)
        Length of the measured interval: the period of a cycle.
    translation : array, shape (n,)
    found : Found
        By point.
    excess : array, shape (points,)
        Violation of |∂Φ| ≤ s by the initial state.
    """

    outcome: Array
    time: Array
    state: Array
    duration: Array
    translation: Array
    found: Found
    excess: Array

    @property
    def sums(self) -> Sums:
        """The accumulated sums."""
        return self.found.sums


class Invariance(NamedTuple):
    """Known symmetries of a system along a motion.

    Attributes
    ----------
    shifts : array, shape (translations, n)
        Directions, orthogonal to each other, in which the state may be shifted.
    frame : array, shape (n,)
        Velocity of the frame in which the system does not depend on time, except for its drives.
    period : float
        Period of the system; 0 if it is not driven.
    parts : int
        Number of these periods after which the drives repeat, too.
    cells : array, shape (n, cells)
        Shifts of the state, with their multiples, that leave the system unchanged.
    crossed : bool
        Whether the drive is a motion over a spatially periodic system.
    """

    shifts: Array
    frame: Array
    period: float
    parts: int
    cells: Array
    crossed: bool


class Loops(Protocol):
    """Interface of the device of the compiled loops: CPU or GPU."""

    def advance(self) -> None:
        """Advance all motions until they are done or wait for the host."""
        ...

    def grow_apart(self) -> None:
        """Advance all motions with their twins."""
        ...

    def ask(self) -> None:
        """Copy the states of motions that wait for a proof to the host."""
        ...

    def answer(self) -> None:
        """Send the results of the proofs."""
        ...

    def fetch(self) -> None:
        """Copy the results and the states of the motions to the host."""
        ...

    def remember(self) -> None:
        """Copy the marks of all motions to the host."""
        ...


class Block:
    """Points that are computed together, with separate closed forms unless they share their
    parameters.

    Attributes
    ----------
    lanes, twins : Lanes
        The motions, and others that start close to them (with the same closed forms).
    marks, rules, saved, found, bench
        See :mod:`stickslip.orbits.settling.engine.tables`.
    excess : array, shape (points,)
        Violation of |∂Φ| ≤ s by the initial states; with a violation there is no motion.

    Parameters
    ----------
    known : Invariance, optional
        By default, translations are the declared one and those found in the formulas, the period is
        that of the first active drive, and the frame is computed from the closed forms; for motions
        over spatially periodic systems, both follow from the formulas.
    """

    def __init__(
        self,
        problem: Problem,
        table: Array,
        states: Array,
        settings: Settings,
        closely: bool,
        shared: bool = False,
        known: Invariance | None = None,
    ) -> None:
        count = len(table)
        n = states.shape[1]
        constants = problem.constants_of(table[:1] if shared else table)
        group = np.zeros(count, np.int64) if shared else np.arange(count)
        self.problem = problem
        self.known = known
        rules = make_rules(problem, settings, closely)
        if known is not None:
            most = np.array([*rules.most[:2], _TURNS, *rules.most[3:]])
            rules = rules._replace(shifts=plain_array(known.shifts), most=most, framed=False)
        over = lattice(problem, table) if known is None else None
        if over is not None and over.moved:
            rules = rules._replace(framed=False)
        self.rules: Rules = rules
        span = float(self.rules.real[0]), float(self.rules.real[1])
        forms = (
            problem.empty_forms(1, _SHARED_SLOTS)
            if shared
            else problem.empty_forms(count, POINT_SLOTS)
        )
        self.lanes: Lanes = Lanes.start(problem, constants, group, states, span, forms)
        self.twins: Lanes = Lanes.start(problem, constants, group, states, span, forms)
        saved, home, before = (Lane(*(part.copy() for part in self.lanes.now)) for _ in range(3))
        self.saved: Lane = saved
        self.prover: Prover = Prover(problem, table, self.rules)
        drive = (
            drive_period(np.where(self.prover.acting, constants.omega[group], 0.0))
            if known is None
            else np.full(count, known.period)
        )
        cells = np.zeros((count, 0, 2, n))
        if known is not None:
            self.prover.parts[:] = known.parts
            cells = np.tile(forms_of([known.cells]), (count, 1, 1, 1))
        elif over is not None:
            drive = np.where(over.period > 0.0, over.period, drive)
            self.prover.parts[:] = over.parts
            cells = over.cells
        limit = np.full(count, self.rules.real[1])
        if settings.max_time is None:
            # A lattice may take longer than the span of the system to be crossed.
            crossed = known.crossed if known is not None else over is not None and over.moved
            limit = np.where(crossed, np.maximum(limit, _CROSSINGS * drive), limit)
        ring = _RINGS * settings.longest_cycle + 1
        self.marks: Marks = make_marks(drive, limit, cells, ring, home, before)
        if known is not None:
            self.marks.frame[:] = known.frame
        elif over is not None:
            self.marks.frame[:] = over.frame
        self.found: Found = make_found(count, n, len(problem.rows.u))
        values = dict(zip(problem.system.parameters, table.T, strict=True))
        self.excess: Array = excess(problem.compiled.equations, values, states, problem.origin)
        self.bench: Bench = make_bench(problem, _ROOM)
        self.marks.outcome[self.excess > 0.0] = Outcome.OUTSIDE.code
        self.marks.numbers[self.excess > 0.0, PHASE] = DONE
        self.lanes.codes[self.excess > 0.0] = Outcome.OUTSIDE.code

    @property
    def settling(self) -> tuple[Marks, Rules, Lane, Bench]:
        """Arguments of the settling loops in addition to the engine."""
        return self.marks, self.rules, self.saved, self.bench

    def engine(self, lanes: Lanes) -> Engine:
        """Arguments of the event loop for these lanes."""
        p = self.problem
        return Engine(
            p.machine,
            p.flow(lanes.constants)._replace(space=p.space()),
            p.flight(False),
            lanes.forms,
            lanes.group,
            lanes.codes,
            lanes.now,
        )

    def settle(self) -> None:
        """Follow all motions until they have settled; their states and attractors are stored in
        `saved` and in the marks."""
        loops = Here(self)
        self._until_done(loops.settle, loops)

    def run(
        self,
        where: Callable[[Block], Loops],
        exponents: bool,
        time_limit: float | None = None,
        classed: bool = False,
    ) -> Observed:
        """Follow and measure all points.

        Parameters
        ----------
        where : function
            Host or device on which the loops run.
        exponents : bool
            Whether Lyapunov exponents are measured.
        time_limit : float, optional
            Wall-clock limit of each point in seconds.
        classed : bool
            Whether to classify motions that have not settled.
        """
        marks = self.marks
        loops = where(self)
        self._in_time(loops.advance, loops, time_limit)
        loops.fetch()
        if exponents:
            marks.numbers[np.isin(marks.outcome, [o.code for o in MEASURED]), PHASE] = MEASURING
            self._in_time(loops.grow_apart, loops, time_limit)
            loops.fetch()
        if classed:
            self._class_unsettled(loops, exponents, time_limit)
        self._name_rest()
        self._name_ends_of_tables()
        return Observed(
            marks.outcome,
            self.problem.origin + self.saved.clock[:, NOW],
            self.saved.y,
            marks.real[:, DURATION],
            self.rules.shifts[0],
            self.found,
            self.excess,
        )

    def _in_time(self, compiled: Callable[[], None], where: Loops, limit: float | None) -> None:
        """Follow all motions to their end, sequentially if there is a time limit."""
        if limit is None:
            self._until_done(compiled, where)
            return
        phase = self.marks.numbers[:, PHASE]
        for i in np.flatnonzero(phase != DONE):
            others = np.arange(len(phase)) != i
            kept = phase[others].copy()
            phase[others] = WAITING
            with watching(limit, processor=True) as scope:
                try:
                    self._until_done(compiled, where)
                except TimeUp as up:
                    if not scope.ends(up):
                        raise
                    self.marks.outcome[i], phase[i] = Outcome.TIME_UP.code, DONE
                finally:
                    phase[others] = kept

    def _until_done(self, compiled: Callable[[], None], where: Loops) -> None:
        phase = self.marks.numbers[:, PHASE]
        while np.any((phase != DONE) & (phase != WAITING)):
            compiled()
            check_stop()
            if np.any(phase == PROVING):
                where.ask()
                self.prover.prove(self.lanes, self.engine(self.lanes), self.settling)
                where.answer()

    def _class_unsettled(self, loops: Loops, known: bool, limit: float | None) -> None:
        """Classify motions that have not settled as irregular or slow.

        Parameters
        ----------
        known : bool
            Whether their exponents are known; else they are measured, in stretches so short that it
            takes no longer than the motion itself.
        limit : float, optional
            Seconds that each point may take; one whose exponent takes longer has none.
        """
        marks = self.marks
        late = np.flatnonzero(marks.outcome == Outcome.NOT_SETTLED.code)
        if not len(late):
            return
        lasted = marks.real[:, DURATION].copy()
        if not known:
            spent = elapsed_of(marks, self.rules, self.saved)[late]
            marks.real[late, DURATION] = np.minimum(lasted[late], spent / (2.0 * TURNS))
            marks.numbers[late, PHASE] = MEASURING
            loops.answer()
            self._in_time(loops.grow_apart, loops, limit)
            loops.fetch()
        loops.remember()
        growth = self.found.exponent[late] * (TURNS - SKIPPED) * marks.real[late, DURATION]
        marks.real[:, DURATION] = lasted
        slow = np.array([changes_slowly(marks, self.rules, int(i)) for i in late])
        # Without a drive neighbouring motions converge only at an equilibrium, unless all contacts
        # stick.
        free = (marks.drive[late] == 0.0) & (not self.rules.timed)
        slow |= free & np.isfinite(growth) & (growth < -CERTAIN_GROWTH)
        calm = np.where(slow, Outcome.SLOW.code, Outcome.NOT_SETTLED.code)
        marks.outcome[late] = np.where(growth > CERTAIN_GROWTH, Outcome.IRREGULAR.code, calm)

    def _name_ends_of_tables(self) -> None:
        """Report motions that are undefined at the start because a table ends as outside of the
        table."""
        equations, outcome = self.problem.compiled.equations, self.marks.outcome
        for i in np.flatnonzero(outcome == Outcome.UNDEFINED.code):
            t = float(self.problem.origin + self.saved.clock[i, NOW])
            state = zip(self.problem.compiled.layout.state, self.saved.y[i].tolist(), strict=True)
            own = zip(self.problem.system.parameters, self.prover.table[i].tolist(), strict=True)
            values = {**dict(own), **dict(state), "t": t}
            if ends_of_tables(equations.kinks, equations.speeds, values):
                outcome[i] = Outcome.OUTSIDE_TABLE.code

    def _name_rest(self) -> None:
        """Classify motions that return after a period of the drive without movement as rest or
        steady sliding."""
        marks, found = self.marks, self.found
        still = (marks.outcome == Outcome.PERIODIC.code) & (found.moves == 0.0)
        held = (found.sums.total[:, STUCK] == found.sums.total[:, LASTED]) & np.all(
            found.shift == 0.0, axis=1
        )
        marks.outcome[still] = np.where(held, Outcome.AT_REST.code, Outcome.STEADY.code)[still]


class Here:
    """The compiled loops on this processor."""

    def __init__(self, block: Block) -> None:
        self.block = block
        self._engine: Engine = block.engine(block.lanes)
        self._twins: Engine | None = None

    @property
    def engine(self) -> Engine:
        """With the flags of this thread."""
        self._engine = self._of_this_thread(self._engine)
        return self._engine

    def _of_this_thread(self, engine: Engine) -> Engine:
        """An engine with the flags and cached modes of this thread."""
        flow, flight = engine.flow, engine.flight
        kept = self.block.problem.shared_flight.making.kept
        return engine._replace(
            flow=flow._replace(space=flagged(flow.space)),
            flight=flight._replace(making=flight.making._replace(kept=kept)),
        )

    def settle(self) -> None:
        """Settle only."""
        settling.settle_all(self.engine, *self.block.settling)
        phase = self.block.marks.numbers[:, PHASE]
        phase[phase == MEASURING] = DONE

    def advance(self) -> None:
        """Measure settled motions, and advance the others."""
        measuring.measure_all(self.engine, *self.block.settling, self.block.found)
        settling.settle_all(self.engine, *self.block.settling)

    def grow_apart(self) -> None:
        """Measure exponents."""
        from stickslip.orbits.settling.engine import exponents

        twins = self._twins or self.block.engine(self.block.twins)
        twins = self._twins = self._of_this_thread(twins)
        exponents.grow_all(self.engine, twins, *self.block.settling, self.block.found)

    def ask(self) -> None:
        """The host already has all data."""

    def answer(self) -> None:
        """The host already has all data."""

    def fetch(self) -> None:
        """The host already has all data."""

    def remember(self) -> None:
        """The host already has all data."""


def make_rules(problem: Problem, settings: Settings, closely: bool) -> Rules:
    """Criteria for settled motions of a system, and their measures."""
    system = problem.system
    layout = problem.compiled.layout
    span = system.span[1] - system.span[0]
    last = settings.max_time or _SPANS * span
    look = span / _LOOKS
    closed = len(problem.empty_forms(1, 1).status) > 0
    declared = np.array([float(system.plain.translation.get(x, 0.0)) for x in layout.state])
    return Rules(
        real=np.array(
            [0.0, last, look, _MARGIN * settings.tolerance, settings.atol, settings.tolerance]
        ),
        most=np.array([settings.max_cycles, settings.max_events, _ENDLESS, settings.longest_cycle]),
        shifts=plain_array(translations(problem.compiled.equations, declared)),
        fine=np.array(problem.retrace),
        closely=closely,
        timed=layout.timed and not Repetition(problem.compiled.equations).plain,
        leaping=len(layout.state) <= _MOST_STATES,
        closed=closed,
        # a frame needs the closed forms of all modes, and slips in a plane have none
        framed=closed and layout.timed and not layout.planes,
    )


def drive_period(omega: Array) -> Array:
    """Period of the first active drive; 0 if there is none. Other drives only lengthen the
    cycle."""
    moving = omega > 0.0
    if not omega.shape[1]:
        return np.zeros(len(omega))
    first = np.take_along_axis(omega, np.argmax(moving, axis=1)[:, None], 1)[:, 0]
    return np.divide(2.0 * np.pi, first, out=np.zeros(len(omega)), where=first > 0.0)
