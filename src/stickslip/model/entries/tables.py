"""Tables: measured curves and surfaces, as functions of any variables of formulas.

Between two knots a curve is a polynomial, and so is a surface in a cell of its grid. As a function
of time that is given by samples it is a select between the nearest even and the nearest odd piece
(:mod:`stickslip.model.entries.polynomials`), so that what a formula costs does not depend on how
many knots there are, and a motion stops exactly at each of them. In a cell of a surface, which one
it is is one number, that of its column and that of its row together, and coefficients are looked up
by it.

Where an argument is seen to stay on one side of an end of a table, as ``abs(v)`` is of 0, nothing
changes at that end, and no event is looked for.
"""

from __future__ import annotations

import hashlib
import math
import zlib
from base64 import b64encode
from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.errors import DeclarationError, suggestion
from stickslip.kept import cached_property
from stickslip.model.entries.grids import (
    MOST_STORED,
    check_word,
    checked_grid,
    grid_in_rows,
    is_grid,
    unpacked_table,
    without_formulas,
)
from stickslip.model.entries.interpolation import (
    ends_of_pieces,
    integrated,
    pieces_of_curve,
    power_series,
)
from stickslip.model.entries.polynomials import (
    INTEGRAL,
    LIVING,
    PiecewisePolynomial,
    Surface,
)
from stickslip.model.entries.samples import WrongRow, checked, unit_entry
from stickslip.model.entries.table_formulas import CurveFunction, SurfaceFunction
from stickslip.model.entries.units import check_unit
from stickslip.model.formats.columns import argument_columns, chosen_columns
from stickslip.numerics.levels import FEW_ROUNDINGS
from stickslip.symbolic.formulas import TableFunction

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TableKind = Literal["linear", "pchip", "cubic"]
Outside = Literal["refused", "constant", "linear"]
TABLE_KINDS: tuple[TableKind, ...] = ("linear", "pchip", "cubic")
OUTSIDE: tuple[Outside, ...] = ("refused", "constant", "linear")
_LISTED = 50  # number of values up to which a model file lists them
_MOST_FORMULAS = 100  # largest number of values that are formulas
_EVERYWHERE = (-math.inf, math.inf)


