"""Smooth flows x' = f(x): systems of internal variables only."""

from __future__ import annotations

from stickslip import Internal, System
from systems import parameters


def flow(laws: dict[str, str], initial: dict[str, float] | None = None, **values: float) -> System:
    """A flow by its laws, with initial values and parameters."""
    internal = {x: Internal(law) for x, law in laws.items()}
    return System(
        name="flow", parameters=parameters(**values), internal=internal, initial=initial or {}
    )
