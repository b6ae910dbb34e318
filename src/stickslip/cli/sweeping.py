"""The commands ``sweep`` and ``plot``: parameter maps."""

from __future__ import annotations

import contextlib
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stickslip.errors import DeclarationError
from stickslip.model.units import with_unit

if TYPE_CHECKING:
    import xarray

    from stickslip.sweeps.adaptive import Adaptive
    from stickslip.sweeps.sweep import Progress

Model = Annotated[
    str,
    typer.Argument(
        metavar="MODEL", help="A name of the catalogue (see: stickslip list) or a .toml file."
    ),
]
Store = Annotated[Path, typer.Argument(metavar="STORE", help="A map written by: stickslip sweep")]


def sweep(
    model: Model,
    over: Annotated[
        list[str],
        typer.Option(
            "--over",
            metavar="NAME=VALUES",
            help="What varies, such as P=0.8:1.6:400, delta=log:0.01:0.2:300, psi=0.1,0.2, "
            "'P,H_star=1:2:9; 3:4:9' or "
            "'P,delta=sobol:1024; 0.8:1.6; 0.01:0.2'; may be repeated.",
        ),
    ],
    measure: Annotated[
        list[str],
        typer.Option(
            "--measure",
            metavar="MEASURE",
            help="period, amplitude, speed, stick_fraction, energy_per_cycle, peak_force, "
            "switches ..., also of one part as in amplitude:psi; 'name = formula' of these; "
            "file.py:function; may be repeated.",
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="STORE", help="The map.  [default: out/NAME.zarr]"),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="Parameter, or free function as a formula; may be repeated.",
        ),
    ] = None,
    initial: Annotated[
        list[str] | None,
        typer.Option(
            "--initial",
            metavar="NAME=VALUE",
            help="Initial value, such as psi=0.8; may be repeated.",
        ),
    ] = None,
    rtol: Annotated[float, typer.Option("--rtol", help="Accuracy of the motions.")] = 1e-10,
    tolerance: Annotated[
        float,
        typer.Option("--tolerance", help="What may be missing to the cycle of a settled motion."),
    ] = 1e-8,
    max_time: Annotated[
        float | None,
        typer.Option(
            "--max-time", metavar="T", help="Time after which a motion counts as not settled."
        ),
    ] = None,
    longest_cycle: Annotated[
        int,
        typer.Option(
            "--longest-cycle", metavar="N", help="Most events, or periods of the drive, of a cycle."
        ),
    ] = 48,
    seed: Annotated[
        int, typer.Option("--seed", min=0, help="Of random and low-discrepancy samples.")
    ] = 0,
    adaptive: Annotated[
        list[str] | None,
        typer.Option(
            "--adaptive",
            metavar="NAME",
            help="Refine only where this measure, or the outcome, changes.",
        ),
    ] = None,
    contrast: Annotated[
        float,
        typer.Option(
            "--contrast",
            help="Change, relative to the range of a measure, that --adaptive refines.",
        ),
    ] = 0.05,
    workers: Annotated[
        int | None, typer.Option("--workers", help="Threads or processes.  [default: cores]")
    ] = None,
    processes: Annotated[
        bool, typer.Option("--processes", help="Processes in place of threads.")
    ] = False,
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler", metavar="ADDRESS", help="Use the Dask cluster at this address."
        ),
    ] = None,
    local_cluster: Annotated[
        bool, typer.Option("--local-cluster", help="Start a Dask cluster here.")
    ] = False,
    device: Annotated[
        str,
        typer.Option(
            "--device", metavar="cpu|gpu", help="Where the compiled loops run; gpu: a CUDA device."
        ),
    ] = "cpu",
    extend: Annotated[
        bool, typer.Option("--extend", help="Add points to a map over some of these values.")
    ] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a stored map.")] = False,
    repair: Annotated[bool, typer.Option("--repair", help="Compute damaged chunks again.")] = False,
) -> None:
    """Measure a system over parameters and initial values.

    Writes a Zarr store, chunk by chunk; the same command takes up what was interrupted.

    Exit code: 0 complete, 2 wrong input, 130 interrupted (what was computed is kept).
    """
    from stickslip.cli.app import INTERRUPTED, finish
    from stickslip.cli.models import assignments, load_model, numbers
    from stickslip.orbits.settling.motions import Settings
    from stickslip.sweeps.sweep import sweep as compute

    system = load_model(model, settings or [])
    start = numbers(assignments(initial or [], "--initial"), "--initial")
    path = out or Path("out") / (re.sub(r"[^\w.-]+", "_", system.name) + ".zarr")
    try:
        with (
            _workers(scheduler, local_cluster, processes, workers) as who,
            _progress(str(path)) as progress,
        ):
            data = compute(
                system,
                over,
                measure,
                path,
                initial=start,
                settings=Settings(
                    tolerance=tolerance, max_time=max_time, longest_cycle=longest_cycle, rtol=rtol
                ),
                seed=seed,
                adaptive=_adaptive(adaptive, contrast),
                scheduler=who,
                workers=workers,
                device=device,
                extend=extend,
                overwrite=overwrite,
                repair=repair,
                progress=progress,
            )
    except KeyboardInterrupt:
        finish(
            f"interrupted; what was computed is in {path}; the same command goes on", INTERRUPTED
        )
    _report(data, path)


