"""The audit of a whole motion, from its knots alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.kept import cached_property, made_once
from stickslip.model.entries.declared import Kind
from stickslip.motion.record.knots import Knots
from stickslip.stopping.scopes import unbroken
from stickslip.symbolic import expressions as ex

if TYPE_CHECKING:
    from stickslip.motion.affine.forms import ClosedForms
    from stickslip.motion.audit.accounts import Accounts
    from stickslip.motion.audit.observers import Sums
    from stickslip.motion.problem import Problem
    from stickslip.motion.steps.arrays import Record


_BEFORE, _AFTER = slice(None, -1), slice(1, None)


@dataclass(frozen=True)
class Audit:
    """A motion measured again from its knots.

    Attributes
    ----------
    energy, dissipated, supplied : arrays, shape (knots,)
    residuals : array, shape (4,)
        See :func:`stickslip.motion.audit.step_balance.judge`.
    open : array, shape (knots,)
        Time after each knot that is not verified.
    largest : array, shape (n,)
        Largest modulus of each component.
    shares : Sums
        Times in stick, forces and work of the contacts; extremes, too, but in long flights these
        are those at some nodes.
    known : array of bool, shape (n,)
        Of which components these extremes are exact.
    exact : callable, optional
        Finds those of all, where they are not.
    """

    energy: Array
    dissipated: Array
    supplied: Array
    residuals: Array
    open: Array
    largest: Array
    shares: Sums
    known: Array
    exact: Callable[[], Sums] | None

    @cached_property
    def sums(self) -> Sums:
        """Extremes, times in stick, forces and work of the contacts."""
        return self.shares if self.exact is None else self.exact()


def audited(problem: Problem, knots: Knots, seen: Array, energy: Array) -> Audit:
    """Follow a motion again from every knot, and measure it.

    Parameters
    ----------
    seen : array
        Sizes of the state, against which steps are measured.
    energy : array, shape (knots,)
        At the knots.
    """
    from stickslip.motion.audit.accounts import FED_IN_ALL, LARGEST
    from stickslip.motion.audit.flights.arrays import extremes_known
    from stickslip.motion.audit.step_balance import judge

    (steps, tally, sums), whole, lost = follow_again(problem, knots, seen)
    known = np.ones(knots.state.shape[1], dtype=bool)
    if whole:
        rising = _moved_by_slip(problem)
        known = extremes_known(problem.rows) | rising
        sums.low[rising] = np.min(knots.state[:, rising], axis=0)
        sums.high[rising] = np.max(knots.state[:, rising], axis=0)
    exact = None if np.all(known) and not lost else partial(sums_of, problem, knots, seen)
    work = np.vstack([np.zeros((1, 2)), np.cumsum(steps.work, axis=0)])
    balance = energy - energy[0] + work[:, 0] - work[:, 1]
    flow = max(
        np.ptp(energy),
        work[-1, 0],
        tally.total[FED_IN_ALL],
        np.max(_kinetic(problem, knots), initial=0.0),
    )
    imbalance, top = np.max(np.abs(balance)), np.max(np.abs(energy))
    residuals = np.zeros(4)
    judge(problem.rows, tally, float(imbalance), float(flow), float(top), residuals)
    return Audit(
        energy,
        work[:, 0],
        work[:, 1],
        residuals,
        np.append(steps.open, 0.0),
        tally.state[LARGEST],
        exact() if exact and lost else sums,
        known if not lost else np.ones_like(known),
        None if lost else exact,
    )


def follow_again(problem: Problem, knots: Knots, seen: Array) -> tuple[Accounts, int, int]:
    """Follow a motion again from knot to knot, and check it; also, how many steps are checked as a
    whole, and in how many of them extremes are not found.

    Parameters
    ----------
    seen : array
        As in :func:`audited`.
    """
    from stickslip.motion.between.flights import known_forms

    return _followed(problem, known_forms(problem, knots), _starts_and_ends(knots), seen)


def _followed(
    problem: Problem, forms: ClosedForms, pairs: tuple[Record, Record], seen: Array
) -> tuple[Accounts, int, int]:
    """The same, from starts to ends."""
    from stickslip.motion.audit.accounts import make_accounts
    from stickslip.motion.audit.flights.arrays import has_long_flights, make_flight_audit
    from stickslip.motion.audit.flights.remembered import (
        recall_evaluations,
        remember_evaluations,
    )
    from stickslip.motion.audit.flights.whole import WHOLE, WITHOUT_EXTREMES, audit_motion
    from stickslip.motion.audit.step_balance import audit_steps

    starts, ends = pairs
    long = has_long_flights(forms, ends.time - starts.time) and problem.has_quadratic_powers

    def measured() -> tuple[Accounts, int, int]:
        accounts = make_accounts(len(ends.time), problem.rows)
        flow = problem.flow(retracing=True)
        if not long:
            audit_steps(problem.machine, flow, seen, starts, ends, True, accounts)
            return accounts, 0, 0
        flights = make_flight_audit(forms, problem.shared_flight, problem.rows, True)
        recall_evaluations(problem, flights)
        audit_motion(problem.machine, flow, flights, seen, starts, ends, accounts)
        remember_evaluations(problem, flights)
        return accounts, int(flights.checked[WHOLE]), int(flights.checked[WITHOUT_EXTREMES])

    return unbroken(measured)


def sums_of(problem: Problem, knots: Knots, seen: Array) -> Sums:
    """Measures of a motion, piece by piece.

    Parameters
    ----------
    problem, knots, seen
        As in :func:`audited`.
    """
    from stickslip.motion.audit.accounts import make_accounts
    from stickslip.motion.audit.step_balance import audit_steps

    def measured() -> Sums:
        accounts = make_accounts(len(knots.time) - 1, problem.rows)
        flow = problem.flow(retracing=True)
        given = problem.machine, flow, seen, *_starts_and_ends(knots)
        audit_steps(*given, True, accounts)
        return accounts.sums

    return unbroken(measured)


def _starts_and_ends(knots: Knots) -> tuple[Record, Record]:
    from stickslip.motion.steps.arrays import Record

    starts, ends = (Record(*(part[own] for part in knots.record)) for own in (_BEFORE, _AFTER))
    return starts, ends


def work_in_steps(problem: Problem, knots: Knots, seen: Array, step: Array, times: Array) -> Array:
    """Work, dissipated and supplied, from the beginning of steps until times in them, shape
    (times, 2).

    Parameters
    ----------
    seen : array
        As in :func:`audited`.
    step : array of int, shape (times,)
        The knots in whose steps they are, in their order.
    times : array
        In their order within a step.
    """
    from stickslip.motion.audit.work import work_until
    from stickslip.motion.between.flights import APART, states_in_flights

    work = np.zeros((len(times), 2))
    states = np.empty((len(times), knots.state.shape[1]))
    flown = states_in_flights(problem, knots, step, times, states, APART)
    if np.any(flown):
        given = step[flown], times[flown], states[flown]
        work[flown] = _work_in_flights(problem, knots, seen, *given)
    if np.all(flown):
        return work
    step, times = step[~flown], times[~flown]

    def measured() -> Array:
        found = np.zeros((len(times), 2))
        flow = problem.flow(retracing=True)
        work_until(problem.machine, flow, seen, knots.record, step, times, found)
        return found

    work[~flown] = unbroken(measured)
    return work


def _work_in_flights(
    problem: Problem, knots: Knots, seen: Array, step: Array, times: Array, states: Array
) -> Array:
    """The same where states at the times are known: from each to the next, as the audit measures
    it."""
    from stickslip.motion.steps.arrays import Record

    mode, region = knots.mode[step], knots.region[step]
    nothing = np.full(len(times), -1)
    ends = Record(times, states, mode, region, nothing)
    first = np.append(True, np.diff(step) > 0)
    before = np.where(first, knots.clock[step], np.roll(times, 1))
    left = np.where(first[:, None], knots.state[step], np.roll(states, 1, axis=0))
    starts = Record(before, left, mode, region, nothing)
    accounts, *_ = _followed(problem, problem.closed_forms, (starts, ends), seen)
    total = np.cumsum(accounts.steps.work, axis=0)
    begun = (total - accounts.steps.work)[first]
    return total - begun[np.cumsum(first) - 1]


def _moved_by_slip(problem: Problem) -> Array:
    """Components of the state that only slip on a surface at rest moves: their extremes are at
    knots, since a contact does not reverse its slip between two."""

    def make() -> Array:
        equations = problem.compiled.equations
        d = equations.declaration
        found = np.zeros(len(d.state), dtype=bool)
        for c in equations.contacts:
            alone = c.kind == Kind.RATE_INDEPENDENT and len(c.direction) == 1 and not c.plane
            if alone and c.speed is ex.ZERO:
                found[d.state.index(next(iter(c.direction)))] = True
        return found

    return made_once(problem.compiled, "moved by slip", make)


def _kinetic(problem: Problem, knots: Knots) -> Array:
    """Kinetic energy at the knots."""
    layout = problem.compiled.layout
    n = layout.sizes["nq"]
    v = knots.state[:, n : 2 * n]
    parts = layout.coupled["Rq"]
    if any(part.moving for part in parts):
        return _kinetic_of_formula(problem, knots)
    total = np.zeros(len(v))
    for part in parts:
        of_part = v[:, part.coordinates]
        M = problem.constants.M[part.coordinates, : len(part.coordinates)]
        total += np.einsum("ki,ij,kj->k", of_part, M, of_part)
    return 0.5 * total


def _kinetic_of_formula(problem: Problem, knots: Knots) -> Array:
    """The same where the mass matrix is not constant."""
    from stickslip.symbolic.evaluator import evaluator

    d = problem.compiled.equations.declaration
    given = problem.parameters
    values = [
        *knots.state.T,
        knots.time,
        *(np.full(len(knots.time), given[p]) for p in d.parameters),
    ]
    (found,) = evaluator([d.kinetic], [*d.state, "t", *d.parameters])(np.array(values))
    return np.asarray(found)
