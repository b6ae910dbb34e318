"""Cycles: what the orbit finder says, against motions that are followed until they repeat themselves.

A cycle that the library certifies has to close, once around, with the extremes that it says, when SciPy integrates its
mechanics (:mod:`.machines`); neighbours that are followed by plain simulation have to be attracted or repelled as it
says; and it has to be the one on which the plainly simulated motion from the start settles, by the smallest lag at
which that repeats itself. What the library says instead of a cycle (rest, a family) is held against the same motion.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

import stickslip as ss
from stickslip import Contact, Inertial, Parameter, RateIndependent, System

from .machines import Damper, Dry, Machine, Masses, NoAnswer, Slider, Toy, follow

Array = np.ndarray
Rng = np.random.Generator
AGREED, REFUSED, NOT_CERTIFIED = "agreed", "refused", "not certified"
WRONG, NO_REFERENCE = "certified and wrong", "reference failed"

CLOSES = 1e-6  # SciPy's motion closes up to this part of the size of the cycle, times its growth
TWICE = 1e-9  # a part of the period after which the state is so near is a period
LAGS = 24  # periods of the drive, or returns, among which the smallest lag is looked for
SETTLED = 1e-6  # a motion that repeats itself to this part of its size has settled
CHUNKS, FIRST = 11, 40  # a motion is followed for FIRST periods, then for twice as many …
SAME = 1e-4  # two cycles with periods and extremes this close are one


@dataclass(frozen=True)
class Verdict:
    """The verdict on a case: one of the words above, the reason, and numbers."""

    kind: str
    note: str = ""
    numbers: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Case:
    """A system with numbers and a start.

    Attributes
    ----------
    machine : Machine
        The same for the reference.
    states : function
        State of the library, by name, ↦ state of the machine.
    watched : tuple of (str, int)
        Names whose extremes are compared, with their numbers in the state of the machine.
    period : float
        Of the drive; or about that of the slowest swing.
    driven : bool
    """

    family: str
    seed: int
    system: System
    parameters: dict[str, float]
    start: dict[str, float]
    machine: Machine
    states: Callable[[dict[str, float]], Array]
    watched: tuple[tuple[str, int], ...]
    period: float
    driven: bool


# -- the families ------------------------------------------------------------------------------------------------------

FAMILIES: dict[str, Callable[[Rng], tuple[Any, ...]]] = {}


def family(make: Callable[[Rng], tuple[Any, ...]]) -> Callable[[Rng], tuple[Any, ...]]:
    """Register a family under its name in words."""
    FAMILIES[make.__name__.replace("_", " ")] = make
    return make


def draw(name: str, seed: int) -> Case:
    """The case of a family with a seed, the same on every machine."""
    rng = np.random.default_rng([zlib.crc32(name.encode()), seed])
    return Case(name, seed, *FAMILIES[name](rng))


def cases(seed: int = 0, count: int = 100) -> Iterator[Case]:
    """Cases of all families in turn."""
    names = list(FAMILIES)
    for i in range(count):
        yield draw(names[i % len(names)], seed + i // len(names))


def parameters(*names: str) -> dict[str, Parameter]:
    return {name: Parameter(1.0) for name in names}


def in_order(*names: str) -> Callable[[dict[str, float]], Array]:
    """States of the machine are those of the library in another order."""
    return lambda state: np.array([state[name] for name in names])


def between(rng: Rng, low: float, high: float) -> float:
    return float(rng.uniform(low, high))


def log_between(rng: Rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


@cache
def belt(kinetic: str) -> System:
    """A mass on a spring and a damper on a belt."""
    return System(
        name="belt",
        parameters=parameters("m", "k", "c", "V", "F_s", "F_k", "v_s"),
        coordinates={"x": Inertial()},
        kinetic="m*d_x**2/2",
        potential="k*x**2/2",
        viscous="c/2*d_x**2",
        contacts={"belt": Contact("d_x", "F_s", surface_speed="V", kinetic=kinetic)},
        span=(0, 100),
    )


def on_a_belt(
    rng: Rng, kinetic: str, law: Callable[[dict[str, float]], Callable[[float], float]], c: tuple[float, float]
):
    p = {"m": log_between(rng, 0.3, 3.0), "k": log_between(rng, 0.3, 3.0), "c": log_between(rng, *c)}
    p |= {"V": log_between(rng, 0.05, 2.5), "F_s": between(rng, 0.8, 1.2), "F_k": between(rng, 0.2, 0.75)}
    p["v_s"] = log_between(rng, 0.05, 2.0)
    machine = Masses(
        [p["m"]],
        lambda t, x, v: np.array([-p["k"] * x[0] - p["c"] * v[0]]),
        [Dry(0, p["V"], p["F_s"], law(p))],
    )
    start = {"x": between(rng, -2.0, 2.0) / p["k"], "d_x": between(rng, -1.0, 1.0) * p["V"]}
    if rng.random() < 0.5:
        start = {"x": 0.9 * p["F_s"] / p["k"], "d_x": p["V"]}
    period = 2 * math.pi * math.sqrt(p["m"] / p["k"]) + 2.0 / (p["k"] * p["V"])
    return belt(kinetic), p, start, machine, in_order("x", "d_x"), (("x", 0), ("d_x", 1)), period, False


@family
def stribeck_belt(rng: Rng) -> tuple[Any, ...]:
    """Friction that falls with the speed: stick-slip, unstable cycles beside it, and steady sliding."""
    return on_a_belt(
        rng,
        "F_k + (F_s - F_k)*exp(-speed/v_s)",
        lambda p: lambda u: p["F_k"] + (p["F_s"] - p["F_k"]) * math.exp(-u / p["v_s"]),
        (0.003, 0.3),
    )


@family
def belt_with_static_above_kinetic(rng: Rng) -> tuple[Any, ...]:
    """Two constants: beyond some speed nothing comes back to the belt."""
    return on_a_belt(rng, "F_k", lambda p: lambda u: p["F_k"], (0.003, 0.2))


@family
def belt_with_a_smooth_bend(rng: Rng) -> tuple[Any, ...]:
    """Friction that falls to a rational law."""
    return on_a_belt(
        rng,
        "F_k + (F_s - F_k)/(1 + (speed/v_s)**2)",
        lambda p: lambda u: p["F_k"] + (p["F_s"] - p["F_k"]) / (1.0 + (u / p["v_s"]) ** 2),
        (0.003, 0.3),
    )


@cache
def belt_and_tail() -> System:
    """A mass on a belt, and a lightly damped one hung on it."""
    return System(
        name="belt and tail",
        parameters=parameters("V", "F_s", "F_k", "c", "m", "k", "c_y"),
        coordinates={"x": Inertial(), "y": Inertial()},
        kinetic="d_x**2/2 + m*d_y**2/2",
        potential="x**2/2 + k*(y - x)**2/2",
        viscous="c/2*d_x**2 + c_y/2*(d_y - d_x)**2",
        contacts={"belt": Contact("d_x", "F_s", surface_speed="V", kinetic="F_k")},
        span=(0, 200),
    )


@family
def complex_multipliers(rng: Rng) -> tuple[Any, ...]:
    """The tail swings on for many periods, and comes near to where it was after a few of them."""
    p = {"V": log_between(rng, 0.1, 0.8), "F_s": 1.0, "F_k": between(rng, 0.3, 0.7), "c": between(rng, 0.0, 0.05)}
    p |= {"m": between(rng, 0.02, 0.15), "k": log_between(rng, 0.02, 0.6), "c_y": log_between(rng, 0.0005, 0.01)}

    def force(t: float, x: Array, v: Array) -> Array:
        pull = p["k"] * (x[1] - x[0]) + p["c_y"] * (v[1] - v[0])
        return np.array([-x[0] - p["c"] * v[0] + pull, -pull])

    machine = Masses([1.0, p["m"]], force, [Dry(0, p["V"], p["F_s"], lambda u: p["F_k"])])
    start = {"x": between(rng, -1.0, 1.0), "d_x": p["V"], "y": between(rng, -1.0, 1.0)}
    period = 2 * math.pi + 2.0 / p["V"]
    order = in_order("x", "y", "d_x", "d_y")
    return belt_and_tail(), p, start, machine, order, (("x", 0), ("y", 1)), period, False


@cache
def jenkins() -> System:
    """A driven oscillator with a damper of a spring and a dry contact in series."""
    return System(
        name="Jenkins element",
        parameters=parameters("k", "c", "k_d", "F_c", "F", "omega", "b"),
        coordinates={"x": Inertial(), "z": RateIndependent()},
        kinetic="d_x**2/2",
        potential="k*x**2/2 + b*x**4/4 + k_d*(x - z)**2/2 - F*cos(omega*t)*x",
        viscous="c/2*d_x**2",
        contacts={"damper": Contact("d_z", "F_c")},
        span=(0, 100),
    )


def with_a_damper(rng: Rng, F: tuple[float, float], c: tuple[float, float], b: float) -> tuple[Any, ...]:
    p = {"k": 1.0, "c": log_between(rng, *c), "k_d": between(rng, 0.1, 1.0), "F_c": 1.0, "F": log_between(rng, *F)}
    p |= {"omega": between(rng, 0.3, 2.0), "b": b}

    def force(t: float, x: Array, v: Array) -> Array:
        return np.array([p["F"] * math.cos(p["omega"] * t) - x[0] - p["b"] * x[0] ** 3 - p["c"] * v[0]])

    machine = Masses([1.0], force, (), [Damper(0, p["k_d"], p["F_c"])])
    reach = 0.9 * p["F_c"] / p["k_d"]
    x = between(rng, -1.0, 1.0)
    start = {"x": x, "z": x + between(rng, -reach, reach) * float(rng.random() < 0.5)}
    return jenkins(), p, start, machine, in_order("x", "d_x", "z"), (("x", 0), ("z", 2)), 2 * math.pi / p["omega"], True


@family
def damper_that_may_slip(rng: Rng) -> tuple[Any, ...]:
    """Light damping plants returns after several periods; the damper slips, or only while the motion settles."""
    return with_a_damper(rng, (0.05, 3.0), (0.01, 0.1), 0.0)


@family
def damper_that_sticks(rng: Rng) -> tuple[Any, ...]:
    """The linear part of a frequency response, for any position of rest."""
    return with_a_damper(rng, (0.01, 0.2), (0.01, 0.1), 0.0)


@family
def damper_on_a_hard_spring(rng: Rng) -> tuple[Any, ...]:
    """Two responses to one load, and subharmonic ones."""
    return with_a_damper(rng, (0.2, 5.0), (0.02, 0.2), 1.0)


@cache
def driven() -> System:
    """A driven oscillator on a dry ground."""
    return System(
        name="driven oscillator",
        parameters=parameters("k", "c", "b", "F_s", "F_k", "F", "omega", "f"),
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="k*x**2/2 + b*x**4/4 - (f + F*cos(omega*t))*x",
        viscous="c/2*d_x**2",
        contacts={"ground": Contact("d_x", "F_s", kinetic="F_k")},
        span=(0, 100),
    )


def on_the_ground(rng: Rng, b: float, ratio: tuple[float, float], F: tuple[float, float]) -> tuple[Any, ...]:
    p = {"k": 1.0, "c": log_between(rng, 0.005, 0.1), "b": b, "F_s": log_between(rng, 0.05, 0.9)}
    p["F_k"] = p["F_s"] * between(rng, *ratio)
    p |= {"F": between(rng, *F), "omega": between(rng, 0.25, 2.2), "f": between(rng, -0.3, 0.3)}

    def force(t: float, x: Array, v: Array) -> Array:
        load = p["f"] + p["F"] * math.cos(p["omega"] * t)
        return np.array([load - p["k"] * x[0] - p["b"] * x[0] ** 3 - p["c"] * v[0]])

    machine = Masses([1.0], force, [Dry(0, 0.0, p["F_s"], lambda u: p["F_k"])])
    start = {"x": between(rng, -2.0, 2.0), "d_x": between(rng, -1.0, 1.0)}
    period = 2 * math.pi / p["omega"]
    return driven(), p, start, machine, in_order("x", "d_x"), (("x", 0), ("d_x", 1)), period, True


@family
def driven_on_dry_ground(rng: Rng) -> tuple[Any, ...]:
    """Non-stop and with stops, an asymmetric load, and rest."""
    return on_the_ground(rng, 0.0, (1.0, 1.0), (0.3, 1.5))


@family
def driven_with_static_above_kinetic(rng: Rng) -> tuple[Any, ...]:
    """Stops that are left with a jump of the force."""
    return on_the_ground(rng, 0.0, (0.4, 1.0), (0.3, 1.5))


@family
def driven_on_a_hard_spring(rng: Rng) -> tuple[Any, ...]:
    """Coexisting and subharmonic motions."""
    return on_the_ground(rng, 1.0, (0.5, 1.0), (0.5, 8.0))


@cache
def two_blocks() -> System:
    """Two blocks on a belt, joined by a spring."""
    return System(
        name="two blocks",
        parameters=parameters("k_c", "k_2", "c", "V", "F_1", "F_2", "r"),
        coordinates={"x": Inertial(), "y": Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential="x**2/2 + k_2*y**2/2 + k_c*(y - x)**2/2",
        viscous="c/2*(d_x**2 + d_y**2)",
        contacts={
            "first": Contact("d_x", "F_1", surface_speed="V", kinetic="r*F_1"),
            "second": Contact("d_y", "F_2", surface_speed="V", kinetic="r*F_2"),
        },
        span=(0, 100),
    )


@family
def two_blocks_on_a_belt(rng: Rng) -> tuple[Any, ...]:
    """Alternating and joint slips; some are irregular."""
    p = {"k_c": log_between(rng, 0.05, 2.0), "k_2": between(rng, 0.6, 1.6), "c": log_between(rng, 0.01, 0.3)}
    p |= {"V": log_between(rng, 0.03, 0.5), "F_1": 1.0, "F_2": between(rng, 0.6, 1.6), "r": between(rng, 0.3, 0.8)}

    def force(t: float, x: Array, v: Array) -> Array:
        pull = p["k_c"] * (x[1] - x[0])
        return np.array([-x[0] + pull, -p["k_2"] * x[1] - pull]) - p["c"] * v

    contacts = [Dry(i, p["V"], p[f"F_{i + 1}"], lambda u, i=i: p["r"] * p[f"F_{i + 1}"]) for i in range(2)]
    start = {"x": between(rng, -0.5, 0.5), "y": between(rng, -0.5, 0.5), "d_x": p["V"], "d_y": p["V"]}
    period, order = 2 * math.pi + 2.0 / p["V"], in_order("x", "y", "d_x", "d_y")
    return two_blocks(), p, start, Masses([1.0, 1.0], force, contacts), order, (("x", 0), ("y", 1)), period, False


@family
def slider_with_a_state(rng: Rng) -> tuple[Any, ...]:
    """The spring slider (3.3): stick-slip, unstable cycles next to its fold, steady sliding."""
    V, nu = log_between(rng, 0.03, 0.4), log_between(rng, 0.02, 0.1)
    system = ss.catalogue.spring_slider(mu="2/sqrt(alpha)")
    start = {"U": between(rng, 0.5, 2.5), "alpha": between(rng, 1.0, 2.0)}
    machine = Slider(V, nu, lambda alpha: 2.0 / math.sqrt(alpha))
    order, watched = in_order("U", "alpha"), (("U", 0), ("alpha", 1))
    return system, {"V": V, "nu": nu}, start, machine, order, watched, 1.0 / V, False


@family
def toy_that_may_walk(rng: Rng) -> tuple[Any, ...]:
    """The toy (4.2): it walks, or its rocking dies out."""
    p = {"delta": log_between(rng, 0.01, 0.15), "P": between(rng, 0.9, 1.3), "c": between(rng, 0.2, 0.4)}
    p |= {"rho": between(rng, 0.1, 0.3), "H_star": between(rng, 2.8, 3.4)}
    machine = Toy(p["delta"], p["P"], p["c"], p["rho"], p["H_star"])
    psi = between(rng, 1.0, 2.0)
    (low, _), (high, _) = machine.bounds(psi)
    start = {"psi": psi, "x_R": between(rng, low, high), "x_L": 0.0, "d_psi": 0.0}

    def states(state: dict[str, float]) -> Array:
        return np.array([state["psi"], state["d_psi"], state["x_R"] - state["x_L"], state["x_R"] + state["x_L"]])

    return ss.catalogue.rocking_toy(), p, start, machine, states, (("psi", 0),), 2 * math.pi, False


# -- the judge ---------------------------------------------------------------------------------------------------------


def judge(case: Case) -> Verdict:
    """Ask the library for the cycle, and hold what it says against other computations."""
    from stickslip.orbits.cycles import find_cycle

    try:
        cycle = find_cycle(case.system, case.start, case.parameters)
    except ss.StickslipError as error:
        return _refused(case, str(error))
    if not cycle.certificate.ok:
        return Verdict(NOT_CERTIFIED, cycle.certificate.verdict, {"period": cycle.period})
    try:
        for check in (_closes, _is_once_around, _attracts_as_said, _is_where_it_settles):
            wrong = check(case, cycle)
            if wrong is not None:
                return wrong
    except NoAnswer as error:
        return Verdict(NO_REFERENCE, str(error))
    return Verdict(AGREED, cycle.stability, {"period": cycle.period})


def reproduction(case: Case) -> str:
    """A script that repeats what the library did."""
    return "\n".join(
        [
            "import stickslip as ss",
            "from stickslip.modelfile import loads",
            f"system = loads({case.system.to_toml()!r}, 'system')",
            f"print(ss.find_cycle(system, {case.start!r}, {case.parameters!r}).describe())",
        ]
    )


def _sizes(cycle: ss.Cycle, case: Case) -> Array:
    """Half the ranges of what is watched."""
    ends = np.array([cycle.extrema[name] for name, _ in case.watched])
    return np.maximum(0.5 * np.ptp(ends, axis=1), 1e-3 * np.max(np.abs(ends)) + 1e-300)


def _closes(case: Case, cycle: ss.Cycle) -> Verdict | None:
    """SciPy's motion from its state closes after its period, and has its extremes."""
    y = case.states(cycle.state)
    motion = follow(case.machine, (cycle.time, cycle.time + cycle.period), y, cycle.period / 50.0)
    own = [i for _, i in case.watched]
    gap = np.max(np.abs((motion.end - y)[own]) / _sizes(cycle, case))
    growth = max(1.0, float(np.max(np.abs(cycle.multipliers))))
    if not gap <= CLOSES * growth:
        return Verdict(WRONG, "it does not close", {"gap": float(gap), "period": cycle.period})
    path = motion.at(cycle.time + cycle.period * np.linspace(0.0, 1.0, 4001))
    for (name, i), size in zip(case.watched, _sizes(cycle, case), strict=True):
        low, high = cycle.extrema[name]
        off = max(abs(path[:, i].min() - low), abs(path[:, i].max() - high)) / size
        if not off <= 1e-5 * growth:
            return Verdict(WRONG, "its extremes are others", {"name": name, "off": float(off)})
    return None


