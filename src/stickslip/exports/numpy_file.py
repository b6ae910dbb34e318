"""Systems as Python files: right-hand side and events as plain NumPy functions, for other
integrators.

The text is generated from the checked expressions of a declaration. Of user input it
contains only names, and the title as a literal in its first lines.
"""

from __future__ import annotations

import ast
import keyword
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from string import Template

from stickslip import storage
from stickslip.equations.derive import MotionEquations, derive
from stickslip.errors import DeclarationError, short
from stickslip.model.entries.declared import Kind, Sampled
from stickslip.model.entries.keys import NORMAL
from stickslip.model.system import System
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.functions import FUNCTIONS

_LONGEST = 200_000  # largest number of characters of a formula
_OPERATIONS = {
    "sqrt": "def sqrt(x):\n    return np.sqrt(x)",
    "sign": "def sign(x):\n    return np.sign(x)",
    "mod": "def mod(x, m):\n    return np.mod(x, m)",
    "square": "def square(x):\n    return 1.0 if sin(x) >= 0 else -1.0",
    "triangle": "def triangle(x):\n    return 2 / np.pi * np.arcsin(np.sin(x))",
    "sawtooth": "def sawtooth(x):\n    return 2 * np.mod(x / (2 * np.pi), 1) - 1",
    "smoothstep": (
        "def smoothstep(x, low, high):\n"
        "    s = np.clip((x - low) / (high - low), 0, 1)\n"
        "    return s * s * (3 - 2 * s)"
    ),
    "piecewise": "def piecewise(test, above, below):\n    return above if test else below",
}
"""Definitions of functions that are not in the table of elementary functions."""
_BUILT_IN = ("abs", "min", "max")
_TEMPLATE = Path(__file__).with_name("numpy_template.txt")
_OWN = frozenset(
    "np itertools t y mode p name NamedTuple Block NOTHING parameters initial span STATE CONTACTS "
    "MOVES N_Q N_Z example kinks solve rhs events first_mode next_mode fits motion inertial "
    "viscous internal numbers rates z_rates".split()
)


def write_numpy(system: System, path: str | Path) -> None:
    """Write the right-hand side and the events of a system as a Python file.

    Raises
    ------
    DeclarationError
        If the system contains unsupported parts: contacts in a plane or with a gap,
        rate-independent coordinates, jumps, samples, or tables.
    StickslipError
        If the file cannot be written.
    """
    text = numpy_text(system)
    with storage.replacing(path) as partial:
        partial.write_text(text, encoding="utf-8")


def numpy_text(system: System) -> str:
    """The text of such a file."""
    from stickslip import __version__

    _check(system)
    equations = derive(system.declaration)
    d = equations.declaration
    names = _Names(["t", *d.state, *d.parameters, *(f"d_{z}" for z in d.viscous)])
    write = _Writer(names)
    massive = [i for i, c in enumerate(equations.contacts) if c.kind == Kind.INERTIAL]
    others = [i for i, c in enumerate(equations.contacts) if c.kind == Kind.VISCOUS]
    asked = [equations.surface_acceleration(i) for i in massive]
    inertial = _block(equations, write, massive, d.inertial, asked)
    speeds = [equations.contacts[i].speed for i in others]
    viscous = _block(equations, write, others, d.viscous, speeds)
    laws = write.vector([ex.substitute(law, equations.speeds) for law in equations.laws])
    kinks = write.vector([ex.substitute(g, equations.speeds) for g in equations.kinks])
    of_state = [
        *_unpacked([names[n] for n in d.state], "y"),
        *_unpacked([names[n] for n in d.parameters], "numbers(p)"),
    ]
    of_rates = [*of_state, *_unpacked([names[f"d_{z}"] for z in d.viscous], "z_rates")]
    parameters = {name: system.plain.parameters[name] for name in d.parameters}
    lines = [
        f"    {name!r}: {float(p.default)!r},"
        + _comment(" ".join(filter(None, (f"[{p.unit}]" if p.unit else "", p.meaning))))
        for name, p in parameters.items()
    ]
    title = f"{system.title or system.name}: right-hand side and events."
    return Template(_TEMPLATE.read_text(encoding="utf-8")).substitute(
        title=_literal(title),
        version=__version__,
        state=repr(tuple(d.state)),
        contacts=repr(tuple(c.name for c in equations.contacts)),
        moves=repr(tuple(c.speed is not ex.ZERO for c in equations.contacts)),
        sizes=f"N_Q, N_Z = {len(d.inertial)}, {len(d.viscous)}",
        parameters="\n".join(lines),
        initial=", ".join(repr(float(d.start[name])) for name in d.state),
        span=repr(tuple(map(float, system.span))),
        imports="".join(f"{line}\n" for line in write.imports()),
        operations="".join(f"\n\n{text}\n" for text in write.operations()),
        inertial=_body(of_rates, inertial),
        viscous=_body(of_state, viscous),
        laws=_body(of_rates if d.internal else [], laws),
        kinks=_body(of_state if equations.kinks else [], kinks),
    )


