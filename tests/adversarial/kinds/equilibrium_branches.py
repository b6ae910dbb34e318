"""Branches of equilibria of a block that slides on a belt, on a wavy spring: over its load, and
over the speed of the belt.

Along a branch the parameter is an explicit function of the place x. So the branch is known as a
whole, folds are zeros of its derivative, and Hopf points are zeros of the damping where the
stiffness is positive; both are roots between the points of a scan. Where the spring has a kink the
equilibrium is on a boundary.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq

import stickslip as ss

from ..case import declaration, given, log_uniform, pick
from ..references.mechanics import Array
from ..registry import in_turn
from ..verdict import AGREED, NO_REFERENCE, NOT_CERTIFIED, REFUSED, WRONG, Verdict, at_most
from .motions import without_numbers

FAMILIES = ("load", "load on a spring with a kink", "speed of the belt")
FAR = 12.0  # where x ends
SCANNED = 48_001  # points of a scan
CLOSE = 1e-8  # of the range of the parameter, and of frequencies
PLACE = 1e-6  # of x
APART = 0.02  # of x: what is nearer to something special is not judged
SURE = 1e-6  # stiffness and damping whose sign decides of stability
PATIENCE = 60.0  # seconds


@dataclass(frozen=True)
class Case:
    """x'' = F − V′(x) − c (1 + b cos x) x′ + m(w − x′) h(x), V′ = k x + A cos(q x) + s max(x − a,
    0), m(u) = r + (1 − r) exp(−u), h(x) = 1 + e tanh x; times are in units in which the speed of
    Stribeck is 1.

    Attributes
    ----------
    family : str
    seed : int
    numbers : dict of str to float
    x : float
        Where the branch starts.
    width : float
        Of the range of the parameter, in units of its value or of 1.
    """

    family: str
    seed: int
    numbers: dict[str, float]
    x: float
    width: float

    @property
    def parameter(self) -> str:
        return "w" if self.family == "speed of the belt" else "F"

    def spring(self, x: Any) -> Any:
        """V′."""
        n = self.numbers
        kink = n["s"] * np.maximum(x - n["a"], 0.0)
        return n["k"] * x + n["A"] * np.cos(n["q"] * x) + kink

    def rough(self, x: Any) -> Any:
        """h."""
        return 1.0 + self.numbers["e"] * np.tanh(x)

    def value(self, x: Any) -> Any:
        """The parameter at which x is an equilibrium; NaN if there is none."""
        n = self.numbers
        if self.parameter == "F":
            return self.spring(x) - (n["r"] + (1 - n["r"]) * np.exp(-n["w"])) * self.rough(x)
        m = (self.spring(x) - n["F"]) / self.rough(x)
        with np.errstate(all="ignore"):
            return -np.log((m - n["r"]) / (1 - n["r"]))

    def stiffness(self, x: Any) -> Any:
        """What is above 0 where the determinant of the Jacobian is."""
        n = self.numbers
        w = self.value(x) if self.parameter == "w" else n["w"]
        m = n["r"] + (1 - n["r"]) * np.exp(-w)
        bent = n["k"] - n["A"] * n["q"] * np.sin(n["q"] * x) + n["s"] * (x > n["a"])
        return bent - m * n["e"] / np.cosh(x) ** 2

    def damping(self, x: Any) -> Any:
        """Minus the trace of the Jacobian."""
        n = self.numbers
        w = self.value(x) if self.parameter == "w" else n["w"]
        falls = (1 - n["r"]) * np.exp(-w) * self.rough(x)
        return n["c"] * (1 + n["b"] * np.cos(x)) - falls

    def system(self) -> ss.System:
        """What the library gets."""
        kink = " + s*max(x - a, 0)**2/2" if self.numbers["s"] else ""
        return ss.System(
            "wavy spring",
            parameters=given(**self.numbers),
            functions={"m(u)": "r + (1 - r)*exp(-u)", "h(x)": "1 + e*tanh(x)"},
            coordinates={"x": ss.Inertial(force="F - c*(1 + b*cos(x))*d_x")},
            kinetic="d_x**2/2",
            potential=f"k*x**2/2 + A/q*sin(q*x){kink}",
            contacts={"belt": ss.Contact("d_x", "h(x)", "w", kinetic="m(speed)*h(x)")},
        )


def draw(family: str, seed: int) -> Case:
    """The case of a family with a seed, the same on every machine."""
    rng = np.random.default_rng([zlib.crc32(family.encode()), seed, 2])
    kink = family == "load on a spring with a kink"
    numbers = {
        "k": log_uniform(rng, 0.2, 2.0),
        "A": float(rng.uniform(0.0, 1.5)),
        "q": float(rng.uniform(0.8, 3.0)),
        "s": float(rng.uniform(-1.5, 2.0)) if kink else 0.0,
        "a": float(rng.uniform(-1.5, 1.5)),
        "r": float(rng.uniform(0.2, 0.7)),
        "e": float(rng.uniform(-0.4, 0.4)),
        "w": log_uniform(rng, 0.1, 1.5),
        "b": float(rng.uniform(-0.6, 0.6)),
        "F": 0.0,
    }
    slope = (1 - numbers["r"]) * np.exp(-numbers["w"])
    numbers["c"] = float(slope * rng.uniform(0.5, 1.6))
    x = float(rng.uniform(-2.0, 2.0))
    width = float(pick(rng, (0.3, 1.0, 3.0)))
    case = Case(family, seed, numbers, x, width)
    if family == "speed of the belt":
        m = numbers["r"] + (1 - numbers["r"]) * np.exp(-numbers["w"])
        numbers["F"] = float(case.spring(x) - m * case.rough(x))
    else:
        numbers["F"] = float(case.value(x))
    return case


def cases(seed: int = 0, count: int = 100) -> Iterator[Case]:
    """Cases of all families in turn."""
    return in_turn(FAMILIES, draw, seed, count)


def reach(case: Case) -> tuple[float, float]:
    """The range of the parameter."""
    at = case.numbers[case.parameter]
    if case.parameter == "w":
        return at / (1.0 + case.width), at * (1.0 + case.width)
    return at - case.width, at + case.width


def reproduction(case: Case) -> str:
    """A script that repeats a case."""
    return (
        f"system = {declaration(case.system())}\n"
        f"branch = ss.continue_equilibrium(system, {case.parameter!r}, {reach(case)}, "
        f"start={{'x': {case.x!r}}})\nprint(branch.special, branch.certificate.describe())"
    )


# -- the reference ---------------------------------------------------------------------------------


class NotKnown(Exception):
    """The reference cannot tell."""


def on_the_branch(case: Case) -> tuple[float, float]:
    """From where to where x goes while the parameter stays in its range."""
    low, high = reach(case)
    ends = []
    for sign in (-1.0, 1.0):
        x = case.x + sign * np.linspace(0.0, FAR, SCANNED)
        value = case.value(x)
        out = np.flatnonzero(~((value >= low) & (value <= high)))
        if not len(out):
            raise NotKnown("the branch is too long")
        last, beyond = float(x[out[0] - 1]), float(x[out[0]])
        bound = high if not case.value(beyond) < low else low
        if not np.isfinite(case.value(beyond)):
            raise NotKnown("the parameter goes to infinity")
        ends.append(_root(lambda v, bound=bound: float(case.value(v) - bound), last, beyond))
    return min(ends), max(ends)


def special(case: Case, first: float, last: float) -> list[tuple[str, float]]:
    """Kinds and places of all that is special, in order."""
    x = np.linspace(first, last, SCANNED)
    found = [("end", first), ("end", last)]
    a = case.numbers["a"]
    kinks = [a] if case.numbers["s"] and first < a < last else []
    found += [("boundary equilibrium", place) for place in kinks]
    for kind, f in (("fold", case.stiffness), ("Hopf", case.damping)):
        y = f(x)
        for i in np.flatnonzero(y[:-1] * y[1:] < 0.0):
            if not any(x[i] <= place <= x[i + 1] for place in kinks):
                found.append((kind, _root(lambda v, f=f: float(f(v)), x[i], x[i + 1])))
        inside = y[1:-1]
        turns = (inside - y[:-2]) * (y[2:] - inside) < 0.0
        if np.any(turns & (np.abs(inside) < 1e-3)):
            raise NotKnown("stiffness or damping touches zero")
    found.sort(key=lambda pair: pair[1])
    places = np.array([place for _, place in found])
    if np.min(np.diff(places), initial=np.inf) < APART:
        raise NotKnown("special points beside each other")
    return [
        (kind, place)
        for kind, place in found
        if kind != "end" and (kind != "Hopf" or case.stiffness(place) > 0.0)
    ]


def _root(f: Callable[[float], float], low: float, high: float) -> float:
    found: Any = brentq(f, low, high, xtol=1e-15, rtol=np.float64(1e-15))
    return float(found)


# -- judge -----------------------------------------------------------------------------------------


def judge(case: Case) -> Verdict:
    """Follow the branch, and compare all of it."""
    try:
        first, last = on_the_branch(case)
        expected = special(case, first, last)
    except NotKnown as reason:
        return Verdict(NO_REFERENCE, str(reason))
    found = branch_of(case)
    if isinstance(found, str):
        return Verdict(REFUSED, without_numbers(found))
    width = reach(case)[1] - reach(case)[0]
    got = [(p.kind, p.state["x"], p.value) for p in found.special]
    numbers = {"got": got, "expected": [(k, x, float(case.value(x))) for k, x in expected]}
    numbers |= {"ended": found.ended, "verdict": found.certificate.verdict}
    fault = compared(case, found, expected, (first, last), width)
    if not found.certificate.ok:
        return Verdict(NOT_CERTIFIED, fault or "but right", numbers)
    return Verdict(WRONG if fault else AGREED, fault, numbers)


def branch_of(case: Case) -> ss.Branch | str:
    """The library's branch, or what it says instead."""
    try:
        with at_most(PATIENCE):
            start = {"x": case.x, "d_x": 0.0}
            return ss.continue_equilibrium(case.system(), case.parameter, reach(case), start=start)
    except Exception as error:  # whatever it raises is a finding
        return f"{type(error).__name__}: {str(error)[:80]}"


