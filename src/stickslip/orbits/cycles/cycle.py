"""Cycles and gaits: motions that close after a period, up to a drift along a translation.

Newton's method on the return map finds stable and unstable ones alike; the order of sticking and
slipping comes from the motion itself. Sources: R. Seydel, *Practical Bifurcation and Stability
Analysis*, chapter 7 (shooting); R. I. Leine, H. Nijmeijer, *Dynamics and Bifurcations of Non-Smooth
Mechanical Systems* (stick-slip cycles).
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.certificates import Certificate
from stickslip.equations.field import MODE_NAMES, mode_name
from stickslip.errors import DeclarationError, short
from stickslip.kept import cached_property
from stickslip.model.entries.units import with_unit
from stickslip.model.quantities import described, drift_units, per_distance_unit
from stickslip.model.system import System
from stickslip.motion.audit.observers import Sums
from stickslip.motion.outcome import Outcome
from stickslip.motion.problem import pose
from stickslip.motion.record.knots import IS_CLOSED, IS_OPEN
from stickslip.numerics.levels import COMPUTED_ZERO, GUARD_TOUCHED
from stickslip.orbits.cycles import measure, over_period
from stickslip.orbits.cycles.certificate import certify_cycle
from stickslip.orbits.cycles.drive_phase import phase_of_drive, read_drive, relative_phase
from stickslip.orbits.cycles.finding import from_state
from stickslip.orbits.cycles.measure import ContactShare, Phase, drift_of
from stickslip.orbits.return_map.damped_newton import Closed
from stickslip.orbits.return_map.mode_sequence import nearest_change
from stickslip.orbits.return_map.recurrence import modes_of_structures
from stickslip.results import Result, listed, restored_certificate

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.motion.trajectory import Trajectory


_NEUTRAL = 1e-9  # multipliers this close to the unit circle are on it


@dataclass(frozen=True, eq=False)
class Cycle(Result):
    """A periodic motion, possibly with a drift. Its properties are computed on first access.

    Attributes
    ----------
    system : System
    parameters : dict of str to float
    """

    KIND: ClassVar[str] = "cycle"

    system: System
    parameters: dict[str, float]
    _found: Closed | None = None

    def __repr__(self) -> str:
        period = with_unit(self.period, self.units["time"])
        drift = f", drift {with_unit(self.drift, self.units['drift'], 6)}" if self.drift else ""
        return f"<Cycle of {self.system.name}: period {period}, {self.stability}{drift}>"

    @cached_property
    def closed(self) -> Closed:
        """The orbit closed by Newton's method; for a stored cycle it is computed again."""
        if self._found is not None:
            return self._found
        problem = pose(
            self.system, {name: self.parameters[name] for name in self.system.parameters}
        )
        return from_state(problem, problem.initial_state(self.state), self.time)

    @cached_property
    def certificate(self) -> Certificate:
        """Residuals of the cycle; see :func:`stickslip.orbits.cycles.certificate.certify_cycle`."""
        return certify_cycle(self.closed)

    @cached_property
    def trajectory(self) -> Trajectory:
        """One period of the motion."""
        return self.closed.orbit.motion

    @cached_property
    def period(self) -> float:
        """Period of the cycle."""
        return self.closed.orbit.period

    @cached_property
    def time(self) -> float:
        """Time of `state`; it matters only for driven systems."""
        return self.closed.shooting.start

    @cached_property
    def state(self) -> dict[str, float]:
        """State at the start of the period."""
        first = self.closed.orbit.legs[0].place.state
        return dict(zip(self.system.declaration.state, map(float, first), strict=True))

    @cached_property
    def section(self) -> str:
        """Description of the state at which the period starts."""
        words = {**MODE_NAMES, IS_OPEN: "open", IS_CLOSED: "closed"}
        modes = ", ".join(
            f"{c}: {mode_name(m, True) if c in self.system.planes else words[m]}"
            for c, m in self.phases[0].modes.items()
        )
        return "the middle of a phase" + (f" ({modes})" if modes else "")

    @cached_property
    def multipliers(self) -> Array:
        """Floquet multipliers, complex, the largest first: growth factors of small perturbations
        over one period. Exactly 0 for perturbations that vanish in stick, or in slip without
        mass."""
        return self.closed.spectrum.every

    @cached_property
    def nontrivial(self) -> Array:
        """The multipliers without those that are 1 by symmetry."""
        return self.closed.spectrum.others

    @cached_property
    def trivial(self) -> int:
        """Number of multipliers that are 1 by symmetry: one for the time shift of an autonomous
        system, one for each translation, and one for each position of a contact that never
        slips."""
        return len(self.closed.spectrum.trivial)

    @cached_property
    def differentiable(self) -> bool:
        """Whether the return map is differentiable at the cycle. It is not if events coincide or a
        guard is touched; the multipliers are then one-sided."""
        return _differentiable(self.closed)

    @cached_property
    def phases(self) -> tuple[Phase, ...]:
        """The sequence of modes, from the simulation."""
        return measure.phases(self.trajectory)

    @cached_property
    def extrema(self) -> dict[str, tuple[float, float]]:
        """Smallest and largest value of each component of the state, unknown of a structure, and
        output."""
        sums = self.trajectory.audit.sums
        ends = zip(map(float, sums.low), map(float, sums.high), strict=True)
        found = dict(zip(self.system.declaration.state, ends, strict=True))
        return found | self.visible_extrema

    def extrema_of(self, name: str) -> tuple[float, float]:
        """Smallest and largest value of one of them; cheaper, unless it is a mode of a
        structure."""
        seen = self.visible_extrema
        return seen[name] if name in seen else self.extrema[name]

    @cached_property
    def visible_extrema(self) -> dict[str, tuple[float, float]]:
        """Extrema without modes of structures, whose extrema are expensive if some are fast."""
        audit = self.trajectory.audit
        modes = modes_of_structures(self.trajectory.problem)
        own = np.ones(len(audit.known), dtype=bool)
        for part in modes:
            own[part] = False
        sums = audit.shares if np.all(audit.known[own]) else audit.sums
        names = self.system.declaration.state
        found = {names[i]: (float(sums.low[i]), float(sums.high[i])) for i in np.flatnonzero(own)}
        return found | over_period.extrema(self.trajectory)

    @cached_property
    def ranges(self) -> Array:
        """Smallest and largest value of each component of the state, shape (n, 2); for modes of
        structures, those of samples."""
        sums = self.trajectory.audit.shares
        return np.column_stack([sums.low, sums.high])

    @cached_property
    def harmonic(self) -> dict[str, complex]:
        """First harmonic of each component of the state, unknown of a structure, and output: c in
        Re(c exp(iωt)), where ω is the frequency of the drives, or of the cycle if there are none. A
        cycle of several periods of the drives has subharmonics as well."""
        return self._harmonics[0]

    @cached_property
    def _harmonics(self) -> tuple[dict[str, complex], dict[str, float]]:
        """First harmonics with their errors: of the state (no name) and of each output."""
        setting = self.closed.shooting.setting
        order = setting.turns if setting.symmetry.driven else 1
        own, error = over_period.harmonics(self.trajectory, self.closed.orbit.shift, order)
        found = dict(zip(self.system.declaration.state, own.tolist(), strict=True))
        for name, row in self.system.unknowns.items():
            found[name] = sum((w * found[mode] for mode, w in row.items()), 0j)
        outputs = self.system.declaration.outputs
        others, more = over_period.harmonics_of(self.trajectory, outputs, found, order)
        return found | others, {"": error, **more}

    @cached_property
    def relative_phase(self) -> dict[str, float]:
        """Phase of the first harmonic of each coordinate, unknown of a structure, or output,
        relative to the drive, in (−3π/2, π/2], negative if it lags behind: relative to the only
        drive of the system, or to the force on it (of an output, the only force that depends on
        time). Empty if nothing drives the system; quantities without a drive are omitted."""
        setting = self.closed.shooting.setting
        if not setting.symmetry.driven:
            return {}
        turn = self.period / setting.turns
        found = dict[str, float]()
        for name in self.system.followed:
            with suppress(DeclarationError):
                own = phase_of_drive(
                    self.system, read_drive(self.system, name), self.parameters, turn
                )
                found[name] = float(relative_phase(np.angle(self.harmonic[name]), own))
        return found

    @cached_property
    def contacts(self) -> dict[str, ContactShare]:
        """Duration of stick and slip and dissipated energy of each contact in one period."""
        return measure.contact_shares(self.trajectory, self.sums)

    @cached_property
    def stick_time(self) -> float:
        """Time in which all contacts stick, in one period."""
        return sum(phase.duration for phase in self.phases if phase.sticks)

    @cached_property
    def slip_time(self) -> float:
        """Time in one period in which not all contacts stick."""
        return sum(phase.duration for phase in self.phases if not phase.sticks)

    @cached_property
    def dissipated(self) -> float:
        """Energy that is dissipated in one period."""
        return float(self.trajectory.audit.dissipated[-1])

    @cached_property
    def supplied(self) -> float:
        """Energy that is supplied in one period."""
        return float(self.trajectory.audit.supplied[-1])

    @cached_property
    def direction(self) -> dict[str, float]:
        """Direction of the drift: the declared translation, or scaled such that the largest
        component is 1. Empty without drift."""
        return drift_of(self.system, self._shift)[0]

    @cached_property
    def drift(self) -> float:
        """Shift along `direction` in one period."""
        return drift_of(self.system, self._shift)[1]

    @property
    def _shift(self) -> Array:
        """Shift of the state in a period; zero for components that are rounding errors."""
        orbit = self.closed.orbit
        moved = np.ptp(orbit.motion.knots.state, axis=0)
        return np.where(np.abs(orbit.shift) > COMPUTED_ZERO * moved, orbit.shift, 0.0)

    @cached_property
    def residual(self) -> float:
        """Closure error of the motion, relative to its size."""
        return self.closed.shooting.miss(self.closed.orbit)

    @property
    def sums(self) -> Sums:
        """Sums over the period, by contact."""
        return self.trajectory.audit.shares

    @property
    def dataset(self) -> xarray.Dataset:
        """One period of the motion."""
        return self.trajectory.dataset

    @property
    def outcome(self) -> Outcome:
        """Always periodic; a ConvergenceError is raised if no cycle is found."""
        return Outcome.PERIODIC

    @property
    def message(self) -> str:
        """Description of the cycle."""
        return f"a {self.stability} cycle of period {with_unit(self.period, self.units['time'])}"

    @property
    def speed(self) -> float:
        """Drift per time."""
        return self.drift / self.period

    @validated
    def sensitivity(self, names: Sequence[str], of: Sequence[str] | None = None) -> xarray.Dataset:
        """Derivatives of period, drift, speed, extremes, amplitudes and multipliers with respect to
        parameters, or those of chosen measures.

        All but those of multipliers are exact; see
        :func:`stickslip.orbits.sensitivities.cycle.cycle_sensitivity`.

        Parameters
        ----------
        names : sequence of str
        of : sequence of str, optional
            Measures by the names that they have in :func:`stickslip.sweep`: ``"period"``,
            ``"speed:x"``, ``"shift:x"``, ``"state:x"``, ``"low:f"``, ``"high:f"``,
            ``"amplitude:f"``, ``"mean:f"``, ``"rms:f"``, ``"crest:f"``, ``"harmonic:f"``,
            ``"phase:f"``, ``"relative_phase:f"``, ``"stick_fraction"``, ``"energy_per_cycle"``,
            ``"energy_per_distance"``, ``"cost_of_transport:m*g"``. f is an output or any formula of
            quantities of results.

        Raises
        ------
        DeclarationError
            If there is no such parameter or measure, or the cycle has no derivative.

        Examples
        --------
        >>> import stickslip as ss
        >>> cycle = ss.find_cycle(ss.catalogue.prandtl_tomlinson())
        >>> slopes = cycle.sensitivity(["k"], of=["energy_per_distance", "mean:k*(X - x)"])
        >>> [f"{float(slopes[name][0]):.6f}" for name in slopes]
        ['-0.143328', '-0.143328']
        """
        from stickslip.orbits.sensitivities.cycle import cycle_sensitivity

        return cycle_sensitivity(self, names, of=of)

    @property
    def stable(self) -> bool:
        """Whether the cycle is stable (modulo phase and translations)."""
        return bool(np.all(np.abs(self.nontrivial) < 1.0 - _NEUTRAL))

    @property
    def neutral(self) -> bool:
        """Whether the cycle is neutrally stable, as without damping."""
        return not self.stable and bool(np.all(np.abs(self.nontrivial) <= 1.0 + _NEUTRAL))

    @property
    def stability(self) -> str:
        """``"stable"``, ``"neutral"`` or ``"unstable"``."""
        return "stable" if self.stable else "neutral" if self.neutral else "unstable"

    @property
    def sticks(self) -> bool:
        """Whether some contact sticks during a part of the period."""
        return any(share.stick_time > 0.0 for share in self.contacts.values())

    @property
    def energy_per_distance(self) -> float:
        """Energy dissipated per distance, which is the mean friction of a pulled body; infinite
        without drift."""
        return self.dissipated / abs(self.drift) if self.drift else math.inf

    @property
    def units(self) -> dict[str, str]:
        """Units of time, energy, drift, speed and energy per distance; ``"1"`` if not declared."""
        drift, speed = drift_units(self.system, self.direction)
        energy = described(self.system, "energy_per_cycle").get("units", "1")
        return {
            "time": self.system.time_unit or "1",
            "energy": energy,
            "drift": drift,
            "speed": speed,
            "energy_per_distance": per_distance_unit(self.system, drift),
        }

    def facts(self) -> dict[str, Any]:
        """Summary as plain data."""
        return {
            **self.system.heading(),
            "period": self.period,
            "stable": self.stable,
            "stability": self.stability,
            "drift": self.drift,
            "speed": self.speed,
            "stick_time": self.stick_time,
            "slip_time": self.slip_time,
            "state": self.state,
            "units": self.units,
            "multipliers": [[float(z.real), float(z.imag)] for z in self.multipliers],
            "extrema": {name: list(ends) for name, ends in self.extrema.items()},
            "contacts": {name: asdict(share) for name, share in self.contacts.items()},
            "phases": [asdict(phase) for phase in self.phases],
            "energy_per_distance": self.energy_per_distance,
            "dissipated": self.dissipated,
            "residual": self.residual,
        }

    def rows(self) -> list[tuple[str, str]]:
        """Summary as rows of text."""
        units = self.units
        rows = [
            ("period", with_unit(self.period, units["time"], 12)),
            ("stability", self.stability),
            ("multipliers", listed(_in_words(self.multipliers))),
        ]
        if self.contacts:
            shares = (with_unit(t, units["time"], 9) for t in (self.stick_time, self.slip_time))
            several = len(self.contacts) > 1
            said = "stick of all contacts, slip of any" if several else "stick, slip"
            rows.append((said, ", ".join(shares)))
        if self.drift:
            drift = with_unit(self.drift, units["drift"], 9)
            speed = with_unit(self.speed, units["speed"], 9)
            energy = with_unit(self.energy_per_distance, units["energy_per_distance"], 9)
            rows += [
                ("drift", f"{drift} per period, speed {speed}"),
                ("energy per distance", energy),
            ]
        return rows

    @validated
    def plot(
        self,
        *quantities: str,
        ax: Axes | None = None,
        t: tuple[float, float] | None = None,
        coordinates: Sequence[str] | None = None,
    ) -> Figure:
        """Plot the cycle or, with a time window or selected coordinates, one period as a motion:
        see :meth:`stickslip.Trajectory.plot`."""
        if t is None and coordinates is None:
            return super().plot(*quantities, ax=ax)
        return self.trajectory.plot(*quantities, ax=ax, t=t, coordinates=coordinates)

    def overview(self, ax: Axes | None = None) -> Figure:
        """Plot the motion or, for a gait, which contact moves when."""
        if ax is None and self.drift and self.contacts:
            from stickslip.figures.gait import plot_gait

            return plot_gait(self)
        return self.trajectory.overview(ax)

    def stored(self) -> tuple[xarray.Dataset, dict[str, Any]]:
        """One period in the form of a stored motion, with the properties of the cycle."""
        data, parts = self.trajectory.stored()
        said = {name: getattr(self, name) for name in _SAID}
        said |= {
            "multipliers": _pairs(self.multipliers),
            "nontrivial": _pairs(self.nontrivial),
            "phases": [asdict(phase) for phase in self.phases],
            "contacts": {name: asdict(share) for name, share in self.contacts.items()},
            "measured": asdict(self.certificate),
        }
        return data, {**parts, "cycle": said}

    @classmethod
    def restored(cls, data: xarray.Dataset, parts: Mapping[str, str], where: str) -> Self:
        """Restore a stored cycle."""
        from stickslip.motion.trajectory import Trajectory

        motion = Trajectory.restored(data, parts, where)
        said: dict[str, Any] = json.loads(parts["cycle"])
        phases = (Phase(p["duration"], p["modes"], tuple(p["region"])) for p in said["phases"])
        changed = {
            "multipliers": _complex(said["multipliers"]),
            "nontrivial": _complex(said["nontrivial"]),
            "phases": tuple(phases),
            "extrema": {name: tuple(ends) for name, ends in said["extrema"].items()},
            "contacts": {name: ContactShare(**share) for name, share in said["contacts"].items()},
            "certificate": restored_certificate(said.pop("measured")),
            "trajectory": motion,
        }
        cycle = cls(motion.system, dict(motion.parameters))
        vars(cycle).update(said | changed)
        return cycle

    @validated
    def mean(self, formula: str) -> float:
        """The mean of a formula over a period, (1/T) ∫ f dt, such as the mean force of a spring
        that pulls the system.

        Parameters
        ----------
        formula : str
            May use the parameters, functions, drives, facts and outputs of the system, ``t``, the
            state, the rates ``d_x``, and the quantities of contacts in :meth:`Trajectory.at`, such
            as ``friction_c``.

        Raises
        ------
        DeclarationError
            If the formula is invalid, or undefined somewhere on the cycle.

        Examples
        --------
        >>> import stickslip as ss
        >>> cycle = ss.find_cycle(ss.catalogue.prandtl_tomlinson())
        >>> print(f"{cycle.mean('k*(X - x)'):.6f} {cycle.energy_per_distance:.6f}")
        0.465260 0.465260
        """
        found, _ = over_period.mean(self.trajectory, formula)
        if not math.isfinite(found):
            raise DeclarationError(
                "formula",
                f"{short(formula)} is undefined on the cycle",
                "Use a formula that is defined along the whole cycle",
            )
        return found

    @validated
    def cost_of_transport(self, weight: float | str) -> float:
        """Energy dissipated per distance and weight; dimensionless.

        Parameters
        ----------
        weight : float or str
            A force, as a number or as a formula of the parameters, such as ``"m*g"``.

        Raises
        ------
        DeclarationError
            If it is not a positive number or a valid formula.
        """
        if isinstance(weight, str):
            weight = measure.weight(self.system, weight, self.parameters)
        elif not 0.0 < weight < math.inf:
            raise DeclarationError(
                "weight",
                f"{weight} is not a positive number",
                "Give the weight as a positive number",
            )
        return self.energy_per_distance / weight

    def describe(self) -> str:
        """Description in a few lines."""
        shown = ", ".join(_in_words(self.multipliers))
        units = self.units
        period, stick, slip, energy = (
            with_unit(value, units[kind], digits)
            for value, kind, digits in (
                (self.period, "time", 12),
                (self.stick_time, "time", 9),
                (self.slip_time, "time", 9),
                (self.dissipated, "energy", 9),
            )
        )
        if len(self.contacts) > 1:
            stick, slip = f"of all contacts {stick}", f"of any {slip}"
        lines = [
            f"period {period}, {self.stability}, multipliers {shown}",
            f"stick {stick}, slip {slip}, dissipated {energy}",
        ]
        if self.drift:
            drift = with_unit(self.drift, units["drift"])
            speed = with_unit(self.speed, units["speed"])
            lines.append(f"drift {drift} per period, speed {speed}")
        lines.append(self.certificate.verdict)
        return "\n".join(lines)


