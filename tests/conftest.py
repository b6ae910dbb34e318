"""Fixtures that several folders share."""

from __future__ import annotations

import gc
import os
import signal
from inspect import unwrap
from pathlib import Path

import pytest

# Before the library is imported, here and in processes that tests start: each test compiles its
# systems, and few of them move for long. `machine_code/test_quick_compile.py` compares the bits.
os.environ.setdefault("STICKSLIP_QUICK_COMPILE", "1")

from stickslip import simulate

gc.disable()  # until all tests are collected

# What a shell starts in the background ignores Ctrl-C, and so does all that it starts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


# Marks of the tests in a folder, so that they can be run, or left out, by themselves.
MARKS = {
    "adversarial": "adversary",
    "attack": "attack",
    "explorer": "explorer",
    "stickslip_paper": "paper",
}


def mark_of(path: Path) -> str:
    """The mark of a test file; empty if its folder has none."""
    here = Path(__file__).parent
    folder = path.relative_to(here).parts[0] if path.is_relative_to(here) else ""
    return MARKS.get(folder, "")


# The files that take longest come first, so that two processes end together.
LONGEST = ("test_documentation.py", "test_page.py", "test_stopping.py", "test_connections.py")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark tests by their folders, and begin with the longest files."""
    for item in items:
        mark = mark_of(item.path)
        if mark:
            item.add_marker(mark)
    items.sort(key=lambda item: item.path.name not in LONGEST)


@pytest.fixture(params=["closed forms", "Taylor steps"])
def flow(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Which flow `simulate` takes where none is asked for: closed forms where modes are affine, or
    Taylor steps everywhere."""
    chosen = "auto" if request.param == "closed forms" else "taylor"
    defaults = unwrap(simulate).__kwdefaults__
    assert defaults is not None
    monkeypatch.setitem(defaults, "flow", chosen)
    return request.param


def pytest_collection_finish() -> None:
    """Collect garbage less often: modules and tests stay, and most objects are not cyclic."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)
    gc.enable()
