"""Floquet multipliers of a cycle, including those that are exactly 1 by symmetry, or 0."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stickslip.arrays import AnyArray, Array
from stickslip.numerics.levels import RANK, TINIEST
from stickslip.orbits.return_map.held import forms
from stickslip.orbits.return_map.shooting import Orbit, Shooting, parameter_values
from stickslip.orbits.return_map.stations import make_station


@dataclass(frozen=True)
class Spectrum:
    """Floquet multipliers: along the motion and translations (all 1), of directions lost in stick
    (0), and the others."""

    trivial: AnyArray
    forgotten: int
    others: AnyArray

    @property
    def every(self) -> AnyArray:
        """All of them, the largest first."""
        found: AnyArray = np.concatenate(
            [self.trivial, self.others, np.zeros(self.forgotten)]
        ).astype(complex)
        return found[np.lexsort((-found.imag, -np.abs(found)))]


def spectrum(shooting: Shooting, orbit: Orbit) -> Spectrum:
    """Multipliers of an orbit.

    When most contacts stick, perturbations of the state have the smallest dimension; directions
    lost there have the multiplier 0, exactly, and the others are those of the return map from that
    phase. A position that is held throughout is unchanged after a period: its linear form ℓ
    satisfies ℓM = ℓ, with multiplier 1, and the others are those of perturbations with ℓ = 0.
    """
    n = len(orbit.shift)
    q = int(shooting.first[1])
    # Leg by leg around; the state with the fewest free directions on the way is kept.
    M = np.eye(q)
    tightest = None
    least = q
    for j, leg in enumerate(orbit.legs):
        there = shooting.stations[(j + 1) % len(orbit.legs)]
        own = leg.place.directions.shape[1]
        bounds = [piece.bound for piece in leg.change.pieces]
        i = int(np.argmax(bounds))
        if n - bounds[i] < least:
            least = n - bounds[i]
            k = leg.motion.knots
            narrow = make_station(
                0.0,
                leg.change.pieces[i],
                float(k.time[i]),
                k.state[i],
                parameter_values(orbit.problem),
                shooting.setting.sizes,
            )
            tightest = narrow, narrow.chart @ leg.change.after[i][:n, :own] @ M
        M = there.chart @ leg.change.matrix[:n, :own] @ M
    W = shooting.unchanged(orbit)
    directions = shooting.stations[0].basis
    if tightest is not None:
        # A maps changes at the first station to the narrow one: the return map from there is A M
        # A⁻¹, and the null space of A has the multiplier 0.
        narrow, A = tightest
        directions = narrow.basis
        W = A @ W
        M = A @ M @ np.linalg.pinv(A)
    left = directions.shape[1]
    resting = np.zeros(0)
    if shooting.setting.held:
        # Positions that are held map onto themselves; the rest is seen where they do not change.
        held = _independent(forms(shooting.setting.held, n) @ directions, W)
        free = np.linalg.svd(held)[2][len(held) :].T if len(held) else np.eye(left)
        resting = _eigenvalues(held @ M @ np.linalg.pinv(held))
        W = free.T @ W
        M = free.T @ M @ free
    # Shifts and the direction of the motion span an invariant space: in a basis that begins with it
    # the matrix is block triangular, and its blocks have the trivial and the other multipliers.
    basis = np.linalg.qr(np.hstack([W, np.eye(len(M))]))[0]
    inner, outer = basis[:, : W.shape[1]], basis[:, W.shape[1] :]
    trivial = np.concatenate([_eigenvalues(inner.T @ M @ inner), resting])
    return Spectrum(trivial, n - left, _eigenvalues(outer.T @ M @ outer))


def _eigenvalues(matrix: Array) -> AnyArray:
    found = np.linalg.eigvals(matrix) if len(matrix) > 1 else matrix.ravel()
    return found.astype(complex)


def _independent(held: Array, unchanged: Array) -> Array:
    """The combinations of held positions that are invariant under translations."""
    if not len(held) or not unchanged.shape[1]:
        return held
    u, s, _ = np.linalg.svd(held @ unchanged)
    size = np.max(np.abs(held)) * np.max(np.abs(unchanged), initial=TINIEST)
    return u[:, np.sum(s > RANK * size) :].T @ held
