"""Motions that repeat themselves in the end: belts, loads with a period, sliders, legs, each with a
start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import cos, pi, sqrt
from typing import Any

import numpy as np

from stickslip import Contact, Inertial, RateIndependent, System

from ..case import Case, Families, Rng, given, log_uniform, pick
from ..references.mechanics import Array, Mechanics
from .classics import WAVE, WAVES, forced
from .features import TRAINS
from .laws import slider, slider_by_hand
from .numbers import scaled, ten
from .several import crawler, toy, toy_by_hand
from .single import by_hand, declared


@dataclass(frozen=True)
class Repeating(Case):
    """A motion that may settle on a cycle; its duration is the period of the load, or about that of
    its slowest swing.

    Attributes
    ----------
    driven : bool
        Whether the load has a period.
    together : sequence of str
        Coordinates that can be shifted together.
    """

    driven: bool = True
    together: Sequence[str] = ()

    def at_home(self, states: Array) -> Array:
        """States, shape (…, n), without what is shifted."""
        own = np.array([name in self.together for name in self.names], dtype=float)
        return states - np.multiply.outer(states @ own, own) / max(np.sum(own), 1.0)


FAMILIES: Families[Repeating] = Families()
family = FAMILIES.add


def repeating(
    case: Case, period: float, driven: bool, start: dict[str, float] | None = None
) -> Repeating:
    """A case as one that repeats itself."""
    own = {
        name: getattr(case, name)
        for name in ("system", "parameters", "initial", "mechanics", "units", "atol")
    }
    return Repeating(
        **(own | {"initial": start or own["initial"], "duration": period, "driven": driven})
    )


# -- belts -----------------------------------------------------------------------------------------

LAWS = {
    "F_k + (mu - F_k)*exp(-speed/v_s)": lambda u, n: (
        n["F_k"] + (n["mu"] - n["F_k"]) * np.exp(-u / n["v_s"])
    ),
    "F_k + (mu - F_k)/(1 + (speed/v_s)**2)": lambda u, n: (
        n["F_k"] + (n["mu"] - n["F_k"]) / (1 + (u / n["v_s"]) ** 2)
    ),
    "F_k": lambda u, n: n["F_k"],
}


def on_a_belt(rng: Rng, text: str, c: tuple[float, float]) -> Repeating:
    """A mass on a spring and a damper on a belt."""
    n = {
        "m": log_uniform(rng, 0.3, 3.0),
        "k": log_uniform(rng, 0.3, 3.0),
        "c": log_uniform(rng, *c),
    }
    n |= {
        "V": log_uniform(rng, 0.05, 2.5),
        "mu": rng.uniform(0.8, 1.2),
        "F_k": rng.uniform(0.2, 0.75),
    }
    n |= {"v_s": log_uniform(rng, 0.05, 2.0)}
    law = LAWS[text]
    V = n["V"]
    mechanics = by_hand(
        "inertial", n, lambda t: 0.0, kinetic=lambda u: law(u, n), belt=lambda t: V + 0 * t
    )
    start = {"x": rng.uniform(-2.0, 2.0) / n["k"], "d_x": rng.uniform(-1.0, 1.0) * V}
    if rng.random() < 0.5:
        start = {"x": 0.9 * n["mu"] / n["k"], "d_x": V}
    system = declared("inertial", kinetic=text, belt="V", extra="F_k=0.2 V=0.3 v_s=0.5")
    return Repeating(
        system,
        n,
        start,
        2 * pi * sqrt(n["m"] / n["k"]) + 2.0 / (n["k"] * V),
        mechanics,
        driven=False,
    )


@family
def falling_with_speed(rng: Rng) -> Repeating:
    """Friction that falls with the speed: stick-slip, unstable cycles beside it, and steady
    sliding."""
    return on_a_belt(rng, "F_k + (mu - F_k)*exp(-speed/v_s)", (0.003, 0.3))


@family
def static_above_kinetic(rng: Rng) -> Repeating:
    """Two constants: beyond some speed nothing comes back to the belt."""
    return on_a_belt(rng, "F_k", (0.003, 0.2))


@family
def smooth_bend(rng: Rng) -> Repeating:
    """Friction that falls by a rational law."""
    return on_a_belt(rng, "F_k + (mu - F_k)/(1 + (speed/v_s)**2)", (0.003, 0.3))


@family
def other_units(rng: Rng) -> Repeating:
    """Masses, lengths and times by powers of ten up to 1e±4."""
    case = on_a_belt(rng, "F_k", (0.003, 0.2))
    other = scaled(case, ten(rng, 4), ten(rng, 4), ten(rng, 4))
    return replace(other, system=replace(case.system, span=(0.0, 100.0 * other.units["time"])))


@cache
def belt_and_tail() -> System:
    return System(
        name="belt and tail",
        parameters=given(V=0.3, mu=1.0, F_k=0.5, c=0.01, m=0.1, k=0.1, e=0.001),
        coordinates={"x": Inertial(), "y": Inertial()},
        kinetic="d_x**2/2 + m*d_y**2/2",
        potential="x**2/2 + k*(y - x)**2/2",
        viscous="c/2*d_x**2 + e/2*(d_y - d_x)**2",
        contacts={"belt": Contact("d_x", "mu", surface_speed="V", kinetic="F_k")},
        span=(0, 200),
    )


@family
def complex_multipliers(rng: Rng) -> Repeating:
    """A light tail swings on for many periods, and comes near to where it was after a few of
    them."""
    n = {
        "V": log_uniform(rng, 0.1, 0.8),
        "mu": 1.0,
        "F_k": rng.uniform(0.3, 0.7),
        "c": rng.uniform(0.0, 0.05),
    }
    n |= {
        "m": rng.uniform(0.02, 0.15),
        "k": log_uniform(rng, 0.02, 0.6),
        "e": log_uniform(rng, 0.0005, 0.01),
    }
    V, F_k, c, m, k, e = (n[name] for name in ("V", "F_k", "c", "m", "k", "e"))

    def force(t: Any, x: Any, v: Any, a: Any, side: Any) -> list[Any]:
        pull = k * (x[1] - x[0]) + e * (v[1] - v[0])
        return [-x[0] - c * v[0] + pull, -pull]

    mechanics = Mechanics(
        kinds=(2, 0, 0, 0),
        inertia=[[1.0, 0.0], [0.0, m]],
        J=[[1.0, 0.0]],
        force=force,
        threshold=lambda t, x, v, a, side: [1.0],
        kinetic=lambda t, x, v, a, side, speed: [F_k],
        belt=lambda t: [V + 0 * t],
    )
    start = {"x": rng.uniform(-1.0, 1.0), "d_x": V, "y": rng.uniform(-1.0, 1.0)}
    return Repeating(belt_and_tail(), n, start, 2 * pi + 2.0 / V, mechanics, driven=False)


@cache
def two_blocks() -> System:
    return System(
        name="two blocks",
        parameters=given(j=1.0, k=1.0, c=0.1, V=0.3, mu=1.0, nu=1.0, r=0.5),
        coordinates={"x": Inertial(), "y": Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential="x**2/2 + k*y**2/2 + j*(y - x)**2/2",
        viscous="c/2*(d_x**2 + d_y**2)",
        contacts={
            "first": Contact("d_x", "mu", surface_speed="V", kinetic="r*mu"),
            "second": Contact("d_y", "nu", surface_speed="V", kinetic="r*nu"),
        },
    )


@family
def two_blocks_on_a_belt(rng: Rng) -> Repeating:
    """Alternating and joint slips; some are irregular."""
    n = {
        "j": log_uniform(rng, 0.05, 2.0),
        "k": rng.uniform(0.6, 1.6),
        "c": log_uniform(rng, 0.01, 0.3),
    }
    n |= {
        "V": log_uniform(rng, 0.03, 0.5),
        "mu": 1.0,
        "nu": rng.uniform(0.6, 1.6),
        "r": rng.uniform(0.3, 0.8),
    }
    j, k, c, V, nu, r = (n[name] for name in ("j", "k", "c", "V", "nu", "r"))

    def force(t: Any, x: Any, v: Any, a: Any, side: Any) -> list[Any]:
        pull = j * (x[1] - x[0])
        return [-x[0] + pull - c * v[0], -k * x[1] - pull - c * v[1]]

    mechanics = Mechanics(
        kinds=(2, 0, 0, 0),
        inertia=np.eye(2),
        J=np.eye(2),
        force=force,
        threshold=lambda t, x, v, a, side: [1.0, nu],
        kinetic=lambda t, x, v, a, side, speed: [r, r * nu],
        belt=lambda t: [V + 0 * t] * 2,
    )
    start = {"x": rng.uniform(-0.5, 0.5), "y": rng.uniform(-0.5, 0.5), "d_x": V, "d_y": V}
    return Repeating(two_blocks(), n, start, 2 * pi + 2.0 / V, mechanics, driven=False)


@family
def slider_with_a_state(rng: Rng) -> Repeating:
    """[M] (3.1)-(3.3): stick-slip, unstable cycles next to its fold, steady sliding."""
    n = {
        "V": log_uniform(rng, 0.03, 0.4),
        "k": 1.0,
        "alpha_0": 1.0,
        "nu": log_uniform(rng, 0.02, 0.1),
    }
    start = {"U": rng.uniform(0.2, 1.2), "alpha": rng.uniform(1.0, 2.0)}
    mechanics = slider_by_hand(n, lambda a: 2 / np.sqrt(a))
    return Repeating(slider("2/sqrt(alpha)"), n, start, 1.0 / n["V"], mechanics, driven=False)


@family
def toy_that_may_walk(rng: Rng) -> Repeating:
    """[M] (4.2): the toy walks, or its rocking dies out."""
    n = {
        "I_b": 1.0,
        "delta": log_uniform(rng, 0.01, 0.15),
        "a": 1.0,
        "b": 1.0,
        "c": rng.uniform(0.2, 0.4),
    }
    n |= {
        "rho": rng.uniform(0.1, 0.3),
        "psi_star": 1.0,
        "H_star": rng.uniform(2.8, 3.4),
        "P": rng.uniform(0.9, 1.3),
    }
    psi = rng.uniform(1.0, 2.0)
    start = {
        "psi": psi,
        "x_R": n["c"] * psi - n["P"] + n["rho"] * rng.uniform(-0.9, 0.9),
        "x_L": 0.0,
    }
    return Repeating(toy(), n, start, 2 * pi, toy_by_hand(n), driven=False, together=("x_R", "x_L"))


# -- loads with a period ---------------------------------------------------------------------------


@cache
def jenkins() -> System:
    """A driven oscillator with a damper of a spring and a dry contact in series."""
    return System(
        name="Jenkins element",
        parameters=given(k=1.0, c=0.02, j=0.5, mu=1.0, F=0.3, omega=1.0, b=0.0),
        coordinates={"x": Inertial(), "z": RateIndependent()},
        kinetic="d_x**2/2",
        potential="k*x**2/2 + b*x**4/4 + j*(x - z)**2/2 - F*cos(omega*t)*x",
        viscous="c/2*d_x**2",
        contacts={"damper": Contact("d_z", "mu")},
    )


def with_a_damper(rng: Rng, F: tuple[float, float], c: tuple[float, float], b: float) -> Repeating:
    n = {
        "k": 1.0,
        "c": log_uniform(rng, *c),
        "j": rng.uniform(0.1, 1.0),
        "mu": 1.0,
        "F": log_uniform(rng, *F),
    }
    n |= {"omega": rng.uniform(0.3, 2.0), "b": b}
    drag = n["c"]
    j = n["j"]
    load = n["F"]
    omega = n["omega"]

    def force(t: Any, x: Any, v: Any, a: Any, side: Any) -> list[Any]:
        pull = j * (x[0] - x[1])
        return [load * cos(np.real(omega * t)) - x[0] - b * x[0] ** 3 - drag * v[0] - pull, pull]

    mechanics = Mechanics(
        kinds=(1, 0, 1, 0),
        inertia=[[1.0]],
        J=[[0.0, 1.0]],
        force=force,
        threshold=lambda t, x, v, a, side: [1.0],
    )
    x = rng.uniform(-1.0, 1.0)
    reach = 0.9 / j
    start = {"x": x, "z": x + rng.uniform(-reach, reach) * (rng.random() < 0.5)}
    return Repeating(jenkins(), n, start, 2 * pi / omega, mechanics)


@family
def damper_that_may_slip(rng: Rng) -> Repeating:
    """Light damping plants returns after several periods; the damper slips, or only while the
    motion settles."""
    return with_a_damper(rng, (0.05, 3.0), (0.01, 0.1), 0.0)


@family
def damper_that_sticks(rng: Rng) -> Repeating:
    """The linear part of a frequency response, for any position of rest."""
    return with_a_damper(rng, (0.01, 0.2), (0.01, 0.1), 0.0)


@family
def damper_on_a_hard_spring(rng: Rng) -> Repeating:
    """Two responses to one load, and subharmonic ones."""
    return with_a_damper(rng, (0.2, 5.0), (0.02, 0.2), 1.0)


def on_the_ground(
    rng: Rng, b: float, ratio: tuple[float, float], F: tuple[float, float]
) -> Repeating:
    """A driven oscillator on a dry ground."""
    n = {
        "m": 1.0,
        "k": 1.0,
        "c": log_uniform(rng, 0.005, 0.1),
        "b": b,
        "mu": log_uniform(rng, 0.05, 0.9),
    }
    n["F_k"] = n["mu"] * rng.uniform(*ratio)
    n |= {
        "F": rng.uniform(*F),
        "omega": rng.uniform(0.25, 2.2),
        "f": rng.uniform(-0.3, 0.3),
        "phi": 0.0,
    }
    f = n["f"]
    load = n["F"]
    omega = n["omega"]
    mechanics = by_hand(
        "inertial",
        n,
        lambda t: f + load * cos(omega * t),
        push=lambda x: -b * x**3,
        kinetic=lambda u: n["F_k"],
    )
    start = {"x": rng.uniform(-2.0, 2.0), "d_x": rng.uniform(-1.0, 1.0)}
    system = declared(
        "inertial", WAVE, potential="b*x**4/4", kinetic="F_k", extra=f"{WAVES} F_k=0.2 b=0"
    )
    return Repeating(system, n, start, 2 * pi / omega, mechanics)


@family
def driven_on_dry_ground(rng: Rng) -> Repeating:
    """Non-stop and with stops, an asymmetric load, and rest."""
    return on_the_ground(rng, 0.0, (1.0, 1.0), (0.3, 1.5))


@family
def driven_with_static_above_kinetic(rng: Rng) -> Repeating:
    """Stops that are left with a jump of the force."""
    return on_the_ground(rng, 0.0, (0.4, 1.0), (0.3, 1.5))


@family
def driven_on_a_hard_spring(rng: Rng) -> Repeating:
    """Coexisting and subharmonic motions."""
    return on_the_ground(rng, 1.0, (0.5, 1.0), (0.5, 8.0))


@family
def driven_dashpot(rng: Rng) -> Repeating:
    """Spring and viscosity: everything is forgotten within a few periods, or at once."""
    case = forced(rng, pick(rng, ("viscous", "rate-independent")))
    return repeating(case, 2 * pi / case.parameters["omega"], True)


@family
def driven_by_short_pulses(rng: Rng) -> Repeating:
    """Pulses that come with a period, and do nothing in between."""
    text = pick(rng, list(TRAINS)[:3])
    shape = TRAINS[text]
    T = rng.uniform(4.0, 12.0)
    w = log_uniform(rng, 0.01, 0.3)
    n = {
        "m": 1.0,
        "k": rng.uniform(0.5, 2.0),
        "mu": rng.uniform(0.2, 0.8),
        "c": rng.uniform(0.05, 0.3),
    }
    n |= {
        "A": n["mu"] + rng.uniform(0.3, 2.0) * pi / (w * T),
        "p": T * rng.uniform(0.1, 0.9),
        "w": w,
        "T": T,
    }
    A, p = n["A"], n["p"]
    mechanics = by_hand("inertial", n, lambda t: A * shape(t, p, T, w), step=min(0.3, w * T / 3))
    system = declared("inertial", f"A*{text}", extra="A=1 p=1 w=0.1 T=5")
    return Repeating(system, n, {"x": rng.uniform(-0.5, 0.5)}, T, mechanics)


@family
def crawling_legs(rng: Rng) -> Repeating:
    """Two legs with bristles, joined by a length that swings: a gait, or rest."""
    n = {"k": rng.uniform(0.5, 2.0), "f": rng.uniform(0.05, 0.2), "g": rng.uniform(0.25, 0.5)}
    n |= {"D": rng.uniform(0.2, 3.0), "omega": rng.uniform(0.5, 2.0)}
    k, f, g, D, omega = (n[name] for name in ("k", "f", "g", "D", "omega"))

    def pull(t: Any, x: Any) -> Any:
        return k * (x[1] - x[0] - D / 2 * np.sin(omega * t))

    mechanics = Mechanics(
        kinds=(0, 0, 2, 0),
        J=np.eye(2),
        force=lambda t, x, v, a, side: [pull(t, x), -pull(t, x)],
        threshold=lambda t, x, v, a, side: ([f + 0 * t, f + 0 * t], [g + 0 * t, g + 0 * t]),
    )
    return Repeating(
        crawler("D/2*sin(omega*t)"), n, {}, 2 * pi / omega, mechanics, together=("x", "y")
    )
