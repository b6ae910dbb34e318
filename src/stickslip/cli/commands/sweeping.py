"""The commands ``sweep`` and ``plot``: parameter maps."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stickslip.cli.common.ending import EXIT_INTERRUPTED, NOT_CERTIFIED, finish
from stickslip.cli.common.models import given, load_model, spans
from stickslip.cli.common.options import (
    AccuracyOfEach,
    Initial,
    MeasureOptions,
    Model,
    ParameterOptions,
    Stored,
    TimeLimitOfEach,
    Until,
    Workers,
)
from stickslip.cli.common.present import folder_of
from stickslip.cli.common.report import print_summary
from stickslip.errors import DeclarationError
from stickslip.storage import named

if TYPE_CHECKING:
    from stickslip import Map
    from stickslip.sweeps.adaptive import Adaptive
    from stickslip.sweeps.sweep import Progress


@dataclass(frozen=True)
class Convergence:
    """Criteria of convergence, and the accuracy."""

    rtol: AccuracyOfEach = 1e-10
    tolerance: Annotated[
        float,
        typer.Option("--tolerance", help="Relative tolerance for the convergence of a motion."),
    ] = 1e-8
    max_time: Annotated[
        float | None,
        typer.Option(
            "--max-time", metavar="T", help="Time after which a motion counts as not converged."
        ),
    ] = None
    longest_cycle: Annotated[
        int,
        typer.Option(
            "--longest-cycle",
            metavar="N",
            help="Maximum number of events, or of drive periods, of a cycle.",
        ),
    ] = 48


@dataclass(frozen=True)
class Refinement:
    """Options for the refinement of an adaptive map."""

    adaptive: Annotated[
        list[str] | None,
        typer.Option(
            "--adaptive",
            metavar="NAME",
            help="Refine only where this measure, or the outcome, changes.",
        ),
    ] = None
    contrast: Annotated[
        float,
        typer.Option(
            "--contrast",
            help="Change relative to the range of the measure above which --adaptive refines.",
        ),
    ] = 0.05

    def rule(self) -> Adaptive | None:
        """The rule of refinement; None for a map of equal resolution."""
        from stickslip.sweeps.adaptive import Adaptive

        return Adaptive(tuple(self.adaptive), self.contrast) if self.adaptive else None


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
    *,
    convergence: Convergence,
    seed: Annotated[
        int, typer.Option("--seed", min=0, help="Seed of random and low-discrepancy samples.")
    ] = 0,
    carry: Annotated[
        str | None,
        typer.Option(
            "--carry",
            metavar="AXIS [up|down|both]",
            help="Start every point along this axis from the final state of the previous one, "
            "such as omega, 'omega down', or 'omega both' for up and down.",
        ),
    ] = None,
    refinement: Refinement,
    by: Workers,
    device: Annotated[
        str,
        typer.Option(
            "--device", metavar="cpu|gpu", help="Device of the computation: cpu or gpu (CUDA)."
        ),
    ] = "cpu",
    stored: Stored,
    time_limit: TimeLimitOfEach = None,
) -> None:
    """Compute measures of a system over a grid of parameters and initial values.

    Writes a Zarr store, chunk by chunk; run the same command again to resume.

    Exit code: 0 complete, 1 a point reached its time limit, 2 wrong input, 130 interrupted
    (the results so far are kept).
    """
    from stickslip import Settings
    from stickslip import sweep as compute

    system = load_model(model, settings or [], until)
    start = given(initial)
    path = out or folder_of(system.name).with_suffix(".zarr")

    def work(**running: Any) -> Map:
        return compute(
            system,
            over,
            measure,
            path,
            initial=start,
            settings=Settings(**vars(convergence)),
            seed=seed,
            carry=carry,
            adaptive=refinement.rule(),
            device=device,
            time_limit=time_limit,
            **vars(stored),
            **running,
        )

    found = computed_map(path, by, work)
    print_summary(found.summary(), more=[("written", str(path))])
    if not found.outcome.ok:
        raise typer.Exit(NOT_CERTIFIED)


def computed_map(path: Path, by: Workers, work: Callable[..., Map]) -> Map:
    """Compute a map with a progress bar; an interruption ends the command.

    Parameters
    ----------
    path : Path
        Its store.
    work : callable
        Takes ``scheduler``, ``workers`` and ``progress``, as ``sweep`` does.
    """
    try:
        with by.started() as scheduler, _progress(str(path)) as progress:
            found = work(scheduler=scheduler, workers=by.workers, progress=progress)
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
            "--out", metavar="FILE", help="Path of the figure.  [default: FILE with .png]"
        ),
    ] = None,
) -> None:
    """Plot a stored result: a motion, a cycle, a branch, a basin, a map or any other.

    By default plots an overview; with --measure, the given measures of a map or a branch, or
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
            "--out", f"unknown figure format '{picture}'", "Use .png, .pdf or .svg"
        ) from None
    typer.echo(picture)


