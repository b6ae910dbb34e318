"""The command ``explore``: the page in the browser."""

from __future__ import annotations

from typing import Annotated

import typer


def explore_command(
    model: Annotated[
        str | None,
        typer.Argument(
            metavar="[MODEL]",
            help="Name of a catalogue system, a .toml file, or the part of an address after #.",
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
) -> None:
    """Open an interactive page in the browser, with the exact motion for every slider position.

    Without MODEL it starts with the gallery. The page connects to this machine only; its address
    contains a random token. Press Ctrl-C to stop it.
    """
    from stickslip.explorer.explore import listening_explorer

    explorer = listening_explorer(model, port=port, host=host, names=tuple(allow or ()))
    typer.echo(f"The explorer runs at {explorer.address}")
    typer.echo("Press Ctrl-C to stop it.")
    if browser:
        import webbrowser

        webbrowser.open(explorer.address)
    explorer.serve()
