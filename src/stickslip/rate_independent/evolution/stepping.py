"""Time steps of an evolution: computed, measured, and accepted or halved."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, StickslipError
from stickslip.rate_independent.evolution.audit import (
    EvolutionState,
    Measured,
    StepBlock,
    measure_steps,
)
from stickslip.rate_independent.evolution.evolution import Evolution
from stickslip.rate_independent.evolution.outcome import EvolutionOutcome
from stickslip.rate_independent.sets.stable_sets import largest_weight
from stickslip.rate_independent.solvers.choose import StepSolver

_LEAST = 1e-3  # smallest energy scale, as a fraction of the energy that the load can transfer
_LOOK_AHEAD = 64  # block size of a solver divided by the smallest number of steps computed together
# largest excess of the forces over K during an adaptive step, as a fraction of the tolerance
_SHARE = 0.5
_SHORTEST = 2.0**-44  # shortest step, as a fraction of the time span


class March:
    """An evolution in progress: iteration yields the accepted blocks of steps.

    An adaptive march halves a step if its |defect| exceeds its part of the tolerance, or if its
    overshoot exceeds the tolerance. That part is ½ tol (h/T · E + D), with the length h of the
    step, the total time T, the energy E transferred so far, and the energy D dissipated in the step
    (the larger term in short steep pulses), so that all defects add up to less than the tolerance.
    The defect is large at onsets and ends of sliding; the overshoot resolves the phase while forces
    are near their bounds.

    Parameters
    ----------
    nodes : array
        Times at which steps end, all after that of the state.
    state : State
        The start; later the last accepted state.
    kkt : float
        Largest KKT residual of a step, relative to the largest weight.
    tolerance : float
        Of the energy balance, and of the distance by which forces leave K.
    adaptive : bool
        Whether steps are halved to keep it; otherwise the nodes are final.

    Attributes
    ----------
    least : float
        Smallest energy scale, used if less has been transferred.
    outcome : EvolutionOutcome
        How it ended.
    detail : str
        The reason, in detail.
    """

    def __init__(
        self,
        problem: Evolution,
        nodes: Array,
        solver: StepSolver,
        state: EvolutionState,
        kkt: float,
        tolerance: float,
        adaptive: bool = True,
    ) -> None:
        self.problem = problem
        self.nodes = nodes
        self.solver = solver
        self.state: EvolutionState = state
        self.kkt = kkt
        self.tolerance = tolerance
        self.adaptive = adaptive
        self.weight: float = (
            largest_weight(problem.dissipation) or float(np.abs(state.load).max()) or 1.0
        )
        self.length: float = float(nodes[-1]) - problem.span[0] if len(nodes) else 0.0
        self.least: float = _LEAST * _energy_of_load(problem, nodes)
        self.outcome: EvolutionOutcome = EvolutionOutcome.INTERRUPTED
        self.detail: str = ""

    def __iter__(self) -> Iterator[StepBlock]:
        block = size = self.solver.block
        for k in range(0, len(self.nodes), block):
            pending = self.nodes[k : k + block]
            while len(pending):
                try:
                    tried = self._try(pending[:size])
                except StickslipError as error:
                    undefined = isinstance(error, DeclarationError)
                    self._stop(
                        EvolutionOutcome.UNDEFINED if undefined else EvolutionOutcome.NOT_CONVERGED,
                        str(error),
                    )
                    return
                good, fits = self._accepted(tried)
                # Steps after a halved one are recomputed, so few are computed ahead near onsets.
                size = min(block, max(2 * good, block // _LOOK_AHEAD, 1))
                if good:
                    yield self._advance(tried, good)
                pending = pending[good:]
                if good == len(fits):
                    continue
                if fits[good]:
                    residual = tried.block.columns["residual"][good]
                    self._stop(
                        EvolutionOutcome.NOT_CONVERGED, f"the KKT residual is {residual:.2e}"
                    )
                    return
                pending = self._halved(pending, ~fits[good:])
                if pending[0] - self.state.t < _SHORTEST * self.length:
                    self._stop(
                        EvolutionOutcome.JUMP,
                        f"between t = {self.state.t:.9g} and {pending[1]:.9g}",
                    )
                    return
        self.outcome = EvolutionOutcome.FINISHED

    def _stop(self, outcome: EvolutionOutcome, detail: str) -> None:
        self.outcome, self.detail = outcome, detail

    def _try(self, times: Array) -> Measured:
        """Steps to the given times, or to the first of them if a later one fails."""
        while True:
            try:
                return self._steps(times)
            except StickslipError:
                if len(times) == 1:
                    raise
                times = times[: len(times) // 2]

    def _steps(self, times: Array) -> Measured:
        start, problem = self.state, self.problem
        loads = problem.ell.over(times)
        sets = problem.sets(times) if problem.dissipation.depends_on_phase else start.sets
        states, effort = self.solver.advance(start.z, loads, sets)
        if len(states) < len(times):
            raise StickslipError("the solver did not converge")
        return measure_steps(
            problem, start, times, states, effort, loads, sets, self.weight, _SHARE * self.tolerance
        )

    def _accepted(self, tried: Measured) -> tuple[int, Array]:
        """Number of accepted steps, and whether each step is short enough."""
        columns = tried.block.columns
        fits = np.ones(len(tried.block.times), bool)
        if self.adaptive:
            share = np.diff(tried.block.times, prepend=self.state.t) / self.length
            scale = np.maximum(tried.flowed, self.least)
            spent = np.diff(columns["dissipated"], prepend=self.state.flow.dissipated)
            fits = np.abs(columns["defect"]) <= 0.5 * self.tolerance * (share * scale + spent)
            fits &= columns["overshoot"] <= _SHARE * self.tolerance
        refused = np.flatnonzero(~(fits & (columns["residual"] <= self.kkt)))
        return (int(refused[0]) if len(refused) else len(fits)), fits

    def _advance(self, tried: Measured, count: int) -> StepBlock:
        self.state = tried.state(count - 1)
        return tried.block.first(count)

    def _halved(self, pending: Array, long: Array) -> Array:
        """The pending times, with the middle of every step that is too long."""
        places = np.flatnonzero(long)
        before = np.append(self.state.t, pending)[places]
        return np.insert(pending, places, (before + pending[places]) / 2.0)


def _energy_of_load(problem: Evolution, times: Array) -> float:
    """Energy that the load can transfer, estimated at a few times. An undefined load is reported by
    the march."""
    loads = []
    for t in np.append(problem.span[0], times[:: max(1, len(times) // 8)]):
        with suppress(DeclarationError):
            loads.append(problem.ell.over(t[None])[0])
    first, *later = loads
    energies = [_released(problem, r) for r in [*(load - first for load in later), first]]
    return max([*energies[:-1], 1e-3 * energies[-1]]) or np.finfo(float).tiny


def _released(problem: Evolution, r: Array) -> float:
    """Energy that a force can release along its own direction."""
    length = float(r @ r)
    return 0.5 * length**2 / float(r @ (problem.A @ r)) if length > 0.0 else 0.0
