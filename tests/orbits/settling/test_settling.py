"""What is said of a motion that settles on no cycle: rest where it is proved, families, irregular
motion."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from orbits.examples import SLIDER, dragged, isola, stribeck_belt
from stickslip import Contact, Inertial, System, Table, Viscous, catalogue, simulate, sweep
from stickslip.errors import ConvergenceError
from stickslip.model.system import Internal
from stickslip.motion.outcome import Outcome
from stickslip.orbits.cycles.find_cycle import find_cycle
from stickslip.orbits.cycles.lyapunov import largest_exponent
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.return_map.families import Family
from stickslip.orbits.return_map.recurrence import window
from stickslip.orbits.settling.resting import MotionPoint, rest_near
from systems import oscillator, parameters


def rest_of(
    system: System, span: tuple[float, float], start: dict[str, float], values: dict[str, float]
):
    """The state near which the end of a motion is proved to rest."""
    motion = simulate(system, span, initial=start, parameters=values)
    pieces = Pieces(motion.problem.compiled.equations)
    w, k = window(motion, pieces), motion.knots
    assert w.symmetry.frame is not None
    point = MotionPoint(
        float(k.time[-1]),
        k.state[-1],
        np.array(list(motion.parameters.values())),
        k.mode[-1],
        k.region[-1],
        np.max(np.abs(w.states), axis=0),
        w.symmetry.frame,
        w.symmetry.shifts.T,
    )
    return rest_near(pieces, point)


# -- rest ------------------------------------------------------------------------------------------


def test_a_load_that_goes_on_rising() -> None:
    """The plate keeps still at first; its spring is pulled on and on, and in the end it moves, as
    fast as the pull.

    Every period of the shaking it slips a little while its weight is least.
    """
    system = catalogue.plate_compactor(F=800, V=0.005)
    still = simulate(system, (0, 4))
    assert still.n_switches == 0
    cycle = find_cycle(system)
    assert cycle.certificate.ok, cycle.certificate.describe()
    assert cycle.speed == pytest.approx(0.005, rel=1e-12)
    late = simulate(system, (0, 40)).at(np.array([30.0, 40.0]))["x"]
    assert (late[1] - late[0]) / 10.0 == pytest.approx(0.005, rel=1e-2)
    assert cycle.period == pytest.approx(2 * math.pi / 60.0, rel=1e-14)


def test_a_very_slow_belt() -> None:
    """Nothing happens for 10⁹ s: the block is carried along, and that is no rest."""
    with pytest.raises(
        ConvergenceError, match=r"no cycle was found within t = 6350: .* never returns"
    ) as e:
        find_cycle(catalogue.belt_block(V=1e-9))
    assert "rest" not in str(e.value)


def test_a_beat_that_moves_only_now_and_then() -> None:
    """Held for most of a beat of 63 s and not in its middle: over ten seconds everything is
    still."""
    system = System(
        name="beat",
        parameters=parameters(F=0.55, c=0.1),
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="x**2/2 - F*(cos(2*t) - cos(2.1*t))*x",
        viscous="c/2*d_x**2",
        contacts={"ground": Contact("d_x", "1")},
        span=(0, 10),
    )
    assert simulate(system, (0, 10)).n_switches == 0
    cycle = find_cycle(system)
    assert cycle.certificate.ok, cycle.certificate.describe()
    assert cycle.period == pytest.approx(20 * math.pi, rel=1e-12)
    assert cycle.slip_time > 0.0


@pytest.mark.parametrize(
    ("system", "span", "start", "values", "expected"),
    [
        # Steady sliding that attracts, from a distance at which it is a contraction.
        (SLIDER, (0.0, 60.0), {"U": 1.65}, {"V": 0.3}, None),
        (
            stribeck_belt(),
            (0.0, 300.0),
            {"x": 0.52, "d_x": 0.0},
            {"V": 3.0},
            (0.5 + 0.5 * math.exp(-6.0), 0.0),
        ),
        # No contact acts: its friction is 0.
        (oscillator(), (0.0, 900.0), {"x": 1.0}, {"mu": 0.0, "F": 0.0, "c": 0.05}, (0.0, 0.0)),
        (isola(), (0.0, 400.0), {"x": 0.05, "y": 0.0}, {"a": 1.5}, (0.0, 0.0)),
        # Stuck, and the rest rocks less and less.
        (catalogue.rocking_toy(), (0.0, 300.0), {"psi": 0.1, "x_R": 0.0}, {}, None),
    ],
)
def test_rest_that_is_proved(
    system: System,
    span: tuple[float, float],
    start: dict[str, float],
    values: dict[str, float],
    expected: tuple[float, ...] | None,
) -> None:
    """Rest is what a much longer motion tends to."""
    found = rest_of(system, span, start, values)
    assert found is not None
    later = simulate(
        system, (span[0], 10.0 * span[1]), initial=start, parameters=values
    ).knots.state[-1]
    assert found == pytest.approx(later, abs=1e-3)
    if expected is not None:
        assert found == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("system", "span", "start", "values"),
    [
        (stribeck_belt(), (0.0, 100.0), {"x": 0.9, "d_x": 1.0}, {"V": 1.0}),  # a cycle
        # next to steady sliding that repels
        (stribeck_belt(), (0.0, 1.0), {"x": 0.5, "d_x": 0.0}, {"V": 1.0}),
        # too far from one that attracts
        (stribeck_belt(), (0.0, 1.0), {"x": 1.5, "d_x": 0.0}, {"V": 3.0}),
        (oscillator(), (0.0, 50.0), {"x": 1.0}, {"mu": 0.0, "F": 0.0}),  # undamped oscillation
        (dragged(), (0.0, 2.0), {}, {}),  # stuck while its spring is pulled
    ],
)
def test_rest_that_is_not_proved(
    system: System, span: tuple[float, float], start: dict[str, float], values: dict[str, float]
) -> None:
    assert rest_of(system, span, start, values) is None


def test_rest_under_a_periodic_load() -> None:
    """A load below the friction: seen over a whole period of it, nothing moves, so nothing ever
    will."""
    with pytest.raises(ConvergenceError, match=r"comes to rest: .* it stays near x = 0.1, d_x = 0"):
        find_cycle(oscillator(), {"x": 0.1}, parameters={"mu": 0.5, "F": 0.3})
    with pytest.raises(ConvergenceError, match=r"comes to rest: from t = 0 it stays near x = 0"):
        find_cycle(catalogue.forced_oscillator(F_c=1.2))


def test_rest_under_a_slow_load() -> None:
    """A load whose period is 628: what it can do is bounded, so that nobody has to wait for it."""
    values = {"mu": 0.5, "F": 0.39, "omega": 0.01}
    with pytest.raises(ConvergenceError, match="comes to rest"):
        find_cycle(oscillator(), {"x": 0.1}, parameters=values)
    assert (
        simulate(oscillator(), (0.0, 3000.0), initial={"x": 0.1}, parameters=values).n_switches == 0
    )
    moved = find_cycle(oscillator(), {"x": 0.1}, parameters={**values, "F": 0.7})
    assert moved.slip_time > 0.0


def test_dying_out_is_not_rest() -> None:
    """x' = −x³ falls like 1/√t: no linear motion decays there, and rest is not claimed."""
    system = System(
        name="slow", internal={"x": Internal("-x**3")}, initial={"x": 0.3}, span=(0, 1000)
    )
    with pytest.raises(ConvergenceError, match="it decays") as e:
        find_cycle(system)
    assert "rest" not in str(e.value)


