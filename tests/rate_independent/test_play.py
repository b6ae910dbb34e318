"""The play: its kernels, its signals, its nodes, and everything a user reads from it."""

from __future__ import annotations

import math
import runpy
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.polynomial import chebyshev

import stickslip as ss
from stickslip.arrays import Array
from stickslip.errors import DeclarationError, StickslipError
from stickslip.figures.play import plot_limit, plot_loops, plot_play
from stickslip.rate_independent.play import nodes
from stickslip.rate_independent.play.clamp import clamp, plays, prandtl_ishlinskii
from stickslip.rate_independent.play.operator import Play, play
from stickslip.rate_independent.signals import chebyshev as panels
from stickslip.symbolic import expressions as ex

EXAMPLES = Path(__file__).parents[2] / "examples"
LOAD = "5*t - t**2"
THRESHOLD = "1 + cos(2*pi*s)/2"


def stepwise(lower: Array, upper: Array, z: float) -> Array:
    out = np.empty(len(lower))
    for k, (low, high) in enumerate(zip(lower.tolist(), upper.tolist(), strict=True)):
        out[k] = z = min(max(z, low), high)
    return out


# --- Arrays ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [0, 1, 2, 3, 10, 11, 1000, 1001])
@pytest.mark.parametrize("swing", [0.01, 0.3, 3.0])  # never forgets, forgets late, forgets soon
def test_clamp_is_the_loop(size: int, swing: float) -> None:
    rng = np.random.default_rng(size)
    for _ in range(20):
        load = np.cumsum(swing * rng.normal(size=size))
        below, above = rng.uniform(0, 1.5, (2, size)) * rng.integers(0, 2, (2, size))
        z = float(rng.normal())
        assert np.array_equal(
            clamp(load - below, load + above, z), stepwise(load - below, load + above, z)
        )


def test_clamp_writes_where_it_is_told() -> None:
    L = np.sin(np.arange(50.0))
    out = np.empty(50)
    assert clamp(L, L + 1, 0.0, out) is out
    assert np.array_equal(out, stepwise(L, L + 1, 0.0))
    assert clamp(L, out, 0.0, out) is out  # over what it reads
    assert np.array_equal(out, stepwise(L, stepwise(L, L + 1, 0.0), 0.0))
    assert np.array_equal(clamp([0.0, 1.0, -3.0], [np.inf, np.inf, -2.0], 0.5), [0.5, 1.0, -2.0])


def test_plays_are_clamps() -> None:
    rng = np.random.default_rng(0)
    load = rng.normal(size=300).cumsum()
    radii = rng.uniform(0, 3, 17)
    weights = rng.normal(size=17)
    start = np.ones(17)
    each = plays(load, radii, start)
    for i, r in enumerate(radii):
        assert np.array_equal(each[:, i], clamp(load - r, load + r, 1.0))
    np.testing.assert_allclose(
        prandtl_ishlinskii(load, radii, weights, initial=start), each @ weights, rtol=0, atol=1e-13
    )
    assert np.array_equal(plays(load, radii, 1.0), each)
    assert start.sum() == 17  # the caller's positions are not moved


def read_only(x: Array) -> Array:
    x = x.copy()
    x.setflags(write=False)
    return x


def misaligned(x: Array) -> Array:
    memory = np.zeros(x.nbytes + 1, np.uint8)[1:]
    memory[:] = x.view(np.uint8)
    return memory.view(x.dtype)


