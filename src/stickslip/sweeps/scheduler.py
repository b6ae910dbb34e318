"""Who does the work: threads, processes, or the workers of a Dask cluster.

All three are executors of :mod:`concurrent.futures`, and one loop serves them. What is computed at a point does not
depend on who computes it, nor on what else is computed.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
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

from stickslip.errors import DeclarationError, StickslipError

T = TypeVar("T")
R = TypeVar("R")
CHANCES = 4  # workers that may die over one task before the task is to blame
AHEAD = 2  # tasks that are handed out for each worker
PATIENCE = 10.0  # seconds that a cluster has to answer
LOCAL = ("threads", "processes")


class Stop:
    """A wish to end early, from Ctrl-C: the first one lets what has begun be finished, the second one does not."""

    def __init__(self) -> None:
        self.wished = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        if self.wished:
            raise KeyboardInterrupt
        self.wished = True
        if os.isatty(2):  # written at once: a signal may come in the middle of other output
            os.write(2, b"\nending when the chunks in work are done; Ctrl-C again ends now\n")


@contextlib.contextmanager
def listening() -> Iterator[Stop]:
    """Take Ctrl-C for a wish to end, for the time of a block; only the main thread can."""
    stop = Stop()
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

    Raises
    ------
    DeclarationError
        If the number of workers is none.
    StickslipError
        If there is no cluster at the address.
    """

    def __init__(self, scheduler: str = "threads", workers: int | None = None) -> None:
        if workers is not None and workers < 1:
            raise DeclarationError("workers", f"{workers} is not a number of workers", "Give at least 1")
        self.scheduler = scheduler
        self.count = workers or os.cpu_count() or 1
        self._client: Any = None
        self._executor: Executor | None = None

    def __enter__(self) -> Pool:
        if self.scheduler not in LOCAL:
            self._client = _client(self.scheduler)
        return self

    def __exit__(self, *error: object) -> None:
        try:
            self.close()
        finally:
            if self._client is not None:
                self._client.close()

    def close(self, executor: Executor | None = None) -> None:
        """Send the workers home, or those of one executor; what they have not begun is dropped."""
        if self._executor is not None and executor in (None, self._executor):
            # The executor of a cluster cancels what it does not wait for, without being asked.
            options = {"cancel_futures": True} if self._client is None else {}
            self._executor.shutdown(wait=False, **options)
            self._executor = None

    @property
    def width(self) -> int:
        """Workers that work side by side now."""
        return self.count if self._client is None else max(1, sum(self._client.nthreads().values()))

    def submit(self, function: Callable[[T], R], task: T) -> tuple[Future[R], Executor]:
        """Hand out a task; who has it is told, too."""
        if self._executor is None:
            self._executor = self._open()
        try:
            return self._executor.submit(function, task), self._executor
        except BrokenExecutor:
            self._executor = self._open()
            return self._executor.submit(function, task), self._executor

    def _open(self) -> Executor:
        if self._client is not None:
            return self._client.get_executor(pure=False)
        if self.scheduler == "threads":
            return ThreadPoolExecutor(self.count)
        import multiprocessing

        # A fork of a process with threads may hang.
        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(self.count, context, initializer=_ignore_interrupts)


def _ignore_interrupts() -> None:
    """Ctrl-C reaches all processes of a terminal; the one that writes decides."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _client(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError:
        raise StickslipError("a cluster needs dask.distributed; install stickslip[cluster]") from None
    try:
        return Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise StickslipError(f"{address}: no Dask scheduler answers there ({reason}). Check the address") from None


@contextlib.contextmanager
def local_cluster(workers: int | None) -> Iterator[str]:
    """The address of a cluster on this machine, for the time of a block."""
    try:
        from distributed import LocalCluster
    except ImportError:
        raise StickslipError("a cluster needs dask.distributed; install stickslip[cluster]") from None
    options: dict[str, Any] = {"threads_per_worker": 1, "dashboard_address": None}
    made: Any = LocalCluster(n_workers=workers or os.cpu_count() or 1, **options)
    with made as cluster:
        yield cluster.scheduler_address


def distribute(function: Callable[[T], R], tasks: Iterable[T], pool: Pool, stop: Stop) -> Iterator[tuple[T, R]]:
    """Results of tasks, in the order in which they are ready; few are under way at any time.

    Parameters
    ----------
    function : callable
    tasks : iterable
        Looked at one by one, as workers become free.
    pool : Pool
    stop : Stop
        Once it is wished for, no task is begun any more.

    Yields
    ------
    task, result

    Raises
    ------
    StickslipError
        If workers die over one task again and again, or the cluster goes away.
    """
    source, again = iter(tasks), list[T]()
    lost: dict[int, int] = {}
    pending: dict[Future[R], tuple[T, Executor]] = {}
    while True:
        most = AHEAD * pool.width
        while not stop.wished and len(pending) < most:
            task = again.pop() if again else next(source, None)
            if task is None:
                break
            future, executor = pool.submit(function, task)
            pending[future] = task, executor
        if stop.wished:
            for future in [future for future in pending if future.cancel()]:
                del pending[future]
        if not pending:
            return
        for future in wait(pending, return_when=FIRST_COMPLETED).done:
            task, executor = pending.pop(future)
            try:
                result = future.result()
            except Exception as error:
                if not _worker_died(error):
                    raise
                again.append(task)
                lost[id(task)] = lost.get(id(task), 0) + 1
                if lost[id(task)] >= CHANCES:
                    raise _fatal(error) from None
                if isinstance(error, BrokenExecutor):
                    pool.close(executor)
                continue
            yield task, result


def _worker_died(error: Exception) -> bool:
    """Whether a task failed for no fault of its own."""
    return isinstance(error, BrokenExecutor) or type(error).__name__ == "KilledWorker"


def _fatal(error: Exception) -> StickslipError:
    reason = " ".join(str(error).split()) or type(error).__name__
    return StickslipError(f"workers died {CHANCES} times over the same chunk ({reason}). Give them more memory")
