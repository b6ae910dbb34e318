"""How a computation ends before it is done: at Ctrl-C, when its time is up, or with the pool that
it works for.

Python hears of a signal between two instructions of its own, so not while a compiled loop runs.
Compiled loops therefore look at two flags in their work space, and return early once one is raised;
a thread beside them raises the flags. A motion that is not cut short does not depend on them.

Whoever computes opens a scope (:func:`watching`), and calls :func:`check` after each compiled call
that may last: it raises what has happened. Scopes belong to threads. What runs inside a scope ends
with it.
"""

from __future__ import annotations

import contextlib
import math
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, TimeLimitError

_T = TypeVar("_T")
_LONGEST = 86_400.0  # seconds that the watchman sleeps at most


class Stopped(BaseException):
    """A task was given up, since there was a wish to stop.

    As KeyboardInterrupt, it is no Exception: it passes through what a user's function catches.
    """


class TimeUp(BaseException):
    """The limit of wall-clock time of a scope was reached.

    Attributes
    ----------
    scope : Scope
        Whose limit it was.
    """

    def __init__(self, scope: Scope) -> None:
        super().__init__(f"the time limit of {scope.limit:g} s was reached")
        self.scope = scope


class Scope:
    """What a computation listens to.

    Attributes
    ----------
    wish, late : arrays of int, shape (1,)
        Not zero once there is a wish to stop, and once the time is up.
    keyboard : bool
        Whether the wish is only that Python has a look at its signals.
    until : float
        When the time is up, by :func:`time.monotonic`.
    limit : float
        Seconds that were allowed; infinite without a limit of its own.
    owner : Scope
        Whose time is up first: this one's, or that of one around it.
    inner : bool
        Whether there is one around it.
    """

    def __init__(self, outer: Scope | None, limit: float, wish: Array | None) -> None:
        self.limit = limit
        self.until: float = time.monotonic() + limit if limit < math.inf else math.inf
        self.owner: Scope = self
        self.keyboard: bool = outer is None and wish is None
        self.wish: Array = np.zeros(1, np.int64)
        self.late: Array = np.zeros(1, np.int64)
        if wish is not None:
            self.wish = wish
        elif outer is not None:
            self.wish, self.keyboard = outer.wish, outer.keyboard
        self.inner: bool = outer is not None
        if outer is not None and outer.until <= self.until:
            self.until, self.late, self.owner = outer.until, outer.late, outer.owner

    def ends(self, why: BaseException) -> bool:
        """Whether the computation of this scope is what ends, and not one that it is a part of:
        its own time is up, or the user has interrupted the outermost one."""
        return why.scope is self if isinstance(why, TimeUp) else not self.inner


class _Here(threading.local):
    """The scope of a thread."""

    scope: Scope | None = None


_here = _Here()
_NEVER = Scope(None, math.inf, None)  # of a thread that listens to nothing


def scope() -> Scope:
    """The innermost scope of this thread."""
    return _here.scope or _NEVER


@contextlib.contextmanager
def watching(
    limit: float | None = None, wish: Array | None = None, around: Scope | None = None
) -> Iterator[Scope]:
    """Open a scope in this thread, for the time of a block.

    Parameters
    ----------
    limit : float, optional
        Seconds of wall-clock time.
    wish : array of int, shape (1,), optional
        Somebody else's flag; by default that of the scope around it, or, in the main thread, one
        that Ctrl-C raises.
    around : Scope, optional
        Of the thread that this one works for; by default the innermost one of this thread.
    """
    before = _here.scope
    outer = around or before
    inner = Scope(outer, math.inf if limit is None else limit, wish)
    with contextlib.ExitStack() as stack:
        stack.callback(setattr, _here, "scope", before)
        _here.scope = inner
        if inner.keyboard and outer is None:
            stack.enter_context(_listening(inner))
        if inner.owner is inner and limit is not None:
            stack.enter_context(_timed(inner))
        yield inner


