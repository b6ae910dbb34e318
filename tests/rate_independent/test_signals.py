"""What a user gives as a function of time or phase, whatever it is given as."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.rate_independent.signals.reading import read
from stickslip.rate_independent.signals.samples import MonotoneTable
from stickslip.rate_independent.signals.signal import OF_PHASE, OF_TIME
from stickslip.symbolic import expressions as ex

T = ex.sym("t")
TIMES = np.linspace(0.0, 2.0, 9)
GIVEN: dict[str, Any] = {
    "formulas": ["3*t", "2 - t"],
    "expressions": [3.0 * T, 2.0 - T],
    "a number and a formula": [ex.num(0.0) + 3.0 * T, "2 - t"],
    "samples": (TIMES, np.column_stack([3.0 * TIMES, 2.0 - TIMES])),
    "a function": lambda t: [3.0 * t, 2.0 - t],
    "a function of columns": lambda t: np.array([[3.0 * t], [2.0 - t]]),
}


@pytest.mark.parametrize("given", GIVEN.values(), ids=GIVEN)
def test_however_it_is_given_it_is_the_same(given: Any) -> None:
    signal = read(given, "load", OF_TIME, (2,))
    places = np.array([0.0, 0.3, 1.1, 2.0])
    expected = np.column_stack([3.0 * places, 2.0 - places])
    np.testing.assert_allclose(signal.over(places), expected, rtol=1e-15)
    np.testing.assert_allclose(signal.at(0.3), expected[1], rtol=1e-15)
    np.testing.assert_allclose(
        signal.entries(np.array([1, 0]), places[1:3]), [1.7, 3.3], rtol=1e-15
    )
    chord = signal.chord(places[:1], places[1:2])
    np.testing.assert_allclose(chord.start, expected[:1])
    np.testing.assert_allclose(chord.off, 0.0, atol=1e-14)
    assert signal.bounded == (not callable(given))
    assert read(signal, "load", OF_TIME, (2,)) is signal


@pytest.mark.parametrize("given", [2.0, "1 + 1", ex.num(2.0), lambda t: 2.0])
def test_one_value_for_polynomials(given: Any) -> None:
    panels = read(given, "load", OF_TIME, ()).panels((0.0, 3.0))
    value = panels.sample(np.array([1.0]), np.array([1.0]))
    assert (value.value.item(), value.rate.item()) == pytest.approx((2.0, 0.0), abs=1e-14)
    assert (panels.samples > 0) == callable(given)


def test_monotone_samples_stay_within_their_chords() -> None:
    y = np.array([0.0, 1.0, 1.2, 3.0, 3.0])
    signal = MonotoneTable(np.arange(5.0), y, "load", OF_TIME, ())
    low, high = np.array([0.1, 1.2, 2.0]), np.array([0.9, 1.6, 3.0])
    chord = signal.chord(low, high)
    for share in np.linspace(0.0, 1.0, 101):
        line = (1.0 - share) * chord.start + share * chord.end
        off = np.abs(signal.over(low + share * (high - low)) - line)
        assert (off <= chord.off + 1e-15).all()
    assert (chord.off > 0.0).all()


def test_the_phase_is_taken_modulo_1() -> None:
    signal = read(["cos(2*pi*s)", "s"], "weights", OF_PHASE)
    np.testing.assert_allclose(signal.at(1.25), [0.0, 0.25], atol=1e-15)
    np.testing.assert_allclose(signal.unwrapped(np.array([1.0])), [[1.0, 1.0]])


def undefined(t: float) -> Array:
    return np.array([0.0, np.nan if t > 1.0 else t])


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (["t", "log(t - 1)"], r"load\[1\]: it is nan at t = 0\.5\. Give finite values"),
        (lambda t: undefined(2.0), r"load\[1\]: it is nan at t = 0\.5"),
        (lambda t: "x", r"load: no value at t = 0\.5 \(a str is not an array of numbers\)"),
        (lambda t: 1 / 0, r"load: the function raises an error at t = 0\.5 \(ZeroDivisionError"),
        (lambda t: [1.0], r"load: its shape is \(1,\) at t = 0\.5, but \(2,\) is needed"),
        (["t"], r"load: its shape is \(1,\), but \(2,\) is needed"),
        (None, r"load: a NoneType is not an array of numbers, a function of t or a formula"),
        (["t", "u"], r"load\[1\]: unknown name 'u'\. Known here: t"),
        (["t", ex.sym("u")], r"load\[1\]: unknown name 'u'\. Known here: t"),
        (([0.0, 1.0], [[1, 2], [3, np.inf]]), r"load\[1\]: it is inf at t = 1\."),
        (([0.0, 1.0], [[1], [3]]), r"load, values: its shape is \(2, 1\), but \(2, 2\)"),
        (([0.0, 0.0], [[1, 2], [3, 4]]), r"load: the times do not increase: 0, then 0 at index 1"),
    ],
)
def test_what_is_wrong_is_said_in_one_way(given: Any, words: str) -> None:
    with pytest.raises(DeclarationError, match=words):
        read(given, "load", OF_TIME, (2,)).over(np.array([0.5]))


def test_expressions_are_formulas_everywhere() -> None:
    s = ex.sym("s")
    wave = 1.0 + 0.5 * ex.call("cos", 2.0 * np.pi * s)
    by_text, by_tree = (
        ss.play(load, threshold, (0, 2), initial=0.0, epsilon=0.25)
        for load, threshold in (("3*t", "1 + 0.5*cos(2*pi*s)"), (3.0 * T, wave))
    )
    np.testing.assert_array_equal(by_tree.z, by_text.z)
    assert ss.WeightedL1([wave]).average().support([1.0]) == pytest.approx(0.5)
    # A declaration holds texts, and says so; trees become texts when it is made.
    given: dict[str, Any] = {
        "force": ex.call("sin", T),
        "potential": 0.5 * ex.sym("x") ** 2,
        "threshold": (ex.num(0.5), 0.25),
        "unknown": ex.sym("y"),
    }
    system = ss.System(
        "block",
        coordinates={"x": ss.Inertial(force=given["force"])},
        kinetic="d_x**2/2",
        potential=given["potential"],
        contacts={"floor": ss.Contact("d_x", given["threshold"])},
    )
    assert system.potential == "0.5*x**2"
    from stickslip.model.system_file import loads

    assert loads(system.to_toml()) == system
    with pytest.raises(DeclarationError, match="potential: unknown name 'y'"):
        ss.System(
            "block",
            coordinates={"x": ss.Viscous()},
            viscous="d_x**2/2",
            potential=given["unknown"],
        )
