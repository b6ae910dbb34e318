"""Pages kept elsewhere in the repository: benchmarks, changelog, contributing, security."""

from __future__ import annotations

import re
from pathlib import Path

from making import markdown

ROOT = Path(__file__).parents[2]
_RESULTS = ROOT / "benchmarks" / "results"
_ORDER = (
    "start installed motion orbits harmonic_balance time_stepping sweep maps samples chains "
    "evolution averages dense_steps versions"
).split()
_APART = ("truth", "wrong", "holding", "cart_pendulum")  # on pages of their own


def pages() -> dict[str, str]:
    """Benchmarks, truth, what goes wrong elsewhere, changelog, contributing, security."""
    others = sorted(p.stem for p in _RESULTS.glob("*.md") if p.stem not in (*_ORDER, *_APART))
    places = [_RESULTS / f"{name}.md" for name in (*_ORDER, *others)]
    tables = "\n".join(_deeper(p.read_text(encoding="utf-8")) for p in places if p.exists())
    tables = re.sub(r"\]\((\w+\.png)\)", r"](../../benchmarks/results/\1)", tables)
    tables = re.sub(r"\[([^\]]+)\]\(\w+\.md\)", r"\1", tables)  # these are on the same page
    return {
        "wrong.md": markdown.filled("wrong", **_sections("benchmarks/results/wrong.md")),
        "generated/benchmarks.md": markdown.filled("benchmarks", tables=tables),
        "generated/truth.md": _read("benchmarks/results/truth.md"),
        "generated/changelog.md": _read("CHANGELOG.md"),
        "generated/contributing.md": _on_the_site("CONTRIBUTING.md"),
        "generated/security.md": _on_the_site("SECURITY.md"),
    }


def _read(place: str) -> str:
    return (ROOT / place).read_text(encoding="utf-8")


def _on_the_site(place: str) -> str:
    """A page of the repository. Links to pages of the site lead there; names of other files are
    text."""
    text = _read(place).replace("](docs/", "](../").replace("](SECURITY.md)", "](security.md)")
    return re.sub(r"\[([^\]]+)\]\((?!\.\./|[a-z]+:|security)[^)]+\)", r"\1", text)


def _sections(place: str) -> dict[str, str]:
    """The parts of a page by their headings."""
    parts = re.split(r"^## (\w+)\n", _read(place), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def _deeper(text: str) -> str:
    """The same with headings one level lower."""
    return re.sub(r"^(#+ )", r"#\1", text, flags=re.MULTILINE)
