"""The connected components of a linear problem [[M, −Jᵀ], [J, 0]]: coordinates and contacts that it
couples.

A force between blocks of a chain stands on the right-hand side; the matrix knows each block with
its contact alone. So its inverse is one of small blocks, and all costs are in proportion to their
number.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from stickslip.errors import DeclarationError
from stickslip.symbolic import expressions as ex

_MOST_COORDINATES = 200
"""That one inverse may couple: its cost grows with their cube."""


class Component(NamedTuple):
    """A connected component, with one inverse: the numbers of its coordinates (among those of their
    kind) and contacts; and whether its matrix varies, so that it is inverted for each series."""

    coordinates: list[int]
    contacts: list[int]
    moving: bool = False


def components(
    coordinates: int,
    entries: Iterable[tuple[int, int]],
    first: int,
    directions: Sequence[Iterable[int]],
    pressing: Iterable[tuple[int, int]] = (),
) -> list[Component]:
    """The connected components of a linear problem, by their least coordinates.

    Parameters
    ----------
    coordinates : int
        How many there are.
    entries : iterable of (int, int)
        Where the matrix is not zero.
    first : int
        Number of the first contact.
    directions : sequence of iterable of int
        Coordinates that each contact moves.
    pressing : iterable of (int, int)
        Contacts that feel normal forces, with those that have them.

    Raises
    ------
    DeclarationError
        If one of them is too large.
    """
    parent = list(range(coordinates + len(directions)))

    def root(i: int) -> int:
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    def join(i: int, j: int) -> None:
        low, high = sorted((root(i), root(j)))
        parent[high] = low

    for i, j in entries:
        join(i, j)
    for c, moved in enumerate(directions):
        for i in moved:
            join(i, coordinates + c)
    for c, other in pressing:
        join(coordinates + c - first, coordinates + other - first)
    found: dict[int, Component] = {}
    for i in range(len(parent)):
        component = found.setdefault(root(i), Component([], []))
        if i < coordinates:
            component.coordinates.append(i)
        else:
            component.contacts.append(first + i - coordinates)
    most = max((len(component.coordinates) for component in found.values()), default=0)
    if most > _MOST_COORDINATES:
        raise DeclarationError(
            "coordinates",
            f"masses, viscosities and contacts couple {most} coordinates directly (at most "
            f"{_MOST_COORDINATES})",
            "Couple them by springs, or by resistances (drag, force)",
        )
    return list(found.values())


def together(
    parts: Sequence[Component],
    pairs: Iterable[tuple[int, ...]],
    closed: Iterable[int],
    always: Iterable[int] = (),
) -> dict[int, int]:
    """Groups of contacts with friction in a plane, and of contacts beside them, that may hold the
    same coordinates, so that their directions may depend on each other.

    Parameters
    ----------
    pairs : iterable of tuple of int
        Components of contacts in a plane, and of faces.
    closed : iterable of int
        Contacts that do not open.
    always : iterable of int
        Contacts that belong to such a group even if they are alone.

    Returns
    -------
    dict of int to int
        By contact, the number of those that it belongs to.
    """
    home = {c: p for p, part in enumerate(parts) for c in part.contacts}
    joined = list(range(len(parts)))
    in_plane = set[int]()
    for i, *others in pairs:
        for j in others:
            if i in home and j in home:
                old, new = joined[home[j]], joined[home[i]]
                joined = [new if p == old else p for p in joined]
                in_plane |= {i, j}
    members: dict[int, list[int]] = {}
    for c in closed:
        if c in home:
            members.setdefault(joined[home[c]], []).append(c)
    lone = frozenset(always)
    found = [
        own
        for own in members.values()
        if in_plane.intersection(own) and (len(own) > 2 or lone.intersection(own))
    ]
    return {c: number for number, own in enumerate(found) for c in own}


def somewhere(table: Sequence[Sequence[ex.Expr]]) -> list[list[float]]:
    """Values of expressions at a generic point."""
    names = sorted(frozenset[str]().union(*(e.symbols for row in table for e in row)))
    point = {name: 0.7 + math.sin(i + 1.0) / 7.0 for i, name in enumerate(names)}
    return [[ex.evaluate(e, point) for e in row] for row in table]
