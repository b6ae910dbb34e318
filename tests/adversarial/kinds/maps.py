"""Maps: random points, against motions that are followed until they repeat themselves
(:mod:`..references.brute`).

A point of a map does not depend on its company, so a case is one point: parameters and an initial
state. What the library certifies (rest, steady sliding, a cycle with its least period and its
measures, "undamped", or a start outside the stable set with the excess) has to be what brute force
finds.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

import stickslip as ss
from stickslip import Contact, Inertial, System

from ..case import Rng, given, log_uniform
from ..families.repeating import FAMILIES as REPEATING
from ..references.brute import (
    CONSTANT,
    EXPONENTIAL,
    MASSES,
    RATIONAL,
    SLIDER,
    TOY,
    Brute,
    Settled,
    settle,
)
from ..references.mechanics import Array
from ..registry import in_turn
from ..verdict import AGREED, NO_REFERENCE, NOT_CERTIFIED, REFUSED, WRONG, Verdict

MEASURES = ("period", "amplitude", "stick_fraction", "energy_per_cycle")
STEPS = 500  # of the reference, in the period of the fastest swing
CLOSE = 1e-6  # relative difference of periods and measures
# A shorter lag that nearly closes: next to a period doubling, where what alternates dies out by one
# part in a hundred each time, twice that lag closes to 1e-6 while so much is left.
NEAR = 1e-4


@dataclass(frozen=True)
class Case:
    """A point of a map.

    Attributes
    ----------
    system, parameters, initial
        What the library gets.
    brute : Brute
        The same for the reference; `start`, `mode`: its initial state.
    span : float
        About the duration of a cycle.
    late : float
        Time before which the reference says nothing.
    excess : float
        By how much the start is outside the stable set.
    drift : bool
        Whether the first component drifts in the library, but not in the reference.
    """

    family: str
    seed: int
    system: System
    parameters: dict[str, float]
    initial: dict[str, float]
    brute: Brute
    start: Array
    mode: tuple[int, ...]
    span: float
    late: float = 0.0
    excess: float = 0.0
    drift: bool = False


FAMILIES: dict[str, Callable[[Rng], dict[str, Any]]] = {}


def family(make: Callable[[Rng], dict[str, Any]]) -> Callable[[Rng], dict[str, Any]]:
    """Register a family under the name of its function."""
    FAMILIES[make.__name__.replace("_", " ")] = make
    return make


def draw(name: str, seed: int) -> Case:
    """The case of a family with a seed: the same on every machine."""
    rng = np.random.default_rng([zlib.crc32(f"maps {name}".encode()), seed])
    return Case(name, seed, **FAMILIES[name](rng))


def cases(seed: int = 0, count: int = 100) -> Iterator[Case]:
    """Cases of all families in turn."""
    return in_turn(FAMILIES, draw, seed, count)


# -- the reference of a system ---------------------------------------------------------------------


def masses(
    mass: list[float],
    stiffness: list[list[float]],
    damping: list[list[float]],
    dry: list[tuple[float, ...]] = (),  # type: ignore[assignment]
    dampers: list[tuple[float, ...]] = (),  # type: ignore[assignment]
    load: tuple[float, ...] = (0.0, 0.0, 1.0),
    wall: tuple[float, ...] = (0.0, 0.0, 1.0, 0.0),
    hard: float = 0.0,
    driven: bool = False,
) -> Brute:
    """Masses with contacts and dampers; see :class:`.brute.Brute`."""
    K = np.array(stiffness, dtype=float)
    loads = (*load, *(0.0, 0.0, 1.0, 0.0, 0.0, 1.0)[len(load) - 3 :])
    stiff = K + np.diag([sum(d[1] for d in dampers if d[0] == i) for i in range(len(mass))])
    fastest = math.sqrt(np.max(np.linalg.eigvals(stiff / np.array(mass)[:, None]).real))
    period = 2 * math.pi / loads[2] if driven else 0.0
    step = 2 * math.pi / max(fastest, loads[2] if driven else 0.0) / STEPS
    return Brute(
        MASSES,
        step,
        period,
        np.array(mass, dtype=float),
        K,
        np.array(damping, dtype=float),
        float(hard),
        np.array(loads, dtype=float),
        np.array(wall, dtype=float),
        np.array(dry, dtype=float).reshape(-1, 8),
        np.array(dampers, dtype=float).reshape(-1, 3),
        np.zeros(1),
    )


def other(kind: int, step: float, *numbers: float) -> Brute:
    """The toy, or the slider."""
    empty = masses([1.0], [[1.0]], [[0.0]])
    return empty._replace(kind=kind, step=step, numbers=np.array(numbers, dtype=float))


def contact(
    mass: float, speed: float, static: float, sliding: float, law: int = CONSTANT, at: float = 1.0
) -> tuple[float, ...]:
    """A row of :attr:`.brute.Brute.dry`."""
    return (mass, speed, static, sliding, float(law), at, 0.0, 0.0)


def following(static: float, dip: float = 0.0) -> tuple[float, ...]:
    """A contact with the ground whose sliding force is its threshold."""
    return (0.0, 0.0, static, static, 0.0, 1.0, dip, 1.0)


def modes(brute: Brute, y: Array) -> tuple[int, ...]:
    """How contacts begin: those that move slip, all others stick until their guards say more."""
    n = len(brute.mass)
    speeds = [float(y[n + int(row[0])] - row[1]) for row in brute.dry]
    return (*(int(np.sign(u)) for u in speeds), *(0 for _ in brute.dampers))


def point(
    system: System,
    p: dict[str, float],
    start: dict[str, float],
    brute: Brute,
    y: Array,
    span: float,
    **more: Any,
):
    """What a family returns."""
    mode = more.pop("mode", None) or modes(brute, y)
    return {
        "system": system,
        "parameters": p,
        "initial": start,
        "brute": brute,
        "start": y,
        "mode": mode,
        "span": span,
    } | more


def repeating(name: str, rng: Rng) -> tuple[System, dict[str, float], dict[str, float], float]:
    """System, parameters, start and period of a family that the cycles have, too."""
    case = REPEATING[name](rng)
    return case.system, dict(case.parameters), dict(case.initial), case.duration


# -- families that the cycles have, too ------------------------------------------------------------


def on_a_belt(rng: Rng, name: str, law: int) -> dict[str, Any]:
    system, p, start, period = repeating(name, rng)
    dry = contact(0, p["V"], p["mu"], p["F_k"], law, p["v_s"])
    y = np.array([start["x"], start["d_x"]])
    return point(system, p, start, masses([p["m"]], [[p["k"]]], [[p["c"]]], [dry]), y, period)


@family
def stribeck_belt(rng: Rng) -> dict[str, Any]:
    """Stick-slip, or steady sliding."""
    return on_a_belt(rng, "falling with speed", EXPONENTIAL)


@family
def belt_with_static_above_kinetic(rng: Rng) -> dict[str, Any]:
    """Two constants."""
    return on_a_belt(rng, "static above kinetic", CONSTANT)


@family
def belt_with_a_smooth_bend(rng: Rng) -> dict[str, Any]:
    """A rational law."""
    return on_a_belt(rng, "smooth bend", RATIONAL)


@family
def complex_multipliers(rng: Rng) -> dict[str, Any]:
    """A tail that swings on for many periods."""
    system, p, start, period = repeating("complex multipliers", rng)
    K = [[1.0 + p["k"], -p["k"]], [-p["k"], p["k"]]]
    C = [[p["c"] + p["e"], -p["e"]], [-p["e"], p["e"]]]
    brute = masses([1.0, p["m"]], K, C, [contact(0, p["V"], p["mu"], p["F_k"])])
    return point(
        system, p, start, brute, np.array([start["x"], start["y"], start["d_x"], 0.0]), period
    )


@family
def two_blocks_on_a_belt(rng: Rng) -> dict[str, Any]:
    """Alternating and joint slips."""
    system, p, start, period = repeating("two blocks on a belt", rng)
    K = [[1.0 + p["j"], -p["j"]], [-p["j"], p["k"] + p["j"]]]
    dry = [contact(i, p["V"], p[s], p["r"] * p[s]) for i, s in enumerate(("mu", "nu"))]
    brute = masses([1.0, 1.0], K, [[p["c"], 0.0], [0.0, p["c"]]], dry)
    return point(
        system, p, start, brute, np.array([start["x"], start["y"], p["V"], p["V"]]), period
    )


def with_a_damper(rng: Rng, name: str) -> dict[str, Any]:
    system, p, start, period = repeating(name, rng)
    if rng.random() < 0.1:
        start["z"] += 2.0 / p["j"]
    damper = (0.0, p["j"], p["mu"])
    load = (0.0, p["F"], p["omega"])
    brute = masses([1.0], [[p["k"]]], [[p["c"]]], [], [damper], load, hard=p["b"], driven=True)
    beyond = p["j"] * abs(start["x"] - start["z"]) - p["mu"]
    return point(
        system,
        p,
        start,
        brute,
        np.array([start["x"], 0.0, start["z"]]),
        period,
        excess=max(beyond, 0.0),
    )


@family
def damper_that_may_slip(rng: Rng) -> dict[str, Any]:
    """Light damping plants returns after several periods."""
    return with_a_damper(rng, "damper that may slip")


@family
def damper_that_sticks(rng: Rng) -> dict[str, Any]:
    """An oscillation is no rest."""
    return with_a_damper(rng, "damper that sticks")


@family
def damper_on_a_hard_spring(rng: Rng) -> dict[str, Any]:
    """Two responses to one load, and subharmonic ones."""
    return with_a_damper(rng, "damper on a hard spring")


def on_the_ground(rng: Rng, name: str, still: bool = False) -> dict[str, Any]:
    system, p, start, period = repeating(name, rng)
    if still:
        p["F"] = 0.0
    dry = contact(0, 0.0, p["mu"], p["F_k"])
    load = (p["f"], p["F"], p["omega"])
    brute = masses([1.0], [[p["k"]]], [[p["c"]]], [dry], load=load, hard=p["b"], driven=not still)
    return point(
        system,
        p,
        start,
        brute,
        np.array([start["x"], start["d_x"]]),
        2 * math.pi if still else period,
    )


@family
def driven_on_dry_ground(rng: Rng) -> dict[str, Any]:
    """Non-stop and with stops, and rest."""
    return on_the_ground(rng, "driven on dry ground")


@family
def driven_with_static_above_kinetic(rng: Rng) -> dict[str, Any]:
    """Stops that are left with a jump of the force."""
    return on_the_ground(rng, "driven with static above kinetic")


@family
def driven_on_a_hard_spring(rng: Rng) -> dict[str, Any]:
    """Coexisting and subharmonic motions."""
    return on_the_ground(rng, "driven on a hard spring")


@family
def coming_to_rest(rng: Rng) -> dict[str, Any]:
    """A drive whose amplitude is zero, and forces that are not affine."""
    return on_the_ground(rng, "driven on a hard spring", still=True)


@family
def slider_with_a_state(rng: Rng) -> dict[str, Any]:
    """The spring slider (3.3)."""
    system, p, start, period = repeating("slider with a state", rng)
    slips = start["U"] > 2.0 / math.sqrt(start["alpha"])
    brute = other(SLIDER, 0.02 * p["nu"], p["V"], p["nu"])
    return point(
        system, p, start, brute, np.array([start["U"], start["alpha"]]), period, mode=(int(slips),)
    )


@family
def toy_that_may_walk(rng: Rng) -> dict[str, Any]:
    """The toy (4.2): it walks, or its rocking dies out; some start outside the stable set."""
    system, p, start, _ = repeating("toy that may walk", rng)
    if rng.random() < 0.2:
        start["x_R"] += float(rng.uniform(-3.0, 3.0))
    right = p["rho"] + p["H_star"] / 2 * (1 + min(max(start["psi"], -1.0), 1.0))
    left = 2 * p["rho"] + p["H_star"] - right
    forces = [
        (start["x_R"] - p["c"] * start["psi"] - p["P"], right),
        (p["c"] * start["psi"] - start["x_R"] - p["P"], left),
    ]
    excess = max(0.0, *(abs(force) - s for force, s in forces))
    brute = other(TOY, 2 * math.pi / STEPS, *(p[n] for n in ("delta", "P", "c", "rho", "H_star")))
    y = np.array([start["psi"], 0.0, start["x_R"], start["x_R"]])
    mode = (0, 0, 1)
    return point(system, p, start, brute, y, 2 * math.pi, mode=mode, excess=excess)


# -- families of their own: what is narrow, what comes late, what is not damped --------------------


@cache
def shaken(threshold: str = "F_s", potential: str = "", load: str = "") -> System:
    """A driven oscillator on a dry ground, with something narrow."""
    return System(
        name="shaken",
        parameters=given(c=1.0, F_s=1.0, f=1.0, F=1.0, omega=1.0, A=1.0, phi=1.0, w=1.0, p=1.0),
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential=f"x**2/2 - (f + F*cos(omega*t){load})*x{potential}",
        viscous="c/2*d_x**2",
        contacts={"ground": Contact("d_x", threshold)},
        span=(0, 100),
    )


BUMP = "exp((cos(omega*t - phi) - 1)/w**2)"


def shaking(rng: Rng) -> dict[str, float]:
    p = {"c": log_uniform(rng, 0.02, 0.2), "F_s": float(rng.uniform(0.2, 0.8)), "f": 0.0, "p": 0.0}
    p |= {
        "omega": float(rng.uniform(0.3, 1.6)),
        "phi": float(rng.uniform(0.0, 6.0)),
        "w": log_uniform(rng, 1e-3, 0.1),
    }
    return p | {"F": p["F_s"] * float(rng.uniform(0.2, 0.9)), "A": 0.0}


@family
def pulses_in_the_load(rng: Rng) -> dict[str, Any]:
    """Between them everything may stick."""
    p = shaking(rng)
    p["A"] = float(rng.uniform(0.1, 2.0)) * p["omega"] / (2.5 * p["w"])
    load = (0.0, p["F"], p["omega"], p["A"], p["phi"], p["w"])
    brute = masses([1.0], [[1.0]], [[p["c"]]], [following(p["F_s"])], load=load, driven=True)
    return point(shaken(load=f" + A*{BUMP}"), p, {}, brute, np.zeros(2), brute.period)


@family
def dips_of_a_threshold(rng: Rng) -> dict[str, Any]:
    """What sticks lets go for an instant."""
    p = shaking(rng) | {"A": float(rng.uniform(0.3, 1.0)), "w": log_uniform(rng, 3e-3, 0.1)}
    load = (0.0, p["F"], p["omega"], 0.0, p["phi"], p["w"])
    brute = masses(
        [1.0], [[1.0]], [[p["c"]]], [following(p["F_s"], p["A"])], load=load, driven=True
    )
    x = float(rng.uniform(-0.1, 0.1)) * p["F_s"]
    return point(
        shaken(f"F_s*(1 - A*{BUMP})"), p, {"x": x}, brute, np.array([x, 0.0]), brute.period
    )


@family
def narrow_wall(rng: Rng) -> dict[str, Any]:
    """A force in a small place."""
    p = shaking(rng) | {"A": float(rng.uniform(0.5, 5.0)), "w": log_uniform(rng, 3e-3, 0.1)}
    p |= {"F": p["F_s"] * float(rng.uniform(1.2, 3.0)), "p": float(rng.uniform(-0.5, 0.5))}
    brute = masses(
        [1.0], [[1.0]], [[p["c"]]], [following(p["F_s"])], load=(0.0, p["F"], p["omega"]),
        wall=(p["A"], p["p"], p["w"], 0.0), driven=True,
    )  # fmt: skip
    start = {"x": p["p"] - 0.4, "d_x": 0.0}
    system = shaken(potential=" + A*w*tanh((x - p)/w)")
    return point(system, p, start, brute, np.array([start["x"], 0.0]), brute.period)


@family
def rough_patch(rng: Rng) -> dict[str, Any]:
    """A place where the ground is rough."""
    p = shaking(rng) | {"A": float(rng.uniform(0.5, 10.0)), "w": log_uniform(rng, 3e-3, 0.1)}
    p |= {"F": p["F_s"] * float(rng.uniform(1.2, 3.0)), "p": float(rng.uniform(-0.5, 0.5))}
    brute = masses(
        [1.0], [[1.0]], [[p["c"]]], [following(p["F_s"])], load=(0.0, p["F"], p["omega"]),
        wall=(0.0, p["p"], p["w"], p["A"]), driven=True,
    )  # fmt: skip
    start = {"x": p["p"] - 0.4, "d_x": 0.0}
    system = shaken("F_s*(1 + A*exp(-((x - p)/w)**2))")
    return point(system, p, start, brute, np.array([start["x"], 0.0]), brute.period)


@cache
def struck() -> System:
    """An oscillator on a dry ground, and one gust."""
    return System(
        name="struck",
        parameters=given(c=1.0, F_s=1.0, f=1.0, G=1.0, T=1.0, tau=1.0),
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="x**2/2 - (f + G*max(0, 1 - abs(t - T)/tau))*x",
        viscous="c/2*d_x**2",
        contacts={"ground": Contact("d_x", "F_s")},
        span=(0, 100),
    )


@family
def gust_after_rest(rng: Rng) -> dict[str, Any]:
    """What rests for long is not at rest for ever."""
    p = {
        "c": log_uniform(rng, 0.02, 0.2),
        "F_s": float(rng.uniform(0.2, 0.8)),
        "G": float(rng.uniform(1.0, 5.0)),
    }
    p |= {
        "f": float(rng.uniform(-0.1, 0.1)),
        "T": log_uniform(rng, 10.0, 5000.0),
        "tau": log_uniform(rng, 1e-2, 3.0),
    }
    load = (p["f"], 0.0, 1.0, 0.0, 0.0, 1.0, p["G"], p["T"], p["tau"])
    brute = masses([1.0], [[1.0]], [[p["c"]]], [contact(0, 0.0, p["F_s"], p["F_s"])], load=load)
    start = {"x": float(rng.uniform(-1.0, 1.0))}
    return point(
        struck(), p, start, brute, np.array([start["x"], 0.0]), 2 * math.pi, late=p["T"] + 100.0
    )


@cache
def dragged() -> System:
    """A block that a spring drags over the ground."""
    return System(
        name="dragged",
        parameters=given(k=1.0, c=1.0, V=1.0, F_s=1.0, F_k=1.0),
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="k*(x - V*t)**2/2",
        viscous="c/2*d_x**2",
        contacts={"ground": Contact("d_x", "F_s", kinetic="F_k")},
        span=(0, 100),
    )


@family
def dragged_block(rng: Rng) -> dict[str, Any]:
    """A system that moves with its load: the reference moves with it."""
    p = {
        "k": log_uniform(rng, 0.3, 3.0),
        "c": log_uniform(rng, 0.003, 0.2),
        "V": log_uniform(rng, 0.05, 1.0),
    }
    p |= {"F_s": float(rng.uniform(0.6, 1.2)), "F_k": float(rng.uniform(0.2, 0.6))}
    dry = contact(0, -p["V"], p["F_s"], p["F_k"])
    brute = masses([1.0], [[p["k"]]], [[p["c"]]], [dry], load=(-p["c"] * p["V"], 0.0, 1.0))
    period = 2 * math.pi / math.sqrt(p["k"]) + 2.0 / (p["k"] * p["V"])
    return point(dragged(), p, {}, brute, np.array([0.0, -p["V"]]), period, drift=True)


@family
def nothing_damps_it(rng: Rng) -> dict[str, Any]:
    """A belt without viscous friction: stick-slip, or for ever an oscillation about sliding."""
    system, p, start, period = repeating("static above kinetic", rng)
    p |= {"c": 0.0, "F_k": p["mu"] if rng.random() < 0.3 else p["F_k"]}
    start = {"x": (p["F_k"] + float(rng.uniform(-1.5, 1.5)) * p["V"]) / p["k"], "d_x": 0.0}
    brute = masses([p["m"]], [[p["k"]]], [[0.0]], [contact(0, p["V"], p["mu"], p["F_k"])])
    return point(system, p, start, brute, np.array([start["x"], 0.0]), period)


# -- the judge -------------------------------------------------------------------------------------


def measured(case: Case) -> dict[str, Any]:
    """What the library says of the point."""
    from stickslip.orbits.settling.motions import Settings
    from stickslip.sweeps.work.chunk import measure_chunk

    start, table = (
        {name: np.array([value]) for name, value in part.items()}
        for part in (case.initial, case.parameters)
    )
    found = measure_chunk(case.system, start, table, MEASURES, Settings())
    return {name: values[0].item() for name, values in found.items()}


def judge(case: Case) -> Verdict:
    """Measure the point, and hold what is certified against brute force."""
    from stickslip.sweeps.request.measures import MISSING

    try:
        found = measured(case)
    except ss.StickslipError as error:
        return Verdict(REFUSED, f"{type(error).__name__}: {str(error)[:80]}")
    outcome = ss.Outcome.from_code(found["outcome"])
    if outcome is ss.Outcome.OUTSIDE or case.excess > 0.0:
        right = (
            abs(found["excess"] - case.excess) <= 1e-9 * case.excess
            and outcome is ss.Outcome.OUTSIDE
        )
        return Verdict(
            AGREED if right else WRONG,
            outcome.label,
            {"excess": found["excess"], "expected": case.excess},
        )
    settled = settle(case.brute, case.start, case.mode, case.span, case.late)
    lacking = MISSING[found["lacking"]]
    numbers = found | {"settles": settled._asdict() if settled is not None else None}
    if lacking == "result":
        return Verdict(REFUSED, outcome.label, numbers)
    if lacking != "nothing":
        kind = settled.kind if settled is not None else "unknown"
        return Verdict(
            NOT_CERTIFIED, f"{outcome.label}, lacks {lacking}; brute force: {kind}", numbers
        )
    if settled is None:
        return Verdict(NO_REFERENCE, "events pile up", numbers)
    difference = compare(case, outcome, found, settled)
    if difference == "" or isinstance(difference, float):
        return Verdict(AGREED, settled.kind, {"difference": difference} if difference != "" else {})
    if settled.nearest < NEAR:
        return Verdict(NO_REFERENCE, "next to a period doubling", numbers)
    for brute, start in (
        (case.brute._replace(step=0.37 * case.brute.step), 0.0),
        (case.brute, 1e-9),
    ):
        y = case.start + start * np.max(np.abs(case.start)) * np.cos(np.arange(len(case.start)))
        again = settle(brute, case.start if start == 0.0 else y, case.mode, case.span, case.late)
        if again is None or again.kind != settled.kind or not _alike(again, settled):
            return Verdict(
                NO_REFERENCE, "it hangs by a thread", numbers | {"or": again and again._asdict()}
            )
    return Verdict(WRONG, str(difference), numbers)


def _alike(one: Settled, two: Settled) -> bool:
    return (
        abs(one.period - two.period) <= 1e-5 * two.period
        and abs(one.amplitude - two.amplitude) <= 1e-4 * two.size
    )


def compare(
    case: Case, outcome: ss.Outcome, found: dict[str, Any], settled: Settled
) -> str | float:
    """What differs, or by how much nothing does; empty where there is nothing to measure."""
    if outcome is ss.Outcome.UNDAMPED:
        return (
            ""
            if settled.kind in ("moves", "cycle") and case.family == "nothing damps it"
            else "called undamped"
        )
    said = {ss.Outcome.AT_REST: "rest", ss.Outcome.STEADY: "steady", ss.Outcome.PERIODIC: "cycle"}[
        outcome
    ]
    if said != settled.kind:
        return f"said {said}, brute force: {settled.kind}"
    if said != "cycle":
        return ""
    rounds = found["period"] / settled.period
    if abs(rounds - 1.0) > CLOSE:
        return (
            "another number of periods" if abs(rounds - round(rounds)) < CLOSE else "another period"
        )
    off = {
        "period": abs(rounds - 1.0),
        "amplitude": 0.0
        if case.drift
        else abs(found["amplitude"] - settled.amplitude) / settled.size,
        "stick_fraction": abs(found["stick_fraction"] - settled.stick),
        "energy_per_cycle": abs(found["energy_per_cycle"] - settled.work)
        / max(settled.work, 1e-300)
        if settled.work > 0.0
        else abs(found["energy_per_cycle"]),
    }
    worst = max(off, key=lambda name: off[name])
    return off[worst] if off[worst] <= 10.0 * CLOSE else f"another {worst}"


def reproduction(case: Case) -> str:
    """A script that repeats what the library did."""
    given = ", ".join(
        f"{{{', '.join(f'{n!r}: np.array([{float(v)!r}])' for n, v in part.items())}}}"
        for part in (case.initial, case.parameters)
    )
    return "\n".join(
        [
            "import numpy as np",
            "from stickslip.model.system_file import loads",
            "from stickslip import Settings",
            "from stickslip.sweeps.work.chunk import measure_chunk",
            f"system = loads({case.system.to_toml()!r}, 'system')",
            f"print(measure_chunk(system, {given}, {MEASURES!r}, Settings()))",
        ]
    )
