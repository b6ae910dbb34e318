"""Measures of settled motions against closed forms, published values and cycles found by Newton's
method."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from typer.models import OptionInfo

import stickslip as ss
from stickslip.arrays import Array
from stickslip.cli.common.options import MeasureOptions
from stickslip.model.formats.measurable import MEASURABLE
from stickslip.model.quantities import described
from stickslip.model.system import Inertial, Parameter, System
from stickslip.motion.outcome import Outcome
from stickslip.orbits.cycles.find_cycle import find_cycle
from stickslip.orbits.sensitivities import measured
from stickslip.orbits.settling.motions import Settings
from stickslip.sweeps.request import measures, one_period
from stickslip.sweeps.work.chunk import measure_chunk

LINEAR = System(
    name="linear_oscillator",
    parameters={
        "c": Parameter(0.2, "", "damping", "[0, inf)"),
        "omega": Parameter(1.3, "", "", "(0, inf)"),
    },
    drives={"push": "cos(omega*t)"},
    coordinates={"x": Inertial(force="push")},
    kinetic="d_x**2/2",
    potential="x**2/2",
    viscous="c/2*d_x**2",
)


def facts(system: System, name: str, parameters: dict[str, Array]) -> Array:
    from stickslip.symbolic import expressions as ex

    rows = zip(*parameters.values(), strict=True)
    known = (dict(zip(parameters, map(float, row), strict=True)) for row in rows)
    return np.array(
        [
            ex.evaluate(system.declaration.facts[name], {**system.values, **values})
            for values in known
        ]
    )


def test_block_on_a_belt() -> None:
    """Popov 2010, chapter 12; the belt's work is dissipated: V times the impulse of the friction
    force."""
    system = ss.catalogue.belt_block()
    V = np.array([0.1, 0.2, 0.3, 0.45])
    found = measure_chunk(
        system,
        {},
        {"V": V},
        (
            "period",
            "amplitude",
            "stick_fraction",
            "energy_per_cycle",
            "peak_force",
            "mean_force",
            "switches",
            "speed:x",
        ),
        Settings(),
    )
    period, slip = (facts(system, name, {"V": V}) for name in ("period", "slip_duration"))
    assert np.all(found["outcome"] == Outcome.PERIODIC.code) and np.max(found["certificate"]) < 1e-8
    np.testing.assert_allclose(found["period"], period, rtol=1e-9)
    np.testing.assert_allclose(found["stick_fraction"], 1.0 - slip / period, rtol=1e-9)
    np.testing.assert_allclose(found["amplitude"], np.sqrt(0.4**2 + V**2), rtol=1e-9)
    np.testing.assert_allclose(found["peak_force"], 1.0, rtol=1e-9)
    np.testing.assert_allclose(
        found["energy_per_cycle"], V * found["mean_force"] * period, rtol=1e-8
    )
    np.testing.assert_array_equal(found["switches"], 2.0)
    np.testing.assert_allclose(found["speed:x"], 0.0, atol=1e-9)


def test_crawler() -> None:
    """DeSimone, Gidoni and Noselli 2015: a step per stroke, or none if the stroke is too short:
    that is rest."""
    system = ss.catalogue.two_leg_crawler()
    D = np.linspace(0.1, 1.0, 12)
    found = measure_chunk(system, {}, {"D": D}, ("speed", "period", "lyapunov"), Settings())
    np.testing.assert_allclose(found["speed"], facts(system, "mean_speed", {"D": D}), atol=1e-10)
    walks = found["speed"] > 0.0
    assert np.any(walks) and np.array_equal(found["outcome"] == Outcome.AT_REST.code, ~walks)
    np.testing.assert_allclose(found["period"], np.where(walks, 2.0 * np.pi, np.nan), rtol=1e-12)
    # a change of the state is forgotten at the first slip, or for ever
    assert np.all(found["lyapunov"] == -np.inf)


def test_scaled_slider() -> None:
    """Reference 9: slip and stick of (3.6) from 40-digit arithmetic; a kink is crossed twice, no
    contact switches."""
    system = ss.catalogue.scaled_slider_limit(nu=0.01, b=1.0)
    found = measure_chunk(
        system, {"gamma": np.array([0.4, 2.0])}, {}, ("period", "switches", "lyapunov"), Settings()
    )
    np.testing.assert_allclose(
        found["period"], 0.38862420022020717876 + 7.0673964441879574179, rtol=1e-9
    )
    np.testing.assert_array_equal(found["switches"], 0.0)
    np.testing.assert_allclose(found["lyapunov"], 0.0, atol=1e-6)


def test_den_hartog() -> None:
    """Non-stop motion of the forced oscillator, Den Hartog 1931."""
    system = ss.catalogue.forced_oscillator(F_c=0.3)
    r = np.array([0.8, 1.2])
    found = measure_chunk(
        system, {}, {"omega": r}, ("amplitude", "period", "stick_fraction"), Settings()
    )
    np.testing.assert_allclose(found["amplitude"], [2.626105, 2.072384], rtol=1e-6)
    np.testing.assert_allclose(found["period"], 2.0 * np.pi / r, rtol=1e-12)
    np.testing.assert_allclose(found["stick_fraction"], 0.0, atol=1e-12)


def test_linear_oscillator() -> None:
    """Amplitude 1/|1 − ω² + icω|, exponent −c/2; without contacts nothing sticks."""
    c, omega = np.array([0.1, 0.3, 0.5]), np.array([0.7, 1.0, 1.4])
    found = measure_chunk(
        LINEAR,
        {},
        {"c": c, "omega": omega},
        ("amplitude", "lyapunov", "stick_fraction"),
        Settings(),
    )
    np.testing.assert_allclose(
        found["amplitude"], 1.0 / np.abs(1.0 - omega**2 + 1j * c * omega), rtol=1e-7
    )
    np.testing.assert_allclose(found["lyapunov"], -c / 2.0, rtol=0.02)
    np.testing.assert_array_equal(found["stick_fraction"], 0.0)


@pytest.mark.parametrize(
    ("system", "start", "parameters"),
    [
        (
            ss.catalogue.rocking_toy(),
            {"psi": 0.0, "d_psi": 1.8, "x_R": 0.0},
            {"P": 1.0, "delta": 0.04},
        ),
        (
            ss.catalogue.spring_slider(mu="2/sqrt(alpha)", nu=0.05),
            {"U": 1.0, "alpha": 1.5},
            {"V": 0.15},
        ),
        (
            ss.catalogue.spring_slider(mu="1.5 - tanh(alpha - 1.5)", nu=0.05),
            {"U": 1.2, "alpha": 1.6},
            {"V": 0.7205},
        ),
    ],
    ids=["toy", "stick-slip", "smooth"],
)
def test_cycles_of_newton(
    system: System, start: dict[str, float], parameters: dict[str, float]
) -> None:
    asked = [
        "period",
        "stick_fraction",
        "energy_per_cycle",
        *(f"amplitude:{x}" for x in system.declaration.state),
    ]
    asked += ["speed"] if system.translation else []
    point = [{k: np.array([v]) for k, v in given.items()} for given in (start, parameters)]
    measured = measure_chunk(system, point[0], point[1], asked, Settings())
    found = {name: float(v[0]) for name, v in measured.items()}
    cycle = find_cycle(system, start, parameters=parameters)
    assert found["outcome"] == Outcome.PERIODIC.code and found["certificate"] < 1e-8
    assert found["period"] == pytest.approx(cycle.period, rel=1e-7)
    assert found["stick_fraction"] == pytest.approx(cycle.stick_time / cycle.period, abs=1e-7)
    lost = sum(share.dissipated for share in cycle.contacts.values())
    assert found["energy_per_cycle"] == pytest.approx(lost, rel=1e-7)
    if system.translation:
        assert found["speed"] == pytest.approx(cycle.speed, rel=1e-7)
    for name, (low, high) in cycle.extrema.items():
        if name not in system.translation:
            assert found[f"amplitude:{name}"] == pytest.approx(0.5 * (high - low), rel=1e-6)


def test_published_walking_speed() -> None:
    """Section 6 of the notes on [M]: period 5.969, v = 0.1675, amplitude 1.6236; rest beside it."""
    system = ss.catalogue.rocking_toy()
    start = {"psi": np.zeros(2), "d_psi": np.array([1.8, 0.4]), "x_R": np.zeros(2)}
    found = measure_chunk(
        system, start, {}, ("speed", "period", "amplitude:psi", "stick_fraction"), Settings()
    )
    assert list(found["outcome"]) == [Outcome.PERIODIC.code, Outcome.AT_REST.code]
    np.testing.assert_allclose(found["speed"], [0.1675, 0.0], atol=5e-5)
    assert found["period"][0] == pytest.approx(5.969, abs=5e-4) and np.isnan(found["period"][1])
    assert (
        found["amplitude:psi"][0] == pytest.approx(1.6236, abs=5e-5)
        and found["amplitude:psi"][1] < 1e-6
    )
    assert found["stick_fraction"][1] == 1.0


def test_steady_sliding_and_motions_that_do_not_settle() -> None:
    """(3.3) beyond its Hopf point is an equilibrium; a block that never sticks oscillates without
    damping."""
    slider = ss.catalogue.spring_slider(mu="1.5 - tanh(alpha - 1.5)", nu=0.05)
    found = measure_chunk(
        slider, {"U": np.array([1.2])}, {"V": np.array([0.8])}, ("amplitude", "period"), Settings()
    )
    assert (
        found["outcome"][0] == Outcome.STEADY.code
        and found["amplitude"][0] < 1e-6
        and np.isnan(found["period"][0])
    )
    block = measure_chunk(
        ss.catalogue.belt_block(),
        {"x": np.array([0.5])},
        {"V": np.array([0.9])},
        ("amplitude", "speed:x"),
        Settings(max_time=500.0),
    )
    assert block["outcome"][0] == Outcome.UNDAMPED.code and block["certificate"][0] < 1e-9


def test_root_mean_squares_are_those_of_a_wave() -> None:
    """Of x = Re(z exp(iωt)), where z = 1/(1 − ω² + icω)."""
    omega = np.array([0.7, 1.3, 2.0])
    names = ["rms:x", "rms:d_x", "rms:x + 1", "rms:2*x*d_x", "mean:x**2", "rms"]
    found = ss.sweep(LINEAR, {"omega": omega}, names, settings=Settings(tolerance=1e-9))
    size = np.abs(1.0 / (1.0 - omega**2 + 0.2j * omega))
    expected = {
        "rms:x": size / np.sqrt(2.0),
        "rms:d_x": omega * size / np.sqrt(2.0),
        "rms:x + 1": np.sqrt(1.0 + size**2 / 2.0),
        "rms:2*x*d_x": omega * size**2 / np.sqrt(2.0),
        "mean:x**2": size**2 / 2.0,
        "rms": size / np.sqrt(2.0),
    }
    for name, values in expected.items():
        np.testing.assert_allclose(found[name], values, rtol=1e-6, err_msg=name)


def test_crest_factors_are_those_of_a_wave() -> None:
    """Of a sinusoid √2; of x + 1, if a is the amplitude of x, (1 + a)/√(1 + a²/2); of |x| + x, a
    rectified sinusoid, 2; of a constant 1; of zero it does not exist."""
    omega = np.array([0.7, 1.3, 2.0])
    size = np.abs(1.0 / (1.0 - omega**2 + 0.2j * omega))
    expected = {
        "crest": np.sqrt(2.0),
        "crest:x": np.sqrt(2.0),
        "crest:d_x": np.sqrt(2.0),
        "crest:-3*x": np.sqrt(2.0),
        "crest:2*x*d_x": np.sqrt(2.0),
        "crest:x + 1": (1.0 + size) / np.sqrt(1.0 + size**2 / 2.0),
        "crest:-x - 1": (1.0 + size) / np.sqrt(1.0 + size**2 / 2.0),
        "crest:abs(x) + x": 2.0,
        "crest:-2": 1.0,
        "crest:0*x": np.nan,
    }
    found = ss.sweep(LINEAR, {"omega": omega}, [*expected], settings=Settings(tolerance=1e-9))
    for name, values in expected.items():
        np.testing.assert_allclose(found[name], np.broadcast_to(values, 3), rtol=1e-6, err_msg=name)
    toy = ss.catalogue.rocking_toy()
    units = {name: described(toy, name)["units"] for name in ("crest:x_R", "crest:d_x_R")}
    assert units == {"crest:x_R": "1", "crest:d_x_R": "1"}


def test_every_measure_is_described() -> None:
    assert set(measures._SUMMED) | set(one_period.RULES) == set(MEASURABLE)
    system = ss.catalogue.rocking_toy()
    named = {
        name: f"{name}:x_R" if row.of == "component" else name for name, row in MEASURABLE.items()
    }
    assert all(described(system, text)["long_name"] for text in named.values())
    shown = next(one.help for one in get_args(MeasureOptions) if isinstance(one, OptionInfo))
    assert str(shown).startswith(f"Measure: {', '.join(MEASURABLE)}; ")
    differentiable = set(re.findall(r'``"(\w+)', str(ss.Cycle.sensitivity.__doc__)))
    assert differentiable == set(measured._RULES)


def test_the_longest_cycle_is_a_setting() -> None:
    """A step of the toy has more than four events: whoever compares each with only four before it
    does not see it."""
    start = {"psi": np.zeros(1), "d_psi": np.full(1, 1.8), "x_R": np.zeros(1)}
    for longest, outcome in ((4, Outcome.NOT_SETTLED), (16, Outcome.PERIODIC)):
        settings = Settings(longest_cycle=longest, max_time=600.0)
        found = measure_chunk(ss.catalogue.rocking_toy(), start, {}, ("period",), settings)
        assert found["outcome"][0] == outcome.code


def test_moving_frame() -> None:
    """A shaken plate pulled at a speed: it follows the pull on average, in a cycle up to a
    shift."""
    system = ss.catalogue.plate_compactor()
    V = np.array([0.03, 0.05, 0.08])
    found = measure_chunk(
        system, {}, {"V": V}, ("speed:x", "period", "mean_force", "energy_per_cycle"), Settings()
    )
    assert np.all(found["outcome"] == Outcome.PERIODIC.code)
    np.testing.assert_allclose(found["speed:x"], V, rtol=1e-8)
    turns = found["period"] * 60.0 / (2.0 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns), rtol=1e-12)
    # The work of the pull is the mean spring force times the way, and all of it is dissipated.
    np.testing.assert_allclose(
        found["energy_per_cycle"], -found["mean_force"] * V * found["period"], rtol=1e-6
    )


def test_harmonics_are_the_transfer_function() -> None:
    """Of place and velocity of a linear oscillator, at the frequency of what drives it."""
    omega = np.linspace(0.3, 2.5, 12)
    asked = ("harmonic", "harmonic:d_x", "phase", "relative_phase", "relative_phase:x")
    found = measure_chunk(LINEAR, {}, {"omega": omega}, asked, Settings())
    transfer = 1.0 / (1.0 - omega**2 + 0.2j * omega)
    np.testing.assert_allclose(found["harmonic"], np.abs(transfer), rtol=1e-9)
    np.testing.assert_allclose(found["harmonic:d_x"], omega * np.abs(transfer), rtol=1e-9)
    for name in asked[2:]:  # the drive is a cosine
        np.testing.assert_allclose(found[name], np.angle(transfer), atol=1e-9)
    sine = replace(LINEAR, drives={"push": "sin(omega*t)"})
    found = measure_chunk(sine, {}, {"omega": omega}, ("phase", "relative_phase"), Settings())
    np.testing.assert_allclose(found["relative_phase"], np.angle(transfer), atol=1e-9)
    behind = np.exp(1j * (found["phase"] - np.angle(transfer) + np.pi / 2.0))
    np.testing.assert_allclose(behind, 1.0, atol=1e-9)
    cycle = find_cycle(sine, parameters={"omega": float(omega[3])})
    assert cycle.relative_phase["x"] == pytest.approx(np.angle(transfer[3]), abs=1e-9)


def test_harmonic_of_a_friction_force() -> None:
    """A block that never sticks rubs like a square wave, whose first harmonic is 4/π of it and
    stands against the velocity."""
    system = ss.catalogue.forced_oscillator(P=1.0, F_c=0.3)
    contact = next(iter(system.dry_contacts))
    force = f"friction_{contact}"
    asked = (f"harmonic:{force}", f"phase:{force}", "phase:d_x", "stick_fraction")
    found = measure_chunk(system, {}, {"omega": np.array([0.7, 1.4])}, asked, Settings())
    np.testing.assert_array_equal(found["stick_fraction"], 0.0)
    np.testing.assert_allclose(found[f"harmonic:{force}"], 4.0 / np.pi * 0.3, rtol=1e-9)
    period = 2.0 * np.pi / np.array([0.7, 1.4])
    for i, T in enumerate(period):
        cycle = find_cycle(system, parameters={"omega": 2.0 * np.pi / T})
        c = cycle.harmonic["d_x"]
        assert found["phase:d_x"][i] == pytest.approx(np.angle(c), abs=1e-8)
        assert cycle.harmonic["x"] * 2j * np.pi / T == pytest.approx(c, rel=1e-8)


def test_no_wave_at_rest() -> None:
    """Where nothing moves there is no harmonic, and no phase of one."""
    system = ss.catalogue.forced_oscillator(P=0.2, F_c=1.0)
    found = measure_chunk(
        system, {}, {"omega": np.array([0.7])}, ("harmonic", "relative_phase"), Settings()
    )
    assert found["harmonic"][0] == 0.0 and np.isnan(found["relative_phase"][0])


def test_energy_per_distance() -> None:
    """Each leg of the crawler goes forward against f₊ (DeSimone et al. 2015); a plate that is
    shaken and pulled takes the mean force of the pull."""
    crawler = ss.catalogue.two_leg_crawler()
    f_plus = np.array([0.05, 0.1, 0.3])
    asked = ("energy_per_distance", "cost_of_transport:k*D", "energy_per_distance:x_1")
    found = measure_chunk(crawler, {}, {"f_plus": f_plus}, asked, Settings())
    for name in asked:
        np.testing.assert_allclose(found[name], 2.0 * f_plus, rtol=1e-9)
    gait = find_cycle(crawler)
    assert gait.cost_of_transport("2*k*D") == pytest.approx(0.1, rel=1e-9)
    branch = ss.continue_cycle(gait, "f_plus", (0.05, 0.2)).points
    np.testing.assert_allclose(branch["energy_per_distance"], 2.0 * branch["f_plus"], rtol=1e-9)
    plate = ss.catalogue.plate_compactor()
    V = np.array([0.03, 0.08])
    asked = ("energy_per_distance:x", "mean_force")
    found = measure_chunk(plate, {}, {"V": V}, asked, Settings())
    np.testing.assert_allclose(found[asked[0]], -found["mean_force"], rtol=1e-6)
    still = measure_chunk(crawler, {}, {"D": np.array([0.1])}, ("energy_per_distance",), Settings())
    assert np.isnan(still["energy_per_distance"][0])


@pytest.mark.parametrize(
    ("system", "name", "said"),
    [
        ("two_leg_crawler", "cost_of_transport", "the weight is missing"),
        ("two_leg_crawler", "cost_of_transport:k", "N/m, but a weight has the unit N"),
        (
            "two_leg_crawler",
            "cost_of_transport:k*D/2",
            "which is not allowed in the name of a variable",
        ),
        ("two_leg_crawler", "cost_of_transport:-k*D", "Give a positive weight"),
        ("two_leg_crawler", "relative_phase:d_x", "unknown quantity 'd_x'"),
        ("belt_block", "relative_phase", "has no drive"),
        ("belt_block", "energy_per_distance", "declares no translation"),
        ("plate_compactor", "relative_phase", "does not oscillate"),
    ],
)
def test_measures_of_a_period_that_cannot_be(system: str, name: str, said: str) -> None:
    with pytest.raises(ss.DeclarationError, match=said):
        measures.needs_close_look(getattr(ss.catalogue, system)(), [name])


def test_a_load_that_does_not_repeat() -> None:
    """The play rests at first, while its threshold oscillates and its load runs away: that is no
    cycle."""
    found = measure_chunk(
        ss.catalogue.oscillating_play(), {}, {}, ("period",), Settings(max_time=5.0)
    )
    assert found["outcome"][0] == Outcome.NOT_SETTLED.code and found["certificate"][0] < 1e-9


def test_waiting_for_a_load_is_not_rest() -> None:
    """A play under a slowly growing load rests for many looks before it moves."""
    play = ss.catalogue.oscillating_play(rho="1", ell="t**2/1000")
    waiting = measure_chunk(play, {}, {}, ("stick_fraction",), Settings(max_time=20.0))
    assert waiting["outcome"][0] == Outcome.NOT_SETTLED.code and waiting["stick_fraction"][0] == 1.0
    still = measure_chunk(
        ss.catalogue.oscillating_play(rho="1", ell="1/2"), {}, {}, ("stick_fraction",), Settings()
    )
    assert still["outcome"][0] == Outcome.AT_REST.code
