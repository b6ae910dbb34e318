"""The onset of slip of a face, with three components of velocity and one force for each direction.

As in :mod:`stickslip.motion.steps.starting`, (Au)₁ = b − k D ∇R(n) = ρ n says where it goes, with
Delassus' matrix D and the rate b without friction, both of which four probes tell. The velocity w =
ρ n minimises (w − b)·D⁻¹(w − b)/2 + k R(w): it is found by Newton's method with R rounded off at 0,
less and less, which has no need of D⁻¹,

    w − b + k D ∇√(R(w)² + ε²) = 0,    w = b − D p,

with steps that lower p·Dp/2 + k √(R(w)² + ε²), the same function, so that flat sets of forces do no
harm; and at last in n and ρ, also where ρ = 0 since the force has just reached its set. Each
further order is one linear problem for the part of nₘ across n and for one order of ρ.
"""

from __future__ import annotations

import math

from stickslip.arrays import Array
from stickslip.equations.codegen.series import invert
from stickslip.motion.algebra.vectors import solve_equations
from stickslip.motion.steps.arrays import (
    AHEAD,
    AIM,
    FEWEST_ORDERS,
    FORMULA,
    LEAD,
    OK,
    PER_FACE,
    Flow,
    Instant,
    Machine,
    Rows,
    plain_coefficients,
)
from stickslip.motion.steps.contacts import directions_of
from stickslip.motion.steps.onset import MOST_LEADING, NEGLIGIBLE
from stickslip.motion.steps.response import (
    AIMS,
    L_,
    LEADING,
    N_,
    RHO,
    aim_row,
    begins_as_face,
    rate_row,
)
from stickslip.motion.steps.sets import axis_of, bend_at, dissipation_at, slope_at
from stickslip.numerics.levels import FIRED, LOWERED, NEWTON_TURNS, ROUNDING
from stickslip.translator import compiled

_ROUNDED = 0.1  # factor by which the rounding-off of R decreases per iteration
_FINEST = 1e-7  # … and its final value relative to R without friction
_SETTLED = 1e-15  # final residual relative to its terms
_MOST_CUTS = 40  # largest number of halvings of a step
_DEPENDENT = 1e-9  # relative to D: a direction with less is one in which the face is held
_IMPROVES = 1e-6  # relative improvement of a rate that justifies another iteration
# Rows of Space.facing for each face: D, b, k with ρ, forces of probes (with room for an inverse),
# that inverse, rates of probes (then what holds directions), equations, what is solved for, p and
# its change.
_D, _B, _K, _FORCES, _INVERSE, _RATES, _EQUATIONS, _SOLVED = 0, 3, 4, 5, 11, 14, 17, 21
_TAKEN, _CHANGE = 22, 23


@compiled(brief=True)
def put_pieces(rows: Rows, p: int, reg: Array, table: Array) -> bool:
    """Put the kinks of the dissipation of a plane onto the sides where a direction is; whether one
    was not.

    Parameters
    ----------
    p : int
        The plane.
    reg : array of int, shape (kinks,)
        Is changed.
    table : array
        With the direction.
    """
    changed = False
    for piece in rows.pieces:
        side = 1 if table[piece[2], 0] >= 0.0 else 0
        if piece[1] == p and reg[piece[0]] != side:
            reg[piece[0]] = side
            changed = True
    return changed


@compiled(brief=True)
def aim_faces(machine: Machine, flow: Flow, at: Instant, table: Array) -> int:
    """Directions of the faces that begin to slip, at the beginning.

    Parameters
    ----------
    flow : Flow
        Its work space says which begin, and receives the directions.
    table : array
        Work space.
    """
    for p in range(len(flow.rows.planes)):
        if begins_as_face(flow, p):
            status = probe_face(machine, flow, at, table, p)
            if status != OK:
                return status
            aim_face(flow, p)
            status = put_face(machine, flow, at, table, p)
            if status != OK:
                return status
    return OK


@compiled(brief=True)
def put_face(machine: Machine, flow: Flow, at: Instant, table: Array, p: int) -> int:
    """Make series with the direction of a face in the work space, on the pieces of its dissipation
    where that is.

    Parameters
    ----------
    table : array
        Receives them.
    p : int
        The face.
    """
    aims = flow.space.aims
    status = OK
    for _ in range(2):
        for i in range(3):
            for k in range(table.shape[1]):
                table[flow.rows.planes[p, AIM] + i, k] = 0.0
            table[flow.rows.planes[p, AIM] + i, 0] = aims[AIMS * p + aim_row(i), 0]
        status = plain_coefficients(machine, flow, at, FEWEST_ORDERS, table)
        if status != OK or not put_pieces(flow.rows, p, at.reg, table):
            break
    return status


