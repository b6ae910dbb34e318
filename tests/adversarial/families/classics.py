"""Oscillators, belts, floors: the systems of textbooks with random numbers, and what stiffness and
speed add."""

from __future__ import annotations

from functools import cache
from math import cos, pi, sin

import numpy as np

from stickslip import Contact, Inertial, System

from ..case import Case, Rng, family, given, log_uniform, pick
from ..references.mechanics import TIME, Mechanics, Zone
from .shapes import BUMPS
from .single import by_hand, declared, ordinary

WAVE = "f + F*cos(omega*t + phi)"
WAVES = "f=0 F=1 omega=1 phi=0"


def forced(rng: Rng, kind: str) -> Case:
    """A harmonic load."""
    n = ordinary(rng, kind) | {
        "f": rng.normal(0, 0.2),
        "F": rng.uniform(0.3, 3),
        "omega": rng.uniform(0.3, 2),
    }
    n |= {"phi": rng.uniform(0, 6)}
    f = n["f"]
    F = n["F"]
    omega = n["omega"]
    phi = n["phi"]
    start = (
        {"x": rng.normal(), "d_x": rng.normal()}
        if kind == "inertial"
        else {"x": 0.3 * rng.normal()}
    )
    if kind == "rate-independent":
        start = {"x": (f + F * cos(phi) + n["mu"] * rng.uniform(-1, 1)) / n["k"]}
    mechanics = by_hand(kind, n, lambda t: f + F * np.cos(omega * t + phi))
    return Case(declared(kind, WAVE, extra=WAVES), n, start, rng.uniform(10, 40), mechanics)


@family
def forced_oscillator(rng: Rng) -> Case:
    """Mass, spring, harmonic load, and a little viscosity."""
    return forced(rng, "inertial")


@family
def forced_dashpot(rng: Rng) -> Case:
    """Spring and viscosity under a harmonic load."""
    return forced(rng, "viscous")


@family
def forced_play(rng: Rng) -> Case:
    """A spring alone under a harmonic load: the play operator."""
    return forced(rng, "rate-independent")


@family
def stiff_dashpot(rng: Rng) -> Case:
    """A viscosity of 1e-4 to 1e-3: slips are fast, and follow the load closely."""
    case = forced(rng, "viscous")
    n = dict(case.parameters) | {"c": log_uniform(rng, 1e-4, 1e-3)}
    f = n["f"]
    F = n["F"]
    omega = n["omega"]
    phi = n["phi"]
    mechanics = by_hand("viscous", n, lambda t: f + F * cos(omega * t + phi))
    return Case(case.system, n, case.initial, rng.uniform(0.3, 1.5), mechanics)


@family
def block_on_a_belt(rng: Rng) -> Case:
    """Static above kinetic friction, constant belt."""
    n = ordinary(rng, "inertial") | {"V": rng.uniform(0.05, 1.0)}
    n |= {"F_k": n["mu"] * rng.uniform(0.3, 0.95)}
    mechanics = by_hand(
        "inertial", n, lambda t: 0.0, kinetic=lambda u: n["F_k"], belt=lambda t: n["V"] + 0 * t
    )
    start = {"x": rng.normal(), "d_x": rng.normal()}
    return Case(
        declared("inertial", kinetic="F_k", belt="V", extra="F_k=0.2 V=0.3"),
        n,
        start,
        30.0,
        mechanics,
    )


STRIBECK = {
    "F_k + (mu - F_k)*exp(-speed/v_s)": lambda u, s, k, v: k + (s - k) * np.exp(-u / v),
    "F_k + (mu - F_k)/(1 + speed/v_s)": lambda u, s, k, v: k + (s - k) / (1 + u / v),
    "F_k + (mu - F_k)*exp(-(speed/v_s)**2)": lambda u, s, k, v: (
        k + (s - k) * np.exp(-((u / v) ** 2))
    ),
    "0.9*(F_k + (mu - F_k)/cosh(speed/v_s))": lambda u, s, k, v: (
        0.9 * (k + (s - k) / np.cosh(u / v))
    ),
}


@family
def stribeck_belt(rng: Rng) -> Case:
    """Friction that falls with speed."""
    text = pick(rng, list(STRIBECK))
    n = ordinary(rng, "inertial") | {"V": rng.uniform(0.02, 1.5), "v_s": rng.uniform(0.05, 1.0)}
    n |= {"F_k": n["mu"] * rng.uniform(0.3, 0.95)}
    mu = n["mu"]
    F_k = n["F_k"]
    v_s = n["v_s"]
    law = STRIBECK[text]
    mechanics = by_hand(
        "inertial",
        n,
        lambda t: 0.0,
        kinetic=lambda u: law(u, mu, F_k, v_s),
        belt=lambda t: n["V"] + 0 * t,
    )
    system = declared("inertial", kinetic=text, belt="V", extra="F_k=0.2 V=0.3 v_s=0.5")
    return Case(system, n, {"x": rng.normal(), "d_x": rng.normal()}, 25.0, mechanics)


