"""The response of a system to a drive over its frequency: data, files, table."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.certificates import Certificate
from stickslip.model.system import System
from stickslip.model.system_file import SYSTEM
from stickslip.orbits.continuation.branch import SPECIAL_POINTS, SpecialPoint, without_knots
from stickslip.results import CERTIFICATE, PLAIN, Completion, Result, shortened, together

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class FrequencyResponse(Result):
    """The response to a drive as a function of its frequency, for levels of another parameter.

    Attributes
    ----------
    system : System
    parameters : dict of str to float
        Values of the fixed parameters (and the defaults of the others).
    parameter : str
        The frequency, or the parameter on which it depends.
    level : str
        The parameter of the levels; empty for a single line.
    coordinate : str
        Quantity of the response: a coordinate, a degree of freedom of a structure, an output or a
        formula.
    dataset : xarray.Dataset
        Over ``point``, along the lines: the parameter, the level and the ``line`` (a number),
        ``amplitude`` (half its range), ``harmonic`` and ``phase`` (of its first harmonic, relative
        to the drive), ``stick`` (fraction of the period in which all contacts stick; ``stick_…`` of
        each), ``period``, ``stable``, ``slips`` (0 where no contact slips). Over ``level``,
        ``direction`` and ``step``: the same quantities of the sweeps (``swept_…``), NaN where no
        cycle was found. Over ``level``: the largest response, ``peak_…``. Over ``backbone``: the
        largest response at and between the levels, ``backbone_…``.
    special : list of SpecialPoint
        Special points of all lines, such as folds and grazing; ``index`` is the number of the
        point.
    notes : list of str
        Reasons for points of sweeps without a cycle, and for lines that end within the range.
    complete, time_up : bool
        Whether the computation was completed; if not, whether the time limit or the user stopped
        it.
    """

    KIND: ClassVar[str] = "frequency response"
    FORMAT: ClassVar[int] = 2
    PARTS: ClassVar = {
        "system": SYSTEM,
        "parameters": PLAIN,
        "names": together("parameter", "level", "coordinate"),
        "special": SPECIAL_POINTS,
        "notes": PLAIN,
        "certificate": CERTIFICATE,
        "complete": PLAIN,
        "time_up": PLAIN,
    }

    system: System
    parameters: dict[str, float]
    parameter: str
    level: str
    coordinate: str
    dataset: xarray.Dataset
    special: list[SpecialPoint]
    notes: list[str]
    certificate: Certificate
    complete: bool = True
    time_up: bool = False

    def __repr__(self) -> str:
        data = self.dataset
        lines = len(np.unique(data["line"])) if data.sizes["point"] else 0
        return (
            f"<FrequencyResponse of {self.system.name}: {self.coordinate} over {self.parameter}, "
            f"{data.sizes['level']} levels, {lines} lines, {data.sizes['point']} points>"
        )

    @property
    def along(self) -> str:
        """Dimension of the points of the lines."""
        return "point"

    @property
    def levels(self) -> Array:
        """Values of the level."""
        return self.dataset["level"].values

    @property
    def outcome(self) -> Completion:
        """Whether a response was found and completely followed."""
        if not self.complete:
            return Completion.TIME_UP if self.time_up else Completion.INTERRUPTED
        some = self.dataset.sizes["point"] > 0
        return Completion.FINISHED if some else Completion.NOTHING_FOUND

    @property
    def message(self) -> str:
        """Number of lines, their special points, and gaps in the response."""
        data = self.dataset
        lines = len(np.unique(data["line"]))
        count = f"lines: {lines}, with {data.sizes['point']} points"
        return "\n".join([count, *(_of_level(s, self.level) for s in self.special), *self.notes])

    def of_kind(self, kind: str) -> list[SpecialPoint]:
        """The special points of a kind."""
        return [s for s in self.special if s.kind == kind]

    def line(self, number: int) -> xarray.Dataset:
        """The points of one line, in their order along it."""
        return self.dataset.isel(point=np.flatnonzero(self.dataset["line"].values == number))

    def facts(self) -> dict[str, Any]:
        """Summary as plain data."""
        data = self.dataset
        return {
            **self.system.heading(),
            "parameter": self.parameter,
            "level": self.level,
            "levels": self.levels.tolist(),
            "coordinate": self.coordinate,
            "drive": data.attrs["drive"],
            "points": data.sizes["point"],
            "largest response": [
                {self.parameter: float(at), "amplitude": float(a), "phase": float(p)}
                for at, a, p in zip(
                    data[f"peak_{self.parameter}"],
                    data["peak_amplitude"],
                    data["peak_phase"],
                    strict=True,
                )
            ],
            "special": [asdict(s) | {"text": s.describe()} for s in self.special],
            "notes": self.notes,
        }

    def rows(self) -> list[tuple[str, str]]:
        """Summary as rows of text."""
        data = self.dataset
        rows = [("response", f"of {self.coordinate} to {data.attrs['drive']}")]
        for i, value in enumerate(self.levels):
            name = f"{self.level} = {value:g}" if self.level else "largest response"
            top = float(data["peak_amplitude"][i])
            at = float(data[f"peak_{self.parameter}"][i])
            shown = f"largest response {top:.9g} at {self.parameter} = {at:.9g}"
            rows.append((name, shown if np.isfinite(top) else "no response"))
        special = [("special point", _of_level(s, self.level)) for s in without_knots(self.special)]
        return [*rows, *shortened(special), *shortened([("note", note) for note in self.notes])]

    @validated
    def plot(self, *quantities: str, ax: Axes | None = None) -> Figure:
        """Plot the amplitude against the frequency with the phase below, or other quantities.

        Parameters
        ----------
        *quantities : str
            Of the points: ``amplitude``, ``harmonic``, ``phase``, ``stick``, ``period``, ...
        ax : matplotlib.axes.Axes, optional
            Existing axes to draw the first of them into.

        Raises
        ------
        DeclarationError
            If there is no such quantity.
        """
        from stickslip.figures.response import plot_response

        return plot_response(self, list(quantities) or None, ax=ax)

    def overview(self, ax: Axes | None = None) -> Figure:
        """Plot the amplitude against the frequency with the phase below."""
        return self.plot(ax=ax)


def _of_level(point: SpecialPoint, level: str) -> str:
    """A special point in words, with the level of its line."""
    where = f"{level} = {point.parameters[level]:g}: " if level else ""
    return where + point.describe()
