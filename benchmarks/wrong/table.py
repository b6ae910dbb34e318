"""What all these scripts share: a table with the versions that it was made with."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterable, Sequence
from importlib.metadata import PackageNotFoundError, version
from time import perf_counter
from typing import TypeVar

_T = TypeVar("_T")


def versions(*packages: str) -> str:
    """Versions of Python and of packages, in a line."""
    found = [f"Python {platform.python_version()}"]
    for package in ("stickslip", *packages):
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            found.append(f"{package} is not installed")
    return ", ".join(found)


def table(headings: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table of Markdown."""
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join("| " + " | ".join(map(str, row)) + " |" for row in lines)


def timed(work: Callable[[], _T]) -> tuple[_T, float]:
    """What it returns, and the seconds of the second call: the first may compile."""
    work()
    began = perf_counter()
    result = work()
    return result, perf_counter() - began
