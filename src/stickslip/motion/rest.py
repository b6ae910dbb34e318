"""Proof that nothing will ever happen again."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.motion import affine

if TYPE_CHECKING:
    from stickslip.motion.knots import Knots
    from stickslip.motion.problem import Problem

Array = Any  # of floats, integers or complex numbers


def rests_forever(problem: Problem, knots: Knots) -> bool:
    """Whether a motion that ends in stick stays there for all later time.

    All contacts stick and the mode is affine and autonomous, so that every guard is c + Re Σ aⱼ exp(λⱼτ). If all
    motions that are excited decay and c > Σ|aⱼ|, no guard can ever vanish: this is a proof, up to rounding. It is
    sufficient, not necessary: while the rest still rocks so widely that the bound fails, the answer is no.
    """
    mode, region, x = knots.mode[-1].astype(np.int64), knots.region[-1].astype(np.int64), knots.state[-1]
    if len(mode) == 0 or np.any(mode != 0) or problem.compiled.layout.timed:
        return False
    T = problem.closed_forms
    found = (
        np.flatnonzero((T.key == affine.mode_key(mode, region)) & (T.status == affine.AFFINE)) if len(T.status) else []
    )
    if len(found) == 0:
        return False
    slot = found[0]
    blocks, guards = T.counts[slot, :2]
    rates: Array = T.exponent[slot, :blocks]
    forcing = T.B[slot, :blocks] @ x + T.phi[slot, :blocks, 0]
    w = T.L[slot, :blocks] @ x
    moving = rates != 0.0
    limit: Array = np.where(moving, -forcing / np.where(moving, rates, 1.0), w)
    amplitude = np.where(moving, w - limit, 0.0)
    size = np.abs(w) + np.abs(limit)
    excited = np.abs(amplitude) > 1e-13 * size
    drifting = ~moving & (
        np.abs(forcing) > 1e-13 * (np.abs(T.B[slot, :blocks]) @ np.abs(x) + np.abs(T.phi[slot, :blocks, 0]))
    )
    if np.any(drifting) or np.any(excited & (rates.real >= 0.0)):
        return False
    P, PV = T.P[slot, :guards], T.PV[slot, :guards, :blocks]
    still = T.moves[slot] == 0
    constant = P[:, still] @ x[still] + T.Q[slot, :guards, 0] + (PV @ limit).real
    bound = np.abs(PV) @ np.abs(amplitude)
    margin = 1e-12 * (np.abs(P) @ np.abs(x) + np.abs(T.Q[slot, :guards, 0]))
    # A guard that nobody moves stays as it is, even at zero: it was admissible when the mode was chosen.
    inert = bound <= margin
    return bool(np.all(np.where(inert, constant >= -margin, constant - bound > margin)))
