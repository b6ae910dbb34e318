"""A recording and the corresponding motion: the measured quantities, the same quantities of a
motion, and their derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, short, suggestion
from stickslip.fitting.recording import Recording
from stickslip.model.declaration import check_initial
from stickslip.model.entries.samples import Samples
from stickslip.model.system import System
from stickslip.motion.outcome import Outcome
from stickslip.motion.simulate import check_span, simulate
from stickslip.motion.trajectory import Trajectory
from stickslip.orbits.sensitivities.motion import Sensitivity, at_events, sensitivities
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

_LONGEST = 100  # pieces of a motion (4096 steps each) after which it is abandoned
# multiple of the time of the last event up to which later events of a motion are awaited
_LATER = 1.25
Noise = float | str


class Unusable(Exception):
    """A motion that cannot be compared with the data: it stopped, or takes too long."""


class Column(NamedTuple):
    """Measured values of one quantity.

    Attributes
    ----------
    name : str
        Of the column.
    formula : str
        The quantity of the motion.
    rows : array of int, shape (m,)
        Rows in which there is a value.
    values : array, shape (m,)
    noise : array, shape (m,), or None
        Standard deviations, if they are known.
    """

    name: str
    formula: str
    rows: Array
    values: Array
    noise: Array | None


@dataclass(frozen=True, eq=False)
class MeasuredRecord:
    """A recording, read for a system.

    Attributes
    ----------
    system : System
        With the drives of the recording.
    times : array
        Of its rows; the numbers of the rows if these are events.
    span : (float, float)
        Of the motion.
    initial : dict of str to Expr
        Initial values that are given, as functions of the parameters.
    dropped : int
        Rows without a time, or without any value.
    """

    recording: Recording
    system: System
    columns: tuple[Column, ...]
    times: Array
    span: tuple[float, float]
    initial: dict[str, Expr]
    dropped: int

    @property
    def count(self) -> int:
        """Number of data."""
        return sum(len(c.rows) for c in self.columns)

    @property
    def data(self) -> Array:
        """The values of all columns, concatenated."""
        return np.concatenate([c.values for c in self.columns])

    def start(self, parameters: Mapping[str, float], free: Mapping[str, float]) -> dict[str, float]:
        """Initial values, from parameters and free initial values."""
        given = {name: ex.evaluate(e, parameters) for name, e in self.initial.items()}
        return {**given, **free}

    def start_slopes(self, parameters: Mapping[str, float], names: Sequence[str]) -> Array:
        """Derivatives of the initial state with respect to parameters, shape (states, names)."""
        state = list(self.system.declaration.state)
        slopes = np.zeros((len(state), len(names)))
        for component, formula in self.initial.items():
            for j, name in enumerate(names):
                if name in formula.symbols:
                    slope = ex.evaluate(ex.derivative(formula, name), parameters)
                    for part, weight in self.system.start_slope(component).items():
                        slopes[state.index(part), j] += weight * slope
        return slopes

    def move(
        self, parameters: Mapping[str, float], free: Mapping[str, float], rtol: float
    ) -> Trajectory:
        """The motion for given parameters and free initial values.

        Raises
        ------
        Unusable
            With the reason.
        """
        given = {**parameters, **self.recording.parameters}
        pieces = 0

        def count(_: float) -> None:
            nonlocal pieces
            pieces += 1
            if pieces > _LONGEST:
                raise Unusable(f"the motion takes more than {4096 * _LONGEST:,} steps")

        try:
            start = self.start(given, free)
            motion = simulate(
                self.system, self.span, initial=start, parameters=given, rtol=rtol, progress=count
            )
        except DeclarationError as error:
            raise Unusable(str(error)) from None
        if motion.outcome is Outcome.INTERRUPTED:
            raise KeyboardInterrupt
        if not motion.outcome.ok:
            raise Unusable(f"{motion.outcome.label} at t = {motion.knots.time[-1]:.6g}")
        return motion

    def of_motion(
        self, motion: Trajectory, names: Sequence[str] = (), touching: bool = False
    ) -> Sensitivity:
        """Measured quantities of a motion at the times (or events) of the rows, and their
        derivatives.

        Parameters
        ----------
        names : sequence of str
            Parameters, and initial values.
        touching : bool
            Whether guards are looked for that are touched without being crossed.

        Raises
        ------
        Unusable
            If it has fewer events than were recorded.
        """
        formulas = [c.formula for c in self.columns]
        start = self.start_slopes(motion.parameters, names)
        if not self.recording.events:
            return sensitivities(
                motion, names, self.times, formulas, touching=touching, start=start
            )
        found = events_of(motion, *self.recording.happening)
        if len(found) < len(self.times):
            raise Unusable(
                f"the motion has {len(found)} events '{self.recording.events}', but the "
                f"recording has {len(self.times)}"
            )
        first = found[: len(self.times)]
        return at_events(motion, first, names, formulas, start, touching)

    def first(self, most: int) -> MeasuredRecord:
        """The record with only the first rows, or events."""
        if most >= len(self.times):
            return self
        columns = []
        for c in self.columns:
            kept = np.flatnonzero(c.rows < most)
            noise = None if c.noise is None else c.noise[kept]
            columns.append(c._replace(rows=c.rows[kept], values=c.values[kept], noise=noise))
        last = float(self.times[most - 1])
        if self.recording.events:
            last = _last_event(self.span[0], columns, self.span[1])
        span = (self.span[0], min(last, self.span[1]))
        return replace(self, columns=tuple(columns), times=self.times[:most], span=span)

    def flat(self, values: Array) -> Array:
        """Measured entries among the values of all quantities at all times, column after column;
        shape (quantities, times, ...)."""
        return np.concatenate([values[j][c.rows] for j, c in enumerate(self.columns)])


def events_of(motion: Trajectory, contact: str, verb: str) -> Array:
    """Knots of the events of a contact."""
    modes = {name: motion.modes[key] for name, key in _keys(motion).items()}
    if contact not in modes:
        raise DeclarationError(f"events: {contact}", "unknown contact", suggestion(contact, modes))
    mode = modes[contact]
    rests, is_open = mode == 0, mode == 2
    state = {"slips": ~rests & ~is_open, "sticks": rests, "opens": is_open, "closes": ~is_open}
    now = state[verb]
    begins = now[1:] & ~now[:-1]
    if verb == "slips":
        # A slip in the other direction is a new one only where it has stuck in between.
        begins &= rests[:-1]
    return np.flatnonzero(begins) + 1


def _keys(motion: Trajectory) -> dict[str, str]:
    from stickslip.model.quantities import contact_key

    names = [*motion.system.frictional, *motion.system.unilateral, *motion.system.constraints]
    return {name: contact_key(name) for name in names if contact_key(name) in motion.modes}


# -- reading ---------------------------------------------------------------------------------------


def read_recording(
    system: System,
    recording: Recording,
    observe: Mapping[str, str],
    noise: Mapping[str, Noise],
) -> MeasuredRecord:
    """Read a recording for a system.

    Parameters
    ----------
    observe : mapping of str to str
        Quantity, or formula of quantities, of each column.
    noise : mapping of str to float or str
        Standard deviations of columns, or the columns that contain them.

    Raises
    ------
    DeclarationError
        If a column or a drive is missing, no data remain, or the motion needs a drive beyond its
        samples.
    """
    where = recording.source
    if recording.events:
        clock = np.arange(recording.table.shape[0], dtype=float)
    else:
        clock = recording.column(recording.clock)
    columns = {name: recording.column(name) for name in observe}
    there = np.isfinite(clock)
    some = np.any([np.isfinite(values) for values in columns.values()], axis=0)
    kept = np.flatnonzero(there & some)
    if not len(kept):
        raise DeclarationError(where, "no row has both a time and a value", "Give at least one row")
    if not recording.events:
        kept = kept[np.argsort(clock[kept], kind="stable")]
    times = clock[kept]
    made = []
    for name, values in columns.items():
        own = values[kept]
        rows = np.flatnonzero(np.isfinite(own))
        if not len(rows):
            raise DeclarationError(f"{where}, column '{name}'", "the column is empty", "Remove it")
        sigma = _noise(recording, name, noise.get(name), kept, rows)
        made.append(Column(name, str(observe[name]), rows, own[rows], sigma))
    moved = _driven(system, recording, clock)
    span = _span(recording, times, made)
    moved.declaration.check_span(*span)
    initial = _initial(moved, recording)
    dropped = int(len(clock) - len(kept))
    return MeasuredRecord(recording, moved, tuple(made), times, span, initial, dropped)


def _noise(
    recording: Recording, name: str, given: Noise | None, kept: Array, rows: Array
) -> Array | None:
    if given is None:
        return None
    where = f"noise.{name}"
    if isinstance(given, str):
        sigma = recording.column(given)[kept][rows]
    else:
        try:
            sigma = np.full(len(rows), float(given))
        except (TypeError, ValueError, OverflowError):
            raise DeclarationError(
                where, f"{given!r} is not a number", "Give a standard deviation"
            ) from None
    if not np.all(sigma > 0.0) or not np.all(np.isfinite(sigma)):
        raise DeclarationError(
            where, "the standard deviation is not positive", "Give a positive number"
        )
    return sigma


def _driven(system: System, recording: Recording, clock: Array) -> System:
    """The system under the drives of a recording."""
    if not recording.drives:
        return system
    given = {}
    for drive, column in recording.drives.items():
        if drive not in system.drives:
            raise DeclarationError(
                f"drives.{drive}", "unknown drive", suggestion(drive, system.drives)
            )
        values = recording.column(column)
        there = np.isfinite(values) & np.isfinite(clock)
        given[drive] = Samples(clock[there], values[there], where=f"{recording.source}, {column}")
    start, end = float(np.nanmin(clock)), float(np.nanmax(clock))
    return replace(system, span=(start, end), drives={**system.drives, **given})


def _span(recording: Recording, times: Array, columns: list[Column]) -> tuple[float, float]:
    """Time span from the first to the last required time."""
    if not recording.events:
        begin = times[0] if recording.begin is None else float(recording.begin)
        if begin > times[0]:
            raise DeclarationError(
                f"{recording.source}, begin",
                f"the motion begins at {begin:g}, which is later than the first row ({times[0]:g})",
                "Begin earlier, or remove these rows",
            )
        if begin == times[-1]:
            raise DeclarationError(
                recording.source,
                f"all rows are at t = {begin:g}, the beginning of the motion",
                "Give rows at later times, or set the beginning: begin=...",
            )
        return check_span((begin, float(times[-1])))
    begin = 0.0 if recording.begin is None else float(recording.begin)
    if recording.end is not None:
        return check_span((begin, float(recording.end)))
    last = _last_event(begin, columns, np.inf)
    if np.isinf(last):
        raise DeclarationError(
            f"{recording.source}, end",
            "the duration of the motion is unknown, since the events have no times",
            "Set the end: end=...",
        )
    return check_span((begin, last))


def _last_event(begin: float, columns: Sequence[Column], otherwise: float) -> float:
    """Time limit for the last event of a motion."""
    times = [float(np.max(c.values)) for c in columns if c.formula == "t" and len(c.values)]
    return begin + _LATER * (times[0] - begin) if times else otherwise


def _initial(system: System, recording: Recording) -> dict[str, Expr]:
    """Initial values as functions of the parameters."""
    declaration = system.declaration
    parameters = {name: ex.sym(name) for name in system.parameters}
    found = {
        name: _closed(declaration.scope.parse(value, f"initial.{name}"), name, parameters)
        for name, value in recording.initial.items()
    }
    for name in system.started(found):
        check_initial(declaration, name, 0.0, system.started_unknowns)
    return found


def _closed(formula: Expr, name: str, parameters: Mapping[str, Expr]) -> Expr:
    strange = formula.symbols - parameters.keys()
    if strange:
        raise DeclarationError(
            f"initial.{name}",
            f"it depends on {short(min(strange))}",
            "Use parameters only in an initial value",
        )
    return formula
