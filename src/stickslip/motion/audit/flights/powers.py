"""Work in a flight in closed form: integrals of products of two exponentials."""

from __future__ import annotations

import math

from stickslip.motion.affine.forms import (
    ClosedForms,
)
from stickslip.motion.affine.modal_sums import (
    grown_by,
)
from stickslip.motion.audit.flights.arrays import LARGE_STATE, FlightAudit, Stretch
from stickslip.motion.audit.observers import Sums
from stickslip.motion.steps.arrays import (
    DISSIPATED,
    SUPPLIED,
    Flow,
    Instant,
    Machine,
    Rows,
)
from stickslip.motion.steps.starting import coefficients
from stickslip.translator import compiled

_LEFT = 1e-15  # relative size of a component of ∫ x xᵀ that is a rounding error


@compiled()
def power_of_pairs(
    machine: Machine, flow: Flow, a: FlightAudit, form: ClosedForms, s: Stretch, at: Instant
) -> tuple[float, float]:
    """Energy that the exponentials of a flight dissipate, and are supplied, by themselves.

    Parameters
    ----------
    at : Instant
        The beginning.
    """
    n = len(a.y)
    first = len(form.c2) - n
    put_pairs(a, form, s)
    for r in range(n):
        for k in range(2):
            paired = a.paired[k, r]
            for j in range(s.exponents):
                paired[j] = complex(0.0, 0.0)
            for q in range(s.exponents):
                z = form.a[first + r, q] * a.r[q]
                for j in range(s.exponents):
                    paired[j] += z * a.pairs[k, q, j]
        both = a.paired[0, r]
        for j in range(s.exponents):
            both[j] = (both[j] + a.paired[1, r, j].conjugate()) * a.r[j]
        for q in range(r + 1):
            own = form.a[first + q]
            total = 0.0
            for j in range(s.exponents):
                total += both[j].real * own[j].real - both[j].imag * own[j].imag
            a.gram[r, q] = a.gram[q, r] = 0.5 * total
    for r in range(n):
        a.gram[n, r] = a.gram[r, r]
    spent, fed = 0.0, 0.0
    here = Instant(at.t, a.y, at.mode, at.reg)
    # Pivoted Cholesky: ∫ x xᵀ dt is a sum of few x xᵀ, so the integral of a quadratic power is the
    # sum of its values at these x, taken so large that terms of lower degree vanish.
    for _ in range(n):
        best, part = 0, 0.0
        for r in range(n):
            if a.gram[r, r] > part * a.gram[n, r]:
                best, part = r, a.gram[r, r] / a.gram[n, r]
        if not part > _LEFT:
            break
        root = math.sqrt(a.gram[best, best])
        for r in range(n):
            a.x[r] = a.gram[r, best] / root
            a.y[r] = LARGE_STATE * a.x[r]
        for r in range(n):
            for q in range(n):
                a.gram[r, q] -= a.x[r] * a.x[q]
        a.gram[best, best] = 0.0
        coefficients(machine, flow, here, 1, flow.space.V)
        machine.powers(flow.space.V, at.reg, flow.k.K, flow.space.powers)
        spent += flow.space.powers[DISSIPATED] / LARGE_STATE / LARGE_STATE
        fed += flow.space.powers[SUPPLIED] / LARGE_STATE / LARGE_STATE
    return spent, fed


@compiled()
def put_pairs(a: FlightAudit, form: ClosedForms, s: Stretch) -> None:
    """Put the integrals of products of exponentials over the flight into the work space."""
    for q in range(s.exponents):
        for j in range(q + 1):
            lam, mu = form.exponent[q], form.exponent[j]
            a.pairs[0, q, j] = a.pairs[0, j, q] = grown_by(lam + mu, s.h)
            pair = grown_by(lam + mu.conjugate(), s.h)
            a.pairs[1, q, j] = pair
            a.pairs[1, j, q] = pair.conjugate()


@compiled()
def add_work_of_pairs(rows: Rows, a: FlightAudit, s: Stretch, sums: Sums) -> None:
    """Add the work of contacts that exponentials do by themselves, with the integrals of their
    products."""
    n, nc = len(a.y), len(rows.u)
    for c in range(nc):
        total = 0.0
        for q in range(s.exponents):
            held = a.right[s.slot, n + nc + c, q] * a.r[q]
            if held == 0.0j:
                continue
            for j in range(s.exponents):
                fast = a.right[s.slot, n + c, j] * a.r[j]
                total += (held * fast * a.pairs[0, q, j]).real
                total += (held * fast.conjugate() * a.pairs[1, q, j]).real
        sums.work[c] -= 0.5 * total
