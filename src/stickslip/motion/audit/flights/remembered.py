"""Evaluations of the equations at the eigenvectors of modes, kept from audit to audit.

They depend on the eigenvectors and on the constants that multiply components of the state only
(:mod:`stickslip.motion.affine.kept_slopes`), which are compared bit by bit: an audit finds the same
numbers as without them. That a mode is affine is proved in every audit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import AnyArray
from stickslip.kept import kept
from stickslip.motion.affine.forms import EXPONENTS, ClosedForms
from stickslip.motion.affine.kept_modes import KEPT_BYTES
from stickslip.motion.audit.flights.arrays import KNOWN, REMEMBERED, FlightAudit

if TYPE_CHECKING:
    from stickslip.motion.problem import Problem


def recall_evaluations(problem: Problem, audit: FlightAudit) -> None:
    """Put known evaluations into an audit."""
    known = kept(problem.compiled, "evaluations")
    constants = _constants(problem) if known else b""
    for slot in range(len(audit.state) if known else 0):
        found = known.get((int(audit.forms.key[slot]), constants))
        if found is None:
            continue
        given, made = found
        if all(map(np.array_equal, given, _vectors(audit.forms, slot, len(audit.y)))):
            for part, value in zip(_evaluated(audit, slot), made, strict=True):
                part[...] = value
            audit.state[slot] = REMEMBERED


def remember_evaluations(problem: Problem, audit: FlightAudit) -> None:
    """Keep what an audit has evaluated, in place of the oldest if there is no room."""
    n = len(audit.y)
    if not len(audit.flight.making.slopes.settings):
        return  # few states, which are evaluated faster than compared
    known = kept(problem.compiled, "evaluations")
    constants = _constants(problem)
    for slot in np.flatnonzero(audit.state == KNOWN).tolist():
        given = [part.copy() for part in _vectors(audit.forms, slot, n)]
        made = [part.copy() for part in _evaluated(audit, slot)]
        size = sum(part.nbytes for part in (*given, *made))
        while len(known) * size > KEPT_BYTES:
            known.pop(next(iter(known)), None)
        known[int(audit.forms.key[slot]), constants] = given, made


def _constants(problem: Problem) -> bytes:
    """The constants that multiply components of the state."""
    k = problem.constants
    scaling = k.K[problem.shared_flight.making.slopes.scaling]
    return b"".join(part.tobytes() for part in (scaling, k.M, k.C, k.J))


def _vectors(forms: ClosedForms, slot: int, n: int) -> list[AnyArray]:
    """Eigenvalues of a mode, with right and left eigenvectors."""
    count = forms.counts[slot, EXPONENTS]
    right = forms.a[slot, forms.a.shape[1] - n :, :count]
    return [forms.exponent[slot, :count], right, forms.R[slot, :count, :n]]


def _evaluated(audit: FlightAudit, slot: int) -> list[AnyArray]:
    """The evaluations of a mode, and what follows from them."""
    count = audit.forms.counts[slot, EXPONENTS]
    own = audit.straight[slot, :count, :count], audit.turned[slot, :count, :count]
    return [audit.right[slot, :, :count], *own, audit.aside[slot, :, :count]]
