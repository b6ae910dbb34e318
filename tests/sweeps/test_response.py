"""Frequency responses: lines, sweeps and largest responses against independent solutions."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from oracles import den_hartog
from oracles.jenkins import Jenkins, Response, response
from orbits.examples import dragged, jenkins
from stickslip import Cycle, FrequencyResponse, Inertial, System, catalogue, frequency_response
from stickslip import open as open_result
from stickslip.errors import DeclarationError
from stickslip.results import Completion
from stickslip.sweeps.carried import carried
from systems import parameters

LEVELS = [0.3, 0.8, 1.5]
SPAN = (0.6, 1.8)
POINTS = 50


@cache
def damped() -> FrequencyResponse:
    return frequency_response(jenkins(), "omega", SPAN, levels={"F": LEVELS}, points=POINTS)


@cache
def expected(F: float) -> list[Response]:
    """Of the oracle, at the frequencies of the sweeps."""
    found: list[Response] = []
    start = None
    for omega in np.linspace(*SPAN, POINTS):
        r = response(Jenkins(F=F, omega=float(omega)), start)
        start = r.start if r.stick < 1.0 else None
        found.append(r)
    return found


def distance(a: object, b: object) -> float:
    return float(np.max(np.abs(np.asarray(a) - np.asarray(b))))


@pytest.mark.parametrize("F", LEVELS)
def test_sweeps_of_a_jenkins_oscillator(F: float) -> None:
    """50 frequencies at three levels, up and down, against closed forms from event to event."""
    amplitude, harmonic, stick = (
        np.array([getattr(r, name) for r in expected(F)])
        for name in ("amplitude", "harmonic", "stick")
    )
    swept = damped().dataset.sel(level=F)
    for direction in ("up", "down"):
        found = swept.sel(direction=direction)
        wave = found["swept_harmonic"].values * np.exp(1j * found["swept_phase"].values)
        assert distance(found["swept_amplitude"] / amplitude, 1.0) < 1e-10
        assert distance(wave / harmonic, 1.0) < 1e-10
        assert distance(found["swept_stick"], stick) < 1e-10


@pytest.mark.parametrize("F", LEVELS)
def test_lines_of_a_jenkins_oscillator(F: float) -> None:
    data = damped().dataset
    (number,) = np.unique(data["line"].values[data["F"].values == F])
    line = damped().line(int(number))
    assert line["omega"].values[[0, -1]] == pytest.approx(SPAN, rel=1e-12)
    grid = np.linspace(*SPAN, POINTS)
    # At an onset of slip the equations of the oracle have no solution.
    onsets = np.array([s.value for s in damped().of_kind("slip onset")])
    beside = np.abs(np.subtract.outer(line["omega"].values, onsets)).min(axis=1) > 1e-9
    line = line.isel(point=np.flatnonzero(beside))
    for i in np.linspace(0, line.sizes["point"] - 1, 9).astype(int):
        point = line.isel(point=i)
        omega = float(point["omega"])
        near = expected(F)[int(np.argmin(np.abs(grid - omega)))]
        r = response(Jenkins(F=F, omega=omega), near.start)
        wave = complex(point["harmonic"]) * np.exp(1j * float(point["phase"]))
        assert abs(float(point["amplitude"]) / r.amplitude - 1.0) < 1e-10
        assert abs(wave / r.harmonic - 1.0) < 1e-10
        assert abs(float(point["stick"]) - r.stick) < 1e-8


@pytest.mark.parametrize("F", LEVELS)
def test_the_damper_slips_where_the_linear_response_is_too_large(F: float) -> None:
    """k_d |x| = F_c of the linear oscillator with both springs."""
    onsets = [s for s in damped().of_kind("slip onset") if s.parameters["F"] == F]
    assert len(onsets) == 2
    for point in onsets:
        linear = Jenkins(F=F, omega=point.value).linear(1.5)
        assert 0.5 * abs(linear) == pytest.approx(1.0, rel=1e-6)
    data = damped().dataset
    line = data.isel(point=np.flatnonzero(data["F"].values == F))
    inside = (line["omega"] > onsets[0].value + 1e-6) & (line["omega"] < onsets[1].value - 1e-6)
    outside = (line["omega"] < onsets[0].value - 1e-6) | (line["omega"] > onsets[1].value + 1e-6)
    assert np.all(line["slips"].values[inside] == 1) and np.all(line["slips"].values[outside] == 0)


def test_largest_responses() -> None:
    """No frequency beside it has a larger response; the backbone passes them, and lies on it
    between them."""
    data = damped().dataset
    for F, omega, top in zip(
        LEVELS, data["peak_omega"].values, data["peak_amplitude"].values, strict=True
    ):
        start = None
        for off in (-1e-3, 0.0, 1e-3):
            r = response(Jenkins(F=F, omega=omega + off), start)
            start = r.start
            if off:
                assert r.amplitude < top
            else:
                assert r.amplitude == pytest.approx(top, rel=1e-10)
    level = data["backbone_F"].values
    assert np.all(np.diff(level) > 0.0) and set(LEVELS) <= set(level.tolist())
    assert len(level) > 2 * len(LEVELS)
    i = int(np.argmax(level == LEVELS[1])) - 2
    F, omega, top = (float(data[f"backbone_{n}"][i]) for n in ("F", "omega", "amplitude"))
    around = [response(Jenkins(F=F, omega=omega + off)).amplitude for off in (-1e-3, 0.0, 1e-3)]
    assert around[1] == pytest.approx(top, rel=1e-10)
    assert max(around) == around[1]


def test_the_certificate_says_that_sweeps_are_on_the_lines() -> None:
    found = damped()
    assert found.certificate.ok, found.certificate.verdict
    assert found.certificate["swept motions that are not on a line"].value == 0.0
    assert found.certificate["first harmonics"].value < 1e-12
    assert found.outcome is Completion.FINISHED


def test_coulomb_friction_is_den_hartogs_limit() -> None:
    """Dry friction alone, where the motion does not stop: amplitude and phase in closed form."""
    found = frequency_response(
        catalogue.forced_oscillator(F_c=0.3), "omega", (1.2, 2.0), points=3
    ).dataset
    assert found["stick"].values.max() == 0.0
    for omega, amplitude in zip(found["omega"].values, found["amplitude"].values, strict=True):
        assert amplitude == pytest.approx(den_hartog.amplitude(omega, 0.3), rel=1e-10)


def test_a_stiff_damper_is_coulomb_friction() -> None:
    """k_d → ∞: the response tends to Den Hartog's. The way 2F_c/k_d back through the spring, from a
    stop on, takes a time of the order k_d^(−1/2)."""
    system = jenkins().with_parameters(c=1e-9, F=1.0, F_c=0.3)
    misses = []
    for k_d in (1e3, 1e4):
        found = frequency_response(
            system, "omega", (1.4, 1.5), parameters={"k_d": k_d}, points=2
        ).dataset
        limit = [den_hartog.amplitude(w, 0.3) for w in found["swept_omega"].values]
        misses.append(distance(found["swept_amplitude"].sel(direction="up")[0], limit))
    assert misses[1] < 5e-3
    assert misses[1] == pytest.approx(0.1**0.5 * misses[0], rel=0.2)


@cache
def bent() -> FrequencyResponse:
    """A resonance that a spring bends, from x'' + c x' + x + x³ = F cos ωt."""
    system = System(
        name="bent",
        parameters=parameters(c=0.1, F=0.2, omega=1.0),
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="x**2/2 + x**4/4 - push*x",
        viscous="c*d_x**2/2",
        drives={"push": "F*cos(omega*t)"},
    )
    return frequency_response(system, "omega", (0.9, 1.7), levels=["F=0.2"], points=17)


