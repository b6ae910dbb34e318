"""First variation of a motion: transition matrices of its smooth pieces and saltation matrices of
its events.

Between events Φ' = J(t)Φ along the motion's own states. At an event with the guard g the motion
changes from the field f⁻ to f⁺, and neighbouring motions do so slightly earlier or later: S = I +
(f⁺ − f⁻)∇gᵀ/(g_t + ∇g·f⁻). If the state jumps, S is that of
:mod:`stickslip.orbits.fields.saltation`. A parameter is an additional constant component, so
derivatives with respect to it follow from the same formulas.

References
----------
R. I. Leine, H. Nijmeijer, *Dynamics and Bifurcations of Non-Smooth Mechanical Systems*, Springer
2004, chapter 7 (the saltation matrix); E. Hairer, S. P. Nørsett, G. Wanner, *Solving Ordinary
Differential Equations I*, II.7 (collocation).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.kept import cached_property
from stickslip.motion.record.discontinuities import Discontinuity, discontinuities_of
from stickslip.motion.steps.arrays import INERTIAL
from stickslip.numerics.levels import COMPUTED_ZERO
from stickslip.orbits.fields import slips
from stickslip.orbits.fields.engine.events import jump
from stickslip.orbits.fields.engine.resolution import resolve_steps
from stickslip.orbits.fields.engine.tables import (
    ALIKE,
    BEGINS,
    CORNER,
    CROWDED,
    ENDS,
    GRAZED,
    HALTED,
    MEETING,
    MET,
    PASSED,
    SPECTRUM_ASKED,
    STAGES,
    STRUCK,
    TOGETHER,
    Leave,
    Pass,
    PassSpace,
)
from stickslip.orbits.fields.engine.variations import vary
from stickslip.orbits.fields.mode_field import Piece, Pieces
from stickslip.orbits.fields.saltation import saltation
from stickslip.orbits.fields.spectra import decompose_piece
from stickslip.stopping.scopes import check_stop

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory


@dataclass(frozen=True)
class Variation:
    """Derivatives of the states of a motion with respect to its first state.

    Attributes
    ----------
    after : array, shape (knots, m, directions)
        Derivatives of (state, p) right after each knot with respect to the first one, in the
        requested directions; m is the number of states and free parameters. May be NaN between
        switches if these values were not needed.
    late : array, shape (knots, directions)
        Derivatives of the time of the event at each knot; NaN if there is none.
    piece : array of int, shape (knots,)
        Piece of the step that begins at each knot.
    corners, grazings : tuple of float
        Times of events at which the motion has no derivative: events that coincide here and not
        nearby, and guards that are touched without being crossed.
    reasons : mapping of float to str
        Reasons, for some of these times.
    """

    after: Array
    late: Array
    made: list[Piece]
    piece: Array
    corners: tuple[float, ...]
    grazings: tuple[float, ...]
    reasons: Mapping[float, str] = field(default_factory=dict[float, str])

    @cached_property
    def pieces(self) -> list[Piece]:
        """Piece of the step that begins at each knot."""
        return [self.made[w] for w in self.piece]

    @property
    def differentiable(self) -> bool:
        """Whether the derivatives exist."""
        return not self.corners and not self.grazings

    @property
    def matrix(self) -> Array:
        """Change of the last (state, p)."""
        return self.after[-1]


def variation(
    trajectory: Trajectory,
    pieces: Pieces,
    directions: Array | None = None,
    between: bool = True,
) -> Variation:
    """First variation along a motion.

    Parameters
    ----------
    pieces : Pieces
        Smooth pieces of its system; their free parameters p are differentiated for, too.
    directions : array, shape (m, directions), optional
        Perturbations of the first (state, p); by default each component separately. They must
        satisfy the constraints of the first mode: sticking contacts do not move, and contacts that
        slide without mass stay on their thresholds.
    between : bool
        Whether derivatives are needed at all knots; if False, they may be NaN except at the start
        of each piece, and at the end.
    """
    with pieces.lock:
        return _varied(trajectory, pieces, directions, between)


def _varied(
    trajectory: Trajectory, pieces: Pieces, directions: Array | None, between: bool
) -> Variation:
    run = _prepared(trajectory, pieces, directions, 1 if between else 2)
    listed = pieces.listed
    problem = trajectory.problem
    work = _work(trajectory, pieces, run, 2 * STAGES * len(run.piece))
    meeting = _Meeting(trajectory, pieces, run)
    start = 0
    while True:
        flow = problem.flow(retracing=True)
        code = vary(problem.machine, flow, listed, run, work, start)
        if code == PASSED:
            break
        if code == HALTED:
            check_stop()
        elif code == SPECTRUM_ASKED:
            w = int(run.event[BEGINS])
            nq = int(problem.rows.sizes[INERTIAL])
            place = np.arange(run.knots.state.shape[1])
            rates = (place >= nq) & (place < 2 * nq)
            held = _held(trajectory, pieces.made[w], run, w)
            decompose_piece(pieces.equations, listed.spectra, w, rates, held)
        elif code == CROWDED:
            work = _work(trajectory, pieces, run, int(run.event[BEGINS]))
        elif code == STRUCK:
            start = meeting.cross_discontinuity()
        else:
            start = meeting.pass_through(code == CORNER)
    grazed = run.knots.time[run.outcome == GRAZED] + run.origin
    grazings = tuple(sorted([*map(float, grazed), *meeting.grazings]))
    corners = tuple(meeting.corners)
    return Variation(
        run.after, run.late, pieces.made, run.piece, corners, grazings, meeting.reasons
    )


def _held(trajectory: Trajectory, piece: Piece, run: Pass, w: int) -> Array:
    """Linear forms of the state that are zero in a piece for all values of the free parameters."""
    i = int(np.flatnonzero(run.piece == w)[0])
    p = np.array([trajectory.parameters[name] for name in trajectory.system.parameters])
    t, y = float(run.knots.time[i]) + run.origin, run.knots.state[i]
    bounds = piece.bounds(t, y, p)
    n = len(y)
    rows = bounds.slopes[:, :n]
    loads = np.abs(bounds.value - rows @ y) > COMPUTED_ZERO * (np.abs(rows) @ np.abs(y))
    moved = np.any(bounds.slopes[:, n:] != 0.0, axis=1) | (bounds.time != 0.0)
    return rows[~(moved | loads)]


def resolution(trajectory: Trajectory, pieces: Pieces) -> Array:
    """Number of parts of each step in which linear motions are resolved by a Gauss rule."""
    rows = trajectory.problem.rows
    with pieces.lock:
        run = _prepared(trajectory, pieces, None, 0)
        resolve_steps(rows, pieces.listed, run, _work(trajectory, pieces, run, 0))
    return np.abs(run.parts[:-1])


def _prepared(trajectory: Trajectory, pieces: Pieces, directions: Array | None, modal: int) -> Pass:
    """The motion in the form of the compiled pass, with the perturbations of its first state."""
    k = trajectory.knots
    number = pieces.numbers(k.mode, k.region)
    columns = k.state.shape[1] + len(pieces.free)
    first = np.eye(columns) if directions is None else directions
    after = np.zeros((len(k.clock), *first.shape))
    after[0] = first
    return Pass(
        k.record,
        trajectory.dense_output.seen,
        float(k.origin),
        float(np.max(np.abs(trajectory.problem.constants.omega), initial=0.0)),
        modal,
        number,
        np.ones(len(number), np.int64),
        after,
        np.full((len(number), first.shape[1]), np.nan),
        np.zeros(len(number), np.int64),
        np.zeros(MET + 1 + pieces.listed.switches.shape[1], np.int64),
    )


def _work(trajectory: Trajectory, pieces: Pieces, run: Pass, nodes: int) -> PassSpace:
    """Work space of the pass, with room for some nodes."""
    _, columns, directions = run.after.shape
    work = pieces.space(trajectory.problem.rows, (columns, directions), nodes)
    p = np.array([trajectory.parameters[name] for name in trajectory.system.parameters])
    first = 1 + run.knots.state.shape[1]
    work.values[first : first + len(p)] = p[:, None]
    return work


# -- where guards meet -----------------------------------------------------------------------------


class _Meeting:
    """Saltation matrices of events that coincide, but not in neighbouring motions, which exist if
    the order of the events does not matter; and of impacts and jumps."""

    def __init__(self, trajectory: Trajectory, pieces: Pieces, run: Pass) -> None:
        self.trajectory = trajectory
        self.knots = trajectory.knots
        self.p = np.array([trajectory.parameters[name] for name in trajectory.system.parameters])
        self.pieces = pieces
        self.run = run
        self.corners: list[float] = []
        self.grazings: list[float] = []
        self.reasons: dict[float, str] = {}

    def pass_through(self, fired: bool) -> int:
        """Set the variation after the events at which the pass has stopped; returns the knot from
        which it resumes.

        Parameters
        ----------
        fired : bool
            Whether guards have fired; if none has although a mode has changed, there is no
            derivative.
        """
        event = self.run.event
        i, last = int(event[BEGINS]), int(event[ENDS])
        switches = [int(s) for s in event[MET : MET + event[MEETING]]] if fired else []
        made, piece = self.pieces.made, self.run.piece
        left, right = made[piece[i - 1]], made[piece[last]]
        resting = self._resting(left, i)
        still = resting & self._resting(right, i)
        if _changed(left, right) <= still:
            # Forces are shared in another way: they are not unique, and the motion has no event.
            self.run.after[i : last + 1] = self.run.after[i]
            self.run.late[i] = np.nan
            return last
        # Nor does it matter how those are shared that rest on, and of what others carry, which has
        # no guard but a velocity, that is rounded to either side of zero.
        undecided = {s for s in resting if s in still or left.setting(s) != 0}
        switches = [s for s in switches if s not in undecided]
        self.run.after[i : last + 1] = self._corner(i, last, switches) @ self.run.after[i]
        return last

    def cross_discontinuity(self) -> int:
        """Set the variation after the jump of the state at which the pass has stopped; returns the
        knot from which it resumes."""
        if int(self.run.event[BEGINS]) not in self._discontinuities:
            return self.slip(int(self.run.event[BEGINS]))
        event, here = self._discontinuities[int(self.run.event[BEGINS])]
        i, last = event.knot, event.last
        sides = self.pieces.made[self.run.piece[i - 1]], self.pieces.made[self.run.piece[last]]
        equations = self.pieces.equations
        found = saltation(equations, self.trajectory, event, here, sides, self.p, self.pieces)
        S = found.matrix
        if not found.exists:
            self.grazings.append(event.time)
            self.reasons[event.time] = found.why
        self.run.late[i] = found.late @ self.run.after[i]
        self.run.after[i : last + 1] = S @ self.run.after[i]
        return last

    def slip(self, i: int) -> int:
        """Set the variation after a knot at which a planar slip begins or ends."""
        sides = self.pieces.made[self.run.piece[i - 1]], self.pieces.made[self.run.piece[i]]
        found = slips.through(self.pieces.equations, self.trajectory, i, sides, self.p)
        if not found.exists:
            self.grazings.append(float(self.knots.time[i]))
        self.run.late[i] = found.late @ self.run.after[i]
        self.run.after[i] = found.matrix @ self.run.after[i]
        return i

    @cached_property
    def _discontinuities(self) -> dict[int, tuple[Discontinuity, Leave]]:
        """The jumps of the state by their knots, and the guards right before each."""
        jumps = list(discontinuities_of(self.trajectory).values())
        before = self.run.piece[[s.knot - 1 for s in jumps]]
        found: dict[int, tuple[Discontinuity, Leave]] = {}
        for w in np.unique(before):
            own = [s for s, piece in zip(jumps, before, strict=True) if piece == w]
            t, y = np.array([s.time for s in own]), np.array([s.before for s in own])
            leaves = self.pieces.made[w].leaves(t, np.ascontiguousarray(y.T), self.p)
            found |= {s.knot: (s, here) for s, here in zip(own, leaves, strict=True)}
        return found

    def _resting(self, piece: Piece, i: int) -> set[int]:
        """The switches of contacts that rest in a piece, at a knot."""
        t, y = float(self.knots.time[i]), self.knots.state[i]
        kinks = len(piece.field.region)
        contacts = range(len(piece.field.mode))
        return {kinks + c for c in contacts if piece.rests(c, t, y, self.p)}

    def _corner(self, i: int, last: int, switches: list[int]) -> Array:
        """Saltation matrix at a simultaneous zero of several guards."""
        arrived = self.run.after[i]
        routes = [self._route(i, last, order) for order in permutations(switches[:3])]
        images = [S @ arrived for S in routes if S is not None]
        size = max((float(np.max(np.abs(image))) for image in images), default=0.0)
        apart = any(np.max(np.abs(image - images[0])) > ALIKE * size for image in images)
        if apart or len(images) < len(routes) or not 0 < len(switches) <= 3:
            self.corners.append(float(self.knots.time[i]))
        return next((S for S in routes if S is not None), np.eye(len(arrived)))

    def _route(self, i: int, last: int, order: Sequence[int]) -> Array | None:
        """S through the switches in a given order; None if they cannot change in it."""
        t, y = float(self.knots.time[i]), self.knots.state[i]
        piece = self.pieces.made[self.run.piece[i - 1]]
        right = self.pieces.made[self.run.piece[last]]
        S = np.eye(len(piece.columns))
        together = TOGETHER * float(self.knots.time[-1] - self.knots.time[0])
        for switch in order:
            here = piece.leave(t, y, self.p)
            falling = [g for g in np.flatnonzero(piece.switches == switch) if here.fall[g] < 0.0]
            if not falling:
                return None
            g = int(min(falling, key=lambda g: abs(here.value[g])))
            if abs(here.value[g]) > together * abs(here.fall[g]):
                return None  # once the others have switched, this one may not have to
            try:
                piece = (
                    right
                    if switch == order[-1]
                    else self.pieces(*piece.switched(switch, right.setting(switch)))
                )
            except ZeroDivisionError:
                return None  # rates are not determined between the two
            if jump(here, g, piece.rates(t, y, self.p), here.terms[g], S) == GRAZED:
                self.grazings.append(t)
        return S


def _changed(left: Piece, right: Piece) -> set[int]:
    """The switches with other settings in another piece."""
    kinks = len(left.field.region)
    switches = range(kinks + len(left.field.mode))
    return {s for s in switches if left.setting(s) != right.setting(s)}