def _is_once_around(case: Case, cycle: ss.Cycle) -> Verdict | None:
    """After no part of its period is it where it was."""
    rounds = round(cycle.period / case.period) if case.driven else 12
    if case.driven and abs(cycle.period / case.period - rounds) > 1e-9:
        return Verdict(WRONG, "no number of periods of the drive", {"period": cycle.period})
    values = cycle.trajectory.at(cycle.time + cycle.period / np.arange(1, rounds + 1))
    for p in range(2, rounds + 1):
        if case.driven and rounds % p:
            continue
        gap = [abs(values[name][p - 1] - cycle.state[name]) for name, _ in case.watched]
        rates = [values[f"d_{name}"][p - 1] - cycle.trajectory.at(cycle.time)[f"d_{name}"] for name, _ in case.watched
                 if f"d_{name}" in values]  # fmt: skip
        if max(np.max(np.array(gap) / _sizes(cycle, case)), np.max(np.abs(rates), initial=0.0)) < TWICE:
            return Verdict(WRONG, "it runs around several times", {"rounds": p, "period": cycle.period})
    return None


def _attracts_as_said(case: Case, cycle: ss.Cycle) -> Verdict | None:
    """Neighbours come nearer to it, or leave, as the multipliers say."""
    largest = float(np.max(np.abs(cycle.nontrivial), initial=0.0))
    if 0.98 < largest < 1.02 or not cycle.differentiable:
        return None
    rounds = 1 if largest == 0.0 else min(math.ceil(math.log(100.0) / abs(math.log(largest))), 400)
    rounds = max(1, rounds if largest < 1.0 else min(rounds, math.floor(math.log(1e4) / math.log(largest))))
    sizes = dict(zip((name for name, _ in case.watched), _sizes(cycle, case), strict=True))
    rng, ratios = np.random.default_rng(case.seed), []
    for _ in range(3):
        beside = {name: value + 1e-6 * sizes.get(name, 0.0) * rng.normal() for name, value in cycle.state.items()}
        beside = {name: value for name, value in beside.items() if not _held(case, cycle, name)} | {
            name: cycle.state[name] for name in cycle.state if _held(case, cycle, name)
        }
        try:
            motion = ss.simulate(case.system, (cycle.time, cycle.time + rounds * cycle.period), beside, case.parameters)
        except ss.StickslipError:
            continue
        before = max(abs(beside[name] - cycle.state[name]) / sizes[name] for name in sizes)
        if before > 0.0 and motion.outcome.ok:
            ratios.append(_off(case, cycle, motion, rounds, sizes) / before)
    if not ratios:
        return None
    if cycle.stable and min(ratios) > 0.5:
        return Verdict(WRONG, "called stable, neighbours are not attracted", {"ratios": ratios, "multiplier": largest})
    if not cycle.stable and largest > 1.0 and max(ratios) < 2.0:
        return Verdict(WRONG, "called unstable, neighbours are attracted", {"ratios": ratios, "multiplier": largest})
    return None


