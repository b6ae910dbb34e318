"""The functions of a system as Python source, for a GPU and as the oracle of the machine code."""

from __future__ import annotations

from stickslip.equations.codegen.generate import Generated
from stickslip.equations.codegen.series import INDEFINITE, MOST_TURNS, SINGULAR
from stickslip.machine_code.interface import INTERFACE
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.functions import FUNCTIONS
from stickslip.symbolic.scalars import SourceText, Store
from stickslip.symbolic.tape import Instruction, Op, ParameterExpressions, Scaled

_OF_TWO = {
    Op.PRODUCT: "product_order(W, {0}, {1}, k)",
    Op.QUOTIENT: "divide_order(W, {0}, {1}, {row}, k)",
}
_OF_ONE = {
    Op.RECIPROCAL: "inverse_order(W, {0}, {row}, k)",
    Op.EXP: "exp_order(W, {0}, {row}, k)",
    Op.LOG: "log_order(W, {0}, {row}, k)",
}
_PAIRS = {
    Op.ROTATION: "rotation_order",
    Op.STEADY: "steady_rotation_order",
    Op.HYPERBOLIC: "hyperbolic_order",
}


_OPTIONS = "cache=True, nopython=True, error_model='numpy', _nrt=False"
_HEADER = '''"""Generated from a declaration; do not edit."""
import math
import numpy as np
from numba import boolean, cfunc, float64, int64, njit, void
from stickslip.equations.codegen.fused import fma
from stickslip.equations.codegen.series import *
vector, matrix, indices = float64[::1], float64[:, ::1], int64[::1]
'''


def source_of(generated: Generated) -> str:
    """The module of a system, with ``KEPT``, the rows that are read beyond order 0."""
    bodies = {
        "setup": [*_statements(generated.setup), "return"],
        "jets": _jets(generated),
        "residual": [*_statements(generated.residual), "return"],
        "powers": [*_statements(generated.powers), "return"],
        "landings": [*_statements(generated.landings), "return"],
    }
    lines = [_HEADER, f"KEPT = {tuple(generated.layout.kept)}", ""]
    for name, body in bodies.items():
        result, arguments = INTERFACE[name]
        lines += [
            f"@cfunc({result}({', '.join(arguments.values())}), {_OPTIONS})",
            f"def {name}({', '.join(arguments)}):",
            *_indent(body),
            "",
        ]
    return "\n".join(lines)


def _statements(stores: list[Store]) -> list[str]:
    written = SourceText()
    for store in stores:
        written.store(store)
    return written.lines


def _jets(generated: Generated) -> list[str]:
    layout = generated.layout
    n = len(layout.state)
    loop = [
        line
        for instruction in layout.instructions
        for line in printed(instruction, generated.constants)
    ]
    loop += [f"W[{i}, k + 1] = W[{row}, k]*(unit/(k + 1))" for i, row in enumerate(layout.rates)]
    return [
        f"unit = W[{n}, 1]",
        f"for i in range({n}):",
        "    W[i, 0] = y[i]",
        f"W[{n}, 0] = t",
        "for k in range(2, N + 1):",
        f"    W[{n}, k] = 0.0",
        "for k in range(N):",
        *_indent(loop),
        *_statements(generated.sizes),
        "return 0",
    ]


def _indent(lines: list[str]) -> list[str]:
    return ["    " + line for line in lines]


def printed(instruction: Instruction, constants: ParameterExpressions) -> list[str]:
    """Statements that compute order k of the row of an instruction of the tape."""
    i = instruction
    row = instruction.row
    inputs: tuple[int, ...] = i.inputs
    target = f"W[{row}, k] = "
    match i.op:
        case Op.LINEAR:
            return [
                target + (" + ".join(coefficient(part, constants) for part in i.parts) or "0.0")
            ]
        case Op.PRODUCT | Op.QUOTIENT:
            return [target + _OF_TWO[i.op].format(*inputs, row=row)]
        case Op.RECIPROCAL | Op.EXP | Op.LOG:
            return [target + _OF_ONE[i.op].format(*inputs, row=row)]
        case Op.POWER:
            size = f"W[{inputs[-1]}, 0]" if inputs[1:] else "0.0"
            return [
                target + f"power_order(W, {inputs[0]}, {row}, {constants.code(i.parts[0].factor)}, "
                f"{size}, k)"
            ]
        case Op.SIZE:
            return [
                target
                + f"({' + '.join(_modulus(part, constants) for part in i.parts)} if k == 0 else "
                "0.0)"
            ]
        case Op.ROTATION | Op.STEADY | Op.HYPERBOLIC:
            return [f"{_PAIRS[i.op]}(W, {inputs[0]}, {row}, {row + 1}, k)"]
        case Op.CHAIN:
            return [target + _chain(i.function, inputs[0], inputs[1])]
        case Op.TAN | Op.TANH:
            # The slope 1 ± y² is a row of its own, one order behind y.
            sign = "+" if i.op is Op.TAN else "-"
            square = f"product_order(W, {row}, {row}, k)"
            slope = f"W[{row + 1}, k] = (1.0 if k == 0 else 0.0) {sign} {square}"
            return [target + _chain(i.function, inputs[0], row + 1), slope]
        case Op.SELECT:
            above, below = (coefficient(part, constants) for part in i.parts)
            return [target + f"{above} if reg[{i.place}] == 1 else {below}"]
        case Op.SPEED:
            return [target + f"mode[{i.place}]*W[{inputs[0]}, k]"]
        case Op.SIDE:
            return [target + _side(i)]
        case Op.ENTRY:
            return [target + _entry(i, constants)]
        case Op.RIGHT:
            surface, rest, plus, minus = (f"W[{r}, k]" for r in inputs)
            return [target + _by_mode(i.place, surface, f"-{rest} - {plus}", f"-{rest} + {minus}")]
        case Op.SOLVE:
            return [f"solve_order({i.matrix}, {i.place}, W, {inputs[0]}, {row}, {i.size}, k)"]
        case Op.RATES:
            return _rates(i, constants)
        case Op.IMPLICIT:
            return _implicit(i)
        case Op.DIRECTION:
            closed = " and ".join(f"mode[{normal}] == 0" for normal in i.pressed)
            mode = f"mode[{i.place}] if {closed} else 0" if closed else f"mode[{i.place}]"
            return [f"direction_order(W, ({', '.join(map(str, inputs))}), {row}, {mode}, k)"]
        case Op.WITHIN:
            return []
    raise NotImplementedError(i.op)


