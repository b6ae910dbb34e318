"""A system's machine code."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

from stickslip.equations.codegen.generate import Generated, Layout, generate
from stickslip.equations.derive import MotionEquations, derive
from stickslip.equations.native import kernels
from stickslip.equations.native.orders import is_long, series_of
from stickslip.equations.native.routines import Routine
from stickslip.equations.native.tables import Tabled
from stickslip.machine_code import shelf
from stickslip.machine_code.functions import Kernel
from stickslip.machine_code.interface import INTERFACE
from stickslip.machine_code.objects import addresses, provide
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
    long = is_long(generated)
    functions: list[Routine] = [series_of(generated)]
    for name in ("setup", "residual", "powers", "landings"):
        routine = Tabled(name) if long else Routine(name)
        routine.statements(getattr(generated, name))
        routine.end("ret void")
        functions.append(routine)
    declared = {name: line for f in functions for name, line in f.declared.items()}
    return "\n".join([*declared.values(), *(f.definition() for f in functions)])
