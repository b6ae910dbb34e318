"""The smooth pieces of a system with numbers: field, Jacobian, guards and constraints of each mode
and region."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from threading import RLock

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.derive import MotionEquations
from stickslip.equations.field import Field, in_region, switched
from stickslip.equations.mode_fields import mode_field
from stickslip.kept import cached_property, made_once
from stickslip.model.entries.declared import Kind
from stickslip.motion.between.dense import make_scratch
from stickslip.motion.steps.arrays import Rows
from stickslip.orbits.fields.engine.tables import (
    Leave,
    Listed,
    PassSpace,
    make_spectra,
    room_for_pass,
)
from stickslip.orbits.fields.instructions import Listing, PointFunction, packed
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

_MOST_PIECES = 256  # largest number of cached pieces of a system
_MANY = 64  # number of pieces above which those that are no longer needed are dropped
_DEPENDENT = 1e-9  # relative distance of a gradient from the span of others on which it depends


@dataclass(frozen=True)
class Bounds:
    """The constraints of a piece at a point: values and derivatives by time, state and free
    parameters."""

    value: Array
    time: Array
    slopes: Array


class Piece:
    """The smooth motion y' = f(t, y, p) in one mode and region, with first derivatives.

    Parameters
    ----------
    free : sequence of str
        Parameters; derivatives with respect to them follow those with respect to the state as last
        columns.
    """

    def __init__(self, field: Field, free: Sequence[str]) -> None:
        self.field = field
        self.columns: tuple[str, ...] = (*field.state, *free)
        self.switches: Array = np.array([g.switch for g in field.guards], dtype=int)
        rows = [[ex.derivative(f, c) for c in self.columns] for f in field.rates]
        moving = {"t", *field.state}
        self.constant: bool = not any(
            e.symbols & moving for row in rows for e in row[: len(field.state)]
        )
        self.timely: bool = not any(
            e.symbols & set(field.state) for row in rows for e in row[len(field.state) :]
        )
        self.slopes: PointFunction = PointFunction(field, [e for row in rows for e in row])
        self._speeds: dict[int, PointFunction] = {}
        self._gaps: dict[int, PointFunction] = {}

    def rates(self, t: float | Array, y: Array, p: Array) -> Array:
        """The field, at a point or at many."""
        return self._rates(t, y, p)

    def jacobian(self, t: Array, y: Array, p: Array) -> Array:
        """∂f/∂(y, p) at many points, shape (points, states, columns)."""
        values = self.slopes(t, y, p)
        return np.moveaxis(values.reshape(len(self.field.state), len(self.columns), -1), -1, 0)

    def leave(self, t: float, y: Array, p: Array) -> Leave:
        """The guards at a point."""
        return self.leaves(np.array([t]), y[:, None], p)[0]

    def leaves(self, t: Array, y: Array, p: Array) -> list[Leave]:
        """The guards at many points, y of the shape (states, points)."""
        n, points = y.shape
        values = np.ascontiguousarray(self.guards(t, y, p).T)
        rates = np.ascontiguousarray(values[:, :n])
        table = values[:, n:].reshape(points, -1, 2 + len(self.columns))
        value, time, slopes = table[..., 0].copy(), table[..., 1], table[..., 2:].copy()
        terms = slopes[..., :n] * rates[:, None]
        fall = time + np.sum(terms, axis=2)
        size = np.abs(time) + np.sum(np.abs(terms), axis=2)
        return [Leave(*each) for each in zip(rates, value, slopes, fall, size, strict=True)]

    def bounds(self, t: float, y: Array, p: Array) -> Bounds:
        """The constraints at a point."""
        table = self._constraints(t, y, p).reshape(-1, 2 + len(self.columns))
        return Bounds(table[:, 0], table[:, 1], table[:, 2:])

    def felt(self, t: Array, y: Array, p: Array) -> Array:
        """Rates, guards, constraints and changes in jumps at many points, shape (functions,
        points)."""
        return self._all_functions(t, y, p)

    def dependence(self, t: Array, y: Array, p: Array) -> Array:
        """Their derivatives with respect to time and the state, shape (points, functions, 1 +
        states)."""
        values = self._dependence(t, y, p)
        return np.moveaxis(values.reshape(-1, 1 + len(y), len(t)), -1, 0)

    def rests(self, contact: int, t: float, y: Array, p: Array) -> bool:
        """Return whether the constraints of the sticking contacts hold another contact with mass at
        rest: its velocity is zero for all admissible states, whatever its mode."""
        c = self.field.contacts[contact]
        if c.kind != Kind.INERTIAL or c.loose:
            return False
        slope = self.velocity(contact, t, y, p)[2:]
        bounds = self.bounds(t, y, p).slopes
        if not len(bounds):
            return False
        left = slope - bounds.T @ np.linalg.lstsq(bounds.T, slope, rcond=None)[0]
        return float(np.max(np.abs(left))) <= _DEPENDENT * float(np.max(np.abs(slope)))

    def velocity(self, contact: int, t: float, y: Array, p: Array) -> Array:
        """Relative velocity of a contact, and its derivatives by time and by the columns."""
        if contact not in self._speeds:
            u = self.field.contacts[contact].u
            self._speeds[contact] = PointFunction(self.field, self._with_slopes([u]))
        return self._speeds[contact](t, y, p)

    def gap(self, contact: int, t: float, y: Array, p: Array) -> Array:
        """Gap of a contact that can open, and its derivatives by time and by the columns."""
        if contact not in self._gaps:
            gap = self.field.contacts[contact].gap
            assert gap is not None
            self._gaps[contact] = PointFunction(self.field, self._with_slopes([gap]))
        return self._gaps[contact](t, y, p)

    def carried(self, t: float, y: Array, p: Array) -> set[int]:
        """The switches of contacts that others hold at rest, although they do not stick in this
        mode: their guards are velocities that are zero up to rounding."""
        kinks = len(self.field.region)
        modes = enumerate(self.field.mode)
        return {kinks + c for c, mode in modes if mode != 0 and self.rests(c, t, y, p)}

    @property
    def bound(self) -> int:
        """Number of constraints."""
        return len(self.field.constraints)

    def setting(self, switch: int) -> int:
        """Region or mode of a switch."""
        kinks = len(self.field.region)
        return self.field.region[switch] if switch < kinks else self.field.mode[switch - kinks]

    def switched(self, switch: int, setting: int) -> tuple[Array, Array]:
        """Mode and region that differ by one switch."""
        mode, region = switched(self.field, switch, setting)
        return np.array(mode, np.int8), np.array(region, np.int8)

    @cached_property
    def straight(self) -> bool:
        """Whether the slopes of the constraints are constant."""
        slopes = self._with_slopes(self.field.constraints)
        values = slice(None, None, 2 + len(self.columns))
        del slopes[values]
        return not any(e.symbols & {"t", *self.field.state} for e in slopes)

    @cached_property
    def _rates(self) -> PointFunction:
        return PointFunction(self.field, self.field.rates)

    @cached_property
    def guards(self) -> PointFunction:
        """Rates, and guards with their derivatives by time and by the columns."""
        guards = self._with_slopes([g.value for g in self.field.guards])
        return PointFunction(self.field, [*self.field.rates, *guards])

    @property
    def _all(self) -> list[Expr]:
        f = self.field
        return [*f.rates, *(g.value for g in f.guards), *f.constraints, *f.leaps]

    @cached_property
    def _all_functions(self) -> PointFunction:
        return PointFunction(self.field, self._all)

    @cached_property
    def _dependence(self) -> PointFunction:
        slopes = [ex.derivative(e, c) for e in self._all for c in ("t", *self.field.state)]
        return PointFunction(self.field, slopes)

    @cached_property
    def _constraints(self) -> PointFunction:
        return PointFunction(self.field, self._with_slopes(self.field.constraints))

    def _with_slopes(self, functions: list[Expr]) -> list[Expr]:
        return [
            e for g in functions for e in (g, *(ex.derivative(g, c) for c in ("t", *self.columns)))
        ]


def mass_at(equations: MotionEquations, piece: Piece, at: tuple[float, Array, Array]) -> Array:
    """The mass matrix at a point (t, y, p) of a piece."""
    values = dict(zip(piece.field.names, (at[0], *at[1], *at[2]), strict=True))
    regions = dict(zip(equations.kinks, piece.field.region, strict=True))
    n = len(equations.declaration.inertial)
    M = np.zeros((n, n))
    for place, entry in equations.mass.items():
        M[place] = ex.evaluate(in_region(entry, regions), values)
    return M


class _Lock:
    """A lock; copies are new ones."""

    def __init__(self) -> None:
        self._inside = RLock()

    def __enter__(self) -> None:
        self._inside.acquire()

    def __exit__(self, *_: object) -> None:
        self._inside.release()

    def __reduce__(self) -> tuple[type[_Lock], tuple[()]]:
        return _Lock, ()


class Pieces:
    """All pieces of a system, created on first access.

    Parameters
    ----------
    *free : str
        Parameters to differentiate with respect to.

    Attributes
    ----------
    lock : Lock
        Held while the work space and the stored eigenvalues are used, and pieces are added.
    """

    def __init__(self, equations: MotionEquations, *free: str) -> None:
        self.equations: MotionEquations = equations
        self.free: tuple[str, ...] = free
        self.made: list[Piece] = []
        self._numbers: dict[bytes, int] = {}
        self._listed: Listed | None = None
        self._spaces: dict[tuple[int, int], PassSpace] = {}
        self._with_free: dict[tuple[str, ...], Pieces] = {}
        self.lock = _Lock()

    def with_free(self, *free: str) -> Pieces:
        """The pieces with these free parameters, created on first access, and again when they have
        become many."""
        found = self if free == self.free else self._with_free.get(free)
        if found is None or len(found.made) > _MANY:
            found = self._with_free[free] = Pieces(self.equations, *free)
        return found

    def __call__(self, mode: Array, region: Array) -> Piece:
        """The piece of a mode and region (arrays of int8), as the engine numbers them."""
        return self.made[self.number(mode, region)]

    def number(self, mode: Array, region: Array) -> int:
        """Number of a piece among those that were requested."""
        key = mode.tobytes() + region.tobytes()

        def make() -> Piece:
            modes, regions = tuple(map(int, mode)), tuple(map(int, region))
            return Piece(mode_field(self.equations, modes, regions), self.free)

        if key not in self._numbers:
            with self.lock:  # another thread may list the pieces, or request the same one
                if key not in self._numbers:
                    piece = made_once(self.equations, "piece", make, (key, self.free), _MOST_PIECES)
                    self.made.append(piece)
                    self._numbers[key] = len(self.made) - 1
        return self._numbers[key]

    def numbers(self, modes: Array, regions: Array) -> Array:
        """Piece numbers of many modes and regions, shape (knots,)."""
        both = np.hstack([modes, regions])
        begins = np.ones(len(both), bool)
        begins[1:] = np.any(both[1:] != both[:-1], axis=1)
        stretches = [self.number(modes[i], regions[i]) for i in np.flatnonzero(begins)]
        return np.array(stretches, np.int64)[np.cumsum(begins) - 1]

    @property
    def listed(self) -> Listed:
        """The requested pieces, as instructions."""
        with self.lock:
            if self._listed is None or len(self._listed.steady) < len(self.made):
                self._listed = listed_pieces(self.made)
                self._spaces = {}
            return self._listed

    def space(self, rows: Rows, shape: tuple[int, int], nodes: int) -> PassSpace:
        """Work space, reused for successive passes.

        Parameters
        ----------
        rows : Rows
            Of the system.
        shape : (int, int)
            Columns and directions.
        nodes : int
            For so many there has to be room.
        """
        listed = self.listed
        found = self._spaces.get(shape)
        if found is None or len(found.step) < nodes:
            between = make_scratch(rows, (0, 2))
            found = room_for_pass(listed, places_of(self.made), nodes, shape, between)
            self._spaces[shape] = found
        return found


def listed_pieces(pieces: list[Piece]) -> Listed:
    """Pieces of one system as instructions."""
    n = len(pieces[0].field.state)
    width = 2 + len(pieces[0].columns)
    most = max(len(piece.switches) for piece in pieces)
    switches = np.full((len(pieces), most), -1)
    falls = np.zeros((len(pieces), most, width), np.int64)
    listings: list[Listing] = []
    spans: list[tuple[int, int, int]] = []
    begin = 0
    for w, piece in enumerate(pieces):
        count = len(piece.switches)
        switches[w, :count] = piece.switches
        falls[w, :count] = piece.guards.listing.wanted[n:].reshape(-1, width)
        for listing in (piece.slopes.listing, piece.guards.listing):
            end = begin + len(listing.code)
            spans.append((begin, begin + listing.once, end))
            listings.append(listing)
            begin = end
    return Listed(
        packed(listings),
        np.array(spans[::2]),
        np.array(spans[1::2]),
        np.array([piece.slopes.listing.wanted for piece in pieces]),
        np.array([piece.guards.listing.wanted[:n] for piece in pieces]),
        falls,
        switches,
        np.array([[*piece.field.region, *piece.field.mode] for piece in pieces], np.int64),
        np.array([piece.constant for piece in pieces], np.int64),
        np.array([piece.timely for piece in pieces], np.int64),
        make_spectra(len(pieces), n, len(pieces[0].columns) - n),
    )


def places_of(pieces: list[Piece]) -> int:
    """Places in the table of values for the instructions of some pieces."""
    return max(f.listing.places for piece in pieces for f in (piece.slopes, piece.guards))
