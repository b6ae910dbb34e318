"""What an equilibrium is: a state of rest or of steady sliding, or a set of them, as data."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from stickslip.certificates import Certificate
from stickslip.equations.derive import MotionEquations
from stickslip.equations.field import MODE_NAMES, Guard, Mode, Region
from stickslip.symbolic import expressions as ex

if TYPE_CHECKING:
    import pandas

CRITICAL = 1e-9  # real parts this small, relative to the largest eigenvalue, are zero


@dataclass(frozen=True)
class Equilibrium:
    """A state of rest or of steady sliding.

    Attributes
    ----------
    state : dict of str to float
        With a drift: one of the states that differ by the translation.
    parameters : dict of str to float
    contacts : tuple of str
        Names of the contacts in the order of `mode`.
    mode, region : tuple of int
        Mode of each contact (0 stick, ±1 slip) and region of each kink.
    eigenvalues : tuple of complex
        Of the motion within the mode's constraints and modulo translation, the rightmost first.
    drift : dict of str to float
        Constant rates of a relative equilibrium: what moves steadily along a translation. Empty at
        rest.
    boundary : tuple of str
        What is just about to change (a guard is zero): a boundary equilibrium, whose stability
        eigenvalues of one side do not decide.
    certificate : Certificate
        What is left of the equations, the nearest guard, and how well the eigenvalues are known.
    eigenvalue_error : float
        By how much they may be wrong; a stability that depends on that is not decided.
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

    def __repr__(self) -> str:
        return f"<Equilibrium {self.describe()}>"

    @property
    def modes(self) -> dict[str, str]:
        """Mode of each contact by name."""
        return {c: MODE_NAMES[m] for c, m in zip(self.contacts, self.mode, strict=True)}

    @property
    def stable(self) -> bool | None:
        """Whether it attracts its neighbours; None if linearisation does not decide."""
        return None if self.boundary else decays(self.eigenvalues, self.eigenvalue_error)

    def describe(self) -> str:
        """One line."""
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
            + f"; {verdict}"
        )
        text += "".join(f"; on the boundary: {name}" for name in self.boundary)
        return f"{text}; {self.certificate.verdict}"


@dataclass(frozen=True)
class EquilibriumSet:
    """A set of equilibria: with dry friction a system can rest anywhere in it.

    Attributes
    ----------
    state : dict of str to float
        A point well inside.
    mode : tuple of int
    regions : tuple of tuple of int
        Regions of the kinks that the set extends over.
    dimension : int
        Dimension of the set (directions of translation included).
    extent : dict of str to (float, float)
        Least and largest value of each state in the set; infinite where there is no bound.
    exact : bool
        Whether the extent is that of the whole set (the forces are affine: a linear program).
        Otherwise it was followed from the point inside, and another part of the set may be further
        out.
    eigenvalues : tuple of complex or None
        At that point, across the set: the zeros along it are left out. None if forces are not
        unique there.
    certificate : Certificate
        Of that point.
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

    def __repr__(self) -> str:
        return f"<EquilibriumSet {self.describe()}>"

    @property
    def modes(self) -> dict[str, str]:
        """Mode of each contact by name."""
        return {c: MODE_NAMES[m] for c, m in zip(self.contacts, self.mode, strict=True)}

    @property
    def stable(self) -> bool | None:
        """Whether what does not stick decays towards the set, at the point inside."""
        return None if self.eigenvalues is None else decays(self.eigenvalues)

    def describe(self) -> str:
        """One line."""
        extent = ", ".join(_interval(name, low, high) for name, (low, high) in self.extent.items())
        how = "" if self.exact else " (followed from a point inside)"
        text = f"of dimension {self.dimension}, {modes_text(self.modes)}: {extent}{how}"
        return text if self.certificate.ok else f"{text}; {self.certificate.verdict}"


@dataclass(frozen=True)
class Equilibria:
    """What was found; iterates over the isolated equilibria, then the sets.

    Attributes
    ----------
    isolated : tuple of Equilibrium
        Stable ones first.
    sets : tuple of EquilibriumSet
    tried : str
        Where was looked.
    nearest : str
        If nothing was found, what came nearest.
    """

    isolated: tuple[Equilibrium, ...]
    sets: tuple[EquilibriumSet, ...]
    tried: str
    nearest: str = ""

    def __repr__(self) -> str:
        return f"<Equilibria: isolated {len(self.isolated)}, sets {len(self.sets)}>"

    def __iter__(self) -> Iterator[Equilibrium | EquilibriumSet]:
        return iter((*self.isolated, *self.sets))

    def __len__(self) -> int:
        return len(self.isolated) + len(self.sets)

    def __getitem__(self, index: int) -> Equilibrium | EquilibriumSet:
        return (*self.isolated, *self.sets)[index]

    @property
    def message(self) -> str:
        """What was found, or what was tried and came nearest."""
        if len(self):
            return "\n".join(found.describe() for found in self)
        return f"no equilibrium was found ({self.tried}); " + (self.nearest or "nothing came near")

    @property
    def table(self) -> pandas.DataFrame:
        """One row an equilibrium or set: state, stability, modes, eigenvalues, drift, extent."""
        import pandas as pd

        rows = []
        for found in self:
            extent = found.extent if isinstance(found, EquilibriumSet) else {}
            rows.append(
                {
                    "dimension": found.dimension if isinstance(found, EquilibriumSet) else 0,
                    **found.state,
                    **{f"mode_{c}": m for c, m in found.modes.items()},
                    "stable": {True: "yes", False: "no", None: "undecided"}[found.stable],
                    "largest_real_part": max(
                        (z.real for z in found.eigenvalues or ()), default=math.nan
                    ),
                    **{f"drift_{name}": rate for name, rate in found.drift.items()},
                    **{
                        f"{name}_{side}": v
                        for name, ends in extent.items()
                        for side, v in zip(("min", "max"), ends, strict=True)
                    },
                    "boundary": ", ".join(found.boundary) if isinstance(found, Equilibrium) else "",
                }
            )
        return pd.DataFrame(rows)


def _interval(name: str, low: float, high: float) -> str:
    """Where a state lies in a set."""
    if low == high:
        return f"{name} = {low:.9g}"
    if math.isinf(low) and math.isinf(high):
        return f"any {name}"
    below = "" if math.isinf(low) else f"{low:.9g} ≤ "
    return below + name + ("" if math.isinf(high) else f" ≤ {high:.9g}")


def decays(eigenvalues: tuple[complex, ...], error: float = 0.0) -> bool | None:
    """Whether all (True) or not all (False) linear motions decay; None between the two, give or
    take an error."""
    if not eigenvalues:
        return True  # nothing is left that could move
    top = max(z.real for z in eigenvalues)
    scale = max(map(abs, eigenvalues))
    return None if abs(top) <= max(CRITICAL * scale, error) else top < 0.0


def describe_guard(equations: MotionEquations, guard: Guard, mode: Mode) -> str:
    """What happens where a guard vanishes."""
    kinks = len(equations.kinks)
    if guard.switch < kinks:
        return f"{ex.to_text(equations.kinks[guard.switch])} = 0"
    contact = guard.switch - kinks
    name = equations.contacts[contact].name
    return f"contact '{name}' goes from {MODE_NAMES[mode[contact]]} to {MODE_NAMES[guard.to]}"


def modes_text(modes: Mapping[str, str]) -> str:
    return ", ".join(f"{contact}: {mode}" for contact, mode in modes.items()) or "no contacts"
