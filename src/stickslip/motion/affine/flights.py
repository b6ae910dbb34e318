"""Exact flow of modes that are affine in the state: closed form instead of steps.

In an affine mode, driven by e = (1, t, cos ω₁t, sin ω₁t, …), state and drives s = (x, e) obey ṡ = S
s, and every guard and every component of the state is a signal

    g(τ) = g(0) + c₁τ + c₂τ² + Re Σⱼ aⱼ rⱼ (exp(λⱼτ) − 1) + Re Σₘ bₘ exp(iωₘt) (exp(iωₘτ) − 1)

with c₁ and r linear in s at the beginning of the flight. Its first crossing is found over the whole
flight. The tables of coefficients are computed in :mod:`.closed_forms`; this module evaluates them.
"""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array, IntVector
from stickslip.machine_code.functions import entry_point
from stickslip.motion.affine.forms import (
    EXPONENTS,
    GUARDS,
    LEADING_ORDERS,
    SEARCHED,
    SLIDES,
    STICKS,
    ClosedForms,
    Flight,
)
from stickslip.motion.affine.matrices import drive_vector
from stickslip.motion.affine.signals import (
    SignalSum,
    Wave,
    first_of_bend,
    first_of_line,
    first_of_many,
    first_of_wave,
    length,
    rough_acos,
)
from stickslip.motion.modes.guards import switch_of
from stickslip.numerics.levels import ON_SURFACE, ROUNDING
from stickslip.translator import compiled

# rounding errors allowed for the guard of a switch that has just fired, which is zero by definition
_FIRED_ROUNDINGS = 1e5
_LOST = 1e-4  # relative to its terms: a smaller component has lost too many digits
UNKNOWN = -2  # returned instead of a guard, if the flight cannot be computed
# Kinds of signals
_NEVER = 0
_LINE = 1
_BEND = 2
_WAVE = 3
_MANY = 4


@entry_point()
def mode_key(mode: IntVector, reg: IntVector) -> int:
    """Number of a mode (0, ±1) and region of at most :data:`.forms.MOST_SWITCHES` switches."""
    key = 1
    for i in range(len(mode)):
        key = key * 3 + mode[i] + 1
    for j in range(len(reg)):
        key = key * 2 + reg[j]
    return key


@compiled()
def find(key: Array, own: Array, first: int, used: int, wanted: int) -> int:
    """Slot of a mode, or −1.

    Parameters
    ----------
    key, own : arrays of int
        Of the closed forms.
    first, used : int
        First slot of the group, and how many it uses.
    wanted : int
        Number of the mode.
    """
    for i in range(first, first + used):
        if key[i] == wanted:
            # Not i itself: the compiler would keep the address of every table through this loop.
            return own[i]
    return -1


@compiled()
def scalar_product(row: Array, s: Array) -> float:
    """Scalar product."""
    total = 0.0
    for i in range(len(s)):
        total += row[i] * s[i]
    return total


@compiled(inline=True)
def place(f: Flight, x: Array, t: float, omega: Array) -> None:
    """Write state and drives at time t, and their moduli, to the work space."""
    s = f.v[0]
    n = len(x)
    for i in range(n):
        s[i] = x[i]
    drive_vector(t, omega, s, n)
    for i in range(len(s)):
        f.size[0, i] = abs(s[i])


@compiled()
def _derive(S: Array, v: Array, k: int) -> None:
    """The k-th derivative from the one before."""
    for i in range(len(S)):
        total = 0.0
        for j in range(len(S)):
            total += S[i, j] * v[k - 1, j]
        v[k, i] = total


@compiled()
def _terms(S: Array, G: Array, size: Array, k: int, near: float) -> float:
    """Size of the terms of G s⁽ᵏ⁾, plus that of its change within a time.

    Parameters
    ----------
    S : array, shape (ns, ns)
    G : array, shape (ns,)
    size : array, shape (orders, ns)
        First the moduli of s; receives the sizes of the terms of its derivatives up to order k + 1.
    near : float
        The time, in the unit of S.
    """
    for o in range(1, k + 2):
        for i in range(len(S)):
            total = 0.0
            for j in range(len(S)):
                total += abs(S[i, j]) * size[o - 1, j]
            size[o, i] = total
    total = 0.0
    for i in range(len(S)):
        total += abs(G[i]) * (size[k, i] + near * size[k + 1, i])
    return total


