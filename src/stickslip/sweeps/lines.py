"""Frequency response: lines of cycles over the frequency of a drive, one for each level of another
parameter.

A line is a branch of cycles, stable or not, with its folds
(:func:`~stickslip.orbits.branches.cycle_branch.continue_cycle`). Where lines begin is what sweeps
tell that carry the state up and down: whatever these have settled on that is on no line yet begins
another one. So where the damper never slips is a part of a line, and a line that is apart from the
others is found if a sweep meets it.

With x(t) = Re(X exp(iωt)) + … and a drive Re(G exp(iωt)) + … the phase is that of X/G, negative if
the coordinate lags behind.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import count, pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.certificates import NOTHING, Certificate, Residual, worst
from stickslip.equations.derive import derive
from stickslip.errors import ConvergenceError, DeclarationError, listing, short, suggestion
from stickslip.kept import cached_property
from stickslip.model.quantities import ENERGIES, contact_key, described, described_as, quantity
from stickslip.model.system import Output, System
from stickslip.motion.between.formulas import read_formula
from stickslip.motion.problem import pose
from stickslip.numerics.levels import COMPUTED_ZERO, HARMONICS_KNOWN
from stickslip.orbits.branches.cycle_branch import continue_cycle
from stickslip.orbits.branches.equilibrium_branch import checked_range
from stickslip.orbits.continuation.branch import Branch, SpecialPoint
from stickslip.orbits.continuation.path import StepControl, Stop
from stickslip.orbits.cycles.cycle import Cycle, find_cycle, make_cycle
from stickslip.orbits.cycles.drive_phase import phase_of_drive, read_drive, relative_phase
from stickslip.orbits.cycles.finding import from_state
from stickslip.orbits.equilibria.finding import checked_values
from stickslip.orbits.fields.clock import Clock, clock
from stickslip.orbits.return_map.recurrence import SHORTEST
from stickslip.progress import Show, watched
from stickslip.stopping.scopes import TimeUp, heed, limited
from stickslip.sweeps.carried import carried, moved
from stickslip.sweeps.request.axes import read_axes
from stickslip.sweeps.response import FrequencyResponse
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.functions import FUNCTIONS

if TYPE_CHECKING:
    import xarray

_COLUMNS = ("line", "amplitude", "harmonic", "phase", "stick", "period", "stable", "slips")
_DIRECTIONS = ("up", "down")
_SAME = 1e-7  # measures that differ by less, relative to the largest response, are the same
_APART = 0.5  # what is this far from a line, relative to the step of the line there, may be on it
_BETWEEN = 5  # largest responses between two levels
_FIRST = 0.004  # part of the range in which a largest response is looked for at first
_PEAK = 1e-6  # to which the frequency of a largest response is known; the response to its square


@validated
def frequency_response(
    system: System,
    parameter: str,
    span: tuple[float, float],
    *,
    levels: Mapping[str, Any] | Sequence[str] | None = None,
    of: str | None = None,
    drive: str | None = None,
    parameters: Mapping[str, float] | None = None,
    initial: Mapping[str, float] | None = None,
    points: int = 25,
    steps: StepControl | None = None,
    time_limit: float | None = None,
) -> FrequencyResponse:
    """Compute the response of a system to a drive over the frequency of the drive.

    Parameters
    ----------
    system : System
    parameter : str
        The parameter on which the period of the drive depends, such as ``"omega"``.
    span : (float, float)
        Its range.
    levels : mapping or sequence of str, optional
        One other parameter and its values, in the notation of the axes of maps: ``{"F": [0.1,
        0.2]}``, ``{"F": "log:0.1:10:5"}``, ``["F=0.1:0.5:3"]``. By default a single line.
    of : str, optional
        Quantity of the response: a coordinate, a degree of freedom of a structure, such as
        ``"u[tip]"``, an output, or a formula of quantities of results, such as ``"u[tip] -
        u[root]"`` or ``"friction_damper"``; by default the first inertial coordinate, or the first
        one.
    drive : str, optional
        Reference of the phases: a drive of the system, or a formula of ``t``. By default the only
        drive, or the force on the coordinate; for other quantities, the only force that depends on
        time.
    parameters : mapping of str to float, optional
        Values of the others.
    initial : mapping of str to float, optional
        Initial state of the sweeps; by default the declared one.
    points : int
        Number of points of a sweep over the range.
    steps : StepControl, optional
        Step control along the lines.
    time_limit : float, optional
        Wall-clock limit in seconds; the response found so far is returned.

    Returns
    -------
    FrequencyResponse
        Every point is a certified cycle. Cycles that are neither reached by a sweep nor connected
        to a line are not found.

    Raises
    ------
    DeclarationError
        If an argument is wrong, or the period of the drives does not depend on the parameter.
    """
    fixed = checked_values(system, parameters)
    if parameter not in system.parameters:
        known = suggestion(parameter, system.parameters)
        raise DeclarationError(parameter, f"unknown parameter of {system.name}", known)
    low, high = checked_range(system, parameter, span)
    level, values = _levels(system, parameter, levels)
    if not isinstance(points, int) or points < 2:
        raise DeclarationError("points", f"{points!r} is not a number of points", "Give at least 2")
    levels_given = [{level: value} for value in values] or [{}]

    def at_first(name: str, text: str, formula: Expr) -> _Level:
        return _Level(
            system, parameter, (low, high), name, text, formula, {**fixed, **levels_given[0]}
        )

    def answers(name: str) -> None:
        """Refuse a quantity that does not repeat, or has no phase."""
        _check_periodic(system, name)
        at_first(name, *read_drive(system, name, drive)).check_phase()

    at_first("", "", ex.ZERO).check_frequency()
    with listing(answers):
        with_output, followed = _followed(system, of)
    text, formula = read_drive(with_output, followed, drive)
    wanted = [
        _Level(with_output, parameter, (low, high), followed, text, formula, {**fixed, **one})
        for one in levels_given
    ]
    for one in wanted:
        one.check_frequency()
        one.check_phase()
    found = list[_Lines]()
    ended: BaseException | None = None
    what = f"a response of {system.name}"
    with limited(time_limit, what) as scope, watched("frequency response") as show:
        try:
            for i, one in enumerate(wanted):
                found.append(_Lines(one, np.linspace(low, high, points)))
                _follow(found[-1], initial, steps, _part(show, i, len(wanted)))
        except (KeyboardInterrupt, TimeUp) as why:
            found = [one for one in found if any(one.met.values())]
            if not found or not scope.ends(why):
                raise
            ended = why
    return _response(system, fixed, level, found, ended)


def _followed(system: System, of: str | None) -> tuple[System, str]:
    """The name whose response it is, and the system with a formula as an output of that name.

    Raises
    ------
    DeclarationError
        If it is neither a name nor a formula of what results show, or does not repeat with the
        motion.
    """
    of = _first(system) if of is None else of
    if of in system.followed:
        return system, of
    _check_periodic(system, of)
    taken = {*system.outputs, *system.declaration.results.names}
    taken |= system.declaration.results.definitions.keys()
    name = next(n for n in (f"response_{i}" for i in count(1)) if n not in taken)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # its doubts are those of the system, which has said them
        return replace(system, outputs={**system.outputs, name: Output(of, meaning=of)}), name


def _check_periodic(system: System, of: str) -> None:
    """Refuse a formula that does not repeat with the motion."""
    if of in system.followed:
        return
    formula = read_formula(system, of, "of")
    if formula.symbols & {*ENERGIES} - {"energy"} or _grows(formula):
        raise DeclarationError(
            "of",
            f"'{short(of)}' is not periodic",
            "Time may appear inside periodic functions; energies that add up may not appear",
        )


def _grows(e: Expr) -> bool:
    """Whether time appears in a formula outside of all functions."""
    if e.op == "sym":
        return e == ex.sym("t")
    if e.op in FUNCTIONS:
        return False
    return any(_grows(part) for part in (*e.args, *(term for term, _ in e.terms)))


def _first(system: System) -> str:
    """The first inertial coordinate, or the first one."""
    first = [x for x in system.declaration.inertial if x in system.coordinates]
    return [*first, *system.places, *system.internal][0]


def _levels(
    system: System, parameter: str, levels: Mapping[str, Any] | Sequence[str] | None
) -> tuple[str, list[float]]:
    """Name and values of the levels; no name if there are none."""
    if not levels:
        return "", []
    try:
        axes = read_axes(system, levels, known=[x for x in system.parameters if x != parameter])
    except DeclarationError as error:
        where = error.where.replace("over", "levels", 1)
        raise DeclarationError(where, error.reason, error.remedy) from None
    names = [name for axis in axes for name in axis.names]
    if len(names) != 1 or names[0] not in system.parameters or names[0] == parameter:
        raise DeclarationError(
            "levels", f"{', '.join(names)} cannot be a level", "Give one parameter, as in F=0.1,0.2"
        )
    return names[0], axes[0].values[0].tolist()


def _part(show: Show, index: int, count: int) -> Callable[[float, str], None]:
    """Shows how much of a level is done."""
    return lambda fraction, text: show((index + fraction) / count, text)


@dataclass(frozen=True)
class _Level:
    """What is asked at one level.

    Attributes
    ----------
    system, parameter, span
        As of :func:`frequency_response`; of a formula, the system has it as an output.
    coordinate : str
        Whose response it is.
    text, drive : str and Expr
        What phases are relative to.
    fixed : dict of str to float
        All parameters but the frequency.
    """

    system: System
    parameter: str
    span: tuple[float, float]
    coordinate: str
    text: str
    drive: Expr
    fixed: dict[str, float]

    @cached_property
    def told_by(self) -> str:
        """What tells cycles apart: a place, since an output may be the same for all."""
        first = _first(self.system)
        places = [x for x in (self.coordinate, first) if x in self.system.places]
        return [*places, self.coordinate][0]

    @cached_property
    def clock(self) -> Clock:
        """What the drives repeat after."""
        values = {**self.fixed, self.parameter: self.span[1]}
        return clock(self.system, derive(self.system.declaration), values)

    def check_frequency(self) -> None:
        """See that there is a drive whose period the parameter changes.

        Raises
        ------
        DeclarationError
            If there is none.
        """
        if not derive(self.system.declaration).timed:
            raise DeclarationError(
                self.system.name, "the system has no drive", "Add a drive, such as F*cos(omega*t)"
            )
        for end in self.span:
            pose(self.system, {**self.fixed, self.parameter: end})
        ends = [{**self.fixed, self.parameter: end} for end in self.span]
        rates = [self.clock.rate(values) for values in ends]
        if not rates[0] * rates[1] > 0.0:
            raise DeclarationError(
                self.parameter, "the frequency is zero within its range", "Exclude this value"
            )
        low, high = map(self.clock.period, ends)
        if abs(high - low) <= COMPUTED_ZERO * high:
            raise DeclarationError(
                self.parameter,
                f"it does not change the period of the drives, {high:.9g}",
                "Choose the parameter that changes their frequency",
            )

    def check_phase(self) -> None:
        """See that the drive has a phase.

        Raises
        ------
        DeclarationError
            If it has none.
        """
        self.phase_of_drive(self.span[1])

    def phase_of_drive(self, value: float) -> float:
        """Phase of the first harmonic of the drive; the state stands still at 0.

        Raises
        ------
        DeclarationError
            If it has none.
        """
        values = {**self.fixed, self.parameter: value}
        period = self.clock.period(values)
        return phase_of_drive(self.system, (self.text, self.drive), values, period)

    def lags(self, phases: Array, values: Array) -> Array:
        """Phases relative to the drive, in (−3π/2, π/2] at first and from there on without
        jumps."""
        of_drive = np.array([self.phase_of_drive(float(v)) for v in values])
        return np.unwrap(relative_phase(phases, of_drive))

    def columns(self, branch: Branch) -> dict[str, Array]:
        """What is said of the points of a line."""
        data, x = branch.points, self.coordinate
        where = data[self.parameter].values
        # A corner breaks what is smooth elsewhere.
        corner = np.zeros(len(where), np.int8)
        corner[[s.index for s in branch.special if s.kind not in ("fold", "period doubling")]] = 1
        period = data["period"].values
        shares = {
            f"stick_{contact_key(c)}": data[f"stick_time_{contact_key(c)}"].values / period
            for c in self.system.contacts
        }
        slips = [share < 1.0 - SHORTEST for share in shares.values()] or [period > 0.0]
        return {
            self.parameter: where,
            "amplitude": data[f"amplitude_{x}"].values,
            "harmonic": data[f"harmonic_{x}"].values,
            "phase": self.lags(data[f"phase_{x}"].values, where),
            "stick": data["stick_time"].values / period,
            "period": period,
            "dissipated": data["dissipated"].values,
            "stable": data["stable"].values,
            "slips": np.any(slips, axis=0).astype(np.int8),
            **shares,
            "corner": corner,
        }

    def measured(self, cycle: Cycle | str) -> dict[str, float]:
        """What is said of a motion of a sweep; not a number where there is none."""
        names = ("amplitude", "harmonic", "phase", "stick", "period", "dissipated")
        if isinstance(cycle, str):
            return dict.fromkeys(names, np.nan)
        h = cycle.harmonic[self.coordinate]
        value = np.array([cycle.parameters[self.parameter]])
        numbers = (
            0.5 * float(np.ptp(cycle._visible_extrema[self.coordinate])),
            abs(h),
            float(self.lags(np.angle([h]), value)[0]),
            cycle.stick_time / cycle.period,
            cycle.period,
            cycle.dissipated,
        )
        return dict(zip(names, numbers, strict=True))


@dataclass
class _Lines:
    """What was found at one level: sweeps up and down in the order of the parameter, and the lines
    through what they met."""

    wanted: _Level
    grid: Array
    met: dict[str, list[Cycle | str]] = field(default_factory=dict)
    branches: list[Branch] = field(default_factory=list)
    missed: int = 0
    peak: Cycle | None = None

    @property
    def swept(self) -> list[list[Cycle | str]]:
        """What each sweep met, at all values of the grid."""
        both: list[list[Cycle | str]] = []
        for direction in _DIRECTIONS:
            met = self.met.get(direction, [])
            whole = met + ["the sweep was interrupted"] * (len(self.grid) - len(met))
            both.append(whole if direction == "up" else whole[::-1])
        return both


def _follow(
    lines: _Lines,
    initial: Mapping[str, float] | None,
    steps: StepControl | None,
    show: Callable[[float, str], None],
) -> None:
    """Sweep up and down at a level, and follow the lines that the sweeps meet.

    Parameters
    ----------
    lines : _Lines
        Receives what is found.
    initial : mapping, optional
        Start of the sweeps.
    steps : StepControl, optional
    show : function
        Takes how much is done, and what.
    """
    wanted = lines.wanted
    beside: dict[Cycle | str, list[Cycle | str]] = {}
    for k, direction in enumerate(_DIRECTIONS):
        values = lines.grid if direction == "up" else lines.grid[::-1]
        up = dict(zip(lines.grid.tolist(), lines.met.get("up", []), strict=False))
        met = lines.met[direction] = []

        def tell(i: int, k: int = k, values: Array = values) -> None:
            text = f"sweep {_DIRECTIONS[k]}, {wanted.parameter} = {values[i]:.6g}"
            show((k + i / len(values)) / 3.0, text)

        for found, followed in carried(
            wanted.system,
            wanted.parameter,
            values.tolist(),
            parameters=wanted.fixed,
            initial=initial,
            progress=tell,
            known=up,
        ):
            if followed:
                beside.setdefault(found, []).append(met[-1])
                beside.setdefault(met[-1], []).append(found)
            met.append(found)
    show(2.0 / 3.0, "lines")
    cycles = list[Cycle]()
    for both in zip(*lines.swept, strict=True):
        met = [c for c in both if isinstance(c, Cycle) and c.certificate.ok]
        x = wanted.told_by
        cycles += met[:1] + [c for c in met[1:] if not _alike(met[0], c, x)]
    # Where a contact rests that never slips is told by neighbours that slip: these come first.
    cycles.sort(key=lambda c: -sum(s.slip_time > 0.0 for s in c.contacts.values()))
    branches = lines.branches
    line_of: dict[Cycle | str, Branch] = {}
    for cycle in cycles:
        # What was followed from a cycle on a line, and is near that line, is on it.
        near = [line_of[c] for c in beside.get(cycle, []) if c in line_of]
        line = next((b for b in near if _spans(wanted, b, cycle)), None)
        line = line or next((b for b in branches if _passes(wanted, b, cycle)), None)
        if line is None:
            line = continue_cycle(cycle, wanted.parameter, wanted.span, steps=steps)
            branches.append(line)
            if line.outcome.interrupted:
                raise KeyboardInterrupt
            heed()
            lines.missed += not _passes(wanted, line, cycle)
        line_of[cycle] = line
    lines.peak = _peak(wanted, branches)


def _spans(wanted: _Level, branch: Branch, cycle: Cycle) -> list[tuple[int, int]]:
    """Pairs of neighbouring points of a branch that enclose a cycle, as far as amplitude and first
    harmonic tell, the nearer one first."""
    numbers = _along(branch, wanted.told_by)
    where = branch.points[wanted.parameter].values
    at = cycle.parameters[wanted.parameter]
    own = _numbers(cycle, wanted.told_by)
    small = _SAME * float(np.max(np.abs(numbers)))
    found = []
    for i in np.flatnonzero((where[:-1] - at) * (where[1:] - at) <= 0.0).tolist():
        step = numbers[i + 1] - numbers[i]
        width = where[i + 1] - where[i]
        part = (at - where[i]) / width if width else 0.0
        far = np.max(np.abs(own - numbers[i] - part * step))
        if far <= _APART * np.max(np.abs(step)) + small:
            found.append((i, i + 1) if part < 0.5 else (i + 1, i))
    return found


def _passes(wanted: _Level, branch: Branch, cycle: Cycle) -> bool:
    """Whether a branch passes a cycle: there are two points that enclose it, and at the value of
    one of them it becomes that one."""
    numbers = _along(branch, wanted.told_by)
    small = _SAME * float(np.max(np.abs(numbers)))
    where = branch.points[wanted.parameter].values
    for j in (j for pair in _spans(wanted, branch, cycle) for j in pair):
        try:
            there = find_cycle(branch.system, cycle, parameters={wanted.parameter: float(where[j])})
        except ConvergenceError:
            continue
        if np.max(np.abs(_numbers(there, wanted.told_by) - numbers[j])) <= small:
            return True
    return False


def _along(branch: Branch, x: str) -> Array:
    """Amplitude and first harmonic of a coordinate at the points of a branch, shape (points, 3)."""
    data = branch.points
    size, angle = data[f"harmonic_{x}"].values, data[f"phase_{x}"].values
    wave = [size * np.cos(angle), size * np.sin(angle)]
    return np.column_stack([data[f"amplitude_{x}"].values, *wave])


def _numbers(cycle: Cycle, x: str) -> Array:
    """Amplitude and first harmonic of a coordinate."""
    h = cycle.harmonic[x]
    return np.array([0.5 * float(np.ptp(cycle.extrema[x])), h.real, h.imag])


def _alike(one: Cycle, other: Cycle, x: str) -> bool:
    """Whether two cycles at one frequency are the same, as far as amplitude and first harmonic
    tell."""
    a, b = _numbers(one, x), _numbers(other, x)
    return bool(np.max(np.abs(a - b)) <= _SAME * np.max(np.abs(a)))


def _cycle_at(branch: Branch, index: int) -> Cycle:
    """The cycle of a point of a branch, closed again."""
    point = branch.points.isel(point=index)
    names = branch.system.declaration.state
    values = {**branch.parameters, branch.parameter: float(point[branch.parameter])}
    problem = pose(branch.system, {name: values[name] for name in branch.system.parameters})
    state = np.array([float(point[name]) for name in names])
    return make_cycle(from_state(problem, state, float(point["time"])))


def _peak(wanted: _Level, branches: list[Branch]) -> Cycle | None:
    """The largest response: between the neighbours of the largest point if the parameter tells the
    cycles there apart, else (at a fold, at an end) that point."""
    if not branches:
        return None
    amplitude = f"amplitude_{wanted.coordinate}"
    branch = max(branches, key=lambda b: float(b.points[amplitude].max()))
    where = branch.points[wanted.parameter].values
    top = int(np.argmax(branch.points[amplitude].values))
    best = _cycle_at(branch, top)
    low, high = sorted(where[[max(top - 1, 0), min(top + 1, len(where) - 1)]].tolist())
    if low < where[top] < high:
        with suppress(ConvergenceError):
            return _climb(wanted, best, low, high)
    return best


def _climb(wanted: _Level, cycle: Cycle, low: float, high: float) -> Cycle:
    """The largest response, from a cycle on, with two values of the parameter on both sides of it.
    It may be beyond these: each time that is seen, one looks twice as far.

    Raises
    ------
    ConvergenceError
        If it is not within the range, or cannot be reached.
    """
    from scipy.optimize import minimize_scalar

    x = wanted.parameter
    middle = cycle.parameters[x]
    seen = {middle: cycle}

    def lowered(value: float) -> float:
        value = float(value)
        if not wanted.span[0] <= value <= wanted.span[1]:
            raise ConvergenceError("the largest response", f"it lies beyond {x} = {value:g}")
        if value not in seen:
            near = min(seen, key=lambda v: abs(v - value))
            seen[value] = moved(seen[near], {x: value})
        return -_numbers(seen[value], wanted.coordinate)[0]

    while not lowered(middle) <= min(lowered(low), lowered(high)):
        if lowered(high) < lowered(low):
            low, middle, high = middle, high, high + 2.0 * (high - middle)
        else:
            low, middle, high = low - 2.0 * (middle - low), low, middle
    if lowered(middle) < min(lowered(low), lowered(high)):
        minimize_scalar(lowered, (low, middle, high), method="brent", options={"xtol": _PEAK})
    return max(seen.values(), key=lambda c: _numbers(c, wanted.coordinate)[0])


def _backbone(level: str, found: list[_Lines]) -> list[Cycle]:
    """The largest responses at the levels and at some between them, in the order of the levels."""
    peaks = [one.peak for one in found if one.peak is not None]
    peaks.sort(key=lambda cycle: cycle.parameters[level])
    cycles = peaks[:1]
    for before, after in pairwise(peaks):
        wanted, last = found[0].wanted, before
        x = wanted.parameter
        step = _FIRST * (wanted.span[1] - wanted.span[0])
        ends = before.parameters[level], after.parameters[level]
        spaced = np.geomspace if ends[0] > 0.0 else np.linspace
        with suppress(ConvergenceError):
            for i, value in enumerate(spaced(*ends, _BETWEEN + 2)[1:-1].tolist()):
                # Most of the way it goes straight to the next peak.
                guess = last.parameters[x]
                guess += (after.parameters[x] - guess) / (_BETWEEN + 1 - i)
                there = moved(last, {level: value, x: guess})
                last = _climb(wanted, there, guess - step, guess + step)
                cycles.append(last)
        cycles.append(after)
    return cycles


# -- results ---------------------------------------------------------------------------------------


def _response(
    system: System,
    fixed: dict[str, float],
    level: str,
    found: list[_Lines],
    ended: BaseException | None,
) -> FrequencyResponse:
    """Everything that was found as one result.

    Parameters
    ----------
    found : list of _Lines
        Of the levels, in their order.
    ended : KeyboardInterrupt, TimeUp or None
        What has ended it before everything was found.
    """
    wanted = found[0].wanted
    x = wanted.coordinate
    of = x if x in system.followed else quantity(wanted.system, x)["long_name"]
    special: list[SpecialPoint] = []
    notes: list[str] = []
    points = 0
    for one in found:
        at = f"{level} = {one.wanted.fixed[level]:g}: " if level else ""
        for branch in one.branches:
            special += [replace(s, index=s.index + points) for s in branch.special]
            points += branch.points.sizes["point"]
            lost = [end.text for end in branch.ends if end.stop is not Stop.RANGE]
            notes += [f"{at}a line ends: {text}" for text in lost]
        for direction, sweep in zip(_DIRECTIONS, one.swept, strict=True):
            for value, cycle in zip(one.grid, sweep, strict=True):
                if isinstance(cycle, str):
                    notes.append(f"{at}{direction} at {wanted.parameter} = {value:g}: {cycle}")
    return FrequencyResponse(
        system,
        fixed,
        wanted.parameter,
        level,
        of,
        _dataset(wanted.system, level, found, of),
        special,
        notes,
        _certificate(found),
        ended is None,
        isinstance(ended, TimeUp),
    )


def _certificate(found: list[_Lines]) -> Certificate:
    """Of all cycles, how well harmonics are known, and whether what sweeps met is on the lines."""
    cycles = [c for one in found for sweep in one.swept for c in sweep if isinstance(c, Cycle)]
    branches = [branch for one in found for branch in one.branches]
    if not branches:
        return NOTHING
    own = worst([*(b.certificate for b in branches), *(c.certificate for c in cycles)])
    of = found[0].wanted.coordinate
    is_output = of in found[0].wanted.system.outputs
    errors = ["harmonics_error", *([f"harmonics_error_{of}"] if is_output else [])]
    known = max(float(b.points[name].max(skipna=False)) for b in branches for name in errors)
    missed = float(sum(one.missed for one in found))
    more = (
        Residual(
            "first harmonics",
            known,
            HARMONICS_KNOWN,
            note="change in the last refinement of the panels",
        ),
        Residual("swept motions that are not on a line", missed, 0.0),
    )
    return replace(own, residuals=(*own.residuals, *more))


def _dataset(system: System, level: str, found: list[_Lines], shown: str) -> xarray.Dataset:
    """Points of the lines, sweeps, and the largest responses."""
    import xarray as xr

    wanted = found[0].wanted
    parameter = wanted.parameter
    attributes = _attributes(system, wanted)
    tables: list[dict[str, Array]] = []
    for one in found:
        for branch in one.branches:
            columns = one.wanted.columns(branch)
            number = np.full(len(columns["amplitude"]), len(tables))
            own = {level: np.full(len(number), one.wanted.fixed[level])} if level else {}
            tables.append({**own, "line": number, **columns})
    empty = {name: np.zeros(0) for name in (parameter, *_COLUMNS)}
    data: dict[str, Any] = {
        name: (
            "point",
            np.concatenate([t[name] for t in tables or [empty]]),
            attributes.get(name, {}),
        )
        for name in (tables[0] if tables else empty)
    }
    swept = [[[one.wanted.measured(c) for c in sweep] for sweep in one.swept] for one in found]
    for name in swept[0][0][0]:
        values = np.array([[[entry[name] for entry in sweep] for sweep in one] for one in swept])
        data[f"swept_{name}"] = ("level", "direction", "step"), values, attributes[name]
    largest = ("amplitude", "harmonic", "phase")
    peaks = [_largest(wanted, one.peak) for one in found]
    for name in (parameter, *largest):
        values = np.array([entry[name] for entry in peaks])
        data[f"peak_{name}"] = "level", values, attributes[name]
    bone = _backbone(level, found) if level else []
    for name in (parameter, *largest[:2], *([level] if level else [])):
        values = np.array([_largest(wanted, c)[name] for c in bone])
        data[f"backbone_{name}"] = "backbone", values, attributes[name]
    coordinates: dict[str, Any] = {
        "direction": list(_DIRECTIONS),
        f"swept_{parameter}": ("step", found[0].grid, attributes[parameter]),
    }
    if level:
        of = np.array([one.wanted.fixed[level] for one in found])
        coordinates["level"] = "level", of, attributes[level]
    about = {"title": system.title or system.name, "coordinate": shown, "drive": wanted.text}
    return xr.Dataset(data, coordinates, about)


def _largest(wanted: _Level, cycle: Cycle | None) -> dict[str, float]:
    """What is said of a largest response, with its parameters."""
    measured = wanted.measured("" if cycle is None else cycle)
    there = {wanted.parameter: np.nan} if cycle is None else cycle.parameters
    return {**measured, **there}


def _attributes(system: System, wanted: _Level) -> dict[str, dict[str, Any]]:
    """Units and meanings."""
    x = quantity(system, wanted.coordinate)
    time = system.time_unit or "1"
    words = {-1: "neutral", 0: "unstable", 1: "stable"}
    named = {
        **{name: quantity(system, name) for name in system.parameters},
        "amplitude": {**x, "long_name": f"amplitude of {x['long_name']}"},
        "harmonic": {**x, "long_name": f"first harmonic of {x['long_name']}"},
        "phase": described_as(f"phase relative to {wanted.text}", "rad"),
        "stick": described(system, "stick_fraction"),
        **{
            f"stick_{contact_key(c)}": described(system, f"stick_fraction:{c}")
            for c in system.contacts
        },
        "period": described_as("period", time),
        "dissipated": described(system, "energy_per_cycle"),
        "slips": described_as("whether a contact slips", "1"),
        "corner": described_as("whether the curve may have a corner", "1"),
    }
    flags = {"flag_values": np.array([*words], np.int8), "flag_meanings": " ".join(words.values())}
    return {**named, "stable": flags}
