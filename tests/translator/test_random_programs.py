"""Random functions of the language: the short run."""

from __future__ import annotations

from pathlib import Path

import pytest

from .random_programs import FEW, tried


@pytest.mark.parametrize("first", range(0, 75, FEW))
def test_random_programs(first: int, tmp_path: Path) -> None:
    agreed, wrong = tried(range(first, first + FEW), 1, tmp_path)
    assert not wrong[:2]
    assert agreed > 5 * FEW
