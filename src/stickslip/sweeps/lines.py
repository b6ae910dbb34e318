"""Frequency response: lines of cycles in the frequency of a drive, one for each level of another
parameter.

A line is a branch of cycles, stable or not, with its folds
(:func:`~stickslip.orbits.branches.cycle_branch.continue_cycle`). Lines start at limit cycles of
sweeps that carry the state up and down: a limit cycle that is on no line yet starts another one, on
which the sweeps then look for their cycles first. So the range in which a damper never slips is a
part of a line, and an isolated line is found if a sweep reaches it.

With x(t) = Re(X exp(iωt)) + … and a drive Re(G exp(iωt)) + … the phase is that of X/G, negative if
the coordinate lags behind.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import count, pairwise
from typing import Any

import numpy as np

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.errors import ConvergenceError, DeclarationError, listing, short, suggestion
from stickslip.model.quantities import ENERGIES
from stickslip.model.system import Output, System
from stickslip.motion.between.formulas import read_formula
from stickslip.motion.problem import checked_values
from stickslip.orbits.branches.cycle_branch import continue_cycle
from stickslip.orbits.branches.equilibrium_branch import checked_range
from stickslip.orbits.continuation.branch import Branch
from stickslip.orbits.continuation.path import StepControl
from stickslip.orbits.cycles.cycle import Cycle
from stickslip.orbits.cycles.drive_phase import read_drive
from stickslip.orbits.cycles.find_cycle import find_cycle
from stickslip.progress import Show, watched
from stickslip.stopping.scopes import TimeUp, check_stop, limited
from stickslip.sweeps.carried import carried, moved
from stickslip.sweeps.levels import DIRECTIONS, Level, Lines, first_coordinate, response_of
from stickslip.sweeps.request.axes import read_axes
from stickslip.sweeps.response import FrequencyResponse
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.functions import FUNCTIONS

_SAME = 1e-7  # measures that differ by less, relative to the largest response, are the same
_APART = 0.5  # a point this far from a line, relative to the step of the line there, may be on it
_BETWEEN = 5  # number of largest responses between two levels
_FIRST = 0.004  # initial fraction of the range in the search for a largest response
_PEAK = 1e-6  # accuracy of the frequency of a largest response; the response has the square of it


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
    """Compute the response of a system to a drive as a function of the frequency of the drive.

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
        Step control along the lines. Steps resolve changes of the whole state: a narrow resonance
        of a mode that remains far smaller than others may be passed. ``StepControl(largest=2e-3)``
        looks more closely.
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
    at_levels = [{**fixed, level: value} for value in values] or [fixed]
    wanted = _posed(system, parameter, (low, high), at_levels, of, drive)
    found = list[Lines]()
    ended: BaseException | None = None
    what = f"a response of {system.name}"
    with limited(time_limit, what) as scope, watched("frequency response") as show:
        try:
            for i, one in enumerate(wanted):
                found.append(Lines(one, np.linspace(low, high, points)))
                _follow(found[-1], initial, steps, _part(show, i, len(wanted)))
        except (KeyboardInterrupt, TimeUp) as why:
            found = [one for one in found if any(one.met.values())]
            if not found or not scope.ends(why):
                raise
            ended = why
    backbone = _backbone(level, found) if level else []
    return response_of(system, fixed, level, found, backbone, ended)


def _posed(
    system: System,
    parameter: str,
    span: tuple[float, float],
    at_levels: list[dict[str, float]],
    of: str | None,
    drive: str | None,
) -> list[Level]:
    """The checked problem of each level.

    Parameters
    ----------
    at_levels : list of dict
        Values of the fixed parameters at each level.

    Raises
    ------
    DeclarationError
        If the quantity is not periodic or has no phase, or the period of the drives does not depend
        on the parameter.
    """

    def at_first(name: str, text: str, formula: Expr) -> Level:
        return Level(system, parameter, span, name, text, formula, at_levels[0])

    def check_quantity(name: str) -> None:
        """Reject a quantity that is not periodic, or has no phase."""
        _check_periodic(system, name)
        at_first(name, *read_drive(system, name, drive)).check_phase()

    # The frequency is checked first: without it no quantity has a phase.
    at_first("", "", ex.ZERO).check_frequency()
    with listing(check_quantity):
        with_output, followed = _followed(system, of)
    text, formula = read_drive(with_output, followed, drive)
    wanted = [
        Level(with_output, parameter, span, followed, text, formula, values) for values in at_levels
    ]
    for one in wanted:
        one.check_frequency()
        one.check_phase()
    return wanted


