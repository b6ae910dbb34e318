"""Harmonically forced oscillator with dry friction, non-stop motion.

J. P. Den Hartog, *Forced vibrations with combined Coulomb and viscous friction*, Trans. ASME 53
(1931) 107-115; the formulas as in L. Marino, A. Cicirello, *Experimental investigation of a
single-degree-of-freedom system with Coulomb friction*, Nonlinear Dynamics 99 (2020).
"""

import math

import numpy as np
import pytest

from oracles import den_hartog
from stickslip import Trajectory, catalogue, simulate
from systems import distance, switches

pytestmark = pytest.mark.usefixtures("flow")

CASES = [(0.8, 0.3, 2.626105), (1.2, 0.3, 2.072384), (2.0, 0.4, 0.266667)]


def follow(
    r: float, beta: float, periods: int, initial: dict[str, float] | None = None
) -> Trajectory:
    """m = k = P = 1, so that ω = r and F_c = β."""
    span = (0.0, periods * 2 * math.pi / r)
    trajectory = simulate(
        catalogue.forced_oscillator(), span, initial=initial, parameters={"F_c": beta, "omega": r}
    )
    assert trajectory.outcome.ok
    assert trajectory.certificate.ok, trajectory.certificate.verdict
    return trajectory


@pytest.mark.parametrize(("r", "beta", "X"), CASES)
def test_start_on_the_periodic_motion(r: float, beta: float, X: float) -> None:
    x, v = den_hartog.state(0.0, r, beta)
    motion = follow(r, beta, 20, {"x": float(x), "d_x": float(v)})
    turns = switches(motion)
    assert set(zip(turns["from"], turns["to"], strict=True)) == {
        ("slip+", "slip-"),
        ("slip-", "slip+"),
    }
    assert len(turns) == 40
    # At its switches the velocity vanishes, the displacement is largest.
    assert distance(turns["x"].abs(), den_hartog.amplitude(r, beta)) < 1e-11
    assert float(np.abs(turns["x"].to_numpy()).max()) == pytest.approx(X, abs=5e-7)
    t = np.linspace(*motion.t_span, 1001)
    x, v = den_hartog.state(r * t, r, beta)
    assert distance(motion.at(t)["x"], x) < 1e-11
    assert distance(motion.at(t)["d_x"], v) < 1e-11


@pytest.mark.parametrize(("r", "beta", "X"), CASES)
@pytest.mark.parametrize("start", [{}, {"x": 1.0, "d_x": -2.0}])
def test_any_start_settles_on_it(r: float, beta: float, X: float, start: dict[str, float]) -> None:
    motion = follow(r, beta, 300, start)
    period = 2 * math.pi / r
    t = np.linspace(295 * period, 300 * period, 501)
    assert distance(motion.at(t)["x"], den_hartog.state(r * t, r, beta)[0]) < 1e-10
    turns = switches(motion)
    late = turns.loc[turns["time"] > 295 * period, "x"].to_numpy()
    assert float(np.abs(late).max()) == pytest.approx(X, abs=5e-7)


@pytest.mark.parametrize(("r", "excess", "stops"), [(0.8, -1e-3, False), (0.8, 1e-3, True)])
def test_stops_begin_at_the_limit(r: float, excess: float, stops: bool) -> None:
    beta = den_hartog.beta_lim(r) + excess
    assert den_hartog.beta_lim(0.8) == pytest.approx(0.81741, abs=5e-6)
    late = switches(follow(r, beta, 200)).query("time > 1000")
    assert ("stick" in set(late["to"])) == stops
