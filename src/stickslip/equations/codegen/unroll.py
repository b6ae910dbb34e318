"""Partial evaluation of generated code: the loop over the orders of a Taylor series, written out
order by order.

The recurrences of :mod:`stickslip.equations.codegen.series` are sums whose lengths are known once
the order is. Written out, with every coefficient in a variable of its own, they run about three
times as fast as loops. They are taken from their own source text, so that the mathematics is said
once.
"""

from __future__ import annotations

import ast
import inspect
import operator
from collections.abc import Collection
from copy import deepcopy
from functools import cache, reduce

from stickslip.equations.codegen import series
from stickslip.equations.codegen.generate import ORDERS

Names = dict[str, ast.expr]
_ARITHMETIC = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_COMPARISONS = {ast.Eq: operator.eq, ast.Gt: operator.gt, ast.GtE: operator.ge}


_MOST_PRODUCTS = 4000  # beyond this, the code would take too long to compile
_STRANDS = 4  # in which long sums are added up, so that no instruction waits long for another
_SUMS = tuple(f"{name}_order" for name in "product divide inverse power exp log chain".split())


def written_out(source: str) -> str:
    """The module of a system with the loop of its ``jets`` written out, where that makes it faster.

    It does where the series contain products of series, not too many, and neither a linear problem
    that depends on the state nor a rate that solves an equation. Coefficients beyond order 0 are
    stored only for the rows that are read, those of ``KEPT``.
    """
    module = ast.parse(source)
    jets = next(f for f in module.body if isinstance(f, ast.FunctionDef) and f.name == "jets")
    place, loop = next(
        (i, s) for i, s in enumerate(jets.body) if isinstance(s, ast.For) and _runs_over_orders(s)
    )
    text = ast.unparse(loop)
    loops = ("invert(", "closer(", "direction_order(")
    if any(loop in text for loop in loops) or not any(name in text for name in _SUMS):
        return source
    kept = next(
        s.value
        for s in module.body
        if isinstance(s, ast.Assign) and ast.unparse(s.targets[0]) == "KEPT"
    )
    lines = unrolled(
        jets.body[:place], loop.body, jets.body[place + 1 : -1], ast.literal_eval(kept)
    )
    if sum(line.count("*") + line.count("fma(") for line in lines) > _MOST_PRODUCTS:
        return source
    jets.body = ast.parse("\n".join(lines)).body
    return ast.unparse(module)


def _runs_over_orders(loop: ast.For) -> bool:
    return ast.unparse(loop).startswith("for k in range(N):")


def unrolled(
    start: list[ast.stmt], body: list[ast.stmt], sizes: list[ast.stmt], kept: Collection[int]
) -> list[str]:
    """The lines of ``jets``.

    Parameters
    ----------
    start : list of ast.stmt
        Statements that set order 0 of the state.
    body : list of ast.stmt
        Statements that compute order k of all rows (k + 1 of the state) from lower orders.
    sizes : list of ast.stmt
        Statements that need order 0 only.
    kept : collection of int
        Rows of which all orders are stored.
    """
    *checkpoints, last = ORDERS
    writer = _Writer(kept)
    # What has a name before the loop keeps it: a variable is read once, an entry of an array again
    # and again.
    named = [s for s in start if isinstance(s, ast.Assign) and isinstance(s.targets[0], ast.Name)]
    writer.lines += map(ast.unparse, named)
    writer.run([s for s in start if s not in named], {"N": ast.Constant(last)})
    for k in range(last):
        writer.run(body, {"k": ast.Constant(k)})
        if k == 0:
            writer.lines += map(ast.unparse, sizes)
        if k + 1 in (1, *checkpoints):
            writer.lines += [f"if N == {k + 1}:", "    return 0"]
    return [*writer.lines, "return 0"]


@cache
def _recurrences() -> dict[str, ast.FunctionDef]:
    """The recurrences by name."""
    functions = [
        node
        for node in ast.parse(inspect.getsource(series)).body
        if isinstance(node, ast.FunctionDef)
    ]
    return {node.name: node for node in functions if node.name.endswith("_order")}


