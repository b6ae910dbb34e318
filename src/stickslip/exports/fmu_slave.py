"""A system inside a functional mock-up unit (FMU): a :class:`stickslip.Stepper` behind the
functions that pythonfmu calls.

A Python exception would end the process of pythonfmu's library, so none leaves this module after
instantiation: errors are logged, the step is discarded, and undefined values are NaN.
"""

from __future__ import annotations

import io
import json
import math
from pathlib import Path
from typing import Any
from uuid import NAMESPACE_URL, uuid5
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from pythonfmu import (
    Boolean,
    DefaultExperiment,
    Fmi2Causality,
    Fmi2Initial,
    Fmi2Slave,
    Fmi2Variability,
    Integer,
    Real,
)
from pythonfmu.enums import Fmi2Status
from pythonfmu.variables import ScalarVariable

from stickslip.errors import ConvergenceError, DeclarationError, StickslipError
from stickslip.exports.fmu_model import (
    CERTIFICATE_OK,
    CERTIFICATE_RESIDUAL,
    CERTIFY,
    MODEL_FILE,
    NO_MODE_KNOWN,
    FmuModel,
    FmuVariable,
)
from stickslip.model.entries.units import factors, lowest_terms
from stickslip.motion.stepper import Stepper, StepperState
from stickslip.motion.trajectory import Trajectory
from stickslip.numerics.levels import LEAST_RTOL, MOMENT

_RTOL = 1e-10
_STEPS = 500  # number of steps of the default experiment
_OUTPUTS = ("output", "mode")
_ROUNDING = 1e-9  # relative rounding error of times that importers sum
_CAUSALITY = {
    "parameter": (Fmi2Causality.parameter, Fmi2Variability.fixed, Fmi2Initial.exact),
    "start": (Fmi2Causality.parameter, Fmi2Variability.fixed, Fmi2Initial.exact),
    "input": (Fmi2Causality.input, Fmi2Variability.continuous, None),
    "output": (Fmi2Causality.output, Fmi2Variability.continuous, Fmi2Initial.calculated),
    "mode": (Fmi2Causality.output, Fmi2Variability.discrete, Fmi2Initial.calculated),
}


