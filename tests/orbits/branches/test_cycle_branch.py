"""Branches of cycles: special points against closed forms, both kinds of Hopf points, corners,
named ends."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from oracles import belt_block, den_hartog
from orbits.examples import (
    HALF_TURN,
    SLIDER,
    damped_block,
    dragged,
    duffing,
    isola,
    mass_on_belt,
    planar,
)
from stickslip import Contact, Parameter, Structure, System, catalogue, simulate
from stickslip.errors import DeclarationError
from stickslip.orbits.branches.cycle_branch import continue_cycle
from stickslip.orbits.branches.equilibrium_branch import continue_equilibrium
from stickslip.orbits.continuation.branch import Branch, SpecialPoint
from stickslip.orbits.continuation.driver import PointOnTheWay
from stickslip.orbits.cycles.cycle import Cycle
from stickslip.orbits.cycles.find_cycle import find_cycle
from systems import distance, oscillator


def follow(cycle: Cycle, parameter: str, span: tuple[float, float]) -> Branch:
    """A branch, every point of which closes and obeys the friction law with its own sequence."""
    branch = continue_cycle(cycle, parameter, span)
    points = branch.points
    assert branch.certificate.ok, branch.certificate.describe()
    assert points["certified"].values.all()
    assert points["residual"].values.max() < 1e-9
    assert np.all(np.isfinite(points["multiplier_real"].values))
    low, high = points[parameter].values.min(), points[parameter].values.max()
    assert span[0] - 1e-9 <= low
    assert high <= span[1] + 1e-9
    return branch


def test_points_are_told_as_they_are_found() -> None:
    """Of cycles and of equilibria, under the names that they have on the branch; from the start in
    both directions, and before it is known how the branch ends."""
    span = (0.05, 0.4)
    told: list[PointOnTheWay] = []
    steady = continue_equilibrium(SLIDER, "V", span, progress=told.append)
    check_told(told, steady, ("V", "U", "alpha"))
    told.clear()
    cycle = find_cycle(SLIDER, parameters={"V": 0.15})
    branch = continue_cycle(cycle, "V", span, progress=told.append)
    check_told(told, branch, ("V", "period", "U", "min_U", "max_U"))


def check_told(told: list[PointOnTheWay], branch: Branch, names: tuple[str, ...]) -> None:
    """Almost all points of the branch were told, each in its direction; changes that are located
    between two of them are not."""
    assert {point.side for point in told} == {1.0, -1.0}
    starts = [next(p for p in told if p.side == side) for side in (1.0, -1.0)]
    assert starts[0].values["V"] == pytest.approx(starts[1].values["V"], rel=1e-9)
    points = np.array([[point.values[name] for name in names] for point in told])
    rows = np.array([branch.points[name].values for name in names]).T
    apart = np.abs(rows[:, None, :] - points[None]).max(axis=2).min(axis=1)
    located = sum(s.kind in ("stick onset", "grazing", "sequence change") for s in branch.special)
    assert np.count_nonzero(apart > 1e-9) <= located + 2


def test_a_listener_may_stop_a_branch() -> None:
    """What it raises comes out; nothing takes it for a step that failed."""

    class Enough(Exception):
        pass

    def tell(point: PointOnTheWay) -> None:
        raise Enough

    with pytest.raises(Enough):
        continue_equilibrium(SLIDER, "V", (0.05, 0.4), progress=tell)
    with pytest.raises(Enough):
        continue_cycle(find_cycle(SLIDER, parameters={"V": 0.15}), "V", (0.05, 0.4), progress=tell)


def kinds(branch: Branch) -> list[str]:
    return [point.kind for point in branch.special]


@pytest.fixture(scope="module")
def slider() -> Branch:
    """From the subcritical Hopf point through the stick onset and a fold down to slow loading."""
    point = continue_equilibrium(SLIDER, "V", (0.2, 0.25)).of_kind("Hopf")[0]
    return follow(find_cycle(SLIDER, point), "V", (0.02, 0.5))


def test_spring_slider(slider: Branch) -> None:
    order = ["fold", "stick onset", "Hopf"]
    assert kinds(slider) in (order, order[::-1])
    hopf, onset, fold = (slider.of_kind(kind)[0] for kind in ("Hopf", "stick onset", "fold"))
    assert hopf.value == pytest.approx(0.224849301296112, rel=1e-12)
    equilibrium = continue_equilibrium(SLIDER, "V", (0.2, 0.25)).of_kind("Hopf")[0]
    assert hopf.state == pytest.approx(equilibrium.state, rel=1e-9)
    assert hopf.value < onset.value < fold.value
    assert "V = 0.02, the end of the range" in slider.ended
    assert "Hopf at V = 0.2248493" in slider.ended
    # Unstable from the Hopf point to the fold, stable from there; sticking from the onset on.
    points = slider.points
    index = np.arange(len(slider.points["V"]))
    towards_hopf = np.sign(hopf.index - fold.index)
    after_fold = towards_hopf * (fold.index - index)
    after_onset = towards_hopf * (onset.index - index)
    away = after_fold != 0
    assert np.array_equal(points["stable"].values[away] == 1, after_fold[away] > 0)
    away = after_onset != 0
    assert np.array_equal(points["sticks"].values[away] == 1, after_onset[away] > 0)


def test_spring_slider_from_a_simulation(slider: Branch) -> None:
    """The same branch from a stick-slip cycle that a simulation has settled on."""
    cycle = find_cycle(SLIDER, simulate(SLIDER, (0, 60), parameters={"V": 0.15}))
    assert cycle.sticks
    assert cycle.stable
    branch = follow(cycle, "V", (0.02, 0.5))
    assert kinds(branch) == ["fold", "stick onset", "Hopf"]
    for point in branch.special:
        other = slider.of_kind(point.kind)[0]
        assert point.value == pytest.approx(other.value, rel=1e-11)
        assert point.period == pytest.approx(
            other.period, rel=1e-6 if point.kind != "Hopf" else 1e-2
        )


def test_stick_onset_of_the_spring_slider(slider: Branch) -> None:
    """On one side the relative speed of the cycle just fails to reach 0, on the other it stays
    there for a moment."""
    onset = slider.of_kind("stick onset")[0]
    before, after = (
        find_cycle(SLIDER, onset.state, parameters={"V": onset.value + d}) for d in (-1e-7, 1e-7)
    )
    assert before.stick_time == 0.0
    assert 0.0 < after.stick_time < 1e-2
    times = np.linspace(*before.trajectory.t_span, 20_001)
    speed = before.trajectory.at(times)["slip_speed_block"].max()
    assert -1e-5 < speed < 0.0


def test_supercritical_spring_slider() -> None:
    """Born stable; its stick onset lies between two loading rates at which simulations slide and
    stick."""
    system = catalogue.spring_slider(mu="1.5 - tanh(alpha - 1.5)", nu=0.05)
    point = continue_equilibrium(system, "V", (0.6, 0.8)).of_kind("Hopf")[0]
    assert (point.value, point.data["lyapunov"]) == pytest.approx(
        (0.721195750057, -0.1165), abs=1e-4
    )
    branch = follow(find_cycle(system, point), "V", (0.1, 1.0))
    assert sorted(kinds(branch)) == ["Hopf", "stick onset"]
    assert branch.points["stable"].values.all()
    assert branch.of_kind("Hopf")[0].value == pytest.approx(point.value, rel=1e-12)
    onset = branch.of_kind("stick onset")[0]
    assert 0.7200 < onset.value < 0.7205
    for rate, sticks in ((onset.value - 1e-5, True), (onset.value + 1e-5, False)):
        settled = simulate(system, (0, 800), initial=onset.state, parameters={"V": rate})
        late = settled.knots.time > 750
        assert np.any(settled.knots.mode[late] == 0) == sticks


def test_hysteresis_of_the_spring_slider() -> None:
    """Loaded faster and faster it sticks and slips until the fold; slower and slower it slides
    until the Hopf point."""
    at_hopf, at_fold = 0.224849301296112, 0.226388127713
    state = {"U": 1.6, "alpha": 1.1}
    moving = []
    steps = [0.2, 0.2235, 0.2245, 0.2255, 0.2262, 0.2266]
    for speed in [*steps, *reversed(steps)]:
        motion = simulate(SLIDER, (0, 3000), initial=state, parameters={"V": speed})
        state = motion.final
        moving.append(np.ptp(motion.at(np.linspace(2950, 3000, 501))["U"]) > 0.02)
    up = moving[: len(steps)]
    down = moving[: len(steps) - 1 : -1]
    assert up == [at_fold > V for V in steps]
    assert down == [at_hopf > V for V in steps]


def test_mass_on_belt() -> None:
    """A supercritical Hopf point; the speed of the growing cycle meets the belt, and the mass
    begins to stick."""
    system = mass_on_belt()
    critical = math.sqrt(0.2 / 0.6)
    point = continue_equilibrium(system, "V", (0.3, 0.8)).of_kind("Hopf")[0]
    assert point.note == "supercritical"
    assert point.value == pytest.approx(critical, rel=1e-11)
    cycle = find_cycle(system, point, parameters={"V": 0.55})
    assert cycle.extrema["d_x"][1] == pytest.approx(2 * math.sqrt(critical**2 - 0.55**2), rel=0.02)
    branch = follow(cycle, "V", (0.1, 0.8))
    assert sorted(kinds(branch)) == ["Hopf", "stick onset"]
    onset = branch.of_kind("stick onset")[0]
    assert onset.value == pytest.approx(math.sqrt(0.8) * critical, rel=0.01)
    points = branch.points
    speeds = points["V"].values
    assert points["stable"].values[speeds < critical - 1e-6].all()
    # At the onset the speed of the mass is that of the belt, and from there on it is forgotten how
    # it came to stick.
    assert points["max_d_x"].values[onset.index] == pytest.approx(onset.value, rel=1e-8)
    sticks = points["sticks"].values == 1
    away = np.arange(len(speeds)) != onset.index
    assert np.array_equal(sticks[away], speeds[away] < onset.value)
    assert np.all(points["multiplier_real"].values[sticks, 1] == 0.0)
    assert np.all(points["multiplier_real"].values[~sticks, 1] > 0.0)


@pytest.mark.parametrize("r", [0.8, 1.2])
def test_den_hartog(r: float) -> None:
    """With more friction the forced oscillator begins to stop where Den Hartog says."""
    cycle = find_cycle(catalogue.forced_oscillator(), parameters={"F_c": 0.3, "omega": r})
    branch = follow(cycle, "F_c", (0.1, 0.95))
    onset = branch.of_kind("stick onset")
    assert [point.value for point in onset] == pytest.approx([den_hartog.beta_lim(r)], rel=1e-9)
    sliding = branch.points["F_c"].values < onset[0].value - 1e-9
    amplitudes = [den_hartog.amplitude(r, beta) for beta in branch.points["F_c"].values[sliding]]
    assert branch.points["max_x"].values[sliding] == pytest.approx(amplitudes, rel=1e-9)
    assert not branch.points["sticks"].values[sliding].any()
    assert branch.points["sticks"].values[branch.points["F_c"].values > onset[0].value + 1e-9].all()


def test_belt_block() -> None:
    """Periods along a branch are those of the formula; so in the frame of the ground, where the
    block drifts."""
    for system in (catalogue.belt_block(), dragged()):
        branch = follow(find_cycle(system), "V", (0.05, 1.5))
        V = branch.points["V"].values
        periods = [belt_block.period(m=1.0, k=1.0, V=v, F_s=1.0, F_k=0.6) for v in V]
        assert branch.points["period"].values == pytest.approx(periods, rel=1e-10)
        assert not branch.special
        assert (
            branch.ended
            == "first point: V = 0.05, the end of the range; last point: V = 1.5, the end of the "
            "range"
        )
        speed = V if system.name == "dragged block" else 0.0 * V
        assert branch.points["speed"].values == pytest.approx(speed, rel=1e-12)


def test_normal_form() -> None:
    """r' = r(a − b r²): amplitude and multiplier of every cycle."""
    branch = follow(find_cycle(planar(), parameters={"a": 0.1, "b": -0.1}), "q", (-3.0, -0.2))
    assert branch.points["max_x"].values == pytest.approx(
        np.sqrt(0.1 / -branch.points["q"].values), rel=1e-10
    )
    assert branch.points["multiplier_real"].values[:, 1] == pytest.approx(
        np.exp(-0.8 * np.pi), rel=1e-9
    )


