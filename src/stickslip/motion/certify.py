"""Certificates of motions: residuals of the laws of motion.

All numbers are computed from the stored knots alone, by a method that did not produce them
(:mod:`stickslip.motion.audit.step_balance`):

* *energy balance (E)*: E(t) + dissipated = E(0) + supplied, at every knot, relative to the energy
  that flows;
* *friction law*, (S) in the form of forces: |λ| ≤ s always, λ = −σk and σu ≥ 0 in slip, u = 0 in
  stick, and every region on its side of its kink, each relative to the largest force and relative
  velocity of its contact;
* *initial state*: by how much the first knot misses the start that was asked for, each component
  relative to its size in the motion, or where it stays zero to the smallest size that counts;
* *equations of motion*: by how much they fail over a step, relative to the size of each component,
  of a mode of a structure to the largest of its modes;
  where motion is stiff, in the time that a Taylor step would take.

The friction law and the equations are bounds for all times, not for those that were looked at: what
could not be enclosed is named. *Rounding errors of the audit* is what these may be, in the units of
the equations of motion.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.certificates import Certificate, within
from stickslip.motion.record.knots import Knots
from stickslip.numerics.levels import CERTIFIED, ROUNDED_SUM

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

NAMES = ("energy balance", "friction law", "equations of motion", "rounding errors of the audit")
_ACCURACY = 10.0  # limit of residuals in units of rtol, if that is more than `CERTIFIED`
_TOUCHING = 1e-9  # gap of touching bodies relative to the largest coordinate of the motion


def certify_trajectory(trajectory: Trajectory) -> Certificate:
    """Measure a trajectory against energy balance, friction law and equations of motion."""
    tolerance = max(CERTIFIED, _ACCURACY * trajectory.rtol)
    values = [float(v) if np.isfinite(v) else np.inf for v in trajectory.audit.residuals]
    measured: list[tuple[str, float]] = [*zip(NAMES, values, strict=True)]
    if trajectory.start is not None:
        measured.append(("initial state", _missed(trajectory, trajectory.start)))
    outcome = "" if trajectory.outcome.ok else trajectory.outcome.label
    return Certificate(
        tuple(within(tolerance, measured)),
        outcome,
        _unverified(trajectory),
        tuple(trajectory.system.left_out(*trajectory.t_span)),
    )


def _missed(trajectory: Trajectory, start: Array) -> float:
    """Deviation of the first knot from the start, relative to the size of each component."""
    states = trajectory.knots.state
    missed = np.abs(states[0] - start)
    if not np.any(missed):
        return 0.0
    sizes = np.max(np.abs(states), axis=0)
    missed[(sizes == 0.0) & (missed <= trajectory.atol)] = 0.0
    n = trajectory.problem.compiled.layout.sizes["nq"]
    for kind in (slice(0, n), slice(n, 2 * n)):
        # Rounding of one component is projected onto the others of its kind.
        rounding = ROUNDED_SUM * float(np.max(sizes[kind], initial=0.0))
        missed[kind] = np.where(missed[kind] <= rounding, 0.0, missed[kind])
    if _collides(trajectory, start):
        missed[n : 2 * n] = 0.0  # The first knot is after an impact, which changes velocities.
    changed = missed != 0.0
    with np.errstate(divide="ignore"):
        return float(np.max(missed[changed] / sizes[changed], initial=0.0))


def _collides(trajectory: Trajectory, start: Array) -> bool:
    """Whether bodies that touch approach each other at the start."""
    which = [*trajectory.switches.openings.values()]
    if not which:
        return False
    k, layout = trajectory.knots, trajectory.problem.compiled.layout
    first = Knots.single(float(k.clock[0]), start, k.mode[0], k.region[0], k.origin)
    (row,) = trajectory.dense_output.rows_by_steps(first, k.clock[:1], np.zeros(1, np.int64))
    gaps = row[[layout.gaps[i] for i in which]]
    rates = row[[layout.u[i] for i in which]]
    places = np.abs(k.state[:, : layout.sizes["nq"]])
    touching = np.abs(gaps) <= _TOUCHING * np.max(places, initial=0.0)
    return bool(np.any(touching & (rates < 0.0)))


def _unverified(trajectory: Trajectory) -> tuple[tuple[float, float], ...]:
    """Spans of the steps that could not be enclosed to their end, joined where they touch."""
    time, left = trajectory.knots.time, trajectory.audit.open
    spans: list[tuple[float, float]] = []
    for i in np.flatnonzero(left > 0.0):
        begin = float(time[i + 1] - left[i])
        end = float(time[i + 1])
        if spans and begin <= spans[-1][1]:
            spans[-1] = spans[-1][0], end
        else:
            spans.append((begin, end))
    return tuple(spans)