@compiled(inline=True)
def stops(form: ClosedForms, settled: Array, c: int) -> bool:
    """Whether a contact with mass has slipped, and now sticks."""
    return bool(form.held[c] == STICKS and abs(settled[c]) == 1)


@compiled(inline=True)
def leading_terms(
    form: ClosedForms,
    f: Flight,
    omega: Array,
    fired: int,
    kinks: int,
    last: float,
    settled: Array,
) -> int:
    """First guard that becomes negative immediately, or −1; the order of the leading Taylor term of
    each guard is left in the work space.

    Parameters
    ----------
    form : ClosedForms
        Of the mode.
    f : Flight
        With s; receives values, sizes of terms, and deciding orders of the guards.
    omega : array, shape (waves,)
        Frequencies of the drives.
    fired, kinks : int
        The switch that has just fired, or −1, and the number of kinks.
    last : float
        Length of the last step.
    settled : array of int, shape (contacts,)
        Mode before the last event.
    """
    v = f.v
    size = f.size
    orders = f.orders
    S = form.S
    G = form.G
    reach = form.reach
    ns = len(S)
    largest = 0.0
    for i in range(ns):
        largest = max(largest, form.felt[i] * size[0, i])
    # A zero is only as accurate as the time at which it was found, and a drive as its phase; a
    # value that changes by less than rounding within the shortest time scale has not begun to
    # change.
    near = last + form.shortest
    if len(omega) > 0:
        near += size[0, ns - 2 * len(omega) - 1]
    ready = 0
    near = near / form.pace
    for g in range(form.counts[GUARDS]):
        k = 0
        value = 0.0
        while k < LEADING_ORDERS:
            if ready < k:  # derivatives are computed up to the order needed
                ready = k
                _derive(S, v, k)
            value, terms = 0.0, 0.0
            for i in range(ns):
                term = G[g, i] * v[k, i]
                value += term
                terms += abs(term)
            if k == 0:
                f.value[g], f.terms[g] = value, terms
            # A value far from zero, or within rounding errors of it, needs no exact bound on its
            # terms.
            bound = reach[g, k] + near * reach[g, k + 1]
            if abs(value) > ROUNDING * _FIRED_ROUNDINGS * largest * bound:
                break
            if abs(value) > ROUNDING * terms:
                floor = ROUNDING * _terms(S, G[g], size, k, near)
                just = k == 0 and switch_of(form.switch[g], kinks, len(form.held)) == fired
                # At the end of a slip the velocity is zero by definition, the force is not.
                if just and (fired < kinks or not stops(form, settled, fired - kinks)):
                    floor *= _FIRED_ROUNDINGS
                if abs(value) > floor:
                    break
            k += 1
        orders[g] = k
        if k < LEADING_ORDERS and value < 0.0:
            return g
    return -1


@compiled(inline=True)
def amplitudes(form: ClosedForms, f: Flight, omega: Array) -> None:
    """Amplitudes of the exponentials at the beginning of a flight."""
    s = f.v[0]
    moduli = f.size[0]
    first = len(f.r) + 2
    for j in range(form.counts[EXPONENTS]):
        row = form.R[j]
        re = 0.0
        im = 0.0
        terms = 0.0
        for i in range(len(s)):
            re += row[i].real * s[i]
            im += row[i].imag * s[i]
            terms += length(row[i]) * moduli[i]
        f.r[j] = complex(re, im)
        f.rounding[j] = terms
        if form.exponent[j].imag == 0.0:
            f.modulus[j] = abs(re)
        else:
            f.modulus[j] = math.sqrt(re * re + im * im)
            f.phase[j] = math.atan2(im, re)
    for m in range(len(omega)):
        f.spin[m] = complex(s[first + 2 * m], s[first + 2 * m + 1])


@compiled()
def turn(re: float, im: float) -> complex:
    """exp(z) − 1, to full accuracy also for small z, so that the change of the state in a short
    flight is accurate."""
    grown = math.expm1(re) if re != 0.0 else 0.0
    if im == 0.0:
        return complex(grown, 0.0)
    sine, cosine = math.sin(0.5 * im), math.cos(0.5 * im)
    back = -2.0 * sine * sine  # cos − 1
    return complex(grown + back + grown * back, (1.0 + grown) * 2.0 * sine * cosine)


@compiled()
def _turn_all(lam: Array, r: Array, nb: int, tau: float, turned: Array) -> None:
    """Changes of the exponentials in a time.

    Parameters
    ----------
    lam, r : arrays of complex
        Exponents λ, and amplitudes.
    nb : int
        How many there are.
    tau : float
        The time.
    turned : array of complex
        Receives r (exp(λτ) − 1).
    """
    for j in range(nb):
        turned[j] = r[j] * turn(lam[j].real * tau, lam[j].imag * tau) if r[j] != 0.0 else 0.0j


