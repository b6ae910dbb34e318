"""An emulation of a GPU on the CPU, for tests on machines without one."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence

import numpy as np

from stickslip.arrays import Array
from stickslip.machine_code.functions import Entry

_FREE = 2**30  # bytes
_GARBAGE = 0xFF  # a byte of uninitialized memory: not a number


class Emulated:
    """Its memory is apart; its threads run one after the other.

    What an entry calls of a system stands where its arguments say, as on the processor.

    Attributes
    ----------
    launches : int
        So far.
    """

    def __init__(self) -> None:
        self.name = "emulated"
        self.launches = 0
        self._memory: dict[int, Array] = {}

    @property
    def taken(self) -> int:
        """Bytes that are not free."""
        return sum(len(room) for room in self._memory.values())

    def free(self) -> int:
        """Bytes that are free."""
        return _FREE - self.taken

    def allocate(self, size: int) -> int:
        """Address of so many bytes."""
        room = np.full(size, _GARBAGE, np.uint8)
        self._memory[room.ctypes.data] = room
        return room.ctypes.data

    def release(self, address: int) -> None:
        """Give bytes back."""
        del self._memory[address]

    def send(self, address: int, array: Array) -> None:
        """Copy an array to the device."""
        ctypes.memmove(address, array.ctypes.data, array.nbytes)

    def fetch(self, address: int, array: Array) -> None:
        """Copy from the device into an array."""
        ctypes.memmove(array.ctypes.data, address, array.nbytes)

    def copy(self, source: int, target: int, size: int) -> None:
        """Copy bytes within the device."""
        ctypes.memmove(target, source, size)

    def load(self, entries: Sequence[Entry], system: str) -> list[Entry]:
        """Entries on the device."""
        return list(entries)

    def launch(self, function: Entry, words: Array, count: int) -> None:
        """Run the loaded function in a number of threads.

        Parameters
        ----------
        words : array of int
            All arguments but the last.
        """
        self.launches += 1
        own = np.append(words, 0)
        for thread in range(count):
            own[-1] = thread
            function.prepared.run(own.ctypes.data)
