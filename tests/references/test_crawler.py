"""Two legs with directional friction and a spring whose rest length oscillates.

A. DeSimone, P. Gidoni, G. Noselli, *Liquid crystal elastomer strips as soft crawlers*, J. Mech.
Phys. Solids 84 (2015) 254-272: net displacement per cycle sgn(f₋ − f₊) max(0, D − 2 min(f₊, f₋)/k)
with the stroke D.
"""

import math

import numpy as np
import pytest

from oracles import crawler
from stickslip import catalogue, simulate
from systems import distance

pytestmark = pytest.mark.usefixtures("flow")

CASES = [(0.3, 0.8), (0.8, 0.3), (1.9, 5.0), (2.1, 5.0), (0.2, 0.21)]


@pytest.mark.parametrize(("f_plus", "f_minus"), CASES)
@pytest.mark.parametrize("k", [1.0, 2.5])
def test_crawler(f_plus: float, f_minus: float, k: float) -> None:
    D = 4.0
    cycles = 8
    # A quarter of each cycle has 100 samples, and the extrema of L are among them.
    t = np.linspace(0.0, 2 * math.pi * cycles, 400 * cycles + 1)
    values = {"D": D, "k": k, "f_plus": f_plus, "f_minus": f_minus}
    motion = simulate(
        catalogue.two_leg_crawler(), (0.0, float(t[-1])), initial={}, parameters=values
    )
    assert motion.outcome.ok
    assert motion.certificate.ok, motion.certificate.verdict
    x_1, x_2 = crawler.simulate(D / 2 * np.sin(t), k, f_plus, f_minus)
    assert distance(motion.at(t)["x_1"], x_1) < 1e-12
    assert distance(motion.at(t)["x_2"], x_2) < 1e-12
    step = crawler.net_displacement(D, k, f_plus, f_minus)
    each = motion.at(2 * math.pi * np.arange(1, cycles))
    assert np.diff(each["x_1"]) == pytest.approx(step, abs=1e-12)
    assert np.diff(each["x_2"]) == pytest.approx(step, abs=1e-12)
    # Only one direction ever costs energy.
    cheap = min(f_plus, f_minus)
    travelled = np.abs(np.diff([x_1, x_2])).sum()
    assert motion.at(float(t[-1]))["dissipated_energy"] == pytest.approx(
        cheap * travelled, rel=1e-10, abs=1e-12
    )
