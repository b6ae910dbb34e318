"""Compilation of many modules, in two processes if there are two cores."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from stickslip.machine_code.objects import LOOPS, Processor, emitted, module_of
from stickslip.machine_code.store import keep, stored
from stickslip.progress import PATIENCE, watched

_FEW = 200_000  # number of characters below which another process does not pay


class Compilation(NamedTuple):
    """A module to be compiled.

    Attributes
    ----------
    text : str
        LLVM assembly.
    place : str
        File where it is kept, without suffix.
    key : str
        All that its machine code depends on.
    bitcode : bool
        Whether to keep bitcode, too.
    """

    text: str
    place: str
    key: str
    here: Processor
    bitcode: bool

    @property
    def path(self) -> Path:
        """File of its machine code."""
        return Path(f"{self.place}.o")

    def done(self) -> bytes | None:
        """Its machine code, if it is there."""
        missing = self.bitcode and stored(Path(f"{self.place}.bc"), self.key) is None
        return None if missing else stored(self.path, self.key)


def make_one(job: Compilation) -> bytes:
    """The machine code of a module, which is kept."""
    module = module_of(job.text, job.here, LOOPS)
    if job.bitcode:
        keep(Path(f"{job.place}.bc"), job.key, module.as_bitcode())
    code = emitted(module, job.here, LOOPS)
    keep(job.path, job.key, code)
    return code


def make_all(jobs: list[Compilation], what: str) -> list[bytes]:
    """The machine code of modules, from disk or new."""
    codes = [job.done() for job in jobs]
    left = [i for i, code in enumerate(codes) if code is None]
    # the largest first, in turns for each process
    left.sort(key=lambda i: -len(jobs[i].text))
    helper = _helper([jobs[i] for i in left[1::2]])
    mine = left if helper is None else left[0::2]
    try:
        with watched(f"compiling: {what}", patience=PATIENCE) as show:
            for count, i in enumerate(mine):
                show(count / len(mine), Path(jobs[i].place).name.rpartition(".")[0])
                codes[i] = make_one(jobs[i])
            if helper is not None:
                helper.wait()
    finally:
        if helper is not None:
            helper.terminate()
    # modules that the other process could not store are compiled here
    return [code or jobs[i].done() or make_one(jobs[i]) for i, code in enumerate(codes)]


def _helper(jobs: list[Compilation]) -> subprocess.Popen[bytes] | None:
    """A second process that compiles and stores some of the modules, or None."""
    if sum(len(job.text) for job in jobs) < _FEW or (os.cpu_count() or 1) < 2:
        return None
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-m", "stickslip.machine_code.making"]
    with suppress(OSError):
        helper = subprocess.Popen(command, stdin=subprocess.PIPE, env=environment)
        assert helper.stdin is not None
        with helper.stdin as there:
            pickle.dump(jobs, there)
        return helper
    return None


def _help(jobs: Any) -> None:
    for job in jobs:
        make_one(job)


if __name__ == "__main__":
    with suppress(KeyboardInterrupt):
        _help(pickle.load(sys.stdin.buffer))
