"""Proof that a motion has no further events."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import AnyArray as Array
from stickslip.motion.affine.flights import mode_key
from stickslip.motion.affine.forms import AFFINE
from stickslip.motion.record.knots import Knots
from stickslip.numerics.levels import GUARD_MARGIN, ROUNDED_SUM, ROUNDING
from stickslip.stopping.scopes import unbroken

if TYPE_CHECKING:
    from stickslip.motion.problem import Problem
    from stickslip.motion.steps.arrays import Flow


def rests_forever(problem: Problem, knots: Knots) -> bool:
    """Whether a motion that ends in stick stays there for all later time.

    All contacts stick and the mode is affine and autonomous, so that every guard is c + Re Σ aⱼ
    exp(λⱼτ). If all motions that are excited decay and c > Σ|aⱼ|, no guard can ever vanish: this is
    a proof, up to rounding. It is sufficient, not necessary: while the rest still rocks so widely
    that the bound fails, the answer is no.
    """
    mode = knots.mode[-1]
    layout = problem.compiled.layout
    if len(mode) == 0 or mode.any() or layout.timed:
        return False
    if layout.planes:
        return _stays(problem, knots)
    key = mode_key(mode.astype(np.int64), knots.region[-1].astype(np.int64))
    T = problem.closed_forms
    found = ((T.key == key) & (T.status == AFFINE)).nonzero()[0]
    if len(found) == 0:
        return False
    slot = found[0]
    blocks, guards = T.counts[slot, :2]
    s = np.array([*knots.state[-1].tolist(), 1.0, 0.0])
    sizes: Array = np.abs(s)
    rates: Array = T.exponent[slot, :blocks]
    r: Array = T.R[slot, :blocks] @ s
    excited = np.abs(r) > ROUNDED_SUM * (np.abs(T.R[slot, :blocks]) @ sizes)
    drift = T.c1[slot] @ s
    terms = np.abs(T.c1[slot]) @ sizes
    if (np.abs(drift) > ROUNDED_SUM * terms).any() or (excited & (rates.real >= 0.0)).any():
        return False
    coefficients: Array = T.a[slot, :guards, :blocks]
    constant = T.G[slot, :guards] @ s - (coefficients @ r).real
    bound = T.swing[slot, :guards, :blocks] @ np.abs(r)
    margin = GUARD_MARGIN * (np.abs(T.G[slot, :guards]) @ sizes)
    # A constant guard has no effect, even at zero: it was admissible when the mode was chosen.
    inert = bound <= margin
    return bool(np.where(inert, constant >= -margin, constant - bound > margin).all())


def _stays(problem: Problem, knots: Knots) -> bool:
    """Whether nothing moves, up to rounding errors, in a motion without closed forms: all
    velocities vanish, and all other rates are rounding errors of their terms. Then the state, and
    with it every guard, is constant."""
    from stickslip.motion.between.dense import make_scratch, sample

    layout = problem.compiled.layout
    last = Knots.single(
        float(knots.clock[-1]), knots.state[-1], knots.mode[-1], knots.region[-1], knots.origin
    )
    out = np.empty((1, layout.rows + 3))
    work = make_scratch(problem.rows, (layout.rows, 2))
    seen = np.zeros(len(problem.rows.watched))
    given = seen, last.record, np.zeros(1, np.int64), last.clock, work, out

    def sampled() -> Flow:
        flow = problem.flow(retracing=True)
        sample(problem.machine, flow, *given)
        return flow

    flow = unbroken(sampled)
    rates = np.abs(out[0, problem.rows.program.rates])
    places = problem.rows.program.rate_sizes
    sizes = np.where(places >= 0, flow.space.mag[places], 0.0)
    return bool(np.all(rates <= ROUNDING * sizes))
