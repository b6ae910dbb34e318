"""[M] sections 1, 2.1 and 2.2: dissipation potentials, energetic solutions, the play with an
oscillating threshold."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy import ndarray as Array

import stickslip as ss
from stickslip import catalogue
from stickslip_paper.sections.claim import (
    Finding,
    Verdict,
    claim,
    corrects,
    equals,
    maximum,
    minimum,
    scales,
    shows,
    together,
    vanishes,
)
from stickslip_paper.sections.laws import at_events

_LOAD = "5*t - t**2"
_SPAN = (0.0, 5.0)
_TOP = 2.5
_HEIGHT = 6.25
_SMOOTH = "1 + cos(2*pi*s)/2"
_KINK = "0.5 + abs(sin(pi*(s - 0.2)))"
_LEAST = 0.5  # minimum of both


def load(t: Array) -> Array:
    return 5 * t - t**2


def smooth(s: Array) -> Array:
    return 1 + np.cos(2 * np.pi * s) / 2


def oscillating(epsilon: float, rho: str = _SMOOTH) -> ss.Play:
    """z_ε of section 2.2."""
    return ss.play(_LOAD, rho, _SPAN, initial=0.0, epsilon=epsilon)


def limit(t: Array, least: float = _LEAST) -> Array:
    """z_0 as it is printed."""
    up = np.maximum(0.0, load(np.minimum(t, _TOP)) - least)
    return np.where(t <= _TOP + np.sqrt(least), up, np.minimum(_HEIGHT - least, load(t) + least))


@claim(
    "section 1",
    "R(q, z, γż) = γ R(q, z, ż) for γ > 0, R ≥ 0 convex",
    "50 random pairs of velocities",
)
def dissipation_is_homogeneous() -> Finding:
    """The dissipation potential of dry friction is nonnegative, convex and positively homogeneous
    of degree 1."""
    potential = ss.WeightedL1(["2 - cos(2*pi*s)", "2 + cos(2*pi*s)"], ["1", "3"])
    rng = np.random.default_rng(0)
    error = convexity = 0.0
    for _ in range(50):
        v = rng.normal(size=2)
        w = rng.normal(size=2)
        s = rng.uniform()
        factor = rng.uniform(0.1, 10)
        value = potential.value(s, v)
        error = maximum(error, abs(potential.value(s, factor * v) / factor - value), -value)
        convexity = maximum(convexity, potential.value(s, v + w) - value - potential.value(s, w))
    return together(
        vanishes(error, 1e-13, "homogeneity"), vanishes(maximum(convexity, 0.0), 1e-13, "convexity")
    )


@claim(
    "figure 1.1",
    "plate compactor: N(t) = mg + F cos Ωt",
    "thresholds at all instants at which a motion starts",
)
def compactor_moves_when_light() -> Finding:
    """Pushed horizontally, the vibrating plate compactor moves only when the normal pressure is
    very low."""
    motion = ss.simulate(catalogue.plate_compactor(), (0.0, 3.0), parameters={"V": 0.02})
    at_rest = 0.6 * 100.0 * 9.81
    starts = at_events(motion, "slip+", contact="ground")
    starts = starts[starts > 1.0]
    share = motion.at(starts)["threshold_plus_ground"] / at_rest
    t = np.linspace(1.0, 3.0, 4001)
    pull = float(np.mean(5000 * (0.02 * t - motion.at(t)["x"]))) / at_rest
    return shows(
        bool(len(starts) > 10 and share.max() < 0.5 and pull < 0.5 and motion.certificate.ok),
        f"{len(starts)} starts at {share.min():.2f} … {share.max():.2f} of the friction without "
        "vibration; "
        f"mean pull {pull:.2f} of it (both below 0.5)",
        largest_share=float(share.max()),
        mean_pull=pull,
    )


@claim(
    "(1.1)",
    "0 ∈ ∂_żR_RI(t/ε, ż) + D_zE(t, z)",
    "motion of the catalogue's declaration, event by event, against the exact play, "
    "ε = 0.1, 2001 times",
)
def reduced_equation() -> Finding:
    """Where the oscillation is given, an equation for z alone is left."""
    t = np.linspace(*_SPAN, 2001)
    z = ss.simulate(catalogue.oscillating_play(), _SPAN).at(t)["z"]
    return vanishes(float(np.abs(z - oscillating(0.1).position(t)).max()), 1e-9)


@claim("section 2.1", "Ψ(0,v) ≤ CΨ(s,v) ≤ C²Ψ(0,v)", "200 phases; C = max ρ/min ρ = 3")
def potential_is_bounded_both_ways() -> Finding:
    """The oscillating potential of the example is bounded above and below by its value at one
    phase."""
    potential = ss.WeightedL1([_SMOOTH])
    C = 3.0
    first = potential.value(0.0, [1.0])
    values = np.array([potential.value(float(s), [1.0]) for s in np.linspace(0, 1, 200)])
    slack = minimum((C * values - first).min(), (C * C * first - C * values).min())
    return shows(
        slack >= -1e-12,
        f"least slack of the two inequalities {slack:.2g} (at least 0)",
        slack=slack,
    )


@claim(
    "(2.1)",
    "⟨Az − ℓ, v − ż⟩ + Ψ(t/ε, v) − Ψ(t/ε, ż) ≥ 0 for all v",
    "exact play, ε = 0.1, at 400 random times with 40 v each",
)
def variational_inequality() -> Finding:
    """The motion solves the evolutionary variational inequality at almost every time."""
    rng = np.random.default_rng(1)
    potential = ss.WeightedL1([_SMOOTH])
    t = rng.uniform(*_SPAN, 400)
    now = oscillating(0.1).at(t)
    worst = 0.0
    for time, z, rate in zip(t, now["z"], now["d_z"], strict=True):
        own = potential.value(time / 0.1, [rate])
        for v in (0.0, *rng.normal(scale=10, size=40)):
            gap = (z - load(time)) * (v - rate) + potential.value(time / 0.1, [v]) - own
            worst = maximum(worst, -gap / (1.0 + abs(rate)))
    return vanishes(worst, 1e-11, "largest violation")


@claim(
    "(2.2)",
    "(S)  E(t,z) ≤ E(t,ẑ) + Ψ(t/ε, ẑ − z) for all ẑ",
    "evolution in R³ by minimising movements, 60 ẑ a step",
)
def energetic_stability() -> Finding:
    """Solutions are globally stable at every time."""
    A, potential, history = _evolution()
    rng = np.random.default_rng(2)
    worst = 0.0
    for time, z in zip(history.times[::5], history.z[::5], strict=True):
        force = A @ z - _force(time)
        for size in 10.0 ** rng.uniform(-4, 1, 60):
            w = size * rng.normal(size=3)
            gain = 0.5 * w @ A @ w + force @ w + potential.value(time / 0.2, w)
            worst = maximum(worst, -gain)
    return vanishes(worst, 1e-9, "largest energy that a jump would gain")


@claim(
    "(2.2)",
    "(E)  E(T,z(T)) + ∫Ψ(s/ε,ż)ds ≤ E(0,z(0)) − ∫⟨ℓ′,z⟩ds",
    "energies of the exact play, recomputed by quadrature",
)
def energy_balance() -> Finding:
    """Solutions satisfy the energy inequality; it is even an equality."""
    motion = oscillating(0.1)
    end = motion.at(5.0)
    start = motion.at(0.0)
    balance = end["energy"] + end["dissipated_energy"] - start["energy"] - end["supplied_energy"]
    t = np.union1d(motion.time, np.linspace(*_SPAN, 100_001))
    z = motion.position(t)
    printed = 0.5 * z[-1] ** 2 - load(t[-1]) * z[-1] - np.trapezoid(-(5 - 2 * t) * z, t)
    way = np.abs(np.diff(z)) * smooth(0.5 * (t[1:] + t[:-1]) / 0.1)
    return together(
        vanishes(balance, 1e-12, "balance of the library"),
        vanishes(printed + way.sum(), 1e-5, "by quadrature"),
    )


@claim("section 2.2", "z(t) ∈ [ℓ(t) − ρ(t/ε), ℓ(t) + ρ(t/ε)]", "exact play, ε = 0.1, 20000 times")
def play_stays_in_its_band() -> Finding:
    """The solution stays in the stable interval."""
    t = np.linspace(*_SPAN, 20_001)
    z = oscillating(0.1).position(t)
    rho = smooth(t / 0.1)
    return vanishes(
        maximum(0.0, (load(t) - rho - z).max(), (z - load(t) - rho).max()), 1e-12, "largest excess"
    )


@claim(
    "section 2.2",
    "z(0) = 0, ℓ′ > 0  ⟹  z does not decrease",
    "rates of the exact play up to the top of the load",
)
def play_first_rises() -> Finding:
    """Starting from z(0) = 0 the solution cannot decrease while the load rises."""
    motion = oscillating(0.1)
    t = np.linspace(0.0, _TOP, 10_001)
    least = float(np.diff(motion.position(t)).min())
    return shows(least >= 0.0, f"least increment {least:.1e} (at least 0)", least=least)


@claim(
    "section 2.2",
    "z_ε(t) = max{0, ℓ(τ) − ρ(τ/ε) | τ ∈ [0,t]} for t ≤ 5/2 + √ρ_min",
    "running maximum over 400001 times, ε = 0.1",
)
def play_is_a_running_maximum() -> Finding:
    """On the way up the solution is the running maximum of the lower bound."""
    t = np.linspace(0.0, _TOP + np.sqrt(_LEAST), 400_001)
    running = np.maximum.accumulate(np.maximum(0.0, load(t) - smooth(t / 0.1)))
    return vanishes(np.abs(oscillating(0.1).position(t) - running).max(), 1e-7)


@claim(
    "section 2.2",
    "z_ε(t) = min{25/4 − ρ_min, ℓ(τ) + ρ(τ/ε)} for t ≥ 5/2 + √ρ_min",
    "running minimum, ε = 0.1; both constants",
    Verdict.CORRECTED,
    correction="The first entry is max_τ (ℓ(τ) − ρ(τ/ε)); 25/4 − ρ_min is its limit for ε → 0.",
    derivation="The way down starts from the position that the way up has reached, the running "
    "maximum of ℓ − ρ(·/ε). It equals 25/4 − ρ_min only if ρ has its minimum at the phase of "
    "the top, τ = 5/2.",
)
def play_comes_down_from_its_maximum() -> Finding:
    """On the way down the solution is the running minimum of the upper bound and of the highest
    position."""
    epsilon = 0.1
    t = np.linspace(*_SPAN, 1_000_001)
    highest = float((load(t) - smooth(t / epsilon)).max())
    after = t[t >= _TOP + np.sqrt(_LEAST)]
    upper = np.minimum.accumulate(load(after) + smooth(after / epsilon))
    z = oscillating(epsilon).position(after)
    printed = np.abs(z - np.minimum(_HEIGHT - _LEAST, upper)).max()
    return corrects(printed, np.abs(z - np.minimum(highest, upper)).max(), 1e-7)


@claim(
    "section 2.2",
    "the last move starts at t = 5/2 + √ρ_min",
    "start of the way down of the exact play with constant thresholds, 5 values of ρ",
    Verdict.CORRECTED,
    correction="It starts at 5/2 + √(2ρ_min); in between both printed branches are the constant "
    "25/4 − ρ_min.",
    derivation="ℓ(t) + ρ = 25/4 − ρ with ℓ(t) = 25/4 − (t − 5/2)² gives (t − 5/2)² = 2ρ.",
)
def last_move_starts_late() -> Finding:
    """The solution rests after the top of the load until the upper bound has come down to it."""
    printed = right = 0.0
    for rho in (0.1, 0.5, 1.0, 2.0, 3.0):
        start = ss.play(_LOAD, rho, _SPAN, initial=0.0).events["time"].to_numpy()[-1]
        printed = maximum(printed, abs(start - _TOP - np.sqrt(rho)))
        right = maximum(right, abs(start - _TOP - np.sqrt(2 * rho)))
    return corrects(printed, right, 1e-12, "start of the last move")


@claim(
    "section 2.2",
    "z_0(t) = max{0, ℓ(τ) − ρ_min},  then min{25/4 − ρ_min, ℓ(τ) + ρ_min}",
    "exact play of the averaged potential against the printed formula, 4 values of ρ_min",
)
def limit_solution() -> Finding:
    """The limit solution is the play with the smallest threshold."""
    t = np.linspace(*_SPAN, 5001)
    error = 0.0
    for least in (0.1, 0.5, 1.0, 2.5):
        average = ss.WeightedL1([f"{least} + 1 + cos(2*pi*s)"]).average()
        threshold = float(average.bounds()[1][0])
        z = ss.play(_LOAD, threshold, _SPAN, initial=0.0).position(t)
        error = maximum(error, float(np.abs(z - limit(t, least)).max()))
    return vanishes(error, 1e-13)


@claim(
    "section 2.2",
    "‖z_ε − z_0‖_∞ ≤ Cε",
    "ss.averaging_study, fitted exponent; largest ratio to ε",
    Verdict.ASYMPTOTIC,
)
def uniform_convergence() -> Finding:
    """The solutions converge uniformly, with an error of order ε."""
    study = _study(_SMOOTH)
    epsilon, distance = study.dataset["epsilon"].values, study.dataset["distance"].values
    bound = vanishes(
        maximum((distance / epsilon).max() - 5.0, 0.0), 1e-6, "excess of the error over 5ε"
    )
    return together(scales(list(epsilon), list(distance), 1.0, 0.05, "error", "ε"), bound)


@claim(
    "section 2.2",
    "ż_ε = 0 or ż_ε = ℓ′(t) − ρ′(t/ε)/ε",
    "rates of the exact play on the way up, ε = 0.1",
)
def rates_are_zero_or_those_of_the_bound() -> Finding:
    """The rate is either zero (stiction) or that of the lower bound."""
    t = np.linspace(0.0, _TOP, 5001)[1:-1]
    rate = oscillating(0.1).at(t)["d_z"]
    bound = 5 - 2 * t + np.pi * np.sin(2 * np.pi * t / 0.1) / 0.1
    moving = np.abs(rate) > 0
    text = f"moving {moving.mean():.0%} of the time"
    found = vanishes(np.minimum(np.abs(rate), np.abs(rate - bound)).max(), 1e-9)
    return Finding(found.verdict, f"{found.measured}; {text}", found.numbers)


@claim(
    "section 2.2",
    "ż_ε ≈ 1/ε on intervals of length O(ε²)",
    "growth of ‖ż_ε‖_{L²} ~ ε^p for ρ smooth and with a kink at its minimum (ss.averaging_study)",
    Verdict.CORRECTED,
    correction="For ρ ∈ C² with a nondegenerate minimum: ż_ε ~ ε^(−1/2) on intervals of length ~ "
    "ε^(3/2). The printed orders hold if ρ has a kink at its minimum.",
    derivation="In each period z_ε makes up for about ℓ′ε. Near a smooth minimum ℓ − ρ rises by "
    "that much above a waiting level when ρ − ρ_min ~ (Δs)² ~ ε, so Δs ~ √ε, Δt = εΔs ~ ε^(3/2), "
    "rate ~ ε/ε^(3/2). With a kink Δs ~ ε. So ‖ż‖² ~ rate²·length·(1/ε) is ε^(−1/2) in the first "
    "case and ε^(−1) in the second: p = −1/4 and −1/2.",
)
def size_of_rates() -> Finding:
    """Within each period the motion happens in a short time at a high rate."""
    smooth_power, kink_power = (_study(rho).powers["rate_l2"] for rho in (_SMOOTH, _KINK))
    found = corrects(
        smooth_power + 0.5, smooth_power + 0.25, 0.03, "exponent of ‖ż‖_{L²} (smooth minimum)"
    )
    printed = abs(smooth_power + 0.5) > 0.15 and found.verdict is not Verdict.FAILS
    kink = equals(kink_power, -0.5, 0.03, "exponent with a kink")
    verdict = Verdict.CORRECTED if printed and kink.verdict is Verdict.HOLDS else Verdict.FAILS
    text = (
        f"‖ż_ε‖_{{L²}} ~ ε^{smooth_power:.3f} (smooth; printed −0.5, corrected −0.25 ± 0.03), "
        f"{kink.measured}"
    )
    return Finding(verdict, text, {"smooth": smooth_power, "kink": kink_power})


@claim(
    "section 2.2",
    "ż_ε does not converge weakly to ż_0 in L^p, 1 ≤ p < ∞",
    "share of the way that z_ε covers faster than K = 20, for ε = 1e-2, 1e-3, 1e-4",
)
def no_weak_convergence_of_rates() -> Finding:
    """The rates do not converge weakly: the motion concentrates on a null set, so they are not
    equi-integrable."""
    shares = []
    for epsilon in (1e-2, 1e-3, 1e-4):
        motion = oscillating(epsilon)
        parts = np.diff(motion.time)
        fast = np.abs(np.diff(motion.z)) > 20 * np.maximum(parts, 1e-300)
        shares.append(
            float(np.abs(np.diff(motion.z))[fast].sum() / np.abs(np.diff(motion.z)).sum())
        )
    text = ", ".join(f"{share:.3f}" for share in shares)
    return shows(
        shares[-1] > 0.95 and shares == sorted(shares),
        f"shares {text} (tending to 1)",
        share=shares[-1],
    )


@claim(
    "section 2.2",
    "ż_ε ⇀* ż_0 in M([0,T])",
    "∫φ dz_ε − ∫φ dz_0 for φ = cos(jπt/T), j < 5 (ss.averaging_study)",
    Verdict.ASYMPTOTIC,
)
def rates_converge_as_measures() -> Finding:
    """The rates converge as measures, tested with continuous functions."""
    study = _study(_SMOOTH)
    largest = study.dataset["weak_distance"].max("test").values
    return scales(
        list(study.dataset["epsilon"].values), list(largest), 1.0, 0.3, "largest defect", "ε"
    )


@cache
def _study(rho: str):
    problem = ss.Evolution([[1.0]], [_LOAD], ss.WeightedL1([rho]), [0.0], epsilon=0.1, span=_SPAN)
    return ss.averaging_study(problem, [3e-2, 1e-2, 3e-3, 1e-3], progress=_silent)


def _silent(fraction: float) -> None:
    pass


def _force(t: float) -> Array:
    return np.array([3 * np.sin(t), 2 * t, 1 - np.cos(2 * t)])


def _evolution():
    """A small evolution in R³ with four different phases."""
    A = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.0]])
    potential = ss.WeightedL1(["1 + cos(2*pi*s)/2", "1 + sin(2*pi*s)/2", "1"])
    problem = ss.Evolution(
        A, ["3*sin(t)", "2*t", "1 - cos(2*t)"], potential, np.zeros(3), epsilon=0.2, span=(0.0, 2.0)
    )
    return A, potential, ss.evolve(problem, steps=200, progress=_silent)
