"""Whether a system goes on repeating itself: what time does to its formulas, from their structure
alone.

That a motion has come back, and the forces on it, too, says nothing about a load that begins a year
later. So the formulas have to be the same a period later, in the frame that moves with the motion:
time may stand in sines and cosines of a constant frequency, of which the period is a multiple; in
sums in which time and frame make up for each other, as in Vt − x; and behind a kink that lies in
the past for good.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from stickslip.equations.derive import MotionEquations
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.enclosures import bounds
from stickslip.symbolic.expressions import Expr

_MAKES_UP = 1e-9  # part of the terms of a sum that may be left of them
_WHOLE = 1e-9  # relative distance from a whole number of periods


@dataclass(frozen=True)
class Repetition:
    """What time does to a system.

    Attributes
    ----------
    equations : MotionEquations
    """

    equations: MotionEquations

    @cached_property
    def plain(self) -> bool:
        """Whether time stands in sines and cosines of one frequency only, whatever the parameters
        are."""
        walk = _Walk({}, 0.0, frozenset(self.equations.declaration.parameters))
        return len(self.equations.frequencies) <= 1 and all(
            walk.stays(e) for e in self.equations.formulas
        )

    def waves(
        self, values: Mapping[str, float], frame: Mapping[str, float], time: float
    ) -> frozenset[float] | None:
        """Frequencies of all that time does from a time on; None if that is more than sines and
        cosines.

        Parameters
        ----------
        values : mapping of str to float
            Parameters.
        frame : mapping of str to float
            Velocity of each state in the frame.
        time : float
        """
        walk = _Walk(frame, time, frozenset())
        numbers = {name: ex.num(value) for name, value in values.items()}
        try:
            if not all(walk.stays(ex.substitute(e, numbers)) for e in self.equations.formulas):
                return None
        except (ZeroDivisionError, OverflowError):
            return None
        return frozenset(abs(ex.number(rate)) for rate in walk.rates)


def repeats(waves: frozenset[float] | None, period: float) -> bool:
    """Whether frequencies fit into a period."""
    turns = [rate * period / (2.0 * math.pi) for rate in waves or ()]
    return waves is not None and all(
        round(n) > 0 and abs(n - round(n)) <= _WHOLE * n for n in turns
    )


class _Walk:
    """One look at formulas, in which the given names are constant.

    Attributes
    ----------
    rates : set of Expr
        Frequencies that were met.
    """

    def __init__(self, frame: Mapping[str, float], time: float, constant: frozenset[str]) -> None:
        self.constant = constant
        self.ranges = {"t": (time, math.inf)}
        self.velocity = {"t": 1.0, **{name: v for name, v in frame.items() if v != 0.0}}
        self.rates: set[Expr] = set()
        self.known: dict[Expr, bool] = {}

    def stays(self, e: Expr) -> bool:
        """Whether an expression is the same a period later."""
        if not e.symbols & self.velocity.keys():
            return True
        if e not in self.known:
            self.known[e] = self._stays(e)
        return self.known[e]

    def _stays(self, e: Expr) -> bool:
        if (frequency := ex.frequency(e)) is not None and self._turns(e.args[0]):
            self.rates.add(frequency)
            return True
        if e.op == "sum":
            return self._sum(e)
        if e.op == "select":
            low, high = bounds(e.args[0], self.ranges)
            if low >= 0.0 or high < 0.0:  # for good
                return self.stays(e.args[1] if low >= 0.0 else e.args[2])
        return e.op != "sym" and all(
            self.stays(part) for part in (*e.args, *(base for base, _ in e.terms))
        )

    def _turns(self, phase: Expr) -> bool:
        """Whether a phase is ωt and what stays as it is."""
        rate = ex.derivative(phase, "t")
        return (
            rate is not ex.ZERO
            and rate.symbols <= self.constant
            and self.stays(phase - rate * ex.sym("t"))
        )

    def _sum(self, e: Expr) -> bool:
        """Whether the terms of a sum that move evenly make up for each other, and the others
        stay."""
        total = size = 0.0
        for term, weight in e.terms:
            if self.stays(term):
                continue
            for name in sorted(term.symbols & self.velocity.keys()):
                slope = ex.derivative(term, name)
                if slope.op != "num" or ex.bends(term, [name]):
                    return False
                part = weight * ex.number(slope) * self.velocity[name]
                total = total + part
                size = size + abs(part)
        return abs(total) <= _MAKES_UP * size
