"""From the syntax tree of a function to assembly: statements, expressions, calls."""

from __future__ import annotations

import ast
import builtins
import inspect
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple, NoReturn

from stickslip.translator import Compiled
from stickslip.translator.assembly import (
    BIT,
    NOTHING,
    POINTER,
    WHOLE,
    Register,
    whole,
)
from stickslip.translator.calls import CALLS, REAL_CALLS
from stickslip.translator.values import (
    BOOL,
    COMPLEX,
    ENTRIES,
    FLOAT,
    INT,
    NAMED,
    NONE,
    PYTHON,
    ArrayType,
    FunctionType,
    Index,
    Refusal,
    Scalar,
    TupleType,
    Type,
    Value,
    Values,
    joined,
    named,
    passed,
)

_RUNTIME_MODULE = "stickslip.translator.runtime"
_MOST_ROUNDS = 12  # in which the types of variables have to settle
_INSTEAD: dict[Any, str] = {
    ast.List: "Use a tuple, or an array that is passed in",
    ast.ListComp: "Write a loop",
    ast.GeneratorExp: "Write a loop",
    ast.Try: "Return a status",
    ast.Raise: "Return a status",
    ast.Assert: "Return a status",
    ast.With: "Do it in the function that calls",
    ast.Lambda: "Write a function of its own",
    ast.FunctionDef: "Write a function of its own",
    ast.JoinedStr: "Return a number",
    ast.Starred: "Name the parts",
}


class Signature(NamedTuple):
    """How a function of the assembly is called."""

    name: str
    result: Type
    arguments: tuple[Type, ...]

    @property
    def returned(self) -> str:
        """LLVM's type of the result; a tuple is written to memory."""
        return NOTHING if isinstance(self.result, TupleType) else self.result.llvm


class Definition(NamedTuple):
    """A function in the assembly.

    Attributes
    ----------
    name : str
    result : str
        With the calling convention.
    parameters : list of (str, str)
        Types with what is known of them, and names.
    body : str
    file : str
        The source.
    inline : bool
        Whether it is inlined wherever it is called.
    called : set of str
        Names of what it calls.
    brief : bool
        Whether its loops have few rounds.
    """

    name: str
    result: str
    parameters: list[tuple[str, str]]
    body: str
    file: str
    inline: bool
    called: set[str]
    brief: bool = False

    def text(self, linkage: str, note: str = "") -> str:
        """The definition."""
        given = ", ".join(f"{kind} {name}" for kind, name in self.parameters)
        note = (" alwaysinline" if self.inline else note) + " optsize" * self.brief
        kind = f"{linkage} {self.result}".strip()
        head = f'define {kind} @"{self.name}"({given}) #0{note}'
        return f"{head} {{\n{self.body}}}\n"

    @property
    def declaration(self) -> str:
        """What other modules know of it."""
        kinds = ", ".join(kind for kind, _ in self.parameters)
        return f'declare {self.result} @"{self.name}"({kinds}) #0'

    @property
    def length(self) -> int:
        """Lines."""
        return self.body.count("\n")


class Loop(NamedTuple):
    """A loop around what is being written: where its next round begins and where it ends, and what
    has been assigned wherever it is left or goes on."""

    again: str
    after: str
    left: list[set[str]]
    continued: list[set[str]]


