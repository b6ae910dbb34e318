"""Many motions on a GPU, one per thread: the event loop, compiled from the same source for another machine.

The compiled functions of :mod:`stickslip.motion` and of a system are scalar loops over arrays that allocate nothing, so
that each of them is also a device function. Closed forms are made by the host between two launches, as for threads.
"""

from __future__ import annotations

from functools import cache
from types import FunctionType, ModuleType
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numba import cuda
from numba.core.dispatcher import Dispatcher

from stickslip.errors import StickslipError
from stickslip.motion import engine
from stickslip.motion.affine import Flight
from stickslip.motion.batch import BATCH_SLOTS
from stickslip.motion.kernel import FULL, Lane, Record, Space
from stickslip.motion.lanes import Lanes

if TYPE_CHECKING:
    from stickslip.motion.problem import Problem

Array = np.ndarray
Tables = TypeVar("Tables", bound=tuple)

THREADS = 64  # of a block


def follow_on_device(
    problem: Problem, table: Array, states: Array, span: tuple[float, float], max_events: int = 1_000_000
) -> tuple[Lane, Array]:
    """Follow motions with the parameters of the rows of a table: where they are at their end, and outcome codes.

    Parameters
    ----------
    problem : Problem
    table : array, shape (motions, parameters)
    states : array, shape (motions, n)
    span : (float, float)
    max_events : int

    Raises
    ------
    StickslipError
        If there is no GPU.
    """
    if not cuda.is_available():
        remedy = "Install the extra 'gpu' on a machine with an NVIDIA GPU, or leave the work to the processor"
        raise StickslipError(f"No CUDA device was found. {remedy}")
    count, kernel = len(states), _kernel(problem.compiled.jets, problem.compiled.residual)
    forms = problem.empty_forms(count, BATCH_SLOTS)
    lanes = Lanes.start(problem, problem.constants_of(table), np.arange(count), states, span, forms)
    rows, constants, group = on_device(problem.rows), on_device(lanes.constants), cuda.to_device(lanes.group)
    space, flight = (on_device(of_each(work, count)) for work in (problem.space(), problem.flight()))
    small = np.zeros((1, 1), np.int8)
    nothing = on_device(Record(np.zeros(1), np.zeros((1, 1)), small, small, np.zeros(1, np.int64)))
    while len(lanes.going):
        lanes.make_closed_forms()
        now, codes = on_device(lanes.now), cuda.to_device(lanes.codes)
        kernel[-(-count // THREADS), THREADS](
            rows,
            space,
            flight,
            constants,
            on_device(lanes.forms),
            lanes.slots,
            problem.order,
            problem.tolerance,
            problem.atol,
            span[1],
            max_events,
            group,
            codes,
            now,
            nothing,
        )
        lanes.codes = on_host(codes)
        lanes.now = Lane(*map(on_host, now))
    return lanes.now, lanes.codes


def on_device(tables: Tables) -> Tables:
    """The same tables in the memory of the GPU."""
    return type(tables)(*(cuda.to_device(part) for part in tables))


def on_host(part: Any) -> Array:
    """A table of the GPU in the memory of the host."""
    return part.copy_to_host()


def of_each(work: Tables, count: int) -> Tables:
    """Work space for every thread (a leading axis)."""
    return type(work)(*(np.repeat(part[None], count, axis=0) for part in work))


@cache
def ported(function: Any) -> Any:
    """A compiled function as a device function, with everything it calls.

    Functions are found by the names that the code uses, in its own module or in a module of the package it names.
    """
    source = function.py_func if isinstance(function, Dispatcher) else function._pyfunc
    space, names = dict(source.__globals__), source.__code__.co_names
    for name in names:
        value = space.get(name)
        if isinstance(value, Dispatcher):
            space[name] = ported(value)
        elif isinstance(value, ModuleType) and value.__name__.startswith("stickslip."):
            space[name] = ModuleType(value.__name__)
            for inner in names:
                item = getattr(value, inner, None)
                setattr(space[name], inner, ported(item) if isinstance(item, Dispatcher) else item)
    return cuda.jit(device=True)(FunctionType(source.__code__, space, source.__name__, source.__defaults__))


@cache
def _kernel(jets: Any, residual: Any) -> Any:
    """The kernel for a system."""
    integrate, jets, residual = ported(engine.integrate), ported(jets), ported(residual)

    @cuda.jit
    def follow(rows, s, f, constants, forms, slots, N, tol, atol, end, max_events, group, codes, lanes, nothing):
        a = cuda.grid(1)  # pyright: ignore[reportCallIssue]
        if a >= codes.shape[0] or codes[a] < FULL:
            return
        b = a + 1
        space = Space(
            s.W[a], s.V[a], s.mag[a], s.Rq[a], s.Rz[a], s.A[a], s.B[a], s.G[a], s.scratch[a], s.stack[a],
            s.touched[a], s.y0[a], s.trial[a], s.promise[a], s.powers[a], s.pending[a], s.labels[a], s.known[a],
        )  # fmt: skip
        flight = Flight(
            f.v[a], f.s[a], f.de[a], f.orders[a], f.e[a], f.r[a], f.p[a], f.up[a], f.down[a], f.c[a], f.a[a], f.b[a],
            f.taylor[a], f.stack[a], f.mode0[a], f.reg0[a],
        )  # fmt: skip
        lane = Lane(
            lanes.clock[a:b], lanes.y[a:b], lanes.mode[a:b], lanes.settled[a:b], lanes.reg[a:b], lanes.counters[a:b]
        )
        integrate(
            jets, residual, rows, space, flight, constants, forms, slots, N, tol, atol, end, max_events, group[a:b],
            codes[a:b], lane, False, nothing,
        )  # fmt: skip

    return follow
