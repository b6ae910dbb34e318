"""A branch of equilibria or cycles over a parameter: data, files, table."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip.certificates import Certificate, Residual
from stickslip.equations.field import Mode, Region
from stickslip.errors import StickslipError
from stickslip.model.system import System
from stickslip.orbits.continuation.arclength import Ending, Stop

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure

KIND = "branch"  # of the stored file
FORMAT = 3  # of the stored file


@dataclass(frozen=True)
class SpecialPoint:
    """Where something happens on a branch.

    Attributes
    ----------
    kind : str
        Such as ``"Hopf"``, ``"fold"``, ``"branch point"``, ``"boundary equilibrium"``.
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
        Its number among the points of the branch.
    period : float or None
        Of a cycle; of a Hopf point the period of the cycles that are born there.
    data : dict of str to float
        Numbers that belong to the kind: a Hopf point has ``frequency`` and ``lyapunov``.
    note : str
        In words: a Hopf point is ``"supercritical"``, ``"subcritical"`` or ``"degenerate"``.
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
    data: dict[str, float] = field(default_factory=dict)
    note: str = ""

    def __repr__(self) -> str:
        return f"<SpecialPoint: {self.describe()}>"

    def describe(self) -> str:
        """One line."""
        data = ", ".join(f"{name} = {value:.9g}" for name, value in self.data.items())
        parts = [f"{self.kind} at {self.parameter} = {self.value:.12g}", data, self.note]
        return ", ".join(part for part in parts if part)


@dataclass(frozen=True)
class Branch:
    """Points of a curve of equilibria or cycles.

    Attributes
    ----------
    system : System
    parameters : dict of str to float
        Values of the parameters that stay fixed (and the start value of the others).
    parameter : str
        The parameter of the branch.
    points : xarray.Dataset
        Dimension ``point``, in the order along the curve.
    special : list of SpecialPoint
        In the same order.
    ends : (Ending, Ending)
        Why it ends, at its first and at its last point.
    certificate : Certificate
        Every residual of its points where it is worst.
    second : str
        The other parameter of a curve in two parameters.
    """

    system: System
    parameters: dict[str, float]
    parameter: str
    points: xarray.Dataset
    special: list[SpecialPoint]
    ends: tuple[Ending, Ending]
    certificate: Certificate
    second: str = ""

    def __repr__(self) -> str:
        values = self.points[self.parameter].values
        return (
            f"<Branch of {self.system.name}: {len(values)} points, {self.parameter} = "
            f"{values.min():g} ... "
            f"{values.max():g}, special points: {len(self.special)}>"
        )

    @property
    def ended(self) -> str:
        """Why it ends at its first and at its last point, in words."""
        return f"first point: {self.ends[0].text}; last point: {self.ends[1].text}"

    @property
    def complete(self) -> bool:
        """Whether it was followed to both ends."""
        return not any(end.stop is Stop.INTERRUPTED for end in self.ends)

    def of_kind(self, kind: str) -> list[SpecialPoint]:
        """The special points of a kind."""
        return [s for s in self.special if s.kind == kind]

    @property
    def summary(self) -> str:
        """The special points and the ends, line by line."""
        return "\n".join(
            [*(s.describe() for s in self.special), self.ended, self.certificate.verdict]
        )

    @property
    def table(self) -> pandas.DataFrame:
        """One row a point; quantities with more dimensions in columns of their own."""
        import pandas as pd

        columns: dict[str, Any] = {}
        for name, values in self.points.data_vars.items():
            flat = values.values.reshape(len(values), -1)
            labels = (
                [str(name)]
                if values.ndim == 1
                else [f"{name}_{i + 1}" for i in range(flat.shape[1])]
            )
            columns |= dict(zip(labels, flat.T, strict=True))
        return pd.DataFrame(columns)

    def to_csv(self, path: str | Path) -> None:
        """Write the points as a table.

        Raises
        ------
        StickslipError
            If the file cannot be written.
        """
        try:
            self.table.to_csv(path, index=False)
        except OSError as error:
            raise StickslipError(f"{path}: cannot be written ({error.strerror or error})") from None

    def plot(self, *, others: Sequence[Branch] = ()) -> Figure:
        """Bifurcation diagram, together with other branches over the same parameter."""
        from stickslip.figures.orbits import plot_branch

        return plot_branch(self, others=others)

    def save(self, path: str | Path) -> None:
        """Write a netCDF-4 file that :func:`open_branch` reads back exactly.

        Raises
        ------
        StickslipError
            If the file cannot be written; an existing file is replaced only by a complete one.
        """
        from stickslip import storage

        parts = {
            "system": self.system.to_toml(),
            "parameters": self.parameters,
            "parameter": self.parameter,
            "special": [asdict(s) for s in self.special],
            "ends": [[end.stop.name, end.text, end.test] for end in self.ends],
            "certificate": asdict(self.certificate),
            "second": self.second,
        }
        storage.write(path, self.points, KIND, FORMAT, **parts)


def open_branch(path: str | Path) -> Branch:
    """Read a stored branch.

    Raises
    ------
    StickslipError
        If the file does not exist or is not a stored branch.
    """
    from stickslip import storage
    from stickslip.model.system_file import loads

    with storage.reading(path, KIND, FORMAT) as (points, own):
        first, last = (
            Ending(Stop[stop], text, test) for stop, text, test in json.loads(own["ends"])
        )
        return Branch(
            loads(own["system"], f"{path}: system"),
            json.loads(own["parameters"]),
            own["parameter"],
            points,
            [_special(entry) for entry in json.loads(own["special"])],
            (first, last),
            _certificate(json.loads(own["certificate"])),
            own["second"],
        )


def _certificate(entry: Mapping[str, Any]) -> Certificate:
    """A certificate as it was stored: lists were tuples."""
    residuals = tuple(Residual(**residual) for residual in entry["residuals"])
    spans = tuple((start, end) for start, end in entry["unverified"])
    return Certificate(residuals, entry["outcome"], spans, tuple(entry["notes"]))


def _special(entry: Mapping[str, Any]) -> SpecialPoint:
    """A special point as it was stored: lists were tuples."""
    return SpecialPoint(**{**entry, "mode": tuple(entry["mode"]), "region": tuple(entry["region"])})
