"""Backbones: frequency and damping of a mode against its amplitude, with exact dry friction.

A decaying motion has no period. The extended periodic motion concept adds self-excitation
proportional to the mass, M q'' + ∂R/∂q' + ∂Φ/∂q = ξ M q', and determines the ξ for which there is a
cycle of a given amplitude. The frequency of the cycle is that of the mode, and D = ξ/(2ω) its
damping ratio: for linear systems with modal damping both are exact, and without interaction of
modes, the response at resonance has nearly the same values.

References
----------
M. Krack, Nonlinear modal analysis of nonconservative systems: extension of the periodic motion
concept, Computers & Structures 154 (2015) 59-71.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.certificates import Certificate, Residual, worst
from stickslip.errors import ConvergenceError, DeclarationError, StickslipError, listing
from stickslip.model.entries.units import with_unit
from stickslip.model.quantities import (
    contact_key,
    described,
    described_as,
    per_time,
    quantity_or_formula,
)
from stickslip.model.system import System
from stickslip.model.system_file import SYSTEM
from stickslip.motion.problem import checked_values, pose
from stickslip.numerics.levels import HARMONICS_KNOWN
from stickslip.orbits.cycles.cycle import Cycle
from stickslip.orbits.cycles.over_period import harmonics_of
from stickslip.orbits.return_map.recurrence import SHORTEST
from stickslip.orbits.studies.amplitudes import Amplitudes, AtAmplitude, share_of
from stickslip.orbits.studies.self_excitation import (
    EXCITATION,
    LinearMode,
    linear_modes,
    self_excited,
)
from stickslip.orbits.studies.swinging import Swinging, read_swinging
from stickslip.progress import watched
from stickslip.results import CERTIFICATE, PLAIN, Completion, Result, shortened, together
from stickslip.stopping.scopes import TimeUp, limited

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SAMPLES = 64  # samples of a period, and around the highest of them
_AGREES = 1e-8  # largest relative error of the amplitude
# factor on the requested amplitudes for smaller ones to try, and largest number of these
_SMALLER, _MOST_SMALLER = 0.25, 8


@dataclass(frozen=True, eq=False, repr=False)
class Backbone(Result):
    """Frequency and damping of a mode as functions of its amplitude.

    Attributes
    ----------
    system : System
    parameters : dict of str to float
    coordinate : str
        The quantity of the amplitude: a name or a formula.
    mode : int
        Number of the linear mode at which the backbone starts; 1 is the lowest.
    linear_frequency : float
        Angular frequency of that mode, with sticking sliders.
    dataset : xarray.Dataset
        Over ``point``, by increasing ``amplitude`` (half the range of the quantity):
        ``frequency`` ω, ``damping`` D = ξ/(2ω), ``excitation`` ξ, ``period``, ``energy`` (the
        largest kinetic energy), ``dissipated`` per period, ``dissipated_…`` in each contact,
        ``stick`` (fraction of the period in which all contacts stick), ``slips`` (0 where no
        contact slips), ``harmonic`` (of the quantity, its modulus).
    notes : list of str
        Amplitudes at which no cycle was found, and why.
    complete, time_up : bool
        Whether the computation was completed; if not, whether the time limit or the user stopped
        it.
    """

    KIND: ClassVar[str] = "backbone"
    PARTS: ClassVar = {
        "system": SYSTEM,
        "parameters": PLAIN,
        "mode": together("coordinate", "mode", "linear_frequency"),
        "notes": PLAIN,
        "certificate": CERTIFICATE,
        "complete": PLAIN,
        "time_up": PLAIN,
    }

    system: System
    parameters: dict[str, float]
    coordinate: str
    mode: int
    linear_frequency: float
    dataset: xarray.Dataset
    notes: list[str]
    certificate: Certificate
    complete: bool = True
    time_up: bool = False

    def __repr__(self) -> str:
        return (
            f"<Backbone of {self.system.name}: mode {self.mode}, {self.coordinate}, "
            f"{self.dataset.sizes['point']} amplitudes>"
        )

    @property
    def along(self) -> str:
        """Dimension of the points."""
        return "point"

    @property
    def amplitude(self) -> Array:
        """Amplitudes, in increasing order, shape (points,)."""
        return self.dataset["amplitude"].values

    @property
    def frequency(self) -> Array:
        """Angular frequencies, shape (points,)."""
        return self.dataset["frequency"].values

    @property
    def damping(self) -> Array:
        """Damping ratios, shape (points,)."""
        return self.dataset["damping"].values

    @property
    def outcome(self) -> Completion:
        """Whether there is a cycle for every amplitude."""
        if not self.complete:
            return Completion.TIME_UP if self.time_up else Completion.INTERRUPTED
        return Completion.STOPPED_EARLY if self.notes else Completion.FINISHED

    @property
    def message(self) -> str:
        """Number of amplitudes, and amplitudes without a cycle."""
        return "\n".join([f"amplitudes: {self.dataset.sizes['point']}", *self.notes])

    def facts(self) -> dict[str, Any]:
        """Summary as plain data."""
        data = self.dataset
        top = int(np.argmax(self.damping))
        return {
            **self.system.heading(),
            "coordinate": self.coordinate,
            "mode": self.mode,
            "linear frequency": self.linear_frequency,
            "points": data.sizes["point"],
            "amplitudes": [float(self.amplitude[0]), float(self.amplitude[-1])],
            "frequencies": [float(self.frequency[0]), float(self.frequency[-1])],
            "largest damping": {
                "amplitude": float(self.amplitude[top]),
                "frequency": float(self.frequency[top]),
                "damping": float(self.damping[top]),
            },
            "notes": self.notes,
        }

    def rows(self) -> list[tuple[str, str]]:
        """Summary as rows of text."""
        data = self.dataset
        units = {name: str(data[name].attrs.get("units", "1")) for name in data.data_vars}
        top = int(np.argmax(self.damping))

        def said(name: str, i: int) -> str:
            return with_unit(float(data[name][i]), units.get(name, "1"), 6)

        ends = [f"{said('frequency', i)} at {said('amplitude', i)}" for i in (0, -1)]
        return [
            ("backbone", f"of mode {self.mode} against the amplitude of {self.coordinate}"),
            ("linear frequency", with_unit(self.linear_frequency, units["frequency"], 9)),
            ("frequency", ", ".join(ends)),
            ("largest damping", f"{float(self.damping[top]):.6g} at {said('amplitude', top)}"),
            *shortened([("note", note) for note in self.notes]),
        ]

    @validated
    def plot(self, *quantities: str, ax: Axes | None = None) -> Figure:
        """Plot the frequency against the amplitude with the damping below, or other quantities.

        Parameters
        ----------
        *quantities : str
            Of the points: ``frequency``, ``damping``, ``energy``, ``dissipated``, ``stick``, ...
        ax : matplotlib.axes.Axes, optional
            Existing axes to draw the first of them into.

        Raises
        ------
        DeclarationError
            If there is no such quantity.
        """
        from stickslip.figures.backbone import plot_backbone

        return plot_backbone(self, list(quantities) or None, ax=ax)

    def overview(self, ax: Axes | None = None) -> Figure:
        """Plot the frequency against the amplitude with the damping below."""
        return self.plot(ax=ax)


@validated
def backbone(
    system: System,
    amplitudes: tuple[float, float],
    *,
    of: str | None = None,
    mode: int = 1,
    parameters: Mapping[str, float] | None = None,
    points: int = 30,
    time_limit: float | None = None,
) -> Backbone:
    """Compute frequency and damping of a mode as functions of its amplitude, by the extended
    periodic motion concept.

    Parameters
    ----------
    system : System
        A system with a constant mass matrix and without a drive: set the amplitude of a drive to
        zero, or configure the drive as 0.
    amplitudes : (float, float)
        Smallest and largest amplitude, positive. The amplitude is half the range of the quantity.
    of : str, optional
        Quantity of the amplitude: an inertial coordinate or its rate, a degree of freedom of a
        structure, such as ``"u[tip]"``, an output, or a formula of these without kinks, such as
        ``"u[tip] - u[root]"``; by default the first inertial coordinate, or the first named degree
        of freedom.
    mode : int
        Number of the linear mode to start from; 1 is the lowest. For the linear mode, sliders
        in series with springs stick, and contacts of coordinates with mass are omitted.
    parameters : mapping of str to float, optional
        Values that replace the defaults.
    points : int
        Number of amplitudes, spaced geometrically.
    time_limit : float, optional
        Wall-clock limit in seconds; the backbone found so far is returned.

    Returns
    -------
    Backbone
        Every point is a certified cycle of the system with the additional force ξ M q', with ω =
        2π/T and D = ξ/(2ω).

    Raises
    ------
    DeclarationError
        If an argument is wrong, the system depends on time, the state jumps, the mass matrix is
        not constant, small oscillations of the mode do not change the quantity, or the mode is
        overdamped at all amplitudes. If it is overdamped at some amplitudes only, the notes list
        these.
    ConvergenceError
        If no cycle is found at any amplitude.

    Examples
    --------
    >>> import stickslip as ss
    >>> oscillator = ss.catalogue.jenkins_oscillator(c=0.0, force=0)
    >>> found = ss.backbone(oscillator, (0.1, 10.0), points=5)
    >>> found.frequency.round(3).tolist()
    [1.414, 1.414, 1.226, 1.049, 1.009]
    """
    values = checked_values(system, parameters)
    wanted = _spaced(amplitudes, points)
    excited = self_excited(system, values)
    modes = linear_modes(excited, {**excited.values, **values})
    if not 1 <= mode <= len(modes):
        raise DeclarationError(
            "mode", f"unknown mode {mode}", f"Choose a mode from 1 to {len(modes)}"
        )
    chosen = modes[mode - 1]

    problem = pose(excited, values)

    def moved(name: str | None) -> Swinging:
        """Reject a quantity that the mode does not move."""
        swinging = read_swinging(system, name, {**system.values, **values})
        share_of(problem, chosen, swinging)
        return swinging

    with listing(moved):
        seeker = Amplitudes(excited, values, chosen, moved(of))
    work = _Work(seeker, wanted)
    ended: BaseException | None = None
    with limited(time_limit, f"a backbone of {system.name}") as scope, watched("backbone") as show:
        try:
            work.run(show)
        except (KeyboardInterrupt, TimeUp) as why:
            if not work.found or not scope.ends(why):
                raise
            ended = why
    if not work.kept:
        if chosen.overdamped or work.found:
            raise _overdamped(modes, mode, work)
        raise work.failure or ConvergenceError(
            f"a backbone of {system.name}", "no cycle was found", "Choose other amplitudes"
        )
    return _result(system, values, mode, work, ended)


def _spaced(amplitudes: tuple[float, float], points: int) -> Array:
    """Amplitudes in geometric progression over the requested range, shape (points,)."""
    low, high = amplitudes
    if not 0.0 < low < high < np.inf:
        raise DeclarationError(
            "amplitudes", f"({low:g}, {high:g}) is not a range of amplitudes", "Give 0 < low < high"
        )
    if isinstance(points, bool) or points < 2:
        raise DeclarationError("points", f"{points!r} is not a number of points", "Give at least 2")
    return np.geomspace(low, high, points)


def _overdamped(modes: list[LinearMode], mode: int, work: _Work) -> DeclarationError:
    """The error for a mode that is overdamped at all amplitudes, with the modes that oscillate."""
    chosen = modes[mode - 1]
    others = [str(i) for i, one in enumerate(modes, 1) if not one.overdamped and i != mode]
    known = [one.damping for one in work.found.values()] or [chosen.damping]
    remedies = ["choose larger amplitudes if the system hardens", "reduce the damping"]
    remedies[:0] = [f"choose one of the modes {', '.join(others)}"] if others else []
    return DeclarationError(
        "mode",
        f"mode {mode} is overdamped: its damping ratio is {chosen.damping:.6g} for small "
        f"oscillations and at least {min(known):.6g} at the amplitudes found, so it does not "
        "oscillate and has no backbone there",
        ", or ".join(remedies).capitalize(),
    )


class _Work:
    """Search for a cycle of every amplitude, from the ends and the middle; if the motion is far
    from the linear mode at all of them, from smaller amplitudes."""

    def __init__(self, seeker: Amplitudes, wanted: Array) -> None:
        self.seeker = seeker
        self.wanted = wanted
        self.found: dict[int, AtAmplitude] = {}
        self.reasons: dict[int, str] = {}
        self.failure: ConvergenceError | None = None

    @property
    def kept(self) -> dict[int, AtAmplitude]:
        """The cycles found, without those at which a mode that is overdamped for small amplitudes
        is still overdamped."""
        linear = self.seeker.mode.overdamped
        return {i: one for i, one in self.found.items() if not (linear and one.overdamped)}

    def run(self, show: Callable[[float, str], None]) -> None:
        """Start at each amplitude without a cycle, and continue in both directions."""
        for i in _order(len(self.wanted)):
            if i not in self.found:
                self._begin(i, float(self.wanted[i]), show)
        for power in range(1, _MOST_SMALLER + 1):
            if self.found:
                break
            self._begin(0, float(self.wanted[0]) * _SMALLER**power, show)

    def _begin(self, i: int, amplitude: float, show: Callable[[float, str], None]) -> None:
        """Start at an amplitude, and continue to the i-th and the following amplitudes, and to the
        preceding ones."""
        try:
            first = self.seeker.first(amplitude)
        except (StickslipError, ArithmeticError, np.linalg.LinAlgError) as failure:
            self.reasons.setdefault(i, str(failure))
            if isinstance(failure, ConvergenceError):
                self.failure = self.failure or failure
            return
        count = len(self.wanted)
        for way in (range(i, count), range(i - 1, -1, -1)):
            free = list[int]()
            for k in way:
                if k in self.found:
                    break
                free.append(k)
            left = iter(free)

            def take(one: AtAmplitude, left: Any = left) -> None:
                self.found[next(left)] = one
                text = f"amplitude {one.amplitude:.6g}"
                show(len(self.found) / count, text)

            why = self.seeker.follow(first, self.wanted[free], take)
            self.reasons |= dict.fromkeys(list(left)[:1], why)

    def notes(self) -> list[str]:
        """Amplitudes without a cycle, or at which the mode is overdamped, in words."""
        kept, notes = self.kept, list[str]()
        for i, a in enumerate(self.wanted.tolist()):
            if i not in self.found:
                why = f": {self.reasons[i]}" if i in self.reasons else ""
                notes.append(f"no cycle at the amplitude {a:.6g}{why}")
            elif i not in kept:
                ratio = self.found[i].damping
                notes.append(
                    f"at the amplitude {a:.6g} the mode is overdamped: its damping ratio is "
                    f"{ratio:.6g}"
                )
        return notes


def _order(count: int) -> list[int]:
    """Order of the starts: the first, the last, the middle, and so on by bisection."""
    order = [0, count - 1]
    step = count - 1
    while step > 1:
        half = (step + 1) // 2
        order += [i for i in range(half, count, half) if i not in order]
        step = half
    return order


# -- results ---------------------------------------------------------------------------------------


def _result(
    system: System,
    values: dict[str, float],
    mode: int,
    work: _Work,
    ended: BaseException | None,
) -> Backbone:
    """The result of all cycles found."""
    import xarray as xr

    swinging, linear = work.seeker.swinging, work.seeker.mode
    found = [one for _, one in sorted(work.kept.items())]
    harmonics = [_harmonic(one.cycle, swinging) for one in found]
    table = [
        {**_measured(system, linear, one), "harmonic": abs(c)}
        for one, (c, _) in zip(found, harmonics, strict=True)
    ]
    attributes = _attributes(system, swinging.name)
    data = {
        name: ("point", np.array([row[name] for row in table]), attributes.get(name, {}))
        for name in table[0]
    }
    data["slips"] = ("point", data["slips"][1].astype(np.int8), data["slips"][2])
    about = {"title": system.title or system.name, "coordinate": swinging.name, "mode": mode}
    certificate = worst([one.cycle.certificate for one in found])
    missed = max(
        abs(row["amplitude"] / one.amplitude - 1.0) for row, one in zip(table, found, strict=True)
    )
    own = Residual("amplitudes", missed, _AGREES, note="relative to the requested ones")
    known = max(error for _, error in harmonics)
    note = "change by the last halving of the panels"
    waves = Residual("first harmonics", known, HARMONICS_KNOWN, note=note)
    certificate = Certificate(
        (*certificate.residuals, own, waves),
        certificate.outcome,
        certificate.unverified,
        certificate.notes,
    )
    return Backbone(
        system,
        values,
        swinging.name,
        mode,
        linear.frequency,
        xr.Dataset(data, attrs=about),
        work.notes() if ended is None else [],
        certificate,
        ended is None,
        isinstance(ended, TimeUp),
    )


def _measured(system: System, linear: LinearMode, one: AtAmplitude) -> dict[str, float]:
    """Measures of a cycle."""
    cycle = one.cycle
    frequency = 2.0 * np.pi / cycle.period
    excitation = cycle.parameters[EXCITATION]
    shares = cycle.contacts
    of_contacts = dict[str, float]()
    for name in system.contacts:
        own = [share for c, share in shares.items() if c == name or c.startswith(f"{name} ")]
        of_contacts[f"dissipated_{contact_key(name)}"] = sum(share.dissipated for share in own)
    slips = any(share.slip_time > SHORTEST * cycle.period for share in shares.values())
    return {
        "amplitude": one.measured,
        "frequency": frequency,
        "damping": excitation / (2.0 * frequency),
        "excitation": excitation,
        "period": cycle.period,
        "energy": _kinetic_energy(cycle, linear.mass),
        "dissipated": cycle.dissipated,
        **of_contacts,
        "stick": cycle.stick_time / cycle.period,
        "slips": float(slips),
    }


def _harmonic(cycle: Cycle, swinging: Swinging) -> tuple[complex, float]:
    """The first harmonic of the quantity, and the change by the last halving of the panels of the
    part that does not follow from the harmonics of the state."""
    asked = {swinging.name: swinging.value}
    found, errors = harmonics_of(cycle.trajectory, asked, cycle.harmonic, 1)
    return found[swinging.name], errors[swinging.name]


def _kinetic_energy(cycle: Cycle, mass: Array) -> float:
    """Largest kinetic energy in a period, from samples, refined samples around the largest, and the
    parabola through the largest of these."""
    n = len(mass)

    def energies(part: Array) -> Array:
        rates = cycle.closed.states_at(part % 1.0)[:, n : 2 * n]
        return 0.5 * np.einsum("ti,ij,tj->t", rates, mass, rates)

    part = np.arange(_SAMPLES) / _SAMPLES
    highest = part[int(np.argmax(energies(part)))]
    energy = energies(highest + np.linspace(-1.0, 1.0, _SAMPLES + 1) / _SAMPLES)
    i = int(np.argmax(energy))
    if not 0 < i < len(energy) - 1:
        return float(energy[i])
    a, b, c = energy[i - 1 : i + 2]
    # The vertex of the parabola through three equidistant samples.
    bend = a - 2.0 * b + c
    return float(b - (c - a) ** 2 / (8.0 * bend)) if bend < 0.0 else float(b)


def _attributes(system: System, name: str) -> dict[str, dict[str, Any]]:
    """Units and meanings."""
    x = quantity_or_formula(system, name)
    time = system.time_unit or "1"
    energy = described(system, "energy_per_cycle")
    unit = energy.get("units")
    return {
        "amplitude": {**x, "long_name": f"amplitude of {x['long_name']}"},
        "harmonic": {**x, "long_name": f"first harmonic of {x['long_name']}"},
        "frequency": described_as("angular frequency", per_time(system, "rad")),
        "damping": described_as("damping ratio", "1"),
        "excitation": described_as("self-excitation by mass", per_time(system, "1")),
        "period": described_as("period", time),
        "energy": described_as("largest kinetic energy", unit),
        "dissipated": energy,
        **{
            f"dissipated_{contact_key(c)}": described_as(f"energy per cycle in {c}", unit)
            for c in system.contacts
        },
        "stick": described(system, "stick_fraction"),
        "slips": described_as("whether a contact slips", "1"),
    }