@compiled()
def stays_zero(form: ClosedForms, f: Flight, g: int, omega: Array) -> bool:
    """Whether a guard whose first derivatives vanish is identically zero: it contains no
    exponential or wave, up to rounding.

    Parameters
    ----------
    form : ClosedForms
        Of the mode.
    f : Flight
        With the amplitudes.
    g : int
        The guard.
    omega : array, shape (waves,)
        Frequencies of the drives.
    """
    reach = 0.0
    terms = f.terms[g]
    for j in range(form.counts[EXPONENTS]):
        reach += form.swing[g, j] * f.modulus[j]
        terms += form.swing[g, j] * f.rounding[j]
    for m in range(len(omega)):
        reach += form.swing[g, len(f.r) + m]
    return bool(reach <= ROUNDING * terms)


@compiled(inline=True)
def sort_guards(form: ClosedForms, f: Flight, omega: Array) -> int:
    """Classify each guard by the kind of its signal. Returns the guard that will probably reach
    zero first, or −1; UNKNOWN if cancellation of its exponentials makes one inaccurate."""
    r = f.r
    modulus = f.modulus
    b = f.b
    lam = form.exponent
    swing = form.swing
    first = -1
    soonest = np.inf
    for g in range(form.counts[GUARDS]):
        f.kind[g] = _NEVER
        if f.orders[g] >= LEADING_ORDERS:
            if not stays_zero(form, f, g, omega):
                return UNKNOWN
            continue
        # c₀ and the amplitudes about it; negligible terms do not count.
        c0 = f.value[g]
        c1 = 0.0
        c2 = 0.0
        reach = 0.0
        terms = f.terms[g]
        for j in range(form.counts[EXPONENTS]):
            c0 -= form.a[g, j].real * r[j].real - form.a[g, j].imag * r[j].imag
            reach += swing[g, j] * modulus[j]
            terms += swing[g, j] * f.rounding[j]
        for m in range(len(omega)):
            b[m] = form.b[g, m] * f.spin[m]
            c0 -= b[m].real
            reach += swing[g, len(r) + m]
        if form.drifts[g] == 1:
            c1 = scalar_product(form.c1[g], f.v[0])
            c2 = form.c2[g]
        if form.decays[g] == 1 and c0 > reach and c1 >= 0.0 and c2 >= 0.0:
            continue  # the decaying terms cannot bring it to zero
        if g >= form.counts[SEARCHED]:
            return UNKNOWN
        floor = ROUNDING * (terms + reach)
        if f.orders[g] == 0 and f.value[g] <= floor:
            return UNKNOWN
        real = 0
        waves = 0
        drives = 0
        lead = 0
        for j in range(form.counts[EXPONENTS]):
            if swing[g, j] * modulus[j] > 0.1 * floor:
                lead = j
                if lam[j].imag == 0.0:
                    real += 1
                else:
                    waves += 1
        for m in range(len(omega)):
            drives += 1 if swing[g, len(r) + m] > 0.1 * floor else 0
        f.c[g, 0] = c0
        f.c[g, 1] = c1
        f.c[g, 2] = c2
        f.floor[g] = floor
        f.lead[g] = lead
        f.guess[g] = 0.0
        if drives > 0 or c2 != 0.0 or real + waves > 1 or (waves == 1 and c1 != 0.0):
            f.kind[g] = _MANY
        elif waves == 1:
            f.kind[g] = _WAVE
            size = swing[g, lead] * modulus[lead]
            if abs(c0) < size:
                # the time at which the cosine decreases through the level
                angle = rough_acos(-c0 / size) - form.angle[g, lead] - f.phase[lead]
                f.guess[g] = (angle - 2.0 * math.pi * np.floor(angle * (0.5 / math.pi))) / lam[
                    lead
                ].imag
        else:
            f.kind[g] = _BEND if real == 1 else _LINE
        if f.guess[g] < soonest:
            first = g
            soonest = f.guess[g]
    return first


