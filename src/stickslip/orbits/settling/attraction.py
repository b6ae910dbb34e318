"""Proof that motions converge to the cycles found by extrapolation: the compiled proof, and its
fields."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.between.dense import make_scratch
from stickslip.orbits.fields.engine.tables import MET, STAGES, room_for_pass
from stickslip.orbits.fields.mode_field import Pieces, places_of
from stickslip.orbits.settling.engine.attraction import (
    OPEN_CLAIM,
    PROVED,
    REFUSED,
    UNKNOWN_MODE,
    Claims,
    prove_all,
)
from stickslip.orbits.settling.engine.tables import LEAPT, PHASE, PROVING
from stickslip.stopping.scopes import check_stop

if TYPE_CHECKING:
    from stickslip.motion.problem import Problem
    from stickslip.motion.steps.arrays import Lane
    from stickslip.orbits.settling.engine.tables import Bench, Engine, Marks, Rules

_FOLLOWED = 32  # number of deviations whose returns are computed
_PARTS = 4  # average number of parts for which there is room in the step between two knots


class Attraction:
    """The proof, for motions of one system.

    Parameters
    ----------
    pieces : Pieces
        Of its system; receives the fields of the modes that are met.
    table : array, shape (lanes, parameters)
    """

    def __init__(self, problem: Problem, pieces: Pieces, table: Array) -> None:
        self.problem = problem
        self.pieces = pieces
        self.table = np.ascontiguousarray(table)
        self._claims: Claims | None = None

    def prove(self, engine: Engine, settling: tuple[Marks, Rules, Lane, Bench]) -> Array:
        """Extrapolated lanes that are proved to converge to their cycles.

        Parameters
        ----------
        engine, settling
            As in :func:`stickslip.orbits.settling.engine.attraction.prove_all`.

        Returns
        -------
        array of bool, shape (lanes,)
        """
        marks, _, saved, bench = settling
        if self._claims is None:
            claimed = np.flatnonzero(
                (marks.numbers[:, PHASE] == PROVING) & (marks.numbers[:, LEAPT] > 0)
            )
            if not self._listed(np.concatenate([saved.mode[claimed[0]], saved.reg[claimed[0]]])):
                return np.zeros(len(self.table), bool)
            self._claims = self._made(engine, bench)
        self._claims.verdict[:] = OPEN_CLAIM
        while True:
            claims = self._claims
            prove_all(engine, *settling, claims)
            if check_stop():
                continue
            missing = np.flatnonzero(claims.verdict == UNKNOWN_MODE)
            if len(missing) == 0:
                break
            known = [self._listed(row) for row in claims.wanted[missing]]
            claims.verdict[missing] = np.where(known, OPEN_CLAIM, REFUSED)
            self._claims = self._made(engine, bench)
            self._claims.verdict[:] = claims.verdict
        return self._claims.verdict == PROVED

    def _listed(self, mode: Array) -> bool:
        """List the field of a mode and region; False if its rates are not determined, so that it
        has no derivatives."""
        contacts = len(self.problem.rows.u)
        try:
            self.pieces.number(mode[:contacts].astype(np.int8), mode[contacts:].astype(np.int8))
        except ZeroDivisionError:
            return False
        return True

    def _made(self, engine: Engine, bench: Bench) -> Claims:
        """Room for the claims, and the fields as they are listed by now."""
        knots = len(bench.record.time)
        n = bench.record.state.shape[1]
        rows = self.problem.rows
        listed = self.pieces.listed
        omega = engine.flow.k.omega[engine.group]
        between = make_scratch(rows, (0, 2))
        made = [piece.field for piece in self.pieces.made]
        places = places_of(self.pieces.made)
        lanes = len(self.table)
        return Claims(
            verdict=np.full(lanes, OPEN_CLAIM),
            wanted=np.zeros((lanes, len(rows.u) + len(rows.kinks)), np.int64),
            parameters=self.table,
            drives=np.max(np.abs(omega), axis=1, initial=0.0),
            origin=float(self.problem.origin),
            listed=listed,
            modes=np.array([field.mode for field in made], np.int64).reshape(len(made), -1),
            regions=np.array([field.region for field in made], np.int64).reshape(len(made), -1),
            piece=np.zeros(knots, np.int64),
            parts=np.zeros(knots, np.int64),
            outcome=np.zeros(knots, np.int64),
            event=np.zeros(MET + 1 + listed.switches.shape[1], np.int64),
            after=np.zeros((knots, n, n)),
            late=np.zeros((knots, 0)),
            work=room_for_pass(listed, places, _PARTS * STAGES * knots, (n, n), between),
            squares=np.zeros((2, n, n)),
            deviation=np.zeros((5, n)),
            followed=np.zeros((_FOLLOWED, n)),
        )
