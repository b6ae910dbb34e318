"""Sets of equilibria {F(y) = 0, G(y) ≥ 0}: their conditions, interior points, and extents.

With dry friction a system may come to rest anywhere in a set. If F and G are affine in each region
of the kinks, a set is a union of polyhedra: extents, and tests of intersection, are linear
programs. Otherwise sets are covered by boxes (:mod:`.level_sets`), after reduction of the
conditions to as few unknowns as possible (:mod:`.reduction`). Without such formulas, an extent is
computed from an interior point by constrained optimisation, which proves nothing about other parts.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.derive import MotionEquations
from stickslip.equations.field import Mode, Region, in_region
from stickslip.errors import DeclarationError
from stickslip.kept import cached_property
from stickslip.numerics.levels import FEASIBLE, NEARLY_SOLVED, RANK, TINIEST
from stickslip.orbits.equilibria.reduction import Reduced, reduce
from stickslip.orbits.fields.steady import ResidualFunction
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

_PRECISE = {"primal_feasibility_tolerance": FEASIBLE, "dual_feasibility_tolerance": FEASIBLE}
_CLOSED = 1e-9  # largest violation of a guard, in units of its terms: the set contains its boundary
_FAR = 1e6  # a component that can move this far, in units of its size, is regarded as unbounded
_OPTIMUM = 1e-13  # tolerance of SLSQP for an extent, in units of the state
_GAIN = 1e-10  # relative to 1 + the modulus: a larger box that gains less does not bound the extent


@dataclass(frozen=True)
class Conditions:
    """Conditions of a set: equations, inequalities and the unknowns that they restrict.

    Attributes
    ----------
    unknowns : tuple of str
        The state first, then forces that are not determined by it.
    values : mapping of str to float
        Values of the parameters.
    states : tuple of str
        The first of the unknowns.
    """

    unknowns: tuple[str, ...]
    equal: tuple[Expr, ...]
    nonnegative: tuple[Expr, ...]
    values: Mapping[str, float]
    states: tuple[str, ...]

    def centre(self, start: Array) -> Array | None:
        """An interior point of the set, or None if none is found (if affine: if the set is empty).

        The depth of a point is its smallest distance to a boundary, estimated from slopes; it is
        bounded by 1.
        """
        _, slopes = self.guards(start)
        lengths = np.linalg.norm(slopes, axis=1)
        if not np.all(np.isfinite(lengths)):
            return None
        depth = ex.sym("depth")
        kept = tuple(g - float(w) * depth for g, w in zip(self.nonnegative, lengths, strict=True))
        deeper = Conditions(
            (*self.unknowns, "depth"), self.equal, (*kept, 1.0 - depth), self.values, self.states
        )
        found = deeper.farthest(np.append(start, 0.0), len(start), 1.0)
        return (
            found[:-1]
            if found is not None and found[-1] >= -_CLOSED * (1.0 + np.max(np.abs(found)))
            else None
        )

    def extent(self, centre: Array, component: int) -> tuple[float, float]:
        """Least and largest value of a component; infinite where there is no bound."""
        ends = [self.farthest(centre, component, sign) for sign in (-1.0, 1.0)]
        low, high = (centre[component] if end is None else end[component] for end in ends)
        return float(low) + 0.0, float(high) + 0.0  # no negative zeros

    @cached_property
    def equations(self) -> ResidualFunction:
        """The equations as functions of the unknowns."""
        return ResidualFunction(self.equal, self.unknowns, self.values)

    @cached_property
    def guards(self) -> ResidualFunction:
        """The inequalities as functions of the unknowns."""
        return ResidualFunction(self.nonnegative, self.unknowns, self.values)

    @property
    def affine(self) -> bool:
        """Whether the set is a polyhedron."""
        return self.equations.affine and self.guards.affine

    def affine_by_regions(self, kinks: Iterable[Expr]) -> bool:
        """Return whether the set is a polyhedron in each region of the kinks."""
        free = frozenset(self.unknowns)
        return all(_affine_pieces(e, free) for e in (*self.equal, *self.nonnegative, *kinks))

    def meets(self, other: Conditions) -> bool:
        """Return whether two polyhedra of the same states have a point in common."""
        own = {x: ex.sym(f"other {x}") for x in other.unknowns if x not in self.states}
        also = [[ex.substitute(e, own) for e in part] for part in (other.equal, other.nonnegative)]
        both = Conditions(
            (*self.unknowns, *(str(x.value) for x in own.values())),
            (*self.equal, *also[0]),
            (*self.nonnegative, *also[1]),
            self.values,
            self.states,
        )
        return both.centre(np.zeros(len(both.unknowns))) is not None

    def completed(self, state: Array) -> Array | None:
        """A state of the set with forces that hold it; None if there are none."""
        n = len(self.states)
        forces = self.unknowns[n:]
        if not forces:
            return state
        at = {**self.values, **dict(zip(self.states, map(float, state), strict=True))}
        held = Conditions(forces, self.equal, self.nonnegative, at, ())
        start = np.zeros(len(forces))
        value, slopes = held.equations(start)
        start = start - np.linalg.lstsq(slopes, value, rcond=None)[0]
        whole = np.append(state, start)
        if np.all(self.guards(whole)[0] >= 0.0):
            return whole
        found = held.centre(start)
        return None if found is None else np.append(state, found)

    def reduced(self, invariant: Array, origin: Array) -> Reduced:
        """The same in free states.

        Raises
        ------
        Irreducible
        """
        return reduce(
            self.states,
            self.unknowns[len(self.states) :],
            self.equal,
            self.nonnegative,
            self.values,
            invariant,
            origin,
        )

    def farthest(self, start: Array, component: int, sign: float) -> Array | None:
        """The point of the set with the largest ± component (infinite if it has no bound); None if
        the set is empty."""
        method = _vertex if self.affine else _optimum
        return method(self.equations, self.guards, start, component, sign)


def _vertex(
    equal: ResidualFunction, guards: ResidualFunction, start: Array, component: int, sign: float
) -> Array | None:
    """Linear program, with rows of unit length."""
    from scipy.optimize import linprog

    (F, A), (g, G) = equal(start), guards(start)
    b = A @ start - F
    h = g - G @ start
    if not all(np.all(np.isfinite(part)) for part in (A, b, G, h)):
        return None  # a formula has no value, wherever the point is
    lengths = [np.linalg.norm(m, axis=1) for m in (A, G)]
    a_size, g_size = (np.where(size > 0.0, size, 1.0) for size in lengths)
    cost = np.zeros(len(start))
    cost[component] = -sign
    A = A / a_size[:, None]
    b = b / a_size
    G = G / g_size[:, None]
    h = h / g_size
    found = linprog(cost, -G, h, A, b, (None, None), options=_PRECISE)
    if found.status == 0:
        return found.x
    return None if found.status == 2 else _without_bound(start, component, sign)


def _without_bound(point: Array, component: int, sign: float) -> Array:
    far = point.copy()
    far[component] = sign * np.inf
    return far


def _optimum(
    equal: ResidualFunction, guards: ResidualFunction, start: Array, component: int, sign: float
) -> Array | None:
    """Sequential quadratic programming in boxes that grow while their boundary is reached."""
    from scipy.optimize import minimize

    def constraint(kind: str, residual: ResidualFunction, size: Array) -> dict:
        return {
            "type": kind,
            "fun": lambda z: residual(units * z)[0] / size,
            "jac": lambda z: residual(units * z)[1] * units / size[:, None],
        }

    units = np.maximum(np.abs(start), 1.0)
    sizes = [
        np.maximum(np.max(np.abs(r(start)[1] * units), axis=1, initial=0.0), TINIEST)
        for r in (equal, guards)
    ]
    goal = np.zeros(len(start))
    goal[component] = -sign
    z = start / units
    reach = 1.0
    best = None
    while reach <= _FAR:
        found = minimize(
            lambda x: float(goal @ x),
            z,
            jac=lambda x: goal,
            bounds=[(a - reach, a + reach) for a in z],
            method="SLSQP",
            constraints=[constraint("eq", equal, sizes[0]), constraint("ineq", guards, sizes[1])],
            options={"maxiter": 200, "ftol": _OPTIMUM},
        )
        off = np.max(np.abs(equal(units * found.x)[0]) / sizes[0], initial=0.0)
        beyond = np.max(-guards(units * found.x)[0] / sizes[1], initial=0.0)
        if not (np.isfinite(found.fun) and max(off, beyond) < NEARLY_SOLVED):
            return best
        gain = sign * (found.x[component] - z[component])
        if best is not None and not gain > _GAIN * (1.0 + abs(z[component])):
            return best
        z = found.x
        best = units * found.x
        reach = 4.0 * reach
    return _without_bound(start, component, sign)


def _affine_pieces(e: Expr, unknowns: frozenset[str]) -> bool:
    """Return whether an expression is affine in each region of its kinks."""
    if any(n.op != "select" and ex.has_pieces(n) and n.symbols & unknowns for n in ex.walk([e])):
        return False
    guards = {n.args[0] for n in ex.walk([e]) if n.op == "select"}
    slopes = [ex.derivative(part, x) for part in (e, *guards) for x in unknowns & part.symbols]
    return not any(unguarded(d) & unknowns for d in slopes)


def unguarded(e: Expr) -> frozenset[str]:
    """Names that an expression depends on within a region of its kinks."""
    known: dict[Expr, frozenset[str]] = {}
    for n in ex.walk([e]):
        parts = n.args[1:] if n.op == "select" else (*n.args, *(t for t, _ in n.terms))
        own = n.symbols if n.op == "sym" else frozenset[str]()
        known[n] = own.union(*(known[part] for part in parts))
    return known[e]


def at_rest(equations: MotionEquations, e: Expr) -> Expr:
    """An expression at rest."""
    names = [f"d_{x}" for x in equations.declaration.coordinates]
    names += [f"speed:{i}" for i in range(len(equations.contacts))]
    return ex.substitute(e, dict.fromkeys(names, ex.ZERO), undefined=True)


def all_stick(
    equations: MotionEquations, mode: Mode, region: Region | None, values: Mapping[str, float]
) -> Conditions:
    """Rest with all closed contacts in stick, in terms of the state and the forces of contacts; in
    a region of the kinks, or with kinks.

    The forces are separate unknowns, since the state does not determine them if more contacts stick
    than there are directions.
    """
    d, rate = equations.declaration, equations.rate
    regions = {} if region is None else dict(zip(equations.kinks, region, strict=True))

    def fix(e: Expr) -> Expr:
        here = e if region is None else in_region(e, regions, undefined=True)
        return at_rest(equations, here)

    held = [ex.sym(f"lambda:{i}") for i in range(len(equations.contacts))]
    first = len(held) - len(rate.force)
    equal = [fix(law) for law in equations.laws]
    for names, forces in (
        (d.inertial, equations.inertial_force),
        (d.viscous, equations.viscous_force),
    ):
        for x, f in zip(names, forces, strict=True):
            pulls = [
                (fix(c.direction[x]) * h, 1.0)
                for c, h in zip(equations.contacts, held, strict=True)
                if x in c.direction
            ]
            equal.append(fix(f) + ex.add(*pulls))
    equal += [fix(f) - h for f, h in zip(rate.force, held[first:], strict=True)]
    equal += [ex.sym(f"d_{q}") for q in d.inertial]
    fixed = frozenset(d.parameters)
    nonnegative = [
        fix(g) if r == 1 else -fix(g) for g, r in regions.items() if not g.symbols <= fixed
    ]
    for i, (c, h) in enumerate(zip(equations.contacts, held, strict=True)):
        if c.gap is not None:
            # 0 ≤ N ⟂ g ≥ 0
            equal.append(fix(c.gap) if mode[i] == 0 else h)
            nonnegative.append(h if mode[i] == 0 else fix(c.gap))
        elif equations.is_loose(i, mode):
            equal.append(h)
        elif not c.plane:
            nonnegative += [h + fix(c.plus), fix(c.minus) - h]
    state = frozenset(d.state)
    equal += [fix(c.speed) for c in equations.contacts if c.speed.symbols & state]
    for plane in equations.planes:
        if plane.formula is not None:
            name = equations.labels[plane.parts[0]]
            raise DeclarationError(
                f"contacts.'{name}'",
                "sets of equilibria are available for discs and ellipses, not for a contact "
                "with a dissipation",
                "Use simulate to compute the state of rest of a motion",
            )
    nonnegative += [
        fix(plane.admissible((held[plane.parts[0]], held[plane.parts[1]])))
        for plane in equations.planes
    ]
    unknowns = (*d.state, *(str(h.value) for h in held))
    return Conditions(unknowns, tuple(equal), tuple(nonnegative), values, tuple(d.state))


def dimension(conditions: Conditions, states: int, point: Array) -> int:
    """Dimension of the set in the state space, near a point; forces that the state does not
    determine do not count."""
    _, slopes = conditions.equations(point)
    size = np.max(np.abs(slopes), axis=1, keepdims=True, initial=0.0)
    scaled = slopes / np.where(size > 0.0, size, 1.0)

    def rank(matrix: Array) -> int:
        return int(np.linalg.matrix_rank(matrix, tol=RANK)) if matrix.size else 0

    forces = len(conditions.unknowns) - states
    return len(conditions.unknowns) - rank(scaled) - (forces - rank(scaled[:, states:]))