def test_period_doubling() -> None:
    branch = follow(find_cycle(planar(), parameters={**HALF_TURN, "a": -0.1}), "a", (-0.4, 0.2))
    assert kinds(branch) == ["period doubling"]
    assert branch.special[0].value == pytest.approx(0.0, abs=1e-11)
    a = branch.points["a"].values
    expected = -np.exp(2 * np.pi * np.column_stack([a, np.full(len(a), -0.2)]))
    found = np.sort(branch.points["multiplier_real"].values, axis=1)
    assert found == pytest.approx(np.sort(expected, axis=1), rel=1e-9)


def test_duffing() -> None:
    """Twice the period doubles; an independent integration has the multiplier −1 there, and the
    short cycle again."""
    single = follow(find_cycle(duffing()), "F", (0.15, 0.4))
    double = follow(
        find_cycle(duffing(), simulate(duffing(), (0, 1000), parameters={"F": 0.28})),
        "F",
        (0.15, 0.4),
    )
    assert kinds(single) == ["period doubling"]
    assert kinds(double) == ["period doubling", "period doubling"]
    first, second = single.special[0], double.special[1]
    assert double.special[0].value == pytest.approx(first.value, rel=1e-10)
    assert "becomes a cycle of half its period" in double.ended
    assert double.points["F"].values.min() == pytest.approx(first.value, rel=1e-3)
    for point in (first, second):
        rotated = monodromy(point)
        assert np.min(np.abs(np.linalg.eigvals(rotated) + 1)) < 1e-8