def compared(
    case: Case,
    found: ss.Branch,
    expected: list[tuple[str, float]],
    ends: tuple[float, float],
    width: float,
) -> str:
    """What is wrong with a branch; empty if nothing is."""
    x: Array = found.points["x"].values
    value: Array = found.points[case.parameter].values
    if np.max(np.abs(case.value(x) - value)) > CLOSE * width:
        return "a point is no equilibrium"
    if abs(np.min(x) - ends[0]) > PLACE or abs(np.max(x) - ends[1]) > PLACE:
        return "it ends elsewhere"
    K, D = case.stiffness(x), case.damping(x)
    sure = (np.abs(K) > SURE) & (np.abs(D) > SURE) & (np.abs(x - case.numbers["a"]) > PLACE)
    stable = (K > 0.0) & (D > 0.0)
    if np.any((found.points["stable"].values == 1)[sure] != stable[sure]):
        return "another stability"
    left = list(found.special)
    for kind, place in expected:
        own = [p for p in left if p.kind == kind and abs(p.state["x"] - place) <= PLACE]
        if len(own) != 1:
            return f"a {kind} is missing" if not own else f"a {kind} comes twice"
        (point,) = own
        left.remove(point)
        if abs(point.value - case.value(place)) > CLOSE * width:
            return f"a {kind} is elsewhere"
        omega = np.sqrt(max(case.stiffness(place), 0.0))
        if kind == "Hopf" and abs(point.data["frequency"] - omega) > CLOSE * max(omega, 1.0):
            return "another frequency"
    return f"no {left[0].kind} is there" if left else ""