class Function(Values, ast.NodeVisitor):
    """Translates one function for one combination of argument types.

    Parameters
    ----------
    program : Program
        Where other functions are found.
    compiled : Compiled
    node : ast.FunctionDef
        What the source says.
    arguments : tuple of Type
    name : str
        In the assembly.
    """

    def __init__(
        self,
        program: Any,
        compiled: Compiled,
        node: ast.FunctionDef,
        arguments: tuple[Type, ...],
        name: str,
    ) -> None:
        super().__init__()
        self.program = program
        self.compiled = compiled
        self.node = node
        self.arguments = arguments
        self.name = name
        self.called: set[str] = set()
        self.calls = 0  # of functions that may do something
        self.flags = "".join(f" {flag}" for flag in compiled.relaxed)
        self.types: dict[str, Type] = {}
        self.result: Type | None = None
        hint = node.returns and self.hint(node.returns)
        self.promised = NAMED.get(hint)
        stores = [x.id for x in ast.walk(node) if isinstance(x, ast.Name) and not _is_read(x)]
        stores += [x.arg for x in node.args.args if x.arg in stores]
        self.stores = {name: stores.count(name) for name in stores}
        self.here: ast.AST = node

    def hint(self, node: ast.expr) -> Any:
        """What an annotation says, if it names a number or nothing."""
        return {
            "int": int,
            "float": float,
            "bool": bool,
            "complex": complex,
            "None": type(None),
        }.get(ast.unparse(node))

    def refuse(self, what: str, remedy: str) -> NoReturn:
        """Refuse, and say where."""
        code = self.compiled.python.__code__
        line = getattr(self.here, "lineno", self.node.lineno)
        raise Refusal(f"{code.co_filename}:{line}: {self.node.name}: {what}. {remedy}")

    def translated(self) -> tuple[Signature, Definition]:
        """How the function is called, and what it is."""
        for _ in range(_MOST_ROUNDS):
            self.changed = False
            self.write()
            if not self.changed:
                break
        else:
            self.here = self.node
            self.refuse("types of variables do not settle", "Annotate or rename them")
        signature = Signature(self.name, self.result or NONE, self.arguments)
        given = [("ptr noalias writeonly captures(none) align 8", "%out")]
        given = given if isinstance(signature.result, TupleType) else []
        for parameter, type_ in zip(self.node.args.args, self.arguments, strict=True):
            is_tuple = isinstance(type_, TupleType)
            note = " noalias readonly captures(none) align 8" if is_tuple else ""
            given.append((f"{passed(type_)}{note}", _argument(parameter.arg)))
        return signature, Definition(
            self.name,
            f"fastcc {signature.returned}",
            given,
            self.body(),
            self.compiled.python.__code__.co_filename,
            self.compiled.inline,
            self.called,
            self.compiled.brief,
        )

    def write(self) -> None:
        """One round, with the types that are known."""
        super().__init__()
        self.called = set()
        self.values: dict[str, Value] = {}
        self.places: dict[str, Register] = {}
        self.assigned: set[str] = set()
        self.loops: list[Loop] = []
        self.unrolled = 0  # loops around this place that are written round by round
        for parameter, type_ in zip(self.node.args.args, self.arguments, strict=True):
            register = Register(_argument(parameter.arg), passed(type_))
            is_tuple = isinstance(type_, TupleType)
            value = Value(type_, register, 0 if is_tuple else None, lasting=is_tuple)
            if parameter.arg in self.stores:
                self.assign_name(parameter.arg, value)
            else:
                self.values[parameter.arg] = value
        self.statements(self.node.body)
        if not self.ended:
            if self.result not in (None, NONE):
                self.here = self.node.body[-1]
                self.refuse("it may end without a result", "Return something at the end")
            self.result = NONE
            self.end("ret void")

    # -- statements --------------------------------------------------------------------------------

    def statements(self, statements: list[ast.stmt]) -> None:
        """Statements up to the first that leaves."""
        for statement in statements:
            if not self.ended:
                self.here = statement
                self.visit(statement)

    def generic_visit(self, node: ast.AST) -> Any:
        """Refuse what is not in the language."""
        self.here = node if hasattr(node, "lineno") else self.here
        remedy = _INSTEAD.get(type(node), "See stickslip.translator for what may be used")
        self.refuse(f"{type(node).__name__} is not in the language", remedy)

    def visit_Pass(self, node: ast.Pass) -> None:
        """Nothing."""

    def visit_Expr(self, node: ast.Expr) -> None:
        """A call, or a docstring."""
        if not isinstance(node.value, ast.Constant):
            self.visit(node.value)

    def visit_Assign(self, node: ast.Assign) -> None:
        """``a = b = value``."""
        value = self.settled(self.plain(self.visit(node.value)))
        for target in node.targets:
            self.assign(target, value)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        """``a: float = value``."""
        if node.value is None:
            self.refuse("a variable without a value", "Assign one")
        value = self.settled(self.plain(self.visit(node.value)))
        said = NAMED.get(self.hint(node.annotation))
        self.assign(node.target, self.cast(value, said) if said else value)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        """``a += value``."""
        operation = type(node.op).__name__
        if isinstance(node.target, ast.Attribute):
            self.refuse(f"an assignment to {ast.unparse(node.target)}", "Make a new tuple")
        if isinstance(node.target, ast.Subscript):
            array, address = self.entry_of(node.target)
            old = self.read_entry(array, address)
            self.write_entry(array, address, self.binary(operation, old, self.visit(node.value)))
            return
        old = self.visit(ast.copy_location(_as_read(node.target), node))
        self.assign(node.target, self.binary(operation, old, self.visit(node.value)))

    def assign(self, target: ast.expr, value: Value) -> None:
        """Give a value to a variable, to an entry of an array, or its parts to several of them."""
        if isinstance(target, ast.Name):
            self.assign_name(target.id, value)
        elif isinstance(target, ast.Subscript):
            array, address = self.entry_of(target)
            self.write_entry(array, address, value)
        elif isinstance(target, ast.Tuple):
            parts = self.parts(value)
            if len(parts) != len(target.elts):
                self.refuse(
                    f"{len(parts)} values for {len(target.elts)} names", "Name each of them"
                )
            for inner, part in zip(target.elts, parts, strict=True):
                self.assign(inner, part)
        else:
            self.refuse(f"an assignment to {ast.unparse(target)}", "Assign to a name or an entry")

    def assign_name(self, name: str, value: Value) -> None:
        """Give a value to a variable."""
        self.assigned.add(name)
        once = self.stores.get(name) == 1 and not self.unrolled
        if value.lasting and once and value.offset is not None:
            self.values[name] = value  # it may stay where it is: nothing writes there
            return
        known = self.types.get(name)
        type_ = value.type if known is None else joined(known, value.type)
        if type_ is None:
            both = f"{named(known)} and {named(value.type)}"  # pyright: ignore[reportArgumentType]
            self.refuse(f"{name} is {both}", "Use two names")
        if type_ != known:
            self.changed = self.changed or known is not None
            self.types[name] = type_
            self.places.pop(name, None)
        if type_ == NONE:
            self.values[name] = value
            return
        if name not in self.places:
            self.places[name] = self.room(type_)
        self.keep(self.cast(value, type_), self.places[name])

    def entry_of(self, node: ast.Subscript) -> tuple[ArrayType, Register]:
        """The entry of an array that is assigned to."""
        array = self.visit(node.value)
        given = self.indices(node.slice)
        if self.is_constant(node):
            self.refuse("an assignment to an entry of a constant", "Pass the array in")
        if not isinstance(array.type, ArrayType):
            self.refuse(f"an assignment to a part of {named(array.type)}", "Make a new tuple")
        places = [index.value for index in given if index.value is not None]
        if len(places) != array.type.axes:
            self.refuse("an assignment to several entries", "Write a loop")
        return array.type, self.entry(array, places)

    def is_constant(self, node: ast.expr) -> bool:
        """Whether something is a part of what the module has."""
        while isinstance(node, (ast.Subscript, ast.Attribute)):
            node = node.value
        known = isinstance(node, ast.Name) and (node.id in self.stores or node.id in self.values)
        return isinstance(node, ast.Name) and not known

    def visit_Return(self, node: ast.Return) -> None:
        """The result; all of them have one type."""
        value = Value(NONE) if node.value is None else self.plain(self.visit(node.value))
        type_ = value.type if self.result is None else joined(self.result, value.type)
        if self.promised is not None and isinstance(value.type, Scalar):
            type_ = self.promised
        if type_ is None or (type_ == NONE) != (value.type == NONE):
            self.refuse("results of several types", "Return the same type everywhere")
        if type_ != self.result:
            self.changed = self.changed or self.result is not None
            self.result = type_
        value = self.cast(value, type_)
        if type_ == NONE:
            self.end("ret void")
        elif isinstance(type_, TupleType):
            self.put(value, Register("%out", POINTER), 0)
            self.end("ret void")
        else:
            self.end(f"ret {self.in_register(value).register.typed}")

    # -- control -----------------------------------------------------------------------------------

    def visit_If(self, node: ast.If) -> None:
        """``if``, ``elif``, ``else``."""
        then, otherwise, after = map(self.label, ("then", "else", "after"))
        self.branch(node.test, then, otherwise)
        before, ways = set(self.assigned), list[set[str]]()
        for label, statements in ((then, node.body), (otherwise, node.orelse)):
            self.ended = True
            self.begin(label)
            self.assigned = set(before)
            self.statements(statements)
            if not self.ended:
                ways.append(self.assigned)
                self.go(after)
        self.meet(after, ways)

    def meet(self, after: str, ways: list[set[str]]) -> None:
        """Go on where ways meet, if any leads there, with the variables that all have assigned."""
        if ways:
            self.begin(after)
            self.assigned = set.intersection(*ways)

    def join(self, after: str, ways: list[set[str]]) -> None:
        """The same, where the way from here leads there, too."""
        if not self.ended:
            ways.append(set(self.assigned))
            self.go(after)
        self.meet(after, ways)

    def visit_While(self, node: ast.While) -> None:
        """``while``, for ever too."""
        head, inside, after = map(self.label, ("while", "body", "after"))
        endless = isinstance(node.test, ast.Constant) and bool(node.test.value)
        self.begin(head)
        if endless:
            self.go(inside)
        else:
            self.branch(node.test, inside, after)
        ways = [] if endless else [set(self.assigned)]
        self._round(node, inside, Loop(head, after, ways, []))
        self.go(head)
        self.meet(after, ways)

    def _round(self, node: ast.While | ast.For, inside: str, loop: Loop) -> None:
        """The body of a loop."""
        if node.orelse:
            self.refuse("else of a loop", "Use a variable that says how it ended")
        self.ended = True
        self.begin(inside)
        self.loops.append(loop)
        self.statements(node.body)
        self.loops.pop()

    def visit_Break(self, node: ast.Break) -> None:
        """Leave a loop."""
        self.loops[-1].left.append(set(self.assigned))
        self.go(self.loops[-1].after)

    def visit_Continue(self, node: ast.Continue) -> None:
        """The next round of a loop."""
        self.loops[-1].continued.append(set(self.assigned))
        self.go(self.loops[-1].again)

    def visit_For(self, node: ast.For) -> None:
        """``for`` over a range, the entries or rows of an array, or the parts of a tuple."""
        source = node.iter
        if isinstance(source, ast.Call) and ast.unparse(source.func) == "range":
            if source.keywords or not 1 <= len(source.args) <= 3:
                self.refuse("a range with such arguments", "Give one to three numbers")
            ends = [self.cast(self.visit(x), INT) for x in source.args]
            step = ends.pop() if len(ends) == 3 else self.constant(1)
            if not step.is_known or step.known == 0:
                self.refuse("a range whose step is not constant", "Use while")
            start = ends[0] if len(ends) == 2 else self.constant(0)
            self._loop_of(node, start, ends[-1], step.known, lambda i: i)
            return
        value = self.visit(source)
        if isinstance(value.type, ArrayType):
            value = self.in_register(value)
            first = self.constant(0), self.length(value, 0)
            self._loop_of(node, *first, 1, lambda i: self.element(value, [Index(i)]))
            return
        self.unrolled += 1
        after = self.label("after")
        ways = list[set[str]]()
        for part in [self.settled(part) for part in self.parts(value)]:
            if not self.ended:
                inside, following = self.label("body"), self.label("next")
                loop = Loop(following, after, ways, [])
                self.assign(node.target, part)
                self.go(inside)
                self._round(node, inside, loop)
                self.join(following, loop.continued)
        self.join(after, ways)
        self.unrolled -= 1

    def _loop_of(
        self, node: ast.For, start: Value, stop: Value, step: int, item: Callable[[Value], Value]
    ) -> None:
        """A loop over whole numbers.

        Parameters
        ----------
        node : ast.For
        start, stop : Value
        step : int
        item : callable
            From the number to what the target gets.
        """
        place = self.slot(WHOLE)
        self.store(start.register, place)
        head, inside, following, after = map(self.label, ("for", "body", "next", "after"))
        self.begin(head)
        at = self.load(WHOLE, place)
        test = self.new(BIT, f"icmp {'slt' if step > 0 else 'sgt'} i64 {at}, {stop.register}")
        ways = [set(self.assigned)]
        first = self.label("first")
        self.choose(test, first, after)
        self.begin(first)
        self.assign(node.target, self.settled(item(Value(INT, at))))
        self.go(inside)
        self._round(node, inside, Loop(following, after, ways, []))
        self.begin(following)
        self.store(self.new(WHOLE, f"add nsw i64 {at}, {step}"), place)
        self.go(head)
        self.meet(after, ways)

    def branch(self, test: ast.expr, yes: str, no: str) -> None:
        """Go one of two ways; what decides nothing is not looked at."""
        self.here = test
        if isinstance(test, ast.BoolOp):
            every = isinstance(test.op, ast.And)
            for part in test.values[:-1]:
                following = self.label("also")
                self.branch(part, *((following, no) if every else (yes, following)))
                self.begin(following)
            self.branch(test.values[-1], yes, no)
        elif isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not):
            self.branch(test.operand, no, yes)
        else:
            self.choose(self.truth(self.visit(test)).register, yes, no)

    # -- expressions -------------------------------------------------------------------------------

    def visit_Constant(self, node: ast.Constant) -> Value:
        """A number."""
        return self.constant(node.value)

    def visit_Name(self, node: ast.Name) -> Value:
        """A variable; else something of the module, or of Python."""
        name = node.id
        if name in self.stores and name not in self.assigned:
            self.here = node
            self.refuse(
                f"{name} may have no value yet", "Assign one before, on every way that leads here"
            )
        if name in self.values:
            return self.values[name]
        if name in self.places:
            return self.kept(self.types[name], self.places[name])
        space = self.compiled.python.__globals__
        if name not in space and not hasattr(builtins, name):
            self.refuse(f"{name} is not known", "Define or import it in the module")
        return self.constant(space[name] if name in space else getattr(builtins, name))

    def visit_Tuple(self, node: ast.Tuple) -> Value:
        """``a, b``."""
        return self.tuple_of(tuple, [self.visit(part) for part in node.elts])

    def visit_Attribute(self, node: ast.Attribute) -> Value:
        """A part of a named tuple, of a complex number, or of a module; the lengths of an array."""
        value, name = self.visit(node.value), node.attr
        type_ = value.type
        if type_ == PYTHON:
            if not hasattr(value.known, name):
                self.refuse(f"{ast.unparse(node)} is not known", "Define it, or name another")
            return self.constant(getattr(value.known, name))
        if type_ == COMPLEX and name in ("real", "imag"):
            return Value(FLOAT, self.split(value)[name == "imag"])
        if isinstance(type_, ArrayType) and name == "shape":
            return self.tuple_of(tuple, [self.length(value, k) for k in range(type_.axes)])
        fields = getattr(type_.kind, "_fields", ()) if isinstance(type_, TupleType) else ()
        if name not in fields:
            self.refuse(f"{named(type_)} has no {name}", "Name one of its parts")
        return self.part(value, fields.index(name))

    def visit_Subscript(self, node: ast.Subscript) -> Value:
        """An entry, a row or a slice of an array; a part of a tuple."""
        value, given = self.visit(node.value), self.indices(node.slice)
        if isinstance(value.type, ArrayType):
            return self.element(value, given)
        index = given[0].value if len(given) == 1 else None
        if index is None or not index.is_known:
            self.refuse("a part of a tuple that is not a constant", "Unpack it, or use an array")
        is_constant = value.type == PYTHON and isinstance(value.known, tuple)
        parts = value.known if is_constant else self.parts(value)
        if not -len(parts) <= index.known < len(parts):
            self.refuse(f"part {index.known} of {len(parts)}", "Count from 0")
        return self.constant(parts[index.known]) if is_constant else parts[index.known]

    def indices(self, node: ast.expr) -> list[Index]:
        """What stands in brackets."""
        found = list[Index]()
        for part in node.elts if isinstance(node, ast.Tuple) else [node]:
            if found and found[-1].slice is not None:
                self.refuse("a slice that is not in the last place", "Write a loop")
            if isinstance(part, ast.Slice):
                if part.step is not None:
                    self.refuse("a slice with a step", "Write a loop")
                ends = [None if x is None else self.index(x) for x in (part.lower, part.upper)]
                found.append(Index(None, (ends[0], ends[1])))
            else:
                found.append(Index(self.index(part)))
        return found

    def index(self, node: ast.expr) -> Value:
        """An index."""
        value = self.visit(node)
        if value.type not in (INT, BOOL):
            self.refuse(f"{named(value.type)} as an index", "Use a whole number")
        if isinstance(node, ast.UnaryOp) and not value.is_known:
            self.refuse("an index that is negative", "Subtract it from the length")
        return self.cast(value, INT)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Value:
        """``-a``, ``+a``, ``not a``."""
        value = self.visit(node.operand)
        if isinstance(node.op, ast.Not):
            return self.inverted(self.truth(value))
        if isinstance(node.op, ast.USub):
            return self.negative(value)
        if isinstance(node.op, ast.UAdd) and value.type in (BOOL, INT):
            return self.cast(value, INT)
        if isinstance(node.op, ast.UAdd) and value.type in (FLOAT, COMPLEX):
            return value
        return self.generic_visit(node.op)

    def visit_BinOp(self, node: ast.BinOp) -> Value:
        """Arithmetic."""
        left, right = self.visit(node.left), self.visit(node.right)
        return self.binary(type(node.op).__name__, left, right)

    def visit_BoolOp(self, node: ast.BoolOp) -> Value:
        """``a and b``, ``a or b``, of truth values."""
        for part in node.values:
            if (kind := self.type_of(part)) != BOOL:
                self.refuse(f"and, or of {named(kind)} as a value", "Write comparisons")
        place = self.slot(BIT)
        yes, no, after = map(self.label, ("yes", "no", "after"))
        self.branch(node, yes, no)
        for label, value in ((yes, True), (no, False)):
            self.ended = True
            self.begin(label)
            self.store(self.constant(value).register, place)
            self.go(after)
        self.begin(after)
        return Value(BOOL, self.load(BIT, place))

    def type_of(self, node: ast.expr) -> Type:
        """The type of an expression, of which nothing is written."""
        kept = len(self.lines), len(self.slots), self.block, self.ended
        type_ = self.plain(self.visit(node)).type
        del self.lines[kept[0] :], self.slots[kept[1] :]
        _, _, self.block, self.ended = kept
        return type_

    def visit_IfExp(self, node: ast.IfExp) -> Value:
        """``a if test else b``."""
        kinds = self.type_of(node.body), self.type_of(node.orelse)
        type_ = joined(*kinds)
        if type_ in (None, NONE):
            self.refuse(f"either {named(kinds[0])} or {named(kinds[1])}", "Give both one type")
        place = self.room(type_)
        then, otherwise, after = map(self.label, ("then", "else", "after"))
        self.branch(node.test, then, otherwise)
        for label, part in ((then, node.body), (otherwise, node.orelse)):
            self.ended = True
            self.begin(label)
            self.keep(self.cast(self.visit(part), type_), place)
            self.go(after)
        self.begin(after)
        return self.kept(type_, place)

    def visit_Compare(self, node: ast.Compare) -> Value:
        """Comparisons, one after the other; all of them are made."""
        left, found = self.visit(node.left), None
        for operation, right in zip(node.ops, node.comparators, strict=True):
            calls = self.calls
            value = self.visit(right)
            if found is not None and self.calls > calls:
                self.refuse("a call that Python may leave out", "Call it before the comparison")
            if isinstance(operation, (ast.In, ast.NotIn)):
                this = self.constant(False)
                for part in self.parts(value):
                    same = self.compare("Eq", left, part)
                    this = self.bit(f"or i1 {this.register}, {same.register}")
                this = self.inverted(this) if isinstance(operation, ast.NotIn) else this
            else:
                this = self.compare(type(operation).__name__, left, value)
            left = value
            found = this if found is None else self.both(found, this)
        assert found is not None
        return found

    def both(self, a: Value, b: Value) -> Value:
        """Whether two things hold."""
        return self.bit(f"select i1 {a.register}, i1 {b.register}, i1 false")

    # -- calls -------------------------------------------------------------------------------------

    def visit_Call(self, node: ast.Call) -> Value:
        """A call of something that the language knows."""
        if isinstance(node.func, ast.Attribute) and node.func.attr == "conjugate":
            value = self.visit(node.func.value)
            if value.type == COMPLEX and not node.args and not node.keywords:
                re, im = self.split(value)
                return self.complex(re, self.real_op("fneg", im))
        function = self.visit(node.func)
        given = [self.visit(x) for x in node.args]
        keywords = {x.arg: self.visit(x.value) for x in node.keywords if x.arg}
        self.here = node
        if isinstance(function.type, FunctionType) and not keywords:
            return self.call_outside(function, function.type, given)
        target: Any = function.known
        if isinstance(target, Compiled):
            names = _signature(target.python).parameters
            return self.call_compiled(target, self.in_order(names, given, keywords))
        if isinstance(target, type) and hasattr(target, "_fields"):
            return self.tuple_of(target, self.in_order(target._fields, given, keywords))
        name = ast.unparse(node.func)
        try:
            make = REAL_CALLS.get(target) or CALLS.get(target)
        except TypeError:  # it cannot be looked up
            make = None
        if make is None:
            self.refuse(f"a call of {name}", "Mark it as compiled, or write it out")
        try:
            _signature(make).bind(self, *given, **keywords)
        except TypeError:
            self.refuse(f"a call of {name} with such arguments", "Give what it takes, in order")
        return make(self, *given)

    def in_order(self, names: Any, given: list[Value], keywords: dict[str, Value]) -> list[Value]:
        """Arguments in the order of the parameters."""
        left = list(names)[len(given) :]
        if len(given) > len(names) or set(left) != set(keywords):
            self.refuse(f"other arguments than {', '.join(names)}", "Give exactly these")
        return [*given, *(keywords[name] for name in left)]

    def call_compiled(self, target: Compiled, given: list[Value]) -> Value:
        """Call another function of the language."""
        given = [self.plain(x) for x in given]
        if any(x.type == NONE for x in given):
            self.refuse("None as an argument", "Use a number")
        self.calls += target.__module__ != _RUNTIME_MODULE
        signature = self.program.signature(target, tuple(x.type for x in given))
        self.called.add(signature.name)
        operands = list[Register]()
        for value, type_ in zip(given, signature.arguments, strict=True):
            value = self.cast(value, type_)
            is_tuple = isinstance(type_, TupleType)
            operands.append(self.in_memory(value) if is_tuple else self.in_register(value).register)
        name = f'@"{signature.name}"'
        if isinstance(signature.result, TupleType):
            out = self.room(signature.result)
            self.call(NOTHING, name, out, *operands, convention=" fastcc")
            return Value(signature.result, out, 0)
        made = self.call(signature.returned, name, *operands, convention=" fastcc")
        return Value(signature.result, made)

    def call_outside(self, function: Value, type_: FunctionType, given: list[Value]) -> Value:
        """Call a function by its address, or by its name if the program knows one."""
        if len(given) != len(type_.arguments):
            self.refuse(f"{type_.name} takes {len(type_.arguments)} arguments", "Give as many")
        self.calls += 1
        pairs = zip(given, type_.arguments, strict=True)
        operands = [self.outward(self.cast(x, wanted)) for x, (_, wanted) in pairs]
        if type_.kind in self.program.direct:
            name = self.program.direct[type_.kind]
            return Value(type_.result, self.outside(type_.result.llvm, name, *operands))
        address = self.in_register(function).register
        return Value(type_.result, self.call(type_.result.llvm, str(address), *operands))

    def runtime(self, name: str, *given: Value) -> Value:
        """Call what Python's operators mean where LLVM has no instruction for it."""
        from stickslip.translator import runtime

        return self.call_compiled(getattr(runtime, name), list(given))

    def table(self, array: Any) -> Value:
        """A constant array."""
        if f"{array.dtype.kind}{array.dtype.itemsize}" not in ENTRIES:
            self.refuse(f"a constant array of {array.dtype}", "Convert its entries")
        name, type_ = self.program.table(array)
        lengths = [whole(n) for n in array.shape]
        return Value(type_, self.structure(type_.llvm, [Register(name, POINTER), *lengths]))


@cache
def _signature(function: Callable[..., Any]) -> inspect.Signature:
    return inspect.signature(function)


def _argument(name: str) -> str:
    """What a parameter is called in the assembly: like nothing else there."""
    return f'%"{name}."'


def _is_read(name: ast.Name) -> bool:
    return isinstance(name.ctx, ast.Load)


def _as_read(target: ast.expr) -> ast.expr:
    assert isinstance(target, ast.Name)
    return ast.Name(target.id, ast.Load())
