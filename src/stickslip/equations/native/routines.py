"""Arguments of the engine, and scalars as machine code."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, partial, reduce
from typing import Any

from stickslip.equations.native.arithmetic import Arithmetic, Count, Operand
from stickslip.equations.native.kernels import reached
from stickslip.machine_code.interface import INTERFACE
from stickslip.numerics.levels import ROUNDING
from stickslip.symbolic.functions import ARGUMENT, FUNCTIONS
from stickslip.symbolic.scalars import Scalar, Store, numeral, scalars_of
from stickslip.translator.assembly import POINTER, REAL, WHOLE, Register, of_type
from stickslip.translator.values import FunctionType, declared_type

_GIVEN = frozenset({"p", "y", "mode", "reg", "K", "Rq", "Rz"})
"""Arrays that a function only reads."""


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class InRegister(Scalar):
    """A value that is made already."""

    register: Register


def in_register(register: Register) -> Scalar:
    """A real in a register, as a value."""
    return InRegister("register", register=of_type(REAL, register))


@cache
def _arguments(name: str) -> tuple[list[Register], str]:
    """The arguments of a function of a system, and the type of its result."""
    function = declared_type(INTERFACE[name])
    assert isinstance(function, FunctionType)
    arguments = [Register(f"%{name}", kind.llvm) for name, kind in function.arguments]
    return arguments, function.result.llvm


class Routine(Arithmetic):
    """A function of a system."""

    def __init__(self, name: str) -> None:
        super().__init__(name, *_arguments(name))

    # -- arguments ---------------------------------------------------------------------------------

    def data(self, name: str) -> Register:
        """Address of an array's first entry."""
        array = self.arguments[name]
        return self.once(("data", name), lambda: self.extract(array, 0, POINTER))

    def stride(self, name: str) -> Register:
        """Distance of rows, in numbers."""
        array = self.arguments[name]
        return self.once(("stride", name), lambda: self.extract(array, 2, WHOLE))

    def row(self, name: str, i: Count) -> Register:
        """Address of a row of a matrix."""

        def make() -> Register:
            return self.at(self.data(name), self.count("mul", self.stride(name), i), REAL)

        return self.once(("row", name, i), make)

    def place(self, name: str, *index: Count) -> Register:
        """Address of an entry of an array."""
        if len(index) == 2:
            return self.at(self.row(name, index[0]), index[1], REAL)
        return self.at(self.data(name), index[0], REAL)

    def entry(self, name: str, *index: Count) -> Operand:
        """An entry of an array; entries that are only read are loaded once."""
        if name not in _GIVEN:
            return self.load(REAL, self.place(name, *index))
        return self.once((name, *index), lambda: self.load(REAL, self.place(name, *index)))

    def which(self, name: str, i: Count) -> Register:
        """The mode of a contact or the region of a kink."""
        return self.once((name, i), lambda: self.load(WHOLE, self.at(self.data(name), i, WHOLE)))

    def is_mode(self, i: Count, how: str, number: int) -> Register:
        """A test of the mode of a contact."""
        mode = self.which("mode", i)
        return self.once((how, i, number), lambda: self.compare(how, mode, number))

    def is_free(self, i: Count, pressed: tuple[int, ...]) -> Register:
        """Whether a contact sticks, or all contacts that press it are open."""
        sticks = self.is_mode(i, "eq", 0)
        if not pressed:
            return sticks
        opened, *others = (self.is_mode(normal, "ne", 0) for normal in pressed)
        for k, other in enumerate(others):
            opened = self.once(("open", i, k), partial(self.both, opened, other))
        return self.once(("free", i), partial(self.either, sticks, opened))

    def is_above(self, i: Count) -> Register:
        """Whether a kink is in its upper region."""
        region = self.which("reg", i)
        return self.once(("above", i), lambda: self.compare("eq", region, 1))

    def by_mode_of(self, i: Count, stick: Operand, plus: Operand, minus: Operand) -> Operand:
        """A value that depends on the mode of a contact."""
        slip = self.select(self.is_mode(i, "sgt", 0), plus, minus) if plus != minus else plus
        return self.select(self.is_mode(i, "eq", 0), stick, slip) if stick != slip else slip

    # -- scalars -----------------------------------------------------------------------------------

    def statements(self, stores: Iterable[Store]) -> None:
        """Write statements."""
        for name, place, value, adding in stores:
            x = self.scalar(value)
            self.write(
                self.add(self.entry(name, *place), x) if adding else x, self.place(name, *place)
            )

    def scalar(self, s: Scalar) -> Operand:
        """A value; each value is computed once."""
        if s.op == "number":
            return s.value
        if s.op == "entry":
            return self.entry(s.name, *s.index)
        if s.op == "name":
            return self.arguments[s.name]
        if isinstance(s, InRegister):
            return s.register
        return self.once(s, lambda: self._scalar(s))

    def _scalar(self, s: Scalar) -> Operand:
        x = [self.scalar(part) for part in s.args]
        match s.op:
            case "kept":
                return x[0]
            case "sum":
                return reduce(partial(self.plainly, "fadd"), x)
            case "product":
                return reduce(self._product, x)
            case "quotient":
                return self.over(*x)
            case "reciprocal":
                return self._reciprocal(x[0])
            case "negative":
                return self.negative(x[0])
            case "modulus":
                return self.modulus(x[0])
            case "larger":
                return self.select(self.test("ogt", *x), *x)
            case "over":
                return self.select(self.test("ogt", x[1], 0.0), self.over(*x), 0.0)
            case "mode":
                return self.by_mode_of(s.index[0], *x)
            case "region":
                return self.select(self.is_above(s.index[0]), *x)
            case "sign":
                tests = ("ogt", "ole") if s.value else ("oge", "olt")
                first, second = (self.test(how, x[0], 0.0) for how in tests)
                return self.select(first, x[1], self.select(second, x[2], math.nan))
            case "real_power":
                return self._power(*x)
            case "first_power":
                return self.first_power(*x)
            case "dot":
                return self._dot(x)
            case "spread":
                return self.spread(s.name, *s.index)
            case "call":
                return self.formula(s.name, x[0])
        raise NotImplementedError(s.op)

    def _product(self, a: Operand, b: Operand) -> Operand:
        """a·b, which is rounded before it is added to anything."""
        return self.times(a, b) if 1.0 in (a, b) else self.plainly("fmul", a, b)

    def modulus(self, x: Operand) -> Operand:
        """|x|."""
        return abs(x) if isinstance(x, float) else self.function("llvm.fabs.f64", x)

    def formula(self, name: str, x: Operand) -> Operand:
        """The value of a function of formulas."""
        formula = FUNCTIONS[name].made_of
        if formula is None:
            return self.function(name, x)
        argument = in_register(x) if isinstance(x, Register) else numeral(x)
        return self.scalar(scalars_of([formula], {ARGUMENT: argument})[formula])

    def _reciprocal(self, x: Operand) -> Operand:
        """1/x, undefined at 0."""
        return self.select(self.test("oeq", x, 0.0), math.nan, self.over(1.0, x))

    def _power(self, x: Operand, p: Operand) -> Operand:
        if p == 2.0:
            return self.times(x, x)
        return self._reciprocal(x) if p == -1.0 else self._defined(self.function("pow", x, p), x, p)

    def _defined(self, power: Operand, x: Operand, p: Operand) -> Operand:
        """A power, but undefined at a pole between −∞ and ∞, and at −∞ if it is not whole."""
        if isinstance(p, float):
            if not p.is_integer():
                return self.select(self.test("olt", x, 0.0), math.nan, power)
            if p > 0.0 or p % 2.0 != 1.0:
                return power
            return self.select(self.test("oeq", x, 0.0), math.nan, power)
        half = self.times(0.5, p)
        odd = self.test(
            "oeq", self.plainly("fsub", half, self.function("llvm.floor.f64", half)), 0.5
        )
        pole = self.both(self.test("oeq", x, 0.0), self.both(odd, self.test("olt", p, 0.0)))
        return self.select(pole, math.nan, power)

    def first_power(self, a: Operand, p: Operand, size: Operand) -> Operand:
        """aᵖ, where a is known to within the rounding error of terms of a given size: values within
        it count as 0."""
        root = "llvm.sqrt.f64"
        power: Operand = self.function(root, a) if p == 0.5 else self.function("pow", a, p)
        if not isinstance(p, float):
            rooted = self.both(self.test("oeq", p, 0.5), self.test("oge", a, 0.0))
            power = self.select(rooted, self.function(root, a), power)
        elif p <= 0.0:
            return self._defined(power, a, p)
        small = self.test("ole", self.modulus(a), self.times(ROUNDING, size))
        if not isinstance(p, float):
            power = self._defined(power, a, p)
            small = self.both(small, self.test("ogt", p, 0.0))
        return self.select(small, 0.0, power)

    def spread(self, matrix: str, i: Count, n: int, base: Any) -> Operand:
        """Σⱼ |Rᵢⱼ| mag[base + j]."""
        return self.kernel(reached, self.place(matrix, i, 0), self.place("mag", base), n)

    def _dot(self, x: list[Operand]) -> Operand:
        """Σ aᵢbᵢ in twice the working precision: algorithm Dot2 of Ogita, Rump and Oishi (2005),
        with the error of each product from a fused operation."""
        total: Operand = 0.0
        lost: Operand = 0.0
        for a, b in zip(x[::2], x[1::2], strict=True):
            product = self._product(a, b)
            error = self.fused(a, b, self.negative(product))
            higher = self.plainly("fadd", total, product)
            part = self.plainly("fsub", higher, total)
            left = self.plainly("fsub", total, self.plainly("fsub", higher, part))
            right = self.plainly("fsub", product, part)
            carried = self.plainly("fadd", left, right)
            lost = self.plainly("fadd", self.plainly("fadd", lost, carried), error)
            total = higher
        finite = self.test("olt", self.modulus(lost), float("inf"))
        return self.select(finite, self.plainly("fadd", total, lost), total)
