"""Catalogues of slip events, as in seismology: start, duration and size of each event.

An event lasts from the first slip after all contacts have stuck to the next time when all do. With
R. Burridge, L. Knopoff, Bull. Seismol. Soc. Am. 57 (1967) 341-371, and J. M. Carlson, J. S. Langer,
Phys. Rev. A 40 (1989) 6470-6484, its size is the sum of the slips of all contacts, the moment of an
earthquake up to a factor.

Friction that depends on rate and state never sticks: there an event lasts as long as some
coordinate is faster than a given rate, or as an output, or any other quantity, is above a level.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from stickslip.arguments import argument_said
from stickslip.arrays import Array
from stickslip.certificates import Certificate, Residual, worst
from stickslip.errors import ConvergenceError, DeclarationError, short
from stickslip.model.entries.units import factors, unit_product, unit_text, with_unit
from stickslip.model.quantities import (
    described_as,
    energy_unit,
    quantity,
    quantity_or_formula,
    slip_unit,
)
from stickslip.model.system import System
from stickslip.model.system_file import SYSTEM
from stickslip.motion.between.formulas import Along, read_formula
from stickslip.motion.record.extrema import extrema_between
from stickslip.motion.record.slips import (
    NODES_OF_STEP,
    dry_contacts_of,
    intervals_of_slip,
    slipping_contacts,
    slips_in,
)
from stickslip.motion.simulate import run_loop
from stickslip.numerics.levels import FEW_ROUNDINGS, HALVINGS
from stickslip.results import CERTIFICATE, ITEMS, PLAIN, Completion, Result
from stickslip.stopping.scopes import watching
from stickslip.symbolic.formulas import is_finite

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.motion.trajectory import Trajectory

_MAGNITUDE = 2.0 / 3.0  # magnitude per decade of the moment
_LOOKS = 33  # number of samples of a step
_MOST_STEPS = 10_000_000  # largest number of events of a motion that is recomputed


@dataclass(frozen=True, eq=False, repr=False)
class EventCatalogue(Result):
    """The slip events of a motion, or of several consecutive motions.

    ``catalogue.table`` is a pandas.DataFrame with one row per event.

    Attributes
    ----------
    system : System
    parameters : dict of str to float
    dataset : xarray.Dataset
        Over ``event``: ``start`` and ``duration``; ``interevent`` (time since the start of the
        previous event); ``size`` (sum of the slips of all contacts, each from the start of the
        event to its end), ``largest_slip`` and ``contacts`` (number of contacts that slip),
        ``first`` (the contact that slipped first), or the same for coordinates, if events are
        defined by a rate; ``energy_released`` (energy dissipated in the event) and ``energy_drop``
        (decrease of the energy of the system over the event, which is the same without energy
        supply), NaN if not requested.
    span : (float, float)
        Time span of the motion. Events that begin before it or end after it are not listed.
    certificate : Certificate
        The certificate of the motion.
    """

    KIND: ClassVar[str] = "event catalogue"
    PARTS: ClassVar = {
        "system": SYSTEM,
        "parameters": PLAIN,
        "span": ITEMS,
        "certificate": CERTIFICATE,
    }

    system: System
    parameters: dict[str, float]
    dataset: xarray.Dataset
    span: tuple[float, float]
    certificate: Certificate

    def __repr__(self) -> str:
        start, end = self.span
        return (
            f"<EventCatalogue of {self.system.name}: {len(self)} events in t = {start:g} ... "
            f"{end:g}>"
        )

    def __len__(self) -> int:
        return self.dataset.sizes["event"]

    def __getitem__(self, name: str) -> xarray.DataArray:
        return self.dataset[name]

    @property
    def along(self) -> str:
        """Dimension of the dataset."""
        return "event"

    def b_value(self, least: float | None = None) -> tuple[float, float]:
        """The exponent of the Gutenberg-Richter law log₁₀ N(≥ M) = a − b·M, with the magnitude
        M = ⅔ log₁₀ size, by maximum likelihood (K. Aki, Bull. Earthq. Res. Inst. 43 (1965) 237).

        Parameters
        ----------
        least : float, optional
            Smallest size to include; by default that of the smallest event.

        Returns
        -------
        (float, float)
            The exponent and its standard error b/√N.

        Raises
        ------
        DeclarationError
            If fewer than two events are at least as large, or all have the same size.
        """
        sizes = self.dataset["size"].values
        sizes = sizes[sizes > 0.0]
        first = float(least) if least is not None else float(sizes.min(initial=np.inf))
        counted = sizes[sizes >= first]
        excess = _MAGNITUDE * (np.mean(np.log10(counted / first)) if len(counted) else 0.0)
        if len(counted) < 2 or not excess > 0.0:
            raise DeclarationError(
                "least",
                f"{len(counted)} events reach this size, and they are too few or all equal",
                "Give a smaller value, or simulate a longer time span",
            )
        b = float(np.log10(np.e) / excess)
        return b, b / math.sqrt(len(counted))

    def recurrence(self) -> tuple[float, float]:
        """Mean of the times between events, and their coefficient of variation (standard deviation
        divided by mean), which is 0 for regular events, 1 for a Poisson process, and larger for
        clusters.

        Raises
        ------
        DeclarationError
            If there are fewer than three events.
        """
        times = self.dataset["interevent"].values
        times = times[np.isfinite(times)]
        if len(times) < 2:
            raise DeclarationError(
                "recurrence", f"the catalogue has {len(self)} events", "Simulate a longer time span"
            )
        mean = float(np.mean(times))
        return mean, float(np.std(times, ddof=1)) / mean

    @property
    def outcome(self) -> Completion:
        """Whether there is any event."""
        return Completion.FINISHED if len(self) else Completion.NOTHING_FOUND

    @property
    def message(self) -> str:
        """Number of events."""
        start, end = self.span
        if not len(self):
            return f"no slip begins and ends in t = {start:g} ... {end:g}"
        return f"{len(self)} events in t = {start:g} ... {end:g}"

    def facts(self) -> dict[str, Any]:
        """Summary as plain data."""
        data = self.dataset
        names = ("size", "duration", "interevent", "energy_released", "energy_drop")
        return {
            **self.system.heading(),
            "span": list(self.span),
            "events": len(self),
            **{
                f"{how} {name.replace('_', ' ')}": float(of(data[name].values))
                for name in names
                if np.any(np.isfinite(data[name].values))
                for how, of in (("mean", np.nanmean), ("largest", np.nanmax))
            },
        }

    def rows(self) -> list[tuple[str, str]]:
        """Summary as rows of text."""
        start, end = self.span
        rows = [("events", f"{len(self):,}"), ("time", f"{start:g} to {end:g}")]
        if said := self.dataset.attrs.get("events"):
            rows.append(("an event", str(said)))
        for name in ("size", "duration", "interevent", "energy_released"):
            values = self.dataset[name].values
            values = values[np.isfinite(values)]
            if not len(values):
                continue
            unit = self.dataset[name].attrs.get("units", "1")
            least, most = (with_unit(float(v), unit, 4) for v in (values.min(), values.max()))
            mean = with_unit(float(values.mean()), unit, 4)
            rows.append((name.replace("_", " "), f"{least} to {most}, mean {mean}"))
        if len(self) > 2:
            rows.append(("recurrence", f"coefficient of variation {self.recurrence()[1]:.3g}"))
        if len(self):
            most = int(self.dataset["contacts"].max())
            of = int(self.dataset.attrs.get("count", len(self.system.frictional)))
            rows.append((str(self.dataset["contacts"].attrs["long_name"]), f"up to {most} of {of}"))
        return rows

    def overview(self, ax: Axes | None = None) -> Figure:
        """Plot sizes over time and their sum, the number of events above each size, and times
        between events; only these numbers if axes are given."""
        from stickslip.figures.event_catalogue import plot_catalogue

        return plot_catalogue(self, ax)

    @classmethod
    def fields_of(cls, data: xarray.Dataset) -> dict[str, Any]:
        """Names of contacts were fixed-length texts in the file."""
        return {"dataset": data.assign(first=data["first"].astype(object))}

    @classmethod
    def joined(cls, pieces: Sequence[EventCatalogue]) -> EventCatalogue:
        """Join the catalogues of consecutive motions.

        Parameters
        ----------
        pieces : sequence of EventCatalogue
            Of one system with the same parameters, in chronological order. All contacts stick where
            one motion continues the previous one; it may begin before an event that is incomplete
            in the previous one.

        Raises
        ------
        DeclarationError
            If the sequence is empty, or the catalogues overlap or belong to different systems.
        """
        import xarray as xr

        if not pieces:
            raise DeclarationError(
                "pieces", "no catalogue was given", "Give at least one catalogue"
            )
        first = pieces[0]
        for before, piece in pairwise(pieces):
            other = piece.dataset.attrs.get("events") != first.dataset.attrs.get("events")
            if other or piece.system != first.system or piece.parameters != first.parameters:
                raise DeclarationError(
                    "pieces",
                    "they belong to different systems or parameters",
                    "Give catalogues of one motion",
                )
            ends = [before.span[0], *(before["start"] + before["duration"]).values[-1:].tolist()]
            # start + duration is rounded
            if piece.span[0] < max(ends) - FEW_ROUNDINGS * abs(max(ends)):
                raise DeclarationError(
                    "pieces",
                    f"a catalogue begins at {piece.span[0]:g}, before the end {max(ends):g} of "
                    "the previous one",
                    "Give them in order of time, without overlap",
                )
        data = xr.concat([piece.dataset for piece in pieces], "event", combine_attrs="override")
        data["interevent"].values[:] = _interevent(data["start"].values)
        return cls(
            first.system,
            first.parameters,
            data,
            (first.span[0], pieces[-1].span[1]),
            worst([piece.certificate for piece in pieces]),
        )


def catalogue_of(motion: Trajectory, energy: bool = True) -> EventCatalogue:
    """The slip events of a motion.

    Parameters
    ----------
    energy : bool
        Whether energies are measured, and with them the certificate: that takes a pass through the
        whole motion.

    Raises
    ------
    DeclarationError
        If no contact is dry.
    """
    import xarray as xr

    system = motion.system
    if not system.frictional:
        raise DeclarationError(
            "contacts",
            f"{system.name} has no dry contacts",
            "Give the rate above which an event is counted, like event_catalogue(faster_than=0.01)",
        )
    k = motion.knots
    names, columns = dry_contacts_of(motion)
    slipping = slipping_contacts(motion, [own[0] for own in columns])
    runs = intervals_of_slip(slipping, k.clock)
    own = np.logical_or.reduceat(slipping, runs.ravel())[::2] if len(runs) else slipping[:0]
    # A contact that has stuck throughout has not slipped; its difference is a rounding error.
    moved = slips_in(motion, runs)
    sizes = np.stack([np.linalg.norm(moved[:, own], axis=1) for own in columns], axis=1)
    sizes = np.where(own, sizes, 0.0)
    begun, ended = runs.T
    none = np.full(len(runs), np.nan)
    released, spent = none, none.copy()
    certificate = Certificate((Residual("motions not audited", 1.0, 0.0),))
    if energy:
        audit = motion.audit
        released = audit.energy[begun] - audit.energy[ended]
        spent = audit.dissipated[ended] - audit.dissipated[begun]
        certificate = motion.certificate
    table = {
        "start": k.time[begun],
        "duration": k.clock[ended] - k.clock[begun],
        "interevent": _interevent(k.time[begun]),
        "size": np.sum(sizes, axis=1),
        "largest_slip": np.max(sizes, axis=1, initial=0.0),
        "contacts": np.sum(own, axis=1),
        "first": names[np.argmax(slipping[begun], axis=1)] if len(runs) else names[:0],
        "energy_drop": released,
        "energy_released": spent,
    }
    attributes = _attributes(system)
    data = xr.Dataset(
        {name: ("event", values, attributes[name]) for name, values in table.items()},
        attrs={"title": system.title or system.name, "source": system.source},
    )
    span = float(k.time[0]), float(k.time[-1])
    return EventCatalogue(system, dict(motion.parameters), data, span, certificate)


@dataclass(frozen=True)
class _Watched:
    """Quantities, each of which is above its level in an event.

    Attributes
    ----------
    levels : array, shape (names,)
    values : callable
        Times since the origin, and steps -> quantities, shape (times, names).
    said : str
        What an event is.
    """

    motion: Trajectory
    names: list[str]
    levels: Array
    values: Callable[[Array, Array], Array]
    said: str

    def above(self, clock: Array, index: Array) -> Array:
        """Whether one of them is, shape (times,)."""
        return np.any(self.values(clock, index) > self.levels, axis=1)


def fast_events(motion: Trajectory, rate: float) -> EventCatalogue:
    """The events of a motion in which some coordinate is faster than a rate.

    Rates are sampled at 33 places of each Taylor step and at their extrema between these; the times
    at which they pass the limit are then exact up to rounding.

    Raises
    ------
    DeclarationError
        If the rate is not positive, or there are no coordinates.
    """
    if not 0.0 < rate < math.inf:
        raise DeclarationError(
            "faster_than", f"{rate:g} is not a positive number", "Give a positive rate"
        )
    system = motion.system
    names = list(system.plain.coordinates)
    if not names:
        raise DeclarationError(
            "faster_than", f"{system.name} has no coordinates", "Declare a coordinate"
        )
    units = {quantity(system, x)["units"] for x in names}
    speeds = {quantity(system, f"d_{x}")["units"] for x in names}
    slip, speed = (found.pop() if len(found) == 1 else None for found in (units, speeds))

    def rates(clock: Array, index: Array) -> Array:
        found = motion.trace([f"d_{x}" for x in names], clock + motion.knots.origin, index)
        return np.abs(np.stack([found[f"d_{x}"] for x in names], axis=-1))

    said = f"while a rate is above {with_unit(rate, speed or '1', 6)}"
    watched = _Watched(motion, names, np.full(len(names), rate), rates, said)
    start, end = _stretches(watched)
    before, after = (motion.at(t + motion.knots.origin) for t in (start, end))
    moved = np.stack([np.abs(after[x] - before[x]) for x in names], axis=-1)
    attributes = {
        "size": described_as("total slip", slip),
        "largest_slip": described_as("largest slip of a coordinate", slip),
        "contacts": described_as("number of fast coordinates", "1"),
        "first": described_as("first coordinate to become fast", None),
        "largest_rate": described_as("largest rate", speed),
    }
    return _listed(watched, (start, end), moved, attributes)


def events_above(motion: Trajectory, levels: Mapping[str, float]) -> EventCatalogue:
    """The events of a motion in which one of some quantities is above its level.

    Parameters
    ----------
    levels : mapping of str to float
        By output, by another quantity of a motion, or by a formula of these.

    Raises
    ------
    DeclarationError
        If there is none, or a level is not a number.
    """
    system = motion.system
    if not levels:
        raise DeclarationError(
            "above", "no quantity is given", 'Name one with its level, like {"output": 0.01}'
        )
    for name, level in levels.items():
        if not is_finite(level):
            raise DeclarationError(
                f"above: {short(name)}",
                f"{argument_said(level)} is not a finite number",
                "Give a finite level",
            )
    names = list(levels)
    along = Along(motion, [read_formula(system, name, f"above: {short(name)}") for name in names])
    said = [quantity_or_formula(system, name) for name in names]
    found = {one.get("units", "1") for one in said}
    unit = found.pop() if len(found) == 1 else None
    texts = [
        f"{name} > {with_unit(level, one.get('units', '1'), 6)}"
        for (name, level), one in zip(levels.items(), said, strict=True)
    ]
    watched = _Watched(
        motion,
        names,
        np.array([*levels.values()], float),
        along.on_clock,
        f"while {' or '.join(texts)}",
    )
    start, end = _stretches(watched)
    whole = None
    if unit is not None:
        whole = unit_text(unit_product((factors(unit), 1), (factors(system.time_unit), 1)))
    attributes = {
        "size": described_as("integral over the event", whole),
        "largest_slip": described_as("largest integral of a quantity", whole),
        "contacts": described_as("number of quantities above their levels", "1"),
        "first": described_as("first quantity above its level", None),
        "largest_rate": described_as("largest value", unit),
    }
    return _listed(watched, (start, end), _integrals(watched, start, end), attributes)


def _listed(
    watched: _Watched,
    span: tuple[Array, Array],
    moved: Array,
    attributes: Mapping[str, dict[str, str]],
) -> EventCatalogue:
    """The events as a catalogue.

    Parameters
    ----------
    span : pair of arrays
        Begins and ends, since the origin.
    moved : array, shape (events, names)
        How large each is in each event.
    """
    import xarray as xr

    motion, names = watched.motion, watched.names
    system, k = motion.system, motion.knots
    start, end = span
    before, after = (motion.at(t + k.origin) for t in span)
    within = _largest_within(watched, start, end)
    above = within > watched.levels
    sizes = np.where(above, moved, 0.0)
    steps = np.searchsorted(k.clock, start, side="right") - 1
    # The variable that begins an event is at its level there; the others are below theirs.
    nearest = watched.values(start, np.clip(steps, 0, len(k.clock) - 2)) - watched.levels
    nearest = np.where(np.isnan(nearest), -np.inf, nearest)
    table = {
        "start": start + k.origin,
        "duration": end - start,
        "interevent": _interevent(start),
        "size": np.sum(sizes, axis=1),
        "largest_slip": np.max(
            np.where(above | ~np.any(above, axis=1)[:, None], moved, -np.inf), axis=1
        ),
        "contacts": np.sum(above, axis=1),
        "first": np.array(names, dtype=object)[np.argmax(nearest, axis=1)],
        "energy_drop": before["energy"] - after["energy"],
        "energy_released": after["dissipated_energy"] - before["dissipated_energy"],
        "largest_rate": np.max(within, axis=1, initial=-np.inf),
    }
    attributes = _attributes(system) | dict(attributes)
    data = xr.Dataset(
        {name: ("event", values, attributes[name]) for name, values in table.items()},
        attrs={
            "title": system.title or system.name,
            "source": system.source,
            "events": watched.said,
            "count": len(names),
        },
    )
    ends = float(k.time[0]), float(k.time[-1])
    return EventCatalogue(system, dict(motion.parameters), data, ends, motion.certificate)


def _looks(watched: _Watched) -> tuple[Array, Array, Array]:
    """Times since the origin, steps and quantities at the samples of all steps: equally spaced,
    both ends among them, and at the turning points between them that matter."""
    motion = watched.motion
    clock = np.union1d(motion.knots.clock, _ends_of_series(motion))
    places = np.linspace(0.0, 1.0, _LOOKS)
    times = clock[:-1, None] + np.diff(clock)[:, None] * places
    steps = np.searchsorted(motion.knots.clock, clock[:-1], side="right") - 1
    index = np.repeat(steps, _LOOKS)
    values = watched.values(times.ravel(), index)
    row, turns = extrema_between(watched.values, watched.levels, times, steps, values)
    # A knot ends one step and begins the next: times alone do not order the samples.
    rows = np.concatenate([np.repeat(np.arange(len(times)), _LOOKS), row])
    clocks = np.concatenate([times.ravel(), turns])
    order = np.lexsort((clocks, rows))
    seen = np.concatenate([values, watched.values(turns, steps[row])])
    return clocks[order], steps[rows[order]], seen[order]


def _ends_of_series(motion: Trajectory) -> Array:
    """Times since the origin, between which a series shows how a motion bends: a flight in closed
    form may be a step of many periods."""
    problem = replace(motion.problem, exact=False)
    vars(problem).update(compiled=motion.problem.compiled, machine=motion.problem.machine)
    k = motion.knots
    start, end = float(k.time[0]), float(k.time[-1])
    if not motion.problem.exact or end <= start:
        return k.clock
    with watching():
        code, knots, ended = run_loop(problem, start, end, k.state[0], _MOST_STEPS)
    if ended is not None:
        raise ended
    if code != 0 and motion.outcome.ok:
        reached = f"the Taylor series of the motion end at t = {knots.time[-1]:.9g}"
        raise ConvergenceError(
            "events faster than a rate", reached, "Catalogue the motion up to that time"
        )
    return knots.clock[knots.clock <= k.clock[-1]]


def _stretches(watched: _Watched) -> tuple[Array, Array]:
    """Begins and ends of the stretches in which a quantity is above its level."""
    clock, index, values = _looks(watched)
    above = np.any(values > watched.levels, axis=1)
    change = np.flatnonzero(above[1:] != above[:-1])
    low, high = clock[change].copy(), clock[change + 1].copy()
    before = above[change]
    # If the quantity jumps between two steps, both have the same time.
    own = index[change]
    for _ in range(HALVINGS if len(change) else 0):
        middle = 0.5 * (low + high)
        same = watched.above(middle, own) == before
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    if len(change) and before[0]:  # it had begun before the motion
        high, before = high[1:], before[1:]
    count = len(high) // 2 * 2
    return high[0:count:2].copy(), high[1:count:2].copy()


def _largest_within(watched: _Watched, start: Array, end: Array) -> Array:
    """Largest values that are seen in each stretch, shape (stretches, names)."""
    clock, _, values = _looks(watched)
    # If a quantity jumps at the end, both of its values have this time.
    first, last = np.searchsorted(clock, start), np.searchsorted(clock, end, side="right")
    found = np.zeros((len(start), len(watched.names)))
    for i, (a, b) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
        found[i] = np.fmax.reduce(values[a:b], axis=0, initial=-np.inf)
    return found


def _integrals(watched: _Watched, start: Array, end: Array) -> Array:
    """Integrals over each stretch, shape (stretches, names), by Gauss's rule on every step."""
    motion = watched.motion
    clock = np.union1d(motion.knots.clock, _ends_of_series(motion))
    nodes, weights = np.polynomial.legendre.leggauss(NODES_OF_STEP)
    found = np.zeros((len(start), len(watched.names)))
    for event, (begun, ended) in enumerate(zip(start.tolist(), end.tolist(), strict=True)):
        inside = clock[(clock > begun) & (clock < ended)]
        edges = np.concatenate([[begun], inside, [ended]])
        half = 0.5 * np.diff(edges)
        times = (edges[:-1] + half)[:, None] + half[:, None] * nodes
        index = np.searchsorted(motion.knots.clock, edges[:-1] + half, side="right") - 1
        values = watched.values(times.ravel(), np.repeat(index, NODES_OF_STEP))
        found[event] = (half[:, None] * weights).ravel() @ values
    return found


def _interevent(start: Array) -> Array:
    """Time since the start of the event before; the first one has none."""
    return np.diff(start, prepend=np.nan)


def _attributes(system: System) -> dict[str, dict[str, str]]:
    """Units and meanings."""
    time = quantity(system, "t")["units"]
    speeds = {slip_unit(system, contact) for contact in system.dry_contacts}
    one = speeds.pop() if len(speeds) == 1 else None
    slip = (
        None
        if one is None
        else unit_text(unit_product((factors(one), 1), (factors(system.time_unit), 1)))
    )
    energy = energy_unit(system)
    return {
        "start": described_as("time", time),
        "duration": described_as("duration", time),
        "interevent": described_as("time between events", time),
        "size": described_as("total slip", slip),
        "largest_slip": described_as("largest slip of a contact", slip),
        "contacts": described_as("number of slipping contacts", "1"),
        "first": described_as("first contact to slip", None),
        "energy_drop": described_as("energy drop", energy),
        "energy_released": described_as("energy released", energy),
    }
