"""Steps of a first variation by the eigenvalues of its Jacobian, in compiled loops: exact for steps
of many periods of the fastest mode.

With a constant Jacobian A, y' = A y + g(t) with A = V Λ L, and a perturbation is multiplied by V
exp(hΛ) L. A parameter adds V φ, with the derivative A_p y + g_p of the rates with respect to it,

    φ_b = ∫ exp((h − s)λ_b) L_b (A_p y(s) + g_p(s)) ds.

The loads g and g_p vary slowly compared with the modes: they are interpolated at Gauss nodes, and
the integrals of exponentials times Legendre polynomials are known, e^{z/2} (−1)ᵈ i_d(z/2) with the
modified spherical Bessel functions i_d. The state is a sum of modes, y = Re Σ V_j w_j with w_j' =
λ_j w_j + γ_j and γ = L g, and by parts

    (λ_j − λ_b) ∫ exp((h − s)λ_b) w_j ds = w_j(h) − exp(hλ_b) w_j(0) − ∫ exp((h − s)λ_b) γ_j ds,

where both exponents are the same, ∫ exp((h − s)λ) w ds = h exp(hλ) w(0) + ∫ (h − s) exp((h − s)λ) γ
ds.

References
----------
NIST Digital Library of Mathematical Functions, 10.47, 10.51 and 18.17.
"""

from __future__ import annotations

import cmath
import math

import numpy as np

from stickslip.arrays import Array
from stickslip.orbits.fields.engine.collocation import NODES
from stickslip.orbits.fields.engine.interpreter import perform
from stickslip.orbits.fields.engine.tables import (
    DECOMPOSED,
    STAGES,
    Listed,
    Pass,
    PassSpace,
    time_of,
)
from stickslip.translator import compiled

PADE_REACH = 1.5
"""Largest |eigenvalue| × step of a collocation step: its Padé approximant of exp is exact to
rounding there."""
MANY = 8
"""Collocation steps that cost as much as one step by eigenvalues, including a part of the
decomposition."""
LARGE = 16
"""Number of states from which every step longer than a collocation step is taken by eigenvalues,
because the exponential of a matrix costs several times as much."""
_SMOOTH = 0.25  # largest frequency of the loads × step of an interpolation
_FINE = 24  # number of Gauss nodes for integrals of slow exponentials
_FAST = 12.0  # |z| above which they follow from a recurrence
_SAME = 1e-7  # difference of exponents × step that counts as zero
_PROBE = 2.0**100  # a state so large that terms independent of it are negligible


def _legendre() -> tuple[Array, Array, Array]:
    """The argument 1 − x of exponentials at fine Gauss nodes x on [0, 1]; Legendre's polynomials
    there times weights, shape (degrees, FINE); and their coefficients in the Lagrange polynomials
    of the nodes, shape (STAGES, degrees)."""
    x, w = np.polynomial.legendre.leggauss(_FINE)
    fine = np.polynomial.legendre.legvander(x, STAGES).T * (0.5 * w)
    x, w = np.polynomial.legendre.leggauss(STAGES)
    degrees = 2 * np.arange(STAGES) + 1
    coefficients = 0.5 * w[:, None] * degrees * np.polynomial.legendre.legvander(x, STAGES - 1)
    return 0.5 * (1.0 - np.polynomial.legendre.leggauss(_FINE)[0]), fine.copy(), coefficients.copy()


_LEFT, _WEIGHED, _COEFFICIENTS = _legendre()


@compiled(inline=True)
def spans_many(listed: Listed, run: Pass, w: int, h: float) -> bool:
    """Return whether a step by eigenvalues is cheaper."""
    many = MANY if run.knots.state.shape[1] < LARGE else 1
    return bool(h * max(run.drives, listed.spectra.rate[w]) > many * PADE_REACH)


@compiled(inline=True)
def by_eigenvalues(listed: Listed, run: Pass, i: int) -> bool:
    """Return whether the step from a knot is taken by eigenvalues."""
    w = run.piece[i]
    if run.modal == 0 or listed.steady[w] == 0 or listed.spectra.state[w] != DECOMPOSED:
        return False
    return spans_many(listed, run, w, time_of(run, i + 1) - time_of(run, i))


