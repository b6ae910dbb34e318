"""The record of a motion: the start of every step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array

if TYPE_CHECKING:
    from stickslip.motion.steps.arrays import Record


# States of a contact that can open, besides −1, 0, 1: open, or closed without friction.
IS_OPEN, IS_CLOSED = 2, 3


@dataclass(frozen=True)
class Knots:
    """Start of every step.

    Attributes
    ----------
    clock : array
        Time since the origin: as exact late as early.
    state, mode, region, cause : arrays
        State, mode of each contact, region of each kink, and the switch that caused it (−1: none).
        A contact in mode ±2 rests, carried by others while it is at its threshold.
    """

    clock: Array
    state: Array
    mode: Array
    region: Array
    cause: Array
    origin: float = 0.0

    @property
    def time(self) -> Array:
        """Time."""
        return self.clock + self.origin

    @property
    def record(self) -> Record:
        """The same as compiled functions take it."""
        from stickslip.motion.steps.arrays import Record

        return Record(self.clock, self.state, self.mode, self.region, self.cause)

    @property
    def slip(self) -> Array:
        """Direction in which each contact slips from every knot on, 0 where it rests."""
        return np.where(np.abs(self.mode) == 2, 0, self.mode).astype(np.int8)

    @classmethod
    def empty(cls, size: int, n: int, contacts: int, kinks: int, origin: float = 0.0) -> Knots:
        """Allocate a number of knots.

        Parameters
        ----------
        size : int
            How many.
        n, contacts, kinks : int
            Numbers of components of the state, of contacts, and of kinks.
        """
        return cls(
            np.zeros(size),
            np.zeros((size, n)),
            np.zeros((size, contacts), np.int8),
            np.zeros((size, kinks), np.int8),
            np.full(size, -1, np.int64),
            origin,
        )

    @classmethod
    def single(
        cls, clock: float, y: Array, mode: Array, region: Array, origin: float = 0.0
    ) -> Knots:
        """A single knot.

        Parameters
        ----------
        clock : float
            Time since the origin.
        y, mode, region : array, shapes (n,), (contacts,) and (kinks,)
        """
        modes, regions = mode[None].astype(np.int8), region[None].astype(np.int8)
        return cls(np.array([clock]), y[None].copy(), modes, regions, np.array([-1]), origin)

    @classmethod
    def joined(cls, pieces: list[Knots]) -> Knots:
        """Knots one after the other, with one origin."""
        if len(pieces) == 1:
            return pieces[0]
        names = ("clock", "state", "mode", "region", "cause")
        parts = {name: np.concatenate([getattr(p, name) for p in pieces]) for name in names}
        return cls(**parts, origin=pieces[0].origin)

    def copied(self) -> Knots:
        """Knots of their own, where others share their memory."""
        parts = (self.clock, self.state, self.mode, self.region, self.cause)
        return Knots(*(part.copy() for part in parts), origin=self.origin)

    def first(self, count: int) -> Knots:
        """The first ones."""
        parts = (self.clock, self.state, self.mode, self.region, self.cause)
        return Knots(*(part[:count] for part in parts), origin=self.origin)
