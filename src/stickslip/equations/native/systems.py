"""A system's machine code."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from stickslip.equations.codegen.generate import generate
from stickslip.equations.codegen.layout import Generated, Layout
from stickslip.equations.derive import MotionEquations, derive
from stickslip.equations.native import kernels
from stickslip.equations.native.looped import is_long, series_of
from stickslip.equations.native.routines import Routine
from stickslip.equations.native.tables import Tabled
from stickslip.kept import made_once
from stickslip.machine_code import shelf
from stickslip.machine_code.functions import Kernel
from stickslip.machine_code.interface import INTERFACE
from stickslip.machine_code.objects import code_of, provide
from stickslip.model.declaration import Declaration
from stickslip.model.system import System

provide([x.symbol for x in vars(kernels).values() if isinstance(x, Kernel)], shelf.engine)


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
    supports: Any

    @property
    def layout(self) -> Layout:
        """Positions of quantities in the arrays of the engine."""
        return self.generated.layout


def compile_system(system: System) -> CompiledSystem:
    """Machine code of a system, from this process, from disk, or new."""
    declaration = system.declaration
    return made_once(declaration, "machine code", lambda: _compiled(declaration))


def _compiled(declaration: Declaration) -> CompiledSystem:
    equations = derive(declaration)
    generated = generate(equations)
    code = code_of(assembly_of(generated), next(iter(INTERFACE)))
    functions = {name: kind(code.address(name)) for name, kind in INTERFACE.items()}
    for function in functions.values():
        function.code = code
    return CompiledSystem(equations, generated, **functions)


def assembly_of(generated: Generated) -> str:
    """The functions of a system as LLVM assembly."""
    long = is_long(generated)
    functions: list[Routine] = [series_of(generated)]
    for name in ("setup", "residual", "powers", "landings", "supports"):
        routine = Tabled(name) if long else Routine(name)
        routine.statements(getattr(generated, name))
        routine.end("ret void")
        functions.append(routine)
    declared = {name: line for f in functions for name, line in f.declared.items()}
    return "\n".join([*declared.values(), *(f.definition() for f in functions)])
