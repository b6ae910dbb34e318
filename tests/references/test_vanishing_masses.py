"""The rocking toy without translational inertia as a limit.

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017): (4.1) becomes (4.2) as m_l, m_b, m_W and ν vanish with the pull P = g m_W/2
fixed.
"""

import numpy as np
import pytest

from stickslip import Trajectory, catalogue, simulate
from systems import distance

pytestmark = pytest.mark.usefixtures("flow")

WALK = {"psi": -1.67, "x_R": 0.5, "x_L": 0.0}
TIMES = np.linspace(0.0, 60.0, 601)


def follow(mass: float, nu: float) -> Trajectory:
    values = {"m_W": mass, "m_b": mass, "m_l": mass, "nu": nu, "g": 2.0 / mass}
    motion = simulate(
        catalogue.rocking_toy_inertial(), (0.0, 60.0), initial=WALK, parameters=values
    )
    assert motion.outcome.ok
    assert motion.certificate.ok, motion.certificate.verdict
    return motion


def errors(motion: Trajectory) -> list[float]:
    limit = simulate(catalogue.rocking_toy(), (0.0, 60.0), initial=WALK)
    assert motion.n_switches == limit.n_switches
    return [distance(motion.at(TIMES)[x], limit.at(TIMES)[x]) for x in ("psi", "x_R", "x_L")]


def test_masses_and_viscosity_vanish() -> None:
    # The legs are overdamped, m ≪ ν² : they follow within a time of order ν.
    found = np.array([errors(follow(nu**2, nu)) for nu in (1e-2, 1e-3, 1e-4)])
    assert np.all(found[-1] < 3e-3)
    assert found[:-1] / found[1:] == pytest.approx(10, rel=0.1)