def monodromy(point: SpecialPoint) -> NDArray[np.float64]:
    """Derivative of the return map of Duffing's equation by SciPy; the motion has to close."""
    from scipy.integrate import solve_ivp

    F, c, omega = (point.parameters[name] for name in ("F", "c", "omega"))
    start = np.array([point.state["x"], point.state["v"]])

    def rates(t: float, z: NDArray[np.float64]) -> NDArray[np.float64]:
        x, v = z[:2]
        J = np.array([[0.0, 1.0], [1 - 3 * x**2, -c]])
        return np.concatenate(
            [[v, x - x**3 - c * v + F * np.cos(omega * t)], (J @ z[2:].reshape(2, 2)).ravel()]
        )

    first = point.data["time"]
    assert point.period is not None
    last = point.data["time"] + point.period
    z = solve_ivp(
        rates, (first, last), np.append(start, np.eye(2)), method="DOP853", rtol=1e-12, atol=1e-13
    ).y[:, -1]
    assert distance(z[:2], start) < 1e-9
    return z[2:].reshape(2, 2)


def test_isola() -> None:
    """A closed branch is followed round once."""
    branch = follow(find_cycle(isola()), "a", (-2.0, 2.0))
    assert sorted(point.value for point in branch.special) == pytest.approx([-1.0, 1.0], abs=1e-10)
    assert set(kinds(branch)) == {"fold"}
    assert branch.ended == "first point: the branch is closed; last point: the branch is closed"
    square = branch.points["max_x"].values ** 2
    a = branch.points["a"].values
    assert (square - 2) ** 2 + a**2 == pytest.approx(np.ones(len(a)), abs=1e-9)
    growth = np.exp(-0.4 * 2 * np.pi * square * (square - 2))
    assert branch.points["multiplier_real"].values.prod(axis=1) == pytest.approx(growth, rel=1e-8)


