"""Curves in two parameters along which an equilibrium keeps a Hopf or a fold point.

Both are zeros of extended systems that are regular where the points are generic (Kuznetsov,
*Elements of Applied Bifurcation Theory*, section 10.3), made symbolically from the field:

    fold   f = 0,  A v = 0,         ⟨v, v⟩ = 1
    Hopf   f = 0,  (A² + κ) v = 0,  ⟨v, v⟩ = 1,  ⟨c, v⟩ = 0,   κ = ω²

with A = ∂f/∂y. A Hopf curve ends where κ vanishes, a Bogdanov-Takens point: beyond it, κ < 0 is a
neutral saddle.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arguments import validated
from stickslip.certificates import Certificate, Residual, worst
from stickslip.equations.mode_fields import mode_field
from stickslip.errors import DeclarationError, StickslipError
from stickslip.model.system import System
from stickslip.motion.problem import checked_values
from stickslip.orbits.branches.equilibrium_branch import checked_range, hopf_test
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
_BESIDE = 1e-4  # part of the range of a parameter, over which eigenvalues are compared
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
    """Follow a Hopf point of an equilibrium while two parameters change.

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
        With ``frequency`` and ``lyapunov`` at every point; the derivative of the growth rate of the
        oscillation with respect to each parameter, ``growth_V``, so that the equilibrium is stable
        on the side of decreasing growth; and ``unstable_others``, how many other eigenvalues are
        unstable. Special points: ``"Bautin"`` (the first Lyapunov coefficient vanishes),
        ``"Bogdanov-Takens"`` (the frequency does), ``"zero-Hopf"``, ``"boundary equilibrium"``.

    Raises
    ------
    DeclarationError
        If an argument is wrong.
    """
    curve = _posed(system, "Hopf", point, (first, second), ranges)
    return curve.branch(system, "Hopf points", _hopf_problem(curve), steps or _STEPS)


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
    """Follow a fold of equilibria while two parameters change.

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
        Special points: ``"cusp"``, ``"Bogdanov-Takens"``, ``"zero-Hopf"``,
        ``"boundary equilibrium"``.

    Raises
    ------
    DeclarationError
        If an argument is wrong.
    """
    if isinstance(point, SpecialPoint) and point.kind == "fold" and point.period is not None:
        begins = NOT_SMOOTH in point.note
        raise DeclarationError(
            "point",
            "it is a fold of cycles" + (", where the sequence of modes changes" if begins else ""),
            "This function follows folds of equilibria; "
            + (
                "follow the stick onset at the same value with stick_onset_curve"
                if begins
                else "use continue_cycle"
            ),
        )
    curve = _posed(system, "fold", point, (first, second), ranges)
    return curve.branch(system, "folds", _fold_problem(curve), steps or _STEPS)


def _posed(
    system: System,
    kind: str,
    point: SpecialPoint,
    names: tuple[str, str],
    ranges: Mapping[str, tuple[float, float]],
) -> _Curve:
    """Check the arguments."""
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
    steady = Steady(
        mode_field(equations, point.mode, point.region),
        values,
        invariant_directions(equations, values, y),
        y,
    )
    guards = [describe_guard(equations, g, point.mode) for g in steady.field.guards]
    return _Curve(steady, y, spans, guards)


@dataclass(frozen=True)
class _Extended:
    """An extended system.

    Attributes
    ----------
    residual : ResidualFunction
        In the state, the vector v, further unknowns, and the two parameters.
    start : array
        Its solution at the given point.
    tests, numbers : functions
        Of the unknowns: test functions; numbers to report.
    endings : dict of str to str
        Test functions that end the curve.
    least : array
        Least lengths that count in the unknowns; those of the parameters are their ranges.
    beside : function, optional
        Of the unknowns: numbers to report of what is beside the curve.
    """

    residual: ResidualFunction
    start: Array
    tests: Numbers
    numbers: Numbers
    endings: dict[str, str]
    least: Array
    beside: Numbers | None = None

    def units(self, x: Array) -> Array:
        """Lengths that count in the unknowns."""
        return np.append(np.maximum(np.abs(x[:-2]), self.least[:-2]), self.least[-2:])


@dataclass(frozen=True)
class _Curve:
    """Start and range of a curve."""

    steady: Steady
    y: Array
    spans: dict[str, tuple[float, float]]
    guards: list[str]

    @property
    def n(self) -> int:
        """Number of states."""
        return len(self.y)

    def vector(self) -> list[Expr]:
        """The unknown vector v."""
        return [ex.sym(f"v:{i}") for i in range(self.n)]

    def image(self, u: list[Expr]) -> list[Expr]:
        """A u."""
        rows = ([ex.derivative(f, x) for x in self.steady.field.state] for f in self.steady.rates)
        return [ex.add(*((d * v, 1.0) for d, v in zip(row, u, strict=True))) for row in rows]

    def extended(self, conditions: list[Expr], *own: str) -> ResidualFunction:
        """f = 0, the conditions, and ⟨v, v⟩ = 1."""
        v = self.vector()
        norm = ex.add(*((x * x, 1.0) for x in v)) - 1.0
        unknowns = [*self.steady.field.state, *(str(x.value) for x in v), *own, *self.spans]
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

    def branch(self, system: System, kind: str, problem: _Extended, steps: StepControl) -> Branch:
        """Both ways from the start."""
        paths: list[Path] = []

        def side(sign: float) -> tuple[list[Path], Ending]:
            towards = np.zeros(len(problem.start))
            towards[-2] = 1.0
            along = -paths[0].points[0].tangent if paths else towards

            def onward(start: Start[_Extended], path: Path) -> Ending:
                paths.append(path)
                return path.ended

            before = len(paths)
            start = Start(problem, self._problem(problem), problem.start, along, steps)
            ending = follow_branch(start, onward, "no further point was found")
            if len(paths) == before:
                raise StickslipError(ending.text)
            return paths[before:], ending

        back, forth, ends = both_ways(side, 1.0)
        behind, ahead = ([p for path in paths for p in path.points] for paths in (back, forth))
        points = [p.x for p in joined(behind, ahead)]
        start = max(len(behind) - 1, 0)
        crossings = [(start - c.index, c.name) for path in back for c in reversed(path.crossings)]
        crossings += [(start + c.index, c.name) for path in forth for c in path.crossings]
        special = [self._special(name, points, i, problem) for i, name in crossings]
        first, second = self.spans
        found = worst([self._certificate(x, problem) for x in points])
        certificate = Certificate((*found.residuals, in_range(ranges(self.spans), points)))
        return Branch(
            system,
            dict(self.steady.values),
            first,
            lambda: self._dataset(system, kind, points, problem),
            special,
            ends,
            with_special(certificate, special),
            second,
        )

    def _certificate(self, x: Array, problem: _Extended) -> Certificate:
        """That of the equilibrium, and what is left of the equations that keep its eigenvalue along
        the curve."""
        found, _ = certify_equilibrium(self.steady, self.point(x), beside=self.point(problem.start))
        value, slopes = problem.residual(x)
        terms = np.abs(slopes) @ problem.units(x) + np.abs(value)
        left = float(np.max(np.abs(value) / np.where(terms > 0.0, terms, 1.0)))
        return Certificate(
            (*found.residuals, Residual("extended equations", left, SOLVED, note="of their terms"))
        )

    def _accept(self, last: Point, new: Point, problem: _Extended) -> None:
        """See that a point is certified; its guards are test functions.

        Raises
        ------
        Lost
            If it is not.
        """
        found = self._certificate(new.x, problem)
        if not all(residual.ok for residual in found.residuals if residual.name != "nearest guard"):
            raise Lost(f"the next point is {found.verdict}")

    def least(self, start: Array) -> Array:
        """Least lengths that count in the unknowns of an extended system; that of the vector v is
        1."""
        floor = 0.2 * np.abs(start)
        floor[: self.n] = self.steady.units(np.append(self.y, start[-2:]), self.spans)
        floor[self.n : 2 * self.n] = 1.0
        floor[-2:] = [high - low for low, high in self.spans.values()]
        return floor

    def _problem(self, problem: _Extended) -> CurveProblem:
        """The curve as the driver follows it."""

        def tests(x: Array, tangent: Array) -> dict[Test, float]:
            margins = self.steady.guards(self.point(x))
            return {**problem.tests(x), **{i: float(g) for i, g in enumerate(margins)}}

        boundaries = {i: f"boundary equilibrium: {text}" for i, text in enumerate(self.guards)}
        return CurveProblem(
            problem.residual,
            problem.units,
            tests,
            {**problem.endings, **boundaries},
            ranges(self.spans),
            lambda last, new: self._accept(last, new, problem),
        )

    # -- results -----------------------------------------------------------------------------------

    def _special(
        self, test: Test, points: list[Array], index: int, problem: _Extended
    ) -> SpecialPoint:
        field, (first, _) = self.steady.field, self.spans
        x = points[index]
        kind, note = (
            ("boundary equilibrium", self.guards[test]) if isinstance(test, int) else (test, "")
        )
        state = dict(zip(field.state, map(float, x[: self.n]), strict=True))
        data = {name: v for name, v in problem.numbers(x).items() if np.isfinite(v)}
        values = self.values(x)
        place = (state, values, field.mode, field.region, index)
        # A test function has no size of its own but what it is at the points beside.
        beside = [points[i] for i in (index - 1, index + 1) if 0 <= i < len(points)]
        here, *others = [abs(self._test(test, point, problem)) for point in (x, *beside)]
        residuals = (
            replace(self._certificate(x, problem)["extended equations"], limit=SOLVED_TO),
            Residual(
                "what vanishes", here / max(others, default=0.0) if any(others) else here, SOLVED_TO
            ),
        )
        return SpecialPoint(kind, first, float(x[-2]), *place, None, data, note, residuals)

    def _test(self, test: Test, x: Array, problem: _Extended) -> float:
        """The value of a test function."""
        if isinstance(test, int):
            return float(self.steady.guards(self.point(x))[test])
        return problem.tests(x)[test]

    def _dataset(
        self, system: System, kind: str, points: list[Array], problem: _Extended
    ) -> xarray.Dataset:
        """Parameters, state, numbers of the family, and certificate of every point."""
        import xarray as xr

        xs = np.array(points)
        sizes = self.steady.sizes(np.array([self.point(x) for x in points]).T)
        numbers = [problem.numbers(x) for x in points]
        if problem.beside is not None:
            numbers = [own | problem.beside(x) for own, x in zip(numbers, points, strict=True)]
        data = {name: ("point", xs[:, i - 2]) for i, name in enumerate(self.spans)}
        data |= {name: ("point", xs[:, i]) for i, name in enumerate(self.steady.field.state)}
        data |= {name: ("point", np.array([row[name] for row in numbers])) for name in numbers[0]}
        data |= {
            "margin": ("point", np.min(sizes.margins, axis=1, initial=1.0)),
            "defect": ("point", sizes.defect),
        }
        certified = np.array([self._certificate(x, problem).ok for x in points], np.int8)
        data |= {"certified": ("point", certified)}
        return xr.Dataset(data, attrs={"title": system.title or system.name, "kind": kind})


def _hopf_problem(curve: _Curve) -> _Extended:
    steady = curve.steady
    n = curve.n
    v = curve.vector()
    kappa = ex.sym("kappa:")
    derivatives = Derivatives(steady.rates, steady.field.state)
    eigenvalue, q = critical_pair(derivatives(curve.y, steady.values)[0])
    first = q.real / np.linalg.norm(q.real)
    other = q.imag - (q.imag @ first) * first
    # Of the plane of v, the direction across the first v is shut out.
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

    def beside(x: Array) -> dict[str, float]:
        """Along the equilibria with other parameters."""
        found = _others(steady.eigenvalues(curve.point(x)), x[2 * n])
        rates = {"unstable_others": float(np.count_nonzero(found.real > 0.0))}
        linear = slopes(np.append(x[:n], x[-2:]))[1]
        for j, (name, (low, high)) in enumerate(curve.spans.items()):
            step = np.zeros(len(x))
            step[j - 2] = _BESIDE * (high - low)
            step[:n] = np.linalg.lstsq(linear[:, :n], -linear[:, n + j] * step[j - 2])[0]
            ends = (_pair(steady.eigenvalues(curve.point(x + s * step)), x[2 * n]) for s in (1, -1))
            ahead, back = (float(np.mean(pair.real)) for pair in ends)
            rates[f"growth_{name}"] = (ahead - back) / (2.0 * step[j - 2])
        return rates

    def tests(x: Array) -> dict[str, float]:
        others = _others(steady.eigenvalues(curve.point(x)), x[2 * n])
        return {
            "Bautin": numbers(x)["lyapunov"],
            "zero-Hopf": float(np.prod(others).real),
            "Bogdanov-Takens": float(x[2 * n]),
        }

    ending = {"Bogdanov-Takens": "Bogdanov-Takens point: the frequency vanishes"}
    return _Extended(residual, start, tests, numbers, ending, curve.least(start), beside)


def _pair(eigenvalues: Array, kappa: float) -> Array:
    """The two eigenvalues nearest to ±i√κ."""
    return eigenvalues[np.argsort(np.abs(eigenvalues**2 + kappa))[:2]]


def _others(eigenvalues: Array, kappa: float) -> Array:
    """All but these."""
    return eigenvalues[np.argsort(np.abs(eigenvalues**2 + kappa))[2:]]


def _fold_problem(curve: _Curve) -> _Extended:
    steady = curve.steady
    n = curve.n
    v = curve.vector()
    image = curve.image(v)
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
    u, _, w = np.linalg.svd(matrix(start))
    left = u[:, -1]
    right = w[-1]
    start[n : 2 * n] = right

    def numbers(x: Array) -> dict[str, float]:
        # The left null vector by a border that stays the same, so that its sign does.
        border = np.block([[matrix(x), left[:, None]], [right[None], np.zeros((1, 1))]])
        p = np.linalg.solve(border.T, np.append(np.zeros(n), 1.0))[:n]
        return {"curvature": float(0.5 * p @ second(x)[0] / np.linalg.norm(p))}

    def tests(x: Array) -> dict[str, float]:
        eigenvalues = steady.eigenvalues(curve.point(x))
        others = np.delete(eigenvalues, np.argmin(np.abs(eigenvalues)))
        products = [np.prod(np.delete(eigenvalues, i)) for i in range(len(eigenvalues))]
        return {
            "cusp": numbers(x)["curvature"],
            "Bogdanov-Takens": float(np.sum(products).real),
            "zero-Hopf": hopf_test(others),
        }

    return _Extended(residual, start, tests, numbers, {}, curve.least(start))
