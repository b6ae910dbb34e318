"""[M] sections 4.1, 4.3 and 4.4: the hysteresis operator of the legs, the reduced oscillator,
walking."""

from __future__ import annotations

import math
from dataclasses import replace
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
    shows,
    together,
    vanishes,
)
from stickslip_paper.sections.laws import at_events, fact, points, rates_of
from stickslip_paper.sections.section4_model import (
    H_L,
    H_R,
    LEFT,
    RANGES,
    RIGHT,
    WALK,
    held,
    threshold,
)

_WIDE = {**RANGES, "P": (0.5, 1.5), "psi": (-2.0, 2.0)}
# Values of the walk with the catalogue's parameters, to the published digits.
_PERIOD = 5.969
_AMPLITUDE = 1.6236
_SPEED = 0.1675

X = 0.5
_PSI_2 = 7 / 3
_PSI_3 = 1 / 6


def boundaries(system: ss.System, values: dict[str, float]) -> dict[str, float]:
    """G_R^±, G_L^± of the library: where the force on a leg reaches its threshold, which is affine
    in d."""
    found = {}
    for leg, name in ((RIGHT, "R"), (LEFT, "L")):
        at_0, at_1 = (held(system, leg, {**values, "x_R": d, "x_L": 0.0}) for d in (0.0, 1.0))
        ends = sorted(
            (side * threshold(system, leg, values) - at_0) / (at_1 - at_0) for side in (1, -1)
        )
        found |= {f"{name}-": ends[0], f"{name}+": ends[1]}
    return found


def curves(psi: Array, P: float = 1.0, H_star: float = 3.0) -> tuple[Array, Array]:
    """G⁻ and G⁺ as printed, for a = ψ* = 1, c = 0.3, ρ = 0.2."""
    right = 0.2 + H_star / 2 * (1 + np.clip(psi, -1, 1))
    left = 0.2 + H_star / 2 * (1 - np.clip(psi, -1, 1))
    lower = np.maximum(P + 0.3 * psi - right, -P + 0.3 * psi - left)
    upper = np.minimum(P + 0.3 * psi + right, -P + 0.3 * psi + left)
    return lower, upper


def Gamma(psi: Array) -> Array:
    """Γ of section 4.4 for the catalogue's parameters."""
    descent = -1 + 0.3 * psi + 0.2 + 1.5 * (1 - psi)
    return np.where(psi <= _PSI_3, X, np.where(psi <= 1, descent, -X))


@claim(
    "section 4.3",
    "G_R^± = (P + cψ ± (ρ + H_R))/a,  G_L^± = (−P + cψ ± (ρ + H_L))/a",
    "where the library's forces reach its thresholds, 100 random points",
)
def boundary_curves() -> Finding:
    """Each leg confines the distance of the legs to an interval."""
    error = 0.0
    system = catalogue.rocking_toy()
    for p in points(_WIDE, 100):
        found = boundaries(system, p)
        for name, P, load in (("R", p["P"], H_R(p)), ("L", -p["P"], H_L(p))):
            for side, sign in (("-", -1), ("+", 1)):
                exact = (P + p["c"] * p["psi"] + sign * (p["rho"] + load)) / p["a"]
                error = maximum(error, abs(found[name + side] - exact))
    return vanishes(error, 1e-12)


@claim(
    "section 4.3",
    "g(t) ∈ [G_R^−(ψ), G_R^+(ψ)] ∩ [G_L^−(ψ), G_L^+(ψ)]",
    "largest excess of d(t) along a walk; least excess of any constant g",
    Verdict.CORRECTED,
    correction="d(t) ∈ […]: the display is about the distance of the legs; g is gravity.",
    derivation="Sign ∈ [−1, 1] in (4.2b,c). No constant lies in all intervals: max G⁻ = X > −X = "
    "min G⁺.",
)
def distance_stays_between() -> Finding:
    """The distance of the legs stays in the intersection of the two intervals."""
    t = np.linspace(0.0, 60.0, 6001)
    now = _walk().at(t)
    lower, upper = curves(now["psi"])
    d = now["x_R"] - now["x_L"]
    printed = 0.5 * float(lower.max() - upper.min())
    return corrects(
        printed, maximum(float((lower - d).max()), float((d - upper).max()), 0.0), 1e-11, "excess"
    )