@pytest.mark.parametrize(
    "kept",
    [
        read_only,
        misaligned,
        lambda x: np.repeat(x, 2)[::2],
        lambda x: x[::-1].copy()[::-1],
        lambda x: x.astype(x.dtype.newbyteorder()),
        lambda x: x.astype(np.int32),
        lambda x: x.tolist(),
    ],
    ids=["read-only", "misaligned", "strided", "backwards", "other bytes", "integers", "list"],
)
def test_however_numbers_are_kept(kept: Callable[[Array], Any]) -> None:
    """Compiled functions take arrays in one form; what a user gives in another is the same."""
    rng = np.random.default_rng(3)
    load, low = rng.integers(-9, 9, (2, 51)).astype(float)
    radii = rng.integers(0, 5, 6).astype(float)
    weights = rng.integers(-5, 5, 6).astype(float)
    high = low + 2.0
    before = load.copy()
    assert np.array_equal(clamp(kept(low), kept(high), 0.0), clamp(low, high, 0.0))
    assert np.array_equal(
        plays(kept(load), kept(radii), kept(weights)), plays(load, radii, weights)
    )
    assert np.array_equal(
        prandtl_ishlinskii(kept(load), kept(radii), kept(weights), initial=kept(radii)),
        prandtl_ishlinskii(load, radii, weights, initial=radii),
    )
    assert np.array_equal(load, before)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: clamp([0, np.nan, 1], [1, 1, 2], 0.0), "lower: sample 1 is NaN"),
        (lambda: clamp([0, 0, 1], [1, 1, np.nan], 0.0), "upper: sample 2 is NaN"),
        (
            lambda: clamp([0, 0, 3], [1, 1, 2], 0.0),
            "at sample 2 it is 3, which exceeds the upper bound 2",
        ),
        (lambda: clamp([0, 0], [1], 0.0), "has 1 samples, but 'lower' has 2"),
        (lambda: clamp([[0, 0]], [1, 1], 0.0), "lower: the array has 2 dimensions"),
        (lambda: clamp(["a"], [1], 0.0), "lower: .* not an array of numbers"),
        (lambda: clamp([0], [1], np.nan), "initial: nan is not a finite number"),
        (lambda: clamp([0], [1], 0.0, np.empty(2)), "out: .*shape"),
        (lambda: clamp([0], [1], 0.0, np.empty(1, np.float32)), "out: .*float32"),
        (lambda: clamp([0, 0], [1, 1], 0.0, np.empty(4)[::2]), "out: .*contiguous, writeable"),
        (lambda: clamp([0], [1], 0.0, read_only(np.empty(1))), "out: .*contiguous, writeable"),
        (lambda: plays([0, np.inf], [1]), "load: sample 1 is inf"),
        (lambda: plays([0, 1], [1, -2]), "radii: entry 1 is negative"),
        (lambda: plays([0, 1], [1, 2, 3], [0, 0]), "initial: 2 were given, but there are 3 radii"),
        (
            lambda: prandtl_ishlinskii([0, 1], [1, 2], [1]),
            "weights: 1 were given, but there are 2 radii",
        ),
        (lambda: prandtl_ishlinskii([0, 1], [1, 2], [1, np.nan]), "weights: sample 1 is nan"),
    ],
)
def test_bad_arrays(call: Callable[[], object], message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        call()


# --- Polynomials on panels ------------------------------------------------------------------------


def test_coefficients_in_any_order() -> None:
    """Of the rows or of the columns first, and kept from change."""
    rng = np.random.default_rng(5)
    c = rng.normal(size=(9, 30)) * 0.5 ** np.arange(9)[:, None]
    start, end = np.sort(rng.uniform(-1.0, 1.0, (2, 30)), axis=0)
    other = np.asfortranarray(c)
    other.setflags(write=False)
    for call in (
        lambda c: panels.sign_changes(c, 0.0),
        lambda c: panels.restrict(c, start, end),
        lambda c: panels.first_crossings(c, start, end),
    ):
        np.testing.assert_array_equal(call(c), call(np.asfortranarray(c)))
        np.testing.assert_array_equal(call(c), call(other))
    x = np.linspace(-1.0, 1.0, 7)[:, None]
    within = start + 0.5 * (x + 1.0) * (end - start)
    np.testing.assert_allclose(
        panels.values(panels.restrict(c, start, end), x), panels.values(c, within), atol=1e-14
    )


def test_every_sign_change_is_found() -> None:
    rng = np.random.default_rng(1)
    for _ in range(500):
        roots = np.sort(rng.uniform(-1.3, 1.3, rng.integers(1, 9)))
        if len(roots) > 1:
            roots[1] = roots[0] + 10.0 ** -rng.integers(1, 6)
        c = chebyshev.chebfromroots(roots)[:, None] * rng.choice([-1e-3, 1e3])
        _, found = panels.sign_changes(c, 0.0)
        assert found == pytest.approx(np.sort(roots[np.abs(roots) < 1]), abs=1e-8)


SHAPES: dict[str, tuple[Callable[[Array], Array], float, int]] = {
    # function, tolerance, most panels
    "smooth": (lambda t: 0.7 + 0.3 * np.cos(5 * t), 1e-14, 20),
    "corners": (lambda t: np.abs(np.sin(5 * t)), 1e-13, 30),
    "corners of a saw": (lambda t: np.abs((1.3 * t) % 1 - 0.5), 1e-13, 40),
    "jumps": (lambda t: np.where(np.sin(3 * t) > 0.3, 1.0, 0.4), 1e-14, 20),
    "spike": (lambda t: np.exp(-(((t - 3.3) / 0.05) ** 2)), 1e-14, 40),
    "root": (lambda t: np.sqrt(np.abs(t - np.pi)), 1e-7, 200),
    "weak corner": (lambda t: np.abs(t - np.pi) ** 1.5, 1e-13, 100),
    "round corner": (lambda t: np.hypot(t - 3, 1e-4), 1e-14, 60),
    "fast": (lambda t: np.cos(200 * np.pi * t), 1e-11, 3000),
}


@pytest.mark.parametrize("name", SHAPES)
def test_fit(name: str) -> None:
    function, tolerance, most = SHAPES[name]
    breaks, c, _ = panels.fit_pieces(function, np.array([0.0, 10.0]))
    t = np.sort(np.random.default_rng(0).uniform(0, 10, 20_000))
    panel = np.searchsorted(breaks, t, side="right") - 1
    x = 2 * (t - breaks[panel]) / np.diff(breaks)[panel] - 1
    assert np.abs(panels.values(c[:, panel], x) - function(t)).max() <= tolerance * 10
    assert len(breaks) < most


# --- Against independent solutions ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("epsilon", "rho"),
    [
        (0.1, "1 + 0.5*cos(2*pi*s)"),
        (0.03, "1 + 0.5*cos(2*pi*s) + 0.2*sin(6*pi*s)"),
        (0.07, "0.3 + abs(sin(2*pi*s))"),
        (0.5, "1 + cos(2*pi*s)"),  # friction vanishes once in a period
    ],
)
def test_the_engine_moves_the_same(epsilon: float, rho: str) -> None:
    """Taylor steps from switch to switch, of the same system."""
    motion = play(LOAD, rho, (0, 5), initial=0.0, epsilon=epsilon)
    engine = ss.simulate(ss.catalogue.oscillating_play(epsilon=epsilon, rho=rho))
    t = np.linspace(0, 5, 2001)
    ours, theirs = motion.at(t), engine.at(t)
    for name, key in (
        ("z", "z"),
        ("friction", "friction_friction"),
        ("dissipated_energy", "dissipated_energy"),
    ):
        np.testing.assert_allclose(ours[name], theirs[key], rtol=0, atol=1e-11)
    switches = engine.events[engine.events["contact"] == "friction"]
    assert motion.n_switches == len(switches)
    np.testing.assert_allclose(motion.events["time"], switches["time"], rtol=0, atol=1e-9)
    assert list(motion.events["to"]) == list(switches["to"])