@compiled(brief=True)
def put_moments(z: complex, work: PassSpace, b: int) -> None:
    """Put ∫₀¹ exp(z (1 − x)) ℓ(x) dx into a column of the moments, with ℓ the Lagrange polynomial
    of each node, and ∫₀¹ (1 − x) exp(z (1 − x)) ℓ(x) dx into one of the later moments."""
    e = work.legendre
    for d in range(STAGES + 1):
        e[d] = complex(0.0, 0.0)
    if abs(z.real) + abs(z.imag) <= _FAST:
        for k in range(_FINE):
            grown = cmath.exp(z * _LEFT[k])
            for d in range(STAGES + 1):
                e[d] += _WEIGHED[d, k] * grown
    else:
        # i₀ = sinh(a)/a, i₁ = cosh(a)/a − sinh(a)/a², i_{d+1} = i_{d−1} − (2d + 1)/a i_d,
        # each times exp(a) with a = z/2.
        whole = cmath.exp(z)
        a = 0.5 * z
        before = 0.5 * (whole - 1.0) / a
        now = 0.5 * (whole + 1.0) / a - before / a
        sign = -1.0
        e[0] = before
        for d in range(1, STAGES + 1):
            e[d] = sign * now
            later = before - (2 * d + 1) * now / a
            before = now
            now = later
            sign = -sign
    for g in range(STAGES):
        total = complex(0.0, 0.0)
        late = complex(0.0, 0.0)
        for d in range(STAGES):
            # (1 − x) P_d = P_d/2 − ((d + 1) P_{d+1} + d P_{d−1})/(4d + 2)
            weight = 1.0 / (2 * d + 1)
            next_one = e[d + 1] * (d + 1)
            if d > 0:
                next_one = next_one + e[d - 1] * d
            total += _COEFFICIENTS[g, d] * e[d]
            late += _COEFFICIENTS[g, d] * 0.5 * (e[d] - weight * next_one)
        work.moments[g, b] = total
        work.later[g, b] = late


@compiled(brief=True)
def put_load(values: Array, t: float, h: float, states: int) -> None:
    """Write the state 0 at the nodes of a part into the table of values."""
    for g in range(STAGES):
        values[0, g] = t + NODES[g] * h
        for r in range(states):
            values[1 + r, g] = 0.0


@compiled()
def modal_component(
    listed: Listed, w: int, b: int, values: Array, places: Array, g: int
) -> complex:
    """A component in eigenvectors of a vector in the table of values.

    Parameters
    ----------
    w, b : int
        The piece, and the eigenvector.
    values : array, shape (places, LANES)
    places : array of int, shape (states,)
        Where the components of the vector are.
    g : int
        The lane.
    """
    left = listed.spectra.left[w]
    re = 0.0
    im = 0.0
    for r in range(len(places)):
        value = values[places[r], g]
        re += left[0, b, r] * value
        im += left[1, b, r] * value
    return complex(re, im)


@compiled(brief=True)
def put_forcing(listed: Listed, run: Pass, work: PassSpace, i: int, until: int) -> None:
    """Store the contribution of each parameter between two knots, in eigenvectors, in `driven`."""
    s = listed.spectra
    w = run.piece[i]
    n = len(run.knots.state[i])
    free = len(work.driven)
    count = s.blocks[w]
    first, moving, last = listed.slopes[w, 0], listed.slopes[w, 1], listed.slopes[w, 2]
    begin = time_of(run, i)
    length = time_of(run, until) - begin
    parts = max(1, math.ceil(length * run.drives / _SMOOTH))
    h = length / parts
    for b in range(count):
        put_moments(s.exponent[w, b] * h, work, b)
        work.grown[b] = cmath.exp(s.exponent[w, b] * h)
        for p in range(free):
            work.driven[p, b] = complex(0.0, 0.0)
    for part in range(parts):
        put_load(work.values, begin + part * h, h, n)
        perform(listed.made, first if part == 0 else moving, last, work.values, STAGES)
        for p in range(free):
            for r in range(n):
                work.places[r] = listed.jacobian[w, r * (n + free) + n + p]
            for b in range(count):
                total = work.driven[p, b] * work.grown[b]
                for g in range(STAGES):
                    load = modal_component(listed, w, b, work.values, work.places, g)
                    total += h * work.moments[g, b] * load
                work.driven[p, b] = total
    if listed.timely[w] == 0:
        put_loads(listed, run, work, i, until, parts)
        for p in range(free):
            put_slopes(listed, run, work, w, p)
            add_through_state(listed, run, work, i, until, p)


