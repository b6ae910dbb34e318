"""What belongs to a system goes with it: equations, machine code, samples."""

from __future__ import annotations

import gc
import sys
import weakref
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.machine_code import objects
from stickslip.symbolic.functions import FUNCTIONS

SAMPLES = 20_000  # of each system


def shaken(seed: int) -> ss.System:
    """A block on a base that is shaken as no other."""
    rng = np.random.default_rng(seed)
    base = ss.Samples(np.linspace(0.0, 100.0, SAMPLES), rng.normal(size=SAMPLES))
    return ss.System(
        "shaken",
        drives={"a": base},
        coordinates={"x": ss.Inertial(force=f"-a + {0.1 * rng.random()!r}")},
        kinetic="d_x**2/2",
        potential="x**2/2",
        contacts={"base": ss.Contact("d_x", 0.5)},
        span=(0.0, 1.0),
    )


def resident() -> float:
    """Bytes of this process that are in memory."""
    pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[1]
    return int(pages) * 4096.0


def plain(seed: int) -> ss.System:
    """A block on a belt, declared anew."""
    return ss.catalogue.belt_block(k=1.0 + 0.01 * seed)


@pytest.mark.parametrize(("declare", "count"), [(plain, 160), (shaken, 40)])
def test_systems_that_are_gone_take_no_memory(
    declare: Callable[[int], ss.System], count: int
) -> None:
    """They are declared, moved and dropped; nothing remains of them but what a few recent ones
    leave."""
    alive: list[weakref.ref[object]] = []
    sizes = []
    rows = set(FUNCTIONS)
    for i in range(count):
        system = declare(i)
        motion = ss.simulate(system, (0.0, 1.0))
        assert motion.certificate.ok
        if i % 20 == 0:
            motion.sensitivity(["x"], [0.5])
        if i % 40 == 0 and declare is plain:
            assert ss.find_cycle(system).certificate.ok
            assert len(ss.sweep(system, {"V": [0.1, 0.2]}, ["period"]).dataset["outcome"]) == 2
        compiled = motion.problem.compiled
        alive += map(weakref.ref, (system.declaration, compiled.equations))
        if declare is shaken:
            alive.append(weakref.ref(compiled.jets.code))
        del system, motion, compiled
        if i in (count // 2, count - 1):
            gc.collect()
            sizes.append(resident() if sys.platform == "linux" else 0.0)
    assert sum(r() is not None for r in alive) == 0
    assert set(FUNCTIONS) <= rows  # those of earlier tests may have gone, too
    # their samples alone are three times as much
    assert sizes[1] - sizes[0] < 0.3 * count / 2 * SAMPLES * 8 * 8


def test_the_code_of_systems_is_freed() -> None:
    """The few that are remembered are those of the last systems."""
    gc.collect()
    before = len(objects._kept)
    for c in np.linspace(1.0, 2.0, 40).tolist():
        system = ss.System(
            "oscillator",
            coordinates={"x": ss.Inertial()},
            kinetic="d_x**2/2",
            potential=f"{c!r}*x**2/2",
            contacts={"ground": ss.Contact("d_x", 0.1)},
            initial={"x": 1.0},
            span=(0.0, 5.0),
        )
        assert ss.simulate(system).certificate.ok
        del system
    gc.collect()
    assert objects._recent.maxlen == 32
    assert len(objects._kept) <= before + 32


def test_samples_that_come_again() -> None:
    """The same samples after they were gone are found at their new place, by motions and by
    formulas that are remembered."""
    found = []
    for _ in range(3):
        motion = ss.simulate(shaken(3))
        slopes = motion.sensitivity(["x"], [0.7])
        found.append((motion.final["x"], float(slopes["x"][0, 0])))
        del motion, slopes
        gc.collect()
        ss.simulate(shaken(4))  # where those were
    assert found[0] == found[1] == found[2]


def test_tables_that_come_again_and_are_gone() -> None:
    """As samples; their rows are in the table of functions as long as they are."""

    def spring(scale: float) -> ss.System:
        return ss.System(
            "spring",
            coordinates={"x": ss.Inertial()},
            kinetic="d_x**2/2",
            potential="integral_F(x)",
            initial={"x": 0.7},
            tables={"F": ss.Table([-1.0, 0.1, 1.0], [-scale, 0.2, scale])},
            span=(0.0, 3.0),
        )

    found = []
    for _ in range(3):
        found.append(ss.simulate(spring(1.0)).final["x"])
        gc.collect()
        ss.simulate(spring(2.0))
    assert found[0] == found[1] == found[2]
    gc.collect()
    digests = [spring(scale).tables["F"].digest for scale in (1.0, 2.0)]
    gc.collect()
    assert not [name for name in FUNCTIONS if any(digest in name for digest in digests)]


def test_equal_samples_share_what_is_made_of_them() -> None:
    one, other = (ss.Samples([0.0, 1.0, 2.0], [0.0, 1.5, 0.5]) for _ in range(2))
    assert one.pieces is other.pieces
    system = ss.System(
        "free",
        drives={"a": other},
        coordinates={"x": ss.Viscous(force="a")},
        viscous="d_x**2/2",
        span=(0.0, 2.0),
    )
    del one, other
    gc.collect()
    motion = ss.simulate(system)
    assert motion.final["x"] == pytest.approx(0.75 + 1.0, rel=1e-12)
