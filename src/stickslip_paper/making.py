"""Make the figures, the animations and the checks of the paper, in two processes."""

from __future__ import annotations

import inspect
import re
import signal
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from textwrap import shorten

import stickslip as ss
from stickslip_paper import claims
from stickslip_paper.sections.claim import Claim, Finding

_WORKERS = 2
_FORMATS = ("svg", "pdf", "png")
LINES = 150  # a module up to this length is shown as a whole


@dataclass(frozen=True)
class Item:
    """An item to create: a figure or an animation by its key, a claim by its name."""

    kind: str
    key: str


@dataclass(frozen=True)
class Made:
    """Result of an item.

    Attributes
    ----------
    finding : Finding or None
        Finding of a claim.
    files : tuple of str
        Relative to the folder.
    error : str
        Reason why a figure could not be created.
    """

    item: Item
    seconds: float
    finding: Finding | None = None
    files: tuple[str, ...] = ()
    error: str = ""

    def good(self, claim: Claim | None) -> bool:
        """Return whether the result is as expected."""
        if self.finding is None or claim is None:
            return not self.error
        return self.finding.verdict is claim.expected


@dataclass
class Work:
    """Requested items and their results."""

    items: list[Item]
    done: dict[Item, Made] = field(default_factory=dict)
    interrupted: bool = False


def items(only: str | None = None) -> list[Item]:
    """Items to create, slow ones first.

    Parameters
    ----------
    only : str, optional
        A figure's key, or a place of claims: ``"4.4"``, ``"(3.6)"``, ``"speed"``.

    Raises
    ------
    ss.DeclarationError
        If nothing has that key.
    """
    from stickslip_paper.figures import FIGURES
    from stickslip_paper.moving.animations import ANIMATIONS

    everything = [(Item("animation", key), key) for key in ANIMATIONS]
    everything += [(Item("figure", key), key) for key in FIGURES]
    everything += [(Item("claim", claim.name), claim.place) for claim in claims()]
    if only is None:
        return [item for item, _ in everything]
    wanted = only.strip("() ")
    found = [
        item
        for item, place in everything
        if wanted in (place, item.key, _number(place), _number(place).rstrip("abc"))
    ]
    if not found:
        known = dict.fromkeys(_number(place) for _, place in everything)
        raise ss.DeclarationError(
            "--only",
            f"there is no '{shorten(only, 60)}'",
            f"Known: {', '.join(sorted(known))}",
        )
    return found


def _number(place: str) -> str:
    """The number in a place: 3.6 of (3.6), 3.1 of theorem 3.1; the place itself if it has none."""
    found = re.search(r"\d+(\.\d+)?[a-c]?", place)
    return found.group() if found else place


def make_all(work: Work, folder: Path, progress: Callable[[float, Item], None]) -> None:
    """Create all items; Ctrl-C keeps completed ones.

    Parameters
    ----------
    work : Work
        Its ``done`` is filled.
    folder : Path
        Folder of the figures.
    progress : callable
        Called with the fraction done and what was done last.
    """
    with ProcessPoolExecutor(_WORKERS, get_context("spawn"), _quiet) as pool:
        futures = {pool.submit(make, item, folder): item for item in work.items}
        try:
            for future in as_completed(futures):
                work.done[futures[future]] = future.result()
                progress(len(work.done) / len(futures), futures[future])
        except KeyboardInterrupt:
            work.interrupted = True
            pool.shutdown(wait=False, cancel_futures=True)
            work.done.update((made.item, made) for made in _finished(futures))


def _quiet() -> None:
    """Let Ctrl-C end a worker without a message."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def _finished(futures: dict[Future[Made], Item]) -> Iterator[Made]:
    for future in futures:
        if future.done() and not future.cancelled() and future.exception() is None:
            yield future.result()


def make(item: Item, folder: Path) -> Made:
    """Make one figure or animation, or check one claim."""
    began = time.perf_counter()
    if item.kind == "claim":
        finding = claim_named(item.key).verify()
        return Made(item, time.perf_counter() - began, finding)
    try:
        files = draw(item.key, folder) if item.kind == "figure" else animate(item.key, folder)
    except Exception as error:  # a failure of one figure does not affect the others
        return Made(item, time.perf_counter() - began, error=f"{type(error).__name__}: {error}")
    return Made(
        item, time.perf_counter() - began, files=tuple(str(f.relative_to(folder)) for f in files)
    )


def claim_named(name: str) -> Claim:
    """The claim of that name."""
    return next(claim for claim in claims() if claim.name == name)


def draw(key: str, folder: Path) -> list[Path]:
    """Draw a figure and save it in all formats."""
    from stickslip_paper.figures import FIGURES

    place = folder / "figures"
    place.mkdir(parents=True, exist_ok=True)
    figure = FIGURES[key].draw()
    files = [place / f"figure-{key}.{form}" for form in _FORMATS]
    with ss.style.paper_style():
        for file in files:
            figure.savefig(file)
    return files


def animate(key: str, folder: Path) -> list[Path]:
    """Make an animation."""
    from stickslip_paper.moving.animations import ANIMATIONS

    place = folder / "animations"
    place.mkdir(parents=True, exist_ok=True)
    return [Path(file) for file in ANIMATIONS[key].make(place)]


def source_of(function: Callable) -> str:
    """The source code of a figure: its module, if it is short, otherwise the function."""
    module = inspect.getmodule(function)
    whole = inspect.getsource(module) if module else ""
    return whole if 0 < whole.count("\n") <= LINES else inspect.getsource(function)
