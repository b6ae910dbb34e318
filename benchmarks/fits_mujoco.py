"""The forced oscillator identified by ``mujoco.sysid``.

The mass is that of the body, the stiffness that of its slide joint, and the dry friction the
joint's ``frictionloss``, which MuJoCo regularises. The force is the control of a motor, which
MuJoCo holds during a step.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from contextlib import redirect_stdout
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from stickslip.arrays import Array

MODEL = """
<mujoco>
  <option timestep="{step}" gravity="0 0 0" integrator="implicitfast" {option}/>
  <worldbody>
    <body name="mass">
      <joint name="x" type="slide" axis="1 0 0" stiffness="1" frictionloss="1"/>
      <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
    </body>
  </worldbody>
  <actuator><motor name="force" joint="x"/></actuator>
  <sensor><jointpos name="position" joint="x"/></sensor>
</mujoco>
"""
NO_SLIP = 'noslip_iterations="10" noslip_tolerance="0"'
WRITTEN: dict[str, Callable[[Any, Any], None]] = {
    "m": lambda spec, p: setattr(spec.body("mass"), "mass", p.value[0]),
    "k": lambda spec, p: spec.joint("x").stiffness.__setitem__(0, p.value[0]),
    "F_c": lambda spec, p: setattr(spec.joint("x"), "frictionloss", p.value[0]),
}


class Setting(NamedTuple):
    """How MuJoCo simulates.

    Attributes
    ----------
    step : float
    option : str
        Further attributes of ``option``.
    middle : bool
        Whether a step has the force of its middle, not that of its beginning.
    """

    step: float
    option: str = ""
    middle: bool = False


SETTINGS = {
    "`mujoco.sysid`, default settings, 2 ms": Setting(0.002),
    "`mujoco.sysid`, NoSlip, force of mid-step, 2 ms": Setting(0.002, NO_SLIP, True),
    "`mujoco.sysid`, NoSlip, force of mid-step, 0.5 ms": Setting(0.0005, NO_SLIP, True),
}


def absent() -> str:
    """What is missing, or an empty text."""
    try:
        import_module("mujoco.sysid")
    except ImportError as error:
        return f"`mujoco.sysid` is not installed here ({error}): pip install 'mujoco[sysid]'"
    return ""


class Identification:
    """A record, to be fitted by ``mujoco.sysid`` on one thread.

    Parameters
    ----------
    setting : Setting
    times, data : array
    start : mapping of str to float
    bounds : mapping of str to (float, float)
    force : callable
        The force at times.
    """

    def __init__(
        self,
        setting: Setting,
        times: Array,
        data: Array,
        start: Mapping[str, float],
        bounds: Mapping[str, tuple[float, float]],
        force: Callable[[Array], Array],
    ) -> None:
        self._mujoco: Any = import_module("mujoco")
        self._sysid: Any = import_module("mujoco.sysid")
        spec = self._mujoco.MjSpec.from_string(
            MODEL.format(step=setting.step, option=setting.option)
        )
        model = spec.compile()
        steps = setting.step * np.arange(round(float(times[-1]) / setting.step) + 1)
        shift = 0.5 * setting.step if setting.middle else 0.0
        sequence = self._sysid.ModelSequences(
            "oscillator",
            spec,
            "record",
            self._sysid.create_initial_state(model, np.zeros(1), np.zeros(1)),
            self._sysid.TimeSeries(steps, force(steps + shift)[:, None]),
            self._sysid.TimeSeries.from_names(times, data[:, None], model),
        )
        self._residuals: Any = self._sysid.build_residual_fn(
            models_sequences=[sequence], n_threads=1
        )
        self._start, self._bounds, self._samples = start, bounds, len(times)
        # `normalize_residual` of MuJoCo divides by this.
        self._scale = float(np.linalg.norm(data)) / np.sqrt(2.0)

    def _unknowns(self) -> Any:
        unknowns = self._sysid.ParameterDict()
        for name, (low, high) in self._bounds.items():
            unknowns.add(
                self._sysid.Parameter(name, self._start[name], low, high, modifier=WRITTEN[name])
            )
        return unknowns

    def fit(self) -> Array:
        """The estimates."""
        with redirect_stdout(io.StringIO()):  # its optimizer cannot be silenced otherwise
            _, found = self._sysid.optimize(self._unknowns(), self._residuals, verbose=False)
        return np.ravel(found.x)

    def slopes(self, p: Array, samples: Array) -> Array:
        """Derivatives of the positions at some samples with respect to the unknowns, by the
        differences of its optimizer."""
        unknowns = self._unknowns()

        def residuals(x: Array) -> Array:
            return np.concatenate(self._residuals(x, unknowns)[0])

        first = residuals(p).reshape(-1, 1)
        low, high = (edge.reshape(-1, 1) for edge in unknowns.get_bounds())
        minimize: Any = import_module("mujoco.minimize")
        slopes, _ = minimize.jacobian_fd(
            residuals, p.reshape(-1, 1), first, np.finfo(float).eps ** 0.5, 0, [low, high]
        )
        before = self._samples - len(slopes)  # it leaves out those before the end of the first step
        return -self._scale * slopes[samples - before]
