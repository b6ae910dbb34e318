"""Lowering of expressions to a tape of rows of Taylor coefficients.

A row holds the Taylor coefficients of one quantity along the motion; every operation gives its k-th coefficient from
coefficients of order at most k of earlier rows. A value that depends on parameters only is a constant ``K[i]``.
The tape is Python source text, made from the expression tree alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from stickslip import expressions as ex
from stickslip.expressions import Expr

CONSTANT_CALLS = {**{f: f"math.{f}" for f in ex.FUNCTIONS}, "exp": "safe_exp"}


@dataclass(frozen=True)
class Scaled:
    """A quantity as (constant code) × row; without row it is the constant itself."""

    factor: str
    row: int | None = None


@dataclass
class Constants:
    """Parameter-only expressions, computed once per set of parameters."""

    parameters: list[str]
    slots: dict[Expr, int] = field(default_factory=dict)

    def code(self, e: Expr) -> str:
        """Code of a constant: a literal or ``K[i]``."""
        if e.op == "num":
            return literal(ex.number(e))
        return f"K[{self.slots.setdefault(e, len(self.slots))}]"

    def is_constant(self, e: Expr) -> bool:
        """Whether the expression depends on parameters only."""
        return e.symbols <= set(self.parameters)

    def source(self) -> list[str]:
        """Body that fills K from the parameter vector p."""
        names = {name: f"p[{i}]" for i, name in enumerate(self.parameters)}
        lines, values = scalar_code(self.slots, names)
        return lines + [f"K[{i}] = {values[e]}" for e, i in self.slots.items()]


def literal(value: float) -> str:
    """A float as source text."""
    return repr(float(value))


def scalar_code(
    targets: Iterable[Expr], names: Mapping[str, str], regions: Mapping[Expr, str] | None = None
) -> tuple[list[str], dict[Expr, str]]:
    """Straight-line scalar code for expressions.

    Parameters
    ----------
    targets : iterable of Expr
    names : mapping of str to str
        Code of each symbol.
    regions : mapping of Expr to str, optional
        Code of the region of each guard; without it the sign of the guard decides.

    Returns
    -------
    lines, values
        Statements, and the code of each expression's value.
    """
    lines: list[str] = []
    values: dict[Expr, str] = {}
    for e in ex.walk(targets):
        if e.op == "num":
            values[e] = literal(ex.number(e))
        elif e.op == "sym":
            values[e] = names[str(e.value)]
        else:
            values[e] = f"s{len(lines)}"
            lines.append(f"{values[e]} = {_scalar(e, values, regions)}")
    return lines, values


def _scalar(e: Expr, v: Mapping[Expr, str], regions: Mapping[Expr, str] | None) -> str:
    match e.op:
        case "sum":
            return " + ".join([literal(float(e.value)), *(f"{literal(c)}*{v[term]}" for term, c in e.terms)])
        case "prod":
            return "*".join(_scalar_power(v[base], p) for base, p in e.terms)
        case "pow":
            return f"real_power({v[e.args[0]]}, {v[e.args[1]]})"
        case "select":
            guard, above, below = e.args
            test = f"{regions[guard]} == 1" if regions is not None else f"{v[guard]} >= 0.0"
            return f"{v[above]} if {test} else {v[below]}"
        case _:
            return f"{'math.' if e.op not in ('exp', 'log') else 'safe_'}{e.op}({v[e.args[0]]})"


def _scalar_power(base: str, p: float) -> str:
    if p == 1.0:
        return base
    if p == 2.0:
        return f"{base}*{base}"
    if p == -1.0:
        return f"reciprocal({base})"
    return f"real_power({base}, {literal(p)})"


class Tape:
    """Rows and statements for a set of expressions."""

    def __init__(
        self, constants: Constants, rows: Mapping[str, int], first_free: int, regions: Mapping[Expr, int]
    ) -> None:
        self.constants, self.regions = constants, regions
        self.names = dict(rows)
        self.rows = first_free
        self.stage = dict.fromkeys(rows.values(), 0)
        self.statements: dict[int, list[str]] = {0: [], 1: [], 2: [], 3: []}
        self._known: dict[Expr, Scaled] = {}
        self._own: dict[Expr, int] = {}
        self._products: dict[tuple[int, int], int] = {}
        self._pairs: dict[tuple[str, Expr], tuple[int, int]] = {}

    def new_row(self, stage: int = 0) -> int:
        """A fresh row that becomes known at a stage."""
        self.stage[self.rows] = stage
        self.rows += 1
        return self.rows - 1

    def name(self, symbol: str, row: int, stage: int) -> None:
        """Let a symbol stand for a row."""
        self.names[symbol] = row
        self.stage[row] = stage

    def emit(self, stage: int, text: str) -> None:
        """Add a statement that computes order k of a row."""
        self.statements[stage].append(text)

    def lower(self, e: Expr) -> Scaled:
        """Make the expression available as a scaled row."""
        if e not in self._known:
            constant = self.constants.is_constant(e)
            self._known[e] = Scaled(self.constants.code(e)) if constant else self._lower(e)
        return self._known[e]

    def row(self, e: Expr) -> int:
        """Make the expression available as a row of its own."""
        scaled = self.lower(e)
        if scaled.row is not None and scaled.factor == "1.0":
            return scaled.row
        if e not in self._own:
            self._own[e] = self.assign([scaled], None)
        return self._own[e]

    def into(self, e: Expr, row: int) -> int:
        """Write the expression to a given row; returns its stage."""
        scaled = self.lower(e)
        self.assign([scaled], row)
        return self.stage[row]

    def assign(self, parts: list[Scaled], row: int | None, constant: str = "0.0") -> int:
        """Row of a linear combination."""
        dynamic = [p for p in parts if p.row is not None]
        fixed = [p.factor for p in parts if p.row is None] + ([constant] if constant != "0.0" else [])
        stage = max([self.stage[p.row] for p in dynamic if p.row is not None], default=0)
        row = self.new_row(stage) if row is None else row
        self.stage[row] = stage
        terms = [f"W[{p.row}, k]" if p.factor == "1.0" else f"{p.factor}*W[{p.row}, k]" for p in dynamic]
        if fixed:
            terms.append(f"({' + '.join(fixed)} if k == 0 else 0.0)")
        self.emit(stage, f"W[{row}, k] = {' + '.join(terms) or '0.0'}")
        return row

    def _operation(self, text: str, *inputs: int) -> int:
        stage = max(self.stage[i] for i in inputs)
        row = self.new_row(stage)
        self.emit(stage, text.format(r=row))
        return row

    def _lower(self, e: Expr) -> Scaled:
        match e.op:
            case "sym":
                return Scaled("1.0", self.names[str(e.value)])
            case "sum":
                parts = []
                for term, c in e.terms:
                    part = self.lower(term)
                    parts.append(Scaled(_times(literal(c), part.factor), part.row))
                if e.value == 0.0 and len(parts) == 1:
                    return parts[0]
                return Scaled("1.0", self.assign(parts, None, literal(float(e.value))))
            case "prod":
                return self._product(e)
            case "pow":
                base, exponent = e.args
                if self.constants.is_constant(exponent):
                    a = self.row(base)
                    p = self.constants.code(exponent)
                    return Scaled("1.0", self._operation(f"W[{{r}}, k] = power_order(W, {a}, {{r}}, {p}, k)", a))
                return self.lower(ex.call("exp", exponent * ex.call("log", base)))
            case "select":
                return self._select(e)
        return self._function(e)

    def _product(self, e: Expr) -> Scaled:
        factor, above, below = "1.0", list[int](), list[int]()
        for base, p in e.terms:
            if self.constants.is_constant(base):
                factor = _times(factor, self.constants.code(ex.power(base, ex.num(p))))
                continue
            scaled = self.lower(base)
            if p.is_integer() and abs(p) <= 8:
                row = scaled.row
                assert row is not None and scaled.factor == "1.0"  # numbers stand in front of a product
                (above if p > 0 else below).extend([row] * int(abs(p)))
            else:
                a = self.row(base)
                above.append(self._operation(f"W[{{r}}, k] = power_order(W, {a}, {{r}}, {literal(p)}, k)", a))
        numerator = self._chain(above)
        if not below:
            return Scaled(factor, numerator)
        denominator = self._chain(below)
        assert denominator is not None
        if numerator is None:
            return Scaled(
                factor, self._operation(f"W[{{r}}, k] = inverse_order(W, {denominator}, {{r}}, k)", denominator)
            )
        return Scaled(
            factor,
            self._operation(
                f"W[{{r}}, k] = divide_order(W, {numerator}, {denominator}, {{r}}, k)", numerator, denominator
            ),
        )

    def _chain(self, rows: list[int]) -> int | None:
        """Row of a product of rows, sharing the partial products."""
        if not rows:
            return None
        rows = sorted(rows)
        result = rows[0]
        for other in rows[1:]:
            key = (min(result, other), max(result, other))
            if key not in self._products:
                text = f"W[{{r}}, k] = product_order(W, {result}, {other}, k)"
                self._products[key] = self._operation(text, result, other)
            result = self._products[key]
        return result

    def _select(self, e: Expr) -> Scaled:
        guard, above, below = e.args
        a, b = self.lower(above), self.lower(below)
        stage = max((self.stage[x.row] for x in (a, b) if x.row is not None), default=0)
        row = self.new_row(stage)

        def coefficient(s: Scaled) -> str:
            return f"({s.factor} if k == 0 else 0.0)" if s.row is None else f"{s.factor}*W[{s.row}, k]"

        region = f"reg[{self.regions[guard]}]"
        self.emit(stage, f"W[{row}, k] = {coefficient(a)} if {region} == 1 else {coefficient(b)}")
        return Scaled("1.0", row)

    def _function(self, e: Expr) -> Scaled:
        (x,) = e.args
        a = self.row(x)
        if e.op in ("sin", "cos", "sinh", "cosh"):
            hyperbolic = e.op.endswith("h")
            family = "h" if hyperbolic else ""
            pair = self._pairs.get((family, x))
            if pair is None:
                stage = self.stage[a]
                pair = self._pairs[family, x] = (self.new_row(stage), self.new_row(stage))
                steady = x.symbols - set(self.constants.parameters) == {"t"} and self.constants.is_constant(
                    ex.derivative(x, "t")
                )
                name = ("steady_" if steady else "") + ("hyperbolic_order" if hyperbolic else "rotation_order")
                self.emit(stage, f"{name}(W, {a}, {pair[0]}, {pair[1]}, k)")
            return Scaled("1.0", pair[0] if e.op.startswith("sin") else pair[1])
        if e.op == "exp":
            return Scaled("1.0", self._operation(f"W[{{r}}, k] = exp_order(W, {a}, {{r}}, k)", a))
        if e.op == "log":
            return Scaled("1.0", self._operation(f"W[{{r}}, k] = log_order(W, {a}, {{r}}, k)", a))
        if e.op in ("atan", "asinh"):
            slope = self.row(1.0 / (1.0 + x**2.0) if e.op == "atan" else (1.0 + x**2.0) ** -0.5)
            text = f"W[{{r}}, k] = math.{e.op}(W[{a}, 0]) if k == 0 else chain_order(W, {a}, {slope}, k)"
            return Scaled("1.0", self._operation(text, a, slope))
        # tan and tanh: the slope 1 ± y² is a row of its own, one order behind y.
        stage = self.stage[a]
        y, slope = self.new_row(stage), self.new_row(stage)
        sign = "+" if e.op == "tan" else "-"
        self.emit(stage, f"W[{y}, k] = math.{e.op}(W[{a}, 0]) if k == 0 else chain_order(W, {a}, {slope}, k)")
        self.emit(stage, f"W[{slope}, k] = (1.0 if k == 0 else 0.0) {sign} product_order(W, {y}, {y}, k)")
        return Scaled("1.0", y)


def _times(a: str, b: str) -> str:
    if a == "1.0":
        return b
    return a if b == "1.0" else f"{a}*{b}"
