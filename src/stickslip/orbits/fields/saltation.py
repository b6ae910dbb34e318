"""Saltation matrices: first variations of a motion through impacts and declared jumps.

The state jumps from y⁻ to y⁺ = Δ(t, y⁻) when a guard h vanishes. Neighbouring motions reach the
guard slightly earlier or later. With the rates f⁻ and f⁺ before and after the jump, a perturbation
is multiplied by

    S = DΔ + (f⁺ − DΔ f⁻ − ∂ₜΔ) ∇hᵀ/(∂ₜh + ∇h·f⁻).

The motion does not record which contacts take part in an impact, and which of them stick (the mode
of the impact). Among the maps of all modes (:func:`.impact_map`), the one is selected that leads to
the recorded state after the impact.

Sequential impacts occur at one instant; in neighbouring motions they follow each other after short
times, in the same order. S is then the product of the matrices of all impacts, each with the gap
that closes and with the rates in between. If several open gaps close simultaneously, or approaches
have equal energies, the order differs between neighbouring motions, and there is no derivative.

References
----------
R. I. Leine, H. Nijmeijer, *Dynamics and Bifurcations of Non-Smooth Mechanical Systems*, Springer
2004, chapter 7; M. di Bernardo et al., *Piecewise-smooth Dynamical Systems*, Springer 2008, 2.5.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, islice, product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.derive import MotionEquations
from stickslip.equations.field import Mode, in_region
from stickslip.equations.mode_fields import impact_map
from stickslip.kept import kept
from stickslip.motion.record.discontinuities import Discontinuity
from stickslip.numerics.levels import FEW_ROUNDINGS, TANGENT
from stickslip.orbits.fields.engine.tables import Leave
from stickslip.orbits.fields.instructions import PointFunction
from stickslip.orbits.fields.mode_field import Piece, Pieces, mass_at
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

TOUCHED = "a guard is touched tangentially"
_UNEXPLAINED = "the impulses do not depend smoothly on the state before the impact"
_AT_ONCE = "several contacts close at once, in a different order in neighbouring motions"
_CHANGES = "an impulse is exactly zero or at its threshold, which neighbouring motions do not share"
_TOO_MANY = "the sequence of impacts does not end"
_MOST_IN_SEQUENCE = 400  # largest number of sequential impacts
_NONE_LEFT = 1e-28  # energy of an approach, relative to the first one, that counts as zero
_EQUAL = 1e-8  # relative difference of energies of approach that counts as zero
_MOST_COMPARED = 128  # largest number of modes of an impact whose derivatives are compared
_CORNER = 1e-9  # relative error of a jump up to which two modes are both considered to explain it …
_APART = 1e-6  # … and relative difference of their derivatives above which they are different
_CLOSED = 1e-10  # gap, relative to the coordinates, below which a contact is closed
_SAME = 1e-7  # error of a jump, relative to the velocities, that is accepted …
_EXACT = 1e-11  # … and error that counts as zero
_MOST_MODES = 4096  # largest number of modes of an impact that are tried
_At = tuple[float, Array, Array]  # t, y, p
_Closing = tuple[int, frozenset[int]]  # a contact that closes, and those without restitution
_NONE = frozenset[int]()


class Landing(NamedTuple):
    """Value of a map of the state, and its derivatives with respect to time, and to state and free
    parameters, shape (n, columns)."""

    after: Array
    time: Array
    slopes: Array


class Saltation(NamedTuple):
    """First variation through a jump of the state.

    Attributes
    ----------
    matrix : array, shape (columns, columns)
    late : array, shape (columns,)
        Derivatives of the time of the jump.
    why : str
        Reason why there is no derivative; empty if it exists.
    """

    matrix: Array
    late: Array
    why: str = ""

    @property
    def exists(self) -> bool:
        """Whether the derivative exists."""
        return not self.why


def _missing(columns: int, why: str) -> Saltation:
    """The result if there is no derivative: the identity."""
    return Saltation(np.eye(columns), np.zeros(columns), why)


class StateMap:
    """A map of the state in the region of a piece, with first derivatives.

    Parameters
    ----------
    piece : Piece
        Before the jump.
    after : sequence of Expr
        The new state, as expressions of the one before.
    """

    def __init__(self, piece: Piece, after: Sequence[Expr]) -> None:
        columns = ("t", *piece.columns)
        every = [e for a in after for e in (a, *(ex.derivative(a, c) for c in columns))]
        self._values = PointFunction(piece.field, every)

    def __call__(self, t: float, y: Array, p: Array) -> Landing:
        """The map at a point."""
        table = self._values(t, y, p).reshape(len(y), -1)
        return Landing(table[:, 0], table[:, 1], table[:, 2:])


def saltation(
    equations: MotionEquations,
    motion: Trajectory,
    event: Discontinuity,
    here: Leave,
    sides: tuple[Piece, Piece],
    p: Array,
    pieces: Pieces,
) -> Saltation:
    """The saltation matrix of an impact or a jump.

    Parameters
    ----------
    here : Leave
        The guards right before the event.
    sides : (Piece, Piece)
        The pieces before and after the event.
    p : array, shape (parameters,)
    pieces : Pieces
        All pieces of the motion.
    """
    left, right = sides
    t, y = event.time, event.before
    k = motion.knots
    n, columns = len(y), len(left.columns)
    after = k.state[event.knot]
    switch = int(k.cause[event.knot])
    contact = switch - len(equations.kinks)
    g = int(np.flatnonzero(left.switches == switch)[0])
    if contact < 0:
        jump = int(np.flatnonzero(motion.switches.jumped[event.knot - 1])[0])
        found = _jump_map(equations, left, jump)(t, y, p)
    else:
        near = _near(equations, left, (t, y, p), contact)
        others = [c for c in near if c != contact and left.field.mode[c] != 0]
        if any(left.velocity(c, t, y, p)[0] < 0.0 for c in others):
            return _missing(columns, _AT_ONCE)
        in_sequence = motion.system.impacts == "in turn" and event.last == event.knot
        if in_sequence and len(near) > 1:
            return _sequential(equations, motion, event, sides, (near, contact), p, pieces)
        found = _impact(equations, sides, event, after, contact, p)
        if found is None:
            return _missing(columns, _UNEXPLAINED)
        if _is_corner(equations, left, (t, y, after), (contact, _NONE), found, p):
            return _missing(columns, _CHANGES)
    if not abs(here.fall[g]) > TANGENT * here.terms[g]:
        return _missing(columns, TOUCHED)
    S = np.eye(columns)
    D = found.slopes[:, :n]
    S[:n] = found.slopes
    # A group of impacts that are treated together has a duration.
    several = event.last > event.knot
    if several:
        after = found.after
    late = right.rates(t, after, p) - D @ here.rates - found.time
    earlier = here.slopes[g] / here.fall[g]
    S[:n] += np.outer(late, earlier)
    if several:
        duration = float(k.time[event.last] - k.time[event.knot])
        J = right.jacobian(np.array([t]), after[:, None], p)[0]
        S[:n] += duration * (J @ S)
    return Saltation(S, -earlier)


def _near(equations: MotionEquations, piece: Piece, at: _At, contact: int) -> list[int]:
    """The closed contacts at the time when one closes, including this one.

    Parameters
    ----------
    piece : Piece
        Before the impact.
    """
    found: list[int] = []
    for c, each in enumerate(equations.contacts):
        if not each.opens:
            continue
        closed = c == contact or piece.field.mode[c] == 0
        if not closed:
            gap = piece.gap(c, *at)
            n = len(piece.field.state)
            closed = abs(gap[0]) <= _CLOSED * float(np.abs(gap[2 : 2 + n]) @ (1.0 + np.abs(at[1])))
        if closed:
            found.append(c)
    return found


def _without_restitution(right: Piece, contact: int) -> frozenset[int]:
    """The contact that has closed if it stays closed after the impact; otherwise nothing."""
    return frozenset([contact]) if right.field.mode[contact] == 0 else _NONE


def _sequential(
    equations: MotionEquations,
    motion: Trajectory,
    event: Discontinuity,
    sides: tuple[Piece, Piece],
    closed: tuple[list[int], int],
    p: Array,
    pieces: Pieces,
) -> Saltation:
    """The saltation matrix of sequential impacts.

    Parameters
    ----------
    sides : (Piece, Piece)
        The pieces before and after the impacts.
    closed : list of int, and int
        Contacts that are closed, and the one that has just closed.
    p : array, shape (parameters,)
    """
    left, right = sides
    near, contact = closed
    t = event.time
    n, columns = len(event.before), len(left.columns)
    after = motion.knots.state[event.knot]
    size = float(np.max(np.abs(after - event.before), initial=0.0))
    for settled in dict.fromkeys([_NONE, _without_restitution(right, contact)]):
        S, late = np.eye(columns), np.zeros(columns)
        y, rates = event.before, left.rates(t, event.before, p)
        energies = _energies(equations, left, near, (t, y, p))
        first = max(energies.values())
        for number in range(_MOST_IN_SEQUENCE):
            c = max(near, key=lambda i: energies[i])
            equal = [i for i in near if energies[i] >= (1.0 - _EQUAL) * energies[c]]
            if len(equal) > 1 or (number == 0 and c != contact):
                return _missing(columns, _AT_ONCE)
            found = _one_impact(equations, left, (t, y, p), (c, settled))
            if found is None:
                break
            if _leaves_at_rest(left, [i for i in near if i != c], (t, y, p), found):
                return _missing(columns, _CHANGES)
            gap = left.gap(c, t, y, p)
            # A neighbour arrives later by −δg/ġ. In between it moves at the rates before the
            # impact instead of those after it.
            fall = gap[1] + float(gap[2 : 2 + n] @ rates)
            y = found.after
            energies = _energies(equations, left, near, (t, y, p))
            ends = max(energies.values()) <= _NONE_LEFT * first
            beyond = right if ends else _between(equations, left, near, (t, y, p), pieces)
            onward = beyond.rates(t, y, p)
            jump = np.eye(columns)
            D = found.slopes[:, :n]
            jump[:n] = found.slopes
            jump[:n] += np.outer(onward - D @ rates - found.time, gap[2:] / fall)
            if number == 0:
                late = -gap[2:] / fall
            S, rates = jump @ S, onward
            if ends:
                accepted = _SAME * size + FEW_ROUNDINGS * float(np.max(np.abs(y)))
                if float(np.max(np.abs(y - after))) <= accepted:
                    return Saltation(S, late)
                break
        else:
            return _missing(columns, _TOO_MANY)
    return _missing(columns, _UNEXPLAINED)


def _leaves_at_rest(piece: Piece, others: list[int], at: _At, landing: Landing) -> bool:
    """Return whether an impact leaves another contact, which it moves, with velocity exactly zero:
    this contact then closes in some neighbouring motions, but not in others.

    Parameters
    ----------
    piece : Piece
        Before the impacts.
    others : list of int
        Closed contacts.
    at : _At
        Before this impact.
    """
    n, columns = len(landing.after), len(piece.columns)
    full = np.eye(columns)
    full[:n] = landing.slopes
    bounds = piece.bounds(*at).slopes
    jump = float(np.max(np.abs(landing.after - at[1])))
    for c in others:
        before = piece.velocity(c, *at)
        after = piece.velocity(c, at[0], landing.after, at[2])
        size = float(np.max(np.abs(before[2:])))
        if abs(after[0]) > _CORNER * size * jump:
            continue
        change = after[2:] @ full - before[2:]
        if len(bounds):
            # Admissible neighbours do not differ in a combination of the constraints.
            change = change - bounds.T @ np.linalg.lstsq(bounds.T, change, rcond=None)[0]
        if float(np.max(np.abs(change))) > _APART * size:
            return True
    return False


def _energies(
    equations: MotionEquations, piece: Piece, near: list[int], at: _At
) -> dict[int, float]:
    """Twice the kinetic energy of the approach of each contact in `near`."""
    moving = [piece.field.state.index(f"d_{q}") for q in equations.declaration.inertial]
    M = mass_at(equations, piece, at)
    found: dict[int, float] = {}
    for c in near:
        u = piece.velocity(c, *at)
        J = u[2:][moving]
        # The square of the approach times the effective mass of the contact, 1/(J M⁻¹ Jᵀ).
        approach = min(float(u[0]), 0.0)
        found[c] = approach**2 / float(J @ np.linalg.solve(M, J))
    return found


def _one_impact(
    equations: MotionEquations, piece: Piece, at: _At, closing: _Closing
) -> Landing | None:
    """The map of the impact of a single contact: its friction continues to slip, if possible, or
    sticks.

    Parameters
    ----------
    piece : Piece
        Before the impacts.
    """
    contact, settled = closing
    rubs = [i for i in range(len(equations.contacts)) if contact in equations.pressing(i)]
    stuck: Landing | None = None
    modes = (mode for mode in _modes(equations, {contact}) if mode[contact] == 0)
    for mode, found in _landings(equations, piece, modes, settled, at):
        slides = [i for i in rubs if mode[i] != 0]
        if not np.all(np.isfinite(found.after)):
            continue
        if not slides:
            stuck = found
            continue
        if len(slides) < len(rubs):
            continue
        before, after = (
            np.array([piece.velocity(i, at[0], y, at[2])[0] for i in slides])
            for y in (at[1], found.after)
        )
        planar = all(equations.contacts[i].plane for i in slides)
        sense = before if planar else np.array([mode[i] for i in slides])
        if abs(mode[slides[0]]) == 1 and float(sense @ after) > 0.0:
            return found
    return stuck


def _between(
    equations: MotionEquations, left: Piece, near: list[int], at: _At, pieces: Pieces
) -> Piece:
    """The piece between two sequential impacts: contacts that neither approach nor recede stay
    closed.

    Parameters
    ----------
    left : Piece
        Before the impacts.
    near : list of int
        Contacts that are closed.
    """
    mode = np.array(left.field.mode, np.int8)
    speed = {c: abs(float(left.velocity(c, *at)[0])) for c in near}
    slow = TANGENT * max(speed.values())
    for c in near:
        mode[c] = 0 if left.field.mode[c] == 0 and speed[c] <= slow else 1
    for i in range(len(mode)):
        if equations.is_loose(i, mode.tolist()):
            mode[i] = 1
    return pieces(mode, np.array(left.field.region, np.int8))


def _jump_map(equations: MotionEquations, piece: Piece, jump: int) -> StateMap:
    """The map of a declared jump, in the region that its guard enters; cached."""
    made: dict[int, StateMap] = kept(piece, "jumps")
    if jump not in made:
        declared = equations.jumps[jump]
        region = list(piece.field.region)
        region[declared.kink] = 1 - region[declared.kink]
        regions = dict(zip(equations.kinks, region, strict=True))
        after = [in_region(declared.values.get(x, ex.sym(x)), regions) for x in piece.field.state]
        made[jump] = StateMap(piece, after)
    return made[jump]


def _impact(
    equations: MotionEquations,
    pieces: tuple[Piece, Piece],
    event: Discontinuity,
    after: Array,
    contact: int,
    p: Array,
) -> Landing | None:
    """The map of an impact, at the state before it; None if no impulse leads to the state after it.

    Parameters
    ----------
    pieces : (Piece, Piece)
        Before and after the impact.
    after : array, shape (n,)
        State after the impact.
    contact : int
        The contact that has closed.
    p : array, shape (parameters,)
    """
    left, right = pieces
    t, y = event.time, event.before
    settled = _without_restitution(right, contact)
    # In a group of impacts, the recorded state is that after the first one, with restitution.
    recorded = settled if event.last == event.knot else _NONE
    mode, landing = _mode_of(equations, left, (t, y, after), (contact, recorded), p)
    if mode is None or recorded == settled:
        return landing
    return _impact_map(equations, left, mode, settled)(t, y, p)


def _mode_of(
    equations: MotionEquations,
    left: Piece,
    jump: tuple[float, Array, Array],
    closing: _Closing,
    p: Array,
) -> tuple[Mode | None, Landing | None]:
    """The mode of an impact that explains a jump, and its map; None if there is none.

    Parameters
    ----------
    left : Piece
        Before the impact.
    jump : float and two arrays, shape (n,)
        Time, and the states before and after the impact.
    p : array, shape (parameters,)
    """
    t, y, after = jump
    contact, settled = closing
    size = float(np.max(np.abs(after - y), initial=0.0))
    # Usually it is the mode of the previous impact, which is accepted if it agrees up to rounding.
    latest: dict[_Closing, Mode] = kept(left, "latest impacts")
    near = {*_closed(equations, left), contact}
    candidates = islice(_modes(equations, near), _MOST_MODES)
    if closing in latest:
        candidates = chain([latest[closing]], candidates)
    best: Mode | None = None
    landing: Landing | None = None
    least = _SAME * size + FEW_ROUNDINGS * float(np.max(np.abs(y)))
    for mode, found in _landings(equations, left, candidates, settled, (t, y, p)):
        error = float(np.max(np.abs(found.after - after)))
        if error < least:
            best, landing, least = mode, found, error
        if least <= _EXACT * size:
            break
    if best is not None:
        latest[closing] = best
    return best, landing


def _is_corner(
    equations: MotionEquations,
    left: Piece,
    jump: tuple[float, Array, Array],
    closing: _Closing,
    landing: Landing,
    p: Array,
) -> bool:
    """Return whether other modes of an impact lead to the same state with other derivatives: an
    impulse is exactly zero, or exactly at its threshold.

    Parameters
    ----------
    left : Piece
        Before the impact.
    jump : float and two arrays, shape (n,)
        Time, and the states before and after the impact.
    landing : Landing
        The map of one of the modes.
    p : array, shape (parameters,)
    """
    t, y, after = jump
    contact, settled = closing
    accepted = _CORNER * float(np.max(np.abs(after - y), initial=0.0))
    closed = _closed(equations, left)
    if not closed - {contact} or accepted < FEW_ROUNDINGS * float(np.max(np.abs(y))):
        return False
    scale = float(np.max(np.abs(landing.slopes)))
    bounds = left.bounds(t, y, p).slopes
    modes = islice(_modes(equations, {*closed, contact}), _MOST_COMPARED)
    for _, found in _landings(equations, left, modes, settled, (t, y, p)):
        if float(np.max(np.abs(found.after - after))) <= accepted:
            # Only derivatives in directions that keep closed contacts closed are compared.
            apart = found.slopes - landing.slopes
            if len(bounds):
                apart = apart - np.linalg.lstsq(bounds.T, apart.T, rcond=None)[0].T @ bounds
            if float(np.max(np.abs(apart))) > _APART * scale:
                return True
    return False


def _closed(equations: MotionEquations, piece: Piece) -> set[int]:
    """Contacts that can open and are closed in a piece."""
    return {i for i, c in enumerate(equations.contacts) if c.opens and piece.field.mode[i] == 0}


def _landings(
    equations: MotionEquations,
    piece: Piece,
    modes: Iterable[Mode],
    settled: frozenset[int],
    at: _At,
) -> Iterator[tuple[Mode, Landing]]:
    """The maps of an impact in some modes, except those without a unique impulse."""
    for mode in modes:
        try:
            yield mode, _impact_map(equations, piece, mode, settled)(*at)
        except ZeroDivisionError:
            continue


def _modes(equations: MotionEquations, near: set[int]) -> Iterator[Mode]:
    """The modes of an impact of the contacts in `near`, each of which may take part or not."""
    choices: list[tuple[int, ...]] = []
    for i, c in enumerate(equations.contacts):
        rubs = bool(set(equations.pressing(i)) & near)
        sliding = (1,) if c.plane else (1, -1)
        if not c.plane and (c.kinetic_plus, c.kinetic_minus) != (c.plus, c.minus):
            sliding += 2, -2
        choices.append((0, 1) if i in near else (0, *sliding) if rubs and not c.opens else (1,))
    for mode in product(*choices):
        # Components of a contact in a plane slip together. Friction without a normal impulse has no
        # effect: of its modes only one is listed.
        apart = any(len({mode[i] for i in own}) > 1 for own in equations.directions.values())
        if not apart and all(
            mode[i] == 1
            for i in range(len(mode))
            if equations.pressing(i) and all(mode[n] != 0 for n in equations.pressing(i))
        ):
            yield mode


def _impact_map(
    equations: MotionEquations, piece: Piece, mode: Mode, settled: frozenset[int]
) -> StateMap:
    """The map of an impact in a mode; cached."""
    made: dict[tuple[Mode, frozenset[int]], StateMap] = kept(piece, "impacts")
    if (mode, settled) not in made:
        after = impact_map(equations, mode, piece.field.region, settled)
        made[mode, settled] = StateMap(piece, after)
    return made[mode, settled]
