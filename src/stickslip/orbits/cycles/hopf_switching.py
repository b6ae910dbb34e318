"""The cycles that emanate from a Hopf point.

On the centre manifold the cycle of amplitude ε is y + 2ε Re(q e^{iωt}) up to O(ε²), at a parameter
O(ε²) from the Hopf point. So the amplitude is given and the parameter found; cycles further out
have amplitudes like the square root of the distance.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import ConvergenceError, DeclarationError, StickslipError
from stickslip.model.system import System
from stickslip.motion.problem import Problem, pose
from stickslip.numerics.levels import COMPUTED_ZERO, FINE_RANK, NO_GROWTH
from stickslip.orbits.continuation.bracket import zero_near
from stickslip.orbits.continuation.branch import SpecialPoint
from stickslip.orbits.equilibria.normal_form import critical_pair
from stickslip.orbits.fields.mode_field import Piece, Pieces
from stickslip.orbits.fields.symmetry import Surroundings
from stickslip.orbits.return_map.damped_newton import Closed, converge
from stickslip.orbits.return_map.families import check_isolated
from stickslip.orbits.return_map.following import follow_state
from stickslip.orbits.return_map.held import Held, held_positions
from stickslip.orbits.return_map.shooting import Setting, Shooting, parameter_values, with_value
from stickslip.orbits.return_map.stations import make_station

_SMALL = 0.01  # amplitude of the first cycle relative to the equilibrium
_INSIDE = 0.3  # … and to the distance from the next switching boundary
_STRETCH = 2.0  # amplitudes grow by at most this factor from one cycle to the next
_CORRECTED = 1e-9  # correction, in units of the state, at which Newton's method has converged
_ROOM = 1e-6  # smallest amplitude up to the next guard for a first cycle, in units of the state


@dataclass(frozen=True)
class _Seed:
    """A cycle near the equilibrium it surrounds."""

    problem: Problem
    equilibrium: Array
    state: Array
    period: float


def emanating_cycle(
    system: System, point: SpecialPoint, parameters: Mapping[str, float] | None
) -> Closed:
    """A cycle of the family that emerges from a Hopf point.

    Raises
    ------
    DeclarationError
        If the point is not a Hopf point, or is on a switching boundary, or the parameter is
        ambiguous.
    ConvergenceError
        If there is no such cycle at the given value of the parameter.
    """
    if point.kind != "Hopf":
        raise DeclarationError(
            "start", f"a special point of kind '{point.kind}'", "Give a point of kind 'Hopf'"
        )
    name = _parameter(point, parameters)
    seed = _small_cycle(pose(system, point.parameters), point, name)
    if not parameters or name not in parameters:
        return _closed(seed, point)
    return _grown(seed, point, name, float(parameters[name]))


def _parameter(point: SpecialPoint, parameters: Mapping[str, float] | None) -> str:
    """The parameter of the branch that the point is on."""
    names = [name for name, value in point.parameters.items() if value == point.value]
    others = {
        n for n, v in (parameters or {}).items() if n not in names and v != point.parameters.get(n)
    }
    if others:
        raise DeclarationError(
            f"parameters.{min(others)}",
            "the Hopf point is not at this value",
            f"Change only the parameter of its branch ({' or '.join(names)})",
        )
    chosen = [n for n in names if n in (parameters or {})] or names
    if len(chosen) != 1:
        raise DeclarationError(
            "start",
            "several parameters have the value of the Hopf point",
            "Change the value of one parameter",
        )
    return chosen[0]


def _piece(pieces: Pieces, point: SpecialPoint) -> Piece:
    return pieces(np.array(point.mode, np.int8), np.array(point.region, np.int8))


def _small_cycle(problem: Problem, point: SpecialPoint, name: str) -> _Seed:
    """The cycle of a small amplitude, and the parameter at which it is one."""
    pieces = Pieces(problem.compiled.equations, name)
    piece = _piece(pieces, point)
    p = parameter_values(problem)
    y = np.array([point.state[x] for x in problem.system.declaration.state])
    rate, q = critical_pair(piece.jacobian(np.zeros(1), y[:, None], p)[0][:, : len(y)])
    # Amplitudes count against the large components of the state: one that rests at 0 has no scale
    # of its own.
    along = float(np.abs(q) @ np.abs(y))
    q = q * (y @ y) / along if along > 0.0 else q / np.max(np.abs(q))
    amplitude = _amplitude(piece, y, q, p)
    period = 2.0 * np.pi / rate.imag
    seed = _Seed(problem, y, y + amplitude * q.real, period)
    shooting = _shooting(seed, pieces, point, amplitude * np.abs(q))
    x = shooting.guess(period, period * piece.rates(0.0, y, p))
    radial = np.zeros(len(x))
    radial[: shooting.time] = shooting.stations[0].chart @ q.real
    units = shooting.units(x, abs(point.value) or 1.0)
    for _ in range(12):
        orbit = shooting.orbit(x)
        step = np.linalg.lstsq(
            np.vstack([orbit.J, radial]) * units, np.append(orbit.F, 0.0), rcond=None
        )[0]
        x = x - units * step
        if np.linalg.norm(step) < _CORRECTED:
            problem = with_value(problem, name, float(x[-1]))
            station = shooting.stations[0]
            state = station.place(x[: shooting.time], 0.0, parameter_values(problem)).state
            return _Seed(
                problem,
                _settled(piece, y, problem, shooting.symmetry.shifts),
                state,
                float(x[shooting.time]),
            )
    raise ConvergenceError(
        "cycles at the Hopf point", "Newton's method does not converge", "Check the Hopf point"
    )


def _amplitude(piece: Piece, y: Array, q: Array, p: Array) -> float:
    """Size of the first cycle: small, and away from every switching boundary."""
    guards = piece.leave(0.0, y, p)
    reach = np.abs(guards.slopes[:, : len(y)] @ q)
    # On the cycle y + 2ε Re(q e^{iωt}) a guard changes, to first order, by at most 2ε · reach.
    room = np.min(guards.value[reach > 0.0] / reach[reach > 0.0], initial=np.inf)
    if not room > _ROOM:
        raise DeclarationError(
            "start",
            "the Hopf point is on a switching boundary",
            "The normal form is not defined there",
        )
    return float(min(_SMALL, _INSIDE * room))


def _settled(piece: Piece, y: Array, problem: Problem, shifts: Array) -> Array:
    """The equilibrium near a state, at rest up to translations."""
    p, n = parameter_values(problem), len(y)
    across = np.eye(n) - shifts @ np.linalg.pinv(shifts) if shifts.shape[1] else np.eye(n)
    # Newton's method where translations neither count nor are moved along.
    for _ in range(6):
        J = piece.jacobian(np.zeros(1), y[:, None], p)[0][:, :n]
        y = y - np.linalg.lstsq(across @ J, across @ piece.rates(0.0, y, p), rcond=FINE_RANK)[0]
    return y


def _shooting(seed: _Seed, pieces: Pieces, point: SpecialPoint, sizes: Array) -> Shooting:
    sizes = np.maximum(sizes, 1e-3 * np.max(sizes))
    piece = _piece(pieces, point)
    p = parameter_values(seed.problem)
    n = len(sizes)
    signs = np.random.default_rng(0).uniform(-1.0, 1.0, (8, n))
    around = Surroundings([piece] * 8, np.zeros(8), seed.equilibrium + signs * sizes, sizes)
    # A small cycle goes around no cell.
    symmetry = around.symmetry(p, None, np.zeros((n, 0)))
    setting = Setting(symmetry, around, None, 1, np.zeros(0), sizes, _held(seed))
    return Shooting(
        seed.problem, pieces, [make_station(0.0, piece, 0.0, seed.state, p, sizes)], 0.0, setting
    )


def _held(seed: _Seed) -> tuple[Held, ...]:
    """Positions that are constant on the first cycle."""
    return held_positions(follow_state(seed.problem, 0.0, seed.period, seed.state))


@dataclass(frozen=True)
class Vanishing:
    """A Hopf point to which cycles shrink.

    Attributes
    ----------
    value : float
        Of the parameter.
    equilibrium : array, shape (n,)
    growth : float
        Residual real part of its eigenvalue, relative to the imaginary part.
    moves : float
        Residual rates of the state there, relative to those of the small cycle.
    """

    value: float
    equilibrium: Array
    growth: float
    moves: float


def shrinks_to(closed: Closed, parameter: str, value: float) -> Vanishing | None:
    """The Hopf point near a value of a parameter to which a small cycle shrinks.

    None if the equilibrium in the middle of the cycle has no such point nearby.
    """
    piece = closed.shooting.stations[0].piece
    problem = closed.orbit.problem
    here = problem.parameters[parameter]
    y = np.mean(closed.samples(64), axis=0)
    frequency = 2.0 * np.pi / closed.orbit.period

    def pair(value: float) -> tuple[complex, Array]:
        there = with_value(problem, parameter, value)
        settled = _settled(piece, y, there, closed.shooting.symmetry.shifts)
        J = piece.jacobian(np.zeros(1), settled[:, None], parameter_values(there))[0][:, : len(y)]
        return critical_pair(J)[0], settled

    try:
        found = zero_near(lambda value: pair(value)[0].real, here, value)
        if found is None:
            return None
        at, settled = pair(found)
    except (ZeroDivisionError, np.linalg.LinAlgError, StickslipError):
        return None
    # The eigenvalues that cross the axis have to turn with the frequency of the cycle.
    if not (abs(at.imag / frequency - 1.0) < 0.1 and abs(at.real) < NO_GROWTH * frequency):
        return None
    there = parameter_values(with_value(problem, parameter, found))
    shifts = closed.shooting.symmetry.shifts
    rates = piece.rates(0.0, settled, there)
    # A steady drift along a translation does not violate the equilibrium conditions.
    rates = rates - shifts @ (np.linalg.pinv(shifts) @ rates) if shifts.shape[1] else rates
    moves = float(np.max(np.abs(rates) / (frequency * closed.shooting.setting.sizes)))
    return Vanishing(found, settled, abs(at.real / at.imag), moves)


def _closed(seed: _Seed, point: SpecialPoint) -> Closed:
    pieces = Pieces(seed.problem.compiled.equations)
    shooting = _shooting(seed, pieces, point, _sizes(seed))
    drift = _piece(pieces, point).rates(0.0, seed.equilibrium, parameter_values(seed.problem))
    closed = converge(shooting, shooting.guess(seed.period, seed.period * drift))
    check_isolated(closed)
    if closed.extent < 0.1:
        raise ConvergenceError(
            "cycles at the Hopf point", "the cycle shrinks to the equilibrium", ""
        )
    return closed


def _sizes(seed: _Seed) -> Array:
    apart = np.abs(seed.state - seed.equilibrium)
    return np.full(len(apart), np.max(apart))


def _grown(seed: _Seed, point: SpecialPoint, name: str, value: float) -> Closed:
    """The cycle at a value of the parameter, from a small one."""
    here = seed.problem.parameters[name]
    if (value - point.value) * (here - point.value) <= 0.0:
        side = "below" if here < point.value else "above"
        raise ConvergenceError(
            f"cycles of {seed.problem.system.name} from the Hopf point at {name} = "
            f"{point.value:.9g}",
            f"they exist {side} this value, not at {name} = {value:.9g}",
            f"Choose a value {side} it; near a subcritical point continue the branch with "
            "continue_cycle",
        )
    closed = _closed(seed, point)
    piece = _piece(Pieces(seed.problem.compiled.equations), point)
    while here != value:
        part = (value - point.value) / (here - point.value)
        stretch = float(np.clip(np.sqrt(part), 1.0 / _STRETCH, _STRETCH))
        here = value if part == stretch**2 else point.value + stretch**2 * (here - point.value)
        here = value if abs(here - value) <= COMPUTED_ZERO * abs(value) else here
        problem = with_value(seed.problem, name, here)
        equilibrium = _settled(piece, seed.equilibrium, problem, closed.shooting.symmetry.shifts)
        state = equilibrium + stretch * (seed.state - seed.equilibrium)
        try:
            closed = _closed(_Seed(problem, equilibrium, state, seed.period), point)
        except StickslipError as failure:
            reached = seed.problem.parameters[name]
            raise ConvergenceError(
                f"the cycle of {seed.problem.system.name} at {name} = {value:.9g}",
                f"the family could be continued from the Hopf point only to {name} = "
                f"{reached:.9g} ({failure})",
                "Continue the branch with continue_cycle",
            ) from None
        seed = replace(
            seed,
            problem=problem,
            equilibrium=equilibrium,
            state=closed.orbit.legs[0].place.state,
            period=closed.orbit.period,
        )
    return closed
