"""What all commands that compute share: do the work, write it down, draw it, say it, and end."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, Protocol

import typer

from stickslip.cli.common.ending import EXIT_INTERRUPTED, NOT_CERTIFIED, finish
from stickslip.cli.common.folder import PICTURE, add_picture, result_folder
from stickslip.cli.common.report import print_summary, warn, written
from stickslip.errors import ConvergenceError
from stickslip.progress import watched
from stickslip.results import Ended, Summary

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

SUMMARY = "summary.json"


def _systems(begun: str) -> list[str]:
    """Names that a shell may complete."""
    from stickslip import catalogue

    return [name for name in catalogue.names() if name.startswith(begun)]


Model = Annotated[
    str,
    typer.Argument(
        metavar="MODEL",
        help="Name of a catalogue system (see: stickslip list) or a .toml file.",
        autocompletion=_systems,
    ),
]
ParameterOptions = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Parameter, or a formula for a free function, or a file of samples for a drive, as "
        "in a=base.csv; may be repeated.",
    ),
]
Initial = Annotated[
    list[str] | None,
    typer.Option(
        "--initial", metavar="NAME=VALUE", help="Initial value, such as psi=0.8; may be repeated."
    ),
]
Until = Annotated[
    float | None,
    typer.Option("--until", metavar="T", help="End of the time span.  [default: the model's]"),
]
Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Folder for the results.  [default: out/NAME]"),
]
TimeLimit = Annotated[
    float | None,
    typer.Option(
        "--time-limit",
        metavar="SECONDS",
        help="Wall-clock limit; the results so far are kept.",
    ),
]
TimeLimitOfEach = Annotated[
    float | None,
    typer.Option(
        "--time-limit",
        metavar="SECONDS",
        help="Processor-time limit of a motion; the others continue.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print only the summary, as JSON.")]
ShowProgress = Callable[..., None]


class Shown(Protocol):
    """What a command can show: every result is one."""

    @property
    def outcome(self) -> Ended:
        """How the computation ended."""
        ...

    def summary(self) -> Summary:
        """What there is to say on a page."""
        ...

    def plot(self) -> Figure:
        """The picture."""
        ...

    def save(self, path: str | Path) -> None:
        """Write the data."""
        ...


@dataclass(frozen=True)
class Files:
    """What a command writes beside the summary and the picture.

    Attributes
    ----------
    data : str
        The file that ``stickslip.open`` reads; none if empty.
    tables : mapping of str to callable
        Files of comma-separated values, and the tables that are in them.
    """

    data: str = ""
    tables: Mapping[str, Callable[[Any], pandas.DataFrame]] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """All files of the folder."""
        return (SUMMARY, *([self.data] if self.data else []), *self.tables, PICTURE)


def present(
    label: str,
    folder: Path,
    files: Files,
    work: Callable[[ShowProgress], Shown],
    json_: bool,
    heading: Mapping[str, Any] | None = None,
) -> NoReturn:
    """Do the work, write its results together, draw them, print them, and end with the exit code
    that fits: 0 complete and certified, 1 not, 130 interrupted.

    Parameters
    ----------
    label : str
        What is done, beside the bar on a terminal.
    work : callable
        Takes what shows progress, returns the result.
    json_ : bool
        Whether the summary is printed as JSON.
    heading : mapping, optional
        What the summary says besides: ``title`` and the like of the model file.
    """
    began = time.perf_counter()
    with result_folder(folder, files.names) as place:
        try:
            with watched(label) as progress:
                result = work(progress)
        except ConvergenceError as failure:
            finish(str(failure), NOT_CERTIFIED)
        if result.outcome.interrupted and sys.stderr.isatty():
            typer.echo(
                "stopping; writing the results so far. Press Ctrl-C again to stop without writing",
                err=True,
            )
        if files.data:
            result.save(place / files.data)
        for name, table in files.tables.items():
            table(result).to_csv(place / name, index=False)
        summary = _timed(result.summary(), heading or {}, time.perf_counter() - began)
        (place / SUMMARY).write_text(summary.to_json() + "\n", encoding="utf-8")
    add_picture(folder, result.plot)
    print_summary(summary, json_, [("written", written(folder, files.names))])
    for warning in summary.data.get("warnings", ()):
        warn(warning)
    if result.outcome.interrupted:
        finish(f"interrupted; the results so far are in {folder}", EXIT_INTERRUPTED)
    raise typer.Exit(0 if summary.good else NOT_CERTIFIED)


def _timed(summary: Summary, heading: Mapping[str, Any], seconds: float) -> Summary:
    """The summary with what else is known, and the time that it took."""
    data = {**summary.data, **heading, "wall_time": seconds}
    rows = (*summary.rows, ("wall time", f"{seconds:.3g} s"))
    return replace(summary, title=str(data["title"]), rows=rows, data=data)


def folder_of(name: str, what: str = "") -> Path:
    """``out/NAME``, or ``out/NAME-what``."""
    plain = re.sub(r"[^\w.-]+", "_", name)
    return Path("out") / (f"{plain}-{what}" if what else plain)