@compiled(brief=True)
def probe_face(machine: Machine, flow: Flow, at: Instant, table: Array, p: int) -> int:
    """D, b and k of a face, from the rates and forces that four directions make.

    Parameters
    ----------
    flow : Flow
        Receives them in its work space.
    table : array
        Work space.
    p : int
        The face.
    """
    rows, aims = flow.rows, flow.space.aims
    plane = rows.planes[p]
    own = flow.space.facing[PER_FACE * p :]
    n = own[_CHANGE]
    place_corner(flow, plane[FORMULA], n)
    for probe in range(4):
        # the corners of a tetrahedron, for the forces as far as the set is wide
        aims[AIMS * p + N_, 0] = n[0] if probe < 2 else -n[0]
        aims[AIMS * p + N_ + 1, 0] = n[1] if probe % 2 == 0 else -n[1]
        aims[AIMS * p + L_, 0] = n[2] if probe == 0 or probe == 3 else -n[2]
        status = put_face(machine, flow, at, table, p)
        if status != OK:
            return status
        block = directions_of(rows, plane[LEAD])
        for i in range(3):
            c = block[i]
            force = table[rows.force[c], 0] / axis_of(flow, c)
            rate = table[plane[AHEAD + i], 1]
            if probe == 0:
                own[_SOLVED, i], own[_B, i] = force, rate
            else:
                own[_FORCES + probe - 1, i] = force - own[_SOLVED, i]
                own[_RATES + probe - 1, i] = rate - own[_B, i]
    R = dissipation_at(flow, plane[FORMULA], n[0], n[1], n[2])
    own[_K, 0] = -(n[0] * own[_SOLVED, 0] + n[1] * own[_SOLVED, 1] + n[2] * own[_SOLVED, 2]) / R
    known = invert(own[_FORCES:], 3, own[_INVERSE:])
    for i in range(3):
        for j in range(3):
            own[_D + i, j] = 0.0
            for k in range(3 if known else 0):
                own[_D + i, j] += own[_INVERSE + j, k] * own[_RATES + k, i]
    for i in range(3):
        for j in range(3):
            own[_B, i] -= own[_D + i, j] * own[_SOLVED, j]
    keep_within(own)
    return OK


@compiled(brief=True)
def keep_within(own: Array) -> None:
    """A matrix that restricts directions to those in which the face can move beside sticking
    contacts: the projection onto the complement of the range of D, times its size.

    Parameters
    ----------
    own : array
        Of the face; receives that matrix.
    """
    basis, held = own[_EQUATIONS:], own[_RATES:]
    size = 0.0
    for i in range(3):
        for j in range(3):
            size = max(size, abs(own[_D + i, j]))
            held[i, j] = 1.0 if i == j else 0.0
    rank = 0
    for _ in range(3):
        # the longest column relative to the previous ones
        longest, most = 0, 0.0
        for c in range(3):
            square = 0.0
            for i in range(3):
                beside = 0.0
                for k in range(3):
                    beside += held[i, k] * own[_D + k, c]
                square += beside * beside
            if square > most:
                longest, most = c, square
        if not most > (_DEPENDENT * size) ** 2:
            break
        for i in range(3):
            basis[rank, i] = 0.0
            for k in range(3):
                basis[rank, i] += held[i, k] * own[_D + k, longest] / math.sqrt(most)
        for i in range(3):
            for k in range(3):
                held[i, k] -= basis[rank, i] * basis[rank, k]
        rank += 1
    for i in range(3):
        for j in range(3):
            held[i, j] = size * held[i, j] if rank < 3 else 0.0


@compiled(brief=True)
def place_corner(flow: Flow, f: int, n: Array) -> None:
    """A unit vector whose components dissipate alike, each on its own: of a flat set of forces,
    four such vectors show all directions of it.

    Parameters
    ----------
    f : int
        Number of the formula.
    n : array
        Receives it.
    """
    length = 0.0
    for i in range(3):
        x, y, z = 1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0, 1.0 if i == 2 else 0.0
        n[i] = 1.0 / (dissipation_at(flow, f, x, y, z) + dissipation_at(flow, f, -x, -y, -z))
        length += n[i] * n[i]
    for i in range(3):
        n[i] /= math.sqrt(length)