def _followed(system: System, of: str | None) -> tuple[System, str]:
    """Name of the quantity of the response, and the system, with a formula added as an output of
    that name.

    Raises
    ------
    DeclarationError
        If it is neither a name nor a formula of quantities of results, or is not periodic.
    """
    of = first_coordinate(system) if of is None else of
    if of in system.followed:
        return system, of
    _check_periodic(system, of)
    taken = {*system.outputs, *system.declaration.results.names}
    taken |= system.declaration.results.definitions.keys()
    name = next(n for n in (f"response_{i}" for i in count(1)) if n not in taken)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # its warnings were issued for the system
        return replace(system, outputs={**system.outputs, name: Output(of, meaning=of)}), name


def _check_periodic(system: System, of: str) -> None:
    """Reject a formula that is not periodic."""
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
    """Return whether time appears in a formula outside of all functions."""
    if e.op == "sym":
        return e == ex.sym("t")
    if e.op in FUNCTIONS:
        return False
    return any(_grows(part) for part in (*e.args, *(term for term, _ in e.terms)))


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
    """Progress callback for one level."""
    return lambda fraction, text: show((index + fraction) / count, text)


def _follow(
    lines: Lines,
    initial: Mapping[str, float] | None,
    steps: StepControl | None,
    show: Callable[[float, str], None],
) -> None:
    """Sweep up and down at a level, and follow the lines through the limit cycles.

    Parameters
    ----------
    lines : Lines
        Receives the results.
    initial : mapping, optional
        Start of the sweeps.
    steps : StepControl, optional
    show : function
        Called with the completed fraction and a text.
    """
    wanted = lines.wanted
    on_lines = _OnLines(lines)
    beside: dict[Cycle | str, list[Cycle | str]] = {}
    for k, direction in enumerate(DIRECTIONS):
        values = lines.grid if direction == "up" else lines.grid[::-1]
        up = dict(zip(lines.grid.tolist(), lines.met.get("up", []), strict=False))
        met = lines.met[direction] = []

        def tell(i: int, k: int = k, values: Array = values) -> None:
            text = f"sweep {DIRECTIONS[k]}, {wanted.parameter} = {values[i]:.6g}"
            show((k + i / len(values)) / 3.0, text)

        def known(value: float, up: dict[float, Cycle | str] = up) -> list[Cycle]:
            seen = [c for c in [up.get(value)] if isinstance(c, Cycle)]
            return [*seen, *(c for c in on_lines.at(value) if c not in seen)]

        for found, followed in carried(
            wanted.system,
            wanted.parameter,
            values.tolist(),
            parameters=wanted.fixed,
            initial=initial,
            progress=tell,
            known=known,
        ):
            if followed:
                beside.setdefault(found, []).append(met[-1])
                beside.setdefault(met[-1], []).append(found)
            met.append(found)
            # The rest position of a contact that never slips is determined by neighbouring cycles
            # with slip.
            if isinstance(found, Cycle) and not found.closed.shooting.setting.held:
                on_lines.place(found, [], steps)
    show(2.0 / 3.0, "lines")
    cycles = list[Cycle]()
    for both in zip(*lines.swept, strict=True):
        met = [c for c in both if isinstance(c, Cycle) and c.certificate.ok]
        x = wanted.distinguished_by
        cycles += met[:1] + [c for c in met[1:] if not _equal(met[0], c, x)]
    cycles.sort(key=lambda c: -sum(s.slip_time > 0.0 for s in c.contacts.values()))
    for cycle in cycles:
        on_lines.place(cycle, beside.get(cycle, []), steps)
    lines.peak = _peak(wanted, lines.branches)


class _OnLines:
    """Cycles of lines at values of the parameter, and the line of each cycle of a sweep."""

    def __init__(self, lines: Lines) -> None:
        self.lines = lines
        self.line_of: dict[Cycle | str, Branch] = {}
        self._known: dict[tuple[Branch, float], list[Cycle]] = {}

    def at(self, value: float) -> list[Cycle]:
        """Cycles of the present lines at a value of the parameter."""
        return [c for branch in self.lines.branches for c in self._of(branch, value)]

    def place(self, cycle: Cycle, beside: list[Cycle | str], steps: StepControl | None) -> None:
        """Assign a certified cycle of a sweep to its line; if it is on none, follow a line through
        it.

        Parameters
        ----------
        beside : list of Cycle
            Cycles that were continued to it, or to which it was continued.
        """
        if cycle in self.line_of or not cycle.certificate.ok:
            return
        wanted, branches = self.lines.wanted, self.lines.branches
        # A cycle continued from one on a line, and near that line, is on it.
        near = [self.line_of[c] for c in beside if c in self.line_of]
        line = next((b for b in near if _spans(wanted, b, cycle)), None)
        line = line or next((b for b in branches if self._passes(b, cycle)), None)
        if line is None:
            line = continue_cycle(cycle, wanted.parameter, wanted.span, steps=steps)
            branches.append(line)
            if line.outcome.interrupted:
                raise KeyboardInterrupt
            check_stop()
            self.lines.missed += not self._passes(line, cycle)
        self.line_of[cycle] = line

    def _of(self, branch: Branch, value: float) -> list[Cycle]:
        """Cycles of a line at a value of the parameter."""
        if (branch, value) not in self._known:
            cycles = _passed(self.lines.wanted, branch, value)
            self._known[branch, value] = cycles
            self.line_of |= dict.fromkeys(cycles, branch)
        return self._known[branch, value]

    def _passes(self, branch: Branch, cycle: Cycle) -> bool:
        """Return whether a line contains a cycle."""
        wanted = self.lines.wanted
        there = self._of(branch, cycle.parameters[wanted.parameter])
        return any(_equal(cycle, c, wanted.distinguished_by) for c in there)


