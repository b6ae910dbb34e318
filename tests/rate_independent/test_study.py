"""[M] Theorem 2.2 measured: z_ε → z_0 uniformly, rates as measures only."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from stickslip.arrays import Array
from stickslip.certificates import Certificate
from stickslip.errors import DeclarationError
from stickslip.rate_independent.dissipation import GroupNorm, WeightedL1
from stickslip.rate_independent.evolution import averaging_study as study_module
from stickslip.rate_independent.evolution.averaging_study import (
    AveragingStudy,
    averaging_study,
    fitted_power,
)
from stickslip.rate_independent.evolution.blocks import TESTS, Gauge, PlayMotion, SteppedMotion
from stickslip.rate_independent.evolution.evolution import Evolution

SMOOTH = "1 + cos(2*pi*s)/2"
KINK = "1/2 + abs(sin(pi*(s - 0.3)))"
EPSILONS = [0.1, 0.03, 0.01, 0.003, 0.001]


def section_2_2(threshold: str, epsilon: float = 1.0) -> Evolution:
    """ℓ = 5t − t², z(0) = 0."""
    return Evolution([[1.0]], "5*t - t**2", WeightedL1([threshold]), [0.0], epsilon, (0, 5))


@cache
def studied(threshold: str) -> AveragingStudy:
    return averaging_study(section_2_2(threshold), EPSILONS)


@pytest.mark.parametrize(("threshold", "power"), [(SMOOTH, -0.25), (KINK, -0.5)])
def test_section_2_2(threshold: str, power: float) -> None:
    """First order in ε; the total variation stays at 11; the rates in L² grow like ε^(−1/4) or
    ε^(−1/2).

    In a period z slides by εℓ′. Near a smooth minimum of ρ this takes ε√ε, at rates 1/√ε; at a kink
    ε², at rates 1/ε.
    """
    study = studied(threshold)
    table = study.dataset
    assert study.rate == pytest.approx(1.0, abs=0.1)
    assert np.all(table["distance"] < 5.0 * table["epsilon"])
    assert study.powers["equicontinuity"] == pytest.approx(1.0, abs=0.15)
    # Of the order ε, with a factor that depends on where in a period the motion turns and ends.
    assert np.all(table["weak_distance"].max("test") < 6.0 * table["epsilon"])
    assert study.powers["weak_distance"] > 0.8
    assert study.powers["rate_l2"] == pytest.approx(power, abs=0.03)
    assert study.powers["steps"] == pytest.approx(-1.0, abs=0.05)
    # z_0 rises to 25/4 − 1/2 and falls to 1/2; its rate is that of ℓ while it moves.
    np.testing.assert_allclose(table["averaged_rate_l1"], 11.0, rtol=1e-6)
    assert np.all(np.abs(table["rate_l1"] - 11.0) < 4.0 * table["epsilon"])
    start = 2.5 - np.sqrt(5.75)  # ℓ = 1/2
    turn = 3.5  # ℓ = 25/4 − 1
    square = ((5 - 2 * start) ** 3 + 5**3 - (2 * turn - 5) ** 3) / 6  # ∫ℓ′²
    np.testing.assert_allclose(table["averaged_rate_l2"], np.sqrt(square), rtol=1e-3)
    np.testing.assert_allclose(table["averaged_dissipated"], 5.5, rtol=1e-9)
    np.testing.assert_allclose(table["dissipated"][-1], 5.5, rtol=2e-2)
    assert np.all(np.diff(table["dissipated"]) < 0.0)
    assert study.saved["steps"][-1] > 300.0


def test_distance_is_that_of_the_closed_formula() -> None:
    """sup|z_ε − z_0| on a fine grid, z_ε as the running maximum and minimum of section 2.2."""
    t = np.linspace(0.0, 5.0, 1_000_001)
    ell = 5 * t - t**2
    rho = 1 + np.cos(2 * np.pi * t / 0.1) / 2

    def motion(threshold: Array) -> Array:
        rising = np.maximum.accumulate(np.maximum(ell - threshold, 0.0))
        after = np.arange(len(t)) > int(np.argmax(rising))
        return np.where(
            after, np.minimum.accumulate(np.where(after, ell + threshold, rising.max())), rising
        )

    exact = np.abs(motion(rho) - motion(np.full_like(t, 0.5))).max()
    assert float(studied(SMOOTH).dataset["distance"][0]) == pytest.approx(exact, abs=1e-4)


def test_stepped_motions_measure_the_same_as_exact_ones() -> None:
    problem = section_2_2(SMOOTH, 0.1)
    grid = np.linspace(0.0, 5.0, 257)
    reference = PlayMotion(replace(section_2_2(SMOOTH), dissipation=WeightedL1([0.5])))
    exact = Gauge(problem.A, grid, reference.at).measure(PlayMotion(problem))
    stepped_motion = SteppedMotion(problem, 1e-5, keep=True)
    stepped = Gauge(problem.A, grid, reference.at).measure(stepped_motion)
    assert stepped.distance == pytest.approx(exact.distance, abs=1e-4)
    assert stepped.variation == pytest.approx(exact.variation, abs=1e-3)
    assert stepped.square == pytest.approx(exact.square, rel=1e-2)
    np.testing.assert_allclose(stepped.tested, exact.tested, atol=1e-3)
    np.testing.assert_allclose(stepped.modulus, exact.modulus, atol=1e-3)
    assert stepped_motion.dissipated == pytest.approx(PlayMotion(problem).dissipated, rel=1e-4)
    times = np.linspace(0.0, 5.0, 1234)
    np.testing.assert_allclose(stepped_motion.at(times), PlayMotion(problem).at(times), atol=1e-4)


class Ramp:
    """z = (t², −t), affine between 4001 times."""

    steps = 4000
    wall_time = 0.0
    dissipated = 0.0
    certificate = Certificate(())

    def blocks(self) -> Iterator[tuple[Array, Array]]:
        t = np.linspace(0.0, 2.0, 4001)
        for part in np.array_split(t, 7):
            yield part, self.at(part)

    def at(self, times: Array) -> Array:
        return np.column_stack([times**2, -times])


def test_gauge_against_integrals() -> None:
    """|z|² = 4z₁² + z₂²; derivatives (2t, −1), tests cos(jπt/2)."""
    grid = np.linspace(0.0, 2.0, 401)
    gauge = Gauge(np.diag([4.0, 1.0]), grid, lambda times: np.zeros((len(times), 2))).measure(
        Ramp()
    )
    assert gauge.distance == pytest.approx(np.sqrt(4 * 16 + 4))
    assert gauge.square == pytest.approx(16 * 8 / 3 + 2, rel=1e-6)
    w = 4.0 * np.array([0.0, 2.0])
    assert gauge.variation == pytest.approx(
        np.diff(w * np.sqrt(w**2 + 1) + np.arcsinh(w))[0] / 8, rel=1e-6
    )
    k = np.arange(1, TESTS) * np.pi / 2
    first = 2 * (np.cos(2 * k) - 1) / k**2  # ∫2t cos kt, sin 2k = 0
    np.testing.assert_allclose(
        gauge.tested, np.vstack([[4.0, -2.0], np.column_stack([first, 0 * k])]), atol=1e-6
    )
    lag = 0.005 * np.arange(1, 401)
    np.testing.assert_allclose(
        gauge.modulus, np.sqrt(4 * (4 - (2 - lag) ** 2) ** 2 + lag**2), rtol=1e-6
    )


@pytest.mark.parametrize(
    "psi",
    [WeightedL1(["2 - cos(2*pi*s)", "2 + cos(2*pi*s)"]), GroupNorm(["1 + cos(2*pi*s)/2"])],
    ids=["Example 2.1", "planar"],
)
def test_the_plane(psi) -> None:
    problem = Evolution(
        np.array([[2.5, 0.5], [0.5, 1.5]]), ["2*t", "3*sin(2*t)"], psi, np.zeros(2), span=(0, 2)
    )
    study = averaging_study(problem, [0.2, 0.1, 0.05], tolerance=1e-3)
    assert study.stopped == "" and study.dataset["epsilon"].values.tolist() == [0.2, 0.1, 0.05]
    assert study.rate == pytest.approx(1.0, abs=0.3)
    assert study.powers["weak_distance"] > 0.5
    assert study.powers["rate_l2"] < -0.1
    assert abs(study.powers["rate_l1"]) < 0.1
    assert "epsilon = 0.2 ... 0.05" in repr(study)


def test_pictures() -> None:
    figure = studied(SMOOTH).plot()
    legends = [axes.get_legend() for axes in figure.axes]
    labels = [text.get_text() for part in legends if part is not None for text in part.get_texts()]
    assert (
        len(labels) == 4
        and r"\varepsilon^{0.94}" in labels[0]
        and r"\varepsilon^{-0.2" in labels[3]
    )


def test_interrupted_studies_keep_what_they_have(monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(fraction: float) -> None:
        if fraction > 0.2:
            raise KeyboardInterrupt

    study = averaging_study(section_2_2(SMOOTH), [0.2, 0.1, 0.05], progress=stop)
    assert study.outcome.interrupted and study.dataset["epsilon"].values.tolist() == [0.2, 0.1]
    jump = Evolution(
        np.eye(2),
        ["piecewise(t < 1/2, 0, 3)", "0"],
        WeightedL1(["1 + cos(2*pi*s)/2", "1"]),
        np.zeros(2),
        span=(0, 1),
    )
    with pytest.raises(study_module.ConvergenceError, match="jump"):
        averaging_study(jump, [0.1])


@pytest.mark.parametrize(
    ("problem", "epsilons", "words"),
    [
        (section_2_2(SMOOTH), [0.1, -1.0], ["epsilons", "positive"]),
        (section_2_2(SMOOTH), [], ["epsilons"]),
        (section_2_2("1"), [0.1], ["dissipation", "phase"]),
        (
            Evolution([[1.0]], "1 + t", WeightedL1([SMOOTH]), [0.0]),
            [0.1],
            ["initial", "every phase", "by 0.5", "settled"],
        ),
    ],
)
def test_bad_studies_are_refused(problem: Evolution, epsilons: list, words: list[str]) -> None:
    with pytest.raises(DeclarationError) as caught:
        averaging_study(problem, epsilons)
    for word in words:
        assert word in str(caught.value)


def test_fitted_power() -> None:
    x = np.array([0.1, 0.2, 0.4])
    assert fitted_power(x, 3.0 * x**1.5) == pytest.approx((1.5, 3.0))
    assert np.isnan(fitted_power(x, np.array([0.0, 0.0, 1.0]))[0])
