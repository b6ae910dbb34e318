"""The commands ``sweep`` and ``plot``: parameter maps."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stickslip.cli.common.ending import EXIT_INTERRUPTED, NOT_CERTIFIED, finish
from stickslip.cli.common.models import assignments, load_model, numbers, spans
from stickslip.cli.common.present import (
    Initial,
    Model,
    ParameterOptions,
    TimeLimitOfEach,
    Until,
    folder_of,
)
from stickslip.cli.common.report import print_summary
from stickslip.errors import DeclarationError
from stickslip.storage import named

if TYPE_CHECKING:
    from stickslip import Map
    from stickslip.sweeps.adaptive import Adaptive
    from stickslip.sweeps.sweep import Progress

ShowPoints = Callable[["Progress"], None] | None
Workers = Annotated[
    int | None,
    typer.Option("--workers", help="Number of threads or processes.  [default: number of cores]"),
]
Processes = Annotated[bool, typer.Option("--processes", help="Use processes instead of threads.")]
Scheduler = Annotated[
    str | None,
    typer.Option("--scheduler", metavar="ADDRESS", help="Use the Dask cluster at this address."),
]
LocalCluster = Annotated[bool, typer.Option("--local-cluster", help="Start a Dask cluster here.")]
Extend = Annotated[bool, typer.Option("--extend", help="Add points to a stored map.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace a stored map.")]
Repair = Annotated[bool, typer.Option("--repair", help="Recompute damaged chunks.")]
Rtol = Annotated[float, typer.Option("--rtol", help="Accuracy of the motions.")]
MeasureOptions = Annotated[
    list[str],
    typer.Option(
        "--measure",
        metavar="MEASURE",
        help="Measure: period, amplitude, speed, stick_fraction, energy_per_cycle, peak_force, "
        "switches, mean, rms, harmonic, relative_phase, energy_per_distance, cost_of_transport:m*g "
        "..., also of one part as in amplitude:psi; 'name = formula' of these; "
        "file.py:function; may be repeated.",
    ),
]


def sweep_command(
    model: Model,
    over: Annotated[
        list[str],
        typer.Option(
            "--over",
            metavar="NAME=VALUES",
            help="Axis of the map, such as P=0.8:1.6:400, delta=log:0.01:0.2:300, psi=0.1,0.2, "
            "'P,H_star=1:2:9; 3:4:9' or 'P,delta=sobol:1024; 0.8:1.6; 0.01:0.2'; may be "
            "repeated.",
        ),
    ],
    measure: MeasureOptions,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="STORE", help="Path of the map.  [default: out/NAME.zarr]"),
    ] = None,
    settings: ParameterOptions = None,
    initial: Initial = None,
    until: Until = None,
    rtol: Rtol = 1e-10,
    tolerance: Annotated[
        float,
        typer.Option(
            "--tolerance", help="Relative tolerance for a motion to count as settled on a cycle."
        ),
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
            "--longest-cycle",
            metavar="N",
            help="Maximum number of events, or of drive periods, of a cycle.",
        ),
    ] = 48,
    seed: Annotated[
        int, typer.Option("--seed", min=0, help="Seed of random and low-discrepancy samples.")
    ] = 0,
    carry: Annotated[
        str | None,
        typer.Option(
            "--carry",
            metavar="AXIS [up|down|both]",
            help="Start every point along this axis from the settled state of the previous one, "
            "such as omega, 'omega down', or 'omega both' for up and down.",
        ),
    ] = None,
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
            help="Change relative to the range of the measure above which --adaptive refines.",
        ),
    ] = 0.05,
    workers: Workers = None,
    processes: Processes = False,
    scheduler: Scheduler = None,
    local_cluster: LocalCluster = False,
    device: Annotated[
        str,
        typer.Option(
            "--device", metavar="cpu|gpu", help="Device of the computation: cpu or gpu (CUDA)."
        ),
    ] = "cpu",
    extend: Extend = False,
    overwrite: Overwrite = False,
    repair: Repair = False,
    time_limit: TimeLimitOfEach = None,
) -> None:
    """Measure a system over parameters and initial values.

    Writes a Zarr store, chunk by chunk; run the same command again to resume.

    Exit code: 0 complete, 1 a point reached its time limit, 2 wrong input, 130 interrupted
    (the results so far are kept).
    """
    from stickslip import sweep as compute
    from stickslip.sweeps.work.chunk import Settings as MapSettings

    system = load_model(model, settings or [], until)
    start = numbers(assignments(initial or [], "--initial"), "--initial")
    path = out or folder_of(system.name).with_suffix(".zarr")
    settled = MapSettings(
        tolerance=tolerance, max_time=max_time, longest_cycle=longest_cycle, rtol=rtol
    )

    def work(who: str, progress: ShowPoints) -> Map:
        return compute(
            system,
            over,
            measure,
            path,
            initial=start,
            settings=settled,
            seed=seed,
            carry=carry,
            adaptive=_adaptive(adaptive, contrast),
            scheduler=who,
            workers=workers,
            device=device,
            extend=extend,
            overwrite=overwrite,
            repair=repair,
            time_limit=time_limit,
            progress=progress,
        )

    who = workers_of(scheduler, local_cluster, processes, workers)
    found = computed_map(path, who, work)
    print_summary(found.summary(), more=[("written", str(path))])
    if not found.outcome.ok:
        raise typer.Exit(NOT_CERTIFIED)


def computed_map(
    path: Path,
    who: contextlib.AbstractContextManager[str],
    work: Callable[[str, ShowPoints], Map],
) -> Map:
    """A map, with a bar while it is computed; where it is interrupted, the command ends.

    Parameters
    ----------
    path : Path
        Its store.
    who : context manager
        Of the scheduler that does the work.
    work : callable
        Takes the scheduler and who is told of progress.
    """
    try:
        with who as scheduler, _progress(str(path)) as progress:
            found = work(scheduler, progress)
    except KeyboardInterrupt:
        text = (
            f"interrupted; the results so far are in {path}; run the same command again to resume"
        )
        finish(text, EXIT_INTERRUPTED)
    if found.outcome.interrupted:
        done = f"{found.computed:,} of {found.dataset['outcome'].size:,} points are in {path}"
        finish(f"interrupted; {done}; run the same command again to resume", EXIT_INTERRUPTED)
    return found


def plot_command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A stored result, or a map.")],
    measure: Annotated[
        list[str] | None,
        typer.Option("--measure", metavar="NAME", help="Quantity to show; may be repeated."),
    ] = None,
    window: Annotated[
        str | None,
        typer.Option("--time", metavar="LOW:HIGH", help="Time window of a motion."),
    ] = None,
    coordinate: Annotated[
        list[str] | None,
        typer.Option(
            "--coordinate", metavar="NAME", help="Coordinate of a motion; may be repeated."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="FILE", help="Path of the picture.  [default: FILE with .png]"
        ),
    ] = None,
) -> None:
    """Draw a stored result: a motion, a cycle, a branch, a basin, a map or any other.

    By default draws an overview; with --measure, the given measures of a map or a branch, or
    quantities. For a motion or a cycle, --time and --coordinate select a part.
    """
    from stickslip import Cycle, Trajectory
    from stickslip import open as open_result
    from stickslip.figures.drawing.style import paper_style

    result = open_result(file)
    part: dict[str, Any] = {}
    if window is not None:
        part["t"] = tuple(spans([f"t={window}"], "--time")["t"])
    if coordinate:
        part["coordinates"] = coordinate
    if part and not isinstance(result, (Trajectory, Cycle)):
        reason = f"{file} contains {named(result.KIND)}, not a motion"
        raise DeclarationError("--time" if window is not None else "--coordinate", reason)
    with paper_style():
        figure = result.plot(*(measure or ()), **part)
    picture = out or (file if file.stem else file.resolve()).with_suffix(".png")
    try:
        with paper_style():
            figure.savefig(picture)
    except ValueError:
        raise DeclarationError(
            "--out", f"unknown picture format '{picture}'", "Use .png, .pdf or .svg"
        ) from None
    typer.echo(picture)


def export_command(
    file: Annotated[
        str,
        typer.Argument(
            metavar="FILE|MODEL", help="A stored result or map, or the model of a system."
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="Path of the file: .csv, .parquet or .wav for a result; .fmu or .py for a model.",
        ),
    ] = None,
    fmi: Annotated[
        bool, typer.Option("--fmi", help="Write an FMU of the model; NAME.fmu without --out.")
    ] = False,
    python: Annotated[
        bool,
        typer.Option("--python", help="Write a Python file of the model; NAME.py without --out."),
    ] = False,
    settings: ParameterOptions = None,
    input_: Annotated[
        list[str] | None,
        typer.Option(
            "--input",
            metavar="NAME",
            help="Parameter or drive to be an input of the FMU; may be repeated.  [default: all "
            "drives]",
        ),
    ] = None,
    no_inputs: Annotated[
        bool,
        typer.Option("--no-inputs", help="Keep all drives of the FMU as declared, without inputs."),
    ] = False,
    quantity: Annotated[
        list[str] | None,
        typer.Option(
            "--quantity",
            metavar="NAME",
            help="Further column, output of the FMU, or quantity of the sound; may be repeated. "
            "[default: all]",
        ),
    ] = None,
    step: Annotated[
        float | None,
        typer.Option("--step", metavar="DT", help="Time between rows of a motion or a cycle."),
    ] = None,
    units: Annotated[
        bool, typer.Option("--units", help="Add units to the column names of a CSV file.")
    ] = False,
    rate: Annotated[
        int, typer.Option("--rate", metavar="HZ", help="Samples per second of a sound.")
    ] = 44100,
    seconds: Annotated[
        float, typer.Option("--seconds", help="Duration in seconds of a unit of time in a sound.")
    ] = 1.0,
) -> None:
    """Export a stored result for other programs: its table as CSV or Parquet, or a quantity of a
    motion or a cycle as sound; or a model as an FMU or a Python file."""
    from stickslip import export
    from stickslip import open as open_result

    place = _place(file, out, {".fmu": fmi, ".py": python})
    if place.suffix.lower() in (".fmu", ".py"):
        inputs = [] if no_inputs else input_ or None
        export(load_model(file, settings or []), place, *(quantity or ()), inputs=inputs)
    else:
        for option, given in (("--set", settings), ("--input", input_)):
            if given:
                raise DeclarationError(option, "a stored result cannot be changed", "Remove it")
        result = open_result(Path(file))
        export(result, place, *(quantity or ()), step=step, units=units, rate=rate, seconds=seconds)
    typer.echo(place)


def _place(file: str, out: Path | None, asked: Mapping[str, bool]) -> Path:
    """The file that is written."""
    endings = [ending for ending, wanted in asked.items() if wanted]
    if len(endings) > 1:
        raise DeclarationError(
            "--python", "--fmi and this option ask for different files", "Use one of them"
        )
    if out is None:
        if not endings:
            remedy = "Give --out FILE or, for a model, --fmi or --python"
            raise DeclarationError("--out", "the file to write is not specified", remedy)
        return Path(Path(file).stem + endings[0])
    if endings and out.suffix.lower() != endings[0]:
        reason = f"'{out}' does not end in {endings[0]}"
        raise DeclarationError("--out", reason, f"Use {out.with_suffix(endings[0])}")
    return out


def _adaptive(names: list[str] | None, contrast: float) -> Adaptive | None:
    from stickslip.sweeps.adaptive import Adaptive

    return Adaptive(tuple(names), contrast) if names else None


@contextlib.contextmanager
def workers_of(
    address: str | None, local_cluster: bool, processes: bool, workers: int | None
) -> Iterator[str]:
    """Who does the work, as the name of a scheduler."""
    from stickslip.sweeps.work.scheduler import local_cluster as started

    if (address is not None) + local_cluster + processes > 1:
        reason = "--processes, --scheduler and --local-cluster exclude each other"
        raise DeclarationError("sweep", reason, "Use one of them")
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
            bar.update(task, completed=state.done, points=state.describe())

        yield show
