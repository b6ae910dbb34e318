"""Friction with a memory: internal variables that heat, age, or are jolted, and rate-and-state
laws."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from stickslip import Contact, Internal, System, catalogue

from ..case import Case, Rng, family, given, log_uniform, pick
from ..references.mechanics import TIME, Mechanics, Zone
from .shapes import BUMPS, Shape
from .single import KINDS

STATES = {
    "0.5 + exp(-(alpha - 1)/0.4)": lambda a: 0.5 + np.exp(-(a - 1) / 0.4),
    "2/sqrt(alpha)": lambda a: 2 / np.sqrt(a),
    "0.4 + 1.2/(1 + (alpha - 1)**2)": lambda a: 0.4 + 1.2 / (1 + (a - 1) ** 2),
    "1 - 0.5*tanh(3*(alpha - 2))": lambda a: 1 - 0.5 * np.tanh(3 * (a - 2)),
}


@cache
def slider(law: str) -> System:
    return catalogue.spring_slider(mu=law)


def slider_by_hand(n: dict[str, float], law: Callable[[Any], Any]) -> Mechanics:
    """The same by hand, with the friction as a function of the state of the surface."""
    V = n["V"]
    k = n["k"]
    nu = n["nu"]
    return Mechanics(
        kinds=(0, 1, 0, 1),
        inertia=[[nu]],
        J=[[1.0]],
        force=lambda t, x, v, a, side: [nu * V - k * x[0]],
        threshold=lambda t, x, v, a, side: [law(a[0])],
        belt=lambda t: [V + 0 * t],
        law=lambda t, x, rates, a, side: [1 - a[0] + k * x[0] * (V - rates[0])],
    )


@family
def spring_slider(rng: Rng) -> Case:
    """[M] (3.1)-(3.3): a viscous block whose friction falls with the heat of sliding."""
    text = pick(rng, list(STATES))
    law = STATES[text]
    n = {
        "V": log_uniform(rng, 0.02, 0.5),
        "k": rng.uniform(0.7, 1.5),
        "alpha_0": 1.0,
        "nu": rng.uniform(0.02, 0.2),
    }
    mechanics = slider_by_hand(n, law)
    start = {"U": rng.uniform(0.2, 0.9), "alpha": rng.uniform(1.0, 2.0)}
    return Case(slider(text), n, start, rng.uniform(5, 12), mechanics)


@cache
def heated(heat: str, kind: str) -> System:
    return System(
        name="flash heating",
        parameters=given(k=1.0, mu=1.0, d=0.5, V=0.3, tau=1.0, q=1.0, c=0.1),
        coordinates={"x": KINDS[kind]()},
        internal={"theta": Internal(f"-theta/tau + q*({heat})")},
        kinetic="d_x**2/2" if kind == "inertial" else 0.0,
        potential="k*x**2/2",
        viscous="c*d_x**2/2",
        contacts={"belt": Contact("d_x", "mu*(1 - d + d/(1 + theta))", "V")},
    )


HEATS = {
    "(d_x - V)**2": (lambda u, bound, side: u * u, None),
    "abs(d_x - V)*mu*(1 - d + d/(1 + theta))": (lambda u, bound, side: side[0] * u * bound, "u"),
}


@family
def flash_heating(rng: Rng) -> Case:
    """A block on a belt that heats its contact and cools in stick."""
    heat = pick(rng, list(HEATS))
    law, kinked = HEATS[heat]
    n = {
        "k": rng.uniform(0.5, 2),
        "mu": 1.0,
        "d": rng.uniform(0.2, 0.8),
        "V": rng.uniform(0.1, 0.8),
    }
    n |= {"tau": rng.uniform(0.3, 3), "q": rng.uniform(0.3, 3), "c": rng.uniform(0.0, 0.2)}
    k, d, V, tau, q, c = (n[name] for name in ("k", "d", "V", "tau", "q", "c"))

    def bound(theta: float) -> float:
        return 1 - d + d / (1 + theta)

    mechanics = Mechanics(
        kinds=(1, 0, 0, 1),
        inertia=[[1.0]],
        J=[[1.0]],
        force=lambda t, x, v, a, side: [-k * x[0] - c * v[0]],
        threshold=lambda t, x, v, a, side: [bound(a[0])],
        belt=lambda t: [V + 0 * t],
        law=lambda t, x, rates, a, side: [-a[0] / tau + q * law(rates[0] - V, bound(a[0]), side)],
        kinks=(lambda t, x, v, a: [v[0] - V]) if kinked else None,
    )
    return Case(
        heated(heat, "inertial"), n, {"x": rng.normal(), "d_x": 0.0}, rng.uniform(8, 20), mechanics
    )


@cache
def logarithmic() -> System:
    return System(
        name="rate and state in logarithms",
        parameters=given(a=0.01, b=0.015, k=0.004, V_p=1.0, D=1.0),
        internal={
            "phi": Internal("(k*(V_p - exp(phi)) - b*(exp(-psi) - exp(phi))/D)/a"),
            "psi": Internal("(exp(-psi) - exp(phi))/D"),
        },
    )


@family
def rate_and_state(rng: Rng) -> Case:
    """The quasistatic slider with the ageing law in ln(V/V₀) and ln(θV₀/D), around the critical
    stiffness."""
    n = {"a": rng.uniform(0.008, 0.012), "V_p": rng.uniform(0.7, 1.5), "D": 1.0}
    n |= {"b": n["a"] * rng.uniform(1.2, 1.6)}
    n |= {"k": (n["b"] - n["a"]) * rng.uniform(0.95, 1.2)}
    a_, b, k, V, D = (n[name] for name in ("a", "b", "k", "V_p", "D"))

    def law(t: float, x: object, rates: object, a: np.ndarray, side: object) -> list[float]:
        ageing = (np.exp(-a[1]) - np.exp(a[0])) / D
        return [(k * (V - np.exp(a[0])) - b * ageing) / a_, ageing]

    mechanics = Mechanics(
        kinds=(0, 0, 0, 2),
        J=[],
        force=lambda t, x, v, a, side: [],
        threshold=lambda t, x, v, a, side: [],
        law=law,
        step=0.5,
    )
    size = log_uniform(rng, 0.02, 1.0)
    start = {"phi": np.log(V) + size * rng.normal(), "psi": -np.log(V) + size * rng.normal()}
    return Case(logarithmic(), n, start, rng.uniform(10, 60), mechanics)


# -- internal variables with narrow features -------------------------------------------------------


@cache
def jolted(kind: str, pulse: str) -> System:
    return System(
        name="heat in pulses",
        parameters=given(m=1.0, c=0.5, k=1.0, f=0.4, mu=0.5, q=1.0, tau=1.0, p=1.0, w=0.1),
        coordinates={"x": KINDS[kind]()},
        internal={"theta": Internal(f"-theta/tau + q*{pulse}")},
        kinetic="m*d_x**2/2" if kind == "inertial" else 0.0,
        potential="k*x**2/2 - f*x",
        viscous="c*d_x**2/2",
        contacts={"ground": Contact("d_x", "mu/(1 + theta**2)")},
    )


@family
def pulse_of_heat(rng: Rng) -> Case:
    """A held block is let go when a short pulse heats its contact."""
    kind = pick(rng, ("inertial", "viscous"))
    shape = pick(rng, BUMPS)
    assert isinstance(shape, Shape)
    span = rng.uniform(15.0, 50.0)
    w = span * log_uniform(rng, 1e-4, 2e-2)
    p = span * rng.uniform(0.1, 0.9)
    n = {
        "m": rng.uniform(0.5, 2),
        "c": rng.uniform(0.1, 1),
        "k": rng.uniform(0.5, 2),
        "mu": rng.uniform(0.3, 0.8),
    }
    n |= {
        "f": n["mu"] * rng.uniform(0.3, 0.95),
        "q": rng.uniform(0.5, 2.0) / w,
        "tau": rng.uniform(0.5, 5),
    }
    n |= {"p": p, "w": w}
    k, f, mu, q, tau = (n[name] for name in ("k", "f", "mu", "q", "tau"))
    drag = n["c"] if kind == "inertial" else 0.0
    mechanics = Mechanics(
        kinds=(1, 0, 0, 1) if kind == "inertial" else (0, 1, 0, 1),
        inertia=[[n["m"] if kind == "inertial" else n["c"]]],
        J=[[1.0]],
        force=lambda t, x, v, a, side: [f - k * x[0] - (drag * v[0] if drag else 0.0)],
        threshold=lambda t, x, v, a, side: [mu / (1 + a[0] ** 2)],
        law=lambda t, x, rates, a, side: [-a[0] / tau + q * shape.at((t - p) / w)],
        zones=(Zone(TIME, p, w),),
    )
    return Case(jolted(kind, shape.text("t")), n, {}, span, mechanics)


@cache
def ripening(kind: str, dip: str) -> System:
    return System(
        name="a weak age",
        parameters=given(m=1.0, c=0.5, k=1.0, f=0.4, mu=0.5, d=0.5, tau=10.0, p=0.5, w=0.1),
        coordinates={"x": KINDS[kind]()},
        internal={"theta": Internal("(1 - theta)/tau")},
        kinetic="m*d_x**2/2" if kind == "inertial" else 0.0,
        potential="k*x**2/2 - f*x",
        viscous="c*d_x**2/2" if kind != "rate-independent" else 0.0,
        contacts={"ground": Contact("d_x", f"mu*(1 - d*{dip})")},
    )


@family
def narrow_in_a_state(rng: Rng) -> Case:
    """An age that grows slowly through a narrow band in which the contact is weak."""
    kind = pick(rng, list(KINDS))
    shape = pick(rng, BUMPS)
    assert isinstance(shape, Shape)
    n = {
        "m": rng.uniform(0.5, 2),
        "c": rng.uniform(0.3, 1),
        "k": rng.uniform(0.5, 2),
        "mu": rng.uniform(0.3, 0.8),
    }
    n |= {
        "d": rng.uniform(0.5, 1),
        "tau": rng.uniform(5, 15),
        "p": rng.uniform(0.2, 0.8),
        "w": log_uniform(rng, 1e-4, 0.1),
    }
    n |= {"f": n["mu"] * (1 - n["d"] * rng.uniform(0.1, 0.9))}
    k, f, mu, d, tau, p, w = (n[name] for name in ("k", "f", "mu", "d", "tau", "p", "w"))
    nq = 1 if kind == "inertial" else 0
    drag = n["c"] if nq else 0.0
    kinds = {"inertial": (1, 0, 0, 1), "viscous": (0, 1, 0, 1), "rate-independent": (0, 0, 1, 1)}[
        kind
    ]
    mechanics = Mechanics(
        kinds=kinds,
        inertia={"inertial": [[n["m"]]], "viscous": [[n["c"]]], "rate-independent": []}[kind],
        J=[[1.0]],
        force=lambda t, x, v, a, side: [f - k * x[0] - (drag * v[0] if drag else 0.0)],
        threshold=lambda t, x, v, a, side: [mu * (1 - d * shape.at((a[0] - p) / w))],
        law=lambda t, x, rates, a, side: [(1 - a[0]) / tau],
        zones=(Zone(1 + nq, p, w),),
    )
    return Case(ripening(kind, shape.text("theta")), n, {}, rng.uniform(1.0, 2.0) * tau, mechanics)
