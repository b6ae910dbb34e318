"""Basins of attraction: which attractor each state of a section reaches.

A basin is a map over initial states (:mod:`stickslip.sweeps.sweep`), with a proof or certificate at
every point. The attractors are then classified. States of rest form sets, as do oscillations in
which a contact sticks permanently, since its position is arbitrary. Any other cycle is closed once
by Newton's method, which also gives its stability, and is assigned to all motions that have settled
on it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.equations.derive import derive
from stickslip.errors import ConvergenceError, DeclarationError, suggestion
from stickslip.kept import cached_property
from stickslip.model.quantities import drift_units, quantity
from stickslip.model.system import System
from stickslip.motion.outcome import Outcome
from stickslip.motion.problem import Problem, pose
from stickslip.motion.simulate import simulate, with_span
from stickslip.numerics.levels import TINIEST
from stickslip.orbits.cycles.cycle import Cycle
from stickslip.orbits.cycles.find_cycle import find_cycle
from stickslip.orbits.cycles.nearness import NearCycle, NearPoint
from stickslip.orbits.equilibria.equilibrium import Equilibrium
from stickslip.orbits.equilibria.finding import equilibria
from stickslip.orbits.fields.steady import invariant_directions
from stickslip.progress import reporting
from stickslip.stopping.scopes import check_limit, watching
from stickslip.sweeps.map import Basin
from stickslip.sweeps.request.axes import Axis, read_axes
from stickslip.sweeps.request.measures import MISSING, ends_with_samples
from stickslip.sweeps.request.plan import Plan
from stickslip.sweeps.request.user_measures import variable
from stickslip.sweeps.store import MapStore, create
from stickslip.sweeps.sweep import Progress, checked_start, compute_missing
from stickslip.sweeps.work.scheduler import Pool

if TYPE_CHECKING:
    import xarray

    from stickslip.orbits.settling.motions import Settings

_STOPPED = -1  # labels of motions that are on no attractor
ON_ITS_WAY = -2  # neither irregular nor slow within the computed time
UNDAMPED = -3
PARTING = -4
SLOWLY = -5
_NOT_COMPUTED = -6
ON_NONE = {
    _NOT_COMPUTED: "not computed",
    SLOWLY: Outcome.SLOW.label,
    PARTING: Outcome.IRREGULAR.label,
    UNDAMPED: Outcome.UNDAMPED.label,
    ON_ITS_WAY: Outcome.NOT_SETTLED.label,
    _STOPPED: "stopped",
}
"""What is said of motions that are on no attractor, by label."""
_ARRIVED = 1e-3  # distance from an attractor, relative to its size, that counts as on it
_SAME = 1e-6  # relative difference of periods, and of ranges, that counts as zero
_LONG_ENOUGH = 6.0  # number of periods after which Newton's method finds that a motion repeats
_MOST = 64  # largest number of attractors
_MOST_STATES = 10**7  # largest number of states of a section
_COMPONENTS = ("state", "low", "high", "shift")  # measures of every component of the state


@dataclass(frozen=True)
class Attractor:
    """An attractor.

    Attributes
    ----------
    kind : str
        ``"rest"`` (every contact sticks for good and nothing moves, or an equilibrium without
        slip), ``"sliding"`` (steady), ``"oscillation"`` (every contact sticks for good, and a drive
        moves the rest), ``"cycle"`` or ``"walking"`` (a cycle with drift).
    state : dict of str to float
        One of its states.
    period, speed : float
        0 if there is none.
    certified : bool
        Whether every motion that reached it is certified, and its cycle, if it has one.
    family : bool
        Whether it belongs to a continuous family: contacts that stick permanently may do so at many
        positions.
    stability : str
        Stability of an isolated equilibrium or a cycle, from its eigenvalues or multipliers; empty
        if these are inconclusive.
    cycle : Cycle or None
        The cycle closed by Newton's method; None if there is none, or it did not converge.
    """

    kind: str
    state: dict[str, float]
    period: float = 0.0
    speed: float = 0.0
    extrema: dict[str, tuple[float, float]] = field(default_factory=dict[str, tuple[float, float]])
    certified: bool = True
    family: bool = False
    stability: str = ""
    cycle: Cycle | None = None


@dataclass(frozen=True)
class SettledMotions:
    """Attractors reached, by motion.

    Attributes
    ----------
    outcome, lacking : arrays of int, shape (motions,)
    time, period : arrays, shape (motions,)
        Time of the state, and time after which it recurs.
    state, low, high, shift : arrays, shape (motions, n)
    stuck : array of bool, shape (motions, contacts)
        Contacts that stick throughout.
    switches : array of int, shape (motions,)
    """

    outcome: Array
    lacking: Array
    time: Array
    period: Array
    state: Array
    low: Array
    high: Array
    shift: Array
    stuck: Array
    switches: Array


@validated
def basin(
    system: System,
    over: Mapping[str, Any] | Sequence[str],
    *,
    initial: Mapping[str, float] | None = None,
    parameters: Mapping[str, float] | None = None,
    span: tuple[float, float] | None = None,
    settings: Settings | None = None,
    workers: int | None = None,
    time_limit: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> Basin:
    """Compute the attractor that each state of a section of initial states reaches.

    Parameters
    ----------
    system : System
    over : mapping of str to axis
        The initial values that vary, usually two, as for :func:`stickslip.sweep`: ``{"psi":
        "-2:2:80", "d_psi": "-3:3:80"}``, or arrays of values. Degrees of freedom of structures,
        such as ``"u[tip]"``, may vary, too.
    initial : mapping of str to float, optional
        Initial values of the other states; by default the declared ones. A rate-independent
        coordinate outside the stable set starts at the nearest stable value.
    parameters : mapping of str to float, optional
        Values that replace the defaults.
    span : (float, float), optional
        Time span that replaces the span of the system: motions start at its beginning, and are
        abandoned after 100 times its length.
    settings : Settings, optional
        Criteria of convergence, and the accuracy.
    workers : int, optional
        Number of threads; by default all cores. The result does not depend on it.
    time_limit : float, optional
        Processor-time limit of a motion in seconds; a motion that exceeds it counts as stopped.
    progress : callable, optional
        Called repeatedly with the completed fraction.

    Returns
    -------
    Basin
        Its dataset has one dimension for each name in `over`: ``attractor``, a code with
        flag_meanings; negative where a motion stopped (−1), spent its budget (−2), is undamped
        (−3), irregular (−4), slow (−5), or was not computed (−6); and ``lacking``, the failed
        criterion of the certificate of each motion. Dimension ``reached``: ``kind``, ``period``,
        ``speed``, ``share`` of the section, ``state_…`` of one state, ``low_…`` and ``high_…`` of
        each attractor, ``certified``, ``stability`` of a cycle, and whether it is one of a
        ``family``.

    Raises
    ------
    DeclarationError
        If an argument is wrong.
    """
    from stickslip.orbits.settling.motions import Settings

    settings = settings or Settings()
    check_limit(time_limit)
    system = with_span(system, span)
    if ends_with_samples(system):
        raise DeclarationError(
            "basin",
            f"the samples that drive {system.name} end, so no motion settles",
            "Declare the samples periodic, or use ss.sweep to measure the motion over their span",
        )
    problem = pose(system, parameters, settings.rtol, settings.atol, origin=system.span[0])
    axes = _axes(system, over)
    varying = {axis.dimension: axis.values[0] for axis in axes}
    given = checked_start(system, initial or {}, [*varying])
    plan = Plan(
        system.with_parameters(**problem.parameters),
        axes,
        _measures(problem),
        given,
        settings,
        0,
        section=True,
    )
    store = create(plan, None)
    with reporting(progress, f"basin of {system.name}") as show:

        def share(state: Progress) -> None:
            show(state.done / state.total)

        pool = Pool("threads", workers)
        interrupted = not compute_missing(store, pool, None, share, time_limit=time_limit)
    data = _classified(problem, store, varying, interrupted)
    return Basin(system, dict(problem.parameters), data)


def _measures(problem: Problem) -> tuple[str, ...]:
    """Measures that distinguish attractors."""
    return (
        *("time", "duration", "switches"),
        *(f"{name}:{x}" for name in _COMPONENTS for x in problem.system.declaration.state),
        *dict.fromkeys(f"stick_fraction:{contact}" for contact in _contacts(problem)),
    )


def _contacts(problem: Problem) -> list[str]:
    """A name for each contact of the engine: the one that was declared, if it has one."""
    named = {part: name for name, parts in problem.system.frictional.items() for part in parts}
    members = problem.compiled.equations.members
    return [named.get(own[0].name, own[0].name) for own in members]


def _classified(
    problem: Problem, store: MapStore, varying: dict[str, Array], interrupted: bool
) -> xarray.Dataset:
    """The dataset of a basin: the attractor of each computed motion of a map."""
    system = problem.system
    done = store.outcome.ravel() >= 0
    label = np.full(done.size, _NOT_COMPUTED)
    lacks = np.full(done.size, MISSING.index("result"))
    reached = []
    if np.any(done):
        found = _settled(problem, store, done)
        # An unknown of a structure moves several states, each in proportion to its slope.
        sizes = np.zeros(len(system.declaration.state))
        for name, values in varying.items():
            for x, slope in system.start_slope(name).items():
                sizes[system.declaration.places[x]] += 0.5 * np.ptp(values) * abs(slope)
        with watching():  # an interrupt ends the complete classification
            classes = _Classification(problem, found, sizes)
        label[done], reached = classes.label, classes.reached
        lacks[done] = found.lacking
    return _dataset(system, varying, label, reached, lacks, interrupted)


def _settled(problem: Problem, store: MapStore, done: Array) -> SettledMotions:
    """Attractors of the motions at the computed points of a map."""
    state = problem.system.declaration.state
    contacts = _contacts(problem)

    def column(name: str) -> Array:
        return store.whole(name).ravel()[done]

    def table(name: str, of: Sequence[str]) -> Array:
        columns = [column(variable(f"{name}:{x}")) for x in of]
        return np.column_stack(columns) if columns else np.zeros((int(np.sum(done)), 0))

    states, low, high, shift = (table(name, state) for name in _COMPONENTS)
    stuck = table("stick_fraction", contacts) >= 1.0
    return SettledMotions(
        column("outcome"),
        column("lacking"),
        column("time"),
        column("duration"),
        states,
        low,
        high,
        shift,
        stuck,
        column("switches"),
    )


def _axes(system: System, over: Mapping[str, Any] | Sequence[str]) -> tuple[Axis, ...]:
    """Values of the states that vary."""
    axes = read_axes(system, over, known=system.starts)
    for axis in axes:
        (name, *others) = axis.names
        where = f"over.{','.join(axis.names)}"
        if others or not system.start_slope(name, "over"):
            known = suggestion(axis.dimension, system.starts)
            raise DeclarationError(where, "not a state of the system", known)
        if len(axis) < 2 or not np.all(np.diff(axis.values[0]) > 0.0):
            raise DeclarationError(
                where,
                "its values do not increase",
                "Give at least two increasing values, as in -2:2:80",
            )
    if math.prod(map(len, axes)) > _MOST_STATES:
        raise DeclarationError(
            "over", f"the section has more than {_MOST_STATES:,} states", "Use fewer values"
        )
    return axes


class _Classification:
    """Classification of motions by their attractors.

    Attributes
    ----------
    label : array of int, shape (motions,)
        Number of the attractor, the most often reached first, or one of :data:`ON_NONE`.
    reached : list of (Attractor, int)
        With the number of motions.
    """

    def __init__(self, problem: Problem, found: SettledMotions, sizes: Array) -> None:
        self.problem = problem
        self.found = found
        self.sizes = sizes
        self.equations = derive(problem.system.declaration)
        groups = [*self._rest(), *self._steady(), *self._families(), *self._cycles()]
        groups.sort(key=lambda group: -len(group[1]))
        self.label = np.full(len(found.outcome), _STOPPED)
        self.label[np.isin(found.outcome, [Outcome.NOT_SETTLED.code, Outcome.PERIODIC.code])] = (
            ON_ITS_WAY
        )
        for kind, own in (
            (Outcome.UNDAMPED, UNDAMPED),
            (Outcome.IRREGULAR, PARTING),
            (Outcome.SLOW, SLOWLY),
        ):
            self.label[found.outcome == kind.code] = own
        for number, (_, members) in enumerate(groups):
            self.label[members] = number
        self.reached = [(attractor, len(members)) for attractor, members in groups]

    def _of(self, outcome: Outcome) -> Array:
        return np.flatnonzero(self.found.outcome == outcome.code)

    def _rest(self) -> Iterator[tuple[Attractor, Array]]:
        """Rest in stick, of which there is a set: one attractor."""
        members = self._of(Outcome.AT_REST)
        if len(members):
            yield self._attractor("rest", members), members

    def _steady(self) -> Iterator[tuple[Attractor, Array]]:
        """Equilibria, and steady sliding."""
        left = self._of(Outcome.STEADY)
        f = self.found
        while len(left):
            state = f.state[left[0]]
            near = (
                NearPoint(state, self._invariant(state), self.sizes).distance(f.state[left])
                < _ARRIVED
            )
            near[0] = True
            slips = f.stuck.shape[1] > 0 and not np.all(f.stuck[left[0]])
            found = self._attractor("sliding" if slips else "rest", left[near])
            yield replace(found, stability=self._stability(state)), left[near]
            left = left[~near]

    def _stability(self, state: Array) -> str:
        """Stability of the isolated equilibrium near a state."""
        for e in self._equilibria:
            near = NearPoint(np.array(list(e.state.values())), self._invariant(state), self.sizes)
            if e.stable is not None and near.distance(state[None])[0] < _ARRIVED:
                return "stable" if e.stable else "unstable"
        return ""

    @cached_property
    def _equilibria(self) -> list[Equilibrium]:
        if self.equations.timed:
            return []
        return [
            e
            for e in equilibria(self.problem.system, parameters=self.problem.parameters)
            if isinstance(e, Equilibrium)
        ]

    def _invariant(self, state: Array) -> Array:
        return invariant_directions(self.equations, self.problem.parameters, state)

    def _families(self) -> Iterator[tuple[Attractor, Array]]:
        """Cycles with permanently sticking contacts: each family of cycles, with the same sticking
        contacts, is one attractor."""
        f = self.found
        left = self._of(Outcome.PERIODIC)
        left = left[np.any(f.stuck[left], axis=1)]
        while len(left):
            first = left[0]
            same = np.all(f.stuck[left] == f.stuck[first], axis=1) & (
                f.switches[left] == f.switches[first]
            )
            same &= np.abs(f.period[left] - f.period[first]) <= _SAME * f.period[first]
            kind = "oscillation" if np.all(f.stuck[first]) else self._kind(first)
            yield self._attractor(kind, left[same], family=True), left[same]
            left = left[~same]

    def _cycles(self) -> Iterator[tuple[Attractor, Array]]:
        """All other cycles."""
        f = self.found
        left = self._of(Outcome.PERIODIC)
        left = left[~np.any(f.stuck[left], axis=1)]
        for _ in range(_MOST):
            if not len(left):
                return
            first = left[0]
            # Newton's method once per attractor; other motions are compared with the closed cycle.
            cycle = self._closed(first)
            near = np.abs(f.period[left] - f.period[first]) <= _SAME * f.period[first]
            if cycle is not None:
                near[near] = (
                    NearCycle(cycle).distance(f.state[left[near]], f.time[left[near]]) < _ARRIVED
                )
            else:
                span = np.maximum(f.high[first] - f.low[first], TINIEST)
                ends = np.maximum(
                    np.abs(f.low[left] - f.low[first]), np.abs(f.high[left] - f.high[first])
                )
                near &= np.all((ends <= _SAME * span) | (f.shift[first] != 0.0), axis=1)
            near[0] = True
            yield self._attractor(self._kind(first), left[near], cycle=cycle), left[near]
            left = left[~near]

    def _closed(self, motion: int) -> Cycle | None:
        """The cycle of a motion by Newton's method, if it is the same cycle."""
        f = self.found
        system = self.problem.system
        values = self.problem.parameters
        start, period = float(f.time[motion]), float(f.period[motion])
        try:
            ahead = simulate(
                system,
                (start, start + _LONG_ENOUGH * period),
                initial=self._named(f.state[motion]),
                parameters=values,
            )
            cycle = find_cycle(system, ahead)
        except (ConvergenceError, DeclarationError):
            return None
        return cycle if abs(cycle.period - period) <= _SAME * period else None

    def _kind(self, motion: int) -> str:
        return "walking" if self._speed(motion) else "cycle"

    def _speed(self, motion: int) -> float:
        """Speed of the drift (its largest component); 0 if it is a rounding error."""
        f = self.found
        shift = f.shift[motion]
        size = np.maximum(np.abs(f.low[motion]), np.abs(f.high[motion]))
        drift = dict(
            zip(self.problem.system.declaration.state, shift / f.period[motion], strict=True)
        )
        return _along(self.problem.system, drift) if np.any(np.abs(shift) > _SAME * size) else 0.0

    def _attractor(
        self, kind: str, members: Array, family: bool = False, cycle: Cycle | None = None
    ) -> Attractor:
        """The attractor of some motions that have settled on the same."""
        f = self.found
        first = members[0]
        moves = kind in ("cycle", "walking", "oscillation")
        low, high = self._named(f.low[first]), self._named(f.high[first])
        return Attractor(
            kind,
            self._named(f.state[first]),
            float(f.period[first]) if moves else 0.0,
            self._speed(first) if kind in ("walking", "sliding") else 0.0,
            cycle.extrema if cycle else {name: (low[name], high[name]) for name in low},
            not np.any(f.lacking[members]) and (cycle is None or cycle.trajectory.certificate.ok),
            family,
            cycle.stability if cycle else "",
            cycle,
        )

    def _named(self, state: Array) -> dict[str, float]:
        return dict(zip(self.problem.system.declaration.state, map(float, state), strict=True))


