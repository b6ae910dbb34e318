"""The audit of motions in closed form: long flights are checked as a whole.

Where rates, forces and guards are affine in the state (:mod:`stickslip.motion.affine.structure`
proves it), a flight in closed form is a candidate like any other,

    p(τ) = q(τ) + Re Σⱼ vⱼrⱼ exp(λⱼτ),

q a polynomial of degree 2 and waves of the drives. Its residual is as simple,

    p′ − f(p) = (q′ − f(q)) + Re Σⱼ (λⱼ − A)vⱼ rⱼ exp(λⱼτ),

with A vⱼ and f(q) evaluated by the equations, not by the closed form. With ρⱼ = (λⱼ − A)vⱼ and left
eigenvectors L it moves the end of the flight by at most Σⱼₖ |vₖ| |(L ρⱼ)ₖ rⱼ| |∫ exp(λₖ(h − τ) +
λⱼτ) dτ|; fast modes are in it with their moduli. Guards are sums of the same exponentials, bounded
on windows (:mod:`stickslip.motion.affine.modal_sums`). Powers are quadratic: that of q is
integrated by Gauss quadrature, what is bilinear in q and the exponentials with the moments of
these, and ∫ P(Re Σ vⱼrⱼ exp) is Σ P(wₖ) with ∫ x xᵀ dτ = Σ wₖwₖᵀ, whose entries are integrals of
pairs. So all powers are those of the system, too.

What is not clear beyond doubt is left to :mod:`stickslip.motion.audit.step_balance`, which follows
the flight piece by piece.
"""

from __future__ import annotations

import cmath
import math

import numpy as np

from stickslip.arrays import (
    Array,
    Vector,
)
from stickslip.machine_code.functions import entry_point
from stickslip.motion.admissible.sharing import any_share
from stickslip.motion.affine.flights import amplitudes, find, mode_key, place, scalar_product
from stickslip.motion.affine.forms import (
    AFFINE,
    EXPONENTS,
    ClosedForms,
    form_of,
)
from stickslip.motion.affine.modal_sums import (
    RADIANS,
    ModalSum,
    largest_of_sum,
    least_of_sum,
    put_moments_at_nodes,
    signal_at,
    widen_by_sum,
)
from stickslip.motion.affine.nodes import COUNT, GAUSS_NODES, GAUSS_WEIGHTS, most
from stickslip.motion.algebra.vectors import copy
from stickslip.motion.audit.accounts import (
    BACKWARDS,
    BEYOND,
    CREEP,
    EXCESS,
    FED,
    FED_IN_ALL,
    LARGEST,
    LARGEST_FORCE,
    LARGEST_SPEED,
    NEGLIGIBLE_PART,
    OFF_THRESHOLD,
    REACHED,
    REST_PART,
    ROUNDING_ERRORS,
    SPEED_HELD,
    SPENT,
    Accounts,
    Tally,
)
from stickslip.motion.audit.beginnings import judge_beginning
from stickslip.motion.audit.between_nodes import StepPiece
from stickslip.motion.audit.flights.arrays import (
    KNOWN,
    LONG_FLIGHT,
    REFUSED,
    REMEMBERED,
    UNKNOWN,
    FlightAudit,
    Stretch,
    put_slow,
    put_state,
    slow_rate,
)
from stickslip.motion.audit.flights.powers import add_work_of_pairs, power_of_pairs
from stickslip.motion.audit.flights.residuals import (
    evaluate_eigenvectors,
    note_residual,
    put_bounds,
    put_rows,
)
from stickslip.motion.audit.friction_law import sample_law
from stickslip.motion.audit.observers import Sums, count_times
from stickslip.motion.audit.step_balance import audit_step, sample_residuals
from stickslip.motion.audit.step_ends import (
    audit_start,
    close_step,
    count_jumps,
    jump_after,
    may_collide,
)
from stickslip.motion.modes.guards import resting
from stickslip.motion.modes.inverses import resolve
from stickslip.motion.steps.arrays import (
    DIMENSION,
    DISSIPATED,
    INERTIAL,
    OK,
    SUPPLIED,
    Flow,
    Instant,
    Machine,
    Record,
    Rows,
    is_stopped,
)
from stickslip.motion.steps.contacts import list_friction
from stickslip.motion.steps.sets import force_terms, is_rate_independent, kink_terms
from stickslip.motion.steps.starting import coefficients
from stickslip.motion.steps.step_size import impulse
from stickslip.numerics.levels import ROUNDING
from stickslip.translator import compiled

