"""An explorer in a process of its own, as the command starts it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from attack.victim import Victim


@pytest.fixture(scope="session")
def victim() -> Iterator[Victim]:
    """One server for all attacks: who comes later finds what the others have left of it."""
    running = Victim()
    yield running
    assert running.end() in (0, -15, 1), "the server had ended before"
