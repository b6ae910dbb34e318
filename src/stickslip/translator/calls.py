"""Functions of Python, `math` and NumPy that the language of the engine contains, and the assembly
of their calls."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from stickslip.translator import call_address, compiled, fma, row_of
from stickslip.translator.assembly import POINTER, REAL, WHOLE, Register
from stickslip.translator.values import (
    BOOL,
    COMPLEX,
    FLOAT,
    INT,
    NAMED,
    NONE,
    ArrayType,
    Scalar,
    TupleType,
    Value,
    Values,
    joined,
)

REAL_FUNCTIONS: dict[Any, str] = {
    getattr(module, name): form.format(name)
    for module, form, names in (
        (math, "llvm.{}.f64", "exp log sin cos sqrt log2 log10 fabs copysign pow"),
        (math, "{}", "tan log1p expm1 sinh cosh tanh acos asin atan"),
        (math, "{}", "erf erfc acosh asinh atanh atan2 hypot fmod"),
        (np, "llvm.{}.f64", "sqrt floor ceil"),
    )
    for name in names.split()
} | {fma: "llvm.fma.f64", np.power: "llvm.pow.f64"}
"""Functions of real numbers, with their names in LLVM or in the mathematical library of C."""
_OF_TWO = (math.atan2, math.hypot, math.fmod, math.copysign, math.pow, np.power)


def _outside(f: Values, name: str, *given: Value) -> Register:
    """Call a function of the library of C, or of LLVM, with real arguments."""
    return f.outside(REAL, name, *(f.cast(x, FLOAT).register for x in given), flags=f.flags)


# Calls are checked against signatures: one function for each number of arguments.


def _real(name: str, f: Values, x: Value, /) -> Value:
    return Value(FLOAT, _outside(f, name, x))


def _real_of_two(name: str, f: Values, x: Value, y: Value, /) -> Value:
    return Value(FLOAT, _outside(f, name, x, y))


def _real_of_three(name: str, f: Values, x: Value, y: Value, z: Value, /) -> Value:
    return Value(FLOAT, _outside(f, name, x, y, z))


def _rounded(name: str, f: Values, x: Value, /) -> Value:
    """An integer: the result of math.floor or math.ceil."""
    return f.cast(x, INT) if x.type in (INT, BOOL) else f.truncated(_real(name, f, x))


def _as(type_: Scalar, f: Values, x: Value, /) -> Value:
    if type_ == BOOL:
        return f.truth(x)
    return f.truncated(x) if (type_, x.type) == (INT, FLOAT) else f.cast(x, type_)


def _complex(f: Values, re: Value, im: Value | None = None, /) -> Value:
    if im is None:
        return f.cast(re, COMPLEX)
    return f.complex(f.cast(re, FLOAT).register, f.cast(im, FLOAT).register)


def _len(f: Values, value: Value, /) -> Value:
    is_array = isinstance(value.type, ArrayType)
    return f.length(value, 0) if is_array else f.constant(len(f.parts(value)))


def _abs(f: Values, x: Value, /) -> Value:
    if x.is_known:
        return f.constant(abs(x.known))
    if x.type == COMPLEX:
        return Value(FLOAT, f.outside(REAL, "hypot", *f.split(x), flags=f.flags))
    if x.type == FLOAT:
        return _real("llvm.fabs.f64", f, x)
    x = f.cast(x, INT)
    return f.either(f.compare("Lt", x, f.constant(0)), f.negative(x), x)


def _best(operation: str, f: Values, first: Value, /, *given: Value) -> Value:
    """The result of max or min: the first argument that is not exceeded by another one."""
    best, *others = (first, *given) if given else f.parts(first) or [Value(NONE)]
    for other in others:
        type_ = joined(best.type, other.type)
        if type_ not in (BOOL, INT, FLOAT):
            f.refuse(f"the largest of {best.type} and {other.type}", "Give numbers")
        best, other = f.cast(best, type_), f.cast(other, type_)
        best = f.either(f.compare(operation, other, best), other, best)
    return best


def _is_finite(f: Values, x: Value, /) -> Value:
    size = f.outside(REAL, "llvm.fabs.f64", f.cast(x, FLOAT).register)
    return Value(BOOL, f.op("fcmp one", size, math.inf))


def _is_nan(f: Values, x: Value, /) -> Value:
    return Value(BOOL, f.op(f"fcmp{f.flags} uno", *[f.cast(x, FLOAT).register] * 2))


def _frexp(f: Values, x: Value, /) -> Value:
    place = f.slot("i32")
    mantissa = f.outside(REAL, "frexp", f.cast(x, FLOAT).register, place)
    exponent = f.converted(f.load("i32", place), WHOLE)
    return f.tuple_of(tuple, [Value(FLOAT, mantissa), Value(INT, exponent)])


def _ldexp(f: Values, x: Value, n: Value, /) -> Value:
    # The exponent must fit into 32 bits; beyond ±9999 the result is 0 or infinite in any case.
    limited = f.outside(WHOLE, "llvm.smin.i64", f.cast(n, INT).register, 9999)
    limited = f.converted(f.outside(WHOLE, "llvm.smax.i64", limited, -9999), "i32")
    return Value(FLOAT, f.outside(REAL, "ldexp", f.cast(x, FLOAT).register, limited))


def _row_of(f: Values, value: Value, i: Value, /) -> Value:
    if isinstance(value.type, TupleType):
        return f.tuple_of(value.type.kind, [_row_of(f, part, i) for part in f.parts(value)])
    return f.element(value, [f.cast(i, INT)]) if isinstance(value.type, ArrayType) else value


def _call_address(f: Values, address: Value, x: Value, /) -> Value:
    place = f.new(POINTER, f"inttoptr {f.cast(address, INT).register.typed} to ptr")
    return Value(FLOAT, f.call(REAL, str(place), f.cast(x, FLOAT).register))


def _complex_exp(f: Values, z: Value, /) -> Value:
    return f.runtime("complex_exp", f.cast(z, COMPLEX))


CALLS: dict[Any, Callable[..., Value]] = {
    **{
        function: partial(_real_of_two if function in _OF_TWO else _real, name)
        for function, name in REAL_FUNCTIONS.items()
    },
    fma: partial(_real_of_three, REAL_FUNCTIONS[fma]),
    math.floor: partial(_rounded, "llvm.floor.f64"),
    math.ceil: partial(_rounded, "llvm.ceil.f64"),
    **{kind: partial(_as, NAMED[kind]) for kind in (int, float, bool)},
    complex: _complex,
    len: _len,
    **dict.fromkeys((abs, np.abs), _abs),
    max: partial(_best, "Gt"),
    min: partial(_best, "Lt"),
    **dict.fromkeys((math.isfinite, np.isfinite), _is_finite),
    **dict.fromkeys((math.isnan, np.isnan), _is_nan),
    math.frexp: _frexp,
    math.ldexp: _ldexp,
    cmath.exp: _complex_exp,
    row_of: _row_of,
    call_address: _call_address,
}
"""Translators of calls, by function."""


# -- operations without an instruction of LLVM, in the language itself -----------------------------

NAN = math.nan


@compiled()
def complex_div(a: complex, b: complex) -> complex:
    """a/b by Smith's algorithm, which avoids overflow of |b|²; NaN if b is 0 or NaN."""
    if abs(b.real) >= abs(b.imag):
        ratio = b.imag / b.real
        denom = b.real + b.imag * ratio
        return complex((a.real + a.imag * ratio) / denom, (a.imag - a.real * ratio) / denom)
    if abs(b.imag) >= abs(b.real):
        ratio = b.real / b.imag
        denom = b.real * ratio + b.imag
        return complex((a.real * ratio + a.imag) / denom, (a.imag * ratio - a.real) / denom)
    return complex(NAN, NAN)


