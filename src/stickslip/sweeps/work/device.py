"""The compiled loops of maps on a GPU, one motion per thread.

Results of motions remain on the GPU until all are done.
"""

from __future__ import annotations

import os
import weakref
from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.native.systems import assembly_of
from stickslip.machine_code.cuda import Cuda
from stickslip.machine_code.emulated import Emulated
from stickslip.machine_code.functions import Entry
from stickslip.machine_code.ptx import find_mathematics
from stickslip.machine_code.words import Elsewhere, by_python
from stickslip.motion.ensemble import Lanes
from stickslip.motion.steps.arrays import DIMENSION
from stickslip.orbits.settling.engine.tables import DEVICE_LANES, make_bench
from stickslip.orbits.settling.engine.threads import (
    Shared,
    ThreadSpace,
    advance_thread,
    grow_thread,
)
from stickslip.orbits.settling.motions import POINT_SLOTS, Block, Settings
from stickslip.translator.values import TupleType, entry_types

if TYPE_CHECKING:
    from stickslip.motion.problem import Problem


_ROOM = 16  # number of knots that are measured together
_TURNS = 256  # number of marks after which control returns to the host
_SHARE = 0.5  # fraction of the free memory that motions may use
_EMULATED = "STICKSLIP_EMULATE_GPU"
_ENTRIES = advance_thread, grow_thread


class Device(Protocol):
    """A device with separate memory, on which threads run."""

    name: str

    def free(self) -> int:
        """Bytes that are free."""
        ...

    def allocate(self, size: int) -> int:
        """Address of so many bytes."""
        ...

    def release(self, address: int) -> None:
        """Give bytes back."""
        ...

    def send(self, address: int, array: Array) -> None:
        """Copy an array to the device."""
        ...

    def fetch(self, address: int, array: Array) -> None:
        """Copy from the device into an array."""
        ...

    def copy(self, source: int, target: int, size: int) -> None:
        """Copy bytes within the device."""
        ...

    def load(self, entries: Sequence[Entry], system: str) -> Sequence[Any]:
        """Entries on the device, which call the functions of a system, given as LLVM assembly."""
        ...

    def launch(self, function: Any, words: Array, count: int) -> None:
        """Run the loaded kernel in a number of threads, and wait for all of them; the words are all
        arguments except the last, which is the number of the thread."""
        ...


def check_device() -> None:
    """Raise an error without a GPU, or without its driver.

    Raises
    ------
    DeclarationError
    """
    if not os.environ.get(_EMULATED):
        find_mathematics()
    find_device()


def find_device() -> Device:
    """The GPU of this machine; with ``STICKSLIP_EMULATE_GPU=1``, for tests, this processor in its
    place."""
    return _emulated() if os.environ.get(_EMULATED) else _gpu()


@cache
def _gpu() -> Device:
    return Cuda()


@cache
def _emulated() -> Device:
    return Emulated()


def lanes_on_device(problem: Problem, settings: Settings) -> int:
    """Number of motions computed together, limited by memory; the results do not depend on it."""
    table = np.array([list(problem.parameters.values())])
    states = np.zeros((1, int(problem.rows.sizes[DIMENSION])))
    block = Block(problem, table, states, settings, False)
    tables = problem.empty_forms(1, POINT_SLOTS), thread_space(problem), block.marks
    sizes: list[int] = []
    each(lambda part: sizes.append(part.nbytes), tables)
    return int(np.clip(_SHARE * find_device().free() / sum(sizes), 1, DEVICE_LANES))


def thread_space(problem: Problem) -> ThreadSpace:
    """Work space of a thread; it contains no results of other threads."""
    return ThreadSpace(problem.space(), problem.flight(False), make_bench(problem, _ROOM))