def _held(case: Case, cycle: ss.Cycle, name: str) -> bool:
    """What sticks where the cycle starts is not pushed: friction or the threshold decides where it goes."""
    state = cycle.trajectory.at(cycle.time)
    modes = [state[f"mode_{contact.replace(' ', '_')}"] for contact in case.system.contacts]
    return name in ("z", "x_R", "x_L") or (name.startswith("d_") and any(m == 0 for m in modes))


def _off(case: Case, cycle: ss.Cycle, motion: ss.Trajectory, rounds: int, sizes: dict[str, float]) -> float:
    """How far the end of a motion is from the cycle: at the same phase of a drive, else from the nearest point."""
    names = list(sizes)
    last = np.array([motion.final[name] for name in names])
    scale = np.array([sizes[name] for name in names])
    if case.driven:
        return float(np.max(np.abs(last - [cycle.state[name] for name in names]) / scale))
    times = cycle.time + cycle.period * np.linspace(0.0, 1.0, 20_001)
    values = cycle.trajectory.at(times)
    path = np.column_stack([values[name] for name in names])
    a, chord = path[:-1], np.diff(path, axis=0)
    along = np.sum((last - a) * chord / scale**2, axis=1)
    part = np.clip(along / np.maximum(np.sum((chord / scale) ** 2, axis=1), 1e-300), 0, 1)
    return float(np.min(np.max(np.abs(last - a - part[:, None] * chord) / scale, axis=1)))


