"""Refinement of the solution of a semi-infinite program by Newton's method for a force, its active
constraints, and their phases."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stickslip.arrays import Array
from stickslip.kept import cached_property
from stickslip.numerics.levels import FINE_RANK
from stickslip.rate_independent.sets.phase_intervals import AtPhases
from stickslip.rate_independent.sets.potential import Dissipation
from stickslip.rate_independent.signals.signal import wrapped

_STEP = 1e-6  # step of the differences in Newton's method
_STEP_OF_PHASES = 1e-3  # … with respect to phases
_WIDEST = 2e-3  # largest differences of phases
_SHIFTS = np.array([-1.0, -0.5, 0.5, 1.0])
# derivative of fourth order from the values at _SHIFTS
_DIFFERENCE = np.array([1.0, -8.0, 8.0, -1.0]) / 6.0
_MOST_ITERATIONS = 12  # largest number of iterations without fast convergence
_FAST = 0.1  # largest ratio of successive residuals of a fast iteration
_SMALL = 1e-8  # size of a Newton step after which the iteration ends
_SHARES = (1.0, 0.5, 0.25, 0.1)  # fractions of a step that are tried
_SLOW = 1e-8  # residual below which a slow decrease is regarded as rounding


@dataclass(frozen=True, eq=False)
class ForceWithMultipliers:
    """A force ξ and its multipliers: motions v_k at phases s_k.

    Attributes
    ----------
    violation : float
        Largest observed excess of ξ over K(s).
    bound : float
        Upper bound of the excess over all phases.
    violated : sequence of float
        Phases at which it lies outside, the worst first.
    sets : Sampled
        K(s) at its phases, once computed.
    """

    xi: Array
    phases: Array
    motions: Array
    violation: float = np.inf
    bound: float = np.inf
    violated: Sequence[float] = ()
    sets: AtPhases | None = None

    @cached_property
    def moved(self) -> Array:
        """The sum of the motions."""
        return self.motions.sum(axis=0)

    def balanced(self, c: Array, Q: Array | None) -> ForceWithMultipliers:
        """The force with motions whose sum is exactly c − Qξ: the largest one is corrected."""
        motions = self.motions.copy()
        rest = c - motions.sum(axis=0) - (0.0 if Q is None else Q @ self.xi)
        motions[int(np.linalg.norm(motions, axis=1).argmax())] += rest
        return replace(self, motions=motions)

    def merged(self, within: float) -> ForceWithMultipliers:
        """The force with phases merged that are closer than a distance, since Newton's method fails
        at double roots."""
        order = np.argsort(self.phases)
        phases, motions = self.phases[order], self.motions[order]
        pieces = np.split(np.arange(len(phases)), np.flatnonzero(np.diff(phases) > within) + 1)
        if len(pieces) == len(phases):
            return self
        sums = np.array([motions[piece].sum(axis=0) for piece in pieces])
        weights = np.linalg.norm(motions, axis=1) + np.finfo(float).tiny
        means = [float(np.average(phases[piece], weights=weights[piece])) for piece in pieces]
        return replace(self, phases=np.array(means), motions=sums, sets=None)

    def gap(self, source: Dissipation) -> float:
        """Duality gap: cost of the motions, less the work of the force on them."""
        sets = source.sampled(self.phases) if self.sets is None else self.sets
        cost = float(sets.support(self.motions).sum())
        lengths = float(np.linalg.norm(self.motions, axis=1).sum())
        return cost - float((self.motions @ self.xi).sum()) + self.violation * lengths


def refined(
    source: Dissipation,
    held: ForceWithMultipliers,
    c: Array,
    Q: Array | None,
    size: float,
    scales: Array,
) -> ForceWithMultipliers:
    """Newton's method for ξ, v_k and s_k at once, from close to the solution.

    Qξ + Σ v_k = c, v_k is normal to K(s_k) at ξ, and s_k is stationary for the distance of ξ + v_k
    from K(s), whose square is differentiable in s even at kinks of Ψ(s, v_k). Derivatives are
    differences, whose width in s is at most half of the scale on which K(s) changes, `scales`,
    shape (k,).

    Parameters
    ----------
    held : ForceWithMultipliers
        Close to the solution.
    c : array, shape (n,)
    Q : array, shape (n, n), optional
        Symmetric; 0 if it is not given.
    size : float
        Size of the sets, the unit of ξ.
    scales : array, shape (k,)
    """
    n = len(c)
    k = len(held.phases)
    length = float(np.linalg.norm(held.motions, axis=1).max())
    curvature = np.zeros((n, n)) if Q is None else Q * (size / length)
    widths = np.minimum(_WIDEST, 0.5 * scales)
    steps = np.column_stack([np.full((k, n), _STEP), _STEP_OF_PHASES * widths])
    moves = np.concatenate([np.zeros((k, 1, n + 1)), steps[:, None] * np.eye(n + 1)], axis=1)

    def at(x: Array, contacts: Array) -> tuple[float, Array, Array]:
        """Residuals of the equations, and the active phases, also for perturbed unknowns."""
        points = contacts[:, None, :] + moves + np.append(x, 0.0)
        touch = _touched(source, points.reshape(-1, n + 1), np.repeat(widths, n + 2), size).reshape(
            points.shape
        )
        rest = np.append(x - touch[:, 0, :n], touch[:, 0, n:], axis=1)
        rest = np.append(curvature @ x + contacts[:, :n].sum(axis=0) - c / length, rest)
        return float(np.linalg.norm(rest)), rest, touch

    # Unknowns: ξ in units of size, and for each phase v_k in units of length and s_k.
    x = held.xi / size
    contacts = np.column_stack([held.motions / length, held.phases])
    off, rest, touch = at(x, contacts)
    for iteration in range(2 * _MOST_ITERATIONS):
        step = np.linalg.lstsq(
            _jacobian(curvature, (touch[:, 1:] - touch[:, :1]) / steps[:, :, None]),
            rest,
            rcond=FINE_RANK,
        )[0]
        to_x = step[:n]
        to_contacts = step[n:].reshape(k, n + 1)
        if float(np.abs(step).max()) <= _SMALL:  # the next step would be a rounding error
            x, contacts = x - to_x, contacts - to_contacts
            break
        for share in _SHARES:
            ahead = at(x - share * to_x, contacts - share * to_contacts)
            if ahead[0] < off:
                break
        else:
            break
        x, contacts = x - share * to_x, contacts - share * to_contacts
        slow = ahead[0] > 0.5 * off and off < _SLOW
        slow |= iteration >= _MOST_ITERATIONS and ahead[0] > _FAST * off
        off, rest, touch = ahead
        if slow:
            break
    return ForceWithMultipliers(x * size, wrapped(contacts[:, n]), contacts[:, :n] * length)


def _jacobian(curvature: Array, changes: Array) -> Array:
    """Derivatives of the equations, from those of the contact points: (k, unknown, result)."""
    n, k = len(curvature), len(changes)
    jacobian = np.zeros((n + k * (n + 1), n + k * (n + 1)))
    jacobian[:n, :n] = curvature
    for i, change in enumerate(changes):
        slope = change.T.copy()
        slope[:n] *= -1.0
        own = slice(n + i * (n + 1), n + (i + 1) * (n + 1))
        jacobian[own, own] = slope
        jacobian[own, :n] = slope[:, :n] + np.eye(n + 1, n)
        jacobian[:n, own] = np.eye(n, n + 1)
    return jacobian


def _touched(source: Dissipation, points: Array, widths: Array, size: float) -> Array:
    """Points of K(s) nearest to points beyond it, and the slopes of half the squared distances in
    s.

    A row holds a point, in units of the size, and its phase.
    """
    phases = points[:, -1:] + widths[:, None] * np.append(0.0, _SHIFTS)
    rows = np.repeat(points[:, :-1], phases.shape[1], axis=0)
    nearest = source.sampled(phases.ravel()).nearest(size * rows) / size
    squares = 0.5 * np.square(rows - nearest).sum(axis=1).reshape(phases.shape)
    return np.column_stack([nearest[:: phases.shape[1]], squares[:, 1:] @ _DIFFERENCE / widths])
