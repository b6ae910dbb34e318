"""Groups of contacts whose relative velocities, or gaps, are multiples of one another.

Contacts along lines whose relative velocities are multiples of one another, such as d_x and −2*d_x
(a brake on a shaft and another one behind a gear), stick at the same time. Their equations of stick
are linearly dependent, so they form one row of the equations of motion. Two floors under one foot
likewise form one contact: they close at the same time.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import replace

from stickslip.errors import DeclarationError, short
from stickslip.model.declaration import DryContact
from stickslip.model.entries.declared import Kind
from stickslip.model.formats.expected import entry_key
from stickslip.numerics.levels import COMPUTED_ZERO
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.enclosures import bounds
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.functions import FUNCTIONS

_POINTS = 6  # number of points at which two formulas are compared


def group_multiples(
    contacts: Sequence[DryContact], parameters: frozenset[str]
) -> list[list[DryContact]]:
    """Group contacts whose relative velocities are multiples of that of the first in the group, and
    contacts that can open if their gaps are positive multiples and their restitution is the same.

    Contacts of rate-independent coordinates, contacts in a plane and sides of constraints are alone
    in their group.

    Raises
    ------
    DeclarationError
        If the factor between two contacts has a pole whichever of them comes first, or the friction
        of two contacts has different tangential restitution.
    """
    normals = frozenset(c.name for c in contacts if c.opens)
    groups: list[list[DryContact]] = []
    similar: dict[Hashable, list[list[DryContact]]] = {}
    for c in contacts:
        key = _key(c)
        candidates = [] if key is None else similar.setdefault(key, [])
        belongs = _has_multiple_gap if c.opens else _is_multiple
        found = next((own for own in candidates if belongs(c, own[0])), None)
        if found is None:
            groups.append([c])
            candidates.append(groups[-1])
        else:
            found.append(c)
    for i, own in enumerate(groups):
        if len(own) == 1:
            continue
        if own[0].opens:
            ratios = [_simplest(_gap(c), _gap(own[0])) for c in own[1:]]
            groups[i][1:] = [replace(c, ratio=r) for c, r in zip(own[1:], ratios, strict=True)]
        else:
            first, *others = _from_first(own, parameters)
            groups[i] = [replace(first, restitution=_restitution(own, normals)), *others]
    return groups


def _key(c: DryContact) -> Hashable | None:
    """A property that all contacts of a group share; None if the contact is alone in its group."""
    if c.opens:
        return None if c.side_of else (_gap(c).symbols, c.restitution)
    alone = c.plane or c.kind == Kind.RATE_INDEPENDENT
    return None if alone else frozenset(c.direction)


def _gap(c: DryContact) -> Expr:
    return c.gap if c.gap is not None else ex.ZERO


def _has_multiple_gap(c: DryContact, other: DryContact) -> bool:
    """Whether a gap is a positive multiple of that of another contact, and neither has adhesion."""
    if c.plus is not ex.ZERO or other.plus is not ex.ZERO:
        return False
    ratio = _simplest(_gap(c), _gap(other))
    return ratio.op == "num" and ex.number(ratio) > 0.0


def _is_multiple(c: DryContact, other: DryContact) -> bool:
    """Whether the relative velocity of a contact is a multiple of that of another one."""
    if c.direction == other.direction and c.speed is other.speed:
        return True
    if not c.direction:
        return False  # both sides move as prescribed
    (x, *others) = c.direction
    first, first_other = c.direction[x], other.direction[x]
    pairs = [(c.direction[y], other.direction[y]) for y in others] + [(c.speed, other.speed)]
    # The vectors are parallel if all minors with their first components vanish.
    return all(_equal(a * first_other, first * b) for a, b in pairs)


def _from_first(own: list[DryContact], parameters: frozenset[str]) -> list[DryContact]:
    """Order a group such that all contacts are multiples of the first one, and set their ratios."""
    if not own[0].direction:
        return own
    x = next(iter(own[0].direction))
    # A ratio should have no pole at all; if there is none, its divisor may contain parameters only,
    # which do not change during a motion.
    for held in (frozenset[str](), parameters):
        for first in own:
            ratios = [_simplest(c.direction[x], first.direction[x]) for c in own]
            if all(_has_no_pole(r, held) for r in ratios):
                found = [replace(c, ratio=r) for c, r in zip(own, ratios, strict=True)]
                return sorted(found, key=lambda c: c.name != first.name)
    raise DeclarationError(
        f"{entry_key('contacts', own[1].name)}.direction",
        f"it is a multiple of the direction of '{short(own[0].name)}', but each of them vanishes "
        "where the other does not",
        "Write both as multiples of one direction that does not vanish",
    )


def _restitution(own: list[DryContact], normals: frozenset[str]) -> Expr:
    """Tangential restitution of merged contacts; contacts without a normal force are ignored."""
    pressed = [c for c in own if c.on or normals & (c.plus.symbols | c.minus.symbols)]
    for c in pressed:
        if c.restitution is not pressed[0].restitution:
            raise DeclarationError(
                f"{entry_key('contacts', c.name)}.tangential_restitution",
                f"it has the same direction as '{short(pressed[0].name)}', but another "
                "tangential restitution",
                "Use the same tangential restitution for both",
            )
    return pressed[0].restitution if pressed else ex.ZERO


def _simplest(a: Expr, b: Expr) -> Expr:
    """The quotient a/b; a number if the quotient is constant."""
    quotient = a / b
    if quotient.op == "num":
        return quotient
    values = (ex.evaluate(quotient, point) for point in _points(quotient))
    value = next(filter(math.isfinite, values), None)
    return ex.num(value) if value is not None and _equal(a, value * b) else quotient


def _equal(a: Expr, b: Expr) -> bool:
    """Whether two expressions are equal up to rounding errors of their numbers.

    Expressions with kinks or samples must have the same form. The others are analytic and are
    compared at a few points of both signs: if they differ, they agree there only by coincidence.
    """
    difference = ex.add((a, 1.0), (b, -1.0))
    if difference is ex.ZERO:
        return True
    if any(e.op == "select" or _is_sampled(e) for e in ex.walk([difference])):
        return False
    compared = False
    for point in _points(a, b):
        left, right = ex.evaluate(a, point), ex.evaluate(b, point)
        if math.isfinite(left) and math.isfinite(right):
            compared = True
            if abs(left - right) > COMPUTED_ZERO * max(abs(left), abs(right)):
                return False
    return compared


def _is_sampled(e: Expr) -> bool:
    return e.op in FUNCTIONS and FUNCTIONS[e.op].sampled


def _points(*expressions: Expr) -> Iterator[dict[str, float]]:
    """Points at which expressions are compared."""
    names = sorted({name for e in expressions for name in e.symbols})
    for k in range(1, _POINTS + 1):
        # Moduli between 0.5 and 1.5, spread by irrational steps (of the golden ratio from point to
        # point). The first two points are positive, since formulas may be undefined elsewhere; the
        # signs of the others vary with the name.
        sizes = (0.5 + (0.381966 * k + 0.55455 * i) % 1.0 for i in range(len(names)))
        signs = (-1.0 if k > 2 and (k * (i + 3) // 2) % 2 else 1.0 for i in range(len(names)))
        yield {n: s * v for n, s, v in zip(names, signs, sizes, strict=True)}


def _has_no_pole(e: Expr, held: frozenset[str]) -> bool:
    """Whether an expression is proved not to divide by zero for any values of its names. Divisors
    that contain only the names `held` are not checked."""
    divisors = [
        base
        for node in ex.walk([e])
        if node.op == "prod"
        for base, exponent in node.terms
        if exponent < 0.0 and not base.symbols <= held
    ]
    return not any(low <= 0.0 <= high for low, high in (bounds(base, {}) for base in divisors))
