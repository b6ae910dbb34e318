"""Motions computed block by block, and their measures."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from stickslip.arrays import Array
from stickslip.certificates import Certificate, Residual
from stickslip.errors import ConvergenceError
from stickslip.kept import cached_property
from stickslip.rate_independent.evolution.audit import start_state
from stickslip.rate_independent.evolution.evolution import Evolution
from stickslip.rate_independent.evolution.evolve import KKT, evolve, step_times
from stickslip.rate_independent.evolution.stepping import March
from stickslip.rate_independent.solvers.choose import choose_solver

if TYPE_CHECKING:
    from stickslip.rate_independent.evolution.history import History
    from stickslip.rate_independent.evolution.model import EvolutionModel
    from stickslip.rate_independent.play.operator import Play

_Rows = Callable[[Array], Array]
TESTS = 5  # continuous functions that rates are tested with: cos(jπ(t − t₀)/T)
_BETWEEN = 16  # pieces of an interval in which a play moves


class Motion(Protocol):
    """A motion with its costs, which are available after it is completed."""

    steps: int
    wall_time: float
    dissipated: float

    @property
    def certificate(self) -> Certificate:
        """Certificate of the completed motion."""
        ...

    def blocks(self) -> Iterator[tuple[Array, Array]]:
        """Times (m,) and states (m, n), including the start, block by block; affine in between."""
        ...

    def at(self, times: Array) -> Array:
        """States (m, n) at given times."""
        ...


def motion_of(problem: Evolution, tolerance: float, keep: bool = False) -> Motion:
    """The motion of a problem: an exact play if it is scalar and its thresholds are known, else an
    adaptive evolution.

    Parameters
    ----------
    tolerance : float
        Of the energy balance of an evolution.
    keep : bool
        Whether :meth:`Motion.at` is needed.
    """
    if problem.dissipation.thresholds is not None:
        return PlayMotion(problem)
    return SteppedMotion(problem, tolerance, keep)


class PlayMotion:
    """A scalar motion, exact.

    Parameters
    ----------
    problem : Evolution
        With a dissipation that has `thresholds`.
    """

    def __init__(self, problem: Evolution) -> None:
        from stickslip.rate_independent.play.operator import play

        began = time.perf_counter()
        thresholds = problem.dissipation.thresholds
        assert thresholds is not None
        self.play: Play = play(
            problem.ell,
            thresholds,
            problem.span,
            initial=float(problem.initial[0]),
            epsilon=problem.epsilon,
            stiffness=float(problem.A[0, 0]),
        )
        self.steps: int = len(self.play.time) - 1
        self.wall_time: float = time.perf_counter() - began
        self.dissipated: float = float(self.play.at(problem.span[1])["dissipated_energy"])

    @property
    def certificate(self) -> Certificate:
        return self.play.certificate

    def blocks(self) -> Iterator[tuple[Array, Array]]:
        nodes = self.play.time
        moving = np.flatnonzero(self.play.mode)
        between = np.linspace(nodes[moving], nodes[moving + 1], _BETWEEN + 1)[1:-1].ravel()
        times = np.union1d(nodes, between)
        yield times, self.at(times)

    def at(self, times: Array) -> Array:
        return self.play.position(times)[:, None]


class SteppedMotion:
    """An adaptive evolution."""

    def __init__(self, problem: Evolution, tolerance: float, keep: bool) -> None:
        self.problem = problem
        self.tolerance = tolerance
        self.keep = keep
        self.kept: list[tuple[Array, Array]] = []
        self.steps: int = 0
        self.wall_time: float = 0.0
        self.dissipated: float = 0.0
        self.worst: dict[str, float] = {"distance": 0.0, "residual": 0.0}
        self.defect: float = 0.0
        self.scale: float = 0.0

    @property
    def certificate(self) -> Certificate:
        """Stability and optimality of the worst step, and the sum of all defects of the energy
        balance, relative to the transferred energy."""
        share = self.defect / self.scale if self.scale > 0.0 else 0.0
        residuals = (
            Residual("stability", self.worst["distance"], KKT),
            Residual("KKT residual", self.worst["residual"], KKT),
            Residual("energy balance", share, self.tolerance),
        )
        return Certificate(residuals)

    def blocks(self) -> Iterator[tuple[Array, Array]]:
        problem = self.problem
        began = time.perf_counter()
        nodes, _ = step_times(problem, problem.span, None)
        state = start_state(problem, problem.span[0], problem.initial)
        solver = choose_solver(problem, None, KKT / 2.0)
        march = March(problem, nodes[1:], solver, state, KKT, self.tolerance)
        yield self._passed(np.array([state.t]), state.z[None])
        for block in march:
            self.steps += len(block.times)
            for name in self.worst:
                self.worst[name] = max(self.worst[name], float(np.max(block.columns[name])))
            self.defect += float(np.sum(np.abs(block.columns["defect"])))
            yield self._passed(block.times, block.states)
        if not march.outcome.ok:
            raise ConvergenceError(
                f"evolution with epsilon = {problem.epsilon:g}", march.outcome.label, march.detail
            )
        flow = march.state.flow
        self.dissipated = flow.dissipated
        self.scale = max(flow.highest - flow.lowest, flow.dissipated, abs(flow.work), march.least)
        self.wall_time = time.perf_counter() - began

    def _passed(self, times: Array, states: Array) -> tuple[Array, Array]:
        if self.keep:
            self.kept.append((times, states))
        return times, states

    def at(self, times: Array) -> Array:
        nodes, states = (np.concatenate(parts) for parts in zip(*self.kept, strict=True))
        self.kept = [(nodes, states)]
        return affine(nodes, states, times)


def affine(nodes: Array, states: Array, times: Array) -> Array:
    """States at times between the nodes."""
    left = np.clip(np.searchsorted(nodes, times, side="right") - 1, 0, len(nodes) - 2)
    share = ((times - nodes[left]) / (nodes[left + 1] - nodes[left]))[:, None]
    return (1.0 - share) * states[left] + share * states[left + 1]


def evolved(
    model: EvolutionModel, averaged: bool, progress: Callable[[float], None] | None = None
) -> History | Play:
    """The evolution of a model: an exact play if it is scalar, else minimising movements.

    Parameters
    ----------
    averaged : bool
        Whether the limit of fast oscillations is meant.
    progress : callable, optional
    """
    from stickslip.rate_independent.evolution.model import with_nearest_start

    problem = with_nearest_start(model.problem.averaged) if averaged else model.problem
    if problem.dissipation.thresholds is not None:
        return PlayMotion(problem).play
    return evolve(problem, steps=model.steps, progress=progress)


class Gauge:
    """Measures of a motion. |·| is the energy norm √⟨Az, z⟩.

    Parameters
    ----------
    grid : array
        Times at which states are kept, for the modulus of continuity.
    reference : callable, optional
        Motion to compare with: times (m,) → states (m, n).

    Attributes
    ----------
    distance : float
        sup |z − reference| over the times that passed.
    variation, square : float
        ∫|ż|dt and ∫|ż|²dt.
    tested : array, shape (tests, n)
        ∫φ_j dz.
    """

    def __init__(self, A: Any, grid: Array, reference: _Rows | None = None) -> None:
        self.A = A
        self.grid = grid
        self.reference = reference
        self.distance: float = 0.0
        self.variation: float = 0.0
        self.square: float = 0.0
        self.tested: Array = np.zeros((TESTS, A.shape[0]))
        self.kept: list[Array] = []
        self.last: tuple[Array, Array] = np.empty(0), np.empty((0, A.shape[0]))

    def measure(self, motion: Motion) -> Gauge:
        """Let a motion pass by."""
        for times, states in motion.blocks():
            self._take(times, states)
        return self

    def _take(self, times: Array, states: Array) -> None:
        if self.reference is not None:
            self.distance = max(
                self.distance, float(self._norms(states - self.reference(times)).max())
            )
        times = np.append(self.last[0], times)
        states = np.concatenate([self.last[1], states])
        self.last = times[-1:].copy(), states[-1:].copy()
        if len(times) == 1:
            return
        ahead = self.grid[sum(map(len, self.kept)) :]
        self.kept.append(affine(times, states, ahead[ahead <= times[-1]]))
        h = np.diff(times)
        d = np.diff(states, axis=0)
        length = self._norms(d)
        self.variation += float(length.sum())
        self.square += float(np.sum(np.square(length) / h))
        start, middle, end = (self._tests(t) for t in (times[:-1], times[:-1] + h / 2.0, times[1:]))
        self.tested += (start + 4.0 * middle + end) / 6.0 @ d

    def _tests(self, times: Array) -> Array:
        """φ_j(t), shape (tests, m)."""
        x = np.pi * (times - self.grid[0]) / (self.grid[-1] - self.grid[0])
        return np.cos(np.arange(TESTS)[:, None] * x)

    def _norms(self, rows: Array) -> Array:
        return np.sqrt(np.maximum(np.einsum("ij,ij->i", (self.A @ rows.T).T, rows), 0.0))

    def weak_distance(self, other: Gauge) -> Array:
        """|∫φ dz − ∫φ dw| for every test function φ."""
        return self._norms(self.tested - other.tested)

    @cached_property
    def modulus(self) -> Array:
        """sup |z(t₂) − z(t₁)| over |t₂ − t₁| ≤ δ, for δ = 1, 2, 3, ... intervals of the grid."""
        z = np.concatenate(self.kept)
        products = z @ (self.A @ z.T)
        squares = products.diagonal()
        apart = np.maximum(squares[:, None] + squares[None] - 2.0 * products, 0.0)
        return np.sqrt(
            np.maximum.accumulate([apart.diagonal(lag).max() for lag in range(1, len(z))])
        )
