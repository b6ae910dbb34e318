"""The positively invariant rectangle of the spring slider.

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017), theorem 3.1: motions of (3.3) with k = α₀ = 1 and a falling μ̃ stay in 0 ≤ U ≤
U_max = μ̃(0) + νV, 0 ≤ α ≤ α_max = 1 + U_max²/ν.
"""

import math

import numpy as np
import pytest

from stickslip import System, Trajectory, catalogue, simulate

pytestmark = pytest.mark.usefixtures("flow")

LAWS = {
    "0.5 + exp(-(alpha - 1)/0.4)": lambda alpha: 0.5 + math.exp(-(alpha - 1) / 0.4),
    "2/(1 + alpha)": lambda alpha: 2 / (1 + alpha),
}


def slider(law: str) -> System:
    return catalogue.spring_slider(mu=law)


def rectangle(law: str, nu: float, V: float) -> tuple[float, float]:
    U_max = LAWS[law](0.0) + nu * V
    return U_max, 1 + U_max**2 / nu


def follow(
    law: str, nu: float, V: float, U: float, alpha: float, until: float = 20.0
) -> Trajectory:
    motion = simulate(
        slider(law), (0.0, until), initial={"U": U, "alpha": alpha}, parameters={"nu": nu, "V": V}
    )
    assert motion.outcome.ok
    assert motion.certificate.ok, motion.certificate.verdict
    return motion


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("nu", "V"), [(0.02, 0.18), (0.2, 0.5), (0.1, 2.0)])
def test_no_motion_leaves_it(law: str, nu: float, V: float) -> None:
    U_max, alpha_max = rectangle(law, nu, V)
    rng = np.random.default_rng(7)
    edges = [(0.0, a) for a in rng.uniform(0, alpha_max, 4)] + [
        (U_max, a) for a in rng.uniform(0, alpha_max, 4)
    ]
    edges += [(u, 0.0) for u in rng.uniform(0, U_max, 4)] + [
        (u, alpha_max) for u in rng.uniform(0, U_max, 4)
    ]
    corners = [(u, a) for u in (0.0, U_max) for a in (0.0, alpha_max)]
    for U, alpha in [*edges, *corners]:
        motion = follow(law, nu, V, U, alpha)
        values = motion.at(np.concatenate([motion.knots.time, np.geomspace(1e-6, 20.0, 200)]))
        assert -1e-12 <= values["U"].min() <= values["U"].max() <= U_max * (1 + 1e-12)
        assert -1e-12 <= values["alpha"].min() <= values["alpha"].max() <= alpha_max * (1 + 1e-12)


def test_it_is_entered_from_outside() -> None:
    law = next(iter(LAWS))
    nu = 0.02
    V = 0.18
    U_max, alpha_max = rectangle(law, nu, V)
    motion = follow(law, nu, V, 2 * U_max, 1.0)
    assert motion.at(0.0)["U"] > U_max
    assert 0 <= motion.final["U"] <= U_max
    assert 0 <= motion.final["alpha"] <= alpha_max


def test_a_periodic_orbit_attracts_where_steady_sliding_is_unstable() -> None:
    # μ̃ = 0.5 + exp(−(α − 1)/0.4), ν = 0.02, V = 0.18: the trace at the equilibrium is positive.
    law = next(iter(LAWS))
    nu = 0.02
    V = 0.18
    alpha = 1.0
    for _ in range(200):
        alpha = 0.5 * (alpha + 1 + V * (LAWS[law](alpha) + nu * V))
    U = LAWS[law](alpha) + nu * V
    slope = -math.exp(-(alpha - 1) / 0.4) / 0.4
    assert -1 - (1 + U * slope) / nu > 0
    far = follow(law, nu, V, U_max := rectangle(law, nu, V)[0], 1.0, 200.0)
    near = follow(law, nu, V, U + 1e-3, alpha, 200.0)
    assert U_max > U
    for motion in (far, near):
        stops = motion.events.loc[motion.events["to"] == "stick", "time"].to_numpy()[-5:]
        assert np.diff(stops) == pytest.approx(4.947746, abs=1e-6)


def test_steady_sliding_attracts_where_it_is_stable() -> None:
    motion = follow("2/(1 + alpha)", 0.2, 0.5, 1.0, 1.0, 200.0)
    alpha = motion.final["alpha"]
    assert motion.final["U"] == pytest.approx(2 / (1 + alpha) + 0.2 * 0.5, abs=1e-9)
    assert alpha == pytest.approx(1 + 0.5 * motion.final["U"], abs=1e-9)
