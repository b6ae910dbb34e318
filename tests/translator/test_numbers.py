"""Arithmetic of numbers: every operator and function, on edges and at random."""

from __future__ import annotations

import cmath
import math
import random
import re
import sys
from itertools import product
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from stickslip.translator import fma
from stickslip.translator.calls import REAL_FUNCTIONS

from .judging import bits, module_of

INF, NAN, LEAST, MOST = math.inf, math.nan, -(2**63), 2**63 - 1
RNG = random.Random(1)
WHOLES = [0, 1, -1, 2, -2, 3, -7, 10, 64, -64, 2**31, MOST - 1, MOST, LEAST, LEAST + 1]
WHOLES += [RNG.randrange(LEAST, MOST) for _ in range(4)]
REALS = [0.0, -0.0, 1.0, -1.0, 0.5, 2.0, -2.5, 3.0, 7.25, -0.1, 1e-320, -5e-324, 1e16, 1e308]
REALS += [-1e308, INF, -INF, NAN, *(RNG.gauss(0, 10) for _ in range(5))]
PARTS = [0.0, -0.0, 1.0, -2.5, 1e-320, -1e-160, 1e160, -1e308, INF, -INF, NAN]
MODERATE = [-3.5, -1.0, -0.25, 0.5, 1.0, 2.75, *(RNG.gauss(0, 2) for _ in range(4))]
OF_TWO = (math.atan2, math.hypot, math.fmod, math.copysign, math.pow, np.power)
FUNCTIONS = [
    f"{'np' if isinstance(f, np.ufunc) else 'math'}.{f.__name__}(a{', b' * (f in OF_TWO)})"
    for f in REAL_FUNCTIONS
    if f is not fma
]
# Parameters and result of entries, and what they compute.
TABLES: dict[str, tuple[str, str, str]] = {
    "whole": (
        "a: int, b: int",
        "int",
        """a + b; a - b; a * b; a // b; a % b; a & b; a | b; a ^ b; -a; +a; -(-a); abs(a); min(a, b)
        max(a, b); min(b, a, 3); max((a, b, -5)); a // 3; a // -3; a // -1; a % 8; a % -8; 7 // b
        -7 % b; a // 0; a % 0; a * a * b; (a < b) + (a != b); (a >= b) * a; -(a == b); +(a <= b)
        a & 255 | b << 3; a if a < b else b; a >> 1 ^ b; int(a > 0) - (b <= 0); True + True + a
        a * 9223372036854775807; a & 0xFFFFFFFFFFFFFFFF; int(a); (a > 0) | b; -True + b""",
    ),
    "shift": ("a: int, b: int", "int", "a << b; a >> b; 1 << b; -1 >> b; (a > 0) << b"),
    "order": (
        "a: int, b: int",
        "bool",
        """a < b; a <= b; a > b; a >= b; a == b; a != b; bool(a); not a; a < b < 7; 0 != a >= b
        a in (b, 2, -1); a not in (b, 0); a in (); (a < 0) == (b < 0); (a < 0) < (b < 0)
        (a > 1) & (b > 1); (a > 1) ^ (b > 1)""",
    ),
    "test": (
        "a: float, b: float",
        "bool",
        """a < b; a <= b; a > b; a >= b; a == b; a != b; not a < b; not a <= b; not a > b
        not a >= b; not a == b; not a != b
        bool(a); not a; a < b < 1.0; a == b != 0; -1 < a <= b; a > 1
        a in (-b, 1.0, -2.5); math.isfinite(a * b); math.isnan(a + b); np.isfinite(a); np.isnan(b)
        a < b or a > b; a < b and b < 3 or not a > 0.0; (a < b) == (b < a)""",
    ),
    "relaxed": ("a: float, b: float", "bool", "math.isfinite(a + b); math.isnan(a - b)"),
    "real": (
        "a: float, b: float",
        "float",
        """a + b; a - b; a * b; a / b; a // b; a % b; -a; +a; abs(a); min(a, b); max(a, b); a - -b
        min(b, a, 0.0); max(-0.0, a, b); math.fabs(a); math.copysign(a, b); math.copysign(1, b)
        np.floor(a); np.ceil(a); a if a < b else b; b if not a <= b else a; float(a > b); a + 3
        2 * b; b / 3; 1 / a; 7 // b; a % 3; a + (b > 0.0); math.frexp(a)[0]; float(a); np.abs(a)
        a + 1.5 * 2.0 - 0.5; (a > b) / 2; True / 3; math.pi * a; a ** 0; a ** 1; a ** 2
        max(-3.0, min(a, 3.0)) % max(b, 0.5); math.fmod(-0.0, max(b, 0.5)); 0.0 % max(b, 2)""",
    ),
    "mixed": (
        "a: int, b: float",
        "float",
        """a + b; a * b; b - a; a / 3; 1 / a; a / b; a // b; b % a; float(a); min(a, b); max(b, a)
        math.sqrt(a); math.ldexp(b, a); (a > 2) * b; -a * b; a if b > 1.0 else b; a / (b > 1)""",
    ),
    "to_whole": (
        "a: float",
        "int",
        "int(a); math.floor(a); math.ceil(a); math.frexp(a)[1]; int(-a); int(a > 0)",
    ),
    "power": (
        "a: float, n: int",
        "float",
        "; ".join([*(f"a ** {n}" for n in range(-3, 13)), "a ** n", "(-a) ** (n + 1)", "a ** -n"]),
    ),
    "function": (
        "a: float, b: float, c: float",
        "float",
        "; ".join(["fma(a, b, c); fma(a, a, -b); a ** b; 2.0 ** a; abs(a) ** 1.5", *FUNCTIONS]),
    ),
    "complexes": (
        "a: float, b: float, c: float, d: float, out: ComplexVector",
        "None",
        """z + w; z - w; z * w; z / w; -z; +z; z.conjugate(); complex(b, a); z.real - w.imag; abs(z)
        z * (1 + 2j); 1j - z; 0.5j * w; complex(z); z if a < b else w; z == w; z != w; z == z
        cmath.exp(z); complex(a); z + 0j; z / (2 - 1j)""",
    ),
    "with_reals": (
        "a: float, b: float, c: float, d: float, out: ComplexVector",
        "None",
        "a * z; z - b; 3 + z; z / c; b / w; z * 2; (a > b) * z; z == a; a != z; 1 / z; n - w",
    ),
}


