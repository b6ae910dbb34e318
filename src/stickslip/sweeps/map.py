"""Results of maps: parameter maps and basins."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.certificates import Certificate, Residual
from stickslip.kept import cached_property
from stickslip.model.entries.units import with_unit
from stickslip.model.system import System
from stickslip.model.system_file import SYSTEM
from stickslip.motion.outcome import Outcome
from stickslip.results import PLAIN, Completion, Result, shortened
from stickslip.storage import PREFIX
from stickslip.sweeps.request.measures import MISSING, how_carried, measures_of
from stickslip.sweeps.request.plan import FORMAT, INTERPOLATED, KIND, NOT_COMPUTED
from stickslip.sweeps.request.records import record_axis
from stickslip.sweeps.store import read_map

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.sweeps.fragility import Fragility

# labels of motions that are on no attractor, with the name of their count
_NOWHERE = {-1: "stopped", -2: "not_settled", -3: "undamped"}


@dataclass(frozen=True, eq=False, repr=False)
class Map(Result):
    """Measures of a system at every point of a grid of parameters and initial values.

    ``map["speed"]`` is the measure as an xarray.DataArray; ``map.dataset`` is the complete dataset.

    Attributes
    ----------
    dataset : xarray.Dataset
        One dimension for each axis; the measures, ``outcome``, ``certificate``, ``lacking`` and
        ``excess``; if the state is carried, also the final state of each point, ``carried_…``.
        Values of a stored map are read lazily.
    """

    KIND: ClassVar[str] = KIND
    FORMAT: ClassVar[int] = FORMAT

    dataset: xarray.Dataset

    def __repr__(self) -> str:
        sizes = " x ".join(f"{n} {name}" for name, n in self.dataset["outcome"].sizes.items())
        carried = f", carried along {self.carried}" if self.carried else ""
        return f"<Map of {self.title}: {sizes}, {', '.join(self.measures)}{carried}>"

    @cached_property
    def system(self) -> System:
        """The system that was measured."""
        from stickslip.model.system_file import loads

        return loads(self.dataset.attrs[f"{PREFIX}model"], "the model of the map")

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the parameters that do not vary."""
        values: dict[str, float] = json.loads(self.dataset.attrs[f"{PREFIX}parameters"])
        return {name: value for name, value in values.items() if name not in self.dataset.coords}

    @property
    def measures(self) -> list[str]:
        """The measures, in the given order."""
        return measures_of(self.dataset)

    @property
    def carried(self) -> str:
        """Axis and direction along which the state was carried; empty if points are independent."""
        return how_carried(self.dataset)

    @property
    def title(self) -> str:
        """Title of the system."""
        return str(self.dataset.attrs["title"])

    @property
    def along(self) -> str:
        """Name of the first axis."""
        return str(self.dataset["outcome"].dims[0])

    @property
    def table(self) -> pandas.DataFrame:
        """One row per point."""
        return self.dataset.to_dataframe().reset_index()

    @cached_property
    def _codes(self) -> Array:
        """Outcomes of all points; negative if not computed."""
        return self.dataset["outcome"].values.ravel()

    @property
    def computed(self) -> int:
        """Points that were computed."""
        return int(np.count_nonzero(self._codes >= 0))

    @property
    def outcome(self) -> Completion:
        """Whether every point was computed."""
        if np.any(self._codes == NOT_COMPUTED):
            return Completion.INTERRUPTED
        late = np.any(self._codes == Outcome.TIME_UP.code)
        return Completion.TIME_UP if late else Completion.FINISHED

    @property
    def message(self) -> str:
        """Number of points computed."""
        done = f"{self.computed:,} of {self._codes.size:,} points are computed"
        late = int(np.count_nonzero(self._codes == Outcome.TIME_UP.code))
        if self.outcome is Completion.TIME_UP:
            return f"{done}; {late:,} of them reached the time limit"
        return done if self.outcome.ok else f"{done}; repeat the same call to resume"

    @cached_property
    def lacking(self) -> dict[str, int]:
        """Number of computed points that fail each criterion of the certificate."""
        lacks = self.dataset["lacking"].values.ravel()[self._codes >= 0]
        counts = np.bincount(lacks, minlength=len(MISSING))
        return {
            name: int(count) for name, count in zip(MISSING[1:], counts[1:], strict=True) if count
        }

    @cached_property
    def warnings(self) -> list[str]:
        """Driving records that are longer than the measured motion."""
        of_records = self.dataset.attrs.get(f"{PREFIX}left_out")
        if of_records is not None:
            return list(map(str, json.loads(of_records)))
        return self.system.left_out(*self.system.span)

    @cached_property
    def certificate(self) -> Certificate:
        """Number of computed points that are not certified, and the largest excess over a limit.

        The variables ``certificate`` and ``lacking`` contain the verdict for each point.
        """
        bad = sum(self.lacking.values())
        done = f"{self.computed - bad:,} of {self.computed:,} points are certified"
        notes = (done, *self.warnings)
        return Certificate((Residual("points not certified", float(bad), 0.0),), notes=notes)

    def facts(self) -> dict[str, Any]:
        """Summary as plain data."""
        return {
            **self.system.heading(),
            "axes": {str(name): int(n) for name, n in self.dataset["outcome"].sizes.items()},
            "measures": self.measures,
            "carried": self.carried,
            "points": int(self._codes.size),
            "computed": self.computed,
            "outcomes": {Outcome.from_code(c).label: n for c, n in self._counted().items()},
            "lacking": self.lacking,
            "warnings": self.warnings,
        }

    def _counted(self) -> dict[int, int]:
        """Number of computed points by the code of their outcome."""
        codes, counts = np.unique(self._codes[self._codes >= 0], return_counts=True)
        return {int(code): int(count) for code, count in zip(codes, counts, strict=True)}

    def rows(self) -> list[tuple[str, str]]:
        """Summary as rows of text."""
        between = int(np.count_nonzero(self._codes == INTERPOLATED))
        more = f" of {self._codes.size:,}, the others interpolated" if between else ""
        rows = [("points", f"{self.computed:,}{more}")]
        rows += [("carried along", self.carried)] if self.carried else []
        rows += [
            (f"  {Outcome.from_code(code).label}", f"{count:,}")
            for code, count in self._counted().items()
        ]
        rows.append(("certified", f"{self.computed - sum(self.lacking.values()):,}"))
        lacks = [f"{name}: {count:,}" for name, count in self.lacking.items()]
        rows += [("  lacking", ", ".join(lacks))] if lacks else []
        rows += [("warning", warning) for warning in self.warnings]
        return [*rows, *self._outside(), *self._missing()]

    def _outside(self) -> list[tuple[str, str]]:
        """Remedy for points that start outside the stable set."""
        outside = self._codes == Outcome.OUTSIDE.code
        if not np.any(outside):
            return []
        excess = self.dataset["excess"]
        unit = str(excess.attrs["units"])
        largest = with_unit(float(np.max(excess.values.ravel()[outside])), unit, 3)
        reason = (
            f"{np.count_nonzero(outside):,} starts violate |∂Φ| ≤ s, by up to {largest}, and no "
            "motion begins there"
        )
        remedy = (
            "start inside the stable set with --initial NAME=VALUE, or vary the initial value "
            "as well, as in --over 'P,x_R=...'"
        )
        return [("starts", reason), ("", remedy)]

    def _missing(self) -> list[tuple[str, str]]:
        """Number of points without a value of a formula or user-defined function, with the
        reasons."""
        rows = []
        for name in map(str, self.dataset.data_vars):
            if not name.endswith("_missing"):
                continue
            words = self.dataset[name].attrs["flag_meanings"].split()
            codes = self.dataset[name].values.ravel()[self._codes >= 0]
            found = zip(*np.unique(codes, return_counts=True), strict=True)
            why = [f"{count:,} {words[c].replace('_', ' ')}" for c, count in found if c]
            rows += [(f"missing {name.removesuffix('_missing')}", ", ".join(why))] if why else []
        return rows

    @validated
    def fragility(self, measure: str, limit: float, over: str | None = None) -> Fragility:
        """Fraction of the records of the map that exceed a limit, as a function of their scale.

        Parameters
        ----------
        measure : str
            The quantity compared with the limit: a measure of the map, such as ``"high:x"``, or the
            name of a formula of these (``"slip = abs(shift)"``).
        limit : float
            In the unit of the measure.
        over : str, optional
            Axis of the curve; by default ``scale``, or the only other axis.

        Returns
        -------
        Fragility

        Raises
        ------
        DeclarationError
            If no axis is of records, or there is no such measure or axis.
        """
        from stickslip.sweeps.fragility import fragility_of

        return fragility_of(self, measure, limit, over)

    @validated
    def plot(self, *quantities: str, ax: Axes | None = None) -> Figure:
        """Plot lines over one axis, a map over two, small multiples over three. If a second axis
        has at most six values, plot a line for each of them.

        Parameters
        ----------
        *quantities : str
            Measures; by default all. ``"outcome"`` is also accepted.
        ax : matplotlib.axes.Axes, optional
            Existing axes to draw the first of them into (maps of one or two axes).

        Raises
        ------
        DeclarationError
            If there is no such measure, or there are more than three axes.
        """
        from stickslip.figures.records import plot_records
        from stickslip.figures.sweep import plot_sweep

        if record_axis(self.dataset) and "outcome" not in quantities:
            return plot_records(self.dataset, quantities or None, ax)
        return plot_sweep(self.dataset, quantities or None, ax)

    def overview(self, ax: Axes | None = None) -> Figure:
        """All measures."""
        return self.plot(ax=ax)

    def stored(self) -> tuple[xarray.Dataset, dict[str, Any]]:
        """The data, and the plan of the computation."""
        own = (
            (key.removeprefix(PREFIX), value)
            for key, value in self.dataset.attrs.items()
            if key.startswith(PREFIX)
        )
        parts = {key: value for key, value in own if key not in ("kind", "format", "version")}
        return self.dataset, parts

    @classmethod
    def restored(cls, data: xarray.Dataset, parts: Mapping[str, str], where: str) -> Self:
        """Restore a stored map."""
        return cls(data.assign_attrs({PREFIX + key: text for key, text in parts.items()}))

    @classmethod
    @validated
    def open(cls, path: str | Path) -> Self:
        """Open a stored map, complete or not; values are read lazily.

        Raises
        ------
        StickslipError
            If there is no map at the path, or it is damaged. Points of which a file is missing
            count as not computed.
        """
        if os.path.isdir(path):  # Path.is_dir raises for invalid paths
            return cls(read_map(Path(path)))
        return super().open(path)


