"""Contacts in a plane: found from their components, with their normal and driving forces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stickslip.equations.coupling import Component, components, somewhere
from stickslip.equations.rate_problem import RateProblem
from stickslip.errors import DeclarationError
from stickslip.model.declaration import Declaration, DryContact
from stickslip.model.entries.declared import Kind
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

if TYPE_CHECKING:
    from stickslip.convex.formula import ConvexFormula


class Plane(NamedTuple):
    """A contact in a plane.

    Attributes
    ----------
    parts : tuple of int
        Its components among the contacts: two in a plane, three of a face.
    axes : tuple of Expr
        The diagonal of A.
    static, kinetic : Expr
        Threshold of abs(A⁻¹λ), and its value in slip.
    pull : tuple of Expr
        Of coordinates without mass, the vector along which they slip, a function of the state:
        what acts against the friction, A⁻¹F. Empty of those with mass, which slip along Au.
    bends : bool
        Whether the response of Au is not linear in the direction: of a formula, and where its
        friction may change the normal force that presses it.
    formula : ConvexFormula or None
        R, in parts of the thresholds, of what has the dissipation s R(Au); A makes of the rate at
        which a face turns a velocity like the others.
    slope : tuple of Expr
        What a unit of the threshold has as friction against a slip along the direction n, whose
        components are the symbols ``n:i``: A n, or A ∇R(n).
    pieces : tuple of (Expr, Expr)
        Kinks between pieces of ∇R, and the same functions of the direction.
    unit : Expr
        What is called speed, of a unit vector: R(n) of a formula.
    """

    parts: tuple[int, ...]
    axes: tuple[Expr, ...]
    static: Expr
    kinetic: Expr
    pull: tuple[Expr, ...] = ()
    bends: bool = False
    formula: ConvexFormula | None = None
    slope: tuple[Expr, ...] = ()
    pieces: tuple[tuple[Expr, Expr], ...] = ()
    unit: Expr = ex.ONE

    @property
    def idle(self) -> tuple[Expr, ...]:
        """The substitute for the direction in stick: zero; of a formula, which has no gradient at
        0, a direction in which all its pieces have one, as those of a disc have where its rim is at
        rest."""
        if self.formula is None:
            return (ex.ZERO,) * len(self.parts)
        if len(self.parts) == 2:
            return (ex.ONE, ex.ZERO)
        return (ex.num(0.5**0.5), ex.ZERO, ex.num(0.5**0.5))

    def bounds(self, i: int) -> tuple[Expr, Expr]:
        """The largest force of a component against a slip forward, and back."""
        if self.formula is None:
            return self.static * self.axes[i], self.static * self.axes[i]
        names = self.formula.names
        along = [
            {x: ex.num(float(side * (j == i))) for j, x in enumerate(names)} for side in (1, -1)
        ]
        R = [ex.substitute(self.formula.value, v, undefined=True) for v in along]
        return self.static * self.axes[i] * R[0], self.static * self.axes[i] * R[1]

    def scaled(self, forces: Sequence[Expr]) -> Expr:
        """abs(A⁻¹λ)² of forces λ."""
        return ex.add(*(((f / a) ** 2, 1.0) for f, a in zip(forces, self.axes, strict=True)))

    def admissible(self, forces: Sequence[Expr]) -> Expr:
        """s² − |A⁻¹λ|², nonnegative if forces λ can be held; s² for a formula, whose condition is
        one for each direction (:meth:`room_along`)."""
        square = self.static**2
        return square - self.scaled(forces) if self.formula is None else square

    def room_along(self, forces: Sequence[Expr], way: Sequence[Expr]) -> Expr:
        """s R(w) + A⁻¹λ·w of a formula, not negative for any w where forces λ can be held."""
        assert self.formula is not None
        R = ex.substitute(self.formula.value, dict(zip(self.formula.names, way, strict=True)))
        parts = zip(forces, self.axes, way, strict=True)
        return ex.add((self.static * R, 1.0), *((f / a * w, 1.0) for f, a, w in parts))


def planes_of(contacts: list[DryContact]) -> list[Plane]:
    """Contacts in a plane, from their components."""
    found = list[Plane]()
    for c in contacts:
        if c.plane != 1:
            continue
        stem = c.name.removesuffix("1")
        own = {
            other.plane: k
            for k, other in enumerate(contacts)
            if other.plane and other.name == f"{stem}{other.plane}"
        }
        parts = tuple(own[k] for k in sorted(own))
        axes = tuple(contacts[part].axis for part in parts)
        plane = Plane(parts, axes, c.plus, c.kinetic_plus)
        n = [ex.sym(f"n:{part}") for part in parts]
        slope = tuple(axis * x for axis, x in zip(axes, n, strict=True))
        pieces: tuple[tuple[Expr, Expr], ...] = ()
        unit = ex.ONE
        if c.dissipation is not None:
            from stickslip.convex.smooth import gradient_along, with_equal_widths

            formula, axes = with_equal_widths(c.dissipation)
            u = [a * relative_velocity(contacts[p]) for a, p in zip(axes, parts, strict=True)]
            slopes, pieces, unit = gradient_along(formula, n, u)
            slope = tuple(a * e for a, e in zip(axes, slopes, strict=True))
            plane = plane._replace(axes=axes, formula=formula)
        found.append(plane._replace(slope=slope, pieces=pieces, unit=unit))
    return found


def component_of(c: DryContact, i: int, plane: Plane) -> DryContact:
    """A component of a contact in a plane, with its part of the forces."""
    k = plane.parts.index(i)
    plus, minus = plane.bounds(k)
    kinetic = plane.kinetic * plane.slope[k]
    return replace(c, plus=plus, minus=minus, kinetic_plus=kinetic, kinetic_minus=kinetic)


def relative_velocity(c: DryContact) -> Expr:
    """The relative velocity of a contact, Σ jₓ ẋ − w."""
    moved = ((j * ex.sym(f"d_{x}"), 1.0) for x, j in c.direction.items())
    return ex.add(*moved, (c.speed, -1.0))


def pressing_on(contacts: list[DryContact], i: int) -> list[int]:
    """The normal forces that the friction of a contact depends on."""
    c = contacts[i]
    names = c.plus.symbols | c.minus.symbols | c.kinetic_plus.symbols | c.kinetic_minus.symbols
    if c.prescribed:
        return []  # it has no part in the problem for normal forces
    normals = [j for j, other in enumerate(contacts) if other.opens]
    return [j for j in normals if f"lambda:{j}" in names]


def pressed_planes(d: Declaration, contacts: list[DryContact], planes: list[Plane]) -> list[Plane]:
    """Note which friction in a plane may change a normal force that it depends on, or that another
    depends on: masses, or contacts, join a plane and the normal direction.

    Raises
    ------
    DeclarationError
        If the law does not tell the normal force that presses one of them.
    """
    acting = [c for c in contacts if c.kind == Kind.INERTIAL]
    parts = [i for plane in planes for i in plane.parts]
    links = [(i, n) for i in range(len(acting)) if i not in parts for n in pressing_on(contacts, i)]
    place = {q: i for i, q in enumerate(d.inertial)}
    entries = matrix_of(d.mass, d.inertial)
    moved = [[place[q] for q in c.direction] for c in acting]
    joined = components(len(place), entries, 0, moved, links)
    home = {c: k for k, part in enumerate(joined) for c in part.contacts}
    rubbed = {home.get(plane.parts[0]) for plane in planes}
    opening = [[i for i in part.contacts if contacts[i].opens] for part in joined]
    shared = set[int]().union(*(_dependent(own, contacts) for own in opening if planes))
    found = list[Plane]()
    for plane in planes:
        normals = pressing_on(contacts, plane.parts[0])
        bends = any(home[n] in rubbed for n in normals)
        others = [
            o for o in planes if o is not plane and home.get(o.parts[0]) == home.get(plane.parts[0])
        ]
        if plane.parts[0] not in home:  # between motions that are given
            found.append(plane)
            continue
        if plane.formula is not None:
            _check_turning(d, contacts, plane, joined[home[plane.parts[0]]])
        if plane.formula is not None and others:
            name, beside = (
                contacts[q.parts[0]].name.removesuffix(" 1") for q in (plane, others[0])
            )
            raise DeclarationError(
                f"contacts.'{name}'",
                f"it has a dissipation, and '{beside}' acts in a plane on the same body",
                "Use a single contact in a plane for this body",
            )
        if bends and (unknown := [contacts[n].name for n in normals if n in shared]):
            raise DeclarationError(
                f"contacts.'{contacts[plane.parts[0]].name.removesuffix(' 1')}'",
                f"its friction depends on {unknown[0]} and also changes it, and the normal "
                "forces of the body are statically indeterminate",
                "Support the body on three contacts, or give the normal forces as formulas of "
                "time and state",
            )
        found.append(plane._replace(bends=bends or plane.formula is not None))
    return found


def _check_turning(
    d: Declaration, contacts: list[DryContact], plane: Plane, part: Component
) -> None:
    """Reject a contact with a dissipation formula on a body that is held by more contacts than it
    has degrees of freedom, if their directions rotate: no criterion then determines how long it
    sticks."""
    closed = [c for c in part.contacts if not contacts[c].opens]
    held = frozenset(d.parameters)
    turning = any(not j.symbols <= held for c in closed for j in contacts[c].direction.values())
    if turning and len(closed) > len(part.coordinates):
        raise DeclarationError(
            f"contacts.'{contacts[plane.parts[0]].name.removesuffix(' 1')}'",
            f"it has a dissipation, and {len(closed)} state-dependent contact directions act on "
            f"{len(part.coordinates)} coordinates",
            "Use at most as many contact directions as the body has degrees of freedom",
        )


def _dependent(normals: list[int], contacts: list[DryContact]) -> set[int]:
    """The normal forces of a body that its motion does not determine, if all of them act.

    Their directions depend on those of others, and so do their gaps, or they are not closed at the
    same time: a floor and a ceiling are not. Both are looked at in one point, which is nothing
    special; both sides of a constraint are one.
    """
    sides = {contacts[n].side_of or contacts[n].name: n for n in reversed(normals)}
    closed = list(sides.values())
    names = sorted({q for n in closed for q in contacts[n].direction})
    if len(closed) < 2:
        return set()
    table = [
        [*(contacts[n].direction.get(q, ex.ZERO) for q in names), contacts[n].gap or ex.ZERO]
        for n in closed
    ]
    J = np.array(somewhere(table))
    J /= np.linalg.norm(J, axis=1)[:, None]
    rank = np.linalg.matrix_rank(J)
    rest = (np.delete(J, i, axis=0) for i in range(len(J)))
    among = {
        contacts[n].side_of or contacts[n].name
        for n, others in zip(closed, rest, strict=True)
        if np.linalg.matrix_rank(others) == rank
    }
    return {n for n in normals if (contacts[n].side_of or contacts[n].name) in among}


def pull_of(
    d: Declaration,
    contacts: list[DryContact],
    plane: Plane,
    rate: RateProblem,
    force_of: dict[str, Expr],
) -> tuple[Expr, ...]:
    """The force that opposes the friction of a contact in a plane of coordinates without mass.

    Of rate-independent ones it is −λ. Of viscous ones u = g (F + λ), with the force F that holds
    them in stick, if the resistance 1/g is the same in all directions: then they slip along F.

    Parameters
    ----------
    force_of : dict of str to Expr
        The force on each viscous coordinate.

    Raises
    ------
    DeclarationError
        If the viscosity is not that of single coordinates, the same in both directions.
    """
    own = [contacts[i] for i in plane.parts]
    if own[0].kind == Kind.INERTIAL or own[0].prescribed:
        return ()
    if own[0].kind == Kind.RATE_INDEPENDENT:
        first = len(contacts) - len(rate.force)
        forces = [rate.force[i - first] for i in plane.parts]
        return tuple(-f / a for f, a in zip(forces, plane.axes, strict=True))
    found = list[Expr]()
    resistance = list[Expr]()
    for c, axis in zip(own, plane.axes, strict=True):
        (z, weight), *others = c.direction.items()
        shared = [other for other in contacts if z in other.direction and other is not c]
        coupled = [y for (x, y) in d.damping if x == z and y != z]
        if others or shared or coupled:
            raise DeclarationError(
                f"contacts.'{c.name.removesuffix(str(c.plane)).rstrip()}'",
                "a contact in a plane without mass slips in the direction of the force, but the "
                f"rate of '{z}' is coupled to others",
                "Let each component act on one viscous coordinate that is not coupled to "
                "others, or declare the coordinates inertial",
            )
        damping = d.damping[z, z]
        found.append((force_of[z] / weight - damping * c.speed / weight**2) / axis)
        resistance.append(damping / (weight * axis) ** 2)
    if resistance[0] is not resistance[1] and not _equal(*resistance):
        raise DeclarationError(
            f"contacts.'{own[0].name.removesuffix('1').rstrip()}'",
            "the viscosities of its components differ, so it does not slip in the direction of "
            "the force",
            "Use the same viscosity for both coordinates (relative to the squares of the axes), "
            "or declare them inertial",
        )
    return tuple(found)


def _equal(a: Expr, b: Expr) -> bool:
    """Whether two expressions of parameters are the same."""
    return ex.add((a, 1.0), (b, -1.0)) is ex.ZERO


def matrix_of(
    entries: dict[tuple[str, str], Expr], names: list[str]
) -> dict[tuple[int, int], Expr]:
    """Entries by place instead of by name, for some names."""
    place = {x: i for i, x in enumerate(names)}
    found = {(place[x], place[y]): e for (x, y), e in entries.items() if x in place and y in place}
    return dict(sorted(found.items(), key=lambda item: item[0]))