def _passed(wanted: Level, branch: Branch, value: float) -> list[Cycle]:
    """The cycles of a line at a value of the parameter: its points there, and neighbouring points
    continued to the value."""
    found = list[Cycle]()
    where = branch.points[wanted.parameter].values
    found += [branch.cycles[j] for j in np.flatnonzero(where == value).tolist()]
    for i in np.flatnonzero((where[:-1] - value) * (where[1:] - value) < 0.0).tolist():
        nearer = sorted((i, i + 1), key=lambda j: abs(where[j] - value))
        for cycle in (branch.cycles[j] for j in nearer):
            with suppress(ConvergenceError):
                there = find_cycle(branch.system, cycle, parameters={wanted.parameter: value})
                if any(i in pair for pair in _spans(wanted, branch, there)):
                    found.append(there)
                    break
    return found


def _spans(wanted: Level, branch: Branch, cycle: Cycle) -> list[tuple[int, int]]:
    """Pairs of neighbouring points of a branch that enclose a cycle, judged by amplitude and first
    harmonic, the nearer one first."""
    numbers = _along(branch, wanted.distinguished_by)
    where = branch.points[wanted.parameter].values
    at = cycle.parameters[wanted.parameter]
    own = _numbers(cycle, wanted.distinguished_by)
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


def _along(branch: Branch, x: str) -> Array:
    """Amplitude and first harmonic of a coordinate at the points of a branch, shape (points, 3)."""
    data = branch.points
    size, angle = data[f"harmonic_{x}"].values, data[f"phase_{x}"].values
    wave = [size * np.cos(angle), size * np.sin(angle)]
    return np.column_stack([data[f"amplitude_{x}"].values, *wave])


def _numbers(cycle: Cycle, x: str) -> Array:
    """Amplitude and first harmonic of a coordinate."""
    h = cycle.harmonic[x]
    return np.array([0.5 * float(np.ptp(cycle.extrema_of(x))), h.real, h.imag])


def _equal(one: Cycle, other: Cycle, x: str) -> bool:
    """Return whether two cycles at one frequency agree in amplitude and first harmonic."""
    a, b = _numbers(one, x), _numbers(other, x)
    return bool(np.max(np.abs(a - b)) <= _SAME * np.max(np.abs(a)))


def _peak(wanted: Level, branches: list[Branch]) -> Cycle | None:
    """The largest response: between the neighbours of the largest point if the parameter is
    monotone there, otherwise (at a fold or an end) that point."""
    if not branches:
        return None
    amplitude = f"amplitude_{wanted.coordinate}"
    branch = max(branches, key=lambda b: float(b.points[amplitude].max()))
    where = branch.points[wanted.parameter].values
    top = int(np.argmax(branch.points[amplitude].values))
    best = branch.cycles[top]
    low, high = sorted(where[[max(top - 1, 0), min(top + 1, len(where) - 1)]].tolist())
    if low < where[top] < high:
        with suppress(ConvergenceError):
            return _maximise(wanted, best, low, high)
    return best


def _maximise(wanted: Level, cycle: Cycle, low: float, high: float) -> Cycle:
    """The largest response, from a cycle and two values of the parameter on both sides of it. If
    the maximum is beyond these, the step is doubled.

    Raises
    ------
    ConvergenceError
        If it is not within the range, or the cycle cannot be continued to it.
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


def _backbone(level: str, found: list[Lines]) -> list[Cycle]:
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
                # Usually it leads straight to the next peak.
                guess = last.parameters[x]
                guess += (after.parameters[x] - guess) / (_BETWEEN + 1 - i)
                there = moved(last, {level: value, x: guess})
                last = _maximise(wanted, there, guess - step, guess + step)
                cycles.append(last)
        cycles.append(after)
    return cycles
