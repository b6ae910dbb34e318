"""The rocking toy walks.

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017), sections 4.3 and 4.4: I_b = a = b = ψ* = P = 1, δ = 0.04, c = 0.3, ρ = 0.2, H*
= 3 walks with the period 5.969 and the speed v = 2X/T = 0.1675. One period feeds the energy 2cX(ψ₃
+ ψ*) into the rocking.

The amplitude 1.859 that is printed with these numbers cannot be: the damping δ∮ψ'² takes up the
0.35 of this feed at the amplitude 1.624 (a harmonic motion would need 1.63), and this the motion
has from any start.
"""

import numpy as np
import pytest

from stickslip import Trajectory, catalogue, simulate
from stickslip.symbolic import expressions as ex
from systems import distance, switches

pytestmark = pytest.mark.usefixtures("flow")

WALK = {"psi": -1.67, "x_R": 0.5, "x_L": 0.0}


def facts() -> dict[str, float]:
    toy = catalogue.rocking_toy()
    return {name: ex.evaluate(fact, toy.values) for name, fact in toy.declaration.facts.items()}


def settled(initial: dict[str, float]) -> tuple[Trajectory, np.ndarray]:
    """A motion to t = 1500 and the last times at which the left leg starts."""
    motion = simulate(catalogue.rocking_toy(), (0.0, 1500.0), initial=initial)
    assert motion.outcome.ok
    assert motion.certificate.ok, motion.certificate.verdict
    table = switches(motion)
    starts = (table["contact"] == "left leg") & (table["to"] == "slip+")
    return motion, table.loc[starts, "time"].to_numpy()[-6:]


@pytest.mark.parametrize("initial", [WALK, {"psi": -3.0, "x_R": -0.1}, {"psi": 2.2, "x_R": -0.5}])
def test_walking(initial: dict[str, float]) -> None:
    motion, starts = settled(initial)
    X = facts()["X"]
    assert pytest.approx(0.5) == X
    period = np.diff(starts)
    assert period == pytest.approx(5.969, abs=5e-4)
    assert np.ptp(period) < 1e-8
    stride = np.diff(motion.at(starts)["x_R"])
    assert stride == pytest.approx(2 * X, abs=1e-12)
    assert np.diff(motion.at(starts)["x_L"]) == pytest.approx(2 * X, abs=1e-12)
    assert stride[0] / period[0] == pytest.approx(0.1675, abs=5e-5)
    psi = motion.at(np.linspace(starts[0], starts[-1], 20_001))["psi"]
    assert (psi.max(), psi.min()) == pytest.approx((1.6236, -1.6236), abs=5e-5)


def test_legs_are_the_hysteresis_of_the_angle() -> None:
    motion, starts = settled(WALK)
    t = np.linspace(starts[-2], starts[-1], 2001)
    values = motion.at(t)
    X, psi_3 = facts()["X"], facts()["psi_3"]
    psi = values["psi"]
    d = values["x_R"] - values["x_L"]
    # d = G: X until ψ rises through ψ₃, then along G_L⁺ to −X at ψ*, and mirrored on the way back.
    down = np.clip(-1 + 0.3 * psi + 0.2 + 1.5 * (1 - psi), -X, X)
    up = np.clip(1 + 0.3 * psi - 0.2 - 1.5 * (1 + psi), -X, X)
    away = np.abs(values["d_psi"]) > 1e-3
    assert distance(d[away], np.where(values["d_psi"] > 0, down, up)[away]) < 1e-11
    assert motion.at(starts)["psi"] == pytest.approx(psi_3, abs=1e-9)
    assert psi_3 == pytest.approx(1 / 6)


def test_energy_fed_in_each_period() -> None:
    X, psi_3 = facts()["X"], facts()["psi_3"]
    fed = 2 * 0.3 * X * (psi_3 + 1.0)
    # The oscillator of section 4.4 dissipates by δψ'² only.
    motion = simulate(catalogue.rocking_oscillator(), (0.0, 1500.0), initial={"psi": -1.67})
    assert motion.certificate.ok, motion.certificate.verdict
    back = (motion.events["contact"] == "d_psi = 0") & (motion.events["to"] == "below")
    turns = motion.events.loc[back, "time"].to_numpy()[-6:]
    assert np.diff(turns) == pytest.approx(5.969, abs=5e-4)
    assert np.diff(motion.at(turns)["dissipated_energy"]) == pytest.approx(fed, abs=1e-9)
    # The toy loses what the weights lose, 2PX for each leg, and friction takes all but this.
    toy, starts = settled(WALK)
    assert np.diff(toy.at(starts)["dissipated_energy"]) == pytest.approx(4 * X, abs=1e-9)
    damping = fed
    friction = 4 * X - fed
    t = np.linspace(starts[-2], starts[-1], 40_001)
    assert 0.04 * np.trapezoid(toy.at(t)["d_psi"] ** 2, t) == pytest.approx(damping, abs=1e-8)
    # Each leg slides against ρ + H: ρ·2X, and H falls linearly with ψ during the step.
    assert friction == pytest.approx(2 * (0.2 * 2 * X + 2 * X * 1.5 * (1 - psi_3) / 2), abs=1e-12)


def test_oscillator_and_toy_move_alike() -> None:
    toy = simulate(catalogue.rocking_toy(), (0.0, 100.0), initial=WALK)
    reduced = simulate(catalogue.rocking_oscillator(), (0.0, 100.0), initial={"psi": WALK["psi"]})
    t = np.linspace(0.0, 100.0, 1001)
    assert distance(toy.at(t)["psi"], reduced.at(t)["psi"]) < 1e-10


def test_rest_coexists_with_walking() -> None:
    motion = simulate(catalogue.rocking_toy(), (0.0, 300.0), initial={"psi": 0.1, "x_R": 0.0})
    assert motion.n_switches == 0
    assert abs(motion.final["psi"]) < 1e-3
    # Without rocking nothing moves below P = ρ + H*/2 = 1.7.
    assert (
        simulate(
            catalogue.rocking_toy(),
            (0.0, 10.0),
            initial={"psi": 0.0, "x_R": 0.0},
            parameters={"P": 1.699},
        ).n_switches
        == 0
    )