@claim(
    "section 4.3", "ḋ ≤ 0 on G⁺, ḋ ≥ 0 on G⁻, ḋ = 0 between", "sign of ḋ at 30001 times of a walk"
)
def hysteresis_of_the_distance() -> Finding:
    """The distance changes only on the boundary curves, and only inward."""
    t = np.linspace(0.0, 60.0, 30_001)
    now = _walk().at(t)
    d, rate = now["x_R"] - now["x_L"], now["d_x_R"] - now["d_x_L"]
    lower, upper = curves(now["psi"])
    inside = (d > lower + 1e-9) & (d < upper - 1e-9)
    worst = maximum(
        float(np.abs(rate[inside]).max()),
        -float(rate[d <= lower + 1e-9].min()),
        float(rate[d >= upper - 1e-9].max()),
    )
    found = vanishes(maximum(worst, 0.0), 1e-12, "largest rate of the wrong sign")
    moving = float((np.abs(rate) > 0).mean())
    return Finding(
        found.verdict, f"{found.measured}; moving {moving:.0%} of the time", found.numbers
    )


@claim(
    "section 4.3",
    "d(t) = 𝓗[ψ(·)](t)",
    "(4.2b,c) driven by a given ψ(t) against the play with the bounds G^±; the same ψ run through "
    "at another speed",
)
def hysteresis_operator() -> Finding:
    """For a given angle the distance of the legs is a hysteresis operator, independent of the
    rate."""
    driven = _driven()
    motion = ss.simulate(driven, (0.0, 20.0), initial={"x_R": 0.0})
    t = motion.knots.time  # between them the bounds are monotone
    now = motion.at(t)
    lower, upper = curves(1.6 * np.sin(t) + 0.7 * np.sin(0.37 * t))
    d = [0.0]
    for low, high in zip(lower[1:], upper[1:], strict=True):
        d.append(min(max(d[-1], float(low)), float(high)))
    clamp = float(np.abs(now["x_R"] - now["x_L"] - d).max())
    slow = ss.simulate(driven, (0.0, 40.0), initial={"x_R": 0.0}, parameters={"tempo": 0.5}).at(
        2 * t
    )
    same = float(np.abs(now["x_R"] - slow["x_R"]).max())
    return together(vanishes(clamp, 1e-10, "clamped"), vanishes(same, 1e-10, "other speed"))


@claim(
    "section 4.3",
    "G⁺ > G⁻",
    "least difference over ψ ∈ [−3, 3] for 100 random parameters with H* > 2P, 2cψ*",
)
def curves_do_not_cross() -> Finding:
    """There is always an admissible distance of the legs."""
    least = math.inf
    system = catalogue.rocking_toy()
    for p in points({**_WIDE, "psi": (-3.0, 3.0)}, 100, seed=1):
        p["H_star"] = max(p["H_star"], 2.1 * p["P"], 2.1 * p["c"] * p["psi_star"])
        g = boundaries(system, p)
        least = minimum(least, min(g["R+"], g["L+"]) - max(g["R-"], g["L-"]))
    return shows(least > 0, f"least G⁺ − G⁻ = {least:.3g} (positive)", least=least)


@claim(
    "section 4.3",
    "local minimum of G⁺ at (ψ*, −X), local maximum of G⁻ at (−ψ*, X),  X = (P − ρ − cψ*)/a",
    "the library's curves at ±ψ* and beside, 50 random parameters; X of the catalogue",
)
def extrema_of_the_curves() -> Finding:
    """The extrema of the boundary curves are the two distances between which the toy walks."""
    error = 0.0
    wrong = 0
    system = catalogue.rocking_toy()

    def ends(p: dict[str, float], psi: float) -> tuple[float, float]:
        g = boundaries(system, {**p, "psi": psi})
        return min(g["R+"], g["L+"]), max(g["R-"], g["L-"])

    for p in points(RANGES, 50, seed=2):
        p["P"] = p["rho"] + p["c"] * p["psi_star"] + 0.3
        p["H_star"] = 2.2 * max(p["P"], p["c"] * p["psi_star"])
        exact = (p["P"] - p["rho"] - p["c"] * p["psi_star"]) / p["a"]
        edge = p["psi_star"]
        top = ends(p, edge)[0]
        bottom = ends(p, -edge)[1]
        error = maximum(
            error, abs(top + exact), abs(bottom - exact), abs(fact(system, "X", **p) - exact)
        )
        wrong += any(ends(p, edge + h)[0] < top for h in (-0.01, 0.01))
        wrong += any(ends(p, -edge + h)[1] > bottom for h in (-0.01, 0.01))
    return together(vanishes(error, 1e-12), shows(wrong == 0, f"{wrong} of 100 are no extrema"))


