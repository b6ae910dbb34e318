"""What an installation takes and how soon it is there: ``python benchmarks/installed.py``.

Sizes of what the core and its extras bring, package by package, each set installed by pip into an
environment of its own; then, in one with the core and matplotlib, the time of an import, of
``--help`` and of a run with its picture. The machine code of the engine is there, as it is with a
wheel; the list of fonts that matplotlib makes once is not, the first time. Also netCDF4 beside
h5netcdf, the other package that writes such files. Minima go to
``benchmarks/results/installed.md``, seconds of a clock beside those of the processor.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
import tomllib
import venv
from pathlib import Path

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "benchmarks" / "results" / "installed.md"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS: dict[str, list[str]] = PROJECT["optional-dependencies"]
CORE = list[str](PROJECT["dependencies"])
ALONE = ("plots", "maps", "evolutions", "explorer", "paper", "fmi", "cluster")
LISTED = 12  # packages by name, the largest
ROUNDS = 7
GOALS = {"import": 0.1, "--help": 0.35, "run": 3.0}  # seconds

SIZES = """
import importlib.metadata as metadata, json
found = {}
for package in metadata.distributions():
    files = [file.locate() for file in package.files or ()]
    found[package.name] = sum(file.stat().st_size for file in files if file.is_file())
print(json.dumps(found))
"""
NETCDF = """
import json, sys, time
sys.path.append({beside!r})
import numpy as np, xarray as xr
data = xr.Dataset({{f"x{{i}}": ("t", np.linspace(0.0, i, 2000)) for i in range(25)}})
seconds = []
for engine in ("netcdf4", "h5netcdf"):
    pairs = []
    for _ in range(5):
        begun = time.process_time()
        data.to_netcdf("x.nc", engine=engine, format="NETCDF4")
        written = time.process_time()
        with xr.open_dataset("x.nc", engine=engine) as read:
            read.load()
        pairs.append((written - begun, time.process_time() - written))
    seconds.append([min(times) for times in zip(*pairs)])
print(json.dumps(seconds))
"""


def wanted(name: str) -> list[str]:
    """What an extra asks for, with that of the extras that it names."""
    found = list[str]()
    for need in EXTRAS[name]:
        if need.startswith("stickslip["):
            inner = need.partition("[")[2].rstrip("]").split(",")
            found += [one for other in inner for one in wanted(other)]
        else:
            found.append(need)
    return found


def environment(place: Path, needs: list[str]) -> Path:
    """The Python of a fresh environment in which these are installed."""
    venv.create(place, symlinks=os.name != "nt")
    python = place / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    command = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet"]
    options = ["--disable-pip-version-check", "--prefer-binary"]
    constraints = ["--constraint", str(ROOT / "constraints.txt")]
    subprocess.run([*command, *options, *constraints, *needs], check=True)
    return python


def sizes(python: Path) -> dict[str, float]:
    """MB of each package."""
    told = subprocess.run([python, "-c", SIZES], capture_output=True, text=True, check=True)
    return {name: size / 1e6 for name, size in json.loads(told.stdout).items()}


def packages(core: dict[str, float]) -> list[str]:
    """The core, package by package."""
    ordered = sorted(core, key=lambda name: -core[name])
    lines = ["| package of the core | MB |", "|---|---|"]
    lines += [f"| {name} | {core[name]:.1f} |" for name in ordered[:LISTED]]
    others = [core[name] for name in ordered[LISTED:]]
    lines.append(f"| {len(others)} others | {sum(others):.1f} |")
    lines.append(f"| all {len(core)} | {sum(core.values()):.0f} |")
    return lines


def timed(command: list[str | Path], place: Path, env: dict[str, str]) -> tuple[float, float]:
    """Seconds of a clock and of the processor."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begun = time.perf_counter()
    subprocess.run(command, cwd=place, env=env, check=True, stdout=subprocess.DEVNULL)
    clock = time.perf_counter() - begun
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return clock, spent


