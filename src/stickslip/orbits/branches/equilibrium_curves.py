"""Curves of Hopf points and of folds of equilibria in two parameters.

They are zeros of extended systems, derived symbolically from the field f, which are regular at
generic points (Kuznetsov, *Elements of Applied Bifurcation Theory*, section 10.3):

    fold   f = 0,  A v = 0,         ⟨v, v⟩ = 1
    Hopf   f = 0,  (A² + κ) v = 0,  ⟨v, v⟩ = 1,  ⟨c, v⟩ = 0,   κ = ω²

with A = ∂f/∂y and a constant vector c. The conditions on v select one vector: of a line at a fold,
of the plane of the critical eigenvectors at a Hopf point. A Hopf curve ends where κ vanishes, at a
Bogdanov-Takens point; beyond it κ < 0, and the equilibrium is a neutral saddle.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import count, groupby
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arguments import validated
from stickslip.certificates import Certificate, Residual, worst
from stickslip.equations.derive import MotionEquations
from stickslip.equations.field import switched
from stickslip.equations.mode_fields import mode_field
from stickslip.errors import DeclarationError, StickslipError
from stickslip.model.system import System
from stickslip.motion.problem import checked_values
from stickslip.numerics.levels import ROUNDED_SUM
from stickslip.orbits.branches.equilibrium_branch import (
    MOST_PIECES,
    boundary_kind,
    checked_range,
    hopf_test,
    tangent_beyond,
)
from stickslip.orbits.branches.special_points import NOT_SMOOTH
from stickslip.orbits.continuation.branch import SOLVED_TO, Branch, SpecialPoint, with_special
from stickslip.orbits.continuation.corrector import Lost
from stickslip.orbits.continuation.driver import (
    CurveProblem,
    Start,
    both_ways,
    follow_branch,
    joined,
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
from stickslip.orbits.equilibria.certificate import SOLVED, certify_equilibrium
from stickslip.orbits.equilibria.equilibrium import describe_guard
from stickslip.orbits.equilibria.normal_form import Derivatives, critical_pair, hopf
from stickslip.orbits.fields.steady import Array, ResidualFunction, Steady, invariant_directions
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

if TYPE_CHECKING:
    import xarray

_STEPS = StepControl(first=0.005, largest=0.02)
_DIFFERENCE = 1e-4  # fraction of the range of a parameter, for central differences of eigenvalues
Numbers = Callable[[Array], dict[str, float]]


@validated
def hopf_curve(
    system: System,
    point: SpecialPoint,
    first: str,
    second: str,
    *,
    ranges: Mapping[str, tuple[float, float]],
    steps: StepControl | None = None,
) -> Branch:
    """Continue a Hopf point of an equilibrium in two parameters.

    Parameters
    ----------
    system : System
    point : SpecialPoint
        Of kind ``"Hopf"``.
    first, second : str
        The two parameters.
    ranges : mapping of str to (float, float)
        The range of each.
    steps : StepControl, optional

    Returns
    -------
    Branch
        At every point ``frequency`` and ``lyapunov``, the first Lyapunov coefficient; the
        derivative of the growth rate of the oscillation with respect to each parameter, such as
        ``growth_V`` (the equilibrium is stable on the side of decreasing growth); and
        ``unstable_others``, the number of other unstable eigenvalues. Special points: ``"Bautin"``
        (the Lyapunov coefficient vanishes), ``"Bogdanov-Takens"`` (the frequency vanishes),
        ``"zero-Hopf"``, ``"boundary equilibrium"``.

    Raises
    ------
    DeclarationError
        If an argument is wrong.
    """
    curve = _checked(system, "Hopf", point, (first, second), ranges)
    return curve.branch(system, "Hopf points", _hopf_problem, steps or _STEPS)


@validated
def fold_curve(
    system: System,
    point: SpecialPoint,
    first: str,
    second: str,
    *,
    ranges: Mapping[str, tuple[float, float]],
    steps: StepControl | None = None,
) -> Branch:
    """Continue a fold of equilibria in two parameters.

    Parameters
    ----------
    system : System
    point : SpecialPoint
        Of kind ``"fold"``, of equilibria.
    first, second : str
        The two parameters.
    ranges : mapping of str to (float, float)
        The range of each.
    steps : StepControl, optional

    Returns
    -------
    Branch
        At every point ``curvature``, ½⟨p, ∂²f(v, v)⟩ with the left null vector p of length 1.
        Special points: ``"cusp"`` (the curvature vanishes), ``"Bogdanov-Takens"``,
        ``"zero-Hopf"``, ``"boundary equilibrium"``.

    Raises
    ------
    DeclarationError
        If an argument is wrong.
    """
    if isinstance(point, SpecialPoint) and point.kind == "fold" and point.period is not None:
        reason = "it is a fold of cycles"
        remedy = "use continue_cycle"
        if NOT_SMOOTH in point.note:
            reason += ", where the sequence of modes changes"
            remedy = "continue the stick onset at the same value with stick_onset_curve"
        raise DeclarationError(
            "point", reason, f"This function continues folds of equilibria; {remedy}"
        )
    curve = _checked(system, "fold", point, (first, second), ranges)
    return curve.branch(system, "folds", _fold_problem, steps or _STEPS)


def _checked(
    system: System,
    kind: str,
    point: SpecialPoint,
    names: tuple[str, str],
    ranges: Mapping[str, tuple[float, float]],
) -> _Curve:
    """Check the arguments, and return the start of the curve."""
    equations = autonomous(system)
    if not isinstance(point, SpecialPoint) or point.kind != kind:
        given = (
            f"a special point of kind '{point.kind}'"
            if isinstance(point, SpecialPoint)
            else repr(point)
        )
        raise DeclarationError(
            "point",
            f"expected a special point of kind '{kind}', got {given}",
            "Use one of branch.special",
        )
    values = checked_values(system, point.parameters)
    if names[0] == names[1]:
        raise DeclarationError(
            names[1], "the two parameters are the same", "Give two different parameters"
        )
    spans = {}
    for name in names:
        if name not in ranges:
            raise DeclarationError(f"ranges.{name}", "the range is missing", "Give (low, high)")
        spans[name] = checked_range(system, name, ranges[name])
        if not spans[name][0] <= values[name] <= spans[name][1]:
            raise DeclarationError(
                f"ranges.{name}",
                f"the point lies at {name} = {values[name]:g}",
                "Choose a range that includes it",
            )
    y = np.array([point.state[name] for name in system.declaration.state])
    invariant = invariant_directions(equations, values, y)
    steady = Steady(mode_field(equations, point.mode, point.region), values, invariant, y)
    return _Curve(equations, steady, y, spans)


@dataclass(frozen=True)
class _Extended:
    """An extended system. Its unknowns are the state, the vector v, κ of a Hopf point, and the two
    parameters.

    Attributes
    ----------
    start : array
        The solution at the given point.
    tests, numbers : functions
        Of the unknowns: test functions; numbers to report.
    endings : dict of str to str
        Test functions that end the curve.
    least : array
        Smallest units of the unknowns; the units of the parameters are their ranges.
    others : function, optional
        Function of the unknowns: numbers that require eigenvalues, and eigenvalues at neighbouring
        parameters. They are computed only for points that are reported.
    """

    residual: ResidualFunction
    start: Array
    tests: Numbers
    numbers: Numbers
    endings: dict[str, str]
    least: Array
    others: Numbers | None = None

    def units(self, x: Array) -> Array:
        """Units of the unknowns."""
        return np.append(np.maximum(np.abs(x[:-2]), self.least[:-2]), self.least[-2:])

    def cleaned(self, x: Array) -> Array:
        """Unknowns with rounding errors set to zero."""
        return np.where(np.abs(x) <= ROUNDED_SUM * self.least, 0.0, x)


@dataclass(frozen=True)
class _CurvePoint:
    """A point of a curve, the test functions that vanish there, and whether the curve continues
    beyond it in another mode or region."""

    curve: _Curve
    problem: _Extended
    x: Array
    tests: tuple[Test, ...] = ()
    continues: bool = False

    @property
    def certificate(self) -> Certificate:
        """Residuals of the point."""
        return self.curve.certificate(self.x, self.problem)

    def test(self, test: Test) -> float:
        """The value of a test function."""
        if isinstance(test, int):
            return float(self.curve.steady.guards(self.curve.point(self.x))[test])
        return self.problem.tests(self.x)[test]


_Extension = Callable[["_Curve"], _Extended]  # `_hopf_problem` or `_fold_problem`


@dataclass(frozen=True)
class _Curve:
    """A curve in one mode and region: the state y at its start, and the ranges of the two
    parameters."""

    equations: MotionEquations
    steady: Steady
    y: Array
    spans: dict[str, tuple[float, float]]

    @property
    def guards(self) -> list[str]:
        """Description of each guard."""
        field = self.steady.field
        return [describe_guard(self.equations, g, field.mode) for g in field.guards]

    @property
    def n(self) -> int:
        """Number of states."""
        return len(self.y)

    def vector(self) -> list[Expr]:
        """The unknown vector v."""
        return [ex.sym(f"v:{i}") for i in range(self.n)]

    def image(self, u: list[Expr]) -> list[Expr]:
        """The product A u."""
        rows = ([ex.derivative(f, x) for x in self.steady.field.state] for f in self.steady.rates)
        return [ex.add(*((d * v, 1.0) for d, v in zip(row, u, strict=True))) for row in rows]

    def extended(self, conditions: list[Expr], *further: str) -> ResidualFunction:
        """Equations f = 0, the conditions, and ⟨v, v⟩ = 1, in the unknowns y, v, `further` names
        and the two parameters."""
        v = self.vector()
        norm = ex.add(*((x * x, 1.0) for x in v)) - 1.0
        unknowns = [*self.steady.field.state, *(str(x.value) for x in v), *further, *self.spans]
        return ResidualFunction(
            [*self.steady.rates, *conditions, norm], unknowns, self.steady.values
        )

    def values(self, x: Array) -> dict[str, float]:
        """All parameters."""
        return {**self.steady.values, **dict(zip(self.spans, map(float, x[-2:]), strict=True))}

    def point(self, x: Array) -> Array:
        """State and all parameters."""
        return self.steady.point(x[: self.n], self.values(x))

    # -- following ---------------------------------------------------------------------------------

    def branch(self, system: System, kind: str, extend: _Extension, steps: StepControl) -> Branch:
        """Follow the curve in both directions, through kinks at which the equations are
        continuous."""
        problem = extend(self)
        tangents: list[Array] = []

        def side(sign: float) -> tuple[list[_CurvePoint], Ending]:
            towards = np.zeros(len(problem.start))
            towards[-2] = 1.0
            # The second side starts opposite to the tangent at which the first one started.
            along = -tangents[0] if tangents else towards
            points: list[_CurvePoint] = []
            pieces = count(1)

            def onward(start: Start[_CurvePoint], path: Path) -> Start[_CurvePoint] | Ending:
                tangents.append(path.points[0].tangent)
                beyond = start.of.curve.beyond(path, start.of.problem, extend, steps)
                if next(pieces) == MOST_PIECES:
                    beyond = None
                # The first point of a later piece is the last one of the piece before.
                found = _points_of(start.of, path, beyond is not None)
                points.extend(found[1 if points else 0 :])
                return path.ended if beyond is None else beyond

            start = self.start(problem, along, steps)
            ending = follow_branch(start, onward, "no further point was found")
            if not points:
                raise StickslipError(ending.text)
            return points, ending

        back, forth, ends = both_ways(side, 1.0)
        points = joined(back, forth)
        special = [_special(points, i, test) for i, p in enumerate(points) for test in p.tests]
        first, second = self.spans
        found = worst([point.certificate for point in points])
        inside = in_range(ranges(self.spans), [point.x for point in points])
        certificate = Certificate((*found.residuals, inside))
        return Branch(
            system,
            dict(self.steady.values),
            first,
            lambda: _dataset(system, kind, points),
            special,
            ends,
            with_special(certificate, special),
            second,
        )

    def start(self, problem: _Extended, towards: Array, steps: StepControl) -> Start[_CurvePoint]:
        """Start of the curve in this mode and region."""
        point = _CurvePoint(self, problem, problem.start)
        return Start(point, self._problem(problem), problem.start, towards, steps)

    def beyond(
        self, path: Path, problem: _Extended, extend: _Extension, steps: StepControl
    ) -> Start[_CurvePoint] | None:
        """Continuation of the curve on the other side of the guard that ended a piece; None if
        there is none.

        Parameters
        ----------
        path : Path
            The piece that has ended.
        problem : _Extended
            Its extended system.
        """
        test, x = path.ended.test, problem.cleaned(path.points[-1].x)
        if not isinstance(test, int):
            return None
        guard = self.steady.field.guards[test]
        values = self.values(x)
        try:
            field = mode_field(self.equations, *switched(self.steady.field, guard.switch, guard.to))
            other = Steady(field, values, self.steady.invariant, x[: self.n])
            curve = replace(self, steady=other, y=x[: self.n])
            extended = extend(curve)
        except ZeroDivisionError:
            return None
        z = extended.start
        F, J = extended.residual(z)
        if not (np.all(np.isfinite(F)) and np.all(np.isfinite(J))):
            return None  # a table ends there
        units = extended.units(z)
        tangent = tangent_beyond(other, guard, curve.point, (z, F, J), units, units, steps)
        return None if tangent is None else curve.start(extended, tangent, steps)

    def certificate(self, x: Array, problem: _Extended) -> Certificate:
        """Certificate of the equilibrium, with the residual of the conditions on its eigenvalue
        along the curve."""
        # A component that vanishes along the curve, such as a rate, has the rounding errors of its
        # terms, not of its value.
        sizes = np.where(problem.start == 0.0, problem.least, problem.start)
        found, _ = certify_equilibrium(self.steady, self.point(x), beside=self.point(sizes))
        value, slopes = problem.residual(x)
        terms = np.abs(slopes) @ problem.units(x) + np.abs(value)
        left = float(np.max(np.abs(value) / np.where(terms > 0.0, terms, 1.0)))
        return Certificate(
            (*found.residuals, Residual("extended equations", left, SOLVED, note="of their terms"))
        )

    def _accept(self, last: Point, new: Point, problem: _Extended) -> None:
        """Check that a point is certified. Guards may vanish: they are test functions.

        Raises
        ------
        Lost
            If it is not.
        """
        found = self.certificate(new.x, problem)
        if not all(residual.ok for residual in found.residuals if residual.name != "nearest guard"):
            raise Lost(f"the next point is {found.verdict}")

    def least(self, start: Array) -> Array:
        """Smallest units of the unknowns of an extended system; those of the vector v are 1."""
        least = 0.2 * np.abs(start)  # of κ; all others are set below
        least[: self.n] = self.steady.units(np.append(self.y, start[-2:]), self.spans)
        least[self.n : 2 * self.n] = 1.0
        least[-2:] = [high - low for low, high in self.spans.values()]
        return least

    def _problem(self, problem: _Extended) -> CurveProblem:
        """The continuation problem of an extended system."""

        def tests(x: Array, tangent: Array) -> dict[Test, float]:
            margins = self.steady.guards(self.point(x))
            return {**problem.tests(x), **{i: float(g) for i, g in enumerate(margins)}}

        # Equations are scaled to the same size: otherwise rounding errors of large equations would
        # dominate the corrections from small ones.
        _, slopes = problem.residual(problem.start)
        sizes = np.max(np.abs(slopes * problem.units(problem.start)), axis=1)
        sizes[sizes == 0.0] = 1.0

        def equations(x: Array) -> tuple[Array, Array]:
            values, slopes = problem.residual(x)
            return values / sizes, slopes / sizes[:, None]

        boundaries = {i: f"boundary equilibrium: {text}" for i, text in enumerate(self.guards)}
        return CurveProblem(
            equations,
            problem.units,
            tests,
            {**problem.endings, **boundaries},
            ranges(self.spans),
            lambda last, new: self._accept(last, new, problem),
        )


# -- results ---------------------------------------------------------------------------------------


def _points_of(start: _CurvePoint, path: Path, continues: bool) -> list[_CurvePoint]:
    """The points of a piece; `continues` if another piece follows."""
    tests: dict[int, list[Test]] = {}
    for crossing in path.crossings:
        tests.setdefault(crossing.index, []).append(crossing.name)
    last = len(path.points) - 1
    return [
        replace(
            start,
            x=start.problem.cleaned(p.x),
            tests=tuple(tests.get(i, ())),
            continues=continues and i == last,
        )
        for i, p in enumerate(path.points)
    ]


def _special(points: list[_CurvePoint], index: int, test: Test) -> SpecialPoint:
    """The special point at a zero of a test function."""
    point = points[index]
    curve, problem, x = point.curve, point.problem, point.x
    field, (first, _) = curve.steady.field, curve.spans
    kind, note = boundary_kind(curve.equations, curve.steady, test), ""
    if isinstance(test, int):
        note = curve.guards[test] + ("; the curve continues" if point.continues else "")
    state = dict(zip(field.state, map(float, x[: curve.n]), strict=True))
    data = {name: v for name, v in problem.numbers(x).items() if np.isfinite(v)}
    where = (state, curve.values(x), field.mode, field.region, index)
    # The scale of a test function is its value at the neighbouring points.
    neighbours = [points[i] for i in (index - 1, index + 1) if 0 <= i < len(points)]
    scale = max((abs(p.test(test)) for p in neighbours if p.curve is curve), default=0.0)
    here = abs(point.test(test))
    residuals = (
        replace(point.certificate["extended equations"], limit=SOLVED_TO),
        Residual("test function", here / scale if scale else here, SOLVED_TO),
    )
    return SpecialPoint(kind, first, float(x[-2]), *where, None, data, note, residuals)


def _dataset(system: System, kind: str, points: list[_CurvePoint]) -> xarray.Dataset:
    """Parameters, state, numbers of the extended system, and certificate of every point."""
    import xarray as xr

    curve = points[0].curve
    xs = np.array([point.x for point in points])
    columns = np.array([curve.point(x) for x in xs]).T
    margin, defect = np.ones(len(points)), np.zeros(len(points))
    numbers: list[dict[str, float]] = []
    for _, piece in groupby(range(len(points)), key=lambda i: id(points[i].curve)):
        own = list(piece)
        first = points[own[0]]
        sizes = first.curve.steady.sizes(columns[:, own], columns)
        margin[own] = np.min(sizes.margins, axis=1, initial=1.0)
        defect[own] = sizes.defect
        others = first.problem.others or (lambda x: {})
        numbers += [first.problem.numbers(xs[i]) | others(xs[i]) for i in own]
    data = {name: ("point", xs[:, i - 2]) for i, name in enumerate(curve.spans)}
    data |= {name: ("point", xs[:, i]) for i, name in enumerate(curve.steady.field.state)}
    data |= {name: ("point", np.array([row[name] for row in numbers])) for name in numbers[0]}
    data |= {"margin": ("point", margin), "defect": ("point", defect)}
    certified = np.array([point.certificate.ok for point in points], np.int8)
    data |= {"certified": ("point", certified)}
    return xr.Dataset(data, attrs={"title": system.title or system.name, "kind": kind})


def _hopf_problem(curve: _Curve) -> _Extended:
    """Extended system of Hopf points, with the unknown κ = ω² after y and v."""
    steady = curve.steady
    n = curve.n
    v = curve.vector()
    kappa = ex.sym("kappa:")
    derivatives = Derivatives(steady.rates, steady.field.state)
    eigenvalue, q = critical_pair(derivatives(curve.y, steady.values)[0])
    first = q.real / np.linalg.norm(q.real)
    other = q.imag - (q.imag @ first) * first
    # The real plane of q and its conjugate is the null space of A² + κ. The condition ⟨c, v⟩ = 0
    # excludes the direction in this plane that is perpendicular to the first v.
    across = ex.add(*((x, float(w)) for x, w in zip(v, other / np.linalg.norm(other), strict=True)))
    twice = curve.image(curve.image(v))
    residual = curve.extended(
        [*(a + kappa * x for a, x in zip(twice, v, strict=True)), across], str(kappa.value)
    )
    start = np.concatenate(
        [curve.y, first, [eigenvalue.imag**2], [steady.values[name] for name in curve.spans]]
    )

    slopes = ResidualFunction(steady.rates, [*steady.field.state, *curve.spans], steady.values)

    def numbers(x: Array) -> dict[str, float]:
        if not x[2 * n] > 0.0:
            return {"frequency": 0.0, "lyapunov": np.nan}
        form = hopf(derivatives, x[:n], curve.values(x), steady.invariant)
        return {"frequency": form.frequency, "lyapunov": form.lyapunov}

    def others(x: Array) -> dict[str, float]:
        """Number of other unstable eigenvalues, and derivatives of the real part of the critical
        pair along the equilibria with other parameters, by central differences."""
        found = _others(steady.eigenvalues(curve.point(x)), x[2 * n])
        rates = {"unstable_others": float(np.count_nonzero(found.real > 0.0))}
        linear = slopes(np.append(x[:n], x[-2:]))[1]
        for j, (name, (low, high)) in enumerate(curve.spans.items()):
            step = np.zeros(len(x))
            step[j - 2] = _DIFFERENCE * (high - low)
            # The equilibrium moves with the parameter by A dy = −∂f/∂p dp.
            step[:n] = np.linalg.lstsq(linear[:, :n], -linear[:, n + j] * step[j - 2])[0]
            ends = (_pair(steady.eigenvalues(curve.point(x + s * step)), x[2 * n]) for s in (1, -1))
            ahead, back = (float(np.mean(pair.real)) for pair in ends)
            rates[f"growth_{name}"] = (ahead - back) / (2.0 * step[j - 2])
        return rates

    def tests(x: Array) -> dict[str, float]:
        eigenvalues = _others(steady.eigenvalues(curve.point(x)), x[2 * n])
        return {
            "Bautin": numbers(x)["lyapunov"],
            "zero-Hopf": float(np.prod(eigenvalues).real),
            "Bogdanov-Takens": float(x[2 * n]),
        }

    ending = {"Bogdanov-Takens": "Bogdanov-Takens point: the frequency vanishes"}
    return _Extended(residual, start, tests, numbers, ending, curve.least(start), others)


def _pair(eigenvalues: Array, kappa: float) -> Array:
    """The two eigenvalues nearest to ±i√κ."""
    return eigenvalues[np.argsort(np.abs(eigenvalues**2 + kappa))[:2]]


def _others(eigenvalues: Array, kappa: float) -> Array:
    """All eigenvalues except the two nearest to ±i√κ."""
    return eigenvalues[np.argsort(np.abs(eigenvalues**2 + kappa))[2:]]


def _fold_problem(curve: _Curve) -> _Extended:
    """Extended system of folds."""
    steady = curve.steady
    n = curve.n
    v = curve.vector()
    image = curve.image(v)
    # The second derivative of f in the direction v.
    curvature = [
        ex.add(
            *((ex.derivative(a, x) * w, 1.0) for x, w in zip(steady.field.state, v, strict=True))
        )
        for a in image
    ]
    second = ResidualFunction(
        curvature, [*steady.field.state, *(str(x.value) for x in v), *curve.spans], steady.values
    )
    slopes = ResidualFunction(steady.rates, [*steady.field.state, *curve.spans], steady.values)
    residual = curve.extended(image)

    def matrix(x: Array) -> Array:
        return slopes(np.append(x[:n], x[-2:]))[1][:, :n]

    start = np.concatenate([curve.y, np.zeros(n), [steady.values[name] for name in curve.spans]])
    # At a fold the last singular vectors are the left and right null vectors.
    u, _, w = np.linalg.svd(matrix(start))
    left = u[:, -1]
    right = w[-1]
    start[n : 2 * n] = right

    def numbers(x: Array) -> dict[str, float]:
        # The left null vector p from a bordered matrix. The border is constant, so p does not
        # change its sign along the curve.
        border = np.block([[matrix(x), left[:, None]], [right[None], np.zeros((1, 1))]])
        p = np.linalg.solve(border.T, np.append(np.zeros(n), 1.0))[:n]
        return {"curvature": float(0.5 * p @ second(x)[0] / np.linalg.norm(p))}

    def tests(x: Array) -> dict[str, float]:
        eigenvalues = steady.eigenvalues(curve.point(x))
        others = np.delete(eigenvalues, np.argmin(np.abs(eigenvalues)))
        # With one zero eigenvalue, the sum of these products is the product of the others, which
        # vanishes with a second zero.
        products = [np.prod(np.delete(eigenvalues, i)) for i in range(len(eigenvalues))]
        return {
            "cusp": numbers(x)["curvature"],
            "Bogdanov-Takens": float(np.sum(products).real),
            "zero-Hopf": hopf_test(others),
        }

    return _Extended(residual, start, tests, numbers, {}, curve.least(start))
