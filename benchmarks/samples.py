"""Drives that are measured: ``python benchmarks/samples.py``.

A block on a base that is shaken, by 1e3 ... 1e6 random accelerations, as straight lines, splines
and steps. Seconds of a first motion (a new process with an engine that is compiled, from the import
of the library and the arrays on) and of the parts of one that is not the first: the samples checked
and made polynomials, the motion, its certificate; and how long one pass over the array takes, a sum
of all entries after the cache has been emptied. To ``benchmarks/results/samples.md``.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

RESULTS = Path(__file__).parent / "results" / "samples.md"
COUNTS = (1000, 10_000, 100_000, 1_000_000)
ROUNDS = 2
SPACING = 0.01


def shaken(count: int, kind: str, seed: int) -> list[float]:
    """Seconds of a first motion, of samples, of a motion and of its certificate, for one pass; MiB;
    and whether it is certified."""
    begun = time.perf_counter()
    import stickslip as ss

    def block(seed: int) -> tuple[ss.System, float]:
        t = np.arange(count) * SPACING
        a = np.sin(t) + 0.3 * np.random.default_rng(seed).normal(size=count)
        begun = time.perf_counter()
        samples = ss.Samples(t, a, kind)  # type: ignore[arg-type]
        samples.pieces.rows()
        taken = time.perf_counter() - begun
        system = ss.System(
            name="shaken",
            drives={"a": samples},
            coordinates={"x": ss.Inertial(force="-a")},
            kinetic="d_x**2/2",
            contacts={"base": ss.Contact("d_x", 0.3)},
            span=samples.span,
        )
        return system, taken

    ss.simulate(block(seed)[0])
    first = time.perf_counter() - begun
    system, made = block(seed + 1)
    begun = time.perf_counter()
    motion = ss.simulate(system)
    moved = time.perf_counter() - begun
    certified = motion.certificate.ok
    judged = time.perf_counter() - begun - moved
    values = np.random.default_rng(seed).normal(size=count)
    np.zeros(4_000_000).sum()
    begun = time.perf_counter()
    values.sum()
    once = time.perf_counter() - begun
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return [first, made, moved, judged, once, memory, float(certified)]


def main() -> None:
    """Measure all of them, each in new processes, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--one", nargs=3, metavar=("COUNT", "KIND", "SEED"))
    given = parser.parse_args().one
    if given:
        print(*shaken(int(given[0]), given[1], int(given[2])))
        return
    lines = [
        "# Measured drives",
        "",
        "| samples | in between | first motion, s | polynomials, ms | motion, ms | certificate, ms "
        "| a pass over the array, ms | memory, MiB | certified |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"STICKSLIP_CACHE": folder}
        for kind in ("linear", "cubic", "hold"):
            for count in COUNTS:
                found = []
                for seed in range(ROUNDS + 1):
                    done = subprocess.run(
                        [sys.executable, __file__, "--one", str(count), kind, str(10 * seed)],
                        env=environment,
                        capture_output=True,
                        text=True,
                        check=True,
                    )
                    found.append([float(x) for x in done.stdout.split()])
                first, made, moved, judged, once, memory, ok = np.min(found[1:], axis=0)
                parts = " | ".join(f"{1e3 * x:.3g}" for x in (made, moved, judged, once))
                lines.append(
                    f"| {count:,} | {kind} | {first:.2f} | {parts} | {memory:.0f} | "
                    f"{'yes' if ok else 'no'} |"
                )
                print(lines[-1], flush=True)
    lines += ["", "Certified: whether all motions of a row are certified."]
    RESULTS.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
