"""Motions advanced step by step, with external inputs: controllers, co-simulation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.errors import ConvergenceError, DeclarationError, short, suggestion
from stickslip.model.entries.declared import Parameter
from stickslip.model.system import System
from stickslip.motion.engine.tables import run_setups
from stickslip.motion.ensemble import Lanes
from stickslip.motion.outcome import Outcome
from stickslip.motion.problem import pose
from stickslip.motion.record.knots import Knots
from stickslip.motion.starts import check_contacts, check_stable_start, numbers_of, put_on_contacts
from stickslip.motion.steps.arrays import CAUSE, FULL, HAPPENED, NOW, SPAN, TAKEN, Constants
from stickslip.stopping.scopes import watching
from stickslip.symbolic.formulas import TimeFunction

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

Interpolation = Literal["hold", "linear"]
_ROOM = 64  # number of knots of a step; a longer one allocates more
_SINCE = "t__since"  # the time since which inputs change


@dataclass(frozen=True)
class StepperState:
    """State of a :class:`Stepper`, returned by :meth:`Stepper.save` and accepted by
    :meth:`Stepper.restore`.

    Attributes
    ----------
    time : float
    inputs : dict of str to float
    lane : tuple of arrays
        Internal data of the engine: the state, the modes of the contacts, the clock.
    numbers : array
        Values of the parameters.
    """

    time: float
    inputs: Mapping[str, float]
    lane: tuple[Array, ...]
    numbers: Array


class Stepper:
    """A motion advanced step by step with external inputs, for controllers written in Python and
    for co-simulation.

    Within a step the motion is that of :func:`stickslip.simulate`, with every switch at its exact
    time, independent of the step size.

    Parameters
    ----------
    system : System
    initial, parameters : mapping of str to float, optional
        As in :func:`stickslip.simulate`.
    inputs : sequence of str
        Parameters and drives that may be set in each step. A drive has its declared value until it
        is set.
    interpolation : {"hold", "linear"}
        Whether an input jumps to its new value at the beginning of the step, or varies linearly
        during the step.
    time : float, optional
        Initial time; by default the start of the span of the system.
    rtol, atol : float
        As in :func:`stickslip.simulate`.
    max_events : int
        Maximum number of events in a step.

    Attributes
    ----------
    time : float
    system : System
        The system with its inputs as parameters, or as linear functions of time.

    Raises
    ------
    DeclarationError
        If an input is not a parameter or a drive, or an argument is wrong.

    Examples
    --------
    >>> import stickslip as ss
    >>> system = ss.System(
    ...     "block",
    ...     parameters={"F": 0.0},
    ...     coordinates={"x": ss.Inertial("m")},
    ...     kinetic="d_x**2/2",
    ...     potential="-F*x",
    ...     contacts={"ground": ss.Contact("d_x", 1.0)},
    ... )
    >>> stepper = ss.Stepper(system, inputs=["F"])
    >>> stepper.advance(1.0, {"F": 0.9})["x"]  # sticks
    0.0
    >>> stepper.advance(2.0, {"F": 2.0})["x"]  # (2 − 1)·1²/2
    0.5
    """

    @validated
    def __init__(
        self,
        system: System,
        *,
        initial: Mapping[str, float] | None = None,
        parameters: Mapping[str, float] | None = None,
        inputs: Sequence[str] = (),
        interpolation: Interpolation = "hold",
        time: float | None = None,
        rtol: float = 1e-10,
        atol: float = 1e-12,
        max_events: int = 100_000,
    ) -> None:
        if interpolation not in ("hold", "linear"):
            reason = f"unknown interpolation '{short(str(interpolation))}'"
            raise DeclarationError("interpolation", reason, 'Choose "hold" or "linear"')
        begin = float(system.span[0] if time is None else time)
        if not math.isfinite(begin):
            raise DeclarationError(
                "time", f"{begin:g} is not a finite number", "Give a finite number"
            )
        values = {**system.values, **(parameters or {})}
        system.declaration.check_parameters(values)
        known = {name: _value_of(system, name, values, begin) for name in inputs}
        self._linear = interpolation == "linear"
        self.system: System = with_inputs(system, known, self._linear, begin)
        kept = {k: v for k, v in values.items() if k in self.system.parameters and k not in known}
        self._problem = pose(self.system, kept, rtol, atol, origin=begin)
        self._places = {name: i for i, name in enumerate(self.system.parameters)}
        self._inputs: dict[str, float] = known
        self._numbers = np.append(numbers_of(self._problem)[0], begin)[None]
        self._rtol = rtol
        self._max_events = max_events
        y = self._problem.initial_state(initial or {})
        y = put_on_contacts(self._problem, begin, self._numbers[:, :-1], y[None])[0]
        constants = Constants(*(part[None] for part in self._problem.constants))
        self._lanes = Lanes.start(
            self._problem,
            constants,
            np.zeros(1, np.int64),
            y[None],
            (0.0, 0.0),
            self._problem.empty_forms(1, 0),
        )
        self._begins = True
        self.time: float = begin
        now = self._lanes.now
        shape = len(y), now.mode.shape[1], now.reg.shape[1]
        self._room = Knots.empty(_ROOM, *shape, begin)
        self._record = self._room.record
        self._names = self.system.declaration.state
        self._last: tuple[float, list[Knots], int, int] | None = None

    @property
    def inputs(self) -> dict[str, float]:
        """Values of the inputs."""
        return dict(self._inputs)

    @property
    def state(self) -> dict[str, float]:
        """Coordinates, rates ``d_x`` of inertial ones, internal variables."""
        return dict(zip(self._names, self._lanes.now.y[0].tolist(), strict=True))

    @property
    def motion(self) -> Trajectory:
        """The motion in the last step, with its events and its certificate.

        Raises
        ------
        DeclarationError
            If no step has been taken.
        """
        from stickslip.motion.trajectory import Trajectory

        if self._last is None:
            raise DeclarationError("motion", "no step has been taken", "Call advance first")
        begin, pieces, count, code = self._last
        knots = Knots.joined([*pieces, self._room.first(count).copied()])
        numbers = dict(zip(self.system.parameters, self._numbers[0].tolist(), strict=False))
        problem = replace(self._problem, parameters=numbers)
        vars(problem).update(compiled=self._problem.compiled, machine=self._problem.machine)
        span = (begin, self.time)
        return Trajectory(problem, span, knots, Outcome.from_code(code), self._rtol)

    @validated
    def advance(self, time: float, inputs: Mapping[str, float] | None = None) -> dict[str, float]:
        """Advance the motion to a later time.

        Parameters
        ----------
        time : float
        inputs : mapping of str to float, optional
            Values of inputs during this step, or at its end if they are interpolated; other inputs
            keep their values.

        Returns
        -------
        dict of str to float
            The :attr:`state` at that time.

        Raises
        ------
        DeclarationError
            If the time is not later, or an input is unknown or not a finite number.
        ConvergenceError
            If the motion ends before that time; :attr:`time` and :attr:`state` are then those of
            its end, and the message gives the reason.
        """
        end = float(time)
        if not self.time < end < math.inf:
            reason = f"{end:g} is not later than the current time {self.time:g}"
            raise DeclarationError("time", reason, "To go back, restore a saved state")
        self._take(inputs or {}, end)
        begin = self.time
        origin = self._problem.origin
        now = self._lanes.now
        before = now.y[0].copy()
        clock, counters = now.clock[0], now.counters[0]
        clock[SPAN] = end - begin
        counters[CAUSE] = -1
        counters[TAKEN] = counters[HAPPENED] = 0
        self._last = None  # the storage is overwritten
        try:
            with watching():  # Ctrl-C ends a long step and leaves the motion where it is
                code, pieces, count = self._follow(end - origin)
        except BaseException:
            self.time = origin + float(clock[NOW])
            raise
        self.time = end if code == 0 else origin + float(clock[NOW])
        self._last = (begin, pieces, count, code)
        if code != 0:
            self._explain(code, begin, before)
        return self.state

    def _follow(self, end: float) -> tuple[int, list[Knots], int]:
        """Run the compiled loop to a time on its clock: the outcome code, the knots that the room
        did not hold, and how many it holds."""
        lanes = self._lanes
        pieces: list[Knots] = []
        lanes.codes[0] = FULL
        while True:
            count = lanes.advance(end, self._max_events, self._record)
            code = int(lanes.codes[0])
            if code < FULL:
                return code, pieces, count
            pieces.append(self._room.first(count).copied())

    def _take(self, given: Mapping[str, float], end: float) -> None:
        """Set the constants of a step to the given inputs."""
        for name, value in given.items():
            if name not in self._inputs:
                reason = f"'{short(str(name))}' is not an input"
                raise DeclarationError("inputs", reason, suggestion(str(name), self._inputs))
            if not math.isfinite(value):
                raise DeclarationError(
                    f"inputs.{name}", f"{value:g} is not a finite number", "Give a finite number"
                )
        if not self._linear and not given:
            return
        row = self._numbers[0]
        places = self._places
        for name, before in self._inputs.items():
            value = float(given.get(name, before))
            if self._linear:
                row[places[f"{name}__from"]] = before
                row[places[f"{name}__rate"]] = (value - before) / (end - self.time)
            else:
                row[places[name]] = value
            self._inputs[name] = value
        if self._linear:
            row[places[_SINCE]] = self.time
        run_setups(self._problem.compiled.setup, self._numbers, self._lanes.constants)

    def _explain(self, code: int, begin: float, y: Array) -> None:
        """Raise the error of a motion that has ended."""
        outcome = Outcome.from_code(code)
        if self.time == begin:
            check_contacts(self._problem, begin, y)
            check_stable_start(self._problem, begin, y)
        raise ConvergenceError(f"the motion ends at t = {self.time:.9g}", outcome.message)

    def save(self) -> StepperState:
        """Save the current state."""
        lane = tuple(part.copy() for part in self._lanes.now)
        return StepperState(self.time, self.inputs, lane, self._numbers.copy())

    def restore(self, state: StepperState) -> None:
        """Restore a saved state.

        Raises
        ------
        DeclarationError
            If it is the state of another system.
        """
        now = self._lanes.now
        shapes = [part.shape for part in now]
        if [
            part.shape for part in state.lane
        ] != shapes or state.inputs.keys() != self._inputs.keys():
            raise DeclarationError(
                "state",
                "the state was saved by another system",
                "Restore a state saved by this stepper",
            )
        for part, saved in zip(now, state.lane, strict=True):
            part[...] = saved
        self.time = state.time
        self._inputs = dict(state.inputs)
        self._numbers[...] = state.numbers
        run_setups(self._problem.compiled.setup, self._numbers, self._lanes.constants)
        self._last = None


def _value_of(system: System, name: str, values: Mapping[str, float], time: float) -> float:
    """The value that an input has before it is given one."""
    if name in values:
        return float(values[name])
    if name not in system.drives:
        known = suggestion(str(name), [*system.parameters, *system.drives])
        reason = f"'{short(str(name))}' is not a parameter or a drive"
        raise DeclarationError("inputs", reason, known)
    drive = system.drives[name]
    if isinstance(drive, TimeFunction) and not drive.covers(time, time):
        return 0.0
    return float(system.evaluate(name, {**values, "t": time}))


def with_inputs(system: System, inputs: Mapping[str, float], linear: bool, time: float) -> System:
    """The system with its inputs as parameters, or as straight lines in time.

    Parameters
    ----------
    inputs : mapping of str to float
        Parameters and drives, and the values that they have at first.
    linear : bool
        Whether they are straight lines.
    time : float
        From which these begin.

    Raises
    ------
    DeclarationError
        If formulas do not make sense any more: they name the rate of a drive.
    """
    parameters = {n: p for n, p in system.parameters.items() if n not in inputs}
    drives = {n: d for n, d in system.drives.items() if n not in inputs}
    for name, value in inputs.items():
        own = system.parameters.get(name, Parameter(value))
        if linear:
            parameters[f"{name}__from"] = replace(own, default=value)
            parameters[f"{name}__rate"] = Parameter(0.0)
            drives[name] = f"{name}__from + {name}__rate*(t - {_SINCE})"
        else:
            parameters[name] = replace(own, default=value)
    if linear and inputs:
        parameters[_SINCE] = Parameter(time)
    return replace(system, parameters=parameters, drives=drives)
