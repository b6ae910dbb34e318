"""Stable sets in the plane, for figures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.numerics.levels import COMPUTED_ZERO

if TYPE_CHECKING:
    from stickslip.rate_independent.sets.potential import Dissipation

_DIRECTIONS = 360
_RAYS = 2880  # more than directions, so that corners stay sharp


def stable_boundary(potential: Dissipation, phases: Array, rays: int = _RAYS) -> Array:
    """Boundary of the intersection of K(s) over some phases, shape (rays, 2): first intersections
    of rays with supporting lines; n = 2.

    Parameters
    ----------
    phases : array, shape (m,)
    """
    directions = _circle(rays)
    normals, offsets = _half_planes(potential, phases)
    slopes = directions @ normals.T
    ahead = slopes > COMPUTED_ZERO
    reach = np.where(ahead, offsets / np.where(ahead, slopes, 1.0), np.inf).min(axis=1)
    return directions * reach[:, None]


def _half_planes(potential: Dissipation, phases: Array) -> tuple[Array, Array]:
    """Unit normals (m, 2) and offsets (m,) of half-planes that enclose K(s) at some phases."""
    known = potential.halfspaces(phases)
    if known is not None:
        return known
    sampled = potential.sampled(phases)
    directions = _circle(_DIRECTIONS)
    return directions, np.array([sampled.support(v).min() for v in directions])


def _circle(count: int) -> Array:
    angles = 2.0 * np.pi * np.arange(count) / count
    return np.column_stack([np.cos(angles), np.sin(angles)])
