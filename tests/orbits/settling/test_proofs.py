"""What maps prove: least periods, what is not damped, starts that friction cannot hold, and that
nothing is missed."""

from __future__ import annotations

import math

import numpy as np
import pytest

import stickslip as ss
from stickslip import Contact, Inertial, Parameter, System
from stickslip.arrays import Array
from stickslip.figures.sweep import plot_sweep
from stickslip.motion.modes.guards import extended_word
from stickslip.motion.outcome import Outcome
from stickslip.orbits.settling.motions import Settings
from stickslip.sweeps.work.chunk import measure_chunk
from sweeps.test_basin import jenkins


def outcomes(found: dict[str, Array]) -> set[Outcome]:
    return {Outcome.from_code(int(code)) for code in found["outcome"]}


def test_an_oscillation_with_a_stuck_damper_has_the_period_of_its_drive() -> None:
    """Light damping brings returns close after 2, 3, 4, 10 periods, long before the first one
    is."""
    omega = np.linspace(0.70, 0.90, 41)
    found = measure_chunk(
        jenkins(), {}, {"omega": omega}, ("period", "amplitude", "stick_fraction"), Settings()
    )
    assert outcomes(found) == {Outcome.PERIODIC} and not np.any(found["lacking"])
    np.testing.assert_allclose(found["period"], 2.0 * np.pi / omega, rtol=1e-12)
    np.testing.assert_allclose(
        found["amplitude"], 0.3 / np.abs(1.5 - omega**2 + 0.02j * omega), rtol=1e-8
    )
    np.testing.assert_array_equal(found["stick_fraction"], 1.0)


def test_undamped_is_proved_or_not_said() -> None:
    start = {"x": np.linspace(0.1, 0.9, 3), "z": np.linspace(0.1, 0.9, 3)}
    free = measure_chunk(
        jenkins(), start, {"c": np.zeros(3), "F": np.zeros(3)}, ("amplitude",), Settings()
    )
    assert outcomes(free) == {Outcome.UNDAMPED} and not np.any(free["lacking"])
    np.testing.assert_allclose(free["amplitude"], start["x"] - 0.5 * start["z"] / 1.5, rtol=1e-3)
    driven = measure_chunk(jenkins(c=0.0, F=0.05), start, {}, ("amplitude",), Settings())
    assert outcomes(driven) == {Outcome.UNDAMPED}
    damped = measure_chunk(jenkins(c=1e-9, F=0.0), start, {}, ("amplitude",), Settings())
    assert outcomes(damped) == {Outcome.AT_REST}
    hard = System(
        name="hard spring",
        parameters={"omega": Parameter(0.7), "F": Parameter(0.1)},
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="x**2/2 + x**4/4 - F*cos(omega*t)*x",
        contacts={"brake": Contact("d_x", 0.0)},
        span=(0, 20),
    )
    unknown = measure_chunk(
        hard, {"x": np.array([0.5, 1.0])}, {}, ("amplitude",), Settings(max_time=300.0)
    )
    assert outcomes(unknown) == {Outcome.NOT_SETTLED} and np.all(unknown["lacking"] > 0)


def test_the_picture_says_which_starts_friction_does_not_hold() -> None:
    """The default start of the toy, x_R − x_L = −0.8 at ψ = 0.8, is beyond what friction holds for
    P > 1.54."""
    data = ss.sweep(
        ss.catalogue.rocking_toy(), {"P": np.linspace(0.8, 1.6, 9), "delta": [0.02, 0.1]}, ["speed"]
    ).dataset
    outside = data["outcome"].values == Outcome.OUTSIDE.code
    assert np.array_equal(np.any(outside, axis=1), np.linspace(0.8, 1.6, 9) > 1.54)
    assert data["excess"].values[-1] == pytest.approx(0.06)
    figure = plot_sweep(data)
    legends = [*figure.legends, *(axes.get_legend() for axes in figure.axes)]
    said = " ".join(text.get_text() for legend in legends if legend for text in legend.get_texts())
    assert "outside the stable set |∂Φ| ≤ s, by up to 0.06 N" in said.replace("\n", " ")


def test_modes_of_many_contacts_and_kinks_are_told_apart() -> None:
    contacts, kinks = 60, 200
    kinds = set()
    for c in range(contacts):
        for mode in (-1, 1):
            kinds.add(extended_word(1, np.eye(contacts, dtype=int)[c] * mode, np.ones(kinks, int)))
    for k in range(kinks):
        kinds.add(extended_word(1, np.zeros(contacts, int), 1 - np.eye(kinks, dtype=int)[k]))
    assert len(kinds) == 2 * contacts + kinks


def kicked() -> System:
    """A block on the ground that is kicked once in a period, for an instant: it slides I²/(2F_s)
    and stops."""
    values = {"omega": 1.0, "phi": 3.0, "w": 1e-3, "I": 1.0, "F_s": 0.5}
    return System(
        name="kicked",
        parameters={name: Parameter(value) for name, value in values.items()},
        drives={"kick": "I*omega/(w*sqrt(2*pi))*exp(-2*(sin((omega*t - phi)/2)/w)**2)"},
        coordinates={"x": Inertial(force="kick")},
        kinetic="d_x**2/2",
        contacts={"ground": Contact("d_x", "F_s")},
        translation={"x": 1},
        span=(0, 50),
    )


def test_no_kick_is_missed() -> None:
    """Between kicks nothing moves and no formula shows that one will come: exp(−10⁶) is zero."""
    phi, w = (part.ravel() for part in np.meshgrid([0.1, 1.0, 3.0, 5.0, 6.2], [1e-2, 1e-3, 1e-4]))
    measures = ("speed", "period", "energy_per_cycle", "switches", "stick_fraction")
    found = measure_chunk(
        kicked(), {}, {"phi": phi, "w": w, "omega": np.full(15, 0.5)}, measures, Settings()
    )
    assert outcomes(found) == {Outcome.PERIODIC} and not np.any(found["lacking"])
    period = 4.0 * math.pi
    np.testing.assert_allclose(found["period"], period, rtol=1e-12)
    # A kick is above the threshold for a time of about w √(log 1/w).
    assert np.all(
        np.abs(found["speed"] * period - 1.0 / (2.0 * 0.5)) < 4.0 * w * np.sqrt(np.log(1.0 / w))
    )
    np.testing.assert_allclose(found["energy_per_cycle"], 0.5 * found["speed"] * period, rtol=1e-9)
    np.testing.assert_allclose(found["stick_fraction"], 1.0 - 2.0 / period, rtol=0.1)
    np.testing.assert_array_equal(found["switches"], 2.0)


def test_no_kick_is_missed_in_a_basin() -> None:
    """A block whose spring holds it is kicked out of any place of rest."""
    held = System(
        name="held",
        parameters={},
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="x**2/2 - 400*exp((cos(t - 3) - 1)/1e-6)*x",
        viscous="d_x**2/10",
        contacts={"ground": Contact("d_x", 0.3)},
        span=(0, 50),
    )
    found = ss.basin(held, {"x": "-0.2:0.2:3", "d_x": "-0.1:0.1:2"}).dataset
    assert found["kind"].values.tolist() == ["cycle"]
    assert found["certified"].values.all() and np.all(found["attractor"].values == 0)
    kick = 400.0 * 1e-3 * math.sqrt(2.0 * math.pi)
    assert found["high_x"].values[0] > 0.3 * kick
