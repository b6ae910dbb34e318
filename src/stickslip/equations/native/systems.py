"""A system's machine code."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

from stickslip.equations.codegen.generate import Generated, Layout, generate
from stickslip.equations.derive import MotionEquations, derive
from stickslip.equations.native.loops import LOOPS
from stickslip.equations.native.orders import is_long, series_of
from stickslip.equations.native.routines import Routine
from stickslip.equations.native.tables import Tabled
from stickslip.machine_code.interface import INTERFACE
from stickslip.machine_code.objects import addresses
from stickslip.model.declaration import Declaration
from stickslip.model.system import System
from stickslip.symbolic.functions import FUNCTIONS

_CALLED = {
    "llvm.fabs.f64": "double @llvm.fabs.f64(double)",
    "llvm.sqrt.f64": "double @llvm.sqrt.f64(double)",
    "llvm.fma.f64": "double @llvm.fma.f64(double, double, double)",
    "pow": "double @pow(double, double)",
    "ilogb": "i32 @ilogb(double)",
    "ldexp": "double @ldexp(double, i32)",
}
"""Functions from outside, beside those of formulas, which the mathematical library has under the
same names."""


@dataclass(frozen=True)
class CompiledSystem:
    """A system's machine code with the layout of its rows."""

    equations: MotionEquations
    generated: Generated
    setup: Any
    jets: Any
    residual: Any
    powers: Any
    landings: Any

    @property
    def layout(self) -> Layout:
        """Where the engine finds things."""
        return self.generated.layout


_compiled: WeakKeyDictionary[Declaration, CompiledSystem] = WeakKeyDictionary()


def compile_system(system: System) -> CompiledSystem:
    """Machine code of a system, from this process, from disk, or new."""
    declaration = system.declaration
    if declaration not in _compiled:
        equations = derive(declaration)
        generated = generate(equations)
        found = addresses(assembly_of(generated), list(INTERFACE))
        pairs = zip(INTERFACE.items(), found, strict=True)
        functions = {name: kind(address) for (name, kind), address in pairs}
        _compiled[declaration] = CompiledSystem(equations, generated, **functions)
    return _compiled[declaration]


def assembly_of(generated: Generated) -> str:
    """The functions of a system as LLVM assembly."""
    functions = [series_of(generated)]
    long = is_long(generated)
    for name in ("setup", "residual", "powers", "landings"):
        routine = Tabled(name) if long else Routine(name)
        routine.statements(getattr(generated, name))
        routine.lines.append("ret void")
        functions.append(routine.text())
    text = "\n".join(functions)
    helpers = [loop for name, loop in LOOPS.items() if f"@{name}(" in text]
    text = "\n".join([text, *helpers])
    called = _CALLED | {name: f"double @{name}(double)" for name in FUNCTIONS}
    declared = [f"declare {line}" for name, line in called.items() if f"@{name}(" in text]
    return "\n".join([*declared, text])
