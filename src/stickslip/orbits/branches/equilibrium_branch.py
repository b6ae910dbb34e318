"""Branches of equilibria in a parameter: folds, Hopf points, branch points, boundary
equilibria."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arguments import validated
from stickslip.certificates import Certificate, Residual, within, worst
from stickslip.equations.derive import MotionEquations
from stickslip.equations.field import Guard, switched
from stickslip.equations.mode_fields import mode_field
from stickslip.errors import ConvergenceError, DeclarationError, StickslipError
from stickslip.model.declaration import check_initial
from stickslip.model.entries.polynomials import ends_of_tables
from stickslip.model.system import System
from stickslip.motion.problem import checked_values
from stickslip.numerics.levels import NEARLY_SOLVED, RANK, ROUNDED_SUM
from stickslip.numerics.ratios import ratio
from stickslip.orbits.branches.equilibria_along import Station, dataset
from stickslip.orbits.continuation.branch import KNOT, SOLVED_TO, Branch, SpecialPoint, with_special
from stickslip.orbits.continuation.corrector import Lost
from stickslip.orbits.continuation.driver import (
    CurveProblem,
    Start,
    Tell,
    both_ways,
    follow_branch,
    joined,
    named_points,
    told_of_points,
)
from stickslip.orbits.continuation.path import (
    Ending,
    Path,
    Point,
    StepControl,
    Test,
    in_range,
    ranges,
)
from stickslip.orbits.equilibria.candidates import autonomous
from stickslip.orbits.equilibria.certificate import certify_equilibria, certify_equilibrium
from stickslip.orbits.equilibria.equilibrium import Equilibrium, describe_guard
from stickslip.orbits.equilibria.finding import equilibria
from stickslip.orbits.equilibria.normal_form import Derivatives, hopf
from stickslip.orbits.fields.steady import (
    Array,
    ResidualFunction,
    Steady,
    invariant_directions,
)
from stickslip.stopping.scopes import limited
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.pieces import is_smooth_knot

if TYPE_CHECKING:
    pass

_STEPS = StepControl(first=0.005, largest=0.02)
MOST_PIECES = 50
"""Modes and regions that a branch of equilibria passes at most."""
_AHEAD = 1e-3  # fraction of a first step over which the guards beyond a boundary are compared
_REAL = 1e-8  # imaginary part, relative to an eigenvalue, that is rounding: √ε where two meet


@validated
def continue_equilibrium(
    system: System,
    parameter: str,
    span: tuple[float, float],
    *,
    start: Equilibrium | Mapping[str, float] | None = None,
    parameters: Mapping[str, float] | None = None,
    steps: StepControl | None = None,
    time_limit: float | None = None,
    progress: Tell | None = None,
) -> Branch:
    """Continue an equilibrium in a parameter.

    Parameters
    ----------
    system : System
    parameter : str
        The parameter that changes.
    span : (float, float)
        Its range.
    start : Equilibrium or mapping of str to float, optional
        Start of the branch, with its parameters; or a state near an equilibrium. By default the
        first isolated equilibrium at the value in `parameters`, or at the middle or an end of the
        range.
    parameters : mapping of str to float, optional
        Values that replace the defaults.
    steps : StepControl, optional
    time_limit : float, optional
        Wall-clock limit in seconds; the branch found so far is returned.
    progress : callable, optional
        Called with every new point (``.side``, ``.values``). By default a progress bar is shown.

    Returns
    -------
    Branch
        In both directions from the start, through folds and mode changes. ``special`` has the kinds
        ``"fold"``, ``"Hopf"`` (with ``frequency`` and ``lyapunov``, the first Lyapunov coefficient,
        see :class:`~stickslip.orbits.equilibria.normal_form.Hopf`), ``"branch point"`` and
        ``"boundary equilibrium"``, or ``"knot"`` at one of a smooth table.

    Raises
    ------
    DeclarationError
        If an argument is wrong, or the system depends on time.
    ConvergenceError
        If no isolated equilibrium is found as a start.
    """
    equations = autonomous(system)
    values = checked_values(system, parameters)
    low, high = checked_range(system, parameter, span)
    first = _start(system, parameter, (low, high), start, values)
    values = first.parameters
    origin = np.array([float(v) for v in first.state.values()])
    follower = _Follower(
        equations,
        values,
        parameter,
        (low, high),
        invariant_directions(equations, values, origin),
        steps or _STEPS,
    )
    x = np.append(origin, values[parameter])
    with (
        limited(time_limit, f"a branch of {system.name}"),
        told_of_points(progress, "following the equilibrium") as tell,
    ):
        back, forth, ends = both_ways(lambda sign: follower.follow(first, x, sign, tell), 1.0)
    return follower.branch(system, back, forth, ends)


def checked_range(system: System, parameter: str, span: tuple[float, float]) -> tuple[float, float]:
    """Check the range of a parameter, and return its ends."""
    try:
        low, high = (float(v) for v in span)
    except (TypeError, ValueError, OverflowError):
        raise DeclarationError(parameter, f"{span!r} is not a range", "Give (low, high)") from None
    for end in (low, high):
        system.declaration.check_range(parameter, end)
    if not low < high:
        raise DeclarationError(parameter, f"({low:g}, {high:g}) is not a range", "Give low < high")
    return low, high


def _start(
    system: System,
    parameter: str,
    span: tuple[float, float],
    start: Equilibrium | Mapping[str, float] | None,
    values: dict[str, float],
) -> Equilibrium:
    low, high = span
    if isinstance(start, Equilibrium):
        if not low <= start.parameters[parameter] <= high:
            raise DeclarationError(
                "start",
                f"the start is at {parameter} = {start.parameters[parameter]:g}, outside "
                f"({low:g}, {high:g})",
                "Choose a start in the range, or another range",
            )
        return start
    if start is not None:
        for name, value in start.items():
            check_initial(system.declaration, name, value)
        system = replace(system, initial={**system.initial, **start})
    inside = [values[parameter]] if low <= values[parameter] <= high else []
    tried: dict[str, str] = {}
    for value in [*inside, 0.5 * (low + high), low, high]:
        found = equilibria(system, parameters={**values, parameter: value})
        candidates = [e for e in found.isolated if not e.boundary]
        if candidates and start is not None:
            return min(candidates, key=lambda e: _distance(e, start))
        if candidates:
            return candidates[0]
        why = (
            "only sets of equilibria in stick"
            if found.sets
            else found.nearest or "no candidate came close"
        )
        tried[f"{parameter} = {value:g}"] = why
    raise ConvergenceError(
        f"equilibria of {system.name}",
        "no isolated equilibrium was found as a start; "
        + "; ".join(f"{at}: {why}" for at, why in tried.items()),
        "Choose another range, or give a start",
    )


def _distance(e: Equilibrium, near: Mapping[str, float]) -> float:
    return sum(((e.state[x] - v) / (1.0 + abs(v))) ** 2 for x, v in near.items())


@dataclass(frozen=True)
class _Piece:
    """A part of a branch within one mode and region, with the certificates of its points and error
    bounds of their eigenvalues."""

    steady: Steady
    path: Path
    certified: list[tuple[Certificate, float]]


class _Follower:
    def __init__(
        self,
        equations: MotionEquations,
        values: dict[str, float],
        parameter: str,
        span: tuple[float, float],
        invariant: Array,
        steps: StepControl,
    ) -> None:
        self.eq = equations
        self.values = values
        self.parameter = parameter
        self.span = span
        self.invariant, self.steps = invariant, steps
        self.width = span[1] - span[0]
        self.contacts = equations.labels
        self.tangent: Array | None = None  # at the start, in the direction that came first

    # -- following ---------------------------------------------------------------------------------

    def follow(
        self, first: Equilibrium, x: Array, sign: float, tell: Tell
    ) -> tuple[list[_Piece], Ending]:
        """The pieces in one direction from the start, and the end.

        Raises
        ------
        StickslipError
            If there is no equilibrium near the start.
        """
        pieces: list[_Piece] = []

        def onward(start: Start[Steady], path: Path) -> Start[Steady] | Ending:
            certified = self._certified(start.of, path)
            if start.problem.accept is None and not all(_solved(found) for found, _ in certified):
                # Then every point is measured before the next one is computed.
                return self._start(start.of, start.x, start.towards, careful=True)
            piece = _Piece(start.of, path, certified)
            pieces.append(piece)
            guard = self._guard_that_ended(piece)
            end = path.points[-1]
            beyond = None if guard is None else self._beyond(start.of, guard, end)
            if beyond is None or len(pieces) == MOST_PIECES:
                return self._ending(piece)
            return self._start(beyond[0], end.x, beyond[1])

        steady = self._steady(first.mode, first.region, x[:-1])
        towards = np.append(np.zeros(len(x) - 1), sign)
        start = self._start(steady, x, towards if self.tangent is None else -self.tangent)
        found = named_points(tell, sign, (*first.state, self.parameter))
        ending = follow_branch(start, onward, "no further equilibrium was found", found)
        if not pieces:
            raise StickslipError(ending.text)
        self.tangent = pieces[0].path.points[0].tangent
        return pieces, ending

    def _steady(self, mode: tuple[int, ...], region: tuple[int, ...], origin: Array) -> Steady:
        return Steady(mode_field(self.eq, mode, region), self.values, self.invariant, origin)

    def _certified(self, steady: Steady, path: Path) -> list[tuple[Certificate, float]]:
        """Certificates of the points of a path; each is compared with the previous point."""
        points = np.array([self._point(steady, point.x) for point in path.points]).T
        beside = np.roll(points, 1, axis=1)
        beside[:, 0] = points[:, min(1, points.shape[1] - 1)]
        return certify_equilibria(steady, points, beside)

    def _start(
        self, steady: Steady, x: Array, towards: Array, careful: bool = False
    ) -> Start[Steady]:
        """The part of the branch in one mode."""
        floor = steady.units(x, {self.parameter: self.span})
        problem = CurveProblem(
            steady.residual(self.parameter),
            lambda x: self._scale(x, floor),
            lambda x, tangent: self._tests(steady, x, tangent),
            dict.fromkeys(range(len(steady.field.guards)), "boundary equilibrium"),
            ranges({self.parameter: self.span}),
            (lambda last, new: self._accept(steady, last, new)) if careful else None,
        )
        return Start(steady, problem, x, towards, self.steps)

    def _accept(self, steady: Steady, last: Point, new: Point) -> None:
        """Check that a point is a certified equilibrium.

        Raises
        ------
        Lost
            If it is not.
        """
        found = certify_equilibrium(
            steady, self._point(steady, new.x), beside=self._point(steady, last.x)
        )[0]
        if not _solved(found):
            raise Lost(f"the next equilibrium is {found.verdict}")

    def _scale(self, x: Array, floor: Array) -> Array:
        # The root of their number, so that the state as a whole counts as much as the parameter.
        units = np.empty(len(x))
        units[:-1] = math.sqrt(len(floor)) * np.maximum(np.abs(x[:-1]), floor)
        units[-1] = self.width
        return units

    def _point(self, steady: Steady, x: Array) -> Array:
        return steady.point(x[:-1], {self.parameter: x[-1]})

    def _tests(self, steady: Steady, x: Array, tangent: Array) -> dict[Test, float]:
        point = self._point(steady, x)
        eigenvalues = steady.eigenvalues(point)
        guards = steady.guards(point)
        slope = tangent[-1]
        with np.errstate(all="ignore"):
            # An eigenvalue passes through 0 at folds and branch points; the quotient has no zero at
            # folds.
            branching = (
                float(np.prod(eigenvalues / np.max(np.abs(eigenvalues))).real / slope)
                if len(eigenvalues)
                else 1.0
            )
        return {
            "fold": slope,
            "branch point": branching,
            "Hopf": hopf_test(eigenvalues),
            **{i: float(g) for i, g in enumerate(guards)},
        }

    def _guard_that_ended(self, piece: _Piece) -> Guard | None:
        test = piece.path.ended.test
        return piece.steady.field.guards[test] if isinstance(test, int) else None

    def _beyond(self, steady: Steady, guard: Guard, end: Point) -> tuple[Steady, Array] | None:
        """The field on the other side of a guard and the direction in which the equilibrium
        continues, if it does."""
        mode, region = switched(steady.field, guard.switch, guard.to)
        try:
            other = self._steady(mode, region, end.x[:-1])
        except ZeroDivisionError:
            return None
        F, J = other.residual(self.parameter)(end.x)
        if not (np.all(np.isfinite(F)) and np.all(np.isfinite(J))):
            return None  # a table ends there
        tangent = tangent_beyond(
            other,
            guard,
            lambda x: self._point(other, x),
            (end.x, F, J),
            self._scale(end.x, other.units(end.x, {self.parameter: self.span})),
            np.full(len(end.x), self.width),
            self.steps,
        )
        return None if tangent is None else (other, tangent)

    # -- results -----------------------------------------------------------------------------------

    def branch(
        self,
        system: System,
        back: list[_Piece],
        forth: list[_Piece],
        ends: tuple[Ending, Ending],
    ) -> Branch:
        """The two directions as one branch, from the far end of the first to that of the second."""
        stations = joined(self._stations(back), self._stations(forth))
        special = [
            s
            for i, station in enumerate(stations)
            for kind in station.kinds
            for s in self._special(station, kind, i)
        ]
        certified = [s.certified for s in stations]
        inside = in_range(ranges({self.parameter: self.span}), [s.point.x for s in stations])
        found = worst([found for found, _ in certified])
        certificate = replace(found, residuals=(*found.residuals, inside))
        return Branch(
            system,
            dict(self.values),
            self.parameter,
            lambda: dataset(system, self.parameter, self.contacts, stations),
            special,
            ends,
            with_special(certificate, special),
        )

    def _ending(self, piece: _Piece) -> Ending:
        guard = self._guard_that_ended(piece)
        if guard is None:
            return piece.path.ended
        x = piece.path.points[-1].x
        where = f"{self.parameter} = {x[-1]:.9g}"
        state = zip(piece.steady.field.state, x[:-1].tolist(), strict=True)
        values = {**self.values, self.parameter: float(x[-1]), **dict(state)}
        if said := ends_of_tables(self.eq.kinks, self.eq.speeds, values):
            return piece.path.ended._replace(text=f"outside of a table at {where} ({said[0]})")
        what = describe_guard(self.eq, guard, piece.steady.field.mode)
        text = f"boundary equilibrium at {where}: {what}"
        return piece.path.ended._replace(text=text)

    def _stations(self, pieces: list[_Piece]) -> list[Station]:
        found: list[Station] = []
        for k, piece in enumerate(pieces):
            kinds: dict[int, list[Test]] = {}
            for crossing in piece.path.crossings:
                kinds.setdefault(crossing.index, []).append(crossing.name)
            note = self._boundary_note(piece, pieces[k + 1 : k + 2])
            largest: dict[Test, float] = {
                name: max(abs(point.tests[name]) for point in piece.path.points)
                for name in range(len(piece.steady.field.guards))
            }
            # The first point of a later piece is the last one of the piece before.
            for i, point in list(enumerate(piece.path.points))[1 if k else 0 :]:
                names = kinds.get(i, [])
                if "fold" in names and any(
                    "branch point" in kinds.get(j, ()) for j in (i - 1, i, i + 1)
                ):
                    names.remove("fold")  # one of two branches that cross may turn
                found.append(
                    Station(
                        piece.steady,
                        point,
                        tuple(names),
                        note,
                        piece.certified[i],
                        largest,
                        pieces[k + 1].path.points[0].x if k + 1 < len(pieces) else None,
                    )
                )
        return found

    def _boundary_note(self, piece: _Piece, onward: list[_Piece]) -> str:
        guard = self._guard_that_ended(piece)
        if guard is None:
            return ""
        text = describe_guard(self.eq, guard, piece.steady.field.mode)
        if not onward:
            return f"{text}; no equilibrium continues from there"
        turned = piece.path.points[-1].tangent[-1] * onward[0].path.points[0].tangent[-1] < 0.0
        return f"{text}; the branch " + ("turns back" if turned else "continues")

    def _special(self, station: Station, test: Test, index: int) -> list[SpecialPoint]:
        """The special point at a zero of a test function, if it is one."""
        steady = station.steady
        x = station.point.x
        data = {}
        period = None
        kind, note = boundary_kind(self.eq, steady, test), ""
        if isinstance(test, int):
            note = station.note
        solved = station.certified[0]["equations"]
        own = [replace(solved, limit=SOLVED_TO)]
        if isinstance(test, int):
            own += self._boundary(station, test)
        elif kind == "fold":
            slope = float(station.point.tangent[-1] / station.point.units[-1])
            own += within(SOLVED_TO, [("slope of the parameter", abs(slope))])
        elif kind == "branch point":
            x, left = self._crossing_of_branches(steady, x)
            own = within(SOLVED_TO, [("equations of a crossing", left)])
        values = {**steady.values, self.parameter: float(x[-1])}
        if kind == "Hopf":
            eigenvalues = steady.eigenvalues(self._point(steady, x))
            a, b = min(combinations(eigenvalues, 2), key=lambda pair: abs(pair[0] + pair[1]))
            if abs(a.imag) <= _REAL * abs(a):
                return []  # a neutral saddle: two real eigenvalues of opposite sign
            own += within(SOLVED_TO, [("real part of the eigenvalue", abs(0.5 * (a + b) / a))])
            form = hopf(
                Derivatives(steady.rates, steady.field.state), x[:-1], values, steady.invariant
            )
            data = {"frequency": form.frequency, "lyapunov": form.lyapunov}
            note = form.criticality
            period = 2.0 * np.pi / form.frequency
        state = dict(zip(steady.field.state, map(float, x[:-1]), strict=True))
        value = float(x[-1])
        place = (state, values, steady.field.mode, steady.field.region, index)
        return [SpecialPoint(kind, self.parameter, value, *place, period, data, note, tuple(own))]

    @staticmethod
    def _boundary(station: Station, guard: int) -> list[Residual]:
        """Residual of the guard that vanishes at a boundary equilibrium, and its distance from the
        continued branch."""
        left, most = abs(station.point.tests[guard]), station.largest[guard]
        note = "of its largest value on the way"
        own = [Residual("guard", left / most if most else left, SOLVED_TO, note=note)]
        if station.onward is not None:
            gap = (station.onward - station.point.x) / station.point.units
            own.append(Residual("gap between the sides", float(np.linalg.norm(gap)), SOLVED_TO))
        return own

    def _crossing_of_branches(self, steady: Steady, x: Array) -> tuple[Array, float]:
        """The branch point near x, and the residual of its equations, relative to their terms. The
        extended system F + b w = 0, wᵀ∂F = 0, ⟨w, w⟩ = 1 is regular at the branch point, whereas F
        = 0 is singular."""
        n = len(steady.field.state)
        names = [*steady.field.state, self.parameter]
        w = [ex.sym(f"w:{i}") for i in range(n)]
        b = ex.sym("b:")
        slopes = [[ex.derivative(f, name) for f in steady.rates] for name in names]
        equations = [f + b * u for f, u in zip(steady.rates, w, strict=True)]
        equations += [
            ex.add(*((d * u, 1.0) for d, u in zip(row, w, strict=True))) for row in slopes
        ]
        equations.append(ex.add(*((u * u, 1.0) for u in w)) - 1.0)
        residual = ResidualFunction(
            equations, [*names, *(str(u.value) for u in w), str(b.value)], steady.values
        )
        _, slopes = steady.residual(self.parameter)(x)
        # w starts as the left singular vector of ∂F with the least singular value, b as 0.
        z: Array = np.concatenate([x, np.linalg.svd(slopes)[0][:, -1], [0.0]])
        units = self._scale(x, steady.units(x, {self.parameter: self.span}))
        for _ in range(20):
            values, slopes = residual(z)
            z = z - np.linalg.lstsq(slopes, values, rcond=None)[0]
        near = np.all(np.abs(z[: n + 1] - x) <= 5.0 * self.steps.largest * units)
        if not (near and np.all(np.isfinite(z))):
            return x, math.inf
        values, slopes = residual(z)
        terms = np.abs(slopes) @ np.concatenate([units, np.ones(n), [0.0]]) + np.abs(values)
        # At a branch point b = 0.
        left = np.append(np.abs(values) / np.where(terms > 0.0, terms, 1.0), abs(z[-1]))
        return z[: n + 1], float(np.max(left))


def tangent_beyond(
    other: Steady,
    guard: Guard,
    point: Callable[[Array], Array],
    at: tuple[Array, Array, Array],
    units: Array,
    widths: Array,
    steps: StepControl,
) -> Array | None:
    """The direction in which a curve continues beyond a guard, if it does.

    Parameters
    ----------
    other : Steady
        On the other side.
    point : callable
        Unknowns -> state and parameters.
    at : tuple of arrays
        The unknowns at the guard, and values and Jacobian of the equations of the other side.
    units, widths : arrays
        Lengths that count in the unknowns, and those of a step.
    """
    x, F, J = at
    rows = ratio(J * widths, np.max(np.abs(J * widths), axis=1, keepdims=True))
    # The null vector of the Jacobian is the tangent of the solutions in the other field.
    s, v = np.linalg.svd(rows)[1:]
    if not (np.all(np.abs(F) <= NEARLY_SOLVED * (np.abs(J) @ units)) and s[-1] > RANK * s[0]):
        return None
    tangent = widths * v[-1]
    here = other.guards(point(x))
    for sign in (1.0, -1.0):
        guards = other.guards(point(x + sign * _AHEAD * steps.first * tangent))
        back = [
            i
            for i, g in enumerate(other.field.guards)
            if g.switch == guard.switch and guards[i] > here[i]
        ]
        if back and all(g >= 0.0 or i in back for i, g in enumerate(guards)):
            return sign * tangent
    return None


def boundary_kind(equations: MotionEquations, steady: Steady, test: Test) -> str:
    """The kind of the special point at which a test function vanishes."""
    if not isinstance(test, int):
        return test
    switch, kinks = steady.field.guards[test].switch, equations.kinks
    return KNOT if switch < len(kinks) and is_smooth_knot(kinks[switch]) else "boundary equilibrium"


@cache
def _pairs(count: int) -> tuple[Array, Array]:
    return np.triu_indices(count, 1)


def _solved(found: Certificate) -> bool:
    """Return whether the equations are solved and the eigenvalues accurate; guards are left to the
    test functions."""
    return found["equations"].ok and found["eigenvalues"].ok


def hopf_test(eigenvalues: Array) -> float:
    """A number that changes its sign where the sum of two eigenvalues vanishes."""
    first, second = _pairs(len(eigenvalues))
    sums = eigenvalues[first] + eigenvalues[second]
    sizes = np.abs(eigenvalues[first]) + np.abs(eigenvalues[second])
    # Sums that vanish identically, as without damping, are set to zero: the sign of a rounding
    # error must not change.
    part = np.where(np.abs(sums) > ROUNDED_SUM * sizes, ratio(sums, sizes), 0.0)
    return float(np.prod(part).real)
