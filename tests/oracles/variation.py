"""First variation of a motion step by step with NumPy: an oracle for the compiled pass.

Fields, guards and their derivatives are NumPy functions of the expressions; eigenvalues say how far
a step of collocation reaches, and its equations are solved by LAPACK.

Between events Φ' = J(t)Φ along the motion's own states. At an event with the guard g the motion
leaves the field f⁻ for f⁺, and neighbours do so a little earlier or later: S = I + (f⁺ −
f⁻)∇gᵀ/(g_t + ∇g·f⁻). A parameter is one more component that does not move, so derivatives with
respect to it pass through the same formulas.

References
----------
R. I. Leine, H. Nijmeijer, *Dynamics and Bifurcations of Non-Smooth Mechanical Systems*, Springer
2004, chapter 7 (the saltation matrix); E. Hairer, S. P. Nørsett, G. Wanner, *Solving Ordinary
Differential Equations I*, II.7 (collocation).
"""

from __future__ import annotations

from functools import cache
from itertools import permutations
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import expm, matrix_balance

from oracles.fields import function
from stickslip.arrays import Array
from stickslip.orbits.fields.engine.tables import Leave
from stickslip.orbits.fields.mode_field import Piece, Pieces
from stickslip.orbits.fields.variational import Variation
from stickslip.symbolic import expressions as ex

if TYPE_CHECKING:
    from collections.abc import Sequence

    from stickslip.motion.record.knots import Knots
    from stickslip.motion.trajectory import Trajectory


_STAGES = 8  # Gauss nodes of a step: order 16
# largest |eigenvalue| × step of a collocation step: its Padé approximant of exp is exact to
# rounding there
_REACH = 1.5
_BATCH = 4096  # collocation steps solved at once
TOGETHER = 1e-9  # events closer than this part of the motion are simultaneous
# a guard whose rate is this small, relative to its terms and its usual rate, is touched, not
# crossed
_TANGENT = 1e-6
_SAME = 1e-8  # derivatives that differ by less, relative to the largest, are the same
_NO_JUMP = 1e-12  # a change of the field this small, relative to its terms, is none


def variation(trajectory: Trajectory, pieces: Pieces, directions: Array | None = None) -> Variation:
    """First variation along a motion.

    Parameters
    ----------
    trajectory : Trajectory
    pieces : Pieces
        Smooth pieces of its system; their free parameter p, if any, is differentiated for, too.
    directions : array, shape (m, directions), optional
        Changes of the first (state, p); by default every component by itself. They have to keep the
        constraints of the first mode: what sticks is not pushed, what slides without mass stays on
        its threshold.

    Returns
    -------
    Variation
    """
    k = trajectory.knots
    p = np.array([trajectory.parameters[name] for name in trajectory.system.parameters])
    made = [pieces(m, r) for m, r in zip(k.mode, k.region, strict=True)]
    flows = transitions(trajectory, made, p)
    events = _Events(k, made, p, pieces)
    first = np.eye(len(made[0].columns)) if directions is None else directions
    after = np.empty((len(k.time), *first.shape))
    after[0] = first
    i = 1
    while i < len(k.time):
        arrived = flows[i - 1] @ after[i - 1]
        last = i
        if made[i] is not made[i - 1]:
            last = events.last_of_cluster(i)
            arrived = events.saltation(i, last, arrived) @ arrived
        after[i : last + 1] = arrived
        i = last + 1
    return Variation(
        after,
        np.full(after[:, 0].shape, np.nan),
        made,
        np.arange(len(made)),
        tuple(events.corners),
        tuple(events.grazings),
    )


# -- fields with NumPy -----------------------------------------------------------------------------


@cache
def _functions(piece: Piece) -> tuple[Any, Any, Any]:
    field, columns = piece.field, piece.columns
    slopes = [ex.derivative(f, c) for f in field.rates for c in columns]
    guards = [
        e
        for g in field.guards
        for e in (g.value, *(ex.derivative(g.value, c) for c in ("t", *columns)))
    ]
    return function(field, field.rates), function(field, slopes), function(field, guards)


def _rates(piece: Piece, t: float, y: Array, p: Array) -> Array:
    return _functions(piece)[0](t, y, p)


