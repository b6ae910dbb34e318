"""Periodicity of a system: the effect of time on its formulas, from their structure alone.

Returns of a motion and of the forces on it do not exclude a load that begins much later. Therefore
the formulas must be invariant under the period, in the frame that moves with the motion: time may
occur in phases that advance uniformly, of whose periods the period is a multiple; in lines in which
time and frame cancel, as in Vt − x (:mod:`stickslip.orbits.fields.lines_and_phases`); and behind a
kink that remains in the past.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from stickslip.equations.derive import MotionEquations
from stickslip.kept import cached_property
from stickslip.numerics.levels import MAKES_UP
from stickslip.orbits.fields.lines_and_phases import Slopes, read_formulas
from stickslip.symbolic import expressions as ex

_WHOLE = 1e-9  # relative distance from an integer number of periods


@dataclass(frozen=True)
class Repetition:
    """Effect of time on a system."""

    equations: MotionEquations

    @cached_property
    def plain(self) -> bool:
        """Whether time occurs in phases of one frequency only, for all parameters."""
        known = self.equations.declaration.parameters
        found = read_formulas(self.equations.formulas, ["t"], constant=known, since=0.0)
        return len(self.equations.frequencies) <= 1 and not found.lines

    def waves(
        self, values: Mapping[str, float], frame: Mapping[str, float], time: float
    ) -> frozenset[float] | None:
        """Frequencies of the time dependence after a given time; None if time does more than
        advance phases.

        Parameters
        ----------
        values : mapping of str to float
            Parameters.
        frame : mapping of str to float
            Velocity of each state in the frame.
        """
        velocity = {"t": 1.0, **{name: v for name, v in frame.items() if v != 0.0}}
        numbers = {name: ex.num(value) for name, value in values.items()}
        try:
            formulas = [ex.substitute(e, numbers) for e in self.equations.formulas]
        except (ZeroDivisionError, OverflowError):
            return None
        found = read_formulas(formulas, velocity, since=time)
        lines = [_advance(line, velocity) for line in found.lines]
        phases = [_advance(phase, velocity) for phase in found.phases]
        if any(lines):
            return None
        return frozenset(2.0 * math.pi * abs(rate) for rate in phases if rate)


def _advance(slopes: Slopes, velocity: Mapping[str, float]) -> float:
    """Rate of a line or phase."""
    terms = [ex.number(slope) * velocity[name] for name, slope in slopes.items()]
    total = math.fsum(terms)
    return total if abs(total) > MAKES_UP * math.fsum(map(abs, terms)) else 0.0


def repeats(waves: frozenset[float] | None, period: float) -> bool:
    """Return whether a period is a multiple of the periods of all frequencies."""
    turns = [rate * period / (2.0 * math.pi) for rate in waves or ()]
    return waves is not None and all(
        round(n) > 0 and abs(n - round(n)) <= _WHOLE * n for n in turns
    )