@family
def moving_belt(rng: Rng) -> Case:
    """A belt whose speed swings, or jolts for a short while."""
    shape = pick(rng, (None, BUMPS[0], BUMPS[1]))
    n = ordinary(rng, "inertial") | {"V": rng.uniform(-0.5, 0.5), "r": rng.uniform(0.1, 1.0)}
    n |= {"F_k": n["mu"] * rng.uniform(0.5, 1.0)}
    if shape is None:
        n |= {"omega": rng.uniform(0.3, 2.0)}
        V = n["V"]
        r = n["r"]
        omega = n["omega"]
        mechanics = by_hand(
            "inertial",
            n,
            lambda t: 0.0,
            kinetic=lambda u: n["F_k"],
            belt=lambda t: V + r * np.sin(omega * t),
        )
        system = declared(
            "inertial",
            kinetic="F_k",
            belt="V + r*sin(omega*t)",
            extra="F_k=0.2 V=0.3 r=0.2 omega=1",
        )
        return Case(system, n, {}, 25.0, mechanics)
    n |= {"w": 30.0 * log_uniform(rng, 1e-4, 3e-2), "p": rng.uniform(3.0, 25.0)}
    V = n["V"]
    r = n["r"]
    w = n["w"]
    p = n["p"]
    mechanics = by_hand(
        "inertial",
        n,
        lambda t: 0.0,
        kinetic=lambda u: n["F_k"],
        belt=lambda t: V + r * shape.at((t - p) / w),
        zones=(Zone(TIME, p, w),),
    )
    system = declared(
        "inertial",
        kinetic="F_k",
        belt=f"V + r*{shape.text('t')}",
        extra="F_k=0.2 V=0.3 r=0.2 p=1 w=0.1",
    )
    return Case(system, n, {}, 30.0, mechanics)


@family
def dither(rng: Rng) -> Case:
    """A slow load with a fast one on top: many short slips."""
    n = ordinary(rng, "inertial") | {"F": rng.uniform(0.2, 1.5), "omega": rng.uniform(10.0, 40.0)}
    n |= {"V": rng.uniform(0.05, 0.3), "c": rng.uniform(0.1, 0.5)}
    F = n["F"]
    omega = n["omega"]
    V = n["V"]
    k = n["k"]
    mechanics = by_hand(
        "inertial", n, lambda t: k * V * t + F * np.sin(omega * t), step=1.0 / omega
    )
    system = declared("inertial", "k*V*t + F*sin(omega*t)", extra="F=1 omega=20 V=0.1")
    return Case(system, n, {}, rng.uniform(3.0, 6.0), mechanics)


# -- a floor and nothing else ----------------------------------------------------------------------

DRAGS = {
    "0": lambda v, c, w: 0.0,
    "c*d_x": lambda v, c, w: c * v,
    "c*log(d_x/w + sqrt(1 + (d_x/w)**2))": lambda v, c, w: c * np.arcsinh(v / w),
    "c*d_x**3": lambda v, c, w: c * v**3,
    "c*tanh(d_x/w)": lambda v, c, w: c * np.tanh(v / w),
}


@cache
def thrown(drag: str, kinetic: str | None = None) -> System:
    return System(
        name="thrown block",
        parameters=given(m=1.0, mu=0.5, F_k=0.2, c=0.1, w=1.0),
        coordinates={"x": Inertial(drag=drag)},
        kinetic="m*d_x**2/2",
        contacts={"floor": Contact("d_x", "mu", kinetic=kinetic)},
    )


@family
def thrown_block(rng: Rng) -> Case:
    """A block thrown over a floor comes to rest and stays."""
    drag = pick(rng, list(DRAGS))
    weak = drag == "0" and rng.random() < 0.5
    n = {
        "m": log_uniform(rng, 0.1, 10.0),
        "mu": log_uniform(rng, 0.03, 1.0),
        "c": rng.uniform(0.01, 0.5),
    }
    n |= {"w": log_uniform(rng, 1e-3, 1.0), "F_k": n["mu"] * rng.uniform(0.2, 1.0)}
    m = n["m"]
    mu = n["mu"]
    c = n["c"]
    w = n["w"]
    law = DRAGS[drag]
    mechanics = Mechanics(
        kinds=(1, 0, 0, 0),
        inertia=[[m]],
        J=[[1.0]],
        force=lambda t, x, v, a, side: [-law(v[0], c, w)],
        threshold=lambda t, x, v, a, side: [mu],
        kinetic=(lambda t, x, v, a, side, speed: [n["F_k"]]) if weak else None,
        zones=() if drag != "c*tanh(d_x/w)" else (Zone(1, 0.0, w),),
    )
    v = rng.uniform(0.1, 2.0) * pick(rng, (-1.0, 1.0))
    stop = m * abs(v) / (n["F_k"] if weak else mu)
    return Case(
        thrown(drag, "F_k" if weak else None),
        n,
        {"d_x": v},
        stop * rng.uniform(0.5, 3.0),
        mechanics,
    )


