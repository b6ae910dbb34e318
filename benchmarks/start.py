"""How soon a new declaration moves, and how fast: ``python benchmarks/start.py [BEFORE]``.

Seconds from a declaration that no cache knows to its first Trajectory (the engine is compiled
already), in this process and as a whole new one; nanoseconds for a Taylor series; seconds of a
motion; the first process after an installation, by what the package came with. And what it takes to
compile the engine, from nothing and after edits, beside an earlier version if BEFORE is a checkout
of one with its own ``.venv``. Minima of the rounds go to ``benchmarks/results/start.md`` with the
machine named.
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import stickslip as ss
from stickslip.arrays import IntVector, Vector
from stickslip.machine_code import shelf
from stickslip.machine_code.functions import entry_point
from stickslip.machine_code.interface import Jets
from stickslip.machine_code.shipping import is_complete
from stickslip.motion.problem import Problem, pose
from stickslip.motion.simulate_many import follow_all
from stickslip.motion.steps.arrays import Space

RESULTS = Path(__file__).parent / "results" / "start.md"
ROUNDS = 3
SERIES = 4000  # in one call
SPAN = (0.0, 20.0)
NEW: dict[str, Callable[[float], ss.System]] = {
    "spring slider, another law": lambda x: ss.catalogue.spring_slider(
        mu=f"0.5 + exp(-(alpha - 1)/{x})"
    ),
    "rocking toy, another friction": lambda x: ss.catalogue.rocking_toy(
        H_R=f"H_star/2*(1 + clip(psi/psi_star, -1, 1)) + {x}*psi**4"
    ),
    "chain of 5 blocks": lambda x: ss.catalogue.block_chain(N=5, belt=f"V + {x}*sin(t)"),
    "chain of 10 blocks": lambda x: ss.catalogue.block_chain(N=10, belt=f"V + {x}*sin(t)"),
    "chain of 40 blocks": lambda x: ss.catalogue.block_chain(N=40, belt=f"V + {x}*sin(t)"),
}
"""By a number that no cache knows."""
KNOWN: dict[str, tuple[ss.System, float]] = {
    "spring slider": (ss.catalogue.spring_slider(), 5000.0),
    "scaled slider": (ss.catalogue.scaled_slider(), 5000.0),
    "Prandtl-Tomlinson tip": (ss.catalogue.prandtl_tomlinson(), 100.0),
    "rocking toy": (ss.catalogue.rocking_toy(), 1000.0),
    "rocking toy with masses": (ss.catalogue.rocking_toy_inertial(), 1200.0),
    "play between oscillating walls": (ss.catalogue.oscillating_play(), 1000.0),
    "plate compactor": (ss.catalogue.plate_compactor(), 100.0),
    "chain of 5 blocks": (ss.catalogue.block_chain(N=5), 500.0),
}


def first_motion(declared: Callable[[float], ss.System]) -> float:
    """Seconds from a declaration to its first Trajectory."""
    number = round(float(np.random.default_rng().uniform(0.3, 0.4)), 12)
    begun = time.perf_counter()
    ss.simulate(declared(number), SPAN)
    return time.perf_counter() - begun


def whole_process(name: str) -> float:
    """Seconds of a process that imports, declares, moves and stops."""
    script = f"import start; start.first_motion(start.NEW[{name!r}])"
    with tempfile.TemporaryDirectory() as folder:
        env = {**os.environ, "STICKSLIP_CACHE": folder}
        begun = time.perf_counter()
        subprocess.run(
            [sys.executable, "-c", script], cwd=Path(__file__).parent, env=env, check=True
        )
        return time.perf_counter() - begun


@entry_point()
def many_series(
    jets: Jets,
    t: float,
    y: Vector,
    mode: IntVector,
    region: IntVector,
    K: Vector,
    space: Space,
    N: int,
    count: int,
) -> None:
    """The same series again and again."""
    for _ in range(count):
        jets(t, y, mode, region, K, space.Rq, space.Rz, N, space.W, space.A, space.B, space.mag)


def series(problem: Problem) -> float:
    """Seconds of a Taylor series."""
    space = problem.space()
    y = problem.initial_state({}) + 0.01
    for inverse in (space.Rq, space.Rz):
        inverse[:] = np.eye(*inverse.shape)
    mode, region = (np.zeros(len(rows), np.int64) for rows in (problem.rows.u, problem.rows.kinks))
    given = 0.3, y, mode, region, problem.constants.K, space, problem.order
    many_series(problem.compiled.jets, *given, 1)
    begun = time.perf_counter()
    many_series(problem.compiled.jets, *given, SERIES)
    return (time.perf_counter() - begun) / SERIES


def motion(problem: Problem, end: float) -> float:
    """Seconds of a motion by Taylor steps."""
    table = np.array([list(problem.parameters.values())])
    y = problem.initial_state({})[None]
    begun = time.perf_counter()
    follow_all(problem, table, y, (0.0, end), 10**7, 1)
    return time.perf_counter() - begun


def starts() -> list[str]:
    """From a declaration to its first Trajectory."""
    ss.simulate(ss.catalogue.rocking_toy(), SPAN)  # the engine
    ss.simulate(ss.catalogue.spring_slider(), SPAN)
    lines = ["| a new declaration → its first Trajectory | s | whole process, s |", "|---|---|---|"]
    for name, declared in NEW.items():
        first = min(first_motion(declared) for _ in range(ROUNDS))
        whole = min(whole_process(name) for _ in range(ROUNDS))
        lines.append(f"| {name} | {first:.3f} | {whole:.2f} |")
        print(lines[-1], flush=True)
    return lines


def speeds() -> list[str]:
    """Series and motions."""
    lines = ["| Taylor steps | series, ns | motion, ms |", "|---|---|---|"]
    for name, (system, end) in KNOWN.items():
        problem = pose(system, exact=False)
        one = min(series(problem) for _ in range(20))
        whole = min(motion(problem, end) for _ in range(25))
        lines.append(f"| {name}, t = {end:g} | {1e9 * one:.0f} | {1e3 * whole:.2f} |")
        print(lines[-1], flush=True)
    return lines


FIRST = {
    "closed forms": "import stickslip as ss; ss.simulate(ss.catalogue.rocking_toy(), (0.0, 20.0))",
    "Taylor steps": "import stickslip as ss; "
    "ss.simulate(ss.catalogue.spring_slider(), (0.0, 20.0), flow='taylor')",
}
SCIPY = (
    "from scipy.integrate import solve_ivp; "
    "solve_ivp(lambda t, y: [y[1], -y[0]], (0.0, 20.0), [1.0, 0.0], rtol=1e-9, atol=1e-9)"
)
HIDDEN = """
from pathlib import Path
from stickslip.arrays import IntVector, Vector
from stickslip.machine_code import shelf
shelf.SHIPPED = Path({folder!r})
"""


def process(script: str, folder: str) -> float:
    """Seconds of a process that imports, moves and stops, with that cache folder."""
    begun = time.perf_counter()
    env = {**os.environ, "STICKSLIP_CACHE": folder}
    subprocess.run([sys.executable, "-c", script], env=env, check=True)
    return time.perf_counter() - begun


def fresh_installations() -> list[str]:
    """The first process after an installation, by what came with it, and a second one."""
    if not is_complete(shelf.level()):
        raise SystemExit("make machine-code first: the engine is not compiled ahead of time")
    lines = [
        "| a fresh installation: import, declare, one motion | machine code shipped, s | bitcode "
        "shipped, s | compiled here, s | second process, s | times SciPy |",
        "|---|---|---|---|---|---|",
    ]
    with tempfile.TemporaryDirectory() as place:
        bitcode = Path(place) / "bitcode" / shelf.level()
        bitcode.mkdir(parents=True)
        for file in (shelf.SHIPPED / shelf.level()).iterdir():
            if file.suffix != ".o":
                shutil.copy(file, bitcode)
        for name, script in FIRST.items():
            seconds = []
            for shipped in (str(shelf.SHIPPED), str(bitcode.parent), place):
                hide = HIDDEN.format(folder=shipped)
                caches = [tempfile.mkdtemp(dir=place) for _ in range(1 if shipped == place else 3)]
                seconds.append(min(process(hide + script, cache) for cache in caches))
            cache = tempfile.mkdtemp(dir=place)
            process(script, cache)
            pairs = [(process(script, cache), process(SCIPY, cache)) for _ in range(9)]
            second, scipy = np.min(pairs, axis=0)
            words = " | ".join(f"{x:.2f}" for x in (*seconds, second, second / scipy))
            lines.append(f"| {name} | {words} |")
            print(lines[-1], flush=True)
    return lines


# What an edit changes: the file, what stands there, and what stands there afterwards.
EDITS = {
    "an edit of a comment": ("motion/engine/event_loop.py", "\n# ", "\n# Really: "),
    "an edit of a constant of one file": (
        "motion/algebra/roots.py",
        "_QUICK = 6",
        "_QUICK = 7",
    ),
    "an edit of a function of one file": (
        "motion/algebra/roots.py",
        "        s = s * x + c[k]\n",
        "        s = c[k] + s * x\n",
    ),
    "an edit of a constant that many read": (
        "numerics/levels.py",
        "\nROUNDING = 64",
        "\nROUNDING = 65",
    ),
}


def compiled(python: str, module: str, source: Path) -> tuple[float, float, float]:
    """Compile the engine of some sources: seconds of processors, of a clock, and the memory of the
    largest process in MB."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begun = time.perf_counter()
    env = {**os.environ, "PYTHONPATH": str(source), "STICKSLIP_CACHE": str(source / "cache")}
    subprocess.run([python, "-m", module], env=env, check=True, stderr=subprocess.DEVNULL)
    wall = time.perf_counter() - begun
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return spent, wall, after.ru_maxrss / 1024.0