_ACTING = 4.0  # length of a Taylor series in shortest times
_ALLOWED = 5e-10  # largest error of a component relative to its size; twice that is not certified
WHOLE, WITHOUT_EXTREMES = range(2)
"""Slots of :attr:`FlightAudit.checked`."""
_DOUBTED, _CHECKED, _UNRESOLVED = range(3)


@entry_point()
def audit_motion(
    machine: Machine,
    flow: Flow,
    flights: FlightAudit,
    seen: Vector,
    starts: Record,
    ends: Record,
    accounts: Accounts,
) -> None:
    """Follow steps again, and measure them, long flights as a whole.

    Parameters
    ----------
    seen, starts, ends, accounts
        As in :func:`.audit_steps`.
    """
    for i in range(len(ends.time)):
        if is_stopped(flow.space):
            return
        length = ends.time[i] - starts.time[i]
        count_times(flow.rows, starts.mode[i], ends.mode[i], length, accounts.sums)
        if length > 0.0:
            found = audit_flight(machine, flow, flights, starts, ends, i, accounts)
            if found == _DOUBTED:
                audit_step(machine, flow, seen, starts, ends, True, i, accounts)
            flights.checked[WHOLE] += 1 if found != _DOUBTED else 0
            flights.checked[WITHOUT_EXTREMES] += 1 if found == _UNRESOLVED else 0
        elif (
            may_collide(flow.rows, ends.cause[i])
            or jump_after(flow.rows, ends.cause[i], starts.region[i]) >= 0
        ):
            audit_start(machine, flow, starts, ends, i, accounts)


