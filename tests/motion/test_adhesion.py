"""Contacts that open and hold a pull: closed forms, an independent integrator, and audits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.model.system_file import loads
from stickslip.motion.trajectory import Trajectory


def lifted(**values: float) -> ss.System:
    """A mass under gravity on adhesive ground, pulled by a spring that is stretched evenly."""
    given = {"m": 2.0, "k": 3.0, "V": 0.5, "g": 1.0, "N0": 4.0} | values
    return ss.System(
        "lifted",
        parameters={name: ss.Parameter(value) for name, value in given.items()},
        coordinates={"y": ss.Inertial()},
        kinetic="m*d_y**2/2",
        potential="m*g*y + k*(y - V*t)**2/2",
        contacts={"foot": ss.Unilateral("y", adhesion="N0")},
        span=(0, 8),
    )


def test_a_mass_is_pulled_off_at_the_adhesion() -> None:
    rng = np.random.default_rng(1)
    for _ in range(8):
        m, k, V, g, N0 = rng.uniform(0.3, 3.0, 5)
        motion = ss.simulate(lifted(m=m, k=k, V=V, g=g, N0=N0), (0, (m * g + N0) / (k * V) + 3))
        off = (m * g + N0) / (k * V)
        assert motion.certificate.ok
        assert motion.events["to"].tolist()[:1] == ["open"]
        assert motion.events["time"].tolist()[0] == pytest.approx(off, rel=1e-13)
        t = off * np.array([0.2, 0.7, 0.99])
        assert motion.at(t)["normal_foot"] == pytest.approx(m * g - k * V * t, abs=1e-12)
        # y'' + w² (y − V t) + g = 0 from rest on
        w = np.sqrt(k / m)
        t = off + np.linspace(0.01, 2.0, 5)
        s = w * (t - off)
        y = V * t - g / w**2 - (V * off - g / w**2) * np.cos(s) - V / w * np.sin(s)
        if np.all(y > 0.0):
            assert motion.at(t)["y"] == pytest.approx(y, abs=1e-10)
            assert np.all(motion.at(t)["normal_foot"] == 0.0)


def test_the_time_of_a_pull_off_has_derivatives() -> None:
    motion = ss.simulate(lifted())
    found = motion.sensitivity(
        ["N0", "V"], [3.0, 5.0], of=["y", "normal_foot"], second_opinion=True
    )
    assert found.d_switch_time.values[:, 0] == pytest.approx([1 / 1.5, -4 / 0.5], rel=1e-12)
    for name in ("y", "normal_foot"):
        assert found[name].values == pytest.approx(
            found[f"{name}_by_differences"].values, rel=1e-6, abs=1e-8
        )


def test_what_opens_too_early_or_too_late_is_not_certified() -> None:
    asked = ss.simulate(lifted())
    for N0 in (3.0, 3.9999, 4.0001, 5.0):
        other = ss.simulate(lifted(N0=N0))
        assert other.certificate.ok
        forged = Trajectory(asked.problem, asked.t_span, other.knots, other.outcome)
        assert not forged.certificate.ok, N0


def ceiling(N0: float, e: float) -> ss.System:
    """A ball thrown at a ceiling that adheres, with N0 in parts of its weight."""
    return ss.System(
        "ceiling",
        coordinates={"y": ss.Inertial()},
        kinetic="d_y**2/2",
        potential="y",
        contacts={"top": ss.Unilateral("1 - y", adhesion=N0, restitution=e)},
        initial={"d_y": 2.0},
        span=(0, 3),
    )


def test_a_ball_sticks_to_a_ceiling_that_holds_its_weight() -> None:
    held = ss.simulate(ceiling(1.5, 0.0))
    assert held.certificate.ok
    assert held.final == {"y": 1.0, "d_y": 0.0}
    assert held.at([2.0])["normal_top"][0] == pytest.approx(-1.0, abs=1e-13)
    # what holds less lets it go at once, and what rebounds is not held
    struck = 2.0 - np.sqrt(2.0)
    for N0, e in ((0.5, 0.0), (1.5, 0.6)):
        free = ss.simulate(ceiling(N0, e))
        assert free.certificate.ok
        fallen = 3.0 - struck
        y = 1.0 - e * np.sqrt(2.0) * fallen - fallen**2 / 2
        assert free.final["y"] == pytest.approx(y, rel=1e-12)


def test_a_bouncing_ball_ends_up_stuck() -> None:
    """Without adhesion the second shake of the table throws it off, with it it stays."""
    for N0, opens in ((0.0, True), (3.0, False)):
        system = ss.System(
            "ball",
            coordinates={"y": ss.Inertial(force="-1 + 2.5*heaviside(t - 20)")},
            kinetic="d_y**2/2",
            contacts={"table": ss.Unilateral("y", adhesion=N0, restitution=0.5)},
            initial={"y": 1.0},
            span=(0, 22),
        )
        motion = ss.simulate(system)
        assert motion.certificate.ok
        assert motion.at([19.0])["normal_table"][0] == pytest.approx(1.0)
        assert (motion.final["y"] > 1.0) is opens


@pytest.mark.parametrize("plane", [False, True])
def test_friction_under_adhesion_is_that_of_derjaguin(plane: bool) -> None:
    """μ(N + N₀) until it is pulled off, nothing afterwards."""
    system = ss.System(
        "dragged",
        coordinates={
            "x": ss.Inertial(force="1.5"),
            "z": ss.Inertial(),
            "y": ss.Inertial(force="t/2 - 1"),
        },
        kinetic="(d_x**2 + d_y**2 + d_z**2)/2",
        contacts={"foot": ss.Unilateral("y", ("d_x", "d_z") if plane else "d_x", 0.4, adhesion=3)},
        span=(0, 10),
    )
    motion = ss.simulate(system)
    assert motion.certificate.ok
    assert motion.events["time"].tolist() == pytest.approx([0.5, 8.0], rel=1e-12)
    assert motion.events["to"].tolist()[1] == "open"
    t = np.array([1.0, 4.0, 7.9])
    rubs = motion.at(t)["friction_foot_1" if plane else "friction_foot"]
    assert rubs == pytest.approx(-0.4 * (4.0 - t / 2), rel=1e-12)
    speed = 1.5 * 7.5 - 0.4 * (4.0 * 7.5 - (64.0 - 0.25) / 4)
    assert motion.at([8.0])["d_x"][0] == pytest.approx(speed, rel=1e-12)
    assert motion.at([10.0])["d_x"][0] == pytest.approx(speed + 3.0, rel=1e-12)


def test_a_plate_that_shakes_does_work_by_adhesion() -> None:
    """N ẇ, the adhesion included: what is held follows the plate."""
    system = ss.System(
        "shaken",
        coordinates={"y": ss.Inertial()},
        kinetic="d_y**2/2",
        potential="y",
        contacts={"plate": ss.Unilateral("y - 0.5*sin(2*t)", adhesion=2)},
        initial={"d_y": 1.0},
        span=(0, 2),
    )
    motion = ss.simulate(system)
    assert motion.certificate.ok and len(motion.events) == 0
    t = np.array([0.5, 1.0, 2.0])
    found = motion.at(t)
    assert found["normal_plate"] == pytest.approx(1 - 2 * np.sin(2 * t), abs=1e-12)
    energy = np.cos(2 * t) ** 2 / 2 + np.sin(2 * t) / 2
    assert found["supplied_energy"] == pytest.approx(energy - 0.5, abs=1e-12)


def test_several_hold_a_pull_together() -> None:
    """A rigid rod on three feet, more than it has freedoms, holds three times what one does."""
    feet = {"a": -1.0, "b": 0.0, "c": 1.0}
    system = ss.System(
        "rod",
        coordinates={"y": ss.Inertial(force="t/2"), "phi": ss.Inertial()},
        kinetic="(d_y**2 + d_phi**2/3)/2",
        contacts={n: ss.Unilateral(f"y + {x}*phi", adhesion=1) for n, x in feet.items()},
        span=(0, 8),
    )
    motion = ss.simulate(system)
    assert motion.certificate.ok
    assert motion.events["time"].tolist() == pytest.approx([6.0, 6.0, 6.0], rel=1e-12)
    assert motion.final["y"] == pytest.approx(0.5 * (8**3 / 6 - 36 * 8 / 2 + 6**3 / 3), rel=1e-10)


def peel(n: int, rng: np.random.Generator) -> tuple[ss.System, dict[str, np.ndarray]]:
    """Lumps of a strip that is peeled off at its end, hinged by springs."""
    N0, m = rng.uniform(0.2, 1.0, n), rng.uniform(0.5, 2.0, n)
    k = rng.uniform(3.0, 9.0, n + 1)
    ends = ["0", *(f"y{i}" for i in range(n)), "0.3*t"]
    springs = [f"{k[i]}*({ends[i + 1]} - {ends[i]})**2/2" for i in range(n + 1)]
    springs[0] = "0"
    system = ss.System(
        "strip",
        coordinates={f"y{i}": ss.Inertial() for i in range(n)},
        kinetic=" + ".join(f"{m[i]}*d_y{i}**2/2" for i in range(n)),
        potential=" + ".join(springs),
        viscous=" + ".join(f"0.1*d_y{i}**2" for i in range(n)),
        contacts={f"c{i}": ss.Unilateral(f"y{i}", adhesion=float(N0[i])) for i in range(n)},
        span=(0, 12),
    )
    return system, {"N0": N0, "m": m, "k": k}


def peeled(n: int, given: dict[str, np.ndarray], stop: float) -> np.ndarray:
    """Places at the end by an integrator that knows events alone; NaN where lumps fall back."""
    N0, m, k = given["N0"], given["m"], given["k"]
    closed = np.ones(n, bool)
    y = np.zeros(2 * n)
    t = 0.0

    def pull(t: float, y: np.ndarray) -> np.ndarray:
        ends = np.concatenate([y[:n], [0.3 * t]])
        stretched = k[1:] * np.diff(ends)
        return stretched - np.concatenate([[0.0], stretched[:-1]]) - 0.2 * y[n:]

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[n:], np.where(closed, 0.0, pull(t, y) / m)])

    while t < stop:
        held, off = np.flatnonzero(closed), np.flatnonzero(~closed)
        events = [lambda t, y, i=i: N0[i] - pull(t, y)[i] for i in held]
        events += [lambda t, y, i=i: y[i] + 1e-12 for i in off]
        for event in events:
            event.terminal, event.direction = True, -1.0  # pyright: ignore
        found = solve_ivp(rates, (t, stop), y, events=events, rtol=1e-11, atol=1e-13)
        t, y = float(found.t[-1]), found.y[:, -1]
        for i, times in zip((*held, *off), found.t_events, strict=True):
            if len(times) and i in off:
                return np.full(n, np.nan)
            closed[i] &= not len(times)
    return y[:n]


def test_a_strip_peels_as_an_integrator_says() -> None:
    rng = np.random.default_rng(7)
    compared = 0
    for n in (1, 2, 2, 3, 3):
        system, given = peel(n, rng)
        motion = ss.simulate(system)
        assert motion.certificate.ok
        y = peeled(n, given, 12.0)
        if np.all(np.isfinite(y)):
            compared += 1
            assert [motion.final[f"y{i}"] for i in range(n)] == pytest.approx(y, abs=1e-7)
    assert compared >= 3


def test_both_states_under_a_pull_are_equilibria() -> None:
    system = ss.System(
        "held",
        parameters={"N0": ss.Parameter(0.4)},
        coordinates={"y": ss.Inertial()},
        kinetic="d_y**2/2",
        potential="(y - 0.3)**2/2",
        viscous="d_y**2/10",
        contacts={"foot": ss.Unilateral("y", adhesion="N0")},
    )
    assert len(list(ss.equilibria(system))) == 2
    assert len(list(ss.equilibria(system.with_parameters(N0=0.2)))) == 1


def test_a_mass_that_hovers_is_not_held() -> None:
    """Rest at a gap is no contact."""
    system = ss.System(
        "hovers",
        coordinates={"y": ss.Inertial()},
        kinetic="d_y**2/2",
        potential="(y - 0.3)**2/2",
        contacts={"foot": ss.Unilateral("y", adhesion=5)},
        initial={"y": 0.3},
        span=(0, 5),
    )
    motion = ss.simulate(system)
    assert motion.certificate.ok
    assert motion.final == {"y": 0.3, "d_y": 0.0}


def test_an_adhesion_is_never_negative() -> None:
    for N0 in ("-1", "sin(t)"):
        with pytest.raises(ss.DeclarationError, match=r"adhesion: .*largest tensile force"):
            ss.System(
                "wrong",
                coordinates={"y": ss.Inertial()},
                kinetic="d_y**2/2",
                contacts={"foot": ss.Unilateral("y", adhesion=N0)},
                span=(0, 6),
            )


def test_adhesion_is_shown_and_written() -> None:
    system = lifted()
    assert loads(system.to_toml()) == system
    text = str(system.equations())
    assert "y = 0:  normal_foot ≥ −N₀" in text
    assert "y > 0:  normal_foot = 0" in text
    assert r"\mathrm{normal\_foot} \geq -N_{0}" in system.equations(latex=True)
