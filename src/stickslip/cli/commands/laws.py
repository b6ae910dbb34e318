"""The command ``law``: the list of named friction laws, and the description of each."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

import typer

from stickslip.cli.common.folder import PICTURE, add_picture, result_folder
from stickslip.cli.common.models import assignments, numbers
from stickslip.cli.common.present import SUMMARY, folder_of
from stickslip.cli.common.report import written
from stickslip.display.terminal import wrap_words
from stickslip.model import laws

_FILES = (SUMMARY, PICTURE)


def list_laws() -> None:
    """All laws with their sources, a line each."""
    known = [laws.by_name(name) for name in laws.all_names()]
    names, titles = (max(len(getattr(law, key)) for law in known) for key in ("name", "title"))
    for law in known:
        typer.echo(f"{law.name:<{names}}   {law.title:<{titles}}   {law.source}")


def show_law(name: str, settings: Iterable[str], out: Path | None) -> None:
    """A single law: the equations of a mass with it, its declaration, and a plot of its loops.

    Raises
    ------
    DeclarationError
        If there is no such law, or a parameter is not admissible.
    """
    law = laws.by_name(name)
    values = numbers(assignments(settings, "--set"), "--set")
    example = law.specimen(values)
    text = str(example.equations()).partition("\nStart")[0].rstrip()
    folder = out or folder_of(law.name, "law")
    with result_folder(folder, _FILES) as place:
        said = {"program": "stickslip", "law": law.name, "source": law.source}
        data = {**said, "equations": text, "parameters": example.values}
        (place / SUMMARY).write_text(
            json.dumps(data, indent=2, ensure_ascii=False) + "\n", encoding="utf-8"
        )

    def draw():
        from stickslip.figures.law import plot_law

        return plot_law(law, values)

    add_picture(folder, draw)
    typer.echo(text)
    typer.echo("\n" + "\n".join(wrap_words(law.about, 96)))
    given = [f"{own} = {p.default:g}" for own, p in law.parameters.items()]
    if law.several:
        given = [f"{own} = [...]" for own in law.parameters]
    options = [f"{own} = {p.default:g}" for own, p in law.options.items()]
    line = ", ".join([f'law = "{law.name}"', 'direction = "d_x"', *given])
    typer.echo(f"\nIn a model file\n  contacts.foot = {{{line}}}")
    if options:
        typer.echo(f"  optional: {', '.join(options)}")
    typer.echo(f"\nwritten   {written(folder, _FILES)}")
