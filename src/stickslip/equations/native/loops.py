"""What is not written out: sums over orders, sums over rows, and the inverse of a matrix, as
functions with loops."""

from __future__ import annotations

from collections.abc import Callable

from stickslip.equations.codegen.series import LEAST_PIVOT
from stickslip.equations.native.assembly import REAL, WHOLE, Assembly, Operand


def _sum(f: Assembly, low: str | int, high: str, term: Callable[[str], tuple[str, str]]) -> None:
    """A sum of products as the result of a function."""

    def step(j: str, s: str) -> list[Operand]:
        return [f.fused(*term(j), s)]

    (s,) = f.loop(low, high, step, (REAL, 0.0))
    f.lines.append(f"ret double {s}")


def _convolution(name: str, more: str, weight: Callable[[Assembly, str], Operand]) -> Assembly:
    """Σ w(j) a[j] b[k − j] for low ≤ j < high."""
    arguments = f"ptr %a, ptr %b, i64 %k, i64 %low, i64 %high{more}"
    f = Assembly(name, arguments, REAL, inside=True)

    def term(j: str) -> tuple[str, str]:
        a = f.load(f.at("%a", j))
        return str(f.times(weight(f, j), a)), f.load(f.at("%b", f.whole("sub", "%k", j)))

    _sum(f, "%low", "%high", term)
    return f


def _cauchy() -> Assembly:
    return _convolution("cauchy", "", lambda f, j: 1.0)


def _chained() -> Assembly:
    return _convolution("chained", "", lambda f, j: f.new(f"sitofp i64 {j} to double"))


def _powered() -> Assembly:
    def weight(f: Assembly, j: str) -> Operand:
        left = f.whole("sub", j, "%k")
        j, left = (f.new(f"sitofp i64 {x} to double") for x in (j, left))
        return f.fused(j, "%p", left)

    return _convolution("powered", ", double %p", weight)


def _applied() -> Assembly:
    """Σ R[j] W[j]: one row of a solution; W in a column, a stride apart."""
    f = Assembly("applied", "ptr %R, ptr %W, i64 %stride, i64 %n", REAL, inside=True)

    def term(j: str) -> tuple[str, str]:
        return f.load(f.at("%R", j)), f.load(f.at("%W", f.whole("mul", j, "%stride")))

    _sum(f, 0, "%n", term)
    return f


def _spread() -> Assembly:
    """Σ |R[j]| mag[j]."""
    f = Assembly("spread", "ptr %R, ptr %mag, i64 %n", REAL, inside=True)

    def term(j: str) -> tuple[str, str]:
        return f.call("llvm.fabs.f64", f.load(f.at("%R", j))), f.load(f.at("%mag", j))

    _sum(f, 0, "%n", term)
    return f


def _balance() -> Assembly:
    """A power of two near the reciprocal of the largest modulus of n numbers, a stride apart; 0 if
    there is none."""
    f = Assembly("balance", "ptr %A, i64 %stride, i64 %n", REAL, inside=True)

    def step(j: str, largest: str) -> list[Operand]:
        x = f.call("llvm.fabs.f64", f.load(f.at("%A", f.whole("mul", j, "%stride"))))
        return [f.choose(f.test("ogt", x, largest), x, largest)]

    (largest,) = f.loop(0, "%n", step, (REAL, 0.0))
    exponent = f.call("ilogb", largest, to="i32")
    turned = f.new(f"sub i32 -1, {exponent}")
    power = f.new(f"call double @ldexp(double 1.0, i32 {turned})")
    there = f.both(f.test("ogt", largest, 0.0), f.test("olt", largest, float("inf")))
    f.lines.append(f"ret double {f.choose(there, power, 0.0)}")
    return f


