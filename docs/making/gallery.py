"""The systems of the catalogue: a page and a picture each."""

from __future__ import annotations

import hashlib
import inspect
import re
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from matplotlib import image

import stickslip as ss
from making import docstrings, examples, markdown, offline_pages
from stickslip.display.system_page import system_page

ROOT = Path(__file__).parents[2]
_SECONDS = 240  # for a picture, on a machine that is busy
_THUMBNAIL = 90  # dots per inch


def systems() -> list[str]:
    """All names."""
    return ss.catalogue.names()


def pages() -> dict[str, str]:
    """The page of each system, and the overview."""
    cards = "\n".join(card(name, ss.catalogue.get(name).title, name) for name in systems())
    overview = markdown.filled(
        "gallery",
        cards=cards,
        examples=examples.cards(),
        sliders=offline_pages.cards(),
        toctree=markdown.toctree([*systems(), *(f"examples/{name}" for name in examples.found())]),
    )
    made = {f"gallery/{name}.md": _page(name) for name in systems()}
    return made | examples.pages() | {"gallery/index.md": overview}


def card(page: str, title: str, under: str, *, drawn: bool = True) -> str:
    """What the overview shows of a page.

    Parameters
    ----------
    drawn : bool
        Whether it has a picture.
    """
    picture = page.replace("examples/", "example-")
    shown = [f":img-top: pictures/{picture}-small.png", f":img-alt: {title}"]
    lines = [
        f":::{{grid-item-card}} {title}",
        f":link: {page}",
        ":link-type: doc",
        *(shown if drawn else []),
        "",
        f"`{under}`",
        ":::",
    ]
    return "\n".join(lines) + "\n"


def _page(name: str) -> str:
    system = ss.catalogue.get(name)
    about = inspect.getdoc(getattr(ss.catalogue, name)) or ""
    parts = docstrings.sections(getattr(ss.catalogue, name))
    lines = [
        f"# {system.title}\n",
        docstrings.markup(parts[""].strip()) + "\n",
        f"![The motion of {system.title}](pictures/{name}.png)\n",
        markdown.block("text", f"stickslip run {name}\nstickslip explore {name}"),
        markdown.block("python", f"ss.simulate(ss.catalogue.{name}()).plot()"),
    ]
    if "References" in parts:
        known = docstrings.markup(parts["References"].strip())
        lines += ["## Sources and known results\n", known + "\n"]
    lines += ["## Equations\n", markdown.html(system_page(system))]
    lines += [checked(re.compile(rf"catalogue\.{name}\b|get\(\"{name}\"\)|\"{name}\""))]
    lines += [
        "## Model file\n",
        f"`stickslip show {name} --toml` prints it; use it as a starting point for your own.\n",
        markdown.block("toml", system.to_toml()),
    ]
    assert about, name
    return "\n".join(lines)


@cache
def _sources() -> dict[str, str]:
    return {
        path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
        for folder in ("tests", "src/stickslip_paper")
        for path in sorted((ROOT / folder).rglob("*.py"))
    }


def checked(used: re.Pattern[str]) -> str:
    """A section on the tests in which something occurs, if there are any."""
    lines = [f"* `{place}`: {said}" for place, said in _tests(used)]
    return "\n".join(["## Tests\n", *lines, ""]) if lines else ""


def _tests(used: re.Pattern[str]) -> Iterator[tuple[str, str]]:
    """These tests, references first, with what they say of themselves."""
    places = [place for place, text in _sources().items() if used.search(text)]
    for place in sorted(places, key=lambda place: "references" not in place)[:6]:
        said = re.match(r'\s*"""(.*?)"""', _sources()[place], re.DOTALL)
        first = " ".join((said[1] if said else "").split("\n\n")[0].split())
        yield place, docstrings.markup(first).replace("|", r"\|").replace("$", r"\$")


# -- pictures --------------------------------------------------------------------------------------


def pictures(folder: Path) -> None:
    """The motion of each system over its declared span, drawn again where something changed."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in systems():
        system = ss.catalogue.get(name)
        mark = folder / f"{name}.made-of"
        now = _digest(system)
        if mark.exists() and mark.read_text(encoding="utf-8") == now:
            continue
        with _in_time(name):
            motion = ss.simulate(system)
            motion.plot().savefig(folder / f"{name}.png", dpi=110)
        thumbnail(motion).savefig(folder / f"{name}-small.png", dpi=_THUMBNAIL)
        mark.write_text(now, encoding="utf-8")


def thumbnail(motion: ss.Trajectory) -> Any:
    """A small picture: the path in a plane, or the first quantity over the time."""
    small = ss.style.new_figure(4.0, 2.6)
    axes = small.add_subplot()
    try:
        ss.figures.path_in_plane(axes, motion)
    except ss.DeclarationError:  # nothing in a plane, or in one that turns with a body
        system = motion.system
        motion.plot(next(iter([*system.places, *system.internal])), ax=axes)
    return small


def shrink(picture: Path, place: Path) -> None:
    """A thumbnail as broad as those of the systems."""
    broad = image.imread(picture).shape[1]
    image.thumbnail(str(picture), str(place), scale=4.0 * _THUMBNAIL / broad)


def _digest(system: Any) -> str:
    return hashlib.sha256((system.to_toml() + code()).encode()).hexdigest()


@cache
def code() -> str:
    """The parts of the library that a picture depends on."""
    rooms = ("motion", "figures", "equations", "symbolic", "model")
    paths = (p for room in rooms for p in sorted((ROOT / "src/stickslip" / room).rglob("*.py")))
    whole = b"".join(path.read_bytes() for path in [Path(__file__), *paths])
    return hashlib.sha256(whole).hexdigest()


@contextmanager
def _in_time(name: str, seconds: int = _SECONDS) -> Iterator[None]:
    """An error if it takes longer than a picture may, where there are alarms."""

    def late(*_: Any) -> None:
        raise TimeoutError(f"the picture of {name} takes more than {seconds} s")

    alarm: Callable[[int], Any] | None = getattr(signal, "alarm", None)
    if alarm is None:
        yield
        return
    before = signal.signal(signal.SIGALRM, late)
    alarm(seconds)
    try:
        yield
    finally:
        alarm(0)
        signal.signal(signal.SIGALRM, before)
