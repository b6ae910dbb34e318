"""Conditions on entries of a declaration: quadratic, definite or differentiable formulas, and the
sizes of their jumps; keys and directions of contacts."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence

from stickslip.errors import DeclarationError
from stickslip.model.entries.declared import Contact
from stickslip.numerics.levels import LEAST_PIVOT, SAME_VALUE
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

_QUADRATIC = "Write a pure quadratic form, like m/2*d_x**2"
_MOST_FULL = 2000  # number of coordinates up to which eigenvalues of a full matrix are computed


def quadratic_form(
    form: Expr, names: Iterable[str], where: str, pure: bool = True
) -> dict[tuple[str, str], Expr]:
    """Matrix of a form of degree two in the rates of the named coordinates; a pure one has no terms
    of lower degree."""
    order = {f"d_{x}": (i, x) for i, x in enumerate(names)}
    at_rest = dict.fromkeys(order, ex.ZERO)
    if ex.bends(form, order):
        raise DeclarationError(
            where, "not quadratic: it has kinks or jumps in the rates", _QUADRATIC
        )
    check_slopes(form, order, where, 2)
    matrix = {}
    for rate, (i, x) in order.items():
        slope = ex.derivative(form, rate)
        for j, y in sorted(order[other] for other in slope.symbols & order.keys()):
            if j > i:
                break
            entry = ex.derivative(slope, f"d_{y}")
            if entry.symbols & order.keys():
                raise DeclarationError(where, f"not quadratic in d_{x}", "Write it like m/2*d_x**2")
            if entry is not ex.ZERO:
                matrix[x, y] = matrix[y, x] = entry
        rest = ex.substitute(slope, at_rest)
        if pure and rest is not ex.ZERO:
            raise DeclarationError(where, f"it has a term linear in d_{x}", _QUADRATIC)
    if pure and ex.substitute(form, at_rest) is not ex.ZERO:
        raise DeclarationError(where, "it has a term without rates", _QUADRATIC)
    return matrix


def check_definite(
    matrix: Mapping[tuple[str, str], Expr],
    names: list[str],
    values: Mapping[str, float],
    where: str,
    what: str,
    semi: bool = False,
) -> None:
    """Reject a matrix that is not symmetric positive (semi-)definite, by Cholesky factorisation of
    the entries that there are.

    Its diagonal is scaled to 1 before pivots are judged: coordinates may have any units.

    Parameters
    ----------
    names : list of str
        Coordinates whose rows and columns count.
    values : mapping of str to float
        At which it is looked at.
    where, what : str
        Key and name of the matrix in the error.
    semi : bool
        Whether it may be semidefinite.
    """
    place = {x: i for i, x in enumerate(names)}
    # right of the diagonal and on it
    rows = [dict[int, float]() for _ in names]
    largest = [0.0] * len(names)
    for (x, y), entry in matrix.items():
        if x in place and y in place:
            i, j = place[x], place[y]
            value = ex.evaluate(entry, values)
            largest[i] = max(largest[i], abs(value))
            if i <= j:
                rows[i][j] = value
    own = [abs(row.get(i, 0.0)) for i, row in enumerate(rows)]
    scale = [math.sqrt(a or b or 1.0) for a, b in zip(own, largest, strict=True)]
    rows = [{j: a / scale[i] / scale[j] for j, a in row.items()} for i, row in enumerate(rows)]
    small = LEAST_PIVOT
    whole = [dict(row) for row in rows] if semi else []
    for k, row in enumerate(rows):
        pivot = row.pop(k, 0.0)
        if not (pivot >= -small if semi else pivot > small):
            if semi and _lowest(whole) >= -small:  # pivots of singular matrices may be rounding
                return
            kind = "positive semidefinite" if semi else "positive definite"
            raise DeclarationError(
                where,
                f"the {what} is not {kind} (at '{names[k]}')",
                "Check for wrong signs and missing terms",
            )
        if pivot <= small:
            if any(abs(a) > small for a in row.values()):
                if semi and _lowest(whole) >= -small:
                    return
                raise DeclarationError(
                    where,
                    f"the {what} is not positive semidefinite (at '{names[k]}')",
                    "Check for wrong signs and missing terms",
                )
            continue
        for i, a in row.items():
            for j, b in row.items():
                if j >= i:
                    rows[i][j] = rows[i].get(j, 0.0) - a / pivot * b


def _lowest(rows: Sequence[Mapping[int, float]]) -> float:
    """The lowest eigenvalue of a symmetric matrix of which the upper half is given, unless that is
    too large."""
    import numpy as np

    if len(rows) > _MOST_FULL:
        return -math.inf
    matrix = np.zeros((len(rows), len(rows)))
    for i, row in enumerate(rows):
        for j, entry in row.items():
            matrix[i, j] = matrix[j, i] = entry
    return float(np.linalg.eigvalsh(matrix)[0])


def check_slopes(formula: Expr, names: Iterable[str], where: str, order: int = 1) -> None:
    """Reject a formula whose derivatives cannot be formed."""
    names = frozenset(names)
    try:
        slopes = [formula]
        for _ in range(order):
            slopes = [ex.derivative(e, name) for e in slopes for name in e.symbols & names]
    except ArithmeticError:
        raise DeclarationError(
            where,
            "its derivatives contain numbers that are too large or undefined",
            "Check for large exponents and numbers",
        ) from None


def jumps_through(
    formula: Expr, guard: Expr, name: str, start: Mapping[str, float], held: Collection[str]
) -> list[float]:
    """Jump of a formula at given points as a name increases through a guard; 0 if none is detected.

    Parameters
    ----------
    start : mapping of str to float
        Values beside which these places are.
    held : collection of str
        Names that have these values everywhere: parameters.
    """
    above, below = (_beside(formula, guard, k) for k in (1, 2))
    slope = ex.derivative(guard, name)
    here = {x: start[x] for x in sorted(formula.symbols | guard.symbols)}
    found = []
    for k in (0, 1, -1):  # also near the start: at the start itself the jump may vanish
        moving = enumerate(sorted(here.keys() - held))
        at = {**here, **{x: here[x] + 0.1 * k * (i + 3) for i, x in moving}, name: 0.0}
        steep = ex.evaluate(slope, at)
        place = -ex.evaluate(guard, at) / steep if steep else math.nan
        near = 0.1 * (1.0 + abs(place))
        (off, one, other), *around = (
            [ex.evaluate(e, {**at, name: place + shift}) for e in (guard, above, below)]
            for shift in (0.0, near, -near)
        )
        scale = max(abs(value) for side in around for value in side[1:])
        jumps = abs(off) <= SAME_VALUE * abs(steep) * near and abs(one - other) > SAME_VALUE * scale
        found.append(math.copysign(one - other, (one - other) * steep) if jumps else 0.0)
    return found


def _beside(formula: Expr, guard: Expr, branch: int) -> Expr:
    """A formula on one side of a guard: with the first or second branch of each of its selects."""

    def change(e: Expr) -> Expr | None:
        return e.args[branch] if e.op == "select" and e.args[0] is guard else None

    return ex.rewrite(formula, change, again=True, undefined=True)


def terms_by_guard(formula: Expr) -> dict[Expr, Expr]:
    """Terms of a formula in which each guard of a kink occurs."""
    found: dict[Expr, dict[Expr, float]] = {}
    for term, c in formula.terms if formula.op == "sum" else ((formula, 1.0),):
        for e in ex.walk([term]):
            if e.op == "select":
                found.setdefault(e.args[0], {})[term] = c
    return {guard: ex.add(*terms.items()) for guard, terms in found.items()}


def size_of_terms(e: Expr, values: Mapping[str, float]) -> float:
    """Sum of the moduli of the terms of an expression."""
    terms = e.terms if e.op == "sum" else [(e, 1.0)]
    constant = abs(float(e.value)) if e.op == "sum" else 0.0
    return constant + sum(abs(c * ex.evaluate(term, values)) for term, c in terms)


def check_line(where: str, contact: Contact) -> None:
    """Reject keys that only a contact in a plane has."""
    if contact.dissipation is not None:
        raise DeclarationError(
            f"{where}.dissipation",
            "a contact along a line does not take a dissipation",
            "Give a pair of thresholds, or two directions, like direction = ['d_x', 'd_y']",
        )
    if isinstance(contact.surface_speed, tuple):
        raise DeclarationError(
            f"{where}.surface_speed",
            "two components were given, but a contact along a line has one",
            "Give one formula, or two directions, like direction = ['d_x', 'd_y']",
        )
    if contact.axes != (1.0, 1.0):
        raise DeclarationError(
            f"{where}.axes",
            "only a contact in a plane has axes",
            "Give two directions, like direction = ['d_x', 'd_y'], or leave the axes out",
        )


def check_components(where: str, contact: Contact, count: int) -> None:
    """Reject keys of a contact in a plane that do not have one entry for each direction."""
    for key, given in (("threshold", contact.threshold), ("kinetic", contact.kinetic)):
        if isinstance(given, tuple):
            raise DeclarationError(
                f"{where}.{key}",
                "a contact in a plane has a single threshold for all directions",
                "Give one formula; for anisotropic friction add 'axes'",
            )
    given = contact.surface_speed
    if (given != 0.0) if not isinstance(given, tuple) else (len(given) != count):
        number = {2: "two", 3: "three"}[count]
        raise DeclarationError(
            f"{where}.surface_speed",
            f"the surface velocity needs {number} components",
            f"Write it like ['{given if isinstance(given, str | float | int) else 'V'}'"
            f"{', 0' * (count - 1)}]",
        )
    if contact.dissipation is None and len(contact.axes) != count:
        raise DeclarationError(
            f"{where}.axes",
            f"expected {count} semi-axes, one for each direction, got {len(contact.axes)}",
            "Give the semi-axes of the ellipsoid of forces and moments, like [1, 1, '2*a/3'] "
            "for a disc of radius a, or a dissipation, like 'disc(v1, v2, a*v3)'"
            if count == 3
            else "Give one for each direction, like [1.0, 0.6]",
        )


def are_parallel(first: Mapping[str, Expr], second: Mapping[str, Expr]) -> bool:
    """Whether two directions are along one line."""
    return first.keys() == second.keys() and all(
        first[x] * second[y] is second[x] * first[y] for x in first for y in first
    )


def are_dependent(directions: Sequence[Mapping[str, Expr]]) -> bool:
    """Whether directions are linearly dependent for all parameters and states."""
    import numpy as np

    names = sorted({x for direction in directions for x in direction})
    entries = [[direction.get(x, ex.ZERO) for x in names] for direction in directions]
    symbols = sorted({x for row in entries for e in row for x in e.symbols})
    # Parameters may be zero until a motion is requested, so the rank is evaluated at a generic
    # point.
    rng = np.random.default_rng(0)
    place = dict(zip(symbols, rng.uniform(0.5, 1.5, len(symbols)), strict=True))
    J = np.array([[ex.evaluate(e, place) for e in row] for row in entries])
    sizes = np.linalg.norm(J, axis=1)
    if not (np.isfinite(sizes).all() and sizes.all()):
        return False
    return bool(np.linalg.matrix_rank(J / sizes[:, None]) < len(directions))
