"""Commands added by other packages: functions for typer, as entry points of one group.

In the ``pyproject.toml`` of a package:

    [project.entry-points."stickslip.commands"]
    paper = "stickslip_paper.command:paper"
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points

import typer

from stickslip.errors import StickslipError

GROUP = "stickslip.commands"
Command = Callable[..., None]


def add_commands(app: typer.Typer, guarded: Callable[[Command], Command]) -> None:
    """Add the commands of other packages, with the same error handling; existing names are not
    overridden."""
    taken = {
        ours.name or getattr(ours.callback, "__name__", "") for ours in app.registered_commands
    }
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        if entry.name not in taken:
            app.command(entry.name)(guarded(_loaded(entry)))


def _loaded(entry: EntryPoint) -> Command:
    """The function of a command, or one that reports why it cannot be imported, so that a broken
    package affects only its command."""
    try:
        return entry.load()
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"

        def broken() -> None:
            raise StickslipError(f"'{entry.name}' ({entry.value}) cannot be loaded: {reason}")

        broken.__doc__ = f"Cannot be loaded: {reason}"
        return broken