def _check(system: System) -> None:
    """Reject systems that are not described by a right-hand side in each mode and by events."""
    d = system.declaration

    def refuse(where: str, reason: str) -> None:
        raise DeclarationError(
            where, f"{reason}, which a NumPy file does not support", "Export an FMU instead"
        )

    for name in d.rate_independent:
        refuse(f"coordinates.{name}", "it is rate-independent, and may jump")
    for name in d.resisted:
        refuse(f"coordinates.{name}.drag", "its rate is defined implicitly")
    for c in d.contacts:
        label = short(c.side_of or c.on or c.name.removeprefix(NORMAL))
        if c.plane:
            label = label.removesuffix(f" {c.plane}")
            refuse(f"contacts.{label}", "it is a contact in a plane")
        if c.opens or c.on or c.side_of:
            refuse(f"contacts.{label}", "it has a gap or holds a constraint")
        if c.prescribed:
            refuse(f"contacts.{label}", "the motion of both of its sides is prescribed")
    for name in system.jumps:
        refuse(f"jumps.{name}", "it is a jump of the state")
    for name, entry in system.internal.items():
        if isinstance(entry, Sampled):
            refuse(f"internal.{name}", "it is sampled")
    for name in d.given:
        refuse(f"drives.{name}", "it is a table of samples")
    for name in system.tables:
        refuse(f"tables.{name}", "it is a table")


class _Names(dict[str, str]):
    """Python identifiers for the names of a system."""

    def __init__(self, names: Iterable[str]) -> None:
        super().__init__()
        taken = {*_OWN, *_OPERATIONS, *_BUILT_IN, *FUNCTIONS} - {"t"}
        for name in dict.fromkeys(names):
            plain = "".join(c if f"a{c}".isidentifier() else "_" for c in name)
            plain = plain if plain.isidentifier() else f"_{plain}"
            while keyword.iskeyword(plain) or plain in taken:
                plain += "_"
            taken.add(plain)
            self[name] = plain