@compiled()
def audit_flight(
    machine: Machine,
    flow: Flow,
    a: FlightAudit,
    starts: Record,
    ends: Record,
    i: int,
    accounts: Accounts,
) -> int:
    """Check and measure the i-th step as a whole: CHECKED; UNRESOLVED if a largest force is not
    found; DOUBTED, without contributions to the accounts, if no clear decision is possible.

    Parameters
    ----------
    starts, ends, accounts
        As in :func:`.audit_steps`.
    """
    rows, space = flow.rows, flow.space
    steps, tally = accounts.steps, accounts.tally
    nc = len(rows.u)
    mode = space.touched[:nc]
    reg = space.touched[nc:]
    copy(starts.mode[i], mode)
    copy(starts.region[i], reg)
    h = ends.time[i] - starts.time[i]
    slot = candidate(rows, a, mode, reg, h)
    if slot < 0 or jump_after(rows, ends.cause[i], reg) >= 0:
        return _DOUBTED
    form = form_of(a.forms, slot)
    space.W[rows.sizes[DIMENSION], 1] = 1.0
    start = Instant(starts.time[i], starts.state[i], mode, reg)
    if not resolve(rows, flow.k, space, mode):
        return _DOUBTED
    if a.state[slot] in (UNKNOWN, REMEMBERED):
        known = evaluate_eigenvectors(machine, flow, a, form, slot, start)
        if not known:
            a.state[slot] = REFUSED
        elif a.state[slot] == UNKNOWN:
            a.state[slot] = KNOWN
    if a.state[slot] == REFUSED:
        return _DOUBTED
    parts = begin_flight(flow, a, form, start, h)
    stretch = Stretch(
        slot, start.t, h, parts, form.counts[EXPONENTS], min(h, _ACTING * form.shortest)
    )
    if not is_flown(machine, flow, a, form, stretch, start, ends, i, tally):
        return _DOUBTED
    list_friction(rows, space, mode)
    sums = accounts.sums
    before = tally.total[ROUNDING_ERRORS]
    copy(sums.impulse, a.before[0])
    copy(sums.work, a.before[1])
    spent, fed, flows = 0.0, 0.0, 0.0
    obeyed, resolved = True, True
    # Rounding errors of the audit are bounded for each step and not carried from part to part.
    noise = a.made
    for r in range(len(a.y)):
        noise[r] = 0.0
    for part in range(parts):
        obeyed = not is_stopped(space)
        if not obeyed:
            break
        lost, given, more = follow_part(machine, flow, a, form, stretch, part, start, i, accounts)
        spent, fed, flows = spent + lost, fed + given, flows + more
        obeyed = lost == lost and obeys(rows, space.mag, a, form, stretch, start, tally)
        if not obeyed:
            break
        for r in range(len(a.y)):
            noise[r] = most(noise[r], steps.noise[i, r])
            steps.noise[i, r] = 0.0
        resolved = add_contacts(rows, space.mag, a, form, stretch, sums) and resolved
    if not obeyed:
        tally.total[ROUNDING_ERRORS] = before
        copy(a.before[0], sums.impulse)
        copy(a.before[1], sums.work)
        for r in range(len(a.y)):
            steps.noise[i, r] = 0.0
        return _DOUBTED
    lost, given = power_of_pairs(machine, flow, a, form, stretch, start)
    steps.work[i, SPENT] += spent + lost
    steps.work[i, FED] += fed + given
    tally.total[FED_IN_ALL] += flows
    for r in range(len(a.y)):
        steps.gap[i, r] += a.bound[r]
        steps.noise[i, r] = noise[r]
    add_work_of_pairs(rows, a, stretch, sums)
    final = Instant(ends.time[i], ends.state[i], mode, reg)
    put_state(a, form, stretch, h, flow.k.omega, space.trial)
    coefficients(machine, flow, Instant(final.t, space.trial, mode, reg), 1, space.W)
    close_step(flow, final, 1, 0.0, start.y, i, steps, tally)
    count_jumps(machine, flow, final, ends.region[i], i, steps, tally)
    judge_beginning(machine, flow, starts, ends, i, tally)
    return _CHECKED if resolved else _UNRESOLVED


@compiled()
def candidate(rows: Rows, a: FlightAudit, mode: Array, reg: Array, h: float) -> int:
    """The closed form that may be that of a step, if the step is long; else −1.

    Parameters
    ----------
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
    h : float
        Length of the step.
    """
    if len(a.state) == 0 or any_share(rows) or len(rows.openings) + len(rows.planes) > 0:
        return -1
    for c in range(len(mode)):
        if abs(mode[c]) > 1:
            return -1
    T = a.forms
    slot = find(T.key, T.own, 0, T.used[0], mode_key(mode, reg))
    if slot < 0 or slot >= len(a.state) or T.status[slot] != AFFINE:
        return -1
    return slot if h > LONG_FLIGHT * T.shortest[slot] > 0.0 else -1


@compiled()
def begin_flight(flow: Flow, a: FlightAudit, form: ClosedForms, start: Instant, h: float) -> int:
    """Put the amplitudes of a flight into the work space; returns in how many parts the drives turn
    a few radians each.

    Parameters
    ----------
    h : float
        Its length.
    """
    omega = flow.k.omega
    f = a.flight
    n = len(a.y)
    first = len(form.c2) - n
    place(f, start.y, start.t, omega)
    amplitudes(form, f, omega)
    for j in range(form.counts[EXPONENTS]):
        a.r[j] = f.r[j] if form.exponent[j] != 0.0j else complex(0.0, 0.0)
        a.growth[j] = math.exp(max(form.exponent[j].real * h, 0.0))
    for r in range(n):
        row = first + r
        a.ramp[r] = scalar_product(form.c1[row], f.v[0])
        a.bend[r] = form.c2[row]
        total = start.y[r]
        for j in range(form.counts[EXPONENTS]):
            total -= (form.a[row, j] * a.r[j]).real
        for m in range(len(omega)):
            a.swing[r, m] = form.b[row, m] * f.spin[m]
            total -= a.swing[r, m].real
        a.base[r] = total
        a.size[r] = abs(start.y[r])
        a.rest[r] = a.made[r] = 0.0
    for j in range(form.counts[EXPONENTS]):
        a.drift[j] = a.turns[j] = 0.0
    fastest = 0.0
    for frequency in omega:
        fastest = max(fastest, frequency)
    return max(1, math.ceil(h * fastest / RADIANS))


