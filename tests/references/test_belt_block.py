"""Block on a belt with static above kinetic friction.

The textbook stick-slip cycle, e.g. V. L. Popov, *Contact Mechanics and Friction*, Springer 2010,
chapter 12: T = 2Δ/(kV) + (2/ω)(π − arctan(ωΔ/(kV))), F in F_k ± √(Δ² + kmV²), Δ = F_s − F_k.
"""

import math

import numpy as np
import pytest

from oracles import belt_block
from stickslip import catalogue, simulate
from systems import distance, switches

pytestmark = pytest.mark.usefixtures("flow")

PRINTED = {"m": 1.0, "k": 1.0, "V": 0.3, "F_s": 1.0, "F_k": 0.6}
CASES = [
    PRINTED,
    {"m": 2.0, "k": 3.0, "V": 0.4, "F_s": 1.5, "F_k": 0.9},
    {**PRINTED, "V": 0.01, "F_k": 0.05},
]


@pytest.mark.parametrize("values", CASES)
def test_cycle(values: dict[str, float]) -> None:
    period = belt_block.period(**values)
    motion = simulate(
        catalogue.belt_block(),
        (0.0, 20 * period),
        initial={"x": 0.0, "d_x": values["V"]},
        parameters=values,
    )
    assert motion.certificate.ok, motion.certificate.verdict
    table = switches(motion)
    slips = table.loc[table["to"] == "slip-", "time"].to_numpy()[1:]
    sticks = table.loc[table["to"] == "stick", "time"].to_numpy()
    assert len(slips) > 15
    # The first stick ends with F = F_s, and from then on the motion is periodic.
    assert distance(np.diff(slips), period) < 1e-10 * period
    sticks = sticks[sticks > slips[0]][: len(slips)]
    assert (
        distance(sticks - slips[: len(sticks)], belt_block.slip_duration(**values)) < 1e-10 * period
    )
    t = np.linspace(slips[0], slips[-1], 2001)
    x, v = belt_block.state(t - slips[0], **values)
    assert distance(motion.at(t)["x"], x) < 1e-9
    # At the switches the acceleration jumps, so the velocity is compared away from them.
    assert np.quantile(np.abs(motion.at(t)["d_x"] - v), 0.99) < 1e-9


def test_printed_numbers() -> None:
    motion = simulate(
        catalogue.belt_block(), (0.0, 100.0), initial={"x": 1.0, "d_x": 0.3}, parameters=PRINTED
    )
    table = switches(motion)
    starts = table.loc[table["to"] == "slip-", "time"].to_numpy()
    assert np.diff(starts) == pytest.approx(7.0952615, abs=5e-8)
    # The spring force is extreme where the velocity vanishes, once on the way out and once on the
    # way back.
    omega, delta = 1.0, 0.4
    turn = math.atan2(0.3 * omega, delta * omega**2)
    force = motion.at(starts[0] + turn + np.array([0.0, math.pi]))["x"]
    assert force == pytest.approx([1.1, 0.1], abs=1e-12)
    t = np.linspace(starts[0], 100.0, 20_001)
    x = motion.at(t)["x"]
    assert (x.min(), x.max()) == pytest.approx((0.1, 1.1), abs=1e-5)
    assert x.min() > 0.1 - 1e-12
    assert x.max() < 1.1 + 1e-12