def coefficient(part: Scaled, constants: ParameterExpressions) -> str:
    """Order k of constant × row."""
    factor = constants.code(part.factor)
    if part.row is None:
        return f"({factor} if k == 0 else 0.0)"
    return f"W[{part.row}, k]" if part.factor is ex.ONE else f"{factor}*W[{part.row}, k]"


def _modulus(part: Scaled, constants: ParameterExpressions) -> str:
    factor = constants.code(part.factor)
    return f"abs({factor})" if part.row is None else f"abs({factor}*W[{part.row}, 0])"


def _by_mode(contact: int, stick: str, plus: str, minus: str) -> str:
    """What depends on the mode of a contact."""
    return f"{stick} if mode[{contact}] == 0 else ({plus} if mode[{contact}] > 0 else {minus})"


def _chain(function: str, a: int, slope: int) -> str:
    first = FUNCTIONS[function].compiled(f"W[{a}, 0]")
    return f"{first} if k == 0 else chain_order(W, {a}, {slope}, k)"


def _side(i: Instruction) -> str:
    """Surface speed in stick; in slip the friction force, against the threshold where it is to be
    broken."""
    surface, plus, minus, static_plus, static_minus = (f"W[{r}, k]" for r in i.inputs)
    if (plus, minus) == (static_plus, static_minus):
        return _by_mode(i.place, surface, f"-{plus}", minus)
    m = f"mode[{i.place}]"
    breaking = f"(-{static_plus} if {m} > 0 else {static_minus})"
    sliding = f"(-{plus} if {m} > 0 else {minus})"
    return f"{surface} if {m} == 0 else ({breaking} if abs({m}) == 2 else {sliding})"


def _entry(i: Instruction, constants: ParameterExpressions) -> str:
    """An entry of the matrix that changes along the motion."""
    own = f"({constants.code(i.parts[0].factor)} if k == 0 else 0.0)"
    stiffness, plus, minus = (f"W[{r}, k]" for r in i.inputs)
    return _by_mode(i.place, own, f"{stiffness} + {plus}", f"{stiffness} - {minus}")


def _implicit(i: Instruction) -> list[str]:
    """The zero of an increasing function at order 0, and the integral of its slope."""
    written = SourceText()
    values = ", ".join(map(written.text, i.zero))
    place = f"W[{i.row}, 0]"
    return [
        "if k == 0:",
        f"    {place} = 0.0",
        "    low, high, last = -FARTHEST, FARTHEST, np.inf",
        f"    for _ in range({MOST_TURNS}):",
        *("        " + line for line in written.lines),
        f"        low, high, last, {place}, going = closer(low, high, last, {place}, {values})",
        "        if not going:",
        "            break",
        "    if going:",
        f"        {place} = np.nan",
        "else:",
        f"    W[{i.row}, k] = W[{i.inputs[0]}, k - 1]*unit/k",
    ]


def _rates(i: Instruction, constants: ParameterExpressions) -> list[str]:
    """Solve A ṙ = b as a series: the inverse at order 0, and what the changes of A take away at the
    others."""
    n = i.size
    right = i.inputs[0]
    inverse = f"{i.matrix}[{i.place}:]"
    first = list[str]()
    later = list[str]()
    for j, entry in enumerate(i.entries):
        place = f"A[{j // n}, {j % n}]"
        if entry.inputs:
            first.append(f"{place} = W[{entry.row}, 0]")
            later.append(
                f"W[{right + j // n}, k] -= lagged_order(W, {entry.row}, {i.row + j % n}, k)"
            )
        else:
            own, stiffness, plus, minus = (constants.code(part.factor) for part in entry.parts)
            first.append(
                f"{place} = "
                + _by_mode(entry.place, own, f"{stiffness} + {plus}", f"{stiffness} - {minus}")
            )
    solved = [
        "if k == 0:",
        *("    " + line for line in first),
        *_refused(f"definite(A, {i.definite}, {inverse})", INDEFINITE if i.definite else None),
        *_refused(f"invert(A, {n}, {inverse})", SINGULAR),
    ]
    return [*solved, *later, f"solve_order({i.matrix}, {i.place}, W, {right}, {i.row}, {n}, k)"]


def _refused(test: str, status: int | None) -> list[str]:
    """Leave with a status where a test fails; None: there is none."""
    return [] if status is None else [f"    if not {test}:", f"        return {status}"]
