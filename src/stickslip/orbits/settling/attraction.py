"""That motions come by themselves to the cycles that they were carried on to: the compiled proof,
and the fields that it needs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.between.dense import make_scratch
from stickslip.orbits.fields.engine.variations import MET, STAGES, room_for_pass
from stickslip.orbits.fields.mode_field import Pieces, places_of
from stickslip.orbits.settling.engine.attraction import (
    OPEN_CLAIM,
    PROVED,
    UNKNOWN_MODE,
    Claims,
    prove_all,
)

if TYPE_CHECKING:
    from stickslip.motion.problem import Problem
    from stickslip.motion.steps.arrays import Lane
    from stickslip.orbits.settling.engine.tables import Bench, Engine, Marks, Rules

STAT = {}
_FOLLOWED = 32  # deviations from which returns may be followed
_NODES = 64  # of the first variation, for each knot that is recorded, at most


def attracted(
    problem: Problem,
    pieces: Pieces,
    table: Array,
    engine: Engine,
    settling: tuple[Marks, Rules, Lane, Bench],
    stop: Array,
) -> Array:
    """Which lanes that were carried on by hand come to their cycles by themselves.

    Parameters
    ----------
    problem : Problem
    pieces : Pieces
        Of its system; receives the fields of the modes that are met.
    table : array, shape (lanes, parameters)
    engine, settling
        As of :func:`stickslip.orbits.settling.engine.attraction.prove_all`.
    stop : array, shape (1,)

    Returns
    -------
    array of bool, shape (lanes,)
    """
    lanes = len(table)
    contacts, kinks = len(problem.rows.u), len(problem.rows.kinks)
    verdict = np.full(lanes, OPEN_CLAIM)
    wanted = np.zeros((lanes, contacts + kinks), np.int64)
    if not pieces.made:
        first = settling[2]
        pieces.number(first.mode[0].astype(np.int8), first.reg[0].astype(np.int8))
    while np.any(verdict == OPEN_CLAIM) and stop[0] == 0:
        claims = _claims(problem, pieces, table, engine, settling, verdict, wanted)
        prove_all(engine, *settling, claims, stop)
        missing = wanted[verdict == UNKNOWN_MODE]
        if len(missing) == 0:
            break
        for row in np.unique(missing, axis=0).astype(np.int8):
            pieces.number(row[:contacts], row[contacts:])
        verdict[verdict == UNKNOWN_MODE] = OPEN_CLAIM
    import collections

    for v in verdict:
        STAT[int(v)] = STAT.get(int(v), 0) + 1
    return verdict == PROVED


def _claims(
    problem: Problem,
    pieces: Pieces,
    table: Array,
    engine: Engine,
    settling: tuple[Marks, Rules, Lane, Bench],
    verdict: Array,
    wanted: Array,
) -> Claims:
    bench = settling[3]
    knots = len(bench.record.time)
    n = bench.record.state.shape[1]
    listed = pieces.listed
    omega = engine.flow.k.omega[engine.group]
    between = make_scratch(problem.rows, (0, 2))
    made = [piece.field for piece in pieces.made]
    return Claims(
        verdict=verdict,
        wanted=wanted,
        parameters=np.ascontiguousarray(table),
        drives=np.max(np.abs(omega), axis=1, initial=0.0),
        origin=float(problem.origin),
        listed=listed,
        modes=np.array([field.mode for field in made], np.int64).reshape(len(made), -1),
        regions=np.array([field.region for field in made], np.int64).reshape(len(made), -1),
        piece=np.zeros(knots, np.int64),
        parts=np.zeros(knots, np.int64),
        outcome=np.zeros(knots, np.int64),
        event=np.zeros(MET + 1 + listed.switches.shape[1], np.int64),
        after=np.zeros((knots, n, n)),
        work=room_for_pass(
            listed, places_of(pieces.made), _NODES * STAGES * knots, (n, n), between
        ),
        squares=np.zeros((2, n, n)),
        deviation=np.zeros((5, n)),
        followed=np.zeros((_FOLLOWED, n)),
    )
