"""The equilibria along a branch: its points with their properties, and their table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from stickslip.certificates import Certificate
from stickslip.model.quantities import contact_key
from stickslip.model.system import System
from stickslip.orbits.continuation.path import (
    Point,
    Test,
)
from stickslip.orbits.equilibria.equilibrium import decays
from stickslip.orbits.fields.steady import (
    Array,
    Steady,
    rightmost_first,
)

if TYPE_CHECKING:
    import xarray

_STABLE = {
    "flag_values": np.array([-1, 0, 1], np.int8),
    "flag_meanings": "undecided unstable stable",
}
_MARGIN = {"long_name": "smallest guard of the mode, relative to the size of its terms"}
_ERROR = {"long_name": "error bound of the eigenvalues"}
_DEFECT = {"long_name": "violation of the equilibrium conditions, relative to the state"}


@dataclass(frozen=True)
class Station:
    """A point of the branch, with its problem, the test functions that vanish there, and the
    connection to the next piece."""

    steady: Steady
    point: Point
    kinds: tuple[Test, ...]
    note: str
    certified: tuple[Certificate, float]
    largest: Mapping[Test, float]
    onward: Array | None = None

    def values(self, parameter: str) -> Array:
        """State and all parameters as one vector; `parameter` is that of the branch."""
        return self.steady.point(self.point.x[:-1], {parameter: self.point.x[-1]})


def by_steady(stations: list[Station]) -> list[list[Station]]:
    """Groups of consecutive stations in one mode."""
    return [list(part) for _, part in groupby(stations, key=lambda station: id(station.steady))]


def dataset(
    system: System, parameter: str, contacts: Sequence[str], stations: list[Station]
) -> xarray.Dataset:
    """Parameter, state, eigenvalues, stability, modes, drift and certificate of every point."""
    import xarray as xr

    points = [s.values(parameter) for s in stations]
    certified = [s.certified for s in stations]
    spectra = [each for part in by_steady(stations) for each in _spectra(part, parameter)]
    drifts = np.array([s.steady.drift(p) for s, p in zip(stations, points, strict=True)])
    margin, defect = _guards_and_defects(stations, points)
    errors = np.array([error for _, error in certified])
    most = max(map(len, spectra))
    padded: Array = np.array(
        [np.pad(e, (0, most - len(e)), constant_values=np.nan) for e in spectra]
    )
    verdict = {True: 1, False: 0, None: -1}
    stable = [verdict[decays(tuple(e), error)] for e, error in zip(spectra, errors, strict=True)]
    state = system.declaration.state
    data = {parameter: ("point", np.array([s.point.x[-1] for s in stations]))}
    data |= {
        name: ("point", np.array([s.point.x[i] for s in stations])) for i, name in enumerate(state)
    }
    data |= {
        "stable": ("point", np.array(stable, np.int8), _STABLE),
        "eigenvalue_real": (("point", "eigenvalue"), padded.real),
        "eigenvalue_imag": (("point", "eigenvalue"), padded.imag),
        "margin": ("point", margin, _MARGIN),
        "defect": ("point", defect, _DEFECT),
        "eigenvalue_error": ("point", errors, _ERROR),
        "certified": ("point", np.array([found.ok for found, _ in certified], np.int8)),
    }
    for i, name in enumerate(contacts):
        data[f"mode_{contact_key(name)}"] = (
            "point",
            np.array([s.steady.field.mode[i] for s in stations], np.int8),
        )
    for i in np.flatnonzero(np.any(drifts != 0.0, axis=0)):
        data[f"drift_{state[i]}"] = ("point", drifts[:, i])
    return xr.Dataset(data, attrs={"title": system.title or system.name, "kind": "equilibria"})


def _spectra(stations: list[Station], parameter: str) -> Array:
    """Eigenvalues at stations in one mode, the rightmost first, shape (stations, eigenvalues)."""
    points = np.array([s.values(parameter) for s in stations]).T
    return rightmost_first(np.linalg.eigvals(stations[0].steady.linearisations(points)))


def _guards_and_defects(stations: list[Station], points: list[Array]) -> tuple[Array, Array]:
    """Least guard, and violation of the equations, of every point."""
    margin, defect = np.ones(len(points)), np.zeros(len(points))
    pieces: dict[int, list[int]] = {}
    for i, station in enumerate(stations):
        pieces.setdefault(id(station.steady), []).append(i)
    every = np.array(points).T
    for members in pieces.values():
        sizes = stations[members[0]].steady.sizes(every[:, members], every)
        margin[members] = np.min(sizes.margins, axis=1, initial=1.0)
        defect[members] = sizes.defect
    return margin, defect
