"""How far a long computation is: on stderr, and only if a person is looking."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from rich.progress import Progress

_display: Progress | None = None  # a terminal has room for one


class Stopped(Exception):
    """A task was given up, since there was a wish to stop."""


class Show(Protocol):
    """Takes the fraction that is done (None: nobody knows) and a few words."""

    def __call__(self, fraction: float | None, text: str = "") -> None: ...


@contextmanager
def watched(what: str) -> Iterator[Show]:
    """A bar on stderr while the block runs; below that of the work it is part of, if that has
    one."""
    if not sys.stderr.isatty():
        yield lambda fraction, text="": None
        return
    with _shared() as bar:
        task = bar.add_task(what, total=None, text="")

        def show(fraction: float | None, text: str = "") -> None:
            bar.update(task, total=None if fraction is None else 1.0, completed=fraction, text=text)

        yield show
        bar.remove_task(task)


@contextmanager
def _shared() -> Iterator[Progress]:
    """The display of this terminal."""
    global _display
    if _display is not None:
        yield _display
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[text]}"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as _display:
        try:
            yield _display
        finally:
            _display = None
