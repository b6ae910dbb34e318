"""The animation of structures: displacements over the number of the unknown, with marks at
contacts."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.explorer.drawings.parts import Scene, curve, disc, label, rod
from stickslip.model.quantities import contact_key
from stickslip.numerics.ratios import ratio

if TYPE_CHECKING:
    from stickslip.model.system import System
    from stickslip.motion.trajectory import Trajectory
    from stickslip.structures.coordinates import InModes

_WIDTH, _TALL = 8.0, 3.0  # width and height of the row of a structure
_REACH = 0.95  # its largest displacement in the drawing
_MOST = 48  # largest number of points of a line
_EACH = (1, 2, 3, 6)  # possible numbers of unknowns of a node
_MODES = 4  # number of modes whose shapes determine the number of unknowns of a node


def structures_by_index(motion: Trajectory, times: Array) -> Scene:
    """Animation of a system that consists of structures.

    Parameters
    ----------
    times : array, shape (n,)
    """
    system = motion.system
    parts = system.written_structures
    height = _TALL * len(parts)
    about = f"Displacements of {system.name} by degree of freedom"
    scene = Scene(_WIDTH + 1.4, height, -height + _TALL / 2.0, about=about)
    for row, (name, part) in enumerate(parts.items()):
        _add_structure(scene, motion, times, name, part, -_TALL * row)
    return scene


def _add_structure(
    scene: Scene, motion: Trajectory, times: Array, name: str, part: InModes, level: float
) -> None:
    """Draw a structure about a level.

    Parameters
    ----------
    name : str
        Of the structure.
    """
    structure = part.structure
    rubbing = rubbing_unknowns(motion.system, name, part)
    marked = {*rubbing, *map(structure.index, structure.indices)}
    line = line_of(structure.modes, marked)
    steps = np.searchsorted(motion.knots.time, times, side="right") - 1
    steps = np.clip(steps, 0, len(motion.knots.time) - 1)
    modes = motion.trace(part.coordinates, times, steps)
    amplitudes = np.array([modes[mode] for mode in part.coordinates])
    ways = structure.modes[line] @ amplitudes
    largest = float(np.max(np.abs(ways), initial=0.0))
    ways = level + ways * (_REACH / largest if largest > 0.0 else 1.0)
    places = np.linspace(-_WIDTH / 2.0, _WIDTH / 2.0, len(line)) if len(line) > 1 else np.zeros(1)
    ends = (-_WIDTH / 2.0, level), (_WIDTH / 2.0, level)
    scene.add(rod(*ends, look="axis"), curve(list(zip(places, ways, strict=True))))
    said: dict[int, str] = {0: str(part.key(line[0])), len(line) - 1: str(part.key(line[-1]))}
    for index in sorted(marked):
        near = int(np.argmin(np.abs(np.array(line) - index)))
        said[near] = str(part.key(index))
        at = float(places[near]), ways[near]
        for above, contact in enumerate(rubbing.get(index, ())):
            scene.add(disc(0.17, (at[0], at[1] + 0.34 * above), look="sole", contact=contact))
        if index not in rubbing:
            scene.add(disc(0.08, at, look="dark"))
    for near, text in said.items():
        scene.add(label(text, (float(places[near]), level - _TALL / 2.0 + 0.12), "small"))


def rubbing_unknowns(system: System, name: str, part: InModes) -> dict[int, list[str]]:
    """Unknowns of a structure with contacts, by index, with the names of these in variables."""
    entry = re.compile(rf"\b(?:d_)?{re.escape(name)}\[\s*(\w+)\s*\]")
    found: dict[int, list[str]] = {}
    for contact in system.frictional:
        declared = next((c for key, c in system.contacts.items() if key == contact), None)
        for unknown in dict.fromkeys(entry.findall(repr(declared))):
            found.setdefault(part.index(unknown), []).append(contact_key(contact))
    return found


def line_of(shapes: Array, marked: set[int]) -> list[int]:
    """Unknowns of one line: those of one direction, if nodes have several, so that modes are smooth
    along it; at most some dozens.

    Parameters
    ----------
    shapes : array, shape (n, m)
        Modes.
    marked : set of int
        Unknowns that should be among them.
    """
    n = len(shapes)

    def rough(each: int) -> float:
        lowest = shapes[:, :_MODES]
        lines = [lowest[first::each] for first in range(each)]
        sizes = [np.ptp(line, axis=0) for line in lines]
        turns = [np.abs(np.diff(line, axis=0)).sum(axis=0) for line in lines]
        return float(np.mean([ratio(turn, size) for turn, size in zip(turns, sizes, strict=True)]))

    possible = [each for each in _EACH if n % each == 0 and n >= 3 * each] or [1]
    roughness = {each: rough(each) for each in possible}
    least = min(roughness.values())
    each = next(each for each in possible if roughness[each] <= 1.5 * least)
    votes = np.bincount([index % each for index in marked], minlength=each)
    sizes = [float(np.abs(shapes[first::each]).max()) for first in range(each)]
    first = int(np.argmax(votes)) if marked else int(np.argmax(sizes))
    line = list(range(first, n, each))
    few = np.unique(np.linspace(0, len(line) - 1, _MOST).round().astype(int)).tolist()
    return sorted({*(line[i] for i in few), *(i for i in line if i in marked)})
