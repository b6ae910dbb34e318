"""Many motions in one call: compiled loops on all cores."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.certificates import Certificate, Residual
from stickslip.errors import DeclarationError
from stickslip.model.declaration import check_initial
from stickslip.model.system import System
from stickslip.model.system_file import SYSTEM
from stickslip.motion.outcome import Outcome
from stickslip.motion.problem import MOTION_SLOTS, Problem, pose
from stickslip.motion.simulate import check_positive, check_span
from stickslip.motion.starts import put_on_contacts
from stickslip.motion.steps.arrays import CROSSED, FULL, NOW, SWITCHES, TAKEN, Lane
from stickslip.results import PLAIN, Completion, Result
from stickslip.stopping.scopes import Stopped, TimeUp, check_limit, check_stop, scope, watching

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BATCH_SLOTS = 12  # number of closed forms for each set of parameters of a batch
_BLOCK_BYTES = 32e6  # bytes of the closed forms of the motions that are computed together
_MOST_LANES = 2048
_PULSE = 0.25  # seconds after which a request to stop is noticed


@dataclass(frozen=True, eq=False, repr=False)
class Ensemble(Result):
    """Final states and outcomes of many motions of a system.

    Attributes
    ----------
    system : System
    parameters : dict of str to float
        Parameters that are the same for all motions.
    dataset : xarray.Dataset
        Dimension ``trajectory``.
    """

    KIND: ClassVar[str] = "ensemble"
    PARTS: ClassVar = {"system": SYSTEM, "parameters": PLAIN}

    system: System
    parameters: dict[str, float]
    dataset: xarray.Dataset

    def __repr__(self) -> str:
        return f"<Ensemble of {self.system.name}: {self.dataset.sizes['trajectory']} motions>"

    def __len__(self) -> int:
        return self.dataset.sizes["trajectory"]

    @property
    def along(self) -> str:
        """Dimension of the dataset."""
        return "trajectory"

    @property
    def counts(self) -> dict[Outcome, int]:
        """Numbers of motions by outcome."""
        codes, numbers = np.unique(self.dataset["outcome"].values, return_counts=True)
        return {Outcome.from_code(int(c)): int(n) for c, n in zip(codes, numbers, strict=True)}

    @property
    def outcome(self) -> Completion:
        """Whether all motions reached their end."""
        if Outcome.INTERRUPTED in self.counts:
            return Completion.INTERRUPTED
        if Outcome.TIME_UP in self.counts:
            return Completion.TIME_UP
        every = all(outcome.ok for outcome in self.counts)
        return Completion.FINISHED if every else Completion.STOPPED_EARLY

    @property
    def message(self) -> str:
        """Numbers of outcomes, with explanations of early ends."""
        found = self.counts.items()
        said = ", ".join(f"{number} {outcome.label}" for outcome, number in found)
        why = {f"{outcome.label}: {outcome.message}" for outcome, _ in found if not outcome.ok}
        return "; ".join([said, *sorted(why)])

    @property
    def certificate(self) -> Certificate:
        """Final states alone are not audited; use `simulate` for a certified motion."""
        unaudited = Residual("motions not audited", float(len(self)), 0.0)
        return Certificate((unaudited,), notes=tuple(self.warnings))

    def facts(self) -> dict[str, Any]:
        """Summary as plain data."""
        ended = {outcome.label: number for outcome, number in self.counts.items()}
        found = {**self.system.heading(), "motions": len(self), "ended": ended}
        return {**found, "warnings": self.warnings}

    def rows(self) -> list[tuple[str, str]]:
        """Summary as rows of text."""
        ended = [(f"  {outcome.label}", str(number)) for outcome, number in self.counts.items()]
        return [("motions", str(len(self))), *ended, *(("warning", w) for w in self.warnings)]

    @property
    def warnings(self) -> list[str]:
        """Driving records that are longer than the motions."""
        return list(map(str, json.loads(self.dataset.attrs.get("warnings", "[]"))))

    def overview(self, ax: Axes | None = None) -> Figure:
        """The final coordinates of all motions."""
        names = [f"final_{name}" for name in self.system.declaration.coordinates]
        return self.plot(*names, ax=ax)


@validated
def simulate_many(
    system: System,
    t_span: tuple[float, float] | None = None,
    *,
    initial: Mapping[str, ArrayLike] | None = None,
    parameters: Mapping[str, ArrayLike] | None = None,
    rtol: float = 1e-10,
    atol: float = 1e-12,
    max_events: int = 1_000_000,
    time_limit: float | None = None,
    workers: int | None = None,
) -> Ensemble:
    """Compute the final states of many motions of a system.

    Parameters
    ----------
    system : System
    t_span : (float, float), optional
        Start and end, the same for all.
    initial, parameters : mapping of str to float or 1-D array, optional
        Values that vary between motions, as arrays of the same length; numbers apply to all
        motions.
    rtol, atol, max_events
        As in :func:`simulate`.
    time_limit : float, optional
        Wall-clock limit in seconds, at which all motions end.
    workers : int, optional
        Number of threads; by default all cores. The result does not depend on it.

    Returns
    -------
    Ensemble
        Its dataset has the dimension ``trajectory``: the given values, the final state
        (``final_psi`` …), ``time``
        reached, ``outcome`` (codes with flag_meanings), ``switches`` of contacts, ``kinks``
        (and guards of jumps) crossed, ``steps``.

    Raises
    ------
    DeclarationError
        If an argument is wrong.
    """
    import xarray as xr

    if not isinstance(system, System):
        raise DeclarationError(
            "system",
            f"{system!r} is not a System",
            "Give a System, such as ss.catalogue.rocking_toy()",
        )
    check_limit(time_limit)
    check_positive(max_events=max_events, **({} if workers is None else {"workers": workers}))
    start, end = check_span(system.span if t_span is None else t_span)
    system.declaration.check_span(start, end)
    given_initial, given_parameters = columns(initial, "initial"), columns(parameters, "parameters")
    count = common_length({**given_initial, **given_parameters})
    table = parameter_table(system, given_parameters, count)
    states = initial_states(system, given_initial, count)
    problem = replace(pose_all(system, given_parameters, rtol, atol), origin=start)
    states = put_on_contacts(problem, start, table, states)
    with watching(time_limit) as own:
        now, codes, ended = follow_all(
            problem, table, states, (0.0, end - start), max_events, workers or os.cpu_count() or 1
        )
        if ended is not None and not own.ends(ended):
            raise ended
    data = {
        name: ("trajectory", np.broadcast_to(v, count).copy())
        for name, v in {**given_initial, **given_parameters}.items()
    }
    data |= {
        f"final_{name}": ("trajectory", now.y[:, i])
        for i, name in enumerate(system.declaration.state)
    }
    labels = {o.code: o.label.replace(" ", "_") for o in Outcome}
    flags = {
        "flag_values": np.array(list(labels), np.int8),
        "flag_meanings": " ".join(labels.values()),
    }
    data |= {
        "time": (
            "trajectory",
            now.clock[:, NOW] + problem.origin,
            {"units": system.time_unit or "1"},
        ),
        "outcome": ("trajectory", codes.astype(np.int8), flags),
        "switches": ("trajectory", now.counters[:, SWITCHES]),
        "kinks": ("trajectory", now.counters[:, CROSSED]),
        "steps": ("trajectory", now.counters[:, TAKEN]),
    }
    about = {"title": system.title or system.name, "source": system.source}
    about["warnings"] = json.dumps(system.left_out(start, end))
    dataset = xr.Dataset(data, attrs=about)
    fixed = {name: value for name, value in system.values.items() if name not in given_parameters}
    return Ensemble(system, fixed, dataset)


def follow_all(
    problem: Problem,
    table: Array,
    states: Array,
    span: tuple[float, float],
    max_events: int,
    workers: int,
) -> tuple[Lane, Array, BaseException | None]:
    """Simulate motions with the parameters in the rows of a table: their final states, outcome
    codes, and the ``KeyboardInterrupt`` or ``TimeUp`` that ended unfinished ones.

    The span is counted from the origin of the problem.

    Blocks of motions are independent of each other, so that neither threads nor memory matter to
    the result.

    Parameters
    ----------
    table : array, shape (motions, parameters)
    states : array, shape (motions, n)
        Where they start.
    max_events : int
        Of each motion.
    workers : int
        Number of threads.
    """
    shared = bool(np.all(table == table[0]))
    slots = MOTION_SLOTS if shared else BATCH_SLOTS
    # Motions with the same parameters share their closed forms: fewer blocks compute these less
    # often.
    lanes = (
        max(_MOST_LANES, -(-len(states) // workers)) if shared else lanes_of_block(problem, slots)
    )
    blocks = [slice(i, i + lanes) for i in range(0, len(states), lanes)]
    ended: BaseException | None = None
    around = scope()
    interrupt = np.zeros(1, np.int64)

    def follow(block: slice) -> tuple[Lane, Array]:
        with watching(interrupt=interrupt, around=around):
            return follow_block(problem, table[block], states[block], span, max_events, slots)

    with ThreadPoolExecutor(workers) as pool:
        futures = [pool.submit(follow, block) for block in blocks]
        try:
            while wait(futures, timeout=_PULSE).not_done:
                check_stop()
        except (KeyboardInterrupt, Stopped, TimeUp) as why:
            ended = why
            interrupt[0] = 1
        done = [future.result() for future in futures]
    now = type(done[0][0])(
        *(np.concatenate(parts) for parts in zip(*(lane for lane, _ in done), strict=True))
    )
    codes = np.concatenate([codes for _, codes in done])
    if np.any(codes >= FULL):
        ended = ended or TimeUp(around.owner)
        outcome = Outcome.TIME_UP if isinstance(ended, TimeUp) else Outcome.INTERRUPTED
        codes[codes >= FULL] = outcome.code
    return now, codes, ended


def lanes_of_block(problem: Problem, slots: int) -> int:
    """Motions worked on together: as many as memory lets, which does not matter to where they
    end."""
    size = sum(part.nbytes for part in problem.empty_forms(1, slots))
    return int(np.clip(_BLOCK_BYTES / size, 1, _MOST_LANES))


def follow_block(
    problem: Problem,
    table: Array,
    states: Array,
    span: tuple[float, float],
    max_events: int,
    slots: int,
) -> tuple[Lane, Array]:
    """Follow some motions to their end, or until a stop is requested.

    Parameters
    ----------
    table : array, shape (motions, parameters)
    states : array, shape (motions, n)
        Where they start.
    span : (float, float)
        Counted from the origin of the problem.
    max_events : int
        Of each motion.
    slots : int
        Room for closed forms, for each set of parameters.
    """
    from stickslip.motion.ensemble import Lanes

    sets, group = distinct(table)
    forms = problem.empty_forms(len(sets), slots)
    lanes = Lanes.start(problem, problem.constants_of(sets), group, states, span, forms)
    with suppress(Stopped, TimeUp):
        lanes.advance(span[1], max_events)
    return lanes.now, lanes.codes


def columns(given: Mapping[str, ArrayLike] | None, where: str) -> dict[str, Array]:
    """Given values as 1-D float arrays."""
    result = {}
    for name, values in (given or {}).items():
        try:
            column = np.atleast_1d(np.asarray(values, dtype=float))
        except (TypeError, ValueError, OverflowError):
            raise DeclarationError(
                f"{where}.{name}", f"{values!r} is not numeric", "Give a number or a 1-D array"
            ) from None
        if column.ndim != 1 or len(column) == 0 or not np.all(np.isfinite(column)):
            raise DeclarationError(
                f"{where}.{name}",
                "not a 1-D array of finite numbers",
                "Give a number or a 1-D array",
            )
        result[name] = column
    return result


def common_length(given: Mapping[str, Array]) -> int:
    """Number of motions."""
    lengths = {len(v) for v in given.values()} - {1}
    if len(lengths) > 1:
        raise DeclarationError(
            "initial, parameters",
            f"the arrays have different lengths: {sorted(lengths)}",
            "Give arrays of the same length",
        )
    return lengths.pop() if lengths else 1


def parameter_table(system: System, given: Mapping[str, Array], count: int) -> Array:
    """All parameters of every motion, shape (motions, parameters), checked.

    Raises
    ------
    DeclarationError
        If a parameter is unknown or not admissible, or if masses or viscosities are.
    """
    declaration = system.declaration
    names = list(system.parameters)
    table = np.tile([system.values[name] for name in names], (count, 1)).reshape(count, len(names))
    for name, values in given.items():
        for extreme in (np.min(values), np.max(values)):
            declaration.check_range(name, float(extreme))
        table[:, names.index(name)] = values
    definite = [
        entry for pair, entry in declaration.mass.items() if {*pair} <= {*declaration.inertial}
    ]
    definite += [
        entry for pair, entry in declaration.damping.items() if {*pair} <= {*declaration.viscous}
    ]
    definite += [declaration.drags[z] for z in declaration.resisted]
    shaping = [
        i
        for i, name in enumerate(names)
        if name in given and any(name in e.symbols for e in definite)
    ]
    first = np.unique(table[:, shaping], axis=0, return_index=True)[1] if shaping else [0]
    for row in table[first]:
        declaration.check_parameters(dict(zip(names, map(float, row), strict=True)))
    return table


def initial_states(system: System, given: Mapping[str, Array], count: int) -> Array:
    """Initial state of every motion, shape (motions, n), checked."""
    declaration = system.declaration
    states = np.tile(
        [float(system.plain.initial.get(name, 0.0)) for name in declaration.state], (count, 1)
    )
    for name, values in system.started(given).items():
        check_initial(declaration, name, float(values[0]), system.started_unknowns)
        states[:, declaration.state.index(name)] = values
    return states


def pose_all(system: System, given: Iterable[str], rtol: float, atol: float) -> Problem:
    """The problem that motions share whose parameters of these names vary over all they may be."""
    problem = pose(system, None, rtol, atol)
    ranges = system.declaration.ranges
    boxes = {name: (value, value) for name, value in problem.parameters.items()}
    return replace(
        problem, boxes=boxes | {name: (ranges[name].low, ranges[name].high) for name in given}
    )


def distinct(table: Array) -> tuple[Array, Array]:
    """The different rows of a table, and which of them each row is."""
    if table.shape[1] == 0:
        return table[:1], np.zeros(len(table), np.int64)
    rows = np.ascontiguousarray(table)
    _, first, group = np.unique(
        rows.view(f"V{rows[0].nbytes}"), return_index=True, return_inverse=True
    )
    return rows[first], np.ascontiguousarray(group.reshape(-1).astype(np.int64))
