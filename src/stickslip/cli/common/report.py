"""Summaries, lists of written files and warnings on the terminal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from stickslip.results import Summary

_VERDICTS = ("outcome", "certificate")  # rows in green or red


def print_summary(
    summary: Summary, json_: bool = False, more: Sequence[tuple[str, str]] = ()
) -> None:
    """Print a summary as JSON and nothing else, or as a table with more rows; bad verdicts are
    red."""
    if json_:
        typer.echo(summary.to_json())
        return
    table = Table.grid(padding=(0, 3))
    table.add_column(style="dim", no_wrap=True)
    table.add_column(overflow="fold")
    for label, text in (*summary.rows, *more):
        if label == "warning":
            continue  # on stderr
        verdict = "green" if summary.good else "bold red"
        table.add_row(label, Text(text, style=verdict if label in _VERDICTS else ""))
    console = Console()
    console.print(Text(summary.title, style="bold"))
    console.print(table)


def written(folder: Path, files: Iterable[str]) -> str:
    """The folder of the results, and the files in it."""
    return f"{folder}/  {', '.join(name for name in files if (folder / name).exists())}"


def warn(text: str) -> None:
    """A warning on stderr."""
    Console(stderr=True).print(Text(f"warning: {text}", style="yellow"))
