"""The figures of [M]: each draws without a warning, in every format, and shows what [M] says of
it."""

from __future__ import annotations

import inspect
import io
from functools import cache

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text

from stickslip.arrays import Array
from stickslip_paper.figures import FIGURES


@cache
def drawn(key: str) -> Figure:
    return FIGURES[key].draw()


def panels(key: str) -> list[Axes]:
    return drawn(key).axes


def line(axes: Axes, name: str) -> tuple[Array, Array]:
    """The line of that label or id."""
    (found,) = [artist for artist in axes.lines if name in (artist.get_label(), artist.get_gid())]
    return points(found)


def points(artist: Line2D) -> tuple[Array, Array]:
    x, y = np.asarray(artist.get_xdata(), dtype=float), np.asarray(artist.get_ydata(), dtype=float)
    return x, y


def test_the_order_is_that_of_the_paper() -> None:
    numbered = [key for key in FIGURES if key[0].isdigit()]
    assert numbered == ["1.1", "2.1", "3.1", "3.2", "3.3", "4.1", "4.2", "4.3", "4.4"]
    assert set(FIGURES) - set(numbered) == {"averaging", "bifurcation", "speed"}
    for key, entry in FIGURES.items():
        assert entry.key == key
        assert entry.title and entry.caption.endswith(".") and "</" not in entry.caption
        assert len(inspect.getsource(entry.draw).splitlines()) <= 40


@pytest.mark.parametrize("key", FIGURES)
def test_every_format(key: str) -> None:
    figure = drawn(key)
    for form, start in (("svg", b"<?xml"), ("pdf", b"%PDF"), ("png", b"\x89PNG")):
        written = io.BytesIO()
        figure.savefig(written, format=form, dpi=60)
        assert written.getvalue().startswith(start)
    visible = [
        text
        for text in figure.findobj(Text)
        if isinstance(text, Text) and text.get_text() and text.get_visible()
    ]
    assert min(float(text.get_fontsize()) for text in visible) >= 9.0  # legible at half size


@pytest.mark.parametrize(
    ("key", "names"),
    [
        ("1.1", ["ell(t)", "z(t)", "N(t)", "rho(t", "Omega t", "psi", "$d$"]),
        ("4.1", ["m_W", "x_R", "x_L", "psi", "H_R", "H_L", "Phi"]),
    ],
)
def test_drawings_name_the_variables(key: str, names: list[str]) -> None:
    words = [text.get_text() for text in drawn(key).findobj(Text) if isinstance(text, Text)]
    for name in names:
        assert any(name in word for word in words), name


def test_1_1_a_toy_walks() -> None:
    """Both feet take the same steps, half a period apart, and are never lifted at once."""
    ways, forces = panels("1.1")[3:]
    t, right = line(forces, "$N_R$")
    _, left = line(forces, "$N_L$")
    half = (len(t) - 1) // 4
    assert np.max(np.abs(right[half:] - left[:-half])) < 1e-6
    assert right.min() > -1e-12 and np.all(right + left > 0.5)
    assert 0.2 < np.mean(right == 0.0) < 0.4  # lifted
    for black in (ways.lines[0], ways.lines[3]):
        _, way = points(black)
        assert np.all(np.diff(way) > -1e-9)
        assert way[-1] - way[0] == pytest.approx(2 * 1.9507, abs=1e-3)


def ell(t: Array) -> Array:
    return 5 * t - t**2


def test_2_1_the_staircase_stays_in_the_stable_region() -> None:
    left, right = panels("2.1")
    t, z = line(left, r"$z_\varepsilon$")
    rho = 1 + np.cos(2 * np.pi * t / 0.1) / 2
    assert np.all(np.abs(z - ell(t)) <= rho + 1e-12)
    assert np.mean(np.abs(np.diff(z)) < 1e-12) > 0.5  # rests most of the time
    assert z.max() < 25 / 4 - 1 / 2  # which [M] takes for the maximum; it is its limit
    t_0, z_0 = line(right, "$z_0$")
    exact = np.where(t_0 <= 2.5, np.maximum(0.0, ell(t_0) - 0.5), np.minimum(5.75, ell(t_0) + 0.5))
    assert z_0 == pytest.approx(exact, abs=1e-12)
    assert np.max(np.abs(z - np.interp(t, t_0, z_0))) < 0.1 * 5


