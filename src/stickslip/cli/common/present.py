"""Common steps of commands that compute: the computation, its files, plot, summary and exit
code."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, Protocol

import typer

from stickslip.cli.common.ending import EXIT_INTERRUPTED, NOT_CERTIFIED, finish
from stickslip.cli.common.folder import PICTURE, add_picture, result_folder
from stickslip.cli.common.options import Json, Out
from stickslip.cli.common.report import print_summary, warn, written
from stickslip.errors import ConvergenceError
from stickslip.progress import watched
from stickslip.results import Ended, Summary

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

SUMMARY = "summary.json"
ShowProgress = Callable[..., None]


class Shown(Protocol):
    """Interface of the objects that commands can show; all results have it."""

    @property
    def outcome(self) -> Ended:
        """Outcome of the computation."""
        ...

    def summary(self) -> Summary:
        """The summary."""
        ...

    def plot(self) -> Figure:
        """The picture."""
        ...

    def save(self, path: str | Path) -> None:
        """Write the data."""
        ...


@dataclass(frozen=True)
class Files:
    """Files written by a command in addition to summary and plot.

    Attributes
    ----------
    data : str
        The file that ``stickslip.open`` reads; none if empty.
    tables : mapping of str to callable
        Files of comma-separated values, and the tables that are in them.
    folder : str
        What the default folder is called after the name of the model: ``out/NAME-folder``.
    """

    data: str = ""
    tables: Mapping[str, Callable[[Any], pandas.DataFrame]] = field(default_factory=dict)
    folder: str = ""

    @classmethod
    def with_table(cls, name: str, folder: str = "") -> Files:
        """``NAME.nc``, and the table of the result as ``NAME.csv``."""
        return cls(f"{name}.nc", {f"{name}.csv": attrgetter("table")}, folder or name)

    @property
    def names(self) -> tuple[str, ...]:
        """All files of the folder."""
        return (SUMMARY, *([self.data] if self.data else []), *self.tables, PICTURE)


@dataclass(frozen=True)
class ResultOptions:
    """Options for the output folder, and for printing the summary."""

    out: Out = None
    json_: Json = False


def present(
    label: str,
    name: str,
    files: Files,
    work: Callable[[ShowProgress], Shown],
    output: ResultOptions,
    heading: Mapping[str, Any] | None = None,
) -> NoReturn:
    """Run a computation, write, plot and print its results, and exit with 0 if complete and
    certified, 1 if not, 130 if interrupted.

    Parameters
    ----------
    label : str
        Label of the progress bar.
    name : str
        Name of the model, used for the default folder.
    work : callable
        progress callback ↦ result.
    heading : mapping, optional
        Additional entries of the summary, such as the ``title`` of the model file.
    """
    folder = output.out or folder_of(name, files.folder)
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
    print_summary(summary, output.json_, [("written", written(folder, files.names))])
    for warning in summary.data.get("warnings", ()):
        warn(warning)
    if result.outcome.interrupted:
        finish(f"interrupted; the results so far are in {folder}", EXIT_INTERRUPTED)
    raise typer.Exit(0 if summary.good else NOT_CERTIFIED)


def _timed(summary: Summary, heading: Mapping[str, Any], seconds: float) -> Summary:
    """The summary with additional entries, and the elapsed time."""
    data = {**summary.data, **heading, "wall_time": seconds}
    rows = (*summary.rows, ("wall time", f"{seconds:.3g} s"))
    return replace(summary, title=str(data["title"]), rows=rows, data=data)


def folder_of(name: str, what: str = "") -> Path:
    """``out/NAME``, or ``out/NAME-what``."""
    plain = re.sub(r"[^\w.-]+", "_", name)
    return Path("out") / (f"{plain}-{what}" if what else plain)
