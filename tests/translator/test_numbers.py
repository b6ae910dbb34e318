"""Arithmetic of numbers: every operator and function, on edges and at random."""

from __future__ import annotations

import cmath
import math
import random
import sys
from itertools import product
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from stickslip.translator import fma
from stickslip.translator.functions import REAL_FUNCTIONS

from .judging import bits, module_of

INF, NAN, LEAST, MOST = math.inf, math.nan, -(2**63), 2**63 - 1
RNG = random.Random(1)
WHOLES = [0, 1, -1, 2, -2, 3, -7, 10, 64, -64, 2**31, MOST - 1, MOST, LEAST, LEAST + 1]
WHOLES += [RNG.randrange(LEAST, MOST) for _ in range(4)]
REALS = [0.0, -0.0, 1.0, -1.0, 0.5, 2.0, -2.5, 3.0, 7.25, -0.1, 1e-320, -5e-324, 1e16, 1e308, -1e308]
REALS += [INF, -INF, NAN, *(RNG.gauss(0, 10) for _ in range(5))]
PARTS = [0.0, -0.0, 1.0, -2.5, 1e-320, -1e-160, 1e160, -1e308, INF, -INF, NAN]
MODERATE = [-3.5, -1.0, -0.25, 0.5, 1.0, 2.75, *(RNG.gauss(0, 2) for _ in range(4))]
TABLES: dict[str, tuple[str, str, list[str]]] = {
    "whole": (
        "a: int, b: int",
        "int",
        [f"a {sign} b" for sign in ("+", "-", "*", "//", "%", "&", "|", "^")]
        + "-a; +a; -(-a); abs(a); min(a, b); max(a, b); min(b, a, 3); max((a, b, -5)); a // 3".split("; ")
        + "a // -3; a // -1; a % 8; a % -8; 7 // b; -7 % b; a // 0; a % 0; a * a * b".split("; ")
        + "(a < b) + (a != b); (a >= b) * a; -(a == b); +(a <= b); a & 255 | b << 3".split("; ")
        + "a if a < b else b; a >> 1 ^ b; int(a > 0) - (b <= 0); a * 9223372036854775807".split("; ")
        + "a & 0xFFFFFFFFFFFFFFFF; int(a); (a > 0) | b; True + True + a; -True + b".split("; "),
    ),
    "shift": ("a: int, b: int", "int", ["a << b", "a >> b", "1 << b", "-1 >> b", "(a > 0) << b"]),
    "order": (
        "a: int, b: int",
        "bool",
        [f"a {sign} b" for sign in ("<", "<=", ">", ">=", "==", "!=")]
        + "bool(a); not a; a < b < 7; 0 != a >= b; a in (b, 2, -1); a not in (b, 0); a in ()".split("; ")
        + "(a < 0) == (b < 0); (a < 0) < (b < 0); (a > 1) & (b > 1); (a > 1) ^ (b > 1)".split("; "),
    ),
    "real": (
        "a: float, b: float",
        "float",
        [f"a {sign} b" for sign in ("+", "-", "*", "/", "//", "%")]
        + "-a; +a; abs(a); min(a, b); max(a, b); min(b, a, 0.0); max(-0.0, a, b); a - -b".split("; ")
        + "math.fabs(a); math.copysign(a, b); math.copysign(1, b); np.floor(a); np.ceil(a)".split("; ")
        + "a if a < b else b; b if not a <= b else a; float(a > b); a + 3; 2 * b; b / 3".split("; ")
        + "1 / a; 7 // b; a % 3; a + (b > 0.0); math.frexp(a)[0]; float(a); np.abs(a)".split("; ")
        + "a + 1.5 * 2.0 - 0.5; (a > b) / 2; True / 3; math.pi * a; a ** 0; a ** 1; a ** 2".split("; "),
    ),
    "mixed": (
        "a: int, b: float",
        "float",
        "a + b; a * b; b - a; a / 3; 1 / a; a / b; a // b; b % a; float(a); min(a, b); max(b, a)".split("; ")
        + "math.sqrt(a); math.ldexp(b, a); (a > 2) * b; -a * b; a if b > 1.0 else b; a / (b > 1)".split("; "),
    ),
    "test": (
        "a: float, b: float",
        "bool",
        [f"a {sign} b" for sign in ("<", "<=", ">", ">=", "==", "!=")]
        + [f"not a {sign} b" for sign in ("<", "<=", ">", ">=", "==", "!=")]
        + "bool(a); not a; a < b < 1.0; a == b != 0; -1 < a <= b; a in (-b, 1.0, -2.5)".split("; ")
        + "math.isfinite(a * b); math.isnan(a + b); np.isfinite(a); np.isnan(b); a > 1".split("; ")
        + "a < b or a > b; a < b and b < 3 or not a > 0.0; (a < b) == (b < a)".split("; "),
    ),
    "to_whole": (
        "a: float",
        "int",
        "int(a); math.floor(a); math.ceil(a); math.frexp(a)[1]; int(-a); int(a > 0)".split("; "),
    ),
    "power": (
        "a: float, n: int",
        "float",
        [f"a ** {n}" for n in range(-3, 13)] + ["a ** n", "(-a) ** (n + 1)", "a ** -n"],
    ),
    "relaxed": ("a: float, b: float", "bool", ["math.isfinite(a + b)", "math.isnan(a - b)"]),
    "function": (
        "a: float, b: float, c: float",
        "float",
        ["fma(a, b, c)", "fma(a, a, -b)"]
        + [
            f"{'np' if isinstance(f, np.ufunc) else 'math'}.{f.__name__}(a{', b' * (f in OF_TWO)})"
            for OF_TWO in [(math.atan2, math.hypot, math.fmod, math.copysign, math.pow, np.power)]
            for f in REAL_FUNCTIONS
            if f is not fma
        ]
        + ["a ** b", "2.0 ** a", "a ** 0.5", "abs(a) ** 1.5"],
    ),
    "complex": (
        "a: float, b: float, c: float, d: float, out: ComplexVector",
        "None",
        "z + w; z - w; z * w; z / w; -z; +z; z.conjugate(); complex(b, a); z.real - w.imag".split("; ")
        + "abs(z); z * (1 + 2j); 1j - z; 0.5j * w; complex(z); z if a < b else w; z == w".split("; ")
        + "z != w; z == z; cmath.exp(z); complex(a); z + 0j; z / (2 - 1j)".split("; "),
    ),
    "with_complex": (
        "a: float, b: float, c: float, d: float, out: ComplexVector",
        "None",
        "a * z; z - b; 3 + z; z / c; b / w; z * 2; (a > b) * z; z == a; a != z; 1 / z; n - w".split("; "),
    ),
}