def test_averaging_has_the_rates_of_section_2_2() -> None:
    left, right = panels("averaging")
    epsilon, distance = line(left, r"$\sup\,|z_\varepsilon - z_0|$")
    assert np.all(distance < 5 * epsilon)
    small = epsilon <= 0.02
    assert np.polyfit(np.log(epsilon[small]), np.log(distance[small]), 1)[0] == pytest.approx(
        1.0, abs=0.05
    )
    markers = {
        artist.get_marker(): points(artist)
        for artist in right.lines
        if artist.get_marker() != "None"
    }
    powers = {marker: np.polyfit(np.log(x), np.log(y), 1)[0] for marker, (x, y) in markers.items()}
    assert powers["s"] == pytest.approx(-0.25, abs=0.03)  # L²
    assert powers["o"] == pytest.approx(0.0, abs=0.01)  # L¹
    assert powers["^"] > 0.7  # tested with continuous functions


def test_3_1_the_limit_cycle_sticks_and_slips() -> None:
    beta, gamma = line(panels("3.1")[0], "limit cycle")
    crossing = np.flatnonzero(np.diff(np.sign(beta)) != 0)
    lower = gamma[crossing][gamma[crossing] < 1]
    upper = gamma[crossing][gamma[crossing] > 1]
    assert beta.min() < -5 and beta.max() > 3
    assert len(lower) >= 1 and len(upper) >= 1  # through A_1 and through A_2
    assert np.ptp(lower) < 1e-2 and np.ptp(upper) < 1e-2


def test_3_2_the_maps() -> None:
    left, right = panels("3.2")
    (gamma, (fixed,)) = line(right, "fixed point")[0][0], line(right, "fixed point")[1:]
    omega = np.sqrt(1 - 0.7**2 / 4)
    end_of_slip = 1 + np.exp(np.pi * 0.7 / (2 * omega)) * (1 - gamma)
    duration = -np.log(gamma / end_of_slip)
    assert (1 - np.exp(-duration)) / duration == pytest.approx(1 / end_of_slip, rel=1e-9)
    assert fixed == pytest.approx(gamma)
    x, y = line(right, "return map")
    assert np.all(np.diff(y) > 0) and np.all(np.diff(y, 2) > -1e-9)  # increasing and convex
    # Ψ'(μ₀v̂) = ρ_b
    assert (1 - y[-1]) / (1 - x[-1]) == pytest.approx(np.exp(np.pi * 0.7 / (2 * omega)), rel=5e-3)
    coarse, fine = (
        points(artist)
        for artist in right.lines
        if artist.get_marker() == "o" and len(points(artist)[0]) == 9
    )
    errors = [np.max(np.abs(again - np.interp(start, x, y))) for start, again in (coarse, fine)]
    assert 5 < errors[0] / errors[1] < 20  # ν is 100 times smaller, √ν 10 times
    assert len(left.lines) == 8


def test_3_3_long_stick_and_short_slip() -> None:
    upper, lower = panels("3.3")
    t, U = line(upper, "$U$")
    _, threshold = line(upper, r"threshold $\tilde\mu(\alpha)$")
    sticks = np.abs(np.diff(U) / np.diff(t) - 0.01) < 1e-9
    assert np.mean(sticks) == pytest.approx(0.912, abs=0.005)
    assert np.all(U[:-1][sticks] <= threshold[:-1][sticks] + 1e-12)
    alpha = points(lower.lines[0])[1]
    decay = np.diff(np.log(alpha - 1)) / np.diff(t)
    assert decay[sticks] == pytest.approx(-1.0, abs=1e-6)
    slips = np.count_nonzero(np.diff(sticks.astype(int)) == 1)
    assert slips == 3
    assert (1 - np.mean(sticks)) * t[-1] / slips == pytest.approx(
        np.pi * 0.1 / np.sqrt(0.75), abs=0.06
    )