def test_sweeps_part_between_folds() -> None:
    data = bent().dataset
    folds = sorted(point.value for point in bent().of_kind("fold"))
    assert len(folds) == 2
    omega = data["swept_omega"].values
    up, down = data["swept_amplitude"].values[0]
    apart = np.abs(up - down) > 1e-6
    assert np.array_equal(apart, (omega > folds[0]) & (omega < folds[1]))
    assert np.any(apart) and np.all(up[apart] > down[apart])
    # Unstable is what is between the folds, and smaller than what the sweep up has reached.
    unstable = data["stable"].values == 0
    inside = data["omega"].values[unstable]
    assert np.all((inside >= folds[0] - 1e-6) & (inside <= folds[1] + 1e-6))
    assert set(np.unique(data["line"].values)) == {0}
    assert np.all(data["slips"].values == 1)  # no contact could stick


def test_sweeps_on_lines_settle_as_those_without_lines() -> None:
    """The cycles that a sweep takes from a line are those that its motion settles on by itself."""
    data, system = bent().dataset, bent().system
    for direction in ("up", "down"):
        values = data["swept_omega"].values[:: 1 if direction == "up" else -1]
        met = dict(zip(values, carried(system, "omega", values.tolist()), strict=True))
        amplitudes = data["swept_amplitude"].sel(direction=direction)[0].values
        for omega, amplitude in zip(data["swept_omega"].values, amplitudes, strict=True):
            cycle, _ = met[omega]
            assert isinstance(cycle, Cycle)
            assert amplitude == pytest.approx(0.5 * np.ptp(cycle.extrema["x"]), rel=1e-9)