@claim(
    "section 4.3",
    "H* > 2cψ*",
    "differences of the library's G⁺ to the left of ψ* for H* = 1.9cψ* and 2.1cψ*, 50 "
    "random parameters",
)
def condition_of_the_minimum() -> Finding:
    """G⁺ has a local minimum at ψ* just if the load rises faster than the coupling."""
    wrong = 0
    system = catalogue.rocking_toy()
    for p in points({**RANGES, "P": (0.5, 1.5)}, 50, seed=7):
        for factor in (1.9, 2.1):
            q = {**p, "H_star": factor * p["c"] * p["psi_star"], "psi": p["psi_star"]}
            edge = boundaries(system, q)["L+"]
            before = boundaries(system, {**q, "psi": q["psi"] - 0.1})["L+"]
            wrong += (before > edge) != (factor > 2)
    return shows(wrong == 0, f"{wrong} of 100 disagree", disagree=wrong)


@claim(
    "section 4.4",
    "ψ_2 = 2ρ/c + ψ*",
    "the library's curves: G_L^−(ψ_2) = −X and G_R^+(−ψ_2) = X, 50 random parameters; ψ_2 "
    "of the catalogue",
)
def end_of_the_simple_regime() -> Finding:
    """Up to the angle ψ_2 the distance stays at ±X beyond the edge ψ*."""
    error = 0.0
    system = catalogue.rocking_toy()
    for p in points(RANGES, 50, seed=3):
        p["P"] = p["rho"] + p["c"] * p["psi_star"] + 0.3
        p["H_star"] = 4 * max(p["P"], p["c"] * p["psi_star"])
        end = p["psi_star"] + 2 * p["rho"] / p["c"]
        X_p = (p["P"] - p["rho"] - p["c"] * p["psi_star"]) / p["a"]
        left, right = (boundaries(system, {**p, "psi": psi}) for psi in (end, -end))
        error = maximum(
            error,
            abs(left["L-"] + X_p),
            abs(right["R+"] - X_p),
            abs(fact(system, "psi_2", **p) - end),
        )
    return vanishes(error, 1e-12)


@claim(
    "section 4.4",
    "ψ_3 is the unique solution of X = G_L^+(ψ) in [0, ψ*]",
    "ψ_3 of the catalogue for 200 random parameters with X > 0, H* > 2P: residual, and how "
    "often it is negative",
    Verdict.CORRECTED,
    correction="ψ_3 ∈ [−ψ*, ψ*]; it is in [0, ψ*] only if also H*/2 ≥ 2P − 2ρ − cψ*.",
    derivation="G_L^+ falls from (H* + ρ − P − cψ*)/a > X at −ψ* (since H* > 2P − 2ρ) to −X at ψ*. "
    "G_L^+(0) > 0, as the note says, is not G_L^+(0) ≥ X.",
)
def turning_angle() -> Finding:
    """The angle from which the left leg follows."""
    system = catalogue.rocking_toy()
    outside = 0.0
    wrong = 0.0
    residual = 0.0
    for p in points({**RANGES, "P": (0.5, 1.5)}, 200, seed=4):
        if p["P"] <= p["rho"] + p["c"] * p["psi_star"]:
            continue
        p["H_star"] = 2.05 * max(p["P"], p["c"] * p["psi_star"])
        psi = fact(system, "psi_3", **p)
        slope = boundaries(system, {**p, "psi": psi})["L+"] - fact(system, "X", **p)
        residual = maximum(residual, abs(slope))
        outside = maximum(outside, -psi, psi - p["psi_star"])
        wrong = maximum(wrong, abs(psi) - p["psi_star"])
        wrong = maximum(
            wrong,
            float(
                (psi >= 0)
                != (p["H_star"] / 2 >= 2 * p["P"] - 2 * p["rho"] - p["c"] * p["psi_star"])
            ),
        )
    return corrects(outside, maximum(residual, wrong), 1e-11, "distance from the interval")


