"""A product and a sum in one instruction, for the source that numba compiles."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import lower_builtin, type_callable


def fma(a: float, b: float, c: float) -> float:
    """a·b + c, compiled to one instruction where the machine has it."""
    return a * b + c


@type_callable(fma)
def _type_of_fma(context: Any) -> Any:
    def signature(a: Any, b: Any, c: Any) -> Any:
        return types.float64(types.float64, types.float64, types.float64)

    return signature


@lower_builtin(fma, types.float64, types.float64, types.float64)
def _code_of_fma(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    real = ir.DoubleType()
    function = builder.module.declare_intrinsic(
        "llvm.fmuladd", [real], ir.FunctionType(real, [real] * 3)
    )
    return builder.call(function, arguments)
