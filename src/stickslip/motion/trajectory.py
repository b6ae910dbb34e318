"""A computed motion: data, values at any time, certificate, file and picture."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.certificates import Certificate
from stickslip.errors import DeclarationError, StickslipError
from stickslip.kept import cached_property
from stickslip.model.entries.polynomials import ends_of_tables
from stickslip.model.quantities import FORCES, contact_key, forces_of, of_modes, quantity
from stickslip.model.system import System
from stickslip.motion.certify import certify_trajectory
from stickslip.motion.outcome import Outcome
from stickslip.motion.problem import Problem, pose
from stickslip.motion.record.audited import Audit, audited
from stickslip.motion.record.knots import IS_OPEN, Knots
from stickslip.motion.record.retraced import Retraced
from stickslip.motion.record.switches import Switches, flags_of_modes
from stickslip.numerics.levels import ON_SURFACE
from stickslip.results import Result, listed
from stickslip.stopping.scopes import unbroken
from stickslip.symbolic import expressions as ex

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.motion.event_catalogue import EventCatalogue

GRID = 1000  # number of points of the dataset between knots


class Trajectory(Result):
    """The motion of a system.

    Attributes
    ----------
    system : System
    parameters : dict of str to float
    problem : Problem
        The compiled system with these parameters, from which the motion can be recomputed.
    t_span : (float, float)
        The requested time span.
    outcome : Outcome
        Outcome of the computation.
    start : array, shape (n,), or None
        The requested initial state, which the certificate compares with the first state.
    """

    KIND: ClassVar[str] = "trajectory"

    def __init__(
        self,
        problem: Problem,
        t_span: tuple[float, float],
        knots: Knots,
        outcome: Outcome,
        rtol: float = 1e-10,
        start: Array | None = None,
    ) -> None:
        self.problem = problem
        self.t_span = t_span
        self.knots = knots
        self.outcome = outcome
        self.rtol = rtol
        self.start = start
        self.wall_time: float = 0.0
        if outcome is Outcome.UNDEFINED and len(knots.clock) == 1 and self._ends_of_tables():
            self.outcome = Outcome.OUTSIDE_TABLE  # it has not begun

    def __repr__(self) -> str:
        return (
            f"<Trajectory of {self.system.name}: t = {self.t_span[0]:g} ... "
            f"{self.knots.time[-1]:g}, "
            f"{self.n_switches} switches, {self.outcome.label}>"
        )

    @property
    def system(self) -> System:
        """The system that moves."""
        return self.problem.system

    @property
    def parameters(self) -> dict[str, float]:
        """Values of all parameters."""
        return self.problem.parameters

    @property
    def atol(self) -> float:
        """Absolute accuracy; smaller components are not resolved."""
        return self.problem.atol * self.rtol

    @property
    def message(self) -> str:
        """Description of the outcome."""
        if self.outcome.ok:
            return self.outcome.message
        label = self.outcome.label
        if self.outcome in (Outcome.JUMPS_MEET, Outcome.JUMPS_ON):
            label = f"{label} ({listed(self._jumps_at_the_end())})"
        if self.outcome is Outcome.OUTSIDE_TABLE:
            said = self._ends_of_tables()
            label = f"{label} ({said[0]})" if said else label
        return f"{label} at t = {self.knots.time[-1]:.9g}: {self.outcome.message}"

    def _ends_of_tables(self) -> list[str]:
        """Tables whose argument is at or beyond an end where the motion ends, with that
        argument."""
        equations = self.problem.compiled.equations
        values = {**self.parameters, **self.final, "t": float(self.knots.time[-1])}
        return ends_of_tables(equations.kinks, equations.speeds, values)

    def _jumps_at_the_end(self) -> list[str]:
        """Jumps whose guards are zero at the end of the motion, within their accuracy."""
        values = {**self.parameters, **self.final, "t": float(self.knots.time[-1])}
        sizes = dict(zip(self.final, map(float, self.dense_output.seen), strict=False)) | {
            "t": values["t"]
        }
        found = []
        for jump in self.problem.compiled.equations.jumps:
            felt = jump.guard.symbols & sizes.keys()
            slopes = {name: ex.evaluate(ex.derivative(jump.guard, name), values) for name in felt}
            size = sum(abs(slope * sizes[name]) for name, slope in slopes.items())
            if abs(ex.evaluate(jump.guard, values)) <= ON_SURFACE * size:
                found.append(jump.name)
        return found

    @property
    def warnings(self) -> list[str]:
        """Declared conditions that the parameters violate, and driving records that are longer than
        the motion."""
        conditions = self.system.declaration.conditions
        failed = [
            f"{self.system.conditions[name].formula} fails: {reason}"
            for name, condition in conditions.items()
            if (reason := condition.fails(self.parameters))
        ]
        return failed + self.system.left_out(*self.t_span)

    # -- names and rows ----------------------------------------------------------------------------

    @cached_property
    def row_of(self) -> dict[str, int]:
        """Row of each published quantity, without modes and energies."""
        layout = self.problem.compiled.layout
        contacts = self.switches.contacts
        rows = {name: i for i, name in enumerate(layout.state)}
        rows |= {name: row for name, row in layout.named.items() if name not in rows}
        for parts in self.system.frictional.values():
            kinds = forces_of(parts)
            for name in parts:
                key = contact_key(name)
                if key not in contacts:
                    continue
                i = contacts[key]
                whole = layout.force[i], layout.plus[i], layout.minus[i], layout.u[i]
                force, plus, minus, u = layout.parts.get(name, whole)
                own = {
                    "friction": force,
                    "threshold": plus,
                    "threshold_plus": plus,
                    "threshold_minus": minus,
                }
                rows |= {f"{kind}_{key}": own[kind] for kind in kinds}
                rows[f"slip_speed_{key}"] = u
        for key, i in self.switches.openings.items():
            whole = layout.force[i], 0, 0, layout.gaps[i]
            force, *_, gap = layout.parts.get(f"normal_{key}", whole)
            rows |= {f"normal_{key}": force, f"gap_{key}": gap}
        return rows | {f"normal_{contact_key(name)}": i for name, i in layout.carrying.items()}

    @cached_property
    def switches(self) -> Switches:
        """Modes of the contacts, switches and jumps, from knot to knot."""
        return Switches(self.system, self.problem.compiled.equations, self.knots)

    @property
    def modes(self) -> dict[str, Array]:
        """Mode of each contact after every knot, by its name in variables: 0 in stick, ±1 in slip
        (1 in a plane); for a contact that can open also 2 if open, and 3 if closed and
        frictionless."""
        return self.switches.modes

    @cached_property
    def impacts(self) -> pandas.DataFrame:
        """Impacts: time, contact whose gap closed, approach speed, rebound speed, and energy lost
        at all contacts.

        If the initial velocity violates a closed contact, the motion begins with an impact that is
        not listed.
        """
        import pandas as pd

        k = self.knots
        first = len(self.problem.compiled.equations.kinks)
        numbers = {first + i: key for key, i in self.switches.openings.items()}
        struck = self._impacts
        before = self.dense_output.rows(k.clock[struck], struck - 1)
        after = self.dense_output.rows(k.clock[struck], struck)
        rows = [self.problem.compiled.layout.u[k.cause[i] - first] for i in struck]
        each = np.arange(len(struck))
        energy = self.problem.compiled.layout.rows
        return pd.DataFrame(
            {
                "time": k.time[struck],
                "contact": [numbers[int(k.cause[i])] for i in struck],
                "approach": -before[each, rows],
                "rebound": after[each, rows],
                "energy": before[:, energy] - after[:, energy],
            }
        )

    @cached_property
    def _impacts(self) -> Array:
        """Knots at which a gap has closed with a speed, so that velocities jump; not the last one
        where the motion ends because they cannot."""
        k = self.knots
        first = len(self.problem.compiled.equations.kinks)
        closed = np.isin(k.cause, [first + i for i in self.switches.openings.values()])
        closed[0] = False
        closed[-1] &= self.outcome not in (Outcome.NO_COLLISION, Outcome.CREATES_ENERGY)
        index = np.flatnonzero(closed)
        return index[k.mode[index - 1, k.cause[index] - first] != 0]

    @cached_property
    def state_jumps(self) -> Array:
        """Indices of the knots at which the state jumps, in impacts or declared jumps."""
        jumped = np.flatnonzero(np.any(self.switches.jumped, axis=1)) + 1
        return np.union1d(self._impacts, jumped)

    @cached_property
    def jumps(self) -> pandas.DataFrame:
        """Jumps of the state: time, name, and change of energy.

        A loss of energy counts as dissipated, a gain as supplied.
        """
        import pandas as pd

        knot, which = map(np.ascontiguousarray, np.nonzero(self.switches.jumped))
        clock = self.knots.clock[knot + 1]
        energy = self.problem.compiled.layout.rows
        before = self.dense_output.rows(clock, knot)[:, energy]
        after = self.dense_output.rows(clock, knot + 1)[:, energy]
        names = np.array([*self.system.jumps], dtype=object)
        time = self.knots.time[knot + 1]
        columns = {"time": time, "jump": names[which], "energy_change": after - before}
        return pd.DataFrame(columns)

    @cached_property
    def dense_output(self) -> Retraced:
        """States, rows and work at any time, recomputed from the knots."""
        return Retraced(self.problem, self.knots)

    def _sample(self, times: Array, index: Array) -> Array:
        """Values of all rows, energy and powers at times within the steps of the knots `index`."""
        return self.dense_output.rows(times - self.knots.origin, index)

    def states_at(self, times: Array, index: Array) -> Array:
        """States at times within the steps of the knots `index`, shape (times, states)."""
        return self.dense_output.states(times - self.knots.origin, index)

    @cached_property
    def audit(self) -> Audit:
        """Energy, work and violations at the knots, recomputed from them."""
        k = self.knots
        rows = self.problem.compiled.layout.rows
        energy = self.dense_output.rows_by_steps(k, k.clock, np.arange(len(k.clock)))[:, rows]
        return audited(self.problem, k, self.dense_output.seen, energy)

    # -- queries
    # --------------------------------------------------------------------------------------

    @validated
    def at(self, t: ArrayLike, side: str = "right") -> dict[str, Any]:
        """All quantities at given times, as accurate as at a switch.

        Parameters
        ----------
        t : float or array
            Times within the computed span.
        side : {"right", "left"}
            Limit to take where a velocity or rate jumps.

        Returns
        -------
        dict of str to float or array
            Coordinates, rates ``d_x``, internal variables; named degrees of freedom of structures,
            such as ``u[tip]``, and their rates; outputs; per contact ``friction_``,
            ``threshold_plus_``, ``threshold_minus_``, ``slip_speed_``, ``mode_``; ``energy``,
            ``dissipated_energy``, ``supplied_energy``.

        Raises
        ------
        DeclarationError
            If a time is outside the computed span, or `side` is invalid.
        """
        times = np.atleast_1d(np.asarray(t, dtype=float))
        first, last = float(self.knots.time[0]), float(self.knots.time[-1])
        if side not in ("left", "right"):
            raise DeclarationError("side", f"{side!r} is not a side", "Use 'left' or 'right'")
        shape = times.shape
        clock = np.ascontiguousarray(times.ravel()) - self.knots.origin
        if times.size and not (
            np.all(clock >= self.knots.clock[0]) and np.all(clock <= self.knots.clock[-1])
        ):
            raise DeclarationError(
                "t", "a time is outside the computed time span", f"Use {first:g} <= t <= {last:g}"
            )
        index = np.searchsorted(self.knots.clock, clock, side=side) - 1
        index = np.clip(index, 0, len(self.knots.clock) - 1)
        values = self.values_at(clock, index)
        return {
            name: v[0].item() if np.ndim(t) == 0 else v.reshape(shape) for name, v in values.items()
        }

    def trace(self, names: Sequence[str], times: Array, index: Array) -> dict[str, Array]:
        """Quantities at many times, for plots; see trace.py.

        Parameters
        ----------
        names : sequence of str
            Parts of the state, degrees of freedom of structures, friction forces and thresholds,
            outputs.
        times : array, shape (n,)
        index : array of int, shape (n,)
            Number of the step that each time belongs to; ascending, as are the times in one step.
        """
        from stickslip.motion.between.dense import make_scratch, shared_forces
        from stickslip.motion.between.formulas import Along
        from stickslip.motion.between.trace import TOLERANCE, trace_rows

        outputs = {n: e for n, e in self.system.declaration.outputs.items() if n in names}
        if outputs:
            found = Along(self, [*outputs.values()])(times, index)
            others = [name for name in names if name not in outputs]
            values = self.trace(others, times, index) if others else {}
            return values | dict(zip(outputs, found.T, strict=True))
        forms = {n: row for n, row in self.system.unknowns.items() if n in names}
        if forms:
            modes = [mode for row in forms.values() for mode in row]
            others = [name for name in names if name not in forms]
            values = self.trace([*dict.fromkeys([*others, *modes])], times, index)
            return values | of_modes(forms, values)
        p, k = self.problem, self.knots
        shown = p.compiled.layout.without_series | shared_forces(p.rows)
        followed = [name for name in names if self.row_of[name] not in shown]
        wanted = np.array([self.row_of[name] for name in followed], dtype=np.int64)
        out = np.empty((len(wanted), len(times)))
        work = make_scratch(p.rows, (p.order + 2, len(wanted)))
        given = self.dense_output.seen, k.record, index, times - k.origin, wanted, work, out
        if followed:
            unbroken(lambda: trace_rows(p.machine, p.flow()._replace(tol=TOLERANCE), *given))
        values = dict(zip(followed, out, strict=True))
        if len(followed) < len(names):
            sampled = self._sample(times, index)
            values = {
                name: values[name] if name in values else sampled[:, self.row_of[name]]
                for name in names
            }
        self._without_contact(values, index)
        return values

    def values_at(self, clock: Array, index: Array) -> dict[str, Array]:
        """All published quantities at times since the origin, within the steps of the knots
        `index`."""
        from stickslip.motion.between.formulas import evaluated

        values = self._values_without_outputs(clock, index)
        outputs = self.system.declaration.outputs
        if not outputs:
            return values
        given = {**values, **self.parameters, "t": clock + self.knots.origin}
        found = evaluated([*outputs.values()], given, len(clock))
        return values | dict(zip(outputs, found, strict=True))

    def _values_without_outputs(self, clock: Array, index: Array) -> dict[str, Array]:
        """The same without outputs."""
        out = self.dense_output.rows(clock, index)
        rows = self.problem.compiled.layout.rows
        values = {name: out[:, row] for name, row in self.row_of.items()}
        values |= of_modes(self.system.unknowns, values)
        self._without_contact(values, index)
        for key, mode in self.modes.items():
            values[f"mode_{key}"] = mode[index]
        values["energy"] = out[:, rows]
        work = self.dense_output.work(clock, index)
        values["dissipated_energy"] = self.audit.dissipated[index] + work[:, 0]
        values["supplied_energy"] = self.audit.supplied[index] + work[:, 1]
        return values

    def _without_contact(self, values: dict[str, Array], index: Array) -> None:
        """Let the forces of what is open be exactly zero: solving leaves rounding errors."""
        for key in self.switches.openings:
            is_open = self.modes[key][index] == IS_OPEN
            for kind in ("normal", *FORCES):
                name = f"{kind}_{key}"
                if name in values:
                    values[name] = np.where(is_open, 0.0, values[name])

    @cached_property
    def certificate(self) -> Certificate:
        """Energy balance, friction law and equations of motion, measured."""
        return certify_trajectory(self)

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """All quantities on the knots and on an even grid of times (right limits where something
        jumps)."""
        import xarray as xr

        k = self.knots
        clock = np.union1d(k.clock, np.linspace(k.clock[0], k.clock[-1], GRID + 1))
        index = np.searchsorted(k.clock, clock, side="right") - 1
        values = self.values_at(clock, index)
        variables = {name: ("time", v, self._attributes(name)) for name, v in values.items()}
        coordinate = ("time", clock + k.origin, quantity(self.system, "t"))
        return xr.Dataset(
            variables,
            {"time": coordinate},
            {
                "title": self.system.title or self.system.name,
                "source": self.system.source,
                "outcome": self.outcome.label,
            },
        )

    def _attributes(self, name: str) -> dict[str, Any]:
        """Unit and meaning of a published quantity; for a mode, the meaning of its numbers."""
        contact = self._contact_of_mode.get(name)
        if contact is None:
            return quantity(self.system, name)
        return {"long_name": f"mode of {contact}", **flags_of_modes(self.system, contact)}

    @cached_property
    def _contact_of_mode(self) -> dict[str, str]:
        """Contacts by the names under which their modes are published."""
        names = [*self.system.frictional, *self.system.unilateral, *self.system.constraints]
        found = {contact_key(contact): contact for contact in names}
        return {f"mode_{key}": contact for key, contact in found.items() if key in self.modes}

    @cached_property
    def events(self) -> pandas.DataFrame:
        """Every change of mode or region, and every jump: time, contact (or the kink, or the jump),
        from, to, and the state.

        Contacts whose relative velocities are multiples of one another switch together, under their
        joined names; ``slip+`` and ``slip-`` then refer to the first of them. Passing a sample of a
        drive is not an event.
        """
        return self.switches.events(self.problem.compiled.layout.state)

    @validated
    def event_catalogue(
        self,
        *,
        faster_than: float | None = None,
        above: Mapping[str, float] | None = None,
        energy: bool = True,
    ) -> EventCatalogue:
        """Return the slip events: each begins with the first slip after all contacts have been
        sticking, and ends when all stick again.

        Parameters
        ----------
        faster_than : float, optional
            If given, an event lasts as long as the rate of some coordinate exceeds this value, as
            for rate-and-state friction, which never sticks.
        above : mapping of str to float, optional
            Levels of outputs, or of any formula of quantities of results. If given, an event lasts
            as long as one of these exceeds its level, and its size is the integral over the event,
            such as the seismic moment if the output is a moment rate. Values are sampled at 33
            points of each Taylor step and at the extrema between them; faster oscillations of a
            formula of time, such as ``sin(400*t)``, are not resolved.
        energy : bool
            Whether to compute energies and the certificate, which requires a pass through the whole
            motion.

        Raises
        ------
        DeclarationError
            If no contact is dry and neither a rate nor a level is given, or both are.
        """
        from stickslip.motion.event_catalogue import catalogue_of, events_above, fast_events

        if faster_than is not None and above is not None:
            raise DeclarationError(
                "above", "a rate is given, too", "Give faster_than or above, not both"
            )
        if above is not None:
            return events_above(self, above)
        return catalogue_of(self, energy) if faster_than is None else fast_events(self, faster_than)

    @validated
    def sensitivity(
        self,
        names: Sequence[str],
        times: ArrayLike | None = None,
        *,
        of: Sequence[str] | None = None,
        second_opinion: bool = False,
    ) -> xarray.Dataset:
        """Derivatives of the motion with respect to parameters and initial values, exact across
        switches, corners and impacts.

        Parameters
        ----------
        names : sequence of str
            Parameters; and components of the state, or degrees of freedom of structures, such as
            ``"u[tip]"``, for their initial values.
        times : array, optional
            By default 201 evenly spaced times.
        of : sequence of str, optional
            Quantities, or formulas of them; by default the state.
        second_opinion : bool
            Whether to compute finite differences of motions, too (a variable with
            ``_by_differences`` for each quantity). They are meaningless at times through which a
            switch passes.

        Returns
        -------
        xarray.Dataset
            A variable for each quantity, over ``parameter`` and ``time``; ``d_switch_time`` over
            ``parameter`` and ``switch``. After the first time without a derivative, values are NaN,
            and the attribute ``missing`` gives the reason.

        Raises
        ------
        DeclarationError
            If a name, a quantity or a time is unknown, or rates have no formula (a drag without
            mass).

        Examples
        --------
        >>> import stickslip as ss
        >>> motion = ss.simulate(ss.catalogue.belt_block(), (0, 10))
        >>> found = motion.sensitivity(["k", "x"], [10.0], of=["x", "friction_belt"])
        >>> found["x"].dims
        ('parameter', 'time')
        """
        from stickslip.orbits.sensitivities.motion import dataset_of, sensitivities

        when = None if times is None else np.asarray(times, float)
        return dataset_of(sensitivities(self, names, when, of), second_opinion)

    @property
    def n_switches(self) -> int:
        """Number of changes between stick and slip, over all contacts."""
        return int(np.count_nonzero(self.switches.switched[0]))

    @property
    def n_kinks(self) -> int:
        """Number of kinks (regions of piecewise functions) crossed, without samples of drives and
        guards of jumps."""
        return int(np.count_nonzero(self.switches.crossed))

    @property
    def final(self) -> dict[str, float]:
        """The last state."""
        return dict(
            zip(self.problem.compiled.layout.state, map(float, self.knots.state[-1]), strict=True)
        )

    # -- summaries
    # ------------------------------------------------------------------------------------

    def facts(self) -> dict[str, Any]:
        """Summary as plain data."""
        return {
            **self.system.heading(),
            "t_span": list(self.t_span),
            "end": float(self.knots.time[-1]),
            "switches": self.n_switches,
            **({"jumps": len(self.jumps)} if self.system.jumps else {}),
            "final": self.final,
            "warnings": self.warnings,
            "rtol": self.rtol,
        }

    def rows(self) -> list[tuple[str, str]]:
        """Summary as rows of text."""
        from stickslip.display.symbols import unicode_symbol

        final = [f"{unicode_symbol(name)} = {value:.6g}" for name, value in self.final.items()]
        rows = [
            ("time", f"{self.t_span[0]:g} to {self.knots.time[-1]:g}"),
            ("switches", str(self.n_switches)),
            *([("jumps", str(len(self.jumps)))] if self.system.jumps else []),
            ("final state", listed(final)),
        ]
        return rows + [("warning", warning) for warning in self.warnings]

    @validated
    def plot(
        self,
        *quantities: str,
        ax: Axes | None = None,
        t: tuple[float, float] | None = None,
        coordinates: Sequence[str] | None = None,
    ) -> Figure:
        """Plot the motion, or a part of it.

        Parameters
        ----------
        *quantities : str
            Variables of the dataset, one panel each; by default an overview. Or the name of a
            registered plot (:func:`stickslip.figures.register`).
        ax : matplotlib.axes.Axes, optional
            Existing axes to draw into, all quantities together.
        t : (float, float), optional
            Time window.
        coordinates : sequence of str, optional
            Coordinates, internal variables and outputs that the overview shows.

        Raises
        ------
        DeclarationError
            If there is no such quantity or coordinate, or the window does not lie within the
            computed span.
        """
        if t is None and coordinates is None:
            return super().plot(*quantities, ax=ax)
        from stickslip.figures.drawing.quantities import plot_quantities
        from stickslip.figures.drawing.sampling import checked_window
        from stickslip.figures.motion import plot_trajectory

        if not quantities and ax is None:
            return plot_trajectory(self, t, coordinates)
        data = self.dataset
        if t is not None:
            low, high = checked_window(self, t)
            time = data["time"].values
            data = data.isel(time=np.flatnonzero((time >= low) & (time <= high)))
        shown = quantities or coordinates or tuple(self.system.declaration.coordinates)
        return plot_quantities(data, shown, self.along, ax)

    def overview(self, ax: Axes | None = None) -> Figure:
        """Plot time traces with stick phases shaded and, if informative, the phase plane; only the
        coordinates if axes are given."""
        if ax is not None:
            return self.plot(*self.system.declaration.coordinates, ax=ax)
        from stickslip.figures.motion import plot_trajectory

        return plot_trajectory(self)

    def stored(self) -> tuple[xarray.Dataset, dict[str, Any]]:
        """The dataset and the knots, from which all values between them are computed."""
        knots, parts = self.minimal_parts()
        return self.dataset.merge(knots), parts

    def minimal_parts(self) -> tuple[xarray.Dataset, dict[str, Any]]:
        """The knots, and the data of the system."""
        import xarray as xr

        k = self.knots
        extra = {
            "knot_time": ("knot", k.clock),
            "knot_state": (("knot", "state"), k.state),
            "knot_mode": (("knot", "contact"), k.mode),
            "knot_region": (("knot", "kink"), k.region),
            "knot_cause": ("knot", k.cause),
        }
        settings = {
            "t_span": self.t_span,
            "origin": k.origin,
            "order": self.problem.order,
            "tolerance": self.problem.tolerance,
            "atol": self.problem.atol,
            "rtol": self.rtol,
            "outcome": self.outcome.code,
            "wall_time": self.wall_time,
            "start": None if self.start is None else self.start.tolist(),
        }
        parts = {
            "system": self.system.to_toml(),
            "parameters": self.parameters,
            "settings": settings,
        }
        return xr.Dataset(extra), parts

    @classmethod
    def restored(cls, data: xarray.Dataset, parts: Mapping[str, str], where: str) -> Self:
        """Restore a stored motion from its knots."""
        from stickslip.model.system_file import loads

        system = loads(parts["system"], f"{where}: system")
        parameters = json.loads(parts["parameters"])
        settings = json.loads(parts["settings"])
        names = ("time", "state", "mode", "region", "cause")
        origin = settings.get("origin", 0.0)
        knots = Knots(
            *(np.ascontiguousarray(data[f"knot_{name}"].values) for name in names), origin=origin
        )
        checked = pose(system, {name: parameters[name] for name in system.parameters})
        numbers = (settings[name] for name in ("order", "tolerance", "atol"))
        problem = Problem(system, checked.parameters, *numbers, origin=origin)
        n = len(system.declaration.state)
        if knots.state.ndim != 2 or knots.state.shape[1] != n or len(knots.time) == 0:
            raise StickslipError(f"{where}: the stored states do not match the stored system")
        outcome = Outcome.from_code(settings["outcome"])
        asked = settings.get("start")
        start = None if asked is None else np.array(asked, float)
        if start is not None and start.shape != (n,):
            raise StickslipError(f"{where}: the stored start does not match the stored system")
        span = tuple(settings["t_span"])
        trajectory = cls(problem, span, knots, outcome, settings["rtol"], start)
        trajectory.wall_time = settings["wall_time"]
        return trajectory
