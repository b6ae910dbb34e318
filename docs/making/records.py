"""Pages that are kept elsewhere in the repository: benchmarks, changelog, contributing."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
_RESULTS = ROOT / "benchmarks" / "results"
_ORDER = (
    "start motion orbits time_stepping sweep maps samples chains evolution averages dense_steps "
    "versions"
).split()
_HEAD = """# Benchmarks

What was measured, the losses included; each table comes from a script in the folder `benchmarks` of the repository, which
writes it. *Times stickslip* above 1 means that the other tool is slower, below 1 that it is faster. The machine stands
above each table; it was shared and noisy, so that a few per cent mean nothing.

What random systems found, judged by programs that share no code with the library, is on a page of its own: [Truth](truth.md).
Beside which other tools fail, and how: [Where other tools go wrong](wrong.md).
"""


def pages() -> dict[str, str]:
    """Benchmarks, truth, changelog, contributing."""
    parts = [_HEAD]
    found = [*_ORDER, *sorted(p.stem for p in _RESULTS.glob("*.md") if p.stem not in (*_ORDER, "truth", "wrong"))]
    for name in found:
        path = _RESULTS / f"{name}.md"
        if path.exists():
            parts.append(_deeper(path.read_text(encoding="utf-8")))
    text = "\n".join(parts).replace("](chains.png)", "](../benchmarks/results/chains.png)")
    return {
        "generated/benchmarks.md": text.replace("](../benchmarks", "](../../benchmarks").replace("](truth.md)", "](truth.md)").replace("](wrong.md)", "](../wrong.md)"),
        "generated/truth.md": _read("benchmarks/results/truth.md"),
        "generated/changelog.md": _read("CHANGELOG.md"),
        "generated/contributing.md": _read("CONTRIBUTING.md").replace("](docs/", "](../"),
    }


def _read(place: str) -> str:
    return (ROOT / place).read_text(encoding="utf-8")


def _deeper(text: str) -> str:
    """The same with headings one level lower."""
    return re.sub(r"^(#+ )", r"#\1", text, flags=re.MULTILINE)