@contextlib.contextmanager
def limited(limit: float | None, what: str) -> Iterator[Scope]:
    """A scope for what has no result unless it comes to its end.

    Parameters
    ----------
    limit : float, optional
        Seconds of wall-clock time.
    what : str
        What is computed.

    Raises
    ------
    DeclarationError
        If the limit is none.
    TimeLimitError
        If the time is up before the end of the block.
    """
    check_limit(limit)
    with watching(limit) as own:
        try:
            yield own
        except TimeUp as up:
            if not own.ends(up):
                raise
            raise TimeLimitError(
                what, f"none was found within the time limit of {limit:g} s", "Raise time_limit"
            ) from None


def check() -> bool:
    """End the computation if there is a reason to.

    Returns
    -------
    bool
        Whether a compiled call may have been cut short although there is none: then it is repeated,
        or goes on.

    Raises
    ------
    TimeUp
        If the time is up.
    Stopped
        If there was a wish to stop.
    """
    now = scope()
    if now.late[0] != 0:
        raise TimeUp(now.owner)
    if now.wish[0] == 0:
        return False
    if not now.keyboard:
        raise Stopped
    # Python has had its look; a handler that wants to end the computation has raised something.
    now.wish[0] = 0
    return True


def whole(call: Callable[[], _T]) -> _T:
    """What a compiled call computes that is not cut short.

    Parameters
    ----------
    call : function
        May be called again.
    """
    if _here.scope is None:
        with watching():
            return whole(call)
    while True:
        found = call()
        if not check():
            return found


def flagged(space: Any) -> Any:
    """Work space of compiled functions with the flags of this thread."""
    now = scope()
    if space.wish is now.wish and space.late is now.late:
        return space
    return space._replace(wish=now.wish, late=now.late)


def check_limit(limit: float | None) -> None:
    """Refuse a limit of wall-clock time that is none.

    Raises
    ------
    DeclarationError
    """
    if limit is None:
        return
    number = isinstance(limit, (int, float, np.integer, np.floating))
    if isinstance(limit, bool) or not number or not 0.0 < limit < math.inf:
        raise DeclarationError(
            "time_limit", f"{limit!r} is no duration", "Give seconds, a positive number"
        )


# -- the thread that raises flags ------------------------------------------------------------------


class _Watchman:
    """Sleeps until a signal has come or a time is up, and raises the flag that stands for it."""

    def __init__(self) -> None:
        import socket

        self._bell, self._rope = socket.socketpair()  # who pulls wakes it
        self._rope.setblocking(False)
        self.due: dict[Scope, float] = {}
        self.keyboard: Scope | None = None
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
            due = list(self.due.items())
            soonest = min((until for _, until in due), default=math.inf)
            self._bell.settimeout(min(max(soonest - time.monotonic(), 1e-3), _LONGEST))
            with contextlib.suppress(TimeoutError):
                self._signalled(self._bell.recv(4096))
            now = time.monotonic()
            for late, until in due:
                if until <= now:
                    late.late[0] = 1
                    self.due.pop(late, None)

    def _signalled(self, numbers: bytes) -> None:
        keyboard = self.keyboard
        if keyboard is not None and signal.SIGINT in numbers:
            keyboard.wish[0] = 1
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
    _here.scope = None


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_dismiss)


@contextlib.contextmanager
def _timed(late: Scope) -> Iterator[None]:
    """Raise the flag of a scope when its time is up."""
    watchman = _hired()
    watchman.due[late] = late.until
    watchman.wake()
    try:
        yield
    finally:
        watchman.due.pop(late, None)


@contextlib.contextmanager
def _listening(keyboard: Scope) -> Iterator[None]:
    """Raise the wish of a scope at Ctrl-C, if it is opened in the main thread: no other is told."""
    heard: Any = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(heard):
        yield
        return
    watchman = _hired()
    before = signal.set_wakeup_fd(watchman.rope, warn_on_full_buffer=False)
    watchman.keyboard, watchman.others = keyboard, before
    try:
        yield
    finally:
        watchman.keyboard = None
        signal.set_wakeup_fd(before)
