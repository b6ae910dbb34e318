"""Maps of motions under drives that are known for a time only: measured is that over the span."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import DeclarationError

PULSE = ss.Samples([0.0, 1.0, 2.0, 10.0], [0.0, 3.0, 0.0, 0.0], kind="hold")


def block(drive: ss.Samples = PULSE, **given: Any) -> ss.System:
    """On a base that is shaken once (Newmark 1965)."""
    return ss.System(
        "newmark",
        parameters={"mu": ss.Parameter(0.1)},
        drives={"a": drive},
        coordinates={"x": ss.Inertial(force="-a", unit="m")},
        kinetic="d_x**2/2",
        contacts={"ground": ss.Contact("d_x", "10*mu")},
        **{"span": (0.0, 10.0), "time_unit": "s", **given},
    )


def slid(motion: ss.Trajectory) -> float:
    """Where it comes to."""
    return motion.final["x"]


def test_the_slip_of_a_block_under_one_pulse() -> None:
    """A pulse of the acceleration A and the duration T moves it by (A − μg)T²A/(2μg) in all
    (Newmark 1965, equation 4)."""
    mu = np.array([0.12, 0.2, 0.29, 0.31])
    found = ss.sweep(block(), {"mu": mu}, ["shift:x", "low:x", slid, "peak_force", "q = shift"])
    held = 10.0 * mu
    expected = np.where(held < 3.0, (3.0 - held) * 3.0 / (2.0 * held), 0.0)
    for name in ("shift:x", "low:x", "slid", "q"):
        np.testing.assert_allclose(found[name].values, -expected, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(found["peak_force"].values, np.minimum(held, 3.0), rtol=1e-10)
    assert found.certificate.ok and found.outcome.ok
    codes = {ss.Outcome.from_code(int(code)) for code in found["outcome"].values}
    assert codes <= {ss.Outcome.FINISHED, ss.Outcome.AT_REST}


def test_what_belongs_to_a_cycle_is_refused() -> None:
    over = {"mu": [0.1, 0.2]}
    for measure in ("period", "harmonic", "energy_per_distance:x", "c = energy_per_cycle"):
        with pytest.raises(DeclarationError, match="end, so no motion settles"):
            ss.sweep(block(), over, [measure])
    with pytest.raises(DeclarationError, match="end, so no motion settles"):
        ss.sweep(block(), over, ["shift"], carry="mu")
    with pytest.raises(DeclarationError, match="so no motion settles"):
        ss.basin(block(), {"x": "0:1:3", "d_x": "0:1:3"})
    with pytest.raises(DeclarationError, match=r"the samples cover 0 \.\.\. 10"):
        ss.sweep(block(span=(0.0, 20.0)), over, ["shift"])


def test_periodic_samples_settle() -> None:
    """Nothing of this holds for samples that repeat."""
    wave = ss.Samples([0.0, 0.5, 1.5, 2.0], [0.0, 3.0, -3.0, 0.0], periodic=True)
    found = ss.sweep(block(wave), {"mu": [0.2]}, ["period"])
    assert found["period"].values[0] == pytest.approx(2.0, rel=1e-12)
