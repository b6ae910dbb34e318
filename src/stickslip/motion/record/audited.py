"""The audit of a whole motion, from its knots alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.record.knots import Knots
from stickslip.stopping.scopes import unbroken

if TYPE_CHECKING:
    from stickslip.motion.audit.accounts import Accounts
    from stickslip.motion.audit.observers import Sums
    from stickslip.motion.problem import Problem


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
    sums : Sums
        Extremes, times in stick, forces and work of the contacts.
    """

    energy: Array
    dissipated: Array
    supplied: Array
    residuals: Array
    open: Array
    largest: Array
    sums: Sums


def audited(problem: Problem, knots: Knots, seen: Array, energy: Array) -> Audit:
    """Follow a motion again from every knot, and measure it.

    Parameters
    ----------
    problem : Problem
    knots : Knots
    seen : array
        Sizes of the state, against which steps are measured.
    energy : array, shape (knots,)
        At the knots.
    """
    from stickslip.motion.audit.accounts import FED_IN_ALL, LARGEST
    from stickslip.motion.audit.step_balance import judge

    steps, tally, sums = follow_again(problem, knots, seen)
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
        sums,
    )


def follow_again(problem: Problem, knots: Knots, seen: Array) -> Accounts:
    """Follow a motion again from knot to knot, and check it.

    Parameters
    ----------
    problem : Problem
    knots : Knots
    seen : array
        As of :func:`audited`.
    """
    from stickslip.motion.audit.accounts import make_accounts
    from stickslip.motion.audit.step_balance import audit_steps
    from stickslip.motion.steps.arrays import Record

    starts, ends = (Record(*(part[own] for part in knots.record)) for own in (_BEFORE, _AFTER))

    def measured() -> Accounts:
        accounts = make_accounts(len(ends.time), problem.rows)
        flow = problem.flow(retracing=True)
        audit_steps(problem.machine, flow, seen, starts, ends, True, accounts)
        return accounts

    return unbroken(measured)


def work_in_steps(problem: Problem, knots: Knots, seen: Array, step: Array, times: Array) -> Array:
    """Work, dissipated and supplied, from the beginning of steps until times in them, shape
    (times, 2).

    Parameters
    ----------
    problem : Problem
    knots : Knots
    seen : array
        As of :func:`audited`.
    step : array of int, shape (times,)
        The knots in whose steps they are, in their order.
    times : array
        In their order within a step.
    """
    from stickslip.motion.audit.work import work_until

    def measured() -> Array:
        work = np.zeros((len(times), 2))
        flow = problem.flow(retracing=True)
        work_until(problem.machine, flow, seen, knots.record, step, times, work)
        return work

    return unbroken(measured)


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