@compiled()
def is_flown(
    machine: Machine,
    flow: Flow,
    a: FlightAudit,
    form: ClosedForms,
    s: Stretch,
    start: Instant,
    ends: Record,
    i: int,
    tally: Tally,
) -> bool:
    """Whether a candidate satisfies the equations, and leads to the end of the step; its error
    bound is left in `bound`.

    Parameters
    ----------
    i : int
        The step.
    tally : Tally
        Sizes so far.
    """
    rows, space, omega = flow.rows, flow.space, flow.k.omega
    n = len(a.y)
    nq = rows.sizes[INERTIAL]
    here = Instant(start.t, a.y, start.mode, start.reg)
    for part in range(s.parts):
        if is_stopped(space):
            return False
        for g in range(COUNT):
            tau = (part + GAUSS_NODES[g]) * (s.h / s.parts)
            put_state(a, form, s, tau, omega, a.x)
            put_slow(a, tau, omega, a.y)
            here = Instant(start.t + tau, a.y, start.mode, start.reg)
            if coefficients(machine, flow, here, 1, space.V) != OK:
                return False
            for r in range(n):
                a.size[r] = max(a.size[r], abs(a.x[r]))
                a.x[r] = slow_rate(a, tau, omega, r) - space.V[rows.program.rates[r], 0]
            note_residual(a, form, s, part + g == 0)
    put_bounds(a, form, s)
    put_state(a, form, s, s.h, omega, a.x)
    for r in range(n):
        a.size[r] = max(a.size[r], tally.state[LARGEST, r])
    for body in rows.bodies:
        for begin in (body[0], nq + body[0]):
            largest = 0.0
            for r in range(begin, begin + body[1]):
                largest = max(largest, a.size[r])
            for r in range(begin, begin + body[1]):
                a.size[r] = largest
    for r in range(n):
        size = a.size[r] + REST_PART * impulse(rows, space.mag, r, s.acting)
        off = a.bound[r] + abs(a.x[r] - ends.state[i, r])
        if not off <= _ALLOWED * size:
            return False
    return True


