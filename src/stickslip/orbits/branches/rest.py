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
from typing import Any, NamedTuple

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


class _Conditions(NamedTuple):
    """The conditions of rest for a position and a value of the parameter.

    Attributes
    ----------
    margins : array, shape (touches,)
        Smallest distances of forces from their thresholds, relative to both thresholds.
    slopes : array, shape (touches, unknowns)
    moves, begins : float
        Changes of the state at the rates of rest, and of the slips where they begin, during a
        period.
    """

    state: Array
    margins: Array
    slopes: Array
    moves: float
    begins: float


def _conditions(
    closed: Closed, station: Station, touches: list[_Touch], xi: Array, given: dict[str, float]
) -> _Conditions:
    """The conditions of rest at some coordinates, for some parameters."""
    shooting, setting = closed.shooting, closed.shooting.setting
    assert setting.clock is not None
    piece, start = station.piece, shooting.start
    p = np.array([given[name] for name in closed.orbit.problem.system.parameters])
    period = setting.turns * setting.clock.period(given)
    place = station.place(xi, start, p)
    y, n = place.state, len(station.origin)
    margins, slopes, begins = list[float](), list[Array](), list[float]()
    for touch in touches:
        t = _least(
            piece, touch.guard, start + period * touch.begin, start + period * touch.end, y, p
        )
        here = piece.leave(t, y, p)
        both = float(here.value[touch.guard] + here.value[touch.opposite])
        margins.append(float(here.value[touch.guard]) / both)
        by_state, by_value = here.slopes[touch.guard, :n] / both, here.slopes[touch.guard, n] / both
        by_value = by_value + by_state @ place.by_parameter
        slopes.append(np.append(by_state @ place.directions, by_value))
        begins.append(float(np.max(np.abs(touch.slip.rates(t, y, p)) / setting.sizes)) * period)
    moves = float(np.max(np.abs(piece.rates(start, y, p)) / setting.sizes)) * period
    return _Conditions(y, np.array(margins), np.array(slopes), moves, max(begins))


def _least(piece: Piece, guard: int, begin: float, end: float, y: Array, p: Array) -> float:
    """When a guard is smallest at a constant state."""
    from scipy.optimize import minimize_scalar

    found: Any = minimize_scalar(
        lambda t: float(piece.leave(t, y, p).value[guard]),
        bounds=(begin, end),
        method="bounded",
        options={"xatol": FEW_ROUNDINGS * (end - begin)},
    )
    return float(found.x)


def _solved(
    closed: Closed, station: Station, touches: list[_Touch], parameter: str, width: float
) -> Rest | None:
    """Newton's method for the position of rest and the parameter."""
    given = dict(closed.orbit.problem.parameters)
    first = given[parameter]
    xi = np.zeros(station.basis.shape[1])
    units = np.append(np.ones(len(xi)), width)
    found = _conditions(closed, station, touches, xi, given)
    for _ in range(_MOST_STEPS):
        if np.max(np.abs(found.margins)) <= _SOLVED:
            break
        step = units * np.linalg.lstsq(found.slopes * units, -found.margins, rcond=None)[0]
        xi = xi + step[:-1]
        given[parameter] += float(step[-1])
        if not abs(given[parameter] - first) <= _FAR * width:
            return None
        found = _conditions(closed, station, touches, xi, given)
    if not found.moves <= _STILL or not found.begins <= _BEGINS:
        return None
    worst = float(np.max(np.abs(found.margins)))
    return Rest(given[parameter], found.state, worst, found.moves)
