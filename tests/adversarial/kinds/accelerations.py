"""Accelerations at an instant, against a convex solver: with given thresholds they are unique,
whatever the rank of the directions,

    min ½ aᵀM a − fᵀa + Σ s |A(J a + J̇ q̇)| over contacts at rest − Σ λ·J a over those that slip.

The solver says which contacts stay; Newton's method in what they leave free makes the minimiser
exact; and forces that keep them must exist, as the solver says again.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from typing import Any

import numpy as np
from scipy import sparse
from scipy.linalg import null_space

import stickslip as ss

from ..families.leaving import FAMILIES, Instant, names
from ..references.mechanics import Array
from ..references.pieces import NoAnswer
from ..registry import in_turn
from ..verdict import (
    AGREED,
    NO_REFERENCE,
    NOT_CERTIFIED,
    REFUSED,
    WRONG,
    OutOfTime,
    Verdict,
    at_most,
)
from .motions import without_numbers

__all__ = ["FAMILIES", "cases", "draw", "judge", "reproduction"]

draw = FAMILIES.draw
CLOSE = 1e-10  # of what friction and loads accelerate
STAYS = 1e-5  # of the same: an acceleration that may be none
HELD = 1e-6  # part of the thresholds up to which the solver is asked
PATIENCE = 60.0


def cases(seed: int = 0, count: int = 100) -> Iterator[Instant]:
    """Cases of all families in turn."""
    return in_turn(FAMILIES, draw, seed, count)


def reproduction(case: Instant) -> str:
    """A script that repeats a case."""
    return case.source()


def judge(case: Instant) -> Verdict:
    """Compute accelerations twice and compare."""
    try:
        with at_most(PATIENCE):
            motion = ss.simulate(
                case.system, (0.0, 1e-3), initial=case.start, parameters=case.numbers
            )
            sampled, certificate = motion.at(0.0), motion.certificate
    except Exception as error:  # whatever it raises is a finding
        return Verdict(REFUSED, f"raises {type(error).__name__}: {without_numbers(str(error))}")
    try:
        with at_most(PATIENCE):
            expected = minimiser(case)
    except (NoAnswer, OutOfTime, np.linalg.LinAlgError) as error:
        return Verdict(NO_REFERENCE, f"{type(error).__name__}: {error}")
    numbers: dict[str, Any] = {"outcome": motion.outcome.label}
    if not motion.outcome.ok and motion.knots.time[-1] == 0.0:
        return Verdict(REFUSED, motion.outcome.label, numbers)
    found = np.array([float(np.asarray(sampled[f"dd_{x}"])) for x in names(case.shape)])
    off = float(np.max(np.abs(found - expected))) / scale(case)
    numbers |= {"difference": off, "got": found.tolist(), "expected": expected.tolist()}
    fault = "" if off <= CLOSE else "accelerations differ"
    if fault and certificate.ok:
        return Verdict(WRONG, fault, numbers)
    if not motion.outcome.ok:
        return Verdict(REFUSED, f"{motion.outcome.label}, {fault or 'but right'}", numbers)
    if not certificate.ok:
        reasons = [r.name for r in certificate.residuals if not r.ok]
        reasons += ["not verified everywhere"] * bool(certificate.unverified)
        return Verdict(NOT_CERTIFIED, f"{', '.join(reasons)}, {fault or 'but right'}", numbers)
    return Verdict(AGREED, "", numbers)


def scale(case: Instant) -> float:
    """What friction and loads may accelerate."""
    inverse = np.linalg.inv(case.mass)
    sizes = [np.max(np.abs(inverse @ case.force), initial=0.0)]
    sizes += [s * np.max(np.abs(inverse @ J.T)) for J, s in zip(case.rows, case.holds, strict=True)]
    sizes += [np.max(np.abs(b), initial=0.0) for b in case.turns]
    return float(np.max(sizes))


def at_rest(case: Instant) -> list[int]:
    """Contacts whose relative velocity is zero."""
    return [k for k, slide in enumerate(case.slides) if not np.any(slide)]


def pushed(case: Instant) -> Array:
    """Loads and the friction of what slips."""
    f = case.force.copy()
    for J, slide, s in zip(case.rows, case.slides, case.holds, strict=True):
        if np.any(slide):
            f -= s * J.T @ slide / np.linalg.norm(slide)
    return f


# -- the minimiser ---------------------------------------------------------------------------------


def minimiser(case: Instant) -> Array:
    """The accelerations.

    Raises
    ------
    NoAnswer
        If it is not known which contacts stay.
    """
    f, rest = pushed(case), at_rest(case)
    crude = solved(case, f, rest)
    size = scale(case)
    pulls = {k: case.rows[k] @ crude + case.turns[k] for k in rest}
    stay = [k for k in rest if np.linalg.norm(pulls[k]) <= STAYS * size]
    a = refined(case, f, rest, stay, crude)
    for k in rest:
        if k not in stay and np.linalg.norm(case.rows[k] @ a + case.turns[k]) <= 1e-8 * size:
            raise NoAnswer("what hardly moves")
    kept = f - case.mass @ a
    for k in rest:
        if k not in stay:
            pull = case.rows[k] @ a + case.turns[k]
            kept -= case.holds[k] * case.rows[k].T @ pull / np.linalg.norm(pull)
    if stay and overload(case, kept, stay) > 1.0 + HELD:
        raise NoAnswer("what stays is not held")
    if not stay and np.max(np.abs(kept)) > 1e-9 * np.max(np.abs(case.mass)) * size:
        raise NoAnswer("Newton's method has not settled")
    return a


def refined(case: Instant, f: Array, rest: list[int], stay: list[int], crude: Array) -> Array:
    """The minimiser by Newton's method in what is free where some contacts stay."""
    free, a = np.eye(len(f)), crude
    if stay:
        rows = np.concatenate([case.rows[k] for k in stay])
        turns = np.concatenate([case.turns[k] for k in stay])
        free = null_space(rows, rcond=1e-9)
        a = a - np.linalg.lstsq(rows, rows @ a + turns, rcond=1e-9)[0]
    moving = [k for k in rest if k not in stay]

    def value(a: Array) -> float:
        held = sum(case.holds[k] * np.linalg.norm(case.rows[k] @ a + case.turns[k]) for k in moving)
        return float(a @ case.mass @ a / 2 - f @ a + held)

    for _ in range(50 if free.size else 0):
        slope, bend = case.mass @ a - f, case.mass.copy()
        for k in moving:
            J, s = case.rows[k], case.holds[k]
            pull = J @ a + case.turns[k]
            r = np.linalg.norm(pull)
            n = pull / r
            slope = slope + s * J.T @ n
            bend = bend + s / r * J.T @ (np.eye(len(J)) - np.outer(n, n)) @ J
        step = -free @ np.linalg.solve(free.T @ bend @ free, free.T @ slope)
        part = 1.0
        while part > 1e-6 and value(a + part * step) > value(a) + 1e-13 * abs(value(a)):
            part /= 2.0
        a = a + part * step
        if np.max(np.abs(step)) <= 1e-15 * max(1.0, float(np.max(np.abs(a)))):
            break
    return a


