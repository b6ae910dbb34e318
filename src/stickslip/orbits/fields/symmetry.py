"""Symmetries of a system: continuous and discrete shifts of the state, shifts of time, and moving
frames.

A translation e leaves every field and every guard unchanged: ∂f·e = 0. A system under a load ℓ = Vt
is unchanged by joint shifts of time and position: ∂ₜf + ∂f·e = 0, so it is autonomous in the frame
that moves with e. Both are directions in which all first derivatives vanish, so they are computed,
not declared. Discrete shifts follow from the formulas
(:mod:`stickslip.orbits.fields.lines_and_phases`): a period of the drives, with the shift of the
state, and the cells of a lattice. All are elements of one group; the return of a cycle is composed
with one of them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.kept import cached_property
from stickslip.numerics.levels import (
    LAST_DIGITS,
    NEARLY_WHOLE,
    NO_CHANGE,
    RANK,
    ROUNDED_SUM,
    TINIEST,
)
from stickslip.orbits.fields.clock import Drives
from stickslip.orbits.fields.mode_field import Piece

if TYPE_CHECKING:
    from stickslip.motion.record.knots import Knots

_SAMPLES = 12  # samples of every piece at which symmetries are searched for
_STANDS = 1e-10  # relative to 1 + the largest: a component of the frame that does not move


@dataclass(frozen=True)
class Symmetry:
    """Invariance of a system along a motion.

    Attributes
    ----------
    shifts : array, shape (states, translations)
        Directions in which the state may be shifted.
    frame : array, shape (states,), or None
        Velocity e of the frame in which the system is autonomous (0: it does not depend on time).
        None: the system is driven.
    turn : array, shape (states,)
        For driven systems, the shift of the state under which the system is invariant after one
        period of its drives.
    cells : array, shape (states, cells)
        Shifts of the state under which the system is invariant, as are their integer multiples.
    """

    shifts: Array
    frame: Array | None
    turn: Array
    cells: Array

    @property
    def driven(self) -> bool:
        """Whether the system is driven."""
        return self.frame is None

    def moved(self, period: float, turns: int, cells: Array) -> Array:
        """Known part of the shift in a period: that of the group element with which a return is
        composed, a number of periods of the drives (or a time in the frame) and cells."""
        along = turns * self.turn if self.frame is None else period * self.frame
        return along + self.cells @ cells

    def counted(self, shift: Array, sizes: Array) -> Array:
        """Number of cells in a shift, rounded."""
        every = np.hstack([self.cells, self.shifts]) / sizes[:, None]
        parts = np.linalg.lstsq(every, shift / sizes, rcond=None)[0]
        return np.rint(parts[: self.cells.shape[1]])

    def in_frame(self, differences: Array, sizes: Array) -> Array:
        """Differences of states without whole cells, shape (…, n)."""
        if not self.cells.shape[1]:
            return differences
        every = np.hstack([self.cells, self.shifts]) / sizes[:, None]
        parts = np.rint((differences / sizes) @ np.linalg.pinv(every).T)
        return differences - parts[..., : self.cells.shape[1]] @ self.cells.T


def alike(a: Symmetry, b: Symmetry) -> bool:
    """Return whether two symmetries are equal, up to rounding."""
    if a.driven != b.driven or a.shifts.shape != b.shifts.shape:
        return False
    together = np.hstack([np.linalg.qr(s.shifts)[0] for s in (a, b)])
    known = [(a.turn, b.turn), (a.frame, b.frame)]
    return bool(np.linalg.matrix_rank(together, RANK) <= a.shifts.shape[1]) and all(
        x is None
        or y is None
        or np.allclose(x, y, rtol=RANK, atol=RANK * np.max(np.abs(x), initial=0.0))
        for x, y in known
    )


@dataclass(frozen=True)
class Surroundings:
    """Points on a motion, at which the symmetries of the system are computed.

    Attributes
    ----------
    pieces : list of Piece
        Of each point.
    times, states : arrays, shapes (points,) and (points, n)
    sizes : array, shape (n,)
        Size of each component of the state.
    """

    pieces: list[Piece]
    times: Array
    states: Array
    sizes: Array
    _found: dict[bytes, Array] = field(default_factory=dict, init=False, repr=False, compare=False)
    _symmetries: dict[tuple[bytes, ...], Symmetry] = field(
        default_factory=dict[tuple[bytes, ...], Symmetry], init=False, repr=False, compare=False
    )

    def symmetry(self, p: Array, drives: Drives | None, cells: Array) -> Symmetry:
        """Symmetry for given parameters, from the drives (None: there are none) and cells in the
        formulas.

        Raises
        ------
        DeclarationError
            If the system is driven and not invariant after one period of its drives.
        """
        key = p.tobytes(), cells.tobytes(), *(np.asarray(d).tobytes() for d in drives or ())
        if key not in self._symmetries:
            self._symmetries[key] = self._symmetry(p, drives, cells)
        return self._symmetries[key]

    def _symmetry(self, p: Array, drives: Drives | None, cells: Array) -> Symmetry:
        shifts, frame = _split(self._unchanged(p))
        # Cells along continuous translations are redundant.
        N, C = shifts / self.sizes[:, None], cells / self.sizes[:, None]
        rest = C - N @ np.linalg.lstsq(N, C, rcond=None)[0]
        cells = cells[:, np.max(np.abs(rest), axis=0) > NO_CHANGE * np.max(np.abs(C), axis=0)]
        if frame is not None or drives is None:
            return Symmetry(shifts, frame, np.zeros(len(self.sizes)), cells)
        return Symmetry(shifts, None, self._turn(p, drives) / drives.parts, cells)

    def contain(self, knots: Knots) -> bool:
        """Whether they have points in all modes of a motion."""
        pieces = dict.fromkeys(self.pieces)
        own = {(piece.field.mode, piece.field.region) for piece in pieces}
        steps = np.diff(knots.time) > 0.0
        both = zip(knots.mode[:-1][steps], knots.region[:-1][steps], strict=True)
        return all((tuple(map(int, m)), tuple(map(int, r))) in own for m, r in both)

    @cached_property
    def _samples(self) -> list[tuple[Piece, Array, Array]]:
        # At random: at equal distances, all of them may meet a drive at the phase at which it does
        # not change.
        found = []
        rng = np.random.default_rng(0)
        for piece in dict.fromkeys(self.pieces):
            index = np.array([i for i, own in enumerate(self.pieces) if own is piece])
            index = np.sort(rng.choice(index, min(len(index), _SAMPLES), replace=False))
            found.append((piece, self.times[index], self.states[index].T))
        return found

    def _unchanged(self, p: Array) -> Array:
        """Basis of the directions of (t, y) along which the system is invariant, shape (1 + n,
        directions)."""
        key = p.tobytes()
        if key not in self._found:
            self._found[key] = self._null_directions(p)
        return self._found[key]

    def _null_directions(self, p: Array) -> Array:
        """The same, computed."""
        rng = np.random.default_rng(0)
        n = len(self.sizes)
        rates, others = list[_Rows](), list[_Rows]()
        for piece, t, y in self._samples:
            # Off the motion, on which slopes may vanish although the system is not invariant.
            around = y + 0.1 * self.sizes[:, None] * rng.uniform(-1.0, 1.0, y.shape)
            slopes = piece.dependence(t, around, p)
            slopes = slopes[np.all(np.isfinite(slopes), axis=(1, 2))]
            if len(slopes):
                rates.append(_merged(slopes[:, :n], True))
                others.append(_merged(slopes[:, n:], False))
        units = np.append(1.0, self.sizes)
        rates = [part._replace(rows=part.rows * units) for part in rates]
        others = [_unit(part._replace(rows=part.rows * units)) for part in others]
        # A rate that is 0 in one piece up to rounding is compared with its size in the others.
        size = np.zeros(n)
        for part in rates:
            np.maximum.at(size, part.of, np.max(np.abs(part.rows), axis=1))
        size = np.where(size > 0.0, size, 1.0)
        every = [*(part._replace(rows=part.rows / size[part.of, None]) for part in rates), *others]
        matrix = np.concatenate([np.zeros((0, 1 + n)), *(part.rows for part in every)])
        weights = np.concatenate([np.zeros(0), *(part.weights for part in every)])
        # A component with a small effect has a small effect in its own units, too, which is not a
        # symmetry: only an effect below rounding errors is zero.
        felt = np.max(np.abs(matrix), axis=0, initial=0.0)
        units = 1.0 / np.maximum(felt, LAST_DIGITS / RANK * np.max(felt) + TINIEST)
        matrix = matrix * units * weights[:, None]
        # The triangle has the same singular values and directions as the many rows.
        triangle = np.linalg.qr(np.vstack([matrix, np.zeros((1 + n, 1 + n))]), mode="r")
        _, s, v = np.linalg.svd(triangle)
        rank = int(np.sum(s > RANK * max(s[0], TINIEST)))
        return v[rank:].T * (units * np.append(1.0, self.sizes))[:, None]

    def _turn(self, p: Array, drives: Drives) -> Array:
        """Shift of the state that compensates a period of the drives: that of the frame which moves
        with them, or, if it is not apparent in the formulas, from the slopes."""
        period, _, velocity = drives
        moved = period * velocity
        felt = [
            (piece.felt(t, y, p), piece.felt(t + period, y + moved[:, None], p))
            for piece, t, y in self._samples
        ]
        change = np.concatenate([(later - now).T.ravel() for now, later in felt])
        terms = np.concatenate([(np.abs(now) + np.abs(later)).T.ravel() for now, later in felt])
        if np.max(np.abs(_relative(change, terms))) <= NO_CHANGE:
            return moved  # and also relative to the terms with the slopes, which are larger
        n = len(self.sizes)
        slopes = [piece.dependence(t, y, p) for piece, t, y in self._samples]
        matrix = np.concatenate([part[:, :, 1:].reshape(-1, n) for part in slopes]) * self.sizes
        by_time = np.concatenate([np.abs(part[:, :, 0]).ravel() for part in slopes])
        size = np.max(np.abs(matrix), axis=1, initial=0.0) + terms + period * by_time
        matrix = _relative(matrix, size[:, None])
        change = _relative(change, size)
        if np.max(np.abs(change)) <= NO_CHANGE:
            return moved
        shift = np.linalg.lstsq(matrix, -change, rcond=RANK)[0]
        if np.max(np.abs(matrix @ shift + change)) <= NO_CHANGE:
            rest = np.where(np.abs(shift) > NO_CHANGE * np.max(np.abs(shift)), shift, 0.0)
            return moved + rest * self.sizes
        raise DeclarationError(
            "period",
            f"the system is not invariant under the period {period:.9g} of its drives: it also "
            "depends on time otherwise",
            "Cycles need a periodic system",
        )


class _Rows(NamedTuple):
    """Distinct slopes of functions at some points, shape (rows, 1 + n), with the weight and the
    function of each row."""

    rows: Array
    weights: Array
    of: Array


def _merged(slopes: Array, timed: bool) -> _Rows:
    """Rows with the same singular values and directions as the slopes of functions at points, shape
    (points, functions, 1 + n): one for each function whose slopes are the same at all points.

    Parameters
    ----------
    timed : bool
        Whether slopes by time may differ; their mean is then in that row, and their deviation in
        another one.
    """
    points, _, width = slopes.shape
    alike = np.all(slopes[1:, :, 1:] == slopes[:1, :, 1:], axis=(0, 2))
    if not timed:
        alike &= np.all(slopes[1:, :, 0] == slopes[:1, :, 0], axis=0)
    same, others = np.flatnonzero(alike), np.flatnonzero(~alike)
    mean = slopes[0, same]
    off = np.zeros_like(mean)
    if timed:
        mean[:, 0] = np.mean(slopes[:, same, 0], axis=0)
        off[:, 0] = np.sqrt(np.mean((slopes[:, same, 0] - mean[:, 0]) ** 2, axis=0))
    rows = np.vstack([slopes[:, others].reshape(-1, width), mean, off])
    weights = np.repeat([1.0, np.sqrt(points)], [points * len(others), 2 * len(same)])
    of = np.concatenate([np.tile(others, points), same, same])
    some = np.any(rows != 0.0, axis=1)
    return _Rows(rows[some], weights[some], of[some])


def _relative(values: Array, size: Array) -> Array:
    """Values relative to the sizes of terms. A value that vanishes in a piece, such as the
    acceleration in stick, is compared with its size in other pieces."""
    return values / np.maximum(size, LAST_DIGITS / NO_CHANGE * np.max(size) + TINIEST)


def _unit(part: _Rows) -> _Rows:
    """Rows scaled to largest component 1, without rows of rounding errors."""
    size = np.max(np.abs(part.rows), axis=1, initial=0.0)
    some = size > ROUNDED_SUM * np.max(size, initial=0.0)
    return _Rows(part.rows[some] / size[some, None], part.weights[some], part.of[some])


def _split(free: Array) -> tuple[Array, Array | None]:
    """Shifts of the state, and the frame of a shift of time, if there is one."""
    moving = np.abs(free[0]) > NO_CHANGE * np.max(np.abs(free), initial=0.0)
    if not np.any(moving):
        return _clean(free[1:]), None
    # Combinations without a shift of time are shifts of the state; of those that shift it by 1, the
    # frame is the shortest, up to shifts.
    _, _, v = np.linalg.svd(free[:1])
    shifts = _clean(free[1:] @ v[1:].T)
    frame = free[1:] @ free[0] / (free[0] @ free[0])
    if shifts.shape[1]:
        frame = frame - shifts @ np.linalg.lstsq(shifts, frame, rcond=None)[0]
    return shifts, np.where(np.abs(frame) > _STANDS * (1.0 + np.max(np.abs(frame))), frame, 0.0)


def _clean(directions: Array) -> Array:
    """Directions with as many exact zeros as possible, the largest component of each 1."""
    rows = directions.T.copy()
    for i in range(len(rows)):
        j = int(np.argmax(np.abs(rows[i])))
        rows[i] /= rows[i, j]
        for k in range(len(rows)):
            if k != i:
                rows[k] -= rows[k, j] * rows[i]
    whole = np.round(rows)
    return np.where(np.abs(rows - whole) < NEARLY_WHOLE, whole, rows).T
