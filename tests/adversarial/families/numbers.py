"""The same mechanics in other units, from 1e-12 to 1e12 and beyond, and motions that end by
name."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import acos, acosh, cos, sin

from stickslip import Contact, Inertial, RateIndependent, System

from ..case import C, Case, Rng, family, given, pick
from ..references.mechanics import Mechanics
from .classics import block_on_a_belt, forced, stribeck_belt
from .several import pair_with_two_contacts
from .single import KINDS

# Exponents of (mass, length, time) of every parameter that the scaled families use.
FORCE = (1, 1, -2)
STIFFNESS = (1, 0, -2)
DAMPING = (1, 0, -1)
SPEED = (0, 1, -1)
DIMENSIONS = {
    **dict.fromkeys(("m", "n"), (1, 0, 0)),
    **dict.fromkeys(("c", "e"), DAMPING),
    **dict.fromkeys(("k", "h", "j"), STIFFNESS),
    **dict.fromkeys(("mu", "nu", "f", "F", "G", "F_k", "G_k"), FORCE),
    **dict.fromkeys(("V", "v_s"), SPEED),
    "omega": (0, 0, -1),
    "phi": (0, 0, 0),
}


def scaled(case: C, mass: float, length: float, time: float) -> C:
    """The same motion in other units."""

    def unit(exponents: tuple[int, int, int]) -> float:
        return mass ** exponents[0] * length ** exponents[1] * time ** exponents[2]

    units = {"time": time, "force": unit(FORCE)}
    units |= {name: unit(SPEED) if name.startswith("d_") else length for name in case.names}
    n = {name: value * unit(DIMENSIONS[name]) for name, value in case.parameters.items()}
    start = {name: value * units[name] for name, value in case.initial.items()}
    least = min(1.0, *(units[name] for name in case.names))
    return replace(case, parameters=n, initial=start, units=units, atol=max(1e-12 * least, 1e-30))


def ten(rng: Rng, reach: int) -> float:
    return 10.0 ** int(rng.integers(-reach, reach + 1))


def plain(rng: Rng) -> Case:
    make = pick(rng, (None, block_on_a_belt, stribeck_belt, pair_with_two_contacts))
    return make(rng) if make else forced(rng, pick(rng, list(KINDS)))


@family
def scales_of_force(rng: Rng) -> Case:
    """All forces (and masses) by a power of ten up to 1e±12."""
    return scaled(plain(rng), ten(rng, 12), 1.0, 1.0)


@family
def scales_of_everything(rng: Rng) -> Case:
    """Masses, lengths and times by powers of ten up to 1e±12."""
    return scaled(plain(rng), ten(rng, 12), ten(rng, 12), ten(rng, 12))


@family
def scales_beyond_reason(rng: Rng) -> Case:
    """One unit by up to 1e±60: what is too small for the absolute tolerance need not be seen, but
    is not refused."""
    which = int(rng.integers(3))
    factor = ten(rng, 60)
    return scaled(plain(rng), *(factor if i == which else 1.0 for i in range(3)))


@cache
def tilted(direction: str) -> System:
    return System(
        name="contact in other units",
        parameters=given(m=1.0, c=0.1, k=1.0, mu=0.5, F=1.0, omega=1.0, phi=0.0),
        coordinates={"x": Inertial()},
        kinetic="m*d_x**2/2",
        potential="k*x**2/2 - F*cos(omega*t + phi)*x",
        viscous="c*d_x**2/2",
        contacts={"ground": Contact(direction, "mu")},
    )


@family
def scales_of_directions(rng: Rng) -> Case:
    """A contact whose direction is written as 1e-7*d_x and the like."""
    exponent = int(pick(rng, (-12, -7, 7, 12)))
    case = forced(rng, "inertial")
    n = {name: case.parameters[name] for name in ("m", "c", "k", "F", "omega", "phi")}
    n["mu"] = case.parameters["mu"] * 10.0**-exponent
    k, c, F, omega, phi = (n[name] for name in ("k", "c", "F", "omega", "phi"))
    mechanics = Mechanics(
        kinds=(1, 0, 0, 0),
        inertia=[[n["m"]]],
        J=[[1.0]],
        force=lambda t, x, v, a, side: [F * cos(omega * t + phi) - k * x[0] - c * v[0]],
        threshold=lambda t, x, v, a, side: [case.parameters["mu"]],
    )
    units = {"force": 10.0**-exponent, "slip": 10.0**exponent}
    return replace(
        case, system=tilted(f"1e{exponent}*d_x"), parameters=n, mechanics=mechanics, units=units
    )


# -- motions that end by name ----------------------------------------------------------------------


@cache
def ending(kind: str, potential: str, threshold: str, kinetic: str | None = None) -> System:
    coordinate = Inertial() if kind == "inertial" else RateIndependent()
    return System(
        name="a motion that ends",
        parameters=given(s=1.0, g=0.5, k=0.5, r=1.0),
        coordinates={"x": coordinate},
        kinetic="d_x**2/2" if kind == "inertial" else 0.0,
        potential=potential,
        contacts={"ground": Contact("d_x", threshold, kinetic=kinetic)},
        span=(0.0, 0.5),
    )


@family
def negative_threshold(rng: Rng) -> Case:
    """A threshold falls below zero, in time or in space."""
    s, r = rng.uniform(0.3, 1.0), rng.uniform(1.1, 3.0)
    if rng.random() < 0.5:
        # x'' = r − s + g t as long as s − g t ≥ 0.
        g = rng.uniform(0.1, 0.5)
        return _ends(
            ending("inertial", "-r*x", "s - g*t"),
            {"s": s, "r": r, "g": g},
            "threshold negative",
            s / g,
        )
    # x'' = r − s + x until x = s.
    time = acosh(1 + s / (r - s))
    return _ends(ending("inertial", "-r*x", "s - x"), {"s": s, "r": r}, "threshold negative", time)


@family
def kinetic_force_negative(rng: Rng) -> Case:
    """A kinetic force leaves its admissible set on the way: below zero."""
    s, r = rng.uniform(0.3, 1.0), rng.uniform(1.1, 3.0)
    # In sliding x'' = r − s + r x... the kinetic force is s − x and vanishes at x = s, as above.
    time = acosh(1 + s / (r - s))
    return _ends(ending("inertial", "-r*x", "s", "s - x"), {"s": s, "r": r}, "kinetic", time)


@family
def kinetic_force_above_threshold(rng: Rng) -> Case:
    """A kinetic force leaves its admissible set on the way: above the threshold."""
    s = rng.uniform(0.3, 1.0)
    r = rng.uniform(1.1, 3.0)
    g = rng.uniform(0.3, 0.9)
    # In sliding x'' = r − g s − x, and g s + x reaches s.
    time = acos(1 - (1 - g) * s / (r - g * s))
    return _ends(
        ending("inertial", "-r*x", "s", "g*s + x"), {"s": s, "r": r, "g": g}, "kinetic", time
    )


@family
def no_bounded_rate(rng: Rng) -> Case:
    """Φ = k(x − t)²/2 − cos x without viscosity: the branch turns where k + cos x = 0, if k < 1."""
    k, s = rng.uniform(0.2, 0.8), rng.uniform(0.1, 0.5)
    turn = acos(-k)
    time = turn + (sin(turn) + s) / k
    return _ends(
        ending("rate-independent", "k/2*(x - t)**2 - cos(x)", "s"),
        {"k": k, "s": s},
        "no bounded rate",
        time,
    )


@family
def blow_up(rng: Rng) -> Case:
    """x'' = 6x² with x = 1/(T − t)² slides into infinity."""
    time, s = rng.uniform(0.5, 2.0), rng.uniform(0.1, 0.5)
    start = {"x": 1 / time**2, "d_x": 2 / time**3}
    case = _ends(ending("inertial", "-2*x**3 - s*x", "s"), {"s": s}, "step too small", time)
    return replace(case, initial=start)


def _ends(system: System, n: dict[str, float], label: str, time: float) -> Case:
    return Case(system, n, {}, 1.5 * time + 1.0, None, expected=(label, time))
