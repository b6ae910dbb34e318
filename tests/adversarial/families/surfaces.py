"""Starts on switching surfaces, grazing slips, and functions that are not analytic where the motion
begins."""

from __future__ import annotations

from functools import cache
from math import cos, pi, sin

import numpy as np

from stickslip import Contact, Inertial, System

from ..case import Case, Rng, family, given, log_uniform, pick
from ..references.mechanics import Mechanics
from .classics import forced
from .single import KINDS, by_hand, declared, ordinary


@family
def start_on_the_threshold(rng: Rng) -> Case:
    """The force is exactly the threshold at first, and then rises, falls, or does so in second
    order."""
    kind = pick(rng, list(KINDS))
    n = ordinary(rng, kind)
    n["mu"] = float(pick(rng, (0.25, 0.5, 0.75)))
    n |= {"r": float(pick(rng, (-1.0, 0.0, 1.0))) * rng.uniform(0.1, 1.0)}
    n |= {"q": float(pick(rng, (-1.0, 1.0))) * rng.uniform(0.01, 0.1)}
    mu = n["mu"]
    r = n["r"]
    q = n["q"]
    mechanics = by_hand(kind, n, lambda t: mu + r * t + q * t**2)
    return Case(
        declared(kind, "mu + r*t + q*t**2", extra="r=0 q=0"),
        n,
        {},
        rng.uniform(3.0, 12.0),
        mechanics,
    )


@family
def start_on_the_belt(rng: Rng) -> Case:
    """The block moves with the belt at first, at a force below, on, or above the threshold."""
    n = ordinary(rng, "inertial") | {"V": rng.uniform(0.1, 1.0), "r": rng.uniform(-0.5, 0.5)}
    n |= {"F_k": n["mu"] * float(pick(rng, (1.0, 0.5)))}
    n["c"] = 0.0
    level = float(pick(rng, (-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5)))
    x = 0.5 * level
    n["k"], n["mu"] = 1.0, 0.5
    n["F_k"] = float(pick(rng, (0.5, 0.25)))
    mechanics = by_hand(
        "inertial",
        n,
        lambda t: n["r"] * t,
        kinetic=lambda u: n["F_k"],
        belt=lambda t: n["V"] + 0 * t,
    )
    system = declared("inertial", "r*t", kinetic="F_k", belt="V", extra="F_k=0.2 V=0.3 r=0")
    return Case(system, n, {"x": x, "d_x": n["V"]}, rng.uniform(5.0, 20.0), mechanics)


@family
def grazing_slip(rng: Rng) -> Case:
    """A swinging load exceeds the threshold by next to nothing, or just does not; slipping, it
    pulls free."""
    n = ordinary(rng, "inertial") | {"omega": rng.uniform(0.3, 2.0), "phi": rng.uniform(0.5, 5.5)}
    excess = log_uniform(rng, 1e-11, 1e-2) * pick(rng, (1.0, 1.0, -1.0))
    n |= {"F": n["mu"] * (1 + excess), "F_k": n["mu"] * rng.uniform(0.3, 0.9)}
    n["c"] = rng.uniform(0.1, 0.5)
    F = n["F"]
    omega = n["omega"]
    phi = n["phi"]
    mechanics = by_hand(
        "inertial", n, lambda t: F * cos(omega * t + phi), kinetic=lambda u: n["F_k"]
    )
    system = declared(
        "inertial", "F*cos(omega*t + phi)", kinetic="F_k", extra="F=0.5 omega=1 phi=1 F_k=0.2"
    )
    start = {"x": 0.0}
    if F * abs(cos(phi)) > n["mu"]:
        n["phi"] = phi = pi / 2
    # The instant of the slip is known to the root of the rounding errors, relative to the excess.
    noise = 1e-15 / np.sqrt(abs(excess))
    return Case(system, n, start, rng.uniform(1.0, 2.0) * 2 * pi / omega, mechanics, noise=noise)


@family
def tiny_slip(rng: Rng) -> Case:
    """The same without a drop of the friction: the slip itself is tiny, and must be there."""
    n = ordinary(rng, "inertial") | {"omega": rng.uniform(0.3, 2.0), "phi": pi / 2}
    n |= {"F": n["mu"] * (1 + log_uniform(rng, 1e-6, 1e-2))}
    F = n["F"]
    omega = n["omega"]
    phi = n["phi"]
    mechanics = by_hand("inertial", n, lambda t: F * cos(omega * t + phi))
    system = declared("inertial", "F*cos(omega*t + phi)", extra="F=0.5 omega=1 phi=1")
    return Case(system, n, {}, rng.uniform(1.0, 2.0) * 2 * pi / omega, mechanics)


# -- powers ----------------------------------------------------------------------------------------