@dataclass(frozen=True)
class Settled:
    """What a plainly simulated motion settles on: its period and extremes; a period of 0 is rest."""

    period: float
    extremes: dict[str, tuple[float, float]]


def settle(case: Case) -> Settled | None:
    """Follow the motion from the start until it repeats itself; None if it does not within the time it is given."""
    t, state, length = 0.0, dict(case.start), FIRST
    size = 0.0
    for _ in range(CHUNKS):
        span = (t, t + length * case.period)
        motion = ss.simulate(case.system, span, state, case.parameters)
        if not motion.outcome.ok:
            return None
        if motion.outcome is ss.Outcome.AT_REST:
            return Settled(0.0, {})
        tail = np.linspace(max(span[0], span[1] - 2 * LAGS * case.period), span[1], 4001)
        values = motion.at(tail)
        size = max(size, *(float(np.max(np.abs(values[name]))) for name, _ in case.watched))
        if all(np.ptp(values[name]) <= 1e-9 * size for name, _ in case.watched):
            return Settled(0.0, {})
        found = _repeats(case, motion, span)
        if found is not None:
            return found
        t, state, length = span[1], motion.final, 2 * length
        if not case.driven and t > 1e6:
            return None
    return None


def _repeats(case: Case, motion: ss.Trajectory, span: tuple[float, float]) -> Settled | None:
    """The smallest lag at which the end of a motion repeats itself."""
    names = [name for name, _ in case.watched]
    if case.driven:
        marks = span[1] - case.period * np.arange(2 * LAGS + 1)
        marks = marks[marks >= span[0]]
    else:
        marks = _maxima(case, motion, span)
    if len(marks) < 4:
        return None
    marks = marks[: 2 * LAGS + 1]
    values = motion.at(marks)
    states = np.column_stack([values[name] for name in names])
    fine = motion.at(np.linspace(marks[-1], marks[0], 2001))
    size = np.array([max(np.ptp(fine[name]), 1e-300) for name in names])
    for lag in range(1, (len(marks) - 1) // 2 + 1):
        gaps = np.max(np.abs(states[:-lag] - states[lag:]) / size, axis=1)
        if np.max(gaps[: 2 * lag]) <= SETTLED:
            period = float(marks[0] - marks[lag])
            once = motion.at(np.linspace(marks[lag], marks[0], 20_001))
            return Settled(period, {name: (float(once[name].min()), float(once[name].max())) for name in names})
    return None


def _maxima(case: Case, motion: ss.Trajectory, span: tuple[float, float]) -> Array:
    """The latest times at which the first watched quantity has a maximum."""
    from scipy.optimize import brentq

    name, found = case.watched[0][0], []
    rate = f"d_{name}"
    t = np.linspace(max(span[0], span[1] - 4 * LAGS * case.period), span[1], 200 * LAGS)
    v = motion.at(t)[rate]
    for i in np.flatnonzero((v[:-1] > 0.0) & (v[1:] <= 0.0))[::-1]:
        found.append(float(brentq(lambda s: motion.at(float(s))[rate], t[i], t[i + 1], xtol=1e-13)))  # type: ignore[arg-type]
        if len(found) > 2 * LAGS:
            break
    return np.array(found)


def _same(case: Case, cycle: ss.Cycle, settled: Settled) -> bool:
    if abs(settled.period / cycle.period - 1.0) > SAME:
        return False
    sizes = _sizes(cycle, case)
    return all(
        max(abs(a - b) for a, b in zip(settled.extremes[name], cycle.extrema[name], strict=True)) <= 10 * SAME * size
        for (name, _), size in zip(case.watched, sizes, strict=True)
    )


def _is_where_it_settles(case: Case, cycle: ss.Cycle) -> Verdict | None:
    """The plainly simulated motion settles on it, or it starts beside it."""
    settled = settle(case)
    if settled is None or _same(case, cycle, settled):
        return None
    start = np.array([case.start.get(name, 0.0) for name, _ in case.watched])
    values = cycle.trajectory.at(cycle.time + cycle.period * np.linspace(0.0, 1.0, 2001))
    path = np.column_stack([values[name] for name, _ in case.watched])
    beside = np.min(np.max(np.abs(path - start) / _sizes(cycle, case), axis=1))
    if beside < 0.1:
        return None
    numbers = {"period": cycle.period, "settles on": settled.period, "start": float(beside), "said": cycle.stability}
    return Verdict(WRONG, "the motion settles on another cycle", numbers)


def _refused(case: Case, reason: str) -> Verdict:
    """What the library says instead of a cycle, against the motion."""
    said = reason.split(": ", 1)[-1]
    settled = settle(case)
    cycles = settled is not None and settled.period > 0.0
    numbers: dict[str, Any] = {"said": said[:300], "settles on": settled.period if settled else None}
    if "comes to rest" in said:
        return Verdict(WRONG if cycles else AGREED, "said to rest", numbers)
    if "the motion looks irregular" in said:
        return Verdict(WRONG, "said to be irregular", numbers) if cycles else Verdict(AGREED, "irregular", numbers)
    for words in ("come in a family", "no cycle was found", "the motion from the start ends", "did not converge"):
        if words in said:
            return Verdict(REFUSED, words + (", yet it settles" if cycles else ""), numbers)
    return Verdict(REFUSED, said[:80], numbers)
