"""Computes a map and kills itself at random moments: ``killing.py STORE LOG KILLS``.

Every attempt is a child of this process, which has imported everything and started nothing. The log
gets a line for every progress: the attempt and the points done; the first one of an attempt says
what it found in the store.
"""

from __future__ import annotations

import os
import random
import signal
import sys
import time

import xarray  # noqa: F401
import zarr.codecs
import zarr.storage  # noqa: F401

import stickslip as ss
import stickslip.sweeps.request.user_measures
from stickslip.sweeps.sweep import Progress, sweep
from sweeps import stand_in

OVER = {"P": "0.6:1.6:40", "delta": "0.01:0.2:40"}
MEASURE = ["speed", "period"]


def attempt(store: str, log: str, number: int, begun: int) -> None:
    file = os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT)

    def note(state: Progress) -> None:
        os.write(file, f"{number} {state.done}\n".encode())
        if state.new > 0:
            os.write(begun, b"!")

    settings = stand_in.Settings(pause=0.02)
    sweep(ss.catalogue.rocking_toy(), OVER, MEASURE, store, settings=settings, progress=note)


if __name__ == "__main__":
    sys.modules["stickslip.sweeps.work.chunk"] = stand_in
    moments = random.Random(20)
    for number in range(int(sys.argv[3])):
        begun, tell = os.pipe()
        child = os.fork()
        if child == 0:
            attempt(sys.argv[1], sys.argv[2], number, tell)
            os._exit(0)
        os.close(tell)
        if number % 2:  # before it has computed anything, or between and within later points
            os.read(begun, 1)
        time.sleep(moments.uniform(0.0, 0.1))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        os.close(begun)