def source() -> str:
    """An entry for each expression."""
    lines = list[str]()
    for table, (given, result, texts) in TABLES.items():
        for k, text in enumerate(texts):
            relaxed = "relaxed=('contract', 'nsz', 'reassoc')" * (table == "relaxed")
            lines += [f"@entry_point({relaxed})", f"def {table}_{k}({given}) -> {result}:"]
            if result == "None":
                lines += ["    n, z, w = 3, complex(a, b), complex(c, d)", f"    out[0] = {text}"]
            else:
                lines += [f"    return {text}"]
    return "\n".join(lines)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    """All of them, compiled together."""
    return module_of(source(), tmp_path_factory.mktemp("numbers"))


def cases(table: str) -> Any:
    """The expressions of a table and their names."""
    texts = TABLES[table][2]
    return pytest.mark.parametrize(
        ("name", "text"), [pytest.param(f"{table}_{k}", text, id=text) for k, text in enumerate(texts)]
    )


def of_python(text: str, **given: Any) -> Any:
    """What Python makes of an expression."""
    return eval(text, {"math": math, "np": np, "cmath": cmath, "fma": fma}, given)


def wrapped(n: int) -> int:
    """A whole number in 64 bits."""
    return (n + 2**63) % 2**64 - 2**63


@cases("whole")
def test_whole_numbers(made: ModuleType, name: str, text: str) -> None:
    for a, b in product(WHOLES, WHOLES):
        try:
            wanted = wrapped(of_python(text, a=a, b=b))
        except ZeroDivisionError:
            wanted = 0
        assert getattr(made, name)(a, b) == wanted, (a, b)


@cases("shift")
def test_shifts(made: ModuleType, name: str, text: str) -> None:
    for a, b in product(WHOLES, [*range(5), 31, 32, 62, 63, 64, 65, 200]):
        assert getattr(made, name)(a, b) == wrapped(of_python(text, a=a, b=b)), (a, b)


@cases("order")
def test_order_of_whole_numbers(made: ModuleType, name: str, text: str) -> None:
    for a, b in product(WHOLES, WHOLES):
        assert getattr(made, name)(a, b) is of_python(text, a=a, b=b), (a, b)


@cases("test")
def test_order_of_real_numbers(made: ModuleType, name: str, text: str) -> None:
    for a, b in product(REALS, REALS):
        assert getattr(made, name)(a, b) is bool(of_python(text, a=a, b=b)), (a, b)


@cases("relaxed")
def test_what_is_not_a_number_stays_visible(made: ModuleType, name: str, text: str) -> None:
    """Also where sums may be reordered."""
    for a, b in product(REALS, REALS):
        assert getattr(made, name)(a, b) is of_python(text, a=a, b=b), (a, b)


def without_number(a: Any, b: Any) -> float:
    """What C has for a quotient by zero."""
    with np.errstate(all="ignore"):
        return float(np.float64(a) / np.float64(b))


@cases("real")
def test_real_numbers(made: ModuleType, name: str, text: str) -> None:
    for a, b in product(REALS, REALS):
        try:
            with np.errstate(all="ignore"):
                wanted = of_python(text, a=a, b=b)
        except ZeroDivisionError:
            wanted = without_number(1 if text == "1 / a" else a, a if text == "1 / a" else b)
            wanted = wanted if "/ " in text and "//" not in text else NAN
        except OverflowError:
            wanted = INF
        assert bits(getattr(made, name)(a, b)) == bits(float(wanted)), (a, b)