def _jacobian(piece: Piece, t: Array, y: Array, p: Array) -> Array:
    values = _functions(piece)[1](t, y, p)
    return np.moveaxis(values.reshape(len(y), len(piece.columns), -1), -1, 0)


def _leave(piece: Piece, t: float, y: Array, p: Array) -> Leave:
    f = _rates(piece, t, y, p)
    table = _functions(piece)[2](t, y, p).reshape(-1, 2 + len(piece.columns))
    terms = table[:, 2 : 2 + len(y)] * f
    fall = table[:, 1] + np.sum(terms, axis=1)
    sizes = np.abs(table[:, 1]) + np.sum(np.abs(terms), axis=1)
    return Leave(f, table[:, 0], table[:, 2:], fall, sizes)


# -- between events --------------------------------------------------------------------------------


def transitions(trajectory: Trajectory, made: list[Piece], p: Array) -> Array:
    """Transition matrix of (state, p) over each step, shape (steps, m, m)."""
    k = trajectory.knots
    n = trajectory.knots.state.shape[1]
    m = len(made[0].columns)
    parts = resolution(trajectory, made, p)
    groups = _steps_by_piece(trajectory.knots, made)
    flows = np.tile(np.eye(m), (len(parts), 1, 1))
    even = {piece for piece, _ in groups if piece.constant and m == n}
    index = np.sort(
        np.concatenate([np.zeros(0, int), *(steps for piece, steps in groups if piece not in even)])
    )
    times, owner, h = gauss_points(k, index, parts[index])
    states = trajectory._sample(times.ravel(), np.repeat(owner, _STAGES))[:, :n].reshape(
        -1, _STAGES, n
    )
    for piece, steps in groups:
        slopes = _jacobian(piece, k.time[steps], k.state[steps].T, p)
        scale = _balance(slopes[:, :, :n])
        if piece in even:
            balanced = slopes / scale[:, None] * scale
            each = expm(balanced * np.diff(k.time)[steps, None, None])
            flows[steps] = each * scale[:, None] / scale
            continue
        own = np.isin(owner, steps)
        pieces = _collocate(piece, times[own], states[own], h[own], p, scale)
        last = np.cumsum(parts[steps])
        for step, a, b in zip(steps, last - parts[steps], last, strict=True):
            flow = _product(pieces[a:b]) * scale[:, None]
            flow[:, :n] /= scale
            flows[step, :n] = flow
    return flows


def _balance(slopes: Array) -> Array:
    """Powers of two in units of which all components are alike: rates of fast modes are large."""
    _, (scale, _) = matrix_balance(np.max(np.abs(slopes), axis=0), permute=False, separate=True)
    return scale


def _steps_by_piece(k: Knots, made: list[Piece]) -> list[tuple[Piece, Array]]:
    """The steps that take time, by the piece they are in."""
    index: dict[Piece, list[int]] = {}
    for i, h in enumerate(np.diff(k.time)):
        if h > 0.0:
            index.setdefault(made[i], []).append(i)
    return [(piece, np.array(steps)) for piece, steps in index.items()]


def resolution(trajectory: Trajectory, made: list[Piece], p: Array) -> Array:
    """Number of equal parts of each step in which linear motions are resolved by a Gauss rule."""
    k = trajectory.knots
    length = np.diff(k.time)
    drives = np.max(np.abs(trajectory.problem.constants.omega), initial=0.0)
    parts = np.ones(len(length), dtype=int)
    for piece, index in _steps_by_piece(k, made):
        ends = np.concatenate([index, index + 1])
        J = _jacobian(piece, k.time[ends], k.state[ends].T, p)[:, :, : k.state.shape[1]]
        fastest = np.maximum(
            *np.split(np.max(np.abs(np.linalg.eigvals(J)), axis=1, initial=0.0), 2)
        )
        parts[index] = np.maximum(
            1, np.ceil(length[index] * np.maximum(fastest, drives) / _REACH)
        ).astype(int)
    return parts


def gauss_points(k: Knots, index: Array, parts: Array) -> tuple[Array, Array, Array]:
    """Gauss nodes of steps divided into parts: times (pieces, stages), step of each piece, and
    length of each piece."""
    c = gauss()[0]
    owner = np.repeat(index, parts)
    within = np.arange(len(owner)) - np.repeat(np.cumsum(parts) - parts, parts)
    h = np.repeat((k.time[index + 1] - k.time[index]) / parts, parts)
    return k.time[owner][:, None] + (within[:, None] + c) * h[:, None], owner, h