def compilers(before: Path | None) -> list[str]:
    """The engine from nothing and after edits."""
    lines = [
        "| compiling the engine | processor time, s | wall clock, s | memory of a process, MB |",
        "|---|---|---|---|",
    ]

    def add(what: str, measured: tuple[float, float, float]) -> None:
        lines.append(f"| {what} | {measured[0]:.1f} | {measured[1]:.1f} | {measured[2]:.0f} |")
        print(lines[-1], flush=True)

    def copied(package: Path, place: Path) -> Path:
        ignored = shutil.ignore_patterns("__pycache__", "shipped")
        shutil.copytree(package, place / "stickslip", ignore=ignored)
        return place

    with tempfile.TemporaryDirectory() as folder:
        source = copied(Path(ss.__file__).parent, Path(folder) / "now")
        module = "stickslip.machine_code.shipping"
        add("from nothing", compiled(sys.executable, module, source))
        add("nothing edited", compiled(sys.executable, module, source))
        for what, (file, old, new) in EDITS.items():
            path = source / "stickslip" / file
            text = path.read_text(encoding="utf-8")
            assert old in text
            path.write_text(text.replace(old, new, 1), encoding="utf-8")
            add(f"after {what}", compiled(sys.executable, module, source))
        if before is not None:  # its memory is that of the larger
            source = copied(before / "src" / "stickslip", Path(folder) / "before")
            python = str(before / ".venv" / "bin" / "python")
            add(
                "an earlier version: from nothing, and after any edit",
                compiled(python, MODULE_BEFORE, source),
            )
    return lines


MODULE_BEFORE = "stickslip.shipping"


def main() -> None:
    """Run everything, print it and keep it."""
    from motion import machine  # here, so that a new process does not import all rivals

    lines = ["# Time from a new declaration to its first motion", "", machine(), ""]
    before = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    lines += [*compilers(before), "", *fresh_installations(), "", *starts(), "", *speeds(), ""]
    print("\n".join(lines))
    RESULTS.write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