# -- friction that changes -------------------------------------------------------------------------


@family
def vanishing_threshold(rng: Rng) -> Case:
    """Thresholds that are zero for a while, or touch it."""
    kind = pick(rng, ("inertial", "viscous", "rate-independent"))
    n = ordinary(rng, kind) | {
        "F": rng.uniform(0.3, 2.0),
        "omega": rng.uniform(0.3, 1.5),
        "phi": rng.uniform(0, 6),
    }
    n |= {"s_1": rng.uniform(0.3, 1.0), "alpha": rng.uniform(0.3, 2.0)}
    n["mu"] = (
        n["s_1"] * float(rng.choice([1.0, 0.3, 0.7, 1.5]))
        if kind != "rate-independent"
        else n["s_1"] * 1.2
    )
    F, omega, phi, mu, s_1, alpha, k = (
        n[name] for name in ("F", "omega", "phi", "mu", "s_1", "alpha", "k")
    )
    plain = by_hand(kind, n, lambda t: F * np.cos(omega * t + phi))
    touches = mu == s_1

    def level(t):
        return mu + s_1 * np.cos(alpha * t)

    mechanics = Mechanics(
        kinds=plain.kinds,
        inertia=plain.inertia,
        J=plain.J,
        force=plain.force,
        threshold=lambda t, x, v, a, side: [level(t) if touches or side[0] > 0 else 0.0 * t],
        kinks=lambda t, x, v, a: [1.0 if touches else np.real(level(t))],
    )
    start = {"x": F * cos(phi) / k} if kind == "rate-independent" else {}
    system = declared(
        kind,
        "F*cos(omega*t + phi)",
        threshold="max(mu + s_1*cos(alpha*t), 0)",
        extra="F=1 omega=1 phi=0 s_1=0.4 alpha=1",
    )
    return Case(system, n, start, rng.uniform(10, 25), mechanics, friction=False)


# -- kinks and jumps -------------------------------------------------------------------------------

KINKS = {
    # −slope of the potential's kinked part in the region given by the sides, and the kink functions
    "A*abs(x - p)": (lambda x, A, p, q, s: -A * s[0], lambda x, p, q: [x - p]),
    "A*max(x - p, 0)**2": (
        lambda x, A, p, q, s: -2 * A * (x - p) * (s[0] > 0),
        lambda x, p, q: [x - p],
    ),
    "A*max(abs(x) - q, 0)**2": (
        lambda x, A, p, q, s: -2 * A * (s[0] * x - q) * s[0] * ((s[1] if s[0] > 0 else s[2]) > 0),
        lambda x, p, q: [x, x - q, -x - q],
    ),
    "A*piecewise(x < p, 0, x < p + q, (x - p)**2, q**2 + 2*q*(x - p - q))": (
        lambda x, A, p, q, s: 0.0 if s[0] < 0 else (-2 * A * (x - p) if s[1] < 0 else -2 * A * q),
        lambda x, p, q: [x - p, x - p - q],
    ),
}


@family
def kinked_spring(rng: Rng) -> Case:
    """Stops, gaps, springs that yield: potentials with kinks."""
    kind = pick(rng, ("inertial", "viscous"))
    text = pick(rng, list(KINKS) if kind == "inertial" else list(KINKS)[1:])
    n = ordinary(rng, kind) | {
        "F": rng.uniform(0.5, 3.0),
        "omega": rng.uniform(0.3, 1.5),
        "phi": rng.uniform(0, 6),
    }
    n |= {"A": rng.uniform(0.2, 3.0), "p": rng.uniform(-0.5, 0.5), "q": rng.uniform(0.1, 0.6)}
    if text == "A*abs(x - p)":
        # stronger, it would catch the block at p in infinitely many swings
        n["A"] = rng.uniform(0.2, 0.9) * n["mu"]
    F, omega, phi, A, p, q = (n[name] for name in ("F", "omega", "phi", "A", "p", "q"))
    push, kinks = KINKS[text]
    k, c = n["k"], n["c"]
    drag = c if kind == "inertial" else 0.0
    mechanics = Mechanics(
        kinds=(1, 0, 0, 0) if kind == "inertial" else (0, 1, 0, 0),
        inertia=[[n["m"] if kind == "inertial" else c]],
        J=[[1.0]],
        force=lambda t, x, v, a, side: [
            F * cos(omega * t + phi)
            - k * x[0]
            - (drag * v[0] if drag else 0.0)
            + push(x[0], A, p, q, side)
        ],
        threshold=lambda t, x, v, a, side: [n["mu"]],
        kinks=lambda t, x, v, a: kinks(x[0], p, q),
    )
    system = declared(
        kind, "F*cos(omega*t + phi)", potential=text, extra="F=1 omega=1 phi=0 A=1 p=0.1 q=0.3"
    )
    return Case(system, n, {"x": rng.normal()}, rng.uniform(10, 20), mechanics)