def texts(table: str) -> list[str]:
    """The expressions of a table."""
    return re.split(r";\s*|\n\s*", TABLES[table][2])


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    """An entry for each table, which is told the number of the expression."""
    lines = list[str]()
    for table, (given, result, _) in TABLES.items():
        relaxed = "relaxed=('contract', 'nsz', 'reassoc')" * (table == "relaxed")
        lines += [f"@entry_point({relaxed})", f"def {table}(k: int, {given}) -> {result}:"]
        if result == "None":
            lines += ["    n, z, w = 3, complex(a, b), complex(c, d)"]
        for k, text in enumerate(texts(table)):
            place = "out[0] =" if result == "None" else "return"
            lines += [f"    if k == {k}:", f"        {place} {text}"]
        lines += [f"    return {result}(0)"] * (result != "None")
    return module_of("\n".join(lines), tmp_path_factory.mktemp("numbers"))


def cases(*tables: str) -> Any:
    """The expressions of some tables, and their numbers."""
    every = [(table, k, text) for table in tables for k, text in enumerate(texts(table))]
    names = [f"{table}: {text}" for table, _, text in every]
    return pytest.mark.parametrize(("table", "k", "text"), every, ids=names)


def of_python(text: str, **given: Any) -> Any:
    """What Python makes of an expression."""
    return eval(text, {"math": math, "np": np, "cmath": cmath, "fma": fma}, given)


def wrapped(n: int) -> int:
    """A whole number in 64 bits."""
    return (n + 2**63) % 2**64 - 2**63


@cases("whole", "shift")
def test_whole_numbers(made: ModuleType, table: str, k: int, text: str) -> None:
    """In 64 bits; a quotient by zero is zero."""
    places = [0, 1, 2, 31, 32, 62, 63, 64, 65, 200]
    for a, b in product(WHOLES, places if table == "shift" else WHOLES):
        try:
            wanted = wrapped(of_python(text, a=a, b=b))
        except ZeroDivisionError:
            wanted = 0
        assert getattr(made, table)(k, a, b) == wanted, (a, b)


@cases("order", "test", "relaxed")
def test_comparisons(made: ModuleType, table: str, k: int, text: str) -> None:
    """What is not a number stays visible where sums may be reordered."""
    numbers = WHOLES if table == "order" else REALS
    for a, b in product(numbers, numbers):
        assert getattr(made, table)(k, a, b) is bool(of_python(text, a=a, b=b)), (a, b)


