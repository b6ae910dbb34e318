"""[M] section 3 after (3.6): the Poincaré maps Φ⁺ and Φ⁻, their fixed point, the times of stick and
slip."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from itertools import pairwise

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
from stickslip_paper.sections.laws import at_events, built, fact, rates_of, root

_FIXED = 0.00590569826359391  # γ_b for b = 1, μ₀ = v̂ = 1, found independently in 15 digits
_VISCOSITIES = [1e-4, 1e-5, 1e-6, 1e-7]


def omega(b: float) -> float:
    return math.sqrt(1 - b * b / 4)


def rho(b: float) -> float:
    """Stretching of a slip at lowest order."""
    return math.exp(math.pi * b / (2 * omega(b)))


def B(T: float) -> float:
    """𝓑(T) = (1 − e^{−T})/T."""
    return -math.expm1(-T) / T


def C(q: float) -> float:
    """𝒞, the inverse of 𝓑."""
    from scipy.special import lambertw

    return float((1 / q + lambertw(-math.exp(-1 / q) / q)).real)


def slip_map(gamma: float, b: float) -> float:
    """Φ⁺ at lowest order, μ₀ = v̂ = 1."""
    return 1 + rho(b) * (1 - gamma)


def stick_map(gamma: float) -> float:
    """Φ⁻ at lowest order, μ₀ = v̂ = 1."""
    return gamma * math.exp(-C(1 / gamma))


def composed(gamma: float, b: float) -> float:
    """Ψ = Φ⁻∘Φ⁺ at lowest order."""
    return stick_map(slip_map(gamma, b))


def fixed_point(b: float) -> float:
    """γ_b, the fixed point of Ψ in the interior."""
    return root(lambda g: composed(g, b) - g, 0.0, 1 - 1e-2 * b)


def exact_composed(gamma: float, nu: float) -> float:
    """Ψ of the exact flow of (3.6), b = 1."""
    _, end = flight(gamma, nu, 2.0, b=1.0)
    return flight(end, nu, 30.0, b=1.0)[1]


def flight(gamma: float, nu: float, until: float, **values: float) -> tuple[float, float]:
    """Duration and γ at the end of the phase of (3.6) that starts in (0, γ), from the exact
    flow."""
    motion = ss.simulate(
        built(catalogue.scaled_slider_limit),
        (0.0, until),
        initial={"beta": 0.0, "gamma": gamma},
        parameters={"nu": nu, **values},
    )
    first = motion.events.iloc[0]
    return float(first["time"]), float(first["gamma"])


@claim(
    "section 3",
    "A₁ = [0, μ₀v̂[, A₂ = ]μ₀v̂, ∞[",
    "sign of β̇ of the library on the axis β = 0, 40 points of each, ν = 1e-6",
)
def sections() -> Finding:
    """On the axis β = 0 motions start to slip below μ₀v̂ and to stick above it (up to the factor 1
    − b√ν)."""
    wrong = 0
    edge = 1 - 1e-3
    for gamma in np.concatenate([np.linspace(0, 0.998, 40), np.linspace(1.0, 5, 40)]).tolist():
        p = {"beta": 0.0, "gamma": gamma, "nu": 1e-6, "b": 1.0, "mu_0": 1.0, "v_hat": 1.0}
        wrong += (rates_of(built(catalogue.scaled_slider_limit), {}, p)["beta"] > 0) != (
            gamma < edge
        )
    return shows(wrong == 0, f"{wrong} of 80 disagree", disagree=wrong)


@claim(
    "section 3",
    "travel time of Φ⁺: πω_b/√ν",
    "duration of the slip from γ = 0.3, exact flow of (3.6), ν = 1e-4 … 1e-7, b = 1: relative "
    "errors",
    Verdict.CORRECTED,
    correction="π√ν/ω_b, up to O(ν).",
    derivation="Half a turn at the frequency ω_b/√ν. (Further below [M] itself has √νπ/ω_b.)",
)
def travel_time_of_slip() -> Finding:
    """A slip lasts half a turn about the focus."""
    errors = []
    printed = math.inf
    for nu in _VISCOSITIES:
        time, _ = flight(0.3, nu, 1.0)
        errors.append(time - math.pi * math.sqrt(nu) / omega(1.0))
        printed = minimum(printed, abs(time - math.pi * omega(1.0) / math.sqrt(nu)) / time)
    order = scales(_VISCOSITIES, errors, 1.0, 0.05, "time − π√ν/ω_b", "ν")
    verdict = (
        Verdict.CORRECTED if order.verdict is Verdict.ASYMPTOTIC and printed > 1 else Verdict.FAILS
    )
    known = fact(catalogue.scaled_slider_limit(), "slip_duration", nu=1e-4, b=1.0)
    same = vanishes(known - math.pi * 1e-2 / omega(1.0), 1e-15, "fact of the catalogue")
    if same.verdict is Verdict.FAILS:
        verdict = Verdict.FAILS
    return Finding(
        verdict, f"printed off by {printed:.0e} times the time; {order.measured}", order.numbers
    )


@claim(
    "section 3",
    "the motion between β = 0 and β = v̂ takes a time of order ν",
    "time until β = v̂ of the exact flow from γ = 0.3, ν = 1e-4 … 1e-7",
    Verdict.ASYMPTOTIC,
)
def passage_to_the_focus() -> Finding:
    """At first a slip rapidly moves to the right."""
    times = []
    for nu in _VISCOSITIES:
        motion = ss.simulate(
            catalogue.scaled_slider_limit(),
            (0.0, 20 * nu),
            initial={"gamma": 0.3},
            parameters={"nu": nu, "b": 1.0},
        )
        times.append(root(lambda t, m=motion: m.at(t)["beta"] - 1.0, 0.0, 20 * nu))
    return scales(_VISCOSITIES, times, 1.0, 0.02, "time", "ν")


@claim(
    "section 3",
    "β̇ = 0 is reached when β is of order 1/√ν",
    "largest β of a slip of the exact flow, ν = 1e-4 … 1e-7",
    Verdict.ASYMPTOTIC,
)
def height_of_a_slip() -> Finding:
    """A slip turns back at a velocity of order 1/√ν."""
    tops = []
    for nu in _VISCOSITIES:
        time, _ = flight(0.3, nu, 1.0)
        motion = ss.simulate(
            catalogue.scaled_slider_limit(),
            (0.0, time),
            initial={"gamma": 0.3},
            parameters={"nu": nu, "b": 1.0},
        )
        tops.append(float(motion.at(np.linspace(0, time, 2001))["beta"].max()))
    return scales(_VISCOSITIES, tops, -0.5, 0.02, "largest β", "ν")


@claim(
    "section 3",
    "Φ⁺(γ) = μ₀v̂ + ρ_b(μ₀v̂ − γ) + O(√ν),  ρ_b = e^{πb/(2ω_b)}",
    "exact flow of (3.6) from 3 values of γ, μ₀ = 1.5, v̂ = 2; exponent of the largest error",
    Verdict.ASYMPTOTIC,
)
def slip_is_a_stretching() -> Finding:
    """A slip turns γ about the focus and stretches the distance by ρ_b."""
    errors = []
    centre = 3.0
    for nu in _VISCOSITIES:
        values = {"b": 1.0, "mu_0": 1.5, "v_hat": 2.0}
        ends = [flight(gamma, nu, 1.0, **values)[1] for gamma in (0.0, 0.9, 2.1)]
        exact = [centre + rho(1.0) * (centre - gamma) for gamma in (0.0, 0.9, 2.1)]
        errors.append(maximum(*(abs(a - b) for a, b in zip(ends, exact, strict=True))))
    known = equals(
        fact(catalogue.scaled_slider_limit(), "rho_b", b=1.0),
        rho(1.0),
        1e-13,
        "ρ_b of the catalogue",
    )
    return together(scales(_VISCOSITIES, errors, 0.5, 0.03, "error of Φ⁺", "ν"), known)


@claim(
    "section 3",
    "νβ(t) = v̂(t − t_0) + (1/μ₀)(1 − e^{t_0−t})γ(t_0),  γ = e^{−(t−t_0)}γ(t_0)",
    "exact flow of (3.6) in stick from γ = 4, ν = 0.01, 200 times",
    Verdict.CORRECTED,
    correction="νβ(t) = v̂(t − t_0) − (1/μ₀)(1 − e^{t_0−t})γ(t_0), and v̂(1 − b√ν) for v̂ under "
    "(3.6).",
    derivation="Integrate νβ̇ = v̂(1 − b√ν) − e^{−(t−t_0)}γ(t_0)/μ₀. With the printed sign β would "
    "be positive in stick.",
)
def sticking_orbit() -> Finding:
    """The sticking phase in closed form."""
    nu = 1e-2
    b = 1.0
    gamma = 4.0
    time, _ = flight(gamma, nu, 30.0, b=b)
    t = np.linspace(0.0, time, 200)
    motion = ss.simulate(
        catalogue.scaled_slider_limit(),
        (0.0, time),
        initial={"gamma": gamma},
        parameters={"nu": nu, "b": b},
    )
    now = motion.at(t)
    load = (1 - b * math.sqrt(nu)) * t
    relaxed = -np.expm1(-t) * gamma
    printed = float(np.abs(nu * now["beta"] - load - relaxed).max())
    right = float(np.abs(nu * now["beta"] - load + relaxed).max())
    right = maximum(right, float(np.abs(now["gamma"] - gamma * np.exp(-t)).max()))
    return corrects(printed, right, 1e-11)


@claim(
    "section 3",
    "Φ⁻(γ(t_0)) = γ(t_0 + T),  v̂T = (1 − e^{−T})γ(t_0)/μ₀;  “even independent of ν”",
    "exact flow of (3.6) from 4 values of γ, ν = 1e-2 and 1e-4",
    Verdict.CORRECTED,
    correction="Under (3.6) v̂(1 − b√ν)T = (1 − e^{−T})γ(t_0)/μ₀: Φ⁻ depends on ν by this factor "
    "and is independent of ν only at lowest order, with the constant v̂/ν.",
    derivation="Zero of the sticking orbit, in which the constant of (3.6) carries 1 − b√ν.",
)
def stick_map_and_viscosity() -> Finding:
    """The stick map follows from the closed form of the sticking orbit."""
    printed = right = 0.0
    for nu in (1e-2, 1e-4):
        for gamma in (1.2, 2.0, 4.0, 7.0):
            time, end = flight(gamma, nu, 30.0, b=1.0)
            printed = maximum(printed, abs(end - gamma * math.exp(-C(1 / gamma))))
            exact = gamma * math.exp(-C((1 - math.sqrt(nu)) / gamma))
            right = maximum(
                right, abs(end - exact), abs((1 - math.sqrt(nu)) * time + math.expm1(-time) * gamma)
            )
    return corrects(printed, right, 1e-10, "error of Φ⁻")


@claim(
    "section 3",
    "𝓑(T) = (1 − e^{−T})/T is strictly decreasing from ]0,∞[ onto ]0,1[",
    "differences over T = 1e-6 … 1e3 in 4000 steps; ends",
)
def duration_function() -> Finding:
    """The function that relates the duration of stick to its start."""
    values = np.array([B(float(T)) for T in np.geomspace(1e-6, 1e3, 4001)])
    ends = together(
        equals(float(values[0]), 1.0, 1e-6, "𝓑(1e-6)"),
        equals(float(values[-1]), 0.0, 1.1e-3, "𝓑(1e3)"),
    )
    return together(
        shows(bool(np.all(np.diff(values) < 0)), f"largest step {np.diff(values).max():.1e}"), ends
    )


@claim(
    "section 3",
    "the inverse of 𝓑 is 𝒞 : ]0,1[ → ]1,∞[",
    "𝒞 and 𝓑∘𝒞 at 200 values of ]0, 1[; durations of stick of the exact flow",
    Verdict.CORRECTED,
    correction="𝒞 : ]0,1[ → ]0,∞[.",
    derivation="The domain of 𝓑 is ]0,∞[; 𝒞(q) → 0 for q → 1. For example 𝒞(0.9) = 0.215.",
)
def range_of_the_inverse() -> Finding:
    """The duration of stick as a function of its start."""
    q = np.linspace(0.005, 0.995, 200)
    values = np.array([C(float(x)) for x in q])
    inverse = maximum(*(abs(B(float(T)) - x) for T, x in zip(values, q, strict=True)))
    short, _ = flight(1.1, 1e-4, 5.0, b=1e-3)
    inverse = maximum(inverse, abs(short - C((1 - 1e-5) / 1.1)))
    return corrects(
        maximum(0.0, 1.0 - float(values.min()), 1.0 - short),
        inverse,
        1e-9,
        "values below 1; 𝓑(𝒞(q)) − q",
    )


@claim(
    "section 3",
    "Φ⁻ is convex and decreasing with slopes in ]−1, 0[",
    "differences on 2000 points of ]1, 20]",
)
def shape_of_the_stick_map() -> Finding:
    """The longer the slip, the further the state relaxes in stick."""
    gamma = np.linspace(1.0005, 20.0, 2000)
    return _shape(
        np.array([stick_map(g) for g in gamma.tolist()]), gamma, lambda s: (s > -1) & (s < 0), 1
    )


@claim(
    "section 3",
    "Ψ = Φ⁻∘Φ⁺ is convex and strictly increasing",
    "differences on 2000 points of [0, 1[ for b = 0.5, 1, 1.5",
)
def shape_of_the_composition() -> Finding:
    """From slip to slip the map is convex and increasing."""
    gamma = np.linspace(0.0, 0.999, 2000)
    return together(
        *(
            _shape(np.array([composed(g, b) for g in gamma.tolist()]), gamma, lambda s: s > 0, 1)
            for b in (0.5, 1, 1.5)
        )
    )


@claim(
    "section 3",
    "Ψ′(μ₀v̂) = ρ_b > 1",
    "one-sided differences at γ = 1 of the lowest-order map, b = 0.5, 1, 1.5",
)
def slope_at_the_focus() -> Finding:
    """Near the focus the map stretches by ρ_b."""
    h = 3e-5
    error = maximum(
        *(
            abs((composed(1 - h, b) - composed(1 - 2 * h, b)) / h / rho(b) - 1)
            for b in (0.5, 1, 1.5)
        )
    )
    return vanishes(error, 5e-3, "largest relative error of the slope")


@claim(
    "section 3",
    "there is a unique fixed point γ_b in the interior",
    "sign changes of Ψ(γ) − γ on 4000 points for b = 0.3, 1, 1.7; γ_1 against its "
    "value in 15 digits",
)
def unique_fixed_point() -> Finding:
    """The lowest-order map has one cycle."""
    counts = []
    for b in (0.3, 1.0, 1.7):
        signs = np.sign([composed(g, b) - g for g in np.linspace(0.0, 0.999, 4000).tolist()])
        counts.append(int(np.count_nonzero(np.diff(signs))))
    one = shows(counts == [1, 1, 1], f"sign changes {counts}")
    return together(equals(fixed_point(1.0), _FIXED, 1e-13, "γ_b for b = 1:"), one)


@claim(
    "section 3",
    "cycles of (3.6) → γ_b",
    "γ at the start of slip on the cycle of the exact flow (ss.simulate), b = 1, ν = 1e-4 … 1e-7",
    Verdict.ASYMPTOTIC,
)
def cycles_tend_to_the_fixed_point() -> Finding:
    """The fixed point is the limit of cycles of (3.6), with an error of order √ν."""
    errors = []
    for nu in _VISCOSITIES:
        errors.append(at_events(_cycle(nu), "above", "gamma")[-1] - _FIXED)
    return scales(_VISCOSITIES, errors, 0.5, 0.03, "γ − γ_b", "ν")


@claim(
    "section 3",
    "“the fixed point at γ = μ₀v̂ of the lowest-order expansion does not survive”",
    "sign changes of Ψ(γ) − γ of the exact flow of (3.6) on 30 points up to the end of A₁; Ψ "
    "there, ν = 1e-3 … 1e-6",
    Verdict.ASYMPTOTIC,
)
def second_fixed_point_does_not_survive() -> Finding:
    """At the upper end of A₁ the exact Ψ is slightly below the diagonal."""
    below = []
    viscosities = [1e-3, 1e-4, 1e-5, 1e-6]
    for nu in viscosities:
        end = (1 - math.sqrt(nu)) * (1 - 1e-9)
        below.append(exact_composed(end, nu) - end)
    grid = np.linspace(0.0, (1 - 1e-2) * (1 - 1e-9), 30)
    signs = np.sign([exact_composed(g, 1e-4) - g for g in grid.tolist()])
    count = int(np.count_nonzero(np.diff(signs)))
    one = shows(count == 1 and max(below) < 0, f"{count} sign change, Ψ − γ < 0 at the end")
    return together(scales(viscosities, below, 0.5, 0.1, "Ψ − γ at the end of A₁", "ν"), one)


@claim(
    "section 3",
    "“all the solutions … have a phase in the lower half plane”",
    "least β over 40 time units of (3.6) from 8 starts near and far from steady "
    "sliding, ν = 0.01, b = 1",
)
def all_solutions_stick() -> Finding:
    """All motions but steady sliding itself come to stick again and again."""
    highest = -math.inf
    for beta, gamma in (
        (1.001, 1.0),
        (1.0, 0.999),
        (2.0, 1.0),
        (9.0, 3.0),
        (-5.0, 0.2),
        (0.0, 0.0),
        (0.5, 4.0),
        (3.0, 0.0),
    ):
        motion = ss.simulate(
            catalogue.scaled_slider_limit(),
            (0.0, 40.0),
            initial={"beta": beta, "gamma": gamma},
            parameters={"nu": 0.01},
        )
        late = motion.at(np.linspace(20.0, 40.0, 2001))["beta"]
        highest = maximum(highest, float(late.min()))
    return shows(
        highest < -1,
        f"each reaches β ≤ {highest:.3g} in the second half of the time",
        highest=highest,
    )


@claim(
    "section 3",
    "the cycle of (3.6) in 20 digits, ν = 0.01, b = 1",
    "find_cycle against values from 40-digit arithmetic: period, multiplier",
)
def cycle_in_many_digits() -> Finding:
    """The periodic orbit of the piecewise linear system, pieced together from its two flows."""

    cycle = ss.find_cycle(
        catalogue.scaled_slider_limit(),
        {"beta": 0.0, "gamma": 0.01},
        parameters={"nu": 0.01, "b": 1.0},
    )
    return together(
        equals(cycle.period, 0.38862420022020717876 + 7.0673964441874579179, 1e-9, "period"),
        equals(float(cycle.nontrivial[0].real), 0.028162086887829495, 1e-9, "multiplier"),
    )


@claim(
    "section 3",
    "b ↦ γ_b is strictly decreasing from μ₀v̂ to 0",
    "γ_b for 30 values of b; b = 0.01 and 1.99",
)
def fixed_point_decreases() -> Finding:
    """The more unstable steady sliding is, the further the slip goes."""
    values = [fixed_point(float(b)) for b in np.linspace(0.05, 1.4, 30)]
    falling = shows(
        bool(np.all(np.diff(values) < 0)), f"largest difference {np.diff(values).max():.1e}"
    )
    small, large = fixed_point(0.01), fixed_point(1.99)
    ends = shows(
        0.95 < small < 1 and 0 <= large < 1e-12, f"γ_0.01 = {small:.4f}, γ_1.99 = {large:.1e}"
    )
    return together(falling, ends)


@claim(
    "section 3",
    "ρ_b increases from 1 to ∞ for b ∈ ]0, 2[",
    "30 values of the catalogue's ρ_b; ends",
)
def stretching_grows() -> Finding:
    """The stretching factor covers everything from none to infinite."""
    system = catalogue.scaled_slider_limit()
    values = [fact(system, "rho_b", b=float(b)) for b in (1e-6, *np.linspace(0.1, 1.9, 28), 1.999)]
    text = f"ρ = {values[0]:.6f} … {values[-1]:.1e}, least difference {np.diff(values).min():.1e}"
    return shows(
        bool(np.all(np.diff(values) > 0) and abs(values[0] - 1) < 1e-5 and values[-1] > 1e40), text
    )


@claim(
    "section 3",
    "0 < Ψ′(γ_b) < 1: the periodic orbit is stable",
    "slope at γ_b for b = 0.3 … 1.2; multipliers of find_cycle",
)
def cycle_is_stable() -> Finding:
    """The periodic orbit is stable."""

    slopes = []
    for b in (0.3, 0.7, 1.0, 1.2):
        g = fixed_point(b)
        h = 1e-4 * g
        slopes.append((composed(g + h, b) - composed(g - h, b)) / (2 * h))
    multipliers = []
    for b in (0.7, 1.4):
        cycle = ss.find_cycle(
            catalogue.scaled_slider_limit(),
            {"beta": 0.0, "gamma": 0.5},
            parameters={"nu": 1e-3, "b": b},
        )
        multipliers.append(maximum(*abs(cycle.nontrivial)))
    listed = ", ".join(f"{m:.2g}" for m in multipliers)
    text = f"slopes {min(slopes):.2g} … {max(slopes):.2g}; multipliers {listed}"
    return shows(all(0 < s < 1 for s in (*slopes, *multipliers)), text)


@claim(
    "section 3",
    "time with β > 0: √νπ/ω_b + O(ν),  time with β < 0: of order 1",
    "durations on the cycle of the exact flow, ν = 1e-4 … 1e-7: exponents",
    Verdict.ASYMPTOTIC,
)
def long_sticks_and_short_slips() -> Finding:
    """There is a relatively long period of sticking and a short one of sliding."""
    slips, sticks = [], []
    for nu in _VISCOSITIES:
        times = _cycle(nu).events["time"].to_numpy()[-3:]
        short, long = sorted(np.diff(times))
        slips.append(short - math.pi * math.sqrt(nu) / omega(1.0))
        sticks.append(long - C(1 / slip_map(_FIXED, 1.0)))
    return together(
        scales(_VISCOSITIES, slips, 1.0, 0.1, "slip − √νπ/ω_b", "ν"),
        scales(_VISCOSITIES, sticks, 0.5, 0.05, "stick − 𝒞(μ₀v̂/Φ⁺(γ_b))", "ν"),
    )


@claim(
    "section 3",
    "γ ∈ [0, C],  β ∈ [−Cv̂/ν, C/√ν]",
    "extrema on the cycle of the exact flow, ν = 1e-4 … 1e-7: exponents",
    Verdict.ASYMPTOTIC,
)
def sizes_of_the_solution() -> Finding:
    """The solutions satisfy the estimates that justify dropping terms."""
    low = []
    high = []
    top = []
    for nu in _VISCOSITIES:
        motion = _cycle(nu)
        times = motion.events["time"].to_numpy()[-3:]
        t = np.concatenate([np.linspace(a, b, 2001) for a, b in pairwise(times)])
        now = motion.at(t)
        low.append(float(now["beta"].min()))
        high.append(float(now["beta"].max()))
        top.append(float(now["gamma"].max()))
    return together(
        scales(_VISCOSITIES, low, -1.0, 0.02, "min β", "ν"),
        scales(_VISCOSITIES, high, -0.5, 0.02, "max β", "ν"),
        scales(_VISCOSITIES, top, 0.0, 0.02, "max γ", "ν"),
    )


# -- what they share -------------------------------------------------------------------------------


@cache
def _cycle(nu: float) -> ss.Trajectory:
    """A motion that has settled, with b = 1."""
    motion = ss.simulate(
        catalogue.scaled_slider_limit(),
        (0.0, 45.0),
        initial={"gamma": 0.1},
        parameters={"nu": nu, "b": 1.0},
    )
    return motion


def _shape(values: Array, x: Array, slopes_in: Callable[[Array], Array], convexity: int) -> Finding:
    slopes = np.diff(values) / np.diff(x)
    convex = bool(np.all(convexity * np.diff(slopes) > -1e-10))
    increase = np.diff(slopes).min()
    text = f"slopes {slopes.min():.4g} … {slopes.max():.4g}, least increase of slope {increase:.1e}"
    return shows(convex and bool(np.all(slopes_in(slopes))), text)
