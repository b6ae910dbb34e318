"""What a period of a motion amounts to: extremes, phases, time in stick and slip, energy by
contact, harmonics, means."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import AnyArray, Array
from stickslip.errors import DeclarationError, short
from stickslip.model.entries.keys import normal_force
from stickslip.model.entries.units import agree, factors
from stickslip.model.quantities import contact_key, described, formula_unit
from stickslip.model.system import System
from stickslip.motion.audit.observers import LASTED, Sums
from stickslip.motion.record.knots import IS_CLOSED, IS_OPEN
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.return_map.recurrence import modes_of_structures, segments
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.evaluator import evaluator
from stickslip.symbolic.formulas import Scope

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(20)
_PARTS = 16  # of the shortest wave that is looked for; a panel is at most one of them
_DOUBLINGS = 6
_SAMPLES = 16  # of a step, between which an unknown of a structure turns once at most
_SAMPLES_OF_ALL = 1000
_REFINED = 6  # times; a value beside an extremum is known to the square of that
_EXACT = 1e-13  # a change by less, relative to the largest value, is rounding


@dataclass(frozen=True)
class Phase:
    """A stretch of a cycle in one mode and region.

    Attributes
    ----------
    duration : float
    modes : dict of str to int
        By contact: 0 stick, +1 or −1 slip, 2 open, 3 closed without friction.
    region : tuple of int
        By kink of the formulas: 1 where its guard is ≥ 0.
    """

    duration: float
    modes: dict[str, int]
    region: tuple[int, ...]

    @property
    def sticks(self) -> bool:
        """Whether all contacts stick that are not open."""
        rests = {0, IS_CLOSED}
        found = set(self.modes.values())
        return bool(found & rests) and found <= {*rests, IS_OPEN}


@dataclass(frozen=True)
class ContactShare:
    """What a contact does in a period.

    Attributes
    ----------
    stick_time, slip_time : float
    dissipated : float
        Energy, without that of impacts.
    open_time : float
        Of a contact that can open; what is closed without friction slips.
    impact_loss : float
        Energy that all contacts lose in its impacts.
    """

    stick_time: float
    slip_time: float
    dissipated: float
    open_time: float = 0.0
    impact_loss: float = 0.0


def phases(motion: Trajectory) -> tuple[Phase, ...]:
    """The phases of a period; the one it starts in, which it also ends in, comes first as a
    whole."""
    k = motion.knots
    names = list(motion.system.contacts)
    mode = {name: motion.modes[contact_key(name)] for name in names}
    found = list[Phase]()
    for a, b in segments(motion):
        modes = {name: int(mode[name][a]) for name in names}
        phase = Phase(float(k.time[b] - k.time[a]), modes, tuple(map(int, k.region[a])))
        if found and (found[-1].modes, found[-1].region) == (phase.modes, phase.region):
            phase = Phase(found.pop().duration + phase.duration, modes, phase.region)
        found.append(phase)
    if len(found) > 1 and (found[0].modes, found[0].region) == (found[-1].modes, found[-1].region):
        whole = Phase(found[0].duration + found[-1].duration, found[0].modes, found[0].region)
        found = [whole, *found[1:-1]]
    return tuple(found)


def contact_shares(motion: Trajectory, sums: Sums) -> dict[str, ContactShare]:
    """Time and energy of every contact."""
    members = motion._problem.compiled.equations.members
    lasted = float(sums.total[LASTED])
    found = {
        contact.name: ContactShare(
            float(stick),
            lasted - float(stick),
            float(work) if len(own) == 1 or contact.opens else dissipated_by(motion, contact.name),
        )
        for own, stick, work in zip(members, sums.stick, sums.work, strict=True)
        for contact in own
    }
    for name, parts in motion.system.planes.items():
        own, *others = (found.pop(part) for part in parts)
        lost = own.dissipated + sum(other.dissipated for other in others)
        found[name] = replace(own, dissipated=lost)
    for name, sides in motion.system.constraints.items():
        for side in sides:
            found.pop(normal_force(side))
        found.setdefault(name, ContactShare(0.0, lasted, 0.0))
    impacts = motion.impacts
    for name in motion.system.unilateral:
        closed = found.pop(normal_force(name)).stick_time
        own = found.get(name, ContactShare(0.0, lasted, 0.0))
        lost = np.sum(
            np.asarray(impacts["energy"])[np.asarray(impacts["contact"]) == contact_key(name)]
        )
        found[name] = ContactShare(
            own.stick_time, closed - own.stick_time, own.dissipated, lasted - closed, float(lost)
        )
    return found


def dissipated_by(motion: Trajectory, name: str) -> float:
    """Energy that one of several contacts dissipates which slip as one, in a period."""
    key = contact_key(name)
    period = float(motion.knots.time[-1] - motion.knots.time[0])
    power, _ = mean(motion, f"friction_{key}*slip_speed_{key}")
    return -period * power


def weight(system: System, text: str, values: Mapping[str, float]) -> float:
    """A weight, given as a formula of the parameters.

    Raises
    ------
    DeclarationError
        If it is not a formula of the parameters, is not positive, or lacks the unit of a force.
    """
    where = f"weight {short(text)}"
    names = {name: ex.sym(name) for name in system.parameters}
    formula = Scope(names).parse(text, where)
    unit, force = factors(formula_unit(system, formula)), factors(_force_unit(system))
    if unit and force and not agree(unit, force):
        said = formula_unit(system, formula)
        raise DeclarationError(
            where, f"it is measured in {said}, a weight in {_force_unit(system)}", "Write it as m*g"
        )
    found = ex.evaluate(formula, values)
    if not found > 0.0:
        raise DeclarationError(where, f"it is {found:g}", "A weight is positive")
    return found


def _force_unit(system: System) -> str:
    return described(system, "peak_force").get("units", "1")


def harmonics(
    motion: Trajectory, shift: Array, order: int, names: Sequence[str] | None = None
) -> tuple[Array, float]:
    """The coefficients c of Re(c exp(2πi·order·t/T)) in the motion of a period, without the drift.

    c = (2/T) ∫ y exp(−2πi·order·t/T) dt.

    Parameters
    ----------
    motion : Trajectory
        One period.
    shift : array, shape (n,)
        Of what is asked for, in that period.
    order : int
    names : sequence of str, optional
        Parts of the state and friction forces; by default the whole state.

    Returns
    -------
    array of complex, shape (n,)
    float
        By how much the last halving has changed them, relative to the size of the motion.
    """
    period = float(motion.knots.time[-1] - motion.knots.time[0])
    start = float(motion.knots.time[0])

    def wave(times: Array, index: Array) -> tuple[Array, AnyArray]:
        if names is None:
            states = motion._states_at(times, index)
        else:
            traced = motion.trace(names, times, index)
            states = np.column_stack([traced[name] for name in names])
        home = states - np.outer((times - start) / period, shift)
        return home, 2.0 * np.exp(-2j * np.pi * order * times / period)

    if names is None and len(motion._problem.rows.bodies):
        found = _of_linear_pieces(motion, shift, order)
        if found is not None:
            return found
    return _averaged(motion, wave, order)


def _of_linear_pieces(motion: Trajectory, shift: Array, order: int) -> tuple[Array, float] | None:
    """The same of a motion whose pieces are linear, y' = A y + g(t), however fast its modes are;
    None if one is not.

    By parts, (iΩ − A) ∫ y exp(−iΩt) dt = ∫ g exp(−iΩt) dt − [y exp(−iΩt)] in each step, where g is
    as smooth as the loads are.
    """
    k, problem = motion.knots, motion._problem
    pieces = Pieces(problem.compiled.equations)
    p = np.array([motion.parameters[name] for name in motion.system.parameters])
    start, n = float(k.time[0]), k.state.shape[1]
    period = float(k.time[-1]) - start
    wave = 2.0 * np.pi * order / period
    fastest = max(wave, float(np.max(np.abs(problem.constants.omega), initial=0.0)))
    every = np.zeros((2, n), complex)  # with panels, and with half as long ones
    known = dict[int, Array]()
    for i in np.flatnonzero(np.diff(k.time) > 0.0):
        number = pieces.number(k.mode[i], k.region[i])
        piece = pieces.made[number]
        if not piece.constant:
            return None
        if number not in known:
            y = np.zeros(n)
            (J,) = piece.jacobian(k.time[i : i + 1], y[:, None], p)
            known[number] = np.linalg.inv(1j * wave * np.eye(n) - J[:, :n])
        a, b = float(k.time[i]), float(k.time[i + 1])
        ends = np.exp(-1j * wave * np.array([a, b]))
        jump = k.state[i + 1] * ends[1] - k.state[i] * ends[0]
        for m in range(2):
            count = (m + 1) * math.ceil(_PARTS * fastest * (b - a) / (2.0 * np.pi))
            width = (b - a) / count
            middle = a + (np.arange(count) + 0.5) * width
            times = (middle[:, None] + 0.5 * width * _NODES).ravel()
            weights = np.tile(0.5 * width * _WEIGHTS, count) * np.exp(-1j * wave * times)
            loads = piece.rates(times, np.zeros((n, len(times))), p)
            every[m] += known[number] @ (loads @ weights - jump)
    drift = shift / period * 1j * period / wave * np.exp(-1j * wave * start)
    found = 2.0 / period * (every - drift)
    size = np.max(np.abs(k.state), axis=0)
    for own in modes_of_structures(motion):
        size[own] = np.max(size[own])
    change = np.max(np.abs(found[1] - found[0]) / np.maximum(size, 1e-300))
    return found[1], float(change)


def extrema_of_unknowns(motion: Trajectory) -> dict[str, tuple[float, float]]:
    """Least and largest values of unknowns of structures over a motion: where their rates pass
    through zero, and at knots.

    Parameters
    ----------
    motion : Trajectory
    """
    k = motion.knots
    steps = np.flatnonzero(np.diff(k.time) > 0.0)
    if not motion.system.unknowns or not len(steps):
        return {}
    lengths = np.diff(k.time)[steps]
    counts = _SAMPLES + np.ceil(_SAMPLES_OF_ALL * lengths / np.sum(lengths)).astype(int)
    index = np.repeat(steps, counts)
    place = np.arange(len(index)) - np.repeat(np.cumsum(counts) - counts, counts)
    # both ends of each step
    times = k.time[index] + place * np.repeat(lengths / (counts - 1), counts)
    unknowns = motion.system.unknowns
    names = [name for name in unknowns if not name.startswith("d_")]
    component = {x: i for i, x in enumerate(motion.system.declaration.state)}
    rows = np.zeros((len(component), 2, len(names)))  # of the unknowns, and of their rates
    for i, name in enumerate(names):
        for k, of in enumerate((name, f"d_{name}")):
            for x, w in unknowns[of].items():
                rows[component[x], k, i] = w
    states = motion._states_at(times, index)
    seen, slopes = states @ rows[:, 0], states @ rows[:, 1]
    low, high = np.min(seen, axis=0), np.max(seen, axis=0)
    # every turn of each of them, between two samples of a step
    same = (np.diff(index) == 0)[:, None]
    at, which = np.nonzero((slopes[:-1] * slopes[1:] < 0.0) & same)
    a, b, f, g = times[at], times[at + 1], slopes[at, which], slopes[at + 1, which]
    for _ in range(_REFINED if len(at) else 0):
        middle = (a * g - b * f) / (g - f)
        states = motion._states_at(middle, index[at])
        value, h = np.einsum("tx,xkt->kt", states, rows[:, :, which])
        np.minimum.at(low, which, value)
        np.maximum.at(high, which, value)
        left = h * f > 0.0  # the turn is on the other side; what stays counts half (Illinois)
        a, f, g = np.where(left, middle, a), np.where(left, h, f / 2.0), np.where(left, g / 2.0, h)
        b = np.where(left, b, middle)
    ends = zip(map(float, low), map(float, high), strict=True)
    return dict(zip(names, ends, strict=True))


def mean(motion: Trajectory, formula: str) -> tuple[float, float]:
    """The mean of a formula over a period, (1/T) ∫ f dt, and by how much the last halving of the
    panels has changed it, relative to the largest value.

    Parameters
    ----------
    motion : Trajectory
        One period.
    formula : str
        Of what formulas may name, and of the rows of the motion.

    Raises
    ------
    DeclarationError
        If it is not a formula of these.
    """
    known = motion.system.plain.declaration.scope
    rows = {name: ex.sym(name) for name in motion._rows}
    scope = Scope({**rows, **known.names}, known.definitions, vectors=known.vectors)
    read = scope.parse(formula, "formula")
    names = sorted(read.symbols)
    for name in names:
        if name not in {"t", *rows, *motion.parameters}:
            raise DeclarationError(
                "formula",
                f"'{name}' has no value along a cycle",
                "Name the state, rates, forces, t",
            )
    value = evaluator([read], names)

    def along(times: Array, index: Array) -> tuple[Array, Array]:
        rows = motion._sample(times, index)
        values = {name: rows[:, row] for name, row in motion._rows.items()}
        values |= {name: np.full(len(times), v) for name, v in motion.parameters.items()}
        values["t"] = times
        table = np.array([values[name] for name in names]).reshape(len(names), len(times))
        return value(table).reshape(-1, 1) * np.ones((len(times), 1)), np.ones(len(times))

    found, change = _averaged(motion, along, 1)
    return float(found[0].real), change


def _averaged(
    motion: Trajectory, values: Callable[[Array, Array], tuple[Array, Array]], order: int
) -> tuple[Array, float]:
    """(1/T) ∫ f w dt over a period, and by how much the last halving of the panels has changed it,
    relative to the largest |f|.

    Gauss quadrature on the steps, each cut into panels until half as long ones change nothing.

    Parameters
    ----------
    motion : Trajectory
    values : callable
        Times, and steps in which they are -> f, shape (times, functions), and w, shape (times,).
    order : int
        Waves of w in a period.
    """
    k = motion.knots
    period = float(k.time[-1]) - float(k.time[0])
    steps = np.flatnonzero(np.diff(k.time) > 0.0)
    lengths = np.diff(k.time)[steps]
    counts = np.ceil(_PARTS * order * lengths / period).astype(int)
    found, change = np.full(1, np.nan + 0j), np.inf
    for _ in range(_DOUBLINGS):
        index = np.repeat(steps, counts)
        place = np.arange(len(index)) - np.repeat(np.cumsum(counts) - counts, counts)
        width = np.repeat(lengths / counts, counts)
        middle = k.time[index] + (place + 0.5) * width
        times = (middle[:, None] + 0.5 * width[:, None] * _NODES).ravel()
        weights = (0.5 * width[:, None] * _WEIGHTS).ravel()
        f, w = values(times, np.repeat(index, len(_NODES)))
        if not np.all(np.isfinite(f)):
            return np.full(f.shape[1], np.nan + 0j), np.inf
        before, found = found, 1.0 / period * (weights * w) @ f
        # Between knots a component may be much larger than at them.
        size = np.maximum(np.max(np.abs(f), axis=0), 1e-300)
        change = float(np.max(np.abs(found - before) / size))
        if change <= _EXACT:
            break
        counts = 2 * counts
    return found, change