class _Writer:
    """Follows statements as far as they are known: loops and tests vanish, coefficients W[r, k]
    become variables."""

    def __init__(self, kept: Collection[int]) -> None:
        self.kept = kept
        self.lines: list[str] = []
        self.known: dict[str, ast.expr] = {}  # coefficients: their variables, or numbers
        self.age: dict[str, int] = {}  # variables, with the line that made them
        self.made: dict[str, ast.expr] = {}  # and what they were made of

    def run(self, body: list[ast.stmt], names: Names) -> ast.expr | None:
        """Follow statements; the value of a ``return``, if one is reached."""
        for statement in body:
            match statement:
                case ast.Return(value=ast.expr() as value):
                    return self.value(value, names)
                case ast.Assign(targets=[target], value=value):
                    self.assign(target, self.value(value, names), names)
                case ast.AugAssign(target=target, op=op, value=value):
                    self.assign(target, self.value(ast.BinOp(target, op, value), names), names)
                case ast.For(target=ast.Name(id=index), iter=ast.Call(args=limits)):
                    for j in range(
                        *(int(_number(self.value(limit, names)) or 0) for limit in limits)
                    ):
                        names[index] = ast.Constant(j)
                        self.run(statement.body, names)
                case ast.If(test=test):
                    chosen = self.value(test, names)
                    assert isinstance(chosen, ast.Constant)  # recurrences branch on the order alone
                    if (
                        result := self.run(
                            statement.body if chosen.value else statement.orelse, names
                        )
                    ) is not None:
                        return result
                case ast.Expr(value=value):
                    self.value(value, names)
                case _:
                    raise NotImplementedError(ast.unparse(statement))
        return None

    def assign(self, target: ast.expr, value: ast.expr, names: Names) -> None:
        """Give a variable, or an entry of an array, its value."""
        if isinstance(target, ast.Name):
            names[target.id] = value
            return
        place = ast.unparse(_Folder(self, names).visit_index(deepcopy(target)))
        coefficient = _coefficient(place)
        if coefficient is None:
            self.lines.append(f"{place} = {ast.unparse(value)}")
            return
        row, order = coefficient
        variable = f"w{row}_{order}"
        if _number(value) is None:
            self.age[variable] = len(self.lines)
            value = self.made[variable] = _Sums(self.age, self.made).visit(value)
            self.lines.append(f"{variable} = {ast.unparse(value)}")
            value = ast.Name(variable)
        self.known[place] = value
        if order == 0 or row in self.kept:
            self.lines.append(f"{place} = {ast.unparse(value)}")

    def value(self, expression: ast.expr, names: Names) -> ast.expr:
        """The expression with everything known put in."""
        return _Folder(self, names).visit(deepcopy(expression))


class _Folder(ast.NodeTransformer):
    """Puts in names, folds constants, and inlines recurrences."""

    def __init__(self, writer: _Writer, names: Names) -> None:
        self.writer, self.names = writer, names

    def visit_Name(self, node: ast.Name) -> ast.expr:
        return self.names.get(node.id, node)

    def visit_index(self, node: ast.expr) -> ast.expr:
        """An array's entry as a place."""
        return self.generic_visit(node)  # type: ignore[return-value]

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        place = self.visit_index(node)
        return self.writer.known.get(ast.unparse(place), place)

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        left = self.visit(node.left)
        right = self.visit(node.right)
        kind = type(node.op)
        a, b = _number(left), _number(right)
        if a is not None and b is not None:
            return ast.Constant(_ARITHMETIC[kind](a, b))
        if (kind is ast.Add and a == 0.0) or (kind is ast.Mult and a == 1.0):
            return right
        if (kind in (ast.Add, ast.Sub) and b == 0.0) or (kind in (ast.Mult, ast.Div) and b == 1.0):
            return left
        if kind is ast.Div and b is not None:
            return ast.BinOp(left, ast.Mult(), ast.Constant(1.0 / b))
        return ast.BinOp(left, node.op, right)

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        left = self.visit(node.left)
        right = self.visit(node.comparators[0])
        a, b = _number(left), _number(right)
        if a is not None and b is not None:
            return ast.Constant(_COMPARISONS[type(node.ops[0])](a, b))
        return ast.Compare(left, node.ops, [right])

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.expr:
        values = [self.visit(value) for value in node.values]
        # the value that decides: any True of an `or`, any False of an `and`
        decisive = isinstance(node.op, ast.Or)
        if any(isinstance(value, ast.Constant) and value.value is decisive for value in values):
            return ast.Constant(decisive)
        open_ones = [value for value in values if not isinstance(value, ast.Constant)]
        return (
            ast.BoolOp(node.op, open_ones)
            if len(open_ones) > 1
            else [*open_ones, ast.Constant(not decisive)][0]
        )

    def visit_IfExp(self, node: ast.IfExp) -> ast.expr:
        test = self.visit(node.test)
        if isinstance(test, ast.Constant):
            return self.visit(node.body if test.value else node.orelse)
        return ast.IfExp(test, self.visit(node.body), self.visit(node.orelse))

    def visit_Call(self, node: ast.Call) -> ast.expr:
        arguments = [self.visit(a) for a in node.args]
        function = _recurrences().get(node.func.id) if isinstance(node.func, ast.Name) else None
        if function is None:
            return ast.Call(node.func, arguments, [])
        names = {
            parameter.arg: a for parameter, a in zip(function.args.args, arguments, strict=True)
        }
        return self.writer.run(function.body, names) or ast.Constant(None)


