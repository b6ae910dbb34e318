"""[M] section 2.3: the averaged dissipation potential and the averaging theorem."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy import ndarray as Array

import stickslip as ss
from stickslip_paper.sections.claim import (
    Finding,
    Verdict,
    claim,
    equals,
    maximum,
    scales,
    shows,
    together,
    vanishes,
)

_PHASES = np.linspace(0.0, 1.0, 721)


def example() -> ss.WeightedL1:
    """Ψ of example 2.1."""
    return ss.WeightedL1(["2 - cos(2*pi*s)", "2 + cos(2*pi*s)"])


def rotating() -> ss.Ellipsoid:
    """An ellipse with the semi-axes 2 and 1/2 that turns fully in a period."""

    def shape(s: float) -> Array:
        c, d = np.cos(np.pi * s), np.sin(np.pi * s)
        turn = np.array([[c, -d], [d, c]])
        return turn @ np.diag([4.0, 0.25]) @ turn.T

    return ss.Ellipsoid(shape)


@claim(
    "(2.3)",
    "Ψ_av(V) = inf{∫Ψ(s,v(s))ds | ∫v(s)ds = V}",
    "cost of the optimal v and its dual bound, 20 random V",
)
def average_is_an_inf_convolution() -> Finding:
    """The averaged potential is the least cost of a microscopic motion with the mean V."""
    rng = np.random.default_rng(0)
    gap = 0.0
    sums = 0.0
    costs = 0.0
    potential = example()
    average = potential.average()
    for _ in range(20):
        V = rng.normal(size=2)
        motion = average.optimal_motion(V)
        spent = sum(
            potential.value(s, v) for s, v in zip(motion.phases, motion.motions, strict=True)
        )
        gap = maximum(gap, abs(motion.gap))
        sums = maximum(sums, float(np.abs(motion.motions.sum(axis=0) - V).max()))
        costs = maximum(costs, abs(spent - average.value(0.0, V)))
    return together(
        vanishes(gap, 1e-12, "duality gap"),
        vanishes(sums, 1e-12, "∫v − V"),
        vanishes(costs, 1e-12, "cost − Ψ_av"),
    )


@claim(
    "section 2.3",
    "Ψ_av ≤ Ψ(s,·) for all s",
    "example 2.1 and a turning ellipse, 181 phases, 21 directions",
)
def average_is_below_every_phase() -> Finding:
    """The averaged potential is not larger than that at any phase, and as large as the cheapest one
    along the axes."""
    above, below = 0.0, 0.0
    for potential in (example(), rotating()):
        average = potential.average()
        for angle in np.linspace(0, np.pi, 21):
            v = np.array([np.cos(angle), np.sin(angle)])
            excess = float(
                (average.value(0.0, v) - potential.sampled(_PHASES[::4]).support(v)).max()
            )
            above = maximum(above, excess)
            if np.abs(v).min() < 1e-12:  # one phase alone moves along an axis
                below = maximum(below, -excess)
    return together(
        vanishes(above, 1e-8, "largest excess"),
        vanishes(below, 1e-8, "distance from the cheapest phase along the axes"),
    )


@claim("example 2.1", "Ψ_av(v) = |v₁| + |v₂|", "ss.WeightedL1.average at 50 random v")
def example_average() -> Finding:
    """The two thresholds 2 ∓ cos 2πs average to 1 each."""
    average = example().average()
    rng = np.random.default_rng(0)
    error = maximum(
        *(abs(average.value(0.0, v) / np.abs(v).sum() - 1.0) for v in rng.normal(size=(50, 2)))
    )
    return vanishes(error, 1e-12, "largest relative difference")


@claim(
    "example 2.1",
    "z₁ moves for s ≈ 0, z₂ for s ≈ 1/2",
    "phases of the optimal motion for V = (0.7, −2)",
)
def example_phases() -> Finding:
    """Moving in the first direction is optimal at one phase, in the second at the opposite one."""
    motion = example().average().optimal_motion([0.7, -2.0])
    first = motion.phases[np.abs(motion.motions[:, 0]) > 1e-9]
    second = motion.phases[np.abs(motion.motions[:, 1]) > 1e-9]
    off = maximum(float(np.abs((first + 0.5) % 1.0 - 0.5).max()), float(np.abs(second - 0.5).max()))
    return vanishes(off, 1e-7, "largest distance of a phase from 0 and 1/2")


@claim(
    "section 2.3",
    "“the easiest opportunity”: v(s) may split the motion",
    "Ψ_av(1,1) against the cheapest single phase",
)
def two_phases_share_the_motion() -> Finding:
    """Different parts of a motion may wait for different phases, so that Ψ_av < min_s Ψ(s, ·)."""
    v = np.array([1.0, 1.0])
    single = float(example().sampled(_PHASES).support(v).min())
    shared = example().average().value(0.0, v)
    return together(
        equals(single, 4.0, 1e-12, "one phase alone"), equals(shared, 2.0, 1e-12, "shared")
    )


@claim(
    "(2.4)",
    "Ψ*(s,ξ) = 0 for ξ ∈ K(s), ∞ otherwise",
    "sign of sup{⟨ξ,v⟩ − Ψ(s,v)} over 720 directions against membership in K(s), 400 ξ",
)
def dual_is_an_indicator() -> Finding:
    """The dual of a 1-homogeneous potential is the indicator of K(s)."""
    rng = np.random.default_rng(3)
    wrong = 0
    angles = np.linspace(0, 2 * np.pi, 721)
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    for potential in (example(), rotating()):
        for _ in range(4):
            s = float(rng.uniform())
            values = np.array([potential.value(s, v) for v in directions])
            for xi in rng.uniform(-3, 3, (50, 2)):
                largest = float((directions @ xi - values).max())
                if abs(largest) > 1e-3:  # 720 directions are too few closer to the boundary
                    wrong += (largest < 0) != potential.contains(xi, s)
    return shows(wrong == 0, f"{wrong} of 400 disagree", disagree=wrong)


@claim(
    "section 2.3",
    "Ψ*_av = χ_{K_av},  K_av = ⋂ₛ K(s)",
    "membership in K_av against membership in K(s) at 181 phases, 400 random ξ",
)
def dual_of_the_average() -> Finding:
    """The stable set of the averaged potential is the intersection of all stable sets."""
    rng = np.random.default_rng(4)
    wrong = 0
    for potential, size in ((example(), 2.0), (rotating(), 0.8)):
        average = potential.average()
        inside = potential.sampled(_PHASES[::4])
        for xi in rng.uniform(-size, size, (200, 2)):
            excess = float(inside.excess(xi).max())
            if abs(excess) > 1e-3:
                wrong += (excess < 0) != average.contains(xi, tolerance=1e-9)
    return shows(wrong == 0, f"{wrong} of 400 disagree", disagree=wrong)


@claim(
    "section 2.3",
    "K_av of a turning ellipse with semi-axes 2, ½ is the disc of radius ½",
    "Ψ_av(v)/|v| in 24 directions",
)
def turning_ellipse() -> Finding:
    """Where friction is small in every direction at some phase, only that is left."""
    average = rotating().average()
    error = 0.0
    for angle in np.linspace(0, np.pi, 24, endpoint=False):
        error = maximum(error, abs(average.value(0.0, [np.cos(angle), np.sin(angle)]) - 0.5))
    return vanishes(error, 1e-7)


@claim(
    "theorem 2.2",
    "z_ε(t) → z_0(t),  0 ∈ ∂Ψ_av(ż) + Az − ℓ",
    "two coupled components with different phases, ss.averaging_study, fitted exponent "
    "of sup|z_ε − z_0|",
    Verdict.ASYMPTOTIC,
)
def averaging_theorem() -> Finding:
    """The solutions converge to that of the averaged equation."""
    table = _study().dataset
    return scales(
        list(table["epsilon"].values),
        list(table["distance"].values),
        1.0,
        0.15,
        "sup|z_ε − z_0|",
        "ε",
    )


@claim(
    "theorem 2.2",
    "0 ∈ ∂Ψ(s,0) + Aẑ_0 − ℓ(0) for all s",
    "an initial state that is stable at one phase only is refused",
)
def initial_state_is_stable_at_every_phase() -> Finding:
    """The theorem needs an initial state that is stable at every phase."""
    potential = ss.WeightedL1(["1 + cos(2*pi*s)/2"])
    refused = 0
    for z in (0.0, 0.4, 0.6, 1.2):
        problem = ss.Evolution([[1.0]], ["0"], potential, [z], epsilon=0.1, span=(0.0, 1.0))
        try:
            problem.averaged()
        except ss.DeclarationError:
            refused += 1
    return shows(
        refused == 2,
        f"{refused} of 4 states refused: those with |Az − ℓ| > ρ_min = 0.5",
        refused=refused,
    )


@claim(
    "(2.5)",
    "‖z_ε(t₂) − z_ε(t₁)‖ ≤ ω(ε) + ω(|t₂ − t₁|)",
    "excess of the modulus of continuity over that of z_0 (ss.averaging_study)",
    Verdict.ASYMPTOTIC,
)
def asymptotic_equicontinuity() -> Finding:
    """The solutions are equicontinuous up to a defect ω(ε) that vanishes with ε."""
    study = _study()
    epsilon, defect = study.dataset["epsilon"].values, study.dataset["equicontinuity"].values
    return scales(list(epsilon), list(defect), 1.0, 0.2, "ω(ε)", "ε")


@claim(
    "section 2.3",
    "ω(ε) cannot be dropped in (2.5)",
    "largest change of z_ε of section 2.2 within the time ε^(5/4), divided by ε",
    Verdict.ASYMPTOTIC,
)
def equicontinuity_is_sharp() -> Finding:
    """In the scalar example z_ε makes up for a whole period in a time that is short compared with
    ε."""
    epsilons = [1e-2, 3e-3, 1e-3, 3e-4]
    largest = []
    for epsilon in epsilons:
        motion = ss.play(
            "5*t - t**2", "1 + cos(2*pi*s)/2", (0.0, 5.0), initial=0.0, epsilon=epsilon
        )
        t = np.union1d(motion.time, np.linspace(0.0, 5.0 - epsilon, 20_001))
        t = t[t <= 5.0 - epsilon]
        change = np.abs(motion.position(t + epsilon**1.25) - motion.position(t))
        largest.append(float(change.max()))
    return scales(epsilons, largest, 1.0, 0.1, "largest change within ε^(5/4)", "ε")


@claim(
    "section 2.3",
    "E(T,z_0(T)) + ∫Ψ_av(ż_0)dt ≤ E(0,ẑ_0) − ∫⟨ℓ′,z_0⟩ds",
    "certificate of the averaged play",
)
def energy_of_the_limit() -> Finding:
    """The limit satisfies the energy estimate with the averaged potential."""
    average = ss.WeightedL1(["1 + cos(2*pi*s)/2"]).average()
    motion = ss.play("5*t - t**2", average.value(0.0, [1.0]), (0.0, 5.0), initial=0.0)
    spent = 0.5 * (6.25 - 0.5) + 0.5 * (6.25 - 1.0)
    return together(
        vanishes(motion.certificate["energy balance"].value, 1e-12, "energy residual"),
        equals(motion.dissipated, spent, 1e-12, "dissipated"),
    )


@claim(
    "section 2.3",
    "0 ∈ ∂Ψ(s,0) + Az_0(t) − ℓ(t) for all s",
    "force of the limit motion in every K(s): 200 times, 721 phases",
)
def limit_is_stable_at_every_phase() -> Finding:
    """The limit is stable for every phase at every time, not only for the average."""
    potential = ss.WeightedL1(["1 + cos(2*pi*s)/2"])
    average = potential.average()
    motion = ss.play("5*t - t**2", average.value(0.0, [1.0]), (0.0, 5.0), initial=0.0)
    sampled = potential.sampled(_PHASES)
    t = np.linspace(0.0, 5.0, 200)
    force = 5 * t - t**2 - motion.position(t)
    worst = maximum(*(float(sampled.excess(np.array([f])).max()) for f in force))
    return vanishes(maximum(worst, 0.0), 1e-12, "largest excess")


@cache
def _study():
    A = np.array([[2.0, -1.0], [-1.0, 2.0]])
    potential = ss.WeightedL1(["1 + cos(2*pi*s)/2", "1 - cos(2*pi*s)/2"])
    problem = ss.Evolution(A, ["3*t", "t"], potential, [0.0, 0.0], epsilon=0.1, span=(0.0, 1.0))
    return ss.averaging_study(
        problem, [0.2, 0.1, 0.05, 0.025], tolerance=1e-3, progress=lambda fraction: None
    )