def _collocate(
    piece: Piece, times: Array, states: Array, h: Array, p: Array, scale: Array
) -> Array:
    """Upper rows of the transition matrices over collocation steps of one piece, from the states at
    their nodes, in units of some scales."""
    flows = np.empty((len(h), states.shape[2], len(piece.columns)))
    for s in range(0, len(h), _BATCH):
        part = slice(s, s + _BATCH)
        J = _jacobian(piece, times[part].ravel(), states[part].reshape(-1, states.shape[2]).T, p)
        J = J / scale[:, None]
        J[:, :, : len(scale)] *= scale
        flows[part] = collocation(J.reshape(-1, _STAGES, *J.shape[1:]), h[part])
    return flows


def collocation(J: Array, h: Array) -> Array:
    """Solve Φ' = J_y Φ (+ J_p) over steps by collocation at the Gauss nodes.

    Parameters
    ----------
    J : array, shape (steps, stages, n, m)
        ∂f/∂(y, p) at the nodes.
    h : array, shape (steps,)

    Returns
    -------
    array, shape (steps, n, m)
        ∂y(end)/∂(y(start), p).
    """
    _, weights, A = gauss()
    steps, s, n, m = J.shape
    Jy = J[..., :n]
    # The slopes K_i at the nodes solve K_i = J_i(1 + h Σ_j a_ij K_j), all steps at once.
    system = -np.einsum("k,ij,kiab->kiajb", h, A, Jy).reshape(steps, s * n, s * n)
    system[:, np.arange(s * n), np.arange(s * n)] += 1.0
    slopes = np.linalg.solve(system, J.reshape(steps, s * n, m)).reshape(steps, s, n, m)
    flow = np.einsum("k,i,kiam->kam", h, weights, slopes)
    flow[:, np.arange(n), np.arange(n)] += 1.0
    return flow


def _product(flows: Array) -> Array:
    """Flow over steps one after the other, in pairs."""
    n = flows.shape[1]
    while len(flows) > 1:
        later = flows[1::2]
        pairs = later[:, :, :n] @ flows[0 : 2 * len(later) : 2]
        pairs[:, :, n:] += later[:, :, n:]
        flows = np.concatenate([pairs, flows[2 * len(later) :]])
    return flows[0]


@cache
def gauss() -> tuple[Array, Array, Array]:
    """Nodes and weights on [0, 1] and the matrix of collocation aᵢⱼ = ∫₀^cᵢ ℓⱼ."""
    x, w = np.polynomial.legendre.leggauss(_STAGES)
    c = 0.5 * (x + 1.0)
    # ℓⱼ = Σ_d (2d + 1)/2 wⱼ P_d(xⱼ) P_d, and ∫P_d = (P_{d+1} − P_{d−1})/(2d + 1), both of which are
    # stable.
    P = np.polynomial.legendre.legvander(x, _STAGES)
    integral = np.empty((_STAGES, _STAGES))
    integral[:, 0] = x + 1.0
    for d in range(1, _STAGES):
        integral[:, d] = (P[:, d + 1] - P[:, d - 1]) / (2 * d + 1)
    weighted = 0.5 * (2 * np.arange(_STAGES) + 1) * P[:, :_STAGES] * w[:, None]
    return c, 0.5 * w, 0.5 * integral @ weighted.T


# -- at events -------------------------------------------------------------------------------------


