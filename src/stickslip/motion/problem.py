"""A system with numbers: what a computation of its motion starts from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from stickslip import expressions as ex
from stickslip.declaration import check_initial
from stickslip.errors import DeclarationError
from stickslip.system import System

if TYPE_CHECKING:
    from stickslip.equations.compiled import CompiledSystem

Array = np.ndarray

SLOTS = 64  # modes with a closed form that one set of parameters may have


@dataclass(frozen=True)
class Problem:
    """A system with numbers: everything the compiled loop takes.

    Attributes
    ----------
    system : System
    parameters : dict of str to float
    order : int
        Order of the Taylor series.
    tolerance, atol : float
        Local tolerance of a step relative to the size of the state plus `atol`.
    exact : bool
        Use closed forms for affine modes; False: Taylor steps everywhere (the two check each other).
    """

    system: System
    parameters: dict[str, float]
    order: int
    tolerance: float
    atol: float
    exact: bool = True

    @cached_property
    def compiled(self) -> CompiledSystem:
        """Machine code and layout of the system."""
        from stickslip.equations.compiled import compile_system

        return compile_system(self.system)

    @cached_property
    def constants(self) -> tuple[Array, Array, Array, Array, Array]:
        """Constants K, mass matrix M, viscous matrix C, contact directions J and drive frequencies ω."""
        from stickslip.motion.engine import run_setup

        layout, s = self.compiled.layout, self.compiled.layout.sizes
        p = np.array([self.parameters[name] for name in self.system.parameters], dtype=float)
        K = np.zeros(max(layout.constants, 1))
        M, C = np.zeros((s["nq"], s["nq"])), np.zeros((s["nz"], s["nz"]))
        J = np.zeros((len(layout.u), s["nq"] + s["nz"] + s["nr"]))
        omega = np.zeros(layout.frequencies)
        run_setup(self.compiled.setup, p, K, M, C, J, omega)
        return K, M, C, J, omega

    @property
    def retrace(self) -> tuple[float, float]:
        """Tolerances for following a motion again between its knots: finer than those that found it."""
        return max(1e-2 * self.tolerance, 1e-16), 1e-3 * self.atol

    @property
    def matrices(self) -> tuple[Array, Array, Array, Array]:
        """K, M, C and J."""
        return self.constants[:4]

    @cached_property
    def closed_forms(self) -> tuple[Array, ...]:
        """Storage of the closed forms of affine modes, filled while the motion is computed."""
        from stickslip.motion.lanes import empty_forms

        return empty_forms(self, 1, SLOTS)

    @cached_property
    def tables(self) -> tuple[Array, ...]:
        """Integer tables of the layout: sizes, rows of u, λ, s⁺, s⁻, guards, and the rows that bound the step."""
        layout = self.compiled.layout
        sizes = np.array([layout.sizes[k] for k in ("n", "nq", "nz", "nr", "na", "mq", "mz", "mr", "kinks")])
        rows = [np.array(r, dtype=np.int64) for r in (layout.u, layout.force, layout.plus, layout.minus, layout.kinks)]
        watched = np.unique(np.concatenate(rows)) if any(len(r) for r in rows) else np.zeros(0, np.int64)
        return sizes, *rows, watched[watched >= layout.sizes["n"]], self._doubtful_thresholds()

    def _doubtful_thresholds(self) -> Array:
        """Rows of thresholds that are not nonnegative for every state."""
        boxes = {name: (v, v) for name, v in self.parameters.items()}
        layout, contacts = self.compiled.layout, self.compiled.equations.contacts
        sides = [(layout.plus[i], c.plus) for i, c in enumerate(contacts)] + [(layout.minus[i], c.minus) for i, c in enumerate(contacts)]
        return np.array(sorted({row for row, s in sides if ex.bounds(s, boxes)[0] < 0.0}), dtype=np.int64)

    def initial_state(self, initial: Mapping[str, float]) -> Array:
        """State vector of initial values (declared defaults where none is given)."""
        declaration = self.system.declaration
        for name, value in initial.items():
            check_initial(declaration, name, value)
        given = {**self.system.initial, **initial}
        return np.array([float(given.get(name, 0.0)) for name in declaration.state])


def pose(system: System, parameters: Mapping[str, float] | None = None, rtol: float = 1e-10, atol: float = 1e-12,
         exact: bool = True) -> Problem:
    """Check parameters and tolerances, and bind them to a system.

    Raises
    ------
    DeclarationError
        If a parameter is unknown or not admissible, or a tolerance is not in range.
    """
    if not isinstance(system, System):
        raise DeclarationError("system", f"expected a System, got {type(system).__name__}", "Use ss.load or ss.catalogue")
    values = {**system.values, **{k: v for k, v in (parameters or {}).items()}}
    system.declaration.check_parameters(values)
    for name, value, low, high in (("rtol", rtol, 1e-13, 1e-3), ("atol", atol, 1e-30, 1.0)):
        if not (isinstance(value, (int, float)) and low <= value <= high):
            raise DeclarationError(name, f"{value!r} is out of range", f"Choose {name} between {low:g} and {high:g}")
    # Global quality: local steps are kept three digits finer than asked for; with Taylor series that is nearly free.
    tolerance = max(1e-3 * rtol, 1e-16)
    order = max(8, min(24, math.ceil(-0.5 * math.log(tolerance)) + 1))
    return Problem(system, {k: float(v) for k, v in values.items()}, order, tolerance, max(atol / rtol, 1e-6), exact)
