"""Cycles that are followed over a parameter, through folds and onsets of stick: belts, sliders,
toys, driven oscillators."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from math import cos, pi, sqrt
from typing import Any

import numpy as np

from stickslip import Contact, Inertial, System, catalogue

from ..case import Families, Rng, given, log_uniform, pick
from ..references.mechanics import Mechanics
from .classics import WAVE, WAVES
from .laws import STATES, slider_by_hand
from .repeating import LAWS, Repeating, jenkins
from .several import toy, toy_by_hand
from .single import by_hand, declared

Numbers = Mapping[str, float]


@dataclass(frozen=True)
class Branching(Repeating):
    """A cycle and the parameter over which it is followed.

    Attributes
    ----------
    parameter : str
    reach : (float, float)
        Its range.
    by_hand : function of numbers
        The mechanics for other values of the parameters.
    """

    parameter: str = ""
    reach: tuple[float, float] = (0.0, 1.0)
    by_hand: Callable[[Numbers], Mechanics] | None = field(default=None)

    def at(self, value: float) -> Mechanics:
        """The mechanics for a value of the parameter."""
        assert self.by_hand is not None
        return self.by_hand({**self.parameters, self.parameter: value})


FAMILIES: Families[Branching] = Families()
family = FAMILIES.add


def branching(
    system: System,
    numbers: dict[str, float],
    start: dict[str, float],
    over: tuple[str, tuple[float, float]],
    made: Callable[[Numbers], Mechanics],
    *,
    period: float = 0.0,
    together: tuple[str, ...] = (),
) -> Branching:
    """A case. Those with a period of the load are driven."""
    return Branching(
        system,
        numbers,
        start,
        period or 2 * pi,
        made(numbers),
        driven=period > 0.0,
        together=together,
        parameter=over[0],
        reach=over[1],
        by_hand=made,
    )


def around(rng: Rng, value: float, factor: float) -> tuple[float, float]:
    """A range around a value, which lies anywhere in it."""
    return value / log_uniform(rng, 1.2, factor), value * log_uniform(rng, 1.2, factor)


# -- belts -----------------------------------------------------------------------------------------


def on_a_belt(rng: Rng, text: str, over: str) -> Branching:
    """A mass that is about to be dragged off by a belt."""
    n = {"m": log_uniform(rng, 0.3, 3.0), "k": log_uniform(rng, 0.3, 3.0)}
    n |= {"mu": rng.uniform(0.8, 1.2), "F_k": rng.uniform(0.2, 0.75)}
    n |= {"v_s": log_uniform(rng, 0.05, 2.0), "c": log_uniform(rng, 0.005, 0.3)}
    n |= {"V": log_uniform(rng, 0.1, 1.0)}
    law = LAWS[text]

    def made(n: Numbers) -> Mechanics:
        return by_hand(
            "inertial",
            dict(n),
            lambda t: 0.0,
            kinetic=lambda u: law(u, n),
            belt=lambda t: n["V"] + 0 * t,
        )

    system = declared("inertial", kinetic=text, belt="V", extra="F_k=0.2 V=0.3 v_s=0.5")
    start = {"x": 0.9 * n["mu"] / n["k"], "d_x": n["V"]}
    reach = {"V": (0.5 * n["V"], 6.0), "c": (0.5 * n["c"], 2.0)}[over]
    return branching(system, n, start, (over, reach), made)


@family
def belt_that_falls(rng: Rng) -> Branching:
    """Faster and faster: the branch turns back at a corner, where the mass sticks no more."""
    return on_a_belt(rng, pick(rng, list(LAWS)[:2]), "V")


@family
def belt_with_more_damping(rng: Rng) -> Branching:
    """The same corner over the damping."""
    return on_a_belt(rng, pick(rng, list(LAWS)), "c")


@cache
def rising_belt() -> System:
    return System(
        name="belt with rising friction",
        parameters=given(V=0.5, a=0.3, b=0.2, c=0.1),
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="x**2/2",
        viscous="c/2*d_x**2",
        contacts={
            "belt": Contact("d_x", "1", surface_speed="V", kinetic="1 - a*speed + b*speed**3")
        },
    )


@family
def belt_that_rises(rng: Rng) -> Branching:
    """Friction that falls and rises again: born stable, then it begins to stick."""
    n = {"a": rng.uniform(0.25, 0.5), "b": rng.uniform(0.1, 0.4), "c": rng.uniform(0.02, 0.15)}
    born = sqrt((n["a"] - n["c"]) / (3 * n["b"]))
    n |= {"V": born * rng.uniform(0.4, 0.97)}

    def made(n: Numbers) -> Mechanics:
        return by_hand(
            "inertial",
            {"m": 1.0, "k": 1.0, "c": n["c"], "mu": 1.0},
            lambda t: 0.0,
            kinetic=lambda u: 1 - n["a"] * u + n["b"] * u**3,
            belt=lambda t: n["V"] + 0 * t,
        )

    reach = 0.2 * born, 1.3 * born
    return branching(rising_belt(), n, {"x": 0.9, "d_x": n["V"]}, ("V", reach), made)


# -- sliders ---------------------------------------------------------------------------------------

SHARP: dict[str, Callable[[Any], Any]] = {
    "0.4 + 1.2*exp(-(alpha - 1))": lambda a: 0.4 + 1.2 * np.exp(-(a - 1)),
    "1.5 - tanh(alpha - 1.5)": lambda a: 1.5 - np.tanh(a - 1.5),
}


@family
def slider_that_heats(rng: Rng) -> Branching:
    """[M] (3.1)-(3.3): the onset of stick lies just beside a fold."""
    text = pick(rng, [*STATES, *SHARP])
    law = (STATES | SHARP)[text]
    n = {"V": log_uniform(rng, 0.05, 0.25), "k": rng.uniform(0.8, 1.2), "alpha_0": 1.0}
    n |= {"nu": log_uniform(rng, 0.02, 0.08)}
    over = pick(rng, ("V", "nu", "k"))
    reach = {"V": (0.03, 1.2), "nu": (0.01, 0.4), "k": (0.3, 4.0)}[over]
    start = {"U": rng.uniform(1.2, 1.7), "alpha": rng.uniform(1.0, 1.1)}
    return branching(
        catalogue.spring_slider(mu=text),
        n,
        start,
        (over, reach),
        lambda n: slider_by_hand(dict(n), law),
    )


# -- toys ------------------------------------------------------------------------------------------


@family
def toy_that_walks(rng: Rng) -> Branching:
    """[M] (4.2): where its legs cease to stop the branch turns back at a corner."""
    n = {"I_b": 1.0, "delta": log_uniform(rng, 0.01, 0.1), "a": 1.0, "b": 1.0}
    n |= {"c": rng.uniform(0.2, 0.4), "rho": rng.uniform(0.1, 0.3), "psi_star": 1.0}
    n |= {"H_star": rng.uniform(2.8, 3.4), "P": rng.uniform(0.9, 1.3)}
    psi = rng.uniform(1.2, 2.2)
    start = {
        "psi": psi,
        "x_R": n["c"] * psi - n["P"] + n["rho"] * rng.uniform(-0.9, 0.9),
        "x_L": 0.0,
    }
    over = pick(rng, ("P", "c", "delta"))
    reach = {"P": (0.4, 1.6), "c": (0.12, 0.6), "delta": (0.5 * n["delta"], 0.3)}[over]
    return branching(
        toy(), n, start, (over, reach), lambda n: toy_by_hand(dict(n)), together=("x_R", "x_L")
    )


# -- driven ----------------------------------------------------------------------------------------


def driven(rng: Rng, n: dict[str, float], hard: float, over: str) -> Branching:
    """An oscillator under a wave on a dry ground."""

    def made(n: Numbers) -> Mechanics:
        f, F, omega, phi, b = (n[name] for name in ("f", "F", "omega", "phi", "b"))
        return by_hand(
            "inertial",
            dict(n),
            lambda t: f + F * cos(omega * t + phi),
            push=lambda x: -b * x**3,
            kinetic=lambda u: n["F_k"],
        )

    n |= {"m": 1.0, "k": 1.0, "b": hard, "phi": 0.0}
    system = declared(
        "inertial", WAVE, potential="b*x**4/4", kinetic="F_k", extra=f"{WAVES} F_k=0.2 b=0"
    )
    reach = {"omega": (0.35, 2.2), "F": (0.4, 2.5 * n["F"]), "F_k": (0.02, n["mu"])}[over]
    start = {"x": rng.uniform(-1.0, 1.0), "d_x": rng.uniform(-1.0, 1.0)}
    period = 2 * pi / n["omega"]
    return branching(system, n, start, (over, reach), made, period=period)


@family
def driven_over_dry_ground(rng: Rng) -> Branching:
    """Non-stop motion, and where it begins to stop."""
    n = {"c": log_uniform(rng, 0.02, 0.2), "mu": rng.uniform(0.4, 0.9), "f": rng.uniform(-0.2, 0.2)}
    n |= {"F_k": n["mu"] * rng.uniform(0.5, 1.0), "F": rng.uniform(1.0, 1.6)}
    n |= {"omega": rng.uniform(0.6, 1.6)}
    return driven(rng, n, 0.0, pick(rng, ("omega", "F", "F_k")))


@family
def driven_on_a_hardening_spring(rng: Rng) -> Branching:
    """The response bends over: smooth folds, onsets of stick beside them."""
    n = {"c": log_uniform(rng, 0.05, 0.2), "mu": rng.uniform(0.1, 0.4), "f": rng.uniform(-0.1, 0.1)}
    n |= {"F_k": n["mu"] * rng.uniform(0.5, 1.0), "F": rng.uniform(0.7, 2.0)}
    n |= {"omega": rng.uniform(0.6, 1.2)}
    return driven(rng, n, 1.0, pick(rng, ("omega", "F", "F_k")))


@family
def driven_below_resonance(rng: Rng) -> Branching:
    """Coulomb friction under a slow load: the mass stops more than twice in a period, slips back
    before it sticks, and comes to rest where friction equals the load. Without damping a
    multiplier is 1 on the way."""
    n = {"m": 1.0, "k": 1.0, "phi": 0.0, "F": 1.0, "mu": rng.uniform(0.1, 0.5)}
    n |= {"c": pick(rng, (0.0, 0.02, 0.1)), "f": pick(rng, (0.0, 0.05, 0.2))}
    n |= {"omega": rng.uniform(0.15, 0.6)}

    def made(n: Numbers) -> Mechanics:
        return by_hand("inertial", dict(n), lambda t: n["f"] + n["F"] * cos(n["omega"] * t))

    over = pick(rng, ("omega", "mu"))
    reach = {"omega": (0.12, 0.9), "mu": (0.05, 1.2)}[over]
    start = {"x": rng.uniform(-1.0, 1.0), "d_x": rng.uniform(-1.0, 1.0)}
    system = declared("inertial", WAVE, extra=WAVES)
    return branching(system, n, start, (over, reach), made, period=2 * pi / n["omega"])


@family
def damper_on_a_hardening_spring(rng: Rng) -> Branching:
    """A damper of a spring and a dry contact in series: folds, and onsets of slip."""
    n = {"k": 1.0, "c": log_uniform(rng, 0.05, 0.2), "j": rng.uniform(0.1, 0.8), "mu": 1.0}
    n |= {"F": log_uniform(rng, 1.0, 3.0), "omega": rng.uniform(0.8, 2.0), "b": 1.0}

    def made(n: Numbers) -> Mechanics:
        k, c, j, mu, F, omega, b = (n[x] for x in ("k", "c", "j", "mu", "F", "omega", "b"))

        def force(t: Any, x: Any, v: Any, a: Any, side: Any) -> list[Any]:
            pull = j * (x[0] - x[1])
            load = F * cos(np.real(omega * t))
            return [load - k * x[0] - b * x[0] ** 3 - c * v[0] - pull, pull]

        return Mechanics(
            kinds=(1, 0, 1, 0),
            inertia=[[1.0]],
            J=[[0.0, 1.0]],
            force=force,
            threshold=lambda t, x, v, a, side: [mu],
        )

    over = pick(rng, ("omega", "F"))
    reach = {"omega": (0.5, 2.6), "F": (0.3, 4.0)}[over]
    start = {"x": rng.uniform(-1.0, 1.0), "z": 0.0}
    return branching(jenkins(), n, start, (over, reach), made, period=2 * pi / n["omega"])
