"""Commands of other packages, and the one that comes with the library."""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

import pytest
import typer
from typer.testing import CliRunner

import stickslip as ss
from stickslip.cli import added
from stickslip.cli.common.ending import guarded
from stickslip_paper import command

PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))


@pytest.fixture
def package(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """A package with a command, one that is broken, and one whose name is taken."""
    module = ModuleType("somebody")
    monkeypatch.setitem(sys.modules, "somebody", module)
    points = [
        EntryPoint(name, f"somebody:{name}", added.GROUP) for name in ("works", "missing", "ours")
    ]
    monkeypatch.setattr(added, "entry_points", lambda group: points)
    yield module


def application() -> typer.Typer:
    app = typer.Typer()

    @app.command()
    def ours() -> None:
        typer.echo("ours")

    @app.callback()
    def _all() -> None:
        pass

    added.add_commands(app, guarded)
    return app


def test_commands_are_added(package: ModuleType) -> None:
    def works(number: int) -> None:
        if number < 0:
            raise ss.StickslipError("no negative numbers")
        typer.echo(f"works {number}")

    package.works = works  # type: ignore[attr-defined]
    package.ours = lambda: typer.echo("theirs")  # type: ignore[attr-defined]
    run = CliRunner().invoke
    assert run(application(), ["works", "3"]).stdout == "works 3\n"
    refused = run(application(), ["works", "--", "-3"])
    assert (refused.exit_code, refused.stderr) == (2, "stickslip: no negative numbers\n")
    assert run(application(), ["ours"]).stdout == "ours\n"
    broken = run(application(), ["missing"])
    assert broken.exit_code == 2
    assert "'missing' (somebody:missing) cannot be loaded: AttributeError" in broken.stderr
    assert broken.stderr.count("\n") == 1


def test_the_paper_says_what_it_lacks(monkeypatch: pytest.MonkeyPatch) -> None:
    def without(name: str) -> object:
        return None if name == "sympy" else find_spec(name)

    monkeypatch.setattr(command, "find_spec", without)
    app = typer.Typer()
    app.command()(guarded(command.paper))
    result = CliRunner().invoke(app, [])
    assert result.exit_code == 2
    assert result.stderr == (
        "stickslip: the paper needs SymPy. Install what it takes: pip install 'stickslip[paper]'\n"
    )


def test_the_paper_is_an_entry_point() -> None:
    """In ``pyproject.toml``, and in what is installed: after a change of it, install again."""
    value = PROJECT["project"]["entry-points"][added.GROUP]["paper"]
    (found,) = [point for point in added.entry_points(group=added.GROUP) if point.name == "paper"]
    assert found.value == value
    assert found.load() is command.paper
