"""A map on a local Dask cluster, one of whose workers is killed: the others repeat its part, and
the results are bitwise identical to those of threads.

Prints the number of killed workers, and whether both maps are the same; takes about ten seconds.
"""

import os
import signal
import threading

import stickslip as ss


def over(points):
    return {"P": f"0.8:1.6:{points}", "delta": f"log:0.01:0.2:{points}"}


def on_a_cluster(points=60, kill_after=1.0):
    """The map, and the workers that were killed."""
    from distributed import LocalCluster

    killed = []
    cluster = LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs=50
    )
    with cluster:
        pids = [worker.pid for worker in cluster.workers.values()]

        def kill():
            os.kill(pids[0], signal.SIGKILL)
            killed.append(pids[0])

        timer = threading.Timer(kill_after, kill)
        timer.start()
        toy = ss.catalogue.rocking_toy()
        found = ss.sweep(toy, over(points), ["speed"], scheduler=cluster.scheduler_address)
        timer.cancel()
    return found, killed


def in_threads(points=60):
    return ss.sweep(ss.catalogue.rocking_toy(), over(points), ["speed"])


if __name__ == "__main__":
    found, killed = on_a_cluster()
    print("workers killed:", len(killed))
    print("the same:", found["speed"].equals(in_threads()["speed"]))
