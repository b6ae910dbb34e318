"""Short tables for people."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from stickslip.cli.folder import FILES
from stickslip.display.symbols import unicode_name

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

SHOWN = 8  # state variables in the table; all are in summary.json


def print_summary(summary: dict[str, Any], folder: Path) -> None:
    """What happened, whether it is certified, and where it is."""
    final = [
        f"{_symbol(name)} = {value:.6g}"
        for name, value in summary["final"].items()
        if value is not None
    ]
    more = [f"... ({len(final)} in all)"] if len(final) > SHOWN else []
    rows = [
        ("outcome", summary["outcome"] if summary["complete"] else summary["message"]),
        ("time", f"{summary['t_span'][0]:g} to {summary['end']:g}"),
        ("switches", str(summary["switches"])),
        ("final state", ", ".join(final[:SHOWN] + more)),
        *certificate_rows(summary["certificate"]),
        ("wall time", f"{summary['wall_time']:.3g} s"),
        ("written", written(folder, FILES)),
    ]
    print_table(
        summary["title"] or summary["system"], rows, summary["certified"] and summary["complete"]
    )
    for warning in summary["warnings"]:
        warn(warning)


def print_check(file: Path, trajectory: Trajectory) -> None:
    """The certificate of a stored trajectory."""
    certificate = trajectory.certificate
    rows = [
        ("file", str(file)),
        ("outcome", trajectory.message),
        ("switches", str(trajectory.n_switches)),
        *certificate_rows(certificate.to_dict()),
    ]
    print_table(trajectory.system.title or trajectory.system.name, rows, certificate.ok)


def written(folder: Path, files: Iterable[str]) -> str:
    """Where the results are, and which."""
    return f"{folder}/  {', '.join(name for name in files if (folder / name).exists())}"


def warn(text: str) -> None:
    """What a user should know beside the result."""
    Console(stderr=True).print(Text(f"warning: {text}", style="yellow"))


def certificate_rows(certificate: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The verdict, and every residual with its limit."""
    rows = [("certificate", str(certificate["verdict"]))]
    for r in certificate["residuals"]:
        value = "not finite" if r["value"] is None else f"{r['value']:.1e}"
        bound = (
            ""
            if r["limit"] is None
            else f", at {'least' if r['least'] else 'most'} {r['limit']:.0e}"
        )
        rows.append((f"  {r['name']}", f"{value}{bound}" + (f" {r['note']}" if r["note"] else "")))
    return rows


def print_table(title: str, rows: Iterable[tuple[str, str]], good: bool) -> None:
    """A title and lines of two columns; what is not good is shown in red."""
    table = Table.grid(padding=(0, 3))
    table.add_column(style="dim", no_wrap=True)
    table.add_column(overflow="fold")
    for label, text in rows:
        style = ("green" if good else "bold red") if label in ("outcome", "certificate") else ""
        table.add_row(label, Text(text, style=style))
    console = Console()
    console.print(Text(title, style="bold"))
    console.print(table)


def _symbol(name: str) -> str:
    return unicode_name(name[2:], 1) if name.startswith("d_") else unicode_name(name)