@dataclass(frozen=True)
class Target:
    """The output file, and its kind."""

    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="Path of the file: .csv, .parquet or .wav for a result; .fmu or .py for a model.",
        ),
    ] = None
    fmi: Annotated[
        bool, typer.Option("--fmi", help="Write an FMU of the model; NAME.fmu without --out.")
    ] = False
    python: Annotated[
        bool,
        typer.Option("--python", help="Write a Python file of the model; NAME.py without --out."),
    ] = False

    def path(self, source: str) -> Path:
        """The path of the file; without ``--out`` it is named after the source.

        Raises
        ------
        DeclarationError
            If the options ask for two kinds of files, or for none.
        """
        asked = {".fmu": self.fmi, ".py": self.python}
        endings = [ending for ending, wanted in asked.items() if wanted]
        if len(endings) > 1:
            raise DeclarationError(
                "--python", "--fmi and this option ask for different files", "Use one of them"
            )
        if self.out is None:
            if not endings:
                remedy = "Give --out FILE or, for a model, --fmi or --python"
                raise DeclarationError("--out", "the file to write is not specified", remedy)
            return Path(Path(source).stem + endings[0])
        if endings and self.out.suffix.lower() != endings[0]:
            reason = f"'{self.out}' does not end in {endings[0]}"
            raise DeclarationError("--out", reason, f"Use {self.out.with_suffix(endings[0])}")
        return self.out


@dataclass(frozen=True)
class Sampling:
    """Rows of a table and samples of a sound, as arguments of ``export``."""

    step: Annotated[
        float | None,
        typer.Option("--step", metavar="DT", help="Time between rows of a motion or a cycle."),
    ] = None
    units: Annotated[
        bool, typer.Option("--units", help="Add units to the column names of a CSV file.")
    ] = False
    rate: Annotated[
        int, typer.Option("--rate", metavar="HZ", help="Samples per second of a sound.")
    ] = 44100
    seconds: Annotated[
        float, typer.Option("--seconds", help="Duration in seconds of a unit of time in a sound.")
    ] = 1.0


def export_command(
    file: Annotated[
        str,
        typer.Argument(
            metavar="FILE|MODEL", help="A stored result or map, or the model of a system."
        ),
    ],
    *,
    target: Target,
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
    sampling: Sampling,
) -> None:
    """Export a stored result for other programs: its table as CSV or Parquet, or a quantity of a
    motion or a cycle as sound; or a model as an FMU or a Python file."""
    from stickslip import export
    from stickslip import open as open_result

    place = target.path(file)
    if place.suffix.lower() in (".fmu", ".py"):
        inputs = [] if no_inputs else input_ or None
        export(load_model(file, settings or []), place, *(quantity or ()), inputs=inputs)
    else:
        for option, values in (("--set", settings), ("--input", input_)):
            if values:
                raise DeclarationError(option, "a stored result cannot be changed", "Remove it")
        result = open_result(Path(file))
        export(result, place, *(quantity or ()), **vars(sampling))
    typer.echo(place)


@contextlib.contextmanager
def _progress(label: str) -> Iterator[Callable[[Progress], None] | None]:
    """Print points done, rate, time left and outcomes to stderr, if it is a terminal."""
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
            if state.new == 0:  # results from the store do not predict the remaining time
                bar.reset(task, total=state.total, completed=state.done)
            bar.update(task, completed=state.done, points=state.describe())

        yield show