@compiled(brief=True)
def put_loads(listed: Listed, run: Pass, work: PassSpace, i: int, until: int, parts: int) -> None:
    """Put ∫ exp((h − s)λ_b) γ_j ds between two knots into `loaded`, of the real and of the
    imaginary part of γ; and ∫ (h − s) exp((h − s)λ_b) γ_j ds into `held`.

    Parameters
    ----------
    work : PassSpace
        With the moments for equal parts of the time between the knots.
    i, until : int
        The knots.
    """
    s = listed.spectra
    w = run.piece[i]
    n = len(run.knots.state[i])
    count = s.blocks[w]
    first, moving, last = listed.guards[w, 0], listed.guards[w, 1], listed.guards[w, 2]
    begin = time_of(run, i)
    h = (time_of(run, until) - begin) / parts
    for b in range(count):
        for j in range(count):
            for k in range(2):
                work.loaded[k, b, j] = work.held[k, b, j] = complex(0.0, 0.0)
    for part in range(parts):
        put_load(work.values, begin + part * h, h, n)
        perform(listed.made, first if part == 0 else moving, last, work.values, STAGES)
        for j in range(count):
            for g in range(STAGES):
                load = modal_component(listed, w, j, work.values, listed.rates[w], g)
                work.load[0, g] = h * load.real
                work.load[1, g] = h * load.imag
            for b in range(count):
                for k in range(2):
                    total = complex(0.0, 0.0)
                    late = complex(0.0, 0.0)
                    for g in range(STAGES):
                        total += work.moments[g, b] * work.load[k, g]
                        late += work.later[g, b] * work.load[k, g]
                    before = work.loaded[k, b, j]
                    work.held[k, b, j] = (
                        work.grown[b] * (work.held[k, b, j] + h * before) + h * late
                    )
                    work.loaded[k, b, j] = work.grown[b] * before + total


@compiled(brief=True)
def put_slopes(listed: Listed, run: Pass, work: PassSpace, w: int, p: int) -> None:
    """Store L A_p V, of the real and of the imaginary part of V, in the spectra, unless A_p is
    unchanged.

    Parameters
    ----------
    work : PassSpace
        At a time of the piece.
    w, p : int
        The piece, and the parameter.
    """
    s = listed.spectra
    n = s.right.shape[2]
    columns = run.after.shape[1]
    first, last = listed.slopes[w, 0], listed.slopes[w, 2]
    matrix = s.slope[w, p]
    same = s.sloped[w, p] == 1
    t = work.values[0, 0]
    rest = work.squares[1, 0]
    put_load(work.values, t, 0.0, n)
    perform(listed.made, first, last, work.values, 1)
    for r in range(n):
        rest[r] = work.values[listed.jacobian[w, r * columns + n + p], 0]
    for begin in range(0, n, STAGES):
        lanes = min(STAGES, n - begin)
        put_load(work.values, t, 0.0, n)
        for g in range(lanes):
            work.values[1 + begin + g, g] = _PROBE
        perform(listed.made, first, last, work.values, STAGES)
        for g in range(lanes):
            for r in range(n):
                value = work.values[listed.jacobian[w, r * columns + n + p], g]
                # A row that does not depend on this component has the same value without it.
                value = 0.0 if value == rest[r] else value / _PROBE
                same = same and matrix[r, begin + g] == value
                matrix[r, begin + g] = value
    if same:
        return
    for k in range(2):
        for r in range(n):
            for j in range(s.blocks[w]):
                work.squares[0, r, j] = 0.0
            for c in range(n):
                if matrix[r, c] != 0.0:
                    for j in range(s.blocks[w]):
                        work.squares[0, r, j] += matrix[r, c] * s.right[w, k, c, j]
        for b in range(s.blocks[w]):
            for j in range(s.blocks[w]):
                re = 0.0
                im = 0.0
                for r in range(n):
                    re += s.left[w, 0, b, r] * work.squares[0, r, j]
                    im += s.left[w, 1, b, r] * work.squares[0, r, j]
                s.coupled[w, 2 * p + k, b, j] = complex(re, im)
    s.sloped[w, p] = 1


