"""Averages over the phase against closed forms and brute force.

In the plane K_av = ∩ₛ K(s) is star-shaped about 0: its edge in the direction u is the least of the
edges of all K(s), and Ψ_av(V) the most that ⟨r u, V⟩ can be. That is searched here with the narrow
places known; thresholds are minima of functions; fixed normals leave a linear program for SciPy.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import linprog, minimize_scalar

import stickslip as ss

from ..case import pick
from ..families.curves import (
    Array,
    Curve,
    Rng,
    any_curve,
    constant,
    folded,
    least,
    places,
    several_wells,
    wave,
    with_a_well,
)
from ..registry import in_turn
from ..verdict import AGREED, NOT_CERTIFIED, REFUSED, WRONG, Verdict, at_most

DIRECTIONS = 2
ANGLES = 256
TOLERANCE = 1e-8  # duality gap that counts as certified, relative to Ψ_av and to the size of K(s)
EXACT = 1e-10  # of references
SEARCHED = 3e-8  # of references that are searched for
PATIENCE = 30.0  # seconds
Reference = Callable[[Array], float]


@dataclass(frozen=True)
class Case:
    """A potential as the library gets it, and Ψ_av(V) of the reference, known to `error` times the
    size of K(s)."""

    family: str
    seed: int
    potential: str
    reference: Reference
    directions: Array
    error: float
    size: float
    made: Any


FAMILIES: dict[str, Callable[[Rng], tuple[Any, ...]]] = {}


def family(make: Callable[[Rng], tuple[Any, ...]]) -> Callable[[Rng], tuple[Any, ...]]:
    """Register a family under its name in words."""
    FAMILIES[make.__name__.replace("_", " ")] = make
    return make


def draw(name: str, seed: int) -> Case:
    """The case of a family with a seed, the same on every machine."""
    rng = np.random.default_rng([zlib.crc32(name.encode()), seed])
    potential, text, reference, error, size, n = FAMILIES[name](rng)
    return Case(
        name, seed, text, reference, rng.normal(size=(DIRECTIONS, n)), error, size, potential
    )


def cases(seed: int = 0, count: int = 100) -> Iterator[Case]:
    """Cases of all families in turn."""
    return in_turn(FAMILIES, draw, seed, count)


# -- thresholds ------------------------------------------------------------------------------------


def minimum(curve: Curve) -> float:
    """Its least value."""
    return curve.least if np.isfinite(curve.least) else least(curve.at, curve.narrow)


def boxes(upper: list[Curve], lower: list[Curve], error: float) -> tuple[Any, ...]:
    """Weighted ℓ1 with given thresholds."""
    texts = [c.text for c in upper], [c.text for c in lower]
    above, below = (np.array([minimum(c) for c in curves]) for curves in (upper, lower))

    def reference(V: Array) -> float:
        return float(above @ np.maximum(V, 0.0) + below @ np.maximum(-V, 0.0))

    size = float(max(above.max(), below.max(), 1.0))
    return (
        ss.WeightedL1(*texts),
        f"ss.WeightedL1({texts[0]!r}, {texts[1]!r})",
        reference,
        error,
        size,
        len(upper),
    )


@family
def wells_of_thresholds(rng: Rng) -> tuple[Any, ...]:
    n = int(rng.integers(1, 4))
    upper, lower = (
        [with_a_well(rng, float(rng.uniform(0.0, 1.0))) for _ in range(n)] for _ in range(2)
    )
    return boxes(upper, lower, EXACT)


@family
def several_wells_of_thresholds(rng: Rng) -> tuple[Any, ...]:
    return boxes([several_wells(rng)], [several_wells(rng)], EXACT)


@family
def folded_waves(rng: Rng) -> tuple[Any, ...]:
    return boxes([folded(rng), folded(rng)], [wave(rng, 0.1, 1.0), folded(rng)], EXACT)


@family
def vanishing_thresholds(rng: Rng) -> tuple[Any, ...]:
    n = int(rng.integers(1, 4))
    curves = [with_a_well(rng, float(pick(rng, (0.0, 0.7)))) for _ in range(n)]
    return boxes(curves, curves, EXACT)


@family
def radii_of_groups(rng: Rng) -> tuple[Any, ...]:
    groups, size = int(rng.integers(1, 4)), int(rng.integers(2, 4))
    curves = [pick(rng, (any_curve(rng, 0.3), folded(rng))) for _ in range(groups)]
    radii = np.array([minimum(c) for c in curves])
    texts = [c.text for c in curves]

    def reference(V: Array) -> float:
        return float(radii @ np.linalg.norm(V.reshape(groups, size), axis=1))

    source = f"ss.GroupNorm({texts!r}, size={size})"
    return (
        ss.GroupNorm(texts, size=size),
        source,
        reference,
        EXACT,
        float(radii.max()),
        groups * size,
    )


@family
def offsets_of_half_spaces(rng: Rng) -> tuple[Any, ...]:
    n, more = int(rng.integers(2, 4)), int(rng.integers(0, 4))
    normals = np.vstack([np.eye(n), -np.eye(n), rng.normal(size=(more, n))])
    curves = [any_curve(rng, float(rng.uniform(0.1, 1.0))) for _ in normals]
    offsets = np.array([minimum(c) for c in curves])
    texts = [c.text for c in curves]

    def reference(V: Array) -> float:
        found = linprog(-V, A_ub=normals, b_ub=offsets, bounds=(None, None), method="highs-ds")
        return -float(found.fun)

    source = f"ss.Polytope(normals={normals.tolist()!r}, offsets={texts!r})"
    potential = ss.Polytope(normals=normals, offsets=texts)
    return potential, source, reference, 1e-9, float(offsets.max()), n


# -- in the plane ----------------------------------------------------------------------------------


def planar(
    edge: Callable[[Array, Array], Array], narrow: tuple[tuple[float, float], ...]
) -> Reference:
    """Ψ_av in the plane; `edge`: angles (m, 1), phases (k,) ↦ how far K(s) reaches there, (m,
    k)."""
    angles = 2.0 * np.pi * np.arange(ANGLES) / ANGLES
    s = places(narrow, 1024)
    radii = np.array([edge(np.array([[a]]), s).min() for a in angles])

    def reach(angle: float) -> float:
        return least(lambda phases: edge(np.array([[angle]]), phases)[0], narrow)

    def reference(V: Array) -> float:
        length = float(np.linalg.norm(V))
        toward = float(np.arctan2(V[1], V[0]))

        def best_near(middle: float, width: float) -> tuple[float, float]:
            """The largest product around an angle, and where; small differences keep their
            digits."""
            found: Any = minimize_scalar(
                lambda x: -reach(middle + x) * np.cos(middle + x - toward),
                bounds=(-width, width),
                method="bounded",
                options={"xatol": 1e-11},
            )
            return -float(found.fun), middle + float(found.x)

        # Along the border of a convex set the product with V has one maximum, which may be sharp,
        # while the radii that were looked at are not quite the least over all phases: so it is
        # looked for in all directions, too.
        step = 2.0 * np.pi / ANGLES
        looked = float(angles[int(np.argmax(radii * np.cos(angles - toward)))])
        middles = (looked, best_near(toward, 0.5 * np.pi)[1])
        return length * max(best_near(middle, 2.0 * step)[0] for middle in middles)

    return reference


def turning(rng: Rng) -> tuple[str, Callable[[Any], Any], float]:
    """An angle over the phase that makes k half turns in a period: as formula, function, and its
    number of turns."""
    k = int(pick(rng, (-2, -1, 1, 2)))
    a = float(rng.uniform(0.0, 0.4))
    p = float(rng.uniform())
    start = float(rng.uniform(0.0, 2.0 * np.pi))
    text = f"({start!r} + pi*{k}*s + {a!r}*sin(2*pi*(s - {p!r})))"
    return text, lambda s: start + np.pi * k * s + a * np.sin(2.0 * np.pi * (s - p)), abs(k) / 2.0


def ellipse(
    rng: Rng, one: Curve, other: Curve, angle: tuple[str, Callable[[Any], Any], float]
) -> tuple[Any, ...]:
    """An ellipse with half axes squared that vary, while it turns."""
    text, turned, _ = angle
    c, s2 = f"cos({text})**2", f"sin({text})**2"
    mixed = f"({one.text} - ({other.text}))*sin({text})*cos({text})"
    shape = [
        [f"({one.text})*{c} + ({other.text})*{s2}", mixed],
        [mixed, f"({one.text})*{s2} + ({other.text})*{c}"],
    ]

    def edge(angles: Array, s: Array) -> Array:
        along = np.cos(angles - turned(s)) ** 2 / one.at(s) + np.sin(
            angles - turned(s)
        ) ** 2 / other.at(s)
        return 1.0 / np.sqrt(along)

    narrow = one.narrow + other.narrow
    size = float(np.sqrt(max(one.at(places(narrow)).max(), other.at(places(narrow)).max())))
    return ss.Ellipsoid(shape), f"ss.Ellipsoid({shape!r})", planar(edge, narrow), SEARCHED, size, 2


@family
def turning_ellipse(rng: Rng) -> tuple[Any, ...]:
    a, b = (float(x) for x in rng.uniform(0.2, 3.0, 2))
    potential, text, _, _, size, n = ellipse(rng, constant(a), constant(b), turning(rng))
    radius = float(np.sqrt(min(a, b)))  # it shows its short axis to every direction
    return potential, text, lambda V: radius * float(np.linalg.norm(V)), EXACT, size, n


@family
def ellipse_that_breathes(rng: Rng) -> tuple[Any, ...]:
    one, other = (wave(rng, float(rng.uniform(0.1, 0.5)), 0.4, 2, 3) for _ in range(2))
    return ellipse(rng, one, other, turning(rng))


@family
def ellipse_with_a_narrow_waist(rng: Rng) -> tuple[Any, ...]:
    kind = str(pick(rng, ("V", "Gauss", "Lorentz", "tanh", "root")))
    one = with_a_well(rng, float(rng.uniform(0.1, 0.5)), kind)
    other = wave(rng, float(rng.uniform(0.2, 1.0)), 0.3, 2, 3)
    return ellipse(rng, one, other, turning(rng))


@family
def polygon_that_turns(rng: Rng) -> tuple[Any, ...]:
    k = int(rng.integers(3, 7))
    text_angle = turning(rng)
    scale = any_curve(rng, float(rng.uniform(0.2, 1.0)))
    text = f"2*{text_angle[0]}"

    def turned(s: Array) -> Array:
        return 2.0 * text_angle[1](s)

    corners = [
        [
            f"({scale.text})*cos({text} + {2 * np.pi * j / k!r})",
            f"({scale.text})*sin({text} + {2 * np.pi * j / k!r})",
        ]
        for j in range(k)
    ]

    def edge(angles: Array, s: Array) -> Array:
        apothem = scale.at(s) * np.cos(np.pi / k)
        return apothem / np.cos(np.mod(angles - turned(s), 2.0 * np.pi / k) - np.pi / k)

    size = float(scale.at(places(scale.narrow)).max())
    source = f"ss.Polytope(vertices={corners!r})"
    return ss.Polytope(vertices=corners), source, planar(edge, scale.narrow), SEARCHED, size, 2


@family
def half_spaces_that_turn(rng: Rng) -> tuple[Any, ...]:
    k = int(rng.integers(3, 6))
    a = float(rng.uniform(0.0, 0.3))
    phases = rng.uniform(size=k)
    base = 2.0 * np.pi * np.arange(k) / k
    curves = [any_curve(rng, float(rng.uniform(0.2, 1.0))) for _ in range(k)]
    angles = [
        f"{b!r} + {a!r}*sin(2*pi*(s - {p!r}))"
        for b, p in zip(base.tolist(), phases.tolist(), strict=True)
    ]
    normals = [[f"cos({t})", f"sin({t})"] for t in angles]

    def edge(u: Array, s: Array) -> Array:
        best = np.full((len(u), len(s)), np.inf)
        for b, p, curve in zip(base, phases, curves, strict=True):
            along = np.cos(u - (b + a * np.sin(2.0 * np.pi * (s - p))))
            best = np.minimum(
                best, np.where(along > 1e-9, curve.at(s) / np.maximum(along, 1e-9), np.inf)
            )
        return best

    narrow = tuple(x for curve in curves for x in curve.narrow)
    size = float(max(curve.at(places(narrow)).max() for curve in curves))
    offsets = [curve.text for curve in curves]
    source = f"ss.Polytope(normals={normals!r}, offsets={offsets!r})"
    return (
        ss.Polytope(normals=normals, offsets=offsets),
        source,
        planar(edge, narrow),
        SEARCHED,
        size,
        2,
    )


@family
def product_of_an_ellipse_and_thresholds(rng: Rng) -> tuple[Any, ...]:
    one = boxes([with_a_well(rng, 0.5)], [with_a_well(rng, 0.2)], EXACT)
    other = turning_ellipse(rng)
    parts = (one[0], other[0])
    texts = f"ss.Product(({one[1]}, {other[1]}))"
    return (
        ss.Product(parts),
        texts,
        lambda V: one[2](V[:1]) + other[2](V[1:]),
        EXACT,
        max(one[4], other[4]),
        3,
    )


# -- the judge -------------------------------------------------------------------------------------


def judge(case: Case) -> Verdict:
    """Ψ_av along random directions against the reference."""
    numbers: dict[str, Any] = {"difference": 0.0, "gap": 0.0}
    try:
        with at_most(PATIENCE):
            average = case.made.average()
            motions = [average.optimal_motion(V) for V in case.directions]
    except Exception as error:  # whatever it raises, it gave no result
        return Verdict(REFUSED, f"{type(error).__name__}: {str(error).split(':')[0]}")
    certified = average.bounded
    reason = average.coverage
    for V, motion in zip(case.directions, motions, strict=True):
        scale = case.size * float(np.abs(V).sum())
        expected = case.reference(V)
        numbers["difference"] = max(numbers["difference"], abs(motion.cost - expected) / scale)
        numbers["gap"] = max(numbers["gap"], abs(motion.gap) / scale)
        if motion.gap > TOLERANCE * scale:
            certified = False
            reason = "the duality gap is above the tolerance"
        if motion.bound > motion.cost + 1e-12 * scale:
            return Verdict(WRONG, "the bound is above the cost", numbers)
    right = numbers["difference"] <= max(case.error, TOLERANCE)
    if certified:
        return Verdict(AGREED, "", numbers) if right else Verdict(WRONG, "another average", numbers)
    return Verdict(NOT_CERTIFIED, f"{reason}; {'right' if right else 'wrong'}", numbers)


def reproduction(case: Case) -> str:
    """A script that repeats what the library did."""
    directions = case.directions.tolist()
    return (
        "import stickslip as ss\n"
        f"average = {case.potential}.average()\n"
        f"print([average.optimal_motion(V) for V in {directions}])"
    )
