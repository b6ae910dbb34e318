"""The command ``stickslip paper``: the figures and claims of [M], and the page that shows them."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import stickslip as ss

if TYPE_CHECKING:
    from stickslip_paper.making import Item, Work

_UNEXPECTED = 1  # exit code, as for all commands
INTERRUPTED = 130
_NEEDED = {"SymPy": "sympy", "Pillow": "PIL"}
NAMES = ("claims.json", "index.html", "figures", "animations")


def paper(
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Folder for the results.  [default: out/paper]"),
    ] = None,
    only: Annotated[
        str | None,
        typer.Option("--only", metavar="KEY", help="One figure or place, such as 4.4 or (3.6)."),
    ] = None,
) -> None:
    """Plot every figure of Mielke 2017 and check its claims.

    Writes figures, animations, claims.json and the page index.html into the folder DIR.

    Exit code: 0 every verdict is the expected one, 1 not, 2 wrong input, 130 interrupted (what was
    made is kept).
    """
    _check_installed()
    from stickslip_paper.making import Work, items, make_all
    from stickslip_paper.report import unexpected, write_data, write_page

    work = Work(items(only))
    began = time.perf_counter()
    folder = out or Path("out") / (
        "paper" if only is None else f"paper-{re.sub(r'[^0-9A-Za-z.]+', '', only)}"
    )
    with _writing(folder):
        write_data(work, folder, 0.0)  # marks the folder as ours
        with _bar() as show:

            def made(fraction: float, item: Item) -> None:
                show(fraction, f"{item.kind} {item.key[:32]:<32}")
                # recorded in case of a later failure
                write_data(work, folder, time.perf_counter() - began)

            make_all(work, folder, made)
        seconds = time.perf_counter() - began
        write_data(work, folder, seconds)
        write_page(work, folder, seconds)
    _report(work, folder, seconds)
    if work.interrupted:
        made_of = f"{len(work.done)} of {len(work.items)} items"
        typer.echo(f"stickslip: interrupted; {made_of} are in {folder}", err=True)
        raise typer.Exit(INTERRUPTED)
    raise typer.Exit(_UNEXPECTED if unexpected(work) else 0)


def _check_installed() -> None:
    """Raise an error if a requirement of the paper is not installed."""
    missing = [name for name, module in _NEEDED.items() if find_spec(module) is None]
    if missing:
        raise ss.StickslipError(
            f"the paper needs {' and '.join(missing)}. "
            "Install what it takes: pip install 'stickslip[paper]'"
        )


@contextmanager
def _bar() -> Iterator[Callable[[float, str], None]]:
    """A progress bar on stderr that is removed at the end; none without a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("making"), BarColumn(), TextColumn("{task.description}"))
    console = Console(stderr=True)
    with Progress(
        *columns,
        TimeElapsedColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda fraction, text: bar.update(task, completed=fraction, description=text)


@contextmanager
def _writing(folder: Path) -> Iterator[None]:
    """Write into a folder that is new, or that an earlier run has made."""
    taken = [name for name in NAMES if (folder / name).exists()]
    if folder.exists() and not folder.is_dir():
        raise ss.StickslipError(
            f"{folder}: is a file, not a folder. Choose another folder with --out"
        )
    if taken and not _is_ours(folder):
        raise ss.StickslipError(
            f"{folder}: holds {', '.join(taken)}, not written by stickslip. Choose another folder "
            "with --out"
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        reason = f"{error.filename or folder}: cannot be written ({error.strerror or error})"
        raise ss.StickslipError(f"{reason}. Choose another folder with --out") from None


def _is_ours(folder: Path) -> bool:
    try:
        data = json.loads((folder / "claims.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(data, dict) and data.get("program") == "stickslip"


def _report(work: Work, folder: Path, seconds: float) -> None:
    """Print a short table, and unexpected results."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from stickslip_paper.making import claim_named
    from stickslip_paper.report import counts, pictures, unexpected

    table = Table.grid(padding=(0, 3))
    table.add_column(style="dim", no_wrap=True)
    table.add_column(overflow="fold")
    for kind in ("figure", "animation"):
        made = pictures(work, kind)
        if made:
            table.add_row(f"{kind}s", ", ".join(entry.key for entry, m in made if not m.error))
    for verdict, count in counts(work).items():
        if count:
            table.add_row(verdict, f"{count} claim{'s' if count > 1 else ''}")
    for made in unexpected(work):
        item = made.item
        text = (
            made.error
            if made.finding is None
            else f"{made.finding.verdict.value}: {made.finding.measured}"
        )
        where = claim_named(item.key).place if item.kind == "claim" else item.kind
        table.add_row("not as expected", Text(f"{where} {item.key}: {text}", style="bold red"))
    table.add_row("wall time", f"{seconds:.3g} s")
    table.add_row("written", f"{folder}/  index.html, claims.json, figures, animations")
    console = Console()
    console.print(Text("Mielke 2017, figures and claims", style="bold"))
    console.print(table)