CORNERS = np.union1d(np.arange(0, 11) * np.pi / 2, (np.arange(0, 27) - 0.5) / 1.3 / 2 + 0.5 / 2.6)
KINDS: list[Callable[[Array], Array]] = [
    lambda t: 0.2 + np.abs(np.sin(2 * t)),
    lambda t: 0.7 + 0.3 * np.cos(5 * t),
    lambda t: 0.1 + np.abs((t * 1.3) % 1 - 0.5),
    lambda t: np.maximum(0.0, np.sin(2 * t)),
]


@pytest.mark.parametrize("seed", range(16))
def test_fine_sampling_converges_to_it(seed: int) -> None:
    """A grid that holds all corners is wrong by the square of its width."""
    rng = np.random.default_rng(seed)
    w = rng.uniform(0.5, 8, 3)
    size = rng.uniform(-2, 2, 3)
    angle = rng.uniform(0, 6, 3)
    minus = KINDS[seed % 4]
    plus = KINDS[seed // 4]
    a = rng.uniform(0.5, 2)

    def load(t: Array) -> Array:
        return (size * np.sin(np.multiply.outer(t, w) + angle)).sum(axis=-1)

    motion = play(
        load, (plus, minus), (0.0, 10.0), initial=float(load(np.zeros(1))[0]) / a, stiffness=a
    )
    assert motion.certificate.ok, motion.certificate.verdict
    errors = []
    for n in (20_000, 80_000):
        t = np.union1d(np.linspace(0, 10, n + 1), CORNERS[CORNERS <= 10])
        stepped = clamp((load(t) - plus(t)) / a, (load(t) + minus(t)) / a, float(motion.z[0]))
        errors.append(np.abs(motion.position(t) - stepped).max())
    assert errors[0] < 300 * (10 / 20_000) ** 2
    assert errors[1] < errors[0] / 4


def test_formula_function_and_samples_agree() -> None:
    t = np.linspace(0, 5, 4001)
    text = play(LOAD, "0.4 + 0.3*abs(sin(3*t))", (0, 5), initial=0.0)
    exact = text.position(t)

    def rho(t: float) -> float:  # takes numbers only
        return 0.4 + 0.3 * abs(float(np.sin(3 * t)))

    one_by_one = play(lambda t: 5 * t - t * t, rho, (0, 5), initial=0.0)
    assert np.abs(one_by_one.position(t) - exact).max() < 1e-13
    values = 0.4 + 0.3 * np.abs(np.sin(3 * t))
    linear = play((t, 5 * t - t**2), (t, values), (0, 5), initial=0.0)
    monotone = play((t, 5 * t - t**2), (t, values), (0, 5), initial=0.0, interpolation="monotone")
    assert np.abs(linear.position(t) - exact).max() < 3e-3  # the corners fall between samples
    assert np.abs(monotone.position(t) - exact).max() < 3e-3
    stepped = clamp(5 * t - t**2 - values, 5 * t - t**2 + values, 0.0)
    assert np.abs(linear.position(t) - stepped).max() < 1e-14


def test_cubics_turn_between_samples() -> None:
    from scipy.interpolate import PchipInterpolator

    rng = np.random.default_rng(3)
    t, u = np.linspace(0, 10, 31), np.linspace(0, 10, 23)
    load = rng.normal(size=31).cumsum()
    rho = rng.uniform(0.2, 1.0, 23)
    motion = play(
        (t, load),
        (u, rho),
        (0.5, 9.5),
        initial=float(PchipInterpolator(t, load)(0.5)),
        interpolation="monotone",
    )
    fine = np.union1d(
        np.linspace(0.5, 9.5, 400_001),
        np.concatenate([t[(t > 0.5) & (t < 9.5)], u[(u > 0.5) & (u < 9.5)]]),
    )
    ell, r = PchipInterpolator(t, load)(fine), PchipInterpolator(u, rho)(fine)
    assert np.abs(motion.position(fine) - clamp(ell - r, ell + r, float(motion.z[0]))).max() < 1e-8
    assert motion.certificate.ok, motion.certificate.verdict
    assert len(motion.time) > 31 + 23  # L and U turn where neither signal does


@pytest.mark.parametrize("width", [1e-2, 1e-3, 2e-4])
def test_two_turning_points_close_together(width: float) -> None:
    """ℓ rises, falls by 4/3 δ³ between c − δ and c + δ and rises again: z rests until ℓ is back, at
    c + 2δ."""
    c = 0.8
    motion = play(
        f"1 + ((t - {c})**3 - 3*{width}**2*(t - {c}))/3",
        0.01,
        (0, 2),
        initial=1 - c**3 / 3 + c * width**2,
    )
    last = motion.events["time"].to_numpy()[-2:]
    assert last == pytest.approx([c - width, c + 2 * width], abs=1e-7)
    rest = motion.position(np.linspace(c - width, c + 2 * width, 50)[1:-1])
    assert np.ptp(rest) == 0.0
    assert rest[0] == pytest.approx(0.99 + 2 / 3 * width**3, abs=1e-15)


def test_phase_is_known_to_the_last_digit_of_the_time() -> None:
    """After ten million periods t/ε has lost nine digits; the remainder of t has not."""
    epsilon = 1e-5
    motion = play("t - 100", THRESHOLD, (100.0, 100.01), initial=-0.5, epsilon=epsilon)
    moving = np.flatnonzero(motion.mode == 1)
    t = 0.5 * (motion.time[moving] + motion.time[moving + 1])
    rho = 1 + np.cos(2 * np.pi * np.mod(t, epsilon) / epsilon) / 2
    assert len(t) > 900
    assert np.abs(motion.at(t)["threshold_plus"] - rho).max() < 1e-13
    assert np.abs(motion.position(t) - (t - 100 - rho)).max() < 1e-13


# --- Jumps and places where something vanishes ----------------------------------------------------


def test_threshold_that_drops() -> None:
    """z jumps to the new bound, and the energy that is set free is dissipated."""
    motion = play(1, "piecewise(t < 1, 2, 0.25)", (0, 2), initial=0.0)
    assert (motion.position(1.0, "left"), motion.position(1.0), motion.final) == (0.0, 0.75, 0.75)
    assert np.count_nonzero(np.diff(motion.time) == 0.0) == 1
    assert motion.dissipated == pytest.approx(0.75 - 0.75**2 / 2, abs=1e-15)
    assert motion.certificate.ok, motion.certificate.verdict
    assert list(motion.events["to"]) == ["slip+", "stick"]
    assert np.all(motion.events["time"] == 1.0)


def test_load_that_jumps() -> None:
    motion = play("piecewise(t < 1, 0, t < 2, 3, -1)", 1, (0, 3), initial=0.5, stiffness=2.0)
    assert motion.position(np.array([0.9, 1.0, 1.9, 2.0, 3.0])) == pytest.approx(
        [0.5, 1.0, 1.0, 0.0, 0.0], abs=1e-15
    )
    assert motion.position(np.array([1.0, 2.0]), "left") == pytest.approx([0.5, 1.0], abs=1e-15)
    assert motion.certificate.ok, motion.certificate.verdict
    # −Δℓ z at each jump of the load.
    assert motion.at(3.0)["supplied_energy"] == pytest.approx(-3 * 0.5 + 4 * 1.0, abs=1e-14)


@pytest.mark.parametrize(
    "given", ["piecewise(s < 1/2, 1, 0.3)", (np.array([0.0, 1.0]), np.array([0.3, 1.0]))]
)
def test_thresholds_that_jump_once_a_period(given: Any) -> None:
    """Rounded times of jumps: from each side, the force is within the threshold of that side."""
    motion = play("3*sin(t)", given, (-4.0, 6.0), initial=2.0, epsilon=0.1)
    for side in ("left", "right"):
        for t in (motion.time, 0.1 * np.arange(-39, 60)):
            now = motion.at(t, side)
            assert np.all(-now["friction"] <= now["threshold_plus"] + 1e-12)
            assert np.all(now["friction"] <= now["threshold_minus"] + 1e-12)
    assert np.count_nonzero(np.diff(motion.time) == 0.0) > 50
    assert motion.certificate.ok, motion.certificate.verdict


def test_phase_intervals_of_panels_join(monkeypatch: pytest.MonkeyPatch) -> None:
    """The panels are walked in chunks; where one ends, z may move, rest or jump."""
    given = ("3*sin(t)", ("0.5 + 0.3*cos(2*pi*s)", "piecewise(s < 1/3, 1, 0.3)"), (0.0, 6.0))
    whole = play(*given, initial=0.1, epsilon=0.25)
    assert np.count_nonzero(np.diff(whole.time) == 0.0) > 5
    for size in (1, 2, 3, 7):
        monkeypatch.setattr(nodes, "_CHUNK", size)
        joined = play(*given, initial=0.1, epsilon=0.25)
        assert all(
            np.array_equal(one, other) for one, other in zip(whole.nodes, joined.nodes, strict=True)
        )


def test_without_friction_z_follows_the_load() -> None:
    t = np.linspace(0, 7, 1001)
    motion = play("sin(t)", 0, (0, 7), initial=0.0)
    assert np.abs(motion.position(t) - np.sin(t)).max() < 1e-14
    assert motion.dissipated == 0.0
    assert motion.certificate.ok, motion.certificate.verdict


def test_at_rest_on_the_boundary() -> None:
    """A load that stays where it is makes no switches out of rounding."""
    motion = play("clip(3*t, 0, 2) + max(t - 3, 0)", "0.7 + 0.1*0", (0, 4), initial=0.0)
    assert list(motion.events["to"]) == ["slip+", "stick", "slip+"]
    assert motion.events["time"].to_numpy() == pytest.approx([0.7 / 3, 2 / 3, 3.0], abs=1e-14)


@pytest.mark.parametrize("shift", [-20.0, 1000.0])
def test_another_start_of_time(shift: float) -> None:
    t = np.linspace(0, 5, 1001)
    here = play("4*sin(t)", "1 + abs(cos(4*t))", (0, 5), initial=0.0)
    there = play(
        f"4*sin(t - {shift})", f"1 + abs(cos(4*(t - {shift})))", (shift, shift + 5), initial=0.0
    )
    assert np.abs(here.position(t) - there.position(t + shift)).max() < 1e-14 * (1 + abs(shift)) * 4
    assert here.n_switches == there.n_switches


# --- What a result says ---------------------------------------------------------------------------


@pytest.fixture(scope="module")
def motion() -> Play:
    return play(LOAD, (THRESHOLD, 0.7), (0, 5), initial=0.0, epsilon=0.1, stiffness=1.5)


def test_values_between_nodes(motion: Play) -> None:
    t = np.random.default_rng(0).uniform(0, 5, (3, 500))
    now = motion.at(t)
    assert all(value.shape == t.shape for value in now.values()) and np.array_equal(
        now["z"], motion.position(t)
    )
    assert motion.position(motion.time) == pytest.approx(motion.z, abs=1e-14)
    assert now["load"] == pytest.approx(5 * t - t**2, abs=1e-14)
    assert now["threshold_plus"] == pytest.approx(1 + np.cos(20 * np.pi * t) / 2, abs=1e-13)
    assert np.all(now["threshold_minus"] == 0.7)
    assert now["friction"] == pytest.approx(1.5 * now["z"] - now["load"], abs=1e-14)
    up, down, rest = (now["mode"] == m for m in (1, -1, 0))
    assert up.any() and down.any() and rest.any()
    assert now["friction"][up] == pytest.approx(-now["threshold_plus"][up], abs=1e-13)
    assert now["friction"][down] == pytest.approx(now["threshold_minus"][down], abs=1e-13)
    assert now["d_z"][up] == pytest.approx(
        (5 - 2 * t + 10 * np.pi * np.sin(20 * np.pi * t))[up] / 1.5, abs=1e-10
    )
    assert now["d_z"][down] == pytest.approx((5 - 2 * t)[down] / 1.5, abs=1e-12)
    assert np.all(now["d_z"][rest] == 0.0)
    balance = now["energy"] + now["dissipated_energy"] - now["supplied_energy"]
    assert balance == pytest.approx(np.zeros(t.shape), abs=1e-13)
    assert isinstance(motion.at(1.0)["z"], float)
    assert isinstance(motion.position(1.0), float)


def test_dataset(motion: Play) -> None:
    data = motion.dataset
    assert set(np.unique(motion.time)) <= set(data["time"].values)
    assert data["z"].sel(time=5.0).item() == pytest.approx(motion.final, abs=1e-15)
    assert data["mode"].dtype == np.int8
    assert data["mode"].attrs["flag_meanings"].split() == ["slip-", "stick", "slip+"]
    assert list(data["mode"].attrs["flag_values"]) == [-1, 0, 1]
    assert all(data[name].attrs["long_name"] for name in data.variables)
    assert all(data[name].attrs["units"] == "1" for name in data.variables if name != "mode")
    assert data["dissipated_energy"].values[-1] == pytest.approx(motion.dissipated, rel=1e-14)
    assert motion.dissipated > 0.0


def test_events(motion: Play) -> None:
    events = motion.events
    assert list(events.columns) == ["time", "from", "to", "z"]
    assert len(events) == motion.n_switches == 49
    assert np.all(events["to"].to_numpy()[:-1] == events["from"].to_numpy()[1:])
    assert motion.position(events["time"].to_numpy()) == pytest.approx(
        events["z"].to_numpy(), abs=1e-14
    )
    assert "78 switches" in repr(play(LOAD, THRESHOLD, (0, 5), initial=0.0, epsilon=0.1))


def test_certificate_sees_what_is_wrong(motion: Play) -> None:
    assert motion.certificate.ok
    assert (
        max(motion.certificate["energy balance"].value, motion.certificate["friction law"].value)
        < 1e-13
    )
    nodes = motion.nodes
    moved = replace(motion, nodes=nodes._replace(z=nodes.z + np.where(nodes.mode == 0, 1e-6, 0.0)))
    assert not moved.certificate.ok
    late = replace(
        motion, nodes=nodes._replace(time=np.concatenate([nodes.time[:-3], nodes.time[-3:] - 1e-5]))
    )
    assert not late.certificate.ok
    other = replace(
        motion,
        bounds=replace(
            motion.bounds,
            load=play("5*t - t**2 + 1e-7*sin(9*t)", 1, (0, 5), initial=0.0).bounds.load,
        ),
    )
    assert not other.certificate.ok


def test_refused_times(motion: Play) -> None:
    with pytest.raises(DeclarationError, match="Use 0 <= t <= 5"):
        motion.at([1.0, 5.1])
    with pytest.raises(DeclarationError, match="Use 0 <= t <= 5"):
        motion.position(np.nan)
    with pytest.raises(DeclarationError, match="'right'"):
        motion.at(1.0, side="middle")
    assert motion.at([])["z"].shape == (0,)


# --- Bad input ------------------------------------------------------------------------------------

UP = np.linspace(0, 5, 6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"load": "5*u"}, "load: unknown name 'u'. Known here: t"),
        ({"load": "__import__('os')"}, "load: unknown function '__import__'"),
        ({"threshold": "1 + s"}, "threshold: unknown name 's'"),
        ({"threshold": "1 + t", "epsilon": 0.1}, "threshold: unknown name 't'"),
        ({"threshold": ("1", "rho")}, r"threshold\[1\]: unknown name 'rho'"),
        ({"threshold": "cos(t)"}, r"threshold: ρ⁻ is negative, -1 at t = 3.14159265"),
        (
            {"threshold": ("0.1 - sin(2*pi*s)", 1), "epsilon": 0.1},
            r"ρ⁺ is negative, -0.9 at .*phase s = 0.25",
        ),
        ({"threshold": -1}, "ρ⁻ is negative, -1 at t = 0"),
        ({"threshold": (UP, 1 - UP)}, "ρ⁻ is negative"),
        (
            {"initial": 1.5},
            r"initial: .*exceeds its threshold by 0.5. .* between -1 and 1; the nearest .* 1$",
        ),
        (
            {"initial": -1.5, "stiffness": 2.0},
            "exceeds its threshold by 2. .*nearest stable value is -0.5",
        ),
        ({"initial": float("nan")}, "initial: expected a number, got nan"),
        ({"initial": "0"}, "initial: expected a number, got '0'"),
        ({"t_span": (5, 0)}, r"t_span: \(5, 0\) is not a time span"),
        ({"t_span": 5}, "t_span: expected a pair of numbers, got 5"),
        ({"epsilon": 0.0}, "epsilon: 0.0 is not a positive number"),
        ({"epsilon": 1e-9, "threshold": THRESHOLD}, "epsilon: the span needs .* panels"),
        ({"stiffness": -1}, "stiffness: -1 is not a positive number"),
        (
            {"interpolation": "spline"},
            "interpolation: unknown interpolation 'spline'. Choose from linear, monotone",
        ),
        ({"load": [1, 2, 3]}, r"load: its shape is \(3,\), but a single value is needed"),
        ({"load": lambda t: "x"}, "load: no value at t = 0"),
        ({"load": "log(t - 1)"}, "load: it is nan at t = "),
        ({"load": lambda t: 1.0 if t < 4.4 else float("inf")}, "load: it is inf at t = 4.[4-9]"),
        ({"load": lambda t: math.sin(1e9 * t)}, "load: it is not smooth .* vectorised"),
        ({"threshold": "1 + cos(1e7*t)"}, "threshold: it is not smooth .*epsilon="),
        ({"load": (UP, np.where(UP == 3, np.nan, UP))}, "load: it is nan at t = 3"),
        ({"load": (np.where(UP == 3, np.inf, UP), UP)}, r"load, times\[3\]: it is inf"),
        ({"load": (UP, UP[:-1])}, "load: 6 times and 5 values"),
        ({"load": (UP[[0, 1, 3, 2, 4, 5]], UP)}, "do not increase: 3, then 2 at index 3"),
        ({"load": (UP[[0, 1, 1, 2, 3, 5]], UP)}, "do not increase: 1, then 1 at index 2"),
        (
            {"load": (UP, UP), "t_span": (0, 6)},
            "known for 0 <= t <= 5 only, but the span is 0 ... 6",
        ),
        (
            {"threshold": (UP, UP), "epsilon": 0.1},
            "one period of the phase s = t/epsilon is 0 ... 1",
        ),
    ],
)
def test_bad_input(change: dict[str, Any], message: str) -> None:
    given: dict[str, Any] = {"load": "5*t - t**2", "threshold": 1, "t_span": (0, 5), "initial": 0.0}
    with pytest.raises(DeclarationError, match=message):
        play(**(given | change))


