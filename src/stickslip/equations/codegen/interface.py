"""How the engine calls the functions of a system."""

from __future__ import annotations

from typing import Any

from numba import float64, int64, types, void

REAL, COUNT, VECTOR, MATRIX, INDICES = "float64", "int64", "vector", "matrix", "indices"
INTERFACE: dict[str, tuple[str, dict[str, str]]] = {
    "setup": (
        "void",
        dict(p=VECTOR, K=VECTOR, M=MATRIX, C=MATRIX, J=MATRIX, omega=VECTOR),
    ),
    "jets": (
        COUNT,
        dict(t=REAL, y=VECTOR, mode=INDICES, reg=INDICES, K=VECTOR, Rq=MATRIX, Rz=MATRIX)
        | dict(N=COUNT, W=MATRIX, A=MATRIX, B=MATRIX, mag=VECTOR),
    ),
    "residual": (
        "void",
        dict(t=REAL, y=VECTOR, mode=INDICES, reg=INDICES, K=VECTOR, G=VECTOR, P=MATRIX),
    ),
    "powers": ("void", dict(W=MATRIX, reg=INDICES, K=VECTOR, out=VECTOR)),
}
"""By name: what a function returns, and its arguments with their kinds."""
_TYPES: dict[str, Any] = {
    "void": void,
    REAL: float64,
    COUNT: int64,
    VECTOR: float64[::1],
    MATRIX: float64[:, ::1],
    INDICES: int64[::1],
}


def signature(name: str) -> Any:
    """The numba signature of a function."""
    result, arguments = INTERFACE[name]
    return _TYPES[result](*(_TYPES[kind] for kind in arguments.values()))


def function_type(name: str) -> Any:
    """The numba type of a function that is handed over."""
    return types.FunctionType(signature(name))