@cases("mixed")
def test_whole_numbers_with_real_ones(made: ModuleType, name: str, text: str) -> None:
    """As long as the whole ones are real numbers, too."""
    for a, b in product([0, 1, -1, 3, -8, 2000, -(2**33), 2**53], REALS):
        try:
            wanted = float(of_python(text, a=a, b=b))
        except (ZeroDivisionError, OverflowError, ValueError):
            assert not math.isfinite(getattr(made, name)(a, b)), (a, b)
        else:
            assert bits(getattr(made, name)(a, b)) == bits(wanted), (a, b)


@cases("to_whole")
def test_real_numbers_become_whole(made: ModuleType, name: str, text: str) -> None:
    """The nearest there is; zero for what is no number."""
    for a in [*REALS, 2.0**62, -(2.0**63), 2.0**63, 1e300, 0.999999, -1.5, 4503599627370497.5]:
        try:
            wanted = min(max(of_python(text, a=a), LEAST), MOST)
        except OverflowError:
            wanted = MOST if (a > 0) is ("-" not in text) else LEAST
        except ValueError:
            wanted = 0
        assert getattr(made, name)(a) == wanted, a


@cases("power")
def test_powers_are_products(made: ModuleType, name: str, text: str) -> None:
    """So each factor may cost half a unit in the last place."""
    whole = [*range(-12, 13), 40, -33, 70_001] if "n" in text else [0]
    for a, n in product([x for x in REALS if not 0 < abs(x) < 1e-9], whole):
        found = getattr(made, name)(a, n)
        with np.errstate(all="ignore"):
            wanted = float(of_python(text, a=np.float64(a), n=n))
        close = 1e-300 < abs(wanted) < INF and math.isclose(found, wanted, rel_tol=40 * 2**-53)
        tiny = 0.0 < abs(wanted) < 1e-300 and abs(found) < 1e-300
        assert bits(found) == bits(wanted) or close or tiny, (a, n, found, wanted)


def test_a_power_of_least_exponent(made: ModuleType) -> None:
    """Its opposite is not a whole number of 64 bits."""
    assert made.power_16(2.0, LEAST) == 0.0
    assert made.power_16(-0.5, LEAST) == INF
    assert made.power_16(1.0, LEAST) == 1.0


@cases("function")
def test_functions(made: ModuleType, name: str, text: str) -> None:
    """The same library of C; Python has a hypot of its own. Where Python raises an error there is
    an infinity or NaN."""
    for a, b in product([*REALS, 0.25, -0.75, 20.0, 710.0], REALS if "b" in text else [1.0]):
        for c in (0.0, -1.5, 1e300) if "fma" in text else (0.0,):
            found = getattr(made, name)(a, b, c)
            try:
                with np.errstate(all="ignore"):
                    # NumPy's power takes a root of −0 that C's does not take
                    wanted = of_python(text.replace("np.power", "math.pow"), a=a, b=b, c=c)
            except (ArithmeticError, ValueError):
                assert not math.isfinite(found), (a, b, c)
                continue
            wanted = NAN if isinstance(wanted, complex) else float(wanted)
            close = math.isfinite(wanted) and abs(found - wanted) <= math.ulp(wanted)
            exact = "hypot" not in text
            assert bits(found) == bits(wanted) or (close and not exact), (a, b, c, found, wanted)


def complex_differences(made: ModuleType, name: str, text: str, parts: list[float]) -> list[Any]:
    """Where complex numbers are not Python's."""
    found, wrong = np.zeros(1, complex), list[Any]()
    for a, b, c, d in product(parts, parts, parts, parts):
        getattr(made, name)(a, b, c, d, found)
        try:
            wanted = complex(of_python(text, a=a, b=b, z=complex(a, b), w=complex(c, d), c=c, n=3))
        except ZeroDivisionError:
            wanted = complex(NAN, NAN)
        except OverflowError:
            wanted = complex(INF, 0.0)
            if "exp" in text:
                continue  # where one part is infinite, so may be the other
        except ValueError:
            wanted = complex(NAN, NAN) if "exp" in text else NAN
            if "exp" in text and not math.isfinite(found[0].real):
                continue
        if bits(complex(found[0])) != bits(wanted):
            # since 3.14 products of Python recover infinities
            if sys.version_info < (3, 14) or not cmath.isnan(found[0]):
                wrong.append((a, b, c, d, complex(found[0]), wanted))
    return wrong


@cases("complex")
def test_complex_numbers(made: ModuleType, name: str, text: str) -> None:
    parts = [*PARTS, 0.3, -20.0, 708.0] if "exp" in text else PARTS
    assert not complex_differences(made, name, text, parts)[:5]


@cases("with_complex")
def test_complex_numbers_with_real_ones(made: ModuleType, name: str, text: str) -> None:
    """Of moderate size: since 3.14 Python leaves out the products with the missing part."""
    assert not complex_differences(made, name, text, MODERATE)[:5]