def test_loss_of_the_cycle() -> None:
    """Beyond some speed a damped block that has slipped no longer reaches the speed of the belt.

    In slip the speed obeys w'' + c w' + w = 0 from w = V, w' = −(F_s − F_k); its largest value
    comes down to V.
    """
    from scipy.optimize import brentq

    c, fall = 0.1, 0.4
    omega = math.sqrt(1 - c**2 / 4)

    def excess(V: float) -> float:
        b = (c * V / 2 - fall) / omega
        # w = e^{−ct/2}(V cos ωt + b sin ωt) has its extrema where tan ωt is this ratio; the second
        # one is the maximum.
        turn = math.atan2(omega * b - c * V / 2, omega * V + c * b / 2) % math.pi + math.pi
        return math.exp(-c * turn / (2 * omega)) * (V * math.cos(turn) + b * math.sin(turn)) - V

    branch = follow(find_cycle(damped_block()), "V", (0.05, 10.0))
    assert kinds(branch) == ["loss of the cycle"]
    assert branch.special[0].value == pytest.approx(brentq(excess, 0.2, 1.0, xtol=1e-15), rel=1e-9)
    assert "no longer returns" in branch.ended


def test_more_stops() -> None:
    """A slowly forced oscillator stops more often: two grazings at once by symmetry, as simulations
    say."""
    system = catalogue.forced_oscillator()
    branch = follow(find_cycle(system, parameters={"F_c": 0.5, "omega": 0.5}), "omega", (0.15, 0.7))
    assert sorted(kinds(branch)) == ["grazing", "stick onset"]
    grazing = branch.of_kind("grazing")[0].value
    for omega, stops in ((grazing - 1e-5, 4), (grazing + 1e-5, 2)):
        period = 2 * math.pi / omega
        start = simulate(system, (0, 20 * period), parameters={"F_c": 0.5, "omega": omega}).final
        motion = simulate(
            system, (0, period), initial=start, parameters={"F_c": 0.5, "omega": omega}
        )
        assert np.count_nonzero(motion.events["to"] == "stick") == stops


