"""Formulas as written by the user: terms and factors keep their order, functions their names.

The engine's expressions (:mod:`stickslip.symbolic.expressions`) are canonical: sorted, with every
function replaced by its body. That is right for a machine and unreadable for a person. Here a
formula is read from the same checked text into a small ordered tree, which can be differentiated:
b/2*psi**2 - c*(x_R - x_L)*psi by psi gives b*psi - c*(x_R - x_L), and a function H_R(psi) stays
H_R(psi).
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from math import gcd
from numbers import Real
from typing import TYPE_CHECKING

from stickslip.symbolic.formulas import builtins, parse_signature, syntax_of
from stickslip.symbolic.functions import FUNCTIONS
from stickslip.symbolic.pieces import STRUCTURES

if TYPE_CHECKING:
    from stickslip.model.entries.tables import Table
    from stickslip.model.system import Drive, System


@dataclass(frozen=True)
class Number:
    """An exact number."""

    value: Fraction


@dataclass(frozen=True)
class Name:
    """A coordinate, rate, parameter, argument or time."""

    name: str


@dataclass(frozen=True)
class OfModes(Name):
    """An unknown of a structure, or its rate: a linear form of modes, or of their rates."""

    weights: tuple[tuple[str, Fraction], ...]


@dataclass(frozen=True)
class InWords:
    """A function of time that is not a formula, in words."""

    words: str


@dataclass(frozen=True)
class Call:
    """A function applied to arguments.

    Attributes
    ----------
    hidden : tuple of str
        State variables and time that the function depends on without naming them as arguments.
    by : tuple of str
        Names of the arguments (or hidden variables) by which it was differentiated.
    """

    name: str
    arguments: tuple[Node, ...] = ()
    hidden: tuple[str, ...] = ()
    by: tuple[str, ...] = ()


@dataclass(frozen=True)
class Sum:
    """Two or more terms."""

    terms: tuple[Node, ...]


@dataclass(frozen=True)
class Term:
    """A number times powers (base, exponent)."""

    factor: Fraction
    powers: tuple[tuple[Node, Node], ...]


@dataclass(frozen=True)
class Relation:
    """A comparison, as in piecewise functions and conditions."""

    sign: str
    left: Node
    right: Node


Node = Number | Name | InWords | Call | Sum | Term | Relation
Factors = tuple[tuple[Node, Node], ...]

VECTOR, INVERSE = "()", "^-1"  # calls that no formula of a declaration can contain
NOUGHT, UNITY, HALF = (Number(Fraction(text)) for text in ("0", "1", "1/2"))
_MINUS_ONE = Number(Fraction(-1))
_MAX_EXPONENT = 8  # larger powers of numbers are not evaluated


def sum_of(*nodes: Node) -> Node:
    """Sum; equal terms are collected at the place of the first."""
    # For each group of equal terms: the powers they share, in the order of the first, and their
    # total factor.
    groups: dict[frozenset[tuple[Node, Node]], tuple[Fraction, Factors]] = {}
    for factor, powers in (coefficient_and_rest(term) for node in nodes for term in _terms(node)):
        if factor == 0:
            continue  # a zero keeps no place for later numbers
        key = frozenset(powers)
        total, first = groups.get(key, (Fraction(0), powers))
        groups[key] = (total + factor, first)
    kept = [as_product(total, powers) for total, powers in groups.values() if total != 0]
    if len(kept) < 2:
        return kept[0] if kept else NOUGHT
    return Sum(tuple(kept))


def _terms(node: Node) -> Iterator[Node]:
    """Terms of a sum, also of −(a − b)."""
    match node:
        case Sum(terms):
            yield from terms
        case Term(factor, ((Sum(terms), exponent),)) if exponent == UNITY and abs(factor) == 1:
            for term in terms:
                yield times(Number(factor), term)
        case _:
            yield node


def coefficient_and_rest(node: Node) -> tuple[Fraction, Factors]:
    """Numeric factor and powers of a term."""
    match node:
        case Number(value):
            return value, ()
        case Term(factor, powers):
            return factor, powers
    return Fraction(1), ((node, UNITY),)


def as_product(factor: Fraction, powers: Factors) -> Node:
    """A number times powers, in its simplest form."""
    if factor == 0 or not powers:
        return Number(factor)
    if factor == 1 and len(powers) == 1 and powers[0][1] == UNITY:
        return powers[0][0]
    return Term(factor, powers)


def times(*nodes: Node) -> Node:
    """Product; equal bases are collected at the place of the first."""
    factor = Fraction(1)
    found = dict[Node, Node]()
    for node in nodes:
        number, powers = coefficient_and_rest(node)
        factor *= number
        for base, exponent in powers:
            found[base] = sum_of(found[base], exponent) if base in found else exponent
    for base in list(found):
        # A one-sided spring: max(x, 0)·(1 if x > 0, else 0) is max(x, 0).
        match base:
            case Call("piecewise", (Relation(">" | "<" as sign, left, right), value, last)) if (
                last == right == NOUGHT
            ):
                if Call("max" if sign == ">" else "min", (left, NOUGHT)) in found:
                    del found[base]
                    return times(as_product(factor, tuple(found.items())), value)
    return as_product(factor, tuple((b, e) for b, e in found.items() if e != NOUGHT))


def raised(base: Node, exponent: Node) -> Node:
    """Power; numbers are evaluated only if the result is readable."""
    if exponent == NOUGHT:
        return UNITY
    if exponent == UNITY or base == UNITY:
        return base
    if isinstance(exponent, Number) and exponent.value.denominator == 1:
        n = exponent.value.numerator
        if (
            isinstance(base, Number)
            and base.value.denominator == 1
            and base.value != 0
            and abs(n) <= _MAX_EXPONENT
        ):
            return Number(base.value**n)
        if isinstance(base, Term) and (abs(n) <= _MAX_EXPONENT):
            powers = tuple((b, times(e, exponent)) for b, e in base.powers)
            return times(raised(Number(base.factor), exponent), Term(Fraction(1), powers))
    return Term(Fraction(1), ((base, exponent),))


def negate(node: Node) -> Node:
    """The negative."""
    return times(_MINUS_ONE, node)


def differentiated(node: Node, name: str) -> Node:
    """Partial derivative by a name."""
    match node:
        case Number():
            return NOUGHT
        case OfModes(_, weights):
            return Number(dict(weights).get(name, Fraction(0)))
        case Name(own):
            return UNITY if own == name else NOUGHT
        case Sum(terms):
            return sum_of(*(differentiated(term, name) for term in terms))
        case Term(_, powers):
            return sum_of(*(_by_one_power(node, base, exponent, name) for base, exponent in powers))
        case Call():
            return _by_argument(node, name)
    raise TypeError("a comparison has no derivative")


def _by_one_power(product: Node, base: Node, exponent: Node, name: str) -> Node:
    inner, outer = differentiated(base, name), differentiated(exponent, name)
    parts = []
    if inner != NOUGHT:
        lowered = times(
            exponent, product, Term(Fraction(1), ((base, _MINUS_ONE),)), _primitive(inner)
        )
        parts.append(_functions_last(lowered))
    if outer != NOUGHT:
        parts.append(times(product, outer, Call("log", (base,))))
    return sum_of(*parts)


def _primitive(node: Node) -> Node:
    """2 (x − y) instead of 2 x − 2 y."""
    if isinstance(node, Sum):
        factors = [coefficient_and_rest(term)[0] for term in node.terms]
        common = (
            gcd(*(f.numerator for f in factors)) if all(f.denominator == 1 for f in factors) else 1
        )
        if common > 1:
            rest = sum_of(*(times(Number(Fraction(1, common)), term) for term in node.terms))
            return Term(Fraction(common), ((rest, UNITY),))
    return node


def _functions_last(node: Node) -> Node:
    if not isinstance(node, Term):
        return node
    calls = [isinstance(base, Call) and bool(base.arguments) for base, _ in node.powers]
    ordered = [
        p for last in (False, True) for p, c in zip(node.powers, calls, strict=True) if c == last
    ]
    return Term(node.factor, tuple(ordered))


def _by_argument(call: Call, name: str) -> Node:
    inner = [NOUGHT if isinstance(a, Relation) else differentiated(a, name) for a in call.arguments]
    if call.name not in builtins() or call.by:
        parts = [
            times(replace(call, by=(*call.by, str(i))), slope)
            for i, slope in enumerate(inner)
            if slope != NOUGHT
        ]
        if name in call.hidden:
            parts.append(replace(call, by=(*call.by, name)))
        return sum_of(*parts)
    if all(slope == NOUGHT for slope in inner):
        return NOUGHT
    match call.name:
        case "min" | "max":
            return _of_extremum(call, inner)
        case "clip":
            x, low, high = call.arguments
            return choice(
                [(Relation("<", x, low), inner[1]), (Relation(">", x, high), inner[2])], inner[0]
            )
        case "piecewise":
            pairs = [(c, v) for c, v in zip(call.arguments[:-1:2], inner[1:-1:2], strict=True)]
            return choice(pairs, inner[-1])
    arguments = STRUCTURES[call.name].arguments if call.name in STRUCTURES else ("x",)
    values = dict(zip(arguments, call.arguments, strict=True))
    return sum_of(
        *(
            _functions_last(times(inserted(outer, values), _primitive(slope)))
            for outer, slope in zip(_slopes(call.name), inner, strict=True)
            if slope != NOUGHT
        )
    )


def _of_extremum(call: Call, inner: list[Node]) -> Node:
    sign = "<" if call.name == "min" else ">"
    best = call.arguments[0]
    slope = inner[0]
    for argument, its_slope in zip(call.arguments[1:], inner[1:], strict=True):
        slope = choice([(Relation(sign, best, argument), slope)], its_slope)
        best = Call(call.name, (best, argument))
    return slope


def choice(pairs: Iterable[tuple[Node, Node]], otherwise: Node) -> Node:
    """Piecewise function of (condition, value) pairs; a plain value if all are equal."""
    pairs = list(pairs)
    if all(value == otherwise for _, value in pairs):
        return otherwise
    return Call("piecewise", (*(part for pair in pairs for part in pair), otherwise))


def _slopes(name: str) -> list[Node]:
    """The derivatives of a function, in the names of its arguments."""
    if name in STRUCTURES:
        return [_shown(text) for text in STRUCTURES[name].slopes]
    return [_shown(FUNCTIONS[name].shown or FUNCTIONS[name].derivative)]


@cache
def _shown(text: str) -> Node:
    return Reader().read(text)


def names_in(node: Node) -> set[str]:
    """Names an expression depends on, hidden ones included."""
    match node:
        case OfModes(_, weights):
            return {mode for mode, _ in weights}
        case Name(name):
            return {name}
        case InWords():
            return {"t"}
        case Sum(terms):
            parts: Iterable[Node] = terms
        case Term(_, powers):
            parts = [part for pair in powers for part in pair]
        case Call(_, arguments, hidden):
            return set(hidden).union(*map(names_in, arguments))
        case Relation(_, left, right):
            parts = [left, right]
        case _:
            parts = []
    return set().union(*map(names_in, parts))


def inserted(node: Node, values: Mapping[str, Node]) -> Node:
    """Replace names by trees."""
    match node:
        case Name(name):
            return values.get(name, node)
        case Sum(terms):
            return sum_of(*(inserted(term, values) for term in terms))
        case Term(factor, powers):
            replaced = (raised(inserted(b, values), inserted(e, values)) for b, e in powers)
            return times(Number(factor), *replaced)
        case Call():
            return replace(node, arguments=tuple(inserted(a, values) for a in node.arguments))
        case Relation(sign, left, right):
            return Relation(sign, inserted(left, values), inserted(right, values))
    return node


class Reader:
    """Reader of formulas of a checked system, or of no system, into trees.

    Attributes
    ----------
    definitions : dict of str to (arguments, body)
        Functions, drives and outputs of the system, their bodies as trees.
    unknowns : dict of str to OfModes
        Those of structures that have been read.
    """

    def __init__(self, system: System | None = None) -> None:
        declared: dict[str, Drive] = {}
        if system is not None:
            declared |= {**system.functions, **system.drives}
            declared |= {name: o.formula for name, o in system.outputs.items()}
        self._sources: dict[str, tuple[tuple[str, ...], Drive | Table]] = {}
        for key, text in declared.items():
            name, arguments = parse_signature(key, key)
            self._sources[name] = (arguments, text)
        for name, table in {}.items() if system is None else system.tables.items():
            self._sources[name] = (table.arguments, table)
        self._parameters = frozenset(() if system is None else system.parameters)
        self._bodies: dict[str, Node] = {}
        self._read: dict[str, Node] = {}
        self._system = system
        self.unknowns: dict[str, OfModes] = {}
        self.definitions: dict[str, tuple[tuple[str, ...], Node]] = {
            name: (arguments, self._body(name)) for name, (arguments, _) in self._sources.items()
        }

    def read(self, text: Drive | Table) -> Node:
        """Tree of a formula that the declaration has accepted."""
        if isinstance(text, Real):
            return Number(Fraction(repr(float(text))))
        if not isinstance(text, str):  # samples, or a table
            return InWords(str(text))
        if text not in self._read:
            self._read[text] = self._visit(syntax_of(text.strip().replace("\n", " ")))
        return self._read[text]

    def _body(self, name: str) -> Node:
        if name not in self._bodies:
            self._bodies[name] = self.read(self._sources[name][1])
        return self._bodies[name]

    def _hidden(self, name: str) -> tuple[str, ...]:
        known = {*self._parameters, *self._sources[name][0], "pi"}
        return tuple(sorted(names_in(self._body(name)) - known))

    def _visit(self, node: ast.AST) -> Node:
        match node:
            case ast.Constant(value=int() | float() as value):
                return Number(Fraction(repr(value)))
            case ast.Name(id=name):
                return self._named(name)
            case ast.UnaryOp(op=ast.USub(), operand=inner):
                return negate(self._visit(inner))
            case ast.UnaryOp(operand=inner):
                return self._visit(inner)
            case ast.BinOp(op=ast.Add() | ast.Sub()):
                return sum_of(
                    *(
                        self._visit(term) if plus else negate(self._visit(term))
                        for term, plus in _chain(node)
                    )
                )
            case ast.BinOp(left=left, op=op, right=right):
                return _binary(op, self._visit(left), self._visit(right))
            case ast.Compare(left=left, ops=[op], comparators=[right]):
                return Relation(_SIGNS[type(op)], self._visit(left), self._visit(right))
            case ast.Subscript(value=ast.Name(id=name), slice=index):
                return self._of_modes(f"{name}[{ast.unparse(index)}]")
            case ast.Call(func=ast.Name(id=name), args=nodes):
                return self._called(name, tuple(map(self._visit, nodes)))
        raise TypeError(f"not supported in formulas: {type(node).__name__}")

    def _named(self, name: str) -> Node:
        """A name, a drive, an abbreviation, or the rate ``d_ell`` of a drive."""
        if name in self._sources:
            return Call(name, (), self._hidden(name))
        if name.startswith("d_") and self._sources.get(name[2:], (None,))[0] == ():
            return Call(name[2:], (), self._hidden(name[2:]), by=("t",))
        return Name(name)

    def _of_modes(self, name: str) -> OfModes:
        """An unknown of a structure."""
        row = {} if self._system is None else self._system.unknown(name)
        weights = tuple((mode, Fraction(repr(weight))) for mode, weight in row.items())
        return self.unknowns.setdefault(name, OfModes(name, weights))

    def _called(self, name: str, arguments: tuple[Node, ...]) -> Node:
        """A function, or the derivative ``d_mu(s)`` of one of the system's functions."""
        if name == "sqrt":
            return raised(arguments[0], HALF)
        if name in self._sources:
            return Call(name, arguments, self._hidden(name))
        if name.startswith("d_") and name[2:] in self._sources:
            return Call(name[2:], arguments, self._hidden(name[2:]), by=("0",))
        return Call(name, arguments)


def _chain(node: ast.AST) -> list[tuple[ast.AST, bool]]:
    """Terms of a long sum with their signs, first to last; such sums nest too deeply for
    recursion."""
    terms = []
    while isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
        terms.append((node.right, isinstance(node.op, ast.Add)))
        node = node.left
    return [(node, True), *reversed(terms)]


_SIGNS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}


def _binary(op: ast.operator, left: Node, right: Node) -> Node:
    match op:
        case ast.Mult():
            return times(left, right)
        case ast.Div():
            return times(left, raised(right, _MINUS_ONE))
    return raised(left, right)