@compiled(inline=True)
def fly(form: ClosedForms, f: Flight, room: float, omega: Array) -> tuple[float, int]:
    """The earliest event within `room`: (duration, guard or −1), with the changes of the
    exponentials until then; or UNKNOWN instead of a guard. Without an event the duration is `room`,
    or the end of the search.

    Parameters
    ----------
    form : ClosedForms
        Of the mode.
    f : Flight
        With s and the deciding orders of the guards; receives the changes.
    room : float
        Longest duration.
    omega : array, shape (waves,)
        Frequencies of the drives.
    """
    r = f.r
    a = f.a
    b = f.b
    lam = form.exponent
    nb = form.counts[EXPONENTS]
    amplitudes(form, f, omega)
    first = sort_guards(form, f, omega)
    if first == UNKNOWN:
        return 0.0, UNKNOWN
    limit = room
    which = -1
    known = False
    for rank in range(-1, form.counts[GUARDS] if first >= 0 else -1):
        # The guard that probably fires first shortens the search for the others.
        g = first if rank < 0 else rank
        if rank == first or f.kind[g] == _NEVER:
            continue
        j = int(f.lead[g])
        floor = f.floor[g]
        rising = f.orders[g]
        found = np.inf
        if f.kind[g] == _WAVE:
            wave = Wave(
                f.c[g, 0],
                form.swing[g, j] * f.modulus[j],
                form.angle[g, j] + f.phase[j],
                lam[j].real,
                lam[j].imag,
                form.tilt[j],
                form.sine[j],
            )
            while True:
                z = form.a[g, j]
                turned = f.turned[j]
                ending = (
                    f.value[g] + z.real * turned.real - z.imag * turned.imag if known else np.nan
                )
                found = first_of_wave(wave, limit, ending, f.guess[g], floor, rising)
                if known or found == found:
                    break
                _turn_all(lam, r, nb, limit, f.turned)
                known = True
        elif f.kind[g] == _BEND:
            size = form.a[g, j].real * r[j].real
            found = first_of_bend(f.c[g, 0], f.c[g, 1], size, lam[j].real, limit, floor, rising)
        elif f.kind[g] == _LINE:
            found = first_of_line(f.c[g, 0], f.c[g, 1], limit, rising)
        else:
            for i in range(nb):
                a[i] = form.a[g, i] * r[i]
            for m in range(len(omega)):
                b[m] = form.b[g, m] * f.spin[m]
            parts = SignalSum(
                f.c[g], a[:nb], f.z[:nb], f.window[:nb], f.kept[:nb], lam[:nb], b, omega
            )
            found, looked = first_of_many(parts, limit, floor, rising, f.taylor, f.stack)
            # Long searches return early, so that a request to stop is noticed.
            if looked < limit:
                limit, which, known = looked, -1, False
        if found <= limit:
            known = known and found == limit
            limit, which = found, g
    if not known:
        _turn_all(lam, r, nb, limit, f.turned)
    return limit, which


@compiled(inline=True)
def arrive(form: ClosedForms, f: Flight, x: Array, tau: float, omega: Array) -> None:
    """Advance x to the end of the flight just found.

    Parameters
    ----------
    form : ClosedForms
        Of the mode.
    f : Flight
        With the changes of the exponentials.
    x : array, shape (n,)
        State at the beginning; receives that at the end.
    tau : float
        Duration.
    omega : array, shape (waves,)
        Frequencies of the drives.
    """
    n = len(x)
    b = f.b
    turned = f.turned
    first = len(form.c2) - n
    for m in range(len(omega)):
        b[m] = f.spin[m] * turn(0.0, omega[m] * tau)
    for i in range(n):
        g = first + i
        change = 0.0
        if form.drifts[g] == 1:
            change = tau * (scalar_product(form.c1[g], f.v[0]) + tau * form.c2[g])
        for j in range(form.counts[EXPONENTS]):
            z = form.a[g, j]
            change += z.real * turned[j].real - z.imag * turned[j].imag
        for m in range(len(omega)):
            z = form.b[g, m]
            change += z.real * b[m].real - z.imag * b[m].imag
        x[i] += change


