"""Chunks of points: independence of how points are split, bad input."""

from __future__ import annotations

import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.motion.outcome import Outcome
from stickslip.motion.simulate_many import initial_states
from stickslip.orbits.settling.motions import Settings
from stickslip.stopping.scopes import Stopped, watching
from stickslip.sweeps.request.measures import MISSING
from stickslip.sweeps.work import chunk
from stickslip.sweeps.work.chunk import measure_chunk

MEASURES = (
    "period",
    "amplitude",
    "speed",
    "stick_fraction",
    "energy_per_cycle",
    "peak_force",
    "switches",
)
TOY = ss.catalogue.rocking_toy()
SYSTEMS = {
    "toy": (TOY, {"P": (0.8, 1.3), "delta": (0.02, 0.2)}),
    "scaled slider": (ss.catalogue.scaled_slider_limit(), {"b": (0.3, 1.9), "nu": (1e-3, 1e-2)}),
    "forced oscillator": (ss.catalogue.forced_oscillator(), {"omega": (0.3, 1.7)}),
    "plate compactor": (ss.catalogue.plate_compactor(), {"Omega": (30.0, 70.0), "V": (0.05, 0.2)}),
    "crawler": (ss.catalogue.two_leg_crawler(), {"D": (0.1, 1.0)}),
}


def spread(ranges: dict[str, tuple[float, float]], count: int) -> dict[str, Array]:
    rng = np.random.default_rng(5)
    return {name: rng.uniform(low, high, count) for name, (low, high) in ranges.items()}


def toy_points(count: int) -> tuple[dict[str, Array], dict[str, Array]]:
    start = {"psi": np.zeros(count), "d_psi": np.linspace(1.0, 1.9, count), "x_R": np.zeros(count)}
    return start, spread(SYSTEMS["toy"][1], count)


def test_many_motions_end_where_single_ones_do() -> None:
    system, ranges = SYSTEMS["scaled slider"]
    given = spread(ranges, 9)
    many = ss.simulate_many(system, (0.0, 30.0), parameters=given).dataset
    for i in range(9):
        one = ss.simulate(
            system,
            (0.0, 30.0),
            initial=None,
            parameters={name: float(v[i]) for name, v in given.items()},
        )
        for name, value in one.final.items():
            assert float(many[f"final_{name}"][i]) == pytest.approx(value, rel=1e-9, abs=1e-9)


