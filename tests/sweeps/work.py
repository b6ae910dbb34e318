"""Work for the tests of schedulers, in a module that other processes can import."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

from stickslip.arrays import Array
from stickslip.progress import Stopped


def square(number: int, stop: Array) -> int:
    return number * number


def die_once(task: tuple[str, int], stop: Array) -> int:
    """The square, unless this is the first one to see the number 3."""
    folder, number = task
    if number == 3:
        try:
            (Path(folder) / "died").touch(exist_ok=False)
        except FileExistsError:
            return square(number, stop)
        os.kill(os.getpid(), signal.SIGKILL)
    return square(number, stop)


def die_always(task: tuple[str, int], stop: Array) -> int:
    if task[1] == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return square(task[1], stop)


def fail(number: int, stop: Array) -> int:
    raise ArithmeticError(f"no square of {number}")


def until_stopped(folder: str, stop: Array) -> int:
    """Says that it has begun, and goes on until it sees the flag."""
    (Path(folder) / "begun").touch()
    while stop[0] == 0:
        time.sleep(0.01)
    raise Stopped
