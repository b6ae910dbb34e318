"""Worker processes, and the distribution of requests to them.

A question waits in its lane; a newer one of the same lane replaces it, or cancels the running one.
A worker that exceeds its limits of time or memory is terminated and replaced.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Hashable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from stickslip.errors import StickslipError
from stickslip.explorer.asking.answer import (
    Answer,
    Compiling,
    Ready,
    WorkerMessage,
    receive_frame,
    refusal,
    send_frame,
)
from stickslip.explorer.asking.limits import COMPILING, LONGEST, MOST_LANES, MOST_MESSAGE, SECONDS
from stickslip.explorer.asking.request import Request

_GRACE = 2.0  # seconds that a worker has to stop a task
_TICK = 0.25  # seconds between checks of the time
_QUICK = "motion"  # kind of request for which a worker is kept free
_COMPILING = Answer({"compiling": True})
Reply = Callable[[Answer | None, bool], None]
InLoop = Callable[[Callable[[], None]], Any]


@dataclass
class Job:
    """A question, its page, the callback for the answer (its parts, then None and True), and its
    length in characters."""

    page: Hashable
    request: Request
    reply: Reply
    size: int = 0

    @property
    def lane(self) -> tuple[Hashable, str]:
        """Key of the requests that a newer request replaces."""
        return self.page, self.request.lane


class Worker:
    """A process that answers one question at a time.

    Parameters
    ----------
    call : callable
        Runs a function in the thread of the server.
    heard : callable
        Called there with the worker and its message; None: it has ended.
    """

    def __init__(self, call: InLoop, heard: Callable[[Worker, Any], None]) -> None:
        self.job: Job | None = None
        self.ready = False
        self.given_up = False
        self.compiling = False
        self.since = time.monotonic()
        self.last_page: Hashable = None
        self._call = call
        self._heard = heard
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        self.process = subprocess.Popen(
            [sys.executable, "-m", "stickslip.explorer.work"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=environment,
            start_new_session=True,  # Ctrl-C is for the server
        )
        threading.Thread(target=self._listen, daemon=True).start()

    def begin(self, job: Job) -> None:
        """Work on this."""
        self.job = job
        self.given_up = False
        self.since = time.monotonic()
        self.last_page = job.page
        self._send(job.request)

    def give_up(self) -> None:
        """Cancel a job whose answer is no longer needed."""
        if not self.given_up:
            self.given_up = True
            self.since = time.monotonic()
            self._send(None)

    def overdue(self, now: float) -> bool:
        """Return whether the time limit is exceeded."""
        if self.job is None:
            return False
        limit = _GRACE if self.given_up else SECONDS.get(self.job.request.what, LONGEST)
        # The next request needs the machine code, too.
        return now - self.since > (COMPILING if self.compiling else limit)

    def end(self) -> None:
        """Kill it."""
        self.process.kill()

    def _send(self, thing: object) -> None:
        assert self.process.stdin is not None
        try:
            send_frame(self.process.stdin, thing)
        except Exception:
            # It has ended or cannot be reached. Its listener detects the end.
            self.end()

    def _listen(self) -> None:
        source = self.process.stdout
        assert source is not None
        said: Any = True
        while said is not None:
            try:
                said = receive_frame(source)
            except (EOFError, OSError, ValueError):
                said = None
            self._call(lambda said=said: self._heard(self, said))
        self.process.wait()
        for pipe in (self.process.stdin, source):
            with suppress(OSError):
                if pipe is not None:
                    pipe.close()


class WorkerPool:
    """Workers for all pages.

    Parameters
    ----------
    call : callable
        Runs a function in the thread of the server, from any thread.
    size : int, optional
        Number of workers; by default the number of processors, between two and four.
    first : Request, optional
        The expected first question.
    """

    def __init__(self, call: InLoop, size: int | None = None, first: Request | None = None) -> None:
        self._call = call
        self._size = size or min(max(os.cpu_count() or 2, 2), 4)
        self._expected = first
        self._waiting: dict[tuple[Hashable, str], Job] = {}
        self._closed = False
        self.replaced = 0
        self.workers: list[Worker] = [self._worker()]

    def ask(self, job: Job) -> None:
        """Queue a question for the next free worker."""
        self._waiting.pop(job.lane, None)
        others = [x for x in self._waiting.values() if x.page == job.page]
        if len(others) >= MOST_LANES or sum(x.size for x in others) + job.size > MOST_MESSAGE:
            job.reply(
                refusal(StickslipError("too many requests of this page at the same time")), True
            )
            return
        self._waiting[job.lane] = job
        for worker in self.workers:
            if worker.job is not None and (
                worker.job.lane == job.lane or _is_idle(worker.job, job)
            ):
                worker.give_up()
        self._distribute()
        if job.lane in self._waiting and any(w.compiling for w in self.workers):
            job.reply(_COMPILING, False)

    def drop(self, page: Hashable, lane: str | None = None) -> None:
        """Discard the questions of a closed page, or those of a lane."""
        for key in [k for k in self._waiting if k[0] == page and lane in (None, k[1])]:
            del self._waiting[key]
        for worker in self.workers:
            if worker.job and worker.job.page == page and lane in (None, worker.job.request.lane):
                worker.give_up()

    def tick(self) -> None:
        """End workers that exceed the time limit; to be called periodically."""
        now = time.monotonic()
        for worker in self.workers:
            if worker.overdue(now):
                worker.end()

    def close(self) -> None:
        """End all workers."""
        self._closed = True
        for worker in self.workers:
            worker.end()

    @property
    def tick_every(self) -> float:
        """Seconds between two ticks."""
        return _TICK

    def _worker(self) -> Worker:
        return Worker(self._call, self._heard)

    def _distribute(self) -> None:
        """Assign waiting questions to free workers, preferably to those that last worked for the
        same page; pages with the fewest workers come first."""
        last = [worker.last_page for worker in self.workers]
        for lane, job in sorted(self._waiting.items(), key=lambda item: last.count(item[1].page)):
            free = [w for w in self.workers if w.job is None and w.ready]
            slow = job.request.what != _QUICK
            if not free or (slow and len(free) == 1 and self._size > 1 and self._one_is_slow()):
                continue
            worker = next((w for w in free if w.last_page == job.page), free[0])
            del self._waiting[lane]
            worker.begin(job)

    def _one_is_slow(self) -> bool:
        """Return whether a worker is busy with a possibly slow question."""
        return any(w.job is not None and w.job.request.what != _QUICK for w in self.workers)

    def _heard(self, worker: Worker, said: Any) -> None:
        if self._closed or worker not in self.workers:
            return
        match said:
            case Ready():
                self._prepare(worker)
            case Compiling():
                self._compiles(worker)
            case WorkerMessage(answer=answer, final=final) if worker.job is not None:
                if not worker.given_up:
                    worker.job.reply(answer, final)
                if final:
                    self._done(worker, worker.job)
            case None:
                self._replace(worker)
        self._distribute()

    def _prepare(self, worker: Worker) -> None:
        """When a worker has loaded, let it repeat the last answered question, without a recipient,
        so that it has the model and the machine code for the next one."""
        worker.ready = True
        if self._expected is not None:
            worker.begin(Job(None, self._expected, lambda answer, final: None))

    def _compiles(self, worker: Worker) -> None:
        """When a worker compiles, notify the pages that wait for it, or for a free worker."""
        worker.compiling = True
        own = [worker.job] if worker.job is not None and not worker.given_up else []
        for job in [*own, *self._waiting.values()]:
            job.reply(_COMPILING, False)

    def _done(self, worker: Worker, job: Job) -> None:
        """A worker is free. The other workers are started after the first answer, so that they do
        not compete with it for processors."""
        worker.job = None
        worker.compiling = False
        if job.request.what == _QUICK and not worker.given_up:
            self._expected = job.request
        if job.page is not None and len(self.workers) < self._size:
            self.workers.append(self._worker())

    def _replace(self, worker: Worker) -> None:
        """When a worker has ended, report it, and start another one."""
        job = worker.job
        if job is not None and job.request is self._expected:
            self._expected = None  # it may end the next one, too
        self.workers[self.workers.index(worker)] = self._worker()
        self.replaced += 1
        if job is None or worker.given_up:
            return
        took_long = worker.overdue(time.monotonic())
        reason = "the computation took too long" if took_long else "the worker process ended"
        error = StickslipError(f"{reason}; a new worker was started")
        answer = refusal(error)
        job.reply(Answer({**answer.head, "lost": True}), False)
        job.reply(None, True)


def _is_idle(job: Job, asked: Job) -> bool:
    """Return whether a worker is preparing for a different question."""
    return job.page is None and job.request.setting != asked.request.setting