@claim(
    "section 4.4",
    "G_L^+(0) = (ρ + H*/2 − D)/a > 0,  G_L^+(ψ*) = −X < 0",
    "the library's curve at 50 random parameters; D as the distance X of the legs, the "
    "only D-like quantity",
    Verdict.CORRECTED,
    correction="D is P.",
    derivation="The definition of G_L^+ at ψ = 0. No D is defined in [M].",
)
def left_curve_changes_sign() -> Finding:
    """The upper curve of the left leg changes its sign between 0 and ψ*."""
    system = catalogue.rocking_toy()
    printed = 0.0
    right = 0.0
    low = math.inf
    for p in points(RANGES, 50, seed=5):
        p["P"] = p["rho"] + p["c"] * p["psi_star"] + 0.3
        p["H_star"] = 2.2 * max(p["P"], p["c"] * p["psi_star"])
        X_p = (p["P"] - p["rho"] - p["c"] * p["psi_star"]) / p["a"]
        middle = boundaries(system, {**p, "psi": 0.0})["L+"]
        edge = boundaries(system, {**p, "psi": p["psi_star"]})["L+"]
        right = maximum(
            right, abs(middle - (p["rho"] + p["H_star"] / 2 - p["P"]) / p["a"]), abs(edge + X_p)
        )
        printed = maximum(printed, abs(middle - (p["rho"] + p["H_star"] / 2 - X_p) / p["a"]))
        low = minimum(low, middle)
    return together(corrects(printed, right, 1e-12), shows(low > 0, f"least G_L^+(0) = {low:.2g}"))


@claim(
    "section 4.4",
    "d = 𝐆(ψ, ψ̇): Γ(ψ) for ψ̇ ≥ 0, −Γ(−ψ) for ψ̇ < 0",
    "the distance of the legs along a settled walk of (4.2), 4000 times",
)
def distance_is_a_function() -> Finding:
    """In simple motion the hysteresis operator is an ordinary function of angle and angular
    velocity."""
    t = np.linspace(400.0, 440.0, 4001)
    now = _walk(440.0).at(t)
    away = np.abs(now["d_psi"]) > 1e-3
    exact = np.where(now["d_psi"] >= 0, Gamma(now["psi"]), -Gamma(-now["psi"]))
    return vanishes(float(np.abs(now["x_R"] - now["x_L"] - exact)[away].max()), 1e-10)


@claim(
    "section 4.4",
    "I_b ψ̈ + δψ̇ + bψ − c𝐆(ψ, ψ̇) = 0",
    "residual of the library's oscillator at 200 random points",
)
def reduced_oscillator() -> Finding:
    """The legs are eliminated and an oscillator for the angle is left."""
    error = 0.0
    system = catalogue.rocking_oscillator()
    for p in points({"psi": (-2.0, 2.0), "d_psi": (-2.0, 2.0), "delta": (0.0, 0.2)}, 200, seed=6):
        psi = np.array(p["psi"])
        G = float(Gamma(psi) if p["d_psi"] >= 0 else -Gamma(-psi))
        found = rates_of(system, {}, p)["d_psi"]
        error = maximum(error, abs(found + p["delta"] * p["d_psi"] + p["psi"] - 0.3 * G))
    facts = {"X": X, "psi_2": _PSI_2, "psi_3": _PSI_3}
    known = maximum(*(abs(fact(system, name) - value) for name, value in facts.items()))
    return together(
        vanishes(error, 1e-13, "largest residual"),
        vanishes(known, 1e-14, "X, ψ_2, ψ_3 of the catalogue"),
    )


@claim(
    "section 4.4",
    "(4.2) for |ψ| ≤ ψ_2 is the oscillator",
    "ψ(t) of the library's (4.2) and of its oscillator, 0 ≤ t ≤ 60",
)
def oscillator_is_the_toy() -> Finding:
    """The reduced oscillator moves like the toy."""
    t = np.linspace(0.0, 60.0, 601)
    reduced = ss.simulate(
        catalogue.rocking_oscillator(), (0.0, 60.0), initial={"psi": WALK["psi"]}
    ).at(t)["psi"]
    psi = _walk().at(t)["psi"]
    inside = shows(
        bool(np.abs(psi).max() < _PSI_2), f"|ψ| ≤ {np.abs(psi).max():.3f} < ψ_2 = {_PSI_2:.3f}"
    )
    return together(vanishes(float(np.abs(psi - reduced).max()), 1e-10), inside)