def test_bifurcation_is_subcritical() -> None:
    axes = panels("bifurcation")[0]
    (V_hopf,), (U_hopf,) = line(axes, "Hopf point")
    assert V_hopf == pytest.approx(0.224849301296112, abs=1e-11)
    alpha = 1 + V_hopf * U_hopf
    slope = -(alpha**-1.5)
    assert -1 - (1 + U_hopf * slope) / 0.05 == pytest.approx(0.0, abs=1e-9)  # trace DF
    V_fold, _ = line(axes, "stick onset and fold")
    assert V_fold == pytest.approx(0.2263881277, abs=1e-9)
    extent = {}
    for name in ("$V$ rising", "$V$ falling"):
        low, high = (points(artist)[1] for artist in axes.lines if artist.get_gid() == name)
        extent[name] = high - low
    V = next(points(artist)[0] for artist in axes.lines if artist.get_gid() == "$V$ rising")
    both = (extent["$V$ rising"] > 0.1) & (extent["$V$ falling"] < 1e-3)
    assert V[both].min() > V_hopf and V[both].max() == pytest.approx(0.22625, abs=1e-9)
    assert np.all(extent["$V$ falling"][V_hopf - V > 1e-4] > 0.1)
    assert np.all(extent["$V$ rising"][V > 0.227] < 1e-3)


def test_4_2_the_corners() -> None:
    axes = panels("4.2")[0]
    psi, upper = line(axes, "G+")
    _, lower = line(axes, "G-")
    assert np.all(upper > lower)
    assert lower == pytest.approx(-upper[::-1], abs=1e-12)
    at = np.argmin(np.abs(psi - 1.0))
    assert upper[at] == pytest.approx(-0.5)
    assert upper[at - 1] > upper[at] < upper[at + 1]


def test_4_3_the_motion_is_on_the_branches() -> None:
    axes = panels("4.3")[0]
    psi, Gamma = line(axes, r"$\Gamma(\psi)$, for $\dot\psi > 0$")
    walk, d = line(axes, "motion of (4.2)")
    rising = np.interp(walk, psi, Gamma)
    falling = -np.interp(-walk, psi, Gamma)
    off = np.minimum(np.abs(d - rising), np.abs(d - falling))
    assert off.max() < 1e-9
    assert np.abs(d - rising).max() > 0.4 and np.abs(d - falling).max() > 0.4
    grid = np.linspace(psi[0], psi[-1], 10_001)
    area = np.trapezoid(np.interp(grid, psi, Gamma) + np.interp(-grid, psi, Gamma), grid)
    assert 0.3 * area == pytest.approx(2 * 0.3 * 0.5 * (1 / 6 + 1), abs=1e-6)


def test_4_4_the_spiral_ends_in_a_cycle_that_closes() -> None:
    plane, angle, legs = panels("4.4")
    psi, rate = line(plane, "limit cycle")
    assert psi.max() == pytest.approx(1.6236, abs=1e-3)
    distance = np.hypot(psi[-300:] - psi[0], rate[-300:] - rate[0])
    assert distance.min() < 2e-3  # after one period of 5.969 s
    radius = {name: np.hypot(*line(plane, name)) for name in ("inside", "outside", "limit cycle")}
    assert radius["outside"].min() > radius["limit cycle"].min() > radius["inside"][0]
    for name, sign in (("inside", 1), ("outside", -1)):
        turns = radius[name][: 6000 // 597 * 597].reshape(-1, 597).mean(axis=1)
        assert np.all(sign * np.diff(turns) > 0)
    t, x_R = line(legs, "right leg, $x_R$")
    _, x_L = line(legs, "left leg, $x_L$")
    assert np.all(np.diff(x_R) > -1e-12) and np.all(np.diff(x_L) > -1e-12)
    late = t > 10
    assert np.max(np.abs(x_R - x_L)[late]) == pytest.approx(0.5, abs=1e-9)
    assert len(points(angle.lines[0])[0]) == len(t)


def test_speed_has_its_thresholds() -> None:
    axes = panels("speed")[0]
    P, v = line(axes, "walking")
    assert P[0] == pytest.approx(0.6166067, abs=2e-5)
    assert v[0] == pytest.approx(0.03745, abs=5e-5)
    assert np.interp(1.0, P, v) == pytest.approx(0.1675, abs=5e-5)
    last = P > 1.562863
    assert v[last] / (1.7 - P[last]) == pytest.approx(
        np.full(last.sum(), v[-1] / (1.7 - P[-1])), rel=1e-6
    )
    assert np.argmax(v) == np.argmax(last) - 1
