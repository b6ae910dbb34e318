"""Tabulated functions of one variable as machine code: piecewise polynomials, one piece for each
pair of rows.

What is written here knows the addresses of its tables, so it is made anew in every process, in some
milliseconds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from stickslip.machine_code.objects import (
    LOOPS,
    STRAIGHT,
    Code,
    Provider,
    emitted,
    find_functions,
    loaded,
    module_of,
    processor,
    provide,
)
from stickslip.translator.assembly import operand


def provide_table(
    names: Mapping[str, tuple[str, Sequence[float]]],
    breaks: Any,
    coefficients: Any,
    ends: Any,
    period: float,
    near: float,
    undefined: Mapping[str, tuple[float, float]],
) -> Provider:
    """Register named functions of tables, so that machine code can call them.

    Parameters
    ----------
    names : mapping of str to (str, sequence of float)
        By name: the side ("even" or "odd": the nearest piece of that parity is continued; "gate":
        the piece that begins within a rounding error, or the one around; "own": that one;
        "evengate" or "oddgate": the gate of the nearest piece of that parity), and factors of the
        coefficients (u⁰, u¹, ... of what is left after as many derivatives as there are factors
        missing).
    breaks : array, shape (m + 1,)
        Ends of the pieces, increasing.
    coefficients : array, shape (m, d + 1)
        Of the powers of u = x − breaks[i].
    ends : array, shape (m, 3)
        Of the gates: coefficients of u⁰, u¹, u².
    period : float
        After which all repeats; 0 if nothing does.
    near : float
        Relative rounding error of x, or of the breaks if these are larger.
    undefined : mapping of str to (float, float)
        By side, below which a function is not a number in its first piece, and above which in its
        last one, if nothing repeats.

    Returns
    -------
    Provider
        Keeps the arrays, whose addresses the code knows.
    """

    def make() -> Code:
        text = _assembly(names, breaks, coefficients, ends, period, near, undefined)
        find_functions(["floor"])
        return loaded([emitted(module_of(text, processor(), STRAIGHT), processor(), LOOPS)])

    return provide(names, make, lasting=False)


def _assembly(
    names: Mapping[str, tuple[str, Sequence[float]]],
    breaks: Any,
    coefficients: Any,
    ends: Any,
    period: float,
    near: float,
    undefined: Mapping[str, tuple[float, float]],
) -> str:
    """The functions as LLVM assembly: `find` looks for the piece around x, first where it would be
    if all were of one length, then by bisection."""
    m = len(breaks) - 1
    first, last = float(breaks[0]), float(breaks[-1])
    table = f"inttoptr (i64 {breaks.ctypes.data} to ptr)"
    density = m / (last - first)
    finding = f"""
