"""Ring-downs: the decay of a free vibration, half-cycle by half-cycle.

A half-cycle is the motion from one turning point of a coordinate, or an output, to the next. With
its positions x₀, x₁, ... and times t₀, t₁, ... there, half-cycle k has the amplitude
A_k = |x_{k+1} − x_k|/2 and the frequency 1/(2(t_{k+1} − t_k)). From δ = ln(A_k/A_{k+1}) follows the
damping ratio ζ = δ/√(π² + δ²), exactly for viscous damping.

References
----------
L. Meirovitch, *Fundamentals of Vibrations*, McGraw-Hill 2001, sections 2.4 and 2.6: logarithmic
decrement, and Coulomb damping, under which amplitudes fall by 2μN/k in each half-cycle. Code_Aster,
test SDND100: the same with numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.certificates import Certificate, Residual
from stickslip.equations.derive import derive
from stickslip.errors import DeclarationError, short
from stickslip.model.entries.units import with_unit
from stickslip.model.quantities import described_as, energy_unit, per_time, quantity_or_formula
from stickslip.model.system import System
from stickslip.model.system_file import SYSTEM
from stickslip.motion.outcome import Outcome
from stickslip.motion.problem import checked_values
from stickslip.motion.simulate import simulate
from stickslip.motion.trajectory import Trajectory
from stickslip.orbits.studies.swinging import read_swinging
from stickslip.orbits.studies.turning_points import SwingTrace, TurningPoints, turning_points
from stickslip.results import CERTIFICATE, PLAIN, TEXT, Completion, Result, shortened, together
from stickslip.symbolic import expressions as ex

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# in units of rtol, relative to the largest amplitude: smaller amplitudes do not determine damping
_LEAST = 1e4
_TURNS = 1e-9  # velocities at turning points, relative to the largest one
_SAMPLES = 4000  # samples of the motion for figures


@dataclass(frozen=True, eq=False, repr=False)
class RingDown(Result):
    """The decay of a free vibration, half-cycle by half-cycle.

    ``ring_down.table`` is a pandas.DataFrame with one row per half-cycle.

    Attributes
    ----------
    system : System
    parameters : dict of str to float
    coordinate : str
        The vibrating quantity: a name or a formula.
    dataset : xarray.Dataset
        Over ``half_cycle``: ``time`` of its middle, ``amplitude`` (half the distance between its
        turning points), ``centre`` (their midpoint), ``frequency`` (cycles per unit of time),
        ``dissipated`` (energy), and from it to the next one ``decrement`` and ``damping``, which
        belong to the geometric mean ``damping_amplitude`` of both amplitudes; these three are NaN
        in the last half-cycle. Over ``turn``: ``turn_time``, ``turn_position``, ``turn_rest`` (how
        long the coordinate rests there), ``turn_energy``. Over ``sample``: ``sample_time`` and
        ``sample_position``, the motion for plots.
    stops : bool
        Whether the coordinate comes to rest within the span, at the last turning point.
    notes : list of str
        Remarks, such as the time after which the decay is not evaluated, or growing amplitudes.
    ended : str
        Outcome of the motion, if it did not reach its end.
    interrupted, time_up : bool
        Whether the user, or the time limit, ended the motion.
    certificate : Certificate
        The certificate of the motion, with the velocities at the turning points.
    """

    KIND: ClassVar[str] = "ring-down"
    PARTS: ClassVar = {
        "system": SYSTEM,
        "parameters": PLAIN,
        "coordinate": TEXT,
        "stops": PLAIN,
        "notes": PLAIN,
        "certificate": CERTIFICATE,
        "ended": TEXT,
        "broken": together("interrupted", "time_up"),
    }

    system: System
    parameters: dict[str, float]
    coordinate: str
    dataset: xarray.Dataset
    stops: bool
    notes: list[str]
    certificate: Certificate
    ended: str = ""
    interrupted: bool = False
    time_up: bool = False

    def __repr__(self) -> str:
        return (
            f"<RingDown of {self.system.name}: {self.coordinate}, {len(self)} half-cycles"
            f"{', then rest' if self.stops else ''}>"
        )

    def __len__(self) -> int:
        return self.dataset.sizes["half_cycle"]

    @property
    def along(self) -> str:
        """Dimension of the half-cycles."""
        return "half_cycle"

    @property
    def outcome(self) -> Completion:
        """Whether there is a half-cycle, and the motion was completed."""
        if self.interrupted:
            return Completion.INTERRUPTED
        if self.time_up:
            return Completion.TIME_UP
        if self.ended:
            return Completion.STOPPED_EARLY
        return Completion.FINISHED if len(self) else Completion.NOTHING_FOUND

    @property
    def message(self) -> str:
        """Number of half-cycles, and the end of the motion."""
        last = self.dataset["turn_time"].values
        rest = f"; at rest from t = {last[-1]:.9g}" if self.stops else ""
        count = f"{self.coordinate} makes {_counted(len(self), 'half-cycle')}{rest}"
        turns = _counted(len(last), "turning point")
        none = f"{self.coordinate} does not oscillate: it has {turns}"
        ended = [f"the motion ends early: {self.ended}"] if self.ended else []
        return "\n".join([count if len(self) else none, *ended, *self.notes])

    def facts(self) -> dict[str, Any]:
        """Summary as plain data."""
        data = self.dataset
        about: dict[str, Any] = {
            **self.system.heading(),
            "coordinate": self.coordinate,
            "half cycles": len(self),
            "stops": self.stops,
            "turning points": [
                {"time": float(t), self.coordinate: float(x)}
                for t, x in zip(data["turn_time"], data["turn_position"], strict=True)
            ],
            "notes": self.notes,
        }
        if self.stops:
            about["rest from"] = float(data["turn_time"][-1])
        for name in ("amplitude", "frequency", "damping"):
            values = _finite(data[name].values)
            if len(values):
                about[f"first {name}"] = float(values[0])
                about[f"last {name}"] = float(values[-1])
        return about

    def rows(self) -> list[tuple[str, str]]:
        """Summary as rows of text."""
        data = self.dataset
        rows = [("ring-down", f"of {self.coordinate}, {_counted(len(self), 'half-cycle')}")]
        for name, label in (("amplitude", "amplitude"), ("frequency", "frequency")):
            rows += _from_to(label, data[name].values, str(data[name].attrs.get("units", "1")))
        rows += _from_to("damping ratio", _finite(data["damping"].values), "1")
        if self.stops:
            unit = str(data["turn_time"].attrs.get("units", "1"))
            at = with_unit(float(data["turn_time"][-1]), unit, 6)
            unit = str(data["turn_position"].attrs.get("units", "1"))
            where = with_unit(float(data["turn_position"][-1]), unit, 6)
            rows.append(("at rest", f"from t = {at}, at {self.coordinate} = {where}"))
        return [*rows, *shortened([("note", note) for note in self.notes])]

    def overview(self, ax: Axes | None = None) -> Figure:
        """Plot the motion with its envelope, and frequency and damping against the amplitude; only
        the motion if axes are given."""
        from stickslip.figures.ring_down import plot_ring_down

        return plot_ring_down(self, ax=ax)


@validated
def ring_down(
    system: System,
    span: tuple[float, float] | None = None,
    *,
    initial: Mapping[str, float] | None = None,
    of: str | None = None,
    parameters: Mapping[str, float] | None = None,
    rtol: float = 1e-10,
    atol: float = 1e-12,
    max_events: int = 1_000_000,
    time_limit: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> RingDown:
    """Analyse the decay of a free vibration: amplitude, frequency and damping of every half-cycle.

    Parameters
    ----------
    system : System
        A system that does not depend on time.
    span : (float, float), optional
        Start and end of the motion; by default the system's own span.
    initial : mapping of str to float, optional
        Initial state; by default the declared one.
    of : str, optional
        The vibrating quantity: an inertial coordinate or its rate, a degree of freedom of a
        structure, such as ``"u[tip]"``, an output, or a formula of these without kinks, such as
        ``"u[tip] - u[root]"``; by default the first inertial coordinate, or the first named degree
        of freedom.
    parameters : mapping of str to float, optional
        Values that replace the defaults.
    rtol, atol : float
        Accuracy of the motion, as in :func:`stickslip.simulate`. Half-cycles below 10⁴ rtol of the
        largest amplitude are omitted.
    max_events : int
        Limit on the number of events.
    time_limit : float, optional
        Wall-clock limit of the motion in seconds.
    progress : callable, optional
        Called repeatedly with the completed fraction.

    Returns
    -------
    RingDown
        Empty if the coordinate does not oscillate.

    Raises
    ------
    DeclarationError
        If an argument is wrong, the system is driven, or the quantity has kinks, may jump, or
        depends on a coordinate without mass.

    Examples
    --------
    >>> import stickslip as ss
    >>> block = ss.System(
    ...     "block",
    ...     coordinates={"x": ss.Inertial()},
    ...     kinetic="d_x**2/2",
    ...     potential="x**2/2",
    ...     contacts={"floor": ss.Contact("d_x", 0.1)},
    ... )
    >>> decay = ss.ring_down(block, (0, 20), initial={"x": 0.85})
    >>> decay["amplitude"].values.round(12).tolist()
    [0.75, 0.55, 0.35, 0.15]
    >>> decay.stops
    True
    """
    values = checked_values(system, parameters)
    swinging = read_swinging(system, of, values)
    _check_free(system, values)
    start, end = system.span if span is None else span
    if not (np.isfinite(start) and np.isfinite(end) and start < end):
        raise DeclarationError(
            "span", f"({start:g}, {end:g}) is not a time span", "Give start < end, both finite"
        )
    motion = simulate(
        system,
        (start, end),
        initial=initial,
        parameters=parameters,
        rtol=rtol,
        atol=atol,
        max_events=max_events,
        time_limit=time_limit,
        progress=progress,
    )
    trace = SwingTrace(motion, swinging.along(motion))
    turns, notes = _kept(turning_points(trace), swinging.name, motion)
    fault = Residual(
        "turning points",
        turns.fault,
        _TURNS,
        note="velocity at a turning point, relative to the largest",
    )
    own = motion.certificate
    return RingDown(
        system,
        motion.parameters,
        swinging.name,
        _dataset(trace, swinging.name, turns),
        turns.stops,
        notes,
        replace(own, residuals=(*own.residuals, fault)),
        "" if _arrived(motion.outcome) else motion.message,
        motion.outcome.interrupted,
        motion.outcome is Outcome.TIME_UP,
    )


def _arrived(outcome: Outcome) -> bool:
    """Return whether a motion reached the end of its span, or permanent rest."""
    return outcome.ok or outcome is Outcome.AT_REST


def _check_free(system: System, values: Mapping[str, float]) -> None:
    """Check that the system does not depend on time.

    Raises
    ------
    DeclarationError
        If it does; the message names the drive, force or formula.
    """
    equations = derive(system.declaration)
    if not equations.timed:
        return
    zeros = {name: ex.ZERO for name, value in values.items() if value == 0.0}

    def acts(formula: ex.Expr) -> bool:
        try:
            return "t" in ex.substitute(formula, zeros).symbols
        except (ZeroDivisionError, OverflowError):
            return "t" in formula.symbols

    formulas = [*equations.formulas, *equations.kinks]
    acting = [formula for formula in formulas if acts(formula)]
    if not acting:
        return
    drives = [name for name, e in system.declaration.drives.items() if acts(e)]
    scope = system.declaration.scope
    forces = {x: scope.parse(force, f"forces.{x}") for x, force in system.forces.items()}
    pushed = [x for x, force in forces.items() if acts(force)]
    if drives:
        what, remedy = f"drive '{drives[0]}'", f'Switch it off, as with {drives[0]}="0"'
    elif pushed:
        # In the equations it is a force on modes, which is unknown to the user.
        what = f"the force on {pushed[0]}, {short(str(system.forces[pushed[0]]))}"
        remedy = "Switch it off, as with an amplitude of 0"
    else:
        what, remedy = short(ex.to_text(acting[0])), "Switch off the drive"
    raise DeclarationError(
        system.name, f"it depends on time ({what})", f"{remedy}; a ring-down is a free motion"
    )


def _kept(turns: TurningPoints, name: str, motion: Trajectory) -> tuple[TurningPoints, list[str]]:
    """The turning points between which amplitudes are well above the accuracy, and notes on
    them."""
    notes = list[str]()
    amplitude = 0.5 * np.abs(np.diff(turns.position))
    least = _LEAST * motion.rtol * float(np.max(amplitude, initial=0.0))
    small = np.flatnonzero(amplitude <= least)
    if len(small):
        count = int(small[0]) + 1
        at = turns.clock[count - 1] + motion.knots.origin
        notes.append(f"after t = {at:.6g} the amplitude is below {least:.3g} and is not evaluated")
        clock, position, rest = (part[:count] for part in (turns.clock, turns.position, turns.rest))
        turns = TurningPoints(clock, position, rest, turns.fault, False, False)
        amplitude = amplitude[: count - 1]
    elif turns.fades and len(amplitude):
        at = turns.clock[-1] + motion.knots.origin
        notes.append(f"after t = {at:.6g} the oscillation fades and is not evaluated")
    grows = int(np.count_nonzero(np.diff(amplitude) > 10.0 * motion.rtol * amplitude[:-1]))
    if grows:
        notes.append(
            f"the amplitude of {name} grows in {grows} of {len(amplitude)} half-cycles: several "
            "modes contribute, or energy is supplied"
        )
    return turns, notes


def _dataset(trace: SwingTrace, name: str, turns: TurningPoints) -> xarray.Dataset:
    """Half-cycles, turning points, and the motion."""
    import xarray as xr

    motion = trace.motion
    system, k = motion.system, motion.knots
    time = turns.clock + k.origin

    def steps(clock: Array) -> Array:
        index = np.searchsorted(k.clock, clock, side="right") - 1
        return np.clip(index, 0, len(k.clock) - 1)

    there = motion.values_at(turns.clock, steps(turns.clock))
    duration = np.diff(turns.clock)
    amplitude = 0.5 * np.abs(np.diff(turns.position))
    decrement = np.full(len(amplitude), np.nan)
    decrement[:-1] = np.log(amplitude[:-1] / amplitude[1:])
    between = np.full(len(amplitude), np.nan)
    between[:-1] = np.sqrt(amplitude[:-1] * amplitude[1:])
    shown = np.union1d(np.linspace(k.clock[0], k.clock[-1], _SAMPLES + 1), turns.clock)
    position, _ = trace(shown, steps(shown))
    x = quantity_or_formula(system, name)
    energy = energy_unit(system)
    meaning = x["long_name"]
    when = system.time_unit or "1"
    of_length = {key: text for key, text in x.items() if key == "units"}
    columns: dict[str, tuple[Array, dict[str, str]]] = {
        "time": (turns.clock[:-1] + 0.5 * duration + k.origin, described_as("time", when)),
        "amplitude": (amplitude, of_length | {"long_name": f"amplitude of {meaning}"}),
        "centre": (
            0.5 * (turns.position[1:] + turns.position[:-1]),
            of_length | {"long_name": f"middle of {meaning}"},
        ),
        "frequency": (0.5 / duration, described_as("frequency", per_time(system, "1"))),
        "decrement": (decrement, described_as("logarithmic decrement of a half-cycle", "1")),
        "damping": (
            decrement / np.sqrt(np.pi**2 + decrement**2),
            described_as("damping ratio", "1"),
        ),
        "damping_amplitude": (
            between,
            of_length | {"long_name": f"amplitude of {meaning}, between two half-cycles"},
        ),
        "dissipated": (
            np.diff(there["dissipated_energy"]),
            described_as("energy dissipated per half-cycle", energy),
        ),
    }
    at_turns: dict[str, tuple[Array, dict[str, str]]] = {
        "turn_time": (time, described_as("time", when)),
        "turn_position": (turns.position, x),
        "turn_rest": (turns.rest, described_as("time at rest", when)),
        "turn_energy": (there["energy"], described_as("energy", energy)),
    }
    drawn: dict[str, tuple[Array, dict[str, str]]] = {
        "sample_time": (shown + k.origin, described_as("time", when)),
        "sample_position": (position, x),
    }
    groups = (("half_cycle", columns), ("turn", at_turns), ("sample", drawn))
    return xr.Dataset(
        {
            key: (along, values, about)
            for along, group in groups
            for key, (values, about) in group.items()
        },
        attrs={"title": system.title or system.name, "coordinate": name},
    )


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


def _finite(values: Array) -> Array:
    return values[np.isfinite(values)]


def _from_to(label: str, values: Array, unit: str) -> list[tuple[str, str]]:
    """The first and the last of some values."""
    if not len(values):
        return []
    first, last = (with_unit(float(v), unit if unit != "1" else "", 6) for v in values[[0, -1]])
    return [(label, f"{first} at first, {last} at last" if len(values) > 1 else first)]
