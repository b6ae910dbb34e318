"""Measures of quantities over a period: extremes, first harmonics, means.

Quantities that are linear in the state with constant coefficients, such as unknowns of structures,
follow from the state alone: their harmonics are sums of those of the state. If they are
combinations of inertial coordinates, their extremes are at zeros of their rates, which are states.
All other formulas are evaluated along the motion: extremes are bracketed between samples, harmonics
and means are integrated by Gauss quadrature whose panels are halved until the result converges. A
formula with two extremes between two samples may be missed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import AnyArray, Array
from stickslip.motion.between.formulas import Along, evaluated, read_formula
from stickslip.numerics.levels import FEW_ROUNDINGS, TINIEST
from stickslip.numerics.ratios import ratio
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.return_map.recurrence import modes_of_structures
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(20)
_PARTS = 16  # panels per shortest wavelength of interest
_DOUBLINGS = 6
_SAMPLES = 16  # samples of a step, between which a quantity has at most one extremum
_SAMPLES_OF_ALL = 1000
# number of refinements; the error of an extreme value is the square of the error of its time
_REFINED = 6
_EXACT = 1e-13  # a smaller change, relative to the largest value, is a rounding error
_CUTS = 8  # parts into which the neighbourhood of an extremum is divided each time
_CUT_TIMES = 26  # largest number of divisions: enough to locate a kink
_SINGULAR = 1e-10  # largest rounding error, relative to the largest value
_KINK_KNOWN = 12  # number of refinements of a kink


# -- what is linear in the state -------------------------------------------------------------------


@dataclass(frozen=True)
class LinearForm:
    """A quantity as a linear combination of parts of the state, and a function of time.

    Attributes
    ----------
    rest : Expr
        Of t and parameters.
    """

    weights: dict[str, float]
    rest: Expr = ex.ZERO


def linear_form(
    state: Iterable[str], parameters: Mapping[str, float], formula: Expr
) -> LinearForm | None:
    """A formula as a linear form of the state; None if it is not linear with constant
    coefficients."""
    felt = sorted(formula.symbols - parameters.keys() - {"t"})
    if not set(state).issuperset(felt) or ex.bends(formula, felt):
        return None
    slopes = {x: ex.derivative(formula, x) for x in felt}
    if any(slope.symbols - parameters.keys() for slope in slopes.values()):
        return None
    rest = ex.substitute(formula, dict.fromkeys(felt, ex.ZERO))
    return LinearForm({x: ex.evaluate(e, parameters) for x, e in slopes.items()}, rest)


# -- extremes --------------------------------------------------------------------------------------


Extremes = dict[str, tuple[float, float]]


def extrema(motion: Trajectory, formulas: Mapping[str, Expr] | None = None) -> Extremes:
    """Least and largest values over a motion: of unknowns of structures and outputs, or of some
    formulas; none of a motion that takes no time.

    Parameters
    ----------
    formulas : mapping of str to Expr, optional
    """
    forms: dict[str, LinearForm] = {}
    if formulas is None:
        unknowns = motion.system.unknowns
        forms = {x: LinearForm(row) for x, row in unknowns.items() if x[:2] != "d_"}
        formulas = motion.system.declaration.outputs
    others: dict[str, Expr] = {}
    state, inertial = motion.system.declaration.places, set(motion.system.declaration.inertial)
    for name, formula in formulas.items():
        form = linear_form(state, motion.parameters, formula)
        if form and form.weights.keys() <= inertial and not ex.bends(form.rest, ["t"]):
            forms[name] = form
        else:
            others[name] = formula
    steps = np.flatnonzero(np.diff(motion.knots.time) > 0.0)
    if not (forms or others) or not len(steps):
        return {}
    times, index = _samples(motion, steps)
    smooth = _where_rates_vanish(motion, forms, times, index) if forms else {}
    return smooth | (_bracketed(motion, others, times, index) if others else {})


def _samples(motion: Trajectory, steps: Array) -> tuple[Array, Array]:
    """Sampled times of a motion, including both ends of each step, and their steps."""
    k = motion.knots
    lengths = np.diff(k.time)[steps]
    counts = _SAMPLES + np.ceil(_SAMPLES_OF_ALL * lengths / np.sum(lengths)).astype(int)
    index = np.repeat(steps, counts)
    place = np.arange(len(index)) - np.repeat(np.cumsum(counts) - counts, counts)
    times = k.time[index] + place * np.repeat(lengths / (counts - 1), counts)
    return np.minimum(times, k.time[index + 1]), index


def _where_rates_vanish(
    motion: Trajectory, forms: Mapping[str, LinearForm], times: Array, index: Array
) -> Extremes:
    """Extremes of linear forms of inertial coordinates: at samples, and at every turn between two
    of a step."""
    places = motion.system.declaration.places
    rows = np.zeros((len(places), 2, len(forms)))  # coefficients of the forms and of their rates
    for i, form in enumerate(forms.values()):
        for x, weight in form.weights.items():
            rows[places[x], 0, i] = rows[places[f"d_{x}"], 1, i] = weight
    rests = [form.rest for form in forms.values()]
    moved = [*rests, *(ex.derivative(rest, "t") for rest in rests)]
    timed = any(rest is not ex.ZERO for rest in rests)

    def besides(at: Array) -> Array:
        """Contribution of time, shape (times, 2, forms)."""
        if not timed:
            return np.zeros((1, 2, len(rests)))
        values = evaluated(moved, {**motion.parameters, "t": at}, len(at))
        return np.moveaxis(values.reshape(2, len(rests), -1), 2, 0)

    states, added = motion.states_at(times, index), besides(times)
    seen, slopes = states @ rows[:, 0] + added[:, 0], states @ rows[:, 1] + added[:, 1]
    low, high = np.min(seen, axis=0), np.max(seen, axis=0)
    # every turn of each of them, between two samples of a step
    same = (np.diff(index) == 0)[:, None]
    at, which = np.nonzero((slopes[:-1] * slopes[1:] < 0.0) & same)
    a, b, f, g = times[at], times[at + 1], slopes[at, which], slopes[at + 1, which]
    for _ in range(_REFINED if len(at) else 0):
        middle = (a * g - b * f) / (g - f)
        states, added = motion.states_at(middle, index[at]), besides(middle)
        more = added[np.arange(len(added)), :, which] if timed else added[0, :, which]
        value, h = np.einsum("tx,xkt->kt", states, rows[:, :, which]) + more.T
        np.minimum.at(low, which, value)
        np.maximum.at(high, which, value)
        # the extremum is on the other side; the value at a retained end is halved (Illinois)
        left = h * f > 0.0
        a, f, g = np.where(left, middle, a), np.where(left, h, f / 2.0), np.where(left, g / 2.0, h)
        b = np.where(left, b, middle)
    ends = zip(map(float, low), map(float, high), strict=True)
    return dict(zip(forms, ends, strict=True))


def _bracketed(
    motion: Trajectory, formulas: Mapping[str, Expr], times: Array, index: Array
) -> Extremes:
    """Extremes of any formulas: at samples, and in the neighbourhoods of samples that may contain
    lower (higher) values, which are bisected until the formulas are linear in them."""
    along = Along(motion, [*formulas.values()])
    seen = along(times, index)
    size = np.maximum(np.max(np.abs(seen), axis=0), TINIEST)
    edge = np.diff(index) != 0
    first, last = np.r_[True, edge], np.r_[edge, True]  # first and last samples of steps
    share = np.arange(_CUTS + 1) / _CUTS
    ends: list[Array] = []
    for sign in (1.0, -1.0):
        lowest = np.min(sign * seen, axis=0)
        at, which = _may_be_lower(sign * seen, first, last, FEW_ROUNDINGS * size)
        steps = index[at]
        a, b = times[np.where(first[at], at, at - 1)], times[np.where(last[at], at, at + 1)]
        for _ in range(_CUT_TIMES):
            if not len(at):
                break
            inside = a[:, None] + (b - a)[:, None] * share
            values = along(inside.ravel(), np.repeat(steps, _CUTS + 1))
            rows = np.arange(len(at))
            y = sign * values.reshape(*inside.shape, len(formulas))[rows, :, which]
            here = np.argmin(y, axis=1)
            np.minimum.at(lowest, which, y[rows, here])
            # A curve that is straight up to rounding errors has its minimum at an end.
            left = np.max(np.abs(np.diff(y, 2, axis=1)), axis=1) > FEW_ROUNDINGS * size[which]
            a = inside[rows, np.maximum(here - 1, 0)][left]
            b = inside[rows, np.minimum(here + 1, _CUTS)][left]
            at, which, steps = at[left], which[left], steps[left]
        ends.append(sign * lowest)
    low, high = (map(float, end) for end in ends)
    return dict(zip(formulas, zip(low, high, strict=True), strict=True))


def _may_be_lower(y: Array, first: Array, last: Array, flat: Array) -> tuple[Array, Array]:
    """Samples near which functions may be lower than at all samples, and these functions.

    Between samples a function is assumed to fall below a sample by less than the difference from
    its neighbours.

    Parameters
    ----------
    y : array, shape (samples, functions)
    first, last : array of bool, shape (samples,)
        Whether a sample has no neighbour on that side.
    flat : array, shape (functions,)
        Differences that are rounding errors.
    """
    with np.errstate(invalid="ignore"):
        rise = np.diff(y, axis=0)
    beyond = np.full((1, y.shape[1]), np.inf)
    before = np.where(first[:, None], np.inf, np.concatenate([beyond, -rise]))
    after = np.where(last[:, None], np.inf, np.concatenate([rise, beyond]))
    step = np.maximum(np.where(first[:, None], 0.0, before), np.where(last[:, None], 0.0, after))
    turns = (before >= 0.0) & (after >= 0.0) & (step > flat)
    at, which = np.nonzero(turns & (y - step <= np.min(y, axis=0)))
    return at, which


# -- harmonics -------------------------------------------------------------------------------------


def harmonics(motion: Trajectory, shift: Array, order: int) -> tuple[Array, float]:
    """The coefficients c of Re(c exp(2πi·order·t/T)) of the state in the motion of a period,
    without the drift.

    c = (2/T) ∫ y exp(−2πi·order·t/T) dt.

    Parameters
    ----------
    motion : Trajectory
        One period of the motion.
    shift : array, shape (n,)
        Of the state, in that period.

    Returns
    -------
    array of complex, shape (n,)
    float
        By how much the last halving has changed them, relative to the size of the motion.
    """
    if len(motion.problem.rows.bodies):
        found = _of_linear_pieces(motion, shift, order)
        if found is not None:
            return found
    c, change = _wave(motion, motion.states_at, shift, order)
    return c, float(np.max(change))


def harmonics_of(
    motion: Trajectory, formulas: Mapping[str, Expr], of_state: Mapping[str, complex], order: int
) -> tuple[dict[str, complex], dict[str, float]]:
    """First harmonics of formulas, from those of the state where linear, and the change of the
    remaining part by the last halving of the panels.

    Parameters
    ----------
    motion : Trajectory
        One period of the motion.
    of_state : mapping of str to complex
        Harmonics of all parts of the state.
    """
    found: dict[str, complex] = {}
    left: dict[str, Expr] = {}
    state = motion.system.declaration.places
    for name, formula in formulas.items():
        form = linear_form(state, motion.parameters, formula)
        weights = {} if form is None else form.weights
        found[name] = sum((w * of_state[x] for x, w in weights.items()), 0j)
        rest = formula if form is None else form.rest
        if not ex.is_number(rest):
            left[name] = rest
    errors = dict.fromkeys(formulas, 0.0)
    if not left:
        return found, errors
    along = Along(motion, [*left.values()])
    k = motion.knots
    steps = np.flatnonzero(np.diff(k.time) > 0.0)
    ends = along(k.time[[0, -1]], steps[[0, -1]])
    kinks = _kinks(motion, left.values())
    more, change = _wave(motion, along, ends[1] - ends[0], order, kinks)
    for name, c, error in zip(left, more.tolist(), change.tolist(), strict=True):
        found[name] += c
        errors[name] = error
    return found, errors


def _wave(
    motion: Trajectory,
    values: Callable[[Array, Array], Array],
    shift: Array,
    order: int,
    kinks: tuple[Array, Array] | None = None,
) -> tuple[Array, Array]:
    """Harmonics of functions of times and steps, by quadrature.

    Parameters
    ----------
    values : callable
        Times, and steps in which they are -> functions, shape (times, functions).
    shift : array, shape (functions,)
    kinks : pair of arrays, optional
        Of the functions, see :func:`_kinks`.
    """
    start = float(motion.knots.time[0])
    period = float(motion.knots.time[-1]) - start

    def wave(times: Array, index: Array) -> tuple[Array, AnyArray]:
        home = values(times, index) - np.outer((times - start) / period, shift)
        return home, 2.0 * np.exp(-2j * np.pi * order * times / period)

    return _averaged(motion, wave, order, kinks)


def _of_linear_pieces(motion: Trajectory, shift: Array, order: int) -> tuple[Array, float] | None:
    """The same of a motion whose pieces are linear, y' = A y + g(t), however fast its modes are;
    None if one is not, or if one of its natural frequencies is Ω.

    By parts, (iΩ − A) ∫ y exp(−iΩt) dt = ∫ g exp(−iΩt) dt − [y exp(−iΩt)] in each step, where g is
    as smooth as the loads are. A free mode without damping, as in a backbone before any contact
    slips, makes the matrix singular.
    """
    k, problem = motion.knots, motion.problem
    pieces = Pieces(problem.compiled.equations)
    p = np.array([motion.parameters[name] for name in motion.system.parameters])
    start, n = float(k.time[0]), k.state.shape[1]
    period = float(k.time[-1]) - start
    wave = 2.0 * np.pi * order / period
    fastest = max(wave, float(np.max(np.abs(problem.constants.omega), initial=0.0)))
    every = np.zeros((2, n), complex)  # with panels, and with half as long ones
    sizes = np.zeros((2, n))  # sizes of the terms of the sums
    known = dict[int, Array]()
    steps = np.flatnonzero(np.diff(k.time) > 0.0)
    numbers = pieces.numbers(k.mode[steps], k.region[steps])
    # Steps of one piece, one after the other, are one.
    changed = (
        (np.diff(numbers) != 0) | (np.diff(steps) != 1) | np.isin(steps[1:], motion.state_jumps)
    )
    begins = np.r_[True, changed]
    firsts, lasts = steps[begins], steps[np.r_[begins[1:], True]]
    for i, j, number in zip(firsts, lasts + 1, numbers[begins].tolist(), strict=True):
        piece = pieces.made[number]
        if not piece.constant:
            return None
        if number not in known:
            y = np.zeros(n)
            (J,) = piece.jacobian(k.time[i : i + 1], y[:, None], p)
            known[number] = np.linalg.inv(1j * wave * np.eye(n) - J[:, :n])
        a, b = float(k.time[i]), float(k.time[j])
        ends = np.exp(-1j * wave * np.array([a, b]))
        jump = k.state[j] * ends[1] - k.state[i] * ends[0]
        edge = np.abs(k.state[j]) + np.abs(k.state[i])
        for m in range(2):
            # Panels resolve the fastest wave of loads and harmonic, not the modes of the structure.
            count = (m + 1) * math.ceil(_PARTS * fastest * (b - a) / (2.0 * np.pi))
            width = (b - a) / count
            middle = a + (np.arange(count) + 0.5) * width
            times = (middle[:, None] + 0.5 * width * _NODES).ravel()
            weights = np.tile(0.5 * width * _WEIGHTS, count) * np.exp(-1j * wave * times)
            loads = piece.rates(times, np.zeros((n, len(times))), p)
            every[m] += known[number] @ (loads @ weights - jump)
            sizes[m] += np.abs(known[number]) @ (edge + np.abs(loads) @ np.abs(weights))
    # The harmonic of the drift shift·t/T over a period, in closed form.
    drift = shift / period * 1j * period / wave * np.exp(-1j * wave * start)
    found = 2.0 / period * (every - drift)
    size = np.max(np.abs(k.state), axis=0)
    for own in modes_of_structures(motion.problem):
        size[own] = np.max(size[own])
    # A component that has just begun to slide moves by rounding errors of the others.
    rounding = 2.0 / period * FEW_ROUNDINGS * sizes[1]
    for own in modes_of_structures(motion.problem):
        if not np.max(rounding[own]) <= _SINGULAR * np.max(size[own]):
            return None
    change = np.maximum(np.abs(found[1] - found[0]) - rounding, 0.0)
    return found[1], float(np.max(ratio(change, size)))


# -- means -----------------------------------------------------------------------------------------


def mean(motion: Trajectory, formula: str) -> tuple[float, float]:
    """The mean of a formula over a period, (1/T) ∫ f dt, and its change by the last halving of the
    panels, relative to the largest value.

    Parameters
    ----------
    motion : Trajectory
        One period of the motion.
    formula : str
        Of what results show, see :func:`~stickslip.motion.between.formulas.read_formula`.

    Raises
    ------
    DeclarationError
        If it is not a formula of these.
    """
    read = read_formula(motion.system, formula, "formula")
    along = Along(motion, [read])

    def values(times: Array, index: Array) -> tuple[Array, Array]:
        return along(times, index), np.ones(len(times))

    found, change = _averaged(motion, values, 1, _kinks(motion, [read]))
    return float(found[0].real), float(change[0])


def _kinks(motion: Trajectory, formulas: Iterable[Expr]) -> tuple[Array, Array] | None:
    """Times at which formulas have kinks or jumps within steps, and these steps: where a guard
    passes through zero between two samples."""
    guards = {e.args[0] for e in ex.walk(formulas) if e.op == "select"}
    guards = [guard for guard in guards if not guard.symbols <= motion.parameters.keys()]
    steps = np.flatnonzero(np.diff(motion.knots.time) > 0.0)
    if not guards or not len(steps):
        return None
    times, index = _samples(motion, steps)
    along = Along(motion, guards)
    seen = along(times, index)
    same = (np.diff(index) == 0)[:, None]
    at, which = np.nonzero((seen[:-1] * seen[1:] < 0.0) & same)
    a, b, f, g = times[at], times[at + 1], seen[at, which], seen[at + 1, which]
    rows = np.arange(len(at))
    for _ in range(_KINK_KNOWN if len(at) else 0):
        middle = (a * g - b * f) / (g - f)
        h = along(middle, index[at])[rows, which]
        left = h * f > 0.0
        a, f, g = np.where(left, middle, a), np.where(left, h, f / 2.0), np.where(left, g / 2.0, h)
        b = np.where(left, b, middle)
        if np.any(h == 0.0):  # both ends there
            hit = h == 0.0
            a, b = np.where(hit, middle, a), np.where(hit, middle, b)
            f, g = np.where(hit, -1.0, f), np.where(hit, 1.0, g)
    where = (a * g - b * f) / (g - f)
    order = np.lexsort((where, index[at]))
    return where[order], index[at][order]


def _averaged(
    motion: Trajectory,
    values: Callable[[Array, Array], tuple[Array, Array]],
    order: int,
    kinks: tuple[Array, Array] | None = None,
) -> tuple[Array, Array]:
    """(1/T) ∫ f w dt over a period, and its change by the last halving of the panels, relative to
    the largest |f|; NaN for functions that are undefined somewhere.

    Gauss quadrature on the steps, each divided into panels that are halved until the result
    converges.

    Parameters
    ----------
    values : callable
        Times, and steps in which they are -> f, shape (times, functions), and w, shape (times,).
    order : int
        Waves of w in a period.
    kinks : pair of arrays, optional
        Times within steps at which f has kinks, and the steps: panels end there.
    """
    k = motion.knots
    period = float(k.time[-1]) - float(k.time[0])
    steps = np.flatnonzero(np.diff(k.time) > 0.0)
    begin, end = k.time[steps], k.time[steps + 1]
    if kinks is not None:
        more, where = kinks
        begin, end = np.r_[begin, more], np.r_[end, more]
        steps = np.sort(np.r_[steps, where])
        begin, end = np.sort(begin), np.sort(end)
    lengths = end - begin
    counts = np.ceil(_PARTS * order * lengths / period).astype(int).clip(1)
    found, change = np.full(1, np.nan + 0j), np.full(1, np.inf)
    for _ in range(_DOUBLINGS):
        index = np.repeat(steps, counts)
        place = np.arange(len(index)) - np.repeat(np.cumsum(counts) - counts, counts)
        width = np.repeat(lengths / counts, counts)
        middle = np.repeat(begin, counts) + (place + 0.5) * width
        times = (middle[:, None] + 0.5 * width[:, None] * _NODES).ravel()
        weights = (0.5 * width[:, None] * _WEIGHTS).ravel()
        f, w = values(times, np.repeat(index, len(_NODES)))
        known = np.all(np.isfinite(f), axis=0)
        before, found = found, np.full(len(known), np.nan + 0j)
        found[known] = 1.0 / period * (weights * w) @ f[:, known]
        # Between knots a component may be much larger than at them.
        size = np.max(np.abs(f), axis=0)
        change = np.where(known, ratio(np.abs(found - before), size), np.inf)
        if np.max(change[known], initial=0.0) <= _EXACT:
            break
        counts = 2 * counts
    return found, change
