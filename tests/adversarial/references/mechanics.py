"""The mechanics of a system with dry friction as plain functions, written by hand and free of the
library's formulas.

Coordinates x = (q, z, r) are inertial, viscous and rate-independent ones, in this order; a are
internal variables. A state is y = (x, v, a) with v = q'. Within one region (the signs `side` of the
kink functions) everything is smooth:

    inertial and viscous    W (q'', z') = f(t, x, v, a) + Jᵀλ,   W = diag(M, C),
    rate-independent        0 = f(t, x, v, a) + Jᵀλ,
    internal                a' = law(t, x, x', a),

with forces λ of the contacts: |λ| ≤ s where u = Jx' − w vanishes, λ = −k Sign(u) where it does not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.arrays import Array

Law = Callable[..., Any]
TIME = -1  # the row of a zone that lies in time


@dataclass(frozen=True)
class Zone:
    """A narrow feature that was planted: along time or along a row of the state, at a place, of a
    width.

    An integrator that steps no further than the distance to the place plus the width cannot miss
    it. A feature in space may travel, at a speed.
    """

    row: int
    place: float
    width: float
    speed: float = 0.0


def pair(bound: Any) -> tuple[Array, Array]:
    """Thresholds for u > 0 and for u < 0: a law returns both or, if they are equal, one list."""
    plus, minus = bound if isinstance(bound, tuple) else (bound, bound)
    return np.asarray(plus), np.asarray(minus)


@dataclass(frozen=True)
class Mechanics:
    """What moves, and what resists.

    Attributes
    ----------
    kinds : (int, int, int, int)
        Numbers of inertial, viscous and rate-independent coordinates and of internal variables.
    inertia : matrix
        W; may be empty.
    J : matrix
        Directions of the contacts; that of a rate-independent coordinate acts on it alone.
    force : function (t, x, v, a, side) -> n numbers
        Everything but W x'' and the contacts, −∂Φ/∂x above all.
    threshold : function (t, x, v, a, side) -> m numbers, or a tuple of two such lists
        Static thresholds; two lists if they differ for u > 0 and u < 0.
    kinetic : function (t, x, v, a, side, speed) -> as threshold, optional
        Forces in sliding at the speeds |u|.
    belt : function t -> m numbers, optional
        Surface speeds w.
    law : function (t, x, rates, a, side) -> numbers, optional
        Rates of the internal variables; knows the rates of inertial and viscous coordinates.
    kinks : function (t, x, v, a) -> numbers, optional
        Functions whose signs are `side`.
    zones : sequence of Zone
    step : float
        No step is longer: everything that is not a zone varies more slowly.
    """

    kinds: tuple[int, int, int, int]
    J: Sequence[Sequence[float]] | Array
    force: Law
    threshold: Law
    inertia: Sequence[Sequence[float]] | Array = ()
    kinetic: Law | None = None
    belt: Law | None = None
    law: Law | None = None
    kinks: Law | None = None
    zones: Sequence[Zone] = ()
    step: float = 0.3

    def stronger(self, factor: float) -> Mechanics:
        """The same with all friction multiplied by a factor (for the sensitivity of a motion)."""
        static, kinetic = self.threshold, self.kinetic

        def scaled(law: Law) -> Law:
            def bound(*state: Any) -> tuple[Array, Array]:
                plus, minus = pair(law(*state))
                return factor * plus, factor * minus

            return bound

        return replace(self, threshold=scaled(static), kinetic=kinetic and scaled(kinetic))

    def later(self, time: float) -> Mechanics:
        """The same with a clock that begins at a time."""

        def shifted(law: Law | None) -> Law | None:
            return law and (lambda t, *state: law(t + time, *state))

        zones = tuple(
            replace(
                zone,
                place=zone.place - time if zone.row == TIME else zone.place + zone.speed * time,
            )
            for zone in self.zones
        )
        laws = {
            name: shifted(getattr(self, name))
            for name in ("force", "threshold", "kinetic", "belt", "law", "kinks")
        }
        return replace(self, zones=zones, **laws)

    def held(self, y: Array, change: Array) -> Array:
        """What is left of a change of a state at t = 0 if the contacts that stick there go on
        sticking."""
        nq = self.kinds[0]
        n = sum(self.kinds[:3])
        J = np.asarray(self.J, dtype=float)
        w = np.real(np.asarray(self.belt(0.0))) if self.belt is not None else np.zeros(len(J))
        rows = J[:, :nq][
            np.any(J[:, :nq] != 0.0, axis=1)
            & (np.abs(J[:, :nq] @ y[n : n + nq] - w) <= 1e-14 * (1 + np.abs(w)))
        ]
        kept = change.copy()
        kept[n : n + nq] -= np.linalg.pinv(rows) @ (rows @ change[n : n + nq])
        return kept