def plot(
    store: Store,
    measure: Annotated[
        list[str] | None,
        typer.Option("--measure", metavar="MEASURE", help="What to show; may be repeated."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="The picture.  [default: STORE with .png]"),
    ] = None,
) -> None:
    """Draw a stored map: lines over one axis, a map over two, small multiples over three."""
    from stickslip.figures.drawing.style import paper_style
    from stickslip.figures.sweep import plot_sweep
    from stickslip.sweeps.sweep import open_sweep

    figure = plot_sweep(open_sweep(store), measure)
    picture = out or (store if store.stem else store.resolve()).with_suffix(".png")
    try:
        with paper_style():
            figure.savefig(picture)
    except ValueError:
        raise DeclarationError(
            "--out", f"'{picture}' has no ending of a picture", "Use .png, .pdf or .svg"
        ) from None
    typer.echo(picture)


def _adaptive(names: list[str] | None, contrast: float) -> Adaptive | None:
    from stickslip.sweeps.adaptive import Adaptive

    return Adaptive(tuple(names), contrast) if names else None


@contextlib.contextmanager
def _workers(
    address: str | None, local_cluster: bool, processes: bool, workers: int | None
) -> Iterator[str]:
    """Who does the work, as the name of a scheduler."""
    from stickslip.sweeps.work.scheduler import local_cluster as started

    if (address is not None) + local_cluster + processes > 1:
        reason = "only one of --processes, --scheduler and --local-cluster can do the work"
        raise DeclarationError("sweep", reason, "Choose one")
    if local_cluster:
        with started(workers) as found:
            yield found
    else:
        yield address or ("processes" if processes else "threads")


@contextlib.contextmanager
def _progress(label: str) -> Iterator[Callable[[Progress], None] | None]:
    """Points done, rate, time left and outcomes on stderr, if a person is looking."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[points]}"),
        TimeRemainingColumn(),
    )
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(label, total=None, points="")

        def show(state: Progress) -> None:
            if state.new == 0:  # what was found in the store says nothing about the time left
                bar.reset(task, total=state.total, completed=state.done)
            bar.update(task, completed=state.done, points=points_line(state))

        yield show


def points_line(state: Progress) -> str:
    """Points done, points per second, and how they ended."""
    from stickslip.motion.outcome import Outcome

    rate = f", {state.new / state.elapsed:,.0f}/s" if state.new and state.elapsed > 0.0 else ""
    ends = ", ".join(
        f"{count:,} {Outcome.from_code(code).label}" for code, count in state.outcomes.items()
    )
    return f"{state.done:,} of {state.total:,} points{rate}" + (f": {ends}" if ends else "")


def _report(data: xarray.Dataset, path: Path) -> None:
    """What the map holds, and how the command ends."""
    import numpy as np

    from stickslip.cli.app import INTERRUPTED, finish
    from stickslip.cli.report import print_table
    from stickslip.sweeps.request.measures import LACKING
    from stickslip.sweeps.request.plan import NOT_COMPUTED

    outcome = data["outcome"]
    lacking = data["lacking"].values
    codes = outcome.values
    done = int(np.count_nonzero(codes >= 0))
    if np.any(codes == NOT_COMPUTED):
        kept = f"{done:,} of {codes.size:,} points are in {path}; the same command goes on"
        finish(f"interrupted; {kept}", INTERRUPTED)
    good = int(np.count_nonzero((lacking == LACKING.index("nothing")) & (codes >= 0)))
    words = dict(
        zip(outcome.attrs["flag_values"], outcome.attrs["flag_meanings"].split(), strict=True)
    )
    rows = [
        (
            "points",
            f"{done:,}"
            + (f" of {codes.size:,}, the others interpolated" if done < codes.size else ""),
        )
    ]
    rows += [
        ("  " + words[c].replace("_", " "), f"{np.count_nonzero(codes == c):,}")
        for c in np.unique(codes)
        if c >= 0
    ]
    rows += [("certified", f"{good:,}"), *_lacking(data), *_outside(data), *_missing(data)]
    rows += [("written", str(path))]
    print_table(data.attrs["title"], rows, good == done)


def _lacking(data: xarray.Dataset) -> list[tuple[str, str]]:
    """How many points lack what to be certified."""
    import numpy as np

    from stickslip.sweeps.request.measures import LACKING

    lacking = data["lacking"].values[data["outcome"].values >= 0]
    codes, counts = np.unique(lacking[lacking > 0], return_counts=True)
    said = [f"{count:,} {LACKING[code]}" for code, count in zip(codes, counts, strict=True)]
    return [("  lacking", ", ".join(said))] if said else []


def _outside(data: xarray.Dataset) -> list[tuple[str, str]]:
    """What can be done about points that start outside the stable set."""
    import numpy as np

    from stickslip.motion.outcome import Outcome

    outside = data["outcome"].values == Outcome.OUTSIDE.code
    if not np.any(outside):
        return []
    largest = with_unit(
        float(np.max(data["excess"].values[outside])), data["excess"].attrs["units"], 3
    )
    count = np.count_nonzero(outside)
    reason = (
        f"{count:,} starts violate |∂Φ| ≤ s, by up to {largest}, so that no motion begins there"
    )
    remedy = (
        "start where friction holds: --initial NAME=VALUE, "
        "or let it vary along, as in --over 'P,x_R=...'"
    )
    return [("starts", reason), ("", remedy)]


def _missing(data: xarray.Dataset) -> list[tuple[str, str]]:
    """How often a function of the user's has no value, and why."""
    import numpy as np

    rows = []
    for name in data.data_vars:
        if str(name).endswith("_missing"):
            words = data[name].attrs["flag_meanings"].split()
            codes, counts = np.unique(
                data[name].values[data["outcome"].values >= 0], return_counts=True
            )
            why = [
                f"{count:,} {words[c].replace('_', ' ')}"
                for c, count in zip(codes, counts, strict=True)
                if c
            ]
            rows += (
                [(f"missing {str(name).removesuffix('_missing')}", ", ".join(why))] if why else []
            )
    return rows
