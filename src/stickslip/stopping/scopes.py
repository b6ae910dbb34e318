"""Scopes of time limits and interruptions of computations."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, TimeLimitError
from stickslip.stopping.watchman import (
    Due,
    PreviousHandler,
    expect,
    expect_no_more,
    listen,
    stop_listening,
    thread_clock,
)

_T = TypeVar("_T")


class Stopped(BaseException):
    """A task was abandoned, since a stop was requested.

    As KeyboardInterrupt, it is no Exception: it passes through what a user's function catches.
    """


class TimeUp(BaseException):
    """The limit of wall-clock time of a scope was reached.

    Attributes
    ----------
    scope : Watch
        Whose limit it was.
    """

    def __init__(self, scope: Watch) -> None:
        super().__init__(f"the time limit of {scope.limit:g} s was reached")
        self.scope = scope


class Watch:
    """Flags and limits that a computation checks.

    Attributes
    ----------
    interrupt, late : arrays of int, shape (1,)
        Not zero once a stop is requested, and once the time is up.
    keyboard : bool
        Whether the interrupt is only that Python has a look at its signals.
    until : float
        When the time is up, by :func:`time.monotonic`; of processor time at the earliest.
    firm : bool
        Whether it is wall-clock time that is limited.
    limit : float
        Seconds that were allowed; infinite without a limit of its own.
    owner : Watch
        Whose time is up first: this one's, or that of one around it.
    inner : bool
        Whether there is one around it.
    """

    def __init__(
        self, outer: Watch | None, limit: float, interrupt: Array | None, firm: bool = True
    ) -> None:
        self.limit = limit
        self.firm: bool = firm
        self.until: float = time.monotonic() + limit if limit < math.inf else math.inf
        self.owner: Watch = self
        self.keyboard: bool = outer is None and interrupt is None
        self.interrupt: Array = np.zeros(1, np.int64)
        self.late: Array = np.zeros(1, np.int64)
        if interrupt is not None:
            self.interrupt = interrupt
        elif outer is not None:
            self.interrupt, self.keyboard = outer.interrupt, outer.keyboard
        self.inner: bool = outer is not None
        if outer is not None and outer.until <= self.until:
            self.until, self.firm = outer.until, outer.firm
            self.late, self.owner = outer.late, outer.owner

    def ends(self, why: BaseException) -> bool:
        """Whether the computation of this scope ends, and not one that it is a part of: its time is
        up, or the user has interrupted the outermost one."""
        return why.scope is self if isinstance(why, TimeUp) else not self.inner


class _Here(threading.local):
    """The scope of a thread."""

    scope: Watch | None = None


_here = _Here()
_NEVER = Watch(None, math.inf, None)  # scope of a thread without a stop condition


def scope() -> Watch:
    """The innermost scope of this thread."""
    return _here.scope or _NEVER


class watching:
    """Opens a scope in this thread, for the time of a block.

    It is opened for every motion, and so is no generator, which takes four times as long.

    Parameters
    ----------
    limit : float, optional
        Seconds of wall-clock time.
    interrupt : array of int, shape (1,), optional
        Somebody else's flag; by default that of the scope around it, or, in the main thread, one
        that Ctrl-C raises.
    around : Watch, optional
        Of the thread that this one works for; by default the innermost one of this thread.
    processor : bool
        Whether the limit is one of processor time of this thread, where the system tells that.
    """

    def __init__(
        self,
        limit: float | None = None,
        interrupt: Array | None = None,
        around: Watch | None = None,
        processor: bool = False,
    ) -> None:
        self._limit = limit
        self._processor = processor
        self._interrupt = interrupt
        self._around = around
        self._before: Watch | None = None
        self._previous: PreviousHandler | None = None
        self._expected: Array | None = None

    def __enter__(self) -> Watch:
        self._before = _here.scope
        outer = self._around or self._before
        limit = math.inf if self._limit is None else self._limit
        clock = thread_clock() if self._processor else -1
        inner = Watch(outer, limit, self._interrupt, firm=clock == -1)
        if outer is None and inner.keyboard:
            self._previous = listen(inner.interrupt)
        if inner.owner is inner and self._limit is not None:
            spent = time.clock_gettime(clock) + self._limit if clock != -1 else 0.0
            expect(Due(inner.until, inner.late, clock, spent))
            self._expected = inner.late
        # Last: an exception before leaves the scope as it was.
        _here.scope = inner
        return inner

    def __exit__(self, *error: object) -> None:
        _here.scope = self._before
        if self._previous is not None:
            stop_listening(self._previous)
        if self._expected is not None:
            expect_no_more(self._expected)


@contextlib.contextmanager
def limited(limit: float | None, what: str) -> Iterator[Watch]:
    """A scope for computations that have no result unless they are completed.

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
                what, f"no result within the time limit of {limit:g} s", "Increase time_limit"
            ) from None


def check_stop() -> bool:
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
        If a stop was requested.
    """
    now = scope()
    # A busy machine may have kept the watchman from raising the flag.
    if now.late[0] != 0 or (now.firm and time.monotonic() > now.until):
        raise TimeUp(now.owner)
    if now.interrupt[0] == 0:
        return False
    if not now.keyboard:
        raise Stopped
    # Python's handlers have run; one that ends the computation has raised an exception.
    now.interrupt[0] = 0
    return True


def unbroken(call: Callable[[], _T]) -> _T:
    """Evaluate a compiled call, repeating it if it was interrupted.

    Parameters
    ----------
    call : function
        May be called again.
    """
    if _here.scope is None:
        with watching():
            return unbroken(call)
    while True:
        found = call()
        if not check_stop():
            return found


def flagged(space: Any) -> Any:
    """Work space of compiled functions with the flags of this thread."""
    now = scope()
    if space.interrupt is now.interrupt and space.late is now.late:
        return space
    return space._replace(interrupt=now.interrupt, late=now.late)


def check_limit(limit: float | None) -> None:
    """Reject a limit of wall-clock time that is none.

    Raises
    ------
    DeclarationError
    """
    if limit is None:
        return
    number = isinstance(limit, (int, float, np.integer, np.floating))
    if isinstance(limit, bool) or not number or not 0.0 < limit < math.inf:
        raise DeclarationError(
            "time_limit", f"{limit!r} is not a duration", "Give a positive number of seconds"
        )