@compiled(brief=True)
def aim_face(flow: Flow, p: int) -> None:
    """The direction in which a face begins to slip, and ρ.

    Parameters
    ----------
    flow : Flow
        With D, b and k in its work space; receives the direction there.
    p : int
        The face.
    """
    aims = flow.space.aims
    own = flow.space.facing[PER_FACE * p :]
    w = own[_SOLVED]
    size = 0.0
    for i in range(3):
        w[i] = own[_B, i]
        own[_TAKEN, i] = 0.0
        size = max(size, abs(w[i]))
    f = flow.rows.planes[p, FORMULA]
    whole = dissipation_at(flow, f, w[0], w[1], w[2]) if size > 0.0 else 0.0
    if not whole > 0.0:
        w[0], w[1], w[2] = 1.0, 0.0, 0.0
    rounded = whole
    while rounded > _FINEST * whole:
        for _ in range(NEWTON_TURNS):
            if not improve_rate(flow, f, own, rounded) > _IMPROVES * size:
                break
        rounded *= _ROUNDED
    length = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    own[_K, 1] = length
    for i in range(3):
        w[i] /= length
    for _ in range(NEWTON_TURNS):
        if not improve_direction(flow, f, own, size) > _SETTLED:
            break
    for i in range(3):
        aims[AIMS * p + aim_row(i), 0] = w[i]
    # When a threshold is just reached, the force beyond it is zero by definition.
    first = abs(own[_K, 1]) > FIRED * size
    aims[AIMS * p + RHO, 0] = own[_K, 1] if first else 0.0
    aims[AIMS * p + LEADING, 0] = 1.0 if first else 0.0


@compiled(brief=True)
def improve_rate(flow: Flow, f: int, own: Array, rounded: float) -> float:
    """A step of Newton's method for w, where R is rounded off; its largest component.

    Parameters
    ----------
    f : int
        Number of the formula.
    own : array
        Of the face; its w is changed.
    """
    w, taken, change = own[_SOLVED], own[_TAKEN], own[_CHANGE]
    equations = own[_EQUATIONS:]
    R = dissipation_at(flow, f, w[0], w[1], w[2])
    root = math.sqrt(R * R + rounded * rounded)
    before = made_least(own, root)
    part = own[_K, 0] * R / root
    less = own[_K, 0] * rounded * rounded / root**3
    for i in range(3):
        change[i] = part * slope_at(flow, f, i) - taken[i]
        for j in range(3):
            equations[i, j] = 1.0 if i == j else 0.0
        equations[i, 3] = own[_B, i] - w[i]
        for k in range(3):
            equations[i, 3] -= own[_D + i, k] * part * slope_at(flow, f, k)
            for j in range(3):
                second = part * bend_at(flow, f, k, j)
                second += less * slope_at(flow, f, k) * slope_at(flow, f, j)
                equations[i, j] += own[_D + i, k] * second
    if not solve_equations(equations, 3):
        return 0.0
    slope = 0.0
    for i in range(3):
        slope += change[i] * equations[i, 3]
    for i in range(3):
        for j in range(3):
            second = part * bend_at(flow, f, i, j)
            second += less * slope_at(flow, f, i) * slope_at(flow, f, j)
            change[i] += second * equations[j, 3]
    # if R is rounded off little, a full step may cross 0
    share, gone = 1.0, 0.0
    for _ in range(_MOST_CUTS):
        for i in range(3):
            w[i] += (share - gone) * equations[i, 3]
            taken[i] += (share - gone) * change[i]
        gone = share
        R = (
            dissipation_at(flow, f, w[0], w[1], w[2])
            if w[0] != 0.0 or w[1] != 0.0 or w[2] != 0.0
            else 0.0
        )
        now = made_least(own, math.sqrt(R * R + rounded * rounded))
        if now <= before + LOWERED * share * slope + ROUNDING * before:
            break
        share *= 0.5
    most = 0.0
    for i in range(3):
        most = max(most, abs(gone * equations[i, 3]))
    return most


@compiled(brief=True)
def made_least(own: Array, root: float) -> float:
    """The function minimised by the rate w = b − D p: p·Dp/2 + k √(R² + ε²).

    Parameters
    ----------
    own : array
        Of the face.
    root : float
        √(R(w)² + ε²).
    """
    taken = own[_TAKEN]
    square = 0.0
    for i in range(3):
        for j in range(3):
            square += taken[i] * own[_D + i, j] * taken[j]
    return float(0.5 * square + own[_K, 0] * root)


