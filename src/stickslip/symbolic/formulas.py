"""The formula language: text -> expression tree, by whitelist.

Python's own parser reads the text; the tree is then translated node by node. Whatever is not a
number, a known name, an arithmetic operation or a listed function is refused. Nothing is ever
evaluated by Python.

Of every drive ``f`` and every function ``f(x)`` of one argument the derivative is known as ``d_f``
and ``d_f(x)`` (within each region, where the function has kinks), so that nobody has to type it in.
"""

from __future__ import annotations

import ast
import math
import re
import threading
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Real
from typing import Any, TypeGuard

from stickslip.errors import DeclarationError, short, suggestion
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.functions import language
from stickslip.symbolic.pieces import STRUCTURES

_PARSER = threading.Lock()
# Limits of a text that is parsed in one step. A sum may be long, since its terms are parsed one by
# one; other formulas may not, since products of many factors have derivatives of as many terms, and
# Python's parser recurses.
_MAX_LENGTH = 4000  # largest number of characters
_MAX_NODES = 1500
_MAX_DEPTH = 60  # largest depth of brackets in a formula
_MAX_HEIGHT = 120  # largest depth of an expression after insertion of all functions
_MAX_WORK = 40_000  # largest number of nodes for one formula with the functions inserted
_WORK_OF_TERM = 100  # additional nodes for each term of a long sum
_LONGEST = 4_000_000  # largest number of characters of a sum
_LONG = 1000  # number of characters above which a formula is parsed term by term
_PIECE = "_piece"  # prefix of the parsed parts of a long formula, which no name has

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*\Z")
_TOKEN = re.compile(
    r"\s+|(?P<operand>(?:\d[\d_]*\.?[\d_]*|\.\d[\d_]*)(?:[eE][+-]?\d+)?|[A-Za-z]\w*(?:\[\s*\w*\s*\])?)"
    r"|(?P<sign>[+-])|(?P<open>\()|(?P<close>\))|(?P<comma>,)|\*\*|[*/<>=]"
)
_OF_NUMPY = re.compile(r"\b(?:np|numpy)\.(?:float|int|uint)\d+\(([^()]*)\)")
"""How NumPy writes its numbers, np.float64(0.5): so they come out of f-strings."""
_SIGNATURE = re.compile(r"\s*([A-Za-z][A-Za-z0-9_]*)\s*(?:\(([^()]*)\))?\s*\Z")
_ELSEWHERE = {
    "ln": "log(x)",
    "log10": "log(x)/log(10)",
    "log2": "log(x)/log(2)",
    "exp2": "2**x",
    "cbrt": "sign(x)*abs(x)**(1/3)",
    "pow": "x**y",
    "arctan2": "atan(y/x)",
    "atan2": "atan(y/x)",
    "ceil": "-floor(-x)",
    "round": "floor(x + 1/2)",
    "frac": "mod(x, 1)",
    "fmod": "mod(x, m)",
    "signum": "sign(x)",
    "step": "heaviside(x)",
    "hypot": "sqrt(x**2 + y**2)",
    "where": "piecewise(x < 0, a, b)",
}  # notations of other languages, and their equivalents here
_CONSTANTS = {"pi": ex.num(math.pi)}
_RESERVED = frozenset(_CONSTANTS) | {"t", "speed"}


def builtins() -> dict[str, int | None]:
    """Functions of the language with the number of their arguments (None: at least one): those of
    the table, and those composed of others."""
    made = {name: None if s.several else len(s.arguments) for name, s in STRUCTURES.items()}
    return made | dict.fromkeys(language(), 1) | {"piecewise": None}


class TimeFunction(ABC):
    """A function of time that is not a formula: samples."""

    @abstractmethod
    def at(self, t: Expr) -> Expr:
        """The value as an expression of one that increases with time."""

    @abstractmethod
    def covers(self, start: float, stop: float) -> bool:
        """Whether it determines all times in a span."""

    @abstractmethod
    def count(self, start: float, stop: float) -> int:
        """Maximum number of kinks in a span."""

    @abstractmethod
    def plain(self) -> dict[str, Any]:
        """Plain data for a model file."""

    @property
    @abstractmethod
    def span(self) -> tuple[float, float]:
        """The first and the last time of which it does."""

    @property
    def ends(self) -> bool:
        """Whether the function is undefined after some time."""
        return not self.covers(0.0, math.inf)