declare double @llvm.floor.f64(double)
declare double @llvm.fabs.f64(double)
define internal i64 @find(double %x) {{
entry:
  %away = fsub double %x, {operand(first)}
  %guess = fmul double %away, {operand(density)}
  %under = fcmp olt double %guess, 0.0
  %above = select i1 %under, double 0.0, double %guess
  %over = fcmp ogt double %above, {operand(float(m - 1))}
  %bounded = select i1 %over, double {operand(float(m - 1))}, double %above
  %known = fcmp ord double %bounded, 0.0
  %inside = select i1 %known, double %bounded, double 0.0
  %g = fptosi double %inside to i64
  %at = getelementptr double, ptr {table}, i64 %g
  %low = load double, ptr %at
  %g1 = add i64 %g, 1
  %at1 = getelementptr double, ptr {table}, i64 %g1
  %high = load double, ptr %at1
  %begun = fcmp ole double %low, %x
  %open = fcmp olt double %x, %high
  %hit = and i1 %begun, %open
  br i1 %hit, label %found, label %loop
found:
  ret i64 %g
loop:
  %lo = phi i64 [ 0, %entry ], [ %newlo, %more ]
  %hi = phi i64 [ {m}, %entry ], [ %newhi, %more ]
  %width = sub i64 %hi, %lo
  %going = icmp sgt i64 %width, 1
  br i1 %going, label %more, label %done
more:
  %sum = add i64 %lo, %hi
  %mid = lshr i64 %sum, 1
  %atmid = getelementptr double, ptr {table}, i64 %mid
  %value = load double, ptr %atmid
  %right = fcmp ole double %value, %x
  %newlo = select i1 %right, i64 %mid, i64 %lo
  %newhi = select i1 %right, i64 %hi, i64 %mid
  br label %loop
done:
  ret i64 %lo
}}"""
    sides = {side for side, _ in names.values()}
    places = [
        _place(side, m, (first, last), period, near, table, undefined[side])
        for side in sorted(sides)
    ]
    values = [
        _value(name, side, factors, ends if side.endswith("gate") else coefficients, table)
        for name, (side, factors) in names.items()
    ]
    return "\n".join([finding, *places, *values])


def _place(
    side: str,
    m: int,
    ends: tuple[float, float],
    period: float,
    near: float,
    table: str,
    undefined: tuple[float, float],
) -> str:
    """The piece for x on a side, and the local coordinate in it: without whole periods, but beyond
    the ends of the table if the piece is.

    Where a function is undefined x is not a number, if nothing repeats.
    """
    first, last = ends
    largest = max(abs(first), abs(last))
    lines = [f"define internal {{ i64, double }} @{side}(double %given) {{"]
    if period > 0.0:
        lines.append(f"""  %since = fsub double %given, {operand(first)}
  %share = fdiv double %since, {operand(period)}
  %turns = call double @llvm.floor.f64(double %share)
  %gone = fmul double %turns, {operand(period)}
  %x = fsub double %given, %gone""")
    else:
        lines.append("  %x = fadd double %given, 0.0")
    lines.append(f"""  %i = call i64 @find(double %x)
  %at = getelementptr double, ptr {table}, i64 %i
  %low = load double, ptr %at
  %next = add i64 %i, 1
  %atnext = getelementptr double, ptr {table}, i64 %next
  %high = load double, ptr %atnext
  %left = fsub double %x, %low
  %right = fsub double %high, %x
  %before = sub i64 %i, 1""")
    if side == "gate":
        lines.append(f"""  %size = call double @llvm.fabs.f64(double %given)
  %far = fcmp ogt double %size, {operand(largest)}
  %counted = select i1 %far, double %size, double {operand(largest)}
  %known = fmul double %counted, {operand(near)}
  %begins = fcmp ole double %right, %known
  %k = select i1 %begins, i64 %next, i64 %i""")
    elif side == "own":
        lines.append("  %k = add i64 %i, 0")
    else:
        lines.append(f"""  %parity = urem i64 %i, 2
  %own = icmp eq i64 %parity, {0 if side.startswith("even") else 1}
  %nearer = fcmp olt double %left, %right
  %other = select i1 %nearer, i64 %before, i64 %next
  %k = select i1 %own, i64 %i, i64 %other""")
    if period > 0.0:
        lines.append(f"""  %past = icmp eq i64 %k, {m}
  %less = fsub double %x, {operand(period)}
  %x1 = select i1 %past, double %less, double %x
  %k1 = select i1 %past, i64 0, i64 %k
  %ahead = icmp slt i64 %k, 0
  %more = fadd double %x, {operand(period)}
  %x2 = select i1 %ahead, double %more, double %x1
  %k2 = select i1 %ahead, i64 {m - 1}, i64 %k1""")
    else:  # at the ends the piece on the other side has that parity, if there is one
        inner = m - 1 if side == "gate" else max(m - 2, 0)
        lines.append(f"""  %past = icmp eq i64 %k, {m}
  %k1 = select i1 %past, i64 {inner}, i64 %k
  %ahead = icmp slt i64 %k, 0
  %k2 = select i1 %ahead, i64 {min(1, m - 1)}, i64 %k1
  %first = icmp eq i64 %k2, 0
  %early = fcmp olt double %x, {operand(undefined[0])}
  %under = and i1 %first, %early
  %last = icmp eq i64 %k2, {m - 1}
  %late = fcmp ogt double %x, {operand(undefined[1])}
  %over = and i1 %last, %late
  %nowhere = or i1 %under, %over
  %x2 = select i1 %nowhere, double 0x7FF8000000000000, double %x""")
    lines.append(f"""  %atk = getelementptr double, ptr {table}, i64 %k2
  %start = load double, ptr %atk
  %u = fsub double %x2, %start
  %one = insertvalue {{ i64, double }} undef, i64 %k2, 0
  %both = insertvalue {{ i64, double }} %one, double %u, 1
  ret {{ i64, double }} %both
}}""")
    return "\n".join(lines)


def _value(name: str, side: str, factors: Sequence[float], table: Any, breaks: str) -> str:
    """A function: Horner's scheme in the last of a piece's coefficients, times factors."""
    width = table.shape[1]
    base = f"inttoptr (i64 {table.ctypes.data} to ptr)"
    skipped = width - len(factors)
    lines = [
        f"define double @{name}(double %x) {{",
        f"  %found = call {{ i64, double }} @{side}(double %x)",
        "  %k = extractvalue { i64, double } %found, 0",
        "  %u = extractvalue { i64, double } %found, 1",
        f"  %row = mul i64 %k, {width}",
        # NaN is propagated, whatever the order
        "  %nothing = fmul double %u, 0.0",
    ]
    total = "%nothing"
    for j in range(len(factors) - 1, -1, -1):
        lines += [
            f"  %place{j} = add i64 %row, {skipped + j}",
            f"  %at{j} = getelementptr double, ptr {base}, i64 %place{j}",
            f"  %c{j} = load double, ptr %at{j}",
            f"  %term{j} = fmul double %c{j}, {operand(factors[j])}",
            f"  %high{j} = fmul double {total}, %u",
            f"  %sum{j} = fadd double %high{j}, %term{j}",
        ]
        total = f"%sum{j}"
    return "\n".join([*lines, f"  ret double {total}", "}"])
