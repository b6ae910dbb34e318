"""The function ``evolve``: from an evolution and times to its history."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arguments import check_tolerances, validated
from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.numerics.levels import SAME_VALUE, WHOLE_COUNT
from stickslip.progress import reporting
from stickslip.rate_independent.evolution.audit import (
    STEP_COLUMNS,
    EnergyFlow,
    EvolutionState,
    StepBlock,
    start_state,
)
from stickslip.rate_independent.evolution.evolution import STABLE_WITHIN, Evolution
from stickslip.rate_independent.evolution.history import History
from stickslip.rate_independent.evolution.stepping import March
from stickslip.rate_independent.solvers.choose import choose_solver

if TYPE_CHECKING:
    import xarray

Observable = Callable[[float, Array], Any]
KKT = 1e-8  # residual of a step, relative to the largest weight
# Steps of the coarse mesh that an adaptive evolution refines: in a period, and in all.
_PER_PERIOD = 8
_PER_SPAN = 64
KEPT = 20_000_000  # largest number of values of z that are stored by default


@validated
def evolve(
    problem: Evolution,
    times: Any = None,
    *,
    steps: int | None = None,
    output: ArrayLike | None = None,
    observables: Mapping[str, Observable] | None = None,
    tolerance: float = 1e-3,
    kkt: float = KKT,
    solver: str | None = None,
    start: History | None = None,
    progress: Callable[[float], None] | None = None,
) -> History:
    """Compute an evolution by minimising movements: z_k = argmin ½⟨Az, z⟩ − ⟨ℓ_k, z⟩ + Ψ(t_k/ε, z −
    z_{k−1}).

    Parameters
    ----------
    problem : Evolution
    times : (float, float) or array, optional
        Start and end, or the times of all steps; starts at the time of `initial`. By default the
        span of the problem.
    steps : int, optional
        Number of equal steps between start and end. By default steps are adaptive: at least 8 per
        period and 64 in total, halved as the energy balance requires.
    output : int or array, optional
        Times at which z is stored (steps end there, too), or the number of steps between stored
        values. By default every step is stored up to a memory limit (160 MB), then every second
        step, and so on.
    observables : mapping of str to callable, optional
        Functions (t, z) → number or array that are recorded at every step.
    tolerance : float
        Tolerance of the energy balance (E), relative to the energy transferred. It controls
        adaptive steps and is the limit of the certificate; between steps, the distance of forces
        from K is at most this fraction of the largest weight.
    kkt : float
        Largest KKT residual of a step, relative to the largest weight.
    solver : {"dense", "multigrid"}, optional
        By default chosen by the problem.
    start : History, optional
        A returned or stored result to be continued with times after its end.
    progress : callable, optional
        Called repeatedly with the completed fraction. By default a progress bar is shown on a
        terminal.

    Returns
    -------
    History
        Returned in any case; its ``outcome`` describes how the computation ended.

    Raises
    ------
    DeclarationError
        If an argument is wrong, or `start` does not belong to the problem.

    Notes
    -----
    Where all moving components keep moving, weighted ℓ1 steps are exact at their ends, independent
    of their length. Otherwise the error is of the first order in the step; adaptive steps make it
    proportional to `tolerance` (to its square root for potentials whose K is curved).
    """
    began = time.perf_counter()
    check_tolerances(tolerance=tolerance, kkt=kkt)
    nodes, adaptive = step_times(problem, problem.span if times is None else times, steps)
    wanted = output_times(output, nodes)
    nodes = merged(nodes, wanted)
    state, record = _begin(
        problem, start, OutputPlan(output if wanted is None else wanted, dict(observables or {}))
    )
    nodes = nodes[nodes > state.t]
    march = March(
        problem, nodes, choose_solver(problem, solver, kkt / 2.0), state, kkt, tolerance, adaptive
    )
    earlier = 0.0 if start is None else start.wall_time
    try:
        with reporting(progress, "evolving", patience=0.0) as show:
            for block in march:
                record.add(block)
                show((march.state.t - problem.span[0]) / march.length)
    except KeyboardInterrupt:
        pass  # the outcome of a march that has not ended is "interrupted"
    left_out = problem.ell.left_out(problem.span[0], float(nodes[-1]) if len(nodes) else state.t)
    data = record.dataset(problem).assign_attrs(
        least_energy=march.least, **({"left_out": "; ".join(left_out)} if left_out else {})
    )
    return History(
        data, march.outcome, march.detail, tolerance, kkt, earlier + time.perf_counter() - began
    )


def nearest_stable(problem: Evolution) -> Array:
    """The stable state nearest to the initial one in the energy norm, shape (n,): one step at the
    start of the span."""
    times = np.array([problem.span[0]])
    solver = choose_solver(problem, None, STABLE_WITHIN / 2.0)
    states, _ = solver.advance(problem.initial, problem.ell.over(times), problem.sets(times))
    return states[0]


def step_times(problem: Evolution, times: Any, steps: int | None) -> tuple[Array, bool]:
    """Times of the steps, the start included, and whether they may be halved."""
    try:
        times = np.array(times, dtype=float)
    except (TypeError, ValueError, OverflowError):
        times = np.empty(0)
    if (
        times.ndim != 1
        or len(times) < 2
        or not np.all(np.isfinite(times))
        or not np.all(np.diff(times) > 0.0)
    ):
        raise DeclarationError(
            "times", "the times do not increase", "Give (start, end), or all times of the steps"
        )
    if times[0] != problem.span[0]:
        raise DeclarationError(
            "times",
            f"they start at {times[0]:g}, but the initial state is given at {problem.span[0]:g}",
            "Start at this time",
        )
    if times[-1] > problem.ell.span[1]:
        raise DeclarationError(
            "times",
            f"the load is defined up to {problem.ell.span[1]:g} only",
            "End at or before this time",
        )
    if steps is not None:
        if len(times) > 2 or not isinstance(steps, int | np.integer) or steps < 1:
            raise DeclarationError(
                "steps", f"{steps!r} steps", "Give (start, end) and a positive number of steps"
            )
        return np.linspace(times[0], times[1], steps + 1), False
    if len(times) > 2:
        return times, False
    knots = problem.ell.knots
    stops = np.concatenate([times[:1], knots[(knots > times[0]) & (knots < times[1])], times[1:]])
    longest = (times[1] - times[0]) / _PER_SPAN
    if problem.dissipation.depends_on_phase:
        longest = min(longest, problem.epsilon / _PER_PERIOD)
    return _filled(stops, longest), True


def _filled(stops: Array, longest: float) -> Array:
    """Times including all stops, evenly spaced in between, with a maximum step."""
    counts = np.ceil(np.diff(stops) / longest * (1.0 - WHOLE_COUNT)).astype(int)
    parts = [
        np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(stops[:-1], stops[1:], counts, strict=True)
    ]
    return np.concatenate([*parts, stops[-1:]])


def output_times(output: Any, nodes: Array) -> Array | None:
    """Requested output times; None for a stride or the default."""
    if output is None or np.ndim(output) == 0:
        if output is not None and not (
            isinstance(output, int | np.integer) and 1 <= output < 2**62
        ):
            raise DeclarationError(
                "output",
                f"{output!r} is not a stride",
                "Give times, or a positive integer to keep every n-th step",
            )
        return None
    wanted = np.array(output, dtype=float)
    if (
        wanted.ndim != 1
        or not np.all((wanted >= nodes[0]) & (wanted <= nodes[-1]))
        or np.any(np.diff(wanted) <= 0.0)
    ):
        raise DeclarationError(
            "output",
            "not increasing times within the span",
            f"Give times from {nodes[0]:g} to {nodes[-1]:g}",
        )
    # A time that is a node up to rounding is that node.
    near = nodes[np.clip(np.searchsorted(nodes, wanted), 0, len(nodes) - 1)]
    left = nodes[np.clip(np.searchsorted(nodes, wanted) - 1, 0, len(nodes) - 1)]
    near = np.where(np.abs(left - wanted) < np.abs(near - wanted), left, near)
    return np.where(np.abs(near - wanted) <= WHOLE_COUNT * (nodes[-1] - nodes[0]), near, wanted)


def merged(nodes: Array, wanted: Array | None) -> Array:
    """Nodes with the output times among them."""
    return nodes if wanted is None else np.union1d(nodes, wanted)


def _begin(
    problem: Evolution, start: History | None, record: OutputPlan
) -> tuple[EvolutionState, OutputPlan]:
    """The state from which to continue, and the record of earlier steps."""
    if start is None:
        state = start_state(problem, problem.span[0], problem.initial)
        zeros = {name: np.zeros(1) for name in STEP_COLUMNS} | {
            "energy": np.array([problem.energy(state.t, state.z)])
        }
        record.add(StepBlock(np.array([state.t]), state.z[None], zeros))
        return state, record
    old = start.dataset
    if old.sizes["component"] != problem.n or old.attrs["epsilon"] != problem.epsilon:
        raise DeclarationError(
            "start",
            f"a result of {old.sizes['component']} components "
            f"with epsilon = {old.attrs['epsilon']:g}",
            "Continue a result of this problem",
        )
    energy = old["energy"].values
    flow = EnergyFlow(
        float(old["dissipated"][-1]),
        float(old["work"][-1]),
        float(energy.min()),
        float(energy.max()),
    )
    t = float(old["step_time"][-1])
    z = old["final_state"].values
    if not math.isclose(
        problem.energy(t, z),
        energy[-1],
        rel_tol=SAME_VALUE,
        abs_tol=SAME_VALUE * float(np.abs(energy).max()),
    ):
        raise DeclarationError(
            "start",
            "its energy does not match that of this problem",
            "Continue a result of this problem",
        )
    record.restore(old)
    return start_state(problem, t, z, flow), record


class OutputPlan:
    """Stored values of a running evolution.

    Parameters
    ----------
    output : array, int or None
        Times, or a stride; by default as many values as the memory limit allows.
    """

    def __init__(self, output: Any, observables: dict[str, Observable]) -> None:
        self.output: Any = output
        self.observables: dict[str, Observable] = observables
        for name in observables:
            if name in {
                *STEP_COLUMNS,
                "z",
                "time",
                "step",
                "step_time",
                "component",
                "final_state",
            }:
                raise DeclarationError(
                    f"observables.{name}", "the name is already used", "Choose another name"
                )
        self.stride = output if np.ndim(output) == 0 and output is not None else 1
        self.count: int = 0  # steps so far
        self.size: int = 0  # number of stored values of z
        self.kept: list[tuple[Array, Array]] = []
        self.blocks: list[tuple[Array, dict[str, Array], Array]] = []

    def add(self, block: StepBlock) -> None:
        """Store the requested values of new steps."""
        if np.ndim(self.output) == 1:
            chosen = np.isin(block.times, self.output)
        else:
            chosen = np.arange(self.count, self.count + len(block.times)) % self.stride == 0
        values = dict(block.columns)
        for name, observe in self.observables.items():
            rows = [
                np.asarray(observe(float(t), z))
                for t, z in zip(block.times, block.states, strict=True)
            ]
            values[name] = np.array(rows)
        self.kept.append((block.times[chosen], block.states[chosen]))
        # last: an interrupt before it loses a block
        self.blocks.append((block.times, values, block.states[-1].copy()))
        self.count += len(block.times)
        self.size += block.states[chosen].size
        while self.output is None and self.size > KEPT:
            times, states = self._kept()
            self.kept, self.stride = [(times[::2].copy(), states[::2].copy())], 2 * self.stride
            self.size = self.kept[0][1].size

    def _kept(self) -> tuple[Array, Array]:
        return np.concatenate([t for t, _ in self.kept]), np.concatenate([z for _, z in self.kept])

    def restore(self, old: xarray.Dataset) -> None:
        """Continue after an earlier result."""
        for name in self.observables:
            if name not in old:
                raise DeclarationError(
                    f"observables.{name}",
                    "the earlier result has no record of this name",
                    "Remove it",
                )
        times = old["step_time"].values
        columns = {name: old[name].values for name in (*STEP_COLUMNS, *self.observables)}
        self.kept = [(old["time"].values, old["z"].values)]
        self.blocks = [(times, columns, old["final_state"].values)]
        self.count = len(times)
        self.size = old["z"].size
        self.stride = int(old.attrs["stride"]) if self.output is None else self.stride

    def dataset(self, problem: Evolution) -> xarray.Dataset:
        """All stored values as a dataset."""
        import xarray as xr

        times = np.concatenate([t for t, _, _ in self.blocks])
        kept_times, states = self._kept()
        done = kept_times <= times[-1]
        data: dict[str, Any] = {
            "z": (("time", "component"), states[done], {"long_name": "state"}),
            "step_time": ("step", times, {"long_name": "time of the step"}),
            "final_state": (
                "component",
                self.blocks[-1][2],
                {"long_name": "state after the last step"},
            ),
        }
        for name in (*STEP_COLUMNS, *self.observables):
            column = np.concatenate([values[name] for _, values, _ in self.blocks])
            dims = ("step", *(f"{name}_{axis}" for axis in range(1, column.ndim)))
            data[name] = (dims, column, {"long_name": STEP_COLUMNS.get(name, name)})
        for name in ("slipping", "effort"):
            data[name] = (data[name][0], data[name][1].astype(np.int64), data[name][2])
        attributes = {
            "epsilon": problem.epsilon,
            "depends_on_phase": int(problem.dissipation.depends_on_phase),
            "bounded": int(problem.bounded),
            "doubt": problem.dissipation.doubt,
            "stride": self.stride,
        }
        return xr.Dataset(
            data, {"time": ("time", kept_times[done], {"long_name": "time"})}, attributes
        )
