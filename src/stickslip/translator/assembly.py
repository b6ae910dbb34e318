"""LLVM assembly of one function under construction: registers, blocks, instructions.

Every register has a type, and what takes one looks at it. So a number is never an address, and a
mistake shows where it is made, not where LLVM reads it.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

BIT, WHOLE, REAL, POINTER, NOTHING = "i1", "i64", "double", "ptr", "void"
TWO_REALS = "{ double, double }"
FASTCC = " fastcc"
"""How functions of the language are called; those of C are called otherwise."""


class WrongType(TypeError):
    """An operand has a type that the instruction does not accept; an internal error of the code
    that writes assembly."""


class Register(NamedTuple):
    """Operand of an instruction: a register, a global name or a literal.

    Attributes
    ----------
    type : str
        In LLVM's words.
    """

    name: str
    type: str

    def __str__(self) -> str:
        return self.name

    @property
    def typed(self) -> str:
        """The operand with its type in front."""
        return f"{self.type} {self.name}"


def operand(x: Register | complex) -> Register:
    """A register, or a number as a literal, exactly."""
    if isinstance(x, Register):
        return x
    if isinstance(x, bool):
        return Register("true" if x else "false", BIT)
    if isinstance(x, int):
        return Register(str(x), WHOLE)
    if isinstance(x, float):
        return Register(f"0x{struct.unpack('<Q', struct.pack('<d', x))[0]:016X}", REAL)
    if isinstance(x, complex):
        return Register(f"{{ {operand(x.real).typed}, {operand(x.imag).typed} }}", TWO_REALS)
    raise WrongType(f"{x!r} is neither a register nor a number")


def of_type(type_: str, x: Register | float) -> Register:
    """An operand of a certain type.

    Raises
    ------
    WrongType
    """
    found = operand(x)
    if found.type != type_:
        raise WrongType(f"{found.typed} where there has to be {type_}")
    return found


class Assembly:
    """A function in the making.

    Attributes
    ----------
    lines : list of str
        Instructions so far.
    slots : list of str
        Room on the stack, made where the function begins.
    block : str
        Label of the block that is being written.
    ended : bool
        Whether that block has its last instruction.
    declared : dict
        Declarations of what is called from outside, by name.
    attributes, within : str
        What LLVM may assume of functions of numbers from outside, and of addresses of entries.
    """

    attributes, within = " #1", "inbounds "

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.slots: list[str] = []
        self.declared: dict[str, str] = {}
        self.block = "entry"
        self.ended = False
        self._count = 0

    def body(self) -> str:
        """The text in the braces."""
        return "\n".join(["entry:", *self.slots, *self.lines, ""])

    def new(self, type_: str, instruction: str) -> Register:
        """The register of an instruction's result."""
        self._count += 1
        self.lines.append(f"%v{self._count} = {instruction}")
        return Register(f"%v{self._count}", type_)

    def slot(self, type_: str) -> Register:
        """Address of room for a value."""
        self._count += 1
        self.slots.append(f"%v{self._count} = alloca {type_}, align 16")
        return Register(f"%v{self._count}", POINTER)

    # -- numbers -----------------------------------------------------------------------------------

    def op(self, instruction: str, a: Register | float, b: Register | float) -> Register:
        """Result of an instruction for two operands of the same type; a truth value for
        comparisons."""
        a = operand(a)
        type_ = BIT if instruction[1:4] == "cmp" else a.type
        return self.new(type_, f"{instruction} {a.typed}, {of_type(a.type, b)}")

    def pick(
        self, test: Register, a: Register | float, b: Register | float, flags: str = ""
    ) -> Register:
        """Select one of two operands of the same type, without a branch."""
        a = operand(a)
        operands = f"{of_type(BIT, test).typed}, {a.typed}, {of_type(a.type, b).typed}"
        return self.new(a.type, f"select{flags} {operands}")

    def converted(self, x: Register, type_: str) -> Register:
        """A whole number or truth value as a real number, or with more or fewer bits."""
        if x.type == type_:
            return x
        bits, wanted = (int(t[1:]) if t[0] == "i" else 0 for t in (x.type, type_))
        if not bits or not (wanted or type_ == REAL):
            raise WrongType(f"{x.typed} where there has to be {type_}")
        how = ("uitofp", "zext") if x.type == BIT else ("sitofp", "sext")
        return self.new(
            type_, f"{'trunc' if 0 < wanted < bits else how[wanted > 0]} {x.typed} to {type_}"
        )

    # -- memory ------------------------------------------------------------------------------------

    def at(self, base: Register, index: Register | int, type_: str) -> Register:
        """Address of an entry of a table."""
        base = of_type(POINTER, base)
        if index == 0:
            return base
        place = of_type(WHOLE, index).typed
        return self.new(POINTER, f"getelementptr {self.within}{type_}, {base.typed}, {place}")

    def load(self, type_: str, address: Register, note: str = "") -> Register:
        """The value at an address."""
        return self.new(type_, f"load {type_}, {of_type(POINTER, address).typed}{note}")

    def store(self, value: Register, address: Register, note: str = "") -> None:
        """Put a value at an address."""
        place = of_type(POINTER, address).typed
        self.lines.append(f"store {value.typed}, {place}{note}")

    def extract(self, value: Register, k: int, type_: str) -> Register:
        """One element of a structure."""
        if not value.type.startswith("{"):
            raise WrongType(f"{value.typed} has no parts")
        return self.new(type_, f"extractvalue {value.typed}, {k}")

    def structure(self, type_: str, parts: list[Register]) -> Register:
        """A structure of parts."""
        made = Register("poison", type_)
        for k, part in enumerate(parts):
            made = self.new(type_, f"insertvalue {made.typed}, {part.typed}, {k}")
        return made

    # -- calls -------------------------------------------------------------------------------------

    def call(
        self, type_: str, function: str, *given: Register, flags: str = "", convention: str = ""
    ) -> Register:
        """The result of a function.

        Parameters
        ----------
        type_ : str
            Of the result.
        function : str
            Its name with @, or the register of its address.
        flags, convention : str
            Fast-math flags, and how it is called if not as functions of C are; each with a space in
            front.
        """
        operands = ", ".join(x.typed for x in given)
        instruction = f"call{flags}{convention} {type_} {function}({operands})"
        if type_ == NOTHING:
            self.lines.append(instruction)
            return Register("", NOTHING)
        return self.new(type_, instruction)

    def outside(
        self, type_: str, name: str, *given: Register | float, flags: str = "", convention: str = ""
    ) -> Register:
        """The result of a function of another module, of LLVM, or of the mathematical library of C.

        Parameters
        ----------
        type_, name, given, flags, convention : str and registers
            As in :meth:`call`; the name without @.
        """
        operands = [operand(x) for x in given]
        kinds = ", ".join(x.type for x in operands)
        group = "" if name.startswith("llvm.") or POINTER in kinds else self.attributes
        declaration = f"declare{convention} {type_} @{name}({kinds}){group}"
        if self.declared.setdefault(name, declaration) != declaration:
            raise WrongType(f"{declaration}, which is a {self.declared[name]}")
        return self.call(type_, f"@{name}", *operands, flags=flags, convention=convention)

    # -- control -----------------------------------------------------------------------------------

    def label(self, hint: str) -> str:
        """A new label."""
        self._count += 1
        return f"{hint}{self._count}"

    def begin(self, label: str) -> None:
        """Begin a block; the one before leads there unless it has ended."""
        self.go(label)
        self.lines.append(f"{label}:")
        self.block = label
        self.ended = False

    def end(self, instruction: str, *labels: str) -> None:
        """End a block, unless it has ended: where that leads."""
        if not self.ended:
            self.lines.append(instruction)
            for label in labels:
                self.leads(label)
        self.ended = True

    def leads(self, label: str) -> None:
        """Note that this place leads to a block; a hook for subclasses."""

    def go(self, label: str) -> None:
        """End a block with a jump."""
        self.end(f"br label %{label}", label)

    def choose(self, test: Register, yes: str, no: str) -> None:
        """End a block with one of two jumps."""
        self.end(f"br {of_type(BIT, test).typed}, label %{yes}, label %{no}", yes, no)
