"""The compiled loops of maps on a GPU, one motion per thread, compiled from the same source for
another machine.

The compiled functions of :mod:`stickslip.motion`, of the maps and of a system are scalar loops over
arrays that allocate nothing, so that each of them is also a device function. What a motion has come
to stays on the GPU until all are done.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache, partial
from importlib.util import find_spec
from types import FunctionType, ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import config, cuda

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.machine_code.functions import Compiled
from stickslip.motion.between.step_balance import Steps, Tally
from stickslip.motion.engine.affine import Probes
from stickslip.motion.engine.eigenvalues import Eigenproblem
from stickslip.motion.engine.forms import Flight, Making
from stickslip.motion.ensemble import Lanes
from stickslip.motion.steps.arrays import DIMENSION, Flow, Machine, Record, Space
from stickslip.orbits.settling.engine.exponents import grow_lane
from stickslip.orbits.settling.engine.measuring import advance_lane
from stickslip.orbits.settling.engine.tables import DEVICE_LANES, Bench, Engine, make_bench
from stickslip.orbits.settling.motions import POINT_SLOTS, Block, Settings

if TYPE_CHECKING:
    from stickslip.motion.problem import Problem


_THREADS = 64  # of a CUDA block
_ROOM = 16  # knots that are measured at a time
_LIBDEVICE = ("floor", "fma")  # what numba-cuda does not know by the names that the code uses
_SIMULATED: bool = config.ENABLE_CUDASIM  # pyright: ignore[reportAttributeAccessIssue]
_TURNS = 256  # marks after which a motion lets the host look whether to go on


def check_device() -> None:
    """Refuse to work without a GPU, or without what drives it.

    Raises
    ------
    DeclarationError
    """
    if not _SIMULATED and find_spec("numba_cuda") is None:
        raise DeclarationError(
            "device", "numba-cuda, which drives the GPU, is not installed", "Install stickslip[gpu]"
        )
    if not cuda.is_available():
        raise DeclarationError(
            "device", "no CUDA device was found on this machine", "Leave the work to the cpu"
        )


def lanes_on_device(problem: Problem, settings: Settings) -> int:
    """Motions worked on together: as many as memory lets, which does not matter to where they
    end."""
    table = np.array([list(problem.parameters.values())])
    marks = Block(
        problem, table, np.zeros((1, int(problem.rows.sizes[DIMENSION]))), settings, False
    ).marks
    tables = (
        problem.empty_forms(1, POINT_SLOTS),
        problem.space(),
        problem.flight(),
        make_bench(problem, _ROOM),
        marks,
    )
    sizes: list[int] = []
    each(lambda part: sizes.append(part.nbytes), tables)
    free = cuda.current_context().get_memory_info()[0]
    return int(np.clip(0.5 * free / sum(sizes), 1, DEVICE_LANES))


class OnDevice:
    """The compiled loops of a block on the GPU.

    Parameters
    ----------
    block : Block
    stop : array
        Seen by the host; no launch takes long.
    """

    def __init__(self, block: Block, stop: Array) -> None:
        self.block = block
        self.count: int = len(block.lanes.codes)
        here = block.engine(block.lanes)
        source: Any = block.problem.compiled.by_numba  # pyright: ignore[reportAttributeAccessIssue]
        self.kernels: tuple[Any, Any] = _kernels(
            source.jets, source.residual, source.powers, source.landings
        )
        rules = block.rules._replace(
            most=np.array([*block.rules.most[:2], _TURNS, block.rules.most[3]])
        )
        space, flight, bench = (
            each(self._for_all, part)
            for part in (here.flow.space, here.flight, make_bench(block.problem, _ROOM))
        )
        # Machine code is part of the kernels.
        shared = here._replace(machine=0, flow=here.flow._replace(space=0), flight=0)
        engine = each(cuda.to_device, shared)
        self.engine: Any = engine._replace(flow=engine.flow._replace(space=space), flight=flight)
        twins = block.twins
        self.twin: Any = self.engine._replace(
            codes=cuda.to_device(twins.codes), lanes=each(cuda.to_device, twins.now)
        )
        self.marks: Any = each(cuda.to_device, block.marks)
        self.rules: Any = each(cuda.to_device, rules)
        self.saved: Any = each(cuda.to_device, block.saved)
        self.found: Any = each(cuda.to_device, block.found)
        self.stop: Any = cuda.to_device(np.zeros(1, np.int64))
        self.bench = bench

    def _for_all(self, part: Array) -> Any:
        """Work space for every thread (a leading axis)."""
        return cuda.to_device(np.tile(part, (self.count, *(1 for _ in part.shape))))

    def advance(self) -> None:
        """Settle and measure."""
        self._launch(self.kernels[0], [(self.block.lanes, self.engine)])

    def grow_apart(self) -> None:
        """Measure exponents."""
        both = [(self.block.lanes, self.engine), (self.block.twins, self.twin)]
        self._launch(self.kernels[1], both)

    def _asked(self) -> tuple[Any, Any]:
        """What the host proves from, and decides: here and there."""
        block = self.block
        marks = self.block.marks
        there = self.marks
        here = (
            marks.outcome,
            marks.real,
            marks.size,
            marks.home,
            marks.numbers,
            block.saved,
            block.lanes.now,
        )
        return here, (
            there.outcome,
            there.real,
            there.size,
            there.home,
            there.numbers,
            self.saved,
            self.engine.lanes,
        )

    def ask(self) -> None:
        """Bring where the motions are that wait for a proof, with their closed forms, to the
        host."""
        there = self.engine.forms, self.marks.frame
        here = self.block.lanes.forms, self.block.marks.frame
        each_pair(lambda table, part: part.copy_to_host(table), here, there)
        each_pair(lambda table, part: part.copy_to_host(table), *self._asked())

    def answer(self) -> None:
        """Send what was proved of them."""
        each_pair(lambda table, part: part.copy_to_device(table), *self._asked())

    def fetch(self) -> None:
        """Bring what was found, and where the motions are, to the host."""
        self.ask()
        each_pair(lambda table, part: part.copy_to_host(table), self.block.found, self.found)

    def _launch(self, kernel: Any, involved: list[tuple[Lanes, Any]]) -> None:
        """Send what the host has changed, let all motions go on, and bring back what the host looks
        at."""
        marks = self.block.marks
        for lanes, there in involved:
            there.codes.copy_to_device(lanes.codes)
        self.marks.numbers.copy_to_device(marks.numbers)
        engines = [there for _, there in involved]
        kernel[-(-self.count // _THREADS), _THREADS](
            *engines, self.marks, self.rules, self.saved, self.bench, self.found, self.stop
        )
        for lanes, there in involved:
            there.codes.copy_to_host(lanes.codes)
        self.marks.numbers.copy_to_host(marks.numbers)


def each(function: Callable[[Array], Any], part: Any) -> Any:
    """Apply a function to all arrays of a tree of tuples."""
    if isinstance(part, tuple):
        inner = [each(function, item) for item in part]
        return type(part)(*inner) if hasattr(part, "_fields") else type(part)(inner)
    return function(part) if isinstance(part, np.ndarray) else part


def each_pair(function: Callable[[Array, Any], Any], part: Any, other: Any) -> None:
    """Apply a function to all arrays of a tree of tuples and their counterparts in another one."""
    if isinstance(part, tuple):
        for item, counterpart in zip(part, other, strict=True):
            each_pair(function, item, counterpart)
    else:
        function(part, other)


@cache
def ported(function: Any) -> Any:
    """A compiled function as a device function, with everything it calls.

    Functions are found by the names that the code uses, in its own module or in a module it names.
    """
    source = function.python if isinstance(function, Compiled) else function._pyfunc
    names = source.__code__.co_names
    space = {name: _there(name, value, names) for name, value in source.__globals__.items()}
    return cuda.jit(device=True)(
        FunctionType(source.__code__, space, source.__name__, source.__defaults__)
    )


def _there(name: str, value: Any, names: tuple[str, ...]) -> Any:
    """What a global name of a function stands for on the GPU, if the function uses these names."""
    if name not in names:
        return value
    if isinstance(value, Compiled):
        return ported(value)
    if name in _LIBDEVICE and callable(value) and not _SIMULATED:
        return getattr(cuda.libdevice, name)  # pyright: ignore[reportAttributeAccessIssue]
    if value is np or (isinstance(value, ModuleType) and value.__name__.startswith("stickslip.")):
        module = ModuleType(value.__name__)
        for inner in filter(partial(hasattr, value), names):
            setattr(module, inner, _there(inner, getattr(value, inner), names))
        return module
    return value


def space_of_thread(s: Any, a: int) -> Any:
    """The rows of a thread, field by field: compiled code knows no loop over the fields of a
    tuple."""
    return Space(
        s.W[a], s.V[a], s.mag[a], s.Rq[a], s.Rz[a], s.A[a], s.B[a], s.G[a],
        s.discs[a], s.balls[a], s.reaches[a], s.kinds[a], s.samples[a], s.bernstein[a],
        s.scratch[a], s.stack[a], s.touched[a], s.y0[a], s.trial[a], s.promise[a],
        s.powers[a], s.pending[a], s.labels[a], s.known[a], s.asked[a],
        s.stages[a], s.impact[a], s.tried[a], s.response[a], s.delassus[a], s.impulses[a],
        s.landed[a], s.stood[a], s.begun[a], s.answer[a], s.aims[a],
    )  # fmt: skip


def flight_of_thread(f: Any, a: int) -> Any:
    """The rows of a thread, field by field: compiled code knows no loop over the fields of a
    tuple."""
    m = f.making
    p = m.probes
    e = m.spectrum
    return Flight(
        f.v[a], f.size[a], f.value[a], f.terms[a], f.orders[a], f.r[a], f.turned[a], f.modulus[a],
        f.phase[a], f.rounding[a], f.spin[a], f.a[a], f.b[a], f.kind[a], f.lead[a], f.c[a],
        f.floor[a], f.guess[a], f.taylor[a], f.stack[a], f.mode0[a], f.reg0[a],
        Making(
            Probes(
                p.F[a], p.hold[a], p.later[a], p.s[a], p.y[a], p.out[a], p.rest[a], p.peak[a],
                p.basis[a], p.axes[a], p.lengths[a],
            ),
            Eigenproblem(
                e.H[a], e.Q[a], e.scale[a], e.v[a], e.T[a], e.Z[a], e.x[a], e.values[a],
                e.vectors[a],
            ),
            m.moving[a], m.part[a], m.members[a], m.V[a], m.L[a], m.ramp[a], m.bend[a], m.up[a],
            m.down[a], m.ones[a],
        ),
    )  # fmt: skip


def bench_of_thread(b: Any, a: int) -> Any:
    """The rows of a thread, field by field: compiled code knows no loop over the fields of a
    tuple."""
    return Bench(
        b.work[a], b.fit[a],
        Record(
            b.record.time[a], b.record.state[a], b.record.mode[a], b.record.region[a],
            b.record.cause[a],
        ),
        Steps(b.steps.work[a], b.steps.gap[a], b.steps.noise[a], b.steps.open[a]),
        Tally(b.tally.state[a], b.tally.law[a], b.tally.kinks[a], b.tally.total[a]),
        b.gaps[a], b.ends[a], b.balance[a], b.residuals[a], b.table[a],
        b.value[a], b.mode[a], b.region[a], b.felt[a],
    )  # fmt: skip


@cache
def _kernels(jets: Any, residual: Any, powers: Any, landings: Any) -> tuple[Any, Any]:
    """The kernels for a system: settle and measure, and exponents."""
    if sys.stderr.isatty():
        print("stickslip: compiling this system for the GPU, some minutes ...", file=sys.stderr)
    jets = ported(jets)
    residual = ported(residual)
    powers = ported(powers)
    landings = ported(landings)
    advance_here, grow_here = ported(advance_lane), ported(grow_lane)
    on_gpu: Any = cuda.jit(device=True)
    own_space, own_flight, own_bench = map(
        on_gpu, (space_of_thread, flight_of_thread, bench_of_thread)
    )

    @cuda.jit(device=True)
    def of_thread(e: Any, a: int) -> Any:
        f = e.flow
        flow = Flow(f.rows, f.k, own_space(f.space, a), f.order, f.tol, f.atol)
        machine = Machine(jets, residual, powers, landings)
        return Engine(machine, flow, own_flight(e.flight, a), e.forms, e.group, e.codes, e.lanes)

    @cuda.jit
    def advance(engine, marks, rules, saved, bench, found, stop):
        a = cuda.grid(1)  # pyright: ignore[reportCallIssue]
        if a < engine.codes.shape[0]:
            advance_here(
                of_thread(engine, a), marks, rules, saved, own_bench(bench, a), found, stop, a
            )

    @cuda.jit
    def grow(engine, twin, marks, rules, saved, bench, found, stop):
        a = cuda.grid(1)  # pyright: ignore[reportCallIssue]
        if a < engine.codes.shape[0]:
            work = own_bench(bench, a)
            grow_here(
                of_thread(engine, a), of_thread(twin, a), marks, rules, saved, work, found, stop, a
            )

    return advance, grow
