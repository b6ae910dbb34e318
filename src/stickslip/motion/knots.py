"""The record of a motion: the start of every step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Array = np.ndarray


@dataclass(frozen=True)
class Knots:
    """Start of every step: time, state, mode of each contact, region of each kink, and the switch that caused it."""

    time: Array
    state: Array
    mode: Array
    region: Array
    cause: Array

    @classmethod
    def empty(cls, size: int, n: int, contacts: int, kinks: int) -> Knots:
        """Room for a number of knots."""
        return cls(
            np.zeros(size),
            np.zeros((size, n)),
            np.zeros((size, contacts), np.int8),
            np.zeros((size, kinks), np.int8),
            np.full(size, -1, np.int64),
        )

    @classmethod
    def single(cls, t: float, y: Array, mode: Array, region: Array) -> Knots:
        """One knot."""
        return cls(
            np.array([t]), y[None].copy(), mode[None].astype(np.int8), region[None].astype(np.int8), np.array([-1])
        )

    @classmethod
    def joined(cls, pieces: list[Knots]) -> Knots:
        """Knots one after the other."""
        names = ("time", "state", "mode", "region", "cause")
        return cls(*(np.concatenate([getattr(p, name) for p in pieces]) for name in names))

    def first(self, count: int) -> Knots:
        """The first ones."""
        return Knots(self.time[:count], self.state[:count], self.mode[:count], self.region[:count], self.cause[:count])