class TableFunction(ABC):
    """A function of one or two arguments that is not a formula: a table."""

    @abstractmethod
    def at(self, arguments: Sequence[Expr], read: Callable[[object], Expr]) -> Expr:
        """The value as an expression of others; `read` parses formulas in it.

        Raises
        ------
        ZeroDivisionError
            If it has no value there.
        """


class Indexed(ABC):
    """Numbers of which a formula names one, as in ``u[3]`` or ``u[tip]``."""

    @property
    @abstractmethod
    def symbols(self) -> frozenset[str]:
        """Symbols in its entries."""

    @property
    @abstractmethod
    def shown(self) -> tuple[int | str, ...]:
        """Keys of the entries that messages list."""

    @abstractmethod
    def entry(self, key: int | str) -> Expr:
        """The entry with a number, counted from 0, or with a name.

        Raises
        ------
        KeyError
            If there is no such entry; the argument lists those that exist.
        """


@dataclass(frozen=True)
class Definition:
    """A function of the declaration: ``H_R(psi)`` (arguments) or a plain abbreviation (none).

    Attributes
    ----------
    by : str
        Name by which the text is differentiated, if this is a derivative.
    """

    where: str
    arguments: tuple[str, ...]
    text: object
    by: str = ""


def syntax_of(text: str) -> ast.expr:
    """The syntax tree of a formula, which is not evaluated.

    Up to Python 3.11.7 the parser counts the recursion of all threads together, and raises
    SystemError where two of them parse at once (CPython issue 106905).

    Raises
    ------
    SyntaxError
        If it is not an expression of Python.
    """
    with _PARSER:
        return ast.parse(text, mode="eval").body


@dataclass
class Scope:
    """Meanings of names in a formula.

    Attributes
    ----------
    names : mapping of str to Expr
        Names that may be used.
    definitions : mapping of str to Definition
        Functions that the declaration defines.
    forbidden : mapping of str to str
        Names that exist but may not be used here, with the reason.
    rows : frozenset of str
        Rows of the table of functions that this may name, beside those that any formula may.
    vectors : mapping of str to Indexed
        Names that stand with an index.
    jumping : dict of Expr to str
        The guards of functions with jumps that were read so far, with the names of these.
    """

    names: Mapping[str, Expr]
    definitions: Mapping[str, Definition] = field(default_factory=dict)
    forbidden: Mapping[str, str] = field(default_factory=dict)
    rows: frozenset[str] = frozenset()
    vectors: Mapping[str, Indexed] = field(default_factory=dict[str, Indexed])
    jumping: dict[Expr, str] = field(default_factory=dict)
    _open: list[str] = field(default_factory=list)
    _known: dict[tuple, Expr] = field(default_factory=dict)
    _work: int = 0

    def parse(self, text: object, where: str) -> Expr:
        """Expression of a formula: of its text, a number, or the expression itself.

        Raises
        ------
        DeclarationError
            If the text is not a formula, or uses what is not known.
        """
        self._work = 0
        return _Reader(self, where, {}).read(text)

    def check(self, name: str) -> None:
        """Parse a definition with its arguments, so that an error is found even if nothing uses
        it."""
        self._work = 0
        definition = self.definitions[name]
        self.apply(name, tuple(ex.sym(a) for a in definition.arguments), definition.where)

    def listed(self, bound: Iterable[str] = ()) -> list[str]:
        """Names of numbers that messages may list, those of entries of vectors first.

        Parameters
        ----------
        bound : iterable of str
            Arguments of the function that is read.
        """
        entries = [f"{name}[{key}]" for name, v in self.vectors.items() for key in v.shown]
        return list(dict.fromkeys([*entries, *bound, *self.names, *self.definitions]))

    def apply(self, name: str, arguments: tuple[Expr, ...], where: str) -> Expr:
        """Value of a function of the declaration."""
        definition = self.definitions[name]
        if len(arguments) != len(definition.arguments):
            wanted = f"{name}({', '.join(definition.arguments)})" if definition.arguments else name
            raise DeclarationError(
                where,
                f"'{name}' takes {len(definition.arguments)} argument(s), got {len(arguments)}",
                f"Write {wanted}",
            )
        if name in self._open:
            chain = " -> ".join([*self._open[self._open.index(name) :], name])
            raise DeclarationError(
                definition.where, f"cyclic definition: {chain}", "Remove the cycle"
            )
        key = (name, arguments)
        if key not in self._known:
            self._open.append(name)
            try:
                self._known[key] = self._insert(definition, arguments)
            finally:
                self._open.pop()
        return self._known[key]

    def _insert(self, definition: Definition, arguments: tuple[Expr, ...]) -> Expr:
        if not definition.by:
            bound = dict(zip(definition.arguments, arguments, strict=True))
            return _Reader(self, definition.where, bound).read(definition.text)
        # The argument is differentiated as a symbol that no formula can name, and inserted
        # afterwards.
        symbols = {name: ex.sym(f"{name}'") for name in definition.arguments}
        body = _Reader(self, definition.where, symbols).read(definition.text)
        slope = ex.derivative(body, str(symbols.get(definition.by, ex.sym(definition.by)).value))
        return ex.substitute(
            slope, {f"{name}'": e for name, e in zip(definition.arguments, arguments, strict=True)}
        )


