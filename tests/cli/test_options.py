"""Options that a command takes as one object."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer
from typer.testing import CliRunner

from stickslip.cli.app import app
from stickslip.cli.common.options import with_single_options


@dataclass(frozen=True)
class Grid:
    """Options of a grid."""

    low: float = 0.0
    count: Annotated[int, typer.Option("--number", help="Number of points.")] = 3


def test_objects_are_given_as_single_options() -> None:
    """An object stands among other options, even before a required one, and its fields have their
    defaults."""
    seen: list[object] = []

    def command(name: str, *, grid: Grid, scale: Annotated[float, typer.Option("--scale")]) -> None:
        """Take everything."""
        seen.append((name, grid, scale))

    own = typer.Typer()
    own.command()(with_single_options(command))
    result = CliRunner().invoke(own, ["a", "--scale", "2", "--number", "5"])
    assert result.exit_code == 0, result.output
    assert seen == [("a", Grid(count=5), 2.0)]
    shown = CliRunner().invoke(own, ["--help"]).output
    assert shown.index("--low") < shown.index("--number") < shown.index("--scale")


def test_all_commands_take_single_options() -> None:
    """No option of the program is an object."""
    program = typer.main.get_command(app)
    names = [p.name for command in program.commands.values() for p in command.params]  # type: ignore[attr-defined]
    assert {"workers", "extend", "rtol", "json_", "out"} <= set(names)
    assert not {"output", "by", "stored", "reading", "target"} & set(names)
