"""What a comparison says: the words that all kinds of cases share."""

from __future__ import annotations

import gc
import inspect
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from types import FrameType
from typing import Any

_LATER = 0.01  # s, after which a limit that was reached is said again
AGREED = "agreed"
REFUSED = "refused"
NOT_CERTIFIED = "not certified"
WRONG = "certified and wrong"
NO_REFERENCE = "reference failed"
KINDS = (AGREED, REFUSED, NOT_CERTIFIED, WRONG, NO_REFERENCE)


@dataclass(frozen=True)
class Verdict:
    """The verdict on a case.

    Attributes
    ----------
    kind : str
        One of KINDS. "refused": the library gave no result, with the reason in `note`; "not
        certified": it gave one and does not vouch for it; "certified and wrong": it vouches for a
        wrong one.
    note : str
        The reason, in words that are the same for all cases of one reason.
    numbers : dict
        Differences, tolerances, conditions.
    """

    kind: str
    note: str = ""
    numbers: dict[str, Any] = field(default_factory=dict)


class OutOfTime(Exception):
    """A computation took too long to wait for."""


def _ignores(frame: FrameType | None) -> bool:
    """Whether a callback of the garbage collector or of a weak reference is under way, or the hook
    that is told what was raised there: all of them ignore what is raised."""
    hook = sys.unraisablehook
    callbacks = [*gc.callbacks, hook.func if isinstance(hook, partial) else hook]
    codes = {getattr(callback, "__code__", None) for callback in callbacks}
    while frame is not None:
        removes = frame.f_globals.get("__name__") == "weakref" and frame.f_code.co_name == "remove"
        if removes or frame.f_code in codes:
            return True
        frame = frame.f_back
    return False


@contextmanager
def at_most(seconds: float) -> Iterator[None]:
    """Raise OutOfTime in the body after that much time of the processor (in the main thread of a
    process), and again until the body ends: what is raised in a finalizer, or in the callback of a
    weak reference, is ignored."""
    own = inspect.currentframe()

    def stop(number: int, frame: FrameType | None) -> None:
        if frame is not own and not _ignores(frame):
            raise OutOfTime(f"no answer within {seconds:g} s")

    before = signal.signal(signal.SIGPROF, stop)
    outer, _ = signal.getitimer(signal.ITIMER_PROF)  # what an outer one has left, or 0
    signal.setitimer(signal.ITIMER_PROF, min(seconds, outer or seconds), _LATER)
    started = time.process_time()
    try:
        yield
    finally:
        left = max(outer - (time.process_time() - started), _LATER) if outer > 0.0 else 0.0
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
        signal.setitimer(signal.ITIMER_PROF, left, _LATER if left else 0.0)
