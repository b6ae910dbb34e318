"""Equilibria as data: states of rest or of steady sliding, and sets of them."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar, overload

from stickslip.certificates import NOTHING, Certificate, Residual, worst
from stickslip.equations.derive import MotionEquations
from stickslip.equations.field import Guard, Mode, Region, mode_name, named_modes
from stickslip.kept import cached_property
from stickslip.model.entries.keys import NORMAL
from stickslip.model.quantities import quantity
from stickslip.model.system import System
from stickslip.model.system_file import SYSTEM
from stickslip.numerics.levels import NO_GROWTH
from stickslip.results import (
    ITEMS,
    PLAIN,
    TEXT,
    Completion,
    Part,
    Result,
    restored_certificate,
    shortened,
)
from stickslip.symbolic.pieces import boundary

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Equilibrium:
    """A state of rest or of steady sliding.

    Attributes
    ----------
    state : dict of str to float
        With a drift, one of the states that differ by the translation.
    parameters : dict of str to float
    contacts : tuple of str
        Names of the contacts in the order of `mode`.
    mode, region : tuple of int
        Mode of each contact (0 stick, ±1 slip; of a normal direction 0 closed, 1 open) and region
        of each kink.
    eigenvalues : tuple of complex
        Eigenvalues of the motion within the constraints of the mode and modulo translation, the
        rightmost first.
    drift : dict of str to float
        Constant rates of a relative equilibrium, which moves steadily along a translation. Empty at
        rest.
    boundary : tuple of str
        Guards that are zero: at a boundary equilibrium, the eigenvalues of one side do not
        determine stability.
    certificate : Certificate
        Residuals of the equations, the nearest guard, and the accuracy of the eigenvalues.
    eigenvalue_error : float
        Error bound of the eigenvalues; stability is undecided if it depends on this error.
    normal_forces : dict of str to float
        Normal forces of closed unilateral contacts, by their names in formulas.
    turned : tuple of str
        Contacts that slip backward where `mode` states forward slip of the combined contact.
    """

    state: dict[str, float]
    parameters: dict[str, float]
    contacts: tuple[str, ...]
    mode: Mode
    region: Region
    eigenvalues: tuple[complex, ...]
    drift: dict[str, float]
    boundary: tuple[str, ...]
    certificate: Certificate
    eigenvalue_error: float
    normal_forces: dict[str, float] = field(default_factory=dict)
    turned: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"<Equilibrium {self.describe()}>"

    @property
    def modes(self) -> dict[str, str]:
        """Mode of each contact by name."""
        return named_modes(self.contacts, self.mode, self.turned)

    @property
    def stable(self) -> bool | None:
        """Whether the equilibrium is stable; None if linearisation is inconclusive."""
        return None if self.boundary else decays(self.eigenvalues, self.eigenvalue_error)

    def describe(self) -> str:
        """Description in one line."""
        verdict = {
            True: "stable",
            False: "unstable",
            None: "stability not decided by linearisation",
        }[self.stable]
        state = ", ".join(f"{name} = {value:.9g}" for name, value in self.state.items())
        drift = ", ".join(f"{name} = {value:.9g}" for name, value in self.drift.items())
        text = (
            f"{modes_text(self.modes)}: {state}"
            + (f", drifting with {drift}" if drift else "")
            + pressed_text(self.normal_forces)
            + f"; {verdict}"
        )
        text += "".join(f"; on the boundary: {name}" for name in self.boundary)
        return f"{text}; {self.certificate.verdict}"


@dataclass(frozen=True)
class EquilibriumSet:
    """A set of equilibria; with dry friction a system can rest anywhere in it.

    Attributes
    ----------
    state : dict of str to float
        A point in the interior.
    mode : tuple of int
    regions : tuple of tuple of int
        Regions of the kinks that the set intersects.
    dimension : int
        Dimension of the set (directions of translation included).
    extent : dict of str to (float, float)
        Smallest and largest value of each state in the set; infinite if unbounded. For a set of
        dimension two or more this is the bounding box.
    exact : bool
        Whether it is proved that the set is connected and that the extent is that of the whole set:
        by linear programs if forces are affine, otherwise by a cover of boxes. If not, the set was
        followed from the interior point, and may have further parts.
    eigenvalues : tuple of complex or None
        Eigenvalues at that point transverse to the set, without the zeros along it. None if the
        forces are not unique there.
    certificate : Certificate
        Of that point.
    normal_forces : dict of str to float
        Normal forces at that point, as in :class:`Equilibrium`; forces that the state does not
        determine are omitted.
    repeats : dict of str to float
        Periods of states under which the set is invariant.
    turned : tuple of str
        As in :class:`Equilibrium`.
    """

    state: dict[str, float]
    parameters: dict[str, float]
    contacts: tuple[str, ...]
    mode: Mode
    regions: tuple[Region, ...]
    dimension: int
    extent: dict[str, tuple[float, float]]
    exact: bool
    eigenvalues: tuple[complex, ...] | None
    drift: dict[str, float]
    certificate: Certificate
    normal_forces: dict[str, float] = field(default_factory=dict)
    repeats: dict[str, float] = field(default_factory=dict)
    turned: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"<EquilibriumSet {self.describe()}>"

    @property
    def modes(self) -> dict[str, str]:
        """Mode of each contact by name."""
        return named_modes(self.contacts, self.mode, self.turned)

    @property
    def stable(self) -> bool | None:
        """Whether components that do not stick decay towards the set, near the interior point."""
        return None if self.eigenvalues is None else decays(self.eigenvalues)

    def describe(self) -> str:
        """Description in one line."""
        extent = ", ".join(_interval(name, low, high) for name, (low, high) in self.extent.items())
        wide = [low for low, high in self.extent.values() if low < high and high - low < math.inf]
        how = " (a bounding box)" if len(wide) > 1 and self.dimension > 1 else ""
        how += "" if self.exact else " (not proved)"
        text = f"of dimension {self.dimension}, {modes_text(self.modes)}: {extent}{how}"
        text += "".join(f", and every {turn:.9g} of {x}" for x, turn in self.repeats.items())
        text += pressed_text(self.normal_forces)
        return text if self.certificate.ok else f"{text}; {self.certificate.verdict}"


def _plain(found: Equilibrium | EquilibriumSet) -> dict[str, Any]:
    """All data of an equilibrium, for JSON."""
    values = found.eigenvalues
    pairs = None if values is None else [[z.real, z.imag] for z in values]
    return {**asdict(found), "eigenvalues": pairs}


def _revived(entry: dict[str, Any]) -> dict[str, Any]:
    """The same from JSON: lists were tuples, pairs complex numbers."""
    values = entry["eigenvalues"]
    changed: dict[str, Any] = {
        "eigenvalues": None if values is None else tuple(complex(*pair) for pair in values),
        "certificate": restored_certificate(entry["certificate"]),
        "contacts": tuple(entry["contacts"]),
        "mode": tuple(entry["mode"]),
        "turned": tuple(entry.get("turned", ())),
    }
    if "extent" in entry:
        changed["extent"] = {name: tuple(ends) for name, ends in entry["extent"].items()}
        changed["regions"] = tuple(tuple(region) for region in entry["regions"])
    else:
        changed["region"] = tuple(entry["region"])
        changed["boundary"] = tuple(entry["boundary"])
    return {**entry, **changed}


def _several(kind: type[Equilibrium] | type[EquilibriumSet]) -> Part:
    """Equilibria, in a file."""
    return Part(
        lambda found: [_plain(e) for e in found],
        lambda text, where: tuple(kind(**_revived(entry)) for entry in json.loads(text)),
    )


@dataclass(frozen=True)
class Equilibria(Result):
    """The equilibria of a system; iterates over the isolated equilibria, then the sets.

    Attributes
    ----------
    system : System
    parameters : dict of str to float
    isolated : tuple of Equilibrium
        Stable ones first.
    sets : tuple of EquilibriumSet
    tried : str
        Description of the search.
    nearest : str
        The closest candidate, if nothing was found.
    undecided : tuple of str
        Regions in which sets may be missing or inaccurate; the result is then neither complete nor
        certified.
    """

    KIND: ClassVar[str] = "equilibria"
    PARTS: ClassVar = {
        "system": SYSTEM,
        "parameters": PLAIN,
        "isolated": _several(Equilibrium),
        "sets": _several(EquilibriumSet),
        "tried": TEXT,
        "nearest": TEXT,
        "undecided": ITEMS,
    }

    system: System
    parameters: dict[str, float]
    isolated: tuple[Equilibrium, ...]
    sets: tuple[EquilibriumSet, ...]
    tried: str
    nearest: str = ""
    undecided: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"<Equilibria: isolated {len(self.isolated)}, sets {len(self.sets)}>"

    def __iter__(self) -> Iterator[Equilibrium | EquilibriumSet]:
        return iter((*self.isolated, *self.sets))

    def __len__(self) -> int:
        return len(self.isolated) + len(self.sets)

    @overload
    def __getitem__(self, name: int) -> Equilibrium | EquilibriumSet: ...

    @overload
    def __getitem__(self, name: str) -> xarray.DataArray: ...

    def __getitem__(self, name: int | str) -> Equilibrium | EquilibriumSet | xarray.DataArray:
        if isinstance(name, str):
            return super().__getitem__(name)
        return (*self.isolated, *self.sets)[name]

    def contains(self, point: Mapping[str, float]) -> bool:
        """Return whether a point is one of the isolated equilibria, or in one of the sets.

        The conditions of rest are tested at the point, not the extents: a gap between two sets, or
        a hole in one, is not part of them. Parts of the same sets outside the searched region are
        included.

        Parameters
        ----------
        point : mapping of str to float
            Values of all coordinates and internal variables. Omitted velocities are those of the
            equilibria.

        Raises
        ------
        DeclarationError
            If it is not a state of the system.

        Examples
        --------
        >>> import stickslip as ss
        >>> block = ss.System(
        ...     "block",
        ...     coordinates={"x": ss.Inertial()},
        ...     kinetic="d_x**2/2",
        ...     potential="(x**2 - 1)**2",
        ...     contacts={"ground": ss.Contact("d_x", 0.5)},
        ... )
        >>> found = ss.equilibria(block)
        >>> found.contains({"x": 0.1}), found.contains({"x": 0.5})
        (True, False)
        """
        from stickslip.orbits.equilibria.finding import is_equilibrium

        return is_equilibrium(self, point)

    @property
    def along(self) -> str:
        """Dimension of the dataset."""
        return "equilibrium"

    @property
    def outcome(self) -> Completion:
        """Whether an equilibrium was found."""
        return Completion.FINISHED if len(self) else Completion.NOTHING_FOUND

    @property
    def message(self) -> str:
        """The equilibria found, or what was tried and the closest candidate."""
        open_ = [f"not complete: {said}" for said in self.undecided]
        if len(self):
            return "\n".join([*(found.describe() for found in self), *open_])
        nothing = f"no equilibrium was found ({self.tried}); "
        return "\n".join([nothing + (self.nearest or "no candidate came close"), *open_])

    @cached_property
    def certificate(self) -> Certificate:
        """The largest value of every residual; empty if there are no equilibria."""
        if not len(self):
            return NOTHING
        found = worst([found.certificate for found in self])
        open_ = [Residual(f"not complete: {said}", 1.0, 0.0) for said in self.undecided]
        return replace(found, residuals=(*found.residuals, *open_))

    @property
    def table(self) -> pandas.DataFrame:
        """One row per equilibrium or set: state, stability, modes, eigenvalues, drift, extent."""
        import pandas as pd

        rows = []
        for found in self:
            extent = found.extent if isinstance(found, EquilibriumSet) else {}
            ends = {
                f"{name}_{side}": value
                for name, span in extent.items()
                for side, value in zip(("min", "max"), span, strict=True)
            }
            real_parts = (z.real for z in found.eigenvalues or ())
            row = {
                "dimension": found.dimension if isinstance(found, EquilibriumSet) else 0,
                **found.state,
                **{f"mode_{c}": m for c, m in found.modes.items()},
                "stable": {True: "yes", False: "no", None: "undecided"}[found.stable],
                "largest_real_part": max(real_parts, default=math.nan),
                **{f"drift_{name}": rate for name, rate in found.drift.items()},
                **found.normal_forces,
                **ends,
                "boundary": ", ".join(found.boundary) if isinstance(found, Equilibrium) else "",
            }
            rows.append(row)
        return pd.DataFrame(rows)

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """The table as a dataset over ``equilibrium``, with units of states, drifts and extents."""
        import xarray as xr

        data = {}
        for key, column in self.table.items():
            name = str(key)
            shown = {*self.system.declaration.state, *self._pressed}
            known = name if name in shown else ""
            values = column.to_numpy()
            values = values.astype(str) if values.dtype == object else values
            data[name] = ("equilibrium", values, quantity(self.system, known) if known else {})
        attrs = {"title": self.title, "source": self.system.source, "tried": self.tried}
        return xr.Dataset(data, attrs=attrs)

    @property
    def _pressed(self) -> set[str]:
        """Names of the normal forces."""
        return {name for found in self for name in found.normal_forces}

    def facts(self) -> dict[str, Any]:
        """Summary as plain data."""
        return {
            **self.system.heading(),
            "tried": self.tried,
            "undecided": list(self.undecided),
            "equilibria": [_facts_of(found) for found in self],
        }

    def rows(self) -> list[tuple[str, str]]:
        """Summary as rows of text."""
        return shortened(
            [
                ("set" if isinstance(found, EquilibriumSet) else "equilibrium", found.describe())
                for found in self
            ]
        )

    def overview(self, ax: Axes | None = None) -> Figure:
        """The eigenvalues in the complex plane."""
        from stickslip.figures.spectrum import plot_eigenvalues

        return plot_eigenvalues(self, ax)

    @classmethod
    def fields_of(cls, data: xarray.Dataset) -> dict[str, Any]:
        """None: the dataset is a table of the equilibria."""
        return {}


def _facts_of(found: Equilibrium | EquilibriumSet) -> dict[str, Any]:
    """Summary of an equilibrium, as plain data."""
    facts = {
        "state": found.state,
        "modes": found.modes,
        "stable": found.stable,
        "drift": found.drift,
        "normal_forces": found.normal_forces,
        "eigenvalues": [[z.real, z.imag] for z in found.eigenvalues or ()],
        "certificate": found.certificate.to_dict(),
        "text": found.describe(),
    }
    if isinstance(found, EquilibriumSet):
        extent = {name: list(ends) for name, ends in found.extent.items()}
        facts |= {"dimension": found.dimension, "extent": extent}
    return facts


def _interval(name: str, low: float, high: float) -> str:
    """Range of a state in a set, as text."""
    if low == high:
        return f"{name} = {low:.9g}"
    if math.isinf(low) and math.isinf(high):
        return f"any {name}"
    below = "" if math.isinf(low) else f"{low:.9g} ≤ "
    return below + name + ("" if math.isinf(high) else f" ≤ {high:.9g}")


def decays(eigenvalues: tuple[complex, ...], error: float = 0.0) -> bool | None:
    """Return whether all (True) or not all (False) linear motions decay; None if the error bound
    leaves it open."""
    if not eigenvalues:
        return True  # all components are fixed
    top = max(z.real for z in eigenvalues)
    scale = max(map(abs, eigenvalues))
    return None if abs(top) <= max(NO_GROWTH * scale, error) else top < 0.0


def describe_guard(equations: MotionEquations, guard: Guard, mode: Mode) -> str:
    """Description of the event at a zero of a guard."""
    kinks = len(equations.kinks)
    if guard.switch < kinks:
        return boundary(equations.kinks[guard.switch])
    contact = guard.switch - kinks
    name = equations.labels[contact]
    if equations.contacts[contact].opens:
        return f"contact '{name.removeprefix(NORMAL)}' {'opens' if guard.to else 'closes'}"
    in_plane = equations.contacts[contact].plane > 0
    before, after = mode_name(mode[contact], in_plane), mode_name(guard.to, in_plane)
    return f"contact '{name}' goes from {before} to {after}"


def pressed_text(forces: Mapping[str, float]) -> str:
    """Normal forces, to be put behind a state."""
    said = ", ".join(f"{name} = {value:.9g}" for name, value in forces.items())
    return f", normal forces {said}" if said else ""


def modes_text(modes: Mapping[str, str]) -> str:
    return ", ".join(f"{contact}: {mode}" for contact, mode in modes.items()) or "no contacts"