POWERS = {
    "A*x**10/10": (lambda x, A, q, s: -A * x**9, None),
    "A*x**4": (lambda x, A, q, s: -4 * A * x**3, None),
    "A*max(x - q, 0)**2.5": (
        lambda x, A, q, s: -2.5 * A * max(x - q, 0.0) ** 1.5 if s[0] > 0 else 0.0,
        lambda x, q: [x - q],
    ),
    "A*abs(x)**2.5": (
        lambda x, A, q, s: -2.5 * A * s[0] * max(s[0] * x, 0.0) ** 1.5,
        lambda x, q: [x],
    ),
    "A*abs(x)**1.5": (
        lambda x, A, q, s: -1.5 * A * s[0] * max(s[0] * x, 0.0) ** 0.5,
        lambda x, q: [x],
    ),
}


@family
def one_sided_powers(rng: Rng) -> Case:
    """Hertzian contacts and hard springs, whose series begin at zero."""
    text = pick(rng, list(POWERS))
    push, kinks = POWERS[text]
    n = ordinary(rng, "inertial") | {
        "F": rng.uniform(0.8, 2.5),
        "omega": rng.uniform(0.3, 1.2),
        "q": 0.1,
    }
    n |= {"A": rng.uniform(0.3, 2.0)}
    F, omega, A, q, k, c, mu = (n[name] for name in ("F", "omega", "A", "q", "k", "c", "mu"))
    mechanics = Mechanics(
        kinds=(1, 0, 0, 0),
        inertia=[[n["m"]]],
        J=[[1.0]],
        force=lambda t, x, v, a, side: [
            F * sin(omega * t) - k * x[0] - c * v[0] + push(x[0], A, q, side)
        ],
        threshold=lambda t, x, v, a, side: [mu],
        kinks=(lambda t, x, v, a: kinks(x[0], q)) if kinks else None,
        step=0.15,
    )
    start = {} if rng.random() < 0.7 else {"d_x": rng.normal()}
    system = declared("inertial", "F*sin(omega*t)", potential=text, extra="F=1 omega=1 A=1 q=0.1")
    return Case(system, n, start, rng.uniform(6.0, 12.0), mechanics)


TIMES = {
    "(t/T)**9": lambda t, T: (t / T) ** 9,
    "(t/T)**17": lambda t, T: (t / T) ** 17,
    "sin(t/T)**22": lambda t, T: np.sin(t / T) ** 22,
    "(1 - cos(t/T))**5/32": lambda t, T: (1 - np.cos(t / T)) ** 5 / 32,
}


@family
def high_powers_of_time(rng: Rng) -> Case:
    """Loads whose series at the start are zero for a long while."""
    kind, text = pick(rng, list(KINDS)), pick(rng, list(TIMES))
    law = TIMES[text]
    n = ordinary(rng, kind) | {"A": rng.uniform(0.8, 3.0), "T": rng.uniform(1.0, 4.0)}
    A, T = n["A"], n["T"]
    span = T * (rng.uniform(1.0, 1.2) if text.startswith("(t") else rng.uniform(3.0, 8.0))
    mechanics = by_hand(kind, n, lambda t: A * law(t, T), step=min(0.2, 0.05 * T))
    return Case(declared(kind, f"A*{text}", extra="A=1 T=1"), n, {}, span, mechanics)


@family
def late_start(rng: Rng) -> Case:
    """The same motion at t = 1e9 as at t = 0."""
    kind = pick(rng, list(KINDS))
    plain = forced(rng, kind)
    n = dict(plain.parameters) | {"late": 1e9}
    system = declared(
        kind, "f + F*cos(omega*(t - late) + phi)", extra="f=0 F=1 omega=1 phi=0 late=0"
    )
    # Instants are known to the spacing of numbers at 1e9: switches and states inherit 1e-7 of a
    # time unit at worst.
    return Case(system, n, plain.initial, plain.duration, plain.mechanics, origin=1e9, noise=1e-7)


@cache
def autonomous() -> System:
    return System(
        name="block on a belt",
        parameters=given(k=1.0, mu=1.0, F_k=0.5, V=0.3),
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="k*x**2/2",
        contacts={"belt": Contact("d_x", "mu", "V", "F_k")},
    )


@family
def late_belt(rng: Rng) -> Case:
    """Nothing depends on time: the start at 1e9 cannot matter but to the instants of output."""
    n = {
        "k": rng.uniform(0.5, 2.0),
        "mu": 1.0,
        "F_k": rng.uniform(0.3, 0.9),
        "V": rng.uniform(0.1, 0.8),
    }
    mechanics = Mechanics(
        kinds=(1, 0, 0, 0),
        inertia=[[1.0]],
        J=[[1.0]],
        force=lambda t, x, v, a, side: [-n["k"] * x[0]],
        threshold=lambda t, x, v, a, side: [1.0],
        kinetic=lambda t, x, v, a, side, speed: [n["F_k"]],
        belt=lambda t: [n["V"] + 0 * t],
    )
    return Case(autonomous(), n, {"x": rng.normal()}, 25.0, mechanics, origin=1e9, noise=1e-7)