def conic(P: Array, q: Array, A: Array, b: Array, widths: list[int]) -> Array:
    """The solution of min ½xᵀPx + qᵀx with b − Ax in second-order cones, or zero (width −d)."""
    clarabel: Any = import_module("clarabel")
    cones = [clarabel.SecondOrderConeT(w) if w > 0 else clarabel.ZeroConeT(-w) for w in widths]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-13
    settings.tol_ktratio = 1e-9
    given = sparse.csc_matrix(np.triu(P)), q, sparse.csc_matrix(A), b, cones, settings
    found = clarabel.DefaultSolver(*given).solve()
    if str(found.status) not in ("Solved", "AlmostSolved", "InsufficientProgress"):
        raise NoAnswer(f"clarabel: {found.status}")
    return np.array(found.x)


def solved(case: Instant, f: Array, rest: list[int]) -> Array:
    """The minimiser by the convex solver."""
    n, m = len(f), len(rest)
    P = np.zeros((n + m, n + m))
    P[:n, :n] = case.mass
    if not rest:
        return np.linalg.solve(case.mass, f)
    q = np.concatenate([-f, case.holds[rest]])
    blocks, right, widths = [], [], []
    for i, k in enumerate(rest):
        J = case.rows[k]
        block = np.zeros((1 + len(J), n + m))
        block[0, n + i] = -1.0
        block[1:, :n] = -J
        blocks.append(block)
        right.append(np.concatenate([[0.0], case.turns[k]]))
        widths.append(1 + len(J))
    return conic(P, q, np.concatenate(blocks), np.concatenate(right), widths)[:n]


def overload(case: Instant, kept: Array, stay: list[int]) -> float:
    """The least factor of their thresholds with which contacts hold a force."""
    n = len(kept)
    ends = np.cumsum([1] + [len(case.rows[k]) for k in stay])
    total = int(ends[-1])
    sums = np.zeros((n, total))
    blocks, widths = [sums], [-n]
    for k, first, last in zip(stay, ends, ends[1:], strict=False):
        sums[:, first:last] = case.rows[k].T
        block = np.zeros((1 + last - first, total))
        block[0, 0] = -case.holds[k]
        block[1:, first:last] = -np.eye(last - first)
        blocks.append(block)
        widths.append(1 + last - first)
    q = np.zeros(total)
    q[0] = 1.0
    right = np.concatenate([kept, np.zeros(sum(w for w in widths if w > 0))])
    return float(conic(np.zeros((total, total)), q, np.concatenate(blocks), right, widths)[0])