class SystemFmu(Fmi2Slave):
    """The system that is declared in the resources of an FMU.

    Parameters
    ----------
    **kwargs
        Of pythonfmu: name of the instance, folder of the resources.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.model: FmuModel = FmuModel.read(Path(str(self.resources)) / MODEL_FILE)
        system = self.model.system
        self.modelName = self.model.identifier
        self.description = system.title or system.name
        self.guid = uuid5(NAMESPACE_URL, self.model.module)
        start, stop = system.span
        self.default_experiment = DefaultExperiment(start, stop, (stop - start) / _STEPS)
        self._begin: float = float(start)
        self._rtol: float = _RTOL
        self._given: dict[str, float] = {}  # parameters, starts and inputs that were set
        self._measures: bool = True
        self._stepper: Stepper | None = None
        self._phase: str = "before"  # "running" after the initialization, then "over"
        self._fault: StickslipError | None = None
        self._motion: Trajectory | None = None  # motion of the last step
        self._shown: dict[str, Any] = {}
        self._certified: bool = True
        self._residual: float = 0.0
        for variable in self.model.variables:
            self.register_variable(self._declared(variable))
        self._declare_certificate()

    # -- variables ---------------------------------------------------------------------------------

    def _declared(self, v: FmuVariable) -> ScalarVariable:
        causality, variability, initial = _CAUSALITY[v.role]
        about: dict[str, Any] = {
            "causality": causality,
            "variability": variability,
            "initial": initial,
            "description": v.meaning,
        }
        if v.role == "mode":
            return Integer(v.name, getter=lambda: self._mode(v.name), **about)
        if v.role == "output":
            return Real(v.name, getter=lambda: self._output(v.name), **about)

        def take(value: float) -> None:
            self._set(v, float(value))

        return Real(v.name, getter=lambda: self._given.get(v.name, v.value), setter=take, **about)

    def _declare_certificate(self) -> None:
        def take(value: bool) -> None:
            self._only_before(CERTIFY, bool(value) != self._measures)
            if self._phase == "before":
                self._measures = bool(value)

        shown: dict[str, Any] = {
            "causality": Fmi2Causality.output,
            "variability": Fmi2Variability.discrete,
            "initial": Fmi2Initial.calculated,
        }
        parameter: dict[str, Any] = dict(
            zip(("causality", "variability", "initial"), _CAUSALITY["parameter"], strict=True)
        )
        for variable in (
            Boolean(
                CERTIFY,
                getter=lambda: self._measures,
                setter=take,
                description="whether the certificate of every step is measured",
                **parameter,
            ),
            Boolean(
                CERTIFICATE_OK,
                getter=lambda: self._measures and self._certified and self._fault is None,
                description="whether all steps so far are certified",
                **shown,
            ),
            Real(
                CERTIFICATE_RESIDUAL,
                getter=lambda: self._residual if self._measures else math.nan,
                description="largest residual of the certificates of all steps so far",
                **shown,
            ),
        ):
            self.register_variable(variable)

    def _set(self, v: FmuVariable, value: float) -> None:
        if v.role != "input":
            changed = value != self._given.get(v.name, v.value)
            self._only_before(v.name, changed)
            if self._phase != "before":
                return
            self._stepper = None
        self._given[v.name] = value
        if self._stepper is None or self._motion is None:
            self._shown = {}

    def _only_before(self, name: str, changed: bool) -> None:
        """Reject all further steps if a parameter changes during the motion."""
        if changed and self._phase != "before":
            reason = "it cannot be set after the initialisation"
            remedy = "Set it earlier, or export it as an input"
            self._refuse(DeclarationError(name, reason, remedy))

    def _refuse(self, error: StickslipError) -> None:
        self._fault = self._fault or error
        self._say(error)

    def _say(self, error: Exception) -> None:
        self.log(f"{self.instance_name}: {error}", Fmi2Status.error)

    def _of(self, role: str) -> dict[str, float]:
        """The set values, by names of the system."""
        own = [v for v in self.model.variables if v.role == role and v.name in self._given]
        return {v.quantity: self._given[v.name] for v in own}

    def _output(self, name: str) -> float:
        if name in self._shown:
            return float(self._shown[name])
        stepper = self._ready()
        if stepper is not None and name in (state := stepper.state):
            return state[name]
        return float(self._all_shown().get(name, math.nan))

    def _mode(self, name: str) -> int:
        value = self._shown[name] if name in self._shown else self._all_shown().get(name)
        return NO_MODE_KNOWN if value is None else int(value)

    def _all_shown(self) -> dict[str, Any]:
        """All quantities at this time; none if the motion has no start."""
        stepper = self._ready()
        if not self._shown and stepper is not None:
            try:
                self._shown = (
                    self._at_the_start(stepper)
                    if self._motion is None
                    else self._motion.at(stepper.time)
                )
            except StickslipError as error:
                self._say(error)
        return self._shown

    def _at_the_start(self, stepper: Stepper) -> dict[str, Any]:
        """Values at the start of the motion."""
        saved = stepper.save()
        start, stop = self.model.system.span
        try:
            stepper.advance(stepper.time + MOMENT * (stop - start), self._of("input"))
            return stepper.motion.at(saved.time)
        finally:
            stepper.restore(saved)

    def _ready(self) -> Stepper | None:
        """The stepper; None if the initial state is inadmissible."""
        if self._stepper is None and self._fault is None:
            try:
                self._stepper = Stepper(
                    self.model.system,
                    initial=self._of("start"),
                    parameters=self._of("parameter"),
                    inputs=self.model.inputs,
                    time=self._begin,
                    rtol=self._rtol,
                )
            except StickslipError as error:
                if self._phase == "before":  # the error can be corrected
                    return None
                self._refuse(error)
        return self._stepper

    # -- interface for importers -------------------------------------------------------------------

    def setup_experiment(
        self, start_time: float, stop_time: float | None, tolerance: float | None
    ) -> None:
        """Set the start time; a tolerance can only increase the accuracy of the motion."""
        self._begin = start_time
        if tolerance is not None:
            self._rtol = min(_RTOL, max(float(tolerance), LEAST_RTOL))
        self._stepper = None

    def exit_initialization_mode(self) -> None:
        """Start the motion; errors of the parameters are logged here, and no step is taken."""
        self._phase = "running"
        self._ready()

    def terminate(self) -> None:
        """End."""
        self._phase = "over"

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance the motion; return whether this succeeded."""
        try:
            self._move(current_time, step_size)
        except Exception as error:
            self._say(error)
            return False
        return True

    def _move(self, begin: float, size: float) -> None:
        stepper = self._ready()
        if self._phase != "running" or stepper is None or self._fault is not None:
            before = "the initialisation has not ended"
            after = "the FMU was terminated"
            raise self._fault or DeclarationError(
                "step", before if self._phase == "before" else after, "Reset the FMU"
            )
        now = stepper.time
        if not 0.0 < size < math.inf or begin + size <= now:
            reason = f"from {begin:.9g} by {size:.9g}, while the FMU is at {now:.9g}"
            remedy = "An FMU cannot step backwards; restore a saved state, or reset it"
            raise DeclarationError("step", reason, remedy)
        if not abs(begin - now) <= _ROUNDING * max(abs(now), size):
            reason = f"the step begins at {begin:.9g}, but the FMU is at {now:.9g}"
            raise DeclarationError("step", reason, "Continue from there, or restore a saved state")
        end = begin + size
        stepper.system.declaration.check_span(now, end)
        saved = stepper.save()
        try:
            stepper.advance(end, self._of("input"))
        except ConvergenceError:
            stepper.restore(saved)  # so that a smaller step may be tried
            raise
        self._motion = stepper.motion
        self._shown = {}
        if self._measures:
            found = self._motion.certificate
            self._certified = self._certified and found.ok
            worst = max(residual.value for residual in found.residuals)
            self._residual = max(self._residual, worst)

    # -- its state ---------------------------------------------------------------------------------

    def _get_fmu_state(self) -> dict[str, Any]:
        moved = self._stepper if self._motion is not None else None
        said = {
            "given": dict(self._given),
            "begin": self._begin,
            "rtol": self._rtol,
            "phase": self._phase,
            "measures": self._measures,
            "certified": self._certified,
            "residual": self._residual,
            "shown": {
                name: value for name, value in self._all_shown().items() if np.ndim(value) == 0
            },
        }
        return {"said": said, "stepper": None if moved is None else moved.save()}

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        said, saved = state["said"], state["stepper"]
        fixed = {n: v for n, v in said["given"].items() if n not in self.model.inputs}
        own = {n: v for n, v in self._given.items() if n not in self.model.inputs}
        same = (fixed, said["begin"], said["rtol"]) == (own, self._begin, self._rtol)
        self._given = dict(said["given"])
        self._begin, self._rtol, self._phase = said["begin"], said["rtol"], said["phase"]
        self._measures, self._certified = said["measures"], said["certified"]
        self._residual = said["residual"]
        self._fault = None
        self._motion = None
        if saved is None or not same:
            self._stepper = None
        stepper = self._ready()
        if saved is not None and stepper is not None:
            stepper.restore(saved)
        self._shown = dict(said["shown"])

    @staticmethod
    def _fmu_state_to_bytes(state: dict[str, Any]) -> bytes:
        saved = state["stepper"]
        said = dict(state["said"])
        arrays: dict[str, Any] = {}
        if saved is not None:
            said |= {"time": saved.time, "inputs": dict(saved.inputs)}
            arrays = {f"lane {i}": part for i, part in enumerate(saved.lane)}
            arrays["numbers"] = saved.numbers
        buffer = io.BytesIO()
        text = np.frombuffer(json.dumps(said).encode(), np.uint8)
        np.savez(buffer, allow_pickle=False, said=text, **arrays)
        return buffer.getvalue()

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> dict[str, Any]:
        with np.load(io.BytesIO(state), allow_pickle=False) as parts:
            said = json.loads(parts["said"].tobytes())
            if "numbers" not in parts:
                return {"said": said, "stepper": None}
            lane = tuple(parts[f"lane {i}"] for i in range(len(parts) - 2))
            numbers = parts["numbers"]
        saved = StepperState(said.pop("time"), said.pop("inputs"), lane, numbers)
        return {"said": said, "stepper": saved}

    # -- description -------------------------------------------------------------------------------

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """The description of the model, with units, and numbers in full."""
        root = super().to_xml(model_options or {})
        root.set("variableNamingConvention", "flat")  # such as u[tip]
        units = {v.name: v.unit for v in self.model.variables if v.unit not in ("", "1")}
        starts = {v.name: repr(v.value) for v in self.model.variables if v.role not in _OUTPUTS}
        unknowns: list[str] = []
        for i, element in enumerate(root.iterfind("ModelVariables/ScalarVariable"), start=1):
            name = element.get("name", "")
            number = element.find("Real")
            if number is not None and name in units:
                number.set("unit", units[name])
            if number is not None and name in starts:
                number.set("start", starts[name])
            if element.get("initial") == "calculated":
                unknowns.append(str(i))
        structure = root.find("ModelStructure")
        if structure is not None:
            initial = SubElement(structure, "InitialUnknowns")
            for index in unknowns:
                SubElement(initial, "Unknown", {"index": index})
        if units:
            root.insert(1, _unit_definitions(sorted(set(units.values()))))
        return root


def _unit_definitions(units: list[str]) -> Element:
    """Units as products of those of the SI."""
    found = Element("UnitDefinitions")
    for unit in units:
        own = SubElement(found, "Unit", {"name": unit})
        scale, powers = lowest_terms(factors(unit))
        if all(power.denominator == 1 for power in powers.values()):
            exponents = {name: str(power) for name, power in powers.items() if name != "rad"}
            factor = {} if scale == 1.0 else {"factor": repr(scale)}
            SubElement(own, "BaseUnit", exponents | factor)
    return found
