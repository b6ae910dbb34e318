"""A thread that raises flags, which compiled loops look at: at a signal, or when a time is up."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import threading
import time
from collections.abc import Iterator
from typing import Any

from stickslip.arrays import Array

_LONGEST = 86_400.0  # seconds that the watchman sleeps at most


class _Watchman:
    """Sleeps until a signal has come or a time is up, and raises the flag that stands for it."""

    def __init__(self) -> None:
        import socket

        self._bell, self._rope = socket.socketpair()  # who pulls wakes it
        self._rope.setblocking(False)
        self.due: dict[int, tuple[float, Array]] = {}
        self.keyboard: Array | None = None
        self.others: int = -1  # who else wants to know of signals
        threading.Thread(target=self._watch, name="stickslip watchman", daemon=True).start()

    @property
    def rope(self) -> int:
        """File descriptor to which a byte is written to wake it: the number of a signal, or 0."""
        return self._rope.fileno()

    def wake(self) -> None:
        """Let it look at what is due."""
        with contextlib.suppress(BlockingIOError):  # it is being woken already
            self._rope.send(b"\0")

    def _watch(self) -> None:
        while True:
            soonest = min((until for until, _ in list(self.due.values())), default=math.inf)
            self._bell.settimeout(min(max(soonest - time.monotonic(), 1e-3), _LONGEST))
            with contextlib.suppress(TimeoutError):
                self._signalled(self._bell.recv(4096))
            for until, late in list(self.due.values()):
                if until <= time.monotonic():
                    late[0] = 1
                    self.due.pop(id(late), None)

    def _signalled(self, numbers: bytes) -> None:
        keyboard = self.keyboard
        if keyboard is not None and signal.SIGINT in numbers:
            keyboard[0] = 1
        passed = numbers.replace(b"\0", b"")
        if self.others >= 0 and passed:
            with contextlib.suppress(OSError):
                os.write(self.others, passed)


_watchman: _Watchman | None = None
_hiring = threading.Lock()


def _hired() -> _Watchman:
    """The watchman of this process."""
    global _watchman
    with _hiring:
        if _watchman is None:
            _watchman = _Watchman()
        return _watchman


def _dismiss() -> None:
    """A process that was forked has no such thread."""
    global _watchman, _hiring
    _watchman, _hiring = None, threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_dismiss)


@contextlib.contextmanager
def timed(late: Array, until: float) -> Iterator[None]:
    """Raise a flag at a time, by :func:`time.monotonic`, if the block lasts until then."""
    watchman = _hired()
    watchman.due[id(late)] = until, late
    watchman.wake()
    try:
        yield
    finally:
        watchman.due.pop(id(late), None)


@contextlib.contextmanager
def hearing(wish: Array) -> Iterator[None]:
    """Raise a flag at Ctrl-C, in the main thread; no other is told of signals."""
    heard: Any = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(heard):
        yield
        return
    watchman = _hired()
    try:
        before = signal.set_wakeup_fd(watchman.rope, warn_on_full_buffer=False)
    except ValueError:  # the main thread of an interpreter in another one is told nothing, either
        yield
        return
    watchman.keyboard, watchman.others = wish, before
    try:
        yield
    finally:
        watchman.keyboard = None
        signal.set_wakeup_fd(before)
