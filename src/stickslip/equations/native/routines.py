"""Arguments of the engine, and scalars as machine code."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from stickslip.equations.native.assembly import WHOLE, Assembly, Operand, constant
from stickslip.machine_code.interface import INTERFACE
from stickslip.symbolic.functions import ARGUMENT, FUNCTIONS
from stickslip.symbolic.scalars import Scalar, Store, numeral
from stickslip.symbolic.tape import scalars_of
from stickslip.translator.values import declared_type

_NOTHING = 64 * 2.220446049250313e-16  # part of its terms below which a difference may be zero
_GIVEN = frozenset({"p", "y", "mode", "reg", "K", "Rq", "Rz"})
"""Arrays that a function only reads."""


class Routine(Assembly):
    """One of the functions of a system."""

    def __init__(self, name: str) -> None:
        function = declared_type(INTERFACE[name])
        arguments = ", ".join(f"{kind.llvm} %{name}" for name, kind in function.arguments)
        super().__init__(name, arguments, function.result.llvm)
        self._kinds = {name: kind.llvm for name, kind in function.arguments}

    # -- arguments ---------------------------------------------------------------------------------

    def data(self, name: str) -> str:
        """Address of an array's first entry."""
        kind = self._kinds[name]
        return self.once(("data", name), lambda: self.new(f"extractvalue {kind} %{name}, 0"))

    def stride(self, name: str) -> str:
        """From a row to the next, in numbers."""
        kind = self._kinds[name]
        return self.once(("stride", name), lambda: self.new(f"extractvalue {kind} %{name}, 2"))

    def row(self, name: str, i: int | str) -> str:
        """Address of a row of a matrix."""

        def make() -> str:
            return self.at(self.data(name), self.whole("mul", self.stride(name), i))

        return self.once(("row", name, i), make)

    def place(self, name: str, *index: int) -> str:
        """Address of an entry of an array."""
        if len(index) == 2:
            return self.at(self.row(name, index[0]), index[1])
        return self.at(self.data(name), index[0])

    def entry(self, name: str, *index: int) -> Operand:
        """An entry of an array; of what is only read, once."""
        if name not in _GIVEN:
            return self.load(self.place(name, *index))
        return self.once((name, *index), lambda: self.load(self.place(name, *index)))

    def which(self, name: str, i: int) -> str:
        """The mode of a contact or the region of a kink."""
        return self.once((name, i), lambda: self.load(self.at(self.data(name), i), WHOLE))

    def is_mode(self, i: int, how: str, number: int) -> str:
        """A test of the mode of a contact."""
        mode = self.which("mode", i)
        return self.once((how, i, number), lambda: self.whole(f"icmp {how}", mode, number))

    def is_free(self, i: int, pressed: tuple[int, ...]) -> str:
        """Whether a contact sticks, or a contact that presses it is open."""
        found = self.is_mode(i, "eq", 0)
        for normal in pressed:
            tests = found, self.is_mode(normal, "ne", 0)
            found = self.once(("free", i, normal), partial(self.either, *tests))
        return found

    def either(self, a: str, b: str) -> str:
        """Whether one of two tests holds."""
        return self.new(f"or i1 {a}, {b}")

    def is_above(self, i: int) -> str:
        """Whether a kink is in its upper region."""
        region = self.which("reg", i)
        return self.once(("above", i), lambda: self.whole("icmp eq", region, 1))

    def by_mode_of(self, i: int, stick: Operand, plus: Operand, minus: Operand) -> Operand:
        """What depends on the mode of a contact."""
        slip = self.choose(self.is_mode(i, "sgt", 0), plus, minus) if plus != minus else plus
        return self.choose(self.is_mode(i, "eq", 0), stick, slip) if stick != slip else slip

    # -- scalars -----------------------------------------------------------------------------------

    def statements(self, stores: Iterable[Store]) -> None:
        """Write statements."""
        for name, place, value, adding in stores:
            x = self.scalar(value)
            self.store(
                self.add(self.entry(name, *place), x) if adding else x, self.place(name, *place)
            )

    def scalar(self, s: Scalar) -> Operand:
        """A value; what has been made once is known."""
        if s.op in ("number", "name"):
            return s.value if s.op == "number" else f"%{s.name}"
        if s.op == "entry":
            return self.entry(s.name, *s.index)
        if s not in self._once:
            self._once[s] = self._scalar(s)
        return self._once[s]

    def _scalar(self, s: Scalar) -> Operand:
        x = [self.scalar(part) for part in s.args]
        match s.op:
            case "kept":
                return x[0]
            case "sum":
                return self._in_turn("fadd", x)
            case "product":
                return self._in_turn("fmul", x)
            case "quotient":
                return self.over(*x)
            case "reciprocal":
                return self.over(1.0, x[0])
            case "negative":
                return self.negative(x[0])
            case "modulus":
                return self.modulus(x[0])
            case "larger":
                return self.choose(self.test("ogt", *x), *x)
            case "over":
                return self.choose(self.test("ogt", x[1], 0.0), self.over(*x), 0.0)
            case "mode":
                return self.by_mode_of(s.index[0], *x)
            case "region":
                return self.choose(self.is_above(s.index[0]), *x)
            case "sign":
                return self.choose(self.test("oge", x[0], 0.0), *x[1:])
            case "real_power":
                return self._power(*x)
            case "first_power":
                return self.first_power(*x)
            case "dot":
                return self._dot(x)
            case "spread":
                return self.spread(s.name, *s.index)
            case "call":
                return self.function(s.name, x[0])
        raise NotImplementedError(s.op)

    def _in_turn(self, operation: str, values: list[Operand]) -> Operand:
        """A sum or a product, in the order in which it stands, each operation rounded."""
        result, *others = values
        for x in others:
            result = self._plainly(operation, result, x)
        return result

    def _plainly(self, operation: str, a: Operand, b: Operand) -> Operand:
        """One operation, as it stands."""
        if operation == "fmul" and 1.0 in (a, b):
            return b if a == 1.0 else a
        return self.new(f"{operation} double {constant(a)}, {constant(b)}", a, b)

    def modulus(self, x: Operand) -> Operand:
        """|x|."""
        return abs(x) if isinstance(x, float) else self.call("llvm.fabs.f64", x)

    def function(self, name: str, x: Operand) -> Operand:
        """The value of a function of formulas."""
        formula = FUNCTIONS[name].made_of
        if formula is None:
            return self.call(name, x)
        argument = Scalar("name", name=x[1:]) if isinstance(x, str) else numeral(x)
        return self.scalar(scalars_of([formula], {ARGUMENT: argument})[formula])

    def _power(self, x: Operand, p: Operand) -> Operand:
        if p == 2.0:
            return self.times(x, x)
        return self.over(1.0, x) if p == -1.0 else self.call("pow", x, p)

    def first_power(self, a: Operand, p: Operand, size: Operand) -> Operand:
        """aᵖ, where a is known up to the rounding error of terms of a size: what may be 0 is 0."""
        power: Operand = self.call("llvm.sqrt.f64", a) if p == 0.5 else self.call("pow", a, p)
        if not isinstance(p, float):
            rooted = self.both(self.test("oeq", p, 0.5), self.test("oge", a, 0.0))
            power = self.choose(rooted, self.call("llvm.sqrt.f64", a), power)
        elif p <= 0.0:
            return power
        small = self.test("ole", self.modulus(a), self.times(_NOTHING, size))
        if not isinstance(p, float):
            small = self.both(small, self.test("ogt", p, 0.0))
        return self.choose(small, 0.0, power)

    def spread(self, matrix: str, i: int, n: int, base: int) -> Operand:
        """Σⱼ |Rᵢⱼ| mag[base + j]."""
        first, last = self.place(matrix, i, 0), self.place("mag", base)
        return self.new(f"call double @spread(ptr {first}, ptr {last}, i64 {n})")

    def _dot(self, x: list[Operand]) -> Operand:
        """Σ aᵢbᵢ as if computed with twice as many digits: the algorithm Dot2 of Ogita, Rump and
        Oishi (2005); the product's error comes from a fused operation."""
        total: Operand = 0.0
        lost: Operand = 0.0
        for a, b in zip(x[::2], x[1::2], strict=True):
            product = self._plainly("fmul", a, b)
            error = self.fused(a, b, self.negative(product))
            higher = self._plainly("fadd", total, product)
            part = self._plainly("fsub", higher, total)
            left = self._plainly("fsub", total, self._plainly("fsub", higher, part))
            right = self._plainly("fsub", product, part)
            carried = self._plainly("fadd", left, right)
            lost = self._in_turn("fadd", [lost, carried, error])
            total = higher
        finite = self.test("olt", self.modulus(lost), float("inf"))
        return self.choose(finite, self._plainly("fadd", total, lost), total)
