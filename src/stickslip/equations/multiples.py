"""Contacts along lines whose relative velocities are multiples of one another, and floors whose
gaps are.

Stick is a relative velocity that is zero, whichever force holds it: a brake on a shaft and one
behind a gear, d_x and −2*d_x on surfaces that fit, come to rest together. As two contacts they
would be one equation of stick too many. Two floors under one foot are closed while their gap is
zero, whichever of them carries it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
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

_POINTS = 6


def one_by_direction(
    contacts: Sequence[DryContact], parameters: frozenset[str]
) -> list[list[DryContact]]:
    """Contacts in groups whose relative velocities are multiples of that of the first of each;
    those that open are together where their gaps are, by positive numbers, and rebound alike.

    Those that have no mass and no viscosity, or rub in a plane, are alone.

    Raises
    ------
    DeclarationError
        If a factor between two of them has a pole whichever of them comes first, or the friction
        of two of them rebounds differently.
    """
    normals = frozenset(c.name for c in contacts if c.opens)
    groups: list[list[DryContact]] = []
    alike: dict[tuple[str, ...], list[list[DryContact]]] = {}
    floors = list[list[DryContact]]()
    for c in contacts:
        if c.opens and not c.side_of:
            found = next((g for g in floors if _is_floor_of(c, g[0])), None)
            if found is None:
                floors.append([c])
                groups.append(floors[-1])
            else:
                found.append(replace(c, ratio=_simplest(_gap(c), _gap(found[0]))))
            continue
        own = [c]
        if not (c.opens or c.plane or c.kind == Kind.RATE_INDEPENDENT):
            known = alike.setdefault(tuple(sorted(c.direction)), [])
            if found := next((g for g in known if _is_multiple(c, g[0])), None):
                found.append(c)
                continue
            known.append(own)
        groups.append(own)
    for i, own in enumerate(groups):
        if len(own) > 1 and not own[0].opens:
            first, *others = _from_first(own, parameters)
            groups[i] = [replace(first, restitution=_restitution(own, normals)), *others]
    return groups


def _gap(c: DryContact) -> Expr:
    return c.gap if c.gap is not None else ex.ZERO


def _is_floor_of(c: DryContact, other: DryContact) -> bool:
    """Whether a gap is that of another contact, or a positive multiple, and rebounds alike."""
    if c.restitution is not other.restitution or _gap(other).symbols != _gap(c).symbols:
        return False
    if c.plus is not ex.ZERO or other.plus is not ex.ZERO:
        return False  # each has separate adhesion
    ratio = _simplest(_gap(c), _gap(other))
    return ratio.op == "num" and ex.number(ratio) > 0.0


def _is_multiple(c: DryContact, other: DryContact) -> bool:
    """Whether the relative velocity of a contact is a multiple of that of another one."""
    if c.direction == other.direction and c.speed is other.speed:
        return True
    if not c.direction:
        return False  # between motions that are given
    (x, *others) = c.direction
    own, its = c.direction[x], other.direction[x]
    pairs = [(c.direction[y], other.direction[y]) for y in others] + [(c.speed, other.speed)]
    return all(_equal(a * its, own * b) for a, b in pairs)


def _from_first(own: list[DryContact], parameters: frozenset[str]) -> list[DryContact]:
    """A group with its ratios, and with a contact first of which all others are multiples."""
    if not own[0].direction:
        return own
    x = next(iter(own[0].direction))
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
    """The quotient a/b, as a number if it is one."""
    found = a / b
    if found.op == "num":
        return found
    values = [v for v in map(_value(found), _points(found)) if math.isfinite(v)]
    constant = ex.num(values[0]) if values else ex.ZERO
    return constant if values and _equal(a, constant * b) else found


def _equal(a: Expr, b: Expr) -> bool:
    """Whether two expressions are the same but for rounding errors of their numbers.

    What has kinks, or is sampled, has to be the same in form; other formulas that agree in some
    points of both signs agree everywhere.
    """
    off = ex.add((a, 1.0), (b, -1.0))
    if off is ex.ZERO:
        return True
    if any(e.op == "select" or _is_sampled(e) for e in ex.walk([off])):
        return False
    compared = 0
    for point in _points(a, b):
        pair = [_value(e)(point) for e in (a, b)]
        if all(map(math.isfinite, pair)):
            compared += 1
            if abs(pair[0] - pair[1]) > COMPUTED_ZERO * max(map(abs, pair)):
                return False
    return compared > 0


def _is_sampled(e: Expr) -> bool:
    return e.op in FUNCTIONS and FUNCTIONS[e.op].sampled


def _points(*expressions: Expr) -> Iterator[dict[str, float]]:
    """Places at which expressions are compared."""
    names = sorted({name for e in expressions for name in e.symbols})
    for turn in range(1, _POINTS + 1):
        sizes = (0.5 + (0.381966 * turn + 0.55455 * i) % 1.0 for i in range(len(names)))
        signs = (-1.0 if turn > 2 and (turn * (i + 3) // 2) % 2 else 1.0 for i in range(len(names)))
        yield {n: s * v for n, s, v in zip(names, signs, sizes, strict=True)}


def _value(e: Expr) -> Callable[[Mapping[str, float]], float]:
    return lambda point: ex.evaluate(e, point)


def _has_no_pole(e: Expr, held: frozenset[str]) -> bool:
    """Whether an expression is proved not to divide by zero for any values of the names, except
    those that are fixed."""
    divisors = [
        base
        for node in ex.walk([e])
        if node.op == "prod"
        for base, exponent in node.terms
        if exponent < 0.0 and not base.symbols <= held
    ]
    return not any(low <= 0.0 <= high for low, high in (bounds(base, {}) for base in divisors))
