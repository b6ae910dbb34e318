"""Expression trees: numbers, names, sums, products, functions and regions.

Every expression has one canonical form (a sum of coefficients times products of powers) and is
unique: equal expressions are the same object. They are therefore compared by ``is``, common
subexpressions need no search, and derivatives and the sets of names in an expression are stored
with it. A function with a kink or a jump (abs, min, piecewise, floor, ...) is a :func:`select` on
the sign of its *guard*; the engine turns each guard into an event.

Values follow IEEE arithmetic. An overflow gives an infinity, and functions of it have their limits:
``min(exp(x), 1)`` is 1 at x = 1000. An undefined value, also at a pole, is NaN, and so is every
expression that contains it: ``max(sqrt(x), 3)`` is NaN at x = −1. Terms that cancel identically are
removed. Numbers are combined when an expression is created, rounded to nearest: ``0.1 + 0.2`` is
the number 0.30000000000000004 in all computations, and enclosures are those of the expression with
this number.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from threading import RLock
from weakref import WeakValueDictionary

from stickslip.symbolic.functions import ARGUMENT, FUNCTIONS

Terms = tuple[tuple["Expr", float], ...]
_ARGUMENT_OF_ROW = re.compile(r"\bx\b")
_LONG_PRODUCT = 12  # products with this many factors, or more, are not merged: see `multiply`
_STRICT = 1.0  # `value` of a strict select


class Expr:
    """A node of an expression tree. Build expressions with the functions of this module, never
    directly.

    Attributes
    ----------
    op : str
        ``num``, ``sym``, ``sum``, ``prod``, ``pow``, ``select`` or the name of a function.
    value : float or str
        The number, the name, or the constant of a sum; of a select, 1 if it is :attr:`strict`,
        otherwise 0.
    args : tuple of Expr
        Arguments of a function, a power or a select.
    terms : tuple of (Expr, float)
        Terms and coefficients of a sum, or factors and exponents of a product.
    symbols : frozenset of str
        Names on which the expression depends.
    depth : int
        Height of the tree, which limits the depth of recursions.
    key : str
        Hash of the expression, the same in every process; terms and factors are sorted by it.
    """

    __slots__ = (
        "__weakref__",
        "_derivatives",
        "_terms_by_name",
        "args",
        "depth",
        "key",
        "op",
        "symbols",
        "terms",
        "value",
    )

    def __init__(
        self, op: str, value: float | str, args: tuple[Expr, ...], terms: Terms, key: str
    ) -> None:
        self.op: str = op
        self.value: float | str = value
        self.args: tuple[Expr, ...] = args
        self.terms: Terms = terms
        self.key: str = key
        children = [*args, *(child for child, _ in terms)]
        self.symbols: frozenset[str] = frozenset().union(*(c.symbols for c in children))
        if op == "sym":
            self.symbols = frozenset([str(value)])
        self.depth: int = 1 + max((c.depth for c in children), default=0)
        self._derivatives: dict[str, Expr] = {}
        self._terms_by_name: dict[str, list[tuple[Expr, float]]] | None = None

    @property
    def strict(self) -> bool:
        """Whether the value of a select is `below`, not `above`, if its guard is 0."""
        return self.value == _STRICT

    def terms_with(self, name: str) -> list[tuple[Expr, float]]:
        """The terms that depend on a name, found without a search through a long sum."""
        if self._terms_by_name is None:
            self._terms_by_name = {}
            for term, c in self.terms:
                for symbol in term.symbols:
                    self._terms_by_name.setdefault(symbol, []).append((term, c))
        return self._terms_by_name.get(name, [])

    def __add__(self, other: Expr | float) -> Expr:
        return add((self, 1.0), (as_expr(other), 1.0))

    def __radd__(self, other: float) -> Expr:
        return self + other

    def __sub__(self, other: Expr | float) -> Expr:
        return add((self, 1.0), (as_expr(other), -1.0))

    def __rsub__(self, other: float) -> Expr:
        return as_expr(other) - self

    def __neg__(self) -> Expr:
        return add((self, -1.0))

    def __mul__(self, other: Expr | float) -> Expr:
        return multiply(self, as_expr(other))

    def __rmul__(self, other: float) -> Expr:
        return self * other

    def __truediv__(self, other: Expr | float) -> Expr:
        return multiply(self, power(as_expr(other), num(-1.0)))

    def __rtruediv__(self, other: float) -> Expr:
        return as_expr(other) / self

    def __pow__(self, other: Expr | float) -> Expr:
        return power(self, as_expr(other))

    def __repr__(self) -> str:
        return to_text(self)

    def __reduce__(self) -> tuple[Callable[..., Expr], tuple[object, ...]]:
        """Create the unique object when an expression is copied or unpickled."""
        return _node, (self.op, self.value, self.args, self.terms)


_nodes: WeakValueDictionary[tuple, Expr] = WeakValueDictionary()
# Expressions of a system that is declared again are still alive.
_recent: deque[Expr] = deque(maxlen=10_000)
_LOCK = RLock()


def _node(
    op: str, value: float | str = 0.0, args: tuple[Expr, ...] = (), terms: Terms = ()
) -> Expr:
    """The unique node with these parts, which must be in canonical form."""
    identity = (op, value, tuple(map(id, args)), tuple((id(e), c) for e, c in terms))
    node = _nodes.get(identity)
    if node is None:
        # The key orders terms and factors the same way in every process, so that generated code is
        # reproducible.
        text = "|".join(
            [op, repr(value), *(a.key for a in args), *(f"{e.key}*{c!r}" for e, c in terms)]
        )
        made = Expr(op, value, args, terms, hashlib.sha1(text.encode()).hexdigest())
        with _LOCK:  # another thread may have just created the same node
            node = _nodes.get(identity)
            if node is None:
                node = _nodes[identity] = made
                _recent.append(node)
    return node


def num(value: float) -> Expr:
    """A number; raises ``OverflowError`` if it is not finite."""
    if not math.isfinite(value):
        raise OverflowError("a number in the formula overflows or is undefined")
    return _node("num", float(value) + 0.0)  # −0 becomes 0


def sym(name: str) -> Expr:
    """A name: coordinate, rate, parameter or time."""
    return _node("sym", name)


ZERO = num(0.0)
ONE = num(1.0)


def as_expr(value: Expr | float) -> Expr:
    """The expression itself, or a number as an expression."""
    return value if isinstance(value, Expr) else num(value)


def is_number(expression: Expr, value: float | None = None) -> bool:
    """Whether the expression is a number (equal to `value`, if given)."""
    return expression.op == "num" and (value is None or expression.value == value)


def number(expression: Expr) -> float:
    """The value of a numeric expression."""
    return float(expression.value)


def add(*weighted: tuple[Expr, float]) -> Expr:
    """Sum of (expression, coefficient) pairs."""
    constant = 0.0
    terms = dict[Expr, float]()
    for expression, weight in weighted:
        if expression.op == "num":
            constant += weight * number(expression)
        elif expression.op == "sum":
            constant += weight * float(expression.value)
            for term, coefficient in expression.terms:
                terms[term] = terms.get(term, 0.0) + weight * coefficient
        else:
            terms[expression] = terms.get(expression, 0.0) + weight
    kept = tuple(
        sorted(((e, c) for e, c in terms.items() if c != 0.0), key=lambda pair: pair[0].key)
    )
    if any(not math.isfinite(c) for _, c in kept):
        raise OverflowError("a number in the formula is too large")
    if not kept:
        return num(constant)
    if len(kept) == 1 and constant == 0.0 and kept[0][1] == 1.0:
        return kept[0][0]
    num(constant)  # raises if the constant is not finite
    if len(kept) > 1 and (moved := _into_branches(constant, terms, kept)) is not None:
        return moved
    return _node("sum", constant, (), kept)


def _into_branches(constant: float, terms: Mapping[Expr, float], kept: Terms) -> Expr | None:
    """Move terms that cancel in a branch of a select into its branches, as in u − clip(u, −2, 2):
    there they cancel exactly, without rounding errors. None if no terms cancel."""
    for e, c in kept:
        if e.op != "select":
            continue
        cancelled = {
            term: weight
            for branch in _leaves(e)
            for term, weight in _linear_terms(branch)
            if term in terms and -c * weight == terms[term]
        }
        if cancelled:
            guard, above, below = e.args
            moved = [(term, -weight) for term, weight in cancelled.items()]
            branches = (add((branch, 1.0), *moved) for branch in (above, below))
            rest = ((x, w) for x, w in kept if x is not e and x not in cancelled)
            changed = select(guard, *branches, strict=e.strict)
            return add((changed, c), (num(constant), 1.0), *rest)
    return None


def _leaves(e: Expr) -> list[Expr]:
    """The branches of a select, with nested selects replaced by their branches."""
    return [leaf for b in e.args[1:] for leaf in _leaves(b)] if e.op == "select" else [e]


def _linear_terms(e: Expr) -> Terms:
    """Terms and coefficients of an expression regarded as a sum, without its constant."""
    return e.terms if e.op == "sum" else () if e.op == "num" else ((e, 1.0),)


def multiply(*factors: Expr) -> Expr:
    """Product of expressions.

    Products of many factors are not merged into longer ones, so that the derivatives of a product
    of n factors have size n, not n².
    """
    coefficient = 1.0
    powers = dict[Expr, float]()
    rooted = set[Expr]()  # bases with fractional exponents: undefined if negative
    for factor in factors:
        if factor.op == "num":
            coefficient *= number(factor)
            continue
        if factor.op == "sum" and factor.value == 0.0 and len(factor.terms) == 1:
            factor, scale = factor.terms[0]
            coefficient *= scale
        short = factor.op == "prod" and len(factor.terms) < _LONG_PRODUCT
        for base, exponent in factor.terms if short else ((factor, 1.0),):
            if base.op == "prod" and (root := _root(base)) is not None:
                base, exponent = root[0], root[1] * exponent
                rooted.add(base)
            elif not exponent.is_integer():
                rooted.add(base)
            powers[base] = powers.get(base, 0.0) + exponent
    if coefficient == 0.0:
        return ZERO
    # If exponents of a root add up to an integer, as in √x·√x, the product is x only if x is never
    # negative. Otherwise it is (√x)², which is undefined for negative x as well.
    plain = list[Expr]()
    for base in rooted:
        if (p := powers[base]).is_integer() and p:
            del powers[base]
            if never_negative(base):
                plain.append(power(base, num(p)))
            else:
                powers[_product(((base, 0.5),))] = 2.0 * p
    if plain:
        others = (_product(((base, p),)) for base, p in powers.items() if p)
        return multiply(num(coefficient), *others, *plain)
    kept = tuple(
        sorted(((e, p) for e, p in powers.items() if p != 0.0), key=lambda pair: pair[0].key)
    )
    if not kept:
        return num(coefficient)
    product = kept[0][0] if len(kept) == 1 and kept[0][1] == 1.0 else _product(kept)
    return product if coefficient == 1.0 else add((product, coefficient))


def _root(e: Expr) -> tuple[Expr, float] | None:
    """Base and exponent of a power with a fractional exponent; None for other expressions."""
    is_root = e.op == "prod" and len(e.terms) == 1 and not e.terms[0][1].is_integer()
    return e.terms[0] if is_root else None


@lru_cache(maxsize=4096)
def never_negative(e: Expr) -> bool:
    """Whether an expression, such as x² + y², is proved to have no negative value."""
    from stickslip.symbolic.enclosures import bounds

    return bounds(e, {})[0] >= 0.0


def _product(powers: Terms) -> Expr:
    if not all(math.isfinite(p) for _, p in powers):
        raise OverflowError("an exponent in the formula is too large")
    return _node("prod", 0.0, (), powers)


def power(base: Expr, exponent: Expr) -> Expr:
    """Power; a numeric exponent becomes part of a product, any other exponent needs a positive
    base."""
    if exponent.op != "num":
        if base.op == "num" and number(base) <= 0.0:
            raise ZeroDivisionError(f"{number(base):g} to a variable power is undefined")
        return ONE if base is ONE else _node("pow", 0.0, (base, exponent))
    p = number(exponent)
    if base.op == "num":
        b = number(base)
        if (b < 0.0 and not p.is_integer()) or (b == 0.0 and p < 0.0):
            raise ZeroDivisionError(f"{b:g}**{p:g} is undefined")
        return num(b**p)
    if p == 0.0:
        return ONE
    if p == 1.0:
        return base
    if base.op == "prod" and p.is_integer() and len(base.terms) < _LONG_PRODUCT:
        # Roots remain factors of their own: `multiply` decides whether (√x)² is x.
        parts = [(e, q) if q.is_integer() else (_product(((e, q),)), 1.0) for e, q in base.terms]
        return multiply(*(_product(((e, q * p),)) for e, q in parts))
    if base.op == "sum" and base.value == 0.0 and len(base.terms) == 1:
        term, c = base.terms[0]
        if c > 0.0 or p.is_integer():
            return multiply(num(c**p), power(term, exponent))
    found = _product(((base, p),))
    return found if _root(base) is None else multiply(found)


def call(name: str, argument: Expr) -> Expr:
    """A function of :data:`~stickslip.symbolic.functions.FUNCTIONS` applied to an expression."""
    row = FUNCTIONS[name]
    if argument.op == "num":
        try:
            return num(row(number(argument)))
        except ValueError:
            raise ZeroDivisionError(f"{name}({number(argument):g}) is undefined") from None
    if row.typed and row.period and argument.op == "sum":
        # This period is a number without rounding error, so whole periods can be removed.
        turns = math.floor(float(argument.value) / row.period + 0.5)
        argument = add((argument, 1.0), (num(turns * row.period), -1.0))
    return _node(name, 0.0, (argument,))


def select(guard: Expr, above: Expr, below: Expr, *, strict: bool = False) -> Expr:
    """`above` if ``guard >= 0`` (if strict, ``guard > 0``), otherwise `below`; undefined if the
    guard is."""
    if above is below:
        return above
    if guard.op == "num":
        here = number(guard)
        return above if here > 0.0 or (here == 0.0 and not strict) else below
    if guard.op == "sum":
        # The guards g, −g and 2g change sign at the same point: one form serves all.
        first, leading = guard.terms[0]
        if leading != 1.0:
            others = ((term, c / leading) for term, c in guard.terms[1:])
            guard = add((num(float(guard.value) / leading), 1.0), (first, 1.0), *others)
            if leading < 0.0:
                above, below, strict = below, above, not strict
    if strict:
        from stickslip.symbolic.enclosures import joins

        # If the branches have the same value at the boundary, strictness makes no difference.
        strict = not joins(guard, above, below)
    return _node("select", _STRICT if strict else 0.0, (guard, above, below))


def branches_of(e: Expr, regions: Mapping[Expr, int]) -> tuple[int, Expr, Expr]:
    """The region of a select, and its branches in the order of this region.

    Parameters
    ----------
    regions : mapping of Expr to int
        Entry of each guard that :func:`listed_guard` returns.

    Returns
    -------
    int, Expr, Expr
        The entry of the listed guard, and the values of the select if the listed guard is
        nonnegative, and if it is negative.
    """
    guard, above, below = e.args
    if e.strict and (opposite := -guard) in regions:
        return regions[opposite], below, above
    return regions[guard], above, below


def listed_guard(e: Expr, constants: frozenset[str]) -> Expr:
    """The guard by which :func:`branches_of` looks up a select.

    A guard that contains only constants can be 0 throughout a motion. If the select is strict, its
    value is then `below`, so −guard is listed, which is nonnegative in this case.

    Parameters
    ----------
    constants : frozenset of str
        Names of constants.
    """
    guard = e.args[0]
    return -guard if e.strict and guard.symbols <= constants else guard


def absolute(x: Expr) -> Expr:
    """Absolute value."""
    return num(abs(number(x))) if x.op == "num" else select(x, x, -x)


def maximum(a: Expr, b: Expr) -> Expr:
    """The larger of two."""
    return select(a - b, a, b)


def minimum(a: Expr, b: Expr) -> Expr:
    """The smaller of two."""
    return select(a - b, b, a)


def clip(x: Expr, low: Expr, high: Expr) -> Expr:
    """`x` limited to an interval."""
    return select(x - low, select(x - high, high, x), low)


def derivative(expression: Expr, name: str) -> Expr:
    """Partial derivative; for functions with kinks, that of each region."""
    if name not in expression.symbols:
        return ZERO
    found = expression._derivatives.get(name)
    if found is None:
        found = expression._derivatives[name] = _derivative(expression, name)
    return found


def _derivative(e: Expr, name: str) -> Expr:
    if e.op == "sym":
        return ONE
    if e.op == "sum":
        return add(*((derivative(term, name), c) for term, c in e.terms_with(name)))
    if e.op == "prod":
        changing = [(base, p) for base, p in e.terms if name in base.symbols]
        return add(*((_slope_of_factor(e, base, p, name), p) for base, p in changing))
    if e.op == "pow":
        base, exponent = e.args
        return e * (
            derivative(exponent, name) * call("log", base)
            + exponent * derivative(base, name) / base
        )
    if e.op == "select":
        guard, above, below = e.args
        return select(guard, derivative(above, name), derivative(below, name), strict=e.strict)
    (x,) = e.args
    return at(FUNCTIONS[e.op].slope, x) * derivative(x, name)


def _slope_of_factor(e: Expr, base: Expr, p: float, name: str) -> Expr:
    """The product e with its factor baseᵖ replaced by baseᵖ⁻¹ base′."""
    if p < 0.0:
        return multiply(e, _relative_slope(base, name))
    others = (power(other, num(q - 1.0 if other is base else q)) for other, q in e.terms)
    return multiply(*others, derivative(base, name))


def _relative_slope(base: Expr, name: str) -> Expr:
    """base′/base; for a + c exp u and cosh u in a form that does not overflow."""
    if (relative := _relative(base)) is not None:
        return at(relative, base.args[0]) * derivative(base.args[0], name)
    growing = [(term, c) for term, c in base.terms_with(name) if _relative(term) is ONE]
    if base.op == "sum" and len(growing) == 1:
        # c exp u = base − rest, so that base′/base = u′ + (rest′ − u′ rest)/base.
        (term, c), rate = growing[0], derivative(growing[0][0].args[0], name)
        rest = add((base, 1.0), (term, -c))
        return rate + (derivative(rest, name) - rate * rest) / base
    return derivative(base, name) / base


def _relative(e: Expr) -> Expr | None:
    """The derivative of a function divided by the function, if the table has a formula for it."""
    return FUNCTIONS[e.op].relative_slope if e.op in FUNCTIONS else None


def at(body: Expr, argument: Expr) -> Expr:
    """The body of a function, such as a derivative of the table, at an argument."""
    return substitute(body, {ARGUMENT: argument})


def has_pieces(e: Expr) -> bool:
    """Whether a node has branches or jumps, which do not appear in its derivative."""
    return e.op == "select" or (e.op in FUNCTIONS and FUNCTIONS[e.op].jumps)


def bends(e: Expr, names: Iterable[str]) -> bool:
    """Whether an expression has branches or jumps in some names: it may then be nonlinear although
    its derivatives are constant."""
    names = frozenset(names)
    return any(has_pieces(n) and n.symbols & names for n in walk([e]))


def frequency(e: Expr) -> Expr | None:
    """The angular frequency of a periodic function of time, the time derivative of its phase in
    radians; None for other expressions."""
    row = FUNCTIONS.get(e.op)
    if row is None or not row.period or "t" not in e.symbols:
        return None
    if bends(e.args[0], "t"):
        return None
    return (2.0 * math.pi / row.period) * derivative(e.args[0], "t")


def turned(e: Expr, quarters: int) -> Expr:
    """A periodic function, shifted in phase by some quarters of its period."""
    row = FUNCTIONS[e.op]
    if row.crest is None:
        return call(e.op, e.args[0] + 0.25 * (quarters % 4) * row.period)
    # A derivative of a sine or cosine shifts it by a quarter, without rounding errors of π/2.
    body = call(e.op, sym(ARGUMENT))
    for _ in range(quarters % 4):
        body = derivative(body, ARGUMENT)
    return at(body, e.args[0])


def along(expression: Expr, rates: Mapping[str, Expr]) -> Expr:
    """Total derivative with respect to time along given rates of the names."""
    names = sorted(expression.symbols & rates.keys())
    return add(*((derivative(expression, name) * rates[name], 1.0) for name in names))


def substitute(expression: Expr, values: Mapping[str, Expr], *, undefined: bool = False) -> Expr:
    """Replace names by expressions; see :func:`rewrite`."""

    def named(e: Expr) -> Expr | None:
        if not e.symbols & values.keys():
            return e
        return values[str(e.value)] if e.op == "sym" else None

    return rewrite(expression, named, undefined=undefined)


def rewrite(
    expression: Expr,
    change: Callable[[Expr], Expr | None],
    *,
    again: bool = False,
    undefined: bool = False,
) -> Expr:
    """Replace nodes.

    Parameters
    ----------
    change : callable
        Returns the replacement of a node, or None to continue with its parts.
    again : bool
        Whether replacements are rewritten as well.
    undefined : bool
        Whether parts that become undefined or too large, such as 1/x at x = 0, are kept
        unevaluated: they may belong to a branch that is not selected.

    Raises
    ------
    ArithmeticError
        If a part becomes undefined or too large, unless `undefined`.
    """
    memo: dict[Expr, Expr] = {}

    def visit(e: Expr) -> Expr:
        if e not in memo:
            new = change(e)
            memo[e] = rebuild(e) if new is None else visit(new) if again else new
        return memo[e]

    def rebuild(e: Expr) -> Expr:
        if e.op in ("sym", "num"):
            return e
        if e.op == "sum":
            return add((num(float(e.value)), 1.0), *((visit(term), c) for term, c in e.terms))
        if e.op == "prod":
            return multiply(*(raised(visit(base), num(p)) for base, p in e.terms))
        args = [visit(a) for a in e.args]
        if e.op == "select":
            return select(*args, strict=e.strict)
        if e.op == "pow":
            return raised(*args)
        try:
            return call(e.op, args[0])
        except ArithmeticError:
            if not undefined:
                raise
            return _node(e.op, 0.0, (args[0],))

    def raised(base: Expr, exponent: Expr) -> Expr:
        try:
            return power(base, exponent)
        except ArithmeticError:
            if not undefined:
                raise
            return _node("pow", 0.0, (base, exponent))

    return visit(expression)


def walk(expressions: Iterable[Expr]) -> list[Expr]:
    """All nodes below the given ones, children before parents, each once."""
    order: dict[Expr, None] = {}

    def visit(e: Expr) -> None:
        if e not in order:
            for child in (*e.args, *(c for c, _ in e.terms)):
                visit(child)
            order[e] = None

    for expression in expressions:
        visit(expression)
    return list(order)


def evaluate(expression: Expr, values: Mapping[str, float]) -> float:
    """Value for given values of the names: infinite on overflow, NaN if undefined."""
    result: dict[Expr, float] = {}
    for e in walk([expression]):
        result[e] = _value(e, values, result)
    return result[expression]


def _value(e: Expr, values: Mapping[str, float], known: Mapping[Expr, float]) -> float:
    """Value of a node from those of its children. Operations and their order are the same as in
    :func:`stickslip.symbolic.scalars.scalars_of`, so that all evaluations agree."""
    match e.op:
        case "num":
            return number(e)
        case "sym":
            return float(values[str(e.value)])
        case "sum":
            total = float(e.value)
            for term, c in e.terms:
                total += c * known[term]
            return total
        case "prod":
            product = 1.0
            for base, p in e.terms:
                product *= real_power(known[base], p)
            return product
        case "pow":
            return real_power(known[e.args[0]], known[e.args[1]])
        case "select":
            guard, above, below = (known[a] for a in e.args)
            if math.isnan(guard):
                return math.nan
            return above if guard > 0.0 or (guard == 0.0 and not e.strict) else below
        case _:
            return FUNCTIONS[e.op].ieee(_argument(e, known))


def _argument(e: Expr, known: Mapping[Expr, float]) -> float:
    """Value of the argument of a function; whole periods may be removed from it."""
    (x,) = e.args
    parts = wrapped_parts(e)
    if parts is None:
        return known[x]
    row = FUNCTIONS[e.op]
    total = float(x.value)
    for term, c in parts:
        total += row.ieee(c * known[term])
    return total


def wrapped_parts(e: Expr) -> Terms | None:
    """Terms of the argument of a function that removes whole periods; None for other expressions.

    Whole periods are removed from every term before the terms are added, so that large multiples of
    the period do not reduce the accuracy of the sum.
    """
    if e.op not in FUNCTIONS or e.args[0].op != "sum":
        return None
    row = FUNCTIONS[e.op]
    return e.args[0].terms if row.typed and row.period else None


def real_power(base: float, p: float) -> float:
    """A power: infinite on overflow or if that is its limit; NaN for a negative base with a
    fractional exponent, and at a pole at which the sign changes."""
    if p == 1.0:
        return base
    if p == 2.0:
        return base * base
    if base == 0.0 and p < 0.0:
        return math.nan if p % 2.0 == 1.0 else math.inf
    if p == -1.0:
        return 1.0 / base
    if base < 0.0 and not p.is_integer():
        return math.nan
    try:
        return math.pow(base, p)
    except OverflowError:
        return -math.inf if base < 0.0 and p % 2.0 == 1.0 else math.inf


def to_text(expression: Expr, longest: int = 2000) -> str:
    """The expression as a formula of the declaration language; parts of more than `longest`
    characters become '...'."""
    known: dict[Expr, tuple[str, int]] = {}
    for e in walk([expression]):
        text, level = _text(e, known)
        known[e] = (text, level) if len(text) <= longest else ("...", 5)
    return known[expression][0]


def _text(e: Expr, known: Mapping[Expr, tuple[str, int]]) -> tuple[str, int]:
    """Text and precedence: 1 sum, 2 product, 3 power, 4 number, 5 name or call; 0 is a negative
    number."""

    def inner(x: Expr, level: int = 0) -> str:
        text, own = known[x]
        return f"({text})" if own < level else text

    match e.op:
        case "num":
            return _digits(number(e)), 0 if number(e) < 0 else 4
        case "sym":
            return str(e.value), 5
        case "sum":
            text = ""
            for term, c in sorted(e.terms, key=lambda pair: pair[1] < 0):
                scaled = inner(term, 2) if abs(c) == 1.0 else _times(abs(c), inner(term, 2))
                text += (
                    (" - " if text else "-") + scaled if c < 0 else (" + " if text else "") + scaled
                )
            if e.value:
                text += f" {'-' if float(e.value) < 0 else '+'} {_digits(abs(float(e.value)))}"
            return text, 1
        case "prod":
            above = [_factor(inner(base, 4), p) for base, p in e.terms if p > 0]
            under = [_factor(inner(base, 4), -p) for base, p in e.terms if p < 0]
            text = "*".join(above) or "1"
            if under:
                text += "/" + (under[0] if len(under) == 1 else f"({'*'.join(under)})")
            return text, 2
        case "pow":
            return f"{inner(e.args[0], 4)}**{inner(e.args[1], 4)}", 3
    from stickslip.symbolic.pieces import as_call

    if (found := as_call(e)) is not None:
        name, arguments = found
        return f"{name}({', '.join(map(to_text, arguments))})", 5
    if e.op == "select":
        if (table := _table_name(e)) is not None:
            return f"{table}({known[e.args[1].args[0]][0]})", 5
        guard, above, below = (inner(a) for a in e.args)
        return f"piecewise({guard} {'>' if e.strict else '>='} 0, {above}, {below})", 5
    if table := FUNCTIONS[e.op].called:
        return f"{table}({known[e.args[0]][0]})", 5
    if typed := FUNCTIONS[e.op].typed:
        return f"({_ARGUMENT_OF_ROW.sub(inner(e.args[0], 5), typed)})", 5
    return f"{e.op}({inner(e.args[0])})", 5


def _table_name(e: Expr) -> str | None:
    """Name of the table that a select evaluates piece by piece; None for other selects."""
    guard, above, below = e.args
    gate, one, other = (FUNCTIONS.get(x.op) for x in (guard, above, below))
    if gate is None or one is None or other is None or not gate.sampled:
        return None
    alike = guard.args == above.args == below.args and one.called == other.called
    return one.called or None if alike else None


def _times(c: float, product: str) -> str:
    return _digits(c) + product[1:] if product.startswith("1/") else f"{_digits(c)}*{product}"


def _factor(base: str, p: float) -> str:
    return base if p == 1.0 else f"{base}**{_digits(p)}"


def _digits(value: float) -> str:
    """Shortest text of a number that is read as the same number."""
    return f"{value:.0f}" if value.is_integer() and abs(value) < 1e15 else repr(value)
