"""A cover of all directions of a space by boxes, on which properties are proved by bounds.

A homogeneous function is determined by its values on the surface of a cube, whose faces are boxes;
other names have ranges. Boxes in which bounds do not decide are divided.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.boxes import Box, enclosures
from stickslip.symbolic.expressions import Expr

BoxRanges = Mapping[str, tuple[Array, Array]]
Decided = NDArray[np.bool_]
_MOST = 40_000  # largest number of boxes
_NARROWEST = 2.0**-40  # narrowest box that is divided, as a fraction of the first


@dataclass(frozen=True)
class Directions:
    """Directions v ≠ 0, and values of other names.

    Attributes
    ----------
    names : tuple of str
        Components of v.
    others : mapping of str to (float, float)
        Ranges of all other names.
    sides : tuple of Expr
        Homogeneous; only directions in which all of these are nonnegative are covered.
    """

    names: tuple[str, ...]
    others: Mapping[str, tuple[float, float]]
    sides: tuple[Expr, ...] = ()

    def beside(self, side: Expr) -> Directions:
        """The directions in which one more expression is nonnegative."""
        return replace(self, sides=(*self.sides, side))

    def without(self, name: str, value: Expr) -> Directions:
        """The directions of a hyperplane, on which one component is a function of the others."""
        sides = tuple(ex.substitute(side, {name: value}) for side in self.sides)
        names = tuple(other for other in self.names if other != name)
        return Directions(names, self.others, tuple(s for s in sides if s.symbols & {*names}))

    def everywhere(
        self,
        verdict: Callable[[BoxRanges], tuple[Decided, Decided]],
        along: int | None = None,
        most: int = _MOST,
    ) -> bool:
        """Return whether a property is proved in all directions.

        Parameters
        ----------
        verdict : callable
            Ranges of all names, arrays of shape (boxes,) -> whether it is proved in each box, and
            whether it is wrong in all of it.
        along : int, optional
            Only in those whose largest component is this one.
        most : int
            Largest number of boxes.
        """
        keys = [*self.names, *self.others]
        low, high = self._faces()
        if along is not None:
            low, high = low[:, 2 * along : 2 * along + 2], high[:, 2 * along : 2 * along + 2]
        first = high - low
        widest = np.where(first > 0.0, first, 1.0).max(axis=1, keepdims=True)
        looked = 0
        while low.shape[1]:
            looked += low.shape[1]
            if looked > most:
                return False
            ranges = {key: (low[i], high[i]) for i, key in enumerate(keys)}
            right, wrong = verdict(ranges)
            open_ = ~right
            for bound in enclosures(self.sides, ranges) if self.sides else ():
                open_ &= bound[1] >= 0.0
                wrong = wrong & (bound[0] >= 0.0)
            if wrong.any():
                return False
            low, high = low[:, open_], high[:, open_]
            if not low.shape[1]:
                return True
            width = (high - low) / widest
            k = width.argmax(axis=0)
            column = np.arange(len(k))
            if (width[k, column] < _NARROWEST).any():
                return False
            middle = 0.5 * (low[k, column] + high[k, column])
            upper, lower = low.copy(), high.copy()
            upper[k, column] = lower[k, column] = middle
            low, high = np.hstack([low, upper]), np.hstack([lower, high])
        return True

    def nonnegative(self, expression: Expr, slack: float = 0.0, most: int = _MOST) -> bool:
        """Whether an expression is proved to be at least −`slack` in all directions with
        max |vᵢ| = 1, by that many boxes at most."""
        if not expression.symbols:
            return ex.number(expression) >= -slack
        known = self.others.keys() | {*self.names}
        if not expression.symbols <= known:
            return False

        def verdict(ranges: BoxRanges) -> tuple[Decided, Decided]:
            (bound,) = enclosures([expression], ranges)
            return bound[0] >= -slack, bound[1] < -slack

        return self.everywhere(verdict, most=most)

    def positive_semidefinite(
        self, matrix: Sequence[Sequence[Expr]], along: int | None = None
    ) -> bool:
        """Whether a symmetric matrix is proved to have no negative eigenvalue in any direction, or
        in those whose largest component is a given one."""
        kept = [i for i, row in enumerate(matrix) if any(not ex.is_number(e, 0.0) for e in row)]
        if not kept:
            return True
        upper = [matrix[i][j] for i in kept for j in kept if i <= j]

        def verdict(ranges: BoxRanges) -> tuple[Decided, Decided]:
            right = _positive_semidefinite(enclosures(upper, ranges), len(kept))
            return right, np.zeros_like(right)

        return self.everywhere(verdict, along)

    def _faces(self) -> tuple[Array, Array]:
        """Lower and upper ends of the faces of a cube, with the ranges of the other names."""
        n = len(self.names)
        low, high = np.full((n, 2 * n), -1.0), np.full((n, 2 * n), 1.0)
        for k in range(n):
            high[k, 2 * k], low[k, 2 * k + 1] = -1.0, 1.0
        if not n:
            low = high = np.zeros((0, 1))
        ends = np.array([*self.others.values()], float).reshape(len(self.others), 2)
        count = low.shape[1]
        return tuple(
            np.vstack([part, np.repeat(ends[:, [i]], count, axis=1)])
            for i, part in enumerate((low, high))
        )  # type: ignore[return-value]


def _positive_semidefinite(upper: Sequence[Box], size: int) -> NDArray[np.bool_]:
    """Whether all matrices in boxes are, given the boxes of their upper triangles."""
    rows, columns = np.triu_indices(size)
    bounds = np.stack(upper)  # (entries, 2, boxes)
    # If second derivatives are unbounded, slopes may jump.
    finite = np.isfinite(bounds).all(axis=(0, 1))
    if size == 1:
        return finite & (bounds[0, 0] >= 0.0)
    bounds = np.where(finite, bounds, 0.0)
    middle = np.zeros((bounds.shape[2], size, size))
    radius = np.zeros_like(middle)
    for i, j, (least, most) in zip(rows, columns, bounds, strict=True):
        middle[:, i, j] = middle[:, j, i] = 0.5 * (least + most)
        radius[:, i, j] = radius[:, j, i] = 0.5 * (most - least)
    # Weyl: eigenvalues change by at most the norm of the perturbation. The last term is rounding.
    moved = radius.sum(axis=2).max(axis=1)
    rounding = 8.0 * size * np.finfo(float).eps * np.abs(middle).sum(axis=2).max(axis=1)
    return finite & (np.linalg.eigvalsh(middle)[:, 0] >= moved + rounding)