# -- families --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("r", "F_c"), [(0.5, 0.2), (0.25, 0.05)])
@pytest.mark.parametrize("x", [0.0, 2.0])
def test_marginally_stable_cycles(r: float, F_c: float, x: float) -> None:
    """G. Csernák, G. Stépán, S. W. Shaw (2007): a continuum of asymmetric cycles at Ω = 1/(2n),
    which is said."""
    system = catalogue.forced_oscillator(F_c=F_c, omega=r)
    with pytest.raises(
        Family, match=r"the cycles form a continuous family.*marginally stable"
    ) as e:
        find_cycle(system, {"x": x})
    assert "did not converge" not in str(e.value)
    # The one that is named closes, and so does its neighbour along the direction that is named.
    text = str(e.value)
    named = re.search(r"the cycle of period ([\d.]+)", text)
    assert named is not None
    assert float(named[1]) == pytest.approx(2 * math.pi / r, rel=1e-8)


def test_members_of_the_family() -> None:
    """From rest at the right phase of the load, at any place between the edges, the motion comes
    back at once."""
    system = catalogue.forced_oscillator(F_c=0.2, omega=0.5)
    for x in (1.25, 1.3333, 1.45):
        last = simulate(system, (0.0, 4 * math.pi), initial={"x": x}).final
        assert (last["x"], last["d_x"]) == pytest.approx((x, 0.0), abs=1e-12)
        with pytest.raises(Family):
            find_cycle(system, {"x": x})
    last = simulate(system, (0.0, 4 * math.pi), initial={"x": 1.15}).final
    assert abs(last["x"] - 1.15) > 1e-3


