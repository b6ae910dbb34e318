"""The largest Lyapunov exponent of an aperiodic motion."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.orbits.fields.engine.tables import TOGETHER
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.fields.variational import variation
from stickslip.orbits.return_map.recurrence import stretch

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory


_STEPS = 64  # steps of the motion between two normalisations
_MOST = 256  # largest number of stretches, counted from the end
_BLOCKS = 8  # number of parts of the motion whose exponents are compared
_CERTAIN = 3.0  # number of standard errors by which an exponent has to be positive
_FORGOTTEN = 1e-12  # size of a change of unit size after sticking contacts have removed it


@dataclass(frozen=True)
class Exponent:
    """A largest Lyapunov exponent with its standard error, over some time."""

    value: float
    error: float
    time: float

    @property
    def irregular(self) -> bool:
        """Whether neighbouring motions certainly separate."""
        return self.value > _CERTAIN * self.error and self.value * self.time > _CERTAIN

    def __str__(self) -> str:
        return f"{self.value:.2g} ± {self.error:.1g}"


def largest_exponent(motion: Trajectory, pieces: Pieces, sizes: Array) -> Exponent | None:
    """Largest Lyapunov exponent along the end of a motion; None if all perturbations vanish in
    finite time.

    Parameters
    ----------
    sizes : array, shape (n,)
        Units of the components.
    """
    change = None
    rng = np.random.default_rng(0)
    growth = []
    lengths = []
    for a, b in pairwise(_ends(motion)):
        part = stretch(motion, a, b)
        if change is None:
            change = _admissible(part, pieces, sizes, rng)
        later = variation(part, pieces, change[:, None]).matrix[: len(sizes), 0]
        size = float(np.linalg.norm(later / sizes))
        if not size > _FORGOTTEN:
            change = None  # sticking contacts have removed the entire change
            continue
        growth.append(np.log(size))
        lengths.append(part.t_span[1] - part.t_span[0])
        change = later / size
    if len(growth) < 2 * _BLOCKS:
        return None
    sums = [np.sum(block) for block in np.array_split(growth, _BLOCKS)]
    times = [np.sum(block) for block in np.array_split(lengths, _BLOCKS)]
    # The standard error is that of block means, since successive growth rates are correlated.
    rates = np.array(sums) / np.array(times)
    return Exponent(
        sum(sums) / sum(times), float(np.std(rates, ddof=1) / np.sqrt(_BLOCKS)), float(sum(times))
    )


def _ends(motion: Trajectory) -> list[int]:
    """Knots between which a perturbation is followed: after an event, never between coincident
    events."""
    time = motion.knots.time
    apart = np.append(np.diff(time) > TOGETHER * (time[-1] - time[0]), True)
    ends = []
    last = len(time)
    for i in range(len(time) - 1, -1, -1):
        if (apart[i] and last - i >= _STEPS) or i == len(time) - 1:
            ends.append(i)
            last = i
        if len(ends) > _MOST:
            break
    return ends[::-1]


def _admissible(part: Trajectory, pieces: Pieces, sizes: Array, rng: np.random.Generator) -> Array:
    """A perturbation of the first state that satisfies the constraints there, of size 1."""
    k = part.knots
    p = np.array([part.parameters[name] for name in part.system.parameters])
    slopes = (
        pieces(k.mode[0], k.region[0])
        .bounds(float(k.time[0]), k.state[0], p)
        .slopes[:, : len(sizes)]
        * sizes
    )
    change = rng.normal(size=len(sizes))
    if len(slopes):
        # The projection onto the null space of the constraints, in units of the sizes.
        change = change - np.linalg.pinv(slopes) @ (slopes @ change)
    return sizes * change / np.linalg.norm(change)
