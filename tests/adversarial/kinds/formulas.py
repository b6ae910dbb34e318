"""Formulas wherever one may stand: a random formula of a random subset of the names that are known
there.

A motion is judged by what the formula is, in Python's own arithmetic, at states that the motion
goes through, and by the motion of the same system with numbers in place of parameters.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import stickslip as ss
from stickslip.sweeps.request.user_measures import FormulaMeasure, read_measures

from ..case import declaration
from ..families.texts import GRID, Rng, Text, drawn, same, settled
from ..registry import in_turn
from ..verdict import AGREED, NOT_CERTIFIED, REFUSED, WRONG, OutOfTime, Verdict, at_most
from .motions import without_numbers

PARAMETERS = ("p", "q", "r")
STATE = ("x", "z", "a")
SPAN = (0.0, 3.0)
PATIENCE = 60.0  # seconds of the processor for one case
CLOSE = 1e-7  # between a motion and the one with numbers in place of parameters
FREE = 1e-5  # relative velocity from which a contact surely slips
LARGEST = 30.0  # formulas that are larger where they are tried are drawn again

START = {"t": 0.0, "x": 1.0, "z": 0.5, "a": 0.25, "d_x": 0.5, "d_z": -0.75, "speed": 0.5}

Sample = Mapping[str, float]
Check = Callable[[Sample], tuple[float, float] | None]


@dataclass(frozen=True)
class Case:
    """A formula at its place.

    Attributes
    ----------
    system : function
        Makes the system; it may be refused.
    formula : Text
    inlined : function
        The same with the numbers of the parameters in the formula.
    checks : sequence of functions
        Values along the motion -> what the library has for something, and what it should be.
    alone : function, optional
        What is judged without a motion: system -> what it has, and what it should be.
    """

    system: Callable[[], ss.System]
    formula: Text
    inlined: Callable[[], ss.System]
    checks: Sequence[Check] = ()
    alone: Callable[[ss.System], tuple[float, float]] | None = None
    family: str = ""
    seed: int = 0


@dataclass(frozen=True)
class Place:
    """Where a formula may stand.

    Attributes
    ----------
    names : tuple of str
        Known there, beside the parameters.
    wrap : str
        A formula that is admissible there for every F.
    changes : function
        The formula's text -> what is different in the declaration.
    check : function, optional
        Values and the value of the wrapped formula -> what the library has, and what it should be.
    alone : function, optional
        System and the value of the wrapped formula -> what it has, and what it should be.
    jumps : bool
        Whether it may jump with what moves.
    """

    names: tuple[str, ...]
    wrap: str
    changes: Callable[[str], dict[str, Any]]
    check: Callable[[Sample, float], tuple[float, float] | None] | None = None
    alone: Callable[[ss.System, float], tuple[float, float]] | None = None
    jumps: bool = False


def ordinary(driven: bool, **changes: Any) -> ss.System:
    """A block on a rough ground, a dashpot, an internal variable, and a drive or a constant
    load."""
    contact = {"direction": "d_x", "threshold": 0.4} | changes.pop("pad", {})
    block = changes.pop("block", {})
    given: dict[str, Any] = {
        "drives": {"w": "cos(1.3*t)" if driven else "0.75"},
        "functions": {"f(u)": "sin(u)"},
        "coordinates": {"x": ss.Inertial(**({"force": "w"} | block)), "z": ss.Viscous()},
        "internal": {"a": ss.Internal("x - a")},
        "kinetic": "d_x**2/2",
        "potential": "x**2/2 + z**2/2 + x*z/4",
        "viscous": "d_z**2/2 + 0.2*d_x**2/2",
        "contacts": {"pad": ss.Contact(**contact)},
        "initial": {"x": 1.0, "z": 0.5, "a": 0.25, "d_x": 0.5},
        "span": SPAN,
    }
    return ss.System("formulas", **(given | changes))


def accelerates(v: Sample, load: float, mass: float = 1.0, damping: float = 0.2) -> Any:
    """The equation of the block: its acceleration, and what it should be under a load."""
    force = load - v["x"] - v["z"] / 4 - damping * v["d_x"] + v["friction_pad"]
    return v["dd_x"], force / mass


def slides(v: Sample, force: float) -> tuple[float, float] | None:
    """Friction of a slip, and its threshold."""
    return (abs(v["friction_pad"]), force) if abs(v["slip_speed_pad"]) > FREE else None


def wave(v: Sample) -> float:
    """The drive of the ordinary system."""
    return v["w"]


MOVING = ("t", *STATE, "d_x")
PLACES: dict[str, Place] = {
    "potential": Place(
        ("x", "z", "a"),
        "0.2*tanh(F)",
        lambda f: {"potential": f"x**2/2 + z**2/2 + x*z/4 + {f}"},
    ),
    "kinetic energy": Place(
        (),
        "1 + 0.5*tanh(F)",
        lambda f: {"kinetic": f"({f})*d_x**2/2"},
        lambda v, mass: accelerates(v, wave(v), mass=mass),
    ),
    "viscous": Place(
        (),
        "0.3 + 0.2*tanh(F)",
        lambda f: {"viscous": f"d_z**2/2 + ({f})*d_x**2/2"},
        lambda v, damping: accelerates(v, wave(v), damping=damping),
    ),
    "force": Place(MOVING, "tanh(F)", lambda f: {"block": {"force": f}}, accelerates),
    "drag": Place(
        ("t", *STATE),
        "0.5 + 0.4*tanh(F)",
        lambda f: {"block": {"drag": f"({f})*d_x"}},
        lambda v, drag: accelerates(v, wave(v), damping=0.2 + drag),
    ),
    "drive": Place(("t",), "tanh(F)", lambda f: {"drives": {"w": f}}, accelerates, jumps=True),
    "function": Place(
        ("x",),
        "tanh(F)",
        lambda f: {
            "functions": {"f(u)": re.sub(r"\bx\b", "u", f)},
            "block": {"force": "f(x)"},
        },
        accelerates,
    ),
    "law": Place(
        (*MOVING, "d_z"),
        "tanh(F)",
        lambda f: {"internal": {"a": ss.Internal(f)}},
        lambda v, rate: (v["d_a"], rate),
    ),
    "threshold": Place(
        MOVING,
        "0.4 + 0.3*tanh(F)",
        lambda f: {"pad": {"threshold": f}},
        lambda v, force: (v["threshold_plus_pad"], force),
    ),
    "kinetic force": Place(
        (*MOVING, "speed"),
        "0.3 + 0.2*tanh(F)",
        lambda f: {"pad": {"threshold": 0.6, "kinetic": f}},
        slides,
    ),
    "surface speed": Place(
        ("t",),
        "0.5*tanh(F)",
        lambda f: {"pad": {"surface_speed": f}},
        lambda v, speed: (v["slip_speed_pad"], v["d_x"] - speed),
    ),
    "direction": Place(
        (),
        "1 + 0.5*tanh(F)",
        lambda f: {"pad": {"direction": f"({f})*d_x"}},
        lambda v, arm: (v["slip_speed_pad"], arm * v["d_x"]),
    ),
    "new state": Place(
        MOVING,
        "0.5*tanh(F)",
        lambda f: {"jumps": {"kick": ss.Jump(when="x - 0.875", to={"a": f}, direction="falling")}},
    ),
    "planar contact": Place(
        ("t", "x", "a"),
        "0.4 + 0.3*tanh(F)",
        lambda f: {
            "coordinates": {"x": ss.Inertial(force="w"), "y": ss.Inertial(), "z": ss.Viscous()},
            "kinetic": "(d_x**2 + d_y**2)/2",
            "contacts": {"pad": ss.Contact(("d_x", "d_y"), f)},
            "initial": {"x": 1.0, "z": 0.5, "a": 0.25, "d_x": 0.5, "d_y": 0.1},
        },
    ),
    "restitution": Place(
        (),
        "0.5 + 0.3*tanh(F)",
        lambda f: {
            "contacts": {"floor": ss.Unilateral("x + 1 + 0*t", restitution=f)},
        },
    ),
    "gap": Place(
        (),
        "0.05*tanh(F)",
        lambda f: {"contacts": {"floor": ss.Unilateral(f"x + 1.5 + sin(t)**3*({f})")}},
    ),
    "fact": Place(
        (),
        "F",
        lambda f: {"facts": {"fact": f}},
        alone=lambda s, value: (s.evaluate("fact"), value),
        jumps=True,
    ),
    "condition": Place(
        (),
        "F",
        lambda f: {"conditions": {"c": ss.Condition(f"{f} > 0.5", "no")}},
        alone=lambda s, value: (float(not ss.simulate(s, (0.0, 0.1)).warnings), float(value > 0.5)),
        jumps=True,
    ),
    "condition at equality": Place(
        (),
        "F",
        lambda f: {"conditions": {"c": ss.Condition(f"{f} <= 0.5", "no")}},
        alone=lambda s, value: (
            float(not ss.simulate(s, (0.0, 0.1)).warnings),
            float(value <= 0.5),
        ),
        jumps=True,
    ),
    "measure": Place(
        (),
        "F",
        lambda f: {"title": f},
        alone=lambda s, value: (_measure(s), value if math.isfinite(value) else math.nan),
        jumps=True,
    ),
}
FAMILIES = [f"formula: {name}" for name in PLACES]


def _measure(system: ss.System) -> float:
    """A formula of measures: the title of the system."""
    (measure,) = read_measures(system, [f"m = {system.title}"])
    assert isinstance(measure, FormulaMeasure)
    return float(np.ravel(measure.values(dict(system.values), 1)[0])[0])


def draw(family: str, seed: int) -> Case:
    """The case of a family with a seed."""
    place = PLACES[family.removeprefix("formula: ")]
    rng = np.random.default_rng([FAMILIES.index(family), seed])
    numbers = {name: float(rng.choice(GRID)) for name in PARAMETERS}
    while True:
        known = [*PARAMETERS, *place.names]
        names = [n for n in known if rng.uniform() < 0.5] or [str(rng.choice(known))]
        moves = any(n in place.names for n in names)
        formula = drawn(rng, names, int(rng.integers(2, 5)), place.jumps or not moves)
        if place.alone is not None or _defined(formula, place.names, numbers, rng):
            break
    text = place.wrap.replace("F", formula.text)
    literal = place.wrap.replace("F", _inlined(formula.text, numbers))
    parameters = {name: ss.Parameter(value) for name, value in numbers.items()}
    case = Case(
        lambda: ordinary(seed % 2 == 0, parameters=parameters, **place.changes(text)),
        formula,
        lambda: ordinary(seed % 2 == 0, **place.changes(literal)),
        family=family,
        seed=seed,
    )

    def value(v: Sample) -> float | None:
        inner = settled(formula, {**numbers, **_named(v, place.names)}, rng)
        return None if inner is None else _wrapped(place.wrap, inner)

    if place.alone is not None:
        judged, expected = place.alone, value({})
        return case if expected is None else replace(case, alone=lambda s: judged(s, expected))

    def check(v: Sample) -> tuple[float, float] | None:
        expected = value(v)
        return None if expected is None or place.check is None else place.check(v, expected)

    return replace(case, checks=[check])


def _inlined(text: str, numbers: Mapping[str, float]) -> str:
    """A text with numbers in place of names."""
    for name, number in numbers.items():
        text = re.sub(rf"\b{name}\b", f"({number!r})", text)
    return text


def _named(v: Sample, names: Sequence[str]) -> dict[str, float]:
    return {n: abs(v["slip_speed_pad"]) if n == "speed" else v[n] for n in names if v}


def _wrapped(wrap: str, value: float) -> float:
    """Value of a formula in its frame a + b tanh(F)."""
    found = re.fullmatch(r"(?:(?P<a>[\d.]+) \+ )?(?:(?P<b>[\d.]+)\*)?tanh\(F\)", wrap)
    if found is None:
        return value
    return float(found["a"] or 0.0) + float(found["b"] or 1.0) * math.tanh(value)


def _defined(formula: Text, names: Sequence[str], numbers: Mapping[str, float], rng: Rng) -> bool:
    """Whether a formula is a number of ordinary size wherever the motion may come."""
    for k in range(40):
        at = {n: float(rng.uniform(0.0 if n in ("t", "speed") else -3.0, 3.0)) for n in names}
        at = START | at if k else at | {n: START[n] for n in names}
        if not abs(formula.value({**numbers, **at})) < LARGEST:
            return False
    return True


def cases(seed: int = 0, count: int = 100) -> Iterator[Case]:
    """Cases of all families in turn."""
    return in_turn(FAMILIES, draw, seed, count)


def judge(case: Case) -> Verdict:
    """What the library makes of a formula at its place."""
    try:
        with at_most(PATIENCE):
            return _judge_alone(case) if case.alone is not None else _judge(case)
    except OutOfTime as error:
        return Verdict(REFUSED, str(error))
    except ss.DeclarationError as error:
        fair = case.alone is not None and "cannot be evaluated" in str(error)
        return Verdict(AGREED if fair else REFUSED, without_numbers(str(error)))
    except Exception as error:  # whatever it raises is a finding
        return Verdict(REFUSED, f"raises {type(error).__name__}: {without_numbers(str(error))}")


def _judge_alone(case: Case) -> Verdict:
    assert case.alone is not None
    found, expected = case.alone(case.system())
    if not same(found, expected):
        return Verdict(WRONG, "another value", {"got": found, "expected": expected})
    return Verdict(AGREED)


def _judge(case: Case) -> Verdict:
    system = case.system()
    motion = ss.simulate(system)
    if not motion.outcome.ok:
        return Verdict(REFUSED, motion.outcome.label)
    rng = np.random.default_rng(case.seed)
    worst = 0.0
    for t in rng.uniform(*SPAN, 12):
        sample = {name: float(value) for name, value in motion.at(float(t)).items()} | {"t": t}
        sample["w"] = math.cos(1.3 * t) if case.seed % 2 == 0 else 0.75
        for check in case.checks:
            pair = check(sample)
            if pair is not None:
                worst = max(worst, abs(pair[0] - pair[1]) / max(1.0, abs(pair[1])))
    try:
        other = ss.simulate(case.inlined())
    except ss.DeclarationError as error:
        if "cannot be evaluated" not in str(error):
            raise
        other = motion  # a number that is undefined is refused where it is written
    apart = max(abs(x - other.final[name]) for name, x in motion.final.items())
    numbers = {"formula off by": worst, "difference": apart}
    if not (worst <= CLOSE and apart <= CLOSE):
        wrong = motion.certificate.ok and other.certificate.ok
        note = "another value" if worst > CLOSE else "another motion with numbers"
        return Verdict(WRONG if wrong else NOT_CERTIFIED, note, numbers)
    if not motion.certificate.ok:
        return Verdict(NOT_CERTIFIED, "but right", numbers)
    if case.seed % 4 == 1 and " t " not in f" {re.sub(r'[^a-z_]', ' ', case.formula.text)} ":
        with suppress(ss.DeclarationError):  # such as one whose rest depends on time
            ss.equilibria(system)
    return Verdict(AGREED, "", numbers)


def reproduction(case: Case) -> str:
    """A script that repeats a case."""
    try:
        system = declaration(case.system())
    except ss.DeclarationError as error:
        return f"# {case.formula.text}\n# {error}"
    return f"system = {system}\nmotion = ss.simulate(system)"
