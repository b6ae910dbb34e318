"""Outcomes of motions."""

from __future__ import annotations

from stickslip.results import Ended


class Outcome(Ended):
    """Outcome of a motion; ``message`` explains it and gives a remedy.

    The result contains the motion up to its end.
    """

    FINISHED = (0, "finished", "The motion reached the end of the time span")
    AT_REST = (
        1,
        "at rest forever",
        "No later event is possible: every contact sticks, and the remaining states converge",
    )
    NO_BOUNDED_RATE = (
        2,
        "no bounded rate",
        "The forces cannot be balanced at any finite rate: the system jumps. Add viscosity or "
        "mass to the coordinate, or reduce the load",
    )
    SLIDING_ON_A_JUMP = (
        3,
        "sliding on a jump",
        "A discontinuous piecewise function pushes the motion onto its discontinuity from both "
        "sides. Make the function continuous, or model the discontinuity as a contact",
    )
    ZENO = (
        4,
        "event accumulation",
        "Infinitely many events accumulate at this time (Zeno behaviour). Check for a contact "
        "whose threshold approaches zero",
    )
    STEP_TOO_SMALL = (
        5,
        "step too small",
        "The motion diverges or a formula is singular near this time. Check the formulas, or "
        "end the time span earlier",
    )
    EVENT_LIMIT = (
        6,
        "limit on events reached",
        "The motion has more events than max_events. Increase max_events to continue",
    )
    NEGATIVE_THRESHOLD = (
        7,
        "threshold negative",
        "A threshold became negative. Write max(..., 0) in its formula",
    )
    UNDEFINED = (
        8,
        "undefined",
        "A formula has no finite value here (log or sqrt of a negative number, asin of a value "
        "above 1, overflow). Check the formulas and parameters",
    )
    OUTSIDE_TABLE = (
        24,
        "outside of a table",
        "The argument of a table is outside its range. Extend the table, or extrapolate with "
        'outside = "constant" or "linear"',
    )
    TIME_UP = (
        23,
        "time limit reached",
        "The time limit was reached; the results so far are kept. Increase time_limit to continue",
    )
    INTERRUPTED = (9, "interrupted", "Stopped by the user; the results so far are kept")
    PERIODIC = (10, "periodic", "The motion has converged to a cycle")
    STEADY = (11, "steady", "The motion has converged to steady sliding or another equilibrium")
    NOT_SETTLED = (
        12,
        "budget spent",
        "The limits were reached before the motion repeated, and neither chaos nor drift was "
        "detected. It may be quasi-periodic, or its cycle has more events than are compared. "
        "Increase max_time, max_cycles or longest_cycle. This is also the outcome of motions whose "
        "rest cannot be proved, and of motions under a load that is not periodic",
    )
    IRREGULAR = (
        25,
        "irregular",
        "The motion has not converged, and neighbouring motions diverge: the largest Lyapunov "
        "exponent is positive. Measures are taken over its last part",
    )
    SLOW = (
        26,
        "slow",
        "The motion has not converged: it still drifts, decays or grows from one return to the "
        "next. Increase max_time or max_cycles",
    )
    UNDAMPED = (
        13,
        "undamped",
        "The motion continues without events, with an undamped oscillation that neither decays "
        "nor grows. Add damping",
    )
    NO_INERTIA = (
        16,
        "inertia not positive definite",
        "The mass matrix is not positive definite here: some rates would have zero or negative "
        "kinetic energy. Check the kinetic energy, or end the time span earlier",
    )
    NO_ACCELERATION = (
        17,
        "no admissible acceleration (Painlevé)",
        "No contact mode has accelerations that satisfy Coulomb's law with these normal forces; "
        "only an impulse could continue the motion. Reduce the coefficient of friction",
    )
    NO_MODE = (
        22,
        "no admissible mode",
        "No contact mode can continue the motion, for an unknown reason. It is not Painlevé's "
        "paradox: friction affects the normal forces too little for that. At the start of a "
        "motion or after a jump of the state, check for overlapping bodies; elsewhere, check "
        "for very stiff forces, and for a force in a plane that leaves its limit curve more slowly "
        "than the fourth power of time",
    )
    NO_COLLISION = (
        18,
        "no admissible impact",
        "No impulses were found that satisfy the impact law. Where bodies touch at more points "
        "than they have degrees of freedom, use the same restitution at all of them or zero, or "
        'set impacts = "in turn"',
    )
    CREATES_ENERGY = (
        19,
        "impact that creates energy",
        "Newton's impact law with friction would create energy here. Reduce the restitution or "
        "the coefficient of friction",
    )
    JUMPS_MEET = (
        20,
        "several jumps at once",
        "The guards of two jumps cross zero at the same time, so the order of the jumps is "
        "undefined. Declare a single jump that does both, or shift one of the guards. Write one "
        "of two sampling periods as a multiple of the other, such as 10*T",
    )
    JUMPS_ON = (
        21,
        "a jump ends in the guard of a jump",
        "The state jumped to a place where the same or another jump is triggered immediately, "
        "which may repeat indefinitely. Let the state jump to one side of the guard, or give the "
        "guard a direction",
    )
    OUTSIDE = (
        15,
        "outside the stable set",
        "The initial state violates |∂Φ| ≤ s: friction cannot hold it, so no motion starts "
        "there. Start inside the stable set; the excess is the amount by which the force is too "
        "large",
    )

    INADMISSIBLE_KINETIC = (
        14,
        "kinetic force not admissible",
        "The kinetic friction force of a contact became negative, or larger than its threshold at "
        "the onset of slip. Keep kinetic >= 0, and kinetic <= threshold at speed 0",
    )

    @property
    def ok(self) -> bool:
        """Whether the requested computation succeeded: the whole time span, or an attractor."""
        return self in (Outcome.FINISHED, Outcome.AT_REST, Outcome.PERIODIC, Outcome.STEADY)
