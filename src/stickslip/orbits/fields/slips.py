"""First variation at events of planar contacts: a contact, or several of one body, begin to slip,
come to rest, or both.

Both events have the usual saltation matrix S = I + (f⁺ − f⁻)∇hᵀ/(∂ₜh + ∇h·f⁻), but the field of a
slip is undefined at u = 0. At the beginning of a slip, the direction of f⁺ is that of the leading
Taylor coefficient of the motion (:mod:`stickslip.motion.steps.starting`). At the end, all values
are taken at a time so close before it that u has its limiting direction, since u may rotate while
it vanishes. Neighbouring motions come to rest earlier or later; perturbations of u in all
directions then vanish.

Contacts that share forces begin to slip together if no admissible forces hold the body: h is the
minimum of Σ s|Gw| − q·w over its mechanisms w (:mod:`stickslip.motion.admissible.overload`), whose
derivatives are those at fixed mechanism. They come to rest together: then h² = uᵀ(J M⁻¹ Jᵀ)⁺u. Near
the end u has a limiting direction and its length decreases linearly. To first order the remaining
time is that of h, independently of small components of u in other directions, since M times the
limiting direction is the left null vector of their linear decay.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.linalg

from stickslip.arrays import Array
from stickslip.equations.derive import MotionEquations
from stickslip.equations.planes import Plane
from stickslip.model.entries.declared import Kind
from stickslip.motion.record.knots import Knots
from stickslip.numerics.levels import ROUNDED_TERM, TANGENT, TINIEST
from stickslip.numerics.ratios import ratio
from stickslip.orbits.fields.engine.tables import Leave
from stickslip.orbits.fields.mode_field import Piece, mass_at
from stickslip.orbits.fields.saltation import TOUCHED, Saltation
from stickslip.symbolic import expressions as ex

if TYPE_CHECKING:
    from stickslip.convex.formula import ConvexFormula
    from stickslip.motion.trajectory import Trajectory

_DEPENDENT = 1e-10  # relative distance of a direction from the span of others on which it depends
_RESOLVED = 1e-10  # fraction of the time below which a step is too short to be sampled
# angles and refinements in the search for the direction in which a slip begins
_ANGLES, _POLISH = 400, 12
_CLOSE = 1e-12  # fraction of a step before its end
_LEAST_TERM = 1e-12  # relative to the largest norm: smaller norms are replaced by it in divisions
_MOST_TURNS, _SETTLED = 2000, 1e-14  # iterations and tolerance of the search for a mechanism


def through(
    equations: MotionEquations,
    motion: Trajectory,
    knot: int,
    pieces: tuple[Piece, Piece],
    p: Array,
) -> Saltation:
    """The saltation matrix at a knot where a planar slip, or slips of contacts that share forces,
    begin, end, or pass through rest.

    Parameters
    ----------
    pieces : (Piece, Piece)
        The pieces before and after the knot.
    p : array, shape (parameters,)
    """
    left, right = pieces
    k = motion.knots
    t, y = float(k.time[knot]), k.state[knot]
    stopped, begun = _events(equations, pieces, (t, y, p))
    n, columns = len(y), len(left.columns)
    S = np.eye(columns)
    none = Saltation(S, np.zeros(columns), TOUCHED)
    if len({equations.sharing.get(c, -1 - c) for c in {*stopped, *begun}}) != 1:
        return none
    # A contact that passes through rest without stopping does so for neighbours, too, if it can
    # only move in one way.
    if stopped and begun and _freedom(equations, left, stopped, (t, y, p)) != 1:
        return none
    onward = _rates(motion, knot, right) if begun else right.rates(t, y, p)
    if stopped:
        turning = any(left.field.contacts[c].plane for c in stopped)
        at = (*_right_before(motion, knot), p) if turning else (t, y, p)
        here = left.leave(*at)
        massive = equations.contacts[stopped[0]].kind == Kind.INERTIAL
        passing = (
            _stopping(equations, left, stopped, at, here.rates)
            if massive and turning
            else _own(left, here, len(equations.kinks) + stopped[0])
        )
    else:
        here = left.leave(t, y, p)
        cause = int(k.cause[knot])
        formulas = [plane for plane in equations.planes if plane.formula is not None]
        bent = [plane for plane in formulas if plane.parts[0] in begun]
        if bent and (len(begun) > 1 or left.field.shared.intersection(begun)):
            return none
        if bent:
            passing = _leaving(left, bent[0], (t, y, p), here.rates)
        elif left.field.shared.intersection(begun):
            passing = _loss_of_hold(equations, pieces, begun, (t, y, p), here.rates)
        else:
            own = cause if cause >= 0 else len(equations.kinks) + begun[0]
            passing = _own(left, here, own)
    if not abs(passing.fall) > TANGENT * passing.terms:
        return none
    earlier = passing.slopes / passing.fall
    S[:n] += np.outer(onward - here.rates, earlier)
    if not begun:
        S = _at_rest(equations, right, (t, y, p)) @ S
    elif len(begun) > 1 and not stopped and not left.field.shared.intersection(begun):
        return none  # in neighbouring motions they begin at different times
    return Saltation(S, -earlier)


def _right_before(motion: Trajectory, knot: int) -> tuple[float, Array]:
    """Time and state just before the end of a planar slip, where only u differs from its value at
    the end.

    The last step is regular: the remaining change of the state, divided by the remaining time, has
    a limit, which is extrapolated from values along the step.
    """
    k = motion.knots
    start, end = float(k.clock[knot - 1]), float(k.clock[knot])
    left = end - start
    if left <= _RESOLVED * max(abs(end), abs(k.origin)):
        return float(k.time[knot - 1]), k.state[knot - 1]
    parts = np.array([1 / 32, 1 / 64, 1 / 128])
    states = motion.states_at(end - parts * left + k.origin, np.full(3, knot - 1))
    rates = (states - k.state[knot]) / (parts * left)[:, None]
    # by a parabola in the remaining time
    limit = (rates[0] - 6.0 * rates[1] + 8.0 * rates[2]) / 3.0
    # The closer the better, but u is a difference of velocities, which are rounded.
    moving = [i for i, name in enumerate(motion.system.declaration.state) if name[:2] == "d_"]
    rounding = ROUNDED_TERM * float(np.max(np.abs(k.state[knot, moving]), initial=0.0))
    close = np.sqrt(ratio(rounding, float(np.max(np.abs(limit[moving]), initial=0.0))))
    return float(k.time[knot]), k.state[knot] + max(close, _CLOSE * left) * limit


def _events(
    equations: MotionEquations, pieces: tuple[Piece, Piece], at: tuple[float, Array, Array]
) -> tuple[list[int], list[int]]:
    """The contacts that come to rest at a point, and those that begin to slip: both, where a slip
    passes through rest; those in a plane by their first components.

    Parameters
    ----------
    pieces : (Piece, Piece)
        Before and after it.
    at : (float, array, array)
        t, y, p.
    """
    left, right = pieces
    stopped: list[int] = []
    begun: list[int] = []
    for c, own in equations.directions.items():
        m = left.field.mode[c]
        n = right.field.mode[c]
        plane = equations.contacts[c].plane
        if not (plane or c in equations.sharing):
            continue
        loose = right.field.contacts[c].loose or left.field.contacts[c].loose
        passes = bool(plane) and m != 0 and n != 0 and not loose
        passes = passes and equations.contacts[c].kind == Kind.INERTIAL
        rests = passes and all(left.velocity(part, *at)[0] == 0.0 for part in own)
        if m != 0 and (n == 0 or rests):
            stopped.append(c)
        if n != 0 and (m == 0 or rests):
            begun.append(c)
    return stopped, begun


def _freedom(
    equations: MotionEquations,
    piece: Piece,
    contacts: list[int],
    at: tuple[float, Array, Array],
) -> int:
    """Number of degrees of freedom of contacts under the constraints of a piece.

    Parameters
    ----------
    contacts : list of int
        By first components.
    at : (float, array, array)
        t, y, p.
    """
    state = piece.field.state
    moving = [state.index(f"d_{q}") for q in equations.declaration.inertial]
    own = [part for c in contacts for part in equations.directions[c]]
    J = np.array([piece.velocity(c, *at)[2:] for c in own])[:, moving]
    bounds = piece.bounds(*at).slopes[:, moving]
    # The rank of the velocities on the null space of the constraints.
    left = J - J @ np.linalg.pinv(bounds, rcond=_DEPENDENT) @ bounds if len(bounds) else J
    sizes = np.linalg.svd(left, compute_uv=False)
    return int(np.sum(sizes > _DEPENDENT * np.max(np.abs(J))))


class _Passing(NamedTuple):
    """The guard of an event: derivatives by the state and free parameters, its rate, and the size
    of the terms of that."""

    slopes: Array
    fall: float
    terms: float


def _own(piece: Piece, here: Leave, switch: int) -> _Passing:
    """The guard of one contact."""
    meant = np.flatnonzero(piece.switches == switch)
    g = int(meant[np.argmin(np.abs(here.value[meant]))])
    return _Passing(here.slopes[g], float(here.fall[g]), float(here.terms[g]))


def _passing(time: float, slopes: Array, rates: Array) -> _Passing:
    terms = slopes[: len(rates)] * rates
    fall, size = time + float(np.sum(terms)), abs(time) + float(np.sum(np.abs(terms)))
    return _Passing(slopes, fall, size)


def _stopping(
    equations: MotionEquations,
    piece: Piece,
    contacts: list[int],
    at: tuple[float, Array, Array],
    rates: Array,
) -> _Passing:
    """The guard h of contacts that come to rest; terms that do not vanish with u are omitted.

    Parameters
    ----------
    piece : Piece
        Before.
    contacts : list of int
        By first components.
    at : (float, array, array)
        t, y, p right before.
    rates : array, shape (n,)
    """
    own = [part for c in contacts for part in equations.directions[c]]
    table = np.array([piece.velocity(c, *at) for c in own])
    u, time, slopes = table[:, 0], table[:, 1], table[:, 2:]
    state = piece.field.state
    moving = [state.index(f"d_{q}") for q in equations.declaration.inertial]
    J = slopes[:, moving]
    M = mass_at(equations, piece, at)
    # ∂h/∂u for h² = uᵀ(J M⁻¹ Jᵀ)⁺u, twice the energy that stopping the contacts takes away.
    weight = np.linalg.pinv(J @ np.linalg.solve(M, J.T), rcond=_DEPENDENT) @ u
    weight /= np.sqrt(max(float(u @ weight), TINIEST))
    return _passing(float(weight @ time), weight @ slopes, rates)


def _leaving(piece: Piece, plane: Plane, at: tuple[float, Array, Array], rates: Array) -> _Passing:
    """The guard of a contact that has a formula and begins to slip: s R(w) + λ·w for the direction
    w in which that is least. By minimality, its derivatives are those at fixed w.

    Parameters
    ----------
    piece : Piece
        Before.
    at : (float, array, array)
        t, y, p.
    rates : array, shape (n,)
    """
    values = dict(zip(piece.field.names, (at[0], *at[1], *at[2]), strict=True))
    forces = [piece.field.contacts[part].force for part in plane.parts]
    parts = zip(forces, plane.axes, strict=True)
    held = np.array([ex.evaluate(force / axis, values) for force, axis in parts])
    s = ex.evaluate(plane.static, values)
    formula = plane.formula
    assert formula is not None
    others = [values[name] for name in formula.ranges]

    n = formula.dimension
    # The forces are on the boundary of the set: minimised is the dissipation plus their power.
    ways = _directions(formula, others)
    rooms = [s * formula.numbers([*w, *others])[0] + w @ held for w in ways]
    w = ways[int(np.argmin(rooms))]
    for _ in range(_POLISH):
        _, *rest = formula.numbers([*w, *others])
        bend = np.array(rest[n:]).reshape(n, n)
        slope = s * np.array(rest[:n]) + held
        # Newton's method across w; R has no curvature along it.
        tangent = scipy.linalg.null_space(w[None])
        turn = np.linalg.solve(s * tangent.T @ bend @ tangent, tangent.T @ slope)
        length = np.linalg.norm(turn)
        w = w - tangent @ turn * min(1.0, ratio(0.3, float(length)))
        w = w / np.linalg.norm(w)
    way = [ex.num(float(x)) for x in w]
    h = plane.room_along(forces, way)
    slopes = np.array([ex.evaluate(ex.derivative(h, c), values) for c in piece.columns])
    return _passing(ex.evaluate(ex.derivative(h, "t"), values), slopes, rates)


def _directions(formula: ConvexFormula, others: list[float]) -> Array:
    """Directions distributed over a circle or a sphere, scaled so that those along the axes
    dissipate equally, shape (count, n)."""
    n = formula.dimension
    k = np.arange(_ANGLES) + 0.5
    if n == 2:
        found = np.column_stack(
            [np.cos(2.0 * np.pi * k / _ANGLES), np.sin(2.0 * np.pi * k / _ANGLES)]
        )
    else:
        # A Fibonacci lattice, which is nearly uniform on the sphere.
        height, turn = 1.0 - 2.0 * k / _ANGLES, np.pi * (1.0 + 5.0**0.5) * k
        across = np.sqrt(1.0 - height**2)
        found = np.column_stack([across * np.cos(turn), across * np.sin(turn), height])
    sizes = [
        formula.numbers([*e, *others])[0] + formula.numbers([*-e, *others])[0] for e in np.eye(n)
    ]
    found = found / np.array(sizes)
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def _loss_of_hold(
    equations: MotionEquations,
    pieces: tuple[Piece, Piece],
    contacts: list[int],
    at: tuple[float, Array, Array],
    rates: Array,
) -> _Passing:
    """The guard h of contacts that share forces and begin to slip together.

    Parameters
    ----------
    pieces : (Piece, Piece)
        Before and after.
    contacts : list of int
        By first components.
    at : (float, array, array)
        t, y, p.
    rates : array, shape (n,)
        Before.
    """
    piece = pieces[0]
    group = equations.sharing[contacts[0]]
    mode = piece.field.mode
    own = [c for c, g in equations.sharing.items() if g == group and mode[c] == 0]
    names = equations.declaration.inertial
    values = dict(zip(piece.field.names, (at[0], *at[1], *at[2]), strict=True))
    fields = piece.field.contacts
    along = {c: [ex.derivative(fields[c].u, f"d_{q}") for q in names] for c in own}

    def number(e: ex.Expr) -> float:
        return ex.evaluate(e, values)

    J = {c: np.array([number(e) for e in along[c]]) for c in own}
    rests = [part for c in own if c not in contacts for part in equations.directions.get(c, ())]
    held = np.array([J[c] for c in rests]).reshape(-1, len(names))
    # The minimum of the frictional power Σ R(Gw) for unit power q·w, over the mechanisms that leave
    # the others at rest.
    free = scipy.linalg.null_space(held, rcond=_DEPENDENT) if len(held) else np.eye(len(names))
    work = -sum((number(fields[c].force) * J[c] for c in own), np.zeros(len(names)))
    shapes: list[tuple[Array, float]] = []
    limits: dict[int, ex.Expr] = {}
    for c in contacts:
        parts = equations.directions[c]
        slips_back = len(parts) == 1 and pieces[1].field.mode[c] < 0
        plane = next((plane for plane in equations.planes if plane.parts[0] == c), None)
        axes = [ex.ONE] if plane is None else list(plane.axes)
        limit = fields[c].minus if slips_back else fields[c].plus
        limits[c] = limit / axes[0]
        scaled = [number(a) * J[part] for part, a in zip(parts, axes, strict=True)]
        shapes.append((np.array(scaled) @ free, number(limits[c])))
    way = free @ _mechanism(shapes, work @ free)
    # The derivatives of h with respect to all other quantities are those for this mechanism and for
    # the forces of the contacts at rest.
    ways = [ex.num(float(w)) for w in way]

    def speed(c: int) -> ex.Expr:
        return ex.add(*((e * w, 1.0) for e, w in zip(along[c], ways, strict=True)))

    terms = [(fields[c].force * speed(c), 1.0) for c in own]
    # the force that remains on the contacts at rest
    left = sum((number(fields[c].force) * J[c] for c in own), np.zeros(len(names)))
    for c in contacts:
        parts = equations.directions[c]
        if len(parts) == 1:
            sign = -1.0 if pieces[1].field.mode[c] < 0 else 1.0
            terms.append((limits[c] * speed(c), sign))
            left += sign * number(limits[c]) * J[c]
            continue
        axes = next(plane.axes for plane in equations.planes if plane.parts[0] == c)
        squares = [(a * speed(part)) ** 2 for a, part in zip(axes, parts, strict=True)]
        size = ex.power(ex.add(*((e, 1.0) for e in squares)), ex.num(0.5))
        terms.append((limits[c] * size, 1.0))
        for a, part in zip(axes, parts, strict=True):
            part_of = number(a) ** 2 * float(J[part] @ way) / number(size)
            left += number(limits[c]) * part_of * J[part]
    if rests:
        forces = np.linalg.lstsq(held.T, left, rcond=None)[0]
        terms += [(speed(c), -float(f)) for c, f in zip(rests, forces, strict=True)]
    h = ex.add(*terms)
    slopes = np.array([number(ex.derivative(h, c)) for c in piece.columns])
    return _passing(number(ex.derivative(h, "t")), slopes, rates)


def _mechanism(shapes: list[tuple[Array, float]], work: Array) -> Array:
    """The motion w with work·w = 1 for which Σ s|Gw| is minimal, by iteratively reweighted least
    squares, which decreases the sum in every iteration.

    Parameters
    ----------
    shapes : list of (array, float)
        G and s of the moving contacts.
    """
    w = work / float(work @ work)
    for _ in range(_MOST_TURNS):
        sizes = [float(np.linalg.norm(G @ w)) for G, _ in shapes]
        least = _LEAST_TERM * max(sizes)
        # ½ Σ s|Gw'|²/|Gw|, plus a constant, bounds the sum from above and touches it at w.
        H = sum(s / max(size, least) * G.T @ G for (G, s), size in zip(shapes, sizes, strict=True))
        new = np.linalg.lstsq(H, work, rcond=None)[0]
        new /= float(work @ new)
        done = np.max(np.abs(new - w)) <= _SETTLED * np.max(np.abs(new))
        w = new
        if done:
            break
    return w


def _at_rest(equations: MotionEquations, piece: Piece, at: tuple[float, Array, Array]) -> Array:
    """The projection onto states that satisfy the constraints of a piece, by impulses of the
    sticking contacts: friction absorbs the remaining velocity in other directions when a slip
    ends."""
    bounds = piece.bounds(*at).slopes
    columns = len(piece.columns)
    P = np.eye(columns)
    if len(bounds):
        state = piece.field.state
        moving = [state.index(f"d_{q}") for q in equations.declaration.inertial]
        J = bounds[:, moving]
        felt = np.linalg.solve(mass_at(equations, piece, at), J.T)
        # Impulses −M⁻¹Jᵀ(J M⁻¹ Jᵀ)⁺ restore J δu = 0; the pseudoinverse allows dependent contacts.
        P[moving] -= felt @ np.linalg.pinv(J @ felt, rcond=_DEPENDENT) @ bounds
    return P


def _rates(motion: Trajectory, knot: int, piece: Piece) -> Array:
    """Rates of the state at a knot in the mode of a piece."""
    from stickslip.motion.trajectory import Trajectory

    k = motion.knots
    mode, region = np.array(piece.field.mode), np.array(piece.field.region)
    alone = Knots.single(float(k.clock[knot]), k.state[knot], mode, region, k.origin)
    time = float(k.time[knot])
    part = Trajectory(motion.problem, (time, time), alone, motion.outcome)
    return part.dense_output.rows(alone.clock, np.array([0]))[0][motion.problem.rows.program.rates]
