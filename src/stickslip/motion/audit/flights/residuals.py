"""Residuals of the equations of motion for a flight in closed form, bounded over its whole
duration."""

from __future__ import annotations

import math

from stickslip.arrays import (
    Array,
)
from stickslip.motion.affine.forms import (
    EXPONENTS,
    ClosedForms,
)
from stickslip.motion.affine.modal_sums import (
    modulus_of,
)
from stickslip.motion.affine.nodes import LEBESGUE, most
from stickslip.motion.affine.structure import is_affine
from stickslip.motion.audit.flights.arrays import (
    LARGE_STATE,
    REMEMBERED,
    FlightAudit,
    Stretch,
)
from stickslip.motion.steps.arrays import (
    DIMENSION,
    OK,
    Flow,
    Instant,
    Machine,
    Rows,
)
from stickslip.motion.steps.starting import coefficients
from stickslip.translator import compiled


@compiled()
def put_rows(rows: Rows, V: Array, table: Array, g: int) -> None:
    """Put the values of all signals at an instant into a column."""
    n, nc = rows.sizes[DIMENSION], len(rows.u)
    for r in range(n):
        table[r, g] = V[rows.program.rates[r], 0]
    for c in range(nc):
        table[n + c, g] = V[rows.u[c], 0]
        table[n + nc + c, g] = V[rows.force[c], 0]
        table[n + 2 * nc + c, g] = V[rows.plus[c], 0]
        table[n + 3 * nc + c, g] = V[rows.minus[c], 0]
    for j in range(len(rows.kinks)):
        table[n + 4 * nc + j, g] = V[rows.kinks[j], 0]


@compiled()
def evaluate_eigenvectors(
    machine: Machine, flow: Flow, a: FlightAudit, form: ClosedForms, slot: int, at: Instant
) -> bool:
    """Evaluate the equations at the eigenvectors of a mode; False if it is not affine.

    Parameters
    ----------
    a : FlightAudit
        Receives what they make of these, and the residuals.
    at : Instant
        In the mode.
    """
    rows, V = flow.rows, flow.space.V
    n = rows.sizes[DIMENSION]
    first = len(form.c2) - n
    if coefficients(machine, flow, at, 1, flow.space.W) != OK or not is_affine(
        flow, at.mode, at.reg
    ):
        return False
    if a.state[slot] == REMEMBERED:
        return True
    here = Instant(at.t, a.y, at.mode, at.reg)
    right = a.right[slot]
    for j in range(form.counts[EXPONENTS]):
        for half in range(2):
            for r in range(n):
                z = form.a[first + r, j]
                a.y[r] = LARGE_STATE * (z.real if half == 0 else z.imag)
            if coefficients(machine, flow, here, 1, V) != OK:
                return False
            put_rows(rows, V, a.slow, 0)
            for row in range(len(right)):
                value = a.slow[row, 0] / LARGE_STATE
                right[row, j] = (
                    complex(value, 0.0) if half == 0 else complex(right[row, j].real, value)
                )
    for j in range(form.counts[EXPONENTS]):
        put_residual(a, form, slot, j)
    return True


@compiled()
def put_residual(a: FlightAudit, form: ClosedForms, slot: int, j: int) -> None:
    """Put the residual of an eigenvector, in eigenvectors, into the tables."""
    n = len(a.y)
    first = len(form.c2) - n
    count = form.counts[EXPONENTS]
    lam = form.exponent[j]
    for k in range(count):
        own = complex(0.0, 0.0)
        other = complex(0.0, 0.0)
        for r in range(n):
            off = a.right[slot, r, j] - lam * form.a[first + r, j]
            own += form.R[k, r] * off
            other += form.R[k, r] * off.conjugate()
        a.straight[slot, k, j] = own
        a.turned[slot, k, j] = other
    for r in range(n):
        off = a.right[slot, r, j] - lam * form.a[first + r, j]
        re, im = off.real, off.imag
        for k in range(count):
            own, other = a.straight[slot, k, j], a.turned[slot, k, j]
            z = form.a[first + r, k]
            re -= 0.5 * (z * (own + other)).real
            im -= 0.5 * (z * (own - other)).imag
        a.aside[slot, r, j] = abs(re) + abs(im)


@compiled()
def note_residual(a: FlightAudit, form: ClosedForms, s: Stretch, begins: bool) -> None:
    """Store the size of the residual of q, given in `x`, and its deviation from that at the first
    node, where the flight `begins`."""
    n = len(a.x)
    first = len(form.c2) - n
    for k in range(s.exponents):
        re = 0.0
        im = 0.0
        for r in range(n):
            re += form.R[k, r].real * a.x[r]
            im += form.R[k, r].imag * a.x[r]
        a.z[k] = complex(re, im)
        if begins:
            a.first[k] = a.last[k] = a.z[k]
        a.drift[k] = most(a.drift[k], LEBESGUE * modulus_of(a.z[k] - a.first[k]))
        a.turns[k] += LEBESGUE * modulus_of(a.z[k] - a.last[k])
        a.last[k] = a.z[k]
    for r in range(n):
        rest = a.x[r]
        for k in range(s.exponents):
            z, w = form.a[first + r, k], a.z[k]
            rest -= z.real * w.real - z.imag * w.imag
        if begins:
            a.still[0, r], a.still[1, r] = rest, a.x[r]
        a.rest[r] = most(a.rest[r], abs(a.still[0, r]) + LEBESGUE * abs(rest - a.still[0, r]))
        a.made[r] = most(a.made[r], abs(a.still[1, r]) + LEBESGUE * abs(a.x[r] - a.still[1, r]))


@compiled()
def passed(one: complex, other: complex, h: float) -> float:
    """Bound of |∫₀ʰ exp(one (h − τ) + other τ) dτ|."""
    largest = math.exp(max(max(one.real, other.real) * h, 0.0))
    away = modulus_of(one - other)
    return largest * (min(h, 2.0 / away) if away > 0.0 else h)


@compiled()
def put_bounds(a: FlightAudit, form: ClosedForms, s: Stretch) -> None:
    """Bound the error at the end of a flight in `bound`: the effect of its residual, over the
    flight or, if the residual averages out, over a Taylor step."""
    n = len(a.bound)
    first = len(form.c2) - n
    for r in range(n):
        a.bound[r] = s.h * a.rest[r] + s.acting * a.made[r]
    for j in range(s.exponents):
        size = modulus_of(a.r[j])
        if size == 0.0:
            continue
        for r in range(n):
            off = modulus_of(a.right[s.slot, r, j] - form.exponent[j] * form.a[first + r, j])
            a.bound[r] += size * a.growth[j] * (s.h * a.aside[s.slot, r, j] + s.acting * off)
    for k in range(s.exponents):
        lam = form.exponent[k]
        if lam == 0.0j:
            continue
        # integration by parts: a constant term counts for one revolution
        size = modulus_of(a.first[k]) + a.drift[k]
        once = (2.0 * size + a.turns[k]) / modulus_of(lam)
        made = a.growth[k] * min(s.h * size, once)
        for j in range(s.exponents):
            size = modulus_of(a.r[j])
            if size > 0.0:
                other = form.exponent[j]
                made += 0.5 * size * modulus_of(a.straight[s.slot, k, j]) * passed(lam, other, s.h)
                made += (
                    0.5
                    * size
                    * modulus_of(a.turned[s.slot, k, j])
                    * passed(lam, other.conjugate(), s.h)
                )
        for r in range(n):
            a.bound[r] += modulus_of(form.a[first + r, k]) * made