class _Events:
    """Saltation matrices of the events of a motion."""

    def __init__(self, knots: Knots, made: list[Piece], p: Array, pieces: Pieces) -> None:
        self.knots = knots
        self.made = made
        self.p = p
        self.pieces = pieces
        self.together = TOGETHER * (knots.time[-1] - knots.time[0])
        self.corners: list[float] = []
        self.grazings: list[float] = []

    def last_of_cluster(self, i: int) -> int:
        """Last of the events that follow event i without any time in between."""
        time = self.knots.time
        last = i
        while last + 2 < len(time) and time[last + 1] - time[i] <= 1e-3 * self.together:
            last += 1
        return last

    def saltation(self, i: int, last: int, arrived: Array) -> Array:
        """Derivative of the states after the events i … last with respect to those before, along
        the motion."""
        left = self.made[i - 1]
        right = self.made[last]
        t = float(self.knots.time[i])
        y = self.knots.state[i]
        here, f = _leave(left, t, y, self.p), _rates(right, t, y, self.p)
        fired = self._fired(left, right, here, self.knots.cause[i : last + 1])
        usual = self._usual(left, here, i, last)
        others = np.flatnonzero(
            (np.abs(here.value) <= self.together * np.abs(here.fall))
            & (here.fall < -_TANGENT * usual)
            & (left.switches != left.switches[fired])
        )
        if len(others) == 0 or self._coincide(here, [fired, *map(int, others)], arrived):
            return self._jump(here, fired, f, t, usual[fired])
        return self._corner(
            left,
            right,
            t,
            y,
            [int(left.switches[fired]), *map(int, left.switches[others])],
            arrived,
        )

    def _usual(self, left: Piece, here: Leave, i: int, last: int) -> Array:
        """How fast the guards fall at most around an event."""
        around = [here.terms]
        for knot in (i - 1, min(last + 1, len(self.knots.time) - 1)):
            fall = _leave(left, float(self.knots.time[knot]), self.knots.state[knot], self.p).fall
            around.append(np.where(np.isfinite(fall), np.abs(fall), 0.0))
        return np.max(around, axis=0)

    def _fired(self, left: Piece, right: Piece, here: Leave, cause: Array) -> int:
        """The guard that fired: of those that belong to the causes, else to a switch that changed,
        the one at zero."""
        causes = {int(c) for c in cause if c >= 0}
        if not causes:
            causes = {int(s) for s in left.switches if left.setting(s) != right.setting(s)}
        found = [g for g, s in enumerate(left.switches) if int(s) in causes]
        return min(found, key=lambda g: abs(here.value[g]) / (abs(here.fall[g]) + 1e-300))

    @staticmethod
    def _coincide(here: Leave, guards: list[int], arrived: Array) -> bool:
        """Whether events that coincide do so for all neighbours, too, so that they are one."""
        with np.errstate(all="ignore"):
            delays = here.slopes[guards] / here.fall[guards, None] @ arrived
            return bool(np.max(np.abs(delays - delays[0])) <= _SAME * np.max(np.abs(delays)))

    def _jump(self, here: Leave, g: int, f: Array, t: float, usual: float) -> Array:
        """S for one guard that usually falls at some rate; the motion goes on with the rates f."""
        S = np.eye(here.slopes.shape[1])
        if np.max(np.abs(f - here.rates)) <= _NO_JUMP * np.max(np.abs(f) + np.abs(here.rates)):
            return S
        if abs(here.fall[g]) <= _TANGENT * usual:
            self.grazings.append(t)
        else:
            S[: len(f)] += np.outer(f - here.rates, here.slopes[g] / here.fall[g])
        return S

    def _corner(
        self, left: Piece, right: Piece, t: float, y: Array, switches: list[int], arrived: Array
    ) -> Array:
        """S where several guards vanish at once: it exists if the order in which they are passed
        does not matter."""
        routes = [self._route(left, right, t, y, order) for order in permutations(switches[:3])]
        images = [S @ arrived for S in routes if S is not None]
        size = max((float(np.max(np.abs(image))) for image in images), default=0.0)
        apart = any(np.max(np.abs(image - images[0])) > _SAME * size for image in images)
        if apart or len(images) < len(routes) or len(switches) > 3:
            self.corners.append(t)
        return next((S for S in routes if S is not None), np.eye(len(arrived)))

    def _route(
        self, left: Piece, right: Piece, t: float, y: Array, order: Sequence[int]
    ) -> Array | None:
        """S through the switches in an order; None if they do not change in it."""
        S = np.eye(len(left.columns))
        piece = left
        for switch in order:
            here = _leave(piece, t, y, self.p)
            falling = [g for g in np.flatnonzero(piece.switches == switch) if here.fall[g] < 0.0]
            if not falling:
                return None
            g = int(min(falling, key=lambda g: abs(here.value[g])))
            piece = (
                right
                if switch == order[-1]
                else self.pieces(*piece.switched(switch, right.setting(switch)))
            )
            S = self._jump(here, g, _rates(piece, t, y, self.p), t, here.terms[g]) @ S
        return S