@dataclass(frozen=True, eq=False, repr=False)
class Basin(Result):
    """The attractor that each state of a section reaches.

    ``basin["attractor"]`` is the map as an xarray.DataArray.

    Attributes
    ----------
    system : System
    parameters : dict of str to float
    dataset : xarray.Dataset
        As :func:`stickslip.basin` describes it.
    """

    KIND: ClassVar[str] = "basin"
    PARTS: ClassVar = {"system": SYSTEM, "parameters": PLAIN}

    system: System
    parameters: dict[str, float]
    dataset: xarray.Dataset

    def __repr__(self) -> str:
        sizes = " x ".join(f"{n} {name}" for name, n in self.dataset["attractor"].sizes.items())
        return f"<Basin of {self.title}: {sizes}, attractors {self.dataset.sizes['reached']}>"

    @property
    def along(self) -> str:
        """Quantities are those of the attractors."""
        return "reached"

    @property
    def outcome(self) -> Completion:
        """Whether every state was followed."""
        broken = bool(self.dataset.attrs["interrupted"])
        return Completion.INTERRUPTED if broken else Completion.FINISHED

    @property
    def message(self) -> str:
        """Attractors reached by the states."""
        return "; ".join(text for _, text in self._reached()) or self.outcome.message

    @cached_property
    def certificate(self) -> Certificate:
        """Numbers of states whose motion is not certified or reaches no attractor, and of
        attractors that are not certified."""
        labels = self.dataset["attractor"].values
        bad = (self.dataset["lacking"].values > 0) & (labels >= 0)
        attractors = int(np.count_nonzero(~self.dataset["certified"].values.astype(bool)))
        counts = {
            "states not certified": int(np.count_nonzero(bad)),
            "states that reach no attractor": int(np.count_nonzero(labels < 0)),
            "attractors not certified": attractors,
        }
        return Certificate(tuple(Residual(name, float(n), 0.0) for name, n in counts.items()))

    def facts(self) -> dict[str, Any]:
        """Summary as plain data."""
        data = self.dataset
        labels = data["attractor"].values
        bad = (data["lacking"].values > 0) & (labels >= 0)
        section = {
            str(d): [float(data[d][0]), float(data[d][-1]), data.sizes[d]]
            for d in data["attractor"].dims
        }
        return {
            **self.system.heading(),
            "uncertified": int(np.count_nonzero(bad)),
            "section": section,
            "attractors": self._attractors(),
            "units": {name: data[name].attrs["units"] for name in ("period", "speed")},
            **{name: int((labels == code).sum()) for code, name in _NOWHERE.items()},
        }

    def _attractors(self) -> list[dict[str, Any]]:
        """Data of every attractor."""
        table = self.dataset.drop_dims([*self.dataset["attractor"].dims])
        return [
            {str(name): values.values[i].item() for name, values in table.items()}
            | {"name": str(table["reached"].values[i])}
            for i in range(table.sizes["reached"])
        ]

    def _reached(self) -> list[tuple[str, str]]:
        """The attractors, the largest basin first."""
        units = {name: self.dataset[name].attrs["units"] for name in ("period", "speed")}
        rows = []
        for a in self._attractors():
            said = [f"{x} {with_unit(a[x], units[x], 6)}" for x in units if a[x]]
            said += [a["stability"]] if a["stability"] not in ("", "stable") else []
            said += ["one of a family"] if a["family"] else []
            share = f"{100 * a['share']:.3g} % of the section"
            rows.append((a["name"].replace("_", " "), ", ".join([share, *said])))
        return rows

    def rows(self) -> list[tuple[str, str]]:
        """Summary as rows of text."""
        labels = self.dataset["attractor"].values
        counts = {name: int((labels == code).sum()) for code, name in _NOWHERE.items()}
        nowhere = [(k.replace("_", " "), f"{n} states") for k, n in counts.items() if n]
        return [*shortened(self._reached()), *nowhere]

    def overview(self, ax: Axes | None = None) -> Figure:
        """Plot the section, coloured by attractor."""
        from stickslip.figures.basin import plot_basin

        return plot_basin(self.dataset, ax)
