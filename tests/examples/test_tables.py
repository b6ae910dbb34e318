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
    steady, cycles = brake.branches()
    assert cycles.certificate.ok, cycles.certificate.describe()
    curve = brake.boundary(steady)
    assert curve.certificate.ok
    slopes = [brake.brake.evaluate(f"d_mu({V!r})") for V in curve.points["V"].values.tolist()]
    np.testing.assert_allclose(curve.points["N"], -0.6 / np.array(slopes), rtol=1e-9)
    swept = brake.speeded_up(speeds=30, forces=3)
    assert swept.certificate.ok
    vibrates = swept["amplitude:x"].values > 1e-6
    speeds, forces = swept["V"].values, swept["N"].values
    stable = forces * [[brake.brake.evaluate(f"d_mu({V!r})")] for V in speeds.tolist()] + 0.6 > 0
    assert vibrates[~stable].all() and not vibrates[-1].any()
    assert (vibrates & stable).any()  # steady sliding and a cycle beside each other
    (onset,) = cycles.of_kind("stick onset")
    last = np.interp(20.0, forces, [speeds[row].max() for row in vibrates.T])
    # It falls off the branch at the latest where that ends, with larger steps earlier.
    assert onset.value - 0.2 < last < onset.value
    fitted = brake.law()
    assert fitted.certificate.ok
    at = np.array([0.1, 1.0, 3.0])
    np.testing.assert_allclose(fitted.at(at), brake.brake.tables["mu"](at), atol=0.01)
    figure = brake.picture(swept, curve, steady, cycles, fitted, speeds=(0.4,))
    assert figure.axes[1].get_ylabel() == "force on the pad  [N]"
