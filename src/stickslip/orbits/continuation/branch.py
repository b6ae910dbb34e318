"""A branch of equilibria or cycles in a parameter: data, files, table."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar

from stickslip.arguments import validated
from stickslip.certificates import Certificate, Residual, worst
from stickslip.equations.field import Mode, Region
from stickslip.kept import cached_property
from stickslip.model.system import System
from stickslip.model.system_file import SYSTEM
from stickslip.orbits.continuation.path import BROKEN_OFF, Ending, Stop
from stickslip.results import (
    CERTIFICATE,
    PLAIN,
    TEXT,
    Completion,
    Part,
    Result,
    restored_residuals,
    shortened,
)

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.orbits.cycles.cycle import Cycle


SOLVED_TO = 1e-10
"""What may be left of the equations of a special point."""
KNOT = "knot"
"""The kind of special points at which a smooth table, or samples, pass a knot."""
_UNMEASURED = Residual("equations that were not measured", 1.0, 0.0)


@dataclass(frozen=True)
class SpecialPoint:
    """A special point of a branch.

    Attributes
    ----------
    kind : str
        Such as ``"Hopf"``, ``"fold"``, ``"branch point"``, ``"boundary equilibrium"``; ``"knot"``
        (of a smooth table or of samples), which figures and summaries leave out.
    parameter : str
        The parameter of the branch.
    value : float
        Its value.
    state : dict of str to float
    parameters : dict of str to float
        All parameters.
    mode, region : tuple of int
        Mode of each contact and region of each kink (of a cycle: where it starts).
    index : int
        Index among the points of the branch.
    period : float or None
        Period of a cycle; for a Hopf point, the period of the emanating cycles.
    data : dict of str to float
        Numbers specific to the kind: a Hopf point has ``frequency`` and ``lyapunov``.
    note : str
        Remark: a Hopf point is ``"supercritical"``, ``"subcritical"`` or ``"degenerate"``.
    residuals : tuple of Residual
        Residuals of the equations that define a point of this kind.
    """

    kind: str
    parameter: str
    value: float
    state: dict[str, float]
    parameters: dict[str, float]
    mode: Mode
    region: Region
    index: int
    period: float | None = None
    data: dict[str, float] = field(default_factory=dict[str, float])
    note: str = ""
    residuals: tuple[Residual, ...] = ()

    @property
    def certificate(self) -> Certificate:
        """Residuals of the equations at the point."""
        return Certificate(self.residuals or (_UNMEASURED,))

    def __repr__(self) -> str:
        return f"<SpecialPoint: {self.describe()}>"

    def describe(self) -> str:
        """Description in one line."""
        data = ", ".join(f"{name} = {value:.9g}" for name, value in self.data.items())
        found = self.certificate
        doubt = "" if found.ok else found.verdict
        parts = [f"{self.kind} at {self.parameter} = {self.value:.12g}", data, self.note, doubt]
        return ", ".join(part for part in parts if part)


def _restored_special(entry: Mapping[str, Any]) -> SpecialPoint:
    """A special point from stored data, in which tuples are lists."""
    changed = {"mode": tuple(entry["mode"]), "region": tuple(entry["region"])}
    residuals = restored_residuals(entry["residuals"])
    known: dict[str, Any] = {**entry, **changed, "residuals": residuals}
    return SpecialPoint(**known)


SPECIAL_POINTS = Part(
    lambda special: [asdict(s) for s in special],
    lambda text, where: [_restored_special(entry) for entry in json.loads(text)],
)
_ENDS = Part(
    lambda ends: [[end.stop.name, end.text, end.test] for end in ends],
    lambda text, where: tuple(
        Ending(Stop[stop], said, test) for stop, said, test in json.loads(text)
    ),
)


@dataclass(frozen=True, eq=False)
class Branch(Result):
    """Points of a curve of equilibria or cycles.

    Attributes
    ----------
    system : System
    parameters : dict of str to float
        Values of the parameters that stay fixed (and the start value of the others).
    parameter : str
        The parameter of the branch.
    special : list of SpecialPoint
        In the same order.
    ends : (Ending, Ending)
        Reasons for the ends of the curve, at its first and last points.
    certificate : Certificate
        The largest value of every residual over its points and special points.
    second : str
        The other parameter of a curve in two parameters.
    cycles : sequence of Cycle
        The cycle at each point; empty for equilibria, and for a branch read from a file.
    """

    KIND: ClassVar[str] = "branch"
    FORMAT: ClassVar[int] = 4
    PARTS: ClassVar = {
        "system": SYSTEM,
        "parameters": PLAIN,
        "parameter": TEXT,
        "special": SPECIAL_POINTS,
        "ends": _ENDS,
        "certificate": CERTIFICATE,
        "second": TEXT,
    }

    system: System
    parameters: dict[str, float]
    parameter: str
    _table: Callable[[], xarray.Dataset] = field(repr=False)
    special: list[SpecialPoint]
    ends: tuple[Ending, Ending]
    certificate: Certificate
    second: str = ""
    cycles: Sequence[Cycle] = field(default=(), repr=False)

    def __repr__(self) -> str:
        values = self.points[self.parameter].values
        return (
            f"<Branch of {self.system.name}: {len(values)} points, {self.parameter} = "
            f"{values.min():g} ... "
            f"{values.max():g}, special points: {len(self.special)}>"
        )

    @cached_property
    def points(self) -> xarray.Dataset:
        """Quantities of every point, computed on first access: dimension ``point``, in order along
        the curve."""
        return self._table()

    @property
    def ended(self) -> str:
        """Reasons for the ends at the first and last points."""
        return f"first point: {self.ends[0].text}; last point: {self.ends[1].text}"

    @property
    def complete(self) -> bool:
        """Whether the branch was followed to both ends."""
        return not any(end.stop in BROKEN_OFF for end in self.ends)

    @validated
    def of_kind(self, kind: str) -> list[SpecialPoint]:
        """The special points of a kind."""
        return [s for s in self.special if s.kind == kind]

    # -- description and summary -------------------------------------------------------------------

    @property
    def along(self) -> str:
        """Dimension of the dataset."""
        return "point"

    @property
    def dataset(self) -> xarray.Dataset:
        """The points."""
        return self.points

    @property
    def outcome(self) -> Completion:
        """Whether the branch was followed to both ends."""
        if self.complete:
            return Completion.FINISHED
        late = any(end.stop is Stop.TIME_UP for end in self.ends)
        return Completion.TIME_UP if late else Completion.INTERRUPTED

    @property
    def message(self) -> str:
        """Reasons for the ends of the branch, and its special points, line by line."""
        return "\n".join([*(s.describe() for s in self.special), self.ended])

    def facts(self) -> dict[str, Any]:
        """Summary as plain data."""
        values = self.points[self.parameter].values
        return {
            **self.system.heading(),
            "parameter": self.parameter,
            "points": len(values),
            "range": [float(values.min()), float(values.max())],
            "special": [asdict(s) | {"text": s.describe()} for s in self.special],
            "ended": self.ended,
        }

    def rows(self) -> list[tuple[str, str]]:
        """Summary as rows of text."""
        values = self.points[self.parameter].values
        span = f"{self.parameter} = {values.min():.9g} to {values.max():.9g}"
        special = [("special point", s.describe()) for s in without_knots(self.special)]
        return [("points", f"{len(values)}, {span}"), *shortened(special), ("ended", self.ended)]

    @validated
    def plot(
        self, *quantities: str, ax: Axes | None = None, others: Sequence[Branch] = ()
    ) -> Figure:
        """Bifurcation diagram, together with other branches over the same parameter.

        Parameters
        ----------
        *quantities : str
            States, ``speed``, or other variables of the points; by default what changes most.
        ax : matplotlib.axes.Axes, optional
            Existing axes to draw the first quantity into.
        others : sequence of Branch
            Of the same system and parameter, such as the cycles that emanate from a branch of
            equilibria.

        Raises
        ------
        DeclarationError
            If there is no such quantity.
        """
        from stickslip.figures.orbits import plot_branch

        return plot_branch(self, list(quantities) or None, others=others, ax=ax)

    def overview(self, ax: Axes | None = None) -> Figure:
        """Bifurcation diagram."""
        return self.plot(ax=ax)

    @classmethod
    def fields_of(cls, data: xarray.Dataset) -> dict[str, Any]:
        """The points, which a branch otherwise computes on first access."""
        return {"_table": lambda: data, "cycles": ()}


def without_knots(special: Sequence[SpecialPoint]) -> list[SpecialPoint]:
    """Special points without knots, at which only a higher derivative changes."""
    return [s for s in special if s.kind != KNOT]


def with_special(points: Certificate, special: Sequence[SpecialPoint]) -> Certificate:
    """Certificate of a branch: residuals of its points and of its special points."""
    own = worst([Certificate(_named(s)) for s in special])
    return replace(points, residuals=(*points.residuals, *own.residuals))


def _named(point: SpecialPoint) -> tuple[Residual, ...]:
    """Residuals of a special point, named after it."""
    where = f"at {point.parameter} = {point.value:.9g}"
    return tuple(
        replace(r, name=f"{point.kind}: {r.name}", note=", ".join(filter(None, (where, r.note))))
        for r in point.certificate.residuals
    )