def test_torus() -> None:
    """The multipliers exp((−c/2 ± iω)T) of a driven oscillator leave the unit circle at c = 0."""
    cycle = find_cycle(
        oscillator(), None, parameters={"mu": 0.0, "c": 0.1, "k": 1.69, "omega": 1.0}
    )
    branch = follow(cycle, "c", (-0.3, 0.3))
    assert kinds(branch) == ["torus"]
    assert branch.special[0].value == pytest.approx(0.0, abs=1e-11)
    assert branch.special[0].note == "rotation number 0.3"
    modulus = np.hypot(*(branch.points[f"multiplier_{part}"].values for part in ("real", "imag")))
    expected = np.exp(-np.pi * branch.points["c"].values)
    assert modulus == pytest.approx(np.column_stack([expected, expected]), rel=1e-9)


def test_without_damping() -> None:
    """All multipliers are on the unit circle, which is no torus anywhere, and attracts nothing."""
    cycle = find_cycle(
        oscillator(), {"x": 1 / (1 - 0.36)}, parameters={"mu": 0.0, "c": 0.0, "omega": 0.6}
    )
    branch = follow(cycle, "omega", (0.55, 0.65))
    assert not branch.special
    assert np.all(branch.points["stable"].values == -1)
    assert "neutral" in cycle.describe()
    modulus = np.hypot(*(branch.points[f"multiplier_{part}"].values for part in ("real", "imag")))
    assert modulus == pytest.approx(np.ones_like(modulus), rel=1e-10)


def test_toy_turns_back_where_its_legs_cease_to_stop() -> None:
    """Walking ends where ψ no longer passes ψ*: there the branch turns back, at an angle, into the
    unstable walk."""
    walk = find_cycle(catalogue.rocking_toy(), {"psi": -1.67, "x_R": 0.45})
    branch = follow(walk, "P", (0.5, 1.2))
    fold = branch.of_kind("fold")
    assert len(fold) == 1
    assert "not smooth" in fold[0].note
    points = branch.points
    P = points["P"].values
    assert points["max_psi"].values[fold[0].index] == pytest.approx(1.0, abs=1e-7)
    assert P.min() == pytest.approx(fold[0].value, abs=1e-9)
    stable = points["stable"].values == 1
    far = P - fold[0].value > 1e-6
    assert np.array_equal(stable[far], points["max_psi"].values[far] > 1.0)
    assert np.count_nonzero(~stable) > 5
    # Inside the unstable walk the toy comes to rest, outside it walks on.
    i = int(np.argmin(np.where(stable, np.inf, np.abs(P - 0.9))))
    toy = catalogue.rocking_toy()
    values = {"P": float(P[i])}
    unstable = find_cycle(
        toy,
        {name: float(points[name].values[i]) for name in ("psi", "d_psi", "x_R", "x_L")},
        parameters=values,
    )
    assert unstable.nontrivial[0].real > 1.0
    starts = unstable.trajectory.events
    stop = starts.loc[starts["to"] == "stick", "time"].iloc[0] + 0.1
    there = unstable.trajectory.at(float(stop))
    for factor, walks in ((0.98, False), (1.02, True)):
        start = {**{name: there[name] for name in unstable.state}, "d_psi": factor * there["d_psi"]}
        motion = simulate(toy, (0, 600), initial=start, parameters=values)
        assert (motion.final["x_R"] - motion.at(550.0)["x_R"] > 0.5) is walks


