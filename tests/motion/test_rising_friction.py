"""Sliding forces that rise with speed, beyond the threshold, too."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest
from scipy.optimize import brentq

import stickslip as ss


def braked(kinetic: str, **initial: float) -> ss.Trajectory:
    """A mass on a spring and on the ground, whose threshold is 1."""
    system = ss.System(
        name="braked",
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="x**2/2",
        contacts={"ground": ss.Contact("d_x", 1.0, kinetic=kinetic)},
        span=(0.0, 10.0),
    )
    return ss.simulate(system, initial=initial)


def test_viscous_sliding() -> None:
    """k = 0.8 + 0.6 |v| is three times the threshold at first, and right: until it stops the mass
    is a damped oscillator about x = −0.8, with closed form."""
    motion = braked("0.8 + 0.6*speed", d_x=4.0)
    assert motion.certificate.ok and motion.outcome.ok
    w = np.sqrt(1.0 - 0.3**2)
    a, b = 0.8, (4.0 + 0.3 * 0.8) / w

    def x(t: float) -> float:
        return float(np.exp(-0.3 * t) * (a * np.cos(w * t) + b * np.sin(w * t)) - 0.8)

    def v(t: float) -> float:
        wave = (b * w - 0.3 * a) * np.cos(w * t) - (a * w + 0.3 * b) * np.sin(w * t)
        return float(np.exp(-0.3 * t) * wave)

    stop = cast(float, brentq(v, 0.5, 2.5, xtol=1e-15))
    first = motion.events.iloc[0]
    assert first["time"] == pytest.approx(stop, rel=1e-13)
    assert first["x"] == pytest.approx(x(stop), rel=1e-13)


def test_what_has_to_hold() -> None:
    """At rest the sliding force is at most the threshold, and never negative."""
    with pytest.raises(ss.DeclarationError, match="not between 0 and the threshold"):
        braked("1.1 - 0.6*speed")
    fading = braked("1 - speed/2", d_x=4.0)
    assert not fading.outcome.ok and "negative" in fading.outcome.message
