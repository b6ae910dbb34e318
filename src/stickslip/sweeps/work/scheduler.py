"""Schedulers: threads, processes, or the workers of a Dask cluster.

All three are executors of :mod:`concurrent.futures`, used by the same loop. The result at a point
does not depend on the scheduler, nor on the other points.
"""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import threading
import uuid
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
    ALL_COMPLETED,
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from types import FrameType
from typing import Any, TypeVar

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, StickslipError
from stickslip.stopping.scopes import Stopped, watching

_T = TypeVar("_T")
_R = TypeVar("_R")
_CHANCES = 4  # number of workers that may fail on one task before the task is regarded as the cause
_AHEAD = 2  # number of tasks that are handed out to each worker
ANSWER_WITHIN = 10.0  # seconds within which a cluster has to answer
# seconds after which a request to stop is noticed, and that tasks under way then have to end
_PULSE = 0.25
_LOCAL = ("threads", "processes")


class Interrupt:
    """A request to end early, from Ctrl-C: the first one stops running tasks, the second one ends
    immediately.

    Parameters
    ----------
    flag : array of int, shape (1,)
        Set to 1; polled by the workers.
    """

    def __init__(self, flag: Array | None = None) -> None:
        self.flag: Array = np.zeros(1, np.int64) if flag is None else flag

    @property
    def requested(self) -> bool:
        """Whether a stop was requested."""
        return bool(self.flag[0] != 0)

    def __call__(self, number: int, frame: FrameType | None) -> None:
        if self.requested:
            raise KeyboardInterrupt
        self.flag[0] = 1
        if os.isatty(2):  # unbuffered: a signal may come in the middle of other output
            os.write(2, b"\nending; the chunks that are done are kept\n")


@contextlib.contextmanager
def listening(flag: Array) -> Iterator[Interrupt]:
    """Treat Ctrl-C as a request to end, within a block; only possible in the main thread."""
    stop = Interrupt(flag)
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    before = signal.signal(signal.SIGINT, stop)
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, before)


class Pool:
    """Workers: an executor that can be opened again after it has broken.

    Parameters
    ----------
    scheduler : str
        ``"threads"``, ``"processes"``, or the address of the scheduler of a Dask cluster.
    workers : int, optional
        Number of threads or processes; by default that of the cores.

    Attributes
    ----------
    flag : array of int, shape (1,)
        In memory shared by threads and processes; 1 if running tasks must stop.

    Raises
    ------
    DeclarationError
        If the number of workers is invalid.
    StickslipError
        If there is no cluster at the address.
    """

    def __init__(self, scheduler: str = "threads", workers: int | None = None) -> None:
        if workers is not None and workers < 1:
            raise DeclarationError(
                "workers", f"{workers} is not a number of workers", "Give at least 1"
            )
        self.scheduler = scheduler
        self.count: int = workers or os.cpu_count() or 1
        self._shared: Any = None
        self.flag: Array = np.zeros(1, np.int64)
        if scheduler == "processes":
            self._shared = _context().RawArray("q", 1)
            self.flag = np.frombuffer(self._shared, np.int64)
        self._key = uuid.uuid4().hex
        self._client: Any = None
        self._executor: Executor | None = None

    def __enter__(self) -> Pool:
        if self.scheduler not in _LOCAL:
            self._client = _client(self.scheduler)
        return self

    def __exit__(self, *error: object) -> None:
        try:
            self.close()
        finally:
            if self._client is not None:
                self._client.close()

    def close(self, executor: Executor | None = None) -> None:
        """Shut down the workers, or those of one executor; tasks that have not started are
        cancelled."""
        if self._executor is not None and executor in (None, self._executor):
            # The executor of a cluster cancels pending tasks by default.
            options = {"cancel_futures": True} if self._client is None else {}
            self._executor.shutdown(wait=False, **options)
            self._executor = None

    @property
    def width(self) -> int:
        """Number of workers available now."""
        return self.count if self._client is None else max(1, sum(self._client.nthreads().values()))

    def submit(self, function: Callable[[_T], _R], task: _T) -> tuple[Future[_R | None], Executor]:
        """Submit a task, and record its executor."""
        try:
            return self._submit_one(function, task)
        except BrokenExecutor:
            self._executor = None
            return self._submit_one(function, task)

    def _submit_one(
        self, function: Callable[[_T], _R], task: _T
    ) -> tuple[Future[_R | None], Executor]:
        executor = self._executor = self._executor or self._open()
        if self.scheduler == "threads":
            return executor.submit(_attempt, function, task, self.flag), executor
        return executor.submit(_attempt_elsewhere, function, task, self._key), executor

    def give_up(self) -> None:
        """Set the flag of workers that do not share memory with this machine."""
        if self._client is None:
            return
        # A worker that has just died never answers.
        telling = threading.Thread(
            target=self._client.run,
            args=(_raise_flag, self._key),
            kwargs={"on_error": "ignore"},
            daemon=True,
        )
        telling.start()
        telling.join(ANSWER_WITHIN)

    def _open(self) -> Executor:
        if self._client is not None:
            return self._client.get_executor(pure=False)
        if self.scheduler == "threads":
            return ThreadPoolExecutor(self.count)
        return ProcessPoolExecutor(
            self.count, _context(), initializer=_begin, initargs=(self._key, self._shared)
        )