@compiled()
def follow_part(
    machine: Machine,
    flow: Flow,
    a: FlightAudit,
    form: ClosedForms,
    s: Stretch,
    part: int,
    at: Instant,
    i: int,
    accounts: Accounts,
) -> tuple[float, float, float]:
    """Evaluate the law at the nodes of a part of a flight.

    Parameters
    ----------
    a : FlightAudit
        Receives the rows at q.
    at : Instant
        The beginning of the flight.
    i : int
        The step.
    accounts : Accounts
        Receives sizes.

    Returns
    -------
    lost, given, flows : float
        Energy that is dissipated, and supplied, without what exponentials do by themselves; and
        what is supplied in modulus. Not numbers if the equations fail at a node.
    """
    rows, space, omega = flow.rows, flow.space, flow.k.omega
    V, powers, sums = space.V, space.powers, accounts.sums
    n = len(a.y)
    first = len(form.c2) - n
    h = s.h / s.parts
    begin = part * h
    for j in range(s.exponents):
        a.begin[j] = a.r[j] * cmath.exp(form.exponent[j] * begin)
        put_moments_at_nodes(form.exponent[j] * h, a.moments, j, a.legendre)
    piece = StepPiece(1, s.t + begin, h, s.acting, 0.0, ROUNDING)
    spent, fed, flows = 0.0, 0.0, 0.0
    for g in range(COUNT):
        weight = h * GAUSS_WEIGHTS[g]
        tau = begin + h * GAUSS_NODES[g]
        put_slow(a, tau, omega, a.y)
        slow = Instant(s.t + tau, a.y, at.mode, at.reg)
        coefficients(machine, flow, slow, 1, V)
        put_rows(rows, V, a.slow, g)
        machine.powers(V, at.reg, flow.k.K, powers)
        spent, fed = spent + weight * powers[DISSIPATED], fed + weight * powers[SUPPLIED]
        for r in range(n):
            a.states[r, g] = a.y[r]
            total = 0.0
            for j in range(s.exponents):
                total += (form.a[first + r, j] * a.begin[j] * a.moments[g, j]).real
            a.x[r] = h * total
        # Powers are quadratic forms: half the difference of both sides is the mixed term of q and
        # the integrals of the exponentials.
        for side in (1.0, -1.0):
            for r in range(n):
                a.y[r] = a.states[r, g] + side * a.x[r]
            coefficients(machine, flow, slow, 1, V)
            machine.powers(V, at.reg, flow.k.K, powers)
            spent += 0.5 * side * powers[DISSIPATED]
            fed += 0.5 * side * powers[SUPPLIED]
        put_state(a, form, s, tau, omega, a.x)
        for r in range(n):
            rate = slow_rate(a, tau, omega, r)
            for j in range(s.exponents):
                rate += (form.exponent[j] * form.a[first + r, j] * a.z[j]).real
            space.samples[r, g] = rate
            sums.low[r], sums.high[r] = min(sums.low[r], a.x[r]), max(sums.high[r], a.x[r])
        coefficients(machine, flow, Instant(slow.t, a.x, at.mode, at.reg), 1, V)
        machine.powers(V, at.reg, flow.k.K, powers)
        flows += weight * abs(powers[SUPPLIED])
        sample_residuals(rows, space, piece, a.x, g, i, accounts.steps, accounts.tally)
        for r in range(n):
            size = a.size[r] + REST_PART * impulse(rows, space.mag, r, s.acting)
            if not s.acting * abs(space.samples[r, g]) <= _ALLOWED * size:
                return np.nan, np.nan, np.nan
        sample_law(rows, space, at.mode, at.reg, s.acting, g, accounts.tally)
    return spent, fed, flows


@compiled()
def signal_of(
    a: FlightAudit, form: ClosedForms, s: Stretch, row: int, sign: float, other: int, turn: float
) -> ModalSum:
    """A signal on the part of a flight that is in the work space: a row times a sign, and another
    one (−1: none).

    Parameters
    ----------
    turn : float
        Sign of the other.
    """
    for g in range(COUNT):
        a.line[g] = sign * a.slow[row, g]
        if other >= 0:
            a.line[g] += turn * a.slow[other, g]
    for j in range(s.exponents):
        z = sign * a.right[s.slot, row, j]
        if other >= 0:
            z += turn * a.right[s.slot, other, j]
        a.z[j] = z * a.begin[j]
    return sum_in_work(a, form, s)


@compiled()
def sum_in_work(a: FlightAudit, form: ClosedForms, s: Stretch) -> ModalSum:
    """The signal in the work space."""
    return ModalSum(
        a.line,
        a.z[: s.exponents],
        form.exponent[: s.exponents],
        s.h / s.parts,
        a.values,
        a.points,
        a.scratch,
        a.stack,
    )