class _Sums(ast.NodeTransformer):
    """Adds up long sums in the order in which their terms become known.

    Each coefficient waits for the one before, so that what takes time is the longest chain of
    instructions. Old terms are added up in strands; what is known last is added last, its product
    and its sum in one instruction.
    """

    def __init__(self, age: dict[str, int], made: dict[str, ast.expr]) -> None:
        self.age, self.made = age, made

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        if isinstance(node.op, ast.Mult):
            return self.scaled(node)
        if not isinstance(node.op, ast.Add):
            return self.generic_visit(node)  # type: ignore[return-value]
        terms = sorted(map(self.visit, _terms(node)), key=self.last)
        strands = [[term] for term in terms[:-2]]
        new = terms[-2:]
        if len(strands) > _STRANDS:
            strands = [terms[i:-2:_STRANDS] for i in range(_STRANDS)]
        sums = [reduce(_plus, strand) for strand in strands]
        while len(sums) > 1:
            sums = [reduce(_plus, sums[i : i + 2]) for i in range(0, len(sums), 2)]
        return reduce(_plus, [*sums, *new])

    def scaled(self, node: ast.BinOp) -> ast.expr:
        """A product without waiting for a product: factors that are known go to what is known."""
        left, right = self.visit(node.left), self.visit(node.right)
        newest = isinstance(left, ast.Name) and self.last(left) > self.last(right)
        match self.made.get(left.id) if newest else None:
            case ast.BinOp(factor, ast.Mult(), ast.Name() as base) if self.last(base) > self.last(
                factor
            ):
                return ast.BinOp(base, ast.Mult(), ast.BinOp(factor, ast.Mult(), right))
            case ast.Call(ast.Name("fma"), [a, b, rest]) if self.last(right) < 0:
                return _plus(
                    ast.BinOp(rest, ast.Mult(), right),
                    ast.BinOp(b, ast.Mult(), ast.BinOp(a, ast.Mult(), right)),
                )
        return ast.BinOp(left, ast.Mult(), right)

    def last(self, term: ast.AST) -> int:
        """When a term is known."""
        return max(
            (self.age.get(n.id, -1) for n in ast.walk(term) if isinstance(n, ast.Name)), default=-1
        )


def _plus(rest: ast.expr, term: ast.expr) -> ast.expr:
    """The sum of the rest and a term."""
    if isinstance(term, ast.BinOp) and isinstance(term.op, ast.Mult):
        return ast.Call(ast.Name("fma"), [term.left, term.right, rest], [])
    return ast.BinOp(rest, ast.Add(), term)


def _terms(node: ast.expr) -> list[ast.expr]:
    """The terms of a sum."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return [*_terms(node.left), *_terms(node.right)]
    return [node]


def _number(node: ast.expr) -> float | None:
    """The value of a numeric constant."""
    if (
        isinstance(node, ast.UnaryOp)
        and isinstance(node.op, ast.USub)
        and (x := _number(node.operand)) is not None
    ):
        return -x
    if not isinstance(node, ast.Constant) or isinstance(node.value, bool):
        return None
    return node.value if isinstance(node.value, int | float) else None


def _coefficient(place: str) -> tuple[int, int] | None:
    """Row and order of a coefficient W[r, k]."""
    if not place.startswith("W["):
        return None
    row, order = place[2:-1].split(", ")
    return (int(row), int(order)) if row.isdigit() and order.isdigit() else None