class Table:
    """A curve or a surface given at points.

    Parameters
    ----------
    points : array, shape (m,), or pair of arrays, shapes (m,) and (n,)
        Increasing points, at least two; for a surface, the two axes of a grid.
    values : array, shape (m,) or (m, n)
        Values at the points. For a curve they may be formulas of the parameters of the system,
        except with ``"pchip"``.
    kind : {"linear", "pchip", "cubic"}
        Interpolation: piecewise linear, bilinear for a surface; the monotone cubic of Fritsch and
        Carlson, for a curve with a continuous slope; or a cubic spline, not-a-knot at its ends, for
        a surface in both directions. As ``PchipInterpolator``, ``CubicSpline`` and
        ``RectBivariateSpline(..., s=0)`` of SciPy.
    outside : {"refused", "constant", "linear"} or pair of these
        Extrapolation: refused, so that a motion outside the points ends with the outcome *outside
        of a table*; the value at the end; or linear with the slope at the end. A pair applies below
        and above. Refused by default.
    where : str
        Name of the input in error messages.
    source : mapping, optional
        The ``file``, and the names of its columns ``of`` and ``value``.
    unit : str
        Unit of the values; empty if it is not declared, so that nothing is compared with it. The
        unit of a slope is this unit divided by that of the argument, and the unit of an integral is
        their product.

    Raises
    ------
    DeclarationError
        If points do not increase, a value is not finite, there are too few, or the unit does not
        parse.

    Notes
    -----
    A table ``mu`` of a system is a function in its formulas, ``mu(abs(d_x))``. For a curve, the
    exact slope and integral are available as ``d_mu(x)`` and ``integral_mu(x)``: the energy of a
    spring with the force ``F(x)`` is ``integral_F(x)``. The integral is 0 at 0, or at the end of
    the table nearest to 0.

    Examples
    --------
    >>> import stickslip as ss
    >>> mu = ss.Table([0.0, 0.1, 1.0], [0.4, 0.3, 0.25], outside="constant")
    >>> mu(0.05)
    0.35
    """

    @validated
    def __init__(
        self,
        points: Any,
        values: Any,
        kind: TableKind = "linear",
        outside: Outside | tuple[Outside, Outside] = "refused",
        *,
        where: str = "table",
        source: Mapping[str, Any] | None = None,
        unit: str = "",
    ) -> None:
        check_word(kind, TABLE_KINDS, f"{where}, kind")
        sides = outside if isinstance(outside, tuple | list) else (outside, outside)
        for side in sides:
            check_word(side, OUTSIDE, f"{where}, outside")
        self.kind: TableKind = kind
        self.outside: tuple[Outside, Outside] = (sides[0], sides[1])
        self.source: dict[str, Any] = dict(source or {})
        self.unit: str = check_unit(unit, f"{where}, unit")
        self.formulas: dict[int, str] = {}
        self.axes: tuple[Array, ...]
        if is_grid(points):
            self.axes, self.values = checked_grid(points, values, where)
            if kind == "pchip":
                raise DeclarationError(
                    f"{where}, kind",
                    '"pchip" is not available for surfaces',
                    'Write "linear" or "cubic"',
                )
        else:
            numbers, self.formulas = without_formulas(values)
            t, self.values = checked(points, numbers, where, "point")
            self.axes = (t,)
            self._check_formulas(where)
        for part in (*self.axes, self.values):
            part.flags.writeable = False
        self._made: dict[tuple[Any, ...], PiecewisePolynomial] = {}

    def _check_formulas(self, where: str) -> None:
        if self.formulas and self.kind == "pchip":
            raise DeclarationError(
                f"{where}, kind",
                '"pchip" is not available for values that are formulas, because its slopes have '
                "kinks as functions of the values",
                'Write kind = "linear" or "cubic", or give numbers',
            )
        if len(self.formulas) > _MOST_FORMULAS:
            raise DeclarationError(
                f"{where}, values",
                f"{len(self.formulas)} values are formulas (at most {_MOST_FORMULAS})",
                "Use numbers, or fewer points",
            )

    @classmethod
    @validated
    def read(
        cls,
        file: str | PathLike[str],
        of: str | tuple[str, str] = "",
        value: str = "",
        kind: TableKind = "linear",
        outside: Outside | tuple[Outside, Outside] = "refused",
        *,
        name: str = "",
        unit: str = "",
    ) -> Table:
        """Read a table from columns of a text file.

        Parameters
        ----------
        file : path
            Columns separated by commas, semicolons, tabs or blanks, with a header line of names;
            lines that begin with # are skipped. For a surface, each row is a point of the grid, in
            any order.
        of : str or pair of str
            Column of the points, by default the first one; two columns for a surface.
        value : str
            Column of the values: by default the one named `name` or ``value``, or else the only
            other one.
        kind, outside, unit
            As in :class:`Table`.
        name : str
            Name of the table in formulas.

        Raises
        ------
        DeclarationError
            If the file cannot be read, a column is missing, or an entry is invalid; the message
            names the row, the column and the remedy.
        """
        arguments = (of,) if isinstance(of, str) and of else tuple(of)
        columns, rows, wanted = chosen_columns(file, argument_columns(arguments, value, name))
        *names, last = wanted
        source = {"file": str(file), "of": names if len(names) > 1 else names[0], "value": last}
        if len(names) > 1:
            axes, grid = grid_in_rows(columns, rows, names, str(file))
            return cls(axes, grid, kind, outside, where=str(file), source=source, unit=unit)
        try:
            checked(columns[0], columns[1], str(file), "point")
        except WrongRow as error:
            raise error.in_file(str(file), int(rows[error.index]), (names[0], last)) from None
        points, values = columns[0], columns[1]
        return cls(points, values, kind, outside, where=str(file), source=source, unit=unit)

    # -- what it is --------------------------------------------------------------------------------

    def __repr__(self) -> str:
        return f"<Table {self.digest}: {self}>"

    def __str__(self) -> str:
        count = " x ".join(f"{len(axis):,}" for axis in self.axes)
        ranges = ", ".join(f"{axis[0]:.6g} to {axis[-1]:.6g}" for axis in self.axes)
        below, above = self.outside
        beyond = below if below == above else f"{below} below, {above} above"
        unit = f", in {self.unit}" if self.unit else ""
        return f"{count} points from {ranges}, {self.kind}, outside {beyond}{unit}"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Table) and other.digest == self.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def __reduce__(self) -> tuple[Any, ...]:
        again = self.points, self.given, self.kind, self.outside, self.source, self.unit
        return _again, again

    def plot(self, ax: Axes | None = None) -> Figure:
        """Plot the points and the interpolation; a surface as contour levels.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Existing axes to draw into.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from stickslip.figures.samples import plot_table

        return plot_table(self, ax)

    def _repr_html_(self) -> str:
        from stickslip import page
        from stickslip.display.system_page import table_page

        return table_page(self, "" if self.formulas else page.drawn(self.plot))

    @property
    def points(self) -> Any:
        """Points of the table: an array, or a pair of arrays."""
        return self.axes if len(self.axes) > 1 else next(iter(self.axes))

    @property
    def given(self) -> Any:
        """The values as given: numbers or formulas."""
        if not self.formulas:
            return self.values
        return [self.formulas.get(i, float(v)) for i, v in enumerate(self.values)]

    @property
    def arguments(self) -> tuple[str, ...]:
        """Names of its arguments in formulas that are parsed."""
        return ("x", "y")[: len(self.axes)]

    @property
    def _weights(self) -> str:
        """The unit of the factors of values, or of the coefficients of a surface."""
        return "1" if self.unit else ""

    @cached_property
    def digest(self) -> str:
        """Hash of the content."""
        about = f"{self.kind} {self.outside} {self.formulas} {self.unit}".rstrip()
        content = hashlib.sha256(about.encode())
        for part in (*self.axes, self.values):
            content.update(np.ascontiguousarray(part).data)
        return content.hexdigest()[:16]

    def plain(self) -> dict[str, Any]:
        """Plain data for a model file: few numbers as lists, many as one string (Base64 of
        compressed floating-point numbers), very many by file and digest."""
        found: dict[str, Any] = {"kind": self.kind} if self.kind != "linear" else {}
        below, above = self.outside
        if below != above:
            found["outside"] = [below, above]
        elif below != "refused":
            found["outside"] = below
        found |= {"unit": self.unit} if self.unit else {}
        size = self.values.size + sum(map(len, self.axes))
        if size <= 2 * _LISTED or self.formulas:
            points = [axis.tolist() for axis in self.axes]
            values = self.given if self.formulas else self.values.tolist()
            return {"points": points if len(points) > 1 else points[0], "values": values, **found}
        if size <= 2 * MOST_STORED:
            content = np.concatenate([*self.axes, self.values.ravel()]).astype("<f8").tobytes()
            shape = list(self.values.shape)
            return {"packed": b64encode(zlib.compress(content)).decode(), "shape": shape, **found}
        return {**self.source, **found, "digest": self.digest}

    @classmethod
    def from_plain(
        cls, table: Mapping[str, Any], where: str, folder: Path = Path(), name: str = ""
    ) -> Table:
        """Table from the plain data of a model file.

        Parameters
        ----------
        table : mapping
            With ``file`` (relative to the folder), ``of`` and ``value``; or ``points`` and
            ``values``; or ``packed`` and ``shape``. With ``kind``, ``outside`` and ``unit``.
        where : str
            The key, for messages.
        folder : path
        name : str
            Name of the table in formulas.

        Raises
        ------
        DeclarationError
        """
        ways = (("file", "of", "value"), ("points", "values"), ("packed", "shape"), ("digest",))
        way = next((w for w in ways if w[0] in table), None)
        if way is None:
            raise DeclarationError(
                where,
                "the points of the table are missing",
                'Write it like {file = "mu.csv", of = "speed", value = "mu"}',
            )
        known = {*way, "kind", "outside", "unit", "digest"}
        for key in table:
            if key not in known:
                raise DeclarationError(f"{where}.{key}", "unknown key", suggestion(key, known))
        outside = table.get("outside", "refused")
        options = (
            table.get("kind", "linear"),
            tuple(outside) if isinstance(outside, list) else outside,
        )
        unit = unit_entry(table, where)
        if way[0] == "file":
            of, value = table.get("of", ""), table.get("value", "")
            of = tuple(of) if isinstance(of, list) else of
            names = (table["file"], value, *(of if isinstance(of, tuple) else (of,)))
            if not all(isinstance(part, str) for part in names) or len(names) > 4:
                raise DeclarationError(
                    where,
                    "the name of a column is not a string",
                    'Write it like of = "speed", or of = ["x", "y"]',
                )
            found = cls.read(folder / table["file"], of, value, *options, name=name, unit=unit)
        elif way[0] == "points":
            points, values = table["points"], table.get("values", ())
            found = cls(points, values, *options, where=where, unit=unit)
        elif way[0] == "packed":
            points, values = unpacked_table(table, where)
            found = cls(points, values, *options, where=where, unit=unit)
        else:
            raise DeclarationError(
                where,
                "these points were too many to be stored",
                "Read them from a file, so that they can be loaded again",
            )
        if table.get("digest", found.digest) != found.digest:
            raise DeclarationError(
                where,
                "the file has changed since the result was stored",
                "Restore the original file",
            )
        return found

    # -- as a function -----------------------------------------------------------------------------

    def __call__(self, *places: ArrayLike) -> Any:
        """Values at places; NaN outside, where that is refused.

        Parameters
        ----------
        *places : array
            One, or two of a surface, which are broadcast against each other.

        Raises
        ------
        DeclarationError
            If values are formulas, or the number of arguments is wrong.
        """
        if self.formulas:
            raise DeclarationError("table", "its values are formulas", "Use system.evaluate")
        if len(places) != len(self.axes):
            raise DeclarationError(
                "table",
                f"the table has {len(self.axes)} argument(s), got {len(places)}",
                "Give one array for each argument",
            )
        at = np.broadcast_arrays(*(np.asarray(place, float) for place in places))
        found = self._evaluated(*at)
        return found if found.ndim else float(found)

    def _evaluated(self, *at: Array) -> Array:
        if len(self.axes) == 1:
            pieces = self.pieces("table", (False, False))
            k, u = self._column(0, at[0])
            return power_series([c[k] for c in pieces.coefficients.T], u)
        (i, u), (j, w) = (self._column(axis, place) for axis, place in enumerate(at))
        c = self._cells((False, False), (False, False))[i, j]
        rows = [
            power_series([c[..., a, b] for b in range(c.shape[-1])], w) for a in range(c.shape[-2])
        ]
        return power_series(rows, u)

    def _column(self, axis: int, place: Array) -> tuple[Array, Array]:
        """The piece along an axis that contains a point, and the local coordinate; NaN outside the
        table."""
        knots = self.axes[axis]
        breaks = ends_of_pieces(knots, (False, False))
        k = np.clip(np.searchsorted(breaks, place, side="right") - 1, 0, len(breaks) - 2)
        low, high = self._covered(axis, (False, False))
        return k, np.where((place >= low) & (place <= high), place - breaks[k], np.nan)

    def functions(self, name: str) -> dict[str, TableFunction]:
        """Functions available in formulas: the table and, for a curve, its slope and integral."""
        if len(self.axes) > 1:
            return {name: SurfaceFunction(self, name)}
        return {
            name: CurveFunction(self, name, name),
            f"d_{name}": CurveFunction(self, name, name, slope=True),
            f"{INTEGRAL}{name}": CurveFunction(self, name, f"{INTEGRAL}{name}"),
        }

    # -- pieces ------------------------------------------------------------------------------------

    def pieces(
        self, called: str, open_ends: tuple[bool, bool], which: int | None = None
    ) -> PiecewisePolynomial:
        """The polynomials of a curve.

        Parameters
        ----------
        called : str
            Name of the table in formulas, or of its integral.
        open_ends : (bool, bool)
            Whether arguments never reach the lower end, and the upper end.
        which : int, optional
            If given, the curve that is 1 at this point and 0 at all others, instead of the values.
        """

        def make(name: str) -> PiecewisePolynomial:
            values = self.values if which is None else np.eye(len(self.values))[which]
            breaks, c = pieces_of_curve(self.axes[0], values, self.kind, self.outside, open_ends)
            if called.startswith(INTEGRAL):
                c = integrated(breaks, c, open_ends)
            covered = self._covered(0, open_ends)
            return PiecewisePolynomial(
                name,
                breaks,
                c,
                0.0,
                sides=("even", "odd"),
                called=called,
                covered=covered,
                unit=self.unit if which is None else self._weights,
            )

        return self._kept(called, open_ends, "values" if which is None else which, make)

    def knots(self, name: str, axis: int, open_ends: tuple[bool, bool]) -> PiecewisePolynomial:
        """The gate between pieces along an axis."""
        breaks = ends_of_pieces(self.axes[axis], open_ends)
        covered = self._covered(axis, open_ends)
        bounded = None if covered == _EVERYWHERE else covered
        zero = np.zeros((len(breaks) - 1, 1))

        def make(label: str) -> PiecewisePolynomial:
            return PiecewisePolynomial(
                label,
                breaks,
                zero,
                0.0,
                sides=("gate",),
                called=name,
                covered=_EVERYWHERE,
                surface=self.surface if axis == 1 else None,
                kinked=self.kind == "linear",
                bounded=bounded,
            )

        return self._kept(name, open_ends, f"knots{axis}", make)

    def places_in_cells(
        self, name: str, axis: int, open_ends: tuple[bool, bool]
    ) -> tuple[PiecewisePolynomial, PiecewisePolynomial]:
        """For an axis of a surface: the number of the piece, and the local coordinate within it."""
        breaks = ends_of_pieces(self.axes[axis], open_ends)
        count = len(breaks) - 1
        covered = self._covered(axis, open_ends)
        surface = self.surface if axis == 0 else None

        def make(label: str, c: Array, of: Surface | None) -> PiecewisePolynomial:
            return PiecewisePolynomial(
                label,
                breaks,
                c,
                0.0,
                sides=("even", "odd"),
                covered=covered,
                surface=of,
                unit=self._weights,
            )

        numbers, within = np.arange(float(count))[:, None], np.tile([0.0, 1.0], (count, 1))
        return (
            self._kept(name, open_ends, f"number{axis}", lambda s: make(s, numbers, surface)),
            self._kept(name, open_ends, f"within{axis}", lambda s: make(s, within, None)),
        )

    def coefficients_of_cells(
        self, name: str, open_x: tuple[bool, bool], open_y: tuple[bool, bool]
    ) -> tuple[int, dict[tuple[int, int], PiecewisePolynomial]]:
        """Number of columns of a surface, and its coefficients by powers of both local coordinates,
        as functions of the number of the cell."""
        cells = self._cells(open_x, open_y)
        columns, rows, high, wide = cells.shape
        breaks = np.arange(columns * rows + 1) - 0.5

        def make(label: str, a: int, b: int) -> PiecewisePolynomial:
            # cells column by column, then row by row
            c = np.ascontiguousarray(cells[:, :, a, b].T.reshape(-1, 1))
            of = self.surface if a == b == 0 else None
            return PiecewisePolynomial(
                label,
                breaks,
                c,
                0.0,
                sides=("own",),
                covered=_EVERYWHERE,
                surface=of,
                unit=self.unit,
            )

        return columns, {
            (a, b): self._kept(
                name, (*open_x, *open_y), f"c{a}{b}", lambda label, a=a, b=b: make(label, a, b)
            )
            for a in range(high)
            for b in range(wide)
        }

    def section(
        self, name: str, axis: int, value: float, open_ends: tuple[bool, bool]
    ) -> PiecewisePolynomial:
        """The section of a surface at a fixed value of one argument: a curve over the other."""
        other = 1 - axis
        ends = ((False, False), open_ends) if axis == 0 else (open_ends, (False, False))

        def make(label: str) -> PiecewisePolynomial:
            k, u = self._column(axis, np.array(value))
            # (pieces of the other axis, powers of this one, powers of the other one)
            cells = self._cells(*ends)
            own = cells[int(k)] if axis == 0 else cells[:, int(k)].transpose(0, 2, 1)
            c = np.ascontiguousarray(
                np.einsum("jab,a->jb", own, float(u) ** np.arange(own.shape[1]))
            )
            breaks = ends_of_pieces(self.axes[other], open_ends)
            covered = self._covered(other, open_ends)
            return PiecewisePolynomial(
                label, breaks, c, 0.0, sides=("even", "odd"), covered=covered, unit=self.unit
            )

        place = np.float64(value).tobytes().hex()
        return self._kept(name, open_ends, f"at{axis}_{place}", make)

    @cached_property
    def surface(self) -> Surface:
        """Bounds of the values in each cell, by Bernstein coefficients."""
        closed = (False, False)
        cells = self._cells(closed, closed)
        breaks = tuple(ends_of_pieces(axis, closed) for axis in self.axes)
        c = cells
        for axis, powers in enumerate((2, 3)):
            length = np.diff(breaks[axis]).reshape((-1, 1, 1, 1) if axis == 0 else (1, -1, 1, 1))
            d = c.shape[powers] - 1
            shape = [1, 1, 1, 1]
            shape[powers] = d + 1
            c = c * length ** np.arange(d + 1.0).reshape(shape)
            matrix = [
                [math.comb(i, j) / math.comb(d, j) for j in range(d + 1)] for i in range(d + 1)
            ]
            c = np.moveaxis(np.tensordot(matrix, c, (1, powers)), 0, powers)
        slack = FEW_ROUNDINGS * np.abs(c).max(axis=(2, 3))
        low, high = c.min(axis=(2, 3)) - slack, c.max(axis=(2, 3)) + slack
        for axis in range(2):
            for side, end in zip(self.outside, (0, -1), strict=True):
                if side == "linear":
                    at = (end, slice(None)) if axis == 0 else (slice(None), end)
                    low[at], high[at] = -math.inf, math.inf
        return Surface((breaks[0], breaks[1]), low, high, cells.shape[2] * cells.shape[3])

    def _cells(self, open_x: tuple[bool, bool], open_y: tuple[bool, bool]) -> Array:
        """Coefficients of cells, shape (columns, rows, powers, powers)."""
        x, y = self.axes
        _, c = pieces_of_curve(x, self.values, self.kind, self.outside, open_x)
        _, cells = pieces_of_curve(y, np.moveaxis(c, -1, 0), self.kind, self.outside, open_y)
        # (rows, powers of y, columns, powers of x)
        return np.ascontiguousarray(cells.transpose(2, 0, 3, 1))

    def _covered(self, axis: int, open_ends: tuple[bool, bool]) -> tuple[float, float]:
        ends = float(self.axes[axis][0]), float(self.axes[axis][-1])
        free = [
            is_open or side != "refused"
            for side, is_open in zip(self.outside, open_ends, strict=True)
        ]
        return (-math.inf if free[0] else ends[0]), (math.inf if free[1] else ends[1])

    def _kept(
        self,
        called: str,
        open_ends: tuple[bool, ...],
        what: int | str,
        make: Callable[[str], PiecewisePolynomial],
    ) -> PiecewisePolynomial:
        """Pieces that equal tables share, as long as one of these exists."""
        key = called, open_ends, what
        if key not in self._made:
            ends = "".join("01"[is_open] for is_open in open_ends)
            name = f"table_{called}_{self.digest}_{ends}_{what}"
            found = LIVING.get(name)
            if found is None:
                found = LIVING[name] = make(name)
            self._made[key] = found
        return self._made[key]


# -- reading ---------------------------------------------------------------------------------------


def _again(points: Any, values: Any, kind: Any, outside: Any, source: Any, unit: str = "") -> Table:
    """A table that another process reads."""
    return Table(points, values, kind, outside, source=source, unit=unit)