@family
def jumps_in_time(rng: Rng) -> Case:
    """Loads and thresholds that jump."""
    kind = pick(rng, ("inertial", "viscous"))
    n = ordinary(rng, kind) | {
        "F": rng.uniform(0.5, 2.0),
        "A": rng.uniform(0.5, 3.0),
        "d": rng.uniform(0.2, 0.9),
    }
    n |= {"p": rng.uniform(2.0, 8.0), "q": rng.uniform(9.0, 15.0), "omega": rng.uniform(0.3, 1.5)}
    F, A, d, p, q, omega, k, mu = (
        n[name] for name in ("F", "A", "d", "p", "q", "omega", "k", "mu")
    )
    drag = n["c"] if kind == "inertial" else 0.0
    mechanics = Mechanics(
        kinds=(1, 0, 0, 0) if kind == "inertial" else (0, 1, 0, 0),
        inertia=[[n["m"] if kind == "inertial" else n["c"]]],
        J=[[1.0]],
        force=lambda t, x, v, a, side: [
            F * sin(omega * t)
            + (A if side[0] > 0 else 0.0)
            - k * x[0]
            - (drag * v[0] if drag else 0.0)
        ],
        threshold=lambda t, x, v, a, side: [mu * (1 - d) if side[1] > 0 else mu],
        kinks=lambda t, x, v, a: [t - p, t - q],
    )
    system = declared(
        kind,
        "F*sin(omega*t) + piecewise(t < p, 0, A)",
        threshold="mu*piecewise(t < q, 1, 1 - d)",
        extra="F=1 A=1 d=0.5 p=1 q=2 omega=1",
    )
    return Case(system, n, {}, rng.uniform(16, 25), mechanics)


@family
def jump_in_space(rng: Rng) -> Case:
    """A force that is on beyond a place, met at speed."""
    n = {"m": rng.uniform(0.5, 2.0), "mu": rng.uniform(0.1, 0.4), "A": rng.uniform(-1.0, 2.0)}
    n |= {"p": rng.uniform(0.3, 1.5), "k": rng.uniform(0.2, 1.0)}
    m, mu, A, p, k = (n[name] for name in ("m", "mu", "A", "p", "k"))
    mechanics = Mechanics(
        kinds=(1, 0, 0, 0),
        inertia=[[m]],
        J=[[1.0]],
        force=lambda t, x, v, a, side: [-k * x[0] + (A if side[0] > 0 else 0.0)],
        threshold=lambda t, x, v, a, side: [mu],
        kinks=lambda t, x, v, a: [x[0] - p],
    )
    system = System(
        name="a force beyond a place",
        parameters=given(m=1.0, mu=0.3, A=1.0, p=1.0, k=1.0),
        coordinates={"x": Inertial(force="piecewise(x < p, 0, A)")},
        kinetic="m*d_x**2/2",
        potential="k*x**2/2",
        contacts={"floor": Contact("d_x", "mu")},
    )
    return Case(system, n, {"d_x": rng.uniform(2.0, 4.0)}, 3 * pi, mechanics)


# -- short memory ----------------------------------------------------------------------------------


@family
def chaotic(rng: Rng) -> Case:
    """A forced double well with friction, followed for a short time only."""
    n = {
        "c": rng.uniform(0.05, 0.2),
        "mu": rng.uniform(0.02, 0.1),
        "F": rng.uniform(0.3, 0.6),
        "k": -1.0,
        "m": 1.0,
    }
    n |= {"omega": rng.uniform(0.8, 1.4)}
    F, omega = n["F"], n["omega"]
    mechanics = by_hand("inertial", n, lambda t: F * cos(omega * t), push=lambda x: -(x**3))
    system = declared("inertial", "F*cos(omega*t)", potential="x**4/4", extra="F=0.4 omega=1")
    return Case(system, n, {"x": rng.normal(), "d_x": rng.normal()}, 15.0, mechanics)
