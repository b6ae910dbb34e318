"""The drives of a system along a motion: formulas of time, evaluated at many times."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.symbolic.evaluator import NumericFunction, evaluator

if TYPE_CHECKING:
    from stickslip.model.system import System
    from stickslip.motion.trajectory import Trajectory


def drive_of(motion: Trajectory, formula: object, times: Array) -> Array | None:
    """The values of a formula of time and parameters; None if it depends on other quantities, or is
    undefined somewhere."""
    found = _compiled(motion.system, str(formula))
    if found is None:
        return None
    values = np.array([times, *(np.full(len(times), v) for v in motion.parameters.values())])
    (result,) = found(values)
    result = np.broadcast_to(np.asarray(result, float), times.shape)
    return result if np.all(np.isfinite(result)) else None


def way_of(motion: Trajectory, speed: object, times: Array) -> Array | None:
    """Displacement of a body with a given speed."""
    rates = drive_of(motion, speed, times)
    if rates is None:
        return None
    steps = np.diff(times) * (rates[1:] + rates[:-1]) / 2.0
    return np.concatenate([[0.0], np.cumsum(steps)])


@lru_cache(maxsize=128)
def _compiled(system: System, formula: str) -> NumericFunction | None:
    try:
        expression = system.declaration.scope.parse(formula, "formula")
        if expression.symbols - {"t", *system.parameters}:
            return None
        return evaluator([expression], ["t", *system.parameters])
    except DeclarationError:
        return None