@compiled(brief=True)
def add_through_state(
    listed: Listed, run: Pass, work: PassSpace, i: int, until: int, p: int
) -> None:
    """Add the contribution A_p y of a parameter between two knots to `driven`.

    Parameters
    ----------
    work : PassSpace
        Contains the loads between them.
    i, until : int
        The knots.
    p : int
        The parameter.
    """
    s = listed.spectra
    w = run.piece[i]
    y = run.knots.state[i]
    h = time_of(run, until) - time_of(run, i)
    count = s.blocks[w]
    for b in range(count):
        work.grown[b] = cmath.exp(s.exponent[w, b] * h)
    for j in range(count):
        re = 0.0
        im = 0.0
        for r in range(len(y)):
            re += s.left[w, 0, j, r] * y[r]
            im += s.left[w, 1, j, r] * y[r]
        start = complex(re, im)
        end = work.grown[j] * start + (work.loaded[0, j, j] + 1j * work.loaded[1, j, j])
        for b in range(count):
            response = s.coupled[w, 2 * p, b, j]
            turned = 1j * s.coupled[w, 2 * p + 1, b, j]
            # The mode, and its conjugate: each is half of the real part.
            for k in range(2):
                sign = 1.0 if k == 0 else -1.0
                exponent = s.exponent[w, j] if k == 0 else s.exponent[w, j].conjugate()
                before = start if k == 0 else start.conjugate()
                after = end if k == 0 else end.conjugate()
                away = exponent - s.exponent[w, b]
                if (abs(away.real) + abs(away.imag)) * h <= _SAME:
                    held = work.held[0, b, j] + sign * 1j * work.held[1, b, j]
                    passed = h * work.grown[b] * before + held
                else:
                    load = work.loaded[0, b, j] + sign * 1j * work.loaded[1, b, j]
                    passed = (after - work.grown[b] * before - load) / away
                work.driven[p, b] += 0.5 * (response + sign * turned) * passed


@compiled()
def modal_step(
    listed: Listed, run: Pass, work: PassSpace, i: int, until: int, change: Array
) -> None:
    """The perturbation at the later of two knots of a piece: multiplied by exp(hA), plus the
    contributions of the parameters.

    Parameters
    ----------
    i, until : int
        The knots.
    change : array, shape (columns, directions)
        Before, and after.
    """
    w = run.piece[i]
    h = time_of(run, until) - time_of(run, i)
    s = listed.spectra
    columns, directions = change.shape
    n = s.right.shape[2]
    if columns > n:
        put_forcing(listed, run, work, i, until)
    count = s.blocks[w]
    re, im, moved = work.modal[0], work.modal[1], work.moved
    for b in range(count):
        for d in range(directions):
            re[b, d] = 0.0
            im[b, d] = 0.0
        # Rows are added in pairs: sums are loaded and stored half as often.
        for c in range(0, n - 1, 2):
            x, u = s.left[w, 0, b, c], s.left[w, 0, b, c + 1]
            y, v = s.left[w, 1, b, c], s.left[w, 1, b, c + 1]
            for d in range(directions):
                re[b, d] += x * change[c, d] + u * change[c + 1, d]
                im[b, d] += y * change[c, d] + v * change[c + 1, d]
        if n % 2 == 1:
            x, y = s.left[w, 0, b, n - 1], s.left[w, 1, b, n - 1]
            for d in range(directions):
                re[b, d] += x * change[n - 1, d]
                im[b, d] += y * change[n - 1, d]
        grown = cmath.exp(s.exponent[w, b] * h)
        for d in range(directions):
            x = re[b, d]
            re[b, d] = grown.real * x - grown.imag * im[b, d]
            im[b, d] = grown.real * im[b, d] + grown.imag * x
        for p in range(columns - n):
            x = work.driven[p, b].real
            y = work.driven[p, b].imag
            for d in range(directions):
                re[b, d] += x * change[n + p, d]
                im[b, d] += y * change[n + p, d]
    for r in range(n):
        for d in range(directions):
            moved[r, d] = 0.0
        for b in range(0, count - 1, 2):
            x, u = s.right[w, 0, r, b], s.right[w, 0, r, b + 1]
            y, v = s.right[w, 1, r, b], s.right[w, 1, r, b + 1]
            for d in range(directions):
                one = x * re[b, d] - y * im[b, d]
                moved[r, d] += one + (u * re[b + 1, d] - v * im[b + 1, d])
        if count % 2 == 1:
            x, y = s.right[w, 0, r, count - 1], s.right[w, 1, r, count - 1]
            for d in range(directions):
                moved[r, d] += x * re[count - 1, d] - y * im[count - 1, d]
    for r in range(n):
        for d in range(directions):
            change[r, d] = moved[r, d]
