"""Instructions of a tape as Python source: order k of every row."""

from __future__ import annotations

from stickslip.symbolic import expressions as ex
from stickslip.symbolic.functions import FUNCTIONS
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


def printed(instruction: Instruction, constants: ParameterExpressions) -> list[str]:
    """Statements that compute order k of the row of an instruction."""
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
            return [target + by_mode(i.place, surface, f"-{rest} - {plus}", f"-{rest} + {minus}")]
        case Op.SOLVE:
            return [f"solve_order({i.matrix}, W, {inputs[0]}, {row}, {i.size}, k)"]
        case Op.RATES:
            return _rates(i, constants)
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


def by_mode(contact: int, stick: str, plus: str, minus: str) -> str:
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
        return by_mode(i.place, surface, f"-{plus}", minus)
    m = f"mode[{i.place}]"
    breaking = f"(-{static_plus} if {m} > 0 else {static_minus})"
    sliding = f"(-{plus} if {m} > 0 else {minus})"
    return f"{surface} if {m} == 0 else ({sliding} if abs({m}) == 1 else {breaking})"


def _entry(i: Instruction, constants: ParameterExpressions) -> str:
    """An entry of the matrix that changes along the motion."""
    own = f"({constants.code(i.parts[0].factor)} if k == 0 else 0.0)"
    stiffness, plus, minus = (f"W[{r}, k]" for r in i.inputs)
    return by_mode(i.place, own, f"{stiffness} + {plus}", f"{stiffness} - {minus}")


def _rates(i: Instruction, constants: ParameterExpressions) -> list[str]:
    """Solve A ṙ = b as a series: the inverse at order 0, and what the changes of A take away at the
    others."""
    n = i.size
    right = i.inputs[0]
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
                + by_mode(entry.place, own, f"{stiffness} + {plus}", f"{stiffness} - {minus}")
            )
    solved = [
        "if k == 0:",
        *("    " + line for line in first),
        f"    if not invert(A, {n}, B):",
        "        return 1",
    ]
    return [*solved, *later, f"solve_order(B, W, {right}, {i.row}, {n}, k)"]
