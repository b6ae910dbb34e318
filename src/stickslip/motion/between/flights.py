"""States within long flights, directly from their closed forms."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import AnyArray, Array
from stickslip.motion.affine.flights import mode_key
from stickslip.motion.affine.forms import EXPONENTS, ClosedForms
from stickslip.stopping.scopes import unbroken

if TYPE_CHECKING:
    from stickslip.motion.problem import Problem
    from stickslip.motion.record.knots import Knots

# shortest length of a flight, in times of its fastest term, for which a closed form pays
_LONG = 100.0
APART = 150.0  # the same per requested time in it, if work is requested


def known_forms(problem: Problem, knots: Knots) -> ClosedForms:
    """The closed forms of a motion, which are recomputed for a motion from a file."""
    from stickslip.motion.engine.event_loop import prepare_flights
    from stickslip.motion.steps.arrays import Constants

    T = problem.closed_forms
    if len(T.status) == 0 or T.used[0] > 0 or len(knots.clock) < 2:
        return T
    lasts = np.append(np.diff(knots.clock) > 0.0, False)
    lasts &= ~np.any(np.abs(knots.mode) > 1, axis=1)
    both = np.column_stack([knots.mode[lasts], knots.region[lasts]]).astype(np.int64)
    both = both[np.sort(np.unique(both, axis=0, return_index=True)[1])]
    contacts = knots.mode.shape[1]
    modes, regions = map(np.ascontiguousarray, (both[:, :contacts], both[:, contacts:]))
    constants = Constants(*(part[None] for part in problem.constants))

    def made() -> None:
        flow = problem.flow(constants)
        prepare_flights(problem.machine, flow, problem.shared_flight, T, modes, regions)

    unbroken(made)
    return T


def states_in_flights(
    problem: Problem, knots: Knots, index: Array, clock: Array, out: Array, apart: float = 0.0
) -> Array:
    """Put the states at some times into an array, as far as the times are in long flights.

    Parameters
    ----------
    index : array of int, shape (times,)
        The knots in whose steps the times are.
    clock : array, shape (times,)
        Times since the origin.
    out : array, shape (times, n)
        Receives the states.
    apart : float
        Shortest times between those in a flight, on average, from which on it is worth it.

    Returns
    -------
    array of bool, shape (times,)
        Where there is one; not at the knots themselves.
    """
    done = np.zeros(len(clock), bool)
    if not np.any(clock > knots.clock[index]):
        return done
    T = known_forms(problem, knots)
    used = int(T.used[0]) if len(T.status) else 0
    if not np.any(T.flown[:used]):
        return done
    slots = {int(key): slot for slot, key in enumerate(T.key[:used]) if T.flown[slot]}
    omega = problem.constants.omega
    n = out.shape[1]
    lengths = np.append(np.diff(knots.clock), 0.0)
    fast = (T.flown[:used] == 1) & (T.shortest[:used] > 0.0)
    if not np.any(fast):
        return done
    shortest = float(np.min(T.shortest[:used][fast]))
    # At a knot the state is known; few of the flights of a motion contain other times.
    inside = np.flatnonzero((clock > knots.clock[index]) & (lengths[index] > _LONG * shortest))
    inside = inside[np.argsort(index[inside], kind="stable")]
    which, firsts = np.unique(index[inside], return_index=True)
    for i, own in zip(which, np.split(inside, firsts[1:]), strict=False):
        if np.any(np.abs(knots.mode[i]) > 1):
            continue
        slot = slots.get(mode_key(knots.mode[i].astype(np.int64), knots.region[i].astype(np.int64)))
        least = 0.0 if slot is None else max(_LONG, apart * len(own)) * float(T.shortest[slot])
        if slot is None or not lengths[i] > least > 0.0:
            continue
        begin = float(knots.clock[i])  # origin of the time of the drives, here as in flights
        tau = clock[own] - knots.clock[i]
        waves: AnyArray = np.exp(1j * omega * begin)
        s = np.concatenate(
            [knots.state[i], [1.0, begin], np.column_stack([waves.real, waves.imag]).ravel()]
        )
        count = int(T.counts[slot, EXPONENTS])
        signals = slice(T.c2.shape[1] - n, None)
        turned: AnyArray = np.expm1(np.multiply.outer(tau, T.exponent[slot, :count]))
        turned *= T.R[slot, :count] @ s
        swung: AnyArray = np.expm1(1j * np.multiply.outer(tau, omega)) * waves
        drift = T.c1[slot, signals] @ s
        out[own] = (
            knots.state[i]
            + np.multiply.outer(tau, drift)
            + np.multiply.outer(tau * tau, T.c2[slot, signals])
            + (turned @ T.a[slot, signals, :count].T).real
            + (swung @ T.b[slot, signals].T).real
        )
        done[own] = True
    return done