def is_finite(value: object) -> TypeGuard[float]:
    """Whether it is a number of any kind (but no bool) and fits into a float."""
    try:
        return (
            isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(float(value))
        )
    except OverflowError:
        return False


def compared(text: str, where: str) -> tuple[str, str, str]:
    """The two sides of a comparison, and its sign between them; each side may contain further
    comparisons in brackets.

    Raises
    ------
    DeclarationError
        If the text is no comparison of two formulas.
    """
    depth, signs = 0, []
    for match in re.finditer(r"[(]|[)]|[<>]=?", text):
        depth += {"(": 1, ")": -1}.get(match.group(), 0)
        if depth == 0 and match.group() != ")":
            signs.append(match)
    if len(signs) != 1:
        raise DeclarationError(
            where, "a condition must compare two formulas", "Write it like 'P > rho + c'"
        )
    return text[: signs[0].start()], signs[0].group(), text[signs[0].end() :]


def formula_text(expression: Expr, where: str) -> str:
    """An expression as a text that is read as the same one.

    Raises
    ------
    DeclarationError
        If it is too long for that.
    """
    text = ex.to_text(expression)
    if "..." in text:
        raise DeclarationError(
            where, "the expression is too long to be written as text", "Simplify the formula"
        )
    return text


def parse_signature(text: str, where: str) -> tuple[str, tuple[str, ...]]:
    """Name and arguments of ``H_R(psi)``."""
    match = _SIGNATURE.match(text)
    if not match:
        raise DeclarationError(
            where,
            f"'{short(text)}' is not a name or a name with arguments",
            "Write it like 'H_R(psi)'",
        )
    arguments = tuple(a.strip() for a in match[2].split(",")) if match[2] is not None else ()
    for name in (match[1], *arguments):
        check_name(name, where)
    if len(set(arguments)) < len(arguments):
        raise DeclarationError(
            where, "two arguments have the same name", "Use a different name for each argument"
        )
    return match[1], arguments


def check_name(name: str, where: str, taken: Iterable[str] = ()) -> None:
    """Reject a name that is no identifier, is reserved, or is taken."""
    if not NAME.match(name):
        raise DeclarationError(
            where,
            f"'{short(name)}' is not a name",
            "Use letters, digits and _, starting with a letter",
        )
    if name in _RESERVED or name in builtins():
        raise DeclarationError(
            where, f"'{name}' has a fixed meaning in formulas", "Choose another name"
        )
    if name in taken:
        raise DeclarationError(where, f"the name '{name}' is declared twice", "Rename one of them")