@cases("real", "mixed")
def test_real_numbers(made: ModuleType, table: str, k: int, text: str) -> None:
    """A quotient by zero is what C has for it, and a rest NaN; whole numbers are real ones, too."""
    wholes = [0, 1, -1, 3, -8, 2000, -(2**33), 2**53]
    for a, b in product(wholes if table == "mixed" else REALS, REALS):
        found = getattr(made, table)(k, a, b)
        with np.errstate(all="ignore"):
            try:
                wanted = of_python(text, a=a, b=b)
            except ZeroDivisionError:
                divided = "//" not in text and "%" not in text
                wanted = of_python(text, a=np.float64(a), b=np.float64(b)) if divided else NAN
            except (OverflowError, ValueError):
                assert not math.isfinite(found), (a, b)
                continue
        assert bits(found) == bits(float(wanted)), (a, b)


@cases("to_whole")
def test_real_numbers_become_whole(made: ModuleType, table: str, k: int, text: str) -> None:
    """The nearest there is; zero for what is not a number."""
    for a in [*REALS, 2.0**62, -(2.0**63), 2.0**63, 1e300, 0.999999, -1.5, 4503599627370497.5]:
        try:
            wanted = min(max(of_python(text, a=a), LEAST), MOST)
        except OverflowError:
            wanted = MOST if (a > 0) is ("-" not in text) else LEAST
        except ValueError:
            wanted = 0
        assert getattr(made, table)(k, a) == wanted, a


@cases("power")
def test_powers_are_products(made: ModuleType, table: str, k: int, text: str) -> None:
    """So each factor may cost half a unit in the last place."""
    wholes = [*range(-12, 13), 40, -33, 70_001] if "n" in text else [0]
    for a, n in product([x for x in REALS if not 0 < abs(x) < 1e-9], wholes):
        found = getattr(made, table)(k, a, n)
        with np.errstate(all="ignore"):
            wanted = float(of_python(text, a=np.float64(a), n=n))
        close = 1e-300 < abs(wanted) < INF and math.isclose(found, wanted, rel_tol=40 * 2**-53)
        tiny = 0.0 < abs(wanted) < 1e-300 and abs(found) < 1e-300
        assert bits(found) == bits(wanted) or close or tiny, (a, n, found, wanted)


def test_a_power_of_least_exponent(made: ModuleType) -> None:
    """Its opposite is not a whole number of 64 bits."""
    k = texts("power").index("a ** n")
    assert [made.power(k, a, LEAST) for a in (2.0, -0.5, 1.0)] == [0.0, INF, 1.0]


@cases("function")
def test_functions(made: ModuleType, table: str, k: int, text: str) -> None:
    """The same library of C; Python has a hypot of its own. Where Python raises an error there is
    an infinity or NaN."""
    for a, b in product([*REALS, 0.25, -0.75, 20.0, 710.0], REALS if "b" in text else [1.0]):
        for c in (0.0, -1.5, 1e300) if "fma" in text else (0.0,):
            found = getattr(made, table)(k, a, b, c)
            try:
                # NumPy's power takes a root of −0 that C's does not take
                with np.errstate(all="ignore"):
                    wanted = of_python(text.replace("np.power", "math.pow"), a=a, b=b, c=c)
            except (ArithmeticError, ValueError):
                assert not math.isfinite(found), (a, b, c)
                continue
            wanted = NAN if isinstance(wanted, complex) else float(wanted)
            close = "hypot" in text and abs(found - wanted) <= math.ulp(wanted)
            assert bits(found) == bits(wanted) or close, (a, b, c, found, wanted)


@cases("complexes", "with_reals")
def test_complex_numbers(made: ModuleType, table: str, k: int, text: str) -> None:
    """Of moderate size with real ones: since 3.14 Python leaves out products with the part that is
    missing, and recovers infinities."""
    parts = MODERATE if table == "with_reals" else PARTS
    parts = [*parts, 0.3, -20.0, 708.0] if "exp" in text else parts
    out = np.zeros(1, complex)
    for a, b, c, d in product(
        parts, parts, *([parts] * 2 if re.search("[cdw]", text) else [[1.0]] * 2)
    ):
        getattr(made, table)(k, a, b, c, d, out)
        found = complex(out[0])
        try:
            wanted = complex(of_python(text, a=a, b=b, c=c, n=3, z=complex(a, b), w=complex(c, d)))
        except (ArithmeticError, ValueError):
            assert not cmath.isfinite(found), (a, b, c, d)
            continue
        recovered = sys.version_info >= (3, 14) and cmath.isnan(found)
        assert bits(found) == bits(wanted) or recovered, (a, b, c, d, found, wanted)
