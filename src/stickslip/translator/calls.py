"""Functions of Python that the language knows: what a call of them becomes."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from stickslip.translator import call_address, fma, row_of
from stickslip.translator.assembly import POINTER, REAL, WHOLE, real, whole
from stickslip.translator.values import (
    BOOL,
    COMPLEX,
    FLOAT,
    INT,
    NAMED,
    NONE,
    ArrayType,
    Index,
    Scalar,
    TupleType,
    Value,
    Values,
    joined,
    named,
)

REAL_FUNCTIONS: dict[Any, str] = {
    **{
        getattr(math, name): f"llvm.{name}.f64"
        for name in "exp log sin cos sqrt log2 log10".split()
    },
    **{getattr(np, name): f"llvm.{name}.f64" for name in "sqrt floor ceil".split()},
    **{
        getattr(math, name): name
        for name in "tan log1p expm1 sinh cosh tanh acos asin atan".split()
    },
    **{getattr(math, name): name for name in "erf erfc acosh asinh atanh atan2 hypot fmod".split()},
    **{math.fabs: "llvm.fabs.f64", math.copysign: "llvm.copysign.f64", fma: "llvm.fma.f64"},
    **{np.power: "llvm.pow.f64", math.pow: "llvm.pow.f64"},
}
"""Functions of real numbers: what LLVM or the mathematical library of C calls them."""


def _len(f: Values, value: Value, /) -> Value:
    if isinstance(value.type, ArrayType):
        return f.length(value, 0)
    return f.constant(len(f.parts(value)))


def _abs(f: Values, x: Value, /) -> Value:
    if x.is_known:
        return f.constant(abs(x.known))
    if x.type == COMPLEX:
        return Value(FLOAT, f.outside(REAL, "hypot", *f.split(x), flags=f.flags))
    if x.type == FLOAT:
        return Value(FLOAT, f.outside(REAL, "llvm.fabs.f64", x.register, flags=f.flags))
    x = f.cast(x, INT)
    return f.either(f.compare("Lt", x, f.constant(0)), f.negative(x), x)


def _best(operation: str, f: Values, first: Value, /, *given: Value) -> Value:
    """The first that no other is better than, as Python has it."""
    best, *others = (first, *given) if given else f.parts(first) or [Value(NONE)]
    for other in others:
        type_ = joined(best.type, other.type)
        if type_ not in (BOOL, INT, FLOAT):
            f.refuse(f"the largest of {named(best.type)} and {named(other.type)}", "Give numbers")
        best, other = f.cast(best, type_), f.cast(other, type_)
        best = f.either(f.compare(operation, other, best), other, best)
    return best


def _complex(f: Values, re: Value, im: Value | None = None, /) -> Value:
    if im is None:
        return f.cast(re, COMPLEX)
    return f.complex(f.cast(re, FLOAT).register, f.cast(im, FLOAT).register)


def _as(type_: Scalar, f: Values, x: Value, /) -> Value:
    if type_ == BOOL:
        return f.truth(x)
    return f.truncated(x) if (type_, x.type) == (INT, FLOAT) else f.cast(x, type_)


def _rounded(name: str, f: Values, x: Value, /) -> Value:
    """A whole number, as math.floor and math.ceil give it."""
    if x.type in (INT, BOOL):
        return f.cast(x, INT)
    return f.truncated(
        Value(FLOAT, f.outside(REAL, name, f.cast(x, FLOAT).register, flags=f.flags))
    )


def _is_finite(f: Values, x: Value, /) -> Value:
    size = f.outside(REAL, "llvm.fabs.f64", f.cast(x, FLOAT).register)
    return f.bit(f"fcmp one double {size}, {real(math.inf)}")


def _is_nan(f: Values, x: Value, /) -> Value:
    register = f.cast(x, FLOAT).register
    return f.bit(f"fcmp{f.flags} uno double {register}, {register}")


def _frexp(f: Values, x: Value, /) -> Value:
    place = f.slot("i32")
    mantissa = f.outside(REAL, "frexp", f.cast(x, FLOAT).register, place)
    exponent = f.new(WHOLE, f"sext {f.load('i32', place).typed} to i64")
    return f.tuple_of(tuple, [Value(FLOAT, mantissa), Value(INT, exponent)])


def _ldexp(f: Values, x: Value, n: Value, /) -> Value:
    # what lies beyond gives zero or an infinity in any case
    few = f.outside(WHOLE, "llvm.smin.i64", f.cast(n, INT).register, whole(9999))
    few = f.outside(WHOLE, "llvm.smax.i64", few, whole(-9999))
    exponent = f.new("i32", f"trunc {few.typed} to i32")
    return Value(FLOAT, f.outside(REAL, "ldexp", f.cast(x, FLOAT).register, exponent))


def _row_of(f: Values, value: Value, i: Value, /) -> Value:
    if isinstance(value.type, TupleType):
        return f.tuple_of(value.type.kind, [_row_of(f, part, i) for part in f.parts(value)])
    return f.element(value, [Index(f.cast(i, INT))]) if isinstance(value.type, ArrayType) else value


def _call_address(f: Values, address: Value, x: Value, /) -> Value:
    place = f.new(POINTER, f"inttoptr {f.cast(address, INT).register.typed} to ptr")
    return Value(FLOAT, f.call(REAL, str(place), f.cast(x, FLOAT).register))


def _complex_exp(f: Values, z: Value, /) -> Value:
    return f.runtime("complex_exp", f.cast(z, COMPLEX))


def _real(name: str, f: Values, x: Value, /) -> Value:
    return Value(FLOAT, f.outside(REAL, name, f.cast(x, FLOAT).register, flags=f.flags))


def _real_of_two(name: str, f: Values, x: Value, y: Value, /) -> Value:
    given = (f.cast(x, FLOAT).register, f.cast(y, FLOAT).register)
    return Value(FLOAT, f.outside(REAL, name, *given, flags=f.flags))


def _fma(f: Values, a: Value, b: Value, c: Value, /) -> Value:
    given = (f.cast(x, FLOAT).register for x in (a, b, c))
    return Value(FLOAT, f.outside(REAL, REAL_FUNCTIONS[fma], *given, flags=f.flags))


_OF_TWO = (math.atan2, math.hypot, math.fmod, math.copysign, math.pow, np.power)
REAL_CALLS: dict[Any, Callable[..., Value]] = {
    **{
        function: partial(_real_of_two if function in _OF_TWO else _real, name)
        for function, name in REAL_FUNCTIONS.items()
    },
    fma: _fma,
}
CALLS: dict[Any, Callable[..., Value]] = {
    len: _len,
    abs: _abs,
    np.abs: _abs,
    max: partial(_best, "Gt"),
    min: partial(_best, "Lt"),
    **{kind: partial(_as, NAMED[kind]) for kind in (int, float, bool)},
    complex: _complex,
    math.floor: partial(_rounded, "llvm.floor.f64"),
    math.ceil: partial(_rounded, "llvm.ceil.f64"),
    math.isfinite: _is_finite,
    np.isfinite: _is_finite,
    math.isnan: _is_nan,
    np.isnan: _is_nan,
    math.frexp: _frexp,
    math.ldexp: _ldexp,
    cmath.exp: _complex_exp,
    row_of: _row_of,
    call_address: _call_address,
}
"""Functions of Python that are more than one instruction: what they become."""
