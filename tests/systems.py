"""Small systems that the tests share. A declaration is compiled once; tests vary its parameters and
initial values."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from stickslip import (
    Contact,
    Inertial,
    Internal,
    Parameter,
    RateIndependent,
    System,
    Trajectory,
    Viscous,
    catalogue,
)

# Thresholds that vanish for a while, or touch 0 (s_0 = s_1), or jump at t = 1.
VARIABLE = "max(s_0 + s_1*cos(w*t) + piecewise(t < 1, 0, jump), 0)"
SMOOTH = "s_0 + s_1*cos(w*t)"


@cache
def published(name: str) -> System:
    """A system of the catalogue with its defaults, compiled once for all that ask here."""
    return catalogue.get(name)


def parameters(**defaults: float) -> dict[str, Parameter]:
    """Parameters without unit and meaning."""
    return {name: Parameter(value) for name, value in defaults.items()}


def ode(name: str, functions: dict[str, str] | None = None, **laws: str) -> System:
    """Internal variables only."""
    return System(
        name=name, functions=functions or {}, internal={x: Internal(law) for x, law in laws.items()}
    )


@cache
def oscillator(threshold: str = "mu") -> System:
    """m x'' + c x' + k x + s Sign(x' - V) ∋ f + F cos(omega t + phi)."""
    return _with_threshold(
        threshold,
        System(
            name="oscillator",
            parameters=parameters(
                m=1.0, c=0.0, k=1.0, mu=0.5, V=0.0, f=0.0, F=1.0, omega=1.0, phi=0.0
            ),
            coordinates={"x": Inertial("m", "position")},
            kinetic="m/2*d_x**2",
            potential="k/2*x**2 - (f + F*cos(omega*t + phi))*x",
            viscous="c/2*d_x**2",
            contacts={"ground": Contact("d_x", "mu", surface_speed="V", unit="N")},
            time_unit="s",
        ),
    )


@cache
def dashpot(threshold: str = "mu") -> System:
    """c x' + k x + s Sign(x') ∋ f + F cos(omega t + phi)."""
    return _with_threshold(
        threshold,
        System(
            name="dashpot",
            parameters=parameters(c=1.0, k=1.0, mu=0.5, f=0.0, F=1.0, omega=1.0, phi=0.0),
            coordinates={"x": Viscous()},
            potential="k/2*x**2 - (f + F*cos(omega*t + phi))*x",
            viscous="c/2*d_x**2",
            contacts={"ground": Contact("d_x", "mu")},
        ),
    )


@cache
def play(threshold: str = "mu") -> System:
    """k x + s Sign(x') ∋ f + F cos(omega t + phi)."""
    return _with_threshold(
        threshold,
        System(
            name="play",
            parameters=parameters(k=1.0, mu=0.5, f=0.0, F=1.0, omega=1.0, phi=0.0),
            coordinates={"x": RateIndependent()},
            potential="k/2*x**2 - (f + F*cos(omega*t + phi))*x",
            contacts={"ground": Contact("d_x", "mu")},
        ),
    )


KINDS = {"inertial": oscillator, "viscous": dashpot, "rate-independent": play}


def _with_threshold(threshold: str, system: System) -> System:
    if threshold == "mu":
        return system
    own = {name: p for name, p in system.parameters.items() if name != "mu"}
    own |= parameters(s_0=1.0, s_1=0.0, w=1.0, jump=0.0)
    contact = replace(system.contacts["ground"], threshold=threshold)
    return replace(system, parameters=own, contacts={"ground": contact})


@cache
def pair(kind: str) -> System:
    """Two equal coordinates joined by a spring, each with its load and its contact."""
    coordinate = Viscous() if kind == "viscous" else RateIndependent()
    return System(
        name=f"{kind} pair",
        parameters=parameters(k=1.0, k_c=0.7, mu=0.5, F_1=1.0, F_2=1.0, omega=1.0, phi=0.0),
        coordinates={"x_1": coordinate, "x_2": coordinate},
        potential="k/2*(x_1**2 + x_2**2) + k_c/2*(x_1 - x_2)**2 - (F_1*x_1 + F_2*x_2)*cos(omega*t "
        "+ phi)",
        viscous="(d_x_1**2 + d_x_2**2)/2" if kind == "viscous" else 0.0,
        contacts={"first": Contact("d_x_1", "mu"), "second": Contact("d_x_2", "mu")},
    )


def switches(trajectory: Trajectory) -> pd.DataFrame:
    """The events of contacts, without the kinks of formulas."""
    events = trajectory.events
    return events.loc[events["contact"].isin(trajectory.system.contacts)].reset_index(drop=True)


def on_grid(trajectory: Trajectory, count: int = 201) -> NDArray[np.float64]:
    """Even times over the computed span."""
    return np.linspace(trajectory.knots.time[0], trajectory.knots.time[-1], count)


def distance(a: ArrayLike, b: ArrayLike) -> float:
    """Largest difference."""
    return float(np.max(np.abs(np.subtract(np.asarray(a), np.asarray(b))), initial=0.0))
