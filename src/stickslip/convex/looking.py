"""Tests of homogeneity, sign and convexity of a formula in sampled directions, with
counterexamples."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import SupportsIndex

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.kept import cached_property
from stickslip.numerics.levels import LAST_DIGITS, SAME_VALUE

_ANGLES = 360  # directions of a plane
_PLANES = 24  # random planes
_MOST_AXES = 6  # number of components up to which the planes of all pairs of axes are sampled
_PLACES = 8  # samples of the other names, within their ranges
_ROUNDING = 1e-11  # relative violation of convexity that is regarded as rounding
_BESIDE_BORDERS = 64  # samples near a hyperplane
_REACHES = (1e-1, 1e-2, 1e-3, 1e-4)
_FACTORS = (0.5, 2.0, 1e3)


@dataclass(frozen=True)
class LookedAt:
    """Values of a formula in planes of directions, closed polygons on the unit circle.

    Attributes
    ----------
    value : callable
        v of shape (n, …), other names (k, …) -> values (…).
    names, others : tuple of str
        Components of v, and the other names.
    symbol : str
        How messages call the formula.
    where : str
        What an error is about.
    directions : ndarray of shape (n, planes, angles)
    places : ndarray of shape (k, places)
    """

    value: Callable[[Array, Array], Array]
    names: tuple[str, ...]
    others: tuple[str, ...]
    symbol: str
    where: str
    directions: Array
    places: Array

    @cached_property
    def values(self) -> Array:
        """Shape (places, planes, angles)."""
        return self.value(*self._rows())

    @property
    def count(self) -> int:
        """Number of directions."""
        return int(np.prod(self.directions.shape[1:]))

    @property
    def size(self) -> float:
        """Largest value of a unit vector."""
        return float(np.abs(self.values).max(initial=0.0))

    def check_values(self) -> None:
        """Reject formulas that are undefined or negative."""
        undefined = np.argwhere(~np.isfinite(self.values))
        if len(undefined):
            raise self._refused(
                f"it has no finite value {self._at(undefined[0])}",
                "It may be undefined at v = 0 only",
            )
        least = np.unravel_index(int(self.values.argmin()), self.values.shape)
        if self.values[least] < -_ROUNDING * self.size:
            raise self._refused(
                f"it is {self.values[least]:.6g} {self._at(least)}, but a dissipation is "
                "nonnegative",
                "Check the signs",
            )

    def check_degree(self) -> None:
        """Reject formulas that are not homogeneous of degree 1."""
        v, others = self._rows()
        for factor in _FACTORS:
            scaled = self.value(factor * v, others)
            off = np.abs(scaled - factor * self.values) - SAME_VALUE * factor * self.size
            if not (off <= 0.0).all():
                k = np.unravel_index(int(np.nan_to_num(off, nan=np.inf).argmax()), off.shape)
                R = self.symbol
                raise self._refused(
                    f"it is not homogeneous of degree 1: {R}({factor:g} v) = {scaled[k]:.6g}, but "
                    f"{factor:g} {R}(v) = {factor * self.values[k]:.6g}, {self._at(k)}",
                    f"Use a rate-independent dissipation, such as sqrt({self.names[0]}**2 + ...)",
                )

    def check_convex(self) -> None:
        """Reject formulas with a counterexample to convexity: v is a sum of neighbours u and w on
        its circle, and R(v) may not exceed R(u) + R(w)."""
        if len(self.names) == 1:  # convex if it is nonnegative
            return
        count = self.directions.shape[2]
        for step in (1, 3, 10, 30, 80):
            part = 0.5 / np.cos(2.0 * np.pi * step / count)
            both = part * (np.roll(self.values, step, axis=2) + np.roll(self.values, -step, axis=2))
            off = self.values - both - _ROUNDING * self.size
            if (off > 0.0).any():
                place, plane, k = np.unravel_index(int(off.argmax()), off.shape)
                u, w = (
                    part * self.directions[:, plane, (k + side * step) % count] for side in (1, -1)
                )
                self._refuse_sum(
                    u, w, self.values[place, plane, k], both[place, plane, k], int(place)
                )

    def check_borders(self, normals: Array) -> None:
        """Reject formulas with a concave kink on a hyperplane: u and w are on both sides of it.

        Parameters
        ----------
        normals : ndarray of shape (k, n)
            Unit normals of hyperplanes.
        """
        n = len(self.names)
        if n == 1 or not len(normals):
            return
        points = np.random.default_rng(0).normal(size=(n, _BESIDE_BORDERS))
        for normal in normals:
            on = points - np.outer(normal, normal @ points)
            on /= np.linalg.norm(on, axis=0)
            for reach in _REACHES:
                sides = [0.5 * (on + side * reach * normal[:, None]) for side in (1.0, -1.0)]
                for place in range(self.places.shape[1]):
                    others = np.repeat(self.places[:, [place]], on.shape[1], axis=1)
                    whole = self.value(on, others)
                    both = self.value(sides[0], others) + self.value(sides[1], others)
                    off = whole - both - _ROUNDING * self.size
                    k = int(off.argmax())
                    if off[k] > 0.0:
                        self._refuse_sum(sides[0][:, k], sides[1][:, k], whole[k], both[k], place)

    def _refuse_sum(self, u: Array, w: Array, whole: float, both: float, place: int) -> None:
        R = self.symbol
        raise self._refused(
            f"it is not convex: {R}(u + w) = {whole:.9g} exceeds {R}(u) + {R}(w) = {both:.9g} "
            f"for u = {_numbers(u)} and w = {_numbers(w)}{self._other(place)}",
            "Use a convex formula",
        )

    def _rows(self) -> tuple[Array, Array]:
        n, *shape = self.directions.shape
        full = (self.places.shape[1], *shape)
        return (
            np.broadcast_to(self.directions[:, None], (n, *full)),
            np.broadcast_to(self.places[:, :, None, None], (len(self.places), *full)),
        )

    def _at(self, index: Iterable[SupportsIndex]) -> str:
        place, plane, k = (int(i) for i in index)
        return f"at v = {_numbers(self.directions[:, plane, k])}{self._other(place)}"

    def _other(self, place: int) -> str:
        pairs = zip(self.others, self.places[:, place], strict=True)
        return "".join(f", {name} = {value:.6g}" for name, value in pairs)

    def _refused(self, reason: str, remedy: str) -> DeclarationError:
        return DeclarationError(self.where, reason, remedy)


def looked_at(
    value: Callable[[Array, Array], Array],
    names: tuple[str, ...],
    ranges: Mapping[str, tuple[float, float]],
    symbol: str,
    where: str,
) -> LookedAt:
    """A formula in the planes of all pairs of axes, and in random ones, for some values of the
    other names.

    Parameters
    ----------
    value : callable
        v of shape (n, …), other names (k, …) -> values (…).
    names : tuple of str
        Components of v.
    ranges : mapping of str to (float, float)
        Of the other names.
    symbol, where : str
        How messages call the formula, and what an error is about.
    """
    n = len(names)
    rng = np.random.default_rng(0)
    axes = np.eye(n)
    planes = [axes[[i, j]] for i, j in combinations(range(n), 2)] if n <= _MOST_AXES else []
    if n > 1:
        planes += [
            np.linalg.qr(rng.normal(size=(n, 2)))[0].T for _ in range(_PLANES if n > 2 else 1)
        ]
    angles = 2.0 * np.pi * np.arange(_ANGLES) / _ANGLES
    circle = np.array([np.cos(angles), np.sin(angles)])
    circle[np.abs(circle) < LAST_DIGITS] = 0.0
    if n == 1:
        directions = np.array([[[1.0, -1.0]]])
    else:
        directions = np.einsum("pin,ia->npa", np.array(planes), circle)
    low, high = np.array([*ranges.values()], float).reshape(len(ranges), 2).T
    free = bool(len(ranges)) and bool((high > low).any())
    share = rng.uniform(size=(len(ranges), _PLACES if free else 1))
    share[:, 0] = 0.0
    places = low[:, None] + (high - low)[:, None] * share
    return LookedAt(value, names, tuple(ranges), symbol, where, directions, places)


def _numbers(v: Array) -> str:
    return "(" + ", ".join(f"{x:.9g}" for x in v) + ")"
