"""How the engine calls the functions of a system."""

from __future__ import annotations

from typing import Any

from numba import float64, int64, types, void

_SERIES = "Rq:matrix Rz:matrix N:int64 W:matrix A:matrix B:matrix mag:vector"
_INSTANT = "t:float64 y:vector mode:indices reg:indices K:vector"
INTERFACE: dict[str, tuple[str, dict[str, str]]] = {
    name: (result, dict(argument.split(":") for argument in arguments.split()))
    for name, result, arguments in (
        ("setup", "void", "p:vector K:vector M:matrix C:matrix J:matrix omega:vector"),
        ("jets", "int64", f"{_INSTANT} {_SERIES}"),
        ("residual", "void", f"{_INSTANT} G:vector P:matrix"),
        ("powers", "void", "W:matrix reg:indices K:vector out:vector"),
    )
}
"""By name: what a function returns, and its arguments with their kinds."""
_TYPES: dict[str, Any] = {
    "void": void,
    "float64": float64,
    "int64": int64,
    "vector": float64[::1],
    "matrix": float64[:, ::1],
    "indices": int64[::1],
}


def signature(name: str) -> Any:
    """The numba signature of a function."""
    result, arguments = INTERFACE[name]
    return _TYPES[result](*(_TYPES[kind] for kind in arguments.values()))


def function_type(name: str) -> Any:
    """The numba type of a function that is handed over."""
    return types.FunctionType(signature(name))
