"""Partial evaluation of generated code: the loop over the orders of a Taylor series, written out order by order.

The recurrences of :mod:`stickslip.equations.series` are sums whose lengths are known once the order is. Written out,
with every coefficient in a variable of its own, they run about three times as fast as loops. They are taken from
their own source text, so that the mathematics is said once.
"""

from __future__ import annotations

import ast
import inspect
import operator
from collections.abc import Iterable
from copy import deepcopy
from functools import cache

from stickslip.equations import series
from stickslip.equations.code import ORDERS

Names = dict[str, ast.expr]
ARITHMETIC = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv}
COMPARISONS = {ast.Eq: operator.eq, ast.Gt: operator.gt, ast.GtE: operator.ge}


MOST_PRODUCTS = 4000  # beyond this, the code would take too long to compile
SUMS = tuple(f"{name}_order" for name in "product divide inverse power exp log chain".split())
TERMS = """
@njit(cache=True, error_model='numpy', _nrt=False, fastmath={{'reassoc', 'contract', 'nsz'}})
def terms(mode, reg, K, Rq, Rz, N, W, A, B):
    {}
    return 0
"""


def written_out(source: str) -> str:
    """The module of a system with the loop of its ``jets`` written out, where that makes it faster.

    It does where the series contain products of series, not too many, and no linear problem that depends on the state.
    """
    module = ast.parse(source)
    at, jets = next((i, f) for i, f in enumerate(module.body) if isinstance(f, ast.FunctionDef) and f.name == "jets")
    place, loop = next((i, s) for i, s in enumerate(jets.body) if isinstance(s, ast.For) and _runs_over_orders(s))
    text = ast.unparse(loop)
    if "invert(" in text or not any(name in text for name in SUMS):
        return source
    lines = unrolled(loop.body, ORDERS[-1], (1, *ORDERS[:-1]))
    if sum(line.count("*") for line in lines) > MOST_PRODUCTS:
        return source
    jets.body[place] = ast.parse("terms(mode, reg, K, Rq, Rz, N, W, A, B)").body[0]
    module.body[at:at] = ast.parse(TERMS.format("\n    ".join(lines))).body
    return ast.unparse(module)


def _runs_over_orders(loop: ast.For) -> bool:
    return ast.unparse(loop).startswith("for k in range(N):")


def unrolled(body: list[ast.stmt], order: int, checkpoints: Iterable[int]) -> list[str]:
    """Statements for the orders 0 … order − 1 of a loop body over ``k``.

    Parameters
    ----------
    body : list of ast.stmt
        Statements that compute order k of all rows (k + 1 of the state) from lower orders.
    order : int
    checkpoints : iterable of int
        Orders after which the code stops if ``N`` is that order.
    """
    writer = _Writer()
    for k in range(order):
        if k in checkpoints:
            writer.lines += [f"if N == {k}:", "    return 0"]
        writer.run(body, {"k": ast.Constant(k)})
    return writer.lines


@cache
def _recurrences() -> dict[str, ast.FunctionDef]:
    """The recurrences by name."""
    functions = [node for node in ast.parse(inspect.getsource(series)).body if isinstance(node, ast.FunctionDef)]
    return {node.name: node for node in functions if node.name.endswith("_order")}


class _Writer:
    """Follows statements as far as they are known: loops and tests vanish, coefficients W[r, k] become variables."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.known: set[str] = set()

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
                    for j in range(*(int(_number(self.value(limit, names)) or 0) for limit in limits)):
                        names[index] = ast.Constant(j)
                        self.run(statement.body, names)
                case ast.If(test=test):
                    chosen = self.value(test, names)
                    assert isinstance(chosen, ast.Constant)  # recurrences branch on the order alone
                    if (result := self.run(statement.body if chosen.value else statement.orelse, names)) is not None:
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
        text, variable = ast.unparse(value), _variable(place)
        if variable is None:
            self.lines.append(f"{place} = {text}")
            return
        self.known.add(variable)
        self.lines += [f"{variable} = {text}", f"{place} = {variable}"]

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
        variable = _variable(ast.unparse(place))
        return ast.Name(variable) if variable in self.writer.known else place

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        left, right, kind = self.visit(node.left), self.visit(node.right), type(node.op)
        a, b = _number(left), _number(right)
        if a is not None and b is not None:
            return ast.Constant(ARITHMETIC[kind](a, b))
        if (kind is ast.Add and a == 0.0) or (kind is ast.Mult and a == 1.0):
            return right
        if (kind in (ast.Add, ast.Sub) and b == 0.0) or (kind in (ast.Mult, ast.Div) and b == 1.0):
            return left
        if kind is ast.Div and b is not None:
            return ast.BinOp(left, ast.Mult(), ast.Constant(1.0 / b))
        return ast.BinOp(left, node.op, right)

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        left, right = self.visit(node.left), self.visit(node.comparators[0])
        a, b = _number(left), _number(right)
        if a is not None and b is not None:
            return ast.Constant(COMPARISONS[type(node.ops[0])](a, b))
        return ast.Compare(left, node.ops, [right])

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.expr:
        values = [self.visit(value) for value in node.values]
        decisive = isinstance(node.op, ast.Or)  # the value that decides: any True of an `or`, any False of an `and`
        if any(isinstance(value, ast.Constant) and value.value is decisive for value in values):
            return ast.Constant(decisive)
        open_ones = [value for value in values if not isinstance(value, ast.Constant)]
        return ast.BoolOp(node.op, open_ones) if len(open_ones) > 1 else [*open_ones, ast.Constant(not decisive)][0]

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
        names = {parameter.arg: a for parameter, a in zip(function.args.args, arguments, strict=True)}
        return self.writer.run(function.body, names) or ast.Constant(None)


def _number(node: ast.expr) -> float | None:
    """The value of a numeric constant."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub) and (x := _number(node.operand)) is not None:
        return -x
    if not isinstance(node, ast.Constant) or isinstance(node.value, bool):
        return None
    return node.value if isinstance(node.value, int | float) else None


def _variable(place: str) -> str | None:
    """Name of the variable that holds a coefficient W[r, k]."""
    if not place.startswith("W["):
        return None
    row, order = place[2:-1].split(", ")
    return f"w{row}_{order}" if row.isdigit() and order.isdigit() else None
