"""Rate-independent evolutions and plays against small steps that know where load and thresholds are
narrow.

An evolution by minimising movements has an error of its own, which it estimates: what is certified
may be off by twice that, in the energy norm. A play is exact.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import stickslip as ss

from ..case import pick
from ..families.curves import CLOSER, Curve, Rng, constant, wave, well, with_a_well
from ..references.quasistatic import Array, follow, play
from ..registry import in_turn
from ..verdict import AGREED, NOT_CERTIFIED, REFUSED, WRONG, Verdict, at_most

STEPS = 2000  # of the reference of evolutions
FINE = 20_000  # … and of plays
CHECKS = 9  # times at which states are compared
ESTIMATES = 2.0  # error estimates that an evolution may be off by
EXACT = 1e-8  # of a play, relative to its largest force
LOOSE = 1e-2  # tolerance of what takes long
PATIENCE = 60.0  # seconds


@dataclass(frozen=True)
class Signal:
    """A function of time: its text, values, and narrow places with widths."""

    text: str
    at: Callable[[Array], Array]
    narrow: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class Case:
    """What the library gets, and the same for the reference.

    Attributes
    ----------
    run : function
        Times ↦ result of the library.
    states : function
        Times ↦ states of the reference, and their error.
    A : ndarray
        Of the energy norm.
    size : float
        Largest force.
    slope : float
        Steepest slope: rounding of times counts as much.
    source : str
        Reproduction.
    """

    family: str
    seed: int
    run: Callable[[Array], Any]
    states: Callable[[Array], tuple[Array, float]]
    A: Array
    size: float
    slope: float
    span: float
    source: str
    exact: bool = False
    numbers: dict[str, Any] = field(default_factory=dict)


FAMILIES: dict[str, Callable[[Rng], dict[str, Any]]] = {}


def family(make: Callable[[Rng], dict[str, Any]]) -> Callable[[Rng], dict[str, Any]]:
    """Register a family under its name in words."""
    FAMILIES[make.__name__.replace("_", " ")] = make
    return make


def draw(name: str, seed: int) -> Case:
    """The case of a family with a seed, the same on every machine."""
    rng = np.random.default_rng([zlib.crc32(name.encode()), seed])
    return Case(name, seed, **FAMILIES[name](rng))


def cases(seed: int = 0, count: int = 100) -> Iterator[Case]:
    """Cases of all families in turn."""
    return in_turn(FAMILIES, draw, seed, count)


# -- signals ---------------------------------------------------------------------------------------


def in_time(curve: Curve, span: float) -> Signal:
    """A curve over the phase, stretched over the span."""
    text = curve.text.replace("(s - ", f"(t/{span!r} - ")
    return Signal(
        text, lambda t: curve.at(t / span), tuple((span * p, span * w) for p, w in curve.narrow)
    )


def smooth(rng: Rng, span: float, amplitude: float) -> Signal:
    """A load that is 0 at the start."""
    own = in_time(wave(rng, 0.0, amplitude, 3, 4), span)
    start = float(own.at(np.zeros(1))[0])
    return Signal(f"{own.text} - {start!r}", lambda t: own.at(t) - start)


def pulsed(rng: Rng, span: float, amplitude: float) -> Signal:
    """A load with a narrow pulse: of no more than a jump is."""
    base = smooth(rng, span, amplitude)
    kind = str(pick(rng, ("V", "Gauss", "Lorentz", "tanh", "root")))
    bump = in_time(well(rng, kind), span)
    height = float(rng.uniform(0.5, 3.0) * pick(rng, (-1.0, 1.0)))
    height *= amplitude
    start = float(bump.at(np.zeros(1))[0])
    text = f"{base.text} + {height!r}*({bump.text} - {start!r})"
    return Signal(text, lambda t: base.at(t) + height * (bump.at(t) - start), bump.narrow)


def threshold(rng: Rng, span: float) -> Signal:
    """Constant, a wave, or a dip."""
    low = float(rng.uniform(0.3, 1.0))
    match int(rng.integers(3)):
        case 0:
            return Signal(f"{low!r}", lambda t: low + 0.0 * t)
        case 1:
            return in_time(wave(rng, low, 0.3, 2, 4), span)
        case _:
            return in_time(
                with_a_well(
                    rng, 0.1 * low, str(pick(rng, ("V", "Gauss", "Lorentz", "tanh", "root")))
                ),
                span,
            )


def dense(span: float, signals: list[Signal], count: int) -> Array:
    """Times that see everything."""
    zoomed = [p + w * CLOSER for s in signals for p, w in s.narrow]
    t = np.unique(np.concatenate([np.linspace(0.0, span, count + 1), *zoomed]))
    return t[(t >= 0.0) & (t <= span)]


def steepest(signals: list[Signal], height: float) -> float:
    """Slope of the narrowest feature."""
    return max((height / w for s in signals for _, w in s.narrow), default=0.0)


# -- plays -----------------------------------------------------------------------------------------


def scalar(
    load: Signal, plus: Signal, minus: Signal, a: float, span: float, **how: Any
) -> dict[str, Any]:
    """A play."""
    signals = [load, plus, minus]
    times = dense(span, signals, FINE)
    size = float(max(np.abs(s.at(times)).max() for s in signals))

    def states(at: Array) -> tuple[Array, float]:
        found = play(
            times,
            lambda t: (load.at(t) - plus.at(t)) / a,
            lambda t: (load.at(t) + minus.at(t)) / a,
            0.0,
            at,
        )
        return found[:, None], 0.0

    return {
        "states": states,
        "A": np.array([[a]]),
        "size": size,
        "slope": steepest(signals, size),
        "span": span,
        **how,
    }


@family
def play_with_a_pulse(rng: Rng) -> dict[str, Any]:
    span, a = float(rng.uniform(1.0, 30.0)), float(rng.uniform(0.3, 3.0))
    load = pulsed(rng, span, 1.0)
    plus = threshold(rng, span)
    minus = threshold(rng, span)
    thresholds = f"({plus.text!r}, {minus.text!r})"
    call = f"ss.play({load.text!r}, {thresholds}, (0.0, {span!r}), initial=0.0, stiffness={a!r})"

    def run(at: Array) -> Any:
        return ss.play(load.text, (plus.text, minus.text), (0.0, span), initial=0.0, stiffness=a)

    return scalar(load, plus, minus, a, span, run=run, source=call, exact=True)


@family
def play_with_a_threshold_that_oscillates(rng: Rng) -> dict[str, Any]:
    span = float(rng.uniform(1.0, 10.0))
    periods = int(rng.integers(2, 12))
    epsilon = span / periods
    load = smooth(rng, span, 1.0)
    kind = str(pick(rng, ("V", "Gauss", "Lorentz", "tanh", "root")))
    curve = with_a_well(rng, float(rng.uniform(0.0, 0.5)), kind)
    centres = [((k + p) * epsilon, w * epsilon) for k in range(periods) for p, w in curve.narrow]
    rho = Signal(curve.text, lambda t: curve.at(t / epsilon), tuple(centres))
    call = (
        f"ss.play({load.text!r}, {curve.text!r}, (0.0, {span!r}), initial=0.0, epsilon={epsilon!r})"
    )

    def run(at: Array) -> Any:
        return ss.play(load.text, curve.text, (0.0, span), initial=0.0, epsilon=epsilon)

    return scalar(load, rho, rho, 1.0, span, run=run, source=call, exact=True)


# -- minimising movements --------------------------------------------------------------------------


def stiffness(rng: Rng, n: int, spread: float = 1.0) -> Array:
    """A symmetric positive definite matrix."""
    Q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    A = Q @ np.diag(10.0 ** rng.uniform(-spread, spread, n) ** 1.0) @ Q.T
    return 0.5 * (A + A.T)


@dataclass(frozen=True)
class Problem:
    """An evolution: A, loads, and what the reference follows, y = B z with boxes or discs.

    Attributes
    ----------
    B : ndarray
        Ψ(z′) = Σ of the reference's potentials of y′.
    bounds : list of (Signal, Signal)
        Lower (as a positive number) and upper threshold of every component, or of every group.
    """

    A: Array
    loads: list[Signal]
    B: Array
    bounds: list[tuple[Signal, Signal]]
    discs: bool
    span: float


def stepped(problem: Problem, potential: Any, text: str, **options: Any) -> dict[str, Any]:
    """The case of an evolution."""
    p = problem
    texts = [load.text for load in problem.loads]
    n = len(p.A)
    inverse = np.linalg.inv(p.B)
    signals = [*p.loads, *(s for pair in p.bounds for s in pair)]
    A = inverse.T @ p.A @ inverse
    averaged = options.pop("averaged", False)
    tolerance = options.pop("tolerance", 1e-3)
    formulas = options.pop("load", texts)

    def at(times: Array) -> tuple[Array, Array, Array]:
        loads = np.column_stack([s.at(times) for s in p.loads]) @ inverse
        low, high = (np.column_stack([pair[i].at(times) for pair in p.bounds]) for i in (0, 1))
        return loads, -low, high

    def states(wanted: Array) -> tuple[Array, float]:
        times = np.union1d(dense(p.span, signals, STEPS), wanted)
        found = [_followed(A, at, times, p.discs, n)[np.searchsorted(times, wanted)]]
        sparse = np.union1d(times[::2], wanted)
        found.append(_followed(A, at, sparse, p.discs, n)[np.searchsorted(sparse, wanted)])
        one, other = (y @ inverse.T for y in found)
        return one, float(np.sqrt(np.einsum("ki,ij,kj->k", one - other, p.A, one - other).max()))

    def run(wanted: Array) -> Any:
        evolution = ss.Evolution(
            p.A, formulas, potential, np.zeros(n), span=(0.0, p.span), **options
        )
        return ss.evolve(
            evolution.averaged() if averaged else evolution, output=wanted, tolerance=tolerance
        )

    span = (0.0, p.span)
    more = "".join(f", {k}={v!r}" for k, v in options.items())
    given = f"{p.A.tolist()!r}, {texts!r}, {text}, {[0.0] * n!r}, span={span!r}{more}"
    evolved = "problem.averaged()" if averaged else "problem"
    source = (
        f"problem = ss.Evolution({given})\nhistory = ss.evolve({evolved}, tolerance={tolerance!r})"
    )
    times = dense(p.span, signals, STEPS)
    size = float(max(np.abs(s.at(times)).max() for s in signals))
    slope = steepest(signals, size)
    return {
        "run": run,
        "states": states,
        "A": p.A,
        "size": size,
        "slope": slope,
        "span": p.span,
        "source": source,
    }


def _followed(
    A: Array, at: Callable[[Array], tuple[Array, Array, Array]], times: Array, discs: bool, n: int
) -> Array:
    loads, low, high = at(times)
    return follow(A, loads, low, high, discs, np.zeros(n))


def phased(curve: Curve, epsilon: float, periods: int) -> Signal:
    """A threshold over time."""
    centres = [((k + p) * epsilon, w * epsilon) for k in range(periods) for p, w in curve.narrow]
    return Signal(curve.text, lambda t: curve.at(t / epsilon), tuple(centres))


@family
def one_component_with_a_pulse(rng: Rng) -> dict[str, Any]:
    span = float(rng.uniform(1.0, 10.0))
    a = float(rng.uniform(0.3, 3.0))
    low = float(rng.uniform(0.3, 1.0))
    rho = Signal(f"{low!r}", lambda t: low + 0.0 * t)
    problem = Problem(
        np.array([[a]]), [pulsed(rng, span, 1.0)], np.eye(1), [(rho, rho)], False, span
    )
    return stepped(problem, ss.WeightedL1([low]), f"ss.WeightedL1({[low]!r})")


@family
def components_with_a_pulse(rng: Rng) -> dict[str, Any]:
    span = float(rng.uniform(1.0, 10.0))
    n = int(rng.integers(2, 5))
    loads = [pick(rng, (pulsed, smooth))(rng, span, 1.0) for _ in range(n)]
    up, down = (rng.uniform(0.3, 1.0, n).tolist() for _ in range(2))
    bounds = [
        (in_time(constant(d), span), in_time(constant(u), span))
        for d, u in zip(down, up, strict=True)
    ]
    problem = Problem(stiffness(rng, n, 0.5), loads, np.eye(n), bounds, False, span)
    return stepped(problem, ss.WeightedL1(up, down), f"ss.WeightedL1({up!r}, {down!r})")


@family
def thresholds_with_dips(rng: Rng) -> dict[str, Any]:
    span = float(rng.uniform(1.0, 5.0))
    n = int(rng.integers(1, 3))
    periods = int(rng.integers(1, 4))
    epsilon = span / periods
    kinds = ("V", "Gauss", "Lorentz", "tanh", "root")
    curves = [
        with_a_well(rng, float(rng.uniform(0.05, 0.3)), str(pick(rng, kinds))) for _ in range(n)
    ]
    rhos = [phased(c, epsilon, periods) for c in curves]
    texts = [c.text for c in curves]
    problem = Problem(
        stiffness(rng, n, 0.3),
        [smooth(rng, span, 1.0) for _ in range(n)],
        np.eye(n),
        [(r, r) for r in rhos],
        False,
        span,
    )
    return stepped(problem, ss.WeightedL1(texts), f"ss.WeightedL1({texts!r})", epsilon=epsilon)


@family
def groups_with_a_pulse(rng: Rng) -> dict[str, Any]:
    span = float(rng.uniform(1.0, 5.0))
    groups = int(rng.integers(1, 3))
    radii = rng.uniform(0.3, 1.0, groups).tolist()
    loads = [pick(rng, (pulsed, smooth))(rng, span, 1.0) for _ in range(2 * groups)]
    edges = [in_time(constant(r), span) for r in radii]
    bounds = list(zip(edges, edges, strict=True))
    problem = Problem(
        stiffness(rng, 2 * groups, 0.5), loads, np.eye(2 * groups), bounds, True, span
    )
    return stepped(problem, ss.GroupNorm(radii), f"ss.GroupNorm({radii!r})", tolerance=LOOSE)


@family
def ellipse_with_a_pulse(rng: Rng) -> dict[str, Any]:
    span = float(rng.uniform(1.0, 5.0))
    root = rng.normal(size=(2, 2)) + np.eye(2)
    shape = root @ root.T
    one = in_time(constant(1.0), span)
    loads = [pulsed(rng, span, 1.0), smooth(rng, span, 1.0)]
    problem = Problem(stiffness(rng, 2, 0.5), loads, root.T, [(one, one)], True, span)
    return stepped(
        problem, ss.Ellipsoid(shape), f"ss.Ellipsoid({shape.tolist()!r})", tolerance=LOOSE
    )


@family
def parallelogram_with_a_pulse(rng: Rng) -> dict[str, Any]:
    span = float(rng.uniform(1.0, 5.0))
    B = rng.normal(size=(2, 2)) + 1.5 * np.eye(2)
    # Σ |(B v)_i| is the support function of the points Bᵀ (±1, ±1).
    corners = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) @ B
    loads = [pulsed(rng, span, 1.0), smooth(rng, span, 1.0)]
    one = in_time(constant(1.0), span)
    problem = Problem(stiffness(rng, 2, 0.5), loads, B, [(one, one)] * 2, False, span)
    return stepped(
        problem,
        ss.Polytope(vertices=corners),
        f"ss.Polytope(vertices={corners.tolist()!r})",
        tolerance=LOOSE,
    )


@family
def averaged_thresholds(rng: Rng) -> dict[str, Any]:
    span = float(rng.uniform(1.0, 10.0))
    n = int(rng.integers(1, 4))
    curves = [with_a_well(rng, float(rng.uniform(0.2, 1.0))) for _ in range(n)]
    thresholds = [in_time(constant(c.least), span) for c in curves]
    bounds = list(zip(thresholds, thresholds, strict=True))
    problem = Problem(
        stiffness(rng, n, 0.5),
        [smooth(rng, span, 1.0) for _ in range(n)],
        np.eye(n),
        bounds,
        False,
        span,
    )
    texts = [c.text for c in curves]
    return stepped(problem, ss.WeightedL1(texts), f"ss.WeightedL1({texts!r})", averaged=True)


@family
def averaged_ellipse(rng: Rng) -> dict[str, Any]:
    span = float(rng.uniform(1.0, 3.0))
    long, short = (float(x) for x in (rng.uniform(1.0, 2.0), rng.uniform(0.3, 0.9)))
    mean = 0.5 * (long**2 + short**2)
    half = 0.5 * (long**2 - short**2)
    p = float(rng.uniform())
    c, s = f"{half!r}*cos(2*pi*(s - {p!r}))", f"{half!r}*sin(2*pi*(s - {p!r}))"
    shape = [[f"{mean!r} + {c}", s], [s, f"{mean!r} - {c}"]]
    loads = [smooth(rng, span, 1.0) for _ in range(2)]
    radius = in_time(constant(short), span)
    problem = Problem(stiffness(rng, 2, 0.3), loads, np.eye(2), [(radius, radius)], True, span)
    return stepped(
        problem, ss.Ellipsoid(shape), f"ss.Ellipsoid({shape!r})", averaged=True, tolerance=LOOSE
    )


@family
def pulse_of_a_function(rng: Rng) -> dict[str, Any]:
    """A pulse in a Python function may be missed; then the result says how finely it has looked."""
    span, low = float(rng.uniform(1.0, 10.0)), float(rng.uniform(0.3, 1.0))
    load = pulsed(rng, span, 1.0)
    rho = in_time(constant(low), span)
    problem = Problem(np.eye(1), [load], np.eye(1), [(rho, rho)], False, span)
    given = {"load": lambda t: [float(load.at(np.array([t]))[0])]}
    return stepped(problem, ss.WeightedL1([low]), f"ss.WeightedL1({[low]!r})", **given)


# -- the judge -------------------------------------------------------------------------------------


def judge(case: Case) -> Verdict:
    """States at a few times against the reference."""
    at = np.linspace(0.0, case.span, CHECKS)
    try:
        with at_most(PATIENCE):
            result = case.run(at)
            certificate = result.certificate
            found = result.position(at)[:, None] if case.exact else result.z
    except Exception as error:  # whatever it raises, it gave no result
        return Verdict(REFUSED, f"{type(error).__name__}: {str(error).split(':')[0]}")
    if not case.exact and not result.outcome.ok:
        return Verdict(REFUSED, result.outcome.label, {"detail": result.detail})
    expected, error = case.states(at)
    off = found - expected
    difference = float(np.sqrt(np.einsum("ki,ij,kj->k", off, case.A, off).max()))
    stiff = float(np.linalg.eigvalsh(case.A)[0])
    rounding = 64.0 * np.spacing(case.span) * case.slope + EXACT * case.size
    allowed = rounding / np.sqrt(stiff) + error
    if not case.exact:
        allowed += ESTIMATES * certificate["error of z"].value
    scale = case.size / np.sqrt(stiff)
    numbers = {
        "difference": difference / scale,
        "allowed": allowed / scale,
        "reference": error / scale,
    }
    right = difference <= allowed
    if certificate.ok and not certificate["samples"].value:
        return Verdict(AGREED, "", numbers) if right else Verdict(WRONG, "another motion", numbers)
    if certificate.ok:
        return Verdict(NOT_CERTIFIED, f"as sampled; {'right' if right else 'wrong'}", numbers)
    reasons = ", ".join(residual.name for residual in certificate.residuals if not residual.ok)
    return Verdict(NOT_CERTIFIED, f"{reasons}; {'right' if right else 'wrong'}", numbers)


def reproduction(case: Case) -> str:
    """A script that repeats what the library did."""
    return f"import stickslip as ss\n{case.source}"