@compiled()
def obeys(
    rows: Rows, mag: Array, a: FlightAudit, form: ClosedForms, s: Stretch, at: Instant, tally: Tally
) -> bool:
    """Whether the law holds on a part of a flight, up to negligible violations, which are recorded.

    Parameters
    ----------
    mag : array
        Sizes of terms.
    a : FlightAudit
        With the rows at q.
    """
    law = tally.law
    n, nc = len(a.y), len(rows.u)
    for c in rows.frictional:
        u, force, plus, minus = n + c, n + nc + c, n + 2 * nc + c, n + 3 * nc + c
        held = NEGLIGIBLE_PART * law[c, LARGEST_FORCE]
        fast = NEGLIGIBLE_PART * max(law[c, LARGEST_SPEED], REST_PART * law[c, SPEED_HELD])
        slack, blur = ROUNDING * mag[c], ROUNDING * force_terms(rows, mag, c)
        if resting(at.mode[c]):
            low = least_of_sum(signal_of(a, form, s, force, 1.0, plus, 1.0), 1e-2 * held)
            high = least_of_sum(signal_of(a, form, s, minus, 1.0, force, -1.0), 1e-2 * held)
            excess = -min(low, high) - blur
            creep = largest_of_sum(signal_of(a, form, s, u, 1.0, -1, 0.0), a.growth) - slack
            if not (excess <= held and creep <= fast):
                return False
            law[c, EXCESS] = most(law[c, EXCESS], excess)
            law[c, CREEP] = most(law[c, CREEP], creep)
            continue
        way = float(at.mode[c])
        low = least_of_sum(signal_of(a, form, s, u, way, -1, 0.0), 1e-2 * fast)
        if not -low - slack <= fast:
            return False
        law[c, BACKWARDS] = most(law[c, BACKWARDS], -low - slack)
        if is_rate_independent(rows, c):
            side = plus if way > 0.0 else minus
            off = largest_of_sum(signal_of(a, form, s, force, 1.0, side, way), a.growth) - blur
            if not off <= held:
                return False
            law[c, OFF_THRESHOLD] = most(law[c, OFF_THRESHOLD], off)
    for j in range(len(rows.kinks)):
        reached = NEGLIGIBLE_PART * tally.kinks[j, REACHED]
        way = 1.0 if at.reg[j] == 1 else -1.0
        low = least_of_sum(signal_of(a, form, s, n + 4 * nc + j, way, -1, 0.0), 1e-2 * reached)
        beyond = -low - ROUNDING * kink_terms(rows, mag, j)
        if not beyond <= reached:
            return False
        tally.kinks[j, BEYOND] = most(tally.kinks[j, BEYOND], beyond)
    return True


@compiled()
def add_contacts(
    rows: Rows, mag: Array, a: FlightAudit, form: ClosedForms, s: Stretch, sums: Sums
) -> bool:
    """Add the contributions of a part of a flight: extremes, largest forces, impulses, and work
    except that of products of exponentials; False if not all extremes are found.

    Parameters
    ----------
    mag : array
        Sizes of terms.
    a : FlightAudit
        With the rows and the state at q.
    """
    n, nc = len(a.y), len(rows.u)
    first = len(form.c2) - n
    h = s.h / s.parts
    found = True
    for r in range(n):
        if a.followed[r] == 0:
            continue
        for g in range(COUNT):
            a.line[g] = a.states[r, g]
        for j in range(s.exponents):
            a.z[j] = form.a[first + r, j] * a.begin[j]
        signal = sum_in_work(a, form, s)
        low, high, all_of = widen_by_sum(signal, sums.low[r], sums.high[r], ROUNDING * a.size[r])
        sums.low[r], sums.high[r] = low, high
        found = found and all_of
    for c in range(nc):
        u, force = n + c, n + nc + c
        signal = signal_of(a, form, s, force, 1.0, -1, 0.0)
        for end in range(2):
            sums.peak[c] = max(sums.peak[c], abs(signal_at(signal, end * h)))
        blur = ROUNDING * force_terms(rows, mag, c)
        low, high, all_of = widen_by_sum(signal, -sums.peak[c], sums.peak[c], blur)
        sums.peak[c] = max(sums.peak[c], max(high, -low))
        found = found and all_of
        for g in range(COUNT):
            fast, held = 0.0, 0.0
            for j in range(s.exponents):
                moment = h * a.begin[j] * a.moments[g, j]
                held += (a.right[s.slot, force, j] * moment).real
                fast += (a.right[s.slot, u, j] * moment).real
            # The slow parts by Gauss's rule, their products with exponentials by moments; products
            # of exponentials alone are added for the whole flight (:func:`add_work_of_pairs`).
            weight = h * GAUSS_WEIGHTS[g]
            sums.impulse[c] += weight * a.slow[force, g] + held
            sums.work[c] -= weight * a.slow[force, g] * a.slow[u, g]
            sums.work[c] -= a.slow[force, g] * fast + held * a.slow[u, g]
    return found