class _Reader:
    """Translates one formula."""

    def __init__(self, scope: Scope, where: str, bound: Mapping[str, Expr]) -> None:
        self.scope = scope
        self.where = where
        self.bound = bound
        self.held: dict[str, Expr] = {}
        self.count = 0
        self.pieces = 0

    def fail(self, reason: str, remedy: str = "") -> DeclarationError:
        return DeclarationError(self.where, reason, remedy)

    def read(self, text: object) -> Expr:
        if isinstance(text, Expr):
            return self.tree(text)
        if isinstance(text, TimeFunction):
            return text.at(self.name("t"))
        if isinstance(text, TableFunction):
            return self.tabulated(text)
        if is_finite(text):
            return ex.num(float(text))
        if isinstance(text, Real) and not isinstance(text, bool):
            raise self.fail("the number is not finite", "Give a finite number")
        if not isinstance(text, str):
            raise self.fail(
                f"expected a formula, got {type(text).__name__}", "Write the formula as a string"
            )
        if not text.strip():
            raise self.fail("the formula is empty", "Write a formula, or 0")
        if "#" in text:  # the rest of the text, also on further lines, would not be read
            raise self.fail("'#' is not allowed in a formula", "Put comments outside the formula")
        if len(text) > _LONGEST:
            raise self.fail(
                f"the formula has {len(text)} characters (at most {_LONGEST})",
                "Use functions to shorten it",
            )
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                return self.whole(_OF_NUMPY.sub(r"(\1)", text.replace("\n", " ")), 0)
        except SyntaxError as error:
            raise self.fail(
                f"'{short(text)}' is not a formula ({error.msg})", "Check operators and brackets"
            ) from None
        except DeclarationError:
            raise
        except (RecursionError, MemoryError, ValueError):
            raise self.fail(f"'{short(text)}' cannot be parsed", "Simplify the formula") from None
        except OverflowError:
            raise self.fail(
                f"'{short(text)}' contains a number that is too large", "Use numbers below 1e308"
            ) from None
        except ZeroDivisionError as error:
            raise self.fail(
                f"'{short(text)}' cannot be evaluated ({error})", "Correct the formula"
            ) from None

    def tabulated(self, table: TableFunction) -> Expr:
        """A table at the arguments of its definition; formulas in it know none of these."""
        try:
            return table.at([*self.bound.values()], _Reader(self.scope, self.where, {}).read)
        except ZeroDivisionError as error:
            raise self.fail(
                str(error), "Extend the table, or set 'outside' to extrapolate"
            ) from None

    def tree(self, expression: Expr) -> Expr:
        """An expression whose names have their meanings in formulas."""
        if expression.depth > _MAX_HEIGHT:
            raise self.fail("the expression is too deeply nested", "Simplify the formula")
        meaning = {name: self.name(name) for name in sorted(expression.symbols)}
        return ex.substitute(expression, meaning)

    def whole(self, text: str, depth: int) -> Expr:
        """The value of a text; a long sum is read term by term, in its brackets, too."""
        if len(text) <= _LONG:
            return self.piece(text, depth)
        terms, brackets = _parts(text)
        if len(terms) > 1:
            return ex.add(*((self.whole(term, depth), sign) for term, sign in terms))
        short_text, end = "", 0
        for start, stop in brackets:
            if stop - start > _LONG // 2 and depth < _MAX_DEPTH:
                name = f"{_PIECE}{len(self.held)}"
                self.held[name] = self.whole(text[start:stop], depth + 1)
                short_text += f"{text[end:start]}{name}"
                end = stop
        return self.piece(short_text + text[end:], depth)

    def piece(self, text: str, depth: int) -> Expr:
        """The value of a text that is read at once."""
        if len(text) > _MAX_LENGTH:
            raise self.fail(
                f"a term of the formula has {len(text)} characters (at most {_MAX_LENGTH})",
                "Use functions to shorten it",
            )
        self.count = 0
        self.pieces += 1
        return self.visit(syntax_of(text.strip()), depth)

    def visit(self, node: ast.AST, depth: int) -> Expr:
        self.tally(depth)
        value = self.translate(node, depth)
        if value.depth > _MAX_HEIGHT:
            raise self.fail(
                "the formula is too deeply nested once its functions are inserted",
                "Simplify the formula",
            )
        return value

    def tally(self, depth: int = 0) -> None:
        """Count one more node."""
        self.count += 1
        self.scope._work += 1
        if self.count > _MAX_NODES or depth > _MAX_DEPTH:
            raise self.fail(
                "the formula is too long or too deeply nested", "Use functions to shorten it"
            )
        if self.scope._work > _MAX_WORK + _WORK_OF_TERM * self.pieces:
            raise self.fail(
                "the formula is too long once its functions are inserted",
                "Simplify the functions it uses",
            )

    def translate(self, node: ast.AST, depth: int) -> Expr:
        match node:
            case ast.Constant(value=bool() | str() | bytes() | complex() | None):
                raise self.fail(f"{node.value!r} is not a number", "Use numbers and names only")
            case ast.Constant(value=int() | float() as value):
                return ex.num(float(value))
            case ast.Name(id=name):
                return self.name(name)
            case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign, operand=inner):
                value = self.visit(inner, depth + 1)
                return -value if isinstance(sign, ast.USub) else value
            case ast.BinOp():
                return self.chain(node, depth)
            case ast.Call():
                return self.call(node, depth)
            case ast.Subscript(value=ast.Name(id=name), slice=index):
                return self.entry(name, index)
            case ast.Compare():
                raise self.fail(
                    "a comparison is allowed inside piecewise(...) only",
                    "Write piecewise(x < 0, a, b)",
                )
        kind = type(node).__name__.lower()
        raise self.fail(
            f"this Python construct is not allowed in formulas ({kind})",
            "Use numbers, names, + - * / **, brackets and " + ", ".join(sorted(builtins())),
        )

    def chain(self, node: ast.expr, depth: int) -> Expr:
        """A sum or product from left to right: as long as it may be, it is not nested."""
        rest = list[tuple[ast.operator, ast.expr]]()
        while isinstance(node, ast.BinOp):
            rest.append((node.op, node.right))
            node = node.left
            self.tally()
        terms = [(self.visit(node, depth + 1), 1.0)]
        for op, right in reversed(rest):
            operand = self.visit(right, depth + 1)
            if isinstance(op, ast.Add | ast.Sub):
                terms.append((operand, 1.0 if isinstance(op, ast.Add) else -1.0))
            else:
                terms = [(self.binary(op, _sum(terms), operand), 1.0)]
        return _sum(terms)

    def binary(self, op: ast.operator, a: Expr, b: Expr) -> Expr:
        match op:
            case ast.Mult():
                return a * b
            case ast.Div():
                return a / b
            case ast.Pow():
                return a**b
            case ast.BitXor():
                raise self.fail("'^' is not a power operator", "Write ** for powers")
            case ast.Mod():
                raise self.fail("'%' is not an operator of formulas", "Write mod(x, m)")
            case ast.FloorDiv():
                raise self.fail("'//' is not an operator of formulas", "Write floor(x/y)")
        raise self.fail(f"unknown operator ({type(op).__name__})", "Use + - * / **")

    def name(self, name: str) -> Expr:
        if name in self.bound:
            return self.bound[name]
        if name in self.held:
            return self.held[name]
        if name in _CONSTANTS:
            return _CONSTANTS[name]
        if name in self.scope.names:
            return self.scope.names[name]
        if name in self.scope.definitions:
            return self.scope.apply(name, (), self.where)
        if name in self.scope.forbidden:
            raise self.fail(f"'{name}' is not allowed here", self.scope.forbidden[name])
        if name in builtins():
            raise self.fail(f"'{name}' is a function", f"Write {name}(...)")
        public = sorted(x for x in self.scope.listed(self.bound) if not x.startswith("_"))
        remedy = suggestion(name, public, accepts=_Reader(self.scope, self.where, self.bound).read)
        raise self.fail(f"unknown name '{short(name)}'", remedy)

    def entry(self, name: str, index: ast.expr) -> Expr:
        """One component of a vector."""
        if name not in self.scope.vectors:
            if name in self.scope.forbidden:
                raise self.fail(f"'{name}' is not allowed here", self.scope.forbidden[name])
            if name in self.bound or name in self.scope.names or name in self.scope.definitions:
                raise self.fail(f"'{name}' is a single number", f"Write {name} without an index")
            raise self.unknown("structure", name, self.scope.vectors)
        match index:
            case ast.Name(id=key) | ast.Constant(value=int(key)) if not isinstance(key, bool):
                pass
            case _:
                raise self.fail(
                    f"the index of '{name}' is not a number or a name",
                    f"Write {name}[0], {name}[1], ..., or {name}[tip] with a name",
                )
        try:
            return self.scope.vectors[name].entry(key)
        except KeyError as error:
            raise self.fail(f"unknown component {name}[{short(str(key))}]", error.args[0]) from None

    def unknown(self, kind: str, name: str, known: Iterable[str]) -> DeclarationError:
        public = sorted(x for x in known if not x.startswith("_"))
        return self.fail(f"unknown {kind} '{short(name)}'", suggestion(name, public))

    def call(self, node: ast.Call, depth: int) -> Expr:
        if not isinstance(node.func, ast.Name) or node.keywords:
            raise self.fail("only plain functions can be called", "Write f(x)")
        name = node.func.id
        if name == "piecewise":
            return self.piecewise(node.args, depth)
        if any(isinstance(a, ast.Starred) for a in node.args):
            raise self.fail("'*' is not allowed before an argument", "List the arguments")
        known = builtins() | dict.fromkeys(self.scope.rows, 1)
        if name not in known and name not in self.scope.definitions:
            if name in _ELSEWHERE:
                raise self.fail(f"unknown function '{name}'", f"Write {_ELSEWHERE[name]}")
            raise self.unknown("function", name, [*known, *self.scope.definitions])
        arguments = tuple(self.visit(a, depth + 1) for a in node.args)
        if name in self.scope.definitions:
            return self.scope.apply(name, arguments, self.where)
        wanted = known[name]
        if (wanted is not None and len(arguments) != wanted) or not arguments:
            named = STRUCTURES[name].arguments if name in STRUCTURES else ("x",)
            raise self.fail(
                f"'{name}' takes {wanted or 'at least 1'} argument(s), got {len(arguments)}",
                f"Write {name}({', '.join(named)})",
            )
        if name in STRUCTURES and name not in self.scope.rows:
            return self.structure(name, arguments)
        return ex.call(name, arguments[0])

    def structure(self, name: str, arguments: tuple[Expr, ...]) -> Expr:
        value = STRUCTURES[name].made(*arguments)
        if STRUCTURES[name].jumps:
            inside = set(ex.walk(arguments))
            for e in ex.walk([value]):
                if e.op == "select" and e not in inside:
                    self.scope.jumping[e.args[0]] = name
        return value

    def piecewise(self, nodes: list[ast.expr], depth: int) -> Expr:
        if len(nodes) < 3 or len(nodes) % 2 == 0:
            raise self.fail(
                "the arguments of piecewise are condition, value, ..., and a final value",
                "Write piecewise(x < 0, a, x < 1, b, c)",
            )
        value = self.visit(nodes[-1], depth + 1)
        for condition, branch in reversed(list(zip(nodes[:-1:2], nodes[1:-1:2], strict=True))):
            value = self.choose(condition, self.visit(branch, depth + 1), value, depth)
        return value

    def choose(self, condition: ast.expr, above: Expr, below: Expr, depth: int) -> Expr:
        match condition:
            case ast.Compare(
                left=left,
                ops=[ast.Lt() | ast.LtE() | ast.Gt() | ast.GtE() as op],
                comparators=[right],
            ):
                a, b = self.visit(left, depth + 1), self.visit(right, depth + 1)
                margin = a - b if isinstance(op, ast.Gt | ast.GtE) else b - a
                return ex.select(margin, above, below, strict=isinstance(op, ast.Lt | ast.Gt))
        raise self.fail(
            "a condition of piecewise must compare two values",
            "Write x < a, x <= a, x > a or x >= a",
        )


