"""How the engine calls the functions of a system."""

from __future__ import annotations

from functools import cache
from typing import Any

_SERIES = "Rq:matrix Rz:matrix N:int64 W:matrix A:matrix B:matrix mag:vector"
_INSTANT = "t:float64 y:vector mode:indices reg:indices K:vector"
INTERFACE: dict[str, tuple[str, dict[str, str]]] = {
    name: (result, dict(argument.split(":") for argument in arguments.split()))
    for name, result, arguments in (
        ("setup", "void", "p:vector K:vector M:matrix C:matrix J:matrix omega:vector"),
        ("jets", "int64", f"{_INSTANT} {_SERIES}"),
        ("residual", "void", f"{_INSTANT} G:vector P:matrix"),
        ("powers", "void", "W:matrix reg:indices K:vector out:vector"),
        ("landings", "void", "W:matrix reg:indices K:vector out:vector"),
    )
}
"""By name: what a function returns, and its arguments with their kinds."""


@cache
def signature(name: str) -> Any:
    """The numba signature of a function."""
    from numba import float64, int64, void

    types: dict[str, Any] = {
        "void": void,
        "float64": float64,
        "int64": int64,
        "vector": float64[::1],
        "matrix": float64[:, ::1],
        "indices": int64[::1],
    }
    result, arguments = INTERFACE[name]
    return types[result](*(types[kind] for kind in arguments.values()))
