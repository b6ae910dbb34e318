"""The benchmark problem with dry friction of ``docs/theory/benchmark-problem.md``: the table of its
reference solution, and the motion of the catalogue, against series in thirty digits."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from oracles.cart_pendulum import Motion, follow

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "benchmarks" / "results" / "cart_pendulum.md"
PAGE = ROOT / "docs" / "theory" / "benchmark-problem.md"
NAMES = ("x", "d_x", "phi", "d_phi")


@pytest.fixture(scope="module")
def exact() -> Motion:
    return follow("2.5", [str(t) for t in range(1, 11)])


def printed(path: Path) -> dict[int, list[float]]:
    """The states of a table, by their times."""
    rows = re.findall(r"^\| (\d+) \|((?: -?\d+\.\d{12} \|){4})$", path.read_text("utf-8"), re.M)
    return {int(t): [float(x) for x in numbers.split("|")[:-1]] for t, numbers in rows}


@pytest.mark.parametrize("path", [RESULTS, PAGE], ids=lambda path: path.parts[-3])
def test_the_table_is_right_to_its_last_digit(path: Path, exact: Motion) -> None:
    table = printed(path)
    assert sorted(table) == list(range(1, 11))
    for t, state in zip(range(1, 11), exact.states, strict=True):
        assert max(abs(a - float(b)) for a, b in zip(table[t], state, strict=True)) < 0.6e-12


def test_the_motion_of_the_catalogue(exact: Motion) -> None:
    motion = ss.simulate(ss.catalogue.cart_pendulum(), (0.0, 10.0), rtol=1e-13)
    assert motion.certificate.ok
    assert len(motion.events) == len(exact.switches) == 20
    switches = [float(t) for t in exact.switches]
    assert np.max(np.abs(motion.events["time"] - switches)) < 1e-13
    states = motion.at(np.arange(1.0, 11.0))
    found = np.column_stack([states[name] for name in NAMES])
    assert np.max(np.abs(found - np.array(exact.states, float))) < 1e-12
