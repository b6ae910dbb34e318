"""Work for the tests of schedulers, in a module that other processes can import."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

from stickslip.stopping.scopes import check_stop


def square(number: int) -> int:
    return number * number


def die_once(task: tuple[str, int]) -> int:
    """The square, unless this is the first one to see the number 3."""
    folder, number = task
    if number == 3:
        try:
            (Path(folder) / "died").touch(exist_ok=False)
        except FileExistsError:
            return square(number)
        os.kill(os.getpid(), signal.SIGKILL)
    return square(number)


def die_always(task: tuple[str, int]) -> int:
    if task[1] == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return square(task[1])


def fail(number: int) -> int:
    raise ArithmeticError(f"no square of {number}")


def until_stopped(folder: str) -> int:
    """Report the start, and continue until a stop is requested."""
    (Path(folder) / "begun").touch()
    while not check_stop():
        time.sleep(0.01)
    return 0
