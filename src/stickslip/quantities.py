"""Units and meanings of what is measured: parts of the state, drifts, and the named measures of maps."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from stickslip.system import System


def quantity(system: System, name: str) -> dict[str, str]:
    """Unit and meaning of a parameter or of a part of the state.

    Parameters
    ----------
    system : System
    name : str
        A parameter, a coordinate ``x``, an internal variable or a rate ``d_x``.
    """
    named = {**system.parameters, **system.coordinates, **system.internal}
    if name in named:
        return {"units": named[name].unit or "1", "long_name": named[name].meaning or name}
    moving = named[name.removeprefix("d_")]
    return {"units": per_time(system, moving.unit), "long_name": f"rate of {moving.meaning or name[2:]}"}


def per_time(system: System, unit: str) -> str:
    """The unit of a rate."""
    time = system.time_unit
    return f"{unit or '1'}/{time}" if time not in ("", "1") else unit or "1"


def drift_units(system: System, direction: Mapping[str, float]) -> tuple[str, str]:
    """Units of a shift along a direction and of its rate; ``"1"`` if the components have none in common."""
    found = {quantity(system, name)["units"] for name, weight in direction.items() if weight}
    if len(found) != 1:
        return "1", "1"
    drift = found.pop()
    return drift, per_time(system, drift)


def described(system: System, text: str) -> dict[str, str]:
    """Unit and meaning of a named measure, such as ``amplitude:psi``."""
    name, _, of = text.partition(":")
    meaning, unit = MEANINGS.get(name, (name.replace("_", " "), _none))
    return {"units": unit(system, of) or "1", "long_name": f"{meaning} ({of})" if of else meaning}


def _none(system: System, of: str) -> str:
    return "1"


def _time(system: System, of: str) -> str:
    return system.time_unit


def _component(system: System, of: str) -> str:
    return quantity(system, of or system.declaration.state[0])["units"]


def _speed(system: System, of: str) -> str:
    return per_time(system, _component(system, of or next(iter(system.translation), "")))


def _force(system: System, of: str) -> str:
    return next((contact.unit for name, contact in system.contacts.items() if of in ("", name)), "")


def _work(system: System, of: str) -> str:
    direction = next((c.direction for c in system.declaration.contacts if of in ("", c.name)), {})
    length = _component(system, next(iter(direction))) if direction else "1"
    return "*".join(unit for unit in (_force(system, of), length) if unit not in ("", "1"))


MEANINGS: dict[str, tuple[str, Callable[[System, str], str]]] = {
    "period": ("period", _time),
    "amplitude": ("amplitude", _component),
    "speed": ("mean speed", _speed),
    "stick_fraction": ("share of the time in stick", _none),
    "energy_per_cycle": ("energy dissipated in a cycle", _work),
    "peak_force": ("largest friction force", _force),
    "mean_force": ("mean friction force", _force),
    "lyapunov": ("largest Lyapunov exponent", lambda system, of: per_time(system, "")),
    "switches": ("switches in a cycle", _none),
}