def test_samples_are_kept_from_change() -> None:
    t, load = np.linspace(0, 5, 50), np.linspace(0, 5, 50)
    motion = play((t, load), 1, (0, 5), initial=0.0)
    load[:] = 0.0
    assert motion.at(5.0)["load"] == 5.0
    assert motion.certificate.ok


# --- Pictures and examples ------------------------------------------------------------------------


def test_picture_of_a_play(motion: Play) -> None:
    (axes,) = plot_play(motion).axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time $t$", "position $z$")
    (line,) = axes.get_lines()
    t, z = line.get_data()
    assert np.array_equal(z, motion.position(np.asarray(t)))
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["$z$", "stable region"]  # type: ignore[union-attr]
    assert motion.plot().axes[0].get_xlim() == (0.0, 5.0)


def test_a_jump_is_drawn_upright() -> None:
    (axes,) = plot_play(play(1, "piecewise(t < 1, 2, 0.25)", (0, 2), initial=0.0)).axes
    t, z = (np.asarray(data) for data in axes.get_lines()[0].get_data())
    assert np.ptp(t[np.flatnonzero(np.diff(z)) + np.arange(2)]) < 1e-15


def test_picture_of_many_nodes() -> None:
    t = np.linspace(0, 1, 200_001)
    (axes,) = plot_play(play((t, np.sin(20 * t)), 0.3, (0, 1), initial=0.0)).axes
    assert len(np.asarray(axes.get_lines()[0].get_xdata())) < 10_000