def test_the_first_harmonic_of_a_bent_resonance_is_about_that_of_averaging() -> None:
    """(1 + ¾A² − ω²)² A² + (cωA)² = F² up to the third harmonic, and sin φ = −cωA/F."""
    data = bent().dataset
    A, omega = data["harmonic"].values, data["omega"].values
    left = np.hypot((1.0 + 0.75 * A**2 - omega**2) * A, 0.1 * omega * A)
    assert left == pytest.approx(0.2, rel=0.1)
    # The power of the drive is what the damper takes: exact but for the other harmonics.
    assert -np.sin(data["phase"].values) == pytest.approx(0.1 * omega * A / 0.2, abs=0.01)


def test_picture() -> None:
    figure = bent().plot()
    upper, lower = figure.axes
    assert lower.get_ylabel() == "phase  [rad]"
    dashed = [line for line in upper.get_lines() if line.get_linestyle() == "--"]
    assert dashed
    assert [text.get_text() for text in upper.texts] == ["$F$ = 0.2"]
    legend = upper.get_legend()
    assert legend is not None
    words = {text.get_text() for text in legend.get_texts()}
    assert {"stable cycle", "unstable cycle", "fold", "sweep up", "sweep down"} <= words
    (axes,) = bent().plot("period").axes
    assert axes.get_ylabel() == "period"
    with pytest.raises(DeclarationError, match="unknown quantity 'speed'"):
        bent().plot("speed")


def test_a_stored_response_is_the_same(tmp_path: Path) -> None:
    path = tmp_path / "response.nc"
    bent().save(path)
    again = open_result(path)
    assert isinstance(again, FrequencyResponse)
    assert again.dataset.identical(bent().dataset)
    assert again.special == bent().special
    assert again.summary().data == bent().summary().data
    assert len(again.table) == again.dataset.sizes["point"]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"parameter": "omga"}, "omga: unknown parameter .*. Did you mean 'omega'"),
        ({"parameter": "c"}, "c: it does not change the period of the drives"),
        ({"span": (1.0, 1.0)}, "omega: .* is not a range"),
        ({"span": (-1.0, 1.0)}, "omega: the frequency is zero within its range"),
        ({"levels": {"G": [1.0]}}, "levels.G: unknown parameter"),
        ({"levels": {"omega": [1.0]}}, "levels: omega cannot be a level"),
        ({"levels": {"F": []}}, "levels.F: there are no points"),
        ({"levels": {"F": [0.1], "c": [0.1]}}, "levels: F, c cannot be a level"),
        ({"levels": {"F": [0.0]}}, "drive: the force on x has no harmonic"),
        ({"drive": "z"}, "drive: z has no harmonic"),
        ({"of": "y"}, "of: unknown quantity 'y'"),
        ({"points": 1}, "points: 1 is not a number of points"),
        (
            {"system": catalogue.belt_block(), "parameter": "V"},
            "belt_block: the system has no drive",
        ),
        ({"system": dragged(), "parameter": "V"}, "V: it does not change the period of the drives"),
    ],
)
def test_bad_input_is_named(given: dict[str, Any], message: str) -> None:
    usual = {"system": jenkins(), "parameter": "omega", "span": (0.8, 1.0)}
    with pytest.raises(DeclarationError, match=message):
        frequency_response(**{**usual, **given})


def test_where_nothing_moves_it_is_said() -> None:
    """A force below the friction: the mass rests at every frequency."""
    found = frequency_response(catalogue.forced_oscillator(F_c=1.5), "omega", (0.8, 1.2), points=2)
    assert found.outcome is Completion.NOTHING_FOUND and not found.certificate.ok
    assert "comes to rest" in found.message
    assert np.all(np.isnan(found["swept_amplitude"]))
    assert "no response" in str(found.summary())
    found.plot()


@pytest.mark.parametrize(
    ("of", "said"),
    [
        ("", "the formula is empty"),
        ("t*x", r"'t\*x' is not periodic"),
        ("x + t**2", "is not periodic"),
        ("dissipated_energy", "'dissipated_energy' is not periodic"),
    ],
)
def test_what_does_not_repeat_has_no_response(of: str, said: str) -> None:
    with pytest.raises(DeclarationError, match=said):
        frequency_response(jenkins(), "omega", SPAN, of=of)
