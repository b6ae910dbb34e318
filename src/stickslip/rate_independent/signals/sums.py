"""Sums of measured signals and a formula: loads that use measured drives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.rate_independent.signals.panels import Panels
from stickslip.rate_independent.signals.signal import Signal, Variable
from stickslip.symbolic.boxes import Chord


class WeightedSignals(Signal):
    """Σ wₖ fₖ of single values.

    Parameters
    ----------
    parts : sequence of (float, Signal)
        Weights, and signals of one value.
    shape : tuple of int
        Of one value: axes of length 1, or none.
    """

    def __init__(
        self,
        parts: Sequence[tuple[float, Signal]],
        where: str,
        clock: Variable,
        shape: tuple[int, ...] = (),
    ) -> None:
        self.parts = parts
        self.where = where
        self.clock = clock
        self.shape = shape
        self.bounded = all(part.bounded for _, part in parts)
        self.span = (
            max(part.span[0] for _, part in parts),
            min(part.span[1] for _, part in parts),
        )
        self.knots = np.unique(np.concatenate([part.knots for _, part in parts]))

    def raw(self, u: float) -> Array:
        return self.unwrapped(np.array([u]))[0]

    def unwrapped(self, places: Array) -> Array:
        total = sum(w * part.unwrapped(places).ravel() for w, part in self.parts)
        return np.reshape(total, (len(places), *self.shape))

    def entries(self, index: NDArray[np.intp], places: Array) -> Array:
        return self.unwrapped(places).ravel()

    def chord(self, low: Array, high: Array) -> Chord:
        chords = [(w, part.chord(low, high)) for w, part in self.parts]
        start = sum(w * np.ravel(chord.start) for w, chord in chords)
        end = sum(w * np.ravel(chord.end) for w, chord in chords)
        off = sum(abs(w) * np.ravel(chord.off) for w, chord in chords)
        return Chord(*(np.reshape(part, (len(low), *self.shape)) for part in (start, end, off)))

    def panels(self, span: tuple[float, float], period: float | None = None) -> Panels:
        self.check_span(*span)
        known = [(w, part.panels(span, period)) for w, part in self.parts]
        inner = [each.edges(*span) for _, each in known]
        breaks = np.unique(np.concatenate([np.array(span), *inner]))
        pieces = [(w, each.pieces(breaks[:-1], breaks[1:])) for w, each in known]
        c = np.zeros((max(len(piece) for _, piece in pieces), len(breaks) - 1))
        for w, piece in pieces:
            c[: len(piece)] += w * piece
        noise = sum(abs(w) * each.noise for w, each in known)
        samples = sum(each.samples for _, each in known)
        return Panels(breaks, c, noise, self._of_arrays, None, samples)

    def _of_arrays(self, u: Array) -> Array:
        return np.reshape(self.unwrapped(np.ravel(u)), np.shape(u))

    def plain(self) -> dict[str, Any]:
        return {"sum": [[w, part.plain()] for w, part in self.parts]}
