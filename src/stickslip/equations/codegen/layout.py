"""Data of the functions of a system: the positions of all quantities in the arrays of the engine
(:class:`Layout`), and the statements (:class:`Generated`)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from stickslip.equations.coupling import Component
from stickslip.kept import cached_property
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.scalars import ParameterExpressions, Store
from stickslip.symbolic.tape import Instruction, rows_made

ORDERS = (8, 12, 16, 20, 24)  # admissible orders of a Taylor series
INVERSES = ("Rq", "Rz")  # names of the linear problems of inertial and of viscous coordinates
MATRICES = (*INVERSES, "B")  # and of rate-independent ones


@dataclass
class Layout:
    """Positions of quantities in the arrays of the engine.

    Attributes
    ----------
    state : list of str
        Names of the state vector y.
    sizes : dict
        n, nq, nz, nr, na, contacts by kind (mq, mz, mr), kinks.
    u, force, plus, minus, kinks : list of int
        Rows of uᵢ, λᵢ, sᵢ⁺, sᵢ⁻ by contact, and of the guards.
    rate_sizes : array of int
        Index in ``mag`` of the size of the terms of each rate; −1 if no terms can cancel.
    named : dict of str to int
        Rows of the rates ``d_x`` and of the internal rates.
    kinetic : list of (int, int, int, int)
        Contact, direction of slip, row of the kinetic friction force k, and row of s − k at speed
        0, for contacts with a declared k.
    rates : list of int
        Rows of the rates of the state.
    rows : int
        Number of rows of W.
    kept : list of int
        Rows of which higher orders than 0 are used.
    instructions : list of Instruction
        The tape, in the order of its computation.
    shown : list of Instruction
        Instructions at order 0 only: rows that results show and on which nothing else depends.
    constants : dict of Expr to int
        Entries of K with their positions.
    coupled : dict of str to list of Component
        For each inverse matrix the unknowns of its rows, component by component.
    together : dict of int to int
        The group of each inertial contact whose direction may depend linearly on those of others,
        if there is friction in a plane.
    turning : dict of (int, int) to int
        Rows of the coefficients of directions that vary, by contact and by the index of the
        coordinate in its component.
    gaps, restitution : dict of int to int
        Rows of the gaps of contacts that can open, and of the restitution of these and of their
        friction.
    planes : list of tuple of int
        Of each contact in a plane, or face, its first direction, the rows of the direction of its
        slip (the first), of |Au|, of Au, and of s² − |A⁻¹λ|², the place of the size of that,
        the rows of s and of what is not negative in slip, 1 if it has mass, 1 if the response is
        not linear in the direction, the number of its formula, −1: none, 1 if Au is a linear
        combination of rates with constant coefficients, and the row of the size of the terms of
        Au.
    formulas : int
        Number of dissipations that are formulas.
    pieces : list of (int, int, int)
        Kinks between pieces of these, the number of the plane, and the row of the same function of
        the direction.
    carrying : dict of str to int
        Rows of the forces of constraints (the sum over both sides), and of the normal forces of
        contacts with adhesion.
    parts : dict of str to (int, int, int, int)
        For contacts that are merged with others, the rows of force, thresholds and relative
        velocity.
    links : list of (int, int, tuple of int)
        Contact with friction, the contact with its normal force, and the rows of the coefficients:
        kinetic for forward and backward slip, then static likewise.
    pressed : int
        Largest number of normal forces in the friction of a contact, at least 1.
    prescribed : bool
        Whether there is friction between two prescribed motions.
    jumps : list of (int, int, list of int)
        For each jump the number of its kink, its direction, and the parts of the state with new
        values.
    """

    state: list[str]
    sizes: dict[str, int]
    u: list[int] = field(default_factory=list)
    force: list[int] = field(default_factory=list)
    plus: list[int] = field(default_factory=list)
    minus: list[int] = field(default_factory=list)
    kinks: list[int] = field(default_factory=list)
    named: dict[str, int] = field(default_factory=dict)
    kinetic: list[tuple[int, int, int, int]] = field(default_factory=list)
    rates: list[int] = field(default_factory=list)
    rows: int = 0
    kept: list[int] = field(default_factory=list)
    instructions: list[Instruction] = field(default_factory=list)
    shown: list[Instruction] = field(default_factory=list)
    constants: dict[Expr, int] = field(default_factory=dict)
    magnitudes: int = 0
    frequencies: int = 0
    timed: bool = False
    rate_sizes: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    coupled: dict[str, list[Component]] = field(default_factory=dict)
    together: dict[int, int] = field(default_factory=dict)
    turning: dict[tuple[int, int], int] = field(default_factory=dict)
    gaps: dict[int, int] = field(default_factory=dict)
    restitution: dict[int, int] = field(default_factory=dict)
    planes: list[tuple[int, ...]] = field(default_factory=list)
    formulas: int = 0
    pieces: list[tuple[int, int, int]] = field(default_factory=list)
    pressed: int = 1
    prescribed: bool = False
    carrying: dict[str, int] = field(default_factory=dict)
    parts: dict[str, tuple[int, int, int, int]] = field(default_factory=dict)
    links: list[tuple[int, int, tuple[int, ...]]] = field(default_factory=list)
    jumps: list[tuple[int, int, list[int]]] = field(default_factory=list)

    @cached_property
    def without_series(self) -> frozenset[int]:
        """Rows that are known at single times only."""
        return frozenset(row for i in self.shown for row in rows_made(i))

    @property
    def columns_behind(self) -> int:
        """Columns of J after those of the coordinates: axis and strength of contacts that share
        forces, and coefficients of friction under normal forces."""
        return self.pressed + 2 if self.together or self.pressed > 1 else 1

    def shape(self, name: str) -> tuple[int, ...]:
        """Shape of an array that ``setup`` fills; a row of M, C and J has the coordinates of one
        component. After these, J has for contacts that may depend on each other the axis of a
        contact in a plane, and the square of a size of the force; last, coefficients of
        friction."""
        s = self.sizes
        widest = {
            matrix: max((len(part.coordinates) for part in self.coupled[matrix]), default=0)
            for matrix in INVERSES
        }
        shapes = {
            "K": (max(len(self.constants), 1),),
            "M": (s["nq"], widest["Rq"]),
            "C": (s["nz"], widest["Rz"]),
            "J": (s["mq"] + s["mz"], max(widest.values()) + self.columns_behind),
            "omega": (self.frequencies,),
        }
        return shapes[name]


@dataclass
class Generated:
    """The statements of the functions of a system.

    Attributes
    ----------
    layout : Layout
        With the tape, from which ``jets`` computes series.
    setup, sizes, residual, powers, landings, supports : list of Store
        Statements of the functions; `sizes`, of ``jets``, fill ``mag`` from order 0.
    """

    layout: Layout
    constants: ParameterExpressions
    setup: list[Store]
    sizes: list[Store]
    residual: list[Store]
    powers: list[Store]
    landings: list[Store]
    supports: list[Store]
