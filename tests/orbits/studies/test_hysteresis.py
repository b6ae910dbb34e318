"""The hysteresis operator of the toy: its curves, its memory, the oscillator that it reduces to.

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017), sections 4.3 and 4.4.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stickslip import catalogue, simulate
from stickslip.errors import DeclarationError
from stickslip.orbits.studies.hysteresis import HysteresisOperator
from stickslip.symbolic import expressions as ex
from systems import distance

SETS = [
    {},
    {"a": 2.0, "c": 0.4, "P": 1.3, "rho": 0.1, "psi_star": 0.7, "H_star": 4.0},
    {"P": 0.8, "rho": 0.3, "H_star": 1.7},
]


@cache
def operator(index: int = 0) -> HysteresisOperator:
    return HysteresisOperator.of(catalogue.rocking_toy(), parameters=SETS[index])


@pytest.mark.parametrize("index", range(len(SETS)))
def test_curves_are_those_of_the_paper(index: int) -> None:
    h = operator(index)
    v = {**catalogue.rocking_toy().values, **SETS[index]}
    psi = np.linspace(-4, 4, 801)
    right = v["H_star"] / 2 * (1 + np.clip(psi / v["psi_star"], -1, 1))
    left = right[::-1]
    G = {
        (leg, s): (pull + v["c"] * psi + s * (v["rho"] + H)) / v["a"]
        for leg, pull, H in (("right leg", v["P"], right), ("left leg", -v["P"], left))
        for s in (1, -1)
    }
    for leg in ("right leg", "left leg"):
        low, high = h.legs[leg]
        assert distance(low(psi), G[leg, -1]) < 1e-13
        assert distance(high(psi), G[leg, 1]) < 1e-13
    assert distance(h.upper(psi), np.minimum(G["right leg", 1], G["left leg", 1])) < 1e-13
    assert distance(h.lower(psi), np.maximum(G["right leg", -1], G["left leg", -1])) < 1e-13


@pytest.mark.parametrize("index", range(len(SETS)))
def test_characteristic_points(index: int) -> None:
    """Read off the curves, they are the closed forms of the catalogue."""
    toy = catalogue.rocking_toy()
    values = {**toy.values, **SETS[index]}
    facts = {name: ex.evaluate(fact, values) for name, fact in toy.declaration.facts.items()}
    h = operator(index)
    assert (h.X, h.psi_2, h.psi_3) == pytest.approx(
        (facts["X"], facts["psi_2"], facts["psi_3"]), rel=1e-12
    )


def test_loop_feeds_the_energy_of_a_period() -> None:
    psi, d = operator().loop(-1.6, 1.6)
    area = 0.5 * np.sum(psi * np.roll(d, -1) - d * np.roll(psi, -1))
    oscillator = catalogue.rocking_oscillator()
    energy = ex.evaluate(oscillator.declaration.facts["energy_per_period"], oscillator.values)
    assert -0.3 * area == pytest.approx(energy, rel=1e-13) == pytest.approx(0.35)
    assert (psi[0], d[0]) == (psi[-1], d[-1])


@pytest.mark.parametrize(
    "start", [{"psi": -2.4, "x_R": 0.2}, {"psi": 0.9, "x_R": -0.6}, {"psi": -3.5, "x_R": 0.1}]
)
def test_legs_of_the_toy_follow_it(start: dict[str, float]) -> None:
    """d of a computed motion is the operator of its ψ, exactly at every switch and turning
    point."""
    motion = simulate(catalogue.rocking_toy(), (0.0, 40.0), initial=start)
    assert motion.certificate.ok
    t = np.union1d(np.linspace(0.0, 40.0, 4001), motion.knots.time)
    values = motion.at(t)
    psi = values["psi"]
    d = values["x_R"] - values["x_L"]
    turns = np.sum(np.diff(np.sign(values["d_psi"])) != 0)
    assert turns > 10
    # Between samples ψ turns by at most ψ̈ h²/8; the curves have slopes up to 1.2.
    assert distance(operator()(psi, initial=d[0]), d) < 2e-4
    moving = np.abs(values["d_psi"]) > 0.1
    assert distance(operator()(psi, initial=d[0])[moving], d[moving]) < 1e-10 + 2e-4 * (
        np.max(np.abs(psi)) < 1.0
    )


angles = st.floats(-3.0, 3.0, allow_nan=False)


@given(st.lists(angles, min_size=2, max_size=8), st.floats(-3.0, 3.0), st.integers(0, 2))
@settings(max_examples=60, deadline=None)
def test_memory(turns: list[float], initial: float, index: int) -> None:
    """Return-point memory, no dependence on speed, values between the curves, swings that clip,
    monotone in d."""
    h = operator(index)
    d = h(turns, initial=initial)
    assert np.all(d <= h.upper(turns) + 1e-14)
    assert np.all(d >= h.lower(turns) - 1e-14)
    a, b = turns[-2:]
    assert h([*turns, a, b], initial=initial)[-1] == pytest.approx(d[-1], abs=1e-13)
    finer = np.concatenate([np.linspace(p, q, 7) for p, q in pairwise(turns)])
    assert h(finer, initial=initial)[-1] == pytest.approx(d[-1], abs=1e-13)
    low, high = h.swing(a, b)
    assert low <= high
    assert d[-1] == pytest.approx(np.clip(d[-2], low, high), abs=1e-14)
    assert h(turns, initial=initial + 0.1)[-1] >= d[-1] - 1e-14


def test_path_has_all_corners() -> None:
    h = operator()
    psi, d = h.path([-1.6, 1.6, 0.3, 1.5], initial=0.9)
    for i in range(len(psi) - 1):
        middle = 0.5 * (psi[i] + psi[i + 1])
        assert h([psi[i], middle], initial=d[i])[-1] == pytest.approx(
            0.5 * (d[i] + d[i + 1]), abs=1e-13
        )


def test_a_function_of_time() -> None:
    h = operator()
    play = h.driven(lambda t: 1.5 * np.sin(t), (0.0, 20.0), initial=0.0)
    assert play.certificate.ok
    times = np.union1d(np.pi / 2 * np.arange(1, 13, 2), [0.0, 3.0, 7.7, 20.0])
    assert play.final == pytest.approx(h(1.5 * np.sin(times), initial=0.0)[-1], abs=1e-12)


def test_reduced_oscillator_is_the_toy_in_simple_motion_only() -> None:
    """Up to the amplitude ψ_2 both move alike; beyond, the held legs are pushed on and 𝐆 is no
    function any more."""
    h = operator()
    for start, alike in ((-h.psi_2 + 0.05, True), (-h.psi_2 - 0.3, False)):
        d = float(np.clip(h.X, h.lower(start), h.upper(start)))
        toy = simulate(
            catalogue.rocking_toy(), (0.0, 6.0), initial={"psi": start, "x_R": d, "x_L": 0.0}
        )
        reduced = simulate(catalogue.rocking_oscillator(), (0.0, 6.0), initial={"psi": start})
        t = np.linspace(0.0, 6.0, 301)
        miss = distance(toy.at(t)["psi"], reduced.at(t)["psi"])
        assert miss < 1e-10 if alike else miss > 1e-2


def test_what_has_no_such_operator() -> None:
    with pytest.raises(DeclarationError, match="no two rate-independent"):
        HysteresisOperator.of(catalogue.belt_block())
    with pytest.raises(DeclarationError, match="not piecewise affine"):
        HysteresisOperator.of(catalogue.rocking_toy(H_R="H_star/2*(1 + tanh(psi))"))
    with pytest.raises(DeclarationError, match="G- exceeds"):
        HysteresisOperator.of(catalogue.rocking_toy(), parameters={"P": 2.0})
    with pytest.raises(DeclarationError, match="do not alternate"):
        HysteresisOperator.of(catalogue.rocking_toy(), parameters={"H_star": 0.5, "P": 0.3}).X  # noqa: B018
    with pytest.raises(DeclarationError, match="finite numbers"):
        operator()([0.0, np.nan])
