"""Error measures of a step, independent of the solver that computed it.

Between the ends of a step z is taken to be affine, ẑ; d is its increment. Along ẑ the energy
balance (E) of [M] (2.2) holds up to the *defect*, the mean over the step of

    Ψ(s, d) − ⟨ℓ − Aẑ, d⟩   (≥ 0 where ẑ is stable),

measured by Simpson's rule: at the ends, where the solver was, and in the middle, where it was not.
The excess of the force over K between the ends is the *overshoot*: bounded if load and thresholds
are formulas or tables, estimated from the same three points if they are Python functions
(``between.py``).

Let z be the exact evolution. As long as ẑ is stable, d/dt ½⟨A(z − ẑ), z − ẑ⟩ = −⟨ξ − ξ̂, ż − dẑ/dt⟩
is at most Ψ(dẑ/dt) − ⟨ξ̂, dẑ/dt⟩: half the squared error, in the energy norm, grows by no more than
the defect. While the force overshoots by δ, it may also grow by δ|ż|, in the dual norm of the sets:
the *slack*, with ż approximated by that of ẑ. Motion of z that ẑ lacks completely is *missed*: a
component pushed by δ, moving alone, has the displacement δ/√Aᵢᵢ in the energy norm. Missed
displacements do not add up, since a later push in the same direction moves z only by the excess
over the earlier one; the largest counts.

A minimising-movement step also has the classical two-sided estimate (ΔE, d, ξ: energy, increment,
force):

    ΔE + Ψ(s_k, d) + ⟨Δℓ, z_{k−1}⟩ = −½⟨Ad, d⟩ ≤ 0,
    ΔE + Ψ(s_{k−1}, d) + ⟨Δℓ, z_k⟩ = ½⟨Ad, d⟩ + [Ψ(s_{k−1}, d) − ⟨ξ_{k−1}, d⟩] ≥ 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stickslip.arrays import Array
from stickslip.rate_independent.evolution.between import overshoot
from stickslip.rate_independent.evolution.evolution import Evolution
from stickslip.rate_independent.sets.stable_sets import StableSets, Step

_EPS = float(np.finfo(float).eps)

STEP_COLUMNS = {
    "energy": "energy of the state",
    "dissipated": "dissipated energy",
    "work": "work of the load",
    "slipping": "number of components (or groups) that moved",
    "residual": "KKT residual of the step, relative to the largest weight",
    "effort": "cycles of the solver, or changes of its active set",
    "distance": "distance of the force from the stable set, relative to the largest weight",
    "defect": "defect of the energy balance in the step",
    "overshoot": "bound on the distance of the force from the stable set during the step, "
    "relative to the largest weight",
    "slack": "bound on the contribution of the overshoot to half the squared error",
    "missed": "bound on the error of z in the energy norm due to the overshoot of the force",
    "increment": "half the squared energy norm of the increment",
    "gap": "dissipation of the increment at the previous phase, minus the work of the previous "
    "force",
}
"""What is kept of every step, with its meaning. Work of the load: −∫⟨dℓ/dt, z⟩dt."""


@dataclass(frozen=True)
class EnergyFlow:
    """Energies up to a time: dissipation, work, and bounds of the energy."""

    dissipated: float = 0.0
    work: float = 0.0
    lowest: float = np.inf
    highest: float = -np.inf


@dataclass(frozen=True)
class EvolutionState:
    """State of an evolution: z(t), and the data for the next step."""

    t: float
    z: Array
    load: Array
    elastic: Array  # A z
    sets: StableSets
    flow: EnergyFlow


@dataclass(frozen=True)
class StepBlock:
    """Consecutive steps: times (m,), states (m, n), and the columns (m,) of `STEP_COLUMNS`."""

    times: Array
    states: Array
    columns: dict[str, Array]

    def first(self, count: int) -> StepBlock:
        """The first steps of it."""
        columns = {name: column[:count] for name, column in self.columns.items()}
        return StepBlock(self.times[:count], self.states[:count], columns)


@dataclass(frozen=True)
class Measured:
    """A block of steps that is measured but not accepted, with the data that the step after each of
    them needs."""

    block: StepBlock
    loads: Array
    elastic: Array
    sets: StableSets
    flow: EnergyFlow

    @property
    def flowed(self) -> Array:
        """Energy that has flowed up to each step: the scale of its defect."""
        energy, work = self.block.columns["energy"], self.block.columns["work"]
        swing = np.maximum.accumulate(np.append(self.flow.highest, energy)) - np.minimum.accumulate(
            np.append(self.flow.lowest, energy)
        )
        return np.maximum.reduce([swing[1:], np.abs(work), self.block.columns["dissipated"]])

    def state(self, k: int) -> EvolutionState:
        """The state after step k."""
        columns = self.block.columns
        energy = columns["energy"][: k + 1]
        flow = EnergyFlow(
            float(columns["dissipated"][k]),
            float(columns["work"][k]),
            min(self.flow.lowest, float(energy.min())),
            max(self.flow.highest, float(energy.max())),
        )
        t = float(self.block.times[k])
        z = self.block.states[k].copy()
        return EvolutionState(
            t, z, self.loads[k].copy(), self.elastic[k].copy(), self.sets.row(k), flow
        )


def start_state(
    problem: Evolution, t: float, z: Array, flow: EnergyFlow | None = None
) -> EvolutionState:
    """The state z at time t."""
    times = np.array([t])
    load = problem.ell.over(times)[0]
    elastic = problem.A @ z
    energy = float(0.5 * z @ elastic - z @ load)
    flow = flow or EnergyFlow()
    flow = replace(flow, lowest=min(flow.lowest, energy), highest=max(flow.highest, energy))
    return EvolutionState(t, z, load, elastic, problem.sets(times), flow)


def measure_steps(
    problem: Evolution,
    start: EvolutionState,
    times: Array,
    states: Array,
    effort: Array,
    loads: Array,
    sets: StableSets,
    weight: float,
    tolerance: float,
) -> Measured:
    """The columns of steps that lead from `start` to the given states.

    Parameters
    ----------
    times, states, effort, loads : arrays, shapes (m,), (m, n), (m,), (m, n)
        Of the ends of the steps.
    sets : StableSets
        At the ends; `start.sets` itself if Ψ does not depend on the phase.
    weight : float
        Largest weight over a period: the least scale of a force.
    tolerance : float
        Of the overshoot, relative to the largest weight: below it, no sharper bound is needed.
    """
    A = problem.A
    mids = (_before(times, np.array(start.t)) + times) / 2.0
    middle = start.sets if sets is start.sets else problem.sets(mids)
    load_mid = problem.ell.over(mids)
    elastic = _times(A, states)
    z_before = _before(states, start.z)
    elastic_before = _before(elastic, start.elastic)
    load_before = _before(loads, start.load)
    d = states - z_before
    pull = elastic - elastic_before
    before = sets.before(start.sets)
    forces = (
        load_before - elastic_before,
        load_mid - 0.5 * (elastic_before + elastic),
        loads - elastic,
    )
    outside = sets.outside(forces[2])
    now = sets.value(d)
    rounding = _EPS * (np.abs(states).max(axis=1) + np.abs(z_before).max(axis=1))
    half, then = (now, now) if sets is start.sets else (middle.value(d), before.value(d))
    gap = then - _dot(forces[0], d)
    # ∫ Ψ(ż) − ⟨ℓ − A z, ż⟩ dt along a straight step, by Simpson's rule.
    defect = (gap + 4.0 * (half - _dot(forces[1], d)) + now - _dot(forces[2], d)) / 6.0
    # −∫ ⟨ℓ̇, z⟩ dt, integrated by parts.
    work = (
        _dot(load_before, z_before)
        - _dot(loads, states)
        + _dot(load_before + 4.0 * load_mid + loads, d) / 6.0
    )
    scale = np.broadcast_to(np.maximum(sets.size(), weight), len(times))
    beyond = None if problem.bounded else sets.overshoot(before, middle, forces)
    if beyond is None:
        ends = np.append(start.t, times)
        rows = np.concatenate([start.elastic[None], elastic])
        beyond = overshoot(problem, ends, rows, tolerance * scale)
    columns = {
        "energy": _dot(states, 0.5 * elastic - loads),
        "dissipated": start.flow.dissipated + np.cumsum((then + 4.0 * half + now) / 6.0),
        "work": start.flow.work + np.cumsum(work),
        "slipping": sets.moving(d),
        "residual": sets.residual(forces[2], outside, d, Step(now, pull, rounding)) / scale,
        "effort": effort,
        "distance": sets.largest(outside) / scale,
        "defect": defect,
        "overshoot": beyond / scale,
        "slack": beyond * sets.total(d),
        "missed": beyond / np.sqrt(A.diagonal().min()),
        "increment": 0.5 * _dot(pull, d),
        "gap": gap,
    }
    return Measured(StepBlock(times, states, columns), loads, elastic, sets, start.flow)


def _times(A: Array, rows: Array) -> Array:
    """A times every row."""
    return (A @ rows.T).T


def _dot(a: Array, b: Array) -> Array:
    return np.einsum("ij,ij->i", a, b)


def _before(rows: Array, first: Array) -> Array:
    """Every row replaced by the previous one."""
    first = first[None]
    return first if len(rows) == 1 else np.concatenate([first, rows[:-1]])