def test_points_do_not_depend_on_their_company(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bit by bit, whatever the chunks, the blocks within them and the threads."""
    start, given = toy_points(23)
    measures = (*MEASURES, "speed:x_R", "stick_fraction:left leg")
    whole = measure_chunk(TOY, start, given, measures, Settings())
    parts = [slice(i, j) for i, j in ((0, 1), (1, 8), (8, 9), (9, 23))]

    def part(piece: slice) -> dict[str, Array]:
        return measure_chunk(
            TOY,
            {k: v[piece] for k, v in start.items()},
            {k: v[piece] for k, v in given.items()},
            measures,
            Settings(),
        )

    with ThreadPoolExecutor(2) as pool:
        pieces = list(pool.map(part, parts))
    monkeypatch.setattr(chunk, "lanes_of_block", lambda problem, slots: 5)
    blocks = measure_chunk(TOY, start, given, measures, Settings())
    less = measure_chunk(TOY, start, given, ("speed",), Settings())
    for name, values in less.items():
        np.testing.assert_array_equal(values, whole[name])
    for name, values in whole.items():
        np.testing.assert_array_equal(np.concatenate([piece[name] for piece in pieces]), values)
        np.testing.assert_array_equal(blocks[name], values)


def test_a_start_outside_the_stable_set_says_by_how_much() -> None:
    """[M] (4.2): the force on the right leg is a(x_R − x_L) − cψ − P, its threshold ρ + H*/2 at ψ =
    0."""
    start = {
        "psi": np.zeros(3),
        "d_psi": np.array([1.8, 0.0, 0.0]),
        "x_R": np.array([0.0, 0.0, -0.8]),
    }
    P = np.array([1.0, 1.75, 1.6])
    found = measure_chunk(TOY, start, {"P": P}, ("speed",), Settings())
    outside = [Outcome.OUTSIDE.code] * 2
    assert list(found["outcome"]) == [Outcome.PERIODIC.code, *outside]
    np.testing.assert_allclose(found["excess"], [0.0, 1.75 - 1.7, 0.8 + 1.6 - 1.7], rtol=1e-12)
    assert np.array_equal(np.isnan(found["speed"]), [False, True, True])
    assert np.array_equal(np.isnan(found["certificate"]), [False, True, True])
    assert [MISSING[code] for code in found["lacking"]] == [
        "nothing",
        "result",
        "result",
    ]


def test_limits_are_kept() -> None:
    start, given = toy_points(2)
    short = measure_chunk(TOY, start, given, ("period",), Settings(max_time=10.0))
    assert np.all(short["outcome"] == Outcome.NOT_SETTLED.code) and np.all(
        np.isnan(short["period"])
    )
    few = measure_chunk(TOY, start, given, ("period",), Settings(max_events=20))
    assert np.all(few["outcome"] == Outcome.EVENT_LIMIT.code)
    cycles = measure_chunk(
        ss.catalogue.forced_oscillator(),
        {},
        {"omega": np.array([0.5])},
        ("period",),
        Settings(max_cycles=3),
    )
    assert cycles["outcome"][0] == Outcome.NOT_SETTLED.code


@pytest.mark.parametrize(
    ("initial", "parameters", "measures", "words"),
    [
        ({}, {"P": [1.0]}, ("sped",), "unknown measure 'sped'"),
        ({}, {"P": [1.0]}, ("amplitude:phi",), "unknown quantity 'phi'"),
        ({}, {"P": [1.0]}, ("stick_fraction:tail",), "unknown quantity 'tail'"),
        ({}, {"rho": [-1.0]}, ("speed",), "outside the admissible range"),
        ({}, {"Q": [1.0]}, ("speed",), "unknown parameter"),
        ({}, {"P": [np.nan]}, ("speed",), "finite"),
        ({"psi": [0.1, 0.2]}, {"P": [1.0, 1.1, 1.2]}, ("speed",), "different lengths"),
        ({"phi": [0.1]}, {}, ("speed",), "not a part of the state"),
    ],
)
def test_bad_input_is_named(
    initial: dict[str, list[float]],
    parameters: dict[str, list[float]],
    measures: tuple[str, ...],
    words: str,
) -> None:
    start, table = ({k: np.array(v) for k, v in part.items()} for part in (initial, parameters))
    with pytest.raises(DeclarationError, match=words):
        measure_chunk(TOY, start, table, measures, Settings())


def test_speed_needs_a_direction() -> None:
    with pytest.raises(DeclarationError, match="declares no translation"):
        measure_chunk(ss.catalogue.belt_block(), {}, {"V": np.array([0.3])}, ("speed",), Settings())


@pytest.mark.parametrize(
    "bad",
    [
        {"tolerance": 0.0},
        {"max_time": -1.0},
        {"max_cycles": 0},
        {"max_events": 0},
        {"longest_cycle": 3},
    ],
)
def test_settings_are_checked(bad: dict[str, Any]) -> None:
    with pytest.raises(DeclarationError, match=next(iter(bad))):
        Settings(**bad)


def test_initial_values_replace_the_declared_ones() -> None:
    states = initial_states(TOY, {"psi": np.array([0.1, 0.2])}, 2)
    names = TOY.declaration.state
    np.testing.assert_array_equal(states[:, names.index("psi")], [0.1, 0.2])
    np.testing.assert_array_equal(states[:, names.index("x_R")], [-0.8, -0.8])


@pytest.mark.parametrize(
    ("given", "named"),
    [({"workers": -1}, "workers"), ({"workers": 0}, "workers"), ({"max_events": 0}, "max_events")],
)
def test_many_motions_refuse_numbers_that_are_none(given: dict[str, int], named: str) -> None:
    with pytest.raises(DeclarationError, match=named):
        ss.simulate_many(ss.catalogue.rocking_toy(), (0.0, 1.0), **given)  # type: ignore[arg-type]
    with pytest.raises(DeclarationError, match="expected a System"):
        ss.simulate_many("toy")  # type: ignore[arg-type]


def test_a_wish_to_stop_ends_every_chunk() -> None:
    """Whatever its loops are about: also while parts of a period are tried, which asks for a motion
    until it is complete."""
    block = ss.load(Path(__file__).parents[2] / "examples" / "jobs" / "13-crate.toml")
    speeds, stiction = np.meshgrid(np.linspace(0.05, 0.3, 200), np.linspace(0.35, 0.8, 50))
    table = {"V": speeds.ravel(), "mu_s": stiction.ravel()}
    ended = list[str]()

    def work(flag: np.ndarray) -> None:
        try:
            with watching(interrupt=flag):
                measure_chunk(block, {}, table, ("period",), Settings())
            ended.append("done")
        except Stopped:
            ended.append("stopped")

    for delay in np.linspace(0.02, 0.2, 60):
        flag = np.zeros(1, np.int64)
        thread = threading.Thread(target=work, args=(flag,), daemon=True)
        thread.start()
        time.sleep(float(delay))
        flag[0] = 1
        thread.join(20.0)
        assert not thread.is_alive(), f"it goes on although a stop was requested ({delay:.3f} s)"
    assert "stopped" in ended
