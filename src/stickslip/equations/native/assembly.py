"""LLVM assembly of one function: values, sums of products, loops.

A value is a number that is known now, or a register. What is zero is absent: it is neither
multiplied nor added. The order of sums is fixed here, and nothing is left for LLVM to reorder, so
that NaN and infinity stay visible and the same bits come out on every processor with fused
multiplication.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Hashable, Sequence
from typing import Any

Operand = float | str
Pair = tuple[Operand, Operand]

REAL, WHOLE, POINTER = "double", "i64", "ptr"
_STRANDS = 4  # in which long sums are added up, so that no instruction waits long for another


def constant(x: Operand) -> str:
    """A value as an operand."""
    return x if isinstance(x, str) else f"0x{struct.unpack('<Q', struct.pack('<d', x))[0]:016X}"


class Assembly:
    """A function in the making.

    Parameters
    ----------
    name : str
    arguments : str
        With their types.
    result : str
        Its type.
    inside : bool
        Whether it is called from this assembly alone.

    Attributes
    ----------
    name : str
    lines : list of str
        Instructions so far.
    """

    def __init__(
        self, name: str, arguments: str, result: str = "void", inside: bool = False
    ) -> None:
        self.name = name
        self.head = f"define {'internal ' if inside else ''}{result} @{name}({arguments})"
        self.lines: list[str] = []
        self._made: dict[str, tuple[Operand, ...]] = {}
        self._age: dict[str, int] = {}
        self._once: dict[Hashable, Any] = {}
        self._registers = 0
        self._stores = 0
        self._block = "entry"

    def text(self) -> str:
        """The whole function."""
        return "\n".join([f"{self.head} {{", "entry:", *self.lines, "}", ""])

    def new(self, instruction: str, *made_of: Operand) -> str:
        """The register of an instruction's result, as old as what it is made of."""
        register = f"%v{self._registers}"
        self._registers += 1
        self.lines.append(f"{register} = {instruction}")
        self._age[register] = max([self.age(x) for x in made_of], default=-1)
        return register

    def once(self, key: Hashable, make: Callable[[], str]) -> str:
        """What is made where it is first needed, and then known."""
        if key not in self._once:
            self._once[key] = make()
        return self._once[key]

    def age(self, x: Operand) -> int:
        """When a value is known: −1 from the start, then by coefficients."""
        return self._age.get(x, -1) if isinstance(x, str) else -1

    def known_now(self, x: Operand) -> None:
        """A coefficient is ready: what is made of it is newer than all before."""
        if isinstance(x, str):
            self._stores += 1
            self._age[x] = self._stores

    # -- arithmetic ------------------------------------------------------------------------------

    def negative(self, a: Operand) -> Operand:
        """−a."""
        if isinstance(a, float):
            return -a
        return self.once(("-", a), lambda: self.new(f"fneg double {a}", a))

    def add(self, a: Operand, b: Operand) -> Operand:
        """A sum."""
        if isinstance(a, float) and isinstance(b, float):
            return a + b
        if b == 0.0 or a == 0.0:
            return a if b == 0.0 else b
        return self.new(f"fadd double {constant(a)}, {constant(b)}", a, b)

    def times(self, a: Operand, b: Operand) -> Operand:
        """A product."""
        if isinstance(a, float) and isinstance(b, float):
            return a * b
        if a == 0.0 or b == 0.0:
            return 0.0
        if a == 1.0 or b == 1.0:
            return b if a == 1.0 else a
        product = self.new(f"fmul double {constant(a)}, {constant(b)}", a, b)
        self._made[product] = (a, b)
        return product

    def fused(self, a: Operand, b: Operand, c: Operand) -> Operand:
        """a·b + c, rounded once."""
        if a in (0.0, 1.0) or b in (0.0, 1.0) or c == 0.0:
            return self.add(self.times(a, b), c)
        if isinstance(a, float) and isinstance(b, float):
            return self.add(a * b, c)
        operands = ", ".join(f"double {constant(x)}" for x in (a, b, c))
        made = self.new(f"call double @llvm.fma.f64({operands})", a, b, c)
        self._made[made] = (a, b, c)
        return made

    def over(self, a: Operand, b: Operand) -> Operand:
        """A quotient."""
        if a == 0.0 or b == 1.0:
            return a
        return self.new(f"fdiv double {constant(a)}, {constant(b)}", a, b)

    def total(self, products: Sequence[Pair]) -> Operand:
        """A sum of products: the old ones in strands, what is known last added last."""
        terms = [(a, b) for a, b in products if a != 0.0 and b != 0.0]
        terms.sort(key=lambda term: max(map(self.age, term)))
        old, new = terms[:-2], terms[-2:]
        strands = [old[i::_STRANDS] for i in range(_STRANDS)] if len(old) > _STRANDS else None
        sums = list[Operand]()
        for strand in [[term] for term in old] if strands is None else strands:
            s: Operand = 0.0
            for a, b in strand:
                s = self.fused(a, b, s)
            sums.append(s)
        while len(sums) > 1:
            pairs = [sums[i : i + 2] for i in range(0, len(sums), 2)]
            sums = [self.add(*pair) if len(pair) == 2 else pair[0] for pair in pairs]
        s = sums[0] if sums else 0.0
        for a, b in new:
            s = self.fused(*self._unwound(a, b), s)
        return s

    def _unwound(self, a: Operand, b: Operand) -> Pair:
        """A product without waiting for a product: factors that are known go to what is known."""
        if self.age(a) < self.age(b):
            a, b = b, a
        made = self._made.get(a, ()) if isinstance(a, str) else ()
        if len(made) == 2 and self.age(a) > self.age(b):
            factor, base = sorted(made, key=self.age)
            if self.age(base) > self.age(factor):
                return base, self.times(factor, b)
        return a, b

    def scaled(self, a: Operand, factor: Operand) -> Operand:
        """A value times something known long ago, without waiting for a sum."""
        made = self._made.get(a, ()) if isinstance(a, str) else ()
        if len(made) == 3:
            x, y, rest = made
            x, y = sorted((x, y), key=self.age)
            return self.fused(y, self.times(x, factor), self.times(rest, factor))
        return self.times(*self._unwound(a, factor))

    # -- functions and choices ---------------------------------------------------------------------

    def call(self, function: str, *operands: Operand, to: str = REAL) -> str:
        """The value of a function of reals."""
        given = ", ".join(f"double {constant(x)}" for x in operands)
        return self.new(f"call {to} @{function}({given})", *operands)

    def test(self, how: str, a: Operand, b: Operand) -> str:
        """A comparison of reals."""
        return self.new(f"fcmp {how} double {constant(a)}, {constant(b)}", a, b)

    def both(self, a: str, b: str) -> str:
        """Whether two tests hold."""
        return self.new(f"and i1 {a}, {b}", a, b)

    def choose(self, test: str, a: Operand, b: Operand) -> Operand:
        """One of two values."""
        if a == b:
            return a
        return self.new(f"select i1 {test}, double {constant(a)}, double {constant(b)}", a, b)

    # -- memory and control ------------------------------------------------------------------------

    def whole(self, operation: str, a: str | int, b: str | int) -> str:
        """Arithmetic or a comparison of whole numbers."""
        return self.new(f"{operation} i64 {a}, {b}")

    def at(self, base: str, index: str | int, kind: str = REAL) -> str:
        """Address of an entry."""
        return self.new(f"getelementptr {kind}, ptr {base}, i64 {index}")

    def load(self, address: str, kind: str = REAL) -> str:
        """What stands at an address."""
        return self.new(f"load {kind}, ptr {address}")

    def store(self, value: Operand, address: str) -> None:
        """Put a real at an address."""
        self.lines.append(f"store double {constant(value)}, ptr {address}")

    def leave(self, test: str, result: int | str) -> None:
        """Return a whole number if a test holds."""
        there, on = self._label(), self._label()
        self.lines.append(f"br i1 {test}, label %{there}, label %{on}")
        self._enter(there)
        self.lines.append(f"ret i64 {result}")
        self._enter(on)

    def loop(
        self,
        low: str | int,
        high: str | int,
        body: Callable[..., Sequence[Operand | int] | None],
        *carried: tuple[str, Operand | int],
        going: int | None = None,
    ) -> list[str]:
        """Follow a body for all whole numbers from `low` to before `high`.

        Parameters
        ----------
        body : callable
            Takes the number and the carried values; returns their new ones.
        carried : tuples (type, first value)
        going : int, optional
            Which of the carried values, a truth value, has to hold for the loop to go on.
        """
        header, inside, after = self._label(), self._label(), self._label()
        before = self._block
        known = dict(self._once)
        self.lines.append(f"br label %{header}")
        self._enter(header)
        place = len(self.lines)
        index, *values = (self.new("phi") for _ in range(1 + len(carried)))
        self.lines.append(f"{index}.go = icmp slt i64 {index}, {high}")
        test = f"{index}.go"
        if going is not None:
            test = self.both(test, values[going])
        self.lines.append(f"br i1 {test}, label %{inside}, label %{after}")
        self._enter(inside)
        changed = body(index, *values) or []
        self.lines.append(f"{index}.next = add i64 {index}, 1")
        self.lines.append(f"br label %{header}")
        sources = [(WHOLE, low, f"{index}.next")]
        sources += [(kind, x, y) for (kind, x), y in zip(carried, changed, strict=True)]
        for i, (kind, x, y) in enumerate(sources):
            x, y = (constant(z) if kind == REAL else z for z in (x, y))
            self.lines[place + i] += f" {kind} [ {x}, %{before} ], [ {y}, %{self._block} ]"
        self._enter(after)
        # What is made inside is not there if the loop is never entered.
        self._once = known
        return values

    def _label(self) -> str:
        self._registers += 1
        return f"l{self._registers}"

    def _enter(self, label: str) -> None:
        self.lines.append(f"{label}:")
        self._block = label
