"""From the syntax tree of a function to assembly: statements, expressions, calls."""

from __future__ import annotations

import ast
import builtins
import inspect
from collections.abc import Callable, Hashable
from functools import cache
from typing import Any, NoReturn

from stickslip.translator import Compiled, calls
from stickslip.translator.assembly import FASTCC, NOTHING, POINTER, WHOLE, Register, operand
from stickslip.translator.definitions import Definition, annotated_type
from stickslip.translator.values import (
    BOOL,
    COMPLEX,
    ENTRIES,
    FLOAT,
    INT,
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
    as_constant,
    joined,
)

_MOST_ROUNDS = 12  # largest number of iterations for the types of variables
_INSTEAD: dict[Any, str] = {
    ast.List: "Use a tuple, or an array that is passed in",
    ast.With: "Do it in the function that calls",
    ast.JoinedStr: "Return a number",
    ast.Starred: "Name the parts",
    **dict.fromkeys((ast.Try, ast.Raise, ast.Assert), "Return a status"),
    **dict.fromkeys((ast.ListComp, ast.GeneratorExp), "Write a loop"),
    **dict.fromkeys((ast.Lambda, ast.FunctionDef), "Write a separate function"),
}


class Function(Values, ast.NodeVisitor):
    """Translates one function for one combination of argument types.

    Parameters
    ----------
    program : Program
        Where other functions are found.
    node : ast.FunctionDef
        What the source says.
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
        self.calls = 0  # calls of functions with side effects
        self.flags = "".join(f" {flag}" for flag in compiled.relaxed)
        self.types: dict[str, Type] = {}
        self.result: Type | None = None
        names = [x for x in ast.walk(node) if isinstance(x, ast.Name)]
        stores = [x.id for x in names if isinstance(x.ctx, ast.Store)]
        stores += [x.arg for x in node.args.args if x.arg in stores]
        self.stores = {name: stores.count(name) for name in stores}
        self.here: ast.AST = node

    def refuse(self, what: str, remedy: str) -> NoReturn:
        """Raise an error with the position in the source."""
        raise self._refusal(what, remedy)

    def refuse_later(self, what: str, remedy: str) -> None:
        """Record an error that is raised at the end, unless a later iteration infers other
        types."""
        self.refusals.append(self._refusal(what, remedy))

    def _refusal(self, what: str, remedy: str) -> Refusal:
        file = self.compiled.python.__code__.co_filename
        line = getattr(self.here, "lineno", self.node.lineno)
        return Refusal(f"{file}:{line}: {self.node.name}: {what}. {remedy}")

    def translated(self) -> Definition:
        """Translate the function, iterating until the types of its variables are fixed."""
        for _ in range(_MOST_ROUNDS):
            self.changed = False
            self.write()
            if not self.changed:
                break
        else:
            self.here = self.node
            self.refuse("the types of variables cannot be inferred", "Annotate or rename them")
        if self.refusals:
            raise self.refusals[0]
        result, given = self.result or NONE, list[tuple[str, str]]()
        if isinstance(result, TupleType):
            given.append(("ptr noalias writeonly captures(none) align 8", "%out"))
        for parameter, type_ in zip(self.node.args.args, self.arguments, strict=True):
            is_tuple = isinstance(type_, TupleType)
            note = " noalias readonly captures(none) align 8" * is_tuple
            given.append((f"{type_.llvm}{note}", _argument(parameter)))
        kind = f"fastcc {NOTHING if isinstance(result, TupleType) else result.llvm}"
        found = self.compiled, self.name, kind, given, self.body(), self.called
        return Definition(*found, self.arguments, result)

    def write(self) -> None:
        """Translate once, with the types that are known."""
        super().__init__()
        self.refusals: list[Refusal] = []
        self.called: set[str] = set()
        self.values: dict[str, Value] = {}
        self.places: dict[str, Register] = {}
        self.assigned: frozenset[str] = frozenset()
        self.ways: dict[str, list[frozenset[str]]] = {}
        self.loops: list[tuple[str, str]] = []  # labels of the next iteration and of the end
        self.unrolled = 0  # number of enclosing loops that are unrolled
        for parameter, type_ in zip(self.node.args.args, self.arguments, strict=True):
            is_tuple = isinstance(type_, TupleType)
            register = Register(_argument(parameter), type_.llvm)
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
        """Reject nodes that are not in the language."""
        self.here = node if hasattr(node, "lineno") else self.here
        remedy = _INSTEAD.get(type(node), "See stickslip.translator for what may be used")
        self.refuse(f"{type(node).__name__} is not in the language", remedy)

    def visit_Pass(self, node: ast.Pass) -> None:
        """Nothing."""

    def visit_Expr(self, node: ast.Expr) -> None:
        """A call, or a docstring."""
        if not isinstance(node.value, ast.Constant):
            self.visit(node.value)

    def visit_Assign(self, node: ast.Assign | ast.AnnAssign) -> None:
        """``a = b = value``, ``a: float = value``."""
        if node.value is None:
            self.refuse("a variable without a value", "Assign one")
        value = self.settled(self.plain(self.visit(node.value)))
        if isinstance(node, ast.AnnAssign) and (said := annotated_type(node.annotation)):
            value = self.cast(value, said)
        for target in [node.target] if isinstance(node, ast.AnnAssign) else node.targets:
            self.assign(target, value)

    visit_AnnAssign = visit_Assign

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        """``a += value``."""
        operation = type(node.op).__name__
        if isinstance(node.target, ast.Subscript):
            array, address = self.entry_of(node.target)
            old = self.read_entry(array, address)
            self.write_entry(array, address, self.binary(operation, old, self.visit(node.value)))
        else:
            old = self.visit(node.target)
            self.assign(node.target, self.binary(operation, old, self.visit(node.value)))

    def assign(self, target: ast.expr, value: Value) -> None:
        """Give a value to a variable, to an entry of an array, or its parts to several of them."""
        if isinstance(target, ast.Name):
            self.assign_name(target.id, value)
        elif isinstance(target, ast.Subscript):
            self.write_entry(*self.entry_of(target), value)
        elif isinstance(target, ast.Tuple):
            parts = self.parts(value)
            if len(parts) != len(target.elts):
                what = f"{len(parts)} values for {len(target.elts)} names"
                self.refuse(what, "Name each of them")
            for inner, part in zip(target.elts, parts, strict=True):
                self.assign(inner, part)
        else:
            self.refuse(f"an assignment to {ast.unparse(target)}", "Make a new tuple")

    def assign_name(self, name: str, value: Value) -> None:
        """Give a value to a variable."""
        self.assigned |= {name}
        once = self.stores[name] == 1 and not self.unrolled
        if value.lasting and once and value.offset is not None:
            self.values[name] = value  # no copy needed: nothing writes to it
            return
        known = self.types.setdefault(name, value.type)
        type_ = joined(known, value.type)
        if type_ is None:
            self.refuse(f"{name} is {known} and {value.type}", "Use two names")
        if type_ != known:
            self.changed = True
            self.types[name] = type_
            self.places.pop(name, None)
        if type_ == NONE:
            self.values[name] = value
            return
        if name not in self.places:
            self.places[name] = self.room(type_)
        self.put(self.cast(value, type_), self.places[name])

    def entry_of(self, node: ast.Subscript) -> tuple[ArrayType, Register]:
        """The entry of an array that is assigned to."""
        array, given = self.visit(node.value), self.indices(node.slice)
        if not isinstance(array.type, ArrayType):
            self.refuse(f"an assignment to a part of {array.type}", "Make a new tuple")
        if array.type.is_constant:
            self.refuse("an assignment to an entry of a constant", "Pass the array in")
        places = [index for index in given if isinstance(index, Value)]
        if len(places) != array.type.axes:
            self.refuse("an assignment to several entries", "Write a loop")
        return array.type, self.entry(array, places)

    def visit_Return(self, node: ast.Return) -> None:
        """The result; all of them have one type."""
        value = Value(NONE) if node.value is None else self.plain(self.visit(node.value))
        type_ = joined(self.result or value.type, value.type)
        declared = annotated_type(self.node.returns)
        if declared is not None and isinstance(value.type, Scalar):
            type_ = declared
        if type_ is None or (type_ == NONE) != (value.type == NONE):
            self.refuse("results of several types", "Return the same type everywhere")
        if type_ != self.result:
            self.changed = self.changed or self.result is not None
            self.result = type_
        value = self.cast(value, type_)
        if isinstance(type_, TupleType):
            self.put(value, Register("%out", POINTER))
        is_in_register = not isinstance(type_, TupleType) and type_ != NONE
        self.end(f"ret {self.in_register(value).register.typed}" if is_in_register else "ret void")

    # -- control -----------------------------------------------------------------------------------
    # A block begins where ways lead to its label, and there the variables are known that have been
    # assigned on all of them.

    def labels(self, *hints: str) -> tuple[str, ...]:
        """New labels."""
        return tuple(map(self.label, hints))

    def leads(self, label: str) -> None:
        """Note that this place leads to a block."""
        self.ways.setdefault(label, []).append(self.assigned)

    def begin(self, label: str) -> None:
        """Begin a block, if anything leads there."""
        self.go(label)
        if label in self.ways:
            super().begin(label)
            self.assigned = frozenset.intersection(*self.ways[label])

    def branch(self, test: ast.expr, yes: str, no: str) -> None:
        """Branch on a condition; constant conditions are resolved without a branch."""
        self.here = test
        if self.ended:
            return
        if isinstance(test, ast.BoolOp):
            every = isinstance(test.op, ast.And)
            for part in test.values[:-1]:
                following = self.label("also")
                self.branch(part, *((following, no) if every else (yes, following)))
                self.begin(following)
            self.branch(test.values[-1], yes, no)
        elif isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not):
            self.branch(test.operand, no, yes)
        elif isinstance(test, ast.Constant) and isinstance(test.value, int):
            self.go(yes if test.value else no)
        else:
            self.choose(self.truth(self.visit(test)).register, yes, no)

    def fork(self, test: ast.expr, yes: Callable[[], None], no: Callable[[], None]) -> None:
        """Do one of two things."""
        then, otherwise, after = self.labels("then", "else", "after")
        self.branch(test, then, otherwise)
        for label, write in ((then, yes), (otherwise, no)):
            self.begin(label)
            if not self.ended:
                write()
            self.go(after)
        self.begin(after)

    def visit_If(self, node: ast.If) -> None:
        """``if``, ``elif``, ``else``."""
        self.fork(
            node.test, lambda: self.statements(node.body), lambda: self.statements(node.orelse)
        )

    def visit_While(self, node: ast.While) -> None:
        """``while``, for ever too."""
        head, inside, after = self.labels("while", "body", "after")
        self.begin(head)
        self.branch(node.test, inside, after)
        self.round(node, inside, head, after)
        self.go(head)
        self.begin(after)

    def round(self, node: ast.While | ast.For, inside: str, again: str, after: str) -> None:
        """The body of a loop: where it begins, its next round begins, and it ends."""
        if node.orelse:
            self.refuse("else of a loop", "Use a variable that says how it ended")
        self.begin(inside)
        self.loops.append((again, after))
        self.statements(node.body)
        self.loops.pop()

    def visit_Break(self, node: ast.Break) -> None:
        """Leave a loop."""
        self.go(self.loops[-1][1])

    def visit_Continue(self, node: ast.Continue) -> None:
        """The next round of a loop."""
        self.go(self.loops[-1][0])

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
            self.count(node, start, ends[-1], step.known, lambda i: i)
            return
        value = self.visit(source)
        if isinstance(value.type, ArrayType):
            value = self.in_register(value)
            ends = self.constant(0), self.length(value, 0)
            self.count(node, *ends, 1, lambda i: self.element(value, [i]))
            return
        self.unrolled += 1
        after = self.label("after")
        for part in [self.settled(part) for part in self.parts(value)]:
            if not self.ended:
                inside, following = self.labels("body", "next")
                self.assign(node.target, part)
                self.round(node, inside, following, after)
                self.begin(following)
        self.begin(after)
        self.unrolled -= 1

    def count(
        self, node: ast.For, start: Value, stop: Value, step: int, item: Callable[[Value], Value]
    ) -> None:
        """A loop over whole numbers.

        Parameters
        ----------
        item : callable
            From the number to what the target gets.
        """
        place = self.slot(WHOLE)
        self.store(start.register, place)
        head, first, inside, following, after = self.labels("for", "first", "body", "next", "after")
        self.begin(head)
        at = self.load(WHOLE, place)
        goes_on = self.op(f"icmp {'slt' if step > 0 else 'sgt'}", at, stop.register)
        self.choose(goes_on, first, after)
        self.begin(first)
        self.assign(node.target, self.settled(item(Value(INT, at))))
        self.round(node, inside, following, after)
        self.begin(following)
        if not self.ended:
            self.store(self.op("add nsw", at, step), place)
        self.go(head)
        self.begin(after)

    # -- expressions -------------------------------------------------------------------------------

    def visit_Constant(self, node: ast.Constant) -> Value:
        """A number."""
        return self.constant(node.value)

    def visit_Name(self, node: ast.Name) -> Value:
        """A variable; else something of the module, or of Python."""
        name = node.id
        if name in self.stores and name not in self.assigned:
            self.here = node
            remedy = "Assign one before, on every way that leads here"
            self.refuse(f"{name} may have no value yet", remedy)
        if name in self.values:
            return self.values[name]
        if name in self.places:
            return self.in_register(Value(self.types[name], self.places[name], 0))
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
        if not isinstance(type_, TupleType) or name not in type_.names:
            self.refuse(f"{type_} has no {name}", "Name one of its parts")
        return self.part(value, type_.names.index(name))

    def visit_Subscript(self, node: ast.Subscript) -> Value:
        """An entry, a row or a slice of an array; a part of a tuple."""
        value, given = self.visit(node.value), self.indices(node.slice)
        if isinstance(value.type, ArrayType):
            return self.element(value, given)
        index = given[0] if len(given) == 1 else None
        if not isinstance(index, Value) or not index.is_known:
            self.refuse("a part of a tuple that is not a constant", "Unpack it, or use an array")
        is_constant = value.type == PYTHON and isinstance(value.known, tuple)
        parts = value.known if is_constant else self.parts(value)
        if not -len(parts) <= index.known < len(parts):
            self.refuse(f"part {index.known} of {len(parts)}", "Count from 0")
        return self.constant(parts[index.known]) if is_constant else parts[index.known]

    def indices(self, node: ast.expr) -> list[Index]:
        """The index in brackets."""
        found = list[Index]()
        for part in node.elts if isinstance(node, ast.Tuple) else [node]:
            if found and not isinstance(found[-1], Value):
                self.refuse("a slice that is not in the last place", "Write a loop")
            if not isinstance(part, ast.Slice):
                found.append(self.index(part))
                continue
            if part.step is not None:
                self.refuse("a slice with a step", "Write a loop")
            low = self.index(part.lower) if part.lower else None
            found.append((low, self.index(part.upper) if part.upper else None))
        return found

    def index(self, node: ast.expr) -> Value:
        """An index."""
        value = self.visit(node)
        if value.type not in (INT, BOOL):
            self.refuse(f"{value.type} as an index", "Use a whole number")
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
        if isinstance(node.op, ast.UAdd) and value.type in (BOOL, INT, FLOAT, COMPLEX):
            return self.cast(value, INT) if value.type == BOOL else value
        return self.generic_visit(node.op)

    def visit_BinOp(self, node: ast.BinOp) -> Value:
        """Arithmetic."""
        left, right = self.visit(node.left), self.visit(node.right)
        return self.binary(type(node.op).__name__, left, right)

    def visit_BoolOp(self, node: ast.BoolOp) -> Value:
        """``a and b``, ``a or b``, of truth values."""
        for part in node.values:
            if (kind := self.type_of(part)) != BOOL:
                self.refuse(f"and, or of {kind} as a value", "Write comparisons")
        return self.visit_IfExp(ast.IfExp(node, ast.Constant(True), ast.Constant(False)))

    def type_of(self, node: ast.expr) -> Type:
        """The type of an expression, without writing code for it."""
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
            self.refuse(f"either {kinds[0]} or {kinds[1]}", "Give both one type")
        place = self.room(type_)

        def put(part: ast.expr) -> Callable[[], None]:
            return lambda: self.put(self.cast(self.visit(part), type_), place)

        self.fork(node.test, put(node.body), put(node.orelse))
        return self.in_register(Value(type_, place, 0))

    def visit_Compare(self, node: ast.Compare) -> Value:
        """Comparisons, one after the other; all of them are made."""
        left, found = self.visit(node.left), None
        for operation, right in zip(node.ops, node.comparators, strict=True):
            before = self.calls
            value = self.visit(right)
            if found is not None and self.calls > before:
                self.refuse("a call that Python may leave out", "Call it before the comparison")
            if isinstance(operation, (ast.In, ast.NotIn)):
                this = self.constant(False)
                for part in self.parts(value):
                    same = self.compare("Eq", left, part)
                    this = Value(BOOL, self.op("or", this.register, same.register))
                this = self.inverted(this) if isinstance(operation, ast.NotIn) else this
            else:
                this = self.compare(type(operation).__name__, left, value)
            left = value
            found = this if found is None else self.either(found, this, self.constant(False))
        assert found is not None
        return found

    # -- calls -------------------------------------------------------------------------------------

    def visit_Call(self, node: ast.Call) -> Value:
        """A call of something that the language knows."""
        if isinstance(node.func, ast.Attribute) and node.func.attr == "conjugate":
            value = self.visit(node.func.value)
            if value.type == COMPLEX and not node.args and not node.keywords:
                re, im = self.split(value)
                return self.complex(re, self.opposite(im))
        function = self.visit(node.func)
        given = [self.visit(x) for x in node.args]
        keywords = {x.arg: self.visit(x.value) for x in node.keywords if x.arg}
        self.here = node
        if isinstance(function.type, FunctionType) and not keywords:
            return self.call_outside(function, given)
        target: Any = function.known
        if isinstance(target, Compiled):
            names = _signature(target.python).parameters
            return self.call_compiled(target, self.in_order(names, given, keywords))
        if isinstance(target, type) and hasattr(target, "_fields"):
            return self.tuple_of(target, self.in_order(target._fields, given, keywords))
        name = ast.unparse(node.func)
        make = calls.CALLS.get(target) if isinstance(target, Hashable) else None
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
        self.calls += target.__module__ != calls.__name__
        types = [x.type for x in given]
        callee: Definition = self.program.definition(target, [as_constant(x, False) for x in types])
        try:
            callee = self.program.definition(target, types)
        except Refusal:
            what = f"a constant array for {target.__name__}, which may write to it"
            self.refuse(what, "Pass in a copy")
        self.called.add(callee.name)
        pairs = zip(given, callee.arguments, strict=True)
        operands = [self.operand(self.cast(value, type_)) for value, type_ in pairs]
        name = f'@"{callee.name}"'
        if isinstance(callee.result, TupleType):
            out = self.room(callee.result)
            self.call(NOTHING, name, out, *operands, convention=FASTCC)
            return Value(callee.result, out, 0)
        made = self.call(callee.result.llvm, name, *operands, convention=FASTCC)
        return Value(callee.result, made)

    def call_outside(self, function: Value, given: list[Value]) -> Value:
        """Call a function by its address, or by its name if the program knows one."""
        type_: FunctionType = function.type
        if len(given) != len(type_.arguments):
            self.refuse(f"{type_} takes {len(type_.arguments)} arguments", "Give as many")
        self.calls += 1
        pairs = zip(given, type_.arguments, strict=True)
        operands = [self.outward(self.cast(x, wanted)) for x, (_, wanted) in pairs]
        if type_.kind in self.program.direct:
            name = self.program.direct[type_.kind]
            return Value(type_.result, self.outside(type_.result.llvm, name, *operands))
        address = self.operand(function)
        return Value(type_.result, self.call(type_.result.llvm, str(address), *operands))

    def runtime(self, name: str, *given: Value) -> Value:
        """Call the function of an operator for which LLVM has no instruction."""
        return self.call_compiled(getattr(calls, name), list(given))

    def table(self, array: Any) -> Value:
        """A constant array."""
        if f"{array.dtype.kind}{array.dtype.itemsize}" not in ENTRIES:
            self.refuse(f"a constant array of {array.dtype}", "Convert its entries")
        name, type_ = self.program.table(array)
        lengths = [operand(n) for n in array.shape]
        return Value(type_, self.structure(type_.llvm, [Register(name, POINTER), *lengths]))


@cache
def _signature(function: Callable[..., Any]) -> inspect.Signature:
    return inspect.signature(function)


def _argument(parameter: ast.arg) -> str:
    """Name of a parameter in the assembly, distinct from all other names there."""
    return f'%"{parameter.arg}."'