def test_crawler_stops() -> None:
    """With a stroke below twice the slack no leg moves: the motion shrinks to nothing on the
    boundary."""
    branch = follow(find_cycle(catalogue.two_leg_crawler()), "D", (0.1, 1.2))
    end = branch.of_kind("boundary equilibrium")[0]
    assert end.value == pytest.approx(2 * 0.1 / 1.0, rel=1e-6)
    D = branch.points["D"].values
    assert branch.points["drift"].values == pytest.approx(D - 0.2, abs=1e-9)


def test_the_end_of_what_is_admissible() -> None:
    """No kinetic friction at all, and none that is negative: T = 2F_s/(kV) + (2/ω)(π −
    arctan(ωF_s/(kV)))."""
    branch = follow(find_cycle(catalogue.belt_block()), "F_k", (0.0, 0.7))
    assert "F_k = 0, the end of the range" in branch.ended
    i = int(np.argmin(branch.points["F_k"].values))
    assert branch.points["F_k"].values[i] == 0.0
    period = belt_block.period(m=1.0, k=1.0, V=0.3, F_s=1.0, F_k=0.0)
    assert branch.points["period"].values[i] == pytest.approx(period, rel=1e-12)


def test_growth_without_bound() -> None:
    """At resonance an undamped oscillator has no cycle: its amplitude is 1/(1 − ω²)."""
    cycle = find_cycle(
        oscillator(), {"x": 1.0 / 0.51}, parameters={"mu": 0.0, "c": 0.0, "omega": 0.7}
    )
    branch = follow(cycle, "omega", (0.6, 1.5))
    assert "grows without bound" in branch.ended
    omega = branch.points["omega"].values
    assert branch.points["max_x"].values == pytest.approx(1 / (1 - omega**2), rel=1e-6)


def test_file(tmp_path: Path) -> None:
    branch = follow(find_cycle(catalogue.belt_block()), "V", (0.25, 0.4))
    branch.save(tmp_path / "branch.nc")
    again = Branch.open(tmp_path / "branch.nc")
    assert again.points.equals(branch.points)
    assert again.ended == branch.ended
    assert "period" in branch.table.columns


def test_bad_arguments() -> None:
    cycle = find_cycle(catalogue.belt_block())
    with pytest.raises(DeclarationError, match="speed"):
        continue_cycle(cycle, "speed", (0.1, 1.0))
    with pytest.raises(DeclarationError, match="outside"):
        continue_cycle(cycle, "V", (0.5, 1.0))
    with pytest.raises(DeclarationError, match="not a range"):
        continue_cycle(cycle, "V", (1.0, 0.5))
    with pytest.raises(DeclarationError, match="expected a Cycle"):
        continue_cycle(cycle.trajectory, "V", (0.1, 1.0))  # type: ignore[arg-type]


def test_a_branch_does_not_go_round_for_ever() -> None:
    """One that comes back to a corner has left the curve at a corner, and is not certified."""
    n = 6
    stiffness = 100.0 * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    chain = System(
        "chain",
        parameters={"omega": Parameter(4.0)},
        structures={"u": Structure(np.eye(n), stiffness, 0.05 * np.eye(n) + 0.002 * stiffness)},
        forces={"u[5]": "5*cos(omega*t)"},
        contacts={"c": Contact("d_u[2]", 1.0)},
    )
    branch = continue_cycle(find_cycle(chain), "omega", (3.9, 4.3), time_limit=60)
    assert "time limit" not in branch.message
    corners = [(round(p.value, 7), p.kind, p.note) for p in branch.special]
    assert len(set(corners)) == len(corners) or not branch.certificate.ok
