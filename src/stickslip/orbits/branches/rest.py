"""Cycles of driven systems that shrink to rest.

In the limit all contacts stick, and the state is constant. Each slip shrinks to an instant at which
the force of its contact, as a function of time, touches the threshold. These conditions determine
the position of rest and the value of the parameter.

At a distance ε from this value the force exceeds the threshold by at most ε, for a time of the
order √ε: velocities are of the order ε^(3/2), displacements of the order ε². Where friction drops
at once when a slip begins, slips have a smallest length, and there is no such limit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import StickslipError
from stickslip.numerics.levels import FEW_ROUNDINGS
from stickslip.orbits.fields.mode_field import Piece, Pieces
from stickslip.orbits.return_map.damped_newton import Closed
from stickslip.orbits.return_map.recurrence import segments
from stickslip.orbits.return_map.shooting import parameter_values
from stickslip.orbits.return_map.stations import Station, make_station

_MOST_STEPS = 20
_SOLVED = 1e-14  # a margin this small, relative to the thresholds, is zero
_FAR = 0.1  # largest change of the parameter, relative to its range
# largest change of the state during a period of rest, in units of the cycle, and at the rates with
# which a slip would begin
_STILL, _BEGINS = 1e-9, 1e-6
LEAST_EXPONENT = 1.4
"""Smallest exponent with which the sizes of cycles may vanish with the distance from the limit: 3/2
but for the size of the smallest cycles."""


@dataclass(frozen=True)
class Rest:
    """The limit of cycles that shrink to rest.

    Attributes
    ----------
    value : float
        Of the parameter.
    state : array, shape (n,)
    margin : float
        Largest distance of a force from its threshold where it touches it, relative to both
        thresholds.
    moves : float
        Change of the state in a period, in units of the cycle.
    """

    value: float
    state: Array
    margin: float
    moves: float


@dataclass(frozen=True)
class _Touch:
    """A force that touches its threshold: the slip that follows, number of its guard and of the
    opposite one, and when, in parts of the period."""

    slip: Piece
    guard: int
    opposite: int
    begin: float
    end: float


def shrinks_to_rest(closed: Closed, pieces: Pieces, parameter: str, width: float) -> Rest | None:
    """The state of rest near a small cycle of a driven system; None if there is none.

    Parameters
    ----------
    pieces : Pieces
        With the parameter free.
    width : float
        Range of the parameter.
    """
    motion = closed.orbit.motion
    k = motion.knots
    found = segments(motion)
    modes = [k.mode[a] for a, _ in found]
    still = [i for i, mode in enumerate(modes) if not np.any(mode)]
    if not still or not closed.shooting.symmetry.driven:
        return None
    a, b = found[still[0]]
    stuck = pieces(k.mode[a], k.region[a])
    touches = _touches(closed, pieces, stuck)
    if not touches:
        return None
    p, y = parameter_values(closed.orbit.problem), k.state[b]
    sizes = closed.shooting.setting.sizes
    station = make_station(0.0, stuck, float(k.time[b]), y, p, sizes)
    try:
        return _solved(closed, station, touches, parameter, width)
    except (StickslipError, ArithmeticError, np.linalg.LinAlgError):
        return None


def _touches(closed: Closed, pieces: Pieces, stuck: Piece) -> list[_Touch]:
    """The forces that reach their thresholds, from the slips of a cycle; none if it has other
    phases than these and rest."""
    motion = closed.orbit.motion
    k = motion.knots
    found = segments(motion)
    kinks = k.region.shape[1]
    touches = list[_Touch]()
    start, period = float(k.time[0]), closed.orbit.period
    for a, b in found[:-1] if len(found) > 1 else found:
        slipping = np.flatnonzero(k.mode[a])
        if np.any(k.region[a] != k.region[0]) or len(slipping) > 1:
            return []
        for contact in slipping:
            own = np.flatnonzero(stuck.switches == kinks + contact)
            to = int(k.mode[a, contact])
            guard = [g for g in own if stuck.field.guards[g].to == to]
            other = [g for g in own if stuck.field.guards[g].to == -to]
            if len(guard) != 1 or len(other) != 1:
                return []
            length = float(k.time[b] - k.time[a])
            times = np.array([k.time[a] - length, k.time[b] + length]) - start
            slip = pieces(k.mode[a], k.region[a])
            touches.append(_Touch(slip, int(guard[0]), int(other[0]), *(times / period).tolist()))
    return touches


def _solved(
    closed: Closed, station: Station, touches: list[_Touch], parameter: str, width: float
) -> Rest | None:
    """Newton's method for the position of rest and the parameter."""
    from scipy.optimize import minimize_scalar

    shooting, problem = closed.shooting, closed.orbit.problem
    piece, setting = station.piece, shooting.setting
    assert setting.clock is not None
    names = problem.system.parameters
    first = problem.parameters[parameter]
    value = first
    xi = np.zeros(station.basis.shape[1])
    n = len(station.origin)
    for _ in range(_MOST_STEPS):
        given = {**problem.parameters, parameter: value}
        p = np.array([given[name] for name in names])
        period = setting.turns * setting.clock.period(given)
        place = station.place(xi, shooting.start, p)
        y = place.state
        margins, rows, begins = list[float](), list[Array](), list[float]()
        for touch in touches:

            def guard(t: float, touch: _Touch = touch) -> float:
                return float(piece.leave(t, y, p).value[touch.guard])

            ends = [shooting.start + part * period for part in (touch.begin, touch.end)]
            least: Any = minimize_scalar(
                guard, bounds=ends, method="bounded", options={"xatol": FEW_ROUNDINGS * period}
            )
            here = piece.leave(float(least.x), y, p)
            both = float(here.value[touch.guard] + here.value[touch.opposite])
            slopes = here.slopes[touch.guard] / both
            margins.append(float(here.value[touch.guard]) / both)
            by_value = slopes[n] + slopes[:n] @ place.by_parameter
            rows.append(np.append(slopes[:n] @ place.directions, width * by_value))
            begin = np.abs(touch.slip.rates(float(least.x), y, p)) / setting.sizes
            begins.append(float(np.max(begin)) * period)
        moves = np.max(np.abs(piece.rates(shooting.start, y, p)) / setting.sizes) * period
        worst = max(map(abs, margins))
        if worst <= _SOLVED:
            break
        step = np.linalg.lstsq(np.array(rows), -np.array(margins), rcond=None)[0]
        xi = xi + step[:-1]
        value = value + width * float(step[-1])
        if not abs(value - first) <= _FAR * width:
            return None
    if not moves <= _STILL or not max(begins) <= _BEGINS:
        return None
    return Rest(value, y, worst, float(moves))
