"""Exported pages of the explorer: six systems with sliders, for readers who install nothing."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import stickslip as ss
from making import gallery

ROOT = Path(__file__).parents[2]
FOLDER = "gallery/pages"


@dataclass(frozen=True)
class OfflinePage:
    """A page over some parameters of a system of the catalogue."""

    system: str
    over: Mapping[str, str]
    about: str


PAGES = (
    OfflinePage(
        "belt_block",
        {"V": "0.1:1.3:13", "F_k": "0.3:0.9:7"},
        "From rest, a block ends in stick-slip on a slow belt, and never sticks on a fast one.",
    ),
    OfflinePage(
        "rocking_toy",
        {"P": "0.8:1.5:8", "delta": "0.02:0.1:5"},
        "A toy walks because rocking unloads its legs one after the other.",
    ),
    OfflinePage(
        "spring_slider",
        {"V": "0.06:0.6:10", "k": "0.5:3:6"},
        "A stiff spring, or a fast pull, turns stick-slip into steady sliding.",
    ),
    OfflinePage(
        "jenkins_oscillator",
        {"P": "0.25:2:8", "omega": "0.6:1.4:9"},
        "As the force grows, a dry damper slips, and the resonance moves to a lower frequency.",
    ),
    OfflinePage(
        "woodpecker",
        {"mu": "0.2:0.4:5", "e_1": "0.3:0.7:3"},
        "A toy slides down a pole, and jams and pecks on the way.",
    ),
    OfflinePage(
        "planar_jenkins",
        {"P": "0.2:2:7", "Q": "0:1.2:4"},
        "Forces along two directions drive a damper along a closed path in the plane.",
    ),
)


def cards() -> str:
    """The cards of all, for the overview."""
    lines: list[str] = []
    for page in PAGES:
        title = ss.catalogue.get(page.system).title
        lines += [
            f":::{{grid-item-card}} {title}",
            f":link: pages/{page.system}.html",
            ":link-type: url",
            f":img-top: pictures/{page.system}-small.png",
            f":img-alt: {title}",
            "",
            page.about,
            ":::",
        ]
    return "\n".join(lines) + "\n"


def write(built: Path) -> None:
    """Compute the pages that are new or have changed; they are copied to the site as they are.

    Parameters
    ----------
    built : Path
        The folder of what is built; the pages are in ``extra`` there.
    """
    folder, marks = built / "extra" / FOLDER, built / "extra-made-of"
    folder.mkdir(parents=True, exist_ok=True)
    marks.mkdir(parents=True, exist_ok=True)
    for page in PAGES:
        system = ss.catalogue.get(page.system)
        made_of = system.to_toml() + json.dumps(page.over) + gallery.code() + _code()
        now = hashlib.sha256(made_of.encode()).hexdigest()
        mark, path = marks / page.system, folder / f"{page.system}.html"
        if path.exists() and mark.exists() and mark.read_text(encoding="utf-8") == now:
            continue
        ss.export(system, path, over=page.over)
        mark.write_text(now, encoding="utf-8")


@cache
def _code() -> str:
    """The parts of the library that a page depends on, besides those of pictures."""
    rooms = ("explorer", "orbits")
    paths = [p for room in rooms for p in sorted((ROOT / "src/stickslip" / room).rglob("*.*"))]
    whole = b"".join(p.read_bytes() for p in paths if p.suffix in (".py", ".js", ".css", ".html"))
    return hashlib.sha256(whole).hexdigest()