@dataclass
class _Writer:
    """Expressions as Python source; collects the functions that they call."""

    names: Mapping[str, str]

    def __post_init__(self) -> None:
        self.called: set[str] = set()
        self.symbols = {name: ex.sym(plain) for name, plain in self.names.items()}

    def text(self, e: Expr) -> str:
        """Text of an expression.

        Raises
        ------
        DeclarationError
            If it depends on anything but time, state and rates, or is too long.
        """
        for name in sorted(e.symbols - self.symbols.keys()):
            what = "a normal force or a rate" if ":" in name else f"'{short(name)}'"
            reason = f"a formula depends on {what}, which is not a function of the state"
            raise DeclarationError("system", reason, "Export an FMU instead")
        found = ex.to_text(ex.substitute(e, self.symbols), _LONGEST)
        if "..." in found:
            raise DeclarationError("system", "a formula is too long to be written", "Export an FMU")
        tree = ast.parse(found, mode="eval")
        self.called |= {
            node.func.id
            for node in ast.walk(tree)
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
        }
        return found

    def vector(self, expressions: Sequence[Expr]) -> str:
        """Text of an array."""
        if not expressions:
            return "np.zeros(0)"
        return f"np.array([{', '.join(map(self.text, expressions))}], dtype=float)"

    def matrix(self, rows: Sequence[Sequence[Expr]], columns: int) -> str:
        """Text of a matrix."""
        if not rows or not columns:
            return f"np.zeros(({len(rows)}, {columns}))"
        texts = [f"[{', '.join(map(self.text, row))}]" for row in rows]
        return f"np.array([{', '.join(texts)}], dtype=float)"

    def imports(self) -> list[str]:
        """Import statements for the functions that were used."""
        found: list[str] = []
        needed: set[str] = {"sin"} if "square" in self.called else set()
        for name in sorted(self.called | needed):
            if name in FUNCTIONS and name not in _OPERATIONS:
                module, _, function = FUNCTIONS[name].arrays.partition(":")
                found.append(f"from {module} import {function}")
                found[-1] += f" as {name}" if function != name else ""
            elif name not in (*_OPERATIONS, *_BUILT_IN):
                raise DeclarationError("system", f"'{short(name)}' is not available in NumPy")
        return found

    def operations(self) -> list[str]:
        """Definitions of functions that NumPy does not have."""
        return [_OPERATIONS[name] for name in sorted(self.called) if name in _OPERATIONS]


def _block(
    equations: MotionEquations,
    write: _Writer,
    contacts: Sequence[int],
    names: Sequence[str],
    asked: Sequence[Expr],
) -> str:
    """The linear problem of the coordinates of a kind, as text."""
    if not names:
        return "NOTHING"
    d = equations.declaration
    inertial = names is d.inertial
    entries = equations.mass if inertial else equations.damping
    forces = equations.inertial_force if inertial else equations.viscous_force
    n = range(len(names))
    own = [equations.contacts[i] for i in contacts]

    def fixed(parts: Iterable[Expr]) -> list[Expr]:
        return [ex.substitute(e, equations.speeds) for e in parts]

    rows = [[entries.get((i, k), ex.ZERO) for k in n] for i in n]
    directions = [[c.direction.get(x, ex.ZERO) for x in names] for c in own]
    parts = {
        "matrix": write.matrix(rows, len(names)),
        "force": write.vector(fixed(forces)),
        "directions": write.matrix(directions, len(names)),
        "surface": write.vector(fixed(c.speed for c in own)),
        "asked": write.vector(fixed(asked)),
        "plus": write.vector(fixed(c.plus for c in own)),
        "minus": write.vector(fixed(c.minus for c in own)),
        "kinetic_plus": write.vector(fixed(c.kinetic_plus for c in own)),
        "kinetic_minus": write.vector(fixed(c.kinetic_minus for c in own)),
    }
    lines = "".join(f"        {name}={text},\n" for name, text in parts.items())
    return f"Block(\n{lines}    )"


def _body(names: Sequence[str], value: str) -> str:
    """The body of a function, which unpacks its names if there is anything to compute."""
    lines = [*names, f"return {value}"] if value != "NOTHING" else ["return NOTHING"]
    return "\n".join(f"    {line}" for line in lines)


def _unpacked(names: Sequence[str], what: str) -> list[str]:
    """A statement that unpacks an array into names."""
    if not names:
        return []
    return [f"{names[0]}, = {what}" if len(names) == 1 else f"{', '.join(names)} = {what}"]


def _plain(text: str) -> str:
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def _literal(text: str) -> str:
    """The text, made safe for a docstring."""
    return _plain(text).replace("\\", "\\\\").replace('"', "'")


def _comment(text: str) -> str:
    plain = _plain(text)
    return f"  # {plain}" if plain else ""
