"""The command ``explore``: the page in the browser."""

from __future__ import annotations

from typing import Annotated

import typer


def explore_command(
    model: Annotated[
        str | None,
        typer.Argument(
            metavar="[MODEL]",
            help="A name of the catalogue, a .toml file, or what an address has behind its #.",
        ),
    ] = None,
    port: Annotated[
        int | None, typer.Option("--port", metavar="N", help="Port to listen at.", min=0, max=65535)
    ] = None,
    host: Annotated[
        str, typer.Option("--host", metavar="ADDRESS", help="Address to listen at.")
    ] = "127.0.0.1",
    allow: Annotated[
        list[str] | None,
        typer.Option(
            "--allow",
            metavar="NAME",
            help="A name of this machine under which browsers may ask; may be repeated.",
        ),
    ] = None,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in a browser.")
    ] = True,
) -> None:
    """Open an interactive page in the browser: drag a slider and watch the exact motion.

    Without MODEL it begins with the gallery. The page communicates with this machine only; its
    address contains a random token. Ctrl-C ends it.
    """
    from stickslip.explorer.explore import listening_explorer

    explorer = listening_explorer(model, port=port, host=host, names=tuple(allow or ()))
    typer.echo(f"The explorer is at {explorer.address}")
    typer.echo("Ctrl-C ends it.")
    if browser:
        import webbrowser

        webbrowser.open(explorer.address)
    explorer.serve()
