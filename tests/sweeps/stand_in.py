"""In the place of the compiled chunk: measures in closed form, so that a test can tell every point
of a map."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pytest

from stickslip.arrays import Array
from stickslip.model.system import System
from stickslip.orbits.settling import motions
from stickslip.stopping.scopes import check_stop

calls: list[int] = []
"""Number of points of each call."""


@dataclass(frozen=True)
class Settings(motions.Settings):
    pause: float = 0.0


def measure_chunk(
    system: System,
    initial: Mapping[str, Array],
    parameters: Mapping[str, Array],
    measures: Sequence[str],
    settings: motions.Settings,
    device: str = "cpu",
    section: bool = False,
    start: float | None = None,
    time_limit: float | None = None,
) -> dict[str, Array]:
    """Rocking toys that walk outside a circle around (P, δ) = (1, 0.1)."""
    given = {**initial, **parameters}
    calls.append(len(next(iter(given.values()))))
    time.sleep(getattr(settings, "pause", 0.0))
    check_stop()
    return closed_form(system, given, measures)


def closed_form(
    system: System, given: Mapping[str, Array], measures: Sequence[str]
) -> dict[str, Array]:
    """What :func:`measure_chunk` measures."""
    count = len(next(iter(given.values())))
    at = {
        name: np.broadcast_to(value, count)
        for name, value in {**system.values, "psi": 0.8, **given}.items()
    }
    P = at["P"]
    delta = at["delta"]
    psi = at["psi"]
    walks = (P - 1.0) ** 2 + (5.0 * (delta - 0.1)) ** 2 > 0.09
    closed = {
        "speed": np.where(walks, np.sin(3.0 * P) + psi * delta, 0.0),
        "period": np.where(walks, 2.0 * np.pi * np.sqrt(P), np.nan),
        "energy_per_cycle": np.exp(delta) * P,
    }
    found = {name: closed[name] for name in measures}
    return {
        **found,
        "outcome": np.where(walks, 0, 1).astype(np.int8),
        "certificate": np.where(delta > 0.15, 1.0, 1e-12),
        "lacking": np.where(delta > 0.15, 4, 0).astype(np.int8),
        "excess": np.zeros(count),
    }


def put_in_place(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let maps be computed by this module."""
    monkeypatch.setitem(sys.modules, "stickslip.sweeps.work.chunk", sys.modules[__name__])
    calls.clear()
