"""Outcomes of evolutions."""

from __future__ import annotations

from stickslip.results import Ended


class EvolutionOutcome(Ended):
    """Outcome of an evolution; ``message`` explains it and gives a remedy.

    Everything computed up to there is kept in the result.
    """

    FINISHED = (0, "finished", "The evolution reached the end of the time span")
    NOT_CONVERGED = (
        1,
        "a step did not converge",
        "The solver did not reach the KKT tolerance. Increase kkt, or check that A is well scaled",
    )
    JUMP = (
        2,
        "a jump",
        "The energy balance fails even for very short steps: the load or a threshold jumps. "
        "Make them continuous, or give the times of the steps",
    )
    UNDEFINED = (
        3,
        "undefined",
        "The load or the dissipation has no admissible value in the next step. Check their "
        "formulas",
    )
    INTERRUPTED = (
        4,
        "interrupted",
        "Stopped by the user; the results so far are kept. Use evolve(problem, times, "
        "start=result) to continue",
    )
