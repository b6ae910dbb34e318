"""Lines of points that carry the state: the points that can be computed next, and their starts."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.model.system import System
from stickslip.motion.outcome import Outcome
from stickslip.orbits.settling.motions import MEASURED
from stickslip.sweeps.request.axes import Grid
from stickslip.sweeps.request.carry import CARRIED, Carry
from stickslip.sweeps.work.carried_state import CarriedState, carried_state

if TYPE_CHECKING:
    from stickslip.sweeps.store import Chunk, MapStore

_SETTLED = {outcome.code for outcome in MEASURED}


@dataclass(frozen=True)
class Runs:
    """Order in which points that carry the state are computed.

    Attributes
    ----------
    order : array of int
        Of the points.
    begins : dict of int to (CarriedState or None)
        Places in that order at which a run of points starts, with the state from which it
        continues; None: it starts from the initial state.
    """

    order: Array
    begins: Mapping[int, CarriedState | None]


class LinesToDo:
    """Chunks with missing points, in the order of the lines; of mutually dependent chunks, one is
    issued at a time.

    Parameters
    ----------
    store : MapStore
        Of a map that is carried.
    """

    def __init__(self, store: MapStore, carry: Carry) -> None:
        self.store = store
        self.grid: Grid = store.grid
        self.path = carry.path(self.grid.axes)
        self._others = carry.others(self.grid.axes)
        self._waiting = deque(map(iter, self._columns()))
        self._out: dict[Chunk, Iterator[Chunk]] = {}

    def __iter__(self) -> Iterator[tuple[Chunk, Array, Runs] | None]:
        """Chunks, positions of their missing points, and the order of these; None while all
        remaining chunks wait for results of running ones."""
        while self._waiting or self._out:
            if not self._waiting:
                yield None
                continue
            column = self._waiting.popleft()
            for chunk in column:
                if len(inside := self.store.missing(chunk)):
                    self._out[chunk] = column
                    yield chunk, inside, self._runs(chunk, inside)
                    break

    def done(self, chunk: Chunk) -> None:
        """Mark a chunk as done, so that dependent chunks can start."""
        self._waiting.append(self._out.pop(chunk))

    def _columns(self) -> Iterator[list[Chunk]]:
        """Successive chunks of lines."""
        grid = self.grid
        counts = [range(-(-n // c)) for n, c in zip(grid.shape, grid.chunk, strict=True)]
        for fixed in product(*(counts[k] for k in self._others)):
            known = dict(zip(self._others, fixed, strict=True))
            places = (known | {k: i // grid.chunk[k] for k, i in at.items()} for at in self.path)
            yield list(dict.fromkeys(tuple(p[k] for k in range(len(counts))) for p in places))

    def _runs(self, chunk: Chunk, inside: Array) -> Runs:
        """Order of the missing points of a chunk, and the states from which they continue."""
        grid = self.grid
        region = grid.region(chunk)
        shape = tuple(part.stop - part.start for part in region)
        index = np.array(np.unravel_index(inside, shape)).T + [part.start for part in region]
        own = list(self.path[0])
        number = {tuple(at[k] for k in own): i for i, at in enumerate(self.path)}
        along = np.array([number[tuple(row)] for row in index[:, own].tolist()])
        line = np.zeros(len(index), int)
        for k in self._others:
            line = line * grid.shape[k] + index[:, k]
        order = np.lexsort((along, line))
        new = np.diff(line[order], prepend=-1) != 0
        new |= np.diff(along[order], prepend=-2) != 1
        begins = {
            int(j): self._before(index[order[j]], int(along[order[j]])) for j in np.flatnonzero(new)
        }
        return Runs(order, begins)

    def _before(self, index: Array, along: int) -> CarriedState | None:
        """The state from which a computed point continues."""
        if along == 0:
            return None
        at = {**dict(enumerate(map(int, index))), **self.path[along - 1]}
        place = tuple(at[k] for k in range(len(at)))
        chunk = tuple(i // c for i, c in zip(place, self.grid.chunk, strict=True))
        inside = tuple(i % c for i, c in zip(place, self.grid.chunk, strict=True))
        system = self.store.plan.system
        names = [f"{CARRIED}{name}" for name in ("time", *system.declaration.state)]
        time, *state = (float(self.store.read(name, chunk)[inside]) for name in names)
        if np.isnan(time):
            return None
        varied = {
            name: float(axis.values[row, i])
            for axis, i in zip(self.grid.axes, place, strict=True)
            for row, name in enumerate(axis.names)
            if name in system.parameters
        }
        return CarriedState({**system.values, **varied}, time, np.array(state))


def needed_to_carry(system: System) -> list[str]:
    """Measures that describe the final state of a point."""
    each = [f"{name}:{x}" for name in ("state", "shift") for x in system.declaration.state]
    return [*each, "time", "duration"]


def passed_on(
    system: System,
    parameters: Mapping[str, float],
    found: Mapping[str, Array],
    given: CarriedState | None,
) -> CarriedState | None:
    """The state that a point passes on: its settled state, or the state it started from if the
    motion has not settled.

    Parameters
    ----------
    parameters : mapping of str to float
        Parameters of the point.
    found : mapping of str to array, shape (1,)
        Contains the measures of :func:`needed_to_carry`.
    given : CarriedState or None
        State from which it started, at its own parameters; None if it started from the initial
        state.
    """
    names = system.declaration.state
    code = int(found["outcome"][0])
    if code not in _SETTLED:
        return given
    state, shift = (
        np.array([float(found[f"{name}:{x}"][0]) for x in names]) for name in ("state", "shift")
    )
    repeats = code in (Outcome.PERIODIC.code, Outcome.STEADY.code)
    rate = shift / float(found["duration"][0]) if repeats else None
    return carried_state(system, parameters, float(found["time"][0]), state, rate)


def stored_of(system: System, handed: list[CarriedState | None]) -> dict[str, Array]:
    """Carried states as variables of a map."""
    names = ("time", *system.declaration.state)
    table = np.full((len(handed), len(names)), np.nan)
    for row, one in zip(table, handed, strict=True):
        if one is not None:
            row[:] = [one.time, *one.state]
    return {f"{CARRIED}{name}": column for name, column in zip(names, table.T, strict=True)}