@claim(
    "section 4.4",
    "there are parameters with a periodic orbit",
    "find_cycle for (4.2): period, residual, multipliers",
)
def periodic_orbit_of_the_toy() -> Finding:
    """The toy has a periodic orbit, and it is stable."""
    cycle = _cycle()
    largest = maximum(*abs(cycle.nontrivial))
    good = shows(
        largest < 1 and cycle.residual < 1e-9,
        f"largest multiplier {largest:.4f}, residual {cycle.residual:.0e}",
    )
    return together(equals(cycle.period, _PERIOD, 5e-4, "period"), good)


@claim(
    "figure 4.4",
    "(ψ, ψ̇) spirals towards a stable limit cycle",
    "amplitudes after t = 300 of motions from outside and inside",
)
def limit_cycle_attracts() -> Finding:
    """Motions from both sides settle on the limit cycle."""
    amplitudes = []
    for start in (
        WALK,
        {"psi": -2.2, "x_R": 0.4, "x_L": 0.0},
        {"psi": -1.3, "x_R": 0.5, "x_L": 0.0},
    ):
        psi = ss.simulate(catalogue.rocking_toy(), (0.0, 520.0), initial=start).at(
            np.linspace(500.0, 520.0, 8001)
        )["psi"]
        amplitudes.append(float(np.abs(psi).max()))
    spread = maximum(*(abs(a - _AMPLITUDE) for a in amplitudes))
    return vanishes(
        spread, 1e-3, f"amplitudes {', '.join(f'{a:.4f}' for a in amplitudes)}; largest distance"
    )


@claim(
    "section 4.4",
    "amplitude 1.859 of the walk with P = 1, δ = 0.04, …",
    "extremum of the cycle; energy balance 2cX(ψ_3 + ψ*) = δ∮ψ̇² of both amplitudes",
    Verdict.CORRECTED,
    correction="1.6236. (This number came with the set of parameters; it is not one of [M].)",
    derivation="The damping of a nearly harmonic motion of amplitude A takes up πδωA² = 0.35, so A "
    "≈ 1.63.",
)
def amplitude_of_the_walk() -> Finding:
    """The amplitude of the rocking follows from the balance of energy."""
    amplitude = _cycle().extrema["psi"][1]
    fed = 2 * 0.3 * X * (_PSI_3 + 1.0)
    harmonic = math.sqrt(fed * _PERIOD / (2 * math.pi**2 * 0.04))
    found = corrects(
        1.859 - amplitude, _AMPLITUDE - amplitude, 1e-4, f"amplitude {amplitude:.4f}; off"
    )
    return together(found, vanishes(harmonic - amplitude, 0.02, "harmonic estimate"))


@claim(
    "figure 4.4",
    "x_{R,L} = vt + periodic,  v = 2X/T",
    "drift of find_cycle for (4.2): 2X in a period; speed",
)
def walking_speed() -> Finding:
    """The legs are periodic up to a linear translation: in each period each leg makes a step of
    2X."""
    cycle = _cycle()
    x = _walk(440.0)
    t = np.linspace(400.0, 420.0, 401)
    steps = [x.at(t + cycle.period)[name] - x.at(t)[name] - 2 * X for name in ("x_R", "x_L")]
    return together(
        equals(cycle.drift, 2 * X, 1e-11, "drift"),
        equals(cycle.speed, _SPEED, 5e-5, "speed"),
        vanishes(float(np.abs(steps).max()), 1e-3, "periodicity of x − vt"),
    )


@claim(
    "section 4.4",
    "“this switching feeds energy into the system”: 2cX(ψ_3 + ψ*) in a period",
    "∮c d ψ̇ dt and δ∮ψ̇² dt of the settled oscillator; energy_per_period of the catalogue",
)
def energy_of_the_switching() -> Finding:
    """The switching of the distance feeds the energy into the rocking that damping takes out."""
    fed = 2 * 0.3 * X * (_PSI_3 + 1.0)
    motion = ss.simulate(catalogue.rocking_oscillator(), (0.0, 500.0), initial={"psi": -1.6})
    turns = at_events(motion, "below", contact="d_psi = 0")[-2:]
    lost = float(np.diff(motion.at(turns)["dissipated_energy"])[0])
    return together(
        equals(lost, fed, 1e-5, "lost by damping"),
        equals(fact(catalogue.rocking_oscillator(), "energy_per_period"), fed, 1e-13, "catalogue"),
    )


