"""How near a cycle is to another sequence of modes: what it nearly touches, and phases that nearly vanish.

Along a branch a guard comes down to zero somewhere inside a phase, or a phase becomes shorter and shorter, or a contact
that slips back and forth is about to stick in between. Where the least of these vanishes, the sequence changes.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stickslip.orbits.pieces import Piece, Pieces
from stickslip.orbits.recurrence import segments
from stickslip.orbits.variational import gauss

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

Array = np.ndarray
Setting = tuple[tuple[int, ...], tuple[int, ...]]
Sequence = tuple[Setting, ...]


def sequence(motion: Trajectory) -> Sequence:
    """Mode and region of the phases of a period, wherever it starts."""
    k = motion.knots
    return _canonical([(tuple(map(int, k.mode[a])), tuple(map(int, k.region[a]))) for a, _ in segments(k)])


def _canonical(phases: list[Setting]) -> Sequence:
    """The phases in their cyclic order without repetitions, from the one that makes the least sequence."""
    kept = [phase for i, phase in enumerate(phases) if phase != phases[i - 1]] or phases[:1]
    return min(tuple(kept[i:] + kept[:i]) for i in range(len(kept)))


def change_of(contacts: list[str], before: Sequence, after: Sequence) -> tuple[str, str]:
    """Name of a change of the sequence, and what happens in words."""
    for i, name in enumerate(contacts):
        stuck, sticks = (any(mode[i] == 0 for mode, _ in s) for s in (before, after))
        if stuck != sticks:
            return "stick onset", f"contact '{name}' " + ("begins to stick" if sticks else "no longer sticks")
    few, many = sorted((before, after), key=len)
    for i, phase in enumerate(many):
        others = [*many[:i], *many[i + 1 :]]
        if len(many) > len(few) and many[i - 1] == many[(i + 1) % len(many)] and _canonical(others) == few:
            return "grazing", _difference(contacts, many[i - 1], phase)
    return "sequence change", f"{_phases(before)} become {_phases(after)}"


def _phases(s: Sequence) -> str:
    return "1 phase" if len(s) == 1 else f"{len(s)} phases"


def _difference(contacts: list[str], a: Setting, b: Setting) -> str:
    """What is different in two phases."""
    from stickslip.equations.field import MODE_NAMES

    modes = [
        f"contact '{c}' touches {MODE_NAMES[n]} from {MODE_NAMES[m]}"
        for c, m, n in zip(contacts, a[0], b[0], strict=True)
        if m != n
    ]
    kinks = [f"kink {j + 1} is touched" for j, (m, n) in enumerate(zip(a[1], b[1], strict=True)) if m != n]
    return ", ".join([*modes, *kinks])


def nearest_change(motion: Trajectory, pieces: Pieces) -> float:
    """The least of: phases as parts of the period, guards and forces relative to their size."""
    k = motion.knots
    found = segments(k)
    p = np.array([motion.parameters[name] for name in motion.system.parameters])
    period = k.time[-1] - k.time[0]
    margins = [float(k.time[b] - k.time[a]) / period for a, b in found[1:-1]]
    dips = [dip for a, b in found for dip in _dips(motion, pieces(k.mode[a], k.region[a]), a, b, p)]
    if dips:
        margins.append(min(dips, key=lambda dip: dip.value).refined())
    for (_, a), (b, _) in itertools.pairwise(found):
        margins += _reversals(motion, pieces, a, b, p)
    return max(min(margins, default=1.0), 1e-300)


@dataclass(frozen=True)
class _Dip:
    """A local minimum of a guard: three times around it, values there, and the guard as a function of time."""

    times: Array
    values: Array
    scale: float
    guard: Callable[[float], float]

    @property
    def value(self) -> float:
        return float(self.values[1]) / self.scale

    def refined(self) -> float:
        """The minimum by parabolas through the last three points."""
        t, g = self.times, self.values
        for _ in range(5):
            (a, b, c), (fa, fb, fc) = t, g
            up, down = (b - a) * (fb - fc), (b - c) * (fb - fa)
            if up == down:
                break
            best = b - 0.5 * ((b - a) * up - (b - c) * down) / (up - down)
            if not a < best < c or best == b:
                break
            value = self.guard(best)
            t, g = np.append(t, best), np.append(g, value)
            order = np.argsort(t)
            t, g = t[order], g[order]
            i = int(np.clip(np.argmin(g), 1, len(g) - 2))
            t, g = t[i - 1 : i + 2], g[i - 1 : i + 2]
        return max(float(np.min(g)), 0.0) / self.scale


def _dips(motion: Trajectory, piece: Piece, a: int, b: int, p: Array) -> list[_Dip]:
    """Local minima of the guards inside a phase."""
    k, n = motion.knots, motion.knots.state.shape[1]
    steps = np.array([i for i in range(a, b) if k.time[i + 1] > k.time[i]])
    times = (k.time[steps][:, None] + np.diff(k.time)[steps][:, None] * gauss()[0]).ravel()
    index = np.repeat(steps, len(gauss()[0]))
    guards = piece.felt(times, motion._sample(times, index)[:, :n].T, p)[n : n + len(piece.switches)]
    found = []
    for row, g in enumerate(guards):
        scale = float(np.max(np.abs(g)))
        inner = np.flatnonzero((g[1:-1] < g[:-2]) & (g[1:-1] <= g[2:])) + 1
        for i in inner if scale > 0.0 else ():

            def guard(t: float, row: int = row) -> float:
                at = min(int(np.searchsorted(k.time, t, side="right")) - 1, len(k.time) - 2)
                y = motion._sample(np.array([t]), np.array([at]))[0, :n]
                return float(piece.felt(t, y, p)[n + row])  # pyright: ignore[reportArgumentType]

            found.append(_Dip(times[i - 1 : i + 2], g[i - 1 : i + 2], scale, guard))
    return found


def _reversals(motion: Trajectory, pieces: Pieces, a: int, b: int, p: Array) -> list[float]:
    """Excess of the forces where contacts slip back without sticking, relative to their size."""
    k, found = motion.knots, []
    before, kinks = k.mode[a - 1] if a else k.mode[a], k.region.shape[1]
    for c in np.flatnonzero(before * k.mode[b] == -1):
        mode = k.mode[b].copy()
        mode[c] = 0
        try:
            piece = pieces(mode, k.region[b])
        except ZeroDivisionError:
            continue
        here = piece.leave(float(k.time[b]), k.state[b], p)
        forces = here.value[piece.switches == kinks + c]
        found.append(abs(float(np.min(forces))) / float(np.sum(np.abs(forces))))
    return found