def test_figure_2_1() -> None:
    example = runpy.run_path(str(EXAMPLES / "play-moving-threshold.py"))
    resolved, averaged = example["resolved"], example["averaged"]
    assert 0.3 < example["distance"] < 0.5
    assert averaged.dissipated == pytest.approx(0.5 * (5.75 + 5.25), rel=1e-14)
    left, right = plot_limit(resolved, averaged).axes
    assert left.get_title(loc="left") == r"$\varepsilon = 0.1$"
    assert right.get_title(loc="left") == r"$\varepsilon \to 0$"
    assert left.get_ylim() == right.get_ylim()


def test_prandtl_ishlinskii_example() -> None:
    example = runpy.run_path(str(EXAMPLES / "prandtl-ishlinskii.py"))
    load, output = example["load"], example["output"]
    assert example["error"] < 1e-15
    # Return-point memory: on the way up from −3, the inner loops 1 → −1.5 → 1 and 2 → 0.5 → 2 leave
    # no trace.
    turns = np.arange(len(load))[::400]
    outer = prandtl_ishlinskii(
        np.linspace(-3, 3, 1201),
        example["RADII"],
        example["WEIGHTS"],
        initial=plays(load[:801], example["RADII"])[-1],
    )
    for k in range(turns[2], turns[3]):
        assert output[k] == pytest.approx(
            np.interp(load[k], np.linspace(-3, 3, 1201), outer), abs=1e-5
        )
    assert output[-1] == pytest.approx(outer[-1], abs=1e-14)
    assert output[turns[-1]] == pytest.approx(output[turns[1]], abs=1e-14)
    figure = plot_loops(load, example["positions"], output)
    assert [axes.get_xlabel() for axes in figure.axes] == [r"load $\ell$"] * 2


def test_a_play_of_expressions(tmp_path: Path) -> None:
    """The same as that of their texts, on disk, too."""
    t, s = ex.sym("t"), ex.sym("s")
    load = 2.0 * ex.call("sin", t)
    threshold = 1.0 + 0.5 * ex.call("erf", ex.call("sin", 2.0 * math.pi * s))
    own = play(load, threshold, (0.0, 7.0), initial=0.0, epsilon=0.5)
    texts = play(ex.to_text(load), ex.to_text(threshold), (0.0, 7.0), initial=0.0, epsilon=0.5)
    assert own.certificate.ok
    np.testing.assert_array_equal(own.nodes.z, texts.nodes.z)
    own.save(tmp_path / "play.nc")
    again = ss.open(tmp_path / "play.nc")
    np.testing.assert_array_equal(again.nodes.z, own.nodes.z)
    assert again.certificate.ok
    waves = ex.add(*((ex.call("sin", k * t), 1.0 / k**2) for k in range(1, 200)))
    with pytest.raises(StickslipError, match="too long to be written as text"):
        play(waves, 1.0, (0.0, 0.1), initial=0.0).save(tmp_path / "long.nc")