def _context() -> Any:
    import multiprocessing

    return multiprocessing.get_context("spawn")  # a fork of a process with threads may hang


_flags: dict[str, Array] = {}
"""The flags that a worker process knows, by pool."""


def _begin(key: str, shared: Any) -> None:
    """Ignore Ctrl-C in a worker process: it reaches all processes of a terminal, and the main
    process sets the flag."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _flags[key] = np.frombuffer(shared, np.int64)


def _flag_of(key: str) -> Array:
    return _flags.setdefault(key, np.zeros(1, np.int64))


def _raise_flag(key: str) -> None:
    _flag_of(key)[0] = 1


def _attempt(function: Callable[[_T], _R], task: _T, flag: Array) -> _R | None:
    """The result of a task; None if it was stopped."""
    try:
        with watching(interrupt=flag):
            return function(task)
    except Stopped:
        return None


def _attempt_elsewhere(function: Callable[[_T], _R], task: _T, key: str) -> _R | None:
    return _attempt(function, task, _flag_of(key))


def _client(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError:
        raise StickslipError(
            "a cluster needs dask.distributed; install stickslip[cluster]"
        ) from None
    try:
        return Client(address, timeout=ANSWER_WITHIN, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise StickslipError(
            f"{address}: no Dask scheduler answers at this address ({reason}). Check the address"
        ) from None


@contextlib.contextmanager
def local_cluster(workers: int | None) -> Iterator[str]:
    """The address of a cluster on this machine, within a block."""
    from multiprocessing.resource_tracker import ensure_running

    try:
        from distributed import LocalCluster
    except ImportError:
        raise StickslipError(
            "a cluster needs dask.distributed; install stickslip[cluster]"
        ) from None

    def made() -> Any:
        # Ctrl-C reaches all processes of a terminal. Workers and their replacements inherit from
        # this thread that they ignore it. (The process that starts the tracker undoes that.)
        ensure_running()
        if hasattr(signal, "pthread_sigmask"):
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        # Without an address it would take a port that another cluster may have.
        options: dict[str, Any] = {"threads_per_worker": 1, "dashboard_address": ":0"}
        options["silence_logs"] = logging.CRITICAL
        return LocalCluster(n_workers=workers or os.cpu_count() or 1, **options)

    with ThreadPoolExecutor(1) as helper:
        starting = helper.submit(made)
        try:
            yield starting.result().scheduler_address
        finally:
            with contextlib.suppress(Exception):  # errors are irrelevant: the process ends
                starting.result().close(timeout=ANSWER_WITHIN)


def distribute(
    function: Callable[[_T], _R], tasks: Iterable[_T | None], pool: Pool, stop: Interrupt
) -> Iterator[tuple[_T, _R]]:
    """Results of tasks, in the order of completion; few tasks are submitted at any time.

    Parameters
    ----------
    function : callable
        Function of a task; it runs in a scope with the flag of the pool
        (:mod:`stickslip.stopping`). Its results are not None.
    tasks : iterable
        Consumed one by one, as workers become free. None means that all remaining tasks wait for
        running ones; the iterator is then polled again after a task completes.
    stop : Stop
        After a request no task is started, and tasks that are not ready shortly afterwards are
        abandoned.

    Yields
    ------
    task, result

    Raises
    ------
    StickslipError
        If workers die repeatedly in one task, or the cluster disconnects.
    """
    source = iter(tasks)
    again = list[_T]()
    lost: dict[int, int] = {}
    pending: dict[Future[_R | None], tuple[_T, Executor]] = {}
    last = False
    while True:
        most = _AHEAD * pool.width
        while not stop.requested and len(pending) < most:
            task = again.pop() if again else next(source, None)
            if task is None:
                break
            future, executor = pool.submit(function, task)
            pending[future] = task, executor
        if not pending or last:
            for future in pending:
                future.cancel()
            return
        last = stop.requested
        if last:
            pool.give_up()
        for future in wait(
            pending, timeout=_PULSE, return_when=ALL_COMPLETED if last else FIRST_COMPLETED
        ).done:
            task, executor = pending.pop(future)
            try:
                result = future.result()
            except Exception as error:
                if not _worker_died(error):
                    raise
                again.append(task)
                lost[id(task)] = lost.get(id(task), 0) + 1
                if lost[id(task)] >= _CHANCES:
                    raise _fatal(error) from None
                if isinstance(error, BrokenExecutor):
                    pool.close(executor)
                continue
            if result is not None:
                yield task, result


def _worker_died(error: Exception) -> bool:
    """Return whether a task failed because its worker died."""
    return isinstance(error, BrokenExecutor) or type(error).__name__ == "KilledWorker"


def _fatal(error: Exception) -> StickslipError:
    reason = " ".join(str(error).split()) or type(error).__name__
    return StickslipError(
        f"workers died {_CHANCES} times on the same chunk ({reason}). Give them more memory"
    )