def _sum(terms: list[tuple[Expr, float]]) -> Expr:
    """A sum; one term is itself."""
    return terms[0][0] if len(terms) == 1 else ex.add(*terms)


def _parts(text: str) -> tuple[list[tuple[str, float]], list[tuple[int, int]]]:
    """Terms of a formula with their signs, and the places of the contents of those outermost
    brackets that contain one value; the text itself if it is not a formula."""
    depth = place = start = begin = 0
    ends = listed = False  # whether an operand ends here; whether there are commas in the bracket
    sign = 1.0
    terms: list[tuple[str, float]] = []
    brackets: list[tuple[int, int]] = []
    while place < len(text):
        token = _TOKEN.match(text, place)
        if token is None:
            return [(text, 1.0)], []
        place = token.end()
        match token.lastgroup:
            case "open":
                if depth == 0:
                    begin, listed = place, False
                depth += 1
            case "close":
                depth -= 1
                if depth == 0 and not listed:
                    brackets.append((begin, place - 1))
            case "comma":
                listed = listed or depth == 1
            case "sign" if depth == 0 and ends:
                terms.append((text[start : place - 1], sign))
                start, sign = place, 1.0 if token.group() == "+" else -1.0
        if depth < 0:
            return [(text, 1.0)], []
        if not token.group().isspace():
            ends = token.lastgroup in ("operand", "close")
    return [*terms, (text[start:], sign)], brackets
