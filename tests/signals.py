"""Ctrl-C for tests of what it ends."""

from __future__ import annotations

import gc
import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def control_c(delay: float) -> Iterator[list[float]]:
    """Ctrl-C after a while; receives when it was."""
    moments = list[float]()

    def send() -> None:
        moments.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(delay, send)
    # Python drops an exception that is raised while a callback of the garbage collector runs, and
    # hypothesis has one: Ctrl-C would be lost there.
    gc.disable()
    timer.start()
    try:
        yield moments
    finally:
        timer.cancel()
        gc.enable()
