"""Narrow features in time and space, on every kind of coordinate: ordinary widths down to 1e-4 of
the whole."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial, update_wrapper
from math import cos, pi
from typing import Any

import numpy as np

from ..case import FAMILIES, Case, Rng, log_uniform, pick
from ..references.mechanics import TIME, Zone
from .shapes import BUMPS, STEPS, Shape
from .single import KINDS, by_hand, declared, ordinary

WAVE = "F*cos(omega*t + phi)"
WAVES = "F=0 omega=1 phi=0"


def each_kind(make: Callable[..., Case]) -> Callable[..., Case]:
    """Register a family for every kind of coordinate."""
    for kind in KINDS:
        made = partial(make, kind=kind)
        update_wrapper(made, make)
        FAMILIES[f"{make.__name__.replace('_', ' ')}, {kind}"] = made
    return make


def wave(rng: Rng, mu: float) -> dict[str, float]:
    """A slow load below the threshold, or none: between the features nothing happens."""
    size = float(rng.choice([0.0, 0.3, 0.9])) * mu
    return {"F": size, "omega": rng.uniform(0.3, 1.2), "phi": rng.uniform(0.0, 6.0)}


@each_kind
def pulse_in_the_load(rng: Rng, kind: str) -> Case:
    """At rest until one short pulse throws it off."""
    shape: Shape = pick(rng, BUMPS)
    n = ordinary(rng, kind)
    span = rng.uniform(20.0, 60.0)
    w = span * log_uniform(rng, 1e-4, 3e-2)
    p = span * rng.uniform(0.1, 0.9)
    kick = rng.uniform(1.0, 4.0) * pick(rng, (-1.0, 1.0))
    height = {"inertial": kick / w, "viscous": kick / min(w, 1.0), "rate-independent": kick}[kind]
    n |= wave(rng, n["mu"]) | {"A": height + n["mu"] * np.sign(kick), "p": p, "w": w}
    F = n["F"]
    omega = n["omega"]
    phi = n["phi"]
    A = n["A"]
    mechanics = by_hand(
        kind,
        n,
        lambda t: F * np.cos(omega * t + phi) + A * shape.at((t - p) / w),
        zones=(Zone(TIME, p, w),),
    )
    system = declared(kind, f"{WAVE} + A*{shape.text('t')}", extra=f"{WAVES} A=1 p=1 w=0.1")
    return Case(system, n, {}, span, mechanics)


def _turn(t: Any, p: float, T: float) -> Any:
    return np.sin(pi * (t - p) / T)


TRAINS = {
    "exp(-(sin(pi*(t - p)/T)/w)**2)": lambda t, p, T, w: np.exp(-((_turn(t, p, T) / w) ** 2)),
    "1/(1 + (sin(pi*(t - p)/T)/w)**2)": lambda t, p, T, w: 1 / (1 + (_turn(t, p, T) / w) ** 2),
    "exp((cos(2*pi*(t - p)/T) - 1)/w**2)": lambda t, p, T, w: np.exp(
        -2 * (_turn(t, p, T) / w) ** 2
    ),
    "cos(pi*(t - p)/T)**1000": lambda t, p, T, w: np.cos(pi * (t - p) / T) ** 1000,
    "(1 + tanh(sin(pi*(t - p)/T)/w))/2": lambda t, p, T, w: STEPS[0].at(_turn(t, p, T) / w),
}


@each_kind
def train_of_pulses(rng: Rng, kind: str) -> Case:
    """Short pulses with a long period."""
    text = pick(rng, list(TRAINS))
    shape = TRAINS[text]
    n = ordinary(rng, kind)
    T = rng.uniform(4.0, 12.0)
    span = T * rng.uniform(3.0, 9.0)
    w = log_uniform(rng, 2e-3, 0.3)
    p = T * rng.uniform(0.1, 0.9)
    w = 0.045 if "1000" in text else w
    width = w * T / pi
    kick = rng.uniform(0.5, 2.0)
    height = {
        "inertial": kick / width,
        "viscous": kick / min(width, 1.0),
        "rate-independent": kick,
    }[kind]
    height = kick if "tanh" in text else height
    n |= wave(rng, n["mu"]) | {"A": height + n["mu"], "p": p, "w": w, "T": T}
    F = n["F"]
    omega = n["omega"]
    phi = n["phi"]
    A = n["A"]
    mechanics = by_hand(
        kind,
        n,
        lambda t: F * np.cos(omega * t + phi) + A * shape(t, p, T, w),
        zones=tuple(Zone(TIME, p + j * T, width) for j in range(-1, int(span / T) + 2)),
    )
    return Case(
        declared(kind, f"{WAVE} + A*{text}", extra=f"{WAVES} A=1 p=1 w=0.1 T=5"),
        n,
        {},
        span,
        mechanics,
    )


@each_kind
def step_in_the_load(rng: Rng, kind: str) -> Case:
    """A load that rises within a short time, and falls again within another."""
    shape: Shape = pick(rng, STEPS)
    n = ordinary(rng, kind)
    span = rng.uniform(20.0, 60.0)
    p, q = np.sort(span * rng.uniform(0.1, 0.9, 2))
    w, w2 = (span * log_uniform(rng, 1e-4, 2e-2) for _ in range(2))
    n |= wave(rng, n["mu"]) | {
        "A": n["mu"] * rng.uniform(1.2, 4.0),
        "p": p,
        "w": w,
        "q": q,
        "w2": w2,
    }
    F = n["F"]
    omega = n["omega"]
    phi = n["phi"]
    A = n["A"]
    mechanics = by_hand(
        kind,
        n,
        lambda t: (
            F * np.cos(omega * t + phi) + A * (shape.at((t - p) / w) - shape.at((t - q) / w2))
        ),
        zones=(Zone(TIME, p, w), Zone(TIME, q, w2)),
    )
    text = f"{WAVE} + A*({shape.text('t')} - {shape.text('t', 'q', 'w2')})"
    return Case(
        declared(kind, text, extra=f"{WAVES} A=1 p=1 w=0.1 q=2 w2=0.1"), n, {}, span, mechanics
    )


@each_kind
def dip_of_a_threshold(rng: Rng, kind: str) -> Case:
    """A constant load that the contact holds but for a short weakness."""
    shape: Shape = pick(rng, BUMPS)
    n = ordinary(rng, kind)
    span = rng.uniform(20.0, 60.0)
    w = span * log_uniform(rng, 1e-4, 3e-2)
    p = span * rng.uniform(0.1, 0.9)
    d = rng.uniform(0.5, 1.0)
    load = n["mu"] * (1 - d * rng.uniform(0.05, 0.9)) * pick(rng, (-1.0, 1.0))
    n |= {"f": load, "d": d, "p": p, "w": w}
    mu = n["mu"]
    mechanics = by_hand(
        kind,
        n,
        lambda t: load + 0.0 * t,
        bound=lambda t, x: mu * (1 - d * shape.at((t - p) / w)),
        zones=(Zone(TIME, p, w),),
    )
    system = declared(
        kind, "f", threshold=f"mu*(1 - d*{shape.text('t')})", extra="f=0 d=0.5 p=1 w=0.1"
    )
    return Case(system, n, {}, span, mechanics)


def travel(rng: Rng, kind: str) -> tuple[dict[str, float], dict[str, float], float, float]:
    """Something that moves along x: numbers, initial values, duration, and how far it gets."""
    n = ordinary(rng, kind)
    if kind != "inertial":
        n |= {"V": rng.uniform(0.1, 0.5)}
        span = rng.uniform(10.0, 30.0)
        return n, {}, span, 0.7 * n["V"] * span
    n |= {"V": 0.0}
    v = rng.uniform(2.0, 4.0)
    mu = n["mu"]
    k = n["k"]
    m = n["m"]
    return n, {"d_x": v}, rng.uniform(10.0, 20.0), (np.sqrt(mu**2 + k * m * v**2) - mu) / k


@each_kind
def rough_patch(rng: Rng, kind: str) -> Case:
    """A narrow place of the floor with more friction (or, now and then, a slippery one)."""
    shape: Shape = pick(rng, BUMPS)
    n, start, span, reach = travel(rng, kind)
    w = reach * log_uniform(rng, 1e-4, 0.1)
    p = reach * rng.uniform(0.3, 0.8)
    if kind == "inertial":
        # The work of the patch is a part of the energy.
        height = rng.uniform(0.05, 0.6) * 0.5 * n["m"] * start["d_x"] ** 2 / w
    else:
        # Steeper than the spring without viscosity, it would have to be jumped over.
        height = (
            n["k"] * w * rng.uniform(0.1, 0.9)
            if kind == "rate-independent"
            else rng.uniform(0.3, 2.0) * n["mu"]
        )
    A = float(rng.choice([1.0, 1.0, -1.0])) * height
    A = max(A, -0.9 * n["mu"])
    n |= {"A": A, "p": p, "w": w}
    V = n["V"]
    k = n["k"]
    mu = n["mu"]
    mechanics = by_hand(
        kind,
        n,
        lambda t: k * V * t,
        bound=lambda t, x: mu + A * shape.at((x - p) / w),
        zones=(Zone(0, p, w),),
    )
    system = declared(
        kind, "k*V*t", threshold=f"mu + A*{shape.text('x')}", extra="V=0 A=0.1 p=1 w=0.1"
    )
    return Case(system, n, start, span, mechanics)


WALLS = {
    BUMPS[0]: lambda u: 2 * u * np.exp(-u * u),
    STEPS[0]: lambda u: -0.5 * BUMPS[1].at(u),
    STEPS[1]: lambda u: -0.25 * BUMPS[1].at(u / 2),
}


@each_kind
def narrow_wall(rng: Rng, kind: str) -> Case:
    """A narrow hill or a steep step of the potential."""
    shape = pick(rng, list(WALLS))
    n, start, span, reach = travel(rng, kind)
    w = reach * log_uniform(rng, 1e-4, 0.1)
    p = reach * rng.uniform(0.3, 0.8)
    height = {
        "inertial": rng.uniform(0.1, 1.3) * 0.5 * n.get("m", 0.0) * start.get("d_x", 0.0) ** 2,
        "viscous": rng.uniform(0.3, 2.0) * n["mu"] * w,
        "rate-independent": rng.uniform(0.1, 0.45) * n["k"] * w**2,
    }[kind]
    n |= {"A": height, "p": p, "w": w}
    V = n["V"]
    k = n["k"]
    A = n["A"]
    slope = WALLS[shape]
    mechanics = by_hand(
        kind,
        n,
        lambda t: k * V * t,
        push=lambda x: A / w * slope((x - p) / w),
        zones=(Zone(0, p, w),),
    )
    system = declared(kind, "k*V*t", potential=f"A*{shape.text('x')}", extra="V=0 A=0.1 p=1 w=0.1")
    return Case(system, n, start, span, mechanics)


@each_kind
def travelling_weakness(rng: Rng, kind: str) -> Case:
    """A narrow weak place that runs along the floor, under a block that is pulled steadily."""
    shape: Shape = pick(rng, BUMPS)
    n = ordinary(rng, kind)
    span = rng.uniform(15.0, 30.0)
    V = rng.uniform(0.2, 1.0) * pick(rng, (-1.0, 1.0))
    w = log_uniform(rng, 1e-3, 0.3)
    d = rng.uniform(0.5, 0.95)
    p = -V * span * rng.uniform(0.2, 0.8)
    n |= {
        "V": V,
        "w": w,
        "d": d,
        "p": p,
        "f": n["mu"] * (1 - d * rng.uniform(0.1, 0.9)) * pick(rng, (-1.0, 1.0)),
    }
    if kind == "rate-independent":
        n["d"] = d = min(d, 0.8 * n["k"] * w / n["mu"])  # steeper, the block would jump
        n["f"] = n["mu"] * (1 - d * rng.uniform(0.1, 0.9))
    mu, f = n["mu"], n["f"]
    mechanics = by_hand(
        kind,
        n,
        lambda t: f + 0.0 * t,
        bound=lambda t, x: mu * (1 - d * shape.at((x - V * t - p) / w)),
        zones=(Zone(0, p, w, V),),
    )
    threshold = f"mu*(1 - d*{shape.text('(x - V*t)')})"
    return Case(
        declared(kind, "f", threshold=threshold, extra="f=0 V=0.3 d=0.5 p=1 w=0.1"),
        n,
        {},
        span,
        mechanics,
    )


def narrow_in_speed(rng: Rng) -> Case:
    """A drag or a Stribeck peak that changes within a small relative velocity."""
    n = ordinary(rng, "inertial") | {"V": rng.uniform(0.1, 0.6), "w": log_uniform(rng, 1e-4, 0.1)}
    n |= {"d": rng.uniform(0.1, 0.6), "F": rng.uniform(0.0, 1.5), "omega": rng.uniform(0.5, 1.5)}
    shape = pick(
        rng,
        (("exp(-speed/w)", lambda u: np.exp(-u)), ("exp(-(speed/w)**2)", lambda u: np.exp(-u * u))),
    )
    mu, V, w, d, F, omega = (n[name] for name in ("mu", "V", "w", "d", "F", "omega"))
    mechanics = by_hand(
        "inertial",
        n,
        lambda t: F * cos(omega * t),
        kinetic=lambda speed: mu * (1 - d * (1 - shape[1](speed / w))),
        belt=lambda t: V + 0 * t,
        zones=(Zone(1, V, w),),
    )
    system = declared(
        "inertial",
        "F*cos(omega*t)",
        kinetic=f"mu*(1 - d*(1 - {shape[0]}))",
        belt="V",
        extra="V=0.3 w=0.1 d=0.3 F=0 omega=1",
    )
    return Case(system, n, {}, rng.uniform(10.0, 30.0), mechanics)


FAMILIES["narrow in speed, inertial"] = narrow_in_speed
