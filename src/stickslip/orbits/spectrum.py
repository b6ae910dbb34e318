"""Floquet multipliers of a cycle, with what is known of them: those that are 1 by symmetry, and those that are 0."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.orbits.shooting import Orbit, Shooting, make_station, numbers

Array = np.ndarray
Complex = Any  # array of complex numbers


@dataclass(frozen=True)
class Spectrum:
    """Floquet multipliers: of the motion and of translations (all 1), of what stick forgets (0), and the others."""

    trivial: Complex
    forgotten: int
    others: Complex

    @property
    def every(self) -> Complex:
        """All of them, the largest first."""
        found: Complex = np.concatenate([self.trivial, self.others, np.zeros(self.forgotten)]).astype(complex)
        return found[np.lexsort((-found.imag, -np.abs(found)))]


def spectrum(shooting: Shooting, orbit: Orbit) -> Spectrum:
    """Multipliers of an orbit.

    Where most contacts stick the changes of the state have the least dimension; what is lost there has the multiplier
    0, exactly, and the others are those of the return map from there.
    """
    n, q = len(orbit.shift), int(shooting.first[1])
    M, tightest = np.eye(q), (q, np.eye(q))
    for j, leg in enumerate(orbit.legs):
        there, own = shooting.stations[(j + 1) % len(orbit.legs)], leg.place.directions.shape[1]
        bounds = [piece.bound for piece in leg.change.pieces]
        i = int(np.argmax(bounds))
        if n - bounds[i] < tightest[0]:
            k = leg.motion.knots
            narrow = make_station(
                0.0, leg.change.pieces[i], float(k.time[i]), k.state[i], numbers(orbit.problem), shooting.setting.sizes
            )
            tightest = n - bounds[i], narrow.chart @ leg.change.after[i][:n, :own] @ M
        M = there.chart @ leg.change.matrix[:n, :own] @ M
    left, A = tightest
    W, M = A @ shooting.unchanged(orbit), A @ M @ np.linalg.pinv(A)
    if W.shape[1] == 0:
        return Spectrum(np.zeros(0, complex), n - left, np.linalg.eigvals(M).astype(complex))
    basis = np.linalg.qr(np.hstack([W, np.eye(left)]))[0]
    inner, outer = basis[:, : W.shape[1]], basis[:, W.shape[1] :]
    trivial = np.linalg.eigvals(inner.T @ M @ inner).astype(complex)
    others = np.linalg.eigvals(outer.T @ M @ outer).astype(complex) if outer.shape[1] else np.zeros(0, complex)
    return Spectrum(trivial, n - left, others)
