"""Threads, processes and clusters: the same bits, and nothing is lost with a worker."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import DeclarationError, StickslipError
from stickslip.sweeps import scheduler
from stickslip.sweeps.adaptive import Adaptive
from stickslip.sweeps.scheduler import Pool, Stop, distribute, local_cluster
from stickslip.sweeps.sweep import Progress, sweep
from sweeps import work

TOY = ss.catalogue.rocking_toy()
OVER = {"P": "0.8:1.4:17", "delta": "log:0.02:0.3:17"}
MEASURE = ["speed", "period", "amplitude:psi"]


def bits(data: Any) -> dict[str, bytes]:
    return {name: data[name].values.tobytes() for name in data.data_vars}


@pytest.fixture(scope="module")
def alone() -> dict[str, bytes]:
    return bits(sweep(TOY, OVER, MEASURE, workers=1))


@pytest.mark.parametrize("workers", [2, 4])
def test_threads_give_the_same_bits(alone: dict[str, bytes], workers: int) -> None:
    assert bits(sweep(TOY, OVER, MEASURE, workers=workers)) == alone


def test_other_chunks_give_the_same_bits(alone: dict[str, bytes]) -> None:
    """An adaptive map computes its points in other company."""
    part = sweep(TOY, OVER, MEASURE, adaptive=Adaptive())
    computed = part["outcome"].values.reshape(-1) >= 0
    assert 0 < np.count_nonzero(computed) < computed.size
    for name in MEASURE:
        whole = np.frombuffer(alone[name])
        assert part[name].values.reshape(-1)[computed].tobytes() == whole[computed].tobytes()


def test_processes_give_the_same_bits(alone: dict[str, bytes]) -> None:
    assert bits(sweep(TOY, OVER, MEASURE, scheduler="processes", workers=2)) == alone


@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning")
def test_a_cluster_whose_workers_are_killed_gives_the_same_bits(alone: dict[str, bytes]) -> None:
    distributed = pytest.importorskip("distributed")
    with local_cluster(2) as address, distributed.Client(address, set_as_default=False) as client:
        pids = list(client.run(os.getpid).values())
        killed: list[int] = []

        def kill(state: Progress) -> None:
            if len(killed) < len(pids) and state.new > len(killed):
                killed.append(pids[len(killed)])
                os.kill(killed[-1], signal.SIGKILL)

        data = sweep(TOY, OVER, MEASURE, scheduler=address, progress=kill)
        assert set(killed) == set(pids)
    assert bits(data) == alone


def test_the_tasks_of_a_dead_process_are_done_again(tmp_path: Path) -> None:
    tasks = [(str(tmp_path), number) for number in range(8)]
    with Pool("processes", 2) as pool:
        found = dict(distribute(work.die_once, tasks, pool, Stop()))
    assert (tmp_path / "died").exists()
    assert found == {task: task[1] ** 2 for task in tasks}


def test_a_task_that_kills_every_worker_is_named_in_the_end(tmp_path: Path) -> None:
    with Pool("processes", 1) as pool, pytest.raises(StickslipError, match="died 4 times"):
        list(distribute(work.die_always, [("", 3)], pool, Stop()))


def test_few_tasks_are_under_way() -> None:
    seen: list[int] = []

    def tasks() -> Iterator[int]:
        for number in range(100):
            seen.append(number)
            yield number

    with Pool("threads", 2) as pool:
        results = distribute(work.square, tasks(), pool, Stop())
        first = next(results)
        assert len(seen) <= 4
        assert dict([first, *results]) == {number: number**2 for number in range(100)}


def test_errors_of_the_work_come_through() -> None:
    with Pool("threads", 2) as pool, pytest.raises(ArithmeticError, match="no square"):
        list(distribute(work.fail, [1, 2], pool, Stop()))


def test_nothing_is_begun_after_a_wish_to_stop() -> None:
    stop = Stop()
    with Pool("threads", 1) as pool:
        results = distribute(work.square, range(100), pool, stop)
        next(results)
        stop(signal.SIGINT, None)
        assert len(list(results)) <= 2
    with pytest.raises(KeyboardInterrupt):
        stop(signal.SIGINT, None)


def test_a_function_that_other_processes_cannot_find() -> None:
    def local(motion: ss.Trajectory) -> float:
        return motion.final["psi"]

    with pytest.raises(DeclarationError, match="cannot be sent to other processes"):
        sweep(TOY, OVER, [local], scheduler="processes")


def test_no_workers_and_no_cluster(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scheduler, "PATIENCE", 0.2)
    with pytest.raises(DeclarationError, match="number of workers"):
        Pool("threads", 0)
    pytest.importorskip("distributed")
    for address in ("tcp://127.0.0.1:9", "nonsense"):
        with pytest.raises(StickslipError, match="no Dask scheduler"), Pool(address):
            pass
