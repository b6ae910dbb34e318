"""Friction laws that are too long for a balance of forces, in mathematical notation."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

from stickslip.display.printers import UnicodeWriter
from stickslip.display.tree import (
    INVERSE,
    NOUGHT,
    UNITY,
    VECTOR,
    Call,
    Name,
    Node,
    Relation,
    inserted,
    negate,
    raised,
    sum_of,
    times,
)


@dataclass(frozen=True)
class Friction:
    """A dry contact whose law is too long for the balance, where its force is denoted by λ.

    Attributes
    ----------
    contact : str
        Name of the contact.
    index : str
        Index of its force: ``_1``, or empty if it is the only one.
    thresholds, sliding : pair of Node
        Largest forces and sliding forces for u > 0 and u < 0.
    """

    contact: str
    index: str
    velocity: Node
    thresholds: tuple[Node, Node]
    sliding: tuple[Node, Node]

    @property
    def force(self) -> Name:
        """The symbol of its force."""
        return Name(f"lam{self.index}")

    @property
    def named(self) -> list[Relation]:
        """Its velocity."""
        return [Relation("=", Name(f"u{self.index}"), self.velocity)]

    @property
    def law(self) -> Hashable:
        """The common part of contacts with the same law."""
        return self.thresholds, self.sliding

    def laws(self, write: UnicodeWriter, index: str) -> list[tuple[str, str]]:
        """Pairs of a condition and the law that then holds, with symbols of the given index."""
        force, u = Name(f"lam{index}"), Name(f"u{index}")
        speed: dict[str, Node] = {"speed": Call("abs", (u,))}
        right, left = (inserted(k, speed) for k in self.sliding)
        plus, minus = self.thresholds
        if plus == minus:
            stick: Node = Relation("<=", Call("abs", (force,)), plus)
        else:
            stick = Relation("<=", negate(plus), Relation("<=", force, minus))
        laws: list[tuple[Node, Node]] = [(Relation("=", u, NOUGHT), stick)]
        if left == right:
            slip = negate(times(right, Call("sign", (u,))))
            laws.append((Relation("!=", u, NOUGHT), Relation("=", force, slip)))
        else:
            laws.append((Relation(">", u, NOUGHT), Relation("=", force, negate(right))))
            laws.append((Relation("<", u, NOUGHT), Relation("=", force, left)))
        return [(write(when), write(law)) for when, law in laws]


@dataclass(frozen=True)
class PlaneFriction:
    """A dry contact in a plane; the components of its force are called λ₁ and λ₂ in the balances.

    Attributes
    ----------
    contact, index : str
        As in :class:`Friction`.
    threshold, sliding : Node
        Largest force and sliding force.
    matrix : str
        What the matrix of the axes is called; empty for a disc.
    axes : tuple of Node
        Its diagonal.
    dissipation : Node or None
        R(v) of a contact that has a formula, in ``v1``, ``v2`` (and ``v3``).
    called : str
        What R is called.
    """

    contact: str
    index: str
    velocity: tuple[Node, ...]
    threshold: Node
    sliding: Node
    matrix: str
    axes: tuple[Node, ...]
    dissipation: Node | None = None
    called: str = ""

    def component(self, i: int) -> Name:
        """The symbol of a component of its force, counted from 1."""
        return Name(f"lam{self.index}_{i}")

    @property
    def named(self) -> list[Relation]:
        """Its velocity, and the matrix of its axes."""
        found = [Relation("=", Name(f"u{self.index}"), Call(VECTOR, self.velocity))]
        if self.matrix:
            found.append(Relation("=", Name(self.matrix), Call("diag", self.axes)))
        if self.dissipation is not None:
            found.append(Relation("=", Call(self.called, (Name("v"),)), self.dissipation))
        return found

    @property
    def law(self) -> Hashable:
        """The common part of contacts with the same law."""
        return self.threshold, self.sliding, self.matrix, self.dissipation

    def laws(self, write: UnicodeWriter, index: str) -> list[tuple[str, str]]:
        """Pairs of a condition and the law that then holds, with symbols of the given index."""
        force: Node = Name(f"lam{index}")
        u: Node = Name(f"u{index}")
        if self.dissipation is not None:
            return [(write(when), write(law)) for when, law in self._of_formula(force, u)]
        moved = u
        if self.matrix:
            A = Name(self.matrix)
            force, moved = times(Call(INVERSE, (A,)), force), times(A, u)
        size = Call("abs", (moved,))
        sliding = inserted(self.sliding, {"speed": size})
        # A fraction, so that the direction is seen: k u/|u|.
        slip = negate(times(sliding, moved, raised(size, negate(UNITY))))
        laws: list[tuple[Node, Node]] = [
            (Relation("=", u, NOUGHT), Relation("<=", Call("abs", (force,)), self.threshold)),
            (Relation("!=", u, NOUGHT), Relation("=", force, slip)),
        ]
        return [(write(when), write(law)) for when, law in laws]

    def _of_formula(self, force: Node, u: Node) -> list[tuple[Node, Node]]:
        """Pairs of a condition and the law that then holds, with R."""
        v = [Name(f"v{i + 1}") for i in range(len(self.velocity))]
        work = sum_of(*(negate(times(self.component(i), x)) for i, x in enumerate(v, 1)))
        most = times(self.threshold, Call(self.called, (Name("v"),)))
        slope = Call(VECTOR, tuple(Call(self.called, (u,), by=(x.name,)) for x in v))
        sliding = inserted(self.sliding, {"speed": Call("abs", (u,))})
        return [
            (Relation("=", u, NOUGHT), Relation("<=", work, most)),
            (Relation("!=", u, NOUGHT), Relation("=", force, negate(times(sliding, slope)))),
        ]


AnyFriction = Friction | PlaneFriction