class Memory:
    """Arrays on a device, which are freed with this object."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._taken: list[int] = []
        weakref.finalize(self, _release, device, self._taken)

    def put(self, array: Array) -> Elsewhere:
        """An array on the device."""
        return self._put(array, array.shape, array.nbytes)

    def put_for_all(self, count: int, array: Array) -> Elsewhere:
        """The same array for every thread (a leading axis)."""
        size = array.nbytes
        there = self._put(array, (count, *array.shape), count * size)
        done = 1
        while done < count and size:
            more = min(done, count - done)
            self._device.copy(there.address, there.address + done * size, more * size)
            done += more
        return there

    def _put(self, array: Array, shape: tuple[int, ...], size: int) -> Elsewhere:
        address = self._device.allocate(max(size, 1))
        self._taken.append(address)
        self._device.send(address, np.ascontiguousarray(array))
        return Elsewhere(address, shape, array.dtype)


def _release(device: Device, taken: list[int]) -> None:
    for address in taken:
        device.release(address)


class OnDevice:
    """The compiled loops of a block on the GPU."""

    def __init__(self, block: Block) -> None:
        self.block = block
        self.device: Device = find_device()
        self.count: int = len(block.lanes.codes)
        system = assembly_of(block.problem.compiled.generated)
        self.functions: Sequence[Any] = self.device.load(_ENTRIES, system)
        memory = self.memory = Memory(self.device)
        most = np.array([*block.rules.most[:2], _TURNS, block.rules.most[3]])
        self.engine: Any = each(memory.put, block.engine(block.lanes))
        self.twin: Any = self.engine._replace(
            codes=memory.put(block.twins.codes), lanes=each(memory.put, block.twins.now)
        )
        self.marks: Any = each(memory.put, block.marks)
        self.saved: Any = each(memory.put, block.saved)
        self.found: Any = each(memory.put, block.found)
        self.shared: Any = Shared(
            each(partial(memory.put_for_all, self.count), thread_space(block.problem)),
            self.marks,
            each(memory.put, block.rules._replace(most=most)),
            self.saved,
            self.found,
        )

    def advance(self) -> None:
        """Settle and measure."""
        self._launch(0, [(self.block.lanes, self.engine)])

    def grow_apart(self) -> None:
        """Measure exponents."""
        self._launch(1, [(self.block.lanes, self.engine), (self.block.twins, self.twin)])

    def _asked(self) -> tuple[Any, Any]:
        """Data from which the host proves and decides, on the device and on the host."""
        here, there = self.block.marks, self.marks
        names = "outcome", "real", "size", "home", "numbers"
        return (
            (*(getattr(here, name) for name in names), self.block.saved, self.block.lanes.now),
            (*(getattr(there, name) for name in names), self.saved, self.engine.lanes),
        )

    def ask(self) -> None:
        """Copy the states of motions that wait for a proof, with their closed forms, to the
        host."""
        self._fetch(self.block.lanes.forms, self.engine.forms)
        self._fetch(self.block.marks.frame, self.marks.frame)
        self._fetch(*self._asked())

    def answer(self) -> None:
        """Send the results of the proofs."""
        self._send(*self._asked())

    def fetch(self) -> None:
        """Copy the results and the states of the motions to the host."""
        self.ask()
        self._fetch(self.block.found, self.found)

    def remember(self) -> None:
        """Copy the marks of all motions to the host."""
        here, there = self.block.marks, self.marks
        for name in ("time", "state", "kind"):
            self._fetch(getattr(here, name), getattr(there, name))

    def _launch(self, number: int, involved: list[tuple[Lanes, Any]]) -> None:
        """Send the changes of the host, advance all motions, and fetch the data that the host
        needs."""
        looked_at = [(lanes.codes, there.codes) for lanes, there in involved]
        looked_at.append((self.block.marks.numbers, self.marks.numbers))
        for here, there in looked_at:
            self._send(here, there)
        given = *(there for _, there in involved), self.shared
        words = words_of(_ENTRIES[number], given)
        self.device.launch(self.functions[number], words, self.count)
        for here, there in looked_at:
            self._fetch(here, there)

    def _send(self, here: Any, there: Any) -> None:
        each_pair(lambda array, place: self.device.send(place.address, array), here, there)

    def _fetch(self, here: Any, there: Any) -> None:
        each_pair(lambda array, place: self.device.fetch(place.address, array), here, there)


def words_of(entry: Entry, given: tuple[Any, ...]) -> Array:
    """All arguments of an entry except the last, as words."""
    found = by_python(TupleType(tuple, entry_types(entry)[0][:-1]), given)
    assert found is not None
    return np.array(found, np.int64)


def each(function: Callable[[Array], Any], part: Any) -> Any:
    """Apply a function to all arrays of a tree of tuples."""
    if isinstance(part, tuple):
        inner = [each(function, item) for item in part]
        return type(part)(*inner) if hasattr(part, "_fields") else tuple(inner)
    return function(part) if isinstance(part, np.ndarray) else part


def each_pair(function: Callable[[Array, Any], Any], part: Any, other: Any) -> None:
    """Apply a function to all arrays of a tree of tuples and their counterparts in another one."""
    if isinstance(part, tuple):
        for item, counterpart in zip(part, other, strict=True):
            each_pair(function, item, counterpart)
    elif isinstance(part, np.ndarray):
        function(part, other)
