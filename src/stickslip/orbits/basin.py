"""Basins of attraction: which attractor each state of a section reaches.

All initial states are followed together in compiled batches. Attractors are not guessed from numbers of the motions:
rest is proved (or is an isolated stable equilibrium), and every other attractor is a cycle that Newton's method has
closed. An initial state belongs to the attractor on which its motion arrives; what has not arrived is followed longer.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from stickslip.equations.derive import MotionEquations, derive
from stickslip.errors import ConvergenceError, DeclarationError
from stickslip.motion.batch import run
from stickslip.motion.knots import Knots
from stickslip.motion.outcome import Outcome
from stickslip.motion.problem import Problem, pose
from stickslip.motion.rest import rests_forever
from stickslip.motion.simulate import simulate
from stickslip.orbits.cycles import Cycle, find_cycle
from stickslip.orbits.equilibria import equilibria
from stickslip.orbits.equilibrium import Equilibrium
from stickslip.orbits.nearness import NearCycle, NearPoint
from stickslip.orbits.regions import values_at
from stickslip.orbits.shooting import follow_freely
from stickslip.orbits.steady import invariant_directions
from stickslip.orbits.symmetry import clock
from stickslip.quantities import drift_units, quantity
from stickslip.system import System

if TYPE_CHECKING:
    import xarray

    from stickslip.motion.kernel import Lane

Array = np.ndarray
Axis = tuple[float, float, int] | Sequence[float] | np.ndarray

STOPPED, ON_ITS_WAY = -1, -2  # labels of motions that are on no attractor
ROUNDS = 6  # the time a motion is given to arrive doubles so many times
STILL = 1e-9  # change of a state, relative to the section, that is none
ARRIVED = 1e-3  # distance from an attractor, relative to its size, that counts as on it
MOST = 64  # attractors
TRIES = 4  # motions of a round that may lead to nothing new before the others are followed longer
SWEEPS = 100  # of the start of rate-independent coordinates
MAX_EVENTS = 1_000_000
MOST_STATES = 10**7  # of a section


@dataclass(frozen=True)
class Attractor:
    """Where motions end.

    Attributes
    ----------
    kind : str
        ``"rest"`` (every contact sticks for good, or nothing moves), ``"sliding"`` (steady), ``"cycle"`` or
        ``"walking"`` (a cycle with drift).
    state : dict of str to float
        One of its states.
    period, speed : float
        0 where there is none.
    extrema : dict of str to (float, float)
    certified : bool
    cycle : Cycle or None
    """

    kind: str
    state: dict[str, float]
    period: float = 0.0
    speed: float = 0.0
    extrema: dict[str, tuple[float, float]] = field(default_factory=dict)
    certified: bool = True
    cycle: Cycle | None = None


def basin(
    system: System,
    over: Mapping[str, Axis],
    parameters: Mapping[str, float] | None = None,
    *,
    initial: Mapping[str, float] | None = None,
    workers: int | None = None,
) -> xarray.Dataset:
    """Which attractor each state of a section of initial states reaches.

    Parameters
    ----------
    system : System
    over : mapping of str to (low, high, number) or 1-D array
        The states that vary, usually two.
    parameters : mapping of str to float, optional
        Values that replace the defaults.
    initial : mapping of str to float, optional
        Of the other states; by default the declared ones. A rate-independent coordinate that friction cannot hold
        there starts at the nearest place at which it can.
    workers : int, optional
        Threads; by default all cores. The result does not depend on it.

    Returns
    -------
    xarray.Dataset
        One dimension for each name in `over`: ``attractor``, a code with flag_meanings; negative where a motion stopped
        (−1) or did not arrive (−2). Dimension ``reached``: ``kind``, ``period``, ``speed``, ``share`` of the section,
        ``state_…`` of one state, ``low_…`` and ``high_…`` of each attractor, ``certified``.

    Raises
    ------
    DeclarationError
        If an argument is wrong.
    """
    problem = pose(system, parameters)
    axes = _axes(system, over)
    if workers is not None and workers < 1:
        raise DeclarationError("workers", f"{workers} is not a number of workers", "Give at least 1")
    if twice := [name for name in initial or {} if name in axes]:
        raise DeclarationError(f"initial.{twice[0]}", "it varies along an axis", "Give it once")
    mesh = np.meshgrid(*axes.values(), indexing="ij")
    states = np.tile(problem.initial_state(dict(initial or {})), (mesh[0].size, 1))
    for name, values in zip(axes, mesh, strict=True):
        states[:, system.declaration.state.index(name)] = values.ravel()
    equations = derive(system.declaration)
    settle_friction(equations, problem.parameters, states)
    search = _Search(problem, equations, states, workers or os.cpu_count() or 1)
    search.run()
    return _dataset(system, axes, search)


def _axes(system: System, over: Mapping[str, Axis]) -> dict[str, Array]:
    """Values of the states that vary."""
    axes = {}
    for name, given in over.items():
        if name not in system.declaration.state:
            raise DeclarationError(
                f"over.{name}", "not a state of the system", f"Choose from {', '.join(system.declaration.state)}"
            )
        try:
            if isinstance(given, tuple) and len(given) == 3 and isinstance(given[2], int):
                values = np.linspace(float(given[0]), float(given[1]), min(max(given[2], 0), MOST_STATES + 1))
            else:
                values = np.asarray(given, dtype=float)
        except (TypeError, ValueError):
            values = np.zeros(0)
        if values.ndim != 1 or len(values) < 2 or not np.all(np.diff(values) > 0.0) or not np.all(np.isfinite(values)):
            raise DeclarationError(f"over.{name}", f"{given!r} is no range", "Give (low, high, number), number >= 2")
        axes[name] = values
    if not axes:
        raise DeclarationError("over", "nothing varies", "Give ranges of one or two states")
    if math.prod(map(len, axes.values())) > MOST_STATES:
        raise DeclarationError("over", f"the section has more than {MOST_STATES:,} states", "Give fewer values")
    return axes


def settle_friction(equations: MotionEquations, values: Mapping[str, float], states: Array) -> None:
    """Move rate-independent coordinates, one after the other, until friction holds them; changes `states`.

    Each goes to the nearest place at which its own contact holds: descent, coordinate by coordinate, in the
    minimisation E(x) + Σ sᵢ|xᵢ − xᵢ⁰| that decides where such a system goes from a state it cannot rest in.
    """
    rate = equations.rate
    acting = [c for c in equations.contacts if c.kind == "rate-independent"]
    rows = [equations.declaration.state.index(next(iter(c.direction))) for c in acting]
    for _ in range(SWEEPS if acting else 0):
        moved = 0.0
        for i, (c, row) in enumerate(zip(acting, rows, strict=True)):
            wanted = [rate.force[i], c.plus, c.minus, rate.partial[i][i]]
            force, plus, minus, slope = values_at(equations, values, states, wanted)
            excess = np.maximum(force - minus, 0.0) + np.minimum(force + plus, 0.0)
            step = np.where(slope != 0.0, -excess / np.where(slope != 0.0, slope, 1.0), 0.0)
            states[:, row] += step
            moved = max(moved, float(np.max(np.abs(step)) / (1.0 + np.max(np.abs(states[:, row])))))
        if moved < 1e-15:
            return


class _Search:
    """Motions on their way, and the attractors found so far.

    Attributes
    ----------
    found : list of (Attractor, nearness or None)
        None: rest in stick, which is a set and is proved state by state.
    label : array of int, shape (motions,)
        Number of the attractor, or STOPPED, or ON_ITS_WAY.
    """

    def __init__(self, problem: Problem, equations: MotionEquations, states: Array, workers: int) -> None:
        self.problem, self.equations, self.states, self.workers = problem, equations, states.copy(), workers
        self.sizes = 0.5 * np.ptp(states, axis=0)
        self.time, end = problem.system.span
        self.span, self.period = end - self.time, self._drive()
        self.label = np.full(len(states), ON_ITS_WAY)
        self.found: list[tuple[Attractor, NearPoint | NearCycle | None]] = []
        self.interrupted = False

    def run(self) -> None:
        """Follow all motions until they have arrived; Ctrl-C keeps what has."""
        try:
            self._steady_states()
            for _ in range(ROUNDS):
                self._advance()
                self._recognise()
                if not np.any(self.label == ON_ITS_WAY):
                    return
                self.span *= 2.0
        except KeyboardInterrupt:
            self.interrupted = True

    def _recognise(self) -> None:
        """Give attractors to the motions that are on one, the known ones first."""
        for number in range(len(self.found)):
            self._assign(number)
        known = 0
        while known < TRIES and len(self.found) < MOST and len(going := np.flatnonzero(self.label == ON_ITS_WAY)):
            known += not self._new(going[len(going) * known // TRIES])

    def _drive(self) -> float | None:
        """Period of the drives, if there are any."""
        if not self.equations.timed:
            return None
        try:
            return clock(self.problem.system, self.equations, self.problem.parameters).period(self.problem.parameters)
        except DeclarationError:
            return None  # a load that only moves: autonomous in its frame

    def _steady_states(self) -> None:
        """Isolated equilibria that attract; those in stick are proved when they are reached."""
        if self.equations.timed:
            return
        values = self.problem.parameters
        for e in equilibria(self.problem.system, values):
            if isinstance(e, Equilibrium) and e.stable:
                state = np.array(list(e.state.values()))
                near = NearPoint(state, invariant_directions(self.equations, values, state), self.sizes)
                extrema = {name: (x, x) for name, x in e.state.items()}
                speed = _along(self.problem.system, e.drift)
                self.found.append((Attractor("sliding" if any(e.mode) else "rest", e.state, 0.0, speed, extrema), near))

    def _advance(self) -> None:
        """Follow all that have not arrived for a while (driven ones: for whole periods)."""
        going = np.flatnonzero(self.label == ON_ITS_WAY)
        span = self.span if self.period is None else self.period * np.ceil(self.span / self.period)
        table = np.tile(np.array(list(self.problem.parameters.values())), (len(going), 1))
        ends = self.time, self.time + span
        now, codes = run(self.problem, table, self.states[going], ends, MAX_EVENTS, self.workers)
        resting = self._resting(now, self.states[going])
        self.states[going], self.time = now.y, ends[1]
        stopped = codes != Outcome.FINISHED.code
        self.label[going[stopped]] = STOPPED
        at_rest = going[resting & ~stopped]
        if len(at_rest):
            self.label[at_rest] = self._rest(self.states[at_rest[0]])

    def _resting(self, now: Lane, before: Array) -> Array:
        """Which motions rest for good: by proof, or because they are where they were after a round in stick."""
        sticks = ~np.any(now.mode, axis=1) & (now.mode.shape[1] > 0)
        change = np.abs(now.y - before) <= STILL * np.maximum(self.sizes, np.abs(before))
        found = sticks & np.all(change, axis=1) & (now.counters[:, 1] == 0)
        known = set()
        for i in np.flatnonzero(sticks & ~found):
            mode = now.mode[i].tobytes() + now.reg[i].tobytes()
            if mode not in known:  # a motion in this mode makes the closed form that the proof needs
                known.add(mode)
                follow_freely(self.problem, self.time, self.time + self.span, now.y[i])
            found[i] = rests_forever(self.problem, Knots.single(self.time, now.y[i], now.mode[i], now.reg[i]))
        return found

    def _rest(self, state: Array) -> int:
        """Number of rest in stick, of which there is a set: one attractor."""
        known = [i for i, (_, near) in enumerate(self.found) if near is None]
        if known:
            return known[0]
        named = self._named(state)
        self.found.append((Attractor("rest", named, extrema={name: (x, x) for name, x in named.items()}), None))
        return len(self.found) - 1

    def _assign(self, number: int) -> None:
        """Give an attractor to the motions that are on it."""
        going, near = np.flatnonzero(self.label == ON_ITS_WAY), self.found[number][1]
        if near is not None and len(going):
            arrived = near.distance(self.states[going], self.time) < ARRIVED
            self.label[going[arrived]] = number

    def _new(self, motion: int) -> bool:
        """Find out where one of the motions goes; whether that was not known."""
        system, values = self.problem.system, self.problem.parameters
        ahead = simulate(system, (self.time, self.time + self.span), self._named(self.states[motion]), values)
        if ahead.outcome is Outcome.AT_REST:
            self.label[motion] = self._rest(ahead.knots.state[-1])
            return False
        try:
            cycle = find_cycle(system, ahead)
        except ConvergenceError:
            return False
        if not cycle.stable:
            return False
        for number, (_, near) in enumerate(self.found):
            if near is not None and near.distance(_state_of(cycle), cycle.time)[0] < ARRIVED:
                self.label[motion] = number
                return False
        kind = "walking" if cycle.drift else "cycle"
        certified = cycle.trajectory.certificate.ok
        found = Attractor(kind, cycle.state, cycle.period, cycle.speed, cycle.extrema, certified, cycle)
        self.found.append((found, NearCycle(cycle)))
        self.label[motion] = len(self.found) - 1
        self._assign(self.label[motion])
        return True

    def _named(self, state: Array) -> dict[str, float]:
        return dict(zip(self.problem.system.declaration.state, map(float, state), strict=True))


def _state_of(cycle: Cycle) -> Array:
    return np.array([list(cycle.state.values())])


def _along(system: System, drift: Mapping[str, float]) -> float:
    """Speed along the declared translation (its largest component, if none is declared)."""
    weights = {name: w for name, w in system.translation.items() if w}
    speeds = [drift[name] / weights[name] for name in weights if name in drift] or list(drift.values())
    return max(speeds, key=abs, default=0.0)


def _dataset(system: System, axes: Mapping[str, Array], search: _Search) -> xarray.Dataset:
    """The map and the table of what was reached, the largest basin first."""
    import xarray as xr

    counts = [int(np.sum(search.label == i)) for i in range(len(search.found))]
    order = [i for i in np.argsort(counts)[::-1] if counts[i]]
    reached = [search.found[i][0] for i in order]
    label = search.label.copy()
    for new, old in enumerate(order):
        label[search.label == old] = new
    names = [_title(a, reached) for a in reached]
    flags = {
        "long_name": "attractor reached",
        "flag_values": np.array([ON_ITS_WAY, STOPPED, *range(len(order))], np.int8),
        "flag_meanings": " ".join(["not_arrived", "stopped", *names]),
    }
    shape = tuple(map(len, axes.values()))
    data: dict[str, object] = {"attractor": (tuple(axes), label.astype(np.int8).reshape(shape), flags)}
    per = {
        "kind": [a.kind for a in reached],
        "period": [a.period for a in reached],
        "speed": [a.speed for a in reached],
        "share": [counts[i] / len(label) for i in order],
        "certified": [a.certified for a in reached],
    }
    for name in system.declaration.state:
        per[f"state_{name}"] = [a.state[name] for a in reached]
        for side, prefix in enumerate(("low", "high")):
            per[f"{prefix}_{name}"] = [a.extrema[name][side] for a in reached]
    data |= {name: ("reached", np.array(values), _attributes(system, name)) for name, values in per.items()}
    coordinates = {name: (name, values, quantity(system, name)) for name, values in axes.items()}
    attrs = {
        "title": system.title or system.name,
        "source": system.source,
        "time": search.time,
        "interrupted": int(search.interrupted),
    }
    return xr.Dataset(data, {**coordinates, "reached": names}, attrs)


def _attributes(system: System, name: str) -> dict[str, str]:
    """Units of a column of the table, where it has some."""
    kind, _, state = name.partition("_")
    if name == "period":
        return {"units": system.time_unit or "1"}
    if name == "speed":
        return {"units": drift_units(system, system.translation)[1]}
    return {"units": quantity(system, state)["units"]} if kind in ("state", "low", "high") else {}


def _title(attractor: Attractor, reached: Sequence[Attractor]) -> str:
    """Its kind, with a number if there are several."""
    same = [a for a in reached if a.kind == attractor.kind]
    return attractor.kind if len(same) == 1 else f"{attractor.kind}_{same.index(attractor) + 1}"
