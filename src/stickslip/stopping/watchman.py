"""A thread that sets the flags checked by compiled loops, at a signal or a time limit."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import threading
import time
from typing import NamedTuple

from stickslip.arrays import Array

_LONGEST = 86_400.0  # longest sleep of the watchman in seconds


class Due(NamedTuple):
    """A flag that is to be raised at a time.

    Attributes
    ----------
    until : float
        When, by :func:`time.monotonic`.
    late : array of int, shape (1,)
        The flag.
    clock : int
        Of the processor time of a thread, by which more time may be left then; -1: none.
    spent : float
        Reading of that clock at which the time is up.
    """

    until: float
    late: Array
    clock: int = -1
    spent: float = 0.0

    def postponed(self) -> Due | None:
        """The same at the earliest time at which the thread can have spent its time; None if it
        has."""
        if self.clock == -1:
            return None
        try:
            left = self.spent - time.clock_gettime(self.clock)
        except OSError:  # the thread is gone
            return None
        return self._replace(until=time.monotonic() + left) if left > 0.0 else None


def thread_clock() -> int:
    """The clock of the processor time of this thread; -1 where the system has none."""
    if not hasattr(time, "pthread_getcpuclockid"):
        return -1
    return time.pthread_getcpuclockid(threading.get_ident())


class _Watchman:
    """A thread that sleeps until a signal arrives or a time is up, and raises the corresponding
    flag."""

    def __init__(self) -> None:
        import socket

        self._receiver, self._sender = socket.socketpair()
        self._sender.setblocking(False)
        # A byte sent there wakes the thread: the number of a signal, or 0.
        self.wakeup_fd: int = self._sender.fileno()
        self.due: dict[int, Due] = {}
        self.keyboard: Array | None = None
        self.others: int = -1  # the file descriptor of the previous receiver of signals
        threading.Thread(target=self._watch, name="stickslip watchman", daemon=True).start()

    def wake(self) -> None:
        """Wake the thread so that it checks which flags are due."""
        with contextlib.suppress(BlockingIOError):  # a wake-up signal is pending already
            self._sender.send(b"\0")

    def _watch(self) -> None:
        while True:
            soonest = min((due.until for due in list(self.due.values())), default=math.inf)
            self._receiver.settimeout(min(max(soonest - time.monotonic(), 1e-3), _LONGEST))
            with contextlib.suppress(TimeoutError):
                self._signalled(self._receiver.recv(4096))
            for key, due in list(self.due.items()):
                if due.until > time.monotonic():
                    continue
                later = due.postponed()
                if later is None:
                    due.late[0] = 1
                    self.due.pop(key, None)
                elif key in self.due:
                    self.due[key] = later

    def _signalled(self, numbers: bytes) -> None:
        keyboard = self.keyboard
        if keyboard is not None and signal.SIGINT in numbers:
            keyboard[0] = 1
        passed = numbers.replace(b"\0", b"")
        if self.others >= 0 and passed:
            with contextlib.suppress(OSError):
                os.write(self.others, passed)


_watchman: _Watchman | None = None
_creating = threading.Lock()


def _instance() -> _Watchman:
    """The watchman of this process."""
    global _watchman
    if _watchman is not None:
        return _watchman
    with _creating:
        if _watchman is None:
            _watchman = _Watchman()
        return _watchman


def _dismiss() -> None:
    """Discard the thread in a forked process, which does not inherit it."""
    global _watchman, _creating
    _watchman, _creating = None, threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_dismiss)


def expect(due: Due) -> None:
    """Register a flag that is to be raised at its time."""
    watchman = _instance()
    watchman.due[id(due.late)] = due
    watchman.wake()


def expect_no_more(late: Array) -> None:
    """Cancel a registered flag."""
    if _watchman is not None:
        _watchman.due.pop(id(late), None)


class PreviousHandler(NamedTuple):
    """The previous receiver of signals."""

    watchman: _Watchman
    before: int


def listen(interrupt: Array) -> PreviousHandler | None:
    """Raise a flag at Ctrl-C from now on. Returns None in threads other than the main one, which
    get no signals."""
    if threading.current_thread() is not threading.main_thread():
        return None
    watchman = _instance()
    try:
        before = signal.set_wakeup_fd(watchman.wakeup_fd, warn_on_full_buffer=False)
    except ValueError:  # the main thread of an interpreter in another one
        return None
    if before == watchman.wakeup_fd:  # an exception occurred before it was restored
        before = -1
    watchman.keyboard, watchman.others = interrupt, before
    return PreviousHandler(watchman, before)


def stop_listening(previous: PreviousHandler) -> None:
    """Return signals to their previous receiver."""
    previous.watchman.keyboard = None
    signal.set_wakeup_fd(previous.before)
