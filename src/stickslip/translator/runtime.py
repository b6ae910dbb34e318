"""What Python's operators mean where LLVM has no instruction for it, in the subset itself."""

from __future__ import annotations

import math

import numpy as np

from stickslip.translator import compiled

NAN = math.nan


@compiled()
def complex_div(a: complex, b: complex) -> complex:
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
    x = z.real
    y = z.imag
    if math.isfinite(x):
        if math.isfinite(y):
            c = math.cos(y)
            s = math.sin(y)
            r = math.exp(x)
            return complex(r * c, r * s)
        return complex(NAN, NAN)
    if x != x:
        return complex(x, x if y != 0.0 else y)
    if x > 0.0:
        if math.isfinite(y):
            re = math.cos(y)
            im = math.sin(y)
            if re != 0.0:
                re *= x
            if im != 0.0:
                im *= x
            return complex(re, im)
        return complex(x, NAN)
    if math.isfinite(y):
        r = math.exp(x)
        return complex(r * math.cos(y), r * math.sin(y))
    return complex(0.0, 0.0)


@compiled()
def power_whole(a: float, b: int) -> float:
    r = 1.0
    left = abs(b)
    if left > 0x10000 or left < 0:  # the least number has no opposite
        return math.pow(a, float(b))
    while left != 0:
        if left & 1 != 0:
            r *= a
        left = left >> 1
        a *= a
    return 1.0 / r if b < 0 else r


@compiled()
def real_mod(a: float, b: float) -> float:
    if b == 0.0:
        return NAN
    m = math.fmod(a, b)
    if m != 0.0:
        return m + b if (b < 0.0) != (m < 0.0) else m
    return math.copysign(0.0, b)


@compiled()
def real_floordiv(a: float, b: float) -> float:
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
