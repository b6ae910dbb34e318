"""Progress of long computations: on stderr in a terminal, or in a notebook."""

from __future__ import annotations

import multiprocessing
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from html import escape
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

if TYPE_CHECKING:
    from rich.progress import Progress

PATIENCE = 0.5
"""Seconds before which nobody asks how far it is."""
_EVERY = 0.2  # seconds between two pictures of a bar in a notebook
_display: Progress | None = None  # shared: a terminal has room for one progress display
_page: _Page | None = None  # shared: so has the output of a notebook cell
_Listener = TypeVar("_Listener", bound=Callable[..., None])


class Show(Protocol):
    """Receives the completed fraction (None: unknown) and a short text."""

    def __call__(self, fraction: float | None, text: str = "") -> None: ...


_Place = Callable[[str], AbstractContextManager[Show]]


def watched(what: str, *, patience: float = 0.0) -> AbstractContextManager[Show]:
    """A progress bar while the block runs, below that of the work it is part of, if that has one:
    on stderr if that is a terminal, in the output of a notebook's cell if there is one, else none.

    Parameters
    ----------
    what : str
        Text beside the bar.
    patience : float
        Seconds before which there is no bar; then it appears with the next call.
    """
    place = _place()
    # Every motion passes here: where no bar can appear, nothing is set up for one.
    return nullcontext(_ignore) if place is None else _watched(what, place, patience)


def reporting(
    listener: _Listener | None, what: str, *, patience: float = PATIENCE
) -> AbstractContextManager[_Listener | Show]:
    """The receiver of the completed fraction: the caller's function, or a progress bar."""
    return watched(what, patience=patience) if listener is None else nullcontext(listener)


def _ignore(fraction: float | None, text: str = "") -> None:
    """Show nothing."""


@contextmanager
def _watched(what: str, place: _Place, patience: float) -> Iterator[Show]:
    began = time.monotonic()
    with ExitStack() as stack:
        bar: Show | None = None

        def show(fraction: float | None, text: str = "") -> None:
            nonlocal bar
            if bar is None and time.monotonic() - began >= patience:
                bar = stack.enter_context(place(what))
            if bar is not None:
                bar(fraction, text)

        if patience == 0.0:
            bar = stack.enter_context(place(what))
        yield show


def _place() -> _Place | None:
    """Output of progress bars; those of other threads and processes are not shown."""
    if threading.current_thread() is not threading.main_thread():
        return None
    if multiprocessing.parent_process() is not None:
        return None
    if in_notebook():
        return _in_cell
    return _on_terminal if sys.stderr.isatty() else None


# -- terminals -------------------------------------------------------------------------------------


@contextmanager
def _on_terminal(what: str) -> Iterator[Show]:
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


# -- notebooks -------------------------------------------------------------------------------------


def in_notebook() -> bool:
    """Whether a kernel runs this. IPython is looked for, and not imported."""
    ipython = sys.modules.get("IPython")
    running = getattr(ipython, "get_ipython", None)
    return running is not None and getattr(running(), "kernel", None) is not None


class _Page:
    """Bars in the output of a cell, one below the other, that are drawn anew in place.

    Nothing is shown of what is done at once, and nothing is left of what is done.
    """

    def __init__(self) -> None:
        self.lines: list[dict[str, Any]] = []
        self.due = time.monotonic() + PATIENCE
        self.handle: Any = None

    def draw(self) -> None:
        """Draw the bars, if an update is due."""
        now = time.monotonic()
        if now < self.due:
            return
        self.due = now + _EVERY
        bars = [_bar(now=now, **line) for line in self.lines]
        self.publish("".join(html for html, _ in bars), "; ".join(text for _, text in bars))

    def publish(self, html: str, text: str) -> None:
        """Put this where the bars are."""
        from IPython.display import display

        content = {"text/html": html, "text/plain": text}
        if self.handle is None:
            self.handle = display(content, raw=True, display_id=True)
        else:
            self.handle.update(content, raw=True)

    def clear(self) -> None:
        """Erase the bars."""
        if self.handle is not None:
            self.publish("", "")


@contextmanager
def _in_cell(what: str) -> Iterator[Show]:
    global _page
    outermost = _page is None
    page = _page = _Page() if _page is None else _page
    line: dict[str, Any] = {"what": what, "fraction": None, "text": "", "began": time.monotonic()}
    page.lines.append(line)

    def show(fraction: float | None, text: str = "") -> None:
        line.update(fraction=fraction, text=text)
        page.draw()

    try:
        yield show
    finally:
        page.lines.remove(line)
        if outermost:
            _page = None
            page.clear()


def _bar(what: str, fraction: float | None, text: str, began: float, now: float) -> tuple[str, str]:
    """A progress bar, as HTML and as text."""
    seconds = f"{now - began:.0f} s"
    share = "" if fraction is None else f"{100.0 * fraction:.0f} %"
    said = ", ".join(part for part in (share, text, seconds) if part)
    value = "" if fraction is None else f' value="{fraction:.4f}" max="1"'
    return (
        f"<div>{escape(what)} <progress{value}></progress> {escape(said)}</div>",
        f"{what}: {said}",
    )