def starts(python: Path, place: Path) -> list[str]:
    """An import, the help, a run with its picture."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    env = {**kept, "PYTHONPATH": str(ROOT / "src")}
    env["STICKSLIP_CACHE"] = str(place / "cache")
    command = [python, "-m", "stickslip.cli"]
    run = [*command, "run", "rocking_toy", "--out", "toy"]
    # The engine, the system and the compiled Python of all packages, as an installation has them.
    timed(run, place, env)

    def measured(words: list[str | Path], fonts: bool = True) -> tuple[float, float]:
        pairs = list[tuple[float, float]]()
        for _ in range(ROUNDS):
            with tempfile.TemporaryDirectory() as empty:
                here = env if fonts else {**env, "MPLCONFIGDIR": empty}
                pairs.append(timed(words, place, here))
        return min(pair[0] for pair in pairs), min(pair[1] for pair in pairs)

    rows = {
        "Python alone": (measured([python, "-c", "pass"]), 0.0),
        "`import stickslip`": (measured([python, "-c", "import stickslip"]), GOALS["import"]),
        "`stickslip --help`": (measured([*command, "--help"]), GOALS["--help"]),
        "the first `stickslip run` with its plot": (measured(run, False), GOALS["run"]),
        "the next run": (measured(run), 0.0),
    }
    lines = ["| | wall clock, s | processor, s | goal, s |", "|---|---|---|---|"]
    for name, ((clock, spent), goal) in rows.items():
        lines.append(f"| {name} | {clock:.2f} | {spent:.2f} | {f'{goal:g}' if goal else ''} |")
    return lines


def netcdf(python: Path, place: Path, core: dict[str, float]) -> list[str]:
    """The two packages that write netCDF-4 files."""
    beside = place / "beside"
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    options = ["--no-deps", "--target", str(beside), "h5netcdf", "h5py"]
    subprocess.run([*command, *options], check=True)
    size = sum(file.stat().st_size for file in beside.rglob("*") if file.is_file()) / 1e6
    script = NETCDF.format(beside=str(beside))
    told = subprocess.run(
        [python, "-c", script], cwd=place, capture_output=True, text=True, check=True
    )
    ours = core["netCDF4"] + core["cftime"]
    lines = ["| 25 variables of 2000 numbers | MB | write, ms | read, ms |", "|---|---|---|---|"]
    names = {"netCDF4, cftime": ours, "h5netcdf, h5py": size}
    for (name, of), (write, read) in zip(names.items(), json.loads(told.stdout), strict=True):
        lines.append(f"| {name} | {of:.1f} | {1e3 * write:.1f} | {1e3 * read:.1f} |")
    return lines


def main() -> None:
    """Install, measure, print it and keep it."""
    sys.path.insert(0, str(ROOT / "benchmarks"))
    from motion import machine

    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        core = sizes(environment(place / "core", CORE))
        sets = ["| set | packages | MB |", "|---|---|---|"]
        sets.append(f"| the core | {len(core)} | {sum(core.values()):.0f} |")
        for name in (*ALONE, "all"):
            found = sizes(environment(place / name, [*CORE, *wanted(name)]))
            line = f"| the core and `{name}` | {len(found)} | {sum(found.values()):.0f} |"
            sets.append(line)
            print(line, flush=True)
        plots = place / "plots" / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
        parts = [sets, packages(core), starts(plots, place), netcdf(plots, place, core)]
    lines = ["# Size and start of an installation", "", machine(), ""]
    for part in parts:
        lines += [*part, ""]
    lines += [REMARK, ""]
    print("\n".join(lines))
    RESULTS.write_text("\n".join(lines), encoding="utf-8")


REMARK = """\
The wall-clock time depends on the load of the machine: compare it with that of Python alone, and
with the processor time, to which the goals apply on an idle machine.

The goal of 350 MB for the core is missed. llvmlite, SciPy and NumPy alone exceed it: llvmlite is
LLVM, which compiles the functions of every new system (the engine itself comes compiled), and
cycles, equilibria, fits and structures use SciPy's linear algebra, optimisation and sparse
matrices. pandas is required because results are xarray datasets. netCDF4 is
required as well: h5netcdf is smaller, but writes and reads the same files several times slower.
`stickslip run` loads neither SciPy nor any module of a later package
(`tests/packaging/test_lean.py`).
"""


if __name__ == "__main__":
    main()