@claim(
    "section 4.1",
    "(i) walking is enabled by oscillations that change the weight on the legs",
    "threshold of each leg at the moments when it slides, relative to that of the upright toy, "
    "over a settled period",
)
def legs_move_when_unloaded() -> Finding:
    """A leg moves while the other one carries most of the weight."""
    t = np.linspace(400.0, 440.0, 20_001)
    now = _walk(440.0).at(t)
    shares = [
        now[f"threshold_plus_{leg}"][now[f"mode_{leg}"] != 0] / 1.7
        for leg in ("right_leg", "left_leg")
    ]
    largest = maximum(*(float(s.max()) for s in shares))
    return shows(
        largest < 1,
        f"legs slide at {min(s.min() for s in shares):.2f} … {largest:.2f} of the upright "
        "threshold",
    )


@claim(
    "section 4.1",
    "(ii) walking needs less pull than sliding; for very small pull no motion",
    "speeds of (4.2) at P = 0.3, 0.45, 0.8, 1.0, 1.2 after 800 time units; sliding needs P = 1.7",
)
def walking_needs_less_pull() -> Finding:
    """The force in the string is substantially smaller for walking than for sliding."""
    pulls = (0.3, 0.45, 0.8, 1.0, 1.2)
    batch = ss.simulate_many(
        catalogue.rocking_toy(),
        (0.0, 800.0),
        initial={
            "psi": -1.67,
            "x_R": [min(P - 0.5, P + 0.3 * -1.67 + 0.2) for P in pulls],
            "x_L": 0.0,
        },
        parameters={"P": pulls},
    )
    speeds = (batch["final_x_R"].values - np.array([P - 0.5 for P in pulls])) / 800.0
    text = ", ".join(f"v({P:g}) = {v:.3f}" for P, v in zip(pulls, speeds, strict=True))
    return shows(
        bool(np.all(np.abs(speeds[:2]) < 5e-3) and speeds[3] > 0.15 and speeds[4] > speeds[3]), text
    )


@claim(
    "section 4.1",
    "(iii) energy is transferred from the forward motion into the rocking",
    "energy of one period of the walk: work of the pull 2P·2X against friction and damping",
)
def energy_from_the_forward_motion() -> Finding:
    """The pull feeds the rocking against its damping."""
    cycle = _cycle()
    work = 2 * 1.0 * cycle.drift
    friction = sum(share.dissipated for share in cycle.contacts.values())
    damping = cycle.dissipated - friction
    return together(
        vanishes(work - cycle.dissipated, 1e-9, "work of the pull − dissipation"),
        equals(damping, 2 * 0.3 * X * (_PSI_3 + 1.0), 1e-8, "damping"),
    )


@claim("section 4.4", "rest and walking coexist", "motions of (4.2) from ψ = 0.1 and from the walk")
def rest_and_walking_coexist() -> Finding:
    """The rest of the toy is stable, too: walking has to be started."""
    motion = ss.simulate(catalogue.rocking_toy(), (0.0, 300.0), initial={"psi": 0.1, "x_R": 0.0})
    walked = _walk(440.0).final["x_R"]
    left = abs(motion.final["psi"])
    text = (
        f"from ψ = 0.1: |ψ(300)| = {left:.1e}, {motion.n_switches} switches; "
        f"walk: x_R(440) = {walked:.1f}"
    )
    return shows(motion.n_switches == 0 and left < 1e-2 and walked > 50, text)


# -- what they share -------------------------------------------------------------------------------


@cache
def _walk(until: float = 60.0) -> ss.Trajectory:
    return ss.simulate(catalogue.rocking_toy(), (0.0, until), initial=WALK)


@cache
def _cycle():

    return ss.find_cycle(catalogue.rocking_toy(), _walk(440.0))


def _driven() -> ss.System:
    """(4.2b,c) with a given angle: the toy's declaration with ψ as a drive."""
    toy = catalogue.rocking_toy()
    coordinates = {x: c for x, c in toy.coordinates.items() if x != "psi"}
    return replace(
        toy,
        name="driven legs",
        parameters={**toy.parameters, "tempo": ss.Parameter(1.0)},
        coordinates=coordinates,
        kinetic=0.0,
        viscous=0.0,
        drives={"psi": "1.6*sin(tempo*t) + 0.7*sin(0.37*tempo*t)"},
        initial={},
        facts={},
        conditions={},
    )
