"""Maps: a system measured at every point of a grid of parameters and initial values."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.errors import DeclarationError, short
from stickslip.model.declaration import check_initial
from stickslip.model.system import System
from stickslip.motion.outcome import Outcome
from stickslip.motion.problem import pose
from stickslip.motion.simulate import check_span, with_span
from stickslip.orbits.settling.engine.tables import DEVICE_LANES
from stickslip.progress import PATIENCE, watched
from stickslip.stopping.scopes import check_limit
from stickslip.sweeps.adaptive import Adaptive, check_adaptive, rounds
from stickslip.sweeps.map import Map
from stickslip.sweeps.request.axes import read_axes
from stickslip.sweeps.request.carry import read_carry
from stickslip.sweeps.request.measures import ends_with_samples
from stickslip.sweeps.request.plan import Plan
from stickslip.sweeps.request.records import Driven, Under, read_records
from stickslip.sweeps.request.user_measures import read_measures
from stickslip.sweeps.store import Chunk, MapStore, create, opened
from stickslip.sweeps.work.carrying import LinesToDo, Runs
from stickslip.sweeps.work.job import Work, check_sendable, compute, work_of
from stickslip.sweeps.work.scheduler import Interrupt, Pool, distribute, listening

if TYPE_CHECKING:
    from stickslip.orbits.settling.motions import Settings


@dataclass(frozen=True)
class Progress:
    """Progress of a map.

    Attributes
    ----------
    done, total : int
        Number of computed points, and of all points.
    new : int
        Points computed by this run.
    elapsed : float
        Seconds since the start of the run.
    outcomes : dict of int to int
        Number of points by the code of their outcome.
    """

    done: int
    total: int
    new: int
    elapsed: float
    outcomes: Mapping[int, int]

    def describe(self) -> str:
        """Points done, points per second, and how they ended."""
        rate = f", {self.new / self.elapsed:,.0f}/s" if self.new and self.elapsed > 0.0 else ""
        ends = ", ".join(
            f"{count:,} {Outcome.from_code(code).label}" for code, count in self.outcomes.items()
        )
        return f"{self.done:,} of {self.total:,} points{rate}" + (f": {ends}" if ends else "")


@dataclass(frozen=True)
class Batch:
    """Points that are computed together.

    Attributes
    ----------
    pieces : list of (chunk, array of int)
        Chunks, and positions of the points in them.
    columns : dict of str to array
        Values of the axes at all points.
    runs : Runs, optional
        Order of the points, if they carry the state.
    under : Under, optional
        The record that drives all of them.
    """

    pieces: list[tuple[Chunk, Array]]
    columns: dict[str, Array]
    runs: Runs | None = None
    under: Under | None = None


@validated
def sweep(
    system: System,
    over: Mapping[str, Any] | Sequence[str],
    measure: Sequence[Any],
    out: str | Path | None = None,
    *,
    initial: Mapping[str, float] | None = None,
    span: tuple[float, float] | None = None,
    settings: Settings | None = None,
    seed: int = 0,
    carry: str | None = None,
    adaptive: Adaptive | None = None,
    scheduler: str = "threads",
    workers: int | None = None,
    device: str = "cpu",
    extend: bool = False,
    overwrite: bool = False,
    repair: bool = False,
    time_limit: float | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> Map:
    """Compute measures of a system over a grid of parameters and initial values.

    Parameters
    ----------
    system : System
    over : mapping of str to axis
        Axes of parameters and initial values, including those of degrees of freedom of structures,
        ``"u[tip]"``: ``{"P": "0.8:1.6:400", "delta": "log:0.01:0.2:300"}``, or arrays of values
        (:mod:`stickslip.sweeps.request.axes` describes the notation). An axis of records,
        ``{"record": ss.Records.read("quakes")}``, drives the system with one record per point; an
        axis ``scale`` multiplies them, and each motion covers the time of its record.
    measure : sequence of str or callable
        Named measures, formulas ``"name = formula"`` of them, functions of a Trajectory. They are
        measures of the motion after convergence or, if drives are samples that end, of the motion
        over the declared span.
    out : str or Path, optional
        Path of the store; an incomplete store is resumed. By default the map is kept in memory.
    initial : mapping of str to float, optional
        Initial values at all points.
    span : (float, float), optional
        Time span that replaces the span of the system: motions start at its beginning, are
        abandoned after 100 times its length, and end with it if drives are samples that end.
    settings : Settings, optional
        Criteria of convergence, and the accuracy.
    seed : int
        Seed of random and low-discrepancy samples.
    carry : str, optional
        Along this axis every point starts from the final state of the previous one, at the same
        phase of the drives, as in an experiment: ``"omega"`` uses the values in the given order,
        ``"omega up"`` and ``"omega down"`` in increasing and decreasing order, ``"omega both"`` up
        and then down again, with an additional axis ``direction``. Points before the first
        converged motion of a line start from the initial state. A motion that stops passes on the
        state from which it started. The states passed on are in the variables ``carried_…``; an
        interrupted line resumes from them.
    adaptive : Adaptive, optional
        Refine only where results change.
    scheduler : str
        ``"threads"``, ``"processes"``, or the address of a Dask scheduler. The result does not
        depend on it.
    workers : int, optional
        Number of threads or processes; by default one per core. With a GPU, number of chunks in
        progress at the same time; by default one.
    device : str
        ``"cpu"``, or ``"gpu"``: the same loops on a CUDA device, one motion per thread (extra
        ``[gpu]``). Results agree up to rounding, so a map begun on one device can be resumed on the
        other.
    extend : bool
        Add new values of the axes to a stored map.
    overwrite : bool
        Replace a stored map.
    repair : bool
        Recompute damaged chunks.
    time_limit : float, optional
        Processor-time limit of a point in seconds, independent of other load on the machine
        (wall-clock time on systems without processor times of threads). A point that exceeds it has
        the outcome ``time limit reached``, and is retried when the map is resumed (unless points
        carry the state).
    progress : callable, optional
        Called as points are completed.

    Returns
    -------
    Map
        Its dataset has one dimension for each axis, and contains the measures, ``outcome`` and
        ``certificate``. After Ctrl-C some points have the outcome -1, not computed.

    Raises
    ------
    DeclarationError
        If an argument is wrong; nothing is computed then.
    StickslipError
        If the store cannot be written, is damaged, or holds another map.
    """
    plan = make_plan(system, over, measure, initial, settings, seed, carry, span)
    _check_carry(plan, adaptive, device)
    check_limit(time_limit)
    pool = _pool(scheduler, workers, device, time_limit)
    with contextlib.ExitStack() as stack:
        if out is None:
            store = create(plan, None)
        else:
            store = stack.enter_context(opened(plan, Path(out), extend=extend, overwrite=overwrite))
            store.audit(repair)
            store.load()
        if adaptive is not None:
            check_adaptive(adaptive, store)
        with watched(f"sweep of {system.name}", patience=PATIENCE) as show:

            def share(state: Progress) -> None:
                show(state.done / state.total, state.describe())

            compute_missing(store, pool, adaptive, progress or share, device, time_limit)
        return Map(store.dataset())


def make_plan(
    system: System,
    over: Mapping[str, Any] | Sequence[str],
    measure: Sequence[Any],
    initial: Mapping[str, float] | None = None,
    settings: Settings | None = None,
    seed: int = 0,
    carry: str | None = None,
    span: tuple[float, float] | None = None,
) -> Plan:
    """Check a request, and create its plan.

    Parameters
    ----------
    system, over, measure, initial, settings, seed, carry, span
        As for :func:`sweep`.

    Raises
    ------
    DeclarationError
        If an argument is wrong.
    """
    from stickslip.orbits.settling.motions import Settings

    if not isinstance(system, System):
        reason = f"expected a System, got {type(system).__name__}"
        raise DeclarationError("system", reason, "Use ss.load or ss.catalogue")
    driven = read_records(system, over, None if span is None else check_span(span, "span"))
    system = with_span(system, span) if driven is None else driven.first
    axes = read_axes(system, over, seed)
    varied = [name for axis in axes for name in axis.names]
    start = checked_start(system, initial or {}, varied)
    settings = settings or Settings()
    pose(system, None, settings.rtol, settings.atol)  # rejects settings that no motion accepts
    if carry is not None and driven is not None:
        raise DeclarationError(
            "carry", "the state cannot be carried from one record to the next", "Remove it"
        )
    if ends_with_samples(system):
        system.declaration.check_span(*system.span)
        if carry is not None:
            raise DeclarationError(
                "carry",
                f"the samples that drive {system.name} end, so no motion settles",
                "Declare the samples periodic",
            )
    axes, carried = read_carry(system, axes, carry)
    measures = read_measures(system, measure)
    return Plan(system, axes, measures, start, settings, seed, carry=carried, driven=driven)


def checked_start(
    system: System, initial: Mapping[str, float], varied: Sequence[str]
) -> dict[str, float]:
    """Initial values of all points of a map, in addition to those that vary.

    Parameters
    ----------
    varied : sequence of str
        Names that vary along axes.

    Raises
    ------
    DeclarationError
        If a name is neither a part of the state nor a degree of freedom of a structure, a value is
        not a number, or it varies.
    """
    started = system.started(initial)
    for name, value in started.items():
        check_initial(system.declaration, name, value, system.started_unknowns)
    if twice := [name for name in (*started, *initial) if name in varied]:
        raise DeclarationError(
            f"initial.{twice[0]}", "it already varies along an axis", "Give it once only"
        )
    system.check_starts([*initial, *varied], "initial")
    return {name: float(value) for name, value in initial.items()}


def _check_carry(plan: Plan, adaptive: Adaptive | None, device: str) -> None:
    """Reject options that are incompatible with carrying the state."""
    if plan.carry is None:
        return
    if adaptive is not None:
        raise DeclarationError(
            "carry",
            "an adaptive map omits points, but a carried point needs the previous one",
            "Remove one of them",
        )
    if device == "gpu":
        raise DeclarationError(
            "carry",
            "a GPU computes points in parallel, but carried points depend on each other",
            'Use device="cpu"',
        )


def _pool(scheduler: str, workers: int | None, device: str, time_limit: float | None) -> Pool:
    """Check the scheduler and device, and create the pool."""
    if device == "gpu":
        if time_limit is not None:
            reason = "a GPU computes all motions of a chunk in parallel"
            raise DeclarationError("time_limit", reason, "Set max_time or max_events instead")
        from stickslip.sweeps.work.device import check_device

        if scheduler != "threads":
            reason = f"a GPU needs the scheduler \"threads\", not '{short(scheduler)}'"
            raise DeclarationError("device", reason, "Remove the scheduler")
        check_device()
        return Pool(scheduler, 1 if workers is None else workers)
    if device != "cpu":
        raise DeclarationError("device", f"unknown device '{short(device)}'", "Choose cpu or gpu")
    return Pool(scheduler, workers)


def compute_missing(
    store: MapStore,
    pool: Pool,
    adaptive: Adaptive | None,
    progress: Callable[[Progress], None] | None = None,
    device: str = "cpu",
    time_limit: float | None = None,
) -> bool:
    """Compute the missing points; return False if interrupted.

    Parameters
    ----------
    store : MapStore
        Receives the results.
    pool : Pool
        Workers.
    adaptive : Adaptive or None
        Selection of points; by default all.
    progress : callable, optional
        Called with :class:`Progress`.
    device : str
        ``"cpu"`` or ``"gpu"``.
    time_limit : float, optional
        Time limit of each point in seconds.
    """
    work = work_of(store.plan, device, time_limit)
    if pool.scheduler == "processes":
        check_sendable(work)
    tell = _Reporter(store, progress)
    wanted: Iterator[Array | None] = iter([None]) if adaptive is None else rounds(store, adaptive)
    with pool, listening(pool.flag) as stop:
        for points in wanted:
            _fill(store, work, points, pool, stop, tell)
            if stop.requested:
                return False
    return True


def _fill(
    store: MapStore, work: Work, points: Array | None, pool: Pool, stop: Interrupt, tell: _Reporter
) -> None:
    """Compute the missing ones of the requested points (all if None), and write them chunk by
    chunk."""
    tell(np.empty(0, np.int8))
    together = DEVICE_LANES if work.device == "gpu" else 1
    carry = store.plan.carry
    lines = None if carry is None else LinesToDo(store, carry)
    tasks = _tasks(store, points, together) if lines is None else _of_lines(lines)
    for task, values in distribute(partial(_work, work), tasks, pool, stop):
        first = 0
        for chunk, inside in task.pieces:
            piece = slice(first, first + len(inside))
            store.write(chunk, inside, {name: some[piece] for name, some in values.items()})
            first = piece.stop
            if lines is not None:
                lines.done(chunk)
        tell(values["outcome"])


def _tasks(store: MapStore, points: Array | None, together: int) -> Iterator[Batch]:
    """Groups of chunks with missing points, with at least a given number of points in each task."""
    if store.plan.driven is not None:
        yield from _of_records(store, points, store.plan.driven)
        return
    grid = store.grid
    pieces = list[tuple[Chunk, Array]]()
    count = 0
    for chunk in chain(grid.chunks(), [None]):
        if chunk is not None and len(inside := store.missing(chunk, points)):
            pieces.append((chunk, inside))
            count += len(inside)
        if count >= together or (chunk is None and pieces):
            parts = [grid.columns(grid.region(chunk), inside) for chunk, inside in pieces]
            yield Batch(
                pieces, {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
            )
            pieces = []
            count = 0


def _of_records(store: MapStore, points: Array | None, driven: Driven) -> Iterator[Batch]:
    """Chunks with missing points; each belongs to one record."""
    grid = store.grid
    (name,) = (axis.names[0] for axis in grid.axes if axis.labels)
    for chunk in grid.chunks():
        inside = store.missing(chunk, points)
        if len(inside):
            columns = grid.columns(grid.region(chunk), inside)
            under = driven.under(float(columns[name][0]))
            yield Batch([(chunk, inside)], columns, under=under)


def _of_lines(lines: LinesToDo) -> Iterator[Batch | None]:
    """Chunks of lines, each when the results it depends on are available; None: none is available
    at the moment."""
    grid = lines.grid
    for found in lines:
        if found is None:
            yield None
            continue
        chunk, inside, runs = found
        yield Batch([(chunk, inside)], grid.columns(grid.region(chunk), inside), runs)


def _work(work: Work, task: Batch) -> dict[str, Array]:
    if task.under is not None:
        work = replace(work, under=task.under)
    return compute(work, task.columns, task.runs)


class _Reporter:
    """Counts completed points, for progress reports."""

    def __init__(self, store: MapStore, listener: Callable[[Progress], None] | None) -> None:
        self.listener = listener
        self.total = store.grid.size
        self.began = time.perf_counter()
        self.new = 0
        self.counts = _count(store.outcome.reshape(-1))

    def __call__(self, codes: Array) -> None:
        self.new += len(codes)
        self.counts += _count(codes)
        if self.listener is not None:
            outcomes = {int(code): int(self.counts[code]) for code in np.flatnonzero(self.counts)}
            elapsed = time.perf_counter() - self.began
            self.listener(Progress(sum(outcomes.values()), self.total, self.new, elapsed, outcomes))


def _count(codes: Array) -> Array:
    """Number of computed points by outcome."""
    return np.bincount(codes[codes >= 0], minlength=128)
