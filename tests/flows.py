"""Smooth flows x' = f(x): systems of internal variables only."""

from __future__ import annotations

from stickslip import Internal, System
from stickslip.arrays import Matrix
from stickslip.machine_code.functions import entry_point
from stickslip.motion.steps.arrays import Flow, Instant, Machine
from stickslip.motion.steps.starting import coefficients
from systems import parameters


def flow(laws: dict[str, str], initial: dict[str, float] | None = None, **values: float) -> System:
    """A flow by its laws, with initial values and parameters."""
    internal = {x: Internal(law) for x, law in laws.items()}
    return System(
        name="flow", parameters=parameters(**values), internal=internal, initial=initial or {}
    )


@entry_point()
def taylor_series(machine: Machine, flow: Flow, at: Instant, order: int, table: Matrix) -> int:
    """Taylor coefficients of all rows."""
    return coefficients(machine, flow, at, order, table)