def test_families_have_neighbours_that_are_none() -> None:
    """Just beside Ω = 1/2 one cycle attracts all."""
    cycle = find_cycle(catalogue.forced_oscillator(F_c=0.2, omega=0.47))
    assert cycle.stable
    assert cycle.certificate.ok, cycle.certificate.describe()


# -- irregular motion ------------------------------------------------------------------------------


@pytest.mark.parametrize("start", [0.07, 0.089, 0.1])
def test_irregular_motion_is_said_to_be(start: float) -> None:
    with pytest.raises(ConvergenceError) as e:
        find_cycle(catalogue.block_chain(N=3), {"x_1": start})
    text = str(e.value)
    assert "no cycle was found within t = 12700" in text
    found = re.search(
        r"the motion appears chaotic: its largest Lyapunov exponent is (\d\.\d+) ± (\d\.\d+)", text
    )
    assert found is not None
    assert 0.0 < float(found[2]) < float(found[1]) < 0.2
    assert "Newton" not in text


def test_lyapunov_exponent_of_a_cycle() -> None:
    """0 along the motion: nothing parts."""
    motion = simulate(SLIDER, (0, 2000), parameters={"V": 0.2})
    pieces = Pieces(motion.problem.compiled.equations)
    found = largest_exponent(motion, pieces, window(motion, pieces).sizes)
    assert found is not None
    assert found.value == pytest.approx(0.0, abs=2e-3)
    assert not found.irregular


def test_lyapunov_exponent_of_two_neighbours() -> None:
    """Duffing's oscillator, irregular: two motions part as fast as the exponent says."""
    system = System(
        name="Duffing, irregular",
        parameters=parameters(F=0.5, c=0.3, omega=1.2),
        coordinates={"x": Inertial(), "y": Viscous()},
        kinetic="d_x**2/2",
        potential="x**4/4 - x**2/2 - F*cos(omega*t)*x + y**2/2",
        viscous="c/2*d_x**2 + d_y**2/2",
        span=(0, 100),
    )
    motion = simulate(system, (0, 6000), initial={"x": 0.1, "d_x": 0.2})
    pieces = Pieces(motion.problem.compiled.equations)
    found = largest_exponent(motion, pieces, window(motion, pieces).sizes)
    assert found is not None
    assert found.irregular
    growth = []
    state = motion.at(100.0)
    names = ("x", "d_x", "y")
    start = {name: state[name] for name in names}
    for n in range(150):
        t = 10.0 * n
        beside = {**start, "x": start["x"] + 1e-7}
        one, other = (simulate(system, (t, t + 10.0), initial=s).final for s in (start, beside))
        growth.append(
            math.log(math.dist([one[x] for x in names], [other[x] for x in names]) / 1e-7)
        )
        start = {name: one[name] for name in names}
    # The neighbour is put back along x each time, which loses some growth; the order is the same.
    assert np.mean(growth) / 10.0 == pytest.approx(found.value, abs=0.06)


@pytest.mark.parametrize("n", [2, 3, 5])
def test_what_may_be_moved_along_several_axes_is_settled(n: int) -> None:
    """The shifts that leave it unchanged came as columns, which compiled code does not take."""
    names = [f"x{i}" for i in range(n)]
    sum_of_all = " + ".join(names)
    system = System(
        "held together",
        coordinates={name: Inertial() for name in names},
        kinetic=" + ".join(f"d_{name}**2/2" for name in names),
        potential=f"({sum_of_all})**2",
    )
    with pytest.raises(ConvergenceError, match="the motion comes to rest"):
        find_cycle(system, simulate(system, (0.0, 20.0)))


def test_an_equilibrium_at_a_knot() -> None:
    """Around a knot of a table an oscillation that dies out has events without end. It became so
    small that its period was halved for ever."""
    speeds, values = [0.0, 0.1, 0.2, 0.35, 0.75], [0.46, 0.379, 0.338, 0.312, 0.299]
    pad = System(
        "pad",
        parameters=parameters(V=0.2, N=2.0),
        tables={"mu": Table(speeds, values, kind="pchip")},
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="200*x**2",
        viscous="0.3*d_x**2",
        contacts={"disc": Contact("d_x", "0.46*N", "V", kinetic="N*mu(speed)")},
        span=(0.0, 10.0),
    )
    found = sweep(pad, {"V": [0.2, 0.21, 0.35]}, ["amplitude:x"], time_limit=60.0)
    assert np.all(found["outcome"].values == Outcome.STEADY.code)
    assert found.certificate.ok
    assert np.all(found["amplitude:x"].values < 1e-9)
