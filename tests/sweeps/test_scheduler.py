"""Threads, processes and clusters: the same bits, and nothing is lost with a worker."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import DeclarationError, StickslipError
from stickslip.orbits.settling.motions import Settings
from stickslip.stopping.scopes import Stopped, watching
from stickslip.sweeps.adaptive import Adaptive
from stickslip.sweeps.sweep import Progress, sweep
from stickslip.sweeps.work import scheduler
from stickslip.sweeps.work.chunk import measure_chunk
from stickslip.sweeps.work.scheduler import Interrupt, Pool, distribute, local_cluster
from sweeps import work

TOY = ss.catalogue.rocking_toy()
OVER = {"P": "0.8:1.4:17", "delta": "log:0.02:0.3:17"}
MEASURE = ["speed", "period", "amplitude:psi"]


def bits(data: Any) -> dict[str, bytes]:
    return {name: data[name].values.tobytes() for name in data.data_vars}


@pytest.fixture(scope="module")
def alone() -> dict[str, bytes]:
    return bits(sweep(TOY, OVER, MEASURE, workers=1).dataset)


@pytest.mark.parametrize("workers", [2, 4])
def test_threads_give_the_same_bits(alone: dict[str, bytes], workers: int) -> None:
    assert bits(sweep(TOY, OVER, MEASURE, workers=workers).dataset) == alone


def test_other_chunks_give_the_same_bits(alone: dict[str, bytes]) -> None:
    """An adaptive map computes its points in other company."""
    part = sweep(TOY, OVER, MEASURE, adaptive=Adaptive()).dataset
    computed = part["outcome"].values.reshape(-1) >= 0
    assert 0 < np.count_nonzero(computed) < computed.size
    for name in MEASURE:
        whole = np.frombuffer(alone[name])
        assert part[name].values.reshape(-1)[computed].tobytes() == whole[computed].tobytes()


def test_processes_give_the_same_bits(alone: dict[str, bytes]) -> None:
    assert bits(sweep(TOY, OVER, MEASURE, scheduler="processes", workers=2).dataset) == alone


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

        data = sweep(TOY, OVER, MEASURE, scheduler=address, progress=kill).dataset
        assert set(killed) == set(pids)
    assert bits(data) == alone


def test_the_tasks_of_a_dead_process_are_done_again(tmp_path: Path) -> None:
    tasks = [(str(tmp_path), number) for number in range(8)]
    with Pool("processes", 2) as pool:
        found = dict(distribute(work.die_once, tasks, pool, Interrupt()))
    assert (tmp_path / "died").exists()
    assert found == {task: task[1] ** 2 for task in tasks}


def test_a_task_that_kills_every_worker_is_named_in_the_end(tmp_path: Path) -> None:
    with Pool("processes", 1) as pool, pytest.raises(StickslipError, match="died 4 times"):
        list(distribute(work.die_always, [("", 3)], pool, Interrupt()))


def test_few_tasks_are_under_way() -> None:
    seen: list[int] = []

    def tasks() -> Iterator[int]:
        for number in range(100):
            seen.append(number)
            yield number

    with Pool("threads", 2) as pool:
        results = distribute(work.square, tasks(), pool, Interrupt())
        first = next(results)
        assert len(seen) <= 4
        assert dict([first, *results]) == {number: number**2 for number in range(100)}


def test_errors_of_the_work_come_through() -> None:
    with Pool("threads", 2) as pool, pytest.raises(ArithmeticError, match="no square"):
        list(distribute(work.fail, [1, 2], pool, Interrupt()))


def test_nothing_is_begun_after_a_wish_to_stop() -> None:
    stop = Interrupt()
    with Pool("threads", 1) as pool:
        results = distribute(work.square, range(100), pool, stop)
        next(results)
        stop(signal.SIGINT, None)
        assert len(list(results)) <= 2
    with pytest.raises(KeyboardInterrupt):
        stop(signal.SIGINT, None)


def end_what_is_under_way(pool: Pool, folder: Path) -> None:
    stop = Interrupt(pool.flag)
    moments = list[float]()

    def interrupt() -> None:
        while not (folder / "begun").exists():
            time.sleep(0.01)
        moments.append(time.monotonic())
        stop(signal.SIGINT, None)

    threading.Thread(target=interrupt).start()
    assert not list(distribute(work.until_stopped, [str(folder)] * 9, pool, stop))
    assert time.monotonic() - moments[0] < 2.0


@pytest.mark.parametrize("kind", ["threads", "processes"])
def test_what_is_under_way_sees_the_wish_to_stop(tmp_path: Path, kind: str) -> None:
    with Pool(kind, 1) as pool:
        end_what_is_under_way(pool, tmp_path)


@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning")
def test_a_cluster_sees_the_wish_to_stop_and_goes_on_with_another_map(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    with local_cluster(1) as address:
        with Pool(address) as pool:
            end_what_is_under_way(pool, tmp_path)
        with Pool(address) as pool:
            assert dict(distribute(work.square, [2, 3], pool, Interrupt())) == {2: 4, 3: 9}


def test_compiled_loops_see_the_wish_to_stop() -> None:
    """Two drives without a common period move a mass for hours, if nobody stops it."""
    stop = np.zeros(1, np.int64)
    began = time.monotonic()
    threading.Timer(0.5, lambda: stop.fill(1)).start()
    system = ss.catalogue.forced_oscillator(force="P*cos(omega*t) + P/2*cos(sqrt(2)*omega*t)")
    settings = Settings(max_time=1e9, max_cycles=10**9, max_events=10**12)
    with watching(interrupt=stop), pytest.raises(Stopped):
        measure_chunk(system, {}, {"omega": np.full(8, 0.5)}, (), settings)
    assert 0.4 < time.monotonic() - began < 5.0


def test_control_c_gives_up_chunks_and_a_map_goes_on_to_the_same_bits(
    alone: dict[str, bytes], tmp_path: Path
) -> None:
    sent: list[float] = []

    def interrupt(state: Progress) -> None:
        if state.new and not sent:
            sent.append(time.monotonic())
            os.kill(os.getpid(), signal.SIGINT)

    part = sweep(TOY, OVER, MEASURE, tmp_path / "toy.zarr", workers=2, progress=interrupt).dataset
    assert time.monotonic() - sent[0] < 2.0
    assert 0 < int((part["outcome"] >= 0).sum()) < part["outcome"].size
    assert bits(sweep(TOY, OVER, MEASURE, tmp_path / "toy.zarr").dataset) == alone


def test_a_function_that_other_processes_cannot_find() -> None:
    def local(motion: ss.Trajectory) -> float:
        return motion.final["psi"]

    with pytest.raises(DeclarationError, match="cannot be sent to other processes"):
        sweep(TOY, OVER, [local], scheduler="processes")


def test_no_workers_and_no_cluster(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scheduler, "ANSWER_WITHIN", 0.2)
    with pytest.raises(DeclarationError, match="number of workers"):
        Pool("threads", 0)
    pytest.importorskip("distributed")
    for address in ("tcp://127.0.0.1:9", "nonsense"):
        with pytest.raises(StickslipError, match="no Dask scheduler"), Pool(address):
            pass
