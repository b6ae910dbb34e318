"""The brake whose friction was measured."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).parents[2] / "examples" / "brake"


def test_a_measured_brake() -> None:
    """Where damping does not outweigh the falling friction the pad vibrates; where friction rises
    it slides."""
    spec = importlib.util.spec_from_file_location("stability", FOLDER / "stability.py")
    assert spec is not None and spec.loader is not None
    brake = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(brake)
    assert brake.cycle.certificate.ok and brake.cycle.stable
    assert brake.swept["certificate"].values.max() <= 1.0
    vibrates = brake.amplitude > 1e-6
    assert vibrates[~brake.steady].all() and not vibrates[-1].any()
    # Steady sliding and a cycle beside each other
    assert (vibrates & brake.steady).any()
    assert brake.found.certificate.ok
    at = np.array([0.1, 1.0, 3.0])
    np.testing.assert_allclose(brake.found.at(at), brake.points(at), atol=0.01)