@compiled(brief=True)
def improve_direction(flow: Flow, f: int, own: Array, size: float) -> float:
    """A step of Newton's method for n and ρ in b − k D ∇R(n) = ρ n; returns its size.

    Parameters
    ----------
    f : int
        Number of the formula.
    own : array
        Of the face; its direction and ρ are changed.
    size : float
        Of rates.
    """
    n, equations = own[_SOLVED], own[_EQUATIONS:]
    place_tangent(flow, f, own, n[0], n[1], n[2], own[_K, 1])
    for i in range(3):
        equations[i, 4] = -own[_B, i] + own[_K, 1] * n[i]
        for k in range(3):
            equations[i, 4] += own[_D + i, k] * own[_K, 0] * slope_at(flow, f, k)
            equations[i, 4] += own[_RATES + i, k] * n[k]
    equations[3, 4] = 0.0
    if not solve_equations(equations, 4):
        return 0.0
    most = abs(equations[3, 4]) / size if size > 0.0 else 0.0
    length = 0.0
    for i in range(3):
        most = max(most, abs(equations[i, 4]))
    # Damped: the linearised equations hold for small rotations of n only.
    share = min(1.0, 0.5 / most) if most > 0.0 else 1.0
    for i in range(3):
        n[i] += share * equations[i, 4]
        length += n[i] * n[i]
    own[_K, 1] += share * equations[3, 4]
    for i in range(3):
        n[i] /= math.sqrt(length)
    return most


@compiled(brief=True)
def place_tangent(flow: Flow, f: int, own: Array, x: float, y: float, z: float, rho: float) -> None:
    """The equations of a change of n and of ρ, with the coefficients −k D ∇²R(n) − ρ and −n, and no
    change along n.

    Parameters
    ----------
    f : int
        Number of the formula.
    own : array
        Of the face; receives them.
    """
    equations = own[_EQUATIONS:]
    dissipation_at(flow, f, x, y, z)
    for i in range(3):
        for j in range(3):
            equations[i, j] = (-rho if i == j else 0.0) - own[_RATES + i, j]
            for k in range(3):
                equations[i, j] -= own[_D + i, k] * own[_K, 0] * bend_at(flow, f, k, j)
    for i in range(3):
        along = x if i == 0 else (y if i == 1 else z)
        equations[i, 3] = -along
        equations[3, i] = along
    equations[3, 3] = 0.0


@compiled(brief=True)
def aim_face_order(flow: Flow, p: int, m: int, lost: float) -> None:
    """Order m of the direction of a face, and the order of |Au| that follows from it.

    Parameters
    ----------
    flow : Flow
        With bₘ, the rates of Au with order m of the direction 0.
    p : int
        The face.
    lost : float
        Rounding errors of an order of Au.
    """
    aims = flow.space.aims
    base = AIMS * p
    own = flow.space.facing[PER_FACE * p :]
    equations = own[_EQUATIONS:]
    x, y, z = aims[base + N_, 0], aims[base + N_ + 1, 0], aims[base + L_, 0]
    leading = int(aims[base + LEADING, 0])
    rho = aims[base + RHO, 0] if leading == 1 else 0.0
    # times m + 1, so that the response is that of order 0
    place_tangent(flow, flow.rows.planes[p, FORMULA], own, x, y, z, (m + 1) * rho)
    along = 0.0
    size = 0.0
    k = m + 1 - leading
    for i in range(3):
        row = base + aim_row(i)
        for j in range(1, m):
            along -= 0.5 * aims[row, j] * aims[row, m - j]
        right = -aims[base + rate_row(i), m]
        size += abs(right)
        if leading > 0:
            for j in range(1, k):
                right += aims[base + RHO, j] * aims[row, k - j]
            if leading > 1 and k > 0:
                right += aims[base + RHO, 0] * aims[row, k]
        equations[i, 4] = (m + 1) * right
    equations[3, 4] = along
    known = solve_equations(equations, 4)
    for i in range(3):
        aims[base + aim_row(i), m] = equations[i, 4] if known else 0.0
    found = equations[3, 4] / (m + 1) if known else 0.0
    if leading > 0:
        aims[base + RHO, k] = found
    elif abs(found) > max(NEGLIGIBLE * size, lost) and m < MOST_LEADING:
        aims[base + LEADING, 0] = m + 1.0
        aims[base + RHO, 0] = found