def _along(system: System, drift: Mapping[str, float]) -> float:
    """Speed along the declared translation (its largest component, if none is declared)."""
    weights = {name: w for name, w in system.plain.translation.items() if w}
    speeds = [drift[name] / weights[name] for name in weights if name in drift] or list(
        drift.values()
    )
    return float(max(speeds, key=abs, default=0.0))


def _dataset(
    system: System,
    axes: Mapping[str, Array],
    label: Array,
    found: Sequence[tuple[Attractor, int]],
    lacks: Array,
    interrupted: bool,
) -> xarray.Dataset:
    """The map and the table of attractors, the largest basin first."""
    import xarray as xr

    reached = [attractor for attractor, _ in found]
    names = [_title(a, reached) for a in reached]
    nowhere = [said.replace(" ", "_") for said in ON_NONE.values()]
    flags = {
        "long_name": "attractor reached",
        "flag_values": np.array([*ON_NONE, *range(len(reached))], np.int8),
        "flag_meanings": " ".join([*nowhere, *names]),
    }
    lacked = {
        "long_name": "failed criterion of the certificate",
        "flag_values": np.arange(len(MISSING), dtype=np.int8),
        "flag_meanings": " ".join(text.replace(" ", "_") for text in MISSING),
    }
    shape = tuple(map(len, axes.values()))
    data: dict[str, object] = {
        "attractor": (tuple(axes), label.astype(np.int8).reshape(shape), flags),
        "lacking": (tuple(axes), lacks.astype(np.int8).reshape(shape), lacked),
    }
    per = {
        "kind": [a.kind for a in reached],
        "period": [a.period for a in reached],
        "speed": [a.speed for a in reached],
        "share": [count / len(label) for _, count in found],
        "certified": [a.certified for a in reached],
        "stability": [a.stability for a in reached],
        "family": [a.family for a in reached],
    }
    for name in system.declaration.state:
        per[f"state_{name}"] = [a.state[name] for a in reached]
        for side, prefix in enumerate(("low", "high")):
            per[f"{prefix}_{name}"] = [a.extrema[name][side] for a in reached]
    data |= {
        name: ("reached", np.array(values), _attributes(system, name))
        for name, values in per.items()
    }
    coordinates = {name: (name, values, quantity(system, name)) for name, values in axes.items()}
    attrs = {
        "title": system.title or system.name,
        "source": system.source,
        "interrupted": int(interrupted),
    }
    return xr.Dataset(data, {**coordinates, "reached": names}, attrs)


def _attributes(system: System, name: str) -> dict[str, str]:
    """Units of a column of the table, if it has any."""
    kind, _, state = name.partition("_")
    if name == "period":
        return {"units": system.time_unit or "1"}
    if name == "speed":
        return {"units": drift_units(system, system.plain.translation)[1]}
    if kind not in ("state", "low", "high"):
        return {}
    return {"units": unit} if (unit := quantity(system, state).get("units")) else {}


def _title(attractor: Attractor, reached: Sequence[Attractor]) -> str:
    """Kind of an attractor, with a number if there are several."""
    same = [a for a in reached if a.kind == attractor.kind]
    return attractor.kind if len(same) == 1 else f"{attractor.kind}_{same.index(attractor) + 1}"