@compiled()
def complex_exp(z: complex) -> complex:
    """exp(z), for infinite and undefined parts as in C (annex G)."""
    x = z.real
    y = z.imag
    if math.isfinite(y) and x < math.inf:
        r = math.exp(x)
        return complex(r * math.cos(y), r * math.sin(y))
    if math.isfinite(x):
        return complex(NAN, NAN)
    if x != x:
        return complex(x, x if y != 0.0 else y)
    if x < 0.0:
        return complex(0.0, 0.0)
    if not math.isfinite(y):
        return complex(x, NAN)
    c = math.cos(y)
    s = math.sin(y)
    return complex(c * x if c != 0.0 else c, s * x if s != 0.0 else s)


@compiled()
def power_whole(a: float, b: int) -> float:
    """aᵇ by repeated squaring; by ``math.pow`` for large exponents."""
    r = 1.0
    left = abs(b)
    if left > 0x10000 or left < 0:  # the smallest integer has no negative
        return math.pow(a, float(b))
    while left != 0:
        if left & 1 != 0:
            r *= a
        left = left >> 1
        a *= a
    return 1.0 / r if b < 0 else r


@compiled()
def real_mod(a: float, b: float) -> float:
    """The remainder a % b, with the sign of b as in Python; NaN if b is 0."""
    if b == 0.0:
        return NAN
    m = math.fmod(a, b)
    if m != 0.0:
        return m + b if (b < 0.0) != (m < 0.0) else m
    return math.copysign(0.0, b)


@compiled()
def real_floordiv(a: float, b: float) -> float:
    """The quotient a // b, rounded as in Python; NaN if b is 0."""
    if b == 0.0:
        return NAN
    m = math.fmod(a, b)
    div = (a - m) / b
    if m != 0.0 and (b < 0.0) != (m < 0.0):
        div -= 1.0
    if div != 0.0:
        f = np.floor(div)
        return f + 1.0 if div - f > 0.5 else f
    return math.copysign(0.0, a / b)
