"""The variables of a functional mock-up unit (FMU), as data."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, is_dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal, Self

from stickslip.errors import DeclarationError, StickslipError, short, suggestion
from stickslip.model import system_file
from stickslip.model.declaration import Declaration
from stickslip.model.quantities import formula_unit, quantity
from stickslip.model.system import System
from stickslip.motion.stepper import Stepper, with_inputs
from stickslip.motion.trajectory import Trajectory
from stickslip.numerics.levels import MOMENT
from stickslip.symbolic.expressions import Expr

MODEL_FILE = "model.json"
CERTIFY = "certificate.measured"
CERTIFICATE_OK = "certificate.ok"
CERTIFICATE_RESIDUAL = "certificate.residual"
AT_START = "start."
NO_MODE_KNOWN = -9  # mode of a motion that cannot start
_OF_ONE_STEP = ("dissipated_energy", "supplied_energy")

Role = Literal["parameter", "start", "input", "output", "mode"]


@dataclass(frozen=True)
class FmuVariable:
    """A variable of an FMU.

    Attributes
    ----------
    value : float
        Before it is set; of outputs 0.
    unit, meaning : str
    """

    name: str
    role: Role
    value: float = 0.0
    unit: str = ""
    meaning: str = ""

    @property
    def quantity(self) -> str:
        """Name in the system."""
        return self.name.removeprefix(AT_START) if self.role == "start" else self.name


@dataclass(frozen=True)
class FmuModel:
    """A system as an FMU.

    Attributes
    ----------
    variables : tuple of FmuVariable
        In the order of their value references.
    version : str
        Of the library that wrote it.
    """

    system: System
    variables: tuple[FmuVariable, ...]
    version: str

    @property
    def inputs(self) -> list[str]:
        """Parameters and drives whose values are set before each step."""
        return [v.name for v in self.variables if v.role == "input"]

    @property
    def identifier(self) -> str:
        """The name of the system as an identifier of C."""
        plain = re.sub(r"\W+", "_", self.system.name, flags=re.ASCII).strip("_")
        return plain if plain[:1].isalpha() else f"system_{plain}".rstrip("_")

    @property
    def module(self) -> str:
        """The name of its Python module, unique for every model, since a process may run several
        FMUs."""
        return f"{self.identifier}_{sha256(self.to_json().encode()).hexdigest()[:12]}"

    def to_json(self) -> str:
        """Text for :meth:`read`."""
        variables = [asdict(v) for v in self.variables]
        parts = {"stickslip": self.version, "variables": variables, "model": self.system.to_toml()}
        return json.dumps(parts, indent=1, ensure_ascii=False)

    @classmethod
    def read(cls, path: Path) -> Self:
        """The model in a file.

        Raises
        ------
        StickslipError
            If it cannot be read.
        """
        try:
            parts = json.loads(path.read_text(encoding="utf-8"))
            variables = tuple(FmuVariable(**v) for v in parts["variables"])
            return cls(system_file.loads(parts["model"]), variables, parts["stickslip"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise StickslipError(f"{path}: not the model of an FMU ({error})") from error


def fmu_model(system: System, inputs: Sequence[str] | None, outputs: Sequence[str]) -> FmuModel:
    """Variables of the FMU of a system.

    Parameters
    ----------
    inputs : sequence of str, optional
        Parameters and drives; by default all drives that can be held.
    outputs : sequence of str
        All if there are none.

    Raises
    ------
    DeclarationError
        If an input cannot be one, an output is unknown, or the declared motion has no start.
    """
    from stickslip import __version__

    chosen = _holdable(system) if inputs is None else list(dict.fromkeys(inputs))
    for name in chosen if inputs is not None else ():
        _check_holdable(system, name)
    stepper = Stepper(system, inputs=chosen)
    start, stop = system.span
    stepper.advance(start + MOMENT * (stop - start))
    motion = stepper.motion
    held = stepper.system.declaration
    used = _symbols_of(held)
    variables = [
        *(
            FmuVariable(name, "parameter", float(p.default), *_said(quantity(system, name)))
            for name, p in system.parameters.items()
            if name in used and name not in chosen
        ),
        *(
            FmuVariable(f"{AT_START}{name}", "start", held.start[name], *_start_said(system, name))
            for name in held.state
        ),
        *(
            FmuVariable(name, "input", value, *_input_said(system, name))
            for name, value in stepper.inputs.items()
        ),
        *_outputs(motion, outputs),
    ]
    return FmuModel(system, tuple(variables), __version__)


def _holdable(system: System) -> list[str]:
    """Drives that can be held during a step."""
    found: list[str] = []
    for name in system.drives:
        try:
            _check_holdable(system, name)
        except DeclarationError:
            continue
        found.append(name)
    return found


def _check_holdable(system: System, name: str) -> None:
    """Reject an input that is neither a parameter nor a drive, or whose rate is used, since a value
    held during a step has no rate."""
    if name in system.parameters:
        return
    if name not in system.drives:
        known = suggestion(str(name), [*system.parameters, *system.drives])
        reason = f"'{short(str(name))}' is not a parameter or a drive"
        raise DeclarationError("inputs", reason, known)
    remedy = "Keep it as declared, and use a parameter that it depends on"
    reason = f"the rate of '{name}' is used, but an input that is held during a step has no rate"
    try:
        held = with_inputs(system, {name: 0.0}, False, 0.0).declaration
    except DeclarationError:
        raise DeclarationError("inputs", reason, remedy) from None
    moved = [e for c in held.contacts for e in (c.gap, *c.direction.values()) if e is not None]
    if any(name in e.symbols for e in moved):
        raise DeclarationError("inputs", reason, remedy)


def _symbols_of(part: Any) -> set[str]:
    """Names that the equations of a declaration depend on."""
    if isinstance(part, Expr):
        return set(part.symbols)
    if isinstance(part, Declaration):
        # Facts, conditions and drives alone are excluded: they do not change the motion.
        of_motion = (
            "mass damping kinetic potential dissipation forces drags laws contacts jumps outputs"
        )
        return _all_symbols(getattr(part, name) for name in of_motion.split())
    if is_dataclass(part) and not isinstance(part, type):
        own = _all_symbols(getattr(part, f.name) for f in fields(part))
        return own | set(getattr(part, "parameters", ()))
    if isinstance(part, dict):
        return _all_symbols(part.values())
    if isinstance(part, list | tuple):
        return _all_symbols(part)
    return set()


def _all_symbols(parts: Iterable[Any]) -> set[str]:
    return set[str]().union(*map(_symbols_of, parts))


def _said(about: Mapping[str, str]) -> tuple[str, str]:
    """Unit and meaning."""
    return about.get("units", ""), about["long_name"]


def _start_said(system: System, name: str) -> tuple[str, str]:
    unit, meaning = _said(quantity(system, name))
    return unit, f"{meaning} at the start"


def _input_said(system: System, name: str) -> tuple[str, str]:
    if name in system.parameters:
        return _said(quantity(system, name))
    formula = system.declaration.drives.get(name)  # None for samples
    return "" if formula is None else formula_unit(system, formula), f"drive {name}"


def _outputs(motion: Trajectory, names: Sequence[str]) -> list[FmuVariable]:
    """Quantities of a motion as outputs; by default all except those that start anew in each
    step."""
    data = motion.dataset
    shown = [str(name) for name in data.data_vars if name not in _OF_ONE_STEP]
    for name in names:
        if name not in shown:
            raise DeclarationError(
                "quantities", f"unknown output '{short(str(name))}'", suggestion(name, shown)
            )
    found: list[FmuVariable] = []
    for name in dict.fromkeys(names or shown):
        about = data[name].attrs
        if "flag_meanings" in about:
            words = zip(about["flag_values"], about["flag_meanings"].split(), strict=True)
            said = ", ".join(f"{number} {word}" for number, word in words)
            found.append(FmuVariable(name, "mode", 0.0, "", f"{about['long_name']}: {said}"))
        else:
            found.append(FmuVariable(name, "output", 0.0, *_said(about)))
    return found
