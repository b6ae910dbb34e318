"""Reductions of structures to fewer coordinates, with their errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.structures.matrices import Factored, block_of, factored, lowest_modes, rounding

if TYPE_CHECKING:
    from stickslip.structures.structure import LeftOut, Structure

InShapes = tuple[Array, Array, Array, "LeftOut"]
"""Shapes of coordinates, (n, m), the mass and the stiffness of m coordinates, what is left out."""


def craig_bampton(structure: Structure, keep: list[int], count: int) -> InShapes:
    """Kept unknowns, and modes that are fixed there.

    Parameters
    ----------
    keep : list of int
        Unknowns that are coordinates.
    count : int
        Modes.

    Raises
    ------
    DeclarationError
        If the structure can move while the kept unknowns are fixed.
    """
    from stickslip.structures.structure import LeftOut

    n = structure.coordinates
    held = np.array([structure.own[i] for i in keep])
    free = np.setdiff1d(np.arange(n), held)
    k, m = structure.stiffness, structure.mass
    b = len(held)
    inner = block_of(k, free, free)
    count = min(count, len(free))
    shapes = np.zeros((n, b + count))
    shapes[held, np.arange(b)] = 1.0
    squares, first = np.empty(0), np.inf
    stiffness = np.zeros((b + count, b + count))
    stiffness[:b, :b] = _full(block_of(k, held, held))
    if len(free):
        factor = factored(inner)
        if factor.singular:
            raise DeclarationError(
                "keep",
                "the structure has rigid-body motions while the kept degrees of freedom are fixed",
                'Keep more of them, such as all of one node, or use method="modal"',
            )
        wanted = min(count + 1, len(free))
        squares, modes = lowest_modes(inner, block_of(m, free, free), wanted, factor)
        first = float(np.sqrt(squares[count])) if len(squares) > count else np.inf
        across = _full(block_of(k, free, held))
        # Displacements of the others under unit displacements of kept unknowns: with these shapes
        # the reduced structure has the exact static stiffness.
        static = -factor.solve(across)
        shapes[free, :b] = static
        shapes[free, b:] = modes[:, :count]
        stiffness[:b, :b] += across.T @ static
        # Constraint modes and fixed-interface modes are orthogonal with respect to K.
        stiffness[range(b, b + count), range(b, b + count)] = squares[:count]
    return (
        shapes,
        _even(shapes.T @ (m @ shapes)),
        _even(stiffness),
        LeftOut("craig-bampton", structure.unknowns, first, 0.0),
    )


def modal(structure: Structure, keep: list[int], count: int) -> InShapes:
    """The lowest modes alone.

    Parameters
    ----------
    keep : list of int
        Unknowns at which the static error is said.
    count : int
        Modes, at least one.

    Raises
    ------
    DeclarationError
        If no mode is asked for.
    """
    from stickslip.structures.structure import LeftOut

    if count == 0:
        raise DeclarationError(
            "modes", "no modes and no kept degrees of freedom", "Give an integer, like 20"
        )
    n = structure.coordinates
    count = min(count, n)
    squares, shapes = lowest_modes(structure.stiffness, structure.mass, min(count + 1, n))
    first = float(np.sqrt(squares[count])) if len(squares) > count else np.inf
    squares, shapes = squares[:count], shapes[:, :count]
    error = _static_error(structure, keep, squares, shapes) if keep else np.nan
    return (
        shapes,
        np.eye(count),
        np.diag(squares),
        LeftOut("modal", structure.unknowns, first, error),
    )


def _static_error(structure: Structure, keep: list[int], squares: Array, shapes: Array) -> float:
    """Largest relative error of static displacements of kept unknowns under forces on these,
    without rigid modes."""
    n = structure.coordinates
    forces = np.zeros((n, len(keep)))
    for j, i in enumerate(keep):
        if structure.basis is None:
            forces[i, j] = 1.0
        else:
            forces[:, j] = structure.basis[i]
    m = structure.mass
    rigid = shapes[:, squares == 0.0]
    elastic, own = shapes[:, squares > 0.0], squares[squares > 0.0]
    # Forces without a resultant: only these have a static displacement, up to a rigid motion.
    forces -= m @ (rigid @ (rigid.T @ forces))
    factor, shift = _regular(structure)
    moved = factor.solve(forces)
    moved -= rigid @ (rigid.T @ (m @ moved))
    exact = np.einsum("ij,ij->j", forces, moved)
    seen = elastic.T @ forces
    found = np.einsum("ij,ij->j", seen, seen / (own + shift)[:, None])
    parts = 1.0 - found / np.where(exact > 0.0, exact, np.inf)
    return float(np.max(np.maximum(parts, 0.0)))


def _regular(structure: Structure) -> tuple[Factored, float]:
    """Factored of K, or where that is singular of K + s M, and s."""
    factor = factored(structure.stiffness)
    if not factor.singular:
        return factor, 0.0
    shift = 1e6 * rounding(structure.stiffness, structure.mass)
    return factored(structure.stiffness + shift * structure.mass), shift


def _full(block: Array) -> Array:
    return block if isinstance(block, np.ndarray) else block.toarray()


def _even(matrix: Array) -> Array:
    return (matrix + matrix.T) / 2.0
