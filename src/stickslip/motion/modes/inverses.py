"""The linear problem of a mode: inverses for forces and accelerations, component by component."""

from __future__ import annotations

from stickslip.arrays import Array
from stickslip.equations.codegen.series import invert, shared_inverse
from stickslip.motion.steps.arrays import (
    CONTACTS,
    COORDINATES,
    FIRST_ROW,
    MATRIX,
    MEMBERS,
    MOVING,
    PRESSING,
    Constants,
    Rows,
    Space,
)
from stickslip.translator import compiled


@compiled()
def resolvent(
    A: Array,
    J: Array,
    links: Array,
    first_link: Array,
    group: Array,
    members: Array,
    n: int,
    m: int,
    mode: Array,
    scratch: Array,
    R: Array,
) -> bool:
    """Inverse of [[A, −Jᵀ], [stick: J, 0; slip: 0, 1]] for the coordinates and contacts of one
    component; contacts that slip under a normal force have σμ in its column.

    Parameters
    ----------
    A, J : arrays
        Mass matrix, or viscous matrix, and contact directions: rows of all coordinates and
        contacts, with a column for each coordinate of their component; the last ones of J have
        coefficients of friction.
    links, first_link : arrays of int
        The contacts with friction under each normal force.
    group : array of int
        The contacts that each may share its force with, or negative.
    members : array of int, shape (n + m,)
        The coordinates, then the contacts.
    n, m : int
        Numbers of them.
    mode : array of int, shape (contacts,)
    scratch : array
        Work space, at least of shape (n + m + 3, n + m).
    R : array
        Receives the inverse in its first rows and columns.

    Returns
    -------
    bool
        False if there is none.
    """
    shared = False
    for i in range(n + m):
        for j in range(n + m):
            scratch[i, j] = 0.0
    for i in range(n):
        for j in range(n):
            scratch[i, j] = A[members[i], j]
        for c in range(m):
            scratch[i, n + c] = -J[members[n + c], i]
    for c in range(m):
        if mode[members[n + c]] == 0:
            for i in range(n):
                scratch[n + c, i] = J[members[n + c], i]
            if group[members[n + c]] >= 0:
                # Only a mark of rows whose forces may not be unique: `shared_inverse` removes it,
                # and minimises Σ λ²/s² among these forces.
                shared = True
                scratch[n + c, n + c] = -J[members[n + c], J.shape[1] - 2]
        else:
            scratch[n + c, n + c] = 1.0
            own = members[n + c]
            sense = 1.0 if mode[own] > 0 else -1.0
            for link in range(first_link[own], first_link[own + 1]):
                coefficient = J[own, friction_column(J, link - first_link[own])]
                for other in range(m):
                    if members[n + other] == links[link, PRESSING]:
                        scratch[n + c, n + other] = sense * coefficient
    return shared_inverse(scratch, n + m, R, False) if shared else invert(scratch, n + m, R)


@compiled()
def friction_column(J: Array, k: int) -> int:
    """The column of J with the coefficient of friction under the k-th of the normal forces that
    press a contact: the last one, then those before its strength and its axis."""
    last = J.shape[1] - 1
    return last if k == 0 else last - 2 - k


@compiled()
def resolve(rows: Rows, k: Constants, space: Space, mode: Array) -> bool:
    """Bring the inverses of the linear problems up to date with the mode, component by component;
    False if one is singular."""
    known = space.known
    last = len(known) - 1
    fresh = known[last] != 0
    for p in range(len(rows.parts)):
        if rows.parts[p, MOVING] == 1:
            continue  # inverted with each series
        n = rows.parts[p, COORDINATES]
        m = rows.parts[p, CONTACTS]
        first = rows.parts[p, MEMBERS]
        changed = fresh
        for i in range(first + n, first + n + m):
            c = rows.members[i]
            changed = changed or known[c] != mode[c]
        if not changed:
            continue
        known[last] = 1
        for i in range(first + n, first + n + m):
            known[rows.members[i]] = mode[rows.members[i]]
        inertial = rows.parts[p, MATRIX] == 0
        if not resolvent(
            k.M if inertial else k.C,
            k.J,
            rows.links,
            rows.first_link,
            rows.group,
            rows.members[first:],
            n,
            m,
            mode,
            space.scratch,
            (space.Rq if inertial else space.Rz)[rows.parts[p, FIRST_ROW] :],
        ):
            return False
    known[last] = 0
    return True