# Entries of a cycle and its fields as data for JSON.
_SAID = (
    "period",
    "time",
    "state",
    "section",
    "trivial",
    "differentiable",
    "extrema",
    "stick_time",
    "slip_time",
    "dissipated",
    "supplied",
    "direction",
    "drift",
    "residual",
)


def _in_words(values: Array) -> list[str]:
    """Complex numbers as texts."""
    return [f"{z.real:.6g}" + (f"{z.imag:+.6g}i" if z.imag else "") for z in values]


def _pairs(values: Array) -> list[list[float]]:
    """Complex numbers for JSON."""
    return [[float(z.real), float(z.imag)] for z in values]


def _complex(pairs: Sequence[Sequence[float]]) -> Array:
    """Complex numbers from JSON."""
    return np.array([complex(*pair) for pair in pairs])


def make_cycle(closed: Closed) -> Cycle:
    """The closed orbit as a result."""
    problem = closed.orbit.problem
    return Cycle(problem.system, dict(problem.parameters), closed)


def _differentiable(closed: Closed) -> bool:
    """Return whether neighbouring motions have the same sequence: no events coincide accidentally,
    and no guard is touched."""
    smooth = all(leg.differentiable for leg in closed.orbit.legs)
    return bool(
        smooth and nearest_change(closed.orbit.motion, closed.shooting.pieces) > GUARD_TOUCHED
    )
