"""Random functions of one variable: formulas for the library, arrays for the reference, and where
they are narrow."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from stickslip.arrays import Array

Rng = np.random.Generator
COARSE = 2048  # places between which every ordinary feature shows
# around a narrow place, in widths
CLOSER = np.concatenate([-np.logspace(2, -6, 120), [0.0], np.logspace(-6, 2, 120)])
CANDIDATES = 4  # local minima that are refined


@dataclass(frozen=True)
class Curve:
    """A function.

    Attributes
    ----------
    text : str
    at : function
        Array ↦ array.
    narrow : tuple of (float, float)
        Places and widths of narrow features.
    least : float
        Its minimum over a period, where it is known; otherwise NaN.
    """

    text: str
    at: Callable[[Any], Any]
    narrow: tuple[tuple[float, float], ...] = ()
    least: float = math.nan


def constant(value: float) -> Curve:
    """A number."""
    return Curve(f"{value!r}", lambda s: value + 0.0 * s, (), value)


# Wells: 0 at their place, at most 1, of period 1. `d` is sin(π(s − p))/(π w), the distance in
# widths.
WELLS: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "V": ("min(1, abs({d}))", lambda d: np.minimum(1.0, np.abs(d))),
    "Gauss": ("(1 - exp(-{d}**2))", lambda d: -np.expm1(-d * d)),
    "Lorentz": ("(1 - 1/(1 + {d}**2))", lambda d: d * d / (1.0 + d * d)),
    "tanh": ("tanh(abs({d}))", lambda d: np.tanh(np.abs(d))),
    "root": ("(1 - 1/sqrt(1 + {d}**2))", lambda d: 1.0 - 1.0 / np.sqrt(1.0 + d * d)),
    "box": ("piecewise(abs({d}) < 1, 0, 1)", lambda d: np.where(np.abs(d) < 1.0, 0.0, 1.0)),
}


def well(rng: Rng, kind: str | None = None, name: str = "s") -> Curve:
    """A narrow well of depth 1."""
    kind = kind or str(rng.choice(list(WELLS)))
    formula, at = WELLS[kind]
    place = float(rng.uniform(0.02, 0.98))
    width = float(10.0 ** rng.uniform(-8.0, -2.0))
    d = f"(sin(pi*({name} - {place!r}))/{math.pi * width!r})"
    reach = math.asin(math.pi * width) / math.pi  # where d = 1
    corners = (
        ((place - reach, 1e-3 * width), (place + reach, 1e-3 * width))
        if kind in ("V", "box")
        else ()
    )
    return Curve(
        formula.format(d=d),
        lambda s: at(np.sin(np.pi * (s - place)) / (np.pi * width)),
        ((place, width), *corners),
        0.0,
    )


def with_a_well(rng: Rng, least: float, kind: str | None = None) -> Curve:
    """A wave with a narrow well, least at its bottom."""
    own = well(rng, kind)
    depth = float(rng.uniform(0.2, 2.0))
    place = own.narrow[0][0]
    height = float(rng.uniform(0.0, 1.0))
    k = int(rng.integers(1, 9))
    text = f"{least!r} + {depth!r}*{own.text} + {height!r}*(1 - cos(2*pi*{k}*(s - {place!r})))"
    return Curve(
        text,
        lambda s: (
            least + depth * own.at(s) + height * (1.0 - np.cos(2.0 * np.pi * k * (s - place)))
        ),
        own.narrow,
        least,
    )


def wave(rng: Rng, low: float, amplitude: float, terms: int = 3, most: int = 6) -> Curve:
    """A trigonometric polynomial that is at least `low`."""
    parts = [
        (amplitude * float(rng.normal()), int(rng.integers(1, most + 1)), float(rng.uniform()))
        for _ in range(terms)
    ]
    mean = low + sum(abs(a) for a, _, _ in parts) + float(rng.uniform(0.0, amplitude))
    text = " + ".join([f"{mean!r}", *(f"{a!r}*cos(2*pi*{k}*(s - {p!r}))" for a, k, p in parts)])
    return Curve(
        text, lambda s: mean + sum(a * np.cos(2.0 * np.pi * k * (s - p)) for a, k, p in parts)
    )


def folded(rng: Rng) -> Curve:
    """A wave that is folded at 0, clipped, or the least of two."""
    one, other = (wave(rng, -1.0, 1.0) for _ in range(2))
    c = float(rng.uniform(0.1, 1.0))
    match int(rng.integers(3)):
        case 0:
            return Curve(f"{c!r} + abs({one.text})", lambda s: c + np.abs(one.at(s)))
        case 1:
            return Curve(f"max({c!r}, {one.text})", lambda s: np.maximum(c, one.at(s)))
        case _:
            return Curve(
                f"{c!r} + abs(min({one.text}, {other.text}))",
                lambda s: c + np.abs(np.minimum(one.at(s), other.at(s))),
            )


def several_wells(rng: Rng) -> Curve:
    """A wave with wells of different depths, so that any may be the deepest."""
    base = wave(rng, 3.0, 0.3)
    wells = [well(rng) for _ in range(int(rng.integers(2, 5)))]
    depths = [float(rng.uniform(0.1, 0.9)) for _ in wells]
    text = " + ".join([base.text, *(f"{d!r}*{w.text}" for d, w in zip(depths, wells, strict=True))])

    def at(s: Any) -> Any:
        return base.at(s) + sum(d * w.at(s) for d, w in zip(depths, wells, strict=True))

    return Curve(text, at, tuple(n for w in wells for n in w.narrow))


def any_curve(rng: Rng, low: float) -> Curve:
    """One of all kinds, at least `low` > 0."""
    match int(rng.integers(4)):
        case 0:
            return wave(rng, low, 0.5)
        case 1:
            return several_wells(rng)
        case _:
            return with_a_well(rng, low)


def places(narrow: tuple[tuple[float, float], ...], count: int = COARSE) -> Array:
    """Phases that see everything."""
    around = [p + w * CLOSER for p, w in narrow]
    found = np.concatenate([np.arange(count) / count, *around])
    return np.unique(found[(found >= 0.0) & (found < 1.0)])


def least(f: Callable[[Array], Array], narrow: tuple[tuple[float, float], ...]) -> float:
    """The least value over a period: among many places, then between the neighbours of the best by
    SciPy."""
    s = places(narrow)
    s = np.concatenate([[s[-1] - 1.0], s, [s[0] + 1.0]])
    values = f(s)
    inner = np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:])) + 1
    best = float(values.min())
    # As low as the steeper neighbour would take it: rounding on a flat bottom promises nothing.
    promised = values[inner] - np.maximum(values[inner - 1], values[inner + 1]) + values[inner]
    for k in inner[np.argsort(promised)][:CANDIDATES]:
        centre = s[k]
        half = 0.5 * (s[k + 1] - s[k - 1])
        found: Any = minimize_scalar(
            lambda x, centre=centre, half=half: float(f(np.array([centre + half * x]))[0]),
            bounds=((s[k - 1] - centre) / half, (s[k + 1] - centre) / half),
            method="bounded",
            options={"xatol": 1e-11},
        )
        best = min(best, float(found.fun))
    return best