@compiled()
def is_below_rounding(
    form: ClosedForms, f: Flight, x: Array, seen: Array, tau: float, omega: Array
) -> bool:
    """Whether a component of the state is lost in rounding: at the end of the flight just found and
    at its midpoint it is below the rounding error of its terms, and it has never been larger. This
    happens where exponentials cancel, in components that the others have not moved yet.

    Parameters
    ----------
    form, f, x, tau, omega
        As in :func:`arrive`; nothing but work space is changed.
    seen : array
        Its first n entries, the largest modulus of each component so far, receive those of this
        flight.
    """
    n = len(x)
    b = f.b
    lost = False
    for m in range(len(omega)):
        b[m] = f.spin[m] * turn(0.0, omega[m] * tau)
    for j in range(form.counts[EXPONENTS]):
        f.window[j] = length(f.turned[j])
    for i in range(n):
        g = len(form.c2) - n + i
        value = x[i] + tau * (scalar_product(form.c1[g], f.v[0]) + tau * form.c2[g])
        terms = 0.0
        for j in range(form.counts[EXPONENTS]):
            z = form.a[g, j]
            value += z.real * f.turned[j].real - z.imag * f.turned[j].imag
            terms += form.swing[g, j] * f.window[j]
        for m in range(len(omega)):
            z = form.b[g, m]
            value += z.real * b[m].real - z.imag * b[m].imag
            terms += form.swing[g, n + m] * length(b[m])
        seen[i] = max(seen[i], abs(value))
        if _LOST * terms > seen[i]:
            seen[i] = max(seen[i], abs(place_at(form, f, x, i, 0.5 * tau, omega)))
        lost = lost or _LOST * terms > seen[i]
    return lost


@compiled()
def place_at(form: ClosedForms, f: Flight, x: Array, i: int, tau: float, omega: Array) -> float:
    """A component of the state during a flight.

    Parameters
    ----------
    form : ClosedForms
        Of the mode.
    f : Flight
        With the amplitudes of the exponentials.
    x : array, shape (n,)
        State at the beginning.
    i : int
        The component.
    tau : float
        Time since the beginning.
    omega : array, shape (waves,)
        Frequencies of the drives.
    """
    g = len(form.c2) - len(x) + i
    value = x[i] + tau * (scalar_product(form.c1[g], f.v[0]) + tau * form.c2[g])
    for j in range(form.counts[EXPONENTS]):
        lam = form.exponent[j]
        value += (form.a[g, j] * f.r[j] * turn(lam.real * tau, lam.imag * tau)).real
    for m in range(len(omega)):
        value += (form.b[g, m] * f.spin[m] * turn(0.0, omega[m] * tau)).real
    return float(value)


@compiled(inline=True)
def land(form: ClosedForms, f: Flight, guard: int, x: Array, last: float) -> float:
    """Move x, at the end of a flight, to the zero of the guard that ended it; returns the time of
    this correction.

    Near resonance, cancellation of large terms displaces the end of a long flight. A one-sided
    power that begins at the zero is undefined on its other side.

    Parameters
    ----------
    form : ClosedForms
        Of the mode of the flight.
    f : Flight
        With s at the end.
    guard : int
        Index among the guards of the mode.
    x : array, shape (n,)
        State; is changed.
    last : float
        Duration of the flight.
    """
    v = f.v
    _derive(form.S, v, 1)
    value, slope = scalar_product(form.G[guard], v[0]), scalar_product(form.G[guard], v[1])
    if not slope < 0.0 or abs(value) * form.pace > -ON_SURFACE * last * slope:
        return 0.0
    for i in range(len(x)):
        x[i] -= value / slope * v[1, i]
    return -value / slope * form.pace


@compiled(inline=True)
def admissible(form: ClosedForms, f: Flight, x: Array, last: float) -> bool:
    """Whether sticking contacts are at rest and sliding rate-independent ones on their threshold;
    removes rounding.

    Parameters
    ----------
    form : ClosedForms
        Of the mode.
    f : Flight
        With s, from which rounding is removed, too.
    x : array, shape (n,)
        State; is changed.
    last : float
        Length of recent steps.
    """
    s = f.v[0]
    moduli = f.size[0]
    S = form.S
    for c in range(len(form.held)):
        if form.held[c] == 0:
            continue
        zero = form.zero[c]
        value = 0.0
        size = 0.0
        for i in range(len(s)):
            value += zero[i] * s[i]
            size += abs(zero[i]) * moduli[i]
        if value == 0.0:
            continue
        if form.held[c] == SLIDES:
            if abs(value) > ON_SURFACE * size:
                return False
            continue
        rate = abs(scalar_product(form.brake[c], s))
        for i in range(len(x)):
            if zero[i] != 0.0:
                for j in range(len(s)):
                    rate += abs(zero[i] * S[i, j]) * moduli[j] / form.pace
        if abs(value) > ON_SURFACE * last * rate + ROUNDING * size:
            return False
        for i in range(len(x)):
            x[i] -= form.hold[c, i] * value
            s[i] = x[i]
            moduli[i] = abs(x[i])
    return True
