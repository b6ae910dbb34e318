"""The command ``explore``: the page in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from stickslip.cli.common.ending import NOT_CERTIFIED
from stickslip.errors import DeclarationError


def explore_command(
    model: Annotated[
        str | None,
        typer.Argument(
            metavar="[MODEL]",
            help="Name of a catalogue system, a .toml file, or the part of a URL after #.",
        ),
    ] = None,
    port: Annotated[
        int | None, typer.Option("--port", metavar="N", help="Port to listen on.", min=0, max=65535)
    ] = None,
    host: Annotated[
        str, typer.Option("--host", metavar="ADDRESS", help="Address to listen on.")
    ] = "127.0.0.1",
    allow: Annotated[
        list[str] | None,
        typer.Option(
            "--allow",
            metavar="NAME",
            help="Host name accepted in requests; may be repeated.",
        ),
    ] = None,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in a browser.")
    ] = True,
    export: Annotated[
        Path | None,
        typer.Option(
            "--export",
            metavar="FILE",
            help="Write a page with stored motions, one .html file that works without this "
            "program and without a network, and exit.",
        ),
    ] = None,
    over: Annotated[
        list[str] | None,
        typer.Option(
            "--over",
            metavar="NAME=VALUES",
            help="Slider of the exported page, such as V=0.05:0.4:15, or V for its range in the "
            "explorer; up to three, whose values are combined.  [default: one parameter at a time]",
        ),
    ] = None,
) -> None:
    """Open an interactive page in the browser, with the exact motion for every slider position.

    Without MODEL the page starts with the gallery. The server listens on this machine only, and the
    URL contains a random token. Press Ctrl-C to stop the server.

    With --export, motions and cycles are computed for all values and written into one file.

    Exit code: 0 done, 1 not every exported motion is certified, 2 wrong input, 130 interrupted.
    """
    if export is not None:
        _export(model, export, over, port)
        return
    if over:
        raise DeclarationError(
            "--over", "only exported pages have sliders with given values", "Add --export FILE.html"
        )
    from stickslip.explorer.explore import listening_explorer

    explorer = listening_explorer(model, port=port, host=host, names=tuple(allow or ()))
    typer.echo(f"The explorer runs at {explorer.address}")
    typer.echo("Press Ctrl-C to stop it.")
    if browser:
        import webbrowser

        webbrowser.open(explorer.address)
    explorer.serve()


def _export(model: str | None, path: Path, over: list[str] | None, port: int | None) -> None:
    """Write a page with stored motions."""
    from stickslip.explorer.explore import named_system
    from stickslip.explorer.offline.page import export_page

    if model is None:
        raise DeclarationError("MODEL", "the system is missing", "Name one, like belt_block")
    if port is not None:
        raise DeclarationError("--port", "an exported page needs no server", "Remove it")
    written = export_page(named_system(model), path, over, where="--export")
    typer.echo(written.describe())
    if not written.ok:
        raise typer.Exit(NOT_CERTIFIED)
