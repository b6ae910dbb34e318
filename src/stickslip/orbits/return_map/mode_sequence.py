"""The distance of a cycle from a change of its mode sequence: nearly touched guards, and nearly
vanishing phases.

Along a branch, a guard may decrease to zero inside a phase, the duration of a phase may decrease to
zero, or a contact may begin to stick at a reversal, or to slip back where it stops. The sequence
changes at the first zero of these distances.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.model.entries.keys import NORMAL
from stickslip.numerics.levels import EPSILON, FEW_ROUNDINGS, TINIEST
from stickslip.orbits.continuation.bracket import zero_between
from stickslip.orbits.continuation.branch import KNOT
from stickslip.orbits.fields.engine.collocation import NODES
from stickslip.orbits.fields.mode_field import Piece, Pieces
from stickslip.orbits.return_map.recurrence import SHORTEST, segments
from stickslip.symbolic.pieces import boundary, is_smooth_knot

if TYPE_CHECKING:
    from stickslip.equations.derive import MotionEquations
    from stickslip.motion.trajectory import Trajectory

ModeAndRegion = tuple[tuple[int, ...], tuple[int, ...]]
Sequence = tuple[ModeAndRegion, ...]

_IMPACT = 4  # mode of a contact in an impact, in a phase without duration
_JUMP = 2  # region of the guard of a jump, likewise
# relative increase of a guard on both sides of a minimum that is more than rounding
_ROUNDED = 1e-6
_ACCURATE = 0.1  # error of a minimum, in units of the rounding error of the guard
_FAR = 0.1  # relative minimum of a guard above which it is far from zero
LOSS = "loss of the cycle"


def sequence(motion: Trajectory) -> Sequence:
    """Mode and region of the phases of a period, independent of its start; an impact, or a jump, is
    a phase without duration.

    A motion that does not end in its first phase is not a cycle; its first phase is then repeated
    at the end.
    """
    k = motion.knots
    found = [(a, _phase(k.mode[a], k.region[a]), -1) for a, _ in segments(motion)]
    for i in motion.state_jumps:
        switch = int(k.cause[i])
        contact = switch - k.region.shape[1]
        mode, region = k.mode[i - 1].copy(), k.region[i - 1].copy()
        if contact < 0:
            region[switch] = _JUMP
        else:
            mode[contact] = _IMPACT
        found.append((i - 0.5, _phase(mode, region), contact))
    found.sort(key=lambda entry: entry[0])
    phases = _without_bounces([entry[1:] for entry in found])
    return _canonical(phases) if phases[0] == phases[-1] else (*phases, phases[0])


def _phase(mode: Array, region: Array) -> ModeAndRegion:
    return tuple(map(int, mode)), tuple(map(int, region))


def _without_bounces(phases: list[tuple[ModeAndRegion, int]]) -> list[ModeAndRegion]:
    """Phases in which a terminating sequence of bounces of a contact counts as one, since the
    number of bounces depends on the resolution."""
    kept: list[tuple[ModeAndRegion, int]] = []
    for phase, contact in phases:
        closed = len(kept) > 2 and contact < 0 and kept[-1][1] >= 0 and phase[0][kept[-1][1]] == 0
        while closed and len(kept) > 4 and kept[-1] == kept[-3] and kept[-2] == kept[-4]:
            del kept[-2:]
        kept.append((phase, contact))
    return [phase for phase, _ in kept]


def is_open(s: Sequence) -> bool:
    """Return whether it is the sequence of a motion that is not a cycle."""
    return len(s) > 1 and s[0] == s[-1]


def _canonical(phases: list[ModeAndRegion]) -> Sequence:
    """The phases in cyclic order without repetitions, rotated to the lexicographically smallest
    sequence."""
    kept = [phase for i, phase in enumerate(phases) if phase != phases[i - 1]] or phases[:1]
    return min(tuple(kept[i:] + kept[:i]) for i in range(len(kept)))


def change_of(equations: MotionEquations, before: Sequence, after: Sequence) -> tuple[str, str]:
    """Name and description of a change of the sequence."""
    contacts = equations.labels
    if is_open(after):
        missed = _difference(equations, after[-2], after[0])
        return LOSS, f"the motion no longer returns to the phase in which it starts: {missed}"
    for i, name in enumerate(contacts):
        if not name.startswith(NORMAL):
            continue
        own = name.removeprefix(NORMAL)
        for mode, kind, said in (
            (_IMPACT, "grazing impact", ("has an impact", "has no impact any more")),
            (0, "loss of contact", ("begins to stay closed", "no longer stays closed")),
        ):
            was, comes = (any(modes[i] == mode for modes, _ in s) for s in (before, after))
            if was != comes:
                return kind, f"contact '{own}' {said[was]}"
    for i, name in enumerate(contacts):
        if not name or name.startswith(NORMAL):
            continue
        stuck, sticks = (any(mode[i] == 0 for mode, _ in s) for s in (before, after))
        if stuck != sticks:
            return "stick onset", f"contact '{name}' " + (
                "begins to stick" if sticks else "no longer sticks"
            )
        slipped, slips = (any(mode[i] != 0 for mode, _ in s) for s in (before, after))
        if slipped != slips:
            return "slip onset", f"contact '{name}' " + (
                "begins to slip" if slips else "sticks throughout"
            )
    few, many = sorted((before, after), key=len)
    touched = _excursions(many, few)
    if touched:
        kind = "grazing impact" if any(_IMPACT in mode for _, (mode, _) in touched) else "grazing"
        if all(_at_smooth_knots(equations, a, b) for a, b in touched):
            kind = KNOT
        return kind, ", ".join(dict.fromkeys(_difference(equations, a, b) for a, b in touched))
    more = len(after) > len(before)
    for kind, brief, said in (
        ("slip back", slips_back, ("sticks where it stops", "slips back before it sticks")),
        ("stick onset", sticks_once_more, ("sticks at one reversal less", "sticks at one more")),
    ):
        own = brief(before, after)
        if own:
            return kind, ", ".join(f"contact '{contacts[i]}' {said[more]}" for i in own)
    if _exchanged(before, after):
        return "sequence change", "two events exchange their order"
    return "sequence change", f"{_phases(before)} become {_phases(after)}"


def _exchanged(before: Sequence, after: Sequence) -> bool:
    """Return whether two sequences differ only in phases whose neighbours are the same: the events
    at both ends of each exchange their order."""
    n = len(before)
    if n != len(after) or n < 3:
        return False
    for i in range(n):
        turned = after[i:] + after[:i]
        differ = [a != b for a, b in zip(before, turned, strict=True)]
        if any(differ) and not any(d and differ[j - 1] for j, d in enumerate(differ)):
            return True
    return False


def slips_back(before: Sequence, after: Sequence) -> list[int]:
    """Contacts that on one side of a change slip back before they stick, and on the other stick
    where they stop."""
    return _brief(before, after, (1, -1, 0))


def sticks_once_more(before: Sequence, after: Sequence) -> list[int]:
    """Contacts that on one side of a change stick at a reversal at which they slip back on the
    other."""
    return _brief(before, after, (1, 0, -1))


def _brief(before: Sequence, after: Sequence, modes: tuple[int, int, int]) -> list[int]:
    """The contacts whose brief phases explain a change, each in the second of three modes, or of
    these with opposite signs."""
    few, many = sorted((before, after), key=len)
    opposite = tuple(-m for m in modes)

    def contact(a: ModeAndRegion, b: ModeAndRegion, c: ModeAndRegion) -> int | None:
        """The one contact whose mode differs between the phases, if it does as wanted."""
        every = zip(a[0], b[0], c[0], strict=True)
        own = [i for i, each in enumerate(every) if each in (modes, opposite)]
        if len(own) != 1 or a[1] != b[1] or b[1] != c[1]:
            return None
        others = [tuple(m for i, m in enumerate(s[0]) if i != own[0]) for s in (a, b, c)]
        return own[0] if others[0] == others[1] == others[2] else None

    found = _vanished(many, few, lambda a, b, c: contact(a, b, c) is not None)
    contacts = [contact(*phases) for phases in found]
    return list(dict.fromkeys(c for c in contacts if c is not None))


def _excursions(many: Sequence, few: Sequence) -> list[tuple[ModeAndRegion, ModeAndRegion]]:
    """Phases that interrupt others and whose removal turns a sequence into the other one, each
    after the phase that it interrupts."""
    found = _vanished(many, few, lambda before, _, after: before == after)
    return [(before, phase) for before, phase, _ in found]


_Phases = tuple[ModeAndRegion, ModeAndRegion, ModeAndRegion]


def _vanished(
    many: Sequence,
    few: Sequence,
    may: Callable[[ModeAndRegion, ModeAndRegion, ModeAndRegion], bool],
) -> list[_Phases]:
    """Phases whose removal turns a sequence into the other one, each between its neighbours.

    There may be several: a cycle with a symmetry touches a boundary more than once.

    Parameters
    ----------
    may : callable
        Whether a phase may vanish between two others.
    """
    found: dict[Sequence, list[_Phases]] = {many: []}
    waiting = [many]
    while waiting:
        s = waiting.pop()
        for i, phase in enumerate(s):
            around = s[i - 1], phase, s[(i + 1) % len(s)]
            if len(s) > len(few) and may(*around):
                rest = _canonical([*s[:i], *s[i + 1 :]])
                if rest not in found:
                    found[rest] = [*found[s], around]
                    waiting.append(rest)
    return found.get(few, [])


def _at_smooth_knots(equations: MotionEquations, a: ModeAndRegion, b: ModeAndRegion) -> bool:
    """Return whether two phases differ only by smooth knots."""
    passed = [g for g, m, n in zip(equations.kinks, a[1], b[1], strict=True) if m != n]
    return a[0] == b[0] and all(map(is_smooth_knot, passed))


def _phases(s: Sequence) -> str:
    return "1 phase" if len(s) == 1 else f"{len(s)} phases"


def _difference(equations: MotionEquations, a: ModeAndRegion, b: ModeAndRegion) -> str:
    """Difference of two phases."""
    from stickslip.equations.field import mode_name

    contacts = equations.labels

    def said(contact: str, m: int, n: int) -> str:
        if not contact:
            return "the force of a constraint changes sign"
        if contact.startswith(NORMAL):
            own = contact.removeprefix(NORMAL)
            words = "has an impact" if _IMPACT in (m, n) else "is about to open or to close"
            return f"contact '{own}' {words}"
        in_plane = contacts.count(contact) > 1
        between = " and ".join(mode_name(each, in_plane) for each in (max(m, n), min(m, n)))
        return f"contact '{contact}' touches the boundary between {between}"

    modes = [said(c, m, n) for c, m, n in zip(contacts, a[0], b[0], strict=True) if m != n]
    kinks = [
        f"{boundary(guard)} is touched"
        for guard, m, n in zip(equations.kinks, a[1], b[1], strict=True)
        if m != n
    ]
    return ", ".join(dict.fromkeys([*modes, *kinks]))


def nearest_change(motion: Trajectory, pieces: Pieces) -> float:
    """The smallest distance from a change of the sequence: durations of phases as fractions of the
    period, without instantaneous ones, and guards and forces relative to their size."""
    k = motion.knots
    found = segments(motion)
    p = np.array([motion.parameters[name] for name in motion.system.parameters])
    period = k.time[-1] - k.time[0]
    margins = [float(k.time[b] - k.time[a]) / period - SHORTEST for a, b in found[1:-1]]
    looked_at = at_nodes(motion)
    low = [
        dip
        for a, b in found
        for dip in dips(motion, pieces(k.mode[a], k.region[a]), a, b, p, looked_at)
    ]
    if low:
        margins.append(min(low, key=lambda dip: dip.value).refined()[1])
    for (_, a), (b, _) in itertools.pairwise(found):
        margins += reversals(motion, pieces, a, b, p)
        margins += stops(motion, pieces, a, b, p)
    return max(min(margins, default=1.0), TINIEST)


@dataclass(frozen=True)
class Dip:
    """A local minimum of a guard: its switch, three times around it, values there, and the guard
    and its rate over time."""

    switch: int
    times: Array
    values: Array
    scale: float
    guard: Callable[[float], float]
    rate: Callable[[float], float]

    @property
    def value(self) -> float:
        return float(self.values[1]) / self.scale

    def refined(self) -> tuple[float, float]:
        """Time of the minimum, and its value relative to the size of the guard: where its rate
        vanishes; only the parabola through the three points if it is far from zero."""
        t, g = self.times, self.values
        first, second = np.diff(g) / np.diff(t)
        bend = (second - first) / (t[2] - t[0])
        slope = first + bend * (t[1] - t[0])
        least = float(g[1]) - float(slope**2 / (4.0 * bend)) if bend > 0.0 else float(g[1])
        if least > _FAR * self.scale:
            return float(t[1]), least / self.scale
        ends = [self.rate(float(t[0])), self.rate(float(t[2]))]
        place = float(t[1])
        if ends[0] < 0.0 < ends[1]:
            curvature = (ends[1] - ends[0]) / float(t[2] - t[0])

            def rate(at: float) -> float:
                found = self.rate(at)
                # The error of the minimum is of the second order.
                left = 0.5 * found**2 / curvature
                return found if left > EPSILON * _ACCURATE * self.scale else 0.0

            place = zero_between(rate, float(t[0]), float(t[2]), *ends)
        value = self.guard(place) if math.isfinite(place) else math.nan
        # A guard whose rate jumps has its minimum at one of the points.
        if not value <= float(g[1]):
            place, value = float(t[1]), float(g[1])
        return place, max(value, 0.0) / self.scale


@dataclass(frozen=True)
class Looks:
    """Samples of a motion at the Gauss nodes of its steps: step, time and state of each."""

    index: Array
    times: Array
    states: Array


def at_nodes(motion: Trajectory, parts: Array | None = None) -> Looks:
    """Samples of a motion at the nodes of all steps of nonzero duration.

    Parameters
    ----------
    parts : array of int, shape (steps,), optional
        Equal parts of each step that have nodes of their own; by default one.
    """
    time = motion.knots.time
    length = np.diff(time)
    number = np.where(length > 0.0, 1 if parts is None else parts, 0)
    step = np.repeat(np.arange(len(length)), number)
    place = np.arange(len(step)) - np.repeat(np.cumsum(number) - number, number)
    h = length[step] / number[step]
    times = (time[step] + place * h)[:, None] + h[:, None] * NODES
    index = np.repeat(step, len(NODES))
    return Looks(index, times.ravel(), motion.states_at(times.ravel(), index))


def dips(motion: Trajectory, piece: Piece, a: int, b: int, p: Array, looks: Looks) -> list[Dip]:
    """Local minima of the guards inside a phase.

    Parameters
    ----------
    piece : Piece
        That of the phase.
    a, b : int
        Knots between which the phase lasts.
    p : array, shape (parameters,)
    looks : Looks
        The motion at its nodes.
    """
    k = motion.knots
    n = k.state.shape[1]
    inside = slice(*np.searchsorted(looks.index, (a, b)))
    times = looks.times[inside]
    guards = piece.felt(times, looks.states[inside].T, p)[n : n + len(piece.switches)]
    scales = np.abs(guards).max(axis=1, initial=0.0)
    here = guards[:, 1:-1]
    lowest = (here < guards[:, :-2]) & (here <= guards[:, 2:]) & (scales[:, None] > 0.0)
    # Steps may be so short that nodes are at the same time.
    lowest &= (np.diff(times)[:-1] > 0.0) & (np.diff(times)[1:] > 0.0)
    # A guard that vanishes at the start or end of the phase has minima there that are rounding
    # errors; so has a slip in a plane that passes through rest, as it does for neighbours, too.
    breaks: list[list[float]] = [[] for _ in scales]
    if piece.field.planes and b > a + 1:
        knots = slice(a + 1, b)
        rests = piece.felt(k.time[knots], k.state[knots].T, p)[n : n + len(scales)] == 0.0
        for row, i in zip(*rests.nonzero(), strict=True):
            breaks[row].append(float(k.time[a + 1 + i]))
    known = _ROUNDED * scales
    if np.any(lowest):
        # … and so have minima hardly larger than rounding errors, such as gaps between the last
        # bounces.
        middle = looks.states[inside][len(times) // 2]
        slopes = np.abs(piece.leave(float(times[len(times) // 2]), middle, p).slopes[:, :n])
        known = np.maximum(known, FEW_ROUNDINGS * slopes @ np.abs(middle))
    for row in np.flatnonzero(np.any(lowest, axis=1)):
        parts = np.split(guards[row], np.searchsorted(times, breaks[row]))
        lowest[row] &= np.concatenate([_rises(part, known[row]) for part in parts])[1:-1]
    carried = piece.carried(float(k.time[a]), k.state[a], p)
    lowest[[int(switch) in carried for switch in piece.switches]] = False
    kinks = len(piece.field.region)
    shared = [int(switch) - kinks in piece.field.shared for switch in piece.switches]
    # If the forces of minimum norm do not hold, others do.
    lowest[shared] &= here[shared] > 0.0

    def at(row: int, i: int) -> Dip:
        def state(t: float) -> Array:
            knot = min(int(np.searchsorted(k.time, t, side="right")) - 1, len(k.time) - 2)
            return motion.states_at(np.array([t]), np.array([knot]))[0]

        def guard(t: float) -> float:
            return float(piece.felt(t, state(t), p)[n + row])  # pyright: ignore[reportArgumentType]

        def rate(t: float) -> float:
            return float(piece.leave(t, state(t), p).fall[row])

        around = slice(i - 1, i + 2)
        switch, scale = int(piece.switches[row]), float(scales[row])
        return Dip(switch, times[around], guards[row, around], scale, guard, rate)

    return [at(int(row), int(i) + 1) for row, i in zip(*lowest.nonzero(), strict=True)]


def guard_between(
    motion: Trajectory, piece: Piece, a: int, b: int, switch: int, p: Array, looks: Looks
) -> Array:
    """Values of a guard at the nodes between two knots.

    Parameters
    ----------
    piece : Piece
        That of the phase.
    switch : int
        That of the guard; of several guards the first.
    p : array, shape (parameters,)
    looks : Looks
        The motion at its nodes.
    """
    inside = slice(*np.searchsorted(looks.index, (a, b)))
    row = motion.knots.state.shape[1] + int(np.flatnonzero(piece.switches == switch)[0])
    return piece.felt(looks.times[inside], looks.states[inside].T, p)[row]


def _rises(values: Array, known: float) -> Array:
    """Values of a guard that exceed rounding errors on both sides, without the first and last
    one."""
    highest = np.maximum.accumulate
    found = np.minimum(highest(values), highest(values[::-1])[::-1]) > known
    found[:1] = found[-1:] = False
    return found


def reversals(motion: Trajectory, pieces: Pieces, a: int, b: int, p: Array) -> list[float]:
    """Excess of the forces where contacts slip back without sticking, relative to their size.

    Parameters
    ----------
    a, b : int
        First knots of a phase, and of the next one.
    p : array, shape (parameters,)
    """
    k = motion.knots
    before = k.mode[a - 1] if a else k.mode[a]
    turned = (before * k.mode[b] == -1).nonzero()[0]
    return [abs(held) for held in _held(motion, pieces, turned, b, p)]


def stops(motion: Trajectory, pieces: Pieces, a: int, b: int, p: Array) -> list[float]:
    """Distance from their thresholds of the forces of contacts along lines that begin to stick.

    Parameters
    ----------
    a, b : int
        First knots of a phase, and of the next one.
    p : array, shape (parameters,)
    """
    k = motion.knots
    before = k.mode[a - 1] if a else k.mode[a]
    lines = [c.plane == 1 and not c.opens for c in motion.problem.compiled.equations.contacts]
    stuck = (np.abs(before) == 1) & (k.mode[b] == 0) & np.array(lines, dtype=bool)
    return [abs(held) for held in _held(motion, pieces, stuck.nonzero()[0], b, p)]


def _held(
    motion: Trajectory, pieces: Pieces, contacts: Array, knot: int, p: Array
) -> Iterator[float]:
    """Margins of contacts at a knot if they stick there."""
    k = motion.knots
    kinks = k.region.shape[1]
    for c in contacts:
        mode = k.mode[knot].copy()
        mode[c] = 0
        stuck = pieces(mode, k.region[knot])
        with suppress(ZeroDivisionError):
            yield holding(stuck, kinks + int(c), float(k.time[knot]), k.state[knot], p)


def holding(stuck: Piece, switch: int, t: float, y: Array, p: Array) -> float:
    """Margin of a sticking contact: the distance from the nearer threshold, relative to both.
    Negative if it slips.

    Parameters
    ----------
    stuck : Piece
        That of a mode in which it sticks.
    switch : int
        Number of the contact.
    y : array, shape (n,)
    p : array, shape (parameters,)
    """
    here = stuck.leave(t, y, p)
    forces = here.value[stuck.switches == switch]
    return float(np.min(forces)) / float(np.sum(np.abs(forces)))