def _invert() -> Assembly:
    """Inverse R of the leading n×n block of A (destroyed, with the row below) by Gauss-Jordan
    elimination; 0 if it is singular. Rows are `a` and `r` numbers apart.

    The same steps as :func:`stickslip.equations.codegen.series.invert`.
    """
    f = Assembly("invert", "ptr %A, i64 %a, i64 %n, ptr %R, i64 %r", WHOLE, inside=True)

    def entry(name: str, i: str, j: str) -> str:
        return f.at(name, f.whole("add", f.whole("mul", i, _APART[name]), j))

    def over_columns(change: Callable[[str], None], high: str = "%n") -> None:
        f.loop(0, high, change)

    def by(address: str, factor: Operand) -> None:
        f.store(f.times(f.load(address), factor), address)

    def scale_row(i: str) -> None:
        factor = f.new(f"call double @balance(ptr {entry('%A', i, '0')}, i64 1, i64 %n)")
        f.leave(f.test("oeq", factor, 0.0), 0)

        def change(j: str) -> None:
            by(entry("%A", i, j), factor)
            f.store(f.choose(f.whole("icmp eq", i, j), factor, 0.0), entry("%R", i, j))

        over_columns(change)

    def scale_column(j: str) -> None:
        factor = f.new(f"call double @balance(ptr {entry('%A', '0', j)}, i64 %a, i64 %n)")
        f.leave(f.test("oeq", factor, 0.0), 0)
        f.store(factor, entry("%A", "%n", j))
        over_columns(lambda i: by(entry("%A", i, j), factor))

    def eliminate(c: str) -> None:
        def larger(i: str, pivot: str, size: str) -> list[Operand]:
            x = f.call("llvm.fabs.f64", f.load(entry("%A", i, c)))
            test = f.test("ogt", x, size)
            return [
                f.new(f"select i1 {test}, i64 {i}, i64 {pivot}"),
                f.choose(test, x, size),
            ]

        size = f.call("llvm.fabs.f64", f.load(entry("%A", c, c)))
        pivot, size = f.loop(f.whole("add", c, 1), "%n", larger, (WHOLE, c), (REAL, size))
        f.leave(f.new(f"xor i1 {f.test('ogt', size, LEAST_PIVOT)}, true"), 0)

        def swap(j: str) -> None:
            for name in ("%A", "%R"):
                here, there = entry(name, c, j), entry(name, pivot, j)
                x, y = f.load(here), f.load(there)
                f.store(y, here)
                f.store(x, there)

        over_columns(swap)
        inverse = f.over(1.0, f.load(entry("%A", c, c)))
        over_columns(lambda j: by(entry("%A", c, j), inverse))
        over_columns(lambda j: by(entry("%R", c, j), inverse))

        def clear(i: str) -> None:
            factor = f.load(entry("%A", i, c))
            other = f.both(f.whole("icmp ne", i, c), f.test("une", factor, 0.0))
            high = f.new(f"select i1 {other}, i64 %n, i64 0")
            minus = f.negative(factor)

            def change(j: str) -> None:
                for name in ("%A", "%R"):
                    place = entry(name, i, j)
                    f.store(f.fused(minus, f.load(entry(name, c, j)), f.load(place)), place)

            over_columns(change, high)

        over_columns(clear)

    def scale_back(i: str) -> None:
        over_columns(lambda j: by(entry("%R", i, j), f.load(entry("%A", "%n", i))))

    for each in (scale_row, scale_column, eliminate, scale_back):
        over_columns(each)
    f.lines.append("ret i64 1")
    return f


def _definite() -> Assembly:
    """Whether the leading n×n block of a symmetric A is positive definite: the pivots of
    elimination, in R, are positive and no rounding errors."""
    f = Assembly("definite", "ptr %A, i64 %a, i64 %n, ptr %R, i64 %r", WHOLE, inside=True)

    def entry(name: str, i: str, j: str) -> str:
        return f.at(name, f.whole("add", f.whole("mul", i, _APART[name]), j))

    def copy(i: str) -> None:
        f.loop(0, "%n", lambda j: f.store(f.load(entry("%A", i, j)), entry("%R", i, j)))

    def eliminate(c: str) -> None:
        pivot = f.load(entry("%R", c, c))
        least = f.times(LEAST_PIVOT, f.call("llvm.fabs.f64", f.load(entry("%A", c, c))))
        f.leave(f.new(f"xor i1 {f.test('ogt', pivot, least)}, true"), 0)

        def clear(i: str) -> None:
            minus = f.negative(f.over(f.load(entry("%R", i, c)), pivot))

            def change(j: str) -> None:
                place = entry("%R", i, j)
                f.store(f.fused(minus, f.load(entry("%R", c, j)), f.load(place)), place)

            f.loop(c, "%n", change)

        f.loop(f.whole("add", c, 1), "%n", clear)

    f.loop(0, "%n", copy)
    f.loop(0, "%n", eliminate)
    f.lines.append("ret i64 1")
    return f


_APART = {"%A": "%a", "%R": "%r"}
"""From a row to the next, in numbers."""

LOOPS = {
    "definite": _definite().text(),
    "cauchy": _cauchy().text(),
    "chained": _chained().text(),
    "powered": _powered().text(),
    "applied": _applied().text(),
    "spread": _spread().text(),
    "invert": _invert().text() + "\n" + _balance().text(),
}
"""Their assembly by name."""
